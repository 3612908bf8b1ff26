"""False alarms: what the null rows draw, what is counted, and that it stays within the nominal share."""

import numpy as np
import pandas as pd
import pytest

from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.evidence import time_test
from harmolab.verdict.judge import judge
from study.figures.results import nulls_figure
from tests.builders import cases, planted_dance
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("05_right_from_wrong")
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


def test_dancer_whose_tempo_is_far_off_is_never_near():
    draw, _ = NULLS["dancer, tempo over 4 % off"]
    ratios = np.log([own_ratio(*draw(30.0, np.random.default_rng(seed))) for seed in range(6)])
    assert np.abs(ratios).min() > 0.95 * CELLS.FAR
    assert min(ratios) < 0 < max(ratios)


def test_tempo_drawn_apart_is_that_of_no_beat_in_particular():
    draw, _ = NULLS["dancer, tempo drawn apart"]
    ratios = [own_ratio(*draw(30.0, np.random.default_rng(seed))) for seed in range(5)]
    assert 0.55 < min(ratios) < 0.95
    assert 1.05 < max(ratios) < 1.8


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
    for seed in range(3):
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
    assert table["cannot tell"].tolist() == [1.0, 0.0]
    assert np.isnan(table.loc[5.0, "p .05"])
    assert table.loc[20.0, ["p_time .05", "p .05", "p .01"]].tolist() == [1.0, 1.0, 0.0]
    assert table["n"].tolist() == [3, 3]


def test_recorded_dancers_are_cut_at_random_and_their_own_beats_moved():
    clip = planted_dance(seconds=24.0, seed=5)
    (grid, windows), (moved, _) = CELLS.recorded_nulls([(clip.motion, clip.beats)]).values()
    assert windows == [6.0, 15.0]
    motion, beats = moved(15.0, np.random.default_rng(1))
    assert motion.duration == pytest.approx(15.0)
    assert beats.tempo == pytest.approx(clip.beats.tempo, rel=0.01)
    assert beats.bar_places is None
    assert 60 <= grid(15.0, np.random.default_rng(1))[1].tempo <= 180


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dancer, same tempo, any phase", "smooth noise"])
def test_p_value_is_small_no_more_often_than_it_may(kind: str):
    draw, _ = NULLS[kind]
    (row,) = CELLS.null_table({kind: (draw, (15.0,))}, 400, 1).to_dict("records")
    assert row["p .05"] <= 0.06
    assert row["p .01"] <= 0.02
    if kind == "smooth noise":
        assert 0.02 <= row["p_time .05"] <= 0.08


def test_smooth_noise_has_no_beat(rng: np.random.Generator):
    beats = CELLS.steady_beats(0.5, 30.0, rng)
    judgement = judge(shape_speed(CELLS.smooth_noise(30.0, rng)), beats)
    assert judgement.signal is not None
    assert time_test(judgement.signal, beats.times).best < 8


# Pictures


def record(kind: str, **shares: float) -> dict[str, object]:
    about = {"kind": kind, "seconds": 15.0, "n": 400, "cannot tell": 0.0}
    return {**about, "p_time .05": 0.05, "p .05": 0.02, "old p .05": 0.17, **shares}


def test_picture_marks_each_share_in_the_row_of_its_kind():
    rows = [record("a"), record("b", **{"p .05": np.nan, "p_time .05": np.nan, "cannot tell": 1.0})]
    (ax,) = nulls_figure(pd.DataFrame(rows)).axes
    marks = {line.get_label(): (list(line.get_xdata()), list(line.get_ydata())) for line in ax.lines[1:]}
    assert marks["old score, published"] == ([0.17, 0.17], [1, 0])
    assert marks["H: in time, and where"][0][0] == 0.02
    assert [text.get_text() for text in ax.texts] == ["too short: not judged"]


def test_title_tells_the_worst_row_of_both_scores():
    rows = [record("a"), record("b", **{"p .05": 0.055, "old p .05": 0.2}), record("c", **{"p .05": np.nan})]
    assert "up to 20% of clips, H in up to 6%" in nulls_figure(pd.DataFrame(rows)).get_suptitle()


def test_few_clips_have_no_finding():
    assert "5 clips a row are too few" in nulls_figure(pd.DataFrame([record("a", n=5)])).get_suptitle()
