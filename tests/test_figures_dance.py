"""A dance frame by frame: poses at even intervals, bars at the music's beats, and which of them were met."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox

from harmolab import synthetic_clip
from harmolab.beats.visual import visual_beats
from harmolab.lab.figures.style import COLOURS
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import music_and_motion, score_motion
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("11_frame_by_frame")
VALLEYS = HarmonyParams.valleys()
# The arm swings once a second and rests at 0.25, 0.75, 1.25 ... s.
BEATS = BeatTrack([0.27, 0.5, 1.25, 1.8], [1.0, 1.0, 1.0, 1.0], fps=15.0, duration=2.0)


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


@pytest.fixture
def arm(swinging_arm: Callable[..., Motion]) -> Motion:
    """Two seconds of an arm that rests twice a second."""
    return swinging_arm(1.0, 15.0, seconds=2.0)


def from_start(motion: Motion, start: float) -> HarmonyScore:
    """The score of the beats from `start` on, found in the whole motion."""
    visual = visual_beats(motion, params=VALLEYS).span(start, motion.duration - start)
    return score_harmony(BEATS.span(start, 2.0 - start), visual, params=VALLEYS, n_rotations=0)


def posed_at(ax: Axes) -> list[float]:
    """Times of the people on axes."""
    return [artist.xy[0] for artist in ax.artists if isinstance(artist, AnnotationBbox)]


def named(ax: Axes, label: str) -> Line2D:
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return line


def test_four_frames_at_15_a_second_are_the_papers_interval(ax: Axes, arm: Motion):
    CELLS.draw_sheet(ax, arm, BEATS)
    np.testing.assert_allclose(posed_at(ax), np.arange(0, 30, 4) / 15)


def test_sheet_has_a_pose_at_every_interval_and_a_bar_at_every_beat(ax: Axes, arm: Motion):
    CELLS.draw_sheet(ax, arm, BEATS, every=10)
    np.testing.assert_allclose(posed_at(ax), [0.0, 10 / 15, 20 / 15])
    bars = [line for line in ax.lines if line.get_gid() == "beat"]
    assert [line.get_xdata()[0] for line in bars] == list(BEATS.times)
    assert {line.get_color() for line in bars} == {COLOURS["audio"]}


def test_beats_in_reach_of_a_rest_are_met_and_others_missed(ax: Axes, arm: Motion):
    CELLS.draw_speed(ax, arm, score_motion(BEATS, arm, params=VALLEYS))
    assert list(named(ax, "hit").get_xdata()) == [0.27, 1.25, 1.8]
    assert list(named(ax, "missed").get_xdata()) == [0.5]
    np.testing.assert_allclose(named(ax, "visual beat").get_xdata(), [0.25, 0.75, 1.25, 1.75], atol=0.01)


def test_beats_before_the_start_are_not_judged(ax: Axes, arm: Motion):
    CELLS.draw_speed(ax, arm, from_start(arm, 1.0), start=1.0)
    assert list(named(ax, "hit").get_xdata()) == [1.25, 1.8]
    assert list(named(ax, "missed").get_xdata()) == []
    np.testing.assert_allclose(named(ax, "visual beat").get_xdata(), [1.25, 1.75], atol=0.01)


def test_marks_of_visual_beats_lie_on_the_curve_of_the_speed(ax: Axes, arm: Motion):
    CELLS.draw_speed(ax, arm, score_motion(BEATS, arm, params=VALLEYS))
    curve, found = ax.lines[0], named(ax, "visual beat")
    np.testing.assert_allclose(np.interp(found.get_xdata(), curve.get_xdata(), curve.get_ydata()), found.get_ydata())


def test_dancers_are_shown_on_one_time_line_and_one_scale_of_speed(arm: Motion, swinging_arm: Callable[..., Motion]):
    motions = {"slow": arm, "fast": swinging_arm(2.0, 15.0, seconds=2.0)}
    scores = {name: from_start(motion, 0.6) for name, motion in motions.items()}
    figure = CELLS.dance_figure(motions, BEATS, scores, start=0.6, titles={"fast": "twice as fast"})
    sheets, speeds = figure.axes[::2], figure.axes[1::2]
    assert [ax.get_title(loc="left") for ax in sheets] == ["slow", "twice as fast"]
    assert len({ax.get_ylim() for ax in speeds}) == 1
    assert len({ax.get_xlim() for ax in figure.axes}) == 1
    assert speeds[0].get_ylim()[1] == pytest.approx(1.5 * max(speeds[1].lines[0].get_ydata()))
    assert figure.axes[-1].get_xlabel() == "time (s)"


def test_what_was_given_is_shaded_up_to_the_start(arm: Motion):
    figure = CELLS.dance_figure({"arm": arm}, BEATS, {"arm": from_start(arm, 0.6)}, start=0.6, titles={})
    assert [ax.patches[-1].get_bbox().x1 for ax in figure.axes] == [pytest.approx(0.6)] * 2


def test_a_dancer_who_is_late_by_the_expected_lag_is_drawn_with_the_hits_of_the_score(ax: Axes):
    clip = synthetic_clip("waltz", seconds=12.0, seed=1)
    music, motion = music_and_motion(replace(clip, offset=clip.offset + 0.3, motion=clip.motion.span(0.0, 8.0)))
    score = score_motion(music, motion, params=replace(VALLEYS, lag=0.3), n_rotations=0)
    assert score.hits.sum() >= 0.8 * score.n_audio
    CELLS.draw_speed(ax, motion, score)
    np.testing.assert_array_equal(named(ax, "hit").get_xdata(), score.music.times[score.pairs >= 0])
    assert len(named(ax, "missed").get_xdata()) == (score.pairs < 0).sum()
