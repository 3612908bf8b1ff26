"""The rival systems of the comparison, trained on HarmoGAN's split and kept in the cache folder; their entry tests.

The entry tests ask about known figures: is a system, as trained here, trained well enough to be compared?
"""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.lee2019 import train as lee
from harmolab.systems.lee2019.networks import Code, DancingToMusic
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.train import Lee2019, rebuilt, speed, train_lee2019
from harmolab.systems.ren2020.networks import RenGenerator
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.ren2020.train import Ren2020, pose_loss, speed_ratio, train_ren2020
from harmolab.systems.training.loop import Tensors
from harmolab.systems.training.splits import Split
from study.experiments.generation import Asked, TrainedSystem, kept_run, paper_split
from study.profile import RunProfile

QUICK_EPOCHS = 2  # of each phase, where the profile cuts trainings short: no number is printed of what so few make


def lee2019(profile: RunProfile, corpus: str, seed: int) -> TrainedSystem:
    """The system of Lee et al. 2019 of a seed, trained now unless it was before."""
    split = paper_split(profile, corpus)
    folder = _run("lee2019", train_lee2019, split, lee_params(profile, seed))
    system: Any = Lee2019.load(folder)
    return TrainedSystem(folder, system, entry_lee2019(system.generator, split))


def ren2020(profile: RunProfile, corpus: str, seed: int) -> TrainedSystem:
    """The system of Ren et al. 2020 of a seed, trained now unless it was before."""
    split = paper_split(profile, corpus)
    folder = _run("ren2020", train_ren2020, split, ren_params(profile, seed))
    run = TrainedSystem(folder, Ren2020.load(folder))
    return replace(run, entry=entry_ren2020(run.system.generator, split, run.history))


def lee_params(profile: RunProfile, seed: int) -> LeeParams:
    """The profile's preset; where it cuts trainings short a tiny one, which fails its entry tests."""
    params = replace(getattr(LeeParams, profile.preset)(), seed=seed)
    if profile.hidden is not None:
        units = round(profile.hidden / ModelParams.small().hidden * params.hidden)
        sizes = {"regressor_layers": (units // 2,), "critic_layers": (units, 30)}
        params = replace(params, hidden=units, latent=units // 2, **sizes)
    if profile.epochs is None:
        return params
    phases = ("style_epochs", "unit_epochs", "composition_epochs")
    return replace(params, **dict.fromkeys(phases, QUICK_EPOCHS))


def ren_params(profile: RunProfile, seed: int) -> RenParams:
    """The profile's preset; where it cuts trainings short a tiny one, which fails its entry tests."""
    params = replace(getattr(RenParams, profile.preset)(), seed=seed)
    if profile.hidden is not None:
        share = profile.hidden / ModelParams.small().hidden
        sizes = {"hidden": round(share * params.hidden), "body": round(share * params.body)}
        params = replace(params, **sizes, discriminator=8, graph=4)
    return params if profile.epochs is None else replace(params, epochs=QUICK_EPOCHS, graph_epochs=1)


def _run(name: str, train: Any, split: Split, params: Any) -> Path:
    """Folder of a finished training of these settings."""
    about = {name: params, "features": split.train.features, "split": split.to_dict()}
    return kept_run(name, about, lambda options: train(split, options, params))


# Entry tests


def _asked(values: dict[str, tuple[float, float, float]]) -> Asked:
    """For each test its value, the range asked for, and whether the value lies in it."""
    return {name: (value, (low, high), bool(low <= value <= high)) for name, (value, low, high) in values.items()}


def entry_lee2019(network: DancingToMusic, split: Split) -> Asked:
    """The entry tests: for each its value, the range asked for, and whether the value lies in it.

    The first four are about pieces of the training split, rebuilt by the means of their codes; a guess of the dance is
    the most frequent one of the validation units, whose songs are heard in training too.

    Parameters
    ----------
    network : DancingToMusic, trained
    split : that it was trained on
    """
    network.eval()
    train, held_out = (lee.split_pieces(network, units) for units in (split.train, split.validation))
    pieces = train.poses.flatten(0, 1)
    again, still = rebuilt(network, pieces), pieces.mean(dim=1, keepdim=True).expand_as(pieces)
    drawn, recorded = drawn_movements(network, pieces), speed(network, pieces)
    guess = Counter(unit.dance for unit in split.validation.units).most_common(1)[0][1] / len(held_out)
    error, right = lee.code_error(network, again, pieces), lee.critic_accuracy(network, held_out)
    values = {
        "L1 of rebuilt pieces over their own mean pose's": (error / lee.code_error(network, still, pieces), 0.0, 0.5),
        "speed of rebuilt pieces over recorded": (speed(network, again) / recorded, 0.7, 1.2),
        "speed of drawn movements over recorded": (speed(network, drawn) / recorded, 0.6, 1.2),
        "divergence of z_move (nats)": (movement_nats(network, pieces), 20.0, math.inf),
        "dance told by style, over guessing": (lee.style_accuracy(network, held_out) / guess, 2.0, math.inf),
        "critic of units right": (right["units"], 0.55, 0.95),
        "critic of dances right": (right["dance"], 0.55, 0.95),
    }
    return _asked(values)


@torch.no_grad()
def drawn_movements(network: DancingToMusic, pieces: Tensor, seed: int = 0) -> Tensor:
    """Units (N, 32, C) from the first poses of pieces and movements drawn from the standard normal."""
    generator = torch.Generator().manual_seed(seed)
    z_move = torch.randn(len(pieces), network.params.latent, generator=generator).to(pieces)
    pairs = zip(pieces.split(lee.CHUNK), z_move.split(lee.CHUNK), strict=True)
    return torch.cat([network.unit_decoder(network.poses(part[:, 0]).mean, code) for part, code in pairs])


@torch.no_grad()
def movement_nats(network: DancingToMusic, pieces: Tensor) -> float:
    """Mean divergence of z_move from the standard normal, nats a piece."""
    codes = [network.movements(part) for part in pieces.split(lee.CHUNK)]
    return float(lee.divergence(Code(*(torch.cat(parts) for parts in zip(*codes, strict=True)))))


def entry_ren2020(network: RenGenerator, split: Split, history: pd.DataFrame) -> Asked:
    """The entry tests: for each its value, the range asked for, and whether the value lies in it.

    Feature terms must fall on the whole, as weighted in the loss. Feature matching alone is no condition: its features
    are those of a discriminator that goes on learning, so it may rise while the dances come nearer. Nor is the speed on
    new units: "slight body swings" are what the system is known for.

    Parameters
    ----------
    network : RenGenerator, trained
    split : that it was trained on
    history : its ``history.csv``
    """
    train, test = Tensors.of(split.train), Tensors.of(split.test)
    target = network.motion_scale(train.motion)
    one, other = (network.drawn(train.audio, train.mask, seed) for seed in (0, 1))
    pace = speed_ratio(network, network.drawn(test.audio, test.mask, 0), test)
    mean_pose = float(pose_loss(target * 0, target, train.mask))
    rows = history[history["phase"] == "adversarial"]
    features = network.params.perceptual_weight * rows["perceptual"] + network.params.feature_weight * rows["feature"]
    losses = rows.drop(columns="phase").filter(regex="^(?!val_)").to_numpy(float)
    values = {
        "L1 of training units over the mean pose's": (float(pose_loss(one, target, train.mask)) / mean_pose, 0, 2 / 3),
        "feature terms, last tenth of epochs over first": (_fall(features), 0, 1),
        "of these, feature matching alone": (_fall(rows["feature"]), 0, np.inf),
        "losses that are not finite": (float((~np.isfinite(losses)).sum()), 0, 0),
        "difference between two seeds (SD)": (float(pose_loss(one, other, train.mask)), 1e-6, np.inf),
        "speed on test units over recorded": (pace, 0, np.inf),
    }
    return _asked(values)


def _fall(values: "pd.Series[float]") -> float:
    """The mean over the last epochs as a share of that over the first."""
    count = max(1, len(values) // 10)
    return float(values.tail(count).mean() / values.head(count).mean())
