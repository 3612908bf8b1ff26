"""Rows of dances brought together, and numbers of dances as a set: Fréchet distance, diversity, multimodality.

Rows are brought together as they come: what a table needs of them, in memory that does not grow with them. Of the
measures only sums by system, song and seed are kept, beyond `MOST_SONGS` songs by groups of songs; of the features
those of a limited number of dances of each system. Groups and dances are drawn by a hash of their names, so that
neither order nor number of processes changes which.

Fréchet distances are those of a system's dances from the recorded dances.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import lazy_loader
import numpy as np

from harmolab.files import atomic_write
from harmolab.lab.evaluate.pairing import FROZEN, OTHER_SONG, RECORDED, Pair
from harmolab.lab.evaluate.protocols import LEAST_SPREAD, protocol_of
from harmolab.metrics.features import diversity, frechet_distance, multimodality, standardise
from harmolab.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
else:  # half a second, which no worker needs to wait for
    pd = lazy_loader.load("pandas")

# Rows brought together

FEATURE_DANCES = 5000  # of a system, of which the features are kept
MOST_SONGS = 5000  # more of them are put together in so many groups
GROUP = ["system", "song", "seed"]
# Of which values are counted, where a row has them.
FACTS = ("fps", "joints", "beats", "dance", "assumptions", "remarks", "begins", "odd")
# Columns of which no mean is taken.
ABOUT = (
    *("key", *GROUP, "motion", "music", "kind", "skeleton", "error", *FACTS),
    *("offset", "oddities", "music_beats", "p_value", "p_value_dance", "harmony_low", "harmony_high", "level"),
)
_FEATURE = re.compile(r"f_(.+)_\d{3}")


@dataclass
class Collected:
    """The parts of the rows of all dances that are kept.

    Parameters
    ----------
    sums, counts : DataFrames by system, song and seed: of every measure, over the dances that have it
    features : system -> DataFrame of the features of some of its dances, with song, seed and skeleton
    extremes : system -> ((harmony, key) of its worst dance, the same of its best); systems without a harmony lack
    facts : system -> each of `FACTS` -> how many dances have which value
    errors : key -> the reason why a dance was not measured
    is_grouped : True where groups stand for songs in `sums` and `counts`
    """

    sums: pd.DataFrame = field(default_factory=lambda: pd.DataFrame())
    counts: pd.DataFrame = field(default_factory=lambda: pd.DataFrame())
    features: dict[str, pd.DataFrame] = field(default_factory=dict)
    extremes: dict[str, tuple[tuple[float, str], tuple[float, str]]] = field(default_factory=dict)
    facts: dict[str, dict[str, Counter[str]]] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    is_grouped: bool = False

    def add(self, part: pd.DataFrame) -> None:
        """Take in the rows of a part."""
        has_failed = part["error"] != ""
        failed, part = part[has_failed], part[~has_failed]
        self.errors |= dict(zip(failed["key"], failed["error"], strict=True))
        if part.empty:
            return
        self._add_numbers(part[[*GROUP, *measure_columns(part)]])
        for system, rows in part.groupby("system"):
            self._add_system(str(system), rows)

    def _add_numbers(self, rows: pd.DataFrame) -> None:
        numbers = (_song_groups(rows) if self.is_grouped else rows).groupby(GROUP)
        self.sums, self.counts = _added(self.sums, numbers.sum()), _added(self.counts, numbers.count())
        if not self.is_grouped and self.sums.index.unique("song").size > MOST_SONGS:
            self.is_grouped = True
            tables = (_song_groups(table.reset_index()) for table in (self.sums, self.counts))
            self.sums, self.counts = (table.groupby(GROUP).sum() for table in tables)

    def _add_system(self, system: str, rows: pd.DataFrame) -> None:
        facts = self.facts.setdefault(system, {name: Counter() for name in FACTS})
        for name in (name for name in FACTS if name in rows):
            facts[name].update(_text(value) for value in rows[name])
        scored = rows.dropna(subset="harmony")
        if len(scored):
            both = [*self.extremes.get(system, ()), *zip(scored["harmony"], scored["key"], strict=True)]
            self.extremes[system] = (min(both), max(both))
        if (rows["kind"] != OTHER_SONG).all():  # whose motions are those of the recorded dances
            names = ["key", "song", "seed", "skeleton", *(name for name in map(str, rows) if _FEATURE.fullmatch(name))]
            kept = pd.concat([self.features.get(system, pd.DataFrame()), rows[names]])
            drawn = pd.util.hash_array(kept["key"].to_numpy(object)).argsort(kind="stable")[:FEATURE_DANCES]
            self.features[system] = kept.iloc[sorted(drawn)]

    @property
    def song_means(self) -> pd.DataFrame:
        """Means of every measure by system and song: over the dances of a seed, then over the seeds."""
        return (self.sums / self.counts).groupby(["system", "song"]).mean()


def _song_groups(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with a group by its name instead of each song."""
    groups = pd.util.hash_array(rows["song"].to_numpy(object)) % MOST_SONGS
    return rows.assign(song=[f"group {group}" for group in groups])


def _text(value: float | int | str) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _added(total: pd.DataFrame, more: pd.DataFrame) -> pd.DataFrame:
    return more if total.empty else total.add(more, fill_value=0)


def feature_cells(features: Mapping[str, FloatArray]) -> dict[str, float]:
    """The columns of the features of a dance, by name and place: f_NAME_000 and so on."""
    return {f"f_{name}_{place:03d}": float(x) for name, row in features.items() for place, x in enumerate(row)}


def feature_columns(frame: pd.DataFrame, name: str) -> list[str]:
    """The columns of the features of a name, in order."""
    return sorted(column for column in map(str, frame) if (match := _FEATURE.fullmatch(column)) and match[1] == name)


def feature_names(frame: pd.DataFrame) -> list[str]:
    """The names of the features in a table."""
    return list(dict.fromkeys(match[1] for column in map(str, frame) if (match := _FEATURE.fullmatch(column))))


def measure_columns(frame: pd.DataFrame) -> list[str]:
    """The columns of the numbers of a dance: neither words about it nor features."""
    return [name for name in map(str, frame) if name not in ABOUT and not _FEATURE.fullmatch(name)]


def collect(parts: Iterable[pd.DataFrame]) -> Collected:
    """The rows of all parts, brought together."""
    collected = Collected()
    for part in parts:
        collected.add(part)
    return collected


def written_parts(parts: Iterable[pd.DataFrame], path: Path, pairs: Iterable[Pair]) -> Iterator[pd.DataFrame]:
    """The parts as they are; on the way their rows, but for the features, are written to a CSV file, which appears at
    the end, whole. Of a dance that failed it has the names and the error.
    """
    by_key = {pair.key: pair for pair in pairs}
    with atomic_write(path) as part_file, part_file.open("w", encoding="utf-8", newline="") as stream:
        for number, part in enumerate(parts):
            own = [by_key[key] for key in part["key"]]
            rows = part.assign(**{name: [getattr(pair, name) for pair in own] for name in ("system", "seed", "song")})
            columns = [name for name in map(str, rows) if not _FEATURE.fullmatch(name)]
            rows[columns].to_csv(stream, index=False, header=not number)
            yield part


# Numbers of a set: Fréchet distances, diversity, multimodality

FEATURES = ("kinetic", "geometric", "pose")  # kinds of features of a dance as a whole
SETS = MappingProxyType({"fid": "Fréchet distance", "diversity": "diversity", "multimodality": "multimodality"})
LEAST = 4  # dances on either side that a distance without its small-sample bias needs


class SetNumber(NamedTuple):
    """A number of a set of dances; of a distance also the number before its bias is taken off. NaN for what is not.

    n is the number of dances, n_recorded that of the dances on the other side of a distance; `constant` are the places
    of features that are constant on that side, not in the dances, where a protocol divides by what is left of them.
    """

    value: float
    n: int
    raw: float = math.nan
    n_recorded: float = math.nan
    constant: tuple[int, ...] = ()


SetNumbers = dict[tuple[str, str], SetNumber]  # (system, measure) -> number


def features_of(table: pd.DataFrame, name: str, skeleton: str) -> pd.DataFrame:
    """The features of a name, by song and seed, of those dances that have them; kinetic ones only of `skeleton`."""
    rows = table[table["skeleton"] == skeleton] if name == "kinetic" else table
    features = rows.set_index(["song", "seed"])[feature_columns(rows, name)]
    # A body of more joints has more features, which stand in columns of the table that the others lack.
    return features.dropna(axis=1, how="all").dropna().astype(np.float64)


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
        recorded = features_of(features[RECORDED], name, skeleton)
        if len(recorded) < 2 or not recorded.shape[1]:
            continue
        for system, table in features.items():
            danced = features_of(table, name, skeleton)
            if danced.empty or danced.shape[1] != recorded.shape[1]:
                continue
            scaled = pd.DataFrame(standardise(danced, recorded), danced.index)
            sides = _halves(scaled) if system == RECORDED else (scaled, pd.DataFrame(standardise(recorded, recorded)))
            if min(map(len, sides)) >= LEAST:
                distance = frechet_distance(*sides, seed=seed)
                numbers[system, f"fid_{name}"] = SetNumber(distance.value, distance.n_a, distance.raw, distance.n_b)
            numbers |= {(system, f"{kind}_{name}"): number for kind, number in _variety(scaled).items()}
    return numbers


def _halves(recorded: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The dances to every second song by name, from the first one on, and those to the songs between."""
    is_second = recorded.reset_index()["song"].rank(method="dense").to_numpy() % 2 == 0
    return recorded[~is_second], recorded[is_second]


def _variety(danced: pd.DataFrame) -> dict[str, SetNumber]:
    """Diversity over the dances of a seed, mean over seeds; multimodality over the seeds of a song, mean over songs.

    Where no song has two seeds, these are folders by style or dancer, no draws: diversity is over all dances.
    """
    by_seed, by_song = (_groups(danced, level) for level in ("seed", "song"))
    numbers, count = {}, len(danced)
    if count > 1 and danced.index.unique().size == danced.index.unique("song").size:
        by_seed = [danced.to_numpy()]
    if by_seed:
        numbers["diversity"] = SetNumber(float(np.mean([diversity(each) for each in by_seed])), count)
    if by_song and danced.index.unique("seed").size > 1:
        numbers["multimodality"] = SetNumber(multimodality(by_song), count)
    return numbers


def _groups(features: pd.DataFrame, level: str) -> list[FloatArray]:
    """The features of each song, or of each seed, of those that have two dances or more."""
    return [rows.to_numpy() for _, rows in features.groupby(level=level, sort=False) if len(rows) > 1]


def protocol_sets(features: Mapping[str, pd.DataFrame], protocol: str) -> SetNumbers:
    """The numbers that a protocol of `harmolab.lab.evaluate.protocols` has for a set of dances, called as there.

    The recorded dances are its reference. Their own line is the ground truth of published tables: those to the songs
    that the systems danced to, against all; where these are all, the distance is that between halves of their songs.
    """
    recorded = features[RECORDED]
    numbers: SetNumbers = {}
    for system, table in features.items():
        if system != RECORDED:
            numbers |= _protocol_numbers(system, table, recorded, protocol)
    danced = {song for system, table in features.items() if system not in (RECORDED, FROZEN) for song in table["song"]}
    truth = recorded[recorded["song"].isin(danced)]
    own = _protocol_numbers(RECORDED, truth, recorded, protocol)
    if len(truth) == len(recorded):
        first, second = _halves(recorded)
        halves = _protocol_numbers(RECORDED, second, first, protocol)
        own = {key: one for key, one in own.items() if "FID" not in key[1]}
        own |= {key: one for key, one in halves.items() if "FID" in key[1]}
    return numbers | own


def _protocol_numbers(system: str, danced: pd.DataFrame, recorded: pd.DataFrame, protocol: str) -> SetNumbers:
    """The numbers of a table of features against another; none where either has fewer than two dances."""
    skeleton = common_skeleton(recorded)
    sides = [_protocol_features(table, protocol, skeleton) for table in (danced, recorded)]
    if sides[0].keys() != sides[1].keys() or min(map(_least, sides)) < 2:
        return {}
    constant = {name[0]: _blown_up(*(side[name] for side in sides)) for name in sides[0]}
    n, n_recorded = map(_least, sides)
    return {
        (system, f"{protocol} {name}"): SetNumber(value, n, n_recorded=n_recorded, constant=constant.get(name[-1], ()))
        for name, value in protocol_of(protocol).sets(*sides).items()
    }


def _blown_up(danced: FloatArray, recorded: FloatArray) -> tuple[int, ...]:
    """The places of features that are constant in the reference, beside a protocol's 1e-10, and not in the dances."""
    is_constant = recorded.std(axis=0) < LEAST_SPREAD
    is_other = np.abs(danced - recorded.mean(axis=0)).max(axis=0) > LEAST_SPREAD
    return tuple(map(int, np.flatnonzero(is_constant & is_other)))


def _protocol_features(table: pd.DataFrame, protocol: str, skeleton: str) -> dict[str, FloatArray]:
    """The protocol's features by name, of dances with the joints of `skeleton`."""
    rows = table[table["skeleton"] == skeleton]
    names = [name for name in feature_names(rows) if name.startswith(f"{protocol} ")]
    sets = {name.removeprefix(f"{protocol} "): features_of(rows, name, skeleton).to_numpy() for name in names}
    return {name: values for name, values in sets.items() if values.size}


def _least(features: Mapping[str, FloatArray]) -> int:
    return min(map(len, features.values()), default=0)
