"""Settings of a synthetic clip, and when things happen in it: beats of the music and ends of the movements."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from harmolab.params import DANCES, check_kinds
from harmolab.score import check_whole
from harmolab.types import BoolArray, FloatArray, IntArray

BARS_AROUND = 3  # bars of the piece that exist before and after the clip, so that its edges are like its middle
CLOSEST = 0.25  # beats that two movement ends stay apart at least
TINY = np.nextafter(0.0, 1.0)  # the least that is positive

# Lowest and highest value of each setting, and the rule in words.
RANGES: Mapping[str, tuple[float, float, str]] = {
    "seconds": (TINY, 3600.0, "must be positive and at most 3600"),
    "fps": (TINY, 1000.0, "must be positive and at most 1000 (15 to 120 is usual)"),
    "tempo": (20.0, 400.0, "must be within 20 and 400 beats per minute"),
    "drift": (-1.0, 1.0, "is a share of the tempo and must be within -1 and 1"),
    "lateness": (-1.0, 1.0, "must be within -1 and 1 seconds"),
    "jitter": (0.0, 1.0, "must be within 0 and 1 seconds"),
    "omission": (0.0, 1.0, "is a share and must be within 0 and 1"),
    "redundancy": (0.0, 1.0, "is a share and must be within 0 and 1"),
    "noise": (0.0, 1.0, "is in metres and must be within 0 and 1"),
    "sample_rate": (8000, np.inf, "must be at least 8000 Hz to hold the drums"),
}


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

    def inside(self, seconds: float) -> BoolArray:
        """(B,) which beats lie in [0, seconds)."""
        return (self.times >= 0) & (self.times < seconds)

    def tempo(self, seconds: float) -> float:
        """Beats per minute, mean over [0, seconds)."""
        counts = np.interp([0.0, seconds], self.times, np.arange(self.times.size))
        return float(60 * np.diff(counts)[0] / seconds)


@dataclass(frozen=True)
class ClipSettings:
    """The settings of a synthetic clip; equal settings give equal clips.

    The dancer is computed, and its movements end (it rests) on the beats of the computed music, but for the liberties
    that the settings name.

    Parameters
    ----------
    dance : str
        One of `DANCES`.
    seconds : float
    fps : float, frames per second
        15 to 120 is usual.
    tempo : float or None, beats per minute
        Mean over the clip. None: drawn from the dance's range.
    drift : float
        Share of the tempo by which it rises from start to end; .1 goes from 5 % below the mean to 5 % above it.
    lateness : float, seconds
        Delay of all movement ends after their beats; negative for early ones.
    jitter : float, seconds
        Standard deviation of each movement end about its beat (Gaussian).
    omission : float
        Share of the beats without a movement end.
    redundancy : float
        Share of the intervals between beats with one more movement end.
    noise : float, metres
        Standard deviation of sensor noise on each joint, axis and frame.
    figures : tuple of str or None
        Names of the figures of the dance (`harmolab.data.synthetic.dancer.figure_names`), danced in turn. None: drawn.
    sample_rate : int, hertz
        At least 8000.
    seed : int
        Of all that is drawn.

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.
    """

    dance: str = "cha-cha"
    seconds: float = 6.0
    fps: float = 60.0
    tempo: float | None = None
    drift: float = 0.0
    lateness: float = 0.0
    jitter: float = 0.0
    omission: float = 0.0
    redundancy: float = 0.0
    noise: float = 0.0
    figures: tuple[str, ...] | None = None
    sample_rate: int = 22050
    seed: int = 0

    def __post_init__(self) -> None:
        if self.dance not in DANCES:
            raise ValueError(f"unknown dance {self.dance!r}; the seven are {', '.join(DANCES)}")
        check_whole(seed=self.seed)
        check_kinds(self)
        for name, (low, high, rule) in RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} {rule}, got {value}")
        if not round(self.seconds * self.fps) >= 2:
            raise ValueError(f"{self.seconds} s at {self.fps} frames per second is less than two frames")
        object.__setattr__(self, "seed", int(self.seed))
        if self.figures is not None:
            object.__setattr__(self, "figures", tuple(self.figures))


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


def beat_grid(settings: ClipSettings) -> BeatGrid:
    """Beats of a dance at its tempo and drift; the clip starts somewhere inside a bar."""
    dance = DANCES[settings.dance]
    rng = np.random.default_rng([settings.seed, 1])
    drawn, phase = rng.uniform(*dance.tempo), rng.uniform(0, dance.meter)
    rate = (drawn if settings.tempo is None else settings.tempo) / 60
    around = BARS_AROUND * dance.meter
    counts = np.arange(-around, np.ceil(settings.seconds * rate) + around) - phase
    return BeatGrid(_times_of_counts(counts, rate, settings.drift, settings.seconds), 0, dance.meter)


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
    downbeats = np.asarray(downbeat_times, float).ravel()
    downbeat = int(np.abs(times - downbeats[0]).argmin()) if downbeats.size else 0
    return BeatGrid(np.concatenate([before, times, after]), (n_before + downbeat) % meter, meter)


def movement_ends(grid: BeatGrid, settings: ClipSettings) -> MovementEnds:
    """The ends of all movements: on the beats, but for lateness, jitter, omission and redundancy.

    Each of these has its own random numbers, so that raising one leaves the others as they were. Ends stay a quarter
    of a beat apart, which cuts the tails of a jitter that is large against the beat.
    """
    size = grid.times.size
    jitters, omissions, redundancies = (np.random.default_rng([settings.seed, 2, stream]) for stream in range(3))
    drawn = grid.times + settings.lateness + settings.jitter * jitters.standard_normal(size)
    gap = CLOSEST * float(np.median(np.diff(grid.times))) * np.arange(size)
    times = np.maximum.accumulate(drawn - gap) + gap
    kept = omissions.random(size) >= settings.omission
    extra = redundancies.random(size - 1) < settings.redundancy
    between = times[:-1] + redundancies.uniform(0.4, 0.6, size - 1) * np.diff(times)
    every = np.concatenate([times[kept], between[extra]])
    beats = np.concatenate([np.flatnonzero(kept), np.full(int(extra.sum()), -1)])
    order = np.argsort(every)
    return MovementEnds(every[order], beats[order])
