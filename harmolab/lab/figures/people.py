"""People in figures: the shapes of `harmolab.lab.person` as polygons of matplotlib."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.collections import PolyCollection

from harmolab.lab.person.camera import ANGLE, Stage, stage_of
from harmolab.lab.person.plan import OUTLINES
from harmolab.lab.person.shapes import Shape, person_shapes, shadow_outline
from harmolab.skeletons import standing_height
from harmolab.types import FloatArray, IntArray, Motion

RIM, THIN_RIM = 0.5, 0.2  # points, of the white line around a part, and around fingers and props


def figure_stage(motion: Motion, turn: float, unit: float | None = None) -> Stage:
    """The stage of a motion whose pictures of size 1 are `unit` high, the dancer's height when left out.

    The camera stands `turn` degrees beyond its usual place, towards the dancer's left.
    """
    stage = stage_of(motion, angle=ANGLE + np.radians(turn))
    unit = unit or max(standing_height(stage.positions), 1e-9)
    return replace(stage, room=(unit, unit))


def posed(stage: Stage, frames: IntArray, middles: FloatArray) -> Stage:
    """The stage of some frames, the camera on the middle (F, 3) of each, at the height of the first."""
    return replace(stage, positions=stage.positions[frames], way=middles[:, [0, 2]], aim=float(middles[0, 1]))


def stage_shapes(stage: Stage, size: float) -> Iterator[tuple[list[Shape], FloatArray]]:
    """Shapes and shadow (corners, 2) of each frame, y up, the point that the camera looks at in the origin."""
    camera, positions = stage.camera(size, size), stage.turned(stage.positions)
    target = np.insert(stage.way, 1, stage.aim, axis=1)[:, None]
    origin = camera.to_pixels(camera.to_view(stage.turned(target), slice(None)))
    shadows = shadow_outline(stage.plan, camera, positions, slice(None))
    shapes = person_shapes(stage.plan, camera, positions, slice(None))
    for person, shadow, centre in zip(shapes, shadows, origin, strict=True):
        upright = [shape._replace(outline=(shape.outline - centre) * (1.0, -1.0)) for shape in person]
        yield upright, (shadow - centre) * (1.0, -1.0)


def middles_of(positions: FloatArray) -> FloatArray:
    """(F, 3): the middle of the extent of each pose."""
    return (positions.min(axis=1) + positions.max(axis=1)) / 2


def person_polygons(
    stage: Stage, shapes: Sequence[Shape], *, trunk: str | None = None, shade: str | None = None
) -> PolyCollection:
    """All shapes as one artist; `trunk` is the colour of trunk and head, `shade` that of all parts of a silhouette."""
    paints = [part.paint for part in stage.plan.parts]
    colours = [
        shade or (trunk if trunk and paints[shape.part] in OUTLINES else "#{:02x}{:02x}{:02x}".format(*shape.colour))
        for shape in shapes
    ]
    rims = [THIN_RIM if shape.thin else RIM for shape in shapes]
    edges = colours if shade else "white"
    return PolyCollection(
        [shape.outline for shape in shapes], facecolors=colours, edgecolors=edges, linewidths=rims, gid="person"
    )
