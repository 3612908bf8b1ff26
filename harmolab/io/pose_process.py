"""The other end of `harmolab.io.pose_child`: pictures to a process that finds bodies in them, landmarks back.

Nothing that comes back is trusted: every answer has a fixed length, its numbers are checked, and a process that falls
silent is stopped. Pictures are sent by a thread, so that one is decoded while a body is found in the one before.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from threading import Event, Thread
from time import monotonic
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harmolab.io.pose_child import HEADER, LANDMARKS, READY

CHILD = Path(__file__).with_name("pose_child.py")
BEGIN_SECONDS = 120.0  # that the process may take to load its models
SILENT_SECONDS = 60.0  # until the next answer
VALUES = 6  # x, y; world x, y, z; visibility
WHO = "the process that finds bodies"
FARTHEST = 20.0  # metres or pictures: no point of a body lies so far from the middle

Landmarks = NDArray[np.float32]  # (33, 6), NaN where nobody is


class Picture(NamedTuple):
    """RGB pixels (H, W, 3), and whether others than the person who is followed are looked for."""

    pixels: NDArray[np.uint8]
    is_looked_at: bool = False


def child_command(folder: Path) -> list[str]:
    """The command that starts the process, without anything of this one's packages in it."""
    return [sys.executable, "-I", "-S", str(CHILD), str(folder)]


def check_child(folder: Path) -> None:
    """ValueError unless the process of an environment starts and says that it is ready."""
    for _ in found_people([], child_command(folder)):
        pass


def found_people(
    pictures: Iterable[Picture], command: Sequence[str], *, seconds: float = SILENT_SECONDS
) -> Iterator[tuple[Landmarks, Landmarks | None]]:
    """For each picture the landmarks of one person followed, and of another one where others were looked for.

    Parameters
    ----------
    pictures : iterable of Picture
    command : what starts the process
    seconds : float, until a process that does not answer is stopped

    Raises
    ------
    ValueError
        The process ends early, falls silent or answers nonsense; and what `pictures` raises.
    """
    with tempfile.TemporaryFile() as words, _process(command, words) as process:
        watch, sender = _Watch(process, BEGIN_SECONDS), _Sender(process, pictures)
        answers = _Answers(process, watch, words)
        try:
            if answers.read(len(READY)) != READY:
                raise ValueError(f"{WHO} answers nonsense at its begin")
            watch.seconds = seconds
            sender.start()
            while (is_looked_at := sender.sent.get()) is not None:
                yield answers.landmarks(), answers.landmarks() if is_looked_at else None
            if sender.error is not None:
                raise sender.error
            answers.check_end()
        finally:
            watch.done.set()


@contextmanager
def _process(command: Sequence[str], words: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """The process, which ends with the block."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError, ValueError):
                pipe.close()  # type: ignore[union-attr]  # both are pipes


class _Watch(Thread):
    """Stops a process that does not answer for so many seconds while an answer is awaited."""

    def __init__(self, process: subprocess.Popen[bytes], seconds: float) -> None:
        super().__init__(daemon=True)
        self.process, self.seconds, self.asked = process, seconds, float("inf")
        self.done, self.has_stopped = Event(), False
        self.start()

    def run(self) -> None:
        """Look several times within the time that is allowed."""
        while not self.done.wait(min(1.0, self.seconds / 4)):
            if monotonic() - self.asked > self.seconds:
                self.has_stopped = True
                self.process.kill()
                return


class _Sender(Thread):
    """Writes pictures to the process, says of each in `sent` that it comes, and keeps the error of their source."""

    def __init__(self, process: subprocess.Popen[bytes], pictures: Iterable[Picture]) -> None:
        super().__init__(daemon=True)
        self.pipe: Any = process.stdin
        self.pictures = pictures
        self.sent: Queue[bool | None] = Queue()
        self.error: Exception | None = None

    def run(self) -> None:
        """Send all pictures, then close the pipe."""
        try:
            for pixels, is_looked_at in self.pictures:
                self.sent.put(is_looked_at)
                self.pipe.write(HEADER.pack(*pixels.shape[:2], is_looked_at) + np.ascontiguousarray(pixels).tobytes())
                self.pipe.flush()
            self.pipe.close()
        except OSError as error:  # a broken pipe: the process has ended, which its reader finds by itself
            self.error = error
        except Exception as error:  # noqa: BLE001  # the reader raises it
            self.error = error
        finally:
            self.sent.put(None)


@dataclass(frozen=True, eq=False)
class _Answers:
    """The answers of a process, checked."""

    process: subprocess.Popen[bytes]
    watch: _Watch
    words: IO[bytes]

    def read(self, size: int) -> bytes:
        """The next bytes; ValueError where there are fewer."""
        pipe: Any = self.process.stdout
        self.watch.asked = monotonic()
        content = bytes(pipe.read(size))
        self.watch.asked = float("inf")
        if len(content) == size:
            return content
        if self.watch.has_stopped:
            raise ValueError(f"{WHO} gave no answer for {self.watch.seconds:g} s and was stopped")
        raise ValueError(f"{WHO} ended early (code {self.process.wait()}): {self._last_words()}")

    def landmarks(self) -> Landmarks:
        """The next person: all of her points, or none."""
        points = np.frombuffer(self.read(LANDMARKS * VALUES * 4), np.float32).reshape(LANDMARKS, VALUES)
        is_missing = np.isnan(points)
        if is_missing.all():
            return points
        if is_missing.any() or np.abs(points).max() > FARTHEST:
            raise ValueError(f"{WHO} answers nonsense: points that are no body's")
        return points

    def check_end(self) -> None:
        """ValueError where more comes than was asked for."""
        pipe: Any = self.process.stdout
        self.watch.asked = monotonic()
        if pipe.read(1):
            raise ValueError(f"{WHO} says more than it was asked")
        self.watch.asked = float("inf")

    def _last_words(self) -> str:
        self.words.seek(max(self.words.seek(0, os.SEEK_END) - 4096, 0))
        lines = [line for line in self.words.read().decode("utf-8", "replace").splitlines() if line.strip()]
        return " ".join(lines[-1].split())[:200] if lines else "it said nothing"
