"""The notebooks keep their form. That each runs from top to bottom is seen by `make report`, which runs them all."""

import ast
import json
import re
from functools import cache
from itertools import groupby
from pathlib import Path

import nbformat
import pytest

from harmolab.lab.report.pages import PAPER
from study import notebook_finding
from tests.builders import cases

ROOT = Path(__file__).resolve().parents[1]
PATHS = sorted((ROOT / "notebooks").glob("*.ipynb"))
COUNT = 21
PARTS = ["the score", "the generator", "your own dance", "Music2Dance", "players"]
MOST_CELLS, MOST_LINES, LONGEST_FUNCTION = 30, 40, 25

ABSOLUTE = re.compile(r"(?:/\w[\w.-]*|~\w*)/|/tmp|[A-Za-z]:[\\/]")

every_notebook = pytest.mark.parametrize("path", PATHS, ids=[path.stem for path in PATHS])


@cache
def notebook_of(path: Path) -> nbformat.NotebookNode:
    return nbformat.read(path, as_version=4)


def sources(path: Path, kind: str, tag: str = "") -> list[str]:
    """What the cells of a kind hold, those with a tag alone if one is named."""
    cells = [cell for cell in notebook_of(path).cells if cell.cell_type == kind]
    return [cell.source for cell in cells if not tag or tag in cell.metadata.get("tags", [])]


def form_faults(source: str) -> list[str]:
    """What one code cell must not hold."""
    tree = ast.parse("\n".join(line for line in source.splitlines() if not line.lstrip().startswith("%")))
    found = [f"{len(source.splitlines())} lines"] if len(source.splitlines()) > MOST_LINES else []
    for node in ast.walk(tree):
        if isinstance(node, ast.AsyncFunctionDef | ast.ClassDef | ast.Try):
            found.append(f"{type(node).__name__} in line {node.lineno}")
        lines = node.end_lineno - node.body[0].lineno + 1 if isinstance(node, ast.FunctionDef) else 0
        if lines > LONGEST_FUNCTION:
            found.append(f"{node.name} has {lines} lines")
        if isinstance(node, ast.Constant) and re.match(r"[/~]\w|[A-Za-z]:\\", str(node.value)):
            found.append(f"absolute path {node.value!r}")
        if isinstance(node, ast.Name | ast.Attribute | ast.alias):
            name = getattr(node, "id", None) or getattr(node, "attr", None) or node.name
            if name.rpartition(".")[2] in ("interact", "interactive", "interactive_output", "Output"):
                found.append(f"{name}, which hangs or stays blank in a report; make a live lab")
    return found


def test_all_notebooks_are_there_and_numbered_without_a_gap():
    assert [path.stem[:3] for path in PATHS] == [f"{number:02d}_" for number in range(COUNT)]


@every_notebook
def test_notebook_is_committed_without_outputs(path: Path):
    nbformat.validate(json.loads(path.read_text("utf-8")))
    cells = [cell for cell in notebook_of(path).cells if cell.cell_type == "code"]
    assert [(cell.outputs, cell.execution_count) for cell in cells] == [([], None)] * len(cells)
    assert "widgets" not in notebook_of(path).metadata


@every_notebook
def test_notebook_starts_with_a_title_and_takes_its_profile_from_one_tagged_cell_that_shows_nothing(path: Path):
    assert notebook_of(path).cells[0].source.startswith(f"# {path.stem[:2]} ")
    (parameters,) = sources(path, "code", "parameters")
    assert "profile = RunProfile.from_env()" in parameters
    assert not isinstance(ast.parse(parameters).body[-1], ast.Expr)


def test_every_notebook_says_which_items_of_the_paper_it_builds():
    assert {item for path in PATHS for item in notebook_of(path).metadata["harmolab"]["paper"]} <= set(PAPER)


@every_notebook
def test_notebook_opens_with_its_finding_and_a_committed_picture_of_it(path: Path):
    facts, finding = notebook_of(path).metadata["harmolab"], notebook_finding(path)
    assert "\n\n" not in notebook_of(path).cells[0].source
    # A finding has its number, but where something is to be heard before any number.
    assert any(digit.isdigit() for digit in finding) != facts.get("heard_first", False)
    entry = json.loads((ROOT / "figures" / "manifest.json").read_text("utf-8"))[facts["picture"]]
    assert (entry["notebook"], Path(facts["picture"]).suffix) == (path.name, ".png")


def test_story_has_its_parts_in_one_piece_each():
    assert [part for part, _ in groupby([notebook_of(path).metadata["harmolab"]["part"] for path in PATHS])] == PARTS


@every_notebook
def test_notebook_asks_before_it_answers(path: Path):
    headings = re.findall(r"^## (.+)$", "\n".join(sources(path, "markdown")), flags=re.MULTILINE)
    assert sum("?" in heading for heading in headings) >= 3


@every_notebook
def test_notebook_says_how_to_read_it_and_what_may_be_wrong(path: Path):
    text = "\n".join(sources(path, "markdown"))
    assert "## What may be wrong" in text
    assert path == PATHS[-1] or re.search(r"^Next: \[\d\d .+\]\(\d\d_\w+\.ipynb\)$", text, flags=re.MULTILINE)


@every_notebook
def test_notebook_is_short_cells_of_short_functions(path: Path):
    cells = sources(path, "code")
    assert len(cells) <= MOST_CELLS
    assert [fault for cell in cells for fault in form_faults(cell)] == []


@cases(
    "source, fault",
    ("x = 1\n" * 41, "41 lines"),
    ("def f():\n" + "    x = 1\n" * 26, "f has 26 lines"),
    ("try:\n    x = 1\nfinally:\n    pass", "Try in line 1"),
    ("class A:\n    pass", "ClassDef in line 1"),
    ("open('/home/me/a.wav')", "absolute path '/home/me/a.wav'"),
    ("open('~user/a.wav')", "absolute path '~user/a.wav'"),
    ("from ipywidgets import interact", "interact, which hangs or stays blank in a report; make a live lab"),
    ("widgets.Output()", "Output, which hangs or stays blank in a report; make a live lab"),
)
def test_planted_fault_of_form_is_found(source: str, fault: str):
    assert form_faults(source) == [fault]


def test_ordinary_cell_has_no_fault():
    source = "%config InlineBackend.figure_format = 'png'\nax.set(ylabel='speed (m/s)')\ndef half(x): return x / 2"
    assert form_faults(source) == []


def test_every_published_figure_has_its_notebook_and_its_file_and_comes_from_the_full_profile():
    entries = json.loads((ROOT / "figures" / "manifest.json").read_text("utf-8"))
    assert {entry["notebook"] for entry in entries.values()} <= {path.name for path in PATHS}
    assert {entry["profile"] for entry in entries.values()} == {"full"}
    assert {file.name for file in (ROOT / "figures").glob("*.*") if file.suffix in (".png", ".csv")} == set(entries)


@every_notebook
def test_notebook_saves_under_its_own_name(path: Path):
    named = re.findall(r'"notebook": "(\w+)"', "\n".join(sources(path, "code")))
    assert named and set(named) == {path.stem}


# Code, formulas, links and the number of the notebook.
NO_PROSE = r"```.*?```|`[^`]*`|\$\$.*?\$\$|\$[^$]*\$|\[\d\d [^\]]*\]\([^)]*\)|\]\([^)]*\)|^# \d\d "
# Words after which a number is an address: Eq. 7-21, Figs. 1 and 3, Sec. 4.1, [05 Right from wrong].
NAMED = r"\d[\d.a-d]*"
ADDRESS = rf"(?:Eqs?|Figs?|Sec|Tables?|[Nn]otebooks?)\.?\s*{NAMED}(?:(?:-|, | and | to ){NAMED})*"


def typed_numbers(markdown: str, code: str) -> list[str]:
    """Numerals in prose that are no address, stand in no formula or code, and that no code cell of the notebook has."""
    text = re.sub(ADDRESS, " ", re.sub(NO_PROSE, " ", markdown, flags=re.S | re.M))
    numbers = re.findall(r"(?<![\w.])\.?\d+(?:[.,]\d+)*", text)
    literals = {float(literal) for literal in re.findall(r"(?<![\w.])\d*\.?\d+", code)}
    return [number for number in numbers if float(number.replace(",", "")) not in literals]


@cases(
    "markdown, numbers",
    ("By Eq. 7-9 and Sec. 3.3, $x = 5$ and `8`: [05 Next](05_next.ipynb)", []),
    ("Hits 88 % of the beats at .25 s", ["88", ".25"]),
    ("Within 0.5 s", []),
)
def test_typed_numbers_are_those_that_no_code_has(markdown: str, numbers: list[str]) -> None:
    assert typed_numbers(markdown, "delay = 0.5") == numbers


@every_notebook
def test_no_number_in_its_prose_is_typed(path: Path) -> None:
    code = "\n".join(sources(path, "code"))
    assert [number for cell in sources(path, "markdown") for number in typed_numbers(cell, code)] == []
