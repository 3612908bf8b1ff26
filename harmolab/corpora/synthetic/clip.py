"""One synthetic clip with the truth about it: music and dance on the same beats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from harmolab.corpora.synthetic.beats import ClipSettings
from harmolab.corpora.synthetic.dance import dance_motion
from harmolab.corpora.synthetic.music import planted_music
from harmolab.corpora.synthetic.steps import choreography
from harmolab.io.beats import BeatAnnotation, Unit
from harmolab.types import Clip, FloatArray

SHORTEST_UNIT = 0.25  # seconds of a figure below which it does not count as being in the clip


@dataclass(frozen=True, eq=False)
class PlantedClip:
    """A clip and what was planted in it.

    Parameters
    ----------
    clip : Clip
        Its `beats` are the planted music beats, with the accents of the bar as strengths.
    annotation : BeatAnnotation
        Beats, downbeats, meter, mean tempo and figures on the clip's time line.
    visual_beat_times : (M,) array, seconds
        Every movement end inside the clip.
    settings : ClipSettings
    """

    clip: Clip
    annotation: BeatAnnotation
    visual_beat_times: FloatArray
    settings: ClipSettings


def planted_clip(settings: ClipSettings, *, name: str | None = None) -> PlantedClip:
    """The clip that the settings describe, with the truth about it.

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.
    """
    music = planted_music(settings)
    danced = choreography(music.grid, settings)
    motion = dance_motion(danced, settings)
    name = f"{settings.dance} {settings.seed}" if name is None else name
    clip = Clip(name, music.audio, motion, 0.0, "synthetic", music.beats, settings.dance)
    ends = danced.ends.times
    annotation = BeatAnnotation(
        music.beats.times,
        music.downbeat_times,
        music.grid.meter,
        music.grid.tempo(settings.seconds),
        settings.dance,
        _units_inside(danced.units, music.beats.times, settings.seconds),
        source="synthetic",
        strengths=music.beats.strengths,
    )
    return PlantedClip(clip, annotation, ends[(ends >= 0) & (ends < settings.seconds)], settings)


def _units_inside(units: tuple[Unit, ...], beat_times: FloatArray, seconds: float) -> tuple[Unit, ...]:
    """The parts of the units that lie inside the clip, each with the beats that fall into it."""
    inside = []
    for unit in units:
        start, end = max(unit.start, 0.0), min(unit.end, seconds)
        if end - start > SHORTEST_UNIT:
            beats = int(((beat_times > start) & (beat_times <= end)).sum())
            inside.append(Unit(unit.name, start, end, beats, unit.figure))
    return tuple(inside)


def synthetic_clip(dance: str = "cha-cha", **settings: Any) -> Clip:
    """Music and a dance on its beats, both from time 0; `clip.beats` are the planted music beats.

    The same seed at another fps is the same dance, seen at other instants. For the planted movement ends and the
    figures use `planted_clip`.

    Parameters
    ----------
    dance : str, one of `params.DANCES`
    **settings
        seconds, fps, tempo, drift, lateness, jitter, omission, redundancy, noise, figures, sample_rate and seed, as in
        `ClipSettings`.

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.

    Examples
    --------
    >>> clip = synthetic_clip("waltz", seconds=4.0, fps=30.0, seed=7)
    >>> clip.motion.n_frames, clip.audio.duration
    (120, 4.0)
    """
    return planted_clip(ClipSettings(dance, **settings)).clip
