"""Pictures of movement on a time axis: stick figures and video frames, each at its moment, never distorted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox, DrawingArea, OffsetImage
from numpy.typing import ArrayLike, NDArray

from harmolab.lab.figures.style import COLOURS
from harmolab.skeletons import turned
from harmolab.types import FloatArray, Motion, Skeleton

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
    colour: str = COLOURS["ink"],
) -> Axes:
    """A stick figure at each time, with grey ghosts of its poses just before.

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
    turn : float, degrees
        Turns a 3-D motion about the vertical axis; at 0 the camera looks from the positive z side.
    """
    moments = np.atleast_1d(np.asarray(times, np.float64))
    levels = np.broadcast_to(np.asarray(y, np.float64), moments.shape)
    heights = np.ptp(motion.positions[..., 1], axis=1)
    places = _projected(motion, turn) * (height / max(float(heights.max()), 1e-9))
    shades = [GHOSTS[-min(len(trail) - place, len(GHOSTS))] for place in range(len(trail))]
    looks = [*((age, shade, 1.2) for age, shade in zip(trail, shades, strict=True)), (0.0, colour, 1.8)]
    for moment, level in zip(moments, levels, strict=True):
        pose = places[_frame_at(motion, moment)]
        offset = height / 2 - (pose.min(axis=0) + pose.max(axis=0)) / 2
        box = DrawingArea(height, height, clip=False)
        for age, shade, width in looks:
            earlier = places[_frame_at(motion, moment - age)]
            box.add_artist(_pose_line(earlier + offset, motion.skeleton, shade, width))
        ax.add_artist(AnnotationBbox(box, (moment, level), **BOX, gid="pose"))
    return ax


def draw_film(
    ax: Axes, motion: Motion, times: ArrayLike, span: tuple[float, float], *, height: float, **look: Any
) -> Axes:
    """`draw_poses` along the middle of axes that show nothing else of a `span` of seconds; `look` as there."""
    draw_poses(ax, motion, times, 0.5, height=height, **look)
    ax.set(xlim=span, ylim=(0.0, 1.0), yticks=[])
    ax.tick_params(axis="x", length=0, labelbottom=False)
    ax.spines[["left", "bottom"]].set_visible(False)
    return ax


def _projected(motion: Motion, turn: float) -> FloatArray:
    """(T, J, 2): to the right and upwards, as a camera far away sees the motion."""
    if motion.positions.shape[2] == 2:
        return motion.positions * (1.0, -1.0)
    return turned(motion.positions, np.radians(turn))[..., :2]


def _frame_at(motion: Motion, moment: float) -> int:
    return int(np.clip(round(moment * motion.fps), 0, motion.n_frames - 1))


def _pose_line(pose: FloatArray, skeleton: Skeleton, colour: str, width: float) -> Line2D:
    """All bones as one line with gaps; dots when there are no bones."""
    if not skeleton.bones:
        return Line2D(pose[:, 0], pose[:, 1], linestyle="none", marker=".", markersize=3, color=colour)
    gap = np.full(2, np.nan)
    path = np.array([point for parent, child in skeleton.bones for point in (pose[parent], pose[child], gap)])
    return Line2D(path[:, 0], path[:, 1], color=colour, linewidth=width, solid_capstyle="round")


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
