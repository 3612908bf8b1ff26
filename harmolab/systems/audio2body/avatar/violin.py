"""Step 6: the violin and its bow, held by four constraints: two points that are fixed, two that look at another."""

from __future__ import annotations

import numpy as np

from harmolab.io.player_points import VIOLIN
from harmolab.rotations import directions
from harmolab.systems.audio2body.avatar.hands import HandAxes
from harmolab.systems.audio2body.avatar.spine import trunk_axes
from harmolab.types import FloatArray

CHIN = np.array([0.05, -0.09, 0.07])  # metres from the head: to its left, up, ahead
BRIDGE, NECK, SCROLL, BOW = 0.19, 0.33, 0.59, 0.74  # metres from the chin rest, and of the bow
FROG = (0.07, 0.02)  # metres from the wrist along the hand, and out of the palm
REST_AIM = np.array([0.7, 0.0, 0.714])  # to the left and ahead, as the violin is held


def violin_position(trunk: dict[str, FloatArray]) -> FloatArray:
    """First constraint: the violin is at a point fixed to the head, (T, 3)."""
    left, up, ahead = trunk_axes(trunk)
    return trunk["head"] + CHIN[0] * left + CHIN[1] * up + CHIN[2] * ahead


def aim(origin: FloatArray, target: FloatArray, rest: FloatArray) -> FloatArray:
    """Second and fourth constraint: unit vectors (T, 3) that look from `origin` at `target`.

    `rest`, a unit vector (3,), where both coincide.
    """
    return directions(target - origin, rest)


def bow_position(wrist: FloatArray, axes: HandAxes | None) -> FloatArray:
    """Third constraint: the bow is at a point fixed to the right hand, (T, 3); at the wrist without fingers."""
    if axes is None:
        return wrist
    return wrist + FROG[0] * axes.along + FROG[1] * axes.palm


def left_hand_point(joints: dict[str, FloatArray]) -> FloatArray | None:
    """(T, 3) what the violin looks at: the root of the left index finger, else the left wrist; None without either."""
    return next((joints[name] for name in ("left_index_1", "left_wrist") if name in joints), None)


def violin(trunk: dict[str, FloatArray], joints: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Chin rest, bridge, beginning of the neck, and scroll, (T, 3); without a left hand to the left and ahead."""
    chin, hand = violin_position(trunk), left_hand_point(joints)
    rest = REST_AIM / np.linalg.norm(REST_AIM)
    pointing = np.broadcast_to(rest, chin.shape) if hand is None else aim(chin, hand, rest)
    places = [chin + distance * pointing for distance in (0.0, BRIDGE, NECK, SCROLL)]
    return dict(zip(VIOLIN, places, strict=True))


def bow(wrist: FloatArray, axes: HandAxes | None, bridge: FloatArray) -> dict[str, FloatArray]:
    """Frog and tip of the bow in the right hand, name -> (T, 3)."""
    frog = bow_position(wrist, axes)
    pointing = aim(frog, bridge, np.array([1.0, 0.0, 0.0]))
    return {"bow_frog": frog, "bow_tip": frog + BOW * pointing}
