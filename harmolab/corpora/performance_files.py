"""The files of a musician's performance: which of a folder's are the sound, the points and the notes.

======================  ==============================================================================================
sound                   ``audio.wav`` (.flac, .ogg, .mp3); else the only sound file; else the sound of the only video
points                  ``motion.npz`` of ours; else the only file of key points (.json, .jsonl), or the only folder of
                        OpenPose's frames (``*_keypoints.json``), which may be this one
``notes.csv``           optional; see `harmolab.io.notes`. A folder without sound must have it
``performance.json``    optional; an object with any of the fields below
======================  ==============================================================================================

==============  ======================================================================================================
``instrument``  "piano" or "violin"; else it is the word in the folder's name, or in that of the folder above
``fps``         frames per second of the points, where their file does not hold it; else that of the only video
``size``        [width, height] of the picture, pixels; for MediaPipe's files that do not hold it
``mirrored``    true where the picture is a mirror image (`harmolab.io.player_keypoints`)
``offset_s``    seconds, audio time of the first frame; else what motion.npz holds, else 0
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
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from harmolab.io.files import MAX_TEXT_BYTES, read_json, reading
from harmolab.io.player_layouts import checked_size
from harmolab.io.player_points import INSTRUMENTS
from harmolab.io.video import is_video

ABOUT, MOTION, NOTES = "performance.json", "motion.npz", "notes.csv"
SOUNDS = (".wav", ".flac", ".ogg", ".mp3")
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
            _FIELDS[name](name, value)
        return about


def _text(name: str, value: Any) -> None:
    if not isinstance(value, str):
        raise ValueError(f"{name} must be text, got {str(value)[:30]!r}")


def _truth(name: str, value: Any) -> None:
    if not isinstance(value, bool):
        raise ValueError(f"{name} must be true or false, got {str(value)[:30]!r}")


def _number(name: str, value: Any) -> None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or abs(value) > 36_000:
        raise ValueError(f"{name} must be a number, got {str(value)[:30]!r}")


def _instrument(name: str, value: Any) -> None:
    if value not in INSTRUMENTS:
        raise ValueError(f"{name} must be {' or '.join(INSTRUMENTS)}, got {str(value)[:30]!r}")


def _file_name(name: str, value: Any) -> None:
    _text(name, value)
    if not 0 < len(value) <= _LONGEST_NAME or PurePath(value).is_absolute() or ".." in PurePath(value).parts:
        raise ValueError(f"{name} must be a name inside of the folder, got {value[:60]!r}")


def _file_names(name: str, value: Any) -> None:
    for one in value if isinstance(value, list) and value else [value]:
        _file_name(name, one)


_FIELDS: dict[str, Callable[[str, Any], object]] = {
    "instrument": _instrument,
    "fps": _number,
    "size": lambda name, value: checked_size(value),
    "mirrored": _truth,
    "offset_s": _number,
    "piece": _text,
    "audio": _file_name,
    "points": _file_names,
    "rendered": _truth,
    "name": _text,
    "source": _text,
    "comment": lambda name, value: None,
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
        _points(folder, about.get("points"), children),
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


def _points(folder: Path, names: str | list[str] | None, children: list[Path]) -> tuple[Path, ...]:
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
