"""Analysis of a study's answers: marks, agreement of raters, rates with intervals, correlation with scores.

A mark is four whole numbers from 0 to 10, one for each of four sides of a dance: naturalness, richness, music, sliding,
as in Music2Dance's study (Sec. 5.1). The mark of a dance is their weighted mean.

Every row of a table says in its field "simulated" whether the raters behind it were people; `answer_grid` refuses
answers of both.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.stats import rankdata

from harmolab.lab.listening.answers import Answers
from harmolab.lab.listening.trials import CHOICES, MARKED, Key, is_answer, marks_of
from harmolab.significance import auc, bootstrap_interval, bootstrap_interval_of, wilson_interval
from harmolab.types import BoolArray, FloatArray

# Marks for four sides of a dance (Music2Dance, Sec. 5.1), and agreement

WEIGHTS: Mapping[str, float] = MappingProxyType(dict(zip(MARKED, (0.25, 0.25, 0.4, 0.1), strict=True)))
MARK = "mark"
Row = dict[str, Any]
TABLES = ("raters", "versions", "marks", "agreement", "scores")  # all that `study_tables` may return


def side_marks(answers: Answers, key: Key) -> dict[str, FloatArray]:
    """Side of a dance -> (R, T) marks of raters (sorted) in the key's trials, the weighted one last; NaN for none.

    Raises
    ------
    ValueError
        If the answers are none, of another study, to trials that the key does not have, or mix people with simulated
        raters.
    """
    grid = _answer_table(answers, key, marks_of, len(MARKED))
    sides = {name: grid[..., place] for place, name in enumerate(MARKED)}
    return sides | {MARK: (grid * np.array([*WEIGHTS.values()])).sum(axis=2)}


def _answer_table(answers: Answers, key: Key, value_of: Callable[[str], Any], *shape: int) -> FloatArray:
    """(R, T, *shape) values of the choices of raters in the key's trials, NaN where there are none; checked."""
    if not answers.answers:
        raise ValueError("there are no answers to analyse")
    if len({answer.simulated for answer in answers.answers}) > 1:
        raise ValueError(
            "people and simulated raters in one analysis; analyse them apart: move answers/simulated-* away"
        )
    raters, trials = answers.raters, tuple(key.trials)
    table = np.full((len(raters), len(trials), *shape), math.nan)
    for answer in answers.answers:
        if answer.study != key.study:
            raise ValueError(f"answers of study {answer.study} do not go with the key of study {key.study}")
        if answer.trial not in trials or not is_answer(key.kind, answer.choice):
            raise ValueError(f"{answer.rater}: the key knows no answer {answer.choice!r} to trial {answer.trial!r:.60}")
        table[raters.index(answer.rater), trials.index(answer.trial)] = value_of(answer.choice)
    return table


def mark_rows(answers: Answers, key: Key, *, seed: int = 0) -> list[Row]:
    """The marks of a study of kind "rate": a row for each system and side of a dance, their weighted mean last.

    The sides are naturalness, richness, music and sliding, each from 0 to 10.

    Parameters
    ----------
    answers : Answers
    key : Key of the study
    seed : int
        Of the resamplings behind the intervals.

    Returns
    -------
    list of dict
        "version" (the system), "side", "n" (dances), "raters" (their number), "rate" (mean), "sd" over dances, "low"
        and "high" (95 % interval by a bootstrap over dances of their means over raters), "simulated". The paper prints
        means and SDs alone. The interval is for these raters: others may mark all dances higher. Of few dances it is
        too narrow: of two it holds the mean in .5 of simulated studies, of five in .83, of ten in .9.

    Raises
    ------
    ValueError
        As `answer_grid`.
    """
    sides = side_marks(answers, key)
    versions = [entry.versions[0] for entry in key.trials.values()]
    rows = []
    for version in sorted(set(versions)):
        columns = np.array([each == version for each in versions])
        for side, marks in sides.items():
            marked = columns & ~np.isnan(marks).all(axis=0)
            dances: FloatArray = np.nanmean(marks[:, marked], axis=0)
            low, high = bootstrap_interval(dances, seed=seed)
            rows.append(
                {
                    "version": version, "side": side, "n": int(dances.size), "raters": len(answers.raters),
                    "rate": float(dances.mean()) if dances.size else math.nan,
                    "sd": float(dances.std(ddof=1)) if dances.size > 1 else math.nan,
                    "low": low, "high": high, "simulated": answers.simulated,
                }
            )  # fmt: skip
    return rows


def krippendorff_alpha(marks: FloatArray) -> float:
    """Krippendorff's alpha of marks (R, T) for interval data; NaN where all marks are the same, or none are shared.

    Of two kinds of answer, 0 and 1, it is the alpha for nominal data. Trials with one answer do not count.

    >>> round(krippendorff_alpha(np.array([[1.0, 2, 3, 3], [1.0, 2, 3, 4]])), 3)
    0.889
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


def agreement_of_marks(answers: Answers, key: Key, *, seed: int = 0) -> Row:
    """Krippendorff's alpha of the weighted marks, with a bootstrap interval over dances; ValueError for one rater."""
    row = agreement("Krippendorff's alpha, marks", krippendorff_alpha, side_marks(answers, key)[MARK], seed=seed)
    return {**row, "simulated": answers.simulated}


def agreement(name: str, measure: Callable[[FloatArray], float], values: FloatArray, *, seed: int = 0) -> Row:
    """A measure of the agreement of raters, of (R, T) values, on the trials that two share at least.

    The interval is a bootstrap over trials, for these raters. Of 10 or 20 trials it holds the truth in .83 to .95 of
    simulated studies; of raters who answer by luck one interval in ten lies below 0. ValueError for one rater.
    """
    if len(values) < 2:
        raise ValueError("agreement needs two raters or more; merge their files first")
    shared = values[:, (~np.isnan(values)).sum(axis=0) > 1]
    low, high = bootstrap_interval_of(
        lambda drawn: [measure(shared[:, places]) for places in drawn], shared.shape[1], seed=seed
    )
    row = {"measure": name, "raters": len(values), "n": shared.shape[1]}
    return {**row, "rate": measure(shared), "low": low, "high": high}


# Tables of a study: raters, versions, agreement, correlation with scores


@dataclass(frozen=True, eq=False)
class Grid:
    """The answers of a study as a table of raters and trials.

    Parameters
    ----------
    second : (R, T) array, 1.0 where the rater gave the second of the two possible answers ("inharmonious", "right"),
        0.0 for the first, NaN where there is no answer
    raters : R names
    trials : T ids
    simulated : bool
    key : Key
    """

    second: FloatArray
    raters: tuple[str, ...]
    trials: tuple[str, ...]
    simulated: bool
    key: Key

    def right(self) -> FloatArray:
        """(R, T) array: 1.0 for a right answer, 0.0 for a wrong one, NaN where none was given or none is right."""
        first, second = CHOICES[self.key.kind]
        expected = [{first: 0.0, second: 1.0}.get(self.key.trials[one].right or "", math.nan) for one in self.trials]
        missing = np.isnan(self.second) | np.isnan(expected)
        return np.where(missing, math.nan, self.second == np.asarray(expected))


def answer_grid(answers: Answers, key: Key) -> Grid:
    """The answers of a study of kind "pick" or "choice" as a table of raters and trials, checked against the key.

    Parameters
    ----------
    answers : Answers
    key : Key of the study

    Returns
    -------
    Grid, which `rater_rows`, `version_rows`, `agreement_row` and `score_rows` take

    Raises
    ------
    ValueError
        If there are no answers, they are of another study, name a trial or a choice that the key does not have, or
        mix people with simulated raters.
    """
    second = _answer_table(answers, key, CHOICES[key.kind].index)
    return Grid(second, answers.raters, tuple(key.trials), answers.simulated, key)


def study_tables(
    answers: Answers, key: Key, scores: Mapping[str, Mapping[str, float]], *, seed: int = 0
) -> dict[str, list[Row]]:
    """The rows of all tables of a study by name; "raters" and "agreement" only where there are any.

    A study of marks has "marks", and "agreement" of several raters.
    """
    if key.kind == "rate":
        agreement = {} if len(answers.raters) < 2 else {"agreement": [agreement_of_marks(answers, key, seed=seed)]}
        return {"marks": mark_rows(answers, key, seed=seed), **agreement}
    grid = answer_grid(answers, key)
    tables = {
        "raters": rater_rows(grid) if any(entry.right for entry in key.trials.values()) else [],
        "versions": version_rows(grid),
        "agreement": [agreement_row(grid, seed=seed)] if len(grid.raters) > 1 else [],
        "scores": score_rows(grid, scores, seed=seed),
    }
    return {name: rows for name, rows in tables.items() if rows}


def _rate_row(hits: int, n: int, interval: tuple[float, float]) -> Row:
    return {"n": n, "rate": hits / n if n else math.nan, "low": interval[0], "high": interval[1]}


def wilson_rate(values: FloatArray) -> Row:
    """Share of ones among independent answers ("rate" of "n"), with Wilson's interval ("low", "high").

    NaN entries do not count; without answers the share and the interval are NaN.
    """
    answered = values[~np.isnan(values)]
    hits, n = int(answered.sum()), answered.size
    return _rate_row(hits, n, wilson_interval(hits, n))


def pooled_rate(values: FloatArray) -> Row:
    """Share of ones over raters and trials, with an interval for other raters and other trials of their kind.

    The fields are those of `wilson_rate`.

    Answers of one rater are alike, and so are answers to one trial. The variance of the mean is that of clusters by
    rater plus that of clusters by trial minus that of single answers (Cameron, Gelbach and Miller 2011), and never
    less than that of independent answers; with it, n answers are worth ``p (1 - p) / variance`` independent ones,
    from which Wilson's interval follows. A bootstrap that draws raters and trials at once would count the noise of
    single answers three times.

    Parameters
    ----------
    values : (R, T) array of 0, 1 and NaN
    """
    answered = ~np.isnan(values)
    hits, n = int(np.nansum(values)), int(answered.sum())
    if n == 0:
        return _rate_row(0, 0, (math.nan, math.nan))
    share = hits / n
    noise = share * (1 - share) / n
    residual = np.where(answered, values - share, 0.0)
    # By rater (axis 1) and by trial (axis 0).
    excess = {axis: max(_cluster_variance(residual, answered, axis) - noise, 0.0) for axis in (1, 0)}
    variance = noise + sum(excess.values())
    worth = share * (1 - share) / variance if variance > 0 else float(n)
    # Few raters tell little about the differences of raters: Student's quantile, by Satterthwaite's degrees of freedom.
    doubt = sum(part**2 / max(int(answered.any(axis).sum()) - 1, 1) for axis, part in excess.items())
    freedom = variance**2 / doubt if doubt > 0 else math.inf
    return _rate_row(hits, n, wilson_interval(share * worth, worth, freedom=freedom))


def _cluster_variance(residual: FloatArray, answered: BoolArray, axis: int) -> float:
    """Variance of the mean if the clusters along the other axis were drawn at random; 0 with fewer than two."""
    clusters = int(answered.any(axis).sum())
    if clusters < 2:
        return 0.0
    sums = residual.sum(axis)
    return float(clusters / (clusters - 1) * (sums**2).sum() / answered.sum() ** 2)


def rater_rows(grid: Grid) -> list[Row]:
    """The share of right answers: a row for each rater, and one for all of them.

    Parameters
    ----------
    grid : Grid of `answer_grid`

    Returns
    -------
    list of dict
        "rater", the rate and its 95 % interval: Wilson's for one rater; that of "all" holds for other raters and other
        trials of their kind.

    Raises
    ------
    ValueError
        If no trial has a right answer, as between two models; use `version_rows`.
    """
    right = grid.right()
    if np.isnan(right).all():
        raise ValueError("no trial of this study has a right answer; use version_rows")
    rows = [{"rater": name, **wilson_rate(values)} for name, values in zip(grid.raters, right, strict=True)]
    rows.append({"rater": "all", **pooled_rate(right)})
    return _labelled(rows, grid)


def version_rows(grid: Grid) -> list[Row]:
    """The answers by version: how often each was called inharmonious ("pick"), or preferred to another ("choice").

    Parameters
    ----------
    grid : Grid of `answer_grid`

    Returns
    -------
    list of dict
        "version" (the condition, or "A over B" for a pair of models), the rate and its 95 % interval, which holds for
        other raters and other trials of their kind.
    """
    pairs = [grid.key.trials[trial].versions for trial in grid.trials]
    rows = []
    for versions in sorted({tuple(sorted(pair)) for pair in pairs}):
        columns = np.array([tuple(sorted(pair)) == versions for pair in pairs])
        # The second answer says "inharmonious", or that the dance on the right is better.
        flipped = np.array([len(pair) == 2 and pair[1] != versions[0] for pair in pairs])
        choices = np.where(flipped[None, :], 1.0 - grid.second, grid.second)[:, columns]
        rows.append({"version": " over ".join(versions), **pooled_rate(choices)})
    return _labelled(rows, grid)


def cohen_kappa(first: FloatArray, second: FloatArray) -> float:
    """Cohen's kappa of two raters' answers to the same trials; NaN if chance alone would make them agree.

    >>> cohen_kappa(np.array([0.0, 0, 1, 1]), np.array([0.0, 0, 1, 0]))
    0.5
    """
    both = ~(np.isnan(first) | np.isnan(second))
    one, other = first[both], second[both]
    if one.size == 0:
        return math.nan
    by_chance = one.mean() * other.mean() + (1 - one.mean()) * (1 - other.mean())
    return float((np.mean(one == other) - by_chance) / (1 - by_chance)) if by_chance < 1 else math.nan


def agreement_row(grid: Grid, *, seed: int = 0) -> Row:
    """Agreement of the raters beyond chance: Cohen's kappa of two raters, Krippendorff's alpha of more.

    0 is chance, 1 full agreement.

    Parameters
    ----------
    grid : Grid of `answer_grid`
    seed : int
        Of the resamplings behind the interval.

    Returns
    -------
    dict
        "rate" (the number), "measure" (its name), "raters" and "n" (numbers of raters, and of trials that two share at
        least), "low" and "high" (95 % interval by a bootstrap over trials), "simulated"

    Raises
    ------
    ValueError
        With one rater.
    """
    if len(grid.raters) > 2:
        row = agreement("Krippendorff's alpha", krippendorff_alpha, grid.second, seed=seed)
    else:
        row = agreement("Cohen's kappa", lambda values: cohen_kappa(*values), grid.second, seed=seed)
    return _labelled([row], grid)[0]


def score_rows(grid: Grid, scores: Mapping[str, Mapping[str, float]], *, seed: int = 0) -> list[Row]:
    """Correlation of the answers with every score: which scores agree with the raters?

    Parameters
    ----------
    grid : Grid of `answer_grid`
    scores : dict
        Name of a score -> its value for every source (`Item.versions`); higher means more harmonious.
    seed : int
        Of the resamplings behind the intervals, a bootstrap over trials, for these raters. Of 10 trials or fewer they
        hold the truth in .8 to .95 of simulated studies.

    Returns
    -------
    list of dict, a row for each score
        "rank", "low" and "high": Spearman's correlation of the score with the share of raters who called the clip
        harmonious, and its 95 % interval. For "choice" it is that of the score of the dance on the right, less that of
        the left one, with the share who chose the right one. "point_biserial", "pb_low" and "pb_high": the same for
        single answers. And the AUC.

    Raises
    ------
    ValueError
        If a score lacks a source.
    """
    rows = []
    for name, values in scores.items():
        score = _trial_scores(grid, name, values)
        liked = grid.second if grid.key.kind == "choice" else 1.0 - grid.second
        defined = ~np.isnan(liked).all(0) & ~np.isnan(score)
        rows.append({"score": name, "n": int(defined.sum()), **_correlations(score[defined], liked[:, defined], seed)})
    return _labelled(rows, grid)


def _trial_scores(grid: Grid, name: str, values: Mapping[str, float]) -> FloatArray:
    """(T,) array: the score of the clip, or of the dance on the right less that of the left one."""
    sources = [grid.key.trials[one].sources for one in grid.trials]
    missing = sorted({source for one in sources for source in one} - set(values))
    if missing:
        raise ValueError(f"score {name!r} has no value for {missing[0]!r} ({len(missing)} missing)")
    return np.array([values[one[-1]] - (values[one[0]] if len(one) == 2 else 0.0) for one in sources])


def _correlations(score: FloatArray, liked: FloatArray, seed: int) -> Row:
    """Both correlations of (T,) scores with (R, T) answers, and the AUC of single answers."""
    share = np.nanmean(liked, axis=0) if score.size else np.empty(0)
    ranks = bootstrap_interval_of(lambda places: _rank(score[places], share[places]), score.size, seed=seed)
    singles = bootstrap_interval_of(lambda at: _point_biserial(score[at], liked[:, at]), score.size, seed=seed)
    scores = np.broadcast_to(score, liked.shape)
    return {
        "rank": float(_rank(score, share)),
        "low": ranks[0],
        "high": ranks[1],
        "point_biserial": float(_point_biserial(score, liked)),
        "pb_low": singles[0],
        "pb_high": singles[1],
        "auc": auc(scores[liked == 1], scores[liked == 0]),
    }


def _rank(score: FloatArray, share: FloatArray) -> FloatArray:
    """Spearman's correlation of (..., T) scores and shares."""
    return _pearson(rankdata(score, axis=-1), rankdata(share, axis=-1))


def _point_biserial(score: FloatArray, liked: FloatArray) -> FloatArray:
    """Correlation of (..., T) scores with all that is answered of (R, ..., T)."""
    both = np.broadcast_arrays(score[..., None], np.moveaxis(liked, 0, -1))
    return _pearson(*(one.reshape(*one.shape[:-2], -1) for one in both))


def _pearson(one: FloatArray, other: FloatArray) -> FloatArray:
    """Correlation along the last axis where both are numbers; NaN if either does not vary."""
    both = ~np.isnan(one + other)
    one, other = (np.where(both, values, 0.0) for values in (one, other))
    count = np.maximum(both.sum(axis=-1, keepdims=True), 1)
    one, other = (both * (values - values.sum(axis=-1, keepdims=True) / count) for values in (one, other))
    spread = np.sqrt(np.square(one).sum(axis=-1) * np.square(other).sum(axis=-1))
    return np.divide((one * other).sum(axis=-1), spread, out=np.full(spread.shape, math.nan), where=spread > 1e-12)


def _labelled(rows: Sequence[Row], grid: Grid) -> list[Row]:
    return [{**row, "simulated": grid.simulated} for row in rows]
