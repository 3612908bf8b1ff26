"""Levels of recordings to their own music, to the same music moved, and to another dance's."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from study.experiments.levels import (
    HALF,
    OTHER,
    OWN,
    QUARTER,
    SAME,
    level_counts,
    level_recordings,
    level_settings,
    level_table,
)
from study.figures.verdicts import levels_figure
from study.profile import RunProfile


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("HARMOLAB_DATA", raising=False)
        ((name, recordings),) = level_recordings(RunProfile.quick()).items()
    assert name == "synthetic"
    return level_table([item for item in recordings if item.clip.dance in ("waltz", "rumba")], seed=1)


def test_planted_dancers_are_on_the_beat_of_their_own_music_only(table: pd.DataFrame):
    levels = table.groupby("music")["level"].apply(list)
    assert set(levels[OWN]) == {4}
    assert 4 not in levels[QUARTER] + levels[HALF]
    assert set(levels[OTHER]) == {1}


def test_four_settings_are_counted_by_level(table: pd.DataFrame):
    counts = level_counts(table.assign(told=table["told"].where(table["music"] != OWN, other=True)))
    assert counts.loc[("annotated", True), OWN] == "0 0 0 0 6"


@pytest.mark.slow
def test_settings_are_tracked_and_annotated_told_and_not():
    rows = level_settings(level_recordings(RunProfile.quick())["synthetic"][:2])
    assert rows.groupby(["beats", "told"]).ngroups == 4
    assert set(rows["music"]) == {OWN, QUARTER, HALF, SAME}


def test_reading_is_the_dance_that_was_learnt_on_other_recordings(table: pd.DataFrame):
    own = table[table["music"] == OWN]
    assert [row.startswith(dance) for row, dance in zip(own["revealed by"], own["dance"], strict=True)] == [True] * 6


def test_one_dance_alone_has_no_other_music():
    recordings = level_recordings(replace(RunProfile.quick(), seed=2))["synthetic"][:2]
    assert list(level_table(recordings)["music"].unique()) == [OWN, QUARTER, HALF, SAME]


def test_picture_counts_the_levels_of_each_music():
    rows = [
        {"music": "a", "level": 4},
        {"music": "a", "level": 4},
        {"music": "a", "level": 0},
        {"music": "b", "level": 1},
    ]
    (ax,) = levels_figure({"beatlocked": rows}).axes
    title = "Recordings on the beat at level 4: 2 of 3 with a music, 0 of 1 with other music"
    assert ax.get_title("left") == title
    widths = [(bar.get_y() + bar.get_height() / 2, bar.get_width()) for bar in ax.patches if bar.get_width()]
    assert [(round(y), width) for y, width in widths] == [(1, 1), (1, 2), (0, 1)]
    assert [text.get_text() for text in ax.texts] == ["1", "2", "1"]


@pytest.mark.data
@pytest.mark.slow
def test_recorded_dancers_are_on_the_beat_of_their_own_music_only(data_root: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_DATA", str(data_root / "beatlocked"))
    (recordings,) = level_recordings(RunProfile.full()).values()
    on_the_beat = level_settings(recordings).query("level == 4").groupby(["beats", "told", "music"]).size()
    ordinary, told = on_the_beat["tracked", False], on_the_beat["annotated", True]
    assert ordinary[OWN] >= 10 and told[OWN] >= 8
    assert max(ordinary.get(music, 0) for music in (QUARTER, HALF, OTHER)) <= 1
    assert told.get(HALF, 0) == told.get(OTHER, 0) == 0
