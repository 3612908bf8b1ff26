"""Dance units of Lee et al. 2019: four beats in 32 frames, beats at frames 3, 11, 19 and 27; and back to any music.

A training unit of eight beats is bent in time so that its beats lie evenly, and cut in two. A dance is composed in that
even time and bent back, so that its beats lie on the music's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.beats.visual import visual_beats
from harmolab.params import HarmonyParams
from harmolab.systems.common.motion_code import frames_at
from harmolab.systems.common.torch_code import PATH_CHANNELS
from harmolab.systems.common.units import DanceUnit, UnitSet
from harmolab.systems.lee2019.params import Beats
from harmolab.types import FloatArray, Motion

BEATS, FRAMES = 4, 32  # of a piece
FIRST, BEAT = 3, 8  # frame of its first beat, frames from beat to beat
REACH = 0.25  # of a beat: a speed valley further from a music beat is not its rest


def piece_set(units: UnitSet, *, beats: Beats, sequence: int) -> NDArray[np.float32]:
    """The pieces of all units, (N, sequence, 32, C) motion codes.

    Raises
    ------
    ValueError
        If a unit has too few beats for so many pieces.
    """
    motions = [units.decoded(unit.motion.astype(np.float64)) for unit in units.units]
    pairs = zip(units.units, motions, strict=True)
    return np.stack([unit_pieces(unit, motion, beats, sequence) for unit, motion in pairs])


def unit_pieces(unit: DanceUnit, motion: Motion, beats: Beats, sequence: int) -> NDArray[np.float32]:
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
