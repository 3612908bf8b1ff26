"""A folder or a video alone in place of a song and a dance; folders of recordings; the demo; moving pictures."""

import csv
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import av
import numpy as np
import pytest

from harmolab.cli import app
from harmolab.data.synthetic import synthetic_motion, write_corpus
from harmolab.lab.explain.filmed import FilmedMotion
from harmolab.lab.explain.performance import Performance
from harmolab.readers.motion import save_motion
from harmolab.readers.video import write_gif, write_video
from harmolab.types import Motion
from tests.builders import called, planted_dance, refused, write_dance, write_song

run = partial(called, app)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of 20 s, and one whose movement is damaged."""
    folder = write_corpus(tmp_path_factory.mktemp("corpus") / "synth", clips=3, seconds=20.0, fps=30.0)
    (sorted(folder.glob("clip_*"))[2] / "motion.npz").write_bytes(b"damaged")
    return folder


@pytest.fixture(scope="module")
def recording(corpus: Path) -> Path:
    return sorted(corpus.glob("clip_*"))[0]


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball that comes to rest on each beat of a synthetic song of 12 s, with that song."""
    clip, path = planted_dance(seconds=12.0), tmp_path_factory.mktemp("video") / "take.mp4"
    steps = np.interp(np.arange(12 * 20) / 20, clip.beats.times, np.arange(len(clip.beats)))
    share = steps % 1
    way = 20 + 80 * np.abs((np.floor(steps) + share**2 * (3 - 2 * share)) % 2 - 1)
    rows, columns = np.mgrid[:96, :128]
    frames = (np.where(np.hypot(rows - 48, columns - x) < 14, 220, 40).astype(np.uint8) for x in way)
    write_video(path, frames, 20.0, audio=clip.audio)
    return path


def test_a_folder_alone_goes_to_every_command(recording: Path, tmp_path: Path) -> None:
    for words in (
        ("score",),
        ("explain",),
        ("play", "--out", tmp_path / "x.html"),
        ("render", "--seconds", 1, "--height", 120, "--out", tmp_path / "x.mp4"),
        ("retime", "--out", tmp_path / "x.npz"),
    ):
        result = run(words[0], recording, *words[1:])
        assert result.exit_code == 0, result.output


def test_a_folder_with_one_song_and_one_motion_needs_no_layout(tmp_path: Path) -> None:
    clip = planted_dance(seconds=20.0)
    write_song(tmp_path / "my song.wav", clip)
    write_dance(tmp_path / "my dance.npz", clip)
    assert json.loads(run("score", tmp_path, "--json").stdout)["clip"]["motion"].endswith("my dance.npz")
    write_dance(tmp_path / "another.npz", clip)
    assert "has no motion.npz" in run("score", tmp_path).stderr


def test_a_video_alone_is_scored_as_it_is_explained(video: Path) -> None:
    scored = json.loads(run("score", video, "--json").stdout)
    explained = json.loads(run("explain", video, "--json").stdout)
    assert scored["clip"]["offset"] == 0.0
    for name in ("level", "verdict", "harmony_above_chance", "p_value"):
        assert scored["recommended"][name] == pytest.approx(explained[name], abs=1e-9)


def test_a_video_alone_is_rendered_with_marks_and_retimed(video: Path, tmp_path: Path) -> None:
    for command in ("render", "retime"):
        out = tmp_path / f"{command}.mp4"
        result = run(command, video, "--out", out)
        assert result.exit_code == 0, result.output
        with av.open(str(out)) as container:
            assert container.streams.video and container.streams.audio


def test_a_video_has_no_body_to_play(video: Path, tmp_path: Path) -> None:
    message = run("play", video, "--out", tmp_path / "x.html").stderr
    assert "of which no body is known" in message and "harmolab explain" in message


def test_options_of_motion_files_are_none_of_a_video(video: Path) -> None:
    assert "--scale is for motion files" in run("score", video, "--scale", 2).stderr


@pytest.mark.parametrize("command", ["score", "explain", "play", "render", "retime"])
def test_a_song_alone_is_told_what_is_missing(command: str, tmp_path: Path) -> None:
    write_song(tmp_path / "song.wav", planted_dance())
    out = () if command in ("score", "explain") else ("--out", tmp_path / ("x.html" if command == "play" else "x.mp4"))
    result = run(command, tmp_path / "song.wav", *out)
    assert result.exit_code == 2
    assert f"{command} takes SONG DANCE; the folder of one recording, or a video" in result.stderr


@pytest.mark.parametrize("command", ["score", "explain", "retime"])
def test_an_unknown_dance_is_refused_before_a_file_is_read(command: str, tmp_path: Path) -> None:
    for name in ("song.wav", "take.mp4"):
        (tmp_path / name).write_text("no media file")
    out = () if command != "retime" else ("--out", tmp_path / "x.mp4")
    result = run(command, tmp_path / "song.wav", tmp_path / "take.mp4", "--dance", "chacha", *out)
    assert "unknown dance 'chacha'; did you mean 'cha-cha'?" in result.stderr


def test_an_unknown_dance_is_refused_beside_annotated_beats_too(recording: Path) -> None:
    assert "did you mean 'waltz'?" in run("score", recording, "--dance", "walz").stderr


def test_a_dance_longer_than_its_song_is_said(tmp_path: Path) -> None:
    clip = planted_dance(seconds=20.0)
    song = write_song(tmp_path / "song.wav", clip)
    save_motion(tmp_path / "long.npz", Motion(np.tile(clip.motion.positions, (2, 1, 1)), 60.0, clip.motion.skeleton))
    result = run("score", song, tmp_path / "long.npz")
    assert "song.wav ends 20.0 s before the dance does: only its first 20.0 s have music" in result.stderr


# A folder of recordings


def test_a_folder_of_recordings_is_a_table_and_a_fault_is_a_row(corpus: Path, recording: Path, tmp_path: Path) -> None:
    out = tmp_path / "table.csv"
    result = run("score", corpus, "--csv", out)
    assert result.exit_code == 1
    assert "1 of 3 recordings could not be scored" in result.stderr
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [bool(row["error"]) for row in rows] == [False, False, True]
    alone = json.loads(run("score", recording, "--json").stdout)
    assert float(rows[0]["harmony_above_chance"]) == alone["recommended"]["harmony_above_chance"]
    assert float(rows[0]["paper_hit_rate"]) == alone["paper"]["hit_rate"]
    assert rows[0]["verdict"] == alone["recommended"]["verdict"]
    assert "motion.npz: cannot be read" in rows[2]["error"]
    assert run("score", corpus, "--csv", out).exit_code == 1, "a table of ours is written over"
    out.write_text("precious")
    assert "not of harmolab" in run("score", corpus, "--csv", out).stderr


def test_options_of_one_recording_are_none_of_many(corpus: Path, recording: Path) -> None:
    assert "--offset is for one recording" in run("score", corpus, "--offset", 1).stderr
    assert "--csv is for a folder of recordings" in run("score", recording, "--csv", "x.csv").stderr


# Moving pictures


def test_a_gif_repeats_has_few_colours_and_is_known_as_ours(tmp_path: Path, recording: Path) -> None:
    out = tmp_path / "x.gif"
    result = run("render", recording, "--start", 2, "--seconds", 1, "--height", 120, "--out", out)
    assert result.exit_code == 0, result.output
    with av.open(str(out)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 13 and frames[0].shape == (120, 160, 3)
    assert len(np.unique(frames[0].reshape(-1, 3), axis=0)) <= 64
    assert run("render", recording, "--seconds", 1, "--height", 120, "--out", out).exit_code == 0


def test_a_gif_needs_frames_of_one_size(tmp_path: Path) -> None:
    frame = np.zeros((32, 32, 3), np.uint8)
    refused("at least one frame", write_gif, tmp_path / "x.gif", [], 10.0)
    refused("frame 1 has shape", write_gif, tmp_path / "x.gif", [frame, frame[:20]], 10.0)
    assert not list(tmp_path.iterdir())


def test_a_video_is_no_gif(video: Path, tmp_path: Path) -> None:
    assert "more colours than a gif" in run("render", video, "--out", tmp_path / "x.gif").stderr


# Demo


def test_the_demo_shows_one_dancer_in_time_and_one_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    out = tmp_path / "demo.html"
    result = run("demo", "--out", out)
    assert result.exit_code == 0, result.output
    assert "You are on the beat" in result.stdout and "late for a rest on the beat" in result.stdout
    assert result.stdout.count("  harmolab ") == 2
    assert opened == [out.as_uri()]
    page = out.read_text()
    assert "The song is synthetic" in page and "mocap.cs.cmu.edu" in page
    assert run("demo", "--out", out, "--no-open").exit_code == 0 and len(opened) == 1


def test_the_demo_writes_over_no_file_of_others(tmp_path: Path) -> None:
    (tmp_path / "x.html").write_text("precious")
    assert "not of harmolab" in run("demo", "--out", tmp_path / "x.html").stderr


def test_a_folder_keeps_its_beats_file(tmp_path: Path) -> None:
    clip = planted_dance(seconds=20.0)
    write_song(tmp_path / "song.wav", clip)
    write_dance(tmp_path / "dance.npz", clip)
    (tmp_path / "song.beats").write_text("".join(f"{time:.4f}\n" for time in clip.beats.times))
    assert json.loads(run("score", tmp_path, "--json").stdout)["clip"]["beats"].endswith("song.beats")


def test_a_body_that_was_followed_poorly_is_told_no_sign_by_no_command(
    video: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = synthetic_motion(np.sort(np.random.default_rng(3).uniform(0, 12, 24)), seconds=12.0, fps=30.0, seed=1)
    growing = 1 + 0.2 * np.where(np.arange(lost.n_frames) // 30 % 2, 1.0, -1.0)[:, None, None]
    loose = replace(lost, positions=growing * lost.positions)
    monkeypatch.setattr("harmolab.cli.playing.is_body_found", lambda path: True)
    monkeypatch.setattr("harmolab.cli.sources.video_performance", lambda path: Performance(path, loose, True))
    monkeypatch.setattr("harmolab.lab.render.video.filmed_motion", lambda path, **_: FilmedMotion(loose))
    outs = {"score": (), "play": ("--out", tmp_path / "x.html"), "retime": ("--out", tmp_path / "x.mp4")}
    for command, out in outs.items():
        said = run(command, video, *out).output
        assert "limbs of the body that was found change their length by 20%" in said.replace("\n", " "), command
        assert "No sign that you follow" not in said.partition("after: ")[0], command
    assert not (tmp_path / "x.html").exists()
