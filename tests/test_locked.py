"""Bodies on a metronome: what the score says of each cheat and each dancer, and its picture."""

import numpy as np
import pandas as pd
import pytest

from harmolab.data.synthetic import DANCER
from harmolab.shape_speed import shape_speed
from harmolab.verdict.judge import judge
from study.experiments.locked import evidence, locked_table, metronome, statue_on_turntable
from tests.builders import cases, planted_dance, still, track
from tests.notebook_cells import notebook_cells

AXES = {"SIDE": np.eye(3)[0], "UP": np.eye(3)[1]}
CELLS = notebook_cells("12_cheating_the_score", DANCER=DANCER, **AXES)
BEATS = metronome(CELLS.SECONDS, CELLS.PERIOD)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return locked_table(CELLS.bodies(1), BEATS, CELLS.FPS).set_index("motion")


def test_poses_are_reached_on_the_beats_and_left_and_reached_at_rest():
    beats = np.array([0.0, 0.01, 0.5, 0.99, 1.0])
    np.testing.assert_allclose(CELLS.arrivals(beats), [0.0, 0.0, 0.5, 1.0, 1.0], atol=2e-5)
    np.testing.assert_allclose(CELLS.arrivals(beats, width=0.5), [0.0, 0.0, 0.0, 1.0, 1.0], atol=1e-3)


def test_stroke_is_half_done_on_the_beat_and_over_soon_after_it():
    np.testing.assert_allclose(CELLS.strokes(np.array([1.0, 1.3, 1.5, 1.7, 2.0]), width=0.6), [1, 1.5, 1.5, 1.5, 2])


def test_impact_is_fastest_when_the_beat_stops_it():
    progress = CELLS.impacts(np.array([0.0, 0.7, 0.85, 0.999, 1.0, 1.2]))
    np.testing.assert_allclose(progress, [0.0, 0.0, 0.25, 0.993, 1.0, 1.0], atol=1e-3)


@cases(
    "name",
    "statue on a turntable",
    "statue, turning and travelling",
    "rigid bob",
    "tremor of 1 mm",
    "tremor of 1 nm",
    "one toe, 1 mm",
)
def test_cheat_that_pleased_the_old_score_gets_no_number(table: pd.DataFrame, name: str):
    assert table.loc[name, "old score"] > 0.9
    assert table.loc[name, "level"] == 0
    assert np.isnan(table.loc[name, ["H", "p", "lag (ms)"]].astype(float)).all()


@pytest.mark.parametrize("name", ["tremor of 5 mm on a drift", "sensor noise, 1 cm"])
def test_little_movement_beside_much_travel_or_noise_gets_no_number(table: pd.DataFrame, name: str):
    assert table.loc[name, "level"] == 0


def test_sensor_noise_that_passes_the_floor_has_no_tempo(table: pd.DataFrame):
    assert table.loc["sensor noise, 3 cm", "level"] == 1
    assert np.isnan(table.loc["sensor noise, 3 cm", "own tempo"])


@pytest.mark.parametrize("name", ["rests on the beats", "rests, 60 ms late", "runner, a step a beat"])
def test_dancer_who_is_slow_on_the_beat_is_on_it(table: pd.DataFrame, name: str):
    assert table.loc[name, "level"] == 4


@pytest.mark.parametrize(
    ("name", "fastest"),
    [("hits the beats", 470), ("rests, half a beat late", 0), ("impact, then freeze", 450),
     ("arrives in .1 s, then stands", 450), ("arrives in .25 s, then stands", 375), ("double time", 125)],
)  # fmt: skip
def test_dancer_elsewhere_in_the_beat_is_in_time_and_gets_no_number(table: pd.DataFrame, name: str, fastest: float):
    assert table.loc[name, "level"] == 3
    assert np.isnan(table.loc[name, "H"])
    assert float(table.loc[name, "revealed by"].split()[1].rstrip(",")) == pytest.approx(fastest, abs=25)


def test_four_steps_in_three_beats_are_in_time_and_not_on_the_beat(table: pd.DataFrame):
    runner = table.loc["runner, 4 steps in 3 beats"]
    assert runner["level"] < 4
    assert runner["rate"] == pytest.approx(4 / 3)


def test_dancer_a_quarter_of_a_beat_late_keeps_time_and_is_told_so(table: pd.DataFrame):
    late = table.loc["rests, a quarter of a beat late"]
    assert (late["level"], late["lag (ms)"]) == (3, pytest.approx(125, abs=15))


def test_lag_of_sixty_milliseconds_is_measured(table: pd.DataFrame):
    assert table.loc["rests, 60 ms late", "lag (ms)"] == pytest.approx(60, abs=12)


@pytest.mark.parametrize(("name", "rate"), [("half time", 0.5), ("double time", 2.0), ("rests on the beats", 1.0)])
def test_movements_a_beat_are_counted(table: pd.DataFrame, name: str, rate: float):
    assert table.loc[name, "rate"] == rate


@pytest.mark.parametrize(
    ("name", "percent"),
    [("tempo + 1 %", 1.0), ("tempo + 1.6 %", 1.6), ("tempo + 7 %", 7.0), ("other tempo (+ 27 %)", 27.0)],
)
def test_dancer_of_another_tempo_is_told_it(table: pd.DataFrame, name: str, percent: float):
    assert table.loc[name, "level"] == 1
    assert table.loc[name, "own tempo"] / 1.2 - 100 == pytest.approx(percent, abs=0.2)


def test_noise_follows_no_beat_and_has_no_tempo(table: pd.DataFrame):
    assert table.loc["smooth noise", "level"] == 1
    assert np.isnan(table.loc["smooth noise", "own tempo"])


def test_hand_that_drums_is_in_time_and_shows_how_few_joints_move(table: pd.DataFrame):
    hand = table.loc["one hand, 10 cm"]
    assert hand["level"] == 4
    assert hand["joints"] == pytest.approx(1 / 21, abs=0.02)
    assert "joints 0.05" in hand["revealed by"]


def test_evidence_names_the_number_below_its_floor():
    assert evidence(judge(shape_speed(still(960, fps=30.0, joints=5)), BEATS)) == "pulse 0.000: next to nothing"
    assert evidence(judge(shape_speed(still(960, fps=30.0, joints=5)), track([1.0]))) == "1 beats"


def test_statue_of_a_dancer_turns_and_keeps_its_shape():
    clip = planted_dance()
    shape = shape_speed(statue_on_turntable(clip.motion, clip.beats))
    assert shape.speed.max() < 1e-9
    assert np.sqrt(shape.room).max() > 0.5


def test_picture_has_a_row_for_each_body_and_marks_who_goes_with_the_music(table: pd.DataFrame):
    old, level, words = CELLS.locked_figure(table.reset_index()).axes
    assert len(old.patches) == len(words.texts) == len(table) == 31
    marks = [line for line in level.lines if len(line.get_xdata()) == 1]
    assert [int(line.get_xdata()[0]) for line in marks] == table["level"].tolist()
    assert {line.get_marker() for line in marks if line.get_xdata()[0] == 4} == {"o"}
    heights = [bar.get_y() + bar.get_height() / 2 for bar in old.patches]
    assert (heights[0], heights[12], heights[13]) == pytest.approx((-1, -13, -15))  # the second group has a heading


def test_finding_counts_who_pleases_each_score(table: pd.DataFrame):
    assert CELLS.finding({"table_cheating_on_the_beat": table.reset_index()}) == (
        "Joint speed in the room is pleased by 10 of 13 cheats and by 4 of 12 dancers in time; "
        "the speed of the body's shape by 2 and by 12."
    )


def test_reading_names_the_cheats_that_pass_and_what_tricks_and_late_music_change(table: pd.DataFrame):
    gains = pd.DataFrame({"paper_hit_rate": [0.1, 0.2, -0.1], "above_chance": [0.1, -0.2, -0.1]})
    late = pd.DataFrame({"music": ["true", "half a beat late"], "mean": [0.8, -0.4]})
    late = late.assign(trick="recommended", measure="above_chance", corpus="made up")
    tables = {"table_cheating_gains": gains, "table_generators_late": late}
    words = CELLS.reading(tables | {"table_cheating_on_the_beat": table.reset_index()})
    assert "Cheats that keep time: one hand, 10 cm; random walk that stops on the beats." in words
    assert "Of 3 tricks 2 raise the paper's hit rate, and 1 harmony above chance." in words
    assert "our generator (made up) from 0.80 to -0.40." in words
