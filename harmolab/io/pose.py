"""The body in a video: key points of one dancer, found by MediaPipe in an environment of its own.

Its world landmarks are metres from the middle of the hips, here with y up: the shape of the body, and not its way over
the floor. Its own smoothing delays and is off; a median of three pictures takes out single wrong ones.

MediaPipe follows one person. Once a second she is painted over, and another one is looked for; where there often is
one, a second reading follows her, and so on. The dancer is the one whose shape moves most.

What was read is kept in the cache under the content of the video, so that the next command need not look again.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from harmolab.io.files import PathLike, Progress, cache_folder, cached_arrays, keep_arrays, silent
from harmolab.io.keypoints import filled_points
from harmolab.io.layouts import MEDIAPIPE_33
from harmolab.io.pose_child import LANDMARKS, MARGIN, painted_over
from harmolab.io.pose_environment import MEDIAPIPE, pose_environment
from harmolab.io.pose_process import VALUES, Landmarks, Picture, child_command, found_people
from harmolab.io.video import VideoFrames, opened_container, video_frames
from harmolab.shape_speed import shape_speed
from harmolab.skeletons import joint_indices, skeleton_part
from harmolab.types import BoolArray, FloatArray, Motion

BODY = (
    "nose", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip",
    "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_foot_index", "right_foot_index",
)  # fmt: skip
UNREAD = "I could not read your movement well enough: "
HEIGHT = 480  # pixels: finer pictures take longer and find the body no better
MOST_RATE = 40.0  # hertz: of faster videos every second picture is read, every third, ...
MOST_PEOPLE = 3
LOOK = 1.0  # seconds between looks for another person
OFTEN = 0.3  # of the looks that must find somebody, before another person is followed
SEEN = 0.5  # visibility from which a point, or on average another person, counts as seen
SHOWN = 0.3  # share of the pictures in which a joint is seen, below which it is left out
FEWEST_JOINTS = 6
MOST_JOINTS_HIDDEN = 0.4  # share of the joints of a picture that may be hidden
FEWEST_FOUND = 0.5  # share of the pictures in which a body is found
KEPT_BYTES = 200 * 2**20  # of readings in the cache
MEDIAN = 3  # pictures
VERSION = 1  # of what is kept


@dataclass(frozen=True, eq=False)
class PoseReading:
    """The dancer of a video.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres from the middle of the hips, y up; not valid where the body is not seen
    points : Motion, (T, J, 2), the same joints as shares of the picture's width and height
    notes : sentences about what was found, for people
    """

    motion: Motion
    points: Motion
    notes: tuple[str, ...] = ()


def read_pose(path: PathLike, *, command: Sequence[str] | None = None, progress: Progress = silent) -> PoseReading:
    """The movement of the dancer in a video.

    Parameters
    ----------
    path : str or path of a video
    command : what starts the process that finds bodies; that of the environment when left out
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError also where there is no environment, and where no person is found, or not enough
        of a body.
    """
    video = video_frames(path, height=HEIGHT, colour=True)
    name, stride = _kept_name(Path(path)), max(1, int(np.ceil(video.fps / MOST_RATE)))
    try:
        people = _kept_people(name)
        if people is None:
            people = _followed_people(video, stride, command or _command(), progress)
            _keep(name, people)
        return _dancer(people, video.fps / stride)
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


def _command() -> list[str]:
    folder = pose_environment()
    if folder is None:
        raise ValueError("there is no MediaPipe to find a body with; `harmolab pose --install` fetches it")
    return child_command(folder)


# One person, and others


def _followed_people(
    video: VideoFrames, stride: int, command: Sequence[str], progress: Progress
) -> list[NDArray[np.float32]]:
    """The landmarks (T, 33, 6) of each person, the one first whom MediaPipe finds first; NaN where she is not found."""
    people: list[NDArray[np.float32]] = []
    total = _frame_count(video) // stride
    while len(people) < MOST_PEOPLE:
        label = f"finding body {len(people) + 1}" if people else "finding the body"
        answers = _Counted(found_people(_pictures(video, stride, people), command), total)
        followed = list(progress(answers, label))
        if not followed:
            raise ValueError("shows no pictures")
        person = np.stack([one for one, _ in followed])
        looks = [other for _, other in followed if other is not None]
        people.append(person)
        if not _is_found(person) or np.mean([_is_somebody(other) for other in looks] or [False]) < OFTEN:
            break
    return people


def _pictures(video: VideoFrames, stride: int, people: Sequence[NDArray[np.float32]]) -> Iterator[Picture]:
    """The pictures of a video in which these people are painted over; about each second others are looked for."""
    every = max(1, round(LOOK * video.fps / stride))
    for index, pixels in enumerate(itertools.islice(video, 0, None, stride)):
        for person in people:
            if index < len(person):
                pixels = painted_over(pixels, person[index])
        yield Picture(pixels, index % every == every // 2)


def _is_somebody(person: Landmarks) -> bool:
    """True for a body that was found, and is seen."""
    return bool(np.isfinite(person).all() and person[:, 5].mean() >= SEEN)


def _is_found(person: NDArray[np.float32]) -> bool:
    """True where a person is found in enough of the pictures."""
    return bool(np.isfinite(person[:, 0, 0]).mean() >= FEWEST_FOUND)


@dataclass(frozen=True, eq=False)
class _Counted:
    """Items, and about how many there will be."""

    items: Iterable[tuple[Landmarks, Landmarks | None]]
    count: int

    def __iter__(self) -> Iterator[tuple[Landmarks, Landmarks | None]]:
        return iter(self.items)

    def __len__(self) -> int:
        return self.count


def _frame_count(video: VideoFrames) -> int:
    """About how many pictures a video has, by what its file says; 0 where it does not."""
    with opened_container(video.path) as container:
        return max(0, round((container.duration or 0) / 1e6 * video.fps))


# From landmarks to a motion


def _dancer(people: Sequence[NDArray[np.float32]], fps: float) -> PoseReading:
    """The person whose shape moves most, of those who are found in enough of the pictures.

    Raises
    ------
    ValueError
        No person is, or too little of a body is seen.
    """
    candidates = [person for person in people if _is_found(person)]
    if not candidates:
        shares = [float(np.isfinite(person[:, 0, 0]).mean()) for person in people]
        few = f"a person is found in {max(shares):.0%} of the pictures only"
        raise ValueError(UNREAD + (few if max(shares) > 0 else "nobody is found in the picture"))
    readings = []
    faults: list[ValueError] = []
    for person in candidates:
        try:
            readings.append(body_motion(person, fps))
        except ValueError as error:
            faults.append(error)
    if not readings:
        raise faults[0]
    dancer = max(readings, key=lambda reading: _movement(reading.motion))
    if len(candidates) == 1:
        return dancer
    note = f"{len(candidates)} people are in the picture; the one who moves most was taken"
    return replace(dancer, notes=(note, *dancer.notes))


def _movement(motion: Motion) -> float:
    """Mean shape speed of the frames that count, metres per second."""
    shape = shape_speed(motion)
    return float(shape.speed[shape.valid].mean()) if shape.valid.any() else 0.0


def body_motion(landmarks: NDArray[np.float32], fps: float) -> PoseReading:
    """The motion of a body from MediaPipe's landmarks; joints that are hardly ever seen are left out, and named.

    Parameters
    ----------
    landmarks : (T, 33, 6) array: x, y; world x, y, z in metres; visibility. NaN in pictures without the body.
    fps : float, hertz

    Raises
    ------
    ValueError
        Too few joints are seen.
    """
    points = landmarks[:, joint_indices(MEDIAPIPE_33, BODY)]
    is_found: BoolArray = np.asarray(np.isfinite(points).all(axis=(1, 2)))
    is_seen: BoolArray = np.asarray(np.nan_to_num(points[..., 5]) >= SEEN)
    is_kept = is_seen[is_found].mean(axis=0) >= SHOWN if is_found.any() else np.zeros(len(BODY), bool)
    keep = [BODY[joint] for joint in np.flatnonzero(is_kept)]
    if len(keep) < FEWEST_JOINTS:
        raise ValueError(f"{UNREAD}only {len(keep)} of {len(BODY)} joints of the body are seen; film all of it")
    skeleton = skeleton_part(MEDIAPIPE_33, joint_indices(MEDIAPIPE_33, keep))
    columns = np.ones((1, len(keep)), bool)
    places = filled_points(points[:, is_kept, :5], is_found[:, None] & columns, skeleton)
    steady: FloatArray = median_filter(places, (MEDIAN, 1, 1), mode="nearest")
    valid = np.asarray(is_found & (is_seen[:, is_kept].mean(axis=1) >= 1 - MOST_JOINTS_HIDDEN))
    if not valid.any():
        raise ValueError(f"{UNREAD}the body is hidden in every picture")
    hidden = [name.replace("_", " ") for name in BODY if name not in keep]
    notes = [f"a body is seen in {valid.mean():.0%} of the pictures"]
    if hidden:
        notes.append(f"hardly ever seen, and left out: {', '.join(hidden)}")
    in_space = Motion(steady[..., 2:] * np.array([1.0, -1.0, -1.0]), fps, skeleton, valid)
    return PoseReading(in_space, Motion(steady[..., :2], fps, skeleton, valid), tuple(notes))


# What is kept


def _kept_name(path: Path) -> str:
    """Name in the cache, by the content of the video and by all that decides what is read in it."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
    digest.update(f"{VERSION} {MEDIAPIPE} {HEIGHT} {MOST_RATE} {LOOK} {OFTEN} {MARGIN} {MOST_PEOPLE}".encode())
    return f"poses_{digest.hexdigest()[:32]}"


def _kept_people(name: str) -> list[NDArray[np.float32]] | None:
    """The people kept under a name; None where there are none, or the file is damaged."""
    arrays = cached_arrays(name)
    people = None if arrays is None else arrays.get("people")
    if people is None or people.dtype != np.float32 or people.ndim != 4 or not 0 < len(people) <= MOST_PEOPLE:
        return None
    if people.shape[1] < 2 or people.shape[2:] != (LANDMARKS, VALUES) or np.isinf(people).any():
        return None
    is_missing = np.isnan(people).all(axis=(2, 3))
    return list(people) if not np.isnan(people[~is_missing]).any() else None


def _keep(name: str, people: Sequence[NDArray[np.float32]]) -> None:
    """Keep what was read; the oldest readings go where all of them take more than `KEPT_BYTES`."""
    length = min(map(len, people))
    keep_arrays(name, {"people": np.stack([person[:length] for person in people])})
    folder = cache_folder()
    with suppress(OSError):
        files = [] if folder is None else sorted(folder.glob("poses_*.npz"), key=lambda file: -file.stat().st_mtime)
        sizes = itertools.accumulate(file.stat().st_size for file in files)
        for file, size in zip(files, sizes, strict=True):
            if size > KEPT_BYTES and file.name != f"{name}.npz":
                file.unlink(missing_ok=True)
