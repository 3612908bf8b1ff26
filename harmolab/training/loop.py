"""Training of HarmoGAN in two visible loops: pretraining, then adversarial epochs (paper Sec. 5.2).

Runs on a CPU, a GPU or several processes (torchrun) through Lightning Fabric. Gradients are averaged over processes here,
in one place, and every process takes its share of the same global batch, so the number of processes does not change
the result. After each epoch the whole state is on disk; a run that was killed goes on from there.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn

from harmolab.models.losses import total_loss
from harmolab.models.soft_harmony import anneal
from harmolab.models.weights import save_weights
from harmolab.params import TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.checkpoints import load_state, restore, save_state, write_aside
from harmolab.training.schedule import adversarial_rate, epoch_order, pretrain_rate
from harmolab.training.steps import Networks, critic_terms, generator_terms, pretrain_terms
from harmolab.training.validation import validate

__all__ = ["HISTORY", "PRETRAINED", "Report", "fit", "history_text", "settings_of"]

HISTORY = "history.csv"
PRETRAINED = "pretrained"
VALIDATE_EVERY = 5  # pretraining epochs; adversarial epochs are all validated
Row = dict[str, Any]
Report = Callable[[Row], None]


@dataclass(eq=False)
class _Fit:
    """What both loops share. `rows` is the history so far, one row an epoch."""

    fabric: Fabric
    networks: Networks
    train: Tensors
    validation: Tensors
    params: TrainParams
    folder: Path
    settings: dict[str, Any]
    rows: list[Row]
    report: Report


def fit(
    fabric: Fabric,
    networks: Networks,
    train: Tensors,
    validation: Tensors,
    params: TrainParams,
    folder: Path,
    *,
    settings: dict[str, Any] | None = None,
    resume: bool = False,
    report: Report = lambda row: None,
) -> list[Row]:
    """Train to the end of the schedule; one row of history per epoch.

    Parameters
    ----------
    fabric : Fabric, launched
    networks : Networks, on the device; trained in place
    train, validation : Tensors on the device
    folder : existing folder; ``state.safetensors`` and ``history.csv`` are kept up to date in it
    settings : JSON-able; a state with other settings is not resumed
    resume : go on from the state in `folder` when there is one
    report : called with each epoch's row, on the first process only

    Raises
    ------
    ValueError
        If the state in `folder` is damaged or belongs to other settings.
    """
    run = _Fit(fabric, networks, train, validation, params, folder, settings or {}, [], report)
    saved = load_state(folder) if resume else None
    if saved is not None and saved[1]["settings"] != run.settings:
        raise ValueError(f"{folder}: was trained with other settings; resume with those, or choose another folder")
    if saved is None or len(saved[1]["history"]) <= params.pretrain_epochs:
        _pretrain(run, saved)
        saved = None
    _adversarial(run, saved)
    return run.rows


def _pretrain(run: _Fit, saved: tuple[dict[str, Tensor], dict[str, Any]] | None) -> None:
    """L_pretrain = 0.1 L_kl + L_mse."""
    generator, params = run.networks.generator, run.params
    optimisers = {"generator": torch.optim.Adam(generator.parameters(), lr=params.pretrain_rate)}
    _go_on(run, optimisers, saved)
    weights = {"kl": params.pretrain_kl_weight, "mse": 1.0}
    for epoch in range(len(run.rows), params.pretrain_epochs):
        rate = _set_rate(optimisers, pretrain_rate(epoch, params))
        means = _Means()
        for batch, share in _batches(run, epoch):
            with run.fabric.autocast():
                terms = pretrain_terms(generator, batch, params)
                loss = total_loss(terms, weights)
            _step(run.fabric, loss * share, optimisers["generator"])
            means.add({**terms, "total": loss}, share)
        row: Row = {"phase": "pretrain", "epoch": epoch, "rate": rate, "tau": "", **means.over(run.fabric)}
        due = epoch % VALIDATE_EVERY == VALIDATE_EVERY - 1 or epoch == params.pretrain_epochs - 1
        _end_epoch(run, row, optimisers, validated=due)
    if params.pretrain_epochs and run.fabric.is_global_zero:
        save_weights(run.folder / PRETRAINED, generator, {"settings": run.settings})


def _adversarial(run: _Fit, saved: tuple[dict[str, Tensor], dict[str, Any]] | None) -> None:
    """Critics and generator in turn on every batch (Eq. 28-32)."""
    params, networks = run.params, run.networks
    optimisers = _adversarial_optimisers(networks, params)
    _go_on(run, optimisers, saved)
    total = params.pretrain_epochs + params.adversarial_epochs
    for epoch in range(len(run.rows), total):
        number = epoch - params.pretrain_epochs
        rate = _set_rate(optimisers, adversarial_rate(number, params))
        tau = anneal(number, params.adversarial_epochs, params.tau_start, params.tau_end)
        means = _Means()
        for batch, share in _batches(run, epoch):
            means.add(_adversarial_step(run, optimisers, batch, share, tau), share)
        row: Row = {"phase": "adversarial", "epoch": epoch, "rate": rate, "tau": tau, **means.over(run.fabric)}
        _end_epoch(run, row, optimisers, validated=True)


def _adversarial_optimisers(networks: Networks, params: TrainParams) -> dict[str, torch.optim.Optimizer]:
    rate = params.adversarial_rate
    return {
        "generator": torch.optim.Adam(networks.generator.parameters(), lr=rate, weight_decay=params.generator_decay),
        "critics": torch.optim.Adam(networks.critics(), lr=rate, weight_decay=params.critic_decay),
    }


def _adversarial_step(
    run: _Fit, optimisers: dict[str, torch.optim.Optimizer], batch: Tensors, share: float, tau: float
) -> dict[str, Tensor]:
    """One update of the critics, one of the generator; all terms of the batch."""
    params, networks = run.params, run.networks
    with run.fabric.autocast():
        made = networks.generator(batch.audio, batch.initial)
        judged = critic_terms(networks, made.motion, batch) if params.gan_weight else {}
    if judged:
        _step(run.fabric, sum(judged.values(), torch.zeros(())) * share, optimisers["critics"])
    with run.fabric.autocast():
        terms = generator_terms(networks, made, batch, params, tau)
        weights = {name: getattr(params, f"{name}_weight") for name in terms}
        loss = total_loss(terms, weights)
    _step(run.fabric, loss * share, optimisers["generator"])
    return {**terms, **judged, "total": loss}


def _go_on(
    run: _Fit, optimisers: dict[str, torch.optim.Optimizer], saved: tuple[dict[str, Tensor], dict[str, Any]] | None
) -> None:
    """Take weights, optimisers and history from a saved state."""
    if saved is None:
        return
    tensors, about = saved
    restore(tensors, run.networks.modules(), optimisers)
    run.rows[:] = about["history"]
    if run.fabric.is_global_zero:  # the kill may have come between the state and the history
        write_aside(run.folder / HISTORY, history_text(run.rows))


def _set_rate(optimisers: dict[str, torch.optim.Optimizer], rate: float) -> float:
    for optimiser in optimisers.values():
        for group in optimiser.param_groups:
            group["lr"] = rate
    return rate


def _batches(run: _Fit, epoch: int) -> Iterator[tuple[Tensors, float]]:
    """This process's share of every global batch, and the weight of its mean in the mean over processes."""
    world, rank = run.fabric.world_size, run.fabric.global_rank
    for indices in epoch_order(len(run.train), epoch, run.params):
        mine = run.train.take(indices, rank, world)
        yield mine, len(mine) * world / len(indices)


def _step(fabric: Fabric, loss: Tensor, optimiser: torch.optim.Optimizer) -> None:
    """Backward, average gradients over processes, update."""
    optimiser.zero_grad(set_to_none=True)
    fabric.backward(loss)
    if fabric.world_size > 1:
        _average_gradients(fabric, [part for group in optimiser.param_groups for part in group["params"]])
    optimiser.step()


def _average_gradients(fabric: Fabric, parameters: list[nn.Parameter]) -> None:
    """Replace each gradient by its mean over processes, all in one message."""
    used = [part for part in parameters if part.grad is not None]
    gradients = [part.grad for part in used if part.grad is not None]
    flat = fabric.all_reduce(torch.cat([gradient.flatten() for gradient in gradients]), reduce_op="mean")
    sizes = [gradient.numel() for gradient in gradients]
    for part, piece in zip(used, torch.as_tensor(flat).split(sizes), strict=True):
        part.grad = piece.view_as(part)


class _Means:
    """Means of named terms over the batches of an epoch."""

    def __init__(self) -> None:
        self.sums: dict[str, Tensor] = {}
        self.count = 0

    def add(self, terms: dict[str, Tensor], share: float) -> None:
        for name, value in terms.items():
            self.sums[name] = self.sums.get(name, torch.zeros((), device=value.device)) + value.detach().float() * share
        self.count += 1

    def over(self, fabric: Fabric) -> dict[str, float]:
        """The means over all processes."""
        stacked = torch.stack(list(self.sums.values())) / self.count
        merged = torch.as_tensor(fabric.all_reduce(stacked, reduce_op="mean")) if fabric.world_size > 1 else stacked
        return dict(zip(self.sums, merged.tolist(), strict=True))


def _end_epoch(run: _Fit, row: Row, optimisers: dict[str, torch.optim.Optimizer], *, validated: bool) -> None:
    """Complete the row, and put state and history on disk."""
    if validated:
        row |= validate(run.networks.generator, run.validation, run.params)
    run.rows.append(row)
    if run.fabric.is_global_zero:
        about = {"settings": run.settings, "history": run.rows}
        save_state(run.folder, run.networks.modules(), optimisers, about)
        write_aside(run.folder / HISTORY, history_text(run.rows))
        run.report(row)


def history_text(rows: list[Row]) -> str:
    """The history as CSV; a value that an epoch does not have is empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def settings_of(**parts: Any) -> dict[str, Any]:
    """Settings as they come back from JSON, so that saved and asked-for ones can be compared."""
    return json.loads(json.dumps({name: asdict(part) if hasattr(part, "__dataclass_fields__") else part for name, part in parts.items()}))
