"""Salience: which beats a viewer or a listener would notice (Eq. 11-13, paper Sec. 3.3.1)."""

from dataclasses import replace

import numpy as np

from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, FloatArray


def audio_mask(strengths: FloatArray, threshold: float, *, reading: str = "threshold") -> BoolArray:
    """W_a: which music beats are attentional (Eq. 11).

    Parameters
    ----------
    strengths : (N,) array, s_a
    threshold : float, lambda_1
    reading : "threshold" or "literal"
        s_a > lambda_1 SD(s_a), or the formula as printed: sign(s_a - SD(s_a)) * lambda_1 > 0, in which lambda_1
        cannot matter.
    """
    if strengths.size == 0:
        return np.zeros(0, dtype=bool)
    if reading == "literal":
        return np.sign(strengths - strengths.std()) * threshold > 0
    return strengths > threshold * strengths.std()


def strength_steps(strengths: FloatArray) -> FloatArray:
    """R (M,): peak-to-valley difference of each visual beat to the one before (Eq. 12); R(1) := R(2).

    >>> strength_steps(np.array([3.0, 1.0, 4.0]))
    array([2., 2., 3.])
    """
    if strengths.size < 2:
        return np.zeros(strengths.size)
    steps = np.abs(np.diff(strengths))
    return np.concatenate([steps[:1], steps])


def visual_mask(
    strengths: FloatArray,
    threshold: float | None,
    *,
    reading: str = "threshold",
    quantity: str = "difference",
    first_beat: str = "copy",
) -> BoolArray:
    """W_v: which visual beats are attentional (Eq. 13); SD is over the defined R(2..M).

    Parameters
    ----------
    strengths : (M,) array, s_v
    threshold : float or None, lambda_2
        None keeps every beat.
    reading : "threshold" or "literal", as in `audio_mask`
    quantity : "difference" or "strength"
        Compare R (the text) or s_v (the formula) with lambda_2 SD(R).
    first_beat : "copy" or "drop"
        The first beat has no R of its own: give it the second's, or leave it out.
    """
    if threshold is None or strengths.size == 0:
        return np.ones(strengths.size, dtype=bool)
    steps = strength_steps(strengths)
    spread = steps[1:].std() if steps.size > 1 else 0.0
    compared = strengths if quantity == "strength" else steps
    mask = np.sign(compared - spread) * threshold > 0 if reading == "literal" else compared > threshold * spread
    if first_beat == "drop":
        mask[0] = False
    return mask


def normalise_strengths(strengths: FloatArray, how: str) -> FloatArray:
    """Strengths (N,) over their maximum ("max"), over their mean ("mean") or as they are ("raw")."""
    if how == "raw" or strengths.size == 0:
        return strengths
    scale = strengths.max() if how == "max" else strengths.mean()
    return strengths / scale if scale > 0 else strengths


def salient_audio(track: BeatTrack, params: HarmonyParams) -> BeatTrack:
    """The attentional music beats p'_a with strengths s'_a."""
    strengths = normalise_strengths(track.strengths, params.normalisation)
    mask = audio_mask(strengths, params.audio_threshold, reading=params.saliency)
    return replace(track, strengths=strengths).select(mask)


def salient_visual(track: BeatTrack, params: HarmonyParams) -> BeatTrack:
    """The attentional visual beats p'_v with strengths s'_v."""
    readings = {"reading": params.saliency, "quantity": params.visual_saliency, "first_beat": params.first_beat}
    return track.select(visual_mask(track.strengths, params.visual_threshold, **readings))
