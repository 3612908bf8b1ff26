"""The joint tree and the body: names and sides of joints, feet and hands, order of the tree, heading, the body frame.

Positions are (T, J, 3) metres with y up, or (T, J, 2) image coordinates. Heading 0 faces +z, heading pi / 2 faces +x.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

# Those of harmolab.types, which builds on this module.
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

HEADING_SMOOTHING = 0.1  # seconds; what is left follows turns, not the swing of single joints
FOLLOW = 0.8  # seconds over which a camera's way is smoothed
SHORTEST_ACROSS = 1e-6  # metres between left and right, seen from above, below which there is no heading

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
# What stands before every name of a rig: Mixamo's (with the colon that BVH cannot have), MotionBuilder's, 3ds Max's,
# VRoid's, SMPL's, Blender's and Character Creator's.
_RIG = re.compile(r"^(mixamorig\d*|character\d+|j_bip(_c)?|bip\d*|[mf]_avg|def|cc_base)[_ .-]", re.IGNORECASE)
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
# The parts that AIST++ writes in one word with their side: lhip, rtoes.
_PARTS = (
    "hip|hipjoint|upleg|thigh|femur|knee|ankle|toes?|foot|heel|"
    "clavicle|collar|(?:in)?shoulder|upperarm|humerus|elbow|wrist|hand"
)
_FUSED = re.compile(rf"(left|right)(?=.)|([lr])(?=(?:{_PARTS})$)")
_FOOT_PARTS = ("toe", "heel", "ankle", "foot")
HIPS = ("hip", "hipjoint", "upleg", "upperleg", "thigh", "femur")
HIPS_AND_SHOULDERS = (*HIPS, "shoulder", "upperarm", "humerus", "clavicle", "collar")


@dataclass(frozen=True)
class Skeleton:
    """The names of a body's joints, and the tree of bones that joins them.

    Measures of feet, hands, hips and shoulders find these joints by their names, such as left_hip, "hip L", RightUpLeg
    or l_shoulder.

    Parameters
    ----------
    joints : (J,) sequence of str
    parents : (J,) sequence of int
        Number of the joint that each joint hangs on; -1 for a root, which hangs on none.

    Raises
    ------
    ValueError
        Unless there is one parent for each joint, -1 or the number of another joint.

    Examples
    --------
    >>> Skeleton(("hip", "knee"), (-1, 0)).bones
    ((0, 1),)
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]

    def __post_init__(self) -> None:
        joints, parents = tuple(map(str, self.joints)), tuple(np.atleast_1d(self.parents).tolist())
        count = len(joints)
        if isinstance(self.joints, str):
            raise ValueError(f"joints must be a list of names, got the text {self.joints!r}")
        if count == 0 or len(parents) != count:
            raise ValueError(f"a skeleton needs one parent per joint, got {count} joints, {len(parents)} parents")
        if not all(parent in range(-1, count) and parent != joint for joint, parent in enumerate(parents)):
            raise ValueError(f"parents must be -1 or the index of another joint (0..{count - 1}): {parents}")
        vars(self).update(joints=joints, parents=tuple(map(int, parents)))

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """The bones as pairs of joint numbers, (parent, child), in the order of the children."""
        return tuple((parent, joint) for joint, parent in enumerate(self.parents) if parent >= 0)

    @classmethod
    def unnamed(cls, count: int) -> "Skeleton":
        """A skeleton of `count` joints of which nothing is known: they are called joint_0 and so on, and have no bones.

        Measures that need the names of joints refuse it.
        """
        return cls(tuple(f"joint_{i}" for i in range(count)), (-1,) * count)


# Names


def _words(name: str) -> list[str]:
    """The words of a name in lower case, its side as a word of its own; the name of a rig before them is left out."""
    words = [word.lower() for word in _WORD.findall(_RIG.sub("", name.rpartition(":")[2]))]
    if any(word in _SIDES for word in words):
        return words
    return [piece for word in words for piece in _FUSED.sub(r"\g<0> ", word, count=1).split()]


@lru_cache(maxsize=4096)
def joint_side(name: str) -> str:
    """Side of the body in a joint's name: "left", "right" or "".

    >>> [joint_side(name) for name in ("left_toe", "toe R", "LeftToeBase", "rtoes", "L_Foot", "neck")]
    ['left', 'right', 'left', 'right', 'left', '']
    """
    return next((_SIDES[word] for word in _words(name) if word in _SIDES), "")


@lru_cache(maxsize=4096)
def joint_part(name: str) -> str:
    """Part of the body in a joint's name, without side, separators and capitals.

    >>> [joint_part(name) for name in ("left_toe", "toe R", "LeftToeBase", "rtoes", "spine_1", "mixamorig:Hips")]
    ['toe', 'toe', 'toebase', 'toes', 'spine1', 'hips']
    """
    return "".join(word for word in _words(name) if word not in _SIDES)


def named_joints(skeleton: Skeleton) -> dict[tuple[str, str], int]:
    """The joint of each (side, part) that names hold; of joints of one name, the first."""
    keys = sides_and_parts(skeleton)
    return {key: keys.index(key) for key in keys}


def sides_and_parts(skeleton: Skeleton) -> list[tuple[str, str]]:
    """`joint_side` and `joint_part` of each joint."""
    return [(joint_side(name), joint_part(name)) for name in skeleton.joints]


@lru_cache(maxsize=64)
def foot_joints(skeleton: Skeleton) -> tuple[tuple[int, ...], ...]:
    """The joints of each foot, by name: toe, heel, ankle or foot. Left first; joints of no side are feet of their own.

    Targets of inverse kinematics (ik_foot_l, foot_ik.R), which may stand anywhere, are no feet.

    Raises
    ------
    ValueError
        No joint is named so.
    """
    sides: dict[str, list[int]] = {"left": [], "right": [], "": []}
    for joint, name in enumerate(skeleton.joints):
        if "ik" not in _words(name) and any(part in joint_part(name) for part in _FOOT_PARTS):
            sides[joint_side(name)].append(joint)
    if not any(sides.values()):
        parts = f"{', '.join(_FOOT_PARTS[:-1])} or {_FOOT_PARTS[-1]}"
        raise ValueError(f"no joint is called {parts}; joints are {skeleton.joints}")
    groups = (tuple(sides["left"]), tuple(sides["right"]), *((joint,) for joint in sides[""]))
    return tuple(joints for joints in groups if joints)


def side_pairs(skeleton: Skeleton, parts: Sequence[str] = HIPS_AND_SHOULDERS) -> tuple[tuple[int, int], ...]:
    """(left, right) joints of hips and shoulders, by their names: left_hip, "hip L", RightUpLeg, lhip, l_shoulder.

    >>> side_pairs(Skeleton(("hip L", "hip R", "knee L"), (-1, 0, 0)))
    ((0, 1),)
    """
    joints = named_joints(skeleton)
    paired = [part for side, part in joints if side == "left" and part in parts and ("right", part) in joints]
    return tuple((joints["left", part], joints["right", part]) for part in paired)


def skull_and_limbs(skeleton: Skeleton) -> tuple[list[int], list[tuple[int, int]]]:
    """The parts of a drawn body: joints of the head, which is one ball, and the bones but for those inside it.

    Hips and shoulders are joined across, which makes the trunk a body.

    >>> skull_and_limbs(Skeleton(("neck", "head L", "head R", "hip L", "hip R"), (-1, 0, 1, 0, 0)))
    ([1, 2], [(0, 1), (0, 3), (0, 4), (3, 4)])
    """
    skull = [joint for joint, name in enumerate(skeleton.joints) if "head" in name.lower()]
    limbs = [*skeleton.bones, *(side_pairs(skeleton) if skeleton.bones else ())]
    return skull, [limb for limb in limbs if not (limb[0] in skull and limb[1] in skull)]


# The tree


def children(parents: Sequence[int]) -> list[list[int]]:
    """The joints that hang on each joint, J lists in the order of their numbers."""
    below: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            below[parent].append(joint)
    return below


def tree_order(parents: Sequence[int]) -> tuple[int, ...]:
    """All joints, parents before children, branch by branch.

    >>> tree_order((1, 2, -1, 2))
    (2, 1, 0, 3)

    Raises
    ------
    ValueError
        If bones form a ring.
    """
    below = children(parents)
    order: list[int] = []
    waiting = [joint for joint, parent in enumerate(parents) if parent < 0][::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += below[order[-1]][::-1]
    if len(order) < len(parents):
        raise ValueError(f"parents must form a tree; the skeleton's bones form a ring: {tuple(parents)}")
    return tuple(order)


def ancestors(parents: Sequence[int]) -> IntArray:
    """(J, J) of 0 and 1: entry (i, j) is 1 where j is joint i or lies between it and its root; errors of `tree_order`.

    >>> ancestors((-1, 0, 1)).tolist()
    [[1, 0, 0], [1, 1, 0], [1, 1, 1]]
    """
    above = np.eye(len(parents), dtype=np.int64)
    for joint in tree_order(parents):
        if parents[joint] >= 0:
            above[joint] += above[parents[joint]]
    return above


def subtree(parents: Sequence[int], joint: int) -> tuple[int, ...]:
    """The joint and all that hangs on it, in order of their numbers."""
    return tuple(np.flatnonzero(ancestors(parents)[:, joint]).tolist())


def joint_indices(skeleton: Skeleton, joints: Sequence[str]) -> list[int]:
    """Numbers of the joints of these names; ValueError where there are none."""
    unknown = [name for name in joints if name not in skeleton.joints]
    if unknown or not joints:
        raise ValueError(f"no joints named {unknown}; there are {', '.join(skeleton.joints)}")
    return [skeleton.joints.index(name) for name in joints]


def skeleton_part(skeleton: Skeleton, keep: Sequence[int]) -> Skeleton:
    """The skeleton of the joints `keep`; each hangs on its nearest ancestor that is kept. Errors of `tree_order`."""
    tree_order(skeleton.parents)  # in a ring of joints that are left out the way up would never end
    parents = []
    for joint in keep:
        parent = skeleton.parents[joint]
        while parent >= 0 and parent not in keep:
            parent = skeleton.parents[parent]
        parents.append(keep.index(parent) if parent >= 0 else -1)
    return Skeleton(tuple(skeleton.joints[joint] for joint in keep), tuple(parents))


# The body in space


def root_position(positions: FloatArray, skeleton: Skeleton) -> FloatArray:
    """The root of every frame, (T, D): the first joint without parent, or, without any bone, the mean of all joints."""
    if not skeleton.bones:
        return positions.mean(axis=1)
    return positions[:, skeleton.parents.index(-1)] if -1 in skeleton.parents else positions[:, 0]


def standing_height(positions: FloatArray) -> float:
    """Height of the dancer, metres: the upper end (90th percentile) of the extent of the body in a frame."""
    return float(np.percentile(np.ptp(positions[..., 1], axis=1), 90))


def camera_way(positions: FloatArray, fps: float) -> FloatArray:
    """The way of a camera that follows the dancer, (T, D): the mean of all joints, smoothed so that it never jerks."""
    return gaussian_filter1d(positions.mean(axis=1), FOLLOW * fps, axis=0, mode="nearest")


def heading(
    positions: FloatArray,
    fps: float,
    skeleton: Skeleton,
    *,
    parts: Sequence[str] = HIPS_AND_SHOULDERS,
    smoothing: float = HEADING_SMOOTHING,
) -> FloatArray:
    """The direction that the dancer faces, (T,) radians from +z towards +x, without jumps.

    It is at a right angle to the mean line from right to left joints, seen from above. Where left and right coincide
    the heading before goes on; it is 0 throughout without names of left and right.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up
    fps : float, hertz
    skeleton : Skeleton
    parts : names of the parts that are paired (`joint_part`)
    smoothing : float, seconds
        Standard deviation of a Gaussian over the line from right to left; 0 for none.
    """
    pairs = side_pairs(skeleton, parts)
    if not pairs:
        return np.zeros(len(positions))
    left, right = np.array(pairs).T
    across = (positions[:, left] - positions[:, right]).mean(axis=1)[:, [0, 2]]
    if smoothing > 0:
        across = gaussian_filter1d(across, smoothing * fps, axis=0, mode="nearest")
    # A dancer who faces +z has the left side at +x.
    angles = np.arctan2(-across[:, 1], across[:, 0])
    distinct = np.hypot(across[:, 0], across[:, 1]) > SHORTEST_ACROSS
    if not distinct.any():
        return np.zeros(len(across))
    last = np.maximum.accumulate(np.where(distinct, np.arange(len(across)), int(distinct.argmax())))
    return np.unwrap(angles[last])


def mean_heading(positions: FloatArray, fps: float, skeleton: Skeleton) -> float:
    """The mean `heading`, radians from +z towards +x: where a camera should stand.

    0 without names of left and right; arbitrary for a dancer who turns on and on.
    """
    return float(np.angle(np.exp(1j * heading(positions, fps, skeleton)).mean()))


def turned(points: FloatArray, angle: FloatArray | float) -> FloatArray:
    """Points (..., 3) turned about the y axis by `angle` (...) radians, from +z towards +x."""
    x, z = points[..., 0], points[..., 2]
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([x * cosine + z * sine, points[..., 1], z * cosine - x * sine], axis=-1)


def body_frame(positions: FloatArray, fps: float, skeleton: Skeleton, *, smoothing: float = 0.0) -> FloatArray:
    """Joint positions seen from the torso: the movement of limbs against the trunk.

    In every frame the origin is the torso, and the hips face +z. So travel, jumps and turns of the whole body are taken
    out, and a statue on a turntable stands still. Lengths and speeds are not scaled.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up; or (T, J, 2) image coordinates
        A picture does not show turns: 2-D points are moved to the torso, and nothing is turned.
    fps : float, hertz
    skeleton : Skeleton
        The torso is the mean of the left and right joints of hips and shoulders, which are found by their names.
        Without such names it is the root, or the mean of all joints where there are no bones. The body faces where its
        hips do, else its shoulders; without names of either nothing is turned.
    smoothing : float, seconds
        Standard deviation of a Gaussian over the direction of the hips. At 0 a rigid body is exactly at rest. A little
        smoothing keeps noise of the hips, which are 0.2 m apart, from shaking the hands, which are 0.8 m away.

    Returns
    -------
    (T, J, D) array, in the unit of `positions`

    Raises
    ------
    ValueError
        If the shape does not fit the skeleton.

    Examples
    --------
    Two joints that travel along x stay where they are:

    >>> step = np.arange(3.0)[:, None, None] * [1.0, 0.0, 0.0]
    >>> body = body_frame(step + [[0.0, 1.0, 0.0], [0.0, 0.5, 0.0]], 30.0, Skeleton(("hip", "knee"), (-1, 0)))
    >>> body[:, 1].tolist()
    [[0.0, -0.5, 0.0], [0.0, -0.5, 0.0], [0.0, -0.5, 0.0]]
    """
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 3 or positions.shape[1] != len(skeleton.joints) or positions.shape[2] not in (2, 3):
        raise ValueError(f"positions must be (T, {len(skeleton.joints)}, 2 or 3), got shape {positions.shape}")
    pairs = side_pairs(skeleton)
    torso = positions[:, np.ravel(pairs)].mean(axis=1) if pairs else root_position(positions, skeleton)
    local = positions - torso[:, None]
    if positions.shape[2] == 2:
        return local
    parts = HIPS if side_pairs(skeleton, HIPS) else HIPS_AND_SHOULDERS
    return turned(local, -heading(positions, fps, skeleton, parts=parts, smoothing=smoothing)[:, None])
