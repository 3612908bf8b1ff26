"""Is it movement? Distances to recordings beside those between recordings (Fig. 9), and frames of both (Fig. 10)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from harmolab.types import Motion
from harmolab.viz.motion import draw_poses
from harmolab.viz.style import COLOURS, figure_style
from harmolab.viz.variants import LOOKS

__all__ = ["DISTANCES", "distances_figure", "draw_distances", "draw_sequence", "sequences_figure", "shot_times"]

FloatArray = NDArray[np.float64]
Record = Mapping[str, Any]

DISTANCES = MappingProxyType(
    {"fid": "FID on the pose network's features", "fid_kinetic": "FID on kinetic features (speeds)"}
)
# Recorded motion against recorded motion: what the bars above are to be compared with.
_REFERENCES = MappingProxyType(
    {"recorded, other figures": "recorded, other figures", "recorded, halves": "recorded, half and half"}
)
HEIGHT = 74.0  # points, of a stick figure


def draw_distances(ax: Axes, rows: Sequence[Record], *, measure: str) -> Axes:
    """One bar a variant, with its interval; below, hatched, recorded motion against recorded motion.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    measure : name in `DISTANCES`
    """
    found = {row["variant"]: row for row in rows if row["measure"] == measure}
    names = [name for name in (*LOOKS, *_REFERENCES) if name in found]
    reach = max(np.nanmax([found[name]["mean"], found[name]["high"]]) for name in names)
    for place, name in enumerate(names[::-1]):
        row, bar = found[name], _bar(name)
        ax.barh(place, row["mean"], height=0.62, **bar)
        if np.isfinite(row["low"]):
            ax.plot([row["low"], row["high"]], [place, place], color=COLOURS["ink"], linewidth=2.2, gid="interval")
        right = np.nanmax([row["mean"], row["high"], 0.0])
        ax.text(right + 0.02 * reach, place, _number(row["mean"]), va="center", fontsize=9, color=COLOURS["ink"])
    words = {name: look.label for name, look in LOOKS.items()} | dict(_REFERENCES)
    ax.set(yticks=range(len(names)), yticklabels=[words[name] for name in names[::-1]], xlabel="distance (0: the same)")
    lowest = min(0.0, *(np.nanmin([found[name]["mean"], found[name]["low"]]) for name in names))
    ax.set_xlim(1.3 * lowest, 1.14 * reach)
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.tick_params(axis="y", length=0)
    return ax


def _bar(name: str) -> dict[str, Any]:
    """Colours of a bar: as everywhere for the variants, grey and hatched for recorded motion."""
    if name in _REFERENCES:
        return {"color": COLOURS["faint"], "edgecolor": COLOURS["chance"], "hatch": "//"}
    look = LOOKS[name]
    return {"color": look.colour if look.filled else "white", "edgecolor": look.colour, "linewidth": 1.6}


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{round(value, 1) + 0.0:.1f}"  # never -0.0


def distances_figure(rows: Iterable[Record]) -> Figure:
    """`draw_distances` for both kinds of features side by side, a row for each corpus.

    Parameters
    ----------
    rows : records of `harmolab.experiments.quality.motion_quality`
    """
    table = list(rows)
    corpora = list(dict.fromkeys(row["corpus"] for row in table))
    with figure_style():
        figure = Figure(figsize=(10.5, 3.2 * len(corpora) + 0.5), layout="constrained")
        axes = figure.subplots(len(corpora), len(DISTANCES), squeeze=False)
        for line, corpus in zip(axes, corpora, strict=True):
            mine = [row for row in table if row["corpus"] == corpus]
            for ax, (measure, title) in zip(line, DISTANCES.items(), strict=True):
                draw_distances(ax, mine, measure=measure).set_title(f"{corpus}: {title}")
                ax.tick_params(axis="y", labelleft=ax is line[0])
        handles = [
            Patch(
                facecolor=COLOURS["faint"], edgecolor=COLOURS["chance"], hatch="//", label="no generator: recordings"
            ),
            Line2D(
                [], [], color=COLOURS["ink"], linewidth=2.2, label="95 % interval, where several were drawn or trained"
            ),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


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


def draw_sequence(
    ax: Axes,
    motion: Motion,
    *,
    shots: int = 12,
    start: float = 0.0,
    turn: float = 0.0,
    colour: str = COLOURS["ink"],
) -> Axes:
    """Stick figures along time; what lies before `start` (seconds) was given and is shaded.

    Parameters
    ----------
    ax : Axes with time on the x axis
    motion : Motion
    shots : int, number of figures
    start : float, seconds
    turn, colour : as in `harmolab.viz.motion.draw_poses`
    """
    times = shot_times(motion, shots)
    draw_poses(ax, motion, times, 0.5, height=HEIGHT, trail=(), turn=turn, colour=colour)
    half = times[-1] / max(shots - 1, 1) / 2 or 0.5
    ax.axvspan(-half, start, color=COLOURS["faint"], alpha=0.5, linewidth=0, zorder=-1, gid="given")
    ax.set(xlim=(-half, times[-1] + half), ylim=(0.0, 1.0), yticks=[])
    ax.tick_params(axis="x", length=0, labelbottom=False)
    for side in ("left", "bottom"):
        ax.spines[side].set_visible(False)
    return ax


def sequences_figure(
    motions: Mapping[str, Motion], *, shots: int = 12, start: float = 0.0, turn: float = 0.0, title: str = ""
) -> Figure:
    """`draw_sequence` for several dances to the same music, under each other at the same moments.

    Parameters
    ----------
    motions : name in `LOOKS` -> Motion, all equally long
    """
    with figure_style():
        figure = Figure(figsize=(11.0, 1.5 * len(motions) + 0.9), layout="constrained")
        axes = figure.subplots(len(motions), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (name, motion) in zip(axes, motions.items(), strict=True):
            look = LOOKS[name]
            draw_sequence(ax, motion, shots=shots, start=start, turn=turn, colour=look.colour).set_title(look.label)
        axes[-1].tick_params(axis="x", length=3, labelbottom=True)
        axes[-1].set_xlabel("time (s)")
        shade = Patch(facecolor=COLOURS["faint"], alpha=0.5, label="given: the beats before the meter")
        axes[0].legend(handles=[shade], loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure
