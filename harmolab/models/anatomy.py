"""What a network is made of, found by running it once: parts that learn, their shapes, what feeds what (Fig. 7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import torch
from torch import Tensor, nn

from harmolab.data.units import Batch
from harmolab.models.harmogan import CrossDomainDiscriminator, Generator, SpatialTemporalDiscriminator

__all__ = ["Part", "anatomy", "parts_of"]


@dataclass(frozen=True)
class Part:
    """A box of the diagram.

    Parameters
    ----------
    name : str
        Attribute of the network ("joining.0" inside a list), argument of its ``forward``, or field of what it returns.
    kind : "input", "output", or the layers inside, such as "GRU" or "3 Conv1d"
    input, output : shapes of the first tensor that goes in and of the first that comes out
        () for what goes into an input of the network, and for what comes out of its output.
    parameters : int, values that training changes
    sources : names of the parts that its input is made of, in the order in which they ran
    """

    name: str
    kind: str
    input: tuple[int, ...]
    output: tuple[int, ...]
    parameters: int
    sources: tuple[str, ...]


def anatomy(generator: Generator, batch: Batch) -> dict[str, tuple[Part, ...]]:
    """Parts of a generator and of the two discriminators of its size, by running them on a batch.

    Parameters
    ----------
    generator : Generator; neither its weights nor its mode change
    batch : Batch of units for it

    Returns
    -------
    dict with the keys "generator", "cross_domain" and "spatial_temporal"
    """
    audio, initial, motion, mask = map(torch.from_numpy, (batch.audio, batch.initial, batch.motion, batch.mask))
    with torch.random.fork_rng(devices=[]):  # looking must not change what is trained afterwards
        cross = CrossDomainDiscriminator(generator.params, generator.n_audio, generator.skeleton)
        temporal = SpatialTemporalDiscriminator(generator.params, generator.skeleton)
    return {
        "generator": parts_of(generator, audio=audio, initial=initial),
        "cross_domain": parts_of(cross, mask=mask, audio=audio, motion=motion),
        "spatial_temporal": parts_of(temporal, mask=mask, motion=motion),
    }


def parts_of(network: nn.Module, *, mask: Tensor | None = None, **inputs: Tensor) -> tuple[Part, ...]:
    """Inputs, parts that learn, and outputs of a network, in the order in which they run on `inputs`.

    Nothing of the wiring is written down here. Each part's output is cut from the graph as it comes out; one part feeds
    another where the gradient of the one's input reaches the other's output, with no part between.

    Parameters
    ----------
    network : Module
        Its children that have parameters are the parts; lists of modules are opened.
    mask : Tensor, optional
        Given to ``forward`` as well; which frames are real is no signal, and no box.
    inputs : arguments of ``forward``; floating-point tensors

    Raises
    ------
    ValueError
        If a part runs more than once (its box would stand for several) or is called like an input.

    Examples
    --------
    >>> small = nn.Sequential(nn.Linear(2, 3), nn.ReLU(), nn.Linear(3, 1))
    >>> [(part.name, part.sources) for part in parts_of(small, input=torch.ones(5, 2))]
    [('input', ()), ('0', ('input',)), ('2', ('0',)), ('output', ('2',))]
    """
    leaves = {name: values.detach().clone().requires_grad_() for name, values in inputs.items()}
    found = [Part(name, "input", (), tuple(values.shape), 0, ()) for name, values in leaves.items()]
    handles = [module.register_forward_hook(_cutter(name, found, leaves)) for name, module in _learning_parts(network)]
    try:
        with torch.enable_grad():
            made = network(**leaves, **({} if mask is None else {"mask": mask}))
    finally:
        for handle in handles:
            handle.remove()
    return (*found, *_outputs(made, leaves))


def _cutter(name: str, found: list[Part], leaves: dict[str, Tensor]) -> Any:
    """Forward hook that notes a part in `found`, and puts a fresh tensor in place of its output, kept in `leaves`."""

    def cut(module: nn.Module, arguments: tuple[Any, ...], result: Any) -> Any:
        if name in leaves:
            raise ValueError(f"{name} runs more than once, or is called like an input; a name stands for one box")
        values = result[0] if isinstance(result, tuple) else result
        count = sum(weights.numel() for weights in module.parameters())
        fed = _sources(arguments[0], leaves)
        found.append(Part(name, _kind(module), tuple(arguments[0].shape), tuple(values.shape), count, fed))
        leaves[name] = values.detach().clone().requires_grad_()
        return (leaves[name], *result[1:]) if isinstance(result, tuple) else leaves[name]

    return cut


def _learning_parts(network: nn.Module) -> Iterator[tuple[str, nn.Module]]:
    """Children with parameters; those of a list one by one."""
    for name, child in network.named_children():
        if isinstance(child, nn.ModuleList):
            inside = [(f"{name}.{place}", module) for place, module in child.named_children()]
        else:
            inside = [(name, child)]
        yield from ((label, module) for label, module in inside if any(True for _ in module.parameters()))


def _kind(module: nn.Module) -> str:
    """Classes of the layers with weights of their own, in order: "3 Conv1d", "GRU", "Conv1d + Linear"."""
    layers = [type(part).__name__ for part in module.modules() if any(True for _ in part.parameters(recurse=False))]
    runs = [(name, len(list(run))) for name, run in groupby(layers)]
    return " + ".join(f"{count} {name}" if count > 1 else name for name, count in runs)


def _sources(values: Tensor, leaves: dict[str, Tensor]) -> tuple[str, ...]:
    """Names of the tensors that `values` depends on."""
    if not values.requires_grad:
        return ()
    # With weights of one, something that is added here and taken away there would seem to have no part in it.
    weights = torch.rand(values.shape, generator=torch.Generator().manual_seed(0)).to(values)
    slopes = torch.autograd.grad(values, list(leaves.values()), weights, retain_graph=True, allow_unused=True)
    pairs = zip(leaves, slopes, strict=True)
    return tuple(name for name, slope in pairs if slope is not None and bool(slope.any()))


def _outputs(made: Any, leaves: dict[str, Tensor]) -> Iterator[Part]:
    """One part for each field of a named tuple; one called "output" for a tensor."""
    fields = made._asdict() if hasattr(made, "_asdict") else {"output": made}
    for name, values in fields.items():
        yield Part(name, "output", tuple(values.shape), (), 0, _sources(values, leaves))
