"""Kept pixels: the same picture as matplotlib's own, whatever changed, with less work."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.figure import Figure

from harmolab.lab.widgets.quickdraw import QuickDraw, plain

# Laying a transparent picture over another rounds each colour once more.
ROUNDING = 2


@pytest.fixture
def figure() -> Figure:
    figure = Figure(figsize=(4, 3), dpi=80)
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.fill_between([0, 1, 2], [0, 3, 1], alpha=0.4, label="speed")
    upper.legend(loc="upper right")
    lower.plot([0, 1, 2], [5, 1, 3], label="beats")
    lower.set(xlabel="time (s)", ylabel="speed (m/s)", title="planted")
    return figure


def largest_difference(first: np.ndarray, second: np.ndarray) -> int:
    assert first.shape == second.shape
    return int(np.abs(first.astype(int) - second.astype(int)).max())


Change = Callable[[Axes, Axes], object]  # of the upper axes, which have a legend and share x, or of the lower ones
CHANGES: dict[str, list[Change]] = {
    "limits": [lambda upper, lower: lower.plot([0, 9], [0, 40]), lambda upper, lower: upper.set_xlim(-3, 3)],
    "label": [
        lambda upper, lower: upper.set_ylabel("strength"),
        lambda upper, lower: lower.yaxis.label.set_color("red"),
    ],
    "grid": [lambda upper, lower: lower.grid(True)],
    "ticks": [
        lambda upper, lower: lower.set_yticks([1, 2.5]),
        lambda upper, lower: lower.set_yticks([1, 2.5], ["one", "two"]),
        lambda upper, lower: lower.minorticks_on(),
    ],
    "tick colours": [
        lambda upper, lower: upper.get_yticklabels()[1].set_color("red"),
        lambda upper, lower: upper.tick_params(colors="red"),
    ],
    "scale": [lambda upper, lower: lower.set_yscale("log")],
    "hidden": [lambda upper, lower: lower.xaxis.set_visible(False), lambda upper, lower: lower.set_axis_off()],
    "place": [
        lambda upper, lower: lower.set_title("another"),
        lambda upper, lower: lower.set_position((0.3, 0.3, 0.4, 0.4)),
    ],
    "canvas": [lambda upper, lower: upper.figure.set_size_inches(3, 2), lambda upper, lower: upper.figure.set_dpi(60)],
    "another axes": [lambda upper, lower: lower.twinx().set_ylabel("right")],
    "legend of an area": [
        lambda upper, lower: upper.legend(["renamed"], loc="upper right"),
        lambda upper, lower: upper.legend(["renamed"], loc="lower left"),
        lambda upper, lower: upper.collections[0].set_color("red") or upper.legend(loc="lower left"),
        lambda upper, lower: upper.get_legend().remove(),
    ],
    "legend of a line": [
        lambda upper, lower: lower.legend(loc="lower left"),
        lambda upper, lower: lower.lines[0].set_color("red") or lower.legend(loc="lower left"),
    ],
}


@pytest.mark.parametrize("kind", CHANGES)
def test_picture_after_each_change_is_the_one_that_matplotlib_draws(figure: Figure, kind: str):
    quick, before = QuickDraw(), plain(figure)
    assert largest_difference(quick(figure), before) <= ROUNDING
    for number, change in enumerate(CHANGES[kind]):
        change(*figure.axes[:2])
        fresh, kept = quick(figure), quick(figure)
        expected = plain(figure)
        assert expected.shape != before.shape or largest_difference(expected, before) > ROUNDING, number
        assert largest_difference(fresh, expected) <= ROUNDING, number
        assert largest_difference(kept, expected) <= ROUNDING, number
        before = expected


def test_axes_that_did_not_change_are_drawn_only_once(figure: Figure, monkeypatch: pytest.MonkeyPatch):
    drawn = []
    for kind in (XAxis, YAxis):
        original = kind.draw
        monkeypatch.setattr(kind, "draw", lambda axis, *rest, o=original: (drawn.append(axis), o(axis, *rest)))
    quick = QuickDraw()
    quick(figure)
    assert len(drawn) == 4
    figure.axes[1].lines[0].set_color("red")
    quick(figure)
    assert len(drawn) == 4
    figure.axes[1].set_ylabel("another")
    quick(figure)
    assert drawn[4:] == [figure.axes[1].yaxis]


def test_figure_keeps_nothing_of_the_quick_drawing(figure: Figure):
    QuickDraw()(figure)
    artists = [*(axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)), figure.axes[0].get_legend()]
    assert [artist for artist in artists if "draw" in vars(artist)] == []


def test_axes_in_three_dimensions_are_drawn_afresh(figure: Figure):
    figure.clear()
    ax = figure.add_subplot(projection="3d")
    ax.plot([0, 1], [0, 1], [0, 1])
    quick = QuickDraw()
    quick(figure)
    ax.view_init(elev=70, azim=10)
    assert largest_difference(quick(figure), plain(figure)) == 0
