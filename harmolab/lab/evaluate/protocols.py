"""Protocols: the measures, music beats and conventions of published evaluation codes, faults included.

They make a number that can stand beside one that a paper printed. The measures are written from their definitions and
count frames, whatever the frame rate. The music beats are librosa's, on the frames of the motion. `harmolab.metrics`
has the same measures in seconds and without the faults. Published codes compute partly in single precision; here all is
double.
"""

import hashlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from harmolab.beats.audio import CACHE_VERSION, HOP, librosa_beats
from harmolab.body.skeletons import Skeleton, joint_part, joint_side, named_joints, skeleton_part
from harmolab.files import Arrays, cached_once
from harmolab.lab.evaluate.pairing import input_stamp
from harmolab.metrics.beat_alignment import beat_align
from harmolab.metrics.features import diversity, frechet_distance, geometric_features, kinetic_features, point_joints
from harmolab.readers.aist import AIST_FPS
from harmolab.readers.audio import load_sound
from harmolab.readers.keypoints import COCO_17
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion
from harmolab.verdict.judge import music_and_motion

# Measures of published codes, in frames

SIGMA_FRAMES = 3.0  # of the kernel of both beat scores
MINIMUM_FRAMES = 10  # aist++: a beat is slower than so many frames on either side
SMOOTHING_FRAMES = 5.0  # bailando
FEATURE_FRAMES = 1200  # bailando: 20 s at 60 frames per second
PFC_SCALE = 1e4  # edge
LEAST_SPREAD = 1e-10  # added to the reference's SD

SMPL_POINTS = (
    *("root", "lhip", "rhip", "belly", "lknee", "rknee", "spine", "lankle", "rankle", "chest", "ltoes", "rtoes"),
    *("neck", "lcollar", "rcollar", "head", "lshoulder", "rshoulder", "lelbow", "relbow"),
    *("lwrist", "rwrist", "lhand", "rhand"),
)
_LEGS = ("root", "lankle", "ltoes", "rankle", "rtoes")
# Words for the six joints of SMPL that geometric features do not ask for: (side, part), the clearest first.
_COLLAR = ("collar", "inshoulder", "clavicle", "shoulder")
_OTHER_POINTS: Mapping[str, Sequence[tuple[str, str]]] = {
    "spine": [("", part) for part in ("spine2", "spine", "spine1")],
    "lcollar": [("left", part) for part in _COLLAR],
    "rcollar": [("right", part) for part in _COLLAR],
    "head": [("", "head")],
    "lhand": [("left", "hand")],
    "rhand": [("right", "hand")],
}
_FEATURES: Mapping[str, Callable[..., FloatArray]] = {"kinetic": kinetic_features, "geometric": geometric_features}


def smpl_joints(skeleton: Skeleton, points: Sequence[str] = SMPL_POINTS) -> list[int]:
    """Numbers of SMPL's joints in its order, by their names; ValueError that names those that are missing.

    >>> smpl_joints(Skeleton(("left_foot", "left_ankle", "pelvis"), (1, 2, -1)), ("root", "lankle", "ltoes"))
    [2, 1, 0]
    """
    joints, named = point_joints(skeleton), named_joints(skeleton)
    for point, words in _OTHER_POINTS.items():
        # AIST++ calls the third joint of the spine so, BVH files the first: what is taken is not taken again.
        free = [named[word] for word in words if word in named and named[word] not in joints.values()]
        joints.update({point: free[0]} if free else {})
    missing = [point for point in points if point not in joints]
    if missing:
        raise ValueError(f"the published code takes SMPL's joints; none is called {', '.join(missing)}, or alike")
    return [joints[point] for point in points]


def coco_joints(skeleton: Skeleton) -> list[int]:
    """Numbers of COCO's 17 joints in its order, by their names; empty where one is missing."""
    named = named_joints(skeleton)
    joints = [named.get((joint_side(name), joint_part(name)), -1) for name in COCO_17.joints]
    return [] if -1 in joints else joints


def beat_align_frames(motion: Motion, music: BeatTrack) -> float:
    """BeatAlign of the AIST++ authors: mean over motion beats of exp(-d^2 / 18), d frames to the nearest music beat.

    Motion beats are frames in which the summed speed of the joints is below that of ten frames on either side.

    Parameters
    ----------
    motion : Motion, three-dimensional, of SMPL's 24 or COCO's 17 joints
    music : BeatTrack on its time line

    Returns
    -------
    float in [0, 1]; 0 without motion beats, else NaN without music beats, where the published code stops

    Raises
    ------
    ValueError
        If joints are missing or the motion is two-dimensional.
    """
    joints = coco_joints(motion.skeleton) or smpl_joints(motion.skeleton)
    # Speed 0 in the first frame, as published: no beat can lie in the ten frames after it.
    speed = np.append(0.0, _frame_speeds(motion, joints).sum(axis=1))
    beats = scipy.signal.argrelextrema(speed, np.less, order=MINIMUM_FRAMES)[0].astype(np.float64)
    music_beats = beat_frames(music, motion.fps, motion.n_frames)
    if not beats.size:
        return 0.0
    return beat_align(beats, music_beats, sigma=SIGMA_FRAMES) if music_beats.size else float("nan")


def bas_frames(motion: Motion, music: BeatTrack) -> float:
    """Beat align score of Bailando: mean over music beats of exp(-d^2 / 18), d frames to the nearest motion beat.

    Motion beats are all minima of the mean speed of the joints, smoothed by a Gaussian of five frames. A speed belongs
    to the earlier of its two frames, so a beat is a frame earlier than in `beat_align_frames`.

    Parameters
    ----------
    motion : Motion, three-dimensional, of SMPL's 24 joints
    music : BeatTrack on its time line

    Returns
    -------
    float in [0, 1]; NaN without beats on either side, where the published code stops

    Raises
    ------
    ValueError
        As `beat_align_frames`.
    """
    speed = _frame_speeds(motion, smpl_joints(motion.skeleton)).mean(axis=1)
    smooth = scipy.ndimage.gaussian_filter1d(speed, SMOOTHING_FRAMES)
    beats = scipy.signal.argrelextrema(smooth, np.less)[0].astype(np.float64)
    music_beats = beat_frames(music, motion.fps, speed.size)
    return beat_align(music_beats, beats, sigma=SIGMA_FRAMES) if beats.size and music_beats.size else float("nan")


def beat_frames(music: BeatTrack, fps: float, n_frames: int) -> FloatArray:
    """Numbers of the frames nearest to the beats, those beyond the last of `n_frames` left out."""
    frames = np.unique(np.rint(music.times * fps))
    return frames[frames < n_frames]


def _frame_speeds(motion: Motion, joints: Sequence[int]) -> FloatArray:
    """Metres that each joint goes from frame to frame, (T - 1, len(joints))."""
    return np.linalg.norm(np.diff(_in_space(motion).positions[:, joints], axis=0), axis=2)


def _in_space(motion: Motion) -> Motion:
    if motion.positions.shape[2] != 3:
        raise ValueError("a three-dimensional motion is needed: metres, y up")
    return motion


def pfc_frames(motion: Motion) -> float:
    """Physical foot contact score of EDGE, square metres per square frame times 10^4.

    The mean over frames of (slower of left ankle and toes) * (slower of the right ones) * (acceleration of the root) /
    (its largest in the clip). Foot speeds are horizontal, in metres a frame; of the root's vertical acceleration only
    the upward part counts. EDGE's z is our y.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up, with root, ankles and toes

    Returns
    -------
    float; NaN where the root does not accelerate, as 0 / 0 in the published code

    Raises
    ------
    ValueError
        As `beat_align_frames`, or if there are fewer than three frames.
    """
    positions = _in_space(motion).positions[:, smpl_joints(motion.skeleton, _LEGS)]
    if len(positions) < 3:
        raise ValueError(f"an acceleration needs three frames, the motion has {len(positions)}")
    push = np.diff(positions[:, 0], n=2, axis=0)  # the time step of 1/30 s cancels in the ratio below
    push[:, 1] = np.maximum(push[:, 1], 0.0)
    strength = np.linalg.norm(push, axis=1)
    if not strength.any():
        return float("nan")
    slide = np.linalg.norm(np.diff(positions[1:, 1:, [0, 2]], axis=0), axis=2)
    slowest = slide[:, :2].min(axis=1) * slide[:, 2:].min(axis=1)
    return float((slowest * strength).mean() / strength.max() * PFC_SCALE)


def smpl_features(motion: Motion) -> dict[str, FloatArray]:
    """ "kinetic" (72,) and "geometric" (32,) features of SMPL's joints, the frames taken for sixtieths of a second.

    Those of ``form="aist++"`` in `kinetic_features` and `geometric_features`, which list the faults. Frames that are
    not valid count like any others.

    Raises
    ------
    ValueError
        As `beat_align_frames`, or if there are fewer than three frames.
    """
    joints = smpl_joints(motion.skeleton)
    body = Motion(motion.positions[:, joints], AIST_FPS, skeleton_part(motion.skeleton, joints))
    return {name: features(body, form="aist++") for name, features in _FEATURES.items()}


def smpl_features_from_start(motion: Motion) -> dict[str, FloatArray]:
    """`smpl_features` of Bailando: of the first 1,200 frames, seen from the place of the root in the first of them."""
    start = _in_space(motion).positions[0, smpl_joints(motion.skeleton, ("root",))]
    return smpl_features(Motion(motion.positions[:FEATURE_FRAMES] - start, motion.fps, motion.skeleton))


def set_scores(features: Mapping[str, ArrayLike], reference: Mapping[str, ArrayLike]) -> dict[str, float]:
    """FID_k, FID_g, Div_k and Div_g of sets of features, as AIST++ and Bailando have them.

    Each feature less the reference's mean, divided by its SD + 1e-10; then the Frechet distance, the bias of small
    samples not taken off, and the mean distance between two rows of `features`.

    Parameters
    ----------
    features, reference : "kinetic" -> (n, 72) array and "geometric" -> (n, 32) array

    Returns
    -------
    dict; NaN where a set has fewer than two rows

    Raises
    ------
    ValueError
        If arrays of two rows or more are not two-dimensional, differ in their columns, or hold NaN or infinity.
    """
    scores: dict[str, float] = {}
    for name in _FEATURES:
        values, model = (np.asarray(side[name], dtype=np.float64) for side in (features, reference))
        scores |= dict(zip((f"FID_{name[0]}", f"Div_{name[0]}"), _distance_and_diversity(values, model), strict=True))
    return scores


def _distance_and_diversity(values: FloatArray, model: FloatArray) -> tuple[float, float]:
    if len(values) < 2 or len(model) < 2:
        return float("nan"), float("nan")
    mean, spread = model.mean(axis=0), model.std(axis=0) + LEAST_SPREAD
    values, model = (values - mean) / spread, (model - mean) / spread
    return frechet_distance(values, model, correct_bias=False).raw, diversity(values)


# Music beats of published codes, on the frames of the motion

MusicBeats = Callable[[Audio, str], BeatTrack]  # sound of `HOP` samples a frame, name of the song -> its beats

FRAME_RATES = (10.0, 250.0)  # hertz, of motions on the frames of which beats are tracked
MOST_FRAMES = 54_000  # of a song: 15 minutes at 60 a second take 5 GB, which Bailando's way of tracking holds at once
TRACKS_KEPT = 2  # songs of which a process holds the beats, as dances to one song come in a row
OTHER_TEMPO = 120.0  # beats per minute, librosa's own, for songs that are not of AIST
_TRACK = ("times", "strengths", "fps", "duration")  # what is kept of published beats
_AIST_SONG = re.compile(r"(?:^|_)m(BR|PO|LO|MH|LH|WA|KR|JS|JB|HO)(\d)(?=_|$)")


def aist_tempo(song: str) -> float:
    """Tempo of a song of AIST by its name, beats per minute; that of `OTHER_TEMPO` for any other.

    >>> aist_tempo("mBR2"), aist_tempo("gHO_sBM_cAll_d19_mHO3_ch01"), aist_tempo("waltz")
    (100.0, 125.0, 120.0)
    """
    name = _AIST_SONG.search(song)
    if name is None:
        return OTHER_TEMPO
    return 110.0 + 5 * int(name[2]) if name[1] == "HO" else 80.0 + 10 * int(name[2])


def aist_beats(audio: Audio, song: str) -> BeatTrack:
    """Music beats of mint's `tools/preprocessing.py`: mean onset strength, the tempo in the song's name as a prior."""
    return librosa_beats(audio, start_tempo=aist_tempo(song))


def bailando_beats(audio: Audio, song: str) -> BeatTrack:
    """Music beats of Bailando's `extractor.py`: median onset strength of the percussive part, prior of 120 a minute."""
    return librosa_beats(audio, percussive=True)


def published_music_and_motion(
    clip: Clip, music: Path, song: str, music_beats: MusicBeats | None
) -> tuple[BeatTrack, Motion]:
    """As `music_and_motion`, with beats that a published code tracks in the file of the song.

    Parameters
    ----------
    clip : Clip with a motion
    music : Path of its song
    song : str, name of the song
    music_beats : function of the published code; the clip's own beats without one

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_sound` and `music_and_motion`; also for a frame rate beyond `FRAME_RATES`, and a song of more than
        `MOST_FRAMES`.
    """
    if clip.motion is None or music_beats is None:
        return music_and_motion(clip)
    fps, (low, high) = clip.motion.fps, FRAME_RATES
    if not low <= fps <= high:
        raise ValueError(
            f"the published code tracks beats on the motion's frames, {low:g} to {high:g} a second: {fps:g}"
        )
    if (frames := round(clip.audio.duration * fps)) > MOST_FRAMES:
        raise ValueError(f"{music} has {frames} frames, more than the {MOST_FRAMES} that are tracked at once; cut it")
    return music_and_motion(replace(clip, beats=_song_beats(music, input_stamp(music), song, fps, music_beats)))


@lru_cache(maxsize=TRACKS_KEPT)
def _song_beats(music: Path, stamp: str, song: str, fps: float, music_beats: MusicBeats) -> BeatTrack:
    """The beats of a song, from the cache where they were tracked before, in whichever process: see `cached_once`.

    `stamp` changes with the file.
    """
    about = f"{CACHE_VERSION} {music.resolve()} {stamp} {song} {fps} {music_beats.__qualname__}"

    def tracked() -> Arrays:
        track = music_beats(load_sound(music, sample_rate=HOP * fps), song)
        return {name: np.asarray(getattr(track, name)) for name in _TRACK}

    arrays = cached_once(hashlib.sha256(about.encode()).hexdigest()[:40], _TRACK, tracked)
    times, strengths, rate, duration = (arrays[name] for name in _TRACK)
    return BeatTrack(times, strengths, float(rate), float(duration))


# Protocols by name


def _beat_align(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"BeatAlign": beat_align_frames(motion, music)}


def _bas(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"BAS": bas_frames(motion, music)}


def _pfc(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"PFC": pfc_frames(motion)}


def _nothing(*_: object) -> dict[str, Any]:
    return {}


SAME_RATE = 1e-3  # relative; a rate nearer to the published one than this is the published one


@dataclass(frozen=True)
class Protocol:
    """The way in which a published code evaluates dances: one of `PROTOCOLS` ("aist++", "edge" and "bailando").

    Parameters
    ----------
    source : str
        The paper and its code.
    fps : float, frames per second
        The rate that its numbers of frames are meant for. Motions of other rates are not resampled, as the code does
        not do it; `remarks` says so.
    notes : tuple of str
        Conventions and known faults, a sentence each.
    missing : str
        A sentence on numbers that the paper prints and that cannot be reproduced; "" where there are none.
    clip : function (Motion, BeatTrack on its time line) -> dict
        Numbers of one dance by name.
    music_beats : function (Audio, name of the song) -> BeatTrack, or None
        Beats of the music, of sound with 512 samples for each frame of the motion. None where the code takes none.
    features : function Motion -> dict
        "kinetic" and "geometric" -> array of one dance: all that `sets` needs of it.
    sets : function (features, reference) -> dict
        FID_k, FID_g, Div_k and Div_g of arrays with a row for each dance.

    Notes
    -----
    `clip` and `features` raise ValueError, which names the joints, where a skeleton lacks some that the published code
    takes. Dicts are empty where the code has no such measure.

    Examples
    --------
    >>> PROTOCOLS["edge"].fps
    30.0
    """

    source: str
    fps: float
    notes: tuple[str, ...]
    clip: Callable[[Motion, BeatTrack], dict[str, float]]
    music_beats: MusicBeats | None = None
    features: Callable[[Motion], dict[str, FloatArray]] = _nothing
    sets: Callable[[Mapping[str, ArrayLike], Mapping[str, ArrayLike]], dict[str, float]] = _nothing
    missing: str = ""

    def remarks(self, motion: Motion, scores: Mapping[str, float]) -> tuple[str, ...]:
        """Sentences on one dance: another frame rate, other joints, filler frames, numbers that are NaN.

        Parameters
        ----------
        motion : Motion
        scores : dict of `clip` of it
        """
        lines = {
            f"The motion has {motion.fps:g} frames per second, the published constants are for {self.fps:g}; "
            "frames were taken as they are.": not math.isclose(motion.fps, self.fps, rel_tol=SAME_RATE),
            "The 17 joints of COCO were taken, where published scores are of SMPL's 24.": (
                "BeatAlign" in scores and bool(coco_joints(motion.skeleton))
            ),
            "Frames that are not valid were taken for motion; the published code knows none.": not motion.valid.all(),
        }
        nan = [f"{name} is NaN: {_UNDEFINED[name]}" for name, value in scores.items() if math.isnan(value)]
        return (*(line for line, holds in lines.items() if holds), *nan)


_UNDEFINED: Mapping[str, str] = {
    "BeatAlign": "there are no music beats, where the published code stops with an error.",
    "BAS": "there are no beats of the music or of the motion, where the published code stops with an error.",
    "PFC": "the root does not accelerate; the published code divides 0 by 0, and its mean over all dances is NaN.",
}
_FRAMES = "Frames are counted, not seconds, so the score depends on the frame rate."
_MEANS = "Means are over dances, as published, however many there are to a song."
# 1 where more is better, -1 where less is. Diversity has neither: papers wish for more, which flailing has.
BETTER: Mapping[str, int] = MappingProxyType({"BeatAlign": 1, "BAS": 1, "PFC": -1, "FID_k": -1, "FID_g": -1})
_TRACKING = (
    "Music beats are librosa's as they come, tracked in the whole song with a frame of 512 samples for each of the "
    "motion ({strength}; prior of the tempo: {prior}), and not those of this table, be these annotated or tracked."
)
_OF_SETS = (
    "Kinetic features (72) take frames for sixtieths of a second and misplace a bracket: a third of them measure the "
    "place of a joint, 3540 times its metres, where an acceleration is meant.",
    "Geometric features (32) divide by 1/120 s, so speeds are doubled; some velocities and planes are of the wrong "
    "points or sides; thresholds are lengths of SMPL's mean body; the lowest joint is the floor.",
    "Features are standardised by mean and SD + 1e-10 of the reference, so one in which the whole reference agrees "
    "outweighs all others where a dance differs in it.",
    "FID_k and FID_g are not corrected for small samples: the fewer dances, the larger they are.",
    "Div_k and Div_g are mean distances between dances, of features standardised by the reference.",
    "Published tables take all motions of AIST++ for the reference, training included; here it is the one of the "
    "table. Fewer than two dances on a side give NaN.",
    "The recorded dances' own line, the ground truth, is of those to the systems' songs against all of them; where "
    "these are the same dances, FID is that between halves of the songs.",
    "Versions differ: FID_g and Div_g in the paper of AIST++ are of earlier geometric features, with one more fault; "
    "copies in which the bracket is mended have other FID_k and Div_k.",
)
PROTOCOLS: Mapping[str, Protocol] = MappingProxyType(
    {
        "aist++": Protocol(
            "Li et al. 2021, google-research/mint with its author's fork, google/aistplusplus_api",
            60.0,
            (
                "BeatAlign is the mean over motion beats of exp(-d^2 / 18), d frames to the nearest music beat: music "
                "beats without a motion beat cost nothing.",
                "Motion beats are frames whose summed joint speed is below that of ten frames on either side, "
                "unsmoothed; the first frame has speed 0, so none lies in the ten after it.",
                "A dance without motion beats scores 0; without music beats the published code stops, here NaN.",
                "Music beats after the end of a dance do not count; the published script counts them for generated "
                "dances, and not for recorded ones.",
                _FRAMES,
                _MEANS,
                _TRACKING.format(
                    strength="mean onset strength",
                    prior="that in the name of a song of AIST, 120 beats a minute for others, where the code stops",
                ),
                *_OF_SETS,
                "Features depend on where in the room a dancer is, by the bracket.",
                "The published script leaves out the first 120 frames, which FACT is given; --seed-frames 120 does so "
                "here, before beats are taken, so that none lies in the ten frames behind them.",
            ),
            *(_beat_align, aist_beats, smpl_features, set_scores),
        ),
        "edge": Protocol(
            "Tseng et al. 2023, Stanford-TML/EDGE",
            30.0,
            (
                "PFC is the mean over frames of (slower of left ankle and toes) x (slower of the right ones) x "
                "(acceleration of the root, downward part left out) / (its largest in the clip), times 10^4.",
                "Foot speeds are horizontal metres a frame, not divided by the time step: at another frame rate the "
                "same dance has another score.",
                "The largest acceleration is that of each clip: one jump of the root makes the rest of a dance good.",
                "A root that does not accelerate gives 0 / 0, which makes the published mean NaN; here only the clip.",
                "PFC takes no music beats: it is the same with any song.",
                _MEANS,
                "The code takes z for up; motions here have y up, and axes are taken accordingly.",
                "The code stops where there are more than 1,000 dances (it draws 1,000 without importing `random`); "
                "here all count.",
            ),
            _pfc,
            missing="Its paper also prints beat alignment and diversity (Dist_k, Dist_g); no code for them is public "
            "(issues 11, 27 and 46), so they cannot be reproduced and are not here.",
        ),
        "bailando": Protocol(
            "Li Siyao et al. 2022, lisiyao21/Bailando",
            60.0,
            (
                "BAS is the mean over music beats of exp(-d^2 / 18), d frames to the nearest motion beat: the other "
                "way round than BeatAlign, so a dance that comes to rest all the time scores high.",
                "Motion beats are all minima, however shallow, of the mean joint speed smoothed by a Gaussian of five "
                "frames; speeds lie on the earlier of two frames, so a beat is one frame earlier than in aist++.",
                "Without beats of music or motion, as in a frozen clip, the published code stops; here NaN.",
                _FRAMES,
                _MEANS,
                _TRACKING.format(strength="median onset strength of the percussive part", prior="120 beats a minute"),
                *_OF_SETS,
                "Features are of the first 1,200 frames, seen from where the root starts: by the bracket they measure "
                "how far a dancer goes from there.",
            ),
            *(_bas, bailando_beats, smpl_features_from_start, set_scores),
        ),
    }
)


def protocol_of(name: str) -> Protocol:
    """A protocol of `PROTOCOLS` by its name.

    Raises
    ------
    ValueError
        There is no such protocol; names those that there are.
    """
    if name not in PROTOCOLS:
        raise ValueError(f"no protocol is called {name!r}; there are: {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]
