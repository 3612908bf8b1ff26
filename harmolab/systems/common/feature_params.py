"""Settings of the input of a system: frame rate, audio features, length of a training unit (paper Sec. 4.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


def check_numbers(settings: Any, *, positive: Sequence[str] = (), not_negative: Sequence[str] = ()) -> None:
    """ValueError, with name and value, for a number out of range."""
    for name in (*positive, *not_negative):
        number = getattr(settings, name)
        if not 0 <= number < math.inf or (number == 0 and name in positive):
            raise ValueError(f"{name} must be {'positive' if name in positive else 'zero or more'}, got {number}")


@dataclass(frozen=True)
class FeatureParams:
    """Input of the generator from music and motion (Sec. 4.1, 5.1).

    Parameters
    ----------
    fps : float, hertz
        Rate of motion and features; the paper resamples to 15.
    n_mfcc : int
        MFCC coefficients of A_f.
    beat_channels : bool
        Beside the MFCC give onset strength, and sine and cosine of the position between two beats. The paper does not.
    unit_beats : int
        Unified length of a training unit in beats: a meter of 4 to 6 beats and the beats before it that fill it up.
    """

    fps: float = 15.0
    n_mfcc: int = 20
    beat_channels: bool = False
    unit_beats: int = 8

    def __post_init__(self) -> None:
        check_numbers(self, positive=("fps", "n_mfcc"))
        if self.unit_beats < 7:
            raise ValueError(f"unit_beats must leave at least one beat before a meter of six, got {self.unit_beats}")

    @classmethod
    def paper(cls) -> FeatureParams:
        """MFCC alone, at 15 frames per second."""
        return cls()

    @classmethod
    def recommended(cls) -> FeatureParams:
        """The same, and where each frame lies between two beats."""
        return cls(beat_channels=True)

    @property
    def n_audio(self) -> int:
        """Audio channels F of A_f."""
        return self.n_mfcc + 3 * self.beat_channels
