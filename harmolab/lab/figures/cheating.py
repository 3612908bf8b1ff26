"""Pictures of tricks that raise a score: each with its own music and with music half a beat late (paper Sec. 6)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
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
PLEASED = 0.3  # of the old score, above chance
LEVEL_WORDS = ("cannot tell", "not this beat", "no steady place", "early or late", "on the beat")
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


def draw_old_scores(ax: Axes, rows: Sequence[Record], places: Mapping[str, float]) -> Axes:
    """A bar for each motion's score on the joint speed in the room; green where the score is pleased.

    Parameters
    ----------
    ax : Axes
    rows : records with "motion" and "old score"
    places : motion -> height of its row
    """
    for row in rows:
        colour = COLOURS["hit"] if row["old score"] > PLEASED else COLOURS["chance"]
        ax.barh(places[row["motion"]], row["old score"], height=0.62, color=colour)
        side, reach = ("left", 3) if row["old score"] >= 0 else ("right", -3)
        ax.annotate(
            f"{row['old score']:.2f}", (row["old score"], places[row["motion"]]), (reach, 0),
            textcoords="offset points", ha=side, va="center", fontsize=8.5,
        )  # fmt: skip
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.set(xlim=(-1.3, 1.3), xticks=(-1, 0, 1), xlabel="above chance")
    return ax


def draw_levels(ax: Axes, rows: Sequence[Record], places: Mapping[str, float]) -> Axes:
    """The level of each motion on a scale of five: a green circle where it keeps time, a grey cross where it does not.

    Parameters
    ----------
    ax : Axes
    rows : records with "motion" and "level"
    places : motion -> height of its row
    """
    for row in rows:
        height, keeps_time = places[row["motion"]], row["level"] >= 2
        colour, mark = (COLOURS["hit"], "o") if keeps_time else (COLOURS["chance"], "X")
        ax.hlines(height, 0, 4, color=COLOURS["faint"], linewidth=1, zorder=0)
        ax.plot(row["level"], height, mark, color=colour, markersize=9)
    ax.set(xlim=(-0.4, 4.4), xticks=range(5))
    ax.set_xticklabels([f"{level} {words}" for level, words in enumerate(LEVEL_WORDS)], rotation=35, ha="right")
    return ax


def locked_figure(rows: Iterable[Record]) -> Figure:
    """Old score, new level and the number that decides of every body on the metronome, group by group.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.locked.locked_table`
    """
    table = list(rows)
    places, groups = _grouped_places(table)
    lowest = min(places.values())
    with styled_axes((11.0, 0.27 * -lowest + 2.1), 1, 3, sharey=True, width_ratios=(1.0, 1.0, 1.25)) as (figure, axes):
        draw_old_scores(axes[0], table, places).set_title("old score: joint speed in the room", fontsize=10)
        draw_levels(axes[1], table, places).set_title("now: level", fontsize=10)
        for row in table:
            axes[2].text(0.0, places[row["motion"]], row["revealed by"], va="center", fontsize=9)
        axes[2].set_title("what decides", fontsize=10)
        axes[2].set(xlim=(0, 1), xticks=())
        axes[2].spines[:].set_visible(False)
        axes[0].set_yticks([*places.values(), *groups.values()], [*places, *groups])
        for label in axes[0].get_yticklabels()[len(places) :]:
            label.set_fontweight("bold")
        for ax in axes:
            ax.tick_params(axis="y", length=0)
            ax.set_ylim(lowest - 0.7, 0.7)
        figure.suptitle(_locked_title(table), x=0.01, ha="left", fontsize=12)
    return figure


def _grouped_places(rows: Sequence[Record]) -> tuple[dict[str, float], dict[str, float]]:
    """Heights of the rows of motions, and of the headings of their groups."""
    places: dict[str, float] = {}
    groups: dict[str, float] = {}
    for row in rows:
        groups.setdefault(row["group"], -1.0 * (len(places) + len(groups)))
        places[row["motion"]] = -1.0 * (len(places) + len(groups))
    return places, groups


def _locked_title(rows: Sequence[Record]) -> str:
    """The finding: how many of each group please the old score, and how many are now said to keep time."""
    parts = []
    for group in dict.fromkeys(row["group"] for row in rows):
        members = [row for row in rows if row["group"] == group]
        old = sum(row["old score"] > PLEASED for row in members)
        new = sum(row["level"] >= 2 for row in members)
        parts.append(f"{group.lower()} {old} of {len(members)}, now {new}")
    return f"Who is said to go with the music?  {'; '.join(parts)}"
