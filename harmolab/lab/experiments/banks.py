"""Dances of the movement that comes with harmolab, measured on songs: guard, seams, jerk at them, rests on the beat."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.beats.audio import music_beats
from harmolab.harmony import score_motion
from harmolab.io.files import Progress, silent
from harmolab.metrics.likeness import LikenessLimits, likeness
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.skeletons import body_frame
from harmolab.systems.choreographer import Choreographer
from harmolab.systems.choreographer.choreography import Choreography
from harmolab.types import BeatTrack, Clip, Motion

SECONDS = 30.0
AROUND = 0.5  # beats to either side of a seam, or of a beat, in which jerk is measured


def bank_table(
    choreographer: Choreographer,
    songs: Iterable[Clip],
    *,
    seeds: Iterable[int] = (0, 1),
    seconds: float = SECONDS,
    limits: LikenessLimits | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """A row for each dance to each song, with the numbers that say whether it may be shown.

    Parameters
    ----------
    choreographer : Choreographer, such as `shipped_bank("salsa")`
    songs : clips with audio; their beats are tracked where they have none, with the tempo of their dance as prior
    seeds : of the dances to each song
    seconds : length of the dances, from the start of the music
    limits : LikenessLimits, those of the choreographer's recordings when left out

    Returns
    -------
    DataFrame
        song, seed, bpm, made (seconds of work after the beats), guard (True where likeness passes), fails, seam and
        worst (cm), jerk (mean jerk about the seams over that about the other beats), skating (m/s), valleys and
        off_beat (harmony above chance of the speed valleys in the body, on the beat and half a beat off).
    """
    rows = []
    seeds = tuple(seeds)
    for clip in progress(list(songs), "dancing"):
        beats = music_beats(clip)
        for seed in seeds:
            begin = time.perf_counter()
            dance = choreographer.choreograph(clip.audio, beats, seconds=seconds, seed=seed)
            row = {"song": clip.name, "seed": seed, "bpm": beats.tempo, "made": time.perf_counter() - begin}
            rows.append(row | dance_row(dance, beats, limits or choreographer.limits))
    return pd.DataFrame(rows)


def dance_row(dance: Choreography, beats: BeatTrack, limits: LikenessLimits | None) -> dict[str, Any]:
    """The numbers of one dance, by the names of `bank_table`; `beats` are on the audio time line."""
    motion = dance.motion
    music = beats.span(dance.start, motion.duration)
    judged = likeness(motion, limits=limits)
    return {
        "guard": judged.passed,
        "fails": ", ".join(judged.fails),
        "seam": dance.mean_seam_cm,
        "worst": dance.worst_seam_cm,
        "jerk": seam_jerk(dance, music),
        "skating": foot_skating(motion),
        "valleys": body_valleys(motion, music),
        "off_beat": body_valleys(motion, later(music, 0.5)),
        "seen": dance.seen_before,
        "stretch": dance.stretch,
    }


def seam_jerk(dance: Choreography, music: BeatTrack) -> float:
    """Mean jerk within half a beat of the seams over that within half a beat of all other beats; NaN without seams."""
    starts = np.array([piece.start for piece in dance.pieces[1:]])
    is_seam = np.isclose(music.times[:, None], starts, atol=1e-6).any(axis=1)
    jerks = np.array(
        [_jerk_at(dance.motion, time, period) for time, period in zip(music.times, _periods(music), strict=True)]
    )
    at_seams, elsewhere = jerks[is_seam], jerks[~is_seam]
    return float(np.nanmean(at_seams) / np.nanmean(elsewhere)) if at_seams.size and elsewhere.size else float("nan")


def _periods(music: BeatTrack) -> np.ndarray:
    """Seconds from each beat to the next; the last as long as the one before."""
    steps = np.diff(music.times)
    return np.append(steps, steps[-1:])


def _jerk_at(motion: Motion, time: float, period: float) -> float:
    """Jerk about a beat; NaN at the ends of the motion, where there is not all of it."""
    first = time - AROUND * period
    if first < 0 or first + period > motion.duration:
        return float("nan")
    return jerk(motion.span(first, period))


def body_valleys(motion: Motion, music: BeatTrack) -> float:
    """Harmony above chance of the moments at which the joints are slowest in the body; -1 to 1."""
    inside = replace(motion, positions=body_frame(motion.positions, motion.fps, motion.skeleton))
    return score_motion(music, inside, params=HarmonyParams.valleys(), n_rotations=0).harmony_above_chance


def later(music: BeatTrack, beats: float) -> BeatTrack:
    """Music whose beats come so many beats later; those beyond its end are left out."""
    times = music.times + beats * _periods(music)
    return replace(music, times=times, duration=max(music.duration, times[-1])).span(0.0, music.duration)
