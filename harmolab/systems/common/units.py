"""Training material of a generator: a unit, a set of units of one body, a padded batch (paper Sec. 4.1)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.motion_code import decode_motion
from harmolab.systems.common.priors import initial_poses
from harmolab.types import FloatArray, Motion, Skeleton

SingleArray = NDArray[np.float32]
A = TypeVar("A")  # array or tensor


@dataclass(frozen=True, eq=False)
class DanceUnit:
    """A meter with the beats before it, and the motion danced to both. Frame 0 is the first of the beats before.

    Parameters
    ----------
    name : str, of the unit: recording, number of its first beat, beats before + beats of the meter
    sequence : str, corpus folder and folder of the recording
    dance : str, "" when unknown
    groups, meter_groups : frozenset of str
        Motion groups (figures) that the whole unit touches, and those that the meter itself touches.
    start : float, seconds, audio time of frame 0
    audio : (T, F) array, A_f
    motion : (T, C) array, the motion code, not normalised
    index : (T,) array, TI: 1 in the beats before, 0 in the meter
    beats : (B,) array, seconds from frame 0
    strengths : (B,) array
    fps : float, hertz
    extra : bool
        True for an additional training unit, which overlaps others; a test never uses two that overlap.
    """

    name: str
    sequence: str
    dance: str
    groups: frozenset[str]
    meter_groups: frozenset[str]
    start: float
    audio: SingleArray
    motion: SingleArray
    index: SingleArray
    beats: FloatArray
    strengths: FloatArray
    fps: float
    extra: bool = False

    def __post_init__(self) -> None:
        if not len(self.audio) == len(self.motion) == len(self.index):
            lengths = f"{len(self.audio)}, {len(self.motion)} and {len(self.index)}"
            raise ValueError(f"{self.name}: audio, motion and index must be equally long, got {lengths} frames")
        if self.beats.shape != self.strengths.shape:
            raise ValueError(f"{self.name}: {self.beats.size} beats have {self.strengths.size} strengths")
        if not 0 < self.n_prior < self.n_frames:
            raise ValueError(f"{self.name}: {self.n_prior} of {self.n_frames} frames come before the meter; needs both")

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.motion)

    @property
    def n_prior(self) -> int:
        """Number of frames of the beats before the meter (TI = 1)."""
        return int(self.index.sum())

    @property
    def meter_start(self) -> float:
        """Audio time of the meter's first frame, seconds."""
        return self.start + self.n_prior / self.fps

    @property
    def end(self) -> float:
        """Audio time at which the last frame ends, seconds."""
        return self.start + self.n_frames / self.fps


@dataclass(frozen=True, eq=False)
class UnitSet:
    """Units of one body, to train or test a generator.

    Parameters
    ----------
    units : tuple of DanceUnit, names all different
    skeleton : Skeleton
    bone_lengths : (J,) array, metres, mean over the recordings; 0 where a joint has no parent
    features : FeatureParams of their features
    source : str, names of the corpora
    notes : tuple of str, one for each recording left out, with the reason
    """

    units: tuple[DanceUnit, ...]
    skeleton: Skeleton
    bone_lengths: FloatArray
    features: FeatureParams
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [unit.name for unit in self.units]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"two units are called {twice!r}; corpora of the same name need different folders")

    def __len__(self) -> int:
        return len(self.units)

    def decoded(self, code: FloatArray) -> Motion:
        """The motion that a code (T, C) of these units stands for."""
        fps = self.features.fps
        return Motion(decode_motion(code, fps, self.skeleton), fps, self.skeleton)

    def select(self, names: Collection[str] | NDArray[np.bool_]) -> UnitSet:
        """The units with these names, or those where a (len,) mask is True, in the order they have here.

        Raises
        ------
        ValueError
            For a name that no unit has, or a mask of another length.
        """
        if isinstance(names, np.ndarray) and names.dtype == bool:
            if names.shape != (len(self),):
                raise ValueError(f"the mask must have one entry per unit ({len(self)}), got shape {names.shape}")
            return replace(self, units=tuple(unit for unit, keep in zip(self.units, names, strict=True) if keep))
        selected = {str(name) for name in names}
        if missing := sorted(selected - {unit.name for unit in self.units}):
            raise ValueError(f"no unit is called {missing[0]!r}")
        return replace(self, units=tuple(unit for unit in self.units if unit.name in selected))


@dataclass(frozen=True, eq=False)
class Batch(Generic[A]):
    """Units padded to the longest of them, arrays or tensors of single precision.

    Padding repeats the last frame; its mask is 0.

    Parameters
    ----------
    audio : (N, T, F); motion, initial : (N, T, C); index, mask : (N, T)
        `initial` holds V_f of Eq. 23; `index` is 0 in the padding.
    beats, strengths, beat_mask : (N, B), seconds from frame 0, strengths, 1 where there is a beat
    """

    audio: A
    motion: A
    initial: A
    index: A
    mask: A
    beats: A
    strengths: A
    beat_mask: A


def collate(units: Sequence[DanceUnit]) -> Batch[SingleArray]:
    """A batch of units, padded to the longest.

    Raises
    ------
    ValueError
        Without units.
    """
    if not units:
        raise ValueError("a batch needs at least one unit")
    return Batch(
        _stacked([unit.audio for unit in units]),
        _stacked([unit.motion for unit in units]),
        _stacked([initial_poses(unit.motion, unit.index) for unit in units]),
        _stacked([unit.index for unit in units], fill=0.0),
        _stacked([np.ones(unit.n_frames) for unit in units], fill=0.0),
        _stacked([unit.beats for unit in units], fill=0.0),
        _stacked([unit.strengths for unit in units], fill=0.0),
        _stacked([np.ones(unit.beats.size) for unit in units], fill=0.0),
    )


def _stacked(arrays: Sequence[NDArray[Any]], fill: float | None = None) -> SingleArray:
    """Arrays (L, ...) of different lengths as one, (N, longest, ...); filled up with `fill` or the last entry."""
    longest = max(len(array) for array in arrays)
    table = np.zeros((len(arrays), longest, *arrays[0].shape[1:]), dtype=np.float32)
    for row, array in zip(table, arrays, strict=True):
        row[: len(array)] = array
        if len(array):
            row[len(array) :] = array[-1] if fill is None else fill
    return table
