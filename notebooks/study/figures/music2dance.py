"""Figures of Music2Dance: limits that long dances keep, hands and end effectors, losses, marks, and its parts.

Numbered as in the paper (Zhuang et al. 2020). Titles are read from what is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from harmolab.lab.figures.style import COLOURS, figure_style, styled_axes
from study.figures.framework import draw_diagram
from study.figures.words import corpus_words

DRAWING = ["draw_memory", "smoothing"]  # beside the temperature
SIDES = (COLOURS["audio"], COLOURS["miss"])  # left and right, as in contact sheets
BOX, GAP, ROW, HALF = 2.05, 0.45, 1.05, 0.36  # inches: width of a box, room between two, a row, half a box's height
# Heading of a box -> its column and row, and what it is of.
FRAMEWORK: Mapping[str, tuple[float, float, str]] = MappingProxyType(
    {
        "music": (0, 0, "audio"),
        "mapping network": (1, 0, "audio"),
        "music at each frame": (2, 0, "audio"),
        "frames so far": (0, 1, "motion"),
        "network": (2, 1, "both"),
        "next frame": (3, 1, "motion"),
        "dance": (0, 2, "both"),
        "parameters": (3, 0, "both"),
    }
)
FRAMEWORK_ARROWS = (
    ("music", "mapping network"), ("mapping network", "music at each frame"), ("music at each frame", "network"),
    ("frames so far", "network"), ("dance", "network"), ("network", "next frame"),
)  # fmt: skip
CHAIN: Mapping[str, tuple[float, float, str]] = MappingProxyType(
    {
        "recordings": (0, 1, "motion"),
        "motion code": (1, 1, "motion"),
        "figures": (2, 1, "both"),
        "train": (3, 0, "both"),
        "validation": (3, 1, "both"),
        "test": (3, 2, "both"),
    }
)
CHAIN_ARROWS = (
    ("recordings", "motion code"), ("motion code", "figures"), ("figures", "train"), ("figures", "validation"),
    ("figures", "test"),
)  # fmt: skip


def endurance_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Share of the dances within each limit: a row for each system, a column for each measure."""
    sums = table.groupby(["system", "measure"], sort=False)[["within", "of"]].sum()
    return (sums["within"] / sums["of"]).unstack("measure").loc[table["system"].unique(), table["measure"].unique()]


def limits_figure(table: pd.DataFrame, *, length: str) -> Figure:
    """Shares of dances that keep each limit: a row a system, a column a measure, green for all, red for none.

    Parameters
    ----------
    table : DataFrame of `endurance_table` in notebook 16, of one corpus
    length : str, of the dances, in words
    """
    summary = endurance_summary(table)
    with styled_axes((9.2, 0.5 * len(summary) + 1.7)) as (figure, (ax,)):
        ax.imshow(summary.to_numpy(np.float64), cmap="RdYlGn", vmin=0, vmax=1, aspect="auto", alpha=0.75)
        for row, values in enumerate(summary.to_numpy(np.float64)):
            for column, value in enumerate(values):
                ax.text(column, row, f"{100 * value:.0f}", ha="center", va="center", color=COLOURS["ink"], fontsize=10)
        ax.set_xticks(range(summary.shape[1]), [name.replace(" ", "\n", 1) for name in summary.columns])
        ax.set_yticks(range(len(summary)), summary.index)
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
        figure.suptitle(_limits_title(summary), x=0.01, ha="left", fontsize=11.5)
        corpus = corpus_words(str(table["corpus"].iloc[0]))
        ax.set_xlabel(f"% of the dances of {length} within each limit ({corpus})")
    return figure


def _limits_title(summary: pd.DataFrame) -> str:
    """The two systems that keep the limit that they keep least often in most dances."""
    kept = summary[~_is_recorded(summary.index)].min(axis=1).nlargest(2)
    words = [f"{share:.0%} with {system}" for system, share in kept.items()]
    return f"Dances that keep their hardest limit: {'; next '.join(words)}"


def _is_recorded(systems: Any) -> Any:
    """Mask of the rows that are no system's: recorded dancers, and their statues."""
    return systems.str.startswith(("recorded", "statue"))


def chance_figure(table: pd.DataFrame, *, used: Mapping[str, float]) -> Figure:
    """Movement, shaking and likeness by temperature, a line for each way to draw; the settings in use are ringed.

    Parameters
    ----------
    table : DataFrame with the columns temperature, smoothing, draw_memory, "moves like people", "pose variance /
        recorded", "jerk / recorded" and "poses apart"; of rows without a temperature only that of the statues is drawn
    used : temperature, smoothing and draw_memory in use
    """
    panels = {
        "pose variance / recorded": (0.5, None),
        "jerk / recorded": (None, 2.0),
        "moves like people": (None, None),
        "poses apart": (None, table.loc[table["dancers"].str.startswith("statues"), "poses apart"].max()),
    }
    rows = table.dropna(subset="temperature")
    at = rows[(rows[list(used)] == pd.Series(used)).all(axis=1)]
    with styled_axes((9.2, 6.4), 2, 2) as (figure, axes):
        for ax, (measure, (least, most)) in zip(axes, panels.items(), strict=True):
            for ((memory, smoothing), own), marker in zip(rows.groupby(DRAWING), "os^DvP", strict=False):
                label = f"smoothed {smoothing:g} s" + (f", draws last {memory:g} s" if memory else "")
                ax.plot(own["temperature"], own[measure], marker=marker, label=label)
            ax.plot(at["temperature"], at[measure], "o", ms=15, mfc="none", mec=COLOURS["ink"])
            for limit in (least, most):
                if limit is not None:
                    ax.axhline(limit, color=COLOURS["chance"], linestyle="--")
            ax.set(xlabel="temperature", title=measure, ylim=(0, None))
        axes[3].set(title="poses apart (no say in the choice)", ylim=(0, 3 * panels["poses apart"][1]))
        axes[3].annotate("statues", (0, panels["poses apart"][1]), va="bottom", fontsize=9)
        axes[2].set(title="dances that move like people", ylim=(0, 1))
        axes[2].yaxis.set_major_formatter(PercentFormatter(1.0))
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        figure.suptitle(_chance_title(rows, at), x=0.01, ha="left", fontsize=11.5)
    return figure


def _chance_title(rows: pd.DataFrame, at: pd.DataFrame) -> str:
    """Dances that move like people at the settings in use, beside the best of the others."""
    share, best = at["moves like people"].max(), rows.drop(at.index)["moves like people"].max()
    order = "more than" if share > best else "as many as" if share == best else "fewer than"
    words = f"Settings in use (ringed): {share:.0%} of dances move like people"
    return f"{words}, {order} at the best others ({best:.0%})"


def marks_figure(marks: pd.DataFrame, weights: Mapping[str, float], *, corpus: str) -> Figure:
    """Marks of every system, 0 to 10: four measures by their weights, and the weighted sum with its interval."""
    names = [*weights, "total"]
    with styled_axes((9.2, 0.42 * len(marks) + 1.8), 1, len(names), sharey=True) as (figure, axes):
        for ax, name in zip(axes, names, strict=True):
            colour = COLOURS["ink"] if name == "total" else COLOURS["audio"]
            ax.barh(marks["system"], marks[name], color=colour, height=0.6)
            ax.set(xlim=(0, 10), title=name if name == "total" else f"{name}\n({100 * weights[name]:.0f} %)")
        ends = marks.dropna(subset="low")
        axes[-1].hlines(ends["system"], ends["low"], ends["high"], color=COLOURS["visual"], linewidth=2)
        axes[0].invert_yaxis()
        figure.supxlabel(f"marks; orange: 95 % over trainings; {corpus_words(corpus)}", fontsize=10)
        figure.suptitle(_marks_title(marks), x=0.01, ha="left", fontsize=11.5)
    return figure


def _marks_title(marks: pd.DataFrame) -> str:
    """The system with the highest total, and if it is above all intervals."""
    systems = marks[~_is_recorded(marks["system"])].set_index("system")
    best, top = systems["total"].idxmax(), systems["total"].max()
    doubt = "" if systems.drop(best)["high"].fillna(0.0).max() < top else ", but inside another's interval"
    return f"Machine marks, nobody was asked: {best} highest with {top:.1f} of 10{doubt}"


def boxes_figure(
    boxes: Mapping[str, str], places: Mapping[str, tuple[float, float, str]], arrows: Sequence[tuple[str, str]]
) -> Figure:
    """Boxes with words, and arrows between them: along a row, else up or down.

    Parameters
    ----------
    boxes : heading -> the lines below it
    places : heading -> column, row (from the top) and name in `framework.TINTS`; headings without a box are left out
    arrows : pairs of headings
    """
    middles = {
        name: ((column + 0.5) * (BOX + GAP), -ROW * (row + 0.5))
        for name, (column, row, _) in places.items()
        if name in boxes
    }
    parts = [[*middles[name], BOX, places[name][2], name, *boxes[name].split("\n")] for name in middles]
    ways = [_way(middles[one], middles[other]) for one, other in arrows if one in middles and other in middles]
    width = max(x for x, _ in middles.values()) + (BOX + GAP) / 2
    height = ROW / 2 - min(y for _, y in middles.values())
    with figure_style():
        figure = Figure(figsize=(width, height))
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width), ylim=(-height, 0.0))
        ax.axis("off")
        draw_diagram(ax, {"parts": parts, "arrows": ways})
    return figure


def _way(before: tuple[float, float], after: tuple[float, float]) -> list[tuple[float, float]]:
    """From one box to another: straight in a row, and up or down with one corner between rows."""
    (x, y), (to, down) = before, after
    if y == down:
        half = BOX / 2 if to > x else -BOX / 2
        return [(x + half, y), (to - half, down)]
    edge = down + (HALF if y > down else -HALF)
    if x == to:
        return [(x, y - (HALF if y > down else -HALF)), (to, edge)]
    if to - x > 1.5 * (BOX + GAP):
        return [(x + BOX / 2, y), (to, y), (to, edge)]
    return [(x + BOX / 2, y), (x + (BOX + GAP) / 2, y), (x + (BOX + GAP) / 2, down), (to - BOX / 2, down)]


def framework_boxes_figure(boxes: Mapping[str, str]) -> Figure:
    """Fig. 3: music and motion through the network; `boxes` as of `harmolab.systems.network_boxes`."""
    return boxes_figure(boxes, FRAMEWORK, FRAMEWORK_ARROWS)


def chain_figure(boxes: Mapping[str, str]) -> Figure:
    """Fig. 2, replaced: recordings to windows; `boxes` as of `recording_chain` in notebook 16."""
    return boxes_figure(boxes, CHAIN, CHAIN_ARROWS)
