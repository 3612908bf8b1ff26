"""The pulse of a motion without beats: its own rests, chosen so that they come about as often as a song's beats."""

from __future__ import annotations

import numpy as np

from harmolab.kinematics import valley_frames
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import FloatArray, Motion

STEP = 0.1  # seconds between moments that may be taken where no rest is near
SHORTEST, LONGEST = 0.6, 1.6  # of the song's beat
STRETCH = 20.0  # standard deviations of speed that a squared log of 1 costs


def rests(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Moments (R,), seconds, at which a pulse may come, and how deep each rests, in standard deviations of the speed.

    Rests are the valleys of the speed of the body's shape. Between them are moments every tenth of a second that are no
    rests, depth 0, for a dancer who does not rest for a while.
    """
    signal = shape_signal(shape_speed(motion))
    frames = valley_frames(signal.values)
    times, depths = signal.times[frames], np.maximum(-signal.values[frames], 0.0)
    grid = np.arange(0.0, (motion.n_frames - 1) / motion.fps, STEP)
    order = np.argsort(moments := np.concatenate([times, grid]), kind="stable")
    return moments[order], np.concatenate([depths, np.zeros(grid.size)])[order]


def pulse(moments: FloatArray, depths: FloatArray, period: float) -> FloatArray:
    """The beats (B,), seconds, that rest deepest and lie nearest to `period` seconds apart; empty if there are not two.

    Dynamic programming over the moments: a beat is worth its depth, less `STRETCH` times the squared logarithm of its
    distance from the beat before over the period, which lies between .6 and 1.6.
    """
    worth, before = depths.copy(), np.full(moments.size, -1)
    first = np.searchsorted(moments, moments - LONGEST * period)
    last = np.searchsorted(moments, moments - SHORTEST * period, side="right")
    for number in np.flatnonzero(last > first).tolist():
        earlier = slice(first[number], last[number])
        ratio = np.log((moments[number] - moments[earlier]) / period)
        gain = worth[earlier] - STRETCH * ratio**2
        best = int(gain.argmax())
        if gain[best] > 0 or moments[number] > LONGEST * period:
            worth[number] += gain[best]
            before[number] = first[number] + best
    if not moments.size:
        return moments
    at_end = moments >= moments[-1] - LONGEST * period
    number = int(np.where(at_end, worth, -np.inf).argmax())
    beats = []
    while number >= 0:
        beats.append(float(moments[number]))
        number = int(before[number])
    return np.array(beats[::-1]) if len(beats) > 1 else np.zeros(0)
