"""Findings behind a verdict: the number, the tempo, the lag and its change, beats met. Each of them is one sentence.

All numbers are those of the judgement, so that no finding can contradict the headline. Early, late and milliseconds
are spoken of only where the judgement places the movement in the beat (levels 3 and 4), and not at all where the
dance's place in its song is known modulo the beat only. Spreads are from bar to bar: they say how steady a take is, and
are no evidence that its place in the beat is more than luck.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from harmolab.harmony import chance_level
from harmolab.types import BeatTrack
from harmolab.verdict.judge import Judgement
from harmolab.verdict.place_test import PlaceTest, place_test
from harmolab.verdict.score import HarmonyScore

SMALLEST = 0.02  # seconds; smaller changes are not noticed
FEWEST = 8  # beats in a half: two blocks that can be drawn from
EVENTS = ("rest", "hit")  # readings whose events are a score's visual beats
Interval = tuple[float, float]
NOTHING: Interval = (float("nan"), float("nan"))


class MeanOffset(NamedTuple):
    """Lag (seconds, late is positive) between two times, with its spread from bar to bar."""

    start: float
    end: float
    mean: float
    interval: Interval


@dataclass(frozen=True)
class Finding:
    """One statistic of a dance, and its sentence.

    Parameters
    ----------
    kind : "score", "tempo", "rate", "lag", "change" or "hits"
    value : float
        Harmony above chance; p-value of the time test; movements a beat; seconds late; seconds later in the second
        half; share of beats met.
    sentence : str
    interval : (float, float), spread of the value from bar to bar; NaN where there is none
    """

    kind: str
    value: float
    sentence: str
    interval: Interval = NOTHING


@dataclass(frozen=True)
class Explanation:
    """Findings in the order of their sentences, and the lag of each half where lags are spoken of."""

    findings: tuple[Finding, ...] = ()
    halves: tuple[MeanOffset, ...] = field(default=(), kw_only=True)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The sentence of each finding."""
        return tuple(finding.sentence for finding in self.findings)

    def relative(self) -> Explanation:
        """The findings that hold for a dance whose place in the song is known modulo the beat only."""
        kept = tuple(one for one in self.findings if one.kind in ("tempo", "rate", "change"))
        return replace(self, findings=kept, halves=())

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def explain(score: HarmonyScore) -> Explanation:
    """The findings about a score.

    Parameters
    ----------
    score : HarmonyScore by ``HarmonyParams.recommended()``

    Returns
    -------
    Explanation; without findings where there is too little to judge (level 0).

    Raises
    ------
    ValueError
        The score has no judgement: its measure is not "shape".

    Examples
    --------
    >>> from harmolab import HarmonyParams, score_clip, synthetic_clip
    >>> words = explain(score_clip(synthetic_clip("rumba", seconds=24.0, seed=3), HarmonyParams.recommended()))
    >>> [finding.kind for finding in words.findings]
    ['score', 'tempo', 'rate', 'lag', 'hits']
    """
    judgement = score.judgement
    if judgement is None:
        raise ValueError(f"words need a score of measure 'shape', got {score.params.measure!r}")
    if judgement.place is None:
        return Explanation()
    findings = [*_score(judgement), _tempo(judgement)]
    if judgement.level >= 2:
        findings.append(_rate(judgement))
    if judgement.level < 3:
        return Explanation(tuple(findings))
    halves = _half_lags(judgement)
    findings += [*_lag(judgement), *_change(halves), *_hits(score)]
    return Explanation(tuple(findings), halves=halves if judgement.pattern else ())


def _score(judgement: Judgement) -> list[Finding]:
    """The number, where a place can be judged."""
    if not judgement.is_placed:
        return []
    value, (low, high) = judgement.harmony_above_chance, judgement.interval
    spread = "" if np.isnan(low) else f"; {low:.2f} to {high:.2f} from bar to bar"
    sentence = (
        f"Harmony above chance is {value:.2f} (0 is a random phase, 1 the best moment of the take on every beat"
        f"{spread})."
    )
    return [Finding("score", value, sentence, judgement.interval)]


def _tempo(judgement: Judgement) -> Finding:
    """The share of tempi that fit as well as the music's."""
    share, tempo = 100 * judgement.p_time, judgement.tempo
    sentence = (
        f"Of the tempi around the music's {tempo:.1f} bpm, {share:.1f} % fit your movement as well (the limit is 5 %)."
    )
    return Finding("tempo", judgement.p_time, sentence)


def _rate(judgement: Judgement) -> Finding:
    rate = float(judgement.time.rate) if judgement.time else np.nan
    return Finding("rate", rate, f"Movements a beat: {rate:.2g}.")


def _lag(judgement: Judgement) -> list[Finding]:
    """The lag, where it was told from what."""
    if judgement.pattern is None:
        return []
    low, high = (edge * 60 / judgement.tempo for edge in judgement.lag_interval)
    spread = "" if np.isnan(low) else f" ({1000 * low:+.0f} to {1000 * high:+.0f} ms from bar to bar)"
    sentence = f"Your lag, late counted positive, is {1000 * judgement.lag_s:+.0f} ms{spread}."
    return [Finding("lag", judgement.lag_s, sentence, (low, high))]


def _half_lags(judgement: Judgement) -> tuple[MeanOffset, ...]:
    """The lag of the first and of the second half; none where a half has too few beats."""
    beats, signal, pattern = judgement.beats, judgement.signal, judgement.pattern
    second = beats.times >= (beats.times[0] + beats.times[-1]) / 2
    halves = beats.select(~second), beats.select(second)
    if signal is None or judgement.place is None or min(map(len, halves)) <= max(FEWEST, judgement.place.pattern.beats):
        return ()
    places = (None, None) if pattern is None else tuple(half.bar_places for half in halves)
    reading = judgement.place.pattern
    tests = [place_test(signal, half.times, at, reading) for half, at in zip(halves, places, strict=True)]
    return tuple(_mean_offset(judgement, half, test) for half, test in zip(halves, tests, strict=True))


def _mean_offset(judgement: Judgement, beats: BeatTrack, test: PlaceTest) -> MeanOffset:
    """The lag of a stretch of beats, of all places that are one the nearest to the lag of the whole."""
    period = 60 / judgement.tempo
    lag = judgement.lag + _wrapped(test.lag - judgement.lag, test.reach)
    low, high = (edge - test.lag + lag for edge in test.spread()[1])
    return MeanOffset(float(beats.times[0]), float(beats.times[-1]), lag * period, (low * period, high * period))


def _wrapped(lag: float, reach: float) -> float:
    """A lag within +- reach beats, beyond which it is another beat's."""
    return (lag + reach) % (2 * reach) - reach


def _change(halves: tuple[MeanOffset, ...]) -> list[Finding]:
    """The change of the lag between the halves, where their spreads from bar to bar do not meet."""
    if not halves:
        return []
    first, second = halves
    change = second.mean - first.mean
    interval = second.interval[0] - first.interval[1], second.interval[1] - first.interval[0]
    if abs(change) < SMALLEST or not (interval[0] > 0 or interval[1] < 0):
        return []
    words = f"{abs(change) * 1000:.0f} ms {'later' if change > 0 else 'earlier'}"
    return [Finding("change", change, f"In the second half you are {words} than in the first.", interval)]


def _hits(score: HarmonyScore) -> list[Finding]:
    """The share of beats with a rest, or a hit, close by, against chance; for those who are there on the beat."""
    judgement, delay = score.judgement, score.params.reaction_delay
    if judgement is None or judgement.level < 4 or judgement.reading not in EVENTS:
        return []
    times = score.visual.times - score.params.lag
    chance = chance_level(times, delay=delay, duration=score.music.duration)
    met = int((score.pairs >= 0).sum())
    sentence = (
        f"{met} of {len(score.music)} beats have a {judgement.reading} within {1000 * delay:.0f} ms; at random "
        f"moments it would be {100 * chance:.0f} % of them."
    )
    return [Finding("hits", met / len(score.music), sentence)]
