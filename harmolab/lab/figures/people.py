"""People in figures: the shapes of `harmolab.lab.person` as polygons of matplotlib, and poses along a time axis.

On a time axis people and video frames stand each at its moment, never distorted.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox, DrawingArea
from numpy.typing import ArrayLike

from harmolab.body.skeletons import standing_height
from harmolab.lab.figures.style import styled_axes
from harmolab.lab.person import ANGLE, OUTLINES, Shape, Stage, person_shapes, shadow_outline, stage_of
from harmolab.types import FloatArray, IntArray, Motion, check_kind

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


# People and video frames on a time axis

BOX: Mapping[str, Any] = MappingProxyType({"frameon": False, "pad": 0.0, "annotation_clip": False})
GHOSTS = ("#C9C9C9", "#A8A8A8")  # oldest first


def draw_poses(
    ax: Axes,
    motion: Motion,
    times: ArrayLike,
    y: ArrayLike,
    *,
    height: float = 75.0,
    trail: Sequence[float] = (0.16, 0.08),
    turn: float = 0.0,
    colour: str | None = None,
) -> Axes:
    """Draw the dancer on a time axis: a person at each time, with grey ghosts of the poses just before.

    The ghosts of a figure in motion stand beside it; one at rest covers them. The figures keep their proportions
    whatever the axes are.

    Parameters
    ----------
    ax : Axes
        With time in seconds on the x axis.
    motion : Motion
        A skeleton without bones is drawn as dots.
    times : (P,) array, seconds of the motion
    y : float or (P,) array
        Places of the middles of the figures on the y axis.
    height : float, points
        Height of a figure that is as high as the dancer ever stretches in the motion.
    trail : sequence of float, seconds
        Time from each ghost to the figure, oldest first; empty for none.
    turn : float, degrees
        So much farther to the dancer's left the camera stands than in all other pictures.
    colour : str
        Of trunk and head, in place of their own.

    Returns
    -------
    The Axes

    Raises
    ------
    ValueError
        Unless a Motion is passed.
    """
    check_kind(motion, Motion)
    moments = np.atleast_1d(np.asarray(times, np.float64))
    levels = np.broadcast_to(np.asarray(y, np.float64), moments.shape)
    tallest = max(float(np.ptp(motion.positions[..., 1], axis=1).max()), 1e-9)
    stage = figure_stage(motion, turn, tallest)
    shades = [GHOSTS[-min(len(trail) - place, len(GHOSTS))] for place in range(len(trail))]
    for moment, level in zip(moments, levels, strict=True):
        seconds = moment - np.array([*trail, 0.0])
        frames = np.clip(np.rint(seconds * motion.fps), 0, motion.n_frames - 1).astype(np.int64)
        middle = middles_of(stage.positions[frames[-1:]])
        *ghosts, (person, _) = stage_shapes(posed(stage, frames, middle.repeat(len(frames), axis=0)), height)
        box = DrawingArea(height, height, clip=False)
        for (earlier, _), shade in zip(ghosts, shades, strict=True):
            box.add_artist(person_polygons(stage, _centred(earlier, height), shade=shade))
        box.add_artist(person_polygons(stage, _centred(person, height), trunk=colour))
        ax.add_artist(AnnotationBbox(box, (moment, level), **BOX, gid="pose"))
    return ax


def _centred(shapes: list[Shape], height: float) -> list[Shape]:
    return [shape._replace(outline=shape.outline + height / 2) for shape in shapes]


def draw_film(
    ax: Axes, motion: Motion, times: ArrayLike, span: tuple[float, float], *, height: float, **look: Any
) -> Axes:
    """`draw_poses` along the middle of axes that show nothing else of a `span` of seconds; `look` as there."""
    draw_poses(ax, motion, times, 0.5, height=height, **look)
    ax.set(xlim=span, ylim=(0.0, 1.0), yticks=[])
    ax.tick_params(axis="x", length=0, labelbottom=False)
    ax.spines[["left", "bottom"]].set_visible(False)
    return ax


def pose_row(motion: Motion, *, count: int = 9) -> Figure:
    """`count` people at even intervals from the first frame to the last, with their seconds."""
    times = np.linspace(0.0, (motion.n_frames - 1) / motion.fps, count)
    margin = times[1] / 2
    with styled_axes((9.0, 1.4)) as (figure, [ax]):
        draw_film(ax, motion, times, (-margin, times[-1] + margin), height=75.0, trail=())
        ax.set(xticks=times, xticklabels=[f"{time:.2f} s" for time in times])
        ax.tick_params(axis="x", labelbottom=True)
    return figure
