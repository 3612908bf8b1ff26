"""Pictures of a report: those its notebooks drew, and beside them the committed ones of the full profile."""

from __future__ import annotations

import json
import re
import struct
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

import nbformat
from nbformat.v4 import new_output

from harmolab.lab.figures.style import MANIFEST

FULL = "full"  # folder of the committed figures, inside the report's folder of figures
SAVED = "harmolab_saved"  # key of a cell's metadata: the figures and tables it wrote
PIXELS_PER_INCH = 100  # at which a figure is shown where there is room
CORPORA = {
    "beatlocked": "recordings on the beat", "tang2018": "recordings of Tang et al.", "realdance": "recordings",
    "aist": "street dance",
}  # fmt: skip


@dataclass(frozen=True)
class Picture:
    """One picture of a page and the words that belong to it.

    Parameters
    ----------
    name : str, its file
    src : address in the page: a file beside it, or the picture itself as ``data:``
    run : "this run" or "full run"
    title : str
    source : str, the manifest's name of the data
    pixels : int, width at `PIXELS_PER_INCH`
    """

    name: str
    src: str
    run: str
    title: str
    source: str
    pixels: int

    @property
    def data(self) -> str:
        """In plain words, the kind of data it was drawn from."""
        return data_words(self.source)

    @property
    def is_synthetic(self) -> bool:
        """Nothing in it was recorded."""
        return self.data == "synthetic data"

    @property
    def words(self) -> str:
        """The label of the picture: the run, and the data."""
        return ", ".join(filter(None, (self.run, self.data)))


def data_words(source: str) -> str:
    """Plain words for the data of a figure: "recordings", "synthetic data", both, or none.

    >>> data_words("beatlocked + synthetic")
    'recordings and synthetic data'
    """
    if not source or source.startswith("no data"):
        return ""
    parts = [part.strip() for part in re.split(r"\+|,|\band\b", source) if part.strip()]
    synthetic = [part for part in parts if part.lower().startswith("synthetic")]
    if len(synthetic) == len(parts):
        return "synthetic data"
    return "recordings and synthetic data" if synthetic else "recordings"


def source_names(source: str) -> list[str]:
    """Names of corpora as a reader of the report knows them: "recordings on the beat" for ``beatlocked``."""
    return list(dict.fromkeys(CORPORA.get(part.split("/")[0], part) for part in source.split(" + ")))


def manifest_of(folder: Path) -> dict[str, dict[str, Any]]:
    """The entries of a folder of figures; none where there is no manifest."""
    path = folder / MANIFEST
    return dict(json.loads(path.read_text("utf-8"))) if path.is_file() else {}


def picture_of(folder: Path, name: str, entry: Mapping[str, Any], *, run: str, below: str = "figures") -> Picture:
    """The picture of a file that lies in the report's folder `below`."""
    src = f"{below}/{quote(name)}"
    return Picture(name, src, run, entry["title"] or name, entry["source"], _pixels((folder / name).read_bytes()))


def pair_pictures(node: nbformat.NotebookNode, figures: Path, full: Mapping[str, Picture]) -> None:
    """Puts beside each picture of the notebook's outputs what it was drawn from and, if there is one, its full run.

    Pictures that a cell saved and did not show are added to its outputs; "saved x.csv" is taken out of them.

    Parameters
    ----------
    node : an executed notebook, changed in place; its cells' `SAVED` name the figures
    figures : folder of what it drew
    full : file name -> committed picture; empty in a report of the full profile
    """
    entries, keys = manifest_of(figures), count(1)
    for cell in node.cells:
        saved = [name for name in cell.metadata.get(SAVED, ()) if name.endswith(".png") and name in entries]
        outputs = [output for output in cell.get("outputs", []) if not _is_remark(output)]
        drawn = [output for output in outputs if "image/png" in output.get("data", {})]
        # A loop shows the last of its figures.
        hidden = [_output(figures / name) for name in saved[: max(0, len(saved) - len(drawn))]]
        names = [""] * (len(drawn) - len(saved)) + saved
        for output, name in zip([*hidden, *drawn], names, strict=True):
            now = _inline(output, name, entries.get(name, {}))
            output.metadata["key"] = f"picture-{next(keys)}"
            output.metadata["pictures"] = [now, *([full[name]] if name in full else [])]
        if "outputs" in cell:
            cell.outputs = [*hidden, *outputs]


def _is_remark(output: nbformat.NotebookNode) -> bool:
    """The line that a saved file leaves, without a picture."""
    data = output.get("data", {})
    return set(data) == {"text/plain"} and re.fullmatch(r"saved \S+\.(png|csv)", data["text/plain"]) is not None


def _output(path: Path) -> nbformat.NotebookNode:
    """A file as a cell shows it."""
    return new_output("display_data", {"image/png": b64encode(path.read_bytes()).decode("ascii")})


def _inline(output: nbformat.NotebookNode, name: str, entry: Mapping[str, Any]) -> Picture:
    """The picture of an output, held by the page itself."""
    png = "".join(output.data["image/png"].split())
    title = entry.get("title") or name or "figure"
    return Picture(name, f"data:image/png;base64,{png}", "this run", title, entry.get("source", ""), _pixels(png))


def _pixels(png: bytes | str) -> int:
    """Width at `PIXELS_PER_INCH` of a PNG, whose header gives its pixels and their number in a metre."""
    header = b64decode(png[:4096]) if isinstance(png, str) else png[:3072]
    (width,) = struct.unpack(">I", header[16:20])
    at = header.find(b"pHYs")
    (per_metre,) = struct.unpack(">I", header[at + 4 : at + 8]) if at > 0 else (0,)
    return round(width / (per_metre * 0.0254) * PIXELS_PER_INCH) if per_metre else int(width)
