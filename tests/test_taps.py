"""Taps of a person: planted tempo, phase and "one" come back from sloppy taps, mended by the sound."""

from collections.abc import Callable

import numpy as np
import pytest

from harmolab.beats.audio import with_clicks
from harmolab.readers.beats import tap_grid, tapped_beats
from harmolab.types import Audio
from tests.builders import cases, refused, track

Clicks = Callable[..., Audio]
NOTHING = np.zeros(0)


def sloppy(beats: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Taps with a jitter of 25 ms, one in eight missed, some double."""
    taps = beats + rng.normal(0, 0.025, beats.size)
    taps = taps[rng.random(beats.size) > 1 / 8]
    return np.sort(np.concatenate([taps, taps[::7] + 0.07]))


@pytest.mark.parametrize("tempo", [62.0, 118.3, 190.0])
def test_sloppy_taps_give_their_tempo_and_phase(tempo: float, rng: np.random.Generator):
    beats = 3.21 + 60 / tempo * np.arange(40)
    grid = tap_grid(sloppy(beats, rng))
    assert 60 / grid.period == pytest.approx(tempo, rel=0.005)
    assert np.abs(grid.deviations(beats)).max() < 0.03


def test_a_pause_of_half_a_minute_between_taps_does_no_harm(rng: np.random.Generator):
    beats = 0.4 + 0.5 * np.concatenate([np.arange(20), np.arange(80, 100)])
    assert tap_grid(beats + rng.normal(0, 0.02, beats.size)).period == pytest.approx(0.5, abs=2e-4)


def test_a_key_that_counts_every_tap_twice_does_no_harm(rng: np.random.Generator):
    taps = 0.4 + 0.5 * np.arange(30) + rng.normal(0, 0.02, 30)
    for delay in (1e-9, 0.03, 0.1):
        assert tap_grid(np.concatenate([taps, taps + delay])).period == pytest.approx(0.5, abs=2e-3)


@cases(
    "taps, fault",
    (np.arange(7) * 0.5, "7 taps are too few; tap 8 beats or more"),
    (np.ones(20), "1 taps are too few"),
    (np.cumsum([0.3, 0.9, 0.5, 1.4, 0.35, 0.8, 1.1, 0.45, 0.6, 1.3, 0.7, 0.4]), "keep no steady tempo"),
)
def test_taps_that_keep_no_tempo_are_refused(taps: np.ndarray, fault: str):
    refused(fault, tap_grid, taps)


def test_taps_to_a_part_become_beats_of_the_whole_song_where_it_sounds(click_track: Clicks, rng: np.random.Generator):
    # Clicks of 113 a minute for a minute, tapped for ten seconds, 40 ms late; silence at both ends has no beats.
    clicks = click_track(113, seconds=60.0).samples
    audio = Audio(np.concatenate([np.zeros(22050), clicks, np.zeros(3 * 22050)]), 22050)
    beats = 1.0 + 60 / 113 * np.arange(113)
    result = tapped_beats(audio, sloppy(beats[30:50], rng) + 0.04, beats[[33, 36]] + 0.04, meter=3)
    assert len(result.track) == 113
    assert np.abs(result.track.times - beats).max() < 0.02
    assert result.track.bar_places.tolist() == (np.arange(113) % 3).tolist()
    assert result.track.quality is None
    assert result.remark == ""


def test_taps_between_the_beats_of_the_sound_stay_there_and_it_is_said(click_track: Clicks):
    result = tapped_beats(click_track(120, seconds=30.0), 5.2 + 0.5 * np.arange(20), NOTHING)
    assert np.median(np.mod(result.track.times, 0.5)) == pytest.approx(0.2, abs=0.02)
    assert "ms after the sound's own beats and were left there" in result.remark
    assert result.track.bar_places is None


def test_where_no_grid_is_heard_the_taps_alone_count_and_it_is_said(rng: np.random.Generator):
    result = tapped_beats(Audio(0.1 * rng.normal(size=30 * 22050), 22050), 5.2 + 0.61 * np.arange(20), NOTHING)
    np.testing.assert_allclose(result.track.times, np.arange(0.32, 30.0, 0.61), atol=0.01)
    assert "far from your taps the beats may drift" in result.remark


def test_ones_that_disagree_are_outvoted_and_it_is_said(click_track: Clicks):
    beats = 0.5 * np.arange(8, 40)
    result = tapped_beats(click_track(120, seconds=30.0), beats, beats[[2, 6, 10, 15]], meter=4)
    assert result.track.bar_places[np.abs(result.track.times - beats[2]).argmin()] == 0
    assert '3 of 4 "ones" agree on where a bar of 4 beats begins.' in result.remark


@cases(
    "taps, ones, meter, fault",
    ([1.0, 99.0], [], 4, "taps must lie in the song, between 0 and 10.0 s"),
    ([1.0, float("nan")], [], 4, "taps must lie in the song"),
    ([1.0], [-1.0], 4, "ones must lie in the song"),
    ([0.5] * 20_001, [], 4, "20001 taps are more than 20000"),
    ([1.0], [], 0, "a bar has 1 to 32 beats, got 0"),
    ([[1.0]], [], 4, "taps must have shape"),
)
def test_impossible_taps_are_refused(click_track: Clicks, taps: list, ones: list, meter: int, fault: str):
    refused(fault, tapped_beats, click_track(120), np.array(taps), np.array(ones), meter=meter)


def test_clicks_lie_on_the_beats_and_are_higher_on_one():
    silent = Audio(np.zeros(22050), 22050)
    samples = with_clicks(silent, track([0.25, 0.5, 0.99], duration=1.0, bar_places=[0, 1, 0])).samples
    sounding = np.flatnonzero(np.abs(samples) > 1e-3)
    assert np.abs(sounding[0] / 22050 - 0.25) < 1e-3
    assert not ((sounding > 0.29 * 22050) & (sounding < 0.5 * 22050)).any()
    crossings = [np.count_nonzero(np.diff(np.sign(samples[start : start + 600]))) for start in (5513, 11025)]
    assert crossings[0] > 1.4 * crossings[1]
    np.testing.assert_array_equal(silent.samples, 0)
