"""All that commands say beside their results: notes, errors, progress; less of it with --quiet, more with --verbose."""

import errno
import io
import logging
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Annotated, Any, NoReturn

import typer

EVERY = 5.0  # seconds to the first line about long work where there is no terminal; the gaps grow
LONGEST = 30.0  # seconds between them in the end
QUIET, USUAL, VERBOSE = -1, 0, 1
LEVEL = ContextVar("level", default=USUAL)  # of what a command says
WATCHER: ContextVar[Any] = ContextVar("watcher", default=None)  # a `Teller`, which hears of long work: no screen does
KEY = "harmolab.level"  # of the same in the meta data of a call, as long as its options are read


def printable(text: str) -> str:
    """`text` in one line: new lines, and all else that no terminal should get, as escape sequences."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


@contextmanager
def said_level(context: typer.Context) -> Iterator[None]:
    """The level that the options of a call ask for, and the log of the package on the screen, inside the block."""
    token = LEVEL.set(context.meta.get(KEY, USUAL))
    log, notes = logging.getLogger("harmolab"), _Notes()
    level = log.level
    log.addHandler(notes)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.setLevel(level)
        log.removeHandler(notes)
        LEVEL.reset(token)


class _Notes(logging.Handler):
    """Notes of all that the package logs, such as that it compiles."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line on standard error, unless it is to be quiet."""
        note(record.getMessage())


def _level(value: int, *names: str, about: str) -> Any:
    """An option that sets the level."""

    def keep(context: typer.Context, is_on: bool) -> None:
        if is_on and context.meta.setdefault(KEY, value) != value:
            refuse("--quiet and --verbose exclude each other")

    return typer.Option(*names, help=about, callback=keep, expose_value=False, is_eager=True)


Quiet = Annotated[bool, _level(QUIET, "--quiet", "-q", about="Print results only: no notes, no progress.")]
SETTINGS = "Print also what is read and how, all settings, and where an error arose."
Verbose = Annotated[bool, _level(VERBOSE, "--verbose", "-v", about=SETTINGS)]


def is_verbose() -> bool:
    """True for those who want to know all."""
    return LEVEL.get() >= VERBOSE


def note(message: str) -> None:
    """One line on standard error, unless it is to be quiet."""
    if LEVEL.get() > QUIET:
        _line(message)


def detail(message: str) -> None:
    """One line on standard error for those who want to know all."""
    if is_verbose():
        _line(message)


def _line(message: str) -> None:
    typer.echo(f"harmolab: {printable(message)}", err=True)


def say(*lines: str, err: bool = False) -> None:
    """Lines of a result."""
    for line in lines:
        typer.echo(printable(line), err=err)


def wrote(*paths: Path | None, err: bool = False) -> None:
    """The line that a file, if any, was written, for each, unless it is to be quiet."""
    if LEVEL.get() > QUIET:
        say(*(f"wrote {path}" for path in paths if path is not None), err=err)


def refuse(message: str) -> NoReturn:
    """One line on standard error, and exit code 2."""
    _line(message)
    raise typer.Exit(2)


@contextmanager
def plain_errors() -> Iterator[None]:
    """One line on standard error and exit code 2 in place of a traceback for bad input; both with --verbose."""
    try:
        yield
    except BrokenPipeError:  # of who reads what is printed, and has read enough
        raise
    except (ValueError, OSError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and not str(error).startswith("Symlink loop"):  # before Python 3.13
            raise
        if is_verbose():
            typer.echo(traceback.format_exc(), err=True)
        # A file that meets a full disk is named where it is written.
        is_full = getattr(error, "errno", 0) == errno.ENOSPC
        name = getattr(error, "filename", None) or ("standard output" if is_full else None)
        refuse(f"{name}: {error.strerror}" if name and error.strerror else str(error))  # type: ignore[union-attr]


def progress(items: Iterable[Any], label: str) -> Iterable[Any]:
    """`items` with a progress bar on standard error, or a line every few seconds where that is no terminal."""
    if watcher := WATCHER.get():
        return watcher.progress(items, label)
    if LEVEL.get() <= QUIET:
        return items
    if not sys.stderr.isatty():
        return _counted(items, label)
    from tqdm import tqdm

    return tqdm(items, desc=label, unit="", leave=False)


def _counted(items: Iterable[Any], label: str) -> Iterator[Any]:
    """`items` with a line every few seconds that says how many are done."""
    total = f" of {len(items)}" if isinstance(items, Sized) else ""
    done = 0
    with _lines(lambda: f"{label}: {done}{total}"):
        for item in items:
            yield item
            done += 1


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Words on the screen while something takes long that cannot be counted."""
    if watcher := WATCHER.get():
        watcher.step(text)
        yield
    elif LEVEL.get() <= QUIET:
        yield
    elif not sys.stderr.isatty():
        with _lines(lambda: text):
            yield
    else:
        from rich.console import Console

        with Console(stderr=True).status(text):
            yield


@contextmanager
def _lines(text: Callable[[], str]) -> Iterator[None]:
    """A line on standard error every few seconds: the text of that moment and the seconds since the begin."""
    begin, stderr, done = monotonic(), sys.stderr, Event()

    def print_lines() -> None:
        gap = EVERY
        while not done.wait(gap):
            gap = min(1.5 * gap, LONGEST)
            typer.echo(f"harmolab: {printable(text())} ({monotonic() - begin:.0f} s)", file=stderr)

    thread = Thread(target=print_lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def finding_beats() -> Any:
    """`waiting` for the beats of a song."""
    return waiting("finding the beats")


@contextmanager
def quiet_decoders() -> Iterator[None]:
    """Keep what decoders in C print ("part2_3_length too large") off the screen, but for those who want to know all.

    They write to file 2 past Python, so Python's own standard error moves to another file meanwhile.
    """
    if is_verbose() or not _is_file_2(sys.stderr):
        yield
        return
    python, screen, nothing = sys.stderr, os.dup(2), os.open(os.devnull, os.O_WRONLY)
    python.flush()
    sys.stderr = open(screen, "w", encoding=python.encoding, errors=python.errors, buffering=1)  # noqa: SIM115, PTH123
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(screen, 2)
        sys.stderr.close()
        os.close(nothing)
        sys.stderr = python


def _is_file_2(stream: Any) -> bool:
    with suppress(AttributeError, io.UnsupportedOperation):
        return bool(stream.fileno() == 2)
    return False
