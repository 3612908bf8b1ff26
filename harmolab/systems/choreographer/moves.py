"""Recorded beats as moves that can be danced: their costs, how far apart they are, and where in the bar they stand.

*Costs* say how much a seam, another tempo, a beat out of place and a repetition weigh. A motion without beats has a
*pulse*: its own rests, picked so that they come about as often as a song's beats.

A *node* is one beat of one recording, [k, k + 1). Its borders are the beats k and k + 1. Around every border and every
middle of a beat lies a *cloud*: the joints at some moments from half a beat before to half a beat after. The distance
of two clouds is what is left after the best turn about the vertical and the best shift on the floor:

``D^2 = sum w |a|^2 + sum w |b|^2 - 2 |sum w a conj(b)| + sum w (height of a - height of b)^2``

with a, b = x + i z of the joints, less their weighted mean, and weights w that sum to 1. The angle of the cross term is
the turn. All pairs are one product of complex matrices.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, make_interp_spline
from scipy.ndimage import binary_opening

from harmolab.beats.meter import cycle_of_meter
from harmolab.body.kinematics import peak_frames
from harmolab.body.skeletons import HIPS, Skeleton, foot_joints, heading
from harmolab.params import BarPattern, check_kinds
from harmolab.shape_speed import ShapeSignal, shape_signal, shape_speed
from harmolab.significance import ranks
from harmolab.systems.choreographer.takes import Take
from harmolab.types import BoolArray, FloatArray, IntArray, SingleArray
from harmolab.verdict import bar_pattern

# Costs of a seam, another tempo, a beat out of place and a repetition

# Costs of a choice that is to be avoided, in centimetres of seam. Never infinite: a small corpus must still dance.
TOO_SHORT, TOO_LONG = 60.0, 80.0
USUAL_METER = 4  # beats in a bar where none is known


@dataclass(frozen=True)
class ChoreographerParams:
    """Settings of the choreographer: the costs by which it picks recorded beats, in centimetres.

    A cost of 3 weighs as much as 3 cm more in a seam, where the dance goes over from one recording to another. Of all
    rows of recorded beats the cheapest is danced.

    Parameters
    ----------
    seam : float
        Cost of any seam, beside its size D.
    wide, wider : float
        Size (centimetres) from which a seam may show, and the cost of each further centimetre, beside the size itself.
    energy : float
        Cost of a beat whose speed, as a rank, is the farthest from the one that is aimed at.
    tempo : float
        Cost for |log(interval of the music / interval of the recorded beat)|, divided by the beats in a bar.
    harmony : float
        Cost of a beat that fits the bar pattern of its dance worst.
    variety : float
        Cost of a beat that looks like the one just danced, divided by the beats in a bar.
    alike : float, centimetres
        At this distance two beats look alike by 1 / e.
    forgetting : float, beats
        After so many a repetition costs 1 / e of what it costs at once.
    winding : float
        Cost in each beat for each turn that the dancer has turned to one side more than to the other.
    noise : float
        Weight of the seed: each recorded beat costs less by .3 times this, times a random number (Gumbel).
    longest_run : int, beats
        Most beats that are taken from one recording in a row.
    unplaced_run : int, beats
        Fewest beats of a run where bars are unknown; else it is one bar.
    twin : float, centimetres
        A seam below this is none: it goes to the same figure in another recording.
    edge : float
        Cost of a seam that reaches beyond the end of a recording, or into frames that are filler.
    foot_weight : float
        Weight of ankles, heels and toes in a seam; other joints weigh 1.
    samples : int
        Moments that are compared in the beat around a seam.
    dense, nearest : int
        Up to `dense` recorded beats all distances are kept; of more, those to the `nearest` only.
    paths : int
        Rows of beats that are followed from beat to beat: so many of the best.

    Raises
    ------
    ValueError
        For a value out of range or of another kind; the message names the field.
    """

    seam: float = 3.0
    wide: float = 12.0
    wider: float = 3.0
    energy: float = 12.0
    tempo: float = 40.0
    harmony: float = 6.0
    variety: float = 30.0
    alike: float = 6.0
    forgetting: float = 400.0
    winding: float = 2.0
    noise: float = 4.0
    longest_run: int = 8
    unplaced_run: int = 4
    twin: float = 1.5
    edge: float = 15.0
    foot_weight: float = 2.0
    samples: int = 7
    dense: int = 3000
    nearest: int = 200
    paths: int = 500

    def __post_init__(self) -> None:
        check_kinds(self)
        for field in fields(self):
            value, is_count = getattr(self, field.name), field.type is int
            if not int(is_count) <= value < 1e9:
                raise ValueError(f"{field.name} must be {'1' if is_count else 'zero'} or more, got {value}")
        if min(self.alike, self.forgetting, self.foot_weight) == 0:
            raise ValueError("alike, forgetting and foot_weight must be positive")


# The pulse of a motion without beats

STEP = 0.1  # seconds between moments that may be taken where no rest is near
SHORTEST, LONGEST = 0.6, 1.6  # of the song's beat
STRETCH = 20.0  # standard deviations of rest that a squared logarithm of 1 costs


def rest(signal: ShapeSignal, period: float) -> FloatArray:
    """Rest of a body at each sample (T,), beside half a `period` (seconds) before and after, in SDs of itself.

    The fit of the speed of its shape to one turn of a cosine: least at the moment, most half a beat to either side.
    """
    if signal.times.size < 2 or not signal.values.any():
        return np.zeros(signal.times.size)
    step = float(signal.times[1] - signal.times[0])
    half = max(1, round(period / 2 / step))
    fit = -bar_pattern.harmonic_fits(np.pad(signal.values, half, mode="edge"), 1, 1, moments=2 * half)[0, half:-half]
    return fit / max(float(fit.std()), 1e-12)


def pulse(signal: ShapeSignal, period: float) -> FloatArray:
    """The beats (B,), seconds, that rest most and lie nearest to `period` seconds apart; empty if there are not two.

    Dynamic programming over the rests and over moments every tenth of a second: a beat is worth its `rest`, less
    `STRETCH` times the squared logarithm of its distance from the beat before over the period; that distance lies
    between .6 and 1.6 periods. The signal is the one that our score reads: that a dance made of these beats scores well
    says that the cut is good, not that the dancer heard any music.
    """
    depth = rest(signal, period)
    if depth.size < 2:
        return np.zeros(0)
    every = max(1, round(STEP / float(signal.times[1] - signal.times[0])))
    frames = np.union1d(peak_frames(depth), np.arange(0, depth.size, every))
    moments, worth = signal.times[frames], depth[frames]
    before = np.full(moments.size, -1)
    first = np.searchsorted(moments, moments - LONGEST * period)
    last = np.searchsorted(moments, moments - SHORTEST * period, side="right")
    for number in np.flatnonzero(last > first).tolist():
        earlier = slice(first[number], last[number])
        gain = worth[earlier] - STRETCH * np.log((moments[number] - moments[earlier]) / period) ** 2
        best = int(gain.argmax())
        worth[number] += gain[best]
        before[number] = first[number] + best
    at_end = moments >= moments[-1] - LONGEST * period
    beats = [int(np.where(at_end, worth, -np.inf).argmax())]
    while before[beats[-1]] >= 0:
        beats.append(int(before[beats[-1]]))
    return moments[beats[::-1]] if len(beats) > 1 else np.zeros(0)


# Beats as nodes, the distances of their clouds, and bar patterns

Complex64 = NDArray[np.complex64]

CENTIMETRES = 100.0  # in a metre
BLOCK = 2**22  # distances computed at a time: 32 MB
UNKNOWN_SHARE = 0.5  # rank of a beat of which no pattern is known
GAP, MOSTLY = 1.0, 0.5  # seconds of filler in a row that are no movement, and share of a beat in them that counts


class Course:
    """A take as a function of its beat number: 2.5 is half way between its third and its fourth beat.

    Positions are a cubic spline; between beats time runs by a monotone cubic (PCHIP), before the first and after the
    last as fast as in the beat interval there. Before its first frame and after its last the dancer stands still.
    """

    def __init__(self, take: Take, beats: FloatArray) -> None:
        self.take, self.beats = take, beats
        positions = take.motion.positions.reshape(take.motion.n_frames, -1)
        times = np.arange(len(positions)) / take.motion.fps
        self._spline = make_interp_spline(times, positions, k=min(3, len(positions) - 1))
        self._clock = PchipInterpolator(np.arange(beats.size), beats) if beats.size > 2 else None

    def seconds(self, numbers: FloatArray) -> FloatArray:
        """Time in the take, of any beat number; it may lie outside of the take."""
        last = self.beats.size - 1
        inside = np.clip(numbers, 0, last)
        times = np.interp(inside, [0, last], self.beats[[0, -1]]) if self._clock is None else self._clock(inside)
        before, after = np.minimum(numbers, 0), np.maximum(numbers - last, 0)
        first, final = self.beats[1] - self.beats[0], self.beats[-1] - self.beats[-2]
        return np.asarray(times + before * first + after * final)

    def positions(self, numbers: FloatArray) -> FloatArray:
        """Joints (..., J, 3) at beat numbers (...)."""
        times = np.clip(self.seconds(numbers), 0.0, self.take.seconds)
        return np.asarray(self._spline(times)).reshape(*np.shape(numbers), -1, 3)

    def speeds(self) -> FloatArray:
        """Speed of the body's shape in each beat (B - 1,), mean, metres a second."""
        shape = shape_speed(self.take.motion)
        way = np.interp(self.beats, shape.times, np.cumsum(shape.speed) / shape.fps)
        return np.asarray(np.diff(way) / np.diff(self.beats))

    def gaps(self) -> BoolArray:
        """True for each beat (B - 1,) that lies mostly in a gap: filler for a second or more."""
        motion = self.take.motion
        is_gap = binary_opening(~motion.valid, np.ones(max(1, round(GAP * motion.fps)), bool))
        frames = np.interp(self.beats * motion.fps, np.arange(is_gap.size + 1), np.insert(np.cumsum(is_gap), 0, 0))
        return np.asarray(np.diff(frames) > MOSTLY * np.diff(self.beats) * motion.fps)

    def turns(self) -> FloatArray:
        """Turn of the hips in each beat (B - 1,), in whole turns to the left; 0 where no joint is named a hip."""
        motion = self.take.motion
        angles = heading(motion.positions, motion.fps, motion.skeleton, parts=HIPS)
        return np.asarray(np.diff(np.interp(self.beats, np.arange(angles.size) / motion.fps, angles))) / (2 * np.pi)


class Clouds(NamedTuple):
    """N clouds of K points: places on the floor as x + i z, heights (metres), both times root weight; the N middles."""

    floor: Complex64
    heights: SingleArray
    middles: NDArray[np.complex128]


def joint_weights(skeleton: Skeleton, foot_weight: float) -> FloatArray:
    """(J,) weights of the joints in a cloud, with sum 1; feet weigh more."""
    weights = np.ones(len(skeleton.joints))
    with suppress(ValueError):  # no joint is called a foot
        weights[[joint for foot in foot_joints(skeleton) for joint in foot]] = foot_weight
    return weights / weights.sum()


def around(params: ChoreographerParams) -> FloatArray:
    """The moments of a cloud, beats from its middle."""
    return np.linspace(-0.5, 0.5, params.samples) if params.samples > 1 else np.zeros(1)


def clouds_of(positions: FloatArray, weights: FloatArray) -> Clouds:
    """The clouds of joints (N, S, J, 3), metres; `weights` (J,) sum to 1."""
    weight = np.broadcast_to(weights / positions.shape[1], positions.shape[1:3]).ravel()
    floor = (positions[..., 0] + 1j * positions[..., 2]).reshape(len(positions), -1)
    middles, root = floor @ weight, np.sqrt(weight)
    heights = (positions[..., 1].reshape(len(positions), -1) * root).astype(np.float32)
    return Clouds(((floor - middles[:, None]) * root).astype(np.complex64), heights, middles)


def distances(one: Clouds, other: Clouds) -> SingleArray:
    """Distance D of every cloud of `one` to every one of `other`, (N, M) centimetres."""
    level = other.heights.mean(axis=0) if len(other.heights) else 0.0  # single precision does not like large heights
    own, others = one.heights - level, other.heights - level
    cross = np.abs(one.floor @ other.floor.conj().T)
    cross += own @ others.T
    square = _squares(one.floor, own)[:, None] + _squares(other.floor, others) - 2 * cross
    return np.sqrt(np.maximum(square, 0, out=square), out=square) * np.float32(CENTIMETRES)


def _squares(floor: Complex64, heights: SingleArray) -> SingleArray:
    return (floor.real**2 + floor.imag**2 + heights**2).sum(axis=1)


class Distances:
    """Distances of all clouds to all; of many clouds those to the nearest alone, and all others are far."""

    def __init__(self, clouds: Clouds, params: ChoreographerParams) -> None:
        size = len(clouds.floor)
        self.is_dense = size <= params.dense
        self._size = size
        if self.is_dense:
            self._matrix = distances(clouds, clouds)
            return
        count = min(params.nearest, size)
        self._nearest, self._matrix = np.empty((size, count), np.int32), np.empty((size, count), np.float32)
        for first in range(0, size, step := max(1, BLOCK // size)):
            rows = slice(first, first + step)
            block = distances(Clouds(clouds.floor[rows], clouds.heights[rows], clouds.middles[rows]), clouds)
            near = np.argpartition(block, count - 1, axis=1)[:, :count]
            self._nearest[rows], self._matrix[rows] = near, np.take_along_axis(block, near, axis=1)

    def rows(self, numbers: IntArray) -> SingleArray:
        """Distances (P, N) of the clouds of those numbers to all, centimetres."""
        if self.is_dense:
            return self._matrix[numbers]
        rows = np.full((numbers.size, self._size), TOO_LONG, np.float32)
        np.put_along_axis(rows, self._nearest[numbers], self._matrix[numbers], axis=1)
        return rows

    def pairs(self, one: IntArray, other: IntArray) -> SingleArray:
        """Distance (P,) of each cloud of `one` to that of `other` at the same place."""
        if self.is_dense:
            return self._matrix[one, other]
        near = self._nearest[one] == other[:, None]
        return np.where(near, self._matrix[one], np.float32(TOO_LONG)).min(axis=1)


@dataclass(frozen=True, eq=False)
class Moves:
    """The nodes of a corpus: N beats of recordings, and all that is known of each before any song is heard.

    Parameters
    ----------
    courses : the recordings
    course, beat : (N,) arrays, each node's recording and beat in it
    start : (N,) array, its first border; its last is the next one
    following : (N,) array, the node that was danced next, -1 at the end of a recording
    places, meters : (N,) arrays, place in the bar (-1 unknown) and beats in a bar (0 unknown)
    lengths : (N,) array, seconds
    shares : (N,) array in (0, 1), rank of the beat among all moments of its recording, by the pattern of its dance
    ranks : (N,) array in (0, 1), rank of the speed of the body's shape among all nodes
    turns : (N,) array, turns of the hips to the left
    gaps : (N,) mask, beats that are mostly filler
    edges : borders at which a seam reaches beyond a recording or into filler, bool
    seams, alike : Distances between borders, and between middles of beats
    weights : (J,) array, of the joints in a cloud
    """

    courses: tuple[Course, ...]
    course: IntArray
    beat: IntArray
    start: IntArray
    following: IntArray
    places: IntArray
    meters: IntArray
    lengths: FloatArray
    shares: FloatArray
    ranks: FloatArray
    turns: FloatArray
    gaps: BoolArray
    edges: BoolArray
    seams: Distances
    alike: Distances
    weights: FloatArray

    def __len__(self) -> int:
        return self.beat.size

    @property
    def meter(self) -> int:
        """Beats in a bar of most nodes whose place is known; 0 where none is."""
        meters = self.meters[self.places >= 0]
        return int(np.bincount(meters).argmax()) if meters.size else 0

    def seam_rows(self, nodes: IntArray, params: ChoreographerParams) -> tuple[SingleArray, SingleArray]:
        """Distance (P, N) between the end of each of `nodes` and the start of any, and what a seam there costs."""
        ends = self.start[nodes] + 1
        distance = self.seams.rows(ends)[:, self.start]
        at_edge = self.edges[ends][:, None] | self.edges[self.start]
        cost = distance + (np.float32(params.seam) + at_edge * np.float32(params.edge))
        return distance, cost + np.float32(params.wider) * np.maximum(distance - np.float32(params.wide), 0)


def moves_of(courses: Sequence[Course], params: ChoreographerParams, shares: Sequence[FloatArray] = ()) -> Moves:
    """The nodes of recordings that have two beats or more; `shares` (a number a beat) are .5 where left out."""
    counts = np.array([course.beats.size - 1 for course in courses])
    course = np.repeat(np.arange(len(courses)), counts)
    beat = np.concatenate([np.arange(count) for count in counts])
    last = beat == counts[course] - 1
    weights = joint_weights(courses[0].take.motion.skeleton, params.foot_weight)
    if not shares:
        shares = [np.full(one.beats.size, UNKNOWN_SHARE) for one in courses]
    borders = [np.arange(one.beats.size, dtype=np.float64) for one in courses]
    return Moves(
        courses=tuple(courses),
        course=course,
        beat=beat,
        start=np.arange(beat.size) + course,
        following=np.where(last, -1, np.arange(1, beat.size + 1)),
        places=np.concatenate([one.take.places_of(one.beats.size)[:-1] for one in courses]),
        meters=np.array([one.take.meter for one in courses])[course],
        lengths=np.concatenate([np.diff(one.beats) for one in courses]),
        shares=np.concatenate([one[:-1] for one in shares]),
        ranks=(ranks(np.concatenate([one.speeds() for one in courses])) - 0.5) / beat.size,
        turns=np.concatenate([one.turns() for one in courses]),
        gaps=np.concatenate([one.gaps() for one in courses]),
        edges=np.concatenate([_edges(one) for one in courses]),
        seams=Distances(_clouds(courses, borders, weights, params), params),
        alike=Distances(_clouds(courses, [one[:-1] + 0.5 for one in borders], weights, params), params),
        weights=weights,
    )


def _clouds(
    courses: Sequence[Course], middles: Sequence[FloatArray], weights: FloatArray, params: ChoreographerParams
) -> Clouds:
    """The clouds around beat numbers of each recording, one recording after the other."""
    pairs, moments = zip(courses, middles, strict=True), around(params)
    clouds = [clouds_of(course.positions(numbers[:, None] + moments), weights) for course, numbers in pairs]
    return Clouds(*map(np.concatenate, zip(*clouds, strict=True)))


def _edges(course: Course) -> BoolArray:
    """The borders (B,) whose cloud reaches beyond the recording, or into frames that are filler."""
    numbers = np.arange(course.beats.size, dtype=np.float64)
    first, last = course.seconds(numbers - 0.5), course.seconds(numbers + 0.5)
    motion = course.take.motion
    filler = np.concatenate([[0], np.cumsum(~motion.valid)])
    frames = [np.clip(np.round(times * motion.fps), 0, motion.n_frames - 1).astype(np.int64) for times in (first, last)]
    tolerance = 0.5 / motion.fps
    outside = (first < -tolerance) | (last > course.take.seconds + tolerance)
    return np.asarray(outside | (filler[frames[1] + 1] > filler[frames[0]]))


def bar_patterns(
    takes: Sequence[Take], signals: Sequence[ShapeSignal]
) -> tuple[dict[tuple[str, int], BarPattern], list[tuple[str, int]]]:
    """The bar pattern that takes of one dance and cycle share, by both; and the dance and cycle of each take.

    It is learnt on these takes, of the speed of the body's shape; those without beats or movement have no part in it.
    """
    keys = [(take.dance, cycle_of_meter(take.meter or None)) for take in takes]
    sums: dict[tuple[str, int], list[bar_pattern.PatternSums]] = {}
    for take, signal, key in zip(takes, signals, keys, strict=True):
        if take.beats.size > 1 and signal.values.any():
            positions = bar_pattern.beat_positions(signal.times, take.track)
            sums.setdefault(key, []).append(bar_pattern.pattern_sums(positions, signal.values, key[1]))
    return {key: bar_pattern.fit_pattern(own) for key, own in sums.items()}, keys


def pattern_shares(takes: Sequence[Take]) -> list[FloatArray]:
    """Rank of each beat of each take among all its moments, by the bar pattern of its dance; (B,) arrays in (0, 1)."""
    signals = [shape_signal(shape_speed(take.motion)) for take in takes]
    patterns, keys = bar_patterns(takes, signals)
    return [
        bar_pattern.beat_ranks(signal.times, signal.values, take.track, patterns[key])
        if take.beats.size > 1 and signal.values.any()
        else np.full(take.beats.size, UNKNOWN_SHARE)
        for take, signal, key in zip(takes, signals, keys, strict=True)
    ]
