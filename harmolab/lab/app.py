"""The page of `harmolab app`: takes a dance and a song, has them looked at, and shows what comes of it.

Files lie in a temporary folder. The work is done by another process, the worker, which also watches: where the page's
own process is killed, the worker removes the folder; where both are, the next page does. It may break off (out of
memory, a decoder that crashes); then the page says so, and another one is started.

Voila over a notebook would show the same. It sends an upload through a websocket as one message, 300 MB of it too.
"""

import json
import multiprocessing
import os
import re
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from filelock import FileLock, Timeout

from harmolab.lab.listening.local_page import TEXT, LocalPage, Reply, record_in
from harmolab.lab.report.templates import rendered
from harmolab.params import HOW_PATTERNS

PREFIX, LOCK = "harmolab_app_", "lock"
MOST = 2**30  # bytes of a file
LONGEST_NAME = 60
SLOTS = ("dance", "song")
TRIES = 20  # to remove a folder
EVERY = 0.2  # seconds between two words on how far the work is
BROKEN = "The work broke off: this machine may have too little memory for it, or the file is damaged in an odd way."
BUSY = "Something is being worked on; wait, or stop it."
KINDS = {".html": "text/html; charset=utf-8", ".mp4": "video/mp4"}
STOPS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Order(NamedTuple):
    """A task and its files.

    Parameters
    ----------
    task : str
    song, dance : Path or None
    style : str, name of the dance, "" where it is not told
    offset : float or None, seconds, song time at which the dance begins
    folder : Path, an empty folder for what is written
    has_start : bool, False where the offset is one that was found from the movement, which tells no place in the beat
    how : str, what is meant to be done on the beat, a name in `HOW_PATTERNS`, "" where it is not told
    """

    task: str
    song: Path | None
    dance: Path | None
    style: str
    offset: float | None
    folder: Path
    has_start: bool = True
    how: str = ""


@dataclass(frozen=True)
class Teller:
    """Tells the page how far the work is and what has come of it; `send` takes a record."""

    send: Callable[[dict[str, Any]], None]

    def step(self, text: str, share: float | None = None) -> None:
        """The step that is being done, and the share of it that is done, if that is known."""
        self.send({"step": text, "share": share})

    def progress(self, items: Iterable[Any], label: str) -> Iterator[Any]:
        """The items; now and then the page hears how many are done."""
        total, before = len(items) if isinstance(items, Sized) else 0, 0.0
        for count, item in enumerate(items):
            if time.monotonic() - before > EVERY:
                before = time.monotonic()
                self.step(label if total else f"{label}: {count}", count / total if total else None)
            yield item

    def lines(
        self, lines: Sequence[str], *, is_good: bool = False, offset: float | None = None, has_start: bool = True
    ) -> None:
        """The answer, first its headline; and where in the song the dance begins, as in `Order`."""
        self.send({"lines": list(lines), "good": is_good, "offset": offset, "has_start": has_start})

    def view(self, kind: str, path: Path, title: str) -> None:
        """A file to look at: a "page", a "film", or one to keep, a "file"."""
        self.send({"view": {"kind": kind, "title": title, "name": path.name}, "path": str(path)})


Work = Callable[[Order, Teller], None]
WorkOf = Callable[[], Work]  # imports it, in the process that does it


class Worker:
    """A process that does one order after another; it removes `folder` where the process that started it is gone.

    Parameters
    ----------
    work_of : function () -> Work, called once in the process, so that this one need not import what the work needs
    folder : Path
    hear : function(worker, record), called with all that it tells, with {"end": fault} at the end of an order, and with
        {"broken": True} where the process is gone
    """

    def __init__(self, work_of: WorkOf, folder: Path, hear: "Hear") -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, end = context.Pipe()
        self._process = context.Process(target=_work, args=(work_of, end, folder), daemon=True)
        self._process.start()
        end.close()  # the worker has it: where the worker ends, so does the pipe
        threading.Thread(target=self._listen, args=(hear,), daemon=True).start()

    def _listen(self, hear: "Hear") -> None:
        with suppress(EOFError, OSError):
            while True:
                hear(self, self._pipe.recv())
        self._process.join()  # its pipe ends a moment before it does, and it is not to be taken for alive
        hear(self, {"broken": True})

    @property
    def is_alive(self) -> bool:
        """False where the process has ended."""
        return self._process.is_alive()

    def do(self, order: Order) -> None:
        """Begin an order."""
        with suppress(OSError):  # it is gone, and `_listen` says so
            self._pipe.send(order)

    def stop(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.join()


Hear = Callable[[Worker, dict[str, Any]], None]


def _work(work_of: WorkOf, pipe: Connection, folder: Path) -> None:
    """The life of a worker."""

    def leave(*_: Any) -> None:
        removed(folder)
        os._exit(0)

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
        leave()

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the page's process, which ends this one
    for number in STOPS:
        signal.signal(number, leave)
    threading.Thread(target=watch, daemon=True).start()
    work, teller = work_of(), Teller(pipe.send)
    with suppress(EOFError, ConnectionError):  # the page's process is gone
        while True:
            order, fault = pipe.recv(), ""
            try:
                work(order, teller)
            except (ValueError, OSError, MemoryError) as error:
                fault = str(error) or BROKEN
            pipe.send({"end": fault})
    leave()


def removed(folder: Path) -> None:
    """Remove a folder, also while another process writes into it."""
    for _ in range(TRIES):
        if folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def sweep() -> None:
    """Remove the folders of pages whose processes are gone; those that live hold a lock."""
    for lock in Path(tempfile.gettempdir()).glob(f"{PREFIX}*/{LOCK}"):
        with suppress(Timeout, OSError), FileLock(lock, timeout=0):
            removed(lock.parent)


class AppServer(LocalPage):
    """Takes a dance and a song in a browser on this machine, and shows what is known of them.

    Parameters
    ----------
    work_of : see `Worker`; its tasks are "judge", "fit" and "dance"
    endings : "dance" and "song" -> the endings of the files that are taken
    styles : names of dances that may be told
    port : int, 0 for any free one

    Attributes
    ----------
    folder : Path of all files, which `stop` removes
    """

    most_upload = MOST

    def __init__(
        self, work_of: WorkOf, endings: Mapping[str, Sequence[str]], styles: Sequence[str] = (), *, port: int = 0
    ) -> None:
        super().__init__(port=port)
        self._endings, self._styles, self._work_of = endings, styles, work_of
        sweep()
        self.folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        self._lock = FileLock(self.folder / LOCK, thread_local=False)
        self._lock.acquire()
        self._changing = threading.RLock()
        self._files: dict[str, Path] = {}
        self._shown: dict[str, Path] = {}  # address below the page -> file
        self._count = 0  # of orders
        self._state: dict[str, Any] = _fresh("")
        self._place: dict[str, Any] = {}  # fields of an `Order`: where the last verdict found that the dance begins
        self._is_looked_for = False  # whether that verdict looks for it
        with self._changing:
            self._worker = self._new_worker()

    def _new_worker(self) -> Worker:
        return Worker(self._work_of, self.folder, self._hear)

    def stop(self) -> None:
        """End serving and working, and remove all files."""
        super().stop()
        with self._changing:
            worker, self._worker = self._worker, None  # type: ignore[assignment]  # its end is no fault
        worker.stop()
        self._lock.release()
        removed(self.folder)

    def get(self, name: str) -> Reply | None:
        """The page, its "state" as JSON, or a file that came of the work."""
        if name == "state":
            with self._changing:
                names = {slot: path.name for slot, path in self._files.items()}
                return Reply(json.dumps(self._state | {"files": names}), kind="application/json")
        path = self._shown.get(name)
        if path is not None and path.is_file():
            return Reply(path, kind=KINDS.get(path.suffix, "application/octet-stream"))
        if name:
            return None
        return Reply(rendered("app.html.j2", endings=self._endings, styles=self._styles, most=self.most_upload))

    def put(self, name: str, chunks: Iterator[bytes]) -> Reply | None:
        """Keeps a file, "dance/NAME" or "song/NAME", in place of the one before."""
        slot, _, named = name.partition("/")
        if slot not in SLOTS:
            return None
        name = re.sub(r"[^\w .,()+-]", "_", named)[-LONGEST_NAME:].lstrip(". ")
        if Path(name).suffix.lower() not in self._endings[slot]:
            raise ValueError(f"{named}: a {slot} ends in {', '.join(self._endings[slot])}")
        self._check_idle()
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        try:
            with (folder / name).open("wb") as file:
                file.writelines(chunks)
            self._take(slot, folder / name)
        except BaseException:
            removed(folder)
            raise
        return Reply("", kind=TEXT)

    def _take(self, slot: str, path: Path | None) -> None:
        """Puts a file, or none, in the place of the one before; what was said of that pair goes with it.

        ValueError while one works with the files, which may have begun as this one came in.
        """
        with self._changing:
            self._check_idle()
            before = self._files.pop(slot, None)
            if path is not None:
                self._files[slot] = path
            self._state, self._place = _fresh(""), {}
        if before is not None:
            removed(before.parent)

    def post(self, body: str) -> Reply:
        """Does what a button asks for: an order, "stop" it, "forget" a file, or "close" the page."""
        content = record_in(body, "orders")
        task = content.get("task")
        if task == "stop":
            self._renew("Stopped.")
        elif task == "forget":
            self._take(str(content.get("slot")), None)
        elif task in ("judge", "fit", "dance"):
            style, how = (str(content.get(name) or "") for name in ("style", "how"))
            self._begin(task, style, how, _seconds(content.get("offset")))
        elif task != "close":
            raise ValueError(f"there is no {task!r}")
        return Reply("", kind=TEXT, is_last=task == "close")

    def _check_idle(self) -> None:
        if self._state["working"]:
            raise ValueError(BUSY)

    def _begin(self, task: str, style: str, how: str, offset: float | None) -> None:
        """Hands an order to the worker."""
        if style and style not in self._styles:
            raise ValueError(f"{style}: is no dance that is known")
        if how and how not in HOW_PATTERNS:
            raise ValueError(f"{how}: is nothing that is done on a beat")
        with self._changing:
            self._check_idle()
            if not self._worker.is_alive:
                self._renew(BROKEN)
            self._count += 1
            folder = self.folder / f"work{self._count}"
            folder.mkdir()
            self._state = _fresh(task, number=self._count)
            self._is_looked_for = task == "judge" and offset is None
            if task == "judge":
                self._place = {}
            place = {"offset": offset} | (self._place if task == "fit" and offset is None else {})
            dance, song = map(self._files.get, SLOTS)
            self._worker.do(Order(task, song, dance, style, folder=folder, how=how, **place))

    def _renew(self, fault: str) -> None:
        """Another worker in place of this one, whose order is given up."""
        with self._changing:
            self._worker.stop()
            self._worker = self._new_worker()
            if self._state["working"]:
                self._state |= {"working": False, "fault": fault}

    def _hear(self, worker: Worker, record: dict[str, Any]) -> None:
        """A record of the worker becomes part of the state; one that was given up tells nothing more."""
        with self._changing:
            if worker is not self._worker:
                return
            if "view" in record:
                address = f"{self._count}/{record['view']['name']}"
                self._shown[address] = Path(record["path"])
                self._state["views"].append({**record["view"], "address": address})
            elif "lines" in record:
                self._state |= {**record, "lines": [self._plain(line) for line in record["lines"]]}
                if self._is_looked_for:
                    self._place = {name: record[name] for name in ("offset", "has_start")}
            elif "step" in record:
                self._state |= record
            elif self._state["working"]:
                self._state |= {"working": False, "fault": self._plain(record.get("end", BROKEN))}

    def _plain(self, text: str) -> str:
        """Words without the folder in which the files lie, and without what a command takes."""
        return without_options(re.sub(re.escape(f"{self.folder}{os.sep}") + r"[^/\\]+[/\\]", "", text))


def without_options(sentence: str) -> str:
    """A sentence without the options in brackets and the order of files of a command: a page has fields for them.

    What it has no field for, a file of beats, is left out whole.

    >>> without_options("Say the dance (--dance waltz), or film with the song playing.")
    'Say the dance, or film with the song playing.'
    """
    return re.sub(
        r"(?:, (?:and give them|or say its beats))? \((?:or )?--[^)]*\)|, before the film or in its place", "", sentence
    )


def _fresh(task: str, *, number: int = 0) -> dict[str, Any]:
    """The state at the begin of an order."""
    nothing: dict[str, Any] = {"lines": [], "good": False, "offset": None, "views": [], "fault": ""}
    return nothing | {"task": task, "number": number, "working": bool(task), "step": "reading", "share": None}


def _seconds(text: Any) -> float | None:
    """The number of seconds in a field; None where it is empty."""
    if text in (None, ""):
        return None
    with suppress(TypeError, ValueError, OverflowError):
        if isfinite(seconds := float(text)):
            return seconds
    raise ValueError(f"{text}: seconds are a number")
