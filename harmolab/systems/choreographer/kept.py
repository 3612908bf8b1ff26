"""Corpora that were read before: the second dance from the same files does not read and measure them again."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from harmolab.io.files import PathLike, Progress, cache_folder, silent
from harmolab.systems.choreographer.generate import Choreographer

SIGNATURE = 1  # raise it when the same files give another choreographer than before
MOST_FILES = 50_000  # below a folder that holds more nothing is kept


def load_corpus(corpus: PathLike, *, scale: float | None = None, progress: Progress = silent) -> Choreographer:
    """The choreographer of a corpus, a saved model or a motion file, with its limits of likeness.

    What was read once is kept in the user's cache (`harmolab.io.files.cache_folder`), as long as no file below the
    folder changes in name, size or time. `scale` is as in `Choreographer.read`.

    Raises
    ------
    FileNotFoundError, ValueError
        As `Choreographer.read`; both name the file or folder.
    """
    if (Path(corpus) / "model.json").is_file():
        return Choreographer.load(corpus)
    place = _place(Path(corpus), scale)
    if place is not None:
        with suppress(OSError, ValueError):
            return Choreographer.load(place)
    choreographer = Choreographer.read([corpus], scale=scale, progress=progress)
    return choreographer if place is None else _keep(choreographer, place)


def _place(corpus: Path, scale: float | None) -> Path | None:
    """The folder in the cache for a corpus as it is now; None where nothing is kept."""
    folder = cache_folder()
    files = [] if folder is None else list(_files(corpus))
    if folder is None or not files or len(files) > MOST_FILES:
        return None
    lines = [f"{path.relative_to(corpus)} {path.stat().st_size} {path.stat().st_mtime_ns}" for path in files]
    return folder / "corpora" / f"{_digest(str(corpus.resolve()))}_{_digest(f'{SIGNATURE} {scale} {sorted(lines)}')}"


def _files(corpus: Path) -> Iterator[Path]:
    """The corpus itself, or the files below it, as many as are looked at."""
    paths = [corpus] if corpus.is_file() else corpus.rglob("*")
    for number, path in enumerate(path for path in paths if path.is_file()):
        if number > MOST_FILES:
            return
        yield path


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]


def _keep(choreographer: Choreographer, place: Path) -> Choreographer:
    """Keep a choreographer in place of what was kept of the same folder; it comes back as it will be read.

    A cache that cannot be written is no error.
    """
    with suppress(OSError):
        choreographer.save(place)
        for older in place.parent.glob(f"{place.name.partition('_')[0]}_*"):
            if older != place:
                shutil.rmtree(older, ignore_errors=True)
        return Choreographer.load(place)
    return choreographer
