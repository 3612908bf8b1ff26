"""Loss terms of Music2Dance (Eq. 7-11): how likely the recorded frame was, and whether the right feet stand."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from harmolab.systems.music2dance.networks import Prediction

HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)


def likelihood_loss(prediction: Prediction, target: Tensor, valid: Tensor) -> Tensor:
    """Negative logarithm of the likelihood of frames (N, T, C): nats a frame, mean over those that are valid (N, T).

    Summed over channels. A Gaussian for each channel; a mixture of one, which is what the paper uses, is no mixture.
    """
    away = (target - prediction.mean) * (-prediction.log_sigma).exp()
    nats = (0.5 * away.square() + prediction.log_sigma + HALF_LOG_TAU).sum(dim=-1)
    return _mean(nats, valid)


def contact_loss(prediction: Prediction, contacts: Tensor, valid: Tensor) -> Tensor:
    """Binary cross-entropy of the contacts (N, T, 2) (Eq. 10), mean over both feet and the valid frames (N, T)."""
    entropy = binary_cross_entropy_with_logits(prediction.contacts, contacts, reduction="none")
    return _mean(entropy.mean(dim=-1), valid)


def squared_error(prediction: Prediction, target: Tensor, valid: Tensor) -> Tensor:
    """Mean square of what the mean misses, squared standard deviations a channel."""
    return _mean((target - prediction.mean).square().mean(dim=-1), valid)


def contact_accuracy(prediction: Prediction, contacts: Tensor, valid: Tensor) -> Tensor:
    """Share of feet that are said rightly to stand or not to, from the second frame on."""
    right = ((prediction.contacts > 0) == (contacts > 0.5)).float().mean(dim=-1)
    return _mean(right[:, 1:], valid[:, 1:])


def majority_contacts(contacts: Tensor, valid: Tensor) -> Tensor:
    """The share of whoever says the more frequent of the two, always."""
    share = _mean(contacts[:, 1:].mean(dim=-1), valid[:, 1:])
    return torch.maximum(share, 1 - share)


def unchanged_contacts(contacts: Tensor, valid: Tensor) -> Tensor:
    """The same share of whoever says "as in the frame before"."""
    same = (contacts[:, 1:] == contacts[:, :-1]).float().mean(dim=-1)
    return _mean(same, valid[:, 1:])


def _mean(values: Tensor, valid: Tensor) -> Tensor:
    """Mean of (N, T) where `valid` is 1."""
    return (values * valid).sum() / valid.sum().clamp(min=1.0)
