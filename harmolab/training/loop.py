"""Training of HarmoGAN in two visible loops: pretraining, then adversarial epochs (paper Sec. 5.2).

Runs on a CPU, a GPU or several processes (torchrun) through Lightning Fabric; `harmolab.training.shards` sees to it
that the number of processes does not change the result. The whole state goes to disk between epochs; a run that was
killed goes on from there.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field, is_dataclass
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn

from harmolab.models.losses import total_loss
from harmolab.models.soft_harmony import anneal
from harmolab.models.weights import load_generator, save_weights
from harmolab.params import TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.checkpoints import load_state, restore, save_state
from harmolab.training.history import EventLog, Report, Row, write_history
from harmolab.training.schedule import adversarial_rate, pretrain_rate
from harmolab.training.shards import Means, Shard, Terms, epoch_shards, step
from harmolab.training.steps import Danced, Networks, critic_terms, danced, generator_terms, pretrain_terms
from harmolab.training.validation import validate

__all__ = ["PRETRAINED", "fit", "settings_of"]

PRETRAINED = "pretrained"
PRETRAIN, ADVERSARIAL = "pretrain", "adversarial"
VALIDATE_EVERY = 5  # pretraining epochs; adversarial epochs are all validated
SAVING_SHARE = 0.05  # of the time may be spent on writing the state; a kill costs the epochs since the last time
Optimisers = dict[str, torch.optim.Optimizer]


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
    report: Report
    rows: list[Row] = field(default_factory=list)
    events: EventLog | None = None
    saving: tuple[float, float] = (0.0, 0.0)  # seconds that the last state took to write, and when that was


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
    folder : existing folder; state, ``history.csv`` and events for TensorBoard are kept up to date in it
    settings : JSON-able; a state with other settings is not resumed
    resume : go on from the state in `folder` when there is one
    report : called with each epoch's row, on the first process only

    Raises
    ------
    ValueError
        If the state in `folder` is damaged or belongs to other settings.
    """
    run = _Fit(fabric, networks, train, validation, params, folder, settings or {}, report)
    tensors = _saved(run) if resume else None
    if fabric.is_global_zero:
        run.events = EventLog(folder, run.rows)
        write_history(folder, run.rows)  # a kill may have come after epochs that no state knows of
    try:
        if not any(row["phase"] == ADVERSARIAL for row in run.rows):
            _pretrain(run, tensors)
            tensors = None
        _adversarial(run, tensors)
    finally:
        if run.events is not None:
            run.events.close()
    return run.rows


def _saved(run: _Fit) -> dict[str, Tensor] | None:
    """The tensors of the state in the folder, if there is one; its history becomes the run's."""
    saved = load_state(run.folder)
    if saved is None:
        return None
    tensors, about = saved
    if about["settings"] != run.settings:
        raise ValueError(f"{run.folder}: was trained with other settings; resume with those, or choose another folder")
    run.rows += about["history"]
    return tensors


def _pretrain(run: _Fit, saved: dict[str, Tensor] | None) -> None:
    """L_pretrain = 0.1 L_kl + L_mse."""
    generator, params = run.networks.generator, run.params
    modules: dict[str, nn.Module] = {"generator": generator}
    optimisers: Optimisers = {"generator": torch.optim.Adam(generator.parameters(), lr=params.pretrain_rate)}
    if saved is not None:
        restore(saved, modules, optimisers)
    weights = {"kl": params.pretrain_kl_weight, "mse": 1.0}
    for epoch in range(len(run.rows), params.pretrain_epochs):
        if params.patience is not None and run.rows and epoch > _best_epoch(run.rows) + params.patience:
            break
        rate = _set_rate(optimisers, pretrain_rate(epoch, params))
        means = Means()
        for shards in epoch_shards(run.fabric, run.train, epoch, params):
            with run.fabric.autocast():
                terms = [_with_total(pretrain_terms(generator, each.own, params), weights) for each in shards]
            step(run.fabric, terms, shards, optimisers["generator"])
            means.add(terms, shards)
        row: Row = {"phase": PRETRAIN, "epoch": epoch, "rate": rate, "tau": "", **means.over(run.fabric)}
        due = epoch % VALIDATE_EVERY == VALIDATE_EVERY - 1 or epoch == params.pretrain_epochs - 1
        _end_epoch(run, row, modules, optimisers, validated=due)
    if params.pretrain_epochs:
        run.fabric.barrier()
        generator.load_state_dict(load_generator(run.folder / PRETRAINED).state_dict())


def _worth_keeping(run: _Fit) -> bool:
    """Whether the last epoch is what pretraining has come to: the best one, or without patience the latest."""
    return run.params.patience is None or _best_epoch(run.rows) == run.rows[-1]["epoch"]


def _best_epoch(rows: list[Row]) -> int:
    """The pretraining epoch with the least error on the validation units so far; 0 before the first was validated."""
    judged = [(row["val_mse"], row["epoch"]) for row in rows if "val_mse" in row]
    return min(judged)[1] if judged else 0


def _adversarial(run: _Fit, saved: dict[str, Tensor] | None) -> None:
    """Critics and generator in turn on every batch (Eq. 28-32)."""
    params, modules = run.params, run.networks.modules()
    optimisers = _adversarial_optimisers(run.networks, params)
    if saved is not None:
        restore(saved, modules, optimisers)
    first = sum(row["phase"] != ADVERSARIAL for row in run.rows)
    for epoch in range(len(run.rows), first + params.adversarial_epochs):
        number = epoch - first
        rate = _set_rate(optimisers, adversarial_rate(number, params))
        tau = anneal(number, params.adversarial_epochs, params.tau_start, params.tau_end)
        means, last = Means(), None  # a new epoch begins new dances, so that one that is resumed goes on the same
        for shards in epoch_shards(run.fabric, run.train, epoch, params):
            terms, last = _adversarial_step(run, optimisers, shards, tau, last)
            means.add(terms, shards)
        row: Row = {"phase": ADVERSARIAL, "epoch": epoch, "rate": rate, "tau": tau, **means.over(run.fabric)}
        _end_epoch(run, row, modules, optimisers, validated=True)


def _adversarial_optimisers(networks: Networks, params: TrainParams) -> Optimisers:
    rate = params.adversarial_rate
    return {
        "generator": torch.optim.Adam(networks.generator.parameters(), lr=rate, weight_decay=params.generator_decay),
        "critics": torch.optim.Adam(networks.critics(params), lr=rate, weight_decay=params.critic_decay),
    }


def _adversarial_step(
    run: _Fit, optimisers: Optimisers, shards: list[Shard], tau: float, last: list[Danced] | None
) -> tuple[list[Terms], list[Danced]]:
    """One update of the critics, one of the generator; all terms of each shard, and what was danced."""
    earlier: list[Danced | None] = [*last] if last else [None] * len(shards)
    with run.fabric.autocast():
        made = [_danced(run, each, before) for each, before in zip(shards, earlier, strict=True)]
    judged = _critics_step(run, optimisers["critics"], made, shards) if run.params.gan_weight else [{} for _ in shards]
    with run.fabric.autocast():
        terms = [_generator_terms(run, dance, each, tau) for dance, each in zip(made, shards, strict=True)]
    step(run.fabric, terms, shards, optimisers["generator"])
    return [both | ours for both, ours in zip(judged, terms, strict=True)], made


def _danced(run: _Fit, shard: Shard, last: Danced | None) -> Danced:
    return danced(run.networks.generator, shard.own, shard.others if run.params.goes_on else None, last)


def _critics_step(run: _Fit, optimiser: torch.optim.Optimizer, made: list[Danced], shards: list[Shard]) -> list[Terms]:
    """One update of the critics; their losses on each shard."""
    with run.fabric.autocast():
        pairs = zip(made, shards, strict=True)
        losses = [critic_terms(run.networks, dance, each.own, run.params) for dance, each in pairs]
    step(run.fabric, [_with_total(each, dict.fromkeys(each, 1.0)) for each in losses], shards, optimiser)
    return losses


def _generator_terms(run: _Fit, made: Danced, shard: Shard, tau: float) -> Terms:
    """The terms of the hybrid loss and their weighted sum (Eq. 32)."""
    terms = generator_terms(run.networks, made, shard.own, run.params, tau)
    return _with_total(terms, {name: getattr(run.params, f"{name}_weight") for name in terms})


def _with_total(terms: Terms, weights: dict[str, float]) -> Terms:
    return {**terms, "total": total_loss(terms, weights)}


def _set_rate(optimisers: Optimisers, rate: float) -> float:
    for optimiser in optimisers.values():
        for group in optimiser.param_groups:
            group["lr"] = rate
    return rate


def _end_epoch(run: _Fit, row: Row, modules: dict[str, nn.Module], optimisers: Optimisers, *, validated: bool) -> None:
    """Complete the row; put history, events and, where it is time, the state on disk."""
    if validated:
        row |= validate(run.networks.generator, run.validation, run.params)
    run.rows.append(row)
    if run.events is None:
        return
    if validated and row["phase"] == PRETRAIN and _worth_keeping(run):
        # Before the state, which may say that pretraining is over.
        save_weights(run.folder / PRETRAINED, run.networks.generator, {"settings": run.settings})
    cost, when = run.saving
    start = time.monotonic()
    last = sum(done["phase"] == row["phase"] for done in run.rows) == _planned(run.params, row["phase"])
    if last or start - when >= cost / SAVING_SHARE:
        save_state(run.folder, modules, optimisers, {"settings": run.settings, "history": run.rows})
        run.saving = time.monotonic() - start, time.monotonic()
    write_history(run.folder, run.rows)
    run.events.add(row)
    run.report(row)


def _planned(params: TrainParams, phase: str) -> int:
    """Epochs of a phase, at most."""
    return params.adversarial_epochs if phase == ADVERSARIAL else params.pretrain_epochs


def settings_of(**parts: Any) -> dict[str, Any]:
    """Settings as they come back from JSON, so that saved and asked-for ones can be compared."""
    plain = {
        name: asdict(part) if is_dataclass(part) and not isinstance(part, type) else part
        for name, part in parts.items()
    }
    return json.loads(json.dumps(plain))
