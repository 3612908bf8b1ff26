"""The training of Lee et al. 2019 in three phases: style of music, coder of units, composition; in a folder of its own.

The folder is that of HarmoGAN's training (`harmolab.systems.harmogan.train`) without a pose network and without
pretrained weights.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from lightning_fabric import Fabric
from numpy.typing import NDArray
from torch import nn

from harmolab.io.files import PathLike, plain
from harmolab.systems.common.history import Report
from harmolab.systems.common.layers import Statistics, channel_statistics
from harmolab.systems.common.phases import Phase, Player, fit, make_fabric
from harmolab.systems.common.runs import finish_run, open_run
from harmolab.systems.common.shards import Batching, Tensors, check_shards
from harmolab.systems.common.splits import Split
from harmolab.systems.common.units import UnitSet
from harmolab.systems.lee2019.measures import code_error, critic_accuracy, rebuilt, speed, style_accuracy
from harmolab.systems.lee2019.networks import DancingToMusic, from_root
from harmolab.systems.lee2019.params import LeeParams
from harmolab.systems.lee2019.pieces import piece_set
from harmolab.systems.lee2019.terms import (
    Pieces,
    coded_units,
    composed,
    composition_terms,
    critic_terms,
    piece_tensors,
    ramp,
    style_terms,
    unit_terms,
)

VALIDATE_EVERY = 10  # epochs
LEAST_STD = 1e-3  # of a number of a pose: the root of a body never moves to the side


def train_lee2019(
    split: Split,
    folder: PathLike,
    *,
    params: LeeParams,
    resume: bool = False,
    fabric: Fabric | None = None,
    report: Report = lambda row, end: None,
) -> DancingToMusic:
    """Train the networks of Lee et al. 2019 and keep everything about it in `folder`.

    Parameters
    ----------
    split : Split of units by motion group
    folder : created; must be new or empty unless `resume`
    params : LeeParams
    resume : go on where the run in `folder` stopped; start it when there is none
    fabric : from `make_fabric`
    report : called with each epoch's row of the history and the epoch that its phase ends at

    Raises
    ------
    ValueError
        If `folder` holds something and `resume` is off, holds a run with other settings or a damaged one, or another
        process trains in it; if units have too few beats for `params.sequence` pieces; if a batch cannot be shared by
        so many processes.
    """
    fabric, folder = fabric or make_fabric(), Path(folder)
    batching = Batching(max(1, params.batch_size // params.sequence), params.shards, params.seed)
    check_shards(len(split.train), batching, fabric.world_size)
    settings = plain({"lee2019": params, "features": split.train.features, "data": split.train.source})
    with open_run(fabric, split, folder, settings, seed=params.seed, resume=resume):
        codes = piece_set(split.train, beats=params.beats, sequence=params.sequence)
        network = initial_network(split.train, codes, params)
        fabric.to_device(network)
        train = piece_tensors(network, split.train, codes, fabric.device)
        validation = split_pieces(network, split.validation, fabric.device)
        steps = phases(network, validation, params)
        fit(fabric, steps, train, batching, folder, settings=settings, resume=resume, report=report)
        finish_run(fabric, split, folder, settings, network)
    return network


def split_pieces(network: DancingToMusic, units: UnitSet, device: torch.device | str = "cpu") -> Pieces:
    """The pieces of a side of a split, cut as the network's own were."""
    codes = piece_set(units, beats=network.params.beats, sequence=network.params.sequence)
    return piece_tensors(network, units, codes, device)


def initial_network(units: UnitSet, codes: NDArray[np.float32], params: LeeParams) -> DancingToMusic:
    """Untrained networks of the run's seed that normalise by the training units and their pieces (N, S, 32, C)."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(params.seed)
        network = DancingToMusic(
            params, units.skeleton, torch.as_tensor(units.bone_lengths, dtype=torch.float32),
            features=units.features, dances=sorted({unit.dance for unit in units.units}),
        )  # fmt: skip
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

    Parameters
    ----------
    network : DancingToMusic, on the device
    validation : pieces on the device
    params : schedule and weights
    """
    return [_style(network, validation, params), _units(network, validation, params),
            _composition(network, validation, params)]  # fmt: skip


def _style(network: DancingToMusic, validation: Pieces, params: LeeParams) -> Phase:
    """The music classifier whose last state is the style."""
    listener = Player(
        "style",
        [*network.music.parameters()],
        lambda output, shard, row: style_terms(network, output, shard.own),
        {"dance": 1.0},
        clip=params.clip,
    )
    return Phase(
        "style",
        params.style_epochs,
        rate=lambda number: params.style_rate,
        modules={"network": network},
        players=[listener],
        forward=lambda shard, last: network.music(shard.own.audio, shard.own.mask),
        validate=lambda: {"val_style": style_accuracy(network, validation)},
        validate_every=VALIDATE_EVERY,
    )


def _units(network: DancingToMusic, validation: Pieces, params: LeeParams) -> Phase:
    """The coder of units: every unit under two shifts."""
    parts: tuple[nn.Module, ...] = (network.poses, network.movements, network.unit_decoder)
    coder = Player(
        "units",
        [parameter for part in parts for parameter in part.parameters()],
        lambda output, shard, row: unit_terms(output, row["kl_weight"]),
        {"own": 1.0, "cross": 1.0, "single": 1.0, "same": 1.0, "kl": 1.0, "nats": 0.0},
        clip=params.clip,
    )
    return Phase(
        "units",
        params.unit_epochs,
        rate=lambda number: params.rate,
        modules={"network": network},
        players=[coder],
        forward=lambda shard, last: coded_units(network, shard.own),
        schedule=lambda number: {"kl_weight": ramp(number, params)},
        validate=lambda: validate_units(network, validation),
        validate_every=VALIDATE_EVERY,
    )


def _composition(network: DancingToMusic, validation: Pieces, params: LeeParams) -> Phase:
    """Critics and composer in turn on every batch; the unit decoder goes on at a share of the rate."""
    critics = Player(
        "critics",
        [*network.unit_critic.parameters(), *network.dance_critic.parameters()],
        lambda output, shard, row: critic_terms(network, output, shard.own),
        {"critic_units": 1.0, "critic_dance": 1.0},
        clip=params.clip,
    )
    parts: tuple[nn.Module, ...] = (
        network.dance_coder, network.dance_decoder, network.style_coder, network.regressor,
    )  # fmt: skip
    composing = {"params": [parameter for part in parts for parameter in part.parameters()]}
    decoding = {"params": [*network.unit_decoder.parameters()], "share": params.decoder_share}
    groups: list[dict[str, Any]] = [composing, decoding]
    composer = Player(
        "composer",
        groups,
        lambda output, shard, row: composition_terms(network, output, shard.own),
        {"kl": params.kl_weight, "means": 1.0, "logvars": 1.0, "poses": params.pose_weight, "gan": 1.0,
         "style": params.style_weight},
        clip=params.clip,
    )  # fmt: skip
    return Phase(
        "composition",
        params.composition_epochs,
        rate=lambda number: params.rate,
        modules={"network": network},
        players=[critics, composer],
        forward=lambda shard, last: composed(network, shard.own),
        validate=lambda: validate_composition(network, validation),
        validate_every=VALIDATE_EVERY,
    )


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
