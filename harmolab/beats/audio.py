"""Audio to beats by librosa onset strength and tempo (Eq. 2-3). The whole track is tracked once, then sliced.

Analysis is cached on disk under a hash of the samples, so a song is listened to once; see `harmolab.io.files`.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from harmolab.beats.meter import accented_places, cycle_of_meter
from harmolab.io.files import cached_arrays, keep_arrays
from harmolab.params import DANCES
from harmolab.types import Audio, BeatTrack, Clip, FloatArray

HOP = 512  # samples between onset strengths
CACHE_VERSION = 2  # raise when the analysis changes
LOUDEST = 1e6  # amplitude above which squares might overflow in single precision


def tempo_range(tempo: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """A tempo prior in beats per minute from a dance's name or a range.

    Raises
    ------
    ValueError
        For an unknown dance, or a range that is not 0 < low < high.
    """
    if tempo is None:
        return None
    if isinstance(tempo, str):
        if tempo not in DANCES:
            raise ValueError(f"unknown dance {tempo!r}; known: {', '.join(DANCES)}")
        return DANCES[tempo].tempo
    low, high = map(float, tempo)
    if not 0 < low < high < 1000:
        raise ValueError(f"a tempo range is two rising numbers in beats per minute, got {tempo}")
    return low, high


def audio_beats(audio: Audio, *, tempo: str | tuple[float, float] | None = None) -> BeatTrack:
    """Music beats p_a with strengths s_a (Eq. 2-3): librosa's tracker, strength = onset envelope at the beat.

    Parameters
    ----------
    audio : Audio
        The whole recording. Beats of separate 6 s pieces agree with those of the whole at F = .71 only.
    tempo : dance name or (low, high) beats per minute, optional
        Prior of the tempo; without one librosa is off by more than 5 % in a third of the dance recordings we have. A
        dance also tells the meter, so beats get their place in the half bar (4/4) or bar (3/4) by their accents.

    Returns
    -------
    BeatTrack; empty for silence.
    """
    bounds = tempo_range(tempo)
    envelope, beats = _cached_analysis(audio, bounds)
    frames = beats[beats < envelope.size]
    rate = audio.sample_rate / HOP
    times = frames.astype(np.float64) * (HOP / audio.sample_rate)
    inside = times <= audio.duration
    strengths = envelope[frames[inside]]
    places = accented_places(strengths, cycle_of_meter(DANCES[tempo].meter)) if isinstance(tempo, str) else None
    return BeatTrack(times[inside], strengths, rate, audio.duration, places)


def music_beats(clip: Clip) -> BeatTrack:
    """The music beats of a clip on its audio's time line: its annotated ones, else those of `audio_beats`.

    The clip's dance, where it is one of `DANCES`, is the prior of the tempo.
    """
    if clip.beats is not None:
        return clip.beats
    return audio_beats(clip.audio, tempo=clip.dance if clip.dance in DANCES else None)


def onset_envelope(audio: Audio) -> tuple[FloatArray, float]:
    """Onset strength g of Eq. 2, (F,) array, and its rate in hertz."""
    return _cached_analysis(audio, None)[0], audio.sample_rate / HOP


def beat_strengths(audio: Audio, times: FloatArray) -> FloatArray:
    """Onset strength at given times (seconds): the largest of the three frames around each, (B,) array."""
    envelope, rate = onset_envelope(audio)
    centre = np.clip(np.round(np.asarray(times) * rate).astype(np.int64), 0, envelope.size - 1)
    around = np.clip(centre[:, None] + np.array([-1, 0, 1]), 0, envelope.size - 1)
    return envelope[around].max(axis=1) if centre.size else np.zeros(0)


def _cached_analysis(audio: Audio, bounds: tuple[float, float] | None) -> tuple[FloatArray, NDArray[np.int64]]:
    """Envelope and beat frames, from the cache when they are there and sound."""
    key = _key(audio, bounds)
    stored = _sound(cached_arrays(key))
    if stored is None:
        compile_tracker()
        stored = _analyse(audio, bounds)
        keep_arrays(key, {"envelope": stored[0], "beats": stored[1]})
    return stored


def _sound(arrays: Mapping[str, NDArray[Any]] | None) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Envelope and beats out of the cache; None when it holds anything else."""
    if arrays is None:
        return None
    try:
        envelope, beats = arrays["envelope"].astype(np.float64), arrays["beats"].astype(np.int64)
    except (KeyError, ValueError):
        return None
    whole = envelope.ndim == beats.ndim == 1 and np.isfinite(envelope).all() and (envelope >= 0).all()
    return (envelope, beats) if whole and (beats >= 0).all() and (np.diff(beats) > 0).all() else None


def _key(audio: Audio, bounds: tuple[float, float] | None) -> str:
    """Content hash: samples, rate, tempo prior, version of the analysis."""
    digest = hashlib.sha256(f"{CACHE_VERSION} {audio.sample_rate} {bounds} {HOP}".encode())
    digest.update(_samples(audio).data)
    return digest.hexdigest()[:40]


def _samples(audio: Audio) -> NDArray[np.float32]:
    """Samples in single precision; absurdly loud ones are scaled down, which moves no onset."""
    peak = float(np.abs(audio.samples).max())
    return np.ascontiguousarray(audio.samples / peak if peak > LOUDEST else audio.samples, dtype=np.float32)


@cache
def compile_tracker() -> None:
    """Have librosa's numba functions compiled and loaded, one process at a time; quick after the first call.

    numba's cache breaks for good when two processes fill it at the same moment: every later run would crash.
    """
    import librosa

    samples = np.sin(np.arange(3 * 22050) / 50.0) * (np.arange(3 * 22050) % 11025 < 1000)
    name = f"harmolab-compile-{os.environ.get('USER', 'user')}.lock"
    with suppress(OSError), FileLock(Path(tempfile.gettempdir()) / name, timeout=300):
        _analyse(Audio(samples, 22050.0), None)
        librosa.beat.beat_track(y=samples.astype(np.float32), sr=22050)  # as others call it: in single precision


def _analyse(audio: Audio, bounds: tuple[float, float] | None) -> tuple[FloatArray, NDArray[np.int64]]:
    """Onset strength and beat frames by librosa."""
    import librosa

    samples = _samples(audio)
    # At least one analysis window, so that a sound of a few milliseconds is analysed like any other.
    samples = np.pad(samples, (0, max(0, 4 * HOP - samples.size)))
    rate = audio.sample_rate
    envelope = librosa.onset.onset_strength(y=samples, sr=rate, hop_length=HOP)
    envelope = np.nan_to_num(envelope, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float64)
    if not envelope.any():
        return envelope, np.zeros(0, dtype=np.int64)
    tempo = _tempo(envelope, rate / HOP, bounds)
    if not 0 < tempo <= 60 * rate / HOP:
        return envelope, np.zeros(0, dtype=np.int64)
    _, beats = librosa.beat.beat_track(onset_envelope=envelope, sr=rate, hop_length=HOP, bpm=tempo)
    return envelope, np.asarray(beats, dtype=np.int64)


def _tempo(envelope: FloatArray, rate: float, bounds: tuple[float, float] | None) -> float:
    """Tempo in beats per minute from an onset envelope of `rate` hertz, within `bounds` when there are any.

    librosa knows only tempi whose beat is a whole number of envelope samples; when none lies within the bounds (119 to
    121 at 43 Hz, or any range at a low sample rate) it is the middle of the bounds.
    """
    import librosa
    from scipy.stats import uniform

    prior: Any = None if bounds is None else uniform(bounds[0], bounds[1] - bounds[0])
    tempo = float(np.ravel(librosa.feature.tempo(onset_envelope=envelope, sr=rate, hop_length=1, prior=prior))[0])
    if bounds is not None and not bounds[0] <= tempo <= bounds[1]:
        return (bounds[0] + bounds[1]) / 2
    return tempo if np.isfinite(tempo) else 0.0
