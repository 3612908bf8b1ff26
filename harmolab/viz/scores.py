"""One picture of a scored clip, a row for each mode: which music beats were met, and the verdict in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.beats.saliency import salient_audio, salient_visual
from harmolab.beats.visual import visual_beats
from harmolab.harmony import hit_pairs
from harmolab.params import HarmonyParams
from harmolab.pattern import fit_of_motion
from harmolab.types import BeatTrack, HarmonyScore, Motion
from harmolab.viz.beats import draw_hits, draw_shares
from harmolab.viz.style import figure_style

__all__ = ["score_figure"]


def score_figure(
    music: BeatTrack,
    motion: Motion,
    chosen: Mapping[str, HarmonyParams],
    scores: Mapping[str, HarmonyScore],
    *,
    title: str = "",
) -> Figure:
    """A row a mode: hits and misses with tolerance fields, or each beat's rank where the mode is a pattern's.

    Parameters
    ----------
    music : BeatTrack on the motion's time line
    motion : Motion
    chosen : mode -> its HarmonyParams
    scores : mode -> the score of this motion and music
    title : str, above the first row
    """
    with figure_style():
        width = min(max(8.0, 0.35 * motion.duration), 24.0)
        figure = Figure(figsize=(width, 2.7 * len(chosen)), layout="constrained")
        axes = figure.subplots(len(chosen), 1, squeeze=False)[:, 0]
        for ax, (name, params) in zip(axes, chosen.items(), strict=True):
            draw_verdict(ax, music, motion, params)
            ax.set_title(f"{name}: {headline(scores[name])}")
            ax.set(xlim=(0, motion.duration), xlabel="time (s)")
        if title:
            figure.suptitle(title, x=0.01, ha="left")
    return figure


def draw_verdict(ax: Axes, music: BeatTrack, motion: Motion, params: HarmonyParams) -> Axes:
    """One mode's beats: met or missed, or ranked."""
    timed = replace(motion, fps=motion.fps / params.clock)
    heard = salient_audio(music, params)
    if params.measure == "pattern":
        fit = fit_of_motion(music, timed, params)
        return draw_shares(ax, heard, fit.shares, chance=fit.chance)
    seen = salient_visual(visual_beats(timed, params=params), params)
    pairs = hit_pairs(heard.times, seen.times - params.lag, delay=params.reaction_delay, matching=params.matching)
    return draw_hits(ax, heard, seen, pairs, delay=params.reaction_delay, lag=params.lag)


def headline(score: HarmonyScore) -> str:
    """The verdict in one line."""
    low, high = score.interval
    return (
        f"above chance {score.harmony_above_chance:+.2f} (95 % {low:+.2f} to {high:+.2f}, p = {score.p_value:.3f});  "
        f"h = {score.harmony:.2f}, {score.hits.sum()} of {score.n_audio} beats, chance {score.chance:.0%}"
    )
