"""Length of a dance: as long as asked for, and no longer than its music."""

from __future__ import annotations

import numpy as np

from harmolab.types import Audio


def n_frames(audio: Audio, start: float, seconds: float | None, fps: float) -> int:
    """Frames of a dance from second `start` of the music on; to its end when `seconds` is None or longer.

    Raises
    ------
    ValueError
        Where there is no music for two frames.
    """
    if not 0 <= start < audio.duration:
        raise ValueError(f"start must lie within the music (0 to {audio.duration:.2f} s), got {start:g} s")
    if seconds is not None and not 0 < seconds < np.inf:
        raise ValueError(f"seconds must be positive, got {seconds:g}")
    length = min(audio.duration - start, np.inf if seconds is None else seconds)
    frames = int(length * fps + 1e-6)
    if frames < 2:
        raise ValueError(f"{length:.3f} s of music are less than two frames at {fps:g} per second")
    return frames
