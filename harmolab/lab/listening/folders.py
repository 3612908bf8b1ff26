"""A study on disk, in a folder that needs no corpus any more.

=====================  ============================================================
trials.json            the blind trials
pages/TRIAL.html       what each of them shows: a blind player
answers/RATER.jsonl    the answers, a file for each rater
key.json, scores.json  what was asked, and how it scores; no rater should open them
=====================  ============================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from harmolab.io.files import MAX_TEXT_BYTES, PathLike, read_json, read_text, reading, write_json, write_text
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import MOST_TRIALS, Key, KeyEntry, Trial, TrialSet

TRIALS_FILE, KEY_FILE, SCORES_FILE = "trials.json", "key.json", "scores.json"
PAGES, ANSWERS = "pages", "answers"


def write_study(folder: PathLike, trials: TrialSet, key: Key) -> Path:
    """The folder, with the blind ``trials.json`` and, not to be shown to a rater, ``key.json``.

    Raises
    ------
    ValueError
        If the key is of another study.
    """
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
        Naming the file, if it is missing or is not what `write_study` writes.
    """
    with reading(path, "the trials of a study", max_bytes=MAX_TEXT_BYTES) as file:
        content = _fields(read_json(file), "study", "kind", "rater", "trials")
        rows = [_fields(row, "id", "stimuli") for row in _listed(content["trials"])]
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
    """The log of one rater, in a file named after them."""
    answers = Path(folder) / ANSWERS
    answers.mkdir(exist_ok=True)
    return AnswerLog(answers / f"{quote(rater, safe=' ')[:200]}.jsonl")


def answer_files(folder: PathLike) -> list[Path]:
    """The answer files of all raters.

    Raises
    ------
    FileNotFoundError
        If nobody has answered yet.
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


def _listed(content: Any) -> list[Any]:
    if not isinstance(content, list) or len(content) > MOST_TRIALS:
        raise ValueError(f"trials must be a list of at most {MOST_TRIALS}")
    return content


def _texts(content: Any) -> tuple[str, ...]:
    if not isinstance(content, list) or not all(isinstance(text, str) and text for text in content):
        raise ValueError(f"must be texts that are not empty, got {content!r:.120}")
    return tuple(content)
