"""Boxes and arrows on axes whose units are inches, so that text fits whatever the figure holds."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Patch
from matplotlib.path import Path as Outline

from harmolab.viz.style import COLOURS

__all__ = ["DASHES", "TINTS", "count_text", "draw_arrow", "draw_box", "inch_axes", "shape_text", "tint_legend"]

# Pale forms of the colours for music and movement, dark enough to be told apart without their edges.
TINTS = {"audio": "#D3E5F1", "motion": "#FBE5BC", "both": "#F2F2F2"}
_EDGES = {"audio": COLOURS["audio"], "motion": COLOURS["visual"], "both": COLOURS["chance"]}
DASHES = (0, (4, 2))
_FONT = 8.5
_LINE = 0.155  # inches from one line of text to the next


def inch_axes(figure: Figure, corner: tuple[float, float], size: tuple[float, float]) -> Axes:
    """Axes without a frame, `size` inches large with the lower left corner at `corner`; y grows upwards from 0."""
    width, height = figure.get_size_inches()
    ax = figure.add_axes((corner[0] / width, corner[1] / height, size[0] / width, size[1] / height))
    ax.set(xlim=(0.0, size[0]), ylim=(0.0, size[1]))
    ax.axis("off")
    return ax


def draw_box(
    ax: Axes,
    middle: tuple[float, float],
    lines: Sequence[str],
    *,
    tint: str = "both",
    width: float = 1.5,
    height: float | None = None,
    rounded: bool = True,
) -> float:
    """Half the height of the box just drawn: a title in bold with lines under it.

    Parameters
    ----------
    ax : Axes in inches
    middle : (x, y)
    lines : title, and what stands below it
    tint : name in `TINTS`: what the box is about
    width, height : inches; the height that the lines need when left out
    rounded : round corners mark what computes, sharp ones mark signals
    """
    tall = height or _LINE * len(lines) + 0.13
    style = "round,pad=0,rounding_size=0.08" if rounded else "square,pad=0"
    corner = (middle[0] - width / 2, middle[1] - tall / 2)
    box = FancyBboxPatch(corner, width, tall, boxstyle=style, facecolor=TINTS[tint], edgecolor=_EDGES[tint], zorder=2)
    box.set_gid("box")
    ax.add_patch(box)
    top = middle[1] + _LINE * (len(lines) - 1) / 2
    for row, line in enumerate(lines):
        weight = "bold" if row == 0 else "normal"
        place = (middle[0], top - row * _LINE)
        ax.text(*place, line, ha="center", va="center", fontsize=_FONT, weight=weight, color=COLOURS["ink"], zorder=3)
    return tall / 2


def draw_arrow(
    ax: Axes, points: Sequence[tuple[float, float]], *, dashed: bool = False, colour: str = COLOURS["ink"]
) -> FancyArrowPatch:
    """An arrow along straight pieces from the first point to the last."""
    outline = Outline(list(points), [Outline.MOVETO, *[Outline.LINETO] * (len(points) - 1)])
    arrow = FancyArrowPatch(
        path=outline, arrowstyle="-|>", mutation_scale=9, linewidth=1.1, edgecolor=colour, facecolor=colour,
        joinstyle="miter", zorder=1, linestyle=DASHES if dashed else "-", shrinkA=0, shrinkB=0,
    )  # fmt: skip
    arrow.set_gid("arrow")
    ax.add_patch(arrow)
    return arrow


def tint_legend() -> list[Patch]:
    """Handles that say what the tints mean."""
    words = {"audio": "music", "motion": "movement", "both": "both"}
    return [Patch(facecolor=TINTS[tint], edgecolor=_EDGES[tint], label=word) for tint, word in words.items()]


def count_text(count: int) -> str:
    """A number of parameters as it is read out.

    >>> count_text(23), count_text(1_234), count_text(139_392), count_text(8_123_456)
    ('23', '1.2 k', '139 k', '8.1 M')
    """
    for unit, sign in ((1_000_000, " M"), (1_000, " k")):
        if count >= unit:
            value = count / unit
            return f"{value:.1f}{sign}" if value < 99.95 else f"{value:.0f}{sign}"
    return str(count)


def shape_text(shape: Sequence[int], batch: int) -> str:
    """The shape of one clip's share in a batch; clips that were cut into several pieces have their number in front.

    >>> shape_text((10, 60), 10), shape_text((50, 128), 10), shape_text((10,), 10)
    ('60', '5 of 128', '1')
    """
    first, *rest = shape
    pieces = first // batch
    inside = " \N{MULTIPLICATION SIGN} ".join(str(size) for size in rest) or "1"
    return f"{pieces} of {inside}" if pieces > 1 else inside
