"""The offset of a motion or a video in its music: the moment of the music at which its first frame stands.

**From the movement.** Dancers slow down on the beat. So the speed curve of the motion is slid along the music, and the
evidence at each lag is its slowness at the music's beats. Beats repeat: an offset that is wrong by a whole beat fits as
well, and the result names these alternatives.

**From the sound** of a video and of a song the offset is exact, and not modulo the beat. A phone that films a dancer
also records the music. Its sound is fainter, coloured by the room and full of steps, but the moments at which each band
of the spectrum sets in are those of the song. They are compared at every lag by fast correlation.

A video without a body becomes a motion first: one point that travels as fast as the picture moves, all pixels together.
Its speed is read as that of joints is. So the beats of a video are the moments of rest, as those of a skeleton are, and
not the impacts that `harmolab.beats.flow.flow_beats` marks a tenth of a second before them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
import soxr
from numpy.typing import NDArray

from harmolab.beats.audio import audio_beats
from harmolab.beats.flow import LAG, flow_directograms
from harmolab.body.kinematics import refine_extrema, smooth
from harmolab.body.skeletons import Skeleton
from harmolab.files import Progress, silent
from harmolab.params import HarmonyParams
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.significance import p_value
from harmolab.types import Audio, BeatTrack, FloatArray, Motion, SingleArray, check_kind

STEP = 0.005  # seconds, between the lags that are tried
FEWEST_BEATS = 4  # of the music inside the motion
LEAST_OVERLAP = 0.5  # of the beats that the best placed motion covers
ATTACK_FRAME = 0.001  # seconds
ATTACK_SMOOTHING = 0.003  # seconds
TRACKER_SPREAD = 0.006  # seconds, scatter of single tracked beats about the attacks
TRACKER_LAGS = (-0.08, 0.03)  # seconds, the range around the tracked beats that is searched for attacks
OTHER_TEMPOS = np.concatenate([np.linspace(0.8, 0.93, 50), np.linspace(1.07, 1.25, 49)])
NULL_STEP = 0.02  # seconds
PICTURE = Skeleton(("picture",), (-1,))


@dataclass(frozen=True, eq=False)
class Offset:
    """The moment of the music at which a motion begins, as far as beats can tell it: the result of `find_offset`.

    Parameters
    ----------
    seconds : float
        Audio time of motion frame 0: of the places that fit, the one nearest to the guess.
    period : float, seconds
        The beat's period. Beats alone tell `seconds` only up to whole periods.
    alternatives : tuple of float, seconds
        The other places within the search, whole periods from `seconds`.
    confidence : float in [0, 1]
        Share of 99 other tempos whose beats meet the motion's rests less well, wherever they are laid. Below 0.95
        there is no evidence that the motion keeps to these beats, and `seconds` means little.
    lags, curve : (L,) arrays
        The audio times tried (seconds), and the evidence: the distance of the joint speed below its mean at the
        music's beats, in standard deviations. NaN where too few beats fall into the motion.
    """

    seconds: float
    period: float
    alternatives: tuple[float, ...]
    confidence: float
    lags: FloatArray
    curve: FloatArray


def find_offset(
    audio: Audio,
    motion: Motion,
    *,
    music: BeatTrack | None = None,
    guess: float = 0.0,
    search: float = 2.0,
    params: HarmonyParams | None = None,
) -> Offset:
    """The moment of the music at which a motion begins, found from the movement alone: known up to whole beats.

    It takes for granted that the dancer is slow on the beats, so a score on this offset proves nothing about the place
    in the beat.

    Parameters
    ----------
    audio : Audio
        The song.
    motion : Motion
    music : BeatTrack, optional
        Beats on the audio's time line. When left out, a program finds them, and they are moved to the attacks of the
        sound. If it follows every second beat only, `Offset.period` is two beats.
    guess : float, seconds
        Moment of the music around which is sought.
    search : float, seconds
        Largest distance from the guess, to either side; 600 at most.
    params : HarmonyParams
        Its smoothing and its `lag` (the delay of a dancer's rest after the beat) are used; the recommended ones when
        left out.

    Returns
    -------
    Offset
        `seconds`, the place nearest to the guess; `period` and `alternatives`, whole beats away; `confidence`, of which
        less than .95 says that the motion may not keep to these beats at all; and the curve of evidence.

    Raises
    ------
    ValueError
        If nothing moves, fewer than four music beats fall into the motion, `guess` or `search` is out of range, or an
        argument is of another kind.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> clip = synthetic_clip("waltz", seconds=12.0, seed=7)
    >>> offset = find_offset(clip.audio, clip.motion.span(0.2, 11.0), music=clip.beats)
    >>> round(offset.seconds, 2)
    0.2
    """
    if not (np.isfinite(guess) and np.isfinite(search) and 0 < search <= 600):
        raise ValueError(f"search must lie between 0 and 600 s and guess be finite, got {search} and {guess}")
    params = params or HarmonyParams.recommended()
    check_kind(motion, Motion)
    check_kind(params, HarmonyParams)
    track = attack_beats(audio) if music is None else music
    check_kind(track, BeatTrack, "music")
    times, speed = _moving(motion, params)
    beats = track.times + params.lag
    lags = float(guess) + STEP * np.arange(-round(search / STEP), round(search / STEP) + 1, dtype=np.float64)
    curve = rest_at_beats(times, speed, beats, lags)
    if beats.size < FEWEST_BEATS or np.isnan(curve).all():
        raise ValueError(f"fewer than {FEWEST_BEATS} music beats fall into the dance: is there music, and enough?")
    period = 60.0 / track.tempo  # in which a pause is whole beats
    seconds = _nearest_peak(lags, curve, period, guess)
    most = int(2 * search / period) + 1
    others = seconds + period * np.delete(np.arange(-most, most + 1), most)
    inside = others[np.abs(others - guess) <= search + 1e-9]
    confidence = 1 - p_value(float(np.nanmax(curve)), _null(times, speed, beats, seconds, period))
    return Offset(seconds, period, tuple(inside.tolist()), confidence, lags, curve)


def _moving(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, FloatArray]:
    """Times and normalised shape speed of the frames that count; ValueError when nothing moves."""
    signal = shape_signal(shape_speed(motion, smoothing=params.position_smoothing))
    times, speed = signal.times, signal.values
    if not speed.any():
        raise ValueError("nothing moves in this motion; there is no offset to find")
    frames = np.clip((times * motion.fps).round().astype(np.int64), 0, motion.n_frames - 1)
    # Filler is neither slow nor fast.
    return times * params.clock, np.where(motion.valid[frames], speed, 0.0)


def rest_at_beats(times: FloatArray, speed: FloatArray, beats: FloatArray, lags: FloatArray) -> FloatArray:
    """Mean of minus the speed at the music's beats, for each lag of the motion.

    Parameters
    ----------
    times, speed : (T,) arrays, seconds and any unit
    beats : (B,) array, seconds of music
    lags : (L,) array, music time of motion time 0

    Returns
    -------
    (L,) array; NaN where the motion covers fewer than four beats, or half as many as at the best lag.

    Examples
    --------
    >>> times = np.arange(0, 4, 0.01)
    >>> speed = -np.cos(2 * np.pi * times)  # slowest at 0, 1, 2, 3 s
    >>> rest_at_beats(times, speed, np.arange(8) + 0.5, np.array([0.0, 0.5])).round(2)
    array([-1.,  1.])
    """
    moments = beats[None, :] - lags[:, None]
    inside = (moments >= times[0]) & (moments <= times[-1])
    count = inside.sum(axis=1)
    rest = -(np.interp(moments, times, speed) * inside).sum(axis=1) / np.maximum(count, 1)
    enough = count >= max(FEWEST_BEATS, LEAST_OVERLAP * count.max(initial=0))
    return np.where(enough, rest, np.nan)


def _nearest_peak(lags: FloatArray, curve: FloatArray, period: float, guess: float) -> float:
    """The best lag, moved by whole periods towards the guess, and to the top of the curve there."""
    filled = np.where(np.isnan(curve), -np.inf, curve)
    best = lags[filled.argmax()]
    near = best - period * np.round((best - guess) / period)
    around = np.where(np.abs(lags - near) <= period / 4, filled, -np.inf)
    top = int(around.argmax() if np.isfinite(around.max()) else filled.argmax())
    if not 0 < top < lags.size - 1 or not np.isfinite(filled[top - 1 : top + 2]).all():
        return float(lags[top])
    return float(lags[0] + STEP * refine_extrema(curve, np.array([top]))[0])


def _null(times: FloatArray, speed: FloatArray, beats: FloatArray, seconds: float, period: float) -> FloatArray:
    """The best evidence that beats of other tempos reach, wherever they are laid."""
    lags = seconds + np.arange(0.0, 1.25 * period, NULL_STEP)
    covered = beats[(beats >= seconds + times[0]) & (beats <= seconds + times[-1])]
    centre = covered.mean()
    best = [rest_at_beats(times, speed, centre + factor * (covered - centre), lags) for factor in OTHER_TEMPOS]
    return np.array([np.nanmax(curve) if np.isfinite(curve).any() else -np.inf for curve in best])


def attack_beats(audio: Audio) -> BeatTrack:
    """Music beats by `audio_beats`, all moved by one lag to where the sound sets in.

    The tracker's beats come 10 to 35 ms late, by about an analysis frame and depending on the sample rate and on the
    sounds. That is no matter for a tolerance of 0.1 s, but it is for an offset.
    """
    track = audio_beats(audio)
    if len(track) == 0:
        return track
    attacks = track.times + _lag_to_attacks(audio, track.times)
    inside = (attacks >= 0) & (attacks <= audio.duration)
    return replace(track.select(inside), times=attacks[inside])


def _lag_to_attacks(audio: Audio, beats: FloatArray) -> float:
    """Seconds from the beats to the steepest rise of the sound's level, on average over all beats."""
    frame = max(1, round(ATTACK_FRAME * audio.sample_rate))
    count = audio.samples.size // frame
    if count < 2:
        return 0.0
    pieces = audio.samples[: count * frame].reshape(count, frame)
    rate = audio.sample_rate / frame
    level = smooth(np.sqrt(np.mean(np.square(pieces, dtype=np.float64), axis=1)), ATTACK_SMOOTHING, rate)
    if level.max() <= 0:
        return 0.0
    rise = np.maximum(np.diff(np.log(level + 0.01 * level.max())), 0.0)
    lags = np.arange(TRACKER_LAGS[0], TRACKER_LAGS[1], ATTACK_FRAME)
    mean = np.interp(beats[None, :] + lags[:, None], np.arange(1, count) / rate, rise).mean(axis=1)
    return float(lags[smooth(mean, TRACKER_SPREAD, 1 / ATTACK_FRAME).argmax()]) if mean.any() else 0.0


def picture_motion(
    frames: Iterable[NDArray[np.uint8]],
    fps: float,
    *,
    watch: Callable[[SingleArray], None] | None = None,
    progress: Progress = silent,
) -> Motion:
    """The movement of a whole picture, as a point on a line.

    Everything in the picture counts, so the camera has to stand still.

    Parameters
    ----------
    frames, fps, watch, progress : see `harmolab.beats.flow.flow_directograms`

    Returns
    -------
    Motion of one joint, 2-D, frame i at i / fps seconds. Its unit is mean picture heights; its direction says nothing.

    Raises
    ------
    ValueError
        For frames that are none, an fps that cannot be, or less video than three times the flow's lag.
    """
    speed = flow_directograms(frames, fps, watch=watch, progress=progress).sum(axis=1)
    lag_frames = max(1, round(LAG * fps))
    if speed.size <= 3 * lag_frames:
        raise ValueError(f"a video of {speed.size} frames is too short to find movement in")
    # Row t was measured from t - lag to t and belongs half way between; step t of the way goes from frame t - 1 to t.
    steps = np.arange(1, speed.size)
    middles = np.arange(lag_frames, speed.size) - lag_frames / 2
    way = np.concatenate([[0.0], np.cumsum(np.interp(steps - 0.5, middles, speed[lag_frames:]))]) / fps
    return Motion(np.stack([way, np.zeros_like(way)], axis=1)[:, None, :], fps, PICTURE)


# The offset from the sound of both, not modulo the beat

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
REPEATS = "Another place fits nearly as well: the song repeats itself, or another song plays in the video."


@dataclass(frozen=True)
class SoundOffset:
    """The song time at which a recording begins, and the evidence.

    Parameters
    ----------
    seconds : float
        Song time of the recording's first moment; negative where it begins before the song.
    height : float
        Evidence: height of the best lag above the median of all lags, in standard deviations of a Gaussian with
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

    Lags that share too little are 0. The others are divided by the root of the shared length, as chance grows with it.
    """
    length = part.shape[1]
    total = np.asarray(sum(scipy.signal.fftconvolve(song, band[::-1]) for band, song in zip(part, whole, strict=True)))
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
    frequencies, _, spectrum = scipy.signal.stft(samples, RATE, nperseg=size, noverlap=size - hop)
    edges = np.geomspace(LOWEST, highest, BANDS + 1)
    power = np.abs(spectrum) ** 2
    bands = np.stack([power[_inside(frequencies, *pair)].mean(axis=0) for pair in pairwise(edges)])
    loudest = bands.max(axis=1, keepdims=True)
    if loudest.max() <= 1e-12:
        raise ValueError(f"the {name} is silent")
    level = np.log(bands + FLOOR**2 * np.maximum(loudest, FLOOR**2 * loudest.max()))
    rise = np.pad(np.maximum(level[:, 2:] - level[:, :-2], 0.0), ((0, 0), (1, 1)))
    # Each band less its mean around each moment, in units of its spread.
    width = round(LOCAL / HOP) | 1
    rest = rise - scipy.signal.fftconvolve(rise, np.full((1, width), 1 / width), mode="same", axes=1)
    return np.asarray(rest / np.maximum(rest.std(axis=1, keepdims=True), 1e-9))


def _inside(frequencies: FloatArray, low: float, high: float) -> NDArray[np.intp]:
    """Places of the frequencies in a band; the nearest one where none falls inside."""
    places = np.flatnonzero((frequencies >= low) & (frequencies < high))
    return places if places.size else np.array([np.abs(frequencies - np.sqrt(low * high)).argmin()])
