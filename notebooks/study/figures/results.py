"""Results over a corpus: AUC of every score, bar patterns, disturbances, false alarms, levels, answers of raters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.verdict.judge import LEVELS
from study.figures.variants import Look, Records, draw_mean, of_first, rows_by_name
from study.figures.words import corpus_words, sentence
from study.saving import mark_corpus

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


def draw_auc(ax: Axes, rows: pd.DataFrame) -> Axes:
    """AUC of each score on its chance band; only what leaves its band has a colour.

    Parameters
    ----------
    ax : Axes
    rows : DataFrame indexed by score, from below, with "AUC", "chance low" and "chance high", of one corpus
    """
    value, low, high, places = rows["AUC"], rows["chance low"], rows["chance high"], np.arange(len(rows))
    ax.barh(places, high - low, left=low, height=0.7, color=COLOURS["faint"], label="chance band (95 %)")
    states = {
        "hit": ("o", "above its chance band: tells", value > high),
        "chance": ("x", "inside: tells nothing", value.between(low, high)),
        "miss": ("x", "below: prefers late music", value < low),
    }
    for name, (mark, words, chosen) in states.items():
        look: dict[str, Any] = {"color": COLOURS[name], "markersize": 7, "markeredgewidth": 2, "label": words}
        ax.plot(value[chosen], places[chosen], mark, **look)
        for auc, end, place in zip(value[chosen], high[chosen], places[chosen], strict=True):
            text: dict[str, Any] = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": 9}
            ax.annotate(f"{auc:.2f}", (max(auc, end), place), color=COLOURS[name], **text)
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1)
    ax.set(xlim=(0, 1.15), ylim=(-0.6, len(rows) - 0.4), yticks=places)
    for label in ax.set_yticklabels([SCORE_LABELS[score] for score in rows.index]):
        label.set_fontweight("bold" if label.get_text() == SCORE_LABELS[OURS] else "normal")
    ax.tick_params(axis="y", length=0)
    return ax


def auc_figure(table: pd.DataFrame) -> Figure:
    """`draw_auc` for the first corpus, the best score on top; at the right, in how many corpora each score tells.

    Parameters
    ----------
    table : DataFrame with the columns of table08b_auc
    """
    table = table[table["score"].isin(SCORE_LABELS)]
    first = of_first(table, "corpus")
    rows = first.sort_values("AUC", ascending=False, kind="stable")[::-1].set_index("score")
    with styled_axes((9.0, 0.3 * len(rows) + 1.8)) as (figure, (ax,)):
        draw_auc(ax, rows).set_xlabel("AUC: how often the true music scores above late music (0.5: a coin, 1: always)")
        _draw_telling(ax, (table["AUC"] > table["chance high"]).groupby(table["score"]).agg(["sum", "size"]))
        about, finding = auc_words(first)
        ax.set_title(f"Which score tells true from late music? {sentence(finding)}\n{about.rstrip(':')}", fontsize=11)
        mark_corpus(ax, str(first["corpus"].iloc[0]))
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9.5)
    return figure


def _draw_telling(ax: Axes, corpora: pd.DataFrame) -> None:
    """At the right of each row the corpora in which its score lies above chance, and how many there are."""
    text: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center", "fontsize": 9.5}
    words = {label: score for score, label in SCORE_LABELS.items()}
    for place, label in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True):
        tells, every = corpora.loc[words[label.get_text()]]
        ax.text(1.0, place, f"{tells} of {every}", **text)
    ax.set_ylim(top=ax.get_ylim()[1] + 0.7)
    ax.text(1.0, len(ax.get_yticks()), "corpora in which it tells", **text, color=COLOURS["chance"])


def auc_words(rows: pd.DataFrame) -> tuple[str, str]:
    """A corpus of `auc_figure`, and its scores that lie above their chance bands, counted, with ours if it is one."""
    above = list(rows.loc[rows["AUC"] > rows["chance high"], "score"])
    ours = (", ours too" if len(above) > 1 else ", ours") if OURS in above else ""
    about = f"{sentence(corpus_words(rows['corpus'].iloc[0]))} ({rows['windows'].iloc[0]} windows):"
    return about, f"{len(above) or 'none'} of {len(rows)} scores tell{ours} ({rows['beats'].iloc[0]} beats)"


def patterns_figure(table: pd.DataFrame, *, corpus: str) -> Figure:
    """Course of shape speed over the beats of each dance, a panel a dance; an arrow to its fastest moment.

    Parameters
    ----------
    table : DataFrame with the columns "dance", "beat" (from 0, the first of a bar, to the end) and "shape speed"
    corpus : str
    """
    dances = list(table.groupby("dance", sort=False))
    lines = -(-len(dances) // 2)
    with styled_axes((9.0, 2.5 * lines + 0.4), lines, 2, sharey=True) as (figure, axes):
        for ax, (dance, course) in zip(axes, dances, strict=False):
            fastest, beats = _draw_course(ax, course)
            ax.set_title(f"{dance}: fastest {_place_in_bar(fastest, beats)}", pad=26, fontsize=10.5)
        for ax in axes[len(dances) :]:
            ax.set_visible(False)
        for ax in axes[::2]:
            ax.set_ylabel("shape speed (SD)")
        slowest = table.loc[table.groupby("dance")["shape speed"].idxmin(), "beat"]
        any_off_beat = (slowest - slowest.round()).abs().max() > NEAR
        title = f"Dancers do not all stop on the beat ({corpus_words(corpus)})" if any_off_beat else ""
        figure.suptitle(title or corpus_words(corpus), x=0.01, ha="left", fontsize=12)
    return figure


def _draw_course(ax: Axes, course: pd.DataFrame) -> tuple[float, int]:
    """The place of the fastest moment, and the beats of the course just drawn."""
    places, speeds, beats = course["beat"], course["shape speed"], round(course["beat"].max())
    ax.fill_between(places, speeds, 0.0, color=COLOURS["visual"], alpha=0.25, linewidth=0)
    ax.plot(places, speeds, color=COLOURS["visual"], linewidth=2)
    fastest = float(places.iloc[speeds.argmax()])
    ax.annotate(
        "fastest here", (fastest, speeds.max()), (0, 16), textcoords="offset points", ha="center", va="bottom",
        fontsize=9, arrowprops={"arrowstyle": "->", "color": COLOURS["ink"]}, annotation_clip=False,
    )  # fmt: skip
    for beat in range(beats + 1):
        ax.axvline(beat, color=COLOURS["audio"], linewidth=1, alpha=0.6)
    ax.axhline(0, color=COLOURS["chance"], linewidth=0.8, zorder=0)
    ax.set(xticks=range(beats + 1), xticklabels=[*range(1, beats + 1), 1], xlim=(0, beats), xlabel="beat of the cycle")
    return fastest, beats


def _place_in_bar(place: float, beats: int) -> str:
    """A place in words: on a beat, or between two."""
    if abs(place - round(place)) <= NEAR:
        return f"on {round(place) % beats + 1}"
    before = int(place) % beats + 1
    return f"between {before} and {before % beats + 1}"


def picks_figure(table: pd.DataFrame, *, corpus: str) -> Figure:
    """Share of inharmonious clips picked out, one bar a judge, people hatched; its title is the best score.

    Parameters
    ----------
    table : DataFrame with columns "judge", "paper", "harmolab" (shares; one of the two is NaN), "low", "high"
    corpus : str
    """
    with styled_axes((9.0, 3.0)) as (figure, (ax,)):
        places = rows_by_name(ax, list(table["judge"]))
        for judge in table.to_dict("records"):
            human, row = pd.notna(judge["paper"]), places[judge["judge"]]
            value = judge["paper"] if human else judge["harmolab"]
            colour, hatch = (COLOURS["chance"], "//") if human else (SCORE_COLOURS[2], None)
            ax.barh(row, value, color=colour, hatch=hatch, height=0.65, edgecolor="white")
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
            ax.annotate(f"{value:.0%}", (0.02, row), va="center", fontweight="bold", bbox=box)
        ax.hlines([*places.values()], table["low"], table["high"], color=COLOURS["ink"], linewidth=2, gid="interval")
        ax.axvline(0.5, color=COLOURS["ink"], linestyle=":", linewidth=1.5)
        ax.annotate("guessing", (0.5, len(places) - 0.45), ha="center", va="bottom", fontsize=9)
        label = f"share of inharmonious clips picked out (black: 95 % of draws); {corpus_words(corpus)}"
        ax.set(xlim=(0, 1), ylim=(-0.6, len(places) - 0.1), xlabel=label)
        ax.set_title(picks_words(table))
    return figure


def picks_words(table: pd.DataFrame) -> str:
    """The best score of `picks_figure` beside guessing."""
    best = table.iloc[table["harmolab"].argmax()]
    return f"Best score: {best['judge']}, {'' if best['low'] > 0.5 else 'not clearly '}better than guessing"


def disturbances_figure(table: pd.DataFrame, scores: Sequence[str] = JITTER_SCORES) -> Figure:
    """AUC of some scores as one disturbance grows; its title is which score stands the most.

    Parameters
    ----------
    table : DataFrame whose first column is the level (its name is the x label), with one column a score
    scores : names of the columns to draw
    """
    with styled_axes((9.0, 4.0)) as (figure, (ax,)):
        for name, mark, colour in zip(scores, SCORE_MARKS, SCORE_COLOURS, strict=False):
            ax.plot(table.iloc[:, 0], table[name], mark, color=colour, label=SCORE_LABELS.get(name, name))
        ax.axhline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1, label="a coin")
        ax.set(xlabel=table.columns[0], ylabel="AUC: how often the true music wins", ylim=(0.4, 1.02))
        # In the order of the lines at the right end.
        handles = sorted(ax.lines, key=lambda line: -float(np.asarray(line.get_ydata())[-1]))
        ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5))
        ax.set_title(disturbance_words(table, scores))
    return figure


def disturbance_words(table: pd.DataFrame, scores: Sequence[str] = JITTER_SCORES) -> str:
    """The score of `disturbances_figure` that stands the most."""
    last = table[list(scores)].iloc[-1].sort_values(ascending=False)
    best, rest = last.index[0], last.iloc[1:]
    return (
        f"“{SCORE_LABELS.get(best, best)}” stands the most: at the right end AUC {last[best]:.2f}, "
        f"the others {rest.min():.2f} to {rest.max():.2f}"
    )


# The recommended score at work: false alarms, and levels of recordings

NOMINAL, EDGE = 0.05, 0.26
FEWEST_ALARMS = 5  # expected in a row, below which its share says nothing
P_LOOKS: Mapping[str, dict[str, Any]] = {
    "old p": {"marker": "X", "markersize": 8, "color": COLOURS["miss"], "label": "old score, published"},
    "p": {"marker": "o", "markersize": 7, "color": COLOURS["ink"], "label": "H: in time, and where"},
}
# From white to green, so that the order of the levels is seen without colour too.
LEVEL_COLOURS = ("#FFFFFF", "#D9D9D9", "#C7E3D8", "#7FC4AB", COLOURS["hit"])


def nulls_figure(table: pd.DataFrame) -> Figure:
    """Share of clips in which harmony is found where there is none, by the old score and by H: a row a kind of clip.

    Of each kind the longest clips are drawn; the table has the others, and the p-value of "in time?" alone. The title
    is the finding, where there are clips enough for one.

    Parameters
    ----------
    table : DataFrame with the columns of table08f_false_alarms
    """
    longest = table.sort_values("seconds", kind="stable").drop_duplicates("kind", keep="last").sort_index()
    with styled_axes((9.0, 0.34 * len(longest) + 2.0)) as (figure, (ax,)):
        names = longest["kind"] + ", " + longest["seconds"].map("{:g} s".format)
        places = np.array([*rows_by_name(ax, list(names)).values()])
        ax.hlines(places, 0.0, 1.0, color=COLOURS["faint"], linewidth=0.8, zorder=0)
        ax.axvline(NOMINAL, color=COLOURS["chance"], linewidth=1.5, linestyle=":")
        for name, look in P_LOOKS.items():
            ax.plot(longest[f"{name} .05"], places, linestyle="none", **look)
        for place in places[longest["cannot tell"] > 0.5]:
            ax.annotate("too short: not judged", (0.6 * EDGE, place), va="center", fontsize=9, color=COLOURS["chance"])
        words = "share of clips in which harmony is found, p ≤ .05 (dotted: what a fair p-value gives)"
        ax.set(xlim=(-0.01, EDGE), xlabel=words)
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9.5)
        figure.suptitle(
            f"Is harmony found where there is none?\n{alarm_words(table)}", x=0.01, ha="left", fontsize=11.5
        )
    return figure


def alarm_words(table: pd.DataFrame) -> str:
    """The worst row of the old score and of H."""
    if table["n"].min() * NOMINAL < FEWEST_ALARMS:
        return f"{table['n'].min()} clips a row are too few to tell how often"
    old, new = table["old p .05"].max(), table["p .05"].max()
    return f"The old score finds it in up to {old:.0%} of clips, H in up to {new:.0%}"


def levels_figure(table: pd.DataFrame) -> Figure:
    """A bar for each music, cut by level, for each corpus: beats by a program, told only the tempi of the dance.

    Parameters
    ----------
    table : DataFrame with the columns of table08i_levels: corpus, beats, told, and a column a music, each cell the
        numbers of recordings at the levels from 0 on, in one text; empty for a music that the corpus lacks
    """
    ordinary = table[(table["beats"] == "tracked") & ~table["told"]].set_index("corpus").drop(columns=["beats", "told"])
    with styled_axes((9.0, 2.1 * len(ordinary) + 0.6), len(ordinary)) as (figure, axes):
        for ax, (corpus, cells) in zip(axes, ordinary.fillna("").iterrows(), strict=True):
            counts = cells[cells != ""].str.split(expand=True).astype(int)
            _draw_level_counts(ax, counts)
            ax.set_title(f"{sentence(corpus_words(str(corpus)))} at level {_on_top(counts)}")
        # Above: below the canvas is where synthetic data is marked.
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=9)
    return figure


def _draw_level_counts(ax: Axes, counts: pd.DataFrame) -> None:
    """Bars of a row a music, a column a level, with the number of recordings in each piece."""
    for level, words in enumerate(LEVELS):
        left = counts.loc[:, : level - 1].sum(axis=1)
        look: dict[str, Any] = {"color": LEVEL_COLOURS[level], "edgecolor": COLOURS["ink"], "label": f"{level} {words}"}
        bars = ax.barh(counts.index, counts[level], left=left, **look)
        ax.bar_label(bars, [str(count or "") for count in counts[level]], label_type="center", fontsize=11)
    ax.set(xlabel="recordings", xlim=(0, None), ylim=(len(counts) - 0.4, -0.6))
    ax.tick_params(axis="y", length=0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def _on_top(counts: pd.DataFrame) -> str:
    """Recordings that reach the highest level with the first music, and with all others."""
    own, other = counts.iloc[0], counts.iloc[1:].sum()
    first, rest = (f"{each.iloc[-1]} of {each.sum()}" for each in (own, other))
    return f"{len(LEVELS) - 1}: {first} with {own.name} music, {rest} with other music"


# Listening studies: share of right answers of each rater; simulated raters are named as such


def study_title(title: str, rows: Sequence[Mapping[Any, Any]]) -> str:
    """The title of a table or figure made from `rows`, which says "simulated" if any rater was.

    >>> study_title("Right answers", [{"rate": 0.8, "simulated": True}])
    'Right answers (simulated raters, no people)'

    Raises
    ------
    ValueError
        If there are no rows, or one does not say whether its raters were simulated.
    """
    if not rows or not all(isinstance(row.get("simulated"), bool) for row in rows):
        raise ValueError('every row of a listening study must say "simulated": True or False')
    if any(row["simulated"] for row in rows):
        return f"{title} (simulated raters, no people)"
    return title


def rates_figure(raters: Records, *, label: str, title: str) -> Figure:
    """A share with its interval for each row: a filled dot if the interval leaves out guessing, else an open one.

    Parameters
    ----------
    raters : table, or its records, with "rate", "low", "high", "n", "simulated", and "rater" or "version" as the name
    label : str, name of the share
    title : str; `study_title` is added
    """
    rows = pd.DataFrame(raters).to_dict("records")
    title = study_title(title, rows)
    with styled_axes((8.0, 1.4 + 0.35 * len(rows))) as (figure, (ax,)):
        places = rows_by_name(ax, [str(row.get("rater", row.get("version"))) for row in rows])
        for row, place in zip(rows, places.values(), strict=True):
            look = Look("", COLOURS["ink"], "o", filled=row["low"] > 0.5 or row["high"] < 0.5)
            draw_mean(ax, {**row, "mean": row["rate"]}, place, look, width=1.5)
            text, at = f"{row['rate']:.0%} of {row['n']}", (1.02, place)
            ax.annotate(text, at, xycoords=("axes fraction", "data"), va="center", color=COLOURS["ink"])
        ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
        ax.set(xlim=(-0.02, 1.02), xlabel=f"{label} (dotted: by guessing; lines: 95 % intervals)")
        ax.set_title(title)
        if any(row["simulated"] for row in rows):
            ax.text(
                0.25, 0.5, "simulated: no people", transform=ax.transAxes, ha="center", va="center", rotation=12,
                fontsize=22, fontweight="bold", color=COLOURS["faint"], zorder=0, gid="watermark",
            )  # fmt: skip
    return figure
