"""The time test: does a movement keep the tempo of these beats better than other tempi?

Beats turned round the end of a clip prove nothing about periodic movement: whatever recurs once a beat fits any phase.
The null here is another tempo. For a cycle of beats the movement is cut into blocks, each block gives a Fourier vector
a_b for every harmonic h of the cycle, and what counts is how well *different* blocks agree:
``T = sum_h |sum_b a_bh|^2 - sum_bh |a_bh|^2``, in standard deviations of blocks with random phases. No pattern, no lag
and no sign is assumed: rests, hits, half time and double time agree alike. The same is asked of 240 grids whose tempi
lie between .6 and 1.67 times that of the beats.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray, IntArray

SAMPLED_AT = 25.0  # hertz: dance holds little above 3 Hz
SLOWEST = 0.6  # ratio of the slowest grid; the fastest is 1 / SLOWEST
N_RATIOS = 241  # log-even, the beats' own tempo in the middle
BLOCK = 4  # beats in a block, at least
FEWEST_BLOCKS = 3
FEWEST_BEATS = 16  # below which nothing is judged: even a dancer in time passes in one take of six
ALPHA = 0.05
BESIDE = 5  # grids, 2 %
LEAST_SPREAD = 0.3  # of the mean SD of the blocks: a block that nearly stands still is not blown up
STEP = -2 * np.log(SLOWEST) / (N_RATIOS - 1)
RATIOS: FloatArray = np.exp(np.linspace(np.log(SLOWEST), -np.log(SLOWEST), N_RATIOS))


@dataclass(frozen=True, eq=False)
class TimeTest:
    """Agreement of the movements from block to block on grids of many tempi.

    Parameters
    ----------
    z : (241,) array, agreement on the grids of `RATIOS` times the beats' tempo; -inf where there are too few blocks
    power : (241,) array, power of one movement a beat of each grid, agreed on by the blocks
    p_value : float, share of the grids, the beats' own counted, that agree at least as well as the beats' own
    rates : dict, movements a beat -> the power on which the blocks agree, on the beats' own grid
    cycles : dict, beats after which a movement may recur -> agreement on the beats' own grid
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
        """Tempo of the movement over that of the beats, between grids by a parabola; above 1 is faster than the music.

        In time with the beats it is the peak beside 1. Else grids of related tempi (2 : 1, 3 : 2) agree as well as the
        movement's own, since z does not see how large a harmonic is; the power does.
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
    """The test of a movement against beats.

    Parameters
    ----------
    signal : ShapeSignal over the span of the beats
    beats : (B,) array, seconds on the signal's time line, two at least
    cycles : tuple of int
        Beats after which movements may recur; the best counts. One beat and the bar's cycle where the meter is known.
    """
    stride = max(1, round(1 / (SAMPLED_AT * float(np.diff(signal.times[:2])[0]))))
    phase = np.interp(signal.times[::stride], beats, np.arange(beats.size, dtype=np.float64))
    weights = np.gradient(phase) * signal.valid[::stride]
    grids = [_agreement(phase, weights, signal.values[::stride], cycle) for cycle in cycles]
    z: FloatArray = np.max([grid.z for grid in grids], axis=0)
    own = z[N_RATIOS // 2]
    p = float(np.mean(z >= own)) if np.isfinite(own) else 1.0
    rates = {
        Fraction(h, cycle): float(row[N_RATIOS // 2])
        for cycle, grid in zip(cycles, grids, strict=True)
        for h, row in enumerate(grid.harmonics, 1)
    }
    owns = {cycle: float(grid.z[N_RATIOS // 2]) for cycle, grid in zip(cycles, grids, strict=True)}
    return TimeTest(z, grids[0].harmonics[cycles[0] - 1], p, rates, owns)


class _Agreement(NamedTuple):
    """z of every ratio, (241,), and the agreed power of each harmonic there, (2 C, 241)."""

    z: FloatArray
    harmonics: FloatArray


def _agreement(phase: FloatArray, weights: FloatArray, values: FloatArray, cycle: int) -> _Agreement:
    """The agreement of blocks on every grid, for movements that recur after `cycle` beats."""
    edges, counts = _block_edges(phase, cycle * -(-BLOCK // cycle))
    is_block = np.arange(edges.shape[1] - 1) < counts[:, None]
    # One row of samples a ratio, and a 0 behind it, where blocks end that do not exist.
    rows = np.arange(N_RATIOS)[:, None]
    places = (edges + rows * (phase.size + 1)).ravel()

    def sums(samples: NDArray[Any]) -> NDArray[Any]:
        """Sums over the blocks, (ratios, blocks), of (ratios, T + 1) samples."""
        return np.where(is_block, np.add.reduceat(samples.ravel(), places).reshape(edges.shape)[:, :-1], 0)

    deviations = _deviations(phase, weights, values, edges, sums)
    turn = np.zeros(deviations.shape, np.complex128)
    turn[:, :-1] = np.exp(-2j * np.pi / cycle * RATIOS[:, None] * phase)
    wave, variance, harmonics = deviations.astype(np.complex128), np.zeros(N_RATIOS), []
    for _ in range(2 * cycle):
        wave *= turn
        vectors = sums(wave)
        power = np.square(vectors.real) + np.square(vectors.imag)
        harmonics.append(np.square(np.abs(vectors.sum(axis=1))) - power.sum(axis=1))
        variance += np.square(power.sum(axis=1)) - np.square(power).sum(axis=1)
    enough = (counts >= FEWEST_BLOCKS) & (variance > 0)
    z = np.divide(np.sum(harmonics, axis=0), np.sqrt(variance), out=np.full(N_RATIOS, -np.inf), where=enough)
    return _Agreement(z, np.array(harmonics) / np.maximum(counts, 1) ** 2)


def _deviations(
    phase: FloatArray,
    weights: FloatArray,
    values: FloatArray,
    edges: IntArray,
    sums: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """(ratios, T + 1) weighted deviations from the mean of their block, over its weight and spread."""
    ones = np.ones((N_RATIOS, 1))
    mass, first, second = (sums(np.append(weights * power, 0.0) * ones) for power in (1.0, values, np.square(values)))
    mass = np.where(mass > 0, mass, 1.0)
    mean = first / mass
    spread = np.sqrt(np.maximum(second / mass - mean**2, 0.0))
    typical = spread.sum(axis=1, keepdims=True) / np.maximum((spread > 0).sum(axis=1, keepdims=True), 1)
    scale = mass * np.maximum(spread, LEAST_SPREAD * typical)
    block = np.zeros((N_RATIOS, phase.size + 1), np.int64)
    np.add.at(block, (np.arange(N_RATIOS)[:, None], edges), 1)
    block = np.clip(np.cumsum(block, axis=1) - 1, 0, mean.shape[1] - 1)
    pick = partial(np.take_along_axis, indices=block, axis=1)
    deviations = (np.append(values, 0.0) - pick(mean)) * np.append(weights, 0.0)
    return np.divide(deviations, pick(scale), out=np.zeros_like(deviations), where=pick(scale) > 0)


def _block_edges(phase: FloatArray, beats: int) -> tuple[IntArray, IntArray]:
    """First sample of every whole block of so many beats, and the end of the last: (ratios, blocks + 1), (ratios,)."""
    first = np.ceil(RATIOS * phase[0] - 1e-6)
    counts = np.maximum((RATIOS * phase[-1] + 1e-6 - first) // beats, 0).astype(np.int64)
    bounds = (first[:, None] + beats * np.arange(counts.max() + 1)) / RATIOS[:, None]
    return np.searchsorted(phase, bounds - 1e-9), counts
