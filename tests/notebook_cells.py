"""The functions that a notebook defines, for tests: its imports, definitions and plain constants, and nothing else."""

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nbformat

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"


def is_definition(node: ast.stmt) -> bool:
    """An import, a function, or a name for a constant that nothing computes."""
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return not any(isinstance(part, ast.Call | ast.Name) for part in ast.walk(node.value))
    return isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef)


def notebook_cells(stem: str, **names: Any) -> SimpleNamespace:
    """What the code cells of a notebook define; `names` are the globals that its functions find besides."""
    notebook = nbformat.read(NOTEBOOKS / f"{stem}.ipynb", as_version=4)
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    source = "\n".join(line for cell in cells for line in cell.splitlines() if not line.startswith("%"))
    body = [node for node in ast.parse(source).body if is_definition(node)]
    space = dict(names)
    exec(compile(ast.Module(body, type_ignores=[]), stem, "exec"), space)
    space.update(names)
    return SimpleNamespace(**{name: value for name, value in space.items() if not name.startswith("__")})
