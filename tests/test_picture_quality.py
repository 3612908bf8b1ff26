"""A video that cannot be read by flow is not judged, and the reason is told."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from harmolab.body.skeletons import joint_indices, skeleton_part
from harmolab.cli.sources import check_signs
from harmolab.lab.explain.filmed import HANDLED, SHAKES, PictureWatch, check_sign, filmed_motion, limb_spread
from harmolab.lab.explain.offset import PICTURE
from harmolab.readers.keypoints import MEDIAPIPE_33
from harmolab.readers.video import write_video
from harmolab.types import Motion
from tests.builders import cases, planted_dance, refused, waving
from tests.phone_videos import Phone, agreement, film, filmed_part

SMALL = Phone(height=180, noise=3.0, fps=25.0)
UNREAD = "I could not read your movement well enough: "


@pytest.fixture(scope="module")
def dance() -> Motion:
    return filmed_part(planted_dance(seconds=12.0), seconds=6.0)[0]


@pytest.mark.slow
@pytest.mark.parametrize("phone", [SMALL, replace(SMALL, noise=8.0, crf=35), replace(SMALL, shake=0.7, contrast=0.5)])
def test_a_dancer_before_a_wall_that_rests_is_read(dance: Motion, tmp_path: Path, phone: Phone):
    correlation, shift = agreement(dance, filmed_motion(film(tmp_path / "take.mp4", dance, None, phone)).motion)
    assert correlation > 0.5  # .59 to .69 by processor and count of threads
    assert abs(shift) <= 0.02


@pytest.mark.slow
@cases(
    "phone, reason",
    (replace(SMALL, shake=6.0), "the camera moves; put it on something that stands still"),
    (replace(SMALL, curtain=30.0), "the background moves, or others do; film with only yourself in the picture"),
    (replace(SMALL, fps=6.0), "6 pictures a second are too few; film with 8 or more"),
)
def test_what_moves_besides_the_dancer_is_named(dance: Motion, tmp_path: Path, phone: Phone, reason: str):
    path = film(tmp_path / "take.mp4", dance, None, phone)
    refused("^" + re.escape(f"{path}: {UNREAD}{reason}"), filmed_motion, path)


def test_a_picture_without_movement_is_told_so(tmp_path: Path):
    write_video(tmp_path / "wall.mp4", [np.full((64, 96, 3), 90, np.uint8)] * 60, 20.0)
    refused(f"{UNREAD}nothing moves in the picture", filmed_motion, tmp_path / "wall.mp4")
    watch = PictureWatch([np.full((6, 8), at % 20 == 9, np.float32) for at in range(60)])  # another slide each second
    refused("nothing moves in the picture", watch.check)


def test_a_light_that_flashes_on_the_beat_is_not_taken_for_a_dancer(tmp_path: Path):
    wall = cv2.resize(np.random.default_rng(1).uniform(40, 160, (48, 64)), (128, 96))
    frames = [np.uint8(wall * (1 + 0.5 * 0.5 ** (at % 10))) for at in range(80)]
    for name in ("room.mp4", "dancer.mp4"):
        write_video(tmp_path / name, frames, 20.0)
        refused("the light changes or the film is cut", filmed_motion, tmp_path / name)
        for at, frame in enumerate(frames):
            cv2.circle(frame, (round(55 + 3 * np.sin(0.3 * at)), 60), 12, 60, -1)


@pytest.mark.parametrize(("columns", "is_read"), [(0, True), (1, False)])
def test_the_limit_lies_between_two_shares_of_the_edge(columns: int, is_read: bool):
    watch, speed = PictureWatch(), np.zeros((60, 80), np.float32)
    speed[10:, :10] = 1.0  # five of six cells of the left edge, of 18 in all: .28
    speed[:10, 10 : 10 + 10 * columns] = 1.0  # and one more: .33
    watch(speed)
    if is_read:
        watch.check()
    else:
        refused("the background moves", watch.check)


@cases("begin, end, reason", (9, 0, HANDLED), (0, 9, HANDLED), (9, 9, HANDLED), (90, 0, SHAKES), (0, 200, SHAKES))
def test_a_camera_that_moves_as_the_film_begins_or_ends_is_told_apart(begin: int, end: int, reason: str):
    cells = np.zeros((240, 6, 8), np.float32)
    cells[:, 2:5, 3:5] = 0.1  # the dancer
    PictureWatch(list(cells)).check()
    cells[[*range(begin), *range(240 - end, 240)]] = 2.0
    refused(re.escape(UNREAD + reason), PictureWatch(list(cells)).check)


def test_no_sign_in_the_flow_is_no_verdict_and_in_a_body_it_is_one():
    body = waving(np.arange(60) / 15)
    flow = Motion(np.zeros((60, 1, 2)), 30.0, PICTURE)
    refused(f"{UNREAD}the flow of the picture shows no sign of the beat", check_sign, "take.mp4", flow)
    check_sign("take.mp4", body)
    video, clip = SimpleNamespace(motion="take.mp4"), SimpleNamespace(motion=flow)
    for level in (0, 2, 4):
        check_signs(video, clip, [SimpleNamespace(judgement=SimpleNamespace(level=level))])


@pytest.mark.parametrize(("loose", "is_refused"), [(0.1, False), (0.2, True)])
def test_a_body_whose_limbs_change_their_length_is_not_told_that_it_shows_no_sign(loose: float, is_refused: bool):
    skeleton = skeleton_part(MEDIAPIPE_33, joint_indices(MEDIAPIPE_33, ("left_shoulder", "left_elbow", "left_wrist")))
    lengths = 1 + loose * np.where(np.arange(60) % 2, 1.0, -1.0)  # SD over mean is `loose`
    arm = np.array([[0.0, 1.4, 0.0], [0.0, 1.1, 0.0], [0.0, 0.8, 0.0]])
    motion = Motion(lengths[:, None, None] * arm, 30.0, skeleton)
    assert limb_spread(motion) == pytest.approx(loose)
    check_sign("take.npz", motion)
    if is_refused:
        refused("limbs of the body that was found change their length by 20%", check_sign, "take.mp4", motion)
    else:
        check_sign("take.mp4", motion)
