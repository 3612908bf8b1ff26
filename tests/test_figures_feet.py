"""Figures of feet: marks at their means, heights in centimetres, grey where a foot stands; quick ones say so."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from study.figures.feet import MEASURES, draw_ways, ways_figure
from study.profile import RunProfile
from study.saving import save_figure
from tests.builders import cases
from tests.notebook_cells import notebook_cells

NAN = float("nan")
CELLS = notebook_cells("17_feet")


def record(feet: str, trainings: int, mean: float, low: float = NAN, high: float = NAN, code: str = "rotations"):
    spread = {
        f"{name}{end}": value for name in MEASURES for end, value in (("", mean), (", low", low), (", high", high))
    }
    about = {"corpus": "made up", "code": code, "unit of MSE": "rad^2"}
    return {**about, "feet": feet, "trainings": trainings, **spread}


ROWS = [
    record("recorded", 0, 2.0), record("no correction", 0, 6.0), record("planted feet, not learnt", 0, 3.0),
    record("temporal convolution", 3, 7.0, 6.5, 7.5),
]  # fmt: skip


def test_each_way_has_its_mark_filled_where_it_was_trained():
    ax = draw_ways(Figure().subplots(), ROWS, measure="sliding (cm/s)")
    marks = {line.get_xdata()[0]: line for line in ax.lines if len(line.get_xdata()) == 1}
    assert set(marks) == {3.0, 7.0}
    assert marks[3.0].get_markerfacecolor() == "white" != marks[7.0].get_markerfacecolor()
    (interval,) = [line for line in ax.lines if line.get_gid() == "interval"]
    assert list(interval.get_xdata()) == [6.5, 7.5]
    lines = {
        line.get_gid(): line.get_xdata()[0] for line in ax.lines if line.get_gid() in ("recorded", "no correction")
    }
    assert lines == {"recorded": 2.0, "no correction": 6.0}


def test_the_error_on_figures_learnt_is_a_cross_beside_the_mark():
    ax = draw_ways(Figure().subplots(), [{**row, "MSE, figures learnt": 1.5} for row in ROWS], measure="MSE")
    crosses = [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "x"]
    assert crosses == [(1.5, 0.0)]  # of what was trained alone


def test_every_corpus_and_code_has_a_row_of_panels():
    figure = ways_figure([*ROWS, *(record(row["feet"], 0, 1.0, code="positions") for row in ROWS)])
    assert len(figure.axes) == 2 * len(MEASURES)
    assert [ax.get_title(loc="left") for ax in figure.axes[:: len(MEASURES)]] == [
        "Made up, code of rotations", "Made up, code of positions",
    ]  # fmt: skip
    title = "Learnt foot models beside no correction: less error with none of 1, less sliding with none of 1"
    assert figure.get_suptitle() == title
    assert figure.axes[0].get_xlabel() == "MSE (rad^2)"


def test_toes_are_drawn_side_by_side_over_the_seconds():
    seconds = np.arange(50) / 25
    dancers = {"recorded": (1.0, 2.0), "with end effectors": (3.0, 4.0)}
    tables = [
        pd.DataFrame({"toe L": left, "toe R": right, "dancer": name, "seconds": seconds})
        for name, (left, right) in dancers.items()
    ]
    figure = CELLS.toes_figure(pd.concat(tables), "recordings on the beat")
    assert figure.get_suptitle() == "Toes range over 0 cm (recorded) and 0 cm (with end effectors)"
    drawn = [[(line.get_label(), line.get_ydata()[0]) for line in ax.lines] for ax in figure.axes]
    assert drawn == [
        [("recorded", 1.0), ("with end effectors", 3.0)], [("recorded", 2.0), ("with end effectors", 4.0)],
    ]  # fmt: skip
    assert figure.axes[0].get_xlim() == (0.0, CELLS.SHOWN)
    assert figure.axes[1].get_xlabel() == "time (s); recordings on the beat"


def test_grey_lies_where_a_foot_is_said_to_stand():
    table = pd.DataFrame({"seconds": np.tile(np.arange(50) / 25, 3), "feet": np.repeat([*CELLS.WAYS.values()], 50)})
    table[[*CELLS.TOES, *CELLS.STANDS]], table[CELLS.SPEEDS] = 0.0, 100.0
    table.loc[table["seconds"].between(0.4, 0.98), "stands L"] = 1.0
    figure = CELLS.foot_model_figure(table)
    grey = [ax.collections[0].get_paths() for ax in figure.axes]
    spans = [[path.get_extents().intervalx.tolist() for path in paths] for paths in grey]
    assert spans == [[[0.4, 1.0]], [], [[0.4, 1.0]], []]
    title = "Standing feet slide at 100 cm/s (no correction), 100 cm/s (foot model) and 100 cm/s (planted feet)"
    assert figure.get_suptitle() == title
    assert figure.axes[2].lines[0].get_ydata()[0] == 100.0
    table["stands L"] = 0.0
    assert CELLS.foot_model_figure(table).get_suptitle() == "No foot is predicted to stand"


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
