"""Tricks that please a score: what they do to a motion, the tables they go into, and their picture."""

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.body.skeletons import Skeleton
from harmolab.lab.figures.style import COLOURS
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.types import Audio, BeatTrack, Clip, Motion
from study.experiments import judging as module
from study.experiments.generation import SYNTHETIC
from study.experiments.judging import (
    LATE,
    TRUE,
    generators_half_a_beat_late,
    half_a_beat_late,
    studied_clips,
    trick_means,
)
from study.figures.variants import LOOKS, SIDES, draw_dumbbells, listening_figure, tricks_figure
from study.profile import RunProfile
from study.saving import smallest_text
from tests.builders import bobbing, refused
from tests.notebook_cells import notebook_cells

PROFILE = RunProfile("tiny", n_clips=2, n_sequences=None, n_rotations=40)
TWO = Skeleton(("hip", "knee"), (-1, 0))
AXES = {"SIDE": np.eye(3)[0], "UP": np.eye(3)[1]}
CELLS = notebook_cells("12_cheating_the_score", **AXES)
BASES = {
    "as danced + jitter 2 cm": "as danced",
    "too slow + tremor 2 Hz": "dance, 3 times too slow",
    "too slow + jitter 5 mm": "dance, 3 times too slow",
    "sway + tremor 2 Hz": "no dance, sway 0.4 Hz",
}
TRICKS = {*BASES, *BASES.values()}


@pytest.fixture
def walk() -> Motion:
    """Two joints that move by a metre a second to the side, ten frames a second."""
    side = np.arange(20) / 10
    positions = np.stack([np.stack([side, np.full(20, height), np.zeros(20)], axis=1) for height in (1.0, 0.5)], axis=1)
    return Motion(positions, 10.0, TWO)


# Tricks


def test_tremor_moves_the_whole_body_up_and_down(walk: Motion):
    moved = CELLS.trembling(walk, 2.5, 0.01).positions - walk.positions
    np.testing.assert_allclose(moved[:5, 0, 1], [0.0, 0.01, 0.0, -0.01, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved[:, 0], moved[:, 1])
    np.testing.assert_allclose(moved[..., [0, 2]], 0.0)


def test_jitter_has_the_size_asked_for(walk: Motion, rng: np.random.Generator):
    long = Motion(np.zeros((5000, 2, 3)), 10.0, TWO)
    assert CELLS.shaken(long, 0.02, rng).positions.std() == pytest.approx(0.02, rel=0.02)


def test_slowed_motion_has_come_a_third_of_the_way(walk: Motion):
    slow = CELLS.slowed(walk, 3.0)
    assert slow.n_frames == walk.n_frames
    np.testing.assert_allclose(slow.positions[:, 0, 0], np.arange(20) / 30)


def test_swaying_body_keeps_its_first_pose(walk: Motion):
    sway = CELLS.swaying(walk, 0.5, 0.05).positions
    np.testing.assert_allclose(sway[:, 0] - sway[:, 1], np.tile([0.0, 0.5, 0.0], (20, 1)))
    assert sway[5, 0, 0] == pytest.approx(0.05)


# Music half a beat late


def test_late_beats_lie_between_the_old_ones_and_come_in_again_at_the_start():
    late = half_a_beat_late(BeatTrack([0.25, 0.75, 1.25, 1.85], [1.0, 2.0, 3.0, 4.0], 100.0, 2.0))
    np.testing.assert_allclose(late.times, [0.1, 0.5, 1.0, 1.5])
    assert list(late.strengths) == [4.0, 1.0, 2.0, 3.0]


def test_single_beat_has_no_half():
    refused("half a beat needs two beats or more, got 1", half_a_beat_late, BeatTrack([0.25], [1.0], 100.0, 2.0))


# Tables


@pytest.fixture
def table(swinging_arm: Callable[..., Motion]) -> pd.DataFrame:
    """Tricks on one clip: an arm that rests on every beat."""
    beats = BeatTrack(0.25 + 0.5 * np.arange(12), np.ones(12), 100.0, 6.0)
    clip = ("arm", swinging_arm(1.0, 60.0), beats)
    material = {"generator_corpora": lambda profile: ("one", "two"), "studied_clips": lambda *_: [clip]}
    return notebook_cells("12_cheating_the_score", **AXES, **material).cheating(PROFILE)


def test_table_has_every_trick_with_both_musics_for_each_corpus(table: pd.DataFrame):
    tricks = table.groupby(["corpus", "music"], sort=False)["trick"].apply(set).to_dict()
    assert tricks == {(corpus, music): TRICKS for corpus in ("one", "two") for music in (TRUE, LATE)}


def test_dancer_on_the_beat_loses_everything_when_the_music_is_late(table: pd.DataFrame):
    danced = table[(table["trick"] == "as danced") & (table["corpus"] == "one")].set_index("music")
    assert danced.loc[TRUE, "above_chance"] == pytest.approx(1.0)
    assert danced.loc[LATE, "hit_rate"] == 0.0
    assert danced.loc[LATE, "above_chance"] < -0.3


def test_what_does_not_depend_on_the_music_is_the_same_with_both(table: pd.DataFrame):
    wide = table[table["corpus"] == "one"].pivot_table(
        index="trick", columns="music", values=["jerk", "paper_count_ratio"]
    )
    for measure in ("jerk", "paper_count_ratio"):
        np.testing.assert_allclose(wide[measure, TRUE], wide[measure, LATE])


def made_up() -> pd.DataFrame:
    """Two clips: h of 1 and 2 for every base, 4 and 7 for every trick; 10 more with late music."""
    rows = []
    for trick in TRICKS:
        for clip, value in enumerate([4.0, 7.0] if trick in BASES else [1.0, 2.0]):
            for music, more in ((TRUE, 0.0), (LATE, 10.0)):
                rows.append({"corpus": "made up", "clip": clip, "trick": trick, "music": music, "h": value + more})
    return pd.DataFrame(rows)


def test_means_are_over_clips_of_one_trick_and_music():
    means = trick_means(made_up(), ["h"]).set_index(["trick", "music"])
    assert means.loc[("as danced", TRUE), "mean"] == 1.5
    assert means.loc[("sway + tremor 2 Hz", LATE), "mean"] == 15.5
    # Half the difference times t(0.975; 1) = 12.7062.
    assert means.loc[("as danced", TRUE), "high"] == pytest.approx(1.5 + 6.3531, abs=1e-4)
    assert set(means["n"]) == {2}


def test_gain_of_a_trick_is_over_the_motion_it_was_put_on_with_the_true_music():
    gained = CELLS.trick_gains(trick_means(made_up(), ["h"]))
    assert dict(zip(gained["trick"], gained["put on"], strict=True)) == dict(BASES)
    assert gained["h"].tolist() == [4.0] * len(BASES)


def test_synthetic_clips_are_read_from_their_own_corpus_where_there_are_recordings(monkeypatch: pytest.MonkeyPatch):
    beats = BeatTrack([0.1, 0.2], [1.0, 1.0], 100.0, 1.0)
    clips = {
        "dances": Clip("b", Audio(np.zeros(10), 10.0), Motion(np.zeros((2, 2, 3)), 10.0, TWO), beats=beats),
        "still": Clip("a", Audio(np.zeros(10), 10.0), beats=beats),
    }
    monkeypatch.setattr(module, "excerpt", lambda sequence, seconds: clips[sequence])
    monkeypatch.setattr(module, "synthetic_corpus", lambda profile: "folder")
    monkeypatch.setattr(module, "readable_recordings", lambda folder: iter(["still", "dances"]))
    monkeypatch.setattr(module, "study_recordings", lambda profile, corpus: iter(["still"]))
    monkeypatch.setattr(module, "data_root", lambda: "recordings")
    assert [name for name, *_ in studied_clips(PROFILE, SYNTHETIC)] == ["b"]
    assert list(studied_clips(PROFILE, "recordings")) == []


def test_generator_that_listens_falls_with_late_music_and_one_beside_the_beat_rises(monkeypatch: pytest.MonkeyPatch):
    beats, index = 0.25 + 0.5 * np.arange(8), np.repeat([1.0, 0.0], 30).astype(np.float32)
    unit = DanceUnit(
        "one", "s", "waltz", frozenset("a"), frozenset("a"), 0.0, np.zeros((60, 1), np.float32),
        np.zeros((60, 6), np.float32), index, beats, np.ones(8), 15.0,
    )  # fmt: skip
    units = UnitSet((unit,), Skeleton(("joint",), (-1,)), np.zeros(1), FeatureParams())
    dances = {"recorded": [bobbing(0.25)], "recommended": [bobbing(0.25)], "paper": [bobbing(0.5)]}
    monkeypatch.setattr(module, "generator_corpora", lambda profile: ("made up",))
    monkeypatch.setattr(module, "danced_units", lambda profile, corpus: (units, dances))
    rates = generators_half_a_beat_late(PROFILE).set_index(["trick", "music"])["hit_rate"]
    assert (rates["recommended", TRUE], rates["recommended", LATE]) == (1.0, 0.0)
    assert (rates["paper", TRUE], rates["paper", LATE]) == (0.0, 1.0)
    assert (rates["recorded", TRUE], rates["recorded", LATE]) == (1.0, 0.0)


# The picture


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def record(trick: str, music: str, mean: float, measure: str = "paper_hit_rate") -> dict[str, object]:
    about = {"corpus": "made up", "trick": trick, "music": music, "measure": measure, "n": 7}
    return {**about, "mean": mean, "low": mean - 0.1, "high": mean + 0.1}


def marks(ax: Axes) -> dict[tuple[float, float], str]:
    """Every single mark: (x, y) -> marker."""
    single = [line for line in ax.lines if len(line.get_xdata()) == 1]
    return {(float(line.get_xdata()[0]), float(line.get_ydata()[0])): line.get_marker() for line in single}


def test_arrow_leads_from_the_true_music_to_a_hollow_dot_at_the_late_one(ax: Axes):
    rows = [record("a", TRUE, 0.9), record("a", LATE, 0.2), record("b", TRUE, 0.3), record("b", LATE, 0.6)]
    draw_dumbbells(ax, rows, measure="paper_hit_rate")
    late = [line for line in ax.lines if line.get_gid() == "late"]
    assert [(float(line.get_xdata()[0]), line.get_markerfacecolor()) for line in late] == [
        (0.2, "white"),
        (0.6, "white"),
    ]
    assert [(text.xyann[0], text.xy[0]) for text in ax.texts] == [(0.9, 0.2), (0.3, 0.6)]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["b", "a"]


def test_level_of_chance_is_a_grey_bar_in_the_row_of_its_trick(ax: Axes):
    rows = [record("a", TRUE, 0.9), record("a", LATE, 0.2), record("a", TRUE, 0.8, "paper_chance")]
    draw_dumbbells(ax, rows, measure="paper_hit_rate")
    (bar,) = [line for line in ax.lines if line.get_color() == COLOURS["chance"]]
    assert list(bar.get_xdata()) == [0.8, 0.8]


def test_generators_keep_their_own_colour_mark_and_name(ax: Axes):
    draw_dumbbells(ax, [record("paper", TRUE, 0.9), record("paper", LATE, 0.2)], measure="paper_hit_rate")
    (mark,) = [line for line in ax.lines if len(line.get_xdata()) == 1 and line.get_marker() == LOOKS["paper"].marker]
    assert mark.get_color() == LOOKS["paper"].colour
    assert [text.get_text() for text in ax.get_yticklabels()] == [LOOKS["paper"].label]


def both_scores(means: dict[tuple[str, str], tuple[float, float]], corpus: str) -> list[dict[str, object]]:
    """Records of (hit rate, harmony above chance) for each (trick, music)."""
    return [
        {**record(*key, mean, measure), "corpus": corpus}
        for key, pair in means.items()
        for measure, mean in zip(SIDES, pair, strict=True)
    ]


def test_titles_count_the_tricks_above_the_dance_and_synthetic_panels_are_marked():
    means = {("as danced", TRUE): (0.6, 0.5), ("shake", TRUE): (0.9, 0.0), ("sway", TRUE): (0.7, 0.6)}
    means |= {(trick, LATE): (0.5, 0.0) for trick, _ in means}
    figure = tricks_figure([*both_scores(means, "beatlocked"), *both_scores(means, "synthetic")])
    findings = [ax.get_title(loc="left").split("\n")[1] for ax in figure.axes]
    assert findings == ["2 of 2 tricks score above the dance", "1 of 2 tricks score above the dance"] * 2
    assert figure.axes[0].get_xlabel().endswith("(7 clips)")
    assert [ax.get_title(loc="right").strip() for ax in figure.axes] == ["", "", "", "synthetic data"]
    assert smallest_text(figure) >= 9


def test_titles_name_whose_score_clearly_falls_with_late_music():
    means = {("paper", TRUE): (0.6, 0.1), ("recommended", TRUE): (0.8, 0.8)}
    means |= {("paper", LATE): (0.5, 0.0), ("recommended", LATE): (0.7, -0.4)}
    figure = listening_figure(both_scores(means, "made up"))
    findings = [ax.get_title(loc="left").split("\n")[1] for ax in figure.axes]
    name = LOOKS["recommended"].label
    assert findings == ["with late music it falls for nobody", f"with late music it falls for {name}"]
