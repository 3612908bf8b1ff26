"""Early and late in numbers: the offset of each visual beat from the music, its means, its change, its drift.

Visual beats are read as places in the beat: a phase from 0 to 1 between two music beats. A dancer who makes two
movements a beat has them at two places, so phases are first folded onto the grid that the dancer keeps. Intervals are
Student's t on the offsets in time. Neighbouring beats resemble each other: that is the least the uncertainty can be.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import stats

from harmolab.bar_pattern import beat_positions
from harmolab.significance import mean_interval
from harmolab.types import BeatTrack, FloatArray

SMALLEST = 0.02  # seconds; smaller offsets are not noticed
LINE_SHARE = 0.9  # a line fits better where it leaves less than this share of the squares that a step leaves
FASTEST_CLOCK = 0.03  # share by which the clock of a recording may be wrong
GRIDS = (1, 2)  # movements that fit on one beat
Interval = tuple[float, float]


class MeanOffset(NamedTuple):
    """Mean offset from the music (seconds, late is positive) between two times, with its 95 % interval."""

    start: float
    end: float
    mean: float
    interval: Interval


@dataclass(frozen=True, eq=False)
class Timing:
    """Offset of each movement from the music.

    Parameters
    ----------
    times, offsets : (M,) arrays, seconds
        Of each visual beat: where it is, and how late after its place on the grid.
    grid : int, places on one beat (2: beats and half beats)
    p_value : float
        Of the Rayleigh test that movements fall anywhere in the beat, times the number of clocks tried.
    """

    times: FloatArray
    offsets: FloatArray
    grid: int
    p_value: float


def beat_timing(music: BeatTrack, visual: BeatTrack, *, lag: float = 0.0) -> Timing:
    """Offset of each visual beat from the grid of beats, or of half beats, that the dancer keeps.

    A clock that runs wrong moves the places evenly: clocks up to 3 % off are tried, the one at which the movements
    gather most is taken, and offsets are counted on from there without jumps.

    Parameters
    ----------
    music, visual : BeatTrack on one time line, two and one beats at least
    lag : float, seconds, how late a movement is expected
    """
    times = visual.times - lag
    positions = beat_positions(times, music) - (0 if music.bar_places is None else music.bar_places[0])
    period = float(np.polyfit(np.arange(len(music)), music.times, 1)[0])
    centre = positions.mean()
    steps = int(np.ceil(FASTEST_CLOCK * np.ptp(positions) * 10)) + 1
    slopes = np.linspace(-FASTEST_CLOCK, FASTEST_CLOCK, 2 * steps + 1)
    n_clocks = 1 + 2 * FASTEST_CLOCK * np.ptp(positions)  # clocks that differ
    best = None
    for grid in GRIDS:
        phases = grid * (positions - slopes[:, None] * (positions - centre))
        resultants = np.exp(2j * np.pi * phases).mean(axis=1)
        top = int(np.abs(resultants).argmax())
        length = float(np.abs(resultants[top]))
        if best is None or length > best[0] + 0.1:  # half beats only where they explain clearly more
            place = np.angle(resultants[top]) / (2 * np.pi)
            rest = (phases[top] - place + 0.5) % 1 - 0.5
            # The middle of the clip lies within half a place of the grid; the clock's part is put back.
            best = length, grid, (rest + place) / grid + slopes[top] * (positions - centre)
    length, grid, lateness = best  # type: ignore[misc]  # GRIDS is not empty
    p = min(1.0, n_clocks * len(GRIDS) * _rayleigh(length, times.size))
    return Timing(visual.times, lateness * period, grid, p)


def _rayleigh(length: float, count: int) -> float:
    """p-value of the mean resultant length of `count` phases (Zar's approximation)."""
    total = count * length
    return float(np.exp(np.sqrt(1 + 4 * count + 4 * (count**2 - total**2)) - (1 + 2 * count)))


def half_means(timing: Timing, duration: float) -> tuple[MeanOffset, ...]:
    """Mean offsets of the first and of the second half; those with fewer than three movements are left out."""
    halves = []
    for start, end in ((0.0, duration / 2), (duration / 2, duration)):
        inside = (timing.times >= start) & (timing.times < end)
        if inside.sum() >= 3:
            mean, low, high = mean_interval(timing.offsets[inside])
            halves.append(MeanOffset(start, end, mean, (low, high)))
    return tuple(halves)


def is_clear(value: float, interval: Interval) -> bool:
    """True where an interval excludes zero, and the value is large enough to notice."""
    return (interval[0] > 0 or interval[1] < 0) and abs(value) >= SMALLEST


def half_difference(timing: Timing, duration: float) -> tuple[float, Interval]:
    """Seconds by which the second half is later than the first, and the 95 % interval (Welch)."""
    second = timing.times >= duration / 2
    early, late = timing.offsets[~second], timing.offsets[second]
    spread = float(np.hypot(early.std(ddof=1) / np.sqrt(early.size), late.std(ddof=1) / np.sqrt(late.size)))
    reach = float(stats.t.ppf(0.975, min(early.size, late.size) - 1)) * spread
    change = float(late.mean() - early.mean())
    return change, (change - reach, change + reach)


def drift(timing: Timing) -> tuple[float, Interval]:
    """Seconds later in each second, by least squares, with Student's interval."""
    line = stats.linregress(timing.times, timing.offsets)
    reach = float(stats.t.ppf(0.975, timing.times.size - 2) * line.stderr)
    return float(line.slope), (float(line.slope) - reach, float(line.slope) + reach)


def line_fits_better(timing: Timing, duration: float) -> bool:
    """True where a straight line leaves a tenth less of the offsets unexplained than a step in the middle."""
    second = timing.times >= duration / 2
    step = np.where(second, timing.offsets[second].mean(), timing.offsets[~second].mean())
    line = np.polyval(np.polyfit(timing.times, timing.offsets, 1), timing.times)
    return bool(np.square(timing.offsets - line).sum() < LINE_SHARE * np.square(timing.offsets - step).sum())
