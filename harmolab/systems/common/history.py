"""The history of a run, one row an epoch: a table for people and notebooks, events for TensorBoard."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

HISTORY = "history.csv"
EVENTS = "events.out.tfevents.*"
Row = dict[str, Any]
Report = Callable[[Row, int], None]  # a row, and the epoch that its phase ends at


def history_text(rows: list[Row]) -> str:
    """The history as CSV; a value that an epoch does not have is empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


class EventLog:
    """The history for TensorBoard, in an events file inside the run's folder.

    A run that resumes replaces the file by the history so far, so that no epoch is there twice.

    Parameters
    ----------
    folder : of the run
    rows : the history so far
    """

    def __init__(self, folder: Path, rows: list[Row]) -> None:
        # Imported here: it takes seconds, and systems that only dance or play need it not.
        from lightning_fabric.loggers.tensorboard import TensorBoardLogger

        for stale in folder.glob(EVENTS):
            stale.unlink()
        self._logger = TensorBoardLogger(folder.resolve(), name="", version="")
        for row in rows:
            self.add(row)

    def add(self, row: Row) -> None:
        """One more epoch, on disk when this returns."""
        values = {_tag(name): value for name, value in row.items() if isinstance(value, float)}
        self._logger.log_metrics(values, step=row["epoch"])
        self._logger.save()

    def close(self) -> None:
        """No more epochs."""
        self._logger.finalize("success")


def _tag(name: str) -> str:
    """Name of a column with its group before the stroke, as TensorBoard shows it."""
    if name in ("rate", "tau"):
        return f"schedule/{name}"
    return f"validation/{name.removeprefix('val_')}" if name.startswith("val_") else f"loss/{name}"
