"""Notebook 08: how far generated motion is from recorded motion, and how far recorded motions are apart (Fig. 9-10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.metrics.features import frechet_distance, geometric_features, kinetic_features, multimodality, standardise
from harmolab.metrics.quality import freezing, pfc, relative_jerk
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.pose_network import embed_meters
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import FloatArray, Motion
from study.experiments.ablation import ablation, seed_means
from study.experiments.generation import VARIANTS, Trained, generator_corpora, trained
from study.experiments.judging import RECORDED, DancedUnit, danced, danced_units, meter_motions, recorded_motions
from study.profile import RunProfile

HALVES, OTHER_FIGURES, FROZEN = "recorded, halves", "recorded, other figures", "recorded, frozen"
DISTANCES = ("fid", "fid_kinetic")
HARMONIES = ("above_chance", "body_above_chance", "statue_above_chance")  # of speed valleys, see `judging.unit_columns`
MEASURES = (*DISTANCES, "diversity", "jerk", "foot_skating", *HARMONIES)
BY_METER = (freezing, pfc, relative_jerk)
DRAWS = 40
COVERAGE = (2.5, 97.5)  # per cent of the draws that an interval holds


def motion_quality(profile: RunProfile) -> pd.DataFrame:
    """Means over seeds of what tells natural movement, for generated and for recorded test units.

    Returns
    -------
    DataFrame with the columns corpus, variant, measure, mean, low, high, seeds as `seed_means` gives them, and seed 1,
    seed 2, ...: the values of single trainings. Recorded motion has no distance from itself: its Frechet distances are
    those of `recorded_distances`, whose intervals hold 95 % of the draws.
    """
    table = ablation(profile)
    keys = ["corpus", "variant", "measure"]
    each = table.melt(["corpus", "variant", "seed"], list(MEASURES), "measure")
    each = each.pivot(index=keys, columns="seed", values="value").add_prefix("seed ").reset_index()
    means = seed_means(table, list(MEASURES)).drop(columns="paper").dropna(subset="mean").merge(each, on=keys)
    floors = [
        recorded_distances(trained(profile, corpus, VARIANTS["paper"], seed), seed=seed).assign(corpus=corpus)
        for corpus in generator_corpora(profile)
        for seed in range(1, profile.n_seeds + 1)
    ]
    floor = pd.concat(floors).groupby(keys, sort=False)[["mean", "low", "high"]].mean().reset_index()
    return pd.concat([means, floor.assign(seeds=profile.n_seeds)], ignore_index=True)


def recorded_distances(run: Trained, *, seed: int = 0) -> pd.DataFrame:
    """Frechet distances between recorded motions, with the pose network and the units of a training.

    "recorded, halves": between two random halves of the test units, where 0 is the truth. "recorded, other figures":
    from as many random training units, of figures that the test does not have, to the test units: real dance, but not
    the same dance.

    Returns
    -------
    DataFrame with the columns variant, measure, and mean, low, high over the draws
    """
    rng = np.random.default_rng(seed)
    test, train = run.split.test, run.split.train
    disjoint = train.select(np.array([not unit.extra for unit in train.units]))  # additional units overlap others
    features = [_features(units, run) for units in (test, disjoint if len(disjoint) >= len(test) else train)]
    rows: list[dict[str, Any]] = []
    for measure in DISTANCES:
        own, other = (values[measure] for values in features)
        if measure == "fid_kinetic":
            own, other = standardise(own, own), standardise(other, own)
        halves = [_halves(own, rng) for _ in range(DRAWS)]
        figures = [_others(own, other, rng) for _ in range(DRAWS)]
        for variant, values in ((HALVES, halves), (OTHER_FIGURES, figures)):
            low, high = np.percentile(values, COVERAGE).tolist()
            row = {"variant": variant, "measure": measure, "mean": float(np.mean(values))}
            rows.append({**row, "low": low, "high": high})
    return pd.DataFrame(rows)


def _features(units: UnitSet, run: Trained) -> dict[str, FloatArray]:
    """Features (N, D) of the recorded motion of units."""
    motions = recorded_motions(units)
    kinetic = np.stack([kinetic_features(motion) for motion in meter_motions(motions, units)])
    return {"fid": embed_meters(motions, units, run.pose_net), "fid_kinetic": kinetic}


def motion_measures(profile: RunProfile) -> pd.DataFrame:
    """Other measures of the field, which need no training, of the test units' meters: recorded, generated, frozen.

    "recorded, frozen" holds the first pose of each meter: what a measure says of no dance at all.

    Returns
    -------
    DataFrame, a row for each corpus and variant (first seed): corpus, variant; freezing (share of time), pfc (m^2/s^2)
    and relative_jerk (1/s^2), means over meters; on the 32 geometric features, in standard deviations of the recorded
    ones, fid_geometric (NaN for recorded motion, which has no distance from itself) and multimodality (among the meters
    of one song, mean over songs; NaN where no song has two).
    """
    rows = []
    for corpus in generator_corpora(profile):
        units, dances = danced_units(profile, corpus)
        meters = {name: meter_motions(motions, units) for name, motions in dances.items()}
        meters[FROZEN] = [replace(motion, positions=_held(motion)) for motion in meters[RECORDED]]
        reference = _geometric(meters[RECORDED])
        for name, motions in meters.items():
            row = {measure.__name__: float(np.mean([measure(motion) for motion in motions])) for measure in BY_METER}
            features = standardise(_geometric(motions), reference)
            distance = frechet_distance(features, standardise(reference, reference)).value
            row["fid_geometric"] = np.nan if name == RECORDED else distance
            rows.append({"corpus": corpus, "variant": name, **row, "multimodality": _within_songs(features, units)})
    return pd.DataFrame(rows)


def _geometric(motions: Sequence[Motion]) -> FloatArray:
    """Geometric features (N, 32) of motions."""
    return np.stack([geometric_features(motion) for motion in motions])


def _held(motion: Motion) -> FloatArray:
    """The first pose of a motion for all of its frames."""
    return np.repeat(motion.positions[:1], motion.n_frames, axis=0)


def _within_songs(features: FloatArray, units: UnitSet) -> float:
    """`multimodality` of (N, D) features, one row a unit; NaN where no song has two units."""
    songs = np.array([unit.sequence for unit in units.units])
    groups = [features[songs == song] for song in dict.fromkeys(songs) if (songs == song).sum() > 1]
    return multimodality(groups) if groups else np.nan


def _halves(features: FloatArray, rng: np.random.Generator) -> float:
    """Distance between two random halves of (N, D)."""
    first, second = np.array_split(rng.permutation(features), 2)
    return frechet_distance(first, second, seed=int(rng.integers(2**31))).value


def _others(features: FloatArray, others: FloatArray, rng: np.random.Generator) -> float:
    """Distance from as many random rows of `others` to (N, D)."""
    rows = rng.choice(len(others), min(len(features), len(others)), replace=False)
    return frechet_distance(others[rows], features, seed=int(rng.integers(2**31))).value


def typical_unit(profile: RunProfile, corpus: str, variants: tuple[str, ...] = ("paper", "recommended")) -> DancedUnit:
    """The test unit on which the first variant (first seed) is neither good nor bad: its error is the median.

    The error is the mean distance of the joints from where they were recorded, over the meter, in the dancer's frame.
    """
    units, dances = danced_units(profile, corpus, variants)
    errors = [_error(*trio) for trio in zip(dances[variants[0]], dances[RECORDED], units.units, strict=True)]
    place = int(np.argsort(errors, kind="stable")[len(errors) // 2])
    return danced(units.units[place], {name: motions[place] for name, motions in dances.items()})


def _error(motion: Motion, recorded: Motion, unit: DanceUnit) -> float:
    """Mean distance of a joint from its recorded place in the dancer's frame, over the meter; metres."""
    codes = [encode_motion(each.positions, each.fps, each.skeleton) for each in (motion, recorded)]
    apart = (codes[0] - codes[1])[unit.n_prior :, : 3 * len(motion.skeleton.joints)].astype(np.float64)
    return float(np.linalg.norm(apart.reshape(-1, 3), axis=1).mean())
