"""Twenty points of a body, each a joint or the middle of joints: what rotations can be fitted to.

Markers are not joints: two on the head, none at pelvis and neck. Forearm markers are left out, since they turn about
the arm and make it jump.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from harmolab.skeletons import joint_part, joint_side
from harmolab.types import Motion, Skeleton

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
    joints = {
        f"{part} {letter}": _first(named, side, _HANDS if part == "hand" else (part,))
        for letter, side in _SIDES
        for part in (*_ARM, *_LEG)
    }
    joints["pelvis"] = joints["hip L"] + joints["hip R"]
    joints["neck"] = joints["shoulder L"] + joints["shoulder R"]
    joints["torso"] = named.get(("", "torso"), [])
    joints["head"] = [joint for (_, part), members in named.items() if part == "head" for joint in members]
    if missing := [name for name in POINTS.joints if not joints[name]]:
        raise ValueError(f"no joint for {', '.join(missing)}; joints are {', '.join(skeleton.joints)}")
    return joints


def _first(named: Mapping[tuple[str, str], list[int]], side: str, parts: tuple[str, ...]) -> list[int]:
    """The joints of the first of some parts that there is."""
    return next((named[side, part] for part in parts if (side, part) in named), [])
