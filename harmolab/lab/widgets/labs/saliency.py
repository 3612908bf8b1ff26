"""The saliency lab: which beats a listener or viewer would notice (Eq. 10-13)."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from harmolab.beats.saliency import audio_mask, normalise_strengths, strength_steps, visual_mask
from harmolab.beats.visual import visual_beats
from harmolab.lab.widgets.labs.controls import named_controls
from harmolab.lab.widgets.labs.lab import MODES
from harmolab.lab.widgets.labs.live import LabContent, LiveLab, Preset, paper_with
from harmolab.lab.widgets.labs.stage import Stage, middle_lambda
from harmolab.lab.widgets.words import LAB_SENTENCES
from harmolab.params import CHOICES
from harmolab.types import BeatTrack, Clip

NAMES = ("lambda1", "lambda2", "normalisation", "saliency", "visual_saliency", "first_beat")
LAMBDAS = np.linspace(0.0, 15.0, 151)
UNITS = {"max": "of the largest", "mean": "of the mean", "raw": "as measured"}
ABOUT = (
    "The longer a stem, the more the beat stands out. Beats below the dotted threshold are grey: they do not count. At "
    "the right: the share that any threshold would keep, and where the sliders stand."
)


def saliency_lab(clip: Clip, **values: Any) -> LiveLab:
    """Sliders for λ1 and λ2 and menus for the readings of Eq. 10-13, below the beats that are kept and dropped.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    **values
        Where controls start instead of at the paper mode: ``lambda2=2.0``.

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = saliency_lab(synthetic_clip("cha-cha"), lambda1=3.0)  # doctest: +SKIP
    """
    stage = Stage.of(clip)
    return LiveLab(saliency_content(stage, visual_beats(stage.motion, params=MODES["paper"])), values)


def saliency_content(stage: Stage, visual: BeatTrack) -> LabContent:
    """The saliency lab of a stage and the visual beats of its motion."""
    return LabContent(
        kind="saliency",
        title="The saliency lab",
        about=ABOUT,
        evidence=_evidence(stage, visual),
        controls=named_controls(*NAMES),
        presets=_presets(middle_lambda(stage.music)),
        params=paper_with,
        numbers=partial(saliency_numbers, stage, visual),
        words=LAB_SENTENCES,
    )


def _presets(loud: float) -> tuple[Preset, ...]:
    """The buttons; `loud` is the λ1 of the one for loud beats."""
    return (
        Preset("the paper's", {}, "λ1 = 0.1 lies below almost any music beat, and λ2 = 1 keeps most movements."),
        Preset("loud beats only", {"lambda1": loud}, "Beat after beat of the music turns grey as the threshold rises."),
        Preset("large movements only", {"lambda2": 2.0}, "Small turns of the dance go first."),
        Preset(
            "of the mean", {"normalisation": "mean"}, "The axis of the music changes; the choice of beats is the same."
        ),
        Preset(
            "as printed",
            {"saliency": "literal"},
            "The formula of the paper as printed: one standard deviation, whatever λ is, unless it is 0.",
        ),
        Preset(
            "by speed",
            {"visual_saliency": "strength"},
            "Slowest moments go and fastest stay, since a slow moment has little speed.",
        ),
        Preset(
            "without the first",
            {"first_beat": "drop"},
            "The first movement has no step of its own: it takes the second's, or is left out, as now.",
        ),
    )


def _evidence(stage: Stage, visual: BeatTrack) -> dict[str, Any]:
    strengths = {how: normalise_strengths(stage.music.strengths, how) for how in CHOICES["normalisation"]}
    steps = strength_steps(visual.strengths)
    return {
        "source": stage.source,
        "duration": stage.motion.duration,
        "times": stage.music.times,
        "music": {
            how: {"strengths": row, "spread": row.std() if row.size else 0.0, "unit": UNITS[how]}
            for how, row in strengths.items()
        },
        "dance": {
            "times": visual.times,
            "speeds": visual.strengths,
            "steps": steps,
            "spread": steps[1:].std() if steps.size > 1 else 0.0,
        },
        "lambdas": LAMBDAS,
    }


def saliency_numbers(stage: Stage, visual: BeatTrack, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: masks of both tracks, the shares kept at every λ, and the sentence.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    **values
        The controls, by name; the paper's when left out.
    """
    params = paper_with(**values)
    strengths = normalise_strengths(stage.music.strengths, params.normalisation)
    music = partial(audio_mask, strengths, reading=params.saliency)
    dance = partial(
        visual_mask,
        visual.strengths,
        reading=params.saliency,
        quantity=params.visual_saliency,
        first_beat=params.first_beat,
    )
    masks = music(threshold=params.audio_threshold), dance(threshold=params.visual_threshold)
    counts = {"music": masks[0].sum(), "beats": len(stage.music), "dance": masks[1].sum(), "movements": len(visual)}
    return {
        **{name: int(count) for name, count in counts.items()},
        "music_mask": masks[0],
        "dance_mask": masks[1],
        "music_shares": [music(threshold=value).mean() for value in LAMBDAS] if len(stage.music) else [],
        "dance_shares": [dance(threshold=value or None).mean() for value in LAMBDAS] if len(visual) else [],
        "sentence": LAB_SENTENCES["kept"].format(**counts),
    }
