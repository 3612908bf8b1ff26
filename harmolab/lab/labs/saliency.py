"""The saliency lab: which beats a listener or viewer would notice (Eq. 10-13)."""

from functools import partial
from typing import Any

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.lab.labs.live import (
    MODES,
    LabContent,
    LiveLab,
    Preset,
    Stage,
    lab_controls,
    lab_params,
    middle_lambda,
    track_evidence,
)
from harmolab.lab.player import LAB_SENTENCES
from harmolab.score import audio_mask, normalise_strengths, visual_mask
from harmolab.types import BeatTrack, Clip

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
    visual = visual_beats(stage.motion, params=MODES["paper"])
    content = LabContent(
        kind="saliency",
        about=ABOUT,
        evidence={
            "source": stage.source,
            "duration": stage.motion.duration,
            "music": track_evidence(stage.music),
            "dance": track_evidence(visual),
            "lambdas": LAMBDAS,
            "units": UNITS,
        },
        controls=lab_controls("saliency"),
        presets=_presets(middle_lambda(stage.music)),
        numbers=partial(saliency_numbers, stage, visual),
    )
    return LiveLab(content, values)


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


def saliency_numbers(stage: Stage, visual: BeatTrack, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: masks of both tracks, the shares kept at every λ, and the sentence.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    **values
        The controls, by name; the paper's when left out.
    """
    params = lab_params(**values)
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
