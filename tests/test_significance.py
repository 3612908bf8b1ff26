"""Nulls by rotation, p-values, bootstrap intervals, AUC."""

from __future__ import annotations

import numpy as np
import pytest

from harmolab.significance import auc, bootstrap_interval, p_value, rotated_shares, rotations


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
    found = rotated_shares(audio, visual, weights, delay=0.2, duration=6.0, count=50)
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize(("audio", "visual"), [([], [1.0]), ([1.0], [])])
def test_no_beats_are_hit_by_no_rotation(audio, visual):
    audio = np.array(audio)
    found = rotated_shares(audio, np.array(visual), np.ones(audio.size), delay=0.2, duration=6.0, count=3)
    np.testing.assert_array_equal(found, [0, 0, 0])


@pytest.mark.parametrize(
    ("observed", "null", "expected"),
    [(5.0, [1.0, 2.0, 3.0], 0.25), (2.0, [1.0, 2.0, 3.0], 0.75), (0.0, [1.0, 2.0, 3.0], 1.0), (1.0, [], 1.0)],
)
def test_p_value_counts_the_observation_itself(observed, null, expected):
    assert p_value(observed, null) == expected


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


@pytest.mark.parametrize(
    ("positives", "negatives", "expected"),
    [
        ([2.0, 3.0], [0.0, 1.0], 1.0),
        ([0.0, 1.0], [2.0, 3.0], 0.0),
        ([1.0, 1.0], [1.0], 0.5),
        ([1.0, 3.0], [2.0, 2.0], 0.5),
        ([1.0, 3.0], [0.0, 2.0], 0.75),  # 1 beats 0; 3 beats both
    ],
)
def test_auc_counts_pairs_and_ties_half(positives, negatives, expected):
    assert auc(positives, negatives) == expected


def test_auc_takes_every_value_of_a_table():
    assert auc([2.0], [[1.0, 3.0], [0.0, 4.0]]) == 0.5


def test_auc_of_nothing_is_nan():
    assert np.isnan(auc([], [1.0]))
    assert np.isnan(auc([1.0], []))
