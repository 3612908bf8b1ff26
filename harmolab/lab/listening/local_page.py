"""A page for a browser of this machine alone: an address that holds a secret, requests, replies."""

import json
import re
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, NamedTuple, Self
from urllib.parse import parse_qs

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import ANCHORS, ASKED, MARKED, MOST, Trial, TrialSet
from harmolab.lab.report.templates import framed, rendered
from harmolab.readers.arrays import number_array
from harmolab.readers.audio import wav_bytes
from harmolab.types import Audio, FloatArray

HOST = "127.0.0.1"
IDLE_SECONDS = 30.0
HTML, TEXT = "text/html; charset=utf-8", "text/plain; charset=utf-8"


class Reply(NamedTuple):
    """Content, status and kind of an answer to a browser; after one that `is_last` the page is finished."""

    content: str | bytes
    status: HTTPStatus = HTTPStatus.OK
    kind: str = HTML
    location: str = ""
    is_last: bool = False


class LocalPage:
    """Serves one page, and what belongs to it, on this machine.

    It listens on 127.0.0.1 only. Its address holds a secret, so that another page open in the browser can neither read
    what it shows nor answer.

    Parameters
    ----------
    port : int, 0 for any free one

    Attributes
    ----------
    path : str, the page's place on the server
    finished : threading.Event, set when the last reply was sent
    """

    most_bytes = 4096  # of what a browser sends

    def __init__(self, *, port: int = 0) -> None:
        self.path = f"/{secrets.token_urlsafe(16)}/"
        self.finished = threading.Event()
        self._server = ThreadingHTTPServer((HOST, port), partial(_Handler, self))
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    def get(self, name: str) -> Reply | None:
        """The page, name "", or a file below it; None where there is nothing of that name."""
        raise NotImplementedError

    def post(self, body: str) -> Reply:
        """The reply to what the page sends; a ValueError or OSError becomes a `refusal`."""
        raise NotImplementedError

    def refusal(self, error: Exception) -> Reply:
        """The reply that says the fault of what was sent, or of what is behind the page."""
        return Reply(str(error), kind=TEXT)

    @property
    def address(self) -> str:
        """The page's address, for a browser of this machine."""
        return f"http://{HOST}:{self._server.server_port}{self.path}"

    def start(self) -> Self:
        """Itself, serving until `stop` or the end of the program."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End serving."""
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


class _Handler(BaseHTTPRequestHandler):
    """GET shows the page or a file below it, POST sends to the page."""

    timeout = IDLE_SECONDS

    def __init__(self, page: LocalPage, *args: Any) -> None:
        self.page = page
        super().__init__(*args)  # answers the request

    def parse_request(self) -> bool:
        """True for a request below the page's own address; any other is answered here."""
        is_request = super().parse_request()
        if is_request and not self.path.startswith(self.page.path):
            self._nothing()
        return is_request and self.path.startswith(self.page.path)

    def do_GET(self) -> None:
        try:
            reply = self.page.get(self.path.removeprefix(self.page.path))
        except (ValueError, OSError) as error:  # a damaged file behind the page
            reply = self.page.refusal(error)._replace(status=HTTPStatus.INTERNAL_SERVER_ERROR)
        self._nothing() if reply is None else self._send(reply)

    def do_POST(self) -> None:
        if self.path != self.page.path:
            return self._nothing()
        try:
            reply = self.page.post(self._body())
        except (ValueError, OSError) as error:
            reply = self.page.refusal(error)._replace(status=HTTPStatus.BAD_REQUEST)
        self._send(reply)

    def _body(self) -> str:
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch("[0-9]{1,9}", length) or int(length) > self.page.most_bytes:
            raise ValueError(f"at most {self.page.most_bytes} bytes are taken")
        return self.rfile.read(int(length)).decode("utf-8", "replace")

    def _nothing(self) -> None:
        self._send(Reply("There is nothing here.", HTTPStatus.NOT_FOUND, TEXT))

    def _send(self, reply: Reply) -> None:
        """Sends a reply; a browser that has closed the page before it has come is no fault."""
        content = reply.content if isinstance(reply.content, bytes) else reply.content.encode()
        headers = {"Content-Type": reply.kind, "Content-Length": str(len(content)), "Cache-Control": "no-store"}
        with suppress(ConnectionError):
            self.send_response(reply.status)
            for name, value in (headers | ({"Location": reply.location} if reply.location else {})).items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)
        if reply.is_last:
            self.page.finished.set()

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the user's terminal is no place for requests."""


# A study as a plain local page, in a browser or in a frame of a notebook; it talks to this machine alone.

TITLE = "Listening study"
FRAME_HEIGHT = 860  # pixels: question, player and answers


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
        trials, waiting = self._trials, self._log.resume(self._trials)
        if not waiting:
            return (), _page(text=f"Thank you. All {len(trials)} answers are saved; you can close this page.")
        number, frame = len(trials) - len(waiting) + 1, framed(self._show(waiting[0]))
        return waiting, _page(trials=trials, trial=waiting[0], number=number, frame=frame, action=self.address)

    def _repr_html_(self) -> str:
        return framed(self.turn()[1], title=TITLE, height=FRAME_HEIGHT)

    def answer(self, trial: str, choice: str) -> None:
        """Writes an answer; one that is no longer asked for, from a page sent twice, changes nothing."""
        with self._answering:
            if trial in {one.id for one in self._log.resume(self._trials)}:
                seconds = round(time.monotonic() - self._since, 3)
                self._log.record(self._trials, trial, choice, seconds=seconds)


# A local page that plays a song while a person taps its beats and marks "one".

SOUND = "sound.wav"


class TapServer(LocalPage):
    """Plays a song in a browser on this machine and takes the taps to it.

    Parameters
    ----------
    title : str, name of the song
    audio : Audio
    save : function(taps, ones) -> str
        Keeps the (K,) times of all taps and the (D,) times of those on "one", in seconds of audio time, and returns
        what to tell the person. Its ValueErrors and OSErrors are told too, and the person may go on tapping.
    port : int, 0 for any free one

    Attributes
    ----------
    finished : threading.Event, set when taps were saved
    """

    most_bytes = 2**20

    def __init__(
        self, title: str, audio: Audio, save: Callable[[FloatArray, FloatArray], str], *, port: int = 0
    ) -> None:
        super().__init__(port=port)
        self._title, self._save, self._sound = title, save, wav_bytes(audio)

    def get(self, name: str) -> Reply | None:
        """The page, or its sound."""
        if name == SOUND:
            return Reply(self._sound, kind="audio/wav")
        return None if name else Reply(rendered("tap.html.j2", title=self._title, sound=SOUND))

    def post(self, body: str) -> Reply:
        """Hands on the taps, ``{"taps": [seconds, ...], "ones": [seconds, ...]}``."""
        content = _parsed(body)
        taps, ones = (number_array(content.get(name), name, (None,)) for name in ("taps", "ones"))
        return Reply(self._save(taps, ones), kind=TEXT, is_last=True)


def _parsed(body: str) -> dict[str, Any]:
    """The record in a text of JSON."""
    try:
        content = json.loads(body)
    except RecursionError:
        raise ValueError("taps lie in lists within lists") from None
    if not isinstance(content, dict):
        raise ValueError("taps come as a record of JSON")
    return content
