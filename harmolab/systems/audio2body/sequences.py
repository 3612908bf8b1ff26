"""Performances as the network takes them: what is heard and where the points are, frame by frame; training windows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from harmolab.corpora.pieces import PieceSplit
from harmolab.systems.audio2body.gaps import usable_steps
from harmolab.systems.audio2body.params import Audio2BodyParams
from harmolab.systems.audio2body.placing import Reference
from harmolab.systems.audio2body.point_space import PointSpace, continued, later, steps_of
from harmolab.systems.common.layers import channel_statistics
from harmolab.types import BoolArray, FloatArray, Skeleton

VALIDATION_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class PlayedSequence:
    """A performance, frame by frame at the rate of the parameters.

    Parameters
    ----------
    name, piece : str
    sound : (T, F) array, what is heard
    points : (T, 2 P) array, x and y of each point in turn, pixels of the reference configuration
    learnt : (T,) mask, the frames that a loss counts
    accepted : (T,) mask, the frames that an error counts
    marks : (T, C) array, what else the network learns of each frame; nothing when left out
    """

    name: str
    piece: str
    sound: NDArray[np.float32]
    points: FloatArray
    learnt: BoolArray
    accepted: BoolArray
    marks: FloatArray | None = None


@dataclass(frozen=True)
class PlayedSplit:
    """Names of performances on each side; ValueError where one is on two, or none is trained on.

    Parameters
    ----------
    train, validation, test : names; validation is empty where a share of the training windows is validated on
    """

    train: tuple[str, ...]
    validation: tuple[str, ...] = ()
    test: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [*self.train, *self.validation, *self.test]
        if doubled := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"{doubled[0]!r} is on two sides of the split")
        if not self.train:
            raise ValueError("no performance to train on")

    @classmethod
    def of(cls, sides: PieceSplit) -> Self:
        """The names of the performances on each side."""
        return cls(*(tuple(each.name for each in side) for side in sides))

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return asdict(self)


def check_pieces(sequences: Iterable[PlayedSequence], split: PlayedSplit) -> None:
    """ValueError for a piece that is tested on, or validated on as a whole, but trained on in another recording."""
    pieces = {sequence.name: sequence.piece or sequence.name for sequence in sequences}
    if missing := sorted({*split.train, *split.validation, *split.test} - pieces.keys()):
        raise ValueError(f"the split names {missing[0]!r}, which is no performance here")
    train = {pieces[name]: name for name in split.train}
    for name in (*split.validation, *split.test):
        if (other := train.get(pieces[name])) is not None:
            raise ValueError(f"{name!r} is held out, but its piece is trained on in {other!r}")


def sides(sequences: Sequence[PlayedSequence], names: Collection[str]) -> list[PlayedSequence]:
    """The sequences of some names."""
    return [sequence for sequence in sequences if sequence.name in names]


def with_other_sounds(sequences: Sequence[PlayedSequence], seed: int) -> list[PlayedSequence]:
    """Each sequence with the sound of another one, over and over if that is shorter; ValueError for a single one."""
    if len(sequences) < 2:
        raise ValueError("the sound of another piece needs two pieces or more")
    order = np.random.default_rng(seed).permutation(len(sequences))
    others = dict(zip(order.tolist(), np.roll(order, 1).tolist(), strict=True))
    return [
        replace(own, sound=np.resize(sequences[others[number]].sound, own.sound.shape))
        for number, own in enumerate(sequences)
    ]


def fitted_space(sequences: Sequence[PlayedSequence], params: Audio2BodyParams) -> PointSpace:
    """Principal components of the frames that are learnt of training sequences; ValueError where there are none."""
    frames = np.concatenate([sequence.points[sequence.learnt] for sequence in sequences])
    return PointSpace.fit(frames, params.components, even_scale=params.even_scale)


def sound_statistics(sequences: Sequence[PlayedSequence]) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (F,) of what is heard in training sequences."""
    sound = torch.from_numpy(np.concatenate([sequence.sound for sequence in sequences]))
    return channel_statistics(sound[None], torch.ones(1, len(sound)))


@dataclass(frozen=True, eq=False)
class PlayedWindows:
    """Windows of steps (`harmolab.systems.common.shards.Units`).

    Parameters
    ----------
    sound : (N, S, F)
    target : (N, S, n), scaled components and then the marks, `delay` steps late
    mask : (N, S), 1 where the loss counts
    residual : (N, S), mean square of what the components leave of the points
    """

    sound: Tensor
    target: Tensor
    mask: Tensor
    residual: Tensor

    def __len__(self) -> int:
        return len(self.sound)

    def take(self, indices: Tensor, rank: int = 0, world: int = 1) -> PlayedWindows:
        """The windows at `indices` that fall to process `rank` of `world`."""
        rows = indices[rank::world].to(self.sound.device)
        return PlayedWindows(self.sound[rows], self.target[rows], self.mask[rows], self.residual[rows])

    @classmethod
    def of(
        cls,
        sequences: Sequence[PlayedSequence],
        space: PointSpace,
        params: Audio2BodyParams,
        device: torch.device | str = "cpu",
    ) -> PlayedWindows:
        """All windows of some sequences, one after the other; the last one of each is filled up with silence."""
        length = params.sequence * params.carry
        parts = [_cut(sequence, space, params, length) for sequence in sequences]
        return cls(*(torch.from_numpy(np.concatenate(values)).to(device) for values in zip(*parts, strict=True)))

    def drawn_apart(self, share: float, seed: int) -> tuple[PlayedWindows, PlayedWindows]:
        """The windows without a random share of them, and that share; ValueError unless both can have one."""
        if len(self) < 2:
            raise ValueError("one window cannot be shared out; more, or longer, performances are needed")
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        count = min(max(1, round(share * len(self))), len(self) - 1)
        return self.take(order[count:].sort().values), self.take(order[:count].sort().values)


def _cut(
    sequence: PlayedSequence, space: PointSpace, params: Audio2BodyParams, length: int
) -> tuple[NDArray[np.float32], ...]:
    """Windows of one sequence: sound, target, mask, residual."""
    components = space.encode(sequence.points)
    residual = np.square(sequence.points - space.decode(components)).mean(axis=1)
    marks = [] if sequence.marks is None else [sequence.marks]
    frames = np.column_stack([components, *marks, residual])
    sound = continued(steps_of(sequence.sound, params.upsample), params.delay_steps)
    targets = later(steps_of(frames, params.upsample), params.delay_steps)
    mask = later(usable_steps(sequence.learnt, params.upsample)[:, None], params.delay_steps)
    values = [_windows(each.astype(np.float32), length) for each in (sound, targets, mask)]
    return values[0], values[1][..., :-1], values[2][..., 0], values[1][..., -1]


def _windows(steps: NDArray[np.float32], length: int) -> NDArray[np.float32]:
    """(W, length, C) windows of steps (S, C), zeros after the last."""
    padded = np.pad(steps, ((0, -len(steps) % length), (0, 0)))
    return padded.reshape(-1, length, steps.shape[1])


@dataclass(frozen=True, eq=False)
class PlayedSet:
    """Performances of one instrument and one set of points.

    Parameters
    ----------
    sequences : tuple of PlayedSequence
    skeleton : of the points
    instrument : "piano" or "violin"
    params : Audio2BodyParams that they were read by
    reference : Reference that their points are placed by
    source : str, names of where they come from
    notes : tuple of str, one for each performance left out, with the reason
    """

    sequences: tuple[PlayedSequence, ...]
    skeleton: Skeleton
    instrument: str
    params: Audio2BodyParams
    reference: Reference
    source: str = ""
    notes: tuple[str, ...] = ()
