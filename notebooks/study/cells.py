"""What a notebook defines, for tests and for drawing again: imports, functions, plain constants, nothing else."""

import ast
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

NOTEBOOKS = Path(__file__).resolve().parents[1]


def is_definition(node: ast.stmt) -> bool:
    """An import, a function, or a name for a constant that nothing computes."""
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return not any(isinstance(part, ast.Call | ast.Name) for part in ast.walk(node.value))
    return isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef)


def notebook_cells(stem: str, **names: Any) -> SimpleNamespace:
    """What the code cells of a notebook define; `names` are the globals that its functions find besides."""
    cells = json.loads((NOTEBOOKS / f"{stem}.ipynb").read_text("utf-8"))["cells"]
    source = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    source = "\n".join(line for line in source.splitlines() if not line.startswith("%"))
    body = [node for node in ast.parse(source).body if is_definition(node)]
    space = dict(names)
    exec(compile(ast.Module(body, type_ignores=[]), stem, "exec"), space)
    space.update(names)
    return SimpleNamespace(**{name: value for name, value in space.items() if not name.startswith("__")})
