"""Music2Dance trained in the notebooks' settings: the paper's way, ours, and the baseline of either.

Trainings are kept in the cache folder and go on where they were cut off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.sequences import SequenceSet, load_sequences
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.systems.music2dance.train import train_music2dance
from harmolab.systems.training.splits import Split, split_units
from study.experiments.contests import Contest
from study.experiments.generation import UNIT_STEP, TrainedSystem, corpus_root, kept_run
from study.profile import RunProfile

_PAPER, _OURS = Music2DanceParams.paper(), Music2DanceParams.recommended()
CALM = 0.1  # temperature of the second version's code; Eq. 12 has 1
DANCER_SETTINGS: Mapping[str, Music2DanceParams] = {
    "paper": _PAPER,
    "paper, calm": replace(_PAPER, temperature=CALM),
    "paper, LSTM": replace(_PAPER, generator="lstm"),
    "paper, LSTM, calm": replace(_PAPER, generator="lstm", temperature=CALM),
    "recommended": _OURS,
}
DANCING = ("temperature", "draw_memory", "smoothing")  # settings that training does not use
QUICK: Mapping[str, Any] = {"residual": 8, "skip": 16, "groups": 1, "lstm": 16, "clusters": 6}
QUICK_EPOCHS: Mapping[str, Any] = {"first_epochs": 4, "second_epochs": 2}


# What the ablations leave out or change; each is trained for a part of the schedule, and so is the whole beside them.
ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "whole": {},
    "mel": {"song": replace(_PAPER.song, features="mel")},
    "no mapping": {"mapping": False},
    "no end effectors": {"end_effectors": False},
    "no clusters": {"clusters": 0},
    "no second phase": {"second_epochs": 0},
    "LSTM": {"generator": "lstm"},
}


def ablated(name: str, share: float = 0.1) -> Music2DanceParams:
    """The paper's settings less one part, a name of `ABLATIONS`, for a share of the schedule.

    They dance with a tenth of the predicted spread: in full it hides everything else.
    """
    epochs = {part: round(share * getattr(_PAPER, part)) for part in ("first_epochs", "second_epochs")}
    short = replace(_PAPER, **epochs, temperature=CALM)
    return replace(short, **ABLATIONS[name])


def trained_dancer(profile: RunProfile, corpus: str, settings: Music2DanceParams, seed: int) -> TrainedSystem:
    """The network of some settings and a seed, trained now unless it was before, on HarmoGAN's split."""
    settings = profiled(profile, replace(settings, seed=seed))
    # How a trained network dances is no matter of its training: one training serves all.
    params = replace(settings, **{name: getattr(_PAPER, name) for name in DANCING})
    split = dancer_split(profile, corpus)
    folder = kept_run(
        "music2dance", {"params": params, "split": split.to_dict()},
        lambda options: train_music2dance(split, coded_sequences(profile, corpus, params), options),
    )  # fmt: skip
    system = Music2Dance.load(folder)
    system.generator.params = settings
    return TrainedSystem(folder, system)


def ablated_dancers(contest: Contest, name: str) -> list[TrainedSystem]:
    """The trainings of an ablation, a name of `ABLATIONS`, as many as `RunProfile.n_dancers`."""
    count = min(contest.trainings, contest.profile.n_dancers)
    settings = ablated(name, contest.profile.ablation_share)
    return [trained_dancer(contest.profile, contest.corpus, settings, seed) for seed in range(1, count + 1)]


def profiled(profile: RunProfile, params: Music2DanceParams) -> Music2DanceParams:
    """Settings for a profile: a quick one trains a tiny network for a few epochs, from which nothing follows."""
    if profile.epochs is None:
        return params
    tiny = replace(params, **QUICK_EPOCHS, **(QUICK if profile.hidden else {}))
    return tiny if params.second_epochs else replace(tiny, second_epochs=0)


def coded_sequences(profile: RunProfile, corpus: str, params: Music2DanceParams) -> SequenceSet:
    """The recordings of a corpus as a training takes them; read once for all trainings that hear and see the same."""
    params = profiled(profile, params)
    read = {name: getattr(params, name) for name in ("song", "representation", "end_effectors", "fps", "window")}
    return replace(_read(profile, corpus, replace(_PAPER, **read)), params=params)


@cache
def dancer_split(profile: RunProfile, corpus: str) -> Split:
    """The split of HarmoGAN (`training_split`), from the one reading of the recordings that dancers are trained on."""
    return split_units(coded_sequences(profile, corpus, _PAPER).units, seed=profile.seed)


@cache
def _read(profile: RunProfile, corpus: str, params: Music2DanceParams) -> SequenceSet:
    return load_sequences([corpus_root(profile, corpus)], params, step=UNIT_STEP)
