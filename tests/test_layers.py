"""The import rule of the package, which library lives where, and how long things may get."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from tests.builders import cases

PACKAGE = Path(__file__).resolve().parents[1] / "harmolab"

# What is on top of what: a room imports from its own row and from those above it, never from its neighbour in a row.
# The rooms of the core are one row, and may import each other.
FILES = ("files",)
CORE = ("types", "params", "body", "shape_speed", "significance", "score", "verdict", "beats", "metrics")
ABOVE = ("clips", "systems", "lab", "musician", "cli")  # each a row of its own
ROWS = (FILES, CORE, ("readers",), ("data", "retime", "soft_score"), *((room,) for room in ABOVE))
ROW = {room: number for number, rooms in enumerate(ROWS) for room in rooms}
# Inside the laboratory and inside systems: a room -> the rooms that it may import.
FROM_TRAINING = frozenset({"training"})
INSIDE = {
    "lab": {
        "person": set(),
        "evaluate": {"figures", "player_data", "report"},
        "compare": {"evaluate"},
        "figures": {"person"},
        "report": set(),
        "listening": {"report"},
        "player_data": {"person", "report"},
        "explain": {"figures", "player_data", "report"},
        "labs": {"compare", "figures", "player_data", "report"},
        "render": {"person", "explain"},
        "app": {"listening", "report"},
        "harmonise": set(),
        "display": {"figures", "player_data"},
    },
    "systems": {
        "training": set(),
        **dict.fromkeys(("contract", "choreographer", "lee2019", "music2dance", "ren2020"), frozenset({"training"})),
        "harmogan": {"training", "choreographer"},
    },
}
LIBRARIES = {
    "torch": ("systems", "soft_score", "lab.harmonise", "lab.evaluate.torch_metric", "musician"),
    "torchmetrics": ("lab.evaluate.metric", "lab.evaluate.torch_metric"),
    "matplotlib": ("lab.figures",),
    "ipywidgets": ("lab.labs",),
    "anywidget": ("lab.labs",),
    "librosa": (
        *("beats.audio", "musician.sound_features", "systems.training.features", "systems.music2dance.music_features"),
    ),
    "pandas": ("lab", "cli"),
    **dict.fromkeys(("jinja2", "nbformat", "nbconvert"), ("lab.report",)),
    **dict.fromkeys(("dask", "distributed"), ("lab.evaluate.engine",)),
    "pyarrow": ("lab.evaluate.parts",),
}
HEAVY = {"torch", "matplotlib", "ipywidgets", "anywidget", "dask", "distributed", "pyarrow"}
LONGEST_FUNCTION = 60
LONGEST_MODULE = 700


def modules(package: Path) -> Iterator[tuple[str, Path]]:
    """(dotted name inside the package, file); the package's own __init__ is ''."""
    for path in sorted(package.rglob("*.py")):
        parts = list(path.relative_to(package).with_suffix("").parts)
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


@cache
def parsed(path: Path) -> tuple[str, ast.Module]:
    source = path.read_text("utf-8")
    return source, ast.parse(source)


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


def import_faults(module: str, name: str) -> Iterator[str]:
    """Every breach of the rule by `module` importing `name`."""
    library, _, rest = name.partition(".")
    homes = LIBRARIES.get(library)
    if homes and not any(module == home or module.startswith(f"{home}.") for home in homes):
        yield f"imports {library}, which belongs in {', '.join(homes)}"
    importer, target = module.partition(".")[0], rest.partition(".")[0]
    if library != "harmolab" or not importer or (importer == "cli" and target not in ROW):
        return
    if target not in ROW:
        yield f"imports {name} from the top of the package; import it from the module that defines it"
    elif importer != target and ROW[target] >= ROW[importer] and not {importer, target} <= {*CORE}:
        yield f"imports {target}, which is not below {importer}"
    elif importer == target and importer in INSIDE:
        yield from inside_faults(INSIDE[importer], module.split(".")[1:2], rest.split(".")[1:2])


def inside_faults(rooms: dict[str, set[str]], importer: list[str], target: list[str]) -> Iterator[str]:
    """A breach of the rule between two rooms of one folder; its facade may import all of them."""
    for room in {*importer, *target} - rooms.keys():
        yield f"{room} is no room there; add it to INSIDE here"
    is_known = importer and target and {*importer, *target} <= rooms.keys()
    if is_known and importer != target and target[0] not in rooms[importer[0]]:
        yield f"imports {target[0]}, which is not below {importer[0]}"


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
    breaches = []
    for module, path in modules(package):
        source, tree = parsed(path)
        importer = module.partition(".")[0]
        if importer and importer != "__main__" and importer not in ROW:
            breaches.append(f"{module}:1: has no place; add it to ROWS here and to CONTRIBUTING.md")
            continue
        breaches += [f"{module}:{line}: {fault}" for line, fault in size_faults(source, tree)]
        for line, name in imported(tree, module, is_package=path.name == "__init__.py"):
            breaches += [f"{module}:{line}: {fault}" for fault in import_faults(module, name)]
    return breaches


def test_package_keeps_to_its_rule_libraries_and_lengths():
    assert faults(PACKAGE) == []


def test_no_module_imports_itself_round_a_circle():
    names = {f"harmolab.{module}" for module, _ in modules(PACKAGE)}
    graph: dict[str, set[str]] = {}
    for module, path in modules(PACKAGE):
        imports = [name for _, name in imported(parsed(path)[1], module, is_package=path.name == "__init__.py")]
        targets = {name if name in names else name.rpartition(".")[0] for name in imports}
        graph[f"harmolab.{module}"] = (targets & names) - {f"harmolab.{module}"}
    TopologicalSorter(graph).prepare()  # CycleError names the circle


def test_the_study_needs_nothing_of_reports_but_the_name_of_a_manifest():
    # nbformat takes three seconds to import, in every notebook that is opened.
    study = sorted((PACKAGE.parent / "notebooks" / "study").rglob("*.py"))
    names = {name for path in study for _, name in imported(parsed(path)[1], "", is_package=False)}
    heavy = ("harmolab.lab.report", "nbformat", "nbconvert")
    assert {name for name in names if name.startswith(heavy)} == {"harmolab.lab.report.MANIFEST"}


def test_the_folder_shows_the_core_and_what_is_around_it():
    shown = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()}
    assert shown == {"__init__", *ROW}
    assert len(shown) == len(ROW) + 1 == 20


def test_contributors_are_told_the_same_rule():
    text = (PACKAGE.parent / "CONTRIBUTING.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d) \| (.+) \|$", text, flags=re.MULTILINE)
    assert {name: int(row) for row, names in rows for name in re.findall(r"`(\w+)`", names)} == ROW


@cases(
    "path, source, fault",
    ("score.py", "from harmolab.lab.figures.style import STYLE", "imports lab"),
    ("metrics/beat_alignment.py", "from harmolab.retime.warps import TimeWarp", "imports retime"),
    ("retime/warps.py", "from harmolab.data.recordings import load_recording", "imports data"),
    ("data/recordings.py", "from ..lab.compare import auc", "imports lab"),
    ("systems/training/units.py", "def f():\n    from harmolab.systems.harmogan.train import fit", "imports harmogan"),
    ("lab/figures/beats.py", "from harmolab.lab.player_data import Player", "imports player_data"),
    ("lab/utils/x.py", "from harmolab.lab.figures.beats import draw_hits", "utils is no room there"),
    ("types.py", "from harmolab import HarmonyParams", "from the top of the package"),
    ("metrics/beat_alignment.py", "import torch.nn", "imports torch"),
    ("lab/report/run.py", "import matplotlib.pyplot as plt", "imports matplotlib"),
    ("beats/flow.py", "import librosa", "imports librosa"),
    ("data/recordings.py", "import pandas as pd", "imports pandas"),
    ("utils.py", "", "has no place"),
    ("readers/npz.py", "assert True", "asserts"),
    ("params.py", "x = 1\n" * 701, "has 701 lines"),
    ("params.py", "def f():\n" + "    x = 1\n" * 61, "f has 61 lines"),
)
def test_planted_breach_is_found(tmp_path: Path, path: str, source: str, fault: str):
    (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / path).write_text(source)
    breaches = faults(tmp_path)
    assert len(breaches) == 1
    assert fault in breaches[0]


@cases(
    "path, source",
    ("beats/visual.py", "from harmolab.body.kinematics import joint_speed\nfrom .tempo import steady_beats"),
    ("beats/audio.py", "import librosa"),
    ("lab/figures/beats.py", "import pandas as pd\nfrom harmolab.score import score_harmony"),
    ("lab/labs/x.py", "from harmolab.lab.figures.beats import draw_hits\nimport ipywidgets"),
    ("systems/harmogan/train.py", "import torch\nfrom harmolab.systems.training.loop import fit"),
    ("cli/reporting.py", "from harmolab.lab.report.run import main"),
    ("__init__.py", "from .harmony import score_harmony"),
)
def test_allowed_import_is_not_a_breach(tmp_path: Path, path: str, source: str):
    (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / path).write_text(source)
    assert faults(tmp_path) == []


def loaded_by(imports: str) -> set[str]:
    """Names of the modules that a new process has after these imports."""
    code = f"import sys, {imports}; print(*sys.modules)"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_importing_harmolab_loads_none_of_the_heavy_libraries_and_the_papers_score_stands_without_the_verdict():
    loaded = loaded_by("harmolab, harmolab.score")
    assert {"harmolab", "harmolab.score"} <= loaded
    assert HEAVY.isdisjoint(loaded)
    assert {"harmolab.verdict.judge", "harmolab.verdict.bar_pattern", "harmolab.shape_speed"}.isdisjoint(loaded)


def test_a_verdict_and_the_workers_of_tables_wait_for_no_library_that_they_do_not_use():
    loaded = loaded_by("harmolab.clips, harmolab.verdict.judge, harmolab.lab.compare.rows, harmolab.lab.evaluate.rows")
    # "pandas" itself is there, unread until it is used.
    assert {"pandas.core", "scipy.stats", "scipy.signal", "cv2", *HEAVY}.isdisjoint(loaded)
