"""The distance from each music beat to the dancer's nearest rest or hit, along time."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.beats import draw_marks, draw_shares
from harmolab.lab.figures.style import COLOURS, styled_axes
from harmolab.types import FloatArray
from harmolab.verdict.score import HarmonyScore

Mean = tuple[float, float, float, tuple[float, float]]  # start, end, mean, interval: all in seconds

DPI = 150
LEAST_ROOM = 1.6  # tolerances that the y axis shows at least


def offset_figure(lags: FloatArray, curve: FloatArray, *, best: float, others: Sequence[float] = ()) -> Figure:
    """Fit of a motion to its music by the place of its first frame; the best place and its rivals are named.

    Parameters
    ----------
    lags, curve : (L,) arrays, seconds and evidence, as in `harmolab.lab.timing.movement.Offset`
    best, others : seconds, the place that fits best and those that fit nearly as well
    """
    with styled_axes((9.0, 3.2)) as (figure, (ax,)):
        ax.plot(lags, curve, color=COLOURS["visual"])
        ax.axvline(best, color=COLOURS["ink"], linestyle="--", label=f"found: {best:.2f} s")
        for number, other in enumerate(others):
            label = "or some beats earlier or later" if number == 0 else None
            ax.axvline(other, color=COLOURS["chance"], linestyle=":", label=label)
        title = f"The dance fits best when it begins {best:.2f} s into the song"
        ax.set_title(f"{title}; {len(others)} other places fit nearly as well" if others else title)
        ax.set(xlabel="song time of the first frame (s)", ylabel="slowness on beats (SD)")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def signed_offsets(audio_times: FloatArray, visual_times: FloatArray) -> FloatArray:
    """Offset of the visual beat nearest to each music beat: (N,) seconds, early is negative; NaN without any.

    >>> signed_offsets(np.array([1.0, 2.0]), np.array([1.1, 1.75]))
    array([ 0.1 , -0.25])
    """
    if visual_times.size == 0:
        return np.full(audio_times.size, np.nan)
    differences = visual_times[None, :] - audio_times[:, None]
    offsets: FloatArray = differences[np.arange(audio_times.size), np.abs(differences).argmin(axis=1)]
    return offsets


def event_name(score: HarmonyScore) -> str:
    """Name of the events that a score's visual beats are: "rest", "hit", or "visual beat" where they are both."""
    if score.judgement is not None and score.judgement.reading == "hit":
        return "hit"
    return {"valleys": "rest", "peaks": "hit"}.get(score.params.detector, "visual beat")


def draw_timing(ax: Axes, score: HarmonyScore, *, event: str = "") -> Axes:
    """Each music beat's distance to the visual beat that hits it, in milliseconds; below zero before it, above after.

    A green circle is a hit of the score; a red cross a miss, at its nearest visual beat. Without visual beats only the
    band of the tolerance is drawn. An event before the beat is not yet a dancer who is early: that is for the verdict.
    `event` names the visual beats, `event_name` where it is left out.
    """
    music, times = score.music, score.visual.times - score.params.lag
    hits = score.pairs >= 0
    offsets = 1000 * signed_offsets(music.times, times)
    offsets[hits] = 1000 * (times[score.pairs[hits]] - music.times[hits])
    delay = 1000 * score.params.reaction_delay
    ax.axhspan(-delay, delay, color=COLOURS["audio"], alpha=0.13, linewidth=0, zorder=0, label="tolerance field")
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8, zorder=1)
    finite = np.isfinite(offsets)
    draw_marks(ax, music.times[finite], offsets[finite], hits[finite], labels=("hit", "missed"))
    room = 1.15 * max(float(np.abs(offsets[finite]).max(initial=0.0)), LEAST_ROOM * delay, 1.0)
    label = f"{event or event_name(score)} before  |  after (ms)"
    ax.set(xlim=(0.0, music.duration), ylim=(-room, room), xlabel="time (s)", ylabel=label)
    return ax


def draw_means(ax: Axes, means: Sequence[Mean]) -> Axes:
    """The lag of each segment as an orange line, with a pale field for its spread.

    Parameters
    ----------
    ax : Axes with milliseconds on the y axis
    means : (start, end, mean, (low, high)) for each segment, seconds
    """
    for place, (start, end, mean, (low, high)) in enumerate(means):
        field = "lag and spread from bar to bar" if place == 0 else None
        ax.plot([start, end], [1000 * mean] * 2, color=COLOURS["visual"], linewidth=2.2, zorder=4, label=field)
        if np.isfinite([low, high]).all():
            ax.fill_between([start, end], 1000 * low, 1000 * high, color=COLOURS["visual"], alpha=0.35, lw=0, zorder=3)
    return ax


def ranks_figure(score: HarmonyScore, *, size: tuple[float, float] = (9.0, 3.6)) -> Figure:
    """The rank of each music beat by the fit to a dance's pattern (`is_ranked`), with a legend; `size` in inches."""
    with styled_axes(size) as (figure, (ax,)):
        draw_shares(ax, score.music, score.shares, chance=score.chance).set_ylabel("rank of the fit")
        _add_legend(ax, size)
    return figure


def timing_figure(
    score: HarmonyScore,
    *,
    means: Sequence[Mean] = (),
    title: str = "The rest or hit nearest to each music beat",
    event: str = "",
    size: tuple[float, float] = (9.0, 3.6),
) -> Figure:
    """`draw_timing` and `draw_means` as one picture with a legend.

    Parameters
    ----------
    score : HarmonyScore
    means : as in `draw_means`, such as the halves of an explanation
    title : str
    event : str, as in `draw_timing`
    size : (float, float), inches
    """
    with styled_axes(size) as (figure, (ax,)):
        draw_means(draw_timing(ax, score, event=event), means)
        ax.set_title(title)
        _add_legend(ax, size)
    return figure


def png_text(figure: Figure) -> str:
    """A figure as base64 of PNG, to stand in a page."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, bbox_inches="tight")
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _add_legend(ax: Axes, size: tuple[float, float]) -> None:
    """A legend below the axes, folded in a narrow figure."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.72 / size[1]), ncols=4 if size[0] > 6 else 2)
