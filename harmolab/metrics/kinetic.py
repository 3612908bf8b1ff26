"""Kinetic features of a motion, one vector a clip: how much energy each joint has and spends (Onuma et al. 2008).

Made for Frechet distances and diversity, in the order and with the windows of AIST++ (Li et al. 2021), whose code took
them from fairmotion. Masses are left out, so energies are squared speeds.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from harmolab.kinematics import upsample_motion
from harmolab.types import BoolArray, FloatArray, IntArray, Motion

AIST_FPS = 60.0  # hertz; windows and differences of AIST++ are so many frames of this rate
_BEFORE, _AFTER = 3, 2  # sixtieths before and after a moment that its window of five steps reaches


class DenseMotion(NamedTuple):
    """A motion at a multiple of 60 frames per second: (T, J, 3) positions, (T,) validity, frames to a sixtieth."""

    positions: FloatArray
    valid: BoolArray
    stride: int


def dense_motion(motion: Motion) -> DenseMotion:
    """`motion` at the lowest multiple of 60 frames per second that loses no frames, by cubic splines.

    Raises
    ------
    ValueError
        If it is two-dimensional, or shorter than two sixtieths of a second.
    """
    if motion.positions.shape[2] != 3:
        raise ValueError("a three-dimensional motion is needed: metres, y up")
    stride = max(1, math.ceil(motion.fps / AIST_FPS - 1e-6))
    dense = upsample_motion(motion, stride * AIST_FPS - 1e-6)
    if dense.n_frames <= 2 * stride:
        raise ValueError(f"the motion lasts {motion.duration:.3f} s, too short for features, which need 1/30 s")
    return DenseMotion(dense.positions, dense.valid, stride)


def kinetic_features(motion: Motion, *, form: Literal["fixed", "aist++"] = "fixed") -> FloatArray:
    """Horizontal energy, vertical energy and energy expenditure of every joint, in this order, joint after joint.

    Velocity and acceleration are means over five steps of 1/60 s around each frame (fewer at the ends). The energies
    are the mean squares over time of the horizontal and of the vertical velocity (m^2/s^2); the expenditure is the mean
    length of the acceleration (m/s^2). Frames whose window is not valid do not count.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        Other rates than 60 frames per second are brought to a multiple of it, so that the features do not show them.
    form : "fixed" or "aist++"
        The published code (fairmotion, copied by AIST++, Bailando and others) divides by the time step too early: the
        first velocity of each acceleration is p(t) - p(t - 1) / dt where it should be (p(t) - p(t - 1)) / dt.
        What it calls an acceleration is therefore a + p (1 / dt^2 - 1 / dt): at 60 frames per second 3540 times the
        place of the joint, which no real acceleration comes near. A third of its features depend on where in the room
        the dancer was, and published distances on kinetic features hang on it. "aist++" does the same, to compare with
        those. Reported as google-research/mint issue 62, facebookresearch/fairmotion pull request 87 and
        google/aistplusplus_api pull request 33.

    Returns
    -------
    (3 J,) array

    Raises
    ------
    ValueError
        If the motion is two-dimensional, too short or nowhere valid, or `form` is another word.
    """
    if form not in ("fixed", "aist++"):
        raise ValueError(f"form must be fixed or aist++, got {form!r}")
    dense = dense_motion(motion)
    positions, stride = dense.positions, dense.stride
    weights = _weights(dense)
    step = 1 / AIST_FPS
    moved, steps = _over_window(positions, len(positions), stride)
    moved *= moved
    energy = (weights / (steps * step) ** 2 @ moved.reshape(len(moved), -1)).reshape(-1, 3)
    # The mean of five second differences is the last first difference less the first one.
    gained, steps = _over_window(positions[stride:] - positions[:-stride], len(positions), stride)
    if form == "aist++":
        gained += ((1 - step) * steps)[:, None, None] * _mean_places(positions, stride)
    gained *= gained
    # A product with a matrix: numpy's own sums over three numbers take three times as long.
    lengths = np.sqrt(gained.reshape(-1, 3) @ np.ones(3)).reshape(len(gained), -1)
    spent = weights / (steps * step**2) @ lengths
    return np.column_stack([energy[:, 0] + energy[:, 2], energy[:, 1], spent]).ravel()


def _over_window(series: FloatArray, n_frames: int, stride: int) -> tuple[FloatArray, FloatArray]:
    """The gain of a (S, J, 3) series over the window of each frame from `stride` on, and the window's sixtieths.

    Both ends of a window stay within the series, the first entry of which belongs to frame 0.
    """
    first, last = _window_ends(n_frames, stride, 0, len(series) - 1)
    gain = np.empty((len(first), *series.shape[1:]))
    reach = (_BEFORE + _AFTER) * stride
    full = slice((_BEFORE - 1) * stride, max(len(series) - _BEFORE * stride, (_BEFORE - 1) * stride))
    # Whole windows by slices, which copy nothing; only those at the ends one by one.
    np.subtract(series[reach:], series[:-reach], out=gain[full])
    ends = np.delete(np.arange(len(first)), full)
    gain[ends] = series[last[ends]] - series[first[ends]]
    return gain, (last - first) / stride


def _window_ends(n_frames: int, stride: int, lowest: int, highest: int) -> tuple[IntArray, IntArray]:
    """First and last frame of the window of each frame from `stride` on, kept within `lowest` and `highest`."""
    moments = np.arange(stride, n_frames)
    return np.maximum(moments - _BEFORE * stride, lowest), np.minimum(moments + _AFTER * stride, highest)


def _mean_places(positions: FloatArray, stride: int) -> FloatArray:
    """Mean of the positions at which a window's second differences are taken, (T - stride, J, 3)."""
    first, last = _window_ends(len(positions), stride, 0, len(positions) - 1 - stride)
    total = np.concatenate([np.zeros_like(positions[:1]), np.cumsum(positions, axis=0)])
    return (total[last + 1] - total[first + stride]) / (last + 1 - first - stride)[:, None, None]


def _weights(dense: DenseMotion) -> FloatArray:
    """Weight of each frame from `stride` on in means over time: those whose window is valid share 1."""
    if dense.valid.all():
        return np.full(len(dense.valid) - dense.stride, 1 / (len(dense.valid) - dense.stride))
    first, last = _window_ends(len(dense.valid), dense.stride, 0, len(dense.valid) - 1 - dense.stride)
    invalid = np.concatenate([[0], np.cumsum(~dense.valid)])
    # A second difference needs one more step than a first one.
    usable = invalid[last + dense.stride + 1] == invalid[first]
    if not usable.any():
        raise ValueError("the motion is nowhere valid for 1/12 s, the window of its features")
    return usable / usable.sum()
