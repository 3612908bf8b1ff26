"""Dances much longer than a unit: lengths of bones, jumps and sliding feet (notebook 08).

Each test song is danced meter by meter, every meter from the end of the last, so that what one meter gets wrong the
next has to live with. What is allowed is measured on the dancers who were recorded to the same songs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.kinematics import in_body
from harmolab.data.recordings import Recording, load_recording, recording_beats
from harmolab.metrics.likeness import likeness
from harmolab.metrics.quality import bone_error, foot_skating, jerk, largest_step
from harmolab.params import HarmonyParams
from harmolab.systems.training.dancing import synthesize_dance
from harmolab.systems.training.runs import MODEL, load_poses
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.generation import VARIANTS, Trained, corpus_root, generator_corpora, trained
from study.experiments.guard import statue
from study.profile import RunProfile

SONGS = 8  # of the test split, spread over it
SECONDS = 30.0
QUICK_SECONDS = 10.0

# The most that a dance may have, and what the number is.
LIMITS = MappingProxyType(
    {
        "bones": (0.05, "largest deviation of a bone's length"),
        "jump": (3.0, "fastest step / 99.9th percentile recorded"),
        "skating": (2.0, "sliding of standing feet / recorded"),
    }
)


@dataclass(frozen=True, eq=False)
class DancedSong:
    """A test song with the dancer who was recorded to it and a generated one; all begin together.

    Parameters
    ----------
    name : str, of the song's folder
    audio : Audio
    beats : BeatTrack of the music
    recorded, generated : Motion
    """

    name: str
    audio: Audio
    beats: BeatTrack
    recorded: Motion
    generated: Motion


def danced_song(profile: RunProfile, corpus: str, variant: str, place: int = 0) -> DancedSong:
    """The `place`-th song of `long_dances`, as recorded and as the variant's generator of the first seed dances it.

    Raises
    ------
    ValueError
        If there is no such song.
    """
    run = trained(profile, corpus, VARIANTS[variant], 1)
    names = _songs(run)
    if not 0 <= place < len(names):
        raise ValueError(f"place must be 0 to {len(names) - 1}, the test songs of {corpus}, got {place}")
    song = load_recording(corpus_root(profile, corpus) / names[place])
    dance, beats = _danced(run, song, _seconds(profile))
    audio = song.clip.audio.span(song.clip.offset, dance.duration)
    return DancedSong(names[place], audio, beats, _dancer(song).span(0.0, dance.duration), dance)


def long_dances(profile: RunProfile) -> pd.DataFrame:
    """Dances of every variant to songs of the test units, 30 s each (10 s in the quick profile) or all of the music.

    Returns
    -------
    DataFrame, a row for each corpus, seed, variant and song: corpus, seed, variant, song, dance, seconds; bones, jump
    and skating as in `LIMITS`; jerk in multiples of the recorded dancers' mean; above_chance and count_ratio for
    valleys within 0.1 s, body_above_chance of the body alone, statue_above_chance of the mean pose on the same path;
    guard, 1 if the dance moves like recorded dancers and 0 if not (`harmolab.metrics.likeness`), and fails, by what
    """
    rows, seconds = [], _seconds(profile)
    for corpus in generator_corpora(profile):
        for seed in range(1, profile.n_seeds + 1):
            runs = {name: trained(profile, corpus, variant, seed) for name, variant in VARIANTS.items()}
            songs = [load_recording(corpus_root(profile, corpus) / name) for name in _songs(runs["paper"])]
            recorded = _recorded(songs, seconds)
            for song, (name, run) in product(songs, runs.items()):
                about = {"corpus": corpus, "seed": seed, "variant": name}
                rows.append({**about, **_measured(run, song, recorded, seconds)})
    return pd.DataFrame(rows)


def _seconds(profile: RunProfile) -> float:
    return QUICK_SECONDS if profile.epochs else SECONDS


def _songs(run: Trained) -> list[str]:
    """Folder names of up to `SONGS` sequences with test units, spread over the test split."""
    names = list(dict.fromkeys(unit.sequence.rpartition("/")[2] for unit in run.split.test.units))
    count = min(SONGS, len(names))
    return [names[place * len(names) // count] for place in range(count)]


def _recorded(songs: list[Recording], seconds: float) -> dict[str, float]:
    """Means over songs of measures of the recorded dancers: peak speed (m/s), skating (m/s), jerk (m/s^3)."""
    motions = [_dancer(song).span(0.0, seconds) for song in songs]
    measures = {"peak": lambda motion: largest_step(motion).percentile_999, "skating": foot_skating, "jerk": jerk}
    return {name: float(np.mean([measure(motion) for motion in motions])) for name, measure in measures.items()}


def _dancer(song: Recording) -> Motion:
    if song.clip.motion is None:
        raise ValueError(f"{song.folder}: has no motion")
    return song.clip.motion


def _measured(run: Trained, song: Recording, recorded: dict[str, float], seconds: float) -> dict[str, Any]:
    """One long dance, in multiples of what is `recorded`."""
    dance, beats = _danced(run, song, seconds)
    moved = {"": dance, "body_": in_body(dance), "statue_": statue(dance)}
    scores = {
        name: score_motion(beats, each, params=HarmonyParams.valleys(), n_rotations=0) for name, each in moved.items()
    }
    judged = likeness(dance, dance=song.clip.dance)
    return {
        "song": song.folder.name,
        "dance": song.clip.dance,
        "seconds": dance.duration,
        "bones": bone_error(dance, run.generator.bone_lengths.double().numpy()),
        "jump": largest_step(dance).largest / recorded["peak"],
        "skating": foot_skating(dance) / recorded["skating"],
        "jerk": jerk(dance) / recorded["jerk"],
        **{f"{name}above_chance": score.harmony_above_chance for name, score in scores.items()},
        "count_ratio": scores[""].n_visual / max(scores[""].n_audio, 1),
        "guard": np.nan if judged.passed is None else float(judged.passed),
        "fails": ", ".join(judged.fails),
    }


def _danced(run: Trained, song: Recording, seconds: float) -> tuple[Motion, BeatTrack]:
    """A generated dance, `seconds` long unless the recorded one is shorter, and the music's beats on its time line."""
    clip, beats = song.clip, recording_beats(song, "annotated" if song.annotation is not None else "tracked")
    dance = _generated(run, clip, beats, min(seconds, _dancer(song).duration))
    return dance, beats.span(clip.offset, dance.duration)


def _generated(run: Trained, clip: Clip, beats: BeatTrack, seconds: float) -> Motion:
    """A dance to a clip's music from its offset on: the only place that knows how a system is asked for one."""
    poses, start = load_poses(run.folder / MODEL), clip.offset
    return synthesize_dance(
        run.generator, clip.audio, beats=beats, start=start, seconds=seconds, seed=1, poses=poses, dance=clip.dance
    )


def dance_limits(dances: pd.DataFrame) -> pd.DataFrame:
    """The share of the dances that keep within `LIMITS`.

    Parameters
    ----------
    dances : DataFrame, as `long_dances` returns it

    Returns
    -------
    DataFrame with the columns corpus, variant, limit (in words), most (allowed), mean, worst, within ("8 of 8")
    """
    rows = []
    for (corpus, variant), part in dances.groupby(["corpus", "variant"], sort=False):
        for name, (most, words) in LIMITS.items():
            values = part[name].to_numpy(np.float64)
            row = {"corpus": corpus, "variant": variant, "limit": words, "most": most, "mean": values.mean()}
            rows.append({**row, "worst": values.max(), "within": f"{(values <= most).sum()} of {values.size}"})
    return pd.DataFrame(rows)
