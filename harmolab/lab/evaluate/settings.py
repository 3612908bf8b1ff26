"""Settings of an evaluation: which folders, read how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harmolab.io.files import PathLike
from harmolab.io.motion_file import ReadingOptions
from harmolab.lab.evaluate.controls import CONTROLS
from harmolab.lab.evaluate.rows import protocol_of
from harmolab.lab.evaluate.summary import RESAMPLES


@dataclass(frozen=True)
class EvaluationSettings:
    """Settings of an evaluation.

    Parameters
    ----------
    systems : name -> folder of its dances (str or path, as all that follow; they are kept as Paths)
    music : folder of songs
    reference : folder of recorded dances
    pairs : file of a list of pairs, or None
    protocol : str, name of a protocol, "" for none
    fps, scale, smpl, up : as in `RowOptions`
    pose_net : weights of a pose network, or None for the shipped one
    resamples, seed : of the intervals
    """

    systems: Mapping[str, PathLike]
    music: PathLike
    reference: PathLike
    pairs: PathLike | None = None
    protocol: str = ""
    fps: float | None = None
    scale: float | None = None
    pose_net: PathLike | None = None
    resamples: int = RESAMPLES
    seed: int = 0
    smpl: PathLike | None = None
    up: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "systems", {name: Path(folder) for name, folder in self.systems.items()})
        for name in ("music", "reference", "pairs", "pose_net", "smpl"):
            path = getattr(self, name)
            object.__setattr__(self, name, None if path is None else Path(path))
        if taken := set(self.systems) & set(CONTROLS):
            raise ValueError(f"{min(taken)!r} is the name of a row that every table has; call the system otherwise")
        if not self.systems and self.pairs is None:
            raise ValueError("there is nothing to evaluate: name a folder of dances, or --system NAME=FOLDER")
        ReadingOptions(up=self.up)  # an error for another axis
        if self.protocol:
            protocol_of(self.protocol)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files and folders that are read."""
        more = (self.pairs, self.pose_net, self.smpl)
        paths = (*self.systems.values(), self.music, self.reference, *more)
        return tuple(Path(path) for path in paths if path is not None)

    def to_dict(self) -> dict[str, Any]:
        """The settings as JSON holds them."""
        named = {name: str(value) if isinstance(value, Path) else value for name, value in vars(self).items()}
        return {**named, "systems": {name: str(folder) for name, folder in self.systems.items()}}
