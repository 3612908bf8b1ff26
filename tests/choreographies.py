"""Choreographed dances measured, for tests: guard, seams and the jerk at them, skating, rests on the beat, harmony.

Every song of a corpus is danced from all other recordings: a song's own one is left out of the corpus that it is danced
from, of the bar pattern that it is scored by and of the limits that its dance is held against.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from harmolab.data.recordings import Recording
from harmolab.lab.compare.windows import cut_clips
from harmolab.lab.evaluate.measured import Dance, dance_numbers
from harmolab.metrics.likeness import LONGEST, LikenessLimits, window_measures
from harmolab.metrics.quality import STEP, sampled, vector_lengths
from harmolab.params import HarmonyParams
from harmolab.systems.choreographer.generate import Choreographer, Choreography
from harmolab.systems.choreographer.takes import take_of
from harmolab.types import BeatTrack
from harmolab.verdict.bar_pattern import fit_pattern
from harmolab.verdict.judge import score_motion

NEAR = 0.05  # seconds: a beat this near to the start of a piece is a seam


def measured(made: Choreography, beats: BeatTrack, dancer: Choreographer, dance: str = "") -> dict[str, float]:
    """The numbers of a dance to beats on the audio time line; likeness is by the limits of the dancer."""
    music = beats.span(made.start, made.motion.duration)
    one = Dance("", "", made.motion, music, dance=dance, limits=dancer.limits)
    numbers = dance_numbers(one, ["likeness", "foot_skating", "rests", "rests_late"])
    seams = {"seam": made.mean_seam_cm, "worst seam": made.worst_seam_cm, "jerk ratio": seam_jerk(made, beats)}
    return numbers | seams


def danced_from_others(recordings: Sequence[Recording], seeds: Sequence[int], seconds: float = LONGEST) -> pd.DataFrame:
    """`measured` of each song danced from the other recordings of its dance, with H by the bar pattern of those."""
    takes = [take_of(one) for one in recordings]
    windows = [window_measures(take.motion) for take in takes]
    sums = [[cut.sums for cut in cut_clips(one, "annotated", None) if cut.sums is not None] for one in recordings]
    rows = []
    for number, (recording, take) in enumerate(zip(recordings, takes, strict=True)):
        clip, others = recording.clip, [place for place in range(len(takes)) if place != number]
        same = [place for place in others if takes[place].dance == take.dance]
        limits = LikenessLimits.of_windows([windows[n] for n in others], [takes[n].dance for n in others])
        pattern = replace(fit_pattern(part for place in same for part in sums[place]), dance=take.dance)
        dancer = Choreographer([takes[place] for place in same], limits=limits)
        start = max(clip.offset, 0.0)
        for seed in seeds:
            about = {"start": start, "seconds": seconds, "seed": seed, "dance": clip.dance}
            made = dancer.choreograph(clip.audio, clip.beats, **about)
            music, params = clip.beats.span(start, seconds), HarmonyParams.recommended(pattern)
            harmony = score_motion(music, made.motion, params=params).harmony_above_chance
            row = {"recording": clip.name, "seed": seed, "H": harmony}
            rows.append(row | measured(made, clip.beats, dancer, clip.dance))
    return pd.DataFrame(rows)


def seam_jerk(dance: Choreography, beats: BeatTrack) -> float:
    """Jerk in the beat around the seams of a dance over jerk around its other beats; NaN without seams, or beats.

    `beats` are those of the music, on the audio time line. Those within a beat of the dance's ends do not count.
    """
    positions, _, stride = sampled(dance.motion, STEP, steps=3)
    size = len(positions) - 3 * stride
    first, second, third, fourth = (positions[place * stride :][:size] for place in range(4))
    values = vector_lengths(fourth - 3 * third + 3 * second - first).mean(axis=1)
    times = (np.arange(size) + 1.5 * stride) * STEP / stride
    moments = beats.times - dance.start
    period = float(np.median(np.diff(moments)))
    moments = moments[(moments > period) & (moments < dance.motion.duration - period)]
    seams = np.array([piece.start for piece in dance.pieces[1:]])
    around = np.array([values[np.abs(times - moment) <= period / 2].mean() for moment in moments])
    is_seam = (np.abs(np.subtract.outer(moments, seams)) < NEAR).any(axis=1)
    if not is_seam.any() or is_seam.all():
        return float("nan")
    return float(around[is_seam].mean() / around[~is_seam].mean())
