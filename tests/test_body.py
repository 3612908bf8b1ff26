"""The body: kernels on joint positions, names of joints, the joint tree, the body frame, with answers by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from harmolab.body import kinematics, skeletons
from harmolab.musician import similarities
from harmolab.types import FloatArray, Motion
from tests.builders import along_x, cases, refused

# One joint goes 3 to the right and 4 up (5 in all), another 2 forward; then only the first moves, 1 back.
STEPS = np.array([[[0, 0, 0], [0, 0, 0]], [[3, 4, 0], [0, 0, 2]], [[2, 4, 0], [0, 0, 2]]], dtype=float)


@cases(
    "reading, expected",
    ("norm", [7, 7, 1]),  # 5 + 2
    ("signed", [9, 9, -1]),  # 3 + 4 + 2
    ("norm_of_sum", [np.sqrt(29), np.sqrt(29), 1]),  # of (3, 4, 2)
)
def test_joint_speed_sums_over_joints_and_repeats_its_first_value(reading, expected):
    np.testing.assert_allclose(kinematics.joint_speed(STEPS, reading=reading), expected)
    np.testing.assert_allclose(kinematics.joint_speed(STEPS, 15.0, reading=reading), 15 * np.array(expected))


def test_a_joint_that_turns_back_while_another_goes_on_spreads_the_directions():
    reversing, steady = [0, 1, 0, -1], [0, 1, 2, 3]
    positions = np.stack([reversing, steady], axis=1)[:, :, None] * np.ones(3)
    # At frame 2 the turns 1 - cos are 2 and 0, SD 1; at frame 3 both go on. The first two frames repeat the third.
    np.testing.assert_allclose(kinematics.direction_spread(positions), [1, 1, 1, 0], atol=1e-12)


def test_a_joint_at_rest_does_not_turn():
    moving, resting = [0, 1, 2, 3], [0, 0, 0, 0]
    positions = np.stack([moving, resting], axis=1)[:, :, None] * np.ones(3)
    np.testing.assert_array_equal(kinematics.direction_spread(positions), [0, 0, 0, 0])


@pytest.mark.parametrize("frames", [2, 3])
def test_direction_spread_of_very_short_motion_is_nothing(frames):
    positions = np.arange(frames * 3.0).reshape(frames, 1, 3)
    np.testing.assert_array_equal(kinematics.direction_spread(positions), np.zeros(frames))


def test_smoothing_by_nothing_and_the_rate_there_is_change_nothing():
    motion = along_x([0, 1, 2], fps=60.0)
    assert kinematics.smooth(STEPS, 0.0, 25.0) is kinematics.smooth_positions(STEPS, 0.0, 25.0) is STEPS
    assert kinematics.resample_motion(motion, 60.0) is kinematics.upsample_motion(motion, 60.0) is motion


@pytest.mark.parametrize("fps", [25.0, 50.0])
def test_smoothing_is_measured_in_seconds(fps):
    curve = np.zeros(round(4 * fps) + 1)
    middle = round(2 * fps)
    curve[middle] = 1.0
    smoothed = kinematics.smooth(curve, 0.2, fps)
    # A Gaussian of 0.2 s falls to exp(-1/2) at 0.2 s.
    assert smoothed[middle + round(0.2 * fps)] / smoothed[middle] == pytest.approx(np.exp(-0.5), rel=1e-9)


def test_smoothing_positions_makes_no_stop_at_the_ends_and_keeps_a_resting_joint_exactly_at_rest():
    course = np.arange(30.0)[:, None, None] * np.array([1.0, -2.0, 0.5]) + 7.0
    np.testing.assert_allclose(kinematics.smooth_positions(course, 0.1, 25.0), course, atol=1e-9)
    assert np.ptp(kinematics.smooth_positions(np.full((30, 2, 3), 0.1), 0.1, 25.0), axis=0).max() == 0


def test_a_tie_takes_the_sign_before_it_and_one_before_the_first_step_has_none():
    curve = np.array([0.0, 1.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(kinematics.step_signs(curve), [1, 1, -1, -1])
    np.testing.assert_array_equal(kinematics.step_signs(curve, carry=False), [1, 0, -1, 0])
    np.testing.assert_array_equal(kinematics.step_signs(np.array([1.0, 1.0, 2.0])), [0, 1])


def test_a_step_of_a_millionth_of_the_maximum_is_a_tie():
    np.testing.assert_array_equal(kinematics.step_signs(np.array([1.0, 1.0 - 9e-7, 0.5]), carry=False), [0, -1])
    np.testing.assert_array_equal(kinematics.step_signs(np.array([1.0, 1.0 - 2e-6, 0.5]), carry=False), [-1, -1])


@pytest.mark.parametrize(("plateau", "expected"), [("last", [3]), ("middle", [2]), ("literal", [])])
def test_a_flat_top_is_a_peak_and_a_flat_bottom_a_valley(plateau: str, expected: list[int]) -> None:
    top = np.array([0.0, 1.0, 1.0, 1.0, 0.0])
    finders = (kinematics.peak_frames, kinematics.valley_frames)
    assert [list(find(top, plateau=plateau)) for find in finders] == [expected, []]
    assert [list(find(-top, plateau=plateau)) for find in finders] == [[], expected]


def test_a_sharp_turn_is_where_it_is_in_every_reading():
    curve = np.array([0.0, 2.0, 1.0, 3.0])
    for plateau in ("last", "middle", "literal"):
        np.testing.assert_array_equal(kinematics.turning_points(curve, plateau=plateau), [1, 2])


@pytest.mark.parametrize("curve", [[1.0, 1.0, 1.0], [0.0, 1.0, 2.0], [1.0, 1.0, 0.0, 0.0], [3.0], []])
def test_a_curve_that_never_turns_has_no_turning_points(curve):
    assert kinematics.turning_points(np.array(curve)).size == 0


def test_an_unknown_reading_is_refused():
    refused("reading must be norm, signed or norm_of_sum, got 'l1'", kinematics.joint_speed, STEPS, reading="l1")
    refused("must be last, middle or literal, got 'first'", kinematics.turning_points, np.zeros(3), plateau="first")


def test_valleys_and_peaks_share_the_turning_points():
    curve = np.array([2.0, 0.0, 3.0, 3.0, 1.0, 2.0])
    np.testing.assert_array_equal(kinematics.turning_points(curve), [1, 3, 4])
    np.testing.assert_array_equal(kinematics.valley_frames(curve), [1, 4])
    np.testing.assert_array_equal(kinematics.peak_frames(curve), [3])


def test_the_top_of_a_parabola_is_found_between_the_samples_and_a_flat_extremum_stays_on_its_sample():
    np.testing.assert_allclose(kinematics.refine_extrema(5 - (np.arange(6) - 2.3) ** 2, np.array([2])), [2.3])
    np.testing.assert_array_equal(kinematics.refine_extrema(np.ones(5), np.array([2])), [2])


def test_resampling_puts_new_frames_on_the_straight_line_between_old_ones_and_keeps_the_length_within_a_frame():
    finer = kinematics.resample_motion(along_x([0, 2, 0], fps=2.0), 4.0)
    np.testing.assert_allclose(finer.positions[:, 0, 0], [0, 1, 2, 1, 0], atol=1e-12)
    assert kinematics.resample_motion(along_x(range(150), fps=25.0), 15.0).n_frames == 90


def test_a_new_frame_is_valid_where_both_frames_around_it_are():
    motion = replace(along_x([0, 1, 2, 3], fps=1.0), valid=[True, True, False, True])
    assert kinematics.resample_motion(motion, 2.0).valid.tolist() == [True, True, *[False] * 5]


def test_resampling_below_two_frames_is_refused():
    short = along_x([0, 1], fps=25.0)
    refused(r"a motion of 0.080 s has no two frames at 15 fps", kinematics.resample_motion, short, 15.0)


def test_upsampling_follows_a_cubic_exactly():
    times = np.arange(8.0)
    fine = kinematics.upsample_motion(along_x(times**3 - 4 * times**2, fps=1.0), 4.0)
    expected = np.arange(29) / 4
    np.testing.assert_allclose(fine.positions[:, 0, 0], expected**3 - 4 * expected**2, atol=1e-9)
    assert fine.fps == 4.0


def test_upsampling_keeps_a_resting_joint_at_rest():
    resting = np.full((9, 1, 3), 0.1)
    moving = np.random.default_rng(1).normal(size=(9, 1, 3))
    motion = Motion(np.concatenate([resting, moving], axis=1), 5.0, skeletons.Skeleton.unnamed(2))
    assert np.ptp(kinematics.upsample_motion(motion, 20.0).positions[:, 0], axis=0).max() == 0


@pytest.mark.parametrize("change_rate", [kinematics.upsample_positions, kinematics.resample_positions])
def test_no_motion_is_blown_up_beyond_all_memory(change_rate: Callable[..., np.ndarray]):
    positions = np.broadcast_to(0.0, (500_000, 4, 3))  # takes no room itself
    fault = "500000 frames of 4 joints at 1 fps would be 60000000 frames at 120 fps"
    refused(fault, change_rate, positions, 1.0, 120.0)


def test_similarity_scales_turns_and_shifts_in_this_order():
    # In a picture (y down) a quarter turn clockwise: right becomes down.
    quarter = similarities.Similarity(2.0, np.pi / 2, np.array([1.0, 0.0]))
    np.testing.assert_allclose(quarter.apply(np.array([[3.0, 0.0], [0.0, 1.0]])), [[1, 6], [-1, 0]], atol=1e-12)


def test_inverse_of_a_similarity_undoes_it(rng: np.random.Generator):
    points = rng.normal(size=(4, 3, 2))
    similarity = similarities.Similarity(0.7, -2.0, np.array([5.0, -9.0]))
    np.testing.assert_allclose(similarity.inverse().apply(similarity.apply(points)), points, atol=1e-12)


def test_fitted_similarity_never_mirrors():
    corner = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    fit = similarities.fit_similarity(corner, corner * [-1, 1])
    # By hand, centred z: sum |z|^2 = 10/3, and w = -conj(z), so sum conj(z) w = -sum conj(z)^2 = -(2 + 4i/3).
    assert fit.scale * np.exp(1j * fit.rotation) == pytest.approx(-(2 + 4j / 3) / (10 / 3))


def test_planted_similarity_is_fitted_exactly(rng: np.random.Generator):
    points = rng.normal(size=(4, 2))
    target = similarities.Similarity(1.3, 3.0, np.array([20.0, -7.0])).apply(points)
    fit = similarities.fit_similarity(points, target)
    np.testing.assert_allclose([fit.scale, fit.rotation, *fit.shift], [1.3, 3.0, 20.0, -7.0], atol=1e-12)


def test_many_similarities_are_fitted_at_once(rng: np.random.Generator):
    points, target = rng.normal(size=(6, 4, 2)), rng.normal(size=(4, 2))
    factors, shifts = similarities.similarity_factors(points, np.broadcast_to(target, points.shape))
    for pose, factor, shift in zip(points, factors, shifts, strict=True):
        fit = similarities.fit_similarity(pose, target)
        assert factor == pytest.approx(fit.scale * np.exp(1j * fit.rotation))
        assert [shift.real, shift.imag] == pytest.approx(list(fit.shift))


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@cases(
    "points, target, fault",
    (SQUARE, np.ones((4, 2)), "the target lie in one place"),
    (np.full((4, 2), 7.3), SQUARE, "the points lie in one place"),
    (SQUARE[:1], SQUARE[:1], "the points lie in one place"),
    (SQUARE * [1, np.nan], SQUARE, "hold NaN or infinity"),
    (SQUARE, SQUARE[:3], r"got \(4, 2\) and \(3, 2\)"),
    (SQUARE, SQUARE * [-1, 1], "are the points mirrored"),
)
def test_what_no_similarity_can_be_fitted_to_is_refused(points, target, fault):
    refused(fault, similarities.fit_similarity, points, target)


# Hips 20 cm and shoulders 30 cm to either side, an elbow and a hand on the left, a nose to the front.
BODY = skeletons.Skeleton(
    ("nose", "left_hip", "right_hip", "left_shoulder", "right_shoulder", "left_elbow", "left_wrist"),
    (-1, 0, 0, 0, 0, 3, 5),
)
POSE = np.array(
    [(0, 1.6, 0.1), (0.2, 1, 0), (-0.2, 1, 0), (0.3, 1.5, 0), (-0.3, 1.5, 0), (0.5, 1.2, 0.1), (0.6, 1, 0.4)]
)
TORSO = np.array([0.0, 1.25, 0.0])  # mean of hips and shoulders
TREE = skeletons.Skeleton(("toe", "knee", "hip", "hand", "head"), (1, 2, -1, 2, 2))
FPS = 20.0
FRAMES = 60
STATUE = np.tile(POSE, (FRAMES, 1, 1))


def travelled(poses: FloatArray, seed: int = 3) -> FloatArray:
    """Poses (T, J, 3) carried about the room and turned by uneven steps, several turns in all, and up and down."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 0.6, len(poses)).cumsum()
    place = rng.normal(0.0, 0.1, (len(poses), 1, 3)).cumsum(axis=0)
    return skeletons.turned(poses, angle[:, None]) + place


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
    ("mixamorig1_RightFoot", "right", "foot"),
    ("Character1_LeftArm", "left", "arm"),
    ("Bip001 L Thigh", "left", "thigh"),
    ("Bip01", "", "bip01"),
    ("J_Bip_C_Hips", "", "hips"),
    ("f_avg_R_Hip", "right", "hip"),
    ("CC_Base_L_Thigh", "left", "thigh"),
    ("DEF-upper_arm.L", "left", "upperarm"),
    ("rtoes", "right", "toes"),
    ("L_Foot", "left", "foot"),
    ("LHipJoint", "left", "hipjoint"),
    ("leftfoot", "left", "foot"),
    ("neck", "", "neck"),
    ("root", "", "root"),
    ("leg", "", "leg"),
)
def test_names_of_joints_tell_side_and_part(name: str, side: str, part: str):
    assert (skeletons.joint_side(name), skeletons.joint_part(name)) == (side, part)


def test_joints_of_a_foot_belong_together_those_without_side_stand_alone_and_no_feet_are_an_error():
    targets = ("ik_foot_root", "ik_foot_l", "foot_ik.R", "LeftFootIK")  # of inverse kinematics, may stand anywhere
    skeleton = skeletons.Skeleton(("right heel", "hip", "left toe", "right toe", "foot_1", *targets), (-1,) * 9)
    assert skeletons.foot_joints(skeleton) == ((2,), (0, 3), (4,))
    refused("no joint is called toe, heel, ankle or foot", skeletons.foot_joints, skeletons.Skeleton.unnamed(3))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left_hip", "right_hip"), ("hip L", "hip R"), ("LeftUpLeg", "RightUpLeg"),
        ("mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"),
        ("l_shoulder", "r_shoulder"), ("LShoulder", "RShoulder"), ("lhip", "rhip"), ("LHipJoint", "RHipJoint"),
        ("Shoulder.L", "Shoulder.R"), ("LEFT_HIP", "RIGHT_HIP"), ("hipL", "hipR"),
        ("mixamorig_LeftUpLeg", "mixamorig_RightUpLeg"), ("J_Bip_L_UpperLeg", "J_Bip_R_UpperLeg"),
    ],
)  # fmt: skip
def test_left_and_right_are_told_by_usual_names(left: str, right: str):
    assert skeletons.side_pairs(skeletons.Skeleton((right, "head", left), (-1, 0, 0))) == ((2, 0),)


@pytest.mark.parametrize("names", [("left_knee", "right_knee"), ("hip", "shoulder"), ("left_hip", "left_shoulder")])
def test_other_joints_make_no_pair(names: tuple[str, str]):
    assert skeletons.side_pairs(skeletons.Skeleton(names, (-1, 0))) == ()


# The tree


def test_children_order_and_subtree_of_a_tree_whose_root_stands_in_the_middle():
    assert skeletons.children(TREE.parents) == [[], [0], [1, 3, 4], [], []]
    assert skeletons.tree_order(TREE.parents) == (2, 1, 0, 3, 4)
    assert [skeletons.subtree(TREE.parents, joint) for joint in (1, 2)] == [(0, 1), (0, 1, 2, 3, 4)]


def test_several_roots_follow_one_another_and_a_ring_of_bones_has_no_order():
    assert skeletons.tree_order((-1, -1, 1, 0)) == (0, 3, 1, 2)
    refused(r"the skeleton's bones form a ring: \(-1, 2, 1\)", skeletons.tree_order, (-1, 2, 1))
    refused("form a ring", skeletons.skeleton_part, skeletons.Skeleton(tuple("abcd"), (-1, 2, 1, 1)), [0, 3])


def test_a_joint_left_out_hands_its_children_to_its_parent():
    assert skeletons.skeleton_part(TREE, [0, 2, 3]) == skeletons.Skeleton(("toe", "hip", "hand"), (1, -1, 1))


def test_ancestors_of_a_tree_hold_each_joint_and_all_above_it():
    assert skeletons.ancestors((1, 2, -1, 2)).tolist() == [[1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 1, 0], [0, 0, 1, 1]]
    refused(r"the skeleton's bones form a ring: \(-1, 2, 1\)", skeletons.ancestors, (-1, 2, 1))


# The body in space


def test_heading_follows_several_turns_without_jumps():
    turns = np.linspace(0.0, 5 * np.pi, 100)
    positions = skeletons.turned(np.tile(POSE, (100, 1, 1)), turns[:, None])
    np.testing.assert_allclose(skeletons.heading(positions, FPS, BODY, smoothing=0.0), turns, atol=1e-12)


def test_standing_height_is_that_of_nine_frames_in_ten():
    crouched = np.where(np.arange(100) < 50, 0.5, 1.0)[:, None, None] * POSE
    assert skeletons.standing_height(crouched) == pytest.approx(0.6)  # the nose at 1.6, the hips at 1.0


def test_a_camera_walks_along_with_a_steady_dancer():
    way = skeletons.camera_way(POSE + np.arange(200.0)[:, None, None] * [0.01, 0, 0], FPS)
    np.testing.assert_allclose(way[70:130] - POSE.mean(axis=0), np.arange(70, 130)[:, None] * [0.01, 0, 0], atol=1e-6)


def test_a_statue_that_travels_and_turns_stands_still_in_the_body_frame():
    positions = travelled(STATUE)
    assert kinematics.joint_speed(positions, FPS).min() > 1.0
    local = skeletons.body_frame(positions, FPS, BODY)
    np.testing.assert_allclose(local, STATUE - TORSO, atol=1e-12)
    np.testing.assert_allclose(kinematics.joint_speed(local, FPS), 0.0, atol=1e-9)


def test_a_waving_hand_keeps_its_speed_however_the_body_travels():
    poses = STATUE.copy()
    poses[:, 6] += np.outer(0.2 * np.sin(np.arange(FRAMES)), [0.6, 0.0, 0.8])
    local_speeds = speeds(skeletons.body_frame(travelled(poses), FPS, BODY))
    np.testing.assert_allclose(local_speeds[:, 6], 0.2 * np.abs(np.diff(np.sin(np.arange(FRAMES)))) * FPS, atol=1e-9)
    np.testing.assert_allclose(local_speeds[:, :6], 0.0, atol=1e-9)


def test_hips_decide_the_heading_when_the_shoulders_twist():
    poses = STATUE.copy()
    poses[:, 3:5] = skeletons.turned(poses[:, 3:5], 0.5 * np.sin(np.arange(FRAMES))[:, None])
    local_speeds = speeds(skeletons.body_frame(travelled(poses), FPS, BODY))
    np.testing.assert_allclose(local_speeds[:, :3], 0.0, atol=1e-9)
    assert local_speeds[:, 3:5].mean() > 0.5


def test_shoulders_decide_where_no_hips_are_named():
    body = skeletons.Skeleton(tuple(name.replace("hip", "side") for name in BODY.joints), BODY.parents)
    local = skeletons.body_frame(travelled(STATUE), FPS, body)
    np.testing.assert_allclose(local[:, 3:5], np.tile([[0.3, 0, 0], [-0.3, 0, 0]], (FRAMES, 1, 1)), atol=1e-12)


def test_points_of_a_picture_lose_their_travel_and_nothing_else():
    picture = STATUE[..., :2].copy()
    picture[:, 6, 0] += np.arange(FRAMES) / FPS  # a hand at 1 unit a second
    local = skeletons.body_frame(picture + np.random.default_rng(5).normal(size=(FRAMES, 1, 2)), FPS, BODY)
    np.testing.assert_allclose(local[:, :6], (STATUE - TORSO)[:, :6, :2], atol=1e-12)
    np.testing.assert_allclose(speeds(local)[:, 6], 1.0)


def test_joints_without_names_are_seen_from_their_root_and_not_turned():
    positions = travelled(STATUE)
    named_nothing = skeletons.Skeleton(tuple("abcdefg"), BODY.parents)
    np.testing.assert_array_equal(skeletons.body_frame(positions, FPS, named_nothing), positions - positions[:, :1])


def test_joints_without_bones_are_seen_from_their_mean():
    positions = travelled(STATUE)
    local = skeletons.body_frame(positions, FPS, skeletons.Skeleton.unnamed(7))
    np.testing.assert_allclose(local, positions - positions.mean(axis=1, keepdims=True))


def test_smoothing_keeps_the_noise_of_the_hips_from_shaking_the_hand():
    positions = np.tile(POSE, (400, 1, 1))
    positions[:, 1:3] += np.random.default_rng(1).normal(0.0, 0.01, (400, 2, 3)) * [0, 0, 1]
    shaken, steady = (speeds(skeletons.body_frame(positions, FPS, BODY, smoothing=s))[:, 6].mean() for s in (0.0, 0.5))
    assert steady < 0.5 * shaken


def test_positions_of_another_body_have_no_body_frame():
    fault = r"positions must be \(T, 7, 2 or 3\), got shape \(4, 5, 3\)"
    refused(fault, skeletons.body_frame, np.zeros((4, 5, 3)), FPS, BODY)
