"""Ren et al. 2020 as a system, its loss terms, and its training: the ST-GCN, then generator and discriminators.

The system is a generator that makes a whole dance from music and noise in one pass. Each loss term is a mean over
clips; padding never counts. Codes are motion codes in standard deviations; masks are 1 at real frames.

Generator and discriminators step in turn. A training has a folder of its own:

==========================  ==================================================================
settings.json               every setting, and what it was trained on
split.json                  which motion groups and units are for training, validation, test
st_gcn.safetensors/.json    the network behind the pose perceptual loss
history.csv, events.*       losses and validation, epoch by epoch (a table; TensorBoard)
state.safetensors           everything needed to go on after a kill
model.safetensors/.json     the generator; `harmolab dance --weights RUN` takes it
==========================  ==================================================================
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from harmolab.systems.ren2020.networks import STGCN, GlobalDiscriminator, LocalDiscriminator, RenGenerator, settle
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.training.checkpoints import Report, TrainOptions
from harmolab.systems.training.layers import Statistics, decode, drawn_by
from harmolab.systems.training.loop import Batching, Phase, Player, Shard, Tensors, Terms, make_fabric
from harmolab.systems.training.network_system import PresetSystem
from harmolab.systems.training.pose_network import train_on_lesson
from harmolab.systems.training.runs import open_run, pose_bank
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import UnitSet
from harmolab.systems.training.weights import load_weights

# Loss terms of the generator and of its two discriminators

Map = tuple[Tensor, Tensor]  # (N, channels, T) and its mask (N, T)


def pose_loss(code: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """L1 of the poses: the mean difference of codes (N, T, C) over real frames and channels."""
    return _over_frames((code.float() - target).abs().mean(dim=-1), mask).mean()


def perceptual_loss(maps: Sequence[Tensor], targets: Sequence[Tensor], weights: Sequence[float]) -> Tensor:
    """Weighted sum of the mean differences between the ST-GCN's maps of danced and recorded clips.

    Parameters
    ----------
    maps, targets : a tensor (N, channels, frames, J) for each block
    weights : of the blocks
    """
    blocks = zip(weights, maps, targets, strict=True)
    return torch.stack([weight * (ours - theirs).abs().mean() for weight, ours, theirs in blocks]).sum()


def matching_loss(maps: Sequence[Map], targets: Sequence[Map]) -> Tensor:
    """Feature matching: the sum over a discriminator's maps of their mean difference on danced and recorded clips."""
    pairs = zip(maps, targets, strict=True)
    return torch.stack([_over_frames((a - b).abs().mean(dim=1), mask).mean() for (a, mask), (b, _) in pairs]).sum()


def deceiving_loss(logits: Tensor, counted: Tensor | None = None) -> Tensor:
    """Cross-entropy of a discriminator's verdicts on danced clips with "recorded", which the generator lowers.

    Parameters
    ----------
    logits : (N,) tensor, or (N, W) for every window of a clip
    counted : (N, W) tensor, 1 for windows that count
    """
    return _verdicts(softplus(-logits), counted)


def discriminator_loss(real: Tensor, fake: Tensor, counted: Tensor | None = None) -> Tensor:
    """Cross-entropy of the verdicts on recorded clips with "recorded", and of those on danced clips with "danced"."""
    return _verdicts(softplus(-real), counted) + _verdicts(softplus(fake), counted)


def gradient_penalty(judge: Callable[[Tensor], Tensor], real: Tensor, fake: Tensor, mask: Tensor) -> Tensor:
    """The squared distance from one of a discriminator's slope, at poses between recorded and danced ones.

    As in Gulrajani et al. 2017; the music is not mixed. Torch's generator of random numbers draws where in between.

    Parameters
    ----------
    judge : function(codes (N, T, C)) -> logits (N,)
    real, fake : (N, T, C) codes, in single precision
    mask : (N, T)
    """
    share = torch.rand(len(real), 1, 1).to(real.device)
    mixed = torch.lerp(fake, real, share).detach().requires_grad_()
    (slope,) = torch.autograd.grad(judge(mixed).sum(), mixed, create_graph=True)
    length = torch.linalg.vector_norm((slope * mask[..., None]).flatten(1), dim=1)
    return (length - 1).square().mean()


def _verdicts(losses: Tensor, counted: Tensor | None) -> Tensor:
    """Mean over clips of losses (N,), or of their means over the windows (N, W) that count."""
    return losses.mean() if counted is None else _over_frames(losses, counted).mean()


def _over_frames(values: Tensor, mask: Tensor) -> Tensor:
    """(N,): means of (N, T) where the mask is 1; 0 for a clip where nothing counts."""
    return (values * mask).sum(dim=1) / mask.sum(dim=1).clamp(min=1.0)


# One step of training on a part of a batch


class Networks(NamedTuple):
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
        recorded_maps, recorded = overall.maps(dance.target, mask), networks.st_gcn.features(dance.target, mask)
    maps, features = overall.maps(dance.code, mask), networks.st_gcn.features(dance.code, mask)
    return {
        "pose": pose_loss(dance.code, dance.target, mask),
        "perceptual": perceptual_loss(features, recorded, params.block_weights),
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

        def judge(code: Tensor) -> Tensor:
            return overall.judge(fixed_music, overall.maps(code, mask)[-1])

        penalty = gradient_penalty(judge, dance.target.float(), fake.float(), mask)
    return {"critic_global": discriminator_loss(*verdicts), "penalty": penalty}


@torch.no_grad()
def speed_ratio(generator: RenGenerator, code: Tensor, units: Tensors) -> float:
    """Mean speed of the joints in codes (N, T, C, in standard deviations) over that of the recorded units."""
    scale = generator.motion_scale
    both = (units.mask[:, 1:] * units.mask[:, :-1])[..., None]
    codes = (code * scale.std + scale.mean, units.motion)
    danced, recorded = (decode(each, generator.fps).diff(dim=1).norm(dim=-1) * both for each in codes)
    return float(danced.sum() / recorded.sum())


# The training

ST_GCN = "st_gcn"
VALIDATE_EVERY = 10  # epochs


def train_ren2020(split: Split, options: TrainOptions, params: RenParams) -> RenGenerator:
    """Train a generator on units and keep everything about it in the folder of `options`.

    Before the epochs of the history those of the ST-GCN are reported: phase ("ST-GCN"), epoch, train, validation.

    Raises
    ------
    ValueError
        As `open_run`.
    """
    fabric, units = make_fabric(accelerator=options.accelerator), split.train
    batching = Batching(params.batch_size, params.shards, params.seed)
    settings = {"train": params, "features": units.features, "data": units.source}
    with open_run(fabric, options, split, settings, batching, len(units)) as run:
        run.save_movements(lambda: pose_bank(units, seed=params.seed))
        stem = run.train_once(ST_GCN, lambda: _st_gcn(split, params, options.report), params.seed)
        st_gcn = load_weights(stem, STGCN).requires_grad_(False)
        train, validation = (Tensors.of(side, fabric.device) for side in (units, split.validation))
        networks = _networks(units, train, st_gcn, params)
        for part in (*networks.modules().values(), st_gcn):
            fabric.to_device(part)
        run.fit([adversarial(networks, train, validation, params)], train)
        run.save(networks.generator.eval(), {"settings": run.settings, "source": units.source, "units": len(units)})
    return networks.generator


def _st_gcn(split: Split, params: RenParams, report: Report) -> STGCN:
    """The trained ST-GCN."""
    units = split.train
    return train_on_lesson(
        lambda: STGCN(units.skeleton, params.graph, fps=units.features.fps, frames=params.graph_frames),
        units, split.validation, seed=params.seed, epochs=params.graph_epochs,
        progress=lambda row: report({"phase": "ST-GCN", **row}, params.graph_epochs),
    )  # fmt: skip


def _networks(units: UnitSet, train: Tensors, st_gcn: STGCN, params: RenParams) -> Networks:
    """Fresh networks that know the training split's statistics; the same for the same seed."""
    features = units.features
    lengths = torch.as_tensor(units.bone_lengths, dtype=torch.float32)
    with drawn_by(params.seed):
        generator = RenGenerator(params, features.n_audio, units.skeleton, lengths, fps=features.fps, features=features)
        local = LocalDiscriminator(params, generator.n_motion)
        overall = GlobalDiscriminator(params, features.n_audio, generator.n_motion)
    generator.set_statistics(Statistics.of(train.audio, train.motion, train.mask))
    return Networks(generator, local, overall, st_gcn)


def adversarial(networks: Networks, train: Tensors, validation: Tensors, params: RenParams) -> Phase:
    """Generator first, then the two discriminators, one step each on every batch; all learn from the same dances."""
    return Phase(
        "adversarial", params.epochs, lambda number: params.generator_rate, networks.modules(),
        players(networks, params), forward=lambda shard, last: danced(networks.generator, shard),
        validate=lambda: validate(networks.generator, train, validation, params), validate_every=VALIDATE_EVERY,
    )  # fmt: skip


def players(networks: Networks, params: RenParams) -> list[Player]:
    """The generator, the local and the global discriminator, with their losses and rates."""
    terms = ("pose", "perceptual", "feature", "local", "global")
    local, overall = (
        [{"params": [*network.parameters()], "share": rate / params.generator_rate}]
        for network, rate in ((networks.local, params.local_rate), (networks.overall, params.global_rate))
    )
    return [
        Player("generator", [*networks.generator.parameters()],
               lambda dance, shard, row: generator_terms(networks, dance, params),
               {name: getattr(params, f"{name}_weight") for name in terms}),
        Player("local", local, lambda dance, shard, row: local_terms(networks, dance),
               {"critic_local": params.discriminator_weight}),
        Player("overall", overall, lambda dance, shard, row: global_terms(networks, dance),
               {"critic_global": params.discriminator_weight, "penalty": params.penalty_weight}),
    ]  # fmt: skip


def validate(generator: RenGenerator, train: Tensors, validation: Tensors, params: RenParams) -> dict[str, float]:
    """Settle batch normalisation on the training units; error and speed on the validation units.

    Returns
    -------
    dict of val_pose (L1 in standard deviations), val_speed (mean joint speed over the recorded one)
    """
    settle(generator, train.audio, train.mask, seed=params.seed)
    code = generator.drawn(validation.audio, validation.mask, params.seed)
    generator.train()
    return {
        "val_pose": float(pose_loss(code, generator.motion_scale(validation.motion), validation.mask)),
        "val_speed": speed_ratio(generator, code, validation),
    }


# The system


class Ren2020(PresetSystem):
    """Ren et al. 2020: a trained network that makes a whole dance from music and noise in one pass.

    Another seed has other noise, and another movement to go on from. `generate`, `train` and `load` are those of all
    systems (`System`); ``preset`` ("small" or "paper") and fields of `RenParams` are keywords of `train`.

    Parameters
    ----------
    generator : RenGenerator
        That knows its audio features.
    poses : PoseBank, optional
        Movements to go on from. Without them: the mean pose at rest.
    meta : JSON-able mapping
        About its training; kept with the weights.
    """

    network = RenGenerator
    settings = RenParams
    train_network = staticmethod(train_ren2020)
