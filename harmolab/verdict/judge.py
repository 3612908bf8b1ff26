"""The verdict on a movement and its beats in five levels, and the functions that score a motion or a clip.

A *floor* says whether there is movement enough. Then come the time test and the place test of
`harmolab.verdict.evidence`. The *lag* is how much later than the beats the body moves.

=====  =============================================================================================================
level  when
=====  =============================================================================================================
0      cannot tell: too little movement inside the body, the body only turns and travels, fewer than 16 beats, or no
       sign of beats that the sound does not keep to
1      no sign that the movement follows these beats (time test, p > .05)
2      the tempo is kept, but the lag wanders by more than a quarter of a beat to either side
3      in time, and not shown to be on the beat
4      on the beat: a steady lag of an eighth of a beat at most, harmony above 0 from bar to bar, a place that no more
       than a quarter of the other lags would do as well as (place test, p <= .25), and a movement that has the rate of
       the beats
=====  =============================================================================================================

The dance, or what is meant on the beat, may be told (`pattern`). Then its place in the beat is asked for. Where nothing
is told, the movement alone decides what is asked for: the waltz's course if the movement recurs most clearly every
three beats, else a rest on each beat. Its place in the beat has no part in that choice. A body that rests on the beat
is on the beat. One that is fastest on it, or arrives on it and stands, may mean that; the verdict then says only when
it is fastest and stillest.

`score_clip` and `score_motion` return the score that the settings ask for: the paper's alone, of `harmolab.score`, or
the recommended one, which has the verdict.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from textwrap import shorten
from typing import Any, Self, cast

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import cycle_of_meter
from harmolab.beats.salience import normalise_strengths
from harmolab.beats.visual import visual_beats
from harmolab.metrics.beat_alignment import kinematic_params, other_scores
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import HarmonyScore, check_whole, hit_pairs, score_harmony, score_of_shares
from harmolab.shape_speed import ShapeSpeed, shape_signal, shape_speed
from harmolab.types import Audio, BeatTrack, Clip, Display, Motion, check_kind, usual_meter
from harmolab.verdict import evidence, sentences

MOST_PLACES = 0.25  # share of the lags that may do as well: those within an eighth of a beat to either side
LINE = 90  # characters of a verdict that is printed in one line
LEVELS = ("cannot tell", "no sign", "in time, no steady place", "in time", "on the beat")  # in a few words


@dataclass(frozen=True, eq=False)
class Judgement(evidence.Evidence, Display):
    """The verdict on a dance: its level, its words, and the evidence that they are made from.

    `harmolab.verdict.evidence.Evidence` has the fields and numbers.
    """

    def __repr__(self) -> str:
        return f"Judgement({self.level} of 4: {shorten(self.verdict, LINE, placeholder='...')})"

    @property
    def verdict(self) -> str:
        """The level in a sentence or two, and where it does not hold: parts of the take, beats without movement."""
        return sentences.verdict(self)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Three sentences at most to read below the verdict: how sure it is, how steady, and what would help."""
        return sentences.remarks(self)

    @property
    def details(self) -> tuple[str, ...]:
        """The sentences for which `remarks` has no room."""
        return sentences.details(self)

    def without_start(self) -> Self:
        """The same verdict where nothing tells when the dance begins: "in time" at most, and no place in the beat."""
        return replace(self, level=min(self.level, 3), has_start=False)

    def to_dict(self) -> dict[str, Any]:
        """Numbers and sentences by name; places in the beat are NaN where nothing tells when the dance begins."""
        names = ("level", "verdict", "remarks", "details", "p_time", "p_place", "lag_s", "tempo", "own_tempo")
        numbers = {name: getattr(self, name) for name in (*names, "reading", "has_start")}
        places: dict[str, Any] = {"lag_interval_s": tuple(edge * 60 / self.tempo for edge in self.lag_interval)}
        places |= sentences.moments_after_beat(self)
        if not self.has_start:
            places = dict.fromkeys((*places, "p_place", "lag_s"), evidence.NAN)
        parts = {name: getattr(self.signal, name, evidence.NAN) for name in ("pulse", "share", "joints")}
        return numbers | {"rate": float(self.time.rate) if self.time else evidence.NAN} | places | parts


def judge(shape: ShapeSpeed, beats: BeatTrack, *, pattern: BarPattern | None = None, seed: int = 0) -> Judgement:
    """The verdict on a movement and the beats that it is danced to, on one time line.

    Parameters
    ----------
    shape : ShapeSpeed of the motion
    beats : BeatTrack
        Beats of the music. All count alike; only the movement between the first and the last is looked at.
    pattern : BarPattern or None
        The movement that is meant: the course of a dance, or one of `HOW_PATTERNS`. None where nothing is told
        (`own_reading`).
    seed : int
        Of the draws behind the intervals from bar to bar.

    Returns
    -------
    Judgement
    """
    if beats.times.size < 2:
        return Judgement(0, beats, pattern)
    signal = shape_signal(shape, beats.times[0], beats.times[-1])
    nothing = Judgement(0, beats, pattern, signal)
    if nothing.n_beats < evidence.FEWEST_BEATS or evidence.floor(signal):
        return nothing
    time = evidence.time_test(signal, beats.times, cycles=cycles_of(beats, pattern))
    bars = beats.bar_places if pattern else None  # a bar counts only where the dance was told
    place = evidence.place_test(signal, beats.times, bars, pattern or own_reading(time))
    interval, lags = place.spread(seed=seed)
    level = min(level_of(time, place, interval, lags), 4 if pattern or evidence.has_bar(time) else 3)
    if level == 1 and not beats.is_sure:
        return nothing
    return Judgement(level, beats, pattern, signal, time, place, interval, lags)


def cycles_of(beats: BeatTrack, pattern: BarPattern | None) -> tuple[int, ...]:
    """Beats after which a movement may recur: one, and the cycle of dance or bar; 1, 2, 3 in six or where unknown."""
    if pattern is not None:
        return tuple(sorted({1, pattern.beats}))
    meter = 6 if beats.bar_places is None else usual_meter(beats.bar_places)
    # Six beats may be twice three or three times two.
    return (1, 2, 3) if meter % 6 == 0 else tuple(sorted({1, cycle_of_meter(meter)}))


def own_reading(time: evidence.TimeTest) -> BarPattern:
    """The pattern that is asked for when nothing is told: the waltz's curve in three, else a rest on each beat."""
    return DANCE_PATTERNS["waltz"] if time.metre == 3 else HOW_PATTERNS["rest"]


def level_of(
    time: evidence.TimeTest, place: evidence.PlaceTest, interval: evidence.Interval, lags: evidence.Interval
) -> int:
    """The level, 1 to 4, of a movement above the floor; the table at the top of the module says when."""
    if not time.p_value <= evidence.ALPHA:
        return 1
    if lags[1] - lags[0] > 2 * evidence.STEADY:
        return 2
    is_near = abs(place.lag) <= evidence.ON_THE_BEAT and place.harmony_above_chance > 0 and interval[0] > 0
    return 4 if is_near and place.p_value <= MOST_PLACES and evidence.has_rate(time, place.pattern) else 3


# The doors of scoring: a motion or a clip in, its score out


def score_motion(
    audio_track: BeatTrack,
    motion: Motion,
    *,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """The score of a motion with the beats of its music, both on the motion's time line.

    Cut beats and motion to the stretch that they share first, as `music_and_motion` does for a clip: in the measure
    "hits" all beats count, also those after the end of the motion.

    Parameters
    ----------
    audio_track : BeatTrack
        Beats of the music, in seconds from the first frame of the motion.
    motion : Motion
    params : HarmonyParams
        ``HarmonyParams.recommended()`` when left out.
    n_rotations : int
        For the measure "hits": rotations in time behind `p_value`, and resamplings behind `interval`; with 0 both are
        NaN. The measure "shape" has both without.
    seed : int
        Of the resamplings.

    Returns
    -------
    HarmonyScore

    Raises
    ------
    ValueError
        Unless a BeatTrack, a Motion and HarmonyParams are passed, and whole numbers from 0 on.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> clip = synthetic_clip("jive", seconds=30.0, seed=3)
    >>> score_motion(clip.beats, clip.motion, params=HarmonyParams.paper()).hit_rate > 0.9
    True
    """
    if not (isinstance(audio_track, BeatTrack) and isinstance(motion, Motion)):
        kinds = f"{type(audio_track).__name__} and {type(motion).__name__}"
        raise ValueError(f"a harmolab.BeatTrack and a harmolab.Motion are needed, got {kinds}")
    params = params or HarmonyParams.recommended()
    check_kind(params, HarmonyParams)
    timed = motion if params.clock == 1 else replace(motion, fps=motion.fps / params.clock)
    visual = visual_beats(timed, params=params)
    if params.measure == "hits":
        return score_harmony(audio_track, visual, params=params, n_rotations=n_rotations, seed=seed)
    return _judged(audio_track, timed, params, visual, seed)


def _judged(track: BeatTrack, motion: Motion, params: HarmonyParams, visual: BeatTrack, seed: int) -> HarmonyScore:
    """The score of `judge`: its visual beats are rests, or hits where hits were told."""
    shape = shape_speed(motion, smoothing=params.position_smoothing)
    check_whole(seed=seed)
    track = replace(track, strengths=normalise_strengths(track.strengths, params.normalisation))
    late = track.times + params.lag
    music = track.select((late >= 0) & (late <= min(track.duration, motion.duration + 1 / motion.fps)))
    judgement = judge(shape, replace(music, times=music.times + params.lag), pattern=params.pattern, seed=seed)
    pairs = hit_pairs(music.times, visual.times - params.lag, delay=params.reaction_delay, matching=params.matching)
    shares, share, chance, null = np.full(pairs.size, np.nan), np.nan, np.nan, np.zeros(0)
    if place := judgement.place:
        shares, share, chance, null = place.shares(pairs.size), float(place.curve[0]), place.chance, place.curve
    score = score_of_shares(params, music, visual, pairs, shares, share, chance)
    return _with_judgement(replace(score, null=null), judgement)


def _with_judgement(score: HarmonyScore, judgement: Judgement) -> HarmonyScore:
    """The score with a judgement and with its numbers."""
    return replace(
        score, p_value=judgement.p_value, interval=judgement.harmony_interval, judgement=judgement,
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
    """The score of a clip: is the dance in time with its music, and on the beat (Eq. 1, 6)?

    Only the stretch that motion and music have in common counts. Beats are those of the clip, else those that a
    program finds in the whole recording (`music_beats`). The verdict in words is ``score.judgement.verdict``.

    Parameters
    ----------
    clip : Clip with a motion
    params : HarmonyParams
        When left out the recommended ones, with the usual course of the clip's dance where it is cha-cha, rumba or
        waltz. ``HarmonyParams.paper()`` is the paper's score.
    tracker : function from Audio to BeatTrack
        Another beat tracker, or ``lambda audio: load_beats("song.beats")``; for clips without beats of their own.
    n_rotations : int
        For the measure "hits" (the paper's): rotations in time behind `p_value`, and resamplings behind `interval`;
        with 0 both are NaN. The measure "shape" (the recommended one) has both without.
    seed : int
        Of the resamplings.

    Returns
    -------
    HarmonyScore
        Where nothing tells when the dance begins (`Clip.has_start` is False) its verdict is "in time" at most, and it
        has no number.

    Raises
    ------
    ValueError
        If `clip` is no Clip or `params` no HarmonyParams, the clip has no motion, or motion and music hardly overlap.

    Examples
    --------
    >>> from harmolab import score_clip, synthetic_clip
    >>> score = score_clip(synthetic_clip("jive", seconds=30.0, seed=3))
    >>> score.harmony_above_chance > 0.5, score.p_value < 0.05, score.judgement.level
    (True, True, 4)
    >>> bool(score.music.times[score.hits].size == score.hits.sum())
    True
    """
    if not isinstance(clip, Clip):
        raise ValueError(f"a harmolab.Clip is needed, got {type(clip).__name__}; score_files takes paths")
    params = params or HarmonyParams.recommended(DANCE_PATTERNS.get(clip.dance))
    check_kind(params, HarmonyParams)
    if clip.beats is None and tracker is not None:
        clip = replace(clip, beats=tracker(clip.audio))
    score = score_motion(*music_and_motion(clip, clock=params.clock), params=params, n_rotations=n_rotations, seed=seed)
    return score if clip.has_start else without_start(score)


def without_start(score: HarmonyScore) -> HarmonyScore:
    """The score where it is not known when the dance begins: no number, and no words on the place in the beat."""
    return _with_judgement(score, score.judgement.without_start()) if score.judgement else score


def other_measures(clip: Clip, *, clock: float = 1.0) -> dict[str, float]:
    """The field's other measures of a clip: beat alignment, beat coverage, beat hit rate, and those of mir_eval.

    None of them subtracts chance: read them beside `score_clip`. The beats of the movement are the minima of the
    smoothed joint speed, as AIST++ defines them.

    Parameters
    ----------
    clip, clock : as in `music_and_motion`

    Returns
    -------
    dict: name of the measure -> number

    Raises
    ------
    ValueError
        As `music_and_motion`.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> sorted(other_measures(synthetic_clip("waltz", seconds=5.0)))[:4]
    ['beat_align_motion', 'beat_align_music', 'beat_coverage', 'beat_hit_rate']
    """
    music, motion = music_and_motion(clip, clock=clock)
    return other_scores(music, visual_beats(replace(motion, fps=motion.fps / clock), params=kinematic_params()))


def music_and_motion(clip: Clip, *, clock: float = 1.0) -> tuple[BeatTrack, Motion]:
    """The beats of a clip's music and its motion, both cut to the stretch that they share.

    Parameters
    ----------
    clip : Clip with a motion; its beats are those of `music_beats`
    clock : float, seconds of music for each second of the motion (`Clip.shared`)

    Returns
    -------
    (BeatTrack, Motion), on one time line that begins with the shared stretch

    Raises
    ------
    ValueError
        If `clip` is no Clip, it has no motion, or motion and music hardly overlap.
    """
    shared = replace(clip, beats=music_beats(clip)).shared(clock=clock)
    return cast(BeatTrack, shared.beats), cast(Motion, shared.motion)
