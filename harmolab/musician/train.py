"""The training of the network (Sec. 4), and its errors in pixels (Sec. 6)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import huber_loss, mse_loss

from harmolab.musician import sequences
from harmolab.musician.bow import Bowing, turn_signal
from harmolab.musician.networks import SoundToPoints, points_from, predicted_points
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSequence, PlayedSet, PlayedSplit, PlayedWindows
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import drawn_by
from harmolab.systems.training.loop import Batching, Phase, Player, Shard, Terms, make_fabric
from harmolab.systems.training.runs import open_run
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import FloatArray, Motion

BEST = "best"  # stem of the weights of the epoch with the least validation error


class Errors(NamedTuple):
    """Errors in pixels of the reference configuration (A2B 19): against the components of the truth, and against it."""

    projected: float
    full: float


def train_audio2body(played: PlayedSet, split: PlayedSplit, options: TrainOptions) -> SoundToPoints:
    """Train the network on performances, keep the best validation epoch, and everything about it in `options.out`.

    "meta" of its weights has the errors of the training, validation and test sides.

    Parameters
    ----------
    played : PlayedSet; its `params` are those of the training
    split : PlayedSplit of the same performances
    options : TrainOptions

    Raises
    ------
    ValueError
        As `open_run`; if a piece is on two sides, or a side has nothing to learn from.
    """
    fabric, params = make_fabric(accelerator=options.accelerator), played.params
    sequences.check_pieces(played.sequences, split)
    network, train, validation = prepared(played, split, fabric.device)
    batching = Batching(params.batch, params.shards, params.seed)
    with open_run(fabric, options, split, {"audio2body": params, "data": played.source}, batching, len(train)) as run:
        fabric.to_device(network)
        run.fit([_phase(network, train, validation, run.folder)], train)
        outcome = side_errors(network, played, split, train, validation)
        stored = {side: values._asdict() for side, values in outcome.items()}
        run.save(network, {"settings": run.settings, "source": played.source, "errors": stored})
    return network.eval()


def prepared(
    played: PlayedSet, split: PlayedSplit, device: torch.device | str = "cpu"
) -> tuple[SoundToPoints, PlayedWindows, PlayedWindows]:
    """An untrained network with the statistics of the training side; windows to train on, and to validate on."""
    params, learnt = played.params, sequences.sides(played.sequences, split.train)
    learnt = sequences.with_other_sounds(learnt, params.seed) if params.shuffled_sound else learnt
    validated = sequences.sides(played.sequences, split.validation)
    bow = Bowing.fit(learnt, played.skeleton, params) if params.bow_phase else None
    if bow is not None:
        learnt, validated = _with_turns(learnt, bow, played), _with_turns(validated, bow, played)
    space, statistics = sequences.fitted_space(learnt, params), sequences.sound_statistics(learnt)
    network = initial_network(played, len(space.basis))
    network.set_statistics(*statistics, space, bow)
    train = PlayedWindows.of(learnt, space, params, device)
    if params.validation == "pieces":
        if not split.validation:
            raise ValueError("whole pieces are to be validated on, and the split has none")
        validation = PlayedWindows.of(validated, space, params, device)
    else:
        train, validation = train.drawn_apart(sequences.VALIDATION_SHARE, params.seed)
    if params.data_share < 1:
        train, _ = train.drawn_apart(1 - params.data_share, params.seed)
    if not bool(train.mask.any()):
        raise ValueError(f"{played.source}: no frame to learn from; every one was rejected")
    return network, train, validation


def _with_turns(learnt: Sequence[PlayedSequence], bow: Bowing, played: PlayedSet) -> list[PlayedSequence]:
    """Sequences whose points have the bow at its mean place; its turns are marked in its stead."""
    fps = played.params.fps
    marks = [turn_signal(each, played.skeleton, fps)[:, None] for each in learnt]
    pairs = zip(learnt, marks, strict=True)
    return [replace(each, points=bow.at_rest(each.points), marks=own) for each, own in pairs]


def initial_network(played: PlayedSet, n_components: int) -> SoundToPoints:
    """An untrained network of the run's seed."""
    with drawn_by(played.params.seed):
        return SoundToPoints(played.params, played.skeleton, played.instrument, n_components, played.reference)


def _phase(network: SoundToPoints, train: PlayedWindows, validation: PlayedWindows, folder: Path) -> Phase:
    params, weights = network.params, [*network.parameters()]
    player = Player(
        "network", weights, lambda output, shard, row: terms(output, shard.own, params.loss), {"error": 1.0}
    )
    return Phase(
        "audio2body",
        params.epochs,
        rate=lambda number: params.rate,
        modules={"network": network},
        players=[player],
        forward=lambda shard, last: _components(network.train(), shard),
        validate=lambda: {"val_error": window_errors(network, validation).projected},
        patience=max(params.epochs, 1),  # all epochs, and the best is kept
        error="val_error",
        keep=lambda: save_weights(folder / BEST, network),
        recall=lambda: network.load_state_dict(load_weights(folder / BEST, SoundToPoints).state_dict()),
    )


def _components(network: SoundToPoints, shard: Shard) -> Tensor:
    """The forward pass of a shard; windows in a row hand on their state, but no gradient."""
    with drawn_by(shard.seed, shard.own.sound.device):
        return windows_passed(network, shard.own.sound)


def windows_passed(network: SoundToPoints, sound: Tensor) -> Tensor:
    """Components (N, S, n) of sound (N, S, F), `sequence` steps at a time."""
    state, parts = None, []
    for part in sound.split(network.params.sequence, dim=1):
        components, state = network(part, state)
        state = (state[0].detach(), state[1].detach())
        parts.append(components)
    return torch.cat(parts, dim=1)


def terms(components: Tensor, windows: PlayedWindows, loss: str) -> Terms:
    """Squared or Huber error summed over components, mean over the steps that count (A2B 18)."""
    measure = huber_loss if loss == "huber" else mse_loss
    errors = measure(components, windows.target, reduction="none").sum(dim=2) * windows.mask
    return {"error": errors.sum() / windows.mask.sum().clamp(min=1.0)}


@torch.no_grad()
def window_errors(network: SoundToPoints, windows: PlayedWindows) -> Errors:
    """Errors of windows, each from a state of 0: means over the steps that count; NaN where there is none.

    With `bow_phase` these are errors of points whose bow is at its mean place, predicted and true: a window is too
    short to tell its direction.
    """
    network.eval()
    squares, sizes = [], network.space_scale.get_buffer("sizes")
    for part in range(0, len(windows), network.params.batch):
        own = windows.take(torch.arange(part, min(part + network.params.batch, len(windows))))
        difference = (windows_passed(network, own.sound) - own.target)[..., : len(sizes)] * sizes
        mean = difference.square().sum(dim=2) / (2 * len(network.skeleton.joints))
        squares.append(torch.stack([mean, mean + own.residual], dim=2)[own.mask > 0])
    return Errors(*torch.cat(squares).sqrt().mean(dim=0).tolist())


def errors(network: SoundToPoints, played: Sequence[PlayedSequence]) -> Errors:
    """Errors of whole recordings: means over accepted frames."""
    return errors_between(
        [predicted_points(network, each.sound) for each in played],
        [network.projected(each.points) for each in played],
        played,
    )


def errors_between(
    predicted: Sequence[FloatArray], projected: Sequence[FloatArray], played: Sequence[PlayedSequence]
) -> Errors:
    """Errors of predicted points (T, 2 P) against projected ones, and against those of the sequences."""
    pairs = [
        (frame_errors(guess, near)[each.accepted], frame_errors(guess, each.points)[each.accepted])
        for guess, near, each in zip(predicted, projected, played, strict=True)
    ]
    return Errors(*(float(np.concatenate(values).mean()) for values in zip(*pairs, strict=True)))


def frame_errors(points: FloatArray, truth: FloatArray) -> FloatArray:
    """Root of the mean square over coordinates, frame by frame: (T,) of two (T, 2 P)."""
    values: FloatArray = np.sqrt(np.square(points - truth).mean(axis=1))
    return values


def mean_pose_errors(network: SoundToPoints, played: Sequence[PlayedSequence]) -> Errors:
    """Errors of the mean pose of the training side, which hears nothing."""
    space = network.space
    predicted = [np.broadcast_to(space.mean, each.points.shape) for each in played]
    return errors_between(predicted, [network.projected(each.points) for each in played], played)


def side_errors(
    network: SoundToPoints, played: PlayedSet, split: PlayedSplit, train: PlayedWindows, validation: PlayedWindows
) -> dict[str, Errors]:
    """Side -> errors; beside those of the test side stand those of the mean pose."""
    outcome = {"train": window_errors(network, train), "validation": window_errors(network, validation)}
    if split.test:
        test = sequences.sides(played.sequences, split.test)
        outcome |= {"test": errors(network, test), "mean pose": mean_pose_errors(network, test)}
    return outcome


# Errors of a prediction beside the filmed playing, in pixels and in per cent of the shoulder width


class TruthErrors(NamedTuple):
    """Errors of a prediction against the true points, over the frames of them that are accepted.

    Parameters
    ----------
    pixels, mean_pose : float, pixels of the reference configuration: of the prediction; of the mean pose of training,
        which hears nothing
    shoulder_width : float, pixels; NaN for points without shoulders
    points : int, points that both have
    accepted : float, share of the frames
    """

    pixels: float
    mean_pose: float
    shoulder_width: float
    points: int
    accepted: float

    @property
    def percent(self) -> float:
        """Per cent of the shoulder width; NaN without shoulders."""
        return 100 * self.pixels / self.shoulder_width

    @property
    def mean_pose_percent(self) -> float:
        """The same of the mean pose."""
        return 100 * self.mean_pose / self.shoulder_width


class Compared(NamedTuple):
    """True points and predicted ones, frame by frame at the rate of the network.

    Parameters
    ----------
    truth : Motion, (T, P, 2), placed as the network's points are; frames that are not accepted are filled in
    prediction : Motion of the same points
    errors : TruthErrors
    """

    truth: Motion
    prediction: Motion
    errors: TruthErrors


def compared(network: SoundToPoints, performance: Performance) -> Compared:
    """A performance, and the points that the network predicts for its sound, of the points that both have.

    Raises
    ------
    ValueError
        The performance is of another instrument or has no sound, no point in common with the network's, nothing to be
        placed by, or no frame that is accepted; it names the performance.
    """
    name = performance.name
    if performance.instrument != network.instrument:
        raise ValueError(f"{name}: is played on a {performance.instrument}, this player plays the {network.instrument}")
    own = performance.motion.skeleton.joints
    joints = [joint for joint in network.skeleton.joints if joint in own]
    if not joints:
        raise ValueError(f"{name}: has no point that this player has; its points are {', '.join(own[:6])} ...")
    part = performance.part(joints)
    sequence = sequences.read_sequence(part, network.params, network.reference, is_test=True)
    if not sequence.accepted.any():
        raise ValueError(f"{name}: every frame of its points is rejected, so there is nothing to compare with")
    numbers = [network.skeleton.joints.index(joint) for joint in joints]
    count, fps, skeleton = len(sequence.points), network.params.fps, part.motion.skeleton
    points = points_from(network, performance.audio, performance.notes, start=performance.offset, count=count)
    truth, predicted = sequence.points.reshape(count, -1, 2), points.positions[:, numbers]
    mean = network.space.mean.reshape(1, -1, 2)[:, numbers]
    error, mean_error = (
        float(frame_errors(each.reshape(len(each), -1), sequence.points)[sequence.accepted].mean())
        for each in (predicted, mean)
    )
    width, accepted = network.reference.shoulder_width, float(sequence.accepted.mean())
    return Compared(
        Motion(truth, fps, skeleton, sequence.accepted),
        Motion(predicted, fps, skeleton),
        TruthErrors(error, mean_error, width, len(joints), accepted),
    )
