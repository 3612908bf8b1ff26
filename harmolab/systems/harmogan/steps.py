"""Loss terms of one batch by name: of pretraining, of the discriminators and of the generator (Eq. 24-32)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor, nn

from harmolab.params import HarmonyParams
from harmolab.skeletons import foot_joints, named_joints
from harmolab.systems.common.pose_network import PoseNet
from harmolab.systems.common.shards import Tensors
from harmolab.systems.common.soft_harmony import SoftHarmony, soft_harmony
from harmolab.systems.common.torch_code import PATH_CHANNELS, local_joints
from harmolab.systems.harmogan.natural_terms import (
    energy_loss,
    foot_loss,
    jerk_loss,
    mean_spread,
    net_turning,
    path_loss,
    spread_loss,
)
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
    feature_loss,
    generator_gan_loss,
    harmony_loss,
    kl_loss,
)
from harmolab.types import Skeleton

TINY = 1e-3  # metres, and radians per second: next to no spread and no turning


@dataclass(frozen=True, eq=False)
class Networks:
    """The trained networks, and the pose network of the feature loss, which is not trained."""

    generator: Generator
    cross_domain: CrossDomainDiscriminator
    spatial_temporal: SpatialTemporalDiscriminator
    pose_net: PoseNet

    def modules(self) -> dict[str, nn.Module]:
        """The trained networks by name."""
        return {name: getattr(self, name) for name in ("generator", "cross_domain", "spatial_temporal")}

    def discriminators(self, params: TrainParams) -> list[nn.Parameter]:
        """Parameters of the discriminators that the generator's loss has a part for."""
        parameters = [*self.spatial_temporal.parameters()]
        return [*self.cross_domain.parameters(), *parameters] if params.cross_domain_weight else parameters


class Danced(NamedTuple):
    """A generator's output for a batch, and its rollout to other music from the end of an earlier dance.

    Parameters
    ----------
    own : GeneratorOutput, to the batch's own music from recorded movement
    later : the units of the rollout, and its motion code (N, T, C); None without rollout
    """

    own: GeneratorOutput
    later: tuple[Tensors, Tensor] | None = None


def danced(generator: Generator, batch: Tensors, others: Tensors | None = None, last: Danced | None = None) -> Danced:
    """The generator's dance to a batch, and a rollout: to the music of `others`, from the end of the `last` rollout.

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
    output = generator(torch.cat([batch.audio, later.audio]), torch.cat([batch.initial, later.initial]))
    own, after = (GeneratorOutput(*pair) for pair in zip(*(part.chunk(2) for part in output), strict=True))
    return Danced(own, (later, after.motion))


def meter_span(batch: Tensors, fps: float) -> Tensor:
    """Start and end (seconds) of each clip's own meter, without the beats before it; (N, 2)."""
    prior, length = (batch.index * batch.mask).sum(dim=1), batch.mask.sum(dim=1)
    return torch.stack([prior, length], dim=1) / fps


def score_batch(
    generator: Generator, positions: Tensor, batch: Tensors, tau: float, params: HarmonyParams
) -> SoftHarmony:
    """Relaxed harmony of joints (N, T, J, 3) with the batch's music, over each clip's own meter."""
    return soft_harmony(
        positions, batch.beats, batch.strengths, batch.beat_mask, batch.mask,
        fps=generator.fps, tau=tau, params=params, span=meter_span(batch, generator.fps),
    )  # fmt: skip


def body_joints(generator: Generator, motion: Tensor) -> Tensor:
    """Joints from the root in the dancer's heading, (N, T, J, 3) metres, of coded motion: no travel, turns or jumps."""
    joints, parents = local_joints(motion), generator.skeleton.parents
    root = parents.index(-1) if -1 in parents else 0
    return joints - joints[:, :, root : root + 1]


def seen_joints(generator: Generator, motion: Tensor, params: TrainParams) -> Tensor:
    """Joints (N, T, J, 3) of coded motion where harmony and energy see them: in the room or in the body."""
    return generator.positions(motion) if params.harmony_frame == "room" else body_joints(generator, motion)


def meter_mask(batch: Tensors) -> Tensor:
    """(N, T), 1 at the frames of each clip's own meter: those before it (TI = 1) are thrown away in a dance."""
    return batch.mask * (1 - batch.index)


def pose_terms(generator: Generator, output: GeneratorOutput, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """L_kl over the 2-D poses and L_mse over the standardised motion (Eq. 24-25)."""
    flat = local_joints(batch.motion)[..., :2]  # recorded 2-D poses V_2d: x and y as seen from the front
    error = motion_error(generator, output.motion, batch, params.epsilon)
    return {"kl": kl_loss(output.flat, flat, batch.mask), "mse": error}


def motion_error(generator: Generator, motion: Tensor, batch: Tensors, epsilon: float) -> Tensor:
    """L_mse (Eq. 25) of coded motion (N, T, C), every channel in standard deviations of the training split."""
    scale = generator.motion_scale
    return charbonnier_mse(scale(motion), scale(batch.motion), batch.index, batch.mask, epsilon=epsilon)


def discriminator_terms(networks: Networks, dances: Danced, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """The losses (Eq. 29-30) of the discriminators that have a weight, on recorded and on generated coded motion.

    The spatial-temporal one judges movement alone, so half of its loss is of the rollout, if there is one.
    """
    motion = dances.own.motion.detach()
    recorded = networks.spatial_temporal(batch.motion, batch.mask)
    terms = {"critic_st": discriminator_loss(recorded, networks.spatial_temporal(motion, batch.mask))}
    if params.cross_domain_weight:
        real = networks.cross_domain(batch.audio, batch.motion, batch.mask)
        terms["critic_cd"] = discriminator_loss(real, networks.cross_domain(batch.audio, motion, batch.mask))
    if dances.later is not None:
        later, after = dances.later
        more = discriminator_loss(recorded, networks.spatial_temporal(after.detach(), later.mask))
        terms["critic_st"] = (terms["critic_st"] + more) / 2
    return terms


def generator_terms(
    networks: Networks, dances: Danced, batch: Tensors, params: TrainParams, tau: float
) -> dict[str, Tensor]:
    """Terms of the generator's hybrid loss (Eq. 32) whose weight is not zero, before weighting.

    With a rollout, half of each term that needs no recorded answer is of the rollout.
    """
    generator, motion = networks.generator, dances.own.motion
    terms = pose_terms(generator, dances.own, batch, params)
    if params.feature_weight:
        maps = [networks.pose_net.features(each, batch.mask) for each in (batch.motion, motion)]
        terms["feature"] = feature_loss(*maps, epsilon=params.epsilon)
    free = _free_terms(networks, motion, batch, params, tau)
    if dances.later is not None:
        later, after = dances.later
        more = _free_terms(networks, after, later, params, tau, same_dance=False)
        free = {name: (value + more[name]) / 2 for name, value in free.items()}
    return terms | free


def _free_terms(
    networks: Networks, motion: Tensor, batch: Tensors, params: TrainParams, tau: float, *, same_dance: bool = True
) -> dict[str, Tensor]:
    """L_gan, L_harmo and natural terms of coded motion (N, T, C), which may be another dance than the recorded."""
    terms: dict[str, Tensor] = {}
    if params.gan_weight:
        weight = params.cross_domain_weight
        together = networks.cross_domain(batch.audio, motion, batch.mask) if weight else None
        movement = networks.spatial_temporal(motion, batch.mask)
        terms["gan"] = generator_gan_loss(together, movement, cross_domain_weight=weight)
    if params.harmony_weight:
        paper = params.harmony == "paper"  # else the chance-corrected score
        settings = HarmonyParams.paper() if paper else HarmonyParams.valleys()
        joints = seen_joints(networks.generator, motion, params)
        score = score_batch(networks.generator, joints, batch, tau, settings)
        terms["harmony"] = (harmony_loss if paper else above_chance_loss)(score, count_weight=params.count_weight)
    return terms | _natural_terms(networks.generator, motion, batch, params, same_dance=same_dance)


def _natural_terms(
    generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams, *, same_dance: bool
) -> dict[str, Tensor]:
    """Terms that keep movement natural while harmony pulls at it; none in paper mode, no "foot" for nameless feet."""
    terms = _variety_terms(generator, motion, batch, params)
    feet = _feet(generator.skeleton) if params.foot_weight else ()
    if params.smoothness_weight or feet:
        positions, target = generator.positions(motion), generator.positions(batch.motion)
        if params.smoothness_weight:
            terms["smoothness"] = jerk_loss(positions, target, batch.mask, fps=generator.fps)
        if feet:
            terms["foot"] = foot_loss(
                positions, target, batch.mask, feet=feet, fps=generator.fps, same_dance=same_dance
            )
    return terms


def _variety_terms(generator: Generator, motion: Tensor, batch: Tensors, params: TrainParams) -> dict[str, Tensor]:
    """Energy, path and spread against the recorded units of the batch."""
    terms: dict[str, Tensor] = {}
    if params.energy_weight:
        ours, theirs = (seen_joints(generator, each, params) for each in (motion, batch.motion))
        counted = batch.mask if params.harmony_frame == "room" else meter_mask(batch)
        terms["energy"] = energy_loss(ours, theirs, counted)
    if params.path_weight:
        ours, theirs = (each[..., -PATH_CHANNELS:] for each in (motion, batch.motion))
        terms["path"] = path_loss(ours, theirs, meter_mask(batch))
    if params.spread_weight:
        ours, theirs = local_joints(motion), local_joints(batch.motion)
        ankles = _ankles(generator.skeleton)
        terms["spread"] = spread_loss(ours, theirs, meter_mask(batch), fps=generator.fps, ankles=ankles)
    return terms


@cache
def _ankles(skeleton: Skeleton) -> tuple[int, int] | None:
    """The left and the right ankle; None without joints of that name."""
    joints = named_joints(skeleton)
    left, right = (joints.get((side, "ankle")) for side in ("left", "right"))
    return None if left is None or right is None else (left, right)


def likeness_ratios(generator: Generator, motion: Tensor, batch: Tensors) -> dict[str, float]:
    """Spread and turning of generated over recorded units: as much of a guard of likeness as short clips can show.

    Returns
    -------
    dict of spread, the mean distance of the joints from their mean place in the clip, and turning, the mean size of the
    clips' mean yaw rate; 1 is as recorded
    """
    counted = meter_mask(batch)
    ours, theirs = (
        (mean_spread(local_joints(each), counted), net_turning(each[..., -1], counted))
        for each in (motion, batch.motion)
    )
    names = ("spread", "turning")
    return {name: float((a + TINY) / (b + TINY)) for name, a, b in zip(names, ours, theirs, strict=True)}


@cache
def _feet(skeleton: Skeleton) -> tuple[int, ...]:
    """All joints of feet; none without joint names of feet."""
    try:
        return tuple(joint for foot in foot_joints(skeleton) for joint in foot)
    except ValueError:
        return ()
