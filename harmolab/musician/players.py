"""Planted players: pieces that follow from a seed, their sound, and the points of a pianist and of a violinist.

A piece has two voices for a pianist, one for a violinist.

The planted pianist: both wrists follow the keys, a finger is down at each onset, the torso sways. The picture is 640 x
480 pixels, as in a mirror: the left hand, on the low keys, stands at small x.

The planted violinist: the bow turns at each onset, its angle is the string, the left hand follows the pitch. The
picture is not mirrored: the player faces the camera, the violin on the left shoulder at large x.
"""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from harmolab.data.synthetic.music import Mixer, tone
from harmolab.data.synthetic.music import Voice as SoundVoice
from harmolab.readers import player_points
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, PHALANGES, PLAYER_50, SIDES, hand_joints
from harmolab.systems.training.features import check_choice
from harmolab.types import Audio, FloatArray, IntArray, Notes

TEMPI = (66.0, 112.0)  # beats per minute
METER = 4
SWELL_BEATS = 16  # beats of one swell of the loudness
REST = 0.5  # seconds without an onset at either end of a piece
MODES = ((0, 2, 4, 5, 7, 9, 11), (0, 2, 3, 5, 7, 8, 11), (0, 2, 3, 5, 7, 9, 10))  # major, harmonic minor, Dorian
STEPS = np.arange(-5, 6)  # of a melody, in degrees of its scale
STEP_CHANCES = np.array([0.02, 0.04, 0.07, 0.15, 0.2, 0.04, 0.2, 0.15, 0.07, 0.04, 0.02])
RETURN = 0.78  # share of its way from the middle of the range that a melody keeps from note to note

Rhythms = tuple[tuple[float, ...], ...]


class Voice(NamedTuple):
    """One line of a piece.

    Parameters
    ----------
    lowest, highest : int, MIDI numbers between which it moves
    rhythms : lengths of notes in beats, one group after another drawn from these; all groups are equally long
    legato : float, share of its time that a note sounds
    accent : float, loudness of a downbeat over that of the other beats
    hand : int, as in `Notes.hands`
    """

    lowest: int
    highest: int
    rhythms: Rhythms
    legato: float
    accent: float
    hand: int


RIGHT_RHYTHMS: Rhythms = (
    (1.0,), (0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (0.25, 0.25, 0.5), (0.5, 0.25, 0.25), (0.25, 0.25, 0.25, 0.25),
)  # fmt: skip
LEFT_RHYTHMS: Rhythms = ((2.0,), (1.0, 1.0), (1.0, 1.0), (0.5, 0.5, 0.5, 0.5), (1.5, 0.5))
# An even number of notes in each bar: bows alternate, and so every bar begins with a down-bow.
BOWED: Rhythms = (
    (2.0, 2.0), (1.0, 1.0, 1.0, 1.0), (1.5, 0.5, 1.0, 1.0), (2.0, 1.0, 0.5, 0.5), (1.0, 0.5, 0.5, 2.0),
    (1.0, 1.0, 0.5, 0.5, 0.5, 0.5), (0.5, 0.5, 0.5, 0.5, 1.0, 1.0), (0.5, 0.5, 1.0, 1.0, 0.5, 0.5),
    (0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5),
)  # fmt: skip
VOICES = {
    "piano": (Voice(36, 60, LEFT_RHYTHMS, 0.9, 1.1, hand=0), Voice(62, 88, RIGHT_RHYTHMS, 0.9, 1.1, hand=1)),
    "violin": (Voice(55, 90, BOWED, 1.0, 1.25, hand=-1),),
}


class PlantedPiece(NamedTuple):
    """The notes of a piece, the beginnings of its bars (seconds) and the length of its beat (seconds)."""

    notes: Notes
    downbeats: FloatArray
    beat: float


def planted_piece(instrument: str, seconds: float, seed: int) -> PlantedPiece:
    """A piece in four, of one tempo; its loudness swells over 16 beats.

    Parameters
    ----------
    instrument : "piano" (left hand MIDI 36 to 60, right hand 62 to 88) or "violin" (55 to 90)
    seconds : float; the first onset is at 0.5 s, and the last one 0.5 s or more before the end
    seed : int; a longer piece of the same seed begins with the same notes

    Raises
    ------
    ValueError
        For another instrument, or less than a second.
    """
    check_choice("instrument", instrument, INSTRUMENTS)
    if not 2 * REST <= seconds < np.inf:
        raise ValueError(f"a piece begins and ends with {REST} s of rest, so it lasts at least 1 s, got {seconds} s")
    rng = np.random.default_rng([seed, INSTRUMENTS.index(instrument)])
    beat = 60 / rng.uniform(*TEMPI)
    scale = (np.array(MODES[rng.integers(len(MODES))]) + rng.integers(12)) % 12
    swell = rng.uniform(0, 2 * np.pi)
    last = (seconds - 2 * REST) / beat + 1e-9  # beats from the first onset to the last one possible
    lines = []
    for voice in VOICES[instrument]:
        starts, lengths = _rhythm(voice, last, rng.spawn(1)[0])
        onsets, offsets = REST + beat * starts, REST + beat * (starts + voice.legato * lengths)
        pitches = _melody(voice, scale, starts.size, rng.spawn(1)[0])
        loudness = _loudness(voice, starts, swell, rng.spawn(1)[0])
        lines.append((onsets, np.minimum(offsets, seconds), pitches, loudness, np.full(starts.size, voice.hand)))
    columns = [np.concatenate(parts) for parts in zip(*lines, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return PlantedPiece(Notes(*(column[order] for column in columns)), REST + beat * np.arange(0, last, METER), beat)


def _rhythm(voice: Voice, last: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(N,) starts and lengths of the notes that begin up to beat `last`, in beats."""
    groups = int(last // sum(voice.rhythms[0])) + 1
    lengths = np.concatenate([voice.rhythms[number] for number in rng.integers(len(voice.rhythms), size=groups)])
    starts = np.cumsum(lengths) - lengths
    return starts[starts <= last], lengths[starts <= last]


def _melody(voice: Voice, scale: IntArray, count: int, rng: np.random.Generator) -> IntArray:
    """(N,) pitches of a walk on a scale; it is drawn to the middle of the voice's range and turns back at its ends."""
    ladder = np.arange(voice.lowest, voice.highest + 1)
    ladder = ladder[np.isin(ladder % 12, scale)]
    steps = rng.choice(STEPS, size=count, p=STEP_CHANCES)
    walk = np.rint(ladder.size / 2 + lfilter([1.0], [1.0, -RETURN], steps)).astype(np.int64)
    round_trip = walk % (2 * (ladder.size - 1))
    return ladder[np.minimum(round_trip, 2 * (ladder.size - 1) - round_trip)]


def _loudness(voice: Voice, starts: FloatArray, swell: float, rng: np.random.Generator) -> FloatArray:
    """(N,) loudness: a slow swell, louder downbeats, and 4 % of chance."""
    accents = np.where(starts % METER < 1e-6, voice.accent, 1.0)
    swelling = 0.55 + 0.22 * np.sin(2 * np.pi * starts / SWELL_BEATS + swell)
    return np.asarray(swelling * accents * rng.uniform(0.96, 1.04, starts.size)).clip(0, 1)


# The sound of notes: a plucked timbre for the piano, a bowed one for the violin

LONGEST = 6.0  # seconds after which a note has ended
VIBRATO_RATE = 5.5  # hertz
VIBRATO_DEPTH = 0.01  # share of the pitch: 17 cents
TIMBRES = {
    "piano": SoundVoice((1.0, 0.55, 0.35, 0.2, 0.12, 0.08, 0.05), 1.4, 0.004, 0.2, 1.0),
    "violin": SoundVoice((1.0, 0.8, 0.6, 0.55, 0.35, 0.25, 0.2, 0.15, 0.1, 0.08), 30.0, 0.06, 0.2, 1.0),
}


def rendered_notes(
    notes: Notes, seconds: float, sample_rate: int = 44100, *, instrument: str = "piano", seed: int = 0
) -> Audio:
    """The sound of notes, played on a synthetic instrument.

    Parameters
    ----------
    notes : Notes; those that begin after the end are silent
    seconds : float, length of the sound, at most 3600
    sample_rate : int, hertz, from 8000 to 192000
    instrument : "piano" (dies away) or "violin" (lasts, with vibrato)
    seed : int, of the phases of the vibrato

    Returns
    -------
    Audio, peak 0.9; the amplitude of a note is in proportion to its loudness. No notes are silence.

    Raises
    ------
    ValueError
        For an instrument, length or rate out of range.
    """
    check_choice("instrument", instrument, INSTRUMENTS)
    if not (8000 <= sample_rate <= 192000 and float(sample_rate).is_integer()):
        raise ValueError(f"sample_rate must be a whole number from 8000 to 192000 Hz, got {sample_rate}")
    if not 1 / sample_rate <= seconds <= 3600:
        raise ValueError(f"seconds must be positive and at most 3600, got {seconds}")
    mixer, timbre = Mixer(seconds, int(sample_rate)), TIMBRES[instrument]
    lengths = (notes.offsets - notes.onsets).clip(2 / mixer.rate, LONGEST)
    phases = vibrato_phases(len(notes), seed) if instrument == "violin" else None
    for pitch in np.unique(notes.pitches):
        numbers = np.flatnonzero(notes.pitches == pitch)
        sound = _tone(int(pitch), float(lengths[numbers].max()), mixer.rate, timbre)
        for number in numbers:
            note = sound if phases is None else _with_vibrato(sound, lengths[number], phases[number], mixer.rate)
            gain = timbre.level * notes.loudness[number]
            mixer.add_note(notes.onsets[number], note, lengths[number], gain, attack=timbre.attack)
    return Audio(mixer.mixed().astype(np.float32), sample_rate)


def vibrato_phases(count: int, seed: int) -> FloatArray:
    """(N,) phase of the vibrato at each onset, radians."""
    return np.random.default_rng([seed, 7]).uniform(0, 2 * np.pi, count)


def _tone(pitch: int, seconds: float, rate: int, timbre: SoundVoice) -> FloatArray:
    """A note of a MIDI pitch; low ones last longer."""
    decay = timbre.decay * 2 ** ((60 - pitch) / 24)
    return tone(440 * 2 ** ((pitch - 69) / 12), seconds, rate, partials=timbre.partials, decay=decay)


def _with_vibrato(sound: FloatArray, seconds: float, phase: float, rate: int) -> FloatArray:
    """The first `seconds` of a note, read at a speed that swings about 1."""
    samples = np.arange(min(round(seconds * rate), sound.size))
    swing = VIBRATO_DEPTH * rate / (2 * np.pi * VIBRATO_RATE)  # samples
    swung = samples + swing * np.sin(2 * np.pi * VIBRATO_RATE * samples / rate + phase)
    return np.interp(swung, np.arange(sound.size), sound)


# Movement on planted moments: glides to onsets, pulses at them, and the points put together

# Share of a fingertip's movement that the points of its finger take part in, from the root to the tip.
BENDING = np.array([0.0, 0.35, 0.7, 1.0])


def glide(times: FloatArray, onsets: FloatArray, values: FloatArray, longest: float) -> FloatArray:
    """(T, ...) values over time: each is reached at its onset, by a raised cosine, and kept until the next glide.

    Parameters
    ----------
    times : (T,) array, seconds
    onsets : (N,) array, seconds, increasing
    values : (N, ...) array
    longest : float, seconds; a glide lasts so long, or the time since the onset before if that is less
    """
    following = np.searchsorted(onsets, times)
    after, before = np.minimum(following, onsets.size - 1), np.maximum(following - 1, 0)
    lasting = np.minimum(np.diff(onsets, prepend=-np.inf), longest)
    progress = (1 - (onsets[after] - times) / lasting[after]).clip(0, 1)
    share = (0.5 - 0.5 * np.cos(np.pi * progress)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[before] + share * (values[after] - values[before]))


def pulses(
    times: FloatArray, onsets: FloatArray, channels: IntArray, heights: FloatArray, *, n_channels: int, radius: float
) -> FloatArray:
    """(T, C) sums of raised-cosine pulses, one for each onset in its channel, which peak at the onset.

    Parameters
    ----------
    times : (T,) array, seconds, equally spaced
    onsets, channels, heights : (N,) arrays
    n_channels : int, C
    radius : float, seconds from the start of a pulse to its peak, and from there to its end
    """
    step = times[1] - times[0]
    around = np.arange(-np.ceil(radius / step), np.ceil(radius / step) + 1)
    frames = (np.round(onsets[:, None] / step) + around).astype(np.int64)
    distance = np.abs(frames * step - onsets[:, None])
    shapes = np.where(distance < radius, 0.5 + 0.5 * np.cos(np.pi * distance / radius), 0.0)
    inside = (frames >= 0) & (frames < times.size)
    track = np.zeros((times.size, n_channels))
    columns = np.broadcast_to(channels[:, None], frames.shape)
    np.add.at(track, (frames[inside], columns[inside]), (heights[:, None] * shapes)[inside])
    return track


def bent_hand(template: FloatArray, tips: FloatArray) -> FloatArray:
    """(T, 21, 2) a hand whose fingertips are moved, with the points between them and the roots.

    Parameters
    ----------
    template : (21, 2) array, the hand at rest
    tips : (T, 5, 2) array, movement of each fingertip, thumb first
    """
    bends = (tips[:, :, None, :] * BENDING[:, None]).reshape(len(tips), len(FINGERS) * PHALANGES, 2)
    return template + np.concatenate([np.zeros((len(tips), 1, 2)), bends], axis=1)


def joined(body: dict[str, FloatArray], hands: dict[str, FloatArray]) -> FloatArray:
    """(T, 50, 2) the points of a player, in the order of `PLAYER_50`.

    Parameters
    ----------
    body : (T, 2) arrays by the names of `BODY` without the wrists, which are those of the hands
    hands : (T, 21, 2) arrays by side
    """
    points = {name: body[name] for name in player_points.BODY if not name.endswith("wrist")}
    for side in SIDES:
        points |= dict(zip(hand_joints(side), np.moveaxis(hands[side], 1, 0), strict=True))
        points[f"{side}_wrist"] = points[f"{side}_hand"]
    return np.stack([points[name] for name in PLAYER_50.joints], axis=1)


def point(x: FloatArray | float, y: FloatArray | float) -> FloatArray:
    """(..., 2) points from their coordinates."""
    return np.stack(np.broadcast_arrays(x, y), axis=-1)


# The planted pianist

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
SHOULDERS = {"left": (232.0, 96.0), "right": (376.0, 96.0)}
HIPS = {"left": (260.0, 290.0), "right": (348.0, 290.0)}
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
MIRRORED = {"left": -1.0, "right": 1.0}


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


# The planted violinist

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
BODY = {
    "left_shoulder": (350.0, 160.0),
    "right_shoulder": (200.0, 170.0),
    "left_hip": (318.0, 398.0),
    "right_hip": (228.0, 402.0),
}
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
    swaying_hands = {side: hands[side] + swaying[:, None] for side in SIDES}
    return joined({name: at + swaying for name, at in body.items()}, swaying_hands)


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
