"""The field's other measures of music and motion, in seconds, each with its source and its pitfalls.

Papers report them, so they make results comparable. None of them subtracts what chance would reach: read them beside
`chance` and `harmony_above_chance` of a `HarmonyScore`, never alone.
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
    """Settings of AIST++'s motion beats: minima of the joint speed, which is smoothed by 5 frames at 60 fps (1/12 s).

    Notes
    -----
    The beats lie on frames, as published: `harmolab score` and `compare` take them so. `harmolab evaluate` compares
    systems of different frame rates, and takes the same minima between frames (``replace(kinematic_params(),
    subframe=True)``). At 30 frames per second its scores are .01 to .05 apart from these.
    """
    return HarmonyParams(detector="valleys", fps=None, smoothing=AIST_SMOOTHING, visual_threshold=None)


def beat_align(queries: ArrayLike, targets: ArrayLike, *, sigma: float = AIST_SIGMA) -> float:
    """Beat alignment score of AIST++ (BeatAlign): how close the beats of one side are to those of the other.

    It is the mean over `queries` of ``exp(-d^2 / (2 sigma^2))``, where d is the distance to the nearest of `targets`
    (Li et al. 2021).

    Parameters
    ----------
    queries, targets : (Q,) and (B,) arrays, seconds
        Motion beats as queries and music beats as targets give "beat_align_motion", the published way. Exchanged they
        give "beat_align_music".
    sigma : float, seconds
        Distance at which a beat still counts .61; the default is 3 frames at 60 frames per second.

    Returns
    -------
    float from 0 to 1; 0 where either side is empty

    Raises
    ------
    ValueError
        If the times are no lists of finite numbers, or sigma is not positive.

    Notes
    -----
    Chance is not taken off. Over motion beats a dance with one well-placed beat scores 1; over music beats a movement
    that turns all the time does. Published codes give sigma in frames, so that their scores change with the frame rate
    (`harmolab.lab.PROTOCOLS` repeats them).

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
    """The beat-tracking measures of mir_eval, with music beats as the reference and motion beats as the estimate.

    They were made for programs that find the beats of music. A dancer who moves on every second beat gets little from
    most of them, and chance is not taken off. mir_eval drops the first five seconds by default, which would leave
    nothing of a clip of 6 s; here nothing is dropped.

    Parameters
    ----------
    audio_times, visual_times : (N,) and (M,) arrays, seconds
        Beats of the music and of the movement, rising.
    only : collection of str
        Measures to compute: of f, cemgil, goto, p_score, cmlc, cmlt, amlc, amlt and information_gain; all when left
        out. mir_eval's documentation defines them.

    Returns
    -------
    dict: "mir_eval_" + name -> number
        All are 0 with fewer than two beats on either side, or where those of one side lie within a hundredth of a
        second, the finest that mir_eval can tell apart.

    Raises
    ------
    ValueError
        If the times are no rising lists of finite numbers, or `only` names what is no measure.

    Examples
    --------
    >>> mir_eval_scores([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], only=["f"])
    {'mir_eval_f': 1.0}
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
    """The field's other measures of two beat tracks: beat alignment, beat coverage, beat hit rate, those of mir_eval.

    For a clip take `other_measures`; `beat_align` and `mir_eval_scores` take times in seconds.

    Parameters
    ----------
    audio_track : BeatTrack
        Beats of the music.
    kinematic_track : BeatTrack
        Beats of the movement, found by ``visual_beats(motion, params=kinematic_params())``; see
        `harmolab.metrics.beat_alignment.kinematic_params`.
    only : collection of str
        Those of mir_eval to compute, as in `mir_eval_scores`.

    Returns
    -------
    dict: name of the measure -> number
        "beat_align_motion" and "beat_align_music" (`beat_align`); "beat_coverage", motion beats per music beat;
        "beat_hit_rate", share of motion beats within .1 s of a music beat; and those of `mir_eval_scores`.

    Raises
    ------
    ValueError
        Unless two BeatTracks are passed.
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
