"""Many clips at once: the hit score of every clip of a corpus after a slider moves (Eq. 11-21, vectorised).

`BeatBatch` keeps the beats of all clips in two flat arrays; clip i is moved by i long days along the time line, so
that one sorted search finds every nearest visual beat and none belongs to another clip. Same numbers as
`score_harmony`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harmolab.beats.saliency import normalise_strengths, strength_steps
from harmolab.harmony import EDGE
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack

__all__ = ["BatchScores", "BeatBatch", "rescore"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
        sounds = [normalise_strengths(music.strengths, "max") for music, _ in pairs]
        steps = [strength_steps(visual.strengths) for _, visual in pairs]
        return cls(
            audio=np.concatenate([music.times + i * gap for i, (music, _) in enumerate(pairs)]),
            audio_strengths=np.concatenate(sounds),
            audio_clip=np.repeat(np.arange(len(pairs)), [len(music) for music, _ in pairs]),
            visual=np.concatenate([visual.times + i * gap for i, (_, visual) in enumerate(pairs)]),
            visual_clip=np.repeat(np.arange(len(pairs)), [len(visual) for _, visual in pairs]),
            steps=np.concatenate(steps),
            spread=np.array([row[1:].std() if row.size > 1 else 0.0 for row in steps]),
            level=np.array([row.std() if row.size else 0.0 for row in sounds]),
            durations=durations,
            gap=gap,
        )


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
    heard = batch.audio_strengths > params.audio_threshold * batch.level[batch.audio_clip]
    visual, visual_clip = _salient_visual(batch, params)
    near = _nearest(batch.audio, visual) <= params.reaction_delay + EDGE
    worth = batch.audio_strengths * heard
    score = np.bincount(batch.audio_clip, worth * near, clips)
    n_audio = np.bincount(batch.audio_clip, heard, clips).astype(np.int64)
    n_visual = np.bincount(visual_clip, minlength=clips)
    both = (n_audio > 0) & (n_visual > 0)
    total, beats = np.bincount(batch.audio_clip, worth, clips), np.bincount(batch.audio_clip, minlength=clips)
    chance = _coverage(visual, visual_clip, batch, params.reaction_delay)
    share = np.divide(score, total, out=np.zeros(clips), where=total > 0)
    below = n_audio * params.beta**2 + n_visual
    return BatchScores(
        harmony=np.divide((1 + params.beta**2) * score, below, out=np.zeros(clips), where=both),
        hit_rate=np.divide(np.bincount(batch.audio_clip, near, clips), beats, out=np.zeros(clips), where=beats > 0),
        chance=chance,
        harmony_above_chance=np.divide(
            share - chance, 1 - chance, out=np.zeros(clips), where=both & (chance < 1 - EDGE)
        ),
        hitting_score=np.asarray(score, dtype=np.float64),
        n_audio=n_audio,
        n_visual=n_visual,
    )


def _salient_visual(batch: BeatBatch, params: HarmonyParams) -> tuple[FloatArray, IntArray]:
    """Attentional visual beats (Eq. 13), shifted by the lag."""
    if params.visual_threshold is None:
        return batch.visual - params.lag, batch.visual_clip
    seen = batch.steps > params.visual_threshold * batch.spread[batch.visual_clip]
    return batch.visual[seen] - params.lag, batch.visual_clip[seen]


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
