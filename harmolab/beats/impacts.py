"""Impacts: from a directogram to the envelope of sudden stops and its peaks (Davis & Agrawala 2018; Eq. 4-5).

The directogram comes from `beats.flow`. An impact is where braking is strongest. For a sudden stop that is the stop
itself; in a smooth movement it comes about a tenth of a second before the standstill that `beats.visual` finds as a
valley of the joint speed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import correlate1d, maximum_filter, maximum_filter1d, median_filter, uniform_filter1d
from scipy.signal import find_peaks

from harmolab.kinematics import refine_extrema, smooth
from harmolab.types import BeatTrack, FloatArray, IntArray

RADIUS = 0.15  # seconds, t_2 of Eq. 5
AROUND = 0.3  # seconds
THRESHOLD = 0.1  # c_2 of Eq. 5


def impact_envelope(directograms: ArrayLike, *, lag_frames: int = 1, smoothing_frames: float = 0.0) -> FloatArray:
    """Speed lost around each frame, summed over the directions.

    A median over 2 lag_frames + 1 frames goes first: it keeps the edge of a stop and takes out a spike (a cut between
    scenes) or a gap (a frame shown twice), each of which would look like a stop. Neighbouring directions are mixed
    1 : 2 : 1, so that a limb that swings round from one bin into the next does not look like one that stops.

    Parameters
    ----------
    directograms : (T, K) array; row t was measured from frame t - lag_frames to frame t
    lag_frames : int
        t_1 of Eq. 4.
    smoothing_frames : float
        Standard deviation of a Gaussian along time.

    Returns
    -------
    (T,) array in the unit of `directograms`, u(t) = sum over theta of max(0, D(t, theta) - D(t + t_1, theta)):
    the movement before frame t less the movement after it. The ends repeat the nearest value, so they hold no peak.
    """
    columns = np.asarray(directograms, dtype=np.float64)
    if len(columns) <= 2 * lag_frames:
        return np.zeros(len(columns))
    trend = median_filter(columns[lag_frames:], size=(2 * lag_frames + 1, 1), mode="mirror")
    trend = correlate1d(trend, [0.25, 0.5, 0.25], axis=1, mode="wrap")
    trend = smooth(trend, smoothing_frames, 1.0)
    lost = np.maximum(trend[:-lag_frames] - trend[lag_frames:], 0.0).sum(axis=1)
    return np.pad(lost, lag_frames, mode="edge")


def normalise_envelope(
    envelope: FloatArray, *, radius_frames: int, floor: float = 0.0, percentile: float = 95.0
) -> FloatArray:
    """The envelope in units of its high peaks, clipped at 1.

    Davis and Agrawala clip at a percentile of all frames, which also cuts down the few true impacts of a quiet
    video; here the percentile is taken over the peaks.

    Parameters
    ----------
    envelope : (T,) array
    radius_frames : int
        Distance within which a peak is the highest.
    floor : float
        If no peak is higher than this, nothing happens in the video and the result is 0 throughout.
    percentile : float, of the heights of the peaks above the floor

    Returns
    -------
    (T,) array in [0, 1]
    """
    heights = envelope[_maxima(envelope, radius_frames)]
    heights = heights[heights > floor]
    if heights.size == 0:
        return np.zeros_like(envelope)
    return np.minimum(envelope / np.percentile(heights, percentile), 1.0)


def local_peaks(
    envelope: FloatArray, *, radius_frames: int, threshold: float, reading: str = "mean", mean_frames: int = 1
) -> IntArray:
    """Frames t with B_v(t) = 1 (Eq. 5).

    Parameters
    ----------
    envelope : (T,) array, d(t)
    radius_frames : int
        t_2: a peak is the highest value within so many frames on either side. The middle of equal values counts.
    threshold : float
        c_2: by how much a peak exceeds what is around it.
    reading : "mean" or "literal"
        What is around it: the mean over `mean_frames` on either side (Davis and Agrawala), or each single value
        within the radius, to the letter of Eq. 5, so that a smooth peak does not pass at a high frame rate.
    mean_frames : int

    Returns
    -------
    (B,) int array, increasing
    """
    frames = _maxima(envelope, radius_frames)
    if reading == "mean":
        around = uniform_filter1d(envelope, 2 * mean_frames + 1, mode="nearest")
    elif reading == "literal":
        neighbours = np.arange(-radius_frames, radius_frames + 1) != 0
        around = maximum_filter(envelope, footprint=neighbours, mode="nearest")
    else:
        raise ValueError(f"reading must be mean or literal, got {reading!r}")
    return frames[envelope[frames] - around[frames] > threshold]


def _maxima(envelope: FloatArray, radius_frames: int) -> IntArray:
    """Positive local maxima that nothing within the radius exceeds; of equals within the radius, one."""
    if not envelope.size:
        return np.zeros(0, np.int64)
    frames, _ = find_peaks(envelope, distance=radius_frames + 1, height=np.finfo(float).tiny)
    highest = maximum_filter1d(envelope, 2 * radius_frames + 1, mode="nearest")
    return frames[envelope[frames] >= highest[frames]].astype(np.int64)


def envelope_beats(
    envelope: FloatArray, fps: float, *, radius: float = RADIUS, around: float = AROUND, threshold: float = THRESHOLD
) -> BeatTrack:
    """Visual beats of an impact envelope (Eq. 5); their strength is its height.

    Parameters
    ----------
    envelope : (T,) array in [0, 1], from `flow_envelope`
    fps : float, hertz
    radius : float, seconds, t_2
    around : float, seconds
        A beat is measured against the mean over this time on either side.
    threshold : float, c_2
    """
    radius_frames, mean_frames = (max(1, round(window * fps)) for window in (radius, around))
    frames = local_peaks(envelope, radius_frames=radius_frames, threshold=threshold, mean_frames=mean_frames)
    return BeatTrack(refine_extrema(envelope, frames) / fps, envelope[frames], fps, len(envelope) / fps)
