"""Lee et al. 2019 as a system: trained networks, and the movements that their dances start from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, Self

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.network_system import NetworkSystem, Notice, check_choice, training_material
from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.lee2019.params import LeeParams

PRESETS = ("small", "paper")


class Lee2019(NetworkSystem):
    """The rival "Dancing to Music": dances composed of learnt four-beat units, warped to the music's beats.

    Ours, written from facts about the public code and trained on our units; not the authors' model.

    Parameters
    ----------
    generator : DancingToMusic
    poses : PoseBank, optional
        Movements to start from. Without: the mean pose at rest.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network = DancingToMusic

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
        """The system trained on corpora, in a folder of its own (`harmolab.systems.lee2019.train`).

        Parameters
        ----------
        data : folders of recordings
        out : folder; new or empty unless `resume`
        preset : "small" or "paper" (`LeeParams`)
        step : int, beats between the starts of training units
        split_seed : int, of the split by motion group
        resume : go on where the run in `out` stopped; start it when there is none
        accelerator : "auto", "cpu" or "cuda"
        report, notice : called after each epoch with its row and its phase's end; with a line about the units
        changes : other values for fields of `LeeParams`, such as ``seed``

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few recordings.
        """
        from harmolab.systems.common.phases import make_fabric
        from harmolab.systems.lee2019.train import train_lee2019

        check_choice("preset", preset, PRESETS)
        if other := sorted(changes.keys() - {field.name for field in fields(LeeParams)}):
            raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
        settings: LeeParams = replace(getattr(LeeParams, preset)(), **changes)
        split = training_material(
            data, out, FeatureParams.paper(),
            step=step, split_seed=split_seed, resume=resume, notice=notice, progress=progress,
        )  # fmt: skip
        fabric = make_fabric(accelerator=accelerator)
        train_lee2019(split, out, params=settings, resume=resume, fabric=fabric, report=report)
        fabric.barrier()
        return cls.load(out)
