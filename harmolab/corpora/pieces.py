"""Sides of a split that share no piece, and the share of their note patterns that two performances have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from harmolab.corpora.instruments import Performance
from harmolab.types import Notes

MOST_SHARED = 0.25  # of the note patterns: above, two performances count as repeats of one piece
PATTERN_NOTES = 4
CHORD_SECONDS = 0.05  # onsets in one such step count as one chord, whose notes are taken low before high


class PieceSplit(NamedTuple):
    """Performances of each side; no piece is on two sides."""

    train: tuple[Performance, ...]
    validation: tuple[Performance, ...]
    test: tuple[Performance, ...]


def note_patterns(notes: Notes) -> set[tuple[int, ...]]:
    """All pitches of four notes in a row: by onset, in steps of 50 ms, low before high."""
    order = np.lexsort((notes.pitches, np.round(notes.onsets / CHORD_SECONDS)))
    pitches = notes.pitches[order].tolist()
    return {tuple(pitches[start : start + PATTERN_NOTES]) for start in range(len(pitches) - PATTERN_NOTES + 1)}


def shared_patterns(notes: Notes, others: Notes) -> float:
    """Share of the note patterns of the one with fewer patterns that the other has too, 0 to 1; 0 without patterns."""
    return _shared(note_patterns(notes), note_patterns(others))


def _shared(patterns: set[tuple[int, ...]], others: set[tuple[int, ...]]) -> float:
    fewer = min(len(patterns), len(others))
    return len(patterns & others) / fewer if fewer else 0.0


def piece_groups(performances: Sequence[Performance], *, most_shared: float = MOST_SHARED) -> list[int]:
    """Number of the group of every performance: those of one piece, and pieces that share too many note patterns.

    Parameters
    ----------
    performances : those without a piece are pieces of their own
    most_shared : float
        Pieces with performances whose `shared_patterns` exceed it are one group. Without notes only `piece` counts.
    """
    patterns = [set() if one.notes is None else note_patterns(one.notes) for one in performances]
    pairs = [
        (first, second)
        for second, one in enumerate(performances)
        for first, other in enumerate(performances[:second])
        if (one.piece and one.piece == other.piece) or _shared(patterns[first], patterns[second]) > most_shared
    ]
    first, second = np.array(pairs, np.int64).reshape(-1, 2).T
    size = len(performances)
    graph = coo_array((np.ones(len(pairs)), (first, second)), shape=(size, size))
    return [int(group) for group in connected_components(graph, directed=False)[1]]


def split_by_piece(
    performances: Sequence[Performance],
    *,
    test_share: float = 0.15,
    validation_share: float = 0.15,
    seed: int = 0,
    most_shared: float = MOST_SHARED,
) -> PieceSplit:
    """Performances dealt out by `piece_groups` at random, never by clip, so that no side has seen another's music.

    Parameters
    ----------
    performances : Performance list
    test_share, validation_share : float
        Share of the seconds to aim at. A side whose share is above 0 gets one group at least; 0 leaves it empty.
    seed : int
    most_shared : as in `piece_groups`

    Raises
    ------
    ValueError
        Shares that are negative or leave nothing to train on; fewer groups than sides.
    """
    if min(test_share, validation_share) < 0 or not test_share + validation_share < 1:
        raise ValueError(
            f"test_share and validation_share must leave some to train on: {test_share}, {validation_share}"
        )
    groups = np.array(piece_groups(performances, most_shared=most_shared), np.int64)
    seconds = np.array([one.motion.duration for one in performances])
    shares = np.array([1 - validation_share - test_share, validation_share, test_share])
    count = int(groups.max(initial=-1)) + 1
    if count < (shares > 0).sum():
        raise ValueError(
            f"{len(performances)} performances are of {count} pieces: too few for {(shares > 0).sum()} sides"
        )
    deficits, sides = shares * seconds.sum(), np.zeros(count, np.int64)
    order = np.random.default_rng(seed).permutation(count)
    for turn, group in enumerate(order):
        needy = np.flatnonzero(shares > 0)[::-1]
        side = needy[turn] if turn < needy.size else np.argmax(np.where(shares > 0, deficits, -np.inf))
        sides[group] = side
        deficits[side] -= seconds[groups == group].sum()
    return PieceSplit(
        *(
            tuple(one for one, group in zip(performances, groups, strict=True) if sides[group] == side)
            for side in range(3)
        )
    )
