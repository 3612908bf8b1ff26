"""A bank of movements that dances start from, and the beginning and the end of every training.

The bank is a few short clips of training motion, kept beside a generator's weights. Its file is called
`<weights>_poses.safetensors` and holds one tensor, ``poses`` (K, T0, C) in 16 bits, and the name of each clip's dance
in its header.

A training begins with its folder, which is opened; its phases are run, and its weights are written.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from safetensors.numpy import save
from torch import nn

from harmolab.files import PathLike, atomic_write, plain, reading
from harmolab.systems.training.about import DEFAULT_STEM, json_file, weights_stem
from harmolab.systems.training.checkpoints import Sides, TrainOptions, open_folder
from harmolab.systems.training.layers import PATH_CHANNELS
from harmolab.systems.training.loop import Batching, Phase, Units, check_shards, fit
from harmolab.systems.training.motion_code import frames_at
from harmolab.systems.training.units import UnitSet
from harmolab.systems.training.weights import read_tensors, save_weights
from harmolab.types import FloatArray

if TYPE_CHECKING:
    from lightning_fabric import Fabric

# The bank of movements that a dance may start from

POSES = 48  # clips of a bank
_BEATS_OF_METER = 4  # the shortest meter, so that its unit has the most beats before it
_MAX_BYTES = 64 * 2**20
_FORMAT = "harmolab poses 1"
# Largest value of a code: metres, metres per second or radians per second.
_LARGEST = 1000.0


@dataclass(frozen=True, eq=False)
class PoseBank:
    """Short motion codes, each of the beats before a meter of four.

    Parameters
    ----------
    poses : (K, T0, C) array, not normalised
    dances : K names, "" where unknown
    """

    poses: FloatArray
    dances: tuple[str, ...]

    def __post_init__(self) -> None:
        poses = np.array(self.poses, dtype=np.float64)
        if poses.ndim != 3 or 0 in poses.shape or not np.isfinite(poses).all() or np.abs(poses).max() > _LARGEST:
            raise ValueError(f"poses must be finite motion codes (clips, frames, channels), got shape {poses.shape}")
        if len(self.dances) != len(poses):
            raise ValueError(f"each of the {len(poses)} clips of poses needs a dance, got {len(self.dances)} names")
        poses.setflags(write=False)
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "dances", tuple(map(str, self.dances)))

    def of(self, dance: str | None) -> FloatArray:
        """The clips (K', T0, C) of a dance; all of them for None, and where no clip is of that dance."""
        rows = [row for row, name in enumerate(self.dances) if name == dance]
        return self.poses[rows] if rows else self.poses

    def drawn(self, dance: str | None, seed: int) -> FloatArray:
        """The clip (T0, C) that a seed draws; consecutive seeds draw different clips, until each was drawn once."""
        clips = self.of(dance)
        return clips[np.random.default_rng(0).permutation(len(clips))[seed % len(clips)]]


def pose_bank(units: UnitSet, *, seed: int = 0) -> PoseBank:
    """A bank of the movements before `POSES` meters of units (those of the training split), dance by dance.

    Only units with a meter of four are taken, so that all clips are equally many beats long; each is brought to the
    median number of frames. Dances share the places evenly, as far as they have units.

    Raises
    ------
    ValueError
        If no unit has a meter of four beats.
    """
    before = units.features.unit_beats - _BEATS_OF_METER
    # A beat between two frames belongs to the frame before it.
    ends = [(unit, (unit.n_prior - 1e-3) / units.features.fps) for unit in units.units]
    usable = [unit for unit, end in ends if (unit.beats < end).sum() == before]
    if not usable:
        raise ValueError(f"no unit has a meter of {_BEATS_OF_METER} beats to take starting poses from")
    sample = [usable[row] for row in spread([unit.dance for unit in usable], POSES, np.random.default_rng(seed))]
    frames = round(float(np.median([unit.n_prior for unit in sample])))
    clips = [retimed(unit.motion[: unit.n_prior], frames) for unit in sample]
    return PoseBank(np.stack(clips), tuple(unit.dance for unit in sample))


def spread(dances: Sequence[str], count: int, rng: np.random.Generator) -> list[int]:
    """Rows of up to `count` of what has these dances, at random, the dances in turn."""
    shuffled = rng.permutation(len(dances))[::-1].tolist()
    queues = [[row for row in shuffled if dances[row] == dance] for dance in sorted({*dances})]
    return [row for turn in zip_longest(*queues) for row in turn if row is not None][:count]


def retimed(code: ArrayLike, n_frames: int) -> FloatArray:
    """A motion code (T, C) danced in `n_frames` frames: (n_frames, C). Joints are interpolated, rates scaled.

    >>> retimed([[0.0, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]], 3)[:, :2]
    array([[0.        , 0.66666667],
           [0.5       , 0.66666667],
           [1.        , 0.66666667]])
    """
    code = np.asarray(code, dtype=np.float64)
    stretched = frames_at(code, np.linspace(0, len(code) - 1, n_frames))
    stretched[:, -PATH_CHANNELS:] *= len(code) / n_frames
    return stretched


def poses_path(weights: PathLike) -> Path:
    """The file of the bank of some weights: beside `<weights>.safetensors`; a folder stands for "model" in it."""
    stem = weights_stem(weights)
    return stem.with_name(f"{stem.name}_poses.safetensors")


def save_poses(weights: PathLike, bank: PoseBank) -> None:
    """Write a bank beside the weights of that name; the file appears whole or not at all."""
    about = {"format": _FORMAT, "dances": json.dumps(bank.dances)}
    with atomic_write(poses_path(weights)) as part:
        part.write_bytes(save({"poses": bank.poses.astype(np.float16)}, metadata=about))


def load_poses(weights: PathLike, *, n_channels: int | None = None) -> PoseBank:
    """The bank beside the weights of that name.

    Parameters
    ----------
    weights : str or path, as for `save_poses`
    n_channels : int, optional
        Channels C that the generator needs; another number is an error.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(poses_path(weights), "a bank of poses", max_bytes=_MAX_BYTES) as path:
        tensors, about = read_tensors(path)
        if about.get("format") != _FORMAT or list(tensors) != ["poses"]:
            raise ValueError("is no bank of poses; write one with save_poses")
        poses = tensors["poses"].double().numpy()
        if n_channels is not None and poses.shape[-1:] != (n_channels,):
            raise ValueError(f"holds poses of shape {poses.shape}; this generator needs {n_channels} channels")
        return PoseBank(poses, tuple(json.loads(about["dances"])))


# A run: its folder is opened, its phases are run, its weights are written


@dataclass(frozen=True, eq=False)
class Run:
    """A training whose folder is open. All processes call its methods; the first one writes.

    Parameters
    ----------
    fabric : Fabric, launched
    options : TrainOptions
    settings : JSON-able, as they are stored
    batching : how units are put into batches
    """

    fabric: Fabric
    options: TrainOptions
    settings: dict[str, Any]
    batching: Batching

    @property
    def folder(self) -> Path:
        """Folder of the run."""
        return Path(self.options.out)

    def fit(self, phases: Sequence[Phase], units: Units) -> None:
        """`harmolab.systems.training.loop.fit` in this folder."""
        fit(
            self.fabric, phases, units, self.batching, self.folder, settings=self.settings, resume=self.options.resume,
            report=self.options.report,
        )  # fmt: skip

    def train_once(self, stem: str, train: Callable[[], nn.Module], seed: int) -> Path:
        """Stem of the weights of a network that is trained before the phases, unless an earlier start kept it."""
        if self.fabric.is_global_zero and not json_file(self.folder / stem).is_file():
            save_weights(self.folder / stem, train(), {"seed": seed})
        self.fabric.barrier()
        return self.folder / stem

    def save_movements(self, bank: Callable[[], PoseBank]) -> None:
        """Write the movements that dances may start from, unless an earlier start kept them."""
        if self.fabric.is_global_zero and not poses_path(self.folder / DEFAULT_STEM).is_file():
            save_poses(self.folder / DEFAULT_STEM, bank())
        self.fabric.barrier()

    def save(self, network: nn.Module, about: Mapping[str, Any]) -> None:
        """Write the trained network, with JSON-able lines about its training."""
        if self.fabric.is_global_zero:
            save_weights(self.folder / DEFAULT_STEM, network, about)


@contextmanager
def open_run(
    fabric: Fabric, options: TrainOptions, split: Sides, settings: Mapping[str, Any], batching: Batching, n_units: int
) -> Iterator[Run]:
    """Lock the folder of a run, with its settings and split, by the first process; wait for all at the end.

    Raises
    ------
    ValueError
        If a batch of so many units cannot be shared by so many processes; if `options.out` holds something and `resume`
        is off, holds a run with other settings, another split, other recordings or a damaged one, or another process
        trains in it.
    """
    check_shards(n_units, batching, fabric.world_size)
    run = Run(fabric, options, plain(dict(settings)), batching)
    first = fabric.is_global_zero
    folder = partial(open_folder, run.folder, run.settings, split, resume=options.resume, corpus=options.corpus)
    with folder() if first else nullcontext():
        fabric.barrier()
        yield run
        fabric.barrier()
