"""The saliency lab: which beats a listener or viewer would notice (Eq. 10-13)."""

from functools import partial
from typing import Any

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.lab.labs import live
from harmolab.lab.player import LAB_SENTENCES
from harmolab.score import audio_mask, normalise_strengths, visual_mask
from harmolab.types import BeatTrack, Clip

LAMBDAS = np.linspace(0.0, 15.0, 151)
UNITS = {"max": "of the largest", "mean": "of the mean", "raw": "as measured"}


def saliency_lab(clip: Clip, **values: Any) -> live.LiveLab:
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
    stage = live.Stage.of(clip)
    visual = visual_beats(stage.motion, params=live.MODES["paper"])
    about, presets = live.lab_texts("saliency", loud=live.middle_lambda(stage.music))
    content = live.LabContent(
        kind="saliency",
        about=about,
        evidence={
            "source": stage.source,
            "duration": stage.motion.duration,
            "music": live.track_evidence(stage.music),
            "dance": live.track_evidence(visual),
            "lambdas": LAMBDAS,
            "units": UNITS,
        },
        controls=live.lab_controls("saliency"),
        presets=presets,
        numbers=partial(saliency_numbers, stage, visual),
    )
    return live.LiveLab(content, values)


def saliency_numbers(stage: live.Stage, visual: BeatTrack, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: masks of both tracks, the shares kept at every λ, and the sentence.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    **values
        The controls, by name; the paper's when left out.
    """
    params = live.lab_params(**values)
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
