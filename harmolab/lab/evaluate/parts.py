"""Rows of a long run in parts on disk: row i stands in part i // size, and a part is replaced whole as it grows.

So the files are the same however often the run was stopped, whoever measured the rows, and what is done is read off
them: every row stands there once or not yet. Parts are Parquet where pyarrow is installed. Where it is not they are CSV
files whose cells are JSON, so that text, numbers and lists stay what they are: larger and slower, and enough for some
thousand rows.
"""

from __future__ import annotations

import json
import time
from base64 import b64decode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np

from harmolab.files import atomic_write, reading, write_synced

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow
else:  # half a second, which no worker needs to wait for
    pd = lazy_loader.load("pandas")

Row = Mapping[str, Any]

STAMP = "inputs"  # column of the parts, not of the table: the state of the files that a row was measured from
PART_ROWS = 1024
FLUSH_SECONDS = 5.0  # the most that a kill costs, but for the rows that are being measured
PARQUET, CSV = ".parquet", ".csv"
_WHAT = "a part of a table"


def part_path(folder: Path, number: int) -> Path:
    """The file of one part of the run in `folder`; all parts are of the kind of the first that is there.

    Raises
    ------
    ValueError
        The run has Parquet parts, and pyarrow is not installed.
    """
    has_arrow = find_spec("pyarrow") is not None
    if not has_arrow and (folder / f"part-{0:07d}{PARQUET}").is_file():
        raise ValueError(f"{folder}: its rows are Parquet, which needs pyarrow; run: pip install pyarrow")
    is_text = not has_arrow or (folder / f"part-{0:07d}{CSV}").is_file()
    return folder / f"part-{number:07d}{CSV if is_text else PARQUET}"


def part_paths(folder: Path) -> list[Path]:
    """The parts of the run in `folder` that are there, in their order."""
    return sorted(folder.glob(f"part-*{part_path(folder, 0).suffix}"))


def cell(value: Any) -> Any:
    """A value as a part holds it: text, a number, None, or a list of numbers; ValueError for another.

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
    columns = {name: [row.get(name) for row in rows] for name in dict.fromkeys(name for row in rows for name in row)}
    content = _csv_bytes(path, columns) if path.suffix == CSV else _parquet_bytes(path, columns)
    with atomic_write(path) as part:
        write_synced(part, content)


def _parquet_bytes(path: Path, columns: Mapping[str, list[Any]]) -> bytes:
    import pyarrow.parquet

    table = pyarrow.table({name: _column(path, name, values) for name, values in columns.items()})
    buffer = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue().to_pybytes()


def _column(path: Path, name: str, values: list[Any]) -> pyarrow.Array[Any]:
    import pyarrow

    try:
        return pyarrow.array(values)
    except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError) as error:
        raise ValueError(f"{path}: values of several kinds in the column {name!r} ({error})") from None


def _csv_bytes(path: Path, columns: Mapping[str, list[Any]]) -> bytes:
    for name, values in columns.items():
        _kind(path, name, set(map(type, values)))
    cells = {
        name: ["" if value is None else json.dumps(value, ensure_ascii=False) for value in values]
        for name, values in columns.items()
    }
    return str(pd.DataFrame(cells).to_csv(index=False, lineterminator="\r\n")).encode()


def _kind(path: Path, name: str, kinds: set[type]) -> type:
    """The kind of a column's values: str, list, float, or int where there is nothing else; `NoneType` for nothing."""
    present = kinds - {NoneType}
    if present in ({int, float}, {int}) and len(kinds) > 1:
        return float
    if len(present) > 1:
        raise ValueError(f"{path}: values of several kinds in the column {name!r}")
    return next(iter(present), NoneType)


def part_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a part, as they were written; ValueError for a damaged file."""
    with reading(path, _WHAT):
        return _csv_rows(path) if path.suffix == CSV else _table(path).to_pylist()


def _csv_rows(path: Path) -> list[dict[str, Any]]:
    cells = pd.read_csv(path, dtype=str, keep_default_na=False)  # the csv module reads no cell of more than 128 KiB
    rows = cells.to_dict("records")
    return [{str(name): json.loads(word) if word else None for name, word in row.items()} for row in rows]


def part_texts(path: Path, column: str) -> list[str]:
    """A column of a part's rows; empty where there is no part, half of one, or no such column."""
    try:
        with reading(path, _WHAT):
            if path.suffix == CSV:
                return [row[column] for row in _csv_rows(path)]
            return _table(path, [column])[column].to_pylist()
    except (ValueError, FileNotFoundError):
        return []


def _table(path: Path, columns: list[str] | None = None) -> pyarrow.Table:
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path, page_checksum_verification=True) as file:
        # Names of columns stand in no page, which has a checksum, but twice in the file.
        names = pyarrow.ipc.read_schema(pyarrow.py_buffer(b64decode(file.metadata.metadata[b"ARROW:schema"]))).names
        if names != file.schema_arrow.names:
            raise ValueError("has damaged names of columns")
        return file.read(columns, use_threads=False)


def part_frames(folder: Path, count: int) -> Iterator[pd.DataFrame]:
    """The rows of all parts as tables with the same columns, of the same types.

    Raises
    ------
    ValueError
        The parts are damaged, or do not hold `count` rows.
    """
    paths = part_paths(folder)
    if part_path(folder, 0).suffix == CSV:
        kinds = _csv_kinds(folder, paths, count)
        return (_csv_frame(path, kinds) for path in paths)
    schema = _common_schema(folder, paths, count)
    return (_frame(path, schema) for path in paths)


def _check_count(folder: Path, rows: int, count: int) -> None:
    if rows != count:
        raise ValueError(f"{folder}: holds {rows} of {count} rows; go on with --resume, or begin anew with --force")


def _common_schema(folder: Path, paths: Sequence[Path], count: int) -> pyarrow.Schema:
    """All columns of the parts with types that hold them, read from their footers alone."""
    import pyarrow.parquet

    schema, rows = pyarrow.schema([]), 0
    for path in paths:
        with reading(path, _WHAT), pyarrow.parquet.ParquetFile(path) as file:
            schema = pyarrow.unify_schemas([schema, file.schema_arrow], promote_options="permissive")
            rows += file.metadata.num_rows
    _check_count(folder, rows, count)
    return pyarrow.schema([column for column in schema if column.name != STAMP])


def _frame(path: Path, schema: pyarrow.Schema) -> pd.DataFrame:
    import pyarrow

    with reading(path, _WHAT):
        table = _table(path)
        own = table.select([name for name in table.column_names if name != STAMP])
        both = pyarrow.concat_tables([schema.empty_table(), own], promote_options="permissive")
        return both.to_pandas(use_threads=False)


def _csv_kinds(folder: Path, paths: Sequence[Path], count: int) -> dict[str, type]:
    """The kind of every column of the parts; of integers float, where some are missing, as a table holds them."""
    kinds: dict[str, set[type]] = {}
    rows = 0
    for path in paths:
        part = part_rows(path)
        for name in dict.fromkeys((*kinds, *part[0])):
            kinds.setdefault(name, {NoneType} if rows else set()).update(type(row.get(name)) for row in part)
        rows += len(part)
    _check_count(folder, rows, count)
    return {name: _kind(folder, name, each) for name, each in kinds.items() if name != STAMP}


def _csv_frame(path: Path, kinds: Mapping[str, type]) -> pd.DataFrame:
    dtypes = {int: "int64", float: "float64", str: pd.Series(["text"]).dtype}  # pandas 3 has a kind of its own for text
    rows = part_rows(path)
    kept = {name: dtypes.get(kind, "object") for name, kind in kinds.items()}
    return pd.DataFrame({name: pd.Series([row.get(name) for row in rows], dtype=kept[name]) for name in kinds})


def write_parts(folder: Path, size: int, rows: Iterable[tuple[int, Row]]) -> None:
    """Write (number, row) that come in their order into the parts of a folder; some may be there already.

    A part is written when it is full, every `FLUSH_SECONDS`, and at the end, be it by an error.
    """
    part: list[Row] = []
    path, last, is_written = folder, time.monotonic(), True
    try:
        for index, row in rows:
            number, place = divmod(index, size)
            if path != part_path(folder, number):  # a part is full before the next one begins
                path = part_path(folder, number)
                part = [*part_rows(path)[:place]] if place else []
            part.append(row)
            is_written = len(part) == size or time.monotonic() - last >= FLUSH_SECONDS
            if is_written:
                write_part(path, part)
                last = time.monotonic()
    finally:
        if not is_written:
            write_part(path, part)
