"""Dances of contestants, measured by the function that a table needs, and kept in the cache folder.

Every dance is kept under all that it depends on, those to songs of one kind of dance together: a comparison that was
killed goes on where it was, and a second one reads.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harmolab.files import Arrays, cached_arrays, keep_arrays, plain
from harmolab.types import Motion
from study.experiments.contestants import Contestant
from study.experiments.contests import Contest
from study.experiments.songs import Excerpt

VERSION = 1  # of what is kept

# Numbers, or arrays of one length, of a motion danced to an excerpt: frame 0 belongs to the excerpt's start.
Measure = Callable[[Motion, Excerpt], Mapping[str, Any]]


def measured(
    kind: str,
    contest: Contest,
    name: str,
    contestant: Contestant,
    songs: Sequence[Excerpt],
    measure: Measure,
    *,
    draws: int = 1,
    settings: Any = None,
) -> pd.DataFrame:
    """A contestant's dances to some songs, each danced `draws` times; measured now unless they were before.

    Parameters
    ----------
    kind : str, of the table
    contest, name, contestant : what is kept is theirs; `name` is that of the row
    songs : Excerpts
    measure : function of a motion and its excerpt to numbers by name; an array is one entry of the table
    draws : int; the seeds are 1 to this
    settings : all that the measures depend on besides, as JSON holds it

    Returns
    -------
    DataFrame, a row a dance, with the columns song, clip, dance, draw, and those of `measure`
    """
    tables = []
    for dance in dict.fromkeys(song.clip.dance for song in songs):
        own = [song for song in songs if song.clip.dance == dance]
        pairs = [(song, draw) for song in own for draw in range(1, draws + 1)]
        key = kept_name(kind, contest, name, contestant, own, {"draws": draws, "settings": settings})
        arrays = cached_arrays(key)
        if arrays is None:
            arrays = _stacked([measure(contestant.dance(song, draw), song) for song, draw in pairs])
            keep_arrays(key, arrays)
        about = [{"song": song.song, "clip": song.name, "dance": dance, "draw": draw} for song, draw in pairs]
        tables.append(pd.DataFrame(about).assign(**{each: list(values) for each, values in arrays.items()}))
    return pd.concat(tables, ignore_index=True)


def _stacked(rows: Sequence[Mapping[str, Any]]) -> Arrays:
    """Each number of all rows in one array; of arrays that differ in length, the ends are left out."""
    columns = {name: [np.asarray(row[name], np.float64) for row in rows] for name in rows[0]}
    return {
        name: np.array([value[: min(map(len, values))] if value.ndim else value for value in values])
        for name, values in columns.items()
    }


def kept(key: str, names: Iterable[str], measure: Callable[[], Arrays]) -> Arrays:
    """The arrays of some names that were kept under a key; measured and kept now unless they were."""
    arrays = cached_arrays(key)
    if arrays is None or set(arrays) != set(names):
        arrays = measure()
        keep_arrays(key, arrays)
    return arrays


def kept_name(
    kind: str, contest: Contest, name: str, contestant: Contestant, excerpts: Sequence[Excerpt], more: Any
) -> str:
    """Name of what is kept: a hash of all that it depends on."""
    songs = [[one.name, one.seconds, _sound_of(one)] for one in excerpts]
    about = [VERSION, kind, contest.about, name, contestant.identity, songs, more]
    return f"compared-{hashlib.sha256(json.dumps(plain(about), sort_keys=True).encode()).hexdigest()[:32]}"


def _sound_of(excerpt: Excerpt) -> str:
    """A hash of a song and its beats."""
    digest = hashlib.sha256(excerpt.clip.audio.samples.tobytes())
    digest.update(excerpt.beats.times.tobytes())
    return digest.hexdigest()


def processor() -> str:
    """Name of this machine's processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text("utf-8").splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
