"""Findings in words, made of the tables of a run: those of the run at hand, and those of the published full run.

A notebook writes its sentences as functions of tables, so that no number in them is typed.
"""

import ast
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from IPython.display import Markdown

from study.profile import RunProfile
from study.saving import figures_folder


class RunTables(Mapping[str, pd.DataFrame]):
    """The tables that a run has saved, read by name when asked for.

    Raises
    ------
    FileNotFoundError
        On asking for a table that the run did not save.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)

    def __getitem__(self, name: str) -> pd.DataFrame:
        path = self.folder / f"{name}.csv"
        if not path.is_file():
            raise FileNotFoundError(f"{path}: this run saved no such table; run the notebook that draws it")
        return pd.read_csv(path)

    def __iter__(self) -> Iterator[str]:
        return (path.stem for path in sorted(self.folder.glob("*.csv")))

    def __len__(self) -> int:
        return sum(1 for _ in self)


Words = Callable[[RunTables], str]


def published_tables() -> RunTables:
    """The committed tables, which a full run made: those beside these notebooks, wherever one of them is run."""
    return RunTables(Path(__file__).resolve().parents[2] / "figures")


def headline(words: Words) -> Markdown:
    """The finding of the published full run, in bold and labelled: what a reader of the finished study should know."""
    return Markdown(f"**{_published(words)}** (full run)")


def say(words: Words, profile: RunProfile) -> Markdown:
    """The words about this run, and after a quick one those about the published full run below them."""
    this = words(RunTables(figures_folder(profile)))
    if profile.name == "full":
        return Markdown(this)
    return Markdown(f"*This run ({profile.name}):*\n\n{this}\n\n*Full run, as published:*\n\n{_published(words)}")


def notebook_finding(path: Path) -> str:
    """The published finding of a notebook, by the function ``finding`` in its cell of that tag; "" without one."""
    cells = json.loads(Path(path).read_text("utf-8"))["cells"]
    source = "".join(line for cell in cells if "finding" in cell["metadata"].get("tags", ()) for line in cell["source"])
    tree = ast.parse(source)
    tree.body = [node for node in tree.body if not isinstance(node, ast.Expr)]
    names: dict[str, Any] = {}
    exec(compile(tree, str(path), "exec"), names)
    return _published(names["finding"]) if "finding" in names else ""


def _published(words: Words) -> str:
    try:
        return words(published_tables())
    except FileNotFoundError as missing:
        return f"No full run has been published yet ({Path(str(missing).partition(':')[0]).name} is missing)."
    except KeyError as missing:
        return f"The published full run is older than these words (it has no {missing})."
