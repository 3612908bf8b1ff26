"""One training loop for every system: batches in shards, and phases in which several players step in turn.

Gradients and means are added up over all shards of a batch in the order of the shards. So the same shards give the same
result to the last bit, whether one process computes them one after the other or each process some of them.

Phases follow one another; on each batch of a phase its players step in turn. The loop runs on a CPU, a GPU or several
processes (torchrun) through Lightning Fabric; `shards` sees to it that the number of processes does not change the
result. The whole state goes to disk between epochs; a run that was killed goes on from there.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from harmolab.files import named_faults, write_text
from harmolab.systems.training import checkpoints
from harmolab.systems.training.features import check_choice
from harmolab.systems.training.units import Batch, UnitSet, collate

if TYPE_CHECKING:
    from lightning_fabric import Fabric

# Units on a device, and batches of them in shards

Terms = dict[str, Tensor]  # by name, "total" is what the gradient is of


class Units(Protocol):
    """Training units that batches are taken from (`Tensors` is one kind)."""

    def __len__(self) -> int:
        """Number of units."""

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Any:
        """A batch of the units at every `world`-th of `indices`, from number `rank` on."""


class Rows:
    """Base of dataclasses of tensors with a row for each unit (`Units`); other fields are the same for all."""

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Self:
        """The units at `indices` that fall to process `rank` of `world`."""
        tensors = {name: values for name, values in vars(self).items() if isinstance(values, Tensor)}
        rows = indices[rank::world].to(next(iter(tensors.values())).device)
        return replace(self, **{name: values[rows] for name, values in tensors.items()})  # type: ignore[type-var]


class Tensors(Batch[Tensor]):
    """A batch of units (or all of a set) on a device."""

    def __len__(self) -> int:
        return len(self.audio)

    @classmethod
    def of(cls, units: UnitSet, device: torch.device | str = "cpu") -> Tensors:
        """All units of a set as one padded batch on `device`."""
        batch = collate(units.units)
        return cls(**{field.name: torch.as_tensor(getattr(batch, field.name)).to(device) for field in fields(cls)})

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Tensors:
        """The units at `indices` that fall to process `rank` of `world`, padded to the longest of all of `indices`.

        Padding thus never depends on how a batch is shared among processes.
        """
        frames = int(self.mask[indices].sum(dim=1).max())
        beats = max(int(self.beat_mask[indices].sum(dim=1).max()), 1)
        ends = {"beats": beats, "strengths": beats, "beat_mask": beats, "bars": 2}
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
        yield [
            Shard(
                units.take(indices, number, count),
                units.take(indices.roll(-1), number, count),
                len(indices[number::count]) / len(indices),
                int(np.random.SeedSequence((batching.seed, epoch, place, number)).generate_state(1)[0]),
            )
            for number in range(fabric.global_rank, count, fabric.world_size)
        ]


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
    fabric: Fabric, terms: list[Terms], shards: list[Shard], optimiser: Optimizer, *, clip: float | None = None
) -> None:
    """Change the optimiser's own parameters, and no others, by the gradient of "total" over all shards of the batch.

    A gradient whose norm is larger than `clip` is scaled down to it; ValueError for one that is not finite.
    """
    parameters = [part for group in optimiser.param_groups for part in group["params"]]
    gradients = []
    for each, shard in zip(terms, shards, strict=True):
        parts = torch.autograd.grad(each["total"] * shard.share, parameters)
        gradients.append(torch.cat([part.flatten() for part in parts]))
    gradient = _added(fabric, torch.stack(gradients))
    if not bool(gradient.isfinite().all()):
        raise ValueError("the training has diverged: a gradient is no finite number; begin anew with another seed")
    for part, piece in zip(parameters, gradient.split([part.numel() for part in parameters]), strict=True):
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
    return sum(values[1:], values[0])


# Phases and players

SAVING_SHARE = 0.05  # of the time may be spent on writing the state; a kill costs the epochs since the last time
Optimisers = dict[str, Optimizer]


@dataclass(frozen=True, eq=False)
class Player:
    """Parameters that one optimiser changes, and the loss that it lowers.

    Parameters
    ----------
    name : of the optimiser in the state
    parameters : that a step changes; no others. Or groups of them, ``{"params": [...], "share": 0.1}``, which learn at
        this share of the phase's rate
    terms : function(output, shard, row) -> named loss terms of one shard
        `output` is the phase's forward pass of the shard, `row` the epoch's row of history as far as it is known
        before its first batch (phase, epoch, rate, what the phase's schedule says).
    weights : of the terms in the loss, by name; those of absent terms are not read
    decay : float, weight decay
    clip : float or None, largest norm of the gradient of all its parameters
    optimiser : class of torch.optim
    """

    name: str
    parameters: Sequence[nn.Parameter] | Sequence[dict[str, Any]]
    terms: Callable[[Any, Shard, checkpoints.Row], Terms]
    weights: Mapping[str, float]
    decay: float = 0.0
    clip: float | None = None
    optimiser: type[Optimizer] = torch.optim.Adam


@dataclass(frozen=True, eq=False)
class Phase:
    """One phase of a training by `fit`, such as a pretraining: its epochs, networks, players and schedules.

    A *player* is a set of parameters with its own loss and optimiser; generator and discriminator are two players.

    Parameters
    ----------
    name : str
        Name of the phase in the history.
    epochs : int
        At most.
    rate : function of the number of the epoch in the phase
        Returns the learning rate of parameters whose share is 1.
    modules : dict
        Networks by name, as they are kept on disk.
    players : sequence of Player
        In the order of their steps on each batch. The terms of all are in the history; "total" there is the loss of the
        last one.
    forward : function (shard, last)
        Returns the output from which the players' terms are computed. `last` is its own output for the shard of that
        number in the batch before, or None in an epoch's first batch, so that an epoch that is resumed goes on the
        same.
    schedule : function of the number of the epoch in the phase
        Returns further columns of the row of the epoch, as a dict.
    validate : function ()
        Returns further columns of the row, as a dict, on every process.
    validate_every : int
        Epochs from one validation to the next; the last epoch is validated, too.
    patience : int or None
        The phase ends earlier if `error` has not fallen for so many epochs, and the best epoch is kept. None: all
        epochs are trained, and the last one is kept.
    error : str
        Column that has its smallest value in the best epoch.
    keep : function () or None
        Called on the first process after each validated epoch that is the one to keep so far.
    recall : function () or None
        Called on every process after the last epoch of the phase; it goes back to the epoch that was kept.
    """

    name: str
    epochs: int
    rate: Callable[[int], float]
    modules: Mapping[str, nn.Module]
    players: Sequence[Player]
    forward: Callable[[Shard, Any], Any]
    schedule: Callable[[int], checkpoints.Row] = lambda number: {}
    validate: Callable[[], dict[str, float]] = dict
    validate_every: int = 1
    patience: int | None = None
    error: str = "val_mse"
    keep: Callable[[], object] | None = None
    recall: Callable[[], object] | None = None


@dataclass(eq=False)
class _Run:
    """State that all phases share. `rows` is the history so far, one row an epoch."""

    fabric: Fabric
    units: Units
    batching: Batching
    folder: Path
    settings: dict[str, Any]
    report: checkpoints.Report
    rows: list[checkpoints.Row] = field(default_factory=list)
    events: checkpoints.EventLog | None = None
    saving: tuple[float, float] = (0.0, 0.0)  # seconds that the last state took to write, and when that was


def check_accelerator(name: str) -> None:
    """ValueError unless it is "auto", "cpu" or "cuda", and this machine has it."""
    check_choice("accelerator", name, ("auto", "cpu", "cuda"))
    if name == "cuda" and not torch.cuda.is_available():
        raise ValueError("accelerator cuda: this machine has no GPU that torch can use; choose cpu or auto")


def make_fabric(*, accelerator: str = "auto") -> Fabric:
    """Fabric for this process, alone or one of torchrun's; bf16 where a GPU computes in it, else 32 bit.

    Parameters
    ----------
    accelerator : "auto" (cuda where it is there, else cpu), "cpu" or "cuda"

    Raises
    ------
    ValueError
        If this machine has no such accelerator.
    """
    from lightning_fabric import Fabric  # seconds, which nobody waits for who only dances

    check_accelerator(accelerator)
    world, local = (int(os.environ.get(name, 1)) for name in ("WORLD_SIZE", "LOCAL_WORLD_SIZE"))
    gpu = accelerator != "cpu" and torch.cuda.is_available()
    fabric = Fabric(
        accelerator="cuda" if gpu else "cpu",  # Fabric's "auto" takes a Mac's GPU, which knows no numbers of 64 bits
        devices=local,
        num_nodes=max(world // local, 1),
        strategy="ddp" if world > 1 else "auto",
        precision="bf16-mixed" if gpu and torch.cuda.is_bf16_supported() else "32-true",
    )
    fabric.launch()
    return fabric


def fit(
    fabric: Fabric,
    phases: Sequence[Phase],
    units: Units,
    batching: Batching,
    folder: Path,
    *,
    settings: dict[str, Any] | None = None,
    resume: bool = False,
    report: checkpoints.Report = lambda row, end: None,
) -> list[checkpoints.Row]:
    """Train networks through all phases, in one process or several, so that a training that was stopped can go on.

    The loop of all systems; take it for a system of your own.

    Parameters
    ----------
    fabric : Fabric of Lightning
        Launched.
    phases : sequence of Phase
        Of networks on the device, which are trained in place. Names differ.
    units : Units
        Training units on the device.
    batching : Batching
        How they are put into batches.
    folder : Path
        An existing folder, in which state, ``history.csv`` and events for TensorBoard are kept up to date.
    settings : JSON-able dict
        A state with other settings is not resumed.
    resume : bool
        Go on from the state in `folder`, where there is one.
    report : function (row, end)
        Called on the first process with the row of each epoch, and the epoch at which its phase ends.

    Returns
    -------
    list of dict, the history: a row for each epoch

    Raises
    ------
    ValueError
        If the state in `folder` is damaged or belongs to other settings, or the training diverges.
    """
    run = _Run(fabric, units, batching, folder, settings or {}, report)
    saved = checkpoints.load_state(folder) if resume else None
    tensors, about = saved or (None, {"settings": run.settings, "history": []})
    if about["settings"] != run.settings:
        raise ValueError(f"{folder}: was trained with other settings; resume with those, or choose another folder")
    run.rows += about["history"]
    if fabric.is_global_zero:
        run.events = checkpoints.EventLog(folder, run.rows)
        # A kill may have come after epochs that no state knows of.
        write_text(folder / checkpoints.HISTORY, checkpoints.history_text(run.rows))
    current = [phase.name for phase in phases].index(run.rows[-1]["phase"]) if run.rows else 0
    try:
        for phase in phases[current:]:
            _train(run, phase, tensors)
            tensors = None
    finally:
        if run.events is not None:
            run.events.close()
    return run.rows


def _train(run: _Run, phase: Phase, saved: dict[str, Tensor] | None) -> None:
    """The epochs of a phase that are still to come, from the tensors of a saved state if there is one."""
    optimisers: Optimisers = {
        player.name: player.optimiser(player.parameters, lr=phase.rate(0), weight_decay=player.decay)  # type: ignore[call-arg]
        for player in phase.players
    }
    if saved is not None:
        checkpoints.restore(saved, phase.modules, optimisers)
    first = sum(row["phase"] != phase.name for row in run.rows)
    for epoch in range(len(run.rows), first + phase.epochs):
        if phase.patience is not None and epoch > _best_epoch(run.rows, phase) + phase.patience:
            break
        rate = phase.rate(epoch - first)
        for group in (group for optimiser in optimisers.values() for group in optimiser.param_groups):
            group["lr"] = rate * group.get("share", 1.0)
        row: checkpoints.Row = {"phase": phase.name, "epoch": epoch, "rate": rate, **phase.schedule(epoch - first)}
        with named_faults(f"{run.folder}: {phase.name} epoch {epoch + 1}"):
            row |= _epoch_means(run, phase, optimisers, row)
        _end_epoch(run, phase, row, optimisers, first)
    if phase.epochs and phase.recall is not None:
        run.fabric.barrier()
        phase.recall()


def _best_epoch(rows: list[checkpoints.Row], phase: Phase) -> int:
    """The epoch of a phase with the least error so far; the present one before any was validated."""
    errors = [(row[phase.error], row["epoch"]) for row in rows if row["phase"] == phase.name and phase.error in row]
    return min(errors)[1] if errors else len(rows)


def _epoch_means(run: _Run, phase: Phase, optimisers: Optimisers, row: checkpoints.Row) -> dict[str, float]:
    """Mean of every loss term over an epoch in which all players learnt."""
    sums: Tensor | float = 0.0  # (shards of this process, terms)
    terms: list[Terms] = []
    outputs, count = None, 0
    for shards in epoch_shards(run.fabric, run.units, row["epoch"], run.batching):
        terms, outputs = _batch(run, phase, optimisers, row, shards, outputs or [None] * len(shards))
        pairs = zip(terms, shards, strict=True)
        sums += torch.stack([torch.stack([*each.values()]).detach().float() * shard.share for each, shard in pairs])
        count += 1
    return dict(zip(terms[0], (_added(run.fabric, torch.as_tensor(sums)) / count).tolist(), strict=True))


def _batch(
    run: _Run, phase: Phase, optimisers: Optimisers, row: checkpoints.Row, shards: list[Shard], last: list[Any]
) -> tuple[list[Terms], list[Any]]:
    """One step of each player; all terms, and the forward pass, of each shard."""
    with run.fabric.autocast():
        outputs = [phase.forward(shard, before) for shard, before in zip(shards, last, strict=True)]
    all_terms: list[Terms] = [{} for _ in shards]
    for player in phase.players:
        with run.fabric.autocast():
            terms = [_with_total(player, output, shard, row) for output, shard in zip(outputs, shards, strict=True)]
        step(run.fabric, terms, shards, optimisers[player.name], clip=player.clip)
        for earlier, own in zip(all_terms, terms, strict=True):
            earlier.pop("total", None)
            earlier |= own
    return all_terms, outputs


def _with_total(player: Player, output: Any, shard: Shard, row: checkpoints.Row) -> Terms:
    """A player's terms of a shard, and "total": their weighted sum."""
    terms = player.terms(output, shard, row)
    weights = {name: weight for name, weight in player.weights.items() if name in terms}
    return terms | {"total": total_loss(terms, weights)}


def _end_epoch(run: _Run, phase: Phase, row: checkpoints.Row, optimisers: Optimisers, first: int) -> None:
    """Complete the row; put history, events and, where it is time, the state on disk."""
    number, end = row["epoch"] + 1 - first, first + phase.epochs
    validated = number % phase.validate_every == 0 or number == phase.epochs
    if validated:
        row |= phase.validate()
    run.rows.append(row)
    if run.events is None:
        return
    best = phase.patience is None or _best_epoch(run.rows, phase) == row["epoch"]
    if validated and best and phase.keep is not None:
        phase.keep()  # before the state, which may say that the phase is over
    cost, when = run.saving
    start = time.monotonic()
    if number == phase.epochs or start - when >= cost / SAVING_SHARE:
        checkpoints.save_state(run.folder, phase.modules, optimisers, {"settings": run.settings, "history": run.rows})
        run.saving = time.monotonic() - start, time.monotonic()
    write_text(run.folder / checkpoints.HISTORY, checkpoints.history_text(run.rows))
    run.events.add(row)
    run.report(row, end)
