"""Tables of a comparison from hand-made dances: means, intervals, ranks, the paper's columns."""

import numpy as np
import pandas as pd
import pytest

from harmolab.significance import bootstrap_interval, mean_interval
from study.cells import notebook_cells
from study.experiments.contestants import HARMOGAN, LEE, REN, RIGHT_SONG, WITHOUT
from study.experiments.judging import PAPER_MEANS, TABLE_1, TABLE_2, printed

CELLS = notebook_cells("10_systems_compared")
KEYS = ("music", "corpus", "system", "training", "song", "clip", "dance", "draw")


def dances(system: str, values: dict[tuple[int, str, str, int], float], **others: float) -> pd.DataFrame:
    """Dances of a system from (training, dance, song, draw) -> h; other measures are 0 unless given."""
    rows = []
    for (training, dance, song, draw), value in values.items():
        about = dict(zip(KEYS, ("songs", "corpus", system, training, song, f"{song} 0", dance, draw), strict=True))
        rows.append({**about, **dict.fromkeys(CELLS.PAPER, 0.0), **others, "h": value})
    return pd.DataFrame(rows)


def test_mean_of_a_dance_is_over_draws_and_songs_and_that_of_all_over_dances():
    values = {(1, "waltz", "a", 1): 0.2, (1, "waltz", "a", 2): 0.4}
    values |= {(1, "waltz", "b", 1): 0.5, (1, "tango", "c", 1): 0.9}
    table = CELLS.table_by_dance(dances(RIGHT_SONG, values, **{"h chance": 0.25}), "h").set_index("dance")
    assert table["mean"].to_dict() == pytest.approx({"waltz": 0.4, "tango": 0.9, "mean": 0.65})
    assert table["clips"].to_dict() == {"waltz": 2, "tango": 1, "mean": 3}
    assert table["chance"].tolist() == pytest.approx([0.25] * 3)
    assert table.loc["waltz", ["low", "high"]].tolist() == pytest.approx(bootstrap_interval([0.3, 0.5], [1, 1]))
    assert table.loc["waltz", ["low", "high"]].tolist() == pytest.approx([0.3, 0.5])
    assert np.isnan(table.loc["tango", "low"]) and table.loc["tango", "interval over"] == ""
    assert table["paper"].isna().all()


def test_several_windows_of_a_song_are_drawn_together():
    table = dances(RIGHT_SONG, {(1, "waltz", song, 1): float(song == "a") for song in ("a", "b")})
    more = pd.concat([table, table.assign(clip=table["clip"] + "'")])
    # As for two songs, however many windows each has.
    assert CELLS.table_by_dance(more, "h")["low"].tolist() == CELLS.table_by_dance(table, "h")["low"].tolist()


def test_interval_of_a_trained_system_is_over_its_trainings():
    values = {(training, "waltz", song, 1): value for training, value in ((1, 0.2), (2, 0.4)) for song in ("a", "b")}
    row = CELLS.mean_over_dances(dances(HARMOGAN, values), "h")
    assert row["interval over"] == "trainings"
    assert (row["mean"], row["low"], row["high"]) == pytest.approx(mean_interval([0.2, 0.4]))
    # SD sqrt(2) / 10, divided by sqrt(2), times t(0.975; 1) = 12.7062.
    assert row["high"] == pytest.approx(0.3 + 1.27062, abs=1e-4)


def test_one_training_has_no_interval_and_what_was_not_trained_has_one_over_songs():
    values = {(1, "waltz", "a", 1): 0.2, (1, "waltz", "b", 1): 0.4}
    one = CELLS.mean_over_dances(dances(HARMOGAN, values), "h")
    assert one["mean"] == pytest.approx(0.3)
    assert np.isnan([one["low"], one["high"]]).all() and one["interval over"] == ""
    cheap = CELLS.mean_over_dances(dances(RIGHT_SONG, values), "h")
    assert (cheap["low"], cheap["high"], cheap["interval over"]) == (pytest.approx(0.2), pytest.approx(0.4), "songs")


def test_songs_are_drawn_anew_within_each_dance():
    clips = pd.DataFrame({"dance": ["a", "a", "b", "b"], "song": list("1234"), "h": [0.0, 1.0, 5.0, 5.0]})
    # The mean over dances lies between (0 + 5) / 2 and (1 + 5) / 2, whichever songs are drawn.
    assert CELLS.within_dances(clips, "h") == pytest.approx((2.5, 3.0))
    assert np.isnan(CELLS.within_dances(clips.iloc[[0, 2]], "h")).all()


def test_a_difference_is_taken_clip_by_clip_and_ranked_only_by_both_intervals():
    base = {(training, "waltz", song, 1): 0.1 * number for training in (1, 2) for number, song in enumerate("abcd")}
    shifted = {key: value + 0.3 + 0.01 * key[0] for key, value in base.items()}
    table = pd.concat([dances(HARMOGAN, base), dances(WITHOUT, shifted)])
    (row,) = CELLS.difference_table(table, ["h"]).to_dict("records")
    assert row["difference"] == pytest.approx(0.315)
    assert (row["low"], row["high"]) == pytest.approx(mean_interval([0.31, 0.32])[1:])
    assert (row["low over songs"], row["high over songs"]) == pytest.approx((0.315, 0.315)) and row["rank"] == "above"
    (row,) = CELLS.difference_table(table[table["training"] == 1], ["h"]).to_dict("records")
    assert row["difference"] == pytest.approx(0.31) and np.isnan([row["low"], row["high"]]).all() and row["rank"] == ""


def test_what_was_not_trained_is_held_against_every_training():
    base = {(training, "waltz", song, 1): 0.5 - 0.1 * training for training in (1, 2) for song in "ab"}
    cheap = {(1, "waltz", song, 1): 0.1 for song in "ab"}
    both = pd.concat([dances(HARMOGAN, base), dances(RIGHT_SONG, cheap)])
    (row,) = CELLS.difference_table(both, ["h"]).to_dict("records")
    assert row["difference"] == pytest.approx(np.mean([-0.3, -0.2]))
    assert (row["low"], row["high"]) == pytest.approx(mean_interval([-0.3, -0.2])[1:]) and row["rank"] == ""


def test_a_rival_trained_once_is_held_against_the_first_training_alone_and_gets_no_rank():
    base = {(training, "waltz", song, 1): 0.1 * training for training in (1, 2, 3) for song in "ab"}
    rival = {(1, "waltz", "a", 1): 0.5, (1, "waltz", "b", 1): 0.6}
    (row,) = CELLS.difference_table(pd.concat([dances(HARMOGAN, base), dances(REN, rival)]), ["h"]).to_dict("records")
    assert row["difference"] == pytest.approx(0.55 - 0.1)
    assert np.isnan([row["low"], row["high"]]).all() and row["rank"] == ""


def test_without_harmogan_there_is_nothing_to_differ_from():
    assert CELLS.difference_table(dances(RIGHT_SONG, {(1, "waltz", "a", 1): 0.2}), ["h"]).empty


def test_the_papers_values_stand_beside_the_systems_that_it_names():
    for system, name in ((HARMOGAN, "HarmoGAN"), (WITHOUT, "HarmoGAN without L_harmo"), (LEE, "Lee"), (REN, "Ren")):
        table = CELLS.table_by_dance(dances(system, {(1, "waltz", "a", 1): 0.2}), "hit_rate").set_index("dance")
        assert table.loc["waltz", "paper"] == TABLE_2[name][-1]
        assert table.loc["mean", "paper"] == pytest.approx(np.mean(TABLE_2[name]))


def test_printed_values_and_their_means():
    assert printed("h", "Lee", "jive") == 0.3359 and printed("hit_rate", "HarmoGAN", "samba") == 0.8369
    assert np.isnan([printed("h", "Lee", "salsa"), printed("h", "Bo", "jive"), printed("above_chance", "Lee")]).all()
    means = {name: (round(printed("h", name), 4), round(printed("hit_rate", name), 4)) for name in TABLE_1}
    rivals = {"Lee": (0.2953, 0.5909), "Ren": (0.2630, 0.4265)}
    assert means == rivals | {"HarmoGAN without L_harmo": (0.1993, 0.2396), "HarmoGAN": (0.3522, 0.7572)}
    assert dict(PAPER_MEANS["lee2019"]) == {"paper_harmony": 0.2953, "paper_hit_rate": 0.5909}
    assert dict(PAPER_MEANS["ren2020"]) == {"paper_harmony": 0.2630, "paper_hit_rate": 0.4265}
