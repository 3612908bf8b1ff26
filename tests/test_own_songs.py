"""Half-minute dances side by side: what a statue shows, what is a mean over songs, which songs are kept."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from harmolab import synthetic_clip
from harmolab.data.recordings import Recording
from harmolab.lab.evaluate.measured import statue
from harmolab.systems.training.pose_network import PoseNet
from harmolab.types import Motion
from study.experiments.locked import statue_on_turntable
from study.experiments.own_songs import (
    OWN,
    RECORDED,
    SHOWN,
    Reference,
    dance_measures,
    own_names,
    song_means,
    song_rows,
)


@pytest.fixture(scope="module")
def waltz() -> Recording:
    """A synthetic dancer who rests on the beats, for 20 s."""
    return Recording(synthetic_clip("waltz", seconds=20.0, seed=3), None, Path("waltz_1"))


def motion_of(recording: Recording) -> Motion:
    assert recording.clip.motion is not None
    return recording.clip.motion


def test_a_dancer_who_rests_on_the_beat_has_harmony_in_the_body(waltz: Recording):
    assert waltz.clip.beats is not None
    row = dance_measures(motion_of(waltz), waltz.clip.beats, dance="waltz")
    assert row["body"] > 0.8
    assert all(np.isfinite(row[name]) for name in SHOWN)


def test_a_statue_on_a_turntable_is_found_out_by_its_own_column(waltz: Recording):
    assert waltz.clip.beats is not None
    row = dance_measures(statue_on_turntable(motion_of(waltz), waltz.clip.beats), waltz.clip.beats, dance="waltz")
    assert row["statue"] == pytest.approx(row["room"], abs=0.05)
    assert row["room"] > 0.8
    assert np.isnan(row["body"])  # no movement
    assert row["passed"] is False and "spread" in row["fails"]


def test_rows_of_songs_are_in_order_and_distances_are_of_all_together(waltz: Recording):
    motion = motion_of(waltz)
    torch.manual_seed(0)
    reference = Reference.of([motion], PoseNet(motion.skeleton, fps=15.0))
    rows = song_rows([waltz, waltz], {"statue": lambda recording: statue(motion_of(recording))}, reference)
    assert rows["motion"].tolist() == [RECORDED, RECORDED, "statue", "statue"]
    assert set(rows["song"]) == {"waltz_1"}
    by_motion = rows.groupby("motion")["fid_kinetic"]
    assert (by_motion.nunique() == 1).all()
    assert by_motion.first()["statue"] > by_motion.first()[RECORDED]


def test_seeds_of_one_system_are_one_row_of_the_means():
    rows = pd.DataFrame(
        {
            "motion": ["recorded", "gan, seed 1", "gan, seed 2", "gan, seed 2"],
            "spread": [16.0, 8.0, 10.0, 12.0],
            "passed": [True, False, None, True],
        }
    )
    means = song_means(rows).set_index("motion")
    assert means["spread"].to_dict() == {"recorded": 16.0, "gan": 10.0}
    assert means["guard"].to_dict() == {"recorded": "1 of 1", "gan": "1 of 3"}


def test_the_four_songs_are_kept_where_they_are_else_the_first_of_each_dance(waltz: Recording):
    other = Recording(synthetic_clip("rumba", seconds=12.0, seed=4), None, Path("rumba_1"))
    corpus = {"waltz_1": waltz, "rumba_1": other, "waltz_2": waltz}
    assert own_names(corpus) == ("waltz_1", "rumba_1")
    assert own_names(corpus | dict.fromkeys(OWN, waltz)) == OWN
