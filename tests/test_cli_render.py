"""`harmolab play` and `harmolab retime`: the right frames and sound, files that are in time, one line for faults."""

import re
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import av
import numpy as np
import pytest
from typer.testing import Result

from harmolab.beats.visual import visual_beats
from harmolab.cli import app, screen
from harmolab.clips import load_clip
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.explain.offset import picture_motion
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import render_skeleton
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.readers.motion import load_motion, save_motion
from harmolab.readers.video import video_frames, write_video
from harmolab.score import score_harmony
from harmolab.types import Clip, Motion
from harmolab.verdict.judge import score_clip
from tests.builders import cases, complaint, done, planted_dance, write_late_pictures, write_pair, write_song

render, retime = (partial(done, app, command) for command in ("play", "retime"))


@pytest.fixture
def files(planted_clip: Clip, tmp_path: Path) -> tuple[Path, Path]:
    """Song and motion of a synthetic cha-cha."""
    return write_pair(tmp_path, planted_clip)[:2]


def frames(path: Path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_video_has_the_length_size_and_sound_asked_for(
    files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    out = tmp_path / "x.mp4"
    monkeypatch.setattr(screen, "EVERY", 0.01)
    assert " of 60 (" in render(*files, "--seconds", 2, "--height", 240, "--out", out).stderr
    assert frames(out).shape == (60, 240, 320, 3)
    with av.open(str(out)) as container:
        sound = container.streams.audio[0]
        assert float(sound.duration * sound.time_base) == pytest.approx(2.0, abs=0.1)


def test_verdict_and_number_are_printed_with_marks_only(tmp_path: Path):
    song, dance = write_pair(tmp_path, planted_dance(seconds=16.0, fps=30.0))[:2]
    small = (song, dance, "--offset", 0, "--height", 120, "--rate", 10, "--out", tmp_path / "x.mp4")
    score = score_clip(load_clip(song, dance, offset=0.0))
    text = render(*small).stdout
    assert text.startswith(score.judgement.verdict)
    assert f"harmony above chance {score.harmony_above_chance:.2f} (0 is luck, 1 the most)" in text
    assert "chance" not in render(*small, "--seconds", 1, "--no-marks").stdout


def test_a_clip_to_share_has_the_verdict_on_the_whole_dance_in_its_picture(tmp_path: Path):
    song, dance = write_pair(tmp_path, planted_dance(seconds=16.0, fps=30.0))[:2]
    verdict = score_clip(load_clip(song, dance)).judgement.verdict
    small = ("--height", 120, "--rate", 10, "--seconds", 2, "--out")
    assert render(song, dance, *small, tmp_path / "x.mp4").stdout.startswith(verdict)
    assert render(song, dance, "--start", 4, "--no-verdict", *small, tmp_path / "y.mp4").stdout.startswith(verdict)
    banded, bare = (frames(tmp_path / name)[:, -24:, :, 0] for name in ("x.mp4", "y.mp4"))
    assert len(banded) == len(bare) == 20
    assert banded[:, -4:, -20:].min() > 240 > bare[:, -4:, -20:].max()  # the band, and the floor
    assert (banded < 150).any(axis=(1, 2)).all()  # letters


def test_webm_has_the_free_codings(files: tuple[Path, Path], tmp_path: Path):
    render(*files, "--seconds", 1, "--height", 240, "--out", tmp_path / "x.webm")
    with av.open(str(tmp_path / "x.webm")) as container:
        assert [stream.codec_context.name for stream in container.streams] == ["vp9", "opus"]
    assert frames(tmp_path / "x.webm").shape == (30, 240, 320, 3)


@pytest.fixture
def take(planted_clip: Clip, tmp_path: Path) -> tuple[Path, Path]:
    """A grey video of 2 s at 25 fps with the song's sound, and the points of a dancer in it who walks to the right."""
    video, points = tmp_path / "take.mp4", tmp_path / "points.npy"
    write_video(video, [np.full((240, 320, 3), 90, np.uint8)] * 50, 25.0, audio=planted_clip.audio.span(0, 2))
    places = np.stack(np.broadcast_arrays(np.arange(100, 200, 2)[:, None], np.linspace(40, 200, 17)), axis=-1)
    np.save(points, places.astype(float))
    return video, points


def test_skeleton_goes_over_the_video_it_was_found_in(take: tuple[Path, Path], tmp_path: Path):
    video, points, out = *take, tmp_path / "x.mp4"
    render(video, points, "--fps", 25, "--over", video, "--no-marks", "--out", out)
    shown = frames(out)
    assert shown.shape == (50, 240, 320, 3)
    columns = [np.flatnonzero(picture[100, :, 0] > 180).mean() for picture in shown]
    np.testing.assert_allclose(columns, 100 + 2 * np.arange(50), atol=2)
    with av.open(str(out)) as container:
        sound = np.concatenate([block.to_ndarray()[0] for block in container.decode(audio=0)])
    assert np.abs(sound).max() > 0.05  # the video's own


@cases("words", (), ("--offset", 0.2))
def test_skeleton_goes_over_its_own_pictures_where_the_first_comes_after_the_sound(
    words: tuple[Any, ...], take: tuple[Path, Path], tmp_path: Path
):
    film, out = tmp_path / "late.mp4", tmp_path / "x.mp4"
    write_late_pictures(film, take[0], 0.2)
    render(film, take[1], "--fps", 25, "--over", film, "--no-marks", "--out", out, *words)
    shown = frames(out)
    assert not (shown[:5, 100] > 180).any()
    columns = [np.flatnonzero(picture[100, :, 0] > 180).mean() for picture in shown[5:]]
    np.testing.assert_allclose(columns, 100 + 2 * np.arange(50), atol=2)


@pytest.mark.slow
@cases(
    "has_sound, line",
    (True, "begin at 3.30 s of the song, by its sound"),
    (False, "Where in its beat you dance cannot"),
)
def test_points_over_their_film_begin_in_another_song_where_its_sound_says(has_sound: bool, line: str, tmp_path: Path):
    clip = planted_dance(seconds=20.0, fps=30.0)
    song, film, points = write_pair(tmp_path, clip)[0], tmp_path / "film.mp4", tmp_path / "points.npz"
    sound = clip.audio.span(3.3, 16.0) if has_sound else None
    write_video(film, [np.full((48, 64, 3), 90, np.uint8)] * 480, 30.0, audio=sound)
    save_motion(
        points, Motion(np.array([32, 40]) - 15 * clip.motion.positions[99:579, :, :2], 30.0, clip.motion.skeleton)
    )
    result = render(song, points, "--over", film, "--out", tmp_path / "x.mp4")
    assert line in " ".join(result.output.split())
    assert ("on the beat" in result.stdout) == has_sound


def test_points_without_their_video_are_drawn_as_a_person(take: tuple[Path, Path], tmp_path: Path):
    render(*take, "--fps", 25, "--height", 120, "--out", tmp_path / "x.mp4")
    assert (frames(tmp_path / "x.mp4").min(axis=3) < 150).any()


@cases("content, fault", (b"", "over.mp4: the file is empty"), (b"no video" * 99, "over.mp4: cannot be read as video"))
def test_unreadable_video_to_draw_over_is_one_line(content: bytes, fault: str, take: tuple[Path, Path], tmp_path: Path):
    (tmp_path / "over.mp4").write_bytes(content)
    words = (*take, "--fps", 25, "--over", tmp_path / "over.mp4", "--no-marks", "--out", tmp_path / "x.mp4")
    assert fault in complaint(app, "play", *words)
    assert not (tmp_path / "x.mp4").exists()


def test_the_video_to_draw_over_is_not_written_over_and_keeps_its_rate(take: tuple[Path, Path], tmp_path: Path):
    before, words = take[0].read_bytes(), ("play", *take, "--fps", 25, "--over", take[0], "--no-marks", "--out")
    assert "is an input here" in complaint(app, *words, take[0])
    assert take[0].read_bytes() == before
    assert "at its own frame rate; leave out --rate" in complaint(app, *words, tmp_path / "x.mp4", "--rate", 30)
    assert "leave out --rate and --follow" in complaint(app, *words, tmp_path / "x.mp4", "--follow")
    assert not (tmp_path / "x.mp4").exists()


@pytest.mark.browser
@pytest.mark.slow
def test_webm_plays_with_its_sound(files: tuple[Path, Path], tmp_path: Path, chromium: Any):
    render(*files, "--seconds", 2, "--height", 240, "--out", tmp_path / "x.webm")
    (tmp_path / "page.html").write_text('<video src="x.webm" autoplay></video>')
    page = chromium.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("document.querySelector('video').currentTime > 0.5")
    counts = "(({videoWidth, webkitAudioDecodedByteCount}) => [videoWidth, webkitAudioDecodedByteCount])"
    width, sound_bytes = page.evaluate(f"{counts}(document.querySelector('video'))")
    page.close()
    assert width == 320 and sound_bytes > 0


def test_marks_may_be_left_out(files: tuple[Path, Path], tmp_path: Path):
    shown = {}
    for option in ("--marks", "--no-marks"):
        render(*files, "--seconds", 1, "--height", 240, option, "--out", tmp_path / "x.mp4")
        shown[option] = frames(tmp_path / "x.mp4")[:, :24, :24].astype(int)
    blue = {option: (corner[..., 2] - corner[..., 0]).max() for option, corner in shown.items()}
    assert blue["--marks"] > 80 > 20 > blue["--no-marks"]


@cases(
    "words, fault",
    (("play", "--out", "x.avi"), "is written as .html, .htm, .mp4, .webm, .gif"),
    (("play", "--out", "x.html", "--rate", "30"), "--rate is for a video, not for x.html"),
    (("play", "--out", "x.mp4", "--other", "."), "--other is for a page, not for x.mp4"),
    (("play", "--out", "x.mp4", "--over", "."), "in space; over a video go points of its pictures"),
    (("play", "--out", "/nowhere/x.mp4"), "/nowhere: no such folder"),
    (("play", "--out", "x.mp4", "--seconds", "-1"), "seconds must be positive and finite, got -1"),
    (("play", "--out", "x.mp4", "--no-marks", "--how", "hit"), "--how is of no use with --no-marks"),
    (("play", "--out", "x.mp4", "--no-marks", "--verdict"), "--verdict is of no use with --no-marks"),
    (("play", "--out", "x.mp4", "--offset", "99"), "motion starting at 99.00 s does not overlap audio"),
    (("play", "--out", "x.mp4", "--start", "99"), "its music ends at 6.00 s, before --start 99"),
    (("play", "--out", "x.html", "--how", "hit", "--pattern", "dance.npz"), "--how and --pattern exclude each other"),
    (("retime", "--out", "x.wav"), "written as .npz, .bvh, .mp4"),
    (("retime", "--out", "x.npz", "--height", "720"), "--height is for a video, not for x.npz"),
    (("retime", "--out", "nowhere/x.npz"), "no such folder"),
    (("retime", "--out", "x.npz", "--strength", "2"), "strength must lie between 0 and 1"),
    (("retime", "--out", "x.npz", "--slowest", "0"), "slowest must lie above 0"),
    (("retime", "--out", "x.npz", "--method", "lee2019", "--slowest", "0.9"), "--slowest is for --method dp"),
    (("retime", "--out", "x.npz", "--offset", "99"), "does not overlap audio"),
)
def test_what_cannot_be_done_is_one_line(
    words: tuple[str, ...], fault: str, files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert fault in complaint(app, words[0], *files, *words[1:])
    assert not list(tmp_path.glob("x.*"))


# Retiming


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Song and motion of a rumba whose steps come early and late."""
    return write_pair(tmp_path_factory.mktemp("pair"), synthetic_clip("rumba", seconds=6.0, jitter=0.15, seed=3))[:2]


def row(result: Result, name: str) -> list[str]:
    """The cells of a row of the printed table."""
    line = next(line for line in result.output.splitlines() if name in line)
    return [cell.strip() for cell in line.strip("│ ").split("│")][1:]


def test_a_jittered_dance_is_mended_and_the_table_says_how(tmp_path: Path):
    song, dance = write_pair(tmp_path, synthetic_clip("rumba", seconds=24.0, jitter=0.15, seed=3))[:2]
    result = retime(song, dance, "--offset", 0, "--out", tmp_path / "x.npz")
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


def test_the_warper_of_2019_can_be_asked_for(pair: tuple[Path, Path], tmp_path: Path):
    result = retime(*pair, "--out", tmp_path / "x.npz", "--method", "lee2019")
    low, high = map(float, row(result, "local speed")[1].split(" to "))
    assert low < 0.7 or high > 1.4


@pytest.mark.slow
def test_a_film_has_pictures_and_the_song_from_the_offset_on(pair: tuple[Path, Path], tmp_path: Path):
    film = tmp_path / "x.mp4"
    retime(*pair, "--out", film, "--offset", -0.5, "--height", 240)
    assert len(frames(film)) == 180
    with av.open(str(film)) as container:
        assert container.streams.video[0].height == 240
        sound = np.concatenate([block.to_ndarray()[0] for block in container.decode(audio=0)])
    assert np.abs(sound[: int(0.45 * 48_000)]).max() < 1e-3 < np.abs(sound[int(0.5 * 48_000) :]).max()


@pytest.mark.slow  # twelve seconds of film, drawn, retimed and read
def test_in_a_retimed_video_the_dancer_rests_on_the_beats(tmp_path: Path):
    clip = synthetic_clip("waltz", seconds=12.0, jitter=0.15, seed=1)
    song = write_song(tmp_path / "song.wav", clip)
    write_video(tmp_path / "in.mp4", render_skeleton(clip.motion, fps=30.0, height=160), 30.0)
    retime(song, tmp_path / "in.mp4", "--out", tmp_path / "out.mp4", "--dance", "waltz", "--height", 144)
    with av.open(str(tmp_path / "out.mp4")) as container:
        film = container.streams.video[0]
        assert (film.frames, film.height, len(container.streams.audio)) == (360, 144, 1)
    scores = []
    for name in ("in.mp4", "out.mp4"):
        video = video_frames(tmp_path / name, height=160)
        rests = visual_beats(picture_motion(video, video.fps), params=HarmonyParams.valleys())
        scores.append(score_harmony(clip.beats, rests, params=HarmonyParams.valleys(), n_rotations=0))
    assert scores[0].harmony_above_chance < 0.45 and scores[1].harmony_above_chance > 0.65


def test_the_marks_of_a_retimed_dance_are_those_of_its_number(pair: tuple[Path, Path], tmp_path: Path):
    with patch("harmolab.lab.render.video.render_dance", wraps=render_dance) as drawn:
        retime(*pair, "--out", tmp_path / "out.mp4", "--how", "hit", "--height", 120)
    assert drawn.call_args.kwargs["score"].params.pattern == HOW_PATTERNS["hit"]


@pytest.mark.parametrize("name", ["x.npz", "x.mp4", "x.bvh"])
def test_files_that_are_no_motion_or_no_video_are_named(pair: tuple[Path, Path], tmp_path: Path, name: str):
    (tmp_path / name).write_bytes(b"not this")
    assert name in complaint(app, "retime", pair[0], tmp_path / name, "--out", tmp_path / "out.mp4")
    assert not (tmp_path / "out.mp4").exists()
