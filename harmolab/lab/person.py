"""The drawn person of all pictures: parts of the body by the names of its joints, one camera, filled outlines.

The parts are head, filled trunk, limbs of two sides, feet and palms. Every part is a rounded hull: the outline around
one to six discs. Their centres are weighted sums of joints, so that the page's script draws the same figure from the
same numbers. Lengths are shares of the stature (segments as Drillis and Contini 1966, in Winter, "Biomechanics and
motor control"). Skeletons without names of shoulders and hips are drawn as sticks, those without bones as dots.

The camera is a little beside the dancer's front, a little above, and goes along with the dancer. Outlines go from far
to near, for any painter: OpenCV, matplotlib, the page's script.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from harmolab.body import skeletons
from harmolab.body.skeletons import turned
from harmolab.metrics.features import point_joints
from harmolab.readers.player_points import FINGERS, PROPS, joint_widths, limb_widths, playing_box
from harmolab.types import FloatArray, IntArray, Motion

# Parts of a body, by the names of its joints

# Left and right differ in lightness and between blue and yellow, which eyes without red or green tell apart; neither is
# a colour of beats, hits or misses.
PAINTS: Mapping[str, tuple[int, int, int]] = {
    "left": (63, 58, 140),
    "right": (222, 110, 38),
    "body": (104, 110, 120),
    "head": (104, 110, 120),
    "assumed": (190, 193, 198),
    "stick": (34, 38, 46),
    "prop": (110, 68, 36),
}
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


def body_plan(positions: FloatArray, skeleton: skeletons.Skeleton) -> BodyPlan:
    """The plan of a motion with positions (T, J, 3) metres, y up, or (T, J, 2) image coordinates."""
    count = len(skeleton.joints)
    # Joints of the body's points by name, fingers and props left out.
    named, names = point_joints(skeleton) if skeleton.bones else {}, skeletons.sides_and_parts(skeleton)
    trunk = [named[point] for point in TRUNK] if set(TRUNK) <= named.keys() else []
    stature = _stature(positions, trunk)
    points = [np.eye(count)]
    feet = _foot_groups(skeleton, names)
    point = {joint: name for name, joint in named.items()}
    parts = [*_limbs(skeleton, point, names, feet, bool(trunk)), *_soles(point, names, feet if trunk else ())]
    parts += _palms(skeleton)
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


def _stature(positions: FloatArray, trunk: Sequence[int]) -> float:
    """Stature by the trunk, which changes less than the height of a pose; by the extent where no trunk is named."""
    if not trunk:
        return max(skeletons.standing_height(positions), 0.5 * float(np.ptp(positions, axis=1).max()), 1e-6)
    left, right, right_hip, left_hip = (positions[:, joint] for joint in trunk)
    length = np.linalg.norm(left + right - left_hip - right_hip, axis=-1) / 2
    across = np.linalg.norm(left - right, axis=-1)
    by_length, by_width = np.percentile(length, 90) / TRUNK_LENGTH, np.percentile(across, 90) / SHOULDERS_APART
    return float(max(by_length, by_width, 1e-6))


def _limbs(
    skeleton: skeletons.Skeleton, point: Mapping[int, str], names: Names, feet: Feet, has_trunk: bool
) -> Iterator[Part]:
    """Arms, legs, fingers and props; sticks for all bones where there is no trunk; dots where there are no bones."""
    skull = set(_skull_joints(names))
    inside = {joint for joint, name in enumerate(names) if _is_inside(*name, point.get(joint, ""))}
    radii = [_radius(part, point.get(joint, "")) for joint, (_, part) in enumerate(names)]
    bones = list(skeleton.bones) if has_trunk else skeletons.skull_and_limbs(skeleton)[1]
    thin = joint_widths(skeleton)
    if not bones:
        dots = sorted({*range(len(names))} - (skull if skeleton.bones else set()))
        yield from (Part((joint,), (STICK,), "stick") for joint in dots)
    for (start, end), width in zip(bones, limb_widths(skeleton, bones), strict=True):
        is_prop, ends = skeleton.joints[start] in PROPS, {start, end}
        is_hidden = ends <= inside | skull or ends & skull or any(ends <= set(foot) for foot in feet)
        if has_trunk and not is_prop and is_hidden:
            continue
        is_thin = not has_trunk or is_prop or min(thin[start], thin[end]) < 1.0
        sizes = (STICK * width,) * 2 if is_thin else (radii[start], radii[end])
        paint = "prop" if is_prop else _side(names[start][0], names[end][0]) or "stick"
        yield Part((start, end), sizes, paint, _nudge(point, start, end) if has_trunk else 0.0)


def _is_inside(side: str, part: str, point: str) -> bool:
    """True for the joints inside the trunk: shoulders, hips, collar bones, and all without a side."""
    return point[1:] in ("shoulder", "hip") or part in skeletons.HIPS_AND_SHOULDERS or not side


def _radius(part: str, point: str) -> float:
    return RADII.get(point[1:], HEEL if "heel" in part else HAND)


def _nudge(point: Mapping[int, str], start: int, end: int) -> float:
    names = {point.get(start, "")[1:], point.get(end, "")[1:]}
    return LEG_NUDGE if names & {"hip", "knee", "ankle", "toes"} else ARM_NUDGE


def _side(*sides: str) -> str:
    """The side of a drawn part: that of its joints, none where it lies across or in the middle."""
    return sides[0] if len(set(sides)) == 1 else ""


def _foot_groups(skeleton: skeletons.Skeleton, names: Names) -> Feet:
    """The joints of each foot that has more than an ankle."""
    with suppress(ValueError):  # no joint is called a foot
        return [group for group in skeletons.foot_joints(skeleton) if len(group) > 1 and names[group[0]][0]]
    return []


def _soles(point: Mapping[int, str], names: Names, feet: Feet) -> Iterator[Part]:
    """A sole around ankle, heel and toes."""
    for group in feet:
        radii = [_radius(names[joint][1], point.get(joint, "toes")) for joint in group]
        side = _side(*(names[joint][0] for joint in group))
        yield Part(group, tuple(min(radius, RADII["ankle"]) for radius in radii), side, LEG_NUDGE)


def _palms(skeleton: skeletons.Skeleton) -> Iterator[Part]:
    """A palm between the wrist and the roots of four fingers."""
    at = {name: joint for joint, name in enumerate(skeleton.joints)}
    for side in ("left", "right"):
        wrist = next((at[name] for name in (f"{side}_hand", f"{side}_wrist") if name in at), None)
        roots = [at[name] for finger in FINGERS[1:] if (name := f"{side}_{finger}_1") in at]
        if wrist is not None and len(roots) == len(FINGERS) - 1:
            yield Part((wrist, *roots), (PALM,) * 5, side, 2 * ARM_NUDGE)


def _skull_joints(names: Names) -> list[int]:
    return [joint for joint, (_, part) in enumerate(names) if "head" in part or part.startswith(FACE)]


def _skull(skeleton: skeletons.Skeleton, names: Names) -> FloatArray:
    """(0 or 1, J): the middle of the joints of the head."""
    joints, skull = np.eye(len(names)), _skull_joints(names) if skeleton.bones else []
    return joints[skull].mean(axis=0, keepdims=True) if skull else joints[:0]


def _upper_body(positions: FloatArray, names: Names, trunk: list[int], stature: float) -> tuple[FloatArray, list[Part]]:
    """Shoulders' middle, chin, crown and the trunk's corners as (7, J) points, and the parts made of them."""
    joints = np.eye(len(names))
    shoulders, hips = joints[trunk[:2]].mean(axis=0), joints[trunk[2:]].mean(axis=0)
    head = _head(names)
    if head is None:
        way = (shoulders - hips) / TRUNK_LENGTH
    else:
        length = float(np.median(np.linalg.norm(np.einsum("j,tjd->td", head - shoulders, positions), axis=-1)))
        way = (head - shoulders) / HEAD_UP * np.clip(HEAD_UP * stature / max(length, 1e-9), *HEAD_STRETCH)
    left, right, right_hip, left_hip = trunk
    corners = joints[trunk] + INWARDS * (joints[[right, left, left_hip, right_hip]] - joints[trunk])
    corners[:2] += DOWN * (hips - shoulders)
    points = np.stack([shoulders, shoulders + CHIN[0] * way, shoulders + CROWN[0] * way, *corners])
    neck, chin, crown, *inside = range(len(names), len(names) + len(points))
    paint = "head" if head is not None else "assumed"
    return points, [
        Part(tuple(inside), (CHEST,) * 2 + (PELVIS,) * 2, "body"),
        Part((neck, chin), (NECK, NECK), "body", NECK_NUDGE),
        Part((chin, crown), (CHIN[1], CROWN[1]), paint, HEAD_NUDGE),
    ]


def _head(names: Names) -> FloatArray | None:
    """(J,) weights of the middle of the head: of the ears, else of joints called head, else of the face."""
    skull = _skull_joints(names)
    ears = [joint for joint in skull if names[joint][1] == "ear"]
    heads = [joint for joint in skull if "head" in names[joint][1]]
    middle = ears if len(ears) == 2 else heads or skull
    return np.eye(len(names))[middle].mean(axis=0) if middle else None


# The camera and the stage


DISTANCE = 3.4  # from the camera to the dancer, in heights of the dancer
ANGLE, LIFT = 0.35, 0.11  # radians from the dancer's front to the left, and above the horizon
AIM = 0.47  # height that the camera looks at, in heights of the dancer
MIDDLE = 0.52  # of the picture's height: where that point lies
FILL, FILL_ACROSS = 0.66, 0.726  # share of the picture's height and width that a dancer's height fills at most
# A musician with an instrument: radians that the camera stands higher, the size in heights and widths of the box, and
# the share of the picture that the box fills.
PLAYER_LIFT, PLAYER_UP, PLAYER_ACROSS, PLAYER_FILL = 0.22, 0.9, 0.62, 0.84
FLAT_FILL = 0.84  # share of the picture that points of a picture fill
OUTLIERS = (0.5, 99.5)  # percentiles between which a picture's points count for its size
FLESH = 0.05  # statures of room around them


@dataclass(frozen=True, eq=False)
class Camera:
    """The place of a camera in each frame; it looks the same way in all.

    Parameters
    ----------
    eye : (T, 3) metres
    axes : (3, 3), rows: right, up and forward
    focal : float, pixels
    height, width : int, pixels
    size : float, metres, height of the dancer
    """

    eye: FloatArray
    axes: FloatArray
    focal: float
    height: float
    width: float
    size: float

    @property
    def ahead(self) -> float:
        """Metres along the floor from the camera to where it looks."""
        return float(-DISTANCE * self.size * self.axes[2, 2])

    def to_view(self, points: FloatArray, frames: slice) -> FloatArray:
        """Points (F, N, 3) of some frames as the camera has them: to its right, above it, in front of it."""
        return (points - self.eye[frames, None]) @ self.axes.T

    def to_pixels(self, view: FloatArray) -> FloatArray:
        """(..., 2) pixel x and pixel y (down) of points (..., 3) of `to_view`."""
        plane = self.focal * view[..., :2] / np.maximum(view[..., 2:], 0.01 * self.size)
        return np.array([self.width / 2, MIDDLE * self.height]) + plane * np.array([1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Stage:
    """A motion as it stands before the camera.

    Parameters
    ----------
    positions : (T, J, 3) metres, y up, floor at y = 0; points of a picture hang upright at z = 0
    plan : BodyPlan
    way : (T, 2), place on the floor that the camera goes along with
    aim : float, height that it looks at
    front : float, radians, heading that it faces
    angle, lift : float, radians, beside that heading and above the horizon
    size : float, height of the dancer
    room : (across, up), what fits the picture, in the unit of positions
    flat : bool, True for points of a picture
    """

    positions: FloatArray
    plan: BodyPlan
    way: FloatArray
    aim: float
    front: float
    angle: float
    lift: float
    size: float
    room: tuple[float, float]
    flat: bool

    def camera(self, height: float, width: float) -> Camera:
        """The camera for a picture of that size, of positions that are `turned` to it."""
        towards = np.array([0.0, np.sin(self.lift), np.cos(self.lift)])
        up = np.array([0.0, np.cos(self.lift), -np.sin(self.lift)])
        target = self.turned(np.insert(self.way, 1, self.aim, axis=1))
        focal = DISTANCE * self.size * min(width / self.room[0], height / self.room[1])
        axes = np.stack([np.array([1.0, 0.0, 0.0]), up, -towards])
        return Camera(target + DISTANCE * self.size * towards, axes, focal, height, width, self.size)

    def turned(self, points: FloatArray) -> FloatArray:
        """Points (..., 3) turned so that the camera stands at +z."""
        return turned(points, -self.front - self.angle)


def stage_of(motion: Motion, *, wall: FloatArray | None = None, follow: bool = False, angle: float = ANGLE) -> Stage:
    """The stage of a motion.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres or (T, J, 2) image coordinates
    wall : (2, 2), low and high corner of the picture, in image coordinates; the motion's own when left out
    follow : bool
        True to keep the middle of the hips in the middle of the picture, in place of the dancer's smoothed way.
    angle : float, radians from the dancer's mean heading to where the camera stands, towards her left
    """
    plan = body_plan(motion.positions, motion.skeleton)
    if motion.positions.shape[2] == 2:
        return _flat_stage(motion.positions, plan, wall, follow)
    low = float(np.percentile(motion.positions[..., 1].min(axis=1), 2))
    positions = motion.positions - np.array([0.0, low, 0.0])
    front = skeletons.mean_heading(positions, motion.fps, motion.skeleton)
    box = playing_box(Motion(positions, motion.fps, motion.skeleton, motion.valid))
    if box is not None:
        return _player_stage(positions, plan, box, front, angle)
    size = max(skeletons.standing_height(positions), 0.5 * float(np.ptp(positions, axis=1).max()), 1e-6)
    followed = np.einsum("j,tjd->td", plan.hips, positions) if follow else skeletons.camera_way(positions, motion.fps)
    room = (size / FILL_ACROSS, size / FILL)
    return Stage(positions, plan, followed[:, [0, 2]], AIM * size, front, angle, LIFT, size, room, False)


def _player_stage(positions: FloatArray, plan: BodyPlan, box: FloatArray, front: float, angle: float) -> Stage:
    """A player with an instrument, who stays in the box (2, 3), which a camera at rest shows from higher up."""
    middle, extent = box.mean(axis=0), np.ptp(box, axis=0)
    lift, across = LIFT + PLAYER_LIFT, float(np.hypot(extent[0], extent[2]))
    size = max(PLAYER_UP * float(extent[1]), PLAYER_ACROSS * across)
    room = (across / PLAYER_FILL, float(extent[1] * np.cos(lift) + across * np.sin(lift)) / PLAYER_FILL)
    way = np.broadcast_to(middle[[0, 2]], (len(positions), 2))
    return Stage(positions, plan, way, float(middle[1]), front, angle, lift, size, room, False)


def _flat_stage(points: FloatArray, plan: BodyPlan, wall: FloatArray | None, follow: bool) -> Stage:
    """Image coordinates hung up in space, y up, before a camera that rests or goes along with the hips."""
    low, high = picture_corners(points, plan) if wall is None else wall
    upright = np.stack([points[..., 0] - (low[0] + high[0]) / 2, high[1] - points[..., 1]], axis=-1)
    positions = np.concatenate([upright, np.zeros_like(upright[..., :1])], axis=-1)
    across, up = np.maximum(high - low, 1e-6).tolist()
    way = np.zeros((len(points), 2))
    if follow:
        way[:, 0] = positions[..., 0] @ plan.hips
    room = (across / FLAT_FILL, up / FLAT_FILL)
    return Stage(positions, plan, way, up / 2, 0.0, 0.0, 0.0, max(across, up), room, True)


def picture_corners(points: FloatArray, plan: BodyPlan) -> FloatArray:
    """(2, 2): low and high corner of a picture in which the figure of points (T, J, 2) has room, but for outliers."""
    lows, highs = np.percentile(np.einsum("qj,tjd->tqd", plan.weights, points), OUTLIERS, axis=0)
    return np.stack([lows.min(axis=0) - FLESH * plan.stature, highs.max(axis=0) + FLESH * plan.stature])


def shared_wall(motions: Sequence[Motion]) -> FloatArray:
    """(2, 2): low and high corner of one picture with two motions in image coordinates; ValueError for any others."""
    if len(motions) != 2 or any(motion.positions.shape[2] != 2 for motion in motions):
        raise ValueError("two motions in image coordinates can lie over each other: a truth, and a prediction of it")
    corners = [picture_corners(motion.positions, body_plan(motion.positions, motion.skeleton)) for motion in motions]
    return np.stack([np.min(corners, axis=(0, 1)), np.max(corners, axis=(0, 1))])


# Outlines of a person, from far to near

CORNERS = 24  # of an outline
PALER = 0.3  # share of white in the farthest part
THINNEST = 0.01  # statures: radius of a part that counts as thin, as fingers and props do
LEAST_RANGE = 0.3  # statures between the paint of near and far
SHADOW_LEAST, SHADOW_SPREAD = 0.06, 0.8  # radius of the shadow: statures, and share of the spread of the joints
_ANGLES = 2 * np.pi * np.arange(CORNERS) / CORNERS
_WAYS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class Shape(NamedTuple):
    """A filled outline (corners, 2) in pixels, y down, its colour, its part's place in the plan, and if it is thin."""

    outline: FloatArray
    colour: tuple[int, int, int]
    part: int
    thin: bool


class Discs(NamedTuple):
    """The discs of every part in every frame: (F, P, C, 2) pixels, (F, P, C) pixels, and (F, P) depths of the parts."""

    centres: FloatArray
    radii: FloatArray
    depths: FloatArray


def person_shapes(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> Iterator[list[Shape]]:
    """The shapes of each frame, from far to near.

    Parameters
    ----------
    plan : BodyPlan
    camera : Camera
    positions : (F, J, 3), metres, of the camera's `frames`
    """
    discs = person_discs(plan, camera, positions, frames)
    outlines = hulls(discs.centres, discs.radii)
    colours = _colours(plan, discs.depths)
    nudged = discs.depths + plan.stature * np.array([part.nudge for part in plan.parts])
    thin = [max(part.radii) < THINNEST for part in plan.parts]
    for order, rows, paints in zip(np.argsort(-nudged, axis=1, kind="stable"), outlines, colours, strict=True):
        yield [Shape(rows[part], tuple(paints[part].tolist()), int(part), thin[part]) for part in order]


def person_discs(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> Discs:
    """Centres, radii and depths of the parts as the camera has them; parts with fewer discs repeat their last."""
    members, shares = _padded(plan)
    view = camera.to_view(np.einsum("qj,fjd->fqd", plan.weights, positions), frames)
    depths = np.maximum(view[..., 2], 0.01 * camera.size)[:, members]
    radii = camera.focal * plan.stature * shares / depths
    last = np.array([len(part.points) for part in plan.parts])
    counted = np.arange(members.shape[1]) < last[:, None]
    return Discs(camera.to_pixels(view)[:, members], radii, (depths * counted).sum(axis=2) / last)


def _padded(plan: BodyPlan) -> tuple[IntArray, FloatArray]:
    """(P, C) points and radii of the parts."""
    most = max(len(part.points) for part in plan.parts)
    points = [part.points + part.points[-1:] * (most - len(part.points)) for part in plan.parts]
    radii = [part.radii + part.radii[-1:] * (most - len(part.radii)) for part in plan.parts]
    return np.array(points), np.array(radii)


def hulls(centres: FloatArray, radii: FloatArray) -> FloatArray:
    """(..., CORNERS, 2) outlines around discs: in each direction, the edge of the disc that reaches farthest.

    >>> hulls(np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([1.0, 2.0]))[0]
    array([6., 0.])
    """
    reach = centres @ _WAYS + radii[..., None]
    farthest = reach.argmax(axis=-2)[..., None]
    edge = np.take_along_axis(centres, farthest, axis=-2)
    radius = np.take_along_axis(radii, farthest[..., 0], axis=-1)[..., None]
    return edge + radius * _WAYS.T


def _colours(plan: BodyPlan, depths: FloatArray) -> IntArray:
    """(F, P, 3) colours: near parts in their paint, far ones paler."""
    paints = np.array([PAINTS[part.paint] for part in plan.parts], float)
    nearest = depths.min(axis=1, keepdims=True)
    span = np.maximum(np.ptp(depths, axis=1, keepdims=True), LEAST_RANGE * plan.stature)
    far = PALER * ((depths - nearest) / span)[..., None]
    return np.rint(paints + far * (255.0 - paints)).astype(np.int64)


def shadow_outline(plan: BodyPlan, camera: Camera, positions: FloatArray, frames: slice) -> FloatArray:
    """(F, CORNERS, 2) pixels: the shadow, a disc on the floor below the body that is as wide as the body is spread."""
    weights = plan.shadow / max(plan.shadow.sum(), 1.0)
    floor = positions[..., [0, 2]]
    middle = np.einsum("j,fjd->fd", weights, floor)
    spread = np.sqrt(np.einsum("j,fjd->f", weights, (floor - middle[:, None]) ** 2))
    radius = SHADOW_LEAST * plan.stature + SHADOW_SPREAD * spread
    edge = middle[:, None] + radius[:, None, None] * _WAYS.T
    places = np.stack([edge[..., 0], np.zeros(edge.shape[:2]), edge[..., 1]], axis=-1)
    return camera.to_pixels(camera.to_view(places, frames))
