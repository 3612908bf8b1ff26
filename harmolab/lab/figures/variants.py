"""Means and intervals by variant: the look of each generator in all pictures, rows of marks, a grid of panels.

Colour and mark name a generator's losses; hollow is without the harmony term.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.types import FloatArray

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Look:
    """Colour and mark of one kind of motion, and its name in words."""

    label: str
    colour: str
    marker: str
    filled: bool

    @property
    def mark(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot` for a single mark."""
        return {
            "linestyle": "none",
            "marker": self.marker,
            "markersize": 8,
            "color": self.colour,
            "markerfacecolor": self.colour if self.filled else "white",
            "markeredgewidth": 1.8,
        }


# Neither colour means anything in `COLOURS`; they differ in lightness and in shape of the mark too.
_PAPER, _OURS = "#8C6D31", "#6A3D9A"

LOOKS = MappingProxyType(
    {
        "paper, without": Look("paper's losses, no harmony", _PAPER, "s", False),
        "paper": Look("paper's losses + harmony", _PAPER, "s", True),
        "recommended, without": Look("our losses, no harmony", _OURS, "o", False),
        "recommended": Look("our losses + harmony", _OURS, "o", True),
        "recorded": Look("recorded motion", COLOURS["ink"], "D", True),
    }
)
PRINTED: Mapping[str, Any] = MappingProxyType(
    {"facecolor": COLOURS["faint"], "edgecolor": COLOURS["chance"], "hatch": "//"}
)  # bars that are no generator's


def by_corpus(rows: Iterable[Record]) -> dict[str, list[Record]]:
    """Records with "corpus", by it, in the order of their first."""
    groups: dict[str, list[Record]] = {}
    for row in rows:
        groups.setdefault(row["corpus"], []).append(row)
    return groups


def rows_by_name(ax: Axes, names: Sequence[str], labels: Mapping[str, str] | None = None) -> dict[str, int]:
    """name -> height of its row on the y axis, the first on top; labelled by `labels`, else by `LOOKS`, else itself."""
    words = {name: look.label for name, look in LOOKS.items()} | dict(labels or {})
    ax.set(yticks=range(len(names)), yticklabels=[words.get(name, name) for name in reversed(names)])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.tick_params(axis="y", length=0)
    return {name: len(names) - 1 - row for row, name in enumerate(names)}


def draw_mean(ax: Axes, row: Record, place: float, look: Look, *, width: float = 2.2) -> None:
    """A mark at the mean of a record with "mean", "low" and "high", and a line over its interval if it has one."""
    if np.isfinite(row["low"]):
        ax.plot([row["low"], row["high"]], [place, place], color=look.colour, linewidth=width, zorder=2, gid="interval")
    ax.plot(row["mean"], place, **look.mark, zorder=4)


def spread(rows: Iterable[Record]) -> tuple[float, float]:
    """Least and greatest of means and ends of intervals."""
    values: FloatArray = np.array([[row["mean"], row["low"], row["high"]] for row in rows], np.float64)
    return float(np.nanmin(values)), float(np.nanmax(values))


def panels(
    rows: Iterable[Record],
    measures: Sequence[str],
    draw: Callable[[Axes, list[Record], str], object],
    *,
    size: tuple[float, float],
    top: float = 0.0,
    handles: Sequence[Artist] = (),
    legend: Literal["outside upper center", "outside lower center"] = "outside upper center",
) -> Figure:
    """A row of panels for each corpus, one for each measure; a free row of `top` inches above them if there is one.

    Parameters
    ----------
    rows : records with "corpus"
    draw : draws a measure of the records of one corpus on axes, and its title
    size : inches, width of the figure and height of a row
    handles, legend : entries of a legend in one line, and its place
    """
    by_corpus: dict[str, list[Record]] = {}
    for row in rows:
        by_corpus.setdefault(row["corpus"], []).append(row)
    heights = [*([top] if top else []), *[size[1]] * len(by_corpus)]
    columns = len(measures)
    with styled_axes((size[0], sum(heights) + 0.5), len(heights), columns, height_ratios=heights) as (figure, axes):
        cells = [(records, measure) for records in by_corpus.values() for measure in measures]
        for place, (ax, cell) in enumerate(zip(axes[columns * bool(top) :], cells, strict=True)):
            draw(ax, *cell)
            ax.tick_params(axis="y", labelleft=place % columns == 0)
        if handles:
            figure.legend(handles=handles, loc=legend, ncols=len(handles))
    return figure


def shaded(label: str) -> Patch:
    """Legend entry of a pale green region."""
    return Patch(facecolor=COLOURS["hit"], alpha=0.13, label=label)
