"""A dance of recorded beats: chosen for the beats of the music by dynamic programming, then laid on them.

Laid beats are turned and shifted onto each other, faded, with whole bones, on feet.
"""

import zlib
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from scipy.interpolate import PchipInterpolator

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton, heading, root_position
from harmolab.files import Progress, silent
from harmolab.systems.choreographer import moves as mv
from harmolab.systems.choreographer.moves import ChoreographerParams, Clouds, Course, Moves
from harmolab.systems.training.feet import grounded
from harmolab.systems.training.motion_code import bone_lengths, continued, fixed_bones
from harmolab.systems.training.units import paced_beats
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray, Motion, SingleArray

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
    early = max(0, int(np.ceil((times[0] - start) / period - SLACK)))
    late = max(0, int(np.ceil((end - times[-1]) / period - SLACK)))
    filled, at = paced_beats(times, period, early, late, longest=LONGEST_INTERVAL)
    first = max(0, int(np.searchsorted(filled, start + SLACK, side="right")) - 1)
    last = max(int(np.searchsorted(filled, end - SLACK)), first + 1)
    inside = slice(first, last + 1)
    if places is None or meter < 1:
        return MusicBeats(filled[inside], np.zeros(0, np.int64), 0)
    numbers = np.arange(filled.size)
    before = np.clip(np.searchsorted(at, numbers, side="right") - 1, 0, None)
    counted = (places[before] + numbers - at[before]) % meter
    return MusicBeats(filled[inside], counted[inside], meter)


def node_costs(moves: Moves, music: MusicBeats, params: ChoreographerParams, seed: int) -> SingleArray:
    """Cost of each of the N nodes at each of the M beats, (M, N), whatever is danced before it."""
    meter = music.meter or mv.USUAL_METER
    off = np.abs(np.log(music.lengths)[:, None] - np.log(moves.lengths))
    # Drawn by the seed and by the beats: another song of the same tempo gets another dance.
    luck = np.random.default_rng([seed, zlib.crc32(np.round(music.times, 3).tobytes())]).gumbel(size=len(moves))
    own = params.harmony * (1 - moves.shares) - NOISE_SHARE * params.noise * luck + mv.TOO_LONG * moves.gaps
    effort = params.energy * np.square(music.ranks[:, None] - moves.ranks) if music.ranks.size else 0.0
    return (params.tempo / meter * off + own + effort).astype(np.float32)


def candidates(moves: Moves, music: MusicBeats) -> list[IntArray]:
    """The nodes that may be danced to each beat: those of its place in the bar, all where no place is known."""
    every = np.arange(len(moves))
    is_alike = moves.meters == music.meter
    fitting = {place: np.flatnonzero((moves.places == place) & is_alike) for place in range(music.meter)}
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
    variety = np.float32(params.variety / (music.meter or mv.USUAL_METER))
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


def _columns(rows: SingleArray, nodes: IntArray) -> SingleArray:
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
        self._kinds: list[SingleArray] = []
        self._likeness: SingleArray | None = None
        if moves.seams.is_dense:
            lengths = (0, shortest, max(shortest, params.longest_run))
            seams = moves.seam_rows(self._every, params)
            self._kinds = [self._priced(self._every, np.full(len(moves), run), *seams) for run in lengths]
            self._likeness = self._alike(self._every)

    def costs(self, nodes: IntArray, run: IntArray) -> SingleArray:
        """Cost (P, N) of going from each of `nodes` to any, after runs of so many beats (P,)."""
        if not self._kinds:
            return self._priced(nodes, run, *self._moves.seam_rows(nodes, self._params))
        kind = np.where(run < self._shortest, 0, np.where(run < self._params.longest_run, 1, 2))
        rows = np.empty((nodes.size, len(self._moves)), np.float32)
        for number, kept in enumerate(self._kinds):
            rows[kind == number] = kept[nodes[kind == number]]
        return rows

    def likeness(self, nodes: IntArray) -> SingleArray:
        """Likeness of each of `nodes` to any, (P, N), 1 for the same."""
        return self._alike(nodes) if self._likeness is None else self._likeness[nodes]

    def go_on(self, before: IntArray, now: IntArray) -> BoolArray:
        """True where a run goes on from a node of `before` (P,) to that of `now`: recorded so, or in a twin."""
        distance = self._moves.seams.pairs(self._moves.start[before] + 1, self._moves.start[now])
        return np.asarray((self._moves.following[before] == now) | (distance < self._params.twin))

    def _priced(self, nodes: IntArray, run: IntArray, distance: SingleArray, seam: SingleArray) -> SingleArray:
        """`costs`, computed of the distances and prices (P, N) of `Moves.seam_rows`."""
        moves, params = self._moves, self._params
        twins, is_long, cost = distance < params.twin, run >= params.longest_run, seam.copy()
        cost += np.float32(mv.TOO_SHORT) * ((run < self._shortest)[:, None] & ~twins)
        cost += np.float32(mv.TOO_LONG) * (is_long[:, None] & twins)
        rows = np.flatnonzero(moves.following[nodes] >= 0)
        cost[rows, moves.following[nodes[rows]]] = np.where(is_long[rows], mv.TOO_LONG, 0.0)
        return cost

    def _alike(self, nodes: IntArray) -> SingleArray:
        return np.exp(-np.square(self._moves.alike.rows(nodes) / np.float32(self._params.alike)))


def _traced(links: list[tuple[IntArray, IntArray]], last: int) -> IntArray:
    """The nodes of the path that ends with the `last` of the nodes of the last beat."""
    path = []
    for nodes, parent in reversed(links):
        path.append(int(nodes[last]))
        last = int(parent[last])
    return np.array(path[::-1])


# Chosen beats laid on the beats of the music

FADE = 0.5  # beats to either side of a seam


@dataclass(frozen=True)
class Run:
    """Beats of one recording that are danced in a row.

    Parameters
    ----------
    course : number of the recording
    beat : number in it of the first beat
    first, last : beats of the music; the run is danced from `first` to `last`
    seam : centimetres, size of the seam it begins with; 0 for the first
    turn, shift : the run turned (a complex number of size 1), then shifted (x + i z, metres)
    """

    course: int
    beat: int
    first: int
    last: int
    seam: float = 0.0
    turn: complex = 1.0
    shift: complex = 0.0


def fit(fixed: Clouds, moved: Clouds) -> tuple[complex, complex]:
    """The turn and then the shift that bring one cloud nearest to another: ``turn * x + shift``."""
    cross = complex((fixed.floor[0].astype(np.complex128) * moved.floor[0].conj()).sum())
    turn = cross / abs(cross) if abs(cross) > 0 else 1.0
    return turn, complex(fixed.middles[0] - turn * moved.middles[0])


def runs_of(
    moves: Moves, path: IntArray, params: ChoreographerParams, *, turn: complex = 1.0, shift: complex = 0.0
) -> list[Run]:
    """The path (M,) as runs, the first turned and shifted as told, each other one onto the one before."""
    begins = np.flatnonzero(np.concatenate([[True], moves.following[path[:-1]] != path[1:]]))
    ends = np.append(begins[1:], path.size)
    runs: list[Run] = []
    for first, last in zip(begins.tolist(), ends.tolist(), strict=True):
        node = int(path[first])
        run = Run(int(moves.course[node]), int(moves.beat[node]), first, last, turn=turn, shift=shift)
        runs.append(_joined(moves, runs[-1], run, params) if runs else run)
    return runs


def _joined(moves: Moves, before: Run, run: Run, params: ChoreographerParams) -> Run:
    """`run` with its seam, turned and shifted onto `before`."""
    end = before.beat + before.last - before.first
    fixed, moved = (
        mv.clouds_of(moves.courses[course].positions((beat + mv.around(params))[None]), moves.weights)
        for course, beat in ((before.course, end), (run.course, run.beat))
    )
    turn, shift = fit(fixed, moved)
    off = np.abs(fixed.floor[0] - turn * moved.floor[0]) ** 2 + (fixed.heights[0] - moved.heights[0]) ** 2
    seam = float(np.sqrt(off.sum())) * mv.CENTIMETRES
    return Run(run.course, run.beat, run.first, run.last, seam, turn * before.turn, before.turn * shift + before.shift)


def beat_numbers(music: MusicBeats, times: FloatArray) -> FloatArray:
    """Beat number (T,) of times within the beats: smooth, whole on the beats, and still where the pose is held."""
    moments, first = np.unique(np.concatenate([music.times - music.held, music.times]), return_index=True)
    numbers = np.tile(np.arange(music.times.size, dtype=np.float64), 2)[first]
    if numbers.size < 3:
        return np.interp(times, moments, numbers)
    return np.asarray(PchipInterpolator(moments, numbers)(times))


def faded(moves: Moves, runs: list[Run], numbers: FloatArray) -> FloatArray:
    """Joints (T, J, 3) at beat numbers (T,) of the music: the runs, each faded into the next around their seam."""
    positions = np.zeros((numbers.size, len(moves.courses[0].take.motion.skeleton.joints), 3))
    for number, run in enumerate(runs):
        weight = np.ones(numbers.size)
        if number > 0:
            weight *= _risen(numbers - run.first)
        if number < len(runs) - 1:
            weight *= 1 - _risen(numbers - run.last)
        frames = np.flatnonzero(weight > 0)
        own = moves.courses[run.course].positions(run.beat + numbers[frames] - run.first)
        floor = (own[..., 0] + 1j * own[..., 2]) * run.turn + run.shift
        placed = np.stack([floor.real, own[..., 1], floor.imag], axis=-1)
        positions[frames] += weight[frames, None, None] * placed
    return positions


def _risen(numbers: FloatArray) -> FloatArray:
    """Progress of a fade, 0 to 1, that many beats from its seam; without a jump in speed or acceleration."""
    share = np.clip(numbers / (2 * FADE) + 0.5, 0.0, 1.0)
    return share**3 * (10 - 15 * share + 6 * share**2)


def corpus_bones(moves: Moves) -> FloatArray:
    """Mean length (J,) of each bone over the recordings, metres."""
    motions = [course.take.motion for course in moves.courses]
    lengths = [bone_lengths(motion.positions, motion.skeleton) for motion in motions]
    return np.average(lengths, axis=0, weights=[motion.n_frames for motion in motions])


def danced(
    moves: Moves, runs: list[Run], numbers: FloatArray, fps: float, *, plant_feet: bool, initial: Motion | None = None
) -> FloatArray:
    """Joints (T, J, 3) of the dance: faded, with whole bones, on the floor, on feet that stand.

    The dancer starts at x = z = 0 and faces +z; or where `initial` ends, and goes on from there.
    """
    skeleton, lengths = moves.courses[0].take.motion.skeleton, corpus_bones(moves)
    positions = fixed_bones(faded(moves, runs, numbers), skeleton.parents, lengths)
    if initial is None:
        positions = _from_the_middle(positions, fps, skeleton)
    positions = grounded(positions, fps, skeleton, plant_feet=plant_feet)
    if initial is None:
        return positions
    past = resample_motion(initial, fps).positions if initial.fps != fps else initial.positions
    joined = continued(past.reshape(len(past), -1), positions.reshape(len(positions), -1), fps)
    return fixed_bones(joined.reshape(positions.shape), skeleton.parents, lengths)


def _from_the_middle(positions: FloatArray, fps: float, skeleton: Skeleton) -> FloatArray:
    """Positions (T, J, 3) that start at x = z = 0 and face +z."""
    facing = np.exp(1j * heading(positions, fps, skeleton)[0])
    place = root_position(positions[:1], skeleton)[0]
    # A heading turns from +z towards +x, x + i z the other way round.
    floor = (positions[..., 0] - place[0] + 1j * (positions[..., 2] - place[2])) * facing
    return np.stack([floor.real, positions[..., 1], floor.imag], axis=-1)


class Ending:
    """The last half beat of a motion that a dance goes on from.

    Parameters
    ----------
    initial : Motion
    lead : float, beats from the start of the dance's first node to its first frame
    period : float, seconds of a beat there
    """

    def __init__(self, initial: Motion, lead: float, period: float, moves: Moves, params: ChoreographerParams) -> None:
        self._moves, self._params = moves, params
        back = np.linspace(-0.5, 0.0, params.samples)
        self._at = lead + back
        line = np.arange(initial.n_frames) / initial.fps
        last = np.clip(line[-1] + back * period, 0.0, None)
        flat = initial.positions.reshape(initial.n_frames, -1)
        ended = np.stack([np.interp(last, line, column) for column in flat.T], axis=1)
        self._cloud = mv.clouds_of(ended.reshape(1, back.size, -1, 3), moves.weights)

    def costs(self) -> FloatArray:
        """Cost of beginning with each node (N,)."""
        moves, costs = self._moves, np.empty(len(self._moves))
        for number, course in enumerate(moves.courses):
            nodes = np.flatnonzero(moves.course == number)
            costs[nodes] = mv.distances(self._cloud, self._clouds(course, moves.beat[nodes]))[0]
        return costs + self._params.seam

    def fit(self, node: int) -> tuple[complex, complex]:
        """The turn and the shift that bring a node onto the ending."""
        moves = self._moves
        return fit(self._cloud, self._clouds(moves.courses[moves.course[node]], moves.beat[node : node + 1]))

    def _clouds(self, course: Course, beats: IntArray) -> Clouds:
        return mv.clouds_of(course.positions(beats[:, None] + self._at), self._moves.weights)
