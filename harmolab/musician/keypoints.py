"""Key points of musicians, body and both hands with their confidence, by name, from the files of pose estimators.

Of several people in a picture, the musician is followed as `harmolab.readers.keypoints` follows a dancer. Left and
right are the player's: in a mirrored picture (as front cameras make) an estimator names the mirror image's, and the
keys run the wrong way, so ``mirrored`` turns both back.

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

Entries, frames and several people are as in `harmolab.readers.keypoints`.

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

import os
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from harmolab.files import MAX_JSON_BYTES, MissingFrameRate, PathLike, named_faults, reading
from harmolab.readers import keypoints
from harmolab.readers.arrays import checked_motion
from harmolab.readers.player_points import BODY, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.types import BoolArray, FloatArray, Motion

# Body and hands of every person in JSON, by name

EXTRAS = ("nose", "neck")  # points of the head that some readers keep
NAMES = (*PLAYER_50.joints, *EXTRAS)
HANDEDNESS = ("mirrored", "picture")

_HANDS = (*hand_joints("left"), *hand_joints("right"))
_FACE, _COCO = ("",) * 68, keypoints.COCO_17.joints
_AT = {name: number for number, name in enumerate(NAMES)}
_HAND_LIST, _POSE_LISTS = "hands", keypoints.POSE_LISTS
_SIDE_LISTS = {side: f"{side}_hand_landmarks" for side in SIDES}
_LANDMARK_KEYS = {_HAND_LIST, *_POSE_LISTS, *_SIDE_LISTS.values()}
_LONGEST_SIDE = 100_000  # pixels


# Points of a person by their key: the names, "" for a point that is not kept, for each number of points there may be.
PARTS: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "pose_keypoints_2d": (keypoints.OPENPOSE_25.joints, keypoints.OPENPOSE_18.joints),
    "hand_left_keypoints_2d": (hand_joints("left"),),
    "hand_right_keypoints_2d": (hand_joints("right"),),
    "keypoints": (_COCO, (*_COCO, *("",) * 6, *_FACE, *_HANDS), (*_COCO, "", "neck", *("",) * 7, *_FACE, *_HANDS)),
    "lefthand_kpts": (hand_joints("left"),),
    "righthand_kpts": (hand_joints("right"),),
}


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


def player_pose(person: Any, layout: keypoints.Layout, name: str) -> FloatArray:
    """(52, 3) x, y, confidence of one person's points in the order of `NAMES`; 0 where there are none.

    Raises
    ------
    ValueError
        A part is damaged, or there is none; with the name.
    """
    pose = np.zeros((len(NAMES), 3))
    keys = [key for key in PARTS if isinstance(person, dict) and person.get(key) not in (None, [])]
    if not keys and not (isinstance(person, dict) and layout.points in person):
        raise ValueError(f"{name}: there are none")
    for key in keys:
        names = {len(row): row for row in PARTS[key]}
        points = keypoints.point_array(person, key, tuple(names), layout.name, name.replace(layout.points, key, 1))
        pose = surer(pose, by_name(points, names[len(points)]))
    return pose


def is_player_landmarks(content: Any) -> bool:
    """True for JSON like MediaPipe's: frames of landmarks, or of objects with any of the keys in the module's text."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list):
        return False
    first = next((frame for frame in frames if frame), None)
    return keypoints.is_landmarks(content) or (isinstance(first, dict) and not _LANDMARK_KEYS.isdisjoint(first))


def player_landmarks(content: Any) -> FloatArray:
    """(T, 52, 3) shares of the picture's width and height, and confidence, in the order of `NAMES`; 0 where absent.

    Raises
    ------
    ValueError
        The content is damaged, or does not say whose hands the labels of "hands" name.
    """
    frames = keypoints.landmark_frames(content)
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
        body = keypoints.landmark_array(content.get(key), f"{key} of {name}")
        if not np.isnan(body).any():
            pose = by_name(body[:, [0, 1, 3]], keypoints.MEDIAPIPE_33.joints)
    for side, (points, score) in _hands(content, handedness, name).items():
        if not np.isnan(points).any():
            hand = np.column_stack([points[:, :2], np.full(len(points), score)])
            pose = surer(pose, by_name(hand, hand_joints(side)))
    return pose


def _hands(frame: Mapping[str, Any], handedness: str | None, name: str) -> dict[str, tuple[FloatArray, float]]:
    """(21, 4) landmarks and the score of each side's hand in a frame; of two with one label the surer."""
    count = len(hand_joints("left"))
    hands = {
        side: (keypoints.landmark_array(frame.get(key), f"{key} of {name}", count), 1.0)
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
            hands[side] = keypoints.landmark_array(entry.get("landmarks"), title, count), score
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


# Points of one musician, followed through the files

SURE = 0.3  # confidence from which on a point counts as detected
LEAST_SHARE = 0.1  # of the frames; a point that is detected in fewer is left out

# function(frame, (left, top, right, bottom)) -> True where the person in that box of that frame is the musician
IsMusician = Callable[[int, tuple[float, float, float, float]], bool]


class PlayerPoints(NamedTuple):
    """Tracked points of a musician.

    Parameters
    ----------
    motion : Motion, (T, P, 2) image coordinates, y down, with the names of `PLAYER_50`
        Gaps are filled by straight lines. A frame in which nothing is detected is not valid.
    confidence : (T, P) array, as the estimator gives it, mostly 0 to 1
    detected : (T, P) mask, False where a point's place is filled in
    """

    motion: Motion
    confidence: FloatArray
    detected: BoolArray


class _Source(NamedTuple):
    """Points of one file: (T, 52, 3) x, y, confidence, its frame rate if it has one, and True for pixels."""

    points: FloatArray
    fps: Any
    is_pixels: bool


def load_player_points(
    paths: PathLike | Sequence[PathLike],
    *,
    fps: float | None = None,
    default_fps: float | None = None,
    size: tuple[float, float] | None = None,
    mirrored: bool | None = None,
    is_musician: IsMusician | None = None,
) -> PlayerPoints:
    """The points of one musician from `.json`, `.jsonl` or the folder that OpenPose wrote; or from several of these.

    Of several files of one video, each point in each frame is taken from the file that is surer of it.

    Parameters
    ----------
    paths : str or path, or several
    fps, default_fps : float, frames per second: in place of what the file says, and where it says nothing
    size : width and height of the picture in pixels; for MediaPipe's files that do not hold it, and for `mirrored`
    mirrored : bool, the picture is a mirror image; default what the file says, else False
    is_musician : function(frame, box) -> bool, such as the signature of a face; it is asked of every person that a
        file of people holds, before one is followed. Default: everybody may be the musician.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError also for files of different lengths or units.
    """
    files = [Path(paths)] if isinstance(paths, str | os.PathLike) else [Path(path) for path in paths]
    if not files:
        raise ValueError("no file of key points is named")
    sources = [_source(file, size, mirrored, is_musician) for file in files]
    rate = next((rate for rate in (fps, *(source.fps for source in sources), default_fps) if rate is not None), None)
    if rate is None:
        raise MissingFrameRate(f"{files[0]}: holds key points but no frame rate; pass fps, such as --fps 25")
    _check_alike(files, sources)
    try:
        return player_points(reduce(surer, (source.points for source in sources)), NAMES, rate)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{', '.join(map(str, files))}: {error}") from None


def player_points(points: FloatArray, names: tuple[str, ...], fps: Any, *, extras: Sequence[str] = ()) -> PlayerPoints:
    """The points of a musician from an array of them; gaps are filled, points that are hardly ever detected left out.

    Parameters
    ----------
    points : (T, P, 3) array: x, y, confidence; a place of NaN is not detected
    names : the P names, of which those of `PLAYER_50` and of `extras` are kept
    fps : frames per second
    extras : of "nose" and "neck", those to keep

    Raises
    ------
    ValueError
        No point is detected in enough frames; a rate, a name or a value cannot be.
    """
    if unknown := set(extras) - set(EXTRAS):
        raise ValueError(f"extras are of {', '.join(EXTRAS)}, got {', '.join(map(str, unknown))}")
    rows = by_name(points, names)
    is_detected = (rows[..., 2] >= SURE) & ~np.isnan(rows).any(axis=2)
    optional = set(EXTRAS) - set(extras)
    shares = is_detected.mean(axis=0) if len(rows) else np.zeros(len(NAMES))
    keep = [number for number, name in enumerate(NAMES) if name not in optional and shares[number] >= LEAST_SHARE]
    if not keep:
        raise ValueError(f"no point of a musician is detected in {LEAST_SHARE:.0%} or more of its {len(rows)} frames")
    skeleton, detected = player_skeleton([NAMES[number] for number in keep]), is_detected[:, keep]
    with np.errstate(over="ignore", invalid="ignore"):  # places out of all bounds, which the motion's check refuses
        places = keypoints.filled_points(rows[:, keep, :2], detected, skeleton)
    motion = checked_motion(places, fps, skeleton, np.asarray(detected.any(axis=1)))
    return PlayerPoints(motion, np.nan_to_num(rows[:, keep, 2]), detected)


def _source(path: Path, size: Sequence[float] | None, mirrored: bool | None, is_musician: IsMusician | None) -> _Source:
    """The points of one file or folder, the player's left being left."""
    about: Mapping[str, Any] = {} if size is None else {"size": checked_size(size)}
    if path.is_dir():
        frames = keypoints.people_in_frames(keypoints.frame_files(path), player_pose)
        with named_faults(path):
            points = _musician(frames, is_musician)
        return _Source(_unmirrored(points, about, bool(mirrored), 0.0), None, True)
    if path.suffix.lower() not in (".json", ".jsonl"):
        raise ValueError(f"{path}: key points of musicians are read from .json, .jsonl and folders of OpenPose")
    with reading(path, "key points", max_bytes=MAX_JSON_BYTES):
        content = keypoints.json_or_lines(path)
        about = {**(content if isinstance(content, dict) else {}), **about}
        turn = about.get("mirrored", False) if mirrored is None else mirrored
        if not isinstance(turn, bool):
            raise ValueError(f"mirrored must be true or false, got {str(turn)[:30]!r}")
        if not is_player_landmarks(content):
            people = keypoints.people_by_frame(content, player_pose)
            return _Source(_unmirrored(_musician(people, is_musician), about, turn, 0.0), about.get("fps"), True)
        (width, height), is_pixels = picture_scale(about)
        with np.errstate(over="ignore"):
            points = player_landmarks(content) * [width, height, 1.0]
        return _Source(_unmirrored(points, {}, turn, width), about.get("fps"), is_pixels)


def _musician(frames: Sequence[Sequence[FloatArray]], is_musician: IsMusician | None) -> FloatArray:
    """(T, 52, 3) of the musician among the people of every frame."""
    if is_musician is not None:
        frames = [
            [pose for pose in people if (pose[:, 2] > 0).any() and is_musician(frame, _box(pose))]
            for frame, people in enumerate(frames)
        ]
    has_body = any((pose[COMPARED, 2] > 0).any() for people in frames for pose in people)
    return keypoints.followed_person(frames, COMPARED if has_body else slice(None))


def _box(pose: FloatArray) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a person's detected points."""
    places = pose[pose[:, 2] > 0, :2]
    return (*map(float, places.min(axis=0)), *map(float, places.max(axis=0)))  # type: ignore[return-value]


def _unmirrored(points: FloatArray, about: Mapping[str, Any], mirrored: bool, width: float) -> FloatArray:
    """(T, 52, 3) points as they are, or of a mirrored picture turned back, with left and right exchanged.

    The picture's width is that of "size" in `about`, else `width`; from another one the points are shifted as a whole.
    """
    if not mirrored:
        return points
    if about.get("size") is not None:
        width = checked_size(about["size"])[0]
    turned = points[:, mirrored_names()]
    turned[..., 0] = np.where(turned[..., 2] > 0, width - turned[..., 0], 0.0)
    return turned


def _check_alike(files: Sequence[Path], sources: Sequence[_Source]) -> None:
    """ValueError unless all sources have as many frames, and one unit."""
    for file, source in zip(files, sources, strict=True):
        if len(source.points) != len(sources[0].points):
            counts = f"{len(source.points)} frames, {files[0].name} {len(sources[0].points)}"
            raise ValueError(f"{file}: has {counts}; points are merged of files of one video")
        if source.is_pixels != sources[0].is_pixels:
            raise ValueError(f'{file}: has another unit than {files[0].name}: write "size" into MediaPipe\'s file')
