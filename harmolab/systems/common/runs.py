"""The folder of a training, as every system of one network has it: opened, its bank of movements, its weights."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from lightning_fabric import Fabric
from torch import nn

from harmolab.systems.common.about import DEFAULT_STEM
from harmolab.systems.common.checkpoints import Sides, open_folder
from harmolab.systems.common.poses_bank import pose_bank, poses_path, save_poses
from harmolab.systems.common.splits import Split
from harmolab.systems.common.weights import save_weights

MODEL = DEFAULT_STEM


@contextmanager
def locked_run(fabric: Fabric, split: Sides, folder: Path, settings: dict[str, Any], *, resume: bool) -> Iterator[bool]:
    """Lock the folder of a run, with its settings and split, by the first process; True for that one.

    Raises
    ------
    ValueError
        As `harmolab.systems.common.checkpoints.open_folder`.
    """
    first = fabric.is_global_zero
    with open_folder(folder, settings, split, resume=resume) if first else nullcontext():
        fabric.barrier()
        yield first


@contextmanager
def open_run(
    fabric: Fabric, split: Split, folder: Path, settings: dict[str, Any], *, seed: int, resume: bool
) -> Iterator[None]:
    """Lock the folder of a run, with its settings and split, and the movements that its dances may start from.

    Raises
    ------
    ValueError
        As `harmolab.systems.common.checkpoints.open_folder`.
    """
    with locked_run(fabric, split, folder, settings, resume=resume) as first:
        if first and not poses_path(folder / MODEL).is_file():
            save_poses(folder / MODEL, pose_bank(split.train, seed=seed))
        fabric.barrier()
        yield


def finish_run(fabric: Fabric, split: Split, folder: Path, settings: dict[str, Any], network: nn.Module) -> None:
    """Write the trained network to the folder, with what it was trained on."""
    if fabric.is_global_zero:
        about = {"settings": settings, "source": split.train.source, "units": len(split.train)}
        save_weights(folder / MODEL, network, about)
