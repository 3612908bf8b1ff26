"""Statistics of a table too long to hold: one pass over its parts, in a memory that does not grow with its rows.

Each takes rows as they come, and no result depends on how they are cut into parts, but for rounding.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from harmolab.metrics.frechet import SPLITS, FrechetResult, Moments, moments_distance
from harmolab.significance import LEVEL
from harmolab.types import BoolArray, FloatArray


class FeatureMoments:
    """Moments of features in one pass, and those of `SPLITS` pairs of halves, which tell the bias of a small sample.

    The halves are drawn by the keys of the rows: rows of one key stay together.
    """

    def __init__(self) -> None:
        self._all: Moments | None = None
        self._halves: dict[tuple[int, bool], Moments] = {}

    def add(self, keys: Sequence[str], features: ArrayLike) -> None:
        """Add (n, d) features of n keys; ValueError for NaN or infinity, another number of rows, other columns."""
        rows = np.asarray(features, np.float64)
        if rows.ndim != 2 or rows.shape[1] == 0 or len(rows) != len(keys):
            raise ValueError(f"features must be (rows, features) of {len(keys)} keys, got shape {rows.shape}")
        if not np.isfinite(rows).all():
            raise ValueError("features hold NaN or infinity")
        if self._all is not None and rows.shape[1:] != self._all.mean.shape:
            raise ValueError(f"features must have {self._all.mean.size} columns as before, got {rows.shape[1]}")
        if not len(rows):
            return
        self._all = _joined(self._all, rows)
        sides = np.array([_sides(key) for key in keys])  # (n, SPLITS)
        for split in range(SPLITS):
            for side in (False, True):
                part = rows[sides[:, split] == side]
                if len(part):
                    self._halves[split, side] = _joined(self._halves.get((split, side)), part)

    @property
    def total(self) -> Moments:
        """The moments of all rows; ValueError before the first."""
        if self._all is None:
            raise ValueError("there are no features yet")
        return self._all

    def bias(self, reference: Moments) -> float:
        """The part of a Frechet distance that the finite size of this set adds, in units of `reference`.

        As `frechet_distance` measures it: halves of n and m rows are (n + m)^2 / (n m) times as far apart as the whole
        is off by its size alone, which is 4 times for equal halves.

        Raises
        ------
        ValueError
            With too few rows to halve them.
        """
        shares = []
        for split in range(SPLITS):
            halves = [self._halves.get((split, side)) for side in (False, True)]
            a, b = (half.standardised(reference) if half and half.size > 1 else None for half in halves)
            if a and b:
                shares.append(moments_distance(a, b) * a.size * b.size / (a.size + b.size) ** 2)
        if not shares:
            raise ValueError(f"{self.total.size} rows are too few to take a bias off")
        return float(np.mean(shares))


def _joined(moments: Moments | None, rows: FloatArray) -> Moments:
    return Moments.of(rows) if moments is None else moments + Moments.of(rows)


def _sides(key: str) -> BoolArray:
    """The half on which a key is in each split."""
    digest = np.frombuffer(hashlib.sha256(key.encode()).digest(), np.uint8)
    return np.unpackbits(digest)[:SPLITS].astype(bool)


def streamed_frechet(features: FeatureMoments, reference: FeatureMoments) -> FrechetResult:
    """Frechet distance in units of the reference (`standardise`), with and without the bias of small samples.

    ``raw`` is that of `frechet_distance`; ``value`` differs from it by the draw of the halves.

    Raises
    ------
    ValueError
        For different columns, or too few rows.
    """
    unit = reference.total
    raw = moments_distance(features.total.standardised(unit), unit.standardised(unit))
    bias = features.bias(unit) + reference.bias(unit)
    return FrechetResult(raw - bias, features.total.size, unit.size, raw)


class SongBootstrap:
    """Means of columns with bootstrap intervals over songs, in one pass (Poisson bootstrap, Chamandy et al. 2012).

    In each of `count` replicates a song counts as often as a Poisson variable of mean 1 says, drawn by its name and
    the seed. So the rows of a song may lie apart, and two systems that danced to the same songs are resampled alike.

    Parameters
    ----------
    n_columns : int, numbers in a row
    count : int, replicates
    seed : int
    """

    def __init__(self, n_columns: int, *, count: int = 1000, seed: int = 0) -> None:
        self._count, self._seed = count, seed
        # Row 0 counts every song once.
        self._sums = np.zeros((count + 1, n_columns))
        self._weights = np.zeros((count + 1, n_columns))

    def add(self, songs: Sequence[str], values: ArrayLike) -> None:
        """Add (n, columns) values of rows that belong to n songs; NaN is a number that does not exist, left out."""
        rows = np.asarray(values, np.float64)
        if rows.shape != (len(songs), self._sums.shape[1]):
            raise ValueError(f"values must be {(len(songs), self._sums.shape[1])}, got shape {rows.shape}")
        names, song = np.unique(np.asarray(songs, str), return_inverse=True)
        drawn = np.array([_song_weights(str(name), self._count, self._seed) for name in names])
        weights = drawn.reshape(-1, self._count + 1)[song].T  # (count + 1, n)
        exists = ~np.isnan(rows)
        self._sums += weights @ np.where(exists, rows, 0.0)
        self._weights += weights @ exists.astype(np.float64)

    @property
    def means(self) -> FloatArray:
        """(columns,) means over all rows; NaN without a number."""
        return self.replicates[0]

    @property
    def replicates(self) -> FloatArray:
        """(1 + count, columns) means: of all rows first, then of each replicate; NaN where it holds no number."""
        empty = self._weights == 0
        return np.where(empty, np.nan, self._sums / np.where(empty, 1.0, self._weights))

    def intervals(self, less: SongBootstrap | None = None, *, level: float = LEVEL) -> FloatArray:
        """(columns, 2) percentile intervals of the means, or of the difference to the means of `less`, song by song."""
        draws = self.replicates - (0.0 if less is None else less.replicates)
        edges = [(1 - level) / 2, (1 + level) / 2]
        columns = [column[~np.isnan(column)] for column in draws[1:].T]
        return np.array([np.quantile(one, edges) if one.size else [np.nan, np.nan] for one in columns])


@lru_cache(maxsize=256)
def _song_weights(name: str, count: int, seed: int) -> FloatArray:
    """(1 + count,) counts of a song: 1 for all rows, then one for each replicate."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), np.uint32)
    draws = np.random.default_rng([seed, *words.tolist()]).poisson(1.0, count)
    return np.append(1.0, draws)


class ScoreHistogram:
    """The AUC of scores of two classes in one pass, by counting them in narrow bins.

    Parameters
    ----------
    low, high : float, bounds of the scores; those beyond are counted at the edge
    n_bins : int
    """

    def __init__(self, low: float, high: float, n_bins: int = 4096) -> None:
        if not low < high:
            raise ValueError(f"low must be below high, got {low:g} and {high:g}")
        self._edges = np.linspace(low, high, n_bins + 1)[1:-1]
        self._counts = np.zeros((2, n_bins), np.int64)

    def add(self, true: ArrayLike, wrong: ArrayLike) -> None:
        """Add scores of either class; NaN is an error."""
        for side, scores in enumerate((true, wrong)):
            values = np.asarray(scores, np.float64).ravel()
            if np.isnan(values).any():
                raise ValueError("scores hold NaN")
            self._counts[side] += np.bincount(np.searchsorted(self._edges, values), minlength=self._counts.shape[1])

    def auc(self) -> tuple[float, float]:
        """The AUC, and how far it may be from that of the scores themselves: half the pairs that share a bin."""
        true, wrong = self._counts.astype(np.float64)
        pairs = true.sum() * wrong.sum()
        if not pairs:
            return float("nan"), float("nan")
        below = np.cumsum(wrong) - wrong
        ties = float(true @ wrong)
        return float((true @ below + ties / 2) / pairs), ties / 2 / pairs
