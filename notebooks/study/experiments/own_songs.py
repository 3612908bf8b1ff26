"""Dances to whole songs, recorded and generated, as `harmolab.lab.evaluate.measured` takes them (notebooks 08, 09).

Harmony of the joint speed in the room can be had by turning alone. So beside the harmony that a body has stands the one
that a statue gets on the same path, and beside both whether the dance moves like recorded dancers at all.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.body.kinematics import resample_motion
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.lab.evaluate.measured import SOURCES, Dance, measure_dances
from harmolab.metrics.features import frechet_distance, kinetic_features, standardise
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.training.pose_network import PoseNet, embed_windows
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.generation import VARIANTS, corpus_root, generator_corpora, trained
from study.experiments.judging import RECORDED
from study.profile import RunProfile

OWN = ("DANCE_C_4", "DANCE_R_4", "DANCE_T_8", "DANCE_W_3")  # of the beat-locked recordings; else one of each dance
SECONDS, RATE = 30.0, 15.0
WINDOW = 2.0  # seconds that a Frechet distance compares
SHOWN = ("spread", "hands", "ankles", "crossed", "turns", "nearest", "knees", "jerk", "skating")
# Measure of the long table -> column of the table of means.
COLUMNS = {f"likeness_{name}": name for name in SHOWN}
COLUMNS |= {"rests": "body", "pattern": "pattern", "room_rests": "room", "statue_rests": "statue"}
COLUMNS |= {"fid": "fid", "fid_kinetic": "fid_kinetic"}

_OURS = VARIANTS["recommended"]
_ROOM: dict[str, Any] = {"harmony_frame": "room", "energy_weight": 2.0, "path_weight": 0.0, "spread_weight": 0.0}
BEFORE = "recommended, harmony in the room"
# Name of a generator -> its variant, and the number of its trainings.
GENERATORS = {
    "recommended": (_OURS, 3),
    BEFORE: (replace(_OURS, params=replace(_OURS.params, **_ROOM)), 1),
    "paper": (VARIANTS["paper"], 1),
}


def beats_of(song: Recording) -> BeatTrack:
    """The annotated beats of a song; tracked ones where there are none."""
    return recording_beats(song, "annotated" if song.annotation is not None else "tracked")


def recorded_dance(song: Recording, seconds: float) -> Motion:
    """The beginning of a recorded dance; ValueError where nobody was recorded."""
    if song.clip.motion is None:
        raise ValueError(f"{song.folder}: has no motion")
    return song.clip.motion.span(0.0, seconds)


def generated_dance(system: HarmoGAN | Choreographer, song: Recording, seconds: float) -> Motion:
    """What a system dances to a song, from where the recorded dancer begins and for as long at most."""
    clip, seconds = song.clip, recorded_dance(song, seconds).duration
    return system.generate(clip.audio, beats_of(song), start=clip.offset, seconds=seconds, seed=1, dance=clip.dance)


def as_dance(system: str, seed: str | int, song: Recording, motion: Motion) -> Dance:
    """A motion to a song with the beats on its own time line."""
    beats = beats_of(song).span(song.clip.offset, motion.duration)
    return Dance(system, song.folder.name, motion, beats, seed, song.clip.dance)


def own_songs(profile: RunProfile) -> pd.DataFrame:
    """The long table of half a minute to songs that are kept from all training: recorded, choreographer, generators.

    The choreographer puts together beats of the other recordings, and the generators of `GENERATORS` were trained on
    them; the first one's pose network measures the Frechet distances. In the quick profile the generators are those of
    the other tables, which did hear these songs, and the old loss is left out.
    """
    corpus = generator_corpora(profile)[0]
    recordings = {
        folder.name: load_recording(folder) for folder in find_recordings(corpus_root(profile, corpus)).folders
    }
    names = own_names(recordings)
    others = [recording for name, recording in recordings.items() if name not in names]
    runs = {
        (name, seed): trained(profile, corpus, variant, seed, without=() if profile.epochs else names)
        for name, (variant, count) in GENERATORS.items()
        for seed in range(1, min(count, profile.n_seeds) + 1)
        if not (profile.epochs and name == BEFORE)
    }
    systems: dict[tuple[str, int], HarmoGAN | Choreographer] = {("choreographer", 1): Choreographer.of(others)}
    systems |= {key: HarmoGAN.load(run.folder) for key, run in runs.items()}
    own = [recordings[name] for name in names]
    dances = [as_dance(RECORDED, 1, song, _half_a_minute(song)) for song in own]
    for key, system in systems.items():
        dances += [as_dance(*key, song, generated_dance(system, song, SECONDS)) for song in own]
    distances = distances_from([_half_a_minute(song) for song in others], next(iter(runs.values())).pose_net)
    return song_table(dances, distances)


def song_table(dances: Collection[Dance], distances: Mapping[str, Callable[..., float]]) -> pd.DataFrame:
    """The long table of dances with the measures of `COLUMNS` and "likeness"; distances as of `distances_from`."""
    single = [name for name in COLUMNS if name in SOURCES]
    return measure_dances(dances, [*single, "likeness"], others={"pattern": _pattern}, of_sets=distances)


def song_means(table: pd.DataFrame) -> pd.DataFrame:
    """Means of `song_table`, a row a system; "guard" counts the dances that move like recorded dancers ("0 of 4")."""
    wide = table.pivot_table("value", "system", "measure", sort=False, dropna=False)
    judged = table[table["measure"] == "likeness"].groupby("system", sort=False)["value"]
    guard = judged.agg(lambda own: f"{(own == 1).sum()} of {own.size}")
    means = wide.reindex(columns=list(COLUMNS)).rename(columns=COLUMNS)
    return means.assign(guard=guard).rename_axis("motion").rename_axis(columns=None).reset_index()


def own_names(recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """The songs that are kept from training: `OWN` where they are all there, else the first of each dance."""
    dances = pd.Series({name: recording.clip.dance for name, recording in recordings.items()})
    return OWN if set(OWN) <= set(recordings) else tuple(dances.drop_duplicates().index)


def distances_from(recorded: Sequence[Motion], pose_net: PoseNet) -> dict[str, Callable[..., float]]:
    """Functions of dances to their Frechet distances from windows of recorded motions, the bias taken off.

    "fid" sees poses by a pose network with the joints of all, "fid_kinetic" how fast each joint moves.
    """
    poses, speeds = embed_windows(recorded, pose_net, seconds=WINDOW), _kinetic(recorded)

    def fid(dances: Sequence[Dance], _: object) -> float:
        return frechet_distance(embed_windows([one.motion for one in dances], pose_net, seconds=WINDOW), poses).value

    def fid_kinetic(dances: Sequence[Dance], _: object) -> float:
        own = _kinetic([one.motion for one in dances])
        return frechet_distance(standardise(own, speeds), standardise(speeds, speeds)).value

    return {"fid": fid, "fid_kinetic": fid_kinetic}


def _half_a_minute(song: Recording) -> Motion:
    """Half a minute of the recorded dancer at the generators' frame rate."""
    return resample_motion(recorded_dance(song, SECONDS), RATE)


def _pattern(dance: Dance) -> float:
    """Harmony above chance by the recommended score; NaN for a dance without bar pattern, or no movement to judge."""
    if dance.dance not in DANCE_PATTERNS:
        return np.nan
    params = HarmonyParams.recommended(DANCE_PATTERNS[dance.dance])
    return score_motion(dance.music, dance.motion, params=params, n_rotations=0).harmony_above_chance


def _kinetic(motions: Sequence[Motion]) -> FloatArray:
    """Kinetic features (N, K) of all whole windows of motions."""
    starts = [np.arange(0.0, motion.duration - WINDOW + 1e-6, WINDOW) for motion in motions]
    pairs = zip(motions, starts, strict=True)
    return np.stack([kinetic_features(motion.span(start, WINDOW)) for motion, own in pairs for start in own.tolist()])
