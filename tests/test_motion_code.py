"""The motion code: poses in a canonical heading and the root's path as rates; what is coded comes back."""

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton, root_position
from harmolab.systems.training.motion_code import bone_lengths, decode_motion, encode_motion, n_channels, root_path
from harmolab.types import Clip
from tests.builders import refused

# Hips 20 cm to either side of the root, a nose 30 cm in front of it, 1 m above the floor.
BODY = Skeleton(("torso", "hip L", "hip R", "nose"), (-1, 0, 0, 0))
POSE = np.array([[0.0, 1.0, 0.0], [0.2, 1.0, 0.0], [-0.2, 1.0, 0.0], [0.0, 1.0, 0.3]])
FPS = 10.0


def placed(x: np.ndarray, z: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """BODY standing at (x, z) and facing `heading`, (T, 4, 3): 0 faces +z, a quarter turn faces +x."""
    turn = [
        np.column_stack([np.cos(heading), 0 * heading, np.sin(heading)]),
        np.tile([0.0, 1.0, 0.0], (len(heading), 1)),
        np.column_stack([-np.sin(heading), 0 * heading, np.cos(heading)]),
    ]
    return np.einsum("tij,kj->tki", np.stack(turn, axis=1), POSE) + np.stack([x, 0 * x, z], axis=1)[:, None]


@pytest.fixture(scope="module")
def dance(planted_clip: Clip) -> tuple[np.ndarray, float, Skeleton]:
    """Six seconds of a dancer who travels and turns."""
    return planted_clip.motion.positions, planted_clip.motion.fps, planted_clip.motion.skeleton


def test_walking_ahead_is_forward_velocity_whatever_the_direction():
    way, rest = np.arange(20) / FPS, np.zeros(20)
    ahead = encode_motion(placed(rest, way, rest), FPS, BODY)
    to_the_right = encode_motion(placed(way, rest, rest + np.pi / 2), FPS, BODY)
    np.testing.assert_allclose(ahead[:, -3:], np.tile([0.0, 1.0, 0.0], (20, 1)), atol=1e-6)
    np.testing.assert_allclose(ahead[:, :-3], np.tile(POSE.ravel(), (20, 1)), atol=1e-6)
    np.testing.assert_allclose(to_the_right, ahead, atol=1e-6)


def test_a_step_to_the_dancers_left_is_positive():
    way, rest = np.arange(20) / FPS, np.zeros(20)
    # Who faces away from the viewer (heading pi) has the left side at -x.
    code = encode_motion(placed(-way, rest, rest + np.pi), FPS, BODY)
    np.testing.assert_allclose(code[:, -3:], np.tile([1.0, 0.0, 0.0], (20, 1)), atol=1e-6)


def test_several_turns_on_the_spot_are_a_steady_yaw_rate():
    turn = np.arange(200) / FPS
    code = encode_motion(placed(0 * turn, 0 * turn, turn), FPS, BODY)
    # The smoothing of the heading sees the ends of the recording.
    np.testing.assert_allclose(code[6:-6, -1], 1.0, atol=1e-6)
    np.testing.assert_allclose(code[6:-6, :-3], np.tile(POSE.ravel(), (188, 1)), atol=1e-6)


def test_the_height_above_the_floor_is_kept():
    assert encode_motion(np.tile(POSE + np.array([0.0, 0.5, 0.0]), (5, 1, 1)), FPS, BODY)[0, 1] == pytest.approx(1.5)


@pytest.mark.parametrize("first", [0, 100])
def test_what_was_coded_is_decoded_from_any_frame_on(dance, first: int):
    positions, fps, skeleton = dance
    code = encode_motion(positions, fps, skeleton)
    assert (code.shape, code.dtype) == ((len(positions), n_channels(skeleton)), np.float32)
    np.testing.assert_array_equal(code[0, -3:], code[1, -3:])  # rates of the first frame repeat the second
    back = decode_motion(code[first:], fps, skeleton, start=root_path(positions, fps, skeleton)[first])
    np.testing.assert_allclose(back, positions[first:], atol=1e-5)


def test_without_a_start_the_dance_begins_at_the_origin_facing_the_viewer(dance):
    positions, fps, skeleton = dance
    first = decode_motion(encode_motion(positions, fps, skeleton), fps, skeleton)[0]
    assert root_position(first[None], skeleton)[0, [0, 2]] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_moving_and_turning_the_room_changes_no_code(dance):
    positions, fps, skeleton = dance
    angle = 2.0
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    elsewhere = positions @ turn.T + [3.0, 0.0, -7.0]
    np.testing.assert_allclose(*[encode_motion(each, fps, skeleton) for each in (positions, elsewhere)], atol=1e-5)


@pytest.mark.parametrize("joints", [("a", "b", "c", "d"), ("torso", "hip L", "knee R", "nose")])
def test_without_paired_names_nobody_turns(joints: tuple[str, ...]):
    turn = np.arange(50) / FPS
    code = encode_motion(placed(0 * turn, turn, turn), FPS, Skeleton(joints, BODY.parents))
    np.testing.assert_allclose(code[:, -3:], np.tile([0.0, 1.0, 0.0], (50, 1)), atol=1e-6)


def test_without_bones_the_root_is_the_mean_of_all_joints():
    skeleton = Skeleton.unnamed(4)
    np.testing.assert_allclose(root_position(POSE[None], skeleton), [[0.0, 1.0, 0.075]])
    positions = placed(np.arange(5.0), np.zeros(5), np.zeros(5))
    back = decode_motion(encode_motion(positions, FPS, skeleton), FPS, skeleton, start=(0.0, 0.075, 0.0))
    np.testing.assert_allclose(back, positions, atol=1e-5)


def test_where_left_and_right_coincide_the_heading_stays():
    flat = Skeleton(("torso", "hip L", "hip R"), (-1, 0, 0))
    facing_right = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, -0.2], [0.0, 1.0, 0.2]])
    lying = np.zeros((3, 3))
    # A minute apart, so that the smoothing reaches from none to the other.
    np.testing.assert_allclose(root_path(np.stack([lying, facing_right, lying, lying]), 1 / 60, flat)[:, 2], np.pi / 2)
    np.testing.assert_array_equal(root_path(np.stack([lying, lying]), FPS, flat)[:, 2], 0.0)


def test_bone_lengths_are_means_over_time_and_zero_at_the_root():
    np.testing.assert_allclose(bone_lengths(np.stack([POSE, 2 * POSE]), BODY), [0.0, 0.3, 0.3, 0.45])


def test_a_single_frame_has_a_code_at_rest():
    code = encode_motion(POSE[None], FPS, BODY)
    np.testing.assert_allclose(code, [[*POSE.ravel(), 0, 0, 0]], atol=1e-7)
    np.testing.assert_allclose(decode_motion(code, FPS, BODY), POSE[None], atol=1e-7)


def test_positions_of_another_body_are_refused():
    message = r"positions must be \(frames, 4, 3\) for this skeleton, got shape \(5, 3, 3\)"
    refused(message, encode_motion, np.zeros((5, 3, 3)), FPS, BODY)
    message = r"code must be \(frames, 15\) for this skeleton, got shape \(5, 12\)"
    refused(message, decode_motion, np.zeros((5, 12)), FPS, BODY)


@pytest.mark.parametrize("fps", [0.0, float("nan"), float("inf")])
def test_a_rate_that_is_none_is_refused(fps: float):
    refused(f"fps must be positive and finite, got {fps}", encode_motion, np.zeros((2, 4, 3)), fps, BODY)
    refused("fps must be positive", decode_motion, np.zeros((2, 15)), fps, BODY)


def test_coding_leaves_its_arguments_alone(dance):
    positions, fps, skeleton = dance
    code = encode_motion(positions, fps, skeleton).astype(np.float64)
    before = code.copy()
    decode_motion(code, fps, skeleton)
    np.testing.assert_array_equal(code, before)
