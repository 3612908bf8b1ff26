"""Which recorded beat is danced to which beat of the music: dynamic programming over all that there are."""

import zlib
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from harmolab.files import Progress, silent
from harmolab.systems.choreographer.moves import TOO_LONG, TOO_SHORT, USUAL_METER, ChoreographerParams, Float32, Moves
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray

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
    held : (M + 1,) array, seconds before each for which the pose is held; none when left out
    ranks : (M,) array in [0, 1], rank of speed in the body to aim at in each beat; empty: any will do
    """

    times: FloatArray
    places: IntArray
    meter: int
    held: FloatArray = None  # type: ignore[assignment]  # filled in below
    ranks: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if self.held is None:
            object.__setattr__(self, "held", np.zeros(self.times.size))

    @property
    def lengths(self) -> FloatArray:
        """(M,) seconds in which each beat is danced."""
        return np.diff(self.times) - self.held[1:]

    @property
    def period(self) -> float:
        """The usual interval, seconds."""
        return float(np.median(self.lengths))

    def part(self, keep: BoolArray, held: FloatArray) -> Self:
        """The beats of a mask (M + 1,), with the seconds `held` (M + 1,) before each beat."""
        places = self.places[keep] if self.places.size else self.places
        return replace(self, times=self.times[keep], places=places, held=held[keep])


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
    inside = slice(first, last + 1)
    if places is None or meter < 1:
        return MusicBeats(filled[inside], np.zeros(0, np.int64), 0)
    before = np.clip(np.searchsorted(numbers, every, side="right") - 1, 0, None)
    counted = (places[before] + every - numbers[before]) % meter
    return MusicBeats(filled[inside], counted[inside], meter)


def node_costs(moves: Moves, music: MusicBeats, params: ChoreographerParams, seed: int) -> Float32:
    """Cost of each of the N nodes at each of the M beats, (M, N), whatever is danced before it."""
    meter = music.meter or USUAL_METER
    off = np.abs(np.log(music.lengths)[:, None] - np.log(moves.lengths))
    # Drawn by the seed and by the beats: another song of the same tempo gets another dance.
    luck = np.random.default_rng([seed, zlib.crc32(np.round(music.times, 3).tobytes())]).gumbel(size=len(moves))
    own = params.harmony * (1 - moves.shares) - NOISE_SHARE * params.noise * luck
    effort = params.energy * np.square(music.ranks[:, None] - moves.ranks) if music.ranks.size else 0.0
    return (params.tempo / meter * off + own + effort).astype(np.float32)


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

    Each path has its run, the beats since its last seam; the turns that it has turned; and its memory of what it
    danced: per node ``max(memory exp(-1 / 400), exp(-(S / 6 cm)^2))`` with the distance S of the beats.

    Parameters
    ----------
    first : (N,) array, what it costs to begin with a node; nothing when left out
    """
    costs, options = node_costs(moves, music, params, seed), candidates(moves, music)
    steps = Steps(moves, params, music.meter or params.unplaced_run)
    variety = np.float32(params.variety / (music.meter or USUAL_METER))
    now = options[0]
    total = costs[0][now] + (0 if first is None else first[now].astype(np.float32))
    turns = moves.turns.astype(np.float32)
    turned = turns[now]
    run, memory, best = np.ones(now.size, np.int64), np.zeros((1, len(moves)), np.float32), np.zeros(now.size, np.int64)
    links: list[tuple[IntArray, IntArray]] = [(now, best)]
    for beat in progress(range(1, len(costs)), "choosing"):
        before, now = now, options[beat]
        kept = np.arange(before.size)
        if before.size > params.paths:
            kept = np.sort(np.argpartition(total, params.paths)[: params.paths])
        memory = memory[best[kept]]
        memory *= np.float32(np.exp(-1 / params.forgetting))
        np.maximum(memory, steps.likeness(before[kept]), out=memory)
        step = variety * _columns(memory, now)
        step += _columns(steps.costs(before[kept], run[kept]), now)
        step += total[kept, None]
        step += np.float32(params.winding) * np.abs(turned[kept, None] + turns[now])
        best = step.argmin(axis=0)
        parent = kept[best]
        total = step[best, np.arange(now.size)] + costs[beat][now]
        turned = turned[parent] + turns[now]
        run = np.where(steps.go_on(before[parent], now), run[parent] + 1, 1)
        links.append((now, parent))
    return _traced(links, int(total.argmin()))


def _columns(rows: Float32, nodes: IntArray) -> Float32:
    """The columns (P, Q) of rows (P, N) that belong to nodes; the rows themselves where these are all."""
    return rows if nodes.size == rows.shape[1] else rows[:, nodes]


class Steps:
    """Costs of going from one node to another, by the length of the run so far.

    A run that goes on, or goes over to a twin, costs nothing more until it is too long; a seam costs more where the run
    is too short. Of few nodes all is computed beforehand, of many when it is asked for.
    """

    def __init__(self, moves: Moves, params: ChoreographerParams, shortest: int) -> None:
        self._moves, self._params, self._shortest = moves, params, shortest
        self._every = np.arange(len(moves))
        self._kinds: list[Float32] = []
        self._likeness: Float32 | None = None
        if moves.seams.is_dense:
            lengths = (0, shortest, max(shortest, params.longest_run))
            self._kinds = [self._priced(self._every, np.full(len(moves), run)) for run in lengths]
            self._likeness = self._alike(self._every)

    def costs(self, nodes: IntArray, run: IntArray) -> Float32:
        """Cost (P, N) of going from each of `nodes` to any, after runs of so many beats (P,)."""
        if not self._kinds:
            return self._priced(nodes, run)
        kind = np.where(run < self._shortest, 0, np.where(run < self._params.longest_run, 1, 2))
        rows = np.empty((nodes.size, len(self._moves)), np.float32)
        for number, kept in enumerate(self._kinds):
            rows[kind == number] = kept[nodes[kind == number]]
        return rows

    def likeness(self, nodes: IntArray) -> Float32:
        """Likeness of each of `nodes` to any, (P, N), 1 for the same."""
        return self._alike(nodes) if self._likeness is None else self._likeness[nodes]

    def go_on(self, before: IntArray, now: IntArray) -> BoolArray:
        """True where a run goes on from a node of `before` (P,) to that of `now`: recorded so, or in a twin."""
        distance = self._moves.seams.pairs(self._moves.start[before] + 1, self._moves.start[now])
        return np.asarray((self._moves.following[before] == now) | (distance < self._params.twin))

    def _priced(self, nodes: IntArray, run: IntArray) -> Float32:
        """`costs`, computed."""
        moves, params = self._moves, self._params
        distance, cost = moves.seam_rows(nodes, params)
        twins, is_long = distance < params.twin, run >= params.longest_run
        cost += np.float32(TOO_SHORT) * ((run < self._shortest)[:, None] & ~twins)
        cost += np.float32(TOO_LONG) * (is_long[:, None] & twins)
        rows = np.flatnonzero(moves.following[nodes] >= 0)
        cost[rows, moves.following[nodes[rows]]] = np.where(is_long[rows], TOO_LONG, 0.0)
        return cost

    def _alike(self, nodes: IntArray) -> Float32:
        rows = self._moves.alike.rows(nodes) / np.float32(self._params.alike)
        return np.exp(-np.square(rows))


def _traced(links: list[tuple[IntArray, IntArray]], last: int) -> IntArray:
    """The nodes of the path that ends with the `last` of the nodes of the last beat."""
    path = []
    for nodes, parent in reversed(links):
        path.append(int(nodes[last]))
        last = int(parent[last])
    return np.array(path[::-1])
