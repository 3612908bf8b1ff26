"""Step 4: hands that are palm up or palm down, and fingers that point where they do in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.io.player_points import FINGERS, PHALANGES
from harmolab.kinematics import smooth
from harmolab.rotations import directions, normal_part
from harmolab.systems.audio2body.avatar.arms import forward_offset
from harmolab.systems.audio2body.avatar.params import HAND, AvatarParams
from harmolab.systems.audio2body.avatar.place import PlacedPoints
from harmolab.systems.audio2body.avatar.spine import FRONT, SIGNS
from harmolab.types import BoolArray, FloatArray

REST_CURL, CURL_SHARE = 0.2, 0.4  # radians of each further joint, and share of the root's bend added to it
LONGEST = 99.0  # percentile of a length in the picture that is its length


@dataclass(frozen=True, eq=False)
class HandAxes:
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
    along = _out_of_picture(middle, (HAND["index"][0] + HAND["little"][0]) / 2, params)
    across = index - little
    width = max(float(np.percentile(np.linalg.norm(across, axis=1), LONGEST)), 1e-6)
    is_down = palm_is_down(-SIGNS[side] * across[:, 0] / width, params.dead_band)
    sign = np.where(is_down, -SIGNS[side], SIGNS[side])
    sideways = sign * np.maximum(np.abs(across[:, 0]), params.dead_band * width)
    thumbwards = normal_part(np.column_stack([sideways, across[:, 1], np.zeros_like(sideways)]), along)
    return HandAxes(along, thumbwards, SIGNS[side] * np.cross(along, thumbwards))


def _out_of_picture(vectors: FloatArray, least: float, params: AvatarParams) -> FloatArray:
    """(T, 3) unit vectors along picture vectors (T, 2), tilted to the camera by how short they look."""
    length = np.linalg.norm(vectors, axis=1)
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
        pointing = _finger_direction(chord, 0.9 * sum(bones), placed.fps, params)
        places = [wrist + forward * axes.along + aside * axes.thumbwards]
        for bone, direction in zip(bones, _bent(pointing, axes.palm, bones), strict=True):
            places.append(places[-1] + bone * direction)
        joints |= dict(zip(names, places, strict=True))
    return joints


def _finger_direction(chord: FloatArray, least: float, fps: float, params: AvatarParams) -> FloatArray:
    """(T, 3) unit vectors from root to tip: the picture's angle at once, the depth from the smoothed length."""
    length = smooth(np.linalg.norm(chord, axis=1), params.smoothing, fps)
    longest = max(float(np.percentile(length, LONGEST)), least)
    return directions(np.column_stack([chord, forward_offset(length, longest, params.depth)]), FRONT)


def _bent(pointing: FloatArray, palm: FloatArray, bones: tuple[float, ...]) -> list[FloatArray]:
    """Directions (T, 3) of a finger's bones, each bent further to the palm, whose end lies along `pointing`."""
    inwards = normal_part(palm, pointing)
    bend = np.arcsin(np.clip((pointing * palm).sum(axis=1, keepdims=True), -1.0, 1.0))
    angles = [number * (REST_CURL + CURL_SHARE * np.maximum(bend, 0.0)) for number in range(len(bones))]
    up, ahead = (
        sum(bone * turn(angle) for bone, angle in zip(bones, angles, strict=True)) for turn in (np.sin, np.cos)
    )
    start = np.arctan2(up, ahead)
    return [np.cos(angle - start) * pointing + np.sin(angle - start) * inwards for angle in angles]
