"""Systems of one network and a bank of movements, what they share: dancing, saving, loading, material to train on."""

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

from torch import nn

from harmolab.data.recordings import find_recordings, recorded_files
from harmolab.files import PathLike, Progress, silent
from harmolab.score import check_whole
from harmolab.systems.training.about import DEFAULT_STEM, corpora, read_about
from harmolab.systems.training.checkpoints import Measure, Notice, Report, TrainOptions, locked
from harmolab.systems.training.features import FeatureParams, check_choice
from harmolab.systems.training.loop import check_accelerator
from harmolab.systems.training.requests import DanceRequest, DanceSystem
from harmolab.systems.training.runs import PoseBank, load_poses, poses_path, save_poses
from harmolab.systems.training.song_to_dance import danced
from harmolab.systems.training.splits import SIDES, Split, split_units
from harmolab.systems.training.units import UnitSet, load_units
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Motion

R = TypeVar("R")
PRESETS = ("small", "paper")


class Learner:
    """A class that is trained on corpora by one door, `train`; the keywords of its own are those of `learn`.

    Attributes
    ----------
    result : class of the network that a training gives, where that is all that is loaded
    """

    result: ClassVar[type[nn.Module]]

    @classmethod
    def learn(cls, data: list[PathLike], options: TrainOptions, **own: Any) -> None:
        """Train on corpora, in the folder of `options`; `own` keywords are checked before anything is written."""
        raise NotImplementedError

    @classmethod
    def files(cls, root: PathLike) -> list[Path]:
        """The files of a corpus that are learnt from."""
        return [file for folder in find_recordings(root).folders for file in recorded_files(folder)]

    @classmethod
    def digests(cls, data: Sequence[PathLike]) -> dict[str, str]:
        """File of some corpora, from the name of its corpus on -> SHA-256."""
        digests = {}
        for root, file in ((top, file) for top in data for file in cls.files(top)):
            name = Path(Path(root).resolve().name, file.relative_to(root)).as_posix()
            with file.open("rb") as content:
                digests[name] = hashlib.file_digest(content, "sha256").hexdigest()
        return digests

    @classmethod
    def load(cls, folder: PathLike) -> Any:
        """The result of the training in a folder; errors name the file."""
        return load_weights(folder, cls.result)

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        resume: bool = False,
        accelerator: str = "auto",
        report: Report = TrainOptions.report,
        notice: Notice = TrainOptions.notice,
        progress: Progress = silent,
        measure: Measure = TrainOptions.measure,
        **own: Any,
    ) -> Any:
        """Train on corpora, in a folder of its own, and return the result.

        Parameters
        ----------
        data : sequence of str or path
            Folders of recordings.
        out, resume, accelerator, report, notice, progress, measure
            As of `harmolab.systems.training.checkpoints.TrainOptions`.
        **own
            Keywords of `learn`: ``preset``, ``split_seed``, or other values for fields of the settings, such as
            ``seed``.

        Raises
        ------
        ValueError
            For an unknown name or value, a path in place of a list, a folder that holds something else, or too few
            recordings.
        """
        check_accelerator(accelerator)
        check_whole(**{name: own[name] for name in ("step", "split_seed") if name in own})
        corpus = partial(cls.digests, folders := corpora(data))
        first = int(os.environ.get("RANK", 0)) == 0
        with locked(Path(out), resume=resume, corpus=corpus) if first else nullcontext():
            cls.learn(folders, TrainOptions(out, resume, accelerator, report, notice, progress, measure, corpus), **own)
        return cls.load(out)


class NetworkSystem(Learner, DanceSystem):
    """A trained network that dances (`harmolab.systems.training.song_to_dance.DancerNetwork`), of the class `network`.

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

    def respond(self, request: DanceRequest) -> Motion:
        """The dance that is asked for (`harmolab.systems.training.song_to_dance`)."""
        return danced(self.generator, self.poses, request)

    def save(self, folder: PathLike) -> None:
        """Write weights, and poses if there are any, to a folder; it is made unless it exists."""
        save_weights(Path(folder) / DEFAULT_STEM, self.generator, self.meta)
        if self.poses is not None:
            save_poses(Path(folder) / DEFAULT_STEM, self.poses)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file; errors name the file."""
        generator: Any = load_weights(folder, cls.network)
        poses = load_poses(folder, n_channels=generator.n_motion) if poses_path(folder).is_file() else None
        return cls(generator, poses, read_about(folder)["meta"])


def noticed_split(units: UnitSet, split_seed: int, step: int, notice: Notice) -> Split:
    """Units `step` beats apart split by motion group; `notice` gets what is left out, odd or not learnt, and how many.

    Raises
    ------
    ValueError
        For too few recordings.
    """
    for line in (*(f"left out: {note}" for note in units.notes), *units.remarks):
        notice(line)
    split = split_units(units, seed=split_seed)
    split.settings["step"] = step
    counts = ", ".join(f"{len(getattr(split, side))} {side}" for side in SIDES)
    dances, trained = ({unit.dance for unit in each.units} for each in (units, split.train))
    untrained = ", ".join(sorted(dances - trained - {""}))
    missing = f"; not trained on: {untrained} (add recordings, or try another --split-seed)" if untrained else ""
    notice(f"units: {counts}; data: {split.train.source}{missing}")
    return split


class PresetSystem(NetworkSystem):
    """A system whose sizes, losses and schedule are one record with presets, `settings`, and that has no other options.

    It hears the features of the paper's own system, so that systems compared hear the same.
    """

    settings: ClassVar[type[Any]]
    train_network: Callable[[Split, TrainOptions, Any], object]  # in the folder of the options

    @classmethod
    def learn(
        cls, data: list[PathLike], options: TrainOptions, *, preset: str = PRESETS[0], step: int = 2,
        split_seed: int = 0, **changes: Any,
    ) -> None:  # fmt: skip
        """Train on corpora; `train` calls it, and takes these keywords.

        Parameters
        ----------
        preset : "small" or "paper"
            Of the settings of this system.
        step : int, beats
            From the start of one training unit to that of the next.
        split_seed : int
            Of the split into training, validation and test by motion group.
        **changes
            Other values for fields of the settings, such as ``seed``.
        """
        params = preset_settings(cls.settings, preset, PRESETS, changes)
        units = load_units(data, FeatureParams.paper(), step=step, progress=options.progress)
        cls.train_network(noticed_split(units, split_seed, step, options.notice), options, params)


def preset_settings(settings: type[R], preset: str, presets: Sequence[str], changes: Mapping[str, Any]) -> R:
    """The settings of a preset, with other values for some fields; ValueError for an unknown name."""
    check_choice("preset", preset, presets)
    return changed(getattr(settings, preset)(), changes)


def changed(settings: R, changes: Mapping[str, Any]) -> R:
    """Settings (a dataclass) with other values for some fields; ValueError for a field that they do not have."""
    if other := sorted(changes.keys() - {field.name for field in fields(settings)}):  # type: ignore[arg-type]
        raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
    return replace(settings, **changes)  # type: ignore[type-var]
