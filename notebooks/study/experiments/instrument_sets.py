"""Sets of musicians' performances in their own layouts; none of them is part of this project.

pianomime
    Fingertips and wrists of pianists with all notes and no sound, as a folder of ``clips.csv`` (clip, piece, ...) and a
    ``clip_NNN.npz`` each: positions in tenths of a millimetre (T, 12, 3), notes, pressed. Its authors tracked them from
    videos of a keyboard seen from above (repository sNiper-Qian/pianomime). x is right along the keys and 0 in the
    middle of the keyboard, y is depth and larger towards the player: a picture from above. **z is not measured** but
    has a few fixed levels, and a fingertip that presses a key was put on the key's middle, so neither z nor a strike is
    evidence of anything; z is not read.
tracked
    Single videos tracked with MediaPipe: body, hands or both, in pixels.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.files import MAX_TEXT_BYTES, SOUNDS, Arrays, PathLike, read_columns, reading
from harmolab.musician.keypoints import player_points
from harmolab.musician.performances import Performance
from harmolab.readers.arrays import checked_motion, read_npz
from harmolab.readers.audio import load_audio
from harmolab.readers.player_points import HANDS_12, SIDES, hand_joints
from harmolab.types import FloatArray, Notes

PIANOMIME, TRACKED = "pianomime", "tracked"

_CLIP = {"positions_tenth_mm": "i", "fps": "f", "joints": "U", "notes": "f"}
_TRACK = {"body": "f", "visibility": "f", "joints": "U", "left_hand": "f", "right_hand": "f", "fps": "f", "notes": "f"}
_FINGERS = {"wrist": "hand"} | {finger: f"{finger}_4" for finger in ("thumb", "index", "middle", "ring", "little")}
_GRID = 3  # decimals of the seconds of a note: they are multiples of 0.05 s in single precision
# The same performance as a clip of pianomime: one piece, so that it stays on that side of a split.
_TWINS = {"piano_top_view": "clip_186"}


def load_pianomime(folder: PathLike) -> list[Performance]:
    """All clips of pianomime, in the order of its clips.csv; `audio` is None until it is rendered from the notes.

    Points are those of `HANDS_12`, in millimetres, (x, depth). Notes have hands, and no loudness (1).

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    folder = Path(folder)
    return [_pianomime_clip(folder / f"{name}.npz", piece) for name, piece in _pieces(folder / "clips.csv").items()]


def _pieces(table: Path) -> dict[str, str]:
    """Clip of pianomime -> its piece."""
    with reading(table, "a table of clips", max_bytes=MAX_TEXT_BYTES):
        columns = read_columns(table, ("clip", "piece"))
        if bad := [name for name in columns["clip"] if not re.fullmatch(r"[\w-]{1,80}", name)]:
            raise ValueError(f"names a clip {bad[0][:30]!r}; a name has letters, digits, _ and - only")
    return dict(zip(columns["clip"], columns["piece"], strict=True))


def _pianomime_clip(path: Path, piece: str) -> Performance:
    """One clip of pianomime."""
    with reading(path, "a clip of pianomime"):
        arrays = _members(path, _CLIP, ("positions_tenth_mm", "fps", "joints", "notes"))
        tenths, names = arrays["positions_tenth_mm"], tuple(map(_pianomime_name, arrays["joints"].ravel().tolist()))
        if names != HANDS_12.joints or tenths.shape[1:] != (len(names), 3):
            raise ValueError(f"has points {names[:3]} ... of shape {tenths.shape}; 12 of both hands are needed")
        motion = checked_motion(tenths[..., :2] / 10.0, _rate(arrays), HANDS_12)
        about: dict[str, Any] = {"piece": f"{PIANOMIME}_{piece}", "source": PIANOMIME}
        return Performance(path.stem, "piano", None, motion, notes=_notes(arrays["notes"], hand=3), **about)


def _pianomime_name(name: str) -> str:
    """The name in `HANDS_12` of one of pianomime's points: left_thumb_4 for l_thumb."""
    letter, _, part = name.partition("_")
    return f"{dict(zip('lr', SIDES, strict=True)).get(letter, letter)}_{_FINGERS.get(part, part)}"


def load_tracked(path: PathLike, *, extras: Sequence[str] = ()) -> Performance:
    """A tracked video: points in pixels with the mask of what was detected, its sound and notes where there are any.

    Parameters
    ----------
    path : str or path of an .npz with "body" (T, P, 2), "joints" and "visibility" (T, P), "left_hand" and "right_hand"
        (T, 21, 2), "notes" (N, 4) of onset, offset, MIDI and velocity, or some of these, and "fps"; sound of the same
        name stands beside it. "pian" or "violin" in its name tells the instrument. NaN is not detected.
    extras : of "nose" and "neck", those to keep

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    path = Path(path)
    instrument = next((name for word, name in (("pian", "piano"), ("violin", "violin")) if word in path.stem), "")
    with reading(path, "tracked points"):
        if not instrument:
            raise ValueError('has neither "pian" nor "violin" in its name')
        arrays = _members(path, _TRACK, ("fps",))
        values, names = _tracked_points(arrays)
        points = player_points(values, names, _rate(arrays), extras=extras)
        notes = _notes(arrays["notes"], velocity=3) if "notes" in arrays else None
    sound = next((file for suffix in SOUNDS if (file := path.with_suffix(suffix)).is_file()), None)
    audio = None if sound is None else load_audio(sound, sample_rate=44100.0)
    about: dict[str, Any] = {"piece": _tracked_piece(path), "source": TRACKED}
    return Performance(path.stem, instrument, audio, points.motion, points.detected, notes, **about)


def _tracked_points(arrays: Arrays) -> tuple[FloatArray, tuple[str, ...]]:
    """(T, P, 3) x, y, confidence of body and hands, and their names."""
    parts: list[FloatArray] = []
    names: list[str] = []
    if "body" in arrays:
        body, joints = arrays["body"], tuple(map(str, arrays.get("joints", np.array([])).ravel().tolist()))
        parts.append(_confident(body, arrays.get("visibility"), len(joints), "body"))
        names += joints
    for side in SIDES:
        if (key := f"{side}_hand") in arrays:
            parts.append(_confident(arrays[key], None, len(hand_joints(side)), key))
            names += hand_joints(side)
    if not parts or len({len(part) for part in parts}) > 1:
        raise ValueError("has no body and no hands, or not as many frames of each")
    return np.concatenate(parts, axis=1), tuple(names)


def _confident(points: Any, visibility: Any, count: int, name: str) -> FloatArray:
    """(T, count, 3) of (T, count, 2) points; confidence 1 where no visibility is known, 0 where a place is NaN."""
    if points.ndim != 3 or points.shape[1:] != (count, 2):
        raise ValueError(f"{name} must have shape (frames, {count}, 2), got {points.shape}")
    sure = np.ones(points.shape[:2]) if visibility is None else visibility
    if sure.shape != points.shape[:2]:
        raise ValueError(f"visibility must have shape {points.shape[:2]}, got {sure.shape}")
    sure = np.where(np.isnan(points).any(axis=2), 0.0, sure)
    return np.concatenate([points.astype(np.float64), sure[..., None]], axis=2)


def _tracked_piece(path: Path) -> str:
    """The piece of a tracked video: that of its twin in the set of pianomime beside it, else its own."""
    table = path.parent.parent / PIANOMIME / "clips.csv"
    if path.stem in _TWINS and table.is_file() and (twin := _pieces(table).get(_TWINS[path.stem])):
        return f"{PIANOMIME}_{twin}"
    return f"{TRACKED}_{path.stem}"


def _members(path: Path, kinds: dict[str, str], needed: Sequence[str]) -> Arrays:
    """The arrays of an .npz; ValueError names those that are missing."""
    arrays = read_npz(path, kinds)
    if missing := [name for name in needed if name not in arrays]:
        raise ValueError(f"has no array {' and no '.join(map(repr, missing))}")
    return arrays


def _rate(arrays: Arrays) -> float:
    if arrays["fps"].size != 1:
        raise ValueError(f"fps must be one number, got shape {arrays['fps'].shape}")
    return round(float(arrays["fps"].item()), 6)


def _notes(table: FloatArray, *, velocity: int | None = None, hand: int | None = None) -> Notes:
    """Notes of rows of onset, offset, MIDI and more, by onset; `velocity` and `hand` are numbers of columns."""
    if table.ndim != 2 or table.shape[1] < 4 or not np.isfinite(table).all():
        raise ValueError(f"notes must be rows of four finite numbers or more, got shape {table.shape}")
    if np.abs(table).max(initial=0.0) > 1e6:
        raise ValueError("notes hold numbers above a million: neither seconds nor keys")
    rows = table[np.argsort(table[:, 0], kind="stable")].astype(np.float64)
    loudness = np.ones(len(rows)) if velocity is None else rows[:, velocity] / 127
    hands = np.full(len(rows), -1) if hand is None else rows[:, hand].astype(np.int64)
    seconds = np.round(rows[:, :2], _GRID)
    return Notes(seconds[:, 0], seconds[:, 1], rows[:, 2].astype(np.int64), loudness, hands)
