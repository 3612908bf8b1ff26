"""Outlines of a person in a picture, from far to near, for any painter: OpenCV, matplotlib, the page's script."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from harmolab.lab.person.camera import Camera
from harmolab.lab.person.plan import PAINTS, BodyPlan
from harmolab.types import FloatArray, IntArray

CORNERS = 24  # of an outline
PALER = 0.3  # share of white in the farthest part
THINNEST = 0.01  # statures: radius of a part that counts as thin, as fingers and props do
LEAST_RANGE = 0.3  # statures between the paint of near and far
SHADOW_LEAST, SHADOW_SPREAD = 0.06, 0.8  # radius of the shadow: statures, and share of the spread of the joints
_ANGLES = 2 * np.pi * np.arange(CORNERS) / CORNERS
_WAYS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class Shape(NamedTuple):
    """A filled outline (corners, 2) in pixels, y down, its colour, its part's place in the plan, and if it is thin."""

    outline: FloatArray
    colour: tuple[int, int, int]
    part: int
    thin: bool


class Discs(NamedTuple):
    """The discs of every part in every frame: (F, P, C, 2) pixels, (F, P, C) pixels, and (F, P) depths of the parts."""

    centres: FloatArray
    radii: FloatArray
    depths: FloatArray


def person_shapes(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> Iterator[list[Shape]]:
    """The shapes of each frame, from far to near.

    Parameters
    ----------
    plan : BodyPlan
    camera : Camera
    positions : (F, J, 3), metres, of the camera's `frames`
    """
    discs = person_discs(plan, camera, positions, frames)
    outlines = hulls(discs.centres, discs.radii)
    colours = _colours(plan, discs.depths)
    nudged = discs.depths + plan.stature * np.array([part.nudge for part in plan.parts])
    thin = [max(part.radii) < THINNEST for part in plan.parts]
    for order, rows, paints in zip(np.argsort(-nudged, axis=1, kind="stable"), outlines, colours, strict=True):
        yield [Shape(rows[part], tuple(paints[part].tolist()), int(part), thin[part]) for part in order]


def person_discs(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> Discs:
    """Centres, radii and depths of the parts as the camera has them; parts with fewer discs repeat their last."""
    members, shares = _padded(plan)
    view = camera.to_view(np.einsum("qj,fjd->fqd", plan.weights, positions), frames)
    depths = np.maximum(view[..., 2], 0.01 * camera.size)[:, members]
    radii = camera.focal * plan.stature * shares / depths
    last = np.array([len(part.points) for part in plan.parts])
    counted = np.arange(members.shape[1]) < last[:, None]
    return Discs(camera.to_pixels(view)[:, members], radii, (depths * counted).sum(axis=2) / last)


def _padded(plan: BodyPlan) -> tuple[IntArray, FloatArray]:
    """(P, C) points and radii of the parts."""
    most = max(len(part.points) for part in plan.parts)
    points = [part.points + part.points[-1:] * (most - len(part.points)) for part in plan.parts]
    radii = [part.radii + part.radii[-1:] * (most - len(part.radii)) for part in plan.parts]
    return np.array(points), np.array(radii)


def hulls(centres: FloatArray, radii: FloatArray) -> FloatArray:
    """(..., CORNERS, 2) outlines around discs: in each direction, the edge of the disc that reaches farthest.

    >>> hulls(np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([1.0, 2.0]))[0]
    array([6., 0.])
    """
    reach = centres @ _WAYS + radii[..., None]
    farthest = reach.argmax(axis=-2)[..., None]
    edge = np.take_along_axis(centres, farthest, axis=-2)
    radius = np.take_along_axis(radii, farthest[..., 0], axis=-1)[..., None]
    return edge + radius * _WAYS.T


def _colours(plan: BodyPlan, depths: FloatArray) -> IntArray:
    """(F, P, 3) colours: near parts in their paint, far ones paler."""
    paints = np.array([PAINTS[part.paint] for part in plan.parts], float)
    nearest = depths.min(axis=1, keepdims=True)
    span = np.maximum(np.ptp(depths, axis=1, keepdims=True), LEAST_RANGE * plan.stature)
    far = PALER * ((depths - nearest) / span)[..., None]
    return np.rint(paints + far * (255.0 - paints)).astype(np.int64)


def shadow_outline(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> FloatArray:
    """(F, CORNERS, 2) pixels: the shadow, a disc on the floor below the body that is as wide as the body is spread."""
    weights = plan.shadow / max(plan.shadow.sum(), 1.0)
    floor = positions[..., [0, 2]]
    middle = np.einsum("j,fjd->fd", weights, floor)
    spread = np.sqrt(np.einsum("j,fjd->f", weights, (floor - middle[:, None]) ** 2))
    radius = SHADOW_LEAST * plan.stature + SHADOW_SPREAD * spread
    edge = middle[:, None] + radius[:, None, None] * _WAYS.T
    places = np.stack([edge[..., 0], np.zeros(edge.shape[:2]), edge[..., 1]], axis=-1)
    return camera.to_pixels(camera.to_view(places, frames))
