"""Notebook 12: ways to raise the paper's score without dancing to the music (Sec. 6), and what other scores say.

A trick knows nothing of the music, so a score that asks about the music must give it what it gives to chance. Each is
scored with the true music and with the same music half a beat late: a dancer who follows the music loses by it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.beats.visual import visual_beats
from harmolab.harmony import score_harmony
from harmolab.lab.experiments.ablation import group_means
from harmolab.lab.experiments.examples import excerpt
from harmolab.lab.experiments.generation import SYNTHETIC, generator_corpora
from harmolab.lab.experiments.judging import MODES, danced_units, harmony_columns, meter_motion, unit_columns
from harmolab.lab.experiments.study import data_root, readable_recordings, study_recordings, synthetic_corpus
from harmolab.lab.profile import RunProfile
from harmolab.metrics.quality import jerk
from harmolab.types import BeatTrack, Motion

Trick = Callable[[Motion, np.random.Generator], Motion]

SECONDS = 6.0
TRUE, LATE = "true", "half a beat late"


def trembling(motion: Motion, hertz: float, size: float) -> Motion:
    """`motion` with a tremor of the whole body: up and down by `size` metres, `hertz` times a second."""
    wave = size * np.sin(2 * np.pi * hertz * np.arange(motion.n_frames) / motion.fps)
    return replace(motion, positions=motion.positions + wave[:, None, None] * np.array([0.0, 1.0, 0.0]))


def shaken(motion: Motion, size: float, rng: np.random.Generator) -> Motion:
    """`motion` with every joint of every frame displaced at random by `size` metres (standard deviation)."""
    return replace(motion, positions=motion.positions + rng.normal(0.0, size, motion.positions.shape))


def slowed(motion: Motion, factor: float) -> Motion:
    """The beginning of `motion`, `factor` times slower and as long as before: a dance that ignores the music.

    Raises
    ------
    ValueError
        If the factor is less than 1.
    """
    if factor < 1:
        raise ValueError(f"factor must be 1 or more, got {factor}")
    frames = np.arange(motion.n_frames) / factor
    before = frames.astype(np.int64)
    after = np.minimum(before + 1, motion.n_frames - 1)
    share = (frames - before)[:, None, None]
    return replace(motion, positions=motion.positions[before] * (1 - share) + motion.positions[after] * share)


def swaying(motion: Motion, hertz: float, size: float) -> Motion:
    """The first pose of `motion`, carried from side to side by `size` metres, `hertz` times a second."""
    wave = size * np.sin(2 * np.pi * hertz * np.arange(motion.n_frames) / motion.fps)
    return replace(motion, positions=motion.positions[:1] + wave[:, None, None] * np.array([1.0, 0.0, 0.0]))


TRICKS: Mapping[str, Trick] = MappingProxyType(
    {
        "as danced": lambda motion, rng: motion,
        "as danced + jitter 2 cm": lambda motion, rng: shaken(motion, 0.02, rng),
        "dance, 3 times too slow": lambda motion, rng: slowed(motion, 3.0),
        "too slow + tremor 2 Hz": lambda motion, rng: trembling(slowed(motion, 3.0), 2.0, 0.01),
        "too slow + jitter 5 mm": lambda motion, rng: shaken(slowed(motion, 3.0), 0.005, rng),
        "no dance, sway 0.4 Hz": lambda motion, rng: swaying(motion, 0.4, 0.05),
        "sway + tremor 2 Hz": lambda motion, rng: trembling(swaying(motion, 0.4, 0.05), 2.0, 0.01),
    }
)

# The base of each trick that has one.
BASES = MappingProxyType(
    {
        "as danced + jitter 2 cm": "as danced",
        "too slow + tremor 2 Hz": "dance, 3 times too slow",
        "too slow + jitter 5 mm": "dance, 3 times too slow",
        "sway + tremor 2 Hz": "no dance, sway 0.4 Hz",
    }
)


def studied_clips(profile: RunProfile, corpus: str) -> Iterator[tuple[str, Motion, BeatTrack]]:
    """(name, motion, tracked beats) of six seconds from the middle of each sequence, as many as the profile takes."""
    planted = corpus == SYNTHETIC and data_root() is not None
    recordings = readable_recordings(synthetic_corpus(profile)) if planted else study_recordings(profile, corpus)
    for clip in (excerpt(recording, SECONDS) for recording in recordings):
        if clip.motion is not None and clip.beats is not None and len(clip.beats) > 1:
            yield clip.name, clip.motion, clip.beats


def cheating(profile: RunProfile) -> pd.DataFrame:
    """Each of `TRICKS` on every clip of the corpora, with the true music and with music half a beat late.

    Returns
    -------
    DataFrame, a row for each corpus, clip, trick and music (`TRUE`, `LATE`): in paper mode (`paper_`) and for valleys
    within 0.1 s harmony, hit_rate, chance, above_chance, n_visual, n_audio and count_ratio (M / N); jerk (m/s^3).
    """
    rng = np.random.default_rng(profile.seed)
    rows = []
    for corpus in generator_corpora(profile):
        for clip, motion, beats in studied_clips(profile, corpus):
            for name, trick in TRICKS.items():
                about = {"corpus": corpus, "clip": clip, "trick": name}
                rows += [about | row for row in _clip_rows(trick(motion, rng), beats)]
    return pd.DataFrame(rows)


def _clip_rows(motion: Motion, beats: BeatTrack) -> Iterator[dict[str, Any]]:
    """One row for each music."""
    visual = {mode: visual_beats(motion, params=params) for mode, params in MODES.items()}
    about = {"jerk": jerk(motion)}
    for music, track in ((TRUE, beats), (LATE, half_a_beat_late(beats))):
        scores = {mode: score_harmony(track, visual[mode], params=MODES[mode], n_rotations=0) for mode in MODES}
        yield {"music": music, **harmony_columns(scores), **about}


def generators_half_a_beat_late(profile: RunProfile) -> pd.DataFrame:
    """The same for the recorded motion of the test units and for the generators of the first seed.

    They are judged on the meter, as everywhere; every beat of the unit is moved by half its median period.

    Returns
    -------
    DataFrame as `cheating` returns it; "clip" is the unit, "trick" the variant.
    """
    rows = []
    for corpus in generator_corpora(profile):
        units, dances = danced_units(profile, corpus)
        for name, motions in dances.items():
            for motion, unit in zip(motions, units.units, strict=True):
                about = {"corpus": corpus, "clip": unit.name, "trick": name, "jerk": jerk(meter_motion(motion, unit))}
                late = replace(unit, beats=unit.beats + np.median(np.diff(unit.beats)) / 2)
                for music, each in ((TRUE, unit), (LATE, late)):
                    rows.append({**about, "music": music, **unit_columns(motion, each)})
    return pd.DataFrame(rows)


def trick_means(table: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Means over clips with 95 % intervals, a row for each corpus, trick, music and measure.

    Parameters
    ----------
    table : DataFrame, as `cheating` or `generators_half_a_beat_late` returns it
    measures : names of its columns

    Returns
    -------
    DataFrame with the columns corpus, trick, music, measure, n, mean, low, high
    """
    keys = ["corpus", "trick", "music"]
    return group_means(table, keys, measures)[[*keys, "measure", "n", "mean", "low", "high"]]


def trick_gains(table: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Gain of each trick over the motion it was put on, with the true music: means over clips.

    Parameters
    ----------
    table : DataFrame, as `cheating` returns it
    measures : names of its columns

    Returns
    -------
    DataFrame, a row for each corpus and trick of `BASES`: corpus, trick, "put on", and the change of every measure
    """
    true = table[table["music"] == TRUE]
    rows = []
    for corpus, part in true.groupby("corpus", sort=False):
        means = part.groupby("trick")[list(measures)].mean()
        for trick, base in BASES.items():
            rows.append({"corpus": corpus, "trick": trick, "put on": base, **(means.loc[trick] - means.loc[base])})
    return pd.DataFrame(rows)


def half_a_beat_late(beats: BeatTrack) -> BeatTrack:
    """The same beats half a median period later; what passes the end comes in again at the start.

    Raises
    ------
    ValueError
        If there are fewer than two beats.
    """
    if len(beats) < 2:
        raise ValueError(f"half a beat needs two beats or more, got {len(beats)}")
    moved = np.mod(beats.times + np.median(np.diff(beats.times)) / 2, beats.duration)
    times, first = np.unique(moved, return_index=True)
    return BeatTrack(times, beats.strengths[first], beats.fps, beats.duration)
