"""Feet of generated dances: Table 2 as a picture, heights of the toes (Fig. 10), a foot model at work."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.types import BoolArray, FloatArray
from study.figures.variants import Look, Record, draw_mean, rows_by_name
from study.figures.words import corpus_words, count_words, listed, sentence

RECORDED, UNTOUCHED = "recorded", "no correction"
MEASURES = ("MSE", "lower body (cm)", "sliding (cm/s)")
LEARNT = ", figures learnt"  # added to the name of a measure
FEET = ("left toe", "right toe")
CENTIMETRES = 100.0
FASTEST = 150.0  # centimetres per second that are shown: feet that swing leave the picture
# Of a curve: colour and line. Black is recorded, as everywhere.
_CURVES: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        "recorded": {"color": COLOURS["ink"], "linestyle": ":"},
        "with end effectors": {"color": "#6A3D9A", "linestyle": "-"},
        "without end effectors": {"color": "#8C6D31", "linestyle": "--"},
        "none": {"color": COLOURS["ink"], "linestyle": ":"},
        "model": {"color": "#6A3D9A", "linestyle": "-"},
        "planted": {"color": "#8C6D31", "linestyle": "--"},
    }
)
_LEARNT_MARK: Mapping[str, Any] = MappingProxyType(
    {"linestyle": "none", "marker": "x", "markersize": 7, "color": COLOURS["chance"], "markeredgewidth": 1.8}
)
_WORDS: Mapping[str, str] = MappingProxyType(
    {"none": "no correction", "model": "foot model", "planted": "planted feet, not learnt"}
)


class Curves(Protocol):
    """Heights (T, 2) of both toes, metres, and speeds (T, 2) of both feet, metres per second."""

    @property
    def heights(self) -> FloatArray: ...

    @property
    def speeds(self) -> FloatArray: ...


def draw_ways(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """A mark with its interval for each way to treat feet; lines: no correction, and recorded; crosses: figures learnt.

    Parameters
    ----------
    ax : Axes
    rows : records of one corpus and code, with "feet", "trainings", and of the measure the mean, low and high
    measure : name of a column
    """
    table = [row for row in rows if row["feet"] not in (RECORDED, UNTOUCHED)]
    lines = {row["feet"]: row[measure] for row in rows if row["feet"] in (RECORDED, UNTOUCHED)}
    labels = {row["feet"]: row["feet"].replace(", ", ",\n") for row in table}
    places = rows_by_name(ax, list(labels), labels)
    for row in table:
        look = Look(row["feet"], COLOURS["ink"], "o", filled=row["trainings"] > 0)
        if np.isfinite(row[measure]):
            mean = {"mean": row[measure], "low": row[f"{measure}, low"], "high": row[f"{measure}, high"]}
            draw_mean(ax, mean, places[row["feet"]], look)
        if row["trainings"] and f"{measure}{LEARNT}" in row:
            ax.plot(row[f"{measure}{LEARNT}"], places[row["feet"]], **_LEARNT_MARK)
    ax.axvline(lines[UNTOUCHED], color=COLOURS["miss"], linestyle="--", linewidth=1.2, gid=UNTOUCHED)
    if lines[RECORDED]:
        ax.axvline(lines[RECORDED], color=COLOURS["chance"], linestyle=":", linewidth=1.5, gid=RECORDED)
    ax.margins(x=0.12)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    return ax


def ways_figure(rows: Iterable[Record]) -> Figure:
    """`draw_ways` for error and sliding: a row of panels for each corpus and motion code.

    Parameters
    ----------
    rows : records of `study.experiments.feet.foot_table`
    """
    every, groups = list(rows), dict[tuple[str, str], list[Record]]()
    for row in every:
        groups.setdefault((row["corpus"], row["code"]), []).append(row)
    size = (9.2, 3.0 * len(groups) + 1.0)
    with styled_axes(size, len(groups), len(MEASURES)) as (figure, axes):
        for line, ((corpus, code), table) in enumerate(groups.items()):
            for place, measure in enumerate(MEASURES):
                ax = draw_ways(axes[len(MEASURES) * line + place], table, measure=measure)
                unit = f" ({table[0]['unit of MSE']})" if measure == "MSE" else ""
                ax.set_xlabel(f"{measure}{unit}")
                ax.tick_params(axis="y", labelleft=place == 0)
            axes[len(MEASURES) * line].set_title(f"{sentence(corpus_words(corpus))}, code of {code}")
        handles = [
            Line2D([], [], **Look("", COLOURS["ink"], "o", filled=True).mark, label="trained, 95 % over trainings"),
            Line2D([], [], **Look("", COLOURS["ink"], "o", filled=False).mark, label="not trained"),
            Line2D([], [], **_LEARNT_MARK, label="on the figures learnt"),
            Line2D([], [], color=COLOURS["miss"], linestyle="--", label=UNTOUCHED),
            Line2D([], [], color=COLOURS["chance"], linestyle=":", label=RECORDED),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        figure.suptitle(_ways_title(every), x=0.01, ha="left", fontsize=11.5)
    return figure


def _ways_title(rows: Sequence[Record]) -> str:
    """Learnt corrections with less error, and with less sliding, than no correction."""
    bare = {(row["corpus"], row["code"]): row for row in rows if row["feet"] == UNTOUCHED}
    pairs = [(row, bare[row["corpus"], row["code"]]) for row in rows if row["trainings"] and np.isfinite(row["MSE"])]
    error, sliding = (
        count_words(sum(own[measure] < before[measure] for own, before in pairs), len(pairs))
        for measure in ("MSE", "sliding (cm/s)")
    )
    return f"Learnt foot models beside no correction: less error with {error}, less sliding with {sliding}"


def draw_curves(ax: Axes, curves: Mapping[str, FloatArray], *, fps: float) -> Axes:
    """Curves (T,) over time, each in the look of its name."""
    for name, values in curves.items():
        ax.plot(np.arange(len(values)) / fps, values, label=_WORDS.get(name, name), **_CURVES[name])
    ax.set_xlim(0.0, max(map(len, curves.values())) / fps)
    return ax


def toes_figure(heights: Mapping[str, FloatArray], *, fps: float, corpus: str, remark: str = "") -> Figure:
    """Heights of the left and the right toe over time, of several dances to the same music (Fig. 10).

    Parameters
    ----------
    heights : name ("recorded", "with end effectors", "without end effectors") -> (T, 2) array, metres
    fps : float, hertz
    corpus, remark : str, below the time axis
    """
    with styled_axes((9.2, 4.6), 2, sharex=True, sharey=True) as (figure, axes):
        for side, (ax, toe) in enumerate(zip(axes, FEET, strict=True)):
            draw_curves(ax, {name: CENTIMETRES * values[:, side] for name, values in heights.items()}, fps=fps)
            ax.set(ylabel="height (cm)", title=f"({'ab'[side]}) {toe}")
        axes[-1].set_xlabel("; ".join(filter(None, ["time (s)", corpus_words(corpus), remark])))
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(heights), borderpad=0.0)
        ranges = [f"{CENTIMETRES * np.ptp(own, axis=0).mean():.0f} cm ({name})" for name, own in heights.items()]
        figure.suptitle(f"Toes range over {listed(ranges)}", x=0.01, ha="left", fontsize=11.5)
    return figure


def foot_model_figure(curves: Mapping[str, Curves], contacts: FloatArray, *, fps: float) -> Figure:
    """Heights of the toes and speeds of the feet of one dance, before and after; shaded where a foot is said to stand.

    Parameters
    ----------
    curves : way ("none", "model", "planted") -> heights and speeds
    contacts : (T, 2) array, 1 where the left, the right foot is predicted to stand
    fps : float, hertz
    """
    with styled_axes((9.2, 5.4), 2, 2, sharex=True, sharey="row") as (figure, axes):
        for place, ax in enumerate(axes):
            line, side = divmod(place, 2)
            picked = {name: (each.speeds if line else each.heights)[:, side] for name, each in curves.items()}
            draw_curves(ax, {name: CENTIMETRES * values for name, values in picked.items()}, fps=fps)
            _shade_contacts(ax, contacts[:, side], fps)
            if line:
                ax.set_xlabel("time (s)")
            else:
                ax.set_title(FEET[side])
        axes[0].set_ylabel("height of the toe (cm)")
        axes[2].set_ylabel("speed of the foot's\nslowest point (cm/s)")
        axes[2].set_ylim(0.0, FASTEST)
        handles = [*axes[0].get_lines(), Patch(facecolor=COLOURS["faint"], label="predicted to stand")]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        figure.suptitle(_standing_title(curves, contacts > 0.5), x=0.01, ha="left", fontsize=11.5)
    return figure


def _standing_title(curves: Mapping[str, Curves], stands: BoolArray) -> str:
    """Mean speeds of the feet where they are predicted to stand (T, 2)."""
    if not stands.any():
        return "No foot is predicted to stand"
    speeds = {_WORDS[name].split(",")[0]: CENTIMETRES * own.speeds[stands].mean() for name, own in curves.items()}
    return f"Standing feet slide at {listed([f'{speed:.0f} cm/s ({name})' for name, speed in speeds.items()])}"


def _shade_contacts(ax: Axes, stands: FloatArray, fps: float) -> None:
    """Grey wherever a foot stands (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], stands > 0.5, [0.0]])))
    for start, end in edges.reshape(-1, 2) / fps:
        ax.axvspan(start, end, color=COLOURS["faint"], alpha=0.6, linewidth=0, zorder=-1, gid="stands")
