"""The long table of dances and its summary: planted dancers, and numbers worked out by hand."""

import io
from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.evaluate.measured import HARMONY, Dance, dance_numbers, measure_dances, statue
from harmolab.lab.evaluate.summary import summary, training_interval
from harmolab.metrics.features import frechet_distance, kinetic_features, standardise
from harmolab.types import BeatTrack, Motion
from tests.builders import refused


def dancers(*systems: str, songs: int = 4) -> list[Dance]:
    """A synthetic dancer to each song, for each system."""
    clips = [synthetic_clip("waltz", seconds=12.0, seed=seed) for seed in range(songs)]
    return [
        Dance(system, f"song {number}", clip.motion, clip.beats)
        for system in systems
        for number, clip in enumerate(clips)
        if clip.motion is not None and clip.beats is not None
    ]


def value_of(table: pd.DataFrame, system: str, measure: str) -> float:
    return float(table[(table["system"] == system) & (table["measure"] == measure)]["value"].mean())


def test_twice_the_size_has_twice_the_jerk_of_the_recorded() -> None:
    recorded = dancers("recorded")
    motions = [replace(one.motion, positions=2 * one.motion.positions) for one in recorded]
    larger = [one._replace(system="x", motion=motion) for one, motion in zip(recorded, motions, strict=True)]
    table = measure_dances([*recorded, *larger], ["jerk_ratio", "speed_ratio"])
    assert value_of(table, "recorded", "jerk_ratio") == pytest.approx(1)
    assert value_of(table, "x", "jerk_ratio") == pytest.approx(2)
    assert value_of(table, "x", "speed_ratio") == pytest.approx(2)
    assert list(table) == ["system", "song", "seed", "measure", "value"]
    assert set(table["measure"]) == {"jerk_ratio", "speed_ratio"}


def test_a_dancer_on_the_beat_rests_on_it_and_not_half_a_beat_later() -> None:
    table = measure_dances(dancers("x", songs=2), ["rests", "rests_late"])
    assert value_of(table, "x", "rests") > 0.8 and value_of(table, "x", "rests_late") < 0


def test_a_statue_has_no_harmony_and_is_no_dancer() -> None:
    stone = [one._replace(motion=statue(one.motion)) for one in dancers("x", songs=1)]
    assert dance_numbers(stone[0], ["harmony", "likeness"]) == {"harmony": 0, "likeness": 0}


def test_dances_that_do_not_follow_unsure_beats_count_in_the_means() -> None:
    dance, *_ = dancers("x", songs=1)
    times = np.arange(0.2, dance.music.duration, 0.37)  # has nothing to do with the dance
    other = BeatTrack(times, np.ones(times.size), 100.0, dance.music.duration)
    unsure = replace(other, quality=0.5, windows=[[6.0, 0.0]])
    sure, doubtful = (dance_numbers(dance._replace(music=one), HARMONY) for one in (other, unsure))
    assert doubtful == pytest.approx(sure | {"level": 0.0}, nan_ok=True)
    assert sure["level"] == 1 and sure["significant"] == 0


def test_sets_of_dances_have_their_distance_and_no_song() -> None:
    recorded = dancers("recorded")
    table = measure_dances([*recorded, *(one._replace(system="x") for one in recorded)], ["fid_kinetic", "seconds"])
    (line,) = table[(table["system"] == "x") & (table["measure"] == "fid_kinetic")].to_dict("records")
    assert line["value"] <= 0 and (line["song"], line["seed"]) == ("", "")  # nothing apart, less the bias
    assert (table["measure"] == "seconds").sum() == 8


def test_the_distance_is_that_of_standardised_features() -> None:
    recorded, own = dancers("recorded"), [one._replace(seed=2) for one in dancers("x", songs=8)[4:]]
    model, values = (np.stack([kinetic_features(one.motion) for one in side]) for side in (recorded, own))
    expected = frechet_distance(standardise(values, model), standardise(model, model))
    assert value_of(measure_dances([*recorded, *own], ["fid_kinetic"]), "x", "fid_kinetic") == expected.value


def test_a_measure_of_sets_has_a_line_for_each_training() -> None:
    recorded = dancers("recorded", songs=2)
    twice = [one._replace(system="x", seed=seed) for seed in (1, 2) for one in recorded]
    table = measure_dances([*recorded, *twice], [], of_sets={"share": lambda own, model: len(own) / len(model)})
    lines = table[table["system"] == "x"].to_dict("records")
    assert [(line["seed"], line["measure"], line["value"]) for line in lines] == [(1, "share", 1.0), (2, "share", 1.0)]


def test_a_measure_of_ones_own_stands_beside_the_others() -> None:
    table = measure_dances(dancers("x", songs=1), ["seconds"], others={"frames": lambda dance: dance.motion.n_frames})
    assert list(table["measure"]) == ["seconds", "frames"]
    assert value_of(table, "x", "frames") == dancers("x", songs=1)[0].motion.n_frames


def test_a_measure_that_there_is_not_is_refused_by_name() -> None:
    message = "no measure of a dance is called 'grace'; there are: seconds, harmony"
    refused(message, measure_dances, dancers("x", songs=1), ["grace"])


def test_ratios_without_recorded_dances_are_refused() -> None:
    refused("need dances of the system 'recorded'", measure_dances, dancers("x", songs=1), ["jerk_ratio"])


def test_what_a_short_dance_does_not_have_is_missing() -> None:
    one = dancers("x", songs=1)[0]
    short = one._replace(motion=Motion(one.motion.positions[:2], one.motion.fps, one.motion.skeleton))
    assert np.isnan(dance_numbers(short, ["jerk"])["jerk"])


# The summary


def lines(*rows: tuple[object, ...], columns: str = "system song seed measure value") -> pd.DataFrame:
    return pd.DataFrame(rows, columns=columns.split())


def row_of(table: pd.DataFrame, system: str) -> dict[Hashable, Any]:
    (row,) = table[table["system"] == system].to_dict("records")
    return row


def test_seeds_are_averaged_within_a_song_in_a_summary() -> None:
    table = lines(("x", "a", 1, "harmony", 0.0), ("x", "a", 2, "harmony", 2.0), ("x", "b", 1, "harmony", 4.0))
    row = row_of(summary(table), "x")  # songs have 1 and 4; the mean over dances is 2
    assert [row[name] for name in ("mean", "n", "low", "high")] == [2.5, 2, 1, 4]


def test_a_table_that_was_read_back_from_a_file_has_the_same_summary() -> None:
    table = lines(("x", "a", "", "harmony", 1.0), ("x", "b", "", "harmony", 4.0), ("x", "", "", "fid_kinetic", 2.0))
    pd.testing.assert_frame_equal(summary(pd.read_csv(io.StringIO(table.to_csv(index=False)))), summary(table))


def test_the_difference_is_over_the_songs_of_both() -> None:
    songs = {"x": {"a": 1.0, "b": 2.0, "c": 9.0}, "y": {"a": 0.0, "b": 1.0}}
    table = lines(*((one, song, "", "harmony", value) for one in songs for song, value in songs[one].items()))
    row = row_of(summary(table, base="y"), "x")
    assert [row[name] for name in ("difference", "difference_low", "difference_high", "common")] == [1, 1, 1, 2]
    assert pd.isna(row["rank"])  # two songs are too few
    assert pd.isna(row_of(summary(table, base="y"), "y")["difference"])
    refused("no system is called 'z'; there are x, y", summary, table, base="z")


def test_a_rank_needs_a_direction_and_a_clear_difference() -> None:
    better = [("x", song, "", name, 1.0) for song in range(6) for name in ("harmony", "pfc", "seconds")]
    worse = [("y", song, "", name, 0.0) for song in range(6) for name in ("harmony", "pfc", "seconds")]
    table = summary(lines(*better, *worse)).set_index(["measure", "system"])["rank"]
    assert (table["harmony", "x"], table["harmony", "y"]) == (1, 2)
    assert (table["pfc", "x"], table["pfc", "y"]) == (2, 1)  # less is better
    assert pd.isna(table["seconds", "x"])


def test_few_trainings_have_a_rank_where_few_are_enough() -> None:
    rows = [(name, run, "harmony", value + 0.01 * run) for name, value in (("x", 1.0), ("y", 0.0)) for run in (1, 2, 3)]
    table = lines(*rows, columns="system training measure value")
    options: dict[str, Any] = {"over": "training", "within": [], "interval": training_interval}
    assert summary(table, **options)["rank"].isna().all()
    assert list(summary(table, **options, fewest=3)["rank"]) == [1, 2]


def test_trainings_are_paired_within_a_corpus_by_students_t() -> None:
    factors = {"with": 2.0, "without": 1.0}.items()
    rows = [("c", each, run, dance, "harmony", by * run) for each, by in factors for run in (1, 2) for dance in "ab"]
    table = lines(*rows, ("d", "with", 1, "a", "harmony", 7.0), columns="corpus variant training dance measure value")
    options: dict[str, Any] = {"over": "training", "within": "dance", "interval": training_interval}
    means = summary(table, "variant", by="corpus", base="without", **options).set_index(["corpus", "variant"])
    own = means.loc[("c", "with")]
    # Trainings have 2 and 4: mean 3, standard error 1, Student's t of one degree 12.706.
    assert own["low"] == pytest.approx(3 - 12.706, abs=1e-3) and own["high"] == pytest.approx(3 + 12.706, abs=1e-3)
    assert own["difference"] == 1.5 and own["common"] == 2
    assert means.loc[("d", "with"), "mean"] == 7 and np.isnan(means.loc[("d", "with"), "low"])


def test_the_mean_over_dances_counts_a_dance_with_few_songs_as_much() -> None:
    rows = [("x", 1, "a", song, "harmony", 0.0) for song in range(3)]
    table = lines(*rows, ("x", 1, "b", 0, "harmony", 1.0), columns="system training dance song measure value")
    row = row_of(summary(table, over="training", within=["dance", "song"], interval=training_interval), "x")
    assert row["mean"] == 0.5  # the mean over songs is .25


def test_what_was_not_measured_is_in_no_mean() -> None:
    row = row_of(summary(lines(("x", "a", "", "harmony", 1.0), ("x", "b", "", "harmony", float("nan")))), "x")
    assert (row["mean"], row["n"]) == (1, 1)
