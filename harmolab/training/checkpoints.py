"""The state of a run in one file, from which it goes on as if it had never stopped.

Tensors are safetensors; everything else (epoch, history, settings) is JSON in the same file's header, so that one
rename publishes both. Nothing is ever unpickled.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

__all__ = ["STATE", "load_state", "optimiser_tensors", "restore", "save_state", "write_aside"]

STATE = "state.safetensors"
FORMAT = 1


def write_aside(path: Path, text: str) -> None:
    """Replace a text file in one step: whoever reads sees the old content or the new one."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".part", delete=False, encoding="utf-8") as aside:
        aside.write(text)
        aside.flush()
        os.fsync(aside.fileno())
    Path(aside.name).replace(path)


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """An optimiser's memory as named tensors: "<parameter number>.<name>"."""
    state = optimiser.state_dict()["state"]
    return {f"{number}.{name}": torch.as_tensor(value) for number, kept in state.items() for name, value in kept.items()}


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
    tensors = {f"module.{name}.{key}": value for name, part in modules.items() for key, value in part.state_dict().items()}
    for name, optimiser in optimisers.items():
        tensors |= {f"optimiser.{name}.{key}": value for key, value in optimiser_tensors(optimiser).items()}
    plain = {key: value.detach().cpu().contiguous().clone() for key, value in tensors.items()}
    aside = folder / f".{STATE}.part"
    save_file(plain, aside, metadata={"format": str(FORMAT), "about": json.dumps(about)})
    with aside.open("rb") as file:
        os.fsync(file.fileno())
    aside.replace(folder / STATE)


def load_state(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """Tensors and `about` of a run; None when nothing was saved yet.

    Raises
    ------
    ValueError
        If the file is damaged or not ours; it names the file.
    """
    path = folder / STATE
    if not path.is_file():
        return None
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no mapping
        if metadata.get("format") != str(FORMAT):
            raise ValueError(f"has format {metadata.get('format')!r}, {FORMAT} is read")
        return tensors, json.loads(metadata["about"])
    except (SafetensorError, ValueError, KeyError, OSError) as error:
        raise ValueError(f"{path}: no training state that can be resumed ({error}); start anew with another --out") from None


def restore(
    tensors: Mapping[str, Tensor],
    modules: Mapping[str, nn.Module],
    optimisers: Mapping[str, torch.optim.Optimizer],
) -> None:
    """Put saved tensors back into modules and optimisers.

    Raises
    ------
    ValueError
        If they do not fit: the state belongs to other settings.
    """
    try:
        for name, part in modules.items():
            part.load_state_dict(_below(tensors, f"module.{name}."))
    except RuntimeError as error:
        raise ValueError(f"{STATE} belongs to a model of another size: {error}") from None
    for name, optimiser in optimisers.items():
        state: dict[int, dict[str, Tensor]] = {}
        for key, value in _below(tensors, f"optimiser.{name}.").items():
            number, _, kind = key.partition(".")
            state.setdefault(int(number), {})[kind] = value
        optimiser.load_state_dict({**optimiser.state_dict(), "state": state})


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix`, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
