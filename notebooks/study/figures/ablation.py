"""Gain and cost of a harmony loss (Fig. 11): measures by loss, and harmony against its price."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import LOOKS, Record, by_corpus, rows_by_name, spread
from study.figures.words import corpus_words, is_synthetic, sentence
from study.saving import mark_synthetic

RECORDED = "recorded"
WEIGHTED = "recommended"  # the loss whose weight the trade-off varies
LOSSES = MappingProxyType({"paper": "paper's losses", "recommended": "our losses"})
_OWNERS = MappingProxyType({"paper": "the paper's", "recommended": "our"})
APART = 0.15  # rows, of a mark from the middle of its row: without the harmony term above, with it below

# Columns of the table of the ablation, with the words for them.
MEASURES = MappingProxyType(
    {
        "paper_harmony": "paper's harmony h",
        "paper_hit_rate": "paper's hit rate",
        "above_chance": "harmony above chance",
        "count_ratio": "beats danced for each beat heard",
        "jerk": "jerk (m/s³)",
        "fid": "distance to recorded dance (FID)",
    }
)
SIDES = MappingProxyType(
    {"above_chance": "0: as many beats as chance meets; 1: every music beat", "fid": "0: moves the same"}
)
SHOWN = ("above_chance", "fid")  # of the picture; the table has them all
PRICES = ("jerk", "fid")


def draw_measure(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """One measure, a row for each loss: hollow without its harmony term, an arrow to the mark with it, intervals.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus; recorded
        motion has a row of its own where its mean is finite
    measure : name in `MEASURES`
    """
    variants = {row["variant"]: row for row in rows if row["measure"] == measure and np.isfinite(row["mean"])}
    places = rows_by_name(ax, [name for name in (*LOSSES, RECORDED) if name in variants], LOSSES)
    for loss, place in places.items():
        if loss == RECORDED:
            _draw_row_mark(ax, variants[loss], loss, place, below=True)
            continue
        without, with_it = variants[f"{loss}, without"], variants[loss]
        arrow = {"arrowstyle": "-|>", "color": LOOKS[loss].colour, "alpha": 0.5, "shrinkA": 5, "shrinkB": 5}
        ends = (with_it["mean"], place - APART), (without["mean"], place + APART)
        ax.annotate("", *ends, arrowprops=arrow, zorder=2)
        _draw_row_mark(ax, without, f"{loss}, without", place + APART, below=False)
        _draw_row_mark(ax, with_it, loss, place - APART, below=True)
    low, high = spread(variants.values())
    left = 0.0 if measure != "above_chance" else min(-0.1, low - 0.05)
    ax.set_xlim(left, max(1.05, high + 0.05) if measure == "above_chance" else 1.08 * high)
    if measure == "above_chance":
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    ax.set_xlabel(SIDES.get(measure, MEASURES.get(measure, measure)))
    return ax


def _draw_row_mark(ax: Axes, row: Record, name: str, height: float, *, below: bool) -> None:
    """A mark, its interval and, on the side where nothing else stands, its number."""
    look = LOOKS[name]
    if np.isfinite(row["low"]) and row["high"] > row["low"]:
        ax.plot([row["low"], row["high"]], [height] * 2, color=look.colour, linewidth=2, zorder=2, gid="interval")
    ax.plot(row["mean"], height, **look.mark, zorder=4)
    number = f"{row['mean']:.1f}" if abs(row["mean"]) >= 2 else f"{row['mean']:.2f}"
    ax.annotate(
        number, (row["mean"], height), (0, -7 if below else 7), textcoords="offset points", ha="center",
        va="top" if below else "bottom", fontsize=9, color=look.colour,
    )  # fmt: skip


def ablation_figure(rows: Iterable[Record], gains: Iterable[Record]) -> Figure:
    """Harmony above chance and FID, a row of panels for each corpus; titles say which loss changes which.

    Parameters
    ----------
    rows : records of `study.experiments.ablation.seed_means` for `SHOWN` at least
    gains : records of `gains` in notebook 09 for the same measures
    """
    corpora, changes = by_corpus(rows), by_corpus(gains)
    size = (9.0, 2.9 * len(corpora) + 0.6)
    with styled_axes(size, len(corpora), len(SHOWN), gridspec_kw={"wspace": 0.08}) as (figure, axes):
        for line, (corpus, records) in enumerate(corpora.items()):
            panels = axes[line * len(SHOWN) : (line + 1) * len(SHOWN)]
            subjects = (f"Harmony above chance, {corpus_words(corpus)}", "FID to recorded dance")
            for ax, measure, subject in zip(panels, SHOWN, subjects, strict=True):
                title = f"{subject}:\n{_finding(changes[corpus], measure)}"
                draw_measure(ax, records, measure=measure).set_title(title, fontsize=10.5)
                ax.set_ylim(-0.6, 2.6 if len(ax.get_yticks()) > len(LOSSES) else 1.6)
            if is_synthetic(corpus):
                mark_synthetic(panels[-1])
        seeds = max((int(row["seeds"]) for records in corpora.values() for row in records if "seeds" in row), default=1)
        figure.legend(handles=_legend(seeds), loc="outside upper center", ncols=4)
    return figure


def _finding(gains: Iterable[Record], measure: str) -> str:
    """The losses whose harmony term changes a measure by more than the interval of the change, in words."""
    changes = {row["loss"]: row for row in gains if row["measure"] == measure}
    sure = {loss: row for loss, row in changes.items() if not row["low"] <= 0.0 <= row["high"]}
    if not sure:
        return "neither clearly changes it"
    verbs = {loss: "raises" if row["change"] > 0.0 else "lowers" for loss, row in sure.items()}
    if len(verbs) == len(LOSSES) and len(set(verbs.values())) == 1:
        return f"both harmony terms {verbs['paper'].removesuffix('s')} it"
    only = "only " if len(verbs) < len(LOSSES) else ""
    return only + ", ".join(f"{_OWNERS[loss]} harmony term {verb} it" for loss, verb in verbs.items())


def _legend(seeds: int) -> list[Line2D]:
    """Entries for the two kinds of marks, the recorded motion and the intervals of so many trainings."""
    look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 8, "color": COLOURS["ink"]}
    interval = Line2D([], [], color=COLOURS["chance"], linewidth=2, label=f"95 % interval, {seeds} trainings")
    return [
        Line2D([], [], **look, markerfacecolor="white", label="without the harmony term"),
        Line2D([], [], **look, label="with it"),
        Line2D([], [], **LOOKS[RECORDED].mark, label="recorded dance"),
        *([interval] if seeds > 1 else []),
    ]


def draw_trade_off(ax: Axes, rows: Iterable[Record], sweep: Sequence[Record] = (), *, measure: str) -> Axes:
    """Harmony above chance against its price: a mark for each variant with its intervals both ways.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    sweep : records with "harmony_weight", "above_chance" and the measure: small marks, each a single training of our
        losses with another weight
    measure : name in `PRICES`, on the x axis
    """
    records = list(rows)
    heights = {row["variant"]: row for row in records if row["measure"] == "above_chance"}
    prices = {row["variant"]: row for row in records if row["measure"] == measure}
    for name, look in LOOKS.items():
        height, price = heights[name], prices[name]
        if not np.isfinite(price["mean"]):  # recorded dance has no distance from itself
            continue
        for ends, other, upright in ((price, height, False), (height, price, True)):
            if np.isfinite(ends["low"]) and ends["high"] > ends["low"]:
                across, up = [max(ends["low"], 0.0) if not upright else ends["low"], ends["high"]], [other["mean"]] * 2
                span = (up, across) if upright else (across, up)
                ax.plot(*span, color=look.colour, linewidth=1.4, alpha=0.6, zorder=2, gid="interval")
        ax.plot(price["mean"], height["mean"], **look.mark, zorder=4)
    colour = LOOKS[WEIGHTED].colour
    for row in sweep:
        ax.plot(row[measure], row["above_chance"], "o", markersize=4, color=colour, zorder=3, gid="sweep")
        ax.annotate(
            f"{row['harmony_weight']:g}", (row[measure], row["above_chance"]), (4, 4), textcoords="offset points",
            fontsize=8.5, color=colour,
        )  # fmt: skip
    ax.axhline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    ax.set(xlabel=f"{MEASURES[measure]}", ylabel="harmony above chance")
    ax.set_xlim(left=0.0)
    return ax


def trade_off_figure(rows: Iterable[Record], sweep: Iterable[Record] = ()) -> Figure:
    """`draw_trade_off` against jerk and FID, a row of panels for each corpus.

    Parameters
    ----------
    rows : records of `study.experiments.ablation.seed_means` for harmony above chance, jerk and FID at least
    sweep : records of the sweep of notebook 09
    """
    corpora, sweeps = by_corpus(rows), by_corpus(sweep)
    with styled_axes((9.0, 3.4 * len(corpora) + 0.7), len(corpora), len(PRICES), sharey="row") as (figure, axes):
        for line, (corpus, records) in enumerate(corpora.items()):
            panels = axes[line * len(PRICES) : (line + 1) * len(PRICES)]
            subjects = (f"{sentence(corpus_words(corpus))}, our harmony term:\n", "")
            for ax, measure, subject in zip(panels, PRICES, subjects, strict=True):
                draw_trade_off(ax, records, sweeps.get(corpus, ()), measure=measure)
                ax.set_title(subject + _price(records, measure), fontsize=10.5)
            panels[1].set_ylabel("")
            if is_synthetic(corpus):
                mark_synthetic(panels[-1])
        handles = [Line2D([], [], **look.mark, label=look.label) for look in LOOKS.values()]
        if sweeps:
            look: dict[str, Any] = {
                "linestyle": "none",
                "marker": "o",
                "markersize": 4,
                "color": LOOKS[WEIGHTED].colour,
            }
            handles.append(Line2D([], [], **look, label="one training with another weight of it"))
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _price(rows: Sequence[Record], measure: str) -> str:
    """Harmony above chance and a price, without our harmony term and with it, in words."""
    means = {(row["variant"], row["measure"]): row["mean"] for row in rows}
    before, after = (means[name, measure] for name in (f"{WEIGHTED}, without", WEIGHTED))
    noun = {"jerk": "jerk", "fid": "FID"}[measure]
    if measure != PRICES[0]:
        return f"{noun} {before:.1f} → {after:.1f}"
    low, high = (means[name, "above_chance"] for name in (f"{WEIGHTED}, without", WEIGHTED))
    return f"harmony {low:.2f} → {high:.2f}, {noun} {before:.0f} → {after:.0f}"
