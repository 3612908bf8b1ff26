"""The saliency lab: which beats of the music and of the dance would be noticed (Eq. 10-13)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from harmolab.beats.saliency import audio_mask, normalise_strengths, strength_steps, visual_mask
from harmolab.beats.visual import visual_beats
from harmolab.lab.figures.beats import draw_stems, draw_threshold
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.lab import Lab, menu, slider, start_at
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes
from harmolab.params import CHOICES, HarmonyParams
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray

# Music above, dance below, on one time line; at their right, how many are kept at every threshold.
PLACES = ((0.085, 0.53, 0.57, 0.345), (0.085, 0.1, 0.57, 0.345), (0.735, 0.1, 0.245, 0.71))
LAMBDAS = np.linspace(0.0, 8.0, 81)


def saliency_lab(clip: Clip, **values: Any) -> Lab:
    """Sliders for λ1 and λ2 and menus for the readings of Eq. 10-13, above what is kept and what is dropped.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    **values
        Where controls start instead of at the paper mode: ``lambda2=2.0``.

    Examples
    --------
    >>> lab = saliency_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["lambda1"].value = 3.0  # doctest: +SKIP
    """
    paper = HarmonyParams.paper()
    controls = {
        "lambda1": slider("λ1 (music)", 0.0, 8.0, 0.1, paper.audio_threshold),
        "lambda2": slider("λ2 (dance)", 0.0, 3.0, 0.1, paper.visual_threshold or 0.0),
        "normalisation": menu("normalisation", CHOICES["normalisation"], paper.normalisation),
        "saliency": menu("saliency", CHOICES["saliency"], paper.saliency),
        "visual_saliency": menu("dance compares", CHOICES["visual_saliency"], paper.visual_saliency),
        "first_beat": menu("first beat", CHOICES["first_beat"], paper.first_beat),
    }
    stage = Stage.of(clip)
    draw = partial(draw_saliency_lab, stage, visual_beats(stage.motion, params=paper))
    return Lab(draw, saliency_params, **start_at(controls, values))


def saliency_params(*, lambda1: float, lambda2: float, **readings: Any) -> HarmonyParams:
    """The paper's settings but for those on the lab's controls; λ2 = 0 keeps every visual beat."""
    return replace(HarmonyParams.paper(), audio_threshold=lambda1, visual_threshold=lambda2 or None, **readings)


def draw_saliency_lab(stage: Stage, visual: BeatTrack, *, figure: Figure | None = None, **values: Any) -> Figure:
    """The lab's picture: strengths with their thresholds, kept in colour and dropped in grey, and the share kept.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    figure : Figure, optional, drawn on if given
    **values
        The arguments of `saliency_params`.
    """
    params = saliency_params(**values)
    shown = Figure() if figure is None else figure
    above, below, right, board = shown.axes or placed_axes(shown, (10.0, 5.6), PLACES)
    loud = normalise_strengths(stage.music.strengths, params.normalisation)
    steps = strength_steps(visual.strengths)
    compared = visual.strengths if params.visual_saliency == "strength" else steps
    heard = audio_mask(loud, params.audio_threshold, reading=params.saliency)
    seen = _visual_mask(visual, params, params.visual_threshold)
    spreads = float(loud.std()) if loud.size else 0.0, float(steps[1:].std()) if steps.size > 1 else 0.0
    _draw_track(above, stage.music, loud, heard, _level(params, params.audio_threshold, spreads[0]), kind="audio")
    _draw_track(below, visual, compared, seen, _level(params, params.visual_threshold, spreads[1]), kind="visual")
    unit = {"max": "of the largest", "mean": "of the mean", "raw": "as measured"}[params.normalisation]
    above.set(ylabel=f"strength ({unit})", xlabel="dotted line: threshold   |   grey, dotted: not noticed")
    what = "joint speed" if params.visual_saliency == "strength" else "step in joint speed"
    below.set(ylabel=f"{what} (m/s)", xlabel=stage.time_label)
    for ax in (above, below):
        ax.set_xlim(0.0, stage.motion.duration)
    _draw_shares_kept(right, loud, visual, params)
    draw_board(board, _numbers(heard, seen, spreads))
    return shown


def _visual_mask(visual: BeatTrack, params: HarmonyParams, threshold: float | None) -> BoolArray:
    return visual_mask(
        visual.strengths, threshold, reading=params.saliency, quantity=params.visual_saliency,
        first_beat=params.first_beat,
    )  # fmt: skip


def _level(params: HarmonyParams, threshold: float | None, spread: float) -> float:
    """Where the threshold lies: λ standard deviations, or one whatever λ in the formula as printed."""
    return spread if params.saliency == "literal" else (threshold or 0.0) * spread


def _draw_track(ax: Axes, track: BeatTrack, heights: FloatArray, kept: BoolArray, level: float, *, kind: str) -> None:
    """One track's stems, from the line on: the music's up, the dance's down."""
    draw_stems(ax, track.select(~kept), kind=kind, heights=heights[~kept], ignored=True)
    draw_stems(ax, track.select(kept), kind=kind, heights=heights[kept])
    draw_threshold(ax, level, kind=kind)
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    reach = 1.1 * max(float(heights.max(initial=0.0)), 1e-12)
    ax.set_ylim((0.0, reach) if kind == "audio" else (-reach, 0.0))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{abs(value):g}"))


def _draw_shares_kept(ax: Axes, loud: FloatArray, visual: BeatTrack, params: HarmonyParams) -> None:
    """Share of beats kept at every λ, and where the sliders stand."""
    curves = {
        "audio": [audio_mask(loud, value, reading=params.saliency).mean() for value in LAMBDAS] if loud.size else [],
        "visual": [_visual_mask(visual, params, value or None).mean() for value in LAMBDAS] if len(visual) else [],
    }
    stand = {"audio": params.audio_threshold, "visual": params.visual_threshold or 0.0}
    for kind, name, marker in (("audio", "music: λ1", "o"), ("visual", "dance: λ2", "^")):
        shares = np.asarray(curves[kind])
        if shares.size:
            ax.plot(LAMBDAS, shares, color=COLOURS[kind], linestyle="-" if kind == "audio" else "--")
            here = shares[np.abs(LAMBDAS - stand[kind]).argmin()]
            ax.plot([stand[kind]], [here], marker=marker, markersize=9, color=COLOURS[kind], clip_on=False)
        ax.text(
            0.0 if kind == "audio" else 1.0, 1.02, name, transform=ax.transAxes, va="bottom",
            ha="left" if kind == "audio" else "right", color=COLOURS[kind], fontweight="bold",
        )  # fmt: skip
    ax.set(xlim=(0.0, LAMBDAS[-1]), ylim=(-0.03, 1.03), xlabel="λ (standard deviations)", ylabel="share of beats kept")


def _numbers(heard: BoolArray, seen: BoolArray, spreads: tuple[float, float]) -> dict[str, str]:
    return {
        "music beats kept": f"{heard.sum()}/{heard.size}",
        "SD of their strength": f"{spreads[0]:.2f}",
        "visual beats kept": f"{seen.sum()}/{seen.size}",
        "SD of their steps": f"{spreads[1]:.2f} m/s",
    }
