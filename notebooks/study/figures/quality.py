"""Distances of dances to recordings beside those between recordings (Fig. 9)."""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import LOOKS, Look, Record, by_corpus, rows_by_name
from study.figures.words import corpus_words, is_synthetic, sentence
from study.saving import mark_synthetic

DISTANCES = MappingProxyType(
    {"fid": "distance of poses", "fid_kinetic": "distance of speeds"}  # Frechet
)
# Recorded motion against recorded motion: name -> label.
_REFERENCES = {
    "recorded, other figures": "recorded dance, other figures",
    "recorded, halves": "recorded dance, two halves",
}
SEED = "seed "  # beginning of the names of columns that hold the value of one training
HEIGHT = 74.0  # points, of a stick figure


def draw_distances(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """A row a variant on a logarithmic axis: a mark at the mean, its interval, a dot for each training.

    What lies below the axis ends in an arrow at its left end: a distance with its bias taken off may be below 0.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus; what they
        have under "seed 1", "seed 2", ... are the values of single trainings
    measure : name in `DISTANCES`
    """
    distances = {row["variant"]: row for row in rows if row["measure"] == measure}
    places = rows_by_name(ax, [name for name in (*LOOKS, *_REFERENCES) if name in distances], _REFERENCES)
    values = np.array([[row["mean"], row["low"], row["high"]] for row in distances.values()], np.float64)
    left = 0.6 * max(0.5, float(np.nanmin(values[values > 0.0])))
    ax.set(xscale="log", xlim=(left, 3.5 * np.nanmax(values[:, 0])), xlabel="distance, in powers of ten")
    ax.xaxis.set_major_formatter("{x:g}")
    right = ax.get_xlim()[1]
    for name, place in reversed(places.items()):
        row, look = distances[name], _distance_look(name)
        ax.hlines(place, left, right, color=COLOURS["faint"], linewidth=0.8, zorder=0)
        if np.isfinite(row["low"]):
            ends = np.clip([row["low"], row["high"]], left, right)
            ax.plot(ends, [place, place], color=look.colour, linewidth=2.2, gid="interval")
            for end, beyond, head in ((left, row["low"] < left, "<"), (right, row["high"] > right, ">")):
                if beyond:
                    ax.plot(end, place, head, color=look.colour, markersize=7, clip_on=False)
        seeds = [value for key, value in row.items() if str(key).startswith(SEED) and value >= left]
        ax.plot(seeds, [place + 0.22] * len(seeds), ".", color=look.colour, markersize=6, gid="seed")
        if row["mean"] >= left:
            ax.plot(row["mean"], place, **look.mark, zorder=4)
        ax.annotate(
            _number(row["mean"]), (max(row["mean"], left), place), (0, -7), textcoords="offset points", ha="center",
            va="top", fontsize=9, color=look.colour,
        )  # fmt: skip
    ax.set_ylim(-0.8, len(places) - 0.5)
    return ax


def _distance_look(name: str) -> Look:
    """Marks as everywhere for the variants, grey diamonds for recorded motion."""
    return Look("", COLOURS["chance"], "D", filled=True) if name in _REFERENCES else LOOKS[name]


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{round(value, 1) + 0.0:.1f}"  # never -0.0


def distances_figure(rows: Iterable[Record]) -> Figure:
    """`draw_distances` for both kinds of features side by side, a row for each corpus; titles name the nearest.

    Parameters
    ----------
    rows : records of the table of notebook 08
    """
    corpora = by_corpus(rows)
    size = (9.0, 3.3 * len(corpora) + 0.5)
    with styled_axes(size, len(corpora), len(DISTANCES), sharey="row") as (figure, axes):
        for line, (corpus, records) in enumerate(corpora.items()):
            panels = axes[line * len(DISTANCES) : (line + 1) * len(DISTANCES)]
            for ax, (measure, words), subject in zip(panels, DISTANCES.items(), (corpus, ""), strict=True):
                start = f"{sentence(corpus_words(subject))}, {words}" if subject else sentence(words)
                draw_distances(ax, records, measure=measure).set_title(
                    f"{start}:\n{_nearest(records, measure)}", fontsize=10.5
                )
            if is_synthetic(corpus):
                mark_synthetic(panels[-1])
        handles = [
            Line2D([], [], **_distance_look("recorded, halves").mark, label="recorded beside recorded dance"),
            Line2D([], [], color=COLOURS["ink"], linewidth=2.2, label="95 % interval (arrow: beyond the axis)"),
        ]
        if any(str(key).startswith(SEED) for records in corpora.values() for row in records for key in row):
            handles.append(Line2D([], [], linestyle="none", marker=".", color=COLOURS["ink"], label="one training"))
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _nearest(rows: Iterable[Record], measure: str) -> str:
    """The generator that comes nearest to recordings, beside the distance between recordings of other figures."""
    means = {row["variant"]: row["mean"] for row in rows if row["measure"] == measure}
    name = min((name for name in LOOKS if name in means), key=means.__getitem__)
    return f"nearest is “{LOOKS[name].label}”"
