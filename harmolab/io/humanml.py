"""HumanML3D's vectors of 263 numbers a frame to the places of 22 joints (Guo et al. 2022, "Generating Diverse and
Natural 3D Human Motions From Text").

A frame holds, in this order: how far the body turns about y until the next frame, as half the angle (1); how far the
pelvis moves until then along x and z of the body (2); the pelvis's height (1); the places of 21 joints, x and z from
the pelvis, y from the floor, in the body's frame that faces +z (63); their 6-D rotations (126), velocities of 22 joints
(66), and four contacts. The places alone tell where the joints are; the last three are not looked at.

The vectors hold no rate. HumanML3D itself is at 20 frames per second, other data written this way is not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.arrays import checked_motion, in_metres
from harmolab.io.motion_file import MotionFile, ReadingOptions, stated_up
from harmolab.io.smpl import SMPL_22
from harmolab.skeletons import turned
from harmolab.types import FloatArray

WIDTH = 263
_LOCAL = slice(4, 4 + 3 * 21)
_HEIGHTS = (0.3, 3.0)  # metres over which a body extends, median


def vector_joints(values: NDArray[Any]) -> FloatArray:
    """Joints (T, 22, 3), metres, y up, of vectors (T, 263); the first frame faces +z, its pelvis over the origin."""
    numbers = values.astype(np.float64)
    facing = 2 * np.concatenate([[0.0], np.cumsum(numbers[:-1, 0])])
    steps = np.zeros((len(numbers), 3))
    steps[1:, [0, 2]] = numbers[:-1, 1:3]
    # Half angles are those of the turn into the body's frame; out of it, the body turns the other way.
    pelvis = np.cumsum(turned(steps, -facing), axis=0)
    pelvis[:, 1] = numbers[:, 3]
    local = numbers[:, _LOCAL].reshape(len(numbers), 21, 3)
    joints = turned(local, -facing[:, None]) + pelvis[:, None] * [1, 0, 1]
    return np.concatenate([pelvis[:, None], joints], axis=1)


def humanml_motion(values: NDArray[Any], options: ReadingOptions) -> MotionFile:
    """The motion of vectors (T, 263); call it inside `harmolab.io.files.reading`.

    Raises
    ------
    MissingFrameRate, ValueError
        No rate is passed; numbers are not finite, or make no body in metres, as those that a network is trained on:
        multiply by the standard deviation and add the mean first.
    """
    options.check_no_body()
    rate = options.rate(hint=", or --fps 20 for HumanML3D's own")
    if not np.isfinite(values).all():
        raise ValueError(f"NaN or infinity at frame {np.argwhere(~np.isfinite(values))[0][0]}; interpolate or cut it")
    with np.errstate(over="ignore", invalid="ignore"):
        joints = in_metres(vector_joints(values), 1.0 if options.scale is None else options.scale)
        extent = float(np.median(np.ptp(joints, axis=1).max(axis=1))) if len(joints) else 0.0
    if not _HEIGHTS[0] <= extent <= _HEIGHTS[1]:
        raise ValueError(
            f"holds HumanML3D vectors of a body that extends over {extent:.3g} m; if they are normalised, multiply by "
            "Std.npy and add Mean.npy first"
        )
    positions, note = stated_up(joints, "y", "as HumanML3D writes", options)
    notes = ("22 joints from the turn and speed of the pelvis and the places in the body", note)
    return MotionFile(checked_motion(positions, rate, SMPL_22), "HumanML3D vectors", notes)
