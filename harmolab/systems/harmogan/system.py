"""HarmoGAN, the system of the harmony paper: a generator, and the movements that its dances start from."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch

from harmolab.files import PathLike
from harmolab.metrics.likeness import LikenessLimits
from harmolab.systems.choreographer.banks import REMARKS, STYLES, shipped_bank
from harmolab.systems.choreographer.generate import Choreographer, Choreography
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.harmogan.sketches import SKETCHES, sketched
from harmolab.systems.training.about import json_file, weights_stem
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import FeatureParams, audio_features, check_choice
from harmolab.systems.training.feet import grounded
from harmolab.systems.training.motion_code import coded, decode_motion, encode_motion, frames_at, root_path
from harmolab.systems.training.network_system import PRESETS, NetworkSystem, changed, noticed_split
from harmolab.systems.training.requests import DanceRequest, check_initial
from harmolab.systems.training.runs import PoseBank
from harmolab.systems.training.units import filled_beats, load_units, recording_folders
from harmolab.types import Audio, BeatTrack, FloatArray, Motion, SingleArray

LOSSES = ("recommended", "paper")
HOP = 6  # beats from one unit of a song to the next
LEAST_SHARE = 1e-6  # weight of a unit's corrections where it has none: another unit's decide


class HarmoGAN(NetworkSystem):
    """HarmoGAN, the system of the harmony paper: a trained network that dances to music.

    As recommended it corrects a *sketch*, the dance of a choreographer. In paper mode it goes on from a movement.
    Train one by `HarmoGAN.train` (keywords: `learn`), or read one by `HarmoGAN.load`. `generate` is that of all systems
    (`System`), with the keywords ``dance`` and ``plant_feet`` of `Choreographer`.

    Parameters
    ----------
    generator : Generator
        That knows its audio features.
    poses : PoseBank, optional
        Movements to start from in paper mode. Without them: the mean pose at rest, and the same dance for every seed.
    meta : JSON-able mapping
        About its training; kept with the weights.
    sketches : Choreographer, optional
        Of the dances that a bounded generator corrects.

    Examples
    --------
    >>> motion = HarmoGAN.load("run").generate(audio, seconds=20.0, seed=3)  # doctest: +SKIP
    """

    network = Generator

    def __init__(
        self, generator: Any, poses: PoseBank | None = None, meta: Mapping[str, Any] | None = None,
        sketches: Choreographer | None = None,
    ) -> None:  # fmt: skip
        super().__init__(generator, poses, meta)
        self.sketches = sketches

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances that it was trained on."""
        return super().dances if self.sketches is None else self.sketches.dances

    @property
    def limits(self) -> LikenessLimits | None:
        """Limits of likeness of the movement that it corrects; None in paper mode."""
        return None if self.sketches is None else self.sketches.limits

    @property
    def knows_bars(self) -> bool:
        """True unless it corrects movement that has no places in the bar."""
        return self.sketches is None or any(take.places.size for take in self.sketches.takes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences about the movement of a shipped bank that it corrects."""
        style = self.meta.get(SKETCHES)
        return (f"a network corrects {REMARKS[style]}",) if style in STYLES else ()

    def respond(self, request: DanceRequest) -> Motion:
        """The dance for a request; another seed has another sketch, or another movement to start from."""
        if self.sketches is None:
            return super().respond(request)
        return self.composed(request).motion

    def choreograph(self, audio: Audio, beats: BeatTrack | None = None, **options: Any) -> Choreography:
        """Dance to music, and say what the sketch of the dance is made of.

        Parameters, result and errors are those of `Choreographer.choreograph`. ValueError also in paper mode, where
        there is no sketch.
        """
        return self.composed(DanceRequest(audio, beats, **options))

    def composed(self, request: DanceRequest) -> Choreography:
        """`choreograph` for a request (`harmolab.systems.training.requests.DanceRequest`)."""
        if self.sketches is None:
            raise ValueError("this generator corrects no sketch: its dances are not made of recordings")
        request = replace(request, beats=request.track())
        sketch = self.sketches.composed(request)
        return replace(sketch, motion=corrected(self.generator, sketch.motion, request))

    def save(self, folder: PathLike) -> None:
        """Write weights, and what its dances start from, to a folder, which is made if there is none."""
        super().save(folder)
        if self.sketches is not None:
            self.sketches.save(Path(folder) / SKETCHES)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file; errors name the file."""
        system = super().load(folder)
        if system.generator.params.bounded:
            place, style = weights_stem(folder).parent / SKETCHES, system.meta.get(SKETCHES)
            if style not in STYLES and not json_file(weights_stem(place)).is_file():
                raise FileNotFoundError(f"{place}: no such movement to correct; copy it from the training's folder")
            system.sketches = shipped_bank(style) if style in STYLES else Choreographer.load(place)
        return system

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
        """Train on corpora; `train` calls it, and takes these keywords.

        `harmolab.systems.harmogan.train` says what is in the folder of a training.

        Parameters
        ----------
        preset : "small" or "paper"
            Sizes of the networks (`ModelParams`).
        params : "recommended" or "paper"
            Losses (`TrainParams`) and audio features (`FeatureParams`).
        step : int, beats
            From the start of one training unit to that of the next.
        split_seed : int
            Of the split into training, validation and test by motion group.
        pretrained : str or path, optional
            Folder of another run on the same data, whose pretraining is taken over.
        **changes
            Other values for fields of `TrainParams`, such as ``seed`` and ``harmony_weight``.
        """
        from harmolab.systems.harmogan.train import train_harmogan

        check_choice("preset", preset, PRESETS)
        check_choice("params", params, LOSSES)
        settings: TrainParams = changed(getattr(TrainParams, params)(), changes)
        units = load_units(data, getattr(FeatureParams, params)(), step=step, progress=options.progress)
        split, model = noticed_split(units, split_seed, step, options.notice), getattr(ModelParams, preset)()
        train = partial(train_harmogan, options=options, model=model, params=settings, pretrained=pretrained)
        if not settings.sketches:
            train(split)
            return
        of_songs = sketched(split, recording_folders(data)[0], settings, progress=options.progress)
        train(of_songs.split, choreographer=of_songs.choreographer, patterns=of_songs.patterns)


@torch.inference_mode()
def corrected(generator: Generator, sketch: Motion, request: DanceRequest) -> Motion:
    """A sketch of a dance with the generator's corrections, on the floor; ValueError for one of other joints.

    The corrections are computed at the generator's rate and applied at the sketch's.
    """
    check_initial(sketch, generator.skeleton, "the generator")
    raw = song_corrections(generator, coded(sketch, generator.fps), request)
    fine = encode_motion(sketch.positions, sketch.fps, sketch.skeleton)
    rows = frames_at(raw, np.arange(len(fine), dtype=np.float64) * generator.fps / sketch.fps)
    moved = generator.corrected(*(torch.from_numpy(each)[None].double() for each in (fine, rows))).motion[0]
    x, z, facing = root_path(sketch.positions, sketch.fps, sketch.skeleton)[0].tolist()
    positions = decode_motion(moved.numpy(), sketch.fps, sketch.skeleton, start=(x, z, facing))
    positions = grounded(positions, sketch.fps, sketch.skeleton, plant_feet=request.plant_feet)
    return Motion(positions, sketch.fps, sketch.skeleton)


def song_corrections(generator: Generator, code: SingleArray, request: DanceRequest) -> FloatArray:
    """The generator's corrections (T, C) of a whole dance (T, C), unit by unit.

    Units of eight beats begin every six; the first beat of each is thrown away, and the corrections, not the joints,
    are faded over the next: there are no seams.
    """
    features, fps, start = generator.audio_params, generator.fps, request.start
    track = request.track()
    music = audio_features(request.audio, track, start + np.arange(len(code)) / fps, features)
    times, _ = filled_beats(track, start, start + len(code) / fps, before=1)
    beats = np.round((times - start) * fps).astype(np.int64).clip(0, len(code))
    total, weights = np.zeros((len(code), generator.n_motion)), np.zeros((len(code), 1))
    for first in range(0, len(beats) - 1, HOP):
        edges = beats[first : first + features.unit_beats + 1]
        frames = np.arange(edges[0], edges[-1])
        if len(frames) > 1:
            inputs = (torch.from_numpy(each[frames]).float()[None] for each in (music, code))
            share = _share(np.interp(frames, edges, np.arange(len(edges))), features.unit_beats, is_first=first == 0)
            total[frames] += share * generator.corrections(*inputs)[0].double().numpy()
            weights[frames] += share
    return total / weights


def _share(beats: FloatArray, length: int, *, is_first: bool) -> FloatArray:
    """Weights (T, 1) of a unit's corrections at beat numbers (T,): none in its first beat, unless it is the first."""
    rise = 1.0 if is_first else np.clip(beats - 1, 0, 1)
    return (rise * np.clip(length - beats, 0, 1) + LEAST_SHARE)[:, None]
