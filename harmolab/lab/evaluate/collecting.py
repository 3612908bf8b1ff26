"""The rows of dances brought together as they come: what a table needs of them, in memory that does not grow with them.

Of the measures only sums by system, song and seed are kept, beyond `MOST_SONGS` songs by groups of songs; of the
features those of a limited number of dances of each system. Groups and dances are drawn by a hash of their names, so
that neither order nor number of processes changes which.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from harmolab.io.files import atomic_write
from harmolab.lab.evaluate.pairing import Pair
from harmolab.lab.evaluate.rows import OTHER_SONG

FEATURE_DANCES = 5000  # of a system, of which the features are kept
MOST_SONGS = 5000  # more of them are put together in so many groups
GROUP = ["system", "song", "seed"]
# Of which values are counted, where a row has them.
FACTS = ("fps", "joints", "beats", "dance", "assumptions", "remarks")
# Columns of which no mean is taken.
ABOUT = (
    *("key", *GROUP, "motion", "music", "kind", "skeleton", "error", *FACTS),
    *("music_beats", "p_value", "p_value_dance", "harmony_low", "harmony_high", "level"),
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

    sums: pd.DataFrame = field(default_factory=pd.DataFrame)
    counts: pd.DataFrame = field(default_factory=pd.DataFrame)
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
            kept = pd.concat([self.features.get(system, pd.DataFrame()), rows[_feature_table(rows)]])
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


def _feature_table(rows: pd.DataFrame) -> list[str]:
    return ["key", "song", "seed", "skeleton", *(name for name in map(str, rows) if _FEATURE.fullmatch(name))]


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
    about = {pair.key: {"system": pair.system, "seed": pair.seed, "song": pair.song} for pair in pairs}
    with atomic_write(path) as part_file, part_file.open("w", encoding="utf-8", newline="") as stream:
        for number, part in enumerate(parts):
            rows = _named(part, about)
            rows[_plain_columns(rows)].to_csv(stream, index=False, header=not number)
            yield part


def _plain_columns(rows: pd.DataFrame) -> list[str]:
    return [name for name in map(str, rows) if not _FEATURE.fullmatch(name)]


def _named(part: pd.DataFrame, about: dict[str, dict[str, str]]) -> pd.DataFrame:
    """The part with system, seed and song also of those that failed."""
    names = pd.DataFrame([about[key] for key in part["key"]], index=part.index)
    return part.assign(system=names["system"], seed=names["seed"], song=names["song"])
