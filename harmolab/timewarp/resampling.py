"""A motion seen at other moments, its bones kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from harmolab.skeletons import tree_order
from harmolab.types import Motion

__all__ = ["motion_at"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def motion_at(motion: Motion, times: FloatArray) -> Motion:
    """The motion's poses at the given times, one a frame.

    Roots follow cubic splines. Bones turn along cubic splines of their direction, and their lengths are interpolated
    linearly, so a bone of constant length keeps it.

    Parameters
    ----------
    motion : Motion of T frames
    times : (T',) array, seconds from the first frame, within 0 and (T - 1) / fps

    Raises
    ------
    ValueError
        When the skeleton's bones form a ring.
    """
    frames = np.clip(times * motion.fps, 0.0, motion.n_frames - 1)
    parents = np.array(motion.skeleton.parents)
    is_root = parents < 0
    parts = np.where(is_root[:, None], motion.positions, motion.positions - motion.positions[:, parents])
    old = np.arange(motion.n_frames)
    positions = CubicSpline(old, parts)(frames)
    positions[:, ~is_root] = _turned(parts[:, ~is_root], positions[:, ~is_root], frames)
    for joint in tree_order(motion.skeleton.parents):
        if not is_root[joint]:
            positions[:, joint] += positions[:, parents[joint]]
    return Motion(positions, motion.fps, motion.skeleton, motion.valid[frames.round().astype(np.int64)])


def _turned(bones: FloatArray, splined: FloatArray, frames: FloatArray) -> FloatArray:
    """The splined bones (T', B, D) with the lengths that the bones (T, B, D) have at those frames."""
    before = np.minimum(frames.astype(np.int64), len(bones) - 2)
    share = (frames - before)[:, None]
    lengths = np.linalg.norm(bones, axis=2)
    wanted = lengths[before] + share * (lengths[before + 1] - lengths[before])
    nearest = bones[frames.round().astype(np.int64)]
    # A bone that flips over passes through a point without direction; the nearest frame then lends its own.
    norms = np.linalg.norm(splined, axis=2)
    lost = norms <= 1e-6 * wanted
    directions = np.where(lost[..., None], nearest, splined)
    norms = np.linalg.norm(directions, axis=2)
    return directions * (wanted / np.where(norms > 0, norms, 1.0))[..., None]
