"""The body in a video: key points of one dancer, found by MediaPipe in an environment and a process of its own.

Pictures go to a process that finds bodies in them (`harmolab.readers.pose_child`), and landmarks come back. Nothing
that comes back is trusted: every answer has a fixed length, its numbers are checked, and a process that falls silent is
stopped. Pictures are sent by a thread, so that one is decoded while a body is found in the one before.

The environment is MediaPipe and a numpy of its own, in a folder of the cache, made once. MediaPipe's wheel holds its
models, and asks for numpy 1, which does not fit into one process with ours. So its packages go into a folder that
another process of the same Python reads. Afterwards nothing needs a network. Nothing is fetched unasked:
`make_pose_environment` is called by `harmolab data pose` alone, after a yes.

``HARMOLAB_POSE=off`` turns pose estimation off, whether the environment is there or not.

MediaPipe's world landmarks are metres from the middle of the hips, here with y up: the shape of the body, and not its
way over the floor. Its own smoothing delays and is off; a median of three pictures takes out single wrong ones.

MediaPipe follows one person. Once a second she is painted over, and another one is looked for; where there often is
one, a second reading follows her, and so on. The dancer is the one whose shape moves most.

What was read is kept in the cache under the content of the video, so that the next command need not look again.
"""

import hashlib
import itertools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from queue import Queue
from typing import IO, Any, NamedTuple

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from harmolab import files
from harmolab.body.skeletons import joint_indices, skeleton_part
from harmolab.readers.keypoints import MEDIAPIPE_33, MOST_JOINTS_HIDDEN
from harmolab.readers.pose_child import HEADER, LANDMARKS, MARGIN, READY, painted_over
from harmolab.readers.video import VideoFrames, frame_count, video_frames
from harmolab.shape_speed import shape_speed
from harmolab.types import BoolArray, FloatArray, Motion, SingleArray, bridged

# The process that finds bodies: pictures to it, landmarks back

CHILD = Path(__file__).with_name("pose_child.py")
BEGIN_SECONDS = 120.0  # that the process may take to load its models
SILENT_SECONDS = 60.0  # until the next answer
VALUES = 6  # x, y; world x, y, z; visibility
WHO = "the process that finds bodies"
FARTHEST = 20.0  # metres or pictures: no point of a body lies so far from the middle

Landmarks = SingleArray  # (33, 6), NaN where nobody is


class Picture(NamedTuple):
    """RGB pixels (H, W, 3), and whether others than the person who is followed are looked for."""

    pixels: NDArray[np.uint8]
    is_looked_at: bool = False


def child_command(folder: Path) -> list[str]:
    """The command that starts the process, without anything of this one's packages in it."""
    return [sys.executable, "-I", "-S", str(CHILD), str(folder)]


def check_child(folder: Path) -> None:
    """ValueError unless the process of an environment starts and says that it is ready."""
    for _ in found_people([], child_command(folder)):
        pass


def found_people(
    pictures: Iterable[Picture], command: Sequence[str], *, seconds: float = SILENT_SECONDS
) -> Iterator[tuple[Landmarks, Landmarks | None]]:
    """For each picture the landmarks of one person followed, and of another one where others were looked for.

    Parameters
    ----------
    pictures : iterable of Picture
    command : what starts the process
    seconds : float, until a process that does not answer is stopped

    Raises
    ------
    ValueError
        The process ends early, falls silent or answers nonsense; and what `pictures` raises.
    """
    sent: Queue[bool | None] = Queue()  # of each picture that comes, whether others are looked for in it
    with ThreadPoolExecutor() as threads, tempfile.TemporaryFile() as words, _process(command, words) as process:
        answers = _Answers(process, threads, words)
        if answers.read(len(READY), BEGIN_SECONDS) != READY:
            raise ValueError(f"{WHO} answers nonsense at its begin")
        sending = threads.submit(_send, process.stdin, pictures, sent)
        while (is_looked_at := sent.get()) is not None:
            yield answers.landmarks(seconds), answers.landmarks(seconds) if is_looked_at else None
        sending.result()
        if answers.next_bytes(1, seconds):
            raise ValueError(f"{WHO} says more than it was asked")


@contextmanager
def _process(command: Sequence[str], words: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """The process, which ends with the block."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError, ValueError):
                pipe.close()  # type: ignore[union-attr]  # both are pipes


def _send(pipe: Any, pictures: Iterable[Picture], sent: Queue[bool | None]) -> None:
    """Write all pictures to the process, then close the pipe."""
    try:
        for pixels, is_looked_at in pictures:
            sent.put(is_looked_at)
            pipe.write(HEADER.pack(*pixels.shape[:2], is_looked_at) + np.ascontiguousarray(pixels).tobytes())
            pipe.flush()
        pipe.close()
    finally:
        sent.put(None)


@dataclass(frozen=True, eq=False)
class _Answers:
    """The answers of a process, checked."""

    process: subprocess.Popen[bytes]
    threads: ThreadPoolExecutor
    words: IO[bytes]

    def next_bytes(self, size: int, seconds: float) -> bytes:
        """The next bytes, fewer at the end; a process that is silent for so many seconds is stopped: ValueError."""
        pipe: Any = self.process.stdout
        try:
            return bytes(self.threads.submit(pipe.read, size).result(seconds))
        except TimeoutError:
            self.process.kill()
            raise ValueError(f"{WHO} gave no answer for {seconds:g} s and was stopped") from None

    def read(self, size: int, seconds: float) -> bytes:
        """The next bytes; ValueError where there are fewer."""
        content = self.next_bytes(size, seconds)
        if len(content) < size:
            raise ValueError(f"{WHO} ended early (code {self.process.wait()}): {self._last_words()}")
        return content

    def landmarks(self, seconds: float) -> Landmarks:
        """The next person: all of her points, or none."""
        points = np.frombuffer(self.read(LANDMARKS * VALUES * 4, seconds), np.float32).reshape(LANDMARKS, VALUES)
        is_missing = np.isnan(points)
        if is_missing.all():
            return points
        if is_missing.any() or np.abs(points).max() > FARTHEST:
            raise ValueError(f"{WHO} answers nonsense: points that are no body's")
        return points

    def _last_words(self) -> str:
        self.words.seek(max(self.words.seek(0, os.SEEK_END) - 4096, 0))
        lines = [line for line in self.words.read().decode("utf-8", "replace").splitlines() if line.strip()]
        return " ".join(lines[-1].split())[:200] if lines else "it said nothing"


# The environment of pose estimation

MEDIAPIPE = "0.10.21"  # the last whose wheel holds the models that it runs without a network
# With what of its needs is used: not OpenCV, matplotlib, JAX and sound, half a gigabyte for drawing and training.
PACKAGES = (f"mediapipe=={MEDIAPIPE}", "numpy>=1.26,<2", "protobuf>=4.25.3,<5", "absl-py", "attrs", "flatbuffers")
OLDEST, NEWEST = (3, 9), (3, 12)  # Python versions that there are wheels for
DOWNLOADED, ON_DISK = 55, 155  # megabytes, measured on Linux
PIP = (sys.executable, "-P", "-m", "pip")
SWITCH = "HARMOLAB_POSE"
NAME = "pose_mediapipe"


def pose_folder() -> Path:
    """The folder of the environment for this Python, be it there or not.

    Raises
    ------
    ValueError
        Nothing is kept on this machine (``HARMOLAB_CACHE=off``).
    """
    cache = files.cache_folder()
    if cache is None:
        raise ValueError("HARMOLAB_CACHE is off, so there is no place for MediaPipe; set it to a folder")
    return cache / f"{NAME}_{MEDIAPIPE}_{sys.implementation.cache_tag}"


def pose_environment() -> Path | None:
    """The folder of the environment; None where it is not there, or turned off."""
    if is_off() or files.cache_folder() is None:
        return None
    folder = pose_folder()
    return folder if folder.is_dir() else None


def is_off() -> bool:
    """True where ``HARMOLAB_POSE`` is "off"."""
    return os.environ.get(SWITCH) == "off"


def hindrance() -> str:
    """The reason why the environment cannot be made here, without a full stop; "" without one."""
    if is_off():
        return f"{SWITCH} is off"
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        versions = " to ".join(".".join(map(str, version)) for version in (OLDEST, NEWEST))
        own = ".".join(map(str, sys.version_info[:2]))
        return f"MediaPipe {MEDIAPIPE} runs in Python {versions}, and this is {own}"
    if files.cache_folder() is None:
        return "HARMOLAB_CACHE is off, so there is no place for MediaPipe"
    return ""


def make_pose_environment(*, pip: Sequence[str] = PIP) -> Path:
    """Fetch MediaPipe into its folder, whole or not at all; the folder. One that is there is left as it is.

    Processes that ask at the same time wait for the first. What a killed one left is removed by the next.

    Parameters
    ----------
    pip : the command that installs

    Raises
    ------
    ValueError
        Why it cannot be made here; or pip's last words, or those of MediaPipe, where it does not run.
    OSError
        The folder cannot be written.
    """
    if reason := hindrance():
        raise ValueError(f"{reason}; the movement of a video is read from the flow of its picture instead")
    if find_spec("pip") is None and pip is PIP:
        raise ValueError(f"pip is not there to fetch MediaPipe with; {sys.executable} -m ensurepip brings it")
    folder = pose_folder()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder.parent / f".{folder.name}.lock"):
        for leftover in folder.parent.glob(f"{files.UNFINISHED}{folder.name}_*"):
            shutil.rmtree(leftover, ignore_errors=True)
        if not folder.is_dir():
            with files.atomic_folder(folder) as part:
                _install(part, pip)
                check_child(part)
    return folder


def _install(part: Path, pip: Sequence[str]) -> None:
    """Put the packages into a folder; ValueError with pip's last words where it fails."""
    options = ("--no-deps", "--only-binary", ":all:", "--quiet", "--no-input", "--disable-pip-version-check")
    command = [*pip, "install", *options, "--target", str(part), *PACKAGES]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode:
        lines = [line for line in done.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        raise ValueError(
            f"MediaPipe could not be fetched; is there a network? pip says: {errors[-1][:300] if errors else 'nothing'}"
        )


# The dancer of a video

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


def read_pose(
    path: files.PathLike, *, command: Sequence[str] | None = None, progress: files.Progress = files.silent
) -> PoseReading:
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
    with files.named_faults(path):
        if (people := _kept_people(name)) is None:
            people = _followed_people(video, stride, command or _command(), progress)
            _keep(name, people)
        return _dancer(people, video.fps / stride)


def _command() -> list[str]:
    if (folder := pose_environment()) is None:
        raise ValueError("there is no MediaPipe to find a body with; `harmolab data pose --install` fetches it")
    return child_command(folder)


# One person, and others


def _followed_people(
    video: VideoFrames, stride: int, command: Sequence[str], progress: files.Progress
) -> list[SingleArray]:
    """The landmarks (T, 33, 6) of each person, the one first whom MediaPipe finds first; NaN where she is not found."""
    people: list[SingleArray] = []
    total = frame_count(video) // stride
    while len(people) < MOST_PEOPLE:
        label = f"finding body {len(people) + 1}" if people else "finding the body"
        answers = files.Counted(found_people(_pictures(video, stride, people), command), total)
        followed = list(progress(answers, label))
        person = np.stack([one for one, _ in followed])
        looks = [other for _, other in followed if other is not None]
        people.append(person)
        if not _is_found(person) or np.mean([_is_somebody(other) for other in looks] or [False]) < OFTEN:
            break
    return people


def _pictures(video: VideoFrames, stride: int, people: Sequence[SingleArray]) -> Iterator[Picture]:
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


def _is_found(person: SingleArray) -> bool:
    """True where a person is found in enough of the pictures."""
    return bool(np.isfinite(person[:, 0, 0]).mean() >= FEWEST_FOUND)


# From landmarks to a motion


def _dancer(people: Sequence[SingleArray], fps: float) -> PoseReading:
    """The person whose shape moves most, of those who are found in enough of the pictures.

    Raises
    ------
    ValueError
        No person is, or too little of a body is seen.
    """
    candidates = [person for person in people if _is_found(person)]
    shares = [float(np.isfinite(person[:, 0, 0]).mean()) for person in people]
    if not candidates:
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
    several = f"{len(candidates)} people are in the picture; the one who moves most was taken"
    notes = [several] if len(candidates) > 1 else []
    if fewer := [share for share in shares if OFTEN <= share < FEWEST_FOUND]:
        notes.append(f"another person is found in {max(fewer):.0%} of the pictures only, and was not looked at")
    return replace(dancer, notes=(*notes, *dancer.notes))


def _movement(motion: Motion) -> float:
    """Mean shape speed of the frames that count, metres per second."""
    shape = shape_speed(motion)
    return float(shape.speed[shape.valid].mean()) if shape.valid.any() else 0.0


def body_motion(landmarks: SingleArray, fps: float) -> PoseReading:
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
    places = bridged(points[:, is_kept, :5].astype(np.float64), is_found)
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


def _kept_people(name: str) -> list[SingleArray] | None:
    """The people kept under a name; None where there are none, or the file is damaged."""
    arrays = files.cached_arrays(name)
    people = None if arrays is None else arrays.get("people")
    if people is None or people.dtype != np.float32 or people.ndim != 4 or not 0 < len(people) <= MOST_PEOPLE:
        return None
    if people.shape[1] < 2 or people.shape[2:] != (LANDMARKS, VALUES) or np.isinf(people).any():
        return None
    is_missing = np.isnan(people).all(axis=(2, 3))
    return list(people) if not np.isnan(people[~is_missing]).any() else None


def _keep(name: str, people: Sequence[SingleArray]) -> None:
    """Keep what was read; the oldest readings go where all of them take more than `KEPT_BYTES`."""
    length = min(map(len, people))
    files.keep_arrays(name, {"people": np.stack([person[:length] for person in people])})
    folder = files.cache_folder()
    with suppress(OSError):
        readings = [] if folder is None else sorted(folder.glob("poses_*.npz"), key=lambda file: -file.stat().st_mtime)
        for file, size in zip(readings, itertools.accumulate(file.stat().st_size for file in readings), strict=True):
            if size > KEPT_BYTES and file.name != f"{name}.npz":
                file.unlink(missing_ok=True)
