"""Key points of pose estimators to Motion: COCO-17, OpenPose and MediaPipe, from JSON, from arrays, from a folder.

A row of `LAYOUTS` is the way in which one estimator writes people into JSON; the content of a file decides which row it
is. Frames that are not named, between the first and the last, are empty.

MediaPipe's landmarks of one body are objects, not files: save a list of frames, or
``{"fps": 30.0, "aspect": 1.5, "world": false, "frames": [...]}``. A frame is a list of 33
``{"x", "y", "z", "visibility"}`` (or ``{"frame": 12, "landmarks": [...]}``), or null or an empty list where the picture
is empty. Where all frames have a number, those that are left out are empty; where they are every second, third, ...,
they were not looked at, and the frame rate is lower. So it is with COCO's.

A joint that an estimator did not see (confidence 0) is filled in by a straight line in time, as seen from the middle of
the body; a frame in which more than two fifths of the joints are hidden is marked not valid, and so is one without
anybody. A joint that is never seen is an error: leave it out (`joints=("left_wrist", ...)`). Joints that MediaPipe
only guesses are kept; frames whose mean visibility is below 0.5 are marked not valid.

Of several people in a frame, of those at least half as confident as the best, the dancer is the one nearest to the
dancer of the frame before; in the first frame the most confident.
"""

import itertools
import json
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab import files
from harmolab.body.skeletons import Skeleton, joint_indices, skeleton_part
from harmolab.readers.arrays import SAVING, check_finite, check_joints, checked_motion, has_body, number_array
from harmolab.types import BoolArray, FloatArray, Motion, bridged

# JSON: layouts of many people, and MediaPipe's landmarks of one body


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

# Lifts of a picture into space (VideoPose3D, MotionBERT) write Human3.6M's 17, those of a picture COCO's.
HUMAN36M_17 = Skeleton(
    (
        *("pelvis", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle", "spine", "thorax"),
        *("neck", "head", "left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"),
    ),
    (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 9, 8, 11, 12, 8, 14, 15),
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

SAVING_POINTS = (
    "save x, y, confidence as an array (T, 17, 3), or MediaPipe's x, y, z, visibility (T, 33, 4): "
    "numpy.save('dance.npy', points)"
)
WHOLE_BODIES = (26, 133, 136)  # points of Halpe and COCO-WholeBody, COCO's 17 first
FACES_AND_HANDS = WHOLE_BODIES[1:]  # those of which most are of the face and of the fingers
POSE_LISTS = ("pose_landmarks", "poseLandmarks", "landmarks")  # keys of a body's landmarks in a frame
_FRAME_KEYS = {*("frame", "frame_id", "frame_idx", "frame_index", "frame_num", "frame_number"), "frameId", "frameIndex"}
MAX_FRAMES = 432_000  # four hours at 30 frames per second
SPARSE = 20  # frames for each entry, on average; above, these are no frames of one video


def check_frames(count: int) -> None:
    """ValueError for more than `MAX_FRAMES` frames."""
    if count > MAX_FRAMES:
        raise ValueError(f"has {count} frames, more than the {MAX_FRAMES} allowed; cut it into parts")


def named_skeleton(count: int) -> Skeleton | None:
    """The pose skeleton with `count` joints: 17 COCO, 18 and 25 OpenPose; None for other counts."""
    return {17: COCO_17, 18: OPENPOSE_18, 25: OPENPOSE_25}.get(count)


def body_order(points: NDArray[Any]) -> Skeleton | None:
    """COCO's or Human3.6M's skeleton of places (T, 17, 2 or 3), seen from any side, any way up; None if neither fits.

    COCO's first five are a head, small beside the body. Human3.6M's spine is half way from the pelvis to the thorax,
    and the thorax half way from shoulder to shoulder.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        head, size = (_median_length(part.std(axis=1)) for part in (points[:, :5], points))
        middles = ((7, (0, 8)), (8, (11, 14)))
        offs = [_median_length(points[:, middle] - points[:, ends].mean(axis=1)) for middle, ends in middles]
    if not head > _HEAD * size:
        return COCO_17
    return HUMAN36M_17 if max(offs) < _MIDDLE * size else None


def picture_order(values: NDArray[Any]) -> Skeleton | None:
    """`body_order` of 17 points of a picture, as `keypoints_motion` takes them, by the frames that show all of them."""
    places = _with_joints(values)[..., :2]
    return body_order(places[~_unseen(places).any(axis=1)])


def _median_length(ways: FloatArray) -> float:
    """Median length of vectors (T, D); 0 where there is none."""
    return float(np.median(np.linalg.norm(ways, axis=1))) if len(ways) else 0.0


def json_or_lines(path: Path) -> Any:
    """The content of a JSON file, or the list of contents of a file with one JSON object a line."""
    text = files.read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        # What goes on behind a whole object in a new line: one object a line.
        if not error.msg.startswith("Extra data") or not text.lstrip().startswith("{"):
            raise
        return [json.loads(line) for line in text.splitlines() if line.strip()]


def people_by_frame(content: Any, pose: Pose | None = None) -> list[list[FloatArray]]:
    """The people in every frame to the last that is named, each (J, 3) x, y, confidence.

    Estimators leave out frames in which they see no person, so a number above 1 of the first is that of empty frames
    before it. Where these would be more than all that are named, the frames are part of a longer video, and the first
    that is named is the first.

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
            f"nor COCO-17 key points (entries with image_id and keypoints); of others {SAVING_POINTS}"
        )
    people: dict[int, list[FloatArray]] = {}
    for place, entry in enumerate(entries):
        poses = entry_poses(entry, layout, f"entry {place}", pose)
        people.setdefault(_frame_number(entry.get(layout.frame, place), place), []).extend(poses)
    return [poses or [] for poses in _by_number(people)]


def _by_number(frames: Mapping[int, Any]) -> list[Any]:
    """Frames in the order of their numbers, None for each that is left out; ValueError where most of them are."""
    first, last = min(frames), max(frames)
    if last - first + 1 > min(MAX_FRAMES, SPARSE * len(frames)):
        raise ValueError(
            f"names {len(frames)} frames between {first} and {last}: these are no frames of one video; "
            "name each image by its frame number"
        )
    if 1 < first <= len(frames):
        first = 0
    return [frames.get(number) for number in range(first, last + 1)]


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
        raise ValueError(f"{name} has no list {layout.people!r}, as {layout.name} writes; of others {SAVING_POINTS}")
    return [(pose or _body)(person, layout, f"{layout.points} of {name}") for person in people]


def _body(person: Any, layout: Layout, name: str) -> FloatArray:
    """(J, 3) x, y, confidence of one person's body, with which the whole body's points begin."""
    counts, person = [len(skeleton.joints) for skeleton in layout.skeletons], person if isinstance(person, dict) else {}
    values = person.get(layout.points)
    length = len(values) if isinstance(values, list) and COCO_17 in layout.skeletons else 0
    wider = [count for count in WHOLE_BODIES if length in (count, 3 * count)]
    return point_array(person, layout.points, wider or counts, layout.name, name)[: max(counts)]


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
    points = next(filter(None, map(_pose_landmarks, frames)), None)
    landmark = points[0] if isinstance(points, list) else None
    return not any(frames) or (isinstance(landmark, dict) and "x" in landmark)


def landmark_frames(content: Any) -> list[Any]:
    """The frames of landmarks; where each has a number, as in "frame", in their order, and None for those left out."""
    frames = content["frames"] if isinstance(content, dict) else content
    numbered = {_own_number(frame): frame for frame in frames}
    if -1 not in numbered:
        if len(numbered) < len(frames):
            raise ValueError("names a frame twice; one body in each is read")
        frames = _by_number(numbered)
    check_frames(len(frames))
    return frames


def _own_number(frame: Any) -> int:
    """The number that a frame has under one of `_FRAME_KEYS`; -1 without one."""
    fields = frame.items() if isinstance(frame, dict) else ()
    return next((value for key, value in fields if key in _FRAME_KEYS and isinstance(value, int)), -1)


def _pose_landmarks(frame: Any) -> Any:
    """The landmarks of a frame's body, also as MediaPipe's Tasks have them, in a list of bodies with one in it."""
    points: Any = next((frame[key] for key in POSE_LISTS if key in frame), None) if isinstance(frame, dict) else frame
    is_list = isinstance(points, list) and len(points) == 1 and isinstance(points[0], list)
    return points[0] if is_list else points


def landmarks_by_frame(content: Any) -> FloatArray:
    """(T, 33, 4) x, y, z and visibility, NaN in empty frames, of content that `is_landmarks`."""
    frames = enumerate(landmark_frames(content))
    return np.stack([landmark_array(_pose_landmarks(frame), f"frame {number}") for number, frame in frames])


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


# Motion from key points; one dancer of several people

MOST_JOINTS_HIDDEN = 0.4  # share of the joints of a picture; it does not count where more are
SEEN = 0.5  # mean visibility of landmarks below which a frame does not count
_PERSON_BYTES = 64 * 2**20
_LANDMARKS = len(MEDIAPIPE_33.joints)
_ENOUGH = 10  # bodies at a regular step, before frames between them count as not looked at
PIXELS = 20.0  # units over which bodies in a picture extend, and none in metres
_ORIGIN = 0.01  # metres, or share of a picture
_IN_PICTURE = 0.9  # share of the landmarks
BAILANDO_END = "_kps.json"
# Shares of the spread of all joints. In recorded dances, seen from all sides and from 60 degrees above, COCO's head is
# 0.22 wide at most and Human3.6M's hips and leg 0.34 or more; its spine and thorax lie 0.32 off the middles at most.
_HEAD, _MIDDLE = 0.3, 0.35
# Some estimators go a little beyond 1; RTMPose and RTMW write logits, to which nothing sets a bound. Over a whole dance
# no body is as thin as the latter, in any unit in which it is as large as pixels are.
_MOST_CONFIDENCE, _MOST_LOGIT = 2.0, 15.0
FRAME_ENDS = ("_keypoints.json", BAILANDO_END)  # of the names of files of one frame


def content_points(content: Any) -> tuple[NDArray[Any], dict[str, Any]]:
    """The key points of a JSON file's content, and what it says about them."""
    if is_landmarks(content):
        return landmarks_by_frame(content), content if isinstance(content, dict) else {}
    return followed_person(people_by_frame(content)), {}


def described_motion(values: NDArray[Any], about: Mapping[str, Any], *, joints: Sequence[str] | None = None) -> Motion:
    """The motion of key points by what is known about them: "fps", and of landmarks "world" and "aspect"."""
    if (rate := about.get("fps")) is None:
        raise files.MissingFrameRate("holds key points but no frame rate; pass fps, such as --fps 25")
    is_world = about.get("world")
    if not isinstance(is_world, bool | None):
        raise ValueError(f"world must be true or false, got {str(is_world)[:30]!r}")
    ratio, frames = float(about.get("aspect", 1.0)), looked_at(values)
    points = values[frames] if values.ndim else values
    return keypoints_motion(points, float(rate) / frames.step, joints=joints, world=is_world, aspect=ratio)


def looked_at(values: NDArray[Any]) -> slice:
    """The frames of key points (T, ...) that were looked at: where bodies lie at a regular step, none between.

    A few bodies may lie so by chance. The first looked at is frame 0, or 1 where frames are counted from 1 on.
    """
    axes = tuple(range(1, values.ndim))
    bodies = np.flatnonzero(values.any(axis=axes) & ~np.isnan(values).all(axis=axes))
    step = int(np.gcd.reduce(np.diff(bodies))) if len(bodies) >= _ENOUGH else 1
    first = int(bodies[0]) % step if step > 1 else 0
    return slice(first, None, step) if first < 2 else slice(0, None, 1)


def keypoints_motion(
    values: np.ndarray, fps: Any, *, joints: Sequence[str] | None = None, world: bool | None = None, aspect: float = 1.0
) -> Motion:
    """A Motion from an array of key points; gaps are filled and marked.

    Parameters
    ----------
    values : (T, J, 2), (T, J, 3) or flat (T, 2J), (T, 3J) array; x, y and perhaps confidence
        Or MediaPipe's landmarks, (T, 33, 3) or (T, 33, 4) x, y, z and visibility, NaN in frames without anybody.
    fps : float, frames per second
    joints : names to keep, optional
    world : bool or None
        World landmarks (metres from the hips, so travel is lost): 3-D, y up. Else image landmarks: 2-D, x and y as
        shares of the picture's width and height. None: world landmarks where the hips stay at the origin.
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
    count = points.shape[1]
    order = picture_order(points) if count == len(COCO_17.joints) else None
    skeleton = MEDIAPIPE_33 if are_landmarks else order or named_skeleton(count) or Skeleton.unnamed(count)
    keep = joint_indices(skeleton, skeleton.joints if joints is None else joints)
    part = skeleton_part(skeleton, keep)
    if are_landmarks:
        if not (np.isfinite(aspect) and 0.1 <= aspect <= 10):
            raise ValueError(f"aspect is width over height and must lie between 0.1 and 10, got {aspect}")
        is_world = are_world_landmarks(points) if world is None else world
        scale = np.array([1.0, -1.0, -1.0] if is_world else [aspect, 1.0])
        places, valid = _seen_landmarks(points)
        return checked_motion(places[:, keep, : scale.size] * scale, fps, part, valid)
    points = points[:, keep]
    visible = np.ones(points.shape[:2], dtype=bool) if points.shape[2] == 2 else np.asarray(points[..., 2] > 0)
    visible &= ~_unseen(points[..., :2])
    places, valid = filled_body(points[..., :2], visible, part)
    return checked_motion(places, fps, part, valid)


def are_confidences(points: NDArray[Any]) -> bool:
    """True where the third numbers of points (T, J, 3) may be a confidence: beside pixels it may be larger."""
    most = _MOST_LOGIT if np.median(np.ptp(points[..., :2], axis=1)) > PIXELS else _MOST_CONFIDENCE
    return bool(((points[..., 2] >= 0) & (points[..., 2] <= most)).all())


def _unseen(places: NDArray[Any]) -> BoolArray:
    """(T, J) True for joints of a picture (T, J, 2) that were not seen: at (-1, -1), as DWPose writes, or at (0, 0).

    Ultralytics writes the latter; not for a joint whose other places are as near to that corner as half the body is
    large, or that is always there. Nothing is unseen where other places are negative: these count from the middle.
    """
    unseen, corner = ((places == place).all(axis=2) for place in (-1, 0))
    if not (unseen | corner).any() or (places[~unseen] < 0).any():
        return np.zeros_like(corner)
    places = np.where((unseen | corner)[..., None], np.nan, places)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a frame, or a joint, of which nothing was seen
        size = np.nanmedian((np.nanmax(places, axis=1) - np.nanmin(places, axis=1)).max(axis=1))
        usual = np.linalg.norm(np.nanmedian(places, axis=0), axis=1)
    return np.asarray(unseen | (corner & (usual > size / 2)))


def are_world_landmarks(landmarks: NDArray[Any]) -> bool:
    """True for MediaPipe's landmarks (T, 33, 3 or 4) in metres: y points down, and the hips stay at the origin."""
    bodies, hips = _bodies_and_hips(landmarks)
    noses = bodies[:, MEDIAPIPE_33.joints.index("nose"), 1]
    at_origin = len(bodies) and np.median(np.abs(hips[:, :2]).max(axis=1)) < _ORIGIN
    return bool(at_origin and np.median(noses) < -_ORIGIN)


def are_image_landmarks(landmarks: NDArray[Any]) -> bool:
    """True for those in a picture: nearly all x and y are shares of it, and z, a depth, is counted from the hips."""
    bodies, hips = _bodies_and_hips(landmarks)
    inside = (bodies[..., :2] >= 0) & (bodies[..., :2] <= 1)
    return bool(len(bodies) and inside.mean() > _IN_PICTURE and np.median(np.abs(hips[:, 2])) < _ORIGIN)


def _bodies_and_hips(landmarks: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The frames of landmarks (T, 33, 3 or 4) that show a body, and the middles of their hips; none of other arrays."""
    if landmarks.ndim != 3 or landmarks.shape[1] != _LANDMARKS or landmarks.shape[2] not in (3, 4):
        landmarks = np.empty((0, _LANDMARKS, 3))
    bodies = landmarks[~np.isnan(landmarks).any(axis=(1, 2)) & landmarks[..., :2].any(axis=(1, 2))]
    return bodies, bodies[:, joint_indices(MEDIAPIPE_33, ("left_hip", "right_hip")), :3].mean(axis=1)


def _with_joints(values: NDArray[Any]) -> NDArray[Any]:
    """(T, J, 2 or 3) from flat or full key points; of a body with face and hands, COCO's 17."""
    flat = {joints * size: size for joints in (17, 18, 25) for size in (2, 3)}
    if values.ndim == 2 and values.shape[1] in flat:
        points = values.reshape(len(values), -1, flat[values.shape[1]])
        if points.shape[2] == 3 and not are_confidences(points):
            count = points.shape[1]
            raise ValueError(f"has {3 * count} columns, each third no confidence; joints in space are (T, {count}, 3)")
        return points
    if values.ndim == 3 and values.shape[2] in (2, 3):
        return values[:, : len(COCO_17.joints)] if values.shape[1] in FACES_AND_HANDS else values
    raise ValueError(
        f"has shape {values.shape}; key points come as (T, J, 2), (T, J, 3), or flat with 17, 18 or 25 joints; "
        f"of others {SAVING}"
    )


def _seen_landmarks(values: NDArray[Any]) -> tuple[FloatArray, BoolArray]:
    """Places (T, 33, 3), filled in where the frame is empty, and the frames (T,) in which the body was."""
    empty = np.isnan(values).all(axis=(1, 2))
    if empty.all():
        raise ValueError(f"nobody is seen in any of its {len(values)} frames")
    valid = np.nan_to_num(values[..., 3].mean(axis=1)) >= SEEN if values.shape[2] == 4 else ~empty
    return bridged(values[..., :3].astype(np.float64), ~empty), valid & ~empty


def filled_body(points: NDArray[Any], visible: BoolArray, skeleton: Skeleton) -> tuple[FloatArray, BoolArray]:
    """`filled_points` as seen from the middle of the body, and the frames (T,) that show three fifths of the joints.

    A hidden joint goes along with the body: an ear may be hidden through half of a dance.
    """
    middle = filled_points(points, visible, skeleton).mean(axis=1, keepdims=True)
    valid = np.asarray(visible.mean(axis=1) >= 1 - MOST_JOINTS_HIDDEN)
    return np.where(visible[..., None], points, filled_points(points - middle, visible, skeleton) + middle), valid


def filled_joints(joints: NDArray[Any]) -> tuple[FloatArray, BoolArray]:
    """`filled_body` of joints in space (T, J, 3): those that are 0 were lost.

    Not so a joint that is 0 most of the time, or near there before and after, as a path that begins at the origin.
    ValueError names the first frame and joint with NaN or infinity.
    """
    check_finite(joints, skeleton := Skeleton.unnamed(joints.shape[1]))
    lost = (joints == 0).all(axis=2)
    if not (lost.any() and np.abs(joints).max() < 1e15):  # what is out of all bounds is refused later
        return joints, np.ones(len(joints), bool)
    is_empty = ~has_body(joints)[:, None]
    lost &= (lost.mean(axis=0) <= 0.5) | is_empty
    places, valid = filled_body(joints, ~lost, skeleton)
    is_near = np.linalg.norm(places, axis=2) < np.median(np.ptp(places, axis=1).max(axis=1)) / 8
    return np.where((is_near & ~is_empty)[..., None], joints, places), valid


def filled_points(points: NDArray[Any], visible: BoolArray, skeleton: Skeleton) -> FloatArray:
    """`points` (T, J, D) with straight lines where a joint was not `visible` (T, J); held at the ends.

    ValueError names the joints that never were.
    """
    hidden = [name for joint, name in enumerate(skeleton.joints) if not visible[:, joint].any()]
    if hidden:
        others = ",".join(name for name in skeleton.joints if name not in hidden)
        hint = f"; keep the other joints only (--joints {others}; in Python joints=[...])" if others else ""
        raise ValueError(f"never shows {', '.join(hidden)}{hint}")
    filled = points.astype(np.float64)
    for joint in np.flatnonzero(~visible.all(axis=0)):
        filled[:, joint] = bridged(filled[:, joint], visible[:, joint])
    return filled


def people_in_frames(paths: Iterable[Path], pose: Pose | None = None) -> list[list[FloatArray]]:
    """The people in each of OpenPose's files of a frame; `pose` as in `layouts.people_by_frame`."""
    frames = []
    for path in paths:
        with files.reading(path, "an OpenPose frame", max_bytes=_PERSON_BYTES):
            frames.append(entry_poses(files.read_json(path), OPENPOSE, "frame", pose))
    return frames


def frame_files(folder: Path) -> list[Path]:
    """The JSON files of OpenPose's folder by frame number; ValueError where a number is missing or there twice."""
    digits = {file: re.findall(r"\d+", file.stem.removesuffix("_keypoints")) for file in folder.glob("*.json")}
    numbered = sorted((int(numbers[-1][-18:]), file) for file, numbers in digits.items() if numbers)
    if not numbered:
        raise ValueError(
            f"{folder}: holds no motion: neither motion.npz nor skeletons.json, nor numbered JSON files as OpenPose "
            f"writes them (name_000000000000.json); of YOLO's texts {SAVING_POINTS}"
        )
    for (number, file), (following, other) in itertools.pairwise(numbered):
        if following == number:
            raise ValueError(f"{folder}: has two files for frame {number}: {file.name} and {other.name}")
        if following > number + 1:
            raise ValueError(
                f"{folder}: frame {number + 1} is missing between {numbered[0][0]} and {numbered[-1][0]}; add it, or "
                "number the files without gaps and pass the rate that is left (--fps)"
            )
    return [file for _, file in numbered]


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
