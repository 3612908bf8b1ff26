"""Errors of avatars in depth, by their settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS, styled_axes

LOOKS = (COLOURS["ink"], "#CC79A7")  # of the instruments: neither has a meaning elsewhere
PANELS = (("wrist depth", "error of the wrist's depth (% of the forearm)"), ("elbow", "error of the elbow (degrees)"))


def depth_figure(rows: Sequence[Mapping[str, Any]], limits: Mapping[str, float], *, title: str) -> Figure:
    """Bars of both errors by setting and instrument; a dashed line is the most that an avatar may miss.

    Parameters
    ----------
    rows : records of `harmolab.lab.depth_table`
    limits : "wrist depth" and "elbow" -> the most
    title : str
    """
    with styled_axes((10.6, 4.2), 1, 2, sharey=True) as (figure, axes):
        for ax, (measure, label) in zip(axes, PANELS, strict=True):
            _draw_bars(ax, rows, measure).set(xlabel=label)
            ax.axvline(limits[measure], color=COLOURS["ink"], linestyle="--", linewidth=1.2)
            ax.text(limits[measure], -0.75, f" at most {limits[measure]:g}", va="center", fontsize=9)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _draw_bars(ax: Axes, rows: Sequence[Mapping[str, Any]], measure: str) -> Axes:
    settings = list(dict.fromkeys(row["settings"] for row in rows))
    instruments = list(dict.fromkeys(row["instrument"] for row in rows))
    thick = 0.8 / len(instruments)
    for number, (instrument, colour) in enumerate(zip(instruments, LOOKS, strict=False)):
        values = [row[measure] for row in rows if row["instrument"] == instrument]
        places = np.arange(len(settings)) + (number - (len(instruments) - 1) / 2) * thick
        bars = ax.barh(places, values, thick, color=colour, label=instrument)
        ax.bar_label(bars, [f"{value:.0f}" for value in values], padding=2, fontsize=8)
    ax.set_yticks(range(len(settings)), settings)
    ax.set_ylim(len(settings) - 0.5, -1.1)
    return ax
