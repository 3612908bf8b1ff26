"""A picture with controls: live in JupyterLab, an ordinary image in a static report."""

from __future__ import annotations

import base64
import html
import inspect
import struct
import traceback
import warnings
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from numpy.typing import NDArray

from harmolab.lab.figures.style import figure_style
from harmolab.lab.widgets.quickdraw import QuickDraw, plain

NARROWEST, WIDEST = "640px", "900px"
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
LOOK: Mapping[str, Any] = MappingProxyType({"style": {"description_width": "initial"}, "layout": {"width": "21em"}})


class Explorer(widgets.VBox):
    """Controls above one picture, which is drawn again whenever a control moves.

    Parameters
    ----------
    draw : callable
        ``draw(**values)`` returns a matplotlib Figure. If it also takes ``figure=``, it is given the same Figure every
        time, the axes of the last drawing still on it but emptied. A draw that starts with
        ``axes = figure.axes or figure.subplots(2, 1)`` takes half the time of one that makes its axes anew, and
        axis limits and labels that stay as they were cost nothing; a legend is drawn anew each time.
    **controls
        One per argument of `draw`: a widget; True or False (checkbox); ``(low, high, step, value)`` (slider, of whole
        numbers if all four are); a list, or a dict of label -> value, of choices (menu, the first one chosen).

    Notes
    -----
    Its mime bundle holds the picture as ``image/png`` beside the live widget, so a notebook executed without widget
    state shows the picture in any viewer, with no script and no network. An error in the first drawing is raised; one
    that a control causes later is shown above the picture, which then stays as it was.

    Examples
    --------
    >>> explorer = Explorer(draw_sine, hertz=(0.5, 4.0, 0.5, 1.0), damped=False)  # doctest: +SKIP
    >>> explorer.values  # doctest: +SKIP
    {'hertz': 1.0, 'damped': False}
    """

    def __init__(self, draw: Callable[..., Figure], /, **controls: Any) -> None:
        self._draw = draw
        self._figure = _reusable_figure(draw)
        self._keeps_axes = True
        self._pixels = QuickDraw()
        self._controls = {name: control(name, spec, LOOK) for name, spec in controls.items()}
        self._drawing = self._stale = False
        self._message = widgets.HTML(layout={"display": "none"})
        self._image = widgets.Image(value=self._render(), format="png")
        # On a phone the picture goes on beyond the screen's edge: any narrower it could not be read.
        self._image.layout.min_width, self._image.layout.max_width = NARROWEST, "none"
        self._image.layout.width = "100%"
        frame = widgets.Box([self._image], layout={"overflow": "auto", "max_width": WIDEST})
        panel = widgets.Box(list(self._controls.values()), layout={"flex_flow": "row wrap"})
        super().__init__([panel, self._message, frame])
        for widget in self._controls.values():
            widget.observe(self._redraw, names="value")

    @property
    def values(self) -> dict[str, Any]:
        """Values of the controls by name."""
        return {name: widget.value for name, widget in self._controls.items()}

    @property
    def controls(self) -> Mapping[str, Any]:
        """The widgets by name; setting ``.value`` on one draws the picture again."""
        return dict(self._controls)

    @property
    def png(self) -> bytes:
        """The current picture."""
        return bytes(self._image.value)

    @property
    def error(self) -> str:
        """Error of the latest drawing as text; empty if there was none."""
        return html.unescape(self._message.value.removeprefix("<pre>").removesuffix("</pre>"))

    def _redraw(self, _change: object = None) -> None:
        """Draws the current values; changes that arrive meanwhile lead to one more picture, not to one each."""
        self._stale = True
        if self._drawing:
            return
        self._drawing = True
        try:
            while self._stale:
                self._stale = False
                self._show()
        finally:
            self._drawing = False

    def _show(self) -> None:
        try:
            self._image.value = self._render()
        except Exception as error:  # noqa: BLE001  # whatever draw() raises, the reader has to see it
            self._complain(error)
        else:
            self._message.value = ""
            self._message.layout.display = "none"

    def _complain(self, error: Exception) -> None:
        """Shows an error above the picture."""
        self._message.value = f"<pre>{html.escape(_where(error))}</pre>"
        self._message.layout.display = "block"

    def _render(self) -> bytes:
        """The picture of the current values, as PNG."""
        with figure_style():
            if self._figure is not None:
                return _png(self._pixels(self._draw_again(self._figure)))
            figure = self._draw(**self.values)
            try:
                return _png(plain(figure))
            finally:
                pyplot.close(figure)  # otherwise the notebook shows it a second time, under the cell

    def _draw_again(self, figure: Figure) -> Figure:
        """Lets `draw` fill the figure that is used every time."""
        if not self._keeps_axes:
            figure.clear()
        _empty_axes(figure)
        before = len(figure.axes)
        self._draw(**self.values, figure=figure)
        if 0 < before < len(figure.axes):
            self._keeps_axes = False  # this draw makes new axes every time: the old ones must go first
            return self._draw_again(figure)
        if not before and isinstance(figure.get_layout_engine(), PlaceHolderLayoutEngine | None):
            _fit_margins(figure)
        return figure

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        bundle = super()._repr_mimebundle_(**kwargs)
        return {**(bundle or {}), "image/png": base64.b64encode(self.png).decode("ascii")}


def _reusable_figure(draw: Callable[..., Figure]) -> Figure | None:
    """The figure to hand to `draw`, or None if it wants none. Its margins are fitted when its axes are new."""
    if "figure" not in inspect.signature(draw).parameters:
        return None
    figure = Figure(figsize=(9.0, 4.5), dpi=90)
    figure.set_layout_engine("none")
    return figure


def _empty_axes(figure: Figure) -> None:
    """Removes what was drawn and leaves axes, ticks and labels, which are slow to make."""
    for ax in figure.axes:
        artists = (*ax.lines, *ax.patches, *ax.collections, *ax.images, *ax.texts, *ax.artists, *ax.tables)
        for artist in (*artists, *filter(None, [ax.get_legend()])):
            artist.remove()
        ax.containers.clear()
        ax.relim()
        ax.set_prop_cycle(None)
    for artist in (*figure.texts, *figure.legends):
        artist.remove()


def _fit_margins(figure: Figure) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*not compatible with tight_layout", category=UserWarning)
        figure.tight_layout()


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """(H, W, 4) pixels as a PNG, each row stored as its difference to the row above.

    Pillow tries five ways to store each row, for the sake of smaller files, which takes twice as long as all the rest.
    """
    height, width = pixels.shape[:2]
    colours = np.empty((height, width, 3), np.uint8)
    for channel in range(3):  # a slice of all three would be copied pixel by pixel, ten times as slowly
        colours[..., channel] = pixels[..., channel]
    flat = colours.reshape(height, 3 * width)
    rows = np.empty((height, 1 + 3 * width), np.uint8)
    rows[:, 0] = 2  # the filter "up"
    rows[0, 1:] = flat[0]
    np.subtract(flat[1:], flat[:-1], out=rows[1:, 1:])
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    # Light compression: the picture travels a few centimetres.
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 1)), (b"IEND", b""))
    return PNG_SIGNATURE + b"".join(map(_chunk, *zip(*chunks, strict=True)))


def _chunk(kind: bytes, data: bytes) -> bytes:
    """One chunk of a PNG file: length, kind, data, checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _where(error: Exception) -> str:
    """The error with the place it came from, such as 'ValueError: delay must be positive (beats.py, line 41)'."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def control(name: str, spec: Any, look: Mapping[str, Any]) -> Any:
    """The widget that `spec` describes as for `Explorer`, labelled with `name` unless `look` has a "description"."""
    if isinstance(spec, widgets.Widget):
        return spec
    look = {"description": name.replace("_", " "), **look}
    if isinstance(spec, bool):
        return widgets.Checkbox(value=spec, indent=False, **look)
    if isinstance(spec, list | dict) and spec:
        return widgets.Dropdown(options=list(spec.items()) if isinstance(spec, dict) else spec, **look)
    if isinstance(spec, tuple) and len(spec) == 4:
        low, high, step, value = spec
        if low < high and step > 0 and low <= value <= high:
            whole = all(isinstance(number, int) for number in spec)
            slider = widgets.IntSlider if whole else widgets.FloatSlider
            return slider(min=low, max=high, step=step, value=value, **look)
    raise ValueError(
        f"control {name!r} must be a widget, True or False, a list or dict of choices, or (low, high, step, value) "
        f"with low <= value <= high; got {spec!r}"
    )
