"""Weights on disk: tensors in safetensors, everything else in a JSON file beside them. Nothing is ever unpickled.

``<stem>.safetensors``
    The module's parameters and buffers.
``<stem>.json``
    What is needed to build the network again (the system it belongs to, its class, and what the network itself says:
    sizes, skeleton, frame rate), the shapes and the SHA-256 of the other file, and whatever the caller adds about
    training.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import safetensors.torch
import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from harmolab.files import PathLike, named_faults, reading
from harmolab.systems.training.about import json_file, read_about, weights_stem, whole, write_about

_WHAT = "weights of harmolab"
# A description beyond these is not one of ours; building it would only fill the memory.
MOST_LAYERS = 64
# Statistics and lengths span too many orders of magnitude for 16 bits.
_ALWAYS_32_BIT = ("_scale.", "bone_lengths")
_YOUNGER = {"draw_memory": 0.0, "layers": 1}  # settings that older files lack, and the value that their systems had


@runtime_checkable
class Stored(Protocol):
    """A torch network that describes itself, so that it can be built again."""

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A network as its description says, of any weights; ValueError for a description that cannot be."""


N = TypeVar("N", bound=nn.Module)


def save_weights(
    path: PathLike, module: nn.Module, meta: Mapping[str, Any] | None = None, *, half: bool = False
) -> None:
    """Write a network to ``<path>.safetensors`` and ``<path>.json``; both appear whole or not at all.

    Parameters
    ----------
    path : str or path
        File stem, or an existing folder (the stem is then "model" in it). Suffixes of the two files may be given.
    module : torch module that is `Stored`; its attribute ``system``, if it has one, names the system it is part of
    meta : JSON-able mapping about training; comes back from `read_about` under "meta"
    half : bool
        Store parameters in 16 bits. Statistics and bone lengths stay in 32.

    Raises
    ------
    ValueError
        If a value is not finite (in 16 bits), or the module does not describe itself.
    """
    if not isinstance(module, Stored):
        raise ValueError(f"weights of networks that describe themselves can be stored, got {type(module).__name__}")
    stem = weights_stem(path)
    tensors = {name: _stored(name, values, half=half) for name, values in module.state_dict().items()}
    _check_finite(stem, tensors)
    data = safetensors.torch.save(tensors)
    about = {
        "system": getattr(module, "system", ""),
        "class": type(module).__name__,
        "build": module.description(),
        "shapes": {name: list(values.shape) for name, values in tensors.items()},
        "sha256": hashlib.sha256(data).hexdigest(),
        "meta": dict(meta or {}),
    }
    write_about(stem, about, _tensor_file(stem), data)


def load_weights(path: PathLike, network: type[N]) -> N:
    """The network of class `network` stored at `path`, on the CPU, in single precision and evaluation mode.

    Everything is checked on the way: description, hash, names and shapes, values.

    Parameters
    ----------
    path : str or path
        As in `save_weights`.
    network : class of torch modules that are `Stored`

    Raises
    ------
    FileNotFoundError
        There is no such weights file.
    ValueError
        It is damaged, foreign, of another size than its description says, holds NaN, lacks its JSON, or is a pickle;
        the message names the file and the fault.
    """
    stem = weights_stem(path)
    file = _tensor_file(stem)
    with reading(file, _WHAT):
        data = file.read_bytes()
        if not json_file(stem).is_file():
            raise ValueError(f"lacks its description {json_file(stem).name}, which must lie beside it")
        about = read_about(stem)
        if about.get("class") != network.__name__:
            raise ValueError(f"holds a {about.get('class')}, not a {network.__name__}")
        tensors, _ = read_tensors(file)
        if hashlib.sha256(data).hexdigest() != about.get("sha256"):
            raise ValueError(f"is not the file that {json_file(stem).name} describes (SHA-256 differs)")
        _check_finite(stem, tensors)
        # Without memory of its own ("meta" device): a false description cannot fill the machine.
        with named_faults(json_file(stem).name), torch.device("meta"), _NothingDrawn():
            module = network.built(about["build"], tensors)  # type: ignore[attr-defined]
        return _filled(module, tensors)


class _NothingDrawn(TorchFunctionMode):
    """Weights are not drawn at random: without memory, torch imports its compiler for that, two seconds long."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if func in (Tensor.normal_, nn.init.normal_):
            return args[0] if args else kwargs["tensor"]
        return func(*args, **(kwargs or {}))


def _tensor_file(stem: Path) -> Path:
    return stem.with_name(f"{stem.name}.safetensors")


def _stored(name: str, values: Tensor, *, half: bool) -> Tensor:
    """A tensor as it goes into the file."""
    keep = not half or any(part in name for part in _ALWAYS_32_BIT)
    return values.detach().cpu().to(torch.float32 if keep else torch.float16).contiguous().clone()


def _check_finite(stem: Path, tensors: Mapping[str, Tensor]) -> None:
    for name, values in tensors.items():
        if not values.is_floating_point():
            raise ValueError(f"{_tensor_file(stem)}: {name} must be floating-point numbers, got {values.dtype}")
        if not bool(values.isfinite().all()):
            raise ValueError(f"{_tensor_file(stem)}: {name} holds NaN or infinity")


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and metadata of a safetensors file; call it inside `reading`, which names the file in errors."""
    try:
        with safe_open(path, framework="pt") as file:
            # Copies: numbers that stay in the file keep it open, and Windows replaces no open file. And products of a
            # single row round by where in memory its numbers lie, which in a file is anywhere.
            return {name: file.get_tensor(name).clone() for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise ValueError(f"is damaged or no safetensors file ({error})") from None


R = TypeVar("R")


def stored_record(record: type[R], stored: Mapping[str, Any]) -> R:
    """A dataclass of settings out of a description, where tuples have become lists; ValueError for what cannot be.

    Numbers that are whole by default must be whole, from 0 to `MOST_UNITS`; a seed may be larger.
    """
    stored = {**_YOUNGER, **stored}
    values = {field.name: stored[field.name] for field in fields(record)}  # type: ignore[arg-type]
    for name, value in values.items():
        default = getattr(record, name, None)
        if name != "seed" and isinstance(default, int) and not isinstance(default, bool) and value != 0:
            whole(name, value)
        if isinstance(value, list):
            if len(value) > MOST_LAYERS:
                raise ValueError(f"describes {len(value)} numbers as {name}, more than {MOST_LAYERS}")
            values[name] = tuple(whole(name, each) if isinstance(each, int) else each for each in value)
    return record(**values)


def _filled(module: N, tensors: Mapping[str, Tensor]) -> N:
    """`module` with these tensors in it; ValueError unless names and shapes agree."""
    expected = module.state_dict()
    if missing := sorted(expected.keys() ^ tensors.keys()):
        raise ValueError(f"has other tensors than its description calls for, such as {missing[0]}")
    for name, values in tensors.items():
        if values.shape != expected[name].shape:
            shapes = f"{tuple(values.shape)}; its description calls for {tuple(expected[name].shape)}"
            raise ValueError(f"{name} has shape {shapes}")
    module.load_state_dict({name: values.float() for name, values in tensors.items()}, assign=True)
    return module.eval()
