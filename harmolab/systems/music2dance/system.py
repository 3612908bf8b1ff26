"""Music2Dance as a system: a network that dances frame after frame, and movements that its dances go on from.

R12 is reading 12 of the paper in docs/readings_music2dance.md.
"""

import copy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self, TypeVar

import numpy as np

from harmolab.body.kinematics import resample_motion
from harmolab.files import PathLike, Progress, reading, silent
from harmolab.systems.music2dance.attributes import AttributeClassifier
from harmolab.systems.music2dance.codes import PositionCode, body_points, check_same_channels
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.generate import FEET, Danced, Feet, dance_positions, danced
from harmolab.systems.music2dance.music_features import blind_features
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.music2dance.params import PRESETS, Music2DanceParams
from harmolab.systems.music2dance.sequences import load_sequences, song_features
from harmolab.systems.training.about import DEFAULT_STEM, json_file, read_about, weights_stem
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import check_choice
from harmolab.systems.training.feet import foot_contacts
from harmolab.systems.training.network_system import NetworkSystem, noticed_split, preset_settings
from harmolab.systems.training.requests import DanceRequest, check_initial
from harmolab.systems.training.runs import PoseBank
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Audio, BeatTrack, FloatArray, Motion

ATTRIBUTES, FOOT_MODEL = "attributes", "feet"  # folders beside the weights, and systems that are trained
TRAIN = "train one: harmolab train DATA --system {0} --out RUN/{0}, where RUN is the folder of these weights"
SHORT_NAMES = MappingProxyType({"phase1": "first_epochs", "phase2": "second_epochs"})
Part = TypeVar("Part", AttributeClassifier, FootModel)


class Music2Dance(NetworkSystem):
    """Music2Dance (Zhuang et al. 2020): a trained network that dances frame after frame, each drawn by chance.

    Another seed draws another movement to go on from, and other frames. `train` and `load` are those of all systems
    (`System`).

    Parameters
    ----------
    generator : DanceNetwork
    poses : PoseBank, optional
        Movements to go on from, with foot contacts as their last two channels. Without them: the mean pose.
    meta : JSON-able mapping
        About its training; kept with the weights.
    attributes : AttributeClassifier, optional
        Says which dance a song calls for (`dance_probabilities`).
    feet : FootModel, optional
        Takes sliding out of dances (``feet="model"``).

    Raises
    ------
    ValueError
        If the foot model takes another motion code than the generator's.
    """

    network = DanceNetwork
    generator: DanceNetwork

    def __init__(
        self,
        generator: DanceNetwork,
        poses: PoseBank | None = None,
        meta: Mapping[str, Any] | None = None,
        *,
        attributes: AttributeClassifier | None = None,
        feet: FootModel | None = None,
    ) -> None:
        super().__init__(generator, poses, meta)
        if feet is not None:
            check_same_channels(feet.motion_code, generator.motion_code)
        self.attributes, self.feet = attributes, feet

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances that were danced in training."""
        return tuple(self.generator.dances)

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        feet: Feet = "planted",
        temperature: float | None = None,
        progress: Progress = silent,
        **options: Any,
    ) -> Motion:
        """Dance to music: a motion whose first frame stands at second `start` of the music.

        Parameters
        ----------
        audio, beats : as in `System.generate`
        feet : "planted", "model" or "none"
            "planted": feet that carry stand. "model": the foot model moves the legs (Sec. 4.5). "none": legs are left
            as they are. The dancer is put on the floor in any case.
        temperature : float from 0 to 4
            Share of the predicted spread that is drawn; that of the training's settings when left out.
        progress : function(iterable, label) -> iterable
            Reports on the frames, such as a progress bar.
        **options
            ``start``, ``seconds``, ``seed`` and ``initial`` as in `System.generate`. ``dance``: one that was not danced
            in training, or none, is danced as one that the seed draws. ``plant_feet=False`` is ``feet="none"``.

        Returns
        -------
        Motion

        Raises
        ------
        ValueError
            As `System.generate`; for an unknown dance, and for ``feet="model"`` without a foot model.
        """
        request = DanceRequest(audio, beats, progress=progress, **options)
        feet = self._feet(feet, plant_feet=request.plant_feet)
        code, network = self.dance_code(request, temperature=temperature), self.generator
        return Motion(dance_positions(network, code, feet, self.feet), network.params.fps, network.motion_code.skeleton)

    def dance_code(self, request: DanceRequest, *, temperature: float | None = None) -> Danced:
        """A dance as the network makes it, before feet and floor are seen to; `temperature` as of `generate`."""
        network = self.generator if temperature is None else drawn_with(self.generator, temperature=temperature)
        request.check_dance(network.dances)
        params, seed = network.params, request.seed
        frames = request.n_frames(params.fps)
        name = request.dance if request.dance in network.dances else network.dances[seed % len(network.dances)]
        prior = self._movement(name, seed) if request.initial is None else self.coded(request.initial)
        music = song_features(request.audio, request.track(), params.song, name)
        return danced(
            network, music, start=request.start, frames=frames, dance=network.dances.index(name), seed=seed,
            prior=prior, progress=request.progress,
        )  # fmt: skip

    def dance_probabilities(self, audio: Audio) -> dict[str, float]:
        """Probability of each dance for a song: which one does it call for (Sec. 4.3)?

        The beats are tracked without a range of tempi (R15).

        Returns
        -------
        dict: name of a dance -> its probability, the most likely first

        Raises
        ------
        ValueError
            If there is no attribute classifier, it gives no numbers, or the music is silent.
        """
        if self.attributes is None:
            raise ValueError(f"these weights have no attribute classifier to ask; {TRAIN.format(ATTRIBUTES)}")
        music = blind_features(audio, rate=self.attributes.params.rate)
        if not music.any():
            raise ValueError("this music is silent, so it sounds like no dance; name the dance")
        shares = self.attributes.probabilities(music)
        if not np.isfinite(shares).all():
            raise ValueError("the attribute classifier gives no finite probabilities; train it anew")
        return dict(sorted(zip(self.attributes.classes, shares.tolist(), strict=True), key=lambda pair: -pair[1]))

    def _feet(self, feet: Feet, *, plant_feet: bool) -> Feet:
        """The handling of the feet that both options say; ValueError where they contradict, or no model is there."""
        check_choice("feet", feet, FEET)
        if feet == "model" and not plant_feet:
            raise ValueError("feet='model' and plant_feet=False exclude each other; leave one of them out")
        if feet == "model" and self.feet is None:
            raise ValueError(f"these weights have no foot model; {TRAIN.format(FOOT_MODEL)}")
        return feet if plant_feet else "none"

    def _movement(self, dance: str, seed: int) -> FloatArray:
        """Motion and contacts (P, C + 2) that a dance goes on from, drawn by `seed`; without a bank the mean pose."""
        if self.poses is None:
            mean: FloatArray = self.generator.motion_scale.mean.cpu().double().numpy()
            return np.append(mean, [1.0, 1.0])[None]
        return self.poses.drawn(dance, seed)

    def coded(self, initial: Motion) -> FloatArray:
        """The code of a motion to go on from, with its foot contacts: (P, C + 2).

        ValueError for a motion of other joints, or in two dimensions.
        """
        code, params = self.generator.motion_code, self.generator.params
        places = isinstance(code, PositionCode)
        check_initial(initial, code.skeleton if places else initial.skeleton, "the network")
        if not places:
            try:
                initial = body_points(initial)
            except ValueError as error:
                raise ValueError(f"initial has {error}") from None
        motion = resample_motion(initial, params.fps)
        return np.column_stack([code.encode(motion), foot_contacts(motion.positions, motion.fps, motion.skeleton)])

    def save(self, folder: PathLike) -> None:
        """Write the system to a folder, and classifier and foot model, where it has them, to folders inside."""
        super().save(folder)
        for name, part in ((ATTRIBUTES, self.attributes), (FOOT_MODEL, self.feet)):
            if part is not None:
                save_weights(Path(folder) / name / DEFAULT_STEM, part, part.meta)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file, with the classifier and foot model beside it."""
        system, home = super().load(folder), weights_stem(folder).parent
        attributes = stored_part(home / ATTRIBUTES, AttributeClassifier)
        feet = stored_part(home / FOOT_MODEL, FootModel)
        if feet is not None:
            with reading(json_file(weights_stem(home / FOOT_MODEL)), "a foot model"):
                check_same_channels(feet.motion_code, system.generator.motion_code)
        return cls(system.generator, system.poses, system.meta, attributes=attributes, feet=feet)

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        preset: str = PRESETS[0],
        step: int = 2,
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """Train on corpora; `train` calls it, and takes these keywords.

        Parameters
        ----------
        preset : "recommended" or "paper"
            Of `Music2DanceParams`.
        step : int, beats
            From the start of one unit to that of the next.
        split_seed : int
            Of the split into training, validation and test by motion group.
        **changes
            Other values for fields of `Music2DanceParams`, such as ``seed``; ``phase1`` and ``phase2`` are other names
            of ``first_epochs`` and ``second_epochs``.
        """
        from harmolab.systems.music2dance.train import train_music2dance

        changes = {SHORT_NAMES.get(name, name): value for name, value in changes.items()}
        params = preset_settings(Music2DanceParams, preset, PRESETS, changes)
        sequences = load_sequences(data, params, step=step, progress=options.progress)
        train_music2dance(noticed_split(sequences.units, split_seed, step, options.notice), sequences, options)


def stored_part(folder: Path, network: type[Part]) -> Part | None:
    """The network in a folder, None where it holds no weights; ValueError or FileNotFoundError names the file."""
    stem = weights_stem(folder)
    if not folder.is_dir() or not any(stem.with_suffix(suffix).exists() for suffix in (".json", ".safetensors")):
        return None
    part = load_weights(folder, network)
    with reading(json_file(stem), "weights of harmolab"):
        part.meta = dict(read_about(folder).get("meta") or {})
    return part


def drawn_with(network: DanceNetwork, **settings: float) -> DanceNetwork:
    """The same network (and its weights) with another `temperature`, `draw_memory` or `smoothing` of its dances."""
    other = copy.copy(network)
    other.params = replace(network.params, **settings)  # type: ignore[arg-type]
    return other
