"""The training of Music2Dance in two phases (supplement 1.2): from recorded frames, then from its own predictions.

The folder of a run holds ``settings.json``, ``split.json``, ``history.csv``, the state that it resumes from, the
trained weights ``model``, and movements that a dance may go on from.
"""

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from harmolab.systems.music2dance.networks import DanceNetwork, Prediction
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.sequences import SequenceSet, Windows, WindowSource, training_windows
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import drawn_by
from harmolab.systems.training.loop import Batching, Phase, Player, Shard, Terms, make_fabric
from harmolab.systems.training.runs import PoseBank, open_run, spread
from harmolab.systems.training.splits import Split

# Loss terms (Eq. 7-11): how likely the recorded frame was, and whether the right feet stand

HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)


def likelihood_loss(prediction: Prediction, target: Tensor, valid: Tensor) -> Tensor:
    """Negative logarithm of the likelihood of frames (N, T, C): nats a frame, mean over those that are valid (N, T).

    Summed over channels. A Gaussian for each channel; a mixture of one, which is what the paper uses, is no mixture.
    """
    away = (target - prediction.mean) * (-prediction.log_sigma).exp()
    nats = (0.5 * away.square() + prediction.log_sigma + HALF_LOG_TAU).sum(dim=-1)
    return _mean(nats, valid)


def contact_loss(prediction: Prediction, contacts: Tensor, valid: Tensor) -> Tensor:
    """Binary cross-entropy of the contacts (N, T, 2) (Eq. 10), mean over both feet and the valid frames (N, T)."""
    entropy = binary_cross_entropy_with_logits(prediction.contacts, contacts, reduction="none")
    return _mean(entropy.mean(dim=-1), valid)


def squared_error(prediction: Prediction, target: Tensor, valid: Tensor) -> Tensor:
    """Mean square of what the mean misses, squared standard deviations a channel."""
    return _mean((target - prediction.mean).square().mean(dim=-1), valid)


def contact_accuracy(prediction: Prediction, contacts: Tensor, valid: Tensor) -> Tensor:
    """Share of feet that are said rightly to stand or not to, from the second frame on."""
    right = ((prediction.contacts > 0) == (contacts > 0.5)).float().mean(dim=-1)
    return _mean(right[:, 1:], valid[:, 1:])


def majority_contacts(contacts: Tensor, valid: Tensor) -> Tensor:
    """The share of whoever says the more frequent of the two, always."""
    share = _mean(contacts[:, 1:].mean(dim=-1), valid[:, 1:])
    return torch.maximum(share, 1 - share)


def unchanged_contacts(contacts: Tensor, valid: Tensor) -> Tensor:
    """The same share of whoever says "as in the frame before"."""
    same = (contacts[:, 1:] == contacts[:, :-1]).float().mean(dim=-1)
    return _mean(same, valid[:, 1:])


def _mean(values: Tensor, valid: Tensor) -> Tensor:
    """Mean of (N, T) where `valid` is 1."""
    return (values * valid).sum() / valid.sum().clamp(min=1.0)


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


def train_music2dance(split: Split, sequences: SequenceSet, options: TrainOptions) -> DanceNetwork:
    """Train the network on whole recordings and keep everything about it in the folder of `options`.

    Parameters
    ----------
    split : Split of the `units` of `sequences`, whose groups decide on which side a window is
    sequences : SequenceSet; its `params` are those of the training
    options : TrainOptions

    Raises
    ------
    ValueError
        As `open_run`; if a side of the split has no window, or a training window a figure of another side.
    """
    fabric, params = make_fabric(accelerator=options.accelerator), sequences.params
    source = training_windows(split, sequences, fabric.device)
    held_out = WindowSource.of(
        sequences, split.groups["validation"], statistics=source.statistics, share=HELD_OUT, device=fabric.device
    )
    batching = Batching(params.batch_size, params.shards, params.seed)
    settings = {"music2dance": params, "data": sequences.units.source}
    with open_run(fabric, options, split, settings, batching, len(source)) as run:
        run.save_movements(lambda: movements(source, seed=params.seed))
        with drawn_by(params.seed):
            network = DanceNetwork(params, sequences.code, sequences.dances)
        network.set_statistics(source.statistics)
        fabric.to_device(network)
        run.fit([_phase(network, source, held_out, params, second=second) for second in (False, True)], source)
        settle(network, source)
        run.save(network, {"settings": run.settings, "source": sequences.units.source})
    return network


def _phase(
    network: DanceNetwork, source: WindowSource, held_out: WindowSource, params: Music2DanceParams, *, second: bool
) -> Phase:
    """Teacher forcing, or both passes."""
    name, epochs, rate, drop = "teacher", params.first_epochs, params.first_rate, params.first_drop
    if second:
        name, epochs, rate, drop = "feedback", params.second_epochs, params.second_rate, params.second_drop
    dancer = Player(
        "dancer", [*network.parameters()], lambda output, shard, row: dance_terms(output, shard.own),
        {"likelihood": 1.0, "contacts": params.contact_weight}, clip=params.clip, optimiser=torch.optim.RMSprop,
    )  # fmt: skip
    return Phase(
        name, epochs, lambda number: rate if number < drop * epochs else DROP * rate, {"network": network}, [dancer],
        forward=lambda shard, last: predicted(network, shard, second=second),
        validate=lambda: validate(network, source, held_out), validate_every=VALIDATE_EVERY,
    )  # fmt: skip


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
    likelihoods = [likelihood_loss(each, output.target, windows.valid) for each in passes]
    contacts = [contact_loss(each, windows.contacts, windows.valid) for each in passes]
    return {"likelihood": torch.stack(likelihoods).sum(), "contacts": torch.stack(contacts).sum()}


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


def movements(source: WindowSource, *, seed: int) -> PoseBank:
    """Recorded movement that a dance may go on from, motion and contacts side by side, the dances in turn."""
    params = source.sequences.params
    frames = max(1, round(params.start_seconds * params.fps))
    dances = [source.sequences.sequences[number].dance for number in source.places[:, 0]]
    rows = spread(dances, BANK, np.random.default_rng(seed))
    clips = [np.concatenate(source.raw(row), axis=1)[:frames] for row in rows]
    return PoseBank(np.stack(clips), tuple(dances[row] for row in rows))
