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

from dataclasses import dataclass
from typing import Any

from harmolab.beats.meter import cycle_of_meter
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern
from harmolab.shape_speed import ShapeSignal, ShapeSpeed, shape_signal
from harmolab.types import BeatTrack
from harmolab.verdict import sentences
from harmolab.verdict.evidence import NAN, ON_THE_BEAT, STEADY, Evidence, Interval, floor, has_rate
from harmolab.verdict.place_test import PlaceTest, place_test
from harmolab.verdict.time_test import ALPHA, FEWEST_BEATS, TimeTest, time_test

MOST_PLACES = 0.25  # share of the lags that may do as well: those within an eighth of a beat to either side
LEVELS = ("cannot tell", "no sign", "in time, no steady place", "in time", "on the beat")  # in a few words


@dataclass(frozen=True, eq=False)
class Judgement(Evidence):
    """A verdict in words, made from its evidence."""

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
        rate = {"rate": float(self.time.rate) if self.time else NAN} | sentences.moments_after_beat(self)
        return numbers | {"lag_interval_s": interval} | rate | parts


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
    """The pattern that is asked for when nothing is told: the waltz's curve in three, else a rest on each beat."""
    return DANCE_PATTERNS["waltz"] if time.metre == 3 else HOW_PATTERNS["rest"]


def placed(signal: ShapeSignal, beats: BeatTrack, pattern: BarPattern, *, is_told: bool) -> PlaceTest:
    """The place test of a pattern; a bar counts only where the dance was told."""
    return place_test(signal, beats.times, beats.bar_places if is_told else None, pattern)


def level_of(time: TimeTest, place: PlaceTest, interval: Interval, lags: Interval) -> int:
    """The level of a movement above the floor."""
    if not time.p_value <= ALPHA:
        return 1
    if lags[1] - lags[0] > 2 * STEADY:
        return 2
    is_near = abs(place.lag) <= ON_THE_BEAT and place.harmony_above_chance > 0 and interval[0] > 0
    return 4 if is_near and place.p_value <= MOST_PLACES and has_rate(time, place.pattern) else 3
