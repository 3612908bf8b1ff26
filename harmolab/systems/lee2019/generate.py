"""A dance unit by unit from the style of a song, brought to its beats: the composer and the warper of Lee et al. 2019.

The music acts twice only: as one vector, the style of the whole song, and through its beats. The warper here is what
the released one means to be: the pose of canonical beat j comes to lie on the j-th music beat, linear in between.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from harmolab.systems.common.borders import continued
from harmolab.systems.common.dancing import DanceInput
from harmolab.systems.common.layers import Normaliser
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.parts import DanceDecoder, MusicStyle, PoseCoder, StyleCoder, UnitDecoder
from harmolab.systems.lee2019.pieces import BEAT, FIRST, FRAMES, canonical, laid_on_beats, line
from harmolab.types import FloatArray

EDGE = 1e-9  # frames: rounding


class Composer(Protocol):
    """The networks that a dance needs (`networks.DancingToMusic`)."""

    params: LeeParams
    fps: float
    n_motion: int
    bone_lengths: Tensor
    audio_scale: Normaliser
    poses: PoseCoder
    unit_decoder: UnitDecoder
    dance_decoder: DanceDecoder
    music: MusicStyle
    style_coder: StyleCoder

    def standardised(self, code: Tensor) -> Tensor:
        """Motion codes (..., C) as the networks take them."""

    def motion(self, poses: Tensor) -> Tensor:
        """Motion codes (..., C) of poses (..., C) out of a network, the root back at x = z = 0."""


class Dance(NamedTuple):
    """A dance, and how its sequences of units were drawn.

    Parameters
    ----------
    code : (n_frames, C) array, the motion code
    sequences : int, sequences of units that share noise
    redraws : int, how often a sequence was still and was drawn again
    """

    code: FloatArray
    sequences: int
    redraws: int


def danced_units(network: Composer, music: DanceInput, seed: int) -> Dance:
    """The dance to what was heard, from the end of the movement before it; `seed` draws noise and codes."""
    start = music.first + len(music.prior)  # frame of the dance, 0 or before it
    beats = beats_from(music.beats, start)
    frames = np.arange(start, music.n_frames, dtype=np.float64)
    last = float(line(frames[-1], beats, canonical(len(beats), first=-1)))
    composed = composed_units(network, music, int(np.ceil((last + 1) / FRAMES)), seed)
    code = laid_on_beats(composed.code, beats, frames, first=-1)
    code = continued(music.prior, code, network.fps, fade=network.params.fade)
    return composed._replace(code=code[-start:])


def beats_from(beats: FloatArray, start: float) -> FloatArray:
    """The beats (frames) that a dance from frame `start` on is laid on; canonical beat 0 lies on the second of them.

    That is the last beat whose unit, which begins three eighths of a beat earlier, does not begin after `start`.

    >>> beats_from(np.array([-10.0, 0.0, 10.0, 20.0]), 7.0)
    array([ 0., 10., 20.])
    """
    begins = beats[1:] - FIRST / BEAT * np.diff(beats)
    return beats[max(int(np.searchsorted(begins, start + EDGE, side="right")) - 1, 0) :]


@torch.inference_mode()
def composed_units(network: Composer, music: DanceInput, n_units: int, seed: int) -> Dance:
    """So many units one after the other in canonical time, three to each draw of noise: code (32 n_units, C)."""
    generator = torch.Generator().manual_seed(seed)
    device, params = network.bone_lengths.device, network.params
    song = torch.from_numpy(music.song()[None]).to(device)
    style = network.music(network.audio_scale(song), torch.ones(song.shape[:2], device=device))
    last = network.standardised(torch.from_numpy(music.prior[-1:]).float().to(device))
    code, redraws = np.zeros((0, network.n_motion)), 0
    starts = range(0, n_units, params.noise_units)
    for _ in music.progress(starts, "dancing"):
        units, again = moving_sequence(network, style, last, generator)
        redraws += again
        for unit in network.motion(units).double().cpu().numpy():
            code = np.concatenate([code, continued(code, unit, network.fps, fade=params.fade) if len(code) else unit])
        last = last_pose(network, units[-1:])
    return Dance(code[: n_units * FRAMES], len(starts), redraws)


def moving_sequence(network: Composer, style: Tensor, last: Tensor, generator: torch.Generator) -> tuple[Tensor, int]:
    """Poses (3, 32, C) of units that share noise, from the pose `last` (1, C) on; and how often they were drawn again.

    They are drawn again while a number of them moves less than `LeeParams.still` from frame to frame on average.
    """
    params = network.params
    units, again = drawn_sequence(network, style, last, generator), 0
    while again < params.redraws and float(units.diff(dim=1).abs().mean()) < params.still:
        units, again = drawn_sequence(network, style, last, generator), again + 1
    return units, again


def drawn_sequence(network: Composer, style: Tensor, last: Tensor, generator: torch.Generator) -> Tensor:
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


def last_pose(network: Composer, poses: Tensor) -> Tensor:
    """The last pose (N, C) of units (N, 32, C), the root back at x = z = 0."""
    return network.standardised(network.motion(poses[:, -1]))
