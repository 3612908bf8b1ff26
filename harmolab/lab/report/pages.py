"""The pages of a report: one per executed notebook, and the index."""

from __future__ import annotations

import csv
import html
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
import nbformat
from latex2mathml.converter import convert as latex_to_mathml
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

from harmolab.lab.report.pictures import FULL, Picture, manifest_of, pair_pictures, picture_of, source_names
from harmolab.lab.report.templates import TEMPLATES, rendered

MARK = '<meta name="generator" content="harmolab">'
TABLE_ROWS = 40  # more than this of a table is left to the CSV file

# Items of the harmony paper; then those of Music2Dance and of Audio to Body Dynamics, whose numbers are the same.
PAPER = {
    "Fig. 1": "which beats are felt to fall together, and which apart",
    "Fig. 2": "visual beats from optical flow and from the skeleton",
    "Fig. 3": "harmony distorted: onsets against beats from direction changes",
    "Fig. 4": "joint speed and the movements that it follows",
    "Fig. 5": "better agreement with beats from the joint speed",
    "Fig. 6": "meter units found in the music's beats",
    "Fig. 7": "the generator, its discriminators and their training",
    "Fig. 8": "how often inharmonious videos are told from true ones",
    "Fig. 9": "quality of the generated motion (FID)",
    "Fig. 10": "a generated dance beside the recorded one",
    "Fig. 11": "what the harmony loss adds",
    "Fig. 12": "harmony and hit rate against other systems",
    "Fig. 13": "which system viewers prefer",
    "Fig. 14": "frames of a dance at the beats of its music",
    "Table 1": "harmony for seven dances",
    "Table 2": "hit rate for seven dances",
    "Music2Dance Fig. 1": "two dances of the network",
    "Music2Dance Fig. 2": "the capture; here the way from recordings to windows",
    "Music2Dance Fig. 3": "the network, with the shapes of its tensors",
    "Music2Dance Fig. 4": "features of a song, on one time axis",
    "Music2Dance Fig. 5": "the classifier of songs, layer by layer",
    "Music2Dance Fig. 6": "marks of people; here of measures",
    "Music2Dance Fig. 7": "dances beside a recorded dancer",
    "Music2Dance Fig. 8": "heights of the hands by music features and by a mel spectrogram",
    "Music2Dance Fig. 9": "places of the end effectors with and without the mapping of the music",
    "Music2Dance Fig. 10": "heights of the toes with and without end effectors, before and after the foot model",
    "Music2Dance Fig. 11": "loss with and without clusters of windows",
    "Music2Dance Table 1": "how often two classifiers give a song its class",
    "Music2Dance Table 2": "error of two foot models",
    "Music2Dance Table 3": "what people marked; here measures, and simulated raters",
    "Audio to Body Fig. 1": "from a sound to an avatar",
    "Audio to Body Fig. 2": "frames of musicians with their points",
    "Audio to Body Fig. 3": "rejected frames, and the rules that caught them",
    "Audio to Body Fig. 4": "the network",
    "Audio to Body Fig. 5": "the first component over the epochs",
    "Audio to Body Fig. 6": "the first component to sound that is no music",
    "Audio to Body Fig. 7": "predicted over tracked points, piano",
    "Audio to Body Fig. 8": "predicted over tracked points, violin",
    "Audio to Body Fig. 9": "an avatar at the piano",
    "Audio to Body Fig. 10": "an avatar with a violin",
    "Audio to Body Fig. 11": "the worst frames, and their causes",
    "Audio to Body video": "music and points that do not match",
    "Audio to Body Table 1": "errors of a violinist by setting",
    "Audio to Body Table 2": "errors of a pianist by setting",
}


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
        """One sentence, from its metadata."""
        return str(self._facts.get("finding", ""))

    @property
    def picture(self) -> str:
        """File of the figure that shows the finding best, from its metadata."""
        return str(self._facts.get("picture", ""))

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


def write_pages(folder: Path, runs: Sequence[NotebookRun], profile: str, committed: Path | None = None) -> None:
    """A page for every notebook, and the index, in `folder` beside the figures already there.

    Parameters
    ----------
    folder : the report's
    runs : in the order of the story
    profile : "quick" or "full"
    committed : folder of full-profile figures, optional; they are copied, to stand beside those of a quick run
    """
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    figures = folder / "figures"
    manifest = manifest_of(figures)
    full = _full_pictures(figures, committed, runs) if committed is not None and profile != "full" else {}
    drawn = {
        name: picture_of(figures, name, entry, run="this run")
        for name, entry in manifest.items()
        if name.endswith(".png")
    }
    chapters = [
        Chapter(run, before, after, full.get(run.picture) or drawn.get(run.picture))
        for before, run, after in zip([None, *runs], runs, [*runs[1:], None], strict=False)
    ]
    for chapter in chapters:
        pair_pictures(chapter.run.node, figures, full)
        (folder / chapter.run.page).write_text(_page(chapter, f"{profile} profile, {date}"), "utf-8")
    index = rendered(
        "index.html.j2",
        parts=[(part, list(chapters)) for part, chapters in groupby(chapters, lambda chapter: chapter.run.part)],
        runs=runs,
        failures=[run for run in runs if run.error],
        figures=[(drawn.get(name), full.get(name), manifest[name]) for name in drawn],
        tables=[(name, entry, *_table(figures / name)) for name, entry in manifest.items() if ".csv" in name],
        paper=[_paper_row(item, subject, runs) for item, subject in PAPER.items()],
        sources=sorted(
            {name for entry in manifest.values() for name in source_names(entry["source"]) if "no data" not in name}
        ),
        profile=profile,
        version=version("harmolab"),
        date=date,
    )
    (folder / "index.html").write_text(index, "utf-8")


def _full_pictures(figures: Path, committed: Path, runs: Sequence[NotebookRun]) -> dict[str, Picture]:
    """The committed pictures of these notebooks by file name, copied below the report's figures."""
    names = {run.path.name for run in runs}
    entries = {
        name: entry
        for name, entry in manifest_of(committed).items()
        if name.endswith(".png") and entry["notebook"] in names and (committed / name).is_file()
    }
    (figures / FULL).mkdir(parents=True, exist_ok=True)
    for name in entries:
        shutil.copyfile(committed / name, figures / FULL / name)
    return {
        name: picture_of(figures / FULL, name, entry, run="full run", below=f"figures/{FULL}")
        for name, entry in entries.items()
    }


def _paper_row(item: str, subject: str, runs: Sequence[NotebookRun]) -> tuple[str, str, str, list[NotebookRun]]:
    """(item, its subject, "built" or "failed" or "missing", the notebooks that build it)."""
    claims = [run for run in runs if item in run.paper]
    if not claims:
        return item, subject, "missing", []
    return item, subject, "failed" if all(run.error for run in claims) else "built", claims


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
    exporter = _OfflineExporter(template_file=str(TEMPLATES / "notebook.html.j2"), embed_images=True)
    facts = {"about": f"{about}, {run.seconds:.0f} s", "error": run.error, "chapter": chapter}
    resources = {"metadata": {"name": run.title, "path": str(run.path.parent)}, "harmolab": facts}
    page, _ = exporter.from_notebook_node(run.node, resources=resources)
    return str(page)


class _MathRenderer(IPythonRenderer):
    """Markdown whose equations become MathML, which browsers draw themselves: no script, no network."""

    def inline_math(self, body: str) -> str:
        return _mathml(body, "inline")

    def block_math(self, body: str) -> str:
        return _mathml(body, "block")

    def latex_environment(self, name: str, body: str) -> str:
        return _mathml(f"\\begin{{{name}}}{body}\\end{{{name}}}", "block")


class _OfflineExporter(HTMLExporter):
    """nbconvert's HTML with equations as MathML."""

    @jinja2.pass_context
    def markdown2html(self, context: Any, source: str) -> str:
        cell = context.get("cell", {})
        renderer = _MathRenderer(
            escape=False,
            attachments=cell.get("attachments", {}),
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
