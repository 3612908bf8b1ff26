"""The verdict on a dance: records of beats met, of movements a beat, of early and late, and each of them in words.

Every finding rests on one statistic with a 95 % interval; its sentence is made from the record here and nowhere else,
and claims something only where that interval excludes zero (or what chance would reach).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from harmolab.bar_pattern import beat_positions
from harmolab.harmony import chance_level
from harmolab.lab.timing.findings import (
    SMALLEST,
    Interval,
    MeanOffset,
    Timing,
    beat_timing,
    drift,
    half_difference,
    half_means,
    is_clear,
    line_fits_better,
)
from harmolab.significance import mean_interval, wilson_interval
from harmolab.types import BeatTrack, HarmonyScore

FEWEST = 6  # beats on either side, below which nothing is said
LOCKED = 0.001  # p-value below which movements keep a place in the beat; beats are not independent, so a strict one
SIMPLE_RATES = {0.25: "one movement every four beats", 0.5: "one movement every two beats", 1.0: "one movement a beat",
                2.0: "two movements a beat"}  # fmt: skip
NOTHING = (float("nan"), float("nan"))


@dataclass(frozen=True)
class Finding:
    """One statistic of a dance and what it was compared with; `sentence` and `summary` are made from these fields.

    Parameters
    ----------
    kind : "score", "hits", "rate", "locked", "mean", "change" or "drift"
    value : float
        Above-chance harmony; share of beats met (NaN: too few beats); movements a beat; p-value; seconds late; seconds
        later in the second half; seconds a second.
    interval : (float, float), 95 %; NaN for a p-value
    counts : (int, int), music beats and movements, of "hits"
    chance, delay : float, share of beats that random moments meet within so many seconds, of "hits"
    halves : tuple of MeanOffset, first and second half, of "change" and "drift"
    is_absolute : bool
        False: the dance's place in the song is known modulo the beat only, so nothing is said about early or late.
    """

    kind: str
    value: float
    interval: Interval = NOTHING
    counts: tuple[int, int] = (0, 0)
    chance: float = float("nan")
    delay: float = float("nan")
    halves: tuple[MeanOffset, ...] = ()
    is_absolute: bool = True

    @property
    def is_missing(self) -> bool:
        """True where there were too few beats for a value."""
        return bool(np.isnan(self.value))

    @property
    def sentence(self) -> str:
        """The finding in words, with its interval."""
        return _SENTENCES[self.kind](self)

    @property
    def summary(self) -> str:
        """Early or late in a few words, without numbers beyond the offset; for "mean", "change" and "drift"."""
        return _SUMMARIES[self.kind](self) + "."


@dataclass(frozen=True)
class Explanation:
    """Findings in the order of their sentences, and the mean offset of each half where there is one."""

    findings: tuple[Finding, ...]
    halves: tuple[MeanOffset, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """The sentence of each finding."""
        return tuple(finding.sentence for finding in self.findings)

    @property
    def is_steady(self) -> bool:
        """True where movements keep a place in the beat, so that the last finding is about early and late."""
        return self.findings[-1].kind in _SUMMARIES

    def relative(self) -> Explanation:
        """The same findings for a dance whose place in the song is known modulo the beat only."""
        return replace(self, findings=tuple(replace(finding, is_absolute=False) for finding in self.findings))

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def explain(score: HarmonyScore) -> Explanation:
    """Findings about a score, and those of `explain_timing`."""
    interval = score.interval if np.isfinite(score.interval[0]) else NOTHING
    timing = explain_timing(score)
    return replace(timing, findings=(Finding("score", score.harmony_above_chance, interval), *timing.findings))


def explain_timing(score: HarmonyScore) -> Explanation:
    """Findings about the beats of a score: how many are met, movements a beat, earliness or lateness.

    Returns
    -------
    Explanation; one finding without a value when there are too few beats to say anything.

    Examples
    --------
    >>> times = np.arange(1, 21) * 0.5
    >>> music, late = (BeatTrack(times + delay, np.ones(20), 100.0, 11.0) for delay in (0.0, 0.08))
    >>> score = score_harmony(music, late, params=HarmonyParams.valleys(), n_rotations=0)
    >>> print(explain_timing(score).sentences[-1])
    You are 80 ms late throughout (95 % interval 80 to 80 ms).
    """
    music, visual, duration = score.music, score.visual, score.music.duration
    if min(len(music), len(visual)) < FEWEST:
        return Explanation((Finding("hits", float("nan"), counts=(len(music), len(visual))),))
    findings = _hits(score), _rate(music, visual)
    timing = beat_timing(music, visual, lag=score.params.lag)
    if timing.p_value > LOCKED:
        return Explanation((*findings, Finding("locked", timing.p_value)))
    halves = half_means(timing, duration)
    return Explanation((*findings, _early_or_late(timing, halves, duration)), halves)


def _hits(score: HarmonyScore) -> Finding:
    """Share of music beats met, with Wilson's interval, against what chance reaches."""
    hits, delay = score.pairs >= 0, score.params.reaction_delay
    chance = chance_level(score.visual.times - score.params.lag, delay=delay, duration=score.music.duration)
    interval = wilson_interval(int(hits.sum()), hits.size)
    return Finding("hits", float(hits.mean()), interval, (len(score.music), len(score.visual)), chance, delay)


def _rate(music: BeatTrack, visual: BeatTrack) -> Finding:
    """Movements a beat: one over the mean step from movement to movement, in beats."""
    mean, low, high = mean_interval(np.diff(beat_positions(visual.times, music)))
    return Finding("rate", 1 / mean, (1 / high, 1 / low if low > 0 else np.inf))


def _early_or_late(timing: Timing, halves: tuple[MeanOffset, ...], duration: float) -> Finding:
    """The drift, else the change between the halves, else one mean for all."""
    if len(halves) == 2:
        change, interval = half_difference(timing, duration)
        if is_clear(change, interval):
            slope, (low, high) = drift(timing)
            length = float(np.ptp(timing.times))
            if is_clear(slope * length, (low * length, high * length)) and line_fits_better(timing, duration):
                return Finding("drift", slope, (low, high), halves=halves)
            return Finding("change", change, interval, halves=halves)
    mean, low, high = mean_interval(timing.offsets)
    return Finding("mean", mean, (low, high))


# Sentences: all of them are below, made from the fields of a finding.


def _side(seconds: float) -> str:
    """An offset in words: "80 ms late"."""
    return f"{abs(seconds) * 1000:.0f} ms {'late' if seconds > 0 else 'early'}"


def _half(half: MeanOffset) -> str:
    """The side of one half of a dance, or "on time"."""
    return _side(half.mean) if is_clear(half.mean, half.interval) else "on time"


def _range(interval: Interval) -> str:
    return f"95 % interval {interval[0] * 1000:.0f} to {interval[1] * 1000:.0f} ms"


def _percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"


def _score_sentence(finding: Finding) -> str:
    start = f"Above-chance harmony is {finding.value:.2f} (0 is chance, 1 is all; "
    low, high = finding.interval
    if np.isnan(low):
        return f"{start}no interval)."
    verdict = "" if low > 0 else ": no evidence that you move with this music" if high >= 0 else ": worse than chance"
    return f"{start}95 % interval {low:.2f} to {high:.2f}){verdict}."


def _hits_sentence(finding: Finding) -> str:
    if finding.is_missing:
        beats, movements = finding.counts
        return f"There are {beats} music beats and {movements} movements: too few to say anything about timing."
    low, high = finding.interval
    doubt = ", which is no evidence of more or less than chance" if low <= finding.chance <= high else ""
    return (
        f"Chance alone would meet {_percent(finding.chance)} of the beats within {finding.delay * 1000:.0f} ms; you "
        f"met {_percent(finding.value)} of them ({_percent(low)} to {_percent(high)}){doubt}."
    )


def _rate_sentence(finding: Finding) -> str:
    rate, (low, high) = finding.value, finding.interval
    names = [name for simple, name in SIMPLE_RATES.items() if low <= simple <= high < 1.3 * low]
    names += [name for simple, name in SIMPLE_RATES.items() if abs(rate / simple - 1) < 0.05]
    words = names[0] if names else f"{rate:.1f} movements a beat"
    return f"You make {words} (95 % interval {low:.2f} to {high:.2f})."


def _locked_sentence(finding: Finding) -> str:
    return (
        f"There is no evidence that your movements keep a place in the beat (p = {finding.value:.2g}; below "
        f"{LOCKED:g} is asked for), so nothing can be said about early or late."
    )


def _mean_words(finding: Finding) -> tuple[str, str]:
    """The claim, and the number that belongs to it."""
    if is_clear(finding.value, finding.interval):
        return f"You are {_side(finding.value)} throughout", ""
    average = f"{finding.value * 1000:.0f} ms"
    if abs(finding.value) < SMALLEST:
        return "You are on time", f": {average} from the beat on average"
    return "There is no evidence that you are early or late", f" ({average} on average)"


def _mean_sentence(finding: Finding) -> str:
    if finding.is_absolute:
        return f"{''.join(_mean_words(finding))} ({_range(finding.interval)})."
    return (
        "You keep the same place in the beat throughout. Whether that is early or late cannot be told from your "
        "movement alone: give the offset."
    )


def _mean_summary(finding: Finding) -> str:
    return _mean_words(finding)[0] if finding.is_absolute else "You keep the same place in its beat throughout"


def _turn(finding: Finding) -> str:
    return f"{abs(finding.value) * 1000:.0f} ms {'later' if finding.value > 0 else 'earlier'}"


def _change_sentence(finding: Finding) -> str:
    if finding.is_absolute:
        return f"{_change_summary(finding)} ({_turn(finding)}; {_range(finding.interval)})."
    return f"You are {_turn(finding)} on the second half than on the first ({_range(finding.interval)})."


def _change_summary(finding: Finding) -> str:
    if finding.is_absolute:
        first, second = map(_half, finding.halves)
        return f"You are {second} on the second half and {first} on the first"
    return f"In the second half you are {_turn(finding)} than in the first"


def _drift_sentence(finding: Finding) -> str:
    slope, (low, high) = finding.value, finding.interval
    first, second = map(_half, finding.halves)
    numbers = (
        f"{slope * 1e4:+.0f} ms in 10 s, 95 % interval {low * 1e4:+.0f} to {high * 1e4:+.0f} ms; the recording's clock "
        f"may run {_percent(abs(slope), 1)} {'fast' if slope > 0 else 'slow'}"
    )
    if finding.is_absolute:
        return f"Your timing drifts: {first} in the first half, {second} in the second ({numbers})."
    return f"Your timing drifts: {numbers}."


def _drift_summary(finding: Finding) -> str:
    drift = f"{abs(finding.value) * 10_000:.0f} ms every ten seconds"
    return f"You fall behind by {drift}" if finding.value > 0 else f"You run ahead by {drift}"


_SENTENCES = {
    "score": _score_sentence, "hits": _hits_sentence, "rate": _rate_sentence, "locked": _locked_sentence,
    "mean": _mean_sentence, "change": _change_sentence, "drift": _drift_sentence,
}  # fmt: skip
_SUMMARIES = {"mean": _mean_summary, "change": _change_summary, "drift": _drift_summary}
