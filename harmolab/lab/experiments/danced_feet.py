"""Feet of what Music2Dance dances: sliding by what is done about it, contacts, and heights of the toes (Fig. 10)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.corpora.folders import find_recordings, load_recording
from harmolab.io.files import silent
from harmolab.kinematics import resample_motion
from harmolab.lab.experiments.feet import CENTIMETRES, CONVOLUTION, MODELS, foot_model, lower_body_distance, wide_means
from harmolab.lab.experiments.generation import corpus_root, generator_corpora
from harmolab.lab.experiments.music2dance import DANCER_SETTINGS, ablated, trained_dancer
from harmolab.lab.experiments.songs import Excerpt, windows
from harmolab.lab.profile import RunProfile
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.skeletons import foot_joints
from harmolab.systems.common.grounding import grounded
from harmolab.systems.music2dance.codes import PositionCode, RotationCode
from harmolab.systems.music2dance.feet import FootModel
from harmolab.systems.music2dance.generate import danced
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.points import body_points
from harmolab.systems.music2dance.sequences import song_features
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.types import FloatArray, Motion

SEED = 1  # of the trainings that are danced with
SECONDS = 20.0  # of a dance
SHOWN_SECONDS = 8.0  # of Fig. 10, as in the paper
SONGS = 2  # of each dance, at most
RECORDED, NONE, MODEL, PLANTED = "recorded", "none", "model", "planted"
MEASURES = ("sliding (cm/s)", "lower body moved (cm)", "jerk (m/s^3)")
VARIETY, PERCENTILES = ("SD (cm)", "range (cm)"), (5.0, 95.0)


def tempered(settings: Music2DanceParams) -> Music2DanceParams:
    """The same network, drawn from as the released code does: a tenth of the predicted spread, then smoothed (R34)."""
    return replace(settings, temperature=0.1, smoothing=0.04)


DANCERS: Mapping[str, Music2DanceParams] = MappingProxyType(
    {
        "recommended": DANCER_SETTINGS["recommended"],
        "paper, a tenth of the spread": tempered(DANCER_SETTINGS["paper"]),
        "paper": DANCER_SETTINGS["paper"],
    }
)
ALL, TENTH = "all of the spread", "a tenth of the spread"
WITH, WITHOUT = "with end effectors", "without end effectors"
EFFECTORS: Mapping[str, Music2DanceParams] = MappingProxyType(
    {WITH: ablated("whole"), WITHOUT: ablated("no end effectors")}
)


@dataclass(frozen=True, eq=False)
class CodedDance:
    """A motion code as a network dances it, or as a recording has it.

    Parameters
    ----------
    code : PositionCode or RotationCode
    fps : float, hertz
    values : (T, C) array
    contacts : (T, 2) array, 1 where a foot is said to stand
    """

    code: PositionCode | RotationCode
    fps: float
    values: FloatArray
    contacts: FloatArray

    def motion(self, model: FootModel | None = None, *, plant_feet: bool = False) -> Motion:
        """The dance on the floor, its code corrected by a foot model (Eq. 14) if there is one."""
        values = self.values if model is None else self._corrected(model)
        positions = grounded(self.code.decode(values, self.fps), self.fps, self.code.skeleton, plant_feet=plant_feet)
        return Motion(positions, self.fps, self.code.skeleton)

    def ways(self, model: FootModel) -> dict[str, Motion]:
        """The dance with its feet as they are ("none"), corrected by a foot model ("model"), and "planted"."""
        return {NONE: self.motion(), MODEL: self.motion(model), PLANTED: self.motion(plant_feet=True)}

    def decoded(self) -> Motion:
        """The dance without any correction, not even of the floor."""
        return Motion(self.code.decode(self.values, self.fps), self.fps, self.code.skeleton)

    def _corrected(self, model: FootModel) -> FloatArray:
        # The model sees the feet where the rotations put them, as in its training, and not where they are predicted.
        code, values = self.code, self.values
        return model.correct(
            code.refreshed(values, self.fps) if isinstance(code, RotationCode) else values, self.contacts
        )


def coded_dance(system: Music2Dance, excerpt: Excerpt, seed: int) -> CodedDance:
    """A dance of a trained network to some seconds of a song, from a movement of its bank."""
    network, clip = system.generator, excerpt.clip
    params = network.params
    dance = clip.dance if clip.dance in network.dances else network.dances[0]
    movements = None if system.poses is None else system.poses.of(dance)
    if movements is None:
        raise ValueError("the weights have no bank of movements that a dance could go on from; train them anew")
    result = danced(
        network, song_features(clip.audio, excerpt.beats, params.song, dance), start=excerpt.start,
        frames=round(excerpt.seconds * params.fps), dance=network.dances.index(dance), seed=seed,
        prior=movements[seed % len(movements)], progress=silent,
    )  # fmt: skip
    return CodedDance(network.motion_code, params.fps, result.code, result.contacts)


def recorded_dance(system: Music2Dance, excerpt: Excerpt) -> CodedDance:
    """The recorded dancer of the same seconds in the network's motion code."""
    network = system.generator
    code, motion = network.motion_code, resample_motion(excerpt.dancer, network.params.fps)
    points = motion if isinstance(code, PositionCode) else body_points(motion)
    return CodedDance(code, motion.fps, code.encode(points), np.ones((motion.n_frames, 2)))


def dance_songs(profile: RunProfile, corpus: str) -> list[Excerpt]:
    """Twenty seconds of up to two songs of each dance of a corpus, with the dancers who were recorded to them."""
    taken: dict[str, list[Excerpt]] = {}
    for folder in find_recordings(corpus_root(profile, corpus)).folders:
        recording = load_recording(folder)
        own = taken.setdefault(recording.clip.dance, [])
        if len(own) < (SONGS if profile.epochs is None else 1):
            own += [excerpt.longer(SECONDS) for excerpt in windows(recording)[:1]]
    return [excerpt for own in taken.values() for excerpt in own]


def feet_of_dances(profile: RunProfile) -> pd.DataFrame:
    """Sliding of generated dances by what is done about their feet; of the first corpus, seed 1, beside the recorded.

    Returns
    -------
    DataFrame, a row for each dancer and way: dancer, feet ("recorded", "none", "model", "planted"), and of each measure
    the mean over songs with its 95 % interval (draws of a song averaged): sliding (cm/s) as
    `harmolab.metrics.quality.foot_skating` has it, lower body moved (cm) (from where it is without correction, seen
    from the root), jerk (m/s^3)
    """
    corpus = generator_corpora(profile)[0]
    rows: list[dict[str, Any]] = []
    for name, settings in DANCERS.items():
        system = trained_dancer(profile, corpus, settings, SEED).system
        model = foot_model(profile, corpus, settings.representation, MODELS[CONVOLUTION]).model
        for excerpt in dance_songs(profile, corpus):
            about = {"dancer": name, "song": excerpt.song}
            rows.append({**about, "feet": RECORDED, **_measures(recorded_dance(system, excerpt).motion())})
            for draw in range(profile.draws):
                ways = coded_dance(system, excerpt, draw).ways(model)
                rows += [{**about, "feet": way, **_measures(motion, ways[NONE])} for way, motion in ways.items()]
    return _over_songs(pd.DataFrame(rows), ["dancer", "feet"], MEASURES)


def _measures(motion: Motion, before: Motion | None = None) -> dict[str, float]:
    """`MEASURES` of a motion; moved from `before`."""
    moved = 0.0
    if before is not None:
        moved = float(lower_body_distance(motion.positions, before.positions, motion.fps, motion.skeleton).mean())
    values = (CENTIMETRES * foot_skating(motion), CENTIMETRES * moved, jerk(motion))
    return dict(zip(MEASURES, values, strict=True))


def _over_songs(rows: pd.DataFrame, keys: list[str], measures: tuple[str, ...]) -> pd.DataFrame:
    """`wide_means` over songs of the means over draws."""
    songs = rows.groupby([*keys, "song"], sort=False)[list(measures)].mean().reset_index()
    return wide_means(songs, keys, measures).rename(columns={"n": "songs"})


def contact_table(profile: RunProfile) -> pd.DataFrame:
    """Predicted contacts of held-out figures, one frame ahead, beside what needs no network.

    Returns
    -------
    DataFrame, a row for the paper's settings and ours (seed 1): dancer, weight of the contacts in the loss, frames per
    second, and the share of feet that are right: predicted, as in the frame before, and by the majority (always
    "stands", or never)
    """
    corpus = generator_corpora(profile)[0]
    rows = []
    for name in ("paper", "recommended"):
        run = trained_dancer(profile, corpus, DANCER_SETTINGS[name], SEED)
        last = run.history.dropna(subset="val_contacts").iloc[-1]
        rows.append(
            {
                "dancer": name,
                "weight": DANCER_SETTINGS[name].contact_weight,
                "frames per second": DANCER_SETTINGS[name].fps,
                "predicted": last["val_contacts"],
                "as in the frame before": last["val_contacts_as_before"],
                "majority": last["val_contacts_majority"],
            }
        )
    return pd.DataFrame(rows)


def toe_heights(motion: Motion) -> FloatArray:
    """Heights of the left and the right toe (T, 2), metres."""
    points = body_points(motion)
    toes = [points.skeleton.joints.index(name) for name in ("toe L", "toe R")]
    return points.positions[:, toes, 1]


def toe_curves(profile: RunProfile) -> dict[str, FloatArray]:
    """Heights of both toes as networks with and without end effectors in their code dance the first song (Fig. 10).

    Without any correction, and drawn as the released code draws.

    Returns
    -------
    name -> (T, 2) array of metres, 25 frames a second; "recorded" is the recorded dancer in the same code
    """
    corpus = generator_corpora(profile)[0]
    excerpt = dance_songs(profile, corpus)[0].longer(SHOWN_SECONDS)
    dances: dict[str, CodedDance] = {}
    for name, settings in EFFECTORS.items():
        system = trained_dancer(profile, corpus, tempered(settings), SEED).system
        dances.setdefault(RECORDED, recorded_dance(system, excerpt))
        dances[name] = coded_dance(system, excerpt, SEED)
    return {name: toe_heights(dance.decoded()) for name, dance in dances.items()}


def toe_variety(profile: RunProfile) -> pd.DataFrame:
    """Variety of the toes' heights with and without end effectors in the code: one curve proves nothing.

    Returns
    -------
    DataFrame, a row for each dancer and drawing (all of the predicted spread, as printed, or a tenth of it, as in the
    released code): dancer, drawing, songs, and of SD (cm) and range (cm, 5th to 95th percentile) of a toe's height the
    mean over songs and its 95 % interval; draws of a song are averaged
    """
    corpus = generator_corpora(profile)[0]
    songs, rows = dance_songs(profile, corpus), []
    for name, settings in EFFECTORS.items():
        for drawing, params in {ALL: settings, TENTH: tempered(settings)}.items():
            system = trained_dancer(profile, corpus, params, SEED).system
            rows += [
                {
                    "dancer": name,
                    "drawing": drawing,
                    "song": excerpt.song,
                    **_variety(coded_dance(system, excerpt, draw)),
                }
                for excerpt in songs
                for draw in range(profile.draws)
            ]
    about = {"dancer": RECORDED, "drawing": ""}
    system = trained_dancer(profile, corpus, EFFECTORS[WITH], SEED).system
    rows += [{**about, "song": each.song, **_variety(recorded_dance(system, each))} for each in songs]
    return _over_songs(pd.DataFrame(rows), ["dancer", "drawing"], VARIETY)


def _variety(dance: CodedDance) -> dict[str, float]:
    heights = CENTIMETRES * toe_heights(dance.decoded())
    low, high = np.percentile(heights, PERCENTILES, axis=0)
    return dict(zip(VARIETY, (float(heights.std(axis=0).mean()), float((high - low).mean())), strict=True))


@dataclass(frozen=True)
class FootCurves:
    """Heights of a dance's toes (T, 2), metres, and speeds of its feet (T, 2), as of `foot_speeds`."""

    heights: FloatArray
    speeds: FloatArray


def foot_curves(profile: RunProfile) -> tuple[dict[str, FootCurves], FloatArray]:
    """One generated dance with its feet as they are, corrected by the foot model, and planted (Fig. 10b).

    Returns
    -------
    (way -> FootCurves, contacts (T, 2) that the network predicts and the foot model is told)
    """
    corpus, settings = generator_corpora(profile)[0], DANCERS["paper, a tenth of the spread"]
    system = trained_dancer(profile, corpus, settings, SEED).system
    model = foot_model(profile, corpus, settings.representation, MODELS[CONVOLUTION]).model
    dance = coded_dance(system, dance_songs(profile, corpus)[0].longer(SHOWN_SECONDS), SEED)
    ways = dance.ways(model).items()
    return {way: FootCurves(toe_heights(motion), foot_speeds(motion)) for way, motion in ways}, dance.contacts


def foot_speeds(motion: Motion) -> FloatArray:
    """Speed along the floor of the slowest point of the left and the right foot, (T, 2), metres per second."""
    steps = np.linalg.norm(np.gradient(motion.positions[..., [0, 2]], axis=0), axis=-1) * motion.fps
    return np.stack([steps[:, list(foot)].min(axis=1) for foot in foot_joints(motion.skeleton)], axis=1)
