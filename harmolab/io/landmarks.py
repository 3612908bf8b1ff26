"""Pose landmarks as MediaPipe gives them (33 points) to Motion.

MediaPipe returns objects, not files; save them as JSON, one entry a frame, or as an array:

``.json``
    a list of frames, or ``{"fps": 30.0, "frames": [...]}``. A frame is a list of 33 ``{"x", "y", "z", "visibility"}``
    (or ``{"landmarks": [...]}``), or null or an empty list where nobody was seen. Beside ``"fps"`` the file may hold
    ``"aspect"`` (width over height of the picture) and ``"world": true`` (these are world landmarks).
``.npy``
    (T, 33, 3) x, y, z, or (T, 33, 4) with the visibility; a frame of NaN where nobody was seen.

MediaPipe guesses joints that it does not see. They are kept, and frames whose visibility is below 0.5 on average are
marked not valid. Frames without anybody are filled in by straight lines and marked not valid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.arrays import checked_motion, number_array, read_npy
from harmolab.io.files import MAX_JSON_BYTES, PathLike, read_json, reading
from harmolab.io.keypoints import joint_indices, skeleton_part
from harmolab.types import FloatArray, Motion, Skeleton

__all__ = ["MEDIAPIPE_33", "is_landmarks", "landmarks_motion", "load_landmarks"]

MEDIAPIPE_33 = Skeleton(
    (
        *("nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer"),
        *("left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow"),
        *("right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index"),
        *("left_thumb", "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle"),
        *("right_ankle", "left_heel", "right_heel", "left_foot_index", "right_foot_index"),
    ),
    (
        *(-1, 0, 1, 2, 0, 4, 5, 3, 6, 0, 0, 0, 0, 11, 12, 13, 14, 15, 16, 15, 16, 15, 16),
        *(11, 12, 23, 24, 25, 26, 27, 28, 29, 30),
    ),
)

SEEN = 0.5  # mean visibility below which a frame does not count
_COUNT = len(MEDIAPIPE_33.joints)


def load_landmarks(
    path: PathLike,
    *,
    fps: float | None = None,
    world: bool | None = None,
    aspect: float | None = None,
    joints: Sequence[str] | None = None,
) -> Motion:
    """The movement in a file of MediaPipe pose landmarks, `.json` or `.npy`.

    Parameters
    ----------
    path : str or path
    fps : float, frames per second; needed unless the JSON holds it
    world : bool, default what the file says, else False
        The file holds world landmarks (metres from the hips, so travel is lost): 3-D, y up. Else image landmarks: 2-D,
        x and y as shares of the picture's width and height.
    aspect : float, default what the file says, else 1
        Width over height of the picture, so that both directions of image landmarks are in one unit.
    joints : names of `MEDIAPIPE_33` to keep, optional

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "MediaPipe landmarks", max_bytes=MAX_JSON_BYTES) as file:
        suffix = file.suffix.lower()
        if suffix == ".json":
            content = read_json(file)
            values, about = _from_json(content), content if isinstance(content, dict) else {}
        elif suffix == ".npy":
            with file.open("rb") as stream:
                values, about = read_npy(stream, file.stat().st_size), {}
        else:
            raise ValueError(f"is no file of landmarks ({suffix or 'no suffix'}); .json and .npy are read")
        rate = about.get("fps") if fps is None else fps
        if rate is None:
            raise ValueError("holds no frame rate; pass fps")
        is_world = about.get("world", False) if world is None else world
        if not isinstance(is_world, bool):
            raise ValueError(f"world must be true or false, got {str(is_world)[:30]!r}")
        wide = float(about.get("aspect", 1.0) if aspect is None else aspect)
        return landmarks_motion(values, rate, world=is_world, aspect=wide, joints=joints)


def is_landmarks(content: Any) -> bool:
    """Whether the content of a JSON file looks like MediaPipe landmarks: frames of landmarks with x and y."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list):
        return False
    seen = next((frame for frame in frames if frame), None)
    points = seen.get("landmarks") if isinstance(seen, dict) else seen
    return isinstance(points, list) and bool(points) and isinstance(points[0], dict) and "x" in points[0]


def landmarks_motion(
    values: NDArray[Any], fps: Any, *, world: bool = False, aspect: float = 1.0, joints: Sequence[str] | None = None
) -> Motion:
    """A Motion from landmarks (T, 33, 3) or, with the visibility, (T, 33, 4); NaN frames are filled and marked.

    Parameters are those of `load_landmarks`.

    Raises
    ------
    ValueError
        For another shape, an aspect that cannot be, or frames in none of which anybody is seen.
    """
    if values.ndim != 3 or values.shape[1] != _COUNT or values.shape[2] not in (3, 4):
        raise ValueError(f"has shape {values.shape}; landmarks come as (T, {_COUNT}, 3) or (T, {_COUNT}, 4)")
    if not (np.isfinite(aspect) and 0.1 <= aspect <= 10):
        raise ValueError(f"aspect is width over height and must lie between 0.1 and 10, got {aspect}")
    points, empty = values[..., :3].astype(np.float64), np.isnan(values).all(axis=(1, 2))
    if empty.all():
        raise ValueError(f"nobody is seen in any of its {len(values)} frames")
    visible = np.nan_to_num(values[..., 3].mean(axis=1)) >= SEEN if values.shape[2] == 4 else ~empty
    kept = joint_indices(MEDIAPIPE_33, MEDIAPIPE_33.joints if joints is None else joints)
    scale = np.array([1.0, -1.0, -1.0] if world else [aspect, 1.0])
    filled = _filled(points, empty)[:, kept, : scale.size] * scale
    return checked_motion(filled, fps, skeleton_part(MEDIAPIPE_33, kept), visible & ~empty)


def _from_json(content: Any) -> FloatArray:
    """(T, 33, 4) landmarks with NaN where nobody was seen."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list) or not frames:
        raise ValueError("has no list of frames; a frame is a list of 33 landmarks with x, y, z and visibility")
    return np.stack([_frame(frame, number) for number, frame in enumerate(frames)])


def _frame(frame: Any, number: int) -> FloatArray:
    """One frame's (33, 4) x, y, z, visibility; NaN where nobody was seen, visibility 1 where none is told."""
    points = frame.get("landmarks") if isinstance(frame, dict) else frame
    if points is None or points == []:
        return np.full((_COUNT, 4), np.nan)
    if not isinstance(points, list) or len(points) != _COUNT or not all(isinstance(point, dict) for point in points):
        raise ValueError(f"frame {number} is no list of {_COUNT} landmarks with x, y, z and visibility")
    missing = [name for name in ("x", "y", "z") if any(name not in point for point in points)]
    if missing:
        raise ValueError(f"frame {number} has a landmark without {missing[0]}")
    rows = [[point["x"], point["y"], point["z"], point.get("visibility", 1.0)] for point in points]
    values = number_array(rows, f"frame {number}", (_COUNT, 4))
    if not np.isfinite(values).all():
        raise ValueError(f"NaN or infinity in frame {number}; write null where nobody was seen")
    return values


def _filled(points: FloatArray, empty: NDArray[np.bool_]) -> FloatArray:
    """`points` (T, 33, 3) with straight lines in time over the empty frames; held at the ends."""
    there, frames = np.flatnonzero(~empty), np.arange(len(points))
    flat = points.reshape(len(points), -1)
    columns = [np.interp(frames, there, column[there]) for column in flat.T]
    return np.stack(columns, axis=1).reshape(points.shape)
