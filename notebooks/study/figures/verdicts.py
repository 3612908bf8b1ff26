"""Pictures of the recommended score at work: false alarms, and levels of recordings."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.verdict.judge import LEVELS
from study.figures.variants import rows_by_name
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


def nulls_figure(table: pd.DataFrame) -> Figure:
    """Share of clips with a small p-value, a mark for each p-value; right of the line a score cries wolf.

    The title is the finding, where there are clips enough for one.

    Parameters
    ----------
    table : DataFrame with the columns of table08f_false_alarms
    """
    with styled_axes((9.0, 0.25 * len(table) + 1.9)) as (figure, (ax,)):
        names = table["kind"] + ", " + table["seconds"].map("{:g} s".format)
        places = np.array([*rows_by_name(ax, list(names)).values()])
        ax.hlines(places, 0.0, 1.0, color=COLOURS["faint"], linewidth=0.8, zorder=0)
        ax.axvline(NOMINAL, color=COLOURS["chance"], linewidth=1.5, linestyle=":")
        for name, look in P_LOOKS.items():
            ax.plot(table[f"{name} .05"], places, linestyle="none", **look)
        for place in places[table["cannot tell"] > 0.5]:
            ax.annotate("too short: not judged", (0.27, place), va="center", fontsize=8.5, color=COLOURS["chance"])
        beyond = (table["p_time .05"] > EDGE).any()
        edge = "\nsquares beyond the edge: dancers who have the music's tempo" if beyond else ""
        ax.set(xlim=(-0.01, EDGE), xlabel=f"share of clips with p ≤ .05 (dotted: what a fair p-value gives){edge}")
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
        figure.suptitle(alarm_words(table), x=0.01, ha="left", fontsize=11.5)
    return figure


def alarm_words(table: pd.DataFrame) -> str:
    """The worst row of the old score and of H."""
    if table["n"].min() * NOMINAL < FEWEST_ALARMS:
        return f"No harmony here, and {table['n'].min()} clips a row are too few to tell how often it is found"
    old, new = table["old p .05"].max(), table["p .05"].max()
    return f"No harmony here: the old score finds it in up to {old:.0%} of clips, H in up to {new:.0%}"


def levels_figure(table: pd.DataFrame) -> Figure:
    """A bar for each music, cut by level, for each corpus: where nothing is told, and a program finds the beats.

    Parameters
    ----------
    table : DataFrame with the columns of table08i_levels: corpus, beats, told, and a column a music, each cell the
        numbers of recordings at the levels from 0 on, in one text; empty for a music that the corpus lacks
    """
    ordinary = table[(table["beats"] == "tracked") & ~table["told"]].set_index("corpus").drop(columns=["beats", "told"])
    with styled_axes((9.0, 2.1 * len(ordinary) + 0.6), len(ordinary)) as (figure, axes):
        for ax, (corpus, cells) in zip(axes, ordinary.fillna("").iterrows(), strict=True):
            counts = cells[cells != ""].str.split(expand=True).astype(int)
            _draw_level_counts(ax, counts)
            ax.set_title(f"{sentence(corpus_words(str(corpus)))} at level {_on_top(counts)}")
        # Above: below the canvas is where synthetic data is marked.
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=9)
    return figure


def _draw_level_counts(ax: Axes, counts: pd.DataFrame) -> None:
    """Bars of a row a music, a column a level, with the number of recordings in each piece."""
    for level, words in enumerate(LEVELS):
        left = counts.loc[:, : level - 1].sum(axis=1)
        look: dict[str, Any] = {"color": LEVEL_COLOURS[level], "edgecolor": COLOURS["ink"], "label": f"{level} {words}"}
        bars = ax.barh(counts.index, counts[level], left=left, **look)
        ax.bar_label(bars, [str(count or "") for count in counts[level]], label_type="center", fontsize=11)
    ax.set(xlabel="recordings", xlim=(0, None), ylim=(len(counts) - 0.4, -0.6))
    ax.tick_params(axis="y", length=0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def _on_top(counts: pd.DataFrame) -> str:
    """Recordings that reach the highest level with the first music, and with all others."""
    own, other = counts.iloc[0], counts.iloc[1:].sum()
    first, rest = (f"{each.iloc[-1]} of {each.sum()}" for each in (own, other))
    return f"{len(LEVELS) - 1}: {first} with {own.name} music, {rest} with other music"
