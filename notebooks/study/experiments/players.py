"""Pianists and violinists to train on, planted or recorded, and the network of some settings trained on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.musician.cleaning import Cleaned, cleaned
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance, split_by_piece
from harmolab.musician.players import rendered_notes
from harmolab.musician.sequences import PlayedSet, PlayedSplit, cleaning_rules, played_set
from harmolab.musician.synthetic import PlantedPerformance, planted_performances
from harmolab.musician.system import Audio2Body
from harmolab.musician.train import Errors, train_audio2body
from harmolab.readers.player_points import INSTRUMENTS, SIDES, hand_joints
from study.experiments.generation import TrainedSystem, kept_run
from study.experiments.instrument_sets import load_pianomime, load_tracked
from study.experiments.study import data_root
from study.profile import RunProfile

PLANTED, HANDS = "planted", "real hands, rendered sound"
PIECES, QUICK_PIECES = (36, 9, 30.0), (6, 2, 12.0)  # planted ones to train and to test on, and their length
EPOCHS = 30  # the paper has 300
QUICK: Mapping[str, Any] = MappingProxyType({"epochs": 2, "hidden": 32, "batch": 25})
TEST_SHARE, HELD_OUT = 0.2, 1 / 6  # of the hands; of the training pieces, where whole ones are validated on
HAND_CLIPS = 120  # real hands that are trained and tested on, at most
# The settings of a reading.
READING = ("fps", "hears", "mfcc", "mels", "energy_delta", "tones", "reject", "gaps", "alignment")
PLAYER_SEEDS, QUICK_PLAYER_SEEDS = 2, 1
PLANTED_DELAY = 0.0625  # seconds, by the error on validation pieces of planted players
PARTS = ("body", "left hand", "right hand")


@dataclass(frozen=True, eq=False)
class PlayerData:
    """Performances of one instrument, split by piece.

    Parameters
    ----------
    label : `PLANTED` or `HANDS`: stands in every picture
    instrument : str
    performances : tuple of Performance
    split : PlayedSplit, of their names
    planted : name -> the truth about a planted performance
    """

    label: str
    instrument: str
    performances: tuple[Performance, ...]
    split: PlayedSplit
    planted: Mapping[str, PlantedPerformance]

    @property
    def test(self) -> tuple[Performance, ...]:
        """The performances of the test side."""
        return tuple(each for each in self.performances if each.name in self.split.test)

    def sides(self, params: Audio2BodyParams) -> PlayedSplit:
        """The split for some settings: where windows are validated on, the validation pieces are trained on, too."""
        if params.validation == "pieces":
            return self.split
        return PlayedSplit((*self.split.train, *self.split.validation), (), self.split.test)

    @property
    def fps(self) -> float:
        """Frame rate of the points."""
        return self.performances[0].motion.fps

    @property
    def source(self) -> str:
        """The data as pictures name them."""
        return "synthetic" if self.label == PLANTED else self.label

    @property
    def title(self) -> str:
        """Label, and the instrument of planted players, for titles."""
        return f"{PLANTED} {self.instrument}" if self.label == PLANTED else self.label

    @property
    def stem(self) -> str:
        """Word for the names of its files."""
        return self.instrument if self.label == PLANTED else "hands"

    @property
    def unit(self) -> str:
        """Unit of the points once they are placed."""
        return "pixels" if self.label == PLANTED else "millimetres"


@cache
def planted_data(profile: RunProfile, instrument: str) -> PlayerData:
    """Planted pieces of an instrument: 36 of 30 s to train on and 9 to test on; few short ones in a quick profile."""
    trained_on, tested_on, seconds = PIECES if profile.epochs is None else QUICK_PIECES
    planted = {each.performance.name: each
               for each in planted_performances(instrument, trained_on + tested_on, seconds=seconds)}  # fmt: skip
    names, last = tuple(planted), trained_on - max(1, round(HELD_OUT * trained_on))
    split = PlayedSplit(names[:last], names[last:trained_on], names[trained_on:])
    performances = tuple(each.performance for each in planted.values())
    return PlayerData(PLANTED, instrument, performances, split, MappingProxyType(planted))


@cache
def hands_data(profile: RunProfile) -> PlayerData | None:
    """Real pianists' hands with the sound of their notes, rendered; None without recordings and in a quick profile.

    Performances that share a quarter of their note patterns are on one side.
    """
    root = data_root()
    if profile.epochs is not None or root is None or not (folder := root / "instruments" / "pianomime").is_dir():
        return None
    clips = load_pianomime(folder)
    rows = np.random.default_rng(profile.seed).permutation(len(clips))[:HAND_CLIPS]
    clips = [with_rendered_sound(clips[row]) for row in sorted(rows.tolist())]
    parts = split_by_piece(clips, test_share=TEST_SHARE, validation_share=HELD_OUT, seed=profile.seed)
    return PlayerData(HANDS, "piano", tuple(clips), PlayedSplit.of(parts), MappingProxyType({}))


def with_rendered_sound(performance: Performance) -> Performance:
    """A performance with the sound of its notes on a synthetic instrument; ValueError where its notes are not known."""
    if performance.notes is None:
        raise ValueError(f"{performance.name}: its notes are not known, and no sound can be rendered from them")
    seconds = performance.offset + performance.motion.duration
    audio = rendered_notes(performance.notes, seconds, instrument=performance.instrument)
    return replace(performance, audio=audio, rendered=True)


def player_corpora(profile: RunProfile) -> tuple[PlayerData, ...]:
    """All data that players are trained on: both planted instruments, and real hands where they are."""
    data = (*(planted_data(profile, instrument) for instrument in INSTRUMENTS), hands_data(profile))
    return tuple(own for own in data if own is not None)


class TrainedPlayer(TrainedSystem):
    """One finished training of an `Audio2Body`."""

    @property
    def errors(self) -> dict[str, Errors]:
        """Its errors by side."""
        return {side: Errors(**values) for side, values in self.system.meta["errors"].items()}


def trained_player(
    profile: RunProfile, data: PlayerData, settings: Audio2BodyParams, seed: int, *, epochs: int | None = None
) -> TrainedPlayer:
    """The network of some settings and a seed, trained now unless it was before; for `epochs` where given.

    Of fewer epochs it is the network that a longer training of the same seed passes through, the best so far.
    """
    params = player_params(profile, data, replace(settings, seed=seed))
    params = params if epochs is None else replace(params, epochs=epochs)
    split = data.sides(params)
    length = sum(each.motion.n_frames for each in data.performances)
    about = {"params": params, "data": (data.label, data.instrument, length), "split": split.to_dict()}
    folder = kept_run("audio2body", about, lambda options: train_audio2body(read_set(data, params), split, options))
    return TrainedPlayer(folder, Audio2Body.load(folder))


def n_player_seeds(profile: RunProfile) -> int:
    """Trainings of each setting."""
    return PLAYER_SEEDS if profile.epochs is None else QUICK_PLAYER_SEEDS


def our_settings(data: PlayerData) -> Audio2BodyParams:
    """The recommended settings; with `PLANTED_DELAY` for planted players, whose hands lead their notes by less."""
    ours = Audio2BodyParams.recommended(data.instrument)
    return replace(ours, delay=PLANTED_DELAY) if data.label == PLANTED else ours


def player_params(profile: RunProfile, data: PlayerData, settings: Audio2BodyParams) -> Audio2BodyParams:
    """Settings at the data's frame rate, for so many epochs; a quick profile trains a small network for two of them."""
    params = replace(settings, fps=data.fps, epochs=EPOCHS)
    return replace(params, **QUICK) if profile.epochs is not None else params


def read_set(data: PlayerData, params: Audio2BodyParams) -> PlayedSet:
    """The performances as a training takes them; read once for all trainings that read the same."""
    read = {name: getattr(params, name) for name in READING}
    return replace(_read(data, replace(Audio2BodyParams(), **read)), params=params)


@cache
def _read(data: PlayerData, params: Audio2BodyParams) -> PlayedSet:
    return played_set(data.performances, params, data.split)


def part_of(joint: str) -> str:
    """The part, one of `PARTS`, that a point belongs to; wrists of the body move with their hands."""
    return next((f"{side} hand" for side in SIDES if joint in (*hand_joints(side), f"{side}_wrist")), "body")


def cleaned_performance(performance: Performance) -> Cleaned:
    """A performance cleaned as it is for a training."""
    return cleaned(performance, cleaning_rules(performance))


def tracked_players() -> tuple[Performance, ...]:
    """Tracked videos of musicians below ``HARMOLAB_DATA``, by name; none without recordings."""
    root = data_root()
    paths = [] if root is None else sorted((root / "instruments" / "tracked").glob("*.npz"))
    return tuple(load_tracked(path) for path in paths)
