"""Likeness of two sets of motions as wholes: Frechet distance of their features, and variety of one set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import pdist

from harmolab.types import FloatArray

SPLITS = 10


@dataclass(frozen=True)
class FrechetResult:
    """A Frechet distance and the sample sizes it rests on.

    Parameters
    ----------
    value : float
        The distance, its small-sample bias taken off when that was asked for. Chance can make it negative.
    n_a, n_b : int
        Number of feature vectors on either side.
    raw : float
        What the formula gives, as papers report it.
    """

    value: float
    n_a: int
    n_b: int
    raw: float


def frechet_distance(
    features_a: ArrayLike, features_b: ArrayLike, *, correct_bias: bool = True, seed: int = 0
) -> FrechetResult:
    """Frechet distance between two sets of features taken as normal distributions (FID, Heusel et al. 2017).

    |m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2)), means m and covariances C of the samples.

    Parameters
    ----------
    features_a, features_b : (n, d) and (m, d) arrays
        Of the same scale in every column: see `standardise`.
    correct_bias : bool
        Take off what small samples add. Two samples of one distribution are never 0 apart: the formula gives about
        c_a / n + c_b / m too much (Chong and Forsyth 2020), several times the distances that matter when there are few
        dances. They extrapolate to infinite samples; we measure c at each side alone: halves of one sample are 4 c / n
        apart where 0 is the truth, so a quarter of their distance, mean over seeded splits, is that side's bias. In
        simulations this had as little bias as the extrapolation and less variance.
    seed : int
        Of the splits.

    Returns
    -------
    FrechetResult

    Raises
    ------
    ValueError
        If the arrays are not (n, d) and (m, d), hold NaN or infinity, or have fewer than two rows (four with
        `correct_bias`).

    Notes
    -----
    The roots of C_a C_b's eigenvalues are the singular values of R_a R_b^T, R the triangular factors of the centred
    samples. So no matrix is squared or rooted, and covariances may be singular.
    Some bias stays where samples are smaller than about twice the number of features. Clips that overlap are not
    independent: they count as more than they are, and too little is taken off.

    Examples
    --------
    >>> frechet_distance([[0.0], [2.0]], [[3.0], [5.0]], correct_bias=False).raw
    9.0
    """
    least = 4 if correct_bias else 2
    a, b = _checked(features_a, "features_a", least), _checked(features_b, "features_b", least)
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"features_a and features_b must have the same columns, got {a.shape[1]} and {b.shape[1]}")
    raw = _distance(a, b)
    rng = np.random.default_rng(seed)
    bias = sum(_own_bias(side, rng) for side in (a, b)) if correct_bias else 0.0
    return FrechetResult(raw - bias, len(a), len(b), raw)


def standardise(features: ArrayLike, reference: ArrayLike) -> FloatArray:
    """`features` in units of the reference: each column less the reference's mean, divided by its SD (AIST++).

    A column in which all of the reference agrees keeps its unit, where AIST++ divides by 1e-10. It agrees where its SD
    is a billionth of the largest feature at most: what a joint that does not move has are errors of rounding.

    Parameters
    ----------
    features, reference : (n, d) and (m, d) arrays

    Returns
    -------
    (n, d) array

    Raises
    ------
    ValueError
        As `frechet_distance`; one row each is enough.
    """
    values, model = _checked(features, "features", 1), _checked(reference, "reference", 1)
    if (columns := values.shape[1]) != model.shape[1]:
        raise ValueError(f"features and reference must have the same columns, got {columns} and {model.shape[1]}")
    spread = model.std(axis=0)
    constant = spread <= 1e-9 * np.abs(model).max()
    return (values - model.mean(axis=0)) / np.where(constant, 1.0, spread)


def diversity(features: ArrayLike) -> float:
    """Mean Euclidean distance between two different rows of (n, d) features (as AIST++ reports it).

    Raises
    ------
    ValueError
        As `frechet_distance`; two rows are needed.

    Examples
    --------
    >>> diversity([[0.0, 0.0], [3.0, 4.0]])
    5.0
    """
    return float(pdist(_checked(features, "features", 2)).mean())


def multimodality(groups: Sequence[ArrayLike]) -> float:
    """Variety of the dances to one song: `diversity` of each song's own (n_i, d) features, mean over the songs.

    Raises
    ------
    ValueError
        If there is no song, or as `diversity` for any of them.
    """
    if not len(groups):
        raise ValueError("multimodality needs the features of one song at least, got none")
    return float(np.mean([diversity(features) for features in groups]))


def _checked(features: ArrayLike, name: str, least: int) -> FloatArray:
    array = np.asarray(features, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] == 0:
        raise ValueError(f"{name} must be (samples, features), got shape {array.shape}")
    if len(array) < least:
        raise ValueError(f"{name} must have at least {least} rows, got {len(array)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds NaN or infinity")
    return array


def _distance(a: FloatArray, b: FloatArray) -> float:
    means = a.mean(axis=0), b.mean(axis=0)
    pairs = zip((a, b), means, strict=True)
    factors = [np.linalg.qr(side - mean, mode="r") / np.sqrt(len(side) - 1) for side, mean in pairs]
    spread = sum(float((factor**2).sum()) for factor in factors)
    common = float(np.linalg.svd(factors[0] @ factors[1].T, compute_uv=False).sum())
    return max(float(((means[0] - means[1]) ** 2).sum()) + spread - 2 * common, 0.0)


def _own_bias(sample: FloatArray, rng: np.random.Generator) -> float:
    """The part of a distance from this side that its finite size adds."""
    half = len(sample) // 2
    shuffled = [rng.permutation(sample) for _ in range(SPLITS)]
    distance = np.mean([_distance(rows[:half], rows[half : 2 * half]) for rows in shuffled])
    return float(distance) / 2 * half / len(sample)
