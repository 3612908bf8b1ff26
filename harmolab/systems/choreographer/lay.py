"""Chosen beats laid on the beats of the music: turned and shifted onto each other, faded, with whole bones, on feet."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton, heading, root_position
from harmolab.systems.choreographer.choose import MusicBeats
from harmolab.systems.choreographer.moves import (
    CENTIMETRES,
    ChoreographerParams,
    Clouds,
    Course,
    Moves,
    around,
    clouds_of,
    distances,
)
from harmolab.systems.training.feet import on_floor, planted_feet
from harmolab.systems.training.motion_code import bone_lengths, continued, fixed_bones
from harmolab.types import FloatArray, IntArray, Motion

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
        clouds_of(moves.courses[course].positions((beat + around(params))[None]), moves.weights)
        for course, beat in ((before.course, end), (run.course, run.beat))
    )
    turn, shift = fit(fixed, moved)
    off = np.abs(fixed.floor[0] - turn * moved.floor[0]) ** 2 + (fixed.heights[0] - moved.heights[0]) ** 2
    seam = float(np.sqrt(off.sum())) * CENTIMETRES
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
    joints = len(moves.courses[0].take.motion.skeleton.joints)
    positions = np.zeros((numbers.size, joints, 3))
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
    positions = on_floor(positions, fps)
    if plant_feet:
        positions = planted_feet(positions, fps, skeleton)
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
        self._cloud = clouds_of(ended.reshape(1, back.size, -1, 3), moves.weights)

    def costs(self) -> FloatArray:
        """Cost of beginning with each node (N,)."""
        moves, costs = self._moves, np.empty(len(self._moves))
        for number, course in enumerate(moves.courses):
            nodes = np.flatnonzero(moves.course == number)
            costs[nodes] = distances(self._cloud, self._clouds(course, moves.beat[nodes]))[0]
        return costs + self._params.seam

    def fit(self, node: int) -> tuple[complex, complex]:
        """The turn and the shift that bring a node onto the ending."""
        moves = self._moves
        return fit(self._cloud, self._clouds(moves.courses[moves.course[node]], moves.beat[node : node + 1]))

    def _clouds(self, course: Course, beats: IntArray) -> Clouds:
        return clouds_of(course.positions(beats[:, None] + self._at), self._moves.weights)
