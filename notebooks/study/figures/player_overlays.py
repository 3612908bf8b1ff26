"""Frames of musicians: predicted points over tracked ones, and which onsets their hands hit (Figs. 7, 8, 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon

from harmolab.body.skeletons import Skeleton
from harmolab.lab.figures.beats import MARK_LOOKS, SPARE_LOOK, draw_hits, name_heights
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.readers.player_points import joint_widths
from harmolab.score import HarmonyScore
from harmolab.types import FloatArray, Motion
from study.experiments.player_frames import PickedFrame

BROAD, NARROW = 5.0, 2.0  # points, of a limb that is tracked, and predicted
FINGER = 0.5  # of a limb's width, as of the lines from shoulders to hips
HEAD, NECK = 0.2, 0.4  # radius of a drawn head, and its height above the shoulders, in shoulder widths
BODY = "#E4E4E4"
LOOKS = {
    "together": MARK_LOOKS["hit"], "a note without a movement": MARK_LOOKS["miss"],
    "a movement without a note": SPARE_LOOK,
}  # fmt: skip
MARGIN = 0.06  # of the picture, around the points
WIDTH = 10.6  # inches


def draw_points(ax: Axes, points: FloatArray, skeleton: Skeleton, *, colour: str, width: float) -> Axes:
    """The bones between points (P, 2) of a picture, y down; those of fingers and to hips thinner, dots on fingers."""
    bones = np.array(skeleton.bones, int).reshape(-1, 2)
    thin = np.array(joint_widths(skeleton)) < 1.0
    is_hip = np.array(["hip" in name for name in skeleton.joints])
    widths = width * np.where((thin | is_hip)[bones].any(axis=1), FINGER, 1.0)
    ax.add_collection(LineCollection(list(points[bones]), colors=colour, linewidths=widths, capstyle="round"))
    ax.plot(*points[thin].T, linestyle="none", marker="o", markersize=FINGER * width, color=colour)
    return ax


def head_of(points: FloatArray, skeleton: Skeleton) -> tuple[FloatArray, float] | None:
    """Centre (2,) and radius of a head over the shoulders of points (P, 2), y down; None without both shoulders.

    It is drawn so that a person is recognised at a glance: no head is tracked.
    """
    at = dict(zip(skeleton.joints, points, strict=True))
    if not {"left_shoulder", "right_shoulder"} <= at.keys():
        return None
    across = at["right_shoulder"] - at["left_shoulder"]
    up = np.array([across[1], -across[0]]) * (1.0 if across[0] > 0 else -1.0)
    return (at["left_shoulder"] + at["right_shoulder"]) / 2 + NECK * up, HEAD * float(np.hypot(*across))


def draw_tracked(ax: Axes, points: FloatArray, skeleton: Skeleton, limits: FloatArray) -> Axes:
    """Tracked points in a part of a picture, over a pale trunk and head (`head_of`) where there are points for them."""
    at, head = dict(zip(skeleton.joints, points, strict=True)), head_of(points, skeleton)
    corners = ("left_shoulder", "right_shoulder", "right_hip", "left_hip")
    trunk = [Polygon([at[name] for name in corners])] if set(corners) <= at.keys() else []
    parts = trunk if head is None else [*trunk, Circle(tuple(head[0]), head[1])]
    ax.add_collection(PatchCollection(parts, facecolor=BODY, edgecolor="none", zorder=0))
    draw_points(ax, points, skeleton, colour=COLOURS["miss"], width=BROAD)
    return frame_picture(ax, limits)


def overlay_figure(overlays: Sequence[PickedFrame], titles: Sequence[str], *, title: str, columns: int = 3) -> Figure:
    """Predicted points, narrow and green, over the tracked ones, broad and red, in one scale and frame of the picture.

    Parameters
    ----------
    overlays : frames of one set of points
    titles : one for each
    title : str, above all; says where the data are from
    columns : int
    """
    skeleton = overlays[0].skeleton
    limits = picture_limits([points for each in overlays for points in (each.tracked, each.predicted)], skeleton)
    rows = -(-len(overlays) // columns)
    across, down = np.ptp(limits, axis=0)
    height = WIDTH / columns * down / across + 0.3 + 0.18 * titles[0].count("\n")
    with styled_axes((WIDTH, rows * height + 0.55), rows, columns) as (figure, axes):
        for ax in axes[len(overlays) :]:
            ax.set_axis_off()
        for ax, overlay, words in zip(axes, overlays, titles, strict=False):
            draw_tracked(ax, overlay.tracked, skeleton, limits).set_title(words, fontsize=10)
            draw_points(ax, overlay.predicted, skeleton, colour=COLOURS["hit"], width=NARROW)
        looks = (("tracked", COLOURS["miss"], BROAD), ("predicted from the sound", COLOURS["hit"], NARROW))
        handles: list[Artist] = [Line2D([], [], color=hue, linewidth=width, label=name) for name, hue, width in looks]
        if head_of(overlays[0].tracked, skeleton) is not None:
            handles.append(Patch(facecolor=BODY, label="trunk and head: drawn, not tracked"))
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def points_figure(motion: Motion, times: Sequence[float], *, title: str) -> Figure:
    """Tracked points (T, P, 2) at some times, seconds, in a row, without any prediction."""
    frames = [motion.positions[round(time * motion.fps)] for time in times]
    limits = picture_limits(frames, motion.skeleton)
    across, down = np.ptp(limits, axis=0)
    with styled_axes((WIDTH, WIDTH / len(frames) * down / across + 0.7), 1, len(frames)) as (figure, axes):
        for ax, points, time in zip(axes, frames, times, strict=True):
            draw_tracked(ax, points, motion.skeleton, limits).set_title(f"{time:.1f} s", fontsize=10)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def picture_limits(frames: Sequence[FloatArray], skeleton: Skeleton) -> FloatArray:
    """(2, 2) low and high corner of a picture with the points of some frames (P, 2), their heads and a margin."""
    heads = [head for points in frames if (head := head_of(points, skeleton)) is not None]
    edges = [centre[None] + sign * radius for centre, radius in heads for sign in (-1.0, 1.0)]
    return with_margin(np.concatenate([*frames, *edges]))


def with_margin(places: FloatArray) -> FloatArray:
    """(2, 2) low and high corner around places (N, 2), with a margin."""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = MARGIN * float((high - low).max())
    return np.stack([low - margin, high + margin])


def frame_picture(ax: Axes, limits: FloatArray) -> Axes:
    """Axes that show a part (2, 2) of a picture, y down, undistorted, with a thin frame and no ticks."""
    (left, top), (right, bottom) = limits
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set(visible=True, color=COLOURS["faint"])
    return ax


def stills_figure(stills: Mapping[str, Sequence[FloatArray]], times: Sequence[float], *, title: str) -> Figure:
    """Rows of pictures (H, W, 3), one row a name, at the same times."""
    height, width = next(iter(stills.values()))[0].shape[:2]
    cell = (WIDTH - 0.3) / len(times)
    size = (WIDTH, len(stills) * cell * height / width + 0.55)
    with styled_axes(size, len(stills), len(times)) as (figure, axes):
        for ax, picture in zip(axes, chain.from_iterable(stills.values()), strict=True):
            ax.imshow(picture, interpolation="antialiased")
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
        for ax, time in zip(axes, times, strict=False):
            ax.set_title(f"{time:.1f} s", fontsize=10)
        for ax, name in zip(axes[:: len(times)], stills, strict=True):
            ax.set_ylabel(name, fontsize=11)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def onsets_figure(scores: Mapping[str, HarmonyScore], *, title: str, event: str, seconds: float) -> Figure:
    """The first seconds of notes (above) and of the hands' events (below), a row for each score."""
    with styled_axes((WIDTH, 2.3 * len(scores) + 0.8), len(scores), sharex=True) as (figure, axes):
        for ax, (name, score) in zip(axes, scores.items(), strict=True):
            draw_hits(ax, score.music, score.visual, score.pairs, delay=score.params.reaction_delay)
            name_heights(ax, {-0.65: event, 0.65: "notes"}).set(xlim=(0.0, seconds), xlabel="")
            words = f"{score.hits.sum()} of {score.n_audio} onsets hit, {score.chance:.0%} by chance"
            ax.set_title(f"{name}: {words}; {score.harmony_above_chance:+.2f} above chance (p = {score.p_value:.3f})")
        axes[-1].set_xlabel("time (s)")
        marks = [Line2D([], [], **look, label=label) for label, look in LOOKS.items()]
        figure.legend(handles=marks, loc="outside lower left", ncols=3)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure
