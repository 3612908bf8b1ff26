"""The points of the body that geometric features speak of, found among the joints of a skeleton by name."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from harmolab.skeletons import joint_part, joint_side
from harmolab.types import FloatArray, Skeleton

# What a part is called, the clearest word first. BVH files call the shoulder "arm" and the collar bone "shoulder", the
# knee "leg" and the ankle "foot", where SMPL's foot is the ball of the foot.
_PAIRED = {
    "hip": ("hip", "upleg", "upperleg", "thigh"),
    "knee": ("knee", "leg", "lowerleg", "shin"),
    "ankle": ("ankle", "foot"),
    "toes": ("toes", "toe", "toebase", "bigtoe", "foot"),
    "shoulder": ("arm", "uparm", "upperarm", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm"),
    "wrist": ("wrist", "hand"),
}
_CENTRAL = {
    "root": ("root", "pelvis", "hips", "midhip"),
    "belly": ("belly", "spine", "spine1", "torso", "waist"),
    "chest": ("chest", "spine3", "spine2", "spine1"),
    "neck": ("neck",),
}
# Points that lie between others, where no joint is called so; the later may rest on the earlier.
_BETWEEN = {"root": ("lhip", "rhip"), "neck": ("lshoulder", "rshoulder"), "chest": ("belly", "neck")}

BODY_POINTS = (
    *("root", "belly", "chest", "neck", "lhip", "rhip", "lknee", "rknee", "lankle", "rankle", "ltoes", "rtoes"),
    *("lshoulder", "rshoulder", "lelbow", "relbow", "lwrist", "rwrist"),
)


@lru_cache(maxsize=64)
def body_points(skeleton: Skeleton) -> FloatArray:
    """How to make the points `BODY_POINTS` of the joints of a skeleton: (18, J) weights, each row's sum 1.

    Joints are known by name, in the words of AIST++, SMPL, BVH files and Tang et al. (whose left wrist is called hand).
    Root, neck and chest are put half way between hips, shoulders, or belly and neck where no joint is called so.

    Raises
    ------
    ValueError
        If points are missing; the message names them.
    """
    found = _named_joints(skeleton)
    rows = {point: np.eye(len(skeleton.joints))[joint] for point, joint in found.items()}
    for point, (one, other) in _BETWEEN.items():
        if point not in rows and one in rows and other in rows:
            rows[point] = (rows[one] + rows[other]) / 2
    missing = [point for point in BODY_POINTS if point not in rows]
    if missing:
        raise ValueError(f"no joint is called {', '.join(missing)}, or alike; joints are {', '.join(skeleton.joints)}")
    weights = np.array([rows[point] for point in BODY_POINTS])
    weights.setflags(write=False)
    return weights


def _named_joints(skeleton: Skeleton) -> dict[str, int]:
    """Joint of every body point that has one of its own; of joints that would fit, the first."""
    joints: dict[tuple[str, str], int] = {}
    for joint, name in enumerate(skeleton.joints):
        joints.setdefault((joint_side(name), joint_part(name)), joint)
    wanted = {(side, side[:1] + part): words for part, words in _PAIRED.items() for side in ("left", "right")}
    wanted |= {("", part): words for part, words in _CENTRAL.items()}
    found: dict[str, int] = {}
    for (side, point), words in wanted.items():
        fitting = [joints[side, word] for word in words if (side, word) in joints]
        # A foot that stands for the ankle cannot be the toes too, nor a spine both belly and chest.
        free = [joint for joint in fitting if joint not in found.values()]
        if free:
            found[point] = free[0]
    return found
