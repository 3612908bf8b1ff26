"""Loss terms of Ren et al.'s generator and of its two discriminators; each is a mean over clips. Padding never counts.

Codes are motion codes in standard deviations; masks are 1 at real frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor
from torch.nn.functional import softplus

Map = tuple[Tensor, Tensor]  # (N, channels, T) and its mask (N, T)


def pose_loss(code: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """L1 of the poses: the mean difference of codes (N, T, C) over real frames and channels."""
    return _over_frames((code.float() - target).abs().mean(dim=-1), mask).mean()


def perceptual_loss(maps: Sequence[Tensor], targets: Sequence[Tensor], weights: Sequence[float]) -> Tensor:
    """Weighted sum of the mean differences between the ST-GCN's maps of danced and recorded clips.

    Parameters
    ----------
    maps, targets : a tensor (N, channels, frames, J) for each block
    weights : of the blocks
    """
    differences = [(ours - theirs).abs().mean() for ours, theirs in zip(maps, targets, strict=True)]
    return torch.stack([weight * each for weight, each in zip(weights, differences, strict=True)]).sum()


def matching_loss(maps: Sequence[Map], targets: Sequence[Map]) -> Tensor:
    """Feature matching: the sum over a discriminator's maps of their mean difference on danced and recorded clips."""
    pairs = zip(maps, targets, strict=True)
    return torch.stack([_over_frames((a - b).abs().mean(dim=1), mask).mean() for (a, mask), (b, _) in pairs]).sum()


def deceiving_loss(logits: Tensor, counted: Tensor | None = None) -> Tensor:
    """Cross-entropy of a discriminator's verdicts on danced clips with "recorded", which the generator lowers.

    Parameters
    ----------
    logits : (N,) tensor, or (N, W) for every window of a clip
    counted : (N, W) tensor, 1 for windows that count
    """
    return _verdicts(softplus(-logits), counted)


def discriminator_loss(real: Tensor, fake: Tensor, counted: Tensor | None = None) -> Tensor:
    """Cross-entropy of the verdicts on recorded clips with "recorded", and of those on danced clips with "danced"."""
    return _verdicts(softplus(-real), counted) + _verdicts(softplus(fake), counted)


def gradient_penalty(judge: Callable[[Tensor], Tensor], real: Tensor, fake: Tensor, mask: Tensor) -> Tensor:
    """The squared distance from one of a discriminator's slope, at poses between recorded and danced ones.

    As in Gulrajani et al. 2017; the music is not mixed. Torch's generator of random numbers draws where in between.

    Parameters
    ----------
    judge : function(codes (N, T, C)) -> logits (N,)
    real, fake : (N, T, C) codes, in single precision
    mask : (N, T)
    """
    share = torch.rand(len(real), 1, 1).to(real.device)
    mixed = torch.lerp(fake, real, share).detach().requires_grad_()
    (slope,) = torch.autograd.grad(judge(mixed).sum(), mixed, create_graph=True)
    length = torch.linalg.vector_norm((slope * mask[..., None]).flatten(1), dim=1)
    return (length - 1).square().mean()


def _verdicts(losses: Tensor, counted: Tensor | None) -> Tensor:
    """Mean over clips of losses (N,), or of their means over the windows (N, W) that count."""
    return losses.mean() if counted is None else _over_frames(losses, counted).mean()


def _over_frames(values: Tensor, mask: Tensor) -> Tensor:
    """(N,): means of (N, T) where the mask is 1; 0 for a clip where nothing counts."""
    return (values * mask).sum(dim=1) / mask.sum(dim=1).clamp(min=1.0)
