"""A pose network on the twenty points of every body: one judge that sees all systems alike."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.training.about import DEFAULT_STEM
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.pose_network import PoseNet, load_pose_net, train_pose_net
from harmolab.systems.training.units import UnitSet
from harmolab.systems.training.weights import save_weights
from study.experiments.generation import kept_run, paper_split
from study.experiments.unheard_songs import common_points
from study.profile import RunProfile


def pointed(units: UnitSet) -> UnitSet:
    """The same units with the motion of the common points."""
    motions = [common_points(units.decoded(unit.motion.astype(np.float64))) for unit in units.units]
    coded = [
        replace(unit, motion=encode_motion(motion.positions, motion.fps, motion.skeleton).astype(np.float32))
        for unit, motion in zip(units.units, motions, strict=True)
    ]
    return replace(units, units=tuple(coded), skeleton=motions[0].skeleton)


@cache
def points_net(profile: RunProfile, corpus: str) -> PoseNet:
    """The network, trained on the training side of a corpus as HarmoGAN's is, now unless it was before."""
    split = paper_split(profile, corpus)
    epochs = profile.pose_epochs or TrainParams.recommended().pose_epochs

    def train(options: TrainOptions) -> None:
        folder = Path(options.out)
        net = train_pose_net(pointed(split.train), pointed(split.validation), seed=profile.seed, epochs=epochs)
        folder.mkdir(parents=True, exist_ok=True)
        save_weights(folder / DEFAULT_STEM, net, {"seed": profile.seed, "epochs": epochs})

    return load_pose_net(kept_run("points", {"split": split.to_dict(), "epochs": epochs}, train) / DEFAULT_STEM)
