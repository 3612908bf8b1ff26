"""All that `harmolab dance` says of a dance: whether it moves like people, how it was joined, how it fits the music."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from harmolab.cli.common import show

if TYPE_CHECKING:
    from harmolab.metrics.likeness import Likeness
    from harmolab.systems.choreographer.choreography import Choreography
    from harmolab.types import BeatTrack, Motion
    from harmolab.verdict.score import HarmonyScore

NAMED = 6  # recordings that are named on the screen and on the page; the others are counted
UNSURE = "laid on beats that a program found, which are unsure here"
ADVICE = "(--"  # begins the option that a remark advises
JOINED = (
    *("mean_seam_cm", "worst_seam_cm", "distinct_minutes", "longest_stretch", "seen_before"),
    *("shares", "stretch", "warnings", "pieces"),
)
LIKENESS = ("verdict", "passed", "fails", "values", "recorded")


@dataclass(frozen=True, eq=False)
class DanceReport:
    """A dance and what is known about it.

    Parameters
    ----------
    seed : int that it was made with
    motion : Motion
    start : float, seconds, audio time of its first frame
    music : BeatTrack on the motion's time line
    score : HarmonyScore of both
    likeness : Likeness of the motion
    choreography : Choreography, None where it was not made of recordings
    remarks : sentences about the dancer, and about the music where it was asked which dance that is
    knows_bars : bool, whether it is of use to be told the dance, or where its bars begin
    dance_probabilities : dance -> how likely the music is one, None where that was not asked
    """

    seed: int
    motion: Motion
    start: float
    music: BeatTrack
    score: HarmonyScore
    likeness: Likeness
    choreography: Choreography | None = None
    remarks: tuple[str, ...] = ()
    knows_bars: bool = True
    dance_probabilities: Mapping[str, float] | None = None

    @cached_property
    def has_harmony(self) -> bool:
        """True unless the dance fails by likeness: its harmony would mean nothing."""
        return self.likeness.passed is not False

    @property
    def caption(self) -> str:
        """The words on a dance that does not pass by likeness, whose harmony is not told alone; "" on one that does."""
        return "" if self.likeness.passed else " ".join(self._judged)

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences: likeness; harmony, if likeness does not fail; what else there is to say."""
        return (*self._judged, *self.notes)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Sentences that go with the numbers: of the score, the dancer, and the choice of movement."""
        judgement = self.score.judgement if self.has_harmony else None
        remarks = () if judgement is None else judgement.remarks
        sentences = [remark for remark in remarks if self.knows_bars or ADVICE not in remark]
        sentences += self.remarks
        sentences += () if self.choreography is None else self.choreography.warnings
        return tuple(map(sentence, sentences))

    @cached_property
    def _judged(self) -> tuple[str, ...]:
        """Likeness, and harmony where it means something."""
        judgement = self.score.judgement if self.has_harmony else None
        is_sure = judgement is None or judgement.beats.is_sure
        harmony = () if judgement is None else (judgement.verdict if is_sure else UNSURE,)
        return tuple(map(sentence, (self.likeness.verdict, *harmony)))

    @cached_property
    def facts(self) -> dict[str, str]:
        """Name -> text of every number, for a table."""
        from harmolab.lab.evaluate.dance_scores import dance_scores

        scores = dance_scores(self.motion, self.music, self.score, likeness=self.likeness) | self._rests()
        return {name: show(value) for name, value in scores.items()} | self._pieces()

    def _rests(self) -> dict[str, float]:
        """Share of the beats on which the body rests, above chance; a dance that fails by likeness has none."""
        from harmolab.lab.evaluate.body_rests import rests_on_beat

        late = {"rests of the body on the beat, above chance": 0.0, "the same half a beat late": 0.5}
        return {
            name: rests_on_beat(self.motion, self.music, late=beats) for name, beats in late.items() if self.has_harmony
        }

    def _pieces(self) -> dict[str, str]:
        """Seams and recordings of a dance that was made of recordings."""
        choreography = self.choreography
        if choreography is None:
            return {}
        mean, worst = choreography.mean_seam_cm, choreography.worst_seam_cm
        return {
            "seams, cm": f"{mean:.1f} on average, {worst:.1f} at worst",
            "distinct movement to choose from": f"{choreography.distinct_minutes:.1f} minutes",
            "longest stretch of one recording": f"{choreography.longest_stretch} beats",
            "beats that were seen before in it": f"{choreography.seen_before:.0%}",
            "made of": folded(choreography.shares),
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON; every piece with its place in the dance. What fails by likeness has no harmony."""
        joined = () if self.choreography is None else JOINED
        return {
            "seed": self.seed,
            "start": self.start,
            "seconds": self.motion.duration,
            "likeness": {name: getattr(self.likeness, name) for name in LIKENESS},
            "harmony": self.score.to_dict() if self.has_harmony else None,
            "remarks": self.remarks,
            "dance_probabilities": self.dance_probabilities,
            **{name: getattr(self.choreography, name) for name in joined},
        }


def sentence(text: str) -> str:
    """Words with a capital at the start and a full stop at the end."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}"


def folded(shares: Mapping[str, float]) -> str:
    """A line that names the recordings that gave most of a dance, and counts the others."""
    lines = [f"{name} {share:.0%}" for name, share in list(shares.items())[:NAMED]]
    more = [f"{len(shares) - NAMED} more (--json names every piece)"] if len(shares) > NAMED else []
    return ", ".join(lines + more)
