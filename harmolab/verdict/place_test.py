"""The place test: at which lag does a movement do on the beats what dancers do there?

A pattern says what is expected around a beat: the learnt curve of a dance, or that the body rests on the beat. Where it
is longer than a beat and "one" is not known, every place at which it may begin is a reading. Every moment of the take
is ranked by how well the next cycle of movement fits; moved by a lag u, the beats have the mean rank M_f(u), and the
best reading T(u) = max_f M_f(u). The choice of the reading is part of the null, since every lag has it too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from harmolab.params import BarPattern
from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray, IntArray

MOMENTS = 48  # a beat
TIE = 0.03  # of the range of T: lags that fit as well as the best
BLOCK = 4  # beats that are drawn together, at least
N_DRAWS = 200


@dataclass(frozen=True, eq=False)
class PlaceTest:
    """Ranks of the beats among all moments of a take, by reading and lag.

    Parameters
    ----------
    pattern : BarPattern
    ranks : (F, B, U) array in (0, 1)
        Rank of each of B beats moved by u / 48 beats, for the U lags of one cycle, and F places where it may begin.
    first : int, number of the first of these beats among the music's
    reach : float, beats: lags up to so far on either side are told apart
    """

    pattern: BarPattern
    ranks: FloatArray
    first: int
    reach: float

    @property
    def curve(self) -> FloatArray:
        """T(u), (U,): mean rank of the beats moved by u, of the best reading there."""
        return self.ranks.mean(axis=1).max(axis=0)

    @property
    def chance(self) -> float:
        """Mean rank at a random lag: 1/2 for one reading, above that where the best of several is taken."""
        return _chance(self.curve, len(self.ranks))

    @property
    def harmony_above_chance(self) -> float:
        """H = (T(0) - c) / (1 - c), in [-1, 1]: 1 when every beat is the best moment of the take."""
        return float(_above(self.curve, len(self.ranks)))

    @property
    def p_value(self) -> float:
        """Share of the lags at which the beats rank at least as high as where they are."""
        curve = self.curve
        return float(np.mean(curve >= curve[0] - 1e-12))

    @property
    def lag(self) -> float:
        """The lag (beats, late is positive) at which the beats rank highest."""
        return float(_lags(self.curve, self.reach))

    def shares(self, n_beats: int) -> FloatArray:
        """Rank of each of the music's beats, (n_beats,), in the reading that fits best at lag 0."""
        return self.shares_at_lags(n_beats)[:, 0]

    def shares_at_lags(self, n_beats: int) -> FloatArray:
        """Rank of each of the music's beats at every lag, (n_beats, U), in the reading that fits best there."""
        best = self.ranks.mean(axis=1).argmax(axis=0)
        beats = (np.arange(n_beats) - self.first) % self.ranks.shape[1]
        return self.ranks[best, beats[:, None], np.arange(best.size)]

    def spread(self, *, seed: int = 0, level: float = 0.95) -> tuple[tuple[float, float], tuple[float, float]]:
        """Intervals of H and of the lag (beats) from bar to bar: blocks of 4 beats or more are drawn with replacement.

        They say how steady the take is, not how likely its place in the beat is by luck: a take has one phase. Both are
        NaN with fewer than two blocks.
        """
        cycle = self.pattern.beats
        starts = np.arange(0, self.ranks.shape[1], cycle * -(-BLOCK // cycle))
        if starts.size < 2:
            return (np.nan, np.nan), (np.nan, np.nan)
        sums = np.add.reduceat(self.ranks, starts, axis=1)
        sizes = np.diff(np.append(starts, self.ranks.shape[1]))
        counts = np.random.default_rng(seed).multinomial(starts.size, np.full(starts.size, 1 / starts.size), N_DRAWS)
        means = np.einsum("db,fbu->dfu", counts, sums) / (counts @ sizes)[:, None, None]
        curves = means.max(axis=1)
        away = (_lags(curves, self.reach) - self.lag + self.reach) % (2 * self.reach) - self.reach
        edges = (1 - level) / 2, (1 + level) / 2
        harmony = np.quantile(_above(curves, len(self.ranks)), edges)
        lags = self.lag + np.quantile(away, edges)
        return (float(harmony[0]), float(harmony[1])), (float(lags[0]), float(lags[1]))


def place_test(signal: ShapeSignal, beats: FloatArray, bar_places: IntArray | None, pattern: BarPattern) -> PlaceTest:
    """The test of a movement against beats.

    Parameters
    ----------
    signal : ShapeSignal over the span of the beats
    beats : (B,) array, seconds on the signal's time line
    bar_places : (B,) array of int, or None when unknown: then every place of the bar is a reading
    pattern : BarPattern

    Raises
    ------
    ValueError
        If the beats do not hold one whole cycle of the readings.
    """
    cycle, places = pattern.beats, range(pattern.beats if bar_places is None else 1)
    # The first sample after a beat may lie up to a step behind it.
    start = signal.times[0] - (signal.times[1] - signal.times[0])
    first = int(np.ceil(np.interp(start, beats, np.arange(beats.size)) - 1e-6))
    count = (beats.size - 1 - first) // cycle * cycle
    if count < 1:
        raise ValueError(f"{beats.size} beats hold no whole cycle of {cycle}")
    moments = np.interp(first + np.arange(count * MOMENTS) / MOMENTS, np.arange(beats.size), beats)
    speed = np.interp(moments, signal.times[signal.valid], signal.values[signal.valid])
    origin = 0 if bar_places is None else int(bar_places[0])
    ranks = [_beat_ranks(speed, pattern, first + origin - place) for place in places]
    reach = 0.5 * (cycle if len(places) == 1 else 1)
    return PlaceTest(pattern, np.array(ranks), first, reach)


def _beat_ranks(speed: FloatArray, pattern: BarPattern, origin: int) -> FloatArray:
    """(B, U) ranks of the beats of a circular speed at every lag within the pattern.

    `origin` is the number of the first beat counted from where the pattern begins.
    """
    harmonics = harmonic_fits(speed, pattern.beats, len(pattern.cosines))
    weights = np.array([pattern.cosines, pattern.sines]).T.ravel()
    places = [_rank(turned(weights, pattern.beats, place) @ harmonics) for place in range(pattern.beats)]
    numbers = np.arange(speed.size // MOMENTS)
    moments = (numbers[:, None] * MOMENTS + np.arange(pattern.beats * MOMENTS)) % speed.size
    return np.array(places)[(numbers + origin)[:, None] % pattern.beats, moments]


def harmonic_fits(speed: FloatArray, beats: int, count: int, *, moments: int = MOMENTS) -> FloatArray:
    """Correlation of a circular speed around each moment with each cosine and sine of a cycle.

    They are seen through a Hann window of one cycle, and have no mean. The fit to a pattern is a sum of these, weighted
    by the pattern's coefficients; the fit to another of its places one with `turned` coefficients.

    Parameters
    ----------
    speed : (G,) array, `moments` samples a beat
    beats : int, length of the cycle
    count : int, H harmonics

    Returns
    -------
    (2 H, G) array: first cosine, first sine, second cosine ...
    """
    half = beats * moments // 2
    offsets = np.arange(-half, half + 1)
    window = 0.5 + 0.5 * np.cos(np.pi * offsets / half)
    angle = np.pi / half * np.arange(1, count + 1)[:, None] * offsets
    waves = window * np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(2 * count, -1)
    waves -= window * (waves.sum(axis=1) / window.sum())[:, None]
    kernels = np.zeros((speed.size, 2 * count))
    np.add.at(kernels, offsets % speed.size, waves.T)
    fits = np.fft.rfft(speed) * np.conj(np.fft.rfft(kernels.T))
    return np.fft.irfft(fits, speed.size)


def turned(weights: FloatArray, beats: int, place: float | FloatArray) -> FloatArray:
    """Coefficients of a pattern seen from `place` beats on, cosines and sines in turn: (..., 2 H) as those given.

    `place` is one for all, or has the shape (..., 1).
    """
    pairs = weights.reshape(*weights.shape[:-1], -1, 2)
    angle = 2 * np.pi * np.arange(1, pairs.shape[-2] + 1) * place / beats
    cosines, sines = pairs[..., 0], pairs[..., 1]
    both = [cosines * np.cos(angle) + sines * np.sin(angle), sines * np.cos(angle) - cosines * np.sin(angle)]
    return np.stack(both, axis=-1).reshape(weights.shape)


def _rank(fits: FloatArray) -> FloatArray:
    """Ranks in (0, 1); what differs by rounding only is a tie."""
    return (rankdata(np.round(fits / max(np.abs(fits).max(), 1e-300), 9)) - 0.5) / fits.size


def _chance(curve: FloatArray, n_readings: int) -> float:
    return 0.5 if n_readings == 1 else float(curve.mean())


def _above(curves: FloatArray, n_readings: int) -> FloatArray:
    """H of curves (..., U)."""
    chance = 0.5 if n_readings == 1 else curves.mean(axis=-1)
    # With several readings chance lies above 1/2, and the worst moment would lie below -1.
    above: FloatArray = np.maximum((curves[..., 0] - chance) / (1 - chance), -1.0)
    return above


def _lags(curves: FloatArray, reach: float) -> FloatArray:
    """Lag in beats of the top of curves (..., U) within the reach: the middle of its plateau, the one nearest 0."""
    size = curves.shape[-1]
    lags = np.arange(-int(reach * MOMENTS), int(reach * MOMENTS) + 1)
    heights = curves[..., lags % size]
    tie = TIE * (curves.max(axis=-1) - curves.min(axis=-1))
    outside = heights < (heights.max(axis=-1) - tie)[..., None]
    nearest = np.where(outside, size, np.abs(lags)).argmin(axis=-1)[..., None]
    places = np.arange(lags.size)
    before = np.maximum.accumulate(np.where(outside, places, -1), axis=-1)
    after = np.minimum.accumulate(np.where(outside, places, lags.size)[..., ::-1], axis=-1)[..., ::-1]
    ends = [np.take_along_axis(edge, nearest, axis=-1)[..., 0] for edge in (before, after)]
    return (0.5 * (ends[0] + ends[1]) + lags[0]) / MOMENTS
