"""The pages of a report: one per executed notebook, and the index; with the pictures that they show."""

import csv
import html
import json
import re
import shutil
import struct
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import count, groupby
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import nbformat
from latex2mathml.converter import convert as latex_to_mathml
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from nbformat.v4 import new_output

from harmolab.lab.report import MANIFEST
from harmolab.lab.report.templates import TEMPLATES, rendered

# Pictures: those its notebooks drew, and beside them the committed ones of the full profile

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


MARK = '<meta name="generator" content="harmolab">'
TABLE_ROWS = 40  # more than this of a table is left to the CSV file

# Items of the harmony paper; then those of Music2Dance and of Audio to Body Dynamics, whose numbers are the same.
PAPER: dict[str, str] = json.loads(Path(__file__).with_name("paper_items.json").read_text("utf-8"))


@dataclass(frozen=True)
class NotebookRun:
    """One executed notebook. `error` is empty if it ran to its end, else the cell that failed and its fault."""

    path: Path
    node: nbformat.NotebookNode
    seconds: float
    error: str

    @property
    def page(self) -> str:
        """Name of its HTML file."""
        return f"{self.path.stem}.html"

    @property
    def number(self) -> str:
        """Its place in the story, two digits of its file name."""
        return self.path.stem[:2]

    @property
    def title(self) -> str:
        """Its first heading, or its file name."""
        text = "\n".join(cell.source for cell in self.node.cells if cell.cell_type == "markdown")
        heading = re.search(r"^#\s+(.+)$", text, flags=re.MULTILINE)
        # "01 Harmony distortion" would show its number twice in the index.
        return re.sub(r"^\d+\W+", "", heading[1]) if heading else self.path.stem

    @property
    def paper(self) -> tuple[str, ...]:
        """The figures and tables of the paper that it builds, from its metadata."""
        return tuple(self._facts.get("paper", ()))

    @property
    def part(self) -> str:
        """The part of the story that it belongs to, from its metadata."""
        return str(self._facts.get("part", ""))

    @property
    def finding(self) -> str:
        """One sentence: from its metadata, or what its cell of that tag has printed."""
        cells = (cell for cell in self.node.cells if "finding" in cell.metadata.get("tags", ()))
        printed = (output.data for cell in cells for output in cell.get("outputs", ()) if "data" in output)
        said = next((str(data["text/markdown"]) for data in printed if "text/markdown" in data), "")
        return str(self._facts.get("finding", "")) or said.replace("**", "")

    @property
    def picture(self) -> str:
        """File of the figure that shows the finding best, from its metadata."""
        return str(self._facts.get("picture", ""))

    @property
    def crop(self) -> str:
        """CSS inset that leaves of that figure the panel that the metadata names; a browser without it shows all."""
        left, top, right, bottom = self._facts.get("panel", (0.0, 0.0, 1.0, 1.0))
        return " ".join(f"{100 * share:.4g}%" for share in (top, 1 - right, 1 - bottom, left))

    @property
    def opens_with_picture(self) -> bool:
        """The figure stands under the finding; not where something is to be heard before any number."""
        return not self._facts.get("heard_first", False)

    @property
    def _facts(self) -> Mapping[str, Any]:
        return dict(self.node.metadata.get("harmolab", {}))


@dataclass(frozen=True)
class Chapter:
    """A notebook's run in the story: its neighbours, and the picture of its finding."""

    run: NotebookRun
    before: NotebookRun | None
    after: NotebookRun | None
    picture: Picture | None


def write_pages(
    folder: Path, runs: list[NotebookRun], profile: str, committed: Path | None = None, documents: Sequence[Path] = ()
) -> None:
    """A page for every notebook, and the index, in `folder` beside the figures already there.

    Parameters
    ----------
    folder : the report's
    runs : in the order of the story
    profile : "quick" or "full"
    committed : folder of full-profile figures, optional; they are copied, to stand beside those of a quick run
    documents : Markdown files that become pages, too; the index links to them first
    """
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    figures = folder / "figures"
    manifest = manifest_of(figures)
    full = _full_pictures(figures, committed, runs) if committed is not None and profile != "full" else {}
    pictures = {name: entry for name, entry in manifest.items() if name.endswith(".png")}
    drawn = {name: picture_of(figures, name, entry, run="this run") for name, entry in pictures.items()}
    chapters = [
        Chapter(run, before, after, full.get(run.picture) or drawn.get(run.picture))
        for before, run, after in zip([None, *runs], runs, [*runs[1:], None], strict=False)
    ]
    for chapter in chapters:
        pair_pictures(chapter.run.node, figures, full)
        (folder / chapter.run.page).write_text(_page(chapter, f"{profile} profile, {date}"), "utf-8")
    texts = [_document(path) for path in documents]
    for text in texts:
        (folder / text.page).write_text(_page(Chapter(text, None, None, None), f"of the full run, {date}"), "utf-8")
    sources = {name for entry in manifest.values() for name in source_names(entry["source"]) if "no data" not in name}
    index = rendered(
        "index.html.j2",
        parts=[(part, list(chapters)) for part, chapters in groupby(chapters, lambda chapter: chapter.run.part)],
        runs=runs,
        documents=texts,
        failures=[run for run in runs if run.error],
        figures=[(drawn.get(name), full.get(name), manifest[name]) for name in drawn],
        tables=[(name, entry, *_table(figures / name)) for name, entry in manifest.items() if ".csv" in name],
        paper=[_paper_row(item, subject, runs) for item, subject in PAPER.items()],
        sources=sorted(sources),
        profile=profile,
        date=date,
    )
    (folder / "index.html").write_text(index, "utf-8")


def _document(path: Path) -> NotebookRun:
    """A Markdown file as a notebook of one cell; links to notebooks lead to their pages, others become their text."""
    text = re.sub(r"\]\(\.\./notebooks/(\w+)\.ipynb\)", r"](\1.html)", path.read_text("utf-8"))
    text = text.replace("](../figures/", "](figures/")
    text = re.sub(r"(?<!!)\[([^\]]+)\]\((?!https?:|\w+\.html)[^)]+\)", r"\1", text)
    # nbconvert embeds no picture from outside the text's folder, and a report that is passed on takes none along.
    place = path.parent.parent / path.name
    return NotebookRun(place, nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(text)]), 0.0, "")


def _full_pictures(figures: Path, committed: Path, runs: Sequence[NotebookRun]) -> dict[str, Picture]:
    """The committed pictures of these notebooks by file name, copied below the report's figures."""
    names, folder = {run.path.name for run in runs}, figures / FULL
    pictures: dict[str, Picture] = {}
    folder.mkdir(parents=True, exist_ok=True)
    for name, entry in manifest_of(committed).items():
        if name.endswith(".png") and entry["notebook"] in names and (committed / name).is_file():
            shutil.copyfile(committed / name, folder / name)
            pictures[name] = picture_of(folder, name, entry, run="full run", below=f"figures/{FULL}")
    return pictures


def _paper_row(item: str, subject: str, runs: Sequence[NotebookRun]) -> tuple[str, str, str, list[NotebookRun]]:
    """(item, its subject, "built" or "failed" or "missing", the notebooks that build it)."""
    claims = [run for run in runs if item in run.paper]
    state = "missing" if not claims else "failed" if all(run.error for run in claims) else "built"
    return item, subject, state, claims


def _table(path: Path) -> tuple[list[str], list[list[str]], int]:
    """(column names, the first rows, number of the other rows) of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    return header, rows[:TABLE_ROWS], max(0, len(rows) - TABLE_ROWS)


def _page(chapter: Chapter, about: str) -> str:
    """The notebook as one HTML page that needs no network."""
    run = chapter.run
    for cell in run.node.cells:
        if cell.cell_type == "markdown":  # the bar below says what comes next
            cell.source = re.sub(r"^Next: .*$", "", cell.source, flags=re.MULTILINE)
            cell.source = re.sub(r"\]\((\w+)\.ipynb\)", r"](\1.html)", cell.source)
        for output in cell.get("outputs", ()):
            if "text/html" in output.get("data", {}):  # what was not measured is a dash, as in every printed table
                output.data["text/html"] = output.data["text/html"].replace("<td>NaN</td>", "<td>&ndash;</td>")
    filters = {"markdown2html": markdown_to_html}
    exporter = HTMLExporter(template_file=str(TEMPLATES / "notebook.html.j2"), embed_images=True, filters=filters)
    facts = {"about": f"{about}, {run.seconds:.0f} s", "error": run.error, "chapter": chapter}
    resources = {"metadata": {"name": run.title, "path": str(run.path.parent)}, "harmolab": facts}
    return str(exporter.from_notebook_node(run.node, resources=resources)[0])


class _MathRenderer(IPythonRenderer):
    """Markdown whose equations become MathML, which browsers draw themselves: no script, no network."""

    def inline_math(self, body: str) -> str:
        return _mathml(body, "inline")

    def block_math(self, body: str) -> str:
        return _mathml(body, "block")

    def latex_environment(self, name: str, body: str) -> str:
        return _mathml(f"\\begin{{{name}}}{body}\\end{{{name}}}", "block")


@jinja2.pass_context
def markdown_to_html(context: Any, source: str) -> str:
    """A cell of Markdown as nbconvert writes it, with equations as MathML; a filter of its exporters."""
    renderer = _MathRenderer(
        escape=False,
        attachments=context.get("cell", {}).get("attachments", {}),
        embed_images=True,
        path=context.get("resources", {}).get("metadata", {}).get("path", ""),
        exclude_anchor_links=True,
    )
    return MarkdownWithMath(renderer=renderer).render(source)


def _mathml(tex: str, display: str) -> str:
    """An equation as MathML; as its TeX source, where the converter does not understand it."""
    # The converter reads the outer environments only, and draws the inner ones' alignment marks as letters.
    outer = re.sub(r"(begin|end)\{(?:aligned|alignedat|gathered|split)\}", r"\1{align*}", tex.strip())
    try:
        mathml: str = latex_to_mathml(outer, display=display)
    except Exception:  # noqa: BLE001  # after any fault of the converter the reader still gets the equation
        return f"<code>{html.escape(tex)}</code>"
    return mathml.replace("<math ", f'<math alttext="{html.escape(tex.strip())}" ', 1)
