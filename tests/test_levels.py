"""Levels of recordings to their own music, to the same music moved, and to another dance's."""

from pathlib import Path

import pandas as pd
import pytest

from study.figures.results import levels_figure
from study.profile import RunProfile
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("05_right_from_wrong")
OWN, QUARTER, HALF, SAME, OTHER = CELLS.OWN, CELLS.QUARTER, CELLS.HALF, CELLS.SAME, CELLS.OTHER


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return CELLS.level_table(
        [item for item in CELLS.planted_recordings(seed=1) if item.clip.dance in ("waltz", "rumba")], seed=1
    )


def test_planted_dancers_are_on_the_beat_of_their_own_music_only(table: pd.DataFrame):
    levels = table.groupby("music")["level"].apply(list)
    assert set(levels[OWN]) == {4}
    assert 4 not in levels[QUARTER] + levels[HALF]
    assert set(levels[OTHER]) == {1}


def test_four_settings_are_counted_by_level(table: pd.DataFrame):
    counts = CELLS.level_counts(table.assign(told=table["told"].where(table["music"] != OWN, other=True)))
    assert counts.loc[("annotated", True), OWN] == "0 0 0 0 6"


@pytest.mark.slow
def test_settings_are_tracked_and_annotated_told_and_not():
    rows = CELLS.level_settings(CELLS.planted_recordings(seed=1)[:2])
    assert rows.groupby(["beats", "told"]).ngroups == 4
    assert set(rows["music"]) == {OWN, QUARTER, HALF, SAME}


def test_reading_is_the_dance_that_was_learnt_on_other_recordings(table: pd.DataFrame):
    own = table[table["music"] == OWN]
    assert [row.startswith(dance) for row, dance in zip(own["revealed by"], own["dance"], strict=True)] == [True] * 6


def test_one_dance_alone_has_no_other_music():
    recordings = CELLS.planted_recordings(seed=2)[:2]
    assert list(CELLS.level_table(recordings)["music"].unique()) == [OWN, QUARTER, HALF, SAME]


def test_no_recordings_have_annotated_beats_without_a_folder(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HARMOLAB_DATA", raising=False)
    assert CELLS.annotated_recordings(RunProfile.quick()) == {}


def test_picture_counts_the_levels_of_each_music():
    row = {"corpus": "beatlocked", "beats": "tracked", "told": False, "a": "1 0 0 0 2", "b": "0 1 0 0 0", "c": ""}
    (ax,) = levels_figure(pd.DataFrame([row, row | {"told": True}])).axes
    title = "Recordings on the beat at level 4: 2 of 3 with a music, 0 of 1 with other music"
    assert ax.get_title("left") == title
    widths = {(round(bar.get_y() + 0.4), bar.get_x(), bar.get_width()) for bar in ax.patches if bar.get_width()}
    assert widths == {(0, 0, 1), (0, 1, 2), (1, 0, 1)}
    assert [text.get_text() for text in ax.texts if text.get_text()] == ["1", "1", "2"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b"]


@pytest.mark.data
@pytest.mark.slow
def test_recorded_dancers_are_on_the_beat_of_their_own_music_only(data_root: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_DATA", str(data_root / "beatlocked"))
    (recordings,) = CELLS.annotated_recordings(RunProfile.full()).values()
    on_the_beat = CELLS.level_settings(recordings).query("level == 4").groupby(["beats", "told", "music"]).size()
    ordinary, told = on_the_beat["tracked", False], on_the_beat["annotated", True]
    assert ordinary[OWN] >= 10 and told[OWN] >= 8
    assert max(ordinary.get(music, 0) for music in (QUARTER, HALF, OTHER)) <= 1
    assert told.get(HALF, 0) == told.get(OTHER, 0) == 0
