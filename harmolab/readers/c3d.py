"""Markers of a c3d file to Motion, through the library ezc3d: `pip install ezc3d`.

Markers become joints without bones. Left out are angles, forces, moments, powers and scalars that a model wrote beside
them, and unlabelled pieces of tracks (``*12`` in Vicon's files, ``Unlabeled 12`` in OptiTrack's), unless
there are no others. The unit is that of ``POINT:UNITS``, the rate that of ``POINT:RATE``. A missing marker is filled
in, and its frame marked not valid, as hidden joints of key points are (`harmolab.readers.keypoints`). The axis that
points up is that of ``POINT:Y_SCREEN``; where a file has none, the markers of head and feet tell, else it must be
passed.
"""

import io
import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.body.skeletons import Skeleton, joint_indices, skeleton_part
from harmolab.files import PathLike, reading
from harmolab.readers.arrays import check_joints, checked_motion, in_metres
from harmolab.readers.keypoints import filled_body
from harmolab.readers.motion_file import Assumption, MotionFile, ReadingOptions, upright
from harmolab.types import BoolArray, FloatArray

UNITS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "meters": 1.0, "metres": 1.0}
SECONDS = 20.0  # that reading may take, and one more for every `BYTES_A_SECOND`
BYTES_A_SECOND = 4 * 2**20
MARK = 0x50  # second byte of every c3d file
UNLABELLED = re.compile(r"(.*:)?(\*\d+$|unlabell?ed)", re.IGNORECASE)  # perhaps after the name of a subject


def load_c3d(path: PathLike, options: ReadingOptions) -> MotionFile:
    """The markers of a c3d file, in metres, y up.

    Parameters
    ----------
    path : str or path
    options : ReadingOptions; `joints` leaves out markers that are never there

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError also where ezc3d is not installed, a marker is never there, the unit or the axis
        that points up is not told, or reading takes longer than its size warrants.
    """
    with reading(path, "a c3d motion") as file:
        if find_spec("ezc3d") is None:
            raise ValueError("to read c3d, install ezc3d: pip install ezc3d")
        options.check_no_body()
        arrays = _content(file)
        points, present = _points(arrays)
        names = _names(arrays["labels"].ravel().tolist(), points.shape[1])
        tracks = [name for name in names if name not in set(arrays["outputs"].tolist())]
        markers = [name for name in tracks if not UNLABELLED.match(name)] or tracks
        if not markers:
            raise ValueError("holds no markers: all of its points are angles, forces and the like")
        keep = joint_indices(Skeleton(names, (-1,) * len(names)), markers if options.joints is None else options.joints)
        skeleton = skeleton_part(Skeleton(names, (-1,) * len(names)), keep)
        filled, valid = filled_body(points[:, keep], present[:, keep], skeleton)
        factor, unit = _unit(str(arrays["units"]), options)
        places, up = _upright(in_metres(filled, factor), skeleton.joints, str(arrays["y_screen"]), options)
        own = arrays["rate"].item() if arrays["rate"].size == 1 and arrays["rate"].item() > 0 else None
        notes = [unit, up]
        if (others := [name for name in names if name not in markers]) and options.joints is None:
            kind = f"no {'labelled ' * (len(markers) < len(tracks))}markers"
            reason = f"that are {kind}: {', '.join(others[:3])}{', ...' * (len(others) > 3)}"
            notes.append(Assumption(f"{len(others)} points left out {reason}", f"points left out: {kind}"))
        return MotionFile(checked_motion(places, options.rate(own), skeleton, valid), "c3d markers", tuple(notes))


def _content(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays that another process reads from a file (`harmolab.readers.c3d_child`)."""
    head = np.fromfile(file, "<u2", 5)
    if not head.size or head[0] >> 8 != MARK:
        raise ValueError("is no c3d file: it does not begin as one")
    command = [sys.executable, "-P", str(Path(__file__).with_name("c3d_child.py")), str(file.resolve())]
    limit = SECONDS + file.stat().st_size / BYTES_A_SECOND
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit, stdin=subprocess.DEVNULL, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"is damaged: it cannot be read in {limit:.0f} s") from None
    if done.returncode:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise ValueError(f"is damaged, ezc3d says: {lines[-1][:200] if lines else f'stopped by {-done.returncode}'}")
    arrays = dict(np.load(io.BytesIO(done.stdout), allow_pickle=False))
    # ezc3d does not notice that frames are missing; the number of the last one ends at 65535, and may be off by one.
    count = arrays["points"].shape[-1]
    stated, swapped = (int(words[4]) - int(words[3]) + 1 for words in (head, head.byteswap()))
    if count < stated - 1 and abs(count - swapped) > 1 and head[4] < 65535:
        raise ValueError(f"is cut off or damaged: {count} of {stated} frames are there; copy it again")
    return arrays


def _points(arrays: dict[str, NDArray[Any]]) -> tuple[FloatArray, BoolArray]:
    """Places (T, J, 3) and the mask (T, J) of those that are there: finite, with a residual that is not negative."""
    points, residuals = arrays["points"].transpose(2, 1, 0), arrays["residuals"].T
    if not points.size or points.shape[2] != 3 or residuals.shape != points.shape[:2]:
        raise ValueError(f"holds no markers: its points have shape {points.shape}")
    check_joints(points.shape[1])
    return points.astype(np.float64), np.isfinite(points).all(axis=2) & (residuals >= 0)


def _names(labels: list[str], count: int) -> tuple[str, ...]:
    """A name for each of `count` markers."""
    return tuple(label.strip() or f"marker_{place}" for place, label in enumerate([*labels, *[""] * count][:count]))


def _unit(unit: str, options: ReadingOptions) -> tuple[float, str]:
    """Metres in one unit, and a sentence."""
    if options.scale is not None:
        return options.scale, f"{options.scale:g} m a unit (as passed)"
    if (factor := UNITS.get(unit.strip().lower())) is None:
        raise ValueError(f"has points in {unit[:20]!r}; pass scale, the metres in one of them (--scale 0.001)")
    return factor, f"in {unit.strip()} (POINT:UNITS)"


def _upright(places: FloatArray, names: Sequence[str], screen: str, options: ReadingOptions) -> tuple[FloatArray, str]:
    """Places with y up, and a sentence."""
    own = axis if (axis := screen.strip().lower().removeprefix("+")) in ("y", "z") else ""
    return upright(places, () if own else names, options, own, "POINT:Y_SCREEN of the file", is_needed=True)
