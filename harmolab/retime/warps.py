"""Time-warps: smooth maps of one time line onto another, from two beat tracks; dynamic programming, Lee et al. 2019.

A warp never stands still and never jumps. The bounded one is found by dynamic programming; the other one is that of Lee
et al. 2019.

A state of the dynamic programming is a candidate match: one visual beat, one music beat, and the distance from it at
which the visual beat comes to lie. A path of matches from the start to the end of the clip is a warp that is linear in
between; every step keeps the bounds on the local speed.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from harmolab.beats.salience import salient_audio, salient_visual
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, FloatArray, IntArray

HALVINGS = 60  # of the interval between two knots: beyond the precision of a double
STEP = 0.01  # seconds between the moments over which `bent` is a mean


@dataclass(frozen=True, eq=False)
class TimeWarp:
    """A map of source times (of the motion as it was) to target times (of the motion as it becomes).

    Between the knots, source time is a monotone cubic (PCHIP) of target time; outside them nothing is shifted.

    Parameters
    ----------
    source, target : (K,) arrays, seconds
        Knots, two or more, strictly increasing, equal at both ends.

    Raises
    ------
    ValueError
        For knots that are too few, not finite, not increasing, or that move an end.

    Examples
    --------
    >>> warp = TimeWarp([0.0, 1.2, 2.0], [0.0, 1.0, 2.0])
    >>> warp([0.0, 1.2, 2.0]).round(6)
    array([0., 1., 2.])
    >>> warp.inverse(1.0)
    array(1.2)
    """

    source: FloatArray
    target: FloatArray

    def __post_init__(self) -> None:
        for name in ("source", "target"):
            object.__setattr__(self, name, _knots(getattr(self, name), name))
        source, target = self.source, self.target
        if source.shape != target.shape:
            raise ValueError(f"a warp needs as many source as target knots, got {source.size} and {target.size}")
        if source[0] != target[0] or source[-1] != target[-1]:
            raise ValueError("a warp keeps its ends; the first and the last knot must be equal in source and target")

    @classmethod
    def identity(cls, duration: float) -> "TimeWarp":
        """The warp of [0, duration] that shifts nothing."""
        return cls(np.array([0.0, duration]), np.array([0.0, duration]))

    @property
    def is_identity(self) -> bool:
        """True if nothing is shifted."""
        return bool(np.array_equal(self.source, self.target))

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.target, self.source)

    def inverse(self, times: ArrayLike) -> FloatArray:
        """Source times of target times (any shape), seconds: the moment of the old motion that is seen then."""
        moments = np.asarray(times, dtype=np.float64)
        if self.is_identity:
            return moments.copy()
        inside = (moments > self.target[0]) & (moments < self.target[-1])
        curve: FloatArray = self._curve(np.clip(moments, self.target[0], self.target[-1]))
        return np.where(inside, curve, moments)

    def __call__(self, times: ArrayLike) -> FloatArray:
        """Target times of source times (any shape), seconds: the moment at which the old motion's is seen now."""
        moments = np.asarray(times, dtype=np.float64)
        place = np.clip(np.searchsorted(self.source, moments, side="right") - 1, 0, self.source.size - 2)
        low, high = self.target[place], self.target[place + 1]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            early = self.inverse(middle) < moments
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        inside = (moments > self.source[0]) & (moments < self.source[-1])
        return np.where(inside & (not self.is_identity), (low + high) / 2, moments)

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest local speed anywhere, source seconds per target second (1 is as before)."""
        if self.is_identity:
            return 1.0, 1.0
        slope = self._curve.derivative()
        bends = slope.derivative().roots(discontinuity=False, extrapolate=False)
        speeds = slope(np.concatenate([self.target, bends[np.isfinite(bends)]]))
        return float(speeds.min()), float(speeds.max())

    def shifts(self) -> FloatArray:
        """Target minus source time at every hundredth second of the target, seconds."""
        times = np.linspace(self.target[0], self.target[-1], max(2, round(np.ptp(self.target) / STEP) + 1))
        return times - self.inverse(times)

    @property
    def bent(self) -> float:
        """Mean absolute shift, seconds."""
        return float(np.abs(self.shifts()).mean())

    def scaled(self, strength: float) -> "TimeWarp":
        """The warp with all its shifts times `strength`: 0 is the identity, 1 the warp itself."""
        if not 0 <= strength <= 1:
            raise ValueError(f"strength must lie between 0 and 1, got {strength}")
        return TimeWarp(self.target + strength * (self.source - self.target), self.target)


def _knots(values: ArrayLike, name: str) -> FloatArray:
    """A read-only copy of knots that increase."""
    knots = np.array(values, dtype=np.float64)
    if knots.ndim != 1 or knots.size < 2:
        raise ValueError(f"{name} knots must be a list of two or more times, got shape {knots.shape}")
    if not np.isfinite(knots).all() or (np.diff(knots) <= 0).any():
        raise ValueError(f"{name} knots must be finite and increase strictly")
    knots.setflags(write=False)
    return knots


# Warps from two beat tracks

Method = Literal["dp", "lee2019"]
METHODS = get_args(Method)

KNOT = 0.02  # seconds between the knots of a warp
ROUNDING = 0.12  # seconds over which a change of speed is spread
STRETCH = 12  # music beats that are judged together
WORTH = 0.4  # mean gain a beat, in missed beats, from which on a stretch is bent
SLACK = 1e-3  # of the bounds, which rounding off and interpolation may use up
LONE_PERIOD = 0.5  # seconds: the beat period of music with a single beat
CLOSEST = 1e-3  # seconds between beats that the warper of 2019 keeps apart
REACH = 0.75  # of the local beat period: a visual beat further away is not brought to this music beat
RESIDUALS = np.linspace(-0.8, 0.8, 17)  # of the tolerance: where around its target a visual beat may come to lie
MUSIC_SKIP = 1.0  # cost of a music beat without a match; a match costs (residual / tolerance)^2
VISUAL_SKIP = 0.1  # cost of a visual beat without a match
BEND = 0.5  # cost of a second at e times the speed
MEMORY = 1500  # candidates that a step looks back on: ten seconds of busy dancing to fast music


def beat_warp(
    visual: BeatTrack,
    music: BeatTrack,
    duration: float,
    *,
    phase: float = 0.0,
    strength: float = 1.0,
    slowest: float = 0.7,
    fastest: float = 1.4,
    params: HarmonyParams | None = None,
    method: Method = "dp",
) -> TimeWarp:
    """The smooth warp that brings visual beats to music beats, and keeps its local speed within bounds everywhere.

    Dynamic programming chooses the pairs of visual and music beats, and their distance where the bounds leave no better
    way; beats may be left out at a cost. The path's changes of speed are then spread over a tenth of a second.

    A dance that is in time already is left alone: the identity comes back unless, in some stretch of 12 music beats,
    the warp gains 0.4 a beat on average, where a missed beat counts 1 and one met at a distance d counts
    (d / reaction_delay)^2. So a second run changes nothing.

    Parameters
    ----------
    visual, music : BeatTrack on one time line
        All beats; saliency (Eq. 11-13) is applied inside.
    duration : float, seconds
        The warp maps [0, duration] onto itself.
    phase : float, beat periods, -1 to 1
        Visual beats are brought this much after the music's: 0.5 is half way to the next.
    strength : float, 0 to 1
        Share of every shift that is made.
    slowest, fastest : float
        Bounds on the local speed, source seconds per target second.
    params : HarmonyParams, default ``HarmonyParams.valleys()``
        ``reaction_delay`` is the distance from its target at which a beat may end; ``lag`` is added to every target.
    method : "dp" or "lee2019"
        This warp, or for comparison `lee_warp`, to which the bounds mean nothing.

    Returns
    -------
    TimeWarp; the identity when there are no beats on one side, or nothing gains enough.

    Raises
    ------
    ValueError
        For a phase, strength or bound out of range, a reaction delay of zero, or a method that is neither.
    """
    params = params or HarmonyParams.valleys()
    _check(phase, strength, slowest, fastest, params.reaction_delay)
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}; got {method!r}")
    if method == "lee2019":
        return lee_warp(visual, music, duration, phase=phase, params=params).scaled(strength)
    beats, targets, periods = _beats_and_targets(visual, music, duration, phase, params)
    if beats.size == 0 or targets.size == 0:
        return TimeWarp.identity(duration)
    candidates = candidate_matches(beats, targets, periods, duration, params.reaction_delay)
    path = best_path(candidates, min(1.0, slowest * (1 + SLACK)), max(1.0, fastest * (1 - SLACK)))
    warp = _bounded(_rounded(candidates.source[path], candidates.target[path]), slowest, fastest)
    if not _gains_enough(warp, beats, targets, params.reaction_delay):
        return TimeWarp.identity(duration)
    return warp if strength == 1 else warp.scaled(strength)


def lee_warp(
    visual: BeatTrack, music: BeatTrack, duration: float, *, phase: float = 0.0, params: HarmonyParams | None = None
) -> TimeWarp:
    """The warp of Lee et al. 2019 ("Dancing to Music") for a motion of any beats: each goes to its nearest music beat.

    Nearest is for unknown beats. A dance whose beats are known by number needs no search: in their system
    (`harmolab.systems.lee2019`) beat j goes to the j-th beat of the music.

    In between time is stretched linearly, as much as it takes: the local speed has no bounds. Of visual beats with the
    same nearest music beat the closest one goes there. Parameters are those of `beat_warp`.
    """
    params = params or HarmonyParams.valleys()
    _check(phase, 1.0, 1.0, 1.0, params.reaction_delay)
    beats, targets, _ = _beats_and_targets(visual, music, duration, phase, params)
    if beats.size == 0 or targets.size == 0:
        return TimeWarp.identity(duration)
    distances = np.abs(beats[:, None] - targets[None])
    nearest, best = distances.argmin(axis=1), distances.argmin(axis=0)
    nearest_pairs = [(beats[best[n]], targets[n]) for n in np.unique(nearest) if nearest[best[n]] == n]
    source, target = np.array([(0.0, 0.0), *nearest_pairs, (duration, duration)]).T
    apart = np.append(True, (np.diff(source) > CLOSEST) & (np.diff(target) > CLOSEST))
    apart[-1] = True
    return _linear(source[apart], target[apart])


def _check(phase: float, strength: float, slowest: float, fastest: float, tolerance: float) -> None:
    if not -1 <= phase <= 1:
        raise ValueError(f"phase must lie between -1 and 1 beat periods, got {phase}")
    if not 0 <= strength <= 1:
        raise ValueError(f"strength must lie between 0 and 1, got {strength}")
    if not 0 < slowest <= 1:
        raise ValueError(f"slowest must lie above 0 and not above 1, got {slowest}")
    if not 1 <= fastest < float("inf"):
        raise ValueError(f"fastest must be 1 or more, and finite, got {fastest}")
    if tolerance <= 0:
        raise ValueError("retiming needs params with a reaction_delay above 0 seconds")


def moved(music: BeatTrack, phase: float) -> BeatTrack:
    """The beats later by so many beat periods; those outside the clip are left out."""
    if not phase:
        return music
    times = music.times + phase * _periods(music.times)
    inside = (times >= 0) & (times < music.duration)
    return replace(music.select(inside), times=times[inside])


def _periods(beats: FloatArray) -> FloatArray:
    """Seconds between beats (N,) at each of them."""
    return np.gradient(beats) if beats.size > 1 else np.full(beats.size, LONE_PERIOD)


def _beats_and_targets(
    visual: BeatTrack, music: BeatTrack, duration: float, phase: float, params: HarmonyParams
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Visual beats (M,), their targets (N,) and the beat periods there (N,), all strictly inside the clip."""
    beats, moves = salient_audio(music, params).times, salient_visual(visual, params).times
    periods = _periods(beats)
    every = _periods(music.times)[np.isin(music.times, beats)]  # the next beat is one that may be too weak to count
    targets = beats + phase * every + params.lag
    inside = (targets > 0) & (targets < duration)
    return moves[(moves > 0) & (moves < duration)], targets[inside], periods[inside]


def _gains_enough(warp: TimeWarp, beats: FloatArray, targets: FloatArray, tolerance: float) -> bool:
    """True if the mean gain of some stretch of music is above `WORTH`."""
    gain = capped_costs(beats, targets, tolerance) - capped_costs(warp(beats), targets, tolerance)
    size = min(STRETCH, gain.size)
    return bool(np.convolve(gain, np.full(size, 1 / size), mode="valid").max() > WORTH)


def _rounded(source: FloatArray, target: FloatArray) -> TimeWarp:
    """The path with its corners rounded off.

    Each speed becomes a weighted mean of speeds nearby, so the bounds of the path hold.
    """
    duration = target[-1]
    times = np.linspace(0.0, duration, max(2, round(duration / KNOT) + 1))
    shifts = np.interp(times, target, source) - times
    half = min(round(ROUNDING / 2 / times[1]), times.size - 2)
    window = np.hanning(2 * half + 3)
    # Mirrored through its ends, which therefore stay where they are.
    mirrored = np.pad(shifts, half + 1, mode="reflect", reflect_type="odd")
    smooth = np.convolve(mirrored, window / window.sum(), mode="valid")
    smooth[[0, -1]] = 0.0
    return TimeWarp(times + smooth, times)


def _bounded(warp: TimeWarp, slowest: float, fastest: float) -> TimeWarp:
    """The warp, its shifts made smaller where interpolation between the knots has broken a bound.

    The slopes at the knots do not scale with the shifts, hence a little less each time, and the loop.
    """
    low, high = warp.speed_range()
    while not warp.is_identity and (low < slowest or high > fastest):
        share = min(1.0, (1 - slowest) / max(1 - low, SLACK), (fastest - 1) / max(high - 1, SLACK))
        warp = warp.scaled(share * (1 - SLACK))
        low, high = warp.speed_range()
    return warp


def _linear(source: FloatArray, target: FloatArray) -> TimeWarp:
    """The warp that is linear between its knots: so many more knots that the cubic pieces are straight.

    Corners remain a little round, with speeds up to a tenth beyond those on either side.
    """
    dense = np.union1d(target, np.arange(0.0, target[-1], KNOT))
    close = np.append(np.diff(dense) > CLOSEST / 2, True) | np.isin(dense, target)
    return TimeWarp(np.interp(dense[close], target, source), dense[close])


class Candidates(NamedTuple):
    """Candidate matches in order of target time; the first and the last are the ends of the clip.

    Parameters
    ----------
    source, target : (K,) arrays, seconds
    visual, music : (K,) arrays, indices of the beats; the ends have -1 and the number of beats
    costs : (K,) array
    """

    source: FloatArray
    target: FloatArray
    visual: FloatArray
    music: FloatArray
    costs: FloatArray


def candidate_matches(
    visual: FloatArray, targets: FloatArray, periods: FloatArray, duration: float, tolerance: float
) -> Candidates:
    """Matches of every visual beat with the music beats within reach, at 17 distances from each.

    Parameters
    ----------
    visual : (M,) array, seconds, inside (0, duration)
    targets, periods : (N,) arrays, seconds: where visual beats should come to lie, and the beat period there
    duration, tolerance : float, seconds
    """
    near = np.abs(visual[None] - targets[:, None]) <= REACH * periods[:, None]
    music, beats = np.repeat(np.nonzero(near), RESIDUALS.size, axis=1)
    residuals = np.resize(RESIDUALS, music.size)
    target = targets[music] + residuals * tolerance
    order = np.argsort(target, kind="stable")
    order = order[(target[order] > 0) & (target[order] < duration)]
    matches = np.stack([visual[beats], target, beats, music, residuals**2])[:, order]
    first, last = [0.0, 0.0, -1, -1, 0.0], [duration, duration, visual.size, targets.size, 0.0]
    return Candidates(*np.column_stack([first, matches, last]))


def best_path(candidates: Candidates, slowest: float, fastest: float) -> IntArray:
    """Indices of the cheapest path from the first candidate to the last, both included.

    Both ends are always joined: at speed 1, if no match is worth more.
    """
    count = candidates.target.size
    total, back = np.full(count, np.inf), np.zeros(count, dtype=np.int64)
    total[0] = 0.0
    for index in range(1, count):
        first = max(0, index - MEMORY)
        before = np.arange(first, index) if first == 0 else np.append(0, np.arange(first, index))
        sums = total[before] + _step_costs(candidates, before, index, slowest, fastest)
        best = int(np.argmin(sums))
        total[index], back[index] = sums[best] + candidates.costs[index], before[best]
    path = [count - 1]
    while path[-1] > 0:
        path.append(int(back[path[-1]]))
    return np.array(path[::-1])


def _step_costs(candidates: Candidates, before: IntArray, index: int, slowest: float, fastest: float) -> FloatArray:
    """Cost of going from each earlier candidate straight to this one; infinite where a bound would break."""
    source, seconds, visual, music = (field[index] - field[before] for field in candidates[:4])
    allowed = (visual > 0) & (music > 0) & (source >= slowest * seconds) & (source <= fastest * seconds) & (seconds > 0)
    speed = np.divide(source, seconds, out=np.ones_like(seconds), where=allowed)
    costs = MUSIC_SKIP * (music - 1) + VISUAL_SKIP * (visual - 1) + BEND * seconds * np.log(speed) ** 2
    return np.where(allowed, costs, np.inf)


def capped_costs(visual: FloatArray, targets: FloatArray, tolerance: float) -> FloatArray:
    """min(distance / tolerance, 1)^2 from each target to its nearest visual beat, (N,)."""
    distances = np.abs(visual[None] - targets[:, None]).min(axis=1, initial=np.inf)
    return np.minimum(distances / tolerance, 1.0) ** 2
