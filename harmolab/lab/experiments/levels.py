"""Levels that recordings reach with their own music, with the same music moved, and with another dance's music."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from harmolab.corpora.folders import Recording
from harmolab.corpora.synthetic import ClipSettings, planted_clip
from harmolab.lab.compare.windows import BeatClip, cut_clips, learn_patterns
from harmolab.lab.experiments.generation import SYNTHETIC
from harmolab.lab.experiments.locked import judged_columns
from harmolab.lab.experiments.study import corpus_folders, data_root, readable_recordings
from harmolab.lab.profile import RunProfile
from harmolab.params import DANCE_PATTERNS, BarPattern
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import judge

OWN, LAGGED, OTHER = "its own", "0.3-0.7 beat late", "another dance's"
LAGS = (0.3, 0.7)  # beats
SECONDS = 32.0  # of each synthetic recording: 16 beats are the least that is judged
PER_DANCE = 3


def level_recordings(profile: RunProfile) -> dict[str, list[Recording]]:
    """Recordings with annotated beats, by corpus; synthetic ones, an exact dancer each, where there are none."""
    if data_root() is not None:
        corpora = {name: list(readable_recordings(root)) for name, root in corpus_folders(profile).items()}
        annotated = {
            name: [item for item in recordings if item.annotation is not None and item.clip.motion is not None]
            for name, recordings in corpora.items()
        }
        if any(annotated.values()):
            return {name: recordings for name, recordings in annotated.items() if recordings}
    return {SYNTHETIC: list(_synthetic_recordings(profile))}


def _synthetic_recordings(profile: RunProfile) -> Iterator[Recording]:
    """`PER_DANCE` recordings of each dance that has a shipped pattern, in memory."""
    for dance in DANCE_PATTERNS:
        for take in range(PER_DANCE):
            settings = ClipSettings(dance, SECONDS, fps=30.0, jitter=0.03, seed=PER_DANCE * profile.seed + take)
            planted = planted_clip(settings)
            yield Recording(planted.clip, planted.annotation, Path(f"{dance} {take}"))


def level_table(recordings: Sequence[Recording], *, seed: int = 0) -> pd.DataFrame:
    """The verdict on whole recordings with annotated beats, to three musics.

    The pattern of a recording is learnt on others of its dance, on figures that it does not hold; where every other
    recording shares a figure, on all of them ("shared figures").

    Parameters
    ----------
    recordings : of one corpus, each with motion and annotated beats
    seed : int, of the lags and the choice of other music

    Returns
    -------
    DataFrame, a row for each recording and music (`OWN`, `LAGGED`, `OTHER`): recording, dance, music, "shared figures",
    and the columns of `judged_columns`. No row for other music where all recordings are of one dance.
    """
    rng = np.random.default_rng(seed)
    clips = [cut_clips(recording, "annotated", None) for recording in recordings]
    rows = []
    for recording, parts in zip(recordings, clips, strict=True):
        pattern, shared = _pattern_of_others(
            parts, [clip for others in clips if others is not parts for clip in others]
        )
        motion, start = _motion(recording), recording.clip.offset
        about = {"recording": recording.clip.name, "dance": recording.clip.dance, "shared figures": shared}
        for music, beats in _musics(parts[0], motion, start, [each[0] for each in clips], rng).items():
            verdict = judge(shape_speed(motion), beats, pattern=pattern)
            rows.append({**about, "music": music, **judged_columns(verdict)})
    return pd.DataFrame(rows)


def _motion(recording: Recording) -> Motion:
    if recording.clip.motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    return recording.clip.motion


def _pattern_of_others(parts: Sequence[BeatClip], others: Sequence[BeatClip]) -> tuple[BarPattern | None, bool]:
    """The pattern learnt on other recordings of the dance, None without any, and if figures had to be shared."""
    strict = replace(parts[0], figures=frozenset().union(*(clip.figures for clip in parts)))
    for judged, shared in ((strict, False), (replace(strict, figures=frozenset()), True)):
        (pattern,) = learn_patterns([judged], others)
        if pattern != BarPattern.stop_on_the_beat():
            return replace(pattern, dance=parts[0].dance), shared
    return None, True


def _musics(
    part: BeatClip, motion: Motion, start: float, corpus: Sequence[BeatClip], rng: np.random.Generator
) -> dict[str, BeatTrack]:
    """Beats of each music on the motion's time line."""
    lag, seconds = rng.uniform(*LAGS) * part.period, motion.duration
    musics = {OWN: part.track.span(start, seconds), LAGGED: part.track.span(start - lag, seconds)}
    strangers = [clip.track for clip in corpus if clip.dance != part.dance]
    if strangers:
        track = strangers[rng.integers(len(strangers))]
        musics[OTHER] = track.span(rng.uniform(0.0, max(track.duration - seconds, 0.0)), seconds)
    return musics
