"""The scoring lab and the saliency lab: choices of the harmony score, and of its salient beats (Eq. 10-13)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from harmolab.bar_pattern import beat_positions, evaluate_pattern, normalised_speed
from harmolab.beats.saliency import audio_mask, normalise_strengths, strength_steps, visual_mask
from harmolab.beats.visual import visual_beats
from harmolab.harmony import score_harmony, score_motion
from harmolab.lab.figures.beats import (
    draw_curve,
    draw_hits,
    draw_motion_curve,
    draw_rotations,
    draw_shares,
    draw_stems,
    draw_threshold,
)
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.lab import MODES, SCORE_SLIDERS, Lab, menu, setting_controls, with_settings
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes, write_above
from harmolab.params import BarPattern, HarmonyParams
from harmolab.significance import rotations
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray
from harmolab.verdict.judge import Judgement
from harmolab.verdict.place_test import MOMENTS, PlaceTest
from harmolab.verdict.score import HarmonyScore

# Under the pictures; a legend would be drawn anew each time a slider moves.
HITS_KEY = (
    "pale blue: tolerance field   |   circle: hit   |   cross: missed, or left over   |   grey, dotted: not noticed"
)
RANKS_KEY = "rank of each music beat among all moments   |   below, dashed: expected speed of the shape"
# Hits over the whole width; below, the dance's curve and, at its right, the moved music.
PLACES = ((0.085, 0.555, 0.895, 0.32), (0.085, 0.14, 0.57, 0.29), (0.735, 0.14, 0.245, 0.29))
# It asks for no hits, and all beats count alike.
IDLE = MappingProxyType({"recommended": ("detector", "matching", "lambda1", "lambda2", "delay", "beta")})
N_ROTATIONS = 200  # as fine as the eye can tell; more would make the sliders sluggish

# Music above, dance below, on one time line; at their right, the share kept at every threshold.
SALIENCY_PLACES = ((0.085, 0.53, 0.57, 0.345), (0.085, 0.1, 0.57, 0.345), (0.735, 0.1, 0.245, 0.71))
SALIENCY_CONTROLS = ("lambda1", "lambda2", "normalisation", "saliency", "visual_saliency", "first_beat")
LAMBDAS = np.linspace(0.0, 8.0, 81)


def scoring_lab(clip: Clip, *, pattern: BarPattern | None = None, **values: Any) -> Lab:
    """Sliders for λ1, λ2, T_delay, β and lag, menus for mode, detector and matching, above a picture of the score.

    Choosing a mode sets the other controls to its own values; each can be moved away from there.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    pattern : BarPattern, optional
        Movement that the recommended mode expects; rests, hits and half time are tried when left out.
    **values
        Where controls start instead of at the paper mode: ``delay=0.1``; a mode brings its own settings.

    Examples
    --------
    >>> lab = scoring_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    stage = Stage.of(clip, pattern)
    mode = {"mode": menu("mode", tuple(MODES), "paper")}
    controls = mode | setting_controls(MODES["paper"], "detector", "matching", *SCORE_SLIDERS)
    settings = partial(lab_params, pattern=stage.pattern)
    return Lab(partial(draw_lab, stage), settings, controls, values, idle=IDLE)


def lab_params(mode: str, *, pattern: BarPattern | None = None, **values: Any) -> HarmonyParams:
    """A mode's settings but for those of the lab's controls in `values`."""
    params = with_settings(MODES[mode], **values)
    return replace(params, pattern=pattern) if params.measure == "shape" else params


def draw_lab(stage: Stage, *, mode: str = "paper", figure: Figure | None = None, **values: Any) -> Figure:
    """The lab's picture: the pairs of beats, the curve of the dance's beats, and the score if the music were moved.

    Parameters
    ----------
    stage : Stage
    mode : "paper", "recommended" or "valleys"
    figure : Figure, optional, drawn on if given
    **values
        The other arguments of `lab_params`; those of the mode when left out.
    """
    params = lab_params(mode, pattern=stage.pattern, **values)
    figure, (above, below, right, board) = placed_axes(figure, (10.0, 5.6), PLACES)
    draw = _draw_hit_score if params.measure == "hits" else _draw_verdict
    draw_board(board, draw(above, below, right, stage, params))
    below.set_xlim(above.get_xlim())
    below.set_xlabel(stage.time_label)
    return figure


def _number(value: float, form: str) -> str:
    """A number as text; a dash where there is none."""
    return "–" if np.isnan(value) else format(value, form)


def _draw_hit_score(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of Eq. 11-21; returns the score's numbers."""
    visual = visual_beats(stage.motion, params=params)
    score = score_harmony(stage.music, visual, params=params, n_rotations=N_ROTATIONS)
    _draw_beats(above, stage.music, visual, score)
    draw_motion_curve(below, stage.motion, params, visual)
    _draw_moved(right, -rotations(stage.music.duration, score.null.size), score)
    right.set_ylabel("share of strength hit")
    return {
        "harmony h": f"{score.harmony:.2f}",
        "music beats hit": f"{score.hits.sum()}/{score.n_audio}",
        "chance": f"{score.chance:.2f}",
        "above chance": f"{score.harmony_above_chance:+.2f}",
        "p-value": _number(score.p_value, ".3f"),
    }


def _draw_beats(ax: Axes, music: BeatTrack, visual: BeatTrack, score: HarmonyScore) -> None:
    """All beats, their thresholds, and the pairs of the salient ones."""
    params = score.params
    heights, steps = _of_largest(music.strengths), _of_largest(strength_steps(visual.strengths))
    audio, dance = np.isin(music.times, score.music.times), np.isin(visual.times, score.visual.times)
    draw_stems(ax, music.select(~audio), kind="audio", heights=heights[~audio], ignored=True)
    draw_stems(ax, visual.select(~dance), kind="visual", heights=steps[~dance], ignored=True)
    draw_hits(
        ax, score.music, score.visual, score.pairs, delay=params.reaction_delay, lag=params.lag,
        audio_heights=heights[audio], visual_heights=steps[dance],
    )  # fmt: skip
    if heights.size:
        draw_threshold(ax, params.audio_threshold * float(heights.std()), kind="audio")
    if params.visual_threshold is not None and steps.size > 1:
        draw_threshold(ax, params.visual_threshold * float(steps[1:].std()), kind="visual")
    ax.set(ylabel="how noticeable", xlabel=HITS_KEY)


def _of_largest(strengths: FloatArray) -> FloatArray:
    """Strengths as shares of the largest."""
    return strengths / max(float(strengths.max(initial=0.0)), 1e-12)


def _draw_moved(ax: Axes, shifts: FloatArray, score: HarmonyScore) -> None:
    """The null distribution over the shifts behind it, brought to both sides of 0 and put in order."""
    duration = score.music.duration
    around = np.mod(shifts + duration / 2, duration) - duration / 2
    order = np.argsort(around)
    draw_rotations(ax, around[order], score.null[order], observed=score.mean_share, chance=score.chance)


def _draw_verdict(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of the recommended mode: rank of each beat, shape speed, and the verdict under it."""
    score = score_motion(stage.music, stage.motion, params=params)
    judgement = score.judgement
    if judgement is None:
        raise ValueError(f"the measure {params.measure!r} gives no verdict")
    chance = 0.5 if judgement.place is None else score.chance
    alike = replace(score.music, strengths=np.ones(score.n_audio))
    draw_shares(above, alike, score.shares, chance=chance)
    above.set(ylabel="rank of the moment", xlabel=RANKS_KEY)
    _draw_expected(below, stage, params, judgement)
    # A text of its own: a label would have the whole axis drawn anew with each sentence.
    below.text(0.0, -0.34, judgement.verdict, transform=below.transAxes, va="top", fontsize=11)
    if judgement.place is None:
        right.set(xlim=(-0.5, 0.5), ylim=(-0.03, 1.05), xlabel="music moved by (s)")
    else:
        _draw_lags(right, judgement.place, 60 / judgement.tempo)
    right.set_ylabel("mean rank of the beats")
    lag = 1000 * judgement.lag_s if judgement.level >= 3 else float("nan")
    return {
        "level": f"{judgement.level} of 4",
        "H, above chance": _number(judgement.harmony_above_chance, "+.2f"),
        "p in time": _number(judgement.p_time, ".3f"),
        "p in place": _number(judgement.p_place, ".3f"),
        "lag (ms)": _number(lag, "+.0f"),
    }


def _draw_expected(ax: Axes, stage: Stage, params: HarmonyParams, judgement: Judgement) -> None:
    """Shape speed, the music's beats, and the reading that fits best laid on them where its place is known."""
    times, speed = normalised_speed(stage.motion, params)
    draw_curve(ax, times, speed)
    pattern = params.pattern or (judgement.place.reading if judgement.place else BarPattern.stop_on_the_beat())
    is_placed = params.pattern is not None and stage.music.bar_places is not None
    if len(stage.music) > 1 and (is_placed or pattern.beats == 1):
        expected = evaluate_pattern(pattern, beat_positions(times - params.lag, stage.music))
        ax.plot(times, 1.5 * expected / max(np.ptp(expected) / 2, 1e-12), color=COLOURS["ink"], linestyle="--")
    high = max(3.0, float(np.abs(speed).max(initial=0.0)))
    ax.vlines(stage.music.times + params.lag, -high, high, color=COLOURS["audio"], alpha=0.35, linewidth=1.2)
    ax.set(ylim=(-high, high), ylabel="shape speed (SD)")


def _draw_lags(ax: Axes, place: PlaceTest, period: float) -> None:
    """Mean rank of the beats at every lag of one cycle, the lags brought to both sides of 0."""
    moments = np.arange(place.curve.size)
    lags = (moments + moments.size // 2) % moments.size - moments.size // 2
    order = np.argsort(lags)
    shifts = lags[order] / MOMENTS * period
    draw_rotations(ax, shifts, place.curve[order], observed=float(place.curve[0]), chance=place.chance)


def saliency_lab(clip: Clip, **values: Any) -> Lab:
    """Sliders for λ1 and λ2 and menus for the readings of Eq. 10-13, above the beats that are kept and dropped.

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
    stage = Stage.of(clip)
    paper = HarmonyParams.paper()
    draw = partial(draw_saliency_lab, stage, visual_beats(stage.motion, params=paper))
    return Lab(draw, partial(with_settings, paper), setting_controls(paper, *SALIENCY_CONTROLS), values)


def draw_saliency_lab(stage: Stage, visual: BeatTrack, *, figure: Figure | None = None, **values: Any) -> Figure:
    """The lab's picture: strengths with their thresholds, kept in colour and dropped in grey, and the share kept.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    figure : Figure, optional, drawn on if given
    **values
        Values of the other `SALIENCY_CONTROLS`, by name; the paper's when left out.
    """
    params = with_settings(HarmonyParams.paper(), **values)
    figure, (above, below, right, board) = placed_axes(figure, (10.0, 5.6), SALIENCY_PLACES)
    heights = normalise_strengths(stage.music.strengths, params.normalisation)
    steps = strength_steps(visual.strengths)
    by_strength = params.visual_saliency == "strength"
    audio = audio_mask(heights, params.audio_threshold, reading=params.saliency)
    dance = _visual_mask(visual, params, params.visual_threshold)
    spreads = float(heights.std()) if heights.size else 0.0, float(steps[1:].std()) if steps.size > 1 else 0.0
    levels = _level(params, params.audio_threshold, spreads[0]), _level(params, params.visual_threshold, spreads[1])
    _draw_track(above, stage.music, heights, audio, levels[0], kind="audio")
    _draw_track(below, visual, visual.strengths if by_strength else steps, dance, levels[1], kind="visual")
    unit = {"max": "of the largest", "mean": "of the mean", "raw": "as measured"}[params.normalisation]
    above.set(ylabel=f"strength ({unit})", xlabel="dotted line: threshold   |   grey, dotted: not noticed")
    below.set(ylabel=f"{'' if by_strength else 'step in '}joint speed (m/s)", xlabel=stage.time_label)
    for ax in (above, below):
        ax.set_xlim(0.0, stage.motion.duration)
    _draw_shares_kept(right, heights, visual, params)
    draw_board(board, _saliency_numbers(audio, dance, spreads))
    return figure


def _visual_mask(visual: BeatTrack, params: HarmonyParams, threshold: float | None) -> BoolArray:
    return visual_mask(
        visual.strengths, threshold, reading=params.saliency, quantity=params.visual_saliency,
        first_beat=params.first_beat,
    )  # fmt: skip


def _level(params: HarmonyParams, threshold: float | None, spread: float) -> float:
    """Height of the threshold: λ standard deviations, or one whatever λ in the formula as printed."""
    return spread if params.saliency == "literal" else (threshold or 0.0) * spread


def _draw_track(ax: Axes, track: BeatTrack, heights: FloatArray, mask: BoolArray, level: float, *, kind: str) -> None:
    """One track's stems, from the line on: the music's up, the dance's down."""
    draw_stems(ax, track.select(~mask), kind=kind, heights=heights[~mask], ignored=True)
    draw_stems(ax, track.select(mask), kind=kind, heights=heights[mask])
    draw_threshold(ax, level, kind=kind)
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    reach = 1.1 * max(float(heights.max(initial=0.0)), 1e-12)
    ax.set_ylim((0.0, reach) if kind == "audio" else (-reach, 0.0))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{abs(value):g}"))


def _draw_shares_kept(ax: Axes, heights: FloatArray, visual: BeatTrack, params: HarmonyParams) -> None:
    """Share of beats kept at every λ, with a mark at the λ of `params`."""
    music = [audio_mask(heights, value, reading=params.saliency).mean() for value in LAMBDAS] if heights.size else []
    dance = [_visual_mask(visual, params, value or None).mean() for value in LAMBDAS] if len(visual) else []
    for kind, name, shares, value, look, side in (
        ("audio", "music: λ1", music, params.audio_threshold, "-o", "left"),
        ("visual", "dance: λ2", dance, params.visual_threshold or 0.0, "--^", "right"),
    ):
        if shares:
            nearest = int(np.abs(LAMBDAS - value).argmin())
            ax.plot(LAMBDAS, shares, look[:-1], color=COLOURS[kind])
            ax.plot([value], [shares[nearest]], look[-1], markersize=9, color=COLOURS[kind], clip_on=False)
        write_above(ax, name, side=side, color=COLOURS[kind], fontweight="bold")
    ax.set(xlim=(0.0, LAMBDAS[-1]), ylim=(-0.03, 1.03), xlabel="λ (standard deviations)", ylabel="share of beats kept")


def _saliency_numbers(audio: BoolArray, dance: BoolArray, spreads: tuple[float, float]) -> dict[str, str]:
    return {
        "music beats kept": f"{audio.sum()}/{audio.size}",
        "SD of their strength": f"{spreads[0]:.2f}",
        "visual beats kept": f"{dance.sum()}/{dance.size}",
        "SD of their steps": f"{spreads[1]:.2f} m/s",
    }
