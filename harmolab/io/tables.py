"""Small tables of text: a line of names, then a line for each row, with commas, semicolons or tabs between."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from harmolab.io.files import read_text

MAX_ROWS = 1_000_000


def read_columns(path: Path, needed: Sequence[str]) -> dict[str, list[str]]:
    """The columns of a table by name; call it inside `harmolab.io.files.reading`.

    Lines that are empty or begin with # are left out. A word with the mark between words in it stands in quotation
    marks; no word goes over two lines.

    Parameters
    ----------
    path : Path
    needed : names of columns that must be there

    Raises
    ------
    ValueError
        A needed column is missing, a name is there twice, or a line has another number of words than the first.
    """
    lines = [(place, line) for place, line in enumerate(read_text(path).splitlines(), 1) if line.strip()]
    lines = [(place, line) for place, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise ValueError(f"has no line of names; the first line must be {','.join(needed)}")
    mark = max(",;\t", key=lines[0][1].count)
    rows = [(place, _words(line, mark)) for place, line in lines]
    names = rows[0][1]
    if missing := [name for name in needed if name not in names]:
        raise ValueError(f"has no column {' and no '.join(missing)} in its first line, {lines[0][1][:80]!r}")
    if len(set(names)) < len(names):
        raise ValueError(f"has a name twice in its first line, {lines[0][1][:80]!r}")
    if len(rows) > MAX_ROWS:
        raise ValueError(f"has {len(rows)} lines, more than the {MAX_ROWS} allowed")
    for place, words in rows:
        if len(words) != len(names):
            raise ValueError(f"line {place} has {len(words)} values, the first line {len(names)} names")
    return {name: [words[number] for _, words in rows[1:]] for number, name in enumerate(names)}


def _words(line: str, mark: str) -> list[str]:
    """The words of a line.

    >>> _words('a.npz, "one, two" ', ",")
    ['a.npz', 'one, two']
    """
    try:
        return [word.strip() for word in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
    except csv.Error as error:
        raise ValueError(f"has a line that is no row of a table ({error}): {line[:80]!r}") from None


def number_column(columns: dict[str, list[str]], name: str) -> list[float]:
    """A column as numbers; ValueError with its name and the word that is none."""
    numbers = []
    for word in columns[name]:
        try:
            numbers.append(float(word))
        except ValueError:
            raise ValueError(f"{name} must be numbers, got {word[:30]!r}") from None
    return numbers
