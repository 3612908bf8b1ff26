"""The meter lab: strong beats, and the meter units they are grouped into (Sec. 4.1, Eq. 22)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import CATEGORIES, MeterUnit, meter_units, strong_beats
from harmolab.beats.salience import salient_audio
from harmolab.lab.labs import live
from harmolab.lab.player_data import LAB_SENTENCES, percent
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, Clip, FloatArray, IntArray

NEAR = 0.1  # seconds: a beat this close to an annotated one has its place in the bar
SEED = 22  # of the measuring error: the same whenever the slider comes back
TRACKS = {"of the clip": "those of the clip", "annotated": "those of the annotation"}
START: Mapping[str, Any] = {"beats": "of the clip", "every": 1.0, "first": 0.0, "error": 0.0}

# One colour for each signature with its inner grouping; the label on each bracket says the same in words.
UNIT_COLOURS = MappingProxyType({"4/4 (2+2)": "#B0528C", "4/4": "#5B2A86", "5/4": "#A6561C", "6/4": "#5E6B00"})


def unit_label(unit: MeterUnit) -> str:
    """The unit's signature; a 4/4 with a second accent in its middle has another than one without.

    >>> unit_label(MeterUnit(0.0, 2.0, [True, False, True, False], "4/4"))
    '4/4 (2+2)'
    """
    return f"{unit.signature} (2+2)" if unit.signature == "4/4" and bool(unit.strong[2]) else unit.signature


@dataclass(frozen=True, eq=False)
class Song:
    """Data of the lab: tracks of one piece of music by name, perhaps an annotated one, and the source."""

    tracks: Mapping[str, BeatTrack]
    annotated: BeatTrack | None = None
    source: str = ""

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.tracks["of the clip"].duration

    @property
    def downbeats(self) -> FloatArray | None:
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


def meter_lab(clip: Clip, *, annotated: BeatTrack | None = None, **values: Any) -> live.LiveLab:
    """A lab in the browser: strong beats, and the meter units that they make, while their input changes (Eq. 22).

    Controls say which beats are taken, from which one on, and how well their strengths are measured.

    Parameters
    ----------
    clip : Clip
        Its own beats are taken, else those that a program finds in its audio.
    annotated : BeatTrack, optional
        Beats with their places in the bar. First beats of bars are then marked, and both tracks can be compared.
    **values
        Values at which controls start, such as ``lambda1=1.0``.

    Returns
    -------
    LiveLab, as of `corpus_lab`

    Raises
    ------
    ValueError
        For an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = meter_lab(synthetic_clip("rumba", seconds=18.0))  # doctest: +SKIP
    >>> lab.set(first=1)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    """
    tracks = {"of the clip": music_beats(clip)}
    if annotated is not None:
        tracks["annotated"] = annotated
    song = Song(tracks, annotated, clip.source)
    menu = live.Menu("beats", "track", {name: TRACKS[name] for name in tracks})
    controls = {"beats": menu, **live.lab_controls("meter")}
    computed = {"loud": live.middle_lambda(tracks["of the clip"])}
    numbers = partial(meter_numbers, song)
    return live.LiveLab(live.LabContent("meter", _evidence(song), controls, numbers, computed, extra=START), values)


def _evidence(song: Song) -> dict[str, Any]:
    units = [(accents, MeterUnit(0.0, 1.0, np.array(accents), name)) for accents, name in CATEGORIES.items()]
    return {
        "source": song.source,
        "duration": song.duration,
        "tracks": {name: _track(song, track) for name, track in song.tracks.items()},
        "downbeats": song.downbeats,
        "categories": {
            "".join("S" if is_strong else "w" for is_strong in accents): unit_label(unit) for accents, unit in units
        },
        "colours": UNIT_COLOURS,
    }


def _track(song: Song, track: BeatTrack) -> dict[str, Any]:
    return {**live.track_evidence(track), "noise": _noise(track), "places": song.places(track)}


def _noise(track: BeatTrack) -> FloatArray:
    """Measuring error of each beat in standard deviations, (B,) array."""
    return np.random.default_rng(SEED).standard_normal(len(track))


# Numbers


def meter_numbers(
    song: Song, *, beats: str = "of the clip", every: float = 1.0, first: float = 0.0, error: float = 0.0, **values: Any
) -> dict[str, Any]:
    """The numbers of the lab: strong beats, meter units, strong beats by place in the bar, and the sentence.

    Parameters
    ----------
    song : Song
    beats : name of one of its tracks
    every : a whole number; 2 takes every second beat, as a tracker does that hears half the tempo
    first : a whole number, beats left out at the start: the grouping starts later
    error : float, standard deviations of the strengths by which each strength is measured wrongly
    **values
        The other controls, by name; weaker beats are left out before they are compared (Eq. 11).
    """
    track = _measured(song.tracks[beats], live.lab_params(**values), every=int(every), first=int(first), error=error)
    strong, units = strong_beats(track.strengths), meter_units(track)
    shares = _time_shares(units, song.duration)
    covered = sum(shares.values())
    numbers = {
        "beats": len(track),
        "strong": int(strong.sum()),
        "units": [(unit.start, unit.end, unit_label(unit)) for unit in units],
        "covered": covered,
        "shares": shares,
        **_accents(strong, song.places(track)),
    }
    text = LAB_SENTENCES["meter"].format(**{**numbers, "covered": percent(covered)})
    of_bars = LAB_SENTENCES["downbeats"].format(**numbers) if song.downbeats is not None else ""
    return numbers | {"sentence": text + of_bars}


def _measured(track: BeatTrack, params: HarmonyParams, *, every: int, first: int, error: float) -> BeatTrack:
    """The beats that are the input of Eq. 22; arguments as for `meter_numbers`."""
    spread = track.strengths.std() if len(track) else 0.0
    strengths = np.maximum(track.strengths + error * spread * _noise(track), 0.0)
    salient = salient_audio(replace(track, strengths=strengths), params)
    numbers = np.arange(len(salient)) - first
    return salient.select((numbers >= 0) & (numbers % every == 0))


def _time_shares(units: Sequence[MeterUnit], duration: float) -> dict[str, float]:
    """Share of the time by signature."""
    shares = dict.fromkeys(UNIT_COLOURS, 0.0)
    for unit in units:
        shares[unit_label(unit)] += (unit.end - unit.start) / duration
    return shares


def _accents(strong: BoolArray, places: IntArray) -> dict[str, Any]:
    """Share of strong beats at each place of the annotated bar, the beats there, and the share among all of them."""
    placed = places >= 0
    counts = np.bincount(places[placed])
    n_strong = np.bincount(places[placed], strong[placed])
    return {
        "counts": counts,
        "accents": n_strong / np.maximum(counts, 1),
        "chance": float(strong[placed].mean()) if placed.any() else np.nan,
        "downbeats": int((places == 0).sum()),
        "strong_downbeats": int((strong & (places == 0)).sum()),
    }
