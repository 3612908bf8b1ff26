"""The mean movement through a beat: what can be seen of a place where nothing was told."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray

MOMENTS = 48  # a beat
SMOOTHING = 4  # moments to either side: a twelfth of a beat


class Course(NamedTuple):
    """Mean signal from one beat to the next, (48,), and where it is highest and lowest: beats after it, in [0, 1)."""

    values: FloatArray
    fastest: float
    stillest: float


def beat_course(signal: ShapeSignal, beats: FloatArray) -> Course:
    """The mean of a signal at each of 48 moments of a beat.

    Parameters
    ----------
    signal : ShapeSignal
    beats : (B,) array, seconds on the signal's time line

    Examples
    --------
    >>> times = np.arange(2000) / 100
    >>> wave = -np.cos(2 * np.pi * (times - 0.1) / 0.5)  # lowest .1 s after each beat of .5 s
    >>> course = beat_course(ShapeSignal(times, wave, times >= 0, 0.5, 1.0, 1.0, 3), 0.5 * np.arange(39))
    >>> round(course.stillest * 0.5, 2), round(course.fastest * 0.5, 2)
    (0.1, 0.35)
    """
    positions = np.interp(signal.times, beats, np.arange(beats.size, dtype=np.float64))
    moments = np.floor(positions * MOMENTS + 0.5).astype(np.int64)[signal.valid] % MOMENTS
    counts = np.bincount(moments, minlength=MOMENTS)
    sums = np.bincount(moments, signal.values[signal.valid], MOMENTS)
    offsets = np.arange(-SMOOTHING, SMOOTHING + 1)
    window = (np.arange(MOMENTS)[:, None] + offsets) % MOMENTS
    values = sums[window].sum(axis=1) / np.maximum(counts[window].sum(axis=1), 1)
    return Course(values, int(values.argmax()) / MOMENTS, int(values.argmin()) / MOMENTS)
