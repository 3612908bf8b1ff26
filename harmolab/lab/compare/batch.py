"""Many clips at once: the score of every clip of a corpus after a slider moves (Eq. 11-21, vectorised).

`BeatBatch` keeps the beats of all clips in two flat arrays; the beats of clip i have an offset of i times a gap longer
than any clip, so that one sorted search finds every nearest visual beat and none belongs to another clip. Same numbers
as `score_harmony`.

`PatternBatch` keeps what the recommended mode needs: music beats, and the normalised speed, which is slow to find.
Same numbers as `score_motion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harmolab.bar_pattern import beat_curve, beat_moments, joint_fits, normalised_speed
from harmolab.beats.saliency import normalise_strengths, strength_steps
from harmolab.beats.visual import visual_beats
from harmolab.harmony import EDGE
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, FloatArray, IntArray, Motion


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
    def of(cls, pairs: Sequence[tuple[BeatTrack, BeatTrack]]) -> BeatBatch:
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

    def moved(self, seconds: FloatArray) -> BeatBatch:
        """The batch with each clip's music moved by `seconds`, (C,), round its end."""
        origin, length = self.audio_clip * self.gap, self.durations[self.audio_clip]
        moved = np.mod(self.audio - origin + seconds[self.audio_clip], length)
        return replace(self, audio=np.asarray(origin + moved, np.float64))


@dataclass(frozen=True, eq=False)
class PatternBatch:
    """C clips for the recommended mode: music beats, the dance's normalised speed, and M, its visual beats.

    Parameters
    ----------
    music : C beat tracks
    speeds : C pairs (times, speed) of `harmolab.bar_pattern.normalised_speed`
    n_visual : (C,) array of int
    """

    music: tuple[BeatTrack, ...]
    speeds: tuple[tuple[FloatArray, FloatArray], ...]
    n_visual: IntArray

    @classmethod
    def of(cls, pairs: Sequence[tuple[BeatTrack, Motion]], params: HarmonyParams) -> PatternBatch:
        """The batch of (music, motion) on one time line; of `params` counts what decides how the motion is read.

        Raises
        ------
        ValueError
            Without clips.
        """
        if not pairs:
            raise ValueError("a batch needs at least one clip")
        timed = [replace(motion, fps=motion.fps / params.clock) for _, motion in pairs]
        return cls(
            tuple(music for music, _ in pairs),
            tuple(normalised_speed(motion, params) for motion in timed),
            np.array([len(visual_beats(motion, params=params)) for motion in timed], np.int64),
        )

    @property
    def durations(self) -> FloatArray:
        """(C,) array, seconds."""
        return np.array([music.duration for music in self.music])

    @cached_property
    def audio_clip(self) -> IntArray:
        """(N,) array: which clip each music beat belongs to."""
        return np.repeat(np.arange(len(self.music)), [len(track) for track in self.music])

    @cached_property
    def beat_numbers(self) -> list[IntArray]:
        """Number of each music beat of each clip, counted from the beginning of a bar where that is known."""
        firsts = [0 if track.bar_places is None or not len(track) else track.bar_places[0] for track in self.music]
        return [np.arange(len(track)) + first for track, first in zip(self.music, firsts, strict=True)]

    @cached_property
    def is_ranked(self) -> list[bool]:
        """True for each clip that has beats and movement enough to be ranked."""
        return [len(track) > 1 and bool(speed.any()) for track, (_, speed) in zip(self.music, self.speeds, strict=True)]

    def moved(self, seconds: FloatArray) -> PatternBatch:
        """The batch with each clip's music moved by `seconds`, (C,), round its end."""
        return replace(self, music=tuple(map(_moved_track, self.music, seconds)))


def _moved_track(track: BeatTrack, seconds: float) -> BeatTrack:
    """The beats moved round the end of their time line; two that fall on one moment become one."""
    times, kept = np.unique(np.mod(track.times + seconds, track.duration), return_index=True)
    places = None if track.bar_places is None else track.bar_places[kept]
    return replace(track, times=times, strengths=track.strengths[kept], bar_places=places)


@dataclass(frozen=True, eq=False)
class BatchScores:
    """(C,) arrays: h of Eq. 21, hit rate, chance level, harmony above chance, h_s, N and M of every clip."""

    harmony: FloatArray
    hit_rate: FloatArray
    chance: FloatArray
    harmony_above_chance: FloatArray
    hitting_score: FloatArray
    n_audio: IntArray
    n_visual: IntArray


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
        chance=chance,
        harmony_above_chance=np.where(counts, _above_chance(_quotient(score, total), chance), 0.0),
        hitting_score=score,
        n_audio=n_audio,
        n_visual=n_visual,
    )


def rescore_patterns(batch: PatternBatch, params: HarmonyParams) -> BatchScores:
    """Scores of every clip by its fit to ``params.pattern``, with the batch's reading of the motions.

    Raises
    ------
    ValueError
        Where the best place in the bar would have to be searched for, or for another reading of saliency: use
        `score_motion` for those.
    """
    pattern = params.pattern or BarPattern.stop_on_the_beat()
    if pattern.beats > 1 and any(track.bar_places is None for track in batch.music):
        raise ValueError("rescore_patterns needs to know the bar places of all beats; use score_motion")
    if params.saliency != "threshold":
        raise ValueError(f"rescore_patterns knows the saliency 'threshold' only, not {params.saliency!r}")
    clips, clip = len(batch.music), batch.audio_clip
    strengths, level = _strengths(batch, params.normalisation)
    salient, ranks = strengths > params.audio_threshold * level[clip], _beat_ranks(batch, params)
    fits, weights = salient & (ranks > 0.5), strengths * salient
    n_audio, n_fitting = (_sums(clip, mask, clips) for mask in (salient, fits))
    score, total, mass = (_sums(clip, part, clips) for part in (weights * fits, weights, weights * ranks))
    chance = np.full(clips, 0.5)
    return BatchScores(
        harmony=_harmony(score, n_audio.astype(np.int64), batch.n_visual, params.beta),
        hit_rate=_quotient(n_fitting, n_audio),
        chance=chance,
        harmony_above_chance=np.where(n_audio > 0, _above_chance(_quotient(mass, total), chance), 0.0),
        hitting_score=score,
        n_audio=n_audio.astype(np.int64),
        n_visual=batch.n_visual,
    )


@lru_cache(maxsize=8)  # asked for whenever a slider moves, and changed by none
def _strengths(batch: PatternBatch, normalisation: str) -> tuple[FloatArray, FloatArray]:
    """Normalised strengths of all music beats, (N,), and their SD in each clip, (C,)."""
    rows = [normalise_strengths(track.strengths, normalisation) for track in batch.music]
    return np.concatenate(rows), np.array([row.std() if row.size else 0.0 for row in rows])


def _beat_ranks(batch: PatternBatch, params: HarmonyParams) -> FloatArray:
    """Rank of every music beat of every clip among the clip's moments, (N,); 0.5 where nothing can be ranked."""
    nothing = (np.zeros(0), 0)
    curves = [
        beat_curve(times - params.lag, speed, track) if moves else nothing
        for track, (times, speed), moves in zip(batch.music, batch.speeds, batch.is_ranked, strict=True)
    ]
    pattern = params.pattern or BarPattern.stop_on_the_beat()
    fits = joint_fits([curve for curve, _ in curves], pattern)
    ordered = np.sort(fits, axis=-1)
    ranks = [np.zeros(0)]
    for clip, (beats, (curve, first)) in enumerate(zip(batch.beat_numbers, curves, strict=True)):
        if curve.size == 0:
            ranks.append(np.full(beats.size, 0.5))
            continue
        places, moments = beats % pattern.beats, beat_moments(beats, first, curve.size)
        ranks.append(_ranks(ordered[clip], places, fits[clip, places, moments]) / curve.size)
    return np.concatenate(ranks)


def _ranks(ordered: FloatArray, places: IntArray, values: FloatArray) -> FloatArray:
    """Number of entries below each value in its row of (rows, G), half of those equal to it counted."""
    below = np.empty(values.size)
    for place, row in enumerate(ordered):
        own = places == place
        below[own] = (row.searchsorted(values[own]) + row.searchsorted(values[own], side="right")) / 2
    return below


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
