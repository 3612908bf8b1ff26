"""`harmolab score` of a folder of recordings: a row each, with a fault in one as its row."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from harmolab.cli.checks import is_told
from harmolab.cli.common import check_out, show
from harmolab.cli.screen import note, plain_errors, printable, progress, wrote
from harmolab.cli.sources import Sources

if TYPE_CHECKING:
    from harmolab.verdict.score import HarmonyScore

Scored = Callable[[Sources], Mapping[str, "HarmonyScore"]]

FOR_ONE = ("offset", "beats", "one", "plot", "others")  # options that mean something for one recording only
JUDGED = ("level", "verdict", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "pulse", "share")
NUMBERS = ("harmony_above_chance", "p_value", "harmony", "hit_rate", "chance", "n_audio", "n_visual")


def is_corpus(folder: Path) -> bool:
    """True for a folder that is no recording itself and holds some."""
    from harmolab.corpora.folders import find_recordings, missing_parts

    return folder.is_dir() and bool(missing_parts(folder)) and bool(find_recordings(folder).folders)


def score_corpus(context: typer.Context, corpus: Path, scored: Scored, *, table: Path | None, as_json: bool) -> None:
    """Score every recording below a folder, print the rows and write them; exit code 1 where some have a fault.

    Parameters
    ----------
    context : of the call
    corpus : folder
    scored : function of the files of a recording; mode -> score
    table : csv to be written, if any
    as_json : print the rows as JSON
    """
    with plain_errors():
        if misplaced := [name for name in FOR_ONE if is_told(context, name)]:
            raise ValueError(f"--{misplaced[0]} is for one recording, and {corpus} holds several; leave it out")
        if table is not None:
            check_out(table, "a table", (".csv",))
        rows = list(recording_rows(corpus, scored))
        if table is not None:
            _write(table, rows)
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
    else:
        _print(rows, str(corpus))
    if table is not None:
        wrote(table, err=as_json)
    if faults := [row["name"] for row in rows if row["error"]]:
        note(f"{len(faults)} of {len(rows)} recordings could not be scored; their rows say why")
        raise typer.Exit(1)


def recording_rows(corpus: Path, scored: Scored) -> Iterator[dict[str, Any]]:
    """A row for each recording at or below a folder; errors of the folder itself as `find_recordings`."""
    from harmolab.corpora.folders import find_recordings, recording_files

    folders, problems = find_recordings(corpus)
    for problem in problems:
        yield _row(problem.folder, corpus, error=problem.message)
    for folder in progress(folders, "scoring"):
        try:
            files = recording_files(folder)
            scores = scored(Sources(files.song, folder, files.beats, files.dance))
            yield _row(folder, corpus, dance=files.dance, scores=scores)
        except (ValueError, OSError) as error:
            yield _row(folder, corpus, error=str(error))


def _row(
    folder: Path, corpus: Path, *, dance: str = "", scores: Mapping[str, HarmonyScore] | None = None, error: str = ""
) -> dict[str, Any]:
    """Name, dance, numbers and fault of a recording; the numbers of our own score go by their names alone."""
    row: dict[str, Any] = {"name": str(folder.relative_to(corpus)), "dance": dance, "error": printable(error)}
    for mode, score in (scores or {}).items():
        values, prefix = score.to_dict(), "" if score.judgement else f"{mode}_"
        low, high = values["interval"]
        names = (*(JUDGED if score.judgement else ()), *NUMBERS)
        row |= {f"{prefix}{name}": values[name] for name in names}
        row |= {f"{prefix}interval_low": low, f"{prefix}interval_high": high}
    return row


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    import pandas as pd

    from harmolab.io.files import write_text

    write_text(path, pd.DataFrame(rows).to_csv(index=False))


def _print(rows: list[dict[str, Any]], title: str) -> None:
    """The rows as a table, with the fault of a recording in place of its level."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from harmolab.verdict.judge import LEVELS

    table = Table("recording", "dance", "harmony above chance", "p in time", "level", title=escape(printable(title)))
    for row in rows:
        numbers = (row.get(name) for name in ("harmony_above_chance", "p_time"))
        level = f"{row['level']} {LEVELS[row['level']]}" if "level" in row else ""
        table.add_row(escape(printable(row["name"])), row["dance"], *map(show, numbers), escape(row["error"] or level))
    Console().print(table)
