"""From a musician's points in a picture to an avatar in space, with instrument and bow (Sec. 5), in seven steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from harmolab.body.kinematics import smooth
from harmolab.body.rotations import directions, normal_part, two_bones
from harmolab.body.skeletons import Skeleton, turned
from harmolab.readers import player_points
from harmolab.readers.player_points import CORNERS, FINGERS, INSTRUMENTS, KEY_LINES, PHALANGES, SIDES
from harmolab.systems.training.features import check_choice, check_settings
from harmolab.types import BoolArray, FloatArray, Motion

# Settings of the avatar (Sec. 5), and the measures of its body.

DepthLaw = Literal["root", "linear"]

# Metres. Joints as estimators of poses see them: shoulders lie nearer together than they are wide.
SHOULDERS, HIPS, SPINE, HEAD = 0.36, 0.18, 0.5, 0.2
FOREARM, UPPER_ARM = 0.26, 0.3
THIGH, SHANK, ANKLE, TOE = 0.43, 0.42, 0.08, 0.16
HIP_ABOVE_SEAT = 0.09
# Root of a finger from the wrist (along the hand, to the side of the thumb) and its three bones.
HAND = {
    "thumb": (0.03, 0.032, (0.042, 0.032, 0.027)),
    "index": (0.09, 0.026, (0.042, 0.026, 0.022)),
    "middle": (0.092, 0.005, (0.047, 0.03, 0.023)),
    "ring": (0.087, -0.014, (0.043, 0.028, 0.023)),
    "little": (0.078, -0.032, (0.034, 0.021, 0.02)),
}


@dataclass(frozen=True)
class AvatarParams:
    """Settings by which points become an avatar.

    Parameters
    ----------
    depth : "root" or "linear"
        Forward offset of a bone of length L that is l long in the picture: sqrt(L^2 - l^2), or L - l.
    percentile : float, 0 to 100
        L is this percentile of l over all frames; the paper's is 100, the longest, which one bad frame decides.
    smoothing : float, seconds
        Standard deviation of the Gaussian over l, since dz/dl is infinite where l = L.
    least_forearm : float, in mean shoulder distances
        The forearm is at least so long; an arm that never lies in the plane of the picture does not show its length.
    elbow_depth : bool
        The upper arm brings the elbow forward by the same law; else, as in the paper, only the forearm counts.
    dead_band : float, widths of the palm
        A hand turns over where its index finger is past the little finger by so much, not before.
    piano_turn : float, radians
        By which a pianist is turned; what is farther left in the picture is nearer to the camera.
    seat : float, metres, height of the stool
    """

    depth: DepthLaw = "root"
    percentile: float = 99.0
    smoothing: float = 0.1
    least_forearm: float = 0.6
    elbow_depth: bool = True
    dead_band: float = 0.15
    piano_turn: float = float(np.radians(35.0))
    seat: float = 0.45

    def __post_init__(self) -> None:
        check_settings(self, not_negative=("smoothing", "least_forearm", "dead_band"), free=("piano_turn",))
        if self.percentile > 100:
            raise ValueError(f"percentile must be 100 at most, got {self.percentile}")
        if not abs(self.piano_turn) < np.radians(80.0):
            raise ValueError(f"piano_turn must lie within 80 degrees, in radians, got {self.piano_turn}")

    @classmethod
    def paper(cls) -> "AvatarParams":
        """As Sec. 5 has it: the longest forearm of all frames as it comes, and the forearm alone makes the depth."""
        return cls(percentile=100.0, smoothing=0.0, least_forearm=0.0, elbow_depth=False)


# Step 5: a pianist's wrists lie along the keyboard, which is turned; keyboard and stool.

WIDTH, DEPTH = 1.22, 0.15  # metres, of 88 keys
OCTAVE, LOWEST_C = 0.1645, 0.047  # metres, and of the lowest C from the left end
F_IN_OCTAVE = 3 / 7
TIPS_AHEAD = 0.06  # metres from the front edge of the keys to where fingers strike
REST_TIPS = np.array([0.0, -0.05, 0.13])  # metres from the wrist to fingertips that no points show
LEAST_ABOVE_HIPS = 0.17  # metres of a pianist's wrists: thighs go under the keys
STOOL_WIDTH, STOOL_DEPTH = 0.42, 0.32


def keyboard_depth(targets: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """Wrists on a line along the keyboard: z = z0 + tan(turn) (xc - x), side -> (T, 3).

    xc is the mean middle of the shoulders, the origin, and z0 the median over hands and frames of what depth from
    forearms gives there. Farther left in the picture is nearer to the camera.
    """
    slope = np.tan(turn)
    ahead = np.median(np.concatenate([wrist[:, 2] + slope * wrist[:, 0] for wrist in targets.values()]))
    return {side: np.column_stack([wrist[:, :2], ahead - slope * wrist[:, 0]]) for side, wrist in targets.items()}


def above_thighs(targets: dict[str, FloatArray], pelvis: FloatArray) -> dict[str, FloatArray]:
    """Wrists, side -> (T, 3), all raised alike where they lie on average less than `LEAST_ABOVE_HIPS` over the hips.

    A camera that looks down on a pianist shows the hands, which are nearer, too low.
    """
    height = float(np.median(np.concatenate([wrist[:, 1] for wrist in targets.values()])) - pelvis[:, 1].mean())
    rise = np.array([0.0, max(LEAST_ABOVE_HIPS - height, 0.0), 0.0])
    return {side: wrist + rise for side, wrist in targets.items()}


def keyboard(joints: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """The corners of a keyboard that rests under the fingertips, before the player, name -> (T, 3).

    From the player, front is near, and low keys are at the left.
    """
    tips = [name for side in SIDES for name in joints if name.startswith(f"{side}_") and name.endswith("_4")]
    wrists = [joints[f"{side}_wrist"] for side in SIDES if f"{side}_wrist" in joints]
    places = np.concatenate([joints[name] for name in tips] or [wrist + turned(REST_TIPS, turn) for wrist in wrists])
    pelvis = joints["pelvis"].mean(axis=0)
    own = turned(places - pelvis, -turn)
    corner = np.array([0.0, np.percentile(own[:, 1], 10), np.median(own[:, 2]) - TIPS_AHEAD])
    numbers = np.arange(KEY_LINES)
    x = WIDTH / 2 - LOWEST_C - OCTAVE * (numbers // 2 + F_IN_OCTAVE * (numbers % 2))
    lines = [[place, 0.0, depth] for place in x for depth in (0.0, DEPTH)]
    table = _table(WIDTH, DEPTH, float(corner[1] + pelvis[1])) + corner
    return _at_rest(player_points.KEYBOARD, np.concatenate([table, lines + corner]), joints["pelvis"], turn)


def stool(pelvis: FloatArray, seat: float, turn: float) -> dict[str, FloatArray]:
    """The corners and feet of a stool of height `seat` on the floor y = 0, name -> (T, 3)."""
    corner = np.array([0.0, seat - pelvis[:, 1].mean(), -STOOL_DEPTH / 2])
    return _at_rest(player_points.STOOL, _table(STOOL_WIDTH, STOOL_DEPTH, seat) + corner, pelvis, turn)


def _table(width: float, depth: float, height: float) -> FloatArray:
    """(9, 3): a level rectangle from the origin on, `OUTLINE`: corners, the first once more, and feet on the floor."""
    left, right = width / 2, -width / 2  # the avatar faces +z: its left is +x
    corners = np.array([[left, 0, 0], [right, 0, 0], [right, 0, depth], [left, 0, depth]])
    return np.concatenate([corners, corners[:1], corners - [0.0, height, 0.0]])


def _at_rest(names: tuple[str, ...], places: FloatArray, pelvis: FloatArray, turn: float) -> dict[str, FloatArray]:
    """Places (N, 3) in the player's own frame, from the mean pelvis, as joints that do not move."""
    world = turned(places, turn) + pelvis.mean(axis=0)
    return {name: np.broadcast_to(place, pelvis.shape) for name, place in zip(names, world, strict=True)}


# Step 1: the points of a picture in metres, the player's shoulders where the avatar's are.

# Share of the player's extent that shoulders must be apart on average: below, they give no scale.
LEAST_SHOULDERS = 1e-3


@dataclass(frozen=True, eq=False)
class PlacedPoints:
    """Points of a player in the plane of the picture, as seen by someone in front.

    Parameters
    ----------
    points : name -> (T, 2) metres, x to the right, y up; the mean middle of both shoulders is the origin
    fps : float, hertz
    turn : float, radians by which the player's body is turned out of the plane, towards +x
    scale : float, metres for each unit of the picture
    """

    points: dict[str, FloatArray]
    fps: float
    turn: float
    scale: float

    def has(self, names: Sequence[str]) -> bool:
        """All these points are there."""
        return set(names) <= self.points.keys()

    def lifted(self, points: FloatArray) -> FloatArray:
        """(T, 3): points (T, 2) put on the upright plane of the body, z = -tan(turn) x."""
        return np.column_stack([points, -np.tan(self.turn) * points[:, 0]])


def placed_points(motion: Motion, *, turn: float = 0.0) -> PlacedPoints:
    """The points by the similarity that brings the time means of both shoulders onto those of the avatar.

    The scale is the avatar's shoulder width by the mean shoulder distance. A player whose left shoulder is at the left
    of the picture was filmed in a mirror (or from behind): the picture is turned round first, so that the avatar's
    left is the player's.

    Parameters
    ----------
    motion : Motion, (T, P, 2), y down
    turn : float, radians
        That the body is turned: its shoulders look narrower by cos(turn), and its left in the picture is nearer.

    Raises
    ------
    ValueError
        Without both shoulders, or where they coincide.
    """
    joints = motion.skeleton.joints
    if not {"left_shoulder", "right_shoulder"} <= set(joints):
        raise ValueError(f"an avatar needs left_shoulder and right_shoulder to be placed by; points are {joints}")
    flat = motion.positions * np.array([1.0, -1.0])
    left, right = (flat[:, joints.index(f"{side}_shoulder")] for side in ("left", "right"))
    is_mirrored = left[:, 0].mean() < right[:, 0].mean()
    if is_mirrored:
        flat, left, right = (points * np.array([-1.0, 1.0]) for points in (flat, left, right))
    across = (left - right).mean(axis=0)
    distance = float(np.linalg.norm(left - right, axis=1).mean())
    if min(np.linalg.norm(across), distance) <= LEAST_SHOULDERS * np.ptp(flat, axis=(0, 1)).max():
        raise ValueError("both shoulders lie on one point on average; an avatar's scale is their distance")
    scale = SHOULDERS * np.cos(turn) / distance
    cosine, sine = across / np.linalg.norm(across)
    middle = (left + right).mean(axis=0) / 2
    # Turned so that the mean shoulders are level.
    level = (flat - middle) @ np.array([[cosine, -sine], [sine, cosine]]) * scale
    points = {name: level[:, joint] for joint, name in enumerate(joints)}
    return PlacedPoints(points, motion.fps, -turn if is_mirrored else turn, scale)


# Step 2: the spine from the hips to the shoulders, the head on it, and legs that rest on the floor.

UP, RIGHT, FRONT = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
SIGNS = {"left": 1.0, "right": -1.0}  # of x: the avatar faces +z
KNEES = 0.13  # metres of the ankles from the middle


def spine(placed: PlacedPoints) -> dict[str, FloatArray]:
    """Joints of trunk and head, name -> (T, 3) metres, shoulders around the origin.

    The root is the mean of the hips, the end of the spine lies towards the mean of the shoulders; its length is the
    mean over time. Without hips the root is a spine at rest below the shoulders.
    """
    shoulders = [placed.lifted(placed.points[f"{side}_shoulder"]) for side in SIDES]
    middle = (shoulders[0] + shoulders[1]) / 2
    length, root = SPINE, middle - SPINE * UP
    if placed.has([f"{side}_hip" for side in SIDES]):
        root = placed.lifted((placed.points["left_hip"] + placed.points["right_hip"]) / 2)
        length = float(np.linalg.norm(middle - root, axis=1).mean())
    up = directions(middle - root, UP)
    across = directions(shoulders[0] - shoulders[1], turned(RIGHT, placed.turn))
    neck = root + length * up
    joints = {"pelvis": root, "neck": neck}
    for side in SIDES:
        joints[f"{side}_shoulder"] = neck + SIGNS[side] * SHOULDERS / 2 * across
        joints[f"{side}_hip"] = root + SIGNS[side] * HIPS / 2 * turned(RIGHT, placed.turn)
    joints["head"] = neck + HEAD * up
    return joints


def legs(trunk: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """Knees, ankles and toes, name -> (T, 3), of a player on a seat over the floor y = 0: feet rest, knees follow."""
    middle = trunk["pelvis"].mean(axis=0) * np.array([1.0, 0.0, 1.0])
    joints: dict[str, FloatArray] = {}
    for side in SIDES:
        foot = np.array([SIGNS[side] * KNEES, ANKLE, 0.9 * THIGH])
        ankle = np.broadcast_to(middle + turned(foot, turn), trunk["pelvis"].shape)
        toe = turned(np.array([0.0, 0.02 - ANKLE, TOE]), turn)
        knee, ankle = two_bones(trunk[f"{side}_hip"], ankle, THIGH, SHANK, turned(FRONT, turn) + UP)
        joints |= {f"{side}_knee": knee, f"{side}_ankle": ankle, f"{side}_toe": ankle + toe}
    return joints


# Step 3: arms that reach for the wrists, whose depth follows from how short a bone looks.

REST_OFFSET = 0.3  # metres that a wrist is before its shoulder where no elbow shows it
UPPER_BY_FOREARM = UPPER_ARM / FOREARM


def forward_offset(length: FloatArray, longest: float, law: str = "root") -> FloatArray:
    """Depth towards the camera of a bone that looks `length` long: sqrt(L^2 - l^2), or linear L - l; 0 from L on.

    A bone of length L = `longest` lies in the plane of the picture, one of length 0 points straight out of it.
    """
    if law == "linear":
        return np.maximum(longest - length, 0.0)
    return np.sqrt(np.maximum(longest**2 - length**2, 0.0))


def wrist_name(placed: PlacedPoints, side: str) -> str:
    """The point that an arm reaches for: the wrist as the body has it, else as the hand has it; "" without both."""
    return next((name for name in (f"{side}_wrist", f"{side}_hand") if name in placed.points), "")


def seen_arm(placed: PlacedPoints, side: str, params: AvatarParams) -> FloatArray | None:
    """(2, T) metres of forearm and upper arm in the picture, smoothed; None for an arm without elbow or wrist."""
    names = [f"{side}_shoulder", f"{side}_elbow", wrist_name(placed, side)]
    if not placed.has(names):
        return None
    shoulder, elbow, wrist = (placed.points[name] for name in names)
    lengths = [np.linalg.norm(bone, axis=1) for bone in (wrist - elbow, elbow - shoulder)]
    return np.stack([smooth(length, params.smoothing, placed.fps) for length in lengths])


def arm_lengths(placed: PlacedPoints, params: AvatarParams) -> tuple[float, float]:
    """(upper arm, forearm), metres: the percentile of the lengths in the picture, of the arm that shows more of it.

    The forearm is no shorter than `least_forearm` of the mean shoulder distance, and the upper arm no shorter than it
    usually is beside such a forearm. Lengths at rest where no arm has an elbow.
    """
    bones = [bone for side in SIDES if (bone := seen_arm(placed, side, params)) is not None]
    if not bones:
        return UPPER_ARM, FOREARM
    forearm, upper = np.percentile(bones, params.percentile, axis=2).max(axis=0)
    forearm = max(float(forearm), params.least_forearm * SHOULDERS, 0.1 * FOREARM)
    return max(float(upper), UPPER_BY_FOREARM * forearm), forearm


def wrist_targets(
    placed: PlacedPoints, trunk: dict[str, FloatArray], lengths: tuple[float, float], params: AvatarParams
) -> dict[str, FloatArray]:
    """Side -> (T, 3) of each wrist there is: where the picture has it, and before its shoulder by `forward_offset`."""
    upper, forearm = lengths
    targets = {}
    for side in SIDES:
        if not (wrist := wrist_name(placed, side)):
            continue
        offset, bones = np.full(len(placed.points[wrist]), REST_OFFSET), seen_arm(placed, side, params)
        if bones is not None:
            offset = forward_offset(bones[0], forearm, params.depth)
            if params.elbow_depth:
                offset = offset + forward_offset(bones[1], upper, params.depth)
        targets[side] = np.column_stack([placed.points[wrist], trunk[f"{side}_shoulder"][:, 2] + offset])
    return targets


def arms(
    trunk: dict[str, FloatArray], targets: dict[str, FloatArray], lengths: tuple[float, float], turn: float
) -> dict[str, FloatArray]:
    """Elbows and wrists, name -> (T, 3): two-bone inverse kinematics, elbows down and outwards.

    A target out of reach is pulled onto the sphere that the arm reaches.
    """
    joints: dict[str, FloatArray] = {}
    for side, target in targets.items():
        pole = turned(np.array([0.5 * SIGNS[side], -1.0, 0.0]), turn)
        elbow, wrist = two_bones(trunk[f"{side}_shoulder"], target, *lengths, pole)
        joints |= {f"{side}_elbow": elbow, f"{side}_wrist": wrist}
    return joints


# Step 4: hands that are palm up or palm down, and fingers that point where they do in the picture.

REST_CURL, CURL_SHARE = 0.2, 0.4  # radians of each further joint, and share of the root's bend added to it
LONGEST = 99.0  # percentile of a length in the picture that is its length


class HandAxes(NamedTuple):
    """Unit vectors of a hand, (T, 3) each: along its back, towards the thumb, out of the palm."""

    along: FloatArray
    thumbwards: FloatArray
    palm: FloatArray


def palm_is_down(offset: FloatArray, dead_band: float) -> BoolArray:
    """(T,) bool: which way a hand is turned, held until the other way is clear (hysteresis).

    Parameters
    ----------
    offset : (T,) array, widths of the palm
        By which the root of the index finger is on that side of the root of the little finger on which it lies while
        the palm is down: for a right hand to the right in the picture.
    dead_band : float
        Offsets up to this size leave the hand as it is. Until the first clear one it is as that will be; down
        where there is none.
    """
    clear = np.flatnonzero(np.abs(offset) > dead_band)
    if not clear.size:
        return np.ones(len(offset), bool)
    last = np.clip(np.searchsorted(clear, np.arange(len(offset)), side="right") - 1, 0, None)
    is_down: BoolArray = offset[clear[last]] > 0
    return is_down


def hand_axes(placed: PlacedPoints, side: str, params: AvatarParams) -> HandAxes | None:
    """Directions of a hand, by the roots of index and little finger; None without them or the hand's wrist.

    Right hand: index to the viewer's left of the little finger is palm up, else palm down; left hand mirrored. How far
    the hand points forward follows from its length in the picture, as for the forearm.
    """
    names = [f"{side}_index_1", f"{side}_little_1"]
    wrist = next((name for name in (f"{side}_hand", f"{side}_wrist") if name in placed.points), "")
    if not wrist or not placed.has(names):
        return None
    index, little = (smooth(placed.points[name], params.smoothing, placed.fps) for name in names)
    middle = (index + little) / 2 - smooth(placed.points[wrist], params.smoothing, placed.fps)
    least = (HAND["index"][0] + HAND["little"][0]) / 2
    along = _out_of_picture(middle, np.linalg.norm(middle, axis=1), least, params)
    across = index - little
    width = max(float(np.percentile(np.linalg.norm(across, axis=1), LONGEST)), 1e-6)
    is_down = palm_is_down(-SIGNS[side] * across[:, 0] / width, params.dead_band)
    sign = np.where(is_down, -SIGNS[side], SIGNS[side])
    sideways = sign * np.maximum(np.abs(across[:, 0]), params.dead_band * width)
    thumbwards = normal_part(np.column_stack([sideways, across[:, 1], np.zeros_like(sideways)]), along)
    return HandAxes(along, thumbwards, SIGNS[side] * np.cross(along, thumbwards))


def _out_of_picture(vectors: FloatArray, length: FloatArray, least: float, params: AvatarParams) -> FloatArray:
    """(T, 3) unit vectors along picture vectors (T, 2), tilted to the camera by how short they look, `length` (T,)."""
    longest = max(float(np.percentile(length, LONGEST)), least)
    return directions(np.column_stack([vectors, forward_offset(length, longest, params.depth)]), FRONT)


def fingers(
    placed: PlacedPoints, side: str, wrist: FloatArray, axes: HandAxes, params: AvatarParams
) -> dict[str, FloatArray]:
    """Joints of the fingers that have a root and a tip in the picture, name -> (T, 3).

    From its root a finger's tip lies at the angle that it has in the picture; the further joints bend along.
    """
    joints: dict[str, FloatArray] = {}
    for finger in FINGERS:
        names = [f"{side}_{finger}_{place}" for place in range(1, PHALANGES + 1)]
        if not placed.has([names[0], names[-1]]):
            continue
        forward, aside, bones = HAND[finger]
        chord = placed.points[names[-1]] - placed.points[names[0]]
        length = smooth(np.linalg.norm(chord, axis=1), params.smoothing, placed.fps)  # the angle is not smoothed
        pointing = _out_of_picture(chord, length, 0.9 * sum(bones), params)
        places = [wrist + forward * axes.along + aside * axes.thumbwards]
        for bone, direction in zip(bones, _bent(pointing, axes.palm, bones), strict=True):
            places.append(places[-1] + bone * direction)
        joints |= dict(zip(names, places, strict=True))
    return joints


def _bent(pointing: FloatArray, palm: FloatArray, bones: tuple[float, ...]) -> list[FloatArray]:
    """Directions (T, 3) of a finger's bones, each bent further to the palm, whose end lies along `pointing`."""
    inwards = normal_part(palm, pointing)
    bend = np.arcsin(np.clip((pointing * palm).sum(axis=1, keepdims=True), -1.0, 1.0))
    angles = [number * (REST_CURL + CURL_SHARE * np.maximum(bend, 0.0)) for number in range(len(bones))]
    turned_bones = list(zip(bones, angles, strict=True))
    up, ahead = (sum(bone * turn(angle) for bone, angle in turned_bones) for turn in (np.sin, np.cos))
    start = np.arctan2(up, ahead)
    return [np.cos(angle - start) * pointing + np.sin(angle - start) * inwards for angle in angles]


# Step 6: the violin and its bow, held by four constraints: two points that are fixed, two that look at another.

CHIN = np.array([0.05, -0.09, 0.07])  # metres from the head: to its left, up, ahead
BRIDGE, NECK, SCROLL, BOW = 0.19, 0.33, 0.59, 0.74  # metres from the chin rest, and of the bow
FROG = (0.07, 0.02)  # metres from the wrist along the hand, and out of the palm
REST_AIM = np.array([0.7, 0.0, 0.714])  # to the left and ahead, as the violin is held


def violin(trunk: dict[str, FloatArray], joints: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Chin rest, bridge, beginning of the neck, and scroll, (T, 3).

    First constraint: the violin is at a point fixed to the head. Second: it looks at the root of the left index finger,
    else at the left wrist; without either, or where both coincide, to the left and ahead.
    """
    up = directions(trunk["neck"] - trunk["pelvis"], UP)
    left = normal_part(trunk["left_shoulder"] - trunk["right_shoulder"], up)
    chin = trunk["head"] + CHIN[0] * left + CHIN[1] * up + CHIN[2] * np.cross(left, up)
    hand = next((joints[name] for name in ("left_index_1", "left_wrist") if name in joints), chin)
    pointing = directions(hand - chin, REST_AIM / np.linalg.norm(REST_AIM))
    places = [chin + distance * pointing for distance in (0.0, BRIDGE, NECK, SCROLL)]
    return dict(zip(player_points.VIOLIN, places, strict=True))


def bow(wrist: FloatArray, axes: HandAxes | None, bridge: FloatArray) -> dict[str, FloatArray]:
    """Frog and tip of the bow in the right hand, name -> (T, 3).

    Third constraint: the frog is at a point fixed to the hand, the wrist without fingers. Fourth: the bow looks at the
    bridge; to +x where both coincide.
    """
    frog = wrist if axes is None else wrist + FROG[0] * axes.along + FROG[1] * axes.palm
    return {"bow_frog": frog, "bow_tip": frog + BOW * directions(bridge - frog, RIGHT)}


# Step 7: all parts as one motion, whose skeleton has further trees for the instrument.


def avatar(points: Motion, instrument: str, *, params: AvatarParams | None = None) -> Motion:
    """An avatar that moves as the points of a musician in a picture do (Sec. 5).

    Parameters
    ----------
    points : Motion, (T, P, 2), any unit, y down, joints by the names of `player_points`
        Both shoulders are needed. Other points may be missing: an arm needs its wrist (or the hand's), a hand the roots
        of index and little finger, a finger its root and its tip; what they lack is left out.
    instrument : "piano" or "violin"
    params : AvatarParams, default our settings

    Returns
    -------
    Motion, (T, J, 3) metres, y up, floor at y = 0, facing +z (at the piano turned to +x by `piano_turn`). Its first
    tree is the body, with the fingers that there are; further trees are the stool, and keyboard or violin and bow
    (`player_points.PROPS`). No bone changes its length.

    Raises
    ------
    ValueError
        For another instrument, points in space, or points without both shoulders.
    """
    params = AvatarParams() if params is None else params
    check_choice("instrument", instrument, INSTRUMENTS)
    if points.positions.shape[2] != 2:
        raise ValueError("an avatar is put together from the points of a picture, (T, P, 2); these are in space")
    placed = placed_points(points, turn=params.piano_turn if instrument == "piano" else 0.0)
    joints = _body(placed, instrument, params)
    height = params.seat + HIP_ABOVE_SEAT - joints["pelvis"][:, 1].mean()
    joints = {name: places + np.array([0.0, height, 0.0]) for name, places in joints.items()}
    joints |= legs(joints, placed.turn) | stool(joints["pelvis"], params.seat, placed.turn)
    if instrument == "piano" and not {"left_wrist", "right_wrist"}.isdisjoint(joints):
        joints |= keyboard(joints, placed.turn)
    names = tuple(joints)
    skeleton = Skeleton(names, tuple(names.index(_PARENTS[name]) if name in _PARENTS else -1 for name in names))
    return Motion(np.stack([*joints.values()], axis=1), points.fps, skeleton, points.valid)


def _body(placed: PlacedPoints, instrument: str, params: AvatarParams) -> dict[str, FloatArray]:
    """Trunk, arms, hands and violin, name -> (T, 3), shoulders around the origin."""
    trunk = spine(placed)
    lengths = arm_lengths(placed, params)
    targets = wrist_targets(placed, trunk, lengths, params)
    if instrument == "piano" and targets:
        targets = above_thighs(keyboard_depth(targets, placed.turn), trunk["pelvis"])
    joints = trunk | arms(trunk, targets, lengths, placed.turn)
    axes = {side: hand_axes(placed, side, params) for side in targets}
    for side, hand in axes.items():
        if hand is not None:
            joints |= fingers(placed, side, joints[f"{side}_wrist"], hand, params)
    if instrument == "violin":
        joints |= violin(trunk, joints)
        if "right" in targets:
            joints |= bow(joints["right_wrist"], axes["right"], joints["violin_bridge"])
    return joints


def _parents() -> dict[str, str]:
    parents = {"neck": "pelvis", "head": "neck"}
    for side in SIDES:
        chain = ["pelvis", *(f"{side}_{part}" for part in ("hip", "knee", "ankle", "toe"))]
        chains = [chain, ["neck", *(f"{side}_{part}" for part in ("shoulder", "elbow", "wrist"))]]
        chains += [[f"{side}_wrist", *(f"{side}_{f}_{k}" for k in range(1, PHALANGES + 1))] for f in FINGERS]
        for chain in chains:
            parents |= dict(zip(chain[1:], chain[:-1], strict=True))
    tables = (names[: len(CORNERS) + 1] for names in (player_points.KEYBOARD, player_points.STOOL))
    for outline in (*tables, player_points.VIOLIN, player_points.BOW):
        parents |= dict(zip(outline[1:], outline[:-1], strict=True))
    parents |= {f"{table}_{c}_foot": f"{table}_{c}" for table in ("keyboard", "stool") for c in CORNERS}
    return parents | {f"keyboard_{line}_back": f"keyboard_{line}_front" for line in range(1, KEY_LINES + 1)}


_PARENTS = _parents()
