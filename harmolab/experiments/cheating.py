"""Notebook 12: ways to raise the paper's score without dancing to the music (Sec. 6), and what other scores say."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from harmolab.experiments.study import excerpt, study_sequences
from harmolab.harmony import score_motion
from harmolab.metrics import jerk
from harmolab.params import HarmonyParams, RunProfile
from harmolab.types import BeatTrack, Clip, Motion

__all__ = ["TRICKS", "cheating", "shaken", "studied_clips", "trembling"]

FloatArray = NDArray[np.float64]
Trick = Callable[[Motion, np.random.Generator], Motion]

SECONDS = 6.0


def trembling(motion: Motion, hertz: float, size: float) -> Motion:
    """`motion` with a tremor of the whole body: up and down by `size` metres, `hertz` times a second."""
    wave = size * np.sin(2 * np.pi * hertz * np.arange(motion.n_frames) / motion.fps)
    return replace(motion, positions=motion.positions + wave[:, None, None] * np.array([0.0, 1.0, 0.0]))


def shaken(motion: Motion, size: float, rng: np.random.Generator) -> Motion:
    """`motion` with every joint of every frame displaced at random by `size` metres (standard deviation)."""
    return replace(motion, positions=motion.positions + rng.normal(0.0, size, motion.positions.shape))


TRICKS: dict[str, Trick] = {
    "as danced": lambda motion, rng: motion,
    "tremor 2 Hz, 1 cm": lambda motion, rng: trembling(motion, 2.0, 0.01),
    "tremor 3 Hz, 1 cm": lambda motion, rng: trembling(motion, 3.0, 0.01),
    "tremor 3 Hz, 3 cm": lambda motion, rng: trembling(motion, 3.0, 0.03),
    "jitter 5 mm": lambda motion, rng: shaken(motion, 0.005, rng),
    "jitter 2 cm": lambda motion, rng: shaken(motion, 0.02, rng),
}


def studied_clips(profile: RunProfile) -> Iterator[Clip]:
    """Six seconds from the middle of each of the study's sequences, with tracked beats."""
    for sequence in study_sequences(profile):
        clip = excerpt(sequence, SECONDS)
        if clip.motion is not None and clip.beats is not None:
            yield clip


def cheating(profile: RunProfile) -> pd.DataFrame:
    """Each trick on every clip of the study, with the true music and with music half a beat late.

    Returns
    -------
    DataFrame, a row for each clip, trick and music ("true", "half a beat late"): the paper's harmony, hit rate, chance
    and M / N, harmony above chance with turns and with valleys, jerk (m/s^3).
    """
    rng = np.random.default_rng(profile.seed)
    rows = []
    for clip in studied_clips(profile):
        for name, trick in TRICKS.items():
            motion = trick(_motion(clip), rng)
            for music, beats in _musics(clip).items():
                rows.append({"clip": clip.name, "trick": name, "music": music, **_scores(motion, beats)})
    return pd.DataFrame(rows)


def _motion(clip: Clip) -> Motion:
    """The clip's motion; `studied_clips` gives none without."""
    if clip.motion is None:
        raise ValueError(f"{clip.name}: has no motion")
    return clip.motion


def _musics(clip: Clip) -> dict[str, BeatTrack]:
    """The clip's beats, and the same half a beat later, around the clip."""
    beats = clip.beats
    if beats is None or len(beats) < 2:
        raise ValueError(f"{clip.name}: has fewer than two music beats")
    late = np.mod(beats.times + np.median(np.diff(beats.times)) / 2, beats.duration)
    order = np.argsort(late)
    times, first = np.unique(late[order], return_index=True)
    return {
        "true": beats,
        "half a beat late": BeatTrack(times, beats.strengths[order][first], beats.fps, beats.duration),
    }


def _scores(motion: Motion, beats: BeatTrack) -> dict[str, Any]:
    paper = score_motion(beats, motion, params=HarmonyParams.paper(), n_rotations=0)
    valleys = score_motion(beats, motion, params=HarmonyParams.valleys(), n_rotations=0)
    return {
        "paper's harmony": paper.harmony,
        "hit rate": paper.hit_rate,
        "chance": paper.chance,
        "M / N": paper.n_visual / max(paper.n_audio, 1),
        "above chance (turns)": paper.harmony_above_chance,
        "above chance (valleys)": valleys.harmony_above_chance,
        "jerk": jerk(motion),
    }
