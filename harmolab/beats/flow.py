"""Visual beats from video: optical flow, directogram, impact envelope and its peaks (Davis & Agrawala 2018; Eq. 4-5).

A dancer who stops makes an *impact*. It is found in four steps:

1. *Optical flow* says how fast each pixel moves, and where to.
2. The *directogram* D(t, theta) adds up the speed in each direction theta, as a spectrogram adds up sound by pitch.
3. The *impact envelope* is the speed that is lost around each frame, in all directions together. It is the counterpart
   of a sound's onset envelope, and d(t) of Eq. 4, with flow as the motion trend MT; t_1 is the time between the two
   moments that are compared.
4. Its peaks are the visual beats, B_v(t) of Eq. 5: t_2 is the time on either side within which a peak is the highest,
   c_2 the height by which it exceeds what is around it.

An impact is where braking is strongest. For a sudden stop that is the stop itself. In a smooth movement it comes about
a tenth of a second before the standstill, which `beats.visual` finds as a valley of the joint speed.

Angles follow the picture: x to the right, y DOWN, so 0 is movement to the right, pi / 2 downwards, pi to the left and
3 pi / 2 upwards. Speeds are picture heights per second, lags and windows are seconds, so that neither resolution nor
frame rate decides what a beat is. The whole picture counts: a moving background counts as much as the dancer (Fig. 2),
and a light that fades within a second looks like movement.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import correlate1d, maximum_filter, maximum_filter1d, median_filter, uniform_filter1d

from harmolab.body.kinematics import refine_extrema, smooth
from harmolab.files import Progress, silent
from harmolab.types import BeatTrack, FloatArray, IntArray, SingleArray, frozen_array

# Impact envelope and its peaks (Eq. 4-5)

RADIUS = 0.15  # seconds, t_2 of Eq. 5
AROUND = 0.3  # seconds
THRESHOLD = 0.1  # c_2 of Eq. 5


def impact_envelope(directograms: ArrayLike, *, lag_frames: int = 1, smoothing_frames: float = 0.0) -> FloatArray:
    """Impact envelope: the speed that is lost around each frame, summed over the directions (Eq. 4 of a video).

    First each direction is replaced by its median over 2 lag_frames + 1 frames. That keeps the edge of a stop, and
    takes out a spike (a cut between scenes) or a gap (a frame shown twice), which would look like a stop. Neighbouring
    directions are mixed 1 : 2 : 1, so that a limb that swings from one direction into the next is not taken for one
    that stops.

    Parameters
    ----------
    directograms : (T, K) array; row t was measured from frame t - lag_frames to frame t
    lag_frames : int
        t_1 of Eq. 4.
    smoothing_frames : float
        Standard deviation of a Gaussian along time.

    Returns
    -------
    (T,) array in the unit of `directograms`: u(t) = sum over theta of max(0, D(t, theta) - D(t + t_1, theta)), the
    movement before frame t less the movement after it. The ends repeat the nearest value, so they hold no peak.
    """
    columns = np.asarray(directograms, dtype=np.float64)
    if len(columns) <= 2 * lag_frames:
        return np.zeros(len(columns))
    trend = median_filter(columns[lag_frames:], size=(2 * lag_frames + 1, 1), mode="mirror")
    trend = correlate1d(trend, [0.25, 0.5, 0.25], axis=1, mode="wrap")
    trend = smooth(trend, smoothing_frames, 1.0)
    lost = np.maximum(trend[:-lag_frames] - trend[lag_frames:], 0.0).sum(axis=1)
    return np.pad(lost, lag_frames, mode="edge")


def normalise_envelope(envelope: FloatArray, *, radius_frames: int, floor: float = 0.0) -> FloatArray:
    """The envelope in units of its high peaks, clipped at 1.

    Davis and Agrawala clip at a percentile of all frames, which also cuts down the few true impacts of a quiet
    video; here the 95th percentile is taken over the peaks above the floor.

    Parameters
    ----------
    envelope : (T,) array
    radius_frames : int
        Distance within which a peak is the highest.
    floor : float
        If no peak is higher than this, nothing happens in the video and the result is 0 throughout.

    Returns
    -------
    (T,) array in [0, 1]
    """
    heights = envelope[_maxima(envelope, radius_frames)]
    heights = heights[heights > floor]
    if heights.size == 0:
        return np.zeros_like(envelope)
    return np.minimum(envelope / np.percentile(heights, 95.0), 1.0)


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
        around = maximum_filter(envelope, footprint=np.arange(-radius_frames, radius_frames + 1) != 0, mode="nearest")
    else:
        raise ValueError(f"reading must be mean or literal, got {reading!r}")
    return frames[envelope[frames] - around[frames] > threshold]


def _maxima(envelope: FloatArray, radius_frames: int) -> IntArray:
    """Positive local maxima that nothing within the radius exceeds; of equals within the radius, one."""
    if not envelope.size:
        return np.zeros(0, np.int64)
    frames, _ = scipy.signal.find_peaks(envelope, distance=radius_frames + 1, height=np.finfo(float).tiny)
    highest = maximum_filter1d(envelope, 2 * radius_frames + 1, mode="nearest")
    return frames[envelope[frames] >= highest[frames]].astype(np.int64)


def envelope_beats(
    envelope: FloatArray, fps: float, *, radius: float = RADIUS, around: float = AROUND, threshold: float = THRESHOLD
) -> BeatTrack:
    """Visual beats of an impact envelope: its peaks (Eq. 5); their strength is the height of the peak.

    A beat is the highest value within `radius` on either side, and exceeds the mean over `around` on either side by
    more than `threshold`. Its time lies between frames, at the top of a parabola.

    Parameters
    ----------
    envelope : (T,) array, 0 to 1, as of `flow_envelope`
    fps : float, hertz, of the envelope
    radius : float, seconds, t_2
    around : float, seconds
    threshold : float, c_2, in units of the envelope

    Returns
    -------
    BeatTrack of T / fps seconds

    Raises
    ------
    ValueError
        If the envelope is no list of finite numbers.

    Examples
    --------
    >>> envelope = np.zeros(50)
    >>> envelope[20] = 1.0
    >>> envelope_beats(envelope, 10.0).times.tolist()
    [2.0]
    """
    envelope = frozen_array(envelope, "envelope")
    radius_frames, mean_frames = (max(1, round(window * fps)) for window in (radius, around))
    frames = local_peaks(envelope, radius_frames=radius_frames, threshold=threshold, mean_frames=mean_frames)
    return BeatTrack(refine_extrema(envelope, frames) / fps, envelope[frames], fps, len(envelope) / fps)


# Optical flow and directogram, and the visual beats of a video

Frame = NDArray[np.uint8]

N_BINS = 16  # directions
SMALLEST_SIDE = 16  # pixels; the coarse grid of the flow has nothing to hold on to below
CHANGED = 2  # grey levels of 255, mean over 5 x 5 pixels
STILL = 0.02  # picture heights per second; slower is the noise of the camera and of the flow itself
LAG = 0.04  # seconds, t_1 of Eq. 4
SMOOTHING = 0.04  # seconds; without it the noise of the flow decides which frame of an impact is highest
# Picture heights per second, mean over the picture: a video without any impact above this counts as still. A limb that
# covers 1 % of the picture and stops from half a picture height per second makes 0.002 after the smoothing.
FLOOR = 1e-4


def optical_flow(previous: Frame, current: Frame) -> SingleArray:
    """Displacement of each pixel of `previous` (dense inverse search, Kroeger et al. 2016).

    Parameters
    ----------
    previous, current : (H, W) uint8 arrays, grey

    Returns
    -------
    (H, W, 2) float32 array, pixels to the right and pixels down; 0 where the picture has not changed
    """
    before, after = np.ascontiguousarray(previous), np.ascontiguousarray(current)
    engine: Any = cv2.DISOpticalFlow.create(cv2.DISOpticalFlow_PRESET_ULTRAFAST)
    # The method spreads a limb's movement far over a plain wall: six times the limb's own, up and down by a third from
    # frame to frame. Where the picture has not changed, nothing has moved.
    return cv2.copyTo(engine.calc(before, after, None), _changed(before, after)).astype(np.float32, copy=False)


def _changed(before: Frame, after: Frame) -> Frame:
    """(H, W) mask, not 0 at the pixels whose surroundings differ by more than the noise of the picture."""
    difference = cv2.subtract(after, before, dtype=cv2.CV_16S)
    # Noise differs from pixel to pixel, while what moves changes whole areas. For Gaussian noise the lower quartile of
    # the first times 3 is four standard deviations of what a 5 x 5 mean leaves of it.
    grain = np.abs(difference - cv2.blur(difference, (3, 3)))[::4, ::4].ravel()
    noise = float(np.partition(grain, grain.size // 4)[grain.size // 4])
    change = cv2.absdiff(cv2.blur(before, (5, 5)), cv2.blur(after, (5, 5)))
    mask = (change > CHANGED + 3 * noise).view(np.uint8)
    # Where a bright place passes into an equally bright one nothing changes for a moment: close such gaps.
    return cv2.dilate(mask, np.ones((5, 5), np.uint8)).view(np.uint8)


def directogram(flow: SingleArray, *, n_bins: int = N_BINS, still: float = 0.0) -> FloatArray:
    """Movement in each direction: one column D(t, theta) of the directogram.

    Parameters
    ----------
    flow : (H, W, 2) array, pixels right and pixels down
    n_bins : int
        Bin k is centred on the angle 2 pi k / n_bins (0 right, a quarter turn down: y points down).
    still : float, pixels
        Displacements up to this length count as none.

    Returns
    -------
    (n_bins,) array, pixels: displacement in the directions of each bin, as a mean over all pixels
    """
    # The flow is smooth over four pixels, so every other one tells the same in a quarter of the time.
    right, down = np.ascontiguousarray(flow[::2, ::2, 0]), np.ascontiguousarray(flow[::2, ::2, 1])
    length, angle = cv2.cartToPolar(right, down)
    moving = length > still
    bins = np.round(angle[moving] * (n_bins / (2 * np.pi))).astype(np.intp) % n_bins
    return np.bincount(bins, length[moving], n_bins) / length.size


def flow_directograms(
    frames: Iterable[Frame],
    fps: float,
    *,
    lag: float = LAG,
    watch: Callable[[SingleArray], None] | None = None,
    progress: Progress = silent,
) -> FloatArray:
    """The directogram of a video, for the eye and for `impact_envelope`.

    Frames are read one by one and forgotten; only the directogram grows with the video.

    Parameters
    ----------
    frames : iterable of (H, W) grey or (H, W, 3) RGB uint8 arrays, all of one shape
        240 pixels high is enough; the time taken grows with the area.
    fps : float, hertz
    lag : float, seconds
        t_1 of Eq. 4: flow is measured over this time (at least one frame), so that 25 and 50 fps see the same.
    watch : function(speed), called with the speed of every pixel, (H, W) picture heights per second, of each flow
    progress : function(iterable, label) -> iterable

    Returns
    -------
    (T, 16) array, picture heights per second, mean over the picture. Pixels slower than `STILL` (0.02) do not count.
    Row t has the movement from second t / fps - lag to t / fps; the rows before the first lag are 0.

    Raises
    ------
    ValueError
        If a frame is no uint8 picture, is smaller than 16 pixels, or differs in size from the first; if fps or lag is
        not positive; if there is no frame.
    """
    lag_frames = _lag_frames(lag, fps)
    per_second = fps / lag_frames
    recent: deque[Frame] = deque(maxlen=lag_frames + 1)
    rows = []
    for frame in _grey(progress(frames, "reading the pictures")):
        recent.append(frame)
        row = np.zeros(N_BINS)
        if len(recent) > lag_frames:
            height = frame.shape[0]
            flow = optical_flow(recent[0], frame)
            row = directogram(flow, still=STILL * height / per_second) * (per_second / height)
            if watch is not None:
                watch(np.hypot(flow[..., 0], flow[..., 1]) * np.float32(per_second / height))
        rows.append(row)
    if not rows:
        raise ValueError("a video needs at least one frame, got none")
    return np.stack(rows)


def _grey(frames: Iterable[Frame]) -> Iterator[Frame]:
    """Grey frames, each checked to be a picture of the size of the first."""
    first: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        picture = np.asarray(frame)
        if picture.dtype != np.uint8 or picture.ndim not in (2, 3) or picture.shape[2:] not in ((), (3,)):
            raise ValueError(
                f"frame {number} must be (H, W) grey or (H, W, 3) RGB of uint8, got {picture.shape} of {picture.dtype}"
            )
        first = first or picture.shape
        if picture.shape != first:
            raise ValueError(f"frame {number} has shape {picture.shape}, the first has {first}; bring them to one size")
        if min(picture.shape[:2]) < SMALLEST_SIDE:
            raise ValueError(f"frames need at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels, got {picture.shape[:2]}")
        # A copy: the source of the frames may draw the next into the same memory.
        grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        yield np.array(grey, dtype=np.uint8, order="C")


def _lag_frames(lag: float, fps: float) -> int:
    """`lag` seconds in frames, at least one; checks both."""
    if not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be positive and finite, got {fps}")
    if not 0 < lag <= 1:
        raise ValueError(f"lag must lie between 0 and 1 seconds, got {lag}")
    return max(1, round(lag * fps))


def flow_envelope(frames: Iterable[Frame], fps: float, *, lag: float = LAG, progress: Progress = silent) -> FloatArray:
    """The impact envelope of a video: how strongly anything in the picture stops, at each frame (Eq. 4).

    `envelope_beats` finds the visual beats in it.

    Parameters
    ----------
    frames : iterable of (H, W) grey or (H, W, 3) RGB uint8 arrays, all of one shape
        Read one by one and forgotten. 240 pixels high is enough; the time taken grows with the area.
    fps : float, hertz
    lag : float, seconds
        t_1 of Eq. 4: the movement before a moment is compared with that so much later. At least one frame, at most 1 s.
    progress : function(iterable, label) -> iterable
        Reports on the frames, such as a progress bar.

    Returns
    -------
    (T,) array from 0 to 1, 0 throughout for a still video; value i belongs to second i / fps

    Raises
    ------
    ValueError
        If a frame is no uint8 picture, is smaller than 16 pixels, or differs in size from the first; if `fps` or `lag`
        is out of range; if there is no frame.
    """
    columns = flow_directograms(frames, fps, lag=lag, progress=progress)
    impacts = impact_envelope(columns, lag_frames=_lag_frames(lag, fps), smoothing_frames=SMOOTHING * fps)
    return normalise_envelope(impacts, radius_frames=max(1, round(RADIUS * fps)), floor=FLOOR)


def flow_beats(frames: Iterable[Frame], fps: float, *, lag: float = LAG, progress: Progress = silent) -> BeatTrack:
    """Visual beats of a video: sudden stops of anything in the picture (Eq. 4-5; Davis & Agrawala 2018).

    A video in which nothing stops has no beats. The parameters are those of `flow_envelope`; for other settings take
    that and `envelope_beats` one after the other.

    Returns
    -------
    BeatTrack of T / fps seconds; strengths are in (0, 1]
    """
    return envelope_beats(flow_envelope(frames, fps, lag=lag, progress=progress), fps)
