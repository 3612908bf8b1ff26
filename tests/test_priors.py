"""Temporal index and initial poses (Eq. 23)."""

import numpy as np
import pytest

from harmolab.systems.training.units import initial_poses, temporal_index
from tests.builders import refused


def test_frames_of_the_last_meter_have_index_one():
    np.testing.assert_array_equal(temporal_index(4, 3), [1, 1, 1, 0])


@pytest.mark.parametrize(("n_prior", "expected"), [(0, [0, 0]), (2, [1, 1])])
def test_index_may_be_all_zero_or_all_one(n_prior: int, expected: list[int]):
    np.testing.assert_array_equal(temporal_index(2, n_prior), expected)


@pytest.mark.parametrize("n_prior", [-1, 4])
def test_more_prior_frames_than_frames_are_refused(n_prior: int):
    refused(rf"n_prior must lie between 0 and n_frames \(3\), got {n_prior}", temporal_index, 3, n_prior)


def test_initial_poses_keep_the_last_meter_and_hold_its_mean_afterwards():
    motion = np.array([[1.0, 10.0], [3.0, 20.0], [7.0, 70.0], [9.0, 90.0]])
    poses = initial_poses(motion, np.array([1.0, 1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(poses, [[1, 10], [3, 20], [2, 15], [2, 15]])
    assert poses.dtype == np.float32


def test_the_current_meter_does_not_show_in_its_initial_poses(rng: np.random.Generator):
    motion, index = rng.normal(size=(6, 4)), temporal_index(6, 2)
    other = motion.copy()
    other[2:] = 1e6
    np.testing.assert_array_equal(initial_poses(motion, index), initial_poses(other, index))


def test_a_unit_without_prior_frames_has_no_initial_poses():
    refused(r"index is 0 everywhere.*Eq\. 23", initial_poses, np.zeros((3, 2)), np.zeros(3))


def test_an_index_of_another_length_is_refused():
    refused(r"one entry per frame \(3\), got shape \(2,\)", initial_poses, np.zeros((3, 2)), np.ones(2))
