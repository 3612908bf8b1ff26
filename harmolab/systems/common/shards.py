"""Units on a device, and batches of them in parts: the same gradients from one process as from several.

Gradients and means are added up over all shards of a batch in the order of the shards. So the same shards give the same
result to the last bit, whether one process computes them one after the other or each process some of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from lightning_fabric import Fabric
from torch import Tensor

from harmolab.systems.common.units import Batch, UnitSet, collate

Terms = dict[str, Tensor]  # by name, "total" is what the gradient is of


class Units(Protocol):
    """Training units that batches are taken from (`Tensors` is one kind)."""

    def __len__(self) -> int:
        """Number of units."""

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Any:
        """A batch of the units at every `world`-th of `indices`, from number `rank` on."""


class Tensors(Batch[Tensor]):
    """A batch of units (or all of a set) on a device."""

    def __len__(self) -> int:
        return len(self.audio)

    @classmethod
    def of(cls, units: UnitSet, device: torch.device | str = "cpu") -> Tensors:
        """All units of a set as one padded batch on `device`."""
        batch = collate(units.units)
        return cls(**{field.name: torch.as_tensor(getattr(batch, field.name)).to(device) for field in fields(cls)})

    def continued_from(self, motion: Tensor, mask: Tensor) -> Tensors:
        """These units with V_f of Eq. 23 from the last frames of another motion instead of the recorded one.

        So a song is danced, meter by meter (Fig. 7b). There is no recording of it to compare with; but harmony needs
        music alone, and a discriminator of movement needs no recording of the same dance.

        Parameters
        ----------
        motion : (N, T, C) motion codes
        mask : (N, T), 1 where `motion` is real
        """
        lengths, prior = mask.sum(dim=1).long(), self.index.sum(dim=1).long()
        frames = torch.arange(self.index.shape[1], device=motion.device)
        at = ((lengths - prior)[:, None] + frames).clamp(min=0).minimum(lengths[:, None] - 1)
        tail = motion.gather(1, at[..., None].expand(-1, -1, motion.shape[2]))
        index = self.index[..., None]
        mean = (tail * index).sum(dim=1, keepdim=True) / prior[:, None, None].clamp(min=1)
        return Tensors(**vars(self) | {"initial": torch.where(index > 0, tail, mean)})

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Tensors:
        """The units at `indices` that fall to process `rank` of `world`, padded to the longest of all of `indices`.

        Padding thus never depends on how a batch is shared among processes.
        """
        frames = int(self.mask[indices].sum(dim=1).max())
        beats = max(int(self.beat_mask[indices].sum(dim=1).max()), 1)
        ends = {"beats": beats, "strengths": beats, "beat_mask": beats}
        rows = indices[rank::world].to(self.audio.device)
        return Tensors(**{f.name: getattr(self, f.name)[rows, : ends.get(f.name, frames)] for f in fields(self)})


@dataclass(frozen=True)
class Batching:
    """Sizes and order of batches.

    Parameters
    ----------
    size : int, units of a batch at most, over all processes together
    shards : int, parts that each batch is computed in
    seed : int, of the order of the units
    """

    size: int
    shards: int = 1
    seed: int = 1


class Shard(NamedTuple):
    """A part of a batch: its units, the units next to them in the batch, its share of the batch, and a seed.

    All that chance decides about a shard is drawn by its seed, which depends on its number in the run alone. So a run
    that resumes draws the same again, and so do several processes.
    """

    own: Any
    others: Any
    share: float
    seed: int = 0


def epoch_order(n_units: int, epoch: int, batching: Batching) -> list[Tensor]:
    """Batches of unit indices of one epoch, the same in every process: every unit once, in an order drawn by the seed.

    As few batches as hold `batching.size` units at most, of equal size to one unit, so that none is left with a unit
    or two. A function of the epoch alone: a run that resumes needs no memory of it.
    """
    shuffle = torch.Generator().manual_seed(batching.seed * 1_000_003 + epoch)
    order = torch.randperm(n_units, generator=shuffle)
    return list(order.tensor_split(-(-n_units // batching.size)))


def check_shards(n_units: int, batching: Batching, world: int) -> None:
    """ValueError unless each of `world` processes gets equally many shards, and every shard a unit of every batch."""
    shards = max(batching.shards, world)
    smallest = min(len(batch) for batch in epoch_order(n_units, 0, batching))
    if shards % world:
        raise ValueError(f"{shards} shards cannot be spread evenly over {world} processes")
    if smallest < shards:
        raise ValueError(f"batches of {smallest} units cannot be cut into {shards} shards; {smallest} at most")


def epoch_shards(fabric: Fabric, units: Units, epoch: int, batching: Batching) -> Iterator[list[Shard]]:
    """This process's shards of each batch of an epoch: of R processes, number r has the shards r, r + R, ..."""
    count = max(batching.shards, fabric.world_size)
    for place, indices in enumerate(epoch_order(len(units), epoch, batching)):
        numbers = range(fabric.global_rank, count, fabric.world_size)
        yield [
            Shard(
                units.take(indices, number, count),
                units.take(indices.roll(-1), number, count),
                len(indices[number::count]) / len(indices),
                _shard_seed(batching.seed, epoch, place, number),
            )
            for number in numbers
        ]


def _shard_seed(*numbers: int) -> int:
    """A seed of its own for the shard of these numbers: of the run, epoch, batch and shard."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])


@contextmanager
def drawn_by(seed: int, device: torch.device) -> Iterator[None]:
    """Random numbers of torch, on the CPU and `device`, by a seed; afterwards they go on as before."""
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(seed)
        yield


def total_loss(terms: Mapping[str, Tensor], weights: Mapping[str, float]) -> Tensor:
    """The weighted sum of the terms (Eq. 32).

    Raises
    ------
    ValueError
        For no terms, a term without weight, or a weight other than 0 without term.
    """
    if not terms:
        raise ValueError("there is no loss term to add up")
    if missing := sorted(set(terms) - set(weights)):
        raise ValueError(f"no weight for the loss terms {', '.join(missing)}; weights are {', '.join(weights)}")
    if unused := sorted(name for name in set(weights) - set(terms) if weights[name] != 0):
        raise ValueError(f"no loss term for the weights {', '.join(unused)}; terms are {', '.join(terms)}")
    return torch.stack([weights[name] * term for name, term in terms.items()]).sum()


def step(
    fabric: Fabric,
    terms: list[Terms],
    shards: list[Shard],
    optimiser: torch.optim.Optimizer,
    *,
    clip: float | None = None,
) -> None:
    """Change the optimiser's own parameters, and no others, by the gradient of "total" over all shards of the batch.

    A gradient whose norm is larger than `clip` is scaled down to it.
    """
    parameters = [part for group in optimiser.param_groups for part in group["params"]]
    gradients = []
    for each, shard in zip(terms, shards, strict=True):
        parts = torch.autograd.grad(each["total"] * shard.share, parameters)
        gradients.append(torch.cat([part.flatten() for part in parts]))
    pieces = _added(fabric, torch.stack(gradients)).split([part.numel() for part in parameters])
    for part, piece in zip(parameters, pieces, strict=True):
        part.grad = piece.view_as(part)
    if clip is not None:
        torch.nn.utils.clip_grad_norm_(parameters, clip)
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
