"""Key points of pose estimators to Motion: COCO-17, OpenPose and MediaPipe, from JSON, from arrays, from a folder.

A joint that an estimator did not see (confidence 0) is filled in by a straight line in time, and its frame is marked
not valid; so is a frame without anybody. A joint that is never seen is an error. Leave out what does not matter
(`joints=("left_wrist", ...)`), else every frame with a hidden ear counts as not valid. Joints that MediaPipe only
guesses are kept; frames whose mean visibility is below 0.5 are marked not valid.

Of several people in a frame, of those at least half as confident as the best, the dancer is the one nearest to the
dancer of the frame before; in the first frame the most confident. `harmolab.io.layouts` has the layouts of JSON.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io import layouts
from harmolab.io.arrays import check_joints, checked_motion, read_npy
from harmolab.io.files import MAX_BYTES, MAX_JSON_BYTES, MissingFrameRate, PathLike, read_json, reading
from harmolab.io.layouts import MEDIAPIPE_33
from harmolab.skeletons import joint_indices, skeleton_part
from harmolab.types import BoolArray, FloatArray, Motion, Skeleton

SEEN = 0.5  # mean visibility of landmarks below which a frame does not count
_PERSON_BYTES = 64 * 2**20
_LANDMARKS = len(MEDIAPIPE_33.joints)
BAILANDO_END = "_kps.json"
FRAME_ENDS = ("_keypoints.json", BAILANDO_END)  # of the names of files of one frame


def load_keypoints(
    path: PathLike,
    *,
    fps: float | None = None,
    joints: Sequence[str] | None = None,
    world: bool | None = None,
    aspect: float | None = None,
) -> Motion:
    """One dancer's movement from key points: `.json`, `.jsonl`, `.npy`, or the folder that OpenPose wrote.

    Parameters
    ----------
    path : str or path
        Arrays are those of `keypoints_motion`.
    fps : float, frames per second; needed unless the JSON holds it
    joints : names to keep, optional
    world, aspect : of MediaPipe's landmarks; default what the file says, else as in `keypoints_motion`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    path = Path(path)
    if path.is_dir():
        return _load_folder(path, fps, joints)
    is_array = path.suffix.lower() == ".npy"
    with reading(path, "key points", max_bytes=MAX_BYTES if is_array else MAX_JSON_BYTES):
        if not is_array:
            return content_motion(layouts.json_or_lines(path), fps=fps, joints=joints, world=world, aspect=aspect)
        with path.open("rb") as stream:
            values = read_npy(stream, path.stat().st_size)
        return _motion(values, {}, fps, joints, world, aspect)


def content_motion(
    content: Any,
    *,
    fps: float | None = None,
    joints: Sequence[str] | None = None,
    world: bool | None = None,
    aspect: float | None = None,
) -> Motion:
    """The motion of a JSON file's content, as `load_keypoints`; call it inside `harmolab.io.files.reading`."""
    if layouts.is_landmarks(content):
        about = content if isinstance(content, dict) else {}
        return _motion(layouts.landmarks_by_frame(content), about, fps, joints, world, aspect)
    return _motion(followed_person(layouts.people_by_frame(content)), {}, fps, joints, world, aspect)


def _motion(
    values: NDArray[Any],
    about: dict[str, Any],
    fps: float | None,
    joints: Sequence[str] | None,
    world: bool | None,
    aspect: float | None,
) -> Motion:
    """The motion of key points, with what the file says about them where the arguments leave it open."""
    rate = about.get("fps") if fps is None else fps
    if rate is None:
        raise MissingFrameRate("holds key points but no frame rate; pass fps, such as --fps 25")
    is_world = about.get("world", False) if world is None else world
    if not isinstance(is_world, bool):
        raise ValueError(f"world must be true or false, got {str(is_world)[:30]!r}")
    ratio = float(about.get("aspect", 1.0) if aspect is None else aspect)
    return keypoints_motion(values, rate, joints=joints, world=is_world, aspect=ratio)


def keypoints_motion(
    values: NDArray[Any], fps: Any, *, joints: Sequence[str] | None = None, world: bool = False, aspect: float = 1.0
) -> Motion:
    """A Motion from an array of key points; gaps are filled and marked.

    Parameters
    ----------
    values : (T, J, 2), (T, J, 3) or flat (T, 2J), (T, 3J) array; x, y and perhaps confidence
        Or MediaPipe's landmarks, (T, 33, 3) or (T, 33, 4) x, y, z and visibility, NaN in frames without anybody.
    fps : float, frames per second
    joints : names to keep, optional
    world : bool
        World landmarks (metres from the hips, so travel is lost): 3-D, y up. Else image landmarks: 2-D, x and y as
        shares of the picture's width and height.
    aspect : float
        Width over height of the picture, so that both directions of image landmarks are in one unit.

    Raises
    ------
    ValueError
        For another shape, an aspect that cannot be, a joint that is never seen, unknown names.
    """
    are_landmarks = values.ndim == 3 and values.shape[1] == _LANDMARKS and values.shape[2] in (3, 4)
    points = values if are_landmarks else _with_joints(values)
    check_joints(points.shape[1])
    named = MEDIAPIPE_33 if are_landmarks else layouts.named_skeleton(points.shape[1])
    skeleton = named or Skeleton.unnamed(points.shape[1])
    keep = joint_indices(skeleton, skeleton.joints if joints is None else joints)
    part = skeleton_part(skeleton, keep)
    if are_landmarks:
        if not (np.isfinite(aspect) and 0.1 <= aspect <= 10):
            raise ValueError(f"aspect is width over height and must lie between 0.1 and 10, got {aspect}")
        scale = np.array([1.0, -1.0, -1.0] if world else [aspect, 1.0])
        places, valid = _seen_landmarks(points)
        return checked_motion(places[:, keep, : scale.size] * scale, fps, part, valid)
    points = points[:, keep]
    if points.shape[2] == 2:
        return checked_motion(points, fps, part)
    visible = np.asarray(points[..., 2] > 0)
    return checked_motion(filled_points(points[..., :2], visible, part), fps, part, np.asarray(visible.all(axis=1)))


def _with_joints(values: NDArray[Any]) -> NDArray[Any]:
    """(T, J, 2 or 3) from flat or full key points."""
    flat = {joints * size: size for joints in (17, 18, 25) for size in (2, 3)}
    if values.ndim == 2 and values.shape[1] in flat:
        return values.reshape(len(values), -1, flat[values.shape[1]])
    if values.ndim == 3 and values.shape[2] in (2, 3):
        return values
    raise ValueError(
        f"has shape {values.shape}; key points come as (T, J, 2), (T, J, 3), or flat with 17, 18 or 25 joints"
    )


def _seen_landmarks(values: NDArray[Any]) -> tuple[FloatArray, BoolArray]:
    """Places (T, 33, 3), filled in where the frame is empty, and the frames (T,) in which the body was."""
    empty = np.isnan(values).all(axis=(1, 2))
    if empty.all():
        raise ValueError(f"nobody is seen in any of its {len(values)} frames")
    valid = np.nan_to_num(values[..., 3].mean(axis=1)) >= SEEN if values.shape[2] == 4 else ~empty
    visible = np.repeat(~empty[:, None], _LANDMARKS, axis=1)
    return filled_points(values[..., :3], visible, MEDIAPIPE_33), valid & ~empty


def filled_points(points: NDArray[Any], visible: BoolArray, skeleton: Skeleton) -> FloatArray:
    """`points` (T, J, D) with straight lines where a joint was not `visible` (T, J); held at the ends.

    ValueError names the joints that never were.
    """
    hidden = [name for joint, name in enumerate(skeleton.joints) if not visible[:, joint].any()]
    if hidden:
        raise ValueError(f"never shows {', '.join(hidden)}; keep the other joints only (joints=...)")
    filled, frames = points.astype(np.float64), np.arange(len(points))
    for joint in np.flatnonzero(~visible.all(axis=0)):
        present = visible[:, joint]
        for axis in range(points.shape[2]):
            filled[:, joint, axis] = np.interp(frames, frames[present], filled[present, joint, axis])
    return filled


def _load_folder(folder: Path, fps: float | None, joints: Sequence[str] | None) -> Motion:
    """One dancer from OpenPose's JSON files, one a frame in the order of their numbers."""
    files = frame_files(folder)
    if fps is None:
        raise MissingFrameRate(f"{folder}: holds no frame rate; pass fps, such as --fps 25")
    frames = []
    for path in files:
        with reading(path, "an OpenPose frame", max_bytes=_PERSON_BYTES):
            frames.append(layouts.entry_poses(read_json(path), layouts.OPENPOSE, "frame"))
    try:
        return keypoints_motion(followed_person(frames), fps, joints=joints)
    except ValueError as error:
        raise ValueError(f"{folder}: {error}") from None


def frame_files(folder: Path) -> list[Path]:
    """The JSON files of OpenPose's folder by frame number; ValueError where a number is missing or there twice."""
    digits = {file: re.findall(r"\d+", file.stem.removesuffix("_keypoints")) for file in folder.glob("*.json")}
    files = sorted((int(numbers[-1][-18:]), file) for file, numbers in digits.items() if numbers)
    if not files:
        raise ValueError(
            f"{folder}: holds no motion: neither motion.npz nor skeletons.json, nor numbered JSON files as OpenPose "
            "writes them (name_000000000000.json)"
        )
    for (number, file), (following, other) in itertools.pairwise(files):
        if following == number:
            raise ValueError(f"{folder}: has two files for frame {number}: {file.name} and {other.name}")
        if following > number + 1:
            raise ValueError(f"{folder}: frame {number + 1} is missing between {files[0][0]} and {files[-1][0]}")
    return [file for _, file in files]


def followed_person(frames: Sequence[Sequence[FloatArray]], compared: slice = slice(None)) -> FloatArray:
    """(T, J, 3) x, y, confidence of one person followed through frames of people (J, 3); 0 in empty frames.

    `compared` are the joints by which people are compared. ValueError if all frames are empty.
    """
    poses: list[FloatArray | None] = []
    last = None
    for people in frames:
        poses.append(_nearest(people, last, compared))
        last = last if poses[-1] is None else poses[-1]
    if last is None:
        raise ValueError(f"nobody is seen in any of its {len(frames)} frames")
    if len({len(pose) for pose in poses if pose is not None}) > 1:
        raise ValueError("mixes poses of different numbers of joints")
    return np.stack([np.zeros_like(last) if pose is None else pose for pose in poses])


def _nearest(people: Sequence[FloatArray], previous: FloatArray | None, compared: slice) -> FloatArray | None:
    """The person who is the one of the frame before, or None in an empty frame."""
    confidence = [float(pose[compared, 2].mean()) for pose in people]
    if not people or max(confidence) <= 0:
        return None
    if previous is None:
        return people[int(np.argmax(confidence))]
    likely = [pose for pose, sure in zip(people, confidence, strict=True) if sure >= 0.5 * max(confidence)]
    return min(likely, key=lambda pose: _distance(pose[compared], previous[compared]))


def _distance(pose: FloatArray, other: FloatArray) -> float:
    """Mean distance of the joints visible in both poses; infinite if there is none."""
    if pose.shape != other.shape:
        return float("inf")
    both = (pose[:, 2] > 0) & (other[:, 2] > 0)
    if not both.any():
        return float("inf")
    with np.errstate(over="ignore"):  # a place out of all bounds is infinitely far; the motion's check refuses it later
        return float(np.linalg.norm(pose[both, :2] - other[both, :2], axis=1).mean())
