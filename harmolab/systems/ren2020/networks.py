"""The networks of Ren et al. 2020: a generator of dances from music and noise, and two discriminators.

A song is danced in one pass of any length: no initial poses, nothing that depends on the frame before. Padding never
counts: the same clip with more of it gives the same dance and the same verdicts.
"""

from collections.abc import Mapping
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pack_padded_sequence, pad_packed_sequence

from harmolab.body.skeletons import Skeleton
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.training.dancing import DanceInput, DancerNetwork
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.layers import BatchNorm, MotionBranch, drawn_by, mean_over_time, perceptron
from harmolab.systems.training.motion_code import continued
from harmolab.systems.training.weights import MOST_LAYERS, stored_record
from harmolab.types import FloatArray


class MusicEncoder(nn.Module):
    """Music (N, T, F), normalised, and its mask (N, T) -> (N, T, hidden): each frame in the light of the whole clip."""

    def __init__(self, params: RenParams, n_audio: int) -> None:
        super().__init__()
        self.front = nn.Linear(n_audio, params.hidden)
        self.encoder = nn.GRU(params.hidden, params.hidden, params.layers, batch_first=True, bidirectional=True)
        self.summary = nn.Linear(2 * params.hidden, params.hidden)

    def forward(self, audio: Tensor, mask: Tensor) -> Tensor:
        frames = torch.tanh(self.front(audio))
        lengths = mask.sum(dim=1).long().cpu()
        # Packed: the way back begins at a clip's own last frame, not in its padding.
        packed = pack_padded_sequence(frames, lengths, batch_first=True, enforce_sorted=False)
        encoded, _ = pad_packed_sequence(self.encoder(packed)[0], batch_first=True, total_length=audio.shape[1])
        return self.summary(encoded)


class ResidualBlock(nn.Module):
    """Twice a linear layer, normalised over all frames of a batch and bent; added to what came in: (K, c) -> (K, c).

    In evaluation the statistics are those kept last; `settle` makes them those of all training units, so that they
    depend neither on the last batches nor on how these were shared among processes.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        layers = ((nn.Linear(channels, channels), BatchNorm(channels, momentum=1.0), nn.ReLU()) for _ in range(2))
        self.layers = nn.Sequential(*(layer for half in layers for layer in half))

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

    def __init__(
        self, params: RenParams, n_audio: int, skeleton: Skeleton, bone_lengths: Tensor, *, fps: float,
        features: FeatureParams | None = None,
    ) -> None:  # fmt: skip
        super().__init__(params, n_audio, skeleton, bone_lengths, fps=fps, features=features)
        self.hearing = MusicEncoder(params, n_audio)
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
            code = audio.new_zeros(*mask.shape, self.n_motion)
            return code.index_put((real,), self.pose(features.float()))

    def noise(self, clips: int, frames: int) -> Tensor:
        """Noise (clips, frames, n) as torch's generator of random numbers has it now."""
        return self.params.noise_std * torch.randn(clips, frames, self.params.noise).to(self.bone_lengths.device)

    @torch.no_grad()
    def drawn(self, audio: Tensor, mask: Tensor, seed: int) -> Tensor:
        """As `forward`, in evaluation mode, with noise drawn by `seed`: nothing is left out."""
        was_training = self.training
        with drawn_by(seed, mask.device):
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
    with drawn_by(seed):
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
        self.seeing = MotionBranch(2 * n_motion, params.discriminator)
        self.verdict = nn.Linear(4 * params.discriminator, 1)

    def forward(self, code: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, W) of codes (N, T, C) in standard deviations, and (N, W), 1 for windows of real frames alone."""
        pieces, masks = windows(with_differences(code), mask, size=self.size, step=self.step)
        counted = masks.amin(dim=2)
        whole_windows = counted > 0.5
        movement = self.seeing(pieces[whole_windows].transpose(1, 2), masks[whole_windows])
        logits = self.verdict(mean_over_time(*movement)).squeeze(-1)
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
        self.seeing = MotionBranch(2 * n_motion, params.discriminator)
        size = params.hidden + 4 * params.discriminator
        self.verdict = perceptron(size, size, 1)

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
        return self.verdict(torch.cat([music, mean_over_time(*last)], dim=-1)).squeeze(-1)
