"""Music2Dance's classifier in pictures: features of a song (Fig. 4), layers (Fig. 5), Table 1."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.types import Audio, Clip, FloatArray
from study.figures.framework import box_height, count_text, drawing_figure
from study.figures.variants import RIVAL, Look, draw_mean, of_measure, panels_figure, rows_by_name
from study.figures.words import clip_words, count_words, listed

_SEEDS: Mapping[str, Any] = {"linestyle": "none", "marker": "|", "markersize": 12, "markeredgewidth": 1.5}
TONES = ("C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B")
POINTS = 1500  # of the wave's outline
LABEL = 20  # letters in a line of a model's name
BOX, COLUMN, STEP = 3.4, 4.5, 0.86  # inches: width of a box, from network to network, from one box to the next


def song_figure(
    clip: Clip,
    music: NDArray[np.float32],
    mel: NDArray[np.float32],
    *,
    rates: tuple[float, float],
    bars: FloatArray | None = None,
    start: float = 0.0,
    seconds: float = 20.0,
) -> Figure:
    """Fig. 4: wave, log-mel spectrogram, chroma, beat and downbeat, and onset of a song on one time axis.

    Parameters
    ----------
    clip : Clip with the whole song
    music : (M, 15) channels of the whole song
    mel : (K, bands) mel spectrogram of the whole song, decibels
    rates : hertz, of `music` and of `mel`; both begin at 0 s
    bars : (B,) seconds at which bars truly begin; None where that is unknown
    start, seconds : float, the part that is drawn; earlier where the song ends before
    """
    start = max(0.0, min(start, clip.audio.duration - seconds))
    end = min(start + seconds, clip.audio.duration)
    with styled_axes((9.2, 8.2), 5, 1, sharex=True, height_ratios=(1, 1.6, 1.7, 0.9, 0.9)) as (figure, axes):
        _draw_wave(axes[0], clip.audio, start, end)
        _draw_grid(axes[1], mel.T, rates[1])
        axes[1].set(title="log-mel spectrogram (no input of the classifier; light: loud)", ylabel="mel band")
        _draw_grid(axes[2], music[:, 3:].T, rates[0])
        axes[2].set(title="inputs 4 to 15, chroma: strength of the twelve tones (light: strong)", ylabel="tone")
        axes[2].set_yticks(range(0, 12, 2), TONES[::2])
        draw_beat_channels(axes[3], music, rates[0], bars)
        _draw_steps(axes[4], music[:, 0], rates[0], color=COLOURS["audio"])
        axes[4].set(title="input 1, onset: a sound sets in", xlabel="time in the song (s)", ylim=(0, 1.05))
        axes[4].set_xlim(start, end)
        kept = np.empty(0) if bars is None else bars[(bars >= start) & (bars < end)]
        figure.suptitle(f"{clip_words(clip)}{_bars_finding(music, kept, rates[0])}", fontsize=11.5, x=0.01, ha="left")
    return figure


def _bars_finding(music: NDArray[np.float32], bars: FloatArray, rate: float) -> str:
    """Bars that truly begin where, to one moment, a downbeat is guessed; empty without true bars."""
    guesses = np.flatnonzero(music[:, 2]) / rate
    met = [np.abs(guesses - bar).min(initial=np.inf) <= 1 / rate for bar in bars]
    return f": the downbeat is guessed at {count_words(sum(met), len(met))} true bar lines" if met else ""


def _draw_wave(ax: Axes, audio: Audio, start: float, end: float) -> None:
    """Least and greatest amplitude of each short stretch."""
    samples = audio.span(start, end - start).samples
    count = min(POINTS, samples.size)
    blocks = samples[: samples.size // count * count].reshape(count, -1)
    times = np.linspace(start, end, count)
    ax.fill_between(times, blocks.min(axis=1), blocks.max(axis=1), color=COLOURS["audio"], linewidth=0)
    ax.set(title="wave", ylabel="amplitude")


def _draw_grid(ax: Axes, values: FloatArray | NDArray[np.float32], rate: float) -> None:
    """Rows of values over time, each value centred on its moment; light is large."""
    rows, moments = values.shape
    extent = (-0.5 / rate, (moments - 0.5) / rate, -0.5, rows - 0.5)
    ax.imshow(values, origin="lower", aspect="auto", extent=extent, cmap="viridis", interpolation="nearest")


def _draw_steps(ax: Axes, values: NDArray[np.float32], rate: float, **look: Any) -> None:
    """A bar for each moment, as wide as the time between two."""
    ax.bar(np.arange(len(values)) / rate, values, width=1 / rate, linewidth=0, **look)


def draw_beat_channels(ax: Axes, music: NDArray[np.float32], rate: float, bars: FloatArray | None = None) -> Axes:
    """Channels beat (pale) and downbeat (dark) of (M, 15) as bars; triangles where a bar truly begins, if known."""
    _draw_steps(ax, music[:, 1], rate, color="#9CC6E0", label="beat (tracked)")
    _draw_steps(ax, music[:, 2], rate, color=COLOURS["ink"], label="downbeat (a guess)")
    if bars is not None:
        ax.plot(bars, np.full(bars.size, 1.15), "v", color=COLOURS["visual"], label="a bar truly begins")
    ax.set(title="inputs 2 and 3, beat and downbeat", ylim=(0, 1.3), yticks=[0, 1])
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=9, borderaxespad=0.2)
    return ax


def classifier_figure(networks: Mapping[str, Sequence[Any]]) -> Figure:
    """Fig. 5: a column of boxes for each network, from a window of features (above) to the classes.

    Parameters
    ----------
    networks : name -> stages (`study.shapes.classifier_stages`)
    """
    longest = max(len(stages) for stages in networks.values())
    width, height = COLUMN * len(networks), STEP * longest + 0.75
    drawing: dict[str, list[Any]] = {"signals": [], "parts": [], "arrows": [], "titles": []}
    for column, (name, stages) in enumerate(networks.items()):
        x = COLUMN * (column + 0.5)
        # The last boxes stand beside each other, so that what differs is seen to differ.
        rows = [*range(len(stages) - 3), *range(longest - 3, longest)]
        places = [height - 0.85 - STEP * row for row in rows]
        boxes = [_box_lines(stage) for stage in stages]
        for number, (y, stage, lines) in enumerate(zip(places, stages, boxes, strict=True)):
            kind, tint = "parts" if stage.parameters else "signals", "both" if number else "audio"
            drawing[kind].append([x, y, BOX, tint, *lines])
        ends = [(y + box_height(lines) / 2, y - box_height(lines) / 2) for y, lines in zip(places, boxes, strict=True)]
        drawing["arrows"] += [[[x, above[1]], [x, below[0]]] for above, below in pairwise(ends)]
        total = count_text(sum(stage.parameters for stage in stages))
        drawing["titles"].append([x - BOX / 2, height - 0.25, f"{name}:\n{total} parameters"])
    words = "shapes of one window: (moments, values), between the convolutions (channels, moments, features)"
    return drawing_figure({**drawing, "size": (width, height), "labels": [[(COLUMN - BOX) / 2, 0.15, words]]})


def _box_lines(stage: Any) -> list[str]:
    """Name, sizes and parameters of a layer where it has some, and the shape."""
    shape = "(" + ", ".join(str(size) for size in stage.shape) + ")"
    layer = [stage.detail, f"{count_text(stage.parameters)} parameters" if stage.parameters else ""]
    return [stage.name, *filter(None, ["; ".join(filter(None, layer))]), shape]


def accuracy_figure(table: pd.DataFrame, differences: pd.DataFrame, *, remark: str = "") -> Figure:
    """Table 1 as dots with intervals, a row for each set of songs; at the right what the convolution gains on others.

    The title names the sets of songs on which the convolution is the best model.

    Parameters
    ----------
    table : Table 1 (notebook 15)
    differences : its differences
    remark : drawn in red below everything
    """
    gaps = of_measure(differences, "balanced", "set")

    def draw(ax: Axes, part: pd.DataFrame, panel: str) -> str:
        ax.tick_params(labelbottom=True)
        if panel == "difference":
            draw_differences(ax, gaps.loc[part["set"].unique()])
            return "convolution minus ..."
        draw_accuracies(ax, part)
        return f"{part['set'].iloc[0]}: {part['n'].iloc[0]} songs"

    look: dict[str, Any] = {"color": COLOURS["ink"], "markersize": 8, "linewidth": 2}
    handles = [
        Line2D([], [], **{**look, "color": RIVAL}, marker="o", label="networks"),
        Line2D([], [], **look, marker="D", label="without a network"),
        Line2D([], [], **_SEEDS, color=COLOURS["ink"], label="least and best seed"),
    ]
    grid: dict[str, Any] = {"more": 1.0, "loc": "outside lower left", "width_ratios": (1.5, 1), "sharex": "col"}
    panels = ["accuracy", "difference"]
    figure = panels_figure(table, draw, panels, handles, height=2.5, by=["set"], **grid)
    left = "songs given their class, all classes counting alike (%)\ndotted: guessing; lines: 95 % over songs"
    figure.axes[-2].set_xlabel(left)
    arrows = "\N{LEFTWARDS ARROW} others better      convolution better \N{RIGHTWARDS ARROW}"
    figure.axes[-1].set_xlabel(f"{arrows}\npoints of per cent; grey: cannot tell")
    best = table.loc[table.groupby("set", sort=False)["balanced"].idxmax()]
    ahead = list(best.loc[best["model"].str.contains("convolution"), "set"])
    where = f" ({listed(ahead)})" if ahead else ""
    title = f"The temporal convolution is the best model on {len(ahead)} of {len(best)} sets of songs{where}"
    figure.suptitle(title, fontsize=11.5, x=0.01, ha="left")
    figure.supxlabel(remark, color=COLOURS["miss"], fontsize=11, x=0.99, ha="right")
    return figure


def draw_accuracies(ax: Axes, table: pd.DataFrame) -> None:
    """One dot a model at its balanced accuracy by song, of one set of songs; diamonds for models without a network."""
    table = table.rename(columns={"balanced": "mean", "balanced low": "low", "balanced high": "high"})
    ax.axvline(table["chance"].iloc[0], color=COLOURS["chance"], linestyle=":", linewidth=1.5)
    for place, (_, row) in zip(_places(ax, table["model"]), table.iterrows(), strict=True):
        network = "LSTM" in row["model"]
        colour = RIVAL if network else COLOURS["chance" if row["model"] == "majority" else "ink"]
        draw_mean(ax, row, place, Look("", colour, "o" if network else "D", filled=True), number=f"{row['mean']:.1f}")
        ax.plot(row[["least seed", "best seed"]], [place, place], **_SEEDS, color=colour, gid="seeds")
    ax.set_xlim(0, 103)


def _places(ax: Axes, models: Iterable[str]) -> Iterable[int]:
    """Heights of the rows of models, whose names stand in two lines where they are long."""
    return rows_by_name(ax, [fill(name, LABEL, break_on_hyphens=False) for name in models]).values()


def draw_differences(ax: Axes, table: pd.DataFrame) -> None:
    """Gain of a model on others: green and a circle where the interval is above 0, red and a cross below, else grey."""
    table = table.rename(columns={"difference": "mean"})
    ax.axvline(0.0, color=COLOURS["ink"], linewidth=0.8)
    for place, (_, row) in zip(_places(ax, table["against"]), table.iterrows(), strict=True):
        kind, marker = ("hit", "o") if row["low"] > 0 else ("miss", "x") if row["high"] < 0 else ("chance", "s")
        draw_mean(ax, row, place, Look("", COLOURS[kind], marker, filled=True), number=f"{row['mean']:+.1f}", up=8)
    ax.margins(x=0.15)
