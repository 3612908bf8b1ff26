"""One verdict on a movement and its beats: five levels, from the floor, the time test and the place test.

=====  =============================================================================================================
level  when
=====  =============================================================================================================
0      cannot tell: too little movement inside the body, the body only turns and travels, fewer than 16 beats, or no
       sign of beats that the sound does not keep to
1      no sign that the movement follows these beats (time test, p > .05)
2      the tempo is kept, but the lag wanders by more than a quarter of a beat to either side
3      in time, and not shown to be on the beat
4      on the beat: a steady lag of an eighth of a beat at most, harmony above 0 from bar to bar, a place that no more
       than a quarter of the other lags would do as well as (place test, p <= .25), and a movement that has the rate of
       the beats
=====  =============================================================================================================

A dance, or how it is danced, may be told (`pattern`): then its place is asked for. With nothing told there is one
reading, which the movement's own metre picks: the waltz's curve where it recurs most clearly every three beats, else a
rest on each beat. Neither half of that choice looks at the phase. Who is at rest on the beat is on it; who is fastest
on it, or arrives on it and stands, may mean to be there, and hears what was seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from harmolab.beats.meter import cycle_of_meter
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern
from harmolab.shape_speed import ShapeSignal, ShapeSpeed, shape_signal
from harmolab.types import BeatTrack
from harmolab.verdict import sentences
from harmolab.verdict.course import Course, beat_course
from harmolab.verdict.place_test import PlaceTest, place_test
from harmolab.verdict.time_test import ALPHA, FEWEST_BEATS, TimeTest, time_test

LEAST_PULSE = 0.03  # per second: 2 cm/s for an adult
LEAST_SWING = 0.02  # metres a second, where fewer than three points have no size to compare with
LEAST_SHARE = 0.1  # of the movement in the room, in 3-D; a picture cannot tell a turning statue from a dancer
CLEAR = 8.0  # z of a tempo that is the body's own: noise reaches 5 to 8, dancers 10 to 47
STEADY = 0.25  # beats: half the width of a steady lag's interval
ON_THE_BEAT = 0.125  # beats
MOST_PLACES = 0.25  # share of the lags that may do as well: those within an eighth of a beat to either side
LEAST_POWER = 0.01  # of the strongest rate's: runners at another rate have .0003 at most, dancers on the beat .03 up
NAN = float("nan")
Interval = tuple[float, float]
LEVELS = ("cannot tell", "no sign", "in time, no steady place", "in time", "on the beat")  # in a few words


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict and its evidence; numbers that do not exist are NaN, sentences are made from the fields.

    Parameters
    ----------
    level : int, 0 to 4
    beats : BeatTrack
    pattern : BarPattern that was told: of the dance, or one of `HOW_PATTERNS`; None where nothing was
    signal : ShapeSignal, None with fewer than two beats
    time, place : TimeTest and PlaceTest, None at level 0
    interval, lag_interval : (float, float)
        Spread of the place test's H and of the lag (beats) from bar to bar, 95 %: how steady the take is, no evidence
        against luck.
    """

    level: int
    beats: BeatTrack
    pattern: BarPattern | None = None
    signal: ShapeSignal | None = None
    time: TimeTest | None = None
    place: PlaceTest | None = None
    interval: Interval = (NAN, NAN)
    lag_interval: Interval = (NAN, NAN)

    @property
    def n_beats(self) -> int:
        """Number of beats at which the body is seen: those in filler frames do not count."""
        if self.signal is None or self.signal.times.size == 0:
            return len(self.beats)
        return int((np.interp(self.beats.times, self.signal.times, self.signal.valid) >= 0.5).sum())

    @property
    def is_placed(self) -> bool:
        """True where the place in the beat can be judged: it was told, or the movement is on the beat by what it is."""
        return self.place is not None and (self.pattern is not None or self.level == 4)

    @property
    def harmony_above_chance(self) -> float:
        """H of the place test, in [-1, 1]; NaN where no place can be judged."""
        return self.place.harmony_above_chance if self.place and self.is_placed else NAN

    @property
    def place_harmony(self) -> float:
        """H of the place test also where no place can be judged, for means over many dances; NaN at level 0."""
        return self.place.harmony_above_chance if self.place else NAN

    @property
    def harmony_interval(self) -> Interval:
        """Spread of H from bar to bar; NaN where no place can be judged."""
        return self.interval if self.is_placed else (NAN, NAN)

    @property
    def p_time(self) -> float:
        """p-value of the time test, the one that decides whether the movement is in time."""
        return self.time.p_value if self.time else NAN

    @property
    def p_place(self) -> float:
        """p-value of the place test."""
        return self.place.p_value if self.place else NAN

    @property
    def p_value(self) -> float:
        """p-value of H; NaN where no place can be judged."""
        return self.p_harmony if self.is_placed else NAN

    @property
    def p_harmony(self) -> float:
        """The larger of both p-values, since harmony is the tempo and the place: that of `place_harmony`."""
        return max(self.p_time, self.p_place)

    @cached_property
    def tempo(self) -> float:
        """Tempo of the music, beats per minute."""
        return self.beats.tempo

    @property
    def own_tempo(self) -> float:
        """Tempo of the movement in beats per minute; NaN where it has no clear one."""
        return self.tempo * self.time.own_ratio if self.time and self.time.best >= CLEAR else NAN

    @property
    def lag(self) -> float:
        """Lag after the reading, beats; late is positive."""
        return self.place.lag if self.place else NAN

    @property
    def lag_s(self) -> float:
        """Lag after the reading, seconds."""
        return self.lag * 60 / self.tempo

    @property
    def reading(self) -> str:
        """Name of what the place is measured from: a dance, "rest", "hit" or "half time"; "" at level 0."""
        if self.place is None:
            return ""
        pattern = self.place.pattern
        return pattern.dance or (pattern.source if pattern.source in HOW_PATTERNS else "pattern")

    @property
    def has_own_rate(self) -> bool:
        """True where what recurs has the rate of the reading, not only another one, as of 4 movements in 3 beats."""
        return bool(self.time and self.place and _has_rate(self.time, self.place.pattern))

    @cached_property
    def course(self) -> Course | None:
        """The mean movement from one beat to the next; None at level 0."""
        return beat_course(self.signal, self.beats.times) if self.signal and self.time else None

    @property
    def floor(self) -> str:
        """The reason why there is too little movement to judge; "" where there is enough, or nothing was seen."""
        return floor(self.signal) if self.signal else ""

    @property
    def is_near(self) -> bool:
        """True where the lag is an eighth of a beat at most."""
        return abs(self.lag) <= ON_THE_BEAT

    @property
    def keeps_the_beat(self) -> bool:
        """True where the lag is steady once it is looked for within half a beat only, not in the whole bar."""
        if self.place is None or self.place.reach <= 0.5:
            return False
        low, high = replace(self.place, reach=0.5).spread()[1]
        return high - low <= 2 * STEADY

    @property
    def is_hit(self) -> bool:
        """True where the movement is in time and fastest on the beat.

        Who arrives on the beat in a tenth of a second and stands is fastest an eighth of a beat before it.
        """
        if self.level < 3 or self.course is None or not self.has_own_rate:
            return False
        return min(self.course.fastest, 1 - self.course.fastest) <= ON_THE_BEAT / 2

    @property
    def verdict(self) -> str:
        """The level in a sentence or two."""
        return sentences.verdict(self)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Three sentences at most to read below the verdict: how sure it is, how steady, what would help."""
        return sentences.remarks(self)

    @property
    def details(self) -> tuple[str, ...]:
        """All else there is to say: for those who want to know more."""
        return sentences.details(self)

    def to_dict(self) -> dict[str, Any]:
        """The numbers and sentences, for JSON."""
        names = ("level", "verdict", "remarks", "details", "p_time", "p_place", "lag_s", "tempo", "own_tempo")
        numbers = {name: getattr(self, name) for name in (*names, "reading")}
        interval = tuple(edge * 60 / self.tempo for edge in self.lag_interval)
        parts = {name: getattr(self.signal, name, NAN) for name in ("pulse", "share", "joints")}
        seen = {"rate": float(self.time.rate) if self.time else NAN} | sentences.seen(self)
        return numbers | {"lag_interval_s": interval} | seen | parts


def judge(shape: ShapeSpeed, beats: BeatTrack, *, pattern: BarPattern | None = None, seed: int = 0) -> Judgement:
    """The verdict on a movement and the beats it is danced to, on one time line.

    Parameters
    ----------
    shape : ShapeSpeed of the motion
    beats : BeatTrack
        All count alike; only the movement between the first and the last is looked at.
    pattern : BarPattern of the dance, one of `HOW_PATTERNS`, or None
        None takes the reading that the movement's own metre picks.
    seed : int, of the spread from bar to bar
    """
    if len(beats) < 2:
        return Judgement(0, beats, pattern)
    signal = shape_signal(shape, beats.times[0], beats.times[-1])
    nothing = Judgement(0, beats, pattern, signal)
    if nothing.n_beats < FEWEST_BEATS or floor(signal):
        return nothing
    time = time_test(signal, beats.times, cycles=cycles_of(beats, pattern))
    place = placed(signal, beats, pattern or own_reading(time), is_told=pattern is not None)
    interval, lags = place.spread(seed=seed)
    level = level_of(time, place, interval, lags)
    if level == 1 and not beats.is_sure:
        return nothing
    return Judgement(level, beats, pattern, signal, time, place, interval, lags)


def cycles_of(beats: BeatTrack, pattern: BarPattern | None) -> tuple[int, ...]:
    """Beats after which a movement may recur: one, and the cycle of the dance or of the bar; up to three if unknown."""
    if pattern is not None:
        return tuple(sorted({1, pattern.beats}))
    if beats.bar_places is None:
        return (1, 2, 3)
    return tuple(sorted({1, cycle_of_meter(int(beats.bar_places.max()) + 1)}))


def own_reading(time: TimeTest) -> BarPattern:
    """What a movement is asked for when nothing is told: the waltz's curve in three, else a rest on each beat."""
    return DANCE_PATTERNS["waltz"] if time.metre == 3 else HOW_PATTERNS["rest"]


def placed(signal: ShapeSignal, beats: BeatTrack, pattern: BarPattern, *, is_told: bool) -> PlaceTest:
    """The place test of a pattern; a bar counts only where the dance was told."""
    return place_test(signal, beats.times, beats.bar_places if is_told else None, pattern)


def floor(signal: ShapeSignal) -> str:
    """The reason why there is too little movement to judge; "" where there is enough."""
    if signal.dimensions == 3 and signal.share < LEAST_SHARE:
        return "you only turn and travel"
    is_still = signal.pulse < LEAST_PULSE or (signal.is_point and signal.swing < LEAST_SWING)
    return "too little movement inside the body" if is_still else ""


def level_of(time: TimeTest, place: PlaceTest, interval: Interval, lags: Interval) -> int:
    """The level of a movement above the floor."""
    if not time.p_value <= ALPHA:
        return 1
    if lags[1] - lags[0] > 2 * STEADY:
        return 2
    is_near = abs(place.lag) <= ON_THE_BEAT and place.harmony_above_chance > 0 and interval[0] > 0
    return 4 if is_near and place.p_value <= MOST_PLACES and _has_rate(time, place.pattern) else 3


def _has_rate(time: TimeTest, pattern: BarPattern) -> bool:
    """True where some of the power on which the blocks agree is at the rates of the pattern."""
    rates = {Fraction(h, pattern.beats) for h in range(1, len(pattern.cosines) + 1)}
    power = sum(time.rates.get(rate, 0.0) for rate in rates)
    return power >= LEAST_POWER * max(time.rates.values())
