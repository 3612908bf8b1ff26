"""Pictures of movement on a time axis: stick figures and video frames, each at its moment, never distorted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox, DrawingArea, OffsetImage
from numpy.typing import ArrayLike, NDArray

from harmolab.lab.figures.style import COLOURS
from harmolab.skeletons import turned
from harmolab.types import FloatArray, Motion, Skeleton

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
    """A stick figure at each time, with grey ghosts of where it was just before.

    A figure in motion is smeared by its ghosts; one at rest covers them. The figures keep their proportions whatever
    the axes are, and are centred on the dancer.

    Parameters
    ----------
    ax : Axes with time in seconds on the x axis
    motion : Motion; a skeleton without bones is drawn as dots
    times : (P,) array, seconds of the motion
    y : float or (P,) array, where the figures stand on the y axis (their middle)
    height : float, points, of a picture as high as the dancer stretches anywhere in the motion
    trail : seconds, how long ago each ghost was, oldest first; empty for none
    turn : float, degrees
        Turns a 3-D motion about the vertical axis; at 0 the camera looks from the positive z side.
    """
    moments = np.atleast_1d(np.asarray(times, np.float64))
    levels = np.broadcast_to(np.asarray(y, np.float64), moments.shape)
    stretch = np.ptp(motion.positions[..., 1], axis=1).max()
    places = _seen(motion, turn) * (height / max(float(stretch), 1e-9))
    for moment, level in zip(moments, levels, strict=True):
        box = DrawingArea(height, height, clip=False)
        for line in _figures(places, motion, moment, trail, colour, middle=height / 2):
            box.add_artist(line)
        figure = AnnotationBbox(box, (moment, level), frameon=False, pad=0.0, annotation_clip=False)
        figure.set_gid("pose")
        ax.add_artist(figure)
    return ax


def _seen(motion: Motion, turn: float) -> FloatArray:
    """(T, J, 2): to the right and upwards, as a camera far away sees the motion."""
    if motion.positions.shape[2] == 2:
        return motion.positions * (1.0, -1.0)
    return turned(motion.positions, np.radians(turn))[..., :2]


def _figures(
    places: FloatArray, motion: Motion, moment: float, trail: Sequence[float], colour: str, *, middle: float
) -> Iterator[Line2D]:
    """The ghosts, then the pose, which is centred on (middle, middle)."""
    now = places[_frame_at(motion, moment)]
    offset = middle - (now.min(axis=0) + now.max(axis=0)) / 2
    shades = [GHOSTS[-min(len(trail) - place, len(GHOSTS))] for place in range(len(trail))]
    for age, shade in zip(trail, shades, strict=True):
        yield _pose_line(places[_frame_at(motion, moment - age)] + offset, motion.skeleton, shade, 1.2)
    yield _pose_line(now + offset, motion.skeleton, colour, 1.8)


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
        shown = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
        image = OffsetImage(shown, zoom=width / shown.shape[1], interpolation="antialiased")
        box = AnnotationBbox(image, (moment, y), frameon=False, pad=0.0, annotation_clip=False)
        box.set_gid("frame")
        ax.add_artist(box)
    return ax
