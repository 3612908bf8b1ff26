"""Listening studies (user studies): share of right answers of each rater; simulated raters are named as such."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import Look, Record, draw_mean, rows_by_name


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


def rates_figure(rows: Sequence[Record], *, label: str, title: str) -> Figure:
    """A share with its interval for each row: a filled dot if the interval leaves out guessing, else an open one.

    Parameters
    ----------
    rows : records with "rate", "low", "high", "n", "simulated", and "rater" or "version" as the name
    label : str, name of the share
    title : str; `study_title` is added
    """
    title = study_title(title, rows)
    with styled_axes((8.0, 1.4 + 0.35 * len(rows))) as (figure, (ax,)):
        places = rows_by_name(ax, [str(row.get("rater", row.get("version"))) for row in rows])
        for row, place in zip(rows, places.values(), strict=True):
            look = Look("", COLOURS["ink"], "o", filled=row["low"] > 0.5 or row["high"] < 0.5)
            draw_mean(ax, {**row, "mean": row["rate"]}, place, look, width=1.5)
            text, at = f"{row['rate']:.0%} of {row['n']}", (1.02, place)
            ax.annotate(text, at, xycoords=("axes fraction", "data"), va="center", color=COLOURS["ink"])
        ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
        ax.set(xlim=(-0.02, 1.02), xlabel=f"{label} (dotted: by guessing; lines: 95 % intervals)")
        ax.set_title(title)
        if any(row["simulated"] for row in rows):
            ax.text(
                0.25, 0.5, "simulated: no people", transform=ax.transAxes, ha="center", va="center", rotation=12,
                fontsize=22, fontweight="bold", color=COLOURS["faint"], zorder=0, gid="watermark",
            )  # fmt: skip
    return figure
