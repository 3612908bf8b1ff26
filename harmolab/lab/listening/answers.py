"""Answers on disk: one line each, written through at once, so that a killed program loses none.

The file is only ever appended to. A program that dies while it writes leaves at most one half line; the next answer
starts a line of its own, and reading leaves the half line out and says so.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock

from harmolab.io.files import MAX_TEXT_BYTES, PathLike, reading
from harmolab.lab.listening.trials import CHOICES, QUESTIONS, Trial, TrialSet, is_answer

SIMULATED = "simulated-"
START = b'{"study"'  # of every line
LOCK_SECONDS = 30.0


@dataclass(frozen=True)
class Answer:
    """One rater's answer to one trial.

    Parameters
    ----------
    study, rater, trial : str
    choice : str, one of `trials.CHOICES`, or four marks ("8 7 10 3")
    seconds : float or None, time that the rater took
    time : str, moment of the answer, as ISO 8601
    simulated : bool
        True if no person gave the answer; then, and only then, the rater's name starts with "simulated-".
    """

    study: str
    rater: str
    trial: str
    choice: str
    seconds: float | None = None
    time: str = ""
    simulated: bool = False

    def __post_init__(self) -> None:
        for name in ("study", "rater", "trial", "choice", "time"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name} must be text, got {getattr(self, name)!r:.60}")
        if not (self.study and self.rater and self.trial):
            raise ValueError("an answer needs a study, a rater and a trial")
        if not any(is_answer(kind, self.choice) for kind in QUESTIONS):
            choices = [choice for pair in CHOICES.values() for choice in pair]
            raise ValueError(f"choice must be one of {choices} or four marks, got {self.choice!r:.60}")
        is_number = isinstance(self.seconds, int | float) and not isinstance(self.seconds, bool)
        if self.seconds is not None and not (is_number and 0 <= self.seconds < float("inf")):
            raise ValueError(f"seconds must be zero or more, got {self.seconds!r:.60}")
        if not isinstance(self.simulated, bool) or self.simulated != self.rater.startswith(SIMULATED):
            raise ValueError(
                f"a simulated rater, and no other, is called {SIMULATED}...; got {self.rater!r:.60} "
                f"with simulated = {self.simulated!r:.20}"
            )


@dataclass(frozen=True)
class Answers:
    """Answers, and notes on the lines that were left out on the way.

    Parameters
    ----------
    answers : tuple of Answer, one per rater and trial, all of one study
    notes : tuple of str
    """

    answers: tuple[Answer, ...]
    notes: tuple[str, ...] = ()

    @property
    def simulated(self) -> bool:
        """True if any of the answers is not a person's."""
        return any(answer.simulated for answer in self.answers)

    @property
    def raters(self) -> tuple[str, ...]:
        """Names, sorted."""
        return tuple(sorted({answer.rater for answer in self.answers}))

    def of(self, raters: str) -> Answers:
        """The answers of "all" raters, of "people" or of "simulated" raters alone.

        Raises
        ------
        ValueError
            If none are left, or "all" are of both kinds.
        """
        answers = [one for one in self.answers if raters == "all" or one.simulated == (raters == "simulated")]
        if not answers:
            raise ValueError(f"there are no answers of {raters} raters")
        if len({one.simulated for one in answers}) > 1:
            raise ValueError("there are answers of people and of simulated raters; say --raters people or simulated")
        return Answers(tuple(answers), self.notes)


class AnswerLog:
    """A file of answers, one line of JSON each, that is only appended to.

    Parameters
    ----------
    path : str or path
        Made by the first answer; its folder has to exist. Several raters and programs may share it.

    Examples
    --------
    >>> log = AnswerLog("answers.jsonl")  # doctest: +SKIP
    >>> for trial in log.resume(trials):  # doctest: +SKIP
    ...     log.record(trials, trial.id, ask(trial))
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path)
        if not self.path.parent.is_dir():
            raise FileNotFoundError(f"{path}: the folder {self.path.parent} does not exist; create it first")

    def append(self, answer: Answer) -> None:
        """Writes one answer through to the disk; when this returns, no crash can undo it."""
        # ASCII alone, so that a line that was cut off anywhere is still text.
        line = json.dumps(asdict(answer), ensure_ascii=True).encode() + b"\n"
        with FileLock(f"{self.path}.lock", timeout=LOCK_SECONDS):
            content = self.path.read_bytes() if self.path.exists() else b""
            half_line = content != b"" and not content.endswith(b"\n")
            with self.path.open("ab") as file:
                file.write(b"\n" + line if half_line else line)
                file.flush()
                os.fsync(file.fileno())
            if not content:
                _sync_folder(self.path.parent)

    def record(self, trials: TrialSet, trial: str, choice: str, *, seconds: float | None = None) -> Answer:
        """The answer of the trials' rater to one of them, just written.

        Raises
        ------
        ValueError
            If there is no such trial or choice, or it is answered already.
        """
        if not is_answer(trials.kind, choice):
            expected = "four marks, as 8 7 10 3" if trials.kind == "rate" else f"one of {trials.choices}"
            raise ValueError(f"choice must be {expected}, got {choice!r:.60}")
        if trial not in {one.id for one in self.resume(trials)}:
            raise ValueError(f"trial {trial!r:.60} is not waiting for an answer of {trials.rater}")
        now = datetime.now(UTC).isoformat(timespec="seconds")
        simulated = trials.rater.startswith(SIMULATED)
        answer = Answer(trials.study, trials.rater, trial, choice, seconds, now, simulated)
        self.append(answer)
        return answer

    def read(self) -> Answers:
        """The answers so far; nothing if the file is not there yet."""
        return merge([self.path]) if self.path.exists() else Answers(())

    def resume(self, trials: TrialSet) -> tuple[Trial, ...]:
        """The trials that their rater has not answered yet, in order.

        Raises
        ------
        ValueError
            If the file holds answers of another study.
        """
        answers = self.read().answers
        if answers and answers[0].study != trials.study:
            raise ValueError(
                f"{self.path}: holds answers of study {answers[0].study}, not {trials.study}; take another file"
            )
        answered = {answer.trial for answer in answers if answer.rater == trials.rater}
        return tuple(trial for trial in trials.trials if trial.id not in answered)


def merge(paths: Sequence[PathLike]) -> Answers:
    """The answers of all files; half lines are left out and noted.

    Of two answers of a rater to a trial the first counts, and a note names the second.

    Raises
    ------
    FileNotFoundError, ValueError
        Naming the file and the line, if a file is missing or is not an answer file, or the answers are of different
        studies; also if there are no files.
    """
    if not paths:
        raise ValueError("no answer files given")
    answers: dict[tuple[str, str], Answer] = {}
    notes: list[str] = []
    study: tuple[str, PathLike] | None = None
    for path in paths:
        for number, answer in _lines(path, notes):
            study = study or (answer.study, path)
            if answer.study != study[0]:
                raise ValueError(
                    f"{path}: line {number} is of study {answer.study}, but {study[1]} is of study {study[0]}; "
                    "analyse each study alone"
                )
            first = answers.setdefault((answer.rater, answer.trial), answer)
            if first is not answer:
                repeated = f"{answer.rater} had answered trial {answer.trial} before"
                notes.append(f"{path}: line {number}: {repeated}; left out")
    return Answers(tuple(answers.values()), tuple(notes))


def _lines(path: PathLike, notes: list[str]) -> Iterator[tuple[int, Answer]]:
    """(line number, answer) of every whole line; half lines go to `notes`."""
    if Path(path).is_file() and Path(path).stat().st_size == 0:
        return  # killed before the first line
    with reading(path, "an answer file", max_bytes=MAX_TEXT_BYTES) as file:
        for number, row in enumerate(file.read_bytes().split(b"\n"), 1):
            answer = _parsed(row, number) if row else None
            if answer is not None:
                yield number, answer
            elif row:
                notes.append(f"{path}: line {number} was cut off while it was written; left out")


def _parsed(row: bytes, number: int) -> Answer | None:
    """The answer in one line; None if the line is the beginning of one."""
    try:
        content = json.loads(row)
    except (ValueError, RecursionError):
        if row.isascii() and (row.startswith(START) or START.startswith(row)):
            return None
        raise ValueError(f"line {number} is not an answer: {row[:60]!r}") from None
    names = {field.name for field in fields(Answer)}
    if not isinstance(content, dict) or set(content) != names:
        raise ValueError(f"line {number} must have the fields {', '.join(sorted(names))} and no other")
    try:
        return Answer(**content)
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


def _sync_folder(folder: Path) -> None:
    """Makes the name of a new file last, where folders can be opened (not on Windows)."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
