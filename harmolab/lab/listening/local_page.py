"""Pages that only a browser of this machine can open: their address holds a secret.

One asks the trials of a study; another plays a song and takes a person's taps.
"""

import io
import json
import re
import secrets
import shutil
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self
from urllib.parse import parse_qs, unquote

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import ANCHORS, ASKED, MARKED, MOST, Trial, TrialSet
from harmolab.lab.report.templates import framed, rendered
from harmolab.readers.arrays import number_array
from harmolab.readers.audio import wav_bytes
from harmolab.types import Audio, FloatArray

HOST = "127.0.0.1"
IDLE_SECONDS = 30.0
CHUNK = 2**18  # bytes of a file that are held at a time
HTML, TEXT = "text/html; charset=utf-8", "text/plain; charset=utf-8"


class Reply(NamedTuple):
    """Content (or the file of it), status and kind of an answer; after one that `is_last` the page is finished."""

    content: str | bytes | Path
    status: HTTPStatus = HTTPStatus.OK
    kind: str = HTML
    location: str = ""
    is_last: bool = False


class LocalPage:
    """Serves one page, and what belongs to it, on this machine.

    It listens on 127.0.0.1 only. Its address holds a secret, so that another page open in the browser can neither read
    what it shows nor answer. A request for another host is not answered: a name of another site may lead here too.

    Parameters
    ----------
    port : int, 0 for any free one

    Raises
    ------
    ValueError
        The port cannot be opened, as where another program has it.

    Attributes
    ----------
    path : str, the page's place on the server
    finished : threading.Event, set when the last reply was sent
    """

    most_bytes = 4096  # of what a browser sends
    most_upload = 0  # bytes of a file

    def __init__(self, *, port: int = 0) -> None:
        self.path = f"/{secrets.token_urlsafe(16)}/"
        self.finished = threading.Event()
        try:
            self._server = ThreadingHTTPServer((HOST, port), partial(_Handler, self))
        except (OSError, OverflowError) as error:
            fault = getattr(error, "strerror", error)
            raise ValueError(f"port {port}: {fault}; choose another (0: any), or end what uses it") from None
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    def get(self, name: str) -> Reply | None:
        """The page, name "", or a file below it; None where there is nothing of that name."""
        raise NotImplementedError

    def post(self, body: str) -> Reply:
        """The reply to what the page sends; a ValueError or OSError becomes a `refusal`."""
        raise NotImplementedError

    def put(self, name: str, chunks: Iterator[bytes]) -> Reply | None:
        """The reply to a file that is sent, in pieces as they come; errors as of `post`. None: no file is taken."""
        return None

    def refusal(self, error: Exception) -> Reply:
        """The reply that says the fault of what was sent, or of what is behind the page."""
        return Reply(str(error), kind=TEXT)

    @property
    def hosts(self) -> tuple[str, str]:
        """The names that a request may have for this machine."""
        return f"{HOST}:{self._server.server_port}", f"localhost:{self._server.server_port}"

    @property
    def address(self) -> str:
        """The page's address, for a browser of this machine."""
        return f"http://{HOST}:{self._server.server_port}{self.path}"

    def start(self) -> Self:
        """Itself, serving until `stop` or the end of the program. A cell that is run again may start it again."""
        if not self._thread.is_alive():
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
    """GET shows the page or a file below it, POST sends to the page, PUT sends a file."""

    timeout = IDLE_SECONDS

    def __init__(self, page: LocalPage, *args: Any) -> None:
        self.page = page
        super().__init__(*args)  # answers the request

    def handle(self) -> None:
        """Answers one connection; a browser that breaks it off is no fault."""
        with suppress(ConnectionError):
            super().handle()

    def parse_request(self) -> bool:
        """True for a request below the page's own address; any other is answered here."""
        if not super().parse_request():
            return False
        is_ours = self.path.startswith(self.page.path) and self.headers.get("Host", "") in self.page.hosts
        if not is_ours:
            self._nothing()
        return is_ours

    @property
    def name(self) -> str:
        """The part of the address below the page."""
        return unquote(self.path.removeprefix(self.page.path))

    def do_GET(self) -> None:
        # An error is a damaged file behind the page.
        self._answer(lambda: self.page.get(self.name), HTTPStatus.INTERNAL_SERVER_ERROR)

    def do_POST(self) -> None:
        self._answer(lambda: None if self.name else self.page.post(self._body()), HTTPStatus.BAD_REQUEST)

    def do_PUT(self) -> None:
        self._answer(self._put, HTTPStatus.BAD_REQUEST)

    def _answer(self, reply_of: Callable[[], Reply | None], status: HTTPStatus) -> None:
        """Sends a reply, or the refusal of what cannot be done."""
        try:
            reply = reply_of()
        except (ValueError, OSError) as error:
            reply = self.page.refusal(error)._replace(status=status)
        self._nothing() if reply is None else self._send(reply)

    def _put(self) -> Reply | None:
        chunks = self._chunks(self._length(self.page.most_upload))
        try:
            return self.page.put(self.name, chunks)
        finally:
            deque(chunks, maxlen=0)  # a browser reads no reply before it has sent all

    def _chunks(self, length: int) -> Iterator[bytes]:
        """The pieces of a file, as they come; ValueError where it ends before its length."""
        while length:
            chunk = self.rfile.read(min(CHUNK, length))
            if not chunk:
                raise ValueError("the file came in part only")
            length -= len(chunk)
            yield chunk

    def _length(self, most: int) -> int:
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch("[0-9]{1,12}", length) or int(length) > most:
            raise ValueError(f"at most {most} bytes are taken")
        return int(length)

    def _body(self) -> str:
        return self.rfile.read(self._length(self.page.most_bytes)).decode("utf-8", "replace")

    def _nothing(self) -> None:
        self._send(Reply("There is nothing here.", HTTPStatus.NOT_FOUND, TEXT))

    def _send(self, reply: Reply) -> None:
        """Sends a reply; a browser that has closed the page before it has come is no fault."""
        with closing(_opened(reply.content)) as content, suppress(ConnectionError):
            length = content.seek(0, io.SEEK_END)
            content.seek(0)
            headers = {"Content-Type": reply.kind, "Content-Length": str(length), "Cache-Control": "no-store"}
            self.send_response(reply.status)
            for name, value in (headers | ({"Location": reply.location} if reply.location else {})).items():
                self.send_header(name, value)
            self.end_headers()
            shutil.copyfileobj(content, self.wfile)
        if reply.is_last:
            self.page.finished.set()

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the user's terminal is no place for requests."""


def _opened(content: str | bytes | Path) -> BinaryIO:
    if isinstance(content, Path):
        return content.open("rb")
    return io.BytesIO(content if isinstance(content, bytes) else content.encode(errors="replace"))


# A study as a local page, in a browser or in a frame of a notebook

TITLE = "Listening study"
FRAME_HEIGHT = 860  # pixels: question, player and answers


def _page(**values: Any) -> str:
    return rendered("study.html.j2", title=TITLE, asked=ASKED, anchors=ANCHORS, most=MOST, **values)


class StudyServer(LocalPage):
    """A page that asks one rater the trials of a study, in a browser on this machine.

    Parameters
    ----------
    trials : TrialSet
        As of `make_trials`.
    log : AnswerLog
        As of `answer_log`. An answer is written to it before the next page is sent.
    show : function from a Trial to its page
        Such as one that calls `blind_page`; the page stands in a frame of this one.
    port : int
        0 for any free one.

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
    finished : threading.Event
        Set when all trials are answered, and the page of thanks was sent.
    """

    def __init__(self, trials: TrialSet, log: AnswerLog, show: Callable[[Trial], str], *, port: int = 0) -> None:
        super().__init__(port=port)
        self._trials, self._log, self._show = trials, log, show
        self._answering = threading.Lock()

    def get(self, name: str) -> Reply | None:
        """The page that asks the next trial, or the page of thanks; None for any other address."""
        if name:
            return None
        waiting, page = self.turn()
        return Reply(page, is_last=not waiting)

    def post(self, body: str) -> Reply:
        """Write the answer of a form, and lead back to the page."""
        form = parse_qs(body)
        try:
            marks = " ".join(form.get(name, [""])[0] for name in MARKED)
            choice = marks if self._trials.kind == "rate" else form.get("choice", [""])[0]
            self.answer(form.get("trial", [""])[0], choice)
        except (ValueError, OSError) as error:
            raise ValueError(f"The answer was not saved: {error}") from None
        return Reply("", HTTPStatus.SEE_OTHER, location=self.path)

    def refusal(self, error: Exception) -> Reply:
        """A page that shows an error."""
        return Reply(_page(text=str(error)))

    def turn(self) -> tuple[tuple[Trial, ...], str]:
        """The trials that have no answer yet, and the page that asks the first of them."""
        trials, waiting = self._trials, self._log.resume(self._trials)
        if not waiting:
            return (), _page(text=f"Thank you. All {len(trials)} answers are saved; you can close this page.")
        number, frame = len(trials) - len(waiting) + 1, framed(self._show(waiting[0]))
        return waiting, _page(trials=trials, trial=waiting[0], number=number, frame=frame, action=self.address)

    def _repr_html_(self) -> str:
        return framed(self.turn()[1], title=TITLE, height=FRAME_HEIGHT)

    def answer(self, trial: str, choice: str) -> None:
        """Write an answer; one to a trial that has an answer, as from a page that was sent twice, changes nothing."""
        with self._answering:
            if trial in {one.id for one in self._log.resume(self._trials)}:
                self._log.record(self._trials, trial, choice)


# A song to which a person taps its beats and marks "one"

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
        content = record_in(body, "taps")
        taps, ones = (number_array(content.get(name), name, (None,)) for name in ("taps", "ones"))
        return Reply(self._save(taps, ones), kind=TEXT, is_last=True)


def record_in(body: str, what: str) -> dict[str, Any]:
    """The record in a text of JSON; ValueError, which says `what` is sent, for anything else."""
    try:
        content = json.loads(body)
    except RecursionError:
        raise ValueError(f"{what} lie in lists within lists") from None
    if not isinstance(content, dict):
        raise ValueError(f"{what} come as a record of JSON")
    return content
