"""Who may import whom, which library lives where, and how long things may get."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "harmolab"

# Layer of every module and subpackage directly under harmolab; imports point to a lower number.
LAYERS = {
    "skeletons": 0,
    "types": 0,
    "params": 0,
    "templates": 0,
    "io": 1,
    "kinematics": 1,
    "beats": 1,
    "profile": 2,
    "harmony": 2,
    "pattern": 2,
    "rescoring": 2,
    "significance": 2,
    "metrics": 2,
    "features": 2,
    "alignment": 3,
    "data": 3,
    "timewarp": 3,
    "explaining": 3,
    "models": 4,
    "viz": 4,
    "training": 5,
    "synthesis": 5,
    "retiming": 5,
    "dance_scores": 3,
    "systems": 6,
    "experiments": 6,
    "parts": 6,
    "corpus": 6,
    "dance_video": 6,
    "discrimination": 6,
    "listening": 6,
    "widgets": 6,
    "pages": 7,
    "own_dance": 7,
    "report": 7,
    "cli": 7,
}
TOP = 7  # may import anything
ARROWS = {  # allowed inside a layer
    ("types", "skeletons"),
    ("params", "features"),
    ("types", "params"),  # a score's settings
    ("beats", "kinematics"),
    ("beats", "io"),  # the cache
    ("harmony", "metrics"),
    ("harmony", "pattern"),
    ("harmony", "significance"),
    ("rescoring", "harmony"),
    ("rescoring", "pattern"),
    ("corpus", "parts"),
    ("discrimination", "corpus"),
    ("experiments", "parts"),
    ("discrimination", "experiments"),
}
SEES_ONLY = {"viz": set(), "widgets": {"viz"}}  # these two see layers 0 to 2 and what is named here

LIBRARIES = {
    "torch": ("models", "training", "synthesis", "systems", "retiming", "experiments"),
    "matplotlib": ("viz", "widgets"),
    "ipywidgets": ("widgets",),
    "anywidget": ("widgets",),
    "librosa": ("io", "beats.audio", "features"),
    "pandas": ("experiments", "discrimination", "corpus", "viz.results", "report", "cli"),
}
HEAVY = {"torch", "matplotlib", "ipywidgets", "anywidget", "dask"}
LONGEST_FUNCTION = 60
LONGEST_MODULE = 350


def modules(package: Path) -> Iterator[tuple[str, Path]]:
    """(dotted name inside the package, file); the package's own __init__ is ''."""
    for path in sorted(package.rglob("*.py")):
        parts = list(path.relative_to(package).with_suffix("").parts)
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def imported(tree: ast.AST, module: str, *, is_package: bool) -> Iterator[tuple[int, str]]:
    """(line, absolute dotted name) of every import, wherever it stands; `from a import b` gives a.b."""
    inside = ["harmolab", *filter(None, module.split("."))]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = inside[: len(inside) - node.level + is_package] if node.level else []
            base = ".".join([*up, *filter(None, [node.module])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def may_import(importer: str, target: str) -> bool:
    """Whether one module or subpackage directly under harmolab may import another."""
    here, there = LAYERS[importer], LAYERS[target]
    if importer == target or here == TOP or (importer, target) in ARROWS:
        return True
    if importer in SEES_ONLY:
        return there <= 2 or target in SEES_ONLY[importer]
    return there < here


def import_faults(module: str, name: str) -> Iterator[str]:
    """What is wrong with `module` importing `name`."""
    library, _, rest = name.partition(".")
    homes = LIBRARIES.get(library)
    if homes and not any(module == home or module.startswith(f"{home}.") for home in homes):
        yield f"imports {library}, which belongs in {', '.join(homes)}"
    importer, target = module.partition(".")[0], rest.partition(".")[0]
    if library != "harmolab" or not importer or LAYERS[importer] == TOP:
        return
    if target not in LAYERS:
        yield f"imports {name} from the top of the package; import it from the module that defines it"
    elif not may_import(importer, target):
        yield f"imports {target}, which its layer must not know"


def size_faults(source: str, tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Functions and modules that are too long (docstrings of functions not counted), and asserts."""
    if (lines := len(source.splitlines())) > LONGEST_MODULE:
        yield 1, f"has {lines} lines, more than {LONGEST_MODULE}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Assert):
            yield node.lineno, "asserts; raise ValueError instead"
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
            if lines > LONGEST_FUNCTION:
                yield node.lineno, f"{node.name} has {lines} lines, more than {LONGEST_FUNCTION}"


def faults(package: Path) -> list[str]:
    """Every breach of the rules in a package, as 'module:line: fault'."""
    found = []
    for module, path in modules(package):
        source = path.read_text("utf-8")
        tree = ast.parse(source)
        importer = module.partition(".")[0]
        if importer and importer != "__main__" and importer not in LAYERS:
            found.append(f"{module}:1: has no layer; add it to LAYERS here and to CONTRIBUTING.md")
            continue
        found += [f"{module}:{line}: {fault}" for line, fault in size_faults(source, tree)]
        for line, name in imported(tree, module, is_package=path.name == "__init__.py"):
            found += [f"{module}:{line}: {fault}" for fault in import_faults(module, name)]
    return found


def test_package_keeps_to_its_layers_libraries_and_lengths():
    assert faults(PACKAGE) == []


def test_contributors_are_told_the_same_layers():
    text = (PACKAGE.parent / "CONTRIBUTING.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d) \| (.+) \|$", text, flags=re.MULTILINE)
    assert {name: int(layer) for layer, names in rows for name in re.findall(r"`(\w+)`", names)} == LAYERS


@pytest.mark.parametrize(
    ("path", "source", "fault"),
    [
        ("harmony.py", "from harmolab.lab.figures.style import STYLE", "imports viz"),
        ("metrics.py", "from .harmony import hit_mask", "imports harmony"),
        ("kinematics.py", "from harmolab.beats import visual", "imports beats"),
        ("data/tang2018.py", "from .. import corpus", "imports corpus"),
        ("viz/beats.py", "def draw(ax):\n    from harmolab.data import synthetic\n", "imports data"),
        ("types.py", "from harmolab import HarmonyParams", "from the top of the package"),
        ("metrics.py", "import torch.nn", "imports torch"),
        ("report.py", "import matplotlib.pyplot as plt", "imports matplotlib"),
        ("beats/flow.py", "import librosa", "imports librosa"),
        ("viz/beats.py", "import pandas as pd", "imports pandas"),
        ("utils.py", "", "has no layer"),
        ("io/npz.py", "assert True", "asserts"),
        ("params.py", "x = 1\n" * 351, "has 351 lines"),
        ("params.py", "def f():\n" + "    x = 1\n" * 61, "f has 61 lines"),
    ],
)
def test_planted_breach_is_found(tmp_path: Path, path: str, source: str, fault: str):
    (tmp_path / path).parent.mkdir(exist_ok=True)
    (tmp_path / path).write_text(source)
    found = faults(tmp_path)
    assert len(found) == 1
    assert fault in found[0]


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("beats/visual.py", "from harmolab.kinematics import joint_speed\nfrom .saliency import salient_beats"),
        ("beats/audio.py", "import librosa"),
        ("viz/results.py", "import pandas as pd\nfrom harmolab.harmony import score_harmony"),
        ("widgets/labs.py", "from harmolab.lab.figures.beats import draw_hits\nimport ipywidgets"),
        ("cli.py", "from harmolab import report"),
        ("__init__.py", "from .harmony import score_harmony"),
    ],
)
def test_allowed_import_is_not_a_breach(tmp_path: Path, path: str, source: str):
    (tmp_path / path).parent.mkdir(exist_ok=True)
    (tmp_path / path).write_text(source)
    assert faults(tmp_path) == []


def test_importing_harmolab_loads_none_of_the_heavy_libraries():
    code = "import sys, harmolab; print(*{name.partition('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "harmolab" in loaded
    assert HEAVY.isdisjoint(loaded)
