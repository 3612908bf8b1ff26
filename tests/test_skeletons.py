"""Names of joints, the joint tree, and the body frame, with answers by hand."""

import numpy as np
import pytest

from harmolab.body.kinematics import joint_speed
from harmolab.body.skeletons import (
    Skeleton,
    ancestors,
    body_frame,
    camera_way,
    children,
    foot_joints,
    heading,
    joint_part,
    joint_side,
    side_pairs,
    skeleton_part,
    standing_height,
    subtree,
    tree_order,
    turned,
)
from harmolab.types import FloatArray
from tests.builders import cases, refused

# Hips 20 cm and shoulders 30 cm to either side, an elbow and a hand on the left, a nose to the front.
BODY = Skeleton(
    ("nose", "left_hip", "right_hip", "left_shoulder", "right_shoulder", "left_elbow", "left_wrist"),
    (-1, 0, 0, 0, 0, 3, 5),
)
POSE = np.array(
    [[0, 1.6, 0.1], [0.2, 1, 0], [-0.2, 1, 0], [0.3, 1.5, 0], [-0.3, 1.5, 0], [0.5, 1.2, 0.1], [0.6, 1, 0.4]]
)
TORSO = np.array([0.0, 1.25, 0.0])  # mean of hips and shoulders
TREE = Skeleton(("toe", "knee", "hip", "hand", "head"), (1, 2, -1, 2, 2))
FPS = 20.0
FRAMES = 60


def travelled(poses: FloatArray, seed: int = 3) -> FloatArray:
    """Poses (T, J, 3) carried about the room and turned by uneven steps, several turns in all, and up and down."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 0.6, len(poses)).cumsum()
    place = rng.normal(0.0, 0.1, (len(poses), 1, 3)).cumsum(axis=0)
    return turned(poses, angle[:, None]) + place


def speeds(positions: FloatArray) -> FloatArray:
    """Speed of every joint over every step, (T - 1, J)."""
    return np.linalg.norm(np.diff(positions, axis=0), axis=2) * FPS


# Names


@cases(
    "name, side, part",
    ("left_ankle", "left", "ankle"),
    ("toe R", "right", "toe"),
    ("LeftToeBase", "left", "toebase"),
    ("mixamorig:RightFoot", "right", "foot"),
    ("rtoes", "right", "toes"),
    ("L_Foot", "left", "foot"),
    ("LHipJoint", "left", "hipjoint"),
    ("leftfoot", "left", "foot"),
    ("neck", "", "neck"),
    ("root", "", "root"),
    ("leg", "", "leg"),
)
def test_names_of_joints_tell_side_and_part(name: str, side: str, part: str):
    assert (joint_side(name), joint_part(name)) == (side, part)


def test_joints_of_a_foot_belong_together_and_joints_without_side_stand_alone():
    skeleton = Skeleton(("right heel", "hip", "left toe", "right toe", "foot_1"), (-1,) * 5)
    assert foot_joints(skeleton) == ((2,), (0, 3), (4,))


def test_a_body_without_feet_is_an_error():
    refused("no joint is called toe, heel, ankle or foot", foot_joints, Skeleton.unnamed(3))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left_hip", "right_hip"), ("hip L", "hip R"), ("LeftUpLeg", "RightUpLeg"),
        ("mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"),
        ("l_shoulder", "r_shoulder"), ("LShoulder", "RShoulder"), ("lhip", "rhip"), ("LHipJoint", "RHipJoint"),
        ("Shoulder.L", "Shoulder.R"), ("LEFT_HIP", "RIGHT_HIP"), ("hipL", "hipR"),
    ],
)  # fmt: skip
def test_left_and_right_are_told_by_usual_names(left: str, right: str):
    assert side_pairs(Skeleton((right, "head", left), (-1, 0, 0))) == ((2, 0),)


@pytest.mark.parametrize("names", [("left_knee", "right_knee"), ("hip", "shoulder"), ("left_hip", "left_shoulder")])
def test_other_joints_make_no_pair(names: tuple[str, str]):
    assert side_pairs(Skeleton(names, (-1, 0))) == ()


# The tree


def test_children_order_and_subtree_of_a_tree_whose_root_stands_in_the_middle():
    assert children(TREE.parents) == [[], [0], [1, 3, 4], [], []]
    assert tree_order(TREE.parents) == (2, 1, 0, 3, 4)
    assert subtree(TREE.parents, 1) == (0, 1)
    assert subtree(TREE.parents, 2) == (0, 1, 2, 3, 4)


def test_several_roots_follow_one_another():
    assert tree_order((-1, -1, 1, 0)) == (0, 3, 1, 2)


def test_a_ring_of_bones_has_no_order():
    refused(r"the skeleton's bones form a ring: \(-1, 2, 1\)", tree_order, (-1, 2, 1))


def test_a_joint_left_out_hands_its_children_to_its_parent():
    assert skeleton_part(TREE, [0, 2, 3]) == Skeleton(("toe", "hip", "hand"), (1, -1, 1))


def test_ancestors_of_a_tree_hold_each_joint_and_all_above_it():
    assert ancestors((1, 2, -1, 2)).tolist() == [[1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 1, 0], [0, 0, 1, 1]]
    refused(r"the skeleton's bones form a ring: \(-1, 2, 1\)", ancestors, (-1, 2, 1))


# The body in space


def test_heading_follows_several_turns_without_jumps():
    turns = np.linspace(0.0, 5 * np.pi, 100)
    positions = turned(np.tile(POSE, (100, 1, 1)), turns[:, None])
    np.testing.assert_allclose(heading(positions, FPS, BODY, smoothing=0.0), turns, atol=1e-12)


def test_standing_height_is_that_of_nine_frames_in_ten():
    crouched = np.where(np.arange(100) < 50, 0.5, 1.0)[:, None, None] * POSE
    assert standing_height(crouched) == pytest.approx(0.6)  # the nose at 1.6, the hips at 1.0


def test_a_camera_walks_along_with_a_steady_dancer():
    way = camera_way(POSE + np.arange(200.0)[:, None, None] * [0.01, 0, 0], FPS)
    np.testing.assert_allclose(way[70:130] - POSE.mean(axis=0), np.arange(70, 130)[:, None] * [0.01, 0, 0], atol=1e-6)


def test_a_statue_that_travels_and_turns_stands_still_in_the_body_frame():
    positions = travelled(np.tile(POSE, (FRAMES, 1, 1)))
    assert joint_speed(positions, FPS).min() > 1.0
    local = body_frame(positions, FPS, BODY)
    np.testing.assert_allclose(local, np.tile(POSE - TORSO, (FRAMES, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(joint_speed(local, FPS), 0.0, atol=1e-9)


def test_a_waving_hand_keeps_its_speed_however_the_body_travels():
    poses = np.tile(POSE, (FRAMES, 1, 1))
    poses[:, 6] += np.outer(0.2 * np.sin(np.arange(FRAMES)), [0.6, 0.0, 0.8])
    local_speeds = speeds(body_frame(travelled(poses), FPS, BODY))
    np.testing.assert_allclose(local_speeds[:, 6], 0.2 * np.abs(np.diff(np.sin(np.arange(FRAMES)))) * FPS, atol=1e-9)
    np.testing.assert_allclose(local_speeds[:, :6], 0.0, atol=1e-9)


def test_hips_decide_the_heading_when_the_shoulders_twist():
    poses = np.tile(POSE, (FRAMES, 1, 1))
    poses[:, 3:5] = turned(poses[:, 3:5], 0.5 * np.sin(np.arange(FRAMES))[:, None])
    local_speeds = speeds(body_frame(travelled(poses), FPS, BODY))
    np.testing.assert_allclose(local_speeds[:, :3], 0.0, atol=1e-9)
    assert local_speeds[:, 3:5].mean() > 0.5


def test_shoulders_decide_where_no_hips_are_named():
    joints = tuple(name.replace("hip", "side") for name in BODY.joints)
    local = body_frame(travelled(np.tile(POSE, (FRAMES, 1, 1))), FPS, Skeleton(joints, BODY.parents))
    np.testing.assert_allclose(local[:, 3:5], np.tile([[0.3, 0, 0], [-0.3, 0, 0]], (FRAMES, 1, 1)), atol=1e-12)


def test_points_of_a_picture_lose_their_travel_and_nothing_else():
    picture = np.tile(POSE[:, :2], (FRAMES, 1, 1))
    picture[:, 6, 0] += np.arange(FRAMES) / FPS  # a hand at 1 unit a second
    moved = picture + np.random.default_rng(5).normal(size=(FRAMES, 1, 2))
    local = body_frame(moved, FPS, BODY)
    np.testing.assert_allclose(local[:, :6], np.tile((POSE - TORSO)[:6, :2], (FRAMES, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(speeds(local)[:, 6], 1.0)


def test_joints_without_names_are_seen_from_their_root_and_not_turned():
    positions = travelled(np.tile(POSE, (FRAMES, 1, 1)))
    named_nothing = Skeleton(tuple("abcdefg"), BODY.parents)
    np.testing.assert_array_equal(body_frame(positions, FPS, named_nothing), positions - positions[:, :1])


def test_joints_without_bones_are_seen_from_their_mean():
    positions = travelled(np.tile(POSE, (FRAMES, 1, 1)))
    local = body_frame(positions, FPS, Skeleton.unnamed(7))
    np.testing.assert_allclose(local, positions - positions.mean(axis=1, keepdims=True))


def test_smoothing_keeps_the_noise_of_the_hips_from_shaking_the_hand():
    positions = np.tile(POSE, (400, 1, 1))
    positions[:, 1:3] += np.random.default_rng(1).normal(0.0, 0.01, (400, 2, 3)) * [0, 0, 1]
    shaken, steady = (speeds(body_frame(positions, FPS, BODY, smoothing=s))[:, 6].mean() for s in (0.0, 0.5))
    assert steady < 0.5 * shaken


def test_positions_of_another_body_have_no_body_frame():
    refused(r"positions must be \(T, 7, 2 or 3\), got shape \(4, 5, 3\)", body_frame, np.zeros((4, 5, 3)), FPS, BODY)
