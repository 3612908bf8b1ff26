"""A corpus of takes on disk: names, tempi and sizes in ``model.json``, movement and beats in ``model.npz`` beside it.

==============  =======================================================================================
name            shape and type, and meaning
==============  =======================================================================================
``positions``   (F, J, 3) 16-bit integers: millimetres, of all takes one after the other. The first two
                frames of a take are places; of the others the second differences are kept, which zip
                well: the place of every joint comes back to the millimetre.
``valid``       (F,) bool, False for filler frames
``beats``       (B,) numbers, seconds from the first frame of their take
``places``      (B,) integers, place in the bar; -1 where unknown
==============  =======================================================================================

The JSON says how many frames and beats each take has. Nothing is unpickled, and nothing is unpacked whose size was not
compared before.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.io.arrays import checked_fps, read_npz
from harmolab.io.files import PathLike, atomic_write, reading
from harmolab.metrics.likeness import LikenessLimits
from harmolab.skeletons import tree_order
from harmolab.systems.choreographer.takes import FARTHEST, MILLIMETRE, Take
from harmolab.systems.common.about import (
    DEFAULT_STEM,
    FORMAT,
    json_file,
    read_about,
    stored_skeleton,
    weights_stem,
    write_synced,
)
from harmolab.types import Motion, Skeleton

CLASS = "Choreographer"
MOST_TAKES, MOST_BEATS, MOST_METER = 10_000, 1_000_000, 32
MOST_VALUES = 50_000_000  # 400 MB when they are read; six hours of 23 joints at 30 frames a second
_ARRAYS = {"positions": "i", "valid": "b", "beats": "f", "places": "i"}
_WHAT = "recorded movement of a choreographer"
Arrays = dict[str, NDArray[Any]]


class Kept(NamedTuple):
    """A corpus as it is kept: its takes, lines about what could not be read, limits of likeness of the takes."""

    takes: tuple[Take, ...]
    notes: tuple[str, ...] = ()
    limits: LikenessLimits | None = None


def save_takes(folder: PathLike, kept: Kept) -> None:
    """Write takes of one skeleton to a folder, made if need be; both files appear whole or not at all.

    Raises
    ------
    ValueError
        A joint jumps by more than 16 bits of millimetres hold.
    """
    stem, takes = Path(folder) / DEFAULT_STEM, kept.takes
    arrays = {
        "positions": np.concatenate([_packed(take) for take in takes]),
        "valid": np.concatenate([take.motion.valid for take in takes]),
        "beats": np.concatenate([take.beats for take in takes]),
        "places": np.concatenate([_places(take) for take in takes]).astype(np.int16),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    data = packed.getvalue()
    about = {
        "format": FORMAT,
        "harmolab": version("harmolab"),
        "system": "choreographer",
        "class": CLASS,
        "build": {"skeleton": asdict(takes[0].motion.skeleton), "takes": [_entry(take) for take in takes]},
        "sha256": hashlib.sha256(data).hexdigest(),
        "notes": list(kept.notes),
        "limits": None if kept.limits is None else kept.limits.to_dict(),
    }
    text = json.dumps(about, indent=1, allow_nan=False)
    stem.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(json_file(stem)) as text_part, atomic_write(_array_file(stem)) as array_part:
        write_synced(text_part, text.encode())
        write_synced(array_part, data)


def load_takes(path: PathLike) -> Kept:
    """The corpus that was saved in a folder.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file: it is not there, damaged, foreign, of another size than its description says, or holds
        what no recording holds.
    """
    stem = weights_stem(path)
    about = read_about(stem)
    file = _array_file(stem)
    with reading(file, _WHAT):
        if about.get("class") != CLASS:
            raise ValueError(f"holds a {about.get('class')}, not a {CLASS}")
        if hashlib.sha256(file.read_bytes()).hexdigest() != about.get("sha256"):
            raise ValueError(f"is not the file that {json_file(stem).name} describes (SHA-256 differs)")
        skeleton, entries = stored_skeleton(about["build"]), about["build"]["takes"]
        tree_order(skeleton.parents)
        shapes = _shapes(entries, len(skeleton.joints))
        arrays = _checked(read_npz(file, _ARRAYS), shapes)
        limits = None if about.get("limits") is None else LikenessLimits.from_dict(about["limits"])
        notes = tuple(str(line) for line in about.get("notes") or ())
        return Kept(_takes(arrays, entries, skeleton), notes, limits)


def _array_file(stem: Path) -> Path:
    return stem.with_name(f"{stem.name}.npz")


def _packed(take: Take) -> NDArray[np.int16]:
    """Positions (T, J, 3) of a take, as they are kept."""
    places = np.round(take.motion.positions / MILLIMETRE).astype(np.int64)
    places[2:] = np.diff(places, n=2, axis=0)
    if np.abs(places).max() > np.iinfo(np.int16).max:
        raise ValueError(f"{take.name}: a joint jumps by more than {FARTHEST:g} m from one frame to the next")
    return places.astype(np.int16)


def _unpacked(kept: NDArray[np.int16]) -> NDArray[np.float64]:
    """Positions (T, J, 3) in metres, of `_packed`."""
    steps = kept[1:].astype(np.int64)
    steps[0] -= kept[0]
    places = np.concatenate([kept[:1].astype(np.int64), np.cumsum(steps, axis=0)])
    return np.cumsum(places, axis=0) * MILLIMETRE


def _places(take: Take) -> NDArray[np.int64]:
    return take.places if take.places.size else np.full(take.beats.size, -1)


def _entry(take: Take) -> dict[str, Any]:
    """The entry of a take in the JSON."""
    motion = take.motion
    counts = {"frames": motion.n_frames, "beats": take.beats.size}
    return {"name": take.name, "dance": take.dance, "fps": motion.fps, "meter": take.meter, **counts}


def _shapes(entries: Any, joints: int) -> dict[str, tuple[int, ...]]:
    """The shapes of the arrays that entries promise; ValueError for those that no corpus has."""
    if not isinstance(entries, list) or not 1 <= len(entries) <= MOST_TAKES:
        raise ValueError(f"describes no list of 1 to {MOST_TAKES} recordings")
    frames = sum(_count(entry, "frames", 2, 2**31) for entry in entries)
    beats = sum(_count(entry, "beats", 0, MOST_BEATS) for entry in entries)
    if frames * joints * 3 > MOST_VALUES:
        raise ValueError(f"describes {frames} frames of {joints} joints, more than {MOST_VALUES} numbers")
    return {"positions": (frames, joints, 3), "valid": (frames,), "beats": (beats,), "places": (beats,)}


def _checked(arrays: Arrays, shapes: dict[str, tuple[int, ...]]) -> Arrays:
    """The arrays; ValueError unless they are of these shapes and hold what a corpus may hold."""
    for name, shape in shapes.items():
        if name not in arrays:
            raise ValueError(f"has no array {name!r}")
        if arrays[name].shape != shape:
            raise ValueError(f"{name} has shape {arrays[name].shape}; its description calls for {shape}")
    if arrays["positions"].dtype != np.int16:
        raise ValueError(f"positions must be 16-bit integers, got {arrays['positions'].dtype}")
    if not -1 <= arrays["places"].min(initial=0) <= arrays["places"].max(initial=0) < MOST_METER:
        raise ValueError(f"places in the bar must lie between -1 and {MOST_METER - 1}")
    return arrays


def _count(entry: Any, name: str, least: int, most: int) -> int:
    """A whole number of an entry."""
    value = entry.get(name) if isinstance(entry, dict) else None
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ValueError(f"describes {name} = {str(value)[:40]}; a whole number from {least} to {most} is needed")
    return value


def _takes(arrays: Arrays, entries: list[dict[str, Any]], skeleton: Skeleton) -> tuple[Take, ...]:
    """The takes that the entries describe, out of checked arrays."""
    takes, frame, beat = [], 0, 0
    for entry in entries:
        frames, beats = slice(frame, frame + entry["frames"]), slice(beat, beat + entry["beats"])
        positions, fps = _unpacked(arrays["positions"][frames]), checked_fps(entry["fps"])
        if np.abs(positions).max() > FARTHEST + 1:
            raise ValueError(f"{str(entry.get('name'))[:40]}: joints are over {FARTHEST:g} m away: damaged")
        motion = Motion(positions, fps, skeleton, arrays["valid"][frames])
        takes.append(_take(entry, motion, arrays["beats"][beats].astype(np.float64), arrays["places"][beats]))
        frame, beat = frames.stop, beats.stop
    return tuple(takes)


def _take(entry: dict[str, Any], motion: Motion, times: NDArray[np.float64], places: NDArray[Any]) -> Take:
    """One take; ValueError where its beats are no beats of it."""
    meter = _count(entry, "meter", 0, MOST_METER)
    last = (motion.n_frames - 1) / motion.fps
    steps_ok = bool(np.isfinite(times).all() and (np.diff(times) > 0).all())
    if not steps_ok or times.size == 1 or (times.size and not (times[0] >= 0 and times[-1] <= last + 1e-6)):
        raise ValueError(f"{str(entry.get('name'))[:40]}: beats must be two or more, rising from 0 to {last:g} s")
    is_placed = bool(times.size and (places >= 0).all() and meter > 0 and (places < meter).all())
    if not math.isfinite(motion.fps) or (times.size and not is_placed and (places >= 0).any()):
        raise ValueError(f"{str(entry.get('name'))[:40]}: places in the bar do not fit its {meter} beats")
    bar_places = places.astype(np.int64) if is_placed else np.zeros(0, np.int64)
    return Take(str(entry["name"]), motion, str(entry["dance"]), times, bar_places, meter)
