"""Figures of notebooks 07 and 08: what is on the axes. Answers are planted; pixels are not looked at."""

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox

from harmolab.body.skeletons import Skeleton
from harmolab.lab.figures.style import COLOURS
from harmolab.systems.harmogan.params import TrainParams
from harmolab.types import Motion
from study.figures.framework import DRAWING, TINTS, count_text, draw_diagram, framework_figure, networks_figure
from study.figures.variants import LOOKS, distances_figure, draw_distances
from study.saving import smallest_text
from tests.builders import cases
from tests.notebook_cells import notebook_cells

TRAINING = notebook_cells("07_anatomy_and_training")


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


# Fig. 7


NETWORKS = {
    "generator": "audio initial hearing encoder seeing decoder flat_head depth_head path_head motion flat",
    "cross_domain": "audio motion hearing seeing both verdict output",
    "spatial_temporal": "motion seeing joining.0 joining.1 joining.2 joining.3 verdict output",
}
SIGNALS = ("audio", "initial", "motion", "flat", "output")
PARTS = [
    {
        "network": network,
        "name": name,
        "layers": "input" if name in SIGNALS else "GRU",
        "parameters": 0 if name in SIGNALS else 1_100,
        "shape": f"of {name}",
    }
    for network, names in NETWORKS.items()
    for name in names.split()
]
BOTH = {"paper": TrainParams.paper(), "ours": TrainParams.recommended()}


def test_every_measured_part_has_a_box_with_its_layers_size_and_shape():
    (ax,) = networks_figure(PARTS).axes
    assert sum(patch.get_gid() == "box" for patch in ax.patches) == len(PARTS) + 3  # three in the legend
    for part in PARTS:
        assert (part["shape"] if part["name"] in SIGNALS else f"to {part['shape']}") in texts(ax)
    assert texts(ax).count("GRU, 1.1 k") == sum(part["parameters"] > 0 for part in PARTS)
    assert "generator $G$: 7.7 k parameters" in texts(ax)


@pytest.mark.parametrize("figure", [networks_figure(PARTS), framework_figure(PARTS, BOTH)])
def test_nothing_in_the_drawing_is_left_to_measure_and_all_of_it_is_on_the_paper(figure: Figure):
    (ax,) = figure.axes
    assert not [text for text in texts(ax) if re.search(r"(?<!_)\{", text)]
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    for text in ax.texts:
        x, y = text.get_position()
        assert left <= x <= right and bottom <= y <= top


def test_boxes_do_not_overlap():
    for figure in (networks_figure(PARTS), framework_figure(PARTS, BOTH)):
        boxes = [patch.get_window_extent() for patch in figure.axes[0].patches if patch.get_gid() == "box"]
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_training_shows_each_loss_with_its_equation_and_both_weights():
    (ax,) = framework_figure(PARTS, BOTH).axes
    for equation in (23, 24, 25, 26, 27, 32):
        assert any(f"Eq. {equation}" in line for line in texts(ax))
    assert f"weight: paper 0.001, ours {BOTH['ours'].mse_weight:g}" in texts(ax)
    assert f"weight: paper 0, ours {BOTH['ours'].smoothness_weight:g}" in texts(ax)
    assert "7.7 k parameters" in texts(ax)
    assert any("4.4 k" in line and "6.6 k" in line for line in texts(ax))  # discriminators of 4 and 6 parts


def test_every_loss_weight_of_the_settings_is_in_the_picture():
    weights = {name.removesuffix("_weight") for name in vars(TrainParams.paper()) if name.endswith("_weight")}
    parts_of_terms = {"pretrain_kl", "count", "cross_domain"}
    assert set(re.findall(r"\{weight\.(\w+)\}", DRAWING.read_text("utf-8"))) == weights - parts_of_terms


def test_a_discriminator_that_is_not_heard_is_named_in_the_picture():
    params = {"paper": TrainParams.paper(), "ours": replace(TrainParams.paper(), gan_weight=0.1, cross_domain_weight=0)}
    (ax,) = framework_figure(PARTS, params).axes
    assert "weight: paper 0.001, ours 0.1 ($D_{st}$ alone)" in texts(ax)


def test_box_is_as_high_as_its_lines_need(ax: Axes):
    draw_diagram(ax, {"parts": [[1, 1, 1, "both", "a"], [1, 3, 1, "audio", "a", "b\nc"]]})
    one, three = (patch.get_bbox().height for patch in ax.patches)
    assert three - one == pytest.approx(2 * 0.155)
    assert texts(ax) == ["a", "a", "b", "c"]
    assert [to_hex(patch.get_facecolor()) for patch in ax.patches] == [
        TINTS[name].lower() for name in ("both", "audio")
    ]


@cases("count, text", (0, "0"), (999, "999"), (1000, "1.0 k"), (99_960, "100 k"), (7.25e6, "7.2 M"))
def test_counts_are_short(count: int, text: str):
    assert count_text(count) == text


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


def history(*courses: list[dict[str, Any]]) -> pd.DataFrame:
    """Courses as one table with all columns of a history."""
    columns = [*TRAINING.VALIDATED, *(column for _, column, _ in TRAINING.TERMS)]
    table = pd.DataFrame([row for rows in courses for row in rows])
    return table.reindex(columns=[*dict.fromkeys([*table.columns, *columns])])


COURSES = history(
    course("paper, without", harmony=None), course("paper", harmony=-0.5), course("recommended", harmony=2.0)
)


def bands(ax: Axes) -> list[tuple[float, float]]:
    found = [patch for patch in ax.patches if patch.get_gid() == "pretraining"]
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in found]


def test_term_is_drawn_over_both_phases_and_pretraining_is_marked(ax: Axes):
    TRAINING.draw_term(ax, COURSES, "mse", ["paper"])
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), np.arange(1, 14))
    np.testing.assert_array_equal(line.get_ydata(), [*(10.0 - np.arange(10)), 1.0, 1.0, 1.0])
    assert bands(ax) == [(0.5, 10.5)]


def test_term_that_only_adversarial_epochs_have_is_drawn_there(ax: Axes):
    TRAINING.draw_term(ax, COURSES, "gan", ["paper"])
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), [11, 12, 13])
    assert bands(ax) == []


def test_lines_look_as_their_variant_everywhere_and_are_dashed_without_harmony(ax: Axes):
    TRAINING.draw_term(ax, COURSES, "mse", ["paper, without", "paper"])
    without, with_it = ax.lines
    assert without.get_color() == with_it.get_color() == LOOKS["paper"].colour
    assert (without.is_dashed(), with_it.is_dashed()) == (True, False)


def test_the_two_harmony_losses_never_share_a_scale():
    figure = TRAINING.losses_figure(COURSES)
    panels = {ax.get_title(loc="left").split("\n")[0]: ax for ax in figure.axes}
    ours, theirs = panels["our harmony"], panels["paper's harmony (Eq. 27)"]
    np.testing.assert_array_equal(ours.lines[0].get_ydata(), [2.0] * 3)
    np.testing.assert_array_equal(theirs.lines[0].get_ydata(), [-0.5] * 3)
    assert len(ours.lines) == len(theirs.lines) == 1


def test_every_term_has_its_panel():
    figure = TRAINING.losses_figure(COURSES)
    assert [ax.get_title(loc="left").split("\n")[0] for ax in figure.axes] == [title for title, *_ in TRAINING.TERMS]
    assert smallest_text(figure) >= 9


def test_validation_starts_at_the_end_of_pretraining(ax: Axes):
    TRAINING.draw_validated(ax, COURSES, "val_harmony")
    assert len(ax.lines) == 3
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), [0, 1, 2, 3])
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [0.2, 0.3, 0.4, 0.5])
    assert ax.get_ylim() == (0.0, 1.0)


def test_each_variant_is_validated_from_the_end_of_its_own_pretraining(ax: Axes):
    longer = course("recommended", harmony=None)[:5] + course("recommended", harmony=2.0)
    TRAINING.draw_validated(ax, history(course("paper", harmony=-0.5), longer), "val_harmony")
    for line in ax.lines:
        np.testing.assert_array_equal(line.get_xdata(), [0, 1, 2, 3])


@pytest.mark.parametrize(("column", "level"), [("val_above_chance", 0.0), ("val_count_ratio", 1.0)])
def test_chance_and_one_beat_for_one_are_dotted(ax: Axes, column: str, level: float):
    TRAINING.draw_validated(ax, COURSES, column)
    assert list(ax.lines[-1].get_ydata()) == [level, level]
    assert ax.lines[-1].get_color() == COLOURS["chance"]


def test_validation_has_the_papers_scores_and_what_they_do_not_tell():
    figure = TRAINING.validation_figure(COURSES)
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "paper's harmony h",
        "paper's hit rate",
        "harmony above chance, in the room",
        "harmony above chance, in the body",
        "spread of poses / recorded",
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


def test_distances_stand_on_a_logarithmic_axis_with_those_between_recordings_at_the_bottom(ax: Axes):
    draw_distances(ax, MEASURED, measure="fid")
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "recorded dance, two halves",
        "recorded dance, other figures",
        LOOKS["paper"].label,
        LOOKS["paper, without"].label,
    ]
    assert ax.get_xscale() == "log"
    assert texts(ax) == ["0.0", "3.0", "25.0", "20.0"]
    means = [line.get_xdata()[0] for line in ax.lines if line.get_marker() in "sD"]
    assert means == [3.0, 25.0, 20.0]  # one below 0 has no mark there, only its number


def test_interval_that_goes_below_the_axis_ends_in_an_arrow_at_its_left_end(ax: Axes):
    draw_distances(ax, MEASURED, measure="fid")
    left = ax.get_xlim()[0]
    spans = [tuple(line.get_xdata()) for line in ax.lines if line.get_gid() == "interval"]
    assert spans == [(left, 1.0), (2.0, 4.0), (22.0, 28.0)]
    assert [line.get_xdata()[0] for line in ax.lines if line.get_marker() == "<"] == [left]


def test_trainings_are_dots(ax: Axes):
    draw_distances(ax, [{**distance("paper", 20.0), "seed 1": 15.0, "seed 2": 25.0}], measure="fid")
    (dots,) = [line for line in ax.lines if line.get_gid() == "seed"]
    assert list(dots.get_xdata()) == [15.0, 25.0]


def test_distances_have_a_row_for_each_corpus_and_name_the_nearest_generator():
    rows = [{**row, "corpus": corpus} for corpus in ("beatlocked", "synthetic") for row in MEASURED]
    rows += [{**row, "measure": "fid_kinetic"} for row in rows]
    figure = distances_figure(rows)
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert {title.split("\n")[1] for title in titles} == {f"nearest is “{LOOKS['paper, without'].label}”"}
    assert [title.split(",")[0] for title in titles[::2]] == ["Recordings on the beat", "Synthetic dancers"]
    assert smallest_text(figure) >= 9


def standing(n_frames: int = 31, fps: float = 15.0) -> Motion:
    skeleton = Skeleton(("hips", "head"), (-1, 0))
    pose = np.array([[0.0, 1.0, 0.0], [0.0, 1.7, 0.0]])
    return Motion(np.repeat(pose[None], n_frames, axis=0), fps, skeleton)


QUALITY = notebook_cells("08_motion_quality")


def test_shots_are_as_far_apart_as_they_can_be_at_equal_steps():
    for frames in (31, 33):
        np.testing.assert_allclose(QUALITY.shot_times(standing(frames), 4) * 15, [0, 10, 20, 30])


def figures_at(ax: Axes) -> list[float]:
    return [artist.xy[0] for artist in ax.get_children() if isinstance(artist, AnnotationBbox)]


def test_recorded_and_generated_stand_under_each_other_at_the_same_moments_and_what_was_given_is_shaded():
    motions = {"recorded": standing(), "paper": standing()}
    example = SimpleNamespace(motions=motions, start=1.0, verdicts={"recorded": "all met", "paper": "none met"})
    figure = QUALITY.sequences_figure(example, "waltz")
    titles = [f"{LOOKS['recorded'].label}: all met", f"{LOOKS['paper'].label}: none met"]
    assert [ax.get_title(loc="left") for ax in figure.axes] == titles
    np.testing.assert_allclose(figures_at(figure.axes[0]), np.arange(10) * 3 / 15)
    assert figures_at(figure.axes[0]) == figures_at(figure.axes[1])
    assert figure.axes[-1].get_xlabel() == "time (s)"
    for ax in figure.axes:
        (shade,) = [patch for patch in ax.patches if patch.get_gid() == "given"]
        assert shade.get_x() + shade.get_width() == pytest.approx(1.0)
        low, high = ax.get_xlim()
        assert low < 0.0 < 27 / 15 < high
