"""`harmolab render`: the right frames and the right sound, and one line where it cannot be done."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
from typer.testing import CliRunner, Result

from harmolab.cli import app
from harmolab.io.motion import save_motion
from harmolab.types import Clip


@pytest.fixture
def files(planted_clip: Clip, tmp_path: Path) -> tuple[Path, Path]:
    """Song and motion of a synthetic cha-cha."""
    song, motion = tmp_path / "song.wav", tmp_path / "dance.npz"
    soundfile.write(song, planted_clip.audio.samples, round(planted_clip.audio.sample_rate))
    save_motion(motion, planted_clip.motion)
    return song, motion


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


def test_marks_may_be_left_out(files: tuple[Path, Path], tmp_path: Path):
    shown = {}
    for option in ("--marks", "--no-marks"):
        assert render(*files, "--seconds", 1, "--height", 240, option, "--out", tmp_path / "x.mp4").exit_code == 0
        shown[option] = frames(tmp_path / "x.mp4")[:, :24, :24].astype(int)
    blue = {option: (corner[..., 2] - corner[..., 0]).max() for option, corner in shown.items()}
    assert blue["--marks"] > 80 > 20 > blue["--no-marks"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--out", "x.gif"), "a video is written as .mp4"),
        (("--out", "/nowhere/x.mp4"), "/nowhere: no such folder"),
        (("--out", "x.mp4", "--seconds", "-1"), "seconds must be positive, got -1"),
        (("--out", "x.mp4", "--offset", "99"), "motion from 99 s does not meet audio"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    options: tuple[str, ...], told: str, files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    result = render(*files, *options)
    assert result.exit_code != 0 and told in result.output
    assert not list(tmp_path.glob("x.*"))
