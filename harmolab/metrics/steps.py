"""Steps of a fixed time through a motion of any rate, so that what is measured over them does not show the rate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from harmolab.kinematics import upsample_motion
from harmolab.types import BoolArray, FloatArray, Motion

STEP = 1 / 15  # seconds: the rate of the generated motion, the slowest that is compared


class Sampled(NamedTuple):
    """A motion with a whole number of frames a step: (T, J, 3) positions, (T,) validity, frames a step."""

    positions: FloatArray
    valid: BoolArray
    stride: int


def sampled(motion: Motion, step: float, *, steps: int, fps: float = 0.0) -> Sampled:
    """`motion` at the lowest rate that loses no frames and has a whole number of them a step, by cubic splines.

    Parameters
    ----------
    motion : Motion
    step : float, seconds
    steps : int
        How many steps in a row are needed.
    fps : float, hertz
        The rate is at least this.

    Raises
    ------
    ValueError
        If the motion is two-dimensional, `steps` steps of `step` seconds fit nowhere into its valid frames, or step is
        not positive.
    """
    if motion.positions.shape[2] != 3:
        raise ValueError("a three-dimensional motion is needed: metres, y up")
    if not 0 < step < math.inf:
        raise ValueError(f"step must be positive, got {step}")
    stride = max(1, math.ceil(max(motion.fps, fps) * step - 1e-6))
    if (motion.n_frames - 1) / motion.fps < steps * step - 1e-9:
        raise ValueError(f"the motion lasts {motion.duration:.3f} s, too short for {steps} steps of {step:.3f} s")
    dense = upsample_motion(motion, stride / step - 1e-6)
    if not spans(dense.valid, steps * stride).any():
        raise ValueError(f"the motion is nowhere valid for {steps} steps of {step:.3f} s")
    return Sampled(dense.positions, dense.valid, stride)


def vector_lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of (T, J, 3) vectors, (T, J)."""
    return np.sqrt(np.einsum("tjd,tjd->tj", vectors, vectors))


def spans(valid: BoolArray, steps: int) -> BoolArray:
    """Which spans of `steps` frame steps hold valid frames only, by the frame they start at."""
    return runs(valid, steps + 1)


def runs(flags: BoolArray, length: int) -> BoolArray:
    """At which places `length` flags in a row are all set, (len(flags) - length + 1,); empty if there are too few."""
    total = np.concatenate([[0], np.cumsum(flags)])
    return total[length:] - total[: max(len(total) - length, 0)] == length
