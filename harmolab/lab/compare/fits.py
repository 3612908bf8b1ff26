"""Clips ranked against patterns, many clips at once, and patterns that are learnt anew: the fitted scores of a corpus.

A clip's H is that of `harmolab.verdict.place_test` with one reading: how high the music's beats rank among all moments
of the clip by their fit to a pattern. Two facts make thousands of null corpora cheap. The fit is linear in the
pattern's coefficients, so the correlations with each harmonic are kept and a new pattern is one product; and music that
begins elsewhere multiplies a clip's Fourier sums by a phase, so patterns are learnt anew by addition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from harmolab.bar_pattern import PatternSums, beat_curve
from harmolab.params import BarPattern
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray
from harmolab.verdict.place_test import harmonic_fits, turned

MOMENTS = 20  # a beat
TENTHS = 10  # of a beat: the lags at which a clip is scored


def cycle_curve(times: FloatArray, speed: FloatArray, track: BeatTrack, cycle: int) -> FloatArray:
    """The speed over whole cycles of beats, (G,) with `MOMENTS` samples a beat, turned to begin where a cycle does.

    Empty without two beats, a whole cycle, or any movement.

    Parameters
    ----------
    times, speed : (T,) arrays, seconds and normalised speed
    track : BeatTrack on the same time line
    cycle : int, beats
    """
    if len(track) < 2 or not speed.any():
        return np.zeros(0)
    curve, first = beat_curve(times, speed, track, moments=MOMENTS)
    whole = curve.size // (cycle * MOMENTS) * cycle * MOMENTS
    return np.roll(curve[:whole], first % max(whole, 1))


def coefficients(pattern: BarPattern, cycle: int) -> FloatArray:
    """(2 H,) cosines and sines in turn of a pattern over a cycle of its own beats, or of a multiple of them."""
    weights = np.zeros((cycle, 2))
    step = cycle // pattern.beats
    weights[step - 1 : step * len(pattern.cosines) : step] = np.array([pattern.cosines, pattern.sines]).T
    return weights.ravel()


def turned_signals(weights: FloatArray, cycle: int, place: float | FloatArray) -> FloatArray:
    """`turned` coefficients (..., F) of several signals, one after another; a `place` array has the shape (..., 1, 1).

    The harmonics of moments turned by -place are those that the coefficients turned by place see.
    """
    signals = weights.reshape(*weights.shape[:-1], -1, 2 * cycle)
    return turned(signals, cycle, place).reshape(weights.shape)


@dataclass(frozen=True, eq=False)
class FitBatch:
    """Fits of n clips with one cycle to each harmonic of it.

    Parameters
    ----------
    cycle : int, beats
    fits : (n, F, G) array of `harmonic_fits`, zeros behind the end of a shorter clip: F = 2 cycle for each signal
    sizes : (n,) array of int, moments of each clip: whole cycles, or 0
    """

    cycle: int
    fits: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, curves: Sequence[FloatArray], cycle: int) -> FitBatch:
        """The batch of n curves of `cycle_curve`, of one signal."""
        sizes = np.array([curve.size for curve in curves], np.int64)
        fits = np.zeros((sizes.size, 2 * cycle, max(sizes.max(initial=0), cycle * MOMENTS)))
        for row, curve in zip(fits, curves, strict=True):
            if curve.size:
                row[:, : curve.size] = harmonic_fits(curve, cycle, cycle, moments=MOMENTS)
        return cls(cycle, fits, sizes)

    def harmony(self, weights: FloatArray) -> FloatArray:
        """H of every clip at lags of 0, .1, .2 ... beat over its cycle, (n, 10 cycle); 0 for one without moments.

        Parameters
        ----------
        weights : (n, F) array, the coefficients of each clip's pattern
        """
        outside = np.arange(self.fits.shape[2]) >= self.sizes[:, None]
        below = np.where(outside, np.inf, 0.0)
        ranks = np.zeros((self.sizes.size, TENTHS * self.cycle))
        for place in range(self.cycle):
            row = turned_signals(weights, self.cycle, place)[:, None] @ self.fits
            folded = self._cycle_means(_ranks(row[:, 0] + below) * ~outside)
            ranks += np.roll(folded, -MOMENTS * place, axis=1)[:, :: MOMENTS // TENTHS]
        sizes = self.sizes[:, None]
        return np.where(sizes > 0, 2 * (ranks / self.cycle + 0.5) / np.maximum(sizes, 1) - 1, 0.0)

    def _cycle_means(self, values: FloatArray) -> FloatArray:
        """Mean over the cycles of each clip: (n, G) to (n, moments of a cycle)."""
        length = self.cycle * MOMENTS
        folded = values.reshape(self.sizes.size, -1, length).sum(axis=1)
        return np.asarray(folded / np.maximum(self.sizes[:, None] // length, 1))


def _ranks(values: FloatArray) -> FloatArray:
    """(n, G) number of values in the row that lie below each one."""
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, values.argsort(axis=1), np.arange(values.shape[1])[None], axis=1)
    return ranks


class Teacher(Protocol):
    """Source of the weights of a score: lessons of clips, and who may learn from whom."""

    def weights(self, origins: FloatArray | float = 0.0) -> FloatArray:
        """(n, F) coefficients for each judged clip where the music of each teaching clip begins so many beats late."""


@dataclass(frozen=True, eq=False)
class Lessons:
    """Fourier sums of the clips that patterns are learnt on, and who may learn from whom.

    Parameters
    ----------
    cycle : int, beats
    sums : (m, 2 cycle) array, cosine and sine sums in turn
    usable : (n, m) bool array: clip j may be learnt on when clip i is judged
    """

    cycle: int
    sums: FloatArray
    usable: BoolArray

    @classmethod
    def of(cls, sums: Sequence[PatternSums | None], usable: BoolArray, cycle: int) -> Lessons:
        """The lessons of m clips; one without sums teaches nothing."""
        rows = [np.zeros(cycle, complex) if one is None else one.sums for one in sums]
        both = np.stack([np.real(rows), -np.imag(rows)], axis=-1)
        is_timed = np.array([one is not None for one in sums], bool)
        return cls(cycle, both.reshape(len(rows), -1), usable & is_timed)

    def weights(self, origins: FloatArray | float = 0.0) -> FloatArray:
        """(n, 2 cycle) coefficients learnt for each judged clip, but for their scale, on which no rank depends.

        Where there is nothing to learn from they are those of movements that stop on the beat.

        Parameters
        ----------
        origins : (m,) array, beats by which the music of each clip is moved
        """
        moved = turned(self.sums, self.cycle, np.broadcast_to(origins, len(self.sums))[:, None])
        rest = coefficients(BarPattern.stop_on_the_beat(), self.cycle)
        weights: FloatArray = self.usable.astype(np.float64) @ moved
        weights[~self.usable.any(axis=1)] = rest
        return weights
