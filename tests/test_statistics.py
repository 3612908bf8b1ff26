"""Statistics in one pass: the same as of the whole table, in a memory that does not grow with it."""

from __future__ import annotations

import numpy as np
import pytest

from harmolab.lab.evaluate.statistics import FeatureMoments, ScoreHistogram, SongBootstrap, streamed_frechet
from harmolab.metrics.frechet import Moments, frechet_distance, moments_distance, standardise
from harmolab.significance import auc


def features(rng: np.random.Generator, n: int, *, shift: float = 0.0) -> np.ndarray:
    """Correlated features of very different sizes, the last one constant."""
    mixed = rng.normal(size=(n, 6)) @ rng.normal(size=(6, 5)) * [1e-3, 1.0, 1e3, 1.0, 1.0] + [0, 5, 1e6, 0, shift]
    return np.column_stack([mixed, np.full(n, 2.5)])


def moments_of(rows: np.ndarray, *cuts: int) -> FeatureMoments:
    """The moments of rows that come in parts cut there."""
    moments = FeatureMoments()
    keys = np.array([f"clip {number}" for number in range(len(rows))])
    for index in np.split(np.arange(len(rows)), cuts):
        moments.add(list(keys[index]), rows[index])
    return moments


def test_moments_of_two_points_by_hand():
    moments = Moments.of(np.array([[1.0, 0.0]])) + Moments.of(np.array([[3.0, 4.0]]))
    np.testing.assert_array_equal(moments.mean, [2.0, 2.0])
    np.testing.assert_allclose(moments.factor.T @ moments.factor, [[2.0, 4.0], [4.0, 8.0]])
    assert moments.size == 2


def test_moments_of_parts_are_those_of_the_whole(rng: np.random.Generator):
    rows = features(rng, 400)
    moments = moments_of(rows, 1, 2, 3, 7, 200, 200, 399).total
    np.testing.assert_allclose(moments.mean, rows.mean(axis=0), rtol=1e-12)
    covariance = moments.factor.T @ moments.factor / 399
    scale = np.sqrt(np.outer(rows.var(axis=0) + 1e-30, rows.var(axis=0) + 1e-30))
    np.testing.assert_allclose(covariance / scale, np.cov(rows.T) / scale, atol=1e-8)


@pytest.mark.parametrize("n", [4, 40, 400])
def test_distance_by_moments_is_that_of_the_features(n: int, rng: np.random.Generator):
    # Fewer rows than features: covariances without inverse.
    a, b = features(rng, n), features(rng, 50, shift=0.5)
    units = standardise(a, b), standardise(b, b)
    expected = frechet_distance(*units, correct_bias=False).raw
    result = streamed_frechet(moments_of(a, n // 2), moments_of(b, 10, 20))
    assert result.raw == pytest.approx(expected, rel=1e-9)
    assert (result.n_a, result.n_b) == (n, 50)
    direct = moments_distance(Moments.of(units[0]), Moments.of(units[1]))
    assert direct == expected


def test_the_bias_that_is_taken_off_is_that_of_the_sample_in_memory(rng: np.random.Generator):
    a, b = rng.normal(size=(200, 8)), rng.normal(size=(300, 8))
    whole = frechet_distance(standardise(a, b), standardise(b, b))
    streamed = streamed_frechet(moments_of(a, 50, 100), moments_of(b, 100))
    assert streamed.raw - streamed.value == pytest.approx(whole.raw - whole.value, rel=0.15)
    assert abs(streamed.value) < streamed.raw / 2  # the truth is 0


def test_rows_of_one_key_stay_in_one_half():
    moments = FeatureMoments()
    moments.add(["clip"] * 8, np.random.default_rng(0).normal(size=(8, 2)))
    with pytest.raises(ValueError, match="8 rows are too few to take a bias off"):
        moments.bias(moments.total)


@pytest.mark.parametrize(
    ("keys", "rows", "fault"),
    [
        (["a", "b"], [[1.0, 2.0]], r"of 2 keys, got shape \(1, 2\)"),
        (["a"], [[1.0, np.nan]], "hold NaN or infinity"),
        (["a"], [[1.0, 2.0, 3.0]], "must have 2 columns as before, got 3"),
    ],
)
def test_features_that_cannot_be_added_are_refused(keys: list[str], rows: list[list[float]], fault: str):
    moments = FeatureMoments()
    moments.add(["first"], [[0.0, 0.0]])
    with pytest.raises(ValueError, match=fault):
        moments.add(keys, rows)


def test_moments_of_nothing_and_of_other_features_are_refused():
    with pytest.raises(ValueError, match="there are no features yet"):
        FeatureMoments().total  # noqa: B018
    one, two = Moments.of(np.zeros((3, 1))), Moments.of(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="the same features, got 1 and 2"):
        moments_distance(one, two)
    with pytest.raises(ValueError, match="at least 2 rows, got 1 and 3"):
        moments_distance(Moments.of(np.zeros((1, 1))), one)


def test_means_leave_out_numbers_that_do_not_exist():
    bootstrap = SongBootstrap(2)
    bootstrap.add(["a", "b"], [[1.0, np.nan], [2.0, np.nan]])
    bootstrap.add(["a"], [[6.0, np.nan]])
    np.testing.assert_array_equal(bootstrap.means, [3.0, np.nan])
    np.testing.assert_array_equal(bootstrap.intervals()[1], [np.nan, np.nan])


def test_interval_covers_the_spread_between_songs_and_not_between_rows():
    # 100 songs of 50 equal rows each: the mean has the standard error of 100 numbers, .1.
    rng = np.random.default_rng(3)
    means = rng.normal(size=100)
    bootstrap = SongBootstrap(1, count=2000)
    for song, mean in enumerate(means):
        bootstrap.add([f"song {song}"] * 50, np.full((50, 1), mean))
    ((low, high),) = bootstrap.intervals()
    assert low < means.mean() < high
    assert high - low == pytest.approx(2 * 1.96 * means.std() / 10, rel=0.08)


def test_the_order_and_the_parts_of_the_rows_do_not_matter(rng: np.random.Generator):
    songs, values = np.array([f"song {number % 7}" for number in range(60)]), rng.normal(size=(60, 3))
    whole, parts = SongBootstrap(3, count=50), SongBootstrap(3, count=50)
    whole.add(songs, values)
    for index in np.array_split(rng.permutation(60), 9):
        parts.add(songs[index], values[index])
    np.testing.assert_allclose(parts.replicates, whole.replicates, rtol=1e-12)


def test_systems_that_danced_to_the_same_songs_are_resampled_alike(rng: np.random.Generator):
    songs, values = [f"song {number}" for number in range(30)], rng.normal(size=(30, 1))
    one, other = SongBootstrap(1), SongBootstrap(1)
    one.add(songs, values + 0.25)
    other.add(songs[::-1], values[::-1])
    np.testing.assert_allclose(one.intervals(other), [[0.25, 0.25]], atol=1e-12)
    assert np.diff(one.intervals()) > 0.4


def test_another_seed_draws_other_songs(rng: np.random.Generator):
    values = rng.normal(size=(20, 1))
    draws = []
    for seed in (0, 0, 1):
        bootstrap = SongBootstrap(1, count=100, seed=seed)
        bootstrap.add([f"song {number}" for number in range(20)], values)
        draws.append(bootstrap.replicates)
    assert (draws[0] == draws[1]).all() and (draws[0][1:] != draws[2][1:]).all()


def test_values_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"values must be \(2, 3\), got shape \(2, 2\)"):
        SongBootstrap(3).add(["a", "b"], np.zeros((2, 2)))


def test_auc_by_counting_is_that_of_the_scores(rng: np.random.Generator):
    true, wrong = rng.integers(0, 40, 500) / 10, rng.integers(0, 35, 700) / 10
    histogram = ScoreHistogram(-0.05, 4.05, 41)  # a bin for each value
    for part in range(5):
        histogram.add(true[part::5], wrong[part::5])
    assert histogram.auc()[0] == pytest.approx(auc(true, wrong), abs=1e-12)
    true, wrong = rng.normal(size=5000), rng.normal(size=4000) - 0.5
    for n_bins in (10, 4096):
        histogram = ScoreHistogram(-3.0, 3.0, n_bins)
        histogram.add(true, wrong)
        value, error = histogram.auc()
        assert abs(value - auc(true, wrong)) <= error
    assert error < 1e-3


def test_auc_of_nothing_is_none_and_nan_an_error():
    histogram = ScoreHistogram(0.0, 1.0)
    assert np.isnan(histogram.auc()).all()
    with pytest.raises(ValueError, match="scores hold NaN"):
        histogram.add([np.nan], [0.0])
    with pytest.raises(ValueError, match="low must be below high, got 1 and 1"):
        ScoreHistogram(1.0, 1.0)
