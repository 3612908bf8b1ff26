"""Data of the labs of one clip, and the layout of the labs' pictures."""

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

    @property
    def middle_lambda(self) -> float:
        """λ1 to one decimal that keeps the louder half of the music beats or so; at most that of the labs' slider."""
        strengths = self.music.strengths
        spread = float(strengths.std()) if strengths.size else 0.0
        return min(np.floor(10 * float(np.median(strengths)) / spread) / 10, 15.0) if spread > 0 else 0.0

    @property
    def time_label(self) -> str:
        """Label of a time axis: the unit, and the source of the data."""
        return axis_label("time (s)", source=self.source)


def axis_label(*notes: str, source: str) -> str:
    """Notes under an axis and the source of the data, apart from each other; empty ones are left out."""
    return "   |   ".join(filter(None, [*notes, source and f"{source} data"]))


def placed_axes(
    figure: Figure | None, size: tuple[float, float], places: Sequence[tuple[float, float, float, float]]
) -> tuple[Figure, list[Axes]]:
    """A figure (a new one for None) and its axes at fixed places, the board last.

    Fixed, so that the same values give the same picture whatever was drawn before. A figure that has axes keeps them.
    """
    figure = Figure() if figure is None else figure
    if not figure.axes:
        figure.set_size_inches(*size)
        board = [figure.add_axes(place) for place in (*places, BOARD)][-1]
        board.set(ylim=(0, 1), frame_on=False)
        board.yaxis.set_visible(False)
    return figure, figure.axes


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
