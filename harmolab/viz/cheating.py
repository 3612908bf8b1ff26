"""Pictures of tricks that raise a score: each with its own music and with music half a beat late (paper Sec. 6)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedFormatter, NullLocator

from harmolab.viz.style import COLOURS, figure_style
from harmolab.viz.variants import LOOKS

__all__ = ["CHEAT_MEASURES", "cheating_figure", "draw_dumbbells"]

Record = Mapping[str, Any]

CHEAT_MEASURES = MappingProxyType(
    {
        "paper_harmony": "paper's harmony h",
        "paper_hit_rate": "paper's hit rate",
        "above_chance": "harmony above chance",
        "paper_count_ratio": "M / N (paper's beats)",
        "jerk": "jerk (m/s³)",
    }
)
CHANCE = MappingProxyType({"paper_hit_rate": "paper_chance"})  # measure -> the level that chance reaches in it
SHARES = ("paper_harmony", "paper_hit_rate")
TRUE = "true"
TIMELESS = ("paper_count_ratio", "jerk")  # the same whatever the music


def draw_dumbbells(ax: Axes, rows: Sequence[Record], *, measure: str) -> Axes:
    """One measure of every trick: a mark with the true music, an arrow to where music half a beat late takes it.

    Parameters
    ----------
    ax : Axes
    rows : records with "trick", "music" ("true", or anything else), "measure", "mean", "low" and "high", of one corpus
    measure : name in `CHEAT_MEASURES`; where chance has a level, `rows` may hold that measure too: a grey bar
    """
    tricks = list(dict.fromkeys(row["trick"] for row in rows))[::-1]
    places = {trick: place for place, trick in enumerate(tricks)}
    values = {(row["trick"], row["music"] == TRUE): row for row in rows if row["measure"] == measure}
    chance = {row["trick"]: row["mean"] for row in rows if row["measure"] == CHANCE.get(measure)}
    for trick, place in places.items():
        _draw_trick(ax, values[trick, True], None if measure in TIMELESS else values[trick, False], place)
        if trick in chance:
            ax.plot([chance[trick]] * 2, [place - 0.38, place + 0.38], color=COLOURS["chance"], linewidth=4, zorder=1)
    ax.hlines(
        range(len(tricks)), *_limits(ax, values.values(), measure), color=COLOURS["faint"], linewidth=0.8, zorder=0
    )
    if measure == "above_chance":
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=4, zorder=1)
    ax.set(yticks=range(len(tricks)), ylim=(-0.6, len(tricks) - 0.4), xlabel=CHEAT_MEASURES.get(measure, measure))
    ax.set_yticklabels([LOOKS[trick].label if trick in LOOKS else trick for trick in tricks])
    ax.tick_params(axis="y", length=0)
    return ax


def _draw_trick(ax: Axes, true: Record, late: Record | None, place: float) -> None:
    """The two marks of a trick with their intervals, and the line between them."""
    look = LOOKS.get(true["trick"])
    colour, marker = (COLOURS["ink"], "o") if look is None else (look.colour, look.marker)
    fill = colour if look is None or look.filled else "white"
    for row in filter(None, (late, true)):
        ax.plot([row["low"], row["high"]], [place, place], color=colour, linewidth=0.9, zorder=2)
    if late is not None:
        ax.plot([true["mean"], late["mean"]], [place, place], color=colour, linewidth=2.0, alpha=0.45, zorder=2)
        head = "<" if late["mean"] < true["mean"] else ">"
        ax.plot(late["mean"], place, linestyle="none", marker=head, markersize=8, color=colour, alpha=0.75, zorder=3)
    ax.plot(
        true["mean"], place, linestyle="none", marker=marker, markersize=8, color=colour, zorder=4,
        markerfacecolor=fill, markeredgewidth=1.6,
    )  # fmt: skip


def _limits(ax: Axes, rows: Iterable[Record], measure: str) -> tuple[float, float]:
    """Limits of the x axis, just set."""
    values = np.array([[row["mean"], row["low"], row["high"]] for row in rows], np.float64)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if measure == "jerk":
        ax.set_xscale("log")
        ax.xaxis.set_minor_locator(NullLocator())
        powers = 10.0 ** np.arange(np.floor(np.log10(max(low, 1e-3))), np.ceil(np.log10(max(high, 1e-3))) + 1)
        ax.set_xticks(powers)
        ax.xaxis.set_major_formatter(FixedFormatter([f"{power:g}" for power in powers]))
        ax.set_xlim(0.7 * powers[0], 1.4 * powers[-1])
    elif measure == "above_chance":
        ax.set_xlim(min(-1.0, low - 0.05), max(1.0, high + 0.05))
    else:
        ax.set_xlim(0.0, 1.08 if measure in SHARES else 1.1 * high)
    left, right = ax.get_xlim()
    return left, right


def cheating_figure(rows: Iterable[Record]) -> Figure:
    """A row of panels for each corpus: `draw_dumbbells` for every measure.

    Parameters
    ----------
    rows : records of `harmolab.experiments.cheating.trick_means` for `CHEAT_MEASURES`, and for "paper_chance"
    """
    table = list(rows)
    corpora = list(dict.fromkeys(row["corpus"] for row in table))
    tricks = len({row["trick"] for row in table})
    with figure_style():
        figure = Figure(figsize=(14.0, (0.36 * tricks + 0.9) * len(corpora) + 0.4), layout="constrained")
        axes = figure.subplots(len(corpora), len(CHEAT_MEASURES), squeeze=False)
        for line, corpus in zip(axes, corpora, strict=True):
            mine = [row for row in table if row["corpus"] == corpus]
            for ax, measure in zip(line, CHEAT_MEASURES, strict=True):
                draw_dumbbells(ax, mine, measure=measure)
                ax.tick_params(axis="y", labelleft=ax is line[0])
            line[0].set_title(f"{corpus} (n = {mine[0]['n']})")
        look: dict[str, Any] = {"color": COLOURS["ink"], "linestyle": "none", "markersize": 8}
        handles = [
            Line2D([], [], marker="o", label="true music", **look),
            Line2D([], [], marker="<", alpha=0.75, label="the same music half a beat late", **look),
            Line2D([], [], color=COLOURS["chance"], linewidth=4, label="what chance reaches"),
        ]
        # Above: below the canvas is where synthetic data is marked.
        figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure
