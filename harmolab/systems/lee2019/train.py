"""Lee et al. 2019 as a system, and its training in three phases: style of music, coder of units, composition.

The system is trained networks, and the movements that their dances start from. It is measured on known figures,
held-out music and codes: how much have the networks learnt?

A training has a folder of its own, that of HarmoGAN's training (`harmolab.systems.harmogan.train`) without a pose
network and without pretrained weights.
"""

import zlib
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy, l1_loss, mse_loss

from harmolab.files import PathLike
from harmolab.systems.lee2019.networks import Code, DancingToMusic, from_root, piece_set
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import Statistics, channel_statistics, decode, drawn_by
from harmolab.systems.training.loop import Batching, Phase, Player, Rows, Tensors, Terms, make_fabric
from harmolab.systems.training.network_system import PresetSystem
from harmolab.systems.training.runs import open_run, pose_bank
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import UnitSet, collate
from harmolab.types import SingleArray

# Batches, the networks' output for them in each phase, and its loss terms


@dataclass(frozen=True, eq=False)
class Pieces(Rows):
    """Training sequences on a device (`harmolab.systems.training.loop.Units`).

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

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> Self:
        """The sequences at `indices` that fall to process `rank` of `world`, with noise of their own."""
        draw = zlib.crc32(np.append(indices.cpu().numpy(), rank).astype("<i8").tobytes())
        return replace(super().take(indices, rank, world), draw=draw)

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
    fake = network.style_coder(style, torch.randn(count, network.params.noise, generator=generator).to(style))
    real_drawn, fake_drawn = real.drawn(generator), fake.drawn(generator)
    both = network.dance_decoder(torch.cat([real_drawn, fake_drawn]), sequence)
    (real_mean, fake_mean), (real_logvar, fake_logvar) = both.mean.chunk(2), both.logvar.chunk(2)
    real_units, fake_units = Code(real_mean, real_logvar), Code(fake_mean, fake_logvar)
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


# Measures of how much the networks have learnt

CHUNK = 128  # pieces at a time


@torch.no_grad()
def rebuilt(network: DancingToMusic, pieces: Tensor) -> Tensor:
    """Pieces (N, 32, C) coded and decoded, by the means of their codes."""
    parts = pieces.split(CHUNK)
    decoded = [network.unit_decoder(network.poses(part[:, 0]).mean, network.movements(part).mean) for part in parts]
    return torch.cat(decoded)


def code_error(network: DancingToMusic, poses: Tensor, pieces: Tensor) -> float:
    """Mean absolute difference of units and pieces (N, 32, C), in standard deviations of the motion code."""
    scale = network.motion_scale
    return float((scale(network.motion(poses)) - scale(network.motion(pieces))).abs().mean())


def speed(network: DancingToMusic, poses: Tensor) -> float:
    """Mean joint speed of units (N, 32, C), metres per canonical frame."""
    return float(torch.linalg.vector_norm(decode(network.motion(poses), network.fps).diff(dim=1), dim=-1).mean())


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


# The training

VALIDATE_EVERY = 10  # epochs
LEAST_STD = 1e-3  # of a number of a pose: the root of a body never moves to the side


def train_lee2019(split: Split, options: TrainOptions, params: LeeParams) -> DancingToMusic:
    """Train the networks of Lee et al. 2019 on units and keep everything about it in the folder of `options`.

    Raises
    ------
    ValueError
        As `open_run`; if units have too few beats for `params.sequence` pieces.
    """
    fabric, units = make_fabric(accelerator=options.accelerator), split.train
    batching = Batching(max(1, params.batch_size // params.sequence), params.shards, params.seed)
    settings = {"lee2019": params, "features": units.features, "data": units.source}
    with open_run(fabric, options, split, settings, batching, len(units)) as run:
        run.save_movements(lambda: pose_bank(units, seed=params.seed))
        codes = piece_set(units, beats=params.beats, sequence=params.sequence)
        network = initial_network(units, codes, params)
        fabric.to_device(network)
        train = piece_tensors(network, units, codes, fabric.device)
        run.fit(phases(network, split_pieces(network, split.validation, fabric.device), params), train)
        run.save(network, {"settings": run.settings, "source": units.source, "units": len(units)})
    return network


def split_pieces(network: DancingToMusic, units: UnitSet, device: torch.device | str = "cpu") -> Pieces:
    """The pieces of a side of a split, cut as the network's own were."""
    codes = piece_set(units, beats=network.params.beats, sequence=network.params.sequence)
    return piece_tensors(network, units, codes, device)


def initial_network(units: UnitSet, codes: SingleArray, params: LeeParams) -> DancingToMusic:
    """Untrained networks of the run's seed that normalise by the training units and their pieces (N, S, 32, C)."""
    lengths = torch.as_tensor(units.bone_lengths, dtype=torch.float32)
    dances = sorted({unit.dance for unit in units.units})
    with drawn_by(params.seed):
        network = DancingToMusic(params, units.skeleton, lengths, features=units.features, dances=dances)
    train = Tensors.of(units)
    network.set_statistics(Statistics.of(train.audio, train.motion, train.mask))
    poses = from_root(torch.from_numpy(codes), network.root).flatten(1, 2)
    mean, std = channel_statistics(poses, torch.ones(poses.shape[:2]))
    offsets = torch.zeros_like(std)
    offsets[3 * network.root : 3 * network.root + 2] = torch.tensor([params.shift_x, params.shift_y])
    # An even offset adds a third of the square of the largest.
    network.pose_scale.set(mean, (std.square() + offsets.square() / 3).sqrt().clamp(min=LEAST_STD))
    return network


def phases(network: DancingToMusic, validation: Pieces, params: LeeParams) -> list[Phase]:
    """Style of music; coder of units; composition with critics and composer in turn.

    While composing, the unit decoder goes on learning at a share of the rate.

    Parameters
    ----------
    network : DancingToMusic, on the device
    validation : pieces on the device
    params : schedule and weights
    """
    common: dict[str, Any] = {"modules": {"network": network}, "validate_every": VALIDATE_EVERY}
    listener = Player(
        "style", _parameters(network.music),
        lambda style, shard, row: {"dance": cross_entropy(network.music.verdict(style), shard.own.dance)},
        {"dance": 1.0}, clip=params.clip,
    )  # fmt: skip
    coder = Player(
        "units", _parameters(network.poses, network.movements, network.unit_decoder),
        lambda output, shard, row: unit_terms(output, row["kl_weight"]),
        {"own": 1.0, "cross": 1.0, "single": 1.0, "same": 1.0, "kl": 1.0, "nats": 0.0}, clip=params.clip,
    )  # fmt: skip
    critics = Player(
        "critics", _parameters(network.unit_critic, network.dance_critic),
        lambda output, shard, row: critic_terms(network, output, shard.own),
        {"critic_units": 1.0, "critic_dance": 1.0}, clip=params.clip,
    )  # fmt: skip
    composing = _parameters(network.dance_coder, network.dance_decoder, network.style_coder, network.regressor)
    decoding: dict[str, Any] = {"params": _parameters(network.unit_decoder), "share": params.decoder_share}
    composer = Player(
        "composer", [{"params": composing}, decoding],
        lambda output, shard, row: composition_terms(network, output, shard.own),
        {"kl": params.kl_weight, "means": 1.0, "logvars": 1.0, "poses": params.pose_weight, "gan": 1.0,
         "style": params.style_weight},
        clip=params.clip,
    )  # fmt: skip
    return [
        Phase("style", params.style_epochs, lambda number: params.style_rate, players=[listener],
              forward=lambda shard, last: network.music(shard.own.audio, shard.own.mask),
              validate=lambda: {"val_style": style_accuracy(network, validation)}, **common),
        Phase("units", params.unit_epochs, lambda number: params.rate, players=[coder],
              forward=lambda shard, last: coded_units(network, shard.own),
              schedule=lambda number: {"kl_weight": ramp(number, params)},
              validate=lambda: validate_units(network, validation), **common),
        Phase("composition", params.composition_epochs, lambda number: params.rate, players=[critics, composer],
              forward=lambda shard, last: composed(network, shard.own),
              validate=lambda: validate_composition(network, validation), **common),
    ]  # fmt: skip


def _parameters(*parts: nn.Module) -> list[nn.Parameter]:
    """The parameters of some parts of the networks."""
    return [parameter for part in parts for parameter in part.parameters()]


def validate_units(network: DancingToMusic, validation: Pieces) -> dict[str, float]:
    """Of unseen pieces, rebuilt: error in standard deviations, and speed by that of the recorded ones."""
    pieces = validation.poses.flatten(0, 1)
    again = rebuilt(network, pieces)
    return {
        "val_error": code_error(network, again, pieces),
        "val_speed": speed(network, again) / max(speed(network, pieces), 1e-6),
    }


def validate_composition(network: DancingToMusic, validation: Pieces) -> dict[str, float]:
    """The same, and how often each critic is right on unseen sequences."""
    right = {f"val_critic_{name}": value for name, value in critic_accuracy(network, validation).items()}
    return validate_units(network, validation) | right


# The system


class Lee2019(PresetSystem):
    """Lee et al. 2019, "Dancing to Music": dances that are composed of learnt units of four beats.

    It is written anew from facts about the public code and trained on our units; it is not the authors' model. Units
    are warped to the beats of the music. `generate`, `train` and `load` are those of all systems (`System`).

    Parameters
    ----------
    generator : DancingToMusic
        The trained networks.
    poses : PoseBank, optional
        Movements to start from. Without them: the mean pose at rest.
    meta : JSON-able mapping
        About its training; kept with the weights.
    """

    network = DancingToMusic
    settings = LeeParams
    train_network = staticmethod(train_lee2019)

    @classmethod
    def learn(cls, data: list[PathLike], options: TrainOptions, *, epochs: int | None = None, **own: Any) -> None:
        """Train on corpora; `train` calls it, and takes these keywords.

        Parameters
        ----------
        epochs : int or None
            Of the phase of units, and of that of compositions; the preset's when left out.
        **own
            ``preset`` ("small" or "paper"), ``step`` (beats from one training unit to the next), ``split_seed``, or
            other values for fields of `LeeParams`, such as ``seed``.
        """
        phases: dict[str, Any] = {} if epochs is None else dict.fromkeys(("unit_epochs", "composition_epochs"), epochs)
        super().learn(data, options, **phases, **own)
