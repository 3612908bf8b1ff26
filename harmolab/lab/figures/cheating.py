"""Pictures of tricks that raise a score: each with its own music and with music half a beat late (paper Sec. 6)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from harmolab.lab.figures.style import COLOURS, mark_synthetic, styled_axes
from harmolab.lab.figures.variants import LOOKS, Look, Record, by_corpus, draw_mean, rows_by_name, spread
from harmolab.lab.figures.words import clearly_above, corpus_words, is_synthetic, listed
from harmolab.verdict.judge import LEVELS

# Columns of the table of tricks, with the words for them.
CHEAT_MEASURES = MappingProxyType(
    {
        "paper_harmony": "paper's harmony h",
        "paper_hit_rate": "paper's hit rate",
        "above_chance": "harmony above chance",
        "paper_count_ratio": "beats danced for each beat heard",
        "jerk": "jerk (m/s³)",
    }
)
SIDES = MappingProxyType(
    {
        "paper_hit_rate": "share of music beats met within 0.25 s",
        "above_chance": "0: as many as chance meets; 1: every beat",
    }
)  # the two scores of the picture, with their axes' names
CHANCE = MappingProxyType({"paper_hit_rate": "paper_chance"})  # measure -> the level that chance reaches in it
TRUE = "true"
UNTOUCHED = "as danced"
PLEASED = 0.3  # of the old score, above chance


def draw_dumbbells(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """One score of every trick: a full mark with the true music, an arrow to a hollow dot, with it half a beat late.

    Parameters
    ----------
    ax : Axes
    rows : records with "trick", "music" ("true", or anything else), "measure", "mean", "low" and "high", of one corpus
    measure : name in `SIDES`; where chance has a level, `rows` may hold that measure too: a grey bar
    """
    records = list(rows)
    places = rows_by_name(ax, list(dict.fromkeys(row["trick"] for row in records)))
    values = {(row["trick"], row["music"] == TRUE): row for row in records if row["measure"] == measure}
    chance = {row["trick"]: row["mean"] for row in records if row["measure"] == CHANCE.get(measure)}
    for trick, place in places.items():
        look = _look(trick)
        _draw_late(ax, values[trick, True], values[trick, False], place, look)
        draw_mean(ax, values[trick, True], place, look, width=0.9)
        if trick in chance:
            ax.plot([chance[trick]] * 2, [place - 0.38, place + 0.38], color=COLOURS["chance"], linewidth=4, zorder=1)
    low, high = spread(values.values())
    ax.set_xlim((min(-1.0, low - 0.05), max(1.0, high + 0.05)) if measure == "above_chance" else (0.0, 1.08))
    ax.xaxis.set_major_locator(MultipleLocator(0.5 if measure == "above_chance" else 0.2))
    ax.hlines([*places.values()], *ax.get_xlim(), color=COLOURS["faint"], linewidth=0.8, zorder=0)
    if measure == "above_chance":
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=4, zorder=1)
    ax.set_xlabel(SIDES.get(measure, measure))
    return ax


def _look(trick: str) -> Look:
    """A generator keeps its colour and mark; all hollow marks here are late music."""
    look = LOOKS.get(trick, Look(trick, COLOURS["ink"], "o", filled=True))
    return Look(look.label, look.colour, look.marker, filled=True)


def _draw_late(ax: Axes, true: Record, late: Record, place: float, look: Look) -> None:
    """An arrow from the mean with the true music to a hollow dot at the one with late music; the latter's interval."""
    low = place - 0.24
    ax.plot([late["low"], late["high"]], [low] * 2, color=look.colour, linewidth=0.9, alpha=0.6, zorder=2)
    ends = (late["mean"], low), (true["mean"], place)
    ax.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": look.colour, "alpha": 0.6, "shrinkB": 5}, zorder=3)
    mark = {**look.mark, "marker": "o", "markersize": 5.5, "markerfacecolor": "white", "markeredgewidth": 1.2}
    ax.plot(late["mean"], low, **mark, zorder=4, gid="late")


def tricks_figure(rows: Iterable[Record]) -> Figure:
    """`draw_dumbbells` of the paper's hit rate and of harmony above chance; titles count tricks that beat the dance.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.cheating.trick_means` for `SIDES` and "paper_chance"
    """
    return _cheating_figure(rows, _beaten, "clips")


def listening_figure(rows: Iterable[Record]) -> Figure:
    """`draw_dumbbells` of the same two scores for generators; titles name who loses clearly when the music is late.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.cheating.trick_means` for `SIDES` and "paper_chance"
    """
    return _cheating_figure(rows, _losers, "units")


def _beaten(values: Mapping[tuple[str, bool], Record]) -> str:
    """Number of tricks that score above the dance that they were put on, in words."""
    tricks = [trick for trick, true in values if true and trick != UNTOUCHED]
    ahead = sum(values[trick, True]["mean"] > values[UNTOUCHED, True]["mean"] for trick in tricks)
    return f"{ahead} of {len(tricks)} tricks score above the dance"


def _losers(values: Mapping[tuple[str, bool], Record]) -> str:
    """Names of those whose score is clearly lower with late music."""
    names = [name for name, true in values if true]
    losers = [LOOKS[name].label for name in names if clearly_above(values[name, True], values[name, False])]
    who = (listed(losers) or "nobody") if len(losers) < len(names) else f"all {len(names)}"
    return f"with late music it falls for {who}"


def _cheating_figure(
    rows: Iterable[Record], finding: Callable[[Mapping[tuple[str, bool], Record]], str], unit: str
) -> Figure:
    """A panel for each score of `SIDES`, below each other for each corpus; `finding` makes its title."""
    corpora = by_corpus(rows)
    tricks = max(len({row["trick"] for row in records}) for records in corpora.values())
    size = (9.0, (0.42 * tricks + 1.2) * len(corpora) + 0.6)
    with styled_axes(size, len(corpora), len(SIDES), sharey="row") as (figure, axes):
        for line, (corpus, records) in enumerate(corpora.items()):
            panels = axes[line * len(SIDES) : (line + 1) * len(SIDES)]
            subjects = (f"Paper's hit rate, {corpus_words(corpus)}", "Harmony above chance")
            for ax, measure, subject in zip(panels, SIDES, subjects, strict=True):
                values = {(row["trick"], row["music"] == TRUE): row for row in records if row["measure"] == measure}
                draw_dumbbells(ax, records, measure=measure).set_title(f"{subject}:\n{finding(values)}", fontsize=10.5)
            panels[0].set_xlabel(f"{panels[0].get_xlabel()} ({records[0]['n']} {unit})")
            if is_synthetic(corpus):
                mark_synthetic(panels[-1])
        figure.legend(handles=_legend(), loc="outside upper center", ncols=3)
    return figure


def _legend() -> list[Line2D]:
    look: dict[str, Any] = {"color": COLOURS["ink"], "linestyle": "none", "marker": "o"}
    late: dict[str, Any] = {"markersize": 5.5, "markerfacecolor": "white", "label": "the same music half a beat late"}
    return [
        Line2D([], [], markersize=8, label="true music", **look),
        Line2D([], [], **look, **late),
        Line2D([], [], color=COLOURS["chance"], linewidth=4, label="what as many beats meet by chance"),
    ]


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
    ax.set_xticklabels([f"{level} {words}" for level, words in enumerate(LEVELS)], rotation=35, ha="right")
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
