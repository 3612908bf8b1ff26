"""A picture that hands on the places of clicks and taps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import anywidget
import traitlets


class ClickPicture(anywidget.AnyWidget):
    """A PNG; clicks and taps inside one area of it are handed on.

    Parameters
    ----------
    value : bytes, the PNG
    area : (left, top, right, bottom)
        The area in which clicks count, in shares of the picture's width and height, from its top left corner.
    hint : str
        Text beside the pointer there.
    on_click : callable
        ``on_click(x, y, width)``: the place as shares of the picture's width and height, and how many pixels of the
        screen (CSS pixels) the picture is wide.
    """

    _esm = Path(__file__).with_name("picture.js")
    value = traitlets.Bytes(b"").tag(sync=True)
    area = traitlets.List(traitlets.Float(), [0.0, 0.0, 1.0, 1.0]).tag(sync=True)
    hint = traitlets.Unicode("").tag(sync=True)

    def __init__(self, on_click: Callable[[float, float, float], object], **traits: object) -> None:
        super().__init__(**traits)
        self.on_msg(lambda _, content, __: on_click(*(float(content[name]) for name in ("x", "y", "width"))))
