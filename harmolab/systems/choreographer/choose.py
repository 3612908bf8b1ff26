"""Which recorded beat is danced to which beat of the music: dynamic programming over all that there are."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from harmolab.io.files import Progress, silent
from harmolab.systems.choreographer.moves import Float32, Moves
from harmolab.systems.choreographer.params import TOO_LONG, TOO_SHORT, USUAL_METER, ChoreographerParams
from harmolab.types import BeatTrack, FloatArray, IntArray

LONGEST_INTERVAL = 1.75  # in usual intervals; beats are put into longer ones
NOISE_SHARE = 0.3
SLACK = 1e-6  # seconds


@dataclass(frozen=True, eq=False)
class MusicBeats:
    """The beats of the music that is danced to, without gaps: from the last before its start to the first after it.

    Parameters
    ----------
    times : (M + 1,) array, seconds
    places : (M + 1,) array, place in the bar of each; empty when unknown
    meter : int, beats in a bar, 0 when unknown
    """

    times: FloatArray
    places: IntArray
    meter: int

    @property
    def period(self) -> float:
        """The usual interval, seconds."""
        return float(np.median(np.diff(self.times)))


def beats_between(track: BeatTrack, start: float, end: float, *, meter: int, period: float) -> MusicBeats:
    """The beats of a track that cover `start` to `end` seconds; where it has none they go on at its usual pace.

    `meter` is that of its places, if it has any; `period` the pace of music that has less than two beats.
    """
    times, places = track.times, track.bar_places
    if times.size > 1:
        period = float(np.median(np.diff(times)))
    elif times.size == 0:
        times, places = np.array([start]), None
    intervals = np.diff(times)
    steps = np.where(intervals > LONGEST_INTERVAL * period, np.round(intervals / period), 1).astype(np.int64)
    numbers = np.concatenate([[0], np.cumsum(steps)])
    early = max(0, int(np.ceil((times[0] - start) / period - SLACK)))
    late = max(0, int(np.ceil((end - times[-1]) / period - SLACK)))
    every = np.arange(-early, numbers[-1] + late + 1)
    filled = np.interp(every, numbers, times)
    filled += period * (np.minimum(every, 0) + np.maximum(every - numbers[-1], 0))
    first = max(0, int(np.searchsorted(filled, start + SLACK, side="right")) - 1)
    last = max(int(np.searchsorted(filled, end - SLACK)), first + 1)
    wanted = slice(first, last + 1)
    if places is None or meter < 1:
        return MusicBeats(filled[wanted], np.zeros(0, np.int64), 0)
    before = np.clip(np.searchsorted(numbers, every, side="right") - 1, 0, None)
    counted = (places[before] + every - numbers[before]) % meter
    return MusicBeats(filled[wanted], counted[wanted], meter)


def seed_of(seed: int, times: FloatArray) -> np.random.Generator:
    """Random numbers of a seed and of the beats: another song of the same tempo gets another dance."""
    return np.random.default_rng([seed, zlib.crc32(np.round(times, 3).tobytes())])


def node_costs(moves: Moves, music: MusicBeats, params: ChoreographerParams, seed: int) -> Float32:
    """What each of the N nodes costs at each of the M beats, (M, N), whatever is danced before it."""
    meter = music.meter or USUAL_METER
    off = np.abs(np.log(np.diff(music.times))[:, None] - np.log(moves.lengths))
    luck = seed_of(seed, music.times).gumbel(size=len(moves))
    own = params.harmony * (1 - moves.shares) - NOISE_SHARE * params.noise * luck
    return (params.tempo / meter * off + own).astype(np.float32)


def candidates(moves: Moves, music: MusicBeats) -> list[IntArray]:
    """The nodes that may be danced to each beat: those of its place in the bar, all where no place is known."""
    every = np.arange(len(moves))
    fitting = {
        place: np.flatnonzero((moves.places == place) & (moves.meters == music.meter)) for place in range(music.meter)
    }
    if not all(nodes.size for nodes in fitting.values()) or not fitting:
        return [every] * (music.times.size - 1)
    return [fitting[place] for place in music.places[:-1].tolist()]


def choose(
    moves: Moves,
    music: MusicBeats,
    params: ChoreographerParams,
    *,
    seed: int = 0,
    first: FloatArray | None = None,
    progress: Progress = silent,
) -> IntArray:
    """The nodes (M,) to dance, one a beat, whose costs have the least sum: the best path to every node is kept.

    Each path has its run, the beats since its last seam, and its memory of what it danced: per node
    ``max(memory exp(-1 / 32), exp(-(S / 6 cm)^2))`` with the distance S of the beats.

    Parameters
    ----------
    first : (N,) array, what it costs to begin with a node; nothing when left out
    """
    costs, options = node_costs(moves, music, params, seed), candidates(moves, music)
    meter = music.meter or USUAL_METER
    shortest = music.meter or params.unplaced_run
    now = options[0]
    total = costs[0][now] + (0 if first is None else first[now].astype(np.float32))
    memory, run = _likeness(moves, now, params), np.ones(now.size, np.int64)
    steps: list[tuple[IntArray, IntArray]] = [(now, np.zeros(0, np.int64))]
    for beat in progress(range(1, len(costs)), "choosing"):
        before, now = now, options[beat]
        kept = np.arange(before.size)
        if before.size > params.paths:
            kept = np.sort(np.argpartition(total, params.paths)[: params.paths])
        step, goes_on = _steps(moves, before[kept], now, run[kept], shortest, params)
        step += np.float32(params.variety / meter) * memory[np.ix_(kept, now)] + total[kept, None]
        best = step.argmin(axis=0)
        column = np.arange(now.size)
        parent = kept[best]
        total = step[best, column] + costs[beat][now]
        run = np.where(goes_on[best, column], run[parent] + 1, 1)
        memory = np.maximum(memory[parent] * np.float32(np.exp(-1 / params.forgetting)), _likeness(moves, now, params))
        steps.append((now, parent))
    return _traced(steps, int(total.argmin()))


def _steps(
    moves: Moves, before: IntArray, now: IntArray, run: IntArray, shortest: int, params: ChoreographerParams
) -> tuple[Float32, np.ndarray]:
    """Cost (P, Q) of going from each node to each, by the length of the run so far, and where the run goes on."""
    distance, cost = moves.seam_rows(before, params)
    goes_on, cost = distance[:, now] < params.twin, cost[:, now]
    too_long = (run >= params.longest_run)[:, None]
    cost += np.float32(TOO_SHORT) * ((run < shortest)[:, None] & ~goes_on)
    cost += np.float32(TOO_LONG) * (too_long & goes_on)
    column = np.full(len(moves), -1)
    column[now] = np.arange(now.size)
    following = np.where(moves.following[before] >= 0, column[moves.following[before]], -1)
    rows = np.flatnonzero(following >= 0)
    cost[rows, following[rows]] = np.where(too_long[rows, 0], TOO_LONG, 0.0)
    goes_on[rows, following[rows]] = True
    return cost, goes_on


def _likeness(moves: Moves, nodes: IntArray, params: ChoreographerParams) -> Float32:
    """How much each of `nodes` looks like any, (P, N), 1 for the same."""
    return np.exp(-np.square(moves.alike.rows(nodes) / np.float32(params.alike)))


def _traced(steps: list[tuple[IntArray, IntArray]], last: int) -> IntArray:
    """The nodes of the path that ends with the `last` of the nodes of the last beat."""
    path = []
    for nodes, parent in reversed(steps):
        path.append(int(nodes[last]))
        last = int(parent[last]) if parent.size else last
    return np.array(path[::-1])
