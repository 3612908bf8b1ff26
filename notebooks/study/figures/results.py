"""Results over a corpus: AUC of every score with its chance band, bar patterns, disturbances, pairwise choices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.params import BarPattern
from harmolab.verdict.bar_pattern import evaluate_pattern
from study.figures.variants import LOOKS, Record, by_corpus, rows_by_name
from study.figures.words import corpus_words, is_synthetic, sentence
from study.saving import mark_synthetic

SCORE_LABELS = {
    "recommended": "recommended (shape speed)",
    "discriminant": "discriminant, trained on lagged music",
    "room_speed": "before: joint speed in the room",  # in tables of earlier runs only
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

OURS = "recommended"
NEAR = 0.15  # beats, within which a moment is on a beat

# Lines for scores and dances; none of them has a meaning elsewhere (audio, visual, hit, miss).
SCORE_COLOURS = ("#222222", "#CC79A7", "#56B4E9", "#8C6D31", "#7F7F7F", "#6A3D9A", "#B8A9C9")
SCORE_MARKS = ("o-", "s--", "^-.", "x:", "d-", "v--", "P-.")
JITTER_SCORES = ("recommended", "valleys", "paper", "beat_align_motion", "mir_eval_f")
# The scores that choose between two dances, in their colours above.
JUDGES = MappingProxyType({"paper's harmony": ("^", SCORE_COLOURS[2]), "above chance": ("s", SCORE_COLOURS[1])})


def draw_auc(ax: Axes, rows: Sequence[Record], names: Sequence[str] | None = None) -> Axes:
    """AUC of each score on its chance band, in the order of the rows; only what leaves its band has a colour.

    Parameters
    ----------
    ax : Axes
    rows : records with "score", "AUC", "chance low" and "chance high", of one corpus
    names : scores that have a line, from above; default those of the rows
    """
    places = rows_by_name(ax, names or [row["score"] for row in rows], SCORE_LABELS)
    for row in rows:
        place, low, high, value = places[row["score"]], row["chance low"], row["chance high"], row["AUC"]
        ax.barh(place, high - low, left=low, height=0.7, color=COLOURS["faint"], label="chance band (95 %)")
        colour = COLOURS["hit"] if value > high else COLOURS["chance"] if value >= low else COLOURS["miss"]
        ax.plot(value, place, "o" if value > high else "x", color=colour, markersize=7, markeredgewidth=2)
        ax.annotate(
            f"{value:.2f}", (max(value, high), place), xytext=(8, 0), textcoords="offset points", va="center",
            fontsize=9, color=colour,
        )  # fmt: skip
    for label in ax.get_yticklabels():
        if label.get_text() == SCORE_LABELS[OURS]:
            label.set_fontweight("bold")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1)
    ax.set_xlim(0, 1.15)
    return ax


def draw_pattern(ax: Axes, pattern: BarPattern) -> Axes:
    """Learnt course of shape speed over the beats of a bar, named 1, 2, 3; an arrow to the fastest moment."""
    positions = np.linspace(0, pattern.beats, 200)
    values = evaluate_pattern(pattern, positions)
    ax.fill_between(positions, values, 0.0, color=COLOURS["visual"], alpha=0.25, linewidth=0)
    ax.plot(positions, values, color=COLOURS["visual"], linewidth=2)
    top = int(np.argmax(values))
    ax.annotate(
        "fastest here", (positions[top], values[top]), (0, 16), textcoords="offset points", ha="center", va="bottom",
        fontsize=9, arrowprops={"arrowstyle": "->", "color": COLOURS["ink"]}, annotation_clip=False,
    )  # fmt: skip
    for beat in range(pattern.beats + 1):
        ax.axvline(beat, color=COLOURS["audio"], linewidth=1, alpha=0.6)
    ax.axhline(0, color=COLOURS["chance"], linewidth=0.8, zorder=0)
    ax.set_xticks(range(pattern.beats + 1), [*(str(beat + 1) for beat in range(pattern.beats)), "1"])
    ax.set_xlim(0, pattern.beats)
    return ax


def draw_picks(ax: Axes, table: pd.DataFrame) -> Axes:
    """Share of inharmonious clips picked out, one bar a judge, its number inside; the paper's viewers hatched.

    Parameters
    ----------
    table : DataFrame with columns "judge", "paper", "harmolab" (shares; one of the two is NaN), "low", "high"
    """
    places = rows_by_name(ax, list(table["judge"]))
    for judge in table.to_dict("records"):
        human, row = pd.notna(judge["paper"]), places[judge["judge"]]
        value = judge["paper"] if human else judge["harmolab"]
        colour, hatch = (COLOURS["chance"], "//") if human else (SCORE_COLOURS[2], None)
        ax.barh(row, value, color=colour, hatch=hatch, height=0.65, edgecolor="white")
        if not human:
            ax.plot([judge["low"], judge["high"]], [row, row], color=COLOURS["ink"], linewidth=2, gid="interval")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
        ax.annotate(f"{value:.0%}", (0.02, row), va="center", fontweight="bold", bbox=box)
    ax.axvline(0.5, color=COLOURS["ink"], linestyle=":", linewidth=1.5)
    ax.annotate("guessing", (0.5, len(places) - 0.45), ha="center", va="bottom", fontsize=9)
    ax.set_ylim(-0.6, len(places) - 0.1)
    ax.set_xlim(0, 1.0)
    ax.set_xlabel("share of inharmonious clips picked out (black: 95 % of draws)")
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


def auc_figure(table: pd.DataFrame) -> Figure:
    """`draw_auc` for each corpus, two in a row, scores in the order of their AUC in the first; titles count who tells.

    Parameters
    ----------
    table : DataFrame with a row a corpus and score, as `study.experiments.discrimination.auc_table` returns it
    """
    corpora = by_corpus([dict(row) for _, row in table.iterrows() if row["score"] in SCORE_LABELS])
    order = [row["score"] for row in sorted(next(iter(corpora.values())), key=lambda row: -row["AUC"])]
    lines = -(-len(corpora) // 2)
    with styled_axes((9.0, (0.24 * len(order) + 0.75) * lines + 0.9), lines, 2, sharey=True) as (figure, axes):
        for ax, (corpus, rows) in zip(axes, corpora.items(), strict=False):
            draw_auc(ax, rows, order).set_title(_tellers(rows), fontsize=10)
            if is_synthetic(corpus):
                mark_synthetic(ax)
        for ax in axes[len(corpora) :]:
            ax.set_visible(False)
        figure.supxlabel("AUC: how often the true music scores above late music (0.5: a coin, 1: always)", fontsize=10)
        look: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 2}
        handles = [
            Line2D([], [], marker="o", color=COLOURS["hit"], label="above its chance band: tells", **look),
            Line2D([], [], marker="x", color=COLOURS["chance"], label="inside: tells nothing", **look),
            Line2D([], [], marker="x", color=COLOURS["miss"], label="below: prefers late music", **look),
            Patch(color=COLOURS["faint"], label="chance band (95 %)"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=4, fontsize=9)
    return figure


def _tellers(rows: Sequence[Record]) -> str:
    """The scores of a corpus that lie above their chance bands, counted, and whether ours is one of them."""
    corpus, windows, beats = (rows[0][name] for name in ("corpus", "windows", "beats"))
    above = [row["score"] for row in rows if row["AUC"] > row["chance high"]]
    ours = (", ours too" if len(above) > 1 else ", ours") if OURS in above else ""
    about = f"{sentence(corpus_words(corpus))} ({windows} windows):"
    return f"{about}\n{len(above) or 'none'} of {len(rows)} scores tell{ours} ({beats} beats)"


def patterns_figure(patterns: Mapping[str, BarPattern], *, corpus: str) -> Figure:
    """`draw_pattern` of each dance in a panel of its own, with the place of its fastest moment as title."""
    lines = -(-len(patterns) // 2)
    with styled_axes((9.0, 2.5 * lines + 0.4), lines, 2, sharey=True) as (figure, axes):
        for ax, (dance, pattern) in zip(axes, patterns.items(), strict=False):
            draw_pattern(ax, pattern).set_title(f"{dance}: {_fastest(pattern)}", pad=26, fontsize=10.5)
            ax.set_xlabel("beat of the cycle")
        for ax in axes[len(patterns) :]:
            ax.set_visible(False)
        for ax in axes[::2]:
            ax.set_ylabel("shape speed (SD)")
        title = f"Dancers do not all stop on the beat ({corpus_words(corpus)})" if _any_off_beat(patterns) else ""
        figure.suptitle(title or corpus_words(corpus), x=0.01, ha="left", fontsize=12)
    return figure


def _slowest(pattern: BarPattern) -> float:
    """Beats from the slowest moment of a pattern to the nearest beat."""
    positions = np.linspace(0, pattern.beats, 200)
    place = float(positions[np.argmin(evaluate_pattern(pattern, positions))])
    return abs(place - round(place))


def _any_off_beat(patterns: Mapping[str, BarPattern]) -> bool:
    return any(_slowest(pattern) > NEAR for pattern in patterns.values())


def _fastest(pattern: BarPattern) -> str:
    """The place of the fastest moment in words: on a beat, or between two."""
    positions = np.linspace(0, pattern.beats, 200)
    place = float(positions[np.argmax(evaluate_pattern(pattern, positions))])
    beat = round(place) % pattern.beats + 1
    if abs(place - round(place)) <= NEAR:
        return f"fastest on {beat}"
    before = int(place) % pattern.beats + 1
    return f"fastest between {before} and {before % pattern.beats + 1}"


def picks_figure(table: pd.DataFrame, *, corpus: str) -> Figure:
    """`draw_picks` in a figure of its own; its title is the best score beside guessing."""
    scores = table[table["paper"].isna()]
    best = scores.sort_values("harmolab").iloc[-1]
    sure = "better than guessing" if best["low"] > 0.5 else "not clearly better than guessing"
    with styled_axes((9.0, 3.0)) as (figure, (ax,)):
        draw_picks(ax, table).set_title(f"Best score: {best['judge']}, {sure}")
        ax.set_xlabel(f"{ax.get_xlabel()}; {corpus_words(corpus)}")
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
    """Share of units on which each score prefers one variant over another, a row a pair; the grey band is a coin's.

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
        levels = [pairs.index((row["first"], row["second"])) + 0.18 - 0.36 * place for row in choices]
        shares = [1.0 - row["share"] for row in choices]
        ax.plot(shares, levels, linestyle="none", marker=marker, markersize=9, color=colour, label=judge, zorder=3)
        for share, level in zip(shares, levels, strict=True):
            ax.annotate(f"{share:.0%}", (share, level), (8, 0), textcoords="offset points", va="center", fontsize=9)
    names = [f"{LOOKS[second].label}\nover {LOOKS[first].label}" for first, second in pairs]
    ax.set(yticks=range(len(pairs)), yticklabels=names, xlim=(-0.03, 1.1), ylim=(-0.6, len(pairs) - 0.4))
    ax.set_xlabel("share of units on which the score prefers the upper name")
    ax.tick_params(axis="y", length=0)
    return ax


def forced_choice_figure(tables: Mapping[str, Sequence[Record]]) -> Figure:
    """`draw_choices` for each corpus, one above the other; titles name the variant that each score likes best."""
    with styled_axes((9.0, 4.3 * len(tables) + 0.4), len(tables)) as (figure, axes):
        for ax, (corpus, rows) in zip(axes, tables.items(), strict=True):
            about = f"{sentence(corpus_words(corpus))}, {rows[0]['n']} units, no people asked"
            draw_choices(ax, rows).set_title(f"{about}:\n{_favourites(rows)}", fontsize=10.5)
            if is_synthetic(corpus):
                mark_synthetic(ax)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def _favourites(rows: Sequence[Record]) -> str:
    """The variant that each judge prefers in most comparisons, in words."""
    votes: dict[str, dict[str, float]] = {}
    for row in rows:
        own = votes.setdefault(row["judge"], {})
        for name, share in ((row["first"], row["share"]), (row["second"], 1.0 - row["share"])):
            own[name] = own.get(name, 0.0) + share
    best = {judge: LOOKS[max(own, key=own.__getitem__)].label for judge, own in votes.items()}
    if len(best) > 1 and len(set(best.values())) == 1:
        return f"both scores like “{next(iter(best.values()))}” best"
    return "\n".join(f"“{judge}” likes “{name}” best" for judge, name in best.items())
