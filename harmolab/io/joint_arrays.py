"""Joints in space as bare numbers, (T, J, 3) or flat: 24 and 22 joints of SMPL, 17 of COCO, from arrays, JSON, pickles.

Bailando writes 24 joints under ``pred_position``, in an array file that holds a pickled dictionary, and its training
data as JSON with ``dance_array``; AIST++ has 17 joints. None of them tells its unit or the axis that points up.

Bailando's folders of JSON files, one a frame: those of ``jsons_original`` hold joints in space under ``3d_pose`` and
are read. Those of ``jsons`` are drawings, in OpenPose's layout but upside down and with left and right exchanged; they
are refused, since the same dances lie in ``pkl``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.io.arrays import checked_motion, in_metres, number_array
from harmolab.io.files import MAX_TEXT_BYTES, MissingFrameRate, read_json, reading
from harmolab.io.layouts import COCO_17, MAX_FRAMES
from harmolab.io.motion_file import Assumption, MotionFile, ReadingOptions, guessed_up, metre_factor
from harmolab.io.smpl import SMPL_22, SMPL_24
from harmolab.types import FloatArray, Skeleton

SKELETONS = {len(skeleton.joints): skeleton for skeleton in (COCO_17, SMPL_22, SMPL_24)}
KEYS = ("pred_position", "dance_array", "keypoints3d_optim", "keypoints3d", "positions")
# Standard deviation over mean of a thigh's length, above which these are no joints: rotations have the same shape.
_STRETCH = 0.5
_FRAME_KEY = "3d_pose"


def positions_in(content: Any) -> Any:
    """The numbers of joints in the content of a JSON file or of a pickle; None where it holds none of these."""
    if isinstance(content, Mapping):
        return next((content[key] for key in KEYS if key in content), None)
    frame = content[0] if isinstance(content, list) and content else None
    if not isinstance(frame, list) or len(frame) not in (*SKELETONS, *(3 * count for count in SKELETONS)):
        return None
    return content if isinstance(frame[0], int | float | list) else None


def is_joints(shape: tuple[int, ...]) -> bool:
    """True for the shape of joints in space, of one of the three skeletons."""
    return (len(shape) == 3 and shape[1] in SKELETONS and shape[2] == 3) or (
        len(shape) == 2 and shape[1] in {3 * count for count in SKELETONS}
    )


def joint_motion(values: Any, options: ReadingOptions, own_fps: float | None = None, kind: str = "") -> MotionFile:
    """The motion of joints in space; call it inside `harmolab.io.files.reading`.

    Parameters
    ----------
    values : (T, J, 3) or (T, 3J) array or nested lists, J 17, 22 or 24
    options : ReadingOptions
    own_fps : float or None, frames per second that the file tells
    kind : of the file; made of the skeleton's name where left out

    Raises
    ------
    MissingFrameRate, ValueError
        There is no rate; the shape is another, the unit cannot be, or these are rotations.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"joints must be numbers of shape (T, J, 3): {error}") from None
    if not is_joints(array.shape) or not 2 <= len(array) <= MAX_FRAMES:
        counts = ", ".join(map(str, SKELETONS))
        raise ValueError(f"joints must have shape (T, J, 3) or (T, 3J) with J of {counts}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"NaN or infinity at frame {np.argwhere(~np.isfinite(array))[0][0]}; interpolate or cut it")
    options.check_no_body()
    rate = options.rate(own_fps)
    joints = array.reshape(len(array), -1, 3)
    skeleton = SKELETONS[joints.shape[1]]
    _check_thighs(joints, skeleton)
    factor, unit = metre_factor(joints, options)
    places, up = _upright(in_metres(joints, factor), skeleton, options)
    name = kind or f"{len(skeleton.joints)} joints of {'COCO' if skeleton is COCO_17 else 'SMPL'}"
    return MotionFile(checked_motion(places, rate, skeleton), name, (unit, up))


def frame_motion(folder: Path, files: Sequence[Path], options: ReadingOptions) -> MotionFile:
    """The motion of Bailando's files of a frame, in their order.

    Raises
    ------
    MissingFrameRate, ValueError
        As `joint_motion`, or a file holds no joints in space; names the folder, or the file.
    """
    if len(files) > MAX_FRAMES:
        raise ValueError(f"{folder}: has {len(files)} frames, more than the {MAX_FRAMES} allowed; cut it into parts")
    if options.fps is None:
        raise MissingFrameRate(
            f"{folder}: holds no frame rate; pass fps, such as --fps 25 (Bailando's settings make 60)"
        )
    frames = []
    for path in files:
        with reading(path, "a frame of Bailando", max_bytes=MAX_TEXT_BYTES) as file:
            content = read_json(file)
            if not isinstance(content, dict) or _FRAME_KEY not in content:
                raise ValueError(
                    f"has no {_FRAME_KEY}; Bailando's drawings in jsons are not read: name the array of this dance in "
                    "its folder pkl, or its folder in jsons_original"
                )
            frames.append(number_array(content[_FRAME_KEY], _FRAME_KEY, (len(SMPL_24.joints), 3)))
    try:
        return joint_motion(np.stack(frames), options, kind="Bailando's frames, 24 joints of SMPL")
    except ValueError as error:
        raise ValueError(f"{folder}: {error}") from None


def _upright(places: FloatArray, skeleton: Skeleton, options: ReadingOptions) -> tuple[FloatArray, str]:
    """Places with y up and a sentence; y where the body does not tell, as in files of our own."""
    try:
        return guessed_up(places, skeleton.joints, options)
    except ValueError:
        reason = "assumed: the body lies, or turns over, and does not tell; --up overrules it"
        return places, Assumption(f"y up ({reason})", "axis assumed: y up")


def _check_thighs(joints: FloatArray, skeleton: Skeleton) -> None:
    """ValueError where the left thigh changes its length as no bone does."""
    hip, knee = (skeleton.joints.index(f"left_{part}") for part in ("hip", "knee"))
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(joints[:, knee] - joints[:, hip], axis=1)
        is_bone = bool(lengths.std() <= _STRETCH * lengths.mean())
    if not is_bone:
        raise ValueError(
            "holds no joints: the thigh changes its length by more than half; SMPL rotations are read "
            "from .npz or .pkl with poses and trans"
        )
