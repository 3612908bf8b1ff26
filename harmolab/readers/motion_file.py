"""A motion file as it was read: the motion, the kind of file, and a sentence for each thing that the file leaves open.

Units and axes that a file does not tell are guessed from the body, and every guess is one of the sentences: an
`Assumption`, which commands print beside what they compute.
"""

import logging
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np

from harmolab.files import MissingFrameRate, PathLike
from harmolab.types import FloatArray, Motion

LOG = logging.getLogger(__name__)
UPRIGHT = 0.8  # share of the way from feet to head that lies along one axis, before that axis counts as up
# Largest extent of a body, in units of its file, that is read as metres, centimetres and millimetres.
EXTENTS = ((10.0, 1.0, "metres"), (400.0, 0.01, "centimetres"), (4000.0, 0.001, "millimetres"))
_HEAD = re.compile(r"head|nose|skull|neck\d*_end|^[lr][fb]hd", re.IGNORECASE)  # also the End Site of a neck
_FEET = re.compile(r"foot|toe|ankle|heel|^[lr](ank|hee)", re.IGNORECASE)


class Assumption(str):
    """A sentence on what a file does not tell, and `brief`, the same in a few words and without numbers of this file.

    >>> Assumption("metres (guessed: the body extends over 1.7 units)", "unit guessed: metres").brief
    'unit guessed: metres'
    """

    brief: str

    def __new__(cls, sentence: str, brief: str) -> "Assumption":
        self = super().__new__(cls, sentence)
        self.brief = brief
        return self


class ReadingKeywords(TypedDict, total=False):
    """Fields of `ReadingOptions`, as keywords of the functions that hand them on."""

    fps: float | None
    scale: float | None
    joints: Sequence[str] | None
    smpl: PathLike | None
    up: str


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
    as_defaults : `fps`, `smpl` and `up` count only where a file leaves them open, as for folders of many kinds
    """

    fps: float | None = None
    scale: float | None = None
    joints: Sequence[str] | None = None
    smpl: PathLike | None = None
    up: str = ""
    as_defaults: bool = False

    def __post_init__(self) -> None:
        if self.up not in ("", "y", "z"):
            raise ValueError(f"up must be y or z, the axis that points up, got {self.up!r}")

    def rate(self, own: float | None = None, hint: str = "") -> float:
        """The rate passed, else the file's `own`; `MissingFrameRate` without either, whose `hint` names one.

        As a default, the rate passed comes second. Where it takes the place of another, the log says both.
        """
        first, second = (own, self.fps) if self.as_defaults else (self.fps, own)
        if (rate := second if first is None else first) is None:
            raise MissingFrameRate(f"holds no frame rate; pass fps, {hint or 'such as --fps 25'}")
        if isinstance(second, float | int) and not (self.as_defaults or math.isclose(rate, second, rel_tol=1e-3)):
            LOG.info("--fps %g takes the place of the file's own %g frames a second", rate, second)
        return float(rate)

    def check_no_body(self) -> None:
        """ValueError where an SMPL body was passed, and not as a default, for a file without SMPL parameters."""
        if self.smpl is not None and not self.as_defaults:
            raise ValueError("holds no SMPL parameters; leave out smpl (--smpl)")


class MotionFile(NamedTuple):
    """A motion and how it was read: the `kind` of its file, and `notes`, one sentence each."""

    motion: Motion
    kind: str
    notes: tuple[str, ...] = ()

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """The notes on what was guessed, assumed or left out."""
        return tuple(note for note in self.notes if isinstance(note, Assumption))


def same_dance(motion: Path, endings: Sequence[str]) -> Path | None:
    """The file beside a motion with its name and an ending before its own in `endings`: the same dance; else None."""
    before = endings[: endings.index(motion.suffix.lower())] if motion.is_file() else ()
    return next(filter(Path.is_file, map(motion.with_suffix, before)), None)


def turned_upright(positions: FloatArray, up: str) -> FloatArray:
    """Positions (..., 3) with y up: of "z" turned by a quarter about x, of "-y" by a half, so that sides stay.

    >>> turned_upright(np.array([1.0, 2.0, 3.0]), "z")
    array([ 1.,  3., -2.])
    """
    if up == "-y":
        return positions * [1.0, -1.0, -1.0]
    return np.stack([positions[..., 0], positions[..., 2], -positions[..., 1]], axis=-1) if up == "z" else positions


def head_above_feet(positions: FloatArray, names: Sequence[str]) -> FloatArray | None:
    """The way from the feet to the head in each frame, (T, 3) of positions (T, J, 3); None where no names say them."""
    head = [joint for joint, name in enumerate(names) if _HEAD.search(name.rpartition(":")[2])]
    feet = [joint for joint, name in enumerate(names) if _FEET.search(name.rpartition(":")[2])]
    if not (head and feet):
        return None
    way: FloatArray = positions[:, head].mean(axis=1) - positions[:, feet].mean(axis=1)
    return way


def upright(
    positions: FloatArray,
    names: Sequence[str],
    options: ReadingOptions,
    own: str = "",
    reason: str = "",
    *,
    is_needed: bool = False,
) -> tuple[FloatArray, str]:
    """Positions (T, J, 3) with y up, and a sentence on what tells the axis: the first of these four that does.

    1. The option; passed as a default, only where the kind of file has no axis of its `own`.
    2. The way from feet to head, of joints with these `names`, unless it leads along the kind's own axis. It may lead
       along y or z and, where the kind has no axis, down along y, as a camera's does: "-y" up.
    3. The kind's own axis, for a `reason`.
    4. y, as most are, is assumed.

    Raises
    ------
    ValueError
        The axis `is_needed`, and none of the first three tells it.
    """
    (way, length), doubt = _way_up(positions, names), ""
    if options.up and not (own and options.as_defaults):
        up, why = options.up, "as passed"
    elif way in ({"y", "z"} - {own} if own else {"y", "z", "-y"}):
        up, doubt, why = way, "guessed", f"the head is {length:.2f} m from the feet along {way}, median"
    elif own:
        up, why = own, reason
    elif is_needed:
        raise ValueError("does not tell which axis points up, nor does the body; pass up, as in --up z")
    else:
        up, doubt, why = "y", "assumed", "the body does not tell"
    turned, places = ", turned to y up" if up != "y" else "", turned_upright(positions, up)
    if doubt:
        return places, Assumption(f"{up} up ({doubt}: {why}; --up overrules it){turned}", f"axis {doubt}: {up} up")
    return places, f"{up} up ({why}){turned}"


def _way_up(positions: FloatArray, names: Sequence[str]) -> tuple[str, float]:
    """The axis along which the head is above the feet, median, and how far; "" where it is none or nothing tells."""
    ways = head_above_feet(positions, names)
    way = np.zeros(3) if ways is None or not len(ways) else np.median(ways, axis=0)
    rows = (("y", way[1]), ("z", way[2]), ("-y", -way[1]))
    return next(((up, float(part)) for up, part in rows if part > UPRIGHT * np.linalg.norm(way)), ("", 0.0))


def metre_factor(positions: FloatArray, options: ReadingOptions) -> tuple[float, str]:
    """Metres in one unit of positions (T, J, 3) and a sentence on it, by the extent of the body.

    ValueError for an extent that no body has in any of these units.
    """
    if options.scale is not None:
        return options.scale, f"{options.scale:g} m a unit (as passed)"
    extent = float(np.median(np.ptp(positions, axis=1).max(axis=1)))
    for limit, factor, unit in EXTENTS:
        if extent <= limit:
            reason = f"guessed: the body extends over {extent:.4g} units; --scale overrules it"
            return factor, Assumption(f"{unit} ({reason})", f"unit guessed: {unit}")
    raise ValueError(f"has a body that extends over {extent:.0f} units; pass scale, the metres in one of them")


def as_read(motion: Motion, kind: str, options: ReadingOptions, *notes: str, is_open: bool = False) -> MotionFile:
    """A motion whose kind is y up by its definition or, where that `is_open`, `upright`; with the option, turned."""
    options.check_no_body()
    if not is_open and (not options.up or options.as_defaults):
        return MotionFile(motion, kind, notes)
    if motion.positions.shape[2] != 3:
        raise ValueError("holds image coordinates, in which y points down; leave out up")
    positions, note = upright(motion.positions, motion.skeleton.joints, options)
    if positions is not motion.positions:
        motion = Motion(positions, motion.fps, motion.skeleton, motion.valid)
    return MotionFile(motion, kind, (*notes, note))
