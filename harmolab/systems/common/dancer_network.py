"""The base of generators: music features in, motion code out, at one frame rate, of one body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, ClassVar

from torch import Tensor

from harmolab.systems.common.about import stored_skeleton
from harmolab.systems.common.dancing import check_dancer
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.layers import Normalised, Normaliser
from harmolab.systems.common.torch_code import PATH_CHANNELS
from harmolab.systems.common.weights import whole
from harmolab.types import Skeleton


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
        If these do not fit together (`check_dancer`).
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
        bone_lengths = bone_lengths.detach().float()
        check_dancer(n_audio, skeleton, bone_lengths, fps=fps, features=features)
        self.params, self.n_audio, self.skeleton, self.fps = params, n_audio, skeleton, float(fps)
        self.features = features
        self.n_motion = 3 * len(skeleton.joints) + PATH_CHANNELS
        self.audio_scale, self.motion_scale = Normaliser(n_audio), Normaliser(self.n_motion)
        self.register_buffer("bone_lengths", bone_lengths.clone())

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
