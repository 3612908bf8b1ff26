"""Marks from 0 to 10 for four sides of a dance, as in Music2Dance's study (Table 3), and what they add up to.

An answer is four whole numbers: naturalness, richness, music, sliding. The mark of a dance is their weighted mean.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.lab.listening.answers import Answers
from harmolab.lab.listening.trials import MARKED, Key, marks_of
from harmolab.significance import bootstrap_interval_of
from harmolab.types import FloatArray, IntArray

WEIGHTS: Mapping[str, float] = MappingProxyType(dict(zip(MARKED, (0.25, 0.25, 0.4, 0.1), strict=True)))
MARK = "mark"


def mark_grid(answers: Answers, key: Key) -> tuple[FloatArray, tuple[str, ...]]:
    """(R, T, 4) marks of raters (sorted) and the key's trials, NaN where there are none; and the raters.

    Raises
    ------
    ValueError
        If the answers are none, of another study, to trials that the key does not have, or mix people with simulated
        raters.
    """
    if not answers.answers or len({answer.simulated for answer in answers.answers}) > 1:
        raise ValueError("marks need answers, of people or of simulated raters, not of both")
    raters, trials = answers.raters, tuple(key.trials)
    grid = np.full((len(raters), len(trials), len(MARKED)), math.nan)
    for answer in answers.answers:
        if answer.study != key.study or answer.trial not in trials:
            raise ValueError(
                f"{answer.rater}: the key knows no trial {answer.trial!r:.60} of study {answer.study!r:.20}"
            )
        grid[raters.index(answer.rater), trials.index(answer.trial)] = marks_of(answer.choice)
    return grid, raters


def mark_rows(answers: Answers, key: Key, *, seed: int = 0) -> list[dict[str, Any]]:
    """A row for each system and side of a dance, the weighted mark last: mean, SD over dances, 95 % interval.

    The interval is a bootstrap over dances of their means over raters. The paper prints means and SDs alone.
    """
    grid, raters = mark_grid(answers, key)
    weighted = (grid * np.array([*WEIGHTS.values()])).sum(axis=2)
    sides = {**{name: grid[..., place] for place, name in enumerate(MARKED)}, MARK: weighted}
    versions = [entry.versions[0] for entry in key.trials.values()]
    rows = []
    for version in sorted(set(versions)):
        columns = np.array([each == version for each in versions])
        for side, marks in sides.items():
            dances = _over_raters(marks[:, columns])
            low, high = bootstrap_interval_of(partial(_mean_at, dances), dances.size, seed=seed)
            rows.append(
                {
                    "version": version, "side": side, "n": int(dances.size), "raters": len(raters),
                    "rate": float(dances.mean()) if dances.size else math.nan,
                    "sd": float(dances.std(ddof=1)) if dances.size > 1 else math.nan,
                    "low": low, "high": high, "simulated": answers.simulated,
                }
            )  # fmt: skip
    return rows


def _mean_at(values: FloatArray, places: IntArray) -> float:
    return float(values[places].mean())


def _over_raters(marks: FloatArray) -> FloatArray:
    """Means over raters (D',) of marks (R, D); dances without any are left out."""
    answered = ~np.isnan(marks).all(axis=0)
    means: FloatArray = np.nanmean(marks[:, answered], axis=0)
    return means


def interval_alpha(marks: FloatArray) -> float:
    """Krippendorff's alpha of marks (R, T) for interval data; NaN where all marks are the same, or none are shared.

    >>> round(interval_alpha(np.array([[1.0, 2, 3, 3], [1.0, 2, 3, 4]])), 3)
    0.906
    """
    counts = (~np.isnan(marks)).sum(axis=0)
    shared = marks[:, counts > 1]
    values = shared[~np.isnan(shared)]
    if values.size < 2 or values.var() == 0:
        return math.nan
    means = np.nanmean(shared, axis=0)
    within = np.nansum((shared - means) ** 2, axis=0) / (counts[counts > 1] - 1)
    observed = (within * counts[counts > 1]).sum() / values.size
    return float(1 - observed / values.var(ddof=1))


def agreement_of_marks(answers: Answers, key: Key, *, seed: int = 0) -> dict[str, Any]:
    """Krippendorff's alpha of the weighted marks, with a bootstrap interval over dances; ValueError for one rater."""
    grid, raters = mark_grid(answers, key)
    if len(raters) < 2:
        raise ValueError("agreement needs two raters or more; merge their files first")
    marks = (grid * np.array([*WEIGHTS.values()])).sum(axis=2)
    shared = marks[:, (~np.isnan(marks)).sum(axis=0) > 1]
    low, high = bootstrap_interval_of(lambda at: interval_alpha(shared[:, at]), shared.shape[1], seed=seed)
    row = {"measure": "Krippendorff's alpha, marks", "raters": len(raters), "n": shared.shape[1]}
    return {**row, "rate": interval_alpha(shared), "low": low, "high": high, "simulated": answers.simulated}
