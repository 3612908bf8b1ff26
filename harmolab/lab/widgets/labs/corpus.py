"""The corpus lab: the scores of many clips with their own and with wrong music, and the AUC, while sliders move."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from harmolab.beats.visual import visual_beats
from harmolab.harmony import score_motion
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PlaceBatch, rescore, rescore_places
from harmolab.lab.figures.beats import draw_marks
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.lab import LOOK, MODES, SCORE_SLIDERS, Lab, menu, setting_controls, slider, with_settings
from harmolab.lab.widgets.labs.stage import Stage, axis_label, draw_board, placed_axes, write_above
from harmolab.lab.widgets.picture import ClickPicture
from harmolab.lab.widgets.player import Dancer, Player
from harmolab.params import HarmonyParams
from harmolab.significance import auc
from harmolab.types import Clip, FloatArray

PLACES = ((0.085, 0.12, 0.4, 0.7), (0.59, 0.12, 0.39, 0.7))
EDGE = 0.02  # of the picture, round the dots' panel
REACH = 12.0  # pixels of the screen: a click this far from a dot still means it
IDLE = MappingProxyType({"recommended": ("lambda1", "lambda2", "delay")})  # all beats count, and no hits
SCORES = MappingProxyType({"harmony h": "harmony", "above chance": "harmony_above_chance", "hit rate": "hit_rate"})
LOWEST = MappingProxyType({"harmony h": 0.0, "above chance": -1.0, "hit rate": 0.0})


@dataclass(frozen=True, eq=False)
class Corpus:
    """Beats of C clips, ready to be scored again and again.

    Parameters
    ----------
    names : C names
    batches : mode -> beats and movement of C clips: a PlaceBatch for "recommended", else a BeatBatch
    periods : (C,) array, seconds between music beats
    source : str, origin of the data
    """

    names: tuple[str, ...]
    batches: Mapping[str, BeatBatch | PlaceBatch]
    periods: FloatArray
    source: str = ""

    def __post_init__(self) -> None:
        counts = {len(self.names), len(self.periods), *(batch.durations.size for batch in self.batches.values())}
        if not self.batches or set(self.batches) - set(MODES) or len(counts) != 1:
            raise ValueError(
                f"a corpus needs a batch for some of {', '.join(MODES)}, with as many clips as names and periods; "
                f"got {', '.join(self.batches) or 'none'} with {', '.join(map(str, sorted(counts)))} clips"
            )
        for mode, batch in self.batches.items():
            if isinstance(batch, PlaceBatch) != (MODES[mode].measure == "shape"):
                raise ValueError(f"the {mode} mode cannot score a {type(batch).__name__}")

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> Corpus:
        """Beats and movement of clips with motion, read once for every mode.

        Raises
        ------
        ValueError
            Without clips, or if one has no motion.
        """
        stages = [Stage.of(clip) for clip in clips]
        batches = {mode: _batch(stages, params) for mode, params in MODES.items()}
        periods = [float(np.median(np.diff(one.music.times))) if len(one.music) > 1 else 0.0 for one in stages]
        sources = sorted({one.source for one in stages if one.source})
        return cls(tuple(clip.name for clip in clips), batches, np.array(periods), " + ".join(sources))


def _batch(stages: Sequence[Stage], params: HarmonyParams) -> BeatBatch | PlaceBatch:
    """The stages as the measure of `params` scores them."""
    if params.measure == "shape":
        return PlaceBatch.of([(one.music, one.motion) for one in stages], params)
    return BeatBatch.of([(one.music, visual_beats(one.motion, params=params)) for one in stages])


@lru_cache(maxsize=2)  # the wrong music stays where it is while other sliders move
def _late(corpus: Corpus, mode: str, beats: float) -> BeatBatch | PlaceBatch:
    """The batch with each clip's music moved by `beats` beats, round its end."""
    return corpus.batches[mode].moved(beats * corpus.periods)


@lru_cache(maxsize=4)  # the true music's scores stay while another clip is chosen, or the wrong music moves
def corpus_scores(corpus: Corpus, mode: str, params: HarmonyParams, late: float | None = None) -> BatchScores:
    """Scores of all clips with true music, or with music that is `late` beats late."""
    batch = corpus.batches[mode] if late is None else _late(corpus, mode, late)
    return rescore_places(batch, params) if isinstance(batch, PlaceBatch) else rescore(batch, params)


class CorpusLab(Lab):
    """The corpus lab: a Lab in which a click on a dot chooses its clip, and opens it if there is a `play`.

    Parameters
    ----------
    corpus : Corpus
    play : callable, optional
        ``play(number, params)`` returns the page element (HTML) that plays a clip; called on a click only.
    controls, values
        As for `Lab`.
    """

    def __init__(
        self,
        corpus: Corpus,
        play: Callable[[int, HarmonyParams], str] | None,
        controls: Mapping[str, Any],
        values: Mapping[str, Any],
    ) -> None:
        self._corpus, self._play = corpus, play
        super().__init__(partial(draw_corpus_lab, corpus), corpus_params, controls, values, idle=IDLE)
        self._player = widgets.HTML(layout={"width": "100%", "display": "none"})
        hint = widgets.HTML(f"{self._image.hint}, or choose it with the clip slider.")
        # The name stands here in full; the slider would cut it off.
        self._button = widgets.Button(icon="play", layout={"width": "auto", "max_width": "100%"})
        self._button.on_click(lambda _: self.play())
        self._controls["clip"].observe(lambda _: self._name_button(), names="value")
        self._name_button()
        line = [hint] if play is None else [self._button, hint]
        self.children = (*self.children, widgets.Box(line, layout={"flex_flow": "row wrap"}), self._player)

    def _name_button(self) -> None:
        self._button.description = f"Play {self._corpus.names[self.values['clip']]}"

    def _picture(self, png: bytes) -> ClickPicture:
        left, bottom, width, height = PLACES[1]
        area = [left - EDGE, 1 - bottom - height - EDGE, left + width + EDGE, 1 - bottom + EDGE]
        hint = "Click a dot to choose its clip" if self._play is None else "Click a dot to see and hear it"
        return ClickPicture(self.click, value=png, area=area, hint=hint)

    def click(self, x: float, y: float, width: float) -> None:
        """Ring and open the clip of the nearest dot; do nothing where no dot is near.

        Parameters
        ----------
        x, y : float, shares of the picture's width and height, from its top left corner
        width : float, pixels of the screen that the picture is wide
        """
        clip = self.clip_at(x, y, width)
        if clip is not None:
            self._controls["clip"].value = clip
            self.play()

    def clip_at(self, x: float, y: float, width: float) -> int | None:
        """Number of the clip whose dot is shown there, or None; clips on one spot take turns. As for `click`."""
        values = self.values
        points = _dots(self._corpus, self.params, values["mode"], values["score"], values["late"])[:2]
        figure: Any = self._figure
        ax, size = figure.axes[1], figure.bbox.size
        away = ax.transData.transform(np.column_stack(points[::-1])) - size * np.array([x, 1.0 - y])
        distance = np.hypot(*away.T) * width / size[0]
        if not distance.min() <= REACH:
            return None
        nearest = np.flatnonzero(distance <= distance.min() + 1e-6)
        return int(nearest[np.argmax(nearest > values["clip"])])

    def play(self) -> None:
        """Open the chosen clip in the player under the picture."""
        if self._play is None:
            return
        try:
            self._player.value = self._play(self.values["clip"], self.params)
        except ValueError as error:
            self._complain(error)
        else:
            self._player.layout.display = "block"


def corpus_lab(clips: Corpus | Sequence[Clip], **values: Any) -> CorpusLab:
    """Sliders for the score's settings above the scores of a whole corpus, with the AUC of true against wrong music.

    Parameters
    ----------
    clips : clips with motion, or a Corpus of their beats
        A click on a dot opens its clip in a player under the picture; of a Corpus it only rings the dot.
    **values
        Where controls start instead of at the first mode's settings: ``delay=0.1``; a mode brings its own.

    Examples
    --------
    >>> lab = corpus_lab(clips)  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    corpus = clips if isinstance(clips, Corpus) else Corpus.of(clips)
    modes = tuple(corpus.batches)
    numbered = [(name, place) for place, name in enumerate(corpus.names)]
    controls = {
        "mode": menu("mode", modes, modes[0]),
        "score": menu("score", tuple(SCORES), "harmony h"),
        "late": slider("late (beats)", 0.0, 1.0, 0.05, 0.5),
        **setting_controls(MODES[modes[0]], *SCORE_SLIDERS),
        "clip": widgets.SelectionSlider(options=numbered, value=0, description="clip", readout=False, **LOOK),
    }
    play = None if isinstance(clips, Corpus) else partial(_player_element, clips)
    return CorpusLab(corpus, play, controls, values)


def _player_element(clips: Sequence[Clip], number: int, params: HarmonyParams) -> str:
    """The player of one clip, with its true music, as an element of a page."""
    clip = clips[number]
    stage = Stage.of(clip)
    score = score_motion(stage.music, stage.motion, params=params, n_rotations=0)
    dancer = Dancer(clip.dance or "dancer", stage.motion, score)
    return Player(clip.shared().audio, [dancer], music=stage.music, title=clip.name)._repr_html_()


def corpus_params(*, mode: str, score: str = "", late: float = 0.0, clip: int = 0, **values: Any) -> HarmonyParams:
    """A mode's settings but for those of the lab's controls; score, clip and delay of the music are no settings."""
    return with_settings(MODES[mode], **values)


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
    """The lab's picture: histograms of the scores with true and with wrong music, and every clip as a dot.

    Parameters
    ----------
    corpus : Corpus
    mode : "paper", "recommended" or "valleys"
    score : "harmony h", "above chance" or "hit rate"
    late : float, beats by which the wrong music is moved
    clip : int, the dot that is ringed
    figure : Figure, optional, drawn on if given
    **values
        The other arguments of `corpus_params`; those of the mode when left out.
    """
    params = corpus_params(mode=mode, **values)
    figure, (left, right, board) = placed_axes(figure, (10.0, 5.4), PLACES)
    true, wrong, low = _dots(corpus, params, mode, score, late)
    _draw_spread(left, true, wrong, low)
    left.set_xlabel(axis_label(score, "lower ones at -1" if low < 0 else "", source=corpus.source))
    write_above(left, f"wrong: {late:g} beat late (outline)", side="right", color=COLOURS["ink"])
    _draw_clips(right, true, wrong, low, clip)
    exact = _scores(corpus, params, mode, score, late)
    write_above(right, f"{corpus.names[clip]}: {exact[0][clip]:.2f} true, {exact[1][clip]:.2f} wrong")
    right.set(xlabel=f"{score}, wrong music", ylabel=f"{score}, true music")
    draw_board(board, _numbers(*exact))
    return figure


def _scores(corpus: Corpus, params: HarmonyParams, mode: str, score: str, late: float) -> tuple[FloatArray, FloatArray]:
    """Scores of all clips with true and with wrong music."""
    true, wrong = (getattr(corpus_scores(corpus, mode, params, beats), SCORES[score]) for beats in (None, late))
    return true, wrong


def _dots(
    corpus: Corpus, params: HarmonyParams, mode: str, score: str, late: float
) -> tuple[FloatArray, FloatArray, float]:
    """Scores of all clips with true and with wrong music as drawn, and the lowest that is drawn."""
    low = LOWEST[score]
    true, wrong = _scores(corpus, params, mode, score, late)
    return np.maximum(true, low), np.maximum(wrong, low), low


def _draw_spread(ax: Axes, true: FloatArray, wrong: FloatArray, low: float) -> None:
    """Two histograms: true music blue, wrong music a grey outline; lines at the means."""
    edges = np.linspace(low, 1.0 + 1e-9, 26)
    highest = 1
    looks: tuple[tuple[FloatArray, str, dict[str, Any]], ...] = (
        (true, "-", {"color": COLOURS["audio"], "fill": True, "alpha": 0.55}),
        (wrong, "--", {"color": COLOURS["ink"], "linewidth": 1.6}),
    )
    for values, line, look in looks:
        counts, _ = np.histogram(np.minimum(values, 1.0), edges)
        ax.stairs(counts, edges, **look)
        ax.axvline(float(values.mean()), color=look["color"], linestyle=line, linewidth=1.4)
        highest = max(highest, int(counts.max()))
    write_above(ax, "true music", color=COLOURS["audio"])
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    top = 10 * 2 ** np.ceil(np.log2(max(1.1 * highest / 10, 1)))  # in steps, so that the axis seldom changes
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
