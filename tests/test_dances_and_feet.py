"""Notebooks 16 and 17: what long dances keep, and figures of feet.

A pose that glides is still, a dancer is not, and limits are those of the recorded. Marks are at their means, heights in
centimetres, grey where a foot stands; quick figures say so.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from harmolab.data.synthetic import synthetic_clip
from harmolab.types import Motion
from study.cells import notebook_cells
from study.figures.feet import MEASURES, draw_ways, ways_figure
from study.profile import RunProfile
from study.saving import save_figure
from tests.builders import cases

DANCES, FEET = notebook_cells("16_music2dance"), notebook_cells("17_feet")


def limits_of(measures: dict[str, float]) -> dict[str, tuple[float, float]]:
    return DANCES.limits_of(pd.DataFrame([measures]))


def passed(measures: dict[str, float], limits: dict[str, tuple[float, float]]) -> dict[str, bool]:
    return {name: low <= measures[name] <= high for name, (low, high) in limits.items()}


@pytest.fixture(scope="module")
def dancer() -> Motion:
    motion = synthetic_clip("cha-cha", seconds=30.0, fps=25.0, seed=2).motion
    assert motion is not None
    return motion


def outcome_of(dancer: Motion, positions: np.ndarray) -> dict[str, bool]:
    """Measure -> whether positions keep the limits that a dancer sets."""
    return passed(DANCES.endurance(replace(dancer, positions=positions)), limits_of(DANCES.endurance(dancer)))


def test_a_dancer_passes_by_a_dancer_of_the_same_dance(dancer: Motion):
    other = synthetic_clip("cha-cha", seconds=30.0, fps=25.0, seed=3).motion
    outcome = passed(DANCES.endurance(dancer), limits_of(DANCES.endurance(other)))
    assert len(outcome) == 9 and all(outcome.values())


def test_a_pose_that_glides_is_still_though_its_joints_move(dancer: Motion):
    way = 0.5 * np.arange(dancer.n_frames)[:, None, None] / dancer.fps * np.array([1.0, 0.0, 0.0])
    measures = DANCES.endurance(replace(dancer, positions=dancer.positions[:1] + way))
    assert measures["freezing"] == 0.0 and measures["still"] == 1.0
    assert measures["pose speed"] < 0.01 and measures["pose variance"] < 1e-6
    outcome = passed(measures, limits_of(DANCES.endurance(dancer)))
    assert not outcome["slowest 10 s"] and not outcome["pose variance"] and not outcome["still"]


def test_ten_seconds_of_rest_are_found_in_half_a_minute(dancer: Motion):
    positions = dancer.positions.copy()
    positions[250:500] = positions[250]
    outcome = outcome_of(dancer, positions)
    assert not outcome["slowest 10 s"] and not outcome["freezing"] and outcome["fastest 10 s"]


def test_shaking_is_told_by_its_jerk(dancer: Motion):
    noise = np.random.default_rng(0).normal(0, 0.01, dancer.positions.shape)
    assert not outcome_of(dancer, dancer.positions + noise)["jerk"]


def test_filler_does_not_count(dancer: Motion):
    positions, valid = dancer.positions.copy(), np.ones(dancer.n_frames, bool)
    positions[300:400], valid[300:400] = positions[300], False
    whole, gap = DANCES.endurance(dancer), DANCES.endurance(Motion(positions, dancer.fps, dancer.skeleton, valid))
    assert gap["pose speed"] == pytest.approx(whole["pose speed"], rel=0.1)
    assert gap["still"] == 0.0


# Figures of feet


def record(feet: str, trainings: int, mean: float, low: float = np.nan, high: float = np.nan, code: str = "rotations"):
    ends = {"": mean, ", low": low, ", high": high}
    about = {"corpus": "made up", "code": code, "unit of MSE": "rad^2", "feet": feet, "trainings": trainings}
    return about | {f"{name}{end}": value for name in MEASURES for end, value in ends.items()}


ROWS = [
    record("recorded", 0, 2.0), record("no correction", 0, 6.0), record("planted feet, not learnt", 0, 3.0),
    record("temporal convolution", 3, 7.0, 6.5, 7.5),
]  # fmt: skip


def test_the_error_on_figures_learnt_is_a_cross_beside_the_mark():
    ax = draw_ways(Figure().subplots(), pd.DataFrame(ROWS).assign(**{"MSE, figures learnt": 1.5}), measure="MSE")
    crosses = [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "x"]
    assert crosses == [(1.5, 0.0)]  # of what was trained alone


def test_title_counts_foot_models_with_less_error_and_less_sliding():
    figure = ways_figure(pd.DataFrame([*ROWS, *(record(row["feet"], 0, 1.0, code="positions") for row in ROWS)]))
    title = "Learnt foot models beside no correction: less error with none of 1, less sliding with none of 1"
    assert figure.get_suptitle() == title


def test_title_has_the_ranges_of_the_toes():
    one = pd.DataFrame({"toe L": 1.0, "toe R": 2.0, "dancer": "recorded", "seconds": np.arange(50) / 25})
    other = one.assign(**{"toe L": 3.0, "toe R": 4.0, "dancer": "with end effectors"})
    figure = FEET.toes_figure(pd.concat([one, other]), "recordings on the beat")
    assert figure.get_suptitle() == "Toes range over 0 cm (recorded) and 0 cm (with end effectors)"


def test_title_has_the_speeds_of_standing_feet():
    table = pd.DataFrame({"seconds": np.tile(np.arange(50) / 25, 3), "feet": np.repeat([*FEET.WAYS.values()], 50)})
    table[[*FEET.TOES, *FEET.STANDS]], table[FEET.SPEEDS] = 0.0, 100.0
    table.loc[table["seconds"].between(0.4, 0.98), "stands L"] = 1.0
    title = "Standing feet slide at 100 cm/s (no correction), 100 cm/s (foot model) and 100 cm/s (planted feet)"
    assert FEET.foot_model_figure(table).get_suptitle() == title
    table["stands L"] = 0.0
    assert FEET.foot_model_figure(table).get_suptitle() == "No foot is predicted to stand"


@cases(
    "profile, trained, words",
    (RunProfile.quick(), True, ["synthetic data; quick profile, not trained"]),
    (RunProfile.quick(), False, ["synthetic data"]),
    (RunProfile.full(), True, ["synthetic data"]),
)
def test_a_quick_picture_of_trained_networks_says_so(
    profile: RunProfile, trained: bool, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("HARMOLAB_FIGURES", str(tmp_path))
    figure = Figure()
    save_figure(figure, "one", notebook="17_feet", source="synthetic", profile=profile, trained=trained)
    assert [text.get_text() for text in figure.texts] == words
