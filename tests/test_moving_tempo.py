"""Tempo that moves: beats follow it, so does a dancer who is in time, and where nothing has beats they are unsure."""

import mir_eval
import numpy as np
import pytest

from harmolab.beats.audio import audio_beats
from harmolab.beats.meter import describe_beats
from harmolab.beats.tempo import free_path, smooth_course, stiff_path, window_accents
from harmolab.data.synthetic.music import PlantedMusic, synthetic_music
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import Audio, FloatArray
from harmolab.verdict.evidence import time_test
from tests.builders import waving

RATE = 50.0  # hertz, of accents
SAMPLE_RATE = 22050


def clicks(times: FloatArray, seconds: float, heights: FloatArray | None = None) -> Audio:
    """Clicks in faint noise."""
    samples = np.random.default_rng(2).normal(0, 1e-3, round(seconds * SAMPLE_RATE))
    decay = np.arange(1000) / SAMPLE_RATE
    click = np.sin(2 * np.pi * 1000 * decay) * np.exp(-decay / 0.01)
    for time, height in zip(times, np.ones(times.size) if heights is None else heights, strict=True):
        part = samples[round(time * SAMPLE_RATE) :][: click.size]
        part += height * click[: part.size]
    return Audio(samples, SAMPLE_RATE)


def through(intervals: FloatArray, first: float = 0.4) -> FloatArray:
    """Times from the first on, with these intervals between them."""
    return first + np.concatenate([[0.0], np.cumsum(intervals)])


def accented(times: FloatArray, seconds: float) -> FloatArray:
    """Accents of height 10 at these times, Gaussians of 20 ms."""
    moments = np.arange(0, seconds, 1 / RATE)
    return 10 * np.exp(-0.5 * ((moments[:, None] - times) / 0.02) ** 2).sum(axis=1)


def f_measure(beats: FloatArray, audio: Audio) -> float:
    """mir_eval's, within 70 ms, of the tracked beats."""
    return float(mir_eval.beat.f_measure(beats, audio_beats(audio).times))


@pytest.fixture(scope="module")
def accelerando() -> PlantedMusic:
    """A band that goes from 100 to 128 beats per minute."""
    return synthetic_music("rumba", seconds=60.0, tempo=114.0, drift=28 / 114, seed=1)


def test_an_accelerando_is_followed_and_told(accelerando: PlantedMusic):
    track = audio_beats(accelerando.audio)
    assert mir_eval.beat.f_measure(accelerando.beats.times, track.times) > 0.95
    assert track.is_sure
    assert "followed beat by beat from 101 to 127 bpm" in describe_beats(track)


def test_a_dancer_who_rests_on_the_beats_of_an_accelerando_is_in_time_with_the_tracked_ones(accelerando: PlantedMusic):
    frames = np.arange(60 * 30) / 30
    motion = waving(np.interp(frames, accelerando.grid.times, np.arange(accelerando.grid.times.size, dtype=float)))
    beats = audio_beats(accelerando.audio).times
    assert time_test(shape_signal(shape_speed(motion), beats[0], beats[-1]), beats).p_value < 0.01


def test_music_of_one_tempo_stays_on_one_grid():
    track = audio_beats(synthetic_music("cha-cha", seconds=40.0, tempo=118.0, seed=2).audio)
    assert np.ptp(np.diff(track.times)) < 1e-9
    assert track.fit == 1
    assert "steady (100%" in describe_beats(track)


@pytest.mark.parametrize(("first", "second"), [(100, 118), (120, 96)])
def test_a_sudden_change_of_tempo_is_followed(first: float, second: float):
    beats = through(np.repeat([60 / first, 60 / second], [first // 2, second // 2]))
    audio = clicks(beats, 60.8)
    assert f_measure(beats, audio) > 0.97
    assert audio_beats(audio).is_sure


def test_a_ballad_whose_tempo_comes_and_goes_is_followed():
    tempi = 76 * (1 + 0.08 * np.sin(np.arange(70) * 0.55) + 0.05 * np.sin(np.arange(70) * 0.93))
    beats = through(60 / tempi)
    audio = clicks(beats, float(beats[-1]) + 0.5)
    assert f_measure(beats, audio) > 0.95
    assert audio_beats(audio).is_sure
    assert "followed beat by beat between" in describe_beats(audio_beats(audio))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_has_unsure_beats(seed: int):
    track = audio_beats(Audio(np.random.default_rng(seed).normal(0, 0.1, 40 * SAMPLE_RATE), SAMPLE_RATE))
    assert len(track) > 40
    assert not track.is_sure
    assert "of 40 s the sound does not keep to these beats" in describe_beats(track)


@pytest.mark.parametrize("rate", [1.5, 3.0, 6.0])
def test_blows_at_random_have_unsure_beats(rate: float, rng: np.random.Generator):
    times = np.sort(rng.uniform(0, 60, round(60 * rate)))
    assert not audio_beats(clicks(times, 60.0, rng.uniform(0.2, 1, times.size))).is_sure


def test_music_that_loses_its_beat_for_half_its_time_is_unsure(rng: np.random.Generator):
    half = np.arange(0.4, 30.0, 0.5)
    assert not audio_beats(clicks(np.concatenate([half, np.sort(rng.uniform(30, 60, 120))]), 60.0)).is_sure


def test_a_pause_does_not_make_beats_unsure():
    beats = np.arange(0.4, 60.0, 0.5)
    track = audio_beats(clicks(beats[(beats < 25) | (beats > 33)], 60.0))
    assert track.is_sure
    assert "steady (100%" in describe_beats(track)


def test_a_free_path_goes_through_a_tempo_that_a_stiff_one_loses():
    beats = through(60 / np.linspace(90, 126, 70))
    seconds = float(beats[-1]) + 0.5
    curve, span = accented(beats, seconds), (0.0, seconds)
    base = np.arange(-0.2, seconds + 0.6, 60 / 108)
    free, stiff = free_path(curve, RATE, 60 / 108, span), stiff_path(curve, RATE, base, span)
    assert mir_eval.beat.f_measure(beats, free) > 0.98
    assert mir_eval.beat.f_measure(beats, stiff) < 0.9


def test_a_free_path_leaves_out_no_beat_and_adds_none_where_the_music_is_silent():
    beats = np.arange(0.5, 40.0, 0.5)
    curve = accented(beats[(beats < 15) | (beats > 20)], 40.0)
    np.testing.assert_allclose(free_path(curve, RATE, 0.5, (0.3, 39.8)), beats, atol=0.03)


def test_accents_at_the_beats_of_a_window_are_told_over_the_mean():
    # Gaussians of 20 ms every 500, read under a Gaussian of 20 ms; straight lines between samples cut their tops.
    beats = np.arange(0.25, 40.0, 0.5)
    curve = accented(beats, 40.0)
    expected = 0.5 / (0.02 * np.sqrt(2 * np.pi) * np.sqrt(2))
    on, off = (window_accents(curve, RATE, beats + late, (0.0, 40.0)) for late in (0.0, 0.25))
    assert on.size == 9  # 8 s each, every 4 s
    np.testing.assert_allclose(on, expected, rtol=0.1)
    assert off.max() < 0.01


def test_silent_windows_have_no_fit_and_windows_without_a_beat_none_at_all():
    beats = np.arange(0.25, 16.0, 0.5)
    curve = np.concatenate([accented(beats, 16.0), np.zeros(round(16 * RATE))])
    values = window_accents(curve, RATE, beats[beats < 8], (0.0, 32.0))
    assert values.size == 4  # the last of those that begin every 4 s holds 4 s of sound
    assert values[0] > 5
    assert (values[2:] == 0).all()


def test_a_smooth_course_keeps_a_tempo_that_drifts_and_takes_off_what_jumps():
    drifting = through(np.linspace(0.6, 0.5, 60))
    np.testing.assert_allclose(smooth_course(drifting), drifting, atol=1e-3)
    rough = drifting + 0.04 * (-1.0) ** np.arange(61)
    assert np.abs(smooth_course(rough) - drifting)[4:-4].max() < 0.01
    np.testing.assert_array_equal(smooth_course(drifting[:5]), drifting[:5])
