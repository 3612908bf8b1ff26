"""The corpus lab: the scores of many clips with their own and with wrong music, and the AUC, while sliders move."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from harmolab.beats.visual import visual_beats
from harmolab.params import HarmonyParams
from harmolab.rescoring import BeatBatch, rescore
from harmolab.significance import auc
from harmolab.types import Clip
from harmolab.viz.beats import draw_marks
from harmolab.viz.style import COLOURS
from harmolab.widgets.labs.lab import LOOK, MODES, Lab, ModeLab, menu, slider, start_at
from harmolab.widgets.labs.stage import Stage, draw_board, placed_axes

__all__ = ["Corpus", "corpus_lab", "corpus_params", "draw_corpus_lab"]

FloatArray = NDArray[np.float64]

PLACES = ((0.085, 0.12, 0.4, 0.7), (0.59, 0.12, 0.39, 0.7))
KINDS = ("paper", "valleys")  # the modes that `rescore` knows
SCORES = MappingProxyType({"harmony h": "harmony", "above chance": "harmony_above_chance", "hit rate": "hit_rate"})
LOWEST = MappingProxyType({"harmony": 0.0, "harmony_above_chance": -1.0, "hit_rate": 0.0})


@dataclass(frozen=True, eq=False)
class Corpus:
    """Beats of C clips, ready to be scored again and again.

    Parameters
    ----------
    names : C names
    batches : mode ("paper", "valleys") -> BeatBatch of C clips, whose visual beats depend on the mode
    periods : (C,) array, seconds between music beats
    source : str, what the data are
    """

    names: tuple[str, ...]
    batches: Mapping[str, BeatBatch]
    periods: FloatArray
    source: str = ""

    def __post_init__(self) -> None:
        counts = {len(self.names), len(self.periods), *(batch.durations.size for batch in self.batches.values())}
        if not self.batches or set(self.batches) - set(KINDS) or len(counts) != 1:
            raise ValueError(
                f"a corpus needs a batch for some of {', '.join(KINDS)}, with as many clips as names and periods; "
                f"got {', '.join(self.batches) or 'none'} with {', '.join(map(str, sorted(counts)))} clips"
            )

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> Corpus:
        """The beats of clips with motion, read once for each mode.

        Raises
        ------
        ValueError
            Without clips, or if one has no motion.
        """
        stages = [Stage.of(clip) for clip in clips]
        batches = {
            kind: BeatBatch.of([(one.music, visual_beats(one.motion, params=MODES[kind])) for one in stages])
            for kind in KINDS
        }
        periods = [float(np.median(np.diff(one.music.times))) if len(one.music) > 1 else 0.0 for one in stages]
        sources = sorted({one.source for one in stages if one.source})
        return cls(tuple(clip.name for clip in clips), batches, np.array(periods), " + ".join(sources))

    def late(self, kind: str, beats: float) -> BeatBatch:
        """The batch with each clip's music moved by `beats` beats, round its end."""
        batch = self.batches[kind]
        origin, length = batch.audio_clip * batch.gap, batch.durations[batch.audio_clip]
        moved = np.mod(batch.audio - origin + beats * self.periods[batch.audio_clip], length)
        return replace(batch, audio=np.asarray(origin + moved, np.float64))


def corpus_lab(clips: Corpus | Sequence[Clip], *, on_clip: Callable[[str], object] | None = None, **values: Any) -> Lab:
    """Sliders for the score's settings above the scores of a whole corpus, with the AUC of true against wrong music.

    Parameters
    ----------
    clips : clips with motion, or a Corpus of their beats
    on_clip : callable, optional
        Called with a clip's name whenever another is chosen, to open it in a player, say.
    **values
        Where controls start instead of at the first mode's settings: ``delay=0.1``; a mode brings its own.

    Examples
    --------
    >>> lab = corpus_lab(clips, on_clip=print)  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    corpus = clips if isinstance(clips, Corpus) else Corpus.of(clips)
    modes = tuple(corpus.batches)
    start = _presets(modes[0])
    numbered = [(name, place) for place, name in enumerate(corpus.names)]
    controls = {
        "mode": menu("mode", modes, modes[0]),
        "score": menu("score", tuple(SCORES), "harmony h"),
        "late": slider("late (beats)", 0.0, 1.0, 0.05, 0.5),
        "lambda1": slider("λ1 (music)", 0.0, 8.0, 0.1, start["lambda1"]),
        "lambda2": slider("λ2 (dance)", 0.0, 3.0, 0.1, start["lambda2"]),
        "delay": slider("T_delay (s)", 0.0, 0.5, 0.01, start["delay"]),
        "beta": slider("β", 0.25, 4.0, 0.25, start["beta"]),
        "lag": slider("lag (s)", -0.4, 0.4, 0.02, start["lag"]),
        "clip": widgets.SelectionSlider(options=numbered, value=0, description="clip", **LOOK),
    }
    lab = ModeLab(partial(draw_corpus_lab, corpus), corpus_params, _presets, **start_at(controls, values, _presets))
    if on_clip is not None:
        controls["clip"].observe(lambda change: on_clip(corpus.names[change["new"]]), names="value")
    return lab


def _presets(mode: str) -> dict[str, Any]:
    """What a mode sets the other controls to."""
    params = MODES[mode]
    return {
        "lambda1": params.audio_threshold,
        "lambda2": params.visual_threshold or 0.0,
        "delay": params.reaction_delay,
        "beta": params.beta,
        "lag": params.lag,
    }


def corpus_params(
    *, mode: str, lambda1: float, lambda2: float, delay: float, beta: float, lag: float, **_: Any
) -> HarmonyParams:
    """The settings that the lab's controls stand for; λ2 = 0 keeps every visual beat."""
    return replace(
        MODES[mode],
        audio_threshold=lambda1,
        visual_threshold=lambda2 or None,
        reaction_delay=delay,
        beta=beta,
        lag=lag,
    )


def draw_corpus_lab(
    corpus: Corpus,
    *,
    mode: str = "paper",
    score: str = "harmony h",
    late: float = 0.5,
    clip: int = 0,
    figure: Figure | None = None,
    **values: Any,
) -> Figure:
    """The lab's picture: how the scores are spread with true and with wrong music, and every clip as a dot.

    Parameters
    ----------
    corpus : Corpus
    mode : "paper" or "valleys"
    score : "harmony h", "above chance" or "hit rate"
    late : float, beats by which the wrong music is moved
    clip : int, the dot that is ringed
    figure : Figure, optional, drawn on if given
    **values
        The other arguments of `corpus_params`; those of the mode when left out.
    """
    params = corpus_params(mode=mode, **{**_presets(mode), **values})
    shown = Figure() if figure is None else figure
    left, right, board = shown.axes or placed_axes(shown, (10.0, 5.4), PLACES)
    name = SCORES[score]
    true, wrong = (getattr(rescore(batch, params), name) for batch in (corpus.batches[mode], corpus.late(mode, late)))
    low = LOWEST[name]
    _draw_spread(left, np.maximum(true, low), np.maximum(wrong, low), low)
    note = "   |   lower ones at -1" if low < 0 else ""
    left.set_xlabel(score + note + (f"   |   {corpus.source} data" if corpus.source else ""))
    _draw_clips(right, np.maximum(true, low), np.maximum(wrong, low), low, clip)
    label = f"{corpus.names[clip]}: {true[clip]:.2f} true, {wrong[clip]:.2f} wrong"
    right.text(0.0, 1.02, label, transform=right.transAxes, va="bottom")
    right.set(xlabel=f"{score}, music {late:g} beat late", ylabel=f"{score}, true music")
    draw_board(board, _numbers(true, wrong))
    return shown


def _draw_spread(ax: Axes, true: FloatArray, wrong: FloatArray, low: float) -> None:
    """Two histograms: true music blue, wrong music a grey outline; lines at the means."""
    edges = np.linspace(low, 1.0 + 1e-9, 26)
    tall = 1
    looks: tuple[tuple[FloatArray, dict[str, Any]], ...] = (
        (true, {"color": COLOURS["audio"], "fill": True, "alpha": 0.55}),
        (wrong, {"color": COLOURS["ink"], "linewidth": 1.6}),
    )
    for values, look in looks:
        counts, _ = np.histogram(np.minimum(values, 1.0), edges)
        ax.stairs(counts, edges, **look)
        tall = max(tall, int(counts.max()))
    for values, colour, line in ((true, "audio", "-"), (wrong, "ink", "--")):
        ax.axvline(float(values.mean()), color=COLOURS[colour], linestyle=line, linewidth=1.4)
    for side, words, colour in (("left", "true music", "audio"), ("right", "wrong music (outline)", "ink")):
        ax.text(
            float(side == "right"), 1.02, words, transform=ax.transAxes, color=COLOURS[colour], ha=side, va="bottom"
        )
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    top = 5 * np.ceil(1.25 * tall / 5)  # in steps, so that the axis seldom changes
    ax.set(xlim=(low, 1.02), ylim=(0, top), ylabel="clips")


def _draw_clips(ax: Axes, true: FloatArray, wrong: FloatArray, low: float, clip: int) -> None:
    """A mark for every clip: green circles where the true music wins, red crosses where not, grey squares for ties."""
    ax.plot([low, 1.0], [low, 1.0], color=COLOURS["chance"], linestyle="--", linewidth=1.2)
    tied = np.isclose(true, wrong)
    draw_marks(ax, wrong[~tied], true[~tied], (true > wrong)[~tied])
    ax.plot(wrong[tied], true[tied], linestyle="none", marker="s", markersize=6, color=COLOURS["chance"], zorder=3)
    ax.plot(
        [wrong[clip]], [true[clip]], marker="s", markersize=17, markerfacecolor="none", markeredgewidth=2.0,
        color=COLOURS["ink"], zorder=5, clip_on=False,
    )  # fmt: skip
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    ax.set(xlim=(low - 0.03, 1.05), ylim=(low - 0.03, 1.05))


def _numbers(true: FloatArray, wrong: FloatArray) -> dict[str, str]:
    return {
        "AUC": f"{auc(true, wrong):.2f}",
        "true music wins": f"{((true > wrong) & ~np.isclose(true, wrong)).sum()}/{true.size}",
        "ties": f"{np.isclose(true, wrong).sum()}",
        "mean, true": f"{true.mean():.2f}",
        "mean, wrong": f"{wrong.mean():.2f}",
    }
