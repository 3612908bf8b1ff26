"""`harmolab render`: the right frames and the right sound, and one line where it cannot be done."""

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from harmolab.cli import app
from harmolab.clips import load_clip
from harmolab.readers.video import write_video
from harmolab.types import Clip
from harmolab.verdict.judge import score_clip
from tests.builders import cases, planted_dance, write_dance, write_song


@pytest.fixture
def files(planted_clip: Clip, tmp_path: Path) -> tuple[Path, Path]:
    """Song and motion of a synthetic cha-cha."""
    return write_song(tmp_path / "song.wav", planted_clip), write_dance(tmp_path / "dance.npz", planted_clip)


def render(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["render", *map(str, arguments)])


def frames(path: Path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_video_has_the_length_size_and_sound_asked_for(files: tuple[Path, Path], tmp_path: Path):
    out = tmp_path / "x.mp4"
    result = render(*files, "--seconds", 2, "--height", 240, "--out", out)
    assert result.exit_code == 0, result.output
    assert frames(out).shape == (60, 240, 320, 3)
    with av.open(str(out)) as container:
        sound = container.streams.audio[0]
        assert float(sound.duration * sound.time_base) == pytest.approx(2.0, abs=0.1)


def test_verdict_and_number_are_printed_with_marks_only(tmp_path: Path):
    clip = planted_dance(seconds=16.0, fps=30.0)
    song, dance = write_song(tmp_path / "song.wav", clip), write_dance(tmp_path / "dance.npz", clip)
    small = (song, dance, "--height", 120, "--rate", 10, "--out", tmp_path / "x.mp4")
    score = score_clip(load_clip(song, dance))
    text = render(*small).stdout
    assert text.startswith(score.judgement.verdict)
    assert f"harmony above chance {score.harmony_above_chance:.2f} (0 is luck, 1 the most)" in text
    assert "chance" not in render(*small, "--no-marks").stdout


def test_webm_has_the_free_codings(files: tuple[Path, Path], tmp_path: Path):
    result = render(*files, "--seconds", 1, "--height", 240, "--out", tmp_path / "x.webm")
    assert result.exit_code == 0, result.output
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
    video, points = take
    out = tmp_path / "x.mp4"
    result = render(video, points, "--fps", 25, "--over", video, "--no-marks", "--out", out)
    assert result.exit_code == 0, result.output
    shown = frames(out)
    assert shown.shape == (50, 240, 320, 3)
    columns = [np.flatnonzero(picture[100, :, 0] > 180).mean() for picture in shown]
    np.testing.assert_allclose(columns, 100 + 2 * np.arange(50), atol=2)
    with av.open(str(out)) as container:
        sound = np.concatenate([block.to_ndarray()[0] for block in container.decode(audio=0)])
    assert np.abs(sound).max() > 0.05  # the video's own


def test_points_without_their_video_are_drawn_as_a_person(take: tuple[Path, Path], tmp_path: Path):
    result = render(*take, "--fps", 25, "--height", 120, "--out", tmp_path / "x.mp4")
    assert result.exit_code == 0, result.output
    assert (frames(tmp_path / "x.mp4").min(axis=3) < 150).any()


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"", "over.mp4: the file is empty"), (b"no video at all" * 99, "over.mp4: cannot be read as video")],
)
def test_an_unreadable_video_to_draw_over_is_one_line(
    content: bytes, told: str, take: tuple[Path, Path], tmp_path: Path
):
    (tmp_path / "over.mp4").write_bytes(content)
    result = render(*take, "--fps", 25, "--over", tmp_path / "over.mp4", "--no-marks", "--out", tmp_path / "x.mp4")
    assert result.exit_code == 2 and told in result.output.replace("\n", "")
    assert not (tmp_path / "x.mp4").exists()


def test_the_video_to_draw_over_is_not_written_over(take: tuple[Path, Path]):
    before = take[0].read_bytes()
    result = render(*take, "--fps", 25, "--over", take[0], "--out", take[0])
    assert result.exit_code == 2 and "is an input here" in result.output.replace("\n", "")
    assert take[0].read_bytes() == before


def test_the_video_to_draw_over_keeps_its_rate(take: tuple[Path, Path], tmp_path: Path):
    result = render(*take, "--fps", 25, "--over", take[0], "--rate", 30, "--no-marks", "--out", tmp_path / "x.mp4")
    assert result.exit_code == 2 and "is drawn at its own frame rate; leave out --rate" in result.output
    assert not (tmp_path / "x.mp4").exists()


@pytest.mark.browser
@pytest.mark.slow
def test_webm_plays_with_its_sound(files: tuple[Path, Path], tmp_path: Path, chromium: Any):
    assert render(*files, "--seconds", 2, "--height", 240, "--out", tmp_path / "x.webm").exit_code == 0
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
        assert render(*files, "--seconds", 1, "--height", 240, option, "--out", tmp_path / "x.mp4").exit_code == 0
        shown[option] = frames(tmp_path / "x.mp4")[:, :24, :24].astype(int)
    blue = {option: (corner[..., 2] - corner[..., 0]).max() for option, corner in shown.items()}
    assert blue["--marks"] > 80 > 20 > blue["--no-marks"]


@cases(
    "options, told",
    (("--out", "x.avi"), "a video is written as .mp4, .webm, .gif"),
    (("--out", "x.mp4", "--over", "none.mp4"), "is movement in space; over a video go points of its pictures"),
    (("--out", "/nowhere/x.mp4"), "/nowhere: no such folder"),
    (("--out", "x.mp4", "--seconds", "-1"), "seconds must be positive and finite, got -1"),
    (("--out", "x.mp4", "--offset", "99"), "motion starting at 99.00 s does not overlap audio"),
)
def test_what_cannot_be_done_is_one_line(
    options: tuple[str, ...], told: str, files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    result = render(*files, *options)
    assert result.exit_code != 0 and told in result.output
    assert not list(tmp_path.glob("x.*"))
