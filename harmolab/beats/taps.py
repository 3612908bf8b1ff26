"""Beats out of the taps of a person who listens: one tempo and phase through all taps, mended by the sound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from harmolab.beats.audio import audio_beats, beat_strengths, sounding_span
from harmolab.beats.steady import NEAR, STEADY, Grid
from harmolab.io.arrays import number_array
from harmolab.io.beats import ANNOTATION_RATE
from harmolab.types import Audio, BeatTrack, FloatArray

FEWEST = 8  # taps
MOST = 20_000
REFINED = 0.06  # seconds within which the sound's phase is believed rather than the taps'; people differ by as much
LEAST_UNITY = 0.6  # length of the mean of the taps as arrows on the beat's circle; a jitter of 16 % of a beat has .6
SHORTEST = 0.15  # seconds between two taps: less is one tap that the key counted twice
SEARCH = 0.06  # part of the tempo by which the tempo of all taps may differ from their median interval
SAME_TEMPO = 0.02  # part of the tempo by which the sound's may differ from that of the taps


class TappedBeats(NamedTuple):
    """The beats of a whole song, and a remark on what the taps left open."""

    track: BeatTrack
    remark: str


def tapped_beats(audio: Audio, taps: FloatArray, ones: FloatArray, *, meter: int = 4) -> TappedBeats:
    """The beats of a song from taps to a part of it, extended from its first to its last sound.

    Double and missed taps do no harm. Where the sound has a steady grid of the tapped tempo, the beats take its period,
    and its phase too if that lies within 60 ms of the taps: a person's constant delay, and the machine's, cannot be
    told from a beat that lies elsewhere.

    Parameters
    ----------
    audio : Audio, the whole song
    taps : (K,) array, seconds of audio time, in any order
    ones : (D,) array, seconds, taps on the first beat of a bar; without any, bar places are unknown
    meter : int, beats in a bar

    Raises
    ------
    ValueError
        For fewer than 8 taps, more than 20,000, times outside the song, a meter below 1, or taps that keep no tempo.
    """
    taps, ones = (_moments(values, name, audio.duration) for values, name in ((taps, "taps"), (ones, "ones")))
    if not 1 <= meter <= 32:
        raise ValueError(f"a bar has 1 to 32 beats, got {meter}")
    grid, remark = _by_sound(audio, taps, tap_grid(taps))
    start, end = sounding_span(audio)
    times = grid.beats(max(start - NEAR, 0.0), end)
    if times.size < 2:
        raise ValueError("the song has no two beats at the tapped tempo")
    places = None
    if ones.size:
        numbers = np.round((ones - times[0]) / grid.period).astype(np.int64)
        votes = np.bincount(numbers % meter, minlength=meter)
        places = (np.arange(times.size) - int(votes.argmax())) % meter
        if votes.max() < ones.size:
            remark += f' {votes.max()} of {ones.size} "ones" agree on where a bar of {meter} beats begins.'
    strengths = beat_strengths(audio, times)
    return TappedBeats(BeatTrack(times, strengths, ANNOTATION_RATE, audio.duration, places), remark.strip())


def tap_grid(taps: FloatArray) -> Grid:
    """The line through taps: first + k period, k whole, with each tap's k its nearest; taps far off do not count.

    The period is first that on whose circle the taps point one way, so pauses, doubles and misses do not matter.

    Raises
    ------
    ValueError
        For fewer than 8 taps, or taps that keep no tempo.
    """
    taps = np.unique(taps)
    taps = taps[np.diff(taps, prepend=-np.inf) >= SHORTEST]
    if taps.size < FEWEST:
        raise ValueError(f"{taps.size} taps are too few; tap {FEWEST} beats or more")
    span = float(np.ptp(taps))
    tempo = 1.0 / float(np.median(np.diff(taps)))
    frequencies = np.arange(tempo * (1 - SEARCH), tempo * (1 + SEARCH), 1 / (20 * span))
    arrows = np.array([np.exp(2j * np.pi * frequency * taps).mean() for frequency in frequencies])
    best = int(np.abs(arrows).argmax())
    if np.abs(arrows[best]) < LEAST_UNITY:
        raise ValueError("the taps keep no steady tempo; start again and tap every beat for ten seconds or more")
    grid = Grid(float(np.angle(arrows[best]) / (2 * np.pi * frequencies[best])), 1.0 / float(frequencies[best]), 0.0)
    near = taps[np.abs(grid.deviations(taps)) < grid.period / 4]
    period, first = np.polyfit(np.round((near - grid.first) / grid.period), near, 1)
    return Grid(float(first), float(period), float(np.abs(arrows[best])))


def _by_sound(audio: Audio, taps: FloatArray, grid: Grid) -> tuple[Grid, str]:
    """The grid of the beats: that of the taps, mended by the sound's where that is steady; and a remark."""
    tempo = 60.0 / grid.period
    track = audio_beats(audio, tempo=(tempo * (1 - SAME_TEMPO), tempo * (1 + SAME_TEMPO)))
    is_steady = track.quality is not None and track.quality >= STEADY and len(track) > 1
    if not is_steady or abs(track.tempo / tempo - 1) > SAME_TEMPO:
        return grid, "No steady grid was heard at your tempo: far from your taps the beats may drift."
    sound = Grid(float(track.times[0]), 60.0 / track.tempo, 0.0)
    late = float(np.median(sound.deviations(taps)))
    if abs(late) <= REFINED:
        return sound, ""
    side = "after" if late > 0 else "before"
    remark = f"Your taps lie {1000 * abs(late):.0f} ms {side} the sound's own beats and were left there."
    return sound._replace(first=sound.first + late), remark


def _moments(values: FloatArray, name: str, duration: float) -> FloatArray:
    """Times in a song, checked."""
    times = number_array(values, name, (None,))
    if times.size > MOST:
        raise ValueError(f"{times.size} {name} are more than {MOST}")
    if not (np.isfinite(times).all() and (times >= 0).all() and (times <= duration).all()):
        raise ValueError(f"{name} must lie in the song, between 0 and {duration:.1f} s")
    return times
