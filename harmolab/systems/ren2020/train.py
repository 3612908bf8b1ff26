"""Ren et al.'s training: the ST-GCN, then generator and discriminators in turn, in a folder of its own.

==========================  ==================================================================
settings.json               every setting, and what it was trained on
split.json                  which motion groups and units are for training, validation, test
st_gcn.safetensors/.json    the network behind the pose perceptual loss
history.csv, events.*       losses and validation, epoch by epoch (a table; TensorBoard)
state.safetensors           everything needed to go on after a kill
model.safetensors/.json     the generator; `harmolab dance --weights RUN` takes it
==========================  ==================================================================
"""

from __future__ import annotations

from pathlib import Path

import torch
from lightning_fabric import Fabric

from harmolab.io.files import PathLike, plain
from harmolab.systems.common.history import Report
from harmolab.systems.common.layers import Statistics
from harmolab.systems.common.phases import Phase, Player, fit, make_fabric
from harmolab.systems.common.pose_network import train_on_lesson
from harmolab.systems.common.runs import finish_run, open_run
from harmolab.systems.common.shards import Batching, Tensors, check_shards
from harmolab.systems.common.splits import Split
from harmolab.systems.common.units import UnitSet
from harmolab.systems.common.weights import load_weights, save_weights
from harmolab.systems.ren2020.networks import GlobalDiscriminator, LocalDiscriminator, RenGenerator, settle
from harmolab.systems.ren2020.params import RenParams
from harmolab.systems.ren2020.st_gcn import STGCN
from harmolab.systems.ren2020.steps import (
    Networks,
    danced,
    danced_units,
    generator_terms,
    global_terms,
    local_terms,
    speed_ratio,
)
from harmolab.systems.ren2020.terms import pose_loss

ST_GCN = "st_gcn"
VALIDATE_EVERY = 10  # epochs


def train_ren2020(
    split: Split,
    folder: PathLike,
    *,
    params: RenParams,
    resume: bool = False,
    fabric: Fabric | None = None,
    report: Report = lambda row, end: None,
) -> RenGenerator:
    """Train a generator and keep everything about it in `folder`.

    Parameters
    ----------
    split : Split of units by motion group
    folder : created; must be new or empty unless `resume`
    params : sizes, losses and schedule
    resume : go on where the run in `folder` stopped; start it when there is none
    fabric : from `make_fabric`
    report : called with each epoch's row of the history and the epoch that its phase ends at; before them with those of
        the ST-GCN: phase ("ST-GCN"), epoch, train, validation

    Raises
    ------
    ValueError
        If `folder` holds something and `resume` is off, holds a run with other settings or a damaged one, or another
        process trains in it; if a batch cannot be shared by so many processes.
    """
    fabric, folder = fabric or make_fabric(), Path(folder)
    batching = Batching(params.batch_size, params.shards, params.seed)
    check_shards(len(split.train), batching, fabric.world_size)
    settings = plain({"train": params, "features": split.train.features, "data": split.train.source})
    with open_run(fabric, split, folder, settings, seed=params.seed, resume=resume):
        st_gcn = _st_gcn(fabric, split, folder, params, report)
        train, validation = (Tensors.of(units, fabric.device) for units in (split.train, split.validation))
        networks = _networks(split.train, train, st_gcn, params)
        for part in (*networks.modules().values(), st_gcn):
            fabric.to_device(part)
        phase = adversarial(networks, train, validation, params)
        fit(fabric, [phase], train, batching, folder, settings=settings, resume=resume, report=report)
        finish_run(fabric, split, folder, settings, networks.generator.eval())
    return networks.generator


def _st_gcn(fabric: Fabric, split: Split, folder: Path, params: RenParams, report: Report) -> STGCN:
    """The ST-GCN, trained once by the first process."""
    if fabric.is_global_zero and not (folder / f"{ST_GCN}.json").is_file():
        units = split.train
        net = train_on_lesson(
            lambda: STGCN(units.skeleton, params.graph, fps=units.features.fps, frames=params.graph_frames),
            units, split.validation, seed=params.seed, epochs=params.graph_epochs,
            progress=lambda row: report({"phase": "ST-GCN", **row}, params.graph_epochs),
        )  # fmt: skip
        save_weights(folder / ST_GCN, net, {"seed": params.seed})
    fabric.barrier()
    return load_weights(folder / ST_GCN, STGCN).requires_grad_(False)


def _networks(units: UnitSet, train: Tensors, st_gcn: STGCN, params: RenParams) -> Networks:
    """Fresh networks that know the training split's statistics; the same for the same seed."""
    features = units.features
    lengths = torch.as_tensor(units.bone_lengths, dtype=torch.float32)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(params.seed)
        generator = RenGenerator(params, features.n_audio, units.skeleton, lengths, fps=features.fps, features=features)
        local = LocalDiscriminator(params, generator.n_motion)
        overall = GlobalDiscriminator(params, features.n_audio, generator.n_motion)
    generator.set_statistics(Statistics.of(train.audio, train.motion, train.mask))
    return Networks(generator, local, overall, st_gcn)


def adversarial(networks: Networks, train: Tensors, validation: Tensors, params: RenParams) -> Phase:
    """Generator first, then the two discriminators, one step each on every batch; all learn from the same dances."""
    return Phase(
        "adversarial",
        params.epochs,
        rate=lambda number: params.generator_rate,
        modules=networks.modules(),
        players=players(networks, params),
        forward=lambda shard, last: danced(networks.generator, shard),
        validate=lambda: validate(networks.generator, train, validation, params),
        validate_every=VALIDATE_EVERY,
    )


def players(networks: Networks, params: RenParams) -> list[Player]:
    """The generator, the local and the global discriminator, with their losses and rates."""
    terms = ("pose", "perceptual", "feature", "local", "global")
    half = params.discriminator_weight
    return [
        Player(
            "generator",
            [*networks.generator.parameters()],
            lambda dance, shard, row: generator_terms(networks, dance, params),
            {name: getattr(params, f"{name}_weight") for name in terms},
        ),
        Player(
            "local",
            [{"params": [*networks.local.parameters()], "share": params.local_rate / params.generator_rate}],
            lambda dance, shard, row: local_terms(networks, dance),
            {"critic_local": half},
        ),
        Player(
            "overall",
            [{"params": [*networks.overall.parameters()], "share": params.global_rate / params.generator_rate}],
            lambda dance, shard, row: global_terms(networks, dance),
            {"critic_global": half, "penalty": params.penalty_weight},
        ),
    ]


def validate(generator: RenGenerator, train: Tensors, validation: Tensors, params: RenParams) -> dict[str, float]:
    """Settle batch normalisation on the training units; error and speed on the validation units.

    Returns
    -------
    dict of val_pose (L1 in standard deviations), val_speed (mean joint speed over the recorded one)
    """
    settle(generator, train.audio, train.mask, seed=params.seed)
    code = danced_units(generator, validation, seed=params.seed)
    generator.train()
    return {
        "val_pose": float(pose_loss(code, generator.motion_scale(validation.motion), validation.mask)),
        "val_speed": speed_ratio(generator, code, validation),
    }
