"""Listening studies (user studies): share of right answers of each rater; simulated raters are named as such."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import Look, Record, draw_mean


def study_title(title: str, rows: Sequence[Record]) -> str:
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


def draw_rates(ax: Axes, rows: Sequence[Record], *, label: str, title: str = "") -> Axes:
    """A share with its interval for each row: a filled dot if the interval leaves out guessing, else an open one.

    Parameters
    ----------
    ax : Axes
    rows : records with "rate", "low", "high", "n", "simulated", and "rater" or "version" as the name
    label : str, name of the share
    title : str; `study_title` is added
    """
    for level, row in enumerate(rows[::-1]):
        look = Look("", COLOURS["ink"], "o", filled=row["low"] > 0.5 or row["high"] < 0.5)
        draw_mean(ax, {**row, "mean": row["rate"]}, level, look, width=1.5)
        text, place = f"{row['rate']:.0%} of {row['n']}", (1.02, level)
        ax.annotate(text, place, xycoords=("axes fraction", "data"), va="center", color=COLOURS["ink"])
    names = [str(row.get("rater", row.get("version"))) for row in rows]
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.set(yticks=range(len(rows)), yticklabels=names[::-1], xlim=(-0.02, 1.02), ylim=(-0.6, len(rows) - 0.4))
    ax.set_xlabel(f"{label} (dotted: by guessing; lines: 95 % intervals)")
    ax.set_title(study_title(title, rows))
    if any(row["simulated"] for row in rows):
        ax.text(
            0.25, 0.5, "simulated: no people", transform=ax.transAxes, ha="center", va="center", rotation=12,
            fontsize=22, fontweight="bold", color=COLOURS["faint"], zorder=0, gid="watermark",
        )  # fmt: skip
    return ax


def rates_figure(rows: Sequence[Record], *, label: str, title: str) -> Figure:
    """`draw_rates` in a figure of its own."""
    with styled_axes((8.0, 1.4 + 0.35 * len(rows))) as (figure, (ax,)):
        draw_rates(ax, rows, label=label, title=title)
    return figure
