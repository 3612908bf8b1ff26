"""What the labs of one clip play with, and how their pictures are laid out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.harmony import music_and_motion
from harmolab.params import BarPattern
from harmolab.types import BeatTrack, Clip, Motion

BOARD = (0.085, 0.94, 0.895, 0.05)  # left, bottom, width, height: at the top of every lab's picture


@dataclass(frozen=True, eq=False)
class Stage:
    """What the lab plays with: music beats and motion on one time line, the recommended mode's pattern, the source."""

    music: BeatTrack
    motion: Motion
    pattern: BarPattern
    source: str = ""

    @classmethod
    def of(cls, clip: Clip, pattern: BarPattern | None = None) -> Stage:
        """The stretch that a clip's music and motion share, with its `music_beats`.

        Raises
        ------
        ValueError
            If the clip has no motion.
        """
        return cls(*music_and_motion(clip), pattern or BarPattern.stop_on_the_beat(), clip.source)

    @property
    def time_label(self) -> str:
        """What stands under a time axis: the unit, and what the data are."""
        return f"time (s)   |   {self.source} data" if self.source else "time (s)"


def placed_axes(
    figure: Figure, size: tuple[float, float], places: Sequence[tuple[float, float, float, float]]
) -> list[Axes]:
    """Axes at fixed places, the board last, so that the same values give the same picture whatever was shown before."""
    figure.set_size_inches(*size)
    axes = [figure.add_axes(place) for place in (*places, BOARD)]
    axes[-1].set(ylim=(0, 1), frame_on=False)
    axes[-1].yaxis.set_visible(False)
    return axes


def draw_board(ax: Axes, numbers: Mapping[str, str]) -> Axes:
    """Numbers over their names. The names are tick labels, which are kept; only numbers are drawn anew."""
    names = ", ".join(numbers)
    if ax.get_gid() != names:
        ax.set_xlim(0, len(numbers))
        ax.set_xticks(np.arange(len(numbers)) + 0.5, list(numbers))
        ax.tick_params(axis="x", length=0, pad=2)
        ax.set_gid(names)
    for place, number in enumerate(numbers.values()):
        ax.text(place + 0.5, 0.1, number, ha="center", va="bottom", fontsize=14, fontweight="bold")
    return ax
