"""The avatar, each step by hand or on a planted player whose place in space is known; how musicians are drawn."""

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import smooth
from harmolab.body.rotations import two_bones
from harmolab.body.skeletons import Skeleton, skull_and_limbs
from harmolab.data.synthetic import DANCER, synthetic_clip
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.person import LIFT, body_plan, shadow_outline, stage_of
from harmolab.lab.player_data import Dancer, Player, movement_data
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import BACKGROUND, render_skeleton
from harmolab.lab.render.video import CORE, RIM, overlay_skeleton
from harmolab.musician import avatar as avatars
from harmolab.musician.avatar import SHOULDERS, AvatarParams, avatar, bow, forward_offset, placed_points, spine
from harmolab.musician.video import PREDICTION, TRUTH, render_points
from harmolab.params import HarmonyParams
from harmolab.readers import player_points as names_of
from harmolab.readers.bvh import WORLD, load_bvh, save_bvh
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.score import score_harmony
from harmolab.types import Audio, Motion
from study.cells import notebook_cells
from study.experiments.player_in_space import Camera, PlayerInSpace, elbow_angles, player_in_space
from tests.builders import bone_lengths, cases, refused, track
from tests.test_player import data_of, positions_of

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
    return float(np.ptp(bone_lengths(motion), axis=0).max())


def in_mirror(points: Motion) -> Motion:
    return Motion(points.positions * [-1.0, 1.0], points.fps, points.skeleton)


# The planted player


def test_camera_shows_what_is_ahead_at_its_centre_and_nearer_things_larger():
    camera = Camera(distance=4.0, height=1.0, focal=1000.0, centre=(320.0, 240.0))
    places = np.array([[0.0, 1.0, 0.0], [0.4, 1.2, 0.0], [0.4, 1.2, 2.0]])
    np.testing.assert_allclose(camera.pixels(places), [[320.0, 240.0], [420.0, 190.0], [520.0, 140.0]])


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_players_bones_keep_their_length_and_noise_is_what_it_is_said_to_be(instrument: str):
    player = player_in_space(instrument, seconds=5.0, noise=2.0)
    for side, (upper, lower) in itertools.product(SIDES, itertools.pairwise(("shoulder", "elbow", "wrist"))):
        bone = of(player.space, f"{side}_{lower}") - of(player.space, f"{side}_{upper}")
        assert np.ptp(np.linalg.norm(bone, axis=1)) < 1e-9
    noise = player.points.positions - player.camera.pixels(player.space.positions)
    assert noise.std() == pytest.approx(2.0, rel=0.03)
    angles = np.degrees(elbow_angles(player.space))
    assert angles.min() > 60 and angles.max() < 170


# Two bones


def test_limb_of_two_bones_is_the_triangle_of_its_sides():
    root, target = np.zeros((2, 3)), np.array([[5.0, 0, 0], [0, 0, 5.0]])
    middle, end = two_bones(root, target, 3.0, 4.0, np.array([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(end, target)
    np.testing.assert_allclose(middle, [[1.8, -2.4, 0], [0, -2.4, 1.8]])


@pytest.mark.parametrize("target", [[0.0, 0.0, 0.0], [0.0, -9.0, 0.0], [0.1, 0.0, 0.0]])
def test_target_that_cannot_be_reached_is_pulled_onto_the_sphere(target: list[float]):
    middle, end = two_bones(np.zeros((1, 3)), np.array([target]), 0.3, 0.25, np.array([0.0, -1.0, 0.0]))
    assert np.linalg.norm(middle) == pytest.approx(0.3)
    assert np.linalg.norm(end - middle) == pytest.approx(0.25)
    assert np.linalg.norm(end) == pytest.approx(min(max(np.linalg.norm(target), 0.05), 0.55), abs=1e-6)


# Step 1: place


def test_shoulders_come_onto_the_avatars_by_one_similarity():
    turn = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    pixels = np.array([[[130.0, 0], [-70.0, 0], [30.0, 50.0]]]) @ turn.T + [300.0, 200.0]
    skeleton = player_skeleton(["left_shoulder", "right_shoulder", "left_hip"])
    placed = placed_points(Motion(np.repeat(pixels, 3, axis=0), 24.0, skeleton))
    assert placed.scale == pytest.approx(SHOULDERS / 200)
    np.testing.assert_allclose(placed.points["left_shoulder"][0], [SHOULDERS / 2, 0], atol=1e-12)
    np.testing.assert_allclose(placed.points["right_shoulder"][0], [-SHOULDERS / 2, 0], atol=1e-12)
    np.testing.assert_allclose(placed.points["left_hip"][0], [0, -50 * placed.scale], atol=1e-12)


def test_raised_left_hand_stays_the_left_one_in_a_mirrored_picture(violinist: PlayerInSpace):
    plain, other = (avatar(points, "violin") for points in (violinist.points, in_mirror(violinist.points)))
    assert of(plain, "left_wrist")[:, 0].mean() > 0.1 > of(plain, "right_wrist")[:, 0].mean()
    np.testing.assert_allclose(other.positions, plain.positions, atol=1e-9)


def test_farther_left_in_the_picture_is_nearer_in_a_mirror_too(pianist: PlayerInSpace):
    for points, sides in ((pianist.points, ("right", "left")), (in_mirror(pianist.points), ("left", "right"))):
        near, far = (of(avatar(points, "piano"), f"{side}_shoulder")[:, 2].mean() for side in sides)
        assert near > far


# Step 2: spine


def test_spine_has_its_mean_length_and_leads_from_the_hips_to_the_shoulders(pianist: PlayerInSpace):
    placed = placed_points(pianist.points)
    joints = spine(placed)
    middles = [(placed.points[f"left_{part}"] + placed.points[f"right_{part}"]) / 2 for part in ("shoulder", "hip")]
    lengths = np.linalg.norm(middles[0] - middles[1], axis=1)
    back = joints["neck"] - joints["pelvis"]
    np.testing.assert_allclose(np.linalg.norm(back, axis=1), lengths.mean())
    np.testing.assert_allclose(back[:, :2] / lengths.mean(), (middles[0] - middles[1]) / lengths[:, None], atol=1e-9)


def test_without_hips_the_root_is_a_spine_at_rest_below_the_shoulders(pianist: PlayerInSpace):
    joints = spine(placed_points(without(pianist.points, lambda name: "hip" in name)))
    np.testing.assert_allclose(joints["neck"] - joints["pelvis"], np.tile([0, avatars.SPINE, 0], (192, 1)), atol=1e-12)


def test_player_sits_on_the_stool_and_the_feet_rest_on_the_floor(pianist: PlayerInSpace):
    result = avatar(pianist.points, "piano")
    assert of(result, "pelvis")[:, 1].mean() == pytest.approx(0.45 + avatars.HIP_ABOVE_SEAT)
    assert of(result, "stool_front_low")[0, 1] == pytest.approx(0.45)
    assert np.abs(of(result, "stool_front_low_foot")[:, 1]).max() < 1e-12
    for side in SIDES:
        assert np.ptp(of(result, f"{side}_toe"), axis=0).max() < 1e-9
        assert 0 <= of(result, f"{side}_toe")[0, 1] < 0.05
    high = avatars.legs({name: of(result, name) + 2.0 for name in ("pelvis", "left_hip", "right_hip")}, 0.0)
    foot = high["left_toe"] - high["left_ankle"]  # keeps its length where the leg is too short
    np.testing.assert_allclose(np.linalg.norm(foot, axis=1), np.hypot(avatars.TOE, 0.02 - avatars.ANKLE))


# Step 3: arms


def test_depth_is_the_third_side_of_a_right_triangle():
    lengths = np.array([0.0, 3.0, 5.0, 6.0])
    np.testing.assert_allclose(forward_offset(lengths, 5.0), [5, 4, 0, 0])
    np.testing.assert_allclose(forward_offset(lengths, 5.0, "linear"), [5, 2, 0, 0])


def bare_forearm_error(*, smoothing: float, percentile: float, law: str) -> float:
    """Median depth error, shares of the forearm, of one of 90 px that swings up to the plane of the picture."""
    rng, times = np.random.default_rng(3), np.arange(24 * 60) / 24
    angle = np.pi / 2 * np.abs(np.sin(2 * np.pi * times / 5.3) * np.sin(2 * np.pi * times / 7.1))
    length = 90 * np.cos(angle)
    seen = smooth(np.hypot(length + rng.normal(0, 1, times.size), rng.normal(0, 1, times.size)), smoothing, 24.0)
    return float(np.median(np.abs(forward_offset(seen, np.percentile(seen, percentile), law) / 90 - np.sin(angle))))


def test_bare_forearm_comes_back_and_the_linear_law_does_not():
    assert bare_forearm_error(smoothing=0.1, percentile=99.0, law="root") < 0.03
    assert bare_forearm_error(smoothing=0.0, percentile=100.0, law="root") > 0.035
    assert bare_forearm_error(smoothing=0.1, percentile=99.0, law="linear") > 0.25


@pytest.mark.parametrize("seed", [1, 3])
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_player_comes_back_in_space(instrument: str, seed: int):
    player = player_in_space(instrument, seed=seed)
    errors = CELLS.depth_errors(player, avatar(player.points, instrument))
    assert all(errors[measure] <= most for measure, most in CELLS.DEPTH_LIMITS.items())
    for worse in (replace(OURS, depth="linear"), replace(OURS, elbow_depth=False), AvatarParams.paper()):
        assert CELLS.depth_errors(player, avatar(player.points, instrument, params=worse))["wrist depth"] > 25.0


def test_raw_lengths_and_the_longest_one_are_worse_for_the_violinist():
    player = player_in_space("violin")
    settings = (OURS, replace(OURS, smoothing=0.0), replace(OURS, smoothing=0.0, percentile=100.0))
    built = (avatar(player.points, "violin", params=params) for params in settings)
    error, raw, longest = (CELLS.depth_errors(player, each)["wrist depth"] for each in built)
    assert error < 0.8 * raw and raw < longest


def test_forearm_that_never_lies_in_the_picture_has_a_least_length(pianist: PlayerInSpace):
    points = np.array(pianist.points.positions)
    names = PLAYER_50.joints
    for side in SIDES:
        points[:, names.index(f"{side}_elbow")] = points[:, names.index(f"{side}_wrist")] + 1.0
    _, forearm = avatars.arm_lengths(placed_points(Motion(points, 24.0, PLAYER_50)), OURS)
    assert forearm == pytest.approx(0.6 * SHOULDERS)
    bare = placed_points(without(pianist.points, MISSING["elbows"]))
    assert avatars.arm_lengths(bare, OURS) == (avatars.UPPER_ARM, avatars.FOREARM)


# Step 4: hands and fingers


def test_hand_turns_over_only_past_the_dead_band():
    offset = np.array([0.1, -0.1, 0.2, 0.1, -0.1, -0.14, -0.16, 0.1, 0.14, 0.2])
    expected = [True, True, True, True, True, True, False, False, False, True]
    np.testing.assert_array_equal(avatars.palm_is_down(offset, 0.15), expected)
    np.testing.assert_array_equal(avatars.palm_is_down(np.zeros(3), 0.15), [True] * 3)
    assert np.abs(np.diff(avatars.palm_is_down(offset, 0.0).astype(int))).sum() > 3


def test_palms_of_a_pianist_are_down_and_up_where_index_and_little_finger_change_places(pianist: PlayerInSpace):
    names, points = PLAYER_50.joints, np.array(pianist.points.positions)
    for side in SIDES:
        hand = avatars.hand_axes(placed_points(pianist.points), side, OURS)
        assert hand is not None
        assert hand.palm[:, 1].max() < 1e-9 and np.median(hand.palm[:, 1]) < -0.3
        pair = [names.index(f"{side}_index_1"), names.index(f"{side}_little_1")]
        points[:, pair] = points[:, pair[::-1]]
        other = avatars.hand_axes(placed_points(Motion(points, 24.0, PLAYER_50)), side, OURS)
        assert other is not None
        assert other.palm[:, 1].min() > -1e-9 and np.median(other.palm[:, 1]) > 0.3


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_fingers_point_where_they_do_in_the_picture(instrument: str):
    player = player_in_space(instrument, seconds=4.0, noise=0.0)
    turn = OURS.piano_turn if instrument == "piano" else 0.0
    placed, result = placed_points(player.points, turn=turn), avatar(player.points, instrument)
    for side, finger in itertools.product(SIDES, FINGERS):
        root, tip = f"{side}_{finger}_1", f"{side}_{finger}_4"
        seen, drawn = placed.points[tip] - placed.points[root], (of(result, tip) - of(result, root))[:, :2]
        cosine = (seen * drawn).sum(axis=1) / np.linalg.norm(seen, axis=1) / np.linalg.norm(drawn, axis=1)
        np.testing.assert_allclose(cosine, 1.0, atol=1e-9)


# Step 5: piano


def test_wrists_lie_on_one_line_that_is_nearer_at_the_left():
    wrists = {"left": np.array([[0.3, -0.3, 0.2], [0.1, -0.3, 0.5]]), "right": np.array([[-0.2, -0.3, 0.4]] * 2)}
    placed = avatars.keyboard_depth(wrists, np.radians(35))
    offsets = np.concatenate([wrist[:, 2] + np.tan(np.radians(35)) * wrist[:, 0] for wrist in placed.values()])
    expected = np.median([0.2 + 0.3 * 0.7002075, 0.5 + 0.1 * 0.7002075, 0.4 - 0.2 * 0.7002075, 0.4 - 0.2 * 0.7002075])
    np.testing.assert_allclose(offsets, expected)
    np.testing.assert_array_equal(placed["left"][:, :2], wrists["left"][:, :2])


def test_pianist_is_turned_by_a_fixed_angle_and_the_keyboard_with_her(pianist: PlayerInSpace):
    for angle in (np.radians(35), np.radians(20)):
        result = avatar(pianist.points, "piano", params=replace(OURS, piano_turn=angle))
        for left, right in (("left_shoulder", "right_shoulder"), ("keyboard_front_low", "keyboard_front_high")):
            across = (of(result, left) - of(result, right)).mean(axis=0)
            assert np.arctan2(-across[2], across[0]) == pytest.approx(angle, abs=1e-2)


def test_keyboard_rests_under_the_fingertips_before_the_player(pianist: PlayerInSpace):
    result = avatar(pianist.points, "piano")
    corners = np.stack([of(result, f"keyboard_{corner}") for corner in ("front_low", "front_high", "back_high")])
    assert np.ptp(corners, axis=1).max() == 0.0
    tips = np.stack([of(result, f"{side}_{finger}_4") for side in SIDES for finger in FINGERS])
    assert np.abs(np.median(tips[..., 1]) - corners[0, 0, 1]) < 0.05
    planted = np.stack([of(pianist.space, f"{side}_{finger}_4") for side in SIDES for finger in FINGERS])
    assert corners[0, 0, 1] == pytest.approx(np.percentile(planted[..., 1], 10), abs=0.05)
    assert np.linalg.norm(corners[0] - corners[1], axis=1)[0] == pytest.approx(1.22)


def test_hands_that_a_high_camera_shows_too_low_come_above_the_thighs(pianist: PlayerInSpace):
    points, names = np.array(pianist.points.positions), PLAYER_50.joints
    low = [number for number, name in enumerate(names) if "shoulder" not in name and "hip" not in name]
    points[:, low, 1] += 100.0
    result = avatar(Motion(points, 24.0, PLAYER_50), "piano")
    assert of(result, "left_wrist")[:, 1].min() > of(result, "left_knee")[:, 1].max()


# Step 6: violin


def angle_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(T,) radians between vectors (T, 3), exact for small ones."""
    return np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1))


def test_violin_keeps_the_four_constraints(violinist: PlayerInSpace):
    result = avatar(violinist.points, "violin")
    chin, scroll, bridge = (of(result, f"violin_{part}") for part in ("chin", "scroll", "bridge"))
    assert np.ptp(np.linalg.norm(chin - of(result, "head"), axis=1)) < 1e-9
    assert angle_between(scroll - chin, of(result, "left_index_1") - chin).max() < 1e-6
    frog, tip = of(result, "bow_frog"), of(result, "bow_tip")
    assert np.ptp(np.linalg.norm(frog - of(result, "right_wrist"), axis=1)) < 1e-9
    assert angle_between(tip - frog, bridge - frog).max() < 1e-6


def test_hand_on_the_bridge_gives_no_nan():
    place = np.array([[0.1, 1.0, 0.2]] * 3)
    np.testing.assert_allclose(bow(place, None, place)["bow_tip"] - place, [[0.74, 0, 0]] * 3)


# Step 7, and what is missing


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_body_is_the_first_tree_and_props_are_the_others(instrument: str):
    result = avatar(player_in_space(instrument, seconds=2.0).points, instrument)
    joints, parents = result.skeleton.joints, result.skeleton.parents
    assert joints[0] == "pelvis" and parents[0] == -1
    assert {joints[i] for i, parent in enumerate(parents) if parent < 0} - {"pelvis"} <= names_of.PROPS
    trees = zip(joints, parents, strict=True)
    assert all((name in names_of.PROPS) == (joints[parent] in names_of.PROPS) for name, parent in trees if parent >= 0)
    props = {"piano": {*names_of.KEYBOARD}, "violin": {*names_of.VIOLIN, *names_of.BOW}}[instrument]
    assert props | set(names_of.STOOL) <= set(joints)
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
def test_missing_parts_are_left_out_and_the_rest_works(instrument: str, part: str):
    points = player_in_space(instrument, seconds=3.0).points
    result = avatar(without(points, MISSING[part]), instrument)  # a Motion has no NaN
    assert changes_of_bones(result) < 1e-6
    assert set(result.skeleton.joints) <= set(avatar(points, instrument).skeleton.joints)
    if part in ("left arm", "all but shoulders"):
        assert not [name for name in result.skeleton.joints if name.startswith(("left_elbow", "left_w", "left_index"))]
    if part in ("right arm", "all but shoulders"):
        assert "bow_tip" not in result.skeleton.joints
        assert (instrument == "violin") == ("violin_scroll" in result.skeleton.joints)
    if part in ("right hand", "roots of fingers"):
        assert not [name for name in result.skeleton.joints if name.startswith("right_index")]


def test_points_that_lie_on_one_another_give_no_nan():
    points = np.zeros((3, 50, 2))
    points[:, PLAYER_50.joints.index("left_shoulder")] = [100.0, 0.0]
    for instrument in INSTRUMENTS:
        assert changes_of_bones(avatar(Motion(points, 24.0, PLAYER_50), instrument)) < 1e-6


def test_what_cannot_be_an_avatar_is_refused(pianist: PlayerInSpace):
    hands = Motion(np.random.default_rng(0).normal(0, 9, (4, 12, 2)), 20.0, names_of.HANDS_12)
    refused("needs left_shoulder and right_shoulder", avatar, hands, "piano")
    refused("both shoulders lie on one point", avatar, Motion(np.zeros((3, 2, 2)), 24.0, SHOULDERS_ONLY), "violin")
    refused("these are in space", avatar, pianist.space, "piano")
    refused("instrument must be piano or violin, got 'cello'", avatar, pianist.points, "cello")
    refused("instrument must be piano or violin, got 'drum'", player_in_space, "drum")
    refused("noise of 0 or more", player_in_space, "piano", noise=-1.0)


@cases(
    "name, value",
    ("depth", "square"),
    ("percentile", 101.0),
    ("percentile", 0.0),
    ("smoothing", -0.1),
    ("piano_turn", 35.0),
)
def test_settings_out_of_range_are_refused_by_name(name: str, value: object):
    refused(name, AvatarParams, **{name: value})


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_avatar_with_its_props_goes_through_a_bvh(instrument: str, tmp_path: Path):
    result = avatar(player_in_space(instrument, seconds=2.0).points, instrument)
    save_bvh(tmp_path / "a.bvh", result)
    loaded = load_bvh(tmp_path / "a.bvh")
    assert loaded.skeleton.parents.count(-1) == 1
    assert set(loaded.skeleton.joints) == {*result.skeleton.joints, WORLD}
    order = [loaded.skeleton.joints.index(name) for name in result.skeleton.joints]
    np.testing.assert_allclose(loaded.positions[:, order], result.positions, atol=1e-4)


# As they are drawn


def is_drawn(frame: np.ndarray) -> np.ndarray:
    """(H, W) where limbs and props are in a picture of the scene."""
    return (frame.max(axis=2) < 165) | (frame[..., 0] - frame[..., 2] > 30)


def pole(names: tuple[str, str]) -> Motion:
    """A body of one pole, and beside it another with joints of these names."""
    places = np.array([[0.0, 0, 0], [0, 1.7, 0], [0.5, 0.2, 0], [0.5, 1.5, 0]])
    return Motion(np.tile(places, (2, 1, 1)), 30.0, Skeleton(("hip", "neck", *names), (-1, 0, -1, 2)))


# Widths


def test_fingers_and_props_are_thin_and_the_rest_is_not():
    widths = dict(zip(PLAYER_50.joints, names_of.joint_widths(PLAYER_50), strict=True))
    thin = {name for side in ("left", "right") for name in hand_joints(side)[1:]}
    assert {name for name, width in widths.items() if width == names_of.THIN} == thin
    assert set(widths.values()) == {names_of.THIN, 1.0}
    violin = Skeleton(names_of.VIOLIN, (-1, 0, 1, 2))
    assert names_of.limb_widths(violin, violin.bones) == [names_of.SOUND_BOX, names_of.SOUND_BOX, names_of.THIN]
    assert names_of.prop_joints(violin) == [0, 1, 2, 3]


def test_dancers_are_drawn_as_before():
    _, limbs = skull_and_limbs(DANCER)
    assert names_of.limb_widths(DANCER, limbs) == [1.0] * len(limbs)
    clip = synthetic_clip("waltz", seed=1)
    assert names_of.playing_box(clip.motion) is None and names_of.prop_joints(DANCER) == []
    data = movement_data(clip.motion)
    assert data["aim"] == 0.47 * data["size"] and data["lift"] == LIFT


@pytest.mark.parametrize(("names", "is_thin"), [(("a", "b"), False), (("left_index_1", "left_index_4"), True)])
def test_finger_is_drawn_thinner_than_a_limb(names: tuple[str, str], is_thin: bool):
    columns = is_drawn(next(render_dance(pole(names))).astype(int))[200:260]  # rows half way up both
    body, other = columns[:, :320].sum(axis=1).mean(), columns[:, 320:].sum(axis=1).mean()
    assert (other < 0.5 * body) == is_thin
    flat = Motion(pole(names).positions[..., :2] * [100.0, -100.0] + 300.0, 30.0, pole(names).skeleton)
    dark = next(render_skeleton(flat, height=480)) < BACKGROUND
    thick = [dark[220:260, half].sum(axis=1).mean() for half in (slice(0, 320), slice(320, 640))]
    assert (thick[1] < 0.5 * thick[0]) == is_thin
    lines = next(overlay_skeleton([np.zeros((480, 640, 3), np.uint8)] * 2, 30.0, flat))
    assert (lines == RIM).any() and (lines == CORE).any()
    light = (lines == CORE).all(axis=2)[200:260]
    assert (light[:, 325:].sum() < 0.75 * light[:, 250:325].sum()) == is_thin


# The scene


@pytest.mark.parametrize(("names", "is_wider"), [(("a", "b"), True), (("bow_frog", "bow_tip"), False)])
def test_props_throw_no_shadow(names: tuple[str, str], is_wider: bool):
    shadows = []
    for reach in (0.0, 1.5):
        places = np.array([[0.0, 0, 0], [0, 0, 0], [0.3, 1.0, 0], [0.4 + reach, 1.0, 0]])
        motion = Motion(np.tile(places, (2, 1, 1)), 30.0, Skeleton(("hip", "neck", *names), (-1, 0, -1, 2)))
        camera = stage_of(motion).camera(480, 640)
        plan = body_plan(places[None], motion.skeleton)
        shadows.append(np.ptp(shadow_outline(plan, camera, places[None], slice(0, 1))[0, :, 0]) / plan.stature)
    assert (shadows[1] > 1.5 * shadows[0]) == is_wider


@pytest.mark.parametrize("size", [(480, 640), (640, 360)])
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_player_and_props_fill_the_picture_and_stay_in_it(instrument: str, size: tuple[int, int]):
    motion = avatar(player_in_space(instrument, seconds=0.6).points, instrument)
    for frame in list(render_dance(motion, height=size[0], width=size[1]))[::8]:
        rows, columns = np.nonzero(is_drawn(frame.astype(int)))
        assert rows.min() > 2 and rows.max() < size[0] - 3
        assert columns.min() > 2 and columns.max() < size[1] - 3
        assert max(np.ptp(rows) / size[0], np.ptp(columns) / size[1]) > 0.6


def test_camera_of_a_player_rests():
    motion = avatar(player_in_space("piano", seconds=0.6).points, "piano")
    first, *_, last = render_dance(motion)
    np.testing.assert_array_equal(first[-60:, :60], last[-60:, :60])
    way = np.array(movement_data(motion)["way"]["low"])
    np.testing.assert_allclose(way, names_of.playing_box(motion).mean(axis=0)[[0, 2]], atol=1e-9)


# Two over each other


def two() -> tuple[Motion, Motion]:
    truth = player_in_space("violin", seconds=2.0).points
    return truth, Motion(truth.positions + np.array([40.0, 0.0]), truth.fps, truth.skeleton)


def test_prediction_is_green_over_a_red_truth():
    truth, prediction = two()
    frame = next(render_points(truth, prediction))
    red, green = ((frame == colour).all(axis=2) for colour in (TRUTH, PREDICTION))
    assert red.sum() > 1.3 * green.sum() > 1000
    assert np.nonzero(green)[1].mean() > np.nonzero(red)[1].mean() + 20
    assert (next(render_points(truth, truth)) == PREDICTION).all(axis=2).sum() > 1000
    for colour, name in ((TRUTH, "miss"), (PREDICTION, "hit")):
        assert "#{:02X}{:02X}{:02X}".format(*colour) == COLOURS[name].upper()


def test_points_in_space_do_not_go_over_each_other():
    player = player_in_space("violin", seconds=2.0)
    refused("one of these motions is in space", render_points, player.points, player.space)
    refused("at least 64 x 64", render_points, player.points, player.points, height=20)


def page_of(motions: list[Motion], **options: Any) -> Player:
    params, music = HarmonyParams.valleys(), track([0.5, 1.0, 1.5], duration=2.0)
    dancers = [
        Dancer(name, motion, score_harmony(music, visual_beats(motion, params=params), params=params, n_rotations=0))
        for name, motion in zip(("truth", "prediction"), motions, strict=False)
    ]
    return Player(Audio(np.zeros(16000), 8000.0), dancers, music=music, title="synthetic", **options)


def test_page_lays_two_motions_of_one_picture_over_each_other_and_then_names_their_colours():
    page = page_of(list(two()), overlaid=True).page
    first, second = data_of(page)["dancers"]
    assert page.count('class="stage"') == 1
    assert first["size"] == second["size"]
    shift = positions_of(second) - positions_of(first)
    np.testing.assert_allclose(shift, np.broadcast_to([40.0, 0.0, 0.0], shift.shape), atol=0.05)
    beside = page_of(list(two())).page
    assert beside.count('class="stage"') == 2
    captions = [re.findall(r'<figcaption class="(\w+)"', each) for each in (page, beside)]
    assert captions == [["truth", "prediction"], []]
    for motions in ([player_in_space("violin", seconds=2.0).space] * 2, [two()[0]]):
        refused("two motions in image coordinates", page_of, motions, overlaid=True)


@pytest.mark.browser
def test_pages_of_players_are_drawn_in_a_browser(chromium: Any, tmp_path: Path):
    motions = [avatar(player_in_space(instrument, seconds=2.0).points, instrument) for instrument in INSTRUMENTS]
    for name, player in {"avatars": page_of(motions), "over": page_of(list(two()), overlaid=True)}.items():
        player.save(tmp_path / f"{name}.html")
        page, faults = chromium.new_page(viewport={"width": 1280, "height": 900}), []
        page.on("pageerror", lambda error, faults=faults: faults.append(str(error)))
        page.goto((tmp_path / f"{name}.html").as_uri())
        page.evaluate("harmolabPlayer.ready")
        page.evaluate("harmolabPlayer.seek(1.0)")
        wood, green = page.evaluate(
            """() => {
              const canvas = document.querySelector(".stage");
              const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
              let wood = 0, green = 0;
              for (let i = 0; i < data.length; i += 4) {
                wood += data[i] - data[i + 2] > 50 && data[i] < 180 && data[i + 1] > data[i + 2];
                green += data[i] === 0 && data[i + 1] === 158 && data[i + 2] === 115;
              }
              return [wood, green];
            }"""
        )
        assert wood > 200 if name == "avatars" else green > 1000
        assert faults == []
        page.close()
