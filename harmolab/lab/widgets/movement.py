"""The movement of one dancer as a player's page holds it: positions, parts of the drawn person, and the camera."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.kinematics import resample_motion, upsample_motion
from harmolab.lab.person import camera, plan, shapes
from harmolab.lab.person.camera import stage_of
from harmolab.types import FloatArray, Motion

SLOWEST, FASTEST = 30.0, 60.0  # frames per second that the page holds
LEVELS = 65535  # steps of a number in the page
# Constants of the figure, with which the page's script draws what `harmolab.lab.person` draws.
LOOK = {
    "angle": camera.ANGLE,
    "distance": camera.DISTANCE,
    "middle": camera.MIDDLE,
    "corners": shapes.CORNERS,
    "paler": shapes.PALER,
    "range": shapes.LEAST_RANGE,
    "thinnest": shapes.THINNEST,
    "shadow": [shapes.SHADOW_LEAST, shapes.SHADOW_SPREAD],
    "paints": {name: list(colour) for name, colour in plan.PAINTS.items()},
    "outlines": list(plan.OUTLINES),
}


def movement_data(motion: Motion, *, wall: FloatArray | None = None) -> dict[str, Any]:
    """Data from which the page draws a motion.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres or (T, J, 2) image coordinates
    wall : (2, 2) array, low and high corner of the picture, in image coordinates; the motion's own when left out
    """
    motion = page_motion(motion)
    stage = stage_of(motion, wall=wall)
    return {
        "flat": stage.flat,
        "aim": stage.aim,
        "lift": stage.lift,
        "front": stage.front,
        "fps": motion.fps,
        "frames": motion.n_frames,
        "joints": len(motion.skeleton.joints),
        "size": stage.size,
        "room": stage.room,
        "stature": stage.plan.stature,
        "points": [_sparse(row) for row in stage.plan.weights[len(motion.skeleton.joints) :]],
        "parts": stage.plan.parts,
        "hips": _sparse(stage.plan.hips),
        "shadow": np.flatnonzero(stage.plan.shadow).tolist(),
        "positions": quantised(stage.positions),
        "way": quantised(stage.way),
    }


def page_motion(motion: Motion) -> Motion:
    """The motion at a rate of `SLOWEST` to `FASTEST` frames per second, as the page holds it."""
    return resample_motion(upsample_motion(motion, SLOWEST), min(max(motion.fps, SLOWEST), FASTEST))


def _sparse(weights: FloatArray) -> list[tuple[int, float]]:
    """(joint, weight) where weights (J,) are not 0."""
    return [(int(joint), float(weights[joint])) for joint in np.flatnonzero(weights)]


def quantised(values: FloatArray) -> dict[str, Any]:
    """(T, ..., K) numbers as base64 of 16-bit steps: value = low[k] + step[k] * number."""
    columns = values.reshape(-1, values.shape[-1])
    low = columns.min(axis=0)
    step = np.maximum((columns.max(axis=0) - low) / LEVELS, 1e-12)
    numbers: NDArray[np.uint16] = np.rint((columns - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step.tolist(), "numbers": base64.b64encode(numbers.tobytes()).decode()}
