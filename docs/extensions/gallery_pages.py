"""The gallery: a card for every notebook with its finding, and a page of its figures with the data behind each."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from generated_pages import FOLDER, write_pages
from PIL import Image
from sphinx.application import Sphinx

from study.findings import notebook_finding

ROOT = Path(__file__).resolve().parents[2]
# Folders of data in the manifest, in words; the first that fits a name is taken.
SOURCES = {
    "beatlocked": "recorded ballroom figures laid on the beat",
    "tang2018_rebuilt": "Tang et al. 2018, rebuilt",
    "tang2018": "Tang et al. 2018, as published",
    "realdance/": "free recordings: ",
}


def finding(path: Path, notebook: dict[str, Any]) -> tuple[str, str]:
    """(title, finding in one sentence) of a notebook: of its metadata, of its first bold words, or of its tables."""
    text = next("".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "markdown")
    title = text.partition("\n")[0].lstrip("# ").strip()
    bold = re.search(r"\*\*(.+?)\*\*", text, flags=re.DOTALL)
    said = notebook["metadata"].get("harmolab", {}).get("finding") or (bold[1] if bold else notebook_finding(path))
    return title, " ".join(said.split())


def source(entry: dict[str, Any]) -> str:
    """The data behind a figure in words."""
    parts = entry["source"].split(" + ")
    for folder, words in SOURCES.items():
        parts = [part.replace(folder, words, 1) if part.startswith(folder) else part for part in parts]
    return "; ".join(parts).replace("_", " ")


def figures(path: Path, notebook: dict[str, Any], manifest: dict[str, Any]) -> list[str]:
    """Names of the pictures that a notebook writes, the one that stands for it first."""
    first = notebook["metadata"].get("harmolab", {}).get("picture")
    names = [name for name, entry in manifest.items() if entry["notebook"] == path.name and name.endswith(".png")]
    return sorted(
        filter(lambda name: (ROOT / "figures" / name).exists(), names), key=lambda name: (name != first, name)
    )


def thumbnail(image: Image.Image, panel: Sequence[float]) -> Image.Image:
    """One panel of a picture: its left, top, right and bottom in shares of width and height."""
    left, top, right, bottom = (round(share * size) for share, size in zip(panel, image.size * 2, strict=True))
    return image.crop((left, top, right, bottom))


def write_thumbnails(folder: Path = FOLDER / "gallery") -> None:
    """The panel of each notebook's picture that its metadata names, as the picture of its card."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted((ROOT / "notebooks").glob("[0-9]*.ipynb")):
        facts = json.loads(path.read_text("utf-8"))["metadata"]["harmolab"]
        with Image.open(ROOT / "figures" / facts["picture"]) as image:
            thumbnail(image, facts["panel"]).save(folder / f"{path.stem}.png")


def card(path: Path, title: str, said: str, subject: str) -> str:
    """Markdown of one notebook's card, to be included by a page in docs/; its picture is a `thumbnail`."""
    return f""":::{{grid-item-card}} {title}
:link: generated/gallery/{path.stem}
:link-type: doc
:img-top: generated/gallery/{path.stem}.png
:img-alt: {subject}, one panel

{said}
:::
"""


def caption(notebook: dict[str, Any], name: str) -> str:
    """The notebook's words above the cell that saves a picture, without their heading; "" where no cell names it."""
    words, stem = "", Path(name).stem
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        saved = re.findall(r'"(\w{8,})(\{?)', text) if "save_figure(" in text else []
        if cell["cell_type"] == "markdown":
            words = re.sub(r"\$([^$]+)\$", r"`\1`", re.sub(r"^#+ .*\n*", "", text)).strip()
        elif any(stem == one or (end and stem.startswith(one)) for one, end in saved):  # the cell may fill in its end
            return words
    return ""


def page(path: Path, title: str, said: str, notebook: dict[str, Any], manifest: dict[str, Any]) -> Iterator[str]:
    """Markdown lines of one notebook's page: what it says, then each figure under its title, with its words once."""
    yield from (f"# {title}", "", said, "", f"Notebook: {{download}}`{path.name} <../../../notebooks/{path.name}>`", "")
    above = ""
    for name in figures(path, notebook, manifest):
        heading, words = manifest[name]["title"].replace("[", "(").replace("]", ")"), caption(notebook, name)
        yield from (f"## {heading}", "", f"Data: {source(manifest[name])}.", "", words if words != above else "", "")
        yield from (f"![{heading}](../../../figures/{name})", "")
        above = words


def gallery() -> dict[str, str]:
    """Name -> text of the cards and of every notebook's page."""
    manifest = json.loads((ROOT / "figures" / "manifest.json").read_text("utf-8"))
    pages, cards, names = {}, [], []
    for path in sorted((ROOT / "notebooks").glob("[0-9]*.ipynb")):
        notebook = json.loads(path.read_text("utf-8"))
        title, said = finding(path, notebook)
        pictures = figures(path, notebook, manifest)
        pages[f"gallery/{path.stem}.md"] = "\n".join(page(path, title, said, notebook, manifest))
        cards.append(card(path, title, said, manifest[pictures[0]]["title"]))
        names.append(f"generated/gallery/{path.stem}")
    grid = [
        "::::{grid} 1 1 2 2",
        ":gutter: 3",
        "",
        *cards,
        "::::",
        "",
        "```{toctree}",
        ":hidden:",
        "",
        *names,
        "```",
        "",
    ]
    return {"cards.inc": "\n".join(grid), **pages}


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages and their thumbnails before Sphinx looks for sources."""
    app.connect("builder-inited", lambda app: write_thumbnails())
    app.connect("builder-inited", lambda app: write_pages(gallery()))
    return {"parallel_read_safe": True}
