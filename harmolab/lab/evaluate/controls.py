"""Rows that every table has: recorded dances, the same with another song, and a pose that is held.

A table in which recorded dances do not win, or a held pose does not lose, measures something else than dancing. Note
in which columns it wins: what stands still neither slides nor jerks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harmolab.io.files import Progress
from harmolab.lab.evaluate.pairing import RECORDED, Pair
from harmolab.lab.evaluate.rows import FROZEN, OTHER_SONG, RowOptions, pair_motion
from harmolab.metrics.likeness import LikenessLimits, window_measures

CONTROLS = (RECORDED, OTHER_SONG, FROZEN)
LIMIT_DANCES = 200  # recorded dances that the limits of likeness are taken from, at most


def control_pairs(recorded: Sequence[Pair]) -> tuple[Pair, ...]:
    """The pairs of all controls, from those of recorded dances and their own songs.

    The other song is the one half way further in the list of songs: neighbours are often of one kind. With one song
    there is none.
    """
    songs = {pair.song: pair.music for pair in sorted(recorded, key=lambda pair: pair.song)}
    names = list(songs)
    others = {name: names[(place + len(names) // 2) % len(names)] for place, name in enumerate(names)}
    swapped = tuple(
        replace(pair, system=OTHER_SONG, song=others[pair.song], music=songs[others[pair.song]], kind=OTHER_SONG)
        for pair in recorded
        if len(names) > 1
    )
    return (*recorded, *swapped, *(replace(pair, system=FROZEN, kind=FROZEN) for pair in recorded))


def recorded_limits(recorded: Sequence[Pair], options: RowOptions, *, progress: Progress) -> LikenessLimits | None:
    """The limits of likeness of the recorded dances, of `LIMIT_DANCES` of them evenly through the list at most.

    None where none of them can be measured: they are two-dimensional, without names of joints, or shorter than 10 s.
    """
    places = np.unique(np.linspace(0, len(recorded) - 1, min(len(recorded), LIMIT_DANCES)).astype(int))
    windows = []
    for place in progress(places.tolist(), "measuring recorded dancers"):
        try:
            windows.append(window_measures(pair_motion(recorded[place], options)))
        except (ValueError, OSError):
            continue  # the row of this dance says what is wrong with it
    usable = [each for each in windows if any(each)]
    return LikenessLimits.of_windows(usable, [""] * len(usable)) if usable else None
