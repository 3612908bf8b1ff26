"""Systems of one network and a bank of movements, what they share: dancing, saving, loading, material to train on."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypeVar

from torch import nn

from harmolab.io.files import PathLike, Progress, silent
from harmolab.systems.common.about import DEFAULT_STEM, read_about
from harmolab.systems.common.checkpoints import check_folder
from harmolab.systems.common.dancing import synthesize_dance
from harmolab.systems.common.feature_params import FeatureParams
from harmolab.systems.common.history import Report
from harmolab.systems.common.poses_bank import PoseBank, load_poses, poses_path, save_poses
from harmolab.systems.common.splits import Split, split_units
from harmolab.systems.common.unit_corpus import load_units
from harmolab.systems.common.weights import load_weights, save_weights
from harmolab.types import Audio, BeatTrack, Motion

Notice = Callable[[str], None]
R = TypeVar("R")
PRESETS = ("small", "paper")


class NetworkSystem:
    """A trained network that dances (`harmolab.systems.common.dancing.Dancer`), of the class `network`.

    Parameters
    ----------
    generator : the network; it knows its audio features
    poses : PoseBank, optional
        Movements to start from. Without: the mean pose at rest.
    meta : JSON-able mapping about its training, kept with the weights
    """

    network: ClassVar[type[nn.Module]]

    def __init__(self, generator: Any, poses: PoseBank | None = None, meta: Mapping[str, Any] | None = None) -> None:
        self.generator, self.poses, self.meta = generator, poses, dict(meta or {})

    @property
    def dances(self) -> tuple[str, ...]:
        """Dances of the movements that it starts from."""
        return () if self.poses is None else tuple(self.poses.dances)

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str | None = None,
        plant_feet: bool = True,
        progress: Progress = silent,
    ) -> Motion:
        """A dance to music (`harmolab.systems.System`); `dance` and `plant_feet` as in `synthesize_dance`."""
        return synthesize_dance(
            self.generator, audio, beats=beats, start=start, seconds=seconds, seed=seed, poses=self.poses,
            initial=initial, dance=dance, plant_feet=plant_feet, progress=progress,
        )  # fmt: skip

    def save(self, folder: PathLike) -> None:
        """Write weights, and poses if there are any, to a folder; it is made unless it exists."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        save_weights(Path(folder) / DEFAULT_STEM, self.generator, self.meta)
        if self.poses is not None:
            save_poses(Path(folder) / DEFAULT_STEM, self.poses)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file; errors name the file."""
        generator: Any = load_weights(folder, cls.network)
        poses = load_poses(folder, n_channels=generator.n_motion) if poses_path(folder).is_file() else None
        return cls(generator, poses, read_about(folder)["meta"])


class PresetSystem(NetworkSystem):
    """A system whose sizes, losses and schedule are one record with presets, `settings`, and that has no other options.

    It hears the features of the paper's own system, so that systems compared hear the same.
    """

    settings: ClassVar[type[Any]]
    presets: ClassVar[Sequence[str]] = PRESETS  # the first is taken where none is named
    short_names: ClassVar[Mapping[str, str]] = MappingProxyType({})  # other names of some fields -> their own

    @classmethod
    def material(cls, data: Sequence[PathLike], params: Any, progress: Progress) -> dict[str, Any]:
        """More keywords for `train_network`: the parts of the corpora that are not in their units."""
        return {}

    @classmethod
    def train_network(cls, split: Split, folder: PathLike, **options: Any) -> None:
        """Train the network in a folder; options: `params`, `resume`, `fabric`, `report`, and those of `material`."""
        raise NotImplementedError

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        preset: str = "",
        step: int = 2,
        split_seed: int = 0,
        resume: bool = False,
        accelerator: str = "auto",
        report: Report = lambda row, end: None,
        notice: Notice = lambda line: None,
        progress: Progress = silent,
        **changes: Any,
    ) -> Self:
        """The system trained on corpora, in a folder of its own.

        Parameters
        ----------
        data : folders of recordings
        out : folder; new or empty unless `resume`
        preset : one of `presets`, of `settings`
        step : int, beats between the starts of training units
        split_seed : int, of the split by motion group
        resume : go on where the run in `out` stopped; start it when there is none
        accelerator : "auto", "cpu" or "cuda"
        report, notice : called after each epoch with its row and its phase's end; with a line about the units
        changes : other values for fields of `settings`, such as ``seed``; `short_names` are taken, too

        Raises
        ------
        ValueError
            For an unknown name or value, a folder that holds something else, or too few recordings.
        """
        from harmolab.systems.common.phases import make_fabric

        preset = preset or cls.presets[0]
        check_choice("preset", preset, cls.presets)
        changes = {cls.short_names.get(name, name): value for name, value in changes.items()}
        params = changed(getattr(cls.settings, preset)(), changes)
        split = training_material(
            data, out, FeatureParams.paper(), step=step, split_seed=split_seed, resume=resume, notice=notice,
            progress=progress,
        )  # fmt: skip
        more = cls.material(data, params, progress)
        fabric = make_fabric(accelerator=accelerator)
        cls.train_network(split, out, params=params, resume=resume, fabric=fabric, report=report, **more)
        fabric.barrier()
        return cls.load(out)


def training_material(
    data: Sequence[PathLike],
    out: PathLike,
    features: FeatureParams,
    *,
    step: int,
    split_seed: int,
    resume: bool,
    notice: Notice,
    progress: Progress = silent,
) -> Split:
    """Units of corpora, split by motion group; `notice` is told what was left out, and how many there are.

    Raises
    ------
    ValueError
        For too few recordings, or a folder `out` that holds something else; asked first, since reading takes minutes.
    """
    if int(os.environ.get("RANK", 0)) == 0:
        check_folder(Path(out), resume=resume)
    units = load_units([Path(root) for root in data], features, step=step, progress=progress)
    split = split_units(units, seed=split_seed)
    for line in units.notes:
        notice(f"left out: {line}")
    counts = ", ".join(f"{len(getattr(split, side))} {side}" for side in ("train", "validation", "test"))
    notice(f"units: {counts}; data: {split.train.source}")
    return split


def changed(settings: R, changes: Mapping[str, Any]) -> R:
    """Settings (a dataclass) with other values for some fields; ValueError for a field that they do not have."""
    if other := sorted(changes.keys() - {field.name for field in fields(settings)}):  # type: ignore[arg-type]
        raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
    return replace(settings, **changes)  # type: ignore[type-var]


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """ValueError unless a setting is one of those there are."""
    if value not in choices:
        raise ValueError(f"{name} must be {' or '.join(choices)}, got {value!r}")
