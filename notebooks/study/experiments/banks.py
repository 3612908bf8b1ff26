"""Dances of the movement that comes with harmolab, measured on songs: guard, seams, jerk at them, rests on the beat."""

from __future__ import annotations

import time
from collections.abc import Sequence

import pandas as pd

from harmolab.beats.audio import music_beats
from harmolab.files import Progress, silent
from harmolab.lab.evaluate.measured import rests_on_beat
from harmolab.metrics.likeness import LONGEST, likeness
from harmolab.metrics.quality import foot_skating
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.types import Clip
from study.experiments.choreography import seam_jerk

# What a style that is shipped must reach in a `bank_table`: means over its dances, and their worst seam.
LEAST_PASSED = 11 / 12
MOST_SEAM, MOST_WORST, MOST_JERK, MOST_SKATING = 10.0, 18.0, 1.0, 0.15
LEAST_RESTS, MOST_RESTS_LATE = 0.25, 0.0


def bank_table(
    choreographer: Choreographer,
    songs: Sequence[Clip],
    *,
    seeds: Sequence[int] = (0, 1),
    seconds: float | None = LONGEST,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Dances of a bank to songs, with the numbers that say whether they may be shown.

    Parameters
    ----------
    choreographer : Choreographer, such as that of `shipped_bank`
    songs : clips with sound; beats are tracked where they have none, with the tempo of their dance as prior
    seeds : one dance each
    seconds : float, length of the dances, from the start of the music; None for all of it
    progress : function(iterable, label) -> iterable

    Returns
    -------
    DataFrame, a row a dance: song, seed, bpm, "work (s)" (after the beats), passed and fails (the guard, by the limits
    of the bank's own takes), "seam (cm)", "worst seam (cm)", "jerk ratio" (`seam_jerk`), skating (m/s), "rests on the
    beat" and "rests half a beat late" (`rests_on_beat`), "seen before"
    """
    rows = []
    for clip in progress(songs, "dancing"):
        beats = music_beats(clip)
        for seed in seeds:
            begin = time.perf_counter()
            choreography = choreographer.choreograph(clip.audio, beats, seconds=seconds, seed=seed)
            work = time.perf_counter() - begin
            judged = likeness(choreography.motion, limits=choreographer.limits)
            music = beats.span(choreography.start, choreography.motion.duration)
            rows.append(
                {
                    "song": clip.name,
                    "seed": seed,
                    "bpm": beats.tempo,
                    "work (s)": work,
                    "passed": judged.passed,
                    "fails": ", ".join(judged.fails),
                    "seam (cm)": choreography.mean_seam_cm,
                    "worst seam (cm)": choreography.worst_seam_cm,
                    "jerk ratio": seam_jerk(choreography, beats),
                    "skating": foot_skating(choreography.motion),
                    "rests on the beat": rests_on_beat(choreography.motion, music),
                    "rests half a beat late": rests_on_beat(choreography.motion, music, late=0.5),
                    "seen before": choreography.seen_before,
                }
            )
    return pd.DataFrame(rows)
