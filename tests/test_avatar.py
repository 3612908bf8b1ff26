"""The avatar: each of its steps by hand or on a planted player whose place in space is known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harmolab.body.kinematics import smooth
from harmolab.body.rotations import two_bones
from harmolab.musician.avatar import (
    HIP_ABOVE_SEAT,
    SHOULDERS,
    SPINE,
    UPPER_ARM,
    AvatarParams,
    aim,
    arm_lengths,
    avatar,
    bow,
    forward_offset,
    hand_axes,
    keyboard_depth,
    palm_is_down,
    placed_points,
    spine,
)
from harmolab.readers.bvh import WORLD, load_bvh, save_bvh
from harmolab.readers.player_points import (
    FINGERS,
    HANDS_12,
    INSTRUMENTS,
    KEYBOARD,
    PLAYER_50,
    PROPS,
    SIDES,
    STOOL,
    hand_joints,
    player_skeleton,
)
from harmolab.types import Motion
from study.experiments.player_in_space import Camera, PlayerInSpace, elbow_angles, player_in_space
from tests.builders import refused
from tests.notebook_cells import notebook_cells

OURS = AvatarParams()
CELLS = notebook_cells("20_players_and_avatars")
SHOULDERS_ONLY = player_skeleton(["left_shoulder", "right_shoulder"])


@pytest.fixture(scope="module")
def pianist() -> PlayerInSpace:
    return player_in_space("piano", seconds=8.0)


@pytest.fixture(scope="module")
def violinist() -> PlayerInSpace:
    return player_in_space("violin", seconds=8.0)


def of(motion: Motion, name: str) -> np.ndarray:
    return motion.positions[:, motion.skeleton.joints.index(name)]


def without(motion: Motion, is_missing: Callable[[str], bool]) -> Motion:
    """The points but for some, by their names."""
    keep = [joint for joint, name in enumerate(motion.skeleton.joints) if not is_missing(name)]
    skeleton = player_skeleton([motion.skeleton.joints[joint] for joint in keep])
    return Motion(motion.positions[:, keep], motion.fps, skeleton)


def changes_of_bones(motion: Motion) -> float:
    """Metres by which the bone that changes most does so."""
    parents = np.array(motion.skeleton.parents)
    child = parents >= 0
    lengths = np.linalg.norm(motion.positions[:, child] - motion.positions[:, parents[child]], axis=2)
    return float(np.ptp(lengths, axis=0).max())


# The planted player


def test_camera_shows_what_is_ahead_at_its_centre_and_nearer_things_larger() -> None:
    camera = Camera(distance=4.0, height=1.0, focal=1000.0, centre=(320.0, 240.0))
    np.testing.assert_allclose(camera.pixels(np.array([0.0, 1.0, 0.0])), [320.0, 240.0])
    np.testing.assert_allclose(camera.pixels(np.array([0.4, 1.2, 0.0])), [420.0, 190.0])
    np.testing.assert_allclose(camera.pixels(np.array([0.4, 1.2, 2.0])), [520.0, 140.0])


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_players_bones_keep_their_length_and_noise_is_what_it_is_said_to_be(instrument: str) -> None:
    player = player_in_space(instrument, seconds=5.0, noise=2.0)
    for side in SIDES:
        for bone in ((f"{side}_shoulder", f"{side}_elbow"), (f"{side}_elbow", f"{side}_wrist")):
            assert np.ptp(np.linalg.norm(of(player.space, bone[1]) - of(player.space, bone[0]), axis=1)) < 1e-9
    noise = player.points.positions - player.camera.pixels(player.space.positions)
    assert noise.std() == pytest.approx(2.0, rel=0.03)
    angles = np.degrees(elbow_angles(player.space))
    assert angles.min() > 60 and angles.max() < 170


def test_elbow_angle_of_a_right_angle_is_ninety_degrees() -> None:
    names = [f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "wrist")]
    arm = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0]])
    motion = Motion(np.tile(np.concatenate([arm, arm * [1, -1, 1]]), (2, 1, 1)), 24.0, player_skeleton(names))
    np.testing.assert_allclose(elbow_angles(motion), np.pi / 2)


def test_planted_player_refuses_what_cannot_be() -> None:
    refused("instrument must be piano or violin, got 'drum'", player_in_space, "drum")
    refused("noise of 0 or more", player_in_space, "piano", noise=-1.0)


# Two bones


def test_limb_of_two_bones_is_the_triangle_of_its_sides() -> None:
    root, target = np.zeros((2, 3)), np.array([[5.0, 0, 0], [0, 0, 5.0]])
    middle, end = two_bones(root, target, 3.0, 4.0, np.array([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(end, target)
    np.testing.assert_allclose(middle, [[1.8, -2.4, 0], [0, -2.4, 1.8]])


@pytest.mark.parametrize("target", [[0.0, 0.0, 0.0], [0.0, -9.0, 0.0], [0.1, 0.0, 0.0]])
def test_target_that_cannot_be_reached_is_pulled_onto_the_sphere(target: list[float]) -> None:
    middle, end = two_bones(np.zeros((1, 3)), np.array([target]), 0.3, 0.25, np.array([0.0, -1.0, 0.0]))
    assert np.linalg.norm(middle) == pytest.approx(0.3)
    assert np.linalg.norm(end - middle) == pytest.approx(0.25)
    assert np.linalg.norm(end) == pytest.approx(min(max(np.linalg.norm(target), 0.05), 0.55), abs=1e-6)


# Step 1: place


def test_shoulders_come_onto_the_avatars_by_one_similarity() -> None:
    turn = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    pixels = np.array([[[130.0, 0], [-70.0, 0], [30.0, 50.0]]]) @ turn.T + [300.0, 200.0]
    skeleton = player_skeleton(["left_shoulder", "right_shoulder", "left_hip"])
    placed = placed_points(Motion(np.repeat(pixels, 3, axis=0), 24.0, skeleton))
    assert placed.scale == pytest.approx(SHOULDERS / 200)
    np.testing.assert_allclose(placed.points["left_shoulder"][0], [SHOULDERS / 2, 0], atol=1e-12)
    np.testing.assert_allclose(placed.points["right_shoulder"][0], [-SHOULDERS / 2, 0], atol=1e-12)
    np.testing.assert_allclose(placed.points["left_hip"][0], [0, -50 * placed.scale], atol=1e-12)


def test_raised_left_hand_stays_the_left_one_in_a_mirrored_picture(violinist: PlayerInSpace) -> None:
    points = violinist.points
    mirrored = Motion(points.positions * [-1.0, 1.0], points.fps, points.skeleton)
    plain, other = avatar(points, "violin"), avatar(mirrored, "violin")
    assert of(plain, "left_wrist")[:, 0].mean() > 0.1 > of(plain, "right_wrist")[:, 0].mean()
    np.testing.assert_allclose(other.positions, plain.positions, atol=1e-9)


def test_farther_left_in_the_picture_is_nearer_in_a_mirror_too(pianist: PlayerInSpace) -> None:
    points = pianist.points
    mirrored = Motion(points.positions * [-1.0, 1.0], points.fps, points.skeleton)
    near, far = (of(avatar(points, "piano"), f"{side}_shoulder")[:, 2].mean() for side in ("right", "left"))
    assert near > far
    near, far = (of(avatar(mirrored, "piano"), f"{side}_shoulder")[:, 2].mean() for side in ("left", "right"))
    assert near > far


# Step 2: spine


def test_spine_has_its_mean_length_and_leads_from_the_hips_to_the_shoulders(pianist: PlayerInSpace) -> None:
    placed = placed_points(pianist.points)
    joints = spine(placed)
    middles = [(placed.points[f"left_{part}"] + placed.points[f"right_{part}"]) / 2 for part in ("shoulder", "hip")]
    lengths = np.linalg.norm(middles[0] - middles[1], axis=1)
    back = joints["neck"] - joints["pelvis"]
    np.testing.assert_allclose(np.linalg.norm(back, axis=1), lengths.mean())
    np.testing.assert_allclose(back[:, :2] / lengths.mean(), (middles[0] - middles[1]) / lengths[:, None], atol=1e-9)


def test_without_hips_the_root_is_a_spine_at_rest_below_the_shoulders(pianist: PlayerInSpace) -> None:
    joints = spine(placed_points(without(pianist.points, lambda name: "hip" in name)))
    np.testing.assert_allclose(joints["neck"] - joints["pelvis"], np.tile([0, SPINE, 0], (192, 1)), atol=1e-12)


def test_player_sits_on_the_stool_and_the_feet_rest_on_the_floor(pianist: PlayerInSpace) -> None:
    result = avatar(pianist.points, "piano")
    assert of(result, "pelvis")[:, 1].mean() == pytest.approx(0.45 + HIP_ABOVE_SEAT)
    assert of(result, "stool_front_low")[0, 1] == pytest.approx(0.45)
    assert np.abs(of(result, "stool_front_low_foot")[:, 1]).max() < 1e-12
    for side in SIDES:
        assert np.ptp(of(result, f"{side}_toe"), axis=0).max() < 1e-9
        assert 0 <= of(result, f"{side}_toe")[0, 1] < 0.05


# Step 3: arms


def test_depth_is_the_third_side_of_a_right_triangle() -> None:
    lengths = np.array([0.0, 3.0, 5.0, 6.0])
    np.testing.assert_allclose(forward_offset(lengths, 5.0), [5, 4, 0, 0])
    np.testing.assert_allclose(forward_offset(lengths, 5.0, "linear"), [5, 2, 0, 0])


def bare_forearm_error(*, smoothing: float, percentile: float, law: str) -> float:
    """Median depth error, shares of the forearm, of one of 90 px that swings up to the plane of the picture."""
    rng, times = np.random.default_rng(3), np.arange(24 * 60) / 24
    angle = np.pi / 2 * np.abs(np.sin(2 * np.pi * times / 5.3) * np.sin(2 * np.pi * times / 7.1))
    length = 90 * np.cos(angle)
    seen = np.hypot(length + rng.normal(0, 1, times.size), rng.normal(0, 1, times.size))
    seen = smooth(seen, smoothing, 24.0)
    return float(np.median(np.abs(forward_offset(seen, np.percentile(seen, percentile), law) / 90 - np.sin(angle))))


def test_bare_forearm_comes_back_and_the_linear_law_does_not() -> None:
    assert bare_forearm_error(smoothing=0.1, percentile=99.0, law="root") < 0.03
    assert bare_forearm_error(smoothing=0.0, percentile=100.0, law="root") > 0.035
    assert bare_forearm_error(smoothing=0.1, percentile=99.0, law="linear") > 0.25


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_player_comes_back_in_space(instrument: str, seed: int) -> None:
    player = player_in_space(instrument, seed=seed)
    result = avatar(player.points, instrument)
    errors = CELLS.depth_errors(player, result)
    assert all(errors[measure] <= most for measure, most in CELLS.DEPTH_LIMITS.items())
    for worse in (replace(OURS, depth="linear"), replace(OURS, elbow_depth=False), AvatarParams.paper()):
        assert CELLS.depth_errors(player, avatar(player.points, instrument, params=worse))["wrist depth"] > 25.0


def test_raw_lengths_and_the_longest_one_are_worse_for_the_violinist() -> None:
    player = player_in_space("violin")
    error, raw, longest = (
        CELLS.depth_errors(player, avatar(player.points, "violin", params=replace(OURS, **changes)))["wrist depth"]
        for changes in ({}, {"smoothing": 0.0}, {"smoothing": 0.0, "percentile": 100.0})
    )
    assert error < 0.8 * raw
    assert raw < longest


def test_forearm_that_never_lies_in_the_picture_has_a_least_length(pianist: PlayerInSpace) -> None:
    points = np.array(pianist.points.positions)
    names = PLAYER_50.joints
    for side in SIDES:
        points[:, names.index(f"{side}_elbow")] = points[:, names.index(f"{side}_wrist")] + 1.0
    assert arm_lengths(placed_points(Motion(points, 24.0, PLAYER_50)), OURS)[1] == pytest.approx(0.6 * SHOULDERS)


# Step 4: hands and fingers


def test_hand_turns_over_only_past_the_dead_band() -> None:
    offset = np.array([0.1, -0.1, 0.2, 0.1, -0.1, -0.14, -0.16, 0.1, 0.14, 0.2])
    expected = [True, True, True, True, True, True, False, False, False, True]
    np.testing.assert_array_equal(palm_is_down(offset, 0.15), expected)
    np.testing.assert_array_equal(palm_is_down(np.zeros(3), 0.15), [True] * 3)
    assert np.abs(np.diff(palm_is_down(offset, 0.0).astype(int))).sum() > 3


def test_palms_of_a_pianist_are_down_and_up_where_index_and_little_finger_change_places(pianist: PlayerInSpace) -> None:
    names, points = PLAYER_50.joints, np.array(pianist.points.positions)
    for side in SIDES:
        hand = hand_axes(placed_points(pianist.points), side, OURS)
        assert hand is not None
        assert hand.palm[:, 1].max() < 1e-9 and np.median(hand.palm[:, 1]) < -0.3
        pair = [names.index(f"{side}_index_1"), names.index(f"{side}_little_1")]
        points[:, pair] = points[:, pair[::-1]]
        other = hand_axes(placed_points(Motion(points, 24.0, PLAYER_50)), side, OURS)
        assert other is not None
        assert other.palm[:, 1].min() > -1e-9 and np.median(other.palm[:, 1]) > 0.3


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_fingers_point_where_they_do_in_the_picture(instrument: str) -> None:
    player = player_in_space(instrument, seconds=4.0, noise=0.0)
    turn = OURS.piano_turn if instrument == "piano" else 0.0
    placed, result = placed_points(player.points, turn=turn), avatar(player.points, instrument)
    for side in SIDES:
        for finger in FINGERS:
            root, tip = f"{side}_{finger}_1", f"{side}_{finger}_4"
            seen, drawn = placed.points[tip] - placed.points[root], (of(result, tip) - of(result, root))[:, :2]
            cosine = (seen * drawn).sum(axis=1) / np.linalg.norm(seen, axis=1) / np.linalg.norm(drawn, axis=1)
            np.testing.assert_allclose(cosine, 1.0, atol=1e-9)


# Step 5: piano


def test_wrists_lie_on_one_line_that_is_nearer_at_the_left() -> None:
    wrists = {"left": np.array([[0.3, -0.3, 0.2], [0.1, -0.3, 0.5]]), "right": np.array([[-0.2, -0.3, 0.4]] * 2)}
    placed = keyboard_depth(wrists, np.radians(35))
    offsets = np.concatenate([wrist[:, 2] + np.tan(np.radians(35)) * wrist[:, 0] for wrist in placed.values()])
    expected = np.median([0.2 + 0.3 * 0.7002075, 0.5 + 0.1 * 0.7002075, 0.4 - 0.2 * 0.7002075, 0.4 - 0.2 * 0.7002075])
    np.testing.assert_allclose(offsets, expected)
    np.testing.assert_array_equal(placed["left"][:, :2], wrists["left"][:, :2])


def test_pianist_is_turned_by_a_fixed_angle_and_the_keyboard_with_her(pianist: PlayerInSpace) -> None:
    for angle in (np.radians(35), np.radians(20)):
        result = avatar(pianist.points, "piano", params=replace(OURS, piano_turn=angle))
        for left, right in (("left_shoulder", "right_shoulder"), ("keyboard_front_low", "keyboard_front_high")):
            across = (of(result, left) - of(result, right)).mean(axis=0)
            assert np.arctan2(-across[2], across[0]) == pytest.approx(angle, abs=1e-2)


def test_keyboard_rests_under_the_fingertips_before_the_player(pianist: PlayerInSpace) -> None:
    result = avatar(pianist.points, "piano")
    corners = np.stack([of(result, f"keyboard_{corner}") for corner in ("front_low", "front_high", "back_high")])
    assert np.ptp(corners, axis=1).max() == 0.0
    tips = np.stack([of(result, f"{side}_{finger}_4") for side in SIDES for finger in FINGERS])
    assert np.abs(np.median(tips[..., 1]) - corners[0, 0, 1]) < 0.05
    planted = np.stack([of(pianist.space, f"{side}_{finger}_4") for side in SIDES for finger in FINGERS])
    assert corners[0, 0, 1] == pytest.approx(np.percentile(planted[..., 1], 10), abs=0.05)
    assert np.linalg.norm(corners[0] - corners[1], axis=1)[0] == pytest.approx(1.22)


def test_hands_that_a_high_camera_shows_too_low_come_above_the_thighs(pianist: PlayerInSpace) -> None:
    points, names = np.array(pianist.points.positions), PLAYER_50.joints
    low = [number for number, name in enumerate(names) if "shoulder" not in name and "hip" not in name]
    points[:, low, 1] += 100.0
    result = avatar(Motion(points, 24.0, PLAYER_50), "piano")
    assert of(result, "left_wrist")[:, 1].min() > of(result, "left_knee")[:, 1].max()


# Step 6: violin


def angle_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(T,) radians between vectors (T, 3), exact for small ones."""
    return np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1))


def test_violin_keeps_the_four_constraints(violinist: PlayerInSpace) -> None:
    result = avatar(violinist.points, "violin")
    chin, scroll, bridge = (of(result, f"violin_{part}") for part in ("chin", "scroll", "bridge"))
    assert np.ptp(np.linalg.norm(chin - of(result, "head"), axis=1)) < 1e-9
    assert angle_between(scroll - chin, of(result, "left_index_1") - chin).max() < 1e-6
    frog, tip = of(result, "bow_frog"), of(result, "bow_tip")
    assert np.ptp(np.linalg.norm(frog - of(result, "right_wrist"), axis=1)) < 1e-9
    assert angle_between(tip - frog, bridge - frog).max() < 1e-6


def test_hand_on_the_bridge_gives_no_nan() -> None:
    place = np.array([[0.1, 1.0, 0.2]] * 3)
    result = bow(place, None, place)
    np.testing.assert_allclose(np.linalg.norm(result["bow_tip"] - result["bow_frog"], axis=1), 0.74)
    np.testing.assert_array_equal(aim(place, place, np.array([0.0, 0.0, 1.0])), [[0, 0, 1]] * 3)


# Step 7, and what is missing


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_body_is_the_first_tree_and_props_are_the_others(instrument: str) -> None:
    result = avatar(player_in_space(instrument, seconds=2.0).points, instrument)
    joints, parents = result.skeleton.joints, result.skeleton.parents
    assert joints[0] == "pelvis" and parents[0] == -1
    assert {joints[i] for i, parent in enumerate(parents) if parent < 0} - {"pelvis"} <= PROPS
    assert all(
        (name in PROPS) == (joints[parent] in PROPS)
        for name, parent in zip(joints, parents, strict=True)
        if parent >= 0
    )
    played = (
        set(KEYBOARD)
        if instrument == "piano"
        else {"violin_chin", "violin_bridge", "violin_scroll", "bow_frog", "bow_tip"}
    )
    assert played | set(STOOL) <= set(joints)
    assert {name for side in SIDES for name in hand_joints(side)[1:]} <= set(joints)


MISSING: dict[str, Callable[[str], bool]] = {
    "nothing": lambda name: False,
    "hips": lambda name: "hip" in name,
    "right hand": lambda name: name in hand_joints("right"),
    "left hand": lambda name: name in hand_joints("left"),
    "left arm": lambda name: name in (*hand_joints("left"), "left_elbow", "left_wrist"),
    "right arm": lambda name: name in (*hand_joints("right"), "right_elbow", "right_wrist"),
    "elbows": lambda name: "elbow" in name,
    "body's wrists": lambda name: "wrist" in name,
    "roots of fingers": lambda name: name.endswith("_1"),
    "thumbs": lambda name: "thumb" in name,
    "all but shoulders": lambda name: "shoulder" not in name,
}


@pytest.mark.parametrize("part", MISSING)
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_missing_parts_are_left_out_and_the_rest_works(instrument: str, part: str) -> None:
    points = player_in_space(instrument, seconds=3.0).points
    result = avatar(without(points, MISSING[part]), instrument)  # a Motion has no NaN
    assert changes_of_bones(result) < 1e-6
    full = avatar(points, instrument)
    assert set(result.skeleton.joints) <= set(full.skeleton.joints)
    if part in ("left arm", "all but shoulders"):
        assert not [name for name in result.skeleton.joints if name.startswith(("left_elbow", "left_w", "left_index"))]
    if part in ("right arm", "all but shoulders"):
        assert "bow_tip" not in result.skeleton.joints
        assert (instrument == "violin") == ("violin_scroll" in result.skeleton.joints)
    if part in ("right hand", "roots of fingers"):
        assert not [name for name in result.skeleton.joints if name.startswith("right_index")]


def test_points_that_lie_on_one_another_give_no_nan() -> None:
    points = np.zeros((3, 50, 2))
    points[:, PLAYER_50.joints.index("left_shoulder")] = [100.0, 0.0]
    for instrument in INSTRUMENTS:
        assert changes_of_bones(avatar(Motion(points, 24.0, PLAYER_50), instrument)) < 1e-6


def test_what_cannot_be_an_avatar_is_refused(pianist: PlayerInSpace) -> None:
    hands = Motion(np.random.default_rng(0).normal(0, 9, (4, 12, 2)), 20.0, HANDS_12)
    refused("needs left_shoulder and right_shoulder", avatar, hands, "piano")
    refused("both shoulders lie on one point", avatar, Motion(np.zeros((3, 2, 2)), 24.0, SHOULDERS_ONLY), "violin")
    refused("these are in space", avatar, pianist.space, "piano")
    refused("instrument must be piano or violin, got 'cello'", avatar, pianist.points, "cello")


@pytest.mark.parametrize(
    "wrong",
    [{"depth": "square"}, {"percentile": 101.0}, {"percentile": 0.0}, {"smoothing": -0.1}, {"piano_turn": 35.0}],
)
def test_settings_out_of_range_are_refused_by_name(wrong: dict[str, object]) -> None:
    refused(next(iter(wrong)), AvatarParams, **wrong)


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_avatar_with_its_props_goes_through_a_bvh(instrument: str, tmp_path: Path) -> None:
    result = avatar(player_in_space(instrument, seconds=2.0).points, instrument)
    save_bvh(tmp_path / "a.bvh", result)
    loaded = load_bvh(tmp_path / "a.bvh")
    assert loaded.skeleton.parents.count(-1) == 1
    assert set(loaded.skeleton.joints) == {*result.skeleton.joints, WORLD}
    order = [loaded.skeleton.joints.index(name) for name in result.skeleton.joints]
    np.testing.assert_allclose(loaded.positions[:, order], result.positions, atol=1e-4)


def test_arms_have_a_length_without_elbows(pianist: PlayerInSpace) -> None:
    assert arm_lengths(placed_points(without(pianist.points, MISSING["elbows"])), OURS)[0] == UPPER_ARM
