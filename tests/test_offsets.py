"""The offset between sound and motion, found again where it was planted; attacks of the music's beats."""

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import soxr
from scipy.signal import butter, sosfilt

from harmolab.beats.audio import audio_beats
from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.explain.offset import attack_beats, find_offset, find_sound_offset, picture_motion, rest_at_beats
from harmolab.lab.render.stick import render_skeleton
from harmolab.params import DANCES, HarmonyParams
from harmolab.types import Audio, BeatTrack, Clip, Motion
from tests.builders import cases, refused

SECONDS = 12.0


def cut(dance: str, seed: int) -> tuple[Clip, float]:
    """A clip whose motion starts at a random frame of the first two seconds, and the audio time of that frame."""
    clip = synthetic_clip(dance, seconds=SECONDS, seed=seed)
    frame = int(np.random.default_rng([seed, *dance.encode()]).integers(0, 121))
    start = frame / clip.motion.fps
    return Clip(clip.name, clip.audio, clip.motion.span(start, SECONDS - start), start, "synthetic", clip.beats), start


def miss(found: float, start: float, beats: BeatTrack) -> float:
    """Distance from the planted offset, modulo the planted beat."""
    period = float(np.diff(beats.times).mean())
    return abs((found - start + period / 2) % period - period / 2)


@pytest.mark.slow
def test_offset_is_found_within_40_ms_modulo_the_beat_in_95_of_100_clips():
    tracked, planted = [], []
    for dance, seed in itertools.product(DANCES, range(4)):
        clip, start = cut(dance, seed)
        tracked.append(miss(find_offset(clip.audio, clip.motion).seconds, start, clip.beats))
        planted.append(miss(find_offset(clip.audio, clip.motion, music=clip.beats).seconds, start, clip.beats))
    assert len(tracked) == 28
    assert np.mean(np.array(tracked) <= 0.04) >= 0.95
    assert np.mean(np.array(planted) <= 0.02) >= 0.95


@cases("dance, paused", ("cha-cha", 0), ("waltz", 0), ("cha-cha", 6))
def test_planted_offset_is_one_of_the_candidates_and_the_one_nearest_to_the_guess_is_taken(dance: str, paused: int):
    clip, start = cut(dance, 3)
    period, numbers = np.diff(clip.beats.times).mean(), np.arange(len(clip.beats))
    clip = replace(clip, beats=clip.beats.select((numbers < 9) | (numbers >= 9 + paused)))
    offset = find_offset(clip.audio, clip.motion, music=clip.beats)
    assert min(abs(candidate - start) for candidate in (offset.seconds, *offset.alternatives)) < 0.02
    assert offset.period == pytest.approx(period, rel=0.01)
    assert offset.confidence >= 0.95
    near = find_offset(clip.audio, clip.motion, music=clip.beats, guess=start + 0.1, search=1.0)
    assert near.seconds == pytest.approx(start, abs=0.02)
    beats = (np.array(offset.alternatives) - offset.seconds) / offset.period
    np.testing.assert_allclose(beats, beats.round(), atol=1e-9)
    assert 0 not in beats.round()
    assert all(-2.0 <= candidate <= 2.0 for candidate in offset.alternatives)


def test_motion_that_started_before_the_music_has_a_negative_offset():
    clip = synthetic_clip("rumba", seconds=SECONDS, seed=2)
    audio = clip.audio.span(1.5, SECONDS)
    offset = find_offset(audio, clip.motion, music=clip.beats.span(1.5, audio.duration), guess=-1.45)
    assert offset.seconds == pytest.approx(-1.5, abs=0.02)


def test_lag_of_the_dancer_is_taken_off():
    clip = synthetic_clip("waltz", seconds=SECONDS, seed=2, lateness=0.1)
    params = replace(HarmonyParams.recommended(), lag=0.1)
    assert find_offset(clip.audio, clip.motion, music=clip.beats, params=params).seconds == pytest.approx(0, abs=0.02)
    assert find_offset(clip.audio, clip.motion, music=clip.beats).seconds == pytest.approx(-0.1, abs=0.02)


def test_dancer_at_another_tempo_gives_no_confidence():
    clip = synthetic_clip("cha-cha", seconds=20.0, tempo=120.0, seed=4)
    other = synthetic_clip("cha-cha", seconds=20.0, tempo=105.0, seed=5)
    assert find_offset(clip.audio, other.motion, music=clip.beats).confidence < 0.95


def test_evidence_is_the_slowness_at_the_beats():
    times = np.arange(0.0, 6.0, 0.01)
    curve = rest_at_beats(times, np.abs(np.sin(np.pi * times)), np.arange(6) + 0.5, np.array([0.0, 0.25, 0.5]))
    np.testing.assert_allclose(curve, [-1.0, -np.sqrt(0.5), 0.0], atol=1e-3)


def test_lags_at_which_few_beats_fall_into_the_motion_have_no_evidence():
    times = np.arange(0.0, 5.0, 0.01)
    curve = rest_at_beats(times, np.cos(times), np.arange(8.0), np.array([0.0, 6.0]))
    assert np.isfinite(curve).tolist() == [True, False]


def test_motion_that_stands_still_silence_and_an_impossible_search_are_refused():
    clip = synthetic_clip("waltz", seed=1)
    film = picture_motion(np.zeros((250, 32, 32), np.uint8), 25.0)
    for still in (Motion(np.zeros((600, 2, 3)), 60.0, Skeleton.unnamed(2)), film):
        refused("nothing moves in this motion", find_offset, clip.audio, still, music=clip.beats)
    refused("fewer than 4 music beats .* is there music", find_offset, Audio(np.zeros(22050 * 6), 22050), clip.motion)
    refused("a harmolab.HarmonyParams is needed", find_offset, clip.audio, clip.motion, params="paper")
    refused("a video of 3 frames is too short", picture_motion, np.zeros((3, 32, 32), np.uint8), 25.0)
    message = "search must lie between 0 and 600 s"
    for search in (0.0, -1.0, float("nan"), 1e9):
        refused(message, find_offset, clip.audio, clip.motion, music=clip.beats, search=search)


def lateness(beats: BeatTrack, times: np.ndarray) -> float:
    """Median distance of beats behind the nearest of these times."""
    late = beats.times[:, None] - times
    return float(np.median(late[np.arange(len(beats)), np.abs(late).argmin(axis=1)]))


@pytest.mark.parametrize("sample_rate", [22050, 44100])
def test_beats_are_moved_to_the_attack_of_clicks(click_track: Callable[..., Audio], sample_rate: int):
    audio = click_track(113.0, seconds=12.0, sample_rate=sample_rate)
    planted = np.arange(0.0, 12.0, 60 / 113)

    assert abs(lateness(audio_beats(audio), planted)) < 0.02
    assert abs(lateness(attack_beats(audio), planted)) < 0.006


def test_silence_has_no_attacks():
    assert len(attack_beats(Audio(np.zeros(22050), 22050))) == 0


# A video


@pytest.mark.parametrize("fps", [25.0, 50.0])
def test_picture_rests_when_the_skeleton_does(planted_clip: Clip, fps: float):
    motion = picture_motion(render_skeleton(planted_clip.motion, height=120, fps=fps), fps)
    assert motion.duration == pytest.approx(planted_clip.motion.duration, abs=2 / fps)
    seen = visual_beats(motion, params=HarmonyParams.recommended())
    skeleton = visual_beats(planted_clip.motion, params=HarmonyParams.recommended())
    assert len(seen) >= 0.8 * len(skeleton)
    assert abs(lateness(seen, skeleton.times)) < 0.015


def test_offset_of_a_video_is_found_modulo_the_beat():
    clip, start = cut("tango", 3)
    motion = picture_motion(render_skeleton(clip.motion, height=120, fps=25.0), 25.0)
    found = find_offset(clip.audio, motion, music=clip.beats)
    assert miss(found.seconds, start, clip.beats) < 0.03
    assert found.confidence >= 0.95


# Sound


@pytest.fixture(scope="module")
def song() -> Audio:
    """Chords that never come back, and notes at random: no two places sound alike."""
    rng = np.random.default_rng(8)
    time = np.arange(round(30.0 * 22050)) / 22050
    samples = np.zeros(time.size)
    for start in np.sort(rng.uniform(0, 29.5, 120)):
        inside = (time >= start) & (time < start + 0.4)
        envelope = np.exp(-(time[inside] - start) / 0.1)
        for hertz in rng.uniform(100, 3500, 3):
            samples[inside] += 0.1 * envelope * np.sin(2 * np.pi * hertz * time[inside])
    return Audio(samples, 22050)


def recorded(song: Audio, start: float, seconds: float, rate: int, *, snr: float, seed: int = 0) -> Audio:
    """What a phone makes of a song: another rate, no bass and no treble, too loud, and noise (decibels below it)."""
    part = song.span(start, seconds).samples.astype(np.float64)
    part = soxr.resample(part, song.sample_rate, rate)
    part = sosfilt(butter(2, [200, min(5000, 0.45 * rate)], "band", fs=rate, output="sos"), part)
    noise = np.random.default_rng(seed).normal(0, part.std() * 10 ** (-snr / 20), part.size)
    return Audio(np.tanh(2 * (part + noise) / part.std()), rate)


@cases("rate, snr", (8000, 0.0), (22050, 30.0), (48000, 0.0))
def test_recording_is_found_in_its_song_through_noise_filter_and_another_rate(song: Audio, rate: int, snr: float):
    for start in (0.0, 7.123, 17.9):
        found = find_sound_offset(recorded(song, start, 10.0, rate, snr=snr), song)
        assert found.seconds == pytest.approx(start, abs=0.01)
        assert found.is_clear and found.is_unique


def test_recording_that_begins_before_the_song_has_a_negative_offset(song: Audio):
    samples = np.concatenate([np.zeros(2 * 22050), song.samples[: 8 * 22050]])
    samples = samples + np.random.default_rng(1).normal(0, 0.01, samples.size)
    assert find_sound_offset(Audio(samples, 22050), song).seconds == pytest.approx(-2.0, abs=0.01)


def test_recording_of_something_else_is_not_clear(song: Audio):
    backwards = Audio(song.samples[::-1], song.sample_rate)
    assert not find_sound_offset(recorded(backwards, 5.0, 10.0, 22050, snr=30.0), song).is_clear
    assert not find_sound_offset(Audio(np.random.default_rng(2).normal(0, 0.1, 10 * 22050), 22050), song).is_clear


def test_song_that_repeats_itself_to_the_note_is_found_but_not_unique(song: Audio):
    twice = Audio(np.tile(song.samples[: 12 * 22050], 2), 22050)
    found = find_sound_offset(twice.span(2.0, 6.0), twice)
    assert found.seconds % 12 == pytest.approx(2.0, abs=0.01)
    assert (found.is_clear, found.is_unique) == (True, False)


def test_short_and_silent_sound_are_refused(song: Audio):
    refused(r"the recording lasts 2\.0 s; 3 s at least", find_sound_offset, song.span(0, 2.0), song)
    refused(r"the song lasts 1\.0 s", find_sound_offset, song, song.span(0, 1.0))
    refused("the recording is silent", find_sound_offset, Audio(np.zeros(22050 * 5), 22050), song)
