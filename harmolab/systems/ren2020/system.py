"""Ren et al. 2020 as a system: a generator that makes a whole dance from music and noise in one pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, Self

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.network_system import NetworkSystem, Notice, check_choice, training_material
from harmolab.systems.ren2020.networks import RenGenerator
from harmolab.systems.ren2020.params import RenParams

PRESETS = ("small", "paper")


class Ren2020(NetworkSystem):
    """A trained generator that dances; another seed is other noise, and another movement to go on from.

    Parameters
    ----------
    generator : RenGenerator that knows its audio features
    poses : PoseBank, optional
        Movements to go on from. Without: the mean pose at rest.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network = RenGenerator

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        preset: str = "small",
        step: int = 2,
        split_seed: int = 0,
        resume: bool = False,
        accelerator: str = "auto",
        report: Callable[[dict[str, Any], int], None] = lambda row, end: None,
        notice: Notice = lambda line: None,
        progress: Progress = silent,
        **changes: Any,
    ) -> Self:
        """Ren et al.'s system trained on corpora, in a folder of its own (`harmolab.systems.ren2020.train` says what).

        Parameters
        ----------
        data : folders of recordings
        out : folder; new or empty unless `resume`
        preset : "small" or "paper", sizes of the networks
        step : int, beats between the starts of training units
        split_seed : int, of the split by motion group
        resume : go on where the run in `out` stopped; start it when there is none
        accelerator : "auto", "cpu" or "cuda"
        report, notice : called after each epoch with its row and its phase's end; with a line about the units
        changes : other values for fields of `RenParams`, such as ``seed`` and ``epochs``

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few recordings.
        """
        from harmolab.systems.common.phases import make_fabric
        from harmolab.systems.ren2020.train import train_ren2020

        check_choice("preset", preset, PRESETS)
        if other := sorted(changes.keys() - {field.name for field in fields(RenParams)}):
            raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
        settings: RenParams = replace(getattr(RenParams, preset)(), **changes)
        split = training_material(
            data, out, FeatureParams.paper(), step=step, split_seed=split_seed, resume=resume, notice=notice,
            progress=progress,
        )  # fmt: skip
        fabric = make_fabric(accelerator=accelerator)
        train_ren2020(split, out, params=settings, resume=resume, fabric=fabric, report=report)
        fabric.barrier()
        return cls.load(out)
