"""Invented dances that a tiny generator learns in a second: what the tests of training share.

`python tiny_training.py DESTINATION CASE...` trains in each DESTINATION/CASE, alone or as one of torchrun's processes;
a case is a key of `CASES`. `python tiny_training.py DESTINATION --kills 5` kills trainings and lets them go on.
"""

import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch

from harmolab import Skeleton
from harmolab.params import BarPattern
from harmolab.systems import FeatureParams, ModelParams, TrainParams
from harmolab.systems.harmogan.train import train_harmogan
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import DanceUnit, UnitSet

FPS = 15.0
DANCER = Skeleton(("hips", "left_hip", "right_hip", "left_toe", "right_toe"), (-1, 0, 0, 1, 2))
MODEL = ModelParams(hidden=16, layers=1, pose_features=8, discriminator=4)
SHORT: dict[str, Any] = {"pretrain_epochs": 3, "adversarial_epochs": 3, "pose_epochs": 1, "batch_size": 4}
PAPER, RECOMMENDED = replace(TrainParams.paper(), **SHORT), replace(TrainParams.recommended(), **SHORT)
# 13 training units: batches of 4, 3, 3, 3; of 5, 4, 4.
PATTERNS = (BarPattern.stop_on_the_beat(),)
SHORTER = {"pretrain_epochs": 2, "adversarial_epochs": 2}
CASES = {
    "paper": replace(PAPER, **SHORTER),
    "paper_shards": replace(PAPER, shards=2, **SHORTER),
    "recommended_shards": replace(RECOMMENDED, shards=2, batch_size=5, **SHORTER),
}


def dancing(phase: np.ndarray) -> np.ndarray:
    """Positions (T, 5, 3): hips that sway with the phase, straight legs of 0.88 m that swing in turn."""
    hips = np.stack([0.1 * np.sin(phase), 0.9 + 0.02 * np.cos(phase), np.zeros_like(phase)], axis=1)
    joints = [hips, hips + np.array([0.1, -0.02, 0]), hips - np.array([0.1, 0.02, 0])]
    for side in (1, 2):
        swing = 0.4 * np.sin(phase) * (3 - 2 * side)
        joints.append(joints[side] + 0.88 * np.stack([np.zeros_like(phase), -np.cos(swing), np.sin(swing)], axis=1))
    return np.stack(joints, axis=1)


def tiny_unit(number: int, features: FeatureParams, *, sketched: bool = False) -> DanceUnit:
    """Eight beats of 3 or 4 frames; the dancer sways and steps once in two beats."""
    rng = np.random.default_rng(number)
    period = int(rng.integers(3, 5))
    time = np.arange(8 * period)
    phase = 2 * np.pi * time / (2 * period) + rng.uniform(0, 0.5)
    positions = dancing(phase)
    audio = rng.normal(size=(len(time), features.n_audio))
    audio[:, 0] = np.cos(phase)
    return DanceUnit(
        f"unit{number}", f"sequence{number}", "waltz", frozenset({f"figure{number % 3}"}),
        frozenset({f"figure{number % 3}"}), 0.0, audio.astype(np.float32), encode_motion(positions, FPS, DANCER),
        (time < 4 * period).astype(np.float32), np.arange(8) * period / FPS, rng.uniform(0.5, 1, 8), FPS,
        sketch=encode_motion(dancing(phase + 1), FPS, DANCER) if sketched else None, bar=(number % 2 - 1, 0),
    )  # fmt: skip


def tiny_split(*, beat_channels: bool = True, n_train: int = 13, sketched: bool = False) -> Split:
    """13 units to train on, three to validate, three to test; the same in every process."""
    features = FeatureParams(fps=FPS, n_mfcc=4, beat_channels=beat_channels)
    units = [tiny_unit(number, features, sketched=sketched) for number in range(n_train + 6)]
    sides = (units[:n_train], units[n_train : n_train + 3], units[n_train + 3 :])
    lengths = bone_lengths(dancing(np.zeros(1)), DANCER)
    sets = [UnitSet(tuple(side), DANCER, lengths, features, "tiny") for side in sides]
    return Split(*sets, {"train": [], "validation": [], "test": []}, {"seed": 0})


def descent(parameters: Iterable[Any], loss: Callable[[], torch.Tensor], *, steps: int, rate: float) -> list[float]:
    """The loss before each step that Adam takes down it."""
    optimiser, errors = torch.optim.Adam(parameters, lr=rate), []
    for _ in range(steps):
        value = loss()
        optimiser.zero_grad()
        value.backward()
        optimiser.step()
        errors.append(float(value.detach()))
    return errors


class Stopped(Exception):
    """Stands for whatever ends a training before its time."""


def stopping(last: int | None) -> Callable[[dict[str, Any], int], None]:
    """A report that ends a training after an epoch of its history, those of a network trained before it left aside."""

    def report(row: dict[str, Any], end: int) -> None:
        if row["phase"] not in ("pose network", "ST-GCN") and row["epoch"] == last:
            raise Stopped

    return report


def train(split: Split, folder: Path, params: TrainParams, *, resume: bool = False) -> None:
    options = TrainOptions(folder, resume=resume, accelerator="cpu")
    train_harmogan(split, options, model=MODEL, params=params, patterns=PATTERNS)


def main(destination: Path, cases: list[str]) -> None:
    torch.set_num_threads(1)
    for case in cases:
        train(tiny_split(sketched=CASES[case].sketches > 0), destination / case, CASES[case])


# Kill -9. Processes are forked, so that not every one of them has to import torch and Fabric first.

LONGER = replace(RECOMMENDED, pretrain_epochs=8, adversarial_epochs=8, pose_epochs=3)


def start(split: Split, folder: Path) -> int:
    """Number of a process that trains in `folder`, going on where an earlier one was killed."""
    if child := os.fork():
        return child
    train(split, folder, LONGER, resume=True)
    os._exit(0)


def ended(child: int, *, wait: bool) -> bool:
    """Whether a process has ended by itself; SystemExit if it failed."""
    done, status = os.waitpid(child, 0 if wait else os.WNOHANG)
    if done and os.waitstatus_to_exitcode(status) != 0:
        sys.exit(f"the training failed: {status}")
    return done != 0


def killed(destination: Path, kills: int, seed: int) -> None:
    """An undisturbed run, and as many others as it takes to kill them `kills` times; all of them finished.

    The first kill comes while the pose network learns, the others at random. Where each came is printed as JSON.
    """
    torch.set_num_threads(1)
    import_module("lightning_fabric")
    split, rng = tiny_split(sketched=True), random.Random(seed)
    begin = time.monotonic()
    ended(start(split, destination / "undisturbed"), wait=True)
    longest = (time.monotonic() - begin) / 3
    run, moments = 0, []
    while len(moments) < kills:
        folder = destination / f"run{run}"
        child = start(split, folder)
        if not moments:
            while not (folder / "settings.json").exists():
                time.sleep(0.001)
        time.sleep(rng.uniform(0, longest) if moments else 0.1)
        if ended(child, wait=False):
            run += 1
            continue
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        moments.append([run, sorted(path.name for path in folder.glob("*"))])
    ended(start(split, destination / f"run{run}"), wait=True)
    print(json.dumps(moments))


if __name__ == "__main__":
    sys.modules["torchmetrics"] = None  # type: ignore[assignment]  # Fabric asks for its version by importing it: seconds
    if sys.argv[2] == "--kills":
        killed(Path(sys.argv[1]), int(sys.argv[3]), seed=1)
    else:
        main(Path(sys.argv[1]), sys.argv[2:])
