"""Systems compared (Fig. 12): a bar a system with its interval, chance on every bar, the paper's value beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import LOOKS, Record
from study.figures.words import corpus_words, is_synthetic, sentence
from study.saving import mark_synthetic

# Measures of the panels from left to right, with the words for them.
COMPARED: Mapping[str, str] = MappingProxyType(
    {
        "h": "harmony h (paper's Table 1)",
        "hit_rate": "hit rate (paper's Table 2)",
        "above_chance": "harmony above chance",
    }
)
WIDE, THIN = 0.72, 0.34  # of bars, of the place of a system
GAP = 0.8  # places between systems and what needs no training
STEP = 0.8  # places from one of these to the next
_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "HarmoGAN": LOOKS["paper"].colour,
        "HarmoGAN without L_harmo": LOOKS["paper"].colour,
        "HarmoGAN, recommended loss": LOOKS["recommended"].colour,
    }
)
_RIVAL, _CHOREOGRAPHER = "#56809E", "#3F7F5F"


def draw_compared(ax: Axes, rows: Sequence[Record], *, measure: str) -> Axes:
    """One measure of every system of a contest; thin grey bars at the bottom are dances that need no training.

    Parameters
    ----------
    ax : Axes
    rows : records of Table 12 (notebook 10) of one contest; kind says where a bar stands
    measure : name in `COMPARED`
    """
    systems, cheap = _sides(rows)
    places = [*range(len(systems)), *(len(systems) + GAP + np.arange(len(cheap)) * STEP)]
    for place, row in zip(places, [*systems, *cheap], strict=True):
        _draw_bar(ax, row, float(place), measure, thin=row in cheap)
    ax.set_yticks(places, [str(row["system"]) for row in (*systems, *cheap)], fontsize=8.5)
    ax.tick_params(axis="y", length=0)
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.set(ylim=(max(places) + 0.6, -0.7), xlabel=COMPARED.get(measure, measure))
    return ax


def _sides(rows: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Systems, and what needs no training."""
    cheap = [row for row in rows if row["kind"] in ("recorded", "pieces")]
    return [row for row in rows if row not in cheap], cheap


def _draw_bar(ax: Axes, row: Record, place: float, measure: str, *, thin: bool) -> None:
    """The bar of one record, its interval, chance and the paper's value; in words where it was not trained enough."""
    mean, width = row[measure], THIN if thin else WIDE
    if not np.isfinite(mean):
        words = str(row["remark"]).partition(":")[0] if isinstance(row["remark"], str) else ""
        ax.text(0.0, place, f" {words or 'no number'}", ha="left", va="center", fontsize=8, color=COLOURS["chance"])
    else:
        hollow = row["system"] == "HarmoGAN without L_harmo"
        colour = COLOURS["chance"] if thin else _colour(row)
        ax.barh(place, mean, width, facecolor="white" if hollow else colour, edgecolor=colour, linewidth=1.4)
        low, high = row[f"{measure} low"], row[f"{measure} high"]
        if np.isfinite(low):
            ax.plot([low, high], [place, place], color=COLOURS["ink"], linewidth=1.6, gid="interval", zorder=4)
        chance = row.get(f"{measure} chance", 0.0)
        ends = [place - width / 2 - 0.06, place + width / 2 + 0.06]
        ax.plot([chance, chance], ends, color=COLOURS["miss"], linewidth=2.0, gid="chance", zorder=3)
    paper = row.get(f"{measure} paper", np.nan)
    if np.isfinite(paper):
        ax.plot(
            paper, place, "D", markersize=6, markerfacecolor="white", markeredgecolor="black", gid="paper", zorder=5
        )


def _colour(row: Record) -> str:
    return _COLOURS.get(row["system"], _CHOREOGRAPHER if row["kind"] == "choreographer" else _RIVAL)


def comparison_figure(rows: Iterable[Record]) -> Figure:
    """`draw_compared` for each of `COMPARED`, a row of panels for each contest; what is synthetic is marked there.

    Parameters
    ----------
    rows : records of Table 12 (notebook 10)
    """
    contests: dict[tuple[str, str], list[Record]] = {}
    for row in rows:
        contests.setdefault((row["music"], row["corpus"]), []).append(row)
    heights = [0.24 * len(records) + 1.0 for records in contests.values()]
    size = (9.0, sum(heights) + 0.8)
    ratios = {"height_ratios": heights}
    with styled_axes(size, len(contests), len(COMPARED), sharey="row", gridspec_kw=ratios) as (figure, axes):
        for line, ((music, corpus), records) in enumerate(contests.items()):
            panels = axes[line * len(COMPARED) : (line + 1) * len(COMPARED)]
            for ax, measure in zip(panels, COMPARED, strict=True):
                draw_compared(ax, records, measure=measure)
            about = f"{sentence(music)}; trained on {corpus_words(corpus)}:"
            # It runs over the panels beside it: an empty title keeps its height free, and nothing its width.
            panels[0].set_title(" \n ", fontsize=10.5)
            words = panels[0].text(0.0, 1.02, f"{about}\n{_finding(records)}", gid="title")
            words.set(transform=panels[0].transAxes, va="bottom", fontsize=10.5, in_layout=False)
            if is_synthetic(music + corpus):
                mark_synthetic(panels[-1])
        figure.legend(handles=_handles(), loc="outside upper center", ncols=2, fontsize=9)
    return figure


def _finding(rows: Sequence[Record]) -> str:
    """The systems whose hit rate, the paper's, is above chance with its whole interval, counted.

    Harmony above chance is in no title: some of the systems were trained for it.
    """
    tried = [row for row in _sides(rows)[0] if np.isfinite(row["hit_rate low"])]
    above = [row for row in tried if row["hit_rate low"] > row["hit_rate chance"]]
    return f"{len(above) or 'none'} of {len(tried)} systems with an interval hit more beats than chance"


def _handles() -> list[Line2D | Patch]:
    """Entries of the legend."""
    return [
        Patch(facecolor=_RIVAL, label="systems, mean over dances"),
        Patch(facecolor=COLOURS["chance"], label="no training needed"),
        Line2D([], [], color=COLOURS["ink"], linewidth=1.6, label="95 % interval, where there is one"),
        Line2D([], [], color=COLOURS["miss"], linewidth=2.0, label="chance: as many beats at random moments"),
        Line2D([], [], linestyle="none", marker="D", markersize=7, markerfacecolor="white", markeredgecolor="black",
               label="printed in the paper, for other music and models"),
    ]  # fmt: skip
