"""The paper's harmony score: intervals, hits, hitting score, F-measure, chance level (Eq. 10, 14-21).

The functions stand in the order of the equations. `score_harmony` puts them together for two beat tracks;
`score_motion` and `score_clip` start from a motion and from a clip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from harmolab.beats.audio import audio_beats
from harmolab.beats.saliency import salient_audio, salient_visual
from harmolab.beats.visual import visual_beats
from harmolab.metrics import kinematic_params, other_scores
from harmolab.params import HarmonyParams
from harmolab.pattern import PatternFit, fit_of_motion
from harmolab.significance import bootstrap_interval, p_value, rotated_shares
from harmolab.types import Audio, BeatTrack, Clip, HarmonyScore, Motion

__all__ = [
    "above_chance",
    "chance_level",
    "f_score",
    "first_shared",
    "harmony_from_hits",
    "hit_mask",
    "hit_pairs",
    "hitting_score",
    "interval_matrix",
    "nearest_intervals",
    "overlap",
    "position_matrix",
    "score_clip",
    "score_harmony",
    "score_motion",
]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

# Distances are compared in floating point; a beat exactly at the delay must stay a hit.
EDGE = 1e-9


def position_matrix(visual_times: FloatArray, n_audio: int) -> FloatArray:
    """Z: the M visual beat positions repeated for each of the N music beats, (N, M) (Eq. 15)."""
    return np.broadcast_to(visual_times, (n_audio, visual_times.size))


def interval_matrix(audio_times: FloatArray, visual_times: FloatArray) -> FloatArray:
    """D: absolute distance of every music beat to every visual beat, (N, M) seconds (Eq. 16).

    The printed formula subtracts visual beats from themselves; the text says audio minus visual.
    """
    return np.abs(position_matrix(visual_times, audio_times.size) - audio_times[:, None])


def nearest_intervals(audio_times: FloatArray, visual_times: FloatArray) -> FloatArray:
    """T: distance of each music beat to its nearest visual beat, (N,) seconds (Eq. 17); infinite without any."""
    if visual_times.size == 0:
        return np.full(audio_times.size, np.inf)
    return interval_matrix(audio_times, visual_times).min(axis=1)


def hit_mask(audio_times: FloatArray, visual_times: FloatArray, *, delay: float, matching: str = "many") -> BoolArray:
    """Hp: which music beats have a visual beat within the delay (Eq. 18).

    Parameters
    ----------
    audio_times : (N,) array, seconds
    visual_times : (M,) array, seconds
    delay : float, seconds
        T_delay; a beat exactly this far away is a hit.
    matching : "many", "nearest" or "max"
        One visual beat may serve many music beats (paper mode), or one only: each music beat in turn takes the
        nearest one that is left (Fig. 1), or as many pairs as possible.

    Returns
    -------
    (N,) bool array; all False if there are no visual beats.
    """
    if matching == "many" or visual_times.size == 0:
        return nearest_intervals(audio_times, visual_times) <= delay + EDGE
    return hit_pairs(audio_times, visual_times, delay=delay, matching=matching) >= 0


def hit_pairs(
    audio_times: FloatArray, visual_times: FloatArray, *, delay: float, matching: str = "nearest"
) -> IntArray:
    """Which visual beat hits each music beat: (N,) indices into `visual_times`, -1 for a miss (Eq. 18).

    Parameters are those of `hit_mask`. Visual beats that no index names are redundant (caption of Fig. 3).
    """
    if audio_times.size == 0 or visual_times.size == 0:
        return np.full(audio_times.size, -1, dtype=np.int64)
    intervals = interval_matrix(audio_times, visual_times)
    if matching == "max":
        pairs = maximum_bipartite_matching(csr_array(intervals <= delay + EDGE), perm_type="column")
        return pairs.astype(np.int64)
    if matching == "many":
        nearest = intervals.argmin(axis=1)
        return np.where(intervals.min(axis=1) <= delay + EDGE, nearest, -1).astype(np.int64)
    return _in_order(intervals, delay)


def _in_order(intervals: FloatArray, delay: float) -> IntArray:
    """Pairs when each music beat in turn takes its nearest visual beat not yet taken (caption of Fig. 1)."""
    free = intervals.copy()
    pairs = np.full(len(free), -1, dtype=np.int64)
    for beat, distances in enumerate(free):
        nearest = int(np.argmin(distances))
        if distances[nearest] <= delay + EDGE:
            pairs[beat] = nearest
            free[:, nearest] = np.inf
    return pairs


def hitting_score(hits: BoolArray, strengths: FloatArray) -> float:
    """h_s: the strengths of the music beats that were hit, added up (Eq. 19)."""
    return float(hits @ strengths)


def f_score(audio_harmony: float, visual_harmony: float, beta: float) -> float:
    """h: weighted harmonic mean of h_a = h_s / N and h_v = h_s / M (Eq. 20); 0 when both are 0."""
    below = beta**2 * visual_harmony + audio_harmony
    return (1 + beta**2) * audio_harmony * (visual_harmony / below) if below > 0 else 0.0


def harmony_from_hits(score: float, n_audio: int, n_visual: int, beta: float) -> float:
    """h as a function of h_s, N and M (Eq. 21); 0 when either side has no beats.

    Lemma 3.1 calls h "uniquely determined by h_s"; that holds only at fixed N and M.
    """
    if n_audio == 0 or n_visual == 0:
        return 0.0
    return (1 + beta**2) * score / (n_audio * beta**2 + n_visual)


def chance_level(visual_times: FloatArray, *, delay: float, duration: float) -> float:
    """c: share of the clip within the delay of a visual beat, which is what a random music beat would score."""
    if visual_times.size == 0:
        return 0.0
    starts = np.maximum(visual_times - delay, 0.0)
    ends = np.minimum(visual_times + delay, duration)
    # Sorted beats: each adds what lies beyond the end of all before it.
    reached = np.concatenate([[0.0], np.maximum.accumulate(ends)[:-1]])
    return float(np.maximum(ends - np.maximum(starts, reached), 0.0).sum() / duration)


def above_chance(share: float, chance: float) -> float:
    """h_cc = (share - c) / (1 - c): 0 is chance, 1 is everything; 0 when chance already reaches everything."""
    return (share - chance) / (1 - chance) if chance < 1 - EDGE else 0.0


def score_harmony(
    audio_track: BeatTrack,
    visual_track: BeatTrack,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of two beat tracks on the same time line (Eq. 10, 14-21), by hits.

    Parameters
    ----------
    audio_track, visual_track : BeatTrack
        All detected beats; saliency (Eq. 11-13) is applied inside.
    params : HarmonyParams, default ``HarmonyParams.paper()``
    n_rotations : int
        Rotations of the null behind `p_value`, and resamplings behind `interval`; 0 leaves both NaN.

    Returns
    -------
    HarmonyScore; with no beats on one side everything is 0, and nothing fails.

    Examples
    --------
    >>> beats = BeatTrack([1.0, 2.0, 3.0], [1.0, 1.0, 1.0], 15.0, 4.0)
    >>> score_harmony(beats, beats, params=HarmonyParams.valleys()).harmony
    1.0
    """
    chosen = params or HarmonyParams.paper()
    audio, visual = salient_audio(audio_track, chosen), salient_visual(visual_track, chosen)
    visual_times = visual.times - chosen.lag
    hits = hit_mask(audio.times, visual_times, delay=chosen.reaction_delay, matching=chosen.matching)
    chance = chance_level(visual_times, delay=chosen.reaction_delay, duration=audio.duration)
    score = _score(audio, visual_times, hits, chance, audio_track, chosen)
    if n_rotations == 0 or len(audio) == 0 or len(visual) == 0:
        return score
    null = rotated_shares(
        audio.times,
        np.sort(np.mod(visual_times, audio.duration)),
        audio.strengths,
        delay=chosen.reaction_delay,
        duration=audio.duration,
        count=n_rotations,
    )
    low, high = bootstrap_interval(hits, audio.strengths, count=n_rotations, seed=seed)
    return replace(
        score,
        p_value=p_value(score.hitting_score, null),
        interval=(above_chance(low, chance), above_chance(high, chance)),
    )


def _score(
    audio: BeatTrack,
    visual_times: FloatArray,
    hits: BoolArray,
    chance: float,
    all_audio: BeatTrack,
    params: HarmonyParams,
) -> HarmonyScore:
    """The numbers of Eq. 19-21 from the hits; the hit rate counts all music beats, salient or not."""
    score, total = hitting_score(hits, audio.strengths), float(audio.strengths.sum())
    all_hits = hit_mask(all_audio.times, visual_times, delay=params.reaction_delay, matching=params.matching)
    rate = all_hits.mean() if len(all_audio) else 0.0
    n_audio, n_visual = len(audio), visual_times.size
    return HarmonyScore(
        harmony=harmony_from_hits(score, n_audio, n_visual, params.beta),
        audio_harmony=score / n_audio if n_audio else 0.0,
        visual_harmony=score / n_visual if n_visual else 0.0,
        hitting_score=score,
        hit_rate=float(rate),
        chance=chance,
        harmony_above_chance=above_chance(score / total, chance) if total > 0 and n_visual else 0.0,
        hits=hits,
        intervals=nearest_intervals(audio.times, visual_times),
        n_audio=n_audio,
        n_visual=n_visual,
    )


def score_motion(
    audio_track: BeatTrack,
    motion: Motion,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of a motion with music beats given on the motion's own time line, by the measure `params` names.

    Cut the beats to the motion first (`overlap` does it for a clip): all of them count.
    """
    chosen = params or HarmonyParams.paper()
    timed = replace(motion, fps=motion.fps / chosen.clock)
    visual = visual_beats(timed, params=chosen)
    if chosen.measure == "hits":
        score = score_harmony(audio_track, visual, params=chosen, n_rotations=n_rotations, seed=seed)
    else:
        fit = fit_of_motion(audio_track, timed, chosen, n_rotations=n_rotations)
        score = _pattern_score(audio_track, visual, fit, chosen, n_rotations, seed)
    kinematic = visual_beats(timed, params=kinematic_params())
    return replace(score, others=other_scores(audio_track, kinematic))


def _pattern_score(
    audio_track: BeatTrack, visual: BeatTrack, fit: PatternFit, params: HarmonyParams, count: int, seed: int
) -> HarmonyScore:
    """A pattern fit in the terms of the paper: a music beat is hit where it fits better than the median moment."""
    audio = salient_audio(audio_track, params)
    score = _score(audio, visual.times - params.lag, fit.shares > 0.5, fit.chance, audio_track, params)
    score = replace(
        score,
        hit_rate=float((fit.shares > 0.5).mean()) if fit.shares.size else 0.0,
        harmony_above_chance=above_chance(fit.mean, fit.chance) if fit.shares.size else 0.0,
    )
    if count == 0 or fit.shares.size == 0:
        return score
    low, high = bootstrap_interval(fit.shares, fit.weights, count=count, seed=seed)
    return replace(
        score,
        p_value=p_value(fit.mean, fit.null),
        interval=(above_chance(low, fit.chance), above_chance(high, fit.chance)),
    )


def score_clip(
    clip: Clip,
    params: HarmonyParams | None = None,
    *,
    tracker: Callable[[Audio], BeatTrack] = audio_beats,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of a clip (Eq. 1, 6), with its annotated beats or else those the tracker finds in the whole recording.

    Only the time that motion and music have in common counts.

    Parameters
    ----------
    clip : Clip with a motion
    params : HarmonyParams, default ``HarmonyParams.paper()``
    tracker : function from Audio to BeatTrack
        Another beat tracker, or ``lambda audio: load_beats("song.beats")``.

    Raises
    ------
    ValueError
        If the clip has no motion, or motion and music hardly overlap.
    """
    chosen = params or HarmonyParams.paper()
    track = clip.beats if clip.beats is not None else tracker(clip.audio)
    music, motion = overlap(clip, track, clock=chosen.clock)
    return score_motion(music, motion, params=chosen, n_rotations=n_rotations, seed=seed)


def overlap(clip: Clip, track: BeatTrack, *, clock: float = 1.0) -> tuple[BeatTrack, Motion]:
    """The stretch that music and motion share: the music's beats on the time line of the motion, and the motion.

    Parameters
    ----------
    clip : Clip with a motion
    track : BeatTrack on the clip's audio time line
    clock : float, time stretch of the motion

    Raises
    ------
    ValueError
        If the clip has no motion, or motion and music hardly overlap.
    """
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to score")
    frame = clock / clip.motion.fps  # seconds of music
    skipped, start = first_shared(clip.offset, frame)
    length = min((clip.motion.n_frames - skipped) * frame, clip.audio.duration - start)
    if length < 2 * frame - EDGE:
        raise ValueError(f"{clip.name}: motion and music meet in less than two frames")
    return track.span(start, length), clip.motion.span(skipped / clip.motion.fps, length / clock)


def first_shared(offset: float, frame: float) -> tuple[int, float]:
    """The motion's first frame inside the music, and not up to half a frame before: its number, its audio time.

    Parameters
    ----------
    offset, frame : float, seconds of music: where frame 0 lies, and how long a frame lasts
    """
    skipped = max(0, int(np.ceil(-offset / frame - EDGE)))
    return skipped, max(offset + skipped * frame, 0.0)
