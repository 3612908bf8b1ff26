"""Distributions of an evaluation: every song of every row of the table, beside the mean and its interval."""

from collections.abc import Collection, Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from harmolab.lab.figures.style import COLOURS, styled_axes

WIDTH = 4.0  # inches
SPREAD = 0.22  # half the height of the band of dots, rows
MOST_DOTS = 300  # of a row; of more songs so many are drawn, evenly through their sorted values


def distribution_figure(
    songs: Mapping[str, ArrayLike], means: Mapping[str, tuple[float, float, float, int]], *, controls: Collection[str]
) -> Figure:
    """A dot a song, a line for the interval and a diamond for the mean; one row a system, controls in grey.

    Parameters
    ----------
    songs : row -> (n,) values of its songs
    means : row -> mean, low and high (NaN for no interval), and number of songs
    controls : rows that are no systems
    """
    with styled_axes((WIDTH, 0.5 + 0.34 * len(songs))) as (figure, (ax,)):
        for place, (name, values) in enumerate(songs.items()):
            dots = np.sort(np.asarray(values, np.float64))
            if dots.size > MOST_DOTS:
                dots = dots[np.linspace(0, dots.size - 1, MOST_DOTS).astype(int)]
            colour = COLOURS["chance"] if name in controls else COLOURS["visual"]
            heights = place + SPREAD * _band(dots.size)
            ax.scatter(dots, heights, s=12, color=colour, alpha=0.55, linewidths=0, gid="song")
            mean, low, high, _ = means[name]
            if np.isfinite(low):
                ax.plot([low, high], [place, place], color=COLOURS["ink"], linewidth=2, gid="interval")
            ax.plot(mean, place, "D", color=COLOURS["ink"], markersize=5, gid="mean")
        ax.set(yticks=range(len(songs)), yticklabels=list(map(plain_text, songs)), ylim=(len(songs) - 0.5, -0.5))
        ax.tick_params(axis="y", length=0)
    return figure


def _band(count: int) -> np.ndarray:
    """Heights between -1 and 1 that spread neighbours apart, the same every time."""
    golden: np.ndarray = np.mod(np.arange(count) * 0.6180339887, 1.0) * 2 - 1
    return golden if count > 1 else np.zeros(count)


def plain_text(name: str, longest: int = 24) -> str:
    """A name as matplotlib prints it: shortened, and no dollar sign begins a formula."""
    short = name if len(name) <= longest else f"{name[: longest - 1]}…"
    return "".join(one if one.isprintable() else " " for one in short).replace("$", r"\$")
