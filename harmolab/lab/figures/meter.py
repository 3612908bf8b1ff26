"""Pictures of strong and weak beats and of the meter units they are grouped into (Fig. 6, Eq. 22)."""

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator
from numpy.typing import ArrayLike

from harmolab.beats.meter import MeterUnit
from harmolab.lab.figures.style import COLOURS
from harmolab.types import BeatTrack

# One colour for each signature with its inner grouping; the label on each bracket says the same in words.
UNIT_COLOURS = MappingProxyType({"4/4 (2+2)": "#B0528C", "4/4": "#5B2A86", "5/4": "#A6561C", "6/4": "#5E6B00"})


def unit_label(unit: MeterUnit) -> str:
    """The unit's signature; a 4/4 with a second accent in its middle has another than one without.

    >>> unit_label(MeterUnit(0.0, 2.0, [True, False, True, False], "4/4"))
    '4/4 (2+2)'
    """
    return f"{unit.signature} (2+2)" if unit.signature == "4/4" and bool(unit.strong[2]) else unit.signature


def draw_meter(
    ax: Axes, track: BeatTrack, strong: ArrayLike, units: Sequence[MeterUnit], *, downbeats: ArrayLike | None = None
) -> Axes:
    """Strong and weak beats as long and short stems, and the meter units as brackets over them (Fig. 6).

    Parameters
    ----------
    ax : Axes
    track : BeatTrack, B music beats
    strong : (B,) bool array, m_e of Eq. 22
    units : sequence of MeterUnit
    downbeats : (D,) array, seconds, optional
        Annotated first beats of the bars, drawn below the line.
    """
    mask = np.asarray(strong, bool)
    heights = track.strengths / max(float(track.strengths.max(initial=0.0)), 1e-12)
    for members, name, filled in ((mask, "strong", True), (~mask, "weak", False)):
        ax.vlines(track.times[members], 0.0, heights[members], color=COLOURS["audio"], linewidth=2.4 if filled else 1.2)
        ax.plot(
            track.times[members], heights[members], linestyle="none", marker="o", markersize=9 if filled else 6,
            color=COLOURS["audio"], markerfacecolor=COLOURS["audio"] if filled else "white", label=f"{name} beat",
        )  # fmt: skip
    for unit in units:
        _draw_bracket(ax, unit)
    if downbeats is not None:
        marks = np.asarray(downbeats, np.float64)
        ax.plot(
            marks, np.full(marks.size, -0.12), linestyle="none", marker="^", markersize=9, color=COLOURS["ink"],
            label="annotated downbeat",
        )  # fmt: skip
    ax.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    ax.set(xlim=(0.0, track.duration), ylim=(-0.25, 1.5), xlabel="time (s)", ylabel="onset strength (of the largest)")
    ax.yaxis.set_major_locator(FixedLocator([0.0, 0.5, 1.0]))
    return ax


def _draw_bracket(ax: Axes, unit: MeterUnit) -> None:
    """A bracket from the unit's first beat to just before the next unit's, with its signature."""
    label = unit_label(unit)
    colour = UNIT_COLOURS.get(label, COLOURS["ink"])
    gap = 0.08 * (unit.end - unit.start) / max(len(unit.strong), 1)
    left, right = unit.start - gap, unit.end - 3 * gap
    ax.axvspan(left, right, ymax=0.86, color=colour, alpha=0.10, linewidth=0, zorder=0)
    ax.plot([left, left, right, right], [1.1, 1.2, 1.2, 1.1], color=colour, linewidth=3.0, gid="bracket")
    ax.text((left + right) / 2, 1.24, label, color=colour, ha="center", va="bottom", fontsize=11, fontweight="bold")


def draw_places(ax: Axes, strong_shares: ArrayLike, counts: ArrayLike, *, chance: float) -> Axes:
    """Share of beats that Eq. 22 calls strong at each place of the annotated bar, with 95 % intervals.

    The title says whether downbeats are called strong more often than other beats.

    Parameters
    ----------
    ax : Axes
    strong_shares : (P,) array in [0, 1]; place 1 is the downbeat
    counts : (P,) array, beats behind each share, which give the width of its interval
    chance : float, share of all beats that are strong
    """
    shares, n_beats = np.asarray(strong_shares, np.float64), np.asarray(counts, np.float64)
    places = np.arange(1, shares.size + 1)
    faces = [COLOURS["audio"], *["white"] * (shares.size - 1)]
    ax.bar(places, shares, width=0.65, color=faces[: shares.size], edgecolor=COLOURS["audio"], linewidth=1.8)
    spread = 1.96 * np.sqrt(np.maximum(shares * (1 - shares), 0.0) / np.maximum(n_beats, 1.0))
    ax.errorbar(places, shares, yerr=spread, fmt="none", ecolor=COLOURS["ink"], capsize=5)
    more = shares[0] - spread[0] > chance
    less = shares[0] + spread[0] < chance
    often = "more often than" if more else "less often than" if less else "no more often than"
    ax.set_title(
        f"{shares.size} beats in a bar: downbeats are called\nstrong {often} other beats", loc="left", fontsize=10.5
    )
    ax.axhline(chance, color=COLOURS["chance"], linestyle="--", linewidth=1.6, label=f"chance {chance:.2f}")
    ax.set(ylim=(0.0, 1.18), xlabel="place in the annotated bar", ylabel="share called strong")
    ax.yaxis.set_major_locator(FixedLocator([0.0, 0.25, 0.5, 0.75, 1.0]))
    ax.set_xticks(places, ["1\n(downbeat)", *map(str, places[1:])][: shares.size])
    return ax
