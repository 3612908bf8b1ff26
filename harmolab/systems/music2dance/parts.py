"""Parts of Music2Dance that are trained by themselves: the foot constraint model and the attribute classifier.

Each is trained into a folder of its own inside the run of a dancer, RUN/feet and RUN/attributes, where the dancer finds
it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.about import read_about
from harmolab.systems.common.checkpoints import check_folder
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.history import Report
from harmolab.systems.common.network_system import Notice, changed, check_choice, training_material
from harmolab.systems.common.phases import make_fabric
from harmolab.systems.music2dance.attributes import AttributeClassifier, AttributeParams, train_attributes
from harmolab.systems.music2dance.feet import FootModel, FootParams, check_velocity, train_feet
from harmolab.systems.music2dance.params import Music2DanceParams, Representation
from harmolab.systems.music2dance.sequences import load_sequences
from harmolab.systems.music2dance.songs import load_songs, split_songs

PRESETS = ("recommended", "paper")


class Feet:
    """The foot constraint model (`FootModel`), as a thing to train."""

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        representation: Representation = "positions",
        step: int = 2,
        split_seed: int = 0,
        resume: bool = False,
        accelerator: str = "auto",
        report: Report = lambda row, end: None,
        notice: Notice = lambda line: None,
        progress: Progress = silent,
        **changes: Any,
    ) -> FootModel:
        """The model trained on the figures of the training side, in a folder of its own.

        Parameters
        ----------
        representation : "positions" or "rotations", as the dancer's that it serves
        data, out, step, split_seed, resume, accelerator, report, notice, progress
            As in `harmolab.systems.common.network_system.PresetSystem.train`.
        changes : other values for fields of `FootParams`, such as ``epochs`` and ``velocity_weight``

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few recordings.
        """
        params = changed(FootParams(), changes)
        coding = replace(Music2DanceParams.recommended(), representation=representation)
        check_velocity(params, representation)
        split = training_material(
            data, out, FeatureParams.paper(), step=step, split_seed=split_seed, resume=resume, notice=notice,
            progress=progress,
        )  # fmt: skip
        sequences = load_sequences(data, coding, progress=progress)
        fabric = make_fabric(accelerator=accelerator)
        model = train_feet(split, sequences, out, params, resume=resume, fabric=fabric, report=report)
        fabric.barrier()
        return model


class Attributes:
    """The attribute classifier (`AttributeClassifier`), as a thing to train."""

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        preset: str = "recommended",
        split_seed: int = 0,
        resume: bool = False,
        accelerator: str = "auto",
        report: Report = lambda row, end: None,
        notice: Notice = lambda line: None,
        progress: Progress = silent,
        **changes: Any,
    ) -> AttributeClassifier:
        """The classifier of the dances of recorded songs, of which a fifth is tested on, in a folder of its own.

        Parameters
        ----------
        preset : "recommended" or "paper", of `AttributeParams`
        split_seed : int, of the songs that are tested on
        data, out, resume, accelerator, report, notice, progress
            As in `harmolab.systems.common.network_system.PresetSystem.train`; `notice` is told the outcome, too.
        changes : other values for fields of `AttributeParams`, such as ``epochs``

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few songs.
        """
        check_choice("preset", preset, PRESETS)
        params = changed(getattr(AttributeParams, preset)(), changes)
        if int(os.environ.get("RANK", 0)) == 0:
            check_folder(Path(out), resume=resume)
        songs = load_songs(data, progress=progress)
        split = split_songs(songs.songs, seed=split_seed)
        for line in songs.notes:
            notice(f"left out: {line}")
        notice(f"songs: {len(split.train)} train, {len(split.test)} test; dances: {', '.join(songs.classes)}")
        fabric = make_fabric(accelerator=accelerator)
        classifier = train_attributes(
            songs.songs, songs.classes, split, out, params, resume=resume, fabric=fabric, report=report
        )
        fabric.barrier()
        test = read_about(out)["meta"]["test"]
        notice(
            f"test songs: {test['right']} of {test['songs']} dances are right; {test['majority']} would be by always "
            "naming the most frequent dance of the training songs"
        )
        return classifier
