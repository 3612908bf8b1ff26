"""The networks of Ren et al. 2020: a generator of dances from music and noise, two discriminators, and ST-GCN.

A song is danced in one pass of any length: no initial poses, nothing that depends on the frame before. Padding never
counts: the same clip with more of it gives the same dance and the same verdicts.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn.functional import relu
from torch.nn.utils.rnn import pack_padded_sequence, pad_packed_sequence

from harmolab.body.skeletons import Skeleton, ancestors
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.training import layers
from harmolab.systems.training.about import stored_skeleton, whole
from harmolab.systems.training.motion_code import continued
from harmolab.systems.training.pose_network import EMBEDDING, resample
from harmolab.systems.training.song_to_dance import DanceInput, DancerNetwork
from harmolab.systems.training.weights import MOST_LAYERS, stored_record
from harmolab.types import FloatArray

# ST-GCN (Yan et al. 2018): convolutions over joints and over time, whose maps say how alike two dances are. Ren et al.
# compare the maps of a classifier of dances ("pose perceptual loss"). Its 16 classes are not known; here it learns what
# the pose network learns (`train_pose_net`), from the training split.

PARTITIONS = 3  # of a joint's neighbours: itself, those nearer to the root, those farther from it
TEMPORAL = 9  # frames that a convolution over time spans
# Channels of each block as multiples of the first's, and the steps in time that it makes.
WIDTHS, STRIDES = (1, 1, 1, 1, 2, 2, 2, 4, 4, 4), (1, 1, 1, 1, 2, 1, 1, 2, 1, 1)


def partitions(skeleton: Skeleton) -> Tensor:
    """(3, J, J): share of joint j's features in joint i's new ones; itself, its parent, its children.

    A joint's neighbours share evenly: each row adds up to one over the three partitions ("spatial configuration").
    """
    n_joints = len(skeleton.joints)
    shares = torch.zeros(PARTITIONS, n_joints, n_joints)
    shares[0] = torch.eye(n_joints)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            shares[1, joint, parent] = shares[2, parent, joint] = 1.0
    return shares / shares.sum(dim=(0, 2))[:, None]


class STGCN(nn.Module):
    """Ten blocks over (time, joints), their temporal rate halved at the fifth and the eighth; then an embedding.

    A clip is the joints' places in the heading frame, normalised, at `frames` moments; the root's path is left out.

    Parameters
    ----------
    skeleton : Skeleton with J joints
    channels : int, of the first block
    fps : float, hertz
        Frame rate of the motion codes it is given.
    frames : int, moments of a clip, whatever its length
    """

    def __init__(self, skeleton: Skeleton, channels: int, *, fps: float, frames: int) -> None:
        super().__init__()
        if not 0 < fps < math.inf or channels < 1 or frames < 1:
            raise ValueError(f"fps, channels and frames must be positive, got {fps}, {channels} and {frames}")
        ancestors(skeleton.parents)  # refuses bones in a circle
        self.skeleton, self.channels, self.fps, self.frames = skeleton, channels, float(fps), frames
        self.motion_scale = layers.Normaliser(3 * len(skeleton.joints) + layers.PATH_CHANNELS)
        sizes = (3, *(channels * width for width in WIDTHS))
        shares = partitions(skeleton)
        self.blocks = nn.ModuleList(
            GraphBlock(a, b, shares, stride=stride, residual=number > 0)
            for number, (a, b, stride) in enumerate(zip(sizes, sizes[1:], STRIDES, strict=False))
        )
        self.summary = nn.Linear(sizes[-1], EMBEDDING)

    def features(self, code: Tensor, mask: Tensor) -> list[Tensor]:
        """Maps (N, channels, frames, J) of the ten blocks, of motion codes (N, T, C) in standard deviations."""
        clip = resample(code[..., : -layers.PATH_CHANNELS], mask, self.frames)
        maps = [clip.unflatten(-1, (-1, 3)).permute(0, 3, 1, 2)]
        for block in self.blocks:
            maps.append(block(maps[-1]))
        return maps[1:]

    def embed(self, motion: Tensor, mask: Tensor) -> Tensor:
        """(N, 32) embeddings of motion codes (N, T, C), not normalised."""
        return self.summary(self.features(self.motion_scale(motion), mask)[-1].mean(dim=(2, 3)))

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        sizes = {"channels": self.channels, "frames": self.frames}
        return {"fps": self.fps, "skeleton": asdict(self.skeleton), **sizes}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """An ST-GCN as its description says; ValueError for sizes that cannot be."""
        channels, frames = (whole(name, build[name]) for name in ("channels", "frames"))
        return cls(stored_skeleton(build), channels, fps=float(build["fps"]), frames=frames)


class GraphBlock(nn.Module):
    """From joints to their neighbours, then over time: (N, in, T, J) -> (N, out, T / stride, J)."""

    shares: Tensor

    def __init__(self, n_in: int, n_out: int, shares: Tensor, *, stride: int, residual: bool) -> None:
        super().__init__()
        self.register_buffer("shares", shares.clone())
        self.edges = nn.Parameter(torch.ones_like(shares))
        self.spatial = nn.Conv2d(n_in, PARTITIONS * n_out, 1)
        self.spatial_norm, self.temporal_norm = layers.BatchNorm(n_out), layers.BatchNorm(n_out)
        self.temporal = nn.Conv2d(n_out, n_out, (TEMPORAL, 1), (stride, 1), padding=(TEMPORAL // 2, 0))
        self.past: nn.Module | None = None
        if residual and n_in == n_out and stride == 1:
            self.past = nn.Identity()
        elif residual:
            self.past = nn.Sequential(nn.Conv2d(n_in, n_out, 1, (stride, 1)), layers.BatchNorm(n_out))

    def forward(self, values: Tensor) -> Tensor:
        spread = self.spatial(values).unflatten(1, (PARTITIONS, -1))  # (N, 3, out, T, J)
        joined = torch.einsum("nkctj,kij->ncti", spread, self.shares * self.edges)
        new = self.temporal_norm(self.temporal(relu(self.spatial_norm(joined))))
        return relu(new if self.past is None else new + self.past(values))


class MusicEncoder(nn.Module):
    """Music (N, T, F), normalised, and its mask (N, T) -> (N, T, hidden): each frame in the light of the whole clip."""

    def __init__(self, params: RenParams, n_audio: int) -> None:
        super().__init__()
        self.front = nn.Linear(n_audio, params.hidden)
        self.encoder = nn.GRU(params.hidden, params.hidden, params.layers, batch_first=True, bidirectional=True)
        self.summary = nn.Linear(2 * params.hidden, params.hidden)

    def forward(self, audio: Tensor, mask: Tensor) -> Tensor:
        frames = torch.tanh(self.front(audio))
        # Packed: the way back begins at a clip's own last frame, not in its padding.
        packed = pack_padded_sequence(frames, mask.sum(dim=1).long().cpu(), batch_first=True, enforce_sorted=False)
        encoded, _ = pad_packed_sequence(self.encoder(packed)[0], batch_first=True, total_length=audio.shape[1])
        return self.summary(encoded)


class ResidualBlock(nn.Module):
    """Twice a linear layer, normalised over all frames of a batch and bent; added to what came in: (K, c) -> (K, c).

    In evaluation the statistics are those kept last; `settle` makes them those of all training units, so that they
    depend neither on the last batches nor on how these were shared among processes.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        parts = ((nn.Linear(channels, channels), layers.BatchNorm(channels, momentum=1.0), nn.ReLU()) for _ in range(2))
        self.layers = nn.Sequential(*(layer for part in parts for layer in part))

    def forward(self, values: Tensor) -> Tensor:
        return values + self.layers(values)


class RenGenerator(DancerNetwork):
    """Music and noise in, the motion code out, all frames of a clip at once.

    Parameters
    ----------
    params : RenParams
    n_audio, skeleton, bone_lengths, fps, features : as of `DancerNetwork`
    """

    system = "ren2020"
    params: RenParams

    def prepare(self, params: RenParams) -> None:
        """Encoders of music and noise, and the blocks that make a pose of both."""
        self.hearing = MusicEncoder(params, self.n_audio)
        self.chance = nn.GRU(params.noise, params.noise, batch_first=True)
        self.joining = nn.Linear(params.hidden + params.noise, params.body)
        self.blocks = nn.Sequential(*(ResidualBlock(params.body) for _ in range(params.blocks)))
        self.dropout = nn.Dropout(params.dropout)
        self.pose = nn.Linear(params.body, self.n_motion)

    def forward(self, audio: Tensor, mask: Tensor, noise: Tensor) -> Tensor:
        """Motion code (N, T, C) in standard deviations, for music (N, T, F) as it is, mask (N, T), noise (N, T, n).

        Padded frames are the mean pose.
        """
        music = self.hearing(self.audio_scale(audio), mask)
        real = mask > 0.5  # from here on, padding is left out of all sums: (K, channels)
        features = torch.cat([music[real], torch.tanh(self.chance(noise)[0])[real]], dim=-1)
        features = self.dropout(self.blocks(self.joining(features)))
        # Centimetres need more digits than the 8 bits of bfloat16.
        with torch.autocast(audio.device.type, enabled=False):
            return audio.new_zeros(*mask.shape, self.n_motion).index_put((real,), self.pose(features.float()))

    def noise(self, clips: int, frames: int) -> Tensor:
        """Noise (clips, frames, n) as torch's generator of random numbers has it now."""
        return self.params.noise_std * torch.randn(clips, frames, self.params.noise).to(self.bone_lengths.device)

    @torch.no_grad()
    def drawn(self, audio: Tensor, mask: Tensor, seed: int) -> Tensor:
        """As `forward`, in evaluation mode, with noise drawn by `seed`: nothing is left out."""
        was_training = self.training
        with layers.drawn_by(seed, mask.device):
            code = self.eval()(audio, mask, self.noise(*mask.shape))
        self.train(was_training)
        return code

    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance: a song in one pass, its music and one draw of noise.

        The generator knows no movement before the dance. Where `source` has one, the first moments go on from its end,
        as at the borders of every other system.
        """
        audio = torch.from_numpy(source.audio)[None].to(self.bone_lengths.device)
        scaled, scale = self.drawn(audio, audio.new_ones(audio.shape[:2]), seed)[0], self.motion_scale
        begin, past = -source.first, source.prior[: -source.first]
        dance = (scaled * scale.std + scale.mean).double().cpu().numpy()[begin : begin + source.n_frames]
        return continued(past, dance, self.fps) if len(past) else dance

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A generator as its description says; ValueError for sizes that cannot be."""
        params = stored_record(RenParams, build["params"])
        if max(params.layers, params.blocks) > MOST_LAYERS:
            raise ValueError(f"describes {params.layers} layers and {params.blocks} blocks, more than {MOST_LAYERS}")
        return cls(params, **cls.body_of(build, tensors))


@torch.no_grad()
def settle(generator: RenGenerator, audio: Tensor, mask: Tensor, *, seed: int) -> None:
    """Give batch normalisation the statistics of these clips, all at once; nothing else changes but to evaluation mode.

    Parameters
    ----------
    audio, mask : (N, T, F) music and (N, T) mask of the training units
    seed : int, of the noise
    """
    with layers.drawn_by(seed):
        generator.train()(audio, mask, generator.noise(*mask.shape))
    generator.eval()


def with_differences(code: Tensor) -> Tensor:
    """(N, T, 2 C): codes (N, T, C) beside the steps that led to them; none leads to the first."""
    return torch.cat([code, nn.functional.pad(code.diff(dim=1), (0, 0, 1, 0))], dim=-1)


class LocalDiscriminator(nn.Module):
    """Is this how people move for half a second? One logit for every window."""

    def __init__(self, params: RenParams, n_motion: int) -> None:
        super().__init__()
        self.size, self.step = params.window_frames, params.window_step_frames
        self.seeing = layers.MotionBranch(2 * n_motion, params.discriminator)
        self.verdict = nn.Linear(4 * params.discriminator, 1)

    def forward(self, code: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, W) of codes (N, T, C) in standard deviations, and (N, W), 1 for windows of real frames alone."""
        pieces, masks = windows(with_differences(code), mask, size=self.size, step=self.step)
        counted = masks.amin(dim=2)
        whole_windows = counted > 0.5
        movement = self.seeing(pieces[whole_windows].transpose(1, 2), masks[whole_windows])
        logits = self.verdict(layers.mean_over_time(*movement)).squeeze(-1)
        return torch.zeros_like(counted, dtype=logits.dtype).index_put((whole_windows,), logits), counted


def windows(values: Tensor, mask: Tensor, *, size: int, step: int) -> tuple[Tensor, Tensor]:
    """Windows (N, W, size, c) of (N, T, c), `step` frames apart, with masks (N, W, size); ValueError without."""
    if values.shape[1] < size:
        raise ValueError(f"clips of {values.shape[1]} frames are shorter than a window of {size}")
    return values.unfold(1, size, step).transpose(2, 3), mask.unfold(1, size, step)


class GlobalDiscriminator(nn.Module):
    """Does this dance belong to this music? One logit for every clip."""

    def __init__(self, params: RenParams, n_audio: int, n_motion: int) -> None:
        super().__init__()
        self.hearing = nn.Linear(n_audio, params.hidden)
        self.attending = nn.Sequential(
            nn.Linear(params.hidden, params.attention), nn.Tanh(), nn.Linear(params.attention, 1)
        )
        self.seeing = layers.MotionBranch(2 * n_motion, params.discriminator)
        size = params.hidden + 4 * params.discriminator
        self.verdict = layers.perceptron(size, size, 1)

    def music(self, audio: Tensor, mask: Tensor) -> Tensor:
        """(N, hidden): features of the music (N, T, F, normalised), their mean over time weighted by self-attention.

        Every clip is heard with its own music. (In the released code a reshaping mixed songs and moments.)
        """
        features = torch.tanh(self.hearing(audio))
        weights = self.attending(features).squeeze(-1).masked_fill(mask < 0.5, -torch.inf).softmax(dim=1)
        return (weights[..., None] * features).sum(dim=1)

    def maps(self, code: Tensor, mask: Tensor) -> list[tuple[Tensor, Tensor]]:
        """The motion branch's three maps, with their masks, of codes (N, T, C) in standard deviations."""
        return self.seeing.maps(with_differences(code).transpose(1, 2), mask)

    def judge(self, music: Tensor, last: tuple[Tensor, Tensor]) -> Tensor:
        """Logits (N,) of music (N, hidden) and the last of `maps`."""
        return self.verdict(torch.cat([music, layers.mean_over_time(*last)], dim=-1)).squeeze(-1)
