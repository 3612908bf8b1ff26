"""From a song to a dance, for every network that moves a body by a motion code: what it gets, and what follows.

A network that dances is a `Dancer`: it says which music features it hears and which body it moves, and its method
``code`` turns a `DanceInput` into a motion code. Beats, features and the movement to start from are prepared here, and
bones, floor and feet are seen to here, for all of them alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from harmolab.beats.audio import music_beats
from harmolab.io.files import Progress, silent
from harmolab.kinematics import resample_motion
from harmolab.params import DANCES
from harmolab.skeletons import ancestors
from harmolab.systems.common.audio_features import audio_features
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.grid import MeterFrames, filled_beats, meter_frames
from harmolab.systems.common.grounding import grounded
from harmolab.systems.common.layers import Normaliser
from harmolab.systems.common.length import n_frames
from harmolab.systems.common.motion_code import decode_motion, encode_motion
from harmolab.systems.common.poses_bank import PoseBank, retimed
from harmolab.systems.common.torch_code import PATH_CHANNELS, fix_bones, local_joints
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion, Skeleton


@dataclass(frozen=True, eq=False)
class DanceInput:
    """All that a network gets before it dances. Frame 0 is the first of the dance; frames before it have been danced.

    Parameters
    ----------
    audio : (T, F) array
        Features of the music, from the first frame of `meters` to the end of the last, at the dancer's rate.
    song : function() -> (S, F) array, features of the whole recording
    beats : (B,) array
        Beats in frames of the dance, between frames too; they reach beyond both of its ends.
    meters : list of MeterFrames, without gaps; the first begins at frame 0 or before it
    prior : (P, C) array, code of the movement that the dance goes on from, from the first frame of `meters` on
    n_frames : int, length of the dance
    progress : function(iterable, label) -> iterable
    """

    audio: NDArray[np.float32]
    song: Callable[[], NDArray[np.float32]]
    beats: FloatArray
    meters: list[MeterFrames]
    prior: FloatArray
    n_frames: int
    progress: Progress = silent

    @property
    def first(self) -> int:
        """The frame that `audio` and `prior` begin at; 0 or negative."""
        return self.meters[0].begin


class Dancer(Protocol):
    """A network that dances to a song (a torch module)."""

    features: FeatureParams | None
    fps: float
    skeleton: Skeleton
    bone_lengths: Tensor
    n_motion: int
    motion_scale: Normaliser

    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance, bones about as long as they should be; `seed` draws all chance."""


def check_dancer(
    n_audio: int, skeleton: Skeleton, bone_lengths: Tensor, *, fps: float, features: FeatureParams | None
) -> None:
    """ValueError unless what a dancer is built of fits together: skeleton, bone lengths (J,), audio channels, rate."""
    ancestors(skeleton.parents)  # refuses bones in a circle
    n_joints = len(skeleton.joints)
    if bone_lengths.shape != (n_joints,) or not bool((bone_lengths >= 0).all()):
        raise ValueError(f"bone_lengths must be {n_joints} lengths in metres, got {bone_lengths.tolist()}")
    if n_audio < 1 or not 0 < fps < math.inf:
        raise ValueError(f"n_audio and fps must be positive, got {n_audio} and {fps}")
    if features is not None and (features.n_audio, features.fps) != (n_audio, fps):
        raise ValueError(f"features must have {n_audio} audio channels at {fps} Hz, got {features}")


def synthesize_dance(
    dancer: Dancer,
    audio: Audio,
    *,
    beats: BeatTrack | None = None,
    seconds: float | None = None,
    start: float = 0.0,
    seed: int = 0,
    poses: PoseBank | None = None,
    initial: Motion | None = None,
    dance: str | None = None,
    plant_feet: bool = True,
    progress: Progress = silent,
) -> Motion:
    """A dance to music, at the dancer's frame rate; frame 0 belongs to the audio time `start`.

    Parameters
    ----------
    dancer : Dancer that knows its audio features, such as HarmoGAN's `Generator`
    audio : Audio
        The whole recording, even where only a part is danced to: beats are tracked in all of it.
    beats : BeatTrack on the audio time line; tracked when left out, with the tempo of `dance` as prior
    seconds : float, length of the dance; to the end of the music when left out or longer
    start : float, seconds of audio time
    seed : int
        Draws the movement that the dance starts from, and what the network leaves to chance.
    poses : PoseBank of movements to start from
        Left out: the mean pose at rest.
    initial : Motion of the dancer's skeleton that the dance goes on from; then no other start is drawn
    dance : name of a dance; starts from a movement of that dance if the bank has one
    plant_feet : bool
        Keep feet that carry from sliding (`harmolab.systems.common.grounding`).
    progress : function(iterable, label) -> iterable

    Returns
    -------
    Motion; the dancer starts at x = z = 0 facing +z, and stands on y = 0

    Raises
    ------
    ValueError
        If `start` or `seconds` lies outside the music, `dance` is unknown to both the bank and the tempo table, the
        poses or `initial` do not fit the dancer, or it was built without features.

    Examples
    --------
    >>> from harmolab.systems.harmogan.networks import load_generator
    >>> generator = load_generator("run/model")  # doctest: +SKIP
    >>> motion = synthesize_dance(generator, load_audio("song.mp3"), seconds=20.0, seed=3)  # doctest: +SKIP
    """
    frames = n_frames(audio, start, seconds, dancer.fps)
    if dancer.features is None:
        raise ValueError("this network does not say which audio features it hears; build it with features=...")
    code = _first_movement(dancer, poses, dance, seed) if initial is None else _coded(dancer, initial)
    track = music_beats(Clip("", audio, beats=beats, dance=dance or ""))
    meters = meter_frames(track, dancer.features, start=start, n_frames=frames, fps=dancer.fps)
    first = meters[0].begin
    if initial is None:  # a movement of the bank fills the beats before a meter of four
        length = max(1, round(meters[0].share * len(code)))
        prior = retimed(code[-length:], meters[0].meter - first)
    else:  # `initial` keeps its speed, and ends where the dance begins, which may be inside a meter
        prior = retimed(code[first:], -first)
    source = _dance_input(dancer.features, audio, track, meters, prior, start, frames, progress)
    return _dressed(dancer, dancer.code(source, seed), plant_feet=plant_feet)


def _dance_input(
    features: FeatureParams,
    audio: Audio,
    track: BeatTrack,
    meters: list[MeterFrames],
    prior: FloatArray,
    start: float,
    frames: int,
    progress: Progress,
) -> DanceInput:
    """The record of what a network is told of a song."""
    times = start + np.arange(meters[0].begin, meters[-1].end) / features.fps
    beats, _ = filled_beats(track, start, start + frames / features.fps, before=2 * features.unit_beats)
    return DanceInput(
        audio=audio_features(audio, track, times, features),
        song=lambda: audio_features(audio, track, np.arange(0.0, audio.duration, 1 / features.fps), features),
        beats=(beats - start) * features.fps,
        meters=meters,
        prior=prior,
        n_frames=frames,
        progress=progress,
    )


def _dressed(dancer: Dancer, code: FloatArray, *, plant_feet: bool) -> Motion:
    """The motion of a code (T, C): bones of their lengths, on the floor, feet that stand."""
    positions = decode_motion(_with_bones(dancer, code), dancer.fps, dancer.skeleton)
    positions = grounded(positions, dancer.fps, dancer.skeleton, plant_feet=plant_feet)
    return Motion(positions, dancer.fps, dancer.skeleton)


def _first_movement(dancer: Dancer, poses: PoseBank | None, dance: str | None, seed: int) -> FloatArray:
    """The motion code (T0, C) that a dance starts from, drawn by `seed`; without a bank the mean pose, at rest."""
    names = {*DANCES, *(() if poses is None else poses.dances)} - {""}
    if dance and dance not in names:
        raise ValueError(f"unknown dance {dance!r}; known: {', '.join(sorted(names))}")
    if poses is None:
        mean = dancer.motion_scale.mean.detach().cpu().double().numpy().copy()
        mean[-PATH_CHANNELS:] = 0.0
        return mean[None]
    clips = poses.of(dance)
    if clips.shape[2] != dancer.n_motion:
        raise ValueError(f"poses must be motion codes (K, T0, {dancer.n_motion}), got shape {clips.shape}")
    # Consecutive seeds draw different movements, until each was drawn once.
    return clips[np.random.default_rng(0).permutation(len(clips))[seed % len(clips)]]


def _coded(dancer: Dancer, motion: Motion) -> FloatArray:
    """The motion code (T0, C) of a motion of the dancer's skeleton."""
    if motion.skeleton.joints != dancer.skeleton.joints:
        joints = len(motion.skeleton.joints), len(dancer.skeleton.joints)
        raise ValueError(f"initial has other joints ({joints[0]}) than the generator ({joints[1]}); retarget it first")
    motion = resample_motion(motion, dancer.fps)
    return encode_motion(motion.positions, motion.fps, motion.skeleton).astype(np.float64)


def _with_bones(dancer: Dancer, code: FloatArray) -> FloatArray:
    """The code (T, C) with every bone at the dancer's length, which fading at a border has changed a little."""
    local = local_joints(torch.from_numpy(code)[None])
    fixed = fix_bones(local, dancer.skeleton.parents, dancer.bone_lengths.cpu().double())
    return np.concatenate([fixed[0].flatten(1).numpy(), code[:, -PATH_CHANNELS:]], axis=1)
