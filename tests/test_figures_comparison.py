"""The picture of a comparison: a bar a system, chance, the paper's value, and no bar without a number."""

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.figures.variants import COMPARED, THIN, WIDE, comparison_figure, draw_compared
from study.saving import smallest_text


def row(system: str, kind: str, h: float, **more: Any) -> dict[str, Any]:
    about: dict[str, Any] = {"music": "songs", "corpus": "mine", "system": system, "kind": kind, "remark": ""}
    for measure in COMPARED:
        about |= {measure: h, f"{measure} low": np.nan, f"{measure} high": np.nan}
        about |= {f"{measure} chance": h - 0.1, f"{measure} paper": np.nan}
    return about | more


ROWS = [
    row("recorded, right song", "recorded", 0.3, **{"h low": 0.2, "h high": 0.4}),
    row("random pieces", "pieces", 0.35),
    row("Ren et al. 2020", "network", np.nan, remark="not trained well enough: speed", **{"h paper": 0.263}),
    row("HarmoGAN", "network", 0.5, **{"h paper": 0.352, "h low": 0.45, "h high": 0.55}),
]


@pytest.fixture
def ax() -> Axes:
    return draw_compared(Figure().add_subplot(), ROWS, measure="h")


def test_systems_have_wide_bars_and_dances_without_training_thin_ones_below(ax: Axes):
    bars = {round(bar.get_width(), 2): bar for bar in ax.patches}
    assert sorted(bars) == [0.3, 0.35, 0.5]
    assert bars[0.5].get_height() == pytest.approx(WIDE)
    assert [bars[0.3].get_height(), bars[0.35].get_height()] == pytest.approx([THIN, THIN])
    assert bars[0.5].get_y() < bars[0.3].get_y() < bars[0.35].get_y()
    assert ax.yaxis_inverted()


def test_every_bar_has_its_chance_and_those_with_an_interval_show_it(ax: Axes):
    marks = {gid: [line for line in ax.lines if line.get_gid() == gid] for gid in ("chance", "interval", "paper")}
    assert sorted(float(line.get_xdata()[0]) for line in marks["chance"]) == pytest.approx([0.2, 0.25, 0.4])
    assert sorted(tuple(line.get_xdata()) for line in marks["interval"]) == [(0.2, 0.4), (0.45, 0.55)]
    assert sorted(float(line.get_xdata()[0]) for line in marks["paper"]) == [0.263, 0.352]


def test_a_system_that_was_not_trained_well_enough_has_words_and_no_bar(ax: Axes):
    assert [text.get_text().strip() for text in ax.texts] == ["not trained well enough"]


def test_panels_are_those_of_the_paper_and_harmony_above_chance_for_each_contest():
    measured = [
        row(f"from {low}", "network", 0.6, **{"hit_rate low": low, "hit_rate high": 0.7}) for low in (0.45, 0.55)
    ]
    other = [{**one, "music": "other songs"} for one in (*ROWS, *measured)]  # chance is at .5
    figure = comparison_figure([*ROWS, *other])
    assert [ax.get_xlabel() for ax in figure.axes] == [*COMPARED.values()] * 2
    (title,) = [text.get_text() for text in figure.axes[3].texts if text.get_gid() == "title"]
    assert title == "Other songs; trained on mine:\n1 of 2 systems with an interval hit more beats than chance"
    assert smallest_text(figure) >= 9


def test_synthetic_is_written_on_the_panels_that_show_it_and_on_no_other():
    figure = comparison_figure([*({**one, "music": "synthetic songs"} for one in ROWS), *ROWS])
    assert [ax.get_title("right").strip() for ax in figure.axes] == ["", "", "synthetic data", "", "", ""]
