"""The skeleton over its video: at the known points, at the right time, and only where somebody was seen."""

import json
from pathlib import Path

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.lab.render.overlay import CORE, load_points, overlay_skeleton, points_in_picture
from harmolab.readers.motion import save_motion
from harmolab.readers.video import VideoFrames, video_frames, write_video
from harmolab.score import score_harmony
from harmolab.types import BeatTrack, Motion
from tests.builders import refused

POLE = Skeleton(("hip", "knee"), (-1, 0))
HEIGHT, WIDTH = 240, 320


def plain(count: int, level: int = 90) -> list[np.ndarray]:
    return [np.full((HEIGHT, WIDTH, 3), level, np.uint8)] * count


def pole(xs: list[float], fps: float = 10.0, valid: list[bool] | None = None) -> Motion:
    """An upright limb from (x, 60) to (x, 180), one x a frame."""
    return Motion([[[x, 60.0], [x, 180.0]] for x in xs], fps, POLE, valid)


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


def test_frames_that_came_in_are_not_changed() -> None:
    frames = plain(2)
    list(overlay_skeleton(frames, 10.0, pole([50, 50])))
    assert (frames[0] == 90).all()


def test_marks_light_up_on_their_beats() -> None:
    music, visual = BeatTrack([0.5], [1.0], 30.0, 2.0), BeatTrack([], [], 30.0, 2.0)
    frames = list(overlay_skeleton(plain(20), 10.0, pole([200] * 20), score=score_harmony(music, visual)))
    lit = [bool((frame[10, 10] == (0, 114, 178)).all()) for frame in frames]
    assert [index for index, on in enumerate(lit) if on] == [5, 6]


def test_pixels_of_the_source_are_scaled_to_the_frames(video: VideoFrames) -> None:
    np.testing.assert_allclose(points_in_picture(pole([400, 400]), video).positions[0], [[200, 30], [200, 90]])


def test_shares_are_taken_of_both_sides(video: VideoFrames) -> None:
    places = points_in_picture(Motion([[[0.5, 0.25], [0.5, 0.75]]] * 2, 10.0, POLE), video).positions
    np.testing.assert_allclose(places[0], [[160, 60], [160, 180]])


def test_points_of_another_picture_are_refused(video: VideoFrames) -> None:
    with pytest.raises(ValueError, match=r"take\.mp4: 100% of the points lie outside its pictures of 640 x 480 pixels"):
        points_in_picture(pole([1500, 1500]), video)


def test_points_outside_in_frames_without_anybody_do_not_count(video: VideoFrames) -> None:
    kept = points_in_picture(pole([100, -9000, -9000, 100], valid=[True, False, False, True]), video)
    assert kept.positions[0, 0, 0] == 50


def test_far_points_are_drawn_without_a_fault() -> None:
    assert next(overlay_skeleton(plain(1), 10.0, pole([1e12, -1e12]))).shape == (HEIGHT, WIDTH, 3)


def test_movement_in_space_is_refused(video: VideoFrames, tmp_path: Path) -> None:
    motion = Motion(np.zeros((3, 2, 3)), 30.0, POLE)
    refused("the motion is movement in space", overlay_skeleton, plain(3), 10.0, motion)
    refused("the motion is movement in space", points_in_picture, motion, video)
    save_motion(tmp_path / "m.npz", motion)
    refused(r"m\.npz: is movement in space; over a video go points of its pictures", load_points, tmp_path / "m.npz")
    refused("fps must be positive", overlay_skeleton, plain(3), float("inf"), pole([1, 1]))


def test_a_hidden_ear_does_not_hide_the_dancer_a_hidden_wrist_does(tmp_path: Path) -> None:
    values = np.ones((4, 17, 3))
    values[..., :2] = 100 + np.arange(17)[:, None]
    values[1, 3, 2] = 0.0  # left ear
    values[2, 9, 2] = 0.0  # left wrist
    np.save(tmp_path / "k.npy", values)
    motion = load_points(tmp_path / "k.npy", fps=25.0)
    assert motion.valid.tolist() == [True, True, False, True]
    assert "left_ear" not in motion.skeleton.joints and "left_wrist" in motion.skeleton.joints


def test_landmarks_stay_shares_whatever_proportions_the_file_notes(tmp_path: Path, video: VideoFrames) -> None:
    frame = [{"x": 0.5, "y": 0.25, "z": 0.0, "visibility": 1.0}] * 33
    (tmp_path / "l.json").write_text(json.dumps({"fps": 10, "aspect": 1.5, "frames": [frame] * 3}))
    placed = points_in_picture(load_points(tmp_path / "l.json"), video)
    np.testing.assert_allclose(placed.positions[0], [[160, 60]] * 33)
