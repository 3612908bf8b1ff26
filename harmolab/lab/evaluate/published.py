"""Measures as published codes compute them, their faults included: in frames, whatever the frame rate.

Written from the definitions, to put a number beside one that a paper printed. `harmolab.metrics` has the same measures
in seconds and without the faults. Published codes compute partly in single precision; all here is double.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d
from scipy.signal import argrelextrema

from harmolab.io.layouts import COCO_17
from harmolab.metrics.beats import beat_align
from harmolab.metrics.body_points import point_joints
from harmolab.metrics.frechet import diversity, frechet_distance
from harmolab.metrics.geometric import geometric_features
from harmolab.metrics.kinetic import AIST_FPS, kinetic_features
from harmolab.skeletons import joint_part, joint_side, named_joints, skeleton_part
from harmolab.types import BeatTrack, FloatArray, Motion, Skeleton

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
_OTHER_POINTS = MappingProxyType(
    {
        "spine": [("", part) for part in ("spine2", "spine", "spine1")],
        "lcollar": [("left", part) for part in _COLLAR],
        "rcollar": [("right", part) for part in _COLLAR],
        "head": [("", "head")],
        "lhand": [("left", "hand")],
        "rhand": [("right", "hand")],
    }
)
_SETS = (("k", "kinetic"), ("g", "geometric"))
_FEATURES: Mapping[str, Callable[..., FloatArray]] = MappingProxyType(
    {"kinetic": kinetic_features, "geometric": geometric_features}
)


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
    beats = argrelextrema(speed, np.less, order=MINIMUM_FRAMES)[0].astype(np.float64)
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
    beats = argrelextrema(gaussian_filter1d(speed, SMOOTHING_FRAMES), np.less)[0].astype(np.float64)
    music_beats = beat_frames(music, motion.fps, speed.size)
    return beat_align(music_beats, beats, sigma=SIGMA_FRAMES) if beats.size and music_beats.size else float("nan")


def beat_frames(music: BeatTrack, fps: float, n_frames: int) -> FloatArray:
    """Numbers of the frames nearest to the beats, those beyond the last of `n_frames` left out."""
    frames = np.unique(np.rint(music.times * fps))
    return frames[frames < n_frames]


def _frame_speeds(motion: Motion, joints: Sequence[int]) -> FloatArray:
    """Metres that each joint goes from frame to frame, (T - 1, len(joints))."""
    positions = _in_space(motion).positions
    return np.linalg.norm(np.diff(positions[:, joints], axis=0), axis=2)


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
    scores = {}
    for letter, name in _SETS:
        values, model = (np.asarray(side[name], dtype=np.float64) for side in (features, reference))
        scores[f"FID_{letter}"], scores[f"Div_{letter}"] = _distance_and_diversity(values, model)
    return scores


def _distance_and_diversity(values: FloatArray, model: FloatArray) -> tuple[float, float]:
    if len(values) < 2 or len(model) < 2:
        return float("nan"), float("nan")
    mean, spread = model.mean(axis=0), model.std(axis=0) + LEAST_SPREAD
    values, model = (values - mean) / spread, (model - mean) / spread
    return frechet_distance(values, model, correct_bias=False).raw, diversity(values)
