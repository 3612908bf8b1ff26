"""Figures of trained musicians: Tables 1 and 2 of "Audio to Body Dynamics", components, error and hits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.words import sentence

PLANTED = "planted hands"  # the truth, beside predicted hands
PARTS = {"body": COLOURS["chance"], "left hand": COLOURS["audio"], "right hand": COLOURS["miss"]}


def player_table_figure(table: pd.DataFrame, *, players: str, unit: str = "pixels") -> Figure:
    """A table as a picture: our errors; test errors less those of the final settings, ours and the paper's.

    Parameters
    ----------
    table : DataFrame of `complete_table` of notebook 19; rows without seeds are limits, drawn as lines. The paper's
        panel is left out without a column "paper test"
    players : str, begins the title
    unit : str, of the errors
    """
    runs, limits = table[table["seeds"].notna()], table[table["seeds"].isna()]
    columns = 3 if "paper test" in runs else 2
    with styled_axes((9.2, 0.3 * len(runs) + 2.2), 1, columns, sharey=True) as (figure, axes):
        _draw_sides(axes[0], runs, limits, unit)
        _draw_differences(axes[1], runs, "test full", COLOURS["ink"])
        axes[1].set(title="ours: test above final", xlabel=f"{unit}; bars: SD over seeds")
        if columns == 3:
            _draw_differences(axes[2], runs, "paper test", COLOURS["chance"])
            axes[2].set(title="paper: test above final", xlabel="its pixels, its data")
        axes[0].invert_yaxis()
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3, fontsize=9)
        figure.suptitle(_table_title(table, players, unit), x=0.01, ha="left", fontsize=11.5)
    return figure


def _table_title(table: pd.DataFrame, players: str, unit: str) -> str:
    """Test errors of the best row, of the final settings and of the mean pose."""
    errors = table.set_index("row")["test full"]
    best = str(errors[table["seeds"].notna().to_numpy()].idxmin())
    others = [f"{name} {errors[name]:.1f}" for name in ("final", "mean pose") if name != best and name in errors]
    return f"{sentence(players)}: least error with {best}, {errors[best]:.1f} {unit} ({', '.join(others)})"


def _draw_sides(ax: Axes, runs: pd.DataFrame, limits: pd.DataFrame, unit: str) -> None:
    """Errors on the three sides, and limits as lines."""
    looks = {"train": ("o", "white"), "validation": ("D", COLOURS["faint"]), "test": ("o", COLOURS["ink"])}
    for side, (marker, fill) in looks.items():
        ax.plot(runs[f"{side} full"], runs["row"], marker, color=COLOURS["ink"], mfc=fill, ms=5, label=side)
    lines = ("--", *["-."] * (len(limits) - 2), ":")
    for (_, row), line in zip(limits.iterrows(), lines, strict=False):
        ax.axvline(row["test full"], color=COLOURS["chance"], linestyle=line, label=row["row"])
    ax.set(xlabel=unit, title="ours: error", xlim=(0, None))


def _draw_differences(ax: Axes, runs: pd.DataFrame, name: str, colour: str) -> None:
    """What the errors of some column are above those of the final settings, with their SDs where there are any."""
    values, kept = runs[name] - runs.loc[runs["row"] == "final", name].item(), runs.dropna(subset=name)
    spread = kept.get(f"{name} SD")
    ax.errorbar(values[kept.index], kept["row"], xerr=spread, fmt="s", color=colour, ms=5, elinewidth=1.5, capsize=2)
    ax.axvline(0, color=COLOURS["faint"], zorder=0)


def components_figure(table: pd.DataFrame, *, count: int = 5) -> Figure:
    """Correlation of predicted and tracked components, and what share of the variance each is, by instrument.

    Parameters
    ----------
    table : DataFrame of `component_table` of notebook 19, of one or more instruments
    count : int, components shown
    """
    groups = list(table.groupby("instrument", sort=False))
    with styled_axes((min(9.2, 4.8 * len(groups)), 3.6), 1, len(groups), sharey=True) as (figure, axes):
        for ax, (instrument, every) in zip(axes, groups, strict=True):
            own = every.head(count)
            bars = ax.bar(own["component"], own["correlation"].fillna(0.0), color=[PARTS[part] for part in own["part"]])
            ax.bar_label(bars, [f"{value:.2f}" for value in own["correlation"]], padding=2, fontsize=9)
            names = zip(own["component"], own["part"], own["share"], strict=True)
            labels = [f"{number}\n{part}\n{100 * share:.2g} %" for number, part, share in names]
            ax.set_xticks(own["component"], labels, fontsize=9)
            ax.axhline(0, color=COLOURS["ink"], linewidth=0.8)
            title = f"largest component predicted at {own['correlation'].iloc[int(own['share'].argmax())]:.2f}"
            ax.set(title=f"Planted {instrument}: {title}", ylim=(min(-0.3, own["correlation"].min() - 0.15), 1.15))
        axes[0].set_ylabel("correlation, test pieces")
        figure.supxlabel("component, the part that moves most with it, its share of the variance", fontsize=9)
    return figure


def hits_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Error and hits side by side: what is nearest in pixels need not strike in time.

    Parameters
    ----------
    tables : instrument -> DataFrame of `hits_table` of notebook 19
    """
    height = sum(0.38 * len(table) + 1.1 for table in tables.values()) + 0.6
    sizes = {"height_ratios": [len(table) for table in tables.values()]}
    with styled_axes((9.2, height), len(tables), 2, sharex="col", gridspec_kw=sizes) as (figure, axes):
        for row, (instrument, table) in enumerate(tables.items()):
            error, hits = axes[2 * row : 2 * row + 2]
            looks: dict[str, Any] = {"height": 0.6, "xerr": table["error SD"], "color": COLOURS["visual"]}
            error.barh(table["hands"], table["error"], **looks)
            looks |= {"xerr": table["hits SD"], "color": COLOURS["hit"], "label": "own music"}
            hits.barh(table["hands"], table["hits"], **looks)
            hits.plot(table["other"], table["hands"], "D", color=COLOURS["ink"], mfc="white", ms=6, label="other music")
            hits.axvline(0, color=COLOURS["chance"], linewidth=1)
            hits.set_yticks([])
            beside: dict[str, Any] = {"fontsize": 9, "transform": hits.get_yaxis_transform()}
            for number, share in enumerate(table["pieces p < .05"]):
                hits.text(1.03, number, f"{100 * share:.0f} %", va="center", **beside)
            hits.text(1.03, -0.6, "pieces with\np < .05", va="bottom", **beside)
            for ax in (error, hits):
                ax.invert_yaxis()
            events = {"piano": "strikes", "violin": "turns of the bow"}[instrument]
            predicted = table[table["hands"] != PLANTED].set_index("hands")
            error.set_title(f"Planted {instrument}: least error\nwith {predicted['error'].idxmin()}")
            hits.set_title(f"Most hits\nwith {predicted['hits'].idxmax()}")
            hits.set_xlabel(f"{events} that meet onsets (0: chance, 1: all)")
        figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
        axes[-2].set_xlabel("error in pixels (less is better)")
        axes[-1].xaxis.set_major_formatter("{x:.1f}")
    return figure
