"""The tables of notebook 05, and the pictures drawn from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from harmolab.lab.compare.auc import CorpusResult
from harmolab.lab.experiments.discrimination import (
    auc_table,
    compare_corpora,
    dance_patterns_of,
    dance_table,
    disturbance_table,
    pick_table,
)
from harmolab.lab.figures.results import disturbances_figure, draw_auc, draw_disturbances, draw_patterns, draw_picks
from harmolab.lab.profile import RunProfile
from harmolab.params import BarPattern


@pytest.fixture(scope="module")
def profile() -> RunProfile:
    return replace(RunProfile.quick(), n_clips=14, n_rotations=40)


@pytest.fixture
def results(profile: RunProfile, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    return compare_corpora(profile)


def planted_result(true: list[float], wrong: list[list[float]]) -> CorpusResult:
    scores = {name: np.array(true) for name in ("recommended", "paper", "hit_rate")}
    strange = {name: np.array(wrong) for name in scores}
    return CorpusResult({}, scores, strange, ["waltz"] * len(true), [str(i) for i in range(len(true))])


def test_a_perfect_score_picks_every_inharmonious_clip(profile: RunProfile) -> None:
    table = pick_table(planted_result([1.0] * 20, [[0.0] * 5] * 20), profile)
    assert table["harmolab"].dropna().tolist() == [1.0, 1.0, 1.0]
    assert table["paper"].dropna().tolist() == [0.78]


def test_a_constant_score_picks_by_guessing(profile: RunProfile) -> None:
    table = pick_table(planted_result([0.5] * 20, [[0.5] * 5] * 20), replace(profile, n_rotations=400))
    np.testing.assert_allclose(table["harmolab"].dropna(), 0.5, atol=0.05)


def test_paper_and_harmolab_never_share_a_column(profile: RunProfile) -> None:
    table = pick_table(planted_result([1.0] * 20, [[0.0] * 5] * 20), profile)
    assert (table["paper"].isna() ^ table["harmolab"].isna()).all()


@pytest.mark.slow
def test_recommended_tells_and_paper_does_not_on_planted_beats(results: dict[str, CorpusResult]) -> None:
    table = auc_table(results).set_index("score")
    assert table.loc["recommended", "tells"] == "yes"
    assert table.loc["paper", "AUC"] < 0.65
    by_dance = dance_table(results)
    assert by_dance["windows"].sum() == 14
    assert set(dance_patterns_of(results, "synthetic")) == {
        "cha-cha", "jive", "quickstep", "rumba", "samba", "tango", "waltz",
    }  # fmt: skip


@pytest.mark.slow
def test_frame_rate_hardly_moves_the_recommended_score(profile: RunProfile) -> None:
    table = disturbance_table(profile, "fps", [15.0, 60.0])
    assert table["frame rate (fps)"].tolist() == [15.0, 60.0]
    assert abs(table["mean recommended"].diff().iloc[1]) <= 0.03


def test_auc_picture_marks_what_lies_above_its_chance_band() -> None:
    scores = {"recommended": {"auc": 0.9, "chance_band": [0.4, 0.6]}, "paper": {"auc": 0.5, "chance_band": [0.4, 0.6]}}
    ax = draw_auc(Figure().subplots(), scores, title="planted")
    marks = {line.get_xdata()[0]: line.get_marker() for line in ax.lines if line.get_marker() in "ox"}
    assert marks == {0.9: "o", 0.5: "x"}
    assert "AUC" in ax.get_xlabel()
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([0.2, 0.2])


def test_pattern_picture_has_a_line_for_each_dance_and_each_beat() -> None:
    patterns = {"waltz": BarPattern(3, (1.0,), (0.0,)), "rumba": BarPattern(2, (1.0,), (0.0,))}
    ax = draw_patterns(Figure().subplots(), patterns)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["waltz (3 beats)", "rumba (2 beats)"]
    assert sum(len(line.get_xdata()) == 200 for line in ax.lines) == 2


def test_picks_picture_draws_people_and_scores_apart() -> None:
    table = pd.DataFrame(
        {"judge": ["people", "score"], "paper": [0.78, np.nan], "harmolab": [np.nan, 0.6], "low": [np.nan, 0.4],
         "high": [np.nan, 0.8]}
    )  # fmt: skip
    ax = draw_picks(Figure().subplots(), table)
    assert sorted(bar.get_width() for bar in ax.patches) == [0.6, 0.78]
    assert len({bar.get_facecolor() for bar in ax.patches}) == 2


def test_disturbance_picture_draws_each_score_over_the_levels() -> None:
    table = pd.DataFrame({"noise (cm)": [0.0, 1.0], "recommended": [1.0, 0.9], "paper": [0.5, 0.5]})
    ax = draw_disturbances(Figure().subplots(), table, ["recommended", "paper"])
    assert ax.get_xlabel() == "noise (cm)"
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [1.0, 0.9])
    title = disturbances_figure(table, ["recommended", "paper"]).axes[0].get_title(loc="left")
    assert "“recommended (shape speed)” stands the most" in title
    assert "AUC 0.90, the others 0.50 to 0.50" in title
