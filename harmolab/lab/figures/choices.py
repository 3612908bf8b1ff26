"""Which of two dances a score prefers, pair by pair: the paper's Fig. 13 with machines for judges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.lab.figures.variants import LOOKS, Record

# The colours of these scores in `harmolab.lab.figures.results.disturbances_figure`.
JUDGES = MappingProxyType({"paper's harmony": ("^", "#56B4E9"), "above chance": ("s", "#CC79A7")})


def draw_choices(ax: Axes, rows: Sequence[Record]) -> Axes:
    """For each pair of variants, how often each score prefers the one on the right; in the grey band a coin would too.

    Parameters
    ----------
    ax : Axes
    rows : records with "first", "second", "judge", "share" (of units on which the judge prefers the first), "n"
    """
    pairs = list(dict.fromkeys((row["first"], row["second"]) for row in rows))[::-1]
    half = 1.96 * 0.5 / np.sqrt(max(row["n"] for row in rows))
    ax.axvspan(0.5 - half, 0.5 + half, color=COLOURS["faint"], zorder=0, label="a coin, 95 % of the time")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.hlines(range(len(pairs)), 0.0, 1.0, color=COLOURS["faint"], linewidth=1, zorder=1)
    for place, (judge, (marker, colour)) in enumerate(JUDGES.items()):
        mine = [row for row in rows if row["judge"] == judge]
        levels = [pairs.index((row["first"], row["second"])) + 0.16 - 0.32 * place for row in mine]
        shares = [1.0 - row["share"] for row in mine]
        ax.plot(shares, levels, linestyle="none", marker=marker, markersize=10, color=colour, label=judge, zorder=3)
    ax.set(yticks=range(len(pairs)), yticklabels=[LOOKS[first].label for first, _ in pairs])
    ax.set(xlim=(-0.03, 1.03), ylim=(-0.6, len(pairs) - 0.4))
    ax.set_xlabel("← prefers the left one      share of units      prefers the right one →")
    other = ax.secondary_yaxis("right")
    other.set_yticks(range(len(pairs)), [LOOKS[second].label for _, second in pairs])
    for axis in (ax, other):
        axis.tick_params(axis="y", length=0)
    return ax


def forced_choice_figure(tables: Mapping[str, Sequence[Record]]) -> Figure:
    """`draw_choices` for each corpus, one above the other."""
    with styled_axes((9.0, 3.6 * len(tables)), len(tables)) as (figure, axes):
        for ax, (corpus, rows) in zip(axes, tables.items(), strict=True):
            draw_choices(ax, rows).set_title(f"{corpus}: two scores as judges, {rows[0]['n']} units (no people)")
        axes[-1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    return figure
