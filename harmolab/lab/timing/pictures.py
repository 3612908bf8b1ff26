"""A video as a motion: one point that travels as fast as the picture moves.

Optical flow says how fast the picture moves at each moment, all pixels together. The point has that speed, so whatever
reads joint speed (visual beats, the score by a bar pattern, the offset) reads a video in the same way: its beats are
the moments of rest, as those of a skeleton are, and not the impacts that `harmolab.beats.flow.flow_beats` marks a
tenth of a second before them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from harmolab.beats.flow import LAG, flow_directograms
from harmolab.io.files import Progress, silent
from harmolab.types import Motion, Skeleton

PICTURE = Skeleton(("picture",), (-1,))


def picture_motion(
    frames: Iterable[NDArray[np.uint8]], fps: float, *, lag: float = LAG, progress: Progress = silent
) -> Motion:
    """The movement of a whole picture, as a point on a line.

    Everything in the picture counts, so the camera has to stand still.

    Parameters
    ----------
    frames, fps, lag, progress : see `harmolab.beats.flow.flow_directograms`

    Returns
    -------
    Motion of one joint, 2-D, frame i at i / fps seconds. Its unit is mean picture heights; its direction says nothing.

    Raises
    ------
    ValueError
        For frames that are none, an fps or a lag that cannot be, or fewer than three lags of video.
    """
    speed = flow_directograms(frames, fps, lag=lag, progress=progress).sum(axis=1)
    lag_frames = max(1, round(lag * fps))
    if speed.size <= 3 * lag_frames:
        raise ValueError(f"a video of {speed.size} frames is too short to find movement in")
    # Row t was measured from t - lag to t and belongs half way between; step t of the way goes from frame t - 1 to t.
    steps = np.arange(1, speed.size)
    middles = np.arange(lag_frames, speed.size) - lag_frames / 2
    way = np.concatenate([[0.0], np.cumsum(np.interp(steps - 0.5, middles, speed[lag_frames:]))]) / fps
    return Motion(np.stack([way, np.zeros_like(way)], axis=1)[:, None, :], fps, PICTURE)
