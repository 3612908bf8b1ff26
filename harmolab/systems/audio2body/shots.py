"""Camera shots of a recording: between two of them the trunk and most points jump at once and stay (reading 10)."""

from __future__ import annotations

import itertools

import numpy as np

from harmolab.io.player_points import SIDES
from harmolab.types import BoolArray, FloatArray, IntArray, Motion

TRUNK = tuple(f"{side}_{part}" for part in ("shoulder", "hip") for side in SIDES)
RESTS = 0.25  # of the way from one place to the other: who sways is half way between two places when passing on


def shot_starts(motion: Motion, kept: BoolArray, *, share: float, longest_frames: int) -> IntArray:
    """First frame of every camera shot; [0] where there is no cut, or a shoulder is not among the points.

    At a cut the trunk (shoulders and hips) and half of all points jump, and the trunk stays: up to the cut it lies by
    its median over the frames before, from the cut on by its median over those after. Hands alone tell no cut, since
    both may leap.

    Parameters
    ----------
    motion : Motion, (T, P, 2)
    kept : (T,) mask of the frames without an error, as far as that can be told before the cuts are known
    share : float, of the median width of the box around the points: the least jump
    longest_frames : int
        Longest run of errors, which is no shot. Medians are taken over twice as many frames.
    """
    frames, joints = np.flatnonzero(kept), motion.skeleton.joints
    if not set(TRUNK[:2]) <= set(joints) or len(frames) < 2 * longest_frames + 2:
        return np.zeros(1, np.int64)
    trunk = motion.positions[:, [joints.index(name) for name in TRUNK if name in joints]]
    x = motion.positions[..., 0]
    least = share * float(np.median(x.max(axis=1) - x.min(axis=1)))
    starts = [0]
    for number in map(int, np.flatnonzero(_distance(trunk[frames[1:]], trunk[frames[:-1]]) > least) + 1):
        before, after = frames[max(0, number - 2 * longest_frames - 1) : number], frames[number:]
        after = after[: 2 * longest_frames + 1]
        is_long = min(len(before), len(after)) > longest_frames and after[0] - starts[-1] > longest_frames
        is_gap = after[0] - before[-1] > 2 * longest_frames
        if not is_long or is_gap or _distance(motion.positions[after[0]], motion.positions[before[-1]]) <= least:
            continue
        old, new = np.median(trunk[before], axis=0), np.median(trunk[after], axis=0)
        apart = float(_distance(new, old))
        if apart > least and max(_distance(trunk[before[-1]], old), _distance(trunk[after[0]], new)) < RESTS * apart:
            # The frames behind a large jump were not kept: the first one in the new place is the cut.
            between = np.arange(before[-1] + 1, after[0] + 1)
            starts.append(int(between[(_distance(trunk[between], new) < RESTS * apart).argmax()]))
    return np.array(starts)


def shot_spans(starts: IntArray, n_frames: int) -> list[slice]:
    """Frames of each camera shot of a recording of `n_frames`."""
    return list(itertools.starmap(slice, itertools.pairwise([*map(int, starts), n_frames])))


def _distance(points: FloatArray, others: FloatArray) -> FloatArray:
    """Median over points of the distance of two arrays (..., P, 2)."""
    away = points - others
    return np.median(np.hypot(away[..., 0], away[..., 1]), axis=-1)
