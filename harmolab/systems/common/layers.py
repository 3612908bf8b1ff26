"""Parts of several systems' networks: normalisation by the training split, branches over time, a count."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

# A channel that hardly varies (the root's own x and z never do) is not blown up to variance one.
_LEAST_STD = 1e-3
SLOPE = 0.1  # of the bend in `perceptron`


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


class Statistics(NamedTuple):
    """Mean and standard deviation of every channel of the training split: audio (F,), motion code (C,)."""

    audio_mean: Tensor
    audio_std: Tensor
    motion_mean: Tensor
    motion_std: Tensor

    @classmethod
    def of(cls, audio: Tensor, motion: Tensor, mask: Tensor) -> Statistics:
        """Statistics over the frames whose mask is 1, of audio (N, T, F), motion (N, T, C) and mask (N, T)."""
        return cls(*channel_statistics(audio, mask), *channel_statistics(motion, mask))


class Normalised(nn.Module):
    """A network with a `Normaliser` of motion, and maybe one of audio."""

    def set_statistics(self, statistics: Statistics) -> None:
        """Normalise by the training split from now on."""
        for name, scale in self.named_children():
            if isinstance(scale, Normaliser):
                scale.set(*(statistics[:2] if name == "audio_scale" else statistics[2:]))


def perceptron(n_in: int, n_hidden: int, n_out: int, *, first: float = 1.0) -> nn.Sequential:
    """Two linear layers with a bend between; the last one's first weights are multiplied by `first`, its bias is 0."""
    last = nn.Linear(n_hidden, n_out)
    with torch.no_grad():
        last.weight.mul_(first)
        last.bias.zero_()
    return nn.Sequential(nn.Linear(n_in, n_hidden), nn.LeakyReLU(SLOPE), last)


class MaskedConvolution(nn.Module):
    """Convolution over time that leaves padding out: (N, T, in), (N, T) -> (N, T', out), (N, T')."""

    def __init__(self, n_in: int, n_out: int, *, stride: int = 1) -> None:
        super().__init__()
        self.stride = stride
        self.convolution = nn.Conv1d(n_in, n_out, 3, stride, padding=1)

    def forward(self, values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        bent = nn.functional.leaky_relu(self.convolution(values), 0.2)
        mask = mask[:, :: self.stride]
        return bent * mask[:, None], mask


class MotionBranch(nn.Module):
    """Three convolutions over time, halving its rate after the first: (N, C, T), (N, T) -> (N, 4 c, T / 4) and mask."""

    def __init__(self, n_in: int, channels: int) -> None:
        super().__init__()
        sizes = (n_in, channels, 2 * channels, 4 * channels)
        self.layers = nn.ModuleList(
            MaskedConvolution(a, b, stride=stride) for a, b, stride in zip(sizes, sizes[1:], (1, 2, 2), strict=False)
        )

    def forward(self, values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        return self.maps(values, mask)[-1]

    def maps(self, values: Tensor, mask: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Output of each of the three layers, with its mask."""
        maps = [(values * mask[:, None], mask)]
        for layer in self.layers:
            maps.append(layer(*maps[-1]))
        return maps[1:]


def mean_over_time(values: Tensor, mask: Tensor) -> Tensor:
    """(N, c): mean of (N, c, T) over the frames whose mask (N, T) is 1."""
    return (values * mask[:, None]).sum(dim=2) / mask.sum(dim=1, keepdim=True).clamp(min=1.0)
