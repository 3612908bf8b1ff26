"""Does a dance move like recorded dancers? Thirteen measures, each within limits that recordings set: the *guard*.

A score of harmony says whether movement and music agree, and the joint speed of a statue on a turntable may agree
perfectly. So it is asked first whether a dance moves like dancers. Music has no part in that, and nothing was fitted:
a limit is the least or the most that the recordings at hand had, with half as much again to spare.

======================================================  =====================  ============================
measure                                                 limit                  of
======================================================  =====================  ============================
spread, poorest, hands, steps, nearest, inside          least / 1.5            this dance, else all dances
ankles, jerk                                            least / 1.5            all dances
jerk, crossed, turns, skating, stride, knees            most * 1.5             all dances
======================================================  =====================  ============================

The measures are taken over at most half a minute, at 15 frames per second, in the body frame
(`body.skeletons.body_frame`): the origin at the torso, turned with the hips, so that travel and turns of the whole body
count as no movement. Jerk and skating are those of `metrics.quality`. Filler frames (`Motion.valid`) count nowhere. A
measure that a body or a stretch cannot answer is left out.

Dances of more than 30 s are measured in windows of 30 s that cover them evenly, and the worst window of each measure
counts: what stands still for half a minute has stopped dancing, however it went on.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from scipy.spatial.distance import cdist

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import HIPS, HIPS_AND_SHOULDERS, Skeleton, body_frame, heading, named_joints, side_pairs
from harmolab.files import read_json, reading
from harmolab.metrics.features import point_joints
from harmolab.metrics.quality import foot_skating, jerk, or_nan, runs, spans, vector_lengths
from harmolab.types import BoolArray, FloatArray, Motion, check_kind

# The thirteen measures

MEASURES: Mapping[str, str] = MappingProxyType(
    {
        "spread": "mean distance of the joints from their mean place, cm",
        "poorest": "the same in the poorest 5 s, cm",
        "hands": "range of the hands, m",
        "steps": "steps a second",
        "nearest": "distance to the most alike other 2 s, cm",
        "inside": "share of the joints' speed that is inside the body",
        "ankles": "distance of the ankles on the floor, median, m",
        "jerk": "jerk, m/s³",
        "crossed": "share of time with crossed ankles",
        "turns": "turns of the body in half a minute",
        "skating": "sliding of standing feet, m/s",
        "stride": "distance of the ankles on the floor, 95th percentile, m",
        "knees": "knee bend, 95th percentile, degrees",
    }
)

RATE = 15.0  # hertz
LONGEST, SHORTEST = 30.0, 10.0  # seconds of movement that are measured at once, and that are needed
POOREST, FIGURE, HOP = 5.0, 2.0, 1.0  # seconds: the poorest stretch, what is compared, and from one to the next
STEP = 0.08  # metres by which the ankles come together between two steps
# Names for the end of the arm, the farthest out first.
_HANDS = ("finger", "fingers", "hand", "wrist")


def body_measures(motion: Motion) -> dict[str, float]:
    """The thirteen measures of one window of movement, of 30 s at most, in the order and units of `MEASURES`.

    =========  =======================================================================================================
    spread     distance of every joint from its mean place in the body, mean over time and joints
    poorest    the same about the mean places of 5 s, the least of all 5 s without filler
    hands      5th to 95th percentile on each axis of the body, length of the diagonal; mean of both hands
    steps      peaks of the ankles' distance on the floor that rise .08 m out of their surroundings
    nearest    joints' mean distance between 2 s and the most alike other 2 s, which may begin at any frame at least 2 s
               away; mean over stretches that begin every second. (Were the others to begin at whole seconds only, a
               loop would be found or not by its length, and a figure by its tempo.)
    inside     mean joint speed in the body over mean joint speed in the room; 0 when nothing moves
    crossed    share of frames in which the left ankle is to the right of the right one, as the hips see it
    turns      full turns between the first and the last frame, there and back cancelling
    knees      angle between thigh and shin, both knees
    =========  =======================================================================================================

    Parameters
    ----------
    motion : Motion, three-dimensional, metres, y up

    Returns
    -------
    dict; a measure is missing where no joint has the name that it needs (hips or shoulders, ankles, knees, hands, feet)
    or no stretch without filler is long enough for it

    Raises
    ------
    ValueError
        If the motion is two-dimensional or no frame is valid.
    """
    if motion.positions.shape[2] != 3:
        raise ValueError("a three-dimensional motion is needed: metres, y up")
    if not motion.valid.any():
        raise ValueError("no frame of the motion is valid")
    steady = resample_motion(motion, RATE)
    body = body_frame(steady.positions, RATE, steady.skeleton)
    values = _legs(body, steady) | _turns(steady)
    values |= {
        "spread": 100 * _spread(body[steady.valid]),
        "poorest": 100 * _poorest(body, steady.valid),
        "nearest": 100 * _nearest(body, steady.valid),
        "inside": _inside(body, steady),
        "hands": _hand_range(body[steady.valid], steady.skeleton),
    }
    values |= {"jerk": or_nan(jerk, motion), "skating": or_nan(foot_skating, motion)}
    return {name: float(values[name]) for name in MEASURES if np.isfinite(values.get(name, np.nan))}


def _spread(places: FloatArray) -> float:
    return float(vector_lengths(places - places.mean(axis=0)).mean())


def _poorest(body: FloatArray, valid: BoolArray) -> float:
    """The least `_spread` of 5 s without filler, metres."""
    length = round(POOREST * RATE)
    starts = np.flatnonzero(runs(valid, length))
    return min((_spread(body[start : start + length]) for start in starts), default=np.nan)


def _nearest(body: FloatArray, valid: BoolArray) -> float:
    """Mean distance of 2 s to the most alike other 2 s, metres; NaN where no two of them lie apart."""
    length, hop = round(FIGURE * RATE), round(HOP * RATE)
    starts, steps = np.flatnonzero(runs(valid, length)), np.arange(length)[:, None]
    apart = sum(cdist(places, places) for places in body.swapaxes(0, 1)) / body.shape[1]
    nearest = []
    for start in starts[starts % hop == 0]:
        others = starts[np.abs(starts - start) >= length]
        if others.size:
            nearest.append(apart[start + steps, others + steps].mean(axis=0).min())
    return float(np.mean(nearest)) if nearest else np.nan


def _inside(body: FloatArray, motion: Motion) -> float:
    """Mean joint speed in the body over that in the room; 0 when nothing moves, NaN without two valid frames in a row.

    A body may be turned one way while its limbs stay where they are, so the share may be above 1.
    """
    together = spans(motion.valid, 1)
    if not together.any():
        return np.nan
    inner, room = (float(vector_lengths(np.diff(p, axis=0))[together].mean()) for p in (body, motion.positions))
    return inner / room if room else 0.0


def _hand_range(body: FloatArray, skeleton: Skeleton) -> float:
    """Diagonal of the box that holds a hand for most of the time, metres, mean of both hands; NaN without hands."""
    joints = named_joints(skeleton)
    hands = [[joints[side, part] for part in _HANDS if (side, part) in joints] for side in ("left", "right")]
    if not all(hands):
        return np.nan
    low, high = np.percentile(body[:, [hand[0] for hand in hands]], (5, 95), axis=0)
    return float(np.linalg.norm(high - low, axis=1).mean())


def _turns(motion: Motion) -> dict[str, float]:
    """The net turns of the body; none without names of left and right."""
    if not side_pairs(motion.skeleton):
        return {}
    parts = HIPS if side_pairs(motion.skeleton, HIPS) else HIPS_AND_SHOULDERS
    angles = heading(motion.positions, RATE, motion.skeleton, parts=parts)
    return {"turns": abs(float(np.diff(angles)[spans(motion.valid, 1)].sum())) / (2 * np.pi)}


def _legs(body: FloatArray, motion: Motion) -> dict[str, float]:
    """The measures of ankles and knees; empty without ankles."""
    points, valid = point_joints(motion.skeleton), motion.valid
    if not {"lankle", "rankle"} <= points.keys():
        return {}
    left, right = body[:, points["lankle"]], body[:, points["rankle"]]
    apart = np.hypot(*(left - right)[:, [0, 2]].T)
    peaks, _ = scipy.signal.find_peaks(apart, prominence=STEP)
    legs = {
        "steps": valid[peaks].sum() / valid.sum() * RATE,
        "ankles": np.median(apart[valid]),
        "crossed": (left[:, 0] < right[:, 0])[valid].mean(),
        "stride": np.percentile(apart[valid], 95),
    }
    if {"lhip", "rhip", "lknee", "rknee"} <= points.keys():
        bends = [_bend(*(body[valid, points[side + part]] for part in ("hip", "knee", "ankle"))) for side in "lr"]
        legs["knees"] = np.percentile(bends, 95)
    return legs


def _bend(hip: FloatArray, knee: FloatArray, ankle: FloatArray) -> FloatArray:
    """(T,) degrees between thigh and shin: 0 for a straight leg."""
    thigh, shin = knee - hip, ankle - knee
    lengths = np.linalg.norm(thigh, axis=1) * np.linalg.norm(shin, axis=1)
    cosines = np.einsum("td,td->t", thigh, shin) / np.maximum(lengths, np.finfo(float).tiny)
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


Range = tuple[float, float, float]  # minimum, median, maximum

# Limits of recorded dancers, and a dance beside them

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
    """The numbers of recorded dancers that `likeness` holds a dance against.

    `LikenessLimits.recorded` has those that come with harmolab, `LikenessLimits.of` makes those of your own recordings.

    Parameters
    ----------
    pooled : dict
        Measure -> (minimum, median, maximum) over windows of at most 30 s of all dances. The measures are those of
        `harmolab.metrics.likeness.MEASURES`.
    dances : dict
        Name of a dance -> the same of this dance alone.
    windows : int
        Number of windows that were measured.

    Raises
    ------
    ValueError
        For an unknown measure, or numbers that do not rise.
    """

    pooled: Mapping[str, Range]
    dances: Mapping[str, Mapping[str, Range]] = field(default_factory=dict)
    windows: int = 0

    def __post_init__(self) -> None:
        for ranges in (self.pooled, *self.dances.values()):
            for name, numbers in ranges.items():
                is_rising = len(numbers) == 3 and 0 <= numbers[0] <= numbers[1] <= numbers[2] < math.inf
                if name not in MEASURES or not is_rising:
                    raise ValueError(f"limits of likeness: {name} must be minimum, median and maximum, got {numbers}")

    @classmethod
    def of(cls, motions: Iterable[Motion], dances: Sequence[str] | None = None) -> "LikenessLimits":
        """The limits of recordings of your own, such as the corpus that a dance is made of.

        Parameters
        ----------
        motions : iterable of Motion, three-dimensional
            Those of less than 10 s are left out.
        dances : sequence of str
            Names of their dances, "" where unknown; all unknown when left out.

        Raises
        ------
        ValueError
            If none is long enough, one is two-dimensional, or `dances` does not fit.
        """
        motions = list(motions)
        names = [""] * len(motions) if dances is None else list(dances)
        return cls.of_windows([window_measures(motion) for motion in motions], names)

    @classmethod
    def of_windows(cls, recordings: Sequence[Sequence[Mapping[str, float]]], dances: Sequence[str]) -> "LikenessLimits":
        """The limits of recordings whose `window_measures` are known already; otherwise as `of`."""
        if len(recordings) != len(dances):
            raise ValueError(f"there are {len(recordings)} recordings and {len(dances)} names of dances")
        windows = [(dance, window) for dance, parts in zip(dances, recordings, strict=True) for window in parts]
        if not windows:
            raise ValueError(f"no recording has {SHORTEST:g} s of movement")
        names = sorted({dance for dance, _ in windows} - {""})
        by_dance = {dance: _ranges([window for name, window in windows if name == dance]) for dance in names}
        return cls(_ranges([window for _, window in windows]), by_dance, len(windows))

    @classmethod
    def recorded(cls) -> "LikenessLimits":
        """The limits that come with harmolab, of 46 windows of 23 recordings of cha-cha, rumba, tango and waltz."""
        with reading(RECORDED, "limits of likeness"):
            return cls.from_dict(read_json(RECORDED))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "LikenessLimits":
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
        """The recorded (minimum, median, maximum) that a measure is held against; None where there are none.

        Amounts (spread, poorest, hands, steps, nearest, inside) are those of the dance, where it was recorded; all
        others are those of all dances.
        """
        ranges = self.dances.get(dance, {}) if measure in AMOUNTS else {}
        return ranges.get(measure, self.pooled.get(measure))


@dataclass(frozen=True)
class Likeness:
    """The measures of a dance beside those of recordings, and the verdict in words: the result of `likeness`.

    Parameters
    ----------
    values : dict
        Measure -> its number; of several windows the worst.
    least, most : dicts
        Measure -> the limit below which, or above which, it fails.
    recorded : dict
        Measure -> the recorded (minimum, median, maximum) that the limits come from.
    windows : int
        Number of windows that were measured.
    cannot : str
        The reason why the dance cannot be judged at all; "" where it can.
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
        """True where every measure is within its limits, False where one is not; None where it cannot be judged."""
        return None if self.cannot else not self.fails

    @property
    def missing(self) -> tuple[str, ...]:
        """The measures that could not be taken: names of joints are missing, or recorded numbers."""
        return tuple(name for name in MEASURES if name not in self.values)

    @property
    def count(self) -> str:
        """Number of measures within their limits, of those taken: "13 of 13"."""
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
        """The fault that a failing measure finds, in words, with its number and the recorded range."""
        value, (low, _, high) = self.values[measure], self.recorded[measure]
        words = _TOO_LITTLE[measure] if value < self.least.get(measure, -math.inf) else _TOO_MUCH[measure]
        return f"{words} ({value:.3g}{UNITS.get(measure, '')}, recorded {low:.3g} to {high:.3g})"

    def _unasked(self) -> str:
        return f"; not asked: {', '.join(self.missing)}" if self.missing else ""


def likeness(
    motion: Motion, *, dance: str = "", limits: LikenessLimits | None = None, held: BoolArray | None = None
) -> Likeness:
    """Likeness of a dance to recorded dancers, music aside: does the body move as theirs, by thirteen measures?

    Each measure has to lie within the limits that recordings set, with half as much again to spare
    (`harmolab.metrics.likeness` has the table). Of a dance that fails, a score of harmony means little. A dance of more
    than 30 s is measured in windows of 30 s, and the worst window of each measure counts.

    Parameters
    ----------
    motion : Motion, metres, y up
        Joints of its left and right hips (or shoulders) must be named so. Without ankles, knees, hands or feet the
        measures that need them are left out, and the verdict says so.
    dance : str
        Amounts of movement are held against recordings of this dance; against all where it is "" or was not recorded.
    limits : LikenessLimits
        Those of four ballroom dances that come with harmolab when left out. For other styles take those of recordings
        in that style, with the same joints: `LikenessLimits.of`.
    held : (T,) bool array
        Frames in which a pose is held on purpose, since the music is silent. They do not count, as filler.

    Returns
    -------
    Likeness
        `passed`, `verdict` in words, `values` by measure. A motion that cannot be judged (in two dimensions, shorter
        than 10 s, or with names of neither hips nor shoulders) is no error: `passed` is None, and the verdict says why.

    Raises
    ------
    ValueError
        For what is no Motion, or `held` of another shape.

    Notes
    -----
    Music that repeats needs no allowance in the measure "nearest", which compares 2 s of movement with the most alike
    other 2 s. Of 175 dances of half a minute to the same 2, 4 or 8 bars over and over (three choreographers, the
    shipped HarmoGAN and Music2Dance) none fails by it: the least is 1.40 times its limit, to the whole songs 1.51
    times.

    Examples
    --------
    >>> import numpy as np
    >>> from harmolab.types import Skeleton
    >>> likeness(Motion(np.zeros((60, 1, 3)), 15.0, Skeleton.unnamed(1))).verdict
    'cannot be judged: no joints are named left and right hip, or shoulder'
    """
    check_kind(motion, Motion)
    held = np.zeros(motion.n_frames, bool) if held is None else np.asarray(held, bool)
    if held.shape != motion.valid.shape:
        raise ValueError(f"held must have one entry per frame ({motion.n_frames}), got shape {held.shape}")
    motion = replace(motion, valid=motion.valid & ~held)
    if motion.positions.shape[2] != 3:
        return Likeness(cannot="cannot be judged: places in a picture do not show how far the body moves")
    if not side_pairs(motion.skeleton):
        return Likeness(cannot="cannot be judged: no joints are named left and right hip, or shoulder")
    limits, windows = limits or LikenessLimits.recorded(), window_measures(motion)
    if not windows:
        needed, seconds = f"{SHORTEST:g} s of movement are needed", motion.valid.sum() / motion.fps
        rest = "" if not held.any() else f", without {held.sum() / motion.fps:.3g} s of a held pose"
        return Likeness(cannot=f"too short to be judged: {needed}, these are {seconds:.3g} s{rest}")
    measured = {name: [window[name] for window in windows if name in window] for name in MEASURES}
    references = {name: limits.reference(name, dance) for name in MEASURES if measured[name]}
    recorded = {name: reference for name, reference in references.items() if reference}
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


def _rounded(ranges: Mapping[str, Range]) -> dict[str, list[float]]:
    return {name: [float(f"{number:.4g}") for number in numbers] for name, numbers in ranges.items()}
