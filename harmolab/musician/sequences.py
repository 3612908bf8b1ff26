"""Performances as the network takes them: sound and principal components of the points, frame by frame; windows.

What is heard and where the points are stand side by side at the network's rate; training windows are cut out of them.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton
from harmolab.files import Progress, named_faults, silent
from harmolab.musician import cleaning
from harmolab.musician.cleaning import CleaningRules, Reference
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance
from harmolab.musician.sound_features import note_features, sound_features
from harmolab.systems.training.layers import channel_statistics
from harmolab.systems.training.loop import Rows
from harmolab.types import Audio, BoolArray, FloatArray, Notes, SingleArray

NO_SOUND = "has no sound; render its notes into audio.wav, or learn from notes in Python (Audio2BodyParams.hears)"
NO_NOTES = "has no notes.csv, from which this network learns"

# Principal components of the points (Sec. 3.4), steps between frames, delay from sound to movement

LEAST_SCALE = 1e-6
A = TypeVar("A", bound=np.generic)


@dataclass(frozen=True, eq=False)
class PointSpace:
    """Points as a few numbers: the mean, and the directions of most variance.

    Parameters
    ----------
    mean : (2 P,) array
    basis : (n, 2 P) array, orthonormal rows; the largest entry of each is positive
    sizes : (n,) array, what a component is divided by
    """

    mean: FloatArray
    basis: FloatArray
    sizes: FloatArray

    @classmethod
    def empty(cls, points: int, components: int) -> "PointSpace":
        """One of so many points and components that nothing was learnt for."""
        return cls(np.zeros(2 * points), np.zeros((components, 2 * points)), np.ones(components))

    @classmethod
    def fit(cls, frames: FloatArray, components: float, *, even_scale: bool = True) -> "PointSpace":
        """The space of frames (F, 2 P): so many components, or as many as hold a share (below 1) of the variance.

        Parameters
        ----------
        frames : accepted frames of the training recordings
        components : number, or share of the variance
        even_scale : one scale for all, the largest standard deviation; else each component's own

        Raises
        ------
        ValueError
            For fewer than two frames.
        """
        if len(frames) < 2:
            raise ValueError(f"principal components need two frames or more, got {len(frames)}")
        mean = frames.mean(axis=0)
        centred = frames - mean
        variances, vectors = np.linalg.eigh(centred.T @ centred / len(frames))
        variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1].T
        count = _count(variances, components)
        basis = vectors[:count]
        largest = np.abs(basis).argmax(axis=1)
        basis = basis * np.sign(basis[np.arange(count), largest])[:, None]
        deviations = np.sqrt(variances[:count])
        scale = np.full(count, deviations.max()) if even_scale else deviations
        return cls(mean, basis, np.maximum(scale, LEAST_SCALE))

    def encode(self, frames: FloatArray) -> FloatArray:
        """Components (..., n), scaled, of frames (..., 2 P)."""
        components: FloatArray = (frames - self.mean) @ self.basis.T / self.sizes
        return components

    def decode(self, components: FloatArray) -> FloatArray:
        """Frames (..., 2 P) of scaled components (..., n)."""
        frames: FloatArray = (components * self.sizes) @ self.basis + self.mean
        return frames


def _count(variances: FloatArray, components: float) -> int:
    """Number of components to keep of those that there are."""
    if components >= 1:
        return min(int(components), len(variances))
    shares = np.cumsum(variances) / max(float(variances.sum()), 1e-30)
    return min(int(np.searchsorted(shares, components - 1e-12)) + 1, len(variances))


def steps_of(values: NDArray[A], upsample: int) -> NDArray[A]:
    """Frames (T, C) as steps, straight lines between them: (upsample (T - 1) + 1, C)."""
    after = np.concatenate([values[1:], values[-1:]])
    shares = (np.arange(upsample) / upsample).astype(values.dtype)[None, :, None]
    between: NDArray[A] = values[:, None] * (1 - shares) + after[:, None] * shares
    return between.reshape(-1, values.shape[1])[: upsample * (len(values) - 1) + 1]


def later(values: NDArray[A], delay: int) -> NDArray[A]:
    """Targets (S, C) moved `delay` steps later, zeros before them: (S + delay, C). The first ones count for nothing."""
    return np.concatenate([np.zeros((delay, *values.shape[1:]), values.dtype), values])


def continued(values: NDArray[A], delay: int) -> NDArray[A]:
    """Sound (S, F) with its last step held for `delay` more: (S + delay, F), so that no pose is lost."""
    return np.concatenate([values, np.repeat(values[-1:], delay, axis=0)])


def frames_of(steps: NDArray[A], upsample: int, delay: int) -> NDArray[A]:
    """Predicted steps (S + delay, C) back as frames (T, C): every `upsample`-th, from the one after the delay."""
    return steps[delay::upsample]


# Sequences, splits and training windows

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
    sound: SingleArray
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
    def of(cls, sides: Sequence[Sequence[Performance]]) -> Self:
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
    others = [sequences[number] for number in np.roll(order, 1)[np.argsort(order)]]
    pairs = zip(sequences, others, strict=True)
    return [replace(own, sound=np.resize(other.sound, own.sound.shape)) for own, other in pairs]


def fitted_space(sequences: Sequence[PlayedSequence], params: Audio2BodyParams) -> PointSpace:
    """Principal components of the frames that are learnt of training sequences; ValueError where there are none."""
    frames = np.concatenate([sequence.points[sequence.learnt] for sequence in sequences])
    return PointSpace.fit(frames, params.components, even_scale=params.even_scale)


def sound_statistics(sequences: Sequence[PlayedSequence]) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (F,) of what is heard in training sequences."""
    sound = torch.from_numpy(np.concatenate([sequence.sound for sequence in sequences]))
    return channel_statistics(sound[None], torch.ones(1, len(sound)))


@dataclass(frozen=True, eq=False)
class PlayedWindows(Rows):
    """Windows of steps (`harmolab.systems.training.loop.Units`).

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

    @classmethod
    def of(
        cls,
        sequences: Sequence[PlayedSequence],
        space: PointSpace,
        params: Audio2BodyParams,
        device: torch.device | str = "cpu",
    ) -> "PlayedWindows":
        """All windows of some sequences, one after the other; the last one of each is filled up with silence."""
        length = params.sequence * params.carry
        parts = [_cut(sequence, space, params, length) for sequence in sequences]
        return cls(*(torch.from_numpy(np.concatenate(values)).to(device) for values in zip(*parts, strict=True)))

    def drawn_apart(self, share: float, seed: int) -> tuple["PlayedWindows", "PlayedWindows"]:
        """The windows without a random share of them, and that share; ValueError unless both can have one."""
        if len(self) < 2:
            raise ValueError("one window cannot be shared out; more, or longer, performances are needed")
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        count = min(max(1, round(share * len(self))), len(self) - 1)
        return self.take(order[count:].sort().values), self.take(order[:count].sort().values)


def _cut(sequence: PlayedSequence, space: PointSpace, params: Audio2BodyParams, length: int) -> tuple[SingleArray, ...]:
    """Windows of one sequence: sound, target, mask, residual."""
    components = space.encode(sequence.points)
    residual = np.square(sequence.points - space.decode(components)).mean(axis=1)
    marks = [] if sequence.marks is None else [sequence.marks]
    frames = np.column_stack([components, *marks, residual])
    sound = continued(steps_of(sequence.sound, params.upsample), params.delay_steps)
    targets = later(steps_of(frames, params.upsample), params.delay_steps)
    mask = later(cleaning.usable_steps(sequence.learnt, params.upsample)[:, None], params.delay_steps)
    values = [_windows(each.astype(np.float32), length) for each in (sound, targets, mask)]
    return values[0], values[1][..., :-1], values[2][..., 0], values[1][..., -1]


def _windows(steps: SingleArray, length: int) -> SingleArray:
    """(W, length, C) windows of steps (S, C), zeros after the last."""
    return np.pad(steps, ((0, -len(steps) % length), (0, 0))).reshape(-1, length, steps.shape[1])


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
    """

    sequences: tuple[PlayedSequence, ...]
    skeleton: Skeleton
    instrument: str
    params: Audio2BodyParams
    reference: Reference
    source: str = ""


# From performances to sequences: points cleaned, placed and at the network's rate; the sound beside them


def played_set(
    performances: Sequence[Performance], params: Audio2BodyParams, split: PlayedSplit, *, progress: Progress = silent
) -> PlayedSet:
    """Performances as the network takes them, placed as the first one of the training side is.

    Those of the test side are cleaned whatever `params.reject` and `params.gaps` say, and keep their time line.

    Raises
    ------
    ValueError
        Where they are of several instruments or sets of points, all frames of one are rejected, or one lacks the sound
        or the notes that are to be heard; it names the performance.
    """
    first = next((each for each in performances if each.name == split.train[0]), None)
    if first is None:
        raise ValueError(f"the split names {split.train[0]!r}, which is no performance here")
    check_alike(performances)
    reference = cleaning.reference_configuration(cleaning.cleaned(at_rate(first, params.fps), cleaning_rules(first)))
    sequences = tuple(
        read_sequence(each, params, reference, is_test=each.name in split.test)
        for each in progress(performances, "reading performances")
    )
    source = ", ".join(dict.fromkeys(each.source for each in performances if each.source))
    skeleton, instrument = first.motion.skeleton, first.instrument
    return PlayedSet(sequences, skeleton, instrument, params, reference, source)


def check_alike(performances: Sequence[Performance]) -> None:
    """ValueError unless performances are of one instrument and one set of points."""
    first = performances[0]
    for other in performances[1:]:
        if other.instrument != first.instrument:
            raise ValueError(f"{first.name} is played on a {first.instrument}, {other.name} on a {other.instrument}")
        if other.motion.skeleton != first.motion.skeleton:
            own, others = len(first.motion.skeleton.joints), len(other.motion.skeleton.joints)
            raise ValueError(f"{first.name} has {own} points, {other.name} {others}; train on one set of points")


def at_rate(performance: Performance, fps: float) -> Performance:
    """A performance whose points have a frame rate; a point between two is detected where both are."""
    motion = performance.motion
    if motion.fps == fps:
        return performance
    resampled = resample_motion(motion, fps)
    places = np.arange(resampled.n_frames) * motion.fps / fps
    before = np.minimum(np.floor(places + 1e-6).astype(np.int64), motion.n_frames - 1)
    after = np.minimum(np.ceil(places - 1e-6).astype(np.int64), motion.n_frames - 1)
    return replace(performance, motion=resampled, detected=performance.detected[before] & performance.detected[after])


def read_sequence(
    performance: Performance, params: Audio2BodyParams, reference: Reference, *, is_test: bool = False
) -> PlayedSequence:
    """A performance as the network takes it; ValueError names one that cannot be.

    Parameters
    ----------
    performance : Performance
    params : Audio2BodyParams
    reference : that its points are placed by
    is_test : cleaned, and with its own time line, whatever `params` say of training
    """
    performance = at_rate(performance, params.fps)
    rules = cleaning_rules(performance) if is_test or params.reject else CleaningRules.off()
    result = cleaning.cleaned(performance, rules)
    motion = cleaning.placed(result, reference, alignment=params.alignment)
    frames, learnt = cleaning.training_frames(motion.valid, "mask" if is_test else params.gaps)
    points = motion.positions[frames].reshape(len(frames), -1)
    with named_faults(performance.name):
        sound = input_features(performance.audio, performance.notes, params, motion.n_frames, start=performance.offset)
    return PlayedSequence(performance.name, performance.piece, sound[frames], points, learnt, result.accepted[frames])


def cleaning_rules(performance: Performance) -> CleaningRules:
    """The rules for a performance: hands without a body have no box whose width could measure a jump."""
    has_body = "left_shoulder" in performance.motion.skeleton.joints
    return CleaningRules() if has_body else CleaningRules(swapped=None, jump=None, centre=None)


def input_features(
    audio: Audio | None, notes: Notes | None, params: Audio2BodyParams, n_frames: int, *, start: float
) -> SingleArray:
    """The notes or the sound of a recording, as a network hears it: so many frames (T, F) from second `start` on."""
    if params.hears == "notes":
        if notes is None:
            raise ValueError("its notes are not known; hear the sound")
        return note_features(notes, params.fps, n_frames, start=start)
    if audio is None:
        raise ValueError(NO_SOUND)
    return sound_features(audio, params, n_frames, start=start)
