"""Notebook 12: ways to raise the paper's score without dancing to the music (Sec. 6), and what other scores say.

A trick knows nothing of the music, so a score that asks about the music must give it what it gives to chance. Each is
scored with the true music and with the same music half a beat late: a dancer who follows the music loses by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.beats.visual import visual_beats
from harmolab.metrics.quality import jerk
from harmolab.score import score_harmony
from harmolab.types import BeatTrack, Motion
from study.experiments.ablation import group_means
from study.experiments.examples import excerpt
from study.experiments.generation import SYNTHETIC, generator_corpora
from study.experiments.judging import MODES, danced_units, harmony_columns, meter_motion, unit_columns
from study.experiments.study import data_root, readable_recordings, study_recordings, synthetic_corpus
from study.profile import RunProfile

SECONDS = 6.0
TRUE, LATE = "true", "half a beat late"


def studied_clips(profile: RunProfile, corpus: str) -> Iterator[tuple[str, Motion, BeatTrack]]:
    """(name, motion, tracked beats) of six seconds from the middle of each sequence, as many as the profile takes."""
    planted = corpus == SYNTHETIC and data_root() is not None
    recordings = readable_recordings(synthetic_corpus(profile)) if planted else study_recordings(profile, corpus)
    for clip in (excerpt(recording, SECONDS) for recording in recordings):
        if clip.motion is not None and clip.beats is not None and len(clip.beats) > 1:
            yield clip.name, clip.motion, clip.beats


def late_rows(motion: Motion, beats: BeatTrack) -> Iterator[dict[str, Any]]:
    """Scores and jerk of a motion, a row for the true music and one for music half a beat late."""
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
    DataFrame, a row for each corpus, unit ("clip"), variant ("trick") and music, with its scores and jerk.
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
    table : DataFrame, as `generators_half_a_beat_late` returns it
    measures : names of its columns

    Returns
    -------
    DataFrame with the columns corpus, trick, music, measure, n, mean, low, high
    """
    keys = ["corpus", "trick", "music"]
    return group_means(table, keys, measures)[[*keys, "measure", "n", "mean", "low", "high"]]


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
