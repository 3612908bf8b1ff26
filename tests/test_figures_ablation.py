"""Figures of the ablation: what stands where on the axes, and that the paper's numbers and ours never meet."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from harmolab.lab.figures.ablation import (
    MEASURES,
    ablation_figure,
    draw_measure,
    draw_printed,
    draw_trade_off,
    trade_off_figure,
)
from harmolab.lab.figures.results import draw_choices, forced_choice_figure
from harmolab.lab.figures.style import COLOURS
from harmolab.lab.figures.variants import LOOKS

NAN = float("nan")
TARGETS = {"above_chance": (0.35, np.inf), "count_ratio": (0.7, 1.4), "jerk": (-np.inf, 1.5), "fid": (-np.inf, 1.1)}
ROWS = {"paper, without": 3, "paper": 2, "recommended, without": 1, "recommended": 0}  # from below


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def record(variant: str, measure: str, mean: float, low: float = NAN, high: float = NAN, paper: float = NAN):
    return {
        "corpus": "made up", "variant": variant, "measure": measure, "mean": mean, "low": low, "high": high,
        "paper": paper,
    }  # fmt: skip


def of_all(measure: str, means: list[float]) -> list[dict[str, object]]:
    """One record for each variant in the order of `ROWS`, then the recorded motion."""
    return [record(name, measure, mean) for name, mean in zip([*ROWS, "recorded"], means, strict=True)]


def marks(ax: Axes) -> dict[tuple[float, float], Line2D]:
    """Every single mark: (x, y) -> its line."""
    single = [line for line in ax.lines if len(line.get_xdata()) == 1]
    return {(round(float(line.get_xdata()[0]), 6), float(line.get_ydata()[0])): line for line in single}


def regions(ax: Axes) -> list[tuple[float, float, float, float]]:
    """(left, right, bottom, top) of each green region."""
    found = [patch for patch in ax.patches if isinstance(patch, Rectangle) and patch.get_gid() == "target"]
    return [tuple(np.round([*area.get_bbox().intervalx, *area.get_bbox().intervaly], 6).tolist()) for area in found]


# One measure


def test_each_variant_has_its_mark_at_its_mean_hollow_without_the_harmony_term(ax: Axes):
    draw_measure(ax, of_all("jerk", [10.0, 40.0, 12.0, 30.0, 20.0]), measure="jerk")
    found = marks(ax)
    assert set(found) == {(10.0, 3.0), (40.0, 2.0), (12.0, 1.0), (30.0, 0.0)}
    faces = {place: found[place].get_markerfacecolor() for place in found}
    assert faces[10.0, 3.0] == faces[12.0, 1.0] == "white"
    assert faces[40.0, 2.0] == LOOKS["paper"].colour
    assert faces[30.0, 0.0] == LOOKS["recommended"].colour
    assert [text.get_text() for text in ax.get_yticklabels()] == [LOOKS[name].label for name in reversed(ROWS)]
    assert ax.get_xlabel() == "jerk (m/s³)"


def test_recorded_motion_is_a_dashed_line_over_all_rows(ax: Axes):
    draw_measure(ax, of_all("jerk", [10.0, 40.0, 12.0, 30.0, 20.0]), measure="jerk")
    (line,) = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert list(line.get_xdata()) == [20.0, 20.0]


def test_interval_is_drawn_only_where_there_is_one(ax: Axes):
    rows = of_all("fid", [10.0, 40.0, 12.0, 30.0, 0.0])
    rows[1] = record("paper", "fid", 40.0, 35.0, 45.0)
    draw_measure(ax, rows, measure="fid")
    intervals = [line for line in ax.lines if line.get_gid() == "interval"]
    assert [list(line.get_xdata()) for line in intervals] == [[35.0, 45.0]]
    assert list(intervals[0].get_ydata()) == [2, 2]


def test_arrows_lead_from_without_to_with(ax: Axes):
    draw_measure(ax, of_all("jerk", [10.0, 40.0, 12.0, 30.0, 20.0]), measure="jerk")
    arrows = [text for text in ax.texts if getattr(text, "arrow_patch", None) is not None]
    assert {(text.xyann, text.xy) for text in arrows} == {((10.0, 3), (40.0, 2)), ((12.0, 1), (30.0, 0))}


def test_axes_start_at_zero_and_hold_the_end_of_what_is_asked_for(ax: Axes):
    draw_measure(ax, of_all("jerk", [10.0, 40.0, 12.0, 30.0, 20.0]), measure="jerk", targets={"paper": (-np.inf, 90.0)})
    left, right = ax.get_xlim()
    assert left == 0.0
    assert right > 90.0
    assert regions(ax) == [(0.0, 90.0, 1.5, 2.5)]


def test_value_below_zero_is_within_the_axes(ax: Axes):
    draw_measure(ax, of_all("above_chance", [-0.3, 0.2, 0.1, 0.5, 0.4]), measure="above_chance")
    assert ax.get_xlim()[0] < -0.3


# The paper's numbers


def test_printed_values_are_hatched_bars_and_nothing_else(ax: Axes):
    rows = [
        record("paper, without", "paper_harmony", 0.9, paper=0.2),
        record("paper", "paper_harmony", 0.8, paper=0.35),
    ]
    draw_printed(ax, [*rows, record("recommended", "paper_harmony", 0.7)], measure="paper_harmony")
    bars = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    assert [bar.get_width() for bar in bars] == [0.35, 0.2]
    assert {bar.get_hatch() for bar in bars} == {"//"}
    assert [text.get_text() for text in ax.get_yticklabels()] == [
        LOOKS[name].label for name in ("paper", "paper, without")
    ]
    assert len(ax.lines) == 0


def all_measures(corpus: str = "made up") -> list[dict[str, object]]:
    """Means 1 to 5 of every measure; two measures have values of the paper."""
    rows = [row for measure in MEASURES for row in of_all(measure, [1.0, 2.0, 3.0, 4.0, 5.0])]
    for row in rows:
        row["corpus"] = corpus
        if row["variant"] == "paper" and row["measure"] in ("paper_harmony", "paper_hit_rate"):
            row["paper"] = 0.123
    return rows


def test_paper_and_ours_share_no_panel():
    figure = ablation_figure([*all_measures("one"), *all_measures("two")], TARGETS)
    lines = np.array(figure.axes).reshape(3, len(MEASURES))
    printed = [[bar.get_width() for bar in ax.patches if bar.get_hatch()] for ax in lines[0]]
    assert printed == [[0.123], [0.123], [], [], [], []]
    assert [len(ax.lines) for ax in lines[0]] == [0] * len(MEASURES)
    assert not [patch for ax in lines[1:].flat for patch in ax.patches if patch.get_hatch()]
    assert [ax.get_title(loc="left") for ax in lines[:, 0]] == ["printed in the paper", "ours: one", "ours: two"]


def test_what_is_asked_for_is_relative_to_the_variant_without_and_the_recorded_motion():
    figure = ablation_figure(all_measures(), TARGETS)
    panels = dict(zip(MEASURES, figure.axes[len(MEASURES) :], strict=True))
    right = {measure: ax.get_xlim()[1] for measure, ax in panels.items()}
    assert regions(panels["paper_harmony"]) == []
    # paper: without 1, with in row 2; ours: without 3, with in row 0; recorded 5
    assert regions(panels["above_chance"]) == [
        pytest.approx((1.35, right["above_chance"], 1.5, 2.5)),
        pytest.approx((3.35, right["above_chance"], -0.5, 0.5)),
    ]
    assert regions(panels["count_ratio"]) == [(0.7, 1.4, 1.5, 2.5), (0.7, 1.4, -0.5, 0.5)]
    assert regions(panels["jerk"]) == [(0.0, 7.5, 1.5, 2.5), (0.0, 7.5, -0.5, 0.5)]
    assert regions(panels["fid"]) == [(0.0, 1.1, 1.5, 2.5), (0.0, pytest.approx(3.3), -0.5, 0.5)]


# The trade-off


def swept(*points: tuple[float, float, float]) -> list[dict[str, float]]:
    """Records of (weight, jerk, harmony above chance)."""
    return [
        {"harmony_weight": weight, "jerk": jerk, "above_chance": above, "fid": 10 * jerk, "count_ratio": 1.0}
        for weight, jerk, above in points
    ]


def test_curve_runs_through_the_weights_in_order_and_names_them(ax: Axes):
    sweep = swept((0.0, 2.0, 0.1), (0.3, 3.0, 0.4), (1.0, 5.0, 0.7))
    draw_trade_off(ax, sweep, {}, measure="jerk", target=(-np.inf, 4.0), least=0.45)
    np.testing.assert_allclose(ax.lines[0].get_xydata(), [(2.0, 0.1), (3.0, 0.4), (5.0, 0.7)])
    assert [text.get_text() for text in ax.texts] == ["0", "0.3", "1"]
    faces = [line.get_markerfacecolor() for line in marks(ax).values()]
    assert faces == ["white", LOOKS["recommended"].colour, LOOKS["recommended"].colour]


def test_region_asked_for_is_left_of_the_limit_and_above_the_least(ax: Axes):
    draw_trade_off(ax, swept((0.0, 2.0, 0.1), (1.0, 5.0, 0.7)), {}, measure="jerk", target=(-np.inf, 4.0), least=0.45)
    assert regions(ax) == [(0.0, 4.0, 0.45, pytest.approx(ax.get_ylim()[1], abs=1e-6))]


def test_region_that_lies_above_the_axes_is_not_turned_upside_down(ax: Axes):
    draw_trade_off(ax, swept((0.0, 2.0, 0.9)), {}, measure="jerk", target=(-np.inf, 4.0), least=1.25)
    ((_, _, bottom, top),) = regions(ax)
    assert bottom == top


def test_trade_off_has_a_row_a_corpus_and_regions_in_the_units_of_the_axes():
    sweep = swept((0.0, 2.0, 0.1), (1.0, 5.0, 0.7))
    others = {"recorded": {"jerk": 4.0, "fid": 0.0, "count_ratio": 0.9, "above_chance": 0.8}}
    figure = trade_off_figure({"one": sweep, "two": sweep}, {"one": others, "two": others}, TARGETS)
    lines = np.array(figure.axes).reshape(2, 3)
    assert [ax.get_title(loc="left") for ax in lines[:, 0]] == ["one", "two"]
    jerk, fid, count = (regions(ax)[0] for ax in lines[1])
    assert jerk[:3] == (0.0, 6.0, 0.45)  # 1.5 times 4; 0.1 and 0.35 more
    assert fid[1] == pytest.approx(22.0)  # 1.1 times 20
    assert count[:2] == (0.7, 1.4)
    assert (4.0, 0.8) in marks(lines[0, 0])


# Votes


def vote(judge: str, share: float, first: str = "paper", second: str = "recommended", n: int = 25) -> dict[str, object]:
    return {"first": first, "second": second, "judge": judge, "share": share, "n": n}


def test_votes_for_the_second_lie_to_the_right_where_its_name_stands(ax: Axes):
    draw_choices(ax, [vote("paper's harmony", 0.9), vote("above chance", 0.2)])
    shares = {line.get_label(): line.get_xdata() for line in ax.lines if not line.get_label().startswith("_")}
    np.testing.assert_allclose(shares["paper's harmony"], [0.1])
    np.testing.assert_allclose(shares["above chance"], [0.8])
    (right,) = ax.child_axes
    assert [text.get_text() for text in ax.get_yticklabels()] == [LOOKS["paper"].label]
    assert [text.get_text() for text in right.get_yticklabels()] == [LOOKS["recommended"].label]


def test_band_of_the_coin_narrows_with_the_root_of_the_number_of_units(ax: Axes):
    draw_choices(ax, [vote("paper's harmony", 0.5, n=49)])
    (band,) = [patch for patch in ax.patches if patch.get_label().startswith("a coin")]
    np.testing.assert_allclose(band.get_bbox().intervalx, [0.5 - 0.98 / 7, 0.5 + 0.98 / 7])


def test_votes_say_in_the_picture_that_nobody_was_asked():
    figure = forced_choice_figure({"made up": [vote("above chance", 0.2)]})
    assert figure.axes[0].get_title(loc="left") == "made up: two scores as judges, 25 units (no people)"


def test_looks_differ_in_mark_as_well_as_colour_and_take_no_colour_that_means_something_else():
    assert {look.colour for name, look in LOOKS.items() if name != "recorded"}.isdisjoint(map(to_hex, COLOURS.values()))
    assert LOOKS["paper"].marker != LOOKS["recommended"].marker
    assert [name for name, look in LOOKS.items() if not look.filled] == ["paper, without", "recommended, without"]
