"""Contact sheets: whole dances as rows of stick figures, for people who want to see what numbers cannot say."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from harmolab.io.player_points import limb_widths
from harmolab.lab.figures.style import COLOURS, figure_style
from harmolab.skeletons import joint_side, mean_heading, skull_and_limbs, standing_height, turned
from harmolab.types import FloatArray, Motion, Skeleton

WIDTH = 1600 / 150  # inches: 1600 pixels at the resolution that figures are saved in
CELL = (0.74, 1.42)  # room of a figure across and up, in heights of the dancer
TITLE = 0.22  # the same, of a dance's name
SKULL = 0.13
SIDES: Mapping[str, str] = MappingProxyType({"left": COLOURS["audio"], "right": COLOURS["miss"], "": COLOURS["ink"]})


def contact_sheet(motions: Mapping[str, Motion], *, every: float = 0.5, columns: int = 20, turn: float = 0.0) -> Figure:
    """Dances one below the other, each as rows of stick figures at even intervals.

    Every dancer is seen from where she faces on average, by a camera that stands still in its direction but goes along
    with the dancer: turns show, travel does not. All figures of a dance stand on one floor and are drawn in one scale,
    heights of the dancer; what is thin is far away. Left limbs are blue, right ones red. Seconds stand below.

    Parameters
    ----------
    motions : label -> Motion; of 2-D motion the picture itself is drawn
    every : float, seconds from one figure to the next
    columns : int, figures in a row
    turn : float, degrees that the camera stands to the side

    Raises
    ------
    ValueError
        If there is no motion, or `every` or `columns` is not positive.
    """
    if not motions:
        raise ValueError("a contact sheet needs at least one motion")
    if not 0 < every < math.inf or columns < 1:
        raise ValueError(f"every and columns must be positive, got {every} and {columns}")
    times = [np.arange(0.0, motion.duration - 0.5 / motion.fps, every) for motion in motions.values()]
    tops = np.cumsum([0.0, *(math.ceil(len(moments) / columns) * CELL[1] + TITLE for moments in times)])
    width = columns * CELL[0]
    with figure_style():
        figure = Figure(figsize=(WIDTH, WIDTH * tops[-1] / width))
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width), ylim=(-tops[-1], 0.0))
        ax.set_axis_off()
        for (label, motion), moments, top in zip(motions.items(), times, -tops[:-1], strict=True):
            ax.text(0.1, top - 0.04, label, va="top", fontweight="bold", color=COLOURS["ink"])
            _draw_dance(ax, motion, moments, columns, turn, top - TITLE)
    return figure


def _draw_dance(ax: Axes, motion: Motion, moments: FloatArray, columns: int, turn: float, top: float) -> None:
    """The figures of one dance, row by row from the top; one unit of the axes is the dancer's height."""
    number = np.arange(len(moments))
    feet = np.stack([(number % columns + 0.5) * CELL[0], top - (number // columns + 0.88) * CELL[1]], axis=1)
    frames = np.clip(np.rint(moments * motion.fps).astype(np.int64), 0, motion.n_frames - 1)
    figures = _from_camera(motion, turn)[frames]
    figures[..., :2] += feet[:, None]
    floors = np.unique(feet[:, 1])
    ax.hlines(floors, 0.1, columns * CELL[0] - 0.1, color=COLOURS["faint"], linewidth=0.8, zorder=0)
    _draw_figures(ax, figures, motion.skeleton)
    for moment, (x, y) in zip(moments, feet, strict=True):
        ax.text(x, y - 0.03, f"{round(moment, 2):g}", ha="center", va="top", fontsize=6.5, color=COLOURS["chance"])


def _from_camera(motion: Motion, turn: float) -> FloatArray:
    """(T, J, 3): across from the middle of the dancer, up from the floor, and towards the camera, in body heights."""
    positions = motion.positions
    if positions.shape[2] == 2:
        positions = np.concatenate([positions * (1.0, -1.0), np.zeros_like(positions[..., :1])], axis=2)
    else:
        positions = turned(positions, np.radians(turn) - mean_heading(positions, motion.fps, motion.skeleton))
    middle = (positions[..., 0].min(axis=1) + positions[..., 0].max(axis=1)) / 2
    floor = np.percentile(positions[..., 1].min(axis=1), 5)
    origin = np.stack([middle, np.full_like(middle, floor), positions[..., 2].mean(axis=1)], axis=1)
    return (positions - origin[:, None]) / max(standing_height(positions), 1e-9)


def _draw_figures(ax: Axes, figures: FloatArray, skeleton: Skeleton) -> None:
    """All stick figures (P, J, 3) as one collection of limbs, far ones first and thinner, and one of heads."""
    skull, limbs = skull_and_limbs(skeleton)
    if not limbs:
        ax.plot(*figures[..., :2].reshape(-1, 2).T, linestyle="none", marker=".", markersize=3, color=COLOURS["ink"])
        return
    parents, joints = np.array(limbs).T
    depth = (figures[:, parents, 2] + figures[:, joints, 2]) / 2
    order = np.argsort(depth, axis=1)
    lines = np.stack([figures[:, parents, :2], figures[:, joints, :2]], axis=2)
    sides = [_limb_side(skeleton, parent, joint) for parent, joint in limbs]
    colours = [SIDES[sides[limb]] for limb in order.ravel()]
    widths = np.interp(np.take_along_axis(depth, order, axis=1).ravel(), (-0.2, 0.2), (1.1, 2.0))
    widths = widths * np.array(limb_widths(skeleton, limbs))[order].ravel()
    segments = np.take_along_axis(lines, order[..., None, None], axis=1).reshape(-1, 2, 2)
    ax.add_collection(LineCollection(list(segments), colors=colours, linewidths=widths, capstyle="round", gid="limbs"))
    if skull:
        balls = [Circle(tuple(head), SKULL / 2) for head in figures[:, skull, :2].mean(axis=1)]
        ax.add_collection(PatchCollection(balls, facecolor="white", edgecolor=COLOURS["ink"], linewidth=1.2, zorder=3))


def _limb_side(skeleton: Skeleton, parent: int, joint: int) -> str:
    """The side of a limb: that of its joints, none where it lies across or in the middle."""
    sides = {joint_side(skeleton.joints[parent]), joint_side(skeleton.joints[joint])}
    return sides.pop() if len(sides) == 1 else ""
