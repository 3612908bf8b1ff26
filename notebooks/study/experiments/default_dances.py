"""Dances of `harmolab dance SONG` without any option: the shipped bank on songs of several dances."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from harmolab.beats.audio import audio_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics.likeness import Likeness, likeness
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.types import Motion

SONGS = ("waltz", "cha-cha", "jive", "quickstep")
SECONDS = 30.0
SEED = 910_000  # of the first song


@dataclass(frozen=True, eq=False)
class DefaultDance:
    """A dance of the shipped bank: the motion, the guard, the seams it was put together at (mean and worst, cm)."""

    motion: Motion
    likeness: Likeness
    mean_seam: float
    worst_seam: float

    @property
    def title(self) -> str:
        """The guard and the seams in a line."""
        return f"{self.likeness.verdict}; seams {self.mean_seam:.0f} cm, {self.worst_seam:.0f} at worst"


def default_dances(songs: Iterable[str] = SONGS, *, seconds: float = SECONDS) -> dict[str, DefaultDance]:
    """Half a minute of dance to a synthetic song of each kind, on beats that are tracked in it.

    Parameters
    ----------
    songs : names of dances, keys of `harmolab.DANCES`; the bank knows none of them and dances salsa to all
    seconds : float, length of each

    Raises
    ------
    ValueError
        For a dance that is unknown.
    """
    bank = shipped_bank("salsa")
    dances = {}
    for number, name in enumerate(songs):
        audio = synthetic_clip(name, seconds=seconds, seed=SEED + number).audio
        choreography = bank.choreograph(audio, audio_beats(audio, tempo=name), seconds=seconds)
        judged = likeness(choreography.motion, limits=bank.limits)
        dances[f"{name} (synthetic song)"] = DefaultDance(
            choreography.motion, judged, choreography.mean_seam_cm, choreography.worst_seam_cm
        )
    return dances
