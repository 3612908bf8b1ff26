"""Figures of the ablation: what stands where on the axes, and that titles follow the numbers."""

from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from harmolab.lab.figures.style import COLOURS
from study.figures.variants import (
    APART,
    LOOKS,
    ablation_figure,
    draw_choices,
    draw_measure,
    draw_trade_off,
    forced_choice_figure,
    trade_off_figure,
)
from study.saving import smallest_text
from tests.builders import cases

NAN = float("nan")


@pytest.fixture
def ax() -> Iterator[Axes]:
    """Axes that a notebook might draw on."""
    yield Figure(figsize=(8, 4)).subplots()


def record(variant: str, measure: str, mean: float, low: float = NAN, high: float = NAN, corpus: str = "made up"):
    return {
        "corpus": corpus,
        "variant": variant,
        "measure": measure,
        "mean": mean,
        "low": low,
        "high": high,
        "seeds": 3,
    }


def of_all(measure: str, means: list[float], corpus: str = "made up") -> list[dict[str, object]]:
    """One record for each variant in the order of `LOOKS`, the recorded motion last."""
    return [record(name, measure, mean, corpus=corpus) for name, mean in zip(LOOKS, means, strict=True)]


def gain(loss: str, measure: str, change: float, half: float, corpus: str = "made up") -> dict[str, object]:
    ends = {"low": change - half, "high": change + half}
    return {"corpus": corpus, "loss": loss, "measure": measure, "change": change, **ends}


def marks(ax: Axes) -> dict[tuple[float, float], Line2D]:
    """Every single mark: (x, y) -> its line."""
    single = [line for line in ax.lines if len(line.get_xdata()) == 1]
    return {(round(float(line.get_xdata()[0]), 6), round(float(line.get_ydata()[0]), 6)): line for line in single}


# One measure


def test_each_loss_has_a_row_with_a_hollow_mark_without_its_harmony_term_above_a_full_one(ax: Axes):
    draw_measure(ax, of_all("fid", [10.0, 40.0, 12.0, 30.0, NAN]), measure="fid")
    found = marks(ax)
    assert set(found) == {(10.0, 1 + APART), (40.0, 1 - APART), (12.0, APART), (30.0, -APART)}
    faces = {place: found[place].get_markerfacecolor() for place in found}
    assert faces[10.0, 1 + APART] == faces[12.0, APART] == "white"
    assert faces[40.0, 1 - APART] == LOOKS["paper"].colour
    assert faces[30.0, -APART] == LOOKS["recommended"].colour
    assert [text.get_text() for text in ax.get_yticklabels()] == ["our losses", "paper's losses"]


def test_recorded_motion_has_a_row_of_its_own_where_it_has_a_value(ax: Axes):
    draw_measure(ax, of_all("above_chance", [0.1, 0.2, 0.3, 0.4, 0.5]), measure="above_chance")
    assert ax.get_yticklabels()[0].get_text() == LOOKS["recorded"].label
    assert (0.5, 0.0) in marks(ax)


def test_interval_is_drawn_only_where_there_is_one(ax: Axes):
    rows = of_all("fid", [10.0, 40.0, 12.0, 30.0, NAN])
    rows[1] = record("paper", "fid", 40.0, 35.0, 45.0)
    draw_measure(ax, rows, measure="fid")
    (interval,) = [line for line in ax.lines if line.get_gid() == "interval"]
    assert list(interval.get_xdata()) == [35.0, 45.0]
    assert list(interval.get_ydata()) == [1 - APART] * 2


def test_arrows_lead_from_without_to_with(ax: Axes):
    draw_measure(ax, of_all("fid", [10.0, 40.0, 12.0, 30.0, NAN]), measure="fid")
    arrows = [text for text in ax.texts if getattr(text, "arrow_patch", None) is not None]
    assert [(text.xyann[0], text.xy[0]) for text in arrows] == [(10.0, 40.0), (12.0, 30.0)]


def test_value_below_zero_is_within_the_axes(ax: Axes):
    draw_measure(ax, of_all("above_chance", [-0.3, 0.2, 0.1, 0.5, 0.4]), measure="above_chance")
    assert ax.get_xlim()[0] < -0.3


def both_measures(corpus: str = "made up") -> list[dict[str, object]]:
    means = {
        "above_chance": [0.1, 0.2, 0.3, 0.9, 0.4],
        "fid": [9.0, 8.0, 7.0, 6.0, NAN],
        "jerk": [1.0, 2.0, 3.0, 4.0, 5.0],
    }
    return [row for measure, values in means.items() for row in of_all(measure, values, corpus)]


@cases(
    "paper, ours, finding",
    (gain("paper", "fid", 1.0, 2.0), gain("recommended", "fid", 3.0, 1.0), "only our harmony term raises it"),
    (gain("paper", "fid", -3.0, 1.0), gain("recommended", "fid", 1.0, 2.0), "only the paper's harmony term lowers it"),
    (gain("paper", "fid", 3.0, 1.0), gain("recommended", "fid", 3.0, 1.0), "both harmony terms raise it"),
    (gain("paper", "fid", 1.0, 2.0), gain("recommended", "fid", -1.0, 2.0), "neither clearly changes it"),
)
def test_title_says_whose_change_is_larger_than_its_interval(paper, ours, finding: str):
    others = [gain(loss, "above_chance", 0.0, 1.0) for loss in ("paper", "recommended")]
    figure = ablation_figure(both_measures(), [paper, ours, *others])
    assert [ax.get_title(loc="left").split(":\n")[1] for ax in figure.axes] == ["neither clearly changes it", finding]


def test_ablation_has_a_row_of_panels_a_corpus_and_marks_only_the_synthetic_one():
    gains = [
        gain(loss, measure, 1.0, 0.5, corpus)
        for corpus in ("beatlocked", "synthetic")
        for loss in ("paper", "recommended")
        for measure in ("above_chance", "fid")
    ]
    figure = ablation_figure([*both_measures("beatlocked"), *both_measures("synthetic")], gains)
    assert [ax.get_title(loc="right").strip() for ax in figure.axes] == ["", "", "", "synthetic data"]
    assert "recordings on the beat" in figure.axes[0].get_title(loc="left")
    assert smallest_text(figure) >= 9


# The trade-off


def test_trade_off_has_a_mark_a_variant_with_both_intervals_and_small_ones_for_other_weights(ax: Axes):
    rows = both_measures()
    rows = [row for row in rows if (row["variant"], row["measure"]) != ("paper", "fid")]
    rows.append(record("paper", "fid", 8.0, -2.0, 18.0))
    draw_trade_off(ax, rows, [{"harmony_weight": 0.1, "above_chance": 0.6, "fid": 6.5}], measure="fid")
    assert {(9.0, 0.1), (8.0, 0.2), (7.0, 0.3), (6.0, 0.9)} < set(marks(ax))
    (interval,) = [line for line in ax.lines if line.get_gid() == "interval"]
    assert list(interval.get_xdata()) == [0.0, 18.0]  # a distance does not go below 0
    assert [text.get_text() for text in ax.texts] == ["0.1"]
    assert not [line for line in ax.lines if line.get_gid() == "sweep" and len(line.get_xdata()) > 1]


def test_titles_of_the_trade_off_are_changes_by_our_harmony_term():
    figure = trade_off_figure([*both_measures("one"), *both_measures("synthetic")])
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[:2] == ["One, our harmony term:\nharmony 0.30 → 0.90, jerk 3 → 4", "FID 7.0 → 6.0"]
    assert figure.axes[3].get_title(loc="right").strip() == "synthetic data"
    assert smallest_text(figure) >= 9


# Votes


def vote(judge: str, share: float, first: str = "paper", second: str = "recommended", n: int = 25) -> dict[str, object]:
    return {"first": first, "second": second, "judge": judge, "share": share, "n": n}


def test_votes_for_the_upper_name_lie_to_the_right(ax: Axes):
    draw_choices(ax, [vote("paper's harmony", 0.9), vote("above chance", 0.2)])
    shares = {line.get_label(): line.get_xdata() for line in ax.lines if not line.get_label().startswith("_")}
    np.testing.assert_allclose(shares["paper's harmony"], [0.1])
    np.testing.assert_allclose(shares["above chance"], [0.8])
    names = f"{LOOKS['recommended'].label}\nover {LOOKS['paper'].label}"
    assert [text.get_text() for text in ax.get_yticklabels()] == [names]
    assert [text.get_text() for text in ax.texts] == ["10%", "80%"]


def test_band_of_the_coin_narrows_with_the_root_of_the_number_of_units(ax: Axes):
    draw_choices(ax, [vote("paper's harmony", 0.5, n=49)])
    (band,) = [patch for patch in ax.patches if patch.get_label().startswith("a coin")]
    np.testing.assert_allclose(band.get_bbox().intervalx, [0.5 - 0.98 / 7, 0.5 + 0.98 / 7])


def test_votes_say_in_the_picture_that_nobody_was_asked():
    votes = [vote("above chance", 0.2), vote("paper's harmony", 0.9)]
    figure = forced_choice_figure([{**one, "corpus": "made up"} for one in votes])
    ours, papers = (LOOKS[name].label for name in ("recommended", "paper"))
    assert figure.axes[0].get_title(loc="left") == (
        "Made up, 25 units, no people asked:\n"
        f"“above chance” likes “{ours}” best\n“paper's harmony” likes “{papers}” best"
    )
    assert smallest_text(figure) >= 9


def test_looks_differ_in_mark_as_well_as_colour_and_take_no_colour_that_means_something_else():
    assert {look.colour for name, look in LOOKS.items() if name != "recorded"}.isdisjoint(map(to_hex, COLOURS.values()))
    assert LOOKS["paper"].marker != LOOKS["recommended"].marker
    assert [name for name, look in LOOKS.items() if not look.filled] == ["paper, without", "recommended, without"]
