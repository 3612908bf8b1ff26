"""A body of 21 joints with an adult's proportions: poses in angles and footholds, bones of constant length."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from harmolab.rotations import two_bones
from harmolab.types import FloatArray, Skeleton

# The harmony paper's points 0 to 20. The neck is no joint: head and shoulders hang on the torso.
DANCER = Skeleton(
    (
        "head L", "head R", "torso", "shoulder L", "elbow L", "forearm L", "hand L", "hip L", "knee L", "ankle L",
        "heel L", "toe L", "shoulder R", "elbow R", "wrist R", "finger R", "hip R", "knee R", "ankle R", "heel R",
        "toe R",
    ),
    (2, 2, -1, 2, 3, 4, 5, 2, 7, 8, 9, 9, 2, 12, 13, 14, 2, 16, 17, 18, 18),
)  # fmt: skip

# Segment lengths as shares of the stature (Drillis and Contini 1966, as in Winter, "Biomechanics and motor control").
# The torso point is the waist, about which chest and pelvis turn.
SHARES = MappingProxyType(
    {
        "waist": 0.605, "shoulder": 0.818, "head": 0.93, "hip": 0.53, "ankle": 0.039,
        "half shoulders": 0.129, "half hips": 0.065, "half head": 0.044,
        "upper arm": 0.186, "forearm": 0.146, "hand": 0.054, "finger": 0.108,
        "thigh": 0.245, "shank": 0.246, "heel": 0.04, "toe": 0.1,
    }
)  # fmt: skip

# Where each quantity stands in a pose vector. Angles are radians; root and feet are places on the floor, metres (x, z).
ROOT = slice(0, 2)
HEADING, RISE, PELVIS = 2, 3, 4
CHEST = slice(5, 8)  # twist, bow, lean
HEAD = 8
ARMS = (slice(9, 14), slice(14, 19))  # left, right: as `synth_figures.ARM_POSES`
FEET = (slice(19, 23), slice(23, 27))  # left, right: ankle when flat (x, z), direction, lift of the heel
BOTH_ARMS, UPPER_BODY = slice(9, 19), slice(4, 19)
POSE_SIZE = 27

REACH = 0.995  # of the leg's length: a knee is never quite straight
SOFTNESS = 0.012  # metres over which the waist gives way when a leg is at its reach


def waist_height(stature: float) -> float:
    """Height of the torso point above the floor when standing easily, metres."""
    return (SHARES["waist"] - 0.012) * stature


def joint_positions(poses: FloatArray, lifts: FloatArray, stature: float) -> FloatArray:
    """Joints of the body in each pose, by forward kinematics; the knees follow from hips and ankles.

    Parameters
    ----------
    poses : (T, POSE_SIZE) array, laid out as `ROOT` to `FEET` above
    lifts : (T, 2) array, metres
        Height of the left and right foot above the floor.
    stature : float, metres

    Returns
    -------
    (T, 21, 3) array, metres, y up, right-handed; at heading 0 the dancer faces +z and its left is +x.
    """
    still = np.zeros(len(poses))
    heading = poses[:, HEADING]
    pelvis = _turned(heading, still, poses[:, PELVIS])
    # The chest faces with the pelvis but does not tilt with it.
    chest = _turned(heading, still, still) @ _turned(*poses[:, CHEST].T)
    hips = [
        pelvis @ _offset(side * SHARES["half hips"], SHARES["hip"] - SHARES["waist"], 0, stature) for side in (1, -1)
    ]
    ankles = [_foot(poses[:, where], lifts[:, side], stature) for side, where in enumerate(FEET)]
    torso = _torso(poses, hips, [ankle[0] for ankle in ankles], stature)
    joints = np.empty((len(poses), len(DANCER.joints), 3))
    joints[:, 2] = torso
    joints[:, 0:2] = torso[:, None] + _head(chest, poses[:, HEAD], stature)
    for side, (arm, leg) in enumerate(((3, 7), (12, 16))):
        joints[:, arm : arm + 4] = torso[:, None] + _arm(chest, poses[:, ARMS[side]], 1 - 2 * side, stature)
        ankle, heel, toe = ankles[side]
        hip = torso + hips[side]
        facing = (heading + poses[:, FEET[side]][:, 2]) / 2
        knee, reached = _leg(hip, ankle, facing, stature)
        shift = reached - ankle
        joints[:, leg : leg + 5] = np.stack([hip, knee, reached, heel + shift, toe + shift], axis=1)
    return joints


def _offset(x: float, y: float, z: float, stature: float) -> FloatArray:
    return stature * np.array([x, y, z])


def _turned(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """(T, 3, 3) rotations: roll about z (left side up), then pitch about x (bow), then yaw about y (to the left)."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(angle), np.sin(angle)) for angle in (yaw, pitch, roll))
    one, nil = np.ones_like(cy), np.zeros_like(cy)
    about_y = np.stack([cy, nil, sy, nil, one, nil, -sy, nil, cy], axis=-1).reshape(-1, 3, 3)
    about_x = np.stack([one, nil, nil, nil, cp, -sp, nil, sp, cp], axis=-1).reshape(-1, 3, 3)
    about_z = np.stack([cr, -sr, nil, sr, cr, nil, nil, nil, one], axis=-1).reshape(-1, 3, 3)
    return about_y @ about_x @ about_z


def _head(chest: FloatArray, turn: FloatArray, stature: float) -> FloatArray:
    """(T, 2, 3) left and right of the head from the torso; it turns about the spine, which keeps its distance."""
    still = np.zeros_like(turn)
    sides = np.array([[SHARES["half head"], SHARES["head"] - SHARES["waist"], 0.02]] * 2) * stature
    sides[1, 0] *= -1
    return np.einsum("tab,jb->tja", chest @ _turned(turn, still, still), sides)


def _arm(chest: FloatArray, angles: FloatArray, side: int, stature: float) -> FloatArray:
    """(T, 4, 3) shoulder, elbow, wrist and hand from the torso; `side` is 1 on the left, -1 on the right."""
    lift, front, plane, elbow, wrist = angles.T
    nil = np.zeros_like(lift)
    upper = np.stack([side * np.sin(lift) * np.cos(front), -np.cos(lift), np.sin(lift) * np.sin(front)], axis=-1)
    outward = np.stack([side * np.cos(lift) * np.cos(front), np.sin(lift), np.cos(lift) * np.sin(front)], axis=-1)
    forward = np.stack([-side * np.sin(front), nil, np.cos(front)], axis=-1)
    across = np.cos(plane)[:, None] * forward + np.sin(plane)[:, None] * outward
    lower, hand = (np.cos(bend)[:, None] * upper + np.sin(bend)[:, None] * across for bend in (elbow, elbow + wrist))
    shoulder = np.broadcast_to(
        _offset(side * SHARES["half shoulders"], SHARES["shoulder"] - SHARES["waist"], 0, stature), upper.shape
    )
    # The left hand is marked at its middle, the right one at a finger.
    tip = SHARES["hand"] if side == 1 else SHARES["finger"]
    lengths = np.array([SHARES["upper arm"], SHARES["forearm"], tip])[:, None, None] * stature
    chain = np.cumsum([shoulder, *(lengths * [upper, lower, hand])], axis=0)
    return np.einsum("tab,jtb->tja", chest, chain)


def _foot(foothold: FloatArray, lift: FloatArray, stature: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(T, 3) ankle, heel and toe of a foot that turns about its toe when the heel rises."""
    x, z, yaw, pitch = foothold.T
    still = np.zeros_like(yaw)
    frame = _turned(yaw, still, still)
    ball = np.stack([x, lift, z], axis=-1) + frame @ _offset(0, 0, SHARES["toe"], stature)
    raised = _turned(yaw, pitch, still)
    ankle = raised @ _offset(0, SHARES["ankle"], -SHARES["toe"], stature)
    heel = raised @ _offset(0, 0, -SHARES["toe"] - SHARES["heel"], stature)
    return ball + ankle, ball + heel, ball


def _torso(poses: FloatArray, hips: list[FloatArray], ankles: list[FloatArray], stature: float) -> FloatArray:
    """(T, 3) the waist: as high as the pose wants, but never higher than both legs reach (a soft minimum)."""
    x, z = poses[:, ROOT].T
    heights = [waist_height(stature) + poses[:, RISE]]
    leg = REACH * (SHARES["thigh"] + SHARES["shank"]) * stature
    for hip, ankle in zip(hips, ankles, strict=True):
        away = np.hypot(x + hip[:, 0] - ankle[:, 0], z + hip[:, 2] - ankle[:, 2])
        heights.append(ankle[:, 1] - hip[:, 1] + np.sqrt(np.maximum(leg**2 - away**2, 0)))
    height = -SOFTNESS * np.logaddexp.reduce(-np.array(heights) / SOFTNESS, axis=0)
    return np.stack([x, height, z], axis=-1)


def _leg(hip: FloatArray, ankle: FloatArray, facing: ArrayLike, stature: float) -> tuple[FloatArray, FloatArray]:
    """(T, 3) knee and ankle of a leg between hip and ankle; the knee bends towards `facing` (radians, yaw)."""
    ahead = np.stack([np.sin(facing), np.zeros(len(hip)), np.cos(facing)], axis=-1)
    return two_bones(hip, ankle, SHARES["thigh"] * stature, SHARES["shank"] * stature, ahead)
