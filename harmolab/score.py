"""The paper's harmony score: hits, hitting score, F-measure, chance level, null distribution (Eq. 10, 14-21).

`harmolab.beats.salience` keeps the beats that a viewer or listener would notice (Eq. 11-13). The intervals between
them (Eq. 15-17) give the hits (Eq. 18), the hits the hitting score (Eq. 19) and the F-measure (Eq. 20-21). Beside these
stand the chance level, harmony above chance, and the null distribution, in which the visual beats are rotated in time.
The functions stand in this order.

`score_harmony` puts the functions together for two beat tracks (Eq. 10, 14-21); the doors of `harmolab.verdict.judge`
start from a motion and from a clip.
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
    """A score and its evidence: all that pictures, pages and sentences about it need. Times are seconds.

    Parameters
    ----------
    params : HarmonyParams, the settings it was computed with
    music, visual : BeatTrack, the attentional beats of both sides on the motion's time line, the lag not taken off
    pairs : (N,) array of int
        Index of the visual beat within the delay of each attentional music beat, -1 for a miss (Eq. 18). The measure
        "shape" does not rest on them, but pictures of who meets whom do.
    shares : (N,) array
        Share of each attentional music beat in the score: 1 for a hit and 0 for a miss, or in the measure "shape" its
        percentile rank among all moments.
    mean_share : float
        Their mean, weighted by the strengths of the beats: what `chance` is taken off. `chance` itself where none is.
        In the measure "shape" all beats of whole cycles count alike; NaN where no place was tested.
    null : (R,) array, that mean after each rotation in time, or at each lag; empty when not computed
    harmony, audio_harmony, visual_harmony : float
        h of Eq. 20-21, h_a = h_s / N and h_v = h_s / M.
    hitting_score : float, h_s of Eq. 19
    hit_rate : float
        Share of all music beats with an attentional visual beat within the delay; in the measure "shape" of those whose
        rank is above 1/2.
    chance : float
        The share that a random shift in time would reach; with one-to-one matching the most that it could reach
        (see `chance_level`), so that a dance at chance is below 0 in `harmony_above_chance`.
    harmony_above_chance : float
        0 is what chance reaches, 1 is every beat hit. The recommended score's is H of its `judgement`: in [-1, 1], and
        NaN where no place in the beat can be judged.
    intervals : (N,) array, from each attentional music beat to its nearest visual beat, less the lag (Eq. 17)
    p_value : float
        Share of random rotations in time that score as high; NaN when not computed. The recommended score's is that of
        its `judgement`.
    interval : (float, float), spread of harmony_above_chance from beat to beat or from bar to bar, 95 %; NaN without
    judgement : Judgement of `harmolab.verdict.judge`, which the record only carries; None unless the measure is "shape"
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
        """`harmony_above_chance` where it means something: NaN where chance alone reaches more than .9 of the beats."""
        return self.harmony_above_chance if self.chance <= MOST_CHANCE else float("nan")

    @property
    def place_harmony(self) -> float:
        """`harmony_above_chance` also where no place can be judged, for means over many dances."""
        return self.judgement.place_harmony if self.judgement else self.harmony_above_chance

    @property
    def hits(self) -> BoolArray:
        """(N,) True for each attentional music beat that counts as hit (Eq. 18), or whose rank is above 1/2."""
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
        """Plain numbers and lists, ready for JSON, without settings and null; a number that does not exist is None."""
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
    """T: distance of each music beat to its nearest visual beat, (N,) seconds (Eq. 17); infinite without any.

    ValueError unless both are lists of finite numbers.
    """
    audio_times, visual_times = checked_times(audio_times, "audio_times"), checked_times(visual_times, "visual_times")
    if visual_times.size == 0:
        return np.full(audio_times.size, np.inf)
    return interval_matrix(audio_times, visual_times).min(axis=1)


def hit_mask(audio_times: ArrayLike, visual_times: ArrayLike, *, delay: float, matching: str = "many") -> BoolArray:
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

    Raises
    ------
    ValueError
        If the times are no lists of finite numbers, the delay is negative or NaN, or `matching` is another word.
    """
    return hit_pairs(audio_times, visual_times, delay=delay, matching=matching) >= 0


def hit_pairs(audio_times: ArrayLike, visual_times: ArrayLike, *, delay: float, matching: str = "nearest") -> IntArray:
    """The visual beat that hits each music beat: (N,) indices into `visual_times`, -1 for a miss (Eq. 18).

    Parameters and errors are those of `hit_mask`. Visual beats that no index names are redundant (caption of Fig. 3).
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
    """h_s: sum of the `strengths` (N,) of the music beats where `hits` (N,) is 1 (Eq. 19)."""
    return float(np.asarray(hits) @ np.asarray(strengths))


def f_score(audio_harmony: float, visual_harmony: float, beta: float) -> float:
    """h: weighted harmonic mean of h_a = h_s / N and h_v = h_s / M (Eq. 20); 0 when both are 0."""
    below = beta**2 * visual_harmony + audio_harmony
    return (1 + beta**2) * audio_harmony * (visual_harmony / below) if below else 0.0


def harmony_from_hits(score: float, n_audio: int, n_visual: int, beta: float) -> float:
    """h as a function of h_s, N and M (Eq. 21); 0 when either side has no beats.

    Lemma 3.1 calls h "uniquely determined by h_s"; that holds only at fixed N and M.
    """
    if n_audio == 0 or n_visual == 0:
        return 0.0
    return (1 + beta**2) * score / (n_audio * beta**2 + n_visual)


def chance_level(visual_times: ArrayLike, *, delay: float, duration: float) -> float:
    """c: share of the clip within the delay of a visual beat, which is what a random music beat would score.

    That holds where one visual beat may serve many music beats (``matching="many"``); where each serves one music beat
    only, chance reaches less, and `HarmonyScore.p_value` tells whether a dance is above it. ValueError unless the times
    are a list of finite numbers, the delay is zero or more, and the duration positive (both seconds).
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
    """h_cc = (share - c) / (1 - c): 0 is chance, 1 is everything; 0 when chance already reaches everything."""
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
    """Harmony of two beat tracks on the same time line (Eq. 10, 14-21), by hits.

    Parameters
    ----------
    audio_track, visual_track : BeatTrack
        All detected beats; saliency (Eq. 11-13) is applied inside. Visual beats after the music are left out.
    params : HarmonyParams, default ``HarmonyParams.paper()``
    n_rotations, seed : int
        Rotations of the null behind `p_value`, and resamplings, drawn by the seed, behind `interval`; 0 leaves both
        NaN. With one-to-one matching each is a matching of its own: some seconds for a song.

    Returns
    -------
    HarmonyScore; with no beats on one side harmony is 0. ValueError for another kind of argument.

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
