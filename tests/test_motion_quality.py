"""Notebook 08: distances between recordings have planted answers; the typical unit is the median one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from harmolab.data.synthetic import synthetic_clip
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.pose_network import PoseNet
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import Motion
from study.cells import notebook_cells
from study.experiments.generation import Trained
from study.experiments.judging import recorded_motions
from tests.builders import ARM

CELLS = notebook_cells("08_motion_quality")
HALVES, OTHER_FIGURES, FROZEN = "recorded, halves", "recorded, other figures", "recorded, frozen"
HAND = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # the hand forwards, nothing else
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
    found = CELLS.recorded_distances(run, seed=1).set_index(["measure", "variant"])
    assert len(found) == 4
    for measure in ("fid", "fid_kinetic"):
        same, other = found.loc[(measure, HALVES)], found.loc[(measure, OTHER_FIGURES)]
        assert same["low"] < 0.0 < same["high"]
        assert other["low"] > same["high"]
        assert other["low"] <= other["mean"] <= other["high"]


def test_same_seed_draws_the_same_halves(run: Trained):
    pd.testing.assert_frame_equal(*(CELLS.recorded_distances(run, seed=3) for _ in range(2)))


def test_typical_unit_is_the_one_with_the_median_error(run: Trained):
    units = run.split.test.select({"test0", "test1", "test2"})
    planted = {"test0": 0.5, "test1": 0.1, "test2": 0.3}
    recorded = recorded_motions(units)
    offsets = np.array([planted[unit.name] for unit in units.units])
    moved = [motion.positions + offset * HAND for motion, offset in zip(recorded, offsets, strict=True)]
    for positions in moved:
        positions[:PRIOR, 1] += 9.0  # the beats before the meter are not judged
    dances = [replace(motion, positions=place) for motion, place in zip(recorded, moved, strict=True)]
    example = CELLS.typical_unit(units, {"recorded": recorded, "paper": dances})
    assert example.name == "test2"
    assert example.start == pytest.approx(PRIOR / FEATURES.fps)
    assert list(example.motions) == ["recorded", "paper"]
    apart = example.motions["paper"].positions[PRIOR:] - example.motions["recorded"].positions[PRIOR:]
    np.testing.assert_allclose(apart, np.broadcast_to(0.3 * HAND, apart.shape), atol=1e-6)


def danced(number: int) -> Motion:
    """Four seconds of a synthetic cha-cha, another one for each number."""
    return synthetic_clip("cha-cha", seconds=4.0, fps=FEATURES.fps, seed=number).motion


def test_measures_without_a_network_have_planted_answers(rng: np.random.Generator):
    songs = ("one", "one", "two", "two", "alone")
    units = arms("test", 5, 0.2, rng)
    units = replace(units, units=tuple(replace(u, sequence=song) for u, song in zip(units.units, songs, strict=True)))
    alike = [danced(number) for number in (1, 1, 2, 2, 3)]  # to one song always the same dance
    shaken = [replace(dance, positions=dance.positions + rng.normal(0, 0.02, dance.positions.shape)) for dance in alike]
    table = CELLS.motion_measures(units, {"recorded": alike, "paper": shaken}).set_index("variant")
    assert table.index.tolist() == ["recorded", "paper", FROZEN]
    frozen, recorded, paper = (table.loc[name] for name in (FROZEN, "recorded", "paper"))
    assert (frozen["freezing"], frozen["pfc"], frozen["relative_jerk"]) == (1.0, 0.0, 0.0)
    assert recorded["freezing"] < 0.5 and recorded["pfc"] > 0 and paper["relative_jerk"] > 2 * recorded["relative_jerk"]
    assert recorded["multimodality"] == 0.0 < paper["multimodality"]
    assert np.isnan(recorded["fid_geometric"]) and frozen["fid_geometric"] > paper["fid_geometric"] > 0


def test_without_two_dances_to_a_song_there_is_no_multimodality(rng: np.random.Generator):
    units = arms("test", 4, 0.2, rng)
    units = replace(units, units=tuple(replace(unit, sequence=unit.name) for unit in units.units))
    dances = {"recorded": [danced(number) for number in range(4)]}
    assert CELLS.motion_measures(units, dances)["multimodality"].isna().all()
