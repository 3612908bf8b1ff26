"""The networks of Lee et al. 2019, the dance units that they code, and dances composed and warped to music's beats.

Dance units are four beats in 32 frames, beats at frames 3, 11, 19 and 27. A training unit of eight beats is bent in
time so that its beats lie evenly, and cut in two. A dance is composed in that even time and bent back, so that its
beats lie on the music's.

The networks are a coder of dance units, a composer of their codes, a style of music, two critics. Poses go through them
as numbers of the motion code in standard deviations of the training split, all joints measured from the root, whose own
x and y then say where the whole body is: so a unit can be shifted.

The music acts twice only: as one vector, the style of the whole song, and through its beats. The warper here is what
the released one means to be: the pose of canonical beat j comes to lie on the j-th music beat, linear in between.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.params import HarmonyParams
from harmolab.systems.lee2019.params import Beats, LeeParams
from harmolab.systems.training.about import stored_list, stored_skeleton
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.layers import PATH_CHANNELS, Normaliser, local_joints, parameter_count
from harmolab.systems.training.motion_code import continued, frames_at
from harmolab.systems.training.song_to_dance import DanceInput, DancerNetwork
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.systems.training.weights import stored_record
from harmolab.types import FloatArray, Motion, SingleArray

# Dance units: four beats in 32 frames, and back to any music

BEATS, FRAMES = 4, 32  # of a piece
FIRST, BEAT = 3, 8  # frame of its first beat, frames from beat to beat
REACH = 0.25  # of a beat: a speed valley further from a music beat is not its rest


def piece_set(units: UnitSet, *, beats: Beats, sequence: int) -> SingleArray:
    """The pieces of all units, (N, sequence, 32, C) motion codes.

    Raises
    ------
    ValueError
        If a unit has too few beats for so many pieces.
    """
    motions = [units.decoded(unit.motion.astype(np.float64)) for unit in units.units]
    pairs = zip(units.units, motions, strict=True)
    return np.stack([unit_pieces(unit, motion, beats, sequence) for unit, motion in pairs])


def unit_pieces(unit: DanceUnit, motion: Motion, beats: Beats, sequence: int) -> SingleArray:
    """The first `sequence` pieces of a unit one after the other, (sequence, 32, C).

    The first piece begins three eighths of a beat before the unit. There its first frames are mirrored in time and
    place, so that the movement goes on at its speed.

    Parameters
    ----------
    unit : DanceUnit
    motion : Motion that its code stands for
    beats : "kinematic" or "music" (`LeeParams.beats`)
    sequence : int
    """
    count = BEATS * sequence
    if len(unit.beats) < count:
        raise ValueError(f"{unit.name}: {sequence} pieces need {count} beats, this unit has {len(unit.beats)}")
    times = rest_times(unit.beats, motion)[:count] if beats == "kinematic" else unit.beats[:count]
    places = line(np.arange(FRAMES * sequence), canonical(count), times * unit.fps)
    return bent(unit.motion, places).reshape(sequence, FRAMES, -1).astype(np.float32)


def rest_times(beats: FloatArray, motion: Motion) -> FloatArray:
    """Music beats (B,), each moved to the nearest speed valley within a quarter of the shorter interval beside it."""
    valleys = visual_beats(motion, params=HarmonyParams.valleys()).times
    if not len(valleys) or len(beats) < 2:
        return beats
    nearest = valleys[np.abs(valleys[None] - beats[:, None]).argmin(axis=1)]
    intervals = np.diff(beats)
    period = np.minimum(np.append(intervals, np.inf), np.append(np.inf, intervals))
    return np.where(np.abs(nearest - beats) <= REACH * period, nearest, beats)


def canonical(count: int, first: int = 0) -> FloatArray:
    """Frames of canonical beats `first`, `first` + 1, ...: 3, 11, 19 ... from beat 0 on."""
    return FIRST + BEAT * (first + np.arange(count, dtype=np.float64))


def laid_on_beats(code: FloatArray, beats: FloatArray, frames: FloatArray, *, first: int = 0) -> FloatArray:
    """A code in canonical time (T, C) danced to music: its pose at frame t is that at `line(t, beats, 3 + 8 j)`.

    Parameters
    ----------
    code : (T, C) array
    beats : (B,) array, frames of the dance at which music beats lie, between frames too; increasing
    frames : (T',) array, consecutive frames of the dance
    first : int, canonical number of the first of `beats`

    Returns
    -------
    (T', C) array; rates of the path are scaled by the local speed
    """
    return bent(code, line(np.asarray(frames, dtype=np.float64), beats, canonical(len(beats), first)))


def line(values: ArrayLike, knots: FloatArray, targets: FloatArray) -> FloatArray:
    """Values mapped by the line through (knots, targets), which goes on straight beyond the outer ones."""
    values = np.asarray(values, dtype=np.float64)
    slopes = np.diff(targets) / np.diff(knots)
    early, late = np.minimum(values - knots[0], 0.0), np.maximum(values - knots[-1], 0.0)
    return np.interp(values, knots, targets) + slopes[0] * early + slopes[-1] * late


def bent(code: ArrayLike, places: FloatArray) -> FloatArray:
    """A motion code (T, C) at frame numbers (K,) that may lie between frames: (K, C).

    Joints are interpolated linearly. Rates are the way of the path from number to number, so that none of it is lost.
    Before frame 0 the code is mirrored: places through frame 0, so that velocity goes on. After its last frame the
    last one holds.
    """
    code = np.asarray(code, dtype=np.float64)
    early = min(max(0, int(np.ceil(-places.min()))), len(code) - 1)
    mirrored = 2 * code[0] - code[early:0:-1]
    steps = np.arange(early + 1, 1, -1).clip(max=len(code) - 1)  # the mirrored step to -m is that from m to m + 1
    mirrored[:, -PATH_CHANNELS:] = code[steps, -PATH_CHANNELS:]
    whole = np.concatenate([mirrored, code])
    way = np.cumsum(whole[:, -PATH_CHANNELS:], axis=0)
    places = np.clip(places + early, 0, len(whole) - 1)
    values, rates = frames_at(whole, places), np.diff(frames_at(way, places), axis=0)
    if len(rates):
        values[:, -PATH_CHANNELS:] = np.concatenate([rates[:1], rates])  # those of the first frame repeat the second's
    return values


# Networks: coders and decoders of poses, units and dances; style of music; critics

SLOPE = 0.2  # of the bends


class Code(NamedTuple):
    """A normal distribution over codes: mean and logarithm of the variance, both (..., size)."""

    mean: Tensor
    logvar: Tensor

    def drawn(self, generator: torch.Generator) -> Tensor:
        """A code drawn from it, (..., size); on every device the same."""
        noise = torch.randn(self.mean.shape, generator=generator).to(self.mean)
        return self.mean + torch.exp(0.5 * self.logvar) * noise

    @property
    def both(self) -> Tensor:
        """Mean and logarithm of the variance side by side, (..., 2 size)."""
        return torch.cat(self, dim=-1)


class Heads(nn.Module):
    """Two linear layers: values (..., n_in) to the `Code` of `size` numbers."""

    def __init__(self, n_in: int, size: int) -> None:
        super().__init__()
        self.mean, self.logvar = nn.Linear(n_in, size), nn.Linear(n_in, size)

    def forward(self, values: Tensor) -> Code:
        return Code(self.mean(values), self.logvar(values))


def layers(sizes: Sequence[int]) -> nn.Sequential:
    """Linear layers of these sizes, each followed by LayerNorm and a bend."""
    steps = (nn.Sequential(nn.Linear(a, b), nn.LayerNorm(b), nn.LeakyReLU(SLOPE)) for a, b in pairwise(sizes))
    return nn.Sequential(*steps)


class PoseCoder(nn.Module):
    """A pose (..., C) to the code of z_init, and z_init back to a pose."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        hidden, size = params.pose_hidden, params.pose_latent
        self.inwards, self.heads = layers((n_motion, hidden, hidden)), Heads(hidden, size)
        self.outwards, self.pose = layers((size, hidden, hidden)), nn.Linear(hidden, n_motion)

    def forward(self, pose: Tensor) -> Code:
        return self.heads(self.inwards(pose))

    def decoded(self, z_init: Tensor) -> Tensor:
        """The pose (..., C) that z_init stands for."""
        return self.pose(self.outwards(z_init))


class MovementCoder(nn.Module):
    """Poses of a unit (N, 32, C) to the code of z_move: a GRU in both directions from a learnt state."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        self.first = nn.Parameter(torch.zeros(2, 1, params.hidden))
        self.reader = nn.GRU(n_motion, params.hidden, batch_first=True, bidirectional=True)
        self.heads = Heads(2 * params.hidden, params.latent)

    def forward(self, poses: Tensor) -> Code:
        _, last = self.reader(poses, self.first.expand(-1, len(poses), -1).contiguous())
        return self.heads(torch.cat([last[0], last[1]], dim=-1))


class Unrolled(nn.Module):
    """A GRU that is fed the same value at every step, and what follows it at each: (N, n_in) to (N, steps, hidden)."""

    def __init__(self, n_first: int, n_in: int, hidden: int) -> None:
        super().__init__()
        self.first, self.cell = nn.Linear(n_first, hidden), nn.GRUCell(n_in, hidden)
        self.after = nn.Sequential(nn.Linear(hidden, hidden), nn.LayerNorm(hidden), nn.ReLU())

    def forward(self, first: Tensor, value: Tensor, steps: int) -> Tensor:
        cell, state, states = self.cell, self.first(first), []
        # What is fed does not change, so its product is taken once: half as long again as torch's GRU would take.
        from_value = nn.functional.linear(value, cell.weight_ih, cell.bias_ih)
        gates, candidate = from_value.split([2 * cell.hidden_size, cell.hidden_size], dim=1)
        for _ in range(steps):
            from_state = nn.functional.linear(state, cell.weight_hh, cell.bias_hh)
            reset, update = torch.sigmoid(gates + from_state[:, : 2 * cell.hidden_size]).chunk(2, dim=1)
            new = torch.tanh(torch.addcmul(candidate, reset, from_state[:, 2 * cell.hidden_size :]))
            state = torch.lerp(new, state, update)
            states.append(state)
        return self.after(torch.stack(states, dim=1))


class UnitDecoder(nn.Module):
    """z_init (N, 10) and z_move (N, Z) to the poses of a unit, (N, 32, C)."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        self.unrolled = Unrolled(params.pose_latent + params.latent, params.latent, params.hidden)
        self.pose = nn.Linear(params.hidden, n_motion)

    def forward(self, z_init: Tensor, z_move: Tensor) -> Tensor:
        return self.pose(self.unrolled(torch.cat([z_init, z_move], dim=-1), z_move, FRAMES))


class DanceCoder(nn.Module):
    """Codes of the units of a dance, (N, S, Z) each, to the code of z_dance (N, Z)."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        self.reader = nn.GRU(2 * params.latent, params.hidden, batch_first=True)
        self.heads = Heads(params.hidden, params.latent)

    def forward(self, units: Code) -> Code:
        _, last = self.reader(units.both)
        return self.heads(last[0])


class DanceDecoder(nn.Module):
    """z_dance (N, Z) to the codes of so many units, (N, S, Z) each."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        self.unrolled = Unrolled(params.latent, params.latent, params.hidden)
        self.heads = Heads(params.hidden, params.latent)

    def forward(self, z_dance: Tensor, units: int) -> Code:
        return self.heads(self.unrolled(z_dance, z_dance, units))


class MusicStyle(nn.Module):
    """A classifier of music by its dance; the last state of its GRU is the style."""

    def __init__(self, params: LeeParams, n_audio: int, n_dances: int) -> None:
        super().__init__()
        self.listening = nn.GRU(n_audio, params.style, batch_first=True)
        self.verdict = nn.Linear(params.style, n_dances)

    def forward(self, audio: Tensor, mask: Tensor) -> Tensor:
        """The style (N, 30) of standardised audio (N, T, F), at the last frame whose mask (N, T) is 1."""
        states, _ = self.listening(audio)
        last = mask.sum(dim=1).long() - 1
        return states[torch.arange(len(audio), device=audio.device), last]


class StyleCoder(nn.Module):
    """Style (N, 30) and noise (N, 30) to the code of z_dance (N, Z)."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        sizes = (params.style + params.noise, *params.style_layers)
        self.inwards, self.heads = layers(sizes), Heads(sizes[-1], params.latent)

    def forward(self, style: Tensor, noise: Tensor) -> Code:
        return self.heads(self.inwards(torch.cat([style, noise], dim=-1)))


class Critic(nn.Module):
    """Logits (N,), high for codes of recorded dances, of codes (N, n_code) and the mean audio (N, F) beside them."""

    def __init__(self, params: LeeParams, n_code: int, n_audio: int) -> None:
        super().__init__()
        size = params.critic_layers[-1]
        self.seeing = layers((n_code, *params.critic_layers))
        self.hearing = layers((n_audio, size, size))
        self.verdict = nn.Linear(2 * size, 1)

    def forward(self, code: Tensor, audio: Tensor) -> Tensor:
        logits: Tensor = self.verdict(torch.cat([self.seeing(code), self.hearing(audio)], dim=-1))
        return logits.squeeze(-1)


class DancingToMusic(DancerNetwork):
    """All networks of Lee et al. 2019: those that dance, and those that taught them.

    Parameters
    ----------
    params : LeeParams
    skeleton : Skeleton with J joints
    bone_lengths : (J,) tensor, metres, 0 at roots
    features : FeatureParams of the audio features
    dances : names of the dances that the style of music tells apart; "" is one of them where it was not known
    """

    system = "lee2019"
    params: LeeParams
    features: FeatureParams

    def __init__(
        self, params: LeeParams, skeleton: Skeleton, bone_lengths: Tensor, *, features: FeatureParams,
        dances: Sequence[str],
    ) -> None:  # fmt: skip
        super().__init__(params, features.n_audio, skeleton, bone_lengths, fps=features.fps, features=features)
        self.dances, self.pose_scale = tuple(dances), Normaliser(self.n_motion)
        self.root = skeleton.parents.index(-1) if -1 in skeleton.parents else 0
        self.poses, self.movements = PoseCoder(params, self.n_motion), MovementCoder(params, self.n_motion)
        self.unit_decoder = UnitDecoder(params, self.n_motion)
        self.dance_coder, self.dance_decoder = DanceCoder(params), DanceDecoder(params)
        self.music = MusicStyle(params, features.n_audio, len(self.dances))
        self.style_coder = StyleCoder(params)
        self.unit_critic = Critic(params, 2 * params.latent * params.sequence, features.n_audio)
        self.dance_critic = Critic(params, 2 * params.latent, features.n_audio)
        inner = layers((params.latent, *params.regressor_layers))
        self.regressor = nn.Sequential(inner, nn.Linear(params.regressor_layers[-1], params.style))

    def standardised(self, code: Tensor) -> Tensor:
        """Motion codes (..., C) as the networks take them."""
        return self.pose_scale(from_root(code, self.root))

    def motion(self, poses: Tensor) -> Tensor:
        """Motion codes (..., C) of poses (..., C) out of a network, the root back at x = z = 0."""
        code = from_root(self.pose_scale.mean + self.pose_scale.std * poses, self.root, backwards=True)
        joints = local_joints(code)
        place = joints[..., self.root, :] if self.skeleton.bones else joints.mean(dim=-2)
        joints = joints - place[..., None, :] * place.new_tensor([1.0, 0.0, 1.0])
        return torch.cat([joints.flatten(-2), code[..., -PATH_CHANNELS:]], dim=-1)

    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance; `seed` draws noise and codes.

        It goes on from the end of the movement before it, and units are laid on the beats from there on.
        """
        start = source.first + len(source.prior)  # frame of the dance, 0 or before it
        beats = beats_from(source.beats, start)
        frames = np.arange(start, source.n_frames, dtype=np.float64)
        last = float(line(frames[-1], beats, canonical(len(beats), first=-1)))
        composed = composed_units(self, source, int(np.ceil((last + 1) / FRAMES)), seed)
        code = laid_on_beats(composed, beats, frames, first=-1)
        return continued(source.prior, code, self.fps, fade=self.params.fade)[-start:]

    def parameter_count(self) -> int:
        """Number of values that training changes and dancing needs."""
        parts = (self.poses, self.unit_decoder, self.dance_decoder, self.music, self.style_coder)
        return sum(parameter_count(part) for part in parts)

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        records = {name: asdict(getattr(self, name)) for name in ("params", "features", "skeleton")}
        return {**records, "dances": list(self.dances)}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """The networks as their description says; ValueError for sizes that cannot be."""
        params, features = stored_record(LeeParams, build["params"]), FeatureParams(**build["features"])
        dances, lengths = [str(dance) for dance in stored_list(build, "dances")], tensors["bone_lengths"]
        return cls(params, stored_skeleton(build), lengths, features=features, dances=dances)


def from_root(code: Tensor, root: int, *, backwards: bool = False) -> Tensor:
    """Motion codes (..., C) with the x and y of all joints but the root measured from the root's; or backwards."""
    offset = torch.zeros_like(code)
    shape = code.shape[-1] - PATH_CHANNELS
    for axis in (0, 1):
        offset[..., axis:shape:3] = code[..., 3 * root + axis, None]
        offset[..., 3 * root + axis] = 0.0
    return code + offset if backwards else code - offset


# Composer and warper: a dance from the style of a song, brought to its beats

EDGE = 1e-9  # frames: rounding


def beats_from(beats: FloatArray, start: float) -> FloatArray:
    """The beats (frames) that a dance from frame `start` on is laid on; canonical beat 0 lies on the second of them.

    That is the last beat whose unit, which begins three eighths of a beat earlier, does not begin after `start`.

    >>> beats_from(np.array([-10.0, 0.0, 10.0, 20.0]), 7.0)
    array([ 0., 10., 20.])
    """
    begins = beats[1:] - FIRST / BEAT * np.diff(beats)
    return beats[max(int(np.searchsorted(begins, start + EDGE, side="right")) - 1, 0) :]


@torch.inference_mode()
def composed_units(network: DancingToMusic, music: DanceInput, n_units: int, seed: int) -> FloatArray:
    """So many units one after the other in canonical time, three to each draw of noise: code (32 n_units, C)."""
    generator = torch.Generator().manual_seed(seed)
    device, params = network.bone_lengths.device, network.params
    song = torch.from_numpy(music.song()[None]).to(device)
    style = network.music(network.audio_scale(song), torch.ones(song.shape[:2], device=device))
    last = network.standardised(torch.from_numpy(music.prior[-1:]).float().to(device))
    code = np.zeros((0, network.n_motion))
    for _ in music.progress(range(0, n_units, params.noise_units), "dancing"):
        units = moving_sequence(network, style, last, generator)
        for unit in network.motion(units).double().cpu().numpy():
            code = np.concatenate([code, continued(code, unit, network.fps, fade=params.fade) if len(code) else unit])
        last = last_pose(network, units[-1:])
    return code[: n_units * FRAMES]


def moving_sequence(network: DancingToMusic, style: Tensor, last: Tensor, generator: torch.Generator) -> Tensor:
    """Poses (3, 32, C) of units that share noise, from the pose `last` (1, C) on.

    They are drawn again while a number of them moves less than `LeeParams.still` from frame to frame on average.
    """
    units = drawn_sequence(network, style, last, generator)
    for _ in range(network.params.redraws):
        if float(units.diff(dim=1).abs().mean()) >= network.params.still:
            break
        units = drawn_sequence(network, style, last, generator)
    return units


def drawn_sequence(network: DancingToMusic, style: Tensor, last: Tensor, generator: torch.Generator) -> Tensor:
    """Poses (3, 32, C) of units drawn with one noise, each from the last pose of the one before."""
    params = network.params
    noise = torch.randn(1, params.noise, generator=generator).to(style)
    z_dance = network.style_coder(style, noise).drawn(generator)
    z_moves = network.dance_decoder(z_dance, params.noise_units).drawn(generator)
    units = []
    for z_move in z_moves.unbind(dim=1):
        units.append(network.unit_decoder(network.poses(last).mean, z_move))
        last = last_pose(network, units[-1])
    return torch.cat(units)


def last_pose(network: DancingToMusic, poses: Tensor) -> Tensor:
    """The last pose (N, C) of units (N, 32, C), the root back at x = z = 0."""
    return network.standardised(network.motion(poses[:, -1]))
