"""Data of the labs of one clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.harmony import music_and_motion
from harmolab.params import BarPattern
from harmolab.types import BeatTrack, Clip, Motion


@dataclass(frozen=True, eq=False)
class Stage:
    """Data of one clip's lab: music beats and motion on one time line, the dance's pattern if known, the source."""

    music: BeatTrack
    motion: Motion
    pattern: BarPattern | None = None
    source: str = ""

    @classmethod
    def of(cls, clip: Clip, pattern: BarPattern | None = None) -> Stage:
        """The segment that a clip's music and motion share, with its `music_beats`.

        Raises
        ------
        ValueError
            If the clip has no motion.
        """
        return cls(*music_and_motion(clip), pattern, clip.source)


def middle_lambda(music: BeatTrack) -> float:
    """λ1 to one decimal that keeps the louder half of the music beats or so; at most that of the labs' slider."""
    strengths = music.strengths
    spread = float(strengths.std()) if strengths.size else 0.0
    return min(np.floor(10 * float(np.median(strengths)) / spread) / 10, 15.0) if spread > 0 else 0.0
