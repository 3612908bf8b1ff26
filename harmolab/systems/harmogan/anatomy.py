"""Parts of a network measured by running it once: their layers, sizes and shapes (Fig. 7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any

import torch
from torch import Tensor, nn

from harmolab.systems.common.layers import parameter_count
from harmolab.systems.common.units import Batch, SingleArray
from harmolab.systems.harmogan.networks import CrossDomainDiscriminator, Generator, SpatialTemporalDiscriminator


@dataclass(frozen=True)
class Part:
    """An input, a part that learns, or an output of a network.

    Parameters
    ----------
    network : "generator", "cross_domain" or "spatial_temporal"
    name : argument of ``forward``, attribute of the network ("joining.0" inside a list), or field of its output
    layers : "input", "output", or the layers inside, such as "GRU" or "3 Conv1d"
    parameters : int, values that training changes
    shape : shape of the output for one unit; units that are cut have the number of pieces in front
    """

    network: str
    name: str
    layers: str
    parameters: int
    shape: str


def anatomy(generator: Generator, batch: Batch[SingleArray]) -> list[Part]:
    """Parts of a generator and of the two discriminators of its size, by running them on a batch.

    Parameters
    ----------
    generator : Generator; neither its weights nor its mode change
    batch : Batch of units for it
    """
    audio, initial, motion, mask = map(torch.from_numpy, (batch.audio, batch.initial, batch.motion, batch.mask))
    with torch.random.fork_rng(devices=[]):  # measuring must not change a training that follows
        cross = CrossDomainDiscriminator(generator.params, generator.n_audio, generator.skeleton)
        temporal = SpatialTemporalDiscriminator(generator.params, generator.skeleton)
    return [
        *parts_of("generator", generator, audio=audio, initial=initial),
        *parts_of("cross_domain", cross, audio=audio, motion=motion, mask=mask),
        *parts_of("spatial_temporal", temporal, motion=motion, mask=mask),
    ]


@torch.no_grad()
def parts_of(title: str, network: nn.Module, **inputs: Tensor) -> list[Part]:
    """Inputs (but for "mask"), parts that learn, in the order in which they run, and outputs of a network.

    Its children with parameters are the parts; lists of modules are opened.
    """
    n_units = len(next(iter(inputs.values())))
    parts = [
        Part(title, name, "input", 0, shape_text(x.shape, n_units)) for name, x in inputs.items() if name != "mask"
    ]

    def note(name: str, module: nn.Module, _: Any, result: Any) -> None:
        shape = (result[0] if isinstance(result, tuple) else result).shape
        parts.append(Part(title, name, layers_of(module), parameter_count(module), shape_text(shape, n_units)))

    hooks = [module.register_forward_hook(partial(note, name)) for name, module in _learning_parts(network)]
    try:
        result = network(**inputs)
    finally:
        for hook in hooks:
            hook.remove()
    outputs = result._asdict() if hasattr(result, "_asdict") else {"output": result}
    return parts + [Part(title, name, "output", 0, shape_text(x.shape, n_units)) for name, x in outputs.items()]


def _learning_parts(network: nn.Module) -> Iterator[tuple[str, nn.Module]]:
    """Children with parameters; those of a list one by one."""
    for name, child in network.named_children():
        if isinstance(child, nn.ModuleList):
            yield from ((f"{name}.{place}", module) for place, module in child.named_children())
        elif any(True for _ in child.parameters()):
            yield name, child


def layers_of(module: nn.Module) -> str:
    """Classes of the layers with weights of their own, in order: "3 Conv1d", "GRU", "Conv1d + Linear"."""
    layers = [type(part).__name__ for part in module.modules() if any(True for _ in part.parameters(recurse=False))]
    runs = [(name, len(list(run))) for name, run in groupby(layers)]
    return " + ".join(f"{count} {name}" if count > 1 else name for name, count in runs)


def shape_text(shape: tuple[int, ...], n_units: int) -> str:
    """The shape of one unit in a batch; units that were cut into several pieces have their number in front.

    >>> shape_text((10, 60), 10), shape_text((50, 128), 10), shape_text((10,), 10)
    ('60', '5 of 128', '1')
    """
    first, *rest = shape
    inside = " \N{MULTIPLICATION SIGN} ".join(str(size) for size in rest) or "1"
    return f"{first // n_units} of {inside}" if first > n_units else inside
