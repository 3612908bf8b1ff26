"""Diagrams: HarmoGAN in training (Fig. 7a), dancing a song (b), its networks part by part (c), and other networks.

Places and words of boxes and arrows are drawn once in ``diagrams.json`` (inches from the lower left corner);
sizes and weights in braces there are measured.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Outline

from harmolab.lab.figures.style import COLOURS, figure_style
from harmolab.systems.harmogan.params import TrainParams
from study.figures.variants import Records

DRAWING = Path(__file__).with_name("diagrams.json")
# Pale forms of the colours for music and movement, dark enough to be told apart without their edges.
TINTS = {"audio": "#D3E5F1", "motion": "#FBE5BC", "both": "#F2F2F2"}
_EDGES = {"audio": COLOURS["audio"], "motion": COLOURS["visual"], "both": COLOURS["chance"]}
_DASHES = (0, (4, 2))
_LINE = 0.155  # inches from one line of text to the next


def framework_figure(parts: Records, params: Mapping[str, TrainParams]) -> Figure:
    """Fig. 7a: training, with the size of each network and the weight of each loss.

    Parameters
    ----------
    parts : table, or its records, with the fields of `study.shapes.Part`
    params : name of a way to train -> its settings; their loss weights are written out, 0 is a term that is off
    """
    names = [name.removesuffix("_weight") for name in vars(TrainParams.paper()) if name.endswith("_weight")]
    weights = {name: ", ".join(f"{key} {_weight(each, name)}" for key, each in params.items()) for name in names}
    return diagram("framework", _sizes(parts) | {f"weight.{name}": text for name, text in weights.items()})


def dancing_figure() -> Figure:
    """Fig. 7b: from meter unit to meter unit of a song."""
    return diagram("dancing", {})


def networks_figure(parts: Records) -> Figure:
    """Fig. 7c: generator and discriminators side by side; `parts` as for `framework_figure`."""
    return diagram("networks", _sizes(parts))


def _weight(params: TrainParams, name: str) -> str:
    """A loss term's weight, and the discriminator it is for where only one counts."""
    weight = f"{getattr(params, f'{name}_weight'):g}"
    return f"{weight} ($D_{{st}}$ alone)" if name == "gan" and params.cross_domain_weight == 0 else weight


def _sizes(parts: Records) -> dict[str, str]:
    """Text for "network" (its parameters) and for "network.part" (layers, parameters and shape)."""
    texts, totals = {}, dict[str, int]()
    for part in pd.DataFrame(parts).to_dict("records"):
        network, count = part["network"], part["parameters"]
        totals[network] = totals.get(network, 0) + count
        layers = "" if part["layers"] in ("input", "output") else f"{part['layers']}, {count_text(count)}\nto "
        texts[f"{network}.{part['name']}"] = layers + part["shape"]
    return texts | {network: count_text(total) for network, total in totals.items()}


def count_text(count: int) -> str:
    """A number of parameters as it is read out.

    >>> count_text(23), count_text(1_234), count_text(139_392), count_text(8_123_456)
    ('23', '1.2 k', '139 k', '8.1 M')
    """
    for unit, sign in ((1_000_000, " M"), (1_000, " k")):
        if count >= unit:
            value = count / unit
            return f"{value:.1f}{sign}" if value < 99.95 else f"{value:.0f}{sign}"
    return str(count)


def diagram(name: str, values: Mapping[str, str]) -> Figure:
    """The drawing of that name, with `values` in place of the words in braces."""
    text = DRAWING.read_text("utf-8")
    filled = re.sub(r"\{([\w. ]+)\}", lambda m: json.dumps(values.get(m[1], m[0]))[1:-1], text)
    return drawing_figure(json.loads(filled)[name])


def drawing_figure(drawing: Mapping[str, Any]) -> Figure:
    """A figure that is nothing but a drawing as for `draw_diagram`; "size" is its width and height in inches."""
    width, height = drawing["size"]
    with figure_style():
        figure = Figure(figsize=(width, height))
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width), ylim=(0.0, height))
        ax.axis("off")
        draw_diagram(ax, drawing)
    return figure


def draw_diagram(ax: Axes, drawing: Mapping[str, Sequence[Any]]) -> Axes:
    """Boxes, arrows and words of a drawing.

    Parameters
    ----------
    ax : Axes in inches
    drawing : lists by name, all optional: "signals" (sharp corners) and "parts" (round ones) of [x, y of the middle,
        width, name in `TINTS`, lines of text]; "arrows", "dashed" and "lines" of corners [x, y]; "joins" of [x, y];
        "hatched" of [x, y, width, height]; "titles" and "labels" of [x, y, text]
    """
    for kind, corners in (("signals", "square,pad=0"), ("parts", "round,pad=0,rounding_size=0.08")):
        for x, y, width, tint, *lines in drawing.get(kind, ()):
            _draw_box(ax, (x, y), width, tint, "\n".join(lines).split("\n"), corners)
    for kind, style in (("arrows", "-"), ("dashed", _DASHES), ("lines", "-")):
        for points in drawing.get(kind, ()):
            _draw_arrow(ax, points, style, "-" if kind == "lines" else "-|>")
    plus = {"boxstyle": "circle,pad=0.08", "facecolor": "white", "edgecolor": COLOURS["ink"]}
    for x, y in drawing.get("joins", ()):
        ax.text(x, y, "+", ha="center", va="center", fontsize=11, bbox=plus, zorder=3)
    for x, y, width, height in drawing.get("hatched", ()):
        look: dict[str, Any] = {"facecolor": TINTS["motion"], "edgecolor": COLOURS["visual"], "linewidth": 0}
        ax.add_patch(Rectangle((x, y), width, height, hatch="///", zorder=3, **look))
    for kind, size in (("titles", 11), ("labels", 9)):
        for x, y, text in drawing.get(kind, ()):
            ax.text(x, y, text, va="center", fontsize=size, color=COLOURS["ink"])
    return ax


def box_height(lines: Sequence[str]) -> float:
    """Inches, as high as the lines need."""
    return (_LINE * len(lines) if lines[0] else 0.0) + 0.13


def _draw_box(ax: Axes, middle: tuple[float, float], width: float, tint: str, lines: Sequence[str], style: str) -> None:
    """A box as high as its lines need, the first of them bold."""
    (x, y), height = middle, box_height(lines)
    look: dict[str, Any] = {"boxstyle": style, "facecolor": TINTS[tint], "edgecolor": _EDGES[tint], "gid": "box"}
    ax.add_patch(FancyBboxPatch((x - width / 2, y - height / 2), width, height, zorder=2, **look))
    for row, line in enumerate(lines):
        up = y + _LINE * ((len(lines) - 1) / 2 - row)
        weight = "normal" if row else "bold"
        ax.text(x, up, line, ha="center", va="center", fontsize=8.5, weight=weight, color=COLOURS["ink"], zorder=3)


def _draw_arrow(ax: Axes, points: Sequence[tuple[float, float]], line: Any, head: str) -> None:
    """Straight pieces from the first point to the last."""
    outline = Outline(list(points), [Outline.MOVETO, *[Outline.LINETO] * (len(points) - 1)])
    look: dict[str, Any] = {"mutation_scale": 9, "linewidth": 1.1, "color": COLOURS["ink"], "joinstyle": "miter"}
    look |= {"arrowstyle": head, "linestyle": line, "shrinkA": 0, "shrinkB": 0, "zorder": 1, "gid": "arrow"}
    ax.add_patch(FancyArrowPatch(path=outline, **look))
