"""Performances of musicians on disk, one folder each (sound, points, notes), and splits that share no piece.

======================  ==============================================================================================
sound                   ``audio.wav`` (or .flac ...); else the only sound file; else the sound of the only video
points                  ``motion.npz`` of ours; else the only file of key points (.json, .jsonl), or the only folder of
                        OpenPose's frames (``*_keypoints.json``), which may be this one
``notes.csv``           optional; see below. A folder without sound must have it
``performance.json``    optional; an object with any of the fields below
======================  ==============================================================================================

==============  ======================================================================================================
``instrument``  "piano" or "violin"; else it is the word in the folder's name, or in that of the folder above
``fps``         frames per second of the points, where their file does not hold it; else that of the only video
``size``        [width, height] of the picture, pixels; for MediaPipe's files that do not hold it
``mirrored``    true where the picture is a mirror image (`harmolab.musician.keypoints`)
``offset_s``    seconds, audio time of the first frame; else what motion.npz holds; else that of the first picture of
                the only video, where this is the sound, too; else 0
``piece``       name of the piece: performances of one piece stay on one side of a split
``audio``       name of the sound file or video, where there are several
``points``      name of the file or folder of points, or a list of those of one video, of which each point in each frame
                is taken from the one that is surer of it
``rendered``    true where the sound was made from the notes
``name``        of the performance; else the folder's
``source``      of the recordings; else the name of the folder above
``comment``     anything
==============  ======================================================================================================

So the simplest folder is ``piano_1/`` with ``take.mp4`` and the folder ``openpose/``; or with ``song.wav`` and
``points.json``.

The notes of a piece are a table of text, ``notes.csv``:

=============  ===================================================================================
column         content
=============  ===================================================================================
``onset_s``    seconds of audio time at which the note begins
``offset_s``   seconds at which it ends
``midi``       key, a MIDI number: 60 is middle C
``loudness``   0 to 1; optional, 1 where there is no such column. MIDI velocities divided by 127
``hand``       left or right, empty where unknown; optional
=============  ===================================================================================

The first line has the names, in any order; other columns are not read. MIDI files are not read: any notation program
or MIDI library writes such a table.
"""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from harmolab.data.recordings import Problem, RecordingFolders, check_root, natural, walk
from harmolab.files import (
    MAX_TEXT_BYTES,
    SOUNDS,
    MissingFrameRate,
    PathLike,
    named_faults,
    number_column,
    read_columns,
    read_json,
    reading,
)
from harmolab.musician.keypoints import IsMusician, checked_size, load_player_points
from harmolab.readers.audio import load_sound
from harmolab.readers.motion import load_detected, load_offset, motion_part, read_motion
from harmolab.readers.player_points import INSTRUMENTS
from harmolab.readers.video import average_rate, first_picture, is_video
from harmolab.types import Audio, BoolArray, Motion, Notes

# A performance: sound, the points of the player, the notes if they are known


@dataclass(frozen=True, eq=False)
class Performance:
    """A musician who plays a piece.

    Parameters
    ----------
    name : str
    instrument : "piano" or "violin"
    audio : Audio or None
    motion : Motion, (T, P, 2) image coordinates, y down; joints by the names of `player_points`, some may be missing
    detected : (T, P) mask, False where a point was not detected (its place is filled in); all True when left out
    notes : Notes or None, on the audio's time line
    offset : float, seconds, audio time of frame 0
    piece : str; performances of one piece, or of its repeats, stay on one side of a split
    rendered : bool, the sound was made from the notes, not recorded
    source : str, "synthetic" or the name of the recordings
    """

    name: str
    instrument: str
    audio: Audio | None
    motion: Motion
    detected: BoolArray = None  # type: ignore[assignment]  # filled in below
    notes: Notes | None = None
    offset: float = 0.0
    piece: str = ""
    rendered: bool = False
    source: str = ""

    def __post_init__(self) -> None:
        if self.instrument not in INSTRUMENTS:
            raise ValueError(f"{self.name}: instrument must be {' or '.join(INSTRUMENTS)}, got {self.instrument!r}")
        if self.motion.positions.shape[2] != 2:
            raise ValueError(f"{self.name}: points of a picture are needed, (T, P, 2), got three coordinates")
        shape = self.motion.positions.shape[:2]
        detected = np.ones(shape, bool) if self.detected is None else np.array(self.detected, bool)
        if detected.shape != shape:
            raise ValueError(f"{self.name}: detected must have shape {shape}, got {detected.shape}")
        detected.setflags(write=False)
        object.__setattr__(self, "detected", detected)
        if not np.isfinite(self.offset):
            raise ValueError(f"{self.name}: offset must be finite, got {self.offset}")

    def part(self, joints: Sequence[str]) -> "Performance":
        """The performance with these points alone, in this order; ValueError for one that it has not."""
        own = self.motion.skeleton.joints
        motion = motion_part(self.motion, joints, self.name)
        return replace(self, motion=motion, detected=self.detected[:, [own.index(each) for each in joints]])

    def frames(self, first: int, last: int) -> "Performance":
        """The performance from frame `first` on, up to the one before `last`."""
        whole, kept = self.motion, slice(first, last)
        motion = Motion(whole.positions[kept], whole.fps, whole.skeleton, whole.valid[kept])
        return replace(self, motion=motion, detected=self.detected[kept], offset=self.offset + first / whole.fps)


# Files of a folder: the sound, the points and the notes

ABOUT, MOTION, NOTES = "performance.json", "motion.npz", "notes.csv"
_FRAME = "_keypoints.json"
_POINTS = (".json", ".jsonl")
_LONGEST_NAME = 200
_OTHER_JSON = (ABOUT, "beats.json", "config.json", "skeletons.json")


class PerformanceFiles(NamedTuple):
    """Files of one folder: the sound (a video perhaps), the points, the notes, a video; None or () without."""

    sound: Path | None
    points: tuple[Path, ...]
    notes: Path | None
    video: Path | None


def about_performance(folder: Path) -> dict[str, Any]:
    """The fields of a folder's performance.json; none where there is no such file.

    Raises
    ------
    ValueError
        The file is damaged, or a field is unknown or of another kind; names file and field.
    """
    path = folder / ABOUT
    if not path.exists():
        return {}
    with reading(path, "the description of a performance", max_bytes=MAX_TEXT_BYTES):
        about = read_json(path)
        if not isinstance(about, dict):
            raise ValueError(f'must be an object with fields such as "instrument", got {str(about)[:30]!r}')
        for name, value in about.items():
            if name not in _FIELDS:
                raise ValueError(f"has a field {name[:30]!r} that is not known; fields are {', '.join(_FIELDS)}")
            fits, rule = _FIELDS[name]
            if not fits(value):
                raise ValueError(f"{name} must be {rule}, got {str(value)[:60]!r}")
        return about


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 36_000


def _is_inside(name: Any) -> bool:
    is_short = isinstance(name, str) and 0 < len(name) <= _LONGEST_NAME
    return is_short and not PurePath(name).is_absolute() and ".." not in PurePath(name).parts


def _are_inside(names: Any) -> bool:
    return all(map(_is_inside, names)) if isinstance(names, list) and names else _is_inside(names)


_Rule = tuple[Callable[[Any], bool], str]
_TEXT: _Rule = (lambda value: isinstance(value, str), "text")
_TRUTH: _Rule = (lambda value: isinstance(value, bool), "true or false")
_NUMBER: _Rule = (_is_number, "a number")
_INSIDE: _Rule = (_is_inside, "a name inside of the folder")
_FIELDS: dict[str, _Rule] = {
    "instrument": (lambda value: value in INSTRUMENTS, " or ".join(INSTRUMENTS)),
    "fps": _NUMBER,
    "size": (lambda value: bool(checked_size(value)), ""),
    "mirrored": _TRUTH,
    "offset_s": _NUMBER,
    "piece": _TEXT,
    "audio": _INSIDE,
    "points": (_are_inside, _INSIDE[1]),
    "rendered": _TRUTH,
    "name": _TEXT,
    "source": _TEXT,
    "comment": (lambda value: True, ""),
}


def named_instrument(folder: Path) -> str:
    """The instrument whose name is a word in that of the folder, or else of the folder above; "" where none is.

    >>> named_instrument(Path("recitals/violin/take_1"))
    'violin'
    """
    full = folder.resolve()
    for name in (full.name, full.parent.name):
        for word in re.findall(r"[a-z]+", name.lower()):
            if word in INSTRUMENTS:
                return word
    return ""


def performance_files(folder: Path) -> PerformanceFiles:
    """The files of a performance's folder, by their names; only performance.json is read.

    Raises
    ------
    ValueError
        There are several of a kind and performance.json does not say which; a file that it names is not there.
    """
    about = about_performance(folder)
    children = sorted(child for child in folder.iterdir() if not child.name.startswith("."))
    videos = [child for child in children if is_video(child)]
    notes = folder / NOTES
    return PerformanceFiles(
        _sound(folder, about.get("audio"), children, videos),
        _point_files(folder, about.get("points"), children),
        notes if notes.is_file() else None,
        videos[0] if len(videos) == 1 else None,
    )


def _sound(folder: Path, name: str | None, children: list[Path], videos: list[Path]) -> Path | None:
    """The sound file or the video of a folder, None without one."""
    if name is not None:
        return _present(folder, name)
    sounds = [child for child in children if child.suffix.lower() in SOUNDS]
    audio = [child for child in sounds if child.stem == "audio"]
    return _only(folder, audio[:1] or sounds or videos, "audio")


def _point_files(folder: Path, names: str | list[str] | None, children: list[Path]) -> tuple[Path, ...]:
    """The files and folders of points of a folder."""
    if names is not None:
        return tuple(_present(folder, name) for name in ([names] if isinstance(names, str) else names))
    if (folder / MOTION).is_file():
        return (folder / MOTION,)
    points = _only(folder, point_files(folder, children), "points")
    return () if points is None else (points,)


def point_files(folder: Path, children: list[Path]) -> list[Path]:
    """Files that may hold key points, and folders of OpenPose's frames, of a folder with these children."""
    files = [child for child in children if child.suffix.lower() in _POINTS and child.name not in _OTHER_JSON]
    frames = [file for file in files if file.name.endswith(_FRAME)]
    folders = [folder] if frames else []
    folders += [child for child in children if child.is_dir() and _is_frames(child)]
    return [*(file for file in files if file not in frames), *folders]


def _is_frames(folder: Path) -> bool:
    """True for a folder of OpenPose's frames that is no performance of its own."""
    try:
        names = [child.name for child in folder.iterdir()]
    except OSError:  # a folder that may not be looked into
        return False
    is_whole = any(name in (ABOUT, NOTES) or has_sound(name) for name in names)
    return not is_whole and any(name.endswith(_FRAME) for name in names)


def has_sound(name: str) -> bool:
    """True for the name of a sound file or of a video."""
    return PurePath(name).suffix.lower() in SOUNDS or is_video(name)


def _present(folder: Path, name: str) -> Path:
    """A file of the folder; ValueError unless it is there."""
    if not (folder / name).exists():
        raise ValueError(f"{folder / ABOUT}: names {name[:60]!r}, which is not in the folder")
    return folder / name


def _only(folder: Path, files: list[Path], field: str) -> Path | None:
    """The only one of some files, None without any; ValueError for several, which names the field that helps."""
    if len(files) > 1:
        names = ", ".join(file.name if file != folder else f"*{_FRAME}" for file in files[:5])
        raise ValueError(f'{folder}: holds {names}; write the one that counts as "{field}" into {ABOUT}')
    return files[0] if files else None


# Notes of a piece, ``notes.csv``

_NEEDED = ("onset_s", "offset_s", "midi")
_HANDS = {"left": 0, "right": 1, "": -1}


def load_notes(path: PathLike) -> Notes:
    """The notes in a table, in the order of their onsets.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "a table of notes", max_bytes=MAX_TEXT_BYTES) as file:
        columns = read_columns(file, _NEEDED)
        onsets, offsets, keys = (np.array(number_column(columns, name)) for name in _NEEDED)
        bad = ~(np.isfinite(keys) & (keys == np.round(keys)) & (keys >= 0) & (keys <= 127))
        if bad.any():
            raise ValueError(f"midi must be whole numbers from 0 to 127, got {columns['midi'][bad.argmax()][:30]!r}")
        loudness = np.array(number_column(columns, "loudness")) if "loudness" in columns else np.ones(keys.size)
        if loudness.size and 1 < loudness.max() <= 127:
            raise ValueError(f"loudness reaches {loudness.max():g}; these are MIDI velocities: divide them by 127")
        words = [word.lower() for word in columns.get("hand", [""] * keys.size)]
        if unknown := [word for word in words if word not in _HANDS]:
            raise ValueError(f"hand must be left, right or empty, got {unknown[0][:30]!r}")
        hands = np.array([_HANDS[word] for word in words], np.int64)
        order = np.argsort(onsets, kind="stable")
        return Notes(onsets[order], offsets[order], keys.astype(np.int64)[order], loudness[order], hands[order])


# Performances read from their folders

SAMPLE_RATE = 44100.0  # hertz: that of the paper's sound
_MAX_DEPTH = 4
_NO_POINTS = (
    "has no points of the player: motion.npz, a .json or .jsonl of key points, or a folder of OpenPose's frames"
)
_NO_SOUND = f"has no sound ({', '.join(SOUNDS)} or a video) and no notes.csv"


def load_performance(
    folder: PathLike,
    *,
    instrument: str | None = None,
    fps: float | None = None,
    sample_rate: float | None = SAMPLE_RATE,
    is_musician: IsMusician | None = None,
    audio: Audio | None = None,
    offset: float | None = None,
    film: PathLike | None = None,
) -> Performance:
    """The performance in a folder.

    Parameters
    ----------
    folder : str or path
        Its files are as in `harmolab.musician.performances`.
    instrument, fps
        "piano" or "violin", and frames per second of the points, of a folder that does not say it.
    sample_rate : float or None, hertz
        Sound of any other rate is resampled to it. None keeps the file's.
    is_musician : as in `load_player_points`
    audio : Audio, the sound in place of the folder's, which then needs none
    offset : float, seconds, audio time of the first frame, in place of what the folder says
    film : str or path, that `audio` is of; of a video frame 0 is the first picture, unless files say another time

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder or the file in it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder")
    about, files = about_performance(folder), performance_files(folder)
    if (fault := _fault(files)) and (audio is None or not files.points):
        raise ValueError(f"{folder}: {fault}")
    plays = about.get("instrument") or named_instrument(folder) or instrument
    if not plays:
        raise ValueError(f'{folder}: does not say the instrument; write {{"instrument": "piano"}} into its {ABOUT}')
    motion, detected, begin = _points(files, about, fps, is_musician, film)
    if audio is None and files.sound is not None:
        audio = load_sound(files.sound, sample_rate=sample_rate)
    offset, full = (about.get("offset_s", begin) or 0.0) if offset is None else offset, folder.resolve()
    with named_faults(folder):
        if audio is not None:
            _check_end(motion, offset, audio)
        notes = None if files.notes is None else load_notes(files.notes)
        name, source = about.get("name", full.name), about.get("source", full.parent.name)
        piece, rendered = about.get("piece", ""), about.get("rendered", False)
        return Performance(name, plays, audio, motion, detected, notes, offset, piece, rendered, source)  # type: ignore[arg-type]


def load_playing(
    path: PathLike,
    audio: Audio,
    *,
    instrument: str,
    fps: float | None = None,
    offset: float | None = None,
    film: PathLike | None = None,
) -> Performance:
    """A musician's own points beside the sound that they were played to.

    Parameters
    ----------
    path : str or path
        A folder as of `load_performance`, of whose sound `audio` takes the place, or a file of points: .npz, .json,
        .jsonl; a folder of OpenPose's frames.
    audio : Audio, the whole recording
    instrument : "piano" or "violin"
    fps : float, frames per second, where the files do not say it
    offset : float, seconds, audio time of the first frame; what the files say when left out, else 0
    film : as in `load_performance`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder or file. ValueError also where the folder says another instrument.
    """
    path = Path(path)
    if path.is_dir():
        performance = load_performance(path, instrument=instrument, fps=fps, audio=audio, offset=offset, film=film)
        if performance.instrument != instrument:
            raise ValueError(f"{path}: is played on a {performance.instrument}, not on a {instrument}")
        return performance
    motion, detected, begin = _points(PerformanceFiles(None, (path,), None, None), {}, fps, None, film)
    offset = (begin or 0.0) if offset is None else offset
    try:
        _check_end(motion, offset, audio)
        return Performance(path.stem, instrument, audio, motion, detected, offset=offset)  # type: ignore[arg-type]
    except ValueError as error:
        raise ValueError(f"{path}: {str(error).removeprefix(f'{path.stem}: ')}") from None


def _fault(files: PerformanceFiles) -> str:
    """The sentence that says which part a folder lacks, "" if it is whole."""
    if not files.points:
        return _NO_POINTS
    return "" if files.sound or files.notes else _NO_SOUND


def _points(
    files: PerformanceFiles,
    about: dict[str, Any],
    fps: float | None,
    is_musician: IsMusician | None,
    film: PathLike | None,
) -> tuple[Motion, BoolArray | None, float | None]:
    """The points of a folder, their mask, and the offset that their file holds, or that of the film."""
    path, rate = files.points[0], about.get("fps")
    if any(file.suffix.lower() == ".npz" for file in files.points):
        if len(files.points) > 1:
            raise ValueError(f"{path.parent / ABOUT}: an .npz has no confidence, so it is not merged with other points")
        if about.get("mirrored"):
            how = "save it of load_player_points(..., mirrored=True), and take the word out"
            raise ValueError(f'{path.parent / ABOUT}: "mirrored" does not turn an .npz round; {how}')
        motion = read_motion(path, fps=fps if rate is None else rate, as_defaults=rate is None).motion
        return motion, load_detected(path), load_offset(path)
    default = average_rate(files.video) if rate is None and fps is None and files.video else fps
    picture: dict[str, Any] = {"size": about.get("size"), "mirrored": about.get("mirrored")}
    try:
        points = load_player_points(files.points, fps=rate, default_fps=default, is_musician=is_musician, **picture)
    except MissingFrameRate:
        raise MissingFrameRate(
            f'{path}: holds no frame rate; write "fps" into {ABOUT} in its folder, or pass fps (--fps 25)'
        ) from None
    films = (film, files.video if files.video == files.sound else None)
    begin = next((first_picture(Path(each)) for each in films if each and is_video(each)), None)
    return points.motion, points.detected, begin


def _check_end(motion: Motion, offset: float, audio: Audio) -> None:
    """ValueError for points that end long after the sound."""
    late = offset + motion.duration - audio.duration
    if late > max(1.0, 0.05 * audio.duration):
        raise ValueError(
            f"the points, at {motion.fps:g} frames a second, end {late:.2f} s after the sound; is that rate right, "
            f"and offset {offset:g} s?"
        )


def find_performances(roots: PathLike | Sequence[PathLike]) -> RecordingFolders:
    """Folders at or below one or several roots that hold a performance, and a problem for each that holds parts of one.

    Nothing but performance.json is read.

    Raises
    ------
    FileNotFoundError, ValueError
        A root does not exist or is not a folder.
    """
    folders: list[Path] = []
    problems: list[Problem] = []
    for root in [Path(roots)] if isinstance(roots, str | os.PathLike) else map(Path, roots):
        check_root(root, "performances")
        for folder, fault in _faults(root):
            if fault:
                problems.append(Problem(folder, f"{folder}: {fault.removeprefix(f'{folder}: ')}"))
            else:
                folders.append(folder)
    above = {parent for folder in folders for parent in folder.parents}
    parts = [problem for problem in problems if problem.folder not in above]
    return RecordingFolders(tuple(sorted(set(folders), key=natural)), tuple(sorted(set(parts))))


def _faults(root: Path) -> Iterator[tuple[Path, str]]:
    """Every folder at or below `root` with a part of a performance, and the fault that it has, "" if it is whole."""
    for folder, below, names in walk(root):
        names = [file for file in names if not file.startswith(".")]
        has_points = MOTION in names or bool(point_files(folder, [folder / child for child in (*names, *below)]))
        if not (has_points or ABOUT in names or NOTES in names or any(map(has_sound, names))):
            if len(folder.relative_to(root).parts) >= _MAX_DEPTH:
                below.clear()
            continue
        if has_points or ABOUT in names:
            below.clear()
        try:
            yield folder, _fault(performance_files(folder))
        except (ValueError, OSError) as error:
            yield folder, str(error)


# Splits that share no piece, by the note patterns that performances have in common

MOST_SHARED = 0.25  # of the note patterns: above, two performances count as repeats of one piece
PATTERN_NOTES = 4
CHORD_SECONDS = 0.05  # onsets in one such step count as one chord, whose notes are taken low before high


def note_patterns(notes: Notes) -> set[tuple[int, ...]]:
    """All pitches of four notes in a row: by onset, in steps of 50 ms, low before high."""
    pitches = notes.pitches[np.lexsort((notes.pitches, np.round(notes.onsets / CHORD_SECONDS)))].tolist()
    return {tuple(pitches[start : start + PATTERN_NOTES]) for start in range(len(pitches) - PATTERN_NOTES + 1)}


def shared_patterns(patterns: set[tuple[int, ...]], others: set[tuple[int, ...]]) -> float:
    """Share of the `note_patterns` of the one with fewer that the other has too, 0 to 1; 0 without patterns."""
    fewer = min(len(patterns), len(others))
    return len(patterns & others) / fewer if fewer else 0.0


def piece_groups(performances: Sequence[Performance]) -> list[int]:
    """Number of the group of every performance: those of one piece, and pieces that share too many note patterns.

    Parameters
    ----------
    performances : those without a piece are pieces of their own
        Pieces with performances whose `shared_patterns` exceed `MOST_SHARED` are one group. Without notes only `piece`
        counts, and whether two have the same sound to the last bit.
    """
    patterns = [set() if one.notes is None else note_patterns(one.notes) for one in performances]
    pairs = [
        (first, second)
        for second, one in enumerate(performances)
        for first, other in enumerate(performances[:second])
        if (one.piece and one.piece == other.piece)
        or _same_sound(one.audio, other.audio)
        or shared_patterns(patterns[first], patterns[second]) > MOST_SHARED
    ]
    rows, columns = np.array(pairs, np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(pairs)), (rows, columns)), shape=(len(performances),) * 2)
    return [int(group) for group in connected_components(graph, directed=False)[1]]


def _same_sound(one: Audio | None, other: Audio | None) -> bool:
    """True for a sound and its copy, which is heard."""
    if one is None or other is None:
        return False
    return np.array_equal(one.samples, other.samples) and bool(one.samples.any())


def split_by_piece(
    performances: Sequence[Performance], *, test_share: float = 0.15, validation_share: float = 0.15, seed: int = 0
) -> list[tuple[Performance, ...]]:
    """Train, validation and test side: performances dealt out by `piece_groups` at random, never by clip.

    So no side has seen another's music.

    Parameters
    ----------
    performances : Performance list
    test_share, validation_share : float
        Share of the seconds to aim at. A side whose share is above 0 gets one group at least; 0 leaves it empty.
    seed : int

    Raises
    ------
    ValueError
        Shares that are negative or leave nothing to train on; fewer groups than sides.
    """
    if min(test_share, validation_share) < 0 or not test_share + validation_share < 1:
        raise ValueError(
            f"test_share and validation_share must leave some to train on: {test_share}, {validation_share}"
        )
    groups = np.array(piece_groups(performances), np.int64)
    seconds = np.array([one.motion.duration for one in performances])
    shares = np.array([1 - validation_share - test_share, validation_share, test_share])
    count = int(groups.max(initial=-1)) + 1
    if count < (needed := (shares > 0).sum()):
        raise ValueError(f"{len(performances)} performances are of {count} pieces: too few for {needed} sides")
    deficits, sides = shares * seconds.sum(), np.zeros(count, np.int64)
    for turn, group in enumerate(np.random.default_rng(seed).permutation(count)):
        needy = np.flatnonzero(shares > 0)[::-1]
        side = needy[turn] if turn < needy.size else np.argmax(np.where(shares > 0, deficits, -np.inf))
        sides[group] = side
        deficits[side] -= seconds[groups == group].sum()
    dealt = list(zip(performances, sides[groups], strict=True))
    return [tuple(one for one, own in dealt if own == side) for side in range(3)]
