"""A synthetic dancer whose movement units end on planted beats: body, figures, choreography, recorded motion.

The body has 21 joints and an adult's proportions: poses in angles and footholds, by forward kinematics, with bones of
constant length. The vocabulary is eight figures for each of seven dances; each dance has its manner. Figures on a grid
of beats become key poses, one for each end of a movement, and the motion is what a recorder of any frame rate would
see.

A figure is a string with one step per beat, over two bars:

    f forward, b back, o out to the side, c close, x cross in front, k cross behind, t tap without weight, - no step

and any number of turns behind the letter, each of 45 degrees: `>` to the right, `<` to the left. The free foot moves,
so that a figure danced from the other foot is its mirror image. The names are the ballroom's; the figures are sketches.
"""

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from harmolab.body.rotations import two_bones
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic.beats import BeatGrid, ClipSettings, MovementEnds, grid_through, movement_ends
from harmolab.params import DANCES
from harmolab.readers.beats import Unit
from harmolab.types import FloatArray, Motion

# The body: forward kinematics of its poses

# The harmony paper's points 0 to 20. The neck is no joint: head and shoulders hang on the torso.
DANCER = Skeleton(
    (
        "head L", "head R", "torso", "shoulder L", "elbow L", "forearm L", "hand L", "hip L", "knee L", "ankle L",
        "heel L", "toe L", "shoulder R", "elbow R", "wrist R", "finger R", "hip R", "knee R", "ankle R", "heel R",
        "toe R",
    ),
    (2, 2, -1, 2, 3, 4, 5, 2, 7, 8, 9, 9, 2, 12, 13, 14, 2, 16, 17, 18, 18),
)  # fmt: skip

# Segment lengths as shares of the stature (Drillis and Contini 1966, as in Winter, "Biomechanics and motor control").
# The torso point is the waist, about which chest and pelvis turn.
SHARES: Mapping[str, float] = {
        "waist": 0.605, "shoulder": 0.818, "head": 0.93, "hip": 0.53, "ankle": 0.039,
        "half shoulders": 0.129, "half hips": 0.065, "half head": 0.044,
        "upper arm": 0.186, "forearm": 0.146, "hand": 0.054, "finger": 0.108,
        "thigh": 0.245, "shank": 0.246, "heel": 0.04, "toe": 0.1,
    }  # fmt: skip

# Where each quantity stands in a pose vector. Angles are radians; root and feet are places on the floor, metres (x, z).
ROOT = slice(0, 2)
HEADING, RISE, PELVIS = 2, 3, 4
CHEST = slice(5, 8)  # twist, bow, lean
HEAD = 8
ARMS = (slice(9, 14), slice(14, 19))  # left, right: as `synth_figures.ARM_POSES`
FEET = (slice(19, 23), slice(23, 27))  # left, right: ankle when flat (x, z), direction, lift of the heel
BOTH_ARMS, UPPER_BODY = slice(9, 19), slice(4, 19)
POSE_SIZE = 27

REACH = 0.995  # of the leg's length: a knee is never quite straight
EASY = 0.012  # of the stature that the waist is lower when standing easily
SOFTNESS = 0.012  # metres over which the waist gives way when a leg is at its reach


def joint_positions(poses: FloatArray, lifts: FloatArray, stature: float) -> FloatArray:
    """Joints of the body in each pose, by forward kinematics; the knees follow from hips and ankles.

    Parameters
    ----------
    poses : (T, POSE_SIZE) array, laid out as `ROOT` to `FEET` above
    lifts : (T, 2) array, metres
        Height of the left and right foot above the floor.
    stature : float, metres

    Returns
    -------
    (T, 21, 3) array, metres, y up, right-handed; at heading 0 the dancer faces +z and its left is +x.
    """
    still = np.zeros(len(poses))
    heading = poses[:, HEADING]
    pelvis = _turned(heading, still, poses[:, PELVIS])
    # The chest faces with the pelvis but does not tilt with it.
    chest = _turned(heading, still, still) @ _turned(*poses[:, CHEST].T)
    height = SHARES["hip"] - SHARES["waist"]
    hips = [pelvis @ _offset(side * SHARES["half hips"], height, 0, stature) for side in (1, -1)]
    ankles = [_foot(poses[:, where], lifts[:, side], stature) for side, where in enumerate(FEET)]
    torso = _torso(poses, hips, [ankle[0] for ankle in ankles], stature)
    joints = np.empty((len(poses), len(DANCER.joints), 3))
    joints[:, 2] = torso
    joints[:, 0:2] = torso[:, None] + _head(chest, poses[:, HEAD], stature)
    for side, (arm, leg) in enumerate(((3, 7), (12, 16))):
        joints[:, arm : arm + 4] = torso[:, None] + _arm(chest, poses[:, ARMS[side]], 1 - 2 * side, stature)
        ankle, heel, toe = ankles[side]
        hip = torso + hips[side]
        facing = (heading + poses[:, FEET[side]][:, 2]) / 2
        knee, reached = _leg(hip, ankle, facing, stature)
        shift = reached - ankle
        joints[:, leg : leg + 5] = np.stack([hip, knee, reached, heel + shift, toe + shift], axis=1)
    return joints


def _offset(x: float, y: float, z: float, stature: float) -> FloatArray:
    return stature * np.array([x, y, z])


def _turned(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """(T, 3, 3) rotations: roll about z (left side up), then pitch about x (bow), then yaw about y (to the left)."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(angle), np.sin(angle)) for angle in (yaw, pitch, roll))
    one, nil = np.ones_like(cy), np.zeros_like(cy)
    about_y = np.stack([cy, nil, sy, nil, one, nil, -sy, nil, cy], axis=-1).reshape(-1, 3, 3)
    about_x = np.stack([one, nil, nil, nil, cp, -sp, nil, sp, cp], axis=-1).reshape(-1, 3, 3)
    about_z = np.stack([cr, -sr, nil, sr, cr, nil, nil, nil, one], axis=-1).reshape(-1, 3, 3)
    return about_y @ about_x @ about_z


def _head(chest: FloatArray, turn: FloatArray, stature: float) -> FloatArray:
    """(T, 2, 3) left and right of the head from the torso; it turns about the spine, which keeps its distance."""
    still = np.zeros_like(turn)
    sides = np.array([[SHARES["half head"], SHARES["head"] - SHARES["waist"], 0.02]] * 2) * stature
    sides[1, 0] *= -1
    return np.einsum("tab,jb->tja", chest @ _turned(turn, still, still), sides)


def _arm(chest: FloatArray, angles: FloatArray, side: int, stature: float) -> FloatArray:
    """(T, 4, 3) shoulder, elbow, wrist and hand from the torso; `side` is 1 on the left, -1 on the right."""
    lift, front, plane, elbow, wrist = angles.T
    nil = np.zeros_like(lift)
    upper = np.stack([side * np.sin(lift) * np.cos(front), -np.cos(lift), np.sin(lift) * np.sin(front)], axis=-1)
    outward = np.stack([side * np.cos(lift) * np.cos(front), np.sin(lift), np.cos(lift) * np.sin(front)], axis=-1)
    forward = np.stack([-side * np.sin(front), nil, np.cos(front)], axis=-1)
    across = np.cos(plane)[:, None] * forward + np.sin(plane)[:, None] * outward
    lower, hand = (np.cos(bend)[:, None] * upper + np.sin(bend)[:, None] * across for bend in (elbow, elbow + wrist))
    shoulder = np.broadcast_to(
        _offset(side * SHARES["half shoulders"], SHARES["shoulder"] - SHARES["waist"], 0, stature), upper.shape
    )
    # The left hand is marked at its middle, the right one at a finger.
    tip = SHARES["hand"] if side == 1 else SHARES["finger"]
    lengths = np.array([SHARES["upper arm"], SHARES["forearm"], tip])[:, None, None] * stature
    chain = np.cumsum([shoulder, *(lengths * [upper, lower, hand])], axis=0)
    return np.einsum("tab,jtb->tja", chest, chain)


def _foot(foothold: FloatArray, lift: FloatArray, stature: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(T, 3) ankle, heel and toe of a foot that turns about its toe when the heel rises."""
    x, z, yaw, pitch = foothold.T
    still = np.zeros_like(yaw)
    frame = _turned(yaw, still, still)
    ball = np.stack([x, lift, z], axis=-1) + frame @ _offset(0, 0, SHARES["toe"], stature)
    raised = _turned(yaw, pitch, still)
    ankle = raised @ _offset(0, SHARES["ankle"], -SHARES["toe"], stature)
    heel = raised @ _offset(0, 0, -SHARES["toe"] - SHARES["heel"], stature)
    return ball + ankle, ball + heel, ball


def _torso(poses: FloatArray, hips: list[FloatArray], ankles: list[FloatArray], stature: float) -> FloatArray:
    """(T, 3) the waist: as high as the pose wants, but never higher than both legs reach (a soft minimum)."""
    x, z = poses[:, ROOT].T
    heights = [(SHARES["waist"] - EASY) * stature + poses[:, RISE]]
    leg = REACH * (SHARES["thigh"] + SHARES["shank"]) * stature
    for hip, ankle in zip(hips, ankles, strict=True):
        away = np.hypot(x + hip[:, 0] - ankle[:, 0], z + hip[:, 2] - ankle[:, 2])
        heights.append(ankle[:, 1] - hip[:, 1] + np.sqrt(np.maximum(leg**2 - away**2, 0)))
    height = -SOFTNESS * np.logaddexp.reduce(-np.array(heights) / SOFTNESS, axis=0)
    return np.stack([x, height, z], axis=-1)


def _leg(hip: FloatArray, ankle: FloatArray, facing: ArrayLike, stature: float) -> tuple[FloatArray, FloatArray]:
    """(T, 3) knee and ankle of a leg between hip and ankle; the knee bends towards `facing` (radians, yaw)."""
    ahead = np.stack([np.sin(facing), np.zeros(len(hip)), np.cos(facing)], axis=-1)
    return two_bones(hip, ankle, SHARES["thigh"] * stature, SHARES["shank"] * stature, ahead)


# Figures and manners of the seven dances

FIGURES: Mapping[str, Mapping[str, str]] = json.loads(Path(__file__).with_name("figures.json").read_text("utf-8"))


def figure_names(dance: str) -> tuple[str, ...]:
    """The figures of a dance, by the names that `beats.json` uses, such as "waltz box"."""
    return tuple(f"{dance} {name}" for name in FIGURES[dance])


# Degrees: elevation of the upper arm from hanging, its azimuth from the side to the front, plane of the elbow (0 bends
# a hanging arm forward, 90 a raised one upward), bend of the elbow, bend of the wrist.
ARM_POSES: Mapping[str, tuple[float, float, float, float, float]] = {
    "low": (14.0, 50.0, 10.0, 25.0, 5.0),
    "side": (78.0, 10.0, 40.0, 20.0, 10.0),
    "front": (65.0, 75.0, 50.0, 35.0, 5.0),
    "high": (150.0, 30.0, 30.0, 30.0, 10.0),
    "chest": (42.0, 45.0, 15.0, 110.0, 5.0),
    "bent": (28.0, 30.0, 20.0, 85.0, 0.0),
    "hip": (45.0, -25.0, -50.0, 95.0, 25.0),
    "frame": (72.0, 25.0, 35.0, 70.0, 5.0),
    "wide frame": (84.0, 5.0, 35.0, 45.0, 5.0),
    "close frame": (58.0, 40.0, 25.0, 95.0, 5.0),
}


@dataclass(frozen=True)
class Manner:
    """The manner of a dance. Lengths are metres for a dancer of 1.7 m and a movement of half a second;
    angles degrees.

    Parameters
    ----------
    step : float, length of a step
    hips : float, tilt of the pelvis over the supporting leg
    sway : float, lean and twist of the chest
    rise : heights of the waist above its middle, one per beat of the bar
    heels : lifts of the heels, one per beat of the bar
    arms : names of the arm poses in use
    """

    step: float
    hips: float
    sway: float
    rise: tuple[float, ...]
    heels: tuple[float, ...]
    arms: tuple[str, ...]


JIVE = ("low", "bent", "front", "side")
LATIN = ("low", "side", "front", "high", "chest", "hip")
BALLROOM = ("frame", "wide frame", "close frame")

MANNERS: Mapping[str, Manner] = {
        "cha-cha": Manner(0.34, 9.0, 11.0, (0.0, -0.03, 0.0, -0.02), (0.0, 4.0, 0.0, 8.0), LATIN),
        "jive": Manner(0.3, 7.0, 10.0, (-0.04, 0.01, -0.04, 0.01), (6.0, 14.0, 6.0, 14.0), JIVE),
        "quickstep": Manner(0.5, 3.0, 8.0, (-0.04, 0.0, 0.02, 0.03), (0.0, 6.0, 16.0, 20.0), BALLROOM),
        "rumba": Manner(0.4, 11.0, 12.0, (0.01, -0.02, 0.0, -0.02), (0.0, 4.0, 4.0, 4.0), LATIN),
        "samba": Manner(0.34, 10.0, 12.0, (-0.05, 0.0, -0.05, 0.0), (0.0, 8.0, 0.0, 8.0), LATIN),
        "tango": Manner(0.45, 2.0, 14.0, (-0.05, -0.03, -0.06, -0.02), (0.0, 0.0, 0.0, 0.0), BALLROOM),
        "waltz": Manner(0.5, 3.0, 13.0, (-0.06, 0.0, 0.04), (0.0, 12.0, 26.0), BALLROOM),
    }  # fmt: skip


# Choreography: key poses, and the motion through them

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


MUSICAL = {"tempo", "drift", "sample_rate"}  # settings of the music alone
CARRY = 0.4  # share of travel that flows through the beats rather than stopping on them


def dance_motion(dance: Choreography, settings: ClipSettings) -> Motion:
    """A choreography as a recorder with the settings' frame rate and noise would see it."""
    seconds, fps = settings.seconds, settings.fps
    poses, lifts = _poses_at(dance, np.arange(round(seconds * fps)) / fps)
    positions = joint_positions(poses, lifts, dance.stature)
    if settings.noise:
        positions += settings.noise * np.random.default_rng([settings.seed, 5]).standard_normal(positions.shape)
    return Motion(positions, fps, DANCER)


def _poses_at(dance: Choreography, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(T, POSE_SIZE) poses and (T, 2) heights of the feet at any times.

    Each unit goes from key pose to key pose with minimum jerk, so its speed is zero at both ends. Part of the travel
    flows on through the keys, and a slow swing never rests, as in people.
    """
    keys = dance.ends.times
    if keys.size < 2:
        still = dance.poses[0] if keys.size else np.zeros(POSE_SIZE)
        return _with_swing(np.tile(still, (times.size, 1)), dance, times), np.zeros((times.size, 2))
    unit = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, keys.size - 2)
    share = np.clip((times - keys[unit]) / (keys[unit + 1] - keys[unit]), 0, 1)
    course = (share**3 * (10 - 15 * share + 6 * share**2))[:, None]
    poses = dance.poses[unit] + course * (dance.poses[unit + 1] - dance.poses[unit])
    flowing = [0, 1, HEADING]
    flow = PchipInterpolator(keys, dance.poses[:, flowing])(np.clip(times, keys[0], keys[-1]))
    poses[:, flowing] += CARRY * (flow - poses[:, flowing])
    return _with_swing(poses, dance, times), 4 * course * (1 - course) * _swing_heights(dance.poses)[unit]


def _swing_heights(poses: FloatArray) -> FloatArray:
    """(M - 1, 2) metres that each foot is lifted in each unit: the further it goes the higher, up to 8 cm."""
    paths = [np.diff(poses[:, where][:, :2], axis=0) for where in FEET]
    far = np.stack([np.hypot(*path.T) for path in paths], axis=1)
    return np.minimum(0.2 * far, 0.08)


def _with_swing(poses: FloatArray, dance: Choreography, times: FloatArray) -> FloatArray:
    """The poses with breath in the chest, weight shifting in the waist and a wandering gaze."""
    breath, weight, gaze = (np.sin(2 * np.pi * rate * times + phase) for rate, phase in dance.swing)
    swung = poses.copy()
    swung[:, CHEST] += np.stack([0.02 * weight, 0.015 * breath, 0.015 * weight], axis=-1)
    swung[:, RISE] += 0.004 * breath
    swung[:, HEAD] += 0.06 * gaze
    return swung


def synthetic_motion(beat_times: ArrayLike, downbeat_times: ArrayLike = (), **settings: Any) -> Motion:
    """A computed dancer to beats of yours: each movement ends on a beat, but for the liberties that the settings name.

    The movement is a function of continuous time: the same seed at another frame rate is the same dance.

    Parameters
    ----------
    beat_times : (B,) array, seconds
        At least two. They are continued at the same pace to fill the clip.
    downbeat_times : array, seconds
        First beats of the bars, as far as they are known.
    **settings
        dance, seconds, fps, lateness, jitter, omission, redundancy, noise, figures and seed, as in `ClipSettings`.

    Returns
    -------
    Motion of 21 named joints, metres

    Raises
    ------
    ValueError
        For a setting out of range, or one that the beats decide (tempo, drift, sample_rate); the message names it.

    Examples
    --------
    >>> synthetic_motion([0.5, 1.0, 1.5], dance="jive", seconds=3.0, fps=30.0)
    Motion(3.00 s, 90 frames at 30 fps, 21 joints in 3D)
    """
    if musical := MUSICAL & settings.keys():
        raise ValueError(f"{min(musical)} is no setting of a motion to given beats")
    clip = ClipSettings(**settings)
    grid = grid_through(beat_times, downbeat_times, DANCES[clip.dance].meter, clip.seconds)
    return dance_motion(choreography(grid, clip), clip)
