"""Pictures of the recommended score at work: false alarms, and levels of recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.verdict.judge import LEVELS
from study.figures.variants import Record, rows_by_name
from study.figures.words import corpus_words, sentence

NOMINAL, EDGE = 0.05, 0.42
FEWEST_ALARMS = 5  # expected in a row, below which its share says nothing
P_LOOKS: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        "old p": {"marker": "X", "markersize": 7, "color": COLOURS["miss"], "label": "old score, published"},
        "p_time": {"marker": "s", "markersize": 10, "color": "#56B4E9", "markerfacecolor": "none", "label": "in time?"},
        "p": {"marker": "o", "markersize": 5, "color": COLOURS["ink"], "label": "H: in time, and where"},
    }
)
# From white to green, so that the order of the levels is seen without colour too.
LEVEL_COLOURS = ("#FFFFFF", "#D9D9D9", "#C7E3D8", "#7FC4AB", COLOURS["hit"])


def draw_false_alarms(ax: Axes, rows: Sequence[Record], *, level: str = ".05") -> Axes:
    """Share of clips with a small p-value, a mark for each p-value; right of the line a score cries wolf.

    Parameters
    ----------
    ax : Axes
    rows : records of `study.experiments.nulls.null_table`
    level : ".05" or ".01"
    """
    names = [f"{row['kind']}, {row['seconds']:g} s" for row in rows]
    places = rows_by_name(ax, names)
    ax.hlines([*places.values()], 0.0, 1.0, color=COLOURS["faint"], linewidth=0.8, zorder=0)
    ax.axvline(float(level), color=COLOURS["chance"], linewidth=1.5, linestyle=":")
    for name, look in P_LOOKS.items():
        ax.plot([row[f"{name} {level}"] for row in rows], [*places.values()], linestyle="none", **look)
    beyond = any(row[f"p_time {level}"] > EDGE for row in rows)
    for row, place in zip(rows, places.values(), strict=True):
        if row["cannot tell"] > 0.5:
            ax.annotate("too short: not judged", (0.27, place), va="center", fontsize=8.5, color=COLOURS["chance"])
    edge = "\nsquares beyond the edge: dancers who have the music's tempo" if beyond else ""
    ax.set(xlim=(-0.01, EDGE), xlabel=f"share of clips with p ≤ {level} (dotted: what a fair p-value gives){edge}")
    return ax


def nulls_figure(rows: Iterable[Record]) -> Figure:
    """`draw_false_alarms` with the finding above it, where there are clips enough for one."""
    table = list(rows)
    with styled_axes((9.0, 0.25 * len(table) + 1.9)) as (figure, (ax,)):
        draw_false_alarms(ax, table)
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
        figure.suptitle(_nulls_title(table), x=0.01, ha="left", fontsize=11.5)
    return figure


def _nulls_title(rows: Sequence[Record]) -> str:
    """The worst row of the old score and of H."""
    if rows[0]["n"] * NOMINAL < FEWEST_ALARMS:
        return f"No harmony here, and {rows[0]['n']} clips a row are too few to tell how often it is found"
    old, new = (np.nanmax([row[f"{name} .05"] for row in rows]) for name in ("old p", "p"))
    return f"No harmony here: the old score finds it in up to {old:.0%} of clips, H in up to {new:.0%}"


def draw_level_counts(ax: Axes, rows: Sequence[Record]) -> Axes:
    """A bar a music, cut by level, with the number of recordings in each piece.

    Parameters
    ----------
    ax : Axes
    rows : records with "music" and "level", one a recording and music
    """
    musics = list(dict.fromkeys(row["music"] for row in rows))
    places = rows_by_name(ax, musics)
    for music, place in places.items():
        levels = [row["level"] for row in rows if row["music"] == music]
        left = 0
        for level, words in enumerate(LEVELS):
            count = levels.count(level)
            label = f"{level} {words}" if place == len(musics) - 1 else None
            ax.barh(place, count, left=left, color=LEVEL_COLOURS[level], edgecolor=COLOURS["ink"], label=label)
            if count:
                ax.text(left + count / 2, place, str(count), ha="center", va="center", fontsize=11)
            left += count
    ax.set(xlabel="recordings", xlim=(0, None))
    return ax


def levels_figure(tables: Mapping[str, Sequence[Record]]) -> Figure:
    """`draw_level_counts` for each corpus, one above the other, with one legend.

    Parameters
    ----------
    tables : corpus -> records of `study.experiments.levels.level_table`
    """
    with styled_axes((9.0, 2.1 * len(tables) + 0.6), len(tables)) as (figure, axes):
        for ax, (corpus, rows) in zip(axes, tables.items(), strict=True):
            draw_level_counts(ax, rows).set_title(_levels_title(corpus, rows))
            ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
        # Above: below the canvas is where synthetic data is marked.
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=9)
    return figure


def _levels_title(corpus: str, rows: Sequence[Record]) -> str:
    """Recordings that reach the highest level with the first music, and with all others."""
    own = rows[0]["music"]
    parts = ([row["level"] for row in rows if (row["music"] == own) is first] for first in (True, False))
    top = len(LEVELS) - 1
    first, other = (f"{levels.count(top)} of {len(levels)}" for levels in parts)
    return f"{sentence(corpus_words(corpus))} at level {top}: {first} with {own} music, {other} with other music"
