"""Step 2: the spine from the hips to the shoulders, the head on it, and legs that rest on the floor."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import SIDES
from harmolab.rotations import directions, normal_part, two_bones
from harmolab.skeletons import turned
from harmolab.systems.audio2body.avatar import params as measures
from harmolab.systems.audio2body.avatar.place import PlacedPoints
from harmolab.types import FloatArray

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
    length, root = measures.SPINE, middle - measures.SPINE * UP
    if placed.has([f"{side}_hip" for side in SIDES]):
        root = placed.lifted((placed.points["left_hip"] + placed.points["right_hip"]) / 2)
        length = float(np.linalg.norm(middle - root, axis=1).mean())
    up = directions(middle - root, UP)
    across = directions(shoulders[0] - shoulders[1], turned(RIGHT, placed.turn))
    neck = root + length * up
    joints = {"pelvis": root, "neck": neck}
    for side in SIDES:
        joints[f"{side}_shoulder"] = neck + SIGNS[side] * measures.SHOULDERS / 2 * across
        joints[f"{side}_hip"] = root + SIGNS[side] * measures.HIPS / 2 * turned(RIGHT, placed.turn)
    joints["head"] = neck + measures.HEAD * up
    return joints


def trunk_axes(trunk: dict[str, FloatArray]) -> FloatArray:
    """(3, T, 3): unit vectors to the left of the upper body, up along its spine, and ahead."""
    up = directions(trunk["neck"] - trunk["pelvis"], UP)
    left = normal_part(trunk["left_shoulder"] - trunk["right_shoulder"], up)
    return np.stack([left, up, np.cross(left, up)])


def legs(trunk: dict[str, FloatArray], turn: float) -> dict[str, FloatArray]:
    """Knees, ankles and toes, name -> (T, 3), of a player on a seat over the floor y = 0: feet rest, knees follow."""
    middle = trunk["pelvis"].mean(axis=0) * np.array([1.0, 0.0, 1.0])
    joints: dict[str, FloatArray] = {}
    for side in SIDES:
        foot = np.array([SIGNS[side] * KNEES, measures.ANKLE, 0.9 * measures.THIGH])
        ankle = np.broadcast_to(middle + turned(foot, turn), trunk["pelvis"].shape)
        toe = ankle + turned(np.array([0.0, 0.02 - measures.ANKLE, measures.TOE]), turn)
        pole = turned(FRONT, turn) + UP
        knee, ankle = two_bones(trunk[f"{side}_hip"], ankle, measures.THIGH, measures.SHANK, pole)
        joints |= {f"{side}_knee": knee, f"{side}_ankle": ankle, f"{side}_toe": ankle + (toe - ankle)}
    return joints
