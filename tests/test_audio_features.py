"""What the generator hears: MFCC at given moments, onsets and beat position; the cache of the analysis."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import librosa
import numpy as np
import pytest

from harmolab.beats.audio import HOP
from harmolab.systems.training import features as heard
from harmolab.systems.training.features import FeatureParams, audio_features, bar_phase, beat_phase, mfcc
from harmolab.types import Audio, BeatTrack
from tests.builders import track
from tests.test_hostile import npy_header, saved

RATE = 22050.0
TICK = HOP / RATE  # seconds between two analyses
NO_BEATS = BeatTrack([], [], 100.0, 10.0)


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARMOLAB_CACHE", "off")


@pytest.fixture
def song(click_track: Callable[..., Audio]) -> Audio:
    """Three seconds of clicks at 120 beats per minute."""
    return click_track(120, seconds=3.0)


def test_at_the_moments_of_the_analysis_features_are_librosas_mfcc(song: Audio):
    table = librosa.feature.mfcc(y=song.samples.astype(np.float32), sr=22050, n_mfcc=20, hop_length=HOP).T
    features = audio_features(song, NO_BEATS, np.arange(10, 20) * TICK, FeatureParams())
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, table[10:20], rtol=1e-4, atol=1e-3)


def test_between_two_moments_features_are_interpolated(song: Audio):
    table = mfcc(song, 13)
    features = audio_features(song, NO_BEATS, np.array([10.25 * TICK]), FeatureParams(n_mfcc=13))
    np.testing.assert_allclose(features[0], 0.75 * table[10] + 0.25 * table[11], rtol=1e-4, atol=1e-3)


def test_before_and_after_the_music_its_ends_hold(song: Audio):
    features = audio_features(song, NO_BEATS, np.array([-5.0, 0.0, 60.0]), FeatureParams())
    np.testing.assert_array_equal(features[0], features[1])
    np.testing.assert_array_equal(features[2], mfcc(song, 20)[-1])


def test_music_at_another_rate_sounds_the_same():
    def tone(rate: float) -> Audio:
        time = np.arange(round(2 * rate)) / rate
        return Audio(0.3 * np.sin(2 * np.pi * 440 * time) * (1 + np.sin(2 * np.pi * 2 * time)), rate)

    moments = np.linspace(0.2, 1.8, 9)
    params = FeatureParams(n_mfcc=5)
    here, there = (audio_features(tone(rate), NO_BEATS, moments, params) for rate in (RATE, 44100.0))
    assert np.abs(here - there).max() < 0.02 * np.abs(here).max()


@pytest.mark.parametrize("samples", [np.ones(40), np.zeros(22050)], ids=["a few milliseconds", "silence"])
def test_hardly_any_sound_has_finite_features(samples: np.ndarray):
    features = audio_features(Audio(samples, RATE), NO_BEATS, np.zeros(3), FeatureParams(beat_channels=True))
    assert features.shape == (3, 23) and np.isfinite(features).all()
    np.testing.assert_array_equal(features[:, -2:], 0.0)  # no beats, no place between them


def test_beat_channels_are_onset_strength_and_beat_position(song: Audio):
    params, moments, beats = FeatureParams(n_mfcc=4, beat_channels=True), np.arange(0, 3, TICK), track([0.5, 1, 1.5, 2])
    features = audio_features(song, beats, moments, params)
    assert features.shape == (len(moments), params.n_audio)
    onsets = features[:, 4]
    assert (onsets.min(), onsets.max()) == (pytest.approx(0.0, abs=0.05), pytest.approx(1.0))
    # The strongest moment lies at a click.
    assert abs(moments[onsets.argmax()] * 2 - round(moments[onsets.argmax()] * 2)) < 4 * TICK
    np.testing.assert_allclose(features[:, 5:], beat_phase(beats, moments), atol=1e-6)


def test_beat_position_is_linear_between_beats_and_goes_on_by_the_median_interval():
    # Intervals 1, 2, 1: the median is 1.
    moments = np.array([1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 0.75, 0.0, 5.5])
    angles = 2 * np.pi * np.array([0.0, 0.25, 0.0, 0.25, 0.5, 0.0, -0.25, -1.0, 1.5])
    expected = np.column_stack([np.sin(angles), np.cos(angles)])
    np.testing.assert_allclose(beat_phase(track([1.0, 2.0, 4.0, 5.0]), moments), expected, atol=1e-9)


def test_the_bar_is_counted_from_the_places_of_its_beats_and_unknown_without_them():
    # Places 2, 0, 1 of three: moments on the beats, half way between the last two, and a beat before the first.
    placed = replace(track([1.0, 2.0, 3.0]), bar_places=np.array([2, 0, 1]))
    angles = 2 * np.pi * np.array([2 / 3, 0.0, 1 / 3, 0.5, 1 / 3])
    expected = np.column_stack([np.sin(angles), np.cos(angles)])
    np.testing.assert_allclose(bar_phase(placed, np.array([1.0, 2.0, 3.0, 3.5, 0.0])), expected, atol=1e-9)
    np.testing.assert_array_equal(bar_phase(track([1.0, 2.0]), np.zeros(2)), np.zeros((2, 2)))


@pytest.mark.parametrize("track", [NO_BEATS, track([1.0])])
def test_fewer_than_two_beats_make_no_position(track: BeatTrack):
    np.testing.assert_array_equal(beat_phase(track, np.arange(3.0)), np.zeros((3, 2)))


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))
    return tmp_path


def test_a_song_is_analysed_once(song: Audio, cache: Path, monkeypatch: pytest.MonkeyPatch):
    first = mfcc(song, 20)
    monkeypatch.setattr(heard, "_analyse", lambda audio, count: pytest.fail("analysed again"))
    np.testing.assert_array_equal(mfcc(song, 20), first)


def test_other_music_or_another_number_of_coefficients_is_analysed_anew(song: Audio, cache: Path):
    louder = Audio(song.samples * 2, song.sample_rate)
    assert [mfcc(song, count).shape[1] for count in (20, 13)] == [20, 13]
    assert (mfcc(louder, 20)[:, 0] > mfcc(song, 20)[:, 0]).any()
    assert len(list(cache.glob("*.npz"))) == 3


CLAIMS = [npy_header("'<f8'", shape) for shape in ("(1000000000, 1000, 3)", "(" * 4000)]  # terabytes, and no end


@pytest.mark.parametrize("damage", [b"", b"no zip", None, *CLAIMS])
def test_a_damaged_cache_file_is_written_anew(song: Audio, cache: Path, damage: bytes | None):
    right = mfcc(song, 20)
    (path,) = cache.glob("*.npz")
    path.write_bytes(saved(np.savez, mfcc=np.full_like(right, np.nan)) if damage is None else damage)
    np.testing.assert_array_equal(mfcc(song, 20), right)
    with np.load(path) as content:
        np.testing.assert_array_equal(content["mfcc"], right)


def test_a_cache_that_cannot_be_written_is_no_error(song: Audio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "file"))
    assert mfcc(song, 20).shape[1] == 20
