"""Trainings of Music2Dance by the command: killed and resumed, refused, without leaks, with a likelihood to compare."""

import csv
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from harmolab.body.skeletons import Skeleton, joint_part
from harmolab.cli import app
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import write_corpus
from harmolab.readers.motion import load_motion, save_motion
from harmolab.systems import find
from harmolab.systems.contract import PARTS, names, trainable
from harmolab.systems.music2dance import train as training
from harmolab.systems.music2dance.feet import FootParams, train_feet
from harmolab.systems.music2dance.sequences import SequenceSet, check_leaks, load_sequences, training_windows
from harmolab.systems.music2dance.train import train_music2dance
from harmolab.systems.training import units
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.groups import Segment
from harmolab.systems.training.splits import Split, split_units
from harmolab.systems.training.units import load_units
from harmolab.types import Motion
from tests.builders import called, cases, refused
from tests.tiny_music2dance import TINY, trained

SCRIPT = Path(__file__).with_name("tiny_music2dance.py")
# Name of a training -> its options; seven epochs, or five.
TRAININGS: dict[str, tuple[object, ...]] = {
    "music2dance": ("--system", "music2dance", "--phase1", 4, "--phase2", 3),
    "feet": ("--system", "feet", "--epochs", 5),
    "attributes": ("--system", "attributes", "--epochs", 5),
}


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """14 synthetic dances of ten seconds."""
    return write_corpus(tmp_path_factory.mktemp("m2d") / "dances", clips=14, seconds=10.0, fps=25.0, seed=2)


@pytest.fixture(scope="module")
def runs(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`runs(name)`: the folder of an unbroken training, made when it is first asked for."""
    home = tmp_path_factory.mktemp("runs")

    def run(name: str) -> Path:
        if not (home / name).exists():
            result = trained(corpus, "--out", home / name, *TRAININGS[name])
            assert result.exit_code == 0, result.output
        return home / name

    return run


def history(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "history.csv").read_text().splitlines()))


# Kill -9


@pytest.mark.slow
@cases("name, epoch, phase", ("music2dance", 5, "feedback"), ("feet", 3, "feet"), ids=["phase 2", "feet"])
def test_a_killed_training_resumes_to_the_same_history(
    name: str, epoch: int, phase: str, runs: Callable[[str], Path], corpus: Path, tmp_path: Path
):
    arguments = (corpus, "--out", tmp_path / "run", *TRAININGS[name])
    path = os.pathsep.join([str(SCRIPT.parents[1]), os.environ.get("PYTHONPATH", "")])
    child = subprocess.run(
        [sys.executable, str(SCRIPT), str(epoch), *map(str, arguments)], env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert child.returncode == -signal.SIGKILL, child.stderr
    assert not (tmp_path / "run" / "model.json").exists()
    assert len(history(tmp_path / "run")) == epoch
    assert history(runs(name))[epoch]["phase"] == phase
    result = trained(*arguments, "--resume")
    assert result.exit_code == 0, result.output
    for file in ("history.csv", "model.safetensors", "split.json", "settings.json"):
        assert (tmp_path / "run" / file).read_bytes() == (runs(name) / file).read_bytes(), file


# Options


def test_options_reach_the_run(runs: Callable[[str], Path]):
    assert [row["phase"] for row in history(runs("music2dance"))] == 4 * ["teacher"] + 3 * ["feedback"]
    params = read_about(runs("music2dance"))["build"]["params"]
    assert (params["first_epochs"], params["second_epochs"], params["representation"]) == (4, 3, "positions")


def test_the_representation_is_an_option(corpus: Path, tmp_path: Path):
    options = ("--representation", "rotations", "--phase1", 1, "--phase2", 0)
    result = trained(corpus, "--out", tmp_path / "run", "--system", "music2dance", *options)
    assert result.exit_code == 0, result.output
    assert read_about(tmp_path / "run")["build"]["code"]["kind"] == "rotations"


REFUSED = "Invalid value for '--representation': 'words' is not one of 'positions', 'rotations'."


@cases(
    "arguments, line",
    (("harmogan", "--phase1", 3), "--phase1 is no option of this system"),
    (("harmogan", "--representation", "positions"), "--representation is no option of this system"),
    (("lee2019", "--phase2", 3), "--phase2 is no option of this system"),
    (("lee2019", "--params", "paper"), "--params is no option of this system"),
    (("lee2019", "--pretrain-epochs", 1), "--pretrain-epochs is no option of this system"),
    (("ren2020", "--harmony-weight", 0), "--harmony-weight is no option of this system"),
    (("ren2020", "--pretrained", "x"), "--pretrained is no option of this system"),
    (("music2dance", "--harmony-weight", 1), "--harmony-weight is no option of this system"),
    (("music2dance", "--epochs", 1), "--epochs is no option of this system"),
    (("music2dance", "--preset", "small"), "preset must be recommended or paper, got 'small'"),
    (("music2dance", "--representation", "words"), REFUSED),
    (("feet", "--preset", "paper"), "--preset is no option of this system"),
    (("feet", "--representation", "words"), REFUSED),
    (
        ("feet", "--representation", "rotations", "--velocity-weight", 3),
        "velocity_weight is for the code of positions; use 0",
    ),
    (("attributes", "--step", 3), "--step is no option of this system"),
    (("attributes", "--preset", "small"), "preset must be recommended or paper, got 'small'"),
)
def test_what_a_system_does_not_take_is_refused_before_anything_is_read(
    arguments: tuple[object, ...], line: str, tmp_path: Path
):
    result = trained(tmp_path / "nowhere", "--out", tmp_path / "run", "--system", *arguments)
    assert result.exit_code == 2 and result.stderr == f"harmolab: {line}\n"


# Corpora that cannot be trained on


def without(parts: set[str], folder: Path) -> None:
    """Take joints out of a recording's motion."""
    motion = load_motion(folder / "motion.npz")
    kept = [joint for joint, name in enumerate(motion.skeleton.joints) if joint_part(name) not in parts]

    def parent(joint: int) -> int:
        above = motion.skeleton.parents[joint]
        return kept.index(above) if above in kept else -1 if above == -1 else parent(above)

    skeleton = Skeleton(tuple(motion.skeleton.joints[joint] for joint in kept), tuple(map(parent, kept)))
    save_motion(folder / "motion.npz", Motion(motion.positions[:, kept], motion.fps, skeleton))


@pytest.fixture(scope="module")
def faulty(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Corpora by what is wrong with them."""
    home = tmp_path_factory.mktemp("faulty")
    recordings = sorted(corpus.glob("clip_*"))
    for name in ("no_feet", "two_bodies"):
        for recording in recordings[:7]:
            shutil.copytree(recording, home / name / recording.name)
    for folder in sorted((home / "no_feet").iterdir()):
        without({"ankle", "heel", "toe"}, folder)
    without({"finger"}, home / "two_bodies" / recordings[3].name)
    shutil.copytree(recordings[0], home / "one_recording" / recordings[0].name)
    (home / "empty").mkdir()
    short = write_corpus(home / "short", clips=14, seconds=7.0, fps=25.0, seed=2)
    return {"short": short, **{path.name: path for path in home.iterdir()}}


@pytest.mark.parametrize("system", ["music2dance", "feet"])
@cases(
    "fault, told",
    ("one_recording", "more recordings, or other shares, are needed"),
    ("two_bodies", r"clip_0004_\S+: has another skeleton \(20 joints\) than \S+clip_0001_\S+ \(21 joints\)"),
    ("no_feet", r"clip_0001_\S+: it must be known which foot stands, but no joint is called toe, heel, ankle"),
    ("empty", r"empty: there is no sequence \(see `harmolab data check`\)"),
)
def test_a_corpus_that_cannot_be_trained_on_is_named(
    system: str, fault: str, told: str, faulty: dict[str, Path], tmp_path: Path
):
    result = trained(faulty[fault], "--out", tmp_path / "run", "--system", system)
    lines = [line for line in result.stderr.splitlines() if not line.startswith("units: ")]
    assert result.exit_code == 2 and len(lines) == 1, result.output
    assert re.search(told, lines[0]) and not (tmp_path / "run").exists()


@pytest.mark.parametrize("system", ["music2dance", "feet"])
def test_recordings_shorter_than_a_window_are_told(system: str, faulty: dict[str, Path], tmp_path: Path):
    result = called(app, "train", faulty["short"], "--out", tmp_path / "run", "--system", system)
    assert (
        result.exit_code == 2
        and "harmolab: short: a side of the split has no 8 s of recorded movement in a row" in result.stderr
    )
    assert "the longest of 14 recordings lasts 7.0 s" in result.stderr and not (tmp_path / "run").exists()


# Parts are no dancers


def test_parts_are_found_by_training_alone():
    assert not {*PARTS} & {*names()}
    assert {name: trainable(name).__name__ for name in PARTS} == {"attributes": "Attributes", "feet": "Feet"}
    assert trainable("music2dance") is find("music2dance")


@pytest.mark.parametrize("part", PARTS)
def test_a_part_does_not_dance(part: str, runs: Callable[[str], Path], corpus: Path, tmp_path: Path):
    sentence = f"{part} is a part of music2dance, not a dancer: train it into a run of music2dance (--out RUN/{part})"
    refused(f"^{part} is a part of music2dance", find, part)
    dancing = ("dance", next(corpus.glob("*/audio.wav")), "--out", tmp_path / "dance.npz")
    assert f"harmolab: {sentence}" in called(app, *dancing, "--system", part).stderr
    assert f"harmolab: {runs(part)}: {sentence}" in called(app, *dancing, "--weights", runs(part)).stderr
    assert not (tmp_path / "dance.npz").exists()


# Leaks


@pytest.fixture(scope="module")
def split(sequences: SequenceSet) -> Split:
    return split_units(sequences.units)


@pytest.fixture(scope="module")
def sequences(corpus: Path) -> SequenceSet:
    return load_sequences([corpus], TINY)


def figures(source: Any, sequences: SequenceSet, number: int, start: int) -> set[str]:
    """The motion groups that a window has frames of, one frame after another."""
    sequence = sequences.sequences[number]
    times = sequence.start + (start + np.arange(TINY.n_frames)) / TINY.fps
    return {each.group for each in sequence.segments for time in times if each.start <= time < each.end}


def test_no_figure_of_a_held_out_side_is_in_a_training_window(split: Split, sequences: SequenceSet):
    source = training_windows(split, sequences)
    danced = set().union(*(figures(source, sequences, *place) for place in source.places[::5].tolist()))
    held_out = {*split.groups["validation"], *split.groups["test"]}
    assert danced and held_out and not danced & held_out


def leaking_groups(split: Split, side: str) -> Split:
    """A split whose first training figure is on another side as well."""
    figure = split.groups["train"][0]
    return replace(split, groups={**split.groups, side: [*split.groups[side], figure]})


def leaking_segments(split: Split, sequences: SequenceSet) -> SequenceSet:
    """Sequences of which the first dances a test figure during a training one, for half a second."""
    source = training_windows(split, sequences)
    number, start = source.places[0]
    sequence = sequences.sequences[number]
    first = sequence.start + (start + 30) / TINY.fps
    segments = (*sequence.segments, Segment(first, first + 0.5, split.groups["test"][0]))
    changed = list(sequences.sequences)
    changed[number] = replace(sequence, segments=segments)
    return replace(sequences, sequences=tuple(changed))


@pytest.mark.parametrize("side", ["validation", "test"])
def test_a_figure_on_two_sides_stops_a_training(side: str, split: Split, sequences: SequenceSet, tmp_path: Path):
    leaking = leaking_groups(split, side)
    with pytest.raises(ValueError, match=f"holds frame .* a figure of the {side} side"):
        train_music2dance(leaking, sequences, TrainOptions(tmp_path / "run"))
    with pytest.raises(ValueError, match=f"holds frame .* a figure of the {side} side"):
        train_feet(leaking, sequences, TrainOptions(tmp_path / "run"), FootParams())
    assert not (tmp_path / "run").exists()


def test_a_test_figure_within_a_training_window_is_named_by_its_frame(split: Split, sequences: SequenceSet):
    leaking = leaking_segments(split, sequences)
    place = training_windows(split, sequences).places[0]
    refused(rf"window at frame {place[1]} holds frame {place[1] + 30}, .* test side", training_windows, split, leaking)
    check_leaks(training_windows(split, sequences), split.groups)


def test_the_split_is_that_of_harmogan_s_units(split: Split, corpus: Path):
    again = split_units(load_units([corpus], FeatureParams.paper(), step=2))
    assert split.to_dict() == again.to_dict()
    assert not split.train.units[0].audio.size and again.train.units[0].audio.size


@pytest.mark.parametrize("system", ["music2dance", "feet"])
def test_each_recording_is_read_once(system: str, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folders = []

    def read(folder: Path) -> Any:
        folders.append(folder)
        return load_recording(folder)

    monkeypatch.setattr(units, "load_recording", read)
    epochs = ("--epochs", 0) if system == "feet" else ("--phase1", 0, "--phase2", 0)
    assert trained(corpus, "--out", tmp_path / "run", "--system", system, *epochs).exit_code == 0
    assert len(folders) == len({*folders}) == 14


# A likelihood that can be compared


def quick(split: Split, sequences: SequenceSet, folder: Path, **changes: Any) -> Path:
    """The folder of a training of five epochs."""
    params = replace(sequences.params, **changes)
    options = TrainOptions(folder, resume=True, accelerator="cpu")
    train_music2dance(split, replace(sequences, params=params), options)
    return folder


def test_the_fixed_windows_are_the_same_with_and_without_clusters(split: Split, sequences: SequenceSet):
    with_clusters, without_any = (
        training_windows(split, replace(sequences, params=replace(TINY, clusters=count))) for count in (3, 0)
    )
    assert with_clusters.weights.std() > 0 == without_any.weights.std()
    rows = [training.even_rows(each) for each in (with_clusters, without_any)]
    for one, other in zip(with_clusters.batch(rows[0]), without_any.batch(rows[1]), strict=True):
        assert torch.equal(one, other)
    assert 1 < len(rows[0]) <= 64


@pytest.mark.slow
def test_validation_leaves_the_weights_as_they_are(
    split: Split, sequences: SequenceSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    rare = quick(split, sequences, tmp_path / "rare")
    monkeypatch.setattr(training, "VALIDATE_EVERY", 1)
    often = quick(split, sequences, tmp_path / "often")
    assert (often / "model.safetensors").read_bytes() == (rare / "model.safetensors").read_bytes()
    assert [bool(row["fixed_nats"]) for row in history(rare)] == [False, False, True, False, True]
    rows = history(often)
    assert all(np.isfinite(float(row["fixed_nats"])) for row in rows)
    assert float(rows[2]["fixed_nats"]) < float(rows[0]["fixed_nats"])


@pytest.mark.slow
def test_a_run_from_before_the_column_goes_on(
    split: Split, sequences: SequenceSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(training, "VALIDATE_EVERY", 1)
    whole = quick(split, sequences, tmp_path / "whole")
    validate = training.validate

    def former(*parts: Any) -> dict[str, float]:
        if (tmp_path / "run" / "history.csv").exists() and len(history(tmp_path / "run")) == 2:
            raise InterruptedError
        return {name: value for name, value in validate(*parts).items() if name != "fixed_nats"}

    monkeypatch.setattr(training, "validate", former)
    with pytest.raises(InterruptedError):
        quick(split, sequences, tmp_path / "run")
    assert "fixed_nats" not in history(tmp_path / "run")[0]
    monkeypatch.setattr(training, "validate", validate)
    resumed = quick(split, sequences, tmp_path / "run")
    assert (resumed / "model.safetensors").read_bytes() == (whole / "model.safetensors").read_bytes()
    assert [bool(row["fixed_nats"]) for row in history(resumed)][-2:] == [True, True]
    assert not history(resumed)[0]["fixed_nats"]
