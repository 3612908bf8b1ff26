"""Table 2 of Music2Dance as a picture: error and sliding by what is done about feet."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import Look, draw_mean, rows_by_name
from study.figures.words import corpus_words, count_words, sentence

RECORDED, UNTOUCHED = "recorded", "no correction"
MEASURES = ("MSE", "lower body (cm)", "sliding (cm/s)")
LEARNT = ", figures learnt"  # added to the name of a measure
LINES: Mapping[str, dict[str, Any]] = MappingProxyType(
    {UNTOUCHED: {"color": COLOURS["miss"], "linestyle": "--"}, RECORDED: {"color": COLOURS["chance"], "linestyle": ":"}}
)
_LEARNT_MARK: dict[str, Any] = {"marker": "x", "markersize": 7, "color": COLOURS["chance"], "markeredgewidth": 1.8}


def draw_ways(ax: Axes, rows: pd.DataFrame, *, measure: str) -> Axes:
    """A mark with its interval for each way to treat feet; lines: no correction, and recorded; crosses: figures learnt.

    Parameters
    ----------
    ax : Axes
    rows : of one corpus and code, with "feet", "trainings", and of the measure the mean, low and high
    measure : name of a column
    """
    every = rows.set_index("feet")
    table = every.drop(index=list(LINES))
    places = rows_by_name(ax, [*table.index], {feet: feet.replace(", ", ",\n") for feet in table.index})
    for feet, row in table.iterrows():
        mean = {"mean": row[measure], "low": row[f"{measure}, low"], "high": row[f"{measure}, high"]}
        draw_mean(ax, mean, places[str(feet)], Look("", COLOURS["ink"], "o", filled=row["trainings"] > 0))
        if row["trainings"] and f"{measure}{LEARNT}" in row:
            ax.plot(row[f"{measure}{LEARNT}"], places[str(feet)], linestyle="none", **_LEARNT_MARK)
    for feet, look in LINES.items():
        if value := every[measure][feet]:
            ax.axvline(value, **look, gid=feet)
    ax.margins(x=0.12)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    return ax


def ways_figure(rows: pd.DataFrame) -> Figure:
    """`draw_ways` for error and sliding: a row of panels for each corpus and motion code of Table 2."""
    groups = rows.groupby(["corpus", "code"], sort=False)
    with styled_axes((9.2, 3.0 * len(groups) + 1.0), len(groups), len(MEASURES)) as (figure, axes):
        for line, ((corpus, code), table) in enumerate(groups):
            own = axes[len(MEASURES) * line : len(MEASURES) * (line + 1)]
            for ax, measure in zip(own, MEASURES, strict=True):
                draw_ways(ax, table, measure=measure).tick_params(axis="y", labelleft=ax is own[0])
                unit = f" ({table['unit of MSE'].iloc[0]})" if measure == "MSE" else ""
                ax.set_xlabel(f"{measure}{unit}")
            own[0].set_title(f"{sentence(corpus_words(str(corpus)))}, code of {code}")
        names = {"trained, 95 % over trainings": True, "not trained": False}
        looks = [Look(name, COLOURS["ink"], "o", filled) for name, filled in names.items()]
        handles = [
            *(Line2D([], [], **look.mark, label=look.label) for look in looks),
            Line2D([], [], linestyle="none", **_LEARNT_MARK, label="on the figures learnt"),
            *(Line2D([], [], **look, label=name) for name, look in LINES.items()),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        figure.suptitle(_ways_title(rows), x=0.01, ha="left", fontsize=11.5)
    return figure


def _ways_title(table: pd.DataFrame) -> str:
    """Learnt corrections with less error, and with less sliding, than no correction."""
    bare = table[table["feet"] == UNTOUCHED].set_index(["corpus", "code"])
    learnt = table[(table["trainings"] > 0) & np.isfinite(table["MSE"])].set_index(["corpus", "code"])
    less = {name: learnt[name] < bare[name].reindex(learnt.index) for name in ("MSE", "sliding (cm/s)")}
    error, sliding = (count_words(int(own.sum()), len(own)) for own in less.values())
    return f"Learnt foot models beside no correction: less error with {error}, less sliding with {sliding}"
