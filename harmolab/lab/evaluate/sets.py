"""Numbers of a system's dances as a set: Fréchet distances from the recorded dances, diversity, multimodality."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from harmolab.lab.evaluate.collecting import feature_columns, feature_names
from harmolab.lab.evaluate.pairing import RECORDED
from harmolab.lab.evaluate.rows import FEATURES, protocol_of
from harmolab.metrics.frechet import diversity, frechet_distance, multimodality, standardise
from harmolab.types import FloatArray

LEAST = 4  # dances on either side that a distance without its small-sample bias needs


class FeatureSet(NamedTuple):
    """Features of dances, (n, d), and the song and seed of each."""

    values: FloatArray
    songs: tuple[str, ...]
    seeds: tuple[str, ...]


class SetNumber(NamedTuple):
    """A number of a set of dances; of a distance also the number before its bias is taken off. NaN for what is not.

    n is the number of dances, n_recorded that of the dances on the other side of a distance.
    """

    value: float
    n: int
    raw: float = math.nan
    n_recorded: float = math.nan


SetNumbers = dict[tuple[str, str], SetNumber]  # (system, measure) -> number


def feature_set(table: pd.DataFrame, name: str, skeleton: str) -> FeatureSet:
    """The features of a name of those dances that have them; kinetic ones only with the joints of `skeleton`."""
    rows = table[table["skeleton"] == skeleton] if name == "kinetic" else table
    columns = feature_columns(rows, name)
    rows = rows.dropna(subset=columns)
    return FeatureSet(rows[columns].to_numpy(np.float64), tuple(rows["song"]), tuple(rows["seed"]))


def common_skeleton(table: pd.DataFrame) -> str:
    """The skeleton that most dances of a table have."""
    return str(table["skeleton"].mode().iloc[0])


def set_numbers(features: Mapping[str, pd.DataFrame], *, seed: int = 0) -> SetNumbers:
    """Every number of every system's dances as a set.

    The features are in units of the recorded dances (`standardise`). The bias of small samples, as estimated, is
    taken off the distances; those with it stand beside, and so do the sample sizes. The recorded dances have no
    distance from themselves: theirs is that between the halves of their songs, every second one by name: what chance
    and other songs leave of 0.

    Parameters
    ----------
    features : system -> table of features: `Collected.features`, with the recorded dances among them
    seed : of the splits behind the correction

    Returns
    -------
    (system, "fid_kinetic", "diversity_kinetic", "multimodality_kinetic" and so on) -> SetNumber; what cannot be
    computed is left out
    """
    skeleton = common_skeleton(features[RECORDED])
    numbers: SetNumbers = {}
    for name in FEATURES:
        recorded = feature_set(features[RECORDED], name, skeleton)
        if len(recorded.values) < 2 or not recorded.values.shape[1]:
            continue
        for system, table in features.items():
            danced = feature_set(table, name, skeleton)
            if not len(danced.values) or danced.values.shape[1] != recorded.values.shape[1]:
                continue
            sides = _halves(recorded) if system == RECORDED else (danced.values, recorded.values)
            if min(map(len, sides)) >= LEAST:
                numbers[system, f"fid_{name}"] = _distance(*sides, recorded.values, seed)
            scaled = danced._replace(values=standardise(danced.values, recorded.values))
            numbers |= {(system, f"{kind}_{name}"): number for kind, number in _variety(scaled).items()}
    return numbers


def _halves(recorded: FeatureSet) -> tuple[FloatArray, FloatArray]:
    """The features of every second song, and of the others."""
    places = {song: place for place, song in enumerate(sorted(set(recorded.songs)))}
    second = np.array([places[song] % 2 == 1 for song in recorded.songs])
    return recorded.values[~second], recorded.values[second]


def _distance(danced: FloatArray, recorded: FloatArray, unit: FloatArray, seed: int) -> SetNumber:
    """The Fréchet distance of two sets in units of a third."""
    result = frechet_distance(standardise(danced, unit), standardise(recorded, unit), seed=seed)
    return SetNumber(result.value, result.n_a, result.raw, result.n_b)


def _variety(danced: FeatureSet) -> dict[str, SetNumber]:
    """Diversity over the dances of a seed, mean over seeds; multimodality over the seeds of a song, mean over songs."""
    by_seed, by_song = (_groups(danced.values, names) for names in (danced.seeds, danced.songs))
    numbers, count = {}, len(danced.values)
    if by_seed:
        numbers["diversity"] = SetNumber(float(np.mean([diversity(each) for each in by_seed])), count)
    if by_song and len(set(danced.seeds)) > 1:
        numbers["multimodality"] = SetNumber(multimodality(by_song), count)
    return numbers


def _groups(values: FloatArray, names: tuple[str, ...]) -> list[FloatArray]:
    """The rows of each name, of those that have two or more."""
    places: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        places.setdefault(name, []).append(place)
    return [values[each] for each in places.values() if len(each) > 1]


def protocol_sets(features: Mapping[str, pd.DataFrame], protocol: str) -> SetNumbers:
    """The numbers that a protocol of `harmolab.lab.evaluate.protocols` has for a set of dances, called as there.

    The recorded dances are its reference, and have none.
    """
    skeleton = common_skeleton(features[RECORDED])
    recorded = _protocol_features(features[RECORDED], protocol, skeleton)
    numbers: SetNumbers = {}
    for system, table in features.items():
        danced = _protocol_features(table, protocol, skeleton)
        if system == RECORDED or danced.keys() != recorded.keys() or min(_least(danced), _least(recorded)) < 2:
            continue
        for name, value in protocol_of(protocol).sets(danced, recorded).items():
            number = SetNumber(value, _least(danced), n_recorded=_least(recorded))
            numbers[system, f"{protocol} {name}"] = number
    return numbers


def _protocol_features(table: pd.DataFrame, protocol: str, skeleton: str) -> dict[str, FloatArray]:
    """The protocol's features by name, of dances with the joints of `skeleton`."""
    rows = table[table["skeleton"] == skeleton]
    names = [name for name in feature_names(rows) if name.startswith(f"{protocol} ")]
    sets = {name.removeprefix(f"{protocol} "): feature_set(rows, name, skeleton).values for name in names}
    return {name: values for name, values in sets.items() if values.size}


def _least(features: Mapping[str, FloatArray]) -> int:
    return min(map(len, features.values()), default=0)
