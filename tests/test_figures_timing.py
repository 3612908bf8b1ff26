"""Distances from the beats along time: offsets, their marks, and the lags of the halves."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from harmolab.lab.figures.beats import draw_means, draw_timing, event_name, offset_figure, signed_offsets, timing_figure
from harmolab.lab.figures.style import COLOURS
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.score import score_harmony
from harmolab.types import BeatTrack
from harmolab.verdict.judge import score_motion
from study.saving import smallest_text
from tests.builders import track, waving

MUSIC = BeatTrack([1.0, 2.0, 3.0], [1.0, 1.0, 1.0], fps=100.0, duration=4.0)
DANCE = BeatTrack([0.95, 2.08, 3.3], [1.0, 1.0, 1.0], fps=100.0, duration=4.0)
SCORE = score_harmony(MUSIC, DANCE, params=HarmonyParams.valleys(), n_rotations=0)
NOBODY = BeatTrack([], [], fps=100.0, duration=4.0)


@pytest.fixture
def ax() -> Iterator[Axes]:
    yield Figure(figsize=(8, 4)).subplots()


def marks(ax: Axes) -> dict[str, tuple[list[float], list[float], str, str]]:
    """label -> (x, y, marker, colour)"""
    return {
        str(line.get_label()): (
            np.round(line.get_xdata(), 6).tolist(),
            np.round(line.get_ydata(), 6).tolist(),
            line.get_marker(),
            to_hex(line.get_markeredgecolor()).upper(),
        )
        for line in ax.lines
    }


def test_offsets_are_early_below_zero_and_late_above():
    np.testing.assert_allclose(signed_offsets(MUSIC.times, DANCE.times), [-0.05, 0.08, 0.3])
    assert np.isnan(signed_offsets(MUSIC.times, NOBODY.times)).all()


def test_hits_and_misses_differ_in_shape_and_colour(ax: Axes):
    found = marks(draw_timing(ax, SCORE))
    assert found["hit"] == ([1.0, 2.0], [-50.0, 80.0], "o", COLOURS["hit"])
    assert found["missed"] == ([3.0], [300.0], "x", COLOURS["miss"])


def test_all_offsets_lie_inside_the_picture(ax: Axes):
    low, high = draw_timing(ax, SCORE).get_ylim()
    assert low == -high
    assert high > 300


@pytest.mark.parametrize(("detector", "event"), [("valleys", "rest"), ("peaks", "hit"), ("turns", "visual beat")])
def test_picture_names_its_events_and_calls_nobody_early(ax: Axes, detector: str, event: str):
    draw_timing(ax, replace(SCORE, params=replace(SCORE.params, detector=detector)))
    assert ax.get_ylabel() == f"{event} before  |  after (ms)"


def test_events_of_a_dancer_who_hits_the_beats_are_hits_where_that_was_told():
    beats = track(np.arange(1, 60) * 0.5, duration=30.0)
    motion = waving(np.arange(900) / 15 + 0.5)  # fastest every half second
    assert event_name(score_motion(beats, motion, params=HarmonyParams.recommended(HOW_PATTERNS["hit"]))) == "hit"
    assert event_name(score_motion(beats, motion)) == "rest"


def test_picture_without_visual_beats_shows_the_band_alone(ax: Axes):
    found = marks(draw_timing(ax, score_harmony(MUSIC, NOBODY, params=HarmonyParams.valleys(), n_rotations=0)))
    assert found.get("hit", ([],))[0] == []
    assert ax.get_xlim() == (0.0, 4.0)


def test_means_are_lines_with_fields_and_an_endless_interval_has_none(ax: Axes):
    draw_means(ax, [(0.0, 2.0, 0.02, (0.01, 0.03)), (2.0, 4.0, 0.08, (-np.inf, np.inf))])
    assert [list(line.get_ydata()) for line in ax.lines] == [[20.0, 20.0], [80.0, 80.0]]
    assert len(ax.collections) == 1


def test_figure_has_a_legend_with_each_meaning_once():
    figure = timing_figure(SCORE, means=[(0.0, 2.0, 0.02, (0.01, 0.03)), (2.0, 4.0, 0.08, (0.07, 0.09))])
    legend = figure.axes[0].get_legend()
    labels = [text.get_text() for text in legend.get_texts()]
    assert sorted(labels) == ["hit", "lag and spread from bar to bar", "missed", "tolerance field"]


def test_narrow_figure_keeps_its_size_and_folds_its_legend():
    figure = timing_figure(SCORE, size=(4.4, 4.4))
    assert figure.get_size_inches().tolist() == [4.4, 4.4]
    assert figure.axes[0].get_legend()._ncols == 2


def test_offset_figure_names_the_place_that_was_found_and_marks_the_others():
    lags = np.linspace(-1.0, 1.0, 5)
    figure = offset_figure(lags, np.cos(lags), best=0.36, others=(-0.14, 0.86))
    (ax,) = figure.axes
    assert [float(line.get_xdata()[0]) for line in ax.lines[1:]] == [0.36, -0.14, 0.86]
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["found: 0.36 s", "or some beats earlier or later"]
    assert ax.get_title(loc="left").startswith("The dance fits best when it begins 0.36 s into the song; 2 other")
    assert smallest_text(figure) >= 9
