"""The look of all figures."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from harmolab.files import WRITTEN_BY, atomic_write

# One meaning per colour. Blue, orange and green are Okabe and Ito's, chosen for colour-blind readers; the red is
# darker than the orange so that the two differ in lightness too.
COLOURS = MappingProxyType(
    {
        "audio": "#0072B2",
        "visual": "#E69F00",
        "hit": "#009E73",
        "miss": "#B2182B",
        "chance": "#7F7F7F",
        "ink": "#222222",
        "faint": "#D9D9D9",
    }
)

# Colour is never the only cue.
MARKERS = MappingProxyType({"audio": "|", "visual": "^", "hit": "o", "miss": "x"})

STYLE: Mapping[Any, Any] = {
    "figure.figsize": (8.0, 4.5),
    "figure.dpi": 100,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
    "savefig.bbox": "tight",
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # a fixed place: searching for a free one takes a fifth of the drawing time
    "axes.labelcolor": COLOURS["ink"],
    "axes.edgecolor": COLOURS["ink"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(
        color=[COLOURS["audio"], COLOURS["visual"], "#009E73", "#CC79A7", "#56B4E9", COLOURS["ink"]]
    ),
    "grid.color": COLOURS["faint"],
    "legend.frameon": False,
    "lines.linewidth": 1.5,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """The look of harmolab's figures for your own: its settings of matplotlib, within a ``with`` block.

    >>> with figure_style():
    ...     mpl.rcParams["axes.spines.top"]
    False
    """
    # Not rc_context, which puts back every setting: a notebook that first plots in the block would then have its
    # figures switched off again afterwards.
    before: dict[Any, Any] = {name: mpl.rcParams[name] for name in STYLE}
    mpl.rcParams.update(STYLE)
    try:
        yield
    finally:
        mpl.rcParams.update(before)


@contextmanager
def styled_axes(
    size: tuple[float, float], rows: int = 1, columns: int = 1, **options: Any
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A new figure of `size` inches and its axes in reading order, in `figure_style`; options as for ``subplots``."""
    with figure_style():
        figure = Figure(figsize=size, layout="constrained")
        yield figure, list(figure.subplots(rows, columns, squeeze=False, **options).flat)


def write_figure(figure: Figure, path: Path) -> Path:
    """`path`, just written in the format that its suffix names; no manifest entry.

    Raises
    ------
    FileNotFoundError
        If its folder does not exist.
    ValueError
        If matplotlib does not write that format.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist; create it first")
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in (formats := FigureCanvasBase.get_supported_filetypes()):
        raise ValueError(f"{path}: no picture format {suffix!r}; there are {', '.join(sorted(formats))}")
    # Without the version of matplotlib the same picture is the same bytes: git sees no change where there is none.
    metadata = {"Software": WRITTEN_BY} if suffix == "png" else None
    with atomic_write(path) as part:
        figure.savefig(part, format=suffix, bbox_inches="tight", metadata=metadata)
    return path
