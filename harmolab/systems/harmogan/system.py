"""HarmoGAN, the system of the harmony paper: a generator, and the movements that its dances start from."""

from typing import Any

from harmolab.files import PathLike
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import FeatureParams, check_choice
from harmolab.systems.training.network_system import PRESETS, NetworkSystem, changed, noticed_split
from harmolab.systems.training.units import load_units

LOSSES = ("recommended", "paper")


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
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        preset: str = "small",
        params: str = "recommended",
        step: int = 2,
        split_seed: int = 0,
        pretrained: PathLike | None = None,
        **changes: Any,
    ) -> None:
        """`train` (`harmolab.systems.harmogan.train` says what is in the folder); its own keywords:

        preset : "small" or "paper", sizes of the networks
        params : "recommended" or "paper", losses and audio features
        step : int, beats between the starts of training units
        split_seed : int, of the split by motion group
        pretrained : folder of another run on the same data, whose pretraining is taken over
        changes : other values for fields of `TrainParams`, such as ``seed`` and ``harmony_weight``
        """
        from harmolab.systems.harmogan.train import train_harmogan

        check_choice("preset", preset, PRESETS)
        check_choice("params", params, LOSSES)
        settings: TrainParams = changed(getattr(TrainParams, params)(), changes)
        units = load_units(data, getattr(FeatureParams, params)(), step=step, progress=options.progress)
        split = noticed_split(units, split_seed, options.notice)
        train_harmogan(split, options, model=getattr(ModelParams, preset)(), params=settings, pretrained=pretrained)
