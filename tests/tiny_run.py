"""A run of small tasks for `tests/test_engine.py`: in a process of its own it may be killed at any moment.

    python -m tests.tiny_run OUT JOBS COUNT [SCHEDULER]

goes on with the run in OUT. Every third row or so has no "beats"; every 50th task fails.
"""

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.lab.evaluate import engine, parts
from harmolab.lab.evaluate.engine import run_rows

PAUSE = 0.01  # seconds that a task takes, so that there is something to interrupt


@dataclass(frozen=True)
class Number:
    """A task: its number, and the file that makes it kill its process, if that is there."""

    number: int
    deadly: Path | None = None

    @property
    def key(self) -> str:
        return f"{self.number:05d}"


@dataclass(frozen=True)
class Tasks(Sequence[Any]):
    """So many tasks, each made by its number when it is asked for."""

    task: Callable[[int], Any]
    size: int

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, index: Any) -> Any:
        if not 0 <= index < self.size:
            raise IndexError(index)
        return self.task(index)


Numbers = partial(Tasks, Number)


def square(task: Number) -> dict[str, Any]:
    """Numbers that follow from the task, of every kind that a cell may have."""
    time.sleep(PAUSE)
    if task.deadly is not None:
        os.kill(os.getpid(), 9)
    if task.number % 50 == 7:
        raise ValueError(f"clip {task.number}\nholds no motion")
    draw = np.random.default_rng(task.number).normal(size=4)
    row = {"square": task.number**2, "draw": draw[0], "name": f"clip {task.number}", "features": draw[1:]}
    return row | ({"beats": np.float32(draw[0])} if task.number % 3 else {})


if __name__ == "__main__":
    engine.PART_ROWS, parts.FLUSH_SECONDS = 64, 0.05
    out, jobs, count, scheduler = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), "".join(sys.argv[4:])
    print(os.getpid(), flush=True)
    run_rows(Numbers(count), square, out, jobs=jobs, scheduler=scheduler, resume=True)
