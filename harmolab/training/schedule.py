"""Learning rates, epoch by epoch, and the order of the units (paper Sec. 5.2).

Functions of the epoch alone: a run that resumes needs no memory of them.
"""

from __future__ import annotations

from itertools import cycle, islice
from math import prod

import torch

from harmolab.params import TrainParams

__all__ = ["adversarial_rate", "epoch_order", "pretrain_rate"]


def pretrain_rate(epoch: int, params: TrainParams) -> float:
    """Adam's learning rate in pretraining epoch `epoch` (from 0): one factor after every 50 epochs, then it stays.

    >>> [pretrain_rate(epoch, TrainParams.paper()) for epoch in (0, 50, 100)]
    [0.001, 0.0005, 0.0001]
    """
    drops = params.pretrain_drops[: epoch // params.pretrain_drop_epochs]
    return params.pretrain_rate * prod(drops)


def adversarial_rate(epoch: int, params: TrainParams) -> float:
    """Learning rate of all networks in adversarial epoch `epoch` (from 0): divided by 2 and 5 in turn every 5 epochs.

    >>> [adversarial_rate(epoch, TrainParams.paper()) for epoch in (0, 5, 10)]
    [0.0001, 5e-05, 1e-05]
    """
    drops = islice(cycle(params.adversarial_drops), epoch // params.adversarial_drop_epochs)
    return params.adversarial_rate * prod(drops)


def epoch_order(n_units: int, epoch: int, params: TrainParams) -> list[torch.Tensor]:
    """Batches of unit indices of one epoch, the same in every process: every unit once, in an order drawn by the seed.

    As few batches as hold `params.batch_size` units at most, of equal size to one unit, so that none is left with a
    unit or two.
    """
    shuffle = torch.Generator().manual_seed(params.seed * 1_000_003 + epoch)
    order = torch.randperm(n_units, generator=shuffle)
    return list(order.tensor_split(-(-n_units // params.batch_size)))
