"""The planted pianist: both wrists follow the keys, a finger is down at each onset, the torso sways.

The picture is 640 x 480 pixels, as in a mirror: the left hand, on the low keys, stands at small x.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from harmolab.corpora.synthetic.players.gestures import bent_hand, glide, joined, point, pulses
from harmolab.corpora.synthetic.players.notes import PlantedPiece
from harmolab.io.player_points import FINGERS, SIDES
from harmolab.types import FloatArray, IntArray, Notes

WHITE_KEY = 10.0  # pixels
KEYBOARD_LEFT = 60.0  # pixels, left edge of the lowest key, MIDI 21
KEYS = np.array([0, 0.5, 1, 1.5, 2, 3, 3.5, 4, 4.5, 5, 5.5, 6])  # of an octave from C, in white keys
SPAN = 2 * WHITE_KEY  # pixels from the middle finger that a hand plays without moving
LEAP = 0.22  # seconds that a wrist takes to a new place, at most
STRIKE = 0.09  # seconds that a finger goes down, and up again
STRIKE_DEPTHS = (4.0, 12.0)  # pixels at loudness 0 and 1
WRIST_SHARE = 0.35  # of a strike's depth
WRIST_Y = 312.0
NOD = 3.0  # pixels, once in two beats
ARM = 122.0  # pixels, of the upper arm and of the forearm
SHOULDERS = MappingProxyType({"left": (232.0, 96.0), "right": (376.0, 96.0)})
HIPS = MappingProxyType({"left": (260.0, 290.0), "right": (348.0, 290.0)})
HIP_SWAY = 0.3  # share of the sway of the shoulders
# The right hand's points from its wrist: x away from the thumb is positive, y towards the fingertips.
HAND = np.array(
    [
        (0, 0),
        (-13, 9), (-19, 18), (-21, 28), (-20, 38),
        (-11, 30), (-12, 40), (-11, 49), (-10, 56),
        (-3, 32), (-2, 43), (-1, 53), (0, 60),
        (6, 31), (8, 41), (9, 50), (10, 57),
        (13, 27), (17, 35), (19, 42), (20, 48),
    ],
    dtype=float,
)  # fmt: skip
TIPS = HAND[[4, 8, 12, 16, 20], 0]
MIRRORED = MappingProxyType({"left": -1.0, "right": 1.0})


def key_x(pitches: IntArray) -> FloatArray:
    """Pixel column of the middle of each key; white keys are 10 pixels wide, a black one lies between two."""
    octaves, notes = np.divmod(pitches, 12)
    lowest = 7 * (21 // 12) + KEYS[21 % 12]
    return np.asarray(KEYBOARD_LEFT + WHITE_KEY * (7 * octaves + KEYS[notes] - lowest + 0.5))


def pianist_points(piece: PlantedPiece, times: FloatArray, sway: FloatArray) -> FloatArray:
    """(T, 50, 2) points of a pianist who plays a piece, in pixels before the camera.

    Parameters
    ----------
    piece : PlantedPiece with notes for both hands
    times : (T,) array, seconds, equally spaced
    sway : (T,) array, pixels to the right by which the shoulders are out of their place; the hands stay on the keys
    """
    hands = {side: _hand(piece.notes.select(piece.notes.hands == i), times, side) for i, side in enumerate(SIDES)}
    nod = NOD * (0.5 - 0.5 * np.cos(np.pi * (times - piece.downbeats[0]) / piece.beat))
    body = {}
    for side in SIDES:
        shoulder = SHOULDERS[side] + point(sway, nod)
        body[f"{side}_shoulder"] = shoulder
        body[f"{side}_elbow"] = _elbow(shoulder, hands[side][:, 0], MIRRORED[side])
        body[f"{side}_hip"] = HIPS[side] + point(HIP_SWAY * sway, 0.0)
    return joined(body, hands)


def hand_places(keys: FloatArray, mirrored: float) -> tuple[FloatArray, IntArray]:
    """Wrist and finger for each key of a voice.

    The hand moves only to a key that is more than two white keys from its middle finger, and puts that finger on it;
    else the nearest finger plays.

    Parameters
    ----------
    keys : (N,) array, pixel column of each key
    mirrored : float, -1 for the left hand, 1 for the right

    Returns
    -------
    (N,) pixel column of the wrist at each onset, and (N,) finger, 0 the thumb.
    """
    places, place = np.empty(keys.size), keys[0]
    for number, key in enumerate(keys):
        place = key if abs(key - place) > SPAN else place
        places[number] = place
    return places, np.abs(places[:, None] + mirrored * TIPS - keys[:, None]).argmin(axis=1)


def strike_depth(loudness: FloatArray) -> FloatArray:
    """Pixels that a fingertip goes down at an onset."""
    low, high = STRIKE_DEPTHS
    return low + (high - low) * loudness


def _hand(notes: Notes, times: FloatArray, side: str) -> FloatArray:
    """(T, 21, 2) a hand that plays one voice."""
    keys, mirrored = key_x(notes.pitches), MIRRORED[side]
    places, fingers = hand_places(keys, mirrored)
    depths, sideways = strike_depth(notes.loudness), keys - places - mirrored * TIPS[fingers]
    moves = [
        pulses(times, notes.onsets, fingers, heights, n_channels=len(FINGERS), radius=STRIKE)
        for heights in (sideways, (1 - WRIST_SHARE) * depths, WRIST_SHARE * depths)
    ]
    wrist = point(glide(times, notes.onsets, places, LEAP), WRIST_Y + moves[2].sum(axis=1))
    return wrist[:, None] + bent_hand(HAND * (mirrored, 1.0), point(moves[0], moves[1]))


def _elbow(shoulder: FloatArray, wrist: FloatArray, outward: float) -> FloatArray:
    """(T, 2) elbow of an arm whose two parts are equally long, on the outer side."""
    along = wrist - shoulder
    reach = np.linalg.norm(along, axis=-1, keepdims=True)
    bulge = np.sqrt(np.maximum(ARM**2 - (reach / 2) ** 2, (0.15 * ARM) ** 2))
    across = outward * along[:, ::-1] * (1.0, -1.0) / reach
    return shoulder + along / 2 + bulge * across
