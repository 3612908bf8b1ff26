"""The sentences of a verdict: one line, three lines at most below it (`remarks`), and all others (`details`).

Sentences are made from the fields of an `Evidence`. "Late" and "early" are said only where a dance, or what is meant on
the beat, was told. Where nothing was told, resting on the beat, hitting it and arriving on it may each be meant, and
the sentence says when the body is fastest and stillest.
"""

from fractions import Fraction
from typing import Literal

import numpy as np

from harmolab.params import HOW_PATTERNS
from harmolab.verdict.evidence import ALPHA, BESIDE, FEWEST_BEATS, MOMENTS, ON_THE_BEAT, STEP, Evidence, has_rate

MOSTLY_TRAVELS, FEW_JOINTS = 0.25, 0.1  # shares below which it is remarked: a hand may drum
FASTEST = 240.0  # beats a minute: music that is counted faster is none
FEW_BEATS = 48  # about half of the recorded dancers pass the time test with so many
TOLD = {"rest": "you rest on it", "hit": "you hit it", "half time": "you rest on every second one"}
PLACES = {"rest": "a rest on the beat", "hit": "a hit on the beat", "half time": "a rest on every second beat"}
RATES = {
    Fraction(1): "once a beat",
    Fraction(1, 2): "once in two beats (half time)",
    Fraction(2): "twice a beat (double time, or to and fro once a beat)",
}
# Movements a beat where trackers take a tempo for another one.
COUNTED = {2: "the sound does not tell that from"} | dict.fromkeys(map(Fraction, ("2/3", "3/2", "4/3")), "if you count")
NAMED = (Fraction(1, 2), Fraction(2))  # rates at which one may be on the beat, and that are named with it
UNPLACED = (
    "You are in time with this song. Where in its beat you dance cannot be told from your movement alone: say where "
    "the dance begins (--offset), or film with the song playing."
)
OFF_BEATS = "If the off-beats were counted, you are on the beat: hear them (`harmolab beats --clicks`)."
MEANT = " If you mean to hit it, say so (--how hit)."
HIT = "In time: you are fastest on the beat (a hit). If you meant to rest on it, you are half a beat off."


def verdict(evidence: Evidence) -> str:
    """The level in a sentence or two, and where it does not hold: parts of the take, beats without movement."""
    words = (_cannot_tell, _no_sign, _no_place, _in_time, _on_the_beat)[evidence.level]
    return words(evidence) + (elsewhere(evidence) + stillness(evidence) if evidence.level else "")


def elsewhere(evidence: Evidence) -> str:
    """A sentence on parts of the take that are otherwise than the whole, in minutes and seconds of the take."""
    clocks = [["{}:{:02}".format(*divmod(round(edge), 60)) for edge in part] for part in evidence.other_parts]
    if not clocks:
        return ""
    *before, last = (f"from {start} to {end}" for start, end in clocks)
    parts = f"{', '.join(before)} and {last}" if before else last
    moves = f" {parts.capitalize()} you move at another tempo than the music's."
    return f" But part by part you are in time {parts}." if evidence.level == 1 else moves


def stillness(evidence: Evidence) -> str:
    """A sentence where the body stands still on more than a tenth of the beats, since a held pose tells nothing."""
    still, beats = evidence.n_still, len(evidence.beats)
    if 10 * still <= beats:
        return ""
    return f" On about {still} of {beats} beats you stand still or move evenly; only the others tell."


def _cannot_tell(evidence: Evidence) -> str:
    if evidence.floor:
        return f"Cannot tell: {evidence.floor}."
    if not evidence.beats.times.size:
        return "Cannot tell: this music has no beat where you dance, or no sound."
    count = evidence.n_beats
    if count >= FEWEST_BEATS and not evidence.beats.is_sure:
        return "Cannot tell: the beats found in this music are unsure, since its sound does not keep to them."
    return f"Cannot tell: {count} {'beat is' if count == 1 else 'beats are'} too few; {FEWEST_BEATS} are needed."


def _no_sign(evidence: Evidence) -> str:
    # Who slips by part of a beat is in time on either side, and has the tempo of the music.
    own, least = evidence.own_tempo, BESIDE * STEP if evidence.other_parts else 0.0
    words = f" Your own tempo is {own:.1f} bpm, the music's {evidence.tempo:.1f}."
    return f"No sign that you follow this beat.{words if abs(own / evidence.tempo - 1) > least else ''}"


def _no_place(evidence: Evidence) -> str:
    return "You keep its tempo, but no steady place in the beat." if evidence.has_own_rate else _other_rate(evidence)


def _other_rate(evidence: Evidence) -> str:
    rate = evidence.time.rate if evidence.time else Fraction(1)
    return f"In time{'' if rate in RATES else ', but not with each beat'}: you move {_times(rate)}."


def _in_time(evidence: Evidence) -> str:
    if not evidence.has_start:
        return UNPLACED
    # A waltz's threes hold rates that have no place in the beat, such as 2 movements in 3 beats.
    moves = evidence.time is not None and has_rate(evidence.time, HOW_PATTERNS["rest"])
    if not (evidence.has_own_rate and (evidence.pattern or moves)):
        return _other_rate(evidence)
    if evidence.pattern is None:
        fastest, stillest = _moment_of(evidence, "fastest", "the beat"), _moment_of(evidence, "stillest", "it")
        return HIT if evidence.is_hit else f"In time: you are {fastest}, and {stillest}."
    if abs(evidence.lag) <= ON_THE_BEAT or evidence.lag_interval[0] <= 0 <= evidence.lag_interval[1]:
        return "In time. Whether you are on the beat cannot be told: other places in it fit as well."
    return f"You keep time, steadily {_late_or_early(evidence)} for {_danced(evidence)}."


def _on_the_beat(evidence: Evidence) -> str:
    if evidence.pattern is None:
        if evidence.reading == "waltz":
            return "You are on the beat: you move in threes, as in a waltz."
        rate = evidence.time.rate if evidence.time else Fraction(1)
        moving = f", moving {_times(rate)}" if rate in NAMED else ""
        return f"You are on the beat{moving}: slow on it, {_moment_of(evidence, 'fastest', 'it')}."
    movement = TOLD.get(evidence.reading, f"you move as in {_danced(evidence)}")
    return f"You are on the beat: {movement} ({_late_or_early(evidence)})."


def _moment_of(evidence: Evidence, extreme: Literal["fastest", "stillest"], beat: str) -> str:
    """When in the beat the body is fastest or stillest: on it, to the nearest 24th of a beat, or before or after it."""
    place = getattr(evidence.course, extreme, 0.0)
    if min(place, 1 - place) < 1 / 24:
        return f"{extreme} on {beat}"
    away, side = (1 - place, "before") if place > 0.75 else (place, "after")
    return f"{extreme} {away * 60000 / evidence.tempo:.0f} ms {side} {beat}"


def _late_or_early(evidence: Evidence) -> str:
    if evidence.is_opposite:
        return "half a beat off"
    return f"{abs(evidence.lag_s) * 1000:.0f} ms {'early' if evidence.lag < 0 else 'late'}"


def _danced(evidence: Evidence) -> str:
    """The dance with its article, the place that was told, or the pattern."""
    name = evidence.reading
    article = "an" if name[:1] in "aeiou" else "a"
    return PLACES.get(name, "this pattern" if name == "pattern" else f"{article} {name}")


def _times(rate: Fraction) -> str:
    """Movements a beat in words: "once a beat", "4 times in 3 beats"."""
    times = "once" if rate.numerator == 1 else f"{rate.numerator} times"
    return RATES.get(rate, f"{times} in {rate.denominator} beats")


def remarks(evidence: Evidence) -> tuple[str, ...]:
    """Three sentences at most: how sure the verdict is, how steady the lag, and what would help or is to be known."""
    return tuple(line for line in (_sure(evidence), _steady(evidence), *_more(evidence)[:1]) if line)


def details(evidence: Evidence) -> tuple[str, ...]:
    """The sentences for which `remarks` has no room."""
    return tuple(_more(evidence)[1:])


def moments_after_beat(evidence: Evidence) -> dict[str, float]:
    """Seconds after the beat at which the body is fastest and stillest; NaN at level 0."""
    course, beat = evidence.course, 60 / evidence.tempo
    moments = (np.nan, np.nan) if course is None else (course.fastest * beat, course.stillest * beat)
    return dict(zip(("fastest_after_beat_s", "stillest_after_beat_s"), moments, strict=True))


def _sure(evidence: Evidence) -> str:
    p, number = evidence.p_time, evidence.harmony_above_chance
    if np.isnan(p):
        return ""
    harmony = "" if np.isnan(number) else f"harmony above chance {number:.2f} (0 is luck, 1 the most); "
    return f"How sure: {harmony}{p:.1%} of other tempi fit as well (p = {p:.3f}; in time is {ALPHA:g} or less)."


def _steady(evidence: Evidence) -> str:
    low, high = evidence.lag_interval
    if evidence.level == 2 and evidence.has_own_rate:
        return "How steady: your place in the beat moves so much that its mean is not known to half a beat."
    if evidence.level < 3 or not evidence.has_own_rate or np.isnan(low) or not evidence.has_start:
        return ""
    width = max(high - low, 1 / MOMENTS) * 60000 / evidence.tempo
    return f"How steady: by all bars together your mean place in the beat is known to within {width:.0f} ms."


def _more(evidence: Evidence) -> list[str]:
    """Caveats and advice, the most important first."""
    signal, lines = evidence.signal, [*_caveats(evidence), *_advice(evidence)]
    if signal is not None and signal.dimensions == 0 and evidence.time:
        size = "" if signal.axes == 3 else "; how large the movement is cannot be known"
        lines.append(f"Only how fast you move was read, no shape: flow and fewer than three points have none{size}.")
    return lines


def _caveats(evidence: Evidence) -> list[str]:
    """Sentences on weak evidence: unsure beats, a body that mostly travels, few joints, other rates, a picture."""
    signal, time, lines = evidence.signal, evidence.time, list[str]()
    if signal is None or time is None:
        return lines
    if not evidence.beats.is_sure:
        lines.append("The beats found in this music are unsure, since its sound often does not keep to them.")
    if signal.share < MOSTLY_TRAVELS:
        lines.append(f"You mostly turn and travel: {signal.share:.0%} of the movement is inside the body.")
    if signal.joints < FEW_JOINTS:
        lines.append(f"Few joints move: all of the movement is that of {signal.joints:.0%} of them.")
    lines += _of_rate(evidence, time.rate)
    if evidence.level == 2 and evidence.keeps_the_beat:
        lines.append("Your place in the beat is steady, but not at one beat of the bar: it goes from one to another.")
    if signal.dimensions == 2:
        hidden = "A picture hides about every fourth dancer who keeps time: a body in space shows more."
        lines.append(hidden if evidence.level == 1 else "In a picture, a turning statue cannot be told from a dancer.")
    return lines


def _of_rate(evidence: Evidence, rate: Fraction) -> list[str]:
    """One line at most: how often the body moves, and how the music may be counted otherwise."""
    words = [_other_count(evidence, rate)]
    if evidence.level > 2 and evidence.has_own_rate and rate in NAMED:
        unlike = "Moments in the beat are means of two unlike beats." if rate < 1 else ""
        words = [f"You move {RATES[rate]}." if evidence.level == 3 else "", unlike, *words]
    return [line] if (line := " ".join(filter(None, words))) else []


def _other_count(evidence: Evidence, rate: Fraction) -> str:
    """A sentence where tracked beats, counted otherwise, would be those of a movement of this rate; else ""."""
    if evidence.beats.quality is None or evidence.level not in (2, 3):
        return ""
    if evidence.pattern is None and rate in COUNTED and (other := round(float(rate) * evidence.tempo)) <= FASTEST:
        mend = "say the dance (--dance), or tap the beats (`harmolab beats --tap`)"
        return f"The music was counted at {evidence.tempo:.0f} bpm; {COUNTED[rate]} {other}: {mend}."
    is_off = evidence.level == 3 and evidence.has_start and (evidence.is_opposite or evidence.is_hit)
    return f"{OFF_BEATS}{MEANT if evidence.is_hit else ''}" if is_off else ""


def _advice(evidence: Evidence) -> list[str]:
    """Ways to learn more than this verdict says."""
    lines: list[str] = []
    if evidence.level == 4 or evidence.floor or (evidence.level == 3 and not evidence.has_start):
        return lines
    if evidence.level == 0 and evidence.n_beats >= FEWEST_BEATS:
        return ["What would help: tap the beats of this song (`harmolab beats --tap`), and give them (--beats)."]
    if evidence.moves_in_half_time:
        half = f"count this music at {evidence.tempo / 2:.0f} bpm, not {evidence.tempo:.0f}, or"
        lines.append(f'What would help: say so if you {half} mean to rest on every second beat (--how "half time").')
    if evidence.pattern is None and evidence.level == 3 and evidence.has_own_rate:
        lines.append("What would help: say the dance (--dance waltz), or what you mean to do on the beat (--how hit).")
    if evidence.pattern and evidence.beats.bar_places is None and evidence.pattern.beats > 1:
        lines.append(
            'Where "one" is was not known, so the place in the bar did not count (--one, or `harmolab beats --tap`).'
        )
    if FEWEST_BEATS <= evidence.n_beats < FEW_BEATS:
        lines.append(f"A longer take would show more: this one has {evidence.n_beats} beats, {FEW_BEATS} say enough.")
    if evidence.pattern is None and evidence.level in (1, 2) and not evidence.moves_in_half_time:
        hear = "hear the counted beats (`harmolab beats --clicks`), or " if evidence.beats.quality is not None else ""
        lines.append(f"What would help: {hear}say the dance, where its usual course is known (--dance).")
    return lines
