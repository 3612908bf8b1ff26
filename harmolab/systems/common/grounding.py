"""What makes a generated dancer stand on the floor: its height, and feet that do not slide while they carry.

A network predicts joints one by one; that the lowest of them should neither float nor sink, and that a standing foot
stays where it is, is known without any learning.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from harmolab.kinematics import smooth
from harmolab.skeletons import foot_joints
from harmolab.systems.common.legs import find_leg, moved_foot
from harmolab.types import FloatArray, Skeleton

FLOOR_WINDOW = 1.2  # seconds; a jump is shorter
FLOOR_SMOOTHING = 0.6  # seconds
RESTING_PERCENTILE = 5.0
CONTACT_HEIGHT = 0.02  # metres above its resting height at which a foot carries little
CONTACT_SPEED = 1.0  # metres per second at which it is rather swung than slides
AIR = 0.02  # weight of "no foot carries"; against it the feet have to make their case
BODY_SMOOTHING = 0.5  # seconds, about a beat
BODY_SHARE = 0.5  # of the feet's slide that the body takes back
LEG_SMOOTHING = 0.04  # seconds
HOLD_TIME, FREE_TIME = 2.0, 0.15  # seconds in which a foot that carries, or does not, returns to its own way
FARTHEST = 0.25  # metres that a foot is held back


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


def planted_feet(positions: FloatArray, fps: float, skeleton: Skeleton) -> FloatArray:
    """Positions (T, J, 3) with feet that do not slide while they carry: the body goes with them, the legs do the rest.

    A foot carries as far as one of its joints is near its resting height (low) and slow, which falls off smoothly. The
    body is moved against the mean slide of the feet, but slowly, and only half as far: more would undo what the dancer
    does on the beat. What is left is done by the legs: a foot that carries is held back, one that does not returns to
    where it would have been. No bone changes. If a foot has no knee and hip above it, the body goes all the way; a
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
    planted = positions - _level(np.concatenate([np.zeros((1, 2)), way]))[:, None]
    for foot, leg in zip(feet, legs, strict=True):
        if leg is not None:
            planted = moved_foot(planted, leg, _level(_held_back(planted, fps, list(foot))))
    return planted


def _slide(positions: FloatArray, fps: float, joints: list[int]) -> tuple[FloatArray, FloatArray]:
    """Horizontal velocity (T - 1, 2) of these joints as far as they carry, and how far that is (T - 1,), 0 to 1."""
    height = positions[:, joints, 1] - np.percentile(positions[:, joints, 1], RESTING_PERCENTILE, axis=0)
    height = np.maximum(np.maximum(height[1:], height[:-1]), 0.0)
    velocity = np.diff(positions[:, joints][..., [0, 2]], axis=0) * fps  # (T-1, F, 2)
    speed = np.linalg.norm(velocity, axis=2)
    weight = np.exp(-((height / CONTACT_HEIGHT) ** 2) - (speed / CONTACT_SPEED) ** 2)
    total = weight.sum(axis=1) + AIR
    return (weight[..., None] * velocity).sum(axis=1) / total[:, None], weight.sum(axis=1) / total


def _held_back(positions: FloatArray, fps: float, foot: list[int]) -> FloatArray:
    """How far (T, 2) to move a foot so that it stands while it carries.

    A shift that starts at 0 where the foot lands is largest where it leaves, and the other way round backwards in time:
    their mean has the same velocity and is half as far off.
    """
    slide, load = _slide(positions, fps, foot)
    forwards, backwards = _added_up(slide, load, fps), _added_up(-slide[::-1], load[::-1], fps)[::-1]
    return smooth((forwards + backwards) / 2, LEG_SMOOTHING, fps)


def _added_up(slide: FloatArray, load: FloatArray, fps: float) -> FloatArray:
    """The slide (T - 1, 2) taken back step by step, (T, 2); forgotten quickly where there is no load."""
    kept = np.exp(-((1 - load) / FREE_TIME + load / HOLD_TIME) / fps)
    shift = np.zeros((len(slide) + 1, 2))
    for frame, (velocity, keep) in enumerate(zip(slide, kept, strict=True)):
        moved = keep * shift[frame] - velocity / fps
        shift[frame + 1] = moved * (FARTHEST / max(float(np.hypot(*moved)), FARTHEST))
    return shift


def _level(way: FloatArray) -> FloatArray:
    """(T, 3) of horizontal (T, 2)."""
    return np.stack([way[:, 0], np.zeros(len(way)), way[:, 1]], axis=1)
