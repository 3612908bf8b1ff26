"""Systems compared song by song: means, intervals over songs, paired differences, and ranks that are more than luck."""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import ndtr, stdtrit

from harmolab.lab.evaluate.measured import MEASURES, Measure
from harmolab.lab.evaluate.protocols import BETTER
from harmolab.lab.evaluate.sets import FEATURES, SETS
from harmolab.significance import LEVEL, bootstrap_interval, mean_interval
from harmolab.types import FloatArray

RESAMPLES = 4000
FEWEST_SONGS = 6  # of five, all differences have one sign in one case of sixteen, by luck
BESIDE = ("difference", "difference_low", "difference_high", "common")  # columns of a difference from the base
Interval = Callable[[FloatArray], tuple[float, float]]


def song_interval(values: FloatArray, *, count: int = RESAMPLES, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the mean of (n,) values of n songs, by resampling the songs.

    The percentiles are those of the expanded interval (Hesterberg 2015): of few songs the plain one is too narrow, by
    what Student's t is wider than the normal distribution and by n / (n - 1) in the variance.
    Resampling reaches from the least value to the largest at most: of two songs the interval holds the mean in half of
    all cases, of three in 75 %, of four in 88 %, of five in 94 % at most.

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


def training_interval(values: FloatArray) -> tuple[float, float]:
    """95 % interval of the mean of (n,) values of n trainings, by Student's t; both NaN with fewer than two."""
    return mean_interval(values)[1:]


def summary(
    table: pd.DataFrame,
    row: str = "system",
    *,
    by: str | Sequence[str] = (),
    over: str = "song",
    within: str | Sequence[str] = ("seed",),
    base: str = "",
    interval: Interval = song_interval,
    fewest: int = FEWEST_SONGS,
) -> pd.DataFrame:
    """Sum up a long table of dances: means with 95 % intervals, paired differences, and ranks of systems.

    Parameters
    ----------
    table : DataFrame
        As `measure_dances` returns it: with the columns `row`, `by`, `over` and `within`, "measure" and "value".
    row : str
        Column whose values are compared, such as "system".
    by : str or sequence of str
        Columns whose values are kept apart, such as a corpus or a dance.
    over : str
        Column of the things that the interval is over: "song", or "training".
    within : str or sequence of str
        Columns over which the mean is taken before: of a song danced with several seeds, the mean over the seeds is one
        value. Of several columns the last is averaged first.
    base : str
        Value of `row` with which the others are compared; no differences when left out.
    interval : function of (n,) values to (low, high)
        `harmolab.lab.evaluate.summary.song_interval` (resamples songs), `training_interval` (Student's t), or another.
    fewest : int
        Number of songs (or trainings) in common below which no rank is given; 6 when left out.

    Returns
    -------
    DataFrame
        Columns of `by`, then `row`, "measure", "mean", "low", "high" and "n" (songs or trainings). With a base also
        "difference", "difference_low", "difference_high" and "common", paired by song or training. "rank" is one more
        than the number of rows that are better beyond luck, which means that the interval of the paired difference
        excludes 0. It is missing for a row that differs from no other in this way, and for measures without a better
        side.

    Raises
    ------
    ValueError
        If `table` is no DataFrame, or has no such columns, or no value of `row` is called `base`.

    Examples
    --------
    >>> songs = range(8)
    >>> lines = [("ours", song, "", "harmony", 0.5 + song % 2 / 10) for song in songs]
    >>> lines += [("theirs", song, "", "harmony", 0.1 + song % 2 / 10) for song in songs]
    >>> table = pd.DataFrame(lines, columns=["system", "song", "seed", "measure", "value"])
    >>> summary(table, base="theirs")[["system", "mean", "difference", "common", "rank"]].round(2)
       system  mean  difference  common  rank
    0    ours  0.55         0.4     8.0     1
    1  theirs  0.15         NaN     NaN     2
    """
    by, within = ([names] if isinstance(names, str) else names for names in (by, within))
    needed = [*by, row, over, *within, "measure", "value"]
    if missing := [name for name in needed if name not in getattr(table, "columns", ())]:
        raise ValueError(f"a DataFrame with a column {' and '.join(missing)} is needed, as of measure_dances")
    if base and base not in set(table[row]):
        raise ValueError(f"no {row} is called {base!r}; there are {', '.join(sorted(map(str, set(table[row]))))}")
    keys = [*by, "measure"]
    levels = [*keys, row, over, *within]
    # Names that are "" are NaN where the table was read back from a file, and those of sets of dances have no song.
    table = table.assign(**{name: table[name].astype(object).where(table[name].notna(), "") for name in levels})
    values = table.groupby(levels, sort=False)["value"].mean()
    for _ in within:
        values = values.groupby(levels := levels[:-1], sort=False).mean()
    lines: list[dict[str, Any]] = []
    for names, part in values.reset_index().groupby(keys, sort=False):
        about: dict[str, Any] = dict(zip(keys, names, strict=True))
        units = part.set_index([row, over])[["value"]].set_axis([about["measure"]], axis=1)
        order = sorted(dict.fromkeys(part[row]), key=lambda name: name == base)  # the base is the second of each pair
        differences = system_differences(units, order, interval=interval)
        places = ranks(differences, order, about["measure"], better=measure_of(about["measure"]).better, fewest=fewest)
        beside = {one.a: dict(zip(BESIDE, one[3:], strict=True)) for one in differences if base and one.b == base}
        for (name, _), mean in system_means(units, interval=interval).items():
            line = about | {row: name} | dict(zip(("mean", "low", "high", "n"), mean, strict=True))
            lines.append(line | beside.get(name, {}) | {"rank": places.get(name)})
    columns = [*by, row, "measure", "mean", "low", "high", "n", *(BESIDE if base else ()), "rank"]
    return pd.DataFrame(lines, columns=columns).astype({"rank": "Int64"})


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
        return self.is_clear_over(FEWEST_SONGS)

    def is_clear_over(self, fewest: int) -> bool:
        """True where the interval excludes 0, over so many songs at least."""
        return self.songs >= fewest and (self.low > 0 or self.high < 0)


def _mean(values: "pd.Series[float]", interval: Interval) -> Mean | None:
    """Mean of the values that there are; None of nothing."""
    numbers = np.asarray(values.dropna(), np.float64)
    return Mean(float(numbers.mean()), *interval(numbers), numbers.size) if numbers.size else None


def system_means(songs: pd.DataFrame, *, interval: Interval = song_interval) -> dict[tuple[str, str], Mean]:
    """(system, measure) -> its mean; what no song has is left out.

    Parameters
    ----------
    songs : DataFrame with the index system, song, and a column for each measure: `Collected.song_means`
    interval : as in `summary`
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
    interval : as in `summary`
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


def ranks(
    differences: Iterable[Difference], systems: Iterable[str], measure: str, *, better: int, fewest: int = FEWEST_SONGS
) -> dict[str, int]:
    """Rank of the systems by a measure: one more than the number of systems that are better beyond luck.

    Better beyond luck: the paired difference is clear over so many songs. A system that differs from no other one in
    this way has no rank, and is left out.

    Parameters
    ----------
    differences : of `system_differences`
    systems : names that are ranked
    measure : name of the measure
    better : 1 where more is better, -1 where less is, 0 for no ranks at all
    fewest : songs in common that a rank needs
    """
    names = set(systems)
    beaten: dict[str, list[str]] = {}
    for one in differences:
        if better and one.measure == measure and one.is_clear_over(fewest) and {one.a, one.b} <= names:
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
