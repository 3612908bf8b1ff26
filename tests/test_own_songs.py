"""Half-minute dances side by side: what a statue shows, what is a mean over songs, which songs are kept."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from study.experiments.own_songs import OWN, RECORDED, SHOWN, distances_from, own_names, song_means, song_table

from harmolab import synthetic_clip
from harmolab.data.recordings import Recording
from harmolab.lab.evaluate.measured import Dance, statue
from harmolab.systems.training.pose_network import PoseNet
from harmolab.types import Motion
from study.experiments.locked import statue_on_turntable


@pytest.fixture(scope="module")
def waltz() -> Recording:
    """A synthetic dancer who rests on the beats, for 20 s."""
    return Recording(synthetic_clip("waltz", seconds=20.0, seed=3), None, Path("waltz_1"))


def motion_of(recording: Recording) -> Motion:
    assert recording.clip.motion is not None
    return recording.clip.motion


def dance_of(recording: Recording, system: str, motion: Motion) -> Dance:
    assert recording.clip.beats is not None
    return Dance(system, "waltz_1", motion, recording.clip.beats, 1, "waltz")


def test_a_dancer_who_rests_on_the_beat_has_harmony_in_the_body_and_a_statue_on_a_turntable_is_revealed(
    waltz: Recording,
):
    motion, music = motion_of(waltz), waltz.clip.beats
    assert music is not None
    dances = [dance_of(waltz, RECORDED, motion), dance_of(waltz, "statue", statue_on_turntable(motion, music))]
    recorded, turned = song_means(song_table(dances, {})).to_dict("records")
    assert recorded["body"] > 0.8 and all(np.isfinite(recorded[name]) for name in SHOWN)
    assert turned["statue"] == pytest.approx(turned["room"], abs=0.05)
    assert turned["room"] > 0.8
    assert np.isnan(turned["body"])  # no movement
    assert turned["guard"] == "0 of 1" and turned["spread"] < recorded["spread"]


def test_rows_of_songs_are_in_order_and_distances_are_of_all_together(waltz: Recording):
    motion = motion_of(waltz)
    torch.manual_seed(0)
    distances = distances_from([motion], PoseNet(motion.skeleton, fps=15.0))
    pairs = ((RECORDED, motion), (RECORDED, motion), ("statue", statue(motion)))
    table = song_table([dance_of(waltz, name, each) for name, each in pairs], distances)
    assert (table[table["measure"].isin(distances)]["song"] == "").all()
    means = song_means(table)
    assert means["motion"].tolist() == [RECORDED, "statue"]
    assert means["fid_kinetic"][1] > means["fid_kinetic"][0]


def test_seeds_of_one_system_are_one_row_of_the_means():
    values = {("recorded", 1): (16.0, 1.0), ("gan", 1): (8.0, 0.0), ("gan", 2): (10.0, np.nan), ("gan", 3): (12.0, 1.0)}
    lines = [
        (system, seed, measure, value)
        for (system, seed), pair in values.items()
        for measure, value in zip(("likeness_spread", "likeness"), pair, strict=True)
    ]
    means = song_means(pd.DataFrame(lines, columns=["system", "seed", "measure", "value"])).set_index("motion")
    assert means["spread"].to_dict() == {"recorded": 16.0, "gan": 10.0}
    assert means["guard"].to_dict() == {"recorded": "1 of 1", "gan": "1 of 3"}


def test_the_four_songs_are_kept_where_they_are_else_the_first_of_each_dance(waltz: Recording):
    other = Recording(synthetic_clip("rumba", seconds=12.0, seed=4), None, Path("rumba_1"))
    corpus = {"waltz_1": waltz, "rumba_1": other, "waltz_2": waltz}
    assert own_names(corpus) == ("waltz_1", "rumba_1")
    assert own_names(corpus | dict.fromkeys(OWN, waltz)) == OWN
