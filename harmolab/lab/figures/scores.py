"""One picture of a scored clip, a row for each mode: which music beats were met, and the verdict in words."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.beats import draw_hits, draw_shares
from harmolab.lab.figures.style import figure_style
from harmolab.types import HarmonyScore


def score_figure(scores: Mapping[str, HarmonyScore], *, title: str = "") -> Figure:
    """A row a mode: hits and misses with tolerance fields, or each beat's rank where the mode is a pattern's.

    Parameters
    ----------
    scores : mode -> the score of one motion with its music
    title : str, above the first row
    """
    duration = max(score.music.duration for score in scores.values())
    with figure_style():
        figure = Figure(figsize=(min(max(8.0, 0.35 * duration), 24.0), 2.7 * len(scores)), layout="constrained")
        axes = figure.subplots(len(scores), 1, squeeze=False)[:, 0]
        for ax, (name, score) in zip(axes, scores.items(), strict=True):
            draw_score(ax, score).set_title(f"{name}: {headline(score)}")
            ax.set(xlim=(0, duration), xlabel="time (s)")
        if title:
            figure.suptitle(title, x=0.01, ha="left")
    return figure


def draw_score(ax: Axes, score: HarmonyScore) -> Axes:
    """The beats of one score: met or missed, or ranked."""
    params = score.params
    if params.measure == "pattern":
        return draw_shares(ax, score.music, score.shares, chance=score.chance)
    return draw_hits(ax, score.music, score.visual, score.pairs, delay=params.reaction_delay, lag=params.lag)


def headline(score: HarmonyScore) -> str:
    """The verdict in one line."""
    low, high = score.interval
    return (
        f"above chance {score.harmony_above_chance:+.2f} (95 % {low:+.2f} to {high:+.2f}, p = {score.p_value:.3f});  "
        f"h = {score.harmony:.2f}, {score.hits.sum()} of {score.n_audio} beats, chance {score.chance:.0%}"
    )
