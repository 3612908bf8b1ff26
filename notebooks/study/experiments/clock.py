"""The time that trainings take, over all their interruptions."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from harmolab.files import write_json


class TrainingClock:
    """Counts the seconds of a training epoch by epoch (a `harmolab.systems.training.checkpoints.Report`).

    They are kept beside the folder of the run, so that a run that was killed goes on counting; the epoch that a kill
    cut short is not counted.

    Parameters
    ----------
    run : folder of the run
    """

    def __init__(self, run: Path) -> None:
        self._file, self._last = clock_file(run), time.perf_counter()
        self._before = training_minutes(run) * 60 if self._file.is_file() else 0.0
        self._epochs: dict[str, float] = {}

    def __call__(self, row: dict[str, Any], end: int) -> None:
        """An epoch has ended."""
        now = time.perf_counter()
        self._epochs[row["phase"]] = round(now - self._last, 4)
        self._before, self._last = self._before + now - self._last, now
        write_json(self._file, {"seconds": round(self._before, 1), "last epoch": self._epochs})


def clock_file(run: Path) -> Path:
    """The file beside a run that holds its seconds."""
    return run.with_name(f"{run.name}.seconds.json")


def training_minutes(run: Path) -> float:
    """Minutes that a run took; NaN where none were counted."""
    file = clock_file(run)
    return float(json.loads(file.read_text("utf-8"))["seconds"]) / 60 if file.is_file() else float("nan")


def epoch_seconds(clock: Path) -> dict[str, float]:
    """Seconds of the last epoch of each phase of a run, by its `clock_file`."""
    return dict(json.loads(clock.read_text("utf-8")).get("last epoch", {}))
