"""One step of training on a part of a batch: the dance, and the terms of each player's loss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from harmolab.systems.common.shards import Shard, Tensors, Terms, drawn_by
from harmolab.systems.common.torch_code import decode
from harmolab.systems.ren2020.networks import GlobalDiscriminator, LocalDiscriminator, RenGenerator
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.ren2020.st_gcn import STGCN
from harmolab.systems.ren2020.terms import (
    deceiving_loss,
    discriminator_loss,
    gradient_penalty,
    matching_loss,
    perceptual_loss,
    pose_loss,
)


@dataclass(frozen=True, eq=False)
class Networks:
    """A generator, those that judge it half a second at a time and as a whole, and the frozen ST-GCN."""

    generator: RenGenerator
    local: LocalDiscriminator
    overall: GlobalDiscriminator
    st_gcn: STGCN

    def modules(self) -> dict[str, nn.Module]:
        """The networks that training changes, by name."""
        return {"generator": self.generator, "local": self.local, "overall": self.overall}


class Danced(NamedTuple):
    """Codes (N, T, C) danced and recorded, and the music (N, T, F), all in standard deviations; mask (N, T); a seed."""

    code: Tensor
    target: Tensor
    audio: Tensor
    mask: Tensor
    seed: int


def danced(generator: RenGenerator, shard: Shard) -> Danced:
    """A dance to each clip's music, with noise and dropout drawn by the shard's seed."""
    units: Tensors = shard.own
    with drawn_by(shard.seed, units.mask.device):
        code = generator(units.audio, units.mask, generator.noise(*units.mask.shape))
    scaled = generator.motion_scale(units.motion), generator.audio_scale(units.audio)
    return Danced(code, *scaled, units.mask, shard.seed)


def generator_terms(networks: Networks, dance: Danced, params: RenParams) -> Terms:
    """The terms that the generator lowers."""
    overall, mask = networks.overall, dance.mask
    with torch.no_grad():
        music = overall.music(dance.audio, mask)
        recorded_maps, recorded_features = (
            overall.maps(dance.target, mask),
            networks.st_gcn.features(dance.target, mask),
        )
    maps = overall.maps(dance.code, mask)
    features = networks.st_gcn.features(dance.code, mask)
    return {
        "pose": pose_loss(dance.code, dance.target, mask),
        "perceptual": perceptual_loss(features, recorded_features, params.block_weights),
        "feature": matching_loss(maps, recorded_maps),
        "local": deceiving_loss(*networks.local(dance.code, mask)),
        "global": deceiving_loss(overall.judge(music, maps[-1])),
    }


def local_terms(networks: Networks, dance: Danced) -> Terms:
    """The loss of the local discriminator."""
    both = torch.cat([dance.target, dance.code.detach()])
    (real, fake), (counted, _) = (each.chunk(2) for each in networks.local(both, dance.mask.repeat(2, 1)))
    return {"critic_local": discriminator_loss(real, fake, counted)}


def global_terms(networks: Networks, dance: Danced) -> Terms:
    """The loss of the global discriminator, and its gradient penalty in single precision."""
    overall, mask, fake = networks.overall, dance.mask, dance.code.detach()
    music = overall.music(dance.audio, mask)
    last = overall.maps(torch.cat([dance.target, fake]), mask.repeat(2, 1))[-1]
    verdicts = overall.judge(music.repeat(2, 1), last).chunk(2)
    with drawn_by(dance.seed, mask.device), torch.autocast(mask.device.type, enabled=False):
        fixed_music = music.detach().float()
        penalty = gradient_penalty(
            lambda code: overall.judge(fixed_music, overall.maps(code, mask)[-1]),
            dance.target.float(),
            fake.float(),
            mask,
        )
    return {"critic_global": discriminator_loss(*verdicts), "penalty": penalty}


@torch.no_grad()
def danced_units(generator: RenGenerator, units: Tensors, *, seed: int) -> Tensor:
    """Codes (N, T, C) in standard deviations of dances to units' music, as a song is danced: nothing left out."""
    was_training = generator.training
    with drawn_by(seed, units.mask.device):
        code: Tensor = generator.eval()(units.audio, units.mask, generator.noise(*units.mask.shape))
    generator.train(was_training)
    return code


@torch.no_grad()
def speed_ratio(generator: RenGenerator, code: Tensor, units: Tensors) -> float:
    """Mean speed of the joints in codes (N, T, C, in standard deviations) over that of the recorded units."""
    scale = generator.motion_scale
    pairs = ((units.mask[:, 1:] * units.mask[:, :-1])[..., None], code * scale.std + scale.mean, units.motion)
    steps = [decode(each, generator.fps).diff(dim=1).norm(dim=-1) * pairs[0] for each in pairs[1:]]
    return float(steps[0].sum() / steps[1].sum())
