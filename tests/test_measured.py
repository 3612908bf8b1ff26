"""The long table of dances: planted dancers, and numbers worked out by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.evaluate.measured import HARMONY, Dance, dance_numbers, measure_dances, statue
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
    refused("no measure of a dance is called 'fid_pose'", measure_dances, dancers("recorded", songs=2), ["fid_pose"])


def test_ratios_without_recorded_dances_are_refused() -> None:
    refused("need dances of the system 'recorded'", measure_dances, dancers("x", songs=1), ["jerk_ratio"])


def test_what_a_short_dance_does_not_have_is_missing() -> None:
    one = dancers("x", songs=1)[0]
    short = one._replace(motion=Motion(one.motion.positions[:2], one.motion.fps, one.motion.skeleton))
    assert np.isnan(dance_numbers(short, ["jerk"])["jerk"])
