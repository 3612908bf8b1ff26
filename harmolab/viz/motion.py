"""Pictures of movement on a time axis: stick figures and video frames, each at its moment, never distorted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox, DrawingArea, OffsetImage
from numpy.typing import ArrayLike, NDArray

from harmolab.types import Motion
from harmolab.viz.style import COLOURS

__all__ = ["draw_frames", "draw_poses"]

FloatArray = NDArray[np.float64]

GHOSTS = ("#C9C9C9", "#A8A8A8")  # oldest first


def draw_poses(
    ax: Axes,
    motion: Motion,
    times: ArrayLike,
    y: ArrayLike,
    *,
    height: float = 55.0,
    trail: Sequence[float] = (0.16, 0.08),
    colour: str = COLOURS["ink"],
) -> Axes:
    """A stick figure at each time, seen from the front, with grey ghosts of where it was just before.

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
    """
    moments = np.atleast_1d(np.asarray(times, np.float64))
    levels = np.broadcast_to(np.asarray(y, np.float64), moments.shape)
    scale = height / max(_stretch(motion), 1e-9)
    for moment, level in zip(moments, levels, strict=True):
        box = _pose_box(motion, moment, tuple(trail), scale, height, colour)
        figure = AnnotationBbox(box, (moment, level), frameon=False, pad=0.0, annotation_clip=False)
        figure.set_gid("pose")
        ax.add_artist(figure)
    return ax


def _stretch(motion: Motion) -> float:
    """Largest extent of a single pose, vertical, in units of the motion."""
    return float(np.ptp(motion.positions[..., 1], axis=1).max())


def _frame_at(motion: Motion, moment: float) -> int:
    return int(np.clip(round(moment * motion.fps), 0, motion.n_frames - 1))


def _pose_box(
    motion: Motion, moment: float, trail: tuple[float, ...], scale: float, height: float, colour: str
) -> DrawingArea:
    """The pose and its ghosts in a box of `height` points."""
    now = motion.positions[_frame_at(motion, moment)]
    middle = (now[:, :2].min(axis=0) + now[:, :2].max(axis=0)) / 2
    upward = 1.0 if motion.positions.shape[2] == 3 else -1.0
    box = DrawingArea(height, height, clip=False)
    past = [(moment - age, ghost) for age, ghost in zip(trail, GHOSTS[-len(trail) :] if trail else (), strict=True)]
    for when, shade in [*past, (moment, colour)]:
        pose = (motion.positions[_frame_at(motion, when), :, :2] - middle) * (scale, upward * scale) + height / 2
        for line in _pose_lines(pose, motion.skeleton.bones, shade, 1.6 if shade == colour else 1.1):
            box.add_artist(line)
    return box


def _pose_lines(pose: FloatArray, bones: tuple[tuple[int, int], ...], colour: str, width: float) -> list[Line2D]:
    """All bones as one line with gaps; dots when there are no bones."""
    if not bones:
        return [Line2D(pose[:, 0], pose[:, 1], linestyle="none", marker=".", markersize=3, color=colour)]
    gap = np.full(2, np.nan)
    path = np.array([point for parent, child in bones for point in (pose[parent], pose[child], gap)])
    return [Line2D(path[:, 0], path[:, 1], color=colour, linewidth=width, solid_capstyle="round")]


def draw_frames(
    ax: Axes, frames: Iterable[NDArray[np.uint8]], times: ArrayLike, y: float = 0.5, *, width: float = 68.0
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
