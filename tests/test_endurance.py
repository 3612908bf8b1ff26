"""Measures of a long dance: a pose that glides is still, a dancer is not, and limits are those of the recorded."""

import numpy as np
import pandas as pd
import pytest

from harmolab.data.synthetic import synthetic_clip
from harmolab.types import Motion
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("16_music2dance")
endurance = CELLS.endurance


def limits_of(measures: dict[str, float]) -> dict[str, tuple[float, float]]:
    return CELLS.limits_of(pd.DataFrame([measures]))


def passed(measures: dict[str, float], limits: dict[str, tuple[float, float]]) -> dict[str, bool]:
    return {name: low <= measures[name] <= high for name, (low, high) in limits.items()}


@pytest.fixture(scope="module")
def dancer() -> Motion:
    motion = synthetic_clip("cha-cha", seconds=30.0, fps=25.0, seed=2).motion
    assert motion is not None
    return motion


def of(dancer: Motion, positions: np.ndarray) -> Motion:
    return Motion(positions, dancer.fps, dancer.skeleton)


def test_a_dancer_passes_by_a_dancer_of_the_same_dance(dancer: Motion):
    other = synthetic_clip("cha-cha", seconds=30.0, fps=25.0, seed=3).motion
    outcome = passed(endurance(dancer), limits_of(endurance(other)))
    assert len(outcome) == 9 and all(outcome.values())


def test_a_pose_that_glides_is_still_though_its_joints_move(dancer: Motion):
    way = 0.5 * np.arange(dancer.n_frames)[:, None, None] / dancer.fps * np.array([1.0, 0.0, 0.0])
    measures = endurance(of(dancer, dancer.positions[:1] + way))
    assert measures["freezing"] == 0.0 and measures["still"] == 1.0
    assert measures["pose speed"] < 0.01 and measures["pose variance"] < 1e-6
    outcome = passed(measures, limits_of(endurance(dancer)))
    assert not outcome["slowest 10 s"] and not outcome["pose variance"] and not outcome["still"]


def test_ten_seconds_of_rest_are_found_in_half_a_minute(dancer: Motion):
    positions = dancer.positions.copy()
    positions[250:500] = positions[250]
    outcome = passed(endurance(of(dancer, positions)), limits_of(endurance(dancer)))
    assert not outcome["slowest 10 s"] and not outcome["freezing"] and outcome["fastest 10 s"]


def test_shaking_is_told_by_its_jerk(dancer: Motion):
    noise = np.random.default_rng(0).normal(0, 0.01, dancer.positions.shape)
    measures, limits = endurance(of(dancer, dancer.positions + noise)), limits_of(endurance(dancer))
    assert not passed(measures, limits)["jerk"]


def test_filler_does_not_count(dancer: Motion):
    positions, valid = dancer.positions.copy(), np.ones(dancer.n_frames, bool)
    positions[300:400], valid[300:400] = positions[300], False
    whole, gap = endurance(dancer), endurance(Motion(positions, dancer.fps, dancer.skeleton, valid))
    assert gap["pose speed"] == pytest.approx(whole["pose speed"], rel=0.1)
    assert gap["still"] == 0.0
