"""Perceptual features of motion: a small VGG over (time, joints), for the feature loss (Eq. 26) and Frechet distances.

The paper takes VGG features of motion; VGG was trained on photographs. Here the same kind of network learns from dance:
it is trained on the training split to tell motion groups and dances apart, to tell intact motion from damaged, and to
remember enough to draw the motion again.
"""

import copy
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Self, TypeVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from harmolab.body.skeletons import Skeleton
from harmolab.files import PathLike
from harmolab.systems.training.about import stored_skeleton
from harmolab.systems.training.layers import PATH_CHANNELS, Normaliser, between, channel_statistics, drawn_by
from harmolab.systems.training.motion_code import check_fps, coded
from harmolab.systems.training.units import DanceUnit, UnitSet, collate
from harmolab.systems.training.weights import load_weights
from harmolab.types import FloatArray, Motion

# Frames that every clip is brought to, whatever its length and frame rate.
FRAMES = 32
# Size of the embedding of a motion (`PoseNet.embed`).
EMBEDDING = 32
# Seconds by which velocities are multiplied, to be about as large as normalised positions.
_VELOCITY_SPAN = 0.2
_WIDTHS = (16, 32, 64)
# Of training: units in a batch and in an epoch; moments that the network learns to draw.
_BATCH, _EPOCH_UNITS, _MOMENTS = 32, 256, 8

N = TypeVar("N", bound=Any)


def resample(values: Tensor, mask: Tensor, frames: int = FRAMES) -> Tensor:
    """(N, frames, C): the real frames of (N, T, C), which come first, brought to one length by linear interpolation."""
    last = (mask.sum(dim=1, keepdim=True) - 1).clamp(min=0)  # (N, 1)
    places = torch.linspace(0, 1, frames, device=values.device, dtype=values.dtype) * last
    return between(values, places.minimum(last))  # rounding may pass the last frame


class PoseNet(nn.Module):
    """VGG over (time, joints): three blocks of 3 x 3 convolutions, halved between; then an embedding.

    A clip is a picture of 32 rows (time) and J + 1 columns (joints, and the root's path as one more) in six colours:
    position and velocity of each joint in the heading frame, normalised.

    Parameters
    ----------
    skeleton : Skeleton with J joints
    fps : float, hertz
        Frame rate of the motion codes it is given.
    """

    def __init__(self, skeleton: Skeleton, *, fps: float) -> None:
        super().__init__()
        check_fps(fps)
        self.skeleton, self.fps = skeleton, float(fps)
        self.motion_scale = Normaliser(3 * len(skeleton.joints) + PATH_CHANNELS)
        self.blocks = nn.ModuleList(_block(a, b) for a, b in itertools.pairwise((6, *_WIDTHS)))
        columns = -(-(len(skeleton.joints) + 1) // 4)  # halved twice
        self.summary = nn.Sequential(nn.Linear(2 * _WIDTHS[-1] * columns, 64), nn.ReLU(), nn.Linear(64, EMBEDDING))

    def picture(self, motion: Tensor, mask: Tensor) -> Tensor:
        """(N, 6, 32, J + 1) of motion codes (N, T, C), not normalised; mask (N, T), 1 at real frames."""
        code = self.motion_scale(motion)
        steps = functional.pad(code[:, 1:] - code[:, :-1], (0, 0, 1, 0)) * (self.fps * _VELOCITY_SPAN)
        both = resample(torch.stack([code, steps], dim=-1).flatten(2), mask)  # (N, 32, C * 2)
        return both.unflatten(-1, (-1, 3, 2)).permute(0, 3, 4, 1, 2).flatten(1, 2)

    def features(self, motion: Tensor, mask: Tensor) -> list[Tensor]:
        """The maps of the three blocks, (N, channels, frames, columns) each: deep features of motion (N, T, C)."""
        maps = [self.blocks[0](self.picture(motion, mask))]
        for block in list(self.blocks)[1:]:
            maps.append(block(functional.max_pool2d(maps[-1], 2, ceil_mode=True)))
        return maps

    def embed(self, motion: Tensor, mask: Tensor) -> Tensor:
        """(N, 32) embeddings of motions (N, T, C), for the Frechet distance."""
        last = self.features(motion, mask)[-1]
        over_time = torch.cat([last.mean(dim=2), last.amax(dim=2)], dim=1)  # (N, 2 c, columns)
        return self.summary(over_time.flatten(1))

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {"fps": self.fps, "skeleton": asdict(self.skeleton)}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A pose network as its description says."""
        return cls(stored_skeleton(build), fps=float(build["fps"]))


def load_pose_net(path: PathLike) -> PoseNet:
    """The pose network stored at `path`; errors as of `harmolab.systems.training.weights.load_weights`."""
    return load_weights(path, PoseNet)


@torch.no_grad()
def embed_meters(motions: Sequence[Motion], units: UnitSet, pose_net: PoseNet) -> FloatArray:
    """Pose network's features (N, D) of the meters of motions, one for each whole unit.

    Every motion, recorded or generated, is coded from its joints: heading and path are those of the body, not
    those in a generator's code. Whole units are coded and then cut, since the heading is smoothed over time.

    Raises
    ------
    ValueError
        If the motions are not as many as the units, or move other joints than the pose network's.
    """
    codes = [_meter_code(motion, unit, pose_net) for motion, unit in zip(motions, units.units, strict=True)]
    mask = nn.utils.rnn.pad_sequence([torch.ones(len(code)) for code in codes], batch_first=True)
    return pose_net.eval().embed(nn.utils.rnn.pad_sequence(codes, batch_first=True), mask).double().numpy()


@torch.no_grad()
def embed_windows(motions: Sequence[Motion], pose_net: PoseNet, *, seconds: float) -> FloatArray:
    """Pose network's features (N, D) of all whole pieces of so many seconds, one motion after the other.

    Motions are coded whole and then cut, since the heading is smoothed over time; they have the network's joints.
    """
    length, pieces = round(seconds * pose_net.fps), []
    for motion in motions:
        code = torch.from_numpy(coded(motion, pose_net.fps))
        pieces += list(code[: len(code) // length * length].split(length))
    batch = torch.stack(pieces)
    return pose_net.eval().embed(batch, torch.ones(batch.shape[:2])).double().numpy()


def _meter_code(motion: Motion, unit: DanceUnit, pose_net: PoseNet) -> Tensor:
    """Motion code (T, C) of a unit's meter at the frame rate of the pose network."""
    if motion.skeleton.joints != pose_net.skeleton.joints:
        joints = ", ".join(motion.skeleton.joints)
        raise ValueError(f"{unit.name}: the motion must have the joints of the pose network, got {joints}")
    code = coded(motion, pose_net.fps)
    return torch.from_numpy(code[round(unit.n_prior * pose_net.fps / unit.fps) :])


def _block(n_in: int, n_out: int) -> nn.Sequential:
    """Two 3 x 3 convolutions. No normalisation, as in the first VGG: how large a movement is must not be lost."""
    layers: list[nn.Module] = []
    for a, b in ((n_in, n_out), (n_out, n_out)):
        convolution = nn.Conv2d(a, b, 3, padding=1)
        nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu")
        layers += [convolution, nn.ReLU()]
    return nn.Sequential(*layers)


def train_pose_net(train: UnitSet, validation: UnitSet, **options: Any) -> PoseNet:
    """A pose network that learnt three tasks on the training units, on the CPU, in evaluation mode.

    The tasks: motion groups and dance (of the training split only); intact or damaged motion (shaking, standing still
    between steps, limbs of another dancer); poses at eight moments. The state of the epoch with the least loss of the
    last two on the validation units is kept.

    Parameters
    ----------
    train, validation : UnitSet
    options : of `train_on_lesson`: ``seed``, ``epochs``, ``progress``; errors as there
    """
    return train_on_lesson(lambda: PoseNet(train.skeleton, fps=train.features.fps), train, validation, **options)


def train_on_lesson(
    build: Callable[[], N],
    train: UnitSet,
    validation: UnitSet,
    *,
    seed: int = 0,
    epochs: int = 40,
    progress: Callable[[dict[str, float]], None] = lambda row: None,
) -> N:
    """A network of motion that learnt the three tasks of `train_pose_net`.

    Parameters
    ----------
    build : function() -> network with fresh weights
        It has ``motion_scale``, a `Normaliser` of motion codes, and ``embed(motion, mask)``: (N, 32) embeddings.
    train, validation : UnitSet
    seed : int
    epochs : int
        An epoch sees 256 training units, drawn anew: the time it takes does not depend on how many there are.
    progress : called with {"epoch", "train", "validation"} (losses) after every epoch

    Raises
    ------
    ValueError
        Without units on either side, or for fewer than one epoch.
    """
    if not len(train) or not len(validation) or epochs < 1:
        sizes = f"{len(train)} units, {len(validation)} validation units and {epochs} epochs"
        raise ValueError(f"a pose network needs units, validation units and epochs, got {sizes}")
    with drawn_by(seed):
        pairs = ((batch.motion, batch.mask) for batch in (collate(train.units), collate(validation.units)))
        motion, mask, test_motion, test_mask = (torch.from_numpy(array) for pair in pairs for array in pair)
        labels = _labels(train.units)
        net = build()
        net.motion_scale.set(*channel_statistics(motion, mask))
        lesson = _Lesson(net, labels.shape[1])
        test = lesson.damaged(test_motion, test_mask)  # the same damage in every epoch
        least, state = float("inf"), copy.deepcopy(net.state_dict())
        optimiser = torch.optim.Adam(lesson.parameters(), lr=1e-3)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs)
        for epoch in range(epochs):
            loss = _epoch(lesson, optimiser, motion, mask, labels)
            schedule.step()
            with torch.no_grad():
                tested = float(sum(lesson.eval().losses(test_motion, test, test_mask, None)))
            lesson.train()
            if tested < least:
                least, state = tested, copy.deepcopy(net.state_dict())
            progress({"epoch": epoch, "train": loss, "validation": tested})
        net.load_state_dict(state)
    return net.eval()


def _labels(units: Sequence[DanceUnit]) -> Tensor:
    """(N, L), 1 where a unit belongs to a motion group or a dance."""
    labels = [unit.groups | {f"dance {unit.dance}"} for unit in units]
    names = sorted(frozenset().union(*labels))
    return torch.tensor([[float(name in own) for name in names] for own in labels])


def _epoch(lesson: "_Lesson", optimiser: torch.optim.Optimizer, motion: Tensor, mask: Tensor, labels: Tensor) -> float:
    """One epoch in batches; the mean loss."""
    passes = -(-_EPOCH_UNITS // len(motion))
    order = torch.cat([torch.randperm(len(motion)) for _ in range(passes)])[:_EPOCH_UNITS]
    total = 0.0
    for rows in order.split(_BATCH):
        intact, real = _cut(motion[rows], mask[rows])
        loss = torch.stack(lesson.losses(intact, lesson.damaged(intact, real), real, labels[rows])).sum()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        total += float(loss.detach()) * len(rows)
    return total / len(order)


def _cut(motion: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """A random stretch of each clip, 60 to 100 % of it, at the same speed."""
    lengths = mask.sum(dim=1, keepdim=True)
    cut_lengths = (lengths * (0.6 + 0.4 * torch.rand_like(lengths))).ceil()
    first = ((lengths - cut_lengths) * torch.rand_like(lengths)).floor()
    frames = torch.arange(mask.shape[1], dtype=mask.dtype)
    real = (frames < cut_lengths).to(mask.dtype)
    return between(motion, (first + frames).clamp(max=mask.shape[1] - 1)), real


class _Lesson(nn.Module):
    """The network and the heads that it learns with; the heads are not kept."""

    def __init__(self, net: Any, n_labels: int) -> None:
        super().__init__()
        self.net = net
        self.group_head, self.intact_head = nn.Linear(EMBEDDING, n_labels), nn.Linear(EMBEDDING, 1)
        self.drawing_head = nn.Linear(EMBEDDING, _MOMENTS * len(net.motion_scale.mean))

    def damaged(self, motion: Tensor, mask: Tensor) -> Tensor:
        """Each clip (N, T, C) damaged in one of three ways, drawn at random: shaking, holding frames, foreign limbs."""
        n, frames, channels = motion.shape
        strength = 0.02 * 20 ** torch.rand(n, 1, 1)  # standard deviations
        shaken = motion + strength * self.net.motion_scale.std * torch.randn_like(motion)
        hold = torch.randint(3, 9, (n, 1))
        held = between(motion, (torch.arange(frames) // hold * hold).to(motion.dtype))
        foreign = torch.rand(n, 1, (channels - PATH_CHANNELS) // 3) < 0.5
        whose = functional.pad(foreign.repeat_interleave(3, dim=2), (0, PATH_CHANNELS))
        mixed = torch.where(whose, motion.roll(1, dims=0), motion)
        kind = torch.randint(3, (n, 1, 1))
        return torch.where(kind == 0, shaken, torch.where(kind == 1, held, mixed))

    def losses(self, intact: Tensor, damaged: Tensor, mask: Tensor, labels: Tensor | None) -> list[Tensor]:
        """Losses of the heads: intact or damaged, drawing, and, with labels, motion groups."""
        embeddings = self.net.embed(torch.cat([intact, damaged]), mask.repeat(2, 1))
        truth = torch.arange(len(embeddings)) < len(intact)
        verdict = self.intact_head(embeddings).squeeze(-1)
        losses = [functional.binary_cross_entropy_with_logits(verdict, truth.to(embeddings.dtype))]
        drawn = self.drawing_head(embeddings[: len(intact)]).unflatten(1, (_MOMENTS, -1))
        losses.append(functional.mse_loss(drawn, resample(self.net.motion_scale(intact), mask, _MOMENTS)))
        if labels is not None:
            answers = self.group_head(embeddings[: len(intact)])
            losses.append(functional.binary_cross_entropy_with_logits(answers, labels))
        return losses
