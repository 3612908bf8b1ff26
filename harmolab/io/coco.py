"""COCO-17 key points in JSON, as pose estimators write them for a whole video.

==========================  ============================================================================================
layout                      who writes it
==========================  ============================================================================================
COCO results                a list of ``{"image_id": 12, "keypoints": [x, y, confidence, ... 51 numbers]}``:
                            AlphaPose, Detectron2, ViTPose, Ultralytics, and whatever else is scored on COCO
COCO annotations            ``{"annotations": [...]}`` with the same entries
MMPose                      ``{"instance_info": [{"frame_id": 1, "instances": [{"keypoints": [[x, y], ...],
                            "keypoint_scores": [...]}]}]}``, or that list alone
OpenPifPaf                  one JSON object a line, ``{"frame": 1, "predictions": [{"keypoints": [51 numbers]}]}``
==========================  ============================================================================================

An ``image_id`` is the number of the frame, or a name with the number in it (``"000012.jpg"``). Frames that are not
named, between the first and the last, show nobody. Of several people the dancer is followed as in
`harmolab.io.keypoints.load_openpose`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.io.arrays import number_array
from harmolab.io.files import MAX_JSON_BYTES, PathLike, read_text, reading
from harmolab.io.keypoints import COCO_17, dancer_motion
from harmolab.types import FloatArray, Motion

__all__ = ["coco_people", "load_coco", "people_motion", "read_lines"]

MAX_FRAMES = 432_000  # four hours at 30 frames per second
SPARSE = 20  # frames for each entry, on average; above, these are no frames of one video
_COUNT = len(COCO_17.joints)

People = dict[int, list[FloatArray]]  # frame number -> (17, 3) x, y, confidence of each person


def load_coco(path: PathLike, *, fps: float, joints: Sequence[str] | None = None) -> Motion:
    """One dancer's movement from a JSON file of COCO-17 key points, in any layout of the table above.

    Parameters
    ----------
    path : str or path
    fps : float, frames per second of the video
    joints : names to keep, optional

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "COCO key points", max_bytes=MAX_JSON_BYTES) as file:
        people = coco_people(read_lines(file))
        if people is None:
            raise ValueError("is no list of COCO-17 key points; see harmolab.io.coco for the layouts that are read")
        return people_motion(people, fps, joints=joints)


def people_motion(people: People, fps: float, *, joints: Sequence[str] | None = None) -> Motion:
    """The dancer among the people of each frame, from the first frame named to the last; as `load_coco`."""
    return dancer_motion(_in_order(people), fps, joints=joints)


def read_lines(path: Path) -> Any:
    """The content of a JSON file, or the list of contents of a file with one JSON object a line."""
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        # What goes on behind a whole object in a new line: one object a line.
        if not error.msg.startswith("Extra data") or not text.lstrip().startswith("{"):
            raise
        return [json.loads(line) for line in text.splitlines() if line.strip()]


def coco_people(content: Any) -> People | None:
    """The people in each frame; None when the content is in none of the layouts.

    >>> nose_only = [5.0, 6.0, 0.9] + [0.0] * 48
    >>> people = coco_people([{"image_id": "frame_07.jpg", "keypoints": nose_only}])
    >>> people[7][0][0]
    array([5. , 6. , 0.9])

    Raises
    ------
    ValueError
        An entry of a known layout is damaged.
    """
    entries = content
    if isinstance(content, dict):
        named = [content[name] for name in ("annotations", "instance_info") if name in content]
        entries = named[0] if named else [content]
    if not isinstance(entries, list) or not entries or not isinstance(entries[0], dict):
        return None
    first = entries[0]
    for frame, persons in (("frame_id", "instances"), ("frame", "predictions")):
        if persons in first:
            return _grouped(entries, frame, persons)
    return _listed(entries) if "keypoints" in first and "image_id" in first else None


def _listed(entries: list[Any]) -> People:
    """COCO results: one entry a person, with the frame named in it."""
    people: People = {}
    for place, entry in enumerate(entries):
        if not isinstance(entry, dict) or "keypoints" not in entry or "image_id" not in entry:
            raise ValueError(f"entry {place} has no image_id and keypoints")
        people.setdefault(_number(entry["image_id"], place), []).append(_pose(entry, place))
    return people


def _grouped(entries: list[Any], frame: str, persons: str) -> People:
    """One entry a frame, with a list of people in it."""
    people: People = {}
    for place, entry in enumerate(entries):
        listed = entry.get(persons) if isinstance(entry, dict) else None
        if not isinstance(listed, list):
            raise ValueError(f"entry {place} has no list {persons!r}")
        people.setdefault(_number(entry.get(frame, place), place), []).extend(_pose(one, place) for one in listed)
    return people


def _number(frame: Any, place: int) -> int:
    """The frame's number, told as a number or inside a name."""
    digits = re.findall(r"\d{1,18}", frame) if isinstance(frame, str) else []
    number = int(digits[-1]) if digits else frame
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 10**18:
        raise ValueError(f"entry {place} names its frame {str(frame)[:30]!r}, which holds no number")
    return number


def _pose(person: Any, place: int) -> FloatArray:
    """(17, 3) x, y, confidence of one person."""
    given = person.get("keypoints") if isinstance(person, dict) else None
    name = f"keypoints of entry {place}"
    if not isinstance(given, list) or len(given) not in (_COUNT, 3 * _COUNT):
        count = len(given) if isinstance(given, list) else "no"
        raise ValueError(f"{name}: {count} values; COCO-17 has 17 points (x, y) or 51 numbers (x, y, confidence)")
    if len(given) == 3 * _COUNT:
        pose = number_array(given, name, (3 * _COUNT,)).reshape(_COUNT, 3)
    else:
        points = number_array(given, name, (_COUNT, 2))
        scores = number_array(person.get("keypoint_scores", [1.0] * _COUNT), f"scores of entry {place}", (_COUNT,))
        pose = np.column_stack([points, scores])
    if not np.isfinite(pose).all():
        raise ValueError(f"{name}: NaN or infinity")
    return pose


def _in_order(people: People) -> list[list[FloatArray]]:
    """The people of every frame from the first named to the last."""
    first, last = min(people), max(people)
    length = last - first + 1
    if length > min(MAX_FRAMES, SPARSE * len(people)):
        raise ValueError(
            f"names {len(people)} frames between {first} and {last}: these are no frames of one video; "
            "name each image by its frame number"
        )
    return [people.get(number, []) for number in range(first, last + 1)]
