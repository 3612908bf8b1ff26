"""Musicians in the JSON of pose estimators: the body and both hands of every person, by name.

People
------
A person is an object; the rows of `PARTS` say which key holds which points, as x, y, confidence, or as pairs (x, y)
with "keypoint_scores" beside them:

==================================  ==================================  ==========================================
estimator                           body                                hands
==================================  ==================================  ==========================================
OpenPose, one file a frame          ``pose_keypoints_2d``, 18 or 25     ``hand_left_keypoints_2d``,
                                                                        ``hand_right_keypoints_2d``, 21 each
COCO-WholeBody (MMPose, AlphaPose)  ``keypoints``, 133: 17 of the body, 6 of the feet, 68 of the face, 2 x 21
Halpe (AlphaPose)                   ``keypoints``, 136: 26 of body and feet, 68 of the face, 2 x 21
COCO-WholeBody's own results        ``keypoints``, 17                   ``lefthand_kpts``, ``righthand_kpts``, 21 each
COCO (any)                          ``keypoints``, 17                   none
==================================  ==================================  ==========================================

Entries, frames and several people are as in `harmolab.io.layouts`.

MediaPipe
---------
MediaPipe returns objects, not files: save ``{"fps": 30.0, "size": [1280, 720], "frames": [...]}``. A frame is null, or
an object with any of these, each null or left out where it is not in the picture:

* ``"pose_landmarks"``: 33 ``{"x", "y", "z", "visibility"}`` (or ``"landmarks"``; a bare list of them is a frame too)
* ``"left_hand_landmarks"``, ``"right_hand_landmarks"``: 21 ``{"x", "y", "z"}`` each, as Holistic has them
* ``"hands"``: a list of ``{"handedness": "Left" or "Right", "score": 0.98, "landmarks": [21 points]}``, as Hands and
  Hand Landmarker have them. Their labels are those of a mirrored picture or of the picture as it is, which differs
  between versions, so ``"handedness": "mirrored"`` or ``"picture"`` has to stand beside "frames".

x and y are shares of the picture's width and height; ``"size"`` makes pixels of them, ``"aspect"`` (width over height)
shares of the height. A hand's "visibility" is not read: MediaPipe writes 0 there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from harmolab.io import layouts
from harmolab.io.layouts import COCO_17, MEDIAPIPE_33, OPENPOSE_18, OPENPOSE_25, Layout
from harmolab.io.player_points import BODY, PLAYER_50, SIDES, hand_joints
from harmolab.types import FloatArray

EXTRAS = ("nose", "neck")  # points of the head that some readers keep
NAMES = (*PLAYER_50.joints, *EXTRAS)
HANDEDNESS = ("mirrored", "picture")

_HANDS = (*hand_joints("left"), *hand_joints("right"))
_FACE = ("",) * 68
_AT = {name: number for number, name in enumerate(NAMES)}
_HAND_LIST, _POSE_LISTS = "hands", ("pose_landmarks", "landmarks")
_SIDE_LISTS = {side: f"{side}_hand_landmarks" for side in SIDES}
_LANDMARK_KEYS = {_HAND_LIST, *_POSE_LISTS, *_SIDE_LISTS.values()}
_LONGEST_SIDE = 100_000  # pixels


class PlayerPart(NamedTuple):
    """Points of a person under one key: their names, "" for a point that is not kept, by how many there are."""

    key: str
    names: Mapping[int, tuple[str, ...]]


def _part(key: str, *names: tuple[str, ...]) -> PlayerPart:
    return PlayerPart(key, {len(row): row for row in names})


PARTS = (
    _part("pose_keypoints_2d", OPENPOSE_25.joints, OPENPOSE_18.joints),
    _part("hand_left_keypoints_2d", hand_joints("left")),
    _part("hand_right_keypoints_2d", hand_joints("right")),
    _part(
        "keypoints",
        COCO_17.joints,
        (*COCO_17.joints, *("",) * 6, *_FACE, *_HANDS),
        (*COCO_17.joints, "", "neck", *("",) * 7, *_FACE, *_HANDS),
    ),
    _part("lefthand_kpts", hand_joints("left")),
    _part("righthand_kpts", hand_joints("right")),
)


def by_name(points: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """(52, D) or (T, 52, D) points in the order of `NAMES`, 0 for those that are not among `names`."""
    rows = np.zeros((*points.shape[:-2], len(NAMES), points.shape[-1]))
    for place, name in enumerate(names):
        if name in _AT:
            rows[..., _AT[name], :] = points[..., place, :]
    return rows


def surer(points: FloatArray, others: FloatArray) -> FloatArray:
    """Of two arrays (..., 3) of x, y, confidence, each point from the one that is surer of it."""
    return np.where(others[..., 2:] > points[..., 2:], others, points)


def player_pose(person: Any, layout: Layout, name: str) -> FloatArray:
    """(52, 3) x, y, confidence of one person's points in the order of `NAMES`; 0 where there are none.

    Raises
    ------
    ValueError
        A part is damaged, or there is none; with the name.
    """
    pose = np.zeros((len(NAMES), 3))
    parts = [part for part in PARTS if isinstance(person, dict) and person.get(part.key) not in (None, [])]
    if not parts and not (isinstance(person, dict) and layout.points in person):
        raise ValueError(f"{name}: there are none")
    for part in parts:
        title = name.replace(layout.points, part.key, 1)
        points = layouts.point_array(person, part.key, tuple(part.names), layout.name, title)
        pose = surer(pose, by_name(points, part.names[len(points)]))
    return pose


def is_player_landmarks(content: Any) -> bool:
    """True for JSON like MediaPipe's: frames of landmarks, or of objects with any of the keys in the module's text."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list):
        return False
    first = next((frame for frame in frames if frame), None)
    return layouts.is_landmarks(content) or (isinstance(first, dict) and not _LANDMARK_KEYS.isdisjoint(first))


def player_landmarks(content: Any) -> FloatArray:
    """(T, 52, 3) shares of the picture's width and height, and confidence, in the order of `NAMES`; 0 where absent.

    Raises
    ------
    ValueError
        The content is damaged, or does not say whose hands the labels of "hands" name.
    """
    frames = content["frames"] if isinstance(content, dict) else content
    handedness = content.get("handedness") if isinstance(content, dict) else None
    if handedness not in (None, *HANDEDNESS):
        raise ValueError(f"'handedness' is {str(handedness)[:30]!r}; it must be 'mirrored' or 'picture'")
    return np.stack([_frame(frame, handedness, f"frame {number}") for number, frame in enumerate(frames)])


def _frame(frame: Any, handedness: str | None, name: str) -> FloatArray:
    """(52, 3) of one frame."""
    if isinstance(frame, list):
        frame = {"landmarks": frame}
    if not isinstance(frame, dict | None):
        raise ValueError(f"{name} is no frame of landmarks but {str(frame)[:30]!r}")
    pose, content = np.zeros((len(NAMES), 3)), frame or {}
    for key in _POSE_LISTS:
        body = layouts.landmark_array(content.get(key), f"{key} of {name}")
        if not np.isnan(body).any():
            pose = by_name(body[:, [0, 1, 3]], MEDIAPIPE_33.joints)
    for side, (points, score) in _hands(content, handedness, name).items():
        if not np.isnan(points).any():
            hand = np.column_stack([points[:, :2], np.full(len(points), score)])
            pose = surer(pose, by_name(hand, hand_joints(side)))
    return pose


def _hands(frame: Mapping[str, Any], handedness: str | None, name: str) -> dict[str, tuple[FloatArray, float]]:
    """(21, 4) landmarks and the score of each side's hand in a frame; of two with one label the surer."""
    count = len(hand_joints("left"))
    hands = {
        side: (layouts.landmark_array(frame.get(key), f"{key} of {name}", count), 1.0)
        for side, key in _SIDE_LISTS.items()
        if frame.get(key)
    }
    entries = frame.get(_HAND_LIST) or []
    if not isinstance(entries, list):
        raise ValueError(f"{name}: 'hands' is no list of hands")
    for number, entry in enumerate(entries):
        title = f"hand {number} of {name}"
        side, score = _side(entry, handedness, title), _score(entry, title)
        if side not in hands or score > hands[side][1]:
            hands[side] = layouts.landmark_array(entry.get("landmarks"), title, count), score
    return hands


def _side(entry: Any, handedness: str | None, name: str) -> str:
    """The side of the picture's person that an entry's hand is on."""
    label = str(entry.get("handedness")).lower() if isinstance(entry, dict) else ""
    if label not in SIDES:
        raise ValueError(f"{name} has no 'handedness' that is 'Left' or 'Right'")
    if handedness is None:
        raise ValueError(
            f"{name} is labelled {label!r}, which is the other hand in some versions of MediaPipe: look at one picture "
            'and write beside \'frames\' "handedness": "picture" where the label is right, "mirrored" where it is not'
        )
    return label if handedness == "picture" else SIDES[1 - SIDES.index(label)]


def _score(entry: Mapping[str, Any], name: str) -> float:
    """The score of a hand, 0 to 1; 1 where none is written."""
    score = entry.get("score", 1.0)
    if isinstance(score, bool) or not isinstance(score, int | float) or not 0 <= score <= 1:
        raise ValueError(f"{name}: its score must lie between 0 and 1, got {str(score)[:30]!r}")
    return float(score)


def picture_scale(about: Mapping[str, Any]) -> tuple[tuple[float, float], bool]:
    """Factors of x and y that make one unit of shares of a picture, and True where that unit is the pixel.

    Parameters
    ----------
    about : "size", width and height in pixels, or "aspect", width over height

    Raises
    ------
    ValueError
        There is neither, or it cannot be.
    """
    size, aspect = about.get("size"), about.get("aspect")
    if size is not None:
        return checked_size(size), True
    if aspect is None:
        raise ValueError('has shares of the picture as x and y; write its "size": [width, height] beside "frames"')
    if isinstance(aspect, bool) or not isinstance(aspect, int | float) or not 0.1 <= aspect <= 10:
        raise ValueError(f"aspect is width over height and must lie between 0.1 and 10, got {str(aspect)[:30]!r}")
    return (float(aspect), 1.0), False


def checked_size(size: Any) -> tuple[float, float]:
    """Width and height of a picture, pixels; ValueError unless these are two numbers that can be."""
    is_pair = isinstance(size, list | tuple) and len(size) == 2 and not any(isinstance(side, bool) for side in size)
    if not is_pair or not all(isinstance(side, int | float) and 1 <= side <= _LONGEST_SIDE for side in size):
        raise ValueError(f"size must be the picture's width and height in pixels, got {str(size)[:40]!r}")
    return float(size[0]), float(size[1])


def mirrored_names() -> list[int]:
    """For every name of `NAMES` the number of the same point on the other side."""
    other = {"left": "right", "right": "left"}
    words = [name.partition("_") for name in NAMES]
    return [_AT.get(f"{other.get(side, side)}{line}{part}", number) for number, (side, line, part) in enumerate(words)]


COMPARED = slice(0, len(BODY))  # people are told apart by their bodies: hands come and go
