"""Systems compared on the same seconds of the same songs (Fig. 12, Tables 1 and 2).

`comparison` trains, dances and measures every row of every contest; it goes on where it was cut off. Tables of what it
returns are made in `standings`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from harmolab.files import Progress, silent
from harmolab.types import Motion
from study.experiments.contestants import (
    BANK,
    CHOREOGRAPHER,
    HARMOGAN,
    LEE,
    M2D,
    RECOMMENDED,
    REN,
    RIGHT_SONG,
    ROWS,
    Contestant,
    applies,
)
from study.experiments.contests import Contest, contests
from study.experiments.measuring import MEASURES, Guarded, Measured, all_dances, dance_seconds, guarded
from study.profile import RunProfile

KEYS = ("music", "corpus", "system", "training", "song", "clip", "dance", "draw")  # of a table of all dances
SHOWN = (RIGHT_SONG, CHOREOGRAPHER, BANK, M2D, HARMOGAN, RECOMMENDED, LEE, REN)  # side by side, for people to look at
SHOWN_SECONDS, SHOWN_SONGS = 10.0, 6


@dataclass(frozen=True, eq=False)
class Entry:
    """One row of a contest: what was measured of its trainings, one after the other.

    Parameters
    ----------
    contest : Contest
    name : str, of the row
    contestants : one a training; one for a row without trainings
    dances : Measured of each; empty where it was not trained well enough
    guards : Guarded of each; likewise
    seconds : float, that a dance of six takes
    """

    contest: Contest
    name: str
    contestants: tuple[Contestant, ...]
    dances: tuple[Measured, ...]
    guards: tuple[Guarded, ...]
    seconds: float

    @property
    def failed(self) -> tuple[str, ...]:
        """The entry tests that any training fails; with one, there are no numbers."""
        return tuple(dict.fromkeys(name for one in self.contestants for name in one.failed))


def entered(contest: Contest, name: str) -> Entry:
    """A row of a contest: trained, danced and measured now, as far as it was not before."""
    row = ROWS[name]
    contestants = row.contestants(contest)
    if any(one.failed for one in contestants):
        return Entry(contest, name, contestants, (), (), float("nan"))
    dances = tuple(all_dances(contest, name, one, contest.profile.draws if row.draws else 1) for one in contestants)
    guards = tuple(guarded(contest, name, one) for one in contestants)
    return Entry(contest, name, contestants, dances, guards, dance_seconds(contest, name, contestants[0]))


def comparison(
    profile: RunProfile, rows: Iterable[str] = tuple(ROWS), *, trainings: int | None = None, progress: Progress = silent
) -> list[Entry]:
    """Every row of every contest of a profile, in this order; resumable.

    Parameters
    ----------
    profile : RunProfile
    rows : names in `ROWS`
    trainings : int, of each network, of Lee and Ren at most `RunProfile.n_rivals`; the profile's when left out. With 0
        there are no networks, nor a pose network
    progress : function(iterable, label) -> iterable
    """
    every = contests(profile, profile.n_seeds if trainings is None else trainings)
    names = [name for name in rows if trainings != 0 or not ROWS[name].is_trained]
    pairs = [(contest, name) for contest in every for name in names if applies(name, contest)]
    return [entered(contest, name) for contest, name in progress(pairs, "comparing systems")]


def facts(entry: Entry) -> dict[str, Any]:
    """All there is to say of a row beside its dances: sizes, times, what it is told, entry tests."""
    tests = [passed for one in entry.contestants for _, _, passed in one.entry.values()]
    return {
        "parameters (M)": entry.contestants[0].parameters,
        "seconds for 6 s": entry.seconds,
        "training minutes": float(np.mean([one.minutes for one in entry.contestants])),
        "told the beats": ROWS[entry.name].told_beats,
        "entry tests": f"{sum(tests)} of {len(tests)}" if tests else "",
        "entry values": "; ".join(f"{name}: {value:.3g}" for name, value in _entry_means(entry).items()),
        "remark": f"not trained well enough: {', '.join(entry.failed)}" if entry.failed else "",
    }


def _entry_means(entry: Entry) -> dict[str, float]:
    """The value of each entry test, mean over trainings."""
    names = dict.fromkeys(name for one in entry.contestants for name in one.entry)
    return {name: float(np.mean([one.entry[name][0] for one in entry.contestants])) for name in names}


def long_table(entries: Iterable[Entry]) -> pd.DataFrame:
    """Every dance of every row: music, corpus, system, training, song, clip, dance, draw, then `MEASURES`."""
    rows = []
    for entry in entries:
        for training, part in enumerate(entry.dances, 1):
            for excerpt, draws in zip(part.excerpts, part.values, strict=True):
                about = {**entry.contest.about, "system": entry.name, "training": training, "song": excerpt.song}
                about |= {"clip": excerpt.name, "dance": excerpt.clip.dance}
                rows += [
                    {**about, "draw": draw, **dict(zip(MEASURES, numbers.tolist(), strict=True))}
                    for draw, numbers in enumerate(draws, 1)
                ]
    return pd.DataFrame(rows, columns=[*KEYS, *MEASURES])


def side_by_side(entries: Iterable[Entry]) -> dict[str, dict[str, Motion]]:
    """Up to six songs with a recorded (or planted) dancer, danced by `SHOWN`: song -> row -> the first ten seconds.

    Songs are those of the guard, the dances in turn; a quick profile shows one. What failed its entry tests is shown
    too, and said to have failed.
    """
    home = [entry for entry in entries if entry.contest.has_own_dancers]
    home = [entry for entry in home if entry.contest is home[0].contest]
    if not home:
        return {}
    contest, rows = home[0].contest, {entry.name: entry for entry in home}
    songs = contest.guarded[:: max(1, len(contest.guarded) // SHOWN_SONGS)]
    count = max(1, min(SHOWN_SONGS, contest.profile.songs // 4))
    return {
        f"{one.song} ({one.clip.dance})": {
            name + (" (not trained well enough)" if rows[name].failed else ""): rows[name]
            .contestants[0]
            .dance(one.longer(SHOWN_SECONDS), 1)
            for name in SHOWN
            if name in rows
        }
        for one in songs[:count]
    }
