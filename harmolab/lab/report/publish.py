"""Figures and tables of a full run: each notebook's replace what it published before, as soon as it has run."""

import ast
import hashlib
import shutil
import subprocess
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import nbformat

from harmolab.files import atomic_write, write_json
from harmolab.lab.report.pages import MANIFEST, NotebookRun, manifest_of

CODE = ("harmolab", "notebooks")  # folders of a project whose last change a run is of
DRAWS = ("_figure", "_picture")  # ends of the names of functions that draw; so do those that begin with "draw_"


def code_commit(project: Path) -> str:
    """The last commit that changed the code of a project, with "+" where files differ from it; "" without git."""
    commands = (["log", "-1", "--format=%h"], ["status", "--porcelain"])
    try:
        answers = [
            subprocess.run(["git", *command, "--", *CODE], cwd=project, capture_output=True, text=True, check=True)
            for command in commands
        ]
    except (OSError, subprocess.CalledProcessError):
        return ""
    commit, changed = (answer.stdout.strip() for answer in answers)
    return f"{commit}+" if commit and changed else commit


def published_notebooks(figures: Path, commit: str) -> set[str]:
    """Names, without ".ipynb", of the notebooks whose figures are all of this commit.

    None of a commit that is not known, or that files differ from.
    """
    if not commit or commit.endswith("+"):
        return set()
    entries = manifest_of(figures).values()
    other = {notebook_of(entry) for entry in entries if entry.get("commit") != commit}
    return {notebook_of(entry) for entry in entries} - other


def notebook_of(entry: Mapping[str, Any]) -> str:
    """The notebook of an entry of the manifest, without ".ipynb"."""
    return str(entry.get("notebook", "")).removesuffix(".ipynb")


def experiment_digest(node: nbformat.NotebookNode) -> str:
    """Twelve digits that change with what the code cells of a notebook compute.

    They do not change with its texts and comments, nor with functions that draw: pictures are drawn again from tables.
    """
    lines = [line for cell in node.cells if cell.cell_type == "code" for line in cell.source.splitlines()]
    body = ast.parse("\n".join(line for line in lines if not line.startswith("%"))).body
    code = [ast.unparse(part) for part in body if not (isinstance(part, ast.FunctionDef) and _draws(part.name))]
    return hashlib.sha256("\n".join(code).encode()).hexdigest()[:12]


def _draws(name: str) -> bool:
    return name.startswith("draw_") or name.endswith(DRAWS)


def publish(run: NotebookRun, pictures: Path, figures: Path, commit: str) -> None:
    """Copy what a notebook saved in `pictures` to `figures`, and last the manifest that lists it.

    What the notebook published before and saved no more is removed, and what is private is left out. The manifest gets
    the commit, the day, the seconds that the notebook took, and the `experiment_digest` of its code.
    """
    name = run.path.stem
    about = {"commit": commit, "date": f"{datetime.now(UTC):%Y-%m-%d}", "seconds": round(run.seconds)}
    about |= {"experiment": experiment_digest(run.node)}
    saved = {file: entry for file, entry in manifest_of(pictures).items() if not entry.get("private")}
    drawn = {file: entry | about for file, entry in saved.items() if notebook_of(entry) == name}
    others = {file: entry for file, entry in manifest_of(figures).items() if notebook_of(entry) != name}
    figures.mkdir(parents=True, exist_ok=True)
    for file in drawn:
        with atomic_write(figures / file) as part:
            shutil.copyfile(pictures / file, part)
    _write(figures, others | drawn)


def remove_others(figures: Path, notebooks: Collection[str]) -> None:
    """Remove what was published by other notebooks than these: they are no more."""
    manifest = manifest_of(figures)
    kept = {file: entry for file, entry in manifest.items() if notebook_of(entry) in notebooks}
    if len(kept) < len(manifest):
        _write(figures, kept)


def _write(figures: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest, then remove the files that only the one before lists."""
    before = manifest_of(figures)
    write_json(figures / MANIFEST, dict(sorted(manifest.items())))
    for file in before.keys() - manifest.keys():
        (figures / Path(file).name).unlink(missing_ok=True)
