"""Drawn people and dances: the one figure of a person, the dance on its floor, the stick figure, lines over a video."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab import person
from harmolab.lab.explain.offset import PICTURE
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.render.scene import FLOOR, WALL, render_dance
from harmolab.lab.render.stick import BACKGROUND, DANCER, HIT, MISS, MUSIC, captioned, hit_times, render_skeleton
from harmolab.lab.render.video import CORE, load_points, overlay_skeleton, points_in_picture, write_dance
from harmolab.params import HarmonyParams
from harmolab.readers.keypoints import COCO_17
from harmolab.readers.motion import save_motion
from harmolab.readers.player_points import PLAYER_50
from harmolab.readers.smpl import SMPL_24
from harmolab.readers.video import VideoFrames, video_frames, write_video
from harmolab.score import HarmonyScore, score_harmony
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion
from study.figures.moving_box import box_walk, moving_box
from tests.builders import cases, refused, track

# The one figure of a person

# Machado, Oliveira and Fernandes 2009, severity 1.0, for linear RGB.
SIMULATION = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def standing(skeleton: Skeleton, axes: int = 3) -> FloatArray:
    """(2, J, axes): a body of 1.7 m that stands with its arms to the sides, or its picture, y down."""
    places = {
        "shoulder": (0.22, 1.39), "elbow": (0.5, 1.39), "wrist": (0.75, 1.39), "hand": (0.8, 1.39), "hip": (0.11, 0.9),
        "knee": (0.11, 0.48), "ankle": (0.11, 0.08), "foot": (0.11, 0.02), "collar": (0.08, 1.4), "ear": (0.07, 1.6),
        "eye": (0.03, 1.62), "forearm": (0.6, 1.39), "heel": (0.11, 0.02), "toe": (0.11, 0.0), "finger": (0.9, 1.39),
    }  # fmt: skip
    central = {"pelvis": 0.95, "spine1": 1.05, "spine2": 1.15, "spine3": 1.3, "neck": 1.42, "head": 1.53, "nose": 1.6}
    pose = []
    for name in skeleton.joints:
        side, _, part = name.partition("_")
        across, up = places.get(part, (0.07 * (part == "head"), central.get(part or name, 1.0)))
        pose.append([{"left": across, "right": -across}.get(side, 0.0), up + 0.07 * (part == "head"), 0.0])
    body = np.tile(np.array(pose), (2, 1, 1))
    return body if axes == 3 else body[..., :2] * [100.0, -100.0] + [300.0, 300.0]


BODIES = {"Tang": TANG_23, "paper": PAPER_21, "SMPL": SMPL_24, "COCO": COCO_17}


def part_of(plan: person.BodyPlan, paint: str, count: int = 2) -> int:
    """Number of the first part of that paint with so many discs."""
    return next(n for n, part in enumerate(plan.parts) if part.paint == paint and len(part.points) == count)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("axes", [2, 3])
def test_every_body_has_a_trunk_a_head_two_arms_and_two_legs(name: str, axes: int) -> None:
    skeleton = BODIES[name]
    plan = person.body_plan(standing(skeleton, axes), skeleton)
    paints = [part.paint for part in plan.parts]
    assert paints.count("head") == 1 and paints.count("body") == 2
    assert paints.count("left") == paints.count("right") >= 4
    assert "stick" not in paints
    largest = plan.weights[list(plan.parts[part_of(plan, "body", 4)].points)].argmax(axis=1)
    assert [skeleton.joints[joint].partition("_")[2] for joint in largest] == ["shoulder"] * 2 + ["hip"] * 2


@pytest.mark.parametrize("name", BODIES)
def test_height_of_the_figure_is_that_of_the_person(name: str) -> None:
    """Whatever the joint called head is, the crown lies where an adult's does."""
    positions = standing(BODIES[name])
    plan = person.body_plan(positions, BODIES[name])
    assert plan.stature == pytest.approx(1.7, rel=0.03)
    chin, crown = (plan.weights[point] @ positions[0] for point in plan.parts[part_of(plan, "head")].points)
    top = crown[1] + plan.parts[part_of(plan, "head")].radii[1] * plan.stature
    assert top == pytest.approx(1.7, abs=0.03)
    assert crown[1] > chin[1] > 1.39
    corners = plan.weights[list(plan.parts[part_of(plan, "body", 4)].points)] @ positions[0]  # a tenth inwards and down
    np.testing.assert_allclose(abs(corners[:, :2]), [[0.176, 1.341]] * 2 + [[0.088, 0.9]] * 2, atol=1e-9)
    assert (chin[1] + crown[1]) / 2 - 1.39 == pytest.approx(person.HEAD_UP * 1.7, abs=0.02)


def test_head_that_was_not_measured_is_assumed_and_pale() -> None:
    paints = [part.paint for part in person.body_plan(standing(PLAYER_50, 2), PLAYER_50).parts]
    assert "assumed" in paints and "head" not in paints
    assert min(person.PAINTS["assumed"]) > max(person.PAINTS["head"])


def test_a_foot_is_one_part_around_ankle_heel_and_toe() -> None:
    feet = [part for part in person.body_plan(standing(TANG_23), TANG_23).parts if len(part.points) == 3]
    joints = [{TANG_23.joints[joint] for joint in part.points} for part in feet]
    assert joints == [{f"{side}_ankle", f"{side}_heel", f"{side}_toe"} for side in ("left", "right")]


def test_bodies_without_names_are_sticks_and_without_bones_dots() -> None:
    pair = Skeleton(("a", "b", "c"), (-1, 0, 1))
    plan = person.body_plan(standing(pair), pair)
    assert [(part.points, part.paint) for part in plan.parts] == [((0, 1), "stick"), ((1, 2), "stick")]
    for markers in (Skeleton.unnamed(3), Skeleton(("HeadL", "HeadR", "Chest"), (-1, -1, -1))):
        assert [part.points for part in person.body_plan(standing(pair), markers).parts] == [(0,), (1,), (2,)]


@pytest.mark.parametrize("name", BODIES)
def test_left_is_at_the_right_of_who_faces_the_dancer(name: str) -> None:
    stage = person.stage_of(Motion(standing(BODIES[name]), 30.0, BODIES[name]))
    discs = person.person_discs(stage.plan, stage.camera(480, 640), stage.turned(stage.positions)[:1], slice(0, 1))
    parts = [*zip(discs.centres[0], stage.plan.parts, strict=True)]
    left, right = (
        np.mean([centres[:, 0].mean() for centres, part in parts if part.paint == paint]) for paint in ("left", "right")
    )
    assert left > 330 > 310 > right


def test_camera_looks_from_beside_the_front_and_above() -> None:
    stage = person.stage_of(Motion(standing(TANG_23), 30.0, TANG_23))
    camera = stage.camera(480, 640)
    target = np.array([stage.way[0, 0], stage.aim, stage.way[0, 1]])
    away = camera.eye[0] - stage.turned(target)
    assert np.linalg.norm(away) == pytest.approx(person.DISTANCE * stage.size)
    assert np.arcsin(away[1] / np.linalg.norm(away)) == pytest.approx(person.LIFT)
    middle = camera.to_pixels(camera.to_view(stage.turned(target[None, None]), slice(0, 1)))
    np.testing.assert_allclose(middle[0, 0], [320.0, 480.0 * person.MIDDLE])
    # A point to the dancer's left and in front of her by the camera's angle lies before the camera.
    ahead = target[None, None] + [np.sin(person.ANGLE), 0.0, np.cos(person.ANGLE)]
    assert camera.to_pixels(camera.to_view(stage.turned(ahead), slice(0, 1)))[0, 0, 0] == pytest.approx(320.0)


def test_camera_that_follows_keeps_the_hips_in_the_middle() -> None:
    walk = standing(TANG_23)[:1] + np.linspace(0, 4, 90)[:, None, None] * np.array([1.0, 0.0, 0.3])
    motion = Motion(walk, 30.0, TANG_23)
    for follow, most in ((True, 1e-6), (False, 200.0)):
        stage = person.stage_of(motion, follow=follow)
        camera, hips = stage.camera(480, 640), np.einsum("j,tjd->td", stage.plan.hips, stage.turned(stage.positions))
        across = camera.to_pixels(camera.to_view(hips[:, None], slice(None)))[:, 0, 0] - 320
        assert np.abs(across).max() <= most
        assert follow or np.abs(across).max() > 20


def test_hull_touches_the_outermost_discs() -> None:
    centres = np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 1.0]])
    outline = person.hulls(centres, np.array([2.0, 3.0, 1.0]))
    assert outline.shape == (person.CORNERS, 2)
    assert outline[:, 0].max() == pytest.approx(13.0) and outline[:, 0].min() == pytest.approx(-2.0)
    distances = np.linalg.norm(outline[:, None] - centres, axis=2) - [2.0, 3.0, 1.0]
    assert distances.min() >= -1e-9
    alone = person.hulls(np.array([[4.0, 5.0]]), np.array([1.5]))
    np.testing.assert_allclose(np.linalg.norm(alone - [4.0, 5.0], axis=1), 1.5)


def test_shapes_come_from_far_to_near_and_near_ones_are_darker() -> None:
    reaching = standing(SMPL_24)
    for side, depth in (("left", 0.6), ("right", -0.6)):
        reaching[:, [SMPL_24.joints.index(f"{side}_{part}") for part in ("elbow", "wrist", "hand")], 2] = depth
    stage = person.stage_of(Motion(reaching, 30.0, SMPL_24), angle=0.0)
    (shapes,) = person.person_shapes(stage.plan, stage.camera(480, 640), stage.turned(stage.positions)[:1], slice(0, 1))
    order = [stage.plan.parts[shape.part] for shape in shapes]
    hands = [part.paint for part in order if SMPL_24.joints.index("left_hand") in part.points] + ["left"]
    assert hands and order[-1].paint == "left" and order[0].paint == "right"
    assert shapes[-1].colour == person.PAINTS["left"] and min(shapes[0].colour) > min(person.PAINTS["right"])


# Colours


def lab(colour: FloatArray) -> FloatArray:
    """CIE L*a*b* of linear RGB, D65."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    ratios = np.clip(to_xyz @ np.clip(colour, 0, 1) / [0.9505, 1.0, 1.089], 0, None)
    x, y, z = np.where(ratios > 0.008856, np.cbrt(ratios), 7.787 * ratios + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def linear(colour: tuple[int, int, int]) -> FloatArray:
    shares = np.array(colour) / 255
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("eye", [None, *SIMULATION])
def test_left_and_right_differ_for_every_eye_in_colour_and_in_lightness(eye: str | None) -> None:
    matrix = np.eye(3) if eye is None else np.array(SIMULATION[eye])
    left, right, trunk = (lab(matrix @ linear(person.PAINTS[name])) for name in ("left", "right", "body"))
    assert np.linalg.norm(left - right) > 40
    assert abs(left[0] - right[0]) > 20
    assert min(np.linalg.norm(left - trunk), np.linalg.norm(right - trunk)) > 20


def test_colours_of_the_sides_mean_nothing_else() -> None:
    marks = [lab(linear(tuple(bytes.fromhex(colour[1:])))) for colour in COLOURS.values()]
    for side, mark in itertools.product(("left", "right"), marks):
        assert np.linalg.norm(lab(linear(person.PAINTS[side])) - mark) > 15


# The dance on its floor

MAN, TWO_LIMBS = Skeleton(("foot", "hip", "head"), (-1, 0, 1)), Skeleton(("a", "b", "c", "d"), (-1, 0, -1, 2))
STANDING = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.7, 0.0]])


def dance(*frames: np.ndarray, fps: float = 30.0, skeleton: Skeleton = MAN) -> Motion:
    return Motion(np.stack(frames), fps, skeleton)


def dark(frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) where the dancer is: floor, lines and shadow are lighter."""
    return np.nonzero(frame.max(axis=2) < 165)


def test_standing_dancer_fills_the_middle_of_the_picture_the_floor_lies_below_the_wall_and_the_shadow_on_it() -> None:
    frame = next(render_dance(dance(STANDING, STANDING)))
    rows, columns = dark(frame)
    assert frame.shape == (480, 640, 3)
    assert columns.mean() == pytest.approx(320, abs=2)
    assert 0.5 < np.ptp(rows) / 480 < 0.75
    assert 20 < rows.min() < rows.max() < 460
    assert tuple(frame[0, 5]) == WALL
    assert tuple(frame[-1, 5]) == FLOOR or frame[-1, 5].min() > 150
    leaning = STANDING + np.array([[0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]])
    shadows = [next(render_dance(dance(pose, pose)))[:, :, 0] == 205 for pose in (STANDING, leaning)]
    assert shadows[1].sum() > 2 * shadows[0].sum()


def test_right_of_the_viewer_is_positive_x_and_nearer_is_larger() -> None:
    sideways = STANDING + np.array([[0, 0, 0], [0.4, 0, 0], [0.8, 0, 0]])
    rows, columns = dark(next(render_dance(dance(sideways, sideways))))
    assert columns[rows < np.median(rows)].mean() > columns[rows > np.median(rows)].mean() + 20
    for nearer in (1.0, -1.0):
        poles = np.array([[-0.5, 0, nearer], [-0.5, 1.5, nearer], [0.5, 0, -nearer], [0.5, 1.5, -nearer]])
        rows, columns = dark(next(render_dance(dance(poles, poles, skeleton=TWO_LIMBS))))
        left, right = (np.ptp(rows[side]) for side in (columns < 320, columns >= 320))
        assert np.sign(left - right) == nearer


def test_nearer_limb_hides_the_farther_one_and_is_darker() -> None:
    levels = []
    for near in (0.1, -0.1):  # a bar from left to right and a pole that cross
        pose = np.array([[-0.5, 1.0, near], [0.5, 1.0, near], [0.0, 0.2, -near], [0.0, 1.8, -near]])
        frame = next(render_dance(dance(pose, pose, skeleton=TWO_LIMBS)))
        rows, columns = dark(frame)
        bar = rows[columns > columns.max() - 20]  # the right end of the bar
        levels.append(frame[int(np.median(bar)), [int(np.median(columns)), columns.max() - 20]].max(axis=1))
    assert levels[0][0] == levels[0][1] < 60  # bar in front: its colour goes through, and is dark
    assert levels[1][0] < levels[1][1]  # bar behind: light, and at the crossing the dark pole hides it


def test_camera_follows_a_walk_while_the_grid_goes_by() -> None:
    walk = dance(*[STANDING + np.array([1.5 * frame / 15, 0, 0]) for frame in range(45)], fps=15.0)
    frames = list(render_dance(walk, height=240, fps=30.0))
    places = [dark(frame)[1].mean() for frame in frames]
    assert (len(frames), frames[0].shape) == (89, (240, 320, 3))  # interpolated to the pictures' rate
    assert max(abs(place - 160) for place in places[35:55]) < 8  # 3 m are some 250 pixels
    assert all(50 < place < 270 for place in places)
    assert (frames[30][235] != frames[40][235]).any()


def score(music: BeatTrack, visual: BeatTrack) -> HarmonyScore:
    return score_harmony(music, visual, params=HarmonyParams.valleys(), n_rotations=0)


def test_music_dancer_and_hits_have_marks_of_their_own_only_where_beats_are_given() -> None:
    for mark, name in ((MUSIC, "audio"), (DANCER, "visual"), (HIT, "hit"), (MISS, "miss")):
        assert "#{:02X}{:02X}{:02X}".format(*mark) == COLOURS[name]
    assert not any((frame[:60, :60] == MUSIC).all(axis=2).any() for frame in render_dance(dance(*[STANDING] * 30)))
    frames = render_dance(dance(*[STANDING] * 60), score=score(track([0.5, 1.5]), track([0.566, 1.0])))
    corners = [frame[:120, :160].copy() for frame in frames]
    music, dancer, hit, missed = (
        [index for index, corner in enumerate(corners) if (corner == colour).all(axis=2).sum() > 60]
        for colour in (MUSIC, DANCER, HIT, MISS)  # an outline has fewer
    )
    assert (music, dancer) == ([*range(15, 20), *range(45, 50)], [*range(17, 22), *range(30, 35)])
    assert hit == [*range(17, 22)]
    assert missed == [*range(45, 50)]


def test_marks_of_a_part_are_those_of_the_whole_at_its_time() -> None:
    scored = score(track([0.5, 1.5]), track([0.566, 1.0]))
    whole, part = (
        np.stack([frame[:120, :160] for frame in render_dance(dance(*[STANDING] * count), score=scored, begin=begin)])
        for count, begin in ((60, 0.0), (30, 1.0))
    )
    assert (whole[30:] == part[: len(whole) - 30]).all()


def test_words_stand_in_a_band_at_the_lower_edge_in_as_many_lines_as_they_need() -> None:
    bands = []
    for text in ("In time.", "You keep time, steadily a little late for a waltz, and here come more words than fit."):
        frame = next(captioned([np.zeros((240, 320, 3), np.uint8)], text))
        rows = np.flatnonzero((frame == 246).all(axis=2).any(axis=1))
        assert rows[-1] == 239 and np.ptp(rows) == rows.size - 1
        assert not (frame[rows[0] :, -4:] < 200).any()  # no letter is cut off
        bands.append(rows.size)
    assert 20 < bands[0] < 40 < bands[1] < 90


def test_hit_falls_on_the_later_beat_of_the_two() -> None:
    np.testing.assert_allclose(hit_times(score(track([0.5, 1.0, 1.5]), track([0.4, 1.05, 1.65]))), [0.5, 1.05])
    assert hit_times(score(track([0.5]), track([]))).size == hit_times(score(track([]), track([0.5]))).size == 0


def test_floor_in_front_of_a_small_dancer_is_not_drawn_from_behind_the_camera() -> None:
    small = next(render_dance(dance(0.3 * STANDING, 0.3 * STANDING)))
    assert (small[:100, :250] == WALL).all() and (small[:100, 390:] == WALL).all()
    assert (small[150:, :100] != FLOOR).any()


def test_real_skeleton_and_one_without_bones_are_drawn() -> None:
    clip = synthetic_clip("waltz", seed=1)
    assert 3000 < dark(next(render_dance(clip.motion)))[0].size < 30_000
    dots = Motion(clip.motion.positions, 60.0, Skeleton.unnamed(clip.motion.positions.shape[1]))
    assert 200 < dark(next(render_dance(dots)))[0].size < 10_000


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    motion = dance(STANDING, STANDING)
    refused("at least 64 x 64 pixels, got 53 x 40", render_dance, motion, height=40)
    refused("at least 16 x 16 pixels, got 20 x 8", render_skeleton, motion, height=8, width=20)
    refused("fps must be positive", render_dance, motion, fps=float("nan"))
    refused("fps must be positive", render_skeleton, motion, fps=0.0)
    refused("fps must be positive", write_dance, tmp_path / "x.mp4", synthetic_clip("waltz", seconds=2.0), rate=0.0)


@pytest.mark.parametrize("angle", [0.0, 1.2, np.pi])
def test_dancer_is_seen_from_where_she_faces(angle: float) -> None:
    """Her left side lies to the right in the picture, whichever way she faces; one arm alone tells left from right."""
    left = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    pose = np.outer([0, 0.15, -0.15, 0.8, 0], left) + np.outer([0, 1, 1, 1, 1.7], [0, 1, 0])
    body = Skeleton(("foot", "left_hip", "right_hip", "left_hand", "top"), (-1, 0, 0, 1, 0))
    _, columns = dark(next(render_dance(dance(pose, pose, skeleton=body))))
    assert columns.max() - 320 > 1.5 * (320 - columns.min())


# The stick figure, and the wandering box

PLAIN = np.full((100, 160), 225, np.uint8)


def dots(*places: tuple[float, float], dimensions: int = 3) -> Motion:
    """One joint that visits `places` in turn, ten a second."""
    positions = np.zeros((len(places), 1, dimensions))
    positions[:, 0, :2] = places
    return Motion(positions, 10.0, Skeleton.unnamed(1))


def drawn_centre(frame: np.ndarray) -> tuple[float, float]:
    """(x, y) of the middle of what is not background."""
    rows, columns = np.nonzero(frame != BACKGROUND)
    return columns.mean(), rows.mean()


@cases("axes, places", (3, [(10, 90), (90, 10)]), (2, [(10, 10), (90, 90)]))
def test_x_goes_right_and_y_up_in_the_room_but_down_in_a_picture(axes: int, places: list) -> None:
    frames = render_skeleton(dots((0, 0), (1, 1), dimensions=axes), height=100, width=100)
    assert [drawn_centre(frame) for frame in frames] == [pytest.approx(at, abs=1) for at in places]


def test_the_camera_keeps_the_whole_motion_in_the_picture(swinging_arm: Callable[..., Motion]) -> None:
    for frame in render_skeleton(swinging_arm(1.0, 25.0, seconds=2.0), height=120):
        assert (np.concatenate([frame[0], frame[-1], frame[:, 0], frame[:, -1]]) == BACKGROUND).all()
        assert (frame != BACKGROUND).any()


def test_a_nearer_limb_hides_a_farther_one() -> None:
    positions = np.array([[[0, 0, -1.0], [1, 0, -1.0], [0.5, -0.5, 1.0], [0.5, 0.5, 1.0]]] * 2)
    motions = [Motion(positions * [1, 1, side], 10.0, TWO_LIMBS) for side in (1, -1)]
    last, first = (next(render_skeleton(motion, height=200, width=200))[90:110, 90:110] for motion in motions)
    assert (last != first).any()


def test_at_another_rate_the_dance_takes_the_same_time() -> None:
    motion = dots(*((i, 0) for i in range(11)))  # one second at 10 fps
    steps = np.diff([drawn_centre(frame)[0] for frame in render_skeleton(motion, height=100, width=220, fps=25.0)])
    np.testing.assert_allclose(steps, np.full(25, 0.8 * 220 / 25), atol=0.7)


def test_frames_have_the_size_that_was_asked_for() -> None:
    motion = dots((0, 0), (1, 1))
    assert next(render_skeleton(motion)).shape == (240, 320)
    coloured = next(render_skeleton(motion, height=90, width=50, colour=True))
    assert (coloured.shape, coloured.dtype) == ((90, 50, 3), np.uint8)
    np.testing.assert_array_equal(coloured[..., 0], next(render_skeleton(motion, height=90, width=50)))


def test_the_box_covers_its_share_of_the_picture_and_leaves_the_rest_alone() -> None:
    original = PLAIN.copy()
    for frame in moving_box([original] * 50, 25.0, seed=3, size=0.3):
        changed = frame != PLAIN
        assert changed.sum() == pytest.approx(30 * 30, rel=0.25)  # with its soft edge
        assert np.ptp(np.nonzero(changed), axis=1) == pytest.approx([30, 30], abs=3)
    np.testing.assert_array_equal(original, PLAIN)


def test_the_box_is_blue_on_colour_frames_and_as_bright_on_grey_ones() -> None:
    coloured = next(moving_box([np.repeat(PLAIN[..., None], 3, axis=2)], 25.0, seed=0))
    grey = next(moving_box([PLAIN], 25.0, seed=0))
    rows, columns = (int(np.median(axis)) for axis in np.nonzero(grey != 225))
    assert coloured[rows, columns].tolist() == [40, 80, 220]
    assert grey[rows, columns] == 84  # 0.299 * 40 + 0.587 * 80 + 0.114 * 220


def walked(seed: int, fps: float, steps: int) -> np.ndarray:
    """The box's first places."""
    return np.array([*itertools.islice(box_walk(np.random.default_rng(seed), (1.0, 0.7), 0.8, fps), steps)])


def test_the_box_walks_within_reach_at_about_its_speed_by_its_seed_at_any_frame_rate() -> None:
    np.testing.assert_allclose(walked(5, 50.0, 100)[::2], walked(5, 25.0, 50), atol=1e-9)
    places = walked(1, 25.0, 5000)
    assert places.min() >= 0 and (places.max(axis=0) <= [1.0, 0.7]).all()
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) * 25
    assert speed.max() <= 1.5 * 0.8 + 1e-9 and speed.mean() == pytest.approx(0.8, rel=0.2)


def test_a_box_as_large_as_the_picture_stays_where_it_is() -> None:
    assert all((frame == 84).all() for frame in moving_box([PLAIN] * 5, 25.0, seed=0, size=2.0))


@pytest.mark.parametrize("bad", [{"fps": 0.0}, {"size": -0.1}, {"speed": float("nan")}])
def test_an_impossible_box_is_refused_by_name(bad: dict[str, float]) -> None:
    settings = {"fps": 25.0, "size": 0.3, "speed": 0.8} | bad
    refused(f"{next(iter(bad))} must be positive", moving_box, [PLAIN], settings.pop("fps"), seed=0, **settings)


# The skeleton over its video

POLE = Skeleton(("hip", "knee"), (-1, 0))
HEIGHT, WIDTH = 240, 320


def plain(count: int) -> list[np.ndarray]:
    return [np.full((HEIGHT, WIDTH, 3), 90, np.uint8)] * count


def pole(xs: list[float], valid: list[bool] | None = None) -> Motion:
    """An upright limb from (x, 60) to (x, 180), ten x a second."""
    return Motion([[[x, 60.0], [x, 180.0]] for x in xs], 10.0, POLE, valid)


def drawn_x(frame: np.ndarray) -> float | None:
    """Mean column of the light core of what is drawn in the row half way down; None where nothing is."""
    columns = np.flatnonzero((frame[120] == CORE).all(axis=1))
    return float(columns.mean()) if columns.size else None


@pytest.fixture
def video(tmp_path: Path) -> VideoFrames:
    """Two seconds of plain grey, 640 x 480 in the file, 320 x 240 as frames."""
    write_video(tmp_path / "take.mp4", [np.full((480, 640, 3), 90, np.uint8)] * 20, 10.0)
    return video_frames(tmp_path / "take.mp4", height=HEIGHT, colour=True)


def test_limb_lies_on_its_points_and_the_rest_of_the_picture_is_kept() -> None:
    frame = next(overlay_skeleton(plain(3), 10.0, pole([100, 100])))
    assert drawn_x(frame) == pytest.approx(100, abs=0.5)
    assert (frame[:, :90] == 90).all() and (frame[:, 111:] == 90).all()
    assert (frame[:50] == 90).all() and (frame[191:] == 90).all()
    assert (frame[70:170, 95:106] < 60).any(axis=(1, 2)).all()  # the dark rim, all along


@pytest.mark.parametrize("rate", [5.0, 10.0, 25.0, 30.0])
def test_pose_is_that_of_the_moment_at_any_frame_rate(rate: float) -> None:
    motion = pole([20.0 + 5 * i for i in range(41)])  # 50 pixels a second, for 4 s
    places = [drawn_x(frame) for frame in overlay_skeleton(plain(400), rate, motion)]
    assert len(places) == 4 * rate + 1
    np.testing.assert_allclose(places, 20 + 50 * np.arange(len(places)) / rate, atol=0.6)


def test_it_ends_with_the_shorter_of_both_and_reads_no_frame_too_many() -> None:
    assert len(list(overlay_skeleton(plain(7), 10.0, pole([50] * 30)))) == 7
    frames = iter(plain(30))
    assert len(list(overlay_skeleton(frames, 10.0, pole([50] * 7)))) == 7
    assert len(list(frames)) == 23


def test_where_nobody_was_seen_nothing_is_drawn() -> None:
    valid = [True, True, False, False, True, True]
    shown = [drawn_x(frame) is not None for frame in overlay_skeleton(plain(6), 10.0, pole([50] * 6, valid=valid))]
    assert shown == valid


def test_marks_light_up_on_their_beats() -> None:
    frames = overlay_skeleton(plain(20), 10.0, pole([200] * 20), score=score(track([0.5]), track([])))
    assert [n for n, frame in enumerate(frames) if (frame[10, 10] == (0, 114, 178)).all()] == [5, 6]


def test_mark_lights_up_in_the_picture_nearest_to_its_beat_and_not_later() -> None:
    frames = overlay_skeleton(plain(20), 10.0, pole([200] * 20), score=score(track([0.53, 1.27]), track([])))
    assert [n for n, frame in enumerate(frames) if (frame[10, 10] == (0, 114, 178)).all()] == [5, 6, 13, 14]


def test_a_film_read_by_its_flow_has_the_marks_of_its_movement(video: VideoFrames, tmp_path: Path) -> None:
    beats, seconds = track([0.5, 1.0, 1.5], duration=2.0), np.arange(60) / 30
    way = seconds - np.sin(4 * np.pi * seconds) / (4 * np.pi)  # at rest each half second
    motion = Motion(np.stack([way, 0 * way], axis=1)[:, None], 30.0, PICTURE)
    clip = Clip("x", Audio(np.zeros(16000), 8000), motion, beats=beats)
    write_dance(tmp_path / "x.mp4", clip, over=video.path, params=HarmonyParams.valleys())
    shown = np.stack([*video_frames(tmp_path / "x.mp4", colour=True)])[:, :80, :40].astype(int)
    lit = {mark: ((abs(shown - mark) < 60).all(axis=3).sum(axis=(1, 2)) > 40).any() for mark in (DANCER, MISS)}
    assert lit == {DANCER: True, MISS: False}


def test_a_part_of_a_dance_over_its_film_is_as_long_as_its_sound(video: VideoFrames, tmp_path: Path) -> None:
    clip = Clip("x", Audio(np.zeros(16000), 8000), Motion(np.zeros((10, 2, 3)), 10.0, POLE))
    write_dance(tmp_path / "x.mp4", clip, over=video.path, points=pole([50.0] * 20), marks=False)
    assert len([*video_frames(tmp_path / "x.mp4")]) == 10


def test_pixels_of_the_source_are_scaled_to_the_frames_and_points_of_another_picture_are_refused(video) -> None:
    np.testing.assert_allclose(points_in_picture(pole([400, 400]), video).positions[0], [[200, 30], [200, 90]])
    fault = r"take\.mp4: 100% of the points lie outside its pictures of 640 x 480 pixels"
    refused(fault, points_in_picture, pole([1500, 1500]), video)
    # Points of frames without anybody do not count.
    kept = points_in_picture(pole([100, -9000, -9000, 100], valid=[True, False, False, True]), video)
    assert kept.positions[0, 0, 0] == 50


def test_far_points_are_drawn_without_a_fault() -> None:
    assert next(overlay_skeleton(plain(1), 10.0, pole([1e12, -1e12]))).shape == (HEIGHT, WIDTH, 3)


def test_movement_in_space_is_refused(video: VideoFrames, tmp_path: Path) -> None:
    motion = Motion(np.zeros((3, 2, 3)), 30.0, POLE)
    refused("the motion is movement in space", next, overlay_skeleton(plain(3), 10.0, motion))
    refused("the motion is movement in space", points_in_picture, motion, video)
    save_motion(tmp_path / "m.npz", motion)
    refused(r"m\.npz: is movement in space; over a video go points of its pictures", load_points, tmp_path / "m.npz")
    refused("fps must be positive", next, overlay_skeleton(plain(3), float("inf"), pole([1, 1])))


def test_a_hidden_ear_does_not_hide_the_dancer_a_hidden_head_and_arm_do(tmp_path: Path) -> None:
    values = np.ones((4, 17, 3))
    values[..., :2] = 100 + np.arange(17)[:, None]
    values[1, 3, 2] = 0.0  # left ear
    values[2, [*range(5), 5, 7, 9], 2] = 0.0
    np.save(tmp_path / "k.npy", values)
    motion = load_points(tmp_path / "k.npy", fps=25.0)
    assert motion.valid.tolist() == [True, True, False, True]
    np.testing.assert_allclose(motion.positions[1, 3], 103)


def test_landmarks_stay_shares_whatever_proportions_the_file_notes(tmp_path: Path, video: VideoFrames) -> None:
    frame = [{"x": 0.5, "y": 0.25, "z": 0.0, "visibility": 1.0}] * 33
    (tmp_path / "l.json").write_text(json.dumps({"fps": 10, "aspect": 1.5, "frames": [frame] * 3}))
    placed = points_in_picture(load_points(tmp_path / "l.json"), video)
    np.testing.assert_allclose(placed.positions[0], [[160, 60]] * 33)
