"""Runs the notebooks and makes of them one offline report, a page each and an index; publishes what a full run drew."""

import argparse
import ast
import asyncio
import csv
import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError
from nbconvert.filters.ansi import strip_ansi
from tqdm import tqdm

from harmolab.files import atomic_folder, atomic_write, write_json
from harmolab.lab.report import MANIFEST
from harmolab.lab.report.pages import MARK, SAVED, NotebookRun, manifest_of, write_pages

# Figures and tables of a full run: a notebook's replace what it published before, once it has run

CODE = ("harmolab", "notebooks")  # folders of a project whose last change a run is of
DRAWS = ("_figure", "_picture")  # ends of the names of functions that draw; so do those that begin with "draw_"


def code_commit(project: Path) -> str:
    """The last commit that changed the code of a project, with "+" where files differ from it; "" without git."""
    try:
        answers = [
            subprocess.run(["git", *command, "--", *CODE], cwd=project, capture_output=True, text=True, check=True)
            for command in (["log", "-1", "--format=%h"], ["status", "--porcelain"])
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


def experiment_digest(node: nbformat.NotebookNode, columns: Sequence[str] = ()) -> str:
    """Twelve digits that change with what the code cells of a notebook compute.

    They do not change with its texts and comments, nor with functions that draw: pictures are drawn again from tables,
    and so is the sentence of the cell "finding". Nor with the names of `columns`, those of its tables, in their order.
    """
    cells = [cell for cell in node.cells if cell.cell_type == "code" and "finding" not in cell.metadata.get("tags", ())]
    lines = [line for cell in cells for line in cell.source.splitlines()]
    tree = ast.parse("\n".join(line for line in lines if not line.startswith("%")))
    places = {name: f"column {place}" for place, name in enumerate(columns)}
    for part in ast.walk(tree):
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            part.value = places.get(part.value, part.value)
    code = [ast.unparse(part) for part in tree.body if not (isinstance(part, ast.FunctionDef) and _draws(part.name))]
    return hashlib.sha256("\n".join(code).encode()).hexdigest()[:12]


def column_names(folder: Path, files: Iterable[str]) -> list[str]:
    """Names of the columns of the tables among some files of a folder, each once, in the order of the files' names."""
    tables = [folder / file for file in sorted(files) if file.endswith(".csv")]
    headers = (next(csv.reader(table.read_text("utf-8").splitlines()[:1]), []) for table in tables)
    return list(dict.fromkeys(chain.from_iterable(headers)))


def _draws(name: str) -> bool:
    return name.startswith("draw_") or name.endswith(DRAWS)


def publish(run: NotebookRun, pictures: Path, figures: Path, commit: str) -> None:
    """Copy what a notebook saved in `pictures` to `figures`, and last the manifest that lists it.

    What the notebook published before and saved no more is removed, and what is private is left out. The manifest gets
    the commit, the day, the seconds that the notebook took, and the `experiment_digest` of its code.
    """
    name = run.path.stem
    about = {"commit": commit, "date": f"{datetime.now(UTC):%Y-%m-%d}", "seconds": round(run.seconds)}
    saved = {file: entry for file, entry in manifest_of(pictures).items() if not entry.get("private")}
    drawn = {file: entry for file, entry in saved.items() if notebook_of(entry) == name}
    about |= {"experiment": experiment_digest(run.node, column_names(pictures, drawn))}
    drawn = {file: entry | about for file, entry in drawn.items()}
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


DOCUMENTS = ("claims.md", "report.md")  # of docs/, which become pages of the report
LONGEST = 5  # notebooks whose minutes are told
TIMEOUTS = {"quick": 900.0, "full": 21600.0, "gpu": 21600.0}  # seconds a cell may take, by profile


@dataclass(frozen=True)
class Report:
    """A finished report: its index page, and the run of each notebook."""

    index: Path
    runs: tuple[NotebookRun, ...]

    @property
    def failures(self) -> tuple[NotebookRun, ...]:
        """The notebooks that did not run to their end."""
        return tuple(run for run in self.runs if run.error)


def build(
    notebooks: Path,
    out: Path,
    *,
    profile: str = "quick",
    figures: Path | None = None,
    only: Sequence[str] = (),
    timeout: float = 900.0,
    jobs: int = 2,
    progress: bool = True,
) -> Report:
    """The report of every notebook in a folder, written to `out`.

    A notebook that fails is marked so, and the report is written all the same. `out` is replaced as a whole at the
    end, so it never holds half a report. What is published is published notebook by notebook, as each has run; those
    that were published by the same commit of the code are not run again. So a killed run goes on where it was.

    Parameters
    ----------
    notebooks : folder that holds *.ipynb; also the working directory of their kernels
    out : folder to write; an earlier report there is replaced
    profile : "quick", "full" or "gpu"
    figures : folder, optional; where to publish figures, tables and manifest of the notebooks that ran too
    only : beginnings of names, such as "07": the notebooks to run; all when left out
    timeout : float, seconds that one cell may take
    jobs : int, notebooks to run at the same time

    Raises
    ------
    FileNotFoundError
        If there is no notebook, or none of such a name.
    ValueError
        If `out` is a file, or holds something that is no report of ours.
    """
    notebooks, out = Path(notebooks).resolve(), Path(out).resolve()
    index, commit = out / "index.html", code_commit(notebooks.parent) if figures else ""
    paths = notebooks_of(notebooks, only)
    if out.is_file():
        raise ValueError(f"{out} is a file; name a folder for the report")
    is_report = index.is_file() and MARK in index.read_text("utf-8", errors="replace")
    if out.is_dir() and any(out.iterdir()) and not is_report:
        raise ValueError(f"{out} holds files that are no report of ours; name an empty or new folder")
    if figures is not None:
        remove_others(figures, {path.stem for path in notebooks.glob("*.ipynb")})
        done = published_notebooks(figures, commit)
        paths = [path for path in paths if path.stem not in done]
    if not paths:
        return Report(index, ())
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_folder(out) as part:
        pictures = part / "figures"
        pictures.mkdir()
        variables = {"HARMOLAB_PROFILE": profile, "HARMOLAB_FIGURES": str(pictures)}
        publish_one = None if figures is None else partial(publish, pictures=pictures, figures=figures, commit=commit)
        runs = asyncio.run(_run_all(paths, variables, timeout, jobs, progress, publish_one))
        pages = [path for path in (notebooks.parent / "docs" / name for name in DOCUMENTS) if path.is_file()]
        write_pages(part, runs, profile, committed=notebooks.parent / "figures", documents=pages)
    return Report(index, tuple(runs))


def notebooks_of(folder: Path, only: Sequence[str] = ()) -> list[Path]:
    """The notebooks of a folder in their order, those whose names begin so; FileNotFoundError where one names none."""
    paths = sorted(folder.glob("*.ipynb"))
    if not paths:
        raise FileNotFoundError(f"no notebooks (*.ipynb) in {folder}")
    for beginning in only:
        if not any(path.name.startswith(beginning) for path in paths):
            raise FileNotFoundError(f"no notebook in {folder} begins with {beginning!r}")
    return [path for path in paths if not only or path.name.startswith(tuple(only))]


async def _run_all(
    paths: Sequence[Path],
    variables: Mapping[str, str],
    timeout: float,
    jobs: int,
    progress: bool,
    publish_one: Callable[[NotebookRun], None] | None,
) -> list[NotebookRun]:
    """All notebooks, at most `jobs` kernels at a time, in the order given; each is published when it has run."""
    places = asyncio.Semaphore(jobs)
    threads = str(max(1, (os.cpu_count() or 1) // jobs))  # so that the kernels do not fight over the cores
    variables = {"OMP_NUM_THREADS": threads, **variables}
    bar = tqdm(total=len(paths), desc="notebooks", unit="", disable=not progress)

    async def one(path: Path) -> NotebookRun:
        async with places:
            run = await _run(path, variables, timeout)
            if publish_one and not run.error:
                publish_one(run)
        bar.set_postfix_str(f"{path.stem} {'FAILED' if run.error else 'ran'} in {run.seconds:.0f} s")
        bar.update()
        return run

    with bar:
        return list(await asyncio.gather(*map(one, paths)))


async def _run(path: Path, variables: Mapping[str, str], timeout: float) -> NotebookRun:
    """One notebook in one kernel; its own errors end up in the result."""
    try:
        node = nbformat.read(path, as_version=4)
    except ValueError:
        empty = nbformat.v4.new_notebook()
        return NotebookRun(path, empty, 0.0, "its file, which is no notebook: saved in part, or with marks of a merge")
    started: list[int] = []
    environment = {**os.environ, **variables}
    client = NotebookClient(
        node,
        timeout=timeout,
        kernel_name="python3",  # whatever kernel its author saved it with
        # With widget state in the file, a static page shows an empty widget in place of its picture.
        store_widget_state=False,
        resources={"metadata": {"path": str(path.parent)}},
        extra_arguments=["--log-level=ERROR"],  # every kernel would warn of its local TCP connection
        on_cell_start=lambda cell, cell_index: started.append(cell_index),
        on_cell_executed=_saved_by_cell(path.name, environment.get("HARMOLAB_FIGURES")),
    )
    # Set outright: a plain "Agg" from outside would leave every figure out of the page.
    inline = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    before, fault = time.perf_counter(), ""
    try:
        await client.async_execute(env={**environment, **inline})
    except CellExecutionError as error:
        fault = f"{error.ename}: {strip_ansi(error.evalue)}"
    except CellTimeoutError:
        fault = f"still running after {timeout:g} s"
    except RuntimeError:  # dead, or not alive in time
        fault = "the kernel died"
    # The code cell that ran last, counted as the reader counts them.
    number = sum(cell.cell_type == "code" for cell in node.cells[: max(started, default=0) + 1])
    return NotebookRun(path, node, time.perf_counter() - before, f"code cell {number}: {fault}" if fault else "")


def _saved_by_cell(notebook: str, folder: str | None) -> Callable[..., None]:
    """Notes in each executed cell which figures and tables it wrote; the manifest beside them names their notebook."""

    def entries() -> list[str]:
        manifest = manifest_of(Path(folder)) if folder else {}
        return [name for name, entry in manifest.items() if entry["notebook"] == notebook]

    def note(cell: nbformat.NotebookNode, **_: object) -> None:
        cell.metadata[SAVED] = [name for name in entries() if name not in names]
        names.update(cell.metadata[SAVED])

    names = set(entries())
    return note


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds the report that the command line asks for; 1 if a notebook failed, else 0."""
    parser = argparse.ArgumentParser(prog="python -m harmolab.lab.report.run", description=__doc__)
    parser.add_argument("--notebooks", type=Path, default=Path("notebooks"), help="folder of notebooks")
    parser.add_argument("--out", type=Path, default=Path("report"), help="folder to write")
    parser.add_argument("--profile", choices=("quick", "full", "gpu"), default="quick")
    parser.add_argument("--figures", type=Path, help="publish figures and tables of each notebook that ran here")
    parser.add_argument("--only", nargs="+", default=(), metavar="07", help="run notebooks whose names begin so")
    parser.add_argument("--timeout", type=float, help="seconds a cell may take (quick: 900, others: 6 hours)")
    parser.add_argument("--jobs", type=int, default=2, help="notebooks at the same time")
    options = parser.parse_args(arguments)
    options.timeout = options.timeout or TIMEOUTS[options.profile]
    try:
        report = build(**vars(options))
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return print_outcome(report)


def print_outcome(report: Report) -> int:
    """Prints which notebooks failed and where the report is; 1 if one did, else 0."""
    if not report.runs:
        print("every notebook is published as this commit of the code has it")
        return 0
    for run in report.failures:
        print(f"FAILED {run.path.name} in {run.error}", file=sys.stderr)
    print(f"{len(report.runs) - len(report.failures)} of {len(report.runs)} notebooks ran; open {report.index}")
    longest = sorted(report.runs, key=lambda run: -run.seconds)[:LONGEST]
    parts = ", ".join(f"{run.path.stem} {run.seconds / 60:.1f}" for run in longest)
    print(f"minutes: {sum(run.seconds for run in report.runs) / 60:.1f}; the longest: {parts}")
    return 1 if report.failures else 0


if __name__ == "__main__":
    sys.exit(main())
