"""A batch in parts, for one process or several: the same gradients whoever computes them.

Gradients and means are added up over all shards of a batch in the order of the shards. So the same shards give the same
result to the last bit, whether one process computes them one after the other or each process some of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from lightning_fabric import Fabric
from torch import Tensor

from harmolab.params import TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.schedule import epoch_order

__all__ = ["Means", "Shard", "Terms", "epoch_shards", "step"]

Terms = dict[str, Tensor]  # by name, "total" is what the gradient is of


class Shard(NamedTuple):
    """A part of a batch: its units, the units next to them in the batch, and what share of the batch it is."""

    own: Tensors
    others: Tensors
    share: float


def epoch_shards(fabric: Fabric, units: Tensors, epoch: int, params: TrainParams) -> Iterator[list[Shard]]:
    """This process's shards of each batch of an epoch: of R processes, number r has the shards r, r + R, ..."""
    count = max(params.shards, fabric.world_size)
    for indices in epoch_order(len(units), epoch, params):
        numbers = range(fabric.global_rank, count, fabric.world_size)
        yield [
            Shard(
                units.take(indices, number, count),
                units.take(indices.roll(-1), number, count),
                len(indices[number::count]) / len(indices),
            )
            for number in numbers
        ]


def step(fabric: Fabric, terms: list[Terms], shards: list[Shard], optimiser: torch.optim.Optimizer) -> None:
    """Change the optimiser's own parameters, and no others, by the gradient of "total" over all shards of the batch."""
    parameters = [part for group in optimiser.param_groups for part in group["params"]]
    found = []
    for each, shard in zip(terms, shards, strict=True):
        gradients = torch.autograd.grad(each["total"] * shard.share, parameters)
        found.append(torch.cat([gradient.flatten() for gradient in gradients]))
    pieces = _added(fabric, torch.stack(found)).split([part.numel() for part in parameters])
    for part, piece in zip(parameters, pieces, strict=True):
        part.grad = piece.view_as(part)
    optimiser.step()


def _added(fabric: Fabric, values: Tensor) -> Tensor:
    """The sum (K,) of values (S, K) over the S shards of this process and those of all others, in the shards' order."""
    if fabric.world_size > 1:
        # Not fabric.all_gather, which keeps a gradient path in a way that torch calls outdated.
        gathered = [torch.empty_like(values) for _ in range(fabric.world_size)]
        torch.distributed.all_gather(gathered, values)
        values = torch.stack(gathered, dim=1).flatten(0, 1)
    total = values[0]
    for each in values[1:]:
        total = total + each
    return total


class Means:
    """Means of named terms over the batches of an epoch."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._sums: Tensor | None = None  # (S, terms)
        self._count = 0

    def add(self, terms: list[Terms], shards: list[Shard]) -> None:
        """One more batch: the terms of each of this process's shards."""
        self._names = list(terms[0])
        pairs = zip(terms, shards, strict=True)
        values = torch.stack([torch.stack([*each.values()]).detach().float() * shard.share for each, shard in pairs])
        self._sums = values if self._sums is None else self._sums + values
        self._count += 1

    def over(self, fabric: Fabric) -> dict[str, float]:
        """The means over all processes; none before the first batch."""
        if self._sums is None:
            return {}
        return dict(zip(self._names, (_added(fabric, self._sums) / self._count).tolist(), strict=True))
