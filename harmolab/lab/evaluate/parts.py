"""Rows of a long run in Parquet parts: row i stands in part i // `PART_ROWS`, and a part is replaced whole as it grows.

So the files are the same however often the run was stopped, whoever measured the rows, and what is done is read off
them: every row stands there once or not yet. Needs pyarrow (``pip install '.[cluster]'``).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harmolab.io.files import PathLike, atomic_write, read_json, reading
from harmolab.systems.common.about import write_synced

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow

Row = Mapping[str, Any]

FORMAT = "harmolab rows 1"
MANIFEST = "run.json"
KEY, ERROR = "key", "error"  # the first two columns of every row
STAMP = "inputs"  # column of the parts, not of the table: the state of the files that a row was measured from
PART_ROWS = 1024
FLUSH_SECONDS = 5.0  # the most that a kill costs, but for the rows that are being measured
_WHAT = "a part of a table"


def check_installed(*packages: str) -> None:
    """ValueError unless these packages, which not every harmolab needs, are installed."""
    for name in packages:
        if find_spec(name) is None:
            raise ValueError(f"this needs {name}; in a copy of harmolab, run: pip install '.[cluster]'")


def part_path(folder: Path, number: int) -> Path:
    """The file of one part of the run in `folder`."""
    return folder / f"part-{number:07d}.parquet"


def cell(value: Any) -> Any:
    """A value as a Parquet column holds it: text, a number, None, or a list of numbers; ValueError for another.

    >>> cell(np.float64(0.5)), cell(np.arange(2))
    (0.5, [0, 1])
    """
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(plain, list | tuple) and all(isinstance(one, int | float) for one in plain):
        return list(plain)
    if plain is None or isinstance(plain, str | int | float):
        return plain
    raise ValueError(f"a table holds text, numbers and lists of numbers, not {type(value).__name__}")


def write_part(path: Path, rows: Sequence[Row]) -> None:
    """Write the rows of a part, whole or not at all, and on disk when this returns.

    Columns stand in the order in which they first appear; what a row does not have is missing there.

    Raises
    ------
    ValueError
        For text and numbers in one column; names the file and the column.
    """
    import pyarrow.parquet

    columns = {name: [row.get(name) for row in rows] for name in dict.fromkeys(name for row in rows for name in row)}
    table = pyarrow.table({name: _column(path, name, values) for name, values in columns.items()})
    buffer = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, buffer, compression="zstd", write_page_checksum=True)
    with atomic_write(path) as part:
        write_synced(part, buffer.getvalue().to_pybytes())


def _column(path: Path, name: str, values: list[Any]) -> pyarrow.Array[Any]:
    import pyarrow

    try:
        return pyarrow.array(values)
    except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError) as error:
        raise ValueError(f"{path}: values of several kinds in the column {name!r} ({error})") from None


def part_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a part, as they were written; ValueError for a damaged file."""
    with reading(path, _WHAT):
        return _table(path).to_pylist()


def part_keys(path: Path) -> list[str]:
    """The keys of a part's rows; none where there is no part, or half of one."""
    return part_texts(path, KEY)


def part_texts(path: Path, column: str) -> list[str]:
    """A column of a part's rows; empty where there is no part, half of one, or no such column."""
    try:
        with reading(path, _WHAT):
            return _table(path, [column])[column].to_pylist()
    except (ValueError, FileNotFoundError):
        return []


def _table(path: Path, columns: list[str] | None = None) -> pyarrow.Table:
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path, page_checksum_verification=True) as file:
        return file.read(columns, use_threads=False)


def read_manifest(folder: PathLike) -> dict[str, Any]:
    """The manifest of a run beside its parts: number of rows, digest of their keys, versions, settings.

    Raises
    ------
    FileNotFoundError, ValueError
        Without a run in the folder.
    """
    with reading(Path(folder) / MANIFEST, "the manifest of a run") as file:
        manifest = read_json(file)
        if not isinstance(manifest, dict) or manifest.get("format") != FORMAT or not isinstance(manifest["rows"], int):
            raise ValueError(f"is no manifest of {FORMAT!r}")
        return manifest


def read_rows(folder: PathLike) -> Iterator[pd.DataFrame]:
    """The table of a finished run, a part at a time, in the order of the keys.

    Every part has all columns, of the same types: the first is "key", the second "error" (empty text where there was
    none, else what stood in the way; the other columns are then missing).

    Raises
    ------
    FileNotFoundError, ValueError
        Without a run in the folder, for a damaged part, and for a run that is not finished.
    """
    check_installed("pyarrow")
    folder = Path(folder)
    count = read_manifest(folder)["rows"]
    paths = sorted(folder.glob("part-*.parquet"))
    schema = _common_schema(folder, paths, count)
    return (_frame(path, schema) for path in paths)


def _common_schema(folder: Path, paths: Sequence[Path], count: int) -> pyarrow.Schema:
    """All columns of the parts with types that hold them, read from their footers alone."""
    import pyarrow.parquet

    schema, rows = pyarrow.schema([]), 0
    for path in paths:
        with reading(path, _WHAT), pyarrow.parquet.ParquetFile(path) as file:
            schema = pyarrow.unify_schemas([schema, file.schema_arrow], promote_options="permissive")
            rows += file.metadata.num_rows
    if rows != count:
        raise ValueError(f"{folder}: holds {rows} of {count} rows; go on with --resume, or begin anew with --force")
    return pyarrow.schema([column for column in schema if column.name != STAMP])


def _frame(path: Path, schema: pyarrow.Schema) -> pd.DataFrame:
    import pyarrow

    with reading(path, _WHAT):
        table = _table(path)
        columns = {
            field.name: table[field.name].cast(field.type)
            if field.name in table.column_names
            else pyarrow.nulls(len(table), field.type)
            for field in schema
        }
        return pyarrow.table(columns, schema=schema).to_pandas(use_threads=False)


class PartWriter:
    """Writes rows that come in their order into the parts of a folder; some may be there already.

    A part is written when it is full, every `FLUSH_SECONDS`, and at the end of the block, be it by an error.
    """

    def __init__(self, folder: Path, part_rows: int) -> None:
        self._folder, self._size = folder, part_rows
        self._number = -1
        self._rows: list[Row] = []
        self._pending = 0
        self._last = time.monotonic()

    def __enter__(self) -> PartWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._flush()

    def add(self, index: int, row: Row) -> None:
        """Add row number `index`; those before it in its part have been added, or are on disk."""
        number, place = divmod(index, self._size)
        if number != self._number:
            self._flush()
            self._number = number
            self._rows = [*part_rows(part_path(self._folder, number))[:place]] if place else []
        self._rows.append(row)
        self._pending += 1
        if len(self._rows) == self._size or time.monotonic() - self._last >= FLUSH_SECONDS:
            self._flush()

    def _flush(self) -> None:
        if self._pending:
            write_part(part_path(self._folder, self._number), self._rows)
        self._pending, self._last = 0, time.monotonic()
