"""Table 2 of Music2Dance as a picture: error and sliding by what is done about feet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import Look, Record, draw_mean, rows_by_name
from study.figures.words import corpus_words, count_words, sentence

RECORDED, UNTOUCHED = "recorded", "no correction"
MEASURES = ("MSE", "lower body (cm)", "sliding (cm/s)")
LEARNT = ", figures learnt"  # added to the name of a measure
_LEARNT_MARK: Mapping[str, Any] = MappingProxyType(
    {"linestyle": "none", "marker": "x", "markersize": 7, "color": COLOURS["chance"], "markeredgewidth": 1.8}
)


def draw_ways(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """A mark with its interval for each way to treat feet; lines: no correction, and recorded; crosses: figures learnt.

    Parameters
    ----------
    ax : Axes
    rows : records of one corpus and code, with "feet", "trainings", and of the measure the mean, low and high
    measure : name of a column
    """
    table = [row for row in rows if row["feet"] not in (RECORDED, UNTOUCHED)]
    lines = {row["feet"]: row[measure] for row in rows if row["feet"] in (RECORDED, UNTOUCHED)}
    labels = {row["feet"]: row["feet"].replace(", ", ",\n") for row in table}
    places = rows_by_name(ax, list(labels), labels)
    for row in table:
        look = Look(row["feet"], COLOURS["ink"], "o", filled=row["trainings"] > 0)
        if np.isfinite(row[measure]):
            mean = {"mean": row[measure], "low": row[f"{measure}, low"], "high": row[f"{measure}, high"]}
            draw_mean(ax, mean, places[row["feet"]], look)
        if row["trainings"] and f"{measure}{LEARNT}" in row:
            ax.plot(row[f"{measure}{LEARNT}"], places[row["feet"]], **_LEARNT_MARK)
    ax.axvline(lines[UNTOUCHED], color=COLOURS["miss"], linestyle="--", linewidth=1.2, gid=UNTOUCHED)
    if lines[RECORDED]:
        ax.axvline(lines[RECORDED], color=COLOURS["chance"], linestyle=":", linewidth=1.5, gid=RECORDED)
    ax.margins(x=0.12)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    return ax


def ways_figure(rows: Iterable[Record]) -> Figure:
    """`draw_ways` for error and sliding: a row of panels for each corpus and motion code.

    Parameters
    ----------
    rows : records of Table 2
    """
    every, groups = list(rows), dict[tuple[str, str], list[Record]]()
    for row in every:
        groups.setdefault((row["corpus"], row["code"]), []).append(row)
    size = (9.2, 3.0 * len(groups) + 1.0)
    with styled_axes(size, len(groups), len(MEASURES)) as (figure, axes):
        for line, ((corpus, code), table) in enumerate(groups.items()):
            for place, measure in enumerate(MEASURES):
                ax = draw_ways(axes[len(MEASURES) * line + place], table, measure=measure)
                unit = f" ({table[0]['unit of MSE']})" if measure == "MSE" else ""
                ax.set_xlabel(f"{measure}{unit}")
                ax.tick_params(axis="y", labelleft=place == 0)
            axes[len(MEASURES) * line].set_title(f"{sentence(corpus_words(corpus))}, code of {code}")
        handles = [
            Line2D([], [], **Look("", COLOURS["ink"], "o", filled=True).mark, label="trained, 95 % over trainings"),
            Line2D([], [], **Look("", COLOURS["ink"], "o", filled=False).mark, label="not trained"),
            Line2D([], [], **_LEARNT_MARK, label="on the figures learnt"),
            Line2D([], [], color=COLOURS["miss"], linestyle="--", label=UNTOUCHED),
            Line2D([], [], color=COLOURS["chance"], linestyle=":", label=RECORDED),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        figure.suptitle(_ways_title(every), x=0.01, ha="left", fontsize=11.5)
    return figure


def _ways_title(rows: Sequence[Record]) -> str:
    """Learnt corrections with less error, and with less sliding, than no correction."""
    bare = {(row["corpus"], row["code"]): row for row in rows if row["feet"] == UNTOUCHED}
    pairs = [(row, bare[row["corpus"], row["code"]]) for row in rows if row["trainings"] and np.isfinite(row["MSE"])]
    error, sliding = (
        count_words(sum(own[measure] < before[measure] for own, before in pairs), len(pairs))
        for measure in ("MSE", "sliding (cm/s)")
    )
    return f"Learnt foot models beside no correction: less error with {error}, less sliding with {sliding}"
