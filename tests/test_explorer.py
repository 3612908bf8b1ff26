"""The Explorer: values to picture, and picture to bundle."""

from __future__ import annotations

import base64
from collections.abc import Callable

import ipywidgets
import pytest
from matplotlib.figure import Figure

from harmolab.lab.figures.style import figure_style
from harmolab.lab.widgets.explorer import Explorer

PNG = b"\x89PNG\r\n"


def draw_level(level: float, figure: Figure | None = None) -> Figure:
    """A horizontal line at `level`, on the axes of last time if there are some."""
    figure = Figure(figsize=(3, 2)) if figure is None else figure
    (ax,) = figure.axes or [figure.subplots()]
    ax.axhline(level)
    ax.set_ylim(0, 10)
    return figure


def draw_fresh(level: float) -> Figure:
    """The same line on a figure of its own."""
    return draw_level(level)


def draw_new_axes(level: float, figure: Figure) -> Figure:
    """The same line by a function that knows nothing of keeping axes."""
    ax = figure.subplots()
    ax.axhline(level)
    ax.set_ylim(0, 10)
    return figure


@pytest.mark.parametrize("draw", [draw_level, draw_fresh, draw_new_axes])
def test_moving_a_control_changes_the_picture_and_moving_it_back_restores_it(draw: Callable[..., Figure]):
    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    first = explorer.png
    explorer.controls["level"].value = 7.5
    assert explorer.values == {"level": 7.5}
    assert explorer.png.startswith(PNG)
    assert explorer.png != first
    explorer.controls["level"].value = 2.0
    assert explorer.png == first


def test_axes_that_are_kept_hold_only_the_latest_drawing():
    seen = []

    def draw(level: float, figure: Figure) -> Figure:
        draw_level(level, figure).axes[0].text(0.5, 0.5, "a")
        seen.append((figure.axes[0], [line.get_ydata()[0] for line in figure.axes[0].lines], len(figure.axes[0].texts)))
        return figure

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert [state[1:] for state in seen] == [([2.0], 1), ([3.0], 1)]
    assert seen[0][0] is seen[1][0]


def test_picture_equals_the_one_that_draw_makes_when_called_directly():
    explorer = Explorer(draw_fresh, level=(0, 10, 1, 2))
    explorer.controls["level"].value = 9
    assert explorer.png == Explorer(draw_fresh, level=(0, 10, 1, 9)).png


def test_figure_made_by_pyplot_is_closed_after_its_picture_was_taken():
    from matplotlib import pyplot

    def draw(level: float) -> Figure:
        figure, ax = pyplot.subplots()
        ax.axhline(level)
        return figure

    before = pyplot.get_fignums()
    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert pyplot.get_fignums() == before


def test_mime_bundle_holds_the_picture_beside_the_live_widget():
    explorer = Explorer(draw_level, level=(0.0, 10.0, 0.5, 2.0))
    bundle = explorer._repr_mimebundle_()
    assert base64.b64decode(bundle["image/png"]) == explorer.png
    assert "application/vnd.jupyter.widget-view+json" in bundle


@pytest.mark.parametrize(
    ("spec", "kind", "value"),
    [
        ((0.0, 1.0, 0.25, 0.5), ipywidgets.FloatSlider, 0.5),
        ((0, 8, 2, 4), ipywidgets.IntSlider, 4),
        (True, ipywidgets.Checkbox, True),
        (["valleys", "peaks"], ipywidgets.Dropdown, "valleys"),
        ({"low": 0.1, "high": 0.9}, ipywidgets.Dropdown, 0.1),
    ],
)
def test_each_kind_of_control_becomes_its_widget_with_a_label(spec: object, kind: type, value: object):
    explorer = Explorer(lambda reaction_delay: Figure(), reaction_delay=spec)
    control = explorer.controls["reaction_delay"]
    assert type(control) is kind
    assert control.description == "reaction delay"
    assert explorer.values == {"reaction_delay": value}


def test_sliders_follow_while_they_are_dragged():
    explorer = Explorer(draw_level, level=(0.0, 10.0, 0.5, 2.0))
    assert explorer.controls["level"].continuous_update is True


@pytest.mark.parametrize("spec", [(5.0, 1.0, 0.1, 2.0), (0.0, 1.0, 0.1, 2.0), (0.0, 1.0), [], "text", 3.0])
def test_control_that_means_nothing_is_refused_by_name(spec: object):
    with pytest.raises(ValueError, match="control 'level' must be"):
        Explorer(draw_level, level=spec)


def test_error_in_the_first_drawing_is_raised():
    def draw(level: float) -> Figure:
        raise KeyError(level)

    with pytest.raises(KeyError):
        Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))


def test_later_error_is_shown_with_its_place_and_goes_when_the_next_drawing_succeeds():
    def draw(level: float) -> Figure:
        if level > 5:
            raise ValueError("level <5> exceeded")
        return draw_fresh(level)

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    first = explorer.png
    explorer.controls["level"].value = 6.0
    assert explorer.error.startswith("ValueError: level <5> exceeded (test_explorer.py, line ")
    assert explorer.png == first
    explorer.controls["level"].value = 3.0
    assert explorer.error == ""
    assert explorer.png != first


def test_change_that_arrives_while_drawing_leads_to_one_more_picture():
    drawn = []

    def draw(level: float) -> Figure:
        drawn.append(level)
        if level == 3.0:  # as if the reader had moved on twice meanwhile
            explorer.controls["level"].value = 4.0
            explorer.controls["level"].value = 5.0
        return draw_fresh(level)

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert drawn == [2.0, 3.0, 5.0]


def test_pictures_are_drawn_in_the_style_of_the_project():
    def draw(level: float) -> Figure:
        figure = draw_fresh(level)
        shown.append(figure.axes[0].spines["top"].get_visible())
        return figure

    shown: list[bool] = []
    Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    with figure_style():
        expected = draw_fresh(2.0).axes[0].spines["top"].get_visible()
    assert shown == [expected] == [False]
