"""The folder of a run, and its state in one file, from which training resumes as if it had never stopped.

Tensors are safetensors; everything else (history, settings) is JSON in the same file's header, so that one rename
publishes both. Nothing is ever unpickled. A run is resumed only with the settings of ``settings.json`` and the split
of ``split.json``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import torch
from filelock import FileLock, Timeout
from safetensors.torch import save
from torch import Tensor, nn

from harmolab.io.files import MAX_JSON_BYTES, atomic_write, plain, read_json, reading, write_json
from harmolab.systems.common.about import write_synced
from harmolab.systems.common.splits import Split
from harmolab.systems.common.weights import read_tensors, renamed


class Sides(Protocol):
    """A split, as far as a run needs it."""

    def to_dict(self) -> dict[str, Any]:
        """All about it, ready for JSON."""


STATE = "state.safetensors"
FORMAT = "harmolab training state 2"
SETTINGS, SPLIT, LOCK = "settings.json", "split.json", ".lock"


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """An optimiser's memory as named tensors: "<parameter number>.<name>"."""
    state = optimiser.state_dict()["state"]
    return {f"{number}.{name}": torch.as_tensor(kept[name]) for number, kept in state.items() for name in kept}


def save_state(
    folder: Path,
    modules: Mapping[str, nn.Module],
    optimisers: Mapping[str, torch.optim.Optimizer],
    about: Mapping[str, Any],
) -> None:
    """Replace ``state.safetensors`` by an atomic write.

    Parameters
    ----------
    folder : the run
    modules, optimisers : by name
    about : JSON-able; comes back from `load_state`
    """
    parts = {f"module.{name}.": part.state_dict() for name, part in modules.items()}
    parts |= {f"optimiser.{name}.": optimiser_tensors(optimiser) for name, optimiser in optimisers.items()}
    tensors = {
        prefix + name: values.detach().cpu().contiguous()
        for prefix, part in parts.items()
        for name, values in part.items()
    }
    text = json.dumps(about)
    metadata = {"format": FORMAT, "about": text, "sha256": _digest(tensors, text)}
    with atomic_write(folder / STATE) as part:
        write_synced(part, save(tensors, metadata))


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
    with reading(path, "the state of a training; start anew with another --out", max_bytes=None):
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
    tensors: Mapping[str, Tensor],
    modules: Mapping[str, nn.Module],
    optimisers: Mapping[str, torch.optim.Optimizer],
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
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder}: is a file; a run needs a folder of its own")
    held = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")) if folder.is_dir() else []
    if held and not resume:
        raise ValueError(f"{folder}: is not empty; use --resume to go on with a run there, or choose another folder")
    if held and SETTINGS not in held:
        raise ValueError(f"{folder}: holds {held[0]} but no {SETTINGS}, so no run to resume; choose another folder")


@contextmanager
def open_folder(folder: Path, settings: dict[str, Any], split: Sides, *, resume: bool) -> Iterator[None]:
    """Lock `folder` for this process and write settings.json and split.json, or check those that are there.

    Parameters
    ----------
    folder : made unless it is there
    settings : JSON-able
    split : Split of the units, or of songs: its `to_dict` says who is on which side
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
            for unfinished in folder.glob(".*.tmp"):
                unfinished.unlink()
            for path, content in ((folder / SETTINGS, settings), (folder / SPLIT, plain(split.to_dict()))):
                if path.exists():
                    _compare(path, _read(path), content)
                else:
                    write_json(path, content)
            yield
    except Timeout:
        raise ValueError(f"{folder}: another process is training there") from None


def check_pretrained(folder: Path, settings: dict[str, Any], split: Split) -> None:
    """FileNotFoundError or ValueError unless the run in `folder` learnt from the units of `split`, at the same size."""
    stored = _read(folder / SETTINGS)
    old, new = ({name: each.get(name) for name in ("model", "features", "data")} for each in (stored, settings))
    _compare(folder / SETTINGS, old, new)
    _compare(folder / SPLIT, _read(folder / SPLIT), plain(split.to_dict()))


def _read(path: Path) -> dict[str, Any]:
    with reading(path, "JSON", max_bytes=MAX_JSON_BYTES):
        content = read_json(path)
        if not isinstance(content, dict):
            raise ValueError("holds no settings of a run")
    return renamed(content)


def _compare(path: Path, stored: dict[str, Any], settings: dict[str, Any]) -> None:
    """ValueError naming the first entry in which two dictionaries differ."""
    for name in sorted(stored.keys() | settings.keys()):
        old, new = stored.get(name), settings.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            _compare(path, {f"{name}.{key}": old[key] for key in old}, {f"{name}.{key}": new[key] for key in new})
        elif old != new:
            fault = f"{name} is {_short(old)}, but {_short(new)} is asked for"
            raise ValueError(f"{path}: {fault}; ask for the same, or choose another folder")


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:40]}..."
