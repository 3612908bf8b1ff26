"""Nulls by rotation, p-values, intervals, AUC."""

import numpy as np
import pytest
from scipy.stats import binomtest

from harmolab.significance import (
    auc,
    bootstrap_interval,
    bootstrap_interval_of,
    mean_interval,
    p_value,
    rotated_shares,
    rotations,
    wilson_interval,
)
from tests.builders import cases


def test_rotations_are_spread_evenly_and_never_zero():
    np.testing.assert_allclose(rotations(8.0, 4), [1, 3, 5, 7])


def test_rotated_hits_by_hand():
    # A circle of 8 s with one visual beat at 1, turned by 1, 3, 5, 7: it stands at 2, 4, 6, 0.
    shares = rotated_shares(
        np.array([2.0, 7.5]), np.array([1.0]), np.array([1.0, 10.0]), delay=0.5, duration=8.0, count=4
    )
    np.testing.assert_array_equal(shares, [1, 0, 0, 10])  # 7.5 and 0 lie half a second apart around the circle


def test_rotated_hits_agree_with_counting_one_by_one(rng: np.random.Generator):
    audio, visual = np.sort(rng.uniform(0, 6, 9)), np.sort(rng.uniform(0, 6, 7))
    weights = rng.uniform(size=9)
    expected = []
    for shift in rotations(6.0, 50):
        distance = np.abs(audio[:, None] - np.mod(visual + shift, 6.0))
        near = np.minimum(distance, 6.0 - distance).min(axis=1) <= 0.2
        expected.append(near @ weights)
    np.testing.assert_allclose(rotated_shares(audio, visual, weights, delay=0.2, duration=6.0, count=50), expected)


@pytest.mark.parametrize(("audio", "visual"), [([], [1.0]), ([1.0], [])])
def test_no_beats_are_hit_by_no_rotation(audio, visual):
    audio = np.array(audio)
    shares = rotated_shares(audio, np.array(visual), np.ones(audio.size), delay=0.2, duration=6.0, count=3)
    np.testing.assert_array_equal(shares, [0, 0, 0])


@pytest.mark.parametrize(
    ("observed", "null", "expected"),
    [(5.0, [1.0, 2.0, 3.0], 0.25), (2.0, [1.0, 2.0, 3.0], 0.75), (0.0, [1.0, 2.0, 3.0], 1.0), (1.0, [], 1.0)],
)
def test_p_value_counts_the_observation_itself(observed, null, expected):
    assert p_value(observed, null) == expected


def test_a_null_value_that_rounding_put_below_the_observation_counts_as_large():
    assert p_value(0.1 + 0.2, [0.3]) == 1.0
    assert p_value(0.3 + 1e-9, [0.3]) == 0.5


@pytest.mark.parametrize(("beat", "hits"), [(1.8, 1.0), (1.8 + 1e-6, 0.0)])
def test_a_rotated_beat_exactly_at_the_delay_is_a_hit(beat: float, hits: float):
    # Half of two seconds earlier; .8 - .7 is rounded up.
    shares = rotated_shares(np.array([beat]), np.array([0.7]), np.ones(1), delay=0.1, duration=2.0, count=1)
    assert shares.tolist() == [hits]


def test_equal_values_have_an_interval_of_no_width():
    assert bootstrap_interval([0.5, 0.5, 0.5]) == (0.5, 0.5)


def test_an_interval_holds_the_mean_and_narrows_with_more_values():
    few = bootstrap_interval([0.0, 1.0] * 10)
    many = bootstrap_interval([0.0, 1.0] * 1000)
    assert few[0] < many[0] < 0.5 < many[1] < few[1]
    # SD 0.5 over the square root of 20 and 2000, times 1.96.
    assert few[1] - few[0] == pytest.approx(2 * 1.96 * 0.5 / np.sqrt(20), rel=0.15)
    assert many[1] - many[0] == pytest.approx(2 * 1.96 * 0.5 / np.sqrt(2000), rel=0.15)


def test_values_without_weight_do_not_count():
    assert bootstrap_interval([1.0, 1.0, 0.0], [1.0, 2.0, 0.0], count=200, seed=1)[1] == 1.0


def test_an_interval_is_the_same_for_the_same_seed():
    values = np.arange(10.0)
    assert bootstrap_interval(values, seed=3) == bootstrap_interval(values, seed=3)
    assert bootstrap_interval(values, seed=3) != bootstrap_interval(values, seed=4)


@pytest.mark.parametrize(("values", "weights"), [([], None), ([1.0], None), ([1.0, 2.0], [0.0, 0.0])])
def test_too_little_for_an_interval_gives_nan(values, weights):
    assert np.isnan(bootstrap_interval(values, weights)).all()


@cases(
    "positives, negatives, expected",
    ([2.0, 3.0], [0.0, 1.0], 1.0),
    ([0.0, 1.0], [2.0, 3.0], 0.0),
    ([1.0, 1.0], [1.0], 0.5),
    ([1.0, 3.0], [2.0, 2.0], 0.5),
    ([1.0, 3.0], [0.0, 2.0], 0.75),  # 1 beats 0; 3 beats both
)
def test_auc_counts_pairs_and_ties_half(positives, negatives, expected):
    assert auc(positives, negatives) == expected


def test_auc_takes_every_value_of_a_table():
    assert auc([2.0], [[1.0, 3.0], [0.0, 4.0]]) == 0.5


def test_auc_of_nothing_is_nan():
    assert np.isnan(auc([], [1.0]))
    assert np.isnan(auc([1.0], []))


def test_mean_interval_is_students():
    # Mean 2, standard deviation 1, three values; the table's t for two degrees of freedom is 4.30265.
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2.0, 2 - 4.30265 / 3**0.5, 2 + 4.30265 / 3**0.5), abs=1e-5)


@pytest.mark.parametrize(("values", "mean"), [([], np.nan), ([2.0], 2.0), ([1.0, np.inf], np.inf)])
def test_mean_of_too_little_has_no_interval(values: list[float], mean: float):
    np.testing.assert_equal(mean_interval(values), (mean, np.nan, np.nan))


@pytest.mark.parametrize(("hits", "n"), [(0, 7), (3, 7), (7, 7), (40, 90)])
def test_wilson_interval_is_scipys(hits: int, n: int):
    bounds = binomtest(hits, n).proportion_ci(0.9, method="wilson")
    assert wilson_interval(hits, n, 0.9) == pytest.approx((bounds.low, bounds.high), abs=1e-12)
    assert wilson_interval(0, 7)[0] == 0.0
    assert wilson_interval(7, 7)[1] == 1.0


def test_wilson_interval_takes_students_quantile_where_the_variance_is_uncertain():
    # With z = 4.30265 (two degrees of freedom): centre 0.5, half width z / sqrt(4 n + 4 z**2) by hand.
    low, high = wilson_interval(5, 10, freedom=2)
    assert (low, high) == pytest.approx((0.5 - 4.30265 / 114.0511**0.5, 0.5 + 4.30265 / 114.0511**0.5), abs=1e-5)


def test_no_answers_have_no_wilson_interval():
    np.testing.assert_equal(wilson_interval(0, 0), (np.nan, np.nan))


def test_bootstrap_of_a_statistic_is_that_of_the_mean_for_the_mean(rng: np.random.Generator):
    values = rng.normal(size=30)
    expected = bootstrap_interval(values, seed=3)
    assert bootstrap_interval_of(lambda places: values[places].mean(), 30, seed=3) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("value", "n"), [(1.0, 1), (np.nan, 9)])
def test_bootstrap_of_what_is_rarely_defined_is_nan(value: float, n: int):
    np.testing.assert_equal(bootstrap_interval_of(lambda places: value, n), (np.nan, np.nan))
