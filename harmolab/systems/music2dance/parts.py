"""Parts of Music2Dance that are trained by themselves: the foot constraint model and the attribute classifier.

Each is trained into a folder of its own inside the run of a dancer, RUN/feet and RUN/attributes, where the dancer finds
it.
"""

from dataclasses import replace
from typing import Any

from harmolab.files import PathLike
from harmolab.systems.music2dance import attributes
from harmolab.systems.music2dance.feet import FootModel, FootParams, check_velocity, train_feet
from harmolab.systems.music2dance.params import Music2DanceParams, Representation
from harmolab.systems.music2dance.sequences import load_sequences
from harmolab.systems.music2dance.system import PRESETS
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.network_system import Learner, changed, noticed_split, preset_settings
from harmolab.systems.training.weights import load_weights


class Feet(Learner):
    """The foot constraint model (`FootModel`), as a thing to train."""

    @classmethod
    def load(cls, folder: PathLike) -> FootModel:
        """The model in the folder of its run."""
        return load_weights(folder, FootModel)

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        representation: Representation = "positions",
        step: int = 2,
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """`train`, on the figures of the training side; its own keywords:

        representation : "positions" or "rotations", as the dancer's that it serves
        step, split_seed : as of `harmolab.systems.training.network_system.PresetSystem.learn`
        changes : other values for fields of `FootParams`, such as ``epochs`` and ``velocity_weight``
        """
        params = changed(FootParams(), changes)
        coding = replace(Music2DanceParams.recommended(), representation=representation)
        check_velocity(params, representation)
        sequences = load_sequences(data, coding, step=step, progress=options.progress)
        train_feet(noticed_split(sequences.units, split_seed, options.notice), sequences, options, params)


class Attributes(Learner):
    """The attribute classifier (`AttributeClassifier`), as a thing to train."""

    @classmethod
    def load(cls, folder: PathLike) -> attributes.AttributeClassifier:
        """The classifier in the folder of its run."""
        return load_weights(folder, attributes.AttributeClassifier)

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        preset: str = PRESETS[0],
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """`train`, on recorded songs, of which a fifth is tested on; the outcome is noticed, too. Its own keywords:

        preset : "recommended" or "paper", of `AttributeParams`
        split_seed : int, of the songs that are tested on
        changes : other values for fields of `AttributeParams`, such as ``epochs``
        """
        params, notice = preset_settings(attributes.AttributeParams, preset, PRESETS, changes), options.notice
        songs = attributes.load_songs(data, progress=options.progress)
        split = attributes.split_songs(songs.songs, seed=split_seed)
        for line in songs.notes:
            notice(f"left out: {line}")
        notice(f"songs: {len(split.train)} train, {len(split.test)} test; dances: {', '.join(songs.classes)}")
        attributes.train_attributes(songs.songs, songs.classes, split, options, params)
        test = read_about(options.out)["meta"]["test"]
        notice(
            f"test songs: {test['right']} of {test['songs']} dances are right; {test['majority']} would be by always "
            "naming the most frequent dance of the training songs"
        )
