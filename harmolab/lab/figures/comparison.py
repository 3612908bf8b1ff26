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
from harmolab.lab.figures.variants import LOOKS, Record

# Measures of the panels from left to right, with the words for them.
COMPARED: Mapping[str, str] = MappingProxyType(
    {
        "h": "harmony h (paper, Table 1)",
        "hit_rate": "hit rate (paper, Table 2)",
        "above_chance": "harmony above chance (0.1 s; not in the paper)",
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
    """One measure of every system of a contest; thin grey bars on the right are dances that need no training.

    Parameters
    ----------
    ax : Axes
    rows : records of `harmolab.lab.experiments.standings.system_table` of one contest; kind says where a bar stands
    measure : name in `COMPARED`
    """
    systems = [row for row in rows if row["kind"] not in ("recorded", "pieces")]
    cheap = [row for row in rows if row["kind"] in ("recorded", "pieces")]
    places = [*range(len(systems)), *(len(systems) + GAP + np.arange(len(cheap)) * STEP)]
    for place, row in zip(places, [*systems, *cheap], strict=True):
        _draw_bar(ax, row, float(place), measure, thin=row in cheap)
    names = [str(row["system"]) for row in (*systems, *cheap)]
    ax.set_xticks(places, names, rotation=38, ha="right", fontsize=8)
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.set(title=COMPARED.get(measure, measure), xlim=(-0.7, max(places) + 0.5))
    return ax


def _draw_bar(ax: Axes, row: Record, place: float, measure: str, *, thin: bool) -> None:
    """The bar of one record, its interval, chance and the paper's value; in words where it was not trained enough."""
    mean, width = row[measure], THIN if thin else WIDE
    if not np.isfinite(mean):
        words = row["remark"].partition(":")[0] or "no number"
        ax.text(place, 0.0, f" {words}", rotation=90, ha="center", va="bottom", fontsize=7.5, color=COLOURS["chance"])
    else:
        hollow = row["system"] == "HarmoGAN without L_harmo"
        colour = COLOURS["chance"] if thin else _colour(row)
        ax.bar(place, mean, width, facecolor="white" if hollow else colour, edgecolor=colour, linewidth=1.4)
        low, high = row[f"{measure} low"], row[f"{measure} high"]
        if np.isfinite(low):
            ax.plot([place, place], [low, high], color=COLOURS["ink"], linewidth=1.6, gid="interval", zorder=4)
        chance = row.get(f"{measure} chance", 0.0)
        ends = [place - width / 2 - 0.06, place + width / 2 + 0.06]
        ax.plot(ends, [chance, chance], color=COLOURS["miss"], linewidth=2.0, gid="chance", zorder=3)
    paper = row.get(f"{measure} paper", np.nan)
    if np.isfinite(paper):
        ax.plot(
            place, paper, "D", markersize=7, markerfacecolor="white", markeredgecolor="black", gid="paper", zorder=5
        )


def _colour(row: Record) -> str:
    return _COLOURS.get(row["system"], _CHOREOGRAPHER if row["kind"] == "choreographer" else _RIVAL)


def comparison_figure(rows: Iterable[Record]) -> Figure:
    """`draw_compared` for each of `COMPARED`, a row of panels for each contest; what is synthetic is marked there.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.standings.system_table`
    """
    contests: dict[tuple[str, str], list[Record]] = {}
    for row in rows:
        contests.setdefault((row["music"], row["corpus"]), []).append(row)
    size = (17.0, 4.5 * len(contests) + 0.5)
    with styled_axes(size, len(contests), len(COMPARED)) as (figure, axes):
        for line, ((music, corpus), records) in enumerate(contests.items()):
            panels = axes[line * len(COMPARED) : (line + 1) * len(COMPARED)]
            for ax, measure in zip(panels, COMPARED, strict=True):
                draw_compared(ax, records, measure=measure)
                if "synthetic" in (music + corpus):
                    ax.text(
                        1.0, 1.0, "synthetic", transform=ax.transAxes, ha="right", va="top", fontsize=9,
                        style="italic", color=COLOURS["miss"], gid="source",
                    )  # fmt: skip
            panels[0].set_ylabel(f"{music}; trained on {corpus}")
        figure.legend(handles=_handles(), loc="outside upper center", ncols=3)
    return figure


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
