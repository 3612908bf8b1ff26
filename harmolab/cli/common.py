"""What every command needs: plain errors, progress bars, reading a corpus, numbers for tables."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from harmolab.data.folders import Recording
    from harmolab.types import Audio, BeatTrack

PAGES = (".html", ".htm")


@contextmanager
def plain_errors() -> Iterator[None]:
    """One line on standard error and exit code 2 in place of a traceback for bad input."""
    try:
        yield
    except (ValueError, OSError) as error:
        typer.echo(f"harmolab: {error}", err=True)
        raise typer.Exit(2) from None


def progress(items: Iterable[Any], label: str) -> Iterable[Any]:
    """`items` with a progress bar on standard error; silent when that is no terminal."""
    from tqdm import tqdm

    return tqdm(items, desc=label, unit="", leave=False, disable=not sys.stderr.isatty())


def sequences_of(corpus: Path, dances: tuple[str, ...] = ()) -> Iterator[Recording]:
    """Readable sequences, one at a time; what cannot be read is told on standard error."""
    from harmolab.data.folders import Problem, find_recordings, load_recording

    found = find_recordings(corpus)
    if not found.folders:
        raise ValueError(f"{corpus}: holds no sequence folder; see `harmolab data check {corpus}`")
    problems = list(found.problems)
    for folder in progress(found.folders, corpus.name):
        try:
            sequence = load_recording(folder)
        except (ValueError, FileNotFoundError) as error:
            problems.append(Problem(folder, str(error)))
            continue
        if not dances or sequence.clip.dance in dances:
            yield sequence
    for problem in problems:
        typer.echo(f"harmolab: left out: {problem.message}", err=True)


def check_out(out: Path, what: str, suffixes: tuple[str, ...]) -> None:
    """ValueError unless `out` ends in one of the suffixes and can be written; to be asked before any work."""
    if out.suffix.lower() not in suffixes:
        raise ValueError(f"{out}: {what} is written as {', '.join(suffixes)}; choose a name that ends so")
    if not out.resolve().parent.is_dir():
        raise ValueError(f"{out.parent}: no such folder")
    if out.suffix.lower() in PAGES and find_spec("jinja2") is None:
        raise ValueError(f"{out}: pages need jinja2; install it with: pip install 'harmolab[lab]'")


@contextmanager
def finding_beats() -> Iterator[None]:
    """A note on the screen while beats are tracked, which takes long the first time on a machine."""
    from rich.console import Console

    with Console(stderr=True).status("finding the beats (the first time on a machine: half a minute)"):
        yield


def track_beats(audio: Audio, dance: str) -> BeatTrack:
    """`audio_beats` with a prior for the tempo of `dance` ("": none)."""
    from harmolab.beats.audio import audio_beats

    with finding_beats():
        return audio_beats(audio, tempo=dance or None)


def show(value: Any) -> str:
    """A number or an interval for a table; "-" for what does not exist."""
    if isinstance(value, tuple | list):
        return " to ".join(map(show, value))
    if value is None or value != value:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def write_text(path: Path, text: str) -> None:
    """Write a line or more of text, whole or not at all."""
    from harmolab.io import files

    files.write_text(path, text + "\n")
