"""The notebooks keep their form, and each runs from top to bottom."""

import ast
import json
import re
from itertools import groupby
from pathlib import Path

import nbformat
import pytest

from harmolab.lab.report.pages import PAPER
from harmolab.lab.report.run import run_notebook
from study import notebook_finding
from tests.builders import cases

ROOT = Path(__file__).resolve().parents[1]
PATHS = sorted((ROOT / "notebooks").glob("*.ipynb"))
NAMES = [
    "00_start_here",
    "01_harmony_distortion",
    "02_flow_or_skeleton",
    "03_beats_from_joint_speed",
    "04_salience_and_scoring",
    "05_right_from_wrong",
    "06_meter_units",
    "07_anatomy_and_training",
    "08_motion_quality",
    "09_harmony_loss",
    "10_systems_compared",
    "11_frame_by_frame",
    "12_cheating_the_score",
    "13_your_own_dance",
    "14_listening_study",
    "15_music_and_attributes",
    "16_music2dance",
    "17_feet",
    "18_sound_and_points",
    "19_sound_to_hands",
    "20_players_and_avatars",
]
PARTS = ["the score", "the generator", "your own dance", "Music2Dance", "players"]
MOST_CELLS = 30
MOST_LINES = 40
LONGEST_FUNCTION = 25
# Under a minute is the aim on two cores; but the first notebook that needs generators trains them for all others, which
# wait for it.
SECONDS_PER_CELL = 900

ABSOLUTE = re.compile(r"(?:/\w[\w.-]*|~\w*)/|/tmp|[A-Za-z]:[\\/]")

every_notebook = pytest.mark.parametrize("path", PATHS, ids=[path.stem for path in PATHS])


def code_cells(path: Path) -> list[nbformat.NotebookNode]:
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def markdown_cells(path: Path) -> list[nbformat.NotebookNode]:
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown"]


def form_faults(source: str) -> list[str]:
    """What one code cell must not hold."""
    tree = ast.parse("\n".join(line for line in source.splitlines() if not line.lstrip().startswith("%")))
    found = [f"{len(source.splitlines())} lines"] if len(source.splitlines()) > MOST_LINES else []
    for node in ast.walk(tree):
        if isinstance(node, ast.AsyncFunctionDef | ast.ClassDef | ast.Try):
            found.append(f"{type(node).__name__} in line {node.lineno}")
        if (
            isinstance(node, ast.FunctionDef)
            and (lines := node.end_lineno - node.body[0].lineno + 1) > LONGEST_FUNCTION
        ):
            found.append(f"{node.name} has {lines} lines")
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and re.match(r"[/~]\w|[A-Za-z]:\\", node.value)
        ):
            found.append(f"absolute path {node.value!r}")
        if isinstance(node, ast.Name | ast.Attribute | ast.alias):
            name = getattr(node, "id", None) or getattr(node, "attr", None) or node.name
            if name.rpartition(".")[2] in ("interact", "interactive", "interactive_output", "Output"):
                found.append(f"{name}, which hangs or stays blank in a report; make a live lab")
    return found


def test_all_notebooks_are_there_and_numbered_without_a_gap():
    assert [path.stem for path in PATHS] == NAMES
    assert [name[:2] for name in NAMES] == [f"{number:02d}" for number in range(len(NAMES))]


@every_notebook
def test_notebook_is_committed_without_outputs(path: Path):
    nbformat.validate(json.loads(path.read_text("utf-8")))
    cells = code_cells(path)
    assert [cell.outputs for cell in cells] == [[]] * len(cells)
    assert [cell.execution_count for cell in cells] == [None] * len(cells)
    assert "widgets" not in nbformat.read(path, as_version=4).metadata


@every_notebook
def test_notebook_starts_with_a_title_and_takes_its_profile_from_one_tagged_cell(path: Path):
    notebook = nbformat.read(path, as_version=4)
    assert notebook.cells[0].cell_type == "markdown"
    assert notebook.cells[0].source.startswith("# ")
    tagged = [cell.source for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assert len(tagged) == 1
    assert "profile = RunProfile.from_env()" in tagged[0]


def test_every_notebook_says_which_items_of_the_paper_it_builds():
    items = {path.stem: nbformat.read(path, as_version=4).metadata["harmolab"]["paper"] for path in PATHS}
    assert {name: sorted(set(named) - set(PAPER)) for name, named in items.items() if set(named) - set(PAPER)} == {}


@every_notebook
def test_notebook_opens_with_its_finding_and_a_committed_picture_of_it(path: Path):
    notebook = nbformat.read(path, as_version=4)
    facts = notebook.metadata["harmolab"]
    title, _, typed = notebook.cells[0].source.partition("\n\n")
    finding = notebook_finding(path)
    assert typed == ""
    assert title.startswith(f"# {path.stem[:2]} ")
    # A finding has its number, but where something is to be heard before any number.
    assert any(digit.isdigit() for digit in finding) != facts.get("heard_first", False)
    entry = json.loads((ROOT / "figures" / "manifest.json").read_text("utf-8"))[facts["picture"]]
    assert (entry["notebook"], Path(facts["picture"]).suffix) == (path.name, ".png")


def test_story_has_its_parts_in_one_piece_each():
    parts = [nbformat.read(path, as_version=4).metadata["harmolab"]["part"] for path in PATHS]
    assert [part for part, _ in groupby(parts)] == PARTS


@every_notebook
def test_notebook_asks_before_it_answers(path: Path):
    headings = re.findall(r"^## (.+)$", "\n".join(cell.source for cell in markdown_cells(path)), flags=re.MULTILINE)
    assert sum("?" in heading for heading in headings) >= 3


@every_notebook
def test_notebook_does_not_greet_with_its_settings(path: Path):
    tagged = [cell for cell in code_cells(path) if "parameters" in cell.metadata.get("tags", [])]
    assert not isinstance(ast.parse(tagged[0].source).body[-1], ast.Expr)


@every_notebook
def test_notebook_says_how_to_read_it_and_what_may_be_wrong(path: Path):
    text = "\n".join("".join(cell["source"]) for cell in json.loads(path.read_text("utf-8"))["cells"])
    assert "## What may be wrong" in text
    assert path == PATHS[-1] or re.search(r"^Next: \[\d\d .+\]\(\d\d_\w+\.ipynb\)$", text, flags=re.MULTILINE)


@every_notebook
def test_notebook_is_short_cells_of_short_functions(path: Path):
    cells = code_cells(path)
    assert len(cells) <= MOST_CELLS
    assert [fault for cell in cells for fault in form_faults(cell.source)] == []


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


def test_every_published_figure_has_its_notebook_and_its_file():
    manifest = ROOT / "figures" / "manifest.json"
    entries = json.loads(manifest.read_text("utf-8")) if manifest.is_file() else {}
    assert {entry["notebook"] for entry in entries.values()} <= {path.name for path in PATHS}
    files = {file.name for file in (ROOT / "figures").glob("*.*") if file.suffix in (".png", ".csv")}
    assert files == set(entries)


def test_published_figures_come_from_the_full_profile():
    manifest = ROOT / "figures" / "manifest.json"
    entries = json.loads(manifest.read_text("utf-8")) if manifest.is_file() else {}
    assert {entry["profile"] for entry in entries.values()} <= {"full"}


@pytest.mark.slow
@every_notebook
def test_notebook_runs_from_top_to_bottom_in_the_quick_profile(path: Path, tmp_path: Path):
    variables = {"HARMOLAB_PROFILE": "quick", "HARMOLAB_FIGURES": str(tmp_path), "HARMOLAB_DATA": ""}
    assert run_notebook(path, variables=variables, timeout=SECONDS_PER_CELL).error == ""
    manifest = json.loads((tmp_path / "manifest.json").read_text("utf-8"))
    assert {entry["notebook"] for entry in manifest.values()} == {path.name}


# Words after which a number is an address: Eq. 7-21, Figs. 1 and 3, Sec. 4.1, [05 Right from wrong].
NAMED = r"\d[\d.a-d]*"
ADDRESS = rf"(?:Eqs?|Figs?|Sec|Tables?|[Nn]otebooks?)\.?\s*{NAMED}(?:(?:-|, | and | to ){NAMED})*"


def typed_numbers(markdown: str, code: str) -> list[str]:
    """Numerals in prose that are no address, stand in no formula or code, and that no code cell of the notebook has."""
    text = re.sub(
        r"```.*?```|`[^`]*`|\$\$.*?\$\$|\$[^$]*\$|\[\d\d [^\]]*\]\([^)]*\)|\]\([^)]*\)|^# \d\d ",
        " ",
        markdown,
        flags=re.S | re.M,
    )
    text = re.sub(ADDRESS, " ", text)
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
    code = "\n".join(cell.source for cell in code_cells(path))
    assert [number for cell in markdown_cells(path) for number in typed_numbers(cell.source, code)] == []
