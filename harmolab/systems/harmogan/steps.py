"""Loss terms of one batch by name: of pretraining, of the discriminators and of the generator (Eq. 24-32)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor, nn

from harmolab.params import HarmonyParams
from harmolab.skeletons import foot_joints
from harmolab.systems.common.batches import Tensors
from harmolab.systems.common.pose_network import PoseNet
from harmolab.systems.common.soft_harmony import SoftHarmony, soft_harmony
from harmolab.systems.common.torch_code import local_joints
from harmolab.systems.harmogan.networks import (
    CrossDomainDiscriminator,
    Generator,
    GeneratorOutput,
    SpatialTemporalDiscriminator,
)
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.harmogan.terms import (
    above_chance_loss,
    charbonnier_mse,
    discriminator_loss,
    energy_loss,
    feature_loss,
    foot_loss,
    generator_gan_loss,
    harmony_loss,
    jerk_loss,
    kl_loss,
)
from harmolab.types import Skeleton


@dataclass(frozen=True, eq=False)
class Networks:
    """Everything that is trained, and the pose network that judges features and is not."""

    generator: Generator
    cross_domain: CrossDomainDiscriminator
    spatial_temporal: SpatialTemporalDiscriminator
    pose_net: PoseNet

    def modules(self) -> dict[str, nn.Module]:
        """The trained networks by name."""
        return {
            "generator": self.generator,
            "cross_domain": self.cross_domain,
            "spatial_temporal": self.spatial_temporal,
        }

    def discriminators(self, params: TrainParams) -> list[nn.Parameter]:
        """Parameters of the discriminators that the generator's loss has a part for."""
        judges = [self.cross_domain, self.spatial_temporal] if params.cross_domain_weight else [self.spatial_temporal]
        return [parameter for judge in judges for parameter in judge.parameters()]


class Danced(NamedTuple):
    """What a generator makes of a batch, and, if asked, of other music from where an earlier dance ended.

    Parameters
    ----------
    own : GeneratorOutput, to the batch's own music from recorded movement
    later : the units whose music is danced to next, and the motion code (N, T, C) of that; None if nobody asked
    """

    own: GeneratorOutput
    later: tuple[Tensors, Tensor] | None = None


def danced(generator: Generator, batch: Tensors, others: Tensors | None = None, last: Danced | None = None) -> Danced:
    """The generator's dance to a batch; and to the music of `others`, from where its `last` one to others' music ended.

    So batch by batch a dance grows as long as that of a song. Without `last` it begins where the batch's recorded
    movement ends. `others` has as many units as the batch, `last` may have had more.
    """
    if others is None:
        return Danced(generator(batch.audio, batch.initial))
    before, mask = batch.motion, batch.mask
    if last is not None and last.later is not None:
        before, mask = last.later[1][: len(others)].detach(), last.later[0].mask[: len(others)]
    later = others.continued_from(before, mask)
    # In one call: a recurrent layer takes its time for each frame, whether ten units take the step or twenty.
    made = generator(torch.cat([batch.audio, later.audio]), torch.cat([batch.initial, later.initial]))
    own, after = (GeneratorOutput(*pair) for pair in zip(*(part.chunk(2) for part in made), strict=True))
    return Danced(own, (later, after.motion))


def flat_poses(motion: Tensor) -> Tensor:
    """The recorded 2-D poses V_2d, (N, T, J, 2), of coded motion (N, T, C): x and y as seen from the front."""
    return local_joints(motion)[..., :2]


def meter_span(batch: Tensors, fps: float) -> Tensor:
    """Start and end (seconds) of each clip's own meter, without the beats before it; (N, 2)."""
    prior, length = (batch.index * batch.mask).sum(dim=1), batch.mask.sum(dim=1)
    return torch.stack([prior, length], dim=1) / fps


def score_batch(generator: Generator, motion: Tensor, batch: Tensors, tau: float, params: HarmonyParams) -> SoftHarmony:
    """Relaxed harmony of coded motion (N, T, C) with its music, over each clip's own meter."""
    return soft_harmony(
        generator.positions(motion),
        batch.beats,
        batch.strengths,
        batch.beat_mask,
        batch.mask,
        fps=generator.fps,
        tau=tau,
        params=params,
        span=meter_span(batch, generator.fps),
    )


def pose_terms(generator: Generator, made: GeneratorOutput, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """L_kl over the 2-D poses and L_mse over the standardised motion (Eq. 24-25)."""
    flat = flat_poses(batch.motion)
    return {
        "kl": kl_loss(made.flat, flat, batch.mask),
        "mse": motion_error(generator, made.motion, batch, params.epsilon),
    }


def motion_error(generator: Generator, made: Tensor, batch: Tensors, epsilon: float) -> Tensor:
    """L_mse (Eq. 25) of coded motion (N, T, C), every channel in standard deviations of the training split."""
    scale = generator.motion_scale
    return charbonnier_mse(scale(made), scale(batch.motion), batch.index, batch.mask, epsilon=epsilon)


def discriminator_terms(networks: Networks, made: Danced, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """The losses (Eq. 29-30) of the discriminators that are heard, on recorded and on generated motion, both coded.

    The spatial-temporal one judges movement alone, so it also sees what was danced to other music.
    """
    motion = made.own.motion.detach()
    recorded = networks.spatial_temporal(batch.motion, batch.mask)
    terms = {"critic_st": discriminator_loss(recorded, networks.spatial_temporal(motion, batch.mask))}
    if params.cross_domain_weight:
        real = networks.cross_domain(batch.audio, batch.motion, batch.mask)
        terms["critic_cd"] = discriminator_loss(real, networks.cross_domain(batch.audio, motion, batch.mask))
    if made.later is not None:
        later, after = made.later
        more = discriminator_loss(recorded, networks.spatial_temporal(after.detach(), later.mask))
        terms["critic_st"] = (terms["critic_st"] + more) / 2
    return terms


def generator_terms(
    networks: Networks, made: Danced, batch: Tensors, params: TrainParams, tau: float
) -> dict[str, Tensor]:
    """Every term of the generator's hybrid loss (Eq. 32) whose weight is not zero, before weighting.

    Where `made` goes on to other music, half of the terms that need no recorded answer are of that part.
    """
    generator, motion = networks.generator, made.own.motion
    terms = pose_terms(generator, made.own, batch, params)
    if params.feature_weight:
        net = networks.pose_net
        terms["feature"] = feature_loss(
            net.features(batch.motion, batch.mask), net.features(motion, batch.mask), epsilon=params.epsilon
        )
    free = _free_terms(networks, motion, batch, params, tau)
    if made.later is not None:
        later, after = made.later
        more = _free_terms(networks, after, later, params, tau, same_dance=False)
        free = {name: (value + more[name]) / 2 for name, value in free.items()}
    return terms | free


def _free_terms(
    networks: Networks, motion: Tensor, batch: Tensors, params: TrainParams, tau: float, *, same_dance: bool = True
) -> dict[str, Tensor]:
    """L_gan, L_harmo, jerk, energy and feet of coded motion (N, T, C), which may be another dance than the recorded."""
    terms: dict[str, Tensor] = {}
    if params.gan_weight:
        weight = params.cross_domain_weight
        together = networks.cross_domain(batch.audio, motion, batch.mask) if weight else None
        movement = networks.spatial_temporal(motion, batch.mask)
        terms["gan"] = generator_gan_loss(together, movement, cross_domain_weight=weight)
    if params.harmony_weight:
        terms["harmony"] = _harmony_term(networks.generator, motion, batch, params, tau)
    return terms | _natural_terms(networks.generator, motion, batch, params, same_dance=same_dance)


def _harmony_term(generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, tau: float) -> Tensor:
    """L_harmo: the paper's (Eq. 27), or the chance-corrected one."""
    if params.harmony == "paper":
        score = score_batch(generator, motion, batch, tau, HarmonyParams.paper())
        return harmony_loss(score, count_weight=params.count_weight)
    score = score_batch(generator, motion, batch, tau, HarmonyParams.valleys())
    return above_chance_loss(score, count_weight=params.count_weight)


def _natural_terms(
    generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, *, same_dance: bool
) -> dict[str, Tensor]:
    """Terms that keep movement natural while harmony pulls at it; none in paper mode, no "foot" for nameless feet."""
    terms: dict[str, Tensor] = {}
    feet = _feet(generator.skeleton) if params.foot_weight else ()
    if params.smoothness_weight or params.energy_weight or feet:
        made, target = generator.positions(motion), generator.positions(batch.motion)
        if params.smoothness_weight:
            terms["smoothness"] = jerk_loss(made, target, batch.mask, fps=generator.fps)
        if params.energy_weight:
            terms["energy"] = energy_loss(made, target, batch.mask)
        if feet:
            terms["foot"] = foot_loss(made, target, batch.mask, feet=feet, fps=generator.fps, same_dance=same_dance)
    return terms


@cache
def _feet(skeleton: Skeleton) -> tuple[int, ...]:
    """All joints of feet; none where the names tell of none."""
    try:
        return tuple(joint for foot in foot_joints(skeleton) for joint in foot)
    except ValueError:
        return ()
