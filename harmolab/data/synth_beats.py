"""When things happen in a synthetic clip: the beats of its music and the ends of its movements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.params import DANCES, Dance

__all__ = ["BeatGrid", "Liberties", "MovementEnds", "beat_grid", "dance_named", "grid_through", "movement_ends"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BARS_AROUND = 3  # bars of the piece that exist before and after the clip, so that its edges are like its middle
CLOSEST = 0.25  # beats that two movement ends stay apart at least


@dataclass(frozen=True, eq=False)
class BeatGrid:
    """Beats of a piece, from before the start of a clip to after its end.

    Parameters
    ----------
    times : (B,) array, seconds; the clip starts at 0
    first_downbeat : int, index of the first downbeat in `times`
    meter : int, beats in a bar
    """

    times: FloatArray
    first_downbeat: int
    meter: int

    @property
    def positions(self) -> IntArray:
        """(B,) place of each beat in its bar; 0 is the downbeat."""
        return (np.arange(self.times.size) - self.first_downbeat) % self.meter

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """(B,) which beats lie in [0, seconds)."""
        return (self.times >= 0) & (self.times < seconds)

    def tempo(self, seconds: float) -> float:
        """Beats per minute, mean over [0, seconds)."""
        counts = np.interp([0.0, seconds], self.times, np.arange(self.times.size))
        return float(60 * np.diff(counts)[0] / seconds)


@dataclass(frozen=True)
class Liberties:
    """How freely a dancer treats the beat.

    Parameters
    ----------
    lateness : float, seconds
        Constant delay of every movement end after its beat (negative: early).
    jitter : float, seconds
        Standard deviation of each movement end about its beat, Gaussian.
    omission : float
        Share of beats on which no movement ends.
    redundancy : float
        Share of beat-to-beat intervals that hold an extra movement end.
    """

    lateness: float = 0.0
    jitter: float = 0.0
    omission: float = 0.0
    redundancy: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.lateness) <= 1:
            raise ValueError(f"lateness must be within -1 and 1 seconds, got {self.lateness}")
        if not 0 <= self.jitter <= 1:
            raise ValueError(f"jitter must be within 0 and 1 seconds, got {self.jitter}")
        for name in ("omission", "redundancy"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is a share and must be within 0 and 1, got {getattr(self, name)}")


@dataclass(frozen=True, eq=False)
class MovementEnds:
    """The times at which movements end, and the beats they belong to.

    Parameters
    ----------
    times : (M,) array, seconds, increasing
    beats : (M,) int array
        Index into the grid of the beat each one ends on; -1 for an extra end between beats.
    """

    times: FloatArray
    beats: IntArray


def dance_named(dance: str) -> Dance:
    """Tempo range and meter of a dance; ValueError lists the seven when it is unknown."""
    if dance not in DANCES:
        raise ValueError(f"unknown dance {dance!r}; the seven are {', '.join(DANCES)}")
    return DANCES[dance]


def beat_grid(dance: str, *, seconds: float, seed: int, tempo: float | None = None, drift: float = 0.0) -> BeatGrid:
    """Beats of a dance; the clip starts somewhere inside a bar.

    Parameters
    ----------
    dance : str, one of `params.DANCES`
    seconds : float, length of the clip
    seed : int
    tempo : float, beats per minute, optional
        Mean over the clip; drawn from the dance's range when left out.
    drift : float
        Share of the tempo by which it rises from start to end (0.1: from 5 % below the mean to 5 % above).

    Raises
    ------
    ValueError
        For an unknown dance, a length or tempo out of range, or a drift beyond -1 to 1.
    """
    kind = dance_named(dance)
    if not (np.isfinite(seconds) and 0 < seconds <= 3600):
        raise ValueError(f"seconds must be positive and at most 3600, got {seconds}")
    if tempo is not None and not 20 <= tempo <= 400:
        raise ValueError(f"tempo must be within 20 and 400 beats per minute, got {tempo}")
    if not abs(drift) <= 1:
        raise ValueError(f"drift is a share of the tempo and must be within -1 and 1, got {drift}")
    rng = np.random.default_rng([seed, 1])
    drawn, phase = rng.uniform(*kind.tempo), rng.uniform(0, kind.meter)
    rate = (drawn if tempo is None else tempo) / 60
    around = BARS_AROUND * kind.meter
    counts = np.arange(-around, np.ceil(seconds * rate) + around) - phase
    return BeatGrid(_times_of_counts(counts, rate, drift, seconds), 0, kind.meter)


def _times_of_counts(counts: FloatArray, rate: float, drift: float, seconds: float) -> FloatArray:
    """Seconds after which so many beats have passed.

    The rate climbs linearly over [0, seconds] and is constant outside: counts = rate (a t + b t^2) inside, with
    a = 1 - drift / 2 and b = drift / (2 seconds).
    """
    beats, a, b = counts / rate, 1 - drift / 2, drift / (2 * seconds)
    inside = np.clip(beats, 0, seconds)
    times = 2 * inside / (a + np.sqrt(a * a + 4 * b * inside))
    return times + np.minimum(beats, 0) / a + np.maximum(beats - seconds, 0) / (1 + drift / 2)


def grid_through(beat_times: ArrayLike, downbeat_times: ArrayLike, meter: int, seconds: float) -> BeatGrid:
    """A grid through known beats, continued at the same pace before the first and after the last.

    Parameters
    ----------
    beat_times : (B,) array, seconds, at least two
    downbeat_times : array, seconds; the beat nearest to its first entry is a downbeat (the first beat if empty)
    meter : int, beats in a bar
    seconds : float
        Length of the clip; beats are added until three bars after its end.
    """
    times = np.asarray(beat_times, float)
    if times.ndim != 1 or times.size < 2 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ValueError("beat_times must be a list of at least two increasing times in seconds")
    around = BARS_AROUND * meter
    first_pace, last_pace = (float(np.median(gaps)) for gaps in (np.diff(times[:9]), np.diff(times[-9:])))
    n_before = around + max(int(np.ceil(times[0] / first_pace)), 0)
    n_after = around + max(int(np.ceil((seconds - times[-1]) / last_pace)), 0)
    before = times[0] - first_pace * np.arange(n_before, 0, -1)
    after = times[-1] + last_pace * np.arange(1, n_after + 1)
    known = np.asarray(downbeat_times, float).ravel()
    downbeat = int(np.abs(times - known[0]).argmin()) if known.size else 0
    return BeatGrid(np.concatenate([before, times, after]), (n_before + downbeat) % meter, meter)


def movement_ends(grid: BeatGrid, liberties: Liberties, *, seed: int) -> MovementEnds:
    """When each movement ends: on the beats, but for the dancer's liberties.

    Every liberty has its own random numbers, so that raising one leaves the others as they were. Ends stay a quarter
    of a beat apart, which cuts the tails of a jitter that is large against the beat.

    Parameters
    ----------
    grid : BeatGrid
    liberties : Liberties
    seed : int
    """
    size = grid.times.size
    jitters, omissions, redundancies = (np.random.default_rng([seed, 2, stream]) for stream in range(3))
    wanted = grid.times + liberties.lateness + liberties.jitter * jitters.standard_normal(size)
    gap = CLOSEST * float(np.median(np.diff(grid.times))) * np.arange(size)
    times = np.maximum.accumulate(wanted - gap) + gap
    kept = omissions.random(size) >= liberties.omission
    extra = redundancies.random(size - 1) < liberties.redundancy
    between = times[:-1] + redundancies.uniform(0.4, 0.6, size - 1) * np.diff(times)
    every = np.concatenate([times[kept], between[extra]])
    beats = np.concatenate([np.flatnonzero(kept), np.full(int(extra.sum()), -1)])
    order = np.argsort(every)
    return MovementEnds(every[order], beats[order])
