"""The tables of notebook 05, and the pictures drawn from them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from harmolab.lab.compare.auc import CorpusResult
from harmolab.lab.figures.style import COLOURS
from harmolab.params import BarPattern
from study.figures.results import SCORE_LABELS, auc_figure, disturbances_figure, draw_auc, patterns_figure, picks_figure
from study.profile import RunProfile
from study.saving import smallest_text
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("05_right_from_wrong")


@pytest.fixture(scope="module")
def profile() -> RunProfile:
    return replace(RunProfile.quick(), n_clips=14, n_rotations=40)


@pytest.fixture
def results(profile: RunProfile, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    return CELLS.compare_corpora(profile)


def planted_result(true: list[float], wrong: list[list[float]]) -> CorpusResult:
    scores = {name: np.array(true) for name in ("recommended", "paper", "hit_rate")}
    strange = {name: np.array(wrong) for name in scores}
    return CorpusResult({}, scores, strange, ["waltz"] * len(true), [str(i) for i in range(len(true))])


def test_a_perfect_score_picks_every_inharmonious_clip(profile: RunProfile) -> None:
    table = CELLS.pick_table(planted_result([1.0] * 20, [[0.0] * 5] * 20), profile)
    assert table["harmolab"].dropna().tolist() == [1.0, 1.0, 1.0]
    assert table["paper"].dropna().tolist() == [0.78]


def test_a_constant_score_picks_by_guessing(profile: RunProfile) -> None:
    table = CELLS.pick_table(planted_result([0.5] * 20, [[0.5] * 5] * 20), replace(profile, n_rotations=400))
    np.testing.assert_allclose(table["harmolab"].dropna(), 0.5, atol=0.05)


def test_paper_and_harmolab_never_share_a_column(profile: RunProfile) -> None:
    table = CELLS.pick_table(planted_result([1.0] * 20, [[0.0] * 5] * 20), profile)
    assert (table["paper"].isna() ^ table["harmolab"].isna()).all()


@pytest.mark.slow
def test_recommended_tells_and_paper_does_not_on_planted_beats(results: dict[str, CorpusResult]) -> None:
    table = CELLS.auc_table(results).set_index("score")
    assert table.loc["recommended", "tells"] == "yes"
    assert table.loc["paper", "AUC"] < 0.65
    assert CELLS.dance_table(results)["windows"].sum() == 14
    assert set(CELLS.bar_courses(results["synthetic"].patterns)["dance"]) == {
        "cha-cha", "jive", "quickstep", "rumba", "samba", "tango", "waltz",
    }  # fmt: skip


@pytest.mark.slow
def test_frame_rate_hardly_moves_the_recommended_score(profile: RunProfile) -> None:
    table = CELLS.disturbance_table(profile, "fps", [15.0, 60.0], "frame rate (fps)")
    assert table["frame rate (fps)"].tolist() == [15.0, 60.0]
    assert abs(table["mean recommended"].diff().iloc[1]) <= 0.03


def test_auc_picture_marks_what_lies_above_its_chance_band() -> None:
    rows = [auc_row("hit_rate", 0.3), auc_row("paper", 0.5), auc_row("recommended", 0.9)]
    ax = draw_auc(Figure().subplots(), pd.DataFrame(rows).set_index("score"))
    marks = {line.get_xdata()[0]: (line.get_marker(), line.get_color()) for line in ax.lines[:3]}
    assert marks == {0.9: ("o", COLOURS["hit"]), 0.5: ("x", COLOURS["chance"]), 0.3: ("x", COLOURS["miss"])}
    assert [line.get_ydata()[0] for line in ax.lines[:3]] == [2, 1, 0]
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([0.2] * 3)
    assert [text.get_fontweight() for text in ax.get_yticklabels()] == ["normal", "normal", "bold"]


def auc_row(score: str, auc: float, corpus: str = "beatlocked") -> dict[str, object]:
    about = {"corpus": corpus, "windows": 9, "beats": "annotated", "score": score}
    return {**about, "AUC": auc, "chance low": 0.4, "chance high": 0.6}


def test_auc_figure_sorts_scores_by_the_first_corpus_and_counts_those_that_tell() -> None:
    first = [auc_row("paper", 0.5), auc_row("recommended", 0.9), auc_row("valleys", 0.7)]
    second = [auc_row("paper", 0.9, "synthetic"), auc_row("recommended", 0.5, "synthetic")]
    figure = auc_figure(pd.DataFrame([*first, *second]))
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == [SCORE_LABELS[name] for name in ("paper", "valleys", "recommended")]  # from below
    assert [ax.get_title(loc="left").split("\n")[1] for ax in figure.axes] == [
        "2 of 3 scores tell, ours too (annotated beats)", "1 of 2 scores tell (annotated beats)",
    ]  # fmt: skip
    assert [ax.get_title(loc="right").strip() for ax in figure.axes] == ["", "synthetic data"]
    assert smallest_text(figure) >= 9


def test_pattern_picture_has_a_panel_for_each_dance_beats_by_number_and_the_fastest_moment() -> None:
    patterns = {"waltz": [BarPattern(3, (1.0,), (0.0,))], "rumba": [BarPattern(2, (0.0,), (1.0,))]}
    figure = patterns_figure(CELLS.bar_courses(patterns), corpus="beatlocked")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["waltz: fastest on 1", "rumba: fastest between 1 and 2"]
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["1", "2", "3", "1"]
    (arrow,) = figure.axes[1].texts
    assert arrow.xy[0] == pytest.approx(0.5, abs=0.01)
    assert "do not all stop on the beat" in figure.get_suptitle()


def test_picks_picture_draws_people_and_scores_apart() -> None:
    table = pd.DataFrame(
        {"judge": ["people", "score"], "paper": [0.78, np.nan], "harmolab": [np.nan, 0.6], "low": [np.nan, 0.4],
         "high": [np.nan, 0.8]}
    )  # fmt: skip
    (ax,) = picks_figure(table, corpus="a").axes
    assert sorted(bar.get_width() for bar in ax.patches) == [0.6, 0.78]
    assert [(text.get_text(), text.xy[0]) for text in ax.texts[:2]] == [("78%", 0.02), ("60%", 0.02)]
    assert "score, not clearly better than guessing" in ax.get_title(loc="left")
    assert len({bar.get_facecolor() for bar in ax.patches}) == 2


def test_disturbance_picture_draws_each_score_over_the_levels() -> None:
    table = pd.DataFrame({"noise (cm)": [0.0, 1.0], "recommended": [1.0, 0.9], "paper": [0.5, 0.5]})
    (ax,) = disturbances_figure(table, ["recommended", "paper"]).axes
    assert ax.get_xlabel() == "noise (cm)"
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [1.0, 0.9])
    title = ax.get_title(loc="left")
    assert "“recommended (shape speed)” stands the most" in title
    assert "AUC 0.90, the others 0.50 to 0.50" in title
