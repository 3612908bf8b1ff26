"""Trained generators for the notebooks: with and without the harmony loss, the paper's and ours, over several seeds.

Every training is kept in the cache folder under its settings, so that notebooks share it and a second run finds it. A
training that was cut off goes on where it stopped.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import pandas as pd
from filelock import FileLock

from harmolab.data.recordings import find_recordings
from harmolab.data.synthetic import write_corpus
from harmolab.files import PathLike, cache_folder, plain
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.harmogan.sketches import Sketched, sketched
from harmolab.systems.harmogan.train import POSE_NET, train_harmogan
from harmolab.systems.training.about import DEFAULT_STEM
from harmolab.systems.training.checkpoints import HISTORY, TrainOptions
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.splits import Split, split_units
from harmolab.systems.training.units import load_units
from study.experiments.clock import TrainingClock, training_minutes
from study.experiments.study import corpus_folders, data_root
from study.profile import RunProfile

SYNTHETIC = "synthetic"
SECONDS = 16.0  # of a synthetic clip: several meters, each with the beats before it
UNIT_STEP = 3  # beats between the starts of training units
MOST_CLIPS = 35  # synthetic clips: about as many units as the recordings have
SWEEP = (0.0, 0.3, 1.0, 2.0)  # harmony weights of the trade-off curve


@dataclass(frozen=True)
class Variant:
    """A way to train: what the generator hears, and its losses."""

    features: FeatureParams
    params: TrainParams

    def weighted(self, **weights: Any) -> Self:
        """The same with other weights of the losses (fields of `TrainParams`); a weight of 0 is an ablation."""
        return replace(self, params=replace(self.params, **weights))


_PAPER = Variant(FeatureParams.paper(), TrainParams.paper())
_OURS = Variant(FeatureParams.recommended(), TrainParams.recommended())
VARIANTS = {
    "paper, without": _PAPER.weighted(harmony_weight=0.0),
    "paper": _PAPER,
    "recommended, without": _OURS.weighted(harmony_weight=0.0),
    "recommended": _OURS,
}


Asked = dict[str, tuple[float, tuple[float, float], bool]]  # entry test -> value, range asked for, passed


@dataclass(frozen=True, eq=False)
class TrainedSystem:
    """One finished training: where it is kept, the system, and its entry tests where it has any."""

    folder: Path
    system: Any
    entry: Asked = field(default_factory=dict)

    @property
    def history(self) -> pd.DataFrame:
        """What was written down of every epoch."""
        return pd.read_csv(self.folder / HISTORY)

    @property
    def minutes(self) -> float:
        """Minutes that it took; NaN where none were counted."""
        return training_minutes(self.folder)


@dataclass(frozen=True, eq=False)
class Trained:
    """One finished training of HarmoGAN: its folder, the generator, the pose network, the split, history by epoch.

    `minutes` are those of its pretraining and its own; NaN where none were counted.
    """

    folder: Path
    generator: Generator
    pose_net: PoseNet
    split: Split
    history: pd.DataFrame
    minutes: float = float("nan")


def generator_corpora(profile: RunProfile) -> tuple[str, ...]:
    """The corpora generators are trained on: the synthetic one; in the full profile the first recorded one as well."""
    recorded = () if profile.epochs or data_root() is None else (next(iter(corpus_folders(profile))),)
    return (*recorded, SYNTHETIC)


def song_folder(kind: str, *, clips: int, seconds: float, seed: int) -> Path:
    """A folder of synthetic songs and their dancers in the cache, written if it is not there."""
    return write_corpus(_home() / f"{kind}_{clips}x{seconds:g}s_seed{seed}", clips=clips, seconds=seconds, seed=seed)


@cache
def training_split(profile: RunProfile, corpus: str, features: FeatureParams, without: tuple[str, ...] = ()) -> Split:
    """Units of a corpus, but for the recordings named in `without`, split by motion group with the profile's seed.

    Raises
    ------
    ValueError
        If there is no corpus of that name.
    """
    root = corpus_root(profile, corpus)
    folders: list[PathLike] = [folder for folder in find_recordings(root).folders if folder.name not in without]
    return split_units(load_units(folders if without else [root], features, step=UNIT_STEP), seed=profile.seed)


def paper_split(profile: RunProfile, corpus: str) -> Split:
    """The `training_split` of a corpus as the paper's systems hear it."""
    return training_split(profile, corpus, FeatureParams.paper())


def corpus_root(profile: RunProfile, corpus: str) -> Path:
    """The folder of a corpus; the synthetic one is written if it is not there.

    Raises
    ------
    ValueError
        If there is no corpus of that name.
    """
    if corpus == SYNTHETIC:
        return song_folder("dances", clips=min(profile.n_clips // 2, MOST_CLIPS), seconds=SECONDS, seed=profile.seed)
    if corpus not in corpus_folders(profile):
        raise ValueError(f"there is no corpus {corpus!r}; there are {', '.join(generator_corpora(profile))}")
    return corpus_folders(profile)[corpus]


def trained(profile: RunProfile, corpus: str, variant: Variant, seed: int, *, without: tuple[str, ...] = ()) -> Trained:
    """The generator of a variant and seed, trained now unless it was before; recordings of `without` take no part.

    The paper's variants share their pretraining, which the harmony loss has no part in.
    """
    params = replace(variant.params, seed=seed, pose_epochs=profile.pose_epochs or variant.params.pose_epochs)
    if profile.preset == "paper":
        params = replace(params, patience=None)
    if profile.epochs:  # an epoch of sketches has several of every unit, and nothing is pretrained there
        first, then = profile.epochs if not params.sketches else (0, max(1, profile.epochs[1] // params.sketches))
        params = replace(params, pretrain_epochs=first, adversarial_epochs=then)
    if params.sketches:
        # The sketches are the same whatever the losses.
        drawn = replace(TrainParams.recommended(), seed=seed, sketches=params.sketches, shifted=params.shifted)
        split, bank, patterns = sketched_split(profile, corpus, variant.features, without, drawn)
        folders = [_run("pretrained", split, profile, params, choreographer=bank, patterns=patterns)]
    else:
        split = training_split(profile, corpus, variant.features, without)
        base = _run("pretrained", split, profile, _pretraining(params))
        folders = [base, _run("run", split, profile, params, pretrained=base)]
    return Trained(
        folders[-1],
        load_generator(folders[-1] / DEFAULT_STEM),
        load_pose_net(folders[-1] / POSE_NET),
        split,
        pd.concat([pd.read_csv(folder / HISTORY) for folder in folders], ignore_index=True),
        sum(map(training_minutes, folders)),
    )


@cache
def sketched_split(
    profile: RunProfile, corpus: str, features: FeatureParams, without: tuple[str, ...], params: TrainParams
) -> Sketched:
    """`training_split` with sketches, drawn by the seed of the training."""
    folders = [one for one in find_recordings(corpus_root(profile, corpus)).folders if one.name not in without]
    return sketched(training_split(profile, corpus, features, without), folders, params)


def _pretraining(params: TrainParams) -> TrainParams:
    """The part of a training that all variants share: settings of the adversarial epochs at their defaults."""
    shared = [field.name for field in fields(params) if field.name.startswith("pretrain_")]
    shared += ["seed", "batch_size", "shards", "epsilon", "pose_epochs", "patience"]
    settings = {name: getattr(params, name) for name in shared}
    return replace(TrainParams.paper(), adversarial_epochs=0, **settings)


def _run(kind: str, split: Split, profile: RunProfile, params: TrainParams, **more: Any) -> Path:
    """Folder of a finished training of these settings; `more` goes to `train_harmogan`."""
    model = model_params(profile)
    about = {"model": model, "params": params, "features": split.train.features, "split": split.to_dict()}
    return kept_run(kind, about, lambda options: train_harmogan(split, options, model=model, params=params, **more))


def kept_run(kind: str, about: Any, train: Callable[[TrainOptions], object]) -> Path:
    """Folder of a finished training in the cache, named by `kind` and all it depends on; trained now unless it was.

    Waits for another process that is at it. `train` is called with the options of a training in this folder, timed,
    that goes on where it was cut off; on the CPU, unless ``HARMOLAB_ACCELERATOR`` says "cuda" or "auto".
    """
    name = hashlib.sha256(json.dumps(plain(about), sort_keys=True).encode()).hexdigest()[:16]
    folder = _home() / "runs" / f"{kind}-{name}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder.with_suffix(".lock")):
        if not (folder / f"{DEFAULT_STEM}.json").is_file():
            device = os.environ.get("HARMOLAB_ACCELERATOR", "cpu")
            train(TrainOptions(folder, resume=True, accelerator=device, report=TrainingClock(folder)))
    return folder


def model_params(profile: RunProfile) -> ModelParams:
    """The profile's preset, or one with as many units as it says, in proportion."""
    small = ModelParams.paper() if profile.preset == "paper" else ModelParams.small()
    hidden = profile.hidden or small.hidden
    sizes = round(hidden / small.hidden * small.pose_features), round(hidden / small.hidden * small.discriminator)
    return ModelParams(hidden, small.layers, sizes[0], max(sizes[1], 4))


def _home() -> Path:
    return cache_folder() or Path(".harmolab")


def weight_sweep(profile: RunProfile, corpus: str) -> Iterator[tuple[float, Trained]]:
    """(harmony weight, training) of the recommended losses from none to twice as much (first seed)."""
    for weight in SWEEP:
        yield weight, trained(profile, corpus, _OURS.weighted(harmony_weight=weight), 1)
