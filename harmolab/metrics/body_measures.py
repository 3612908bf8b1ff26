"""Thirteen measures of the way a body moves, music aside, over at most half a minute.

Taken at 15 frames per second in the body frame (`skeletons.body_frame`): the origin at the torso, turned with the hips,
so that travel and turns of the whole body count as no movement. Jerk and skating are those of `metrics.quality`.
Filler frames (`Motion.valid`) count nowhere. A measure that a body or a stretch cannot answer is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from scipy.signal import find_peaks
from scipy.spatial.distance import cdist

from harmolab.kinematics import resample_motion
from harmolab.metrics.body_points import point_joints
from harmolab.metrics.quality import foot_skating, jerk, or_nan, runs, spans, vector_lengths
from harmolab.skeletons import HIPS, HIPS_AND_SHOULDERS, body_frame, heading, named_joints, side_pairs
from harmolab.types import BoolArray, FloatArray, Motion, Skeleton

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
    """The numbers of `MEASURES`, in their order and units, of one window of movement (at most 30 s are meant).

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
    values = _amounts(body, steady) | _legs(body, steady) | _turns(steady)
    values["hands"] = _hand_range(body[steady.valid], steady.skeleton)
    values |= {name: or_nan(measure, motion) for name, measure in (("jerk", jerk), ("skating", foot_skating))}
    return {name: float(values[name]) for name in MEASURES if np.isfinite(values.get(name, np.nan))}


def _amounts(body: FloatArray, motion: Motion) -> dict[str, float]:
    """Amount and variety of movement, from the places (T, J, 3) of the joints in the body."""
    return {
        "spread": 100 * _spread(body[motion.valid]),
        "poorest": 100 * _poorest(body, motion.valid),
        "nearest": 100 * _nearest(body, motion.valid),
        "inside": _inside(body, motion),
    }


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
    pairs = side_pairs(motion.skeleton, HIPS)
    if not side_pairs(motion.skeleton):
        return {}
    angles = heading(motion.positions, RATE, motion.skeleton, parts=HIPS if pairs else HIPS_AND_SHOULDERS)
    return {"turns": abs(float(np.diff(angles)[spans(motion.valid, 1)].sum())) / (2 * np.pi)}


def _legs(body: FloatArray, motion: Motion) -> dict[str, float]:
    """The measures of ankles and knees; empty without ankles."""
    points, valid = point_joints(motion.skeleton), motion.valid
    if not {"lankle", "rankle"} <= points.keys():
        return {}
    left, right = body[:, points["lankle"]], body[:, points["rankle"]]
    apart = np.hypot(*(left - right)[:, [0, 2]].T)
    peaks, _ = find_peaks(apart, prominence=STEP)
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
