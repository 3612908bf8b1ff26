"""Many clips at once: the score of every clip of a corpus after a slider moves (Eq. 11-21, vectorised).

`BeatBatch` keeps the beats of all clips in two flat arrays; the beats of clip i have an offset of i times a gap longer
than any clip, so that one sorted search finds every nearest visual beat and none belongs to another clip. Same numbers
as `score_harmony`.

`PlaceBatch` keeps what the recommended mode needs: how the beats rank at every lag, which is slow to find.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.beats.salience import normalise_strengths, strength_steps
from harmolab.beats.visual import visual_beats
from harmolab.params import HarmonyParams
from harmolab.score import EDGE
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import BeatTrack, FloatArray, IntArray, Motion
from harmolab.verdict.evidence import MOMENTS, floor, place_test, time_test
from harmolab.verdict.judge import cycles_of, own_reading

LONGEST = 3  # beats, of the readings where nothing is told


@dataclass(frozen=True, eq=False)
class BeatBatch:
    """Beats of C clips: flat times and strengths, and where each clip's begin (C + 1 bounds).

    ``steps`` holds R of Eq. 12 for every visual beat, ``spread`` SD(R) of each clip, ``level`` SD(s_a): what saliency
    needs and no slider changes.
    """

    audio: FloatArray
    audio_strengths: FloatArray
    audio_clip: IntArray
    visual: FloatArray
    visual_clip: IntArray
    steps: FloatArray
    spread: FloatArray
    level: FloatArray
    durations: FloatArray
    gap: float

    @classmethod
    def of(cls, pairs: Sequence[tuple[BeatTrack, BeatTrack]]) -> "BeatBatch":
        """The batch of (music, visual) beat tracks, one pair a clip.

        Raises
        ------
        ValueError
            Without clips.
        """
        if not pairs:
            raise ValueError("a batch needs at least one clip")
        durations = np.array([music.duration for music, _ in pairs])
        gap = 4.0 * float(durations.max()) + 4.0
        strengths = [normalise_strengths(music.strengths, "max") for music, _ in pairs]
        steps = [strength_steps(visual.strengths) for _, visual in pairs]
        return cls(
            audio=np.concatenate([music.times + i * gap for i, (music, _) in enumerate(pairs)]),
            audio_strengths=np.concatenate(strengths),
            audio_clip=np.repeat(np.arange(len(pairs)), [len(music) for music, _ in pairs]),
            visual=np.concatenate([visual.times + i * gap for i, (_, visual) in enumerate(pairs)]),
            visual_clip=np.repeat(np.arange(len(pairs)), [len(visual) for _, visual in pairs]),
            steps=np.concatenate(steps),
            spread=np.array([row[1:].std() if row.size > 1 else 0.0 for row in steps]),
            level=np.array([row.std() if row.size else 0.0 for row in strengths]),
            durations=durations,
            gap=gap,
        )


@dataclass(frozen=True, eq=False)
class PlaceBatch:
    """C clips for the recommended mode, ranked at every lag of one cycle: a lag is an index.

    H needs no more than two beats here, since a mean over clips is shown. It is 0 where too little moves inside the
    body, or the beats hold no whole cycle.

    Parameters
    ----------
    curves : (C, U) array, T(u) of `PlaceTest`, U / 48 beats
    hits : (C, U) array, number of beats that fit better than the median moment
    hitting : (C, U) array, strengths of these beats added up
    chance : (C,) array
    n_audio, n_visual : (C,) arrays of int
    periods : (C,) array, seconds from beat to beat
    durations : (C,) array, seconds
    """

    curves: FloatArray
    hits: FloatArray
    hitting: FloatArray
    chance: FloatArray
    n_audio: IntArray
    n_visual: IntArray
    periods: FloatArray
    durations: FloatArray

    @classmethod
    def of(cls, pairs: Sequence[tuple[BeatTrack, Motion]], params: HarmonyParams) -> "PlaceBatch":
        """The batch of (music, motion) on one time line, read with the pattern of `params`.

        Raises
        ------
        ValueError
            Without clips.
        """
        if not pairs:
            raise ValueError("a batch needs at least one clip")
        rows = [_place_row(music, motion, params) for music, motion in pairs]
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    def moved(self, seconds: FloatArray) -> "PlaceBatch":
        """The batch with each clip's music moved by `seconds`, (C,), to the nearest of 48 moments a beat."""
        steps = np.round(seconds / self.periods * MOMENTS).astype(np.int64)
        lags = (np.arange(self.curves.shape[1]) + steps[:, None]) % self.curves.shape[1]
        arrays = {name: np.take_along_axis(getattr(self, name), lags, axis=1) for name in ("curves", "hits", "hitting")}
        return replace(self, **arrays)


def _place_row(music: BeatTrack, motion: Motion, params: HarmonyParams) -> tuple[Any, ...]:
    """The fields of a `PlaceBatch` of one clip."""
    pattern, strengths = params.pattern, normalise_strengths(music.strengths, params.normalisation)
    cycle = LONGEST if pattern is None else pattern.beats
    curve, hits, chance = np.full(cycle * MOMENTS, 0.5), np.zeros((2, cycle * MOMENTS)), 0.5
    # A beat at either end may lie beyond the motion's samples.
    if len(music) >= cycle + 2 and not floor(signal := shape_signal(shape_speed(motion), *music.times[[0, -1]])):
        reading = pattern or own_reading(time_test(signal, music.times, cycles=cycles_of(music, None)))
        place = place_test(signal, music.times, None if pattern is None else music.bar_places, reading)
        fits = place.shares_at_lags(len(music)) > 0.5
        sums = np.array([place.curve, fits.sum(axis=0), strengths @ fits])
        tiled, chance = np.tile(sums, cycle // reading.beats), place.chance
        curve, hits = tiled[0], tiled[1:]
    period = 60 / music.tempo if len(music) > 1 else 1.0
    return curve, *hits, chance, len(music), len(visual_beats(motion, params=params)), period, music.duration


@dataclass(frozen=True, eq=False)
class BatchScores:
    """(C,) arrays: h of Eq. 21, hit rate and harmony above chance of every clip."""

    harmony: FloatArray
    hit_rate: FloatArray
    harmony_above_chance: FloatArray


def rescore(batch: BeatBatch, params: HarmonyParams) -> BatchScores:
    """Hit scores of every clip (paper readings: threshold, difference, copied first beat, many-to-one, max).

    Raises
    ------
    ValueError
        For another reading: use `score_harmony` for those.
    """
    readings = (params.saliency, params.visual_saliency, params.first_beat, params.matching, params.normalisation)
    if readings != ("threshold", "difference", "copy", "many", "max"):
        raise ValueError(f"rescore knows the default readings only, not {readings}; use score_harmony")
    clips = batch.durations.size
    salient = batch.audio_strengths > params.audio_threshold * batch.level[batch.audio_clip]
    visual, visual_clip = _salient_visual(batch, params)
    near = _nearest(batch.audio, visual) <= params.reaction_delay + EDGE
    weights = batch.audio_strengths * salient
    n_visual = np.bincount(visual_clip, minlength=clips)
    n_audio = np.bincount(batch.audio_clip, salient, clips).astype(np.int64)
    score, total, hits = (_sums(batch.audio_clip, part, clips) for part in (weights * near, weights, near))
    chance = _coverage(visual, visual_clip, batch, params.reaction_delay)
    counts = (n_audio > 0) & (n_visual > 0)
    return BatchScores(
        harmony=_harmony(score, n_audio, n_visual, params.beta),
        hit_rate=_quotient(hits, np.bincount(batch.audio_clip, minlength=clips)),
        harmony_above_chance=np.where(counts, _above_chance(_quotient(score, total), chance), 0.0),
    )


def rescore_places(batch: PlaceBatch, params: HarmonyParams) -> BatchScores:
    """Scores of every clip at the lag of `params`, to the nearest of 48 moments a beat.

    At no lag, with 16 beats and above the floor they are those of `score_motion`.
    """
    clips, size = batch.curves.shape
    now = np.arange(clips), np.round(params.lag / batch.periods * MOMENTS).astype(np.int64) % size
    return BatchScores(
        harmony=_harmony(batch.hitting[now], batch.n_audio, batch.n_visual, params.beta),
        hit_rate=_quotient(batch.hits[now], batch.n_audio),
        harmony_above_chance=_above_chance(batch.curves[now], batch.chance),
    )


def _sums(clip: IntArray, values: NDArray[Any], clips: int) -> FloatArray:
    """Values added up for every clip."""
    return np.bincount(clip, values, clips).astype(np.float64)


def _quotient(above: FloatArray, below: ArrayLike) -> FloatArray:
    """Quotients, 0 where nothing stands below."""
    return np.divide(above, below, out=np.zeros(above.shape), where=np.asarray(below) > 0)


def _harmony(score: FloatArray, n_audio: IntArray, n_visual: IntArray, beta: float) -> FloatArray:
    """h of Eq. 21."""
    counts = (n_audio > 0) & (n_visual > 0)
    return _quotient(np.where(counts, (1 + beta**2) * score, 0.0), n_audio * beta**2 + n_visual)


def _above_chance(share: FloatArray, chance: FloatArray) -> FloatArray:
    return np.divide(share - chance, 1 - chance, out=np.zeros(share.shape), where=chance < 1 - EDGE)


def _salient_visual(batch: BeatBatch, params: HarmonyParams) -> tuple[FloatArray, IntArray]:
    """Attentional visual beats (Eq. 13), shifted by the lag."""
    if params.visual_threshold is None:
        return batch.visual - params.lag, batch.visual_clip
    salient = batch.steps > params.visual_threshold * batch.spread[batch.visual_clip]
    return batch.visual[salient] - params.lag, batch.visual_clip[salient]


def _nearest(audio: FloatArray, visual: FloatArray) -> FloatArray:
    """Distance of every music beat to the nearest visual beat; clips lie too far apart to meet."""
    if visual.size == 0:
        return np.full(audio.size, np.inf)
    after = np.searchsorted(visual, audio)
    left = np.abs(audio - visual[np.maximum(after - 1, 0)])
    return np.minimum(left, np.abs(visual[np.minimum(after, visual.size - 1)] - audio))


def _coverage(visual: FloatArray, clip: IntArray, batch: BeatBatch, delay: float) -> FloatArray:
    """Chance level of every clip: share of it within the delay of a visual beat."""
    origin = clip * batch.gap
    starts = np.maximum(visual - delay, origin)
    ends = np.minimum(visual + delay, origin + batch.durations[clip])
    reached = np.concatenate([[-np.inf], np.maximum.accumulate(ends)[:-1]]) if ends.size else ends
    added = np.maximum(ends - np.maximum(starts, reached), 0.0)
    return np.bincount(clip, added, batch.durations.size) / batch.durations
