"""Music beats of a sound by librosa's onset strength and tempo (Eq. 2-3), and clicks on beats, to judge them by ear.

Symbols of the paper: A(t) is the sound, g(t) its onset strength (Eq. 2), B_a(t) the beats that are found in it, with
times p_a(b) and strengths s_a(b) (Eq. 3).

The beats of a whole song are tracked once; parts of it are cut from these. Where the music keeps one tempo, the tracked
beats are laid on a grid of this tempo, else they follow the music; see `harmolab.beats.tempo`. The analysis of a song
is kept on disk under a hash of its samples, so that it is done once; see `harmolab.files`.
"""

import hashlib
import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from harmolab.beats.tempo import NEAR, likelier_tempo, steady_beats
from harmolab.files import cached_arrays, import_librosa, keep_arrays
from harmolab.params import DANCES
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, IntArray, SingleArray, check_kind

# librosa's tracker on this machine: compiled or not, as numba's cache tells


def is_tracker_compiled() -> bool:
    """True where numba's cache holds librosa's tracker for this Python. librosa is not imported, which would compile.

    The cache lies in ``NUMBA_CACHE_DIR`` where that is set, else beside librosa's files, else with the user's caches.
    """
    name = f"*beat*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    return any(next(folder.rglob(name), None) is not None for folder in _numba_caches())


def _numba_caches() -> list[Path]:
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(named)]
    from platformdirs import user_cache_path

    spec = find_spec("librosa")
    beside = [] if spec is None else [Path(folder) for folder in spec.submodule_search_locations or ()]
    return [*beside, user_cache_path("numba", appauthor=False)]


# Clicks on the beats, to judge them by ear

SECONDS = 0.03  # of a click
DECAY = 0.006  # seconds in which it falls to 1/e
PITCHES = (2400.0, 1500.0)  # hertz: on "one", on any other beat
MUSIC = 0.5  # amplitude of the music, whose largest is 1, under clicks of 0.5


def with_clicks(audio: Audio, track: BeatTrack) -> Audio:
    """The music with a click on each beat, to judge beats by ear: higher clicks on the first beats of bars.

    The loudest sample of the music is brought to half of full scale. Beats after the end of the sound have no click.

    Parameters
    ----------
    audio : Audio
    track : BeatTrack
        Beats on the audio's time line. Where no bars are known all clicks are alike.

    Returns
    -------
    Audio of the same length and rate

    Raises
    ------
    ValueError
        Unless an Audio and a BeatTrack are passed.
    """
    check_kind(audio, Audio)
    check_kind(track, BeatTrack)
    samples = audio.samples * (MUSIC / max(float(np.abs(audio.samples).max()), 1e-12))
    time = np.arange(round(SECONDS * audio.sample_rate)) / audio.sample_rate
    one, other = (0.5 * np.sin(2 * np.pi * pitch * time) * np.exp(-time / DECAY) for pitch in PITCHES)
    places = np.ones(len(track)) if track.bar_places is None else track.bar_places
    for first, place in zip(np.round(track.times * audio.sample_rate).astype(int), places, strict=True):
        click = (other if place else one)[: max(0, samples.size - first)]
        samples[first : first + click.size] += click
    return Audio(samples, audio.sample_rate)


# Music beats of a sound

LOG = logging.getLogger(__name__)
COMPILING = "compiling librosa's beat tracker, once on a machine (half a minute)"
HOP = 512  # samples between onset strengths
CACHE_VERSION = 7  # raise when the analysis changes
# Envelope samples by which onset strength lies behind what annotators tap: 30 ms at 22,050 Hz. There it is 19 to 51 ms
# on songs of known grid; from 8 to 48 kHz it is 1.0 to 1.6 samples on three recordings.
LATENESS = 1.3
QUIET = 1e-4  # part of the largest amplitude below which there is silence: 80 dB
LOUDEST = 1e6  # amplitude above which squares might overflow in single precision


def tempo_range(tempo: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """The range of tempi, in beats per minute, that a dance's name or a range stands for; None for None.

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
    if np.shape(tempo) != (2,) or not 0 < tempo[0] < tempo[1] < 1000:
        raise ValueError(f"a tempo range is two rising numbers in beats per minute, got {tempo}")
    return float(tempo[0]), float(tempo[1])


def audio_beats(
    audio: Audio, *, tempo: str | tuple[float, float] | None = None, lateness: float = LATENESS
) -> BeatTrack:
    """The beats of music, found in its sound: times p_a(b) with strengths s_a(b) (Eq. 2-3).

    librosa's tracker finds them. Then they are laid on one grid of constant tempo where the music keeps one, else they
    follow the music (`harmolab.beats.tempo`). The strength of a beat is the onset strength by it (`onset_envelope`).

    Parameters
    ----------
    audio : Audio
        The whole recording. Beats of separate pieces of 6 s agree with those of the whole less well: their F-measure
        is .71.
    tempo : str or (low, high), optional
        Name of a dance of `DANCES`, or beats per minute, among which the tempo is sought. Without it the tempo of 19 in
        23 dance recordings is right, and that of four is twice what it should be: the sound does not tell whether music
        counts 80 or 160.
    lateness : float, samples of the onset envelope
        The beats are moved earlier by so much, since onset strength rises later than a listener taps. 0 leaves them on
        the onset strength; the default is 30 ms at 22,050 Hz.

    Returns
    -------
    BeatTrack
        Beats from the first to the last sound, none for silence. `quality`, `windows` and `fit` say how sure they are.
        A beat with which the sound begins has strength 0, since its onset rises above nothing. `bar_places` is None:
        the sound does not tell where a bar begins (`with_one`), since in 4/4 the strongest beat is as often another as
        the first.

    Raises
    ------
    ValueError
        For an unknown dance, a range that does not rise, or what is no Audio.

    Examples
    --------
    >>> from harmolab import load_audio  # doctest: +SKIP
    >>> beats = audio_beats(load_audio("song.mp3"), tempo="waltz")  # doctest: +SKIP
    """
    analysis = _cached_analysis(audio, tempo_range(tempo))
    rate = audio.sample_rate / HOP
    strengths = _largest_near(analysis.envelope, rate, analysis.beats)
    times = analysis.beats - lateness / rate
    # A beat that is heard as the sound begins is there, and not a little before it.
    inside = (analysis.beats >= 0) & (times >= -NEAR) & (times <= audio.duration)
    times, quality, windows = np.maximum(times, 0.0), analysis.quality, analysis.windows
    return BeatTrack(times[inside], strengths[inside], rate, audio.duration, quality=quality, windows=windows)


def music_beats(clip: Clip) -> BeatTrack:
    """The music beats of a clip on its audio's time line: its own (`Clip.beats`), else those of `audio_beats`.

    Where the clip's dance is one of `DANCES`, the tempo is sought in the range of that dance. ValueError unless a Clip
    is passed.
    """
    check_kind(clip, Clip)
    if clip.beats is not None:
        return clip.beats
    return audio_beats(clip.audio, tempo=clip.dance if clip.dance in DANCES else None)


def librosa_beats(audio: Audio, *, start_tempo: float = 120.0, percussive: bool = False) -> BeatTrack:
    """Beats of librosa's tracker as they come, as published codes take them: on no steady grid, and not moved earlier.

    They lie on the frames of librosa, each of `HOP` (512) samples. So sound of ``HOP * fps`` hertz has its beats on the
    frames of a motion of `fps` frames per second.

    Parameters
    ----------
    audio : Audio, the whole song
    start_tempo : float, beats per minute
        Tempo around which librosa seeks the tempo.
    percussive : bool
        Whether the onset strength is the median over the mel bands of the percussive part of the sound, else it is the
        mean over those of all of it.

    Returns
    -------
    BeatTrack; empty for silence
    """
    import librosa

    compile_tracker()
    samples, rate = _window_samples(audio), audio.sample_rate
    if percussive:
        samples = librosa.effects.percussive(samples)
    envelope = librosa.onset.onset_strength(y=samples, sr=rate, aggregate=np.median if percussive else np.mean)
    with np.errstate(invalid="ignore"):  # the compiled tracker of librosa 1.0 warns here, and gives the beats of 0.11
        _, frames = librosa.beat.beat_track(onset_envelope=envelope, sr=rate, start_bpm=start_tempo)
    strengths, times = envelope[frames], frames * HOP / rate
    inside = times <= audio.duration  # a very short sound is padded to a window
    return BeatTrack(times[inside], strengths[inside], rate / HOP, audio.duration)


def onset_envelope(audio: Audio) -> tuple[FloatArray, float]:
    """Onset strength g(t) of a sound (Eq. 2): how much louder the bands of its spectrum become at each moment.

    It is librosa's: the mean over the mel bands of what they gain in decibels. It lies some 30 ms behind the moment at
    which a listener taps (at 22,050 Hz).

    Returns
    -------
    (F,) array, and its rate in hertz: value i belongs to second i / rate. ValueError unless an Audio is passed.
    """
    return _cached_analysis(audio, None).envelope, audio.sample_rate / HOP


def beat_strengths(audio: Audio, times: FloatArray) -> FloatArray:
    """Onset strength by each of (B,) times in seconds: the largest of the three samples around it, (B,) array."""
    return _largest_near(*onset_envelope(audio), np.asarray(times))


def _largest_near(envelope: FloatArray, rate: float, times: FloatArray) -> FloatArray:
    """(B,) largest of the three values of an envelope around each time."""
    centre = np.clip(np.round(times * rate).astype(np.int64), 0, envelope.size - 1)
    around = np.clip(centre[:, None] + np.array([-1, 0, 1]), 0, envelope.size - 1)
    return envelope[around].max(axis=1) if centre.size else np.zeros(0)


class _Analysis(NamedTuple):
    """Onset strength, (F,); beats in seconds on the envelope's clock, (B,); quality and windows, see `SteadyBeats`."""

    envelope: FloatArray
    beats: FloatArray
    quality: float
    windows: FloatArray


def _cached_analysis(audio: Audio, bounds: tuple[float, float] | None) -> _Analysis:
    """The analysis of a sound, from the cache when it is there and whole; `bounds` are the prior of its tempo."""
    if not isinstance(audio, Audio):  # here, since a score that asks in another room walks farther
        raise ValueError(f"a harmolab.Audio is needed, got {type(audio).__name__}")
    key = _key(audio, bounds)
    stored = _stored_analysis(cached_arrays(key) or {})
    if stored is None:
        compile_tracker()
        envelope, frames = _analyse(audio, bounds)
        rate = audio.sample_rate / HOP
        start, end = sounding_span(audio)
        # A first beat may come a little before the sound that it is heard by.
        span = (start + LATENESS / rate - NEAR, end + LATENESS / rate)
        stored = _Analysis(envelope, *steady_beats(envelope, rate, frames / rate, span))
        keep_arrays(key, {name: np.asarray(value) for name, value in stored._asdict().items()})
    return stored


def sounding_span(audio: Audio) -> tuple[float, float]:
    """Seconds of the first and the last sample above `QUIET` of the loudest; (0, 0) for silence."""
    level = np.abs(audio.samples)
    loud = np.flatnonzero(level > QUIET * level.max())
    return (float(loud[0] / audio.sample_rate), float(loud[-1] / audio.sample_rate)) if loud.size else (0.0, 0.0)


def _stored_analysis(arrays: Mapping[str, NDArray[Any]]) -> _Analysis | None:
    """The analysis out of the cache; None when it holds anything else."""
    try:
        envelope, beats, quality, windows = (arrays[name].astype(np.float64) for name in _Analysis._fields)
    except (KeyError, ValueError):
        return None
    whole = envelope.ndim == beats.ndim == 1 and np.isfinite(envelope).all() and (envelope >= 0).all()
    rising = np.isfinite(beats).all() and (np.diff(beats) > 0).all()
    shaped = quality.shape == () and windows.shape[1:] == (2,) and np.isfinite(windows).all()
    return _Analysis(envelope, beats, float(quality), windows) if whole and rising and shaped else None


def _key(audio: Audio, bounds: tuple[float, float] | None) -> str:
    """Content hash: samples, rate, tempo prior and other settings, version of the analysis."""
    digest = hashlib.sha256(f"{CACHE_VERSION} {audio.sample_rate} {bounds} {HOP}".encode())
    digest.update(single_samples(audio).data)
    return digest.hexdigest()[:40]


def single_samples(audio: Audio) -> SingleArray:
    """Samples in single precision; absurdly loud ones are scaled down, which moves no onset."""
    peak = float(np.abs(audio.samples).max())
    return np.ascontiguousarray(audio.samples / peak if peak > LOUDEST else audio.samples, dtype=np.float32)


def _window_samples(audio: Audio) -> SingleArray:
    """At least one analysis window, so that a sound of a few milliseconds is analysed like any other."""
    return np.pad(single_samples(audio), (0, max(0, 4 * HOP - audio.samples.size)))


@cache
def compile_tracker() -> None:
    """Have librosa's numba functions compiled and loaded, one process at a time; quick after the first call.

    numba's cache breaks for good when two processes fill it at the same moment: every later run would crash. The log
    of this module says `COMPILING` when this process begins to, and nothing while it waits for another one.
    """
    samples = np.sin(np.arange(3 * 22050) / 50.0) * (np.arange(3 * 22050) % 11025 < 1000)
    name = f"harmolab-compile-{os.environ.get('USER', 'user')}.lock"
    with suppress(OSError), FileLock(Path(tempfile.gettempdir()) / name, timeout=300):
        if not is_tracker_compiled():
            LOG.info(COMPILING)
        with _numba_keeps_all():
            beat = import_librosa().beat

        _analyse(Audio(samples, 22050.0), None)
        beat.beat_track(y=samples.astype(np.float32), sr=22050)  # as others call it: in single precision


@contextmanager
def _numba_keeps_all() -> Iterator[None]:
    """Imports in this block are compiled once for all processes, also where their author has each compile anew.

    librosa 0.11 leaves one function of its tracker out of numba's cache, over a second of each process's start.
    """
    import numba

    guvectorize = numba.guvectorize
    numba.guvectorize = lambda *signature, **options: guvectorize(*signature, **(options | {"cache": True}))
    try:
        yield
    finally:
        numba.guvectorize = guvectorize


def _analyse(audio: Audio, bounds: tuple[float, float] | None) -> tuple[FloatArray, IntArray]:
    """Onset strength (F,) and beats (B,), numbers of its samples, by librosa."""
    import librosa

    samples, rate = _window_samples(audio), audio.sample_rate
    envelope = librosa.onset.onset_strength(y=samples, sr=rate, hop_length=HOP)
    envelope = np.nan_to_num(envelope, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float64)
    if not envelope.any():
        return envelope, np.zeros(0, dtype=np.int64)
    tempo = _tempo(envelope, rate / HOP, bounds)
    if not 0 < tempo <= 60 * rate / HOP:
        return envelope, np.zeros(0, dtype=np.int64)
    if bounds is None:
        tempo = likelier_tempo(envelope, rate / HOP, tempo)
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
