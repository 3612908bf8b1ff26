"""From the beats of a song to the meters that are danced one after the other, and the frames of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.unit_corpus import meter_spans
from harmolab.types import BeatTrack, FloatArray

DEFAULT_PERIOD = 0.5  # seconds between beats where the music has none
LONGEST_INTERVAL = 2.5  # in usual intervals; beats are put into longer ones
# A beat that lies this share of a frame before a frame counts as on it.
EDGE = 1e-6


@dataclass(frozen=True)
class MeterFrames:
    """One meter and the beats before it, in frames of a dance whose frame 0 is its first.

    Parameters
    ----------
    begin, meter, end : int
        First frame of the beats before, first frame of the meter, frame after its last. `begin` may be negative.
    share : float
        Length of the beats before, as a share of the longest possible prior (before a meter of four beats).
    """

    begin: int
    meter: int
    end: int
    share: float


def filled_beats(track: BeatTrack, start: float, end: float, *, before: int) -> tuple[FloatArray, FloatArray]:
    """Times and strengths of a track's beats, with beats added where it has none between `start` and `end`.

    Parameters
    ----------
    track : BeatTrack
    start, end : float, seconds
        The beats reach from `before` beats before `start` to `end` at least.
    before : int

    Returns
    -------
    (B,) times, which may be negative, and (B,) strengths; added beats go on by the median interval, with the median
    strength, so that they are never accents. Without two beats to go by they are half a second apart.
    """
    times, strengths = track.times, track.strengths
    period = float(np.median(np.diff(times))) if times.size > 1 else DEFAULT_PERIOD
    usual = float(np.median(strengths)) if times.size else 1.0
    if not times.size:
        times, strengths = np.array([start]), np.array([usual])
    early = before + max(0, int(np.ceil((times[0] - start) / period)))
    late = max(0, int(np.ceil((end - times[-1]) / period + EDGE)))
    times = np.concatenate(
        [times[0] - period * np.arange(early, 0, -1), times, times[-1] + period * np.arange(1, late + 1)]
    )
    strengths = np.concatenate([np.full(early, usual), strengths, np.full(late, usual)])
    return _without_gaps(times, strengths, period, usual)


def _without_gaps(
    times: FloatArray, strengths: FloatArray, period: float, usual: float
) -> tuple[FloatArray, FloatArray]:
    """The same with evenly spaced beats in every interval that is much longer than usual."""
    intervals = np.diff(times)
    pieces = np.where(intervals > LONGEST_INTERVAL * period, np.round(intervals / period), 1).astype(np.int64)
    at = np.concatenate([[0], np.cumsum(pieces)])  # where the old beats stand among the new
    filled = np.full(at[-1] + 1, usual)
    filled[at] = strengths
    return np.interp(np.arange(at[-1] + 1), at, times), filled


def meter_frames(
    track: BeatTrack, features: FeatureParams, *, start: float, n_frames: int, fps: float
) -> list[MeterFrames]:
    """The meters that cover a dance, in order, without gaps; the first may begin before the dance.

    Parameters
    ----------
    track : BeatTrack on the audio time line
    features : FeatureParams
    start : float, seconds of audio time, of the dance's first frame
    n_frames : int, length of the dance
    fps : float, hertz
    """
    longest = features.unit_beats
    times, strengths = filled_beats(track, start, start + n_frames / fps, before=2 * longest)
    shifted = times - times[0]  # a beat track has no negative times
    spans = meter_spans(BeatTrack(shifted, strengths, track.fps, float(shifted[-1]) + 1.0), features)
    frames = np.floor((times - start) * fps + EDGE).astype(np.int64)
    meters = []
    for first, count in spans:
        meter, end = int(frames[first]), int(frames[first + count])
        before = min(max(longest - count, 1), first)
        if end > max(meter, 0) and meter < n_frames and before:
            begin = min(int(frames[first - before]), meter - 1)
            meters.append(MeterFrames(begin, meter, end, min(before / (longest - 4), 1.0)))
    return meters
