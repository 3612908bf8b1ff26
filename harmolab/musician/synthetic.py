"""A pianist and a violinist in the plane, planted on the notes of pieces that follow from a seed.

The sound is rendered from the same notes. The truth comes with every performance: the points without noise, the part
of them that follows from the notes, planted faults by name, the camera, and the strikes or turns of the bow.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harmolab.musician import players
from harmolab.musician.performances import Performance
from harmolab.musician.similarities import Similarity
from harmolab.readers.player_points import INSTRUMENTS, PLAYER_50, SIDES, hand_joints
from harmolab.score import check_whole
from harmolab.systems.training.features import check_choice
from harmolab.types import BeatTrack, BoolArray, FloatArray, Motion, Notes

# Faults of trackers, planted in short bursts, each kind by its name

FAULTS = ("swapped hands", "other person", "missing hand", "jump")
LONGEST_BURST = 6  # frames
GAPS = (12, 51)  # frames from one burst to the next: bursts are 3.5 frames long on average, 10 % of all frames
PERSON_DISTANCE = (180.0, 260.0)  # pixels to the left or right at which another person is
PERSON_SIZE = (0.6, 0.85)  # of the player's
JUMP = (50.0, 110.0)  # pixels
HANDS = [[PLAYER_50.joints.index(name) for name in hand_joints(side)] for side in SIDES]


def with_faults(points: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, BoolArray, np.ndarray]:
    """Points of a player with faults in a tenth of the frames, in bursts of one to six frames.

    Parameters
    ----------
    points : (T, 50, 2) array, pixels
    rng : np.random.Generator

    Returns
    -------
    The points; (T, 50) mask, False where a hand is missing, whose points stay where they were last; (T,) array of str,
    one of `FAULTS`, or "" for a good frame.
    """
    faulty, detected = points.copy(), np.ones(points.shape[:2], bool)
    fault = np.full(len(points), "", f"<U{max(map(len, FAULTS))}")
    for first, last, kind in _bursts(len(points), rng):
        burst, hand = slice(first, last), HANDS[rng.integers(2)]
        fault[burst] = kind
        if kind == "swapped hands":
            faulty[burst, HANDS[0] + HANDS[1]] = points[burst, HANDS[1] + HANDS[0]]
        elif kind == "missing hand":
            faulty[burst, hand] = faulty[first - 1, hand]
            detected[burst, hand] = False
        elif kind == "jump":
            angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(*JUMP)
            faulty[burst] += distance * np.array([np.cos(angle), np.sin(angle)])
        else:
            faulty[burst] = _other_person(points, burst, rng)
    return faulty, detected, fault


def _bursts(frames: int, rng: np.random.Generator) -> Iterator[tuple[int, int, str]]:
    """First frame, frame after the last, and kind of each burst; every four bursts hold each kind once."""
    kinds: list[str] = []
    first = int(rng.integers(*GAPS, endpoint=True))
    while first < frames:
        kinds = kinds or [str(kind) for kind in rng.permutation(FAULTS)]
        last = first + int(rng.integers(1, LONGEST_BURST, endpoint=True))
        yield first, min(last, frames), kinds.pop()
        first = last + int(rng.integers(*GAPS, endpoint=True))


def _other_person(points: FloatArray, burst: slice, rng: np.random.Generator) -> FloatArray:
    """(t, 50, 2) a smaller person beside the player, moving as the player did twelve frames before."""
    size, distance = rng.uniform(*PERSON_SIZE), rng.choice([-1.0, 1.0]) * rng.uniform(*PERSON_DISTANCE)
    pose = points[burst.start - GAPS[0] : burst.stop - GAPS[0]]
    centre = pose.mean(axis=(0, 1))
    return np.asarray(centre + (distance, 0.0) + size * (pose - centre))


# The planted performance

PICTURE = (640, 480)  # pixels
# Camera of a performance: largest change of size (share), turn (radians) and shift (pixels) about the picture's centre.
ZOOM, TURN, SHIFT = 0.08, np.radians(3.0), 25.0
# Sway of the torso: amplitudes in pixels of its slow and its quick part, and the ranges of their periods in seconds.
SWAY = {"piano": (8.0, 4.0), "violin": (3.0, 1.5)}
SWAY_PERIODS = ((7.0, 13.0), (3.0, 5.0))
# Lowest and highest value of each setting, and the rule in words.
RANGES = {
    "seconds": (2.0, 3600.0, "must be within 2 and 3600"),
    "noise": (0.0, 100.0, "is in pixels and must be within 0 and 100"),
    "fps": (5.0, 1000.0, "must be within 5 and 1000 frames per second (24 is usual)"),
    "sample_rate": (8000, 192000, "must be within 8000 and 192000 Hz"),
}


@dataclass(frozen=True, eq=False)
class PlantedPerformance:
    """A performance and what was planted in it; all points are in the picture, (T, 50, 2) pixels, as `PLAYER_50`.

    Parameters
    ----------
    performance : Performance
        Its motion has noise and faults; its notes are those that the sound was rendered from.
    clean : points without noise and faults
    from_audio : `clean` without the sway, which is not in the music: the best that sound can tell
    direction_blind : of a violinist, `from_audio` with the bow at its mean place: all but the direction of the bow,
        which is not in the sound; None for a pianist
    fault : (T,) array of str, one of `FAULTS`, or "" for a good frame
    camera : Similarity from the player's own picture to this one
    strikes : BeatTrack of the moments that the movement marks: strikes of the fingers, or turns of the bow
    downbeats : (D,) array, seconds
    bow : (T,) array, place of the bow from 0, the frog, to 1, the tip; it rises in a down-bow; None for a pianist
    """

    performance: Performance
    clean: FloatArray
    from_audio: FloatArray
    direction_blind: FloatArray | None
    fault: np.ndarray
    camera: Similarity
    strikes: BeatTrack
    downbeats: FloatArray
    bow: FloatArray | None

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


def planted_performance(
    instrument: str,
    *,
    seconds: float = 30.0,
    seed: int = 1,
    faults: bool = True,
    noise: float = 1.0,
    fps: float = 24.0,
    sample_rate: int = 44100,
) -> PlantedPerformance:
    """A pianist or a violinist who plays a piece of its own, with sound, points, notes and the truth about them.

    A longer performance of the same seed begins alike: the same points up to a second before the
    end of the shorter one, and the same sound but for its level.

    Parameters
    ----------
    instrument : "piano" or "violin"
    seconds : float, 2 to 3600
    seed : int; sets notes, sway, camera, noise and faults. Each seed has another piece
    faults : bool, plant `FAULTS` in a tenth of the frames
    noise : float, pixels, standard deviation of white noise on every coordinate
    fps : float, frames per second
    sample_rate : int, hertz

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.

    Examples
    --------
    >>> planted = planted_performance("violin", seconds=4.0, seed=7, sample_rate=8000)
    >>> planted.performance.motion.positions.shape, planted.performance.source
    ((96, 50, 2), 'synthetic')
    """
    _check(instrument, seed, seconds=seconds, noise=noise, fps=fps, sample_rate=sample_rate)
    piece, times = players.planted_piece(instrument, seconds, seed), np.arange(round(seconds * fps)) / fps
    bow = players.bow_place(piece, times) if instrument == "violin" else None
    camera = _camera(_stream(instrument, seed, 1))

    def pictured(sway: FloatArray, place: FloatArray | None) -> FloatArray:
        if place is None:
            return camera.apply(players.pianist_points(piece, times, sway))
        return camera.apply(players.violinist_points(piece, times, sway, place, seed=seed))

    clean, still = pictured(_sway(instrument, times, _stream(instrument, seed, 2)), bow), np.zeros(times.size)
    tracked = clean + noise * _stream(instrument, seed, 3).standard_normal(clean.shape)
    detected, fault = np.ones(clean.shape[:2], bool), np.full(times.size, "")
    if faults:
        tracked, detected, fault = with_faults(tracked, _stream(instrument, seed, 4))
    audio = players.rendered_notes(piece.notes, seconds, sample_rate, instrument=instrument, seed=seed)
    name, motion = f"planted {instrument} {seed}", Motion(tracked, fps, PLAYER_50)
    performance = Performance(name, instrument, audio, motion, detected, piece.notes, 0.0, name, True, "synthetic")
    from_audio, blind = pictured(still, bow), None if bow is None else pictured(still, np.full_like(bow, bow.mean()))
    strikes = _strikes(piece.notes, fps, seconds)
    return PlantedPerformance(performance, clean, from_audio, blind, fault, camera, strikes, piece.downbeats, bow)


def planted_performances(
    instrument: str, count: int, *, seed: int = 1, **settings: Any
) -> Iterator[PlantedPerformance]:
    """Planted performances one after the other, with the seeds `seed`, `seed` + 1 and so on, each of another piece.

    Parameters
    ----------
    instrument : "piano" or "violin"
    count : int
    seed : int, of the first
    **settings : seconds, faults, noise, fps and sample_rate, as in `planted_performance`
    """
    return (planted_performance(instrument, seed=seed + number, **settings) for number in range(count))


def _check(instrument: str, seed: int, **numbers: float) -> None:
    """ValueError that names the setting which is out of range."""
    check_choice("instrument", instrument, INSTRUMENTS)
    check_whole(seed=seed)
    for name, value in numbers.items():
        low, high, rule = RANGES[name]
        if not low <= value <= high:
            raise ValueError(f"{name} {rule}, got {value}")


def _stream(instrument: str, seed: int, purpose: int) -> np.random.Generator:
    """Chance for one purpose, so that one setting does not move what another draws."""
    return np.random.default_rng([seed, INSTRUMENTS.index(instrument), purpose])


def _camera(rng: np.random.Generator) -> Similarity:
    """A camera that stands a little different for each performance."""
    centre = np.array(PICTURE) / 2
    turned = Similarity(1 + rng.uniform(-ZOOM, ZOOM), rng.uniform(-TURN, TURN), np.zeros(2))
    return replace(turned, shift=centre + rng.uniform(-SHIFT, SHIFT, 2) - turned.apply(centre))


def _sway(instrument: str, times: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(T,) pixels to the right by which the torso is out of its place."""
    periods = [rng.uniform(*limits) for limits in SWAY_PERIODS]
    phases = rng.uniform(0, 2 * np.pi, 2)
    return np.asarray(np.sin(2 * np.pi * times[:, None] / periods + phases) @ np.array(SWAY[instrument]))


def _strikes(notes: Notes, fps: float, seconds: float) -> BeatTrack:
    """The onsets, each with its greatest loudness; both hands may strike at once."""
    times, numbers = np.unique(notes.onsets, return_inverse=True)
    loudness = np.zeros(times.size)
    np.maximum.at(loudness, numbers, notes.loudness)
    return BeatTrack(times, loudness, fps, seconds)
