"""The training of Music2Dance in two phases (supplement 1.2): from recorded frames, then from its own predictions.

The folder of a run holds ``settings.json``, ``split.json``, ``history.csv``, the state that it resumes from, the
trained weights ``model``, and movements that a dance may go on from.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from lightning_fabric import Fabric
from torch import Tensor

from harmolab.io.files import PathLike, plain
from harmolab.systems.common.about import DEFAULT_STEM
from harmolab.systems.common.history import Report
from harmolab.systems.common.phases import Phase, Player, fit, make_fabric
from harmolab.systems.common.poses_bank import PoseBank, save_poses, spread
from harmolab.systems.common.runs import locked_run
from harmolab.systems.common.shards import Batching, Shard, Terms, check_shards, drawn_by
from harmolab.systems.common.splits import Split
from harmolab.systems.common.weights import save_weights
from harmolab.systems.music2dance.networks import DanceNetwork, Prediction
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.sequences import SequenceSet
from harmolab.systems.music2dance.terms import (
    contact_accuracy,
    contact_loss,
    likelihood_loss,
    majority_contacts,
    squared_error,
    unchanged_contacts,
)
from harmolab.systems.music2dance.windows import Windows, WindowSource, training_windows

VALIDATE_EVERY = 10  # epochs
VALIDATED = 64  # windows at most
BANK = 24  # movements that a dance may go on from
# Share of a window that must be of the validation side to be validated on, where only those frames count.
HELD_OUT = 0.25
DROP = 0.1  # of the rate that is left after a drop


class Predicted(NamedTuple):
    """Both passes over a batch: `second` is None in the first phase; `target` is the motion (N, T, C)."""

    first: Prediction
    second: Prediction | None
    target: Tensor


def train_music2dance(
    split: Split,
    sequences: SequenceSet,
    folder: PathLike,
    *,
    resume: bool = False,
    fabric: Fabric | None = None,
    report: Report = lambda row, end: None,
) -> DanceNetwork:
    """Train the network on whole recordings and keep everything about it in `folder`.

    Parameters
    ----------
    split : Split by motion group, whose groups decide on which side a window is
    sequences : SequenceSet of the same recordings; its `params` are those of the training
    folder : created; must be new or empty unless `resume`
    resume : go on where the run in `folder` stopped; start it when there is none
    fabric : from `make_fabric`
    report : called with each epoch's row of the history and the epoch that its phase ends at

    Raises
    ------
    ValueError
        If `folder` holds something and `resume` is off, holds a run with other settings or a damaged one, or another
        process trains in it; if a side of the split has no window, or a training window a figure of another side; if
        a batch cannot be shared by so many processes.
    """
    fabric, folder, params = fabric or make_fabric(), Path(folder), sequences.params
    source = training_windows(split, sequences, fabric.device)
    held_out = WindowSource.of(
        sequences, split.groups["validation"], dances=sequences.dances, statistics=source.statistics, share=HELD_OUT,
        device=fabric.device,
    )  # fmt: skip
    batching = Batching(params.batch_size, params.shards, params.seed)
    check_shards(len(source), batching, fabric.world_size)
    settings = plain({"music2dance": params, "data": sequences.source})
    with locked_run(fabric, split, folder, settings, resume=resume) as first:
        network = initial_network(sequences, params)
        network.set_statistics(source.statistics)
        fabric.to_device(network)
        phases = [_phase(network, source, held_out, params, second=second) for second in (False, True)]
        fit(fabric, phases, source, batching, folder, settings=settings, resume=resume, report=report)
        settle(network, source)
        if first:
            save_weights(folder / DEFAULT_STEM, network, {"settings": settings, "source": sequences.source})
            save_poses(folder / DEFAULT_STEM, movements(source, seed=params.seed))
    return network


def initial_network(sequences: SequenceSet, params: Music2DanceParams) -> DanceNetwork:
    """An untrained network of the run's seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(params.seed)
        return DanceNetwork(params, sequences.code, sequences.dances)


def _phase(
    network: DanceNetwork, source: WindowSource, held_out: WindowSource, params: Music2DanceParams, *, second: bool
) -> Phase:
    """Teacher forcing, or both passes."""
    name, epochs, rate, drop = (
        ("feedback", params.second_epochs, params.second_rate, params.second_drop)
        if second
        else ("teacher", params.first_epochs, params.first_rate, params.first_drop)
    )
    return Phase(
        name,
        epochs,
        rate=_falling(rate, drop * epochs),
        modules={"network": network},
        players=[
            Player(
                "dancer",
                [*network.parameters()],
                lambda output, shard, row: dance_terms(output, shard.own),
                {"likelihood": 1.0, "contacts": params.contact_weight},
                clip=params.clip,
                optimiser=torch.optim.RMSprop,
            )
        ],
        forward=lambda shard, last: predicted(network, shard, second=second),
        validate=lambda: validate(network, source, held_out),
        validate_every=VALIDATE_EVERY,
    )


def _falling(rate: float, drop: float) -> Callable[[int], float]:
    """A rate that falls to a tenth at epoch `drop`."""
    return lambda number: rate if number < drop else DROP * rate


def predicted(network: DanceNetwork, shard: Shard, *, second: bool) -> Predicted:
    """Every frame predicted from those before it, with noise and dropout; then, `second`, from the predictions.

    Noise is drawn once for a window, so that a noisy target has the noise of the input. The first pass's prediction is
    cut off from the gradient before it is the second's input.
    """
    windows: Windows = shard.own
    params = network.params
    with drawn_by(shard.seed, windows.motion.device):
        noisy = windows.motion + params.noise * torch.randn_like(windows.motion)
        music = network.music_at(windows.music, windows.moments)
        first = network.predicted(noisy, windows.contacts, music, windows.dance, dropout=params.motion_dropout)
        again = None
        if second:
            fed = torch.cat([noisy[:, :1], first.mean[:, 1:]], dim=1).detach()
            standing = torch.cat([windows.contacts[:, :1], (first.contacts[:, 1:] > 0).float()], dim=1)
            again = network.predicted(fed, standing, music, windows.dance, dropout=params.motion_dropout)
    return Predicted(first, again, noisy if params.noisy_target else windows.motion)


def dance_terms(output: Predicted, windows: Windows) -> Terms:
    """Likelihood and contacts (Eq. 11) of one pass, or the sums over both."""
    passes = [output.first] if output.second is None else [output.first, output.second]
    return {
        "likelihood": _sum(likelihood_loss(each, output.target, windows.valid) for each in passes),
        "contacts": _sum(contact_loss(each, windows.contacts, windows.valid) for each in passes),
    }


def _sum(values: object) -> Tensor:
    return torch.stack(list(values)).sum()  # type: ignore[call-overload]


@torch.no_grad()
def settle(network: DanceNetwork, source: WindowSource) -> None:
    """Give batch normalisation the statistics of the training windows, whatever the last batch was."""
    if network.mapping is not None:
        network.mapping.settle(source.batch(even_rows(source)).music)
    network.eval()


@torch.no_grad()
def validate(network: DanceNetwork, source: WindowSource, held_out: WindowSource) -> dict[str, float]:
    """Of unseen windows, frame by frame from recorded ones: error, likelihood, contacts beside "as before".

    "fixed_nats" is the likelihood of one set of training windows, drawn without clusters: losses of trainings that draw
    their windows differently are of different windows, and this one can be compared (R27).
    """
    settle(network, source)
    windows, fixed = (each.batch(even_rows(each)) for each in (held_out, source))
    prediction, of_fixed = network(windows), network(fixed)
    network.train()
    return {
        "val_mse": float(squared_error(prediction, windows.motion, windows.valid)),
        "val_nats": float(likelihood_loss(prediction, windows.motion, windows.valid)),
        "val_contacts": float(contact_accuracy(prediction, windows.contacts, windows.valid)),
        "val_contacts_as_before": float(unchanged_contacts(windows.contacts, windows.valid)),
        "val_contacts_majority": float(majority_contacts(windows.contacts, windows.valid)),
        "fixed_nats": float(likelihood_loss(of_fixed, fixed.motion, fixed.valid)),
    }


def even_rows(source: WindowSource, most: int = VALIDATED) -> np.ndarray:
    """Rows of up to `most` windows of a source, evenly apart."""
    count = min(most, len(source.places))
    return np.linspace(0, len(source.places) - 1, count).round().astype(np.int64)


class Movement(NamedTuple):
    """The row of a window, and what is danced in it."""

    row: int
    dance: str


def movements(source: WindowSource, *, seed: int) -> PoseBank:
    """Recorded movement that a dance may go on from, motion and contacts side by side, the dances in turn."""
    params = source.sequences.params
    frames = max(1, round(params.start_seconds * params.fps))
    every = [
        Movement(row, source.sequences.sequences[number].dance)
        for row, (number, _) in enumerate(source.places.tolist())
    ]
    selected = spread(every, BANK, np.random.default_rng(seed))
    clips = [np.concatenate(source.raw(movement.row), axis=1)[:frames] for movement in selected]
    return PoseBank(np.stack(clips), tuple(movement.dance for movement in selected))
