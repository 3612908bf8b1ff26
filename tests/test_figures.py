"""What is on the axes: lines, marks, labels, limits. Answers are planted; pixels are not looked at."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox, DrawingArea, OffsetImage

from harmolab import HarmonyParams, score_clip, synthetic_clip
from harmolab.beats.meter import MeterUnit
from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.lab.figures.beats import (
    draw_curve,
    draw_hits,
    draw_marks,
    draw_shares,
    draw_stems,
    draw_tolerance,
    score_figure,
)
from harmolab.lab.figures.people import draw_poses
from harmolab.lab.figures.style import COLOURS, MARKERS
from harmolab.lab.labs.meter import UNIT_COLOURS, unit_label
from harmolab.lab.person import ANGLE
from harmolab.types import BeatTrack, Motion
from study.saving import smallest_text
from tests.builders import refused
from tests.notebook_cells import notebook_cells
from tests.test_person import standing

MUSIC = BeatTrack([0.5, 1.0, 1.5], [4.0, 1.0, 2.0], fps=100.0, duration=2.0)
DANCE = BeatTrack([0.6, 0.8, 1.4, 1.9], [1.0, 1.0, 1.0, 1.0], fps=15.0, duration=2.0)
METER, FILM = notebook_cells("06_meter_units"), notebook_cells("02_flow_or_skeleton")
PAIRS = np.array([0, -1, 2])  # 0.5 with 0.6, 1.0 alone, 1.5 with 1.4


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def named(ax: Axes, label: str) -> Line2D:
    """The one line of that label."""
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return line


def points(line: Line2D) -> list[tuple[float, float]]:
    """Its points, rounded."""
    return [(round(float(x), 6), round(float(y), 6)) for x, y in line.get_xydata()]


def stems(ax: Axes, colour: str) -> list[tuple[float, float, float]]:
    """(time, bottom, top) of every vertical line of a colour, in order."""
    found = []
    for lines in ax.collections:
        if isinstance(lines, LineCollection) and to_hex(lines.get_color()[0]) == colour.lower():
            found += [(float(a[0]), float(a[1]), float(b[1])) for a, b in lines.get_segments()]
    return found


# beats


def test_curve_has_a_line_and_a_mark_at_each_beat_on_the_curve(ax: Axes):
    times = np.linspace(0.0, 2.0, 21)
    assert draw_curve(ax, times, 10 * times, DANCE) is ax
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 10 * times)
    assert points(named(ax, "visual beat (4)")) == [(0.6, 6.0), (0.8, 8.0), (1.4, 14.0), (1.9, 19.0)]
    assert [time for time, *_ in stems(ax, COLOURS["visual"])] == [0.6, 0.8, 1.4, 1.9]
    assert ax.get_xlabel() == "time (s)"
    assert ax.get_xlim() == (0.0, 2.0)


@pytest.mark.parametrize(("kind", "marker"), [("audio", "o"), ("visual", MARKERS["visual"])])
def test_curve_and_marks_have_the_colour_of_their_kind(ax: Axes, kind: str, marker: str):
    draw_curve(ax, [0.0, 2.0], [1.0, 1.0], MUSIC, kind=kind)
    assert {line.get_color() for line in ax.lines} == {COLOURS[kind]}
    assert ax.lines[1].get_marker() == marker


def test_curve_below_zero_stays_in_the_picture(ax: Axes):
    draw_curve(ax, [0.0, 1.0, 2.0], [-2.0, 0.0, 1.0])
    assert ax.get_ylim() == pytest.approx((-2.16, 1.08))


def test_music_points_up_and_the_dance_points_down(ax: Axes):
    draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1)
    assert stems(ax, COLOURS["audio"]) == [(0.5, 0.0, 1.0), (1.0, 0.0, 1.0), (1.5, 0.0, 1.0)]
    assert stems(ax, COLOURS["visual"]) == [(time, 0.0, -1.0) for time in (0.6, 0.8, 1.4, 1.9)]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["dance", "music"]


def test_paired_beats_get_circles_missed_ones_crosses_and_spare_ones_grey_dots(ax: Axes):
    draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1)
    assert points(named(ax, "hit")) == [(0.5, 1.0), (1.5, 1.0), (0.6, -1.0), (1.4, -1.0)]
    assert points(named(ax, "missed")) == [(1.0, 1.0)]
    assert points(named(ax, "visual beat left over")) == [(0.8, -1.0), (1.9, -1.0)]
    assert named(ax, "visual beat left over").get_color() == COLOURS["chance"]
    assert named(ax, "hit").get_marker() == "o"
    assert named(ax, "missed").get_marker() == "x"
    assert named(ax, "hit").get_markeredgecolor() == COLOURS["hit"]
    assert named(ax, "missed").get_markeredgecolor() == COLOURS["miss"]


def test_stems_can_tell_the_strength(ax: Axes):
    draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1, audio_heights=[1.0, 0.25, 0.5], visual_heights=[0.1, 0.2, 0.3, 0.4])
    assert [top for *_, top in stems(ax, COLOURS["audio"])] == [1.0, 0.25, 0.5]
    assert [top for *_, top in stems(ax, COLOURS["visual"])] == [-0.1, -0.2, -0.3, -0.4]
    assert points(named(ax, "hit"))[0] == (0.5, 1.0)
    assert points(named(ax, "missed"))[0] == (1.0, 0.25)


def test_score_is_drawn_in_rows_of_fifteen_seconds_below_its_verdict_in_words():
    clip = synthetic_clip("waltz", seconds=20, seed=1)
    scores = {"paper": score_clip(clip, HarmonyParams.paper()), "recommended": score_clip(clip)}
    figure = score_figure(scores, title="a waltz")
    assert [ax.get_xlim() for ax in figure.axes] == [(0.0, 15.0), (15.0, 30.0)] * 2
    hits = int(scores["paper"].hits.sum())
    assert (
        figure.axes[0].get_title(loc="left").startswith(f"paper: {hits} of {scores['paper'].n_audio} music beats met")
    )
    assert scores["recommended"].judgement.verdict in figure.axes[2].get_title(loc="left")
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "time in the music (s)"] * 2
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert len(labels) == len(set(labels)) and {"hit", "missed"} <= set(labels)
    assert smallest_text(figure) >= 9


def fields(ax: Axes) -> list[tuple[float, float]]:
    """(left, right) of each tolerance field."""
    (bands,) = [c for c in ax.collections if c.get_label() == "tolerance field"]
    assert isinstance(bands, PolyCollection)
    return [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in bands.get_paths()]


def test_tolerance_field_reaches_the_delay_to_either_side_of_each_music_beat(ax: Axes):
    draw_tolerance(ax, MUSIC.times, 0.2)
    np.testing.assert_allclose(fields(ax), [(0.3, 0.7), (0.8, 1.2), (1.3, 1.7)])


def test_tolerance_fields_lie_where_the_lag_expects_the_dance(ax: Axes):
    draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1, lag=0.05)
    np.testing.assert_allclose(fields(ax), [(0.45, 0.65), (0.95, 1.15), (1.45, 1.65)])


def test_no_delay_draws_no_field(ax: Axes):
    draw_tolerance(ax, MUSIC.times, 0.0)
    assert len(ax.collections) == 0


def test_empty_tracks_draw_without_a_mark(ax: Axes):
    nothing = BeatTrack([], [], fps=15.0, duration=2.0)
    draw_hits(ax, nothing, nothing, [], delay=0.25)
    draw_curve(ax, [], [], nothing)
    assert all(len(line.get_xdata()) == 0 for line in ax.lines if line.get_label() in ("hit", "missed"))


def test_beats_that_nobody_notices_are_grey_and_dotted(ax: Axes):
    draw_stems(ax, MUSIC, kind="audio", ignored=True)
    (lines,) = ax.collections
    assert to_hex(lines.get_color()[0]) == COLOURS["chance"].lower()
    assert lines.get_linestyle()[0][1] is not None
    assert lines.get_label() == "music beat, not noticed"


def test_marks_can_have_other_names(ax: Axes):
    draw_marks(ax, [1.0, 2.0], [0.5, 0.6], [True, False], labels=("kept", "new"))
    assert points(named(ax, "kept")) == [(1.0, 0.5)]
    assert points(named(ax, "new")) == [(2.0, 0.6)]


def test_shares_rise_from_chance_and_stronger_beats_are_wider(ax: Axes):
    draw_shares(ax, MUSIC, [0.9, 0.2, 0.5], chance=0.5)
    assert stems(ax, COLOURS["audio"]) == [(0.5, 0.5, 0.9), (1.0, 0.5, 0.2), (1.5, 0.5, 0.5)]
    assert ax.collections[0].get_linewidth() == pytest.approx([6.0, 2.25, 3.5])
    assert points(named(ax, "above the median moment")) == [(0.5, 0.9)]
    assert points(named(ax, "below it")) == [(1.0, 0.2), (1.5, 0.5)]


def test_tolerances_fill_what_lies_between_hit_rate_and_chance(ax: Axes):
    rows = {"delay": [0.0, 0.1, 0.2], "hit_rate": [0.0, 0.6, 0.9], "chance": [0.0, 0.4, 0.8], "delay_of_paper": 0.1}
    notebook_cells("04_salience_and_scoring").draw_tolerances(ax, pd.DataFrame(rows), "turns")
    np.testing.assert_allclose(named(ax, "hit rate").get_ydata(), [0.0, 0.6, 0.9])
    np.testing.assert_allclose(named(ax, "chance").get_ydata(), [0.0, 0.4, 0.8])
    np.testing.assert_allclose(named(ax, "paper: 0.1 s").get_xdata(), 0.1)
    assert ax.get_title(loc="left") == "turns:\n60% met within 0.1 s, 40% by chance"
    corners = {(round(x, 6), round(y, 6)) for x, y in ax.collections[0].get_paths()[0].vertices}
    assert {(0.1, 0.4), (0.1, 0.6), (0.2, 0.8), (0.2, 0.9)} <= corners


# meter

UNITS = (
    MeterUnit(0.5, 2.5, [True, False, True, False], "4/4"),
    MeterUnit(2.5, 4.5, [True, False, False, False], "4/4"),
    MeterUnit(4.5, 7.5, [True, False, False, True, False, False], "6/4"),
)


def test_units_are_labelled_with_their_inner_accent():
    assert [unit_label(unit) for unit in UNITS] == ["4/4 (2+2)", "4/4", "6/4"]


def test_every_category_of_eq_22_has_a_colour_of_its_own():
    from harmolab.beats.meter import CATEGORIES, MeterUnit

    labels = {unit_label(MeterUnit(0.0, 1.0, list(pattern), name)) for pattern, name in CATEGORIES.items()}
    assert set(UNIT_COLOURS) == labels
    assert len(set(UNIT_COLOURS.values())) == len(labels)


def test_brackets_stand_over_their_units_and_do_not_touch(ax: Axes):
    track = BeatTrack(np.arange(1, 17) * 0.5, np.ones(16), fps=43.0, duration=9.0)
    METER.draw_meter(ax, track, np.zeros(16, bool), UNITS)
    brackets = [line for line in ax.lines if line.get_gid() == "bracket"]
    spans = [(line.get_xdata()[0], line.get_xdata()[-1]) for line in brackets]
    assert [line.get_color() for line in brackets] == [UNIT_COLOURS[unit_label(unit)] for unit in UNITS]
    np.testing.assert_allclose(spans, [(0.5, 2.5), (2.5, 4.5), (4.5, 7.5)], atol=0.13)
    assert all(left[1] < right[0] for left, right in pairwise(spans))
    assert [text.get_text() for text in ax.texts] == ["4/4 (2+2)", "4/4", "6/4"]


def test_strong_and_weak_beats_differ_in_more_than_height(ax: Axes):
    track = BeatTrack([1.0, 2.0, 3.0], [1.0, 4.0, 2.0], fps=43.0, duration=4.0)
    METER.draw_meter(ax, track, np.array([False, True, False]), (), downbeats=[1.0, 3.0])
    strong, weak = named(ax, "strong beat"), named(ax, "weak beat")
    assert points(strong) == [(2.0, 1.0)]
    assert points(weak) == [(1.0, 0.25), (3.0, 0.5)]
    assert strong.get_markerfacecolor() == COLOURS["audio"]
    assert weak.get_markerfacecolor() == "white"
    assert [time for time, _ in points(named(ax, "annotated downbeat"))] == [1.0, 3.0]


def places_of_bar(strong: list[float], counts: list[int]) -> pd.DataFrame:
    """Rows of one meter, 0.4 of whose beats are strong."""
    return pd.DataFrame({"place": np.arange(len(strong)) + 1, "strong": strong, "n": counts, "chance": 0.4})


def test_places_show_each_share_its_interval_and_chance(ax: Axes):
    METER.draw_places(ax, places_of_bar([0.5, 0.2, 1.0], [100, 400, 9]))
    assert [bar.get_height() for bar in ax.patches] == [0.5, 0.2, 1.0]
    (spread,) = [c for c in ax.collections if isinstance(c, LineCollection)]
    half = [(end[1] - start[1]) / 2 for start, end in spread.get_segments()]
    # 1.96 sqrt(p (1 - p) / n)
    np.testing.assert_allclose(half, [0.098, 0.0392, 0.0], atol=1e-9)
    assert named(ax, "chance 0.40").get_ydata()[0] == 0.4
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["1\n(downbeat)", "2", "3"]
    assert ax.get_title(loc="left").endswith("strong more often than other beats")
    METER.draw_places(ax, places_of_bar([0.45, 0.2], [100, 400]))
    assert ax.get_title(loc="left").endswith("strong no more often than other beats")
    assert METER.downbeat_words(places_of_bar([0.25, 0.5], [100, 100])) == "strong less often than other beats"


# motion

ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))


def moving_arm(dimensions: int = 3) -> Motion:
    """An arm that hangs (y = 0, -1, -2) and moves a metre to the right in every one of ten seconds, at 10 fps."""
    positions = np.zeros((100, 3, dimensions))
    positions[:, :, 0] = np.arange(100)[:, None] / 10
    positions[:, :, 1] = [0.0, -1.0, -2.0] if dimensions == 3 else [0.0, 1.0, 2.0]
    return Motion(positions, 10.0, ARM)


def boxes(ax: Axes, gid: str) -> list[AnnotationBbox]:
    return [artist for artist in ax.artists if isinstance(artist, AnnotationBbox) and artist.get_gid() == gid]


def people_of(box: AnnotationBbox) -> list[PolyCollection]:
    assert isinstance(box.offsetbox, DrawingArea)
    return [child for child in box.offsetbox.get_children() if isinstance(child, PolyCollection)]


def corners_of(person: PolyCollection) -> np.ndarray:
    """(corners, 2) of all parts."""
    return np.concatenate([path.vertices for path in person.get_paths()])


def test_there_is_a_figure_at_each_time_with_its_ghosts(ax: Axes):
    assert draw_poses(ax, moving_arm(), [1.0, 2.0, 3.0], 0.5) is ax
    assert [box.xy for box in boxes(ax, "pose")] == [(1.0, 0.5), (2.0, 0.5), (3.0, 0.5)]
    assert [len(people_of(box)) for box in boxes(ax, "pose")] == [3, 3, 3]


@pytest.mark.parametrize("axes", [2, 3])
def test_figure_is_as_high_as_its_bones_and_flesh_and_stands_in_the_middle(ax: Axes, axes: int):
    draw_poses(ax, moving_arm(axes), [1.0], 0.5, height=60.0, trail=())
    (person,) = people_of(boxes(ax, "pose")[0])
    heights = corners_of(person)[:, 1]
    assert 60.0 <= np.ptp(heights) < 66.0
    assert (heights.max() + heights.min()) / 2 == pytest.approx(30.0, abs=1.0)


def test_ghosts_of_a_moving_body_trail_behind_and_older_ones_more(ax: Axes):
    draw_poses(ax, moving_arm(), [5.0], 0.5, height=60.0, trail=(0.4, 0.2))
    old, young, now = (corners_of(person)[:, 0].mean() for person in people_of(boxes(ax, "pose")[0]))
    # 60 points are two metres, and the arm moves a metre a second, seen a little from the side.
    assert now - young == pytest.approx(0.2 * 30 * np.cos(ANGLE), rel=0.05)
    assert now - old == pytest.approx(0.4 * 30 * np.cos(ANGLE), rel=0.05)


def test_turning_the_camera_to_the_side_hides_movement_to_the_side(ax: Axes):
    draw_poses(ax, moving_arm(), [5.0], 0.5, trail=(0.4,), turn=90.0 - np.degrees(ANGLE))
    ghost, now = (corners_of(person)[:, 0].mean() for person in people_of(boxes(ax, "pose")[0]))
    assert now - ghost == pytest.approx(0.0, abs=0.2)


def test_skeleton_without_bones_is_drawn_as_dots(ax: Axes):
    draw_poses(ax, Motion(moving_arm().positions, 10.0, Skeleton.unnamed(3)), [1.0], 0.5, trail=())
    (person,) = people_of(boxes(ax, "pose")[0])
    dots = [path.vertices for path in person.get_paths()]
    assert len(dots) == 3
    assert all(np.ptp(dot, axis=0) == pytest.approx(np.ptp(dots[0], axis=0), rel=0.05) for dot in dots)


def test_colour_of_a_figure_is_that_of_its_trunk_and_the_sides_keep_theirs(ax: Axes):
    draw_poses(ax, Motion(standing(TANG_23), 30.0, TANG_23), [0.0], 0.5, trail=(), colour=COLOURS["hit"])
    (person,) = people_of(boxes(ax, "pose")[0])
    colours = [to_hex(colour).upper() for colour in person.get_facecolors()]
    assert colours.count(COLOURS["hit"]) == 3  # trunk, neck, head
    assert len(set(colours)) > 2


def test_times_beyond_the_motion_show_its_first_or_last_pose(ax: Axes, swinging_arm: Callable[..., Motion]):
    draw_poses(ax, swinging_arm(1.0, 25.0, seconds=2.0), [-1.0, 99.0], 0.0, trail=())
    assert len(boxes(ax, "pose")) == 2


def test_frames_stand_at_their_times_and_keep_their_pixels(ax: Axes):
    frame = np.full((24, 32, 3), 90, np.uint8)
    FILM.draw_frames(ax, [frame, frame], [0.5, 1.5], width=64.0)
    found = boxes(ax, "frame")
    assert [box.xy for box in found] == [(0.5, 0.5), (1.5, 0.5)]
    image = found[0].offsetbox
    assert isinstance(image, OffsetImage)
    assert image.get_data().shape == (24, 32, 3)
    assert image.get_zoom() == 2.0


def test_number_of_frames_must_be_the_number_of_times(ax: Axes):
    refused("zip", FILM.draw_frames, ax, [np.zeros((24, 32, 3), np.uint8)], [0.5, 1.5])
