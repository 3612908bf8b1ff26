"""Batch normalisation whose statistics are floating-point numbers only, as weights on disk have to be."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import batch_norm


class BatchNorm(nn.Module):
    """Values (N, c, ...) normalised channel by channel: in training by the batch's statistics, else by those kept.

    Parameters
    ----------
    channels : int
    momentum : float, share of a batch's statistics in those kept after it; 1 keeps the last batch's
    """

    mean: Tensor
    variance: Tensor

    def __init__(self, channels: int, *, momentum: float = 0.1) -> None:
        super().__init__()
        self.momentum = momentum
        self.weight, self.bias = nn.Parameter(torch.ones(channels)), nn.Parameter(torch.zeros(channels))
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("variance", torch.ones(channels))

    def forward(self, values: Tensor) -> Tensor:
        kept = self.mean, self.variance
        return batch_norm(values, *kept, self.weight, self.bias, training=self.training, momentum=self.momentum)
