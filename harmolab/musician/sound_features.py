"""The sound as the network hears it: 28 numbers a frame, frames exactly 1 / fps seconds apart (Sec. 3.2).

Frame t speaks of the time from t / fps to (t + 1) / fps; its middle is half a frame later than key point t.
"""

from functools import cache, partial

import numpy as np
import soxr
from scipy.fft import dct

from harmolab.beats.audio import single_samples
from harmolab.files import import_librosa
from harmolab.musician.params import HIGH_TONE, KEYS, LOW_TONE, LOWEST_KEY, Audio2BodyParams
from harmolab.systems.training.features import cached_table
from harmolab.types import Audio, FloatArray, Notes, SingleArray

RATE = 44100.0  # hertz at which everything is listened to
SILENCE = 1e-6  # root mean square below which there is no sound, and what is added before logarithms
SLOPE = 2  # frames on each side that a derivative is taken over
TONE_RATE, TONE_WINDOW = 11025.0, 2048  # hertz, and samples (186 ms) that tones are told apart in: more than a frame
AT_ONCE = 2048  # frames, so that an hour takes little memory
A4, A4_MIDI = 440.0, 69
NOTE_RATE = 200.0  # hertz, of the onset strength for notes
NOTE_WINDOW = 0.046  # seconds
NOTE_BANDS, NOTE_RANGE = 120, (27.5, 16000.0)  # mel bands, hertz: from the lowest key of a piano on
CACHE_VERSION = 2  # raise when the analysis changes


def sound_features(
    audio: Audio, params: Audio2BodyParams, n_frames: int, *, start: float = 0.0, cached: bool = True
) -> SingleArray:
    """The input of the network for a recording, frame by frame: (n_frames, F), F being `params.n_sound`.

    Parameters
    ----------
    audio : Audio, the whole recording
    params : Audio2BodyParams that hear sound
    n_frames : int
    start : float, seconds, audio time of frame 0; what lies outside the recording is silence
    cached : bool, by content
    """
    names = (params.fps, params.mfcc, params.mels, params.energy_delta, params.tones, n_frames, start)
    words = f"audio2body {CACHE_VERSION} {audio.sample_rate} {names}"
    listen = partial(_listened, audio, params, n_frames, start)
    return cached_table(audio, words, params.n_sound, listen) if cached else listen()


def _listened(audio: Audio, params: Audio2BodyParams, n_frames: int, start: float) -> SingleArray:
    samples = normalised_loudness(audio)
    parts = [frame_mfcc(samples, params, n_frames, start=start)]
    if params.tones != "none":
        parts.append(tone_strengths(samples, params, n_frames, start=start))
    return np.concatenate(parts, axis=1)


def normalised_loudness(audio: Audio) -> SingleArray:
    """The samples at 44,100 Hz with root mean square 1 over the whole recording (0 dB); silence stays silence."""
    samples = np.asarray(audio.samples, dtype=np.float32)
    if audio.sample_rate != RATE:
        samples = soxr.resample(samples, audio.sample_rate, RATE, quality="VHQ")
    level = float(np.sqrt(np.mean(np.square(samples, dtype=np.float64)))) if samples.size else 0.0
    return samples / np.float32(level) if level > SILENCE else np.zeros_like(samples)


def frame_mfcc(samples: SingleArray, params: Audio2BodyParams, n_frames: int, *, start: float = 0.0) -> SingleArray:
    """Mel cepstrum and log mean energy of each frame, and their derivatives: (T, 2 mfcc + 2).

    Parameters
    ----------
    samples : (S,) array at `RATE`
    params : Audio2BodyParams
        Window and hop are both 1 / fps: frame t begins at sample round(44100 (start + t / fps)), so nothing drifts. The
        zeroth coefficient is one; mel bands go from 0 to 22,050 Hz; without `energy_delta` the last column is left out.
    n_frames : int, T; beyond the end there is silence
    start : float, seconds

    Returns
    -------
    Columns: coefficients, ln(mean square + 1e-6), then the slope of each over five frames
    """
    width, mfcc = int(np.ceil(RATE / params.fps)), params.mfcc
    window = np.hamming(width).astype(np.float32)
    size = 1 << (width - 1).bit_length()
    bands = _mel_bands(size, params.mels)
    values = np.empty((n_frames, mfcc + 1), np.float32)
    for first in range(0, n_frames, AT_ONCE):
        frames = _frames(samples, params.fps, start, range(first, min(first + AT_ONCE, n_frames)), width)
        power = _power(frames * window, size) / np.square(window).sum()
        rows = values[first : first + len(frames)]
        rows[:, :mfcc] = dct(np.log(power @ bands + SILENCE), axis=1, norm="ortho")[:, :mfcc]
        rows[:, mfcc] = np.log(np.square(frames).mean(axis=1) + SILENCE)
    return np.concatenate([values, slopes(values)[:, : mfcc + params.energy_delta]], axis=1)


def _frames(
    samples: SingleArray, fps: float, start: float, numbers: range, width: int, *, rate: float = RATE, late: int = 0
) -> SingleArray:
    """(F, width) samples of some frames, from `late` samples after their beginning; zeros outside the recording."""
    firsts = np.round((start + np.arange(numbers.start, numbers.stop) / fps) * rate).astype(np.int64) + late
    low, high = int(firsts[0]), int(firsts[-1]) + width
    part = np.zeros(high - low, np.float32)
    inside = slice(max(low, 0), min(high, samples.size))
    if inside.start < inside.stop:
        part[inside.start - low : inside.stop - low] = samples[inside]
    view: SingleArray = np.lib.stride_tricks.sliding_window_view(part, width)[firsts - low]
    return view


def _power(frames: SingleArray, size: int) -> SingleArray:
    spectrum = np.fft.rfft(frames, size, axis=1)
    power: SingleArray = (np.square(spectrum.real) + np.square(spectrum.imag)).astype(np.float32)
    return power


@cache
def _mel_bands(size: int, mels: int) -> SingleArray:
    """(size / 2 + 1, mels) shares of each frequency in each band."""
    librosa = import_librosa()

    bands: SingleArray = librosa.filters.mel(sr=RATE, n_fft=size, n_mels=mels, norm=None).T.astype(np.float32)
    return bands


def slopes(values: FloatArray | SingleArray) -> SingleArray:
    """Slope a frame of a line through five frames around each, (T, C); the first and last frames are repeated."""
    padded = np.pad(values, ((SLOPE, SLOPE), (0, 0)), mode="edge")
    steps = np.arange(-SLOPE, SLOPE + 1)
    total = sum(step * padded[SLOPE + step : SLOPE + step + len(values)] for step in steps.tolist())
    return np.asarray(total / np.square(steps).sum(), np.float32)


def tone_strengths(samples: SingleArray, params: Audio2BodyParams, n_frames: int, *, start: float = 0.0) -> SingleArray:
    """Strength of each semitone from C2 to C7, (T, 61), or of `tones` "chroma" over octaves, (T, 12): ln(1 + power).

    They are listened to in windows of 186 ms about the middle of each frame.
    """
    samples = soxr.resample(samples, RATE, TONE_RATE, quality="HQ")
    window, bands = np.hamming(TONE_WINDOW).astype(np.float32), _tone_bands(params.tones == "chroma")
    late = round(TONE_RATE / params.fps / 2) - TONE_WINDOW // 2
    values = np.empty((n_frames, bands.shape[1]), np.float32)
    for first in range(0, n_frames, AT_ONCE):
        numbers = range(first, min(first + AT_ONCE, n_frames))
        frames = _frames(samples, params.fps, start, numbers, TONE_WINDOW, rate=TONE_RATE, late=late)
        power = _power(frames * window, TONE_WINDOW) / np.square(window).sum()
        values[first : first + len(frames)] = np.log1p(power @ bands)
    return values


@cache
def _tone_bands(chroma: bool) -> SingleArray:
    """(1025, 61 or 12) shares of each frequency in each semitone: triangles from one semitone to the next."""
    frequencies = np.fft.rfftfreq(TONE_WINDOW, 1 / TONE_RATE)
    pitches = A4_MIDI + 12 * np.log2(np.maximum(frequencies, 1.0) / A4)
    tones = np.arange(LOW_TONE, HIGH_TONE + 1)
    bands = np.clip(1 - np.abs(pitches[:, None] - tones), 0, None)
    if chroma:
        bands = np.stack([bands[:, tones % 12 == tone].sum(axis=1) for tone in range(12)], axis=1)
    return bands.astype(np.float32)


def note_features(notes: Notes, fps: float, n_frames: int, *, start: float = 0.0) -> SingleArray:
    """The notes in place of their sound: (T, 88), each key's loudness while it is down, twice as much as it is struck.

    Pitches beyond the keys of a piano are left out.
    """
    values = np.zeros((n_frames, KEYS), np.float32)
    first = np.floor((notes.onsets - start) * fps + 1e-6).astype(np.int64)
    last = np.maximum(np.ceil((notes.offsets - start) * fps - 1e-6).astype(np.int64), first + 1)
    for begin, end, pitch, loudness in zip(first, last, notes.pitches, notes.loudness, strict=True):
        key = int(pitch) - LOWEST_KEY
        if 0 <= key < KEYS and end > 0 and begin < n_frames:
            values[max(begin, 0) : end, key] = np.maximum(values[max(begin, 0) : end, key], loudness)
            if begin >= 0:
                values[begin, key] = 2 * loudness
    return values


def note_envelope(audio: Audio) -> tuple[FloatArray, float]:
    """Onset strength that a vibrato does not raise, (F,) array, and its rate of about 200 hertz.

    The rise of each mel band in decibels over the largest of the five bands around it two frames before ("SuperFlux",
    Boeck and Widmer 2013): a note that trembles in pitch stays within its neighbours. Sample i belongs to second
    i / rate, the middle of its window.
    """
    librosa = import_librosa()

    hop = max(round(audio.sample_rate / NOTE_RATE), 1)
    window = 2 * max(round(NOTE_WINDOW * audio.sample_rate / 2), 8)
    samples = single_samples(audio)
    samples = np.pad(samples, (0, max(0, 2 * window - samples.size)))
    bands = librosa.feature.melspectrogram(
        y=samples,
        sr=audio.sample_rate,
        n_fft=window,
        hop_length=hop,
        n_mels=min(NOTE_BANDS, window // 8),  # no band may be narrower than what the window resolves
        fmin=min(NOTE_RANGE[0], audio.sample_rate / 8),
        fmax=min(NOTE_RANGE[1], audio.sample_rate / 2),
    )
    decibels = librosa.power_to_db(bands, ref=np.max)
    strength = librosa.onset.onset_strength(S=decibels, sr=audio.sample_rate, lag=2, max_size=5, center=False)
    return np.asarray(strength, dtype=np.float64), audio.sample_rate / hop
