"""The folder of a run, and its state in one file, from which it goes on as if it had never stopped.

Tensors are safetensors; everything else (history, settings) is JSON in the same file's header, so that one rename
publishes both. Nothing is ever unpickled. ``settings.json`` and ``split.json`` tell whether what lies in a folder
belongs to what is asked for.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from filelock import FileLock, Timeout
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from harmolab.io.files import MAX_JSON_BYTES, read_json, reading
from harmolab.systems.common.splits import Split
from harmolab.systems.common.weights import renamed

STATE = "state.safetensors"
PART = ".part"  # ends the name of a file that is not finished
FORMAT = "harmolab training state 2"
SETTINGS, SPLIT, LOCK = "settings.json", "split.json", ".lock"
OTHERWISE = "ask for the same, or choose another folder"


def write_aside(path: Path, content: str | bytes) -> None:
    """Replace a file in one step: whoever reads sees the old content or the new one."""
    aside = path.with_name(f".{path.name}{PART}")
    with aside.open("wb") as file:
        file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())
    aside.replace(path)


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
    """Write ``state.safetensors`` aside, then rename it over the last one.

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
    write_aside(folder / STATE, save(tensors, metadata))


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
        tensors, metadata = _opened(path)
        if metadata.get("format") != FORMAT:
            raise ValueError("is no training state of this version of harmolab; start anew with another --out")
        if metadata["sha256"] != _digest(tensors, metadata["about"]):
            raise ValueError("is damaged (SHA-256 differs); start anew with another --out")
        return tensors, json.loads(metadata["about"])


def _opened(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and metadata of a safetensors file."""
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise ValueError(f"is damaged or no safetensors file ({error}); start anew with another --out") from None


def _digest(tensors: Mapping[str, Tensor], text: str) -> str:
    """SHA-256 over the text and the tensors, in the order of their names."""
    found = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        found.update(name.encode())
        found.update(tensors[name].reshape(-1).view(torch.uint8).numpy().data)
    return found.hexdigest()


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
    return renamed(found)


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
