"""The offset of a motion in its music, from its movement: the audio time of its first frame.

Dancers slow down on the beat. So the motion's speed curve is slid along the music, and its slowness at the music's
beats, lag by lag, is the evidence. Beats repeat: an offset that is wrong by a whole beat fits as well, and
the result names these alternatives.

A video becomes a motion first: one point that travels as fast as the picture moves, all pixels together. Visual beats,
the score by a bar pattern and the offset read that speed as they read joint speed: the beats of a video are the
moments of rest, as those of a skeleton are, and not the impacts that `harmolab.beats.flow.flow_beats` marks a tenth of
a second before them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from harmolab.bar_pattern import normalised_speed
from harmolab.beats.audio import audio_beats
from harmolab.beats.flow import LAG, flow_directograms
from harmolab.io.files import Progress, silent
from harmolab.kinematics import refine_extrema, smooth
from harmolab.params import HarmonyParams
from harmolab.significance import p_value
from harmolab.types import Audio, BeatTrack, FloatArray, Motion, Skeleton

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
    """The audio time of motion frame 0, as far as beats can tell it.

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
    """The audio time of motion frame 0, modulo the beat.

    Parameters
    ----------
    audio : Audio
    motion : Motion
    music : BeatTrack, optional
        Beats on the audio's time line. Left out, they are tracked and moved to the attacks (`attack_beats`). Where a
        tracker follows every second beat only, `period` is two beats.
    guess : float, seconds
    search : float, seconds
        Largest distance from the guess, to either side.
    params : HarmonyParams, default ``HarmonyParams.recommended()``
        Its smoothing and its `lag` (the delay of a dancer's rest after the beat) are used.

    Raises
    ------
    ValueError
        When nothing moves, fewer than four music beats fall into the motion, or `search` is not positive.

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
    times, speed = _moving(motion, params)
    track = attack_beats(audio) if music is None else music
    beats = track.times + params.lag
    lags = float(guess) + STEP * np.arange(-round(search / STEP), round(search / STEP) + 1, dtype=np.float64)
    curve = rest_at_beats(times, speed, beats, lags)
    if beats.size < FEWEST_BEATS or np.isnan(curve).all():
        raise ValueError(f"fewer than {FEWEST_BEATS} music beats fall into the motion; nothing tells its offset")
    period = float(np.polyfit(np.arange(beats.size), beats, 1)[0])
    seconds = _nearest_peak(lags, curve, period, guess)
    most = int(2 * search / period) + 1
    others = seconds + period * np.delete(np.arange(-most, most + 1), most)
    inside = others[np.abs(others - guess) <= search + 1e-9]
    confidence = 1 - p_value(float(np.nanmax(curve)), _null(times, speed, beats, seconds, period))
    return Offset(seconds, period, tuple(inside.tolist()), confidence, lags, curve)


def _moving(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, FloatArray]:
    """Times and normalised speed of the frames that count; ValueError when nothing moves."""
    times, speed = normalised_speed(motion, replace(params, clock=1.0))
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


def attack_beats(audio: Audio, *, tempo: str | tuple[float, float] | None = None) -> BeatTrack:
    """Music beats by `audio_beats`, all moved by one lag to where the sound sets in.

    The tracker's beats come 10 to 35 ms late, by about an analysis frame and depending on the sample rate and on the
    sounds. That is no matter for a tolerance of 0.1 s, but it is for an offset.

    Parameters
    ----------
    audio : Audio
    tempo : as in `audio_beats`
    """
    track = audio_beats(audio, tempo=tempo)
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
    watch: Callable[[NDArray[np.float32]], None] | None = None,
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
