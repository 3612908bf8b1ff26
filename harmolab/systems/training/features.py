"""Music features of the generator, A_f(t): MFCC at the motion's rate (Sec. 4.1), and the beat position of frames."""

import hashlib
import sys
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import soxr
from numpy.typing import NDArray

from harmolab.beats.audio import HOP, onset_envelope
from harmolab.files import cached_arrays, import_librosa, keep_arrays
from harmolab.params import KINDS, check_kinds
from harmolab.systems.training.about import MOST_FPS, MOST_UNITS
from harmolab.systems.training.motion_code import frames_at
from harmolab.types import Audio, BeatTrack, FloatArray, SingleArray

# Settings of the input of a system: frame rate, audio features, length of a training unit (paper Sec. 4.1).

NUMBERS, LISTS = (int, float, int | None, float | None), (tuple[int, ...], tuple[float, ...])  # hints of settings
LARGEST = {"seed": 2**32 - 1}  # settings that may be larger than sizes are


def check_settings(settings: Any, *, not_negative: Collection[str] = (), free: Collection[str] = ()) -> None:
    """ValueError, with name and value, unless numbers are positive numbers and choices among those of their `Literal`.

    Parameters
    ----------
    settings : a dataclass of numbers, lists of them, flags, choices, settings; other fields are not looked at
    not_negative : names of the numbers that may be zero as well
    free : of those that may be any number
    """
    check_kinds(settings)
    for name, hint in get_type_hints(type(settings)).items():
        value = getattr(settings, name)
        if get_origin(hint) is Literal:
            check_choice(name, value, get_args(hint))
        elif isinstance(hint, type) and is_dataclass(hint) and not isinstance(value, hint):
            raise ValueError(f"{name} must be {hint.__name__}(...), got {value!r}")
        elif hint in LISTS or (hint in NUMBERS and name not in free):
            _check_numbers(name, value, hint, can_be_zero=name in not_negative)


def _check_numbers(name: str, value: Any, hint: Any, *, can_be_zero: bool) -> None:
    """ValueError unless a setting is a number, or a list of them, as its hint says, and of a size that it may have."""
    if value is None and hint in NUMBERS:
        return
    is_list, is_whole = hint in LISTS, hint in (int, int | None, tuple[int, ...])
    most = LARGEST.get(name, MOST_UNITS if is_whole else sys.float_info.max)
    is_right = isinstance(value, tuple | list) == is_list
    for entry in value if isinstance(value, tuple | list) else [value]:
        is_number = isinstance(entry, KINDS[int if is_whole else float])
        is_right = is_right and is_number and 0 <= entry <= most and (entry != 0 or can_be_zero)
    if not is_right:
        least = "zero or more" if can_be_zero else "positive"
        numbers = f"a list of numbers, each {least}" if is_list else least
        raise ValueError(f"{name} must be {numbers}, got {value}{f'; {most} at most' if is_whole else ''}")


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """ValueError unless a setting is one of those there are."""
    if value not in choices:
        raise ValueError(f"{name} must be {' or '.join(choices)}, got {value!r}")


@dataclass(frozen=True)
class FeatureParams:
    """Settings of what a generator gets of music and motion: features A_f(t) and training units (Sec. 4.1, 5.1).

    Parameters
    ----------
    fps : float, frames per second
        Rate of motion and features; the paper resamples to 15.
    n_mfcc : int
        Number of MFCC coefficients.
    beat_channels : bool
        Whether onset strength, and sine and cosine of the position between two beats, stand beside the MFCC. The paper
        has MFCC alone.
    bar_channels : bool
        Whether sine and cosine of the position in the bar do, too, where bars are known.
    unit_beats : int
        Length of a training unit in beats: a meter of 4 to 6 beats, and as many beats before it as fill it up. At least
        7.

    Raises
    ------
    ValueError
        For a value out of range or of another kind.
    """

    fps: float = 15.0
    n_mfcc: int = 20
    beat_channels: bool = False
    bar_channels: bool = False
    unit_beats: int = 8

    def __post_init__(self) -> None:
        check_settings(self, free=("unit_beats",))
        if self.fps > MOST_FPS:
            raise ValueError(f"fps must be {MOST_FPS} at most, got {self.fps:g}")
        if self.unit_beats < 7:
            raise ValueError(f"unit_beats must leave at least one beat before a meter of six, got {self.unit_beats}")

    @classmethod
    def paper(cls) -> "FeatureParams":
        """The paper's: MFCC alone, at 15 frames per second."""
        return cls()

    @classmethod
    def recommended(cls) -> "FeatureParams":
        """The same, and the place of each frame between two beats and in its bar."""
        return cls(beat_channels=True, bar_channels=True)

    @property
    def n_audio(self) -> int:
        """Number of channels F of A_f."""
        return self.n_mfcc + 3 * self.beat_channels + 2 * self.bar_channels


# librosa's own rate: the mel bands reach to half the rate, so coefficients at another rate would mean other things.
RATE = 22050.0
CACHE_VERSION = 1  # raise when the analysis changes
SHORTEST = 2048  # samples in one analysis window


def audio_features(audio: Audio, beats: BeatTrack, times: FloatArray, params: FeatureParams) -> SingleArray:
    """A_f, audio features at given moments: (T, params.n_audio) array, not normalised.

    Parameters
    ----------
    audio : Audio
        The whole recording; it is analysed once, and the analysis cached by content.
    beats : BeatTrack on the audio's time line; looked at only with `params.beat_channels`
    times : (T,) array, seconds of audio time
        Before the start and after the end the first and last values hold.
    params : FeatureParams

    Returns
    -------
    (T, F) array, single precision: the MFCC, linearly interpolated; with `beat_channels` also onset strength (its
    maximum is 1), and sine and cosine of 2 pi times the beat position (both 0 where the music has no two beats); with
    `bar_channels` those of the position in the bar (both 0 where that is not known)
    """
    times = np.asarray(times, dtype=np.float64)
    columns = [_sampled(mfcc(audio, params.n_mfcc), RATE / HOP, times)]
    if params.beat_channels:
        envelope, rate = onset_envelope(audio)
        columns.append(_sampled(envelope[:, None] / max(float(envelope.max(initial=0.0)), 1e-12), rate, times))
        columns.append(beat_phase(beats, times))
    if params.bar_channels:
        columns.append(bar_phase(beats, times))
    return np.concatenate(columns, axis=1).astype(np.float32)


def beat_phase(beats: BeatTrack, times: FloatArray) -> FloatArray:
    """Sine and cosine of 2 pi times the beat position at given moments, (T, 2); both 0 without two beats."""
    return circle(beat_numbers(beats, times))


def beat_numbers(beats: BeatTrack, times: FloatArray) -> FloatArray:
    """Beat position (T,) of moments: linear from beat to beat, on by the median interval; NaN without two beats."""
    if len(beats) < 2:
        return np.full(len(times), np.nan)
    period = float(np.median(np.diff(beats.times)))
    early, late = np.maximum(beats.times[0] - times, 0.0), np.maximum(times - beats.times[-1], 0.0)
    return np.interp(times, beats.times, np.arange(len(beats))) - early / period + late / period


def bar_phase(beats: BeatTrack, times: FloatArray) -> FloatArray:
    """Sine and cosine of 2 pi times the position in the bar, (T, 2); 0 where no beat knows its place."""
    places = beats.bar_places
    if places is None or len(beats) < 2:
        return np.zeros((len(times), 2))
    numbers = beat_numbers(beats, times)
    before = np.clip(np.floor(numbers), 0, len(beats) - 1).astype(np.int64)
    return circle((places[before] + numbers - before) / (places.max() + 1))


def circle(turns: FloatArray) -> FloatArray:
    """Sine and cosine (T, 2) of so many turns (T,); 0 for NaN.

    >>> circle(np.array([0.25, np.nan])).round(3)
    array([[1., 0.],
           [0., 0.]])
    """
    return np.nan_to_num(np.stack([np.sin(2 * np.pi * turns), np.cos(2 * np.pi * turns)], axis=1))


def mfcc(audio: Audio, count: int) -> SingleArray:
    """MFCC of a whole recording, (F, count) array at 22050 / 512 hertz, the first centred at 0 s; cached by content.

    Recordings at another rate than 22050 hertz are resampled first.
    """
    words = f"mfcc {CACHE_VERSION} {audio.sample_rate} {count} {HOP}"
    return cached_table(audio, words, count, lambda: _analyse(audio, count))


def cached_table(audio: Audio, words: str, columns: int, analyse: Callable[[], NDArray[Any]]) -> SingleArray:
    """A table (N, `columns`) of a sound, from the cache where it is there and sound.

    Parameters
    ----------
    audio : Audio
    words : name of the analysis, its version, the sample rate, and whatever else changes the numbers
    columns : int
    analyse : function() -> (N, `columns`) array
    """
    digest, name = hashlib.sha256(words.encode()), words.partition(" ")[0]
    digest.update(np.ascontiguousarray(audio.samples, dtype=np.float32).data)
    key = digest.hexdigest()[:40]
    table = (cached_arrays(key) or {}).get(name, np.zeros(0))
    is_finite = table.dtype == np.float32 and table.size and np.isfinite(table).all()
    if not is_finite or table.shape[1:] != (columns,):
        table = analyse().astype(np.float32)
        keep_arrays(key, {name: table})
    return table


def _analyse(audio: Audio, count: int) -> SingleArray:
    """The analysis itself, by librosa."""
    librosa = import_librosa()

    samples = audio.samples
    if audio.sample_rate != RATE:
        samples = soxr.resample(np.asarray(samples), audio.sample_rate, RATE, quality="HQ")
    samples = np.pad(samples, (0, max(0, SHORTEST - samples.size))).astype(np.float32)
    # At least as many mel bands as coefficients.
    table = librosa.feature.mfcc(y=samples, sr=RATE, n_mfcc=count, hop_length=HOP, n_mels=max(128, count))
    return np.ascontiguousarray(table.T, dtype=np.float32)


def _sampled(table: NDArray[np.floating], rate: float, times: FloatArray) -> FloatArray:
    """Rows of `table` (F, K) at `rate` hertz, linearly interpolated at `times`: (T, K) array; the ends hold."""
    return frames_at(table, np.clip(times * rate, 0.0, len(table) - 1))
