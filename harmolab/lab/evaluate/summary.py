"""Systems compared song by song: means, intervals over songs, paired differences, and ranks that are more than luck."""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import ndtr, stdtrit

from harmolab.lab.evaluate.measured import MEASURES, Measure
from harmolab.lab.evaluate.protocols import BETTER
from harmolab.lab.evaluate.sets import FEATURES, SETS
from harmolab.significance import LEVEL, bootstrap_interval
from harmolab.types import FloatArray

RESAMPLES = 4000
FEWEST_SONGS = 6  # of five, all differences have one sign in one case of sixteen, by luck
Interval = Callable[[FloatArray], tuple[float, float]]


def song_interval(values: FloatArray, *, count: int = RESAMPLES, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the mean of (n,) values of n songs, by resampling the songs.

    The percentiles are those of the expanded interval (Hesterberg 2015): of few songs the plain one is too narrow, by
    what Student's t is wider than the normal distribution and by n / (n - 1) in the variance.
    Resampling reaches from the least value to the largest at most: of two songs the interval holds the mean in half of
    all cases, of three in 75 %, of four in 88 %, of five in 94 % at most. Of values that are all equal, as shares of 0
    in every song, it has no width; of n songs the true share may then lie up to ``1 - 0.025 ** (1 / n)`` away.

    Returns
    -------
    (low, high); both NaN with fewer than two songs

    Examples
    --------
    >>> song_interval(np.array([0.0, 1.0]))
    (0.0, 1.0)
    """
    n = len(values)
    if n < 2:
        return math.nan, math.nan
    reach = math.sqrt(n / (n - 1)) * float(stdtrit(n - 1, (1 + LEVEL) / 2))
    return bootstrap_interval(values, count=count, seed=seed, level=1 - 2 * float(ndtr(-reach)))


class Mean(NamedTuple):
    """Mean of a measure over the songs of a system, its interval (NaN for none), and the number of songs."""

    mean: float
    low: float
    high: float
    songs: int


class Difference(NamedTuple):
    """Mean of the differences a - b of a measure over the songs of two systems, its interval, and the songs."""

    measure: str
    a: str
    b: str
    mean: float
    low: float
    high: float
    songs: int

    @property
    def is_clear(self) -> bool:
        """True where the interval excludes 0, over `FEWEST_SONGS` songs at least."""
        return self.songs >= FEWEST_SONGS and (self.low > 0 or self.high < 0)


def _mean(values: "pd.Series[float]", interval: Interval) -> Mean | None:
    """Mean of the values that there are; None of nothing."""
    numbers = np.asarray(values.dropna(), np.float64)
    return Mean(float(numbers.mean()), *interval(numbers), numbers.size) if numbers.size else None


def system_means(songs: pd.DataFrame, *, interval: Interval = song_interval) -> dict[tuple[str, str], Mean]:
    """(system, measure) -> its mean; what no song has is left out.

    Parameters
    ----------
    songs : DataFrame with the index system, song, and a column for each measure, as `Collected.song_means`
    interval : function of (n,) values to (low, high)
    """
    tables = ((measure, songs[measure].unstack(0)) for measure in map(str, songs.columns))
    means = {(system, measure): _mean(table[system], interval) for measure, table in tables for system in table.columns}
    return {key: mean for key, mean in means.items() if mean is not None}


def dance_means(
    sums: pd.DataFrame, counts: pd.DataFrame, measures: Iterable[str], *, interval: Interval = song_interval
) -> dict[tuple[str, str], Mean]:
    """(system, measure) -> its mean over dances, as published codes take it, however many there are to a song.

    The interval is over songs all the same: of values whose mean is that of the dances, each song's moved from it by
    what its dances move it (the linearised ratio of sum and number).

    Parameters
    ----------
    sums, counts : DataFrames as of `Collected`
    measures : columns of both
    interval : function of (n,) values to (low, high)
    """
    means = {}
    for measure in measures:
        songs = pd.DataFrame({"sum": sums[measure], "n": counts[measure]}).groupby(["system", "song"]).sum()
        for system, each in songs[songs["n"] > 0].groupby("system"):
            mean = each["sum"].sum() / each["n"].sum()
            moved = mean + len(each) * (each["sum"] - each["n"] * mean) / each["n"].sum()
            means[str(system), measure] = Mean(float(mean), *interval(moved.to_numpy()), len(each))
    return means


def system_differences(
    songs: pd.DataFrame, systems: Sequence[str], *, interval: Interval = song_interval
) -> list[Difference]:
    """The differences of every measure over the songs that two systems both danced to.

    Parameters are those of `system_means`; `systems` are those that are compared, each with each.
    """
    differences = []
    for measure in map(str, songs.columns):
        table = songs[measure].unstack(0)  # NaN where a system has no dance to a song
        for first, second in itertools.combinations(systems, 2):
            if (mean := _mean(table[first] - table[second], interval)) is not None:
                differences.append(Difference(measure, first, second, *mean))
    return differences


def ranks(differences: Iterable[Difference], systems: Iterable[str], measure: str, *, better: int) -> dict[str, int]:
    """Rank of the systems by a measure: one more than the number of systems that are better beyond luck.

    Better beyond luck: the paired difference is clear. A system that differs from no other one in this way has no
    rank, and is left out.

    Parameters
    ----------
    differences : of `system_differences`
    systems : names that are ranked
    measure : name of the measure
    better : 1 where more is better, -1 where less is, 0 for no ranks at all
    """
    names = set(systems)
    beaten: dict[str, list[str]] = {}
    for one in differences:
        if better and one.measure == measure and one.is_clear and {one.a, one.b} <= names:
            winner, loser = (one.a, one.b) if (one.low > 0) == (better > 0) else (one.b, one.a)
            beaten.setdefault(loser, []).append(winner)
            beaten.setdefault(winner, [])
    return {name: len(winners) + 1 for name, winners in beaten.items()}


def measure_of(name: str) -> Measure:
    """Words and direction of a column of the table; a column of a protocol is called as there."""
    kind, _, features = name.partition("_")
    if kind in SETS and features in FEATURES:
        return Measure(f"{SETS[kind]}, {features} features", -1 if kind == "fid" else 0)
    return MEASURES.get(name, Measure(name, BETTER.get(name.partition(" ")[2], 0)))
