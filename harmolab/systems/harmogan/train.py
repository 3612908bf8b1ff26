"""HarmoGAN's training: two phases, pretraining and adversarial epochs (paper Sec. 5.2), in a folder of its own.

==========================  ==================================================================
settings.json               every setting, and what it was trained on
split.json                  which motion groups and units are for training, validation, test
pose_net.safetensors/.json  the network behind the feature loss and the Frechet distance
history.csv, events.*       losses and validation, epoch by epoch (a table; TensorBoard)
state.safetensors           everything needed to go on after a kill
pretrained.safetensors/...  the generator before its adversarial epochs
sketches/                   the movement whose dances it corrects, if it does
model.safetensors/.json     the generator; `harmolab dance --weights RUN` takes it
==========================  ==================================================================
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from harmolab.files import PathLike, plain
from harmolab.params import BarPattern, HarmonyParams
from harmolab.soft_score import anneal
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan import losses
from harmolab.systems.harmogan.networks import Generator, Networks, load_generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.harmogan.sketches import SKETCHES
from harmolab.systems.training.about import json_file
from harmolab.systems.training.checkpoints import Measure, Report, TrainOptions, check_pretrained
from harmolab.systems.training.loop import Batching, Phase, Player, Tensors, make_fabric
from harmolab.systems.training.pose_network import PoseNet, load_pose_net, train_pose_net
from harmolab.systems.training.runs import open_run, pose_bank
from harmolab.systems.training.splits import Split
from harmolab.systems.training.weights import save_weights
from harmolab.types import BeatTrack, Motion

POSE_NET, PRETRAINED = "pose_net", "pretrained"
VALIDATE_EVERY = 5  # pretraining epochs; adversarial epochs are all validated
MEASURED = 64  # validation units at most that `TrainOptions.measure` is asked about
Validate = Callable[[], dict[str, float]]
HARD = 1e-8  # softness at which the relaxed score is the hard one


def train_harmogan(
    split: Split, options: TrainOptions, *, model: ModelParams, params: TrainParams, pretrained: PathLike | None = None,
    choreographer: Choreographer | None = None,
    patterns: Sequence[BarPattern] = (),
) -> Generator:  # fmt: skip
    """Train a generator and keep everything about it in the folder of `options`.

    Parameters
    ----------
    split : Split of units by motion group, with sketches where `params` has some
    options : TrainOptions; before the epochs of the history it reports those of the pose network: phase ("pose
        network"), epoch, train, validation
    model : sizes
    params : schedule and loss weights
    pretrained : folder of another run on the same data, whose pretraining and pose network are taken over
    choreographer : of the units' sketches, to be kept in the run
    patterns : bar patterns that the units name by number

    Raises
    ------
    ValueError
        As `open_run`; if `pretrained` is a run on other data, or without pretraining.
    """
    before = None if pretrained is None else Path(pretrained)
    model = replace(model, bounded=params.sketches > 0)
    if before is not None:
        params = replace(params, pretrain_epochs=0)
    fabric, units = make_fabric(accelerator=options.accelerator), split.train
    records = {"model": model, "train": params, "features": units.features, "data": units.source}
    settings = plain(records | {"pretrained": before is not None})
    if before is not None:
        check_pretrained(before, settings, split, options.corpus)
        if not json_file(before / PRETRAINED).is_file():
            raise ValueError(f"{before}: has no pretraining to take over; leave --pretrained out")
    batching = Batching(params.batch_size, params.shards, params.seed)
    with open_run(fabric, options, split, settings, batching, len(units)) as run:
        if choreographer is None:
            run.save_movements(lambda: pose_bank(units, seed=params.seed))
        elif fabric.is_global_zero:
            choreographer.save(run.folder / SKETCHES)
        stem = run.train_once(POSE_NET, lambda: _pose_net(split, params, before, options.report), params.seed)
        pose_net = load_pose_net(stem).requires_grad_(False)
        train, validation = (Tensors.of(side, fabric.device) for side in (units, split.validation))
        networks = Networks.fresh(units, train, model, pose_net, params.seed)
        if before is not None:
            networks.generator.load_state_dict(load_generator(before / PRETRAINED).state_dict())
        for part in (*networks.modules().values(), pose_net):
            fabric.to_device(part)
        run.fit(phases(networks, validation, params, run.folder, run.settings, patterns, options.measure), train)
        run.save(networks.generator, {"settings": run.settings, "source": units.source, "units": len(units)})
    return networks.generator


def _pose_net(split: Split, params: TrainParams, pretrained: Path | None, report: Report) -> PoseNet:
    """The pose network, from `pretrained` or trained now."""
    if pretrained is not None:
        return load_pose_net(pretrained / POSE_NET)
    return train_pose_net(
        split.train, split.validation, seed=params.seed, epochs=params.pose_epochs,
        progress=lambda row: report({"phase": "pose network", **row}, params.pose_epochs),
    )  # fmt: skip


def phases(
    networks: Networks, validation: Tensors, params: TrainParams, folder: Path, settings: dict[str, Any],
    patterns: Sequence[BarPattern] = (), measure: Measure = TrainOptions.measure,
) -> list[Phase]:  # fmt: skip
    """Pretraining of the generator alone, then discriminators and generator in turn.

    Parameters
    ----------
    networks : Networks, on the device
    validation : units on the device
    params : schedule and loss weights
    folder : of the run; ``pretrained.safetensors`` and ``.json`` are kept in it
    settings : JSON-able; kept beside those weights
    patterns : bar patterns that the units name by number
    measure : as in `TrainOptions`
    """
    validated = partial(validate, networks.generator, validation, params, measure)
    first = _pretraining(networks, params, folder, settings, validated)
    return [first, _adversarial(networks, params, patterns, validated)]


def _pretraining(
    networks: Networks, params: TrainParams, folder: Path, settings: dict[str, Any], validated: Validate
) -> Phase:
    """L_pretrain = 0.1 L_kl + L_mse; ends with the best epoch."""
    generator = networks.generator
    learner = Player(
        "generator",
        [*generator.parameters()],
        lambda output, shard, row: losses.pose_terms(generator, output, shard.own, params),
        {"kl": params.pretrain_kl_weight, "mse": 1.0},
    )
    return Phase(
        "pretrain",
        params.pretrain_epochs,
        rate=lambda number: pretrain_rate(number, params),
        modules={"generator": generator},
        players=[learner],
        forward=lambda shard, last: generator(shard.own.audio, shard.own.initial),
        schedule=lambda number: {"tau": ""},
        validate=validated,
        validate_every=VALIDATE_EVERY,
        patience=params.patience,
        keep=lambda: save_weights(folder / PRETRAINED, generator, {"settings": settings}),
        recall=lambda: generator.load_state_dict(load_generator(folder / PRETRAINED).state_dict()),
    )


def _adversarial(networks: Networks, params: TrainParams, patterns: Sequence[BarPattern], validated: Validate) -> Phase:
    """Discriminators and generator in turn on every batch (Eq. 28-32)."""
    generator = networks.generator
    discriminators = Player(
        "discriminators",
        networks.discriminators(params),
        lambda output, shard, row: losses.discriminator_terms(networks, output, shard, params),
        {"critic_st": 1.0, "critic_cd": 1.0},
        params.discriminator_decay,
        params.clip,
    )
    dancer = Player(
        "generator",
        [*generator.parameters()],
        lambda output, shard, row: losses.generator_terms(networks, output, shard, params, row["tau"], patterns),
        {name.removesuffix("_weight"): getattr(params, name) for name in vars(params) if name.endswith("_weight")},
        params.generator_decay,
        params.clip,
    )
    return Phase(
        "adversarial",
        params.adversarial_epochs,
        rate=lambda number: adversarial_rate(number, params),
        modules=networks.modules(),
        players=[discriminators, dancer] if params.gan_weight else [dancer],
        forward=lambda shard, last: generator(shard.own.audio, shard.own.initial),
        schedule=lambda number: {"tau": anneal(number, params.adversarial_epochs, params.tau_start, params.tau_end)},
        validate=validated,
    )


def pretrain_rate(epoch: int, params: TrainParams) -> float:
    """Adam's learning rate in pretraining epoch `epoch` (from 0): one factor after every 50 epochs, then it stays.

    >>> [pretrain_rate(epoch, TrainParams.paper()) for epoch in (0, 50, 100)]
    [0.001, 0.0005, 0.0001]
    """
    return params.pretrain_rate * prod(params.pretrain_drops[: epoch // params.pretrain_drop_epochs])


def adversarial_rate(epoch: int, params: TrainParams) -> float:
    """Learning rate of all networks in adversarial epoch `epoch` (from 0): divided by 2 and 5 in turn every 5 epochs.

    >>> [adversarial_rate(epoch, TrainParams.paper()) for epoch in (0, 5, 10)]
    [0.0001, 5e-05, 1e-05]
    """
    drops = islice(cycle(params.adversarial_drops), epoch // params.adversarial_drop_epochs)
    return params.adversarial_rate * prod(drops)


@torch.no_grad()
def validate(
    generator: Generator, units: Tensors, params: TrainParams, measure: Measure = TrainOptions.measure
) -> dict[str, float]:
    """Means over units: error, harmony by the paper and above chance, and what a guard of likeness would ask.

    `measure` is asked about the dances to `MEASURED` of the units at most.

    Returns
    -------
    dict of val_mse, val_harmony, val_hit_rate (paper mode), val_above_chance, val_body_above_chance, val_count_ratio
    (valleys within 0.1 s; of the speed in the room but for the second), val_spread and val_turning (over recorded);
    val_NAME of each number of `measure`
    """
    motion = generator(units.audio, units.initial).motion
    room, body = generator.positions(motion), losses.body_joints(generator, motion)
    paper = losses.score_batch(generator, room, units, HARD, HarmonyParams.paper())
    valleys = losses.score_batch(generator, room, units, HARD, HarmonyParams.valleys())
    in_body = losses.score_batch(generator, body, units, HARD, HarmonyParams.valleys())
    others = losses.likeness_ratios(motion, units) | dict(measure(*_dances(generator, room, units)))
    return {
        "val_mse": float(losses.motion_error(generator, motion, units, params.epsilon)),
        "val_harmony": float(paper.harmony.mean()),
        "val_hit_rate": float(paper.hit_rate.mean()),
        "val_above_chance": float(valleys.above_chance.mean()),
        "val_body_above_chance": float(in_body.above_chance.mean()),
        "val_count_ratio": float(valleys.n_visual.sum() / valleys.n_audio.sum().clamp(min=1.0)),
        **{f"val_{name}": value for name, value in others.items()},
    }


def _dances(generator: Generator, positions: Tensor, units: Tensors) -> tuple[list[Motion], list[BeatTrack]]:
    """Dances and beats of some units evenly through all, from joints (N, T, J, 3), the padding left out."""
    motions, tracks = [], []
    for number in np.unique(np.linspace(0, len(units) - 1, min(len(units), MEASURED)).astype(int)).tolist():
        joints = positions[number, : int(units.mask[number].sum())].double().cpu().numpy()
        motion = Motion(joints, generator.fps, generator.skeleton)
        is_beat = units.beat_mask[number] > 0
        times, strengths = (values[number][is_beat].double().cpu().numpy() for values in (units.beats, units.strengths))
        inside = (times >= 0) & (times <= motion.duration)
        tracks.append(BeatTrack(times[inside], strengths[inside], generator.fps, motion.duration))
        motions.append(motion)
    return motions, tracks
