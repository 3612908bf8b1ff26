"""Step 3: arms that reach for the wrists, whose depth follows from how short a bone looks."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import SIDES
from harmolab.kinematics import smooth
from harmolab.rotations import two_bones
from harmolab.skeletons import turned
from harmolab.systems.audio2body.avatar.params import FOREARM, SHOULDERS, UPPER_ARM, AvatarParams
from harmolab.systems.audio2body.avatar.place import PlacedPoints
from harmolab.systems.audio2body.avatar.spine import SIGNS
from harmolab.types import FloatArray

REST_OFFSET = 0.3  # metres that a wrist is before its shoulder where no elbow shows it
UPPER_BY_FOREARM = UPPER_ARM / FOREARM


def forward_offset(length: FloatArray, longest: float, law: str = "root") -> FloatArray:
    """Depth towards the camera of a bone that looks `length` long: sqrt(L^2 - l^2), or linear L - l; 0 from L on.

    A bone of length L = `longest` lies in the plane of the picture, one of length 0 points straight out of it.
    """
    if law == "linear":
        return np.maximum(longest - length, 0.0)
    return np.sqrt(np.maximum(longest**2 - length**2, 0.0))


def seen_length(placed: PlacedPoints, start: str, end: str, smoothing: float) -> FloatArray:
    """(T,) metres between two points in the picture, smoothed by a Gaussian of `smoothing` seconds."""
    return smooth(np.linalg.norm(placed.points[end] - placed.points[start], axis=1), smoothing, placed.fps)


def wrist_name(placed: PlacedPoints, side: str) -> str:
    """The point that an arm reaches for: the wrist as the body has it, else as the hand has it; "" without both."""
    return next((name for name in (f"{side}_wrist", f"{side}_hand") if name in placed.points), "")


def arm_lengths(placed: PlacedPoints, params: AvatarParams) -> tuple[float, float]:
    """(upper arm, forearm), metres: the percentile of the lengths in the picture, of the arm that shows more of it.

    The forearm is no shorter than `least_forearm` of the mean shoulder distance, and the upper arm no shorter than it
    usually is beside such a forearm. Lengths at rest where no arm has an elbow.
    """
    sides = [side for side in SIDES if f"{side}_elbow" in placed.points and wrist_name(placed, side)]
    if not sides:
        return UPPER_ARM, FOREARM
    bones = [
        [
            seen_length(placed, f"{side}_elbow", wrist_name(placed, side), params.smoothing),
            seen_length(placed, f"{side}_shoulder", f"{side}_elbow", params.smoothing),
        ]
        for side in sides
    ]
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
        wrist = wrist_name(placed, side)
        if not wrist:
            continue
        offset = np.full(len(placed.points[wrist]), REST_OFFSET)
        if f"{side}_elbow" in placed.points:
            length = seen_length(placed, f"{side}_elbow", wrist, params.smoothing)
            offset = forward_offset(length, forearm, params.depth)
            if params.elbow_depth:
                length = seen_length(placed, f"{side}_shoulder", f"{side}_elbow", params.smoothing)
                offset = offset + forward_offset(length, upper, params.depth)
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
