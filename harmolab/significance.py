"""Chance and uncertainty: null distributions by rotation in time, p-values, intervals, AUC.

A *null distribution* has the values of a score that luck gives: here those after the beats of the movement are shifted
in time around the end of the clip (rotated), so that the movement stays what it is and only its moment changes. The
p-value is the share of them that are at least as large as the score. Intervals are by Student's t (a mean), by Wilson
(a share), or by bootstrap: the values are drawn anew with replacement many times, and the middle 95 % of what comes out
is the interval.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtrit

from harmolab.types import FloatArray, IntArray

LEVEL = 0.95  # of every interval, unless another is given


def rotations(duration: float, count: int) -> FloatArray:
    """`count` shifts in (0, duration), evenly spread and never zero: the null of "same motion, other moment"."""
    return (np.arange(count, dtype=np.float64) + 0.5) * (duration / max(count, 1))


def rotated_hits(
    audio_times: FloatArray, visual_times: FloatArray, weights: FloatArray, *, delay: float, duration: float, count: int
) -> FloatArray:
    """Weighted hits after each of `count` rotations of the visual beats: shifts in time around the end of the clip.

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
    shifted = np.mod(audio_times[None, :] - rotations(duration, count)[:, None], duration)
    after = np.clip(np.searchsorted(around, shifted), 1, around.size - 1)
    distance = np.minimum(np.abs(around[after] - shifted), np.abs(shifted - around[after - 1]))
    return (distance <= delay + 1e-9) @ weights


def ranks(values: ArrayLike) -> FloatArray:
    """Ranks (n,) of (n,) values from 1; equal values share the mean of theirs.

    `scipy.stats.rankdata` for one row, without the second that importing scipy.stats takes.

    >>> ranks([0.5, 0.1, 0.5]).tolist()
    [2.5, 1.0, 2.5]
    """
    every = np.asarray(values, dtype=np.float64)
    ordered = np.sort(every)
    return (np.searchsorted(ordered, every) + np.searchsorted(ordered, every, side="right") + 1) / 2


def p_value(observed: float, null: ArrayLike) -> float:
    """The p-value of a number: how often luck gives one that is at least as large.

    The observation itself is counted among the R null values, so that p is never 0: (1 + n) / (1 + R), where n of them
    are at least as large.

    Parameters
    ----------
    observed : float
    null : (R,) array, values by luck alone, such as the `null` of a `HarmonyScore`

    Returns
    -------
    float above 0, at most 1; NaN where one of the numbers is NaN

    Examples
    --------
    >>> p_value(3.0, [1.0, 2.0, 4.0])
    0.5
    """
    values = np.asarray(null, dtype=np.float64)
    if np.isnan(observed) or np.isnan(values).any():
        return math.nan
    return float((1 + np.count_nonzero(values >= observed - 1e-12)) / (1 + values.size))


def mean_interval(values: ArrayLike, level: float = LEVEL) -> tuple[float, float, float]:
    """Mean of (n,) values and its interval by Student's t: (mean, low, high).

    Both bounds are NaN with fewer than two values or an infinite one; so is the mean of no values.

    >>> mean_interval([2.0])
    (2.0, nan, nan)
    """
    numbers = np.asarray(values, dtype=np.float64)
    mean = float(numbers.mean()) if numbers.size else math.nan
    if numbers.size < 2 or np.isinf(numbers).any():
        return mean, math.nan, math.nan
    half = float(numbers.std(ddof=1) / np.sqrt(numbers.size) * stdtrit(numbers.size - 1, (1 + level) / 2))
    return mean, mean - half, mean + half


def wilson_interval(hits: float, n: float, level: float = LEVEL, *, freedom: float = math.inf) -> tuple[float, float]:
    """Wilson's score interval of a share: `hits` of `n` answers, neither of which need be whole.

    Parameters
    ----------
    hits, n : float
    level : float
    freedom : float
        Degrees of freedom of the variance behind `n`; Student's quantile then takes the place of the Gaussian's.

    Returns
    -------
    (low, high) within 0 and 1; both NaN without answers.

    >>> [round(bound, 3) for bound in wilson_interval(8, 10)]
    [0.49, 0.943]
    """
    if n == 0:
        return math.nan, math.nan
    quantile = stdtrit(freedom, (1 + level) / 2) if np.isfinite(freedom) else ndtri((1 + level) / 2)
    share, square = hits / n, quantile**2 / n
    centre = (share + square / 2) / (1 + square)
    half = quantile * math.sqrt(share * (1 - share) / n + square / (4 * n)) / (1 + square)
    low, high = np.clip([centre - half, centre + half], 0.0, 1.0).tolist()
    return (low if hits > 0 else 0.0), (high if hits < n else 1.0)


def bootstrap_interval(
    values: ArrayLike, weights: ArrayLike | None = None, *, count: int = 1000, seed: int = 0, level: float = LEVEL
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
        return math.nan, math.nan
    drawn = np.random.default_rng(seed).integers(0, numbers.size, (count, numbers.size))
    total = mass[drawn].sum(axis=1)
    means = np.divide((numbers * mass)[drawn].sum(axis=1), total, out=np.zeros(count), where=total > 0)
    return _percentiles(means, level)


def bootstrap_interval_of(
    statistic: Callable[[IntArray], ArrayLike], n: int, *, count: int = 1000, seed: int = 0, level: float = LEVEL
) -> tuple[float, float]:
    """Percentile interval of a statistic over resamplings of the places 0 to n - 1.

    Parameters
    ----------
    statistic : function of resamplings, (C, n) places, that returns their C values; it is called with some at a time
    n, count : int, places, and resamplings of them
    seed, level : as in `bootstrap_interval`

    Returns
    -------
    (low, high); both NaN with fewer than two places, or where more than half of the values are NaN.
    """
    if n < 2:
        return math.nan, math.nan
    drawn = np.random.default_rng(seed).integers(0, n, (count, n))
    values = np.concatenate([statistic(some) for some in np.array_split(drawn, max(1, count // 100))])
    return (math.nan, math.nan) if np.isnan(values).mean() > 0.5 else _percentiles(values, level)


def _percentiles(values: FloatArray, level: float) -> tuple[float, float]:
    low, high = np.nanquantile(values, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def auc(positives: ArrayLike, negatives: ArrayLike) -> float:
    """AUC, the area under the ROC curve: how well a score tells positives from negatives.

    Positives are scores of dances to their own music, for example, and negatives those to wrong music. The AUC is the
    probability that a positive drawn at random is larger than a negative; ties count half. 1 tells all apart, .5 is a
    coin, 0 tells all apart the wrong way.

    Parameters
    ----------
    positives, negatives : arrays of scores, of any lengths and shapes

    Returns
    -------
    float from 0 to 1; NaN where one side is empty or holds NaN

    Examples
    --------
    >>> auc([2.0, 3.0], [1.0, 2.0])
    0.875
    """
    high, low = np.ravel(positives), np.sort(np.ravel(negatives))
    if high.size == 0 or low.size == 0 or np.isnan(high).any() or np.isnan(low).any():
        return math.nan
    below = np.searchsorted(low, high, side="left") + np.searchsorted(low, high, side="right")
    return float(below.sum() / (2 * high.size * low.size))
