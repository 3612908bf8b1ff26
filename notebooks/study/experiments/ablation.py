"""The tables of notebooks 08 and 09: what the harmony loss buys and what it costs, over corpora and seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.significance import mean_interval
from harmolab.systems.harmogan.networks import generate_units
from study.experiments.generation import VARIANTS, Trained, generator_corpora, trained
from study.experiments.judging import RECORDED, judge, recorded_motions
from study.experiments.printed import printed
from study.profile import RunProfile

DISTANCES = ("fid", "fid_raw", "fid_kinetic")  # from the recorded motion

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
                rows.append({"corpus": corpus, "variant": name, "seed": seed, **judged(run, seed)})
            rows.append({"corpus": corpus, "variant": RECORDED, "seed": seed, **_recorded(runs["paper"], seed)})
    return pd.DataFrame(rows)


def judged(run: Trained, seed: int) -> dict[str, float]:
    """Measures of a generator's motion for the test units, as `study.experiments.judging.judge` has them."""
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
