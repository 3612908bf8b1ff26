"""experiments.quality: distances between recordings have planted answers; the typical unit is the median one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from harmolab.data.splits import Split
from harmolab.data.units import DanceUnit, UnitSet
from harmolab.experiments import quality
from harmolab.experiments.generation import Trained
from harmolab.experiments.quality import HALVES, OTHER_FIGURES, recorded_distances, typical_unit
from harmolab.models.harmogan import Generator
from harmolab.models.pose_features import PoseNet
from harmolab.params import FeatureParams, ModelParams, RunProfile
from harmolab.types import Skeleton

ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))
FEATURES = FeatureParams.paper()
T, PRIOR = 40, 10


def swinging(name: str, width: float, rng: np.random.Generator) -> DanceUnit:
    """An arm that swings by about `width` metres at a random moment of its course."""
    time = np.arange(T) / FEATURES.fps
    swing = width * rng.uniform(0.8, 1.2) * np.sin(2 * np.pi * rng.uniform(0.8, 1.2) * time + rng.uniform(0, 6))
    joints = np.zeros((T, 3, 3), np.float32)
    joints[:, :, 1] = [1.4, 1.1, 0.8]
    joints[:, 1:, 0] = swing[:, None] * [0.5, 1.0]
    code = np.concatenate([joints.reshape(T, -1), np.zeros((T, 3), np.float32)], axis=1)
    index = (np.arange(T) < PRIOR).astype(np.float32)
    audio, none = np.zeros((T, FEATURES.n_audio), np.float32), np.zeros(0)
    alone = frozenset({name})
    return DanceUnit(name, "arm", "waltz", alone, alone, 0.0, audio, code, index, none, none, FEATURES.fps)


def arms(label: str, count: int, width: float, rng: np.random.Generator) -> UnitSet:
    units = tuple(swinging(f"{label}{number}", width, rng) for number in range(count))
    return UnitSet(units, ARM, np.array([0.0, 0.3, 0.3]), FEATURES, "arms")


@pytest.fixture
def run(rng: np.random.Generator) -> Trained:
    """Test arms swing by 0.2 m, training arms by 0.6 m."""
    torch.manual_seed(0)
    train, test = arms("train", 30, 0.6, rng), arms("test", 24, 0.2, rng)
    tiny = ModelParams(hidden=8, layers=1, pose_features=4, discriminator=2)
    generator = Generator(tiny, FEATURES.n_audio, ARM, torch.tensor([0.0, 0.3, 0.3]), fps=FEATURES.fps)
    split = Split(train, arms("validation", 4, 0.6, rng), test, {}, {})
    return Trained(Path(), generator, PoseNet(ARM, fps=FEATURES.fps), split, pd.DataFrame())


def test_halves_of_the_same_recordings_are_no_distance_apart_and_other_figures_are(run: Trained):
    found = recorded_distances(run, seed=1).set_index(["measure", "variant"])
    assert len(found) == 4
    for measure in ("fid", "fid_kinetic"):
        same, other = found.loc[(measure, HALVES)], found.loc[(measure, OTHER_FIGURES)]
        assert same["low"] < 0.0 < same["high"]
        assert other["low"] > same["high"]
        assert other["low"] <= other["mean"] <= other["high"]


def test_same_seed_draws_the_same_halves(run: Trained):
    pd.testing.assert_frame_equal(recorded_distances(run, seed=3), recorded_distances(run, seed=3))


def test_typical_unit_is_the_one_with_the_median_error(run: Trained, monkeypatch: pytest.MonkeyPatch):
    units = run.split.test.select({"test0", "test1", "test2"})
    planted = {"test0": 0.5, "test1": 0.1, "test2": 0.3}

    def off(generator: Generator, chosen: UnitSet) -> list[np.ndarray]:
        made = [unit.motion.astype(np.float64) for unit in chosen.units]
        for code, unit in zip(made, chosen.units, strict=True):
            code[PRIOR:, 2:9:3] += planted[unit.name]  # z of every joint
            code[:PRIOR, :9] += 9.0  # the beats before the meter are not judged
        return made

    split = Split(run.split.train, run.split.validation, units, {}, {})
    planted_run = Trained(run.folder, run.generator, run.pose_net, split, run.history)
    monkeypatch.setattr(quality, "trained", lambda *_: planted_run)
    monkeypatch.setattr(quality, "generate", off)
    example = typical_unit(RunProfile.quick(), "arms", ("paper",))
    assert example.name == "test2"
    assert example.start == pytest.approx(PRIOR / FEATURES.fps)
    assert list(example.motions) == ["recorded", "paper"]
    recorded, made = (motion.positions[PRIOR:, 1] - motion.positions[PRIOR:, 0] for motion in example.motions.values())
    np.testing.assert_allclose(made, recorded, atol=1e-6)  # all joints moved alike
