"""The scoring lab: every choice of the harmony score on a control, and one picture that shows what it does."""

from __future__ import annotations

from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.bar_pattern import beat_positions, evaluate_pattern, normalised_speed
from harmolab.beats.saliency import strength_steps
from harmolab.beats.visual import motion_curve, visual_beats
from harmolab.harmony import score_harmony, score_motion
from harmolab.lab.figures.beats import draw_curve, draw_hits, draw_rotations, draw_shares, draw_stems, draw_threshold
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.lab import (
    MODES,
    Lab,
    ModeLab,
    menu,
    score_params,
    score_presets,
    score_sliders,
    start_at,
)
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.significance import rotations
from harmolab.types import BeatTrack, Clip, FloatArray, HarmonyScore

# Under the pictures; a legend would be made and drawn anew each time a slider moves.
HITS_KEY = (
    "pale blue: tolerance field   |   circle: hit   |   cross: missed, or left over   |   grey, dotted: not noticed"
)
RANKS_KEY = "rank of each music beat among all moments   |   wider if stronger   |   below, dashed: expected speed"
# Hits over the whole width; below, the dance's curve and, at its right, the moved music.
PLACES = ((0.085, 0.535, 0.895, 0.34), (0.085, 0.1, 0.57, 0.31), (0.735, 0.1, 0.245, 0.31))
IDLE = MappingProxyType({"recommended": ("matching", "lambda2", "delay")})  # it asks for no hits
N_ROTATIONS = 200  # as fine as the eye can tell; more would make the sliders sluggish


def scoring_lab(clip: Clip, *, pattern: BarPattern | None = None, **values: Any) -> Lab:
    """Sliders for λ1, λ2, T_delay, β and lag, menus for mode, detector and matching, above a picture of the score.

    Choosing a mode sets the other controls to what that mode uses; each can be moved away from there.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    pattern : BarPattern, optional
        What the recommended mode expects of the dance; movements that stop on the beat when left out.
    **values
        Where controls start instead of at the paper mode: ``delay=0.1``; a mode brings its own settings.

    Examples
    --------
    >>> lab = scoring_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    stage = Stage.of(clip, pattern)
    controls = start_at(_controls(), values, _presets)
    settings = partial(lab_params, pattern=stage.pattern)
    return ModeLab(partial(draw_lab, stage), settings, _presets, IDLE, **controls)


def _controls() -> dict[str, Any]:
    """The lab's widgets, at the paper mode."""
    start = _presets("paper")
    return {
        "mode": menu("mode", tuple(MODES), "paper"),
        "detector": menu("detector", CHOICES["detector"], start["detector"]),
        "matching": menu("matching", CHOICES["matching"], start["matching"]),
        **score_sliders("paper"),
    }


def _presets(mode: str) -> dict[str, Any]:
    """What a mode sets the other controls to."""
    return {"detector": MODES[mode].detector, "matching": MODES[mode].matching, **score_presets(mode)}


def lab_params(mode: str, *, pattern: BarPattern | None = None, **values: Any) -> HarmonyParams:
    """The settings that the lab's controls stand for: detector, matching, and those of `score_params`."""
    return score_params(mode, pattern=pattern or BarPattern.stop_on_the_beat(), **values)


def draw_lab(stage: Stage, *, mode: str = "paper", figure: Figure | None = None, **values: Any) -> Figure:
    """The lab's picture: who meets whom, the curve the dance's beats come from, and the score if the music were moved.

    Parameters
    ----------
    stage : Stage
    mode : "paper", "recommended" or "valleys"
    figure : Figure, optional, drawn on if given
    **values
        The other arguments of `lab_params`; those of the mode when left out.
    """
    params = lab_params(mode, **{**_presets(mode), **values}, pattern=stage.pattern)
    shown = Figure() if figure is None else figure
    above, below, right, board = shown.axes or placed_axes(shown, (10.0, 5.6), PLACES)
    draw = _draw_hit_score if params.measure == "hits" else _draw_pattern_score
    draw_board(board, draw(above, below, right, stage, params))
    below.set_xlim(above.get_xlim())
    below.set_xlabel(stage.time_label)
    return shown


def _numbers(score: HarmonyScore, *, met: str) -> dict[str, str]:
    """The score by the names of its parts."""
    return {
        "harmony h": f"{score.harmony:.2f}",
        f"music beats {met}": f"{score.hits.sum()}/{score.n_audio}",
        "chance": f"{score.chance:.2f}",
        "above chance": f"{score.harmony_above_chance:+.2f}",
        "p-value": "–" if np.isnan(score.p_value) else f"{score.p_value:.3f}",
    }


def _draw_hit_score(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of Eq. 11-21; returns the score's numbers."""
    visual = visual_beats(stage.motion, params=params)
    score = score_harmony(stage.music, visual, params=params, n_rotations=N_ROTATIONS)
    _draw_beats(above, stage.music, visual, score)
    curve, fps = motion_curve(stage.motion, params)
    draw_curve(below, (np.arange(curve.size) - 0.5 * params.subframe) / fps, curve, visual)
    below.set_ylabel("change of direction (SD)" if params.detector == "direction" else "joint speed (m/s)")
    _draw_moved(right, -rotations(stage.music.duration, score.null.size), score)
    right.set_ylabel("share of strength hit")
    return _numbers(score, met="hit")


def _draw_beats(ax: Axes, music: BeatTrack, visual: BeatTrack, score: HarmonyScore) -> None:
    """All beats, their thresholds, and who meets whom among those that are noticed."""
    params = score.params
    loud, steps = _shares(music.strengths), _shares(strength_steps(visual.strengths))
    kept, used = np.isin(music.times, score.music.times), np.isin(visual.times, score.visual.times)
    draw_stems(ax, music.select(~kept), kind="audio", heights=loud[~kept], ignored=True)
    draw_stems(ax, visual.select(~used), kind="visual", heights=steps[~used], ignored=True)
    draw_hits(
        ax, score.music, score.visual, score.pairs, delay=params.reaction_delay, lag=params.lag,
        audio_heights=loud[kept], visual_heights=steps[used],
    )  # fmt: skip
    if len(music):
        draw_threshold(ax, params.audio_threshold * float(loud.std()), kind="audio")
    if params.visual_threshold is not None and len(visual) > 1:
        draw_threshold(ax, params.visual_threshold * float(steps[1:].std()), kind="visual")
    ax.set(ylabel="how noticeable", xlabel=HITS_KEY)


def _shares(strengths: FloatArray) -> FloatArray:
    """Strengths as shares of the largest."""
    return strengths / max(float(strengths.max(initial=0.0)), 1e-12)


def _draw_moved(ax: Axes, shifts: FloatArray, score: HarmonyScore) -> None:
    """The null distribution over the shifts behind it, brought to both sides of 0 and put in order."""
    duration = score.music.duration
    around = np.mod(shifts + duration / 2, duration) - duration / 2
    order = np.argsort(around)
    draw_rotations(ax, around[order], score.null[order], observed=score.share, chance=score.chance)


def _draw_pattern_score(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of the recommended mode: rank of each beat, and the speed with the pattern laid on the beats."""
    times, speed = normalised_speed(stage.motion, params)
    score = score_motion(stage.music, stage.motion, params=params, n_rotations=N_ROTATIONS)
    music = score.music
    passed = stage.music.select(~np.isin(stage.music.times, music.times))
    above.plot(passed.times, np.full(len(passed), score.chance), "|", color=COLOURS["chance"], markersize=10)
    draw_shares(above, music, score.shares, chance=score.chance)
    above.set(ylabel="rank of the moment", xlabel=RANKS_KEY)
    draw_curve(below, times, speed)
    if len(stage.music) > 1 and (stage.music.bar_places is not None or params.pattern.beats == 1):
        expected = evaluate_pattern(params.pattern, beat_positions(times - params.lag, stage.music))
        below.plot(times, 1.5 * expected / max(np.ptp(expected) / 2, 1e-12), color=COLOURS["ink"], linestyle="--")
    high = max(3.0, float(np.abs(speed).max(initial=0.0)))
    below.vlines(music.times, -high, high, color=COLOURS["audio"], alpha=0.35, linewidth=1.2)
    below.set(ylim=(-high, high), ylabel="joint speed (SD)")
    _draw_moved(right, np.linspace(0.0, music.duration, score.null.size, endpoint=False), score)
    right.set_ylabel("mean rank of the beats")
    return _numbers(score, met="that fit")
