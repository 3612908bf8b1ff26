"""Faults of trackers, planted in the points of a player in short bursts, each kind by its name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from harmolab.io.player_points import PLAYER_50, SIDES, hand_joints
from harmolab.types import BoolArray, FloatArray

FAULTS = ("swapped hands", "other person", "missing hand", "jump")
LONGEST_BURST = 6  # frames
GAPS = (12, 51)  # frames from one burst to the next: bursts are 3.5 frames long on average, 10 % of all frames
PERSON_DISTANCE = (180.0, 260.0)  # pixels to the left or right at which another person is
PERSON_SIZE = (0.6, 0.85)  # of the player's
JUMP = (50.0, 110.0)  # pixels
HANDS = [[PLAYER_50.joints.index(name) for name in hand_joints(side)] for side in SIDES]


@dataclass(frozen=True, eq=False)
class FaultyPoints:
    """Points with faults.

    Parameters
    ----------
    points : (T, 50, 2) array
    detected : (T, 50) mask, False where a hand is missing; its points stay where they were last
    fault : (T,) array of str, one of `FAULTS`, or "" for a good frame
    """

    points: FloatArray
    detected: BoolArray
    fault: np.ndarray


def with_faults(points: FloatArray, rng: np.random.Generator) -> FaultyPoints:
    """Points of a player with faults in a tenth of the frames, in bursts of one to six frames.

    Parameters
    ----------
    points : (T, 50, 2) array, pixels
    rng : np.random.Generator
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
    return FaultyPoints(faulty, detected, fault)


def without_faults(points: FloatArray) -> FaultyPoints:
    """The same points, all detected and good."""
    return FaultyPoints(points, np.ones(points.shape[:2], bool), np.full(len(points), ""))


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
