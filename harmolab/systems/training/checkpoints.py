"""The folder of a run: its history, its settings, and its state in one file, from which training resumes.

It resumes as if it had never stopped. Tensors are safetensors; everything else (history, settings) is JSON in the same
file's header, so that one rename publishes both. Nothing is ever unpickled. A run is resumed only with the settings of
``settings.json``, the split of ``split.json`` and the recordings of ``corpus.json``.

The history has one row an epoch: a table for people and notebooks, events for TensorBoard.
"""

import csv
import hashlib
import io
import itertools
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import torch
from filelock import FileLock, Timeout
from safetensors.torch import save
from torch import Tensor, nn
from torch.optim import Optimizer

from harmolab import files
from harmolab.systems.training.about import SETTINGS
from harmolab.systems.training.splits import Split
from harmolab.systems.training.weights import read_tensors
from harmolab.types import BeatTrack, Motion

# The history of a run, one row an epoch

HISTORY = "history.csv"
EVENTS = "events.out.tfevents.*"
Row = dict[str, Any]
Report = Callable[[Row, int], None]  # a row, and the epoch that its phase ends at


def history_text(rows: list[Row]) -> str:
    """The history as CSV; a value that an epoch does not have is empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


class EventLog:
    """The history for TensorBoard, in an events file inside the run's folder.

    A run that resumes replaces the file by the history so far, so that no epoch is there twice.

    Parameters
    ----------
    folder : of the run
    rows : the history so far
    """

    def __init__(self, folder: Path, rows: list[Row]) -> None:
        # Imported here: it takes seconds, and systems that only dance or play need it not. The `SummaryWriter` that
        # stands above it starts two threads; without the memory for them it never ends.
        from tensorboardX.event_file_writer import EventsWriter

        for stale in folder.glob(EVENTS):
            stale.unlink()
        self._writer = EventsWriter(str(folder.resolve() / "events"))
        for row in rows:
            self.add(row)

    def add(self, row: Row) -> None:
        """One more epoch, on disk when this returns."""
        from tensorboardX.proto.event_pb2 import Event

        values = [{"tag": _tag(name), "simple_value": x} for name, x in row.items() if isinstance(x, float)]
        self._writer.write_event(Event(wall_time=time.time(), step=row["epoch"], summary={"value": values}))
        self._writer.flush()

    def close(self) -> None:
        """No more epochs."""
        self._writer.close()


def _tag(name: str) -> str:
    """Name of a column with its group before the stroke, as TensorBoard shows it."""
    if name.startswith("val_"):
        return f"validation/{name.removeprefix('val_')}"
    return f"schedule/{name}" if name in ("rate", "tau") else f"loss/{name}"


Notice = Callable[[str], None]
Measure = Callable[[Sequence[Motion], Sequence[BeatTrack]], Mapping[str, float]]
Corpus = Callable[[], dict[str, str]]


@dataclass(frozen=True, eq=False)
class TrainOptions:
    """Options of every training beside its settings: none of them changes what is learnt.

    Parameters
    ----------
    out : folder of the run; new or empty unless `resume`
    resume : go on where the run in `out` stopped; start it when there is none
    accelerator : "auto", "cpu" or "cuda"
    report : called with each epoch's row of the history and the epoch that its phase ends at
    notice : called with a line about the material
    progress : function(iterable, label) -> iterable, of the reading
    measure : function(motions, beats) -> name -> number, of dances to validation units; further columns of the history
    corpus : function() -> file -> digest, of all files that are learnt from; a run is resumed with the same only
    """

    out: files.PathLike
    resume: bool = False
    accelerator: str = "auto"
    report: Report = lambda row, end: None
    notice: Notice = lambda line: None
    progress: files.Progress = files.silent
    measure: Measure = lambda motions, beats: {}
    corpus: Corpus = dict


class Sides(Protocol):
    """A split, as far as a run needs it."""

    def to_dict(self) -> dict[str, Any]:
        """All about it, ready for JSON."""


STATE = "state.safetensors"
FORMAT = "harmolab training state 2"
SPLIT, CORPUS, LOCK = "split.json", "corpus.json", ".lock"


# The state and the folder of a run


def save_state(
    folder: Path, modules: Mapping[str, nn.Module], optimisers: Mapping[str, Optimizer], about: Mapping[str, Any]
) -> None:
    """Replace ``state.safetensors`` by an atomic write.

    Parameters
    ----------
    folder : the run
    modules, optimisers : by name
    about : JSON-able; comes back from `load_state`
    """
    parts = {f"module.{name}.": part.state_dict() for name, part in modules.items()}
    # An optimiser's memory: "<parameter number>.<name>".
    for name, optimiser in optimisers.items():
        parts |= {f"optimiser.{name}.{number}.": kept for number, kept in optimiser.state_dict()["state"].items()}
    tensors = {
        prefix + name: torch.as_tensor(values).detach().cpu().contiguous()
        for prefix, part in parts.items()
        for name, values in part.items()
    }
    text = json.dumps(about)
    metadata = {"format": FORMAT, "about": text, "sha256": _digest(tensors, text)}
    with files.atomic_write(folder / STATE) as part:
        files.write_synced(part, save(tensors, metadata))


def load_state(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """Tensors and `about` of a run; None when nothing was saved yet.

    Raises
    ------
    ValueError
        If the file is damaged or not ours; it names the file.
    """
    path = folder / STATE
    if not path.exists():
        return None
    with files.reading(path, "the state of a training; start anew with another --out", max_bytes=None):
        tensors, metadata = read_tensors(path)
        if metadata.get("format") != FORMAT:
            raise ValueError("is no training state of this version of harmolab; start anew with another --out")
        if metadata["sha256"] != _digest(tensors, metadata["about"]):
            raise ValueError("is damaged (SHA-256 differs); start anew with another --out")
        return tensors, json.loads(metadata["about"])


def _digest(tensors: Mapping[str, Tensor], text: str) -> str:
    """SHA-256 over the text and the tensors, in the order of their names."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].reshape(-1).view(torch.uint8).numpy().data)
    return digest.hexdigest()


def restore(
    tensors: Mapping[str, Tensor], modules: Mapping[str, nn.Module], optimisers: Mapping[str, Optimizer]
) -> None:
    """Put saved tensors back into modules and optimisers."""
    for name, part in modules.items():
        part.load_state_dict(_below(tensors, f"module.{name}."))
    for name, optimiser in optimisers.items():
        state: dict[int, dict[str, Tensor]] = {}
        for key, value in _below(tensors, f"optimiser.{name}.").items():
            number, _, kind = key.partition(".")
            state.setdefault(int(number), {})[kind] = value
        optimiser.load_state_dict({**optimiser.state_dict(), "state": state})


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix`, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def check_folder(folder: Path, *, resume: bool) -> None:
    """ValueError unless `folder` is new or empty or, with `resume`, holds a run; nothing is written."""
    place = next(each for each in (folder, *folder.parents) if each.exists())
    if not (place.is_dir() and os.access(place, os.W_OK)):
        fault = "nothing may be written there" if place.is_dir() else "is a file"
        raise ValueError(f"{place}: {fault}; a run needs a folder of its own")
    held = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")) if folder.is_dir() else []
    if held and not resume:
        raise ValueError(f"{folder}: is not empty; use --resume to go on with a run there, or choose another folder")
    if held and SETTINGS not in held:
        raise ValueError(f"{folder}: holds {held[0]} but no {SETTINGS}, so no run to resume; choose another folder")


@contextmanager
def locked(folder: Path, *, resume: bool, corpus: Corpus | None = None) -> Iterator[None]:
    """Keep other processes out of `folder`, which is made, and removed if nothing is written; errors of `open_folder`.

    The thread that holds the lock may take it again.
    """
    check_folder(folder, resume=resume)
    new = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        lock = FileLock(folder / LOCK, is_singleton=True).acquire(timeout=0)
    except Timeout:
        raise ValueError(f"{folder}: another process is training there") from None
    with lock:
        try:
            if corpus is not None and (folder / CORPUS).is_file():
                _checked_corpus(folder / CORPUS, corpus())
            yield
        finally:
            with suppress(OSError):  # another process may begin there, or have removed it
                if new and [*folder.iterdir()] == [folder / LOCK]:
                    (folder / LOCK).unlink()
                    for each in new:
                        each.rmdir()


@contextmanager
def open_folder(
    folder: Path, settings: dict[str, Any], split: Sides, *, resume: bool, corpus: Corpus = TrainOptions.corpus
) -> Iterator[None]:
    """Lock `folder` for this process and write its settings, split and corpus.json, or check those that are there.

    Parameters
    ----------
    folder : made unless it is there
    settings : JSON-able
    split : Split of the units, or of songs: its `to_dict` says who is on which side
    resume : whether the folder may hold a run
    corpus : as in `TrainOptions`

    Raises
    ------
    ValueError
        If the folder may not be written to, holds a run with other settings, another split or other recordings, or
        another process trains in it.
    """
    with locked(folder, resume=resume):
        for unfinished in folder.glob(".*.tmp"):
            unfinished.unlink()
        recorded = _checked_corpus(folder / CORPUS, corpus())
        for path, content in ((folder / SETTINGS, settings), (folder / SPLIT, files.plain(split.to_dict()))):
            if path.exists():
                _compare(path, _read(path), content)
            else:
                files.write_json(path, content)
        if recorded:
            files.write_json(folder / CORPUS, recorded)
        yield


def _checked_corpus(path: Path, corpus: dict[str, str]) -> dict[str, str]:
    """The digests of what is learnt from; ValueError naming a file that is not as those in `path` say, if any do."""
    stored = _read(path) if path.exists() else corpus
    if changed := sorted(dict(stored.items() ^ corpus.items())):
        fault = f"{changed[0]} is not what it was when this training began"
        raise ValueError(f"{path}: {fault}; put it back, or choose another folder")
    return corpus


def check_pretrained(folder: Path, settings: dict[str, Any], split: Split, corpus: Corpus) -> None:
    """FileNotFoundError or ValueError unless the run in `folder` learnt from the same units and files, at this size."""
    stored = _read(folder / SETTINGS)
    old, new = ({name: each.get(name) for name in ("model", "features", "data")} for each in (stored, settings))
    _compare(folder / SETTINGS, old, new)
    _checked_corpus(folder / CORPUS, corpus())
    _compare(folder / SPLIT, _read(folder / SPLIT), files.plain(split.to_dict()))


def _read(path: Path) -> dict[str, Any]:
    with files.reading(path, "JSON", max_bytes=files.MAX_JSON_BYTES):
        if not isinstance(content := files.read_json(path), dict):
            raise ValueError("holds no settings of a run")
    return content


def _compare(path: Path, stored: dict[str, Any], settings: dict[str, Any]) -> None:
    """ValueError naming the first entry in which two dictionaries differ."""
    pairs = {key: (stored.get(key), settings.get(key)) for key in sorted(stored.keys() | settings.keys())}
    # A seed says more than the groups that follow from it.
    for name, (old, new) in sorted(pairs.items(), key=lambda item: isinstance(item[1][0], dict | list)):
        if isinstance(old, dict) and isinstance(new, dict):
            _compare(path, {f"{name}.{key}": old[key] for key in old}, {f"{name}.{key}": new[key] for key in new})
        elif old != new:
            fault = f"{name} is {_where_they_differ(old, new)}, but {_where_they_differ(new, old)} is asked for"
            raise ValueError(f"{path}: {fault}; ask for the same, or choose another folder")


def _where_they_differ(value: Any, other: Any) -> str:
    """The JSON of a value, of a long one the 40 characters about the first in which it differs from another's."""
    text, against = json.dumps(value), json.dumps(other)
    same = sum(itertools.takewhile(bool, (a == b for a, b in zip(text, against, strict=False))))
    start = max(0, same - 20) if len(text) > 40 else 0
    return f"{'...' if start > 0 else ''}{text[start : start + 40]}{'...' if start + 40 < len(text) else ''}"
