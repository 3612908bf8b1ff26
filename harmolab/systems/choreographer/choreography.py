"""A dance and what it is made of: which recordings, what seams, how much of it is new, what to be warned of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from harmolab.systems.choreographer.choose import MusicBeats
from harmolab.systems.choreographer.lay import Run
from harmolab.systems.choreographer.moves import Moves
from harmolab.systems.choreographer.params import ChoreographerParams
from harmolab.types import BoolArray, FloatArray, IntArray, Motion

VISIBLE_SEAM = 18.0  # centimetres above which a faded seam can be seen
LEAST_MINUTES, ENOUGH_MINUTES = 1.0, 2.0
OTHER_TEMPO = 0.2  # share by which a tempo may be another before the dance suffers
TOO_LITTLE = "too little motion for this song"


@dataclass(frozen=True)
class Piece:
    """Beats of one recording that are danced in a row.

    Parameters
    ----------
    recording : str, its name
    first_beat, last_beat : beats of the recording, its first counted as 0; it is danced from one to the other
    source_start, source_end : seconds of them in the recording's motion
    seam_cm : size of the seam it begins with; 0 for the first
    start : seconds in the dance; negative where the first beat lies before it
    """

    recording: str
    first_beat: int
    last_beat: int
    source_start: float
    source_end: float
    seam_cm: float
    start: float


@dataclass(frozen=True, eq=False)
class Choreography:
    """A dance, and what it is made of.

    Parameters
    ----------
    motion : Motion; frame 0 belongs to the audio time `start`
    start : float, seconds
    pieces : tuple of Piece
    mean_seam_cm, worst_seam_cm : float
        Seams below 1.5 cm, to the same figure in another recording, are left out of the mean; 0 without seams.
    distinct_minutes : float, minutes of the corpus without beats that look like earlier ones
    longest_stretch : int, beats in a row that one recording also has
    seen_before : float in [0, 1], share of the beats that look like an earlier beat of this dance
    shares : share of the beats that each recording gave, by its name, largest first
    stretch : float, mean |log| of the tempo changes: .03 is 3 %
    warnings : sentences that its maker should read
    """

    motion: Motion
    start: float
    pieces: tuple[Piece, ...]
    mean_seam_cm: float
    worst_seam_cm: float
    distinct_minutes: float
    longest_stretch: int
    seen_before: float
    shares: Mapping[str, float]
    stretch: float
    warnings: tuple[str, ...]


def pieces_of(moves: Moves, runs: list[Run], music: MusicBeats, start: float) -> tuple[Piece, ...]:
    """The runs of a dance, by name and time."""
    pieces = []
    for run in runs:
        course, last = moves.courses[run.course], run.beat + run.last - run.first
        begins, ends = course.beats[[run.beat, last]].tolist()
        begin = float(music.times[run.first]) - start
        pieces.append(Piece(course.take.name, run.beat, last, begins, ends, run.seam, begin))
    return tuple(pieces)


def seam_sizes(runs: list[Run], params: ChoreographerParams) -> tuple[float, float]:
    """Mean and worst seam, centimetres; those below a twin's are left out of the mean."""
    seams = np.array([run.seam for run in runs[1:]])
    real = seams[seams >= params.twin]
    return float(real.mean()) if real.size else 0.0, float(seams.max(initial=0.0))


def distinct_minutes(moves: Moves, params: ChoreographerParams) -> float:
    """Minutes of the beats that no earlier beat looks like."""
    is_new = np.ones(len(moves), bool)
    for first in range(0, len(moves), 500):
        rows = np.arange(first, min(first + 500, len(moves)))
        is_new[rows] = ~(_twins(moves, rows, params) & (np.arange(len(moves)) < rows[:, None])).any(axis=1)
    return float(moves.lengths[is_new].sum()) / 60


def _twins(moves: Moves, nodes: IntArray, params: ChoreographerParams) -> BoolArray:
    """Which nodes look like each of `nodes`, (P, N); each like itself."""
    twins = moves.alike.rows(nodes) < params.twin
    twins[np.arange(nodes.size), nodes] = True
    return twins


def repetition(moves: Moves, path: IntArray, params: ChoreographerParams) -> tuple[int, float]:
    """The longest stretch of beats that one recording also has, and the share of beats that look like earlier ones."""
    twins = _twins(moves, path, params)
    is_repeated = np.triu(twins[:, path].T, k=1).any(axis=0)
    before = np.full(len(moves), -1)
    before[moves.following[moves.following >= 0]] = np.flatnonzero(moves.following >= 0)
    stretch, longest = np.zeros(len(moves), np.int64), 0
    for row in twins:
        stretch = np.where(row, np.where(before >= 0, stretch[before], 0) + 1, 0)
        longest = max(longest, int(stretch.max()))
    return longest, float(is_repeated.mean())


def recording_shares(moves: Moves, path: IntArray) -> dict[str, float]:
    """Share of the beats by recording, largest first."""
    counts = np.bincount(moves.course[path], minlength=len(moves.courses)) / path.size
    order = np.argsort(-counts, kind="stable")
    return {moves.courses[number].take.name: float(counts[number]) for number in order.tolist() if counts[number]}


def stretches(moves: Moves, path: IntArray, music: MusicBeats) -> FloatArray:
    """Logarithm (M,) of how much longer each beat is danced than it was recorded."""
    return np.log(np.diff(music.times) / moves.lengths[path])


def warnings_of(
    moves: Moves, music: MusicBeats, *, worst: float, minutes: float, is_own_pulse: bool, has_beats: bool
) -> tuple[str, ...]:
    """Sentences about what this corpus cannot do for this song."""
    lines = []
    if not has_beats:
        lines.append("no beats are heard in this music: the dance keeps a tempo of its own")
    if worst > VISIBLE_SEAM or minutes < LEAST_MINUTES:
        reason = f"{minutes:.1f} distinct minutes" if minutes < LEAST_MINUTES else f"a seam of {worst:.0f} cm shows"
        rule = f": {ENOUGH_MINUTES:g} distinct minutes of a dance do, {LEAST_MINUTES:g} is the least"
        lines.append(f"{TOO_LITTLE} ({reason}){rule if minutes < ENOUGH_MINUTES else ''}")
    ratio = float(np.median(moves.lengths)) / music.period
    if not is_own_pulse and has_beats and abs(ratio - 1) > OTHER_TEMPO:
        pace = "faster" if ratio > 1 else "slower"
        lines.append(
            f"the music ({60 / music.period:.0f} bpm) is {100 * abs(ratio - 1):.0f} % {pace} than the recorded dancing "
            f"({60 / float(np.median(moves.lengths)):.0f} bpm)"
        )
    return (*lines, *_bar_warning(moves, music, is_own_pulse))


def _bar_warning(moves: Moves, music: MusicBeats, is_own_pulse: bool) -> tuple[str, ...]:
    """A sentence where the bar is not danced, and why."""
    meter = moves.meter
    if is_own_pulse or meter == 0:
        return ("the bar is not danced: where it begins in these recordings is not known",)
    if music.meter == 0:
        return ('"one" of this music is not known, so the bar is not danced; say where a bar begins (--one SECONDS)',)
    if not (moves.meters == music.meter).any():
        return (f"the bar is not danced: the music has {music.meter} beats in a bar, these recordings {meter}",)
    return ()
