"""The scoring lab: every choice of the harmony score on a control, and one picture that shows what it does."""

from __future__ import annotations

from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from harmolab.beats.saliency import salient_audio, salient_visual, strength_steps
from harmolab.beats.visual import motion_curve, visual_beats
from harmolab.harmony import above_chance, harmony_from_hits, hit_pairs, hitting_score, score_harmony
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.pattern import PatternFit, beat_positions, evaluate_pattern, fit_of_speed, normalised_speed
from harmolab.significance import p_value, rotated_shares, rotations
from harmolab.types import BeatTrack, Clip
from harmolab.viz.beats import draw_curve, draw_hits, draw_rotations, draw_shares, draw_stems, draw_threshold
from harmolab.viz.style import COLOURS
from harmolab.widgets.labs.lab import MODES, Lab, ModeLab, menu, score_params, score_presets, score_sliders, start_at
from harmolab.widgets.labs.stage import Stage, draw_board, placed_axes

__all__ = ["N_ROTATIONS", "draw_lab", "lab_params", "scoring_lab"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

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


def _numbers(harmony: float, hits: BoolArray, chance: float, above: float, p: float, *, met: str) -> dict[str, str]:
    """The score by the names of its parts."""
    return {
        "harmony h": f"{harmony:.2f}",
        f"music beats {met}": f"{int(hits.sum())}/{hits.size}",
        "chance": f"{chance:.2f}",
        "above chance": f"{above:+.2f}",
        "p-value": "–" if np.isnan(p) else f"{p:.3f}",
    }


def _draw_hit_score(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of Eq. 11-21; returns the score's numbers."""
    visual = visual_beats(stage.motion, params=params)
    music, dance = salient_audio(stage.music, params), salient_visual(visual, params)
    score = score_harmony(stage.music, visual, params=params, n_rotations=N_ROTATIONS)
    _draw_beats(above, stage.music, visual, params)
    curve, fps = motion_curve(stage.motion, params)
    draw_curve(below, (np.arange(curve.size) - 0.5 * params.subframe) / fps, curve, visual)
    below.set_ylabel("change of direction (SD)" if params.detector == "direction" else "joint speed (m/s)")
    total = max(float(music.strengths.sum()), 1e-12)
    turned = np.sort(np.mod(dance.times - params.lag, music.duration))
    weights = rotated_shares(
        music.times, turned, music.strengths, delay=params.reaction_delay, duration=music.duration, count=N_ROTATIONS
    )
    moved = -rotations(music.duration, N_ROTATIONS)
    _draw_moved(right, moved, weights / total, music.duration, score.hitting_score / total, score.chance)
    right.set_ylabel("share of strength hit")
    return _numbers(score.harmony, score.hits, score.chance, score.harmony_above_chance, score.p_value, met="hit")


def _draw_beats(ax: Axes, music: BeatTrack, visual: BeatTrack, params: HarmonyParams) -> None:
    """All beats, their thresholds, and who meets whom among those that are noticed."""
    heard, seen = salient_audio(music, params), salient_visual(visual, params)
    pairs = hit_pairs(heard.times, seen.times - params.lag, delay=params.reaction_delay, matching=params.matching)
    loud, steps = _shares(music.strengths), _shares(strength_steps(visual.strengths))
    kept, used = np.isin(music.times, heard.times), np.isin(visual.times, seen.times)
    draw_stems(ax, music.select(~kept), kind="audio", heights=loud[~kept], ignored=True)
    draw_stems(ax, visual.select(~used), kind="visual", heights=steps[~used], ignored=True)
    draw_hits(
        ax, heard, seen, pairs, delay=params.reaction_delay, lag=params.lag,
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


def _draw_moved(
    ax: Axes, moved: FloatArray, shares: FloatArray, duration: float, observed: float, chance: float
) -> None:
    """The shifts brought to both sides of 0 and put in order."""
    around = np.mod(moved + duration / 2, duration) - duration / 2
    order = np.argsort(around)
    draw_rotations(ax, around[order], shares[order], observed=observed, chance=chance)


def _draw_pattern_score(above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams) -> dict[str, str]:
    """The picture of the recommended mode: rank of each beat, and the speed with the pattern laid on the beats."""
    times, speed = normalised_speed(stage.motion, params)
    fit = fit_of_speed(stage.music, times, speed, params, n_rotations=N_ROTATIONS)
    music = salient_audio(stage.music, params)
    passed = stage.music.select(~np.isin(stage.music.times, music.times))
    above.plot(passed.times, np.full(len(passed), fit.chance), "|", color=COLOURS["chance"], markersize=10)
    draw_shares(above, music, fit.shares, chance=fit.chance)
    above.set(ylabel="rank of the moment", xlabel=RANKS_KEY)
    draw_curve(below, times, speed)
    if len(stage.music) > 1 and (stage.music.bar_places is not None or params.pattern.beats == 1):
        expected = evaluate_pattern(params.pattern, beat_positions(times - params.lag, stage.music))
        below.plot(times, 1.5 * expected / max(np.ptp(expected) / 2, 1e-12), color=COLOURS["ink"], linestyle="--")
    high = max(3.0, float(np.abs(speed).max(initial=0.0)))
    below.vlines(music.times, -high, high, color=COLOURS["audio"], alpha=0.35, linewidth=1.2)
    below.set(ylim=(-high, high), ylabel="joint speed (SD)")
    length = stage.motion.duration
    moved = np.linspace(0.0, length, fit.null.size, endpoint=False)
    _draw_moved(right, moved, fit.null, length, fit.mean, fit.chance)
    right.set_ylabel("mean rank of the beats")
    return _pattern_numbers(stage, music, fit, params)


def _pattern_numbers(stage: Stage, music: BeatTrack, fit: PatternFit, params: HarmonyParams) -> dict[str, str]:
    """As `harmolab.harmony.score_motion` has it: a beat counts as hit where it fits better than the median moment."""
    hits = fit.shares > 0.5
    n_visual = len(visual_beats(stage.motion, params=params))
    harmony = harmony_from_hits(hitting_score(hits, music.strengths), len(music), n_visual, params.beta)
    above = above_chance(fit.mean, fit.chance) if len(music) else 0.0
    p = p_value(fit.mean, fit.null) if len(music) else float("nan")
    return _numbers(harmony, hits, fit.chance, above, p, met="that fit")
