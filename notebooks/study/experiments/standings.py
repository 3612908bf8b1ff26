"""Tables of a comparison: by dance (Tables 1 and 2), by system (Fig. 12), and differences to HarmoGAN.

Intervals hold 95 %. By dance they are over songs (bootstrap of the mean over draws and trainings). Of means over dances
they are over trainings (Student's t), and of what was not trained over songs, drawn anew within each dance. One
training has no interval.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from harmolab.metrics.features import diversity, frechet_distance, multimodality, standardise
from harmolab.significance import LEVEL, bootstrap_interval, mean_interval
from harmolab.types import FloatArray
from study.experiments.comparison import Entry, facts, long_table
from study.experiments.contestants import HARMOGAN, RIGHT_SONG, ROWS
from study.experiments.measuring import Measured, processor, reference
from study.experiments.printed import MEAN, printed

CHANCES = {"h": "h_chance", "hit_rate": "hit_chance"}  # measure -> that of as many beats at random moments
GROUP = ["music", "corpus", "system"]
RESAMPLINGS = 1000
LEAST = 30  # pieces or dances on either side of a Frechet distance; fewer tell nothing
RATIOS = ("jerk", "skating", "speed")


def table_by_dance(dances: pd.DataFrame, measure: str) -> pd.DataFrame:
    """One measure of every system by dance, and its mean over dances (Tables 1 and 2).

    Parameters
    ----------
    dances : DataFrame of `comparison.long_table`
    measure : "h" or "hit_rate", or another of its columns (then without chance)

    Returns
    -------
    DataFrame with the columns music, corpus, system, dance ("mean" in the last row of each system), mean, low, high,
    "interval over" ("songs", "trainings" or "" where there is none), chance, clips, trainings, paper
    """
    rows = []
    chance = CHANCES.get(measure)
    for names, part in dances.groupby(GROUP, sort=False):
        about = dict(zip(GROUP, names, strict=True))
        clips, count = _over_draws(part, [measure, *([chance] if chance else [])]), part["training"].nunique()
        for dance, own in clips.groupby("dance", sort=False):
            songs = own.groupby("song")[measure].agg(["mean", "size"])
            low, high = bootstrap_interval(songs["mean"], songs["size"])
            row = {"dance": dance, "mean": own[measure].mean(), "low": low, "high": high}
            row |= {"interval over": "songs" if np.isfinite(low) else ""}
            rows.append({**about, **row, **_beside(own, chance), "trainings": count})
            rows[-1]["paper"] = printed(measure, ROWS[str(names[-1])].printed, str(dance))
        row = {"dance": MEAN, **mean_over_dances(part, measure), **_beside(clips, chance), "trainings": count}
        rows.append({**about, **row, "paper": printed(measure, ROWS[str(names[-1])].printed)})
    return pd.DataFrame(rows)


def _over_draws(part: pd.DataFrame, measures: Sequence[str], *more: str) -> pd.DataFrame:
    """Means over draws, and trainings unless "training" is among `more`: a row a clip, its dance and song."""
    return part.groupby(["dance", "song", "clip", *more], sort=False)[list(measures)].mean().reset_index()


def _beside(clips: pd.DataFrame, chance: str | None) -> dict[str, float]:
    """Chance, mean over dances, and the number of clips."""
    mean = float("nan") if chance is None else clips.groupby("dance")[chance].mean().mean()
    return {"chance": mean, "clips": clips["clip"].nunique()}


def mean_over_dances(part: pd.DataFrame, measure: str) -> dict[str, Any]:
    """Mean over dances of one system's measure: mean, low, high and "interval over".

    Parameters
    ----------
    part : rows of `comparison.long_table` of one system in one contest
    """
    system = str(part["system"].iloc[0])
    by_training = _over_draws(part, [measure], "training").groupby(["training", "dance"])[measure].mean()
    means = by_training.groupby("training").mean()
    if ROWS[system].is_trained:
        mean, low, high = mean_interval(means)
        return {"mean": mean, "low": low, "high": high, "interval over": "trainings" if np.isfinite(low) else ""}
    low, high = within_dances(_over_draws(part, [measure]), measure)
    return {"mean": means.mean(), "low": low, "high": high, "interval over": "songs" if np.isfinite(low) else ""}


def within_dances(clips: pd.DataFrame, measure: str) -> tuple[float, float]:
    """Percentile interval of the mean over dances, songs drawn anew within each dance; NaN where each has one song.

    Parameters
    ----------
    clips : a row a clip: dance, song and the measure
    """
    rng = np.random.default_rng(0)
    total, dances = np.zeros(RESAMPLINGS), 0
    several = False
    for _, own in clips.dropna(subset=measure).groupby("dance", sort=False):
        songs = own.groupby("song", sort=False)[measure].agg(["sum", "size"]).to_numpy(np.float64)
        drawn = songs[rng.integers(0, len(songs), (RESAMPLINGS, len(songs)))].sum(axis=1)
        total, dances, several = total + drawn[:, 0] / drawn[:, 1], dances + 1, several or len(songs) > 1
    if not several:
        return float("nan"), float("nan")
    low, high = np.quantile(total / dances, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def difference_table(dances: pd.DataFrame, measures: Sequence[str], base: str = HARMOGAN) -> pd.DataFrame:
    """Every system less HarmoGAN with the paper's loss, clip by clip, mean over dances.

    Returns
    -------
    DataFrame with the columns music, corpus, system, measure, difference; low and high over trainings (Student's t, the
    same number of training on both sides; NaN for one); "low over songs" and "high over songs"; rank: "above" or
    "below" where both intervals exclude 0, else ""
    """
    rows = []
    for names, contest in dances.groupby(["music", "corpus"], sort=False):
        own = contest[contest["system"] == base]
        for system, part in contest.groupby("system", sort=False):
            for measure in measures if len(own) and system != base else ():
                about = {**dict(zip(GROUP, (*names, system), strict=True)), "measure": measure}
                rows.append({**about, **_difference(part, own, measure)})
    columns = [*GROUP, "measure", "difference", "low", "high", "low over songs", "high over songs", "rank"]
    return pd.DataFrame(rows, columns=columns)


def _difference(part: pd.DataFrame, base: pd.DataFrame, measure: str) -> dict[str, Any]:
    """One row of `difference_table`."""
    keys = ["dance", "song", "clip"]
    left, right = (_over_draws(side, [measure], "training") for side in (part, base))
    if not ROWS[str(part["system"].iloc[0])].is_trained:
        left = left.drop(columns="training")
    paired = left.merge(right, on=[name for name in (*keys, "training") if name in left], suffixes=("", " base"))
    paired = paired.assign(**{measure: paired[measure] - paired[f"{measure} base"]})
    by_training = paired.groupby(["training", "dance"])[measure].mean().groupby("training").mean()
    mean, low, high = mean_interval(by_training)
    below, above = within_dances(_over_draws(paired, [measure]), measure)
    rank = "above" if min(low, below) > 0 else "below" if max(high, above) < 0 else ""
    row = {"difference": mean, "low": low, "high": high, "low over songs": below, "high over songs": above}
    return {**row, "rank": rank if np.isfinite([low, below]).all() else ""}


def system_table(entries: Iterable[Entry]) -> pd.DataFrame:
    """Everything about every system, one row each in each contest; numbers are empty where training was not enough.

    Returns
    -------
    DataFrame: music, corpus, system, kind, trainings, clips; h and hit_rate (paper mode) each with low, high, chance
    and the paper's value; above_chance (valleys within 0.1 s) with low and high, and with the music half a beat late;
    M / N; Frechet distances, diversity, multimodality; jerk, skating and speed in multiples of the recorded dancers';
    pattern; the guard and the recommended score of longer dances; and `comparison.facts`
    """
    rows = []
    for entry in entries:
        about: dict[str, Any] = {**entry.contest.about, "system": entry.name, "kind": ROWS[entry.name].kind}
        about["trainings"] = len(entry.contestants) * ROWS[entry.name].is_trained
        rows.append({**about, **_scores(entry), **_likeness(entry), **_guard(entry), **facts(entry)})
    table = pd.DataFrame(rows)
    return table.assign(processor=processor())


def _scores(entry: Entry) -> dict[str, Any]:
    """Means over dances of the scores of timing."""
    table = long_table([entry])
    row: dict[str, Any] = {"clips": table["clip"].nunique()}
    for measure in ("h", "hit_rate", "above_chance"):
        mean = mean_over_dances(table, measure) if len(table) else {}
        ends = {f"{measure} {key}": mean.get(key, np.nan) for key in ("low", "high")}
        row |= {measure: mean.get("mean", np.nan), **ends}
        if chance := CHANCES.get(measure):
            row[f"{measure} chance"] = _mean(table, chance)
            row[f"{measure} paper"] = printed(measure, ROWS[entry.name].printed)
    row |= {"half a beat late": _mean(table, "late"), "pattern": _mean(table, "pattern")}
    return {**row, "M / N": table["n_visual"].mean() / table["n_audio"].mean() if len(table) else np.nan}


def _mean(table: pd.DataFrame, measure: str) -> float:
    """Mean over dances; NaN of nothing."""
    return float(table.groupby("dance")[measure].mean().mean()) if len(table) else float("nan")


def _likeness(entry: Entry) -> dict[str, float]:
    """Distances to the recorded dancers and variety, means over trainings."""
    names = (
        "FID (pose network)",
        "FID (kinetic)",
        "diversity",
        "multimodality",
        *(f"{name} / recorded" for name in RATIOS),
    )
    if not entry.dances:
        return dict.fromkeys(names, float("nan"))
    recorded = reference(entry.contest)
    rows = [[*_distances(entry, one, recorded), *_ratios(one, recorded)] for one in entry.dances]
    return dict(zip(names, np.mean(rows, axis=0).tolist(), strict=True))


def _distances(entry: Entry, dances: Measured, recorded: Measured) -> list[float]:
    """FID on the pose network's and on kinetic features, diversity, multimodality; NaN for another body."""
    if not dances.kinetic.shape[-1] or len(dances.kinetic) < 2:
        return [float("nan")] * 4
    model = recorded.kinetic[:, 0]
    kinetic: FloatArray = standardise(_rows(dances.kinetic), model).reshape(dances.kinetic.shape)
    distances = [float("nan")] * 2  # recorded movement has no distance from itself
    if entry.name != RIGHT_SONG:
        distances = [
            _frechet(dances.poses[:, 0], recorded.poses[:, 0]),
            _frechet(kinetic[:, 0], standardise(model, model)),
        ]
    variety = multimodality(list(kinetic)) if kinetic.shape[1] > 1 else 0.0
    return [*distances, diversity(kinetic[:, 0]), variety]


def _frechet(dances: FloatArray, recorded: FloatArray) -> float:
    """Frechet distance of features (..., F) of dances; NaN where there are too few."""
    if not dances.size or not recorded.size or min(len(flat := _rows(dances)), len(_rows(recorded))) < LEAST:
        return float("nan")
    return frechet_distance(flat, _rows(recorded)).value


def _rows(features: FloatArray) -> FloatArray:
    """(N, F) of (..., F)."""
    return features.reshape(-1, features.shape[features.ndim - 1])


def _ratios(dances: Measured, recorded: Measured) -> list[float]:
    """`RATIOS` in multiples of the recorded dancers' means."""
    return [float(dances.of(name).mean() / recorded.of(name).mean()) for name in RATIOS]


def _guard(entry: Entry) -> dict[str, Any]:
    """The number of longer dances that move like the recorded dancers, and the recommended score of them all."""
    if not entry.guards:
        return {"guard": "", "shape score": float("nan")}
    passed = np.concatenate([one.passed for one in entry.guards])
    shape = np.concatenate([one.shape for one in entry.guards])
    judged, scored = passed[np.isfinite(passed)], shape[np.isfinite(shape)]
    guard = f"{judged.sum():.0f} of {judged.size}" if judged.size else "cannot be judged"
    return {"guard": guard, "shape score": float(scored.mean()) if scored.size else float("nan")}
