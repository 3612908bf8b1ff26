"""A foot put elsewhere: the knee follows, no bone changes; feet that carry are held back by the legs."""

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton, foot_joints
from harmolab.metrics.quality import foot_skating
from harmolab.systems.training.feet import Leg, find_leg, moved_feet, planted_feet
from harmolab.systems.training.motion_code import bone_lengths
from harmolab.types import Motion
from tests.builders import cases

FPS = 15.0
WALKER = Skeleton(
    ("torso", "head", *(f"{part} {side}" for side in "LR" for part in ("hip", "knee", "ankle", "toe"))),
    (-1, 0, 0, 2, 3, 4, 0, 6, 7, 8),
)
LEFT, RIGHT = Leg(2, 3, 4, (4, 5)), Leg(6, 7, 8, (8, 9))


def standing(frames: int = 90) -> np.ndarray:
    """A dancer at rest with knees a little bent forwards (+z); ankles 5 cm high."""
    leg, aside = np.array([[0, 0.9, 0], [0, 0.48, 0.08], [0, 0.05, 0], [0, 0.0, 0.15]]), np.array([0.1, 0, 0])
    rest = np.concatenate([[[0, 1.0, 0], [0, 1.6, 0]], leg + aside, leg - aside])
    return np.tile(rest, (frames, 1, 1))


def test_legs_are_found_by_the_names_of_feet():
    assert [find_leg(WALKER, foot) for foot in foot_joints(WALKER)] == [LEFT, RIGHT]


@cases(
    "joints, parents",
    (("hip", "toe L"), (-1, 0)),  # no knee
    (("hip", "knee L", "toe L"), (-1, -1, 1)),  # no hip above the knee
    (("hip", "knee L", "heel L", "toe L"), (-1, 0, 1, 1)),  # which one is the ankle?
    (("hip", "knee L", "ankle L", "tail"), (-1, 0, 1, 1)),  # the knee carries something else
)
def test_what_is_no_leg_of_two_bones_is_none(joints: tuple[str, ...], parents: tuple[int, ...]):
    skeleton = Skeleton(joints, parents)
    assert find_leg(skeleton, foot_joints(skeleton)[0]) is None


def test_what_hangs_on_the_ankle_goes_with_it():
    skeleton = Skeleton(("hip", "knee L", "ankle L", "ball L", "toe L"), (-1, 0, 1, 2, 3))
    assert find_leg(skeleton, (2,)).foot == (2, 3, 4)


def test_a_moved_foot_arrives_and_no_bone_changes():
    positions = standing(50)
    shift = np.random.default_rng(0).uniform([-0.05, 0.0, -0.05], [0.05, 0.1, 0.05], (50, 3))
    moved = moved_feet(positions, [LEFT], shift[:, None])
    np.testing.assert_allclose(moved[:, [4, 5]], positions[:, [4, 5]] + shift[:, None], atol=1e-9)
    bones = np.linalg.norm(moved - moved[:, list(WALKER.parents)], axis=2)[:, 1:]
    np.testing.assert_allclose(bones, np.tile(bone_lengths(positions, WALKER)[1:], (50, 1)), atol=1e-9)
    others = [joint for joint in range(10) if joint not in (3, 4, 5)]
    np.testing.assert_array_equal(moved[:, others], positions[:, others])
    assert (moved[:, 3, 2] > moved[:, 4, 2] - 0.1).all() and (moved[:, 3, 2] > 0).all()  # the knee stays in front


def test_a_foot_goes_no_further_than_the_leg_reaches():
    positions = standing(2)
    moved = moved_feet(positions, [LEFT], np.array([[[0.0, -3.0, 0.0]]] * 2))
    bones = bone_lengths(moved, WALKER)
    np.testing.assert_allclose(bones, bone_lengths(positions, WALKER), atol=1e-9)
    assert np.linalg.norm(moved[0, 4] - moved[0, 2]) == pytest.approx(0.99 * (bones[3] + bones[4]))


def test_a_straight_leg_bends_forwards():
    positions = standing(1)
    positions[:, 3, 2] = 0.0
    assert moved_feet(positions, [LEFT], np.array([[[0.0, 0.1, 0.0]]]))[0, 3, 2] > 0.1


def test_no_shift_changes_nothing():
    np.testing.assert_allclose(moved_feet(standing(3), [RIGHT], np.zeros((3, 1, 3))), standing(3), atol=0.01)


def swaying() -> np.ndarray:
    """The body goes 10 cm to and fro twice a second over feet that go with it, as a network makes it."""
    shift = 0.1 * np.sin(4 * np.pi * np.arange(90) / FPS)
    return standing() + shift[:, None, None] * np.array([1.0, 0, 0])


def test_legs_hold_sliding_feet_back_while_the_body_dances_on():
    planted = planted_feet(swaying(), FPS, WALKER)
    before, after = (foot_skating(Motion(each, FPS, WALKER)) for each in (swaying(), planted))
    assert after < 0.25 * before
    np.testing.assert_allclose(*[np.diff(each[20:70, :2], axis=0) for each in (planted, swaying())], atol=1e-3)
    np.testing.assert_allclose(bone_lengths(planted, WALKER), bone_lengths(swaying(), WALKER), atol=1e-9)


def test_a_foot_in_the_air_goes_its_own_way():
    kicking = standing()
    lift = np.sin(2 * np.pi * np.arange(90) / 30).clip(min=0)
    kicking[:, [4, 5]] += 0.3 * lift[:, None, None] * np.array([0, 1.0, 1.0])
    kicking = moved_feet(standing(), [LEFT], (kicking[:, 4] - standing()[:, 4])[:, None])
    np.testing.assert_allclose(planted_feet(kicking, FPS, WALKER), kicking, atol=0.03)
