"""What people are told: the verdict in one line, three lines below it, and all else for those who ask.

Sentences are made from the fields of a `Judgement`. Late and early are said only against what was told: without a dance
an arrival, a hit and a rest are places of their own, and what is said is when the body is fastest and stillest.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from harmolab.verdict.course import MOMENTS
from harmolab.verdict.time_test import ALPHA, FEWEST_BEATS

if TYPE_CHECKING:
    from harmolab.verdict.judge import Judgement

MOSTLY_TRAVELS, FEW_JOINTS = 0.25, 0.1  # shares below which it is remarked: a hand may drum
FEW_BEATS = 48  # about half of the recorded dancers pass the time test with so many
TOLD = {"rest": "you rest on it", "hit": "you hit it", "half time": "you rest on every second one"}
PLACES = {"rest": "a rest on the beat", "hit": "a hit on the beat", "half time": "a rest on every second beat"}
RATES = {
    Fraction(1): "once a beat",
    Fraction(1, 2): "once in two beats (half time)",
    Fraction(2): "twice a beat (double time, or to and fro once a beat)",
}
NAMED = (Fraction(1, 2), Fraction(2))  # rates at which one may be on the beat, and that are named with it
HIT = "In time: you are fastest on the beat (a hit). If you meant to rest on it, you are half a beat late."


def verdict(judgement: Judgement) -> str:
    """The level in a sentence or two."""
    return (_cannot_tell, _no_sign, _no_place, _in_time, _on_the_beat)[judgement.level](judgement)


def _cannot_tell(judgement: Judgement) -> str:
    if judgement.floor:
        return f"Cannot tell: {judgement.floor}."
    count = judgement.n_beats
    if count >= FEWEST_BEATS and not judgement.beats.is_sure:
        return "Cannot tell: the beats found in this music are unsure, since its sound does not keep to them."
    return f"Cannot tell: {count} {'beat is' if count == 1 else 'beats are'} too few; {FEWEST_BEATS} are needed."


def _no_sign(judgement: Judgement) -> str:
    own = judgement.own_tempo
    words = "" if np.isnan(own) else f" Your own tempo is {own:.1f} bpm, the music's {judgement.tempo:.1f}."
    return f"No sign that you follow this beat.{words}"


def _no_place(judgement: Judgement) -> str:
    return "You keep its tempo, but no steady place in the beat." if judgement.has_own_rate else _other_rate(judgement)


def _other_rate(judgement: Judgement) -> str:
    rate = judgement.time.rate if judgement.time else Fraction(1)
    return f"In time{'' if rate in RATES else ', but not with each beat'}: you move {_times(rate)}."


def _in_time(judgement: Judgement) -> str:
    if not judgement.has_own_rate:
        return _other_rate(judgement)
    if judgement.pattern is None:
        return HIT if judgement.is_hit else f"In time: you are {_fastest(judgement)}, and {_stillest(judgement)}."
    if judgement.is_near:
        return "In time. Whether you are on the beat cannot be told: other places in it fit as well."
    return f"You keep time, steadily {_late_or_early(judgement)} for {_danced(judgement)}."


def _on_the_beat(judgement: Judgement) -> str:
    if judgement.pattern is None:
        if judgement.reading == "waltz":
            return "You are on the beat: you move in threes, as in a waltz."
        rate = judgement.time.rate if judgement.time else Fraction(1)
        moving = f", moving {_times(rate)}" if rate in NAMED else ""
        return f"You are on the beat{moving}: slow on it, {_fastest(judgement, 'it')}."
    told = TOLD.get(judgement.reading, f"you move as in {_danced(judgement)}")
    return f"You are on the beat: {told} ({_late_or_early(judgement)})."


def _fastest(judgement: Judgement, beat: str = "the beat") -> str:
    return f"fastest {_after(judgement, judgement.course.fastest if judgement.course else 0.0, beat)}"


def _stillest(judgement: Judgement) -> str:
    return f"stillest {_after(judgement, judgement.course.stillest if judgement.course else 0.0, 'it')}"


def _after(judgement: Judgement, place: float, beat: str) -> str:
    """When in the beat something happens: on it, to the nearest 24th of a beat, or after it."""
    if min(place, 1 - place) < 1 / 24:
        return f"on {beat}"
    away, side = (1 - place, "before") if place > 0.75 else (place, "after")
    return f"{away * 60000 / judgement.tempo:.0f} ms {side} {beat}"


def _late_or_early(judgement: Judgement) -> str:
    return f"{abs(judgement.lag_s) * 1000:.0f} ms {'early' if judgement.lag < 0 else 'late'}"


def _danced(judgement: Judgement) -> str:
    """The dance with its article, the place that was told, or the pattern."""
    name = judgement.reading
    return PLACES.get(name) or (
        "this pattern" if name == "pattern" else f"{'an' if name[:1] in 'aeiou' else 'a'} {name}"
    )


def _times(rate: Fraction) -> str:
    """How often the body moves: "once a beat", "4 times in 3 beats"."""
    times = "once" if rate.numerator == 1 else f"{rate.numerator} times"
    return RATES.get(rate, f"{times} in {rate.denominator} beats")


def remarks(judgement: Judgement) -> tuple[str, ...]:
    """Three sentences at most: how sure, how steady, what would help or what else to know."""
    lines = [_sure(judgement), _steady(judgement), *_more(judgement)[:1]]
    return tuple(line for line in lines if line)


def details(judgement: Judgement) -> tuple[str, ...]:
    """What `remarks` has no room for."""
    return tuple(_more(judgement)[1:])


def seen(judgement: Judgement) -> dict[str, float]:
    """Seconds after the beat at which the body is fastest and stillest; NaN at level 0."""
    course, beat = judgement.course, 60 / judgement.tempo
    moments = (np.nan, np.nan) if course is None else (course.fastest * beat, course.stillest * beat)
    return dict(zip(("fastest_after_beat_s", "stillest_after_beat_s"), moments, strict=True))


def _sure(judgement: Judgement) -> str:
    p, number = judgement.p_time, judgement.harmony_above_chance
    if np.isnan(p):
        return ""
    harmony = "" if np.isnan(number) else f"harmony above chance {number:.2f} (0 is luck, 1 the most); "
    return f"How sure: {harmony}{p:.1%} of other tempi fit as well (p = {p:.3f}; in time is {ALPHA:g} or less)."


def _steady(judgement: Judgement) -> str:
    low, high = judgement.lag_interval
    if judgement.level >= 2 and not judgement.has_own_rate:
        return ""
    if judgement.level == 2:
        return "How steady: your place in the beat moves by more than half a beat."
    if judgement.level < 2 or np.isnan(low):
        return ""
    width = max(high - low, 1 / MOMENTS) * 60000 / judgement.tempo
    return f"How steady: from bar to bar your place in the beat moves within {width:.0f} ms."


def _more(judgement: Judgement) -> list[str]:
    """Caveats and advice, the weightiest first."""
    return [*_caveats(judgement), *_advice(judgement)]


def _caveats(judgement: Judgement) -> list[str]:
    """What the verdict rests on, where that is little or unusual."""
    signal, time, lines = judgement.signal, judgement.time, list[str]()
    if signal is None or time is None:
        return lines
    if not judgement.beats.is_sure:
        lines.append("The beats found in this music are unsure, since its sound does not keep to all of them.")
    if signal.share < MOSTLY_TRAVELS:
        lines.append(f"You mostly turn and travel: {signal.share:.0%} of the movement is inside the body.")
    if signal.joints < FEW_JOINTS:
        lines.append(f"Few joints move: all of it is the movement of {signal.joints:.0%} of them.")
    if judgement.level == 3 and judgement.has_own_rate and time.rate in NAMED:
        lines.append(f"You move {RATES[time.rate]}.")
    if judgement.level == 2 and judgement.keeps_the_beat:
        lines.append("Your place in the beat is steady; the beat of the bar that it belongs to is not.")
    if signal.dimensions == 2:
        lines.append("In a picture, a statue that turns cannot be told from a dancer.")
    if signal.dimensions == 0:
        size = "" if signal.axes == 3 else "; how large the movement is cannot be known"
        lines.append(f"Fewer than three points were read, not a body: they have no shape, but a speed{size}.")
    return lines


def _advice(judgement: Judgement) -> list[str]:
    """Ways to learn more than this verdict says."""
    lines: list[str] = []
    if judgement.level == 4 or judgement.floor:
        return lines
    if judgement.pattern is None and judgement.level == 3 and judgement.has_own_rate:
        lines.append("What would help: say the dance (--dance waltz), or what you mean to do on the beat (--how hit).")
    if judgement.pattern and judgement.beats.bar_places is None and judgement.pattern.beats > 1:
        lines.append('Where "one" is was not known: the place in the bar could not count (--one, or `harmolab tap`).')
    if FEWEST_BEATS <= judgement.n_beats < FEW_BEATS:
        lines.append(f"A longer take would show more: it has {judgement.n_beats} beats, {FEW_BEATS} say enough.")
    if judgement.pattern is None and judgement.level in (1, 2):
        lines.append("What would help: the name of the dance, where its usual course is known (--dance).")
    return lines
