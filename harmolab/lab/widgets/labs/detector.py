"""The beat-detector lab: the moments that are visual beats, and the curve from which they are read."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harmolab.beats.visual import motion_curve, visual_beats
from harmolab.harmony import music_and_motion, nearest_intervals
from harmolab.lab.widgets.labs.controls import POSITION_SMOOTHINGS, RATES, named_controls
from harmolab.lab.widgets.labs.lab import with_settings
from harmolab.lab.widgets.labs.live import LabContent, LiveLab, Preset, paper_with
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.lab.widgets.words import LAB_SENTENCES
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Clip, FloatArray

NEAR = 0.05  # seconds: a planted beat with a detected one this close is a detected beat
NAMES = ("detector", "fps", "plateau", "smoothing", "position_smoothing", "subframe")
ABOUT = (
    "Above: the curve of the dance, a triangle at each visual beat, blue lines at the music's beats. Below: all beats, "
    "and how far each visual beat lies from the nearest beat of the music; beats at random would lie flat."
)
FINE: Mapping[str, Any] = {"fps": None, "subframe": True}
PRESETS = (
    Preset("the paper's", {}, "Peaks and valleys of the speed at 15 frames a second: many beats, placed on frames."),
    Preset("slowest moments", {"detector": "valleys"}, "Peaks of the speed go; the rests between two movements stay."),
    Preset(
        "its own frames",
        {"detector": "valleys", "fps": None},
        "The curve gets its true shape: 15 frames a second move a beat by up to a frame, 67 ms.",
    ),
    Preset(
        "between frames",
        {"detector": "valleys", "subframe": True},
        "Beats leave the grid of frames, even at 15 frames a second.",
    ),
    Preset(
        "fine and smooth",
        {"detector": "valleys", **FINE, "smoothing": 0.05},
        "Between frames of the fine curve, smoothed a little: small turns of the speed go, longer movements stay.",
    ),
    Preset(
        "too smooth",
        {"detector": "valleys", **FINE, "smoothing": 0.3},
        "The curve gets flat: movements shorter than the smoothing are gone.",
    ),
    Preset(
        "directions",
        {"detector": "direction"},
        "Beats are changes of direction, as in the study that the paper improves on.",
    ),
)


def detector_lab(clip: Clip, *, planted: ArrayLike | None = None, **values: Any) -> LiveLab:
    """Menus for detector, frame rate and plateau and controls for both smoothings, below the curve and its beats.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    planted : (P,) array, seconds on the audio's time line, optional
        Where movements truly end, if that is known: circles mark the detected ones, crosses the others.
    **values
        Where controls start instead of at the paper mode: ``detector="valleys"``.

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = detector_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.set(smoothing=0.05)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    """
    times = None if planted is None else _on_stage(clip, planted)
    return LiveLab(detector_content(Stage.of(clip), times), values)


def _on_stage(clip: Clip, planted: ArrayLike) -> FloatArray:
    """Planted times on the time line of the stage."""
    times = np.sort(np.asarray(planted, np.float64))
    track = BeatTrack(times, np.ones(times.size), fps=100.0, duration=clip.audio.duration)
    return music_and_motion(replace(clip, beats=track))[0].times


def detector_content(stage: Stage, planted: FloatArray | None = None) -> LabContent:
    """The detector lab of a stage; `planted` as for `detector_lab`, on the stage's time line."""
    return LabContent(
        kind="detector",
        title="The detector lab",
        about=ABOUT,
        evidence=_evidence(stage, planted),
        controls=named_controls(*NAMES),
        presets=PRESETS,
        params=paper_with,
        numbers=partial(detector_numbers, stage, planted),
        words=LAB_SENTENCES,
    )


def _evidence(stage: Stage, planted: FloatArray | None) -> dict[str, Any]:
    """Curves that are not yet smoothed, for every rate and smoothing of positions; the browser does the rest."""
    rates = {f"{fps:g}": paper_with(fps=fps) for fps in RATES if fps is not None}
    rates["own"], rates["interpolated"] = paper_with(fps=None), paper_with(fps=None, subframe=True)
    motion = stage.motion
    return {
        "source": stage.source,
        "duration": motion.duration,
        "music": stage.music.times,
        "planted": planted,
        "near": NEAR,
        "levels": list(POSITION_SMOOTHINGS),
        "rates": {name: _curves(stage, params) for name, params in rates.items()},
        "valid": {"fps": motion.fps, "frames": motion.n_frames, "gaps": np.flatnonzero(~motion.valid)},
    }


def _curves(stage: Stage, params: HarmonyParams) -> dict[str, Any]:
    """Rate, and the curve of each kind at each smoothing of positions; base64 of doubles, which loses no digit."""
    kinds = {"joints": "turns", "direction": "direction"}
    curves = {
        kind: [
            motion_curve(stage.motion, with_settings(params, detector=detector, position_smoothing=level))
            for level in POSITION_SMOOTHINGS
        ]
        for kind, detector in kinds.items()
    }
    return {
        "fps": curves["joints"][0][1],
        "curves": {kind: [_base64(curve) for curve, _ in levels] for kind, levels in curves.items()},
    }


def _base64(values: FloatArray) -> str:
    return base64.b64encode(values.astype("<f8").tobytes()).decode("ascii")


def detector_numbers(stage: Stage, planted: FloatArray | None, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: visual beats, which planted ones are near one of them, and the sentence.

    Parameters
    ----------
    stage : Stage
    planted : (P,) array, seconds on the stage's time line, or None
    **values
        The controls, by name; the paper's when left out.
    """
    visual = visual_beats(stage.motion, params=paper_with(**values))
    near = None if planted is None else nearest_intervals(planted, visual.times) <= NEAR
    counts = {
        "beats": len(visual),
        "music": len(stage.music),
        "planted": 0 if planted is None else planted.size,
        "found": 0 if near is None else int(near.sum()),
        "near": round(1000 * NEAR),
    }
    distances = nearest_intervals(visual.times, stage.music.times)
    return {
        **counts,
        "times": visual.times,
        "heights": visual.strengths,
        "mask": near,
        "rate": len(visual) / stage.motion.duration,
        "distance": float(np.median(distances)) if len(visual) and len(stage.music) else np.nan,
        "sentence": LAB_SENTENCES["detected" if planted is None else "planted"].format(**counts),
    }
