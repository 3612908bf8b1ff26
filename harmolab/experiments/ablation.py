"""The tables of notebooks 08, 09 and 11: what the harmony loss buys and what it costs, over corpora and seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import t as student

from harmolab.experiments.generation import VARIANTS, Trained, generator_corpora, trained, weight_sweep
from harmolab.experiments.judging import generate, judge, score_unit, unit_motion
from harmolab.params import HarmonyParams, RunProfile

__all__ = [
    "PAPER_MEANS",
    "RECORDED",
    "TARGETS",
    "ablation",
    "forced_choice",
    "gains",
    "mean_interval",
    "seed_means",
    "targets_met",
    "trade_off",
]

FloatArray = NDArray[np.float64]
Seeds = dict[str, dict[str, FloatArray]]  # side of a comparison -> measure -> one value a seed

RECORDED = "recorded"
LOSSES = ("paper", "recommended")
COVERAGE = 0.95
DISTANCES = ("fid", "fid_raw", "fid_kinetic")  # from the recorded motion

# What a harmony loss is asked for: (least, most) of each measure, compared as `TARGET_WORDS` says. Beats are speed
# valleys within 0.1 s.
TARGETS = MappingProxyType(
    {"above_chance": (0.35, np.inf), "count_ratio": (0.7, 1.4), "jerk": (-np.inf, 1.5), "fid": (-np.inf, 1.1)}
)
TARGET_WORDS = MappingProxyType(
    {
        "above_chance": "gain in harmony above chance",
        "count_ratio": "M / N",
        "jerk": "jerk / recorded jerk",
        "fid": "FID / FID without the loss",
    }
)

# Means over the seven dances of the paper's Tables 1 and 2 (Ballroom music; not comparable number by number).
PAPER_MEANS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "paper, without": MappingProxyType({"paper_harmony": 0.1993, "paper_hit_rate": 0.2396}),
        "paper": MappingProxyType({"paper_harmony": 0.3522, "paper_hit_rate": 0.7572}),
    }
)


def ablation(profile: RunProfile) -> pd.DataFrame:
    """Every measure of `harmolab.experiments.judging.judge` on the test units, for each corpus, variant and seed.

    Returns
    -------
    DataFrame with the columns corpus, variant, seed and the measures; the variant "recorded" is the recorded motion
    itself, judged with the same pose network.
    """
    return pd.DataFrame(list(_ablation_rows(profile)))


def _ablation_rows(profile: RunProfile) -> Iterator[dict[str, Any]]:
    for corpus in generator_corpora(profile):
        for seed in range(1, profile.n_seeds + 1):
            runs = {name: trained(profile, corpus, variant, seed) for name, variant in VARIANTS.items()}
            for name, run in runs.items():
                yield {"corpus": corpus, "variant": name, "seed": seed, **_judged(run, seed)}
            yield {"corpus": corpus, "variant": RECORDED, "seed": seed, **_recorded(runs["paper"], seed)}


def _judged(run: Trained, seed: int) -> dict[str, float]:
    """A generator's motion for the test units."""
    return judge(generate(run.generator, run.split.test), run.split.test, run.pose_net, seed=seed)


def _recorded(run: Trained, seed: int) -> dict[str, float]:
    """The recorded motion of the test units, under the same measures; it has no distance from itself."""
    units = run.split.test
    found = judge([unit.motion.astype(np.float64) for unit in units.units], units, run.pose_net, seed=seed)
    return found | dict.fromkeys(DISTANCES, np.nan)


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
    rows = []
    for (corpus, variant), part in table.groupby(["corpus", "variant"], sort=False):
        for measure in measures:
            mean, low, high = mean_interval(part[measure].to_numpy(np.float64))
            about = {"corpus": corpus, "variant": variant, "measure": measure, "mean": mean, "low": low, "high": high}
            rows.append({**about, "seeds": len(part), "paper": _printed(str(variant), measure)})
    return pd.DataFrame(rows)


def mean_interval(values: FloatArray) -> tuple[float, float, float]:
    """Mean of (n,) values and its 95 % interval by Student's t; NaN where there is one value, or an infinite one.

    >>> mean_interval(np.array([2.0]))
    (2.0, nan, nan)
    """
    if values.size < 2 or np.isinf(values).any():
        return float(values.mean()), np.nan, np.nan
    half = float(values.std(ddof=1) / np.sqrt(values.size) * student.ppf((1 + COVERAGE) / 2, values.size - 1))
    mean = float(values.mean())
    return mean, mean - half, mean + half


def _printed(variant: str, measure: str) -> float:
    """The paper's value; NaN where it prints none."""
    return PAPER_MEANS.get(variant, {}).get(measure, np.nan)


def gains(table: pd.DataFrame, measures: list[str]) -> pd.DataFrame:
    """What each harmony loss changed: the same seed with it and without it, means over seeds.

    Parameters
    ----------
    table : DataFrame, as `ablation` returns it
    measures : names of its columns

    Returns
    -------
    DataFrame with the columns corpus, loss ("paper" or "recommended"), measure, without, with, change, low, high (95 %
    interval of the change; NaN for a single seed), factor (NaN where `without` is not above 0), and the paper's own
    without, with and factor, NaN where it prints none.
    """
    rows = []
    for corpus, loss, seeds in _by_loss(table):
        for measure in measures:
            change, low, high = mean_interval(seeds["with"][measure] - seeds["without"][measure])
            before, after = (float(seeds[side][measure].mean()) for side in ("without", "with"))
            row = {"corpus": corpus, "loss": loss, "measure": measure, "without": before, "with": after}
            row |= {"change": change, "low": low, "high": high, "factor": _factor(after, before)}
            printed = _printed(f"{loss}, without", measure), _printed(loss, measure)
            row |= {"paper without": printed[0], "paper with": printed[1], "paper factor": _factor(*printed[::-1])}
            rows.append(row)
    return pd.DataFrame(rows)


def _factor(value: float, reference: float) -> float:
    """How many times the reference; NaN unless that is above 0."""
    return value / reference if reference > 0 else np.nan


def _by_loss(table: pd.DataFrame) -> Iterator[tuple[str, str, Seeds]]:
    """(corpus, loss, one value a seed of every measure "with" the loss, "without" it and "recorded")."""
    names = table.columns.difference(["corpus", "variant", "seed"])
    for corpus, part in table.groupby("corpus", sort=False):
        by_seed = part.sort_values("seed").set_index("variant")
        for loss in LOSSES:
            sides = {"with": loss, "without": f"{loss}, without", "recorded": RECORDED}
            rows = {side: by_seed.loc[[variant]] for side, variant in sides.items()}
            yield (
                str(corpus),
                loss,
                {side: {name: found[name].to_numpy(np.float64) for name in names} for side, found in rows.items()},
            )


def _ratio(value: float, reference: float) -> float:
    """value / reference. Nothing is a multiple of a reference that is not above 0: infinite, or 0 if it is no larger.

    A Frechet distance with its bias corrected can be slightly below 0 where two sets do not differ.
    """
    if np.isnan(value) or np.isnan(reference):
        return np.nan
    if reference > 0:
        return value / reference
    return np.inf if value > 0 else 0.0


def targets_met(table: pd.DataFrame) -> pd.DataFrame:
    """Which of `TARGETS` each harmony loss reaches on each corpus.

    Parameters
    ----------
    table : DataFrame, as `ablation` returns it

    Returns
    -------
    DataFrame with the columns corpus, loss, target, asked (in words), reached (mean over seeds), low, high (its 95 %
    interval; NaN for a single seed), met (by the mean), seeds that meet it (in words).
    """
    rows = []
    for corpus, loss, seeds in _by_loss(table):
        for measure, values in _reached(seeds).items():
            least, most = TARGETS[measure]
            mean, low, high = mean_interval(values)
            good = int(((values >= least) & (values <= most)).sum())
            row = {
                "corpus": corpus,
                "loss": loss,
                "target": TARGET_WORDS[measure],
                "asked": _asked(least, most),
                "reached": mean,
            }
            row |= {"low": low, "high": high, "met": bool(least <= mean <= most)}
            rows.append({**row, "seeds that meet it": f"{good} of {values.size}"})
    return pd.DataFrame(rows)


def _reached(seeds: Seeds) -> dict[str, FloatArray]:
    """One value a seed for each of `TARGETS`."""
    after, before, recorded = (seeds[side] for side in ("with", "without", "recorded"))
    return {
        "above_chance": after["above_chance"] - before["above_chance"],
        "count_ratio": after["count_ratio"],
        "jerk": after["jerk"] / recorded["jerk"],
        "fid": np.array([_ratio(*pair) for pair in zip(after["fid"], before["fid"], strict=True)]),
    }


def _asked(least: float, most: float) -> str:
    """A range in words."""
    if np.isinf(most):
        return f"at least {least:g}"
    return f"at most {most:g}" if np.isinf(least) else f"{least:g} to {most:g}"


def trade_off(profile: RunProfile, corpus: str) -> pd.DataFrame:
    """The recommended losses with the harmony term weighted from nothing to twice as much (first seed).

    Returns
    -------
    DataFrame, one row a weight: harmony_weight and every measure on the test units.
    """
    return pd.DataFrame(
        [{"harmony_weight": weight, **_judged(run, 1)} for weight, run in weight_sweep(profile, corpus)]
    )


def forced_choice(profile: RunProfile, corpus: str) -> pd.DataFrame:
    """Fig. 13 without people: for each pair of variants, how often a score prefers the first on the same test unit.

    Returns
    -------
    DataFrame, a row for each pair and judge (the paper's harmony; harmony above chance): first, second, judge, share
    that prefers the first (ties count half), n units
    """
    runs = {name: trained(profile, corpus, variant, 1) for name, variant in VARIANTS.items()}
    judges = {"paper's harmony": HarmonyParams.paper(), "above chance": HarmonyParams.valleys()}
    scores = {
        (name, judge): _unit_scores(run, params) for name, run in runs.items() for judge, params in judges.items()
    }
    rows = []
    for first, second in combinations(VARIANTS, 2):
        for name in judges:
            better = np.sign(scores[first, name] - scores[second, name])
            rows.append({"first": first, "second": second, "judge": name, "share": (1 + better).mean() / 2})
    return pd.DataFrame(rows).assign(n=len(runs["paper"].split.test))


def _unit_scores(run: Trained, params: HarmonyParams) -> np.ndarray[Any, np.dtype[np.float64]]:
    """One score a test unit: the paper's harmony in paper mode, else harmony above chance."""
    units = run.split.test
    pairs = zip(generate(run.generator, units), units.units, strict=True)
    found = [score_unit(unit_motion(code, units), unit, params) for code, unit in pairs]
    paper = params == HarmonyParams.paper()
    return np.array([score.harmony if paper else score.harmony_above_chance for score in found])
