"""The field's other measures of music and motion, in seconds, each with its source and its pitfalls.

They are what papers report, so a reader can compare. None of them subtracts what chance would reach: read them beside
`chance` and `harmony_above_chance`, never alone.
"""

import warnings
from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harmolab.params import HarmonyParams
from harmolab.score import checked_times, hit_mask, nearest_intervals
from harmolab.types import BeatTrack, FloatArray, check_kind

AIST_SIGMA = 3 / 60  # seconds: 3 frames at AIST++'s 60 fps
AIST_SMOOTHING = 5 / 60  # seconds: 5 frames at 60 fps


def kinematic_params() -> HarmonyParams:
    """Settings of AIST++'s motion beats: minima of the joint speed smoothed by 5 frames at 60 fps, here in seconds.

    Notes
    -----
    They lie on frames, as published: `harmolab score` and `compare` take them so. `harmolab evaluate` compares systems
    of different frame rates, and takes the same minima between frames (``replace(kinematic_params(), subframe=True)``):
    at 30 frames a second its scores are .01 to .05 apart from these.
    """
    return HarmonyParams(detector="valleys", fps=None, smoothing=AIST_SMOOTHING, visual_threshold=None)


def beat_align(queries: ArrayLike, targets: ArrayLike, *, sigma: float = AIST_SIGMA) -> float:
    """Mean of exp(-d^2 / (2 sigma^2)) over `queries`, d the distance to the nearest target (Li et al. 2021, AIST++).

    Parameters
    ----------
    queries, targets : (B,) arrays, seconds
        Motion beats and music beats give "beat_align_motion"; exchanged they give "beat_align_music".
    sigma : float, seconds

    Returns
    -------
    float in [0, 1]; 0 when either side is empty.

    Raises
    ------
    ValueError
        If the times are no lists of finite numbers, or sigma is not positive.

    Notes
    -----
    Over motion beats, one well-placed beat scores 1; over music beats, a motion that turns all the time does. Published
    codes give sigma in frames, so their scores change with the frame rate.

    Examples
    --------
    >>> beat_align(np.array([1.0]), np.array([1.0, 2.0]))
    1.0
    """
    if not sigma > 0:
        raise ValueError(f"sigma must be positive, got {sigma}")
    intervals = nearest_intervals(checked_times(queries, "queries"), checked_times(targets, "targets"))
    return float(np.exp(-(intervals**2) / (2 * sigma**2)).mean()) if intervals.size else 0.0


def beat_coverage(n_visual: int, n_audio: int) -> float:
    """Motion beats per music beat (Lee et al. 2019); 0 without music beats. More is not better: jitter raises it."""
    return n_visual / n_audio if n_audio else 0.0


def beat_hit_rate(visual_times: FloatArray, audio_times: FloatArray, *, delay: float = 0.1) -> float:
    """Share of motion beats within `delay` seconds of a music beat (Lee et al. 2019); 0 without motion beats.

    The source gives no tolerance; the faster the music, the easier a hit.
    """
    return float(hit_mask(visual_times, audio_times, delay=delay).mean()) if len(visual_times) else 0.0


def _p_score(music: FloatArray, motion: FloatArray) -> float:
    """mir_eval's P-score: pairs of beats within a fifth of the beat interval, at 100 Hz, per beat of the longer list.

    mir_eval correlates the whole song with itself to count them: 15 s for ten minutes of music.
    """
    start = min(music[0], motion[0])
    reference, estimate = (np.unique(np.ceil((times - start) * 100)) for times in (music, motion))
    reach = np.round(0.2 * np.median(np.diff(reference)))
    pairs = np.searchsorted(estimate, reference + reach, "right") - np.searchsorted(estimate, reference - reach, "left")
    return float(pairs.sum() / max(music.size, motion.size))


MIR_EVAL_NAMES = ("f", "cemgil", "goto", "p_score", "cmlc", "cmlt", "amlc", "amlt", "information_gain")


def mir_eval_scores(
    audio_times: ArrayLike, visual_times: ArrayLike, *, only: Collection[str] = MIR_EVAL_NAMES
) -> dict[str, float]:
    """The beat-tracking measures of mir_eval, music beats as reference, motion beats as estimate.

    mir_eval drops the first five seconds by default, which of a 6 s clip leaves nothing; nothing is dropped here.
    They were made for trackers that hear the music: a dancer who moves on every second beat is punished by most of
    them.

    Returns
    -------
    dict of "mir_eval_" + name for the names of `only`; all 0 with fewer than two beats on either side, or when those of
    one side lie within a hundredth of a second, which is the finest that mir_eval can tell apart.

    Raises
    ------
    ValueError
        If the times are no rising lists of finite numbers, or `only` names what is no measure.
    """
    audio_times, visual_times = checked_times(audio_times, "audio_times"), checked_times(visual_times, "visual_times")
    if any((np.diff(times) < 0).any() for times in (audio_times, visual_times)):
        raise ValueError("audio_times and visual_times must rise; sort them")
    if unknown := set(only) - set(MIR_EVAL_NAMES):
        raise ValueError(f"no measure is called {', '.join(unknown)}; there are {', '.join(MIR_EVAL_NAMES)}")
    if min(len(audio_times), len(visual_times)) < 2 or min(np.ptp(audio_times), np.ptp(visual_times)) <= 0.01:
        return {f"mir_eval_{name}": 0.0 for name in only}
    # Imported late: it takes a second, and only callers of this function need it.
    import mir_eval.beat as judge

    measures: dict[str, Callable[[FloatArray, FloatArray], Any]] = {
        "f": judge.f_measure,
        "cemgil": lambda music, motion: judge.cemgil(music, motion)[0],
        "goto": judge.goto,
        "p_score": _p_score,
        "information_gain": judge.information_gain,
    }
    tracking = ("cmlc", "cmlt", "amlc", "amlt")
    with warnings.catch_warnings():
        # mir_eval takes means of nothing where few beats match; what it makes of them is a score of 0.
        warnings.simplefilter("ignore", RuntimeWarning)
        # Where beats lie close together mir_eval counts some of them twice, and two of its measures exceed 1.
        values = {
            name: min(float(score(audio_times, visual_times)), 1.0) for name, score in measures.items() if name in only
        }
    if set(tracking) & set(only):
        values.update(zip(tracking, map(float, judge.continuity(audio_times, visual_times)), strict=True))
    return {f"mir_eval_{name}": values[name] for name in only}


def other_scores(
    audio_track: BeatTrack, kinematic_track: BeatTrack, *, only: Collection[str] = MIR_EVAL_NAMES
) -> dict[str, float]:
    """All measures of this module for one clip, of mir_eval's those in `only`; `kinematic_track` as found with
    `kinematic_params`. ValueError unless a BeatTrack is passed; `beat_align` and `mir_eval_scores` take seconds.
    """
    for track in (audio_track, kinematic_track):
        check_kind(track, BeatTrack)
    audio, visual = audio_track.times, kinematic_track.times
    return {
        "beat_align_motion": beat_align(visual, audio),
        "beat_align_music": beat_align(audio, visual),
        "beat_coverage": beat_coverage(len(visual), len(audio)),
        "beat_hit_rate": beat_hit_rate(visual, audio),
        **mir_eval_scores(audio, visual, only=only),
    }
