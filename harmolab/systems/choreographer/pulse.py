"""The pulse of a motion without beats: its own rests, chosen so that they come about as often as a song's beats."""

from __future__ import annotations

import numpy as np

from harmolab.kinematics import peak_frames
from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray

STEP = 0.1  # seconds between moments that may be taken where no rest is near
SHORTEST, LONGEST = 0.6, 1.6  # of the song's beat
STRETCH = 20.0  # standard deviations of rest that a squared logarithm of 1 costs


def rest(signal: ShapeSignal, period: float) -> FloatArray:
    """Rest of a body at each sample (T,), beside half a `period` (seconds) before and after, in SDs of itself.

    The fit of the speed of its shape to one turn of a cosine: least at the moment, most half a beat to either side.
    """
    if signal.times.size < 2 or not signal.values.any():
        return np.zeros(signal.times.size)
    step = float(signal.times[1] - signal.times[0])
    half = max(1, round(period / 2 / step))
    angle = np.arange(-half, half + 1) / half * np.pi
    window = 0.5 + 0.5 * np.cos(angle)
    template = window * np.cos(angle)
    template -= window * template.sum() / window.sum()
    fit = -np.convolve(np.pad(signal.values, half, mode="edge"), template, mode="valid")
    return fit / max(float(fit.std()), 1e-12)


def pulse(signal: ShapeSignal, period: float) -> FloatArray:
    """The beats (B,), seconds, that rest most and lie nearest to `period` seconds apart; empty if there are not two.

    Dynamic programming over the rests and over moments every tenth of a second: a beat is worth its `rest`, less
    `STRETCH` times the squared logarithm of its distance from the beat before over the period; that distance lies
    between .6 and 1.6 periods. The signal is the one that our score reads: that a dance made of these beats scores well
    says that the cut is good, not that the dancer heard any music.
    """
    depth = rest(signal, period)
    if depth.size < 2:
        return np.zeros(0)
    every = max(1, round(STEP / float(signal.times[1] - signal.times[0])))
    frames = np.union1d(peak_frames(depth), np.arange(0, depth.size, every))
    moments, worth = signal.times[frames], depth[frames]
    before = np.full(moments.size, -1)
    first = np.searchsorted(moments, moments - LONGEST * period)
    last = np.searchsorted(moments, moments - SHORTEST * period, side="right")
    for number in np.flatnonzero(last > first).tolist():
        earlier = slice(first[number], last[number])
        gain = worth[earlier] - STRETCH * np.log((moments[number] - moments[earlier]) / period) ** 2
        best = int(gain.argmax())
        worth[number] += gain[best]
        before[number] = first[number] + best
    at_end = moments >= moments[-1] - LONGEST * period
    return _traced(moments, before, int(np.where(at_end, worth, -np.inf).argmax()))


def _traced(moments: FloatArray, before: np.ndarray, number: int) -> FloatArray:
    """The beats up to one of the moments, by the moment before each."""
    beats = []
    while number >= 0:
        beats.append(float(moments[number]))
        number = int(before[number])
    return np.array(beats[::-1]) if len(beats) > 1 else np.zeros(0)
