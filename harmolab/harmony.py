"""The paper's harmony score: intervals, hits, hitting score, F-measure, chance level (Eq. 10, 14-21).

The functions stand in the order of the equations. `score_harmony` puts them together for two beat tracks;
`score_motion` and `score_clip` start from a motion and from a clip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from harmolab.bar_pattern import fit_of_motion
from harmolab.beats.audio import music_beats
from harmolab.beats.saliency import normalise_strengths, salient_audio, salient_visual
from harmolab.beats.visual import visual_beats
from harmolab.metrics.beats import kinematic_params, other_scores
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.shape_speed import shape_speed
from harmolab.significance import bootstrap_interval, p_value, rotated_shares
from harmolab.types import Audio, BeatTrack, BoolArray, Clip, FloatArray, IntArray, Motion
from harmolab.verdict.judge import judge
from harmolab.verdict.score import HarmonyScore

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
    """The visual beat that hits each music beat: (N,) indices into `visual_times`, -1 for a miss (Eq. 18).

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
    params = params or HarmonyParams.paper()
    music, visual = salient_audio(audio_track, params), salient_visual(visual_track, params)
    times, delay = visual.times - params.lag, params.reaction_delay
    pairs = hit_pairs(music.times, times, delay=delay, matching=params.matching)
    chance, total = chance_level(times, delay=delay, duration=music.duration), float(music.strengths.sum())
    share = hitting_score(pairs >= 0, music.strengths) / total if total > 0 else chance
    score = _score(params, music, visual, pairs, (pairs >= 0).astype(np.float64), share, chance)
    every = hit_mask(audio_track.times, times, delay=delay, matching=params.matching)
    score = replace(score, hit_rate=float(every.mean()) if every.size else 0.0)
    if n_rotations == 0 or total == 0 or times.size == 0:
        return score
    return _with_null(score, None, n_rotations, seed)


def _score(
    params: HarmonyParams,
    music: BeatTrack,
    visual: BeatTrack,
    pairs: IntArray,
    shares: FloatArray,
    share: float,
    chance: float,
) -> HarmonyScore:
    """The numbers of Eq. 17 and 19-21 of attentional beats, without a null; the hit rate is that of these beats."""
    hits, n_audio, n_visual = shares > 0.5, music.times.size, visual.times.size
    hitting = hitting_score(hits, music.strengths)
    return HarmonyScore(
        params,
        music,
        visual,
        pairs,
        shares,
        share,
        harmony=harmony_from_hits(hitting, n_audio, n_visual, params.beta),
        audio_harmony=hitting / n_audio if n_audio else 0.0,
        visual_harmony=hitting / n_visual if n_visual else 0.0,
        hitting_score=hitting,
        hit_rate=float(hits.mean()) if n_audio else 0.0,
        chance=chance,
        harmony_above_chance=above_chance(share, chance),
        intervals=nearest_intervals(music.times, visual.times - params.lag),
    )


def _with_null(score: HarmonyScore, null: FloatArray | None, count: int, seed: int) -> HarmonyScore:
    """The score with its null distribution (None: that of its hits), p-value and bootstrap interval."""
    music, params = score.music, score.params
    if null is None:
        around = np.sort(np.mod(score.visual.times - params.lag, music.duration))
        delay, duration = params.reaction_delay, music.duration
        null = rotated_shares(music.times, around, music.strengths, delay=delay, duration=duration, count=count)
        null = null / music.strengths.sum()
    low, high = bootstrap_interval(score.shares, music.strengths, count=count, seed=seed)
    p = p_value(score.mean_share, null)
    interval = above_chance(low, score.chance), above_chance(high, score.chance)
    return replace(score, null=null, p_value=p, interval=interval)


def score_motion(
    audio_track: BeatTrack,
    motion: Motion,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of a motion with music beats given on the motion's own time line, by the measure `params` names.

    Cut the beats to the motion first (`Clip.shared` does it for a clip): all of them count. `params` are
    ``HarmonyParams.recommended()`` when left out. The measure "shape" has its p-value and spread without rotations.
    """
    params = params or HarmonyParams.recommended()
    timed = motion if params.clock == 1 else replace(motion, fps=motion.fps / params.clock)
    visual = visual_beats(timed, params=params)
    if params.measure == "hits":
        return score_harmony(audio_track, visual, params=params, n_rotations=n_rotations, seed=seed)
    if params.measure == "shape":
        return _judged(audio_track, timed, params, visual, seed)
    fit = fit_of_motion(audio_track, timed, params, n_rotations=n_rotations)
    # In the paper's terms a music beat is hit where it fits better than the median moment.
    share, times = fit.mean if fit.music.times.size else fit.chance, visual.times - params.lag
    pairs = hit_pairs(fit.music.times, times, delay=params.reaction_delay, matching=params.matching)
    score = _score(params, fit.music, visual, pairs, fit.shares, share, fit.chance)
    return _with_null(score, fit.null, n_rotations, seed) if n_rotations and fit.music.times.size else score


def _judged(track: BeatTrack, motion: Motion, params: HarmonyParams, visual: BeatTrack, seed: int) -> HarmonyScore:
    """The score of `judge`; in the paper's terms its movements are rests, or hits where hits were told."""
    track = replace(track, strengths=normalise_strengths(track.strengths, params.normalisation))
    late = track.times + params.lag
    music = track.select((late >= 0) & (late <= track.duration))
    shape = shape_speed(motion, smoothing=params.position_smoothing)
    judgement = judge(shape, replace(music, times=music.times + params.lag), pattern=params.pattern, seed=seed)
    pairs = hit_pairs(music.times, visual.times - params.lag, delay=params.reaction_delay, matching=params.matching)
    place = judgement.place
    if place is None:
        score = _score(params, music, visual, pairs, np.full(len(music), np.nan), np.nan, np.nan)
        return replace(score, harmony_above_chance=np.nan, judgement=judgement)
    curve = place.curve
    score = _score(params, music, visual, pairs, place.shares(len(music)), float(curve[0]), place.chance)
    return replace(
        score, null=curve, p_value=judgement.p_value, interval=judgement.harmony_interval, judgement=judgement,
        harmony_above_chance=judgement.harmony_above_chance,
    )  # fmt: skip


def score_clip(
    clip: Clip,
    params: HarmonyParams | None = None,
    *,
    tracker: Callable[[Audio], BeatTrack] | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of a clip (Eq. 1, 6), with its annotated beats or else those tracked in the whole recording.

    Only the time that motion and music have in common counts.

    Parameters
    ----------
    clip : Clip with a motion
    params : HarmonyParams, default ``HarmonyParams.recommended()`` with the pattern of the clip's dance, if known
    tracker : function from Audio to BeatTrack
        Another beat tracker, or ``lambda audio: load_beats("song.beats")``; for clips without annotated beats.
    n_rotations : int
        Rotations of the null behind `p_value`, and resamplings behind `interval`; 0 leaves both NaN.
    seed : int, of the resamplings

    Raises
    ------
    ValueError
        If the clip has no motion, or motion and music hardly overlap.

    Examples
    --------
    >>> from harmolab import score_clip, synthetic_clip
    >>> score = score_clip(synthetic_clip("jive", seconds=30.0, seed=3))
    >>> score.harmony_above_chance > 0.5, score.p_value < 0.05, score.judgement.level
    (True, True, 4)
    >>> bool(score.music.times[score.hits].size == score.hits.sum())
    True
    """
    params = params or HarmonyParams.recommended(DANCE_PATTERNS.get(clip.dance))
    if clip.beats is None and tracker is not None:
        clip = replace(clip, beats=tracker(clip.audio))
    beats, motion = music_and_motion(clip, clock=params.clock)
    return score_motion(beats, motion, params=params, n_rotations=n_rotations, seed=seed)


def other_measures(clip: Clip, *, clock: float = 1.0) -> dict[str, float]:
    """The field's other measures of a clip, name -> number: beat alignment, coverage, and those of mir_eval.

    `clock` and the errors are those of `music_and_motion`.
    """
    music, motion = music_and_motion(clip, clock=clock)
    timed = replace(motion, fps=motion.fps / clock)
    return other_scores(music, visual_beats(timed, params=kinematic_params()))


def music_and_motion(clip: Clip, *, clock: float = 1.0) -> tuple[BeatTrack, Motion]:
    """The `music_beats` of a clip and its motion, both cut to the stretch they share (`Clip.shared`).

    Raises
    ------
    ValueError
        If the clip has no motion, or motion and music hardly overlap.
    """
    if clip.beats is None:
        clip = replace(clip, beats=music_beats(clip))
    shared = clip.shared(clock=clock)
    return cast(BeatTrack, shared.beats), cast(Motion, shared.motion)
