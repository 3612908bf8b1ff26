"""The points of the body that geometric features are about, from the joints of a skeleton by name."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from harmolab.skeletons import named_joints
from harmolab.types import FloatArray, Skeleton

# Words for a part, the clearest first. BVH files call the shoulder "arm" and the collar bone "shoulder", the
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
    """Weights (18, J) that make the points `BODY_POINTS` of the joints of a skeleton; each row's sum is 1.

    Joints are identified by name, in the words of AIST++, SMPL, BVH files and Tang et al. (who call a left wrist hand).
    Root, neck and chest are put half way between hips, shoulders, or belly and neck where no joint is called so.

    Raises
    ------
    ValueError
        If points are missing; the message names them.
    """
    rows = {point: np.eye(len(skeleton.joints))[joint] for point, joint in point_joints(skeleton).items()}
    for point, (one, other) in _BETWEEN.items():
        if point not in rows and one in rows and other in rows:
            rows[point] = (rows[one] + rows[other]) / 2
    missing = [point for point in BODY_POINTS if point not in rows]
    if missing:
        raise ValueError(f"no joint is called {', '.join(missing)}, or alike; joints are {', '.join(skeleton.joints)}")
    weights = np.array([rows[point] for point in BODY_POINTS])
    weights.setflags(write=False)
    return weights


def point_joints(skeleton: Skeleton) -> dict[str, int]:
    """The joint of each body point that has one of its own; of several that fit, the first."""
    joints = named_joints(skeleton)
    words = {(side, side[:1] + part): names for part, names in _PAIRED.items() for side in ("left", "right")}
    words |= {("", part): names for part, names in _CENTRAL.items()}
    points: dict[str, int] = {}
    for (side, point), names in words.items():
        fitting = [joints[side, name] for name in names if (side, name) in joints]
        # A foot that stands for the ankle cannot be the toes too, nor a spine both belly and chest.
        free = [joint for joint in fitting if joint not in points.values()]
        if free:
            points[point] = free[0]
    return points
