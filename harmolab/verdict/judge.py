"""One verdict on a movement and its beats: five levels, in words, from the floor, the time test and the place test.

=====  =============================================================================================================
level  when
=====  =============================================================================================================
0      cannot tell: too little movement inside the body, the body only turns and travels, or fewer than 16 beats
1      no sign that the movement follows these beats (time test, p > .05)
2      the tempo is kept, but the lag wanders by more than a quarter of a beat to either side
3      in time, at a steady lag of more than an eighth of a beat
4      on the beat
=====  =============================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from harmolab.beats.meter import cycle_of_meter
from harmolab.params import BarPattern
from harmolab.shape_speed import ShapeSignal, ShapeSpeed, shape_signal
from harmolab.types import BeatTrack
from harmolab.verdict.place_test import PlaceTest, place_test
from harmolab.verdict.time_test import TimeTest, time_test

FEWEST_BEATS = 16
LEAST_PULSE = 0.03  # per second: 2 cm/s for an adult
LEAST_SHARE = 0.1  # of the movement in the room, in 3-D; a picture cannot tell a turning statue from a dancer
ALPHA = 0.05
CLEAR = 8.0  # z of a tempo that is the body's own: noise reaches 5 to 8, dancers 10 to 47
STEADY = 0.25  # beats: half the width of a steady lag's interval
ON_THE_BEAT = 0.125  # beats
ANYWHERE = 0.45  # beats: nine tenths of the half beat between rest and hit
MOSTLY_TRAVELS, FEW_JOINTS = 0.25, 0.1  # shares below which it is remarked: a hand may drum
FEW_BEATS = 48  # about half of the recorded dancers pass the time test with so many
NAN = float("nan")
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Judgement:
    """A verdict and its evidence; numbers that do not exist are NaN, sentences are made from the fields.

    Parameters
    ----------
    level : int, 0 to 4
    beats : BeatTrack
    pattern : BarPattern of the dance, or None where rest, hit and half time were tried
    signal : ShapeSignal, None with fewer than two beats
    time, place : TimeTest and PlaceTest, None at level 0
    interval, lag_interval : (float, float)
        Spread of H and of the lag (beats) from bar to bar, 95 %: how steady the take is, no evidence against luck.
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
    def harmony_above_chance(self) -> float:
        """H of the place test, in [-1, 1]; NaN at level 0."""
        return self.place.harmony_above_chance if self.place else NAN

    @property
    def p_time(self) -> float:
        """p-value of the time test."""
        return self.time.p_value if self.time else NAN

    @property
    def p_place(self) -> float:
        """p-value of the place test."""
        return self.place.p_value if self.place else NAN

    @property
    def p_value(self) -> float:
        """The larger of both, which is that of H: harmony is the tempo and the place."""
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
        """Name of the reading that fits best at the lag: a dance, "rest", "hit" or "half time"; "" at level 0."""
        if self.place is None:
            return ""
        return self.place.reading.source if self.pattern is None else self.pattern.dance or "pattern"

    @property
    def verdict(self) -> str:
        """The level in a sentence or two."""
        return _VERDICTS[self.level](self)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences to read beside the verdict, and ways to learn more."""
        return tuple(_remarks(self))

    def to_dict(self) -> dict[str, Any]:
        """The numbers and sentences, for JSON."""
        names = ("level", "verdict", "remarks", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "reading")
        numbers = {name: getattr(self, name) for name in names}
        interval = tuple(edge * 60 / self.tempo for edge in self.lag_interval)
        parts = {name: getattr(self.signal, name, NAN) for name in ("pulse", "share", "joints")}
        return numbers | {"lag_interval_s": interval} | parts


def judge(shape: ShapeSpeed, beats: BeatTrack, *, pattern: BarPattern | None = None, seed: int = 0) -> Judgement:
    """The verdict on a movement and the beats it is danced to, on one time line.

    Parameters
    ----------
    shape : ShapeSpeed of the motion
    beats : BeatTrack
        All count alike; only the movement between the first and the last is looked at.
    pattern : BarPattern of the dance, or None
        None asks whether the body rests on the beats, hits them, or rests on every second one.
    seed : int, of the spread from bar to bar
    """
    if len(beats) < 2:
        return Judgement(0, beats, pattern)
    signal = shape_signal(shape, beats.times[0], beats.times[-1])
    nothing = Judgement(0, beats, pattern, signal)
    if nothing.n_beats < FEWEST_BEATS or floor(signal):
        return nothing
    time = time_test(signal, beats.times, cycles=_cycles(beats, pattern))
    place = place_test(signal, beats.times, beats.bar_places, pattern)
    interval, lags = place.spread(seed=seed)
    return Judgement(_level(time, place.lag, lags), beats, pattern, signal, time, place, interval, lags)


def _cycles(beats: BeatTrack, pattern: BarPattern | None) -> tuple[int, ...]:
    """Beats after which a movement may recur: one, and the cycle of the dance or of the bar; up to three if unknown."""
    if pattern is not None:
        return tuple(sorted({1, pattern.beats}))
    if beats.bar_places is None:
        return (1, 2, 3)
    return tuple(sorted({1, cycle_of_meter(int(beats.bar_places.max()) + 1)}))


def floor(signal: ShapeSignal) -> str:
    """The reason why there is too little movement to judge; "" where there is enough."""
    if signal.dimensions == 3 and signal.share < LEAST_SHARE:
        return "you only turn and travel"
    return "too little movement inside the body" if signal.pulse < LEAST_PULSE else ""


def _level(time: TimeTest, lag: float, lags: Interval) -> int:
    """The level of a movement above the floor."""
    if not time.p_value <= ALPHA:
        return 1
    if lags[1] - lags[0] > 2 * STEADY:
        return 2
    return 3 if abs(lag) > ON_THE_BEAT else 4


# Sentences: all of them are below, made from the fields of a judgement.


def _cannot_tell(judgement: Judgement) -> str:
    if judgement.signal is not None and (reason := floor(judgement.signal)):
        return f"Cannot tell: {reason}."
    count = judgement.n_beats
    return f"Cannot tell: {count} {'beat is' if count == 1 else 'beats are'} too few; {FEWEST_BEATS} are needed."


def _no_sign(judgement: Judgement) -> str:
    own = judgement.own_tempo
    words = "" if np.isnan(own) else f" Your own tempo is {own:.1f} bpm, the music's {judgement.tempo:.1f}."
    return f"No sign that you follow this beat.{words}"


def _no_place(judgement: Judgement) -> str:
    return "You keep its tempo, but no steady place."


def _steadily(judgement: Judgement) -> str:
    steadily = "" if _is_anywhere(judgement) else "steadily "
    place = "a rest or a hit on the beat" if judgement.pattern is None else _dance(judgement)
    return f"You keep time, {steadily}{_late_or_early(judgement)} for {place}."


def _is_anywhere(judgement: Judgement) -> bool:
    """True where a lag of rest or hit takes nearly all the half beat there is for it from bar to bar.

    It may wander as much as a lag of level 2: within a quarter of a beat to either side that cannot be seen.
    """
    low, high = judgement.lag_interval
    return judgement.pattern is None and bool(high - low >= ANYWHERE)


def _on_the_beat(judgement: Judgement) -> str:
    movement = _MOVEMENTS.get(judgement.reading, f"you move as in {_dance(judgement)}")
    return f"You are on the beat: {movement} ({_late_or_early(judgement)})."


def _late_or_early(judgement: Judgement) -> str:
    return f"{abs(judgement.lag_s) * 1000:.0f} ms {'early' if judgement.lag < 0 else 'late'}"


def _dance(judgement: Judgement) -> str:
    """The dance with its article, or the pattern."""
    name = judgement.reading
    return "this pattern" if name == "pattern" else f"{'an' if name[:1] in 'aeiou' else 'a'} {name}"


_VERDICTS = (_cannot_tell, _no_sign, _no_place, _steadily, _on_the_beat)
_MOVEMENTS = {"rest": "you rest on it", "hit": "you hit it", "half time": "you rest on every second one"}
_RATES = {0.5: "You move in half time: once in two beats.", 2.0: "You move in double time: twice a beat."}


def _remarks(judgement: Judgement) -> list[str]:
    """The remarks of `Judgement.remarks`."""
    remarks = []
    signal, level = judgement.signal, judgement.level
    if signal is not None and judgement.time is not None:
        if signal.share < MOSTLY_TRAVELS:
            remarks.append(f"You mostly turn and travel: {signal.share:.0%} of the movement is inside the body.")
        if signal.joints < FEW_JOINTS:
            remarks.append(f"Few joints move: all of it is the movement of {signal.joints:.0%} of them.")
        if signal.dimensions == 2:
            remarks.append("In a picture, a statue that turns cannot be told from a dancer.")
        if signal.dimensions == 0:
            remarks.append("Fewer than three points have no shape: their speed in the room was read.")
    if level == 2 and judgement.place is not None and judgement.place.reach > 0.5 and _keeps_the_beat(judgement.place):
        remarks.append("Your place in the beat is steady; the beat of the bar that it belongs to is not.")
    if level >= 2 and judgement.time is not None and judgement.time.rate in _RATES:
        remarks.append(_RATES[judgement.time.rate])
    if level >= 3 and _is_anywhere(judgement):
        remarks.append("That is the mean: from bar to bar you are anywhere between rest and hit.")
    if level >= 3 and judgement.pattern is None:
        remarks.append("A rest half a beat late is a hit on the beat: movement alone cannot tell which is meant.")
    return remarks + _advice(judgement)


def _keeps_the_beat(place: PlaceTest) -> bool:
    """True where the lag is steady once it is looked for within half a beat only, not in the whole bar."""
    low, high = replace(place, reach=0.5).spread()[1]
    return high - low <= 2 * STEADY


def _advice(judgement: Judgement) -> list[str]:
    """Ways to learn more than this verdict says."""
    advice: list[str] = []
    if judgement.level == 4 or (judgement.signal is not None and floor(judgement.signal)):
        return advice
    if FEWEST_BEATS <= judgement.n_beats < FEW_BEATS:
        advice.append(f"A longer take would show more: it has {judgement.n_beats} beats, {FEW_BEATS} say enough.")
    if judgement.pattern is None:
        advice.append("The name of the dance would show more, where its pattern is known (--dance).")
    elif judgement.beats.bar_places is None and judgement.pattern.beats > 1:
        advice.append('Where "one" is was not known: the place in the bar could not count (--one, or `harmolab tap`).')
    return advice
