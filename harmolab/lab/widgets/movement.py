"""The movement of one dancer as a player's page holds it: what is drawn, how thick, from where, and the numbers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.player_points import limb_widths, playing_box, prop_joints
from harmolab.kinematics import resample_motion, upsample_motion
from harmolab.skeletons import camera_way, mean_heading, skull_and_limbs, standing_height
from harmolab.types import FloatArray, Motion

SLOWEST, FASTEST = 30.0, 60.0  # frames per second that the page holds
LEVELS = 65535  # steps of a number in the page
AIM = 0.47  # height that the camera looks at, in heights of the dancer
# Player with an instrument: radians that the camera stands higher, and the size in heights and widths of the box.
PLAYER_LIFT, PLAYER_UP, PLAYER_ACROSS = 0.22, 0.9, 0.62


def movement_data(motion: Motion, *, wall: FloatArray | None = None) -> dict[str, Any]:
    """Data from which the page draws a motion.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres or (T, J, 2) image coordinates
    wall : (2, 2) array, low and high corner of the picture, in image coordinates; the motion's own when left out
    """
    skull, limbs = skull_and_limbs(motion.skeleton)
    motion = resample_motion(upsample_motion(motion, SLOWEST), min(max(motion.fps, SLOWEST), FASTEST))
    flat = motion.positions.shape[2] == 2
    positions, way, size = _on_wall(motion.positions, wall) if flat else _on_floor(motion.positions, motion.fps)
    aim, lift, box = AIM * size, 0.0, playing_box(motion)
    if box is not None:
        middle, extent = box.mean(axis=0), np.ptp(box, axis=0)
        way, aim, lift = np.broadcast_to(middle[[0, 2]], way.shape), float(middle[1]), PLAYER_LIFT
        size = max(PLAYER_UP * float(extent[1]), PLAYER_ACROSS * float(np.hypot(extent[0], extent[2])))
    return {
        "flat": flat,
        "aim": aim,
        "lift": lift,
        "front": 0.0 if flat else mean_heading(motion.positions, motion.fps, motion.skeleton),
        "fps": motion.fps,
        "frames": motion.n_frames,
        "joints": len(motion.skeleton.joints),
        "bones": limbs,
        "widths": limb_widths(motion.skeleton, limbs),
        "props": prop_joints(motion.skeleton),
        "skull": skull,
        "size": size,
        "positions": quantised(positions),
        "way": quantised(way),
    }


def shared_wall(motions: Sequence[Motion]) -> FloatArray:
    """(2, 2): low and high corner of one picture with two motions in image coordinates; ValueError for any others."""
    if len(motions) != 2 or any(motion.positions.shape[2] != 2 for motion in motions):
        raise ValueError("two motions in image coordinates can lie over each other: a truth, and a prediction of it")
    points = np.concatenate([motion.positions.reshape(-1, 2) for motion in motions])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def quantised(values: FloatArray) -> dict[str, Any]:
    """(T, ..., K) numbers as base64 of 16-bit steps: value = low[k] + step[k] * number."""
    columns = values.reshape(-1, values.shape[-1])
    low = columns.min(axis=0)
    step = np.maximum((columns.max(axis=0) - low) / LEVELS, 1e-12)
    numbers: NDArray[np.uint16] = np.rint((columns - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step.tolist(), "numbers": base64.b64encode(numbers.tobytes()).decode()}


def _on_floor(positions: FloatArray, fps: float) -> tuple[FloatArray, FloatArray, float]:
    """(positions with the floor at y = 0, the camera's way over it (T, 2), the dancer's height)."""
    low = float(np.percentile(positions[..., 1].min(axis=1), 2))
    height, way = standing_height(positions), camera_way(positions, fps)[:, [0, 2]]
    size = max(height, 0.5 * float(np.ptp(positions, axis=1).max()), 1e-6)
    return positions - np.array([0.0, low, 0.0]), way, size


def _on_wall(points: FloatArray, wall: FloatArray | None) -> tuple[FloatArray, FloatArray, float]:
    """Image coordinates hung up in space, y up: (positions with z = 0, a camera that rests, the picture's size)."""
    low, high = (points.min(axis=(0, 1)), points.max(axis=(0, 1))) if wall is None else wall
    upright = np.stack([points[..., 0] - (low[0] + high[0]) / 2, high[1] - points[..., 1]], axis=-1)
    positions = np.concatenate([upright, np.zeros_like(upright[..., :1])], axis=-1)
    return positions, np.zeros((len(points), 2)), max(float((high - low).max()), 1e-6)
