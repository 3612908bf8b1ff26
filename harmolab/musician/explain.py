"""The score of a musician's hands in words: findings, the events at which hands and sound part, stretches of time.

All numbers are those of `harmolab.musician.events`, so that no finding can contradict the score.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, cast

import numpy as np
from scipy.stats import binom

from harmolab.files import named_faults, plain
from harmolab.lab.explain.performance import Explanation, Finding
from harmolab.lab.figures.beats import signed_offsets
from harmolab.musician.events import CERTAIN, PlayingScore, onset_beats, playing_score, scored
from harmolab.musician.performances import Performance
from harmolab.score import HarmonyScore, hit_mask
from harmolab.types import Audio, BeatTrack, Clip, Motion, Notes

STRETCH = 5.0  # seconds
EVENTS = {"piano": "strike", "violin": "turn of the bow"}
MANY_EVENTS = {"piano": "strikes", "violin": "turns of the bow"}
# Above chance, of notes at the onsets of a sound. On planted pieces of 12 s it is 1 with their own sound. Of 160 with
# another sound, or .1 to .5 s beside their own, 92 % are below this and have no evidence.
OWN_SOUND = 0.5
OTHER_SOUND = "Cannot tell: the notes that came with this playing are not those of the sound."

Kind = Literal["missed", "other hand", "stray"]


class Parting(NamedTuple):
    """One moment at which hands and sound part.

    Parameters
    ----------
    kind : "missed", an onset without an event; "other hand", one that only the other hand meets; or "stray", an event
        without an onset
    time : float, seconds of the motion, of the onset or the event
    hand : "left", "right", or "" where it is not known
    distance : float, seconds from the onset to the nearest event of its hand (late is positive), or from the nearest
        onset to the event; NaN where there is none
    """

    kind: Kind
    time: float
    hand: str
    distance: float


class Stretch(NamedTuple):
    """Onsets, those of them that are hit, and events without an onset, in some seconds of the motion."""

    start: float
    end: float
    onsets: int
    hits: int
    strays: int


@dataclass(frozen=True, kw_only=True)
class PlayingFindings(Explanation):
    """A verdict, findings in the order of their sentences, and what they rest on.

    Parameters
    ----------
    verdict : str, one sentence
    findings : tuple of Finding: "notes" (of another sound), "score", "hand", "other hand", "lag", "stretch" and
        "body", where there is one
    partings : tuple of Parting, by time
    stretches : tuple of Stretch, 5 s each
    """

    verdict: str
    partings: tuple[Parting, ...]
    stretches: tuple[Stretch, ...]


@dataclass(frozen=True, eq=False)
class ExplainedPlaying:
    """A performance whose hands were scored with its sound.

    Parameters
    ----------
    performance : Performance, as it was
    motion : Motion, the part of it that has sound
    audio : Audio of that part, or None
    skipped : float, seconds of the motion before that part
    sound : Notes, or BeatTrack of the onsets found in the sound, on the part's time line
    score : PlayingScore
    words : PlayingFindings
    """

    performance: Performance
    motion: Motion
    audio: Audio | None
    skipped: float
    sound: Notes | BeatTrack
    score: PlayingScore
    words: PlayingFindings

    @property
    def summary(self) -> tuple[str, ...]:
        """The verdict, and the sentence of each finding."""
        return (self.words.verdict, *self.words.sentences)

    details: ClassVar[tuple[str, ...]] = ()  # all is said in the summary

    def to_dict(self) -> dict[str, Any]:
        """Numbers and text, ready for JSON."""
        words = {
            "verdict": self.words.verdict,
            "words": list(self.words.sentences),
            "partings": [parting._asdict() for parting in self.words.partings],
            "stretches": [stretch._asdict() for stretch in self.words.stretches],
        }
        about = {"performance": self.performance.name, "source": self.performance.source, "skipped_s": self.skipped}
        return dict(plain(about | self.score.to_dict() | words))


def explain_playing(performance: Performance) -> ExplainedPlaying:
    """Score a musician's performance and explain the score in sentences: do the hands meet the notes?

    The hands are compared with the notes of the performance, or where there are none with the onsets that a program
    finds in its sound. A pianist's notes that do not fit the sound make the verdict, and the first finding.

    Parameters
    ----------
    performance : `harmolab.musician.performances.Performance`
        As `load_performance` or `load_playing` of the same module read it.

    Returns
    -------
    ExplainedPlaying
        `score`, and the verdict and findings in words. `save_playing_page` and `playing_player` show it.

    Raises
    ------
    ValueError
        If it has neither notes nor sound, its motion and sound hardly overlap, it lacks the points of the hands, or it
        is of another kind.
    """
    if not isinstance(performance, Performance):
        raise ValueError(f"a musician's Performance is needed, got {type(performance).__name__}")
    name, motion = performance.name, performance.motion
    if performance.notes is None and performance.audio is None:
        raise ValueError(f"{name}: has neither notes nor sound to compare the hands with; add audio or notes to it")
    clip = Clip(name, performance.audio or _silence(performance), motion, performance.offset)
    shared = clip.shared()
    first, part = clip.shared_frame(), cast(Motion, shared.motion)
    skipped, detected = first / motion.fps, performance.detected[first : first + part.n_frames]
    notes = performance.notes
    whole = onset_beats(cast(Audio, performance.audio)) if notes is None else notes
    sound = whole.span(performance.offset + skipped, part.duration)
    with named_faults(name):
        score = playing_score(part, sound, performance.instrument, detected=detected)
    audio, words = None if performance.audio is None else shared.audio, playing_findings(score)
    if audio is not None and notes is not None and performance.instrument == "piano":  # a bow's onsets are soft
        words = _beside_sound(words, scored(score.score.music, onset_beats(audio)))
    return ExplainedPlaying(performance, part, audio, skipped, sound, score, words)


def _beside_sound(words: PlayingFindings, fit: HarmonyScore) -> PlayingFindings:
    """The words, unless the notes `fit` the onsets of the sound no better than by chance: then this comes first."""
    if not (fit.p_value >= CERTAIN and fit.harmony_above_chance < OWN_SOUND and fit.n_audio):
        return words
    sentence = (
        f"{(fit.pairs >= 0).sum()} of the notes' {fit.n_audio} onsets are at an onset of the sound, no more than by "
        "chance. What follows is of the notes. Are they of this recording, in seconds from its beginning?"
    )
    doubt = Finding("notes", fit.harmony_above_chance, sentence, fit.interval)
    return replace(words, verdict=OTHER_SOUND, findings=(doubt, *words.findings))


def _silence(performance: Performance) -> Audio:
    """Silence as long as notes and motion together, in place of the sound of a performance that has none."""
    notes = cast(Notes, performance.notes)
    seconds = max([performance.offset + performance.motion.duration, *notes.offsets.tolist(), 1.0])
    return Audio(np.zeros(int(np.ceil(100.0 * seconds))), 100.0)


def playing_findings(score: PlayingScore, *, is_filmed: bool = True) -> PlayingFindings:
    """The verdict on a musician's hands in words, and the findings behind it.

    The lag and the worst stretch of time are among them only where there is evidence.

    Parameters
    ----------
    score : PlayingScore
        As of `harmolab.playing_score`.
    is_filmed : bool
        False for hands that were computed from the sound, so that picture and sound cannot begin apart.

    Returns
    -------
    PlayingFindings
    """
    partings = _partings(score)
    stretches = _stretches(score, partings)
    findings = [_score(score), *_hands(score, partings), *_lag(score), *_worst(score, stretches), _body(score)]
    verdict = _verdict(score, is_filmed=is_filmed)
    return PlayingFindings(tuple(findings), verdict=verdict, partings=partings, stretches=stretches)


def _partings(score: PlayingScore) -> tuple[Parting, ...]:
    """Onsets that are missed, by the hand that they belong to where it is known, and events far from any onset."""
    params, onsets = score.score.params, score.score.music.times
    every = score.score.visual.times - params.lag
    rows: list[tuple[Kind, float, str, float]] = []
    for hand, own in (score.hands or {"": score.score}).items():
        missed = own.pairs < 0
        times = own.music.times[missed]
        distances = signed_offsets(own.music.times, own.visual.times - params.lag)[missed]
        met = hit_mask(times, every, delay=params.reaction_delay)
        kinds: list[Kind] = ["other hand" if other else "missed" for other in met]
        rows += zip(kinds, times, itertools.repeat(hand), distances)
    for hand, track in score.events.items():
        times = track.times - params.lag
        stray = ~hit_mask(times, onsets, delay=params.reaction_delay)
        distances = -signed_offsets(times, onsets)[stray]
        rows += zip(itertools.repeat("stray"), track.times[stray], itertools.repeat(hand), distances)
    partings = [Parting(kind, float(time), hand, float(distance)) for kind, time, hand, distance in rows]
    return tuple(sorted(partings, key=lambda parting: (parting.time, parting.hand)))


def _stretches(score: PlayingScore, partings: Sequence[Parting]) -> tuple[Stretch, ...]:
    """Counts of every 5 s; what is left over at the end is a stretch of its own."""
    onsets, hits = score.score.music.times, score.score.music.times[score.score.pairs >= 0]
    strays = [parting.time for parting in partings if parting.kind == "stray"]
    duration = score.score.music.duration
    edges = np.append(np.arange(0.0, duration, STRETCH), duration)
    counts = [np.histogram(times, edges)[0] for times in (onsets, hits, strays)]
    return tuple(
        Stretch(float(start), float(end), *map(int, row))
        for start, end, *row in zip(edges[:-1], edges[1:], *counts, strict=True)
    )


def _verdict(score: PlayingScore, *, is_filmed: bool) -> str:
    whole, events = score.score, MANY_EVENTS[score.instrument]
    if whole.n_audio == 0:
        return "Cannot tell: the sound has no onsets that hands could meet."
    if whole.n_visual == 0:
        return f"Cannot tell: the hands make no {events} that could be read."
    if score.is_together:
        return f"The hands meet the sound: {whole.mean_share:.0%} of it, where {whole.chance:.0%} would be chance."
    if np.isfinite(score.lag.seconds):
        doubt = ": picture and sound may not begin together" if is_filmed else ""
        late = f"{abs(1000 * score.lag.seconds):.0f} ms {'late' if score.lag.seconds > 0 else 'early'}"
        return f"The hands meet the sound {late}{doubt}."
    return "There is no evidence that these hands play this sound."


def _score(score: PlayingScore) -> Finding:
    whole, event = score.score, EVENTS[score.instrument]
    low, high = whole.interval
    spread = "" if np.isnan(low) else f", {low:.2f} to {high:.2f}"
    sentence = (
        f"{int((whole.pairs >= 0).sum())} of {whole.n_audio} onsets have a {event} within "
        f"{1000 * whole.params.reaction_delay:.0f} ms. Weighed by loudness that is {whole.mean_share:.0%}, and "
        f"{whole.chance:.0%} at random moments: {whole.harmony_above_chance:.2f} above chance (0 is chance, 1 is every "
        f"onset{spread}{_evidence(whole)})."
    )
    return Finding("score", whole.harmony_above_chance, sentence, whole.interval)


def _evidence(score: HarmonyScore) -> str:
    """The p-value for a sentence, "" where there is none."""
    return "" if np.isnan(score.p_value) else f"; p = {score.p_value:.3f}"


def _hands(score: PlayingScore, partings: Sequence[Parting]) -> list[Finding]:
    """Each hand with its own notes, and the notes that only the other hand meets."""
    events = MANY_EVENTS[score.instrument]
    findings = []
    for hand, own in score.hands.items():
        strays, every = sum(each.kind == "stray" and each.hand == hand for each in partings), len(score.events[hand])
        sentence = (
            f"The {hand} hand meets {int((own.pairs >= 0).sum())} of its {own.n_audio} onsets "
            f"({own.harmony_above_chance:.2f} above chance); {strays} of its {every} {events} are at no onset."
        )
        findings.append(Finding("hand", own.harmony_above_chance, sentence, own.interval))
    if count := sum(parting.kind == "other hand" for parting in partings):
        words = "onset is" if count == 1 else "onsets are"
        findings.append(Finding("other hand", float(count), f"{count} {words} met by the other hand alone."))
    return findings


def _lag(score: PlayingScore) -> list[Finding]:
    """The lag of the hands as a whole."""
    seconds, (low, high), share, _ = score.lag
    if np.isnan(seconds):
        return []
    spread = "" if np.isnan(low) else f" ({round(1000 * low):+d} to {round(1000 * high):+d} ms)"
    sentence = (
        f"As a whole the hands move {round(1000 * seconds):+d} ms from the onsets, where + is late{spread}; "
        f"at the best lag {share:.0%} are met."
    )
    return [Finding("lag", seconds, sentence, (low, high))]


def _worst(score: PlayingScore, stretches: Sequence[Stretch]) -> list[Finding]:
    """The stretch that meets fewer onsets than the others by more than luck (binomial, Bonferroni)."""
    total = sum(stretch.onsets for stretch in stretches)
    if not score.is_together or total == 0:
        return []
    rate = sum(stretch.hits for stretch in stretches) / total
    p_values = [len(stretches) * float(binom.cdf(stretch.hits, stretch.onsets, rate)) for stretch in stretches]
    worst = stretches[int(np.argmin(p_values))]
    if not min(p_values) < CERTAIN:
        return []
    hits = f"{worst.hits} of {worst.onsets} onsets are met"
    sentence = f"The hands meet least from {worst.start:.0f} to {worst.end:.0f} s: {hits}."
    return [Finding("stretch", worst.hits / worst.onsets, sentence)]


def _body(score: PlayingScore) -> Finding:
    body = score.body
    sentence = (
        f"The speed of the whole body, by which dances are scored, is {body.harmony_above_chance:.2f} above chance "
        f"(0 is chance{_evidence(body)})."
    )
    return Finding("body", body.harmony_above_chance, sentence, body.interval)
