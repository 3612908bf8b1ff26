"""From a song to a dance, for every network that moves a body by a motion code: its input, and what follows.

A network that dances is a `DancerNetwork`: it says which music features it takes and which body it moves, and its
method ``code`` turns a `DanceInput` into a motion code. For all of them alike, beats, features and the movement to
start from are prepared here, and bones, floor and feet are seen to.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from harmolab.body.skeletons import Skeleton, ancestors
from harmolab.files import Progress, silent
from harmolab.systems.training.about import stored_skeleton, whole
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.feet import grounded
from harmolab.systems.training.layers import PATH_CHANNELS, Normalised, Normaliser, fix_bones, local_joints
from harmolab.systems.training.motion_code import coded, decode_motion
from harmolab.systems.training.requests import DanceRequest, check_initial
from harmolab.systems.training.runs import PoseBank, retimed
from harmolab.systems.training.units import MeterFrames, filled_beats, meter_frames
from harmolab.types import Audio, FloatArray, Motion, SingleArray


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

    audio: SingleArray
    song: Callable[[], SingleArray]
    beats: FloatArray
    meters: list[MeterFrames]
    prior: FloatArray
    n_frames: int
    progress: Progress = silent

    @property
    def first(self) -> int:
        """The frame that `audio` and `prior` begin at; 0 or negative."""
        return self.meters[0].begin


# The base of generators: music features in, motion code out, at one frame rate, of one body.


class DancerNetwork(Normalised):
    """A generator that knows its settings, its music features, its body, and the statistics of its training split.

    Parameters
    ----------
    params : dataclass of the network's sizes
    n_audio : int, channels F of the audio features
    skeleton : Skeleton with J joints
    bone_lengths : (J,) tensor, metres, 0 at roots
    fps : float, hertz
    features : FeatureParams, optional
        Settings of the audio features; kept with the weights, so that the generator can dance to a song.

    Raises
    ------
    ValueError
        If these do not fit together.
    """

    settings: ClassVar[str] = "params"  # name of `params` in the description of weights
    bone_lengths: Tensor

    def __init__(
        self,
        params: Any,
        n_audio: int,
        skeleton: Skeleton,
        bone_lengths: Tensor,
        *,
        fps: float,
        features: FeatureParams | None = None,
    ) -> None:
        super().__init__()
        self.params, self.n_audio, self.skeleton, self.fps = params, n_audio, skeleton, float(fps)
        self.features = features
        self.n_motion = 3 * len(skeleton.joints) + PATH_CHANNELS
        self.register_buffer("bone_lengths", bone_lengths.detach().float().clone())
        self._check()
        self.audio_scale, self.motion_scale = Normaliser(n_audio), Normaliser(self.n_motion)
        self.prepare(params)

    def prepare(self, params: Any) -> None:
        """The network's own layers, where they follow from its sizes and its body alone."""

    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance, bones about as long as they should be; `seed` draws all chance."""
        raise NotImplementedError

    def _check(self) -> None:
        ancestors(self.skeleton.parents)  # refuses bones in a circle
        n_joints, lengths = len(self.skeleton.joints), self.bone_lengths
        if lengths.shape != (n_joints,) or not bool((lengths >= 0).all()):
            raise ValueError(f"bone_lengths must be {n_joints} lengths in metres, got {lengths.tolist()}")
        if self.n_audio < 1 or not 0 < self.fps < math.inf:
            raise ValueError(f"n_audio and fps must be positive, got {self.n_audio} and {self.fps}")
        if self.features is not None and (self.features.n_audio, self.features.fps) != (self.n_audio, self.fps):
            raise ValueError(f"features must have {self.n_audio} audio channels at {self.fps} Hz, got {self.features}")

    @property
    def audio_params(self) -> FeatureParams:
        """The music features that it hears; ValueError for a network that does not say."""
        if self.features is None:
            raise ValueError("this network does not say which audio features it hears; build it with features=...")
        return self.features

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {
            self.settings: asdict(self.params),
            "features": None if self.features is None else asdict(self.features),
            "n_audio": self.n_audio,
            "fps": self.fps,
            "skeleton": asdict(self.skeleton),
        }

    @staticmethod
    def body_of(build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> dict[str, Any]:
        """The arguments of the constructor beside `params`, out of a description; ValueError for what cannot be."""
        return {
            "n_audio": whole("n_audio", build["n_audio"]),
            "skeleton": stored_skeleton(build),
            "bone_lengths": tensors["bone_lengths"],
            "fps": float(build["fps"]),
            "features": None if build["features"] is None else FeatureParams(**build["features"]),
        }


# A dance to a song


def synthesize_dance(dancer: DancerNetwork, audio: Audio, *, poses: PoseBank | None = None, **options: Any) -> Motion:
    """Let a network dance to music: a motion that begins at second `start` of the music, at the network's frame rate.

    Systems do the same by their method `generate`; this function takes a network that belongs to none.

    Parameters
    ----------
    dancer : DancerNetwork
        That knows its audio features, such as HarmoGAN's `Generator`.
    audio : Audio
        The whole recording.
    poses : PoseBank
        Movements to start from; when left out, the mean pose at rest.
    **options
        ``beats``, ``start``, ``seconds``, ``seed`` and ``initial`` as in `System.generate`; ``plant_feet``,
        ``progress``; and ``dance``: the dance starts from a movement of it, if there is one among the poses.

    Returns
    -------
    Motion
        The dancer starts at x = z = 0, facing +z, and stands on y = 0.

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
    return danced(dancer, poses, DanceRequest(audio, **options))


def danced(dancer: DancerNetwork, poses: PoseBank | None, request: DanceRequest) -> Motion:
    """`synthesize_dance` of a request."""
    code = _with_bones(dancer, dancer.code(_dance_input(dancer, poses, request), request.seed))
    positions = decode_motion(code, dancer.fps, dancer.skeleton)
    positions = grounded(positions, dancer.fps, dancer.skeleton, plant_feet=request.plant_feet)
    return Motion(positions, dancer.fps, dancer.skeleton)


def _dance_input(dancer: DancerNetwork, poses: PoseBank | None, request: DanceRequest) -> DanceInput:
    """The record of what a network is told of a song."""
    audio, start = request.audio, request.start
    frames, features = request.n_frames(dancer.fps), dancer.audio_params
    request.check_dance(() if poses is None else poses.dances)
    track = request.track()
    meters = meter_frames(track, features, start=start, n_frames=frames, fps=dancer.fps)
    times = start + np.arange(meters[0].begin, meters[-1].end) / features.fps
    beats, _ = filled_beats(track, start, start + frames / features.fps, before=2 * features.unit_beats)
    return DanceInput(
        audio=audio_features(audio, track, times, features),
        song=lambda: audio_features(audio, track, np.arange(0.0, audio.duration, 1 / features.fps), features),
        beats=(beats - start) * features.fps,
        meters=meters,
        prior=_prior(dancer, poses, request, meters[0]),
        n_frames=frames,
        progress=request.progress,
    )


def _prior(dancer: DancerNetwork, poses: PoseBank | None, request: DanceRequest, first: MeterFrames) -> FloatArray:
    """The code of the movement that a dance goes on from, in the beats before its first meter."""
    if request.initial is None:  # a movement of the bank fills the beats before a meter of four
        code = _first_movement(dancer, poses, request)
        return retimed(code[-max(1, round(first.share * len(code))) :], first.meter - first.begin)
    check_initial(request.initial, dancer.skeleton, "the generator")
    # It keeps its speed, and ends where the dance begins, which may be inside a meter.
    return retimed(coded(request.initial, dancer.fps)[first.begin :], -first.begin)


def _first_movement(dancer: DancerNetwork, poses: PoseBank | None, request: DanceRequest) -> FloatArray:
    """The motion code (T0, C) that a dance starts from, drawn by its seed; without a bank the mean pose, at rest."""
    if poses is None:
        mean = dancer.motion_scale.mean.detach().cpu().double().numpy().copy()
        mean[-PATH_CHANNELS:] = 0.0
        return mean[None]
    if poses.poses.shape[2] != dancer.n_motion:
        raise ValueError(f"poses must be motion codes (K, T0, {dancer.n_motion}), got shape {poses.poses.shape}")
    return poses.drawn(request.dance, request.seed)


def _with_bones(dancer: DancerNetwork, code: FloatArray) -> FloatArray:
    """The code (T, C) with every bone at the dancer's length, which fading at a border has changed a little."""
    local = local_joints(torch.from_numpy(code)[None])
    fixed = fix_bones(local, dancer.skeleton.parents, dancer.bone_lengths.cpu().double())
    return np.concatenate([fixed[0].flatten(1).numpy(), code[:, -PATH_CHANNELS:]], axis=1)
