"""Measures of how much the networks of Lee et al. 2019 have learnt: on known figures, held-out music and codes."""

from __future__ import annotations

import torch
from torch import Tensor

from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.lee2019.parts import Code
from harmolab.systems.lee2019.terms import Pieces, composed, divergence, verdicts

CHUNK = 128  # pieces at a time


@torch.no_grad()
def rebuilt(network: DancingToMusic, pieces: Tensor) -> Tensor:
    """Pieces (N, 32, C) coded and decoded, by the means of their codes."""
    parts = [network.unit_decoder(network.poses(part[:, 0]).mean, network.movements(part).mean)
             for part in pieces.split(CHUNK)]  # fmt: skip
    return torch.cat(parts)


@torch.no_grad()
def drawn_movements(network: DancingToMusic, pieces: Tensor, seed: int = 0) -> Tensor:
    """Units (N, 32, C) from the first poses of pieces and movements drawn from the standard normal."""
    generator = torch.Generator().manual_seed(seed)
    z_move = torch.randn(len(pieces), network.params.latent, generator=generator).to(pieces)
    pairs = zip(pieces.split(CHUNK), z_move.split(CHUNK), strict=True)
    return torch.cat([network.unit_decoder(network.poses(part[:, 0]).mean, code) for part, code in pairs])


def code_error(network: DancingToMusic, poses: Tensor, pieces: Tensor) -> float:
    """Mean absolute difference of units and pieces (N, 32, C), in standard deviations of the motion code."""
    scale = network.motion_scale
    return float((scale(network.motion(poses)) - scale(network.motion(pieces))).abs().mean())


def speed(network: DancingToMusic, poses: Tensor) -> float:
    """Mean joint speed of units (N, 32, C), metres per canonical frame."""
    positions = network.positions(network.motion(poses))
    return float(torch.linalg.vector_norm(positions.diff(dim=1), dim=-1).mean())


@torch.no_grad()
def movement_nats(network: DancingToMusic, pieces: Tensor) -> float:
    """Mean divergence of z_move from the standard normal, nats a piece."""
    codes = [network.movements(part) for part in pieces.split(CHUNK)]
    return float(divergence(Code(*(torch.cat(parts) for parts in zip(*codes, strict=True)))))


@torch.no_grad()
def style_accuracy(network: DancingToMusic, batch: Pieces) -> float:
    """Share of sequences whose dance the style of their music tells."""
    logits = network.music.verdict(network.music(batch.audio, batch.mask))
    return float((logits.argmax(dim=1) == batch.dance).float().mean())


@torch.no_grad()
def critic_accuracy(network: DancingToMusic, batch: Pieces) -> dict[str, float]:
    """Share of codes, half real and half from music, that each critic ("units", "dance") takes for what they are."""
    pairs = verdicts(network, composed(network, batch), batch)
    return {name: float(torch.cat([real > 0, fake < 0]).float().mean()) for name, (real, fake) in pairs.items()}
