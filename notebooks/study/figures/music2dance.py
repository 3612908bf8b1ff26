"""Figures of Music2Dance: limits that long dances keep, hands and end effectors, losses, marks.

Numbered as in the paper (Zhuang et al. 2020). Titles are read from what is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.variants import rows_by_name
from study.figures.words import corpus_words

PANELS = ("pose variance / recorded", "jerk / recorded", "moves like people", "poses apart")
DRAWING = ["draw_memory", "smoothing"]  # beside the temperature


def endurance_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Share of the dances within each limit: a row for each system, a column for each measure."""
    sums = table.groupby(["system", "measure"], sort=False)[["within", "of"]].sum()
    return (sums["within"] / sums["of"]).unstack("measure").loc[table["system"].unique(), table["measure"].unique()]


def limits_figure(table: pd.DataFrame, *, length: str) -> Figure:
    """Share of dances that keep the limit that is hardest for them: a bar a system, with the name of that limit.

    Parameters
    ----------
    table : DataFrame of `endurance_table` in notebook 16, of one corpus; it has every limit, and the recorded dancers
        who set them
    length : str, of the dances, in words
    """
    summary = endurance_summary(table)
    summary = summary[~_is_recorded(summary.index)]
    hardest, limits = 100 * summary.min(axis=1), summary.idxmin(axis=1)
    with styled_axes((9.0, 0.36 * len(summary) + 1.4)) as (figure, (ax,)):
        for system, place in rows_by_name(ax, list(summary.index)).items():
            ax.barh(place, hardest[system], color=COLOURS["visual"], height=0.62)
            words = f"{hardest[system]:.0f} %" + f": {limits[system]}" * bool(hardest[system] < 100)
            ax.annotate(words, (hardest[system], place), (5, 0), textcoords="offset points", va="center", fontsize=9.5)
        about = f"of the dances of {length}, {corpus_words(table['corpus'].iloc[0])}"
        ax.set(xlim=(0, 130), xticks=range(0, 101, 25), xlabel=f"% within the limit that is hardest for each, {about}")
        title = "Which system keeps dancing like people?"
        figure.suptitle(f"{title}\n{_limit_words(hardest)}", x=0.01, ha="left", fontsize=11.5)
    return figure


def _limit_words(hardest: pd.Series) -> str:
    """The two systems with the most dances within their hardest limit."""
    words = "; next ".join(f"{share:.0f} % with {system}" for system, share in hardest.nlargest(2).items())
    return f"Dances that keep their hardest limit: {words}"


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
    statues = table.loc[table["dancers"].str.startswith("statues"), "poses apart"].max()
    limits = dict(zip(PANELS, (0.5, 2.0, None, statues), strict=True))
    rows = table.dropna(subset="temperature")
    at = rows[(rows[list(used)] == pd.Series(used)).all(axis=1)]
    with styled_axes((9.2, 6.4), 2, 2) as (figure, axes):
        for ax, (measure, limit) in zip(axes, limits.items(), strict=True):
            for ((memory, smoothing), own), marker in zip(rows.groupby(DRAWING), "os^DvP", strict=False):
                label = f"smoothed {smoothing:g} s" + (f", draws last {memory:g} s" if memory else "")
                ax.plot(own["temperature"], own[measure], marker=marker, label=label)
            ax.plot(at["temperature"], at[measure], "o", ms=15, mfc="none", mec=COLOURS["ink"])
            if limit is not None:
                ax.axhline(limit, color=COLOURS["chance"], linestyle="--")
            ax.set(xlabel="temperature", title=measure, ylim=(0, None))
        axes[3].set(title="poses apart (no say in the choice)", ylim=(0, 3 * statues))
        axes[3].annotate("statues", (0, statues), va="bottom", fontsize=9)
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
