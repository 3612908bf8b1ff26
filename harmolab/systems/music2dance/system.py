"""Music2Dance as a system: a network that dances frame after frame, and movements that its dances go on from."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self, TypeVar

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.io.files import PathLike, Progress, reading, silent
from harmolab.kinematics import resample_motion
from harmolab.params import DANCES
from harmolab.systems.common.about import DEFAULT_STEM, json_file, read_about, weights_stem
from harmolab.systems.common.contacts import foot_contacts
from harmolab.systems.common.length import n_frames
from harmolab.systems.common.network_system import PresetSystem, check_choice
from harmolab.systems.common.poses_bank import PoseBank
from harmolab.systems.common.splits import Split
from harmolab.systems.common.weights import load_weights, save_weights
from harmolab.systems.music2dance.attributes import AttributeClassifier
from harmolab.systems.music2dance.codes import PositionCode, check_same_channels
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.generate import FEET, Danced, Feet, dance_positions, danced
from harmolab.systems.music2dance.music_features import blind_features
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.points import body_points
from harmolab.systems.music2dance.sequences import load_sequences, song_features
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion

ATTRIBUTES, FOOT_MODEL = "attributes", "feet"  # folders beside the weights, and systems that are trained
TRAIN = "train one: harmolab train DATA --system {0} --out RUN/{0}, where RUN is the folder of these weights"
Part = TypeVar("Part", AttributeClassifier, FootModel)


class Music2Dance(PresetSystem):
    """A trained network that dances; another seed draws another movement to go on from, and other chances.

    Parameters
    ----------
    generator : DanceNetwork
    poses : PoseBank, optional
        Movements to go on from, contacts as their last two channels. Without: the mean pose.
    meta : JSON-able mapping about its training, kept with the weights
    attributes : AttributeClassifier, optional
        It says which dance a song calls for.
    feet : FootModel, optional
        It takes sliding out of dances (``feet="model"``).

    Raises
    ------
    ValueError
        If the foot model takes another motion code than the generator's.
    """

    network, settings = DanceNetwork, Music2DanceParams
    presets = ("recommended", "paper")
    short_names = MappingProxyType({"phase1": "first_epochs", "phase2": "second_epochs"})

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
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str | None = None,
        plant_feet: bool = True,
        feet: Feet = "planted",
        temperature: float | None = None,
        progress: Progress = silent,
    ) -> Motion:
        """A dance to music (`harmolab.systems.System`).

        Parameters
        ----------
        dance : name of a dance; one that was not danced in training, or none, is danced as one that `seed` draws
        plant_feet : False is ``feet="none"``
        feet : "planted", "model" or "none"
            Feet that carry are kept from sliding by `planted_feet`, or by the foot model (Sec. 4.5), or not at all. The
            dancer is put on the floor in any case.
        temperature : share of the predicted spread that is drawn, 0 to 4; that of the training's settings when left out
        """
        feet = self._feet(feet, plant_feet=plant_feet)
        code = self.dance_code(
            audio, beats, start=start, seconds=seconds, seed=seed, initial=initial, dance=dance,
            temperature=temperature, progress=progress,
        )  # fmt: skip
        network: DanceNetwork = self.generator
        positions = dance_positions(network, code, feet, self.feet)
        return Motion(positions, network.params.fps, network.motion_code.skeleton)

    def dance_code(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str | None = None,
        temperature: float | None = None,
        progress: Progress = silent,
    ) -> Danced:
        """A dance as the network makes it, before the feet and the floor; parameters as of `generate`."""
        network: DanceNetwork = (
            self.generator if temperature is None else drawn_with(self.generator, temperature=temperature)
        )
        if dance and dance not in {*DANCES, *network.dances}:
            raise ValueError(f"unknown dance {dance!r}; known: {', '.join(sorted({*DANCES, *network.dances} - {''}))}")
        params = network.params
        frames = n_frames(audio, start, seconds, params.fps)
        name = dance if dance in network.dances else network.dances[seed % len(network.dances)]
        prior = self._movement(name, seed) if initial is None else self.coded(initial)
        track = music_beats(Clip("", audio, beats=beats, dance=dance or ""))
        return danced(
            network, song_features(audio, track, params.song, name), start=start, frames=frames,
            dance=network.dances.index(name), seed=seed, prior=prior, progress=progress,
        )  # fmt: skip

    def dance_probabilities(self, audio: Audio) -> dict[str, float]:
        """Dance -> its probability, the most likely first, of a song (Sec. 4.3); heard without a prior of tempo (R15).

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
        pairs = zip(self.attributes.classes, shares.tolist(), strict=True)
        return dict(sorted(pairs, key=lambda pair: -pair[1]))

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
        clips = self.poses.of(dance)
        return clips[np.random.default_rng(0).permutation(len(clips))[seed % len(clips)]]

    def coded(self, initial: Motion) -> FloatArray:
        """Motion and contacts of a motion to go on from; ValueError for one of other joints, or in two dimensions."""
        code, params = self.generator.motion_code, self.generator.params
        if (axes := initial.positions.shape[2]) != 3:
            raise ValueError(f"initial must be a motion in three dimensions, got {axes}")
        if not isinstance(code, PositionCode):
            try:
                initial = body_points(initial)
            except ValueError as error:
                raise ValueError(f"initial has {error}") from None
        elif initial.skeleton.joints != code.skeleton.joints:
            joints = len(initial.skeleton.joints), len(code.skeleton.joints)
            raise ValueError(
                f"initial has other joints ({joints[0]}) than the network ({joints[1]}); retarget it first"
            )
        motion = resample_motion(initial, params.fps)
        contacts = foot_contacts(motion.positions, motion.fps, motion.skeleton)
        return np.column_stack([code.encode(motion), contacts])

    def save(self, folder: PathLike) -> None:
        """As all systems do; classifier and foot model, where there are any, to folders in it."""
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
    def material(cls, data: Sequence[PathLike], params: Music2DanceParams, progress: Progress) -> dict[str, Any]:
        """The recordings as a whole: windows are longer than units."""
        return {"sequences": load_sequences(list(data), params, progress=progress)}

    @classmethod
    def train_network(cls, split: Split, folder: PathLike, **options: Any) -> None:
        """`harmolab.systems.music2dance.train.train_music2dance`, which says what is in the folder."""
        from harmolab.systems.music2dance.train import train_music2dance

        del options["params"]  # `sequences` were read by them, and hold them
        train_music2dance(split, folder=folder, **options)


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
