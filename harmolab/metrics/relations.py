"""The geometric features of a body as tables: points, directions, thresholds (Müller and Röder 2006).

Thresholds are in upper arms, shoulder widths and hip widths of the dancer. The tables "aist++" are as AIST++'s
code has them; `geometric_features` says where and why they differ from the definitions.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from harmolab.metrics.body_points import BODY_POINTS
from harmolab.types import FloatArray, IntArray

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


class Sizes(NamedTuple):
    """Lengths that thresholds are multiples of, metres."""

    humerus: float
    shoulders: float
    hips: float


class Projections(NamedTuple):
    """P rows: (P,) features, (2, P) points of a line or (3, P) of a plane, (2, P) ends of a vector, limits, units."""

    features: IntArray
    normals: IntArray
    vectors: IntArray
    thresholds: FloatArray
    sizes: IntArray  # which of Sizes


class Angles(NamedTuple):
    """A rows: (A,) features, (2, A) ends of two vectors, cosine of the bound, and 1 for below it or -1 for above."""

    features: IntArray
    first: IntArray
    second: IntArray
    cosines: FloatArray
    signs: FloatArray


class Limits(NamedTuple):
    """L rows: (L,) features, points, and thresholds in upper arms, of a height or of a speed per second."""

    features: IntArray
    points: IntArray
    thresholds: FloatArray


def point_numbers(rows: Iterable[str]) -> IntArray:
    """Numbers of the body points in rows of P names, (P, rows)."""
    return np.array([[BODY_POINTS.index(name) for name in row.split()] for row in rows]).T


def _projections(*rows: tuple[str, str, str, float, str]) -> Projections:
    features, normals, vectors, thresholds, sizes = zip(*rows, strict=True)
    which = [Sizes._fields.index(size) for size in sizes]
    directions, ends = point_numbers(normals), point_numbers(vectors)
    return Projections(_features(features), directions, ends, np.array(thresholds), np.array(which))


def _features(names: Iterable[str]) -> IntArray:
    return np.array([GEOMETRIC_FEATURES.index(name) for name in names])


def _angles(*rows: tuple[str, str, str, float]) -> Angles:
    features, first, second, bounds = zip(*rows, strict=True)
    one, other = point_numbers(first), point_numbers(second)
    return Angles(_features(features), one, other, np.cos(np.radians(bounds)), -np.sign(np.array(bounds)))


def _limits(*rows: tuple[str, str, float]) -> Limits:
    features, points, thresholds = zip(*rows, strict=True)
    return Limits(_features(features), point_numbers(points)[0], np.array(thresholds))


# Feature; a direction, from one point to another; a vector between two points; threshold and its unit. True where the
# part of the vector along the direction is beyond the threshold; in tables that move, of its change in a second.
LINES = _projections(
    ("right hand above neck", "chest neck", "neck rwrist", 0.2, "humerus"),
    ("left hand above neck", "chest neck", "neck lwrist", 0.2, "humerus"),
    ("hands far apart sideways", "lshoulder rshoulder", "lwrist rwrist", 2.5, "shoulders"),
    ("feet far apart sideways", "lhip rhip", "lankle rankle", 2.1, "hips"),
)
MOVING_LINES = {
    "fixed": _projections(
        ("right hand moves up", "belly chest", "chest rwrist", 1.8, "humerus"),
        ("left hand moves up", "belly chest", "chest lwrist", 1.8, "humerus"),
        ("hands approach each other", "lwrist rwrist", "rwrist lwrist", 1.4, "humerus"),
        ("right hand leaves root", "rwrist root", "rwrist root", 1.4, "humerus"),
        ("left hand leaves root", "lwrist root", "lwrist root", 1.4, "humerus"),
    ),
    "aist++": _projections(
        ("right hand moves up", "belly chest", "belly chest", 1.8, "humerus"),
        ("left hand moves up", "belly chest", "belly chest", 1.8, "humerus"),
        ("hands approach each other", "lwrist rwrist", "lwrist rwrist", 1.4, "humerus"),
        ("right hand leaves root", "rwrist root", "rwrist lwrist", 1.4, "humerus"),
        ("left hand leaves root", "lwrist root", "lwrist rwrist", 1.4, "humerus"),
    ),
}
# The direction is the normal (b - a) x (c - a) of a plane through three points.
PLANES = {
    "fixed": _projections(
        ("right foot behind left leg", "root lhip ltoes", "root rankle", 0.38, "humerus"),
        ("left foot behind right leg", "root rtoes rhip", "root lankle", 0.38, "humerus"),
        ("root behind frontal plane", "rankle neck lankle", "rankle root", 0.5, "humerus"),
    ),
    "aist++": _projections(
        ("right foot behind left leg", "root ltoes lhip", "root rankle", 0.38, "humerus"),
        ("left foot behind right leg", "root rtoes rhip", "root lankle", 0.38, "humerus"),
        ("root behind frontal plane", "rankle lankle neck", "rankle root", 0.5, "humerus"),
    ),
}
MOVING_PLANES = {
    "fixed": _projections(
        ("right hand moves forward", "neck rhip lhip", "neck rwrist", 1.8, "humerus"),
        ("left hand moves forward", "neck rhip lhip", "neck lwrist", 1.8, "humerus"),
    ),
    "aist++": _projections(
        ("right hand moves forward", "neck lhip rhip", "neck rwrist", 1.8, "humerus"),
        ("left hand moves forward", "neck rhip lhip", "neck lwrist", 1.8, "humerus"),
    ),
}
# Two vectors, and what the angle between them is above, or, with a minus, below: degrees.
ANGLES = _angles(
    ("right elbow bent", "relbow rshoulder", "relbow rwrist", -110),
    ("left elbow bent", "lelbow lshoulder", "lelbow lwrist", -110),
    ("right knee bent", "rknee rhip", "rknee rankle", -110),
    ("left knee bent", "lknee lhip", "lknee lankle", -110),
    ("right upper arm abducted", "neck root", "rshoulder relbow", 25),
    ("left upper arm abducted", "neck root", "lshoulder lelbow", 25),
    ("right thigh abducted", "neck root", "rhip rknee", 50),
    ("left thigh abducted", "neck root", "lhip lknee", 50),
)
FAST = _limits(
    ("right hand fast", "rwrist", 2.5),
    ("left hand fast", "lwrist", 2.5),
    ("right foot fast", "rankle", 2.5),
    ("left foot fast", "lankle", 2.5),
    ("root fast", "root", 2.3),
)
# Heights above the lowest joint of the moment, in upper arms.
RAISED = _limits(("right foot raised", "rankle", 1.2), ("left foot raised", "lankle", 1.2))
LOW = _limits(("right hand low", "rwrist", 1.2), ("left hand low", "lwrist", 1.2))
