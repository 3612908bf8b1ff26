"""The evidence behind a verdict: a movement, its beats and the two tests, as numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from harmolab.params import HOW_PATTERNS, BarPattern
from harmolab.shape_speed import ShapeSignal
from harmolab.types import BeatTrack
from harmolab.verdict.course import Course, beat_course
from harmolab.verdict.place_test import PlaceTest
from harmolab.verdict.time_test import TimeTest

LEAST_PULSE = 0.03  # per second: 2 cm/s for an adult
LEAST_SWING = 0.02  # metres a second, where fewer than three points have no size to compare with
LEAST_SHARE = 0.1  # of the movement in the room, in 3-D; a picture cannot tell a turning statue from a dancer
CLEAR = 8.0  # z of a tempo that is the body's own: noise reaches 5 to 8, dancers 10 to 47
STEADY = 0.25  # beats: half the width of a steady lag's interval
ON_THE_BEAT = 0.125  # beats
LEAST_POWER = 0.01  # of the strongest rate's: runners at another rate have .0003 at most, dancers on the beat .03 up
NAN = float("nan")
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The numbers of a verdict; those that do not exist are NaN.

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
        return bool(self.time and self.place and has_rate(self.time, self.place.pattern))

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


def floor(signal: ShapeSignal) -> str:
    """The reason why there is too little movement to judge; "" where there is enough."""
    if signal.dimensions == 3 and signal.share < LEAST_SHARE:
        return "you only turn and travel"
    is_still = signal.pulse < LEAST_PULSE or (signal.is_point and signal.swing < LEAST_SWING)
    return "too little movement inside the body" if is_still else ""


def has_rate(time: TimeTest, pattern: BarPattern) -> bool:
    """True where some of the power on which the blocks agree is at the rates of the pattern."""
    rates = {Fraction(h, pattern.beats) for h in range(1, len(pattern.cosines) + 1)}
    power = sum(time.rates.get(rate, 0.0) for rate in rates)
    return power >= LEAST_POWER * max(time.rates.values())
