"""The choreographer measured: each song danced from all other recordings, beside the dancer who was recorded to it.

A song's own recording is left out of the corpus that it is danced from, of the bar pattern that it is scored by and of
the limits that its dance is held against, so nothing is judged by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.data.recordings import Recording
from harmolab.files import Progress, silent
from harmolab.lab.compare.windows import cut_clips
from harmolab.metrics.likeness import LONGEST, LikenessLimits, likeness, window_measures
from harmolab.metrics.quality import STEP, foot_skating, sampled, vector_lengths
from harmolab.params import BarPattern, HarmonyParams
from harmolab.systems.choreographer.generate import Choreographer, Choreography
from harmolab.systems.choreographer.moves import ChoreographerParams
from harmolab.systems.choreographer.takes import take_of
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.bar_pattern import PatternSums, fit_pattern
from harmolab.verdict.judge import score_motion

# What the means over all dances must reach, and the number of dances that must pass the guard: all.
MOST_SEAM, MOST_JERK, MOST_SKATING, LEAST_HARMONY = 8.0, 1.1, 0.35, 0.35
NEAR = 0.05  # seconds: a beat this near to the start of a piece is a seam


def choreography_table(
    recordings: Sequence[Recording],
    *,
    seeds: Sequence[int] = (0, 1),
    seconds: float = LONGEST,
    params: ChoreographerParams | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Every song danced from the other recordings of its dance, on its annotated beats, beside who was recorded to it.

    Parameters
    ----------
    recordings : of one skeleton, with annotated beats and bars, two of each dance at least
    seeds : one dance each
    seconds : float, length of the dances, from where the recorded dancer begins
    params : ChoreographerParams, optional
    progress : function(iterable, label) -> iterable

    Returns
    -------
    DataFrame, a row a dance: recording, dance, seed, passed and fails (the guard), "seam (cm)" and "worst seam (cm)",
    seams, "jerk ratio" (`seam_jerk`), skating (m/s), H, p and level of our score by the bar pattern of the others,
    "longest stretch" (beats), "seen before", "distinct minutes"; and "H recorded", "p recorded", "level recorded" and
    "skating recorded" of the dancer who was recorded

    Raises
    ------
    ValueError
        If a recording has no motion or no annotated beats, or is alone in its dance.
    """
    takes = [take_of(recording) for recording in recordings]
    windows = [window_measures(take.motion) for take in takes]
    sums = [_sums(recording) for recording in progress(recordings, "learning bars")]
    rows: list[dict[str, Any]] = []
    for number, recording in enumerate(progress(recordings, "dancing")):
        others = [other for other in range(len(recordings)) if other != number]
        same = [other for other in others if takes[other].dance == takes[number].dance]
        if not same:
            raise ValueError(f"{takes[number].name}: no other recording of {takes[number].dance or 'its dance'}")
        limits = LikenessLimits.of_windows([windows[n] for n in others], [takes[n].dance for n in others])
        pattern = replace(fit_pattern(part for n in same for part in sums[n]), dance=takes[number].dance)
        dancer = Choreographer([takes[n] for n in same], params=params, limits=limits)
        rows += [_row(recording, dancer, pattern, seed, seconds) for seed in seeds]
    return pd.DataFrame(rows)


def choreography_summary(table: pd.DataFrame) -> pd.DataFrame:
    """The means of a `choreography_table` beside what they must reach, and beside the recorded dancers.

    Returns
    -------
    DataFrame indexed by what is counted: dance, wanted, recorded
    """
    mean, size = table.mean(numeric_only=True), len(table)
    counts = {name: int((table[name] < 0.05).sum()) for name in ("p", "p recorded")}
    rows = {
        "passes the guard": (f"{int((table['passed'] == True).sum())}/{size}", f"{size}/{size}", ""),  # noqa: E712
        "mean seam (cm)": (mean["seam (cm)"], f"at most {MOST_SEAM:g}", ""),
        "jerk at seams / at other beats": (mean["jerk ratio"], f"at most {MOST_JERK:g}", ""),
        "skating (m/s)": (mean["skating"], f"at most {MOST_SKATING:g}", mean["skating recorded"]),
        "H by the bar pattern": (mean["H"], f"at least {LEAST_HARMONY:g}", mean["H recorded"]),
        "p < .05": (f"{counts['p']}/{size}", "", f"{counts['p recorded']}/{size}"),
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=["made", "wanted", "recorded"])


def _sums(recording: Recording) -> list[PatternSums]:
    """Fourier sums of a recording's clips, which its dance's pattern is learnt from, as `harmolab learn` does."""
    clips = cut_clips(recording, "annotated", None)
    return [clip.sums for clip in clips if clip.sums is not None]


def _row(recording: Recording, dancer: Choreographer, pattern: BarPattern, seed: int, seconds: float) -> dict[str, Any]:
    """One dance, measured."""
    clip = recording.clip
    if clip.motion is None or clip.beats is None:
        raise ValueError(f"{clip.name}: needs a motion and annotated beats")
    start = max(clip.offset, 0.0)
    dance = dancer.choreograph(clip.audio, clip.beats, start=start, seconds=seconds, seed=seed, dance=clip.dance)
    judged = likeness(dance.motion, dance=clip.dance, limits=dancer.limits)
    danced = clip.motion.span(start - clip.offset, seconds)
    return {
        "recording": clip.name,
        "dance": clip.dance,
        "seed": seed,
        "passed": judged.passed,
        "fails": ", ".join(judged.fails),
        "seam (cm)": dance.mean_seam_cm,
        "worst seam (cm)": dance.worst_seam_cm,
        "seams": len(dance.pieces) - 1,
        "jerk ratio": seam_jerk(dance, clip.beats),
        "skating": foot_skating(dance.motion),
        **_scored(clip.beats.span(start, seconds), dance.motion, pattern, ""),
        "longest stretch": dance.longest_stretch,
        "seen before": dance.seen_before,
        "distinct minutes": dance.distinct_minutes,
        "skating recorded": foot_skating(danced),
        **_scored(clip.beats.span(start, seconds), danced, pattern, " recorded"),
    }


def _scored(beats: BeatTrack, motion: Motion, pattern: BarPattern, suffix: str) -> dict[str, Any]:
    """H, p and level of our score."""
    score = score_motion(beats, motion, params=HarmonyParams.recommended(pattern))
    level = np.nan if score.judgement is None else score.judgement.level
    return {f"H{suffix}": score.harmony_above_chance, f"p{suffix}": score.p_value, f"level{suffix}": level}


def seam_jerk(dance: Choreography, beats: BeatTrack) -> float:
    """Jerk in the beat around the seams of a dance over jerk around its other beats; NaN without seams, or beats.

    `beats` are those of the music, on the audio time line. Those within a beat of the dance's ends do not count.
    """
    times, values = _jerk_course(dance.motion)
    moments = beats.times - dance.start
    period = float(np.median(np.diff(moments)))
    moments = moments[(moments > period) & (moments < dance.motion.duration - period)]
    seams = np.array([piece.start for piece in dance.pieces[1:]])
    around = np.array([values[np.abs(times - moment) <= period / 2].mean() for moment in moments])
    is_seam = (np.abs(np.subtract.outer(moments, seams)) < NEAR).any(axis=1)
    if not is_seam.any() or is_seam.all():
        return float("nan")
    return float(around[is_seam].mean() / around[~is_seam].mean())


def _jerk_course(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """The length of the third difference of joint positions (`harmolab.metrics.quality.jerk`), and its moments."""
    positions, _, stride = sampled(motion, STEP, steps=3)
    size = len(positions) - 3 * stride
    first, second, third, fourth = (positions[place * stride :][:size] for place in range(4))
    change = vector_lengths(fourth - 3 * third + 3 * second - first).mean(axis=1) / STEP**3
    return (np.arange(size) + 1.5 * stride) * STEP / stride, change
