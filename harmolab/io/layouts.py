"""Key points in the JSON of pose estimators: a table of layouts of many people, and MediaPipe's landmarks of one body.

A row of `LAYOUTS` is the way in which one estimator writes people; the content of a file decides which row it is.
Frames that are not named, between the first and the last, are empty.

MediaPipe returns objects, not files: save a list of frames, or ``{"fps": 30.0, "aspect": 1.5, "world": false,
"frames": [...]}``. A frame is a list of 33 ``{"x", "y", "z", "visibility"}`` (or ``{"landmarks": [...]}``), or null or
an empty list where the picture is empty.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from harmolab.io.arrays import number_array
from harmolab.io.files import read_text
from harmolab.types import FloatArray, Skeleton


def _both(*parts: str) -> tuple[str, ...]:
    """The left and the right of each part in turn."""
    return tuple(f"{side}_{part}" for part in parts for side in ("left", "right"))


def _branches(*parts: str) -> tuple[str, ...]:
    """All parts of the right, then all of the left."""
    return tuple(f"{side}_{part}" for side in ("right", "left") for part in parts)


COCO_17 = Skeleton(
    ("nose", *_both("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")),
    (-1, 0, 0, 1, 2, 0, 0, 5, 6, 7, 8, 5, 6, 11, 12, 13, 14),
)

_HEAD_AND_ARMS = ("nose", "neck", *_branches("shoulder", "elbow", "wrist"))
_FACE = (*_branches("eye"), *_branches("ear"))

OPENPOSE_18 = Skeleton(
    (*_HEAD_AND_ARMS, *_branches("hip", "knee", "ankle"), *_FACE),
    (1, -1, 1, 2, 3, 1, 5, 6, 1, 8, 9, 1, 11, 12, 0, 0, 14, 15),
)

OPENPOSE_25 = Skeleton(
    (
        *(*_HEAD_AND_ARMS, "mid_hip", *_branches("hip", "knee", "ankle"), *_FACE, "left_big_toe", "left_small_toe"),
        *("left_heel", "right_big_toe", "right_small_toe", "right_heel"),
    ),
    (1, 8, 1, 2, 3, 1, 5, 6, -1, 8, 9, 10, 8, 12, 13, 0, 0, 15, 16, 14, 19, 14, 11, 22, 11),
)

MEDIAPIPE_33 = Skeleton(
    (
        *("nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer"),
        *("left_ear", "right_ear", "mouth_left", "mouth_right", *_both("shoulder", "elbow", "wrist", "pinky")),
        *_both("index", "thumb", "hip", "knee", "ankle", "heel", "foot_index"),
    ),
    (
        *(-1, 0, 1, 2, 0, 4, 5, 3, 6, 0, 0, 0, 0, 11, 12, 13, 14, 15, 16, 15, 16, 15, 16),
        *(11, 12, 23, 24, 25, 26, 27, 28, 29, 30),
    ),
)


class Layout(NamedTuple):
    """One way of writing people into JSON: its name, its skeletons, and the keys by which its parts are called.

    `entries` is the list of entries, where it stands in an object; `frame` the number of an entry's frame, or a name
    with the number in it (``"000012.jpg"``); `people` the list of people of an entry, or "" where an entry is one
    person; `points` a person's numbers x, y, confidence, or pairs (x, y) with "keypoint_scores" beside them.
    """

    name: str
    skeletons: tuple[Skeleton, ...]
    entries: str
    frame: str
    people: str
    points: str

    def fits(self, entry: Any) -> bool:
        """True for an entry that has the keys of this layout."""
        keys = {self.people} if self.people else {self.frame, self.points}
        return isinstance(entry, dict) and keys <= entry.keys()


Pose = Callable[[Any, Layout, str], FloatArray]

LAYOUTS = (
    # AlphaPose, Detectron2, ViTPose, Ultralytics and all that is scored on COCO; a bare list, or as annotations.
    Layout("COCO-17", (COCO_17,), "annotations", "image_id", "", "keypoints"),
    Layout("MMPose", (COCO_17,), "instance_info", "frame_id", "instances", "keypoints"),
    Layout("OpenPifPaf", (COCO_17,), "", "frame", "predictions", "keypoints"),  # one object a line
    Layout("OpenPose", (OPENPOSE_18, OPENPOSE_25), "", "", "people", "pose_keypoints_2d"),  # one file a frame
)
OPENPOSE = LAYOUTS[-1]

MAX_FRAMES = 432_000  # four hours at 30 frames per second
SPARSE = 20  # frames for each entry, on average; above, these are no frames of one video


def named_skeleton(count: int) -> Skeleton | None:
    """The pose skeleton with `count` joints: 17 COCO, 18 and 25 OpenPose; None for other counts."""
    return {17: COCO_17, 18: OPENPOSE_18, 25: OPENPOSE_25}.get(count)


def json_or_lines(path: Path) -> Any:
    """The content of a JSON file, or the list of contents of a file with one JSON object a line."""
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        # What goes on behind a whole object in a new line: one object a line.
        if not error.msg.startswith("Extra data") or not text.lstrip().startswith("{"):
            raise
        return [json.loads(line) for line in text.splitlines() if line.strip()]


def people_by_frame(content: Any, pose: Pose | None = None) -> list[list[FloatArray]]:
    """The people in every frame from the first that is named to the last, each (J, 3) x, y, confidence.

    >>> nose_only = [5.0, 6.0, 0.9] + [0.0] * 48
    >>> people_by_frame([{"image_id": "frame_07.jpg", "keypoints": nose_only}])[0][0][0]
    array([5. , 6. , 0.9])

    Parameters
    ----------
    content : of a JSON file
    pose : function(person, layout, name) -> (J, 3); left out, the body alone

    Raises
    ------
    ValueError
        The content is in no layout of the table, or an entry is damaged.
    """
    if isinstance(content, dict) and isinstance(content.get("people"), list):
        raise ValueError("is one frame of OpenPose; name the folder that holds all of them")
    entries = content
    if isinstance(content, dict):
        entries = next((content[layout.entries] for layout in LAYOUTS if layout.entries in content), [content])
    sample = entries[0] if isinstance(entries, list) and entries else None
    layout = next((layout for layout in LAYOUTS if layout.fits(sample)), None)
    if layout is None:
        raise ValueError(
            f"holds {_summary(content)}, which is neither MediaPipe landmarks (frames of 33 points with x, y, z) "
            "nor COCO-17 key points (entries with image_id and keypoints)"
        )
    people: dict[int, list[FloatArray]] = {}
    for place, entry in enumerate(entries):
        poses = entry_poses(entry, layout, f"entry {place}", pose)
        people.setdefault(_frame_number(entry.get(layout.frame, place), place), []).extend(poses)
    first, last = min(people), max(people)
    if last - first + 1 > min(MAX_FRAMES, SPARSE * len(people)):
        raise ValueError(
            f"names {len(people)} frames between {first} and {last}: these are no frames of one video; "
            "name each image by its frame number"
        )
    return [people.get(number, []) for number in range(first, last + 1)]


def _summary(content: Any) -> str:
    """A JSON content in a few words."""
    if isinstance(content, dict):
        return "an object with " + (", ".join(repr(str(name)[:20]) for name in list(content)[:5]) or "nothing in it")
    if isinstance(content, list):
        return f"a list of {len(content)}" + (f", first {str(content[0])[:40]!r}" if content else "")
    return repr(str(content)[:40])


def _frame_number(frame: Any, place: int) -> int:
    """The number of a frame from a number or from a name that holds it."""
    digits = re.findall(r"\d{1,18}", frame) if isinstance(frame, str) else []
    number = int(digits[-1]) if digits else frame
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 10**18:
        raise ValueError(f"entry {place} names its frame {str(frame)[:30]!r}, which holds no number")
    return number


def entry_poses(entry: Any, layout: Layout, name: str, pose: Pose | None = None) -> list[FloatArray]:
    """The people in one entry, each (J, 3) x, y, confidence; ValueError with its name where they are damaged."""
    if not layout.people and not layout.fits(entry):
        raise ValueError(f"{name} has no {layout.frame} and {layout.points}")
    people: Any = [entry]
    if layout.people:
        people = entry.get(layout.people) if isinstance(entry, dict) else None
    if not isinstance(people, list):
        raise ValueError(f"{name} has no list {layout.people!r}")
    return [(pose or _body)(person, layout, f"{layout.points} of {name}") for person in people]


def _body(person: Any, layout: Layout, name: str) -> FloatArray:
    """(J, 3) x, y, confidence of one person's body."""
    counts = [len(skeleton.joints) for skeleton in layout.skeletons]
    return point_array(person if isinstance(person, dict) else {}, layout.points, counts, layout.name, name)


def point_array(person: Mapping[str, Any], key: str, counts: Sequence[int], estimator: str, name: str) -> FloatArray:
    """(J, 3) x, y, confidence of a person's points under a key, J one of `counts`; ValueError with a name for them."""
    values = person.get(key)
    length = len(values) if isinstance(values, list) else 0
    count = next((count for count in counts if length in (count, 3 * count)), None)
    if count is None:
        points = " or ".join(map(str, counts))
        raise ValueError(f"{name}: {length} values; {estimator} has {points} points of x, y and confidence")
    if length == 3 * count:
        pose = number_array(values, name, (length,)).reshape(-1, 3)
    else:
        scores = number_array(person.get("keypoint_scores", [1.0] * count), f"scores beside {name}", (count,))
        pose = np.column_stack([number_array(values, name, (count, 2)), scores])
    if not np.isfinite(pose).all():
        raise ValueError(f"{name}: NaN or infinity at joint {np.argwhere(~np.isfinite(pose))[0][0]}")
    return pose


def is_landmarks(content: Any) -> bool:
    """True for JSON like MediaPipe's: frames of landmarks with x, or empty frames."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list) or not frames:
        return False
    first = next((frame for frame in frames if frame), None)
    points = first.get("landmarks") if isinstance(first, dict) else first
    return first is None or (
        isinstance(points, list) and bool(points) and isinstance(points[0], dict) and "x" in points[0]
    )


def landmarks_by_frame(content: Any) -> FloatArray:
    """(T, 33, 4) x, y, z and visibility, NaN in empty frames, of content that `is_landmarks`."""
    frames = content["frames"] if isinstance(content, dict) else content
    lists = [frame.get("landmarks") if isinstance(frame, dict) else frame for frame in frames]
    return np.stack([landmark_array(points, f"frame {number}") for number, points in enumerate(lists)])


def landmark_array(points: Any, name: str, count: int = len(MEDIAPIPE_33.joints)) -> FloatArray:
    """(count, 4) x, y, z, visibility of a list of landmarks; NaN for an empty one, visibility 1 where none is written.

    Raises
    ------
    ValueError
        The list is damaged; with the name.
    """
    if points is None or points == []:
        return np.full((count, 4), np.nan)
    if not isinstance(points, list) or len(points) != count or not all(isinstance(point, dict) for point in points):
        raise ValueError(f"{name} is no list of {count} landmarks with x, y, z and visibility")
    missing = [axis for axis in "xyz" if any(axis not in point for point in points)]
    if missing:
        raise ValueError(f"{name} has a landmark without {', '.join(missing)}")
    rows = [[point["x"], point["y"], point["z"], point.get("visibility", 1.0)] for point in points]
    values = number_array(rows, name, (count, 4))
    if not np.isfinite(values).all():
        raise ValueError(f"NaN or infinity in {name}; write null where nobody was seen")
    return values
