"""Notebook 05: tables and pictures of what tells right from wrong, levels of recordings, false alarms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from harmolab.data.recordings import find_recordings
from harmolab.data.synthetic import write_corpus
from harmolab.lab.compare.auc import CorpusResult
from harmolab.lab.compare.scores import LAGS
from harmolab.lab.figures.style import COLOURS
from harmolab.params import BarPattern
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.evidence import time_test
from harmolab.verdict.judge import judge
from study.cells import notebook_cells
from study.figures import results as pictures
from study.profile import RunProfile
from study.saving import smallest_text
from tests.builders import cases, planted_dance

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
    assert table["harmolab"].dropna().tolist() == [1.0, 1.0, 1.0] and table["paper"].dropna().tolist() == [0.78]


def test_a_constant_score_picks_by_guessing(profile: RunProfile) -> None:
    table = CELLS.pick_table(planted_result([0.5] * 20, [[0.5] * 5] * 20), replace(profile, n_rotations=400))
    np.testing.assert_allclose(table["harmolab"].dropna(), 0.5, atol=0.05)


@pytest.mark.slow
def test_recommended_tells_and_paper_does_not_on_planted_beats(results: dict[str, CorpusResult]) -> None:
    table = CELLS.auc_table(results).set_index("score")
    assert table.loc["recommended", "tells"] == "yes" and table.loc["paper", "AUC"] < 0.65
    assert CELLS.dance_table(results)["windows"].sum() == 14
    dances = {"cha-cha", "jive", "quickstep", "rumba", "samba", "tango", "waltz"}
    assert set(CELLS.bar_courses(results["synthetic"].patterns)["dance"]) == dances


@pytest.mark.slow
def test_frame_rate_hardly_moves_the_recommended_score(profile: RunProfile) -> None:
    table = CELLS.disturbance_table(profile, "fps", [15.0, 60.0], "frame rate (fps)")
    assert table["frame rate (fps)"].tolist() == [15.0, 60.0] and abs(table["mean recommended"].diff().iloc[1]) <= 0.03


def test_auc_picture_marks_what_lies_above_its_chance_band() -> None:
    rows = [auc_row("hit_rate", 0.3), auc_row("paper", 0.5), auc_row("recommended", 0.9)]
    ax = pictures.draw_auc(Figure().subplots(), pd.DataFrame(rows).set_index("score"))
    marks = {line.get_xdata()[0]: (line.get_marker(), line.get_color()) for line in ax.lines[:3]}
    assert marks == {0.9: ("o", COLOURS["hit"]), 0.5: ("x", COLOURS["chance"]), 0.3: ("x", COLOURS["miss"])}
    assert [line.get_ydata()[0] for line in ax.lines[:3]] == [2, 1, 0]


def auc_row(score: str, auc: float, corpus: str = "beatlocked") -> dict[str, object]:
    about = {"corpus": corpus, "windows": 9, "beats": "annotated", "score": score}
    return {**about, "AUC": auc, "chance low": 0.4, "chance high": 0.6}


def test_auc_figure_sorts_scores_of_the_first_corpus_and_counts_the_corpora_in_which_each_tells() -> None:
    first = [auc_row("paper", 0.5), auc_row("recommended", 0.9), auc_row("valleys", 0.7)]
    second = [auc_row("paper", 0.9, "synthetic"), auc_row("recommended", 0.8, "synthetic")]
    (ax,) = (figure := pictures.auc_figure(pd.DataFrame([*first, *second]))).axes
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert labels == [pictures.SCORE_LABELS[name] for name in ("paper", "valleys", "recommended")]  # from below
    assert "2 of 3 scores tell, ours too (annotated beats)" in ax.get_title(loc="left")
    counts = {text.get_position()[1]: text.get_text() for text in ax.texts if " of " in text.get_text()}
    assert counts == {0: "1 of 2", 1: "1 of 1", 2: "2 of 2"}
    assert smallest_text(figure) >= 9
    assert pictures.auc_figure(pd.DataFrame(second)).axes[0].get_title(loc="right").strip() == "synthetic data"


def test_pattern_picture_says_where_each_dance_is_fastest() -> None:
    patterns = {"waltz": [BarPattern(3, (1.0,), (0.0,))], "rumba": [BarPattern(2, (0.0,), (1.0,))]}
    figure = pictures.patterns_figure(CELLS.bar_courses(patterns), corpus="beatlocked")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["waltz: fastest on 1", "rumba: fastest between 1 and 2"]
    assert "do not all stop on the beat" in figure.get_suptitle()


def test_picks_picture_says_whether_the_best_score_is_clearly_better_than_guessing() -> None:
    ours = {"harmolab": [np.nan, 0.6], "low": [np.nan, 0.4], "high": [np.nan, 0.8]}
    table = pd.DataFrame({"judge": ["people", "score"], "paper": [0.78, np.nan], **ours})
    (ax,) = pictures.picks_figure(table, corpus="a").axes
    assert "score, not clearly better than guessing" in ax.get_title(loc="left")


def test_disturbance_picture_says_which_score_stands_the_most() -> None:
    table = pd.DataFrame({"noise (cm)": [0.0, 1.0], "recommended": [1.0, 0.9], "paper": [0.5, 0.5]})
    (ax,) = pictures.disturbances_figure(table, ["recommended", "paper"]).axes
    title = ax.get_title(loc="left")
    assert "“recommended (shape speed)” stands the most" in title and "AUC 0.90, the others 0.50 to 0.50" in title


OWN, QUARTER, HALF, SAME, OTHER = CELLS.OWN, CELLS.QUARTER, CELLS.HALF, CELLS.SAME, CELLS.OTHER


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    recordings = CELLS.planted_recordings(seed=2, takes=2)
    return CELLS.level_table([item for item in recordings if item.clip.dance in ("waltz", "rumba")], seed=1)


def test_planted_dancers_are_on_the_beat_of_their_own_music_only(table: pd.DataFrame):
    levels = table.groupby("music")["level"].apply(list)
    assert set(levels[OWN]) == {4} and 4 not in levels[QUARTER] + levels[HALF]
    assert set(levels[OTHER]) == {1}


def test_four_settings_are_counted_by_level(table: pd.DataFrame):
    counts = CELLS.level_counts(table.assign(told=table["told"].where(table["music"] != OWN, other=True)))
    assert counts.loc[("annotated", True), OWN] == "0 0 0 0 4"


@pytest.mark.slow
def test_settings_are_tracked_and_annotated_told_and_not_and_one_dance_alone_has_no_other_music():
    rows = CELLS.level_settings(CELLS.planted_recordings(seed=1, takes=2)[:2])
    assert rows.groupby(["beats", "told"]).ngroups == 4 and list(rows["music"].unique()) == [OWN, QUARTER, HALF, SAME]


def test_reading_is_the_dance_that_was_learnt_on_other_recordings(table: pd.DataFrame):
    own = table[table["music"] == OWN]
    assert [row.startswith(dance) for row, dance in zip(own["revealed by"], own["dance"], strict=True)] == [True] * 4


def test_no_recordings_have_annotated_beats_without_a_folder(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    assert CELLS.annotated_recordings(RunProfile.quick()) == {}


def test_picture_counts_the_levels_of_each_music():
    row = {"corpus": "beatlocked", "beats": "tracked", "told": False, "a": "1 0 0 0 2", "b": "0 1 0 0 0", "c": ""}
    (ax,) = pictures.levels_figure(pd.DataFrame([row, row | {"told": True}])).axes
    assert ax.get_title("left") == "Recordings on the beat at level 4: 2 of 3 with a music, 0 of 1 with other music"


@pytest.mark.data
@pytest.mark.slow
def test_recorded_dancers_are_on_the_beat_of_their_own_music_only(data_root: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_DATA", str(data_root / "beatlocked"))
    (recordings,) = CELLS.annotated_recordings(RunProfile.full()).values()
    tables = CELLS.level_table(recordings, "tracked", False), CELLS.level_table(recordings, "annotated", True)
    ordinary, told = (table.query("level == 4").groupby("music").size() for table in tables)
    assert ordinary[OWN] >= 10 and told[OWN] >= 8
    assert max(ordinary.get(music, 0) for music in (QUARTER, HALF, OTHER)) <= 1
    assert told.get(HALF, 0) == told.get(OTHER, 0) == 0


NULLS = CELLS.planted_nulls()
Pair = tuple[Motion, BeatTrack]


def on_the_beat(seconds: float, rng: np.random.Generator) -> Pair:
    beats = CELLS.steady_beats(0.5, seconds, rng)
    return CELLS.dancer(beats, rng), beats


def test_beats_are_steady_and_begin_within_one_period(rng: np.random.Generator):
    beats = CELLS.steady_beats(0.5, 10.0, rng)
    assert 0 <= beats.times[0] < 0.5
    np.testing.assert_allclose(np.diff(beats.times), 0.5)
    assert beats.duration == 10.0


@cases("kind, least, most", ("dancer, same tempo, any phase", 0.0, 0.001), ("dancer, tempo within 2 %", 0.0, 0.021))
def test_dancer_has_the_tempo_of_the_row(kind: str, least: float, most: float):
    motion, beats = NULLS[kind][0](60.0, np.random.default_rng(4))
    assert least <= abs(own_ratio(motion, beats) - 1) <= most


def test_dancer_whose_tempo_is_far_off_is_never_near_and_one_drawn_apart_has_any():
    far, apart = (
        np.log([own_ratio(*NULLS[f"dancer, tempo {kind}"][0](30.0, np.random.default_rng(seed))) for seed in range(4)])
        for kind in ("over 4 % off", "drawn apart")
    )
    assert np.abs(far).min() > 0.95 * CELLS.FAR and min(far) < 0 < max(far)
    assert np.log(0.55) < min(apart) < np.log(0.95) and np.log(1.05) < max(apart) < np.log(1.8)


def own_ratio(motion: Motion, beats: BeatTrack) -> float:
    """Tempo of the movement over that of the beats."""
    found = judge(shape_speed(motion), beats).time
    assert found is not None
    return found.own_ratio


def test_noise_of_one_clip_is_the_same_with_stillness_after_it():
    kinds = ("noise, no stillness after it", "noise, then 48 s of stillness")
    plain, still = (NULLS[kind][0](12.0, np.random.default_rng(2)) for kind in kinds)
    np.testing.assert_array_equal(plain[0].positions, still[0].positions[: plain[0].n_frames])
    np.testing.assert_array_equal(plain[1].times, still[1].times)
    assert still[0].duration == 60.0


def test_standing_still_after_the_last_beat_changes_nothing():
    kinds = ("noise, no stillness after it", "noise, then 12 s of stillness", "noise, then 48 s of stillness")
    for seed in range(2):
        plain, *still = (
            judge(shape_speed(motion), beats)
            for motion, beats in (NULLS[kind][0](12.0, np.random.default_rng(seed)) for kind in kinds)
        )
        assert [one.level for one in still] == [plain.level] * 2
        # The end of the motion itself shows in its last tenths of a second, the length of the stillness not at all.
        for name in ("p_time", "place_harmony"):
            short, long = (getattr(one, name) for one in still)
            assert short == pytest.approx(long, abs=1e-9)
            assert short == pytest.approx(getattr(plain, name), abs=0.06)


def test_dancers_on_the_beat_are_always_in_time_and_short_windows_are_not_judged():
    table = CELLS.null_table({"on the beat": (on_the_beat, (5.0, 20.0))}, 3, 1).set_index("seconds")
    assert table["cannot tell"].tolist() == [1.0, 0.0] and np.isnan(table.loc[5.0, "p .05"])
    assert table.loc[20.0, ["p_time .05", "p .05", "p .01"]].tolist() == [1.0, 1.0, 0.0]
    assert table["n"].tolist() == [3, 3]


def test_recorded_dancers_are_cut_at_random_and_their_own_beats_moved():
    clip = planted_dance(seconds=24.0, seed=5)
    (grid, windows), (moved, _) = CELLS.recorded_nulls([(clip.motion, clip.beats)]).values()
    assert windows == [6.0, 15.0]
    motion, beats = moved(15.0, np.random.default_rng(1))
    assert motion.duration == pytest.approx(15.0)
    assert beats.tempo == pytest.approx(clip.beats.tempo, rel=0.01) and beats.bar_places is None
    assert 60 <= grid(15.0, np.random.default_rng(1))[1].tempo <= 180


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dancer, same tempo, any phase", "smooth noise"])
def test_p_value_is_small_no_more_often_than_it_may(kind: str):
    draw, _ = NULLS[kind]
    (row,) = CELLS.null_table({kind: (draw, (15.0,))}, 120, 1).to_dict("records")
    assert row["p .05"] <= 0.06 and row["p .01"] <= 0.02
    if kind == "smooth noise":
        assert 0.02 <= row["p_time .05"] <= 0.08


def test_smooth_noise_has_no_beat(rng: np.random.Generator):
    beats = CELLS.steady_beats(0.5, 30.0, rng)
    judgement = judge(shape_speed(CELLS.smooth_noise(30.0, rng)), beats)
    assert judgement.signal is not None and time_test(judgement.signal, beats.times).best < 8


# Pictures


def record(kind: str, **shares: float) -> dict[str, object]:
    about = {"kind": kind, "seconds": 15.0, "n": 400, "cannot tell": 0.0}
    return {**about, "p_time .05": 0.05, "p .05": 0.02, "old p .05": 0.17, **shares}


def test_picture_says_which_clips_are_too_short():
    rows = [record("a"), record("b", **{"p .05": np.nan, "p_time .05": np.nan, "cannot tell": 1.0})]
    (ax,) = pictures.nulls_figure(pd.DataFrame(rows)).axes
    assert [text.get_text() for text in ax.texts] == ["too short: not judged"]


def test_title_tells_the_worst_row_of_both_scores():
    rows = [record("a"), record("b", **{"p .05": 0.055, "old p .05": 0.2}), record("c", **{"p .05": np.nan})]
    assert "up to 20% of clips, H in up to 6%" in pictures.nulls_figure(pd.DataFrame(rows)).get_suptitle()


# Readings of paper mode


def test_own_music_is_preferred_in_the_share_of_late_musics_that_score_less_and_half_of_the_ties():
    rows = np.array([[0.5, 0.4, 0.6, 0.5, 0.1], [0.2, 0.2, 0.2, 0.2, 0.2]])
    np.testing.assert_allclose(CELLS.preferred(rows), [2.5 / 4, 0.5])


@pytest.mark.slow
def test_readings_of_a_recording_of_ours_are_those_of_its_beats_and_they_differ(tmp_path: Path):
    write_corpus(tmp_path, clips=2, seconds=14.0, seed=2)
    folders = find_recordings(tmp_path).folders
    table = notebook_cells("05_right_from_wrong", LAGS=LAGS).readings_table(folders, 0).set_index("reading")
    names = ["as it is", "dance not told", "not 30 ms earlier", "librosa as it comes", "all of these"]
    assert list(table.index) == names and set(table["recordings"]) == {2}
    readings = CELLS.paper_readings(folders[0])
    ours, late = (readings[name][1].times for name in ("as it is", "not 30 ms earlier"))
    np.testing.assert_allclose(np.median(late - ours[-late.size :]), 1.3 * 512 / 22050, atol=1e-3)
    assert table["AUC"].between(table["AUC low"], table["AUC high"]).all()
    assert table.loc["librosa as it comes", "h"] == table.loc["all of these", "h"]  # no layout that leaves more open
