"""`harmolab retime`: files that are in time, a small table, one line for what cannot be done."""

import re
from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
import typer
from typer.testing import CliRunner, Result

from harmolab.beats.visual import visual_beats
from harmolab.cli.retiming import retime
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.lab.explain.offset import picture_motion
from harmolab.lab.render.stick import render_skeleton
from harmolab.params import HarmonyParams
from harmolab.readers.motion import load_motion
from harmolab.readers.video import video_frames, write_video
from harmolab.score import score_harmony
from harmolab.types import Clip
from tests.builders import cases, write_dance, write_song

app = typer.Typer()
app.command()(retime)


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_clip(ClipSettings("rumba", seconds=10.0, jitter=0.15, seed=3)).clip


@pytest.fixture(scope="module")
def song(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_song(tmp_path_factory.mktemp("music") / "song.wav", clip)


@pytest.fixture(scope="module")
def dance(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dance(tmp_path_factory.mktemp("motion") / "dance.npz", clip)


def call(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "120"})


def row(result: Result, name: str) -> list[str]:
    """The cells of a row of the printed table."""
    line = next(line for line in result.output.splitlines() if name in line)
    return [cell.strip() for cell in line.strip("│ ").split("│")][1:]


def test_a_jittered_dance_is_mended_and_the_table_says_how(tmp_path: Path):
    clip = planted_clip(ClipSettings("rumba", seconds=24.0, jitter=0.15, seed=3)).clip
    song, dance = write_song(tmp_path / "song.wav", clip), write_dance(tmp_path / "dance.npz", clip)
    result = call(song, dance, "--out", tmp_path / "x.npz")
    assert result.exit_code == 0, result.output
    said = [line for line in result.output.splitlines() if line.startswith(("before: ", "after: "))]
    numbers = [re.match(r"(\w+): You are on the beat: slow on it.* above chance ([\d.]+) ", line) for line in said]
    assert [match[1] for match in numbers] == ["before", "after"]
    before, after = (float(match[2]) for match in numbers)
    assert after > before + 0.1
    fewer, more = map(float, row(result, "beats with a rest near"))
    assert more > fewer + 0.3
    assert 10 < float(row(result, "mean, ms")[1]) < float(row(result, "largest, ms")[1]) < 500
    low, high = map(float, row(result, "local speed")[1].split(" to "))
    assert 0.7 <= low < 1 < high <= 1.4
    assert load_motion(tmp_path / "x.npz").n_frames == load_motion(dance).n_frames
    assert f"wrote {tmp_path / 'x.npz'}" in result.output.replace("\n", "")


def test_no_strength_writes_the_same_motion(dance: Path, song: Path, tmp_path: Path):
    assert "Nothing was worth bending." in call(song, dance, "--out", tmp_path / "x.npz", "--strength", 0).output
    np.testing.assert_array_equal(load_motion(tmp_path / "x.npz").positions, load_motion(dance).positions)


def test_the_warper_of_2019_can_be_asked_for(dance: Path, song: Path, tmp_path: Path):
    result = call(song, dance, "--out", tmp_path / "x.npz", "--method", "lee2019")
    low, high = map(float, row(result, "local speed")[1].split(" to "))
    assert low < 0.7 or high > 1.4


@pytest.mark.parametrize("suffix", [".mp4", pytest.param(".webm", marks=pytest.mark.slow)])
def test_a_film_has_pictures_and_the_song_from_the_offset_on(dance: Path, song: Path, tmp_path: Path, suffix: str):
    film = tmp_path / f"x{suffix}"
    result = call(song, dance, "--out", film, "--offset", -0.5)
    assert result.exit_code == 0, result.output
    with av.open(str(film)) as container:
        assert {stream.type for stream in container.streams} == {"video", "audio"}
        assert sum(1 for _ in container.decode(video=0)) == 300
    with av.open(str(film)) as container:
        sound = np.concatenate([block.to_ndarray()[0] for block in container.decode(audio=0)])
    assert np.abs(sound[: int(0.45 * 48_000)]).max() < 1e-3 < np.abs(sound[int(0.5 * 48_000) :]).max()


@pytest.mark.slow  # twelve seconds of film, drawn, retimed and read
def test_in_a_retimed_video_the_dancer_rests_on_the_beats(tmp_path: Path):
    clip = planted_clip(ClipSettings("waltz", seconds=12.0, jitter=0.15, seed=1)).clip
    soundfile.write(tmp_path / "song.wav", clip.audio.samples, round(clip.audio.sample_rate))
    write_video(tmp_path / "in.mp4", render_skeleton(clip.motion, fps=30.0, height=160), 30.0)
    result = call(tmp_path / "song.wav", tmp_path / "in.mp4", "--out", tmp_path / "out.mp4", "--dance", "waltz")
    assert result.exit_code == 0, result.output
    scores = []
    for name in ("in.mp4", "out.mp4"):
        video = video_frames(tmp_path / name, height=160)
        rests = visual_beats(picture_motion(video, video.fps), params=HarmonyParams.valleys())
        scores.append(score_harmony(clip.beats, rests, params=HarmonyParams.valleys(), n_rotations=0))
    assert scores[0].harmony_above_chance < 0.45
    assert scores[1].harmony_above_chance > 0.65


def test_a_video_is_retimed_with_its_song(song: Path, tmp_path: Path):
    frames = []
    for place in 24 + 16 * np.cos(np.pi * np.arange(150) / 30):  # a square that turns round every second
        picture = np.full((64, 64, 3), 30, np.uint8)
        picture[24:40, round(place) : round(place) + 16] = (250, 200, 0)
        frames.append(picture)
    write_video(tmp_path / "in.mp4", frames, 30.0)
    result = call(song, tmp_path / "in.mp4", "--out", tmp_path / "out.mp4")
    assert result.exit_code == 0, result.output
    with av.open(str(tmp_path / "out.mp4")) as container:
        assert container.streams.video[0].frames == 150
        assert len(container.streams.audio) == 1


@cases(
    "arguments, message",
    (["--out", "x.wav"], "written as .npz, .bvh, .mp4"),
    (["--out", "nowhere/x.npz"], "no such folder"),
    (["--out", "x.npz", "--strength", "2"], "strength must lie between 0 and 1"),
    (["--out", "x.npz", "--slowest", "0"], "slowest must lie above 0"),
    (["--out", "x.npz", "--offset", "99"], "does not overlap audio"),
    (["--out", "x.npz", "--offset", "nan"], "offset must be finite"),
)
def test_what_cannot_be_done_is_one_line(
    dance: Path, song: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
):
    monkeypatch.chdir(tmp_path)
    result = call(song, dance, *arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_no_motion_or_no_video_are_named(song: Path, tmp_path: Path):
    for name in ("x.npz", "x.mp4", "x.bvh"):
        (tmp_path / name).write_bytes(b"not this")
        result = call(song, tmp_path / name, "--out", tmp_path / "out.mp4")
        assert result.exit_code == 2
        assert name in result.output
        assert not (tmp_path / "out.mp4").exists()


def test_only_the_joints_that_are_named_are_retimed(song: Path, dance: Path, tmp_path: Path):
    result = call(song, dance, "--joints", "hand L,finger R,torso,toe L,toe R", "--out", tmp_path / "x.npz")
    assert result.exit_code == 0, result.output
    assert load_motion(tmp_path / "x.npz").skeleton.joints == ("hand L", "finger R", "torso", "toe L", "toe R")
