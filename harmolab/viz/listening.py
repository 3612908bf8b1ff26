"""Listening studies: who was right how often, and how answers go with scores; simulated raters are named as such."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.viz.style import COLOURS, figure_style

__all__ = ["draw_rates", "draw_scores", "rates_figure", "scores_figure", "study_title"]

Row = Mapping[str, Any]


def study_title(title: str, rows: Sequence[Row]) -> str:
    """The title of a table or figure made from `rows`, which says "simulated" if any rater was.

    >>> study_title("Right answers", [{"rate": 0.8, "simulated": True}])
    'Right answers (simulated raters, no people)'

    Raises
    ------
    ValueError
        If there are no rows, or one does not say whether its raters were simulated.
    """
    if not rows or not all(isinstance(row.get("simulated"), bool) for row in rows):
        raise ValueError('every row of a listening study must say "simulated": True or False')
    if any(row["simulated"] for row in rows):
        return f"{title} (simulated raters, no people)"
    return title


def draw_rates(ax: Axes, rows: Sequence[Row], *, label: str, title: str = "") -> Axes:
    """A share with its interval for each row: a filled dot if the interval leaves out guessing, else an open one.

    Parameters
    ----------
    ax : Axes
    rows : records with "rate", "low", "high", "n", "simulated", and "rater" or "version" as the name
    label : str, what the share is a share of
    title : str; `study_title` is added
    """
    for level, row in enumerate(rows[::-1]):
        _draw_interval(ax, level, row["rate"], row["low"], row["high"], chance=0.5)
        _note(ax, level, f"{row['rate']:.0%} of {row['n']}")
    names = [str(row.get("rater", row.get("version"))) for row in rows]
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.set(yticks=range(len(rows)), yticklabels=names[::-1], xlim=(-0.02, 1.02), ylim=(-0.6, len(rows) - 0.4))
    ax.set_xlabel(f"{label} (dotted: by guessing; lines: 95 % intervals)")
    ax.set_title(study_title(title, rows))
    return ax


def draw_scores(ax: Axes, rows: Sequence[Row], *, title: str = "") -> Axes:
    """The rank correlation of each score with the answers, on its interval; filled if that leaves out zero.

    Parameters
    ----------
    ax : Axes
    rows : records with "score", "rank", "low", "high", "simulated"
    title : str; `study_title` is added
    """
    for level, row in enumerate(rows[::-1]):
        _draw_interval(ax, level, row["rank"], row["low"], row["high"], chance=0.0)
        _note(ax, level, "undefined" if math.isnan(row["rank"]) else f"{row['rank']:+.2f}")
    ax.axvline(0.0, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.set(yticks=range(len(rows)), yticklabels=[row["score"] for row in rows[::-1]], xlim=(-1.05, 1.05))
    ax.set(ylim=(-0.6, len(rows) - 0.4), xlabel="rank correlation of score and answers (lines: 95 % intervals)")
    ax.set_title(study_title(title, rows))
    return ax


def _draw_interval(ax: Axes, level: int, value: float, low: float, high: float, *, chance: float) -> None:
    """A dot on its interval, filled if the interval leaves out chance."""
    face = COLOURS["ink"] if low > chance or high < chance else "white"
    ax.plot([low, high], [level, level], color=COLOURS["ink"], linewidth=1.5)
    ax.plot(value, level, "o", color=COLOURS["ink"], markerfacecolor=face, markersize=8)


def _note(ax: Axes, level: int, text: str) -> None:
    ax.annotate(text, (1.02, level), xycoords=("axes fraction", "data"), va="center", color=COLOURS["ink"])


def rates_figure(rows: Sequence[Row], *, label: str, title: str) -> Figure:
    """`draw_rates` in a figure of its own."""
    with figure_style():
        figure = Figure(figsize=(8.0, 1.4 + 0.35 * len(rows)), layout="constrained")
        draw_rates(figure.subplots(), rows, label=label, title=title)
    return figure


def scores_figure(rows: Sequence[Row], *, title: str) -> Figure:
    """`draw_scores` in a figure of its own."""
    with figure_style():
        figure = Figure(figsize=(8.0, 1.4 + 0.35 * len(rows)), layout="constrained")
        draw_scores(figure.subplots(), rows, title=title)
    return figure
