"""2-D key points (COCO-17, OpenPose) to Motion in image coordinates, y down.

An estimator marks a joint it did not see with confidence 0. Such a joint is filled in by a straight line in time, and
the frame is marked not valid; a joint that is never seen is an error. Leave out what does not matter
(`joints=("left_wrist", ...)`), else every frame with a hidden ear counts as not valid.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.arrays import checked_motion, number_array, read_npy
from harmolab.io.files import PathLike, read_json, reading
from harmolab.types import FloatArray, Motion, Skeleton

__all__ = [
    "COCO_17",
    "OPENPOSE_18",
    "OPENPOSE_25",
    "dancer_motion",
    "joint_indices",
    "keypoints_motion",
    "load_keypoints",
    "load_openpose",
    "named_skeleton",
    "skeleton_part",
]

COCO_17 = Skeleton(
    (
        *("nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow"),
        *("right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee"),
        *("left_ankle", "right_ankle"),
    ),
    (-1, 0, 0, 1, 2, 0, 0, 5, 6, 7, 8, 5, 6, 11, 12, 13, 14),
)

OPENPOSE_18 = Skeleton(
    (
        *("nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist"),
        *("right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle"),
        *("right_eye", "left_eye", "right_ear", "left_ear"),
    ),
    (1, -1, 1, 2, 3, 1, 5, 6, 1, 8, 9, 1, 11, 12, 0, 0, 14, 15),
)

OPENPOSE_25 = Skeleton(
    (
        *("nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist"),
        *("mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle"),
        *("right_eye", "left_eye", "right_ear", "left_ear", "left_big_toe", "left_small_toe", "left_heel"),
        *("right_big_toe", "right_small_toe", "right_heel"),
    ),
    (1, 8, 1, 2, 3, 1, 5, 6, -1, 8, 9, 10, 8, 12, 13, 0, 0, 15, 16, 14, 19, 14, 11, 22, 11),
)

_PERSON_BYTES = 64 * 2**20


def named_skeleton(count: int) -> Skeleton | None:
    """The pose skeleton with `count` joints: 17 COCO, 18 and 25 OpenPose; None for other counts."""
    return {17: COCO_17, 18: OPENPOSE_18, 25: OPENPOSE_25}.get(count)


def load_keypoints(path: PathLike, *, fps: float, joints: Sequence[str] | None = None) -> Motion:
    """2-D key points from a `.npy` array, or from a folder of OpenPose JSON files.

    Parameters
    ----------
    path : str or path
        An array (T, J, 2), (T, J, 3) with a confidence behind x and y, or flat (T, 2J), (T, 3J); J is 17, 18 or 25.
        Or the folder that OpenPose wrote.
    fps : float, frames per second
    joints : names, optional
        Keep these joints only.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    if Path(path).is_dir():
        return load_openpose(path, fps=fps, joints=joints)
    with reading(path, "a .npy array") as file:
        with file.open("rb") as stream:
            values = read_npy(stream, file.stat().st_size)
        return keypoints_motion(values, fps, joints=joints)


def keypoints_motion(values: NDArray[Any], fps: float, *, joints: Sequence[str] | None = None) -> Motion:
    """A Motion from an array of key points; gaps (confidence 0) are filled and marked.

    Parameters
    ----------
    values : (T, J, 2), (T, J, 3) or flat (T, 2J), (T, 3J) array; x, y and perhaps confidence
    fps : float, frames per second
    joints : names to keep, optional
    """
    points = _with_joints(values)
    skeleton = named_skeleton(points.shape[1]) or Skeleton.unnamed(points.shape[1])
    if joints is not None:
        keep = joint_indices(skeleton, joints)
        points, skeleton = points[:, keep], skeleton_part(skeleton, keep)
    if points.shape[2] == 2:
        return checked_motion(points, fps, skeleton)
    seen = np.asarray(points[..., 2] > 0)
    return checked_motion(_filled(points[..., :2], seen, skeleton), fps, skeleton, np.asarray(seen.all(axis=1)))


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


def joint_indices(skeleton: Skeleton, joints: Sequence[str]) -> list[int]:
    """Where `joints` stand in the skeleton."""
    unknown = [name for name in joints if name not in skeleton.joints]
    if unknown or not joints:
        raise ValueError(f"no joints named {unknown}; there are {', '.join(skeleton.joints)}")
    return [skeleton.joints.index(name) for name in joints]


def skeleton_part(skeleton: Skeleton, keep: list[int]) -> Skeleton:
    """The skeleton of the joints `keep`; each hangs on its nearest ancestor that is kept."""
    parents = []
    for joint in keep:
        parent = skeleton.parents[joint]
        while parent >= 0 and parent not in keep:
            parent = skeleton.parents[parent]
        parents.append(keep.index(parent) if parent >= 0 else -1)
    return Skeleton(tuple(skeleton.joints[joint] for joint in keep), tuple(parents))


def _filled(points: NDArray[Any], seen: NDArray[np.bool_], skeleton: Skeleton) -> FloatArray:
    """`points` (T, J, 2) with straight lines where a joint was not `seen` (T, J); held at the ends."""
    never = [name for joint, name in enumerate(skeleton.joints) if not seen[:, joint].any()]
    if never:
        raise ValueError(f"never shows {', '.join(never)}; keep the other joints only (joints=...)")
    filled, frames = points.astype(np.float64), np.arange(len(points))
    for joint in np.flatnonzero(~seen.all(axis=0)):
        there = seen[:, joint]
        for axis in (0, 1):
            filled[:, joint, axis] = np.interp(frames, frames[there], filled[there, joint, axis])
    return filled


def load_openpose(folder: PathLike, *, fps: float, joints: Sequence[str] | None = None) -> Motion:
    """One dancer's key points from a folder of OpenPose JSON files, one file a frame in the order of their numbers.

    With several people in a frame, of those at least half as confident as the best the one nearest to the dancer of
    the frame before is taken (in the first frame: the most confident). Frames without anybody are filled in and
    marked not valid.

    Parameters
    ----------
    folder : str or path
    fps : float, frames per second
    joints : names to keep, optional

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder or the file in it.
    """
    frames = [_people(file) for file in _frame_files(Path(folder))]
    try:
        return dancer_motion(frames, fps, joints=joints)
    except ValueError as error:
        raise ValueError(f"{folder}: {error}") from None


def dancer_motion(frames: Sequence[Sequence[FloatArray]], fps: float, *, joints: Sequence[str] | None = None) -> Motion:
    """One dancer followed through frames with any number of people (`load_openpose` tells how).

    Parameters
    ----------
    frames : for each frame the people in it, each (J, 3): x, y, confidence
    fps : float, frames per second
    joints : names to keep, optional

    Raises
    ------
    ValueError
        Nobody is seen in any frame, or poses differ in their number of joints.
    """
    found: list[FloatArray | None] = []
    last = None
    for people in frames:
        found.append(_dancer(people, last))
        last = last if found[-1] is None else found[-1]
    poses = [pose for pose in found if pose is not None]
    if not poses:
        raise ValueError(f"nobody is seen in any of its {len(frames)} frames")
    if len({len(pose) for pose in poses}) > 1:
        raise ValueError("mixes poses of different numbers of joints")
    empty = np.zeros_like(poses[0])
    return keypoints_motion(np.stack([empty if pose is None else pose for pose in found]), fps, joints=joints)


def _frame_files(folder: Path) -> list[Path]:
    """The JSON files of a folder by frame number; ValueError where a number is missing."""
    if not folder.exists():
        raise FileNotFoundError(f"{folder}: no such folder")
    if not folder.is_dir():
        raise ValueError(f"{folder}: is not a folder of OpenPose JSON files")
    numbered: dict[int, Path] = {}
    for file in folder.glob("*.json"):
        numbers = re.findall(r"\d+", file.stem.removesuffix("_keypoints"))
        number = int(numbers[-1][-18:]) if numbers else -1
        if number in numbered:
            raise ValueError(f"{folder}: has two files for frame {number}: {numbered[number].name} and {file.name}")
        if numbers:
            numbered[number] = file
    if not numbered:
        raise ValueError(f"{folder}: holds no numbered JSON files as OpenPose writes them (name_000000000000.json)")
    first, last = min(numbered), max(numbered)
    if last - first + 1 != len(numbered):
        missing = next(number for number in range(first, last) if number not in numbered)
        raise ValueError(f"{folder}: frame {missing} is missing between {first} and {last}")
    return [numbered[number] for number in range(first, last + 1)]


def _people(file: Path) -> list[FloatArray]:
    """The people in one frame, each (J, 3): x, y, confidence."""
    with reading(file, "an OpenPose frame", max_bytes=_PERSON_BYTES):
        frame = read_json(file)
        if not isinstance(frame, dict) or not isinstance(frame.get("people"), list):
            raise ValueError("has no list 'people'; OpenPose writes one into every frame")
        return [_person(person) for person in frame["people"]]


def _person(person: Any) -> FloatArray:
    """One person's key points (J, 3)."""
    flat = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
    if not isinstance(flat, list) or len(flat) not in (3 * 18, 3 * 25):
        raise ValueError("has a person without pose_keypoints_2d of 18 or 25 joints (x, y, confidence)")
    pose = number_array(flat, "pose_keypoints_2d", (None,)).reshape(-1, 3)
    if not np.isfinite(pose).all():
        joint = int(np.argwhere(~np.isfinite(pose))[0][0])
        raise ValueError(f"NaN or infinity at joint {joint}")
    return pose


def _dancer(people: Sequence[FloatArray], previous: FloatArray | None) -> FloatArray | None:
    """The person who is the dancer, or None if nobody is there."""
    confidence = [float(pose[:, 2].mean()) for pose in people]
    if not people or max(confidence) <= 0:
        return None
    if previous is None:
        return people[int(np.argmax(confidence))]
    likely = [pose for pose, sure in zip(people, confidence, strict=True) if sure >= 0.5 * max(confidence)]
    return min(likely, key=lambda pose: _distance(pose, previous))


def _distance(pose: FloatArray, other: FloatArray) -> float:
    """Mean distance of the joints seen in both poses; infinite if there is none."""
    if pose.shape != other.shape:
        return float("inf")
    both = (pose[:, 2] > 0) & (other[:, 2] > 0)
    if not both.any():
        return float("inf")
    with np.errstate(over="ignore"):  # a place out of all bounds is infinitely far; the motion's check refuses it later
        return float(np.linalg.norm(pose[both, :2] - other[both, :2], axis=1).mean())
