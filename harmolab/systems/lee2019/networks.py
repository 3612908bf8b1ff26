"""The networks of Lee et al. 2019: a coder of dance units, a composer of their codes, a style of music, two critics.

Poses go through them as numbers of the motion code in standard deviations of the training split, all joints measured
from the root, whose own x and y then say where the whole body is: so a unit can be shifted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Self

import torch
from torch import Tensor, nn

from harmolab.systems.common.about import stored_skeleton
from harmolab.systems.common.dancing import DanceInput
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.layers import Normalised, Normaliser, parameter_count
from harmolab.systems.common.torch_code import PATH_CHANNELS, decode, local_joints
from harmolab.systems.common.weights import stored_record
from harmolab.systems.lee2019.generate import danced_units
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.parts import (
    Critic,
    DanceCoder,
    DanceDecoder,
    MovementCoder,
    MusicStyle,
    PoseCoder,
    StyleCoder,
    UnitDecoder,
    layers,
)
from harmolab.types import FloatArray, Skeleton


class DancingToMusic(Normalised):
    """All networks of Lee et al. 2019: those that dance, and those that taught them.

    Parameters
    ----------
    params : LeeParams
    skeleton : Skeleton with J joints
    bone_lengths : (J,) tensor, metres, 0 at roots
    features : FeatureParams of the audio features
    dances : names of the dances that the style of music tells apart; "" is one of them where it was not known
    """

    system = "lee2019"
    bone_lengths: Tensor

    def __init__(
        self,
        params: LeeParams,
        skeleton: Skeleton,
        bone_lengths: Tensor,
        *,
        features: FeatureParams,
        dances: Sequence[str],
    ) -> None:
        super().__init__()
        self.params, self.skeleton, self.features, self.dances = params, skeleton, features, tuple(dances)
        self.fps, self.n_motion = float(features.fps), 3 * len(skeleton.joints) + PATH_CHANNELS
        self.root = skeleton.parents.index(-1) if -1 in skeleton.parents else 0
        self.register_buffer("bone_lengths", bone_lengths.detach().float().clone())
        self.audio_scale, self.motion_scale = Normaliser(features.n_audio), Normaliser(self.n_motion)
        self.pose_scale = Normaliser(self.n_motion)
        self.poses, self.movements = PoseCoder(params, self.n_motion), MovementCoder(params, self.n_motion)
        self.unit_decoder = UnitDecoder(params, self.n_motion)
        self.dance_coder, self.dance_decoder = DanceCoder(params), DanceDecoder(params)
        self.music = MusicStyle(params, features.n_audio, len(self.dances))
        self.style_coder = StyleCoder(params)
        self.unit_critic = Critic(params, 2 * params.latent * params.sequence, features.n_audio)
        self.dance_critic = Critic(params, 2 * params.latent, features.n_audio)
        inner = layers((params.latent, *params.regressor_layers))
        self.regressor = nn.Sequential(inner, nn.Linear(params.regressor_layers[-1], params.style))

    def standardised(self, code: Tensor) -> Tensor:
        """Motion codes (..., C) as the networks take them."""
        poses: Tensor = self.pose_scale(from_root(code, self.root))
        return poses

    def motion(self, poses: Tensor) -> Tensor:
        """Motion codes (..., C) of poses (..., C) out of a network, the root back at x = z = 0."""
        code = from_root(self.pose_scale.mean + self.pose_scale.std * poses, self.root, backwards=True)
        joints = local_joints(code)
        place = joints[..., self.root, :] if self.skeleton.bones else joints.mean(dim=-2)
        joints = joints - place[..., None, :] * place.new_tensor([1.0, 0.0, 1.0])
        return torch.cat([joints.flatten(-2), code[..., -PATH_CHANNELS:]], dim=-1)

    def positions(self, motion: Tensor) -> Tensor:
        """Joints in the world, (N, T, J, 3) metres, of motion codes (N, T, C); they start at x = z = 0, heading 0."""
        return decode(motion, self.fps)

    def code(self, source: DanceInput, seed: int) -> FloatArray:
        """The motion code (n_frames, C) of a dance (`generate.danced_units`)."""
        return danced_units(self, source, seed).code

    def parameter_count(self) -> int:
        """Number of values that training changes and dancing needs."""
        parts = (self.poses, self.unit_decoder, self.dance_decoder, self.music, self.style_coder)
        return sum(parameter_count(part) for part in parts)

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {
            "params": asdict(self.params),
            "features": asdict(self.features),
            "skeleton": asdict(self.skeleton),
            "dances": list(self.dances),
        }

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """The networks as their description says; ValueError for sizes that cannot be."""
        return cls(
            stored_record(LeeParams, build["params"]),
            stored_skeleton(build),
            tensors["bone_lengths"],
            features=FeatureParams(**build["features"]),
            dances=[str(dance) for dance in build["dances"]],
        )


def from_root(code: Tensor, root: int, *, backwards: bool = False) -> Tensor:
    """Motion codes (..., C) with the x and y of all joints but the root measured from the root's; or backwards."""
    offset = torch.zeros_like(code)
    shape = code.shape[-1] - PATH_CHANNELS
    for axis in (0, 1):
        offset[..., axis:shape:3] = code[..., 3 * root + axis, None]
        offset[..., 3 * root + axis] = 0.0
    return code + offset if backwards else code - offset
