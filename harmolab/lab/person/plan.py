"""The drawn parts of a body, from the names of its joints: head, filled trunk, limbs of two sides, feet and palms.

Every part is a rounded hull: the outline around one to six discs. Their centres are weighted sums of joints, so that
the page's script draws the same figure from the same numbers. Lengths are shares of the stature (segments as Drillis
and Contini 1966, in Winter, "Biomechanics and motor control"). Skeletons without names of shoulders and hips are
drawn as sticks, those without bones as dots.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from harmolab.io.player_points import FINGERS, PROPS, joint_widths, limb_widths
from harmolab.metrics.body_points import point_joints
from harmolab.skeletons import (
    HIPS_AND_SHOULDERS,
    Skeleton,
    foot_joints,
    sides_and_parts,
    skull_and_limbs,
    standing_height,
)
from harmolab.types import FloatArray

# Left and right differ in lightness and between blue and yellow, which eyes without red or green tell apart; neither is
# a colour of beats, hits or misses.
PAINTS: Mapping[str, tuple[int, int, int]] = MappingProxyType(
    {
        "left": (63, 58, 140),
        "right": (222, 110, 38),
        "body": (104, 110, 120),
        "head": (104, 110, 120),
        "assumed": (190, 193, 198),
        "stick": (34, 38, 46),
        "prop": (110, 68, 36),
    }
)
OUTLINES = ("body", "head", "assumed")  # paints of parts that stay open where another figure lies under them
TRUNK = ("lshoulder", "rshoulder", "rhip", "lhip")
TRUNK_LENGTH, SHOULDERS_APART = 0.288, 0.258
# Radii of the discs at the points of a body, and of those beyond the wrists and ankles.
RADII: Mapping[str, float] = MappingProxyType(
    {"shoulder": 0.026, "elbow": 0.021, "wrist": 0.016, "hip": 0.042, "knee": 0.029, "ankle": 0.019, "toes": 0.013}
)
HAND, HEEL, STICK, PALM = 0.013, 0.015, 0.018, 0.006
# The trunk's discs lie inside shoulders and hips, so that it has depth from the side: radii, share of the way inwards
# and, of those at the shoulders, down.
CHEST, PELVIS, NECK = 0.045, 0.046, 0.022
INWARDS, DOWN = 0.1, 0.1
# The head reaches from chin to crown: how far its two discs lie above the shoulders, and their radii.
HEAD_UP, CHIN, CROWN = 0.115, (0.101, 0.045), (0.132, 0.054)
HEAD_STRETCH = (0.5, 2.5)  # of the distance from shoulders to the head's joint, which may be at the skull's base or top
# Statures by which parts count as farther away: arms are drawn over the trunk beside them, legs under it.
ARM_NUDGE, LEG_NUDGE, HEAD_NUDGE, NECK_NUDGE = -0.03, 0.04, -0.04, 0.1
FACE = ("nose", "eye", "ear", "mouth", "jaw", "face")
Feet = Sequence[tuple[int, ...]]  # the joints of each foot
Names = Sequence[tuple[str, str]]  # the side and the part of the body in the name of each joint


class Part(NamedTuple):
    """A rounded hull: its points, their radii in statures, its paint, and the nudge of its depth in statures."""

    points: tuple[int, ...]
    radii: tuple[float, ...]
    paint: str
    nudge: float = 0.0


@dataclass(frozen=True, eq=False)
class BodyPlan:
    """The drawn parts of a skeleton.

    Parameters
    ----------
    weights : (Q, J), share of each joint in each point
    parts : tuple of Part
    stature : float, in the unit of the positions
    hips : (J,), share of each joint in the middle of the hips, which a camera can follow
    shadow : (J,), 1 for joints that throw a shadow, 0 for those of props
    """

    weights: FloatArray
    parts: tuple[Part, ...]
    stature: float
    hips: FloatArray
    shadow: FloatArray


def body_plan(positions: FloatArray, skeleton: Skeleton) -> BodyPlan:
    """The plan of a motion with positions (T, J, 3) metres, y up, or (T, J, 2) image coordinates."""
    count = len(skeleton.joints)
    named, names = _body_joints(skeleton), sides_and_parts(skeleton)
    trunk = [named[point] for point in TRUNK] if set(TRUNK) <= named.keys() else []
    stature = _stature(positions, trunk)
    points = [np.eye(count)]
    feet = _foot_groups(skeleton, names)
    parts = [
        *_limbs(skeleton, named, names, feet, bool(trunk)),
        *_soles(named, names, feet if trunk else ()),
        *_palms(skeleton),
    ]
    if trunk:
        upper, extra = _upper_body(positions, names, trunk, stature)
        points.append(upper)
        parts += extra
    else:
        points.append(_skull(skeleton, names))
        parts += [Part((count,), (CROWN[1],), "head", HEAD_NUDGE)] * len(points[-1])
    hips = np.eye(count)[trunk[2:]].mean(axis=0) if trunk else np.full(count, 1 / count)
    is_prop = np.array([name in PROPS for name in skeleton.joints])
    return BodyPlan(np.concatenate(points), tuple(parts), stature, hips, np.where(is_prop, 0.0, 1.0))


def _body_joints(skeleton: Skeleton) -> dict[str, int]:
    """Joints of the body's points by name, fingers and props left out."""
    return {} if not skeleton.bones else point_joints(skeleton)


def _stature(positions: FloatArray, trunk: Sequence[int]) -> float:
    """Stature by the trunk, which changes less than the height of a pose; by the extent where no trunk is named."""
    if not trunk:
        extent = float(np.ptp(positions, axis=1).max())
        return max(standing_height(positions), 0.5 * extent, 1e-6)
    left, right, right_hip, left_hip = (positions[:, joint] for joint in trunk)
    length = np.linalg.norm(left + right - left_hip - right_hip, axis=-1) / 2
    across = np.linalg.norm(left - right, axis=-1)
    return max(*(float(np.percentile(size, 90)) / share for size, share in (
        (length, TRUNK_LENGTH), (across, SHOULDERS_APART)
    )), 1e-6)  # fmt: skip


def _limbs(skeleton: Skeleton, named: Mapping[str, int], names: Names, feet: Feet, has_trunk: bool) -> Iterator[Part]:
    """Arms, legs, fingers and props; sticks for all bones where there is no trunk; dots where there are no bones."""
    skull = set(_skull_joints(names))
    point = {joint: name for name, joint in named.items()}
    inside = {joint for joint, name in enumerate(names) if _is_inside(*name, point.get(joint, ""))}
    radii = [_radius(part, point.get(joint, "")) for joint, (_, part) in enumerate(names)]
    bones = list(skeleton.bones) if has_trunk else skull_and_limbs(skeleton)[1]
    thin = joint_widths(skeleton)
    if not bones:
        yield from (Part((joint,), (STICK,), "stick") for joint in range(len(skeleton.joints)) if joint not in skull)
    for (start, end), width in zip(bones, limb_widths(skeleton, bones), strict=True):
        is_prop = skeleton.joints[start] in PROPS
        is_hidden = {start, end} <= inside | skull or bool({start, end} & skull)
        if has_trunk and not is_prop and (is_hidden or any({start, end} <= set(foot) for foot in feet)):
            continue
        is_thin = not has_trunk or is_prop or min(thin[start], thin[end]) < 1.0
        sizes = (STICK * width,) * 2 if is_thin else (radii[start], radii[end])
        paint = "prop" if is_prop else _side(names[start][0], names[end][0]) or "stick"
        yield Part((start, end), sizes, paint, _nudge(point, start, end) if has_trunk else 0.0)


def _is_inside(side: str, part: str, point: str) -> bool:
    """True for the joints inside the trunk: shoulders, hips, collar bones, and all without a side."""
    return point[1:] in ("shoulder", "hip") or part in HIPS_AND_SHOULDERS or not side


def _radius(part: str, point: str) -> float:
    return RADII.get(point[1:], HEEL if "heel" in part else HAND)


def _nudge(point: Mapping[int, str], start: int, end: int) -> float:
    names = {point.get(start, "")[1:], point.get(end, "")[1:]}
    return LEG_NUDGE if names & {"hip", "knee", "ankle", "toes"} else ARM_NUDGE


def _side(*sides: str) -> str:
    """The side of a drawn part: that of its joints, none where it lies across or in the middle."""
    return sides[0] if len(set(sides)) == 1 else ""


def _foot_groups(skeleton: Skeleton, names: Names) -> Feet:
    """The joints of each foot that has more than an ankle."""
    if not any(word in part for _, part in names for word in ("toe", "heel", "ankle", "foot")):
        return []
    return [group for group in foot_joints(skeleton) if len(group) > 1 and names[group[0]][0]]


def _soles(named: Mapping[str, int], names: Names, feet: Feet) -> Iterator[Part]:
    """A sole around ankle, heel and toes."""
    point = {joint: name for name, joint in named.items()}
    for group in feet:
        radii = [_radius(names[joint][1], point.get(joint, "toes")) for joint in group]
        side = _side(*(names[joint][0] for joint in group))
        yield Part(group, tuple(min(radius, RADII["ankle"]) for radius in radii), side, LEG_NUDGE)


def _palms(skeleton: Skeleton) -> Iterator[Part]:
    """A palm between the wrist and the roots of four fingers."""
    at = {name: joint for joint, name in enumerate(skeleton.joints)}
    for side in ("left", "right"):
        wrist = next((at[name] for name in (f"{side}_hand", f"{side}_wrist") if name in at), None)
        roots = [at[name] for finger in FINGERS[1:] if (name := f"{side}_{finger}_1") in at]
        if wrist is not None and len(roots) == len(FINGERS) - 1:
            yield Part((wrist, *roots), (PALM,) * 5, side, 2 * ARM_NUDGE)


def _skull_joints(names: Names) -> list[int]:
    return [joint for joint, (_, part) in enumerate(names) if "head" in part or part.startswith(FACE)]


def _skull(skeleton: Skeleton, names: Names) -> FloatArray:
    """(0 or 1, J): the middle of the joints of the head."""
    skull = _skull_joints(names) if skeleton.bones else []
    return (
        np.eye(len(skeleton.joints))[skull].mean(axis=0, keepdims=True)
        if skull
        else np.zeros((0, len(skeleton.joints)))
    )


def _upper_body(
    positions: FloatArray, names: Names, trunk: Sequence[int], stature: float
) -> tuple[FloatArray, list[Part]]:
    """Shoulders' middle, chin, crown and the trunk's corners as (7, J) points, and the parts made of them."""
    count = len(names)
    joints = np.eye(count)
    shoulders, hips = joints[trunk[:2]].mean(axis=0), joints[trunk[2:]].mean(axis=0)
    head = _head(names)
    if head is None:
        way = (shoulders - hips) / TRUNK_LENGTH
    else:
        length = float(np.median(np.linalg.norm(np.einsum("j,tjd->td", head - shoulders, positions), axis=-1)))
        way = (head - shoulders) / HEAD_UP * np.clip(HEAD_UP * stature / max(length, 1e-9), *HEAD_STRETCH)
    corners = [joints[joint] + INWARDS * (joints[other] - joints[joint]) for joint, other in _across(trunk)]
    corners[:2] = [corner + DOWN * (hips - shoulders) for corner in corners[:2]]
    points = np.stack([shoulders, shoulders + CHIN[0] * way, shoulders + CROWN[0] * way, *corners])
    neck, chin, crown, *inside = range(count, count + len(points))
    paint = "head" if head is not None else "assumed"
    return points, [
        Part(tuple(inside), (CHEST,) * 2 + (PELVIS,) * 2, "body"),
        Part((neck, chin), (NECK, NECK), "body", NECK_NUDGE),
        Part((chin, crown), (CHIN[1], CROWN[1]), paint, HEAD_NUDGE),
    ]


def _across(trunk: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Each corner joint of the trunk with the one on the other side."""
    left, right, right_hip, left_hip = trunk
    yield from ((left, right), (right, left), (right_hip, left_hip), (left_hip, right_hip))


def _head(names: Names) -> FloatArray | None:
    """(J,) weights of the middle of the head: of the ears, else of joints called head, else of the face."""
    skull = _skull_joints(names)
    parts = {joint: names[joint][1] for joint in skull}
    ears = [joint for joint in skull if parts[joint] == "ear"]
    heads = [joint for joint in skull if "head" in parts[joint]]
    middle = ears if len(ears) == 2 else heads or skull
    return np.eye(len(names))[middle].mean(axis=0) if middle else None
