"""The tables of notebooks 08 and 09: what the harmony loss buys and what it costs, over corpora and seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.significance import mean_interval
from harmolab.systems.harmogan.networks import generate_units
from study.experiments.generation import VARIANTS, Trained, generator_corpora, trained, weight_sweep
from study.experiments.judging import RECORDED, judge, recorded_motions
from study.experiments.printed import printed
from study.profile import RunProfile

LOSSES = ("paper", "recommended")
DISTANCES = ("fid", "fid_raw", "fid_kinetic")  # from the recorded motion

# Aims of a harmony loss: (least, most) of each measure, compared as `TARGET_WORDS` says. Beats are speed
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

# Row of the paper's Tables 1 and 2 that each variant stands beside.
_PRINTED_ROWS = MappingProxyType(
    {"paper, without": "HarmoGAN without L_harmo", "paper": "HarmoGAN", "lee2019": "Lee", "ren2020": "Ren"}
)

# Means over the seven dances of the paper's Tables 1 and 2 (Ballroom music; not comparable number by number).
PAPER_MEANS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        variant: MappingProxyType(
            {
                f"paper_{measure}": round(printed(name, row), 4)
                for measure, name in (("harmony", "h"), ("hit_rate",) * 2)
            }
        )
        for variant, row in _PRINTED_ROWS.items()
    }
)


def ablation(profile: RunProfile) -> pd.DataFrame:
    """Measures of `study.experiments.judging.judge` on the test units, for each corpus, variant and seed.

    Returns
    -------
    DataFrame with the columns corpus, variant, seed and the measures; the variant "recorded" is the recorded motion
    itself, judged with the same pose network.
    """
    rows = []
    for corpus in generator_corpora(profile):
        for seed in range(1, profile.n_seeds + 1):
            runs = {name: trained(profile, corpus, variant, seed) for name, variant in VARIANTS.items()}
            for name, run in runs.items():
                rows.append({"corpus": corpus, "variant": name, "seed": seed, **_judged(run, seed)})
            rows.append({"corpus": corpus, "variant": RECORDED, "seed": seed, **_recorded(runs["paper"], seed)})
    return pd.DataFrame(rows)


def _judged(run: Trained, seed: int) -> dict[str, float]:
    """A generator's motion for the test units."""
    return judge(generate_units(run.generator, run.split.test), run.split.test, run.pose_net, seed=seed)


def _recorded(run: Trained, seed: int) -> dict[str, float]:
    """The recorded motion of the test units, under the same measures; it has no distance from itself."""
    units = run.split.test
    measures = judge(recorded_motions(units), units, run.pose_net, seed=seed)
    return measures | dict.fromkeys(DISTANCES, np.nan)


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
    return means.assign(paper=[_printed(variant, measure) for variant, measure in pairs])


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


def _printed(variant: str, measure: str) -> float:
    """The paper's value; NaN where it prints none."""
    return PAPER_MEANS.get(variant, {}).get(measure, np.nan)


def gains(table: pd.DataFrame, measures: list[str]) -> pd.DataFrame:
    """Changes by each harmony loss: the same seed with it and without it, means over seeds.

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
            before, after = (seeds[side][measure].mean(skipna=False) for side in ("without", "with"))
            row = {"corpus": corpus, "loss": loss, "measure": measure, "without": before, "with": after}
            row |= {"change": change, "low": low, "high": high, "factor": _factor(after, before)}
            without, with_it = _printed(f"{loss}, without", measure), _printed(loss, measure)
            row |= {"paper without": without, "paper with": with_it, "paper factor": _factor(with_it, without)}
            rows.append(row)
    return pd.DataFrame(rows)


def _factor(value: float, reference: float) -> float:
    """`value` as a multiple of the reference; NaN unless that is above 0."""
    return value / reference if reference > 0 else np.nan


def _by_loss(table: pd.DataFrame) -> Iterator[tuple[str, str, dict[str, pd.DataFrame]]]:
    """(corpus, loss, one row a seed "with" the loss, "without" it and "recorded", all in the order of the seeds)."""
    for corpus, part in table.groupby("corpus", sort=False):
        by_variant = {name: rows.reset_index(drop=True) for name, rows in part.sort_values("seed").groupby("variant")}
        for loss in LOSSES:
            sides = {"with": loss, "without": f"{loss}, without", "recorded": RECORDED}
            yield str(corpus), loss, {side: by_variant[variant] for side, variant in sides.items()}


def _ratio(value: float, reference: float) -> float:
    """value / reference. Nothing is a multiple of a reference that is not above 0: infinite, or 0 if it is no larger.

    A Frechet distance with its bias corrected can be slightly below 0 where two sets do not differ.
    """
    if reference > 0 or np.isnan(value + reference):
        return value / reference
    return np.inf if value > 0 else 0.0


def targets_met(table: pd.DataFrame) -> pd.DataFrame:
    """The `TARGETS` that each harmony loss reaches on each corpus.

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
            row: dict[str, Any] = {"corpus": corpus, "loss": loss, "target": TARGET_WORDS[measure]}
            row |= {"asked": _range_text(least, most), "reached": mean, "low": low, "high": high}
            row["met"] = bool(least <= mean <= most)
            rows.append({**row, "seeds that meet it": f"{good} of {len(values)}"})
    return pd.DataFrame(rows)


def _reached(seeds: Mapping[str, pd.DataFrame]) -> dict[str, pd.Series[float]]:
    """One value a seed for each of `TARGETS`."""
    after, before, recorded = (seeds[side] for side in ("with", "without", "recorded"))
    return {
        "above_chance": after["above_chance"] - before["above_chance"],
        "count_ratio": after["count_ratio"],
        "jerk": after["jerk"] / recorded["jerk"],
        "fid": pd.Series([_ratio(*pair) for pair in zip(after["fid"], before["fid"], strict=True)]),
    }


def _range_text(least: float, most: float) -> str:
    """A range in words."""
    if np.isinf(most):
        return f"at least {least:g}"
    return f"at most {most:g}" if np.isinf(least) else f"{least:g} to {most:g}"


def trade_off(profile: RunProfile) -> pd.DataFrame:
    """The recommended losses with the harmony term weighted from nothing to twice as much (first seed).

    Returns
    -------
    DataFrame, one row for each corpus and weight: corpus, harmony_weight and every measure on the test units.
    """
    rows = [
        {"corpus": corpus, "harmony_weight": weight, **_judged(run, 1)}
        for corpus in generator_corpora(profile)
        for weight, run in weight_sweep(profile, corpus)
    ]
    return pd.DataFrame(rows)
