"""Parts of the networks of Lee et al. 2019: coders and decoders of poses, units and dances; style of music; critics."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.pieces import FRAMES

SLOPE = 0.2  # of the bends


class Code(NamedTuple):
    """A normal distribution over codes: mean and logarithm of the variance, both (..., size)."""

    mean: Tensor
    logvar: Tensor

    def drawn(self, generator: torch.Generator) -> Tensor:
        """A code drawn from it, (..., size); on every device the same."""
        noise = torch.randn(self.mean.shape, generator=generator).to(self.mean)
        return self.mean + torch.exp(0.5 * self.logvar) * noise

    @property
    def both(self) -> Tensor:
        """Mean and logarithm of the variance side by side, (..., 2 size)."""
        return torch.cat(self, dim=-1)


class Heads(nn.Module):
    """Two linear layers: values (..., n_in) to the `Code` of `size` numbers."""

    def __init__(self, n_in: int, size: int) -> None:
        super().__init__()
        self.mean, self.logvar = nn.Linear(n_in, size), nn.Linear(n_in, size)

    def forward(self, values: Tensor) -> Code:
        return Code(self.mean(values), self.logvar(values))


def layers(sizes: Sequence[int]) -> nn.Sequential:
    """Linear layers of these sizes, each followed by LayerNorm and a bend."""
    steps = (nn.Sequential(nn.Linear(a, b), nn.LayerNorm(b), nn.LeakyReLU(SLOPE)) for a, b in pairwise(sizes))
    return nn.Sequential(*steps)


class PoseCoder(nn.Module):
    """A pose (..., C) to the code of z_init, and z_init back to a pose."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        hidden, size = params.pose_hidden, params.pose_latent
        self.inwards, self.heads = layers((n_motion, hidden, hidden)), Heads(hidden, size)
        self.outwards, self.pose = layers((size, hidden, hidden)), nn.Linear(hidden, n_motion)

    def forward(self, pose: Tensor) -> Code:
        code: Code = self.heads(self.inwards(pose))
        return code

    def decoded(self, z_init: Tensor) -> Tensor:
        """The pose (..., C) that z_init stands for."""
        pose: Tensor = self.pose(self.outwards(z_init))
        return pose


class MovementCoder(nn.Module):
    """Poses of a unit (N, 32, C) to the code of z_move: a GRU in both directions from a learnt state."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        self.first = nn.Parameter(torch.zeros(2, 1, params.hidden))
        self.reader = nn.GRU(n_motion, params.hidden, batch_first=True, bidirectional=True)
        self.heads = Heads(2 * params.hidden, params.latent)

    def forward(self, poses: Tensor) -> Code:
        _, last = self.reader(poses, self.first.expand(-1, len(poses), -1).contiguous())
        code: Code = self.heads(torch.cat([last[0], last[1]], dim=-1))
        return code


class Unrolled(nn.Module):
    """A GRU that is fed the same value at every step, and what follows it at each: (N, n_in) to (N, steps, hidden)."""

    def __init__(self, n_first: int, n_in: int, hidden: int) -> None:
        super().__init__()
        self.first, self.cell = nn.Linear(n_first, hidden), nn.GRUCell(n_in, hidden)
        self.after = nn.Sequential(nn.Linear(hidden, hidden), nn.LayerNorm(hidden), nn.ReLU())

    def forward(self, first: Tensor, value: Tensor, steps: int) -> Tensor:
        cell, state, states = self.cell, self.first(first), []
        # What is fed does not change, so its product is taken once: half as long again as torch's GRU would take.
        from_value = nn.functional.linear(value, cell.weight_ih, cell.bias_ih)
        gates, candidate = from_value.split([2 * cell.hidden_size, cell.hidden_size], dim=1)
        for _ in range(steps):
            from_state = nn.functional.linear(state, cell.weight_hh, cell.bias_hh)
            reset, update = torch.sigmoid(gates + from_state[:, : 2 * cell.hidden_size]).chunk(2, dim=1)
            new = torch.tanh(torch.addcmul(candidate, reset, from_state[:, 2 * cell.hidden_size :]))
            state = torch.lerp(new, state, update)
            states.append(state)
        output: Tensor = self.after(torch.stack(states, dim=1))
        return output


class UnitDecoder(nn.Module):
    """z_init (N, 10) and z_move (N, Z) to the poses of a unit, (N, 32, C)."""

    def __init__(self, params: LeeParams, n_motion: int) -> None:
        super().__init__()
        self.unrolled = Unrolled(params.pose_latent + params.latent, params.latent, params.hidden)
        self.pose = nn.Linear(params.hidden, n_motion)

    def forward(self, z_init: Tensor, z_move: Tensor) -> Tensor:
        states = self.unrolled(torch.cat([z_init, z_move], dim=-1), z_move, FRAMES)
        poses: Tensor = self.pose(states)
        return poses


class DanceCoder(nn.Module):
    """Codes of the units of a dance, (N, S, Z) each, to the code of z_dance (N, Z)."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        self.reader = nn.GRU(2 * params.latent, params.hidden, batch_first=True)
        self.heads = Heads(params.hidden, params.latent)

    def forward(self, units: Code) -> Code:
        _, last = self.reader(units.both)
        code: Code = self.heads(last[0])
        return code


class DanceDecoder(nn.Module):
    """z_dance (N, Z) to the codes of so many units, (N, S, Z) each."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        self.unrolled = Unrolled(params.latent, params.latent, params.hidden)
        self.heads = Heads(params.hidden, params.latent)

    def forward(self, z_dance: Tensor, units: int) -> Code:
        code: Code = self.heads(self.unrolled(z_dance, z_dance, units))
        return code


class MusicStyle(nn.Module):
    """A classifier of music by its dance; the last state of its GRU is the style."""

    def __init__(self, params: LeeParams, n_audio: int, n_dances: int) -> None:
        super().__init__()
        self.listening = nn.GRU(n_audio, params.style, batch_first=True)
        self.verdict = nn.Linear(params.style, n_dances)

    def forward(self, audio: Tensor, mask: Tensor) -> Tensor:
        """The style (N, 30) of standardised audio (N, T, F), at the last frame whose mask (N, T) is 1."""
        states, _ = self.listening(audio)
        last = mask.sum(dim=1).long() - 1
        return states[torch.arange(len(audio), device=audio.device), last]


class StyleCoder(nn.Module):
    """Style (N, 30) and noise (N, 30) to the code of z_dance (N, Z)."""

    def __init__(self, params: LeeParams) -> None:
        super().__init__()
        sizes = (params.style + params.noise, *params.style_layers)
        self.inwards, self.heads = layers(sizes), Heads(sizes[-1], params.latent)

    def forward(self, style: Tensor, noise: Tensor) -> Code:
        code: Code = self.heads(self.inwards(torch.cat([style, noise], dim=-1)))
        return code


class Critic(nn.Module):
    """Logits (N,), high for codes of recorded dances, of codes (N, n_code) and the mean audio (N, F) beside them."""

    def __init__(self, params: LeeParams, n_code: int, n_audio: int) -> None:
        super().__init__()
        size = params.critic_layers[-1]
        self.seeing = layers((n_code, *params.critic_layers))
        self.hearing = layers((n_audio, size, size))
        self.verdict = nn.Linear(2 * size, 1)

    def forward(self, code: Tensor, audio: Tensor) -> Tensor:
        logits: Tensor = self.verdict(torch.cat([self.seeing(code), self.hearing(audio)], dim=-1))
        return logits.squeeze(-1)
