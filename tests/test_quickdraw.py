"""Kept pixels: the same picture as matplotlib's own, whatever changed, with less work."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.figure import Figure

from harmolab.widgets.quickdraw import QuickDraw, plain

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


CHANGES: dict[str, Callable[[Axes], object]] = {
    "nothing": lambda ax: None,
    "a longer curve": lambda ax: ax.plot([0, 9], [0, 40]),
    "limits": lambda ax: ax.set_xlim(-3, 3),
    "label": lambda ax: ax.set_ylabel("strength"),
    "label colour": lambda ax: ax.yaxis.label.set_color("red"),
    "grid": lambda ax: ax.grid(True),
    "tick places": lambda ax: ax.set_yticks([1, 2.5]),
    "tick names": lambda ax: ax.set_yticks([1, 2], ["one", "two"]),
    "tick colour": lambda ax: ax.tick_params(colors="red"),
    "one tick colour": lambda ax: ax.get_yticklabels()[1].set_color("red"),
    "minor ticks": lambda ax: ax.minorticks_on(),
    "scale": lambda ax: ax.set_yscale("log"),
    "hidden axis": lambda ax: ax.xaxis.set_visible(False),
    "everything hidden": lambda ax: ax.set_axis_off(),
    "title": lambda ax: ax.set_title("another"),
    "new legend": lambda ax: ax.legend(loc="lower left"),
    "legend text": lambda ax: ax.legend(["renamed"], loc="upper right"),
    "legend colour": lambda ax: (ax.collections or ax.lines)[0].set_color("red") or ax.legend(loc="upper right"),
    "legend gone": lambda ax: ax.get_legend() and ax.get_legend().remove(),
    "place of the axes": lambda ax: ax.set_position((0.3, 0.3, 0.4, 0.4)),
    "size": lambda ax: ax.figure.set_size_inches(3, 2),
    "resolution": lambda ax: ax.figure.set_dpi(60),
    "another axes": lambda ax: ax.twinx().set_ylabel("right"),
}


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("change", CHANGES)
def test_picture_after_a_change_is_the_one_that_matplotlib_draws(figure: Figure, change: str, row: int):
    quick = QuickDraw()
    quick(figure)
    CHANGES[change](figure.axes[row])
    assert largest_difference(quick(figure), plain(figure)) <= ROUNDING
    assert largest_difference(quick(figure), plain(figure)) <= ROUNDING


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
