"""Step 1: the points of a picture in metres, the player's shoulders where the avatar's are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harmolab.systems.audio2body.avatar.params import SHOULDERS
from harmolab.types import FloatArray, Motion

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
