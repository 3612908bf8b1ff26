"""Draws a figure again and again, keeping the pixels of axes, ticks and labels, which rarely change.

They take most of the time in which matplotlib draws a plot. Each is kept as a transparent picture of its own, which
is laid down at its place in the drawing order, and drawn anew only when it would look different.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


def plain(figure: Figure) -> Pixels:
    """A figure as (height, width, 4) pixels, drawn once (savefig would draw it twice)."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


@dataclass
class QuickDraw:
    """Pictures of one figure, each as (height, width, 4) pixels.

    >>> figure = Figure()
    >>> ax = figure.subplots()
    >>> QuickDraw()(figure).shape
    (480, 640, 4)
    """

    _layers: dict[Hashable, tuple[Hashable, tuple[int, int, Pixels] | None]] = field(default_factory=dict)

    def __call__(self, figure: Figure) -> Pixels:
        """The figure as it is now."""
        artists = list(_slow_artists(figure))
        for key, artist, look in artists:
            artist.draw = self._kept(artist, look, key)
        try:
            return plain(figure)
        finally:
            for _, artist, _ in artists:
                del artist.draw  # the method of its class shows again

    def _kept(self, artist: Any, look: Callable[[Any], Hashable], key: Hashable) -> Callable[[RendererAgg], None]:
        """A stand-in for ``artist.draw`` that draws from memory where it can."""

        def draw(renderer: RendererAgg) -> None:
            canvas = (artist.figure.dpi, renderer.width, renderer.height)
            before, layer = self._layers.get(key, (None, None))
            if (canvas, look(artist)) != before:
                layer = _layer(artist, renderer)
                # Once more, because drawing makes new ticks.
                self._layers[key] = ((canvas, look(artist)), layer)
            if layer is not None:
                left, bottom, pixels = layer
                renderer.draw_image(renderer.new_gc(), left, bottom, pixels)
            artist.stale = False

        return draw


def _slow_artists(figure: Figure) -> Iterator[tuple[Hashable, Any, Callable[[Any], Hashable]]]:
    """(key, artist, function that returns its look) of each artist that is slow to draw."""
    for place, ax in enumerate(figure.axes):
        if ax.name != "rectilinear":
            continue  # the look of a polar or 3-D axis depends on more than is compared here
        yield (place, "x"), ax.xaxis, _axis_look
        yield (place, "y"), ax.yaxis, _axis_look


def _layer(artist: Artist, renderer: RendererAgg) -> tuple[int, int, Pixels] | None:
    """(left, bottom, pixels from the bottom up) of an artist alone; None if it draws nothing."""
    alone = RendererAgg(renderer.width, renderer.height, renderer.dpi)
    type(artist).draw(artist, alone)
    pixels = np.asarray(alone.buffer_rgba())
    rows, columns = np.nonzero(pixels[..., 3])
    if rows.size == 0:
        return None
    top, end = rows.min(), rows.max() + 1
    left, right = columns.min(), columns.max() + 1
    return int(left), int(renderer.height - end), pixels[top:end, left:right][::-1].copy()


def _axis_look(axis: Axis) -> Hashable:
    """Everything on which the pixels of an axis with its ticks, labels and grid depend."""
    places = axis.get_majorticklocs()
    return (
        axis.get_visible(),
        axis.axes.bbox.bounds,
        tuple(axis.get_view_interval()),
        axis.get_scale(),
        axis.get_label_text(),
        _text_look(axis.label),
        tuple(places),
        tuple(axis.get_major_formatter().format_ticks(list(places))),
        tuple(axis.get_minorticklocs()),
        repr(sorted(axis.get_tick_params().items())),
        repr(sorted(axis.get_tick_params(which="minor").items())),
        axis.offsetText.get_text(),
        tuple(
            (_text_look(tick.label1), tick.gridline.get_color(), tick.tick1line.get_color()) for tick in axis.majorTicks
        ),
    )


def _text_look(text: Any) -> Hashable:
    return text.get_visible(), text.get_color(), text.get_size(), text.get_rotation(), text.get_alpha()
