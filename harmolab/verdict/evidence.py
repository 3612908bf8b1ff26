"""The evidence behind a verdict, as numbers: a movement, its beats, the time test, the place test, the mean course.

**The time test asks: does the movement keep the tempo of these beats better than other tempi?** Movement that recurs
once a beat fits beats at any moment, so moving the beats in time proves nothing. The null is another tempo.

1. The signal of the movement (`harmolab.shape_speed`) is cut into blocks b of four beats or more.
2. Each block gives a complex Fourier coefficient a_bh for every harmonic h of a cycle of one, two or three beats, up to
   two movements a beat. The cycle that agrees best counts.
3. The test number is how well *different* blocks agree, ``z = (sum_h |sum_b a_bh|^2 - sum_bh |a_bh|^2) / SD``. SD is
   the standard deviation that the numerator has for blocks with random phases.
4. The same is computed for 240 grids whose tempi lie between .6 and 1.67 times that of the beats. The p-value is the
   share of grids whose z is at least as large.

No pattern, no lag and no sign is assumed: rests, hits, half time and double time agree alike.

**The place test asks: at which lag does the movement do on the beats what is expected there?** The lag is how much
later than the beats the body moves. A pattern says what is expected around a beat: the learnt course of a dance, or
that the body rests.

1. Every moment of the take is ranked by how well the movement around it fits the pattern; ranks lie between 0 and 1.
2. Beats that are moved by a lag u have the mean rank M_f(u), where f is the place at which the pattern begins.
3. Where the pattern is longer than a beat and "one" is not known, each f is tried: T(u) = max_f M_f(u). Every lag has
   this choice, so that chance has it, too.
4. Harmony above chance is ``H = (T(0) - c) / (1 - c)``; c is 1/2, or the mean of T over all lags where f is chosen.

**The mean course of movement through a beat** shows when the body is fastest and stillest where nothing was told.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, reduce
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.params import HOW_PATTERNS, BarPattern
from harmolab.shape_speed import ShapeSignal
from harmolab.types import BeatTrack, FloatArray, IntArray
from harmolab.verdict.bar_pattern import first_place, moment_ranks, pattern_fits

# The time test

SAMPLED_AT = 25.0  # hertz: dance holds little above 3 Hz
SLOWEST = 0.6  # ratio of the slowest grid; the fastest is 1 / SLOWEST
N_RATIOS = 241  # log-even, the beats' own tempo in the middle
BLOCK = 4  # beats in a block, at least
FEWEST_BLOCKS = 3
FEWEST_BEATS = 16  # below which nothing is judged: of recorded takes of 16 beats one in six to eight is in time
ALPHA = 0.05
BESIDE = 5  # grids, 2 %
LEAST_SPREAD = 0.3  # of the mean SD of the blocks: a block that nearly stands still is not blown up
STEP = -2 * np.log(SLOWEST) / (N_RATIOS - 1)
RATIOS: FloatArray = np.exp(np.linspace(np.log(SLOWEST), -np.log(SLOWEST), N_RATIOS))


@dataclass(frozen=True, eq=False)
class TimeTest:
    """Agreement of the movement from block to block on grids of many tempi: the result of `time_test`.

    Parameters
    ----------
    z : (241,) array
        Agreement on the grid of each tempo, in standard deviations of blocks with random phases. The tempi are `RATIOS`
        times that of the beats, whose own is in the middle. -inf where there are too few blocks.
    power : (241,) array
        Power of one movement a beat on each grid, as far as the blocks agree on it.
    p_value : float
        Share of the 241 grids, the beats' own among them, that agree at least as well as the beats' own.
    rates : dict
        Movements a beat (a Fraction) -> the power on which the blocks agree, on the beats' own grid.
    cycles : dict
        Beats after which a movement may recur -> agreement on the beats' own grid.
    """

    z: FloatArray
    power: FloatArray
    p_value: float
    rates: Mapping[Fraction, float]
    cycles: Mapping[int, float]

    @property
    def rate(self) -> Fraction:
        """Movements a beat: the harmonic that agrees best on the beats' own grid."""
        return max(self.rates, key=self.rates.__getitem__)

    @property
    def metre(self) -> int:
        """Beats after which the movement recurs most clearly, of the cycles that were tried."""
        return max(self.cycles, key=self.cycles.__getitem__)

    @property
    def own(self) -> float:
        """Agreement on the beats' own grid."""
        return float(self.z[N_RATIOS // 2])

    @property
    def best(self) -> float:
        """Agreement on the best grid."""
        return float(self.z.max())

    @property
    def own_ratio(self) -> float:
        """Tempo of the movement over that of the beats; above 1 it is faster than the music.

        It lies between grids, by a parabola. For a movement in time it is the peak of z within 2 % of 1. Else it is the
        peak of `power`: grids of related tempi (2 : 1, 3 : 2) have the same z, which does not see how large a harmonic
        is.
        """
        heights = np.where(np.abs(np.arange(N_RATIOS) - N_RATIOS // 2) <= BESIDE, self.z, -np.inf)
        return _peak_ratio(heights if self.p_value <= ALPHA else self.power)


def _peak_ratio(heights: FloatArray) -> float:
    """Ratio at the highest point of (241,) heights, by a parabola through its neighbours."""
    top = int(heights.argmax())
    around = heights[top - 1 : top + 2]
    shift = 0.0
    if around.size == 3 and np.isfinite(around).all() and (bend := around[0] - 2 * around[1] + around[2]) < 0:
        shift = 0.5 * (around[0] - around[2]) / bend
    return float(np.exp((top + shift - N_RATIOS // 2) * STEP))


def time_test(signal: ShapeSignal, beats: FloatArray, *, cycles: tuple[int, ...] = (1, 2, 3)) -> TimeTest:
    """Agreement of a movement with the tempo of its beats, and with 240 other tempi: is it in time?

    Parameters
    ----------
    signal : ShapeSignal over the span of the beats
    beats : (B,) array, seconds on the signal's time line
        At least five, which make one block.
    cycles : tuple of int
        Beats after which movements may recur; the one that agrees best counts. Where the meter is known: one beat, and
        the cycle of the bar.

    Returns
    -------
    TimeTest
    """
    stride = max(1, round(1 / (SAMPLED_AT * float(np.diff(signal.times[:2])[0]))))
    phase = np.interp(signal.times[::stride], beats, np.arange(beats.size, dtype=np.float64))
    weights = np.gradient(phase) * signal.valid[::stride]
    grids = _grids(phase, weights, signal.values[::stride], list(cycles))
    z: FloatArray = np.max([grid.z for grid in grids.values()], axis=0)
    own = z[N_RATIOS // 2]
    p = float(np.mean(z >= own)) if np.isfinite(own) else 1.0
    powers = {cycle: grid.harmonics[:, N_RATIOS // 2].tolist() for cycle, grid in grids.items()}
    rates = {Fraction(h, cycle): power for cycle, row in powers.items() for h, power in enumerate(row, 1)}
    owns = {cycle: float(grid.z[N_RATIOS // 2]) for cycle, grid in grids.items()}
    return TimeTest(z, grids[cycles[0]].harmonics[cycles[0] - 1], p, rates, owns)


class _Blocks(NamedTuple):
    """Whole blocks of beats on every grid.

    Edges are first samples, and the end of the last block, (241, B + 1); counts of blocks that exist, (241,);
    deviations (241, T + 1) are weighted ones from the mean of their block, over its weight and spread, and a 0 behind
    them, where blocks end that do not exist.
    """

    edges: IntArray
    counts: IntArray
    deviations: FloatArray

    @classmethod
    def of(cls, phase: FloatArray, weights: FloatArray, values: FloatArray, length: int) -> "_Blocks":
        """Blocks of so many beats, of (T,) samples."""
        edges, counts = _block_edges(phase, length)
        blocks = cls(edges, counts, np.zeros((N_RATIOS, phase.size + 1)))
        mass, first, second = (blocks.sums(np.append(weights * power, 0.0)) for power in (1.0, values, values**2))
        mass = np.where(mass > 0, mass, 1.0)
        mean = first / mass
        spread = np.sqrt(np.maximum(second / mass - mean**2, 0.0))
        typical = spread.sum(axis=1, keepdims=True) / np.maximum((spread > 0).sum(axis=1, keepdims=True), 1)
        scale = blocks.at_samples(mass * np.maximum(spread, LEAST_SPREAD * typical))
        away = (np.append(values, 0.0) - blocks.at_samples(mean)) * np.append(weights, 0.0)
        np.divide(away, scale, out=blocks.deviations, where=scale > 0)
        return blocks

    def sums(self, samples: NDArray[Any]) -> NDArray[Any]:
        """Sums over the blocks, (241, B), of samples (241, T + 1), or (T + 1,) for all grids."""
        places = self.edges if samples.ndim == 1 else self.edges + np.arange(0, samples.size, samples.shape[1])[:, None]
        is_block = np.arange(self.edges.shape[1] - 1) < self.counts[:, None]
        # What reaches from the last edge of a grid to the first of the next is no block, and left out.
        return np.where(is_block, np.add.reduceat(samples.ravel(), places.ravel()).reshape(places.shape)[:, :-1], 0)

    def at_samples(self, numbers: FloatArray) -> FloatArray:
        """(241, T + 1): at each sample the number, of (241, B), of its block; of the nearest one outside of all."""
        inner = self.edges[:, 1:-1]
        size = np.full((N_RATIOS, 1), self.deviations.shape[1])
        lengths = np.diff(inner, axis=1, prepend=0, append=size)
        return np.repeat(numbers.ravel(), lengths.ravel()).reshape(self.deviations.shape)


class _Agreement(NamedTuple):
    """z of every ratio, (241,), and the agreed power of each harmonic there, (2 C, 241)."""

    z: FloatArray
    harmonics: FloatArray


def _grids(phase: FloatArray, weights: FloatArray, values: FloatArray, cycles: list[int]) -> dict[int, _Agreement]:
    """The agreement on every grid of the blocks of (T,) samples, for movements that recur after so many beats."""
    common, grids = math.lcm(*cycles), dict[int, _Agreement]()
    turn = np.exp(-2j * np.pi / common * RATIOS[:, None] * np.append(phase, 0.0))
    lengths = {cycle: cycle * -(-BLOCK // cycle) for cycle in cycles}
    for length in dict.fromkeys(lengths.values()):
        alike = [cycle for cycle in cycles if lengths[cycle] == length]
        turns = reduce(np.multiply, [turn] * (common // max(alike)))
        grids |= _block_agreements(_Blocks.of(phase, weights, values, length), turns, alike)
    return grids


def _block_agreements(blocks: _Blocks, turn: NDArray[Any], cycles: list[int]) -> dict[int, _Agreement]:
    """The agreement of blocks; the longest of the cycles, in which `turn` turns once, is a multiple of each."""
    wave, longest, variances, harmonics = blocks.deviations.astype(np.complex128), max(cycles), [], []
    for _ in range(2 * longest):
        wave *= turn
        vectors = blocks.sums(wave)
        power = np.square(vectors.real) + np.square(vectors.imag)
        harmonics.append(np.square(np.abs(vectors.sum(axis=1))) - power.sum(axis=1))
        variances.append(np.square(power.sum(axis=1)) - np.square(power).sum(axis=1))
    every = {cycle: slice(longest // cycle - 1, None, longest // cycle) for cycle in cycles}
    return {cycle: _agreement(blocks.counts, harmonics[rows], variances[rows]) for cycle, rows in every.items()}


def _agreement(counts: IntArray, harmonics: list[FloatArray], variances: list[FloatArray]) -> _Agreement:
    """Agreement from (241,) powers of each harmonic and their variances, and the counts of blocks."""
    variance = np.sum(variances, axis=0)
    enough = (counts >= FEWEST_BLOCKS) & (variance > 0)
    z = np.divide(np.sum(harmonics, axis=0), np.sqrt(variance), out=np.full(N_RATIOS, -np.inf), where=enough)
    return _Agreement(z, np.array(harmonics) / np.maximum(counts, 1) ** 2)


def _block_edges(phase: FloatArray, beats: int) -> tuple[IntArray, IntArray]:
    """First sample of every whole block of so many beats, and the end of the last: (ratios, blocks + 1), (ratios,)."""
    first = np.ceil(RATIOS * phase[0] - 1e-6)
    counts = np.maximum((RATIOS * phase[-1] + 1e-6 - first) // beats, 0).astype(np.int64)
    bounds = (first[:, None] + beats * np.arange(counts.max() + 1)) / RATIOS[:, None]
    return np.searchsorted(phase, bounds - 1e-9), counts


# The place test

MOMENTS = 48  # a beat
TIE = 0.03  # of the range of T: lags that fit as well as the best
PLACE_BLOCK = 4  # beats that are drawn together, at least
N_DRAWS = 200


@dataclass(frozen=True, eq=False)
class PlaceTest:
    """Ranks of the beats among all moments of a take, at every lag: the result of `place_test`.

    Parameters
    ----------
    pattern : BarPattern
        The movement that is expected around a beat.
    ranks : (F, B, U) array
        Rank, between 0 and 1, of each of B beats moved by a lag of u / 48 beat: for the U lags of one cycle of the
        pattern, and for the F places at which the pattern may begin (1 where "one" is known, or the cycle is one beat).
    first : int
        Number of the first of these beats among those of the music.
    reach : float, beats
        Largest lag on either side that can be told from the others: half a beat, or half a cycle where "one" is known.
    """

    pattern: BarPattern
    ranks: FloatArray
    first: int
    reach: float

    @property
    def curve(self) -> FloatArray:
        """T(u), (U,): mean rank of the beats moved by u, with the pattern begun at the place that is best there."""
        return self.ranks.mean(axis=1).max(axis=0)

    @property
    def chance(self) -> float:
        """Chance c, the mean rank at a random lag: 1/2, or more where the best of several places is taken."""
        return 0.5 if len(self.ranks) == 1 else float(self.curve.mean())

    @property
    def harmony_above_chance(self) -> float:
        """H = (T(0) - c) / (1 - c), from -1 to 1: 1 where every beat is the best moment of the take, 0 at chance."""
        return float(_above(self.curve, len(self.ranks)))

    @property
    def p_value(self) -> float:
        """Share of all lags at which the beats rank at least as high as where they are, at lag 0."""
        curve = self.curve
        return float(np.mean(curve >= curve[0] - 1e-12))

    @property
    def lag(self) -> float:
        """The lag, in beats, at which the beats rank highest; positive where the body moves late."""
        return float(_lags(self.curve, self.reach))

    def shares(self, n_beats: int) -> FloatArray:
        """Rank of each of the music's beats, (n_beats,), with the pattern begun at the place that is best at lag 0."""
        return self.shares_at_lags(n_beats)[:, 0]

    def shares_at_lags(self, n_beats: int) -> FloatArray:
        """Rank of each of the music's beats at every lag, (n_beats, U), the pattern begun at the place best there."""
        best = self.ranks.mean(axis=1).argmax(axis=0)
        beats = (np.arange(n_beats) - self.first) % self.ranks.shape[1]
        return self.ranks[best, beats[:, None], np.arange(best.size)]

    def spread(self, *, seed: int = 0, level: float = 0.95) -> tuple[tuple[float, float], tuple[float, float]]:
        """Intervals of H and of the lag (beats) from bar to bar: (low, high) of each.

        Blocks of 4 beats or more are drawn with replacement, 200 times. The intervals say how well the bars of the take
        tell its mean place. They do not say how far single bars lie from it, nor how likely the place is by luck.

        Parameters
        ----------
        seed : int, of the draws
        level : float, share of the draws that lie within an interval

        Returns
        -------
        ((low, high) of H, (low, high) of the lag); NaN with fewer than two blocks
        """
        cycle = self.pattern.beats
        starts = np.arange(0, self.ranks.shape[1], cycle * -(-PLACE_BLOCK // cycle))
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
    """Ranks of the beats among all moments of a movement by their fit to a pattern, at every lag: where in the beat?

    Parameters
    ----------
    signal : ShapeSignal over the span of the beats
    beats : (B,) array, seconds on the signal's time line
    bar_places : (B,) array of int or None
        Place of each beat in its bar. None where unknown: the pattern may then begin on any beat of its cycle.
    pattern : BarPattern
        The movement that is expected around a beat.

    Returns
    -------
    PlaceTest

    Raises
    ------
    ValueError
        If the beats do not hold one whole cycle of the pattern.
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
    origin = 0 if bar_places is None else first_place(bar_places)
    ranks = [_beat_ranks(speed, pattern, first + origin - place) for place in places]
    return PlaceTest(pattern, np.array(ranks), first, 0.5 * (cycle if len(places) == 1 else 1))


def _beat_ranks(speed: FloatArray, pattern: BarPattern, origin: int) -> FloatArray:
    """(B, U) ranks of the beats of a circular speed at every lag within the pattern.

    `origin` is the number of the first beat counted from where the pattern begins.
    """
    places = [moment_ranks(fits) for fits in pattern_fits(speed, pattern, moments=MOMENTS)]
    numbers = np.arange(speed.size // MOMENTS)
    moments = (numbers[:, None] * MOMENTS + np.arange(pattern.beats * MOMENTS)) % speed.size
    return np.array(places)[(numbers + origin)[:, None] % pattern.beats, moments]


def _above(curves: FloatArray, n_readings: int) -> FloatArray:
    """H of curves (..., U)."""
    chance = 0.5 if n_readings == 1 else curves.mean(axis=-1)
    # With several readings chance lies above 1/2, and the worst moment would lie below -1.
    return np.asarray(np.maximum((curves[..., 0] - chance) / (1 - chance), -1.0))


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


# The mean movement through a beat

SMOOTHING = 4  # moments of `MOMENTS` a beat, to either side: a twelfth of a beat


class Course(NamedTuple):
    """The mean signal at 48 moments from one beat to the next, and where it is highest and lowest.

    Parameters
    ----------
    values : (48,) array, the mean signal
    fastest, stillest : float, beats after the beat, from 0 to below 1
    """

    values: FloatArray
    fastest: float
    stillest: float


def beat_course(signal: ShapeSignal, beats: FloatArray) -> Course:
    """The mean of a signal at each of 48 moments of a beat, smoothed over a twelfth of a beat to either side.

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


# All the evidence

LEAST_PULSE = 0.03  # per second: 2 cm/s for an adult
STILL = 8  # beats, two bars
PART, MOST_PARTS = 48, 8  # beats of a part of a take at least, and number of parts at most
LEAST_SWING = 0.02  # metres a second, where fewer than three points have no size to compare with
LEAST_SHARE = 0.1  # of the movement in the room, in 3-D; a picture cannot tell a turning statue from a dancer
CLEAR = 8.0  # z of a tempo that is the body's own: noise reaches 5 to 8, dancers 10 to 47
STEADY = 0.25  # beats: half the width of a steady lag's interval
ON_THE_BEAT = 0.125  # beats
LEAST_POWER = 0.01  # of the strongest rate's: runners at another rate have .0003 at most, dancers on the beat .03 up
LEAST_OF_BAR = 0.2  # the same, once in three beats: 4 or 2 movements there have .08 at most, recorded waltzes .59 up
NAN = float("nan")
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The numbers of a verdict; those that do not exist are NaN.

    Parameters
    ----------
    level : int
        0 cannot tell, 1 no sign that these beats are followed, 2 in time without a steady place in the beat, 3 in time,
        4 on the beat.
    beats : BeatTrack
        The beats of the music.
    pattern : BarPattern or None
        The movement that was told to be meant: the course of a dance, or one of `HOW_PATTERNS`. None where nothing was.
    signal : ShapeSignal or None
        The movement between the first and the last beat. None with fewer than two beats.
    time, place : TimeTest and PlaceTest
        The two tests; None at level 0.
    interval, lag_interval : (float, float)
        95 % intervals of H and of the lag (beats) from bar to bar. They say how well the bars of the take tell their
        mean, and are no evidence against luck.
    has_start : bool
        False where nothing tells at which moment of the song the dance begins. Then no place in the beat is judged.
    """

    level: int
    beats: BeatTrack
    pattern: BarPattern | None = None
    signal: ShapeSignal | None = None
    time: TimeTest | None = None
    place: PlaceTest | None = None
    interval: Interval = (NAN, NAN)
    lag_interval: Interval = (NAN, NAN)
    has_start: bool = True

    @property
    def n_beats(self) -> int:
        """Number of beats that count: those that fall into filler frames of the motion do not."""
        if self.signal is None or self.signal.times.size == 0:
            return len(self.beats)
        return int((np.interp(self.beats.times, self.signal.times, self.signal.valid) >= 0.5).sum())

    @cached_property
    def n_still(self) -> int:
        """Number of beats in stretches of 8 or more at which the body stands still, or moves evenly."""
        return still_beats(self.signal, self.beats.times) if self.signal and self.time else 0

    @cached_property
    def other_parts(self) -> list[Interval]:
        """Parts of the take, (start, end) in seconds, of which the time test says the contrary of what it says of all.

        A take of 96 beats or more is tested in up to eight equal parts of 48 beats or more. Where the whole is not in
        time, the parts that are in time are returned, each by itself: their p is at most .05 over the number of parts.
        Where the whole is in time, those that move at another tempo are returned, neighbours as one: p is above .05,
        the tempo of their own is clear, and the body does not stand still on most beats.
        """
        parts, count = list[Interval](), min(len(self.beats) // PART, MOST_PARTS)
        if self.signal is None or self.time is None or count < 2:
            return parts
        for first, last in pairwise(np.linspace(0, len(self.beats) - 1, count + 1).round().astype(int)):
            beats = self.beats.times[first : last + 1]
            # A sample more at least on either side.
            kept = slice(*np.maximum(np.searchsorted(self.signal.times, beats[[0, -1]]) + np.array([-2, 2]), 0))
            cut = {name: getattr(self.signal, name)[kept] for name in ("times", "values", "valid")}
            part = replace(self.signal, **cut)
            test = time_test(part, beats, cycles=tuple(self.time.cycles))
            is_out_of_time = test.p_value > ALPHA and test.best >= CLEAR and 2 * still_beats(part, beats) < beats.size
            is_other = is_out_of_time if self.level > 1 else test.p_value <= ALPHA / count
            if is_other and self.level > 1 and parts and parts[-1][1] == beats[0]:
                parts[-1] = parts[-1][0], float(beats[-1])
            elif is_other:
                parts.append((float(beats[0]), float(beats[-1])))
        return parts

    @property
    def is_placed(self) -> bool:
        """True where the place in the beat can be judged: the pattern was told, or the movement is on the beat.

        False where it is not known when the dance begins.
        """
        return self.has_start and self.place is not None and (self.pattern is not None or self.level == 4)

    @property
    def harmony_above_chance(self) -> float:
        """H of the place test, from -1 to 1, 0 at chance; NaN where no place can be judged (`is_placed`)."""
        return self.place.harmony_above_chance if self.place and self.is_placed else NAN

    @property
    def place_harmony(self) -> float:
        """H of the place test also where no place can be judged, for means over many dances; NaN at level 0."""
        return self.place.harmony_above_chance if self.place else NAN

    @property
    def harmony_interval(self) -> Interval:
        """95 % interval of H from bar to bar; NaN where no place can be judged."""
        return self.interval if self.is_placed else (NAN, NAN)

    @property
    def p_time(self) -> float:
        """p-value of the time test: at .05 or less the movement is in time."""
        return self.time.p_value if self.time else NAN

    @property
    def p_place(self) -> float:
        """p-value of the place test: the share of lags that do as well. Level 4 asks for a quarter at most."""
        return self.place.p_value if self.place else NAN

    @property
    def p_value(self) -> float:
        """p-value of H; NaN where no place can be judged."""
        return self.p_harmony if self.is_placed else NAN

    @property
    def p_harmony(self) -> float:
        """The larger of the p-values of both tests, since harmony needs tempo and place: that of `place_harmony`."""
        return max(self.p_time, self.p_place)

    @cached_property
    def tempo(self) -> float:
        """Tempo of the music, beats per minute."""
        return self.beats.tempo

    @property
    def own_tempo(self) -> float:
        """Tempo of the movement in beats per minute; NaN where it has no clear one."""
        return self.tempo * self.time.own_ratio if self.time and self.time.best >= CLEAR else NAN

    @property
    def lag(self) -> float:
        """The lag in beats: how much later than expected the body moves; early is negative."""
        return self.place.lag if self.place else NAN

    @property
    def lag_s(self) -> float:
        """The lag in seconds; early is negative."""
        return self.lag * 60 / self.tempo

    @property
    def is_opposite(self) -> bool:
        """True where the lag is about half a beat, so that late and early are the same, and no bar tells them apart."""
        return self.place is not None and self.place.reach <= 0.5 and abs(self.lag) > 0.5 - ON_THE_BEAT

    @property
    def moves_in_half_time(self) -> bool:
        """True where nothing was told, and the movement recurs once in two beats only (half time)."""
        in_time = self.level in (2, 3) and self.pattern is None and not self.has_own_rate
        return in_time and self.time is not None and self.time.rate == Fraction(1, 2)

    @property
    def reading(self) -> str:
        """Name of the movement that the lag is measured from; "" at level 0.

        It is a dance, "rest", "hit" or "half time", or "pattern" for any other.
        """
        if self.place is None:
            return ""
        pattern = self.place.pattern
        return pattern.dance or (pattern.source if pattern.source in HOW_PATTERNS else "pattern")

    @property
    def has_own_rate(self) -> bool:
        """True where the movement has the rate of the pattern, not only another one, as of 4 movements in 3 beats."""
        time, place = self.time, self.place
        return bool(time and place and (self.pattern or has_bar(time)) and has_rate(time, place.pattern))

    @cached_property
    def course(self) -> Course | None:
        """The mean movement from one beat to the next (`beat_course`); None at level 0."""
        return beat_course(self.signal, self.beats.times) if self.signal and self.time else None

    @cached_property
    def floor(self) -> str:
        """The reason why there is too little movement to judge; "" where there is enough, or no signal."""
        return floor(self.signal) if self.signal else ""

    @property
    def keeps_the_beat(self) -> bool:
        """True where "one" is known, and the lag is steady if it is looked for within half a beat, not in the bar."""
        if self.place is None or self.place.reach <= 0.5:
            return False
        low, high = replace(self.place, reach=0.5).spread()[1]
        return high - low <= 2 * STEADY

    @property
    def is_hit(self) -> bool:
        """True where the movement is in time and fastest on the beat, to a sixteenth of a beat.

        A body that arrives on the beat in a tenth of a second and then stands is fastest an eighth of a beat before it.
        """
        course = self.course if self.level > 2 and self.has_own_rate else None
        return course is not None and min(course.fastest, 1 - course.fastest) <= ON_THE_BEAT / 2


def floor(signal: ShapeSignal) -> str:
    """The reason why there is too little movement to judge; "" where there is enough."""
    if signal.dimensions == 3 and signal.share < LEAST_SHARE:
        return "you only turn and travel"
    # Fewer than three points in metres have no shape, and may have no size.
    is_point = signal.dimensions == 0 and signal.axes == 3
    is_still = signal.pulse < LEAST_PULSE or (is_point and signal.swing < LEAST_SWING)
    return "too little movement inside the body" if is_still else ""


def still_beats(signal: ShapeSignal, beats: FloatArray) -> int:
    """Number of beats in stretches of `STILL` or more, each with less pulse until the next than the floor asks for."""
    parts = np.split(np.where(signal.valid, signal.pulse * signal.values, NAN), np.searchsorted(signal.times, beats))
    is_still = [bool(part.size and part.std() < LEAST_PULSE) for part in parts[1:-1]]
    return sum(length for still, run in groupby(is_still) if still and (length := len(list(run))) >= STILL)


def has_rate(time: TimeTest, pattern: BarPattern) -> bool:
    """True where some of the power on which the blocks agree is at the rates of the pattern."""
    rates = {Fraction(h, pattern.beats) for h in range(1, len(pattern.cosines) + 1)}
    return sum(time.rates.get(rate, 0.0) for rate in rates) >= LEAST_POWER * max(time.rates.values())


def has_bar(time: TimeTest) -> bool:
    """False for what recurs every three beats and does not move once in them, as a waltz does: 4 times, or twice."""
    return time.metre != 3 or time.rates[Fraction(1, 3)] >= LEAST_OF_BAR * max(time.rates.values())
