"""One test unit, danced by everybody: the recorded motion and that of every generator, to look at (notebook 11)."""

from __future__ import annotations

from dataclasses import dataclass

from harmolab.lab.experiments.judging import RECORDED, danced_units, score_unit, unit_beats
from harmolab.lab.profile import RunProfile
from harmolab.params import HarmonyParams
from harmolab.systems.common.units import DanceUnit
from harmolab.types import BeatTrack, HarmonyScore, Motion


@dataclass(frozen=True, eq=False)
class DancedUnit:
    """A unit's music beats and all that was danced to them.

    Parameters
    ----------
    name : str, of the unit
    dance : str
    beats : BeatTrack, seconds from the unit's first frame
    start : float, seconds, where the meter begins; the motion before it was given
    motions : variant, or "recorded" -> Motion
    scores : the same names -> HarmonyScore of the meter, valleys within 0.1 s
    """

    name: str
    dance: str
    beats: BeatTrack
    start: float
    motions: dict[str, Motion]
    scores: dict[str, HarmonyScore]

    @property
    def verdicts(self) -> dict[str, str]:
        """What each motion reached, in words."""
        return {name: _verdict(score) for name, score in self.scores.items()}


def danced_unit(profile: RunProfile, corpus: str, place: int = 0) -> DancedUnit:
    """The `place`-th test unit of a corpus, as recorded and as the generators of the first seed dance it.

    Raises
    ------
    ValueError
        If the test split has no such unit.
    """
    units, dances = danced_units(profile, corpus)
    if not 0 <= place < len(units):
        raise ValueError(f"place must be 0 to {len(units) - 1}, the test units of {corpus}, got {place}")
    return danced(units.units[place], {name: motions[place] for name, motions in dances.items()})


def danced(unit: DanceUnit, motions: dict[str, Motion]) -> DancedUnit:
    """A unit with the motions danced to it, the recorded one among them, and their scores."""
    scores = {name: score_unit(motion, unit, HarmonyParams.valleys()) for name, motion in motions.items()}
    beats = unit_beats(unit, motions[RECORDED])
    return DancedUnit(unit.name, unit.dance, beats, unit.n_prior / unit.fps, motions, scores)


def _verdict(score: HarmonyScore) -> str:
    return (
        f"{score.hits.sum()} of {score.n_audio} beats met with {score.n_visual} of its own, "
        f"harmony above chance {score.harmony_above_chance:+.2f}"
    )
