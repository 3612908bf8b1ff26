"""Folders of recordings on disk, in the layout of Tang et al. or in ours, one folder a recording.

==========  ====================================================================
Tang 2018   skeletons.json, config.json, audio.mp3
ours        motion.npz, audio.wav (or .flac, .ogg, .mp3)
both        beats.json, optional: beats, bars, dance, units, motion_offset_s
==========  ====================================================================

The dance stands in beats.json or in the folder's name (DANCE_C, _R, _T, _W).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from harmolab.beats.audio import beat_strengths, music_beats
from harmolab.corpora import tang2018
from harmolab.io.audio import load_audio
from harmolab.io.beats import BeatAnnotation, load_annotation
from harmolab.io.files import PathLike, reading
from harmolab.io.motion import load_motion, load_offset, motion_part, read_motion
from harmolab.io.motion_file import MotionFile
from harmolab.types import BeatTrack, Clip, Motion

ReadingReport = Callable[[PathLike, MotionFile], object]  # called with a file's path and how it was read
_MAX_DEPTH = 4
_PARTS = ("skeletons.json", "config.json", "motion.npz")


@dataclass(frozen=True, eq=False)
class Recording:
    """One folder: the clip, its annotation (None without beats.json), and the path."""

    clip: Clip
    annotation: BeatAnnotation | None
    folder: Path


class Problem(NamedTuple):
    """A folder that cannot be used, and the reason in one sentence that names the file."""

    folder: Path
    message: str


class RecordingFolders(NamedTuple):
    """Folders that hold a whole recording, in natural order, and those that hold only parts of one."""

    folders: tuple[Path, ...]
    problems: tuple[Problem, ...]


def find_recordings(root: PathLike) -> RecordingFolders:
    """The folders of recordings at or below `root`; nothing is read yet.

    Raises
    ------
    FileNotFoundError, ValueError
        `root` does not exist or is not a folder.
    """
    root = Path(root)
    if not root.exists():
        raise FileNotFoundError(f"{root}: no such folder")
    if not root.is_dir():
        raise ValueError(f"{root}: is a file; a folder of sequences is needed")
    missing = {folder: missing_parts(folder) for folder in _folders_with_parts(root)}
    return RecordingFolders(
        tuple(folder for folder, parts in missing.items() if not parts),
        tuple(Problem(folder, _lacks(folder, parts)) for folder, parts in missing.items() if parts),
    )


def _lacks(folder: Path, parts: list[str]) -> str:
    """The sentence that a folder has no such parts."""
    return f"{folder}: has no {' and no '.join(parts)}"


def _folders_with_parts(root: Path) -> list[Path]:
    """Folders at or below `root` that hold at least one part of a recording, DANCE_2 before DANCE_10."""
    folders = []
    for name, below, files in os.walk(root):
        depth = len(Path(name).relative_to(root).parts)
        below[:] = [] if depth >= _MAX_DEPTH else [child for child in below if not child.startswith(".")]
        if any(part in files for part in _PARTS):
            folders.append(Path(name))
    return sorted(folders, key=natural)


def natural(path: Path) -> list[tuple[int, str]]:
    """A key that sorts numbers in names as numbers."""
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d{1,18})", str(path))]


def missing_parts(folder: PathLike) -> list[str]:
    """The files that a folder lacks to be a recording; empty if it is whole."""
    folder = Path(folder)
    missing = [part for part in _PARTS[:2] if not (folder / part).is_file()]
    if (folder / "motion.npz").is_file() or len(missing) == 2:
        missing = [] if (folder / "motion.npz").is_file() else ["motion.npz"]
    try:
        tang2018.find_audio(folder)
    except FileNotFoundError:
        missing.append("audio.wav (.flac, .ogg, .mp3)")
    return missing


def iter_recordings(root: PathLike) -> Iterator[Recording | Problem]:
    """The recordings at or below `root`, one in memory at a time; a Problem in place of each that cannot be read."""
    folders, problems = find_recordings(root)
    yield from problems
    for folder in folders:
        try:
            yield load_recording(folder)
        except (ValueError, FileNotFoundError) as error:
            yield Problem(folder, str(error))


def load_recording(
    folder: PathLike,
    *,
    sample_rate: float | None = 22050.0,
    clock: float = 1.0,
    points: int = 23,
    travel: bool = True,
    ground: bool = True,
) -> Recording:
    """One folder: the clip with its annotated beats, and the annotation.

    Parameters
    ----------
    folder : str or path
    sample_rate : float or None, hertz
        As in `load_audio`.
    clock, points, travel, ground
        For the Tang layout only; as in `harmolab.corpora.tang2018.load_skeletons`.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder")
    if missing := missing_parts(folder):
        raise FileNotFoundError(_lacks(folder, missing))
    annotation = load_annotation(folder / "beats.json") if (folder / "beats.json").is_file() else None
    is_own = (folder / "motion.npz").is_file()
    if is_own:
        motion, offset = load_motion(folder / "motion.npz"), recorded_offset(folder) or 0.0
    else:
        motion, offset = tang2018.load_danced(folder, clock=clock, points=points, travel=travel, ground=ground)
    audio = load_audio(tang2018.find_audio(folder), sample_rate=sample_rate)
    beyond = offset + motion.duration - audio.duration
    if is_own and beyond > max(1.0, 0.05 * audio.duration):
        raise ValueError(
            f"{folder}: the motion lasts {motion.duration:.2f} s at {motion.fps:g} fps and ends {beyond:.2f} s after "
            "the audio; is its fps right?"
        )
    try:
        source, dance = folder.resolve().parent.name, tang2018.dance_of(folder)
        clip = Clip(folder.name, audio, motion, offset, source, dance=dance)
    except ValueError as error:
        raise ValueError(f"{folder}: {error}") from None
    return Recording(clip if annotation is None else _annotated(clip, annotation, folder), annotation, folder)


def _annotated(clip: Clip, annotation: BeatAnnotation, folder: Path) -> Clip:
    """`clip` with the beats, dance and source of its annotation."""
    with reading(folder / "beats.json", "a beat annotation"):
        beats = annotation.track(clip.audio.duration)
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
    return RecordingFiles(tang2018.find_audio(folder), beats, annotated or tang2018.dance_of(folder))


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
    folder = path if path.is_dir() else path.parent
    motion = path / "motion.npz" if path.is_dir() else path
    is_recording = path.is_dir() or path.name == "motion.npz"
    if (folder / "motion.npz").is_file() and is_recording and (folder / "beats.json").is_file():
        annotated = load_annotation(folder / "beats.json").offset
        return load_offset(folder / "motion.npz") if annotated is None else annotated
    if motion.suffix.lower() == ".npz" and (motion.is_file() or not path.is_dir()):
        return load_offset(motion)
    is_tang = (path.is_dir() or path.name.endswith("skeletons.json")) and (folder / "config.json").is_file()
    return tang2018.load_config(folder / "config.json").start / tang2018.FPS if is_tang else None


def load_any_motion(
    path: PathLike,
    *,
    fps: float | None = None,
    scale: float | None = None,
    joints: tuple[str, ...] | None = None,
    smpl: PathLike | None = None,
    up: str = "",
    report: ReadingReport = lambda path, file: None,
) -> Motion:
    """The motion in any file that `load_motion` reads, in a recording's folder, or in a skeletons.json.

    Parameters
    ----------
    path : str or path
    fps, scale, joints, smpl, up : as in `load_motion`, for the files that it reads
    report : function(path, MotionFile), called with how the file was read

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    file = read_any_motion(path, fps=fps, scale=scale, joints=joints, smpl=smpl, up=up)
    report(path, file)
    return file.motion


def read_any_motion(
    path: PathLike,
    *,
    fps: float | None = None,
    scale: float | None = None,
    joints: tuple[str, ...] | None = None,
    smpl: PathLike | None = None,
    up: str = "",
    as_defaults: bool = False,
) -> MotionFile:
    """As `load_any_motion`, with the kind of the file and notes on how it was read; parameters of `read_motion`."""
    path = Path(path)
    if path.is_dir() and (path / "skeletons.json").is_file() and not (path / "motion.npz").is_file():
        path = path / "skeletons.json"
    if path.name.endswith("skeletons.json"):
        return MotionFile(motion_part(tang2018.load_skeletons(path), joints, path), "skeletons of Tang et al.")
    return read_motion(path, fps=fps, scale=scale, joints=joints, smpl=smpl, up=up, as_defaults=as_defaults)


def recording_beats(recording: Recording, beats: str) -> BeatTrack:
    """Beats of a recording's music on the audio time line.

    Parameters
    ----------
    recording : Recording
    beats : "annotated" or "tracked"
        Annotated beats take their strengths from the music's onsets; tracked ones are the clip's `music_beats`.

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
        duration = max(clip.audio.duration, float(annotation.times[-1]) + 1e-3)
        strengths = np.maximum(beat_strengths(clip.audio, annotation.times), 0.0)
        return replace(annotation.track(duration), strengths=strengths if strengths.any() else annotation.times * 0 + 1)
    return music_beats(replace(clip, beats=None))
