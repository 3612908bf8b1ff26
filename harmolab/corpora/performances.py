"""Performances of musicians on disk, one folder each; `harmolab.corpora.performance_files` says which files it has."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from harmolab.corpora.folders import Problem, RecordingFolders, natural
from harmolab.corpora.instruments import Performance
from harmolab.corpora.performance_files import (
    ABOUT,
    MOTION,
    NOTES,
    PerformanceFiles,
    about_performance,
    has_sound,
    named_instrument,
    performance_files,
    point_files,
)
from harmolab.io.audio import save_audio
from harmolab.io.files import MissingFrameRate, PathLike, atomic_folder, write_json
from harmolab.io.motion import load_detected, load_motion, load_offset, save_motion
from harmolab.io.notes import load_notes, save_notes
from harmolab.io.player_keypoints import IsMusician, load_player_points
from harmolab.io.video import average_rate
from harmolab.io.video_sound import load_sound
from harmolab.types import Audio, BoolArray, Motion

SAMPLE_RATE = 44100.0  # hertz: that of the paper's sound
_AUDIO = "audio.wav"
_MAX_DEPTH = 4
_NO_POINTS = (
    "has no points of the player: motion.npz, a .json or .jsonl of key points, or a folder of OpenPose's frames"
)
_NO_SOUND = "has no sound (.wav, .flac, .ogg, .mp3 or a video) and no notes.csv"


class _Points(NamedTuple):
    motion: Motion
    detected: BoolArray | None
    offset: float | None


def load_performance(
    folder: PathLike,
    *,
    instrument: str | None = None,
    fps: float | None = None,
    sample_rate: float | None = SAMPLE_RATE,
    is_musician: IsMusician | None = None,
    audio: Audio | None = None,
) -> Performance:
    """The performance in a folder.

    Parameters
    ----------
    folder : str or path
        Its files are as in `harmolab.corpora.performance_files`.
    instrument, fps
        "piano" or "violin", and frames per second of the points, of a folder that does not say it.
    sample_rate : float or None, hertz
        Sound of any other rate is resampled to it. None keeps the file's.
    is_musician : as in `load_player_points`
    audio : Audio, the sound in place of the folder's, which then needs none

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
    points = _points(files, about, fps, is_musician)
    if audio is None and files.sound is not None:
        audio = load_sound(files.sound, sample_rate=sample_rate)
    offset = about.get("offset_s", points.offset) or 0.0
    if audio is not None:
        _check_end(folder, offset + points.motion.duration, audio.duration, points.motion.fps)
    full = folder.resolve()
    try:
        return Performance(
            about.get("name", full.name), plays, audio, points.motion, points.detected,  # type: ignore[arg-type]
            None if files.notes is None else load_notes(files.notes), offset,
            about.get("piece", ""), about.get("rendered", False), about.get("source", full.parent.name),
        )  # fmt: skip
    except ValueError as error:
        raise ValueError(f"{folder}: {str(error).removeprefix(f'{folder}: ')}") from None


def load_playing(
    path: PathLike, audio: Audio, *, instrument: str, fps: float | None = None, offset: float | None = None
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

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder or file. ValueError also where the folder says another instrument.
    """
    path = Path(path)
    if path.is_dir():
        performance = load_performance(path, instrument=instrument, fps=fps, audio=audio)
        if performance.instrument != instrument:
            raise ValueError(f"{path}: is played on a {performance.instrument}, not on a {instrument}")
        return performance if offset is None else replace(performance, offset=offset)
    points = _points(PerformanceFiles(None, (path,), None, None), {}, fps, None)
    begin = next((time for time in (offset, points.offset) if time is not None), 0.0)
    _check_end(path, begin + points.motion.duration, audio.duration, points.motion.fps)
    try:
        return Performance(path.stem, instrument, audio, points.motion, points.detected, offset=begin)  # type: ignore[arg-type]
    except ValueError as error:
        raise ValueError(f"{path}: {str(error).removeprefix(f'{path.stem}: ')}") from None


def _fault(files: PerformanceFiles) -> str:
    """The sentence that says which part a folder lacks, "" if it is whole."""
    if not files.points:
        return _NO_POINTS
    return "" if files.sound or files.notes else _NO_SOUND


def _points(
    files: PerformanceFiles, about: dict[str, Any], fps: float | None, is_musician: IsMusician | None
) -> _Points:
    """The points of a folder, their mask, and the offset that their file holds."""
    path, rate = files.points[0], about.get("fps")
    if any(file.suffix.lower() == ".npz" for file in files.points):
        if len(files.points) > 1:
            raise ValueError(f"{path.parent / ABOUT}: an .npz has no confidence, so it is not merged with other points")
        return _Points(load_motion(path, fps=rate), load_detected(path), load_offset(path))
    default = average_rate(files.video) if rate is None and fps is None and files.video else fps
    try:
        points = load_player_points(
            files.points, fps=rate, default_fps=default, size=about.get("size"), mirrored=about.get("mirrored"),
            is_musician=is_musician,
        )  # fmt: skip
    except MissingFrameRate:
        raise MissingFrameRate(
            f'{path}: holds no frame rate; write "fps" into {ABOUT} in its folder, or pass fps (--fps 25)'
        ) from None
    return _Points(points.motion, points.detected, None)


def _check_end(folder: Path, end: float, seconds: float, fps: float) -> None:
    """ValueError for points that end long after the sound."""
    if end - seconds > max(1.0, 0.05 * seconds):
        late = f"{end - seconds:.2f} s after the sound"
        raise ValueError(f"{folder}: the points, at {fps:g} frames a second, end {late}; is that rate right?")


def save_performance(folder: PathLike, performance: Performance) -> None:
    """Write a performance as a folder, whole or not at all: audio.wav, motion.npz, notes.csv, performance.json.

    `load_performance` gives points, mask, notes and names back to the last bit; the sound is kept with 16 bits, and at
    the rate that it has.

    Raises
    ------
    ValueError
        The folder is there and holds other files.
    """
    folder = Path(folder)
    ours = {_AUDIO, MOTION, NOTES, ABOUT}
    if folder.exists() and (not folder.is_dir() or {child.name for child in folder.iterdir()} - ours):
        raise ValueError(f"{folder}: is there and holds other files; choose another folder")
    about = {name: getattr(performance, name) for name in ("name", "instrument", "piece", "rendered", "source")}
    with atomic_folder(folder) as part:
        if performance.audio is not None:
            save_audio(part / _AUDIO, performance.audio)
        save_motion(part / MOTION, performance.motion, offset=performance.offset, detected=performance.detected)
        if performance.notes is not None:
            save_notes(part / NOTES, performance.notes)
        write_json(part / ABOUT, about)


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
        if not root.exists():
            raise FileNotFoundError(f"{root}: no such folder")
        if not root.is_dir():
            raise ValueError(f"{root}: is a file; a folder of performances is needed")
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
    for name, below, names in os.walk(root):
        folder = Path(name)
        below[:] = sorted(child for child in below if not child.startswith("."))
        names = [file for file in names if not file.startswith(".")]
        has_points = MOTION in names or bool(point_files(folder, [folder / child for child in (*names, *below)]))
        if not (has_points or ABOUT in names or NOTES in names or any(map(has_sound, names))):
            below[:] = below if len(folder.relative_to(root).parts) < _MAX_DEPTH else []
            continue
        if has_points or ABOUT in names:
            below[:] = []
        try:
            yield folder, _fault(performance_files(folder))
        except (ValueError, OSError) as error:
            yield folder, str(error)


def iter_performances(roots: PathLike | Sequence[PathLike], **options: Any) -> Iterator[Performance | Problem]:
    """The performances at or below one or several roots, one in memory at a time; a Problem in place of each other.

    Parameters
    ----------
    roots : as in `find_performances`
    options : of `load_performance`
    """
    folders, problems = find_performances(roots)
    yield from problems
    for folder in folders:
        try:
            yield load_performance(folder, **options)
        except (ValueError, OSError) as error:
            yield Problem(folder, str(error))
