"""Music2Dance with one part less (Figs. 8, 9, 11): hands over time, places of the end effectors, losses, measures.

Every ablation is the paper's settings with one difference, for a part of the schedule, with the same seeds and windows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.kinematics import smooth_positions
from harmolab.files import Progress, silent
from harmolab.significance import mean_interval
from harmolab.systems.music2dance.codes import RotationCode
from harmolab.systems.training.requests import DanceRequest
from harmolab.types import FloatArray, Motion
from study.experiments.contests import Contest
from study.experiments.minutes import (
    MINUTE,
    common_points,
    dance_seconds,
    measures,
    n_draws,
    recorded_dancers,
    unheard_song,
)
from study.experiments.music2dance import ABLATIONS, TrainedDancer, ablated, trained_dancer

HANDS = ("hand L", "hand R")
HAND_SECONDS, HAND_SEEDS = 8.0, 20
SMOOTHING = 0.1  # seconds, of Fig. 8 (R43)
FIRST_SONG = 700
MEASURED = ("pose variance", "pose speed", "jerk", "still")


def ablated_dancers(contest: Contest, name: str) -> list[TrainedDancer]:
    """The trainings of an ablation, a name of `music2dance.ABLATIONS`, as many as `RunProfile.n_dancers`."""
    count = min(contest.trainings, contest.profile.n_dancers)
    return [
        trained_dancer(contest.profile, contest.corpus, ablated(name), training) for training in range(1, count + 1)
    ]


def danced(run: TrainedDancer, dance: str, number: int, seconds: float) -> Motion:
    """A dance to an unheard song as the network makes it: feet are not planted."""
    song = unheard_song(dance, FIRST_SONG + number, seconds)
    return run.system.generate(song.clip.audio, song.beats, seed=number, dance=dance, plant_feet=False)


@dataclass(frozen=True, eq=False)
class HandHeights:
    """Heights of both hands above the floor, metres: raw and smoothed (S, T, 2), S dances, at times (T,)."""

    times: FloatArray
    raw: FloatArray
    smoothed: FloatArray


def hand_heights(contest: Contest, name: str, dance: str, *, count: int = HAND_SEEDS) -> HandHeights:
    """Fig. 8: hands in dances to one song by an ablation's trainings in turn, another seed each."""
    runs = ablated_dancers(contest, name)
    song = unheard_song(dance, FIRST_SONG, HAND_SECONDS)
    motions = [
        common_points(
            runs[seed % len(runs)].system.generate(
                song.clip.audio, song.beats, seed=seed, dance=dance, plant_feet=False
            )
        )
        for seed in range(n_draws(contest.profile, count))
    ]
    joints, fps = [motions[0].skeleton.joints.index(hand) for hand in HANDS], motions[0].fps
    smoothed = [smooth_positions(motion.positions, SMOOTHING, fps) for motion in motions]
    return HandHeights(
        np.arange(motions[0].n_frames) / fps,
        np.stack([motion.positions[:, joints, 1] for motion in motions]),
        np.stack([positions[:, joints, 1] for positions in smoothed]),
    )


@dataclass(frozen=True, eq=False)
class EndEffectors:
    """Places of feet, head and hands on the first two axes of the recorded ones (Fig. 9).

    Parameters
    ----------
    recorded : (F, 2) array
    generated : name -> (F', 2) array
    shares : DataFrame with the columns ablation, share (of the recorded variance, all axes), low, high (95 % over
        trainings), trainings
    """

    recorded: FloatArray
    generated: dict[str, FloatArray]
    shares: pd.DataFrame


def end_effectors(contest: Contest, names: Iterable[str], dance: str, *, count: int = 6) -> EndEffectors:
    """Fig. 9: principal axes of recorded end effectors of one dance, and generated ones on them."""
    runs = {name: ablated_dancers(contest, name) for name in names}
    code = next(iter(runs.values()))[0].system.generator.motion_code
    motions = [clip.motion for clip in recorded_dancers(contest)[dance] if clip.motion is not None]
    recorded = np.concatenate([_places(code, motion)[motion.valid] for motion in motions])
    middle, spread = recorded.mean(axis=0), recorded.var(axis=0).sum()
    axes = np.linalg.svd(recorded - middle, full_matrices=False)[2][:2].T
    generated, rows = {}, []
    for name, trainings in runs.items():
        places = [
            np.concatenate(
                [_places(code, danced(run, dance, number, dance_seconds(contest.profile, 30.0))) for number in range(n)]
            )
            for run in trainings
            for n in [n_draws(contest.profile, count)]
        ]
        mean, low, high = mean_interval([each.var(axis=0).sum() / spread for each in places])
        rows.append({"ablation": name, "share": mean, "low": low, "high": high, "trainings": len(places)})
        generated[name] = (np.concatenate(places) - middle) @ axes
    return EndEffectors((recorded - middle) @ axes, generated, pd.DataFrame(rows))


def _places(code: Any, motion: Motion) -> FloatArray:
    """(T, 15) places of the end effectors, from the root in its heading, of a motion of any body with the points."""
    points = RotationCode(code.body, code.means, end_effectors=True)
    return points.encode(motion)[:, -15:]


def ablation_table(
    contest: Contest, names: Iterable[str] = tuple(ABLATIONS), progress: Progress = silent
) -> pd.DataFrame:
    """Every ablation: dances of a minute beside recorded ones, losses and contacts on held-out figures.

    Returns
    -------
    DataFrame with the columns ablation, measure, mean, low, high (95 % over trainings), trainings. Measures: those of
    `MEASURED` in multiples of the recorded dancers' (still: share of seconds), "nats", "squared error", "contacts",
    "contacts, as before", "contacts, majority" (held-out figures), "fixed nats" (training windows drawn without
    clusters), parameters, epochs
    """
    recorded = {
        dance: pd.DataFrame([measures(clip.motion, dance, contest.limits) for clip in clips if clip.motion]).mean()
        for dance, clips in recorded_dancers(contest).items()
    }
    rows = []
    for name in progress(list(names), "ablations"):
        each = pd.DataFrame([_measured(contest, run, recorded) for run in ablated_dancers(contest, name)])
        for measure in each:
            mean, low, high = mean_interval(each[measure])
            row = {"ablation": name, "measure": measure, "mean": mean, "low": low, "high": high}
            rows.append(row | {"trainings": len(each)})
    return pd.DataFrame(rows)


HISTORY_COLUMNS = {
    "val_nats": "nats",
    "val_mse": "squared error",
    "val_contacts": "contacts",
    "val_contacts_as_before": "contacts, as before",
    "val_contacts_majority": "contacts, majority",
    "fixed_nats": "fixed nats",
}


def _measured(contest: Contest, run: TrainedDancer, recorded: dict[str, pd.Series]) -> dict[str, float]:
    """One training: its dances of a minute, one of each style, and the last row of its history."""
    seconds, parts = dance_seconds(contest.profile, MINUTE), []
    for dance, usual in recorded.items():
        own = measures(danced(run, dance, 1, seconds), dance, contest.limits)
        parts.append({name: own[name] / (1.0 if name == "still" else usual[name]) for name in MEASURED})
    last = run.history.ffill().iloc[-1]
    numbers = {words: float(last[name]) for name, words in HISTORY_COLUMNS.items() if name in last}
    about = {"parameters": float(run.system.generator.parameter_count()), "epochs": float(len(run.history))}
    means = {name: float(np.mean([part[name] for part in parts])) for name in MEASURED}
    return {**means, **numbers, **about}


def effector_disagreement(contest: Contest, name: str = "whole") -> float:
    """Distance of predicted feet, head and hands from where the predicted rotations put them (R36).

    Returns
    -------
    Its mean, centimetres, over dances of a minute, one of each style and training
    """
    away = []
    for run in ablated_dancers(contest, name):
        network = run.system.generator
        for dance in recorded_dancers(contest):
            song = unheard_song(dance, FIRST_SONG, dance_seconds(contest.profile, MINUTE))
            code = run.system.dance_code(DanceRequest(song.clip.audio, song.beats, seed=1, dance=dance)).code
            apart = (code - network.motion_code.refreshed(code, network.params.fps))[:, -15:]
            away.append(np.linalg.norm(apart.reshape(len(code), -1, 3), axis=2).mean())
    return 100 * float(np.mean(away))
