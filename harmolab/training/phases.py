"""The two phases of HarmoGAN's training, pretraining and adversarial epochs (paper Sec. 5.2), and its validation."""

from __future__ import annotations

from itertools import cycle, islice
from math import prod
from pathlib import Path
from typing import Any

import torch

from harmolab.models.harmogan import Generator, load_generator
from harmolab.models.soft_harmony import anneal
from harmolab.models.weights import save_weights
from harmolab.params import HarmonyParams, TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.loop import Phase, Player
from harmolab.training.steps import (
    Networks,
    danced,
    discriminator_terms,
    generator_terms,
    motion_error,
    pose_terms,
    score_batch,
)

PRETRAINED = "pretrained"
VALIDATE_EVERY = 5  # pretraining epochs; adversarial epochs are all validated
HARD = 1e-8  # softness at which the relaxed score is the hard one


def phases(
    networks: Networks, validation: Tensors, params: TrainParams, folder: Path, settings: dict[str, Any]
) -> list[Phase]:
    """Pretraining of the generator alone, then discriminators and generator in turn.

    Parameters
    ----------
    networks : Networks, on the device
    validation : units on the device
    params : schedule and loss weights
    folder : of the run; ``pretrained.safetensors`` and ``.json`` are kept in it
    settings : JSON-able; kept beside those weights
    """
    return [_pretraining(networks, validation, params, folder, settings), _adversarial(networks, validation, params)]


def _pretraining(
    networks: Networks, validation: Tensors, params: TrainParams, folder: Path, settings: dict[str, Any]
) -> Phase:
    """L_pretrain = 0.1 L_kl + L_mse; ends with the best epoch."""
    generator = networks.generator
    learner = Player(
        "generator",
        [*generator.parameters()],
        lambda output, shard, row: pose_terms(generator, output, shard.own, params),
        {"kl": params.pretrain_kl_weight, "mse": 1.0},
    )
    return Phase(
        "pretrain",
        params.pretrain_epochs,
        rate=lambda number: pretrain_rate(number, params),
        modules={"generator": generator},
        players=[learner],
        forward=lambda shard, last: generator(shard.own.audio, shard.own.initial),
        schedule=lambda number: {"tau": ""},
        validate=lambda: validate(generator, validation, params),
        validate_every=VALIDATE_EVERY,
        patience=params.patience,
        keep=lambda: save_weights(folder / PRETRAINED, generator, {"settings": settings}),
        recall=lambda: generator.load_state_dict(load_generator(folder / PRETRAINED).state_dict()),
    )


def _adversarial(networks: Networks, validation: Tensors, params: TrainParams) -> Phase:
    """Discriminators and generator in turn on every batch (Eq. 28-32)."""
    generator = networks.generator
    discriminators = Player(
        "discriminators",
        networks.discriminators(params),
        lambda output, shard, row: discriminator_terms(networks, output, shard.own, params),
        {"critic_st": 1.0, "critic_cd": 1.0},
        params.discriminator_decay,
    )
    dancer = Player(
        "generator",
        [*generator.parameters()],
        lambda output, shard, row: generator_terms(networks, output, shard.own, params, row["tau"]),
        {name.removesuffix("_weight"): getattr(params, name) for name in vars(params) if name.endswith("_weight")},
        params.generator_decay,
    )
    return Phase(
        "adversarial",
        params.adversarial_epochs,
        rate=lambda number: adversarial_rate(number, params),
        modules=networks.modules(),
        players=[discriminators, dancer] if params.gan_weight else [dancer],
        forward=lambda shard, last: danced(generator, shard.own, shard.others if params.rollout else None, last),
        schedule=lambda number: {"tau": anneal(number, params.adversarial_epochs, params.tau_start, params.tau_end)},
        validate=lambda: validate(generator, validation, params),
    )


def pretrain_rate(epoch: int, params: TrainParams) -> float:
    """Adam's learning rate in pretraining epoch `epoch` (from 0): one factor after every 50 epochs, then it stays.

    >>> [pretrain_rate(epoch, TrainParams.paper()) for epoch in (0, 50, 100)]
    [0.001, 0.0005, 0.0001]
    """
    drops = params.pretrain_drops[: epoch // params.pretrain_drop_epochs]
    return params.pretrain_rate * prod(drops)


def adversarial_rate(epoch: int, params: TrainParams) -> float:
    """Learning rate of all networks in adversarial epoch `epoch` (from 0): divided by 2 and 5 in turn every 5 epochs.

    >>> [adversarial_rate(epoch, TrainParams.paper()) for epoch in (0, 5, 10)]
    [0.0001, 5e-05, 1e-05]
    """
    drops = islice(cycle(params.adversarial_drops), epoch // params.adversarial_drop_epochs)
    return params.adversarial_rate * prod(drops)


@torch.no_grad()
def validate(generator: Generator, units: Tensors, params: TrainParams) -> dict[str, float]:
    """Means over units: error, the paper's harmony and hit rate, harmony above chance, beats M per beat N.

    Returns
    -------
    dict of val_mse, val_harmony, val_hit_rate (paper mode), val_above_chance, val_count_ratio (valleys within 0.1 s)
    """
    generator.eval()
    motion = generator(units.audio, units.initial).motion
    generator.train()
    paper = score_batch(generator, motion, units, HARD, HarmonyParams.paper())
    valleys = score_batch(generator, motion, units, HARD, HarmonyParams.valleys())
    return {
        "val_mse": float(motion_error(generator, motion, units, params.epsilon)),
        "val_harmony": float(paper.harmony.mean()),
        "val_hit_rate": float(paper.hit_rate.mean()),
        "val_above_chance": float(valleys.above_chance.mean()),
        "val_count_ratio": float(valleys.n_visual.sum() / valleys.n_audio.sum().clamp(min=1.0)),
    }
