"""Batches of Lee et al. 2019: the networks' output for one in each phase of the training, and its loss terms."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy, l1_loss, mse_loss

from harmolab.systems.common.shards import Terms
from harmolab.systems.common.units import UnitSet, collate
from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.parts import Code


@dataclass(frozen=True, eq=False)
class Pieces:
    """Training sequences on a device (`harmolab.systems.common.shards.Units`).

    Parameters
    ----------
    poses : (N, S, 32, C) tensor, standardised as the networks take them
    audio, mask : (N, T, F) standardised, and (N, T), 1 where real
    dance : (N,) tensor, number of the dance; -1 for one that the networks do not know
    draw : int, of the noise of this batch: drawn by its units and their order, so that a run that resumes repeats it
    """

    poses: Tensor
    audio: Tensor
    mask: Tensor
    dance: Tensor
    draw: int = 0

    def __len__(self) -> int:
        return len(self.poses)

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Pieces:
        """The sequences at `indices` that fall to process `rank` of `world`."""
        rows = indices[rank::world].to(self.poses.device)
        draw = zlib.crc32(np.append(indices.cpu().numpy(), rank).astype("<i8").tobytes())
        return Pieces(self.poses[rows], self.audio[rows], self.mask[rows], self.dance[rows], draw)

    @property
    def generator(self) -> torch.Generator:
        """Source of this batch's noise, from its beginning."""
        return torch.Generator().manual_seed(self.draw)

    @property
    def mean_audio(self) -> Tensor:
        """(N, F)."""
        return (self.audio * self.mask[..., None]).sum(dim=1) / self.mask.sum(dim=1, keepdim=True)


def piece_tensors(network: DancingToMusic, units: UnitSet, codes: np.ndarray, device: torch.device | str) -> Pieces:
    """Units, and the codes (N, S, 32, C) of their pieces, as the networks take them."""
    batch = collate(units.units)
    numbers = [network.dances.index(unit.dance) if unit.dance in network.dances else -1 for unit in units.units]
    with torch.no_grad():
        poses = network.standardised(torch.from_numpy(codes).to(device))
        audio = network.audio_scale(torch.from_numpy(batch.audio).to(device))
    return Pieces(poses, audio, torch.from_numpy(batch.mask).to(device), torch.tensor(numbers, device=device))


def divergence(code: Code) -> Tensor:
    """Divergence (nats) from the standard normal: summed over a code's numbers, mean over everything else."""
    mean, logvar = code
    return 0.5 * (mean.square() + logvar.exp() - 1 - logvar).sum(dim=-1).mean()


def ramp(epoch: int, params: LeeParams) -> float:
    """Weight of the divergences in epoch `epoch` of the units' phase: a logistic ramp over shares of its epochs.

    >>> round(ramp(80, LeeParams(unit_epochs=270)) / 0.01, 2)
    0.49
    """
    share = (epoch + 0.5) / max(params.unit_epochs, 1)
    return params.kl_weight / (1 + float(np.exp((params.ramp_midpoint - share) / params.ramp_width)))


# Style


def style_terms(network: DancingToMusic, style: Tensor, batch: Pieces) -> Terms:
    """Cross-entropy of the dance by the style (N, 30) of its music."""
    return {"dance": cross_entropy(network.music.verdict(style), batch.dance)}


# Units


class CodedUnits(NamedTuple):
    """Units (2 N, 32, C) under two shifts, first all under one, and what the coder makes of them.

    `own` and `cross` are decoded with the z_move of the same shift and of the other one; `single` are the poses
    (2 N, 4, C) at `frames`, coded alone.
    """

    poses: Tensor
    z_init: Code
    z_move: Code
    drawn: Tensor
    own: Tensor
    cross: Tensor
    frames: Tensor
    single: Tensor


def shifted(network: DancingToMusic, poses: Tensor, generator: torch.Generator) -> Tensor:
    """Poses (N, 32, C), each moved to the side and up by one random offset for all joints: that of the root."""
    params, root = network.params, 3 * network.root
    offsets = 2 * torch.rand(len(poses), 1, 2, generator=generator) - 1
    metres = offsets * torch.tensor([params.shift_x, params.shift_y])
    moved = poses.clone()
    moved[..., root : root + 2] += metres.to(poses) / network.pose_scale.std[root : root + 2]
    return moved


def coded_units(network: DancingToMusic, batch: Pieces) -> CodedUnits:
    """Every unit under two shifts through the coder, and decoded with either's movement, in one call each."""
    generator, units = batch.generator, batch.poses.flatten(0, 1)
    poses = torch.cat([shifted(network, units, generator), shifted(network, units, generator)])
    frames = torch.randint(poses.shape[1], (network.params.pose_frames,), generator=generator).to(poses.device)
    z_init, z_move = network.poses(poses[:, 0]), network.movements(poses)
    drawn_init, drawn_move = z_init.drawn(generator), z_move.drawn(generator)
    other = drawn_move.roll(len(units), dims=0)
    own, cross = network.unit_decoder(drawn_init.repeat(2, 1), torch.cat([drawn_move, other])).chunk(2)
    single = network.poses.decoded(network.poses(poses[:, frames]).drawn(generator))
    return CodedUnits(poses, z_init, z_move, drawn_move, own, cross, frames, single)


def unit_terms(output: CodedUnits, weight: float) -> Terms:
    """Errors of both shifts added up; `weight` times the divergences; those of z_move alone in nats ("nats")."""
    one, other = output.drawn.chunk(2)
    move = divergence(output.z_move)
    return {
        "own": 2 * l1_loss(output.own, output.poses),
        "cross": 2 * l1_loss(output.cross, output.poses),
        "single": 2 * l1_loss(output.single, output.poses[:, output.frames]),
        "same": l1_loss(one, other),
        "kl": weight * (divergence(output.z_init) + move),
        "nats": move.detach(),
    }


# Composition


class Composed(NamedTuple):
    """Dances of a batch as codes: recorded ones rebuilt, and ones from music.

    Parameters
    ----------
    units : Code (N, S, Z), of the recorded units, as the frozen coder has them
    poses : (N, S, 32, C), decoded from the rebuilt units
    real, fake : Code (N, Z) of z_dance, from the recorded units and from music
    real_drawn, fake_drawn : (N, Z)
    real_units, fake_units : Code (N, S, Z), composed of either
    style : (N, 30)
    """

    units: Code
    poses: Tensor
    real: Code
    fake: Code
    real_drawn: Tensor
    fake_drawn: Tensor
    real_units: Code
    fake_units: Code
    style: Tensor


def composed(network: DancingToMusic, batch: Pieces) -> Composed:
    """Recorded sequences through both coders and back, and sequences to the same music."""
    generator, (count, sequence) = batch.generator, batch.poses.shape[:2]
    pieces = batch.poses.flatten(0, 1)
    with torch.no_grad():  # coders of the earlier phases are frozen
        flat, z_init = network.movements(pieces), network.poses(pieces[:, 0]).mean
        style = network.music(batch.audio, batch.mask)
    units = Code(*(part.unflatten(0, (count, sequence)) for part in flat))
    real = network.dance_coder(units)
    noise = torch.randn(count, network.params.noise, generator=generator).to(style)
    fake = network.style_coder(style, noise)
    real_drawn, fake_drawn = real.drawn(generator), fake.drawn(generator)
    both = network.dance_decoder(torch.cat([real_drawn, fake_drawn]), sequence)
    real_units, fake_units = (Code(*parts) for parts in zip(*(part.chunk(2) for part in both), strict=True))
    poses = network.unit_decoder(z_init, real_units.drawn(generator).flatten(0, 1)).unflatten(0, (count, sequence))
    return Composed(units, poses, real, fake, real_drawn, fake_drawn, real_units, fake_units, style)


def verdicts(network: DancingToMusic, output: Composed, batch: Pieces) -> dict[str, tuple[Tensor, Tensor]]:
    """Logits (N,) of each critic, of rebuilt dances and of those from music; no gradient through either."""
    audio = batch.mean_audio
    codes = {"units": (output.real_units, output.fake_units), "dance": (output.real, output.fake)}
    critics = {"units": network.unit_critic, "dance": network.dance_critic}
    return {
        name: (critics[name](real.both.detach().flatten(1), audio), critics[name](fake.both.detach().flatten(1), audio))
        for name, (real, fake) in codes.items()
    }


def critic_terms(network: DancingToMusic, output: Composed, batch: Pieces) -> Terms:
    """Binary cross-entropy of each critic, of real and of fake codes."""
    return {
        f"critic_{name}": _entropy(real, 1.0) + _entropy(fake, 0.0)
        for name, (real, fake) in verdicts(network, output, batch).items()
    }


def composition_terms(network: DancingToMusic, output: Composed, batch: Pieces) -> Terms:
    """The composer's terms: rebuilding, divergences, what both critics say of dances from music, style."""
    audio, units, rebuilt = batch.mean_audio, output.units, output.real_units
    flat = network.unit_critic(output.fake_units.both.flatten(1), audio)
    style = [network.regressor(code) for code in (output.real_drawn, output.fake_drawn)]
    return {
        "kl": divergence(output.real) + divergence(rebuilt),
        "means": l1_loss(rebuilt.mean, units.mean),
        "logvars": l1_loss(rebuilt.logvar, units.logvar),
        "poses": l1_loss(output.poses, batch.poses),
        "gan": _entropy(flat, 1.0) + _entropy(network.dance_critic(output.fake.both, audio), 1.0),
        "style": mse_loss(style[0], output.style) + mse_loss(style[1], output.style),
    }


def _entropy(logits: Tensor, target: float) -> Tensor:
    """Binary cross-entropy of logits whose answer is `target` throughout."""
    return binary_cross_entropy_with_logits(logits, torch.full_like(logits, target))
