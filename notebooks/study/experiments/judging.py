"""Generators judged by what they dance to units of music and to whole songs, beside recorded motion (08, 09, 11, 12).

Everything here takes motions: a system is judged by the joints it moves, not by how it codes them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import in_body
from harmolab.lab.evaluate.measured import statue
from harmolab.metrics.features import diversity, frechet_distance, kinetic_features, standardise
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import DANCES, HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.significance import mean_interval
from harmolab.systems.harmogan.networks import generate_units
from harmolab.systems.training.pose_network import PoseNet, embed_meters
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import BeatTrack, Motion
from study.experiments.generation import SYNTHETIC, VARIANTS, Trained, generator_corpora, trained
from study.experiments.study import data_root, excerpt, readable_recordings, study_recordings, synthetic_corpus
from study.profile import RunProfile

# The paper's Tables 1 and 2: systems by dance, in the order of `DANCES`. For other music, models and data than ours.

MEAN = "mean"  # of the seven dances; the paper draws it in Fig. 12 and prints it nowhere

# Harmony h (Eq. 20) by dance, and hit rate of the music beats as a share.
TABLE_1: Mapping[str, tuple[float, ...]] = {
    "Lee": (0.3509, 0.3359, 0.2773, 0.2862, 0.2805, 0.2657, 0.2704),
    "Ren": (0.2759, 0.3321, 0.1625, 0.2154, 0.2761, 0.2671, 0.3122),
    "HarmoGAN without L_harmo": (0.1983, 0.2337, 0.1511, 0.2104, 0.2012, 0.1929, 0.2076),
    "HarmoGAN": (0.4097, 0.3995, 0.3199, 0.3495, 0.3468, 0.2948, 0.3455),
}
TABLE_2: Mapping[str, tuple[float, ...]] = {
    "Lee": (0.5810, 0.5992, 0.5303, 0.6491, 0.6493, 0.5846, 0.5430),
    "Ren": (0.2813, 0.5103, 0.3333, 0.4153, 0.4907, 0.4284, 0.5259),
    "HarmoGAN without L_harmo": (0.2270, 0.2397, 0.1818, 0.2533, 0.2970, 0.2148, 0.2636),
    "HarmoGAN": (0.7460, 0.7565, 0.7122, 0.7701, 0.8369, 0.7498, 0.7290),
}
TABLES: Mapping[str, Mapping[str, tuple[float, ...]]] = {"h": TABLE_1, "hit_rate": TABLE_2}


def printed(measure: str, system: str, dance: str = MEAN) -> float:
    """The paper's value of "h" or "hit_rate" for a system and dance; NaN where it prints none.

    >>> round(printed("h", "HarmoGAN"), 4)
    0.3522
    """
    values = TABLES.get(measure, {}).get(system)
    if values is None or dance not in (*DANCES, MEAN):
        return float("nan")
    return float(np.mean(values)) if dance == MEAN else values[list(DANCES).index(dance)]


# Units of music

RECORDED = "recorded"
MODES: Mapping[str, HarmonyParams] = {
    "paper_": HarmonyParams.paper(),
    "": HarmonyParams.valleys(),
}  # prefix of a column -> score
DISTANCES = ("fid", "fid_raw", "fid_kinetic")  # from the recorded motion
TRUE, LATE = "true", "half a beat late"  # music
_PRINTED_ROWS = {"paper, without": "HarmoGAN without L_harmo", "paper": "HarmoGAN", "lee2019": "Lee", "ren2020": "Ren"}
# Means over the seven dances of the paper's Tables 1 and 2 (Ballroom music; not comparable number by number).
PAPER_MEANS: Mapping[str, Mapping[str, float]] = {
    variant: {f"paper_{'harmony' if name == 'h' else name}": round(printed(name, row), 4) for name in TABLES}
    for variant, row in _PRINTED_ROWS.items()
}


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
    harmony = pd.DataFrame([unit_columns(*pair) for pair in zip(motions, units.units, strict=True)]).mean()
    for mode in MODES:
        harmony[f"{mode}count_ratio"] = harmony[f"{mode}n_visual"] / max(harmony[f"{mode}n_audio"], 1e-9)
    meters, recorded_meters = (meter_motions(whole, units) for whole in (motions, recorded))
    values, target = (embed_meters(whole, units, pose_net) for whole in (motions, recorded))
    kinetic, reference = (np.stack([kinetic_features(motion) for motion in cut]) for cut in (meters, recorded_meters))
    kinetic, reference = standardise(kinetic, reference), standardise(reference, reference)
    return {
        **harmony,
        "jerk": np.mean([jerk(motion) for motion in meters]),
        "foot_skating": np.mean([foot_skating(motion) for motion in meters]),
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


# What the harmony loss buys and what it costs, over corpora and seeds (notebooks 08 and 09)


def ablation(profile: RunProfile) -> pd.DataFrame:
    """Measures of `judge` on the test units, for each corpus, variant and seed.

    Returns
    -------
    DataFrame with the columns corpus, variant, seed and the measures; the variant "recorded" is the recorded motion
    itself. Of each seed all are judged with the pose network of the variant "paper".
    """
    rows = []
    for corpus, seed in product(generator_corpora(profile), range(1, profile.n_seeds + 1)):
        runs = {name: trained(profile, corpus, variant, seed) for name, variant in VARIANTS.items()}
        units, pose_net = runs["paper"].split.test, runs["paper"].pose_net
        of_all = {name: judged(run, seed, pose_net) for name, run in runs.items()}
        recorded = judge(recorded_motions(units), units, pose_net, seed=seed)
        of_all[RECORDED] = recorded | dict.fromkeys(DISTANCES, np.nan)  # it has no distance from itself
        rows += [{"corpus": corpus, "variant": name, "seed": seed, **own} for name, own in of_all.items()]
    return pd.DataFrame(rows)


def judged(run: Trained, seed: int, pose_net: PoseNet) -> dict[str, float]:
    """`judge` of a generator's motion for the test units, by a pose network that judges others too."""
    return judge(generate_units(run.generator, run.split.test), run.split.test, pose_net, seed=seed)


def seed_means(table: pd.DataFrame, measures: list[str]) -> pd.DataFrame:
    """Means over seeds with 95 % intervals (Student's t), one row for each corpus, variant and measure.

    Parameters
    ----------
    table : DataFrame, as `ablation` returns it
    measures : names of its columns

    Returns
    -------
    DataFrame with the columns corpus, variant, measure, mean, low, high, seeds, paper. `low` and `high` are NaN for a
    single seed; `paper` is the paper's value where it prints one, NaN elsewhere.
    """
    means = group_means(table, ["corpus", "variant"], measures).rename(columns={"n": "seeds"})
    pairs = zip(means["variant"], means["measure"], strict=True)
    return means.assign(paper=[PAPER_MEANS.get(variant, {}).get(measure, np.nan) for variant, measure in pairs])


def group_means(table: pd.DataFrame, keys: Sequence[str], measures: Sequence[str]) -> pd.DataFrame:
    """Mean and 95 % interval (Student's t) of each measure in each group of rows.

    Parameters
    ----------
    table : DataFrame
    keys : names of the columns whose values make a group
    measures : names of numeric columns

    Returns
    -------
    DataFrame with the columns of `keys`, then measure, mean, low, high, n; groups in the order of their first rows.
    `low` and `high` are NaN for a group of one row.
    """
    rows = []
    for names, part in table.groupby(list(keys), sort=False):
        for measure in measures:
            mean, low, high = mean_interval(part[measure].to_numpy(np.float64))
            group = dict(zip(keys, names, strict=True))
            rows.append({**group, "measure": measure, "mean": mean, "low": low, "high": high, "n": len(part)})
    return pd.DataFrame(rows)


# Motions with their music, and with the same music half a beat late (notebook 12). A score that asks about it
# must give a trick, which knows nothing of it, what it gives to chance; a dancer who follows the music loses by it.


def studied_clips(profile: RunProfile, corpus: str) -> Iterator[tuple[str, Motion, BeatTrack]]:
    """(name, motion, tracked beats) of six seconds from the middle of each sequence, as many as the profile takes."""
    planted = corpus == SYNTHETIC and data_root() is not None
    recordings = readable_recordings(synthetic_corpus(profile)) if planted else study_recordings(profile, corpus)
    for clip in (excerpt(recording, 6.0) for recording in recordings):
        if clip.motion is not None and clip.beats is not None and len(clip.beats) > 1:
            yield clip.name, clip.motion, clip.beats


def late_rows(motion: Motion, beats: BeatTrack) -> Iterator[dict[str, Any]]:
    """Scores and jerk of a motion, a row for the true music and one for music half a beat late."""
    visual = {mode: visual_beats(motion, params=params) for mode, params in MODES.items()}
    about = {"jerk": jerk(motion)}
    for music, track in ((TRUE, beats), (LATE, half_a_beat_late(beats))):
        scores = {mode: score_harmony(track, visual[mode], params=MODES[mode], n_rotations=0) for mode in MODES}
        yield {"music": music, **harmony_columns(scores), **about}


def generators_half_a_beat_late(profile: RunProfile) -> pd.DataFrame:
    """The same for the recorded motion of the test units and for the generators of the first seed.

    They are judged on the meter, as everywhere; every beat of the unit is moved by half its median period.

    Returns
    -------
    DataFrame, a row for each corpus, unit ("clip"), variant ("trick") and music, with its scores and jerk.
    """
    rows = []
    for corpus in generator_corpora(profile):
        units, dances = danced_units(profile, corpus)
        for name, motions in dances.items():
            for motion, unit in zip(motions, units.units, strict=True):
                about = {"corpus": corpus, "clip": unit.name, "trick": name, "jerk": jerk(meter_motion(motion, unit))}
                late = replace(unit, beats=unit.beats + np.median(np.diff(unit.beats)) / 2)
                for music, each in ((TRUE, unit), (LATE, late)):
                    rows.append({**about, "music": music, **unit_columns(motion, each)})
    return pd.DataFrame(rows)


def trick_means(table: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """`group_means` over clips, of each corpus, trick and music, of a table of `generators_half_a_beat_late`."""
    means = group_means(table, ["corpus", "trick", "music"], measures)
    return means[["corpus", "trick", "music", "measure", "n", "mean", "low", "high"]]


def half_a_beat_late(beats: BeatTrack) -> BeatTrack:
    """The same beats half a median period later; what passes the end comes in again at the start.

    Raises
    ------
    ValueError
        If there are fewer than two beats.
    """
    if len(beats) < 2:
        raise ValueError(f"half a beat needs two beats or more, got {len(beats)}")
    moved = np.mod(beats.times + np.median(np.diff(beats.times)) / 2, beats.duration)
    times, first = np.unique(moved, return_index=True)
    return BeatTrack(times, beats.strengths[first], beats.fps, beats.duration)
