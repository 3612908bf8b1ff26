"""One clear error for every damaged file: what a library throws becomes a ValueError that names the file.

Nothing in a file is trusted: its size is looked at before it is read, and a loader raises ValueError or
FileNotFoundError only, with the file's name first.
"""

from __future__ import annotations

import json
import os
import pickle
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PathLike = str | os.PathLike[str]
Progress = Callable[[Iterable[Any], str], Iterable[Any]]

MAX_BYTES = 512 * 2**20
# Parsed text takes many times its room.
MAX_JSON_BYTES = 256 * 2**20
MAX_TEXT_BYTES = 16 * 2**20

# RuntimeError stands for RecursionError, NotImplementedError and the errors of libsndfile.
_FAULTS = (
    ValueError,
    OSError,
    EOFError,
    RuntimeError,
    ArithmeticError,
    LookupError,
    TypeError,
    AttributeError,
    SyntaxError,
    tokenize.TokenError,
    struct.error,
    zlib.error,
    zipfile.BadZipFile,
    pickle.UnpicklingError,
)


def silent(items: Iterable[Any], label: str) -> Iterable[Any]:
    """The items as they are: the `Progress` that shows nothing."""
    return items


@contextmanager
def reading(path: PathLike, what: str, *, max_bytes: int | None = MAX_BYTES) -> Iterator[Path]:
    """The path, checked to be an ordinary file with bytes in it; faults inside the block name the file.

    Parameters
    ----------
    path : str or path
    what : str
        What the file ought to be, such as "a BVH motion".
    max_bytes : int or None
        Larger files are refused unread. None: any size (the reader bounds itself).

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        It is a folder, a device, empty or too large, or the block failed on its content.
    """
    try:
        _check_file(Path(path), max_bytes)
        yield Path(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"{path}: no such file") from None
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than this machine has; read a part of it") from error
    except _FAULTS as error:
        raise ValueError(_message(str(path), what, error)) from error


def _check_file(path: Path, max_bytes: int | None) -> None:
    """ValueError unless `path` is an ordinary file of 1 to `max_bytes` bytes."""
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise ValueError("is a folder, not a file")
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("is a device or a pipe, not a file; copy it to a file first")
    if status.st_size == 0:
        raise ValueError("the file is empty")
    if max_bytes is not None and status.st_size > max_bytes:
        raise ValueError(f"has {status.st_size} bytes, more than the {max_bytes} allowed; cut it into parts")


def _message(path: str, what: str, error: Exception) -> str:
    """`error` in one line behind the file's name; an error that is none of ours says what was expected."""
    text = " ".join(str(error).split())[:400]
    if text.startswith(path):
        return text
    if type(error) is ValueError:
        return f"{path}: {text}"
    return f"{path}: cannot be read as {what} ({text or type(error).__name__})"


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, without a byte order mark."""
    return path.read_bytes().decode("utf-8-sig")


def read_json(path: Path) -> Any:
    """The content of a JSON file; call it inside `reading`, which bounds its size and words its errors."""
    return json.loads(path.read_bytes())
