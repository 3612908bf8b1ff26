"""Array files, pickles and JSON to Motion: the shape of an array and the names beside it tell what they hold."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.aist import AIST_FPS, aist_motion, is_aist_name, read_array_pickle
from harmolab.io.arrays import checked_motion, in_metres, npy_pickle, read_npy
from harmolab.io.files import MAX_JSON_BYTES, PathLike, reading
from harmolab.io.humanml import WIDTH, humanml_motion
from harmolab.io.joint_arrays import is_joints, joint_motion, positions_in
from harmolab.io.keypoints import content_motion, keypoints_motion
from harmolab.io.layouts import is_landmarks, json_or_lines, named_skeleton
from harmolab.io.motion_file import Assumption, MotionFile, ReadingOptions, as_read
from harmolab.io.smpl_files import VECTORS, is_parameters, parameter_motion, vector_motion

_NAMED = Assumption(
    f"{AIST_FPS:g} frames a second (assumed: it is named as AIST++'s recordings are; --fps overrules it)",
    f"{AIST_FPS:g} frames a second assumed by the name",
)
_METRES = Assumption("metres (assumed, since the array does not tell; --scale overrules it)", "unit assumed: metres")


def load_pickle(path: PathLike, options: ReadingOptions) -> MotionFile:
    """AIST++ keypoints3d, SMPL parameters, or joints in space."""
    with reading(path, "a pickle of arrays") as file:
        return _content_motion(read_array_pickle(file.read_bytes()), file, options)


def _content_motion(content: dict[str, Any], file: Path, options: ReadingOptions) -> MotionFile:
    """The motion in a dictionary of arrays."""
    if is_parameters(content):
        return parameter_motion(content, file, options)
    if {"keypoints3d", "keypoints3d_optim"} & content.keys() or (values := positions_in(content)) is None:
        scale = 0.01 if options.scale is None else options.scale
        motion = aist_motion(content, options.rate(AIST_FPS), scale)
        return as_read(motion, "AIST++ key points", options, f"{scale:g} m a unit, {motion.fps:g} frames a second")
    return _joint_motion(values, file, options)


def _joint_motion(values: Any, file: Path, options: ReadingOptions, own_fps: float | None = None) -> MotionFile:
    """Joints in space at the rate that their file tells, else at that of its name."""
    rate, notes = (own_fps, ()) if own_fps is not None else _named_rate(file, options)
    read = joint_motion(values, options, rate)
    return read._replace(notes=(*read.notes, *notes))


def _named_rate(file: Path, options: ReadingOptions) -> tuple[float | None, tuple[Assumption, ...]]:
    """The rate of a file by its name, unless one is passed, and the note on it."""
    return (AIST_FPS, (_NAMED,)) if options.fps is None and is_aist_name(file) else (None, ())


def load_json(path: PathLike, options: ReadingOptions) -> MotionFile:
    """Joints in space, or key points of a pose estimator."""
    with reading(path, "key points", max_bytes=MAX_JSON_BYTES) as file:
        content = json_or_lines(file)
        values = None if is_landmarks(content) else positions_in(content)
        own = content.get("fps") if isinstance(content, dict) else None
        if values is None:
            rate = own if options.as_defaults and own is not None else options.fps
            return as_read(content_motion(content, fps=rate, joints=options.joints), "key points", options)
        return _joint_motion(values, file, options, own)


def load_npy(path: PathLike, options: ReadingOptions) -> MotionFile:
    """A `.npy` array: joints in space, image coordinates, landmarks with their visibility, vectors, a dictionary."""
    with reading(path, "a .npy array") as file:
        with file.open("rb") as stream:
            if (pickled := npy_pickle(stream)) is not None:
                return _content_motion(read_array_pickle(pickled), file, options)
            values = read_npy(stream, file.stat().st_size)
        width = values.shape[1] if values.ndim == 2 else 0
        if width == WIDTH:
            return humanml_motion(values, options)
        if width in VECTORS:
            return vector_motion(values, options)
        if is_joints(values.shape) and not _has_confidence(values):
            return _joint_motion(values, file, options)
        named, notes = _named_rate(file, options)
        rate = options.rate(named)
        if values.ndim != 3 or values.shape[2] != 3 or _has_confidence(values):
            return as_read(keypoints_motion(values, rate, joints=options.joints), "key points", options, *notes)
        unit = _METRES if options.scale is None else f"{options.scale:g} m a unit (as passed)"
        places = in_metres(values, 1.0 if options.scale is None else options.scale)
        motion = checked_motion(places, rate, named_skeleton(values.shape[1]))
        return as_read(motion, "joints", options, unit, *notes, is_open=True)


def _has_confidence(values: NDArray[Any]) -> bool:
    """True where (T, J, 3), also flat, is image coordinates with a confidence: pixels or shares beside 0 to 1."""
    is_flat = values.ndim == 2
    points = values.reshape(len(values), -1, 3) if is_flat and values.shape[1] % 3 == 0 else values
    if not len(points) or points.ndim != 3 or points.shape[2] != 3 or named_skeleton(points.shape[1]) is None:
        return False
    places, confidence = points[..., :2], points[..., 2]
    are_shares = is_flat and places.min() >= 0 and places.max() <= 1
    return bool(confidence.min() >= 0 and confidence.max() <= 1 and (np.abs(places).max() > 20 or are_shares))
