"""The look of all figures, the folder they are saved in, and the manifest beside them."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any, NotRequired, Protocol, TypedDict, Unpack

import matplotlib as mpl
from cycler import cycler
from filelock import FileLock
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure
from matplotlib.text import Text

from harmolab.io.files import WRITTEN_BY, atomic_write, write_json
from harmolab.lab.profile import RunProfile

MANIFEST = "manifest.json"
PAGE_WIDTH = 992  # pixels, of a column of the report

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

STYLE: Mapping[Any, Any] = MappingProxyType(
    {
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
)


class Frame(Protocol):
    """A table that can write itself, such as a pandas DataFrame."""

    def to_csv(self, path: Any, *, index: bool) -> Any: ...


@contextmanager
def figure_style() -> Iterator[None]:
    """Matplotlib settings of this project, for the length of a ``with`` block.

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


@dataclass(frozen=True)
class Saved:
    """A file just saved; as the last line of a notebook's cell it shows the picture, if pyplot does not."""

    path: Path
    picture: bytes | None = field(default=None, repr=False)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        # The name alone: the folder is that of the moment, and a temporary one while a report is made.
        bundle = {"text/plain": f"saved {self.path.name}"}
        if self.picture is not None:
            bundle["image/png"] = base64.b64encode(self.picture).decode("ascii")
        return bundle


def figures_folder(profile: RunProfile) -> Path:
    """The folder of figures: ``HARMOLAB_FIGURES``, or the project's ``figures/``; ``figures/quick/`` for a quick run.

    The published figures are those of the full profile, so a quick run must not replace them.
    """
    if folder := os.environ.get("HARMOLAB_FIGURES"):
        return Path(folder)
    folder_now = Path.cwd()
    root = next(
        (parent for parent in (folder_now, *folder_now.parents) if (parent / "pyproject.toml").is_file()), folder_now
    )
    return root / "figures" if profile.name == "full" else root / "figures" / profile.name


class About(TypedDict):
    """Description of a figure or table in the manifest.

    notebook : name of the notebook that draws it
    source : origin of the data: "synthetic", or the name of the recordings
    seed : the profile's when left out
    title : one line for the report's index
    trained : whether it shows what a network does; of a quick profile the figure then says that it is not trained
    """

    notebook: str
    source: str
    profile: RunProfile
    seed: NotRequired[int | None]
    title: NotRequired[str]
    trained: NotRequired[bool]


def save_figure(figure: Figure, name: str, **about: Unpack[About]) -> Saved:
    """The PNG just written, with its entry in the manifest beside it.

    Parameters
    ----------
    figure : matplotlib Figure; marked "synthetic data" if the source says so, and where a network is not trained
    name : str, file name without suffix, such as "fig01_harmony_distortion"
    about : as in `About`

    Raises
    ------
    ValueError
        If the name is not a plain file name.
    """
    with _recorded(name, ".png", **about) as path:
        panels_marked = any(text.get_gid() == "source" for text in figure.findobj(Text))
        marks = {
            "synthetic data": "synthetic" in about["source"].lower() and not panels_marked,
            "quick profile, not trained": about.get("trained", False) and about["profile"].epochs is not None,
        }
        _mark(figure, "; ".join(words for words, applies in marks.items() if applies))
        write_figure(figure, path)
    shown_by_pyplot = figure.canvas.manager is not None
    return Saved(path, None if shown_by_pyplot else path.read_bytes())


def save_table(frame: Frame, name: str, **about: Unpack[About]) -> Saved:
    """The CSV just written; arguments as for `save_figure`. The frame's index is left out."""
    with _recorded(name, ".csv", **about) as path, atomic_write(path) as part:
        frame.to_csv(part, index=False)
    return Saved(path)


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


def mark_synthetic(ax: Axes) -> None:
    """The words "synthetic data" at the right, above the title; `save_figure` then marks panels alone."""
    title = ax.get_title(loc="left")
    words = "synthetic data" + "\n" * (title.count("\n") + bool(title))
    ax.set_title(words, loc="right", fontsize=9, style="italic", color=COLOURS["miss"], gid="source")


def smallest_text(figure: Figure) -> float:
    """Size of the smallest letters in pixels, when the figure is as wide as a page of the report (`PAGE_WIDTH`)."""
    texts = [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]
    pixels_a_point = min(PAGE_WIDTH / figure.get_figwidth(), figure.get_dpi()) / 72
    return pixels_a_point * min(float(text.get_fontsize()) for text in texts)


def _mark(figure: Figure, words: str) -> None:
    if not words or any(text.get_gid() == "source" for text in figure.texts):
        return
    if figure.legends:
        # A legend at the edge of the canvas stays where the layout has it, else it moves down onto the mark.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        for legend in figure.legends:
            legend.set_bbox_to_anchor((0.0, 0.0, 1.0, 1.0), figure.transFigure)
    # Below the canvas: a tight bounding box grows to hold it, and it covers nothing.
    figure.text(1.0, -0.01, words, gid="source", ha="right", va="top", size=9, style="italic", color=COLOURS["miss"])


@contextmanager
def _recorded(
    name: str,
    suffix: str,
    *,
    notebook: str,
    source: str,
    profile: RunProfile,
    seed: int | None = None,
    title: str = "",
    trained: bool = False,
) -> Iterator[Path]:
    """Path of a figure to write; then adds or replaces its entry in the manifest.

    Notebooks that run at the same time wait for each other.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise ValueError(f"a figure's name must be a plain file name without folders, got {name!r}")
    folder = figures_folder(profile)
    folder.mkdir(parents=True, exist_ok=True)
    yield folder / f"{name}{suffix}"
    entry = {
        "notebook": f"{Path(notebook).stem}.ipynb",
        "profile": profile.name,
        "seed": profile.seed if seed is None else seed,
        "source": source,
        "title": title,
        "version": version("harmolab"),
    }
    manifest = folder / MANIFEST
    with FileLock(manifest.with_name(f".{MANIFEST}.lock"), timeout=60):
        entries = json.loads(manifest.read_text("utf-8")) if manifest.is_file() else {}
        write_json(manifest, dict(sorted({**entries, f"{name}{suffix}": entry}.items())))
