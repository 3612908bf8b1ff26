"""Kinetic features: energies worked out by hand, the published fault, frame rates, places."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import bench_motion_features
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics.features import kinetic_features
from harmolab.types import Motion
from tests.builders import refused

TWO = Skeleton(("still", "moving"), (-1, 0))
STEP = 1 / 60


def second_joint(x: np.ndarray, y: np.ndarray, z: np.ndarray, fps: float = 60.0) -> Motion:
    """A joint that rests at the origin, and one that moves."""
    moving = np.stack([x, y, z], axis=1)
    return Motion(np.stack([np.zeros_like(moving), moving], axis=1), fps, TWO)


def test_a_joint_at_constant_velocity_has_energy_and_spends_none():
    t = np.arange(120) / 60
    np.testing.assert_allclose(
        kinetic_features(second_joint(3 * t, 2 * t, 4 * t)), [0, 0, 0, 25, 4, 0], rtol=1e-9, atol=1e-9
    )


def test_a_falling_joint_spends_the_gravity():
    t = np.arange(120) / 60
    assert kinetic_features(second_joint(0 * t, -4.905 * t**2, 0 * t))[5] == pytest.approx(9.81)


def test_a_swing_has_the_energy_and_acceleration_of_means_over_five_steps():
    # The mean of five velocities is the way over five steps, 2 sin(5 pi f / 60) wide, by their time; that of five
    # accelerations the change of a velocity over them. Means over time: 1/2 for sin^2, 2 / pi for |sin|.
    f, t = 1.5, np.arange(3600) / 60
    found = kinetic_features(second_joint(0.2 * np.sin(2 * np.pi * f * t), 0 * t, 0 * t))
    window = 2 * np.sin(5 * np.pi * f * STEP) / (5 * STEP)
    assert found[3] == pytest.approx((0.2 * window) ** 2 / 2, rel=2e-3)
    assert found[5] == pytest.approx(0.2 * window * 2 * np.sin(np.pi * f * STEP) / STEP * 2 / np.pi, rel=2e-3)


def test_the_published_form_takes_a_place_for_an_acceleration():
    # Nothing moves, so an acceleration should be 0; p (1 / dt^2 - 1 / dt) is |(3, 0, 4)| * 3540.
    still = np.full(30, 1.0)
    assert kinetic_features(second_joint(3 * still, 0 * still, 4 * still))[5] == 0.0
    published = kinetic_features(second_joint(3 * still, 0 * still, 4 * still), form="aist++")
    np.testing.assert_allclose(published, [0, 0, 0, 0, 0, 5 * (60**2 - 60)])


def test_the_published_form_moves_with_the_place_in_the_room_and_ours_does_not():
    dance = bench_motion_features.moving_body(2.0)
    moved = replace(dance, positions=dance.positions + np.array([4.0, 0.0, -3.0]))
    np.testing.assert_allclose(kinetic_features(moved), kinetic_features(dance), rtol=1e-8)
    expenditure = slice(2, None, 3)
    change = kinetic_features(moved, form="aist++") / kinetic_features(dance, form="aist++")
    assert (change[expenditure] > 1.5).all()


@pytest.mark.parametrize("frames", [3, 4, 6, 7, 60])
def test_both_forms_are_those_of_plain_loops(frames: int):
    dance = bench_motion_features.moving_body(frames / 60)
    published = bench_motion_features.loop_kinetic(dance.positions)
    np.testing.assert_allclose(kinetic_features(dance, form="aist++"), published, rtol=1e-9)
    np.testing.assert_allclose(
        np.delete(kinetic_features(dance), slice(2, None, 3)), np.delete(published, slice(2, None, 3))
    )


@pytest.mark.parametrize("fps", [15, 25, 30, 90, 120])
def test_the_frame_rate_does_not_matter(fps: float):
    def found(rate: float) -> np.ndarray:
        return kinetic_features(synthetic_clip("rumba", seconds=8.0, fps=rate, seed=3).motion)

    # At 15 frames per second splines must guess the quickest accelerations.
    np.testing.assert_allclose(found(fps), found(60), rtol=0.06 if fps == 15 else 0.03, atol=2e-3)


def test_fillers_do_not_count():
    t = np.arange(120) / 60
    leap = np.where(np.arange(120) < 60, t, 100 * t)
    motion = replace(second_joint(leap, 0 * t, 0 * t), valid=np.arange(120) < 60)
    np.testing.assert_allclose(kinetic_features(motion), [0, 0, 0, 1, 0, 0], atol=1e-9)


def test_flat_short_and_invalid_motions_are_refused():
    t = np.arange(30) / 60
    motion = second_joint(t, t, t)
    refused("three-dimensional", kinetic_features, replace(motion, positions=motion.positions[..., :2]))
    refused(r"lasts 0.033 s, too short", kinetic_features, replace(motion, positions=motion.positions[:2], valid=None))
    refused("nowhere valid for 1/12 s", kinetic_features, replace(motion, valid=np.arange(30) % 4 != 0))


def test_an_unknown_form_is_refused():
    t = np.arange(30) / 60
    refused("form must be fixed or aist", kinetic_features, second_joint(t, t, t), form="faulty")
