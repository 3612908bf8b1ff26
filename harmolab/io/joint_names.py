"""What joints are called in different formats: which side of the body a name tells, and which part."""

from __future__ import annotations

import re

from harmolab.types import Skeleton

__all__ = ["foot_joints", "joint_part", "joint_side"]

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
# The parts that AIST++ writes in one word with their side: lhip, rtoes.
_PARTS = (
    "hip|hipjoint|upleg|thigh|femur|knee|ankle|toes?|foot|heel|"
    "clavicle|collar|(?:in)?shoulder|upperarm|humerus|elbow|wrist|hand"
)
_FUSED = re.compile(rf"(left|right)(?=.)|([lr])(?=(?:{_PARTS})$)")
_FOOT_PARTS = ("toe", "heel", "ankle", "foot")


def _words(name: str) -> list[str]:
    """The words of a name in lower case, its side as a word of its own; what stands before a colon is left out."""
    words = [word.lower() for word in _WORD.findall(name.rpartition(":")[2])]
    if any(word in _SIDES for word in words):
        return words
    return [piece for word in words for piece in _FUSED.sub(r"\g<0> ", word, count=1).split()]


def joint_side(name: str) -> str:
    """Side of the body that a joint's name tells: "left", "right" or "".

    >>> [joint_side(name) for name in ("left_toe", "toe R", "LeftToeBase", "rtoes", "L_Foot", "neck")]
    ['left', 'right', 'left', 'right', 'left', '']
    """
    sides = [_SIDES[word] for word in _words(name) if word in _SIDES]
    return sides[0] if sides else ""


def joint_part(name: str) -> str:
    """Part of the body that a joint's name tells, without side, separators and capitals.

    >>> [joint_part(name) for name in ("left_toe", "toe R", "LeftToeBase", "rtoes", "spine_1", "mixamorig:Hips")]
    ['toe', 'toe', 'toebase', 'toes', 'spine1', 'hips']
    """
    return "".join(word for word in _words(name) if word not in _SIDES)


def foot_joints(skeleton: Skeleton) -> tuple[tuple[int, ...], ...]:
    """The joints of each foot, by name: toe, heel, ankle or foot. Left first; joints of no side are feet of their own.

    Raises
    ------
    ValueError
        No joint is named so.
    """
    found = [
        joint for joint, name in enumerate(skeleton.joints) if any(part in joint_part(name) for part in _FOOT_PARTS)
    ]
    if not found:
        raise ValueError(
            f"no joint is called {', '.join(_FOOT_PARTS[:-1])} or {_FOOT_PARTS[-1]}; joints are {skeleton.joints}"
        )
    sides = {side: tuple(j for j in found if joint_side(skeleton.joints[j]) == side) for side in ("left", "right", "")}
    return tuple(joints for joints in (sides["left"], sides["right"], *((j,) for j in sides[""])) if joints)
