"""What chance would reach: nulls by rotation in time, p-values, bootstrap intervals, AUC."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

__all__ = ["auc", "bootstrap_interval", "mean_interval", "p_value", "rotated_shares", "rotations"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def rotations(duration: float, count: int) -> FloatArray:
    """`count` shifts in (0, duration), evenly spread and never zero: the null of "same motion, other moment"."""
    return (np.arange(count, dtype=np.float64) + 0.5) * (duration / count)


def rotated_shares(
    audio_times: FloatArray,
    visual_times: FloatArray,
    weights: FloatArray,
    *,
    delay: float,
    duration: float,
    count: int,
) -> FloatArray:
    """Weighted hits after each of `count` rotations of the visual beats within the clip.

    Parameters
    ----------
    audio_times : (N,) array, seconds
    visual_times : (M,) array, seconds, sorted, in [0, duration]
    weights : (N,) array, what each hit is worth
    delay, duration : float, seconds
    count : int

    Returns
    -------
    (count,) array, sum of the weights of the music beats that are hit; distances are measured around the circle.
    """
    if visual_times.size == 0 or audio_times.size == 0:
        return np.zeros(count)
    around = np.concatenate([visual_times[-1:] - duration, visual_times, visual_times[:1] + duration])
    asked = np.mod(audio_times[None, :] - rotations(duration, count)[:, None], duration)
    after = np.clip(np.searchsorted(around, asked), 1, around.size - 1)
    distance = np.minimum(np.abs(around[after] - asked), np.abs(asked - around[after - 1]))
    return (distance <= delay + 1e-9) @ weights


def p_value(observed: float, null: ArrayLike) -> float:
    """Share of null values at least as large as `observed`, counting the observation itself: never zero.

    >>> p_value(3.0, [1.0, 2.0, 4.0])
    0.5
    """
    values = np.asarray(null, dtype=np.float64)
    return float((1 + np.count_nonzero(values >= observed - 1e-12)) / (1 + values.size))


def mean_interval(values: ArrayLike, level: float = 0.95) -> tuple[float, float, float]:
    """(mean, low, high): mean of (n,) values and its interval by Student's t.

    Returns
    -------
    `low` and `high` are NaN where there is one value, or an infinite one.

    >>> mean_interval([2.0])
    (2.0, nan, nan)
    """
    numbers = np.asarray(values, dtype=np.float64)
    mean = float(numbers.mean())
    if numbers.size < 2 or np.isinf(numbers).any():
        return mean, np.nan, np.nan
    # `stdtrit` is the quantile of scipy.stats.t, which would take half a second to import.
    half = float(numbers.std(ddof=1) / np.sqrt(numbers.size) * stdtrit(numbers.size - 1, (1 + level) / 2))
    return mean, mean - half, mean + half


def bootstrap_interval(
    values: ArrayLike, weights: ArrayLike | None = None, *, count: int = 1000, seed: int = 0, level: float = 0.95
) -> tuple[float, float]:
    """Percentile interval of the weighted mean of `values`, resampled with replacement.

    Neighbouring beats are not independent, so this is the least the uncertainty can be.

    Returns
    -------
    (low, high); both NaN with fewer than two values or no weight.
    """
    numbers = np.asarray(values, dtype=np.float64)
    mass = np.ones_like(numbers) if weights is None else np.asarray(weights, dtype=np.float64)
    if numbers.size < 2 or mass.sum() <= 0:
        return float("nan"), float("nan")
    drawn = np.random.default_rng(seed).integers(0, numbers.size, (count, numbers.size))
    total = mass[drawn].sum(axis=1)
    means = np.divide((numbers * mass)[drawn].sum(axis=1), total, out=np.zeros(count), where=total > 0)
    low, high = np.quantile(means, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def auc(positives: ArrayLike, negatives: ArrayLike) -> float:
    """Probability that a positive ranks above a negative, ties counted half; NaN when either is empty.

    >>> auc([2.0, 3.0], [1.0, 2.0])
    0.875
    """
    high, low = np.ravel(positives), np.sort(np.ravel(negatives))
    if high.size == 0 or low.size == 0:
        return float("nan")
    below = np.searchsorted(low, high, side="left") + np.searchsorted(low, high, side="right")
    return float(below.sum() / (2 * high.size * low.size))
