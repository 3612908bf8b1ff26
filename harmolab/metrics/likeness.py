"""Does a dance move like recorded dancers? Thirteen measures, each beside what recordings had: the guard of a score.

A score of harmony asks whether movement and music agree, and a statue on a turntable may agree perfectly. So a dance is
asked first whether it is one. Nothing here hears music, and nothing was fitted: a limit is what the recordings at hand
had, with half as much again to spare.

======================================================  =====================  ============================
measure                                                 limit                  of
======================================================  =====================  ============================
spread, poorest, hands, steps, nearest, inside          least / 1.5            this dance, else all dances
ankles, jerk                                            least / 1.5            all dances
jerk, crossed, turns, skating, stride, knees            most * 1.5             all dances
======================================================  =====================  ============================

Dances of more than 30 s are measured in windows of 30 s that cover them evenly, and the worst window of each measure
counts: what stands still for half a minute has stopped dancing, however it went on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.io.files import read_json, reading
from harmolab.metrics.body_measures import LONGEST as LONGEST
from harmolab.metrics.body_measures import MEASURES as MEASURES
from harmolab.metrics.body_measures import SHORTEST, body_measures
from harmolab.skeletons import side_pairs
from harmolab.types import Motion

Range = tuple[float, float, float]  # minimum, median, maximum

MARGIN = 1.5  # how much less, or more, than any recording had
AMOUNTS = ("spread", "poorest", "hands", "steps", "nearest", "inside")
LOWER = (*AMOUNTS, "ankles", "jerk")
UPPER = ("jerk", "crossed", "turns", "skating", "stride", "knees")
HARDLY = 0.05  # share of a window by which a motion may be longer and still be one window
TOLD = 3  # failures that a verdict names
RECORDED = Path(__file__).with_name("likeness.json")

UNITS: Mapping[str, str] = MappingProxyType(
    {"spread": " cm", "poorest": " cm", "hands": " m", "steps": " a second", "nearest": " cm", "ankles": " m"}
    | {"jerk": " m/s³", "skating": " m/s", "stride": " m", "knees": "°"}
)
_TOO_LITTLE = {
    "spread": "the body hardly moves",
    "poorest": "the body rests for 5 s",
    "hands": "the hands hardly move",
    "steps": "hardly a step is taken",
    "nearest": "the same 2 s come again and again",
    "inside": "the body turns and travels as one piece",
    "ankles": "the feet stand too close together",
    "jerk": "the movement is too smooth",
}
_TOO_MUCH = {
    "jerk": "the movement is jerky",
    "crossed": "the legs are crossed too often",
    "turns": "the body turns round and round",
    "skating": "the standing feet slide",
    "stride": "the feet are too far apart",
    "knees": "the knees bend too far",
}


@dataclass(frozen=True)
class LikenessLimits:
    """Numbers of recorded dancers: minimum, median and maximum of each measure over windows of at most 30 s.

    Parameters
    ----------
    pooled : measure -> (minimum, median, maximum), all dances
    dances : name of a dance -> the same of that dance alone
    windows : int, how many there were
    """

    pooled: Mapping[str, Range]
    dances: Mapping[str, Mapping[str, Range]] = field(default_factory=dict)
    windows: int = 0

    def __post_init__(self) -> None:
        for ranges in (self.pooled, *self.dances.values()):
            _check_ranges(ranges)

    @classmethod
    def of(cls, motions: Iterable[Motion], dances: Sequence[str] | None = None) -> LikenessLimits:
        """The limits of recordings of your own, such as the corpus that a dance is made of.

        Parameters
        ----------
        motions : iterable of Motion, three-dimensional; those of less than 10 s are left out
        dances : names of their dances, "" where unknown; all unknown when left out

        Raises
        ------
        ValueError
            If none is long enough, one is two-dimensional, or `dances` does not fit.
        """
        motions = list(motions)
        names = [""] * len(motions) if dances is None else list(dances)
        return cls.of_windows([window_measures(motion) for motion in motions], names)

    @classmethod
    def of_windows(cls, recordings: Sequence[Sequence[Mapping[str, float]]], dances: Sequence[str]) -> LikenessLimits:
        """`of` recordings whose `window_measures` are known already; errors as there."""
        if len(recordings) != len(dances):
            raise ValueError(f"there are {len(recordings)} recordings and {len(dances)} names of dances")
        windows = [window for recording in recordings for window in recording]
        if not windows:
            raise ValueError(f"no recording has {SHORTEST:g} s of movement")
        by_dance = {
            dance: [
                window
                for recording, name in zip(recordings, dances, strict=True)
                if name == dance
                for window in recording
            ]
            for dance in sorted(set(dances) - {""})
        }
        return cls(
            _ranges(windows), {dance: _ranges(parts) for dance, parts in by_dance.items() if parts}, len(windows)
        )

    @classmethod
    @cache
    def recorded(cls) -> LikenessLimits:
        """The limits that are shipped: 46 windows of 23 recordings of cha-cha, rumba, tango and waltz."""
        with reading(RECORDED, "limits of likeness"):
            return cls.from_dict(read_json(RECORDED))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> LikenessLimits:
        """The limits in what `to_dict` gave; ValueError where it is something else."""
        try:
            dances = {str(name): _as_ranges(ranges) for name, ranges in content["dances"].items()}
            return cls(_as_ranges(content["pooled"]), dances, int(content["windows"]))
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"no limits of likeness: {error!r}") from None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for a JSON file, rounded to four digits."""
        return {
            "windows": self.windows,
            "pooled": _rounded(self.pooled),
            "dances": {name: _rounded(ranges) for name, ranges in self.dances.items()},
        }

    def reference(self, measure: str, dance: str = "") -> Range | None:
        """The recorded numbers that a measure is held against; None where there are none."""
        ranges = self.dances.get(dance, {}) if measure in AMOUNTS else {}
        return ranges.get(measure, self.pooled.get(measure))


@dataclass(frozen=True)
class Likeness:
    """The measures of a dance beside those of recordings, and what they say.

    Parameters
    ----------
    values : measure -> its number; of several windows the worst
    least, most : measure -> the limit below or above which it fails
    recorded : measure -> (minimum, median, maximum) that the limits come from
    windows : int, how many windows were measured
    cannot : str, why the dance cannot be judged at all; empty when it can
    """

    values: Mapping[str, float] = field(default_factory=dict)
    least: Mapping[str, float] = field(default_factory=dict)
    most: Mapping[str, float] = field(default_factory=dict)
    recorded: Mapping[str, Range] = field(default_factory=dict)
    windows: int = 0
    cannot: str = ""

    @property
    def fails(self) -> tuple[str, ...]:
        """The measures outside their limits, in the order of `MEASURES`."""
        return tuple(name for name in self.values if _excess(name, self.least, self.most, self.values[name]) > 1)

    @property
    def passed(self) -> bool | None:
        """True where every measure that was asked is within its limits; None where the dance cannot be judged."""
        return None if self.cannot else not self.fails

    @property
    def missing(self) -> tuple[str, ...]:
        """The measures that could not be asked: names of joints are missing, or recorded numbers."""
        return tuple(name for name in MEASURES if name not in self.values)

    @property
    def count(self) -> str:
        """The number of measures within their limits, of those asked: "13 of 13"."""
        return f"{len(self.values) - len(self.fails)} of {len(self.values)}"

    @property
    def verdict(self) -> str:
        """The result in plain words: "moves like recorded dancers (13 of 13 measures)", or what fails."""
        if self.cannot:
            return self.cannot
        if not self.fails:
            return f"moves like recorded dancers ({self.count} measures{self._unasked()})"
        faults = "; ".join(self.complaint(name) for name in self.fails[:TOLD])
        more = f"; {len(self.fails) - TOLD} more" if len(self.fails) > TOLD else ""
        return f"not meaningful: {faults}{more} ({self.count} measures pass{self._unasked()})"

    def complaint(self, measure: str) -> str:
        """The fault that a measure finds where it fails, with its number and the recorded range."""
        value, (low, _, high) = self.values[measure], self.recorded[measure]
        words = _TOO_LITTLE[measure] if value < self.least.get(measure, -math.inf) else _TOO_MUCH[measure]
        return f"{words} ({value:.3g}{UNITS.get(measure, '')}, recorded {low:.3g} to {high:.3g})"

    def harmony_text(self, score: float) -> str:
        """The words to print for the harmony of this dance, without the number where the dance fails."""
        if self.passed is False:
            return self.verdict
        return f"{score:.2f} ({self.verdict})"

    def _unasked(self) -> str:
        return f"; not asked: {', '.join(self.missing)}" if self.missing else ""


def likeness(motion: Motion, *, dance: str = "", limits: LikenessLimits | None = None) -> Likeness:
    """The measures of a dance beside those of recorded dancers; nothing is raised where there is nothing to judge.

    Parameters
    ----------
    motion : Motion, metres, y up
        Joints of its left and right hips (or shoulders) must be named so; without ankles, knees, hands or feet the
        measures that need them are left out, and the verdict says so.
    dance : str
        Amounts are held against recordings of this dance; against all where it is "" or has no recordings.
    limits : LikenessLimits
        The shipped ones of four ballroom dances when left out. For other styles take those of recordings in that style,
        with the same joints: `LikenessLimits.of`.

    Examples
    --------
    >>> import numpy as np
    >>> from harmolab.types import Skeleton
    >>> likeness(Motion(np.zeros((60, 1, 3)), 15.0, Skeleton.unnamed(1))).verdict
    'cannot be judged: no joints are named left and right hip, or shoulder'
    """
    if reason := _unjudgeable(motion):
        return Likeness(cannot=reason)
    limits, windows = limits or LikenessLimits.recorded(), window_measures(motion)
    if not windows:
        seconds = motion.valid.sum() / motion.fps
        return Likeness(
            cannot=f"too short to be judged: {SHORTEST:g} s of movement are needed, these are {seconds:.3g} s"
        )
    measured = {name: [window[name] for window in windows if name in window] for name in MEASURES}
    recorded = {name: reference for name in MEASURES if measured[name] and (reference := limits.reference(name, dance))}
    least = {name: recorded[name][0] / MARGIN for name in recorded if name in LOWER}
    most = {name: recorded[name][2] * MARGIN for name in recorded if name in UPPER}
    values = {name: max(measured[name], key=partial(_excess, name, least, most)) for name in recorded}
    if not values:
        return Likeness(cannot="cannot be judged: there are no recorded numbers for what was measured")
    return Likeness(values, least, most, recorded, len(windows))


def motion_windows(motion: Motion) -> tuple[Motion, ...]:
    """The windows of 30 s that cover a motion evenly; the motion itself where it is hardly longer than one.

    Windows with less than 10 s that are no filler are left out.
    """
    count = math.ceil(motion.duration / LONGEST - HARDLY)
    starts = np.linspace(0.0, motion.duration - LONGEST, count) if count > 1 else ()
    parts = tuple(motion.span(start, LONGEST) for start in starts) or (motion,)
    return tuple(part for part in parts if part.valid.sum() >= SHORTEST * part.fps - 1)


def window_measures(motion: Motion) -> tuple[dict[str, float], ...]:
    """`body_measures` of all `motion_windows`; ValueError for a two-dimensional motion."""
    return tuple(map(body_measures, motion_windows(motion)))


def _unjudgeable(motion: Motion) -> str:
    """The reason that a motion cannot be judged, whatever its length; empty otherwise."""
    if motion.positions.shape[2] != 3:
        return "cannot be judged: places in a picture do not show how far the body moves"
    if not side_pairs(motion.skeleton):
        return "cannot be judged: no joints are named left and right hip, or shoulder"
    return ""


def _excess(name: str, least: Mapping[str, float], most: Mapping[str, float], value: float) -> float:
    """The factor by which a value is below its lower or above its upper limit; more than 1 is a failure."""
    below = _times(least[name], value) if name in least else 0.0
    return max(below, _times(value, most[name]) if name in most else 0.0)


def _times(larger: float, smaller: float) -> float:
    """Quotient of two numbers that are not negative; 1 of two zeros."""
    if smaller == 0:
        return math.inf if larger > 0 else 1.0
    return larger / smaller


def _ranges(windows: Sequence[Mapping[str, float]]) -> dict[str, Range]:
    """Minimum, median and maximum of each measure that any window has."""
    columns = {name: [window[name] for window in windows if name in window] for name in MEASURES}
    return {name: (min(v), float(np.median(v)), max(v)) for name, v in columns.items() if v}


def _as_ranges(content: Mapping[str, Any]) -> dict[str, Range]:
    """The ranges of a JSON file, in the order of `MEASURES`; TypeError where they are none."""
    if unknown := set(content) - set(MEASURES):
        raise ValueError(f"unknown measures of likeness: {', '.join(sorted(map(str, unknown)))}")
    return {name: tuple(content[name]) for name in MEASURES if name in content}


def _check_ranges(ranges: Mapping[str, Range]) -> None:
    """ValueError where a range is not three ordered numbers from 0 on."""
    for name, numbers in ranges.items():
        if name not in MEASURES or len(numbers) != 3 or not 0 <= numbers[0] <= numbers[1] <= numbers[2] < math.inf:
            raise ValueError(f"limits of likeness: {name} must be minimum, median and maximum, got {numbers}")


def _rounded(ranges: Mapping[str, Range]) -> dict[str, list[float]]:
    return {name: [float(f"{number:.4g}") for number in numbers] for name, numbers in ranges.items()}
