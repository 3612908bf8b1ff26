"""A study as a plain local page, in a browser or in a frame of a notebook; it talks to this machine alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import LocalPage, Reply
from harmolab.lab.listening.trials import ANCHORS, ASKED, MARKED, MOST, Trial, TrialSet
from harmolab.lab.report.templates import framed, rendered

TITLE = "Listening study"
FRAME_HEIGHT = 860  # pixels: question, player and answers


def trial_page(trials: TrialSet, waiting: tuple[Trial, ...], show: Callable[[Trial], str], *, action: str) -> str:
    """The page of the first waiting trial, or of thanks.

    Parameters
    ----------
    trials : TrialSet
    waiting : tuple of Trial, those without an answer
    show : callable, ``show(trial)`` returns the page of a trial, such as `blind_page`, which is framed
    action : str, address that the answer is sent to
    """
    if not waiting:
        return _page(text=f"Thank you. All {len(trials)} answers are saved; you can close this page.")
    number = len(trials) - len(waiting) + 1
    return _page(trials=trials, trial=waiting[0], number=number, frame=framed(show(waiting[0])), action=action)


def _page(**values: Any) -> str:
    return rendered("study.html.j2", title=TITLE, asked=ASKED, anchors=ANCHORS, most=MOST, **values)


class StudyServer(LocalPage):
    """Asks the trials of one rater in a browser on this machine.

    Parameters
    ----------
    trials : TrialSet
    log : AnswerLog
        An answer is written through before the next page is sent.
    show : callable, ``show(trial)`` returns the page of a trial, such as `blind_page`, which is framed
    port : int, 0 for any free one

    Notes
    -----
    In a notebook it shows itself as a frame whose buttons work while the kernel runs. The frame holds the trial itself,
    so the offline report shows and plays it too.

    Examples
    --------
    >>> StudyServer(trials, log, show).start()  # doctest: +SKIP
    >>> server = StudyServer(trials, log, show)  # doctest: +SKIP
    >>> with server.running() as address:  # doctest: +SKIP
    ...     webbrowser.open(address)
    ...     server.finished.wait()

    Attributes
    ----------
    finished : threading.Event, set when the page of thanks was sent
    """

    def __init__(self, trials: TrialSet, log: AnswerLog, show: Callable[[Trial], str], *, port: int = 0) -> None:
        super().__init__(port=port)
        self._trials, self._log, self._show = trials, log, show
        self._since = time.monotonic()
        self._answering = threading.Lock()

    def get(self, name: str) -> Reply | None:
        """The page that asks, or thanks."""
        if name:
            return None
        waiting, page = self.turn()
        return Reply(page, is_last=not waiting)

    def post(self, body: str) -> Reply:
        """Writes the answer of a form, and leads back to the page."""
        form = parse_qs(body)
        try:
            marks = " ".join(form.get(name, [""])[0] for name in MARKED)
            choice = marks if self._trials.kind == "rate" else form.get("choice", [""])[0]
            self.answer(form.get("trial", [""])[0], choice)
        except (ValueError, OSError) as error:
            raise ValueError(f"The answer was not saved: {error}") from None
        return Reply("", HTTPStatus.SEE_OTHER, location=self.path)

    def refusal(self, error: Exception) -> Reply:
        """A page with the fault."""
        return Reply(_page(text=str(error)))

    def turn(self) -> tuple[tuple[Trial, ...], str]:
        """The trials without an answer, and the page that asks the first of them."""
        self._since = time.monotonic()
        waiting = self._log.resume(self._trials)
        return waiting, trial_page(self._trials, waiting, self._show, action=self.address)

    def _repr_html_(self) -> str:
        return framed(self.turn()[1], title=TITLE, height=FRAME_HEIGHT)

    def answer(self, trial: str, choice: str) -> None:
        """Writes an answer; one that is no longer asked for, from a page sent twice, changes nothing."""
        with self._answering:
            if trial in {one.id for one in self._log.resume(self._trials)}:
                seconds = round(time.monotonic() - self._since, 3)
                self._log.record(self._trials, trial, choice, seconds=seconds)
