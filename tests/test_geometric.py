"""Geometric features: poses and movements that make one of them true, both forms, other skeletons."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import bench_motion_features
from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.data.synthetic import synthetic_clip
from harmolab.data.synthetic.dancer import DANCER
from harmolab.metrics.features import BODY_POINTS, GEOMETRIC_FEATURES, body_points, geometric_features
from harmolab.readers.keypoints import COCO_17
from harmolab.types import Motion
from tests.builders import cases, refused

SMPL_24: Skeleton = bench_motion_features.SMPL_24


def body(places: dict[str, tuple[float, float, float]] | None = None, velocities: dict | None = None) -> Motion:
    """A tenth of a second of somebody who stands facing +z, some joints elsewhere or moving (metres per second)."""
    standing, velocity = bench_motion_features.STANDING.copy(), np.zeros((24, 3))
    for name, place in (places or {}).items():
        standing[SMPL_24.joints.index(name)] = place
    for name, way in (velocities or {}).items():
        velocity[SMPL_24.joints.index(name)] = way
    return Motion(standing + np.arange(6)[:, None, None] / 60 * velocity, 60.0, SMPL_24)


def true_features(motion: Motion, **settings: str) -> set[str]:
    """The features that are true in every frame; none may be true in some only."""
    shares = geometric_features(motion, **settings)
    assert set(shares) <= {0.0, 1.0}
    return {name for name, share in zip(GEOMETRIC_FEATURES, shares, strict=True) if share}


def mirrored(motion: Motion) -> Motion:
    """The motion as a mirror shows it: x reversed, left and right exchanged."""
    names = motion.skeleton.joints
    other = {"l": "r", "r": "l"}
    sided = {name: other[name[0]] + name[1:] for name in names if name[0] in "lr" and name != "root"}
    order = [names.index(sided.get(name, name)) for name in names]
    return replace(motion, positions=motion.positions[:, order] * np.array([-1.0, 1.0, 1.0]))


def exchanged(name: str) -> str:
    """The same feature of the other side."""
    return name.replace("right", "?").replace("left", "right").replace("?", "left")


POSES = {
    "right hand above neck": {"rwrist": (-0.35, 1.7, 0)},
    "right elbow bent": {"rwrist": (-0.2, 1.35, 0.1)},
    "hands far apart sideways": {"rwrist": (-0.5, 0.93, 0), "lwrist": (0.5, 0.93, 0)},
    "right foot behind left leg": {"rankle": (-0.1, 0.2, -0.4)},
    "right foot raised": {"rankle": (-0.1, 0.4, 0)},
    "feet far apart sideways": {"rankle": (-0.3, 0.08, 0), "lankle": (0.3, 0.08, 0)},
    "right knee bent": {"rankle": (-0.09, 0.25, 0.29), "rtoes": (-0.09, 0.2, 0.3), "rknee": (-0.09, 0.5, 0.45)},
    "right upper arm abducted": {"relbow": (-0.4, 1.25, 0), "rwrist": (-0.4, 1.0, 0)},
    "right thigh abducted": {"rknee": (-0.45, 0.65, 0)},
    "root behind frontal plane": {"root": (0, 0.95, -0.2)},
    "spine horizontal": {"neck": (0, 0.95, 0.5), "chest": (0, 0.95, 0.3), "belly": (0, 0.95, 0.1)},
    "right hand low": {"rwrist": (-0.3, 0.2, 0.1)},
}


def test_nothing_is_true_of_somebody_who_stands_still():
    assert true_features(body()) == set()


@pytest.mark.parametrize("name", POSES)
def test_a_pose_makes_its_feature_true(name: str):
    assert name in true_features(body(POSES[name]))
    assert exchanged(name) in true_features(mirrored(body(POSES[name])))


SPEED = 0.6  # metres per second; upper arms of 25.6 cm want 0.46 to move, 0.36 to approach, 0.64 to be fast
MOVES = {
    "right hand moves forward": {"rwrist": (0, 0, SPEED)},
    "right hand moves up": {"rwrist": (0, SPEED, 0)},
    "hands approach each other": {"rwrist": (SPEED / 2, 0, 0), "lwrist": (-SPEED / 2, 0, 0)},
    "right hand leaves root": {"rwrist": (-SPEED, 0, 0)},
}


@pytest.mark.parametrize("name", MOVES)
def test_a_movement_makes_its_feature_true_and_the_opposite_one_does_not(name: str):
    assert true_features(body(velocities=MOVES[name])) == {name}
    assert true_features(mirrored(body(velocities=MOVES[name]))) == {exchanged(name)}
    backward = {joint: tuple(-part for part in way) for joint, way in MOVES[name].items()}
    assert name not in true_features(body(velocities=backward))


@cases("joint, name", ("rwrist", "right hand fast"), ("lankle", "left foot fast"), ("root", "root fast"))
def test_what_moves_faster_than_its_limit_is_fast(joint: str, name: str):
    assert name in true_features(body(velocities={joint: (0, 0.7, 0)}))
    assert name not in true_features(body(velocities={joint: (0, 0.55, 0)}))


def test_somebody_who_is_carried_is_fast_but_moves_no_limb():
    carried = body(velocities=dict.fromkeys(SMPL_24.joints, (0.0, 0.0, 1.0)))
    fast = {"right hand fast", "left hand fast", "right foot fast", "left foot fast", "root fast"}
    assert true_features(carried) == fast


def test_the_mirrored_dance_has_the_features_of_the_other_side():
    dance = bench_motion_features.moving_body(4.0)
    features, other = (
        dict(zip(GEOMETRIC_FEATURES, geometric_features(m), strict=True)) for m in (dance, mirrored(dance))
    )
    assert other == {name: features[exchanged(name)] for name in GEOMETRIC_FEATURES}


# The published form


def test_the_published_form_is_that_of_plain_loops():
    dance = bench_motion_features.moving_body(1.5)
    np.testing.assert_allclose(
        geometric_features(dance, form="aist++"), bench_motion_features.loop_geometric(dance.positions), atol=1e-12
    )


def test_the_published_form_doubles_speeds():
    slow = body(velocities={"rwrist": (0.1, -0.4, 0)})
    assert "right hand fast" in true_features(slow, form="aist++")
    assert "right hand fast" not in true_features(slow)


@cases(
    "velocities, published",
    ({"rwrist": (-0.3, 0, 0), "lwrist": (0.3, 0, 0)}, "hands approach each other"),
    ({"rwrist": (0, 0, -SPEED)}, "right hand moves forward"),
    ({"chest": (0, SPEED, 0)}, "right hand moves up"),
)
def test_the_published_form_takes_movements_for_others(velocities: dict, published: str):
    assert published in true_features(body(velocities=velocities), form="aist++")
    assert published not in true_features(body(velocities=velocities))


# What must not matter


@pytest.mark.parametrize("form", ["fixed", "aist++"])
def test_place_and_heading_do_not_matter(form: str):
    dance = bench_motion_features.moving_body(4.0)
    turn = np.array([[np.cos(2), 0, np.sin(2)], [0, 1, 0], [-np.sin(2), 0, np.cos(2)]])
    moved = replace(dance, positions=dance.positions @ turn + np.array([5.0, 3.0, -2.0]))
    np.testing.assert_allclose(geometric_features(moved, form=form), geometric_features(dance, form=form), atol=5e-3)


def test_the_size_of_the_dancer_does_not_matter():
    dance = bench_motion_features.moving_body(4.0)
    child = replace(dance, positions=0.6 * dance.positions)
    np.testing.assert_allclose(geometric_features(child), geometric_features(dance), atol=5e-3)


@pytest.mark.parametrize("fps", [15, 25, 30, 90, 120])
def test_the_frame_rate_does_not_matter(fps: float):
    def found(rate: float) -> np.ndarray:
        return geometric_features(synthetic_clip("cha-cha", seconds=8.0, fps=rate, seed=1).motion)

    assert np.count_nonzero(found(60)) > 10
    np.testing.assert_allclose(found(fps), found(60), atol=0.02)


def test_fillers_do_not_count():
    bent = body(POSES["right elbow bent"])
    motion = Motion(np.concatenate([bent.positions, body().positions]), 60.0, SMPL_24, np.arange(12) < 6)
    # Upper arm and shoulders are the same in both halves.
    np.testing.assert_array_equal(geometric_features(motion), geometric_features(bent))


# Joints


def weights(skeleton: Skeleton) -> dict[str, dict[str, float]]:
    """Which joints make each point, and how much."""
    rows = zip(BODY_POINTS, body_points(skeleton), strict=True)
    return {point: {skeleton.joints[j]: float(row[j]) for j in np.flatnonzero(row)} for point, row in rows}


@pytest.mark.parametrize("skeleton", [TANG_23, PAPER_21])
def test_points_of_the_recordings_are_found(skeleton: Skeleton):
    found = weights(skeleton)
    assert (found["lwrist"], found["rwrist"]) == ({"left_hand": 1.0}, {"right_wrist": 1.0})
    assert (found["ltoes"], found["belly"]) == ({"left_toe": 1.0}, {"torso": 1.0})
    assert found["root"] == {"left_hip": 0.5, "right_hip": 0.5}
    assert found["neck"] == {"left_shoulder": 0.5, "right_shoulder": 0.5}
    assert found["chest"] == {"torso": 0.5, "left_shoulder": 0.25, "right_shoulder": 0.25}


def test_points_of_smpl_are_found_under_both_of_its_namings():
    words = "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot "
    words += "right_foot neck left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow "
    words += "left_wrist right_wrist left_hand right_hand"
    np.testing.assert_array_equal(body_points(Skeleton(tuple(words.split()), SMPL_24.parents)), body_points(SMPL_24))


def test_points_of_a_bvh_file_are_found():
    words = "Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase Spine Spine1 Neck "
    words += "Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm RightForeArm RightHand"
    found = weights(Skeleton(tuple(words.split()), (-1,) * 21))
    told = {point: next(iter(joints)) for point, joints in found.items()}
    assert (told["root"], told["belly"], told["chest"]) == ("Hips", "Spine", "Spine1")
    assert (told["lshoulder"], told["lelbow"], told["lwrist"]) == ("LeftArm", "LeftForeArm", "LeftHand")
    assert (told["rhip"], told["rknee"], told["rankle"], told["rtoes"]) == (
        *("RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"),
    )


def test_every_row_of_weights_sums_to_one():
    np.testing.assert_allclose(body_points(DANCER).sum(axis=1), 1.0)


def test_missing_joints_are_named():
    dance = Motion(np.zeros((30, 17, 3)), 60.0, COCO_17)
    refused("no joint is called belly, chest, ltoes, rtoes, or alike", geometric_features, dance)


def test_one_foot_joint_a_leg_is_not_both_ankle_and_toes():
    words = [name.replace("lankle", "left foot") for name in SMPL_24.joints if name != "ltoes"]
    refused("no joint is called ltoes, or alike", body_points, Skeleton(tuple(words), (-1,) * 23))


@cases(
    "change, message",
    (lambda motion: replace(motion, positions=motion.positions[..., :2]), "three-dimensional"),
    (lambda motion: replace(motion, positions=motion.positions[:2], valid=None), "too short"),
    (lambda motion: replace(motion, valid=np.arange(6) % 2 == 0), "nowhere valid for 2 steps"),
)
def test_flat_short_and_invalid_motions_are_refused(change: Callable[[Motion], Motion], message: str):
    refused(message, geometric_features, change(body()))


def test_an_unknown_form_is_refused():
    refused("form must be fixed or aist", geometric_features, body(), form="published")


def test_a_body_without_extent_has_no_relations():
    assert true_features(Motion(np.zeros((30, 24, 3)), 60.0, SMPL_24)) == set()
