"""Results over a corpus: AUC of every score with its chance band, bar patterns, disturbances, pairwise choices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.bar_pattern import evaluate_pattern
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.lab.figures.variants import LOOKS, Record, rows_by_name
from harmolab.params import BarPattern

SCORE_LABELS = {
    "recommended": "recommended (shape speed)",
    "room_speed": "before: joint speed in the room",
    "peaks_lagged": "speed peaks, one lag a dance",
    "valleys": "speed valleys within 0.1 s",
    "paper": "paper: harmony h",
    "paper_above_chance": "paper, chance-corrected",
    "hit_rate": "paper: hit rate",
    "beat_align_motion": "AIST++ alignment, motion beats",
    "beat_align_music": "AIST++ alignment, music beats",
    "beat_hit_rate": "Lee et al. hit rate",
    "mir_eval_f": "mir_eval F, 70 ms",
}

# Lines for scores and dances; none of them has a meaning elsewhere (audio, visual, hit, miss).
SCORE_COLOURS = ("#222222", "#CC79A7", "#56B4E9", "#8C6D31", "#7F7F7F", "#6A3D9A", "#B8A9C9")
SCORE_MARKS = ("o-", "s--", "^-.", "x:", "d-", "v--", "P-.")
JITTER_SCORES = ("recommended", "valleys", "paper", "beat_align_motion", "mir_eval_f")
# The scores that choose between two dances, in their colours above.
JUDGES = MappingProxyType({"paper's harmony": ("^", SCORE_COLOURS[2]), "above chance": ("s", SCORE_COLOURS[1])})


def draw_auc(ax: Axes, scores: Mapping[str, Mapping[str, Any]], *, title: str = "") -> Axes:
    """AUC of each score as a dot on its chance band: a dot inside its grey band tells nothing.

    Parameters
    ----------
    ax : Axes
    scores : the "scores" of a `harmolab compare` summary
    title : str
    """
    places = rows_by_name(ax, [name for name in SCORE_LABELS if name in scores], SCORE_LABELS)
    for name, row in places.items():
        (low, high), value = scores[name]["chance_band"], scores[name]["auc"]
        label = None if row else "chance band (95 %)"
        ax.barh(row, high - low, left=low, height=0.7, color=COLOURS["faint"], label=label)
        colour = COLOURS["hit"] if value > high else COLOURS["ink"] if value >= low else COLOURS["miss"]
        ax.plot(value, row, "o" if value > high else "x", color=colour, markersize=8, markeredgewidth=2)
        ax.annotate(f"{value:.2f}", (value, row), xytext=(9, 0), textcoords="offset points", va="center", color=colour)
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1)
    ax.set_xlim(0, 1.1)
    ax.set_xlabel("AUC: true above wrong music (0.5 = coin, 1 = always)")
    ax.set_title(title)
    return ax


def draw_patterns(ax: Axes, patterns: Mapping[str, BarPattern]) -> Axes:
    """Learnt course of shape speed over the beats, one line a dance; beats are vertical lines."""
    longest = max(pattern.beats for pattern in patterns.values())
    styles = zip(patterns.items(), ["-", "--", "-.", ":", "-", "--", "-."], SCORE_COLOURS, strict=False)
    for (name, pattern), style, colour in styles:
        positions = np.linspace(0, pattern.beats, 200)
        values = evaluate_pattern(pattern, positions)
        ax.plot(positions, values, style, color=colour, label=f"{name} ({pattern.beats} beats)")
    for beat in range(longest + 1):
        ax.axvline(beat, color=COLOURS["audio"], linewidth=1, alpha=0.6)
    ax.axhline(0, color=COLOURS["faint"], linewidth=1, zorder=0)
    ax.set(xlabel="beat of the cycle (0 = first beat of the bar)", ylabel="shape speed (SD from its mean)")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def draw_picks(ax: Axes, table: pd.DataFrame) -> Axes:
    """Share of inharmonious clips picked out, one bar a judge; the paper's viewers hatched, in their own colour.

    Parameters
    ----------
    table : DataFrame with columns "judge", "paper", "harmolab" (shares; one of the two is NaN), "low", "high"
    """
    places = rows_by_name(ax, list(table["judge"]))
    for judge in table.to_dict("records"):
        human, row = pd.notna(judge["paper"]), places[judge["judge"]]
        value, end = (judge["paper"], judge["paper"]) if human else (judge["harmolab"], judge["high"])
        colour, hatch = (COLOURS["chance"], "//") if human else (SCORE_COLOURS[2], None)
        ax.barh(row, value, color=colour, hatch=hatch, height=0.65, edgecolor="white")
        if not human:
            ax.plot([judge["low"], judge["high"]], [row, row], color=COLOURS["ink"], linewidth=2)
        ax.annotate(f" {value:.0%}", (max(value, end), row), va="center")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.set_xlim(0, 1.12)
    ax.set_xlabel("inharmonious clips picked out (dotted: by guessing; black: 95 % of draws)")
    return ax


def draw_disturbances(ax: Axes, table: pd.DataFrame, scores: Sequence[str]) -> Axes:
    """AUC of some scores as one disturbance grows; the legend is in the order of the lines at its greatest level.

    Parameters
    ----------
    table : DataFrame whose first column is the level (its name is the x label), with one column a score
    scores : names of the columns to draw
    """
    for name, mark, colour in zip(scores, SCORE_MARKS, SCORE_COLOURS, strict=False):
        ax.plot(table.iloc[:, 0], table[name], mark, color=colour, label=SCORE_LABELS.get(name, name))
    ax.axhline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1, label="a coin")
    ax.set(xlabel=table.columns[0], ylabel="AUC: how often the true music wins", ylim=(0.4, 1.02))
    handles = sorted(ax.lines, key=lambda line: -float(np.asarray(line.get_ydata())[-1]))
    ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def auc_figure(summaries: Mapping[str, Mapping[str, Any]]) -> Figure:
    """`draw_auc` for several corpora, four in a row at most.

    Parameters
    ----------
    summaries : corpus -> the summary of its comparison
    """
    columns = min(len(summaries), 4)
    rows = -(-len(summaries) // columns)
    with styled_axes((4.4 + 3.6 * columns, 4.6 * rows), rows, columns, sharey=True) as (figure, axes):
        for ax, (name, summary) in zip(axes, summaries.items(), strict=False):
            draw_auc(ax, summary["scores"], title=f"{name} (n = {summary['n']}, {summary['beats']} beats)")
        for ax in axes[len(summaries) :]:
            ax.set_visible(False)
    return figure


def patterns_figure(patterns: Mapping[str, BarPattern], *, title: str) -> Figure:
    """`draw_patterns` in a figure of its own."""
    with styled_axes((8.0, 3.8)) as (figure, (ax,)):
        draw_patterns(ax, patterns).set_title(title)
    return figure


def picks_figure(table: pd.DataFrame, *, title: str) -> Figure:
    """`draw_picks` in a figure of its own."""
    with styled_axes((8.0, 2.8)) as (figure, (ax,)):
        draw_picks(ax, table).set_title(title)
    return figure


def disturbances_figure(table: pd.DataFrame, scores: Sequence[str] = JITTER_SCORES) -> Figure:
    """`draw_disturbances` in a figure of its own; its title is which score stands the most."""
    last = table.iloc[-1]
    best = max(scores, key=lambda name: last[name])
    rest = [last[name] for name in scores if name != best]
    with styled_axes((9.0, 4.0)) as (figure, (ax,)):
        draw_disturbances(ax, table, scores).set_title(
            f"“{SCORE_LABELS.get(best, best)}” stands the most: at the right end AUC {last[best]:.2f}, "
            f"the others {min(rest):.2f} to {max(rest):.2f}"
        )
    return figure


def draw_choices(ax: Axes, rows: Sequence[Record]) -> Axes:
    """Share of units on which each score prefers the right one of two variants; the grey band is a coin's (Fig. 13).

    Parameters
    ----------
    ax : Axes
    rows : records with "first", "second", "judge", "share" (of units on which the judge prefers the first), "n"
    """
    pairs = list(dict.fromkeys((row["first"], row["second"]) for row in rows))[::-1]
    half = 1.96 * 0.5 / np.sqrt(max(row["n"] for row in rows))
    ax.axvspan(0.5 - half, 0.5 + half, color=COLOURS["faint"], zorder=0, label="a coin, 95 % of the time")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.hlines(range(len(pairs)), 0.0, 1.0, color=COLOURS["faint"], linewidth=1, zorder=1)
    for place, (judge, (marker, colour)) in enumerate(JUDGES.items()):
        choices = [row for row in rows if row["judge"] == judge]
        levels = [pairs.index((row["first"], row["second"])) + 0.16 - 0.32 * place for row in choices]
        shares = [1.0 - row["share"] for row in choices]
        ax.plot(shares, levels, linestyle="none", marker=marker, markersize=10, color=colour, label=judge, zorder=3)
    ax.set(yticks=range(len(pairs)), yticklabels=[LOOKS[first].label for first, _ in pairs])
    ax.set(xlim=(-0.03, 1.03), ylim=(-0.6, len(pairs) - 0.4))
    ax.set_xlabel("← prefers the left one      share of units      prefers the right one →")
    other = ax.secondary_yaxis("right")
    other.set_yticks(range(len(pairs)), [LOOKS[second].label for _, second in pairs])
    for axis in (ax, other):
        axis.tick_params(axis="y", length=0)
    return ax


def forced_choice_figure(tables: Mapping[str, Sequence[Record]]) -> Figure:
    """`draw_choices` for each corpus, one above the other."""
    with styled_axes((9.0, 3.6 * len(tables)), len(tables)) as (figure, axes):
        for ax, (corpus, rows) in zip(axes, tables.items(), strict=True):
            draw_choices(ax, rows).set_title(f"{corpus}: two scores as judges, {rows[0]['n']} units (no people)")
        axes[-1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    return figure
