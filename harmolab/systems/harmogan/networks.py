"""HarmoGAN's networks: the generator (paper Sec. 4.2), its dances of any length, and the two discriminators.

All of them take the motion code of `harmolab.systems.training.motion_code` as it is, in metres and seconds, and
normalise it with the training split's mean and standard deviation, which they keep as buffers.

A dance of any length is made meter by meter, each from the end of the last (paper Sec. 4.1, Fig. 7b). For every meter
the generator is given its music and the beats before it, and as initial poses what was danced in those beats (Eq. 23).
Its output for the beats before (TI = 1) is thrown away; its meter is continued from the end of the last one. The first
meter follows a movement from the bank of poses, brought to the music's tempo.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor, nn

from harmolab.body.skeletons import Skeleton, joint_part, subtree
from harmolab.files import PathLike
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.training import layers
from harmolab.systems.training.about import whole
from harmolab.systems.training.loop import Tensors
from harmolab.systems.training.motion_code import continued
from harmolab.systems.training.pose_network import PoseNet
from harmolab.systems.training.song_to_dance import DanceInput, DancerNetwork
from harmolab.systems.training.units import UnitSet, collate, initial_poses, temporal_index
from harmolab.systems.training.weights import MOST_LAYERS, load_weights
from harmolab.types import FloatArray, Motion, SingleArray


@torch.no_grad()
def generate_units(generator: torch.nn.Module, units: UnitSet) -> list[Motion]:
    """A dance to each whole unit, from its music and the poses before the meter; one batch through the generator."""
    batch = collate(units.units)
    codes = generator.eval()(torch.from_numpy(batch.audio), torch.from_numpy(batch.initial)).motion
    pairs = zip(codes, units.units, strict=True)
    return [units.decoded(code[: unit.n_frames].double().numpy()) for code, unit in pairs]


# Parts in time that the spatial-temporal discriminator looks at (Sec. 4.2).
SEGMENTS = 5
# Seconds before and after a moment in the reach of the encoder: a dancer must know of a beat before it comes.
_HORIZON = 0.7
# Size of the last layers' first weights: an untrained generator returns the initial poses, nearly.
_FIRST_CORRECTION = 0.01


class GeneratorOutput(NamedTuple):
    """Motion code (N, T, C), and the 2-D poses (N, T, J, 2) it was lifted from.

    The 2-D poses are x and y in the heading frame, metres, before the bones get their lengths.
    """

    motion: Tensor
    flat: Tensor


class Generator(DancerNetwork):
    """HarmoGAN's generator, a network: G(A_f, V_f) = V', from music and initial poses to motion (Sec. 4.2, Fig. 7c).

    A_f(t) are the features of the music, V_f(t) the initial poses, V'(t) is the motion; all frames of a unit are made
    at once. A GRU encodes the music. The features of the initial poses are concatenated with it, and a GRU decodes both
    into poses. Skip connections concatenate the audio-visual features once more in front of every head. One head gives
    2-D poses (x, y), a second lifts them to 3-D, a third moves the root. Where the paper is silent, we took:

    * Heads give corrections to the initial poses V_f, in standard deviations, not poses. Training starts from V_f.
    * A convolution over 0.7 s around each moment precedes the encoder, so that movement can be prepared.
    * Bones are set to their reference lengths at the end (`fix_bones`).
    * No noise: other initial poses give another dance.

    Where the initial poses are a movement (`ModelParams.bounded`), corrections keep within a few centimetres of it.
    Music and initial poses that are padded with their last frame give the same motion as without padding.

    To dance with trained weights take `HarmoGAN` or `load`.

    Parameters
    ----------
    params : ModelParams
    n_audio, skeleton, bone_lengths, fps, features : as of `harmolab.systems.training.song_to_dance.DancerNetwork`
    """

    system, settings = "harmogan", "model"
    params: ModelParams

    def prepare(self, params: ModelParams) -> None:
        hidden, channels, n_joints = params.hidden, params.pose_features, len(self.skeleton.joints)
        reach = max(1, round(_HORIZON * self.fps))
        width = max(1, hidden // 4)
        self.hearing = nn.Conv1d(self.n_audio, width, 2 * reach + 1, padding=reach, padding_mode="replicate")
        self.encoder = nn.GRU(width, hidden, params.layers, batch_first=True)
        self.seeing = layers.perceptron(self.n_motion, channels, channels)
        self.decoder = nn.GRU(hidden + channels, hidden, params.layers, batch_first=True)
        joined = hidden + hidden + channels
        self.flat_head = layers.perceptron(joined, channels, 2 * n_joints, first=_FIRST_CORRECTION)
        self.depth_head = layers.perceptron(joined + 2 * n_joints, channels, n_joints, first=_FIRST_CORRECTION)
        self.path_head = layers.perceptron(joined, channels, layers.PATH_CHANNELS, first=_FIRST_CORRECTION)

    def forward(self, audio: Tensor, initial: Tensor) -> GeneratorOutput:
        """The motion to music (N, T, F) and initial poses (N, T, C), both as they are (not normalised)."""
        return self.corrected(initial, self.corrections(audio, initial))

    def corrections(self, audio: Tensor, initial: Tensor) -> Tensor:
        """The heads' numbers (N, T, C) for music and initial poses: three a joint, and three of the path."""
        music = self.hearing(self.audio_scale(audio).transpose(1, 2)).transpose(1, 2)
        encoded, _ = self.encoder(nn.functional.leaky_relu(music, layers.SLOPE))  # (N, T, hidden)
        features = torch.cat([encoded, self.seeing(self.motion_scale(initial))], dim=-1)
        decoded, _ = self.decoder(features)
        joined = torch.cat([decoded, features], dim=-1)
        flat = self.flat_head(joined)  # corrections to x and y, (N, T, 2 J)
        depth = self.depth_head(torch.cat([joined, flat], dim=-1))
        local = torch.cat([flat.unflatten(-1, (-1, 2)), depth[..., None]], dim=-1)
        return torch.cat([local.flatten(-2), self.path_head(joined)], dim=-1)

    def corrected(self, initial: Tensor, corrections: Tensor) -> GeneratorOutput:
        """Initial poses (N, T, C) with `corrections` (N, T, C), bones at their lengths; frame by frame, at any rate."""
        # Centimetres need more digits than the 8 bits of bfloat16.
        with torch.autocast(initial.device.type, enabled=False):
            raw, path = corrections.to(initial.dtype), initial[..., -layers.PATH_CHANNELS :]
            if self.params.bounded:
                joints = moved_within_bounds(layers.local_joints(initial), raw, self.skeleton)
                return GeneratorOutput(torch.cat([joints.flatten(-2), path], dim=-1), joints[..., :2])
            code = initial + raw * self.motion_scale.std
            joints = layers.local_joints(code)
            fixed = layers.fix_bones(joints, self.skeleton.parents, self.bone_lengths)
            motion = torch.cat([fixed.flatten(-2), code[..., -layers.PATH_CHANNELS :]], dim=-1)
        return GeneratorOutput(motion, joints[..., :2])

    def positions(self, motion: Tensor) -> Tensor:
        """Joints in the world, (N, T, J, 3) metres, of motion codes (N, T, C); they start at x = z = 0, heading 0."""
        return layers.decode(motion, self.fps)

    @torch.inference_mode()
    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance, meter by meter, each from the end of the movement before.

        It leaves nothing to chance: `seed` is not read.
        """
        origin, prior = source.first, source.prior
        code = np.zeros((source.meters[-1].end - origin, self.n_motion))
        code[: len(prior)] = prior
        for meter in source.progress(source.meters, "dancing"):
            begin, now, end = (frame - origin for frame in (meter.begin, meter.meter, meter.end))
            motion = self._meter(source.audio[begin:end], code[begin:end], now - begin)
            new = max(now, len(prior))
            code[new:end] = continued(code[:new], motion[new - now :], self.fps)
        return code[-origin : source.n_frames - origin]

    def _meter(self, music: SingleArray, code: FloatArray, n_prior: int) -> FloatArray:
        """Motion code of one meter, (T - n_prior, C), from its music (T, F) and the code (T, C) danced so far."""
        initial = initial_poses(code.astype(np.float32), temporal_index(len(code), n_prior))
        inputs = (torch.from_numpy(each[None]).to(self.bone_lengths.device) for each in (music, initial))
        code_of_meter: FloatArray = self(*inputs).motion[0, n_prior:].double().cpu().numpy()
        return code_of_meter

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A generator as its description says; ValueError for sizes that cannot be."""
        sizes = dict(build["model"])
        is_bounded = sizes.pop("bounded", False) is True
        model = ModelParams(**{name: whole(name, value) for name, value in sizes.items()}, bounded=is_bounded)
        if model.layers > MOST_LAYERS:
            raise ValueError(f"describes {model.layers} recurrent layers, more than {MOST_LAYERS}")
        return cls(model, **cls.body_of(build, tensors))


# Corrections of a movement: the largest that a joint, and the trunk as one piece, may be moved from it.
REACH, LIFT, BEND = 0.04, 0.04, math.radians(8.0)  # metres, metres, radians
GAIN = 10.0  # of the heads' numbers, which begin small
ARMS = ("elbow", "forearm", "lowarm", "wrist", "hand")
LEGS = ("knee", "leg", "shin", "ankle", "foot")


def moved_within_bounds(joints: Tensor, corrections: Tensor, skeleton: Skeleton) -> Tensor:
    """A movement with bounded corrections: the trunk turned and raised as one, arms and legs moved joint by joint.

    The trunk, with the arms on it, turns by 8 degrees and rises by 4 cm at most, limb joints move by 4 cm at most; a
    correction r is ``r / sqrt(1 + |r|^2)`` of that. Every bone keeps the length that it has in the movement.

    Parameters
    ----------
    joints : (N, T, J, 3) tensor, metres, in the dancer's heading
    corrections : (N, T, 3 J + 3) tensor: of each joint, the root's being the rise, and a vector of rotation
    skeleton : Skeleton; joints that are called none of an arm or a leg are trunk

    Returns
    -------
    (N, T, J, 3) tensor
    """
    root = skeleton.parents.index(-1)
    arms, legs = (joints.new_tensor(_below(skeleton, parts))[:, None] for parts in (ARMS, LEGS))
    raw = GAIN * corrections
    moves, bend = layers.local_joints(raw), _squashed(raw[..., -layers.PATH_CHANNELS :]) * BEND
    rise = _squashed(moves[..., root, :])[..., None, 1:2] * LIFT * joints.new_tensor([0.0, 1.0, 0.0])
    pivot = joints[..., root : root + 1, :]
    trunk = pivot + _rotated(joints - pivot, bend[..., None, :]) + rise
    carried = torch.where(legs > 0, joints, trunk) + (arms + legs) * REACH * _squashed(moves)
    return layers.fix_bones(carried, skeleton.parents, layers.bones(joints, skeleton.parents).norm(dim=-1))


@cache
def _below(skeleton: Skeleton, parts: tuple[str, ...]) -> list[float]:
    """1 for each joint that is called one of some parts of a limb, or hangs on one; else 0."""
    limb = {joint for joint, name in enumerate(skeleton.joints) if joint_part(name) in parts}
    below = {below for joint in limb for below in subtree(skeleton.parents, joint)}
    return [float(joint in below) for joint in range(len(skeleton.joints))]


def _squashed(vectors: Tensor) -> Tensor:
    """Vectors (..., 3) shortened to less than 1, in their direction."""
    return vectors * torch.rsqrt(1 + vectors.square().sum(dim=-1, keepdim=True))


def _rotated(vectors: Tensor, turn: Tensor) -> Tensor:
    """Vectors (..., 3) rotated about `turn` (..., 3) by its length, radians (Rodrigues)."""
    angle = torch.sqrt(turn.square().sum(dim=-1, keepdim=True) + 1e-12)
    axis = (turn / angle).expand_as(vectors)
    across = torch.linalg.cross(axis, vectors, dim=-1)
    return vectors + angle.sin() * across + (1 - angle.cos()) * torch.linalg.cross(axis, across, dim=-1)


def load_generator(path: PathLike) -> Generator:
    """The generator stored at `path`; errors as of `harmolab.systems.training.weights.load_weights`."""
    return load_weights(path, Generator)


class CrossDomainDiscriminator(layers.Normalised):
    """D_cd: does this motion belong to this music? Two branches, features concatenated, one logit per clip (Sec. 4.2).

    The features are concatenated moment by moment, so that agreement in time is an input.
    """

    def __init__(self, params: ModelParams, n_audio: int, skeleton: Skeleton) -> None:
        super().__init__()
        n_motion = 3 * len(skeleton.joints) + layers.PATH_CHANNELS
        self.audio_scale, self.motion_scale = layers.Normaliser(n_audio), layers.Normaliser(n_motion)
        self.hearing = layers.MotionBranch(n_audio, params.discriminator)
        self.seeing = layers.MotionBranch(n_motion, params.discriminator)
        self.both = layers.MaskedConvolution(8 * params.discriminator, 4 * params.discriminator, stride=2)
        self.verdict = layers.perceptron(4 * params.discriminator, 2 * params.discriminator, 1)

    def forward(self, audio: Tensor, motion: Tensor, mask: Tensor) -> Tensor:
        """Logits (N,), high for a true pair: audio (N, T, F), motion code (N, T, C), mask (N, T) of ones where real."""
        music, _ = self.hearing(self.audio_scale(audio).transpose(1, 2), mask)
        movement, reduced = self.seeing(self.motion_scale(motion).transpose(1, 2), mask)
        both, reduced = self.both(torch.cat([music, movement], dim=1), reduced)
        return self.verdict(layers.mean_over_time(both, reduced)).squeeze(-1)


class SpatialTemporalDiscriminator(layers.Normalised):
    """D_st: is this how people move? Five even segments, their features concatenated one after the other (Sec. 4.2).

    Segment k's features are joined to those of segments 1 to k - 1. Every clip is cut by its own length.
    """

    def __init__(self, params: ModelParams, skeleton: Skeleton) -> None:
        super().__init__()
        n_motion, size = 3 * len(skeleton.joints) + layers.PATH_CHANNELS, 4 * params.discriminator
        self.motion_scale = layers.Normaliser(n_motion)
        self.seeing = layers.MotionBranch(n_motion, params.discriminator)
        self.joining = nn.ModuleList(nn.Linear(2 * size, size) for _ in range(SEGMENTS - 1))
        self.verdict = layers.perceptron(size, 2 * params.discriminator, 1)

    def forward(self, motion: Tensor, mask: Tensor) -> Tensor:
        """Logits (N,), high for recorded motion: motion code (N, T, C), mask (N, T) of ones where real."""
        pieces, masks = segments(self.motion_scale(motion), mask)  # (N, 5, W, C), (N, 5, W)
        movement, reduced = self.seeing(pieces.flatten(0, 1).transpose(1, 2), masks.flatten(0, 1))
        features = layers.mean_over_time(movement, reduced).unflatten(0, (-1, SEGMENTS))  # (N, 5, size)
        joined = features[:, 0]
        for step, join in enumerate(self.joining, start=1):
            joined = nn.functional.leaky_relu(join(torch.cat([joined, features[:, step]], dim=-1)), 0.2)
        return self.verdict(joined).squeeze(-1)


def segments(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """(N, 5, W, C) and mask (N, 5, W): the real frames of (N, T, C) in five segments, even to a frame, of W at most."""
    lengths = mask.sum(dim=1).round().long()  # real frames come first
    borders = torch.arange(SEGMENTS + 1, device=values.device) * lengths[:, None] // SEGMENTS  # (N, 6)
    width = -(-values.shape[1] // SEGMENTS)
    frames = borders[:, :-1, None] + torch.arange(width, device=values.device)  # (N, 5, W)
    inside = (frames < borders[:, 1:, None]).to(values.dtype)
    rows = torch.arange(len(values), device=values.device)[:, None, None]
    return values[rows, frames.clamp(max=values.shape[1] - 1)], inside


@dataclass(frozen=True, eq=False)
class Networks:
    """The trained networks, and the pose network of the feature loss, which is not trained."""

    generator: Generator
    cross_domain: CrossDomainDiscriminator
    spatial_temporal: SpatialTemporalDiscriminator
    pose_net: PoseNet

    @classmethod
    def fresh(cls, units: UnitSet, train: Tensors, model: ModelParams, pose_net: PoseNet, seed: int) -> Self:
        """Fresh networks that know the training split's statistics; the same for the same seed."""
        n_audio, skeleton = units.features.n_audio, units.skeleton
        lengths = torch.as_tensor(units.bone_lengths, dtype=torch.float32)
        with layers.drawn_by(seed):
            generator = Generator(model, n_audio, skeleton, lengths, fps=units.features.fps, features=units.features)
            cross = CrossDomainDiscriminator(model, n_audio, skeleton)
            temporal = SpatialTemporalDiscriminator(model, skeleton)
        statistics = layers.Statistics.of(train.audio, train.motion, train.mask)
        for part in (generator, cross, temporal):
            part.set_statistics(statistics)
        return cls(generator, cross, temporal, pose_net)

    def modules(self) -> dict[str, nn.Module]:
        """The trained networks by name."""
        return {name: getattr(self, name) for name in ("generator", "cross_domain", "spatial_temporal")}

    def discriminators(self, params: TrainParams) -> list[dict[str, Any]]:
        """Parameters of the discriminators that the generator's loss has a part for, and the share of their rate."""
        parameters = [*self.spatial_temporal.parameters()]
        if params.cross_domain_weight:
            parameters = [*self.cross_domain.parameters(), *parameters]
        return [{"params": parameters, "share": params.critic_share}]
