"""The environment of pose estimation: whole or not at all, by one process at a time, and never unasked."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from harmolab.cli import app, posing
from harmolab.files import UNFINISHED
from harmolab.lab.explain.filmed import filmed_motion
from harmolab.readers import pose as environment
from harmolab.readers.pose import read_pose
from harmolab.readers.video import write_video
from tests.builders import called, cases, planted_dance, refused
from tests.phone_videos import CASES, agreement, film, filmed_part
from tests.pose_stand_ins import pip
from tests.test_pose import waves


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HARMOLAB_POSE", "on")
    (tmp_path / "cache").mkdir()
    return tmp_path / "cache"


@pytest.fixture
def video(tmp_path: Path) -> Path:
    frames = (frame for frame in waves(1.0, seconds=2.0).astype("uint8")[:, None, None, None] + 0 * blank())
    write_video(tmp_path / "take.mp4", frames, 20.0)
    return tmp_path / "take.mp4"


def blank() -> Any:
    import numpy as np

    return np.zeros((1, 64, 96, 3), np.uint8)


def made(folder: Path) -> Path:
    return environment.make_pose_environment(pip=pip(folder))


def test_it_is_named_with_version_and_python_and_lies_in_the_cache(tmp_path: Path, cache: Path):
    folder = made(tmp_path)
    assert folder == cache / f"pose_mediapipe_0.10.21_{sys.implementation.cache_tag}"
    assert environment.pose_environment() == folder
    assert [path.name for path in cache.iterdir() if path.is_dir()] == [folder.name]


def test_its_packages_are_pinned_whole_wheels_without_more(tmp_path: Path, cache: Path):
    made(tmp_path)
    (call,) = (cache / "calls").read_text().splitlines()
    assert "install --no-deps --only-binary :all: --quiet" in call
    assert "mediapipe==0.10.21 numpy>=1.26,<2" in call


def test_one_that_is_there_is_not_fetched_again(tmp_path: Path, cache: Path):
    made(tmp_path)
    (cache / "mode").write_text("fails")
    made(tmp_path)
    assert len((cache / "calls").read_text().splitlines()) == 1


@cases(
    "mode, words",
    ("fails", "could not be fetched.*ERROR: No matching distribution found for mediapipe==0.10.21"),
    ("broken", "ended early.*ImportError: GLIBC is too old"),
)
def test_a_failure_leaves_nothing_and_says_why(tmp_path: Path, cache: Path, mode: str, words: str):
    (cache / "mode").write_text(mode)
    refused(words, made, tmp_path)
    assert environment.pose_environment() is None
    assert not [path for path in cache.iterdir() if path.is_dir()]


def making(folder: Path) -> subprocess.Popen[bytes]:
    """Another process that makes the environment."""
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
    assert environment.pose_environment() is None
    assert len(list(cache.glob(f"{UNFINISHED}*"))) == 1
    (cache / "mode").unlink()
    assert made(tmp_path) == environment.pose_environment()
    assert not list(cache.glob(f"{UNFINISHED}*"))


def test_several_at_once_make_one(tmp_path: Path, cache: Path):
    command = pip(tmp_path)
    with ThreadPoolExecutor(4) as pool:
        folders = set(pool.map(lambda _: environment.make_pose_environment(pip=command), range(4)))
    assert folders == {environment.pose_environment()}
    assert len((cache / "calls").read_text().splitlines()) == 1


def test_a_python_without_wheels_is_told_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(environment.sys, "version_info", (3, 13, 0))
    refused(r"MediaPipe 0\.10\.21 runs in Python 3\.9 to 3\.12, and this is 3\.13", environment.make_pose_environment)


def test_without_a_cache_there_is_no_place(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_CACHE", "off")
    assert environment.pose_environment() is None
    refused("HARMOLAB_CACHE is off", environment.make_pose_environment)


def test_the_switch_turns_one_off_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made(tmp_path)
    monkeypatch.setenv("HARMOLAB_POSE", "off")
    assert environment.pose_environment() is None


# The command


@pytest.fixture
def installs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders that commands made, by the stand-in of pip."""
    done: list[Path] = []

    def make(**_: Sequence[str]) -> Path:
        done.append(original(pip=pip(tmp_path)))
        return done[-1]

    original = environment.make_pose_environment
    monkeypatch.setattr(environment, "make_pose_environment", make)
    return done


def run(*arguments: object, answer: str = "") -> Result:
    from typer.testing import CliRunner

    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=answer)


def test_without_a_terminal_nothing_is_fetched_and_the_line_says_how(installs: list[Path]):
    result = run("pose", "--install")
    assert result.exit_code == 2 and not installs
    assert "about 55 MB, 155 MB on disk, in " in result.stderr
    assert "To agree: harmolab pose --install --yes" in result.stderr


def test_yes_fetches_without_a_question(installs: list[Path], cache: Path):
    result = run("pose", "--install", "--yes")
    assert result.exit_code == 0 and len(installs) == 1
    assert f"MediaPipe lies in {installs[0]}" in result.stderr
    assert "is there already" in run("pose", "--install").stdout
    assert run("pose", "--remove").stdout == "removed\n"
    assert environment.pose_environment() is None
    assert run("pose", "--remove").stdout == "there is nothing to remove\n"


@pytest.mark.parametrize(("answer", "count"), [("y\n", 1), ("n\n", 0), ("\n", 0)])
def test_on_a_terminal_a_question_is_asked(
    installs: list[Path], monkeypatch: pytest.MonkeyPatch, answer: str, count: int
):
    monkeypatch.setattr(posing, "_is_terminal", lambda: True)
    result = run("pose", "--install", answer=answer)
    assert "Fetch it now? (With no, the flow of the picture is used.) [y/N]" in result.stderr
    assert "After that no network is needed." in result.stderr
    assert len(installs) == count
    assert ("nothing was fetched" in result.stderr) == (count == 0)


def test_other_commands_ask_once_and_take_the_flow_after_a_no(
    installs: list[Path], video: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(posing, "_is_terminal", lambda: True)
    asked: list[str] = []
    monkeypatch.setattr(posing.typer, "confirm", lambda text, **_: asked.append(text))
    for _ in range(2):
        posing.offer_poses(video)
        assert "take.mp4 is read by the flow of its picture" in capsys.readouterr().err
    assert len(asked) == 1 and not installs


def test_without_a_terminal_one_line_says_what_would_be_surer(
    installs: list[Path], video: Path, capsys: pytest.CaptureFixture[str]
):
    posing.offer_poses(video)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("its dancer's body would be surer: `harmolab pose --install` fetches what finds it, once")
    assert not installs


def test_where_it_cannot_be_made_nobody_is_asked(
    installs: list[Path], video: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(posing, "_is_terminal", lambda: True)
    monkeypatch.setattr(environment, "hindrance", lambda: "this is Python 3.13")
    posing.offer_poses(video)
    assert capsys.readouterr().err == ""


def test_playing_a_video_without_it_says_what_fetches_it(installs: list[Path], video: Path, tmp_path: Path):
    result = called(app, "play", video, "--out", tmp_path / "x.html")
    assert result.exit_code == 2
    assert "of which no body is known to play; `harmolab pose --install` fetches what finds it" in result.stderr


@cases(
    "arguments, words",
    ((), "pose takes a VIDEO, --install or --remove"),
    (("nothing.mp4",), "nothing.mp4: no such file"),
    (("dance.bvh",), "dance.bvh: is no video by its name; `harmolab convert` reads files of movement"),
    (("take.mp4", "--out", "x.gif"), "x.gif: a motion is written as .npz, .bvh"),
    (("text.mp4",), "text.mp4: cannot be read as video"),
)
def test_mistakes_are_told_before_anything_is_fetched(
    installs: list[Path], video: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
):
    monkeypatch.chdir(video.parent)
    (video.parent / "dance.bvh").write_text("HIERARCHY")
    (video.parent / "text.mp4").write_text("no video")
    result = run("pose", *arguments, "--yes") if arguments else run("pose")
    assert result.exit_code == 2 and not installs
    assert words in result.stderr


# The real thing


@pytest.fixture(scope="module")
def mediapipe() -> Path:
    """The folder of an environment that somebody made on this machine; none is fetched for a test."""
    named = os.environ.get("HARMOLAB_TEST_POSE")
    if named is None:
        pytest.skip("no MediaPipe: HARMOLAB_TEST_POSE names the folder of an environment, of `harmolab pose --install`")
    return Path(named)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["worst", "two people"])
def test_the_movement_of_a_filmed_dancer_is_read_in_time(
    mediapipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
):
    environment.pose_folder().symlink_to(mediapipe)
    motion, _, _ = filmed_part(planted_dance(seconds=12.0), seconds=8.0)
    read = filmed_motion(film(tmp_path / "take.mp4", motion, None, CASES[case])).motion
    correlation, shift = agreement(motion, read)
    assert correlation > 0.7
    assert abs(shift) <= 0.02


@pytest.mark.data
def test_nobody_is_found_in_drawn_figures_and_a_dancer_is_in_every_picture(mediapipe: Path, data_root: Path):
    environment.pose_folder().symlink_to(mediapipe)
    refused("nobody is found in the picture", read_pose, data_root / "extra" / "video" / "gendance_case1.mp4")
    assert read_pose(data_root / "extra" / "video" / "d2mgan_motivation_gt.mp4").motion.valid.all()


def test_the_module_of_the_process_needs_nothing_of_ours():
    spec = importlib.util.find_spec("harmolab.readers.pose_child")
    assert spec is not None and spec.origin is not None
    assert (
        "harmolab import" not in Path(spec.origin).read_text()
        and "import harmolab" not in Path(spec.origin).read_text()
    )
