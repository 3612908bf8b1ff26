"""Points of several detectors as one set (reading 7): each point from the source that is surest of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harmolab.io.player_points import PLAYER_50, player_skeleton
from harmolab.types import FloatArray, Motion


@dataclass(frozen=True, eq=False)
class Detections:
    """Points of one detector and how sure it is of them.

    Parameters
    ----------
    motion : Motion, (T, P, 2)
    confidence : (T, P) array, 0 (not detected; the place is filled in) and up
    """

    motion: Motion
    confidence: FloatArray

    def __post_init__(self) -> None:
        confidence = np.array(self.confidence, dtype=np.float64)
        shape = self.motion.positions.shape
        if shape[2] != 2:
            raise ValueError("detected points are (T, P, 2), got three coordinates")
        if confidence.shape != shape[:2] or not (np.isfinite(confidence).all() and (confidence >= 0).all()):
            raise ValueError(f"confidence must be {shape[:2]} numbers that are not negative, got {confidence.shape}")
        confidence.setflags(write=False)
        object.__setattr__(self, "confidence", confidence)


def merged(sources: Sequence[Detections]) -> Detections:
    """Every point that any source has, in each frame from the source with the highest confidence (reading 7).

    Sources may have different points, by name; of equal confidences the earlier source counts. The result has the
    points of `PLAYER_50` first, in its order, and is valid in frames where the source of any of its points is.

    ValueError without sources, or where their frames or rates differ.
    """
    if not sources:
        raise ValueError("there are no detections to merge")
    first = sources[0].motion
    for source in sources[1:]:
        if (source.motion.n_frames, source.motion.fps) != (first.n_frames, first.fps):
            raise ValueError(
                f"detectors saw {first.n_frames} frames at {first.fps:g} fps and {source.motion.n_frames} at "
                f"{source.motion.fps:g}; run them on the same video, or resample one (resample_motion)"
            )
    names = _joint_names(sources)
    shape = (len(sources), first.n_frames, len(names))
    confidence, positions = np.full(shape, -1.0), np.zeros((*shape, 2))
    for number, source in enumerate(sources):
        columns = [names.index(name) for name in source.motion.skeleton.joints]
        confidence[number][:, columns] = source.confidence
        positions[number][:, columns] = source.motion.positions
    best = confidence.argmax(axis=0)[None]
    points = np.take_along_axis(positions, best[..., None], axis=0)[0]
    valid = np.stack([source.motion.valid for source in sources])[best[0], np.arange(first.n_frames)[:, None]]
    motion = Motion(points, first.fps, player_skeleton(names), valid.any(axis=1))
    return Detections(motion, np.take_along_axis(confidence, best, axis=0)[0])


def _joint_names(sources: Sequence[Detections]) -> list[str]:
    """Names of all joints of the sources, those of `PLAYER_50` first."""
    names = dict.fromkeys(name for source in sources for name in source.motion.skeleton.joints)
    return [*(name for name in PLAYER_50.joints if name in names), *names.keys() - set(PLAYER_50.joints)]
