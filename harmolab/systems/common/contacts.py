"""Which foot stands: by the height and the speed of its heel and toe."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from harmolab.skeletons import foot_joints, joint_part
from harmolab.types import BoolArray, FloatArray, Skeleton

HEIGHT = 0.03  # metres above where a joint rests
SPEED = 0.3  # metres per second along the floor
RESTING = 5.0  # percentile of a joint's height, over a whole recording
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
