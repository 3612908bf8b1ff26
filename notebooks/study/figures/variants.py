"""Generators, tricks and systems in charts by rows: a mark at each mean, a line over its 95 % interval (Figs. 9 to 13).

Colour and mark name a generator's losses; hollow is without the harmony term. Every figure is of one table; `draw_...`
functions draw a measure of the rows of one corpus, and those that return words return the title.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.words import corpus_words, is_synthetic, listed, sentence
from study.saving import mark_corpus

Records = pd.DataFrame | Sequence[Mapping[str, Any]]  # a table, or its rows


@dataclass(frozen=True)
class Look:
    """Colour and mark of one kind of motion, and its name in words."""

    label: str
    colour: str
    marker: str
    filled: bool

    @property
    def mark(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot` for a single mark."""
        face = self.colour if self.filled else "white"
        colours = {"color": self.colour, "markerfacecolor": face, "markeredgewidth": 1.8}
        return {"linestyle": "none", "marker": self.marker, "markersize": 8, **colours}


# Neither colour means anything in `COLOURS`; they differ in lightness and in shape of the mark too.
_PAPER, _OURS = "#8C6D31", "#6A3D9A"
RIVAL, CHOREOGRAPHER = "#56809E", "#3F7F5F"  # of systems that are no generators of ours

LOOKS: Mapping[str, Look] = {
    "paper, without": Look("paper's losses, no harmony", _PAPER, "s", False),
    "paper": Look("paper's losses + harmony", _PAPER, "s", True),
    "recommended, without": Look("our losses, no harmony", _OURS, "o", False),
    "recommended": Look("our losses + harmony", _OURS, "o", True),
    "recorded": Look("recorded motion", COLOURS["ink"], "D", True),
}
_DOT: Mapping[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 8, "color": COLOURS["ink"]}


def rows_by_name(ax: Axes, names: Sequence[str], labels: Mapping[str, str] | None = None) -> dict[str, int]:
    """name -> height of its row on the y axis, the first on top; labelled by `labels`, else by `LOOKS`, else itself."""
    words = {name: look.label for name, look in LOOKS.items()} | dict(labels or {})
    ax.set(yticks=range(len(names)), yticklabels=[words.get(name, name) for name in reversed(names)])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.tick_params(axis="y", length=0)
    return {name: len(names) - 1 - row for row, name in enumerate(names)}


def draw_mean(
    ax: Axes, row: Any, place: float, look: Look, *, width: float = 2.2, number: str = "", up: float = 7, **mark: Any
) -> None:
    """A mark at the mean of a record with "mean", "low" and "high", and a line over its interval if it has one.

    A mean that is not finite has no mark. `number` stands `up` points above the mark, below it where
    that is negative. `mark` changes the look of the mark.
    """
    if np.isfinite(row["low"]):
        ax.plot([row["low"], row["high"]], [place, place], color=look.colour, linewidth=width, zorder=2, gid="interval")
    if np.isfinite(row["mean"]):
        ax.plot(row["mean"], place, zorder=4, **look.mark | mark)
    if number:
        text: dict[str, Any] = {"ha": "center", "va": "bottom" if up > 0 else "top", "fontsize": 9}
        ax.annotate(number, (row["mean"], place), (0, up), textcoords="offset points", color=look.colour, **text)


def draw_arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    """A pale arrow from mark to mark."""
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": colour, "alpha": 0.5, "shrinkA": 5, "shrinkB": 5}
    ax.annotate("", end, start, arrowprops=arrow, zorder=2)


def of_measure(table: pd.DataFrame, measure: str | None, name: str = "variant") -> pd.DataFrame:
    """The rows of one measure, by their name."""
    return table[table["measure"] == measure].set_index(name)


def ends(table: pd.DataFrame) -> tuple[float, float]:
    """Least and greatest of means and ends of intervals."""
    values = table[["mean", "low", "high"]].to_numpy(np.float64)
    return float(np.nanmin(values)), float(np.nanmax(values))


def panels_figure(
    table: pd.DataFrame,
    draw: Callable[[Axes, pd.DataFrame, str], str],
    measures: Sequence[str],
    handles: Sequence[Artist] = (),
    *,
    height: float,
    more: float = 0.6,
    by: Sequence[str] = ("corpus",),
    loc: Any = "outside upper center",
    ncols: int = 3,
    **grid: Any,
) -> Figure:
    """A row of panels for each corpus of a table, a panel a measure, marked where it is synthetic; a legend above.

    Parameters
    ----------
    table : with the columns of `by`
    draw : function that draws a measure of the rows of one corpus, and returns the panel's title
    measures : from left to right
    handles : of the legend; those of the first panel when left out
    height, more : inches, of the panels of a corpus, and of the figure besides
    by : columns whose values make a row of panels
    loc, ncols : of the legend
    grid : as for ``subplots``
    """
    parts = {" ".join(map(str, names)): part for names, part in table.groupby(list(by), sort=False)}
    size = (9.0, height * len(parts) + more)
    with styled_axes(size, len(parts), len(measures), **grid) as (figure, axes):
        for ax, (part, measure) in zip(axes, product(parts.values(), measures), strict=True):
            ax.set_title(draw(ax, part, measure), fontsize=10.5)
        for ax, names in zip(axes[len(measures) - 1 :: len(measures)], parts, strict=True):
            # A picture of one corpus is marked by that alone: `save_figure` goes by all that its table has.
            if is_synthetic(names) or len(parts) == 1:
                mark_corpus(ax, names)
        entries = handles or axes[0].get_legend_handles_labels()[0]
        figure.legend(handles=entries, loc=loc, ncols=ncols)
    return figure


def of_first(table: pd.DataFrame, *columns: str) -> pd.DataFrame:
    """The rows that have in these columns what the first row has: a picture shows one case, its table all."""
    first = table.iloc[0]
    return table[np.logical_and.reduce([table[column] == first[column] for column in columns])]


def corpus_of(part: pd.DataFrame) -> str:
    """The corpus of some rows in words."""
    return corpus_words(part["corpus"].iloc[0])


# Distances of dances to recordings beside those between recordings (Fig. 9)

DISTANCES: Mapping[str, str] = {"fid": "distance of poses", "fid_kinetic": "distance of joint speeds"}  # Frechet
# Recorded motion against recorded motion: name -> label.
_REFERENCES = {
    "recorded, other figures": "recorded dance, other figures",
    "recorded, halves": "recorded dance, two halves",
}
_REFERENCE = Look("", COLOURS["chance"], "D", filled=True)
WIDE = 100.0  # a distance above which the axis goes by powers of ten: one training lies far off
SEEDS = "^seed "  # columns that hold the value of one training each


def draw_distances(ax: Axes, rows: pd.DataFrame, measure: str) -> str:
    """A row a variant: a mark at the mean with its number, its interval, a dot for each training.

    The axis holds every interval whole: a distance with its bias taken off may be below 0. The title names the
    generator that comes nearest to recordings.

    Parameters
    ----------
    ax : Axes
    rows : with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus; what they have
        under "seed 1", "seed 2", ... are the values of single trainings
    measure : name in `DISTANCES`
    """
    table = of_measure(rows, measure)
    places = rows_by_name(ax, [name for name in (*LOOKS, *_REFERENCES) if name in table.index], _REFERENCES)
    for name, place in places.items():
        row, look = table.loc[name], LOOKS.get(name, _REFERENCE)
        draw_mean(ax, row, place, look, number=f"{round(row['mean'], 1) + 0.0:.1f}", up=-7)  # never -0.0
        seeds = row.filter(regex=SEEDS).to_numpy(np.float64)
        ax.plot(seeds, np.full(seeds.size, place + 0.22), ".", color=look.colour, markersize=6, gid="seed")
    ax.axvline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    ax.set_xscale("symlog", linthresh=WIDE)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set(xlabel=f"Fréchet {DISTANCES[measure]} to recorded dance (0: the same)", ylim=(-0.8, len(places) - 0.5))
    ax.hlines([*places.values()], *ax.get_xlim(), color=COLOURS["faint"], linewidth=0.8, zorder=0)
    nearest = _nearest(table[table.index.isin([*LOOKS])])
    return f"Who moves most like recorded dance? {nearest}\n({corpus_of(table)})"


def _nearest(table: pd.DataFrame) -> str:
    """The variant of the least mean, and whether the interval of another one reaches into its own."""
    name = str(table["mean"].idxmin())
    clearly = "" if (table["low"].drop(name) > table.loc[name, "high"]).all() else ", not clearly"
    return f"Nearest{clearly}: “{LOOKS[name].label}”"


def distances_figure(table: pd.DataFrame) -> Figure:
    """`draw_distances` of speeds for the first corpus of the table of notebook 08, which has the others.

    Not of poses: these are measured by a pose network that the paper's loss trains on, so they favour it.
    """
    handles = [
        Line2D([], [], **_REFERENCE.mark, label="recorded beside recorded dance"),
        Line2D([], [], color=COLOURS["ink"], linewidth=2.2, label="95 % interval"),
        Line2D([], [], linestyle="none", marker=".", color=COLOURS["ink"], label="one training"),
    ]
    return panels_figure(of_first(table, "corpus"), draw_distances, ["fid_kinetic"], handles, height=3.3, more=0.5)


# Gain and cost of a harmony loss (Fig. 11): measures by loss, and harmony against its price

RECORDED = "recorded"
WEIGHTED = "recommended"  # the loss whose weight the trade-off varies
LOSSES: Mapping[str, str] = {"paper": "paper's losses", "recommended": "our losses"}
_OWNERS: Mapping[str, str] = {"paper": "the paper's", "recommended": "our"}
APART = 0.15  # rows, of a mark from the middle of its row: without the harmony term above, with it below
MEASURES = ("paper_harmony", "paper_hit_rate", "above_chance", "count_ratio", "jerk", "fid")  # of the ablation's table
# Of the picture, with the name of the axis and of the subject; the table has them all.
SHOWN: Mapping[str, tuple[str, str]] = {
    "above_chance": ("0: as many beats as chance meets; 1: every music beat", "Harmony above chance, {}"),
    "fid": ("0: the same; by the paper's network", "FID to recorded dance"),
}
PRICES: Mapping[str, str] = {"jerk": "jerk (m/s³)", "fid": "distance to recorded dance (FID) by the paper's network"}


def draw_measure(ax: Axes, rows: pd.DataFrame, measure: str) -> None:
    """One measure, a row for each loss: hollow without its harmony term, an arrow to the mark with it, intervals.

    Parameters
    ----------
    ax : Axes
    rows : with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus; recorded motion has
        a row of its own where its mean is finite
    measure : name in `SHOWN`
    """
    table = of_measure(rows, measure).dropna(subset="mean")
    places = rows_by_name(ax, [name for name in (*LOSSES, RECORDED) if name in table.index], LOSSES)
    for loss, place in places.items():
        pair = {f"{loss}, without": place + APART, loss: place - APART} if loss != RECORDED else {loss: place}
        for name, height in pair.items():
            mean, up = float(table["mean"][name]), 7 if height > place else -7
            number = f"{mean:.1f}" if abs(mean) >= 2 else f"{mean:.2f}"
            draw_mean(ax, table.loc[name], height, LOOKS[name], width=2, number=number, up=up)
        if loss != RECORDED:
            start, end = ((float(table["mean"][name]), height) for name, height in pair.items())
            draw_arrow(ax, start, end, LOOKS[loss].colour)
    low, high = ends(table)
    ax.set(xlim=(0.0, 1.08 * high), xlabel=SHOWN[measure][0])
    if measure == "above_chance":
        ax.set_xlim(min(-0.1, low - 0.05), max(1.05, high + 0.05))
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)


def ablation_figure(table: pd.DataFrame, gains: pd.DataFrame) -> Figure:
    """Harmony above chance and FID, a row of panels for each corpus; titles say which loss changes which.

    Parameters
    ----------
    table : of `study.experiments.judging.seed_means` for `SHOWN` at least
    gains : of `gains` in notebook 09 for the same measures
    """

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> str:
        draw_measure(ax, part, measure)
        changes = gains[(gains["corpus"] == part["corpus"].iloc[0]) & (gains["measure"] == measure)]
        return f"{SHOWN[measure][1].format(corpus_of(part))}:\n{_change_words(changes.set_index('loss'))}"

    handles = [
        Line2D([], [], **_DOT, markerfacecolor="white", label="without the harmony term"),
        Line2D([], [], **_DOT, label="with it"),
        Line2D([], [], **LOOKS[RECORDED].mark, label="recorded dance"),
    ]
    if (seeds := table["seeds"].max()) > 1:
        handles.append(Line2D([], [], color=COLOURS["chance"], linewidth=2, label=f"95 % interval, {seeds} trainings"))
    return panels_figure(table, draw, [*SHOWN], handles, height=2.9, ncols=4, gridspec_kw={"wspace": 0.08})


def _change_words(gains: pd.DataFrame) -> str:
    """The losses whose harmony term changes a measure by more than the interval of the change, in words."""
    sure = gains[~gains["low"].le(0.0) | ~gains["high"].ge(0.0)]
    verbs = {str(loss): "raises" if change > 0.0 else "lowers" for loss, change in sure["change"].items()}
    if not verbs:
        return "neither clearly changes it"
    if len(verbs) == len(LOSSES) and len(set(verbs.values())) == 1:
        return f"both harmony terms {verbs['paper'].removesuffix('s')} it"
    only = "only " if len(verbs) < len(LOSSES) else ""
    return only + ", ".join(f"{_OWNERS[loss]} harmony term {verb} it" for loss, verb in verbs.items())


def draw_trade_off(ax: Axes, rows: pd.DataFrame, sweep: pd.DataFrame, measure: str) -> None:
    """Harmony above chance against its price: a mark for each variant with its intervals both ways.

    Parameters
    ----------
    ax : Axes
    rows : with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    sweep : with "harmony_weight", "above_chance" and the measure: small marks, each a single training of our losses,
        the larger the greater its weight; none for FID, whose unit is another in each training
    measure : name in `PRICES`, on the x axis
    """
    heights, prices = (of_measure(rows, name) for name in ("above_chance", measure))
    for name, price in prices.dropna(subset="mean").iterrows():  # recorded dance has no distance from itself
        height, look = heights.loc[str(name)], LOOKS[str(name)]
        line: dict[str, Any] = {"color": look.colour, "linewidth": 1.4, "alpha": 0.6, "zorder": 2, "gid": "interval"}
        if np.isfinite(price["low"]):
            ax.plot([max(price["low"], 0.0), price["high"]], [height["mean"]] * 2, **line)
        if np.isfinite(height["low"]):
            ax.plot([price["mean"]] * 2, [height["low"], height["high"]], **line)
        ax.plot(price["mean"], height["mean"], **look.mark, zorder=4)
    ordered = sweep.sort_values("harmony_weight") if measure != "fid" else sweep[:0]
    dot: dict[str, Any] = {"color": LOOKS[WEIGHTED].colour, "markeredgecolor": "white", "zorder": 3, "gid": "sweep"}
    for rank, place in enumerate(ordered[[measure, "above_chance"]].to_numpy(np.float64)):
        ax.plot(*place, "o", markersize=4 + 1.2 * rank, **dot)
    ax.axhline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    ax.set_xlabel(PRICES[measure])
    ax.set_xlim(left=0.0)


def trade_off_figure(table: pd.DataFrame, sweep: pd.DataFrame) -> Figure:
    """`draw_trade_off` against jerk and FID, a row of panels for each corpus; titles say what our harmony term changes.

    Parameters
    ----------
    table : of `study.experiments.judging.seed_means` for harmony above chance, jerk and FID at least
    sweep : of the sweep of notebook 09
    """

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> str:
        draw_trade_off(ax, part, sweep[sweep["corpus"] == part["corpus"].iloc[0]], measure)
        means = part.set_index(["measure", "variant"])["mean"]
        harmony, price = (means[name][[f"{WEIGHTED}, without", WEIGHTED]] for name in ("above_chance", measure))
        if measure == "fid":
            return "FID {:.1f} → {:.1f}".format(*price)
        ax.set_ylabel("harmony above chance")
        change = "harmony {:.2f} → {:.2f}, jerk {:.0f} → {:.0f}".format(*harmony, *price)
        return f"{sentence(corpus_of(part))}, our harmony term:\n{change}"

    handles = [Line2D([], [], **look.mark, label=look.label) for look in LOOKS.values()]
    weights = " < ".join(f"{weight:g}" for weight in sorted(set(sweep["harmony_weight"])))
    dot = {**_DOT, "markersize": 4, "color": LOOKS[WEIGHTED].colour}
    handles.append(Line2D([], [], **dot, label=f"one training, weight {weights}"))
    return panels_figure(table, draw, [*PRICES], handles, height=3.4, more=0.7, sharey="row")


# Tricks that raise a score: each with its own music and with music half a beat late (Sec. 6)

CHEAT_MEASURES = (*MEASURES[:3], "paper_count_ratio", "jerk")  # of the table of tricks
# The two scores of the picture, with the names of their axes and of their subjects.
SIDES: Mapping[str, tuple[str, str]] = {
    "paper_hit_rate": ("share of music beats met within 0.25 s", "Paper's hit rate, {}"),
    "above_chance": ("0: as many as chance meets; 1: every beat", "Harmony above chance"),
}
CHANCE: Mapping[str, str] = {"paper_hit_rate": "paper_chance"}  # measure -> the level that chance reaches in it
TRUE = "true"
UNTOUCHED = "as danced"
_LATE: Mapping[str, Any] = {"markersize": 5.5, "markeredgewidth": 1.2}


def both_musics(rows: pd.DataFrame, measure: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of a measure by trick, with the true music and with late music."""
    table = of_measure(rows, measure, "trick")
    return table[table["music"] == TRUE], table[table["music"] != TRUE]


def draw_dumbbells(ax: Axes, rows: pd.DataFrame, measure: str) -> None:
    """One score of every trick: a full mark with the true music, an arrow to a hollow dot, with it half a beat late.

    Parameters
    ----------
    ax : Axes
    rows : with "trick", "music" ("true", or anything else), "measure", "mean", "low" and "high", of one corpus
    measure : name in `SIDES`; where chance has a level, `rows` may hold that measure too: a grey bar
    """
    true, late = both_musics(rows, measure)
    places = rows_by_name(ax, list(true.index))
    for trick, place in places.items():
        # A generator keeps its colour and mark; all hollow marks are late music.
        look = replace(LOOKS.get(trick, Look(trick, COLOURS["ink"], "o", True)), filled=True)
        hollow = replace(look, marker="o", filled=False)
        draw_arrow(ax, (true["mean"][trick], place), (late["mean"][trick], place - 0.24), look.colour)
        draw_mean(ax, late.loc[trick], place - 0.24, hollow, width=0.9, gid="late", **_LATE)
        draw_mean(ax, true.loc[trick], place, look, width=0.9)
    for name, mean in of_measure(rows, CHANCE.get(measure), "trick")["mean"].groupby("trick").last().items():
        height = places[str(name)] + np.array([-0.38, 0.38])
        ax.plot([mean, mean], height, color=COLOURS["chance"], linewidth=4, zorder=1)
    low, high = ends(pd.concat([true, late]))
    ax.set(xlim=(0.0, 1.08), xlabel=SIDES[measure][0])
    if measure == "above_chance":
        ax.set_xlim(min(-1.0, low - 0.05), max(1.0, high + 0.05))
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=4, zorder=1)
    ax.xaxis.set_major_locator(MultipleLocator(0.5 if measure == "above_chance" else 0.2))
    ax.hlines([*places.values()], *ax.get_xlim(), color=COLOURS["faint"], linewidth=0.8, zorder=0)


def tricks_beaten(true: pd.DataFrame, late: pd.DataFrame) -> str:
    """Tricks that beat the dance they were put on, counted."""
    tricks = true["mean"].drop(UNTOUCHED)
    return f"{(tricks > true.loc[UNTOUCHED, 'mean']).sum() or 'none'} of {len(tricks)}"


def who_falls(true: pd.DataFrame, late: pd.DataFrame) -> str:
    """Who loses clearly when the music is late."""
    falls = true["low"].fillna(true["mean"]) > late["high"].fillna(late["mean"])
    names = [LOOKS[str(name)].label for name in true.index[falls]]
    who = (listed(names) or "nobody") if len(names) < len(true) else f"all {len(names)}"
    return fill(f"with late music it falls for {who}", 42)


def tricks_figure(table: pd.DataFrame) -> Figure:
    """`draw_dumbbells` of the paper's hit rate for the first corpus; what is above chance stands at the right.

    Parameters
    ----------
    table : of `study.experiments.judging.trick_means` for `SIDES` and "paper_chance"
    """

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> str:
        draw_dumbbells(ax, part, measure)
        ax.set_xlabel(f"{ax.get_xlabel()} ({part['n'].iloc[0]} clips, {corpus_of(part)})")
        ax.set_ylim(top=ax.get_ylim()[1] + 0.8)
        _draw_column(ax, both_musics(part, "above_chance")[0]["mean"], "above\nchance")
        rate, above = (tricks_beaten(*both_musics(part, name)) for name in SIDES)
        return f"Do tricks please the score? {rate} raise the paper's hit rate, {above} harmony above chance"

    return panels_figure(of_first(table, "corpus"), draw, ["paper_hit_rate"], _music_handles(), height=3.6, more=0.5)


def _draw_column(ax: Axes, values: pd.Series, heading: str) -> None:
    """Numbers at the right of the rows of `rows_by_name`, the first on top, and words above them."""
    text: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center", "fontsize": 9.5}
    for place, value in enumerate(reversed(values.to_list())):
        ax.text(1.12, place, f"{value:+.2f}", **text)
    ax.text(1.12, len(values) - 0.25, heading, **text | {"va": "center", "color": COLOURS["chance"]})


def _music_handles() -> list[Artist]:
    """Legend of `draw_dumbbells`."""
    return [
        Line2D([], [], **_DOT, label="true music"),
        Line2D([], [], **{**_DOT, **_LATE}, markerfacecolor="white", label="the same music half a beat late"),
        Line2D([], [], color=COLOURS["chance"], linewidth=4, label="what as many beats meet by chance"),
    ]


def listening_figure(table: pd.DataFrame) -> Figure:
    """`draw_dumbbells` of generators, both scores side by side; titles name who loses clearly when music is late.

    Parameters
    ----------
    table : of `study.experiments.judging.trick_means` for `SIDES` and "paper_chance"
    """

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> str:
        draw_dumbbells(ax, part, measure)
        if measure == "paper_hit_rate":
            ax.set_xlabel(f"{ax.get_xlabel()} ({part['n'].iloc[0]} units)")
        return f"{SIDES[measure][1].format(corpus_of(part))}:\n{who_falls(*both_musics(part, measure))}"

    height = 0.42 * table.groupby("corpus")["trick"].nunique().max() + 1.2
    return panels_figure(table, draw, [*SIDES], _music_handles(), height=height, sharey="row")


# Which of two dances a score prefers (in place of Fig. 13)

JUDGES: Mapping[str, tuple[str, str]] = {"paper's harmony": ("^", "#56B4E9"), "above chance": ("s", "#CC79A7")}


def draw_choices(ax: Axes, table: pd.DataFrame) -> None:
    """Share of units on which each score prefers one variant over another, a row a pair; the grey band is a coin's.

    Parameters
    ----------
    ax : Axes
    table : with "first", "second", "judge", "share" (of units on which the judge prefers the first), "n"
    """
    pairs = zip(table["first"], table["second"], strict=True)
    names = [f"{LOOKS[second].label}\nover {LOOKS[first].label}" for first, second in pairs]
    places = rows_by_name(ax, list(dict.fromkeys(names)))
    half = 0.98 / np.sqrt(table["n"].max())
    ax.axvspan(0.5 - half, 0.5 + half, color=COLOURS["faint"], zorder=0, label="a coin, 95 % of the time")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.hlines([*places.values()], 0.0, 1.0, color=COLOURS["faint"], linewidth=1, zorder=1)
    table = table.assign(height=[places[name] for name in names], share=1.0 - table["share"])
    for up, (judge, (marker, colour)) in zip((0.18, -0.18), JUDGES.items(), strict=True):
        shares = np.add(table.loc[table["judge"] == judge, ["share", "height"]].to_numpy(np.float64), (0.0, up))
        ax.plot(*shares.T, marker, linestyle="none", markersize=9, color=colour, label=judge, zorder=3)
        for share in shares:
            ax.annotate(f"{share[0]:.0%}", tuple(share), (8, 0), textcoords="offset points", va="center", fontsize=9)
    ax.set(xlim=(-0.03, 1.1), xlabel="share of units on which the score prefers the upper name")


def favourites(table: pd.DataFrame) -> dict[str, str]:
    """Judge -> name of the variant that it prefers in most comparisons; rows as for `draw_choices`."""
    turned = table.assign(first=table["second"], share=1.0 - table["share"])
    votes = pd.concat([table, turned]).groupby(["judge", "first"], sort=False)["share"].sum()
    return {judge: LOOKS[name].label for judge, name in votes.groupby("judge", sort=False).idxmax()}


def forced_choice_figure(table: pd.DataFrame) -> Figure:
    """`draw_choices` for each corpus, one above the other; titles name the variant that each score likes best."""

    def draw(ax: Axes, part: pd.DataFrame, _: str) -> str:
        draw_choices(ax, part)
        best = favourites(part)
        words = "\n".join(f"“{judge}” likes “{name}” best" for judge, name in best.items())
        if len(best) > 1 and len(set(best.values())) == 1:
            words = f"both scores like “{next(iter(best.values()))}” best"
        return f"{sentence(corpus_of(part))}, {part['n'].iloc[0]} units, no people asked:\n{words}"

    return panels_figure(table, draw, ["share"], height=4.3, more=0.4)


# Systems compared (Fig. 12): the paper's hit rate of each beyond what as many beats meet by chance

COLOURED: Mapping[str, str] = {
    "HarmoGAN without L_harmo": _PAPER,
    "HarmoGAN": _PAPER,
    "HarmoGAN, recommended loss": _OURS,
}
NO_SYSTEM = ("recorded", "pieces")  # kinds of dances that need no training


def draw_compared(ax: Axes, table: pd.DataFrame) -> None:
    """Share of music beats met beyond chance: a mark a system with its interval, below in grey what needs no training.

    Parameters
    ----------
    ax : Axes
    table : Table 12 (notebook 10), of one contest; kind says where a mark stands
    """
    cheap = table["kind"].isin(NO_SYSTEM)
    table = pd.concat([table[~cheap], table[cheap]]).set_index("system")
    places = rows_by_name(ax, [*table.index])
    gained = table[["hit_rate", "hit_rate low", "hit_rate high"]].sub(table["hit_rate chance"], axis=0) * 100
    gained.columns = ["mean", "low", "high"]
    for system, place in places.items():
        kind, row = table["kind"][system], gained.loc[system]
        usual = CHOREOGRAPHER if kind == "choreographer" else RIVAL
        colour = COLOURS["chance"] if kind in NO_SYSTEM else COLOURED.get(system, usual)
        draw_mean(ax, row, place, Look(system, colour, "D" if kind in NO_SYSTEM else "o", bool(row["low"] > 0.0)))
        if not np.isfinite(row["mean"]):
            words = str(table["remark"][system]).partition(":")[0]
            ax.text(0.0, place, f"  {words}", va="center", fontsize=9, color=COLOURS["chance"])
    ax.axvline(0.0, color=COLOURS["miss"], linewidth=2.0, zorder=1)
    ax.axhline(cheap.sum() - 0.5, color=COLOURS["faint"], linewidth=1)
    ax.set_xlabel("music beats met within 0.25 s, beyond what as many beats meet by chance (percentage points)")


def compared_words(part: pd.DataFrame) -> str:
    """Systems of a contest, counted, whose hit rate lies above chance with its whole interval."""
    tried = part[~part["kind"].isin(NO_SYSTEM)].dropna(subset="hit_rate low")
    above = (tried["hit_rate low"] > tried["hit_rate chance"]).sum()
    return f"{above or 'none'} of {len(tried)} with an interval"


def comparison_figure(table: pd.DataFrame) -> Figure:
    """`draw_compared` for one contest of Table 12 (notebook 10): to recorded songs if there are any.

    The title counts by the hit rate, which is the paper's measure, and no system was trained for it. The other
    contests and measures, and the paper's numbers, are in the table.
    """

    def draw(ax: Axes, part: pd.DataFrame, _: str) -> str:
        draw_compared(ax, part)
        about = f"{sentence(part['music'].iloc[0])}; trained on {corpus_of(part)}"
        return f"Does a system meet more beats than chance? {sentence(compared_words(part))}\n{about}"

    handles = [
        Line2D([], [], **_DOT, label="above chance with all its interval"),
        Line2D([], [], **_DOT, markerfacecolor="white", label="not above, or no interval"),
        Line2D([], [], **{**_DOT, "marker": "D", "color": COLOURS["chance"]}, label="no training needed"),
        Line2D([], [], color=COLOURS["miss"], linewidth=2.0, label="chance"),
    ]
    recorded = table[~table["music"].map(is_synthetic)]
    shown = of_first(recorded if len(recorded) else table, "music", "corpus")
    size = {"height": 0.27 * len(shown) + 0.8, "more": 0.5}
    return panels_figure(shown, draw, ["hit_rate"], handles, by=["music", "corpus"], ncols=4, **size)
