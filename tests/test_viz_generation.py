"""Figures of notebooks 07 and 08: what is on the axes. Answers are planted; pixels are not looked at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox
from matplotlib.patches import FancyArrowPatch, Rectangle

from harmolab.params import TrainParams
from harmolab.types import Motion, Skeleton
from harmolab.viz.anatomy import draw_network, networks_figure, nodes_of
from harmolab.viz.boxes import TINTS, count_text, draw_box, inch_axes, shape_text
from harmolab.viz.framework import DANCING, LOSSES, TRAINING, draw_dancing, draw_training, framework_figure
from harmolab.viz.quality import distances_figure, draw_distances, draw_sequence, sequences_figure, shot_times
from harmolab.viz.style import COLOURS
from harmolab.viz.training import GUESSING, TERMS, draw_term, draw_validated, losses_figure, validation_figure
from harmolab.viz.variants import LOOKS


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


# boxes and networks


@dataclass(frozen=True)
class Part:
    """A part as `harmolab.models.anatomy` tells of it."""

    name: str
    kind: str
    input: tuple[int, ...] = ()
    output: tuple[int, ...] = ()
    parameters: int = 0
    sources: tuple[str, ...] = ()


# Two inputs are joined for `decoder` and, with it, once more for `head`: a skip connection.
SKIPPING = (
    Part("audio", "input", output=(4, 30, 5)),
    Part("initial", "input", output=(4, 30, 12)),
    Part("encoder", "GRU", (4, 30, 5), (4, 30, 16), 1_100, ("audio",)),
    Part("seeing", "2 Linear", (4, 30, 12), (4, 30, 8), 200, ("initial",)),
    Part("decoder", "GRU", (4, 30, 24), (4, 30, 16), 20_000, ("encoder", "seeing")),
    Part("head", "Linear", (4, 30, 40), (4, 30, 12), 492, ("encoder", "seeing", "decoder")),
    Part("motion", "output", input=(4, 30, 12), sources=("initial", "head")),
)


def test_parts_that_join_the_same_features_share_a_plus_and_a_larger_join_takes_in_the_smaller():
    nodes = nodes_of(SKIPPING, {})
    assert nodes["decoder"].sources == ("encoder+seeing",)
    assert nodes["encoder+seeing"].sources == ("encoder", "seeing")
    assert nodes["head"].sources == ("decoder+encoder+seeing",)
    assert nodes["decoder+encoder+seeing"].sources == ("decoder", "encoder+seeing")
    assert [name for name, node in nodes.items() if node.part is None] == ["encoder+seeing", "decoder+encoder+seeing"]


def test_every_node_stands_below_all_that_feeds_it_and_outputs_at_the_bottom():
    nodes = nodes_of(SKIPPING, {})
    assert all(nodes[source].level < node.level for node in nodes.values() for source in node.sources)
    assert nodes["audio"].level == nodes["initial"].level == 0
    assert nodes["motion"].level == max(node.level for node in nodes.values())


def test_what_an_output_takes_straight_from_an_input_is_written_in_its_box():
    assert nodes_of(SKIPPING, {})["motion"].sources == ("head",)
    ax = draw_network(inch_axes(Figure(figsize=(6, 8)), (0, 0), (6, 8)), SKIPPING, "generator")
    assert "added to $V_f$" in texts(ax)


def test_network_has_a_box_for_each_part_an_arrow_for_each_link_and_its_size_in_the_title():
    ax = draw_network(inch_axes(Figure(figsize=(6, 8)), (0, 0), (6, 8)), SKIPPING, "generator")
    assert sum(patch.get_gid() == "box" for patch in ax.patches) == len(SKIPPING)
    links = sum(len(node.sources) for node in nodes_of(SKIPPING, {}).values())
    assert sum(patch.get_gid() == "arrow" for patch in ax.patches) == links
    assert texts(ax).count("+") == 2
    assert ax.get_title(loc="left").endswith("21.8 k parameters")
    assert {"pose decoder", "GRU, 20.0 k", "to 30 \N{MULTIPLICATION SIGN} 16"} <= set(texts(ax))


def test_part_without_words_of_its_own_is_called_as_in_the_code():
    ax = draw_network(inch_axes(Figure(figsize=(6, 8)), (0, 0), (6, 8)), SKIPPING, "generator")
    assert "head" in texts(ax)


def test_boxes_are_tinted_by_what_they_deal_in():
    ax = draw_network(inch_axes(Figure(figsize=(6, 8)), (0, 0), (6, 8)), SKIPPING, "generator")
    boxes = [patch for patch in ax.patches if patch.get_gid() == "box"]
    found = [tint for box in boxes for tint, colour in TINTS.items() if to_hex(box.get_facecolor()) == colour.lower()]
    assert sorted(found) == ["audio"] * 2 + ["both"] * 2 + ["motion"] * 3


def test_only_features_that_are_joined_again_are_dashed():
    ax = draw_network(inch_axes(Figure(figsize=(6, 8)), (0, 0), (6, 8)), SKIPPING, "generator")
    dashed = [patch for patch in ax.patches if isinstance(patch, FancyArrowPatch) and patch.get_linestyle() != "-"]
    assert len(dashed) == 1


def test_networks_stand_side_by_side_each_in_its_own_axes():
    figure = networks_figure({"generator": SKIPPING, "cross_domain": SKIPPING})
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[0].startswith("generator")
    assert titles[1].startswith("discriminator")
    left, right = figure.axes[0].get_position(), figure.axes[1].get_position()
    assert left.x1 <= right.x0


def test_box_is_as_high_as_its_lines_need():
    ax = inch_axes(Figure(figsize=(4, 4)), (0, 0), (4, 4))
    one, three = draw_box(ax, (1, 1), ["a"]), draw_box(ax, (1, 3), ["a", "b", "c"])
    assert three - one == pytest.approx(0.155)
    assert texts(ax) == ["a", "a", "b", "c"]


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0"), (999, "999"), (1000, "1.0 k"), (99_960, "100 k"), (7.25e6, "7.2 M")]
)
def test_counts_are_short(count: int, text: str):
    assert count_text(count) == text


def test_pieces_that_clips_are_cut_into_are_counted():
    assert shape_text((20, 8, 3), 4) == "5 of 8 \N{MULTIPLICATION SIGN} 3"


# framework


COUNTS = {"generator": 66_702, "cross_domain": 12_700, "spatial_temporal": 12_400}


def test_training_shows_each_loss_with_its_equation_and_both_weights():
    params = {"paper": TrainParams.paper(), "ours": TrainParams.recommended()}
    ax = draw_training(inch_axes(Figure(figsize=TRAINING), (0, 0), TRAINING), COUNTS, params)
    found = texts(ax)
    titles = [title for title, *_ in LOSSES.values()]
    assert [line.split(" (")[0] for line in found if line.split(" (")[0] in titles] == titles
    for equation in (23, 24, 25, 26, 27, 32):
        assert any(f"Eq. {equation}" in line for line in found)
    ours = TrainParams.recommended()
    assert f"weight: paper 0.001, ours {ours.mse_weight:g}" in found
    assert f"weight: paper 0, ours {ours.smoothness_weight:g}" in found
    assert "66.7 k parameters" in found
    assert any("12.7 k" in line and "12.4 k" in line for line in found)


def test_every_loss_weight_of_the_settings_is_in_the_picture():
    weights = {name for name in vars(TrainParams.paper()) if name.endswith("_weight")}
    parts_of_terms = {"pretrain_kl_weight", "count_weight", "cross_domain_weight"}
    assert weights - parts_of_terms == {f"{name}_weight" for name in LOSSES}


def test_a_discriminator_that_is_not_heard_is_named_in_the_picture():
    counts = {"generator": 1, "cross_domain": 1, "spatial_temporal": 1}
    params = {"paper": TrainParams.paper(), "ours": replace(TrainParams.paper(), gan_weight=0.1, cross_domain_weight=0)}
    ax = draw_training(inch_axes(Figure(figsize=TRAINING), (0, 0), TRAINING), counts, params)
    assert any("paper 0.001, ours 0.1 ($D_{st}$ alone)" in text.get_text() for text in ax.texts)


def test_last_beats_of_a_meter_lead_to_the_next_generator():
    ax = draw_dancing(inch_axes(Figure(figsize=DANCING), (0, 0), DANCING))
    tails = [patch for patch in ax.patches if isinstance(patch, Rectangle) and patch.get_gid() == "last beats"]
    assert len(tails) == 3
    assert sum(patch.get_gid() == "arrow" for patch in ax.patches) == 3 * 2 + 1  # music, dance; the first pose
    over = [patch for patch in ax.patches if patch.get_gid() == "handing over"]
    assert len(over) == 2
    for tail, arrow in zip(tails, over, strict=False):
        assert tail.get_x() < arrow.get_path().vertices[0, 0] < tail.get_x() + tail.get_width()


def test_framework_has_both_panels():
    figure = framework_figure(COUNTS, {"paper": TrainParams.paper()})
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert [title[0] for title in titles if title] == ["a", "b"]


# training


def course(variant: str, *, harmony: float | None) -> list[dict[str, Any]]:
    """Ten epochs of pretraining, validated at the fifth and the tenth, and three adversarial ones."""
    rows: list[dict[str, Any]] = []
    for epoch in range(10):
        due = epoch in (4, 9)
        rows.append({"variant": variant, "phase": "pretrain", "epoch": epoch, "mse": 10.0 - epoch})
        rows[-1] |= {"val_harmony": 0.2 if due else np.nan, "val_above_chance": 0.0 if due else np.nan, "gan": np.nan}
    for epoch in range(3):
        rows.append({"variant": variant, "phase": "adversarial", "epoch": epoch, "mse": 1.0, "gan": 1.3})
        rows[-1] |= {"val_harmony": 0.3 + 0.1 * epoch, "val_above_chance": -0.1, "val_count_ratio": 1.2}
        rows[-1] |= {} if harmony is None else {"harmony": harmony}
    return rows


COURSES = course("paper, without", harmony=None) + course("paper", harmony=-0.5) + course("recommended", harmony=2.0)


def bands(ax: Axes) -> list[tuple[float, float]]:
    found = [patch for patch in ax.patches if patch.get_gid() == "pretraining"]
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in found]


def test_term_is_drawn_over_both_phases_and_pretraining_is_marked(ax: Axes):
    draw_term(ax, COURSES, "mse", ["paper"])
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), np.arange(1, 14))
    np.testing.assert_array_equal(line.get_ydata(), [*(10.0 - np.arange(10)), 1.0, 1.0, 1.0])
    assert bands(ax) == [(0.5, 10.5)]


def test_term_that_only_adversarial_epochs_have_is_drawn_there_beside_the_line_of_guessing(ax: Axes):
    draw_term(ax, COURSES, "gan", ["paper"])
    line, guess = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), [11, 12, 13])
    assert guess.get_ydata()[0] == pytest.approx(GUESSING) == pytest.approx(1.3863, abs=1e-4)
    assert bands(ax) == []


def test_lines_look_as_their_variant_everywhere_and_are_dashed_without_harmony(ax: Axes):
    draw_term(ax, COURSES, "mse", ["paper, without", "paper"])
    without, with_it = ax.lines
    assert without.get_color() == with_it.get_color() == LOOKS["paper"].colour
    assert (without.is_dashed(), with_it.is_dashed()) == (True, False)


def test_the_two_harmony_losses_never_share_a_scale():
    figure = losses_figure(COURSES)
    panels = {ax.get_title(loc="left"): ax for ax in figure.axes}
    ours, theirs = panels["our harmony"], panels["paper's harmony (Eq. 27)"]
    np.testing.assert_array_equal(ours.lines[0].get_ydata(), [2.0] * 3)
    np.testing.assert_array_equal(theirs.lines[0].get_ydata(), [-0.5] * 3)
    assert len(ours.lines) == len(theirs.lines) == 1


def test_every_term_has_its_panel():
    figure = losses_figure(COURSES)
    assert [ax.get_title(loc="left") for ax in figure.axes[: len(TERMS)]] == [title for title, *_ in TERMS]


def test_validation_starts_at_the_end_of_pretraining(ax: Axes):
    draw_validated(ax, COURSES, "val_harmony")
    assert len(ax.lines) == 3
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), [0, 1, 2, 3])
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [0.2, 0.3, 0.4, 0.5])
    assert ax.get_ylim() == (0.0, 1.0)


@pytest.mark.parametrize(("column", "level"), [("val_above_chance", 0.0), ("val_count_ratio", 1.0)])
def test_chance_and_one_beat_for_one_are_dotted(ax: Axes, column: str, level: float):
    draw_validated(ax, COURSES, column)
    assert list(ax.lines[-1].get_ydata()) == [level, level]
    assert ax.lines[-1].get_color() == COLOURS["chance"]


def test_validation_has_the_papers_scores_and_what_they_do_not_tell():
    figure = validation_figure(COURSES)
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "paper's harmony h",
        "paper's hit rate",
        "harmony above chance",
        "beats danced / heard",
    ]


# quality


def distance(
    variant: str, mean: float, low: float = np.nan, high: float = np.nan, corpus: str = "some"
) -> dict[str, Any]:
    base = {"corpus": corpus, "variant": variant, "low": low, "high": high}
    return {**base, "measure": "fid", "mean": mean}


MEASURED = [
    distance("paper, without", 20.0),
    distance("paper", 25.0, 22.0, 28.0),
    distance("recorded, halves", -0.02, -1.0, 1.0),
    distance("recorded, other figures", 3.0, 2.0, 4.0),
]


def test_bars_are_distances_with_those_between_recordings_at_the_bottom(ax: Axes):
    draw_distances(ax, MEASURED, measure="fid")
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "recorded, half and half",
        "recorded, other figures",
        LOOKS["paper"].label,
        LOOKS["paper, without"].label,
    ]
    assert [bar.get_width() for bar in ax.patches] == [-0.02, 3.0, 25.0, 20.0]
    assert [bool(bar.get_hatch()) for bar in ax.patches] == [True, True, False, False]
    assert texts(ax) == ["0.0", "3.0", "25.0", "20.0"]


def test_intervals_are_drawn_where_there_are_some_and_lie_inside_the_axes(ax: Axes):
    draw_distances(ax, MEASURED, measure="fid")
    spans = [tuple(line.get_xdata()) for line in ax.lines if line.get_gid() == "interval"]
    assert spans == [(-1.0, 1.0), (2.0, 4.0), (22.0, 28.0)]
    low, high = ax.get_xlim()
    assert low < -1.0 < 28.0 < high


def test_bar_of_a_training_without_harmony_is_hollow(ax: Axes):
    draw_distances(ax, MEASURED, measure="fid")
    with_it, without = ax.patches[2], ax.patches[3]
    assert to_hex(with_it.get_facecolor()) == LOOKS["paper"].colour.lower()
    assert to_hex(without.get_facecolor()) == "#ffffff"
    assert to_hex(without.get_edgecolor()) == LOOKS["paper"].colour.lower()


def test_distances_have_a_row_for_each_corpus_and_a_panel_for_each_kind_of_features():
    rows = [{**row, "corpus": corpus} for corpus in ("one", "two") for row in MEASURED]
    rows += [{**row, "measure": "fid_kinetic"} for row in rows]
    titles = [ax.get_title(loc="left") for ax in distances_figure(rows).axes]
    assert [title.split(":")[0] for title in titles] == ["one", "one", "two", "two"]


def standing(n_frames: int = 31, fps: float = 15.0) -> Motion:
    skeleton = Skeleton(("hips", "head"), (-1, 0))
    pose = np.array([[0.0, 1.0, 0.0], [0.0, 1.7, 0.0]])
    return Motion(np.repeat(pose[None], n_frames, axis=0), fps, skeleton)


def test_shots_are_as_far_apart_as_they_can_be_at_equal_steps():
    np.testing.assert_allclose(shot_times(standing(31), 4) * 15, [0, 10, 20, 30])
    np.testing.assert_allclose(shot_times(standing(33), 4) * 15, [0, 10, 20, 30])
    np.testing.assert_array_equal(shot_times(standing(), 1), [0.0])


@pytest.mark.parametrize("shots", [0, 32])
def test_more_shots_than_frames_are_refused(shots: int):
    with pytest.raises(ValueError, match=r"shots must be from 1 to the number of frames \(31\), got"):
        shot_times(standing(31), shots)


def figures_at(ax: Axes) -> list[float]:
    return [artist.xy[0] for artist in ax.get_children() if isinstance(artist, AnnotationBbox)]


def test_sequence_has_a_figure_at_each_shot_and_shades_what_was_given(ax: Axes):
    draw_sequence(ax, standing(31), shots=4, start=1.0)
    np.testing.assert_allclose(figures_at(ax), np.array([0, 10, 20, 30]) / 15)
    (shade,) = [patch for patch in ax.patches if patch.get_gid() == "given"]
    assert shade.get_x() + shade.get_width() == pytest.approx(1.0)
    low, high = ax.get_xlim()
    assert low < 0.0 < 2.0 < high


def test_recorded_and_generated_stand_under_each_other_at_the_same_moments():
    figure = sequences_figure({"recorded": standing(), "paper": standing()}, shots=4, start=1.0, title="waltz")
    assert [ax.get_title(loc="left") for ax in figure.axes] == [LOOKS["recorded"].label, LOOKS["paper"].label]
    assert figures_at(figure.axes[0]) == figures_at(figure.axes[1])
    assert figure.axes[-1].get_xlabel() == "time (s)"
