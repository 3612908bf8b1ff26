"""The bow of a violinist: its place taken out of the points that a network learns, and put back by its strokes.

Where the bow is depends on up or down, of which the sound says little; learnt with the squared error both are averaged,
and the bow stands still.

So its place is taken out of the points before the network learns them; in its stead the network says where the bow
turns. A stroke is as long as its loudness and duration say. Strokes alternate, and over a whole recording the louder
notes tell which are down-bows. Ours, not the paper's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.signal import find_peaks

from harmolab.body.kinematics import refine_extrema
from harmolab.body.skeletons import Skeleton
from harmolab.musician.events import bow_turns
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PlayedSequence
from harmolab.readers.player_points import hand_joints
from harmolab.types import BoolArray, FloatArray, IntArray, Motion, SingleArray

LATENESS = 0.1  # seconds after a turn at which the network says so: an attack is known by what follows it
WIDTH = 0.03  # seconds, standard deviation of the bump that marks a turn
PEAK = 3.0  # height of that bump: the turns vary about as much as the first component, and count as much in the loss
HEIGHT, APART = 0.2, 0.12  # of a predicted turn: least share of that height, seconds to the next one
ENDS = (1.0, 99.0)  # percentiles of the bow hand's way that count as the ends of the bow
AT_END = 0.08  # of the bow: strokes that stop so near to its ends may have been cut short
SHORTEST = 0.03  # of the bow: shorter strokes say nothing
ALTERNATION = 0.98  # probability that the stroke after a turn goes the other way: else one was overlooked
LEAK = 0.01  # share of its way back to the mean that the bow goes at each turn, so that wrong lengths do not add up
AROUND = 2  # strokes before and after that one is held against
REPEATS = 3.0  # by which evidence is divided: strokes held against each other say the same several times
QUIET = -7.0  # log mean energy below which nothing sounds: 30 dB below the recording's mean
LEAST_STROKES = 10
RIDGE = 1e-3


class Strokes(NamedTuple):
    """Strokes of a bow.

    Parameters
    ----------
    turns : (K + 1,) array, seconds, from the beginning of the first to the end of the last
    signs : (K,) array of int, 1 for a down-bow, towards the tip, -1 for an up-bow
    lengths : (K,) array, bow lengths
    """

    turns: FloatArray
    signs: IntArray
    lengths: FloatArray


@dataclass(frozen=True, eq=False)
class Bowing:
    """The bow as it was learnt from training recordings. Places are from 0 (frog) to 1 (tip).

    Parameters
    ----------
    reading : (2 P,) array, by which points are multiplied to have the place, less `levels[0]`
    effect : (2 P,) array, pixels by which points move from place 0 to 1
    levels : (3,) array: place of points that are all 0; mean place; place at the first turn
    law : (3,) array: the log of a stroke's length is `law` times (1, log seconds, loudness)
    evidence : (4 `AROUND` + 1,) array: the log odds of a down-bow are `evidence` times `stroke_contrasts`
    """

    reading: FloatArray
    effect: FloatArray
    levels: FloatArray
    law: FloatArray
    evidence: FloatArray

    @classmethod
    def empty(cls, points: int) -> Self:
        """One of so many points that nothing was learnt for."""
        still = np.zeros(2 * points)
        return cls(still, still, np.zeros(3), np.zeros(3), np.zeros(4 * AROUND + 1))

    @classmethod
    def fit(cls, sequences: Sequence[PlayedSequence], skeleton: Skeleton, params: Audio2BodyParams) -> Self:
        """The bow of training sequences, from the frames that are learnt.

        ValueError if the points lack the left shoulder or the right hand, or fewer than ten strokes are long enough.
        """
        frames = np.concatenate([each.points[each.learnt] for each in sequences])
        reading, offset = _place_reading(frames, skeleton)
        places = frames @ reading + offset
        centred = places - places.mean()
        effect = centred @ frames / max(float(centred @ centred), RIDGE)
        ways = [each.points @ reading + offset for each in sequences]
        turns = [_tracked_turns(each, skeleton, params.fps) for each in sequences]
        at_turns = [place_at(way, each, params.fps) for way, each in zip(ways, turns, strict=True)]
        loud = [loudness(each.sound, params) for each in sequences]
        sounds = [stroke_sounds(own, level, params.fps) for own, level in zip(turns, loud, strict=True)]
        shifts = np.concatenate([np.diff(each) for each in at_turns])
        ends = np.concatenate([each[1:] for each in at_turns])
        long = np.abs(shifts) > SHORTEST
        free = long & (np.minimum(ends, 1 - ends) > AT_END)
        if (count := free.sum()) < LEAST_STROKES:
            raise ValueError(f"a bow is learnt from {LEAST_STROKES} strokes or more; these recordings have {count}")
        law = np.linalg.lstsq(_law_terms(np.concatenate(sounds))[free], np.log(np.abs(shifts[free])), rcond=None)[0]
        contrasts = np.concatenate([stroke_contrasts(each) for each in sounds])
        start = float(np.mean([each[0] for each in at_turns if each.size]))
        levels = np.array([offset, places.mean(), start])
        return cls(reading, effect, levels, law, discriminant(contrasts[long], shifts[long] > 0))

    def place(self, points: FloatArray) -> FloatArray:
        """(T,) place of the bow in points (T, 2 P)."""
        places: FloatArray = points @ self.reading + self.levels[0]
        return places

    def at_place(self, points: FloatArray, place: FloatArray | float) -> FloatArray:
        """Points (T, 2 P) whose bow is at the mean place, as they are with the bow at `place` (T,)."""
        moved = np.broadcast_to(np.asarray(place) - self.levels[1], len(points))
        return points + moved[:, None] * self.effect

    def at_rest(self, points: FloatArray) -> FloatArray:
        """Points (T, 2 P) as they are with the bow at the mean place: all but what depends on its direction."""
        return points - (self.place(points) - self.levels[1])[:, None] * self.effect

    def strokes(self, turns: FloatArray, loud: FloatArray, fps: float) -> Strokes:
        """The strokes between turns (seconds), and after the last one as long as it sounds.

        Parameters
        ----------
        turns : (K,) array, seconds
        loud : (T,) array, `loudness` of each frame
        fps : float, hertz
        """
        sounding = np.flatnonzero(loud > QUIET)
        end = (sounding[-1] + 1) / fps if sounding.size else 0.0
        turns = np.append(turns, max(end, turns[-1] + 1 / fps)) if turns.size else np.zeros(1)
        sounds = stroke_sounds(turns, loud, fps)
        signs = alternating(stroke_contrasts(sounds) @ self.evidence / REPEATS)
        return Strokes(turns, signs, np.minimum(np.exp(_law_terms(sounds) @ self.law), 1.0))

    def places(self, strokes: Strokes, frames: int, fps: float) -> FloatArray:
        """(T,) place over time: strokes one after the other, of even speed, within the bow."""
        at_turns = stroke_ends(strokes.signs * strokes.lengths, start=self.levels[2], mean=self.levels[1])
        return np.asarray(np.interp(np.arange(frames) / fps, strokes.turns, at_turns))


def turn_signal(sequence: PlayedSequence, skeleton: Skeleton, fps: float) -> FloatArray:
    """(T,) curve to learn: a bump of height `PEAK`, `LATENESS` seconds after each turn of the tracked bow."""
    times = np.arange(len(sequence.points))[:, None] / fps - LATENESS
    distances = times - _tracked_turns(sequence, skeleton, fps)
    return PEAK * np.exp(-np.square(distances / WIDTH) / 2).max(axis=1, initial=0.0)


def turns_of(signal: FloatArray, rate: float) -> FloatArray:
    """(K,) seconds of the turns in a predicted `turn_signal` (S,) of so many steps a second."""
    peaks, _ = find_peaks(signal, height=HEIGHT * PEAK, distance=max(1, round(APART * rate)))
    times = refine_extrema(signal, peaks) / rate - LATENESS
    return times[times > 0]


def loudness(sound: SingleArray, params: Audio2BodyParams) -> FloatArray:
    """(T,) log mean energy of each frame of what is heard (T, F); of notes, the log energy of the loudest key."""
    if params.hears == "sound":
        return sound[:, params.mfcc].astype(np.float64)
    return np.asarray(2 * np.log(np.maximum(np.minimum(sound.max(axis=1), 1.0), RIDGE)), np.float64)


def stroke_sounds(turns: FloatArray, loud: FloatArray, fps: float) -> FloatArray:
    """Log seconds and mean loudness of the strokes between turns (K + 1,): (K, 2)."""
    summed = np.interp(turns * fps, np.arange(loud.size + 1), np.concatenate([[0.0], np.cumsum(loud)]))
    seconds = np.maximum(np.diff(turns), RIDGE)
    return np.column_stack([np.log(seconds), np.diff(summed) / (seconds * fps)])


def stroke_contrasts(sounds: FloatArray) -> FloatArray:
    """Strokes (K, 2) less each neighbour of theirs, log seconds and loudness: (K, 4 `AROUND` + 1); the last is 1."""
    if not len(sounds):
        return np.zeros((0, 4 * AROUND + 1))
    numbers = np.arange(len(sounds))
    steps = [step for step in range(-AROUND, AROUND + 1) if step]
    beside = [sounds - sounds[np.clip(numbers + step, 0, len(sounds) - 1)] for step in steps]
    return np.column_stack([*beside, np.ones(len(sounds))])


def discriminant(values: FloatArray, truth: BoolArray) -> FloatArray:
    """Weights (C,) whose product with values (N, C), the last column 1, is the log odds of the truth (N,).

    Linear discriminant analysis: two normal distributions of one covariance, equally frequent. 0 where all are of one
    class.
    """
    if truth.all() or not truth.any():
        return np.zeros(values.shape[1])
    inner = values[:, :-1]
    means = np.stack([inner[truth].mean(axis=0), inner[~truth].mean(axis=0)])
    left = inner - means[np.where(truth, 0, 1)]
    covariance = left.T @ left / len(left) + RIDGE * np.eye(inner.shape[1])
    weights = np.linalg.solve(covariance, means[0] - means[1])
    return np.append(weights, -weights @ means.mean(axis=0))


def alternating(odds: FloatArray, alternation: float = ALTERNATION) -> IntArray:
    """The likeliest directions (K,), 1 or -1, of strokes that mostly alternate, by the log odds of 1 of each.

    Viterbi's algorithm with two states.
    """
    change = np.log([[1 - alternation, alternation], [alternation, 1 - alternation]])
    own = np.column_stack([odds, -odds]) / 2
    total, before = np.zeros(2), np.zeros((len(odds), 2), np.int64)
    for number, values in enumerate(own):
        ways = total[:, None] + (change if number else 0.0)
        before[number] = ways.argmax(axis=0)
        total = ways.max(axis=0) + values
    states = np.zeros(len(odds), np.int64)
    state = int(total.argmax())
    for number in range(len(odds) - 1, -1, -1):
        states[number], state = state, int(before[number, state])
    return 1 - 2 * states


def stroke_ends(shifts: FloatArray, *, start: float, mean: float, leak: float = LEAK) -> FloatArray:
    """(K + 1,) place of the bow at each turn: strokes (K,) added up, within 0 and 1, drawn to the mean a little."""
    places = [start]
    for shift in shifts:
        places.append(min(max(places[-1] + leak * (mean - places[-1]) + float(shift), 0.0), 1.0))
    return np.array(places)


def place_at(way: FloatArray, times: FloatArray, fps: float) -> FloatArray:
    """Places (K,) at some seconds of a way (T,)."""
    return np.asarray(np.interp(times * fps, np.arange(way.size), way))


def _law_terms(sounds: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(sounds)), sounds])


def _place_reading(frames: FloatArray, skeleton: Skeleton) -> tuple[FloatArray, float]:
    """Weights (2 P,) of the points and a number to add: the way of the bow hand beside the left shoulder.

    Its direction is that of most variance, away from the shoulder; its ends are percentiles.
    """
    joints = skeleton.joints
    hand = [joints.index(name) for name in (*hand_joints("right"), "right_wrist") if name in joints]
    if not hand or "left_shoulder" not in joints:
        raise ValueError("the place of a bow needs the left_shoulder and points of the right hand")
    weights = np.zeros(len(joints))
    weights[hand] = 1 / len(hand)
    weights[joints.index("left_shoulder")] = -1.0
    path = np.tensordot(frames.reshape(len(frames), -1, 2), weights, axes=([1], [0]))
    axis = np.linalg.eigh(np.cov(path, rowvar=False))[1][:, -1]
    axis = axis * (1.0 if path.mean(axis=0) @ axis >= 0 else -1.0)
    low, high = np.percentile(path @ axis, ENDS)
    length = max(float(high - low), RIDGE)
    return np.outer(weights, axis).ravel() / length, -float(low) / length


def _tracked_turns(sequence: PlayedSequence, skeleton: Skeleton, fps: float) -> FloatArray:
    """Turns of the bow of tracked points, seconds; those on lines over rejected frames, too."""
    return bow_turns(Motion(sequence.points.reshape(len(sequence.points), -1, 2), fps, skeleton)).times
