"""`figures/` holds what the notebooks, as they stand, save in one full run: nothing is missing, nothing stale."""

import ast
import json
import re
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

import nbformat
import pytest

from harmolab.lab.report import MANIFEST
from harmolab.lab.report.run import column_names, experiment_digest, notebook_of
from study.figures.redraw import PICTURES
from study.saving import PRIVATE

ROOT = Path(__file__).resolve().parents[1]
PATHS = {path.stem: path for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
ENTRIES: dict[str, dict[str, Any]] = json.loads((ROOT / "figures" / MANIFEST).read_text("utf-8"))
PEOPLE = re.compile("|".join(f"'{source}'" for source in PRIVATE))
SAVES = {"save_figure": ".png", "save_table": ".csv"}

each_notebook = pytest.mark.parametrize("stem", PATHS)


def test_digest_changes_with_what_is_computed_and_not_with_words_or_with_what_draws():
    drawing = "def draw_all(x):\n    return x\n\n\n"
    cells = {
        "as it is": [f"{drawing}x = 1", "%time\ny = 2"],
        "commented": [f"{drawing}x = 1  # one", "y = 2"],
        "drawn otherwise": [f"{drawing.replace('return x', 'return 2 * x')}x = 1", "y = 2"],
        "another number": [f"{drawing}x = 2", "y = 2"],
    }
    digests = {}
    for name, codes in cells.items():
        own = [nbformat.v4.new_code_cell(code) for code in codes]
        says = nbformat.v4.new_code_cell(f"words = {name!r}", metadata={"tags": ["finding"]})
        digests[name] = experiment_digest(nbformat.v4.new_notebook(cells=[says, *own]))
    assert digests["as it is"] == digests["commented"] == digests["drawn otherwise"] != digests["another number"]


def test_digest_keeps_with_a_column_that_is_renamed_in_code_and_table_and_with_nothing_less(tmp_path: Path):
    def digest(code: str, header: str) -> str:
        (tmp_path / "table.csv").write_text(f"{header}\n1,2\n", "utf-8")
        columns = column_names(tmp_path, ["picture.png", "table.csv"])
        return experiment_digest(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)]), columns)

    code, header = "row = {'h': 1, 'told the beats': 2}", 'h,"told the beats"'
    renamed = code.replace("told the beats", "hears, counted"), header.replace("told the beats", "hears, counted")
    others = digest(renamed[0], header), digest(code, renamed[1]), digest(code.replace("2", "3"), header)
    assert digest(code, header) == digest(*renamed) not in others


@cache
def published(stem: str) -> dict[str, dict[str, Any]]:
    """The entries of a notebook in the manifest, by file."""
    return {file: entry for file, entry in ENTRIES.items() if notebook_of(entry) == stem}


@cache
def saved_names(stem: str) -> list[str]:
    """Files that a notebook saves and publishes, as patterns: "*" stands for what a loop puts into a name."""
    code = "\n".join(cell.source for cell in nbformat.read(PATHS[stem], 4).cells if cell.cell_type == "code")
    calls = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Call)]
    calls = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id in SAVES]
    shown = [call for call in calls if "private=True" not in ast.unparse(call) and not PEOPLE.search(ast.unparse(call))]
    return [pattern_of(call.args[1]) + SAVES[call.func.id] for call in shown if isinstance(call.func, ast.Name)]


def pattern_of(name: ast.expr) -> str:
    """The name of a figure in a call, with "*" for each part that is computed."""
    parts = name.values if isinstance(name, ast.JoinedStr) else [name]
    return "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in parts)


@each_notebook
def test_all_that_a_notebook_saves_is_published_and_nothing_else(stem: str):
    missing = [name for name in saved_names(stem) if not any(fnmatchcase(file, name) for file in published(stem))]
    others = [file for file in published(stem) if not any(fnmatchcase(file, name) for name in saved_names(stem))]
    assert (missing, others) == ([], [])
    assert [file for file in published(stem) if not (ROOT / "figures" / file).is_file()] == []


@each_notebook
def test_published_files_are_of_the_experiment_as_it_stands(stem: str):
    columns = column_names(ROOT / "figures", published(stem))
    digest = experiment_digest(nbformat.read(PATHS[stem], 4), columns)
    assert {entry.get("experiment") for entry in published(stem).values()} == {digest}


def test_all_published_files_are_of_one_commit_of_the_full_profile():
    assert len({entry.get("commit") for entry in ENTRIES.values()}) == 1
    assert {entry["profile"] for entry in ENTRIES.values()} == {"full"}


def test_every_picture_that_can_be_drawn_again_is_published_with_its_tables():
    tables = {f"{name}.csv" for _, _, *names in PICTURES.values() for name in names}
    assert {f"{name}.png" for name in PICTURES} | tables <= set(ENTRIES)
