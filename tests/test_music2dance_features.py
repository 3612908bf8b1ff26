"""What Music2Dance hears: clicks in the right moment, tones in the right channel; loudness does not count."""

from pathlib import Path

import numpy as np
import pytest
import soxr

from harmolab.data.synthetic import synthetic_clip
from harmolab.systems.music2dance import music_features as module
from harmolab.systems.music2dance.music_features import CHANNELS, accented_place, marked, mel_features, music_features
from harmolab.types import Audio, BeatTrack
from tests.builders import metronome, track

RATE = 22050
SECONDS = 12.0


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path))
    return tmp_path


def clicks(times: np.ndarray) -> Audio:
    """Short noises at these seconds."""
    samples = np.zeros(int(SECONDS * RATE))
    burst = np.random.default_rng(0).normal(0, 0.3, 300) * np.exp(-np.arange(300) / 60)
    for start in np.round(times * RATE).astype(int):
        samples[start : start + 300] += burst
    return Audio(samples, RATE)


def tone(frequency: float) -> Audio:
    return Audio(0.5 * np.sin(2 * np.pi * frequency * np.arange(int(SECONDS * RATE)) / RATE), RATE)


def silent() -> BeatTrack:
    return track([], duration=SECONDS)


def test_planted_beats_peak_in_their_moment_or_its_neighbour():
    times = np.arange(0.5, SECONDS - 0.5, 0.537)
    features = music_features(clicks(times), track(times, duration=SECONDS))
    cells = np.round(times * 10).astype(int)
    for channel in ("onset", "beat"):
        curve = features[:, CHANNELS.index(channel)]
        peaks = [cell + np.argmax(curve[cell - 2 : cell + 3]) - 2 for cell in cells]
        assert np.mean(np.abs(peaks - cells) <= 1) >= 0.95, channel


def test_a_beat_between_two_moments_is_shared_by_them():
    np.testing.assert_allclose(marked(np.array([0.1, 0.23]), 5, 10.0), [0, 1, 0.7, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(marked(np.array([-0.1, 0.4, 0.45]), 5, 10.0), [0, 0, 0, 0, 1], atol=1e-12)


def test_known_bars_give_the_downbeats_and_else_the_strongest_place():
    beats = metronome(np.ones(16), first=0.5, duration=SECONDS, bar_places=[0, 1, 2, 3] * 4)
    down = music_features(clicks(beats.times), beats)[:, CHANNELS.index("downbeat")]
    np.testing.assert_array_equal(np.flatnonzero(down), [5, 25, 45, 65])
    assert np.flatnonzero(accented_place(metronome([1, 1, 3, 1] * 3))).tolist() == [2, 6, 10]
    assert not accented_place(silent()).any()


def test_an_a_sounds_in_the_channel_of_a():
    chroma = music_features(tone(440.0), silent())[:, 3:]
    assert (chroma.argmax(axis=1) == CHANNELS.index("A") - 3).mean() >= 0.95


def test_two_sample_rates_agree():
    clip = synthetic_clip("waltz", seconds=SECONDS, seed=2)
    samples = np.asarray(clip.audio.samples, float)
    twice = Audio(soxr.resample(samples, clip.audio.sample_rate, 2 * clip.audio.sample_rate, quality="VHQ"), 2 * RATE)
    one, other = (music_features(audio, clip.beats) for audio in (clip.audio, twice))
    assert np.abs(one - other[: len(one)]).max() < 0.05


def test_half_as_loud_is_the_same_music():
    clip = synthetic_clip("tango", seconds=SECONDS, seed=1)
    half = Audio(np.asarray(clip.audio.samples, float) / 2, clip.audio.sample_rate)
    for hear in (lambda audio: music_features(audio, clip.beats), mel_features):
        np.testing.assert_allclose(hear(half), hear(clip.audio), atol=1e-3)


def test_a_second_call_reads_what_the_first_kept(monkeypatch: pytest.MonkeyPatch):
    audio = tone(300.0)
    first = music_features(audio, silent())
    monkeypatch.setattr(module, "_listen", lambda *_: pytest.fail("it was listened to again"))
    np.testing.assert_array_equal(music_features(audio, silent()), first)


@pytest.mark.parametrize("seconds", [0.01, 0.3, 1.0])
def test_short_and_silent_sounds_have_features_of_their_length(seconds: float):
    for samples in (np.zeros(int(seconds * RATE)), np.random.default_rng(1).normal(0, 0.1, int(seconds * RATE))):
        audio = Audio(samples, RATE)
        features = music_features(audio, track([], duration=seconds))
        assert features.shape == (np.ceil(seconds * 10), 15)
        assert np.isfinite(features).all() and features.min() >= 0 and features.max() <= 1
        assert np.isfinite(mel_features(audio)).all()
