"""Parts of several systems' networks: normalisation by the training split, statistics, a count."""

from __future__ import annotations

import torch
from torch import Tensor, nn

# A channel that hardly varies (the root's own x and z never do) is not blown up to variance one.
_LEAST_STD = 1e-3


def channel_statistics(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (C,) of values (N, T, C) over frames whose mask (N, T) is 1; ValueError without."""
    real = values[mask > 0.5].double()
    if not len(real):
        raise ValueError("mask must keep at least one frame to take statistics from")
    return real.mean(dim=0).float(), real.std(dim=0, correction=0).float()


class Normaliser(nn.Module):
    """To mean zero and standard deviation one, channel by channel; changes nothing until its statistics are set."""

    mean: Tensor
    std: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("std", torch.ones(channels))

    def set(self, mean: Tensor, std: Tensor) -> None:
        """Keep (channels,) mean and standard deviation; ValueError for other shapes, NaN, or a negative deviation."""
        for name, values in (("mean", mean), ("standard deviation", std)):
            if values.shape != self.mean.shape:
                raise ValueError(f"{name} must have shape {tuple(self.mean.shape)}, got {tuple(values.shape)}")
            if not bool(values.isfinite().all()):
                raise ValueError(f"{name} must be finite, got {values.tolist()}")
        if bool((std < 0).any()):
            raise ValueError(f"standard deviation must be zero or more, got {std.min().item()}")
        self.mean.copy_(mean)
        self.std.copy_(std)

    def forward(self, values: Tensor) -> Tensor:
        """(..., channels), in standard deviations from the mean."""
        return (values - self.mean) / self.std.clamp(min=_LEAST_STD)


def parameter_count(module: nn.Module) -> int:
    """Number of values that training changes."""
    return sum(values.numel() for values in module.parameters())
