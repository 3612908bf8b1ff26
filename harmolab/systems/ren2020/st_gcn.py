"""ST-GCN (Yan et al. 2018): convolutions over joints and over time, whose maps say how alike two dances are.

Ren et al. compare the maps of a classifier of dances ("pose perceptual loss"). What its 16 classes were is not known;
here it learns what the pose network learns (`train_pose_net`), from the training split.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

from harmolab.body.skeletons import Skeleton, ancestors
from harmolab.systems.training.about import stored_skeleton
from harmolab.systems.training.layers import PATH_CHANNELS, BatchNorm, Normaliser
from harmolab.systems.training.pose_network import EMBEDDING, resample
from harmolab.systems.training.weights import whole

PARTITIONS = 3  # of a joint's neighbours: itself, those nearer to the root, those farther from it
TEMPORAL = 9  # frames that a convolution over time spans
# Channels of each block as multiples of the first's, and the steps in time that it makes.
WIDTHS, STRIDES = (1, 1, 1, 1, 2, 2, 2, 4, 4, 4), (1, 1, 1, 1, 2, 1, 1, 2, 1, 1)


def partitions(skeleton: Skeleton) -> Tensor:
    """(3, J, J): share of joint j's features in joint i's new ones; itself, its parent, its children.

    A joint's neighbours share evenly: each row adds up to one over the three partitions ("spatial configuration").
    """
    n_joints = len(skeleton.joints)
    shares = torch.zeros(PARTITIONS, n_joints, n_joints)
    shares[0] = torch.eye(n_joints)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            shares[1, joint, parent] = shares[2, parent, joint] = 1.0
    return shares / shares.sum(dim=(0, 2))[:, None]


class STGCN(nn.Module):
    """Ten blocks over (time, joints), their temporal rate halved at the fifth and the eighth; then an embedding.

    A clip is the joints' places in the heading frame, normalised, at `frames` moments; the root's path is left out.

    Parameters
    ----------
    skeleton : Skeleton with J joints
    channels : int, of the first block
    fps : float, hertz
        Frame rate of the motion codes it is given.
    frames : int, moments of a clip, whatever its length
    """

    def __init__(self, skeleton: Skeleton, channels: int, *, fps: float, frames: int) -> None:
        super().__init__()
        if not 0 < fps < math.inf or channels < 1 or frames < 1:
            raise ValueError(f"fps, channels and frames must be positive, got {fps}, {channels} and {frames}")
        ancestors(skeleton.parents)  # refuses bones in a circle
        self.skeleton, self.channels, self.fps, self.frames = skeleton, channels, float(fps), frames
        self.motion_scale = Normaliser(3 * len(skeleton.joints) + PATH_CHANNELS)
        sizes = (3, *(channels * width for width in WIDTHS))
        shares = partitions(skeleton)
        self.blocks = nn.ModuleList(
            GraphBlock(a, b, shares, stride=stride, residual=number > 0)
            for number, (a, b, stride) in enumerate(zip(sizes, sizes[1:], STRIDES, strict=False))
        )
        self.summary = nn.Linear(sizes[-1], EMBEDDING)

    def features(self, code: Tensor, mask: Tensor) -> list[Tensor]:
        """Maps (N, channels, frames, J) of the ten blocks, of motion codes (N, T, C) in standard deviations."""
        clip = resample(code[..., :-PATH_CHANNELS], mask, self.frames)
        maps = [clip.unflatten(-1, (-1, 3)).permute(0, 3, 1, 2)]
        for block in self.blocks:
            maps.append(block(maps[-1]))
        return maps[1:]

    def embed(self, motion: Tensor, mask: Tensor) -> Tensor:
        """(N, 32) embeddings of motion codes (N, T, C), not normalised."""
        return self.summary(self.features(self.motion_scale(motion), mask)[-1].mean(dim=(2, 3)))

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        sizes = {"channels": self.channels, "frames": self.frames}
        return {"fps": self.fps, "skeleton": asdict(self.skeleton), **sizes}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """An ST-GCN as its description says; ValueError for sizes that cannot be."""
        channels, frames = (whole(name, build[name]) for name in ("channels", "frames"))
        return cls(stored_skeleton(build), channels, fps=float(build["fps"]), frames=frames)


class GraphBlock(nn.Module):
    """From joints to their neighbours, then over time: (N, in, T, J) -> (N, out, T / stride, J)."""

    shares: Tensor

    def __init__(self, n_in: int, n_out: int, shares: Tensor, *, stride: int, residual: bool) -> None:
        super().__init__()
        self.register_buffer("shares", shares.clone())
        self.edges = nn.Parameter(torch.ones_like(shares))
        self.spatial = nn.Conv2d(n_in, PARTITIONS * n_out, 1)
        self.spatial_norm, self.temporal_norm = BatchNorm(n_out), BatchNorm(n_out)
        self.temporal = nn.Conv2d(n_out, n_out, (TEMPORAL, 1), (stride, 1), padding=(TEMPORAL // 2, 0))
        self.past: nn.Module | None = None
        if residual:
            same = n_in == n_out and stride == 1
            self.past = (
                nn.Identity() if same else nn.Sequential(nn.Conv2d(n_in, n_out, 1, (stride, 1)), BatchNorm(n_out))
            )

    def forward(self, values: Tensor) -> Tensor:
        spread = self.spatial(values).unflatten(1, (PARTITIONS, -1))  # (N, 3, out, T, J)
        joined = torch.einsum("nkctj,kij->ncti", spread, self.shares * self.edges)
        new = self.temporal_norm(self.temporal(relu(self.spatial_norm(joined))))
        return relu(new if self.past is None else new + self.past(values))
