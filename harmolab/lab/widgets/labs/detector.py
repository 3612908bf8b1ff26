"""The beat-detector lab: what is taken for a visual beat, and how the curve is made that the beats are read from."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator
from numpy.typing import ArrayLike, NDArray

from harmolab.beats.visual import motion_curve, visual_beats
from harmolab.harmony import music_and_motion, nearest_intervals
from harmolab.lab.figures.beats import draw_curve, draw_marks, draw_stems
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.figures.timing import signed_offsets
from harmolab.lab.widgets.labs.lab import Lab, menu, slider, start_at
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes
from harmolab.params import CHOICES, HarmonyParams
from harmolab.types import BeatTrack, Clip, FloatArray

# The curve over the whole width; below, who is where, and at its right, how far from the music.
PLACES = ((0.085, 0.47, 0.895, 0.405), (0.085, 0.115, 0.57, 0.25), (0.735, 0.115, 0.245, 0.25))
FOUND = 0.05  # seconds: a planted beat with a detected one this close counts as found
BINS = np.linspace(-0.4, 0.4, 33)  # seconds
RATES = (("its own", None), ("60", 60.0), ("30", 30.0), ("25", 25.0), ("15", 15.0), ("10", 10.0))


def detector_lab(clip: Clip, *, planted: ArrayLike | None = None, **values: Any) -> Lab:
    """Menus for detector, frame rate and plateau, sliders for both smoothings, above the curve and its beats.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    planted : (P,) array, seconds on the audio's time line, optional
        When movements really end, where somebody knows: circles and crosses tell which of them were found.
    **values
        Where controls start instead of at the paper mode: ``detector="valleys"``.

    Examples
    --------
    >>> lab = detector_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["smoothing"].value = 0.05  # doctest: +SKIP
    """
    paper = HarmonyParams.paper()
    controls = {
        "detector": menu("detector", CHOICES["detector"], paper.detector),
        "fps": menu("frames a second", RATES, paper.fps),
        "plateau": menu("plateau", CHOICES["plateau"], paper.plateau),
        "smoothing": slider("speed σ (s)", 0.0, 0.3, 0.01, paper.smoothing),
        "position_smoothing": slider("position σ (s)", 0.0, 0.3, 0.01, paper.position_smoothing),
        "subframe": menu("beats", (("on frames", False), ("between frames", True)), paper.subframe),
    }
    truth = None if planted is None else _on_stage(clip, planted)
    return Lab(
        partial(draw_detector_lab, Stage.of(clip), truth),
        detector_params,
        **start_at(controls, values),
    )


def _on_stage(clip: Clip, planted: ArrayLike) -> FloatArray:
    """Planted times on the time line of the stage."""
    times = np.sort(np.asarray(planted, np.float64))
    track = BeatTrack(times, np.ones(times.size), fps=100.0, duration=clip.audio.duration)
    return music_and_motion(replace(clip, beats=track))[0].times


def detector_params(**values: Any) -> HarmonyParams:
    """The paper's settings but for those on the lab's controls."""
    return replace(HarmonyParams.paper(), **values)


def draw_detector_lab(
    stage: Stage, planted: FloatArray | None = None, *, figure: Figure | None = None, **values: Any
) -> Figure:
    """The lab's picture: the curve with its beats, all beats side by side, and their distances from the music.

    Parameters
    ----------
    stage : Stage
    planted : (P,) array, seconds on the stage's time line, optional
    figure : Figure, optional, drawn on if given
    **values
        The arguments of `detector_params`.
    """
    params = detector_params(**values)
    shown = Figure() if figure is None else figure
    above, below, right, board = shown.axes or placed_axes(shown, (10.0, 5.6), PLACES)
    found = visual_beats(stage.motion, params=params)
    curve, fps = motion_curve(stage.motion, params)
    draw_curve(above, (np.arange(curve.size) - 0.5 * params.subframe) / fps, curve, found)
    above.vlines(stage.music.times, 0.0, above.get_ylim()[1], color=COLOURS["audio"], alpha=0.4, linewidth=1.2)
    above.set(
        xlim=(0.0, stage.motion.duration),
        xlabel="orange: curve of the dance, triangle: a visual beat   |   blue line: a music beat",
        ylabel="change of direction (SD)" if params.detector == "direction" else "joint speed (m/s)",
    )
    met = None if planted is None else nearest_intervals(planted, found.times) <= FOUND
    _draw_side_by_side(below, stage, found, planted, met)
    _draw_distances(right, stage.music, found)
    draw_board(board, _numbers(stage, found, met))
    return shown


def _draw_side_by_side(
    ax: Axes, stage: Stage, found: BeatTrack, planted: FloatArray | None, met: NDArray[np.bool_] | None
) -> None:
    draw_stems(ax, stage.music, kind="audio")
    draw_stems(ax, found, kind="visual")
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.yaxis.set_major_locator(FixedLocator([-1.5, -0.5, 0.5]))
    ax.yaxis.set_major_formatter(FixedFormatter(["" if planted is None else "planted", "dance", "music"]))
    ax.tick_params(axis="y", length=0)
    if planted is not None and met is not None:
        draw_marks(ax, planted, np.full(planted.size, -1.5), met)
    ax.set(xlim=(0.0, stage.motion.duration), ylim=(-1.1 if planted is None else -1.9, 1.1), xlabel=stage.time_label)


def _draw_distances(ax: Axes, music: BeatTrack, found: BeatTrack) -> None:
    """Histogram of how long after its nearest music beat each visual beat comes; beats at random would lie flat."""
    tall = 0
    if len(music) and len(found):
        counts, edges = np.histogram(-signed_offsets(found.times, music.times), BINS)
        ax.stairs(counts, edges, fill=True, color=COLOURS["visual"])
        tall = int(counts.max())
    ax.axvline(0.0, color=COLOURS["audio"], linewidth=1.6)
    ax.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    top = 4 * (1 + tall // 4)  # in steps, so that the axis seldom changes
    ax.set(xlim=(BINS[0], BINS[-1]), ylim=(0, top), xlabel="after nearest music beat (s)", ylabel="visual beats")


def _numbers(stage: Stage, found: BeatTrack, met: NDArray[np.bool_] | None) -> dict[str, str]:
    distances = nearest_intervals(found.times, stage.music.times)
    numbers = {
        "visual beats": f"{len(found)}",
        "music beats": f"{len(stage.music)}",
        "visual beats a second": f"{len(found) / stage.motion.duration:.1f}",
        "median distance": f"{1000 * np.median(distances):.0f} ms" if len(found) and len(stage.music) else "–",
    }
    if met is not None:
        numbers[f"planted, found within {1000 * FOUND:.0f} ms"] = f"{met.sum()}/{met.size}"
    return numbers
