"""Geometric features of a motion, one vector a clip: how often 32 things are true of the body (Müller et al. 2005).

"The right hand moves forward", "the left knee is bent": relations between points of the body, each true or false at a
moment, as AIST++ (Li et al. 2021) uses them for Frechet distances and diversity. The tables hold points, directions and
thresholds (Müller and Röder 2006); those of "aist++" are as AIST++'s code has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np

from harmolab.metrics.body_points import BODY_POINTS, body_points
from harmolab.metrics.kinetic import AIST_FPS, DenseMotion, dense_motion
from harmolab.types import BoolArray, FloatArray, Motion

GEOMETRIC_FEATURES = (
    *("right hand moves forward", "left hand moves forward", "right hand above neck", "left hand above neck"),
    *("right hand moves up", "left hand moves up", "right elbow bent", "left elbow bent"),
    *("hands far apart sideways", "hands approach each other", "right hand leaves root", "left hand leaves root"),
    *("right hand fast", "left hand fast", "right foot behind left leg", "left foot behind right leg"),
    *("right foot raised", "left foot raised", "feet far apart sideways", "right knee bent", "left knee bent"),
    *("right foot fast", "left foot fast", "right upper arm abducted", "left upper arm abducted"),
    *("right thigh abducted", "left thigh abducted", "root behind frontal plane", "spine horizontal"),
    *("right hand low", "left hand low", "root fast"),
)

# Direction: from one point to another, or the normal (b - a) x (c - a) of a plane through three points. Then a vector
# between two points. True where the part of the vector along the direction, or of its change in a second where the
# feature moves, is beyond the threshold, in upper arms, shoulder widths or hip widths of the dancer.
LINES = (
    ("right hand above neck", "chest neck", "neck rwrist", 0.2, "humerus"),
    ("left hand above neck", "chest neck", "neck lwrist", 0.2, "humerus"),
    ("hands far apart sideways", "lshoulder rshoulder", "lwrist rwrist", 2.5, "shoulders"),
    ("feet far apart sideways", "lhip rhip", "lankle rankle", 2.1, "hips"),
)
PLANES = MappingProxyType(
    {
        "fixed": (
            ("right foot behind left leg", "root lhip ltoes", "root rankle", 0.38, "humerus"),
            ("left foot behind right leg", "root rtoes rhip", "root lankle", 0.38, "humerus"),
            ("root behind frontal plane", "rankle neck lankle", "rankle root", 0.5, "humerus"),
        ),
        "aist++": (
            ("right foot behind left leg", "root ltoes lhip", "root rankle", 0.38, "humerus"),
            ("left foot behind right leg", "root rtoes rhip", "root lankle", 0.38, "humerus"),
            ("root behind frontal plane", "rankle lankle neck", "rankle root", 0.5, "humerus"),
        ),
    }
)
MOVING = MappingProxyType(
    {
        "fixed": (
            ("right hand moves forward", "neck rhip lhip", "neck rwrist", 1.8, "humerus"),
            ("left hand moves forward", "neck rhip lhip", "neck lwrist", 1.8, "humerus"),
            ("right hand moves up", "belly chest", "chest rwrist", 1.8, "humerus"),
            ("left hand moves up", "belly chest", "chest lwrist", 1.8, "humerus"),
            ("hands approach each other", "lwrist rwrist", "rwrist lwrist", 1.4, "humerus"),
            ("right hand leaves root", "rwrist root", "rwrist root", 1.4, "humerus"),
            ("left hand leaves root", "lwrist root", "lwrist root", 1.4, "humerus"),
        ),
        "aist++": (
            ("right hand moves forward", "neck lhip rhip", "neck rwrist", 1.8, "humerus"),
            ("left hand moves forward", "neck rhip lhip", "neck lwrist", 1.8, "humerus"),
            ("right hand moves up", "belly chest", "belly chest", 1.8, "humerus"),
            ("left hand moves up", "belly chest", "belly chest", 1.8, "humerus"),
            ("hands approach each other", "lwrist rwrist", "lwrist rwrist", 1.4, "humerus"),
            ("right hand leaves root", "rwrist root", "rwrist lwrist", 1.4, "humerus"),
            ("left hand leaves root", "lwrist root", "lwrist rwrist", 1.4, "humerus"),
        ),
    }
)
# Two vectors, and what the angle between them is above, or, with a minus, below: degrees.
ANGLES = (
    ("right elbow bent", "relbow rshoulder", "relbow rwrist", -110),
    ("left elbow bent", "lelbow lshoulder", "lelbow lwrist", -110),
    ("right knee bent", "rknee rhip", "rknee rankle", -110),
    ("left knee bent", "lknee lhip", "lknee lankle", -110),
    ("right upper arm abducted", "neck root", "rshoulder relbow", 25),
    ("left upper arm abducted", "neck root", "lshoulder lelbow", 25),
    ("right thigh abducted", "neck root", "rhip rknee", 50),
    ("left thigh abducted", "neck root", "lhip lknee", 50),
)
# Point, and its speed in upper arms a second.
FAST = (
    ("right hand fast", "rwrist", 2.5),
    ("left hand fast", "lwrist", 2.5),
    ("right foot fast", "rankle", 2.5),
    ("left foot fast", "lankle", 2.5),
    ("root fast", "root", 2.3),
)
HEIGHT = 1.2  # upper arms above the lowest joint of the moment
RAISED = MappingProxyType({"right foot raised": "rankle", "left foot raised": "lankle"})
LOW = MappingProxyType({"right hand low": "rwrist", "left hand low": "lwrist"})

Points = dict[str, FloatArray]  # name -> (3, T)

# The body of SMPL's mean shape, which AIST++ takes for all dancers.
_AIST_SIZES = {"humerus": 0.2568381092115207, "shoulders": 0.39084835854945527, "hips": 0.11924706586886204}
# AIST++ motion has 60 frames per second; its code divides by the time step of 120, as fairmotion has it.
_AIST_RATE = 120.0
_UPRIGHT = math.cos(math.radians(70.0))  # a spine between 70 and 110 degrees from the vertical is horizontal


def geometric_features(motion: Motion, *, form: Literal["fixed", "aist++"] = "fixed") -> FloatArray:
    """Share of the time that each of the 32 `GEOMETRIC_FEATURES` is true.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        With the joints that `body_points` asks for. Other rates than 60 frames per second are brought to a multiple of
        it; velocities are differences over 1/60 s. A moment counts if both its frames are valid.
    form : "fixed" or "aist++"
        The code of AIST++, taken from fairmotion, departs from the features' definitions in five places. "aist++"
        repeats them, to compare with its scores:

        * velocities are divided by 1/120 s in motion of 60 frames per second, so they are twice what they are;
        * a velocity along a line is that of the third point against the first, where it should be that of the fourth
          against the third: "moves up" forgets the hand, "approach" becomes its opposite;
        * a hand that leaves the root is measured by the velocity of the other hand;
        * normals of planes point the wrong way, and for the left side, where left and right have changed places, the
          other way again: the right hand must move backward, the left one forward;
        * thresholds are lengths of SMPL's mean body. "fixed" measures the dancer: medians over time.

        The lowest joint stands for the floor in both.

    Returns
    -------
    (32,) array in [0, 1]

    Raises
    ------
    ValueError
        If joints are missing (the message names them), the motion is two-dimensional, too short or nowhere valid, or
        `form` is another word.
    """
    if form not in ("fixed", "aist++"):
        raise ValueError(f"form must be fixed or aist++, got {form!r}")
    weights = body_points(motion.skeleton)
    dense = dense_motion(motion)
    # Joints first and frames last, so that all that follows runs along neighbouring numbers.
    joints = np.ascontiguousarray(dense.positions.transpose(1, 2, 0))
    places = (weights @ joints.reshape(len(joints), -1)).reshape(len(weights), 3, -1)
    points = dict(zip(BODY_POINTS, places, strict=True))
    sizes, rate = (_AIST_SIZES, _AIST_RATE) if form == "aist++" else (_measured(points), AIST_FPS)
    now = {name: place[:, dense.stride :] for name, place in points.items()}
    before = {name: place[:, : -dense.stride] for name, place in points.items()}
    true = {
        **_projections(now, before, sizes, rate, form),
        **_angles(now),
        **_heights(now, joints[:, 1, dense.stride :].min(axis=0), sizes["humerus"]),
    }
    for name, point, threshold in FAST:
        true[name] = _lengths(now[point] - before[point]) > threshold * sizes["humerus"] / rate
    return _mean_over_time(np.array([true[name] for name in GEOMETRIC_FEATURES]), dense)


def _vector(points: Points, names: str) -> FloatArray:
    """The vector (3, T) between two points, or the normal of the plane through three."""
    first, *others = (points[name] for name in names.split())
    arms = [other - first for other in others]
    return arms[0] if len(arms) == 1 else np.cross(arms[0], arms[1], axis=0)


def _projections(
    now: Points, before: Points, sizes: Mapping[str, float], rate: float, form: str
) -> dict[str, BoolArray]:
    """The features of `LINES`, `PLANES` and `MOVING`, (T',) each; velocities are differences over a sixtieth."""
    true = {}
    for name, direction, vector, threshold, size in (*LINES, *PLANES[form]):
        true[name] = _beyond(_vector(now, vector), _vector(now, direction), threshold * sizes[size])
    for name, direction, vector, threshold, size in MOVING[form]:
        change = _vector(now, vector) - _vector(before, vector)
        true[name] = _beyond(change, _vector(now, direction), threshold * sizes[size] / rate)
    return true


def _beyond(vectors: FloatArray, directions: FloatArray, limit: float) -> BoolArray:
    """True where the part of (3, T') vectors along directions exceeds the limit."""
    # Both sides times the direction's length: where a plane has no normal, nothing is beyond it.
    return (directions * vectors).sum(axis=0) > limit * _lengths(directions)


def _angles(now: Points) -> dict[str, BoolArray]:
    """The features that are about angles, (T',) each."""
    spine = now["root"] - now["neck"]
    true = {"spine horizontal": np.abs(spine[1]) < _UPRIGHT * _lengths(spine)}
    for name, first, second, bound in ANGLES:
        one, other = _vector(now, first), _vector(now, second)
        excess = (one * other).sum(axis=0) - math.cos(math.radians(bound)) * _lengths(one) * _lengths(other)
        true[name] = excess > 0 if bound < 0 else excess < 0
    return true


def _heights(now: Points, lowest: FloatArray, humerus: float) -> dict[str, BoolArray]:
    """The features that are about heights above the lowest joint (T',), (T',) each."""
    raised = {name: now[point][1] - lowest > HEIGHT * humerus for name, point in RAISED.items()}
    return raised | {name: now[point][1] - lowest < HEIGHT * humerus for name, point in LOW.items()}


def _measured(points: Points) -> dict[str, float]:
    """The dancer's own sizes, metres: medians over time."""
    bones = ("lshoulder lelbow", "rshoulder relbow", "lshoulder rshoulder", "lhip rhip")
    left, right, shoulders, hips = (float(np.median(_lengths(_vector(points, bone)))) for bone in bones)
    return {"humerus": (left + right) / 2, "shoulders": shoulders, "hips": hips}


def _mean_over_time(true: BoolArray, dense: DenseMotion) -> FloatArray:
    """Share of the usable moments at which each row of (32, T') is true."""
    usable = dense.valid[dense.stride :] & dense.valid[: -dense.stride]
    if not usable.any():
        raise ValueError("the motion is nowhere valid for 1/60 s, the step of its features")
    return true[:, usable].mean(axis=1) if not usable.all() else true.mean(axis=1)


def _lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of (3, T) vectors, (T,)."""
    return np.sqrt((vectors * vectors).sum(axis=0))
