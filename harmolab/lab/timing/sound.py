"""The offset of a recording in a song, from the sound of both: exact, and not modulo the beat.

A phone that films a dancer also records the music. Its sound is fainter, coloured by the room and full of steps, but
the moments at which each band of the spectrum sets in are those of the song. They are compared at every lag by fast
correlation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import soxr
from numpy.typing import NDArray
from scipy.signal import fftconvolve, stft

from harmolab.kinematics import refine_extrema
from harmolab.types import Audio, FloatArray

RATE = 16_000.0  # hertz, of the sound that is compared
HOP = 0.005  # seconds
WINDOW = 0.032  # seconds
BANDS = 24
LOWEST, HIGHEST = 80.0, 7000.0  # hertz
FLOOR = 1e-3  # of a band's loudest moment: 60 dB
LOCAL = 1.0  # seconds, over which loudness is made even
SHORTEST = 3.0  # seconds that both must share
APART = 0.1  # seconds: nearer lags belong to the same peak
CLEAR = 13.0  # most other songs stay below; those with a steady beat may not, but are then not unique either
GAUSSIAN = 1.4826  # standard deviations in a median absolute deviation
ALONE = 2.0  # times as high as elsewhere; other songs reached 1.6
REPEATED = 0.8


@dataclass(frozen=True)
class SoundOffset:
    """The song time at which a recording begins, and the evidence.

    Parameters
    ----------
    seconds : float
        Song time of the recording's first moment; negative where it begins before the song.
    height : float
        Evidence: how far the best lag stands above the median of all lags, in standard deviations of a Gaussian with
        their median absolute deviation (beats of one tempo make peaks of their own, which must not count as noise).
    elsewhere : float
        The same at the best lag more than 0.1 s away. A song that repeats itself to the note has a high one.
    """

    seconds: float
    height: float
    elsewhere: float

    @property
    def is_clear(self) -> bool:
        """True if the recording holds this song.

        Either the evidence is higher than most other songs reach, or no other place comes near it. A song with a
        steady beat may pass for another of a like tempo; then many places fit, and `is_unique` is False.
        """
        return self.height >= CLEAR or self.height >= ALONE * self.elsewhere

    @property
    def is_unique(self) -> bool:
        """True if no other place fits nearly as well. Else the song repeats itself, or it is another song."""
        return self.elsewhere < REPEATED * self.height


def find_sound_offset(recording: Audio, song: Audio) -> SoundOffset:
    """The song time at which a recording begins, from the sound of both.

    Loudness, sample rate and the colour of the sound may differ; the speed must be the same.

    Parameters
    ----------
    recording : Audio, such as the sound of a video
    song : Audio

    Raises
    ------
    ValueError
        One of them is shorter than three seconds, or silent.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> song = synthetic_clip("waltz", seconds=12.0, seed=7).audio
    >>> round(find_sound_offset(song.span(3.0, 6.0), song).seconds, 2)
    3.0
    """
    # A recording of 8000 Hz holds nothing above 4000: those bands would compare noise.
    highest = min(HIGHEST, 0.45 * recording.sample_rate, 0.45 * song.sample_rate)
    part, whole = _onsets(recording, "recording", highest), _onsets(song, "song", highest)
    curve = _evidence(part, whole)
    best = int(curve.argmax())
    place = float(refine_extrema(curve, np.array([best]))[0]) if 0 < best < curve.size - 1 else float(best)
    away = curve[np.abs(np.arange(curve.size) - best) > APART / HOP]
    return SoundOffset((place - (part.shape[1] - 1)) * HOP, float(curve[best]), float(away.max(initial=0.0)))


def _evidence(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Correlation at every lag, from one frame shared at the start to one at the end, in robust standard deviations.

    Lags that share too little are 0. The others are divided by the root of what is shared, as chance grows with it.
    """
    length = part.shape[1]
    total = np.asarray(sum(fftconvolve(song, band[::-1]) for band, song in zip(part, whole, strict=True)))
    lags = np.arange(total.size) - (length - 1)
    shared = np.minimum(whole.shape[1], lags + length) - np.maximum(lags, 0)
    enough = shared >= min(length, whole.shape[1], round(SHORTEST / HOP))
    curve = total / np.sqrt(np.maximum(shared, 1))
    median = np.median(curve[enough])
    spread = GAUSSIAN * np.median(np.abs(curve[enough] - median))
    return np.where(enough, (curve - median) / max(float(spread), 1e-9), 0.0)


def _onsets(audio: Audio, name: str, highest: float) -> FloatArray:
    """(bands, frames) rise of the level in each band, made even over time; ValueError for silence."""
    if audio.duration < SHORTEST:
        raise ValueError(
            f"the {name} lasts {audio.duration:.1f} s; {SHORTEST:g} s at least are needed to compare sound"
        )
    samples = soxr.resample(audio.samples.astype(np.float32), audio.sample_rate, RATE)
    size, hop = round(WINDOW * RATE), round(HOP * RATE)
    frequencies, _, spectrum = stft(samples, RATE, nperseg=size, noverlap=size - hop, boundary="zeros", padded=True)
    edges = np.geomspace(LOWEST, highest, BANDS + 1)
    power = np.abs(spectrum) ** 2
    bands = np.stack([power[_inside(frequencies, *pair)].mean(axis=0) for pair in pairwise(edges)])
    loudest = bands.max(axis=1, keepdims=True)
    if loudest.max() <= 1e-12:
        raise ValueError(f"the {name} is silent")
    level = np.log(bands + FLOOR**2 * np.maximum(loudest, FLOOR**2 * loudest.max()))
    rise = np.maximum(level[:, 2:] - level[:, :-2], 0.0)
    rise = np.pad(rise, ((0, 0), (1, 1)))
    return _even(rise)


def _inside(frequencies: FloatArray, low: float, high: float) -> NDArray[np.intp]:
    """Places of the frequencies in a band; the nearest one where none falls inside."""
    places = np.flatnonzero((frequencies >= low) & (frequencies < high))
    return places if places.size else np.array([np.abs(frequencies - np.sqrt(low * high)).argmin()])


def _even(rise: FloatArray) -> FloatArray:
    """Each band less its mean around each moment, in units of its spread."""
    width = round(LOCAL / HOP) | 1
    window = np.ones((1, width)) / width
    rest = rise - fftconvolve(rise, window, mode="same", axes=1)
    return np.asarray(rest / np.maximum(rest.std(axis=1, keepdims=True), 1e-9))
