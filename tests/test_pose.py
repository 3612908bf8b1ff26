"""The body in a video: a process that may fall silent, die or talk nonsense; several people; cache and environment.

The environment is whole or not at all, made by one process at a time, and never unasked.
"""

import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from harmolab.cli import app, data
from harmolab.files import UNFINISHED
from harmolab.lab.explain.filmed import filmed_motion
from harmolab.readers import pose
from harmolab.readers.keypoints import MEDIAPIPE_33
from harmolab.readers.pose import Picture, body_motion, found_people, read_pose
from harmolab.readers.video import write_video
from tests import phone_videos
from tests.builders import cases, complaint, planted_dance, refused

# The redness of a picture's left half is the height of her wrists: 0 low, 255 one metre higher. The right half: the
# same of a second person, unless black. What goes wrong is told by "FAULT" in place of a picture's answer.
CHILD = """
import struct, sys, time
import numpy as np
out, read = sys.stdout.buffer, sys.stdin.buffer.read
body = np.load(sys.argv[1])
fault, at = sys.argv[2], int(sys.argv[3])
def answer(part):
    points = body.copy()
    level = part[..., 0].mean() / 255 if part[..., 0].mean() > 10 else 0
    points[15:17, 3] -= level
    points[:, 0] = points[:, 0] * 0.3 + 0.1
    if level == 0:
        points[:] = np.nan
    return points.astype(np.float32).tobytes()
if fault == "mute": time.sleep(60)
out.write(b"NONSENSE" if fault == "begin" else b"POSE0001"); out.flush()
index = 0
while True:
    header = read(12)
    if len(header) < 12: break
    height, width, looked_at = struct.unpack("<3I", header)
    pixels = np.frombuffer(read(height * width * 3), np.uint8).reshape(height, width, 3)
    if index == at and fault == "hang": time.sleep(60)
    if index == at and fault == "crash":
        print("Check failed: no such graph", file=sys.stderr); sys.exit(6)
    content = answer(pixels[:, : width // 2])
    if index == at and fault == "infinite": content = np.full((33, 6), np.inf, np.float32).tobytes()
    if index == at and fault == "half": content = content[:400] + np.full(98, np.nan, np.float32).tobytes()
    if index == at and fault == "short": out.write(content[:100]); out.flush(); sys.exit(0)
    out.write(content)
    if looked_at: out.write(answer(pixels[:, width // 2 :]))
    out.flush()
    index += 1
if fault == "long": out.write(b"more"); out.flush()
"""

PIP = """
import sys, time
from pathlib import Path
target = Path(sys.argv[sys.argv.index("--target") + 1])
(target / "mediapipe" / "python" / "solutions").mkdir(parents=True)
for name in ("mediapipe", "mediapipe/python", "mediapipe/python/solutions"):
    (target / name / "__init__.py").write_text("")
(target / "mediapipe/python/solutions/pose.py").write_text("class Pose:\\n    def __init__(self, **options): pass\\n")
with (target.parent / "calls").open("a") as calls:
    calls.write(" ".join(sys.argv[1:]) + "\\n")
mode = (target.parent / "mode").read_text() if (target.parent / "mode").exists() else ""
if mode == "slow": time.sleep(60)
if mode == "fails":
    print("WARNING: retrying", file=sys.stderr)
    print("ERROR: No matching distribution found for mediapipe==0.10.21", file=sys.stderr)
    sys.exit(1)
if mode == "broken":
    (target / "mediapipe/python/solutions/pose.py").write_text("raise ImportError('GLIBC is too old')\\n")
"""


def standing_body() -> np.ndarray:
    """(33, 6) landmarks of somebody who stands, in the middle of the picture, all seen."""
    heights = {"nose": -0.6, "shoulder": -0.45, "elbow": -0.2, "wrist": 0.0, "hip": 0.0, "knee": 0.4, "ankle": 0.8}
    points = np.zeros((33, 6), np.float32)
    for joint, name in enumerate(MEDIAPIPE_33.joints):
        side = 0.2 if name.startswith("left") else -0.2 if name.startswith("right") else 0.0
        height = next((value for part, value in heights.items() if part in name), 0.85 if "foot" in name else -0.6)
        points[joint] = [0.5 + side, 0.5 + height / 2.5, side, height, 0.1 * ("foot" in name), 0.9]
    return points


def stand_in(folder: Path, fault: str = "", at: int = 3, body: np.ndarray | None = None) -> list[str]:
    """The command of the process; it goes wrong in this way at that picture."""
    (folder / "child.py").write_text(CHILD)
    np.save(folder / "body.npy", standing_body() if body is None else body)
    return [sys.executable, str(folder / "child.py"), str(folder / "body.npy"), fault, str(at)]


def pip(folder: Path) -> list[str]:
    """The command that installs; a file "mode" beside its target says how it goes wrong."""
    (folder / "pip.py").write_text(PIP)
    return [sys.executable, str(folder / "pip.py")]


FPS = 20.0


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HARMOLAB_POSE", "on")
    (tmp_path / "cache").mkdir()
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


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return film(tmp_path / "take.mp4", waves(1.0, seconds=2.0))


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


@pytest.mark.slow
@cases("fault, start, seconds", ("hang", 60.0, 0.7), ("mute", 0.7, 60.0))
def test_a_process_that_hangs_or_never_begins_is_stopped(tmp_path: Path, monkeypatch, fault: str, start, seconds):
    monkeypatch.setattr(pose, "BEGIN_SECONDS", start)
    begin = time.monotonic()
    words = "gave no answer for 0.7 s and was stopped"
    refused(words, list, found_people(pictures(), stand_in(tmp_path, fault), seconds=seconds))
    assert time.monotonic() - begin < 10


@pytest.mark.slow
def test_slow_pictures_are_no_silence_of_the_process_and_an_error_of_the_video_is_told_as_it_is(tmp_path: Path):
    def slow(count: int):
        for picture in pictures(count):
            time.sleep(0.4)
            yield picture
        if count < 3:
            raise ValueError("take.mp4: is cut off")

    assert len(list(found_people(slow(3), stand_in(tmp_path), seconds=0.3))) == 3
    refused(r"take\.mp4: is cut off", list, found_people(slow(2), stand_in(tmp_path)))


def test_the_motion_is_in_metres_with_y_up_and_named_joints(tmp_path: Path):
    motion = read_pose(film(tmp_path / "take.mp4", waves(1.0)), command=stand_in(tmp_path)).motion
    assert (motion.fps, motion.skeleton.joints) == (FPS, pose.BODY)
    wrist, nose, foot = (motion.positions[:, pose.BODY.index(name), 1] for name in ("left_wrist", "nose", "left_ankle"))
    assert nose[0] == pytest.approx(0.6) and foot[0] == pytest.approx(-0.8)
    np.testing.assert_allclose(wrist, waves(1.0) / 255, atol=0.04)
    assert motion.valid.all()


@pytest.mark.slow
def test_a_fast_video_is_read_at_every_third_picture_in_its_own_time(tmp_path: Path):
    frames = np.repeat(waves(1.0)[::2].astype(np.uint8), 6)[:, None, None, None] + np.zeros((1, 64, 128, 3), np.uint8)
    write_video(tmp_path / "fast.mp4", frames, 60.0)
    motion = read_pose(tmp_path / "fast.mp4", command=stand_in(tmp_path)).motion
    assert (motion.fps, motion.duration) == (30.0, pytest.approx(len(frames) / 60, abs=0.05))


@cases(
    "left, words",
    (np.zeros(40), "I could not read your movement well enough: nobody is found in the picture"),
    (np.repeat([120.0, 0.0], [10, 30]), r"a person is found in 2\d% of the pictures only"),
)
def test_nobody_and_somebody_in_few_pictures_are_told_so(tmp_path: Path, left: np.ndarray, words: str):
    path = film(tmp_path / "empty.mp4", left)
    refused(f"{re.escape(str(path))}: .*{words}", read_pose, path, command=stand_in(tmp_path))


def test_pictures_without_the_body_are_filled_in_and_do_not_count(tmp_path: Path):
    left = waves(0.5)
    left[20:25] = 0.0
    motion = read_pose(film(tmp_path / "gap.mp4", left), command=stand_in(tmp_path)).motion
    np.testing.assert_array_equal(np.flatnonzero(~motion.valid), np.arange(20, 25))
    assert np.isfinite(motion.positions).all()


def test_joints_out_of_the_picture_are_left_out_and_named_and_too_little_of_a_body_is_an_error():
    landmarks = np.repeat(standing_body()[None], 30, axis=0)
    landmarks[:, 25:33, 5] = 0.1  # from the knees down
    reading = body_motion(landmarks, 30.0)
    assert [name for name in pose.BODY if name not in reading.motion.skeleton.joints] == list(pose.BODY[-6:])
    assert reading.motion.valid.all()
    assert "left out: left knee, right knee, left ankle" in reading.notes[-1]
    landmarks[:, 13:, 5] = 0.1
    refused("only 3 of 15 joints of the body are seen; film all of it", body_motion, landmarks, 30.0)


def test_a_single_wrong_picture_is_taken_out():
    landmarks = np.repeat(standing_body()[None], 30, axis=0)
    landmarks[12, [11, 12]] = landmarks[12, [12, 11]]  # left and right shoulder swapped
    assert np.ptp(body_motion(landmarks, 30.0).motion.positions, axis=0).max() == 0


LIVELY, QUIET = waves(1.5), waves(0.2, size=5.0)


@pytest.mark.slow
@cases("left, right", (QUIET, LIVELY), (LIVELY, QUIET))
def test_of_two_people_the_one_who_moves_most_is_taken(tmp_path: Path, left: np.ndarray, right: np.ndarray):
    reading = read_pose(film(tmp_path / "two.mp4", left, right, blue=0), command=two_people(tmp_path))
    assert reading.notes[0] == "2 people are in the picture; the one who moves most was taken"
    wrist = reading.motion.positions[:, pose.BODY.index("left_wrist"), 1]
    np.testing.assert_allclose(wrist, LIVELY / 255, atol=0.08)


def test_of_somebody_who_is_found_too_seldom_to_be_judged_a_line_tells(video: Path, tmp_path: Path, cache: Path):
    read_pose(video, command=stand_in(tmp_path))
    (kept,) = cache.glob("poses_*.npz")
    people = np.tile(standing_body(), (2, 40, 1, 1))
    people[1, 16:] = np.nan
    np.savez(kept, people=people)
    notes = ("another person is found in 40% of the pictures only, and was not looked at", "a body is seen in 100% of")
    assert [note[: len(start)] for note, start in zip(read_pose(video).notes, notes, strict=True)] == [*notes]
    people[1, 8:] = np.nan  # such as somebody who walks by
    np.savez(kept, people=people)
    assert len(read_pose(video).notes) == 1


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


@pytest.mark.slow
def test_a_damaged_reading_in_the_cache_is_read_anew(video: Path, tmp_path: Path, cache: Path):
    first = read_pose(video, command=stand_in(tmp_path)).motion
    (kept,) = cache.glob("poses_*.npz")
    people = np.zeros((1, 10, 33, 6), np.float32)
    unknown = people.copy()
    unknown[0, 0, 0, 0] = np.nan
    for damaged in (None, unknown, people[:, :, :5], people.astype(int)):
        np.savez(kept, people=damaged)
        if damaged is None:
            kept.write_bytes(b"PK\x03\x04")
        np.testing.assert_array_equal(first.positions, read_pose(video, command=stand_in(tmp_path)).motion.positions)


def test_the_oldest_readings_go_where_all_take_too_much_room(tmp_path: Path, cache: Path, monkeypatch):
    monkeypatch.setattr(pose, "KEPT_BYTES", 50_000)
    for number in range(4):
        read_pose(film(tmp_path / "take.mp4", waves(0.5 + number, seconds=2.0)), command=stand_in(tmp_path))
        time.sleep(0.02)
    files = list(cache.glob("poses_*.npz"))
    assert 1 <= len(files) < 4
    assert sum(file.stat().st_size for file in files) <= 50_000


def test_without_an_environment_the_error_says_what_fetches_it(video: Path):
    refused("`harmolab data pose --install` fetches it", read_pose, video)


# The environment


def made(folder: Path) -> Path:
    return pose.make_pose_environment(pip=pip(folder))


def test_it_lies_in_the_cache_by_version_and_python_of_pinned_wheels_and_is_fetched_once(tmp_path: Path, cache: Path):
    folder = made(tmp_path)
    assert folder == cache / f"pose_mediapipe_0.10.21_{sys.implementation.cache_tag}"
    assert pose.pose_environment() == folder
    assert [path.name for path in cache.iterdir() if path.is_dir()] == [folder.name]
    (cache / "mode").write_text("fails")
    made(tmp_path)
    (call,) = (cache / "calls").read_text().splitlines()
    assert "install --no-deps --only-binary :all: --quiet" in call
    assert "mediapipe==0.10.21 numpy>=1.26,<2" in call


@cases(
    "mode, words",
    ("fails", "could not be fetched.*ERROR: No matching distribution found for mediapipe==0.10.21"),
    ("broken", "ended early.*ImportError: GLIBC is too old"),
)
def test_a_failure_leaves_nothing_and_says_why(tmp_path: Path, cache: Path, mode: str, words: str):
    (cache / "mode").write_text(mode)
    refused(words, made, tmp_path)
    assert pose.pose_environment() is None
    assert not [path for path in cache.iterdir() if path.is_dir()]


def making(folder: Path) -> subprocess.Popen[bytes]:
    """Another process that makes the pose."""
    code = f"from harmolab.readers import pose as e; print(e.make_pose_environment(pip={pip(folder)!r}))"
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, start_new_session=True)


def test_killed_in_the_middle_leaves_nothing_and_the_next_cleans_up(tmp_path: Path, cache: Path):
    (cache / "mode").write_text("slow")
    process = making(tmp_path)
    end = time.monotonic() + 60
    while not (cache / "calls").exists() and time.monotonic() < end:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    assert pose.pose_environment() is None
    assert len(list(cache.glob(f"{UNFINISHED}*"))) == 1
    (cache / "mode").unlink()
    assert made(tmp_path) == pose.pose_environment()
    assert not list(cache.glob(f"{UNFINISHED}*"))


def test_several_at_once_make_one(tmp_path: Path, cache: Path):
    command = pip(tmp_path)
    with ThreadPoolExecutor(4) as pool:
        folders = set(pool.map(lambda _: pose.make_pose_environment(pip=command), range(4)))
    assert folders == {pose.pose_environment()}
    assert len((cache / "calls").read_text().splitlines()) == 1


def test_where_it_cannot_be_or_is_turned_off_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made(tmp_path)
    for name in ("HARMOLAB_POSE", "HARMOLAB_CACHE"):
        monkeypatch.setenv("HARMOLAB_POSE", "on")
        monkeypatch.setenv(name, "off")
        assert pose.pose_environment() is None
    refused("HARMOLAB_CACHE is off", pose.make_pose_environment)
    monkeypatch.setattr(pose.sys, "version_info", (3, 13, 0))
    refused(r"MediaPipe 0\.10\.21 runs in Python 3\.9 to 3\.12, and this is 3\.13", pose.make_pose_environment)


# The command


@pytest.fixture
def installs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders that commands made, by the stand-in of pip."""
    done, original = [], pose.make_pose_environment

    def make(**_: Sequence[str]) -> Path:
        done.append(original(pip=pip(tmp_path)))
        return done[-1]

    monkeypatch.setattr(pose, "make_pose_environment", make)
    return done


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody sits before the screen."""
    monkeypatch.setattr(data, "_is_terminal", lambda: True)


def run(*arguments: object, answer: str = "") -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=answer)


def test_without_a_terminal_nothing_is_fetched_and_a_line_says_how_and_what_would_be_surer(installs, video: Path):
    result = run("data", "pose", "--install")
    assert result.exit_code == 2 and not installs
    assert "about 55 MB, 155 MB on disk, in " in result.stderr
    assert "To agree: harmolab data pose --install --yes" in result.stderr
    (line,) = offered(video).splitlines()
    assert line.endswith("surer to read the dancer's body: `harmolab data pose --install` fetches what finds it, once")
    assert not installs


def test_yes_fetches_without_a_question(installs: list[Path], cache: Path):
    result = run("data", "pose", "--install", "--yes")
    assert result.exit_code == 0 and len(installs) == 1
    assert f"MediaPipe lies in {installs[0]}" in result.stderr
    assert "is there already" in run("data", "pose", "--install").stdout
    shutil.rmtree(installs[0])
    assert pose.pose_environment() is None  # who deletes the folder has removed it


@cases("answer, count", ("y\n", 1), ("n\n", 0), ("\n", 0))
def test_on_a_terminal_a_question_is_asked(installs: list[Path], terminal: None, answer: str, count: int):
    result = run("data", "pose", "--install", answer=answer)
    assert "Fetch it now? (With no, the flow of the picture is used.) [y/N]" in result.stderr
    assert "After that no network is needed." in result.stderr
    assert len(installs) == count
    assert ("nothing was fetched" in result.stderr) == (count == 0)


def offered(video: Path) -> str:
    """What the offer to read this video by its body prints."""
    with redirect_stderr(StringIO()) as stream:
        data.offer_poses(video)
    return stream.getvalue()


@pytest.mark.usefixtures("terminal")
def test_other_commands_ask_once_and_take_the_flow_after_a_no(installs, video: Path, monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []
    monkeypatch.setattr(data.typer, "confirm", lambda text, **_: asked.append(text))
    for _ in range(2):
        assert "take.mp4 is read by the flow of its picture" in offered(video)
    assert len(asked) == 1 and not installs
    monkeypatch.setattr(pose, "hindrance", lambda: "this is Python 3.13")
    assert offered(video) == "", "where it cannot be made nobody is asked"


def test_playing_a_video_without_it_says_what_fetches_it(installs: list[Path], video: Path, tmp_path: Path):
    (song := tmp_path / "song.wav").touch()
    for files in ([video], [song, video]):
        fault = complaint(app, "play", *files, "--out", tmp_path / "x.html")
        assert "nothing here finds its body for the page; `harmolab data pose --install` fetches what does" in fault
        assert f"`harmolab score {' '.join(map(str, files))} --why " in fault


@cases(
    "arguments, words",
    ((), "pose takes a VIDEO or --install"),
    (("nothing.mp4", "--yes"), "nothing.mp4: no such file"),
    (("dance.bvh", "--yes"), "dance.bvh: is no video by its name; `harmolab data convert` reads files of movement"),
    (("take.mp4", "--out", "x.gif", "--yes"), "x.gif: a motion is written as .npz, .bvh"),
    (("text.mp4", "--yes"), "text.mp4: cannot be read as video"),
)
def test_mistakes_are_told_before_anything_is_fetched(installs, video: Path, monkeypatch, arguments, words: str):
    monkeypatch.chdir(video.parent)
    (video.parent / "dance.bvh").write_text("HIERARCHY")
    (video.parent / "text.mp4").write_text("no video")
    result = run("data", "pose", *arguments)
    assert result.exit_code == 2 and not installs and words in result.stderr


# The real thing


@pytest.fixture(scope="module")
def mediapipe() -> Path:
    """The folder of an environment that somebody made on this machine; none is fetched for a test."""
    named = os.environ.get("HARMOLAB_TEST_POSE")
    if named is None:
        pytest.skip("no MediaPipe: HARMOLAB_TEST_POSE names the folder that `harmolab data pose --install` makes")
    return Path(named)


@pytest.mark.slow
@cases("phone", phone_videos.Phone(noise=6, shake=1.5, crf=35), phone_videos.Phone(people=2))
def test_the_movement_of_a_filmed_dancer_is_read_in_time(mediapipe: Path, tmp_path: Path, phone: phone_videos.Phone):
    pose.pose_folder().symlink_to(mediapipe)
    motion, _, _ = phone_videos.filmed_part(planted_dance(seconds=12.0), seconds=8.0)
    read = filmed_motion(phone_videos.film(tmp_path / "take.mp4", motion, None, phone)).motion
    correlation, shift = phone_videos.agreement(motion, read)
    assert correlation > 0.7
    assert abs(shift) <= 0.02


@pytest.mark.data
def test_nobody_is_found_in_drawn_figures_and_a_dancer_is_in_every_picture(mediapipe: Path, data_root: Path):
    pose.pose_folder().symlink_to(mediapipe)
    refused("nobody is found in the picture", read_pose, data_root / "extra" / "video" / "gendance_case1.mp4")
    assert read_pose(data_root / "extra" / "video" / "d2mgan_motivation_gt.mp4").motion.valid.all()


def test_the_module_of_the_process_needs_nothing_of_ours():
    source = Path(str(importlib.util.find_spec("harmolab.readers.pose_child").origin)).read_text()
    assert "harmolab import" not in source and "import harmolab" not in source
