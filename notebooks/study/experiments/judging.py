"""Hard scores of motions danced to units of music, from any source, beside those of the recorded motion.

Everything here takes motions: a system is judged by the joints it moves, not by how it codes them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import in_body
from harmolab.lab.evaluate.measured import statue
from harmolab.metrics.features import diversity, frechet_distance, kinetic_features, standardise
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.systems.harmogan.networks import generate_units
from harmolab.systems.training.pose_network import PoseNet, embed_meters
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import BeatTrack, Motion
from study.experiments.generation import VARIANTS, trained
from study.profile import RunProfile

RECORDED = "recorded"
MODES = MappingProxyType({"paper_": HarmonyParams.paper(), "": HarmonyParams.valleys()})  # prefix of a column -> score


def danced_units(
    profile: RunProfile, corpus: str, variants: Sequence[str] = tuple(VARIANTS)
) -> tuple[UnitSet, dict[str, list[Motion]]]:
    """The test units of a corpus, and the motions danced to them: recorded, and by the variants of the first seed.

    Variants that hear other music features have a test set of their own, of the same units.
    """
    runs = {name: trained(profile, corpus, VARIANTS[name], 1) for name in variants}
    units = runs[variants[0]].split.test
    motions = {name: generate_units(run.generator, run.split.test) for name, run in runs.items()}
    return units, {RECORDED: recorded_motions(units), **motions}


def recorded_motions(units: UnitSet) -> list[Motion]:
    """The recorded motion of each unit: whole units, with the beats before the meter."""
    return [units.decoded(unit.motion.astype(np.float64)) for unit in units.units]


def meter_motion(motion: Motion, unit: DanceUnit) -> Motion:
    """A unit's motion without the beats before the meter; its frame rate may differ from the unit's."""
    first = round(unit.n_prior * motion.fps / unit.fps)
    return Motion(motion.positions[first:], motion.fps, motion.skeleton, motion.valid[first:])


def meter_motions(motions: Sequence[Motion], units: UnitSet) -> list[Motion]:
    """`meter_motion` of motions, one for each unit."""
    return [meter_motion(*pair) for pair in zip(motions, units.units, strict=True)]


def score_unit(motion: Motion, unit: DanceUnit, params: HarmonyParams) -> HarmonyScore:
    """Harmony of a unit's motion over its meter: visual beats come from all of it, those of the meter count."""
    start = unit.n_prior / unit.fps
    music, visual = unit_beats(unit, motion), visual_beats(motion, params=params)
    meter = (start, motion.duration - start)
    return score_harmony(music.span(*meter), visual.span(*meter), params=params, n_rotations=0)


def unit_beats(unit: DanceUnit, motion: Motion) -> BeatTrack:
    """The music beats of a unit on the time line of a motion danced to it, seconds from its first frame."""
    duration = max(motion.duration, float(unit.beats.max(initial=0.0)))
    return BeatTrack(unit.beats, unit.strengths, motion.fps, duration)


def judge(motions: Sequence[Motion], units: UnitSet, pose_net: PoseNet, *, seed: int = 0) -> dict[str, float]:
    """Means over units of every measure of motions, one for each whole unit.

    Parameters
    ----------
    motions : sequence of Motion, in the order of the units; frame 0 is the unit's
    units : UnitSet, whose recorded motion the distances are measured from
    pose_net : PoseNet for the same skeleton
    seed : int, of the correction of the Frechet distances' bias

    Returns
    -------
    dict with, in paper mode (`paper_`) and for valleys within 0.1 s: harmony, hit rate, chance, harmony above chance,
    M and N a unit, M / N; harmony above chance of the body alone (`body_`) and of its statue (`statue_`, see
    `unit_columns`); jerk (m/s^3), skating (m/s), Frechet distances on the pose network's and on kinetic features,
    to the units' recorded motion, and diversity.

    Raises
    ------
    ValueError
        If the motions are not as many as the units, or move other joints than the pose network's.
    """
    recorded = recorded_motions(units)
    meters, recorded_meters = (meter_motions(whole, units) for whole in (motions, recorded))
    values, target = (embed_meters(whole, units, pose_net) for whole in (motions, recorded))
    kinetic, reference = (np.stack([kinetic_features(motion) for motion in cut]) for cut in (meters, recorded_meters))
    kinetic, reference = standardise(kinetic, reference), standardise(reference, reference)
    return {
        **_harmony(motions, units),
        "jerk": float(np.mean([jerk(motion) for motion in meters])),
        "foot_skating": float(np.mean([foot_skating(motion) for motion in meters])),
        "fid": frechet_distance(values, target, seed=seed).value,
        "fid_raw": frechet_distance(values, target, correct_bias=False).value,
        "fid_kinetic": frechet_distance(kinetic, reference, seed=seed).value,
        "diversity": diversity(values),
        "units": float(len(units)),
    }


def harmony_columns(scores: Mapping[str, HarmonyScore]) -> dict[str, float]:
    """The columns of tables from scores of `MODES`, by their prefix."""
    fields = ("harmony", "hit_rate", "chance", "harmony_above_chance", "n_visual", "n_audio")
    columns: dict[str, float] = {}
    for mode, score in scores.items():
        columns |= {mode + field.removeprefix("harmony_"): getattr(score, field) for field in fields}
    return columns | {f"{mode}count_ratio": score.n_visual / max(score.n_audio, 1) for mode, score in scores.items()}


def unit_columns(motion: Motion, unit: DanceUnit) -> dict[str, float]:
    """`harmony_columns` of `score_unit` in all modes; above chance also of the body alone, and of a statue.

    "body_above_chance" sees joints in the body; "statue_above_chance" is what the mean pose on the same path gets. A
    dance that is no better than its statue has danced with its path.
    """
    columns = harmony_columns({mode: score_unit(motion, unit, params) for mode, params in MODES.items()})
    others = {"body_": in_body(motion), "statue_": statue(motion)}
    scores = {name: score_unit(other, unit, MODES[""]) for name, other in others.items()}
    return columns | {f"{name}above_chance": score.harmony_above_chance for name, score in scores.items()}


def _harmony(motions: Sequence[Motion], units: UnitSet) -> dict[str, float]:
    """Means over units of `unit_columns`; M / N is the ratio of the means."""
    columns = [unit_columns(*pair) for pair in zip(motions, units.units, strict=True)]
    means = {name: float(np.mean([each[name] for each in columns])) for name in columns[0]}
    ratios = {mode: means[f"{mode}n_visual"] / max(means[f"{mode}n_audio"], 1e-9) for mode in MODES}
    return means | {f"{mode}count_ratio": ratio for mode, ratio in ratios.items()}


@dataclass(frozen=True, eq=False)
class DancedUnit:
    """A unit's music beats and all that was danced to them.

    Parameters
    ----------
    name : str, of the unit
    dance : str
    beats : BeatTrack, seconds from the unit's first frame
    start : float, seconds, where the meter begins; the motion before it was given
    motions : variant, or "recorded" -> Motion
    scores : the same names -> HarmonyScore of the meter, valleys within 0.1 s
    """

    name: str
    dance: str
    beats: BeatTrack
    start: float
    motions: dict[str, Motion]
    scores: dict[str, HarmonyScore]

    @property
    def verdicts(self) -> dict[str, str]:
        """The result of each motion, in words."""
        return {
            name: f"{score.hits.sum()} of {score.n_audio} beats met, {score.chance * score.n_audio:.1f} by chance"
            for name, score in self.scores.items()
        }


def danced(units: UnitSet, dances: Mapping[str, Sequence[Motion]], place: int) -> DancedUnit:
    """The `place`-th of some units with what `danced_units` has danced to it, the recorded one among them.

    Raises
    ------
    ValueError
        If there is no such unit.
    """
    if not 0 <= place < len(units):
        raise ValueError(f"place must be 0 to {len(units) - 1}, the test units, got {place}")
    unit, motions = units.units[place], {name: each[place] for name, each in dances.items()}
    scores = {name: score_unit(motion, unit, HarmonyParams.valleys()) for name, motion in motions.items()}
    beats = unit_beats(unit, motions[RECORDED])
    return DancedUnit(unit.name, unit.dance, beats, unit.n_prior / unit.fps, motions, scores)
