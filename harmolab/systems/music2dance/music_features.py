"""Fifteen channels of music, ten a second (Sec. 4.2, Fig. 4): onset, beat, downbeat, and the strength of twelve tones.

The paper takes them from madmom. Ours are librosa's onsets and chroma and the project's own beats.
"""

import numpy as np
import soxr

from harmolab.beats.audio import HOP, LATENESS, audio_beats
from harmolab.files import import_librosa
from harmolab.systems.training.features import cached_table
from harmolab.types import Audio, BeatTrack, BoolArray, FloatArray, SingleArray, check_kind

CHANNELS = ("onset", "beat", "downbeat", "C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B")
RATE = 22050.0  # hertz at which everything is listened to
CHROMA_WINDOW = 4096  # samples
LOUD = 99.0  # percentile of the onset strength that counts as certain
FLOOR_DB, SILENCE = -80.0, 1e-4  # of a mel spectrogram; largest amplitude below which there is no sound
CACHE_VERSION = 1  # raise when the analysis changes


def n_cells(audio: Audio, rate: float) -> int:
    """Number of moments of the features of a recording: one every 1 / rate seconds, the first at 0 s."""
    return int(np.ceil(audio.duration * rate - 1e-9))


def music_features(audio: Audio, beats: BeatTrack, *, meter: int = 4, rate: float = 10.0) -> SingleArray:
    """The channels of `CHANNELS` at moments 0, 1 / rate, ... of audio time: (M, 15) array, each from 0 to 1.

    Parameters
    ----------
    audio : Audio, the whole recording; the analysis is cached by content
    beats : BeatTrack on its time line
        Where its bar places are unknown, the first of a bar of `meter` beats is the place of `accented_place`.
    meter : int, beats in a bar
    rate : float, hertz
    """
    cells = n_cells(audio, rate)
    words = f"music {CACHE_VERSION} {audio.sample_rate} attributes {rate}"
    sound = cached_table(audio, words, len(CHANNELS) - 2, lambda: _listen(_samples(audio), cells, rate))
    ones = beats.select(beats.bar_places == 0 if beats.bar_places is not None else accented_place(beats, meter=meter))
    marks = [marked(track.times, cells, rate) for track in (beats, ones)]
    return np.column_stack([sound[:, 0], *marks, sound[:, 1:]]).astype(np.float32)


def blind_features(audio: Audio, *, rate: float = 10.0) -> SingleArray:
    """Music2Dance's features of a song whose dance is not known: fifteen channels, `rate` times a second (Sec. 4.2).

    Onset, beat, downbeat, and the strength of the twelve tones. Beats are tracked without a range of tempi (R15 of
    ``docs/readings_music2dance.md``).

    Returns
    -------
    (M, 15) array at the moments 0, 1 / rate, ... of the audio; ValueError unless an Audio is passed
    """
    return music_features(audio, audio_beats(audio), rate=rate)


def mel_features(audio: Audio, *, rate: float = 10.0, bands: int = 80) -> SingleArray:
    """A mel spectrogram of a sound, as features of its music.

    Parameters
    ----------
    audio : Audio
    rate : float, hertz
        Of the moments.
    bands : int
        Number of mel bands.

    Returns
    -------
    (M, bands) array at the moments 0, 1 / rate, ... of the audio: decibels from -80 to 0, the loudest

    Raises
    ------
    ValueError
        Unless an Audio is passed.
    """
    check_kind(audio, Audio)
    cells = n_cells(audio, rate)
    words = f"music {CACHE_VERSION} {audio.sample_rate} mel {rate} {bands}"
    return cached_table(audio, words, bands, lambda: _mel(_samples(audio), cells, rate, bands))


def marked(times: FloatArray, cells: int, rate: float) -> FloatArray:
    """One for each of some times (seconds), shared by the two nearest moments as it lies between them: (cells,)."""
    values = np.zeros(cells + 1)
    places = times * rate
    inside = (places >= 0) & (places <= cells - 1)
    before = places[inside].astype(np.int64)
    np.add.at(values, before, before + 1 - places[inside])
    np.add.at(values, before + 1, places[inside] - before)
    return np.minimum(values[:cells], 1.0)


def accented_place(beats: BeatTrack, *, meter: int = 4) -> BoolArray:
    """Every `meter`-th beat, (B,) mask: those that are strongest on the whole. A guess: in 4/4 it is often another.

    >>> track = BeatTrack(np.arange(1, 9) / 2, np.tile([1.0, 2.0, 1.0, 1.0], 2), 100.0, 5.0)
    >>> np.flatnonzero(accented_place(track))
    array([1, 5])
    """
    places = np.arange(len(beats)) % meter
    means = [beats.strengths[places == place].mean() for place in range(min(meter, len(beats)))]
    return places == (int(np.argmax(means)) if means else 0)


def _samples(audio: Audio) -> FloatArray:
    """The sound at `RATE`, at least one window long, its largest amplitude 1; zeros for silence."""
    samples = np.asarray(audio.samples, dtype=np.float64)
    if audio.sample_rate != RATE:
        samples = soxr.resample(samples, audio.sample_rate, RATE, quality="HQ")
    samples = np.pad(samples, (0, max(0, CHROMA_WINDOW - samples.size)))
    loudest = np.abs(samples).max()
    return samples / loudest if loudest > SILENCE else np.zeros_like(samples)


def _listen(samples: FloatArray, cells: int, rate: float) -> FloatArray:
    """Onset, the largest in each moment's share of time, and mean chroma there: (cells, 13)."""
    librosa = import_librosa()

    if not samples.any():
        return np.zeros((cells, 13))
    strength = librosa.onset.onset_strength(y=samples, sr=RATE, hop_length=HOP)
    onset = np.minimum(strength / max(np.percentile(strength, LOUD), 1e-9), 1.0)
    chroma = librosa.feature.chroma_stft(y=samples, sr=RATE, n_fft=CHROMA_WINDOW, hop_length=HOP)
    onsets = _by_cell(onset[:, None], cells, rate, late=LATENESS, reduce=np.maximum)
    return np.column_stack([onsets, _by_cell(chroma.T, cells, rate, reduce=np.add)])


def _mel(samples: FloatArray, cells: int, rate: float, bands: int) -> FloatArray:
    librosa = import_librosa()

    if not samples.any():
        return np.full((cells, bands), FLOOR_DB)
    power = librosa.feature.melspectrogram(y=samples, sr=RATE, hop_length=HOP, n_mels=bands)
    return _by_cell(librosa.power_to_db(power, ref=np.max, top_db=-FLOOR_DB).T, cells, rate, reduce=np.add)


def _by_cell(frames: FloatArray, cells: int, rate: float, *, reduce: np.ufunc, late: float = 0.0) -> FloatArray:
    """Largest value (`np.maximum`) or mean (`np.add`) of frames (F, K) nearest to each moment: (cells, K)."""
    at = np.clip(np.round((np.arange(len(frames)) - late) * HOP / RATE * rate), 0, cells - 1).astype(np.int64)
    firsts = np.searchsorted(at, np.arange(cells))
    values: FloatArray = reduce.reduceat(frames, np.minimum(firsts, len(frames) - 1), axis=0)
    if reduce is np.add:
        values = values / np.maximum(np.diff(np.append(firsts, len(frames))), 1)[:, None]
    return values
