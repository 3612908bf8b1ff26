"""The rival systems of the comparison, trained on the same split as HarmoGAN and kept in the cache folder likewise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.train import Lee2019, train_lee2019
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.ren2020.train import Ren2020, train_ren2020
from harmolab.systems.training.checkpoints import HISTORY
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.splits import Split
from study.experiments.clock import training_minutes
from study.experiments.entry_tests_lee import entry_lee2019
from study.experiments.entry_tests_ren import entry_ren2020
from study.experiments.generation import kept_run, training_split
from study.profile import RunProfile

QUICK_EPOCHS = 2  # of each phase, where the profile cuts trainings short: no number is printed of what so few make
Asked = dict[str, tuple[float, tuple[float, float], bool]]


@dataclass(frozen=True, eq=False)
class TrainedRival:
    """One finished training: where it is kept, the system, its entry tests, the minutes it took."""

    folder: Path
    system: Any
    entry: Asked
    minutes: float


def lee2019(profile: RunProfile, corpus: str, seed: int) -> TrainedRival:
    """The system of Lee et al. 2019 of a seed, trained now unless it was before."""
    split = training_split(profile, corpus, FeatureParams.paper())
    folder = _run("lee2019", train_lee2019, split, lee_params(profile, seed))
    system: Any = Lee2019.load(folder)
    return TrainedRival(folder, system, entry_lee2019(system.generator, split), training_minutes(folder))


def ren2020(profile: RunProfile, corpus: str, seed: int) -> TrainedRival:
    """The system of Ren et al. 2020 of a seed, trained now unless it was before."""
    split = training_split(profile, corpus, FeatureParams.paper())
    folder = _run("ren2020", train_ren2020, split, ren_params(profile, seed))
    system: Any = Ren2020.load(folder)
    history = pd.read_csv(folder / HISTORY)
    return TrainedRival(folder, system, entry_ren2020(system.generator, split, history), training_minutes(folder))


def lee_params(profile: RunProfile, seed: int) -> LeeParams:
    """The small preset; for a profile that cuts trainings short a tiny one, which fails its entry tests."""
    small = replace(LeeParams.small(), seed=seed)
    if profile.epochs is None or profile.hidden is None:
        return small
    units = round(profile.hidden / ModelParams.small().hidden * small.hidden)
    return replace(
        small, hidden=units, latent=units // 2, regressor_layers=(units // 2,), critic_layers=(units, 30),
        style_epochs=QUICK_EPOCHS, unit_epochs=QUICK_EPOCHS, composition_epochs=QUICK_EPOCHS,
    )  # fmt: skip


def ren_params(profile: RunProfile, seed: int) -> RenParams:
    """The small preset; for a profile that cuts trainings short a tiny one, which fails its entry tests."""
    small = replace(RenParams.small(), seed=seed)
    if profile.epochs is None or profile.hidden is None:
        return small
    share = profile.hidden / ModelParams.small().hidden
    return replace(
        small, hidden=round(share * small.hidden), body=round(share * small.body), discriminator=8, graph=4,
        epochs=QUICK_EPOCHS, graph_epochs=1,
    )  # fmt: skip


def _run(name: str, train: Any, split: Split, params: Any) -> Path:
    """Folder of a finished training of these settings."""
    about = {name: params, "features": split.train.features, "split": split.to_dict()}
    return kept_run(name, about, lambda options: train(split, options, params))
