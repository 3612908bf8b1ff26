"""The state of a run in one file, from which it goes on as if it had never stopped.

Tensors are safetensors; everything else (history, settings) is JSON in the same file's header, so that one rename
publishes both. Nothing is ever unpickled.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from harmolab.io.files import reading

__all__ = ["STATE", "load_state", "optimiser_tensors", "restore", "save_state", "write_aside"]

STATE = "state.safetensors"
PART = ".part"  # ends the name of a file that is not finished
FORMAT = "harmolab training state 1"


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
