"""Gain and cost of a harmony loss (Fig. 11): measures by variant, and the trade-off curve."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from harmolab.lab.figures.style import COLOURS, figure_style, styled_axes
from harmolab.lab.figures.variants import LOOKS, PRINTED, Record, draw_mean, panels, rows_by_name, shaded, spread
from harmolab.systems.harmogan.params import TrainParams

Targets = Mapping[str, tuple[float, float]]  # name -> (least, most); either may be infinite

RECORDED = "recorded"
WEIGHTED = "recommended"  # the loss whose weight the trade-off curve varies
SHIFTS = (
    (0, -14),
    (-17, 0),
    (17, -6),
    (-15, 8),
    (15, 10),
)  # points from mark to label; mirrored on a curve to the left
OUR_WEIGHT = TrainParams.recommended().harmony_weight

# Columns of the ablation, from left to right, with the words for them.
MEASURES = MappingProxyType(
    {
        "paper_harmony": "paper's harmony h",
        "paper_hit_rate": "paper's hit rate",
        "above_chance": "harmony above chance",
        "count_ratio": "M / N (speed valleys)",
        "jerk": "jerk (m/s³)",
        "fid": "FID",
    }
)
GENERATED = tuple(name for name in LOOKS if name != RECORDED)


def draw_measure(ax: Axes, rows: Iterable[Record], *, measure: str, targets: Targets | None = None) -> Axes:
    """One measure of every variant: a mark at the mean, a line over its interval, the recorded motion dashed.

    An arrow leads from each variant without the harmony term to the one with it.

    Parameters
    ----------
    ax : Axes
    rows : records with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    measure : name in `MEASURES`
    targets : variant -> (least, most) as its target, a pale green band in its row; either may be infinite
    """
    places = rows_by_name(ax, GENERATED)
    by_variant = {row["variant"]: row for row in rows if row["measure"] == measure}
    if RECORDED in by_variant and np.isfinite(by_variant[RECORDED]["mean"]):
        ax.axvline(by_variant[RECORDED]["mean"], color=LOOKS[RECORDED].colour, linestyle="--", linewidth=1.3, zorder=1)
    low, high = spread(by_variant.values())
    for name, place in places.items():
        look, mean = LOOKS[name], by_variant[name]["mean"]
        draw_mean(ax, by_variant[name], place, look)
        ax.annotate(
            f"{mean:.0f}" if high >= 10 else f"{mean:.2f}", (mean, place), xytext=(0, 6), textcoords="offset points",
            ha="center", va="bottom", fontsize=8.5, color=look.colour, zorder=4,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )  # fmt: skip
        if (before := by_variant.get(f"{name}, without")) is not None:
            ends = (mean, place), (before["mean"], places[before["variant"]])
            arrow = {"arrowstyle": "-|>", "color": look.colour, "alpha": 0.45, "shrinkA": 6, "shrinkB": 6}
            ax.annotate("", *ends, arrowprops=arrow, zorder=2)
    ax.set(ylim=(-0.5, len(GENERATED) - 0.2), xlabel=MEASURES.get(measure, measure))
    # From zero, so that lengths can be compared; no further than a share can go.
    limits = [limit for target in (targets or {}).values() for limit in target if np.isfinite(limit)]
    shares = measure in ("paper_harmony", "paper_hit_rate")
    ax.set_xlim(min(0.0, low - 0.12 * (high - low)), 1.08 if shares else 1.15 * max([high, *limits]))
    for name, target in (targets or {}).items():
        _shade(ax, target, (places[name] - 0.5, places[name] + 0.5))
    return ax


def _shade(ax: Axes, across: tuple[float, float], up: tuple[float, float]) -> None:
    """The part of a rectangle within the axes, pale green; its ends may be infinite."""
    (left, right), (bottom, top) = np.clip(across, *ax.get_xlim()), np.clip(up, *ax.get_ylim())
    look: dict[str, Any] = {"facecolor": COLOURS["hit"], "alpha": 0.13, "linewidth": 0, "gid": "target"}
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, zorder=0, **look))


def _absolute(targets: Targets, before: Record, recorded: Record) -> dict[str, tuple[float, float]]:
    """Targets in the units of the axes: relative ones times their reference.

    Parameters
    ----------
    targets : as for `ablation_figure`
    before, recorded : measure -> value, without the harmony term and of the recorded motion
    """
    base, jerk, fid = before["above_chance"], recorded["jerk"], max(before["fid"], 0.0)
    return {
        "above_chance": (base + targets["above_chance"][0], base + targets["above_chance"][1]),
        "count_ratio": targets["count_ratio"],
        "jerk": (targets["jerk"][0], targets["jerk"][1] * jerk),
        "fid": (targets["fid"][0], targets["fid"][1] * fid),
    }


def draw_printed(ax: Axes, rows: Iterable[Record], *, measure: str) -> Axes:
    """The paper's printed values of one measure: hatched grey bars, which none of our own numbers has.

    Parameters
    ----------
    rows : records with "variant", "measure" and "paper" (NaN where the paper prints nothing)
    """
    printed = {row["variant"]: row["paper"] for row in rows if row["measure"] == measure}
    names = [name for name in GENERATED if np.isfinite(printed.get(name, np.nan))]
    places = rows_by_name(ax, names)
    bars = ax.barh([*places.values()][::-1], [printed[name] for name in names[::-1]], height=0.6, **PRINTED)
    ax.bar_label(bars, fmt="%.2f", padding=3, fontsize=8.5, color=COLOURS["chance"])
    ax.set(xlim=(0.0, 1.0), xlabel=MEASURES.get(measure, measure))
    return ax


def ablation_figure(rows: Iterable[Record], targets: Targets) -> Figure:
    """A row of panels for each corpus, one panel a measure, and above them, apart, the values printed in the paper.

    Parameters
    ----------
    rows : records of `harmolab.lab.experiments.ablation.seed_means`
    targets : measure -> (least, most), the TARGETS of the experiment: "above_chance" a gain over the variant
        without the harmony term, "count_ratio" as it is, "jerk" in multiples of the recorded motion's, "fid" of that
        without the harmony term
    """
    table = list(rows)

    titles = {"paper_harmony": "ours: {corpus}", "above_chance": "what the paper leaves out"}

    def draw(ax: Axes, records: list[Record], measure: str) -> None:
        draw_measure(ax, records, measure=measure, targets=_row_targets(records, targets, measure))
        ax.set_title(titles.get(measure, "").format(**records[0]))

    with figure_style():
        figure = panels(table, list(MEASURES), draw, size=(14.0, 2.36), top=1.35)
        _draw_printed_row(figure.axes[: len(MEASURES)], [row for row in table if row["corpus"] == table[0]["corpus"]])
    return figure


def _row_targets(rows: Sequence[Record], targets: Targets, measure: str) -> dict[str, tuple[float, float]]:
    """variant with the harmony term -> (least, most) of a measure in the units of the axes; empty without a target."""
    means: dict[str, dict[str, float]] = {}
    for row in rows:
        means.setdefault(row["variant"], {})[row["measure"]] = row["mean"]
    losses = [name for name in GENERATED if f"{name}, without" in means and measure in targets]
    return {name: _absolute(targets, means[f"{name}, without"], means[RECORDED])[measure] for name in losses}


def _draw_printed_row(axes: Sequence[Axes], rows: Sequence[Record]) -> None:
    """The paper's two measures, and the legend where it has none."""
    for ax, measure in zip(axes, MEASURES, strict=True):
        if any(row["measure"] == measure and np.isfinite(row["paper"]) for row in rows):
            draw_printed(ax, rows, measure=measure).tick_params(axis="y", labelleft=ax is axes[0])
        else:
            ax.axis("off")
    axes[0].set_title("printed in the paper")
    handles = [
        Patch(**PRINTED, label="printed in the paper, for other music"),
        Line2D([], [], color=LOOKS[RECORDED].colour, linestyle="--", label="recorded motion"),
        shaded("asked of a harmony loss"),
        Line2D([], [], color=COLOURS["chance"], linewidth=2.2, label="95 % interval, where several were trained"),
    ]
    axes[2].legend(handles=handles, loc="upper left", fontsize=9).set_in_layout(False)


def draw_trade_off(
    ax: Axes,
    sweep: Sequence[Record],
    others: Mapping[str, Record],
    *,
    measure: str,
    target: tuple[float, float],
    least: float,
) -> Axes:
    """Harmony above chance against its cost, as the weight of the harmony term grows; the targets are a green region.

    Parameters
    ----------
    ax : Axes
    sweep : records with "harmony_weight", "above_chance" and the measure, in order of weight
    others : name in `LOOKS` -> a record with "above_chance" and the measure, to compare with
    measure : name in `MEASURES`, on the x axis
    target : (least, most) of the measure; either may be infinite
    least : float, target of the harmony above chance
    """
    look = LOOKS[WEIGHTED]
    points = [(row[measure], row["above_chance"], row["harmony_weight"]) for row in sweep]
    ax.plot([x for x, _, _ in points], [y for _, y, _ in points], "-", color=look.colour, linewidth=1.2, zorder=2)
    turn = -1 if points[-1][0] < points[0][0] else 1
    for (x, y, weight), (right, up) in zip(points, cycle(SHIFTS), strict=False):
        ax.plot(x, y, **{**look.mark, "markerfacecolor": look.colour if weight else "white"}, zorder=3)
        ax.annotate(
            f"{weight:g}", (x, y), xytext=(turn * right, up), textcoords="offset points", ha="center",
            va="center", fontsize=9, color=look.colour, zorder=4,
        )  # fmt: skip
    for name, row in others.items():
        ax.plot(row[measure], row["above_chance"], **LOOKS[name].mark, zorder=3)
    _set_limits(ax, [row["above_chance"] for row in (*sweep, *others.values())], target)
    ax.set_xlabel(MEASURES.get(measure, measure))
    _shade(ax, target, (least, np.inf))
    return ax


def _set_limits(ax: Axes, heights: Sequence[float], target: tuple[float, float]) -> None:
    """Room for every mark, for 0 and 1, and for the ends of the region of the targets."""
    ax.margins(x=0.12)
    left, right = ax.get_xlim()
    ax.set_xlim(min(left, 0.9 * target[0] if np.isfinite(target[0]) else 0.0), max(right, 1.08 * target[1]))
    ax.set_ylim(min(-0.05, min(heights) - 0.08), max(1.02, max(heights) + 0.08))


def trade_off_figure(
    sweeps: Mapping[str, Sequence[Record]],
    others: Mapping[str, Mapping[str, Record]],
    targets: Targets,
) -> Figure:
    """A row for each corpus: `draw_trade_off` against jerk, FID and M / N.

    Parameters
    ----------
    sweeps : corpus -> records, the first of them without the harmony term
    others : corpus -> name in `LOOKS` -> record; "recorded" among them
    targets : as for `ablation_figure`
    """
    with styled_axes((12.0, 3.5 * len(sweeps) + 0.5), len(sweeps), 3, sharey="row") as (figure, axes):
        for row, (corpus, sweep) in enumerate(sweeps.items()):
            line = axes[3 * row : 3 * row + 3]
            limits = _absolute(targets, sweep[0], others[corpus][RECORDED])
            least = limits["above_chance"][0]
            for ax, measure in zip(line, ("jerk", "fid", "count_ratio"), strict=True):
                draw_trade_off(ax, sweep, others[corpus], measure=measure, target=limits[measure], least=least)
            line[0].set(ylabel="harmony above chance", title=corpus)
        names = (WEIGHTED, *next(iter(others.values())))
        handles = [Line2D([], [], **LOOKS[name].mark, label=LOOKS[name].label) for name in names]
        handles[0].set_label(f"our losses, weight of the harmony term beside it (elsewhere {OUR_WEIGHT:g})")
        # Above: below the canvas is where synthetic data is marked.
        figure.legend(handles=[*handles, shaded("asked for")], loc="outside upper center", ncols=3)
    return figure
