"""A page for a browser of this machine alone: an address that holds a secret, requests, replies."""

from __future__ import annotations

import re
import secrets
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, NamedTuple, Self

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
