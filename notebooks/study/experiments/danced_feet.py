"""Feet of what Music2Dance dances: sliding by what is done about it, contacts, and heights of the toes (Fig. 10)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import foot_joints
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.systems.music2dance.codes import body_points
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.generate import FEET, Danced, dance_positions
from harmolab.systems.music2dance.networks import CONTACTS
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.systems.training.requests import DanceRequest
from harmolab.types import BoolArray, FloatArray, Motion
from study.experiments.ablated import ablated_dancers
from study.experiments.contests import Contest
from study.experiments.feet import CENTIMETRES, CONVOLUTION, MODELS, foot_model, lower_body_distance, wide_means
from study.experiments.minutes import dance_seconds, n_draws, recorded_dancers, unheard_song
from study.experiments.music2dance import CALM, DANCER_SETTINGS, trained_dancer

TRAINING = 1  # of several, that is danced with
DANCERS = ("recommended", "paper, calm", "paper")  # names of `DANCER_SETTINGS`
SECONDS, DRAWS = 20.0, 5  # of a dance; dances of each style
SHOWN_SECONDS, SHOWN_FROM = 8.0, 4.0  # of Fig. 10, as in the paper; what comes before goes on from the bank
FIRST_SONG = 800
RECORDED = "recorded"
FEET_MEASURES = ("sliding (cm/s)", "lower body moved (cm)", "jerk (m/s^3)")
VARIETY, PERCENTILES = ("SD (cm)", "range (cm)"), (5.0, 95.0)
VARIETY_DRAWS = 20  # dances of each style
DRAWINGS = {"all of the spread": 1.0, "a tenth of the spread": CALM}
# As Fig. 10 calls them -> names of `music2dance.ABLATIONS`.
EFFECTORS = {"with end effectors": "whole", "without end effectors": "no end effectors"}
TOES = ("toe L", "toe R")


class Recorded(NamedTuple):
    """A recorded dancer in a motion code, and a (T,) mask, False for filler."""

    code: Danced
    valid: BoolArray


def feet_of_dances(contest: Contest) -> pd.DataFrame:
    """Sliding of dances to songs that no training heard, by what is done about their feet, beside recorded dancers.

    Returns
    -------
    DataFrame, a row for each dancer and way: dancer, feet ("recorded", "none", "model", "planted"), n (dances), and of
    each measure the mean over dances with its 95 % interval: sliding (cm/s) as
    `harmolab.metrics.quality.foot_skating` has it, lower body moved (cm) (from where it is without correction, seen
    from the root), jerk (m/s^3). "recorded" are the recorded dancers, through the motion code of the dancer.
    """
    rows: list[dict[str, Any]] = []
    for name in DANCERS:
        settings = DANCER_SETTINGS[name]
        system = trained_dancer(contest.profile, contest.corpus, settings, TRAINING).system
        model = foot_model(contest.profile, contest.corpus, settings.representation, MODELS[CONVOLUTION]).model
        for recorded in recorded_codes(contest, system):
            motion = ways_to_treat(system, recorded.code, model)["none"]
            rows.append({"dancer": name, "feet": RECORDED, **_measures(replace(motion, valid=recorded.valid))})
        for dance in dance_codes(contest, system, DRAWS):
            ways = ways_to_treat(system, dance, model)
            rows += [{"dancer": name, "feet": way, **_measures(each, ways["none"])} for way, each in ways.items()]
    return wide_means(pd.DataFrame(rows), ["dancer", "feet"], FEET_MEASURES)


def dance_codes(contest: Contest, system: Music2Dance, draws: int, **options: Any) -> Iterator[Danced]:
    """Dances in every recorded style, each to a song of its own; options as of `Music2Dance.dance_code`."""
    for dance in recorded_dancers(contest):
        for number in range(n_draws(contest.profile, draws)):
            song = unheard_song(dance, FIRST_SONG + number, dance_seconds(contest.profile, SECONDS))
            yield system.dance_code(DanceRequest(song.clip.audio, song.beats, seed=number, dance=dance), **options)


def recorded_codes(contest: Contest, system: Music2Dance, dance: str | None = None) -> Iterator[Recorded]:
    """The first seconds of each recorded dancer, of one dance or of all, in a network's motion code."""
    seconds, fps = dance_seconds(contest.profile, SECONDS), system.generator.params.fps
    for name, clips in recorded_dancers(contest).items():
        for motion in (clip.motion for clip in clips if clip.motion is not None and dance in (None, name)):
            part = resample_motion(motion.span(0.0, min(seconds, motion.duration)), fps)
            values = system.coded(part)
            yield Recorded(Danced(values[:, :-CONTACTS], values[:, -CONTACTS:]), part.valid)


def ways_to_treat(system: Music2Dance, dance: Danced, model: FootModel) -> dict[str, Motion]:
    """A dance on the floor: "planted", corrected by a foot model ("model"), and with its feet as they are ("none")."""
    network = system.generator
    fps, skeleton = network.params.fps, network.motion_code.skeleton
    return {way: Motion(dance_positions(network, dance, way, model), fps, skeleton) for way in FEET[::-1]}


def _measures(motion: Motion, before: Motion | None = None) -> dict[str, float]:
    """`FEET_MEASURES` of a motion; moved from `before`."""
    moved = 0.0
    if before is not None:
        moved = float(lower_body_distance(motion.positions, before.positions, motion.fps, motion.skeleton).mean())
    values = (CENTIMETRES * foot_skating(motion), CENTIMETRES * moved, jerk(motion))
    return dict(zip(FEET_MEASURES, values, strict=True))


def contact_table(contest: Contest) -> pd.DataFrame:
    """Predicted contacts of held-out figures, one frame ahead, beside what needs no network.

    Returns
    -------
    DataFrame, a row for the paper's settings and ours (first training): dancer, weight of the contacts in the loss,
    frames per second, and the share of feet that are right: predicted, as in the frame before, and by the majority
    (always "stands", or never)
    """
    rows = []
    for name in ("paper", "recommended"):
        settings = DANCER_SETTINGS[name]
        run = trained_dancer(contest.profile, contest.corpus, settings, TRAINING)
        last = run.history.dropna(subset="val_contacts").iloc[-1]
        rows.append(
            {
                "dancer": name,
                "weight": settings.contact_weight,
                "frames per second": settings.fps,
                "predicted": last["val_contacts"],
                "as in the frame before": last["val_contacts_as_before"],
                "majority": last["val_contacts_majority"],
            }
        )
    return pd.DataFrame(rows)


def toe_heights(system: Music2Dance, dance: Danced) -> FloatArray:
    """Heights of the left and the right toe (T, 2), metres, as they come out of the network: no correction at all."""
    network = system.generator
    code, fps = network.motion_code, network.params.fps
    return _toes(Motion(code.decode(dance.code, fps), fps, code.skeleton))


def _toes(motion: Motion) -> FloatArray:
    points = body_points(motion)
    return points.positions[:, [points.skeleton.joints.index(toe) for toe in TOES], 1]


def toe_curves(contest: Contest, dance: str) -> dict[str, FloatArray]:
    """Fig. 10: toes in dances to one song by networks with and without end effectors in their code.

    A tenth of the predicted spread is drawn, as in the released code; all of it hides everything else.

    Returns
    -------
    name -> (T, 2) array of metres, 25 frames a second; "recorded" is a recorded dancer in the same code
    """
    song = unheard_song(dance, FIRST_SONG, SHOWN_FROM + SHOWN_SECONDS)
    heights: dict[str, FloatArray] = {}
    for name, ablation in EFFECTORS.items():
        system = ablated_dancers(contest, ablation)[0].system
        if not heights:
            heights[RECORDED] = toe_heights(system, next(recorded_codes(contest, system, dance)).code)
        heights[name] = toe_heights(
            system, system.dance_code(DanceRequest(song.clip.audio, song.beats, seed=1, dance=dance))
        )
    first = round(SHOWN_FROM * DANCER_SETTINGS["paper"].fps)
    last = first + round(SHOWN_SECONDS * DANCER_SETTINGS["paper"].fps)
    return {name: values[first:last] for name, values in heights.items()}


def toe_variety(contest: Contest) -> pd.DataFrame:
    """Variety of the toes' heights with and without end effectors in the code: one curve proves nothing.

    Returns
    -------
    DataFrame, a row for each dancer and drawing (all of the predicted spread, as printed, or a tenth, as in the
    released code): dancer, drawing, n (dances), and of SD (cm) and range (cm, 5th to 95th percentile) of a toe's height
    the mean over dances and its 95 % interval
    """
    rows: list[dict[str, Any]] = []
    for name, ablation in EFFECTORS.items():
        runs = ablated_dancers(contest, ablation)
        for drawing, temperature in DRAWINGS.items():
            for run in runs:
                dances = dance_codes(contest, run.system, VARIETY_DRAWS // len(runs), temperature=temperature)
                about = {"dancer": name, "drawing": drawing}
                rows += [{**about, **_variety(toe_heights(run.system, dance))} for dance in dances]
    first = ablated_dancers(contest, EFFECTORS["with end effectors"])[0].system
    about = {"dancer": RECORDED, "drawing": ""}
    rows += [
        {**about, **_variety(toe_heights(first, recorded.code)[recorded.valid])}
        for recorded in recorded_codes(contest, first)
    ]
    return wide_means(pd.DataFrame(rows), ["dancer", "drawing"], VARIETY)


def _variety(heights: FloatArray) -> dict[str, float]:
    """`VARIETY` of heights (T, 2), metres: means over both toes."""
    low, high = np.percentile(heights, PERCENTILES, axis=0)
    values = (heights.std(axis=0).mean(), (high - low).mean())
    return {name: CENTIMETRES * float(value) for name, value in zip(VARIETY, values, strict=True)}


@dataclass(frozen=True, eq=False)
class FootCurves:
    """Heights of a dance's toes (T, 2), metres, and speeds of its feet (T, 2), as of `foot_speeds`."""

    heights: FloatArray
    speeds: FloatArray


def foot_curves(contest: Contest, dance: str) -> tuple[dict[str, FootCurves], FloatArray]:
    """One dance with its feet as they are, corrected by the foot model, and planted; 25 frames a second.

    Returns
    -------
    (way -> FootCurves, contacts (T, 2) that the network predicts and the foot model is told)
    """
    settings = DANCER_SETTINGS["paper, calm"]
    system = trained_dancer(contest.profile, contest.corpus, settings, TRAINING).system
    model = foot_model(contest.profile, contest.corpus, settings.representation, MODELS[CONVOLUTION]).model
    song = unheard_song(dance, FIRST_SONG, SHOWN_FROM + SHOWN_SECONDS)
    code = system.dance_code(DanceRequest(song.clip.audio, song.beats, seed=1, dance=dance))
    first = round(SHOWN_FROM * settings.fps)
    curves = {
        way: FootCurves(_toes(motion)[first:], foot_speeds(motion)[first:])
        for way, motion in ways_to_treat(system, code, model).items()
    }
    return curves, code.contacts[first:]


def foot_speeds(motion: Motion) -> FloatArray:
    """Speed along the floor of the slowest point of the left and the right foot, (T, 2), metres per second."""
    steps = np.linalg.norm(np.gradient(motion.positions[..., [0, 2]], axis=0), axis=-1) * motion.fps
    return np.stack([steps[:, list(foot)].min(axis=1) for foot in foot_joints(motion.skeleton)], axis=1)
