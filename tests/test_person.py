"""The one figure of a person: its parts by the names of joints, where they lie, its colours, the camera."""

import itertools

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.person import (
    ANGLE,
    CORNERS,
    DISTANCE,
    HEAD_UP,
    LIFT,
    MIDDLE,
    PAINTS,
    BodyPlan,
    body_plan,
    hulls,
    person_discs,
    person_shapes,
    stage_of,
)
from harmolab.readers.keypoints import COCO_17
from harmolab.readers.player_points import PLAYER_50
from harmolab.readers.smpl import SMPL_24
from harmolab.types import FloatArray, Motion

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
    if axes == 2:
        return np.tile(np.array(pose)[:, :2] * [100.0, -100.0] + [300.0, 300.0], (2, 1, 1))
    return np.tile(np.array(pose), (2, 1, 1))


BODIES = {"Tang": TANG_23, "paper": PAPER_21, "SMPL": SMPL_24, "COCO": COCO_17}


def discs_of(motion: Motion) -> tuple[BodyPlan, FloatArray, FloatArray]:
    """Plan, centres and radii of the first frame in a picture of 640 x 480 pixels."""
    stage = stage_of(motion)
    discs = person_discs(stage.plan, stage.camera(480, 640), stage.turned(stage.positions)[:1], slice(0, 1))
    return stage.plan, discs.centres[0], discs.radii[0]


def part_of(plan: BodyPlan, paint: str, count: int = 2) -> int:
    """Number of the first part of that paint with so many discs."""
    return next(n for n, part in enumerate(plan.parts) if part.paint == paint and len(part.points) == count)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("axes", [2, 3])
def test_every_body_has_a_trunk_a_head_two_arms_and_two_legs(name: str, axes: int) -> None:
    skeleton = BODIES[name]
    plan = body_plan(standing(skeleton, axes), skeleton)
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
    plan = body_plan(positions, BODIES[name])
    assert plan.stature == pytest.approx(1.7, rel=0.03)
    chin, crown = (plan.weights[point] @ positions[0] for point in plan.parts[part_of(plan, "head")].points)
    top = crown[1] + plan.parts[part_of(plan, "head")].radii[1] * plan.stature
    assert top == pytest.approx(1.7, abs=0.03)
    assert crown[1] > chin[1] > 1.39
    assert (chin[1] + crown[1]) / 2 - 1.39 == pytest.approx(HEAD_UP * 1.7, abs=0.02)


def test_head_that_was_not_measured_is_assumed_and_pale() -> None:
    player = PLAYER_50
    paints = [part.paint for part in body_plan(standing(player, 2), player).parts]
    assert "assumed" in paints and "head" not in paints
    assert min(PAINTS["assumed"]) > max(PAINTS["head"])


def test_a_foot_is_one_part_around_ankle_heel_and_toe() -> None:
    feet = [part for part in body_plan(standing(TANG_23), TANG_23).parts if len(part.points) == 3]
    assert [{TANG_23.joints[joint] for joint in part.points} for part in feet] == [
        {f"{side}_{part}" for part in ("ankle", "heel", "toe")} for side in ("left", "right")
    ]


def test_bodies_without_names_are_sticks_and_without_bones_dots() -> None:
    pair = Skeleton(("a", "b", "c"), (-1, 0, 1))
    plan = body_plan(standing(pair), pair)
    assert [(part.points, part.paint) for part in plan.parts] == [((0, 1), "stick"), ((1, 2), "stick")]
    assert [part.points for part in body_plan(standing(pair), Skeleton.unnamed(3)).parts] == [(0,), (1,), (2,)]


def test_arms_alone_are_drawn_in_the_colours_of_their_sides() -> None:
    arm = Skeleton(("left_elbow", "left_wrist", "right_elbow", "right_wrist"), (-1, 0, -1, 2))
    assert [part.paint for part in body_plan(standing(arm), arm).parts] == ["left", "right"]


@pytest.mark.parametrize("name", BODIES)
def test_left_is_at_the_right_of_who_faces_the_dancer(name: str) -> None:
    plan, centres, _ = discs_of(Motion(standing(BODIES[name]), 30.0, BODIES[name]))
    sides = {
        paint: np.mean([centres[n, :, 0].mean() for n, part in enumerate(plan.parts) if part.paint == paint])
        for paint in ("left", "right")
    }
    assert sides["left"] > 330 > 310 > sides["right"]


def test_camera_looks_from_beside_the_front_and_above() -> None:
    stage = stage_of(Motion(standing(TANG_23), 30.0, TANG_23))
    camera = stage.camera(480, 640)
    target = np.array([stage.way[0, 0], stage.aim, stage.way[0, 1]])
    away = camera.eye[0] - stage.turned(target)
    assert np.linalg.norm(away) == pytest.approx(DISTANCE * stage.size)
    assert np.arcsin(away[1] / np.linalg.norm(away)) == pytest.approx(LIFT)
    middle = camera.to_pixels(camera.to_view(stage.turned(target[None, None]), slice(0, 1)))
    np.testing.assert_allclose(middle[0, 0], [320.0, 480.0 * MIDDLE])
    # A point to the dancer's left and in front of her by the camera's angle lies before the camera.
    ahead = target[None, None] + [np.sin(ANGLE), 0.0, np.cos(ANGLE)]
    assert camera.to_pixels(camera.to_view(stage.turned(ahead), slice(0, 1)))[0, 0, 0] == pytest.approx(320.0)


def test_camera_that_follows_keeps_the_hips_in_the_middle() -> None:
    walk = standing(TANG_23)[:1] + np.linspace(0, 4, 90)[:, None, None] * np.array([1.0, 0.0, 0.3])
    motion = Motion(walk, 30.0, TANG_23)
    for follow, most in ((True, 1e-6), (False, 200.0)):
        stage = stage_of(motion, follow=follow)
        camera, hips = stage.camera(480, 640), np.einsum("j,tjd->td", stage.plan.hips, stage.turned(stage.positions))
        across = camera.to_pixels(camera.to_view(hips[:, None], slice(None)))[:, 0, 0] - 320
        assert np.abs(across).max() <= most
        assert follow or np.abs(across).max() > 20


def test_hull_touches_the_outermost_discs() -> None:
    centres = np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 1.0]])
    outline = hulls(centres, np.array([2.0, 3.0, 1.0]))
    assert outline.shape == (CORNERS, 2)
    assert outline[:, 0].max() == pytest.approx(13.0) and outline[:, 0].min() == pytest.approx(-2.0)
    distances = np.linalg.norm(outline[:, None] - centres, axis=2) - [2.0, 3.0, 1.0]
    assert distances.min() >= -1e-9
    alone = hulls(np.array([[4.0, 5.0]]), np.array([1.5]))
    np.testing.assert_allclose(np.linalg.norm(alone - [4.0, 5.0], axis=1), 1.5)


def test_shapes_come_from_far_to_near_and_near_ones_are_darker() -> None:
    reaching = standing(SMPL_24)
    for side, depth in (("left", 0.6), ("right", -0.6)):
        reaching[:, [SMPL_24.joints.index(f"{side}_{part}") for part in ("elbow", "wrist", "hand")], 2] = depth
    stage = stage_of(Motion(reaching, 30.0, SMPL_24), angle=0.0)
    (shapes,) = person_shapes(stage.plan, stage.camera(480, 640), stage.turned(stage.positions)[:1], slice(0, 1))
    order = [stage.plan.parts[shape.part] for shape in shapes]
    hands = [part.paint for part in order if SMPL_24.joints.index("left_hand") in part.points] + ["left"]
    assert hands and order[-1].paint == "left" and order[0].paint == "right"
    assert shapes[-1].colour == PAINTS["left"] and min(shapes[0].colour) > min(PAINTS["right"])


def test_synthetic_dancer_is_as_tall_as_its_stature() -> None:
    motion = synthetic_clip("waltz", seed=1).motion
    assert 1.5 < body_plan(motion.positions, motion.skeleton).stature < 2.0


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
    left, right, trunk = (lab(matrix @ linear(PAINTS[name])) for name in ("left", "right", "body"))
    assert np.linalg.norm(left - right) > 40
    assert abs(left[0] - right[0]) > 20
    assert min(np.linalg.norm(left - trunk), np.linalg.norm(right - trunk)) > 20


def test_colours_of_the_sides_mean_nothing_else() -> None:
    marks = [lab(linear(tuple(bytes.fromhex(colour[1:])))) for colour in COLOURS.values()]
    for (_, paint), mark in itertools.product([item for item in PAINTS.items() if item[0] in ("left", "right")], marks):
        assert np.linalg.norm(lab(linear(paint)) - mark) > 15
