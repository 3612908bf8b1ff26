"""A dance frame by frame (Fig. 14): stick figures at even intervals, the music's beats, and the joint speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from harmolab.beats.visual import motion_curve
from harmolab.lab.figures.beats import MARK_LOOKS, draw_marks, draw_tolerance, timed_curve
from harmolab.lab.figures.people import draw_film
from harmolab.lab.figures.style import COLOURS, MARKERS, styled_axes
from harmolab.score import HarmonyScore
from harmolab.types import BeatTrack, Motion
from study.figures.words import listed

FRAMES = 4  # between two pictures of the paper's Fig. 14, at 15 frames per second
HEIGHT = 92.0  # points, of a stick figure


def sheet_times(motion: Motion, *, every: int = FRAMES) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Seconds of every `every`-th frame.

    Raises
    ------
    ValueError
        If `every` is not positive.
    """
    if every < 1:
        raise ValueError(f"every must be one frame or more, got {every}")
    return np.arange(0, motion.n_frames, every) / motion.fps


def draw_sheet(ax: Axes, motion: Motion, beats: BeatTrack, *, every: int = FRAMES) -> Axes:
    """Stick figures along time, one every few frames, over bars at the music's beats.

    Parameters
    ----------
    ax : Axes with time on the x axis
    motion : Motion, at 15 frames per second if it is to be compared with Fig. 14
    beats : BeatTrack on the motion's time line
    every : int, frames from one figure to the next
    """
    for time in beats.times:
        ax.axvline(time, color=COLOURS["audio"], linewidth=3.5, alpha=0.55, zorder=0, gid="beat")
    span = (-0.5 * every / motion.fps, motion.duration)
    return draw_film(ax, motion, sheet_times(motion, every=every), span, height=HEIGHT)


def draw_speed(ax: Axes, motion: Motion, score: HarmonyScore, *, start: float = 0.0, top: float | None = None) -> Axes:
    """The curve that visual beats are read from, those beats, and the hits and misses of the music's beats.

    Parameters
    ----------
    ax : Axes with time on the x axis
    motion : Motion
    score : HarmonyScore of the motion from `start` on
    start : float, seconds of the motion's time line at which the score's begins; nothing before it is judged
    top : float, end of the y axis; one and a half times the highest speed when left out
    """
    params = score.params
    seconds, curve = timed_curve(motion, params)
    top = top or 1.5 * max(float(curve.max(initial=0.0)), 1e-9)
    music, visual = score.music.times + start, score.visual.times + start
    draw_tolerance(ax, music + params.lag, params.reaction_delay, reach=top)
    ax.plot(seconds, curve, color=COLOURS["visual"], linewidth=1.4, zorder=2)
    ax.plot(
        visual, np.interp(visual, seconds, curve), linestyle="none", marker=MARKERS["visual"], markersize=7,
        color=COLOURS["visual"], markeredgecolor="white", markeredgewidth=0.6, zorder=3, label="visual beat",
    )  # fmt: skip
    draw_marks(ax, music, np.full(music.size, 0.85 * top), score.pairs >= 0)
    ax.set(xlim=(0.0, motion.duration), ylim=(0.0, top))
    ax.yaxis.set_major_locator(MaxNLocator(3))
    return ax


def dance_figure(
    motions: Mapping[str, Motion],
    beats: BeatTrack,
    scores: Mapping[str, HarmonyScore],
    *,
    start: float = 0.0,
    titles: Mapping[str, str] | None = None,
) -> Figure:
    """Several dances to the same music: frames over the music's beats, and under them the speed with hits and misses.

    Parameters
    ----------
    motions : name -> Motion, all on the time line of the beats
    beats : BeatTrack
    scores : the same names -> HarmonyScore of the motion from `start` on
    start : float, seconds; what comes before is shaded: it is input of the generator, and not judged
    titles : name -> title above its frames; the name alone when left out
    """
    longest = max(motion.duration for motion in motions.values())
    top = 1.5 * max(float(motion_curve(motion, scores[name].params)[0].max()) for name, motion in motions.items())
    size = (float(np.clip(2.7 * longest, 9.0, 11.0)), 2.5 * len(motions) + 0.9)
    ratios = [1.7, 0.8] * len(motions)
    with styled_axes(size, len(ratios), sharex=True, height_ratios=ratios) as (figure, axes):
        for (name, motion), sheet, speed in zip(motions.items(), axes[::2], axes[1::2], strict=True):
            draw_sheet(sheet, motion, beats).set_title((titles or {}).get(name, name))
            draw_speed(speed, motion, scores[name], start=start, top=top).set_ylabel("m/s")
            for ax in (sheet, speed):
                ax.axvspan(-1.0, start, color=COLOURS["faint"], alpha=0.5, linewidth=0, zorder=-1)
        figure.suptitle(_claim(scores, titles or {}), x=0.01, ha="left", fontsize=12)
        axes[-1].set(xlabel="time (s)", xlim=(-0.5 * FRAMES / motion.fps, longest))
        axes[-1].legend(handles=_legend(FRAMES / motion.fps), loc="upper center", bbox_to_anchor=(0.5, -0.6), ncols=3)
    return figure


def _claim(scores: Mapping[str, HarmonyScore], titles: Mapping[str, str]) -> str:
    """Names of those that meet the most beats, and the number of these."""
    met = {name: int(score.hits.sum()) for name, score in scores.items()}
    most = max(met.values())
    best = [titles.get(name, name).split(":")[0] for name, hits in met.items() if hits == most]
    beats = next(iter(scores.values())).n_audio
    only = "Only " if len(best) == 1 < len(met) else ""
    return f"{only}{listed(best)}: {most} of {beats} beats met" if most else f"Nobody meets one of {beats} beats"


def _legend(interval: float) -> list[Line2D | Patch]:
    """An entry for each kind of mark, and for poses `interval` seconds apart."""
    return [
        Line2D([], [], color=COLOURS["audio"], linewidth=3.5, alpha=0.55, label="music beat"),
        Line2D([], [], color=COLOURS["visual"], marker=MARKERS["visual"], label="joint speed, added up; its valleys"),
        Line2D([], [], **MARK_LOOKS["hit"], label="beat met"),
        Line2D([], [], **{**MARK_LOOKS["miss"], "markersize": 6}, label="missed"),
        Patch(facecolor=COLOURS["faint"], alpha=0.5, label="given (last meter)"),
        Line2D([], [], color=COLOURS["ink"], label=f"pose, one every {interval:.2f} s"),
    ]
