"""A motion file as it was read: the motion, the kind of file, and a sentence for each thing that the file leaves open.

Units and axes that a file does not tell are guessed from the body, and every guess is one of the sentences.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from harmolab.io.files import MissingFrameRate, PathLike
from harmolab.types import FloatArray, Motion

UPRIGHT = 0.8  # share of the way from feet to head that lies along one axis, before that axis counts as up
# Largest extent of a body, in units of its file, that is read as metres, centimetres and millimetres.
EXTENTS = ((10.0, 1.0, "metres"), (400.0, 0.01, "centimetres"), (4000.0, 0.001, "millimetres"))
_HEAD = re.compile(r"head|nose|skull|^[lr][fb]hd", re.IGNORECASE)
_FEET = re.compile(r"foot|toe|ankle|heel|^[lr](ank|hee)", re.IGNORECASE)


@dataclass(frozen=True)
class ReadingOptions:
    """Answers to what a motion file may leave open.

    Parameters
    ----------
    fps : float or None, frames per second; in place of the file's own
    scale : float or None, metres in one unit of the file
    joints : names to keep; None for all
    smpl : path of the user's own SMPL body (`.npz`), or None
    up : "y" or "z", the axis of the file that points up; "" where the file or its body says it
    """

    fps: float | None = None
    scale: float | None = None
    joints: Sequence[str] | None = field(default=None)
    smpl: PathLike | None = None
    up: str = ""

    def __post_init__(self) -> None:
        if self.up not in ("", "y", "z"):
            raise ValueError(f"up must be y or z, the axis that points up, got {self.up!r}")

    def rate(self, own: float | None = None, hint: str = "") -> float:
        """The rate passed, else the file's `own`; `MissingFrameRate` without either, with a `hint` for people."""
        if self.fps is None and own is None:
            raise MissingFrameRate(f"holds no frame rate; pass fps, such as --fps 25{hint}")
        return float(own if self.fps is None else self.fps)  # type: ignore[arg-type]  # one of them is there

    def check_no_body(self) -> None:
        """ValueError where an SMPL body was passed for a file that holds no SMPL parameters."""
        if self.smpl is not None:
            raise ValueError("holds no SMPL parameters; leave out smpl (--smpl)")


class MotionFile(NamedTuple):
    """A motion and how it was read: the `kind` of its file, and `notes`, one sentence each."""

    motion: Motion
    kind: str
    notes: tuple[str, ...] = ()


def turned_upright(positions: FloatArray, up: str) -> FloatArray:
    """Positions (..., 3) with y up: of "z", the body turned by a quarter about x, so that it stays right-handed.

    >>> turned_upright(np.array([1.0, 2.0, 3.0]), "z")
    array([ 1.,  3., -2.])
    """
    return np.stack([positions[..., 0], positions[..., 2], -positions[..., 1]], axis=-1) if up == "z" else positions


def stated_up(positions: FloatArray, own: str, reason: str, options: ReadingOptions) -> tuple[FloatArray, str]:
    """Positions with y up and a sentence, where the kind of file fixes its axis; the option goes before."""
    up, why = (options.up, "as passed") if options.up else (own, reason)
    return turned_upright(positions, up), f"{up} up ({why}){', turned to y up' if up == 'z' else ''}"


def guessed_up(positions: FloatArray, names: Sequence[str], options: ReadingOptions) -> tuple[FloatArray, str]:
    """Positions with y up and a sentence, where nothing in the file tells: the way from feet to head decides.

    ValueError where that way leads along neither y nor z, or joints are not named so, and the option is not passed.
    """
    if options.up:
        return stated_up(positions, "", "", options)
    head = [joint for joint, name in enumerate(names) if _HEAD.search(name.rpartition(":")[2])]
    feet = [joint for joint, name in enumerate(names) if _FEET.search(name.rpartition(":")[2])]
    if head and feet:
        way = np.median(positions[:, head].mean(axis=1) - positions[:, feet].mean(axis=1), axis=0)
        for axis, up in ((1, "y"), (2, "z")):
            if np.isfinite(way).all() and way[axis] > UPRIGHT * np.linalg.norm(way):
                reason = f"guessed: the head is {way[axis]:.2f} m from the feet along {up}, median; --up overrules it"
                return stated_up(positions, up, reason, options)
    raise ValueError("does not tell which axis points up, nor does the body; pass up, as in --up z")


def metre_factor(positions: FloatArray, options: ReadingOptions) -> tuple[float, str]:
    """Metres in one unit of positions (T, J, 3) and a sentence on it, by the extent of the body.

    ValueError for an extent that no body has in any of these units.
    """
    if options.scale is not None:
        return options.scale, f"{options.scale:g} m a unit (as passed)"
    extent = float(np.median(np.ptp(positions, axis=1).max(axis=1)))
    for limit, factor, unit in EXTENTS:
        if extent <= limit:
            return factor, f"{unit} (guessed: the body extends over {extent:.3g} units; --scale overrules it)"
    raise ValueError(f"has a body that extends over {extent:.3g} units; pass scale, the metres in one of them")


def as_read(motion: Motion, kind: str, options: ReadingOptions, *notes: str) -> MotionFile:
    """A motion whose kind is y up; with the option, turned."""
    options.check_no_body()
    if not options.up:
        return MotionFile(motion, kind, notes)
    if motion.positions.shape[2] != 3:
        raise ValueError("holds image coordinates, in which y points down; leave out up")
    positions, note = stated_up(motion.positions, "", "", options)
    return MotionFile(Motion(positions, motion.fps, motion.skeleton, motion.valid), kind, (*notes, note))
