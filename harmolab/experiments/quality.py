"""Notebook 08: how far generated motion is from recorded motion, and how far recorded motions are apart (Fig. 9-10)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from harmolab.data.units import UnitSet
from harmolab.experiments.ablation import RECORDED, ablation, seed_means
from harmolab.experiments.generation import VARIANTS, Trained, generator_corpora, trained
from harmolab.experiments.judging import embed, generate, meter_motion, unit_motion
from harmolab.features.kinetic import kinetic_features
from harmolab.metrics import frechet_distance, standardise
from harmolab.params import RunProfile
from harmolab.types import Motion

__all__ = ["HALVES", "OTHER_FIGURES", "Example", "motion_quality", "recorded_distances", "typical_unit"]

FloatArray = NDArray[np.float64]

HALVES, OTHER_FIGURES = "recorded, halves", "recorded, other figures"
DISTANCES = ("fid", "fid_kinetic")
MEASURES = (*DISTANCES, "diversity", "jerk", "foot_skating")
DRAWS = 40
COVERAGE = (2.5, 97.5)  # per cent of the draws that an interval holds


def motion_quality(profile: RunProfile) -> pd.DataFrame:
    """Means over seeds of what tells natural movement, for generated and for recorded test units.

    Returns
    -------
    DataFrame with the columns corpus, variant, measure, mean, low, high, seeds as `seed_means` gives them. Recorded
    motion has no distance from itself: its Frechet distances are those of `recorded_distances`, whose intervals hold
    95 % of the draws.
    """
    means = seed_means(ablation(profile), list(MEASURES)).drop(columns="paper").dropna(subset="mean")
    floors = [
        recorded_distances(trained(profile, corpus, VARIANTS["paper"], seed), seed=seed).assign(corpus=corpus)
        for corpus in generator_corpora(profile)
        for seed in range(1, profile.n_seeds + 1)
    ]
    keys = ["corpus", "variant", "measure"]
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
    apart = train.select(np.array([not unit.extra for unit in train.units]))  # additional units overlap others
    mine, others = (_features(units, run) for units in (test, apart if len(apart) >= len(test) else train))
    rows: list[dict[str, Any]] = []
    for measure in DISTANCES:
        here, there = mine[measure], others[measure]
        if measure == "fid_kinetic":
            here, there = standardise(here, here), standardise(there, here)
        halves = [_halves(here, rng) for _ in range(DRAWS)]
        figures = [_others(here, there, rng) for _ in range(DRAWS)]
        rows.append({"variant": HALVES, "measure": measure, **_over_draws(halves)})
        rows.append({"variant": OTHER_FIGURES, "measure": measure, **_over_draws(figures)})
    return pd.DataFrame(rows)


def _features(units: UnitSet, run: Trained) -> dict[str, FloatArray]:
    """Features (N, D) of the recorded motion of units."""
    codes = [unit.motion.astype(np.float64) for unit in units.units]
    meters = [meter_motion(code, unit, units) for code, unit in zip(codes, units.units, strict=True)]
    kinetic = np.stack([kinetic_features(motion) for motion in meters])
    return {"fid": embed(codes, units, run.pose_net), "fid_kinetic": kinetic}


def _over_draws(values: Sequence[float]) -> dict[str, float]:
    """Mean and interval."""
    low, high = np.percentile(values, COVERAGE)
    return {"mean": float(np.mean(values)), "low": float(low), "high": float(high)}


def _halves(features: FloatArray, rng: np.random.Generator) -> float:
    """Distance between two random halves of (N, D)."""
    first, second = np.array_split(rng.permutation(features), 2)
    return frechet_distance(first, second, seed=int(rng.integers(2**31))).value


def _others(features: FloatArray, others: FloatArray, rng: np.random.Generator) -> float:
    """Distance from as many random rows of `others` to (N, D)."""
    chosen = rng.choice(len(others), min(len(features), len(others)), replace=False)
    return frechet_distance(others[chosen], features, seed=int(rng.integers(2**31))).value


@dataclass(frozen=True, eq=False)
class Example:
    """One test unit, as danced and as generated. Up to `start` (seconds) all were given the same movement."""

    name: str
    dance: str
    start: float
    motions: dict[str, Motion]


def typical_unit(profile: RunProfile, corpus: str, variants: tuple[str, ...] = ("paper", "recommended")) -> Example:
    """The test unit on which the first variant (first seed) is neither good nor bad: its error is the median.

    The error is the mean distance of the joints from where they were recorded, over the meter, in the dancer's frame.
    """
    runs = {name: trained(profile, corpus, VARIANTS[name], 1) for name in variants}
    units = runs[variants[0]].split.test
    errors = list(_errors(runs[variants[0]], units))
    place = int(np.argsort(errors, kind="stable")[len(errors) // 2])
    chosen = units.units[place]
    motions = {RECORDED: unit_motion(chosen.motion.astype(np.float64), units)}
    for name, run in runs.items():
        unit = run.split.test.select({chosen.name})
        motions[name] = unit_motion(generate(run.generator, unit)[0], unit)
    return Example(chosen.name, chosen.dance, chosen.n_prior / units.features.fps, motions)


def _errors(run: Trained, units: UnitSet) -> Iterator[float]:
    """Mean distance of a joint from its recorded place, metres, one for each unit."""
    n_local = 3 * len(units.skeleton.joints)
    for code, unit in zip(generate(run.generator, units), units.units, strict=True):
        apart = (code - unit.motion)[unit.n_prior :, :n_local].reshape(-1, 3)
        yield float(np.linalg.norm(apart, axis=1).mean())
