"""Pictures of movement on a time axis: people and video frames, each at its moment, never distorted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.offsetbox import AnnotationBbox, DrawingArea, OffsetImage
from numpy.typing import ArrayLike, NDArray

from harmolab.lab.figures.people import figure_stage, middles_of, person_polygons, posed, stage_shapes
from harmolab.lab.person.shapes import Shape
from harmolab.types import Motion

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
    """A person at each time, with grey ghosts of the poses just before.

    A figure in motion is smeared by its ghosts; one at rest covers them. The figures keep their proportions whatever
    the axes are, and are centred on the dancer.

    Parameters
    ----------
    ax : Axes with time in seconds on the x axis
    motion : Motion; a skeleton without bones is drawn as dots
    times : (P,) array, seconds of the motion
    y : float or (P,) array, where the figures stand on the y axis (their middle)
    height : float, points, of a picture as high as the dancer stretches anywhere in the motion
    trail : seconds from each ghost to the figure, oldest first; empty for none
    turn : float, degrees that the camera stands farther to the dancer's left than in all other pictures
    colour : of trunk and head, in place of their own
    """
    moments = np.atleast_1d(np.asarray(times, np.float64))
    levels = np.broadcast_to(np.asarray(y, np.float64), moments.shape)
    tallest = max(float(np.ptp(motion.positions[..., 1], axis=1).max()), 1e-9)
    stage = figure_stage(motion, turn, tallest)
    shades = [GHOSTS[-min(len(trail) - place, len(GHOSTS))] for place in range(len(trail))]
    for moment, level in zip(moments, levels, strict=True):
        frames = np.array([_frame_at(motion, moment - age) for age in (*trail, 0.0)])
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


def _frame_at(motion: Motion, moment: float) -> int:
    return int(np.clip(round(moment * motion.fps), 0, motion.n_frames - 1))


def draw_frames(
    ax: Axes, frames: Iterable[NDArray[np.uint8]], times: ArrayLike, y: float = 0.5, *, width: float = 75.0
) -> Axes:
    """Pictures of a video, each centred on its time.

    Parameters
    ----------
    ax : Axes with time in seconds on the x axis
    frames : iterable of (H, W) grey or (H, W, 3) RGB uint8 arrays, one for each time
    times : (P,) array, seconds
    y : float, where they stand on the y axis
    width : float, points of one picture
    """
    for frame, moment in zip(frames, np.atleast_1d(np.asarray(times, np.float64)), strict=True):
        picture = np.asarray(frame)
        picture = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
        image = OffsetImage(picture, zoom=width / picture.shape[1], interpolation="antialiased")
        ax.add_artist(AnnotationBbox(image, (moment, y), **BOX, gid="frame"))
    return ax
