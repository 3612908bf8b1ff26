"""Geometric features of a motion, one vector a clip: how often 32 things are true of the body (Müller et al. 2005).

"The right hand moves forward", "the left knee is bent": relations between points of the body, each true or false at a
moment, as AIST++ (Li et al. 2021) uses them for Frechet distances and diversity. `features.relations` lists them.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from harmolab.metrics import relations
from harmolab.metrics.body_points import BODY_POINTS, body_points
from harmolab.metrics.kinetic import AIST_FPS, DenseMotion, dense_motion
from harmolab.metrics.relations import GEOMETRIC_FEATURES, Projections, Sizes, point_numbers
from harmolab.types import BoolArray, FloatArray, Motion

# The body of SMPL's mean shape, which AIST++ takes for everybody.
_AIST_SIZES = Sizes(0.2568381092115207, 0.39084835854945527, 0.11924706586886204)
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
    points = (weights @ joints.reshape(len(joints), -1)).reshape(len(weights), 3, -1)
    sizes, rate = (_AIST_SIZES, _AIST_RATE) if form == "aist++" else (_measured(points), AIST_FPS)
    true = np.empty((len(GEOMETRIC_FEATURES), len(dense.positions) - dense.stride), bool)
    for still in (relations.LINES, relations.PLANES[form]):
        true[still.features] = _beyond(points, still, sizes, dense.stride)
    for moving in (relations.MOVING_LINES[form], relations.MOVING_PLANES[form]):
        true[moving.features] = _beyond(points, moving, sizes, dense.stride, rate=rate)
    fast = relations.FAST
    steps = points[fast.points, :, dense.stride :] - points[fast.points, :, : -dense.stride]
    true[fast.features] = _lengths(steps) > (fast.thresholds * sizes.humerus / rate)[:, None]
    _mark_angles(true, points[..., dense.stride :])
    _mark_heights(true, points[:, 1, dense.stride :], joints[:, 1, dense.stride :].min(axis=0), sizes)
    return _mean_over_time(true, dense)


def _beyond(
    points: FloatArray, table: Projections, sizes: Sizes, stride: int, *, rate: float | None = None
) -> BoolArray:
    """True where vectors, or with `rate` their changes over a sixtieth, exceed thresholds along directions, (P, T')."""
    corners = [points[corner, :, stride:] for corner in table.normals]
    arms = [corner - corners[0] for corner in corners[1:]]
    normals = arms[0] if len(arms) == 1 else np.cross(arms[0], arms[1], axis=1)
    vectors = points[table.vectors[1]] - points[table.vectors[0]]
    limits = table.thresholds * np.array(sizes)[table.sizes]
    if rate is None:
        vectors = vectors[..., stride:]
    else:
        vectors, limits = vectors[..., stride:] - vectors[..., :-stride], limits / rate
    # Both sides times the normal's length: where a plane has no normal, nothing is beyond it.
    return (normals * vectors).sum(axis=1) > limits[:, None] * _lengths(normals)


def _mark_angles(true: BoolArray, points: FloatArray) -> None:
    """Fill in what is about angles; `points` without the first sixtieth."""
    angles = relations.ANGLES
    first = points[angles.first[1]] - points[angles.first[0]]
    second = points[angles.second[1]] - points[angles.second[0]]
    bounds = angles.cosines[:, None] * _lengths(first) * _lengths(second)
    true[angles.features] = angles.signs[:, None] * ((first * second).sum(axis=1) - bounds) > 0
    spine = points[BODY_POINTS.index("root")] - points[BODY_POINTS.index("neck")]
    true[GEOMETRIC_FEATURES.index("spine horizontal")] = np.abs(spine[1]) < _UPRIGHT * np.sqrt((spine**2).sum(axis=0))


def _mark_heights(true: BoolArray, heights: FloatArray, lowest: FloatArray, sizes: Sizes) -> None:
    """Fill in what is about heights, (18, T'), above the lowest joint, (T',); both without the first sixtieth."""
    above = heights - lowest
    raised, low = relations.RAISED, relations.LOW
    true[raised.features] = above[raised.points] > raised.thresholds[:, None] * sizes.humerus
    true[low.features] = above[low.points] < low.thresholds[:, None] * sizes.humerus


def _measured(points: FloatArray) -> Sizes:
    """The dancer's own sizes: medians over time."""
    starts, ends = point_numbers(("lshoulder lelbow", "rshoulder relbow", "lshoulder rshoulder", "lhip rhip"))
    left, right, shoulders, hips = np.median(_lengths(points[ends] - points[starts]), axis=1)
    return Sizes(float(left + right) / 2, float(shoulders), float(hips))


def _mean_over_time(true: BoolArray, dense: DenseMotion) -> FloatArray:
    usable = dense.valid[dense.stride :] & dense.valid[: -dense.stride]
    if not usable.any():
        raise ValueError("the motion is nowhere valid for 1/60 s, the step of its features")
    return true[:, usable].mean(axis=1) if not usable.all() else true.mean(axis=1)


def _lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of (P, 3, T) vectors, (P, T)."""
    return np.sqrt((vectors * vectors).sum(axis=1))
