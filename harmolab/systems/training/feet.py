"""A generated dancer put on the floor: its height, feet that do not slide while they carry, and legs that allow it.

A network predicts joints one by one. That the lowest of them neither floats nor sinks, and that a standing foot stays
in its place, needs no learning. Legs of two bones, hip to knee to ankle, follow by inverse kinematics.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter, minimum_filter1d

from harmolab.body.kinematics import smooth
from harmolab.body.rotations import TINY, two_bones
from harmolab.body.skeletons import HIPS, Skeleton, foot_joints, heading, joint_part, subtree
from harmolab.types import BoolArray, FloatArray

FLOOR_WINDOW = 1.2  # seconds; a jump is shorter
FLOOR_SMOOTHING = 0.6  # seconds
RESTING = 5.0  # percentile of the height of a joint, over a whole recording, at which it rests
CONTACT_HEIGHT = 0.02  # metres above its resting height at which a foot carries little
CONTACT_SPEED = 1.0  # metres per second at which it is rather swung than slides
AIR = 0.02  # weight of "no foot carries" beside the weights of the feet, each 0 to 1
BODY_SMOOTHING = 0.5  # seconds, about a beat
BODY_SHARE = 0.5  # of the feet's slide that the body takes back
LEG_SMOOTHING = 0.04  # seconds
HOLD_TIME, FREE_TIME = 2.0, 0.15  # seconds in which a foot that carries, or does not, returns to its own way
FARTHEST = 0.25  # metres that a foot is held back
STRETCHED = 0.99  # of its length: a leg is not pulled further, since a knee snaps where a leg becomes straight
FORWARD = 0.05  # of the foot's direction in that of the knee, which a straight leg does not show
STANDING_SPEED = 0.25  # metres per second at which a foot hardly carries
STANDING_HEIGHT = 0.1  # metres above the other foot, likewise
TOLD = 4.0  # what a contact that is told counts beside these two
CHANGE = 0.05  # seconds in which the load goes from one foot to the other
ROLLING = 0.1  # metres per second: joints of a foot that are slower stand alike
ROOT_SMOOTHING = 0.1  # seconds, of the body's way and height over the foot that carries
STEP_HEIGHT = 0.05  # metres that a foot is lifted at least
STEP_SPEED = 0.5  # metres per second at which, or above, it is lifted so high
AHEAD = 0.2  # metres by which a knee is drawn to where the hips face: a nearly straight leg trembles to either side


def on_floor(positions: FloatArray, fps: float) -> FloatArray:
    """Positions (T, J, 3) shifted up and down so that the dancer stands on y = 0, and nothing is ever below it.

    The floor is what the lowest joint comes back to within about a second, smoothed: slow floating and sinking goes,
    jumps and knee bends stay.
    """
    lowest = positions[..., 1].min(axis=1)
    window = max(1, round(FLOOR_WINDOW * fps))
    floor = smooth(minimum_filter1d(lowest, window, mode="nearest"), FLOOR_SMOOTHING, fps)
    shift = floor + (lowest - floor).min()
    return positions - shift[:, None, None] * np.array([0.0, 1.0, 0.0])


def grounded(positions: FloatArray, fps: float, skeleton: Skeleton, *, plant_feet: bool) -> FloatArray:
    """Positions (T, J, 3) `on_floor`, and with `planted_feet` if they are asked for."""
    positions = on_floor(positions, fps)
    return planted_feet(positions, fps, skeleton) if plant_feet else positions


def planted_feet(positions: FloatArray, fps: float, skeleton: Skeleton) -> FloatArray:
    """Positions (T, J, 3) with feet that do not slide while they carry: the body goes with them, the legs do the rest.

    A foot carries as far as one of its joints is near its resting height (low) and slow, which falls off smoothly. The
    body is moved against the mean slide of the feet, but slowly, and only half as far: more would undo the movement on
    the beat. The legs do the rest: a foot that carries is held back, one that does not returns to its own way. No bone
    changes. If a foot has no knee and hip above it, the body goes all the way; a
    skeleton without joints called toe, heel, ankle or foot is left alone.
    """
    try:
        feet = foot_joints(skeleton)
    except ValueError:
        return positions
    if len(positions) < 2:
        return positions
    legs = [find_leg(skeleton, foot) for foot in feet]
    slide, _ = _slide(positions, fps, [joint for foot in feet for joint in foot])
    way = np.cumsum(smooth(slide, BODY_SMOOTHING, fps), axis=0) / fps * (BODY_SHARE if all(legs) else 1.0)
    planted = positions - np.insert(np.concatenate([np.zeros((1, 2)), way]), 1, 0.0, axis=1)[:, None]
    shifts = np.stack([_held_back(*_slide(planted, fps, list(foot)), fps) for foot in feet], axis=1)
    return moved_feet(planted, legs, np.insert(smooth(shifts, LEG_SMOOTHING, fps), 1, 0.0, axis=2))


def standing_dancer(positions: FloatArray, fps: float, skeleton: Skeleton, contacts: FloatArray) -> FloatArray:
    """Positions (T, J, 3) of a dancer who glides and floats, put on the feet that carry; nothing is below y = 0.

    Which foot carries is told by `contacts`, and by which is slower and lower; one always does. The body goes up and
    down, and along, so that the foot that carries is on the floor and stays. The legs do the rest: such a foot is held
    back as by `planted_feet`, one that steps leaves the floor, and one in the air goes its own way. No bone changes.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up, at any height
    fps : float, hertz
    skeleton : Skeleton with F feet (`harmolab.body.skeletons.foot_joints`; ValueError where there is none)
    contacts : (T, F) array, 1 where a foot stands, 0 where it does not; a network's, or `foot_contacts`
    """
    feet = [list(foot) for foot in foot_joints(skeleton)]
    if len(positions) < 2:
        return on_floor(positions, fps)
    velocity, lowest = _foot_velocity(positions, fps, feet), _lowest(positions, feet)
    load = _load(velocity, lowest, contacts, fps)
    share = (load / load.sum(axis=1, keepdims=True))[..., None]
    way = np.cumsum(smooth((share * velocity).sum(axis=1), ROOT_SMOOTHING, fps), axis=0) / fps
    floor = smooth((share[..., 0] * lowest).sum(axis=1), ROOT_SMOOTHING, fps)
    standing = positions - np.insert(way, 1, floor, axis=1)[:, None]
    shifts = smooth(_steps(standing, fps, feet, load), LEG_SMOOTHING, fps)
    angle = heading(positions, fps, skeleton, parts=HIPS)
    ahead = AHEAD * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    standing = moved_feet(standing, [find_leg(skeleton, foot) for foot in feet], shifts, ahead)
    return standing - min(standing[..., 1].min(), 0.0) * np.array([0.0, 1.0, 0.0])


def _load(velocity: FloatArray, lowest: FloatArray, contacts: FloatArray, fps: float) -> FloatArray:
    """Load (T, F) of each foot, 0 to 1; the one that carries most has 1, but while it changes."""
    speed = smooth(np.linalg.norm(velocity, axis=2), LEG_SMOOTHING, fps)
    above = lowest - lowest.min(axis=1, keepdims=True)
    score = TOLD * contacts - (speed / STANDING_SPEED) ** 2 - (above / STANDING_HEIGHT) ** 2
    return smooth(np.exp(score - score.max(axis=1, keepdims=True)), CHANGE, fps)


def _steps(positions: FloatArray, fps: float, feet: Sequence[list[int]], load: FloatArray) -> FloatArray:
    """Shift (T, F, 3) of each foot, not smooth: it stands as far as it carries, else it is as high as a step."""
    velocity, lowest = _foot_velocity(positions, fps, feet), _lowest(positions, feet)
    step = STEP_HEIGHT * np.minimum(np.linalg.norm(velocity, axis=2) / STEP_SPEED, 1.0)
    up = (1 - load) * np.maximum(lowest, step) - lowest
    slide = load[..., None] * velocity
    held = [_held_back(slide[1:, foot], load[1:, foot], fps) for foot in range(len(feet))]
    return np.insert(np.stack(held, axis=1), 1, up, axis=2)


def _lowest(positions: FloatArray, feet: Sequence[list[int]]) -> FloatArray:
    """Height (T, F) of the lowest joint of each foot."""
    return np.stack([positions[:, foot, 1].min(axis=1) for foot in feet], axis=1)


def _foot_velocity(positions: FloatArray, fps: float, feet: Sequence[list[int]]) -> FloatArray:
    """Horizontal velocity (T, F, 2) of each foot: mostly that of its slowest joint, as it may turn on heel or toe."""
    velocity = np.gradient(positions[..., [0, 2]], axis=0) * fps
    weight = 1 / ((velocity**2).sum(axis=2, keepdims=True) + ROLLING**2)
    sums = [[(part[:, foot]).sum(axis=1) for foot in feet] for part in (weight * velocity, weight)]
    return np.stack(sums[0], axis=1) / np.stack(sums[1], axis=1)


def _slide(positions: FloatArray, fps: float, joints: list[int]) -> tuple[FloatArray, FloatArray]:
    """Horizontal velocity (T - 1, 2) of joints, weighted by their load, and that load (T - 1,), from 0 to 1."""
    height = positions[:, joints, 1] - np.percentile(positions[:, joints, 1], RESTING, axis=0)
    height = np.maximum(np.maximum(height[1:], height[:-1]), 0.0)
    velocity = np.diff(positions[:, joints][..., [0, 2]], axis=0) * fps  # (T-1, F, 2)
    speed = np.linalg.norm(velocity, axis=2)
    weight = np.exp(-((height / CONTACT_HEIGHT) ** 2) - (speed / CONTACT_SPEED) ** 2)
    total = weight.sum(axis=1) + AIR
    return (weight[..., None] * velocity).sum(axis=1) / total[:, None], weight.sum(axis=1) / total


def _held_back(slide: FloatArray, load: FloatArray, fps: float) -> FloatArray:
    """Shift (T, 2) that makes a foot stand while it carries, not smooth, from its slide (T - 1, 2) and load (T - 1,).

    A shift that starts at 0 where the foot lands is largest where it leaves, and the other way round backwards in time:
    their mean has the same velocity and is half as far off.
    """
    forwards, backwards = _added_up(slide, load, fps), _added_up(-slide[::-1], load[::-1], fps)[::-1]
    return (forwards + backwards) / 2


def _added_up(slide: FloatArray, load: FloatArray, fps: float) -> FloatArray:
    """The slide (T - 1, 2) taken back step by step, (T, 2); forgotten quickly where there is no load."""
    decays = np.exp(-((1 - load) / FREE_TIME + load / HOLD_TIME) / fps)
    steps = slide / fps
    shifts = [0j]  # x + i z: two numbers a step are slow as an array
    for step, decay in zip((steps[:, 0] + 1j * steps[:, 1]).tolist(), decays.tolist(), strict=True):
        moved = decay * shifts[-1] - step
        shifts.append(moved * (FARTHEST / max(abs(moved), FARTHEST)))
    return np.column_stack([np.real(shifts), np.imag(shifts)])


@dataclass(frozen=True)
class Leg:
    """Joints of a leg by number; `foot` is the ankle and all that hangs on it."""

    hip: int
    knee: int
    ankle: int
    foot: tuple[int, ...]


def find_leg(skeleton: Skeleton, foot: Sequence[int]) -> Leg | None:
    """The leg above the joints of one foot (`harmolab.body.skeletons.foot_joints`).

    None where they hang on more than one joint, where no knee and hip are above them, or where the knee carries more
    than this foot.
    """
    tops = [joint for joint in foot if skeleton.parents[joint] not in foot]
    if len(tops) != 1:
        return None
    ankle = tops[0]
    knee = skeleton.parents[ankle]
    hip = skeleton.parents[knee] if knee >= 0 else -1
    below = subtree(skeleton.parents, ankle)
    if hip < 0 or subtree(skeleton.parents, knee) != (*sorted({knee, *below}),):
        return None
    return Leg(hip, knee, ankle, below)


def moved_feet(
    positions: FloatArray, feet: Sequence[Leg | None], shifts: FloatArray, ahead: FloatArray | float = 0.0
) -> FloatArray:
    """Positions (T, J, 3) with the foot of each of F legs moved by `shifts` (T, F, 3), as far as the leg reaches.

    The hip stays, thigh and shank keep their lengths, and the knee stays on the side that it was bent to; `ahead`
    (T, 3), metres, draws it to another. A foot that has no whole leg, None, stays where it is.
    """
    legs, shifts = [leg for leg in feet if leg is not None], shifts[:, [leg is not None for leg in feet]]
    if not legs:
        return positions
    joints = np.array([(leg.hip, leg.knee, leg.ankle) for leg in legs])
    hip, knee, ankle = (np.concatenate(positions[:, own].swapaxes(0, 1)) for own in joints.T)
    foot = np.concatenate([positions[:, leg.foot].mean(axis=1) for leg in legs])
    thigh, shank = _lengths(knee - hip), _lengths(ankle - knee)
    longest = np.maximum(STRETCHED * (thigh + shank), _lengths(ankle - hip))
    target = ankle + np.concatenate(shifts.swapaxes(0, 1))
    way = np.tile(np.broadcast_to(ahead, positions[:, 0].shape), (len(legs), 1))
    pole = (knee - hip) + FORWARD * (foot - ankle) + way
    knees, reached = two_bones(hip, target, thigh, shank, pole, longest=longest)
    changed = positions.copy()
    for leg, bent, moved in zip(legs, np.split(knees, len(legs)), np.split(reached - ankle, len(legs)), strict=True):
        changed[:, leg.knee] = bent
        changed[:, leg.foot] += moved[:, None]
    return changed


def _lengths(vectors: FloatArray) -> FloatArray:
    """(T, 1) lengths of vectors (T, 3), never 0."""
    return np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


# Which foot stands: by the height and the speed of its heel and toe.

HEIGHT = 0.03  # metres above where a joint rests
SPEED = 0.3  # metres per second along the floor
MEDIAN = 3  # frames


def foot_contacts(positions: FloatArray, fps: float, skeleton: Skeleton) -> BoolArray:
    """(T, 2) mask: True where the left, the right foot stands: its heel or toe is near its resting height, and slow.

    Parameters
    ----------
    positions : (T, J, 3) array, metres, y up; a whole recording, whose 5th percentile of a joint's height is the floor
    fps : float, hertz
    skeleton : Skeleton with feet on both sides

    Raises
    ------
    ValueError
        If the skeleton has no feet, or not one on each side.
    """
    feet = foot_joints(skeleton)
    if len(feet) != 2:
        raise ValueError(f"contacts need a left and a right foot; the skeleton has {len(feet)}: {skeleton.joints}")
    velocity = np.gradient(positions[..., [0, 2]], axis=0) * fps
    height = positions[..., 1] - np.percentile(positions[..., 1], RESTING, axis=0)
    down = (height < HEIGHT) & (np.linalg.norm(velocity, axis=2) < SPEED)
    standing = np.stack([down[:, _soles(skeleton, foot)].any(axis=1) for foot in feet], axis=1)
    steady: BoolArray = median_filter(standing, size=(MEDIAN, 1), mode="nearest")
    return steady


def _soles(skeleton: Skeleton, foot: tuple[int, ...]) -> list[int]:
    """Heel and toe of a foot; all of its joints where neither has a name."""
    soles = [joint for joint in foot if joint_part(skeleton.joints[joint]) in ("heel", "toe", "toes")]
    return soles or list(foot)
