"""Rows measured one after the other in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from harmolab.io.files import PathLike, Progress, silent
from harmolab.lab.evaluate.pairing import Pair

PART_ROWS = 256


def run_rows(
    tasks: Sequence[Pair],
    measure: Callable[[Pair], Mapping[str, Any]],
    out: PathLike,
    *,
    jobs: int = 0,
    scheduler: str = "",
    resume: bool = False,
    progress: Progress = silent,
) -> Iterator[pd.DataFrame]:
    """Tables of rows in the order of the tasks, each with its task's key; a task that fails has its error there.

    Nothing is written to `out`: there is nothing to resume.

    Raises
    ------
    ValueError
        For `jobs`, `scheduler` or `resume`, which need several processes.
    """
    if jobs or scheduler or resume:
        raise ValueError("--jobs, --scheduler and --resume are for several processes, which this version does not have")
    rows: list[Mapping[str, Any]] = []
    for task in progress(tasks, "measuring"):
        try:
            row = measure(task)
        except (ValueError, OSError) as error:
            row = {"error": str(error)}
        rows.append({"key": task.key, **row})
        if len(rows) == PART_ROWS:
            yield pd.DataFrame(rows)
            rows = []
    if rows:
        yield pd.DataFrame(rows)
