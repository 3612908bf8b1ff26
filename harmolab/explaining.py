"""A score in plain words: how many beats were met, how often the dancer moves, and how early or late.

Each sentence rests on one statistic with a 95 % interval, and is only said where that interval excludes zero (or what
chance would reach). Where there is no evidence the sentence says that.

Visual beats are read as places in the beat: a phase from 0 to 1 between two music beats. A dancer who makes two
movements a beat has them at two places, so phases are first folded onto the grid that the dancer keeps. Intervals are
Student's t on the offsets in time. Neighbouring beats resemble each other: that is the least the uncertainty can be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from harmolab.beats.saliency import salient_audio, salient_visual
from harmolab.harmony import chance_level, hit_mask
from harmolab.params import HarmonyParams
from harmolab.pattern import beat_positions
from harmolab.types import BeatTrack, HarmonyScore

__all__ = ["Explanation", "Finding", "Stretch", "Timing", "beat_timing", "explain", "explain_timing"]

FloatArray = NDArray[np.float64]

FEWEST = 6  # beats on either side, below which nothing is said
SMALLEST = 0.02  # seconds; smaller offsets are real perhaps, but nobody notices them
LOCKED = 0.001  # p-value below which movements keep a place in the beat; beats are not independent, so a strict one
CLEARLY = 0.9  # to blame a clock, a line must leave this share of what a step leaves, or less
FASTEST_CLOCK = 0.03  # share by which the clock of a recording may be wrong
GRIDS = (1, 2)  # movements that fit on one beat
SIMPLE_RATES = {0.25: "one movement every four beats", 0.5: "one movement every two beats", 1.0: "one movement a beat",
                2.0: "two movements a beat"}  # fmt: skip
Interval = tuple[float, float]


@dataclass(frozen=True)
class Finding:
    """One sentence and the number behind it.

    Parameters
    ----------
    kind : "score", "hits", "rate", "locked", "mean", "change" or "drift"
    sentence : str
    value : float
        Above-chance harmony; share of beats met; movements a beat; p-value; seconds late; seconds later in the second
        half; seconds a second.
    interval : (float, float), 95 %; NaN for a p-value
    """

    kind: str
    sentence: str
    value: float
    interval: Interval


@dataclass(frozen=True)
class Stretch:
    """Mean offset from the music (seconds, late is positive) between two times, with its 95 % interval."""

    start: float
    end: float
    mean: float
    interval: Interval


@dataclass(frozen=True)
class Explanation:
    """Findings in the order they are told, and the mean offset of each half where there is one."""

    findings: tuple[Finding, ...]
    stretches: tuple[Stretch, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """The words alone."""
        return tuple(finding.sentence for finding in self.findings)

    def __str__(self) -> str:
        return "\n".join(self.sentences)


@dataclass(frozen=True, eq=False)
class Timing:
    """How far each movement lies from the music.

    Parameters
    ----------
    times, offsets : (M,) arrays, seconds
        Of each visual beat: where it is, and how late after its place on the grid.
    grid : int, places on one beat (2: beats and half beats)
    p_value : float
        Of the Rayleigh test that movements fall anywhere in the beat, times the number of clocks tried.
    """

    times: FloatArray
    offsets: FloatArray
    grid: int
    p_value: float


def explain(
    score: HarmonyScore, music: BeatTrack, visual: BeatTrack, *, params: HarmonyParams | None = None
) -> Explanation:
    """A score and its timing in words.

    Parameters
    ----------
    score : HarmonyScore
    music, visual : BeatTrack on one time line, as they were scored
    params : HarmonyParams, default ``HarmonyParams.valleys()``
    """
    timing = explain_timing(music, visual, params=params)
    return Explanation((_score_finding(score), *timing.findings), timing.stretches)


def explain_timing(
    music: BeatTrack, visual: BeatTrack, *, duration: float | None = None, params: HarmonyParams | None = None
) -> Explanation:
    """Beats met, movements a beat, and earliness or lateness, in words.

    Parameters
    ----------
    music, visual : BeatTrack on one time line
    duration : float, seconds, default that of the music
    params : HarmonyParams, default ``HarmonyParams.valleys()``
        Its saliency, reaction delay and lag are used.

    Returns
    -------
    Explanation; one sentence when there are too few beats to say anything.

    Examples
    --------
    >>> times = np.arange(1, 21) * 0.5
    >>> music = BeatTrack(times, np.ones(20), 100.0, 11.0)
    >>> print(explain_timing(music, BeatTrack(times + 0.08, np.ones(20), 100.0, 11.0)).sentences[-1])
    You are 80 ms late throughout (95 % interval 80 to 80 ms).
    """
    chosen = params or HarmonyParams.valleys()
    length = music.duration if duration is None else duration
    heard, seen = salient_audio(music, chosen), salient_visual(visual, chosen)
    if min(len(heard), len(seen)) < FEWEST:
        few = f"There are {len(heard)} music beats and {len(seen)} movements: too few to say anything about timing."
        return Explanation((Finding("hits", few, float("nan"), _NOTHING),))
    told = [_hits_finding(heard, seen, length, chosen), _rate_finding(heard, seen)]
    timing = beat_timing(heard, seen, lag=chosen.lag)
    if timing.p_value > LOCKED:
        told.append(_unlocked(timing))
        return Explanation(tuple(told))
    halves = _halves(timing, length)
    return Explanation((*told, *_timing_findings(timing, halves, length)), halves)


_NOTHING = (float("nan"), float("nan"))


def beat_timing(music: BeatTrack, visual: BeatTrack, *, lag: float = 0.0) -> Timing:
    """How late each visual beat is on the grid of beats, or of half beats, that the dancer keeps.

    A clock that runs wrong moves the places evenly: clocks up to 3 % off are tried, the one at which the movements
    gather most is taken, and offsets are counted on from there without jumps.

    Parameters
    ----------
    music, visual : BeatTrack on one time line, two and one beats at least
    lag : float, seconds, how late a movement is expected
    """
    times = visual.times - lag
    positions = beat_positions(times, music) - (0 if music.bar_places is None else music.bar_places[0])
    period = float(np.polyfit(np.arange(len(music)), music.times, 1)[0])
    centre = positions.mean()
    steps = int(np.ceil(FASTEST_CLOCK * np.ptp(positions) * 10)) + 1
    slopes = np.linspace(-FASTEST_CLOCK, FASTEST_CLOCK, 2 * steps + 1)
    trials = 1 + 2 * FASTEST_CLOCK * np.ptp(positions)  # clocks that differ
    best = None
    for grid in GRIDS:
        turned = grid * (positions - slopes[:, None] * (positions - centre))
        gathered = np.exp(2j * np.pi * turned).mean(axis=1)
        top = int(np.abs(gathered).argmax())
        size = float(np.abs(gathered[top]))
        if best is None or size > best[0] + 0.1:  # half beats only where they explain clearly more
            place = np.angle(gathered[top]) / (2 * np.pi)
            rest = (turned[top] - place + 0.5) % 1 - 0.5
            # The middle of the clip lies within half a place of the grid; the clock's part is put back.
            best = size, grid, (rest + place) / grid + slopes[top] * (positions - centre)
    size, grid, late = best  # type: ignore[misc]  # GRIDS is not empty
    p = min(1.0, trials * len(GRIDS) * _rayleigh(size, times.size))
    return Timing(visual.times, late * period, grid, p)


def _rayleigh(size: float, count: int) -> float:
    """p-value of the mean resultant length `size` of `count` phases (Zar's approximation)."""
    total = count * size
    return float(np.exp(np.sqrt(1 + 4 * count + 4 * (count**2 - total**2)) - (1 + 2 * count)))


def _mean(values: FloatArray) -> tuple[float, Interval]:
    """Mean and Student's 95 % interval; without end below three values."""
    if values.size < 3:
        return (float(values.mean()) if values.size else float("nan")), (-np.inf, np.inf)
    reach = float(stats.t.ppf(0.975, values.size - 1) * values.std(ddof=1) / np.sqrt(values.size))
    return float(values.mean()), (float(values.mean()) - reach, float(values.mean()) + reach)


def _halves(timing: Timing, duration: float) -> tuple[Stretch, ...]:
    """Mean offsets of the first and of the second half; those with fewer than three movements are left out."""
    found = []
    for start, end in ((0.0, duration / 2), (duration / 2, duration)):
        inside = (timing.times >= start) & (timing.times < end)
        if inside.sum() >= 3:
            found.append(Stretch(start, end, *_mean(timing.offsets[inside])))
    return tuple(found)


def _score_finding(score: HarmonyScore) -> Finding:
    low, high = score.interval
    about = f"{score.harmony_above_chance:.2f} (0 is chance, 1 is all"
    if not np.isfinite(low):
        return Finding("score", f"Above-chance harmony is {about}; no interval).", score.harmony_above_chance, _NOTHING)
    verdict = "" if low > 0 else ": no evidence that you move with this music" if high >= 0 else ": worse than chance"
    sentence = f"Above-chance harmony is {about}; 95 % interval {low:.2f} to {high:.2f}){verdict}."
    return Finding("score", sentence, score.harmony_above_chance, score.interval)


def _hits_finding(music: BeatTrack, visual: BeatTrack, duration: float, params: HarmonyParams) -> Finding:
    """Share of music beats met, with Wilson's interval, against what chance reaches."""
    times, delay = visual.times - params.lag, params.reaction_delay
    hits = hit_mask(music.times, times, delay=delay, matching=params.matching)
    chance = chance_level(times, delay=delay, duration=duration)
    wilson = stats.binomtest(int(hits.sum()), hits.size).proportion_ci(method="wilson")
    known = f"met {hits.mean():.0%} of them ({wilson.low:.0%} to {wilson.high:.0%})"
    text = f"Chance alone would meet {chance:.0%} of the beats within {delay * 1000:.0f} ms; you {known}"
    if wilson.low <= chance <= wilson.high:
        text += ", which is no evidence of more or less than chance"
    sentence = text.replace("%", " %") + "."
    return Finding("hits", sentence, float(hits.mean()), (float(wilson.low), float(wilson.high)))


def _rate_finding(music: BeatTrack, visual: BeatTrack) -> Finding:
    """Movements a beat: one over the mean step from movement to movement, in beats."""
    mean, (low, high) = _mean(np.diff(beat_positions(visual.times, music)))
    rate, interval = 1 / mean, (1 / high, 1 / low if low > 0 else np.inf)
    near = [name for simple, name in SIMPLE_RATES.items() if interval[0] <= simple <= interval[1] < 1.3 * interval[0]]
    near = near or [name for simple, name in SIMPLE_RATES.items() if abs(rate / simple - 1) < 0.05]
    words = near[0] if near else f"{rate:.1f} movements a beat"
    return Finding("rate", f"You make {words} (95 % interval {interval[0]:.2f} to {interval[1]:.2f}).", rate, interval)


def _unlocked(timing: Timing) -> Finding:
    sentence = (
        f"There is no evidence that your movements keep a place in the beat (p = {timing.p_value:.2g}; below "
        f"{LOCKED:g} is asked for), so nothing can be said about early or late."
    )
    return Finding("locked", sentence, timing.p_value, _NOTHING)


def _timing_findings(timing: Timing, halves: tuple[Stretch, ...], duration: float) -> list[Finding]:
    """Drift, else a change between the halves, else one mean for all."""
    drift = _drift(timing)
    if len(halves) == 2:
        change, interval = _difference(timing, duration)
        if _is_clear(change, interval):
            if _clear_drift(drift, timing) and _line_fits_better(timing, duration):
                return [_drift_finding(drift, halves)]
            return [_change_finding(change, interval, halves)]
    return [_mean_finding(*_mean(timing.offsets))]


def _is_clear(value: float, interval: Interval) -> bool:
    """Whether an interval excludes zero, and the value is large enough to notice."""
    return (interval[0] > 0 or interval[1] < 0) and abs(value) >= SMALLEST


def _difference(timing: Timing, duration: float) -> tuple[float, Interval]:
    """How much later the second half is than the first (Welch)."""
    second = timing.times >= duration / 2
    early, late = timing.offsets[~second], timing.offsets[second]
    spread = float(np.hypot(early.std(ddof=1) / np.sqrt(early.size), late.std(ddof=1) / np.sqrt(late.size)))
    reach = float(stats.t.ppf(0.975, min(early.size, late.size) - 1)) * spread
    change = float(late.mean() - early.mean())
    return change, (change - reach, change + reach)


def _drift(timing: Timing) -> tuple[float, Interval]:
    """Seconds later in each second, by least squares, with Student's interval."""
    line = stats.linregress(timing.times, timing.offsets)
    reach = float(stats.t.ppf(0.975, timing.times.size - 2) * line.stderr)
    return float(line.slope), (float(line.slope) - reach, float(line.slope) + reach)


def _clear_drift(drift: tuple[float, Interval], timing: Timing) -> bool:
    slope, (low, high) = drift
    length = float(np.ptp(timing.times))
    return _is_clear(slope * length, (low * length, high * length))


def _line_fits_better(timing: Timing, duration: float) -> bool:
    """Whether a straight line leaves a tenth less of the offsets unexplained than a step in the middle."""
    second = timing.times >= duration / 2
    step = np.where(second, timing.offsets[second].mean(), timing.offsets[~second].mean())
    line = np.polyval(np.polyfit(timing.times, timing.offsets, 1), timing.times)
    return bool(np.square(timing.offsets - line).sum() < CLEARLY * np.square(timing.offsets - step).sum())


def _side(stretch: Stretch) -> str:
    """A half in words: "80 ms late", or "on time"."""
    if not _is_clear(stretch.mean, stretch.interval):
        return "on time"
    return f"{abs(stretch.mean) * 1000:.0f} ms {'late' if stretch.mean > 0 else 'early'}"


def _range(interval: Interval) -> str:
    return f"95 % interval {interval[0] * 1000:.0f} to {interval[1] * 1000:.0f} ms"


def _mean_finding(mean: float, interval: Interval) -> Finding:
    if _is_clear(mean, interval):
        words = f"You are {abs(mean) * 1000:.0f} ms {'late' if mean > 0 else 'early'} throughout"
    elif abs(mean) < SMALLEST:
        words = f"You are on time: {mean * 1000:.0f} ms from the beat on average"
    else:
        words = f"There is no evidence that you are early or late ({mean * 1000:.0f} ms on average)"
    return Finding("mean", f"{words} ({_range(interval)}).", mean, interval)


def _change_finding(change: float, interval: Interval, halves: tuple[Stretch, ...]) -> Finding:
    first, second = map(_side, halves)
    words = f"You are {second} on the second half and {first} on the first"
    turn = f"{abs(change) * 1000:.0f} ms {'later' if change > 0 else 'earlier'}"
    return Finding("change", f"{words} ({turn}; {_range(interval)}).", change, interval)


def _drift_finding(drift: tuple[float, Interval], halves: tuple[Stretch, ...]) -> Finding:
    slope, (low, high) = drift
    first, second = map(_side, halves)
    clock = f"the recording's clock may run {abs(slope):.1%} {'fast' if slope > 0 else 'slow'}".replace("%", " %")
    sentence = (
        f"Your timing drifts: {first} in the first half, {second} in the second ({slope * 1e4:+.0f} ms in 10 s, 95 % "
        f"interval {low * 1e4:+.0f} to {high * 1e4:+.0f} ms; {clock})."
    )
    return Finding("drift", sentence, slope, drift[1])
