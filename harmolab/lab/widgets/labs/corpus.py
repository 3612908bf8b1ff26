"""The corpus lab: the scores of many clips with their own and with wrong music, and the AUC, while sliders move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from harmolab.harmony import score_motion
from harmolab.lab.figures.beats import draw_marks
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.clips import Corpus, corpus_scores
from harmolab.lab.widgets.labs.lab import (
    LOOK,
    ModeLab,
    menu,
    score_params,
    score_presets,
    score_sliders,
    slider,
    start_at,
)
from harmolab.lab.widgets.labs.stage import Stage, draw_board, placed_axes
from harmolab.lab.widgets.picture import ClickPicture
from harmolab.lab.widgets.player import Dancer, Player
from harmolab.params import HarmonyParams
from harmolab.significance import auc
from harmolab.types import Clip, FloatArray

PLACES = ((0.085, 0.12, 0.4, 0.7), (0.59, 0.12, 0.39, 0.7))
EDGE = 0.02  # of the picture, round the dots' panel
REACH = 12.0  # pixels of the screen: a click this far from a dot still means it
IDLE = MappingProxyType({"recommended": ("lambda2", "delay")})  # it asks for no hits
SCORES = MappingProxyType({"harmony h": "harmony", "above chance": "harmony_above_chance", "hit rate": "hit_rate"})
LOWEST = MappingProxyType({"harmony": 0.0, "harmony_above_chance": -1.0, "hit_rate": 0.0})


class CorpusLab(ModeLab):
    """The corpus lab: a ModeLab in which a click on a dot chooses its clip, and opens it where there is something to.

    Parameters
    ----------
    corpus : Corpus
    play : callable, optional
        ``play(number, params)`` returns the page element (HTML) that plays a clip; called on a click only.
    **controls
        As `corpus_lab` makes them.
    """

    def __init__(
        self, corpus: Corpus, play: Callable[[int, HarmonyParams], str] | None = None, /, **controls: Any
    ) -> None:
        self._corpus, self._play = corpus, play
        super().__init__(partial(draw_corpus_lab, corpus), corpus_params, score_presets, IDLE, **controls)
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
        """What a click does: the clip of the nearest dot is ringed and opened; nothing where no dot is near.

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


def corpus_lab(
    clips: Corpus | Sequence[Clip], *, on_clip: Callable[[str], object] | None = None, **values: Any
) -> CorpusLab:
    """Sliders for the score's settings above the scores of a whole corpus, with the AUC of true against wrong music.

    Parameters
    ----------
    clips : clips with motion, or a Corpus of their beats
        A click on a dot opens its clip in a player under the picture; of a Corpus it only rings the dot.
    on_clip : callable, optional
        Called with a clip's name whenever another is chosen.
    **values
        Where controls start instead of at the first mode's settings: ``delay=0.1``; a mode brings its own.

    Examples
    --------
    >>> lab = corpus_lab(clips, on_clip=print)  # doctest: +SKIP
    >>> lab.controls["delay"].value = 0.1  # doctest: +SKIP
    """
    corpus = clips if isinstance(clips, Corpus) else Corpus.of(clips)
    modes = tuple(corpus.batches)
    numbered = [(name, place) for place, name in enumerate(corpus.names)]
    controls = {
        "mode": menu("mode", modes, modes[0]),
        "score": menu("score", tuple(SCORES), "harmony h"),
        "late": slider("late (beats)", 0.0, 1.0, 0.05, 0.5),
        **score_sliders(modes[0]),
        "clip": widgets.SelectionSlider(options=numbered, value=0, description="clip", readout=False, **LOOK),
    }
    play = None if isinstance(clips, Corpus) else partial(_played, clips)
    lab = CorpusLab(corpus, play, **start_at(controls, values, score_presets))
    if on_clip is not None:
        controls["clip"].observe(lambda change: on_clip(corpus.names[change["new"]]), names="value")
    return lab


def _played(clips: Sequence[Clip], number: int, params: HarmonyParams) -> str:
    """The player of one clip, with its true music, as an element of a page."""
    clip = clips[number]
    stage = Stage.of(clip)
    score = score_motion(stage.music, stage.motion, params=params, n_rotations=0)
    dancer = Dancer(clip.dance or "dancer", stage.motion, score)
    return Player(clip.shared().audio, [dancer], music=stage.music, title=clip.name)._repr_html_()


def corpus_params(*, mode: str, score: str = "", late: float = 0.0, clip: int = 0, **values: Any) -> HarmonyParams:
    """The settings that the lab's controls stand for; which score, how late and which clip are none of them."""
    return score_params(mode, **values)


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
    mode : "paper", "recommended" or "valleys"
    score : "harmony h", "above chance" or "hit rate"
    late : float, beats by which the wrong music is moved
    clip : int, the dot that is ringed
    figure : Figure, optional, drawn on if given
    **values
        The other arguments of `corpus_params`; those of the mode when left out.
    """
    params = corpus_params(mode=mode, **{**score_presets(mode), **values})
    shown = Figure() if figure is None else figure
    left, right, board = shown.axes or placed_axes(shown, (10.0, 5.4), PLACES)
    true, wrong, low = _dots(corpus, params, mode, score, late)
    _draw_spread(left, true, wrong, low)
    note = "   |   lower ones at -1" if low < 0 else ""
    left.set_xlabel(score + note + (f"   |   {corpus.source} data" if corpus.source else ""))
    _draw_clips(right, true, wrong, low, clip)
    exact = [getattr(corpus_scores(corpus, mode, params, by), SCORES[score]) for by in (None, late)]
    label = f"{corpus.names[clip]}: {exact[0][clip]:.2f} true, {exact[1][clip]:.2f} wrong"
    right.text(0.0, 1.02, label, transform=right.transAxes, va="bottom")
    right.set(xlabel=f"{score}, wrong music", ylabel=f"{score}, true music")
    wrong_music = f"wrong: {late:g} beat late (outline)"
    left.text(1.0, 1.02, wrong_music, transform=left.transAxes, color=COLOURS["ink"], ha="right", va="bottom")
    draw_board(board, _numbers(*exact))
    return shown


def _dots(
    corpus: Corpus, params: HarmonyParams, mode: str, score: str, late: float
) -> tuple[FloatArray, FloatArray, float]:
    """Every clip's score with true and with wrong music as shown, and the lowest that is shown."""
    name = SCORES[score]
    low = LOWEST[name]
    true, wrong = (np.maximum(getattr(corpus_scores(corpus, mode, params, by), name), low) for by in (None, late))
    return true, wrong, low


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
    ax.text(0.0, 1.02, "true music", transform=ax.transAxes, color=COLOURS["audio"], va="bottom")
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    top = 10 * 2 ** np.ceil(np.log2(max(1.1 * tall / 10, 1)))  # in steps, so that the axis seldom changes
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
