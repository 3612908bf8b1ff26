"""Systems compared song by song: means, intervals over songs, paired differences, and ranks that are more than luck."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from scipy.special import ndtr, stdtrit

from harmolab.lab.evaluate.rows import MEASURES, Measure
from harmolab.significance import LEVEL, bootstrap_interval
from harmolab.types import FloatArray

RESAMPLES = 4000
FEWEST_SONGS = 6  # of five, all differences have one sign in one case of sixteen, by luck


def song_interval(values: FloatArray, *, count: int = RESAMPLES, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the mean of (n,) values of n songs, by resampling the songs.

    The percentiles are those of the expanded interval (Hesterberg 2015): of few songs the plain one is too narrow, by
    what Student's t is wider than the normal distribution and by n / (n - 1) in the variance.

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


def system_means(songs: pd.DataFrame, *, count: int = RESAMPLES, seed: int = 0) -> pd.DataFrame:
    """Mean, low, high and number of songs of every system and measure.

    Parameters
    ----------
    songs : DataFrame with the index system, song, and a column for each measure: `Collected.song_means`
    count, seed : of the resampling
    """
    rows = []
    for system, table in songs.groupby(level="system", sort=False):
        for measure in songs.columns:
            values = table[measure].dropna().to_numpy(np.float64)
            if values.size:
                low, high = song_interval(values, count=count, seed=seed)
                about = {"system": system, "measure": measure, "mean": float(values.mean())}
                rows.append({**about, "low": low, "high": high, "songs": values.size})
    return pd.DataFrame(rows, columns=["system", "measure", "mean", "low", "high", "songs"])


def system_differences(
    songs: pd.DataFrame, systems: Sequence[str], *, count: int = RESAMPLES, seed: int = 0
) -> pd.DataFrame:
    """Mean, low, high and number of songs of the differences a - b over the songs that both systems danced to.

    Parameters are those of `system_means`; `systems` are those that are compared, each with each.
    """
    rows = []
    for first, second in itertools.combinations(systems, 2):
        differences = songs.loc[first] - songs.loc[second]  # aligned by song; NaN where one of them lacks it
        for measure in songs.columns:
            values = differences[measure].dropna().to_numpy(np.float64)
            if values.size:
                low, high = song_interval(values, count=count, seed=seed)
                about = {"measure": measure, "a": first, "b": second, "mean": float(values.mean())}
                rows.append({**about, "low": low, "high": high, "songs": values.size})
    return pd.DataFrame(rows, columns=["measure", "a", "b", "mean", "low", "high", "songs"])


def ranks(differences: pd.DataFrame, systems: Iterable[str], measure: str, *, better: int) -> dict[str, int]:
    """Rank of the systems by a measure: one more than the number of systems that are better beyond luck.

    Better beyond luck: the interval of the paired difference excludes 0, over `FEWEST_SONGS` songs at least. A system
    that differs from no other one in this way has no rank, and is left out.

    Parameters
    ----------
    differences : DataFrame of `system_differences`
    systems : names that are ranked
    measure : name of the measure
    better : 1 where more is better, -1 where less is, 0 for no ranks at all
    """
    names = set(systems)
    rows = differences[(differences["measure"] == measure) & (differences["songs"] >= FEWEST_SONGS)]
    beaten: dict[str, list[str]] = {}
    for row in rows.itertuples():
        if better and {row.a, row.b} <= names and (row.low > 0 or row.high < 0):
            winner, loser = (row.a, row.b) if (row.low > 0) == (better > 0) else (row.b, row.a)
            beaten.setdefault(loser, []).append(winner)
            beaten.setdefault(winner, [])
    return {name: len(winners) + 1 for name, winners in beaten.items()}


def measure_of(name: str) -> Measure:
    """Words and direction of a column; a column of a protocol is called as there, and has no direction."""
    return MEASURES.get(name, Measure(name, 0))
