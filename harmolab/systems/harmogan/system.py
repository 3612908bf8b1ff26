"""HarmoGAN, the system of the harmony paper: a generator, and the movements that its dances start from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Self

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.network_system import NetworkSystem, Notice, changed, check_choice, training_material
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams

PRESETS, LOSSES = ("small", "paper"), ("recommended", "paper")


class HarmoGAN(NetworkSystem):
    """A trained generator that dances; another movement to start from is all that another seed changes.

    Parameters
    ----------
    generator : Generator that knows its audio features
    poses : PoseBank, optional
        Movements to start from. Without: the mean pose at rest, which makes the same dance for every seed.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network = Generator

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        preset: str = "small",
        params: str = "recommended",
        step: int = 2,
        split_seed: int = 0,
        pretrained: PathLike | None = None,
        resume: bool = False,
        accelerator: str = "auto",
        report: Callable[[dict[str, Any], int], None] = lambda row, end: None,
        notice: Notice = lambda line: None,
        progress: Progress = silent,
        **changes: Any,
    ) -> Self:
        """HarmoGAN trained on corpora, in a folder of its own (`harmolab.systems.harmogan.train` says what is in it).

        Parameters
        ----------
        data : folders of recordings
        out : folder; new or empty unless `resume`
        preset : "small" or "paper", sizes of the networks
        params : "recommended" or "paper", losses and audio features
        step : int, beats between the starts of training units
        split_seed : int, of the split by motion group
        pretrained : folder of another run on the same data, whose pretraining is taken over
        resume : go on where the run in `out` stopped; start it when there is none
        accelerator : "auto", "cpu" or "cuda"
        report, notice : called after each epoch with its row and its phase's end; with a line about the units
        changes : other values for fields of `TrainParams`, such as ``seed`` and ``harmony_weight``

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few recordings.
        """
        from harmolab.systems.common.phases import make_fabric
        from harmolab.systems.harmogan.train import train_harmogan

        check_choice("preset", preset, PRESETS)
        check_choice("params", params, LOSSES)
        settings: TrainParams = changed(getattr(TrainParams, params)(), changes)
        features: FeatureParams = getattr(FeatureParams, params)()
        split = training_material(
            data, out, features, step=step, split_seed=split_seed, resume=resume, notice=notice, progress=progress
        )
        fabric = make_fabric(accelerator=accelerator)
        train_harmogan(
            split, out, model=getattr(ModelParams, preset)(), params=settings, resume=resume, pretrained=pretrained,
            fabric=fabric, report=report,
        )  # fmt: skip
        fabric.barrier()
        return cls.load(out)
