"""Figures and tables of a run: the folder they are saved in, and the manifest beside them."""

import base64
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, NotRequired, TypedDict, Unpack

import pandas as pd
from filelock import FileLock
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from harmolab.files import atomic_write, write_json
from harmolab.lab.figures.style import COLOURS, write_figure
from harmolab.lab.report import MANIFEST
from study.figures.pictures import PICTURES
from study.figures.words import is_synthetic
from study.profile import RunProfile

PAGE_WIDTH = 992  # pixels, of a column of the report
PRIVATE = ("tracked", "tracked videos")  # sources that show people whose recordings may be looked at here alone


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
    if chosen := os.environ.get("HARMOLAB_FIGURES"):
        return Path(chosen)
    folder = project_folder() / "figures"
    return folder if profile.name == "full" else folder / profile.name


def project_folder() -> Path:
    """The folder of the project that the working directory lies in; the working directory where there is none."""
    working = Path.cwd()
    above = (working, *working.parents)
    return next((folder for folder in above if (folder / "pyproject.toml").is_file()), working)


class About(TypedDict):
    """Description of a figure or table in the manifest.

    notebook : name of the notebook that draws it
    source : origin of the data: "synthetic", or the name of the recordings
    seed : the profile's when left out
    title : one line for the report's index
    trained : whether it shows what a network does; of a quick profile the figure then says that it is not trained
    private : whether it shows recorded people who may be looked at here alone: it is in the report, and not published;
        so is every picture whose source is one of `PRIVATE`
    run : commit, day and the like of the run whose tables it is drawn from again
    """

    notebook: str
    source: str
    profile: RunProfile
    seed: NotRequired[int]
    title: NotRequired[str]
    trained: NotRequired[bool]
    private: NotRequired[bool]
    run: NotRequired[Mapping[str, Any]]


def save_figure(figure: Figure, name: str, *, tables: Sequence[str] | None = None, **about: Unpack[About]) -> Saved:
    """The PNG just written, with its entry in the manifest beside it.

    Parameters
    ----------
    figure : matplotlib Figure; marked "synthetic data" if the source says so, and where a network is not trained
    name : str, file name without suffix, such as "fig01_harmony_distortion"
    tables : names of the saved tables that give it; () where it is drawn of bodies, sound or the shapes of a network.
        Left out, those that `study.figures.pictures` names
    about : as in `About`

    Raises
    ------
    ValueError
        If the name is not a plain file name, or a table was not saved in the folder before.
    """
    folder = figures_folder(about["profile"])
    tables = PICTURES.get(name, ())[2:] if tables is None else tables
    if missing := [f"{table}.csv" for table in tables if not (folder / f"{table}.csv").is_file()]:
        raise ValueError(f"{name} is drawn of {' and '.join(missing)}, not saved in {folder}: save tables first")
    trained = {"trained": True} if about.get("trained", False) else {}
    with _recorded(name, ".png", {"tables": [f"{table}.csv" for table in tables], **trained}, **about) as path:
        panels_marked = any(text.get_gid() == "source" for text in figure.findobj(Text))
        marks = {
            "synthetic data": "synthetic" in about["source"].lower() and not panels_marked,
            "quick profile, not trained": about.get("trained", False) and about["profile"].epochs is not None,
        }
        _mark(figure, "; ".join(words for words, applies in marks.items() if applies))
        write_figure(figure, path)
    shown_by_pyplot = figure.canvas.manager is not None
    return Saved(path, None if shown_by_pyplot else path.read_bytes())


def save_table(frame: pd.DataFrame, name: str, **about: Unpack[About]) -> Saved:
    """The CSV just written; arguments as for `save_figure`. The frame's index is left out."""
    with _recorded(name, ".csv", {}, **about) as path, atomic_write(path) as part:
        frame.to_csv(part, index=False)
    return Saved(path)


def mark_corpus(ax: Axes, corpus: str) -> None:
    """The words "synthetic data" at the right, above the title, if the corpus is; `save_figure` then adds no mark."""
    if not is_synthetic(corpus):
        ax.set_title(" ", loc="right", fontsize=12, gid="source")
        return
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
def _recorded(name: str, suffix: str, more: Mapping[str, Any], **about: Unpack[About]) -> Iterator[Path]:
    """Path of a figure to write; then adds or replaces its entry in the manifest, with `more` in it.

    Notebooks that run at the same time wait for each other.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise ValueError(f"a figure's name must be a plain file name without folders, got {name!r}")
    profile = about["profile"]
    folder = figures_folder(profile)
    folder.mkdir(parents=True, exist_ok=True)
    yield folder / f"{name}{suffix}"
    entry = {
        "notebook": f"{Path(about['notebook']).stem}.ipynb",
        "profile": profile.name,
        "seed": about.get("seed", profile.seed),
        "source": about["source"],
        "title": about.get("title", ""),
        "version": version("harmolab"),
        **({"private": True} if about.get("private", False) or about["source"] in PRIVATE else {}),
        **about.get("run", {}),
        **more,
    }
    manifest = folder / MANIFEST
    with FileLock(manifest.with_name(f".{MANIFEST}.lock"), timeout=60):
        entries = json.loads(manifest.read_text("utf-8")) if manifest.is_file() else {}
        write_json(manifest, dict(sorted({**entries, f"{name}{suffix}": entry}.items())))
