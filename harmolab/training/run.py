"""From folders of recordings to a trained generator in a folder of its own.

==========================  ==================================================================
settings.json               every setting, and what it was trained on
split.json                  which motion groups and units are for training, validation, test
pose_net.safetensors/.json  the network behind the feature loss and the Frechet distance
history.csv, events.*       losses and validation, epoch by epoch (a table; TensorBoard)
state.safetensors           everything needed to go on after a kill
pretrained.safetensors/...  the generator before its adversarial epochs
model.safetensors/.json     the generator; `harmolab dance --weights RUN` takes it
==========================  ==================================================================
"""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric

from harmolab.data.splits import Split
from harmolab.data.units import UnitSet
from harmolab.io.files import PathLike
from harmolab.models.harmogan import CrossDomainCritic, Generator, SpatialTemporalCritic, Statistics
from harmolab.models.pose_features import PoseNet, train_pose_net
from harmolab.models.poses_bank import pose_bank, poses_path, save_poses
from harmolab.models.weights import load_generator, load_pose_net, save_weights
from harmolab.params import ModelParams, TrainParams
from harmolab.training.batches import Tensors
from harmolab.training.folders import check_pretrained, open_folder
from harmolab.training.history import Report
from harmolab.training.loop import PRETRAINED, fit, settings_of
from harmolab.training.schedule import epoch_order
from harmolab.training.steps import Networks

__all__ = ["MODEL", "POSE_NET", "make_fabric", "train_harmogan"]

MODEL, POSE_NET = "model", "pose_net"


def make_fabric(*, accelerator: str = "auto", precision: Any = None) -> Fabric:
    """Fabric for this process: alone, or one of those that torchrun started.

    Parameters
    ----------
    accelerator : "auto", "cpu" or "cuda"
    precision : "32-true" or "bf16-mixed"; None is bf16 where a GPU computes in it, else 32 bit

    Raises
    ------
    ValueError
        If this machine has no such accelerator.
    """
    world, local = (int(os.environ.get(name, 1)) for name in ("WORLD_SIZE", "LOCAL_WORLD_SIZE"))
    if accelerator == "cuda" and not torch.cuda.is_available():
        raise ValueError("accelerator cuda: this machine has no GPU that torch can use; choose cpu or auto")
    if precision is None:
        gpu = accelerator != "cpu" and torch.cuda.is_available() and torch.cuda.is_bf16_supported()
        precision = "bf16-mixed" if gpu else "32-true"
    fabric = Fabric(
        accelerator=accelerator,
        devices=local,
        num_nodes=max(world // local, 1),
        strategy="ddp" if world > 1 else "auto",
        precision=precision,
    )
    fabric.launch()
    return fabric


def train_harmogan(
    split: Split,
    folder: PathLike,
    *,
    model: ModelParams,
    params: TrainParams,
    resume: bool = False,
    pretrained: PathLike | None = None,
    fabric: Fabric | None = None,
    report: Report = lambda row: None,
) -> Generator:
    """Train a generator and keep everything about it in `folder`.

    Parameters
    ----------
    split : Split of units by motion group
    folder : created; must be new or empty unless `resume`
    model : sizes
    params : schedule and loss weights
    resume : go on where the run in `folder` stopped; start it when there is none
    pretrained : folder of another run on the same data, whose pretraining and pose network are taken over
    fabric : from `make_fabric`
    report : called with each epoch's row of the history; before them with the pose network's epochs: phase
        ("pose network"), epoch, train, validation

    Raises
    ------
    ValueError
        If `folder` holds something and `resume` is off, holds a run with other settings or a damaged one, or another
        process trains in it; if `pretrained` is a run on other data; if a batch cannot be shared by so many processes.
    """
    fabric, folder = fabric or make_fabric(), Path(folder)
    pretrained = None if pretrained is None else Path(pretrained)
    _check_shares(len(split.train), params, fabric.world_size)
    params = params if pretrained is None else replace(params, pretrain_epochs=0)
    settings = settings_of(
        model=model,
        train=params,
        features=split.train.features,
        data=split.train.source,
        pretrained=pretrained is not None,
    )
    if pretrained is not None:
        check_pretrained(pretrained, settings, split)
    first = fabric.is_global_zero
    with open_folder(folder, settings, split, resume=resume) if first else nullcontext():
        if first and not poses_path(folder / MODEL).is_file():
            save_poses(folder / MODEL, pose_bank(split.train, seed=params.seed))
        fabric.barrier()
        pose_net = _pose_net(fabric, split, folder, params, pretrained, report)
        train, validation = (Tensors.of(units, fabric.device) for units in (split.train, split.validation))
        networks = _networks(split.train, train, model, pose_net, params.seed)
        if pretrained is not None:
            networks.generator.load_state_dict(load_generator(pretrained / PRETRAINED).state_dict())
        for part in (*networks.modules().values(), pose_net):
            fabric.to_device(part)
        fit(fabric, networks, train, validation, params, folder, settings=settings, resume=resume, report=report)
        if first:
            about = {"settings": settings, "source": split.train.source, "units": len(split.train)}
            save_weights(folder / MODEL, networks.generator, about)
    return networks.generator


def _check_shares(n_units: int, params: TrainParams, world: int) -> None:
    """ValueError unless every process gets equally many shards, and every shard a unit of every batch."""
    shards = max(params.shards, world)
    smallest = min(len(batch) for batch in epoch_order(n_units, 0, params))
    if shards % world:
        raise ValueError(f"{shards} shards cannot be spread evenly over {world} processes")
    if smallest < shards:
        raise ValueError(f"batches of {smallest} units cannot be cut into {shards} shards; {smallest} at most")


def _pose_net(
    fabric: Fabric, split: Split, folder: Path, params: TrainParams, pretrained: Path | None, report: Report
) -> PoseNet:
    """The pose network: taken over, or trained once by the first process."""
    if fabric.is_global_zero and not (folder / f"{POSE_NET}.json").is_file():
        if pretrained is None:
            net = train_pose_net(
                split.train,
                split.validation,
                seed=params.seed,
                epochs=params.pose_epochs,
                progress=lambda row: report({"phase": "pose network", **row}),
            )
        else:
            net = load_pose_net(pretrained / POSE_NET)
        save_weights(folder / POSE_NET, net, {"seed": params.seed})
    fabric.barrier()
    return load_pose_net(folder / POSE_NET).requires_grad_(False)


def _networks(units: UnitSet, train: Tensors, model: ModelParams, pose_net: PoseNet, seed: int) -> Networks:
    """Fresh networks that know the training split's statistics; the same for the same seed."""
    n_audio, skeleton = units.features.n_audio, units.skeleton
    lengths = torch.as_tensor(units.bone_lengths, dtype=torch.float32)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        generator = Generator(model, n_audio, skeleton, lengths, fps=units.features.fps, features=units.features)
        cross, temporal = CrossDomainCritic(model, n_audio, skeleton), SpatialTemporalCritic(model, skeleton)
    statistics = Statistics.of(train.audio, train.motion, train.mask)
    for part in (generator, cross, temporal):
        part.set_statistics(statistics)
    return Networks(generator, cross, temporal, pose_net)
