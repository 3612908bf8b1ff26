"""Strong and weak beats, and their grouping into meter units (paper Sec. 4.1, Fig. 6, Eq. 22)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harmolab.types import BeatTrack, BoolArray

# Accent pattern (True = strong) -> signature. Three types in four categories, as Sec. 4.1 counts them: a quarter-note
# meter opens on a strong beat and is split by its inner strong beats, 4 = 2+2 or 4, 5 = 3+2, 6 = 3+3.
CATEGORIES: dict[tuple[bool, ...], str] = {
    (True, False, True, False): "4/4",
    (True, False, False, False): "4/4",
    (True, False, False, True, False): "5/4",
    (True, False, False, True, False, False): "6/4",
}


@dataclass(frozen=True, eq=False)
class MeterUnit:
    """One meter: a group of beats that the music repeats (paper Fig. 6).

    Parameters
    ----------
    start, end : float, seconds
    strong : (B,) bool array, which of its beats are strong (Eq. 22)
    signature : str, such as "4/4"
    """

    start: float
    end: float
    strong: BoolArray
    signature: str

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"a meter unit must end after it starts, got {self.start} to {self.end} s")
        strong = np.array(self.strong, bool)
        strong.setflags(write=False)
        object.__setattr__(self, "strong", strong)


def strong_beats(strengths: NDArray[np.float64]) -> BoolArray:
    """m_e: a beat is strong when it is stronger than the one before (Eq. 22); the first, having none, is weak.

    >>> strong_beats(np.array([1.0, 3.0, 2.0, 2.5]))
    array([False,  True, False,  True])
    """
    if len(strengths) == 0:
        return np.zeros(0, dtype=bool)
    return np.concatenate([[False], np.diff(strengths) > 0])


def cycle_of_meter(meter: int | None) -> int:
    """Beats in a pattern's cycle: half a bar in even meters, the bar in odd ones, one beat in an unknown meter."""
    if meter is None:
        return 1
    return 2 if meter % 2 == 0 else meter


def accented_places(strengths: NDArray[np.float64], cycle: int) -> NDArray[np.int64]:
    """Place of each beat in its cycle, the place with the strongest beats on average being 0; (B,) array.

    What a listener without a score would do. On the waltzes of the beat-locked recordings it found the annotated bar in
    ten of ten; in cha-cha and rumba the strongest beat is as often the second as the first.

    >>> accented_places(np.array([1.0, 3.0, 1.0, 2.0, 1.0]), 2)
    array([1, 0, 1, 0, 1])
    """
    beats = np.arange(len(strengths))
    means = [strengths[beats % cycle == place].mean() if place < len(strengths) else 0.0 for place in range(cycle)]
    return (beats - int(np.argmax(means))) % cycle


def meter_units(track: BeatTrack) -> tuple[MeterUnit, ...]:
    """Meter units of a beat track, in order, without overlap: at each beat the longest category that fits.

    Beats that start no category are passed over. A unit ends where its next beat begins; the last needs that beat too.

    Returns
    -------
    tuple of MeterUnit
    """
    strong, last = strong_beats(track.strengths), track.times.size - 1
    units: list[MeterUnit] = []
    beat = 0
    while beat < last:
        accents = (tuple(strong[beat : beat + length].tolist()) for length in (6, 5, 4))
        marks = next((marks for marks in accents if marks in CATEGORIES), ())
        if marks and beat + len(marks) <= last:
            start, end = track.times[[beat, beat + len(marks)]].tolist()
            units.append(MeterUnit(start, end, np.array(marks), CATEGORIES[marks]))
        beat += len(marks) or 1
    return tuple(units)
