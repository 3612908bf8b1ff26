"""The word that librosa's tracker is being compiled: once on a machine, when it is."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from harmolab.beats import audio
from harmolab.beats import audio as compiling
from harmolab.cli import app
from tests.builders import called, cases, planted_dance, write_song

VERSION = f"py{sys.version_info.major}{sys.version_info.minor}"


@pytest.fixture
def song(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A song that nobody has listened to, for a process that has not compiled yet."""
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "analyses"))
    audio.compile_tracker.cache_clear()
    return write_song(tmp_path / "song.wav", planted_dance())


@cases(
    "name, is_compiled",
    (f"librosa_e756/guf-beat.__beat_track_dp-558.{VERSION}.nbi", True),
    ("librosa_e756/guf-beat.__beat_track_dp-558.py20.nbi", False),  # of another Python
    (f"util_29fc/utils._localmax-1035.{VERSION}.nbi", False),  # of another part of librosa
    (f"librosa_e756/beat.__beat_track_dp-558.{VERSION}.1.nbc", False),  # without its index
)
def test_tracker_is_compiled_where_numba_keeps_its_index(
    name: str, is_compiled: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not compiling.is_tracker_compiled()
    (tmp_path / name).parent.mkdir()
    (tmp_path / name).touch()
    assert compiling.is_tracker_compiled() == is_compiled


def test_real_compilation_of_this_machine_is_found() -> None:
    assert compiling.is_tracker_compiled()  # conftest has had it compiled


@pytest.mark.parametrize(("is_compiled", "times"), [(False, 1), (True, 0)])
def test_command_says_once_that_it_compiles_and_only_then(
    is_compiled: bool, times: int, song: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audio, "is_tracker_compiled", lambda: is_compiled)
    said = called(app, "dance", song, "--seconds", "5", "--out", song.with_name("dance.npz")).stderr
    assert said.count("compiling") == times
    assert said.count(f"harmolab: {audio.COMPILING}\n") == times
    assert "first time" not in said


def test_quiet_command_compiles_without_a_word(song: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audio, "is_tracker_compiled", lambda: False)
    assert called(app, "beats", song, "-q").stderr == ""


def test_process_that_waits_for_another_to_compile_says_nothing(song: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = [False]  # the cache as it is before the lock is there

    class Lock:
        def __init__(self, *_: object, **__: object) -> None: ...

        def __enter__(self) -> None:
            answers[0] = True  # meanwhile the other process has compiled

        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(audio, "FileLock", Lock)
    monkeypatch.setattr(audio, "is_tracker_compiled", lambda: answers[0])
    assert "compiling" not in called(app, "beats", song).stderr


@pytest.mark.slow
def test_second_command_on_a_machine_no_longer_compiles(tmp_path: Path) -> None:
    write_song(tmp_path / "song.wav", planted_dance())
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "numba"), "HARMOLAB_CACHE": "off"}
    command = [sys.executable, "-m", "harmolab.cli", "beats", str(tmp_path / "song.wav")]
    said = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stderr for _ in "ab"]
    assert [text.count("compiling") for text in said] == [1, 0]
