"""Audio to beats: clicks whose times are known, odd sounds, and a cache that nothing can poison."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import harmolab.beats.audio as listening
from harmolab.beats.audio import audio_beats, beat_strengths, tempo_range
from harmolab.files import cache_folder
from harmolab.types import Audio
from tests.builders import cases, refused

Clicks = Callable[..., Audio]
HOP_SECONDS = 512 / 22050


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Each test listens for itself."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("HARMOLAB_CACHE", str(folder))
    return folder


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[Audio]:
    """A stand-in for librosa with beats at frames 3 and 5; the list holds what it was asked."""
    asked: list[Audio] = []

    def analyse(audio: Audio, bounds: object) -> tuple[np.ndarray, np.ndarray]:
        asked.append(audio)
        return np.array([0.0, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0]), np.array([3, 5])

    monkeypatch.setattr(listening, "_analyse", analyse)
    return asked


def offsets(times: np.ndarray, period: float) -> np.ndarray:
    """Distance of each time to the nearest multiple of the period."""
    return np.abs(times - period * np.round(times / period))


@pytest.mark.parametrize("bpm", [90, 120, 150])
def test_beats_lie_on_the_clicks(click_track: Clicks, bpm: int):
    track = audio_beats(click_track(bpm))
    assert offsets(track.times, 60 / bpm).max() <= 1.5 * HOP_SECONDS
    assert np.median(np.diff(track.times)) == pytest.approx(60 / bpm, rel=0.03)
    assert len(track) >= 10 * bpm / 60 - 3
    assert track.duration == 10.0


@pytest.mark.parametrize("sample_rate", [8000, 44100, 96000])
def test_beats_lie_on_the_clicks_at_any_sample_rate(click_track: Clicks, sample_rate: int):
    track = audio_beats(click_track(120, sample_rate=sample_rate))
    assert offsets(track.times, 0.5).max() <= max(0.02, 1.5 * 512 / sample_rate)
    assert len(track) >= 14


def test_the_prior_chooses_between_a_tempo_and_its_half(click_track: Clicks):
    clicks = click_track(160)
    slow, fast = (audio_beats(clicks, tempo=bounds) for bounds in ((70, 90), (150, 170)))
    assert np.median(np.diff(slow.times)) == pytest.approx(0.75, rel=0.05)
    assert np.median(np.diff(fast.times)) == pytest.approx(0.375, rel=0.05)


def test_a_narrow_prior_is_obeyed_even_where_librosa_knows_no_such_tempo(click_track: Clicks):
    # Its tempi at 43 envelope samples per second are 117.5 and 123.0.
    track = audio_beats(click_track(120), tempo=(119, 121))
    assert len(track) >= 17
    assert offsets(track.times, 0.5).max() <= 1.5 * HOP_SECONDS


def test_a_dance_names_its_tempo_even_at_a_low_sample_rate(click_track: Clicks):
    # At 8 kHz no whole number of envelope samples makes 188-216 beats per minute.
    track = audio_beats(click_track(200, sample_rate=8000), tempo="quickstep")
    assert np.median(np.diff(track.times)) == pytest.approx(0.3, rel=0.1)


def test_strengths_are_the_onset_envelope_near_the_beats(click_track: Clicks):
    # Every second click ten times as loud, which is 20 dB; onset strength is a difference of dB.
    loud, all_clicks = click_track(60), click_track(120)
    track = audio_beats(Audio(0.9 * loud.samples + 0.1 * all_clicks.samples, 22050), tempo=(110, 130))
    is_loud = offsets(track.times, 1.0) < 0.1
    assert track.strengths[is_loud].min() > 1.1 * track.strengths[~is_loud].max()
    assert track.fps == pytest.approx(22050 / 512)


def test_louder_clicks_are_not_stronger_when_all_are_louder(click_track: Clicks):
    audio = click_track(120)
    quiet = Audio(audio.samples * 0.1, audio.sample_rate)
    np.testing.assert_array_equal(audio_beats(audio).times, audio_beats(quiet).times)


def test_silence_has_no_beats():
    assert len(audio_beats(Audio(np.zeros(22050), 22050))) == 0


@pytest.mark.parametrize("samples", [1, 100, 2205])
def test_a_very_short_sound_is_no_error(rng: np.random.Generator, samples: int):
    track = audio_beats(Audio(rng.normal(size=samples), 22050))
    assert (track.times <= track.duration).all()


@pytest.mark.parametrize("amplitude", [1e30, 1e200])
def test_absurd_amplitudes_do_not_overflow(click_track: Clicks, amplitude: float):
    audio = click_track(120)
    loud = Audio(audio.samples * amplitude, audio.sample_rate)
    np.testing.assert_array_equal(audio_beats(loud).times, audio_beats(audio).times)


@pytest.mark.parametrize("rate", [1.0, 100.0])
def test_an_absurd_sample_rate_is_no_error(rate: float):
    assert len(audio_beats(Audio(np.sin(np.arange(300.0)), rate), tempo="quickstep")) == 0


def test_beat_strengths_take_the_largest_of_three_frames(counted: list[Audio]):
    # Envelope 2, 0, 1, 0 from frame 3 on at 43 Hz; asked at frames 2 (sees 0, 2), 4 (2, 0, 1), 6 (1, 0), at the end.
    asked = np.array([2, 4, 6, 400]) * HOP_SECONDS
    np.testing.assert_array_equal(beat_strengths(Audio(np.ones(9000), 22050), asked), [2, 2, 1, 1])


def test_beat_strengths_of_no_beats_are_none(counted: list[Audio]):
    assert beat_strengths(Audio(np.ones(9000), 22050), np.zeros(0)).size == 0


def test_beats_behind_the_end_are_left_out(counted: list[Audio]):
    # Frame 5 is at 0.12 s, the beat that is heard by it 1.3 frames earlier.
    assert len(audio_beats(Audio(np.ones(1000), 22050))) == 1


@cases("given, expected", (None, None), ("waltz", (78.0, 96.0)), ((100, 120), (100.0, 120.0)), ([60, 61.5], (60, 61.5)))
def test_a_tempo_prior_is_a_dance_or_a_range(given, expected):
    assert tempo_range(given) == expected


@cases(
    "given, message",
    ("polka", "unknown dance 'polka'; known: cha-cha, jive"),
    ((120, 100), "a tempo range is two rising numbers in beats per minute, got"),
    ((0, 100), "a tempo range is two rising numbers"),
    ((100, 100), "a tempo range is two rising numbers"),
    ((float("nan"), 100), "a tempo range is two rising numbers"),
)
def test_a_bad_tempo_prior_is_refused(given, message):
    refused(message, tempo_range, given)


def test_a_song_is_listened_to_once(counted: list[Audio]):
    first, again = audio_beats(Audio(np.ones(9000), 22050)), audio_beats(Audio(np.ones(9000), 22050))
    assert len(counted) == 1
    np.testing.assert_array_equal(first.times, again.times)
    np.testing.assert_array_equal(first.strengths, [2, 1])
    np.testing.assert_array_equal(again.strengths, [2, 1])


def test_other_samples_another_rate_and_another_prior_are_listened_to_anew(counted: list[Audio]):
    samples = np.ones(9000)
    audio_beats(Audio(samples, 22050))
    audio_beats(Audio(samples * 0.5, 22050))
    audio_beats(Audio(samples, 44100))
    audio_beats(Audio(samples, 22050), tempo="waltz")
    audio_beats(Audio(samples, 22050), tempo=(78.0, 96.0))  # the waltz's own range
    assert len(counted) == 4


def test_the_cache_can_be_switched_off(counted: list[Audio], cache: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_CACHE", "off")
    audio = Audio(np.ones(9000), 22050)
    audio_beats(audio)
    audio_beats(audio)
    assert cache_folder() is None
    assert len(counted) == 2
    assert not cache.exists()


def test_without_a_setting_the_cache_is_the_users(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HARMOLAB_CACHE")
    folder = cache_folder()
    assert folder is not None
    assert folder.name == "harmolab"


def test_a_cache_that_cannot_be_written_is_no_error(counted: list[Audio], cache: Path):
    cache.write_text("a file where the folder should be")
    assert len(audio_beats(Audio(np.ones(9000), 22050))) == 2


def test_a_failed_write_leaves_nothing_behind(counted: list[Audio], cache: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*args: object, **arrays: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez", full)
    assert len(audio_beats(Audio(np.ones(9000), 22050))) == 2
    assert list(cache.iterdir()) == []


def damaged(whole: bytes) -> dict[str, bytes]:
    """Ways in which a file goes bad."""
    made = {f"cut to {size}": whole[:size] for size in (0, 3, 30, len(whole) // 2, len(whole) - 1)}
    made |= {"text": b"not found", "zeros": bytes(len(whole))}
    for place in range(0, len(whole), 3):
        made[f"byte {place}"] = whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]
        made[f"bit of byte {place}"] = whole[:place] + bytes([whole[place] ^ 8]) + whole[place + 1 :]
    return made


def test_a_damaged_cache_file_is_built_again(counted: list[Audio], cache: Path):
    audio = Audio(np.ones(9000), 22050)
    audio_beats(audio)
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    for name, content in damaged(whole).items():
        file.write_bytes(content)
        np.testing.assert_array_equal(audio_beats(audio).strengths, [2, 1], err_msg=name)
    file.write_bytes(b"")
    audio_beats(audio)
    assert file.read_bytes() == whole


FIT = {"fit": np.array(1.0)}


@cases(
    "arrays",
    {"envelope": np.ones(5)},
    {"envelope": np.full(5, np.nan), "beats": np.array([1]), "quality": np.array(1.0), **FIT},
    {"envelope": np.ones((5, 5)), "beats": np.array([1]), "quality": np.array(1.0), **FIT},
    {"envelope": np.ones(5), "beats": np.array([np.nan]), "quality": np.array(1.0), **FIT},
    {"envelope": np.ones(5), "beats": np.array([1]), "quality": np.array([1.0]), **FIT},
    {"envelope": np.ones(5), "beats": np.array([1]), "quality": np.array(1.0), "fit": np.array([1.0])},
    {"envelope": np.ones(5), "beats": np.array([3, 1]), "quality": np.array(1.0), **FIT},
    {"envelope": np.array(["a"]), "beats": np.array([1]), "quality": np.array(1.0), **FIT},
)
def test_a_cache_file_with_something_else_in_it_is_built_again(counted: list[Audio], cache: Path, arrays: dict):
    audio = Audio(np.ones(9000), 22050)
    audio_beats(audio)
    (file,) = cache.iterdir()
    np.savez(file, **arrays)
    np.testing.assert_array_equal(audio_beats(audio).strengths, [2, 1])


def test_a_lone_array_in_place_of_a_cache_file_is_built_again(counted: list[Audio], cache: Path):
    audio = Audio(np.ones(9000), 22050)
    audio_beats(audio)
    (file,) = cache.iterdir()
    with file.open("wb") as stream:
        np.save(stream, np.ones(5))
    assert len(audio_beats(audio)) == 2


RIVAL = """
import os
from pathlib import Path
import numpy as np
import harmolab.beats.audio as listening
from harmolab.types import Audio

envelope, beats = np.zeros(20000), np.array([3, 9, 12, 24, 30])
envelope[beats] = [1, 2, 3, 4, 5]
listening._analyse = lambda audio, bounds: (envelope, beats)
audio = Audio(np.ones(22050), 22050)
for turn in range(150):
    track = listening.audio_beats(audio)
    if not np.array_equal(track.strengths, [1, 2, 3, 4, 5]):
        raise SystemExit(f"turn {turn} read {track.strengths}")
    for file in Path(os.environ["HARMOLAB_CACHE"]).glob("*.npz"):
        file.unlink(missing_ok=True)
"""


@pytest.mark.slow  # processes
def test_two_processes_share_a_cache_without_reading_halves(cache: Path):
    environment = {**os.environ, "HARMOLAB_CACHE": str(cache)}
    rivals = [
        subprocess.Popen([sys.executable, "-c", RIVAL], env=environment, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    errors = [rival.communicate(timeout=60)[1] for rival in rivals]
    assert [rival.returncode for rival in rivals] == [0, 0], errors
    assert list(cache.glob(".*.tmp")) == []
