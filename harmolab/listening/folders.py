"""A study on disk: the blind trials, and in a file of its own the key, which no rater should open."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from harmolab.io.aside import written_aside
from harmolab.io.errors import MAX_TEXT_BYTES, PathLike, read_json, reading
from harmolab.listening.trials import MOST_TRIALS, Asked, Key, Trial, TrialSet

__all__ = ["KEY_FILE", "TRIALS_FILE", "read_key", "read_trials", "write_study"]

TRIALS_FILE, KEY_FILE = "trials.json", "key.json"


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
    _write_json(folder / TRIALS_FILE, asdict(trials))
    asked = {name: asdict(one) for name, one in key.trials.items()}
    _write_json(folder / KEY_FILE, {"study": key.study, "kind": key.kind, "trials": asked})
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
        trials = {name: _asked(row) for name, row in content["trials"].items()}
        return Key(content["study"], content["kind"], trials)


def _asked(content: Any) -> Asked:
    row = _fields(content, "item", "versions", "sources", "right")
    return Asked(_texts([row["item"]])[0], _texts(row["versions"]), _texts(row["sources"]), row["right"])


def _fields(content: Any, *names: str) -> dict[str, Any]:
    """`content`, if it is an object with just these fields: any other might tell the rater something."""
    if not isinstance(content, dict) or set(content) != set(names):
        found = sorted(content) if isinstance(content, dict) else type(content).__name__
        raise ValueError(f"must have the fields {', '.join(names)} and no other, got {found!s:.200}")
    return content


def _listed(content: Any) -> list[Any]:
    if not isinstance(content, list) or len(content) > MOST_TRIALS:
        raise ValueError(f"trials must be a list of at most {MOST_TRIALS}")
    return content


def _texts(content: Any) -> tuple[str, ...]:
    if not isinstance(content, list) or not all(isinstance(text, str) and text for text in content):
        raise ValueError(f"must be texts that are not empty, got {content!r:.120}")
    return tuple(content)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with written_aside(path) as aside:
        aside.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", "utf-8")
