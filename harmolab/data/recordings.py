"""Folders of recordings on disk, in the layout of Tang et al. (2018) or in ours, one folder a recording, as clips.

==========  ====================================================================
Tang 2018   skeletons.json, config.json, audio.mp3
ours        motion.npz, audio.wav (or .flac, .ogg, .mp3, .m4a)
both        beats.json, optional: beats, bars, dance, units, motion_offset_s
==========  ====================================================================

The dance stands in beats.json or in the folder's name (DANCE_C, _R, _T, _W).

The layout of Tang et al. is one folder with audio, config.json and skeletons.json:

``config.json``
    ``{"start_position", "end_position"}``: the span of the audio that the motion belongs to, in frames at 25 fps.
``skeletons.json``
    ``{"length", "center": (T, 3), "skeletons": (T, 23, 3)}``: 25 fps, centimetres, y up, left-handed; the skeletons
    are relative to the centre.

Properties of these recordings, and how the loader meets them:

* The recordings are spliced from reused units; six steps of a straight line join two units. The six frames that such a
  line leads to are no recorded movement: `Motion.valid` is False there.
* The units were recorded at other places, so the floor climbs and falls by up to half a metre from unit to unit. Each
  unit is set back on the floor by one constant, which changes no speed inside a unit.
* The motion runs 1.0 to 1.5 % fast against the music: `clock=1.013` stretches it. Off by default.
* Most motions are up to 56 frames shorter than the span in config.json. A motion of quite another length belongs to
  another frame rate (a second copy of this corpus is around that has one) and is refused.
"""

import os
import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypedDict, Unpack

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.body.skeletons import Skeleton
from harmolab.files import MAX_JSON_BYTES, SOUNDS, PathLike, named_faults, read_json, reading
from harmolab.readers.arrays import checked_motion, in_metres, number_array
from harmolab.readers.audio import load_audio
from harmolab.readers.beats import BeatAnnotation, load_annotation
from harmolab.readers.motion import load_motion, load_offset, motion_part, read_motion
from harmolab.readers.motion_file import MotionFile, ReadingKeywords
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray, Motion

# Recordings of Tang et al. (2018)

FPS = 25.0

_JOINTS = (
    *("left_head", "right_head", "torso", "left_shoulder", "left_elbow", "left_forearm", "left_hand"),
    *("left_hip", "left_knee", "left_ankle", "left_heel", "left_toe"),
    *("right_shoulder", "right_elbow", "right_wrist", "right_finger"),
    *("right_hip", "right_knee", "right_ankle", "right_heel", "right_toe", "right_forearm", "left_finger"),
)
_PARENTS = (3, 12, -1, 2, 3, 4, 5, 2, 7, 8, 9, 9, 2, 12, 21, 14, 2, 16, 17, 18, 18, 13, 6)

TANG_23 = Skeleton(_JOINTS, _PARENTS)
# The harmony paper's joints are the first 21; its right wrist hangs on the elbow.
PAPER_21 = Skeleton(_JOINTS[:21], tuple(13 if parent == 21 else parent for parent in _PARENTS[:21]))

_DANCES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}

# Positions are rounded to 1e-5 m, so a straight line bends by up to 4e-5 m. A dancer bends more in every frame.
_STRAIGHT_METRES, _MOVING_METRES = 5e-5, 1e-3
# A splice of 6 steps has 5 frames without acceleration; retimed copies have 3 to 8.
_SPLICE_FRAMES = (3, 8)
# Shares of the span in config.json between which a motion's length is believed.
_SPAN_SHARES = (0.9, 1.02)


class SpanFrames(NamedTuple):
    """The span of the audio that was danced, in frames at 25 fps."""

    start: int
    end: int


def dance_of(folder: PathLike) -> str:
    """The dance by the letter in a folder's name (``DANCE_W_12`` is a waltz), or ""."""
    match = re.match(r"DANCE_([A-Z])(_|$)", Path(folder).name)
    return _DANCES.get(match[1], "") if match else ""


def find_audio(folder: PathLike) -> Path:
    """The file audio.wav, .flac, .ogg, .mp3 or .m4a of a folder; FileNotFoundError if there is none."""
    for path in filter(Path.is_file, [Path(folder) / f"audio{suffix}" for suffix in SOUNDS]):
        return path
    raise FileNotFoundError(f"{folder}: has no audio.wav, .flac, .ogg, .mp3 or .m4a")


class SkeletonsKeywords(TypedDict, total=False):
    """Keywords of `load_skeletons`, with its defaults."""

    clock: float
    points: int
    travel: bool
    ground: bool
    splices: bool


def load_danced(folder: Path, **keywords: Unpack[SkeletonsKeywords]) -> tuple[Motion, float]:
    """The motion of one folder and the audio time of its first frame, start_position / 25 fps, in seconds.

    Parameters
    ----------
    folder : Path
    keywords : clock, points, travel, ground, splices; as in `load_skeletons`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. A motion whose length does not fit config.json is an error.
    """
    span = load_config(folder / "config.json")
    motion = load_skeletons(folder / "skeletons.json", **keywords)
    share = motion.n_frames / (span.end - span.start)
    if not _SPAN_SHARES[0] <= share <= _SPAN_SHARES[1]:
        raise ValueError(
            f"{folder / 'skeletons.json'}: has {motion.n_frames} frames, config.json spans {span.end - span.start} at "
            f"25 fps; this copy seems to have another frame rate ({FPS * share:.1f} fps would fit)"
        )
    return motion, span.start / FPS


def load_config(path: PathLike) -> SpanFrames:
    """The danced span in a config.json, in frames at 25 fps."""
    with reading(path, "a config.json", max_bytes=2**20) as file:
        content = read_json(file)
        values = content if isinstance(content, dict) else {}
        start, end = values.get("start_position"), values.get("end_position")
        if not isinstance(start, int) or not isinstance(end, int):
            raise ValueError("needs the whole numbers start_position and end_position (frames at 25 fps)")
        # Ten hours: beyond, these are no frames.
        if not 0 <= start < end <= 36_000 * FPS:
            raise ValueError(f"the motion must end after it starts, got {start} to {end} frames")
        return SpanFrames(start, end)


def load_skeletons(
    path: PathLike,
    *,
    clock: float = 1.0,
    points: int = 23,
    travel: bool = True,
    ground: bool = True,
    splices: bool = False,
) -> Motion:
    """The motion in a skeletons.json: metres, y up, right-handed, splices marked as not valid.

    Parameters
    ----------
    path : str or path
    clock : float
        Time stretch of the motion: 1.013 makes it 1.3 % longer.
    points : 23 or 21
        All joints, or those of the harmony paper (without right forearm and left finger).
    travel : bool
        False: the pose only, without the dancer's way through the room. This is what the harmony paper's numbers were
        computed from.
    ground : bool
        Set every unit back on the floor (y = 0). Without effect if `travel` is False.
    splices : bool
        True: the straight lines that join units count as movement, as they must have in the harmony paper.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    if points not in (21, 23):
        raise ValueError(f"points must be 23 (all) or 21 (the paper's), got {points}")
    if not 0.5 <= clock <= 2.0:
        raise ValueError(f"clock is a time stretch near 1, got {clock}")
    with reading(path, "a skeletons.json", max_bytes=MAX_JSON_BYTES) as file:
        poses, centre = _content(read_json(file))
        world = in_metres(poses + centre[:, None], 0.01)
        first, last = splice_steps(world)
        valid = np.ones(len(world), bool)
        if not splices:
            for before, after in zip(first, last, strict=True):
                valid[before + 1 : after + 1] = False
        positions = world if travel else in_metres(poses, 0.01)
        if travel and ground:
            positions = on_the_floor(world, first, last)
        # Left-handed to right-handed.
        positions = positions * (1.0, 1.0, -1.0)
        return checked_motion(positions[:, :points], FPS / clock, TANG_23 if points == 23 else PAPER_21, valid)


def _content(content: Any) -> tuple[FloatArray, FloatArray]:
    """Poses (T, 23, 3) and centres (T, 3), centimetres."""
    if not isinstance(content, dict) or not {"skeletons", "center"} <= set(content):
        raise ValueError("needs the lists 'skeletons' and 'center'")
    poses = number_array(content["skeletons"], "skeletons", (None, 23, 3))
    centre = number_array(content["center"], "center", (len(poses), 3))
    if content.get("length", len(poses)) != len(poses):
        raise ValueError(f"says length {content['length']!r}, but holds {len(poses)} frames: cut off?")
    for name, values in (("skeletons", poses), ("center", centre)):
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            joint = f", joint {bad[0][1]} ({TANG_23.joints[bad[0][1]]})" if values is poses else ""
            raise ValueError(f"{name} hold NaN or infinity at frame {bad[0][0]}{joint}")
    # A body that is a kilometre long, or that far away, is damaged; sums of such numbers are not safe either.
    if len(poses) and max(np.abs(poses).max(), np.abs(centre).max()) > 1e5:
        raise ValueError("has positions over 1 km; centimetres are expected")
    return poses, centre


def splice_steps(positions: FloatArray) -> tuple[list[int], list[int]]:
    """The last frame before and the first frame after each straight line that joins two units.

    A line shows as three to eight frames in a row in which no joint accelerates although the body moves.

    Parameters
    ----------
    positions : (T, J, 3) array, metres

    Returns
    -------
    two lists of frame indices, equally long; the frames strictly between lie on the line
    """
    if len(positions) < 3:
        return [], []
    straight = np.abs(np.diff(positions, n=2, axis=0)).max(axis=(1, 2)) < _STRAIGHT_METRES
    moving = np.abs(np.diff(positions, axis=0)).max(axis=(1, 2))[1:] > _MOVING_METRES
    shortest, longest = _SPLICE_FRAMES
    runs = [(first, last) for first, last in true_runs(straight & moving) if shortest <= last - first <= longest]
    return [first for first, _ in runs], [last + 1 for _, last in runs]


def true_runs(mask: BoolArray) -> list[tuple[int, int]]:
    """(first, one behind last) index of each run of True in a (T,) mask."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def on_the_floor(positions: FloatArray, first: list[int], last: list[int]) -> FloatArray:
    """`positions` with every unit between splices shifted so that the median of its lowest point is at y = 0.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up
    first, last : frame indices as `splice_steps` gives them; the shift changes along the line between them
    """
    lowest = positions[:, :, 1].min(axis=1)
    starts, ends = [0, *last], [*first, len(positions) - 1]
    frames = np.array([frame for unit in zip(starts, ends, strict=True) for frame in unit])
    floor = [float(np.median(lowest[start : end + 1])) for start, end in zip(starts, ends, strict=True)]
    shift = np.interp(np.arange(len(positions)), frames, np.repeat(floor, 2))
    return positions - shift[:, None, None] * np.array([0.0, 1.0, 0.0])


# Folders of recordings, in either layout

ReadingReport = Callable[[PathLike, MotionFile], object]  # called with a file's path and how it was read
_MAX_DEPTH = 4
_PARTS = ("skeletons.json", "config.json", "motion.npz")
_NO_SOUND = "audio.wav (.flac, .ogg, .mp3, .m4a)"
_OTHER_MOTIONS = (".bvh", ".npz", ".npy", ".pkl", ".c3d")  # to be made a motion.npz


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording: a song and the motion danced to it, read from a folder.

    Parameters
    ----------
    clip : Clip
        With the annotated beats, where there are some.
    annotation : BeatAnnotation or None
        All that the folder's beats.json says (`harmolab.readers.beats`); None without this file.
    folder : Path
    """

    clip: Clip
    annotation: BeatAnnotation | None
    folder: Path


class Problem(NamedTuple):
    """A folder that cannot be used, and the reason in one sentence that names the file."""

    folder: Path
    message: str


ProblemReport = Callable[[Problem], object]  # called with each folder that cannot be read


class RecordingFolders(NamedTuple):
    """Folders that hold a whole recording, in natural order, and those that hold only parts of one."""

    folders: tuple[Path, ...]
    problems: tuple[Problem, ...]


def find_recordings(root: PathLike) -> RecordingFolders:
    """The folders of recordings at or below a folder; nothing is read yet.

    Two layouts are known: that of Tang et al. 2018 (skeletons.json, config.json and audio.mp3), and ours (motion.npz
    and audio.wav, .flac, .ogg, .mp3 or .m4a). In both a file beats.json may stand beside them.

    Returns
    -------
    RecordingFolders
        `folders`: paths of whole recordings. `problems`: folders that hold parts of one only, or that cannot be opened,
        each with its reason.

    Raises
    ------
    FileNotFoundError, ValueError
        If `root` does not exist, or is no folder.
    """
    root = Path(root)
    check_root(root, "sequences")
    closed: list[OSError] = []
    missing = {folder: missing_parts(folder) for folder in _folders_with_parts(root, closed.append)}
    problems = [Problem(folder, _lacks(folder, parts)) for folder, parts in missing.items() if parts]
    problems += [Problem(Path(one.filename), f"{one.filename}: {one.strerror}") for one in closed]
    return RecordingFolders(tuple(folder for folder, parts in missing.items() if not parts), tuple(problems))


def check_root(root: Path, what: str) -> None:
    """FileNotFoundError or ValueError, which name the root, where it is no folder; `what` it should be a folder of."""
    if not root.exists():
        raise FileNotFoundError(f"{root}: no such folder")
    if not root.is_dir():
        raise ValueError(f"{root}: is a file; a folder of {what} is needed")


def _lacks(folder: Path, parts: list[str]) -> str:
    """The sentence that a folder has no such parts, and what makes them of files of other names."""
    files = {path.suffix.lower(): path for path in sorted(folder.glob("*")) if path.is_file()}
    motions, sounds = ([files[end] for end in ends if end in files] for ends in (_OTHER_MOTIONS, SOUNDS))
    cures = ""
    if "motion.npz" in parts and motions:
        paths = shlex.join([str(motions[0]), str(folder / "motion.npz")])
        cures = f"; harmolab data convert {paths} writes it"
    if parts[-1] == _NO_SOUND and sounds:
        cures += f"; rename {sounds[0].name} to audio{sounds[0].suffix.lower()}"
    return f"{folder}: has no {' and no '.join(parts)}{cures}"


def _folders_with_parts(root: Path, closed: Callable[[OSError], object]) -> list[Path]:
    """Folders at or below `root` with a part of a recording, or its sound and another motion; DANCE_2 before _10.

    `closed` is called with the error of each folder that cannot be read.
    """
    folders = []
    for folder, _, files in walk(root, closed, _MAX_DEPTH):
        has_motion = any(Path(file).suffix.lower() in _OTHER_MOTIONS for file in files)
        has_sound = any(f"audio{end}" in files for end in SOUNDS)
        if not set(_PARTS).isdisjoint(files) or (has_motion and has_sound):
            folders.append(folder)
    return sorted(folders, key=natural)


def walk(
    root: Path, closed: Callable[[OSError], object] | None = None, depth: float = np.inf
) -> Iterator[tuple[Path, list[str], list[str]]]:
    """`os.walk` through links as well, those last: no hidden folder, none twice, and none that holds `root`.

    Below a folder that lies `depth` folders deep none is entered, unless a link that is less deep leads there.
    """
    starts, entered, cut = [root], {*root.resolve().parents}, set[Path]()
    for start in starts:
        for name, below, files in os.walk(start, onerror=closed):
            folder, place = Path(name), Path(name).resolve()
            is_done = place in entered and place not in cut
            below[:] = [] if is_done else sorted(child for child in below if not child.startswith("."))
            if place not in entered:
                entered.add(place)
                yield folder, below, files
            if below and len(folder.relative_to(root).parts) >= depth:
                cut.add(place)
                below.clear()
            starts += filter(Path.is_symlink, (folder / child for child in below))


def natural(path: Path) -> list[tuple[int, str]]:
    """A key that sorts numbers in names as numbers."""
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d{1,18})", str(path))]


def missing_parts(folder: PathLike) -> list[str]:
    """The files that a folder lacks to be a recording; empty if it is whole."""
    folder = Path(folder)
    is_own = (folder / "motion.npz").is_file()
    missing = [] if is_own else [part for part in _PARTS[:2] if not (folder / part).is_file()]
    if len(missing) == 2:
        missing = ["motion.npz"]
    has_sound = any((folder / f"audio{end}").is_file() for end in SOUNDS)
    return missing if has_sound else [*missing, _NO_SOUND]


def recorded_files(folder: Path) -> list[Path]:
    """All files that the recording in a folder is read from."""
    return [find_audio(folder), *filter(Path.is_file, (folder / name for name in (*_PARTS, "beats.json")))]


def iter_recordings(root: PathLike) -> Iterator[Recording | Problem]:
    """All recordings at or below a folder, read one by one, so that only one is in memory.

    Yields
    ------
    Recording, or in its place a Problem (`folder`, `message`) for each that cannot be read; these come first where
    files are missing

    Raises
    ------
    FileNotFoundError, ValueError
        As `find_recordings`.
    """
    folders, problems = find_recordings(root)
    yield from problems
    for folder in folders:
        try:
            yield load_recording(folder)
        except (ValueError, FileNotFoundError) as error:
            yield Problem(folder, str(error))


def load_recording(
    folder: PathLike, *, sample_rate: float | None = 22050.0, **keywords: Unpack[SkeletonsKeywords]
) -> Recording:
    """The recording in a folder: its song, its motion, and its annotation.

    The folder has the layout of Tang et al. 2018 or ours (`find_recordings`).

    Parameters
    ----------
    folder : str or path
    sample_rate : float or None, hertz
        The sound is resampled to this rate; None keeps that of the file.
    clock : float
        This and what follows is for the layout of Tang et al. alone. Time stretch of the motion: 1.013 makes it 1.3 %
        longer, since these recordings run 1 to 1.5 % fast. 1 when left out.
    points : 23 or 21
        All joints (when left out), or those of the harmony paper, without right forearm and left finger.
    travel : bool
        False leaves out the dancer's way through the room, as the paper's numbers do.
    ground : bool
        Whether every unit of the choreography is set on the floor, y = 0 (when left out); of no effect without travel.
    splices : bool
        True counts the straight lines that join units as movement. When left out they are filler (`Motion.valid`).

    Returns
    -------
    Recording

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file or folder. ValueError also where a motion of our layout ends long after its sound.
    TypeError
        For another keyword, such as `fps`, which `load_motion` takes.

    Examples
    --------
    >>> clip = load_recording("my_corpus/take_1").clip  # doctest: +SKIP
    """
    folder = Path(folder)
    if unknown := keywords.keys() - SkeletonsKeywords.__annotations__.keys():
        raise TypeError(f"load_recording has no argument {min(unknown)}; load_motion and load_clip read with others")
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder")
    if missing := missing_parts(folder):
        raise FileNotFoundError(_lacks(folder, missing))
    annotation = load_annotation(folder / "beats.json") if (folder / "beats.json").is_file() else None
    is_own = (folder / "motion.npz").is_file()
    if is_own:
        motion, offset = load_motion(folder / "motion.npz"), recorded_offset(folder) or 0.0
    else:
        motion, offset = load_danced(folder, **keywords)
    audio = load_audio(find_audio(folder), sample_rate=sample_rate)
    beyond = offset + motion.duration - audio.duration
    if is_own and beyond > max(1.0, 0.05 * audio.duration):
        raise ValueError(
            f"{folder}: the motion lasts {motion.duration:.2f} s at {motion.fps:g} fps and ends {beyond:.2f} s after "
            "the audio; is its fps right?"
        )
    with named_faults(folder):
        clip = Clip(folder.name, audio, motion, offset, folder.resolve().parent.name, dance=dance_of(folder))
    return Recording(clip if annotation is None else _annotated(clip, annotation, folder), annotation, folder)


def _annotated(clip: Clip, annotation: BeatAnnotation, folder: Path) -> Clip:
    """`clip` with the beats, dance and source of its annotation."""
    with reading(folder / "beats.json", "a beat annotation"):
        beats = annotation.in_music(clip.audio)
    return replace(clip, beats=beats, dance=annotation.dance or clip.dance, source=annotation.source or clip.source)


class RecordingFiles(NamedTuple):
    """Files of one recording's folder: its song, its annotated beats if there are any, and the dance, "" if unknown."""

    song: Path
    beats: Path | None
    dance: str


def recording_files(folder: PathLike) -> RecordingFiles:
    """The files of a folder that holds a whole recording, beside its motion, which is read from the folder itself.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder, or the file in it.
    """
    folder = Path(folder)
    if missing := missing_parts(folder):
        raise FileNotFoundError(_lacks(folder, missing))
    beats = folder / "beats.json" if (folder / "beats.json").is_file() else None
    annotated = load_annotation(beats).dance if beats else ""
    return RecordingFiles(find_audio(folder), beats, annotated or dance_of(folder))


def recorded_offset(path: PathLike) -> float | None:
    """Audio time (seconds) of a motion's first frame, by its file or by the files of its recording; None without one.

    Parameters
    ----------
    path : str or path
        A recording's folder, its motion.npz or its skeletons.json, whose beats.json or config.json is asked first; or
        any `.npz` that keeps its offset, also where beats.json says nothing of it. Other files beside a recording do
        not belong to it.

    Raises
    ------
    FileNotFoundError, ValueError
        The file, or the folder's beats.json or config.json, is damaged or not there; names it.
    """
    path = Path(path)
    is_folder = path.is_dir()
    folder, motion = (path, path / "motion.npz") if is_folder else (path.parent, path)
    is_own = motion.name == "motion.npz" and motion.is_file()
    if is_own and (folder / "beats.json").is_file():
        annotated = load_annotation(folder / "beats.json").offset
        return load_offset(motion) if annotated is None else annotated
    if is_own or (motion.suffix.lower() == ".npz" and not is_folder):
        return load_offset(motion)
    is_tang = (is_folder or path.name.endswith("skeletons.json")) and (folder / "config.json").is_file()
    return load_config(folder / "config.json").start / FPS if is_tang else None


def load_any_motion(
    path: PathLike, *, report: ReadingReport = lambda path, file: None, **options: Unpack[ReadingKeywords]
) -> Motion:
    """The motion in any file that `load_motion` reads, in a recording's folder, or in a skeletons.json.

    Parameters
    ----------
    path : str or path
    report : function(path, MotionFile), called with how the file was read
    options : fps, scale, joints, smpl, up, as in `load_motion`, for the files that it reads

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    file = read_any_motion(path, **options)
    report(path, file)
    return file.motion


def read_any_motion(path: PathLike, *, as_defaults: bool = False, **options: Unpack[ReadingKeywords]) -> MotionFile:
    """As `load_any_motion`, with the kind of the file and notes on how it was read; parameters of `read_motion`."""
    path = Path(path)
    if path.is_dir() and (path / "skeletons.json").is_file() and not (path / "motion.npz").is_file():
        path = path / "skeletons.json"
    if path.name.endswith("skeletons.json"):
        if not as_defaults and (wrong := [one for one in ("fps", "scale", "smpl", "up") if options.get(one)]):
            raise ValueError(f"{path}: skeletons of Tang et al. have one rate, unit and axis; leave out --{wrong[0]}")
        return MotionFile(motion_part(load_skeletons(path), options.get("joints"), path), "skeletons of Tang et al.")
    return read_motion(path, as_defaults=as_defaults, **options)


def recording_beats(recording: Recording, beats: str) -> BeatTrack:
    """Beats of a recording's music on the audio time line.

    Parameters
    ----------
    recording : Recording
    beats : "annotated" or "tracked"
        Annotated beats are those of `BeatAnnotation.in_music`, as in the clip; tracked ones are `music_beats` of the
        sound alone.

    Raises
    ------
    ValueError
        If annotated beats are asked for and there are none.
    """
    clip, annotation = recording.clip, recording.annotation
    if beats == "annotated":
        if annotation is None:
            raise ValueError(f"{recording.folder}: no beats.json; use tracked beats")
        if annotation.times.size == 0:
            raise ValueError(f"{recording.folder}: beats.json holds no beats; use tracked beats")
        return annotation.in_music(clip.audio)
    return music_beats(replace(clip, beats=None))
