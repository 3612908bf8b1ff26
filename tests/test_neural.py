"""The neural tracker's adapter, with a stand-in for its package: what it is given, and what is refused."""

import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from harmolab.readers.beats import neural_beats
from harmolab.types import Audio
from tests.builders import refused

AUDIO = Audio(np.zeros(4 * 22050), 22050)


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """A package beat_this that hears a beat every half second and a bar every three; the list holds what it got."""
    calls: list[object] = []

    class Audio2Beats:
        def __init__(self, checkpoint_path: str, device: str, float16: bool = False, dbn: bool = False) -> None:
            calls.append((checkpoint_path, device))
            if Path(checkpoint_path).read_bytes() == b"damaged":
                raise RuntimeError("Invalid magic number")

        def __call__(self, signal: np.ndarray, sr: int) -> tuple[np.ndarray, np.ndarray]:
            calls.append((signal.dtype, signal.shape, sr))
            return np.arange(0.5, 4.0, 0.5), np.array([1.0, 2.5])

    package, inference = ModuleType("beat_this"), ModuleType("beat_this.inference")
    package.__spec__ = ModuleSpec("beat_this", None)
    package.__path__ = []
    inference.Audio2Beats = Audio2Beats
    monkeypatch.setitem(sys.modules, "beat_this", package)
    monkeypatch.setitem(sys.modules, "beat_this.inference", inference)
    return calls


def test_it_gets_a_file_that_is_there_and_its_downbeats_become_bars(given: list[object], tmp_path: Path):
    file = tmp_path / "final0.ckpt"
    file.write_bytes(b"weights")
    track = neural_beats(AUDIO, file)
    assert given == [(str(file.resolve()), "cpu"), (np.dtype("float32"), (88200,), 22050)]
    np.testing.assert_allclose(track.times, np.arange(0.5, 4.0, 0.5))
    assert track.bar_places.tolist() == [2, 0, 1, 2, 0, 1, 2] and track.quality is None


@pytest.mark.parametrize("name", [None, "final0", "https://example.org/final0.ckpt", "folder"])
def test_what_is_no_file_never_reaches_the_package_which_would_download_it(
    given: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str | None
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    refused(r"no weights on this machine; get a checkpoint .* with --checkpoint", neural_beats, AUDIO, name)
    assert given == []


def test_a_damaged_checkpoint_is_named(given: list[object], tmp_path: Path):
    (tmp_path / "x.ckpt").write_bytes(b"damaged")
    message = r"x.ckpt: cannot be read as a checkpoint of beat_this \(Invalid magic"
    refused(message, neural_beats, AUDIO, tmp_path / "x.ckpt")


def test_without_the_package_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("harmolab.readers.beats.find_spec", lambda name: None)
    refused("needs its package; pip install beat-this, then get a checkpoint", neural_beats, AUDIO, tmp_path)
