"""The paper's harmony score: hits, hitting score, F-measure, chance level, null distribution (Eq. 10, 14-21).

The paper compares the beats of the music, b_a, with those of the movement, the visual beats b_v. The functions stand in
the order of its equations:

========  ==========================  =============================================================================
equation  symbol                      meaning
========  ==========================  =============================================================================
10, 14    h = F_s(p'_a, p'_v)         the score of the attentional beats, those that a listener or viewer notices;
                                      `harmolab.beats.salience` picks them (Eq. 11-13)
15        Z(b_a, b_v)                 times of the M visual beats, once for each of the N music beats
16        D(b_a, b_v)                 distance of every music beat to every visual beat
17        T(b_a)                      distance of each music beat to its nearest visual beat
18        Hp(b_a)                     hits: 1 where T is at most T_delay, else 0
19        h_s                         hitting score: sum of the strengths s_a of the music beats that are hit
20        h = F_s(h_a, h_v)           F-measure of h_a = h_s / N and h_v = h_s / M, weighted by beta
21        h of h_s, N, M              the same in one formula
========  ==========================  =============================================================================

Three things are ours, since h alone does not tell a dance from luck. The *chance level* c is the share of music beats
that would be hit at random moments. *Harmony above chance* is (share - c) / (1 - c). The *null distribution* has the
scores after the visual beats are rotated in time, which means shifted around the end of the clip.

`score_harmony` puts the functions together for two beat tracks. `harmolab.verdict.judge` starts from a motion, or from
a clip.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from harmolab.beats.salience import salient_audio, salient_visual
from harmolab.files import plain
from harmolab.params import CHOICES, HarmonyParams
from harmolab.significance import bootstrap_interval, p_value, rotated_hits, rotations
from harmolab.types import BeatTrack, BoolArray, Display, FloatArray, IntArray, frozen_array

# The score as a record, with its evidence

MOST_CHANCE = 0.9  # share of the beats reached by chance, above which a score above chance says nothing


@dataclass(frozen=True, eq=False)
class HarmonyScore(Display):
    """The score of a dance with its music, and the evidence behind it.

    Functions such as `score_clip` and `score_harmony` return it; pictures, pages and sentences are made from it. What
    the fields mean depends on the measure that was asked for (`HarmonyParams.measure`):

    "shape", the recommended score
        Read `judgement`: the verdict in words, the level, the lag. `harmony_above_chance`, `p_value` and `interval` are
        those of the judgement.
    "hits", the paper's score
        Read `harmony_above_chance` beside `chance`, `p_value` and `interval`. `harmony` and `hit_rate`, which the paper
        prints, say little alone: where chance is high, any movement gets much of them.

    Times are seconds on the motion's time line. A visual beat is one of the movement, such as a rest. Attentional beats
    are those that count (Eq. 11-13): N of the music, M visual ones. In the measure "shape" every beat counts.

    Parameters
    ----------
    params : HarmonyParams
        The settings that it was computed with.
    music, visual : BeatTrack
        The attentional beats of the music and of the movement; `params.lag` is not taken off.
    pairs : (N,) array of int
        Number of the visual beat that hits each music beat, -1 for a miss (Eq. 18). In the measure "shape" only
        pictures use them.
    shares : (N,) array
        The part of each music beat in the score. "hits": 1 for a hit, 0 for a miss. "shape": the rank of its moment
        among all moments of the take, between 0 and 1.
    mean_share : float
        Mean of `shares`, from which `harmony_above_chance` follows: (mean_share - chance) / (1 - chance). "hits":
        weighted by the strengths of the beats, and equal to `chance` without any. "shape": over the beats of whole
        cycles, and NaN where the place in the beat was not tested.
    null : (R,) array
        The same mean after each rotation of the visual beats in time ("hits"), or at each lag ("shape"); empty where it
        was not computed.
    harmony : float
        h of Eq. 20-21; 0 without beats on one side.
    audio_harmony, visual_harmony : float
        h_a = h_s / N and h_v = h_s / M.
    hitting_score : float
        h_s of Eq. 19.
    hit_rate : float
        "hits": share of all music beats, salient or not, that have an attentional visual beat within the delay.
        "shape": share of the music beats whose rank is above 1/2.
    chance : float
        "hits": the hit rate that chance would reach (`chance_level`). Where each visual beat hits one music beat only,
        it is more than chance can reach, so that a dance at chance is below 0 in `harmony_above_chance`. "shape": the
        mean rank at a random lag.
    harmony_above_chance : float
        0 is what chance reaches, 1 the most there is, negative worse than chance. "shape": from -1 to 1, and NaN where
        no place in the beat can be judged (`HarmonyScore.place_harmony` has the number nevertheless).
    intervals : (N,) array, seconds
        From each music beat to its nearest visual beat, the lag taken off; not negative (Eq. 17). Infinite without
        visual beats.
    p_value : float
        "hits": share of rotations in time that score at least as high. It is too small, and `harmony_above_chance` too
        large, where music and movement are still in the same part, such as an intro (`score_harmony`). "shape": the
        larger of the p-values of both tests, in time and place. NaN where it was not computed.
    interval : (float, float)
        95 % interval of `harmony_above_chance`, from beat to beat ("hits") or from bar to bar ("shape"); NaN where it
        was not computed.
    judgement : Judgement of `harmolab.verdict.judge`
        The verdict; None unless the measure is "shape".
    """

    params: HarmonyParams
    music: BeatTrack
    visual: BeatTrack
    pairs: IntArray
    shares: FloatArray
    mean_share: float
    harmony: float
    audio_harmony: float
    visual_harmony: float
    hitting_score: float
    hit_rate: float
    chance: float
    harmony_above_chance: float
    intervals: FloatArray
    null: FloatArray = field(default_factory=lambda: np.zeros(0))
    p_value: float = float("nan")
    interval: tuple[float, float] = (float("nan"), float("nan"))
    judgement: Any = None

    def __repr__(self) -> str:
        number = f"{self.above_chance:+.2f} above chance, " if np.isfinite(self.above_chance) else ""
        met = f"h = {self.harmony:.2f}, {self.hits.sum()} of {self.n_audio} music beats met"
        return f"HarmonyScore({number}{met if self.judgement is None else self.judgement})"

    @property
    def above_chance(self) -> float:
        """`harmony_above_chance`; NaN where chance alone hits more than .9 of the beats, since it then says nothing."""
        return self.harmony_above_chance if self.chance <= MOST_CHANCE else float("nan")

    @property
    def place_harmony(self) -> float:
        """`harmony_above_chance` also where no place in the beat can be judged, for means over many dances."""
        return self.judgement.place_harmony if self.judgement else self.harmony_above_chance

    @property
    def hits(self) -> BoolArray:
        """(N,) True for each attentional music beat that is hit (Eq. 18), or in "shape" whose rank is above 1/2."""
        return self.shares > 0.5

    @property
    def n_audio(self) -> int:
        """N, the number of attentional music beats."""
        return self.music.times.size

    @property
    def n_visual(self) -> int:
        """M, the number of attentional visual beats."""
        return self.visual.times.size

    def to_dict(self) -> dict[str, Any]:
        """The score as plain numbers, lists and words for JSON; None stands for a number that does not exist.

        Settings and the null distribution are left out; numbers and sentences of the judgement are among them.
        """
        beats = {"music_times": self.music.times, "visual_times": self.visual.times, "pairs": self.pairs}
        inner = ("params", "music", "visual", "null", "judgement")
        numbers = {name: value for name, value in vars(self).items() if name not in inner}
        counts = {"hits": self.hits, "n_audio": self.n_audio, "n_visual": self.n_visual}
        return dict(plain(numbers | counts | beats | (self.judgement.to_dict() if self.judgement else {})))


# Intervals, hits, hitting score, F-measure (Eq. 15-21), and the chance level

# Distances are compared in floating point; a beat exactly at the delay must stay a hit.
EDGE = 1e-9


def checked_times(times: ArrayLike, name: str) -> FloatArray:
    """Moments (B,) as an array; ValueError names them where they are no list of finite numbers."""
    is_checked = type(times) is np.ndarray and times.dtype == np.float64 and np.isfinite(times).all()
    array = np.asarray(times) if is_checked else frozen_array(times, name)
    if array.ndim != 1:
        raise ValueError(f"{name} must be a list of moments (B,), got shape {array.shape}")
    return array


def position_matrix(visual_times: FloatArray, n_audio: int) -> FloatArray:
    """Z: the M visual beat positions repeated for each of the N music beats, (N, M) (Eq. 15)."""
    return np.broadcast_to(visual_times, (n_audio, visual_times.size))


def interval_matrix(audio_times: FloatArray, visual_times: FloatArray) -> FloatArray:
    """D: absolute distance of every music beat to every visual beat, (N, M) seconds (Eq. 16).

    The printed formula subtracts visual beats from themselves; the text says audio minus visual.
    """
    return np.abs(position_matrix(visual_times, audio_times.size) - audio_times[:, None])


def nearest_intervals(audio_times: ArrayLike, visual_times: ArrayLike) -> FloatArray:
    """T(b_a): distance of each music beat to its nearest visual beat (Eq. 17).

    Parameters
    ----------
    audio_times, visual_times : (N,) and (M,) arrays, seconds
        Beats of the music and of the movement, in any order.

    Returns
    -------
    (N,) array, seconds, zero or more; infinite if there are no visual beats

    Raises
    ------
    ValueError
        Unless both are lists of finite numbers.

    Examples
    --------
    >>> nearest_intervals([1.0, 2.0, 3.0], [1.25, 3.0]).tolist()
    [0.25, 0.75, 0.0]
    """
    audio_times, visual_times = checked_times(audio_times, "audio_times"), checked_times(visual_times, "visual_times")
    if visual_times.size == 0:
        return np.full(audio_times.size, np.inf)
    return interval_matrix(audio_times, visual_times).min(axis=1)


def hit_mask(audio_times: ArrayLike, visual_times: ArrayLike, *, delay: float, matching: str = "many") -> BoolArray:
    """Hp(b_a): which music beats are hit, so that a visual beat lies within the delay (Eq. 18).

    Parameters
    ----------
    audio_times : (N,) array, seconds
        Beats of the music.
    visual_times : (M,) array, seconds
        Beats of the movement.
    delay : float, seconds
        T_delay, zero or more. A visual beat exactly this far away, before or after, hits.
    matching : "many", "nearest" or "max"
        "many" (paper mode): one visual beat may hit many music beats. Else it hits one only. "nearest": each music beat
        in turn takes the nearest visual beat that is left (Fig. 1). "max": as many pairs as possible are made.

    Returns
    -------
    (N,) bool array; all False if there are no visual beats

    Raises
    ------
    ValueError
        If the times are no lists of finite numbers, the delay is negative or NaN, or `matching` is another word.

    Examples
    --------
    >>> hit_mask([1.0, 2.0, 3.0], [1.25, 3.0], delay=0.25).tolist()
    [True, False, True]
    """
    return hit_pairs(audio_times, visual_times, delay=delay, matching=matching) >= 0


def hit_pairs(audio_times: ArrayLike, visual_times: ArrayLike, *, delay: float, matching: str = "nearest") -> IntArray:
    """The visual beat that hits each music beat (Eq. 18).

    Parameters and errors are those of `hit_mask`; here one visual beat hits one music beat unless told otherwise.

    Returns
    -------
    (N,) array of int: numbers of beats in `visual_times`, -1 for a miss. The paper calls visual beats that hit nothing
    redundant (caption of Fig. 3).

    Examples
    --------
    >>> hit_pairs([1.0, 2.0, 3.0], [1.25, 3.0], delay=0.25).tolist()
    [0, -1, 1]
    """
    if matching not in CHOICES["matching"]:
        raise ValueError(f"matching must be one of {', '.join(CHOICES['matching'])}; got {matching!r}")
    if not delay >= 0:
        raise ValueError(f"delay must be zero or more seconds, got {delay}")
    audio_times, visual_times = checked_times(audio_times, "audio_times"), checked_times(visual_times, "visual_times")
    if audio_times.size == 0 or visual_times.size == 0:
        return np.full(audio_times.size, -1, dtype=np.int64)
    intervals = interval_matrix(audio_times, visual_times)
    if matching == "max":
        return maximum_bipartite_matching(csr_array(intervals <= delay + EDGE), perm_type="column").astype(np.int64)
    if matching == "many":
        return np.where(intervals.min(axis=1) <= delay + EDGE, intervals.argmin(axis=1), -1).astype(np.int64)
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


def hitting_score(hits: ArrayLike, strengths: ArrayLike) -> float:
    """Hitting score h_s: the sum of the strengths of the music beats that are hit (Eq. 19).

    Parameters
    ----------
    hits : (N,) array, True or 1 for a hit, as of `hit_mask`
    strengths : (N,) array, s_a; `salient_audio` brings them to a scale that does not depend on the recording

    Examples
    --------
    >>> hitting_score([True, False, True], [1.0, 0.5, 0.25])
    1.25
    """
    return float(np.asarray(hits) @ np.asarray(strengths))


def f_score(audio_harmony: float, visual_harmony: float, beta: float) -> float:
    """Harmony h: the weighted harmonic mean of h_a and h_v (Eq. 20).

    ``h = (1 + beta^2) h_a h_v / (beta^2 h_v + h_a)``

    Parameters
    ----------
    audio_harmony, visual_harmony : float
        h_a = h_s / N over the N music beats, and h_v = h_s / M over the M visual beats.
    beta : float
        Above 1 it matters more that music beats are hit, below 1 that visual beats hit.

    Returns
    -------
    float; 0 where both are 0

    Examples
    --------
    >>> round(f_score(1.0, 0.5, 2.0), 3)
    0.833
    """
    below = beta**2 * visual_harmony + audio_harmony
    return (1 + beta**2) * audio_harmony * (visual_harmony / below) if below else 0.0


def harmony_from_hits(score: float, n_audio: int, n_visual: int, beta: float) -> float:
    """Harmony h from the hitting score and the numbers of beats (Eq. 21); equal to `f_score` of both sides.

    ``h = (1 + beta^2) h_s / (N beta^2 + M)``

    Parameters
    ----------
    score : float, h_s of `hitting_score`
    n_audio, n_visual : int, N and M, the numbers of music beats and of visual beats
    beta : float, as in `f_score`

    Returns
    -------
    float; 0 where either side has no beats

    Notes
    -----
    Lemma 3.1 of the paper calls h "uniquely determined by h_s". That holds at fixed N and M only.

    Examples
    --------
    >>> round(harmony_from_hits(2.0, 2, 4, 2.0), 3)  # as f_score(2 / 2, 2 / 4, 2.0)
    0.833
    """
    if n_audio == 0 or n_visual == 0:
        return 0.0
    return (1 + beta**2) * score / (n_audio * beta**2 + n_visual)


def chance_level(visual_times: ArrayLike, *, delay: float, duration: float) -> float:
    """Chance level c: the hit rate that music beats at random moments would reach.

    It is the share of the clip that lies within the delay of a visual beat. That holds where one visual beat may hit
    many music beats (``matching="many"``). Where each hits one music beat only, chance reaches less, and
    `HarmonyScore.p_value` tells whether a dance is above it.

    Parameters
    ----------
    visual_times : (M,) array, seconds, beats of the movement
    delay : float, seconds, T_delay
    duration : float, seconds, of the clip

    Returns
    -------
    float from 0 to 1; 0 without visual beats

    Raises
    ------
    ValueError
        Unless the times are a list of finite numbers, the delay is zero or more, and the duration positive.

    Examples
    --------
    Two beats with a quarter of a second on either side fill one of four seconds:

    >>> chance_level([1.0, 2.0], delay=0.25, duration=4.0)
    0.25
    """
    if not (duration > 0 and delay >= 0):
        raise ValueError(f"duration must be positive, got {duration}, and delay zero or more, got {delay}")
    times = np.sort(checked_times(visual_times, "visual_times"))
    if times.size == 0:
        return 0.0
    starts = np.maximum(times - delay, 0.0)
    ends = np.minimum(times + delay, duration)
    # Sorted beats: each adds what lies beyond the end of all before it.
    reached = np.concatenate([[0.0], np.maximum.accumulate(ends)[:-1]])
    return float(np.maximum(ends - np.maximum(starts, reached), 0.0).sum() / duration)


def above_chance(share: float, chance: float) -> float:
    """Harmony above chance: (share - c) / (1 - c), with c what chance reaches.

    Parameters
    ----------
    share : float, such as a hit rate
    chance : float, c, the same at random moments (`chance_level`)

    Returns
    -------
    float: 0 at chance, 1 where all is hit, negative below chance; 0 where chance reaches everything already

    Examples
    --------
    >>> above_chance(0.75, 0.5)
    0.5
    """
    return 0.0 if chance >= 1 - EDGE else (share - chance) / (1 - chance)


# Harmony of two beat tracks (Eq. 10, 14-21), with its null distribution


def check_whole(**values: object) -> None:
    """ValueError that names what is no whole number from 0 on."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
            raise ValueError(f"{name} must be a whole number, not negative, got {value!r}")


def score_harmony(
    audio_track: BeatTrack,
    visual_track: BeatTrack,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """The paper's score of music beats and visual beats on one time line: how many are hit (Eq. 10, 14-21).

    It counts hits whatever `params.measure` says. For a motion take `score_motion`, for a clip `score_clip`.

    Parameters
    ----------
    audio_track, visual_track : BeatTrack
        All beats of the music, and all of the movement; those that count are picked here (Eq. 11-13). Visual beats
        after the end of the music are left out.
    params : HarmonyParams
        ``HarmonyParams.paper()`` when left out.
    n_rotations : int
        Rotations in time behind `p_value`, and resamplings of the beats behind `interval`; with 0 both are NaN. With
        one-to-one matching the rotations take some seconds for a song.
    seed : int
        Of the resamplings.

    Returns
    -------
    HarmonyScore
        Without beats on one side its harmony is 0.

    Raises
    ------
    ValueError
        Unless BeatTracks and HarmonyParams are passed, and whole numbers from 0 on.

    Notes
    -----
    Chance is that of the whole duration. Where both sides have no beats in the same part, an intro in which the dancer
    waits, they meet more often than at other moments, though no beat is met. Of beats of 20 s that had nothing to do
    with each other p was .05 or less in .05 of cases, and in .38 where both began after 10 s, with a mean harmony above
    chance of .23. Cut both tracks to the part where both have beats first (`BeatTrack.span`).

    Examples
    --------
    >>> beats = BeatTrack([1.0, 2.0, 3.0], [1.0, 1.0, 1.0], 15.0, 4.0)
    >>> score_harmony(beats, beats, params=HarmonyParams.valleys()).harmony
    1.0
    """
    params = params or HarmonyParams.paper()
    for kind, value in ((BeatTrack, audio_track), (BeatTrack, visual_track), (HarmonyParams, params)):
        if not isinstance(value, kind):
            raise ValueError(f"a harmolab.{kind.__name__} is needed, got {type(value).__name__}")
    check_whole(n_rotations=n_rotations, seed=seed)
    is_inside = visual_track.times <= audio_track.duration + 1 / visual_track.fps  # a frame more is rounding
    visual_track = visual_track if is_inside.all() else visual_track.select(is_inside)
    music, visual = salient_audio(audio_track, params), salient_visual(visual_track, params)
    times, delay = visual.times - params.lag, params.reaction_delay
    pairs = hit_pairs(music.times, times, delay=delay, matching=params.matching)
    chance, total = chance_level(times, delay=delay, duration=music.duration), float(music.strengths.sum())
    share = hitting_score(pairs >= 0, music.strengths) / total if total > 0 else chance
    score = score_of_shares(params, music, visual, pairs, (pairs >= 0).astype(np.float64), share, chance)
    every = hit_mask(audio_track.times, times, delay=delay, matching=params.matching)
    score = replace(score, hit_rate=float(every.mean()) if every.size else 0.0)
    if n_rotations == 0 or total == 0 or times.size == 0:
        return score
    return _with_null(score, n_rotations, seed)


def score_of_shares(
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
        params, music, visual, pairs, shares, share,
        harmony=harmony_from_hits(hitting, n_audio, n_visual, params.beta), hitting_score=hitting,
        audio_harmony=hitting / n_audio if n_audio else 0.0, visual_harmony=hitting / n_visual if n_visual else 0.0,
        hit_rate=float(hits.mean()) if n_audio else 0.0, chance=chance,
        harmony_above_chance=above_chance(share, chance),
        intervals=nearest_intervals(music.times, visual.times - params.lag),
    )  # fmt: skip


def _null(music: BeatTrack, times: FloatArray, params: HarmonyParams, count: int) -> FloatArray:
    """(count,) share of the music beats that is hit after each rotation of the visual beats."""
    weights, delay, duration = music.strengths, params.reaction_delay, music.duration
    if params.matching == "many":
        around = np.sort(np.mod(times, duration))
        hits = rotated_hits(music.times, around, weights, delay=delay, duration=duration, count=count)
    else:
        moved = np.sort(np.mod(times + rotations(duration, count)[:, None], duration), axis=1)
        hits = np.array([hit_mask(music.times, row, delay=delay, matching=params.matching) for row in moved]) @ weights
    return hits / weights.sum()


def _with_null(score: HarmonyScore, count: int, seed: int) -> HarmonyScore:
    """The score with its null distribution, p-value and bootstrap interval."""
    music, params = score.music, score.params
    null = _null(music, score.visual.times - params.lag, params, count)
    low, high = bootstrap_interval(score.shares, music.strengths, count=count, seed=seed)
    p, edges = p_value(score.mean_share, null), (above_chance(low, score.chance), above_chance(high, score.chance))
    return replace(score, null=null, p_value=p, interval=edges)
