"""The beat-detector lab: the moments that are visual beats, and the curve from which they are read."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harmolab.beats.visual import visual_beats
from harmolab.lab.labs.live import LabContent, LiveLab, Stage, curve_evidence, lab_controls, lab_params, lab_texts
from harmolab.lab.player import LAB_SENTENCES
from harmolab.score import nearest_intervals
from harmolab.types import BeatTrack, Clip, FloatArray
from harmolab.verdict.judge import music_and_motion

NEAR = 0.05  # seconds: a planted beat with a detected one this close is a detected beat


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
    stage, controls = Stage.of(clip), lab_controls("detector")
    times = None if planted is None else _on_stage(clip, planted)
    evidence = {
        "source": stage.source,
        "duration": stage.motion.duration,
        "music": stage.music.times,
        "planted": times,
        "near": NEAR,
        **curve_evidence(stage.motion, controls),
    }
    about, presets = lab_texts("detector")
    numbers = partial(detector_numbers, stage, times)
    return LiveLab(LabContent("detector", about, evidence, controls, presets, numbers), values)


def _on_stage(clip: Clip, planted: ArrayLike) -> FloatArray:
    """Planted times on the time line of the stage."""
    times = np.sort(np.asarray(planted, np.float64))
    track = BeatTrack(times, np.ones(times.size), fps=100.0, duration=clip.audio.duration)
    return music_and_motion(replace(clip, beats=track))[0].times


def detector_numbers(stage: Stage, planted: FloatArray | None, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: visual beats, which planted ones are near one of them, and the sentence.

    Parameters
    ----------
    stage : Stage
    planted : (P,) array, seconds on the stage's time line, or None
    **values
        The controls, by name; the paper's when left out.
    """
    visual = visual_beats(stage.motion, params=lab_params(**values))
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
