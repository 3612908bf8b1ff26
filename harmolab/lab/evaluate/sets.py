"""Numbers of a system's dances as a set: Fréchet distances from the recorded dances, diversity, multimodality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from harmolab.lab.evaluate.collecting import feature_columns, feature_names
from harmolab.lab.evaluate.pairing import RECORDED
from harmolab.metrics.frechet import diversity, frechet_distance, multimodality, standardise
from harmolab.types import FloatArray

FEATURES = ("kinetic", "geometric", "pose")
LEAST = 4  # dances on either side that a distance without its small-sample bias needs


class FeatureSet(NamedTuple):
    """Features of dances, (n, d), and the song and seed of each."""

    values: FloatArray
    songs: tuple[str, ...]
    seeds: tuple[str, ...]


def feature_set(table: pd.DataFrame, name: str, skeleton: str) -> FeatureSet:
    """The features of a name of those dances that have them; kinetic ones only with the joints of `skeleton`."""
    rows = table[table["skeleton"] == skeleton] if name == "kinetic" else table
    columns = feature_columns(rows, name)
    rows = rows.dropna(subset=columns)
    return FeatureSet(rows[columns].to_numpy(np.float64), tuple(rows["song"]), tuple(rows["seed"]))


def common_skeleton(table: pd.DataFrame) -> str:
    """The skeleton that most dances of a table have."""
    return str(table["skeleton"].mode().iloc[0])


def set_numbers(features: Mapping[str, pd.DataFrame], *, seed: int = 0) -> pd.DataFrame:
    """Every number of every system's dances as a set.

    The features are in units of the recorded dances (`standardise`). Distances are without the bias of small samples,
    those with it stand beside, and so do the sample sizes. The recorded dances have no distance from themselves: theirs
    is that between the halves of their songs, every second one by name, which is what chance leaves of 0.

    Parameters
    ----------
    features : system -> table of features: `Collected.features`, with the recorded dances among them
    seed : of the splits behind the correction

    Returns
    -------
    DataFrame: system, measure ("fid_kinetic", "diversity_kinetic", "multimodality_kinetic", ...), mean (the number),
    raw, n, n_recorded; what cannot be computed is left out
    """
    if RECORDED not in features:
        return pd.DataFrame(columns=_COLUMNS)
    skeleton = common_skeleton(features[RECORDED])
    rows = []
    for name in FEATURES:
        recorded = feature_set(features[RECORDED], name, skeleton)
        if len(recorded.values) < 2 or not recorded.values.shape[1]:
            continue
        for system, table in features.items():
            danced = feature_set(table, name, skeleton)
            if not len(danced.values) or danced.values.shape[1] != recorded.values.shape[1]:
                continue
            sides = _halves(recorded) if system == RECORDED else (danced.values, recorded.values)
            rows += [{"system": system, **row} for row in _distance(*sides, recorded.values, name, seed)]
            scaled = danced._replace(values=standardise(danced.values, recorded.values))
            rows += [{"system": system, "n": len(danced.values), **row} for row in _variety(scaled, name)]
    return pd.DataFrame(rows, columns=_COLUMNS)


_COLUMNS = ["system", "measure", "mean", "raw", "n", "n_recorded"]


def _halves(recorded: FeatureSet) -> tuple[FloatArray, FloatArray]:
    """The features of every second song, and of the others."""
    places = {song: place for place, song in enumerate(sorted(set(recorded.songs)))}
    second = np.array([places[song] % 2 == 1 for song in recorded.songs])
    return recorded.values[~second], recorded.values[second]


def _distance(
    danced: FloatArray, recorded: FloatArray, unit: FloatArray, name: str, seed: int
) -> list[dict[str, float | str]]:
    """The Fréchet distance of two sets in units of a third; none where one of them is too small."""
    if min(len(danced), len(recorded)) < LEAST:
        return []
    result = frechet_distance(standardise(danced, unit), standardise(recorded, unit), seed=seed)
    about = {"measure": f"fid_{name}", "mean": result.value, "raw": result.raw}
    return [{**about, "n": result.n_a, "n_recorded": result.n_b}]


def _variety(danced: FeatureSet, name: str) -> list[dict[str, float | str]]:
    """Diversity over the dances of a seed, mean over seeds; multimodality over the seeds of a song, mean over songs."""
    by_seed, by_song = (_groups(danced.values, names) for names in (danced.seeds, danced.songs))
    rows: list[dict[str, float | str]] = []
    if by_seed:
        rows.append({"measure": f"diversity_{name}", "mean": float(np.mean([diversity(each) for each in by_seed]))})
    if by_song and len(set(danced.seeds)) > 1:
        rows.append({"measure": f"multimodality_{name}", "mean": multimodality(by_song)})
    return rows


def _groups(values: FloatArray, names: tuple[str, ...]) -> list[FloatArray]:
    """The rows of each name, of those that have two or more."""
    places: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        places.setdefault(name, []).append(place)
    return [values[each] for each in places.values() if len(each) > 1]


def protocol_sets(features: Mapping[str, pd.DataFrame], protocol: str) -> pd.DataFrame:
    """The numbers that a protocol of `harmolab.lab.evaluate.protocols` has for a set of dances: system, measure, mean.

    The recorded dances are its reference, and have none.
    """
    from harmolab.lab.evaluate.protocols import PROTOCOLS

    if RECORDED not in features:
        return pd.DataFrame(columns=_COLUMNS)
    skeleton = common_skeleton(features[RECORDED])
    rows = []
    for system, table in features.items():
        sides = [_protocol_features(part, protocol, skeleton) for part in (table, features[RECORDED])]
        if system == RECORDED or sides[0].keys() != sides[1].keys() or min(map(_least, sides)) < 2:
            continue
        numbers = PROTOCOLS[protocol].sets(*sides)
        count = {"n": _least(sides[0]), "n_recorded": _least(sides[1])}
        rows += [
            {"system": system, "measure": f"{protocol} {name}", "mean": number, **count}
            for name, number in numbers.items()
        ]
    return pd.DataFrame(rows, columns=_COLUMNS)


def _protocol_features(table: pd.DataFrame, protocol: str, skeleton: str) -> dict[str, FloatArray]:
    """The protocol's features by name, of dances with the joints of `skeleton`."""
    rows = table[table["skeleton"] == skeleton]
    names = [name for name in feature_names(rows) if name.startswith(f"{protocol} ")]
    sets = {name.removeprefix(f"{protocol} "): feature_set(rows, name, skeleton).values for name in names}
    return {name: values for name, values in sets.items() if values.size}


def _least(features: Mapping[str, FloatArray]) -> int:
    return min(map(len, features.values()), default=0)
