"""Rejected frames in training (reading 9): their loss is masked, or lines stand in for them, or they are cut out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from harmolab.types import BoolArray, FloatArray, IntArray, Motion

Gaps = Literal["mask", "interpolate", "splice"]


@dataclass(frozen=True, eq=False)
class TrainingFrames:
    """Frames of a recording as a network is trained on them.

    Parameters
    ----------
    positions : (N, P, 2) array
    frames : (N,) array of int, the frame of the recording, so of its sound, that each is
    usable : (N,) mask of the frames whose error counts
    """

    positions: FloatArray
    frames: IntArray
    usable: BoolArray


def training_frames(motion: Motion, gaps: Gaps = "mask") -> TrainingFrames:
    """The frames of a cleaned recording (T, P, 2), valid where accepted, with its gaps treated in one of three ways.

    "mask" keeps the time line and lets the error of rejected frames not count; "interpolate" counts the lines that fill
    them ("interpolated missing data" of Table 2); "splice" cuts them out, sound and points alike, so that the network
    goes over every gap as if no time had passed.
    """
    if gaps not in get_args(Gaps):
        raise ValueError(f"gaps must be mask, interpolate or splice, got {gaps!r}")
    frames = np.flatnonzero(motion.valid) if gaps == "splice" else np.arange(motion.n_frames)
    usable = motion.valid if gaps == "mask" else np.ones(len(frames), bool)
    return TrainingFrames(motion.positions[frames], frames, usable)


def usable_steps(usable: BoolArray, upsample: int) -> BoolArray:
    """(upsample (T - 1) + 1,) mask of the steps between frames whose interpolation needs no frame that is not usable.

    Parameters
    ----------
    usable : (T,) mask of frames
    upsample : int, steps a frame: step `upsample` t is frame t

    Examples
    --------
    >>> usable_steps(np.array([True, True, False]), 2)
    array([ True,  True,  True, False, False])
    """
    if upsample < 1:
        raise ValueError(f"upsample must be 1 or more steps a frame, got {upsample}")
    steps = np.arange(upsample * (len(usable) - 1) + 1)
    return np.asarray(usable[steps // upsample] & usable[-(-steps // upsample)])
