"""README and docs import from the doors `harmolab`, its `systems`, `lab` and `musician`, notebooks what is public."""

import ast
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import harmolab
import harmolab.lab
import harmolab.musician
import harmolab.systems
import study

ROOT = Path(__file__).resolve().parents[1]
DOORS = {door.__name__: door for door in (harmolab, harmolab.systems, harmolab.lab, harmolab.musician, study)}


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
            if isinstance(node, ast.ImportFrom) and re.match(r"(harmolab|study)\b", node.module or ""):
                yield from ((file, str(node.module), alias.name) for alias in node.names)
            if isinstance(node, ast.Import):
                yield from ((file, alias.name, "") for alias in node.names if re.match(r"harmolab\b", alias.name))


def test_readme_and_docs_import_from_the_doors():
    assert {(file, module) for file, module, _ in imports() if module not in DOORS and file.endswith("md")} == set()
    assert {module for _, module, _ in imports()} >= set(DOORS)
    assert len({file for file, _, _ in imports()}) >= 15  # the search finds them


def test_every_name_they_import_from_a_door_is_public():
    names = [(file, module, name) for file, module, name in imports() if name and module in DOORS]
    assert [(file, name) for file, module, name in names if name not in DOORS[module].__all__] == []


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


def private_names(source: str) -> list[str]:
    """Names of harmolab that begin with an underscore, imported or reached through a module or an object."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and re.match(r"harmolab\b", node.module or ""):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        if isinstance(node, ast.Attribute) and not (
            isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
        ):
            names.append(node.attr)
    return [name for name in names if re.search(r"(^|\.)_(?!_|replace$|asdict$)", name)]


def test_the_study_uses_nothing_private_of_the_package() -> None:
    assert private_names("from harmolab.score import _with_null\nscore._secret\nself._own") == [
        "harmolab.score._with_null",
        "_secret",
    ]
    files = sorted((ROOT / "notebooks" / "study").rglob("*.py"))
    assert len(files) > 5
    assert {file.name: names for file in files if (names := private_names(file.read_text("utf-8")))} == {}
    assert {
        file: names for file, source in sources() if file.endswith("ipynb") and (names := private_names(source))
    } == {}


def test_the_wheel_holds_the_package_alone_and_the_package_knows_no_study() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"] == {"packages": ["harmolab"]}
    package = [path.read_text("utf-8") for path in (ROOT / "harmolab").rglob("*.py")]
    assert not [source for source in package if re.search(r"^\s*(from|import) study\b", source, flags=re.MULTILINE)]
