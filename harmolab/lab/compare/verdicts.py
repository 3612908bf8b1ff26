"""The verdict on each recording of a corpus, and how many reach each level with true and with lagged music."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harmolab.bar_pattern import fit_pattern
from harmolab.corpora import folders
from harmolab.corpora.folders import recording_beats
from harmolab.harmony import music_and_motion
from harmolab.io.files import plain
from harmolab.lab.compare.fits import TENTHS
from harmolab.lab.compare.scores import LAGS
from harmolab.lab.compare.windows import BeatClip, usable
from harmolab.params import DANCE_PATTERNS
from harmolab.shape_speed import ShapeSpeed, shape_speed
from harmolab.types import BeatTrack
from harmolab.verdict.judge import judge

N_LEVELS = 5


@dataclass(frozen=True, eq=False)
class RecordingVerdict:
    """A recording as `harmolab score` judges it, and what it takes to judge it again.

    Parameters
    ----------
    clip : BeatClip, the first clip of the recording, with the figures of all and no movement
    row : dict, the verdict with true music for JSON
    shape : ShapeSpeed of the motion; its energy is that of all joints together
    music : BeatTrack, the true beats
    """

    clip: BeatClip
    row: dict[str, Any]
    shape: ShapeSpeed
    music: BeatTrack

    def lagged(self, seed: int) -> BeatTrack:
        """The music one random lag of 0.3-0.7 beat later."""
        lag = int(np.random.default_rng(seed).choice(LAGS)) / TENTHS
        return _later(self.music, lag * self.clip.period)


def recording_verdict(recording: folders.Recording, beats: str, clips: Sequence[BeatClip]) -> RecordingVerdict:
    """The verdict on a whole recording as `score_clip` judges it.

    Parameters
    ----------
    recording : Recording with a motion
    beats : "annotated" or "tracked"
    clips : its clips
    """
    clip = recording.clip
    if beats == "tracked" or clip.beats is None:
        clip = replace(clip, beats=recording_beats(recording, beats))
    music, motion = music_and_motion(clip)
    shape = shape_speed(motion)
    judgement = judge(shape, music, pattern=DANCE_PATTERNS.get(clip.dance))
    numbers = {"harmony_above_chance": judgement.harmony_above_chance, "p_value": judgement.p_value}
    row = {"name": clip.name, "dance": clip.dance, **judgement.to_dict(), **numbers}
    figures = frozenset[str]().union(*(one.figures for one in clips))
    first = replace(clips[0], figures=figures, visual={}, speeds={}, sums={}, lessons={})
    slim = replace(shape, energy=shape.energy.mean(axis=1, keepdims=True))
    return RecordingVerdict(first, plain(row), slim, music)


def _later(track: BeatTrack, seconds: float) -> BeatTrack:
    """The beats later by so many seconds, but for those that leave the time line."""
    times = track.times + seconds
    inside = times <= track.duration
    return replace(track.select(inside), times=times[inside])


def verdict_summary(
    verdicts: Sequence[RecordingVerdict], fit_clips: Sequence[BeatClip], is_inside: bool, seed: int
) -> dict[str, Any]:
    """ "recordings", one row each, and "levels": how many recordings reach each level.

    The levels "true" and "lagged" are by the patterns that ship, as in `harmolab score`. Those with "learnt" are by a
    pattern learnt on other figures of `fit_clips`, in other recordings if these are the corpus; recordings for which
    there is none are left out. Recording i has the lag that `seed` + i draws.
    """
    levels: dict[str, list[int]] = {name: [] for name in ("true", "lagged", "true, learnt", "lagged, learnt")}
    for number, verdict in enumerate(verdicts):
        lagged = verdict.lagged(seed + number)
        levels["true"].append(verdict.row["level"])
        levels["lagged"].append(judge(verdict.shape, lagged, pattern=DANCE_PATTERNS.get(verdict.clip.dance)).level)
        sums = [
            clip.sums["recommended"]
            for clip in fit_clips
            if clip.sums and usable(clip, verdict.clip, same_corpus=is_inside)
        ]
        if sums:
            pattern = replace(fit_pattern(sums), dance=verdict.clip.dance)
            for name, track in (("true, learnt", verdict.music), ("lagged, learnt", lagged)):
                levels[name].append(judge(verdict.shape, track, pattern=pattern).level)
    counts = {name: np.bincount(np.array(row, np.int64), minlength=N_LEVELS).tolist() for name, row in levels.items()}
    return {"recordings": [verdict.row for verdict in verdicts], "levels": counts}
