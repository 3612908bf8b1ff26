"""What the documents say exists."""

import ast
import dataclasses
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

from harmolab.params import HarmonyParams

ROOT = Path(__file__).resolve().parents[1]
CONVENTIONS = ROOT / "docs" / "conventions.md"


def rows(path: Path) -> Iterator[list[str]]:
    """Cells of every table row of a document, headings and rules left out."""
    lines = path.read_text("utf-8").splitlines()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line.startswith("|") and not line.startswith("|---") and not following.startswith("|---"):
            yield [cell.strip() for cell in line.strip().strip("|").split(" | ")]


def dotted_names(path: Path) -> list[str]:
    """Backticked names with a dot in the tables of a document: module.name or module.Class.field."""
    cells = " ".join(cell for row in rows(path) for cell in row)
    return sorted(set(re.findall(r"`([a-z]\w*(?:\.\w+)+)`", cells)) - {"beats.json"})


def resolve(name: str) -> object:
    """What a dotted name below harmolab, or of the notebooks' study, means; AttributeError when nothing."""
    words = name.split(".")
    top = [] if words[0] == "study" else ["harmolab"]
    for cut in range(len(words), 0, -1):
        try:
            found: object = importlib.import_module(".".join([*top, *words[:cut]]))
        except ModuleNotFoundError as error:
            if not str(error.name).startswith(("harmolab", "study")):
                raise
            continue
        for word in words[cut:]:
            fields = (
                {field.name: field for field in dataclasses.fields(found)} if dataclasses.is_dataclass(found) else {}
            )
            found = fields[word] if word in fields else getattr(found, word)
        return found
    raise AttributeError(name)


NO_NOUNS = {"found", "told", "heard", "seen", "wanted", "made", "chosen", "known", "asked", "mine", "given", "shown"}
NO_NOUNS |= {"here", "there", "critic", "goes_on", "written_aside"}
NO_RESULTS = ("What ", "Where ", "Whether ", "How ", "Who ", "Why ")


def unsearchable_words(source: str) -> Iterator[tuple[int, str]]:
    """(line, word) of variables and functions that are no nouns, and docstrings that do not say what is returned."""
    for node in ast.walk(ast.parse(source)):
        name = ""
        if isinstance(node, ast.arg):
            name = node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = node.name
        if name.strip("_") in NO_NOUNS:
            yield node.lineno, name
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            text = ast.get_docstring(node) or ""
            if text.startswith(NO_RESULTS) or re.search(r"\b(nobody|somebody)\b", text, re.IGNORECASE):
                yield getattr(node, "lineno", 1), text.partition("\n")[0]


def test_the_package_keeps_to_its_words():
    paths = sorted((ROOT / "harmolab").rglob("*.py"))
    assert [(path.name, *word) for path in paths for word in unsearchable_words(path.read_text("utf-8"))] == []


def test_words_that_cannot_be_searched_for_are_noticed():
    source = 'def told(given, beats):\n    """What is hit."""\n    for found in beats:\n        pairs = found\n'
    assert sorted(unsearchable_words(source)) == [(1, "What is hit."), (1, "given"), (1, "told"), (3, "found")]


def test_the_conventions_name_code():
    assert len(dotted_names(CONVENTIONS)) > 50


def exists(name: str) -> bool:
    try:
        return resolve(name) is not None
    except AttributeError:
        return False


def test_every_name_in_the_conventions_exists():
    assert [name for name in dotted_names(CONVENTIONS) if not exists(name)] == []


def test_a_name_that_does_not_exist_is_noticed():
    wrong = ["body.kinematics.joint_sped", "types.Motion.position", "nothing.at_all"]
    assert [name for name in [*wrong, "body.kinematics.joint_speed"] if not exists(name)] == wrong


def test_settings_of_paper_mode_are_as_the_conventions_say():
    paper = HarmonyParams.paper()
    told = {row[1].strip("`").rpartition(".")[2]: row[2] for row in rows(CONVENTIONS) if "HarmonyParams." in row[1]}
    numbers = {name: float(value.split()[0]) for name, value in told.items() if re.match(r"\d", value)}
    assert len(numbers) == 5
    assert numbers == {name: getattr(paper, name) for name in numbers}


def test_every_module_of_the_numeric_core_is_in_the_conventions():
    named = {name.rpartition(".")[0] for name in dotted_names(CONVENTIONS)}
    modules = {"score", "shape_speed", "significance"}
    for folder in ("beats", "body", "metrics", "verdict"):
        modules |= {f"{folder}.{path.stem}" for path in (ROOT / "harmolab" / folder).glob("[a-z]*.py")}
    assert modules <= named


def linked_files() -> list[tuple[str, str]]:
    """(document, target) of every relative link in the documents."""
    documents = [*sorted((ROOT / "docs").glob("*.md")), *sorted(ROOT.glob("*.md"))]
    return [
        (str(path.relative_to(ROOT)), target)
        for path in documents
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text("utf-8"))
        if "://" not in target and not target.startswith("mailto:")
    ]


def test_every_link_of_the_documents_leads_to_a_file():
    links = linked_files()
    assert len(links) > 10
    assert [link for link in links if not (ROOT / link[0]).parent.joinpath(link[1]).exists()] == []


def test_every_test_the_documents_name_exists():
    sources = {path.name: path.read_text("utf-8") for path in (ROOT / "tests").glob("test_*.py")}
    functions = {name for source in sources.values() for name in re.findall(r"^def (test_\w+)", source, re.MULTILINE)}
    for document in (ROOT / "docs").glob("*.md"):
        for name in re.findall(r"`(?:tests/)?(test_\w+(?:\.py)?)`", document.read_text("utf-8")):
            if name.endswith(".py"):
                assert name in sources, f"{document.name} names {name}"
            else:
                assert any(function.startswith(name) for function in functions), f"{document.name} names {name}"


def test_documents_do_not_speak_of_the_machine_they_were_written_on():
    for document in [*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")]:
        found = re.search(r"/work/|/root/|/home/\w", document.read_text("utf-8"))
        assert found is None, f"{document.name}: {found and found.group()}"
