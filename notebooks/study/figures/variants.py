"""Means and intervals by variant: the look of each generator in all pictures, rows of marks.

Colour and mark name a generator's losses; hollow is without the harmony term.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from harmolab.lab.figures.style import COLOURS
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
