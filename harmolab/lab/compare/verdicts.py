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
from harmolab.lab.compare.fits import TENTHS
from harmolab.lab.compare.scores import LAGS
from harmolab.lab.compare.windows import BeatClip, usable
from harmolab.params import DANCE_PATTERNS
from harmolab.shape_speed import ShapeSpeed, shape_speed
from harmolab.types import BeatTrack
from harmolab.verdict.judge import Judgement, judge

N_LEVELS = 5


@dataclass(frozen=True, eq=False)
class RecordingVerdict:
    """A recording as `harmolab score` judges it, and what it takes to judge it again by another pattern.

    Parameters
    ----------
    clip : BeatClip, the first clip of the recording, with the figures of all
    judgement : Judgement with true music
    lagged_level : int, level with the music 0.3-0.7 beat late
    shape : ShapeSpeed of the motion; its energy is that of all joints together
    tracks : the true and the lagged beats
    """

    clip: BeatClip
    name: str
    judgement: Judgement
    lagged_level: int
    shape: ShapeSpeed
    tracks: tuple[BeatTrack, BeatTrack]

    @property
    def row(self) -> dict[str, Any]:
        """The verdict for JSON."""
        judgement = self.judgement
        numbers = {"harmony_above_chance": judgement.harmony_above_chance, "p_value": judgement.p_value}
        return {"name": self.name, "dance": self.clip.dance, **judgement.to_dict(), **numbers}


def recording_verdict(
    recording: folders.Recording, beats: str, clips: Sequence[BeatClip], *, seed: int = 0
) -> RecordingVerdict:
    """The verdict on a whole recording as `score_clip` judges it, and on the same music one random lag later.

    Parameters
    ----------
    recording : Recording with a motion
    beats : "annotated" or "tracked"
    clips : its clips
    seed : int, of the lag
    """
    clip = recording.clip
    if beats == "tracked" or clip.beats is None:
        clip = replace(clip, beats=recording_beats(recording, beats))
    lag = int(np.random.default_rng(seed).choice(LAGS)) / TENTHS * clips[0].period
    music, motion = music_and_motion(clip)
    shape, tracks = shape_speed(motion), (music, _later(music, lag))
    true, lagged = (judge(shape, track, pattern=DANCE_PATTERNS.get(clip.dance)) for track in tracks)
    figures = frozenset[str]().union(*(one.figures for one in clips))
    slim = replace(shape, energy=shape.energy.mean(axis=1, keepdims=True))
    return RecordingVerdict(replace(clips[0], figures=figures), clip.name, true, lagged.level, slim, tracks)


def _later(track: BeatTrack, seconds: float) -> BeatTrack:
    """The beats later by so many seconds, but for those that leave the time line."""
    times = track.times + seconds
    inside = times <= track.duration
    return replace(track.select(inside), times=times[inside])


def verdict_summary(
    verdicts: Sequence[RecordingVerdict], fit_clips: Sequence[BeatClip], is_inside: bool
) -> dict[str, Any]:
    """ "recordings", one row each, and "levels": how many recordings reach each level.

    The levels "true" and "lagged" are by the patterns that ship, as in `harmolab score`. Those with "learnt" are by a
    pattern learnt on other figures of `fit_clips`, in other recordings if these are the corpus; recordings for which
    there is none are left out.
    """
    levels: dict[str, list[int]] = {
        "true": [verdict.judgement.level for verdict in verdicts],
        "lagged": [verdict.lagged_level for verdict in verdicts],
        "true, learnt": [],
        "lagged, learnt": [],
    }
    for verdict in verdicts:
        sums = [
            clip.sums["recommended"]
            for clip in fit_clips
            if clip.sums and usable(clip, verdict.clip, same_corpus=is_inside)
        ]
        if sums:
            pattern = replace(fit_pattern(sums), dance=verdict.clip.dance)
            for name, track in zip(("true, learnt", "lagged, learnt"), verdict.tracks, strict=True):
                levels[name].append(judge(verdict.shape, track, pattern=pattern).level)
    counts = {name: np.bincount(np.array(row, np.int64), minlength=N_LEVELS).tolist() for name, row in levels.items()}
    return {"recordings": [verdict.row for verdict in verdicts], "levels": counts}
