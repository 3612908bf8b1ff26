"""The scoring lab: every choice of the harmony score on a control, and one picture that shows what it does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from harmolab.beats.audio import audio_beats
from harmolab.beats.saliency import salient_audio, salient_visual, strength_steps
from harmolab.beats.visual import motion_curve, visual_beats
from harmolab.harmony import hit_pairs, overlap, score_motion
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.pattern import PatternFit, beat_positions, evaluate_pattern, fit_of_motion, normalised_speed
from harmolab.significance import rotated_shares, rotations
from harmolab.types import BeatTrack, Clip, HarmonyScore, Motion
from harmolab.viz.beats import draw_curve, draw_hits, draw_rotations, draw_shares, draw_stems, draw_threshold
from harmolab.viz.style import COLOURS
from harmolab.widgets.explorer import Explorer

__all__ = ["Stage", "draw_lab", "lab_params", "scoring_lab"]

FloatArray = NDArray[np.float64]

MODES = MappingProxyType(
    {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(), "valleys": HarmonyParams.valleys()}
)
N_ROTATIONS = 200  # as fine as the eye can tell; more would make the sliders sluggish


@dataclass(frozen=True, eq=False)
class Stage:
    """What the lab plays with: music beats and motion on one time line, and the bar pattern of the recommended mode."""

    music: BeatTrack
    motion: Motion
    pattern: BarPattern

    @classmethod
    def of(cls, clip: Clip, pattern: BarPattern | None = None) -> Stage:
        """The part of a clip where music and motion overlap; its own beats, else those tracked in its audio.

        Raises
        ------
        ValueError
            If the clip has no motion.
        """
        track = audio_beats(clip.audio) if clip.beats is None else clip.beats
        return cls(*overlap(clip, track), pattern or BarPattern.stop_on_the_beat())


def scoring_lab(clip: Clip, *, pattern: BarPattern | None = None, **values: Any) -> Explorer:
    """Sliders for λ1, λ2, T_delay, β and lag, menus for mode, detector and matching, above a picture of the score.

    Choosing a mode sets the other controls to what that mode uses; each can be moved away from there.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    pattern : BarPattern, optional
        What the recommended mode expects of the dance; movements that stop on the beat when left out.
    **values
        Where controls start instead of at the paper mode: ``delay=0.1``.

    Examples
    --------
    >>> lab = scoring_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    controls = _controls()
    unknown = set(values) - set(controls)
    if unknown:
        raise ValueError(f"no control {', '.join(sorted(unknown))}; there are {', '.join(controls)}")
    for name, value in values.items():
        controls[name].value = value
    return _ModeExplorer(partial(draw_lab, Stage.of(clip, pattern)), **controls)


class _ModeExplorer(Explorer):
    """An Explorer whose other controls follow the mode, with one new picture for all of them."""

    _following = False

    def _redraw(self, change: Any = None) -> None:
        if self._following:
            return
        if change is not None and change["owner"] is self._controls["mode"]:
            self._following = True
            try:
                for name, value in _presets(change["new"]).items():
                    self._controls[name].value = value
            finally:
                self._following = False
        super()._redraw(change)


def _controls() -> dict[str, Any]:
    """The lab's widgets, at the paper mode."""
    start = _presets("paper")
    look: dict[str, Any] = {"style": {"description_width": "5.5em"}, "layout": {"width": "22em"}}
    menus = {"mode": tuple(MODES), "detector": CHOICES["detector"], "matching": CHOICES["matching"]}
    sliders = {
        "lambda1": ("λ1 (music)", 0.0, 4.0, 0.1),
        "lambda2": ("λ2 (dance)", 0.0, 3.0, 0.1),
        "delay": ("T_delay (s)", 0.0, 0.5, 0.01),
        "beta": ("β", 0.25, 4.0, 0.25),
        "lag": ("lag (s)", -0.4, 0.4, 0.02),
    }
    made: dict[str, Any] = {
        name: widgets.Dropdown(options=options, value=start.get(name, "paper"), description=name, **look)
        for name, options in menus.items()
    }
    for name, (label, low, high, step) in sliders.items():
        made[name] = widgets.FloatSlider(
            value=start[name], min=low, max=high, step=step, description=label, readout_format=".2f", **look
        )
    return made


def _presets(mode: str) -> dict[str, Any]:
    """What a mode sets the other controls to."""
    params = MODES[mode]
    return {
        "detector": params.detector,
        "matching": params.matching,
        "lambda1": params.audio_threshold,
        "lambda2": params.visual_threshold or 0.0,
        "delay": params.reaction_delay,
        "beta": params.beta,
        "lag": params.lag,
    }


def lab_params(
    mode: str,
    *,
    detector: str,
    matching: str,
    lambda1: float,
    lambda2: float,
    delay: float,
    beta: float,
    lag: float,
    pattern: BarPattern | None = None,
) -> HarmonyParams:
    """The settings that the lab's controls stand for; λ2 = 0 keeps every visual beat."""
    choices: dict[str, Any] = {"detector": detector, "matching": matching}
    return replace(
        MODES[mode],
        **choices,
        audio_threshold=lambda1,
        visual_threshold=lambda2 or None,
        reaction_delay=delay,
        beta=beta,
        lag=lag,
        pattern=pattern or BarPattern.stop_on_the_beat(),
    )


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
    above, below, right = shown.axes or _three_axes(shown)
    score = score_motion(stage.music, stage.motion, params=params, n_rotations=N_ROTATIONS)
    if params.measure == "hits":
        _draw_hit_score(above, below, right, stage, params, score)
    else:
        _draw_pattern_score(above, below, right, stage, params, score)
    above.set_title(_headline(score, params))
    above.set_xlabel("")
    above.legend(
        loc="upper left", bbox_to_anchor=(0.0, -0.09), ncols=7, fontsize=9, columnspacing=1.2, handletextpad=0.5
    )
    right.set_title("if the music were moved")
    below.set_xlim(above.get_xlim())
    return shown


def _three_axes(figure: Figure) -> list[Axes]:
    """Hits over the whole width; below, the dance's curve and, at its right, the moved music."""
    figure.set_size_inches(10.0, 5.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.4, 1.0), height_ratios=(1.15, 1.0))
    return [figure.add_subplot(place) for place in (grid[0, :], grid[1, 0], grid[1, 1])]


def _headline(score: HarmonyScore, params: HarmonyParams) -> str:
    """The score in one line."""
    met = "hit" if params.measure == "hits" else "fit"
    facts = [
        f"harmony h = {score.harmony:.2f}",
        f"{int(score.hits.sum())} of {score.n_audio} music beats {met}",
        f"chance {score.chance:.2f}",
        f"above chance {score.harmony_above_chance:+.2f}",
    ]
    return "  |  ".join(facts if np.isnan(score.p_value) else [*facts, f"p = {score.p_value:.3f}"])


def _draw_hit_score(
    above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams, score: HarmonyScore
) -> None:
    """The picture of Eq. 11-21."""
    visual = visual_beats(stage.motion, params=params)
    music, dance = salient_audio(stage.music, params), salient_visual(visual, params)
    pairs = hit_pairs(music.times, dance.times - params.lag, delay=params.reaction_delay, matching=params.matching)
    heights = {"audio": _shares(stage.music.strengths), "visual": _shares(strength_steps(visual.strengths))}
    kept = {"audio": np.isin(stage.music.times, music.times), "visual": np.isin(visual.times, dance.times)}
    for kind, track in (("audio", stage.music), ("visual", visual)):
        passed = ~kept[kind]
        draw_stems(above, track.select(passed), kind=kind, heights=heights[kind][passed], ignored=True)
    draw_hits(
        above, music, dance, pairs, delay=params.reaction_delay, lag=params.lag,
        audio_heights=heights["audio"][kept["audio"]], visual_heights=heights["visual"][kept["visual"]],
    )  # fmt: skip
    draw_threshold(above, params.audio_threshold * float(heights["audio"].std()), kind="audio")
    if params.visual_threshold is not None and len(visual) > 1:
        draw_threshold(above, params.visual_threshold * float(heights["visual"][1:].std()), kind="visual")
    above.set_ylabel("how noticeable")
    curve, fps = motion_curve(stage.motion, params)
    shift = 0.5 if params.subframe else 0.0
    draw_curve(below, (np.arange(curve.size) - shift) / fps, curve, visual)
    below.set_ylabel("change of direction (SD)" if params.detector == "direction" else "joint speed (m/s)")
    _draw_moved_hits(right, music, dance, params, score)


def _shares(strengths: FloatArray) -> FloatArray:
    """Strengths as shares of the largest."""
    return strengths / max(float(strengths.max(initial=0.0)), 1e-12)


def _draw_moved_hits(ax: Axes, music: BeatTrack, dance: BeatTrack, params: HarmonyParams, score: HarmonyScore) -> None:
    """Share of the music's weight that is hit, for every shift of the music."""
    total = max(float(music.strengths.sum()), 1e-12)
    turned = np.sort(np.mod(dance.times - params.lag, music.duration))
    weights = rotated_shares(
        music.times, turned, music.strengths, delay=params.reaction_delay, duration=music.duration, count=N_ROTATIONS
    )
    moved = -rotations(music.duration, N_ROTATIONS)
    _draw_moved(ax, moved, weights / total, music.duration, score.hitting_score / total, score.chance)
    ax.set_ylabel("share of strength hit")


def _draw_moved(
    ax: Axes, moved: FloatArray, shares: FloatArray, duration: float, observed: float, chance: float
) -> None:
    """The shifts brought to both sides of 0 and put in order, the unmoved music among them."""
    around = np.mod(moved + duration / 2, duration) - duration / 2
    order = np.argsort(around)
    draw_rotations(ax, around[order], shares[order], observed=observed, chance=chance)


def _draw_pattern_score(
    above: Axes, below: Axes, right: Axes, stage: Stage, params: HarmonyParams, score: HarmonyScore
) -> None:
    """The picture of the recommended mode: rank of each beat, and the speed with the pattern laid on the beats."""
    fit = fit_of_motion(stage.music, stage.motion, params, n_rotations=N_ROTATIONS)
    music = salient_audio(stage.music, params)
    passed = stage.music.select(~np.isin(stage.music.times, music.times))
    if len(passed):
        above.plot(passed.times, np.zeros(len(passed)), "|", color=COLOURS["chance"], markersize=8)
    draw_shares(above, music, fit.shares, chance=fit.chance)
    above.set_ylabel("rank of the moment")
    _draw_expected(below, stage, params)
    _draw_moved_ranks(right, stage, fit)


def _draw_expected(ax: Axes, stage: Stage, params: HarmonyParams) -> None:
    """Normalised speed, and what the pattern expects of it on these beats."""
    times, speed = normalised_speed(stage.motion, params)
    draw_curve(ax, times, speed)
    music = salient_audio(stage.music, params)
    if len(music) > 1 and (music.bar_places is not None or params.pattern.beats == 1):
        expected = evaluate_pattern(params.pattern, beat_positions(times - params.lag, music))
        scale = max(float(np.abs(expected).max(initial=0.0)), 1e-12)
        ax.plot(times, 1.5 * expected / scale, color=COLOURS["ink"], linestyle="--", linewidth=1.4)
    ax.vlines(music.times, -3.0, 3.0, color=COLOURS["audio"], alpha=0.35, linewidth=1.2)
    ax.set(ylim=(-3.0, 3.0), ylabel="speed (SD), expected: dashed")


def _draw_moved_ranks(ax: Axes, stage: Stage, fit: PatternFit) -> None:
    """Mean rank of the music's beats, for every shift of the music between its first and last beat."""
    count = len(fit.null)
    length = float(np.ptp(stage.music.times)) if len(stage.music) > 1 else stage.music.duration
    _draw_moved(ax, np.linspace(0.0, length, count, endpoint=False), fit.null, length, fit.mean, fit.chance)
    ax.set_ylabel("mean rank")
