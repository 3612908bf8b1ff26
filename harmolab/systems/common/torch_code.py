"""The motion coding of `motion_code` in torch: differentiable, batched, without loops over time.

A code has C = 3 J + 3 channels: the joints of every frame seen from the dancer's heading, above the root's place on the
floor (metres, J x 3), the root's velocity to the side and forward (m/s), and the yaw rate (rad/s).
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from harmolab.skeletons import ancestors

# Root velocity to the side and forward, yaw rate: the last channels of a code.
PATH_CHANNELS = 3
# Square of a length (0.1 mm) below which a bone has no direction.
_TINY = 1e-8


def local_joints(code: Tensor) -> Tensor:
    """The joints in the heading frame, (N, T, J, 3) metres, of a code (N, T, 3 J + 3)."""
    return code[..., :-PATH_CHANNELS].unflatten(-1, (-1, 3))


def root_path(code: Tensor, fps: float) -> tuple[Tensor, Tensor]:
    """Place of the root on the floor (N, T, 2: x, z; metres) and heading (N, T; radians), from (0, 0) and 0 on.

    Rates at frame t describe the step from t - 1 to t, so those of frame 0 say nothing. A step is taken in the heading
    that it ends with.
    """
    rates = code[..., -PATH_CHANNELS:] / fps
    rates = torch.cat([torch.zeros_like(rates[:, :1]), rates[:, 1:]], dim=1)
    heading = rates[..., 2].cumsum(dim=1)
    x, z = _turned(rates[..., 0], rates[..., 1], heading)
    return torch.stack([x, z], dim=-1).cumsum(dim=1), heading


def _turned(x: Tensor, z: Tensor, heading: Tensor) -> tuple[Tensor, Tensor]:
    """x and z of floor vectors turned by `heading` about the vertical axis (0: along z; positive: towards x)."""
    sine, cosine = heading.sin(), heading.cos()
    return x * cosine + z * sine, z * cosine - x * sine


def decode(code: Tensor, fps: float) -> Tensor:
    """Joint positions in the world that a motion code stands for; starts at x = z = 0 with heading 0.

    Parameters
    ----------
    code : (N, T, 3 J + 3) tensor, not normalised
    fps : float, hertz

    Returns
    -------
    (N, T, J, 3) tensor, metres, y up. Same as `harmolab.systems.common.motion_code.decode_motion`.
    """
    path, heading = root_path(code, fps)
    x, y, z = local_joints(code).unbind(dim=-1)  # each (N, T, J)
    x, z = _turned(x, z, heading[..., None])
    return torch.stack([x + path[..., 0, None], y, z + path[..., 1, None]], dim=-1)


def fix_bones(local: Tensor, parents: Sequence[int], lengths: Tensor) -> Tensor:
    """Joints moved along their bones until every bone has its length; roots stay, directions stay.

    A joint is the sum of the bones between it and its root, so the whole tree is one product with `ancestors`.

    Parameters
    ----------
    local : (N, T, J, 3) tensor, metres
    parents : J indices, -1 at roots
    lengths : (J,) tensor, metres; those of roots are not read

    Returns
    -------
    (N, T, J, 3) tensor. A bone of no length (under 0.1 mm) keeps less than its length, and finite gradients.
    """
    joints = torch.arange(len(parents), device=local.device)
    above = torch.as_tensor(list(parents), device=local.device)
    is_root = above < 0
    bones = local - local[..., torch.where(is_root, joints, above), :]  # zero at roots
    directions = bones * torch.rsqrt((bones * bones).sum(dim=-1, keepdim=True) + _TINY)
    steps = torch.where(is_root[:, None], local, directions * lengths.to(local)[:, None])
    return torch.einsum("ij,ntjc->ntic", local.new_tensor(ancestors(parents)), steps)
