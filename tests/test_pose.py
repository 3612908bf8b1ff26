"""The body in a video: asked of a process that may fall silent, die or talk nonsense; several people; the cache."""

import re
import time
from pathlib import Path

import numpy as np
import pytest

from harmolab.files import cache_folder
from harmolab.readers import pose
from harmolab.readers import pose as pose_process
from harmolab.readers.pose import Picture, body_motion, found_people, read_pose
from harmolab.readers.video import write_video
from tests.builders import cases, refused
from tests.pose_stand_ins import stand_in, standing_body

FPS = 20.0


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HARMOLAB_POSE", "on")
    return tmp_path / "cache"


def pictures(count: int = 6) -> list[Picture]:
    return [Picture(np.full((32, 64, 3), 40 + index, np.uint8)) for index in range(count)]


def film(path: Path, left: np.ndarray, right: np.ndarray | float = 0.0, *, blue: float = 1.0) -> Path:
    """A video whose left half has these brightnesses, a picture each, with this share of blue; its right half those."""
    frames = np.zeros((len(left), 64, 128, 3), np.uint8)
    frames[:, :, :64] = np.asarray(left)[:, None, None, None]
    frames[:, :, 64:] = (np.zeros(len(left)) + right)[:, None, None, None]
    frames[:, :, :64, 2] = blue * frames[:, :, :64, 2]
    write_video(path, frames, FPS)
    return path


def waves(hertz: float, seconds: float = 6.0, size: float = 60.0) -> np.ndarray:
    return 120 + size * np.sin(2 * np.pi * hertz * np.arange(round(seconds * FPS)) / FPS)


def test_every_picture_gets_the_answer_of_its_own_body(tmp_path: Path):
    people = list(found_people(pictures(), stand_in(tmp_path)))
    heights = [person[15, 3] for person, _ in people]
    np.testing.assert_allclose(heights, [-(40 + index) / 255 for index in range(6)], atol=1e-5)
    assert all(other is None for _, other in people)


@cases(
    "fault, words",
    ("begin", "answers nonsense at its begin"),
    ("crash", r"ended early \(code 6\): Check failed: no such graph"),
    ("infinite", "points that are no body's"),
    ("half", "points that are no body's"),
    ("short", "ended early"),
    ("long", "says more than it was asked"),
)
def test_a_process_that_goes_wrong_is_one_clear_error(tmp_path: Path, fault: str, words: str):
    refused(words, list, found_people(pictures(), stand_in(tmp_path, fault)))


def test_a_process_that_hangs_is_stopped(tmp_path: Path):
    begin = time.monotonic()
    with pytest.raises(ValueError, match="gave no answer for 1 s and was stopped"):
        list(found_people(pictures(), stand_in(tmp_path, "hang"), seconds=1.0))
    assert time.monotonic() - begin < 10


def test_a_process_that_never_begins_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pose_process, "BEGIN_SECONDS", 1.0)
    refused("gave no answer for 1 s", list, found_people(pictures(), stand_in(tmp_path, "mute")))


def test_an_error_of_the_video_is_told_as_it_is(tmp_path: Path):
    def damaged():
        yield from pictures(2)
        raise ValueError("take.mp4: is cut off")

    refused(r"take\.mp4: is cut off", list, found_people(damaged(), stand_in(tmp_path)))


def test_slow_pictures_are_no_silence_of_the_process(tmp_path: Path):
    def slow():
        for picture in pictures(3):
            time.sleep(0.7)
            yield picture

    assert len(list(found_people(slow(), stand_in(tmp_path), seconds=0.5))) == 3


def test_the_motion_is_in_metres_with_y_up_and_named_joints(tmp_path: Path):
    motion = read_pose(film(tmp_path / "take.mp4", waves(1.0)), command=stand_in(tmp_path)).motion
    assert (motion.fps, motion.skeleton.joints) == (FPS, pose.BODY)
    wrist, nose, foot = (motion.positions[:, pose.BODY.index(name), 1] for name in ("left_wrist", "nose", "left_ankle"))
    assert nose[0] == pytest.approx(0.6) and foot[0] == pytest.approx(-0.8)
    np.testing.assert_allclose(wrist, waves(1.0) / 255, atol=0.04)
    assert motion.valid.all()


def test_a_fast_video_is_read_at_every_third_picture_in_its_own_time(tmp_path: Path):
    frames = np.repeat(waves(1.0)[::2].astype(np.uint8), 6)[:, None, None, None] + np.zeros((1, 64, 128, 3), np.uint8)
    write_video(tmp_path / "fast.mp4", frames, 60.0)
    motion = read_pose(tmp_path / "fast.mp4", command=stand_in(tmp_path)).motion
    assert (motion.fps, motion.duration) == (30.0, pytest.approx(len(frames) / 60, abs=0.05))


def test_nobody_is_told_as_nobody(tmp_path: Path):
    path = film(tmp_path / "empty.mp4", np.zeros(40))
    message = "I could not read your movement well enough: nobody is found in the picture"
    refused(f"{re.escape(str(path))}: {message}", read_pose, path, command=stand_in(tmp_path))


def test_somebody_in_few_pictures_is_told_so(tmp_path: Path):
    path = film(tmp_path / "short.mp4", np.repeat([120.0, 0.0], [10, 30]))
    refused(r"a person is found in 2\d% of the pictures only", read_pose, path, command=stand_in(tmp_path))


def test_pictures_without_the_body_are_filled_in_and_do_not_count(tmp_path: Path):
    left = waves(0.5)
    left[20:25] = 0.0
    motion = read_pose(film(tmp_path / "gap.mp4", left), command=stand_in(tmp_path)).motion
    np.testing.assert_array_equal(np.flatnonzero(~motion.valid), np.arange(20, 25))
    assert np.isfinite(motion.positions).all()


def test_joints_out_of_the_picture_are_left_out_and_named():
    landmarks = np.repeat(standing_body()[None], 30, axis=0)
    landmarks[:, 25:33, 5] = 0.1  # from the knees down
    reading = body_motion(landmarks, 30.0)
    assert [name for name in pose.BODY if name not in reading.motion.skeleton.joints] == list(pose.BODY[-6:])
    assert reading.motion.valid.all()
    assert "left out: left knee, right knee, left ankle" in reading.notes[-1]


def test_too_little_of_a_body_is_an_error():
    landmarks = np.repeat(standing_body()[None], 30, axis=0)
    landmarks[:, 13:, 5] = 0.1
    refused("only 3 of 15 joints of the body are seen; film all of it", body_motion, landmarks, 30.0)


def test_a_single_wrong_picture_is_taken_out():
    landmarks = np.repeat(standing_body()[None], 30, axis=0)
    landmarks[12, [11, 12]] = landmarks[12, [12, 11]]  # left and right shoulder swapped
    assert np.ptp(body_motion(landmarks, 30.0).motion.positions, axis=0).max() == 0


@pytest.mark.parametrize("quiet_one_first", [True, False])
def test_of_two_people_the_one_who_moves_most_is_taken(tmp_path: Path, quiet_one_first: bool):
    lively, quiet = waves(1.5), waves(0.2, size=5.0)
    left, right = (quiet, lively) if quiet_one_first else (lively, quiet)
    reading = read_pose(film(tmp_path / "two.mp4", left, right, blue=0), command=two_people(tmp_path))
    assert reading.notes[0] == "2 people are in the picture; the one who moves most was taken"
    wrist = reading.motion.positions[:, pose.BODY.index("left_wrist"), 1]
    np.testing.assert_allclose(wrist, lively / 255, atol=0.08)


def two_people(folder: Path) -> list[str]:
    """A process that follows who is in the left half, or in the right one where the left one is painted over."""
    command = stand_in(folder)
    script = Path(command[1])
    swap = "    left = pixels[:, : width // 2].mean(axis=(0, 1))\n"
    swap += "    if left[2] > 0.2 * left[0]:  # painted over: it was without blue\n"
    swap += "        pixels = np.concatenate([pixels[:, width // 2 :], 0 * pixels[:, width // 2 :]], axis=1)\n"
    text = script.read_text().replace("    content = answer(", swap + "    content = answer(")
    # The box of the one on the left is the left half.
    script.write_text(text.replace("points[:, 0] * 0.3 + 0.1", "np.linspace(0, 0.41, 33)"))
    return command


def test_what_was_read_is_kept_by_the_content_of_the_video(tmp_path: Path, cache: Path):
    path = film(tmp_path / "take.mp4", waves(1.0))
    first = read_pose(path, command=stand_in(tmp_path)).motion
    moved = path.rename(tmp_path / "renamed.mp4")
    again = read_pose(moved, command=["a command", "that is not there"]).motion
    np.testing.assert_array_equal(first.positions, again.positions)
    film(moved, waves(2.0))
    assert not np.array_equal(read_pose(moved, command=stand_in(tmp_path)).motion.positions, first.positions)
    assert len(list(cache.glob("poses_*.npz"))) == 2


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", "nan", "shape", "type"])
def test_a_damaged_reading_in_the_cache_is_read_anew(tmp_path: Path, cache: Path, content: bytes | str):
    path = film(tmp_path / "take.mp4", waves(1.0))
    first = read_pose(path, command=stand_in(tmp_path)).motion
    (kept,) = cache.glob("poses_*.npz")
    if isinstance(content, bytes):
        kept.write_bytes(content)
    else:
        people = np.zeros((1, 10, 33, 6), np.float32)
        people[0, 0, 0, 0] = np.nan
        np.savez(kept, people={"nan": people, "shape": people[:, :, :5], "type": np.zeros(people.shape, int)}[content])
    np.testing.assert_array_equal(first.positions, read_pose(path, command=stand_in(tmp_path)).motion.positions)


def test_the_oldest_readings_go_where_all_take_too_much_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pose, "KEPT_BYTES", 150_000)
    for number in range(4):
        read_pose(film(tmp_path / "take.mp4", waves(0.5 + number)), command=stand_in(tmp_path))
        time.sleep(0.02)
    folder = cache_folder()
    assert folder is not None
    files = list(folder.glob("poses_*.npz"))
    assert 1 <= len(files) < 4
    assert sum(file.stat().st_size for file in files) <= 150_000


def test_without_an_environment_the_error_says_what_fetches_it(tmp_path: Path):
    with pytest.raises(ValueError, match="no MediaPipe to find a body with; `harmolab pose --install` fetches it"):
        read_pose(film(tmp_path / "take.mp4", waves(1.0)))
