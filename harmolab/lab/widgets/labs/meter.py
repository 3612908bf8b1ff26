"""The meter lab: strong beats, and the meter units they are grouped into (Sec. 4.1, Eq. 22)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import MeterUnit, meter_units, strong_beats
from harmolab.beats.saliency import salient_audio
from harmolab.lab.figures.meter import UNIT_COLOURS, draw_meter, draw_places, unit_label
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.widgets.labs.lab import Lab, menu, setting_controls, slider, with_settings
from harmolab.lab.widgets.labs.stage import axis_label, draw_board, placed_axes
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, Clip, IntArray

PLACES = ((0.085, 0.5, 0.895, 0.375), (0.085, 0.115, 0.4, 0.245), (0.58, 0.115, 0.4, 0.245))
NEAR = 0.1  # seconds: a beat this close to an annotated one has its place in the bar
SEED = 22  # of the measuring error: the same whenever the slider comes back


@dataclass(frozen=True, eq=False)
class Song:
    """Data of the lab: tracks of one piece of music by name, perhaps an annotated one, and the source."""

    tracks: Mapping[str, BeatTrack]
    annotated: BeatTrack | None = None
    source: str = ""

    @property
    def downbeats(self) -> NDArray[np.float64] | None:
        """Annotated first beats of the bars, seconds."""
        if self.annotated is None or self.annotated.bar_places is None:
            return None
        return self.annotated.times[self.annotated.bar_places == 0]

    def places(self, track: BeatTrack) -> IntArray:
        """Place of each beat in the annotated bar, -1 where none is known; (B,) array."""
        bars = self.annotated
        if bars is None or bars.bar_places is None or len(bars) == 0:
            return np.full(len(track), -1)
        gaps = np.abs(track.times[:, None] - bars.times[None, :])
        return np.where(gaps.min(axis=1) <= NEAR, bars.bar_places[gaps.argmin(axis=1)], -1)


def meter_lab(clip: Clip, *, annotated: BeatTrack | None = None, **values: Any) -> Lab:
    """Controls for the input of Eq. 22 - which beats, from which on, how well measured - above strong beats and units.

    Parameters
    ----------
    clip : Clip; its own beats, else those tracked in its audio
    annotated : BeatTrack, optional
        Beats with their places in the bar: downbeats are marked, and both tracks can be compared.
    **values
        Where controls start: ``lambda1=1.0``.

    Examples
    --------
    >>> lab = meter_lab(synthetic_clip("rumba", seconds=18.0))  # doctest: +SKIP
    >>> lab.controls["first"].value = 1  # doctest: +SKIP
    """
    tracks = {"of the clip": music_beats(clip)}
    if annotated is not None:
        tracks["annotated"] = annotated
    controls = {
        "beats": menu("beats", tuple(tracks), "of the clip"),
        **setting_controls(HarmonyParams.paper(), "lambda1"),
        "every": slider("take every", 1, 4, 1, 1),
        "first": slider("leave out first", 0, 7, 1, 0),
        "error": slider("error (SD)", 0.0, 1.0, 0.05, 0.0),
    }
    return Lab(partial(draw_meter_lab, Song(tracks, annotated, clip.source)), meter_params, controls, values)


def meter_params(*, lambda1: float, **_: Any) -> HarmonyParams:
    """The paper's settings but for λ1, the only control of this lab that is one of them."""
    return with_settings(HarmonyParams.paper(), lambda1=lambda1)


def draw_meter_lab(
    song: Song,
    *,
    beats: str = "of the clip",
    lambda1: float = 0.1,
    every: int = 1,
    first: int = 0,
    error: float = 0.0,
    figure: Figure | None = None,
) -> Figure:
    """The lab's picture: strong and weak beats with their units, the time each signature takes, and places in the bar.

    Parameters
    ----------
    song : Song
    beats : name of one of its tracks
    lambda1 : float; weaker beats are left out before they are compared (Eq. 11)
    every : int; 2 takes every second beat, as a tracker does that hears half the tempo
    first : int, beats left out at the start: the grouping starts later
    error : float, standard deviations of the strengths by which each strength is measured wrongly
    figure : Figure, optional, drawn on if given
    """
    figure, (above, left, right, board) = placed_axes(figure, (10.0, 6.2), PLACES)
    track = _measured(song.tracks[beats], lambda1=lambda1, every=every, first=first, error=error)
    strong, units = strong_beats(track.strengths), meter_units(track)
    draw_meter(above, track, strong, units, downbeats=song.downbeats)
    key = "filled: strong beat   |   open: weak   |   bracket: meter unit"
    downbeat = "" if song.downbeats is None else "triangle: annotated downbeat"
    above.set_xlabel(axis_label("time (s)", key, downbeat, source=song.source))
    above.set(ylabel="strength (of largest)", xlim=(-0.01 * track.duration, 1.01 * track.duration))
    shares = _time_shares(units, track.duration)
    _draw_signatures(left, shares)
    places = song.places(track)
    _draw_bar(right, strong, places)
    draw_board(board, _numbers(strong, units, shares, places, song.downbeats is not None))
    return figure


def _measured(track: BeatTrack, *, lambda1: float, every: int, first: int, error: float) -> BeatTrack:
    """The beats that are the input of Eq. 22; arguments as for `draw_meter_lab`."""
    noise = np.random.default_rng(SEED).standard_normal(len(track))
    spread = float(track.strengths.std()) if len(track) else 0.0
    strengths = np.maximum(track.strengths + error * spread * noise, 0.0)
    salient = salient_audio(replace(track, strengths=strengths), meter_params(lambda1=lambda1))
    numbers = np.arange(len(salient)) - first
    return salient.select((numbers >= 0) & (numbers % every == 0))


def _time_shares(units: Sequence[MeterUnit], duration: float) -> dict[str, float]:
    """Share of the time by signature, and the share that no unit covers."""
    shares = dict.fromkeys(UNIT_COLOURS, 0.0)
    for unit in units:
        shares[unit_label(unit)] += (unit.end - unit.start) / duration
    return {**shares, "none": 1.0 - sum(shares.values())}


def _draw_signatures(ax: Axes, shares: Mapping[str, float]) -> None:
    colours = [UNIT_COLOURS.get(name, COLOURS["chance"]) for name in shares]
    ax.bar(np.arange(len(shares)), list(shares.values()), width=0.65, color=colours)
    if not ax.get_gid():
        ax.set_xticks(np.arange(len(shares)), list(shares))
        ax.set_gid("named")
    ax.set(ylim=(0.0, 1.0), ylabel="share of the time", xlabel="signature of the unit")


def _draw_bar(ax: Axes, strong: BoolArray, places: IntArray) -> None:
    """Share of strong beats at each place of the annotated bar."""
    counts = np.bincount(places[places >= 0])
    if counts.size == 0:
        ax.text(0.5, 0.5, "no annotated bars", transform=ax.transAxes, ha="center", color=COLOURS["chance"])
        ax.set(xticks=[], yticks=[])
        return
    n_strong = np.bincount(places[places >= 0], strong[places >= 0])
    draw_places(ax, n_strong / np.maximum(counts, 1), counts, chance=float(strong[places >= 0].mean()))


def _numbers(
    strong: BoolArray, units: Sequence[MeterUnit], shares: Mapping[str, float], places: IntArray, annotated: bool
) -> dict[str, str]:
    numbers = {
        "beats": f"{strong.size}",
        "strong": f"{strong.sum()}",
        "meter units": f"{len(units)}",
        "time covered": f"{1.0 - shares['none']:.0%}",
    }
    if annotated:
        numbers["downbeats that are strong"] = f"{(strong & (places == 0)).sum()}/{(places == 0).sum()}"
    return numbers
