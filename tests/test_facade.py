"""The three doors: notebooks, README and docs import from `harmolab`, `harmolab.systems` and `harmolab.lab` only."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import harmolab
import harmolab.lab
import harmolab.systems

ROOT = Path(__file__).resolve().parents[1]
DOORS = {"harmolab": harmolab, "harmolab.systems": harmolab.systems, "harmolab.lab": harmolab.lab}


def sources() -> Iterator[tuple[str, str]]:
    """(file, Python source) of every code cell of a notebook and every code block of a document."""
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for cell in json.loads(path.read_text("utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                yield path.name, re.sub(r"^%.*$", "pass", "".join(cell["source"]), flags=re.MULTILINE)
    for path in sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")]):
        for block in re.findall(r"```(?:python|py|pycon)?\n(.*?)```", path.read_text("utf-8"), flags=re.DOTALL):
            yield path.name, "\n".join(re.findall(r"^(?:>>> )?((?:from|import) .*)$", block, flags=re.MULTILINE))


def imports() -> Iterator[tuple[str, str, str]]:
    """(file, module, name) of every import of harmolab in them; name "" for `import module`."""
    for file, source in sources():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ImportFrom) and re.match(r"harmolab\b", node.module or ""):
                yield from ((file, str(node.module), alias.name) for alias in node.names)
            if isinstance(node, ast.Import):
                yield from ((file, alias.name, "") for alias in node.names if re.match(r"harmolab\b", alias.name))


def test_notebooks_readme_and_docs_import_from_three_doors():
    elsewhere = {(file, module) for file, module, _ in imports() if module not in DOORS}
    assert elsewhere == set()
    assert {module for _, module, _ in imports()} == set(DOORS)
    assert len({file for file, _, _ in imports()}) >= 15  # the search finds them


def test_every_name_they_import_is_public():
    assert [(file, name) for file, module, name in imports() if name and name not in DOORS[module].__all__] == []


@pytest.mark.parametrize("door", DOORS)
def test_every_public_name_resolves_to_what_is_called_so(door: str):
    for name in DOORS[door].__all__:
        assert getattr(getattr(DOORS[door], name), "__name__", name) == name


def test_a_public_name_hides_no_module_of_its_package():
    for door in DOORS.values():
        folder = Path(str(door.__file__)).parent
        modules = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
        assert not modules & set(door.__all__)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="scor_clip"):
        harmolab.scor_clip  # noqa: B018
