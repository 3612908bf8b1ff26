"""HarmoGAN, the system of the harmony paper: a generator, and the movements that its dances start from."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.about import DEFAULT_STEM, read_about
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.poses_bank import PoseBank, load_poses, poses_path, save_poses
from harmolab.systems.common.splits import split_units
from harmolab.systems.common.unit_corpus import load_units
from harmolab.systems.common.weights import save_weights
from harmolab.systems.harmogan.generate import synthesize_dance
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.types import Audio, BeatTrack, Motion

PRESETS, LOSSES = ("small", "paper"), ("recommended", "paper")


class HarmoGAN:
    """A trained generator that dances.

    Parameters
    ----------
    generator : Generator that knows its audio features
    poses : PoseBank, optional
        Movements to start from. Without: the mean pose at rest, which makes the same dance for every seed.
    meta : JSON-able mapping about its training, kept with the weights
    """

    def __init__(
        self, generator: Generator, poses: PoseBank | None = None, meta: Mapping[str, Any] | None = None
    ) -> None:
        self.generator, self.poses, self.meta = generator, poses, dict(meta or {})

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str | None = None,
        plant_feet: bool = True,
        progress: Progress = silent,
    ) -> Motion:
        """A dance to music (`harmolab.systems.System`); `dance` and `plant_feet` as in `synthesize_dance`.

        The only thing that `seed` draws is the movement to start from; it draws nothing where `initial` is given.
        """
        return synthesize_dance(
            self.generator, audio, beats=beats, start=start, seconds=seconds, seed=seed, poses=self.poses,
            initial=initial, dance=dance, plant_feet=plant_feet, progress=progress,
        )  # fmt: skip

    def save(self, folder: PathLike) -> None:
        """Write weights, and poses if there are any, to a folder; it is made unless it exists."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        save_weights(Path(folder) / DEFAULT_STEM, self.generator, self.meta)
        if self.poses is not None:
            save_poses(Path(folder) / DEFAULT_STEM, self.poses)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file; errors name the file."""
        generator = load_generator(folder)
        poses = load_poses(folder, n_channels=generator.n_motion) if poses_path(folder).is_file() else None
        return cls(generator, poses, read_about(folder)["meta"])

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
        notice: Callable[[str], None] = lambda line: None,
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
        from harmolab.systems.common.checkpoints import check_folder
        from harmolab.systems.common.phases import make_fabric
        from harmolab.systems.harmogan.train import train_harmogan

        for name, value, choices in (("preset", preset, PRESETS), ("params", params, LOSSES)):
            if value not in choices:
                raise ValueError(f"{name} must be {' or '.join(choices)}, got {value!r}")
        settings: TrainParams = replace(getattr(TrainParams, params)(), **changes)
        if int(os.environ.get("RANK", 0)) == 0:
            check_folder(Path(out), resume=resume)  # before the recordings are read, which takes minutes
        features: FeatureParams = getattr(FeatureParams, params)()
        units = load_units([Path(root) for root in data], features, step=step, progress=progress)
        split = split_units(units, seed=split_seed)
        for line in units.notes:
            notice(f"left out: {line}")
        counts = ", ".join(f"{len(getattr(split, side))} {side}" for side in ("train", "validation", "test"))
        notice(f"units: {counts}; data: {split.train.source}")
        fabric = make_fabric(accelerator=accelerator)
        train_harmogan(
            split, out, model=getattr(ModelParams, preset)(), params=settings, resume=resume, pretrained=pretrained,
            fabric=fabric, report=report,
        )  # fmt: skip
        fabric.barrier()
        return cls.load(out)
