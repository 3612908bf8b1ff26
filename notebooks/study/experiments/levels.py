"""Levels that recordings reach with their own music, with the same music moved, and with another dance's music."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.data.recordings import Recording, recording_beats
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.lab.compare.windows import BeatClip, cut_clips, learn_patterns
from harmolab.params import DANCE_PATTERNS, BarPattern
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import LEVELS, judge
from study.experiments.generation import SYNTHETIC
from study.experiments.locked import judged_columns
from study.experiments.study import corpus_folders, data_root, readable_recordings
from study.profile import RunProfile

OWN, QUARTER, HALF = "its own", "a quarter of a beat late", "half a beat late"
SAME, OTHER = "the same dance's", "another dance's"
LAGS = MappingProxyType({QUARTER: 0.25, HALF: 0.5})  # beats
SETTINGS = (("tracked", False), ("tracked", True), ("annotated", False), ("annotated", True))
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


def level_table(
    recordings: Sequence[Recording], *, beats: str = "annotated", is_told: bool = True, seed: int = 0
) -> pd.DataFrame:
    """The verdict on whole recordings, to five musics.

    Where the dance is told its pattern is learnt on other recordings of it, on figures that the judged one does not
    hold; where every other recording shares a figure, on all of them ("shared figures").

    Parameters
    ----------
    recordings : of one corpus, each with motion and annotated beats
    beats : "annotated" or "tracked"
    is_told : bool, whether the dance is told
    seed : int, of the choice of other music

    Returns
    -------
    DataFrame, a row for each recording and music: recording, dance, music, beats, "told", "shared figures", and the
    columns of `judged_columns`. No row for another dance's music where all recordings are of one dance, and none for
    the same dance's where there is one recording of it.
    """
    rng = np.random.default_rng(seed)
    clips = [cut_clips(recording, "annotated", None) for recording in recordings]
    tracks = [recording_beats(recording, beats) for recording in recordings]
    rows = []
    for number, (recording, parts) in enumerate(zip(recordings, clips, strict=True)):
        pattern, shared = (None, False)
        if is_told:
            rest = [clip for others in clips if others is not parts for clip in others]
            pattern, shared = _pattern_of_others(parts, rest)
        about = {"recording": recording.clip.name, "dance": recording.clip.dance, "beats": beats, "told": is_told}
        shape = shape_speed(_motion(recording))
        for music, track in _musics(recordings, tracks, number, rng).items():
            verdict = judge(shape, track, pattern=pattern)
            rows.append({**about, "shared figures": shared, "music": music, **judged_columns(verdict)})
    return pd.DataFrame(rows)


def level_settings(recordings: Sequence[Recording], *, seed: int = 0) -> pd.DataFrame:
    """`level_table` with tracked and with annotated beats, with nothing told and with the dance told."""
    tables = [level_table(recordings, beats=beats, is_told=is_told, seed=seed) for beats, is_told in SETTINGS]
    return pd.concat(tables, ignore_index=True)


def level_counts(table: pd.DataFrame) -> pd.DataFrame:
    """A table of `level_settings` as counts: a row a setting, a column a music; cells by level, 0 to 4."""

    def counts(levels: pd.Series) -> str:
        return " ".join(map(str, np.bincount(levels, minlength=len(LEVELS))))

    return table.groupby(["beats", "told", "music"], sort=False)["level"].agg(counts).unstack().fillna("")


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
    recordings: Sequence[Recording], tracks: Sequence[BeatTrack], number: int, rng: np.random.Generator
) -> dict[str, BeatTrack]:
    """Beats of each music on the time line of the motion of a recording, by its number."""
    clip, track = recordings[number].clip, tracks[number]
    start, seconds = clip.offset, _motion(recordings[number]).duration
    musics = {OWN: track.span(start, seconds)}
    musics |= {name: track.span(start - lag * 60 / track.tempo, seconds) for name, lag in LAGS.items()}
    for name, is_same in ((SAME, True), (OTHER, False)):
        others = [
            other for at, (item, other) in enumerate(zip(recordings, tracks, strict=True))
            if at != number and (item.clip.dance == clip.dance) is is_same
        ]  # fmt: skip
        if others:
            other = others[rng.integers(len(others))]
            musics[name] = other.span(rng.uniform(0.0, max(other.duration - seconds, 0.0)), seconds)
    return musics
