"""The leaderboard, `docs/leaderboard.md`, made from the files in `benchmarks/leaderboard/rows`.

    python -m benchmarks.leaderboard                        # checks every row and writes the page
    python -m benchmarks.leaderboard compare NAME CORPUS    # measures a corpus and writes the row NAME
    python -m benchmarks.leaderboard evaluate NAME TABLE    # takes a row from a folder of `harmolab evaluate --out`

A row is a folder: `row.json`, of which people write "about" and the commands above write "measured", and
`evidence.csv`, the score of every window or dance. The numbers of a row are computed from its evidence, as it is
written; a row whose numbers do not follow from it is an error.
"""

from __future__ import annotations

import argparse
import datetime
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.leaderboard.page import SCORES, page
from harmolab.files import PathLike, is_close, plain, write_json, write_text
from harmolab.lab.compare.auc import CorpusResult, compare
from harmolab.lab.evaluate.submission import (
    ABOUT,
    EVIDENCE,
    FILES,
    ROW,
    csv_text,
    digest_of,
    evaluate_numbers,
    file_hashes,
    read_evidence,
    row_content,
    submission_of,
)
from harmolab.significance import auc, bootstrap_interval_of

ROOT = Path(__file__).resolve().parents[2]
ROWS, PAGE = Path(__file__).parent / "rows", ROOT / "docs" / "leaderboard.md"


def window_table(result: CorpusResult) -> pd.DataFrame:
    """The evidence of a comparison: a line a window, with its recording and every score with true and wrong music."""
    columns: dict[str, Any] = {"recording": [Path(name).name for name in result.sequences], "dance": result.dances}
    for score in SCORES:
        columns[f"{score} true"] = result.true[score]
        columns |= {f"{score} wrong {k}": wrong for k, wrong in enumerate(result.wrong[score].T, 1)}
    return pd.DataFrame(columns)


def compare_numbers(windows: pd.DataFrame, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The AUC of each score and its interval over recordings, from the evidence."""
    members = list(windows.groupby("recording", sort=False).indices.values())
    numbers = {}
    for score in SCORES:
        true = windows[f"{score} true"].to_numpy()
        wrong = windows[[name for name in windows if name.startswith(f"{score} wrong ")]].to_numpy()

        def auc_of(drawn: Iterable[Sequence[int]], true: Any = true, wrong: Any = wrong) -> list[float]:
            indices = (np.concatenate([members[place] for place in places]) for places in drawn)
            return [auc(true[index], wrong[index]) for index in indices]

        interval = bootstrap_interval_of(auc_of, len(members), count=settings["rotations"], seed=settings["seed"])
        numbers[score] = {"auc": auc(true, wrong), "interval": interval}
    return numbers


NUMBERS = {"compare": compare_numbers, "evaluate": evaluate_numbers}


def digest(paths: Iterable[PathLike]) -> str:
    """The digest of some files and of all files in some folders, whatever lies above them."""
    return digest_of(file_hashes(paths))


def code_commit() -> str:
    """The last commit that changed the package; ValueError where it differs from what would run now."""
    if subprocess.run(["git", "status", "--porcelain", "--", "harmolab"], cwd=ROOT, capture_output=True).stdout:
        raise ValueError("harmolab/ differs from its last commit: commit it first, so that the row can name a commit")
    command = ["git", "log", "-1", "--format=%H", "--", "harmolab"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def write_row(name: str, kind: str, command: str, evidence: pd.DataFrame, digits: str, **measured: Any) -> None:
    """Write evidence and measured part of a row; "about" stays as it is."""
    folder = ROWS / name
    about = _about(folder)
    write_text(folder / EVIDENCE, evidence.to_csv(index=False, float_format=digits, lineterminator="\n"))
    numbers = NUMBERS[kind](read_evidence(folder), measured["settings"])
    code = {"version": version("harmolab"), "commit": code_commit(), "date": datetime.date.today().isoformat()}
    measured = {**measured, "kind": kind, "command": command, "harmolab": code, "numbers": numbers}
    write_json(folder / ROW, {"about": about, "measured": measured})


def write_compare_row(name: str, corpus: Path) -> None:
    """Measure a corpus by `compare` with its default settings, and write the row."""
    _about(ROWS / name)  # an error now, not after an hour
    result = compare(corpus)
    summary = result.summary
    settings = {key: summary[key] for key in ("window", "null", "beats", "seed", "fitted_on")} | {"rotations": 400}
    windows = window_table(result)
    if windows["recording"].nunique() != summary["n_sequences"]:
        raise ValueError(f"{corpus}: some recordings have the same name; intervals need one name for each")
    exact = compare_numbers(windows, settings)
    if any(abs(exact[score]["auc"] - summary["scores"][score]["auc"]) > 1e-9 for score in SCORES):
        raise ValueError(f"{corpus}: the AUC of the windows is not that of `harmolab evaluate compare`")
    write_row(
        name, "compare",
        f"harmolab evaluate compare {corpus.name} --beats {settings['beats']} --rotations 400 --seed 0",
        windows, "%.4g", settings=settings, digest=digest(result.sequences),
        recordings=sorted(set(windows["recording"])), windows=len(windows),
        chance_band={score: summary["scores"][score]["chance_band"] for score in SCORES},
    )  # fmt: skip


def write_evaluate_row(name: str, table: Path) -> None:
    """Write a row from what `harmolab evaluate` left in a folder."""
    row = submission_of(table)
    write_text(ROWS / name / FILES, csv_text(row.files))
    write_row(name, evidence=row.evidence, digits="%.6g", **row.measured)


def load_row(folder: Path) -> dict[str, Any]:
    """A row with its name, its numbers computed anew.

    Raises
    ------
    FileNotFoundError, ValueError
        A file or a field is missing, or the numbers do not follow from the evidence; names the row.
    """
    about = _about(folder)
    measured = row_content(folder).get("measured")
    if measured is None:
        raise ValueError(f"{folder / ROW}: holds nothing measured yet; run python -m benchmarks.leaderboard --help")
    numbers = plain(NUMBERS[measured["kind"]](read_evidence(folder), measured["settings"]))
    if not is_close(numbers, measured["numbers"]):
        raise ValueError(f"{folder / ROW}: its numbers do not follow from {EVIDENCE}; make the row anew")
    return {"name": folder.name, "about": about, **measured}


def _about(folder: Path) -> dict[str, Any]:
    """What people wrote about a row; errors as `load_row`."""
    about = row_content(folder).get("about", {})
    if missing := [name for name in ABOUT if name not in about]:
        raise ValueError(f'{folder / ROW}: "about" lacks {", ".join(missing)}')
    return {name: about[name] for name in ABOUT}


def load_rows(folder: Path = ROWS) -> list[dict[str, Any]]:
    """All rows by name; errors as `load_row`."""
    return [load_row(path.parent) for path in sorted(folder.glob(f"*/{ROW}"))]


def main(arguments: Sequence[str] | None = None) -> None:
    """Write a row, or the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.leaderboard", description=__doc__)
    commands = parser.add_subparsers(dest="kind")
    for kind, what in (("compare", "corpus"), ("evaluate", "table")):
        command = commands.add_parser(kind)
        command.add_argument("name", help="folder in benchmarks/leaderboard/rows, with its row.json")
        command.add_argument("folder", type=Path, metavar=what)
    options = parser.parse_args(arguments)
    if options.kind:
        write = write_compare_row if options.kind == "compare" else write_evaluate_row
        write(options.name, options.folder)
    write_text(PAGE, page(load_rows()))


if __name__ == "__main__":
    main()
