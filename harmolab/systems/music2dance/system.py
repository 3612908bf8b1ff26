"""Music2Dance as a system: a network that dances frame after frame, and movements that its dances go on from."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.io.files import PathLike, Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.params import DANCES
from harmolab.systems.common.contacts import foot_contacts
from harmolab.systems.common.grounding import grounded
from harmolab.systems.common.length import n_frames
from harmolab.systems.common.network_system import PresetSystem
from harmolab.systems.common.splits import Split
from harmolab.systems.music2dance.codes import PositionCode
from harmolab.systems.music2dance.generate import danced
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.points import body_points
from harmolab.systems.music2dance.sequences import load_sequences, song_features
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion


class Music2Dance(PresetSystem):
    """A trained network that dances; another seed draws another movement to go on from, and other chances.

    Parameters
    ----------
    generator : DanceNetwork
    poses : PoseBank, optional
        Movements to go on from, contacts as their last two channels. Without: the mean pose.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network, settings = DanceNetwork, Music2DanceParams
    presets = ("recommended", "paper")
    short_names = MappingProxyType({"phase1": "first_epochs", "phase2": "second_epochs"})

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
        temperature: float | None = None,
        progress: Progress = silent,
    ) -> Motion:
        """A dance to music (`harmolab.systems.System`).

        Parameters
        ----------
        dance : name of a dance; one that was not danced in training, or none, is danced as one that `seed` draws
        plant_feet : keep feet that carry from sliding
        temperature : share of the predicted spread that is drawn; that of the training's settings when left out
        """
        network: DanceNetwork = self.generator if temperature is None else with_temperature(self.generator, temperature)
        if dance and dance not in {*DANCES, *network.dances}:
            raise ValueError(f"unknown dance {dance!r}; known: {', '.join(sorted({*DANCES, *network.dances} - {''}))}")
        params = network.params
        frames = n_frames(audio, start, seconds, params.fps)
        name = dance if dance in network.dances else network.dances[seed % len(network.dances)]
        prior = self._movement(name, seed) if initial is None else self._coded(initial)
        track = music_beats(Clip("", audio, beats=beats, dance=dance or ""))
        dance_code = danced(
            network, song_features(audio, track, params.song, name), start=start, frames=frames,
            dance=network.dances.index(name), seed=seed, prior=prior, progress=progress,
        )  # fmt: skip
        code = network.motion_code
        positions = grounded(code.decode(dance_code.code, params.fps), params.fps, code.skeleton, plant_feet=plant_feet)
        return Motion(positions, params.fps, code.skeleton)

    def _movement(self, dance: str, seed: int) -> FloatArray:
        """Motion and contacts (P, C + 2) that a dance goes on from, drawn by `seed`; without a bank the mean pose."""
        if self.poses is None:
            mean: FloatArray = self.generator.motion_scale.mean.cpu().double().numpy()
            return np.append(mean, [1.0, 1.0])[None]
        clips = self.poses.of(dance)
        return clips[np.random.default_rng(0).permutation(len(clips))[seed % len(clips)]]

    def _coded(self, initial: Motion) -> FloatArray:
        """Motion and contacts of a motion to go on from; ValueError for one of other joints."""
        code, params = self.generator.motion_code, self.generator.params
        if isinstance(code, PositionCode) and initial.skeleton.joints != code.skeleton.joints:
            joints = len(initial.skeleton.joints), len(code.skeleton.joints)
            raise ValueError(
                f"initial has other joints ({joints[0]}) than the network ({joints[1]}); retarget it first"
            )
        motion = resample_motion(initial if isinstance(code, PositionCode) else body_points(initial), params.fps)
        contacts = foot_contacts(motion.positions, motion.fps, motion.skeleton)
        return np.column_stack([code.encode(motion), contacts])

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


def with_temperature(network: DanceNetwork, temperature: float) -> DanceNetwork:
    """The same network (and its weights) that draws another share of the predicted spread."""
    other = copy.copy(network)
    other.params = replace(network.params, temperature=temperature)
    return other
