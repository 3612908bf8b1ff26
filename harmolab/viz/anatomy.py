"""The networks as diagrams (Fig. 7c): boxes are parts that learn, a plus joins features, arrows were measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from harmolab.viz.boxes import DASHES, count_text, draw_arrow, draw_box, inch_axes, shape_text, tint_legend
from harmolab.viz.style import COLOURS, figure_style

__all__ = ["Node", "draw_network", "networks_figure", "nodes_of"]

LANE, BOX, JOINT = 1.66, 1.46, 0.11  # inches: from lane to lane, width of a box, radius of a plus
FORK = 0.19  # from a plus down to where its arrows part
BOX_LEVEL, JOINT_LEVEL = 0.83, 0.5  # height of a level with boxes, of one with pluses only
SHAPES = "shapes of one unit: frames \N{MULTIPLICATION SIGN} channels; Conv1d: channels \N{MULTIPLICATION SIGN} frames"

TITLES = {
    "generator": "generator $G$",
    "cross_domain": "discriminator $D_{cd}$",
    "spatial_temporal": "discriminator $D_{st}$",
}
# Words for names in the code, and the lane from the left in which each box stands.
_WORDS: dict[str, dict[str, tuple[str, float]]] = {
    "generator": {
        "audio": ("music $A_f$", 0.0),
        "initial": ("initial poses $V_f$", 2.0),
        "hearing": ("music near a frame", 0.0),
        "encoder": ("audio encoder", 0.0),
        "seeing": ("pose features", 2.0),
        "decoder": ("pose decoder", 1.0),
        "flat_head": ("2-D poses", 0.0),
        "depth_head": ("depth lifting", 1.0),
        "path_head": ("path of the root", 2.0),
        "motion": ("motion $V'$", 1.0),
        "flat": ("2-D poses $V'_{2d}$", 0.0),
    },
    "cross_domain": {
        "audio": ("music $A_f$", 0.0),
        "motion": ("motion", 1.0),
        "hearing": ("music branch", 0.0),
        "seeing": ("motion branch", 1.0),
        "both": ("joint features", 0.5),
        "verdict": ("verdict", 0.5),
        "output": ("true pair?", 0.5),
    },
    "spatial_temporal": {
        "motion": ("motion", 0.0),
        "seeing": ("each of 5 segments", 0.0),
        **{f"joining.{step}": (f"segments 1 to {step + 2}", 1.0) for step in range(9)},
        "verdict": ("verdict", 1.0),
        "output": ("recorded motion?", 1.0),
    },
}


class Part(Protocol):
    """What a part of a network tells: `harmolab.models.anatomy.Part`."""

    @property
    def name(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def input(self) -> tuple[int, ...]: ...
    @property
    def output(self) -> tuple[int, ...]: ...
    @property
    def parameters(self) -> int: ...
    @property
    def sources(self) -> tuple[str, ...]: ...


@dataclass(frozen=True)
class Node:
    """A box or, without a part, a plus that joins features. `level` counts from the top, `lane` from the left."""

    name: str
    sources: tuple[str, ...]
    level: int
    lane: float
    part: Part | None = None


def nodes_of(parts: Sequence[Part], lanes: Mapping[str, float]) -> dict[str, Node]:
    """Boxes and pluses by name, sources first. Parts that are made of the same features share a plus.

    A plus takes in another where it joins all that the other joins: that is how skip connections appear. What an output
    takes straight from an input is left to the text in its box.
    """
    inputs = {part.name for part in parts if part.kind == "input"}
    fed = {part.name: _drawn_sources(part, inputs) for part in parts}
    joins = sorted(
        {frozenset(names) for names in fed.values() if len(names) > 1}, key=lambda join: (len(join), sorted(join))
    )
    members = {join: _members(join, joins[:place]) for place, join in enumerate(joins)}
    links = {name: (_name(frozenset(names)),) if len(names) > 1 else names for name, names in fed.items()}
    links |= {_name(join): names for join, names in members.items()}
    places: dict[str, float] = {}
    for part in parts:  # one that was given no lane stands below what feeds it
        above = [places[name] for name in fed[part.name]]
        places[part.name] = lanes.get(part.name, sum(above) / len(above) if above else 0.0)
    for join in joins:
        users = [places[name] for name, names in fed.items() if frozenset(names) == join]
        places[_name(join)] = sum(users) / len(users)
    by_name = {part.name: part for part in parts}
    levels = {name: _level(name, links) for name in links}
    bottom = max(levels.values())
    levels |= {part.name: bottom for part in parts if part.kind == "output"}
    order = sorted(links, key=lambda name: levels[name])
    return {name: Node(name, links[name], levels[name], places[name], by_name.get(name)) for name in order}


def _drawn_sources(part: Part, inputs: set[str]) -> tuple[str, ...]:
    return tuple(name for name in part.sources if part.kind != "output" or name not in inputs)


def _name(join: Iterable[str]) -> str:
    return "+".join(sorted(join))


def _members(join: frozenset[str], smaller: Sequence[frozenset[str]]) -> tuple[str, ...]:
    """What flows into a plus, where the largest plus that it contains stands for all of its features."""
    inside = max((other for other in smaller if other < join), key=len, default=frozenset())
    return (*sorted(join - inside), *([_name(inside)] if inside else []))


def _level(name: str, links: Mapping[str, tuple[str, ...]]) -> int:
    """Steps from the inputs by the longest way."""
    return max((1 + _level(source, links) for source in links[name]), default=0)


def draw_network(ax: Axes, parts: Sequence[Part], network: str) -> Axes:
    """One network from its inputs, at the top, to its outputs.

    Parameters
    ----------
    ax : Axes in inches, see `harmolab.viz.boxes.inch_axes`
    parts : records of `harmolab.models.anatomy`
    network : "generator", "cross_domain" or "spatial_temporal"
    """
    words = _WORDS[network]
    nodes = nodes_of(parts, {name: lane for name, (_, lane) in words.items()})
    middles = _middles(nodes, ax.get_ylim()[1])
    about = {name: _about(name, nodes) for name in nodes}
    batch = next(part.output[0] for part in parts if part.kind == "input")
    halves = dict.fromkeys(nodes, JOINT)
    for name, node in nodes.items():
        if node.part is None:
            circle = {"boxstyle": "circle,pad=0.08", "facecolor": "white", "edgecolor": COLOURS["ink"]}
            ax.text(*middles[name], "+", ha="center", va="center", fontsize=11, bbox=circle, zorder=3)
        else:
            lines = [words.get(name, (name, 0.0))[0], *_facts(node.part, batch)]
            signal = node.part.kind in ("input", "output")
            halves[name] = draw_box(ax, middles[name], lines, tint=about[name], width=BOX, rounded=not signal)
    for name, node in nodes.items():
        for source in node.sources:
            _connect(ax, source, name, nodes, middles, halves)
    total = sum(part.parameters for part in parts)
    ax.set_title(f"{TITLES[network]}: {count_text(total)} parameters", loc="left")
    return ax


def _middles(nodes: Mapping[str, Node], top: float) -> dict[str, tuple[float, float]]:
    """Where each node stands, inches."""
    levels = sorted({node.level for node in nodes.values()})
    tall = [any(node.part and node.level == level for node in nodes.values()) for level in levels]
    heights, y = {}, top
    for level, boxes in zip(levels, tall, strict=True):
        height = BOX_LEVEL if boxes else JOINT_LEVEL
        heights[level] = y - height / 2
        y -= height
    return {name: ((node.lane + 0.5) * LANE, heights[node.level]) for name, node in nodes.items()}


def _height(nodes: Mapping[str, Node]) -> float:
    """Inches that a network needs."""
    boxes = {node.level for node in nodes.values() if node.part}
    return BOX_LEVEL * len(boxes) + JOINT_LEVEL * len({node.level for node in nodes.values()} - boxes)


def _about(name: str, nodes: Mapping[str, Node]) -> str:
    """Tint: what a box deals in. What a network makes of movement and music is named by what it is."""
    node = nodes[name]
    if node.part and node.part.kind == "output" and len(node.part.input) > 1:
        return "motion"
    if not node.sources:
        return "audio" if name == "audio" else "motion"
    found = {_about(source, nodes) for source in node.sources}
    return found.pop() if len(found) == 1 else "both"


def _facts(part: Part, batch: int) -> list[str]:
    """The lines under a box's title."""
    if part.kind == "input":
        return [shape_text(part.output, batch)]
    if part.kind == "output":
        added = [f"added to ${_SIGNS[name]}$" for name in part.sources if name in _SIGNS]
        return [shape_text(part.input, batch), *added]
    return [f"{part.kind}, {count_text(part.parameters)}", f"to {shape_text(part.output, batch)}"]


_SIGNS = {"initial": "V_f"}


def _connect(
    ax: Axes,
    source: str,
    target: str,
    nodes: Mapping[str, Node],
    middles: Mapping[str, tuple[float, float]],
    halves: Mapping[str, float],
) -> None:
    """An arrow that turns at right angles: down and then aside into a plus, aside and then down into a box."""
    (x0, y0), (x1, y1) = middles[source], middles[target]
    first, last = nodes[source], nodes[target]
    start, end = (x0, y0 - halves[source]), (x1, y1 + halves[target])
    skips = first.part is None and last.part is None  # features joined before are joined again
    if x0 == x1 and not any(n.lane == first.lane and first.level < n.level < last.level for n in nodes.values()):
        draw_arrow(ax, [start, end], dashed=skips)
    elif x0 == x1:  # around what stands between
        aside = x0 + 0.62 * LANE
        draw_arrow(ax, [(x0, y0 - FORK), (aside, y0 - FORK), (aside, y1), (x1 + JOINT, y1)], dashed=skips)
    elif last.part is None:
        draw_arrow(ax, [start, (x0, y1), (x1 + JOINT * (1 if x0 > x1 else -1), y1)], dashed=skips)
    elif first.part is None:
        draw_arrow(ax, [(x0, y0 - FORK), (x1, y0 - FORK), end])
    else:
        draw_arrow(ax, [(x0 + BOX / 2 * (1 if x1 > x0 else -1), y0), (x1, y0), end])


def networks_figure(networks: Mapping[str, Sequence[Part]]) -> Figure:
    """Generator and discriminators side by side, at the same scale.

    Parameters
    ----------
    networks : what `harmolab.models.anatomy.anatomy` returns
    """
    found = {
        name: nodes_of(parts, {key: lane for key, (_, lane) in _WORDS[name].items()})
        for name, parts in networks.items()
    }
    widths = [(max(node.lane for node in nodes.values()) + 1) * LANE for nodes in found.values()]
    tall = max(map(_height, found.values()))
    with figure_style():
        figure = Figure(figsize=(sum(widths) + 0.2 * len(widths), tall + 0.9))
        figure.set_layout_engine("none")
        left = 0.0
        for (name, parts), width in zip(networks.items(), widths, strict=True):
            draw_network(inch_axes(figure, (left, 0.45), (width, tall)), parts, name)
            left += width + 0.2
        line = Line2D([], [], color=COLOURS["ink"], linestyle=DASHES, label="skip connection")
        plus = Line2D(
            [],
            [],
            linestyle="none",
            marker="$\\oplus$",
            markersize=11,
            markeredgewidth=0,
            color=COLOURS["ink"],
            label="joined",
        )
        below = inch_axes(figure, (0.0, 0.0), (left, 0.4))
        below.legend(handles=[*tint_legend(), plus, line], loc="lower left", ncols=5)
        below.text(left - 0.1, 0.1, SHAPES, ha="right", va="bottom", fontsize=9, color=COLOURS["ink"])
    return figure
