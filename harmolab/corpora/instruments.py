"""Performances of musicians: sound, the points of the player, the notes if they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harmolab.io.player_points import INSTRUMENTS
from harmolab.types import Audio, BoolArray, Motion, Notes


@dataclass(frozen=True, eq=False)
class Performance:
    """A musician who plays a piece.

    Parameters
    ----------
    name : str
    instrument : "piano" or "violin"
    audio : Audio or None
    motion : Motion, (T, P, 2) image coordinates, y down; joints by the names of `player_points`, some may be missing
    detected : (T, P) mask, False where a point was not detected (its place is filled in); all True when left out
    notes : Notes or None, on the audio's time line
    offset : float, seconds, audio time of frame 0
    piece : str; performances of one piece, or of its repeats, stay on one side of a split
    rendered : bool, the sound was made from the notes, not recorded
    source : str, "synthetic" or the name of the recordings
    """

    name: str
    instrument: str
    audio: Audio | None
    motion: Motion
    detected: BoolArray = None  # type: ignore[assignment]  # filled in below
    notes: Notes | None = None
    offset: float = 0.0
    piece: str = ""
    rendered: bool = False
    source: str = ""

    def __post_init__(self) -> None:
        if self.instrument not in INSTRUMENTS:
            raise ValueError(f"{self.name}: instrument must be {' or '.join(INSTRUMENTS)}, got {self.instrument!r}")
        if self.motion.positions.shape[2] != 2:
            raise ValueError(f"{self.name}: points of a picture are needed, (T, P, 2), got three coordinates")
        shape = self.motion.positions.shape[:2]
        detected = np.ones(shape, bool) if self.detected is None else np.array(self.detected, bool)
        if detected.shape != shape:
            raise ValueError(f"{self.name}: detected must have shape {shape}, got {detected.shape}")
        detected.setflags(write=False)
        object.__setattr__(self, "detected", detected)
        if not np.isfinite(self.offset):
            raise ValueError(f"{self.name}: offset must be finite, got {self.offset}")
