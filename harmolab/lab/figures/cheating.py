"""Pictures of tricks that raise a score: each with its own music and with music half a beat late (paper Sec. 6)."""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from harmolab.lab.figures.style import COLOURS
from harmolab.lab.figures.variants import LOOKS, Look, Record, draw_mean, panels, rows_by_name, spread

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


def draw_dumbbells(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """One measure of every trick: a mark with the true music, an arrow to its value with music half a beat late.

    Parameters
    ----------
    ax : Axes
    rows : records with "trick", "music" ("true", or anything else), "measure", "mean", "low" and "high", of one corpus
    measure : name in `CHEAT_MEASURES`; where chance has a level, `rows` may hold that measure too: a grey bar
    """
    records = list(rows)
    places = rows_by_name(ax, list(dict.fromkeys(row["trick"] for row in records)))
    values = {(row["trick"], row["music"] == TRUE): row for row in records if row["measure"] == measure}
    chance = {row["trick"]: row["mean"] for row in records if row["measure"] == CHANCE.get(measure)}
    for trick, place in places.items():
        look = LOOKS.get(trick, Look(trick, COLOURS["ink"], "o", filled=True))
        if measure not in TIMELESS:
            _draw_late(ax, values[trick, True], values[trick, False], place, look)
        draw_mean(ax, values[trick, True], place, look, width=0.9)
        if trick in chance:
            ax.plot([chance[trick]] * 2, [place - 0.38, place + 0.38], color=COLOURS["chance"], linewidth=4, zorder=1)
    _set_limits(ax, *spread(values.values()), measure)
    ax.hlines([*places.values()], *ax.get_xlim(), color=COLOURS["faint"], linewidth=0.8, zorder=0)
    if measure == "above_chance":
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=4, zorder=1)
    ax.set_xlabel(CHEAT_MEASURES.get(measure, measure))
    return ax


def _draw_late(ax: Axes, true: Record, late: Record, place: float, look: Look) -> None:
    """An arrow from the mean with the true music to the one with late music, and that one's interval."""
    ax.plot([late["low"], late["high"]], [place, place], color=look.colour, linewidth=0.9, zorder=2)
    ax.plot([true["mean"], late["mean"]], [place, place], color=look.colour, linewidth=2.0, alpha=0.45, zorder=2)
    head = "<" if late["mean"] < true["mean"] else ">"
    ax.plot(late["mean"], place, linestyle="none", marker=head, markersize=8, color=look.colour, alpha=0.75, zorder=3)


def _set_limits(ax: Axes, low: float, high: float, measure: str) -> None:
    """Limits of the x axis for values from `low` to `high`; jerk counts in powers of ten."""
    if measure == "jerk":
        ax.set_xscale("log")
        ax.xaxis.set_minor_locator(NullLocator())
        powers = 10.0 ** np.arange(np.floor(np.log10(max(low, 1e-3))), np.ceil(np.log10(max(high, 1e-3))) + 1)
        ax.set_xticks(powers, [f"{power:g}" for power in powers])
        ax.set_xlim(0.7 * powers[0], 1.4 * powers[-1])
    elif measure == "above_chance":
        ax.set_xlim(min(-1.0, low - 0.05), max(1.0, high + 0.05))
    else:
        ax.set_xlim(0.0, 1.08 if measure in SHARES else 1.1 * high)


def cheating_figure(rows: Iterable[Record]) -> Figure:
    """A row of panels for each corpus: `draw_dumbbells` for every measure.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.cheating.trick_means` for `CHEAT_MEASURES`, and for "paper_chance"
    """
    table = list(rows)
    look: dict[str, Any] = {"color": COLOURS["ink"], "linestyle": "none", "markersize": 8}
    handles = [
        Line2D([], [], marker="o", label="true music", **look),
        Line2D([], [], marker="<", alpha=0.75, label="the same music half a beat late", **look),
        Line2D([], [], color=COLOURS["chance"], linewidth=4, label="what chance reaches"),
    ]
    height = 0.36 * len({row["trick"] for row in table}) + 0.9
    # The legend stands above: below the canvas is where synthetic data is marked.
    return panels(table, list(CHEAT_MEASURES), _draw_panel, size=(14.0, height), handles=handles)


def _draw_panel(ax: Axes, rows: list[Record], measure: str) -> None:
    draw_dumbbells(ax, rows, measure=measure)
    if measure == next(iter(CHEAT_MEASURES)):
        ax.set_title(f"{rows[0]['corpus']} (n = {rows[0]['n']})")
