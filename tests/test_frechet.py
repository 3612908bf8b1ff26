"""Distances between sets of features: closed forms, small samples, what is refused."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import sqrtm

from harmolab.metrics.features import FrechetResult, diversity, frechet_distance, multimodality, standardise
from tests.builders import cases, refused


def sigma_points(mean: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """2 d points whose mean is `mean` and whose (n - 1) covariance is diagonal with SDs `spread`, exactly."""
    count = 2 * len(mean)
    steps = np.diag(spread) * np.sqrt((count - 1) / 2)
    return np.concatenate([mean + steps, mean - steps])


def test_distance_of_axis_parallel_normals_is_that_of_their_means_and_deviations():
    # |m_a - m_b|^2 + sum (s_a - s_b)^2 = (1 + 4) + (1 + 9)
    a = sigma_points(np.array([0.0, 0.0]), np.array([1.0, 2.0]))
    b = sigma_points(np.array([1.0, 2.0]), np.array([2.0, 5.0]))
    assert frechet_distance(a, b, correct_bias=False).raw == pytest.approx(15.0)


def test_distance_is_that_of_the_matrix_root(rng: np.random.Generator):
    a, b = rng.normal(size=(60, 6)) @ rng.normal(size=(6, 6)), rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6))
    covariances = np.cov(a.T), np.cov(b.T)
    root = sqrtm(covariances[0] @ covariances[1]).real
    expected = ((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(covariances[0] + covariances[1] - 2 * root)
    assert frechet_distance(a, b, correct_bias=False).raw == pytest.approx(expected)


def test_shifting_one_side_adds_the_square_of_the_shift(rng: np.random.Generator):
    a = rng.normal(size=(50, 4))
    assert frechet_distance(a, a + np.array([3.0, 0.0, 4.0, 0.0]), correct_bias=False).raw == pytest.approx(25.0)


def test_shifting_both_sides_changes_nothing(rng: np.random.Generator):
    a, b = rng.normal(size=(30, 3)), rng.normal(size=(40, 3))
    assert frechet_distance(a + 1e3, b + 1e3).value == pytest.approx(frechet_distance(a, b).value, abs=1e-8)


def test_fewer_samples_than_features_give_a_finite_distance(rng: np.random.Generator):
    a = rng.normal(size=(5, 64))
    assert frechet_distance(a, a, correct_bias=False).raw == pytest.approx(0.0, abs=1e-9)
    assert frechet_distance(a, rng.normal(size=(5, 64)), correct_bias=False).raw > 1


def test_constant_features_are_no_obstacle():
    a = np.tile([1.0, 2.0], (10, 1))
    assert frechet_distance(a, a + 1.0) == FrechetResult(2.0, 10, 10, 2.0)


@pytest.mark.parametrize(("size_a", "size_b"), [(60, 60), (40, 120), (200, 200)])
def test_two_samples_of_one_distribution_are_nothing_apart_once_corrected(size_a: int, size_b: int):
    rng = np.random.default_rng(4)
    results = [frechet_distance(rng.normal(size=(size_a, 16)), rng.normal(size=(size_b, 16))) for _ in range(40)]
    raw, values = np.mean([result.raw for result in results]), np.array([result.value for result in results])
    assert raw > 0.8
    # The mean of 40 estimates lies within three standard errors of 0, and a tenth of the bias at most is left.
    assert abs(values.mean()) < max(3 * values.std() / np.sqrt(40), 0.1 * raw)


def test_the_correction_keeps_a_distance_that_is_there():
    # |0.5|^2 in 12 features and an SD of 1.5 for 1: 3 + 12 * 0.25 = 6.
    rng = np.random.default_rng(5)
    results = [
        frechet_distance(rng.normal(size=(80, 12)), rng.normal(0.5, 1.5, size=(80, 12)), seed=i) for i in range(40)
    ]
    assert np.mean([result.value for result in results]) == pytest.approx(6.0, rel=0.05)
    assert np.mean([result.raw for result in results]) > 7


def test_sample_sizes_and_the_raw_distance_are_reported(rng: np.random.Generator):
    result = frechet_distance(rng.normal(size=(30, 3)), rng.normal(size=(20, 3)))
    assert (result.n_a, result.n_b) == (30, 20)
    assert result.value < result.raw


def test_without_correction_value_and_raw_agree(rng: np.random.Generator):
    result = frechet_distance(rng.normal(size=(30, 3)), rng.normal(size=(20, 3)), correct_bias=False)
    assert result.value == result.raw


def test_the_same_seed_gives_the_same_value(rng: np.random.Generator):
    a, b = rng.normal(size=(30, 3)), rng.normal(size=(20, 3))
    assert frechet_distance(a, b, seed=3) == frechet_distance(a, b, seed=3)
    assert frechet_distance(a, b, seed=3).value != frechet_distance(a, b, seed=4).value


GOOD = np.arange(12.0).reshape(6, 2) % 5


@cases(
    "a, b, message",
    (GOOD[:, 0], GOOD, r"features_a must be \(samples, features\), got shape \(6,\)"),
    (np.zeros((6, 0)), np.zeros((6, 0)), "features_a must be"),
    (GOOD[:3], GOOD, "features_a must have at least 4 rows, got 3"),
    (GOOD, np.zeros((0, 2)), "features_b must have at least 4 rows, got 0"),
    (GOOD, np.where(GOOD == 4, np.nan, GOOD), "features_b holds NaN"),
    (GOOD, GOOD[:, :1], "same columns, got 2 and 1"),
)
def test_unfit_features_are_refused_by_name(a: np.ndarray, b: np.ndarray, message: str):
    refused(message, frechet_distance, a, b)


def test_two_rows_are_enough_without_correction():
    assert frechet_distance([[0.0], [2.0]], [[3.0], [5.0]], correct_bias=False).raw == 9.0
    refused("at least 2 rows, got 1", frechet_distance, [[0.0]], [[3.0], [5.0]], correct_bias=False)


def test_standardised_features_are_in_units_of_the_reference():
    reference = np.array([[0.0, 7.0], [2.0, 7.0]])  # mean 1, SD 1; a column that never changes
    np.testing.assert_allclose(standardise([[3.0, 8.0]], reference), [[2.0, 1.0]])


def test_errors_of_rounding_are_no_unit():
    reference = np.array([[0.0, 1e-31], [2.0, 3e-31]])  # a joint that rests beside one that moves
    np.testing.assert_allclose(standardise([[3.0, 1e-3]], reference), [[2.0, 1e-3]])


def test_standardising_needs_the_same_columns():
    refused("same columns, got 1 and 2", standardise, [[1.0]], [[1.0, 2.0]])


def test_diversity_is_the_mean_distance_of_pairs():
    # Pairs of the corners of a 3-4-5 triangle.
    assert diversity([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]) == pytest.approx(4.0)


def test_equal_dances_have_no_diversity():
    assert diversity(np.ones((5, 3))) == 0.0


def test_multimodality_is_the_mean_over_songs_of_the_diversity_within():
    songs = [[[0.0], [1.0]], [[10.0], [13.0]]]  # 1 apart, 3 apart; how far the songs are apart does not count
    assert multimodality(songs) == 2.0


@cases(
    "call, message",
    (lambda: diversity([[1.0, 2.0]]), "at least 2 rows"),
    (lambda: multimodality([]), "one song at least"),
    (lambda: multimodality([[[1.0], [2.0]], [[1.0]]]), "at least 2 rows"),
)
def test_too_few_dances_are_refused(call: Callable[[], float], message: str):
    refused(message, call)
