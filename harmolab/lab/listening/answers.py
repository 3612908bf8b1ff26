"""Answers of raters on disk, the folder of a study that holds them, and simulated raters.

An answer is a line of a file. It is written at once, so that a killed program loses none, and nothing in the file is
ever changed. A program that dies while it writes leaves at most one half line. The next answer starts a line of its
own, and reading leaves the half line out and says so.

A study is a folder that needs the recordings no more:

=====================  ============================================================
trials.json            the blind trials
pages/TRIAL.html       the page of each of them: a blind player
answers/RATER.jsonl    the answers, a file for each rater
key.json, scores.json  the truth about the trials, and their scores; not for raters
=====================  ============================================================

Simulated raters are not people; they have a known skill, test the analysis, and are called simulated wherever they
appear.
"""

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np
from filelock import FileLock

from harmolab.files import MAX_TEXT_BYTES, PathLike, read_json, read_text, reading, write_json, write_text
from harmolab.lab.listening.trials import CHOICES, MARKED, MOST, MOST_TRIALS, Key, KeyEntry, Trial, TrialSet, is_answer
from harmolab.score import check_whole

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
    time : str, moment of the answer, as ISO 8601
    simulated : bool
        True if no person gave the answer; then, and only then, the rater's name starts with "simulated-".
    """

    study: str
    rater: str
    trial: str
    choice: str
    time: str = ""
    simulated: bool = False

    def __post_init__(self) -> None:
        for name in ("study", "rater", "trial", "choice", "time"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name} must be text, got {getattr(self, name)!r:.60}")
        if not (self.study and self.rater and self.trial):
            raise ValueError("an answer needs a study, a rater and a trial")
        choices = [choice for pair in CHOICES.values() for choice in pair]
        if self.choice not in choices and not is_answer("rate", self.choice):
            raise ValueError(f"choice must be one of {choices} or four marks, got {self.choice!r:.60}")
        if not isinstance(self.simulated, bool) or self.simulated != self.rater.startswith(SIMULATED):
            raise ValueError(
                f"a simulated rater, and no other, is called {SIMULATED}...; got {self.rater!r:.60} "
                f"with simulated = {self.simulated!r:.20}"
            )


@dataclass(frozen=True)
class Answers:
    """The answers of a study, as `merge` reads them.

    Parameters
    ----------
    answers : tuple of Answer
        One for each rater and trial, all of one study.
    notes : tuple of str
        Sentences on the lines of files that were left out.
    """

    answers: tuple[Answer, ...]
    notes: tuple[str, ...] = ()

    @property
    def simulated(self) -> bool:
        """True if any of the answers is not a person's."""
        return any(answer.simulated for answer in self.answers)

    @property
    def raters(self) -> tuple[str, ...]:
        """Names of the raters, sorted."""
        return tuple(sorted({answer.rater for answer in self.answers}))


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

    def record(self, trials: TrialSet, trial: str, choice: str) -> Answer:
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
        answer = Answer(trials.study, trials.rater, trial, choice, now, trials.rater.startswith(SIMULATED))
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
    """Read the answers of several files, such as one for each rater, into one record.

    Of two answers of a rater to one trial the first in time counts, and a note names the other. Half lines are left out
    and noted.

    Parameters
    ----------
    paths : sequence of str or path
        As of `answer_files`.

    Returns
    -------
    Answers

    Raises
    ------
    FileNotFoundError, ValueError
        If a file is missing or holds no answers, or the answers are of different studies; they name file and line.
        Also if there are no files, or one path is passed in place of a list.
    """
    if not paths or isinstance(paths, str | os.PathLike):
        raise ValueError(f"answer files are needed, in a list as answer_files returns it; got {str(paths)!r}")
    answers: dict[tuple[str, str], _Line] = {}
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
            line = _Line(path, number, answer)
            first = answers.setdefault((answer.rater, answer.trial), line)
            if first is not line:
                first, later = sorted((first, line), key=lambda one: one.answer.time)
                answers[answer.rater, answer.trial] = first
                repeated = f"{later.answer.rater} had answered trial {later.answer.trial} before"
                notes.append(f"{later.path}: line {later.number}: {repeated}; left out")
    return Answers(tuple(line.answer for line in answers.values()), tuple(notes))


class _Line(NamedTuple):
    """An answer, and where it stands."""

    path: PathLike
    number: int
    answer: Answer


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
    if not isinstance(content, dict) or set(content) - {"seconds"} != names:  # which older files have
        raise ValueError(f"line {number} must have the fields {', '.join(sorted(names))} and no other")
    try:
        return Answer(**{name: content[name] for name in names})
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


# The folder of a study

TRIALS_FILE, KEY_FILE, SCORES_FILE = "trials.json", "key.json", "scores.json"
PAGES, ANSWERS = "pages", "answers"


def write_study(folder: PathLike, trials: TrialSet, key: Key) -> Path:
    """Write a study into a folder: the blind ``trials.json``, and ``key.json``, which no rater may see.

    Parameters
    ----------
    folder : str or path
        Made if there is none.
    trials : TrialSet
        As of `make_trials`.
    key : Key
        As of `make_key` with the same arguments.

    Returns
    -------
    Path of the folder

    Raises
    ------
    ValueError
        If the key is of another study, or an argument is of another kind.
    """
    if not (isinstance(trials, TrialSet) and isinstance(key, Key)):
        raise ValueError(f"trials and their key are needed, got {type(trials).__name__} and {type(key).__name__}")
    if trials.study != key.study:
        raise ValueError(f"trials of study {trials.study} do not go with the key of study {key.study}")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / KEY_FILE, key)
    write_json(folder / TRIALS_FILE, trials)  # last: a study that has it is whole
    return folder


def read_trials(path: PathLike) -> TrialSet:
    """The trials in a ``trials.json``.

    Raises
    ------
    FileNotFoundError, ValueError
        Naming the file, if it is missing or was not written by `write_study`.
    """
    with reading(path, "the trials of a study", max_bytes=MAX_TEXT_BYTES) as file:
        content = _fields(read_json(file), "study", "kind", "rater", "trials")
        if not isinstance(content["trials"], list) or len(content["trials"]) > MOST_TRIALS:
            raise ValueError(f"trials must be a list of at most {MOST_TRIALS}")
        rows = [_fields(row, "id", "stimuli") for row in content["trials"]]
        trials = tuple(Trial(row["id"], _texts(row["stimuli"])) for row in rows)
        return TrialSet(content["study"], content["kind"], _texts([content["rater"]])[0], trials)


def read_key(path: PathLike) -> Key:
    """The key in a ``key.json``; raises as `read_trials` does."""
    with reading(path, "the key of a study", max_bytes=MAX_TEXT_BYTES) as file:
        content = _fields(read_json(file), "study", "kind", "trials")
        if not isinstance(content["trials"], dict):
            raise ValueError("trials must be an object from trial to what it asks")
        trials = {name: _key_entry(row) for name, row in content["trials"].items()}
        return Key(content["study"], content["kind"], trials)


def write_page(folder: PathLike, trial: str, page: str) -> None:
    """Write the page of a trial; `trial` is its id."""
    path = _page_path(folder, trial)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, page)


def read_page(folder: PathLike, trial: str) -> str:
    """The page of a trial, HTML.

    Raises
    ------
    FileNotFoundError, ValueError
        Naming the file.
    """
    with reading(_page_path(folder, trial), "the page of a trial", max_bytes=MAX_TEXT_BYTES) as file:
        return read_text(file)


def _page_path(folder: PathLike, trial: str) -> Path:
    return Path(folder) / PAGES / f"{trial}.html"


def answer_log(folder: PathLike, rater: str) -> AnswerLog:
    """The log of one rater's answers, a file of the study that is named after the rater.

    Parameters
    ----------
    folder : str or path
        Of the study (`write_study`).
    rater : str

    Returns
    -------
    AnswerLog, which `StudyServer` writes to
    """
    answers = Path(folder) / ANSWERS
    answers.mkdir(exist_ok=True)
    return AnswerLog(answers / f"{quote(rater, safe=' ')[:200]}.jsonl")


def answer_files(folder: PathLike) -> list[Path]:
    """The answer files of all raters of a study, for `merge`.

    Parameters
    ----------
    folder : str or path
        Of the study.

    Returns
    -------
    list of Path, sorted

    Raises
    ------
    FileNotFoundError
        If there are no answers yet.
    """
    files = sorted((Path(folder) / ANSWERS).glob("*.jsonl"))
    if not files:
        raise FileNotFoundError(f"{Path(folder) / ANSWERS}: nobody has answered yet")
    return files


def write_scores(folder: PathLike, scores: Mapping[str, Mapping[str, float]]) -> None:
    """Writes the value of every score for every source: ``{score: {source: value}}``, null where there is none."""
    write_json(Path(folder) / SCORES_FILE, scores)


def read_scores(path: PathLike) -> dict[str, dict[str, float]]:
    """The scores in a ``scores.json``, NaN where there is none; raises as `read_trials` does."""
    with reading(path, "the scores of a study", max_bytes=MAX_TEXT_BYTES) as file:
        content = read_json(file)
        if not isinstance(content, dict) or not all(isinstance(values, dict) for values in content.values()):
            raise ValueError("must be an object from score to source to number")
        return {name: {source: _number(value) for source, value in row.items()} for name, row in content.items()}


def _number(value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"a score must be a number or null, got {value!r:.60}")
    return float(value)


def _key_entry(content: Any) -> KeyEntry:
    row = _fields(content, "item", "versions", "sources", "right")
    return KeyEntry(_texts([row["item"]])[0], _texts(row["versions"]), _texts(row["sources"]), row["right"])


def _fields(content: Any, *names: str) -> dict[str, Any]:
    """`content`, if it is an object with just these fields: any other might tell the rater something."""
    if not isinstance(content, dict) or set(content) != set(names):
        content_names = sorted(content) if isinstance(content, dict) else type(content).__name__
        raise ValueError(f"must have the fields {', '.join(names)} and no other, got {content_names!s:.200}")
    return content


def _texts(content: Any) -> tuple[str, ...]:
    if not isinstance(content, list) or not all(isinstance(text, str) and text for text in content):
        raise ValueError(f"must be texts that are not empty, got {content!r:.120}")
    return tuple(content)


# Simulated raters of known skill


@dataclass(frozen=True)
class SimulatedRater:
    """A simulated rater, who is right with a known probability; to test a study and its analysis before people come.

    Parameters
    ----------
    skill : float from 0 to 1
        Probability of a right answer; .5 is guessing.
    seed : int
        Of the answers; it also names the rater.
    prefers : str, optional
        The version that is taken for right in trials that have no right answer, as between two models. Marks of its
        dances are higher, the more so the more skill.

    Examples
    --------
    >>> SimulatedRater(0.8, seed=3).name
    'simulated-3'
    """

    skill: float
    seed: int
    prefers: str | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.skill <= 1.0:
            raise ValueError(f"skill must be between 0 and 1, got {self.skill}")
        check_whole(seed=self.seed)

    @property
    def name(self) -> str:
        """Name of the rater, to be passed to `make_trials`."""
        return f"{SIMULATED}{self.seed}"

    def answers(self, trials: TrialSet, key: Key) -> tuple[Answer, ...]:
        """An answer to every trial; unlike a person, a simulated rater looks at the key.

        Raises
        ------
        ValueError
            If the trials are another rater's or another study's, or a trial has no right answer and the rater prefers
            neither of the two.
        """
        if trials.study != key.study or trials.rater != self.name:
            raise ValueError(f"{self.name} was given trials of {trials.rater}, study {trials.study}")
        rng = np.random.default_rng([self.seed, int(trials.study, 16)])
        answers = []
        for trial in trials.trials:
            entry = key.trials[trial.id]
            choice = self._marks(entry, rng) if trials.kind == "rate" else self._choice(entry, trials.choices, rng)
            answers.append(Answer(trials.study, self.name, trial.id, choice, simulated=True))
        return tuple(answers)

    def _marks(self, entry: KeyEntry, rng: np.random.Generator) -> str:
        """Four marks for a dance: 5, two more or less by skill and version, and chance."""
        is_liked = entry.versions[0] == self.prefers
        centre = MOST / 2 + (2 if is_liked else -2) * (2 * self.skill - 1)
        marks = np.clip(np.round(rng.normal(centre, 1.0, len(MARKED))), 0, MOST).astype(int)
        return " ".join(map(str, marks))

    def _choice(self, entry: KeyEntry, choices: tuple[str, str], rng: np.random.Generator) -> str:
        right = self._right(entry)
        return right if rng.random() < self.skill else choices[1 - choices.index(right)]

    def _right(self, entry: KeyEntry) -> str:
        if entry.right is not None:
            return entry.right
        if self.prefers not in entry.versions:
            raise ValueError(f"no answer is right between {entry.versions}; give prefers= one of them")
        return "left" if self.prefers == entry.versions[0] else "right"
