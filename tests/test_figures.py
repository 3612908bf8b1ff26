"""What is on the axes: lines, marks, labels, limits; and that every picture of a score shows its own pairs."""

from collections.abc import Callable, Iterator
from dataclasses import replace
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

from harmolab import score_clip, synthetic_clip
from harmolab.beats.meter import CATEGORIES, MeterUnit
from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.lab.figures import beats
from harmolab.lab.figures.people import draw_poses
from harmolab.lab.figures.style import COLOURS, MARKERS
from harmolab.lab.labs.live import Stage
from harmolab.lab.labs.meter import UNIT_COLOURS, unit_label
from harmolab.lab.labs.one_clip import scoring_numbers
from harmolab.lab.person import ANGLE
from harmolab.lab.player_data import Dancer, Player
from harmolab.lab.render.stick import hit_times
from harmolab.params import CHOICES, HOW_PATTERNS, HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.types import Audio, BeatTrack, Motion
from harmolab.verdict.judge import music_and_motion, score_motion
from study.cells import notebook_cells
from study.saving import smallest_text
from tests.builders import ARM, cases, planted_dance, refused, track, waving
from tests.test_player import data_of
from tests.test_render import standing

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


def looks(ax: Axes) -> list[tuple[str, str]]:
    """Marker and colour of the beats that were met and of those that were not."""
    return [(line.get_marker(), line.get_markeredgecolor()) for line in (named(ax, "hit"), named(ax, "missed"))]


def stems(ax: Axes, colour: str) -> list[tuple[float, float, float]]:
    """(time, bottom, top) of every vertical line of a colour, in order."""
    lines = [one for one in ax.collections if isinstance(one, LineCollection)]
    own = [one for one in lines if to_hex(one.get_color()[0]) == colour.lower()]
    return [(float(a[0]), float(a[1]), float(b[1])) for one in own for a, b in one.get_segments()]


# beats


def test_curve_has_a_line_and_a_mark_at_each_beat_on_the_curve(ax: Axes):
    times = np.linspace(0.0, 2.0, 21)
    assert beats.draw_curve(ax, times, 10 * times, DANCE) is ax
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 10 * times)
    assert points(named(ax, "visual beat (4)")) == [(0.6, 6.0), (0.8, 8.0), (1.4, 14.0), (1.9, 19.0)]
    assert [time for time, *_ in stems(ax, COLOURS["visual"])] == [0.6, 0.8, 1.4, 1.9]
    assert (ax.get_xlabel(), ax.get_xlim()) == ("time (s)", (0.0, 2.0))


@pytest.mark.parametrize(("kind", "marker"), [("audio", "o"), ("visual", MARKERS["visual"])])
def test_curve_and_marks_have_the_colour_of_their_kind(ax: Axes, kind: str, marker: str):
    beats.draw_curve(ax, [0.0, 2.0], [1.0, 1.0], MUSIC, kind=kind)
    assert {line.get_color() for line in ax.lines} == {COLOURS[kind]}
    assert ax.lines[1].get_marker() == marker


def test_curve_below_zero_stays_in_the_picture(ax: Axes):
    beats.draw_curve(ax, [0.0, 1.0, 2.0], [-2.0, 0.0, 1.0])
    assert ax.get_ylim() == pytest.approx((-2.16, 1.08))


def test_music_points_up_and_the_dance_points_down(ax: Axes):
    beats.draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1)
    assert stems(ax, COLOURS["audio"]) == [(time, 0.0, 1.0) for time in (0.5, 1.0, 1.5)]
    assert stems(ax, COLOURS["visual"]) == [(time, 0.0, -1.0) for time in (0.6, 0.8, 1.4, 1.9)]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["dance", "music"]


def test_paired_beats_get_circles_missed_ones_crosses_and_spare_ones_grey_dots(ax: Axes):
    beats.draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1)
    assert points(named(ax, "hit")) == [(0.5, 1.0), (1.5, 1.0), (0.6, -1.0), (1.4, -1.0)]
    assert points(named(ax, "missed")) == [(1.0, 1.0)]
    assert points(named(ax, "visual beat left over")) == [(0.8, -1.0), (1.9, -1.0)]
    assert named(ax, "visual beat left over").get_color() == COLOURS["chance"]
    assert looks(ax) == [("o", COLOURS["hit"]), ("x", COLOURS["miss"])]


def test_stems_can_tell_the_strength(ax: Axes):
    beats.draw_stems(ax, MUSIC, kind="audio", heights=[1.0, 0.25, 0.5])
    beats.draw_stems(ax, DANCE, kind="visual", heights=[0.1, 0.2, 0.3, 0.4])
    assert [top for *_, top in stems(ax, COLOURS["audio"])] == [1.0, 0.25, 0.5]
    assert [top for *_, top in stems(ax, COLOURS["visual"])] == [-0.1, -0.2, -0.3, -0.4]


def test_score_is_drawn_in_rows_of_fifteen_seconds_below_its_verdict_in_words():
    clip = synthetic_clip("waltz", seconds=20, seed=1)
    scores = {"paper": score_clip(clip, HarmonyParams.paper()), "recommended": score_clip(clip)}
    for nothing in ({}, scores["paper"]):
        refused("scores by their modes are needed, such as", beats.score_figure, nothing)
    figure = beats.score_figure(scores, title="a waltz")
    assert [ax.get_xlim() for ax in figure.axes] == [(0.0, 15.0), (15.0, 30.0)] * 2
    words = f"paper: {scores['paper'].hits.sum()} of {scores['paper'].n_audio} music beats met"
    assert figure.axes[0].get_title(loc="left").startswith(words)
    judgement, title = scores["recommended"].judgement, figure.axes[2].get_title(loc="left")
    assert judgement.verdict in title and f", p in time = {judgement.p_time:.3f})" in title
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "time in the music (s)"] * 2
    for drawn, named in ((figure, "16"), (beats.score_figure(scores, begin=12.4), "28.4")):
        assert drawn.axes[1].xaxis.get_major_formatter()(16.0) == named
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert len(labels) == len(set(labels)) and {"hit", "missed"} <= set(labels)
    assert smallest_text(figure) >= 9


def test_tolerance_fields_lie_where_the_lag_expects_the_dance_and_no_delay_draws_none(ax: Axes):
    beats.draw_tolerance(ax, MUSIC.times, 0.0)
    assert len(ax.collections) == 0
    beats.draw_hits(ax, MUSIC, DANCE, PAIRS, delay=0.1, lag=0.05)
    (bands,) = [one for one in ax.collections if one.get_label() == "tolerance field"]
    edges = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in bands.get_paths()]
    np.testing.assert_allclose(edges, [(0.45, 0.65), (0.95, 1.15), (1.45, 1.65)])


def test_empty_tracks_draw_without_a_mark(ax: Axes):
    nothing = BeatTrack([], [], fps=15.0, duration=2.0)
    beats.draw_hits(ax, nothing, nothing, [], delay=0.25)
    beats.draw_curve(ax, [], [], nothing)
    assert all(len(line.get_xdata()) == 0 for line in ax.lines if line.get_label() in ("hit", "missed"))


def test_shares_rise_from_chance_and_stronger_beats_are_wider(ax: Axes):
    beats.draw_shares(ax, MUSIC, [0.9, 0.2, 0.5], chance=0.5)
    assert stems(ax, COLOURS["audio"]) == [(0.5, 0.5, 0.9), (1.0, 0.5, 0.2), (1.5, 0.5, 0.5)]
    assert ax.collections[0].get_linewidth() == pytest.approx([6.0, 2.25, 3.5])
    assert points(named(ax, "above the median moment")) == [(0.5, 0.9)]
    assert points(named(ax, "below it")) == [(1.0, 0.2), (1.5, 0.5)]


def test_title_of_tolerances_has_hits_and_chance_at_the_papers_delay(ax: Axes):
    rows = {"delay": [0.0, 0.1, 0.2], "hit_rate": [0.0, 0.6, 0.9], "chance": [0.0, 0.4, 0.8], "delay_of_paper": 0.1}
    notebook_cells("04_salience_and_scoring").draw_tolerances(ax, pd.DataFrame(rows), "turns")
    assert ax.get_title(loc="left") == "turns:\n60% met within 0.1 s, 40% by chance"


# meter

UNITS = (
    MeterUnit(0.5, 2.5, [True, False, True, False], "4/4"),
    MeterUnit(2.5, 4.5, [True, False, False, False], "4/4"),
    MeterUnit(4.5, 7.5, [True, False, False, True, False, False], "6/4"),
)


def test_every_category_of_eq_22_has_a_colour_of_its_own():
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
    assert (points(strong), points(weak)) == ([(2.0, 1.0)], [(1.0, 0.25), (3.0, 0.5)])
    assert (strong.get_markerfacecolor(), weak.get_markerfacecolor()) == (COLOURS["audio"], "white")
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


def test_there_is_a_figure_at_each_time_with_its_ghosts_beyond_the_motion_too(ax: Axes):
    assert draw_poses(ax, moving_arm(), [-1.0, 2.0, 99.0], 0.5) is ax
    assert [box.xy for box in boxes(ax, "pose")] == [(-1.0, 0.5), (2.0, 0.5), (99.0, 0.5)]
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
    sizes = [np.ptp(path.vertices, axis=0) for path in person.get_paths()]
    np.testing.assert_allclose(sizes, [sizes[0]] * 3, rtol=0.05)


def test_colour_of_a_figure_is_that_of_its_trunk_and_the_sides_keep_theirs(ax: Axes):
    draw_poses(ax, Motion(standing(TANG_23), 30.0, TANG_23), [0.0], 0.5, trail=(), colour=COLOURS["hit"])
    (person,) = people_of(boxes(ax, "pose")[0])
    colours = [to_hex(colour).upper() for colour in person.get_facecolors()]
    assert colours.count(COLOURS["hit"]) == 3  # trunk, neck, head
    assert len(set(colours)) > 2


def test_frames_stand_at_their_times_one_each_and_keep_their_pixels(ax: Axes):
    frame = np.full((24, 32, 3), 90, np.uint8)
    FILM.draw_frames(ax, [frame, frame], [0.5, 1.5], width=64.0)
    found = boxes(ax, "frame")
    assert [box.xy for box in found] == [(0.5, 0.5), (1.5, 0.5)]
    image = found[0].offsetbox
    assert isinstance(image, OffsetImage)
    assert (image.get_data().shape, image.get_zoom()) == ((24, 32, 3), 2.0)
    refused("zip", FILM.draw_frames, ax, [frame], [0.5, 1.5])  # a frame for each time


# Distances from the beats along time

VALLEYS = HarmonyParams.valleys()
SONG = track([1.0, 2.0, 3.0], duration=4.0)
SCORE = score_harmony(SONG, track([0.95, 2.08, 3.3], duration=4.0), params=VALLEYS, n_rotations=0)


def test_hits_and_misses_differ_in_shape_and_colour_and_lie_inside_the_picture(ax: Axes):
    beats.draw_timing(ax, SCORE)
    assert points(named(ax, "hit")) == [(1.0, -50.0), (2.0, 80.0)]
    assert points(named(ax, "missed")) == [(3.0, 300.0)]
    assert looks(ax) == [("o", COLOURS["hit"]), ("x", COLOURS["miss"])]
    assert ax.get_ylim()[1] == -ax.get_ylim()[0] > 300
    assert beats.FAR not in ax.get_legend_handles_labels()[1]
    later = replace(SCORE, params=replace(SCORE.params, lag=0.05))
    hits = named(beats.draw_timing(Figure().subplots(), later), "hit")
    assert points(hits) == [(1.0, -100.0), (2.0, 30.0)]  # less the expected lag


def test_beats_after_the_dancer_has_stopped_stand_at_the_edge_and_do_not_stretch_the_axis(ax: Axes):
    music, dancer = (track(times, duration=11.0) for times in (np.arange(1, 21) * 0.5, np.arange(1, 16) * 0.5 + 0.04))
    beats.draw_timing(ax, score_harmony(music, dancer, params=VALLEYS, n_rotations=0))
    far = named(ax, beats.FAR)
    assert [x for x, _ in points(far)] == [8.0, 8.5, 9.0, 9.5, 10.0]
    assert -ax.get_ylim()[1] < points(far)[0][1] == points(far)[-1][1] < 0
    assert ax.get_ylim()[1] < 300


@pytest.mark.parametrize(("detector", "event"), [("valleys", "rest"), ("peaks", "hit"), ("turns", "visual beat")])
def test_picture_names_its_events_and_calls_nobody_early(ax: Axes, detector: str, event: str):
    beats.draw_timing(ax, replace(SCORE, params=replace(SCORE.params, detector=detector)))
    assert ax.get_ylabel() == f"{event} before  |  after (ms)"


def test_events_of_a_dancer_who_hits_the_beats_are_hits_where_that_was_told():
    music = track(np.arange(1, 60) * 0.5, duration=30.0)
    motion = waving(np.arange(900) / 15 + 0.5)  # fastest every half second
    assert beats.event_name(score_motion(music, motion, params=HarmonyParams.recommended(HOW_PATTERNS["hit"]))) == "hit"
    assert beats.event_name(score_motion(music, motion)) == "rest"


def test_picture_without_visual_beats_shows_the_band_alone(ax: Axes):
    beats.draw_timing(ax, score_harmony(SONG, track([], duration=4.0), params=VALLEYS, n_rotations=0))
    assert marked(ax, "hit") == []
    assert ax.get_xlim() == (0.0, 4.0)


def test_means_are_lines_with_fields_and_an_endless_interval_has_none(ax: Axes):
    beats.draw_means(ax, [(0.0, 2.0, 0.02, (0.01, 0.03)), (2.0, 4.0, 0.08, (-np.inf, np.inf))])
    assert [list(line.get_ydata()) for line in ax.lines] == [[20.0, 20.0], [80.0, 80.0]]
    assert len(ax.collections) == 1


def test_legend_has_each_meaning_once_and_is_folded_in_a_narrow_figure():
    means = [(0.0, 2.0, 0.02, (0.01, 0.03)), (2.0, 4.0, 0.08, (0.07, 0.09))]
    figure = beats.timing_figure(SCORE, means=means, size=(4.4, 4.4))
    legend = figure.axes[0].get_legend()
    labels = sorted(text.get_text() for text in legend.get_texts())
    assert labels == ["hit", "lag and spread from bar to bar", "missed", "tolerance field"]
    assert (figure.get_size_inches().tolist(), legend._ncols) == ([4.4, 4.4], 2)


def test_offset_figure_names_the_place_that_was_found_and_marks_the_others():
    lags = np.linspace(-1.0, 1.0, 5)
    figure = beats.offset_figure(lags, np.cos(lags), best=0.36, others=(-0.14, 0.86))
    (ax,) = figure.axes
    assert [float(line.get_xdata()[0]) for line in ax.lines[1:]] == [0.36, -0.14, 0.86]
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["found: 0.36 s", "or some beats earlier or later"]
    assert ax.get_title(loc="left").startswith("The dance fits best when it begins 0.36 s into the song; 2 other")
    assert smallest_text(figure) >= 9


# A dance frame by frame

CELLS = notebook_cells("11_frame_by_frame")
# The arm swings once a second and rests at 0.25, 0.75, 1.25 ... s.
BEATS = BeatTrack([0.27, 0.5, 1.25, 1.8], [1.0, 1.0, 1.0, 1.0], fps=15.0, duration=2.0)


@pytest.fixture
def arm(swinging_arm: Callable[..., Motion]) -> Motion:
    """Two seconds of an arm that rests twice a second."""
    return swinging_arm(1.0, 15.0, seconds=2.0)


def from_start(motion: Motion, start: float) -> HarmonyScore:
    """The score of the beats from `start` on, found in the whole motion."""
    visual = visual_beats(motion, params=VALLEYS).span(start, motion.duration - start)
    return score_harmony(BEATS.span(start, 2.0 - start), visual, params=VALLEYS, n_rotations=0)


@cases("options, every", ({}, 4), ({"every": 10}, 10))  # four frames at 15 a second are the paper's interval
def test_sheet_has_a_pose_at_every_interval_and_a_bar_at_every_beat(ax: Axes, arm: Motion, options: dict, every: int):
    CELLS.draw_sheet(ax, arm, BEATS, **options)
    poses = [artist.xy[0] for artist in ax.artists if isinstance(artist, AnnotationBbox)]
    np.testing.assert_allclose(poses, np.arange(0, 30, every) / 15)
    bars = [(line.get_xdata()[0], line.get_color()) for line in ax.lines if line.get_gid() == "beat"]
    assert bars == [(time, COLOURS["audio"]) for time in BEATS.times]


def test_beats_in_reach_of_a_rest_are_met_and_others_missed(ax: Axes, arm: Motion):
    CELLS.draw_speed(ax, arm, score_motion(BEATS, arm, params=VALLEYS))
    assert (marked(ax, "hit"), marked(ax, "missed")) == ([0.27, 1.25, 1.8], [0.5])
    curve, found = ax.lines[0], named(ax, "visual beat")
    np.testing.assert_allclose(found.get_xdata(), [0.25, 0.75, 1.25, 1.75], atol=0.01)
    np.testing.assert_allclose(np.interp(found.get_xdata(), *curve.get_data()), found.get_ydata())


def test_dancers_are_shown_on_one_time_line_and_one_scale_of_speed(arm: Motion, swinging_arm: Callable[..., Motion]):
    motions = {"slow": arm, "fast": swinging_arm(2.0, 15.0, seconds=2.0)}
    scores = {name: from_start(motion, 0.6) for name, motion in motions.items()}
    figure = CELLS.dance_figure(motions, BEATS, scores, start=0.6, titles={"fast": "twice as fast"})
    sheets, speeds = figure.axes[::2], figure.axes[1::2]
    assert [ax.get_title(loc="left") for ax in sheets] == ["slow", "twice as fast"]
    assert len({ax.get_ylim() for ax in speeds}) == len({ax.get_xlim() for ax in figure.axes}) == 1
    assert [ax.patches[-1].get_bbox().x1 for ax in figure.axes] == pytest.approx([0.6] * 4)  # given up to there
    for ax, score in zip(speeds, scores.values(), strict=True):
        assert marked(ax, "hit") == pytest.approx(np.add(music_hits(score), 0.6).tolist())
        assert named(ax, "visual beat").get_xdata().min() >= 0.6
    assert speeds[0].get_ylim()[1] == pytest.approx(1.5 * max(speeds[1].lines[0].get_ydata()))
    assert figure.axes[-1].get_xlabel() == "time (s)"


# Every picture and page of a score shows its own pairs, whatever the settings

MODES = {"paper": HarmonyParams.paper(), "valleys": VALLEYS, "recommended": HarmonyParams.recommended()}
FEW, ALL = 12, 60  # sets of settings in a quick run and in a whole one


def settings(rng: np.random.Generator) -> tuple[str, dict[str, object]]:
    """A mode, and what the lab's controls may change about it."""
    return str(rng.choice(list(MODES))), {
        "lag": round(float(rng.uniform(-0.3, 0.3)), 3),
        "matching": str(rng.choice(CHOICES["matching"])),
        "reaction_delay": round(float(rng.uniform(0.03, 0.3)), 3),
        "detector": str(rng.choice(CHOICES["detector"])),
    }


Drawn = list[tuple[str, dict[str, object], HarmonyScore]]


@pytest.fixture(scope="module")
def late_dance() -> tuple[BeatTrack, Motion]:
    """A dancer who begins a fifth of a second late, so that hits depend on lag and delay."""
    clip = planted_dance("cha-cha", seconds=7.0, fps=30.0, seed=4)
    return music_and_motion(replace(clip, offset=clip.offset + 0.2, motion=clip.motion.span(0.0, 6.0)))


@pytest.fixture(scope="module", params=[FEW, pytest.param(ALL, marks=pytest.mark.slow)])
def drawn_scores(request: pytest.FixtureRequest, late_dance: tuple[BeatTrack, Motion]) -> Drawn:
    """Random settings, and the score by each."""
    rng = np.random.default_rng(11)
    chosen = [settings(rng) for _ in range(request.param)]
    drawn = [(mode, values, replace(MODES[mode], **values)) for mode, values in chosen]
    return [(*one, score_motion(*late_dance, params=params, n_rotations=0)) for *one, params in drawn]


def marked(ax: Axes, label: str) -> list[float]:
    """Places along time of the marks with a label, in order."""
    return sorted(float(x) for line in ax.lines if line.get_label() == label for x in line.get_xdata())


def music_hits(score: HarmonyScore) -> list[float]:
    return score.music.times[score.pairs >= 0].tolist()


def in_score_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    ax = beats.score_figure({"one": score}).axes[0]
    visual = score.visual.times[np.unique(score.pairs[score.pairs >= 0])]
    return sorted(marked(ax, "hit") + marked(ax, "above the median moment")), sorted([*music_hits(score), *visual])


def in_dance_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    return marked(CELLS.draw_speed(Figure().subplots(), motion, score), "hit"), music_hits(score)


def in_timing_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    return marked(beats.draw_timing(Figure().subplots(), score), "hit"), music_hits(score)


def in_marks_of_videos(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    hits = score.pairs >= 0
    later = np.maximum(score.music.times[hits], score.visual.times[score.pairs[hits]])
    return hit_times(score).tolist(), sorted(later.tolist())


@pytest.mark.parametrize("drawn", [in_score_figure, in_dance_figure, in_timing_figure, in_marks_of_videos])
def test_hits_shown_are_the_pairs_of_the_score(drawn: Callable[..., tuple], drawn_scores: Drawn, late_dance: tuple):
    results = [(mode, values, *drawn(score, late_dance[1])) for mode, values, score in drawn_scores]
    assert [row for row in results if row[2] != pytest.approx(row[3])] == []
    assert sum(bool(expected) for *_, expected in results) > len(drawn_scores) / 2  # there was something to show


def in_scoring_lab(mode: str, values: dict[str, object], score: HarmonyScore, dance: tuple) -> tuple[list, list]:
    lab = {"delay" if name == "reaction_delay" else name: value for name, value in values.items()}
    name = "shares" if mode == "recommended" else "pairs"
    shown = list(scoring_numbers(Stage(*dance), mode=mode, **lab)[name])
    return shown, getattr(score, name).tolist() if shown else []


def in_player(mode: str, values: dict[str, object], score: HarmonyScore, dance: tuple) -> tuple[list, list]:
    page = Player(Audio(np.zeros(8000), 8000.0), [Dancer("one", dance[1], score)], music=dance[0], title="").page
    met = [mark["met"] for mark in data_of(page)["dancers"][0]["marks"]]
    return met, [round(float(score.visual.times[pair]), 4) if pair >= 0 else None for pair in score.pairs]


@pytest.mark.parametrize("page", [in_scoring_lab, in_player])
def test_pages_hold_the_pairs_of_the_score(page: Callable[..., tuple], drawn_scores: Drawn, late_dance: tuple):
    results = [(mode, values, *page(mode, values, score, late_dance)) for mode, values, score in drawn_scores]
    assert [row for row in results if row[2] != row[3]] == []
