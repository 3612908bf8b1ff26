"""A listening study in a notebook: one trial, its buttons, and every answer on disk before the next trial shows."""

from __future__ import annotations

import base64
import html
import io
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import ipywidgets as widgets
import numpy as np
import soundfile
from matplotlib.figure import Figure

from harmolab.types import Audio, Clip, Motion
from harmolab.viz.motion import draw_poses
from harmolab.viz.style import figure_style

__all__ = ["TrialPresenter", "plain_trial", "still_trial"]

STRIP = 13  # stick figures of a still trial


class TrialLike(Protocol):
    """A trial as `harmolab.listening.trials.Trial` has it."""

    @property
    def id(self) -> str: ...
    @property
    def stimuli(self) -> tuple[str, ...]: ...


class TrialsLike(Protocol):
    """Trials as `harmolab.listening.trials.TrialSet` has them."""

    @property
    def question(self) -> str: ...
    @property
    def choices(self) -> tuple[str, str]: ...
    @property
    def trials(self) -> Sequence[Any]: ...
    def __len__(self) -> int: ...


class LogLike(Protocol):
    """A log as `harmolab.listening.answers.AnswerLog` is one."""

    def resume(self, trials: Any) -> Sequence[Any]: ...
    def record(self, trials: Any, trial: str, choice: str, *, seconds: float | None = None) -> Any: ...


class TrialPresenter(widgets.VBox):
    """Asks one trial after the other, starting with the first that has no answer yet.

    Parameters
    ----------
    trials : TrialSet
    log : AnswerLog
        An answer is written through before the next trial shows; an error in writing is shown and the trial stays.
    show : callable, optional
        ``show(trial)`` returns the HTML of one trial, such as a player of the clip that its key names.

    Notes
    -----
    Its mime bundle holds the first trial as ``text/html`` beside the live widget, so a static report shows what the
    rater would see, with buttons that do nothing.

    Examples
    --------
    >>> TrialPresenter(trials, AnswerLog("answers.jsonl"))  # doctest: +SKIP
    """

    def __init__(self, trials: TrialsLike, log: LogLike, show: Callable[[Any], str] | None = None) -> None:
        self._trials, self._log, self._show = trials, log, show or plain_trial
        self._heading, self._stage = widgets.HTML(), widgets.HTML()
        self._message = widgets.HTML(layout={"display": "none"})
        self._buttons = [widgets.Button(description=choice) for choice in trials.choices]
        for button in self._buttons:
            button.on_click(self._clicked)
        super().__init__([self._heading, self._stage, widgets.HBox(self._buttons), self._message])
        self._turn()

    @property
    def trial(self) -> TrialLike | None:
        """The trial shown now; None when all are answered."""
        return self._waiting[0] if self._waiting else None

    @property
    def error(self) -> str:
        """Why the latest answer was not written; empty if it was."""
        return html.unescape(self._message.value.removeprefix("<pre>").removesuffix("</pre>"))

    def answer(self, choice: str) -> None:
        """Writes the answer to the trial shown and goes on; what a button does."""
        if self.trial is None:
            raise ValueError("all trials are answered")
        self._log.record(self._trials, self.trial.id, choice, seconds=round(time.monotonic() - self._since, 3))
        self._turn()

    def _clicked(self, button: Any) -> None:
        for one in self._buttons:
            one.disabled = True  # a double click must not answer the next trial
        try:
            self.answer(button.description)
        except (ValueError, OSError) as error:  # a full disk, a file of another study
            self._complain(str(error))
        finally:
            for one in self._buttons:
                one.disabled = self.trial is None

    def _complain(self, text: str) -> None:
        self._message.value = f"<pre>{html.escape(text)}</pre>" if text else ""
        self._message.layout.display = "block" if text else "none"

    def _turn(self) -> None:
        """Shows the first trial without an answer, or thanks."""
        self._waiting = self._log.resume(self._trials)
        self._heading.value = self._headline()
        self._stage.value = self._show(self.trial) if self.trial is not None else ""
        self._complain("")
        for button in self._buttons:
            button.disabled = self.trial is None
        self._since = time.monotonic()

    def _headline(self) -> str:
        if self.trial is None:
            return f"<p>Thank you. All {len(self._trials)} answers are saved.</p>"
        number = len(self._trials) - len(self._waiting) + 1
        return f"<p>Trial {number} of {len(self._trials)}: {html.escape(self._trials.question)}</p>"

    def _still(self) -> str:
        """The trial shown, with buttons that do nothing."""
        names = (html.escape(button.description) for button in self._buttons)
        buttons = " ".join(f"<button disabled>{name}</button>" for name in names)
        return f"<div>{self._heading.value}{self._stage.value}<p>{buttons}</p></div>"

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        bundle = super()._repr_mimebundle_(**kwargs)
        return {**(bundle or {}), "text/html": self._still()}


def plain_trial(trial: TrialLike) -> str:
    """A sound for each stimulus of a trial, by its id in the folder ``media``, and the id of the trial."""
    sounds = "".join(
        f'<audio controls preload="none" src="media/{html.escape(name, quote=True)}.wav"></audio>'
        for name in trial.stimuli
    )
    return f"<p>{sounds}</p><p><small>trial {html.escape(trial.id)}</small></p>"


def still_trial(*clips: Clip) -> str:
    """The sound of each clip under a strip of stick figures: no names, and no beats that would give the answer away.

    Parameters
    ----------
    clips : Clips with a motion, each shown from the first frame of its motion; two for a choice: left, right

    Raises
    ------
    ValueError
        If a clip has no motion, or its music does not reach into it.
    """
    shown = []
    for clip in clips:
        if clip.motion is None:
            raise ValueError(f"clip {clip.name!r} has no motion to show")
        music = clip.audio.span(clip.offset, clip.motion.duration)
        shown.append(
            f'<img alt="stick figures" style="max-width:100%" src="data:image/png;base64,{_strip(clip.motion)}"><br>'
            f'<audio controls src="data:audio/wav;base64,{_wav(music)}"></audio>'
        )
    return "".join(f'<div style="display:inline-block;width:{98 // len(shown)}%">{one}</div>' for one in shown)


def _strip(motion: Motion) -> str:
    """A PNG of the dance, in base64."""
    with figure_style():
        figure = Figure(figsize=(9.0, 1.5), dpi=80)
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.02, 0.28, 0.96, 0.7))
        draw_poses(ax, motion, np.linspace(0.0, motion.duration, STRIP), 0.5, height=62.0)
        ax.set(xlim=(-0.03 * motion.duration, 1.03 * motion.duration), ylim=(0.0, 1.0), yticks=[], xlabel="time (s)")
        ax.spines["left"].set_visible(False)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", bbox_inches=None)
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _wav(audio: Audio) -> str:
    stream = io.BytesIO()
    soundfile.write(stream, np.clip(audio.samples, -1.0, 1.0), round(audio.sample_rate), "PCM_16", format="WAV")
    return base64.b64encode(stream.getvalue()).decode("ascii")
