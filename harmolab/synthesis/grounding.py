"""What makes a generated dancer stand on the floor: its height, and feet that do not slide while they carry.

A network predicts joints one by one; that the lowest of them should neither float nor sink, and that a standing foot
stays where it is, is known without any learning.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from harmolab.io.joint_names import foot_joints
from harmolab.kinematics import smooth
from harmolab.types import FloatArray, Skeleton

__all__ = ["on_floor", "planted_feet"]

FLOOR_WINDOW = 1.2  # seconds; a jump is shorter
FLOOR_SMOOTHING = 0.6  # seconds
RESTING_PERCENTILE = 5.0
CONTACT_HEIGHT = 0.02  # metres above its resting height at which a foot carries little
CONTACT_SPEED = 1.0  # metres per second at which it is rather swung than slides
AIR = 0.02  # weight of "no foot carries"; against it the feet have to make their case
PLANT_SMOOTHING = 0.06  # seconds


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
    """Positions (T, J, 3) with the body's way over the floor changed so that feet which carry do not slide.

    Every foot joint has a weight: large where it is near its resting height (low) and slow, falling off smoothly. The
    whole body is moved against the weighted mean of the feet's own velocities, smoothed a little, so nothing jerks and
    no bone changes. A skeleton without joints called toe, heel, ankle or foot is left alone.
    """
    try:
        feet = [joint for foot in foot_joints(skeleton) for joint in foot]
    except ValueError:
        return positions
    if len(positions) < 2:
        return positions
    height = positions[:, feet, 1] - np.percentile(positions[:, feet, 1], RESTING_PERCENTILE, axis=0)
    height = np.maximum(np.maximum(height[1:], height[:-1]), 0.0)
    velocity = np.diff(positions[:, feet][..., [0, 2]], axis=0) * fps  # (T-1, F, 2)
    speed = np.linalg.norm(velocity, axis=2)
    weight = np.exp(-((height / CONTACT_HEIGHT) ** 2) - (speed / CONTACT_SPEED) ** 2)
    slide = (weight[..., None] * velocity).sum(axis=1) / (weight.sum(axis=1) + AIR)[:, None]
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(smooth(slide, PLANT_SMOOTHING, fps), axis=0) / fps])
    shifted = positions.copy()
    shifted[..., [0, 2]] -= way[:, None]
    return shifted
