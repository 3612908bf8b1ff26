"""The planted violinist: the bow turns at each onset, its angle is the string, the left hand follows the pitch.

The picture is 640 x 480 pixels, not mirrored: the player faces the camera, the violin on the left shoulder at large x.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from harmolab.corpora.synthetic.players.gestures import bent_hand, glide, joined, point
from harmolab.corpora.synthetic.players.notes import PlantedPiece
from harmolab.corpora.synthetic.players.sound import VIBRATO_RATE, vibrato_phases
from harmolab.io.player_points import FINGERS, SIDES
from harmolab.types import FloatArray, IntArray, Notes

OPEN_STRINGS = np.array([55, 62, 69, 76])
NECK = np.array([0.99, 0.12])  # direction from the chin to the scroll
BELOW_NECK = np.array([-0.12, 0.99])
NUT = np.array([525.0, 160.0])
BRIDGE = np.array([421.0, 147.5])
STRING = 105.0  # pixels from the bridge to the nut
HAND_SHARE = 0.8  # of the way along the string that the hand goes; the finger reaches the rest
SHIFT = 0.12  # seconds of a shift of the left hand, at most
CROSSING = 0.12  # seconds in which the bow goes over to another string, at most
BOW = np.array([-0.53, 0.848])  # direction from the bridge to the bow hand
BELOW_BOW = np.array([0.848, 0.53])
FROG, BOW_LENGTH = 20.0, 215.0  # pixels from the bridge to the bow hand at place 0, and further to place 1
BOW_ENDS = (0.05, 0.85)
STROKE = 0.6  # bow lengths of a note of one second at loudness 1
STROKE_POWER = 0.8
START, APPROACH = 0.25, 0.4  # place of the bow at the first onset, and seconds before it in which it comes there
STRING_ANGLES = np.tan(np.radians([-11.0, -3.5, 4.0, 11.5]))  # G to E; positive is a lower bow hand
VIBRATO = 1.5  # pixels of the stopping fingertip along the neck
PRESS = 5.0  # pixels from a finger above the string to the string
BODY = MappingProxyType(
    {
        "left_shoulder": (350.0, 160.0),
        "right_shoulder": (200.0, 170.0),
        "left_hip": (318.0, 398.0),
        "right_hip": (228.0, 402.0),
    }
)
# (2,) points at which an elbow is for two places of its hand; in between in proportion.
RIGHT_ELBOW = ((262.0, 240.0), (142.0, 292.0))  # bow at place 0, at place 1
LEFT_ELBOW = ((432.0, 260.0), (412.0, 260.0))  # stop at the nut, at the middle of the string
ELBOW_SHIFT = 60.0  # pixels right and down by which the right elbow moves for a string angle whose tangent is 1
# The left hand's points from where its index finger is on the string: along the neck, and below it.
LEFT_HAND = np.array(
    [
        (-16, 42),
        (-4, 33), (4, 23), (8, 12), (9, 2),
        (8, 17), (14, 4), (9, -5), (0, -5),
        (0, 18), (5, 4), (-1, -6), (-9, -5),
        (-8, 20), (-5, 6), (-11, -5), (-18, -5),
        (-15, 24), (-15, 12), (-20, 1), (-26, -5),
    ],
    dtype=float,
)  # fmt: skip
STOPS = -LEFT_HAND[[8, 12, 16, 20], 0]  # pixels from the index finger to each stopping finger, towards the bridge
# The right hand's points from the tip of its thumb, which holds the bow.
BOW_HAND = np.array(
    [
        (-57, -15),
        (-39, -15), (-22, -11), (-9, -6), (0, 0),
        (-11, -19), (7, -10), (10, 2), (8, 10),
        (-14, -15), (0, 3), (4, 16), (2, 26),
        (-19, -7), (-7, 12), (-4, 23), (-4, 32),
        (-27, 1), (-16, 16), (-14, 26), (-12, 34),
    ],
    dtype=float,
)  # fmt: skip


def violinist_points(
    piece: PlantedPiece, times: FloatArray, sway: FloatArray, place: FloatArray, *, seed: int
) -> FloatArray:
    """(T, 50, 2) points of a violinist who plays a piece, in pixels before the camera.

    Parameters
    ----------
    piece : PlantedPiece of one voice
    times : (T,) array, seconds
    sway : (T,) array, pixels to the right by which the player, with the violin, is out of place
    place : (T,) array, of the bow hand: 0 plays at the frog, 1 at the tip; as `bow_place` has it
    seed : int, of the vibrato
    """
    notes = piece.notes
    tilt = glide(times, notes.onsets, STRING_ANGLES[string_numbers(notes.pitches)], CROSSING)
    stop = glide(times, notes.onsets, stop_distance(notes.pitches), SHIFT)
    hands = {"left": _left_hand(notes, times, stop, seed), "right": _bow_hand(place, tilt)}
    body = {name: np.broadcast_to(rest, (times.size, 2)) for name, rest in BODY.items()}
    body["right_elbow"] = _between(RIGHT_ELBOW, place) + point(ELBOW_SHIFT * tilt, ELBOW_SHIFT * tilt)
    body["left_elbow"] = _between(LEFT_ELBOW, 2 * stop / STRING)
    swaying = point(sway, 0.0)
    return joined(
        {name: at + swaying for name, at in body.items()}, {side: hands[side] + swaying[:, None] for side in SIDES}
    )


def string_numbers(pitches: IntArray) -> IntArray:
    """(N,) string of each pitch, 0 the G string, 3 the E string: the highest that is not above it."""
    return np.searchsorted(OPEN_STRINGS, pitches, side="right") - 1


def stop_distance(pitches: IntArray) -> FloatArray:
    """(N,) pixels along the string from the nut to where a pitch is stopped; 0 for an open string."""
    semitones = pitches - OPEN_STRINGS[string_numbers(pitches)]
    return np.asarray(STRING * (1 - 2.0 ** (-semitones / 12)))


def bow_turns(piece: PlantedPiece) -> FloatArray:
    """(N,) place of the bow at each onset, where it turns, and (1,) at the end of the last note.

    Down-bows (towards the tip) and up-bows alternate, and a bar begins with a down-bow. A stroke is as long as loudness
    x duration^0.8 says, but for the ends of the bow.
    """
    notes = piece.notes
    lengths = STROKE * notes.loudness * np.diff(notes.onsets, append=notes.offsets[-1]) ** STROKE_POWER
    places = np.full(lengths.size + 1, START)
    for number, length in enumerate(lengths):
        places[number + 1] = np.clip(places[number] + (-1) ** number * length, *BOW_ENDS)
    return places


def bow_place(piece: PlantedPiece, times: FloatArray) -> FloatArray:
    """(T,) place of the bow hand over time: linear between the turns of `bow_turns`, at rest after the last note."""
    notes, turns = piece.notes, bow_turns(piece)
    moments = np.concatenate([[notes.onsets[0] - APPROACH], notes.onsets, notes.offsets[-1:]])
    return np.interp(times, moments, np.concatenate([[BOW_ENDS[1] / 2], turns]))


def _bow_hand(place: FloatArray, tilt: FloatArray) -> FloatArray:
    """(T, 21, 2) the right hand; a string crossing moves it across the bow only, so that turns stay on the onsets."""
    distance = (FROG + BOW_LENGTH * place)[:, None]
    grip = BRIDGE + distance * (BOW + tilt[:, None] * BELOW_BOW)
    return grip[:, None] + BOW_HAND


def _left_hand(notes: Notes, times: FloatArray, stop: FloatArray, seed: int) -> FloatArray:
    """(T, 21, 2) the left hand; the finger nearest to the stop presses and reaches it."""
    distances = stop_distance(notes.pitches)
    reaches = (1 - HAND_SHARE) * distances[:, None] - STOPS
    fingers = np.abs(reaches).argmin(axis=1)
    pressing = np.zeros((len(notes), len(FINGERS)))
    pressing[np.arange(len(notes)), fingers + 1] = distances > 0
    reach = np.take_along_axis(reaches, fingers[:, None], axis=1)
    down, along = (glide(times, notes.onsets, values, CROSSING) for values in (pressing, pressing * reach))
    tips = point(-along - _vibrato(notes, times, seed)[:, None] * down, PRESS * down)
    hand = bent_hand(LEFT_HAND, tips) - point(HAND_SHARE * stop, 0.0)[:, None]
    return NUT + hand @ np.stack([NECK, BELOW_NECK])


def _vibrato(notes: Notes, times: FloatArray, seed: int) -> FloatArray:
    """(T,) pixels towards the bridge by which the stopping finger rolls: the sound is highest when it is nearest."""
    number = np.maximum(np.searchsorted(notes.onsets, times, side="right") - 1, 0)
    phases = vibrato_phases(len(notes), seed)[number]
    return np.asarray(VIBRATO * np.cos(2 * np.pi * VIBRATO_RATE * (times - notes.onsets[number]) + phases))


def _between(ends: tuple[tuple[float, float], tuple[float, float]], share: FloatArray) -> FloatArray:
    """(T, 2) points on the way between two."""
    first, last = np.array(ends)
    return np.asarray(first + share[:, None] * (last - first))
