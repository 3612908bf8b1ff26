"""Choreography: figures on a grid of beats become key poses, one for each end of a movement."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from harmolab.corpora.synthetic.beats import BeatGrid, ClipSettings, MovementEnds, movement_ends
from harmolab.corpora.synthetic.body import (
    ARMS,
    BOTH_ARMS,
    CHEST,
    FEET,
    HEAD,
    HEADING,
    PELVIS,
    POSE_SIZE,
    RISE,
    ROOT,
    UPPER_BODY,
)  # fmt: skip
from harmolab.corpora.synthetic.figures import ARM_POSES, FIGURES, MANNERS, Manner, figure_names
from harmolab.io.beats import Unit
from harmolab.types import FloatArray

EIGHTH = np.pi / 4
STAGE = 2.0  # metres from the middle beyond which the dancer turns back
FASTEST_FOOT = 3.0  # metres per second, mean over a unit; the peak is 1.9 times that
FASTEST_ARM, FASTEST_TURN = 4.0, 3.5  # radians per second, likewise


@dataclass(frozen=True, eq=False)
class Choreography:
    """A dance as a function of continuous time.

    Parameters
    ----------
    ends : MovementEnds
        Times of the key poses; every one ends a movement unit.
    poses : (M, POSE_SIZE) array, one key pose per end
    units : tuple of Unit
        The figures in order, each from the beat it sets out on to the beat it ends on.
    stature : float, metres
    swing : (3, 2) array
        Rate (hertz) and phase (radians) of the slow swing of breath, weight and gaze, which keeps no beat.
    """

    ends: MovementEnds
    poses: FloatArray
    units: tuple[Unit, ...]
    stature: float
    swing: FloatArray


@dataclass(frozen=True, eq=False)
class _Figure:
    """Steps of a figure, and arms and chest on each beat; the same for every dancer."""

    steps: tuple[str, ...]
    arms: FloatArray  # (beats, 2, 5) radians, of the free and the supporting side
    chest: FloatArray  # (beats, 4) twist, bow, lean and turn of the head, within -1 and 1


def _figure(name: str, dance: str) -> _Figure:
    """A figure of the vocabulary; arms and chest are drawn from a generator that its name seeds."""
    steps = tuple(FIGURES[dance][name.removeprefix(f"{dance} ")].split())
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    poses = MANNERS[dance].arms
    arm_poses = np.empty((len(steps), 2), int)
    for side in range(2):
        arm_poses[0, side] = rng.integers(len(poses))
        for beat in range(1, len(steps)):  # never the same pose twice running
            arm_poses[beat, side] = (arm_poses[beat - 1, side] + rng.integers(1, len(poses))) % len(poses)
    arms = np.radians([ARM_POSES[pose] for pose in poses])[arm_poses]
    # Signs alternate, so that the chest moves on every beat.
    chest = rng.uniform(0.4, 1.0, (len(steps), 4)) * np.where(np.arange(len(steps)) % 2, 1, -1)[:, None]
    return _Figure(steps, arms, chest)


def choreography(grid: BeatGrid, settings: ClipSettings) -> Choreography:
    """The settings' dance on a grid of beats; their seed sets the dancer (stature, habits) and the figures.

    Raises
    ------
    ValueError
        For a figure that the dance does not have, or no figure.
    """
    rng = np.random.default_rng([settings.seed, 4])
    stature = float(np.clip(rng.normal(1.70, 0.07), 1.55, 1.90))
    swing = np.stack([rng.uniform(0.12, 0.35, 3), rng.uniform(0, 2 * np.pi, 3)], axis=1)
    routine = _routine(grid, settings, rng)
    ends = movement_ends(grid, settings)
    plan, units = _plan(settings.dance, grid, routine)
    poses = _Dancer(MANNERS[settings.dance], stature, grid, rng).dance(plan, ends)
    return Choreography(ends, poses, units, stature, swing)


def _routine(grid: BeatGrid, settings: ClipSettings, rng: np.random.Generator) -> tuple[str, ...]:
    """The figures to dance in turn: two for a short clip, more for a longer one."""
    names = figure_names(settings.dance)
    count = int(np.clip(grid.times[-1] // 8, 2, len(names)))
    drawn = tuple(names[place] for place in rng.permutation(len(names))[:count])
    if settings.figures is None:
        return drawn
    unknown = [name for name in settings.figures if name not in names]
    if unknown or not settings.figures:
        raise ValueError(f"figures must name some of {', '.join(names)}; got {', '.join(unknown) or 'none'}")
    return settings.figures


def _plan(
    dance: str, grid: BeatGrid, routine: tuple[str, ...]
) -> tuple[list[tuple[_Figure, int] | None], tuple[Unit, ...]]:
    """The figure of each beat and the place in it, and the figures as units."""
    plan: list[tuple[_Figure, int] | None] = [None] * grid.times.size
    figures = {name: _figure(name, dance) for name in set(routine)}
    counts = dict.fromkeys(routine, 0)
    units, beat, turn = [], grid.first_downbeat or grid.meter, 0
    while beat < grid.times.size:
        name = routine[turn % len(routine)]
        steps = min(len(figures[name].steps), grid.times.size - beat)
        plan[beat : beat + steps] = [(figures[name], place) for place in range(steps)]
        counts[name] += 1
        start, end = grid.times[[beat - 1, beat + steps - 1]]
        units.append(Unit(f"{name} {counts[name]}", float(start), float(end), steps, name))
        beat, turn = beat + steps, turn + 1
    return plan, tuple(units)


class _Dancer:
    """The state of a dancer from beat to beat: where the feet are, which one is free, where the body faces."""

    def __init__(self, manner: Manner, stature: float, grid: BeatGrid, rng: np.random.Generator) -> None:
        self.manner, self.size, self.grid, self.rng = manner, stature / 1.7, grid, rng
        self.stature = stature
        self.heading = float(rng.uniform(-np.pi, np.pi))
        self.support = int(rng.integers(2))
        self.energy = float(rng.uniform(0.85, 1.15))
        self.feet = np.zeros((2, 4))
        for side in range(2):
            self.feet[side] = self._foothold(np.zeros(2), 0.0, 0.08, side)

    def dance(self, plan: list[tuple[_Figure, int] | None], ends: MovementEnds) -> FloatArray:
        """(M, POSE_SIZE) a key pose per movement end. A beat without an end is a step that is not taken."""
        neutral = _Figure(("-",), np.radians([[ARM_POSES[self.manner.arms[0]]] * 2]), np.zeros((1, 4)))
        poses = np.empty((ends.times.size, POSE_SIZE))
        habits = np.zeros((self.grid.times.size, POSE_SIZE))
        habits[:, UPPER_BODY] = self.rng.normal(0, np.radians(3), habits[:, UPPER_BODY].shape)
        planted = np.flatnonzero(ends.beats >= 0)
        spans = np.diff(ends.times[planted], prepend=ends.times[:1] - 1.0)
        for count, (key, span) in enumerate(zip(planted, spans, strict=True)):
            beat = int(ends.beats[key])
            figure, place = plan[beat] or (neutral, 0)
            poses[key] = self._key_pose(figure, place, beat, span) + habits[beat]
            if count:
                before = poses[planted[count - 1], BOTH_ARMS]
                turn = np.clip(poses[key, BOTH_ARMS] - before, -FASTEST_ARM * span, FASTEST_ARM * span)
                poses[key, BOTH_ARMS] = before + turn
        for key in np.flatnonzero(ends.beats < 0):
            poses[key] = self._halfway(poses, int(key), ends)
        return poses

    def _key_pose(self, figure: _Figure, place: int, beat: int, span: float) -> FloatArray:
        """(POSE_SIZE,) where a unit of `span` seconds leads: further with more time, furthest on a downbeat."""
        position = int(self.grid.positions[beat])
        vigour = self.energy * min(span / 0.5, 1.2) * (1.25 if position == 0 else 0.9)
        self._step(figure.steps[place], self.manner.step * vigour, span)
        free = 1 - self.support
        side = 1 if self.support == 0 else -1  # towards the supporting leg: left is +
        twist, bow, lean, gaze = figure.chest[place] * np.radians(self.manner.sway) * vigour
        pose = np.zeros(POSE_SIZE)
        pose[ROOT] = self._balance()
        pose[HEADING] = self.heading
        pose[RISE] = self.manner.rise[position] * self.size * vigour
        pose[PELVIS] = side * np.radians(self.manner.hips) * vigour
        pose[CHEST] = side * twist, 0.06 + 0.4 * bow, -side * 0.6 * lean
        pose[HEAD] = side * 1.2 * gaze
        for which, arm in enumerate((free, self.support)):
            pose[ARMS[arm]] = self._arm(figure, place, which, min(vigour, 0.9))
        for foot in range(2):
            pose[FEET[foot]] = self.feet[foot]
            pose[FEET[foot]][3] += np.radians(self.manner.heels[position])
        return pose

    def _arm(self, figure: _Figure, place: int, which: int, vigour: float) -> FloatArray:
        """(5,) angles of an arm; a dancer short of time stays nearer to the middle of the figure's poses."""
        middle = figure.arms[:, which].mean(axis=0)
        return middle + vigour * (figure.arms[place, which] - middle)

    def _step(self, step: str, length: float, span: float) -> None:
        """Turn, then move the free foot within `span` seconds; with weight on it the other foot is free next."""
        angle = EIGHTH * (step.count("<") - step.count(">")) + self._homeward()
        turn = np.clip(angle, -FASTEST_TURN * span, FASTEST_TURN * span)
        move, free = step[0], 1 - self.support
        self.heading += turn
        self.feet[self.support, 2] += 0.7 * turn  # the supporting foot turns most of the way with the body
        self.feet[:, 3] = 0.0
        if move == "-":
            return
        ahead = {"f": length, "b": -0.9 * length, "x": 0.4 * length, "k": -0.4 * length, "t": 0.5 * length}.get(move, 0)
        apart = {"o": 0.16 + 0.8 * length, "x": -0.1, "k": -0.1, "t": 0.2 + 0.4 * length}.get(move, 0.17)
        foothold = self._foothold(self.feet[self.support, :2], ahead, apart, free)
        path = foothold[:2] - self.feet[free, :2]
        foothold[:2] = self.feet[free, :2] + path * min(1.0, FASTEST_FOOT * span / max(np.hypot(*path), 1e-9))
        self.feet[free] = foothold
        if move == "t":
            self.feet[free, 3] = np.radians(35)
        else:
            self.support = free

    def _homeward(self) -> float:
        """A turn of up to an eighth towards the middle of the stage, when the dancer has strayed from it."""
        place = self.feet[:, :2].mean(axis=0)
        if np.hypot(*place) < STAGE:
            return 0.0
        angle = np.arctan2(-place[0], -place[1]) - self.heading
        return float(np.clip((angle + np.pi) % (2 * np.pi) - np.pi, -EIGHTH, EIGHTH))

    def _foothold(self, origin: FloatArray, ahead: float, apart: float, foot: int) -> FloatArray:
        """(4,) a place ahead of `origin` and to the side of `foot`, toes turned out a little."""
        side = 1 if foot == 0 else -1
        front = np.array([np.sin(self.heading), np.cos(self.heading)])
        left = np.array([np.cos(self.heading), -np.sin(self.heading)])
        x, z = origin + self.size * (ahead * front + side * apart * left)
        return np.array([x, z, self.heading + side * np.radians(8), 0.0])

    def _balance(self) -> FloatArray:
        """(2,) where the waist is: nearly over the supporting foot, a little before the ankles."""
        places = self.feet[:, :2]
        front = np.array([np.sin(self.heading), np.cos(self.heading)])
        return 0.7 * places[self.support] + 0.3 * places[1 - self.support] + 0.035 * self.size * front

    def _halfway(self, poses: FloatArray, key: int, ends: MovementEnds) -> FloatArray:
        """A stop on the way between two key poses, with the arms beside the straight way."""
        planted = np.flatnonzero(ends.beats >= 0)
        place = int(np.searchsorted(planted, key))
        if planted.size == 0:
            return np.zeros(POSE_SIZE)
        before, after = planted[max(place - 1, 0)], planted[min(place, planted.size - 1)]
        share = np.interp(ends.times[key], ends.times[[before, after]], [0.0, 1.0]) if before < after else 0.0
        pose = poses[before] + share * (poses[after] - poses[before])
        near = np.abs(np.delete(ends.times, key) - ends.times[key]).min()
        pose[BOTH_ARMS] += self.rng.normal(0, np.radians(6), pose[BOTH_ARMS].shape) * min(near / 0.2, 1.0)
        return pose
