"""The speed of the shape of a body: nothing rigid has any, and no way of looking at a body changes it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.shape_speed import ShapeSpeed, shape_signal, shape_speed, unturn
from harmolab.types import FloatArray, Motion

BODY = np.random.default_rng(1).normal(0.0, 0.5, (12, 3))
DANCE = synthetic_motion(np.arange(0.0, 8.5, 0.5), seconds=8.0, fps=30.0, seed=2)


def turned(body: FloatArray, angle: FloatArray) -> FloatArray:
    """(T, J, 3) positions of a body turned about the vertical by (T,) angles."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = np.moveaxis(np.broadcast_to(body, (angle.size, *body.shape[-2:])), -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def moving(positions: FloatArray, fps: float = 30.0) -> Motion:
    return Motion(positions, fps, Skeleton.unnamed(positions.shape[1]))


def numbers(motion: Motion) -> FloatArray:
    signal = shape_signal(shape_speed(motion))
    return np.array([*signal.values[::7], signal.pulse, signal.share, signal.joints])


@given(st.floats(15.0, 120.0), st.integers(0, 10_000))
def test_a_rigid_body_that_turns_and_travels_has_none(fps: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, way = np.cumsum(rng.normal(0, 0.1, 60)), np.cumsum(rng.normal(0, 0.05, (60, 1, 3)), axis=0)
    shape = shape_speed(moving(turned(BODY, angle) + way, fps))
    assert shape.speed.max() < 1e-9 * np.sqrt(shape.room.max())


def test_a_body_that_tumbles_has_next_to_none() -> None:
    tumbling = turned(BODY, np.linspace(0, 6, 120))[..., [1, 0, 2]]
    assert shape_signal(shape_speed(moving(tumbling))).share < 0.02


@given(st.floats(0.01, 100.0), st.floats(-3.0, 3.0), st.integers(0, 1000))
def test_scale_yaw_mirror_place_and_joint_order_change_no_number(scale: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = turned(DANCE.positions, np.full(DANCE.n_frames, yaw)) * [-scale, scale, scale] + rng.normal(0, 9, 3)
    other = moving(positions[:, rng.permutation(positions.shape[1])])
    np.testing.assert_allclose(numbers(other), numbers(DANCE), rtol=1e-6, atol=1e-6)


def test_it_is_the_speed_of_the_joints_around_their_mean_when_nothing_turns() -> None:
    swing = np.sin(2 * np.pi * np.arange(300) / 100)
    positions = np.tile(np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]), (300, 1, 1))
    positions[:, 2:, 1] *= (1 + 0.1 * swing)[:, None]  # two joints breathe in and out
    shape = shape_speed(moving(positions, 100.0), smoothing=0.0)
    expected = np.abs(np.gradient(0.1 * swing, 0.01)) * np.sqrt(2 / 4)
    np.testing.assert_allclose(shape.speed[5:-5], expected[5:-5], atol=1e-9)


def test_a_frozen_pose_on_a_dancers_path_loses_what_the_dancer_keeps() -> None:
    angle = np.linspace(0, 9, DANCE.n_frames)
    statue = moving(turned(DANCE.positions[:1], angle) + DANCE.positions.mean(axis=1, keepdims=True))
    assert shape_signal(shape_speed(statue)).share < 1e-9
    assert shape_signal(shape_speed(DANCE)).share > 0.4


def test_the_share_of_joints_that_move_is_one_in_all_for_one_joint() -> None:
    positions = np.tile(BODY, (300, 1, 1))
    positions[:, 0] += 0.02 * np.random.default_rng(0).normal(size=(300, 3)).cumsum(axis=0)
    assert 1 / 12 < shape_signal(shape_speed(moving(positions))).joints < 0.15


def test_pan_roll_zoom_and_shear_of_a_camera_move_no_picture_of_a_still_body() -> None:
    flat = BODY[:, :2]
    time = np.arange(90)[:, None, None] / 30
    matrix = np.array([[1.0, 0.3], [-0.2, 1.1]]) * (1 + 0.2 * np.sin(time)) + np.array([[0, 1], [-1, 0]]) * 0.3 * time
    filmed = np.einsum("jd,tde->tje", flat, matrix) + 2 * time
    shape = shape_speed(moving(filmed))
    assert shape.dimensions == 2
    assert shape.speed.max() < 1e-2 * np.sqrt(shape.room.max())


def test_two_points_have_no_shape_and_keep_their_speed_in_the_room() -> None:
    shape = shape_speed(moving(DANCE.positions[:, :2]))
    assert shape.dimensions == 0
    np.testing.assert_allclose(shape.speed, np.sqrt(shape.room))


def test_a_line_of_joints_and_joints_in_one_place_have_finite_numbers() -> None:
    wave = np.sin(np.arange(60) / 5)[:, None, None] * np.array([0.0, 0.1, 0.0])
    for body in (np.linspace(0, 1, 5)[:, None] * np.ones(3), np.zeros((5, 3))):
        assert np.isfinite(numbers(moving(body + wave))).all()


def test_nothing_outside_the_span_has_a_part_in_the_signal() -> None:
    still = np.concatenate([DANCE.positions, np.tile(DANCE.positions[-1], (900, 1, 1))])
    ends = (1.0, 7.0)
    alone, before_rest = (
        shape_signal(shape_speed(each), *ends) for each in (DANCE, replace(DANCE, positions=still, valid=None))
    )
    np.testing.assert_allclose(before_rest.values, alone.values, atol=1e-9)
    assert before_rest.pulse == pytest.approx(alone.pulse)


def test_frames_that_are_filler_count_for_nothing() -> None:
    valid = np.ones(DANCE.n_frames, bool)
    valid[100:110] = False
    jumped = DANCE.positions.copy()
    jumped[100:110] *= 3
    signal = shape_signal(shape_speed(replace(DANCE, positions=jumped, valid=valid)))
    assert not signal.valid[(signal.times > 3.4) & (signal.times < 3.6)].any()
    assert abs(signal.values[signal.valid].mean()) < 1e-12


def test_a_span_without_movement_is_all_zero() -> None:
    signal = shape_signal(shape_speed(DANCE), 90.0, 91.0)
    assert (signal.values.size, signal.pulse) == (0, 0.0)
    assert np.isnan(signal.share)


def test_unturned_positions_lie_around_their_mean() -> None:
    assert np.abs(unturn(DANCE.positions).mean(axis=1)).max() < 1e-12


def rigid(turn: FloatArray, body: FloatArray) -> Motion:
    """A body (J, d) seen through matrices (T, d, d), one a frame, a hundred frames a second."""
    return moving(np.einsum("tde,je->tjd", turn, body), 100.0)


def test_the_ridge_leaves_three_millionths_of_a_round_body_that_tumbles() -> None:
    # Six joints on the axes: (2/3 + 2 R) trace w = 2/3 trace w0, so 3 R of the rotation is left, with R = 1e-6.
    angle = 0.01 * np.arange(100)
    turn = np.tile(np.eye(3), (100, 1, 1))
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 2, 1], turn[:, 1, 2] = np.sin(angle), -np.sin(angle)
    shape = shape_speed(rigid(turn, np.concatenate([np.eye(3), -np.eye(3)])), smoothing=0.0)
    np.testing.assert_allclose((shape.speed / np.sqrt(shape.room))[1:-1], 3e-6, rtol=1e-3)


def test_the_ridge_leaves_two_millionths_of_a_round_picture_that_is_zoomed() -> None:
    # Four joints on the axes: (1/2 + R) trace A = 1/2 trace A0.
    zoom = (1 + 0.01 * np.arange(100))[:, None, None] * np.eye(2)
    shape = shape_speed(rigid(zoom, np.concatenate([np.eye(2), -np.eye(2)])), smoothing=0.0)
    np.testing.assert_allclose((shape.speed / np.sqrt(shape.room))[1:-1], 2e-6, rtol=1e-3)


HALVED = np.pi / np.sqrt(0.5 * np.log(2))  # seconds: half of a wave of this period is within the SD of one second


@pytest.mark.parametrize(("period", "left"), [(HALVED, 1 / 2), (HALVED / 2, 15 / 16), (2 * HALVED, 1 - 2**-0.25)])
def test_a_gaussian_of_one_second_is_the_drift_that_is_taken_off(period: float, left: float) -> None:
    # It keeps exp(-2 (pi SD / period)^2) of a wave.
    fps, count = 10.0, round(200 * period * 10)
    speed = 2 + np.sqrt(2) * np.sin(2 * np.pi * np.arange(count) / fps / period)  # SD 1
    ones, valid = np.ones(count), np.ones(count, bool)
    signal = shape_signal(ShapeSpeed(fps, speed, ones[:, None], ones, ones, valid, 3))
    assert signal.pulse == pytest.approx(left, rel=0.01)
