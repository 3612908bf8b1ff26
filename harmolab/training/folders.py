"""The folder of a run: may it be written to, and does what lies in it belong to what is asked for?"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from harmolab.data.splits import Split
from harmolab.io.files import MAX_JSON_BYTES, read_json, reading
from harmolab.training.checkpoints import PART, write_aside

__all__ = ["check_folder", "check_pretrained", "open_folder"]

SETTINGS, SPLIT, LOCK = "settings.json", "split.json", ".lock"
OTHERWISE = "ask for the same, or choose another folder"


def check_folder(folder: Path, *, resume: bool) -> None:
    """See that a run may be kept in `folder`: it is new or empty or, with `resume`, holds a run.

    Raises
    ------
    ValueError
        Otherwise; nothing was written.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder}: is a file; a run needs a folder of its own")
    held = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")) if folder.is_dir() else []
    if held and not resume:
        raise ValueError(f"{folder}: is not empty; use --resume to go on with a run there, or choose another folder")
    if held and SETTINGS not in held:
        raise ValueError(f"{folder}: holds {held[0]} but no {SETTINGS}, so no run to resume; choose another folder")


@contextmanager
def open_folder(folder: Path, settings: dict[str, Any], split: Split, *, resume: bool) -> Iterator[None]:
    """Keep `folder` for this process; settings.json and split.json are in it, and are what was asked for.

    Parameters
    ----------
    folder : made unless it is there
    settings : JSON-able
    split : Split of the units
    resume : whether the folder may hold a run

    Raises
    ------
    ValueError
        If the folder may not be written to, holds a run with other settings or another split, or another process
        trains in it.
    """
    check_folder(folder, resume=resume)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / LOCK, timeout=0):
            for unfinished in folder.glob(f".*{PART}"):
                unfinished.unlink()
            _agree(folder / SETTINGS, settings)
            _agree(folder / SPLIT, _plain(split.to_dict()))
            yield
    except Timeout:
        raise ValueError(f"{folder}: another process is training there") from None


def check_pretrained(folder: Path, settings: dict[str, Any], split: Split) -> None:
    """See that the run in `folder` learnt from the very units of `split`, with a model of the same size.

    Raises
    ------
    FileNotFoundError, ValueError
        Otherwise.
    """
    shared = ("model", "features", "data")
    found = _read(folder / SETTINGS)
    _compare(folder / SETTINGS, {name: found.get(name) for name in shared}, {name: settings[name] for name in shared})
    _compare(folder / SPLIT, _read(folder / SPLIT), _plain(split.to_dict()))


def _agree(path: Path, wanted: dict[str, Any]) -> None:
    """Write `wanted` unless the file is there; then it must hold the same."""
    if path.exists():
        _compare(path, _read(path), wanted)
    else:
        write_aside(path, json.dumps(wanted, indent=1))


def _read(path: Path) -> dict[str, Any]:
    with reading(path, "JSON", max_bytes=MAX_JSON_BYTES):
        found = read_json(path)
        if not isinstance(found, dict):
            raise ValueError("holds no settings of a run")
    return found


def _compare(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    """ValueError naming the first entry in which two dictionaries differ."""
    for name in sorted(found.keys() | wanted.keys()):
        here, asked = found.get(name), wanted.get(name)
        if isinstance(here, dict) and isinstance(asked, dict):
            _compare(path, {f"{name}.{key}": here[key] for key in here}, {f"{name}.{key}": asked[key] for key in asked})
        elif here != asked:
            raise ValueError(f"{path}: {name} is {_short(here)}, but {_short(asked)} is asked for; {OTHERWISE}")


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:40]}..."


def _plain(content: dict[str, Any]) -> dict[str, Any]:
    """A dictionary as it comes back from JSON."""
    return json.loads(json.dumps(content))
