"""The beat-detector lab: the moments that are visual beats, and the curve from which they are read."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from harmolab.beats.visual import visual_beats
from harmolab.harmony import music_and_motion, nearest_intervals
from harmolab.lab.figures.beats import draw_marks, draw_motion_curve, draw_stems, name_heights
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.figures.timing import signed_offsets
from harmolab.lab.widgets.labs.lab import Lab, setting_controls, with_settings
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray

# The curve over the whole width; below, all beats, and at their right, their distances from the music.
PLACES = ((0.085, 0.47, 0.895, 0.405), (0.085, 0.115, 0.57, 0.25), (0.735, 0.115, 0.245, 0.25))
NEAR = 0.05  # seconds: a planted beat with a detected one this close is a detected beat
BINS = np.linspace(-0.4, 0.4, 33)  # seconds
CONTROLS = ("detector", "fps", "plateau", "smoothing", "position_smoothing", "subframe")


def detector_lab(clip: Clip, *, planted: ArrayLike | None = None, **values: Any) -> Lab:
    """Menus for detector, frame rate and plateau, sliders for both smoothings, above the curve and its beats.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    planted : (P,) array, seconds on the audio's time line, optional
        Where movements truly end, if that is known: circles mark the detected ones, crosses the others.
    **values
        Where controls start instead of at the paper mode: ``detector="valleys"``.

    Examples
    --------
    >>> lab = detector_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["smoothing"].value = 0.05  # doctest: +SKIP
    """
    times = None if planted is None else _on_stage(clip, planted)
    draw = partial(draw_detector_lab, Stage.of(clip), times)
    paper = HarmonyParams.paper()
    return Lab(draw, partial(with_settings, paper), setting_controls(paper, *CONTROLS), values)


def _on_stage(clip: Clip, planted: ArrayLike) -> FloatArray:
    """Planted times on the time line of the stage."""
    times = np.sort(np.asarray(planted, np.float64))
    track = BeatTrack(times, np.ones(times.size), fps=100.0, duration=clip.audio.duration)
    return music_and_motion(replace(clip, beats=track))[0].times


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
        Values of the `CONTROLS`, by name; the paper's when left out.
    """
    params = with_settings(HarmonyParams.paper(), **values)
    figure, (above, below, right, board) = placed_axes(figure, (10.0, 5.6), PLACES)
    visual = visual_beats(stage.motion, params=params)
    draw_motion_curve(above, stage.motion, params, visual)
    above.vlines(stage.music.times, 0.0, above.get_ylim()[1], color=COLOURS["audio"], alpha=0.4, linewidth=1.2)
    key = "orange: curve of the dance, triangle: a visual beat   |   blue line: a music beat"
    above.set(xlim=(0.0, stage.motion.duration), xlabel=key)
    detected = None if planted is None else nearest_intervals(planted, visual.times) <= NEAR
    _draw_side_by_side(below, stage, visual, planted, detected)
    _draw_distances(right, stage.music, visual)
    draw_board(board, _numbers(stage, visual, detected))
    return figure


def _draw_side_by_side(
    ax: Axes, stage: Stage, visual: BeatTrack, planted: FloatArray | None, detected: BoolArray | None
) -> None:
    draw_stems(ax, stage.music, kind="audio")
    draw_stems(ax, visual, kind="visual")
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    name_heights(ax, {-1.5: "" if planted is None else "planted", -0.5: "dance", 0.5: "music"})
    if planted is not None and detected is not None:
        draw_marks(ax, planted, np.full(planted.size, -1.5), detected)
    ax.set(xlim=(0.0, stage.motion.duration), ylim=(-1.1 if planted is None else -1.9, 1.1), xlabel=stage.time_label)


def _draw_distances(ax: Axes, music: BeatTrack, visual: BeatTrack) -> None:
    """Histogram of the seconds from its nearest music beat to each visual beat; beats at random would lie flat."""
    highest = 0
    if len(music) and len(visual):
        counts, edges = np.histogram(-signed_offsets(visual.times, music.times), BINS)
        ax.stairs(counts, edges, fill=True, color=COLOURS["visual"])
        highest = int(counts.max())
    ax.axvline(0.0, color=COLOURS["audio"], linewidth=1.6)
    ax.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    top = 4 * (1 + highest // 4)  # in steps, so that the axis seldom changes
    ax.set(xlim=(BINS[0], BINS[-1]), ylim=(0, top), xlabel="after nearest music beat (s)", ylabel="visual beats")


def _numbers(stage: Stage, visual: BeatTrack, detected: BoolArray | None) -> dict[str, str]:
    distances = nearest_intervals(visual.times, stage.music.times)
    numbers = {
        "visual beats": f"{len(visual)}",
        "music beats": f"{len(stage.music)}",
        "visual beats a second": f"{len(visual) / stage.motion.duration:.1f}",
        "median distance": f"{1000 * np.median(distances):.0f} ms" if len(visual) and len(stage.music) else "–",
    }
    if detected is not None:
        numbers[f"planted, found within {1000 * NEAR:.0f} ms"] = f"{detected.sum()}/{detected.size}"
    return numbers
