"""A listening study in a notebook: one trial, its buttons, and every answer on disk before the next trial shows."""

from __future__ import annotations

import html
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import ipywidgets as widgets
import numpy as np

from harmolab.types import Clip
from harmolab.widgets.player import BlindPlayer

__all__ = ["TrialPresenter", "player_trial"]

BUTTON = widgets.Layout(width="14rem", height="3rem")


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
    show : callable
        ``show(trial)`` returns the HTML of one trial, such as `player_trial` of the clips that its key names.

    Notes
    -----
    Its mime bundle holds the first trial as ``text/html`` beside the live widget, so a static report shows what the
    rater would see, with buttons that do nothing.

    Examples
    --------
    >>> TrialPresenter(trials, AnswerLog("answers.jsonl"), show)  # doctest: +SKIP
    """

    def __init__(self, trials: TrialsLike, log: LogLike, show: Callable[[Any], str]) -> None:
        self._trials, self._log, self._show = trials, log, show
        self._heading, self._stage = widgets.HTML(), widgets.HTML()
        self._message = widgets.HTML(layout={"display": "none"})
        self._buttons = [widgets.Button(description=choice, layout=BUTTON) for choice in trials.choices]
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
        self._stage.value = self._show(self.trial) if self.trial is not None else ""
        self._heading.value = self._headline()
        self._complain("")
        for button in self._buttons:
            button.disabled = self.trial is None
        self._since = time.monotonic()

    def _headline(self) -> str:
        if self.trial is None:
            return f"<p>Thank you. All {len(self._trials)} answers are saved.</p>"
        number = len(self._trials) - len(self._waiting) + 1
        question = html.escape(self._trials.question)
        return f"<p>Trial {number} of {len(self._trials)}</p><p><b>{question}</b></p>"

    def _still(self) -> str:
        """The trial shown, with buttons that do nothing."""
        names = (html.escape(button.description) for button in self._buttons)
        style = "font-size: 1.1rem; padding: 0.6rem 1.8rem"
        buttons = " ".join(f'<button disabled style="{style}">{name}</button>' for name in names)
        note = "<small>The buttons work in JupyterLab.</small>"
        return f"<div>{self._heading.value}{self._stage.value}<p>{buttons} {note}</p></div>"

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        bundle = super()._repr_mimebundle_(**kwargs)
        return {**(bundle or {}), "text/html": self._still()}


def player_trial(*clips: Clip) -> str:
    """A trial as a blind player: one dancer, or two side by side (left, right) to one music.

    Parameters
    ----------
    clips : Clips with a motion that starts with the music; a second one must have the same music

    Raises
    ------
    ValueError
        If a clip has no motion, its motion does not start with the music, or two clips have two pieces of music.
    """
    motions = []
    for clip in clips:
        if clip.motion is None:
            raise ValueError(f"clip {clip.name!r} has no motion to show")
        if clip.offset:
            raise ValueError(f"clip {clip.name!r}: its motion starts {clip.offset:g} s into the music; cut both first")
        if not np.array_equal(clip.audio.samples, clips[0].audio.samples):
            raise ValueError(f"clips {clips[0].name!r} and {clip.name!r} have two pieces of music; one can be heard")
        motions.append(clip.motion)
    return BlindPlayer(clips[0].audio, motions)._repr_html_()
