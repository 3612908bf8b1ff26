"""Musicians as they are drawn: thin fingers, props without shadows, a camera by their box, two over each other."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton, skull_and_limbs
from harmolab.data.synthetic import DANCER, synthetic_clip
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.person import LIFT, body_plan, shadow_outline, stage_of
from harmolab.lab.player import Dancer, Player, movement_data
from harmolab.lab.render.overlay import CORE, RIM, overlay_skeleton
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import BACKGROUND, render_skeleton
from harmolab.musician.avatar import avatar
from harmolab.musician.video import PREDICTION, TRUTH, render_points
from harmolab.params import HarmonyParams
from harmolab.readers.player_points import (
    INSTRUMENTS,
    PLAYER_50,
    SOUND_BOX,
    THIN,
    VIOLIN,
    hand_joints,
    joint_widths,
    limb_widths,
    playing_box,
    prop_joints,
)
from harmolab.score import score_harmony
from harmolab.types import Audio, Motion
from study.experiments.player_in_space import player_in_space
from tests.builders import refused, track
from tests.test_player import data_of, positions_of


def drawn(motion: Motion) -> np.ndarray:
    """(H, W) where limbs are in the first picture of the scene."""
    frame = next(render_dance(motion)).astype(int)
    return (frame.max(axis=2) < 165) | (frame[..., 0] - frame[..., 2] > 30)


def pole(names: tuple[str, str]) -> Motion:
    """A body of one pole, and beside it another with joints of these names."""
    places = np.array([[0.0, 0, 0], [0, 1.7, 0], [0.5, 0.2, 0], [0.5, 1.5, 0]])
    return Motion(np.tile(places, (2, 1, 1)), 30.0, Skeleton(("hip", "neck", *names), (-1, 0, -1, 2)))


# Widths


def test_fingers_and_props_are_thin_and_the_rest_is_not() -> None:
    widths = dict(zip(PLAYER_50.joints, joint_widths(PLAYER_50), strict=True))
    thin = {name for side in ("left", "right") for name in hand_joints(side)[1:]}
    assert {name for name, width in widths.items() if width == THIN} == thin
    assert set(widths.values()) == {THIN, 1.0}
    violin = Skeleton(VIOLIN, (-1, 0, 1, 2))
    assert limb_widths(violin, violin.bones) == [SOUND_BOX, SOUND_BOX, THIN]
    assert prop_joints(violin) == [0, 1, 2, 3]


def test_dancers_are_drawn_as_before() -> None:
    _, limbs = skull_and_limbs(DANCER)
    assert limb_widths(DANCER, limbs) == [1.0] * len(limbs)
    clip = synthetic_clip("waltz", seed=1)
    assert playing_box(clip.motion) is None and prop_joints(DANCER) == []
    data = movement_data(clip.motion)
    assert data["aim"] == 0.47 * data["size"] and data["lift"] == LIFT


@pytest.mark.parametrize(("names", "is_thin"), [(("a", "b"), False), (("left_index_1", "left_index_4"), True)])
def test_finger_is_drawn_thinner_than_a_limb(names: tuple[str, str], is_thin: bool) -> None:
    columns = drawn(pole(names))[200:260]  # rows half way up both
    body, other = columns[:, :320].sum(axis=1).mean(), columns[:, 320:].sum(axis=1).mean()
    assert (other < 0.5 * body) == is_thin
    flat = Motion(pole(names).positions[..., :2] * [100.0, -100.0] + 300.0, 30.0, pole(names).skeleton)
    dark = next(render_skeleton(flat, height=480)) < BACKGROUND
    thick = [dark[220:260, half].sum(axis=1).mean() for half in (slice(0, 320), slice(320, 640))]
    assert (thick[1] < 0.5 * thick[0]) == is_thin
    black = [np.zeros((480, 640, 3), np.uint8)] * 2
    lines = next(overlay_skeleton(black, 30.0, flat))
    assert (lines == RIM).any() and (lines == CORE).any()
    light = (lines == CORE).all(axis=2)[200:260]
    assert (light[:, 325:].sum() < 0.75 * light[:, 250:325].sum()) == is_thin


# The scene


@pytest.mark.parametrize(("names", "is_wider"), [(("a", "b"), True), (("bow_frog", "bow_tip"), False)])
def test_props_throw_no_shadow(names: tuple[str, str], is_wider: bool) -> None:
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
def test_player_and_props_fill_the_picture_and_stay_in_it(instrument: str, size: tuple[int, int]) -> None:
    motion = avatar(player_in_space(instrument, seconds=2.0).points, instrument)
    for frame in list(render_dance(motion, height=size[0], width=size[1]))[::20]:
        rows, columns = np.nonzero((frame.max(axis=2) < 165) | (frame[..., 0].astype(int) - frame[..., 2] > 30))
        assert rows.min() > 2 and rows.max() < size[0] - 3
        assert columns.min() > 2 and columns.max() < size[1] - 3
        assert max(np.ptp(rows) / size[0], np.ptp(columns) / size[1]) > 0.6


def test_camera_of_a_player_rests() -> None:
    motion = avatar(player_in_space("piano", seconds=2.0).points, "piano")
    first, *_, last = render_dance(motion)
    np.testing.assert_array_equal(first[-60:, :60], last[-60:, :60])
    way = np.array(movement_data(motion)["way"]["low"])
    np.testing.assert_allclose(way, playing_box(motion).mean(axis=0)[[0, 2]], atol=1e-9)


# Two over each other


def two() -> tuple[Motion, Motion]:
    truth = player_in_space("violin", seconds=2.0).points
    return truth, Motion(truth.positions + np.array([40.0, 0.0]), truth.fps, truth.skeleton)


def test_prediction_is_green_over_a_red_truth() -> None:
    truth, prediction = two()
    frame = next(render_points(truth, prediction))
    red, green = ((frame == colour).all(axis=2) for colour in (TRUTH, PREDICTION))
    assert red.sum() > 1.3 * green.sum() > 1000
    assert np.nonzero(green)[1].mean() > np.nonzero(red)[1].mean() + 20
    assert (next(render_points(truth, truth)) == PREDICTION).all(axis=2).sum() > 1000
    for colour, name in ((TRUTH, "miss"), (PREDICTION, "hit")):
        assert "#{:02X}{:02X}{:02X}".format(*colour) == COLOURS[name].upper()


def test_points_in_space_do_not_go_over_each_other() -> None:
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


def test_page_lays_two_motions_of_one_picture_over_each_other() -> None:
    page = page_of(list(two()), overlaid=True).page
    first, second = data_of(page)["dancers"]
    assert page.count('class="stage"') == 1
    assert first["size"] == second["size"]
    shift = positions_of(second) - positions_of(first)
    np.testing.assert_allclose(shift, np.broadcast_to([40.0, 0.0, 0.0], shift.shape), atol=0.05)
    assert page_of(list(two())).page.count('class="stage"') == 2
    with pytest.raises(ValueError, match="two motions in image coordinates"):
        page_of([player_in_space("violin", seconds=2.0).space] * 2, overlaid=True)
    refused("two motions in image coordinates", page_of, [two()[0]], overlaid=True)


@pytest.mark.browser
def test_pages_of_players_are_drawn_in_a_browser(chromium: Any, tmp_path: Path) -> None:
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


def test_caption_names_the_colours_only_where_dancers_are_overlaid() -> None:
    classes = [
        re.findall(r'<figcaption class="(\w+)"', page_of(list(two()), overlaid=over).page) for over in (True, False)
    ]
    assert classes == [["truth", "prediction"], []]
