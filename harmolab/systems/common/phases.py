"""One training loop for every system: phases one after the other; on each batch of a phase its players step in turn.

Runs on a CPU, a GPU or several processes (torchrun) through Lightning Fabric; `shards` sees to it
that the number of processes does not change the result. The whole state goes to disk between epochs; a run that was
killed goes on from there.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn

from harmolab.io.files import write_text
from harmolab.systems.common.checkpoints import load_state, restore, save_state
from harmolab.systems.common.history import HISTORY, EventLog, Report, Row, history_text
from harmolab.systems.common.shards import Batching, Means, Shard, Terms, Units, epoch_shards, step, total_loss

SAVING_SHARE = 0.05  # of the time may be spent on writing the state; a kill costs the epochs since the last time
ACCELERATORS = ("auto", "cpu", "cuda")
Optimisers = dict[str, torch.optim.Optimizer]


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
    terms: Callable[[Any, Shard, Row], Terms]
    weights: Mapping[str, float]
    decay: float = 0.0
    clip: float | None = None
    optimiser: type[torch.optim.Optimizer] = torch.optim.Adam


@dataclass(frozen=True, eq=False)
class Phase:
    """A part of a training: its epochs, networks, players and schedules.

    Parameters
    ----------
    name : in the history
    epochs : int, at most
    rate : function(number of the epoch in the phase) -> learning rate of parameters whose share is 1
    modules : networks by name, as they are kept in the state
    players : in the order of their steps on each batch
        The terms of all of them are in the history; "total" there is the last one's loss.
    forward : function(shard, last) -> output that the players' terms are computed from
        `last` is its own output for the shard of that number in the batch before; None in an epoch's first batch, so
        that an epoch that is resumed goes on the same.
    schedule : function(number of the epoch in the phase) -> further columns of its row
    validate : function() -> further columns of the row, on every process
    validate_every : int, epochs; the last epoch is validated too
    patience : int or None
        The phase ends earlier when `error` has not fallen for so many epochs, and the best epoch is kept. None: all
        epochs, and the last one is kept.
    error : column with the smallest value in the best epoch
    keep : function(), called on the first process after each validated epoch that is the one to keep so far
    recall : function(), called on every process after the phase's last epoch: goes back to the epoch that was kept
    """

    name: str
    epochs: int
    rate: Callable[[int], float]
    modules: Mapping[str, nn.Module]
    players: Sequence[Player]
    forward: Callable[[Shard, Any], Any]
    schedule: Callable[[int], Row] = lambda number: {}
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
    report: Report
    rows: list[Row] = field(default_factory=list)
    events: EventLog | None = None
    saving: tuple[float, float] = (0.0, 0.0)  # seconds that the last state took to write, and when that was


def make_fabric(*, accelerator: str = "auto") -> Fabric:
    """Fabric for this process, alone or one of torchrun's; bf16 where a GPU computes in it, else 32 bit.

    Parameters
    ----------
    accelerator : "auto", "cpu" or "cuda"

    Raises
    ------
    ValueError
        If this machine has no such accelerator.
    """
    if accelerator not in ACCELERATORS:
        raise ValueError(f"accelerator must be {' or '.join(ACCELERATORS)}, got {accelerator!r}")
    world, local = (int(os.environ.get(name, 1)) for name in ("WORLD_SIZE", "LOCAL_WORLD_SIZE"))
    if accelerator == "cuda" and not torch.cuda.is_available():
        raise ValueError("accelerator cuda: this machine has no GPU that torch can use; choose cpu or auto")
    gpu = accelerator != "cpu" and torch.cuda.is_available() and torch.cuda.is_bf16_supported()
    fabric = Fabric(
        accelerator=accelerator,
        devices=local,
        num_nodes=max(world // local, 1),
        strategy="ddp" if world > 1 else "auto",
        precision="bf16-mixed" if gpu else "32-true",
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
    report: Report = lambda row, end: None,
) -> list[Row]:
    """Train through all phases; one row of history per epoch.

    Parameters
    ----------
    fabric : Fabric, launched
    phases : of networks on the device, which are trained in place; names differ
    units : training units on the device
    batching : how they are put into batches
    folder : existing folder; state, ``history.csv`` and events for TensorBoard are kept up to date in it
    settings : JSON-able; a state with other settings is not resumed
    resume : go on from the state in `folder` when there is one
    report : called with each epoch's row and the epoch that its phase ends at, on the first process only

    Raises
    ------
    ValueError
        If the state in `folder` is damaged or belongs to other settings.
    """
    run = _Run(fabric, units, batching, folder, settings or {}, report)
    tensors, about = (load_state(folder) if resume else None) or (None, {"settings": run.settings, "history": []})
    if about["settings"] != run.settings:
        raise ValueError(f"{folder}: was trained with other settings; resume with those, or choose another folder")
    run.rows += about["history"]
    if fabric.is_global_zero:
        run.events = EventLog(folder, run.rows)
        write_text(folder / HISTORY, history_text(run.rows))  # a kill may have come after epochs that no state knows of
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
        restore(saved, phase.modules, optimisers)
    first = sum(row["phase"] != phase.name for row in run.rows)
    for epoch in range(len(run.rows), first + phase.epochs):
        if phase.patience is not None and epoch > _best_epoch(run.rows, phase) + phase.patience:
            break
        rate = phase.rate(epoch - first)
        for group in (group for optimiser in optimisers.values() for group in optimiser.param_groups):
            group["lr"] = rate * group.get("share", 1.0)
        row: Row = {"phase": phase.name, "epoch": epoch, "rate": rate, **phase.schedule(epoch - first)}
        row |= _epoch_means(run, phase, optimisers, row)
        _end_epoch(run, phase, row, optimisers, first)
    if phase.epochs and phase.recall is not None:
        run.fabric.barrier()
        phase.recall()


def _best_epoch(rows: list[Row], phase: Phase) -> int:
    """The epoch of a phase with the least error so far; the present one before any was validated."""
    errors = [(row[phase.error], row["epoch"]) for row in rows if row["phase"] == phase.name and phase.error in row]
    return min(errors)[1] if errors else len(rows)


def _epoch_means(run: _Run, phase: Phase, optimisers: Optimisers, row: Row) -> dict[str, float]:
    """Mean of every loss term over an epoch in which all players learnt."""
    means, outputs = Means(), None
    for shards in epoch_shards(run.fabric, run.units, row["epoch"], run.batching):
        terms, outputs = _batch(run, phase, optimisers, row, shards, outputs or [None] * len(shards))
        means.add(terms, shards)
    return means.over(run.fabric)


def _batch(
    run: _Run, phase: Phase, optimisers: Optimisers, row: Row, shards: list[Shard], last: list[Any]
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


def _with_total(player: Player, output: Any, shard: Shard, row: Row) -> Terms:
    """A player's terms of a shard, and "total": their weighted sum."""
    terms = player.terms(output, shard, row)
    weights = {name: weight for name, weight in player.weights.items() if name in terms}
    return terms | {"total": total_loss(terms, weights)}


def _end_epoch(run: _Run, phase: Phase, row: Row, optimisers: Optimisers, first: int) -> None:
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
        save_state(run.folder, phase.modules, optimisers, {"settings": run.settings, "history": run.rows})
        run.saving = time.monotonic() - start, time.monotonic()
    write_text(run.folder / HISTORY, history_text(run.rows))
    run.events.add(row)
    run.report(row, end)
