"""Motion as the networks of Music2Dance take it: positions (our mode) or rotations (the paper's, Sec. 4.4.1).

Rotations are fitted to twenty points of a body, each a joint or the middle of joints. Markers are not joints: two on
the head, none at pelvis and neck. Forearm markers are left out, since they turn about the arm and make it jump.

A code turns positions into channels and back, frame by frame but for the root's path, whose channels are rates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from harmolab.body.rotations import Body, fit_body, forward_kinematics, joint_rotations
from harmolab.body.skeletons import Skeleton, ancestors, children, heading, joint_part, joint_side, turned
from harmolab.systems.training.about import stored_skeleton
from harmolab.systems.training.motion_code import bone_lengths, decode_motion, encode_motion, fixed_bones, n_channels
from harmolab.types import FloatArray, Motion

# Twenty points of a body, to which rotations are fitted

_SIDES = (("L", "left"), ("R", "right"))
_ARM, _LEG = ("shoulder", "elbow", "hand"), ("hip", "knee", "ankle", "toe", "heel")
POINTS = Skeleton(
    (
        "pelvis", "torso", "neck", "head",
        *(f"{part} {letter}" for letter, _ in _SIDES for part in _ARM),
        *(f"{part} {letter}" for letter, _ in _SIDES for part in _LEG),
    ),
    (-1, 0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 12, 12, 0, 15, 16, 17, 17),
)  # fmt: skip
# Names of a hand: its marker, not that of a finger.
_HANDS = ("hand", "wrist", "finger")


def body_points(motion: Motion) -> Motion:
    """The points of `POINTS` of a motion whose joints have the names that they need.

    Raises
    ------
    ValueError
        If a joint is missing: torso, head, and on both sides shoulder, elbow, hand (or wrist, finger), hip, knee,
        ankle, toe and heel.
    """
    if motion.skeleton == POINTS:
        return motion
    places = sources(motion.skeleton)
    positions = np.stack([motion.positions[:, places[name]].mean(axis=1) for name in POINTS.joints], axis=1)
    return Motion(positions, motion.fps, POINTS, motion.valid)


def sources(skeleton: Skeleton) -> Mapping[str, list[int]]:
    """Point -> the joints that it is the middle of; ValueError for a skeleton that lacks one."""
    named: dict[tuple[str, str], list[int]] = {}
    for joint, name in enumerate(skeleton.joints):
        named.setdefault((joint_side(name), joint_part(name)), []).append(joint)
    joints: dict[str, list[int]] = {}
    for (letter, side), part in product(_SIDES, (*_ARM, *_LEG)):
        parts = _HANDS if part == "hand" else (part,)
        joints[f"{part} {letter}"] = next((named[side, name] for name in parts if (side, name) in named), [])
    joints["pelvis"] = joints["hip L"] + joints["hip R"]
    joints["neck"] = joints["shoulder L"] + joints["shoulder R"]
    joints["torso"] = named.get(("", "torso"), [])
    joints["head"] = [joint for (_, part), members in named.items() if part == "head" for joint in members]
    if missing := [name for name in POINTS.joints if not joints[name]]:
        raise ValueError(f"no joint for {', '.join(missing)}; joints are {', '.join(skeleton.joints)}")
    return joints


# Codes of positions and of rotations

ROOT = 7  # channels of the root in the code of rotations
END_EFFECTORS = ("toe L", "toe R", "head", "hand L", "hand R")
APART = 0.01  # radians, or metres, by which the bodies of two codes of rotations may differ
EVERY = 5  # frames: a body's shape is fitted to one in so many


@dataclass(frozen=True, eq=False)
class PositionCode:
    """The motion code of `harmolab.systems.training.motion_code`; bones get their lengths after decoding."""

    skeleton: Skeleton
    lengths: FloatArray

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Self:
        """The code of recorded motions of one skeleton: bones are as long as they are on average."""
        skeleton = motions[0].skeleton
        lengths = [bone_lengths(motion.positions[motion.valid], skeleton) for motion in motions]
        return cls(skeleton, np.average(lengths, axis=0, weights=[motion.n_frames for motion in motions]))

    @property
    def n_motion(self) -> int:
        """Channels C."""
        return n_channels(self.skeleton)

    def encode(self, motion: Motion) -> FloatArray:
        """The channels (T, C) of a recorded motion."""
        return encode_motion(motion.positions, motion.fps, motion.skeleton).astype(np.float64)

    def decode(self, code: ArrayLike, fps: float) -> FloatArray:
        """Positions (T, J, 3) metres; the dancer starts at x = z = 0, heading 0."""
        return fixed_bones(decode_motion(code, fps, self.skeleton), self.skeleton.parents, self.lengths)

    def to_dict(self) -> dict[str, Any]:
        """All that `stored_code` needs, JSON-able."""
        return {"kind": "positions", "skeleton": asdict(self.skeleton), "lengths": self.lengths.tolist()}


@dataclass(frozen=True, eq=False)
class RotationCode:
    """Root, rotations of the joints that carry others, and places of feet, head and hands (Eq. 2-4).

    ============  ====================================================================================================
    0 ... 2       yaw rate, root's velocity to the side and forward in its heading, per second
    3             height of the root, metres
    4 ... 6       what else the root is turned, beside its heading, as a rotation vector
    7 ... 42      rotation vectors of 12 joints, from their mean rotation
    43 ... 57     toes, head, hands: x and z from the root in its heading, y from the floor, metres (`end_effectors`)
    ============  ====================================================================================================

    Parameters
    ----------
    body : Body of the 20 points of `points.POINTS`
    means : (J, 3) array, rotation vector of each joint's mean rotation; the root's without its heading
    end_effectors : bool
    """

    body: Body
    means: FloatArray
    end_effectors: bool = True

    @classmethod
    def of(cls, motions: Sequence[Motion], *, end_effectors: bool = True) -> Self:
        """The code of recorded motions: a body of their mean shape, and the joints' mean rotations."""
        points = [body_points(motion) for motion in motions]
        frames = np.concatenate([motion.positions[motion.valid][::EVERY] for motion in points])
        first = cls(fit_body(frames, POINTS), np.zeros((len(POINTS.joints), 3)), end_effectors)
        facings = [heading(motion.positions, motion.fps, POINTS) for motion in points]
        pairs = zip(points, facings, strict=True)
        turns = np.concatenate([first._turns(motion, facing)[motion.valid][::EVERY] for motion, facing in pairs])
        means = [Rotation.from_matrix(turns[:, joint]).mean().as_rotvec() for joint in range(len(POINTS.joints))]
        return cls(first.body, np.array(means), end_effectors)

    @property
    def skeleton(self) -> Skeleton:
        """The 20 points."""
        return self.body.skeleton

    @cached_property
    def rotating(self) -> list[int]:
        """Joints that carry others, but for the root."""
        below = children(self.skeleton.parents)
        return [joint for joint in self.body.order[1:] if below[joint]]

    @property
    def n_motion(self) -> int:
        """Channels C: 58, or 43 without end effectors."""
        return ROOT + 3 * len(self.rotating) + 3 * len(END_EFFECTORS) * self.end_effectors

    def encode(self, motion: Motion) -> FloatArray:
        """The channels (T, C) of a recorded motion; its own bone lengths are used to fit the rotations."""
        points = body_points(motion)
        facing = heading(points.positions, points.fps, POINTS)
        turns, means = self._turns(points, facing), Rotation.from_rotvec(self.means).as_matrix()
        away = means.swapaxes(-1, -2) @ turns
        vectors = Rotation.from_matrix(away.reshape(-1, 3, 3)).as_rotvec().reshape(*away.shape[:2], 3)
        root = points.positions[:, self.body.order[0]]
        columns = [_rates(root, facing, points.fps), root[:, 1:2], vectors[:, self.body.order[0]]]
        columns += [vectors[:, joint] for joint in self.rotating]
        if self.end_effectors:
            columns.append(self.effectors(points.positions, facing).reshape(len(root), -1))
        return np.column_stack(columns)

    def decode(self, code: ArrayLike, fps: float) -> FloatArray:
        """Positions (T, J, 3) metres, from x = z = 0 and heading 0 on; places of end effectors are not read (R36)."""
        code = np.asarray(code, dtype=np.float64)
        steps = code[:, :3] / fps
        steps[:1] = 0.0
        facing = np.cumsum(steps[:, 0])
        way = np.cumsum(turned(np.insert(steps[:, 1:], 1, 0.0, axis=1), facing), axis=0)
        root, order = way + code[:, 3:4] * np.array([0.0, 1.0, 0.0]), self.body.order
        vectors = np.zeros((len(code), len(POINTS.joints), 3))
        vectors[:, order[0]] = code[:, 4:ROOT]
        vectors[:, self.rotating] = code[:, ROOT : ROOT + 3 * len(self.rotating)].reshape(len(code), -1, 3)
        turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3)
        turns = Rotation.from_rotvec(self.means).as_matrix() @ turns
        turns[:, order[0]] = _about_y(facing) @ turns[:, order[0]]
        return forward_kinematics(turns, root, self.body)

    def effectors(self, positions: FloatArray, facing: FloatArray) -> FloatArray:
        """Places (T, 5, 3) of `END_EFFECTORS` of positions (T, J, 3): x, z from the root in its heading, y as it is."""
        joints = [self.skeleton.joints.index(name) for name in END_EFFECTORS]
        root = positions[:, self.body.order[0], None] * np.array([1.0, 0.0, 1.0])
        return turned(positions[:, joints] - root, -facing[:, None])

    def to_dict(self) -> dict[str, Any]:
        """All that `stored_code` needs, JSON-able."""
        body = {"skeleton": asdict(self.skeleton), "offsets": self.body.offsets.tolist()}
        return {"kind": "rotations", **body, "means": self.means.tolist(), "end_effectors": self.end_effectors}

    def refreshed(self, code: ArrayLike, fps: float) -> FloatArray:
        """A code (T, C) whose end effectors are where its rotations put them."""
        fresh = np.array(code, dtype=np.float64)
        if self.end_effectors:
            facing = np.cumsum(np.append(0.0, fresh[1:, 0] / fps))
            places = self.effectors(self.decode(fresh, fps), facing)
            fresh[:, -places[0].size :] = places.reshape(len(fresh), -1)
        return fresh

    def _turns(self, points: Motion, facing: FloatArray) -> FloatArray:
        """Rotations (T, J, 3, 3) of a body of the recording's own bone lengths; the root's without its heading."""
        own = self.body.resized(bone_lengths(points.positions[points.valid], POINTS))
        turns = joint_rotations(points.positions, own)
        root = self.body.order[0]
        turns[:, root] = _about_y(-facing) @ turns[:, root]
        return turns


MotionCode = PositionCode | RotationCode


def stored_code(stored: Mapping[str, Any]) -> MotionCode:
    """A code as `to_dict` describes it; ValueError for what cannot be."""
    skeleton = stored_skeleton(stored)
    ancestors(skeleton.parents)  # refuses bones in a circle
    n_joints = len(skeleton.joints)
    if stored["kind"] == "positions":
        lengths = _numbers(stored["lengths"], (n_joints,))
        if (lengths < 0).any():
            raise ValueError(f"describes a bone of {lengths.min()} m")
        return PositionCode(skeleton, lengths)
    if stored["kind"] != "rotations" or skeleton != POINTS:
        raise ValueError(f"describes motion as {str(stored['kind'])[:40]!r}, which is not known, or of another body")
    body = Body(skeleton, _numbers(stored["offsets"], (n_joints, 3)))
    return RotationCode(body, _numbers(stored["means"], (n_joints, 3)), bool(stored["end_effectors"]))


def check_same_channels(code: MotionCode, needed: MotionCode) -> None:
    """ValueError unless the channels of a code mean what those of another do; bones may have other lengths."""
    kinds = [each.to_dict()["kind"] for each in (code, needed)]
    if kinds[0] != kinds[1]:
        raise ValueError(f"takes motion as {kinds[0]}; the generator dances {kinds[1]}")
    if code.skeleton != needed.skeleton:
        counts = len(code.skeleton.joints), len(needed.skeleton.joints)
        raise ValueError(f"takes another skeleton ({counts[0]} joints) than the generator's ({counts[1]} joints)")
    if isinstance(code, RotationCode) and isinstance(needed, RotationCode):
        pairs = ((code.means, needed.means), (code.body.offsets, needed.body.offsets))
        if code.end_effectors != needed.end_effectors or not all(np.allclose(*pair, 0, APART) for pair in pairs):
            raise ValueError("takes rotations from another body at rest; train it on the recordings of the generator")


def _numbers(values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"describes a body by numbers of shape {array.shape}; finite ones of shape {shape} are needed")
    return array


def _rates(root: FloatArray, facing: FloatArray, fps: float) -> FloatArray:
    """Yaw rate and velocity of the root (T, 3), as `encode_motion` takes them, the yaw first."""
    steps = turned(np.diff(root * np.array([1.0, 0.0, 1.0]), axis=0), -facing[1:])[:, [0, 2]]
    rates = np.column_stack([np.diff(facing), steps]) * fps
    return np.concatenate([rates[:1], rates])


def _about_y(angle: FloatArray) -> FloatArray:
    """(T, 3, 3) rotations about the vertical: heading 0 (+z) to heading `angle` (T,), pi / 2 being +x."""
    return Rotation.from_rotvec(angle[:, None] * np.array([0.0, 1.0, 0.0])).as_matrix()
