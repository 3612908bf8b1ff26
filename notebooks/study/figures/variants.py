"""Generators, tricks and systems in charts by rows: a mark at each mean, a line over its 95 % interval (Figs. 9 to 13).

Colour and mark name a generator's losses; hollow is without the harmony term. Tables may also be lists of records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from harmolab.lab.figures.style import COLOURS, styled_axes
from study.figures.words import corpus_words, is_synthetic, listed, sentence
from study.saving import mark_synthetic

Record = Mapping[str, Any]
Table = Any  # a DataFrame, or an iterable of records


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
        return {
            "linestyle": "none",
            "marker": self.marker,
            "markersize": 8,
            "color": self.colour,
            "markerfacecolor": self.colour if self.filled else "white",
            "markeredgewidth": 1.8,
        }


# Neither colour means anything in `COLOURS`; they differ in lightness and in shape of the mark too.
_PAPER, _OURS = "#8C6D31", "#6A3D9A"
RIVAL, CHOREOGRAPHER = "#56809E", "#3F7F5F"  # of systems that are no generators of ours

LOOKS = MappingProxyType(
    {
        "paper, without": Look("paper's losses, no harmony", _PAPER, "s", False),
        "paper": Look("paper's losses + harmony", _PAPER, "s", True),
        "recommended, without": Look("our losses, no harmony", _OURS, "o", False),
        "recommended": Look("our losses + harmony", _OURS, "o", True),
        "recorded": Look("recorded motion", COLOURS["ink"], "D", True),
    }
)


def rows_by_name(ax: Axes, names: Sequence[str], labels: Mapping[str, str] | None = None) -> dict[str, int]:
    """name -> height of its row on the y axis, the first on top; labelled by `labels`, else by `LOOKS`, else itself."""
    words = {name: look.label for name, look in LOOKS.items()} | dict(labels or {})
    ax.set(yticks=range(len(names)), yticklabels=[words.get(name, name) for name in reversed(names)])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.tick_params(axis="y", length=0)
    return {name: len(names) - 1 - row for row, name in enumerate(names)}


def draw_mean(
    ax: Axes, row: Any, place: float, look: Look, *, width: float = 2.2, number: str = "", up: float = 7
) -> None:
    """A mark at the mean of a record with "mean", "low" and "high", and a line over its interval if it has one.

    A mean that is not finite has no mark; `number` stands `up` points above the mark.
    """
    if np.isfinite(row["low"]):
        ax.plot([row["low"], row["high"]], [place, place], color=look.colour, linewidth=width, zorder=2, gid="interval")
    if np.isfinite(row["mean"]):
        ax.plot(row["mean"], place, **look.mark, zorder=4)
    if number:
        draw_number(ax, number, (row["mean"], place), look.colour, up)


def draw_number(ax: Axes, number: str, place: tuple[float, float], colour: str, up: float = 7) -> None:
    """Words so many points above a place, below it where `up` is negative."""
    side: dict[str, Any] = {"ha": "center", "va": "bottom" if up > 0 else "top"}
    ax.annotate(number, place, (0, up), textcoords="offset points", fontsize=9, color=colour, **side)


def of_measure(rows: Table, measure: str | None, name: str = "variant") -> pd.DataFrame:
    """The rows of one measure, by their name."""
    table = pd.DataFrame(rows)
    return table[table["measure"] == measure].set_index(name)


def ends(table: pd.DataFrame) -> tuple[float, float]:
    """Least and greatest of means and ends of intervals."""
    values = table[["mean", "low", "high"]].to_numpy(np.float64)
    return float(np.nanmin(values)), float(np.nanmax(values))


def corpus_figure(
    rows: Table,
    panels: Sequence[Callable[[Axes, pd.DataFrame], object]],
    handles: Sequence[Artist] | None = None,
    *,
    height: float,
    more: float = 0.6,
    ncols: int = 3,
    **grid: Any,
) -> Figure:
    """A row of panels for each corpus of a table, marked where it is synthetic, and a legend above.

    Parameters
    ----------
    rows : with the column corpus
    panels : functions that draw the rows of one corpus and set the title, from left to right
    handles : of the legend; those of the first panel when left out
    height, more : inches, of a row of panels, and of the figure besides
    ncols : of the legend
    grid : as for ``subplots``
    """
    corpora = pd.DataFrame(rows).groupby("corpus", sort=False)
    with styled_axes((9.0, height * len(corpora) + more), len(corpora), len(panels), **grid) as (figure, axes):
        for line, (corpus, part) in enumerate(corpora):
            own = axes[line * len(panels) : (line + 1) * len(panels)]
            for ax, draw in zip(own, panels, strict=True):
                draw(ax, part)
            if is_synthetic(str(corpus)):
                mark_synthetic(own[-1])
        entries = handles or axes[0].get_legend_handles_labels()[0]
        figure.legend(handles=entries, loc="outside upper center", ncols=ncols)
    return figure


def corpus_of(part: pd.DataFrame) -> str:
    """The corpus of some rows in words."""
    return corpus_words(part["corpus"].iloc[0])


# Distances of dances to recordings beside those between recordings (Fig. 9)

DISTANCES = MappingProxyType({"fid": "distance of poses", "fid_kinetic": "distance of speeds"})  # Frechet
# Recorded motion against recorded motion: name -> label.
_REFERENCES = {
    "recorded, other figures": "recorded dance, other figures",
    "recorded, halves": "recorded dance, two halves",
}
_REFERENCE = Look("", COLOURS["chance"], "D", filled=True)
SEEDS = "^seed "  # columns that hold the value of one training each


def draw_distances(ax: Axes, rows: Table, *, measure: str) -> Axes:
    """A row a variant on a logarithmic axis: a mark at the mean, its interval, a dot for each training.

    What lies below the axis ends in an arrow at its left end: a distance with its bias taken off may be below 0. The
    title names the generator that comes nearest to recordings.

    Parameters
    ----------
    ax : Axes
    rows : with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus; what they have
        under "seed 1", "seed 2", ... are the values of single trainings
    measure : name in `DISTANCES`
    """
    table = of_measure(rows, measure)
    places = rows_by_name(ax, [name for name in (*LOOKS, *_REFERENCES) if name in table.index], _REFERENCES)
    values = table[["mean", "low", "high"]].to_numpy(np.float64)
    left, right = 0.6 * max(0.5, float(np.nanmin(values[values > 0.0]))), 3.5 * table["mean"].max()
    ax.set(xscale="log", xlim=(left, right), xlabel="distance, in powers of ten")
    ax.xaxis.set_major_formatter("{x:g}")
    for name, place in reversed(places.items()):
        row, look = table.loc[name], LOOKS.get(name, _REFERENCE)
        mean, low, high = map(float, row[["mean", "low", "high"]].to_numpy())
        ax.hlines(place, left, right, color=COLOURS["faint"], linewidth=0.8, zorder=0)
        inside = {"mean": mean if mean >= left else np.nan, "low": np.clip(low, left, right)}
        draw_mean(ax, inside | {"high": np.clip(high, left, right)}, place, look)
        for end, beyond, head in ((left, low < left, "<"), (right, high > right, ">")):
            if beyond:
                ax.plot(end, place, head, color=look.colour, markersize=7, clip_on=False)
        seeds = row.filter(regex=SEEDS).to_numpy(np.float64)
        seeds = seeds[seeds >= left]
        ax.plot(seeds, np.full(seeds.size, place + 0.22), ".", color=look.colour, markersize=6, gid="seed")
        number = f"{mean:.0f}" if abs(mean) >= 100 else f"{round(mean, 1) + 0.0:.1f}"  # never -0.0
        draw_number(ax, number, (max(mean, left), place), look.colour, -7)
    ax.set_ylim(-0.8, len(places) - 0.5)
    words = f"{corpus_of(table)}, {DISTANCES[measure]}" if measure == "fid" else DISTANCES[measure]
    nearest = LOOKS[str(table.loc[table.index.isin([*LOOKS]), "mean"].idxmin())]
    ax.set_title(f"{sentence(words)}:\nnearest is “{nearest.label}”", fontsize=10.5)
    return ax


def distances_figure(rows: Table) -> Figure:
    """`draw_distances` for both kinds of features side by side, a row for each corpus, of the table of notebook 08."""
    table = pd.DataFrame(rows)
    handles = [
        Line2D([], [], **_REFERENCE.mark, label="recorded beside recorded dance"),
        Line2D([], [], color=COLOURS["ink"], linewidth=2.2, label="95 % interval (arrow: beyond the axis)"),
    ]
    if table.filter(regex=SEEDS).size:
        handles.append(Line2D([], [], linestyle="none", marker=".", color=COLOURS["ink"], label="one training"))
    panels = [lambda ax, part, name=name: draw_distances(ax, part, measure=name) for name in DISTANCES]
    return corpus_figure(table, panels, handles, height=3.3, more=0.5, sharey="row")


# Gain and cost of a harmony loss (Fig. 11): measures by loss, and harmony against its price

RECORDED = "recorded"
WEIGHTED = "recommended"  # the loss whose weight the trade-off varies
LOSSES = MappingProxyType({"paper": "paper's losses", "recommended": "our losses"})
_OWNERS = MappingProxyType({"paper": "the paper's", "recommended": "our"})
APART = 0.15  # rows, of a mark from the middle of its row: without the harmony term above, with it below
# Columns of the table of the ablation, with the words for them.
MEASURES = MappingProxyType(
    {
        "paper_harmony": "paper's harmony h",
        "paper_hit_rate": "paper's hit rate",
        "above_chance": "harmony above chance",
        "count_ratio": "beats danced for each beat heard",
        "jerk": "jerk (m/s³)",
        "fid": "distance to recorded dance (FID)",
    }
)
# Of the picture, with the name of the axis and of the subject; the table has them all.
SHOWN = MappingProxyType(
    {
        "above_chance": ("0: as many beats as chance meets; 1: every music beat", "Harmony above chance, {}"),
        "fid": ("0: moves the same", "FID to recorded dance"),
    }
)
_DOT: Mapping[str, Any] = MappingProxyType({"linestyle": "none", "marker": "o", "color": COLOURS["ink"]})


def draw_measure(ax: Axes, rows: Table, *, measure: str) -> Axes:
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
        if loss != RECORDED:
            arrow: dict[str, Any] = {
                "arrowstyle": "-|>",
                "color": LOOKS[loss].colour,
                "alpha": 0.5,
                "shrinkA": 5,
                "shrinkB": 5,
            }
            start, end = ((table.loc[name, "mean"], height) for name, height in pair.items())
            ax.annotate("", end, start, arrowprops=arrow, zorder=2)
        for name, height in pair.items():
            mean, up = float(table["mean"][name]), 7 if height > place else -7
            number = f"{mean:.1f}" if abs(mean) >= 2 else f"{mean:.2f}"
            draw_mean(ax, table.loc[name], height, LOOKS[name], width=2, number=number, up=up)
    low, high = ends(table)
    ax.set(xlim=(0.0, 1.08 * high), xlabel=SHOWN[measure][0])
    if measure == "above_chance":
        ax.set_xlim(min(-0.1, low - 0.05), max(1.05, high + 0.05))
        ax.axvline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    return ax


def ablation_figure(rows: Table, gains: Table) -> Figure:
    """Harmony above chance and FID, a row of panels for each corpus; titles say which loss changes which.

    Parameters
    ----------
    rows : of `study.experiments.judging.seed_means` for `SHOWN` at least
    gains : of `gains` in notebook 09 for the same measures
    """
    table, changes = pd.DataFrame(rows), pd.DataFrame(gains).set_index(["corpus", "measure"]).sort_index()

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> None:
        finding = _change_words(changes.loc[(part["corpus"].iloc[0], measure)].set_index("loss"))
        title = f"{SHOWN[measure][1].format(corpus_of(part))}:\n{finding}"
        draw_measure(ax, part, measure=measure).set_title(title, fontsize=10.5)

    handles = [
        Line2D([], [], **_DOT, markersize=8, markerfacecolor="white", label="without the harmony term"),
        Line2D([], [], **_DOT, markersize=8, label="with it"),
        Line2D([], [], **LOOKS[RECORDED].mark, label="recorded dance"),
    ]
    if (seeds := table.get("seeds", pd.Series([1])).max()) > 1:
        handles.append(Line2D([], [], color=COLOURS["chance"], linewidth=2, label=f"95 % interval, {seeds} trainings"))
    panels = [lambda ax, part, name=name: draw(ax, part, name) for name in SHOWN]
    return corpus_figure(table, panels, handles, height=2.9, ncols=4, gridspec_kw={"wspace": 0.08})


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


def draw_trade_off(ax: Axes, rows: Table, sweep: Table = (), *, measure: str) -> Axes:
    """Harmony above chance against its price: a mark for each variant with its intervals both ways.

    Parameters
    ----------
    ax : Axes
    rows : with "variant", "measure", "mean", "low" and "high" (NaN for no interval), of one corpus
    sweep : with "harmony_weight", "above_chance" and the measure: small marks, each a single training of our losses
        with another weight
    measure : "jerk" or "fid", on the x axis
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
    colour = LOOKS[WEIGHTED].colour
    for row in pd.DataFrame(sweep).to_dict("records"):
        place = row[measure], row["above_chance"]
        ax.plot(*place, "o", markersize=4, color=colour, zorder=3, gid="sweep")
        words: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8.5, "color": colour}
        ax.annotate(f"{row['harmony_weight']:g}", place, (4, 4), **words)
    ax.axhline(0.0, color=COLOURS["chance"], linewidth=1, zorder=0)
    ax.set(xlabel=MEASURES[measure], ylabel="harmony above chance")
    ax.set_xlim(left=0.0)
    return ax


def trade_off_figure(rows: Table, sweep: Table = ()) -> Figure:
    """`draw_trade_off` against jerk and FID, a row of panels for each corpus; titles say what our harmony term changes.

    Parameters
    ----------
    rows : of `study.experiments.judging.seed_means` for harmony above chance, jerk and FID at least
    sweep : of the sweep of notebook 09
    """
    weights = pd.DataFrame(sweep)

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> None:
        own = weights[weights["corpus"] == part["corpus"].iloc[0]] if weights.size else weights
        draw_trade_off(ax, part, own, measure=measure)
        means = part.set_index(["measure", "variant"])["mean"]
        harmony, price = (means[name][[f"{WEIGHTED}, without", WEIGHTED]] for name in ("above_chance", measure))
        title = "FID {:.1f} → {:.1f}".format(*price)
        if measure == "jerk":
            title = f"{sentence(corpus_of(part))}, our harmony term:\n"
            title += "harmony {:.2f} → {:.2f}, jerk {:.0f} → {:.0f}".format(*harmony, *price)
        ax.set_title(title, fontsize=10.5)
        ax.set_ylabel(ax.get_ylabel() if measure == "jerk" else "")

    handles = [Line2D([], [], **look.mark, label=look.label) for look in LOOKS.values()]
    if weights.size:
        dot = {**_DOT, "markersize": 4, "color": LOOKS[WEIGHTED].colour}
        handles.append(Line2D([], [], **dot, label="one training with another weight of it"))
    panels = [lambda ax, part, name=name: draw(ax, part, name) for name in ("jerk", "fid")]
    return corpus_figure(rows, panels, handles, height=3.4, more=0.7, sharey="row")


# Tricks that raise a score: each with its own music and with music half a beat late (Sec. 6)

# Columns of the table of tricks, with the words for them.
CHEAT_MEASURES = MappingProxyType(
    {name: words for name, words in MEASURES.items() if name in ("paper_harmony", "paper_hit_rate", "above_chance")}
    | {"paper_count_ratio": MEASURES["count_ratio"], "jerk": MEASURES["jerk"]}
)
# The two scores of the picture, with the names of their axes and of their subjects.
SIDES = MappingProxyType(
    {
        "paper_hit_rate": ("share of music beats met within 0.25 s", "Paper's hit rate, {}"),
        "above_chance": ("0: as many as chance meets; 1: every beat", "Harmony above chance"),
    }
)
CHANCE = MappingProxyType({"paper_hit_rate": "paper_chance"})  # measure -> the level that chance reaches in it
TRUE = "true"
UNTOUCHED = "as danced"


def both_musics(rows: Table, measure: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of a measure by trick, with the true music and with late music."""
    table = of_measure(rows, measure, "trick")
    return table[table["music"] == TRUE], table[table["music"] != TRUE]


def draw_dumbbells(ax: Axes, rows: Table, *, measure: str) -> Axes:
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
        _draw_late(ax, true.loc[trick], late.loc[trick], place, look)
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
    return ax


def _draw_late(ax: Axes, true: Any, late: Any, place: float, look: Look) -> None:
    """An arrow from the mean with the true music to a hollow dot at the one with late music; the latter's interval."""
    low = place - 0.24
    ax.plot([late["low"], late["high"]], [low] * 2, color=look.colour, linewidth=0.9, alpha=0.6, zorder=2)
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": look.colour, "alpha": 0.6, "shrinkB": 5}
    ax.annotate("", (late["mean"], low), (true["mean"], place), arrowprops=arrow, zorder=3)
    mark: dict[str, Any] = {
        **look.mark,
        "marker": "o",
        "markersize": 5.5,
        "markerfacecolor": "white",
        "markeredgewidth": 1.2,
    }
    ax.plot(late["mean"], low, **mark, zorder=4, gid="late")


def tricks_figure(rows: Table) -> Figure:
    """`draw_dumbbells` of the paper's hit rate and of harmony above chance; titles count tricks that beat the dance.

    Parameters
    ----------
    rows : of `study.experiments.judging.trick_means` for `SIDES` and "paper_chance"
    """

    def beaten(true: pd.DataFrame, late: pd.DataFrame) -> str:
        tricks = true["mean"].drop(UNTOUCHED)
        return f"{(tricks > true.loc[UNTOUCHED, 'mean']).sum()} of {len(tricks)} tricks score above the dance"

    return _cheating_figure(rows, beaten, "clips")


def listening_figure(rows: Table) -> Figure:
    """`draw_dumbbells` of the same two scores for generators; titles name who loses clearly when the music is late.

    Parameters
    ----------
    rows : as for `tricks_figure`
    """

    def losers(true: pd.DataFrame, late: pd.DataFrame) -> str:
        low, top = (
            side.where(side.notna(), each["mean"]) for side, each in ((true["low"], true), (late["high"], late))
        )
        names = [LOOKS[str(name)].label for name in true.index[low > top]]
        who = (listed(names) or "nobody") if len(names) < len(true) else f"all {len(names)}"
        return f"with late music it falls for {who}"

    return _cheating_figure(rows, losers, "units")


def _cheating_figure(rows: Table, finding: Callable[[pd.DataFrame, pd.DataFrame], str], unit: str) -> Figure:
    """A panel for each score of `SIDES`, below each other for each corpus; `finding` makes its title."""
    table = pd.DataFrame(rows)

    def draw(ax: Axes, part: pd.DataFrame, measure: str) -> None:
        title = f"{SIDES[measure][1].format(corpus_of(part))}:\n{finding(*both_musics(part, measure))}"
        draw_dumbbells(ax, part, measure=measure).set_title(title, fontsize=10.5)
        if measure == "paper_hit_rate":
            ax.set_xlabel(f"{ax.get_xlabel()} ({part['n'].iloc[0]} {unit})")

    late: dict[str, Any] = {"markersize": 5.5, "markerfacecolor": "white", "label": "the same music half a beat late"}
    handles = [
        Line2D([], [], **_DOT, markersize=8, label="true music"),
        Line2D([], [], **_DOT, **late),
        Line2D([], [], color=COLOURS["chance"], linewidth=4, label="what as many beats meet by chance"),
    ]
    height = 0.42 * table.groupby("corpus")["trick"].nunique().max() + 1.2
    panels = [lambda ax, part, name=name: draw(ax, part, name) for name in SIDES]
    return corpus_figure(table, panels, handles, height=height, sharey="row")


# Which of two dances a score prefers (in place of Fig. 13)

JUDGES = MappingProxyType({"paper's harmony": ("^", "#56B4E9"), "above chance": ("s", "#CC79A7")})


def draw_choices(ax: Axes, rows: Table) -> Axes:
    """Share of units on which each score prefers one variant over another, a row a pair; the grey band is a coin's.

    Parameters
    ----------
    ax : Axes
    rows : with "first", "second", "judge", "share" (of units on which the judge prefers the first), "n"
    """
    table = pd.DataFrame(rows)
    pairs = zip(table["first"], table["second"], strict=True)
    names = [f"{LOOKS[second].label}\nover {LOOKS[first].label}" for first, second in pairs]
    places = rows_by_name(ax, list(dict.fromkeys(names)))
    half = 0.98 / np.sqrt(table["n"].max())
    ax.axvspan(0.5 - half, 0.5 + half, color=COLOURS["faint"], zorder=0, label="a coin, 95 % of the time")
    ax.axvline(0.5, color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    ax.hlines([*places.values()], 0.0, 1.0, color=COLOURS["faint"], linewidth=1, zorder=1)
    table = table.assign(height=[places[name] for name in names], share=1.0 - table["share"])
    for up, (judge, (marker, colour)) in zip((0.18, -0.18), JUDGES.items(), strict=True):
        own = table[table["judge"] == judge]
        look: dict[str, Any] = {"linestyle": "none", "marker": marker, "markersize": 9, "color": colour}
        ax.plot(own["share"], own["height"] + up, **look, label=judge, zorder=3)
        for share, height in zip(own["share"], own["height"] + up, strict=True):
            ax.annotate(f"{share:.0%}", (share, height), (8, 0), textcoords="offset points", va="center", fontsize=9)
    ax.set(xlim=(-0.03, 1.1), xlabel="share of units on which the score prefers the upper name")
    return ax


def favourites(rows: Table) -> dict[str, str]:
    """Judge -> name of the variant that it prefers in most comparisons; rows as for `draw_choices`."""
    table = pd.DataFrame(rows)
    turned = table.assign(first=table["second"], share=1.0 - table["share"])
    votes = pd.concat([table, turned]).groupby(["judge", "first"], sort=False)["share"].sum()
    return {judge: LOOKS[name].label for judge, name in votes.groupby("judge", sort=False).idxmax()}


def forced_choice_figure(rows: Table) -> Figure:
    """`draw_choices` for each corpus, one above the other; titles name the variant that each score likes best."""

    def draw(ax: Axes, part: pd.DataFrame) -> None:
        best = favourites(part)
        words = "\n".join(f"“{judge}” likes “{name}” best" for judge, name in best.items())
        if len(best) > 1 and len(set(best.values())) == 1:
            words = f"both scores like “{next(iter(best.values()))}” best"
        about = f"{sentence(corpus_of(part))}, {part['n'].iloc[0]} units, no people asked"
        draw_choices(ax, part).set_title(f"{about}:\n{words}", fontsize=10.5)

    return corpus_figure(rows, [draw], height=4.3, more=0.4)


# Systems compared (Fig. 12): a bar a system with its interval, chance on every bar, the paper's value beside it

# Measures of the panels from left to right, with the words for them.
COMPARED: Mapping[str, str] = MappingProxyType(
    {
        "h": "harmony h (paper's Table 1)",
        "hit_rate": "hit rate (paper's Table 2)",
        "above_chance": "harmony above chance",
    }
)
WIDE, THIN = 0.72, 0.34  # of bars, of the place of a system
GAP = 0.8  # places between systems and what needs no training
STEP = 0.8  # places from one of these to the next
HOLLOW = "HarmoGAN without L_harmo"
_COLOURS = MappingProxyType({"HarmoGAN": _PAPER, HOLLOW: _PAPER, "HarmoGAN, recommended loss": _OURS})

_DIAMOND: Mapping[str, Any] = MappingProxyType(
    {"linestyle": "none", "marker": "D", "markerfacecolor": "white", "markeredgecolor": "black"}
)


def draw_compared(ax: Axes, rows: Table, *, measure: str) -> Axes:
    """One measure of every system of a contest; thin grey bars at the bottom are dances that need no training.

    Parameters
    ----------
    ax : Axes
    rows : of Table 12 (notebook 10), of one contest; kind says where a bar stands
    measure : name in `COMPARED`
    """
    table = pd.DataFrame(rows)
    table = table.assign(cheap=table["kind"].isin(["recorded", "pieces"])).sort_values("cheap", kind="stable")
    steps = np.where(table["cheap"], STEP, 1.0)
    places = np.cumsum(steps) - steps + GAP * table["cheap"].to_numpy()
    for place, (_, row) in zip(places, table.iterrows(), strict=True):
        _draw_bar(ax, row, place, measure)
    ax.set_yticks(places, table["system"], fontsize=8.5)
    ax.tick_params(axis="y", length=0)
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.set(ylim=(places.max() + 0.6, -0.7), xlabel=COMPARED[measure])
    return ax


def _draw_bar(ax: Axes, row: Any, place: float, measure: str) -> None:
    """The bar of one system, its interval, chance and the paper's value; in words where it was not trained enough."""
    mean, width, paper = row[measure], THIN if row["cheap"] else WIDE, row.get(f"{measure} paper", np.nan)
    if np.isfinite(mean):
        usual = CHOREOGRAPHER if row["kind"] == "choreographer" else RIVAL
        colour = COLOURS["chance"] if row["cheap"] else _COLOURS.get(row["system"], usual)
        face = "white" if row["system"] == HOLLOW else colour
        ax.barh(place, mean, width, facecolor=face, edgecolor=colour, linewidth=1.4)
        low, high, chance = row[f"{measure} low"], row[f"{measure} high"], row.get(f"{measure} chance", 0.0)
        if np.isfinite(low):
            ax.plot([low, high], [place, place], color=COLOURS["ink"], linewidth=1.6, gid="interval", zorder=4)
        height = place + np.array([-0.5, 0.5]) * (width + 0.12)
        ax.plot([chance, chance], height, color=COLOURS["miss"], linewidth=2.0, gid="chance", zorder=3)
    else:
        words = str(row["remark"]).partition(":")[0] if isinstance(row["remark"], str) else ""
        ax.text(0.0, place, f" {words or 'no number'}", ha="left", va="center", fontsize=8, color=COLOURS["chance"])
    if np.isfinite(paper):
        ax.plot(paper, place, **_DIAMOND, markersize=6, gid="paper", zorder=5)


def comparison_figure(rows: Table) -> Figure:
    """`draw_compared` for each of `COMPARED`, a row of panels for each contest; what is synthetic is marked there.

    Titles count the systems whose hit rate, the paper's, is above chance with its whole interval. Harmony above chance
    is in no title: some of the systems were trained for it.

    Parameters
    ----------
    rows : of Table 12 (notebook 10)
    """
    contests = list(pd.DataFrame(rows).groupby(["music", "corpus"], sort=False))
    heights = [0.24 * len(table) + 1.0 for _, table in contests]
    size, ratios = (9.0, sum(heights) + 0.8), {"height_ratios": heights}
    with styled_axes(size, len(contests), len(COMPARED), sharey="row", gridspec_kw=ratios) as (figure, axes):
        for line, ((music, corpus), table) in enumerate(contests):
            panels = axes[line * len(COMPARED) : (line + 1) * len(COMPARED)]
            for ax, measure in zip(panels, COMPARED, strict=True):
                draw_compared(ax, table, measure=measure)
            tried = table[~table["kind"].isin(["recorded", "pieces"])].dropna(subset="hit_rate low")
            above = (tried["hit_rate low"] > tried["hit_rate chance"]).sum()
            finding = f"{above or 'none'} of {len(tried)} systems with an interval hit more beats than chance"
            # It runs over the panels beside it: an empty title keeps its height free, and nothing its width.
            panels[0].set_title(" \n ", fontsize=10.5)
            about = f"{sentence(str(music))}; trained on {corpus_words(str(corpus))}:\n{finding}"
            words = panels[0].text(0.0, 1.02, about, gid="title", transform=panels[0].transAxes)
            words.set(va="bottom", fontsize=10.5, in_layout=False)
            if is_synthetic(f"{music} {corpus}"):
                mark_synthetic(panels[-1])
        figure.legend(handles=_compared_handles(), loc="outside upper center", ncols=2, fontsize=9)
    return figure


def _compared_handles() -> list[Artist]:
    """Entries of the legend."""
    return [
        Patch(facecolor=RIVAL, label="systems, mean over dances"),
        Patch(facecolor=COLOURS["chance"], label="no training needed"),
        Line2D([], [], color=COLOURS["ink"], linewidth=1.6, label="95 % interval, where there is one"),
        Line2D([], [], color=COLOURS["miss"], linewidth=2.0, label="chance: as many beats at random moments"),
        Line2D([], [], **_DIAMOND, markersize=7, label="printed in the paper, for other music and models"),
    ]
