"""A picture that tells where it is clicked or tapped."""

from __future__ import annotations

from collections.abc import Callable

import anywidget
import traitlets

SCRIPT = """
function render({ model, el }) {
  const image = document.createElement("img");
  let address = "";
  const show = () => {
    URL.revokeObjectURL(address);
    address = URL.createObjectURL(new Blob([model.get("value")], { type: "image/png" }));
    image.src = address;
  };
  const place = (event) => {
    const frame = image.getBoundingClientRect();
    const [x, y] = [(event.clientX - frame.left) / frame.width, (event.clientY - frame.top) / frame.height];
    const [left, top, right, bottom] = model.get("area");
    return { x, y, width: frame.width, inside: left <= x && x <= right && top <= y && y <= bottom };
  };
  image.className = "widget-image";
  image.style.maxWidth = "none";
  image.style.width = "100%";
  image.alt = model.get("hint");
  image.addEventListener("pointermove", (event) => {
    const { inside } = place(event);
    image.style.cursor = inside ? "pointer" : "";
    image.title = inside ? model.get("hint") : "";
  });
  image.addEventListener("click", (event) => {
    const { x, y, width, inside } = place(event);
    if (inside) model.send({ x, y, width });
  });
  model.on("change:value", show);
  show();
  el.append(image);
  return () => {
    model.off("change:value", show);
    URL.revokeObjectURL(address);
  };
}
export default { render };
"""


class ClickPicture(anywidget.AnyWidget):
    """A PNG; clicks and taps inside one area of it are handed on.

    Parameters
    ----------
    value : bytes, the PNG
    area : (left, top, right, bottom)
        Where clicks count, in shares of the picture's width and height, from its top left corner.
    hint : str
        What the pointer says there.
    on_click : callable
        ``on_click(x, y, width)``: the place as shares of the picture's width and height, and how many pixels of the
        screen (CSS pixels) the picture is wide.
    """

    _esm = SCRIPT
    value = traitlets.Bytes(b"").tag(sync=True)
    area = traitlets.List(traitlets.Float(), [0.0, 0.0, 1.0, 1.0]).tag(sync=True)
    hint = traitlets.Unicode("").tag(sync=True)

    def __init__(self, on_click: Callable[[float, float, float], object], **traits: object) -> None:
        super().__init__(**traits)
        self.on_msg(lambda _, content, __: on_click(*(float(content[name]) for name in ("x", "y", "width"))))
