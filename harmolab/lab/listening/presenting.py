"""A study as a plain local page, in a browser or in a frame of a notebook; it talks to this machine alone."""

from __future__ import annotations

import html
import re
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import Trial, TrialSet
from harmolab.lab.report.templates import framed

HOST = "127.0.0.1"
TITLE = "Listening study"
MOST_BYTES = 4096  # of a form
IDLE_SECONDS = 30.0
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
        return _page(f"<p>Thank you. All {len(trials)} answers are saved; you can close this page.</p>")
    trial, number = waiting[0], len(trials) - len(waiting) + 1
    buttons = "".join(f'<button name="choice" value="{choice}">{choice}</button>' for choice in trials.choices)
    return _page(
        f'<p class="count">Trial {number} of {len(trials)}</p>'
        f'<progress max="{len(trials)}" value="{number - 1}"></progress>'
        f"<h1>{html.escape(trials.question)}</h1>{framed(show(trial))}"
        f'<form method="post" action="{html.escape(action, quote=True)}">'
        f'<input type="hidden" name="trial" value="{trial.id}">{buttons}</form>'
    )


STYLE = """
  body { font: 1.1rem/1.4 system-ui, sans-serif; max-width: 48rem; margin: 0.5rem auto; padding: 0 0.7rem;
    color: #222; }
  h1 { font-size: 1.5rem; text-align: center; margin: 0.6rem 0; } .count { margin: 0; color: #555; font-size: 0.95rem; }
  progress { display: block; width: 100%; height: 0.5rem; accent-color: #0072b2; }
  form { display: grid; grid-template-columns: 1fr 1fr; gap: 0.7rem; max-width: 40rem; margin: 0.6rem auto; }
  button { font: inherit; font-size: 1.25rem; min-height: 3.6rem; border: 2px solid #222; border-radius: 8px;
    background: #fff; color: inherit; cursor: pointer; }
  button:hover { background: #e8f1f7; } button:focus-visible { outline: 3px solid #0072b2; outline-offset: 2px; }
"""


def _page(body: str) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{TITLE}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<style>{STYLE}</style></head><body>{body}</body></html>"
    )


class StudyServer:
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
    It listens on 127.0.0.1 only. Its address holds a secret, so that another page open in the browser can neither
    read the trials nor answer them.

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
    finished : threading.Event, set when the rater has seen the page of thanks
    """

    def __init__(self, trials: TrialSet, log: AnswerLog, show: Callable[[Trial], str], *, port: int = 0) -> None:
        self._trials, self._log, self._show = trials, log, show
        self.path = f"/{secrets.token_urlsafe(16)}/"
        self._since = time.monotonic()
        self._answering = threading.Lock()
        self.finished = threading.Event()
        self._server = ThreadingHTTPServer((HOST, port), partial(_Handler, self))
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    @property
    def address(self) -> str:
        """The page's address, for a browser of this machine."""
        return f"http://{HOST}:{self._server.server_port}{self.path}"

    def start(self) -> StudyServer:
        """Itself, serving until `stop` or the end of the program."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End serving; answers stay."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    @contextmanager
    def running(self) -> Iterator[str]:
        """The address, served until the end of the ``with`` block."""
        self.start()
        try:
            yield self.address
        finally:
            self.stop()

    def page(self) -> str:
        """The page that the rater sees now."""
        return self.turn()[1]

    def turn(self) -> tuple[tuple[Trial, ...], str]:
        """The trials without an answer, and the page that asks the first of them."""
        self._since = time.monotonic()
        waiting = self._log.resume(self._trials)
        return waiting, trial_page(self._trials, waiting, self._show, action=self.address)

    def _repr_html_(self) -> str:
        return framed(self.page(), title=TITLE, height=FRAME_HEIGHT)

    def answer(self, trial: str, choice: str) -> None:
        """Writes an answer; one that is no longer asked for, from a page sent twice, changes nothing."""
        with self._answering:
            if trial in {one.id for one in self._log.resume(self._trials)}:
                seconds = round(time.monotonic() - self._since, 3)
                self._log.record(self._trials, trial, choice, seconds=seconds)


class _Handler(BaseHTTPRequestHandler):
    """GET shows the trial, POST answers it."""

    timeout = IDLE_SECONDS

    def __init__(self, study: StudyServer, *args: Any) -> None:
        self.study = study
        super().__init__(*args)  # answers the request

    def do_GET(self) -> None:
        if not self._is_ours():
            return
        try:
            waiting, page = self.study.turn()
            self._reply(HTTPStatus.OK, page)
            if not waiting:
                self.study.finished.set()
        except ValueError as error:  # a damaged file of answers or pages
            self._reply(HTTPStatus.INTERNAL_SERVER_ERROR, _page(f"<p>{html.escape(str(error))}</p>"))

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        try:
            form = self._form()
            self.study.answer(form.get("trial", [""])[0], form.get("choice", [""])[0])
        except (ValueError, OSError) as error:
            self._reply(HTTPStatus.BAD_REQUEST, _page(f"<p>The answer was not saved: {html.escape(str(error))}</p>"))
        else:
            self._reply(HTTPStatus.SEE_OTHER, "", Location=self.path)

    def _form(self) -> dict[str, list[str]]:
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch("[0-9]{1,9}", length) or int(length) > MOST_BYTES:
            raise ValueError(f"an answer has at most {MOST_BYTES} bytes")
        return parse_qs(self.rfile.read(int(length)).decode("utf-8", "replace"))

    def _is_ours(self) -> bool:
        if self.path == self.study.path:
            return True
        self._reply(HTTPStatus.NOT_FOUND, _page("<p>There is nothing here.</p>"))
        return False

    def _reply(self, status: HTTPStatus, text: str, **headers: str) -> None:
        content = text.encode()
        self.send_response(status)
        fixed = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(content))}
        for name, value in {**fixed, "Cache-Control": "no-store", **headers}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the rater's terminal is no place for requests."""
