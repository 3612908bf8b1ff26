"""Distances of dances to recordings beside those between recordings (Fig. 9), and frames of both (Fig. 10)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from harmolab.lab.figures.motion import draw_film
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.lab.figures.variants import LOOKS, PRINTED, Record, panels, rows_by_name, spread
from harmolab.types import FloatArray, Motion

DISTANCES = MappingProxyType(
    {"fid": "FID on the pose network's features", "fid_kinetic": "FID on kinetic features (speeds)"}
)
# Recorded motion against recorded motion, the reference of the bars above: name -> label.
_REFERENCES = {"recorded, other figures": "recorded, other figures", "recorded, halves": "recorded, half and half"}
HEIGHT = 74.0  # points, of a stick figure


def draw_distances(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """One bar a variant, with its interval; below, hatched, recorded motion against recorded motion.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    measure : name in `DISTANCES`
    """
    distances = {row["variant"]: row for row in rows if row["measure"] == measure}
    places = rows_by_name(ax, [name for name in (*LOOKS, *_REFERENCES) if name in distances], _REFERENCES)
    low, high = spread(distances.values())
    for name, place in reversed(places.items()):
        row = distances[name]
        ax.barh(place, row["mean"], height=0.62, **_bar(name))
        if np.isfinite(row["low"]):
            ax.plot([row["low"], row["high"]], [place, place], color=COLOURS["ink"], linewidth=2.2, gid="interval")
        right = np.nanmax([row["mean"], row["high"], 0.0])
        ax.text(right + 0.02 * high, place, _number(row["mean"]), va="center", fontsize=9, color=COLOURS["ink"])
    ax.set(xlabel="distance (0: the same)", xlim=(1.3 * min(0.0, low), 1.14 * high))
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    return ax


def _bar(name: str) -> dict[str, Any]:
    """Colours of a bar: as everywhere for the variants, grey and hatched for recorded motion."""
    if name in _REFERENCES:
        return dict(PRINTED)
    look = LOOKS[name]
    return {"color": look.colour if look.filled else "white", "edgecolor": look.colour, "linewidth": 1.6}


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{round(value, 1) + 0.0:.1f}"  # never -0.0


def distances_figure(rows: Iterable[Record]) -> Figure:
    """`draw_distances` for both kinds of features side by side, a row for each corpus.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.quality.motion_quality`
    """
    interval = "95 % interval, where several were drawn or trained"
    handles = [
        Patch(**PRINTED, label="no generator: recordings"),
        Line2D([], [], color=COLOURS["ink"], linewidth=2.2, label=interval),
    ]
    return panels(rows, list(DISTANCES), _draw_panel, size=(10.5, 3.2), handles=handles, legend="outside lower center")


def _draw_panel(ax: Axes, rows: list[Record], measure: str) -> None:
    draw_distances(ax, rows, measure=measure).set_title(f"{rows[0]['corpus']}: {DISTANCES[measure]}")


def shot_times(motion: Motion, shots: int) -> FloatArray:
    """Seconds of so many frames, as far apart as they can be at equal steps from the first.

    Raises
    ------
    ValueError
        If there is not at least one shot and as many frames.
    """
    if not 1 <= shots <= motion.n_frames:
        raise ValueError(f"shots must be from 1 to the number of frames ({motion.n_frames}), got {shots}")
    step = (motion.n_frames - 1) // max(shots - 1, 1)
    return np.arange(shots) * step / motion.fps


def draw_sequence(ax: Axes, motion: Motion, *, shots: int = 12, start: float = 0.0, colour: str | None = None) -> Axes:
    """People along time; what lies before `start` (seconds) is input of the generator and shaded.

    Parameters
    ----------
    ax : Axes with time on the x axis
    motion : Motion
    shots : int, number of figures
    start : float, seconds
    colour : as in `harmolab.lab.figures.motion.draw_poses`
    """
    times = shot_times(motion, shots)
    half = times[-1] / max(shots - 1, 1) / 2 or 0.5
    ax.axvspan(-half, start, color=COLOURS["faint"], alpha=0.5, linewidth=0, zorder=-1, gid="given")
    return draw_film(ax, motion, times, (-half, times[-1] + half), height=HEIGHT, trail=(), colour=colour)


def sequences_figure(motions: Mapping[str, Motion], *, shots: int = 12, start: float = 0.0, title: str = "") -> Figure:
    """`draw_sequence` for several dances to the same music, under each other at the same moments.

    Parameters
    ----------
    motions : name in `LOOKS` -> Motion, all equally long
    """
    with styled_axes((11.0, 1.5 * len(motions) + 0.9), len(motions), sharex=True) as (figure, axes):
        for ax, (name, motion) in zip(axes, motions.items(), strict=True):
            look = LOOKS[name]
            draw_sequence(ax, motion, shots=shots, start=start, colour=look.colour).set_title(look.label)
        axes[-1].tick_params(axis="x", length=3, labelbottom=True)
        axes[-1].set_xlabel("time (s)")
        shade = Patch(facecolor=COLOURS["faint"], alpha=0.5, label="given: the beats before the meter")
        axes[0].legend(handles=[shade], loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure
