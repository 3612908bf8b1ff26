"""One synthetic clip with the truth about it: music and dance on the same beats."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from harmolab.data.synth_beats import Liberties, dance_named
from harmolab.data.synth_dance import dance_motion
from harmolab.data.synth_music import synthetic_music
from harmolab.data.synth_steps import choreography
from harmolab.io.beats import BeatAnnotation, Unit
from harmolab.types import Clip

__all__ = ["ClipSettings", "PlantedClip", "planted_clip", "synthetic_clip"]

FloatArray = NDArray[np.float64]

SHORTEST_UNIT = 0.25  # seconds of a figure below which it does not count as being in the clip


@dataclass(frozen=True)
class ClipSettings:
    """Everything that a synthetic clip follows from; equal settings give equal clips.

    Parameters
    ----------
    dance : str, one of `params.DANCES`
    seconds : float
    fps : float, frames per second; 15 to 120 is usual
    tempo : float or None, beats per minute; None: drawn from the dance's range
    drift : float, share of the tempo by which it rises from start to end
    lateness : float, seconds, constant delay of the movements
    jitter : float, seconds, standard deviation of each movement end
    omission : float, share of beats without a movement end
    redundancy : float, share of beat-to-beat intervals with an extra movement end
    noise : float, metres, standard deviation of the sensor noise on each joint and axis
    figures : tuple of names of `figure_names(dance)`, danced in turn; None: drawn
    sample_rate : int, hertz
    seed : int
    """

    dance: str = "cha-cha"
    seconds: float = 6.0
    fps: float = 60.0
    tempo: float | None = None
    drift: float = 0.0
    lateness: float = 0.0
    jitter: float = 0.0
    omission: float = 0.0
    redundancy: float = 0.0
    noise: float = 0.0
    figures: tuple[str, ...] | None = None
    sample_rate: int = 22050
    seed: int = 0

    def __post_init__(self) -> None:
        dance_named(self.dance)
        if isinstance(self.seed, bool) or not isinstance(self.seed, Integral) or self.seed < 0:
            raise ValueError(f"seed must be a whole number, not negative, got {self.seed!r}")
        object.__setattr__(self, "seed", int(self.seed))
        if self.figures is not None:
            object.__setattr__(self, "figures", tuple(self.figures))
        self.liberties  # noqa: B018  # checks them

    @property
    def liberties(self) -> Liberties:
        """The dancer's part of the settings."""
        return Liberties(self.lateness, self.jitter, self.omission, self.redundancy)


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
    music = synthetic_music(
        settings.dance,
        seconds=settings.seconds,
        seed=settings.seed,
        tempo=settings.tempo,
        drift=settings.drift,
        sample_rate=settings.sample_rate,
    )
    danced = choreography(
        settings.dance,
        music.grid,
        seed=settings.seed,
        liberties=settings.liberties,
        figures=settings.figures,
    )
    motion = dance_motion(danced, seconds=settings.seconds, fps=settings.fps, noise=settings.noise, seed=settings.seed)
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


def synthetic_clip(
    dance: str = "cha-cha",
    *,
    seconds: float = 6.0,
    fps: float = 60.0,
    tempo: float | None = None,
    drift: float = 0.0,
    lateness: float = 0.0,
    jitter: float = 0.0,
    omission: float = 0.0,
    redundancy: float = 0.0,
    noise: float = 0.0,
    figures: tuple[str, ...] | None = None,
    sample_rate: int = 22050,
    seed: int = 0,
) -> Clip:
    """Music and a dance on its beats, both from time 0; `clip.beats` are the planted music beats.

    The same seed at another fps is the same dance, seen at other instants. For the planted movement ends and the
    figures use `planted_clip`.

    Parameters
    ----------
    dance, seconds, fps, tempo, drift, lateness, jitter, omission, redundancy, noise, figures, sample_rate, seed
        As in `ClipSettings`.

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
    settings = ClipSettings(
        dance, seconds, fps, tempo, drift, lateness, jitter, omission, redundancy, noise, figures, sample_rate, seed
    )
    return planted_clip(settings).clip
