"""Pictures of tricks that raise a score: each with its own music and with music half a beat late (paper Sec. 6)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import LOOKS, Look, Record, by_corpus, draw_mean, rows_by_name, spread
from study.figures.words import clearly_above, corpus_words, is_synthetic, listed
from study.saving import mark_synthetic

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
    rows : records of `study.experiments.cheating.trick_means` for `SIDES` and "paper_chance"
    """
    return _cheating_figure(rows, _beaten, "clips")


def listening_figure(rows: Iterable[Record]) -> Figure:
    """`draw_dumbbells` of the same two scores for generators; titles name who loses clearly when the music is late.

    Parameters
    ----------
    rows : records of `study.experiments.cheating.trick_means` for `SIDES` and "paper_chance"
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
