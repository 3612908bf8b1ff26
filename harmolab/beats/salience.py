"""Salience: which beats a viewer or a listener would notice (Eq. 11-13, paper Sec. 3.3.1).

The paper calls these beats *attentional*. Its masks W_a(b) and W_v(b) are 1 for them and 0 for all others; p'_a, s'_a
and p'_v, s'_v are times and strengths of the beats that are kept. SD is the standard deviation over all beats.
"""

from dataclasses import replace

import numpy as np

from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, FloatArray


def audio_mask(strengths: FloatArray, threshold: float, *, reading: str = "threshold") -> BoolArray:
    """W_a(b): which music beats are attentional, so that a listener notices them (Eq. 11).

    Parameters
    ----------
    strengths : (N,) array, s_a
    threshold : float, lambda_1
    reading : "threshold" or "literal"
        s_a > lambda_1 SD(s_a), or the formula as printed: sign(s_a - SD(s_a)) * lambda_1 > 0, in which the size of
        lambda_1 cannot matter.

    Returns
    -------
    (N,) bool array
    """
    spread = strengths.std() if strengths.size else 0.0
    if reading == "literal":
        return np.sign(strengths - spread) * threshold > 0
    return strengths > threshold * spread


def strength_steps(strengths: FloatArray) -> FloatArray:
    """R(b): difference in strength of each visual beat, such as a peak, to the one before, a valley (Eq. 12).

    (M,) for (M,) strengths s_v. The first beat, which has none before it, has the difference of the second.

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
    """W_v(b): which visual beats are attentional, so that a viewer notices them (Eq. 13).

    A beat is kept where R(b) > lambda_2 SD(R); SD is over R(2) to R(M), which Eq. 12 defines.

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

    Returns
    -------
    (M,) bool array
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
    """The attentional music beats: those that a listener notices, with their strengths on one scale (Eq. 11).

    Parameters
    ----------
    track : BeatTrack
        All beats of the music.
    params : HarmonyParams
        `normalisation`, `audio_threshold` (lambda_1) and `saliency` are read.

    Returns
    -------
    BeatTrack with times p'_a and strengths s'_a

    Examples
    --------
    >>> beats = BeatTrack([0.5, 1.0, 1.5], [4.0, 0.1, 2.0], 100.0, 2.0)
    >>> salient_audio(beats, HarmonyParams.paper()).strengths.tolist()
    [1.0, 0.5]
    """
    strengths = normalise_strengths(track.strengths, params.normalisation)
    mask = audio_mask(strengths, params.audio_threshold, reading=params.saliency)
    return replace(track, strengths=strengths).select(mask)


def salient_visual(track: BeatTrack, params: HarmonyParams) -> BeatTrack:
    """The attentional visual beats: those that a viewer notices (Eq. 12-13).

    Parameters
    ----------
    track : BeatTrack
        All visual beats of the movement.
    params : HarmonyParams
        `visual_threshold` (lambda_2), `saliency`, `visual_saliency` and `first_beat` are read.

    Returns
    -------
    BeatTrack with times p'_v and strengths s'_v
    """
    readings = {"reading": params.saliency, "quantity": params.visual_saliency, "first_beat": params.first_beat}
    return track.select(visual_mask(track.strengths, params.visual_threshold, **readings))
