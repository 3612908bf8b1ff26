"""Half a minute of dance to songs that no generator has heard: movement, likeness and harmony side by side.

Harmony of the joint speed in the room can be had by turning alone. So beside the harmony that a body has stands the one
that a statue gets on the same path, and beside both whether the dance moves like recorded dancers at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import pandas as pd

from harmolab.body.kinematics import resample_motion
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.lab.evaluate.measured import rests_on_beat, statue
from harmolab.metrics.features import frechet_distance, kinetic_features, standardise
from harmolab.metrics.likeness import LikenessLimits, likeness
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.training.pose_network import PoseNet, embed_windows
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.generation import VARIANTS, Variant, corpus_root, generator_corpora, trained
from study.experiments.judging import RECORDED
from study.profile import RunProfile

Generate = Callable[[Recording], Motion]

CHOREOGRAPHER = "choreographer"
OWN = ("DANCE_C_4", "DANCE_R_4", "DANCE_T_8", "DANCE_W_3")  # of the beat-locked recordings; else one of each dance
SECONDS, RATE = 30.0, 15.0
WINDOW = 2.0  # seconds that a Frechet distance compares
SEEDS = (1, 2, 3)
SHOWN = ("spread", "hands", "ankles", "crossed", "turns", "nearest", "knees", "jerk", "skating")

_OURS = VARIANTS["recommended"]
BEFORE = replace(
    _OURS, params=replace(_OURS.params, harmony_frame="room", energy_weight=2.0, path_weight=0.0, spread_weight=0.0)
)
GENERATORS: Mapping[str, tuple[Variant, Sequence[int]]] = {
    "recommended": (_OURS, SEEDS),
    "recommended, harmony in the room": (BEFORE, SEEDS[:1]),
    "paper": (VARIANTS["paper"], SEEDS[:1]),
}


@dataclass(frozen=True, eq=False)
class Reference:
    """Windows of recorded movement, as a pose network and kinetics see them: Frechet distances are measured from these.

    Parameters
    ----------
    pose_net : PoseNet
    poses : (N, 32) array, its embeddings of the windows
    kinetic : (N, K) array, kinetic features of the windows
    """

    pose_net: PoseNet
    poses: FloatArray
    kinetic: FloatArray

    @classmethod
    def of(cls, motions: Sequence[Motion], pose_net: PoseNet) -> Self:
        """Reference of recorded motions with the joints of the pose network."""
        return cls(pose_net, embed_windows(motions, pose_net, seconds=WINDOW), _kinetic(motions))

    def distances(self, motions: Sequence[Motion]) -> dict[str, float]:
        """Frechet distances "fid" and "fid_kinetic" of windows of these motions, bias corrected."""
        kinetic, reference = (standardise(each, self.kinetic) for each in (_kinetic(motions), self.kinetic))
        return {
            "fid": frechet_distance(embed_windows(motions, self.pose_net, seconds=WINDOW), self.poses).value,
            "fid_kinetic": frechet_distance(kinetic, reference).value,
        }


def dance_measures(
    motion: Motion, beats: BeatTrack, *, dance: str = "", limits: LikenessLimits | None = None
) -> dict[str, Any]:
    """Measures of a dance and of its harmony with the music: one row of a table.

    Parameters
    ----------
    motion : Motion, at least 10 s
    beats : BeatTrack on the motion's time line
    dance : str
    limits : LikenessLimits that the dance is held against, the shipped ones when left out

    Returns
    -------
    dict of the measures of `SHOWN` (`harmolab.metrics.likeness.MEASURES` has their units; NaN where none), of harmonies
    above chance, and of the guard's answer: "body" for valleys of the speed in the body within 0.1 s, "pattern" for the
    recommended score with the dance's bar pattern, "room" for valleys of the speed in the room, "statue" for the same
    of the mean pose on the same path (NaN each where nothing moves); passed, fails
    """
    judged = likeness(motion, dance=dance, limits=limits)
    return {
        **{name: judged.values.get(name, np.nan) for name in SHOWN},
        "body": rests_on_beat(motion, beats),
        "pattern": _pattern(motion, beats, dance),
        "room": _valleys(motion, beats),
        "statue": _valleys(statue(motion), beats),
        "passed": judged.passed,
        "fails": ", ".join(judged.fails),
    }


def _valleys(motion: Motion, beats: BeatTrack) -> float:
    """Harmony above chance of speed valleys within 0.1 s; NaN without any, of a body that does not move."""
    score = score_motion(beats, motion, params=HarmonyParams.valleys(), n_rotations=0)
    return score.harmony_above_chance if score.n_visual else np.nan


def _pattern(motion: Motion, beats: BeatTrack, dance: str) -> float:
    """Harmony above chance by the recommended score; NaN for a dance without bar pattern, or no movement to judge."""
    if dance not in DANCE_PATTERNS:
        return np.nan
    params = HarmonyParams.recommended(DANCE_PATTERNS[dance])
    return score_motion(beats, motion, params=params, n_rotations=0).harmony_above_chance


def song_rows(
    recordings: Sequence[Recording], dancers: Mapping[str, Generate], reference: Reference | None = None
) -> pd.DataFrame:
    """`dance_measures` of what is danced to the songs of recordings, and of the recorded dancers.

    Parameters
    ----------
    recordings : each with a motion; half a minute from the beginning of the motion is taken
    dancers : name -> function(recording) -> Motion, such as `song_dancer`
    reference : where Frechet distances are measured from; without it there are none

    Returns
    -------
    DataFrame, a row for each motion and song: motion, song, dance, the measures, and the distances of all dances of
    that name together, fid and fid_kinetic
    """
    rows = []
    for name, dancer in {RECORDED: _recorded, **dancers}.items():
        motions = [dancer(recording) for recording in recordings]
        together = reference.distances(motions) if reference else {}
        for recording, motion in zip(recordings, motions, strict=True):
            clip = recording.clip
            measures = dance_measures(motion, _beats(recording).span(clip.offset, motion.duration), dance=clip.dance)
            rows.append({"motion": name, "song": recording.folder.name, "dance": clip.dance, **measures, **together})
    return pd.DataFrame(rows)


def song_means(rows: pd.DataFrame) -> pd.DataFrame:
    """Means over songs of `song_rows`, a row for each motion; "guard" counts the dances that pass ("0 of 4").

    Motions whose names differ in nothing but ", seed N" are one row.
    """
    named = rows.assign(motion=rows["motion"].str.replace(r", seed \d+$", "", regex=True))
    groups = named.groupby("motion", sort=False)
    means = groups.mean(numeric_only=True).drop(columns="passed", errors="ignore")
    passed = groups["passed"].apply(lambda part: f"{sum(each is True for each in part)} of {len(part)}")
    return means.assign(guard=passed).reset_index()


def own_songs(profile: RunProfile) -> pd.DataFrame:
    """`song_rows` of songs that are kept from all training: recorded dancers, choreographer and generators.

    The choreographer puts together beats of the other recordings, and the generators of `GENERATORS` were trained on
    them; the first one's pose network measures the Frechet distances. In the quick profile the generators are those of
    the other tables, which did hear these songs, and the old loss is left out.
    """
    corpus = generator_corpora(profile)[0]
    folders = find_recordings(corpus_root(profile, corpus)).folders
    recordings = {folder.name: load_recording(folder) for folder in folders}
    names = own_names(recordings)
    others = [recording for name, recording in recordings.items() if name not in names]
    runs = {
        f"{name}, seed {seed}": trained(profile, corpus, variant, seed, without=() if profile.epochs else names)
        for name, (variant, seeds) in GENERATORS.items()
        for seed in seeds[: profile.n_seeds]
        if not (profile.epochs and variant is BEFORE)
    }
    dancers = {CHOREOGRAPHER: song_dancer(Choreographer.of(others))}
    dancers |= {name: song_dancer(HarmoGAN.load(run.folder)) for name, run in runs.items()}
    reference = Reference.of([_recorded(each) for each in others], next(iter(runs.values())).pose_net)
    return song_rows([recordings[name] for name in names], dancers, reference)


def song_dancer(system: HarmoGAN | Choreographer, *, seed: int = 1) -> Generate:
    """A function that has a system dance half a minute to a recording's song, from where the dancer begins."""

    def generate(recording: Recording) -> Motion:
        clip, seconds = recording.clip, min(SECONDS, _recorded(recording).duration)
        return system.generate(
            clip.audio, _beats(recording), start=clip.offset, seconds=seconds, seed=seed, dance=clip.dance
        )

    return generate


def own_names(recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """The songs that are kept from training: `OWN` where they are all there, else the first of each dance."""
    if set(OWN) <= set(recordings):
        return OWN
    first: dict[str, str] = {}
    for name, recording in recordings.items():
        first.setdefault(recording.clip.dance, name)
    return tuple(first.values())


def _beats(recording: Recording) -> BeatTrack:
    """The annotated beats of the music; tracked ones where there are none."""
    return recording_beats(recording, "annotated" if recording.annotation is not None else "tracked")


def _recorded(recording: Recording) -> Motion:
    """Half a minute of the recorded dancer at the generators' frame rate."""
    if recording.clip.motion is None:
        raise ValueError(f"{recording.folder}: has no motion")
    return resample_motion(recording.clip.motion.span(0.0, SECONDS), RATE)


def _windows(motion: Motion) -> list[Motion]:
    """The motion cut into pieces of two seconds."""
    return [motion.span(start, WINDOW) for start in np.arange(0.0, motion.duration - WINDOW + 1e-6, WINDOW).tolist()]


def _kinetic(motions: Sequence[Motion]) -> FloatArray:
    """Kinetic features (N, K) of all windows."""
    return np.stack([kinetic_features(window) for motion in motions for window in _windows(motion)])
