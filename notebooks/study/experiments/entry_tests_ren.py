"""Is Ren et al.'s system, as trained here, trained well enough to be compared? It is asked about known figures."""

from __future__ import annotations

import numpy as np
import pandas as pd

from harmolab.systems.ren2020.networks import RenGenerator
from harmolab.systems.ren2020.train import danced_units, pose_loss, speed_ratio
from harmolab.systems.training.loop import Tensors
from harmolab.systems.training.splits import Split

SHARE = 10  # first and last tenth of the epochs
Results = dict[str, tuple[float, tuple[float, float], bool]]


def entry_ren2020(network: RenGenerator, split: Split, history: pd.DataFrame) -> Results:
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
    one, other = (danced_units(network, train, seed=seed) for seed in (0, 1))
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
        "speed on test units over recorded": (
            speed_ratio(network, danced_units(network, test, seed=0), test),
            0,
            np.inf,
        ),
    }
    return {name: (value, (low, high), bool(low <= value <= high)) for name, (value, low, high) in values.items()}


def _fall(values: pd.Series[float]) -> float:
    """The mean over the last epochs as a share of that over the first."""
    count = max(1, len(values) // SHARE)
    return float(values.tail(count).mean() / values.head(count).mean())
