"""Files: one clear error for every damaged one, whole or no new ones, JSON, the cache, progress, tables of text.

Nothing in a file is trusted: its size is looked at before it is read, and a loader raises ValueError or
FileNotFoundError only, with the file's name first.
"""

import atexit
import csv
import json
import math
import os
import pickle
import re
import shutil
import stat
import struct
import tempfile
import threading
import time
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filelock import FileLock

if TYPE_CHECKING:
    from numpy.typing import NDArray

PathLike = str | os.PathLike[str]
Arrays = dict[str, "NDArray[Any]"]

# function(items, label) -> items, such as ``lambda items, label: tqdm(items, desc=label)``
Progress = Callable[[Iterable[Any], str], Iterable[Any]]

MAX_BYTES = 512 * 2**20
# Parsed text takes many times its room.
MAX_JSON_BYTES = 256 * 2**20
MAX_TEXT_BYTES = 16 * 2**20
LEFTOVER_SECONDS = 86_400.0  # a file that is written for a day was left by a killed process
_LEFTOVER = re.compile(r"\..+\.npz\.\d+\.\d+\.tmp")
WRITTEN_BY = "written by harmolab"  # stands at the begin or the end of files whose format has room for it
_LETTERS = 50  # of a name, of up to 4 bytes each, that its hidden neighbour has too: file systems take 255 bytes in all
_ENDS = 65_536  # bytes at either end of a file that are searched for it
_TABLES = 2**24  # of an MP4, whose tags stand behind tables of some 34 kilobytes a minute
# What it is in an .npz and on a page; bar patterns, a BVH and a table of recordings are known by what ours alone have.
_OWN = re.compile(
    rb"""written by harmolab|written_by_harmolab|<meta name="generator" content="harmolab">|"cosines": \["""
    rb"""|\Aname,dance,error,|End Site\n\t+\{\n\t+OFFSET 0 0 0\n\t+\}"""
)
SOUNDS = (".wav", ".flac", ".ogg", ".mp3", ".m4a")  # endings of sound files
UNFINISHED = ".writing_"  # begins the name of a folder that is being filled

# RuntimeError stands for RecursionError, NotImplementedError and the errors of libsndfile.
_FAULTS = (
    ValueError, OSError, EOFError, RuntimeError, ArithmeticError, LookupError, TypeError, AttributeError, SyntaxError,
    csv.Error, tokenize.TokenError, struct.error, zlib.error, zipfile.BadZipFile, pickle.UnpicklingError,
)  # fmt: skip


def silent(items: Iterable[Any], label: str) -> Iterable[Any]:
    """The items as they are: the `Progress` that shows nothing."""
    return items


@dataclass(frozen=True, eq=False)
class Counted:
    """Items, and about how many there will be, for a `Progress`."""

    items: Iterable[Any]
    count: int

    def __iter__(self) -> Iterator[Any]:
        return iter(self.items)

    def __len__(self) -> int:
        return self.count


class MissingFrameRate(ValueError):
    """A motion file holds no frame rate, and none was passed; with a rate it may be read."""


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
        It is a folder, a device, empty or too large, or the block failed on its content; a `MissingFrameRate` of the
        block stays one.
    """
    try:
        _check_file(Path(path), max_bytes)
        yield Path(path)
    except FileNotFoundError as error:
        if error.errno is None:  # of another file that the block read, which it names
            raise
        raise FileNotFoundError(f"{path}: no such file") from None
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than this machine has; read a part of it") from error
    except _FAULTS as error:
        kind = MissingFrameRate if isinstance(error, MissingFrameRate) else ValueError
        raise kind(_message(str(path), what, error)) from error


@contextmanager
def named_faults(name: object) -> Iterator[None]:
    """ValueErrors of the block begin with a name, mostly that of a file."""
    try:
        yield
    except ValueError as error:
        text = str(error).removeprefix(f"{name}: ").removeprefix(f"{Path(str(name)).name}: ")
        raise ValueError(f"{name}: {text}") from None


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
    # A name may hold new lines itself, and libsndfile names the file by its bytes.
    text = " ".join(str(getattr(error, "error_string", error)).removeprefix(path).split())[:400]
    if str(error).startswith(path):
        return path + text
    if type(error) in (ValueError, MissingFrameRate):
        return f"{path}: {text}"
    if isinstance(error, PermissionError):
        return f"{path}: {error.strerror}"
    if text.startswith("File does not exist"):  # so libsndfile calls an MP3 without a whole frame
        text = "damaged or cut off"
    if isinstance(error, UnicodeDecodeError):
        text = "no text in UTF-8: if it is text, save it in that encoding"
    return f"{path}: cannot be read as {what} ({text or type(error).__name__})"


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, without a byte order mark."""
    return path.read_bytes().decode("utf-8-sig")


def read_json(path: Path) -> Any:
    """The content of a JSON file; call it inside `reading`, which bounds its size and words its errors."""
    return json.loads(path.read_bytes())


def check_output(out: PathLike, inputs: Iterable[PathLike]) -> None:
    """Checks that what is read is not written over.

    Parameters
    ----------
    out : str or path of a file or folder to be written
    inputs : the files and folders that it is made from

    Raises
    ------
    ValueError
        `out` is one of them, be it through a link, or a file that is there already inside of one; names both.
    """
    out = Path(out)
    if not out.exists():
        return
    places = set() if out.is_dir() else {out.resolve(), out.parent.resolve() / out.name}
    for path in filter(Path.exists, map(Path, inputs)):
        if out.samefile(path):
            raise ValueError(f"{out}: is an input here ({path}); choose another name for the output")
        if any(path.resolve() in place.parents for place in places):
            raise ValueError(f"{out}: is there already, inside an input ({path}); choose another name for the output")


def is_own_file(path: PathLike) -> bool:
    """True where a file was written by this package, and not by its user or another program; False without one."""
    if not Path(path).is_file():
        return False
    with Path(path).open("rb") as stream:
        first = stream.read(_ENDS)
        first += stream.read(_TABLES) if first[4:8] == b"ftyp" else b""
        stream.seek(max(stream.seek(0, os.SEEK_END) - _ENDS, 0))
        return bool(_OWN.search(first) or _OWN.search(stream.read()))


def write_synced(path: Path, data: bytes) -> None:
    """Write a file, on disk when this returns: not even a power failure after a rename leaves half of it."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def atomic_write(path: PathLike) -> Iterator[Path]:
    """A hidden neighbour of `path` to write to; it takes the place of `path` at the end, or is removed after an error.

    A reader of `path` meanwhile gets the former content.

    Raises
    ------
    OSError
        It is a folder, or cannot be written; names `path`.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: is a folder; name a file in it")
    part = path.with_name(f".{path.name[-_LETTERS:]}.{os.getpid()}.{threading.get_native_id()}.tmp")
    with _naming(path, part):
        try:
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@contextmanager
def _naming(path: Path, part: Path) -> Iterator[None]:
    """OSErrors of the block name `path`, where they name nothing or the hidden `part` in its place."""
    try:
        yield
    except OSError as error:
        if error.errno is not None:
            name = str(error.filename or part).removeprefix("file:").replace(str(part), str(path))
            raise OSError(error.errno, os.strerror(error.errno), name) from error
        if type(error) is OSError:  # of numpy: so many values requested, so many written
            raise OSError(f"{path}: {error}") from error
        raise


@contextmanager
def atomic_folder(path: PathLike) -> Iterator[Path]:
    """A hidden neighbour of the folder `path` to fill; as `atomic_write`, what `path` held goes as a whole."""
    path = Path(path)
    part = Path(tempfile.mkdtemp(prefix=f"{UNFINISHED}{path.name[-_LETTERS:]}_", dir=path.parent))
    try:
        part.chmod(0o755)
        with _naming(path, part):
            yield part
            if path.exists():
                shutil.rmtree(path)
            part.replace(path)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def write_text(path: PathLike, text: str) -> None:
    """Write a file of text, UTF-8, whole or not at all; bytes of file names that are no UTF-8 as escape sequences.

    Ends of lines are written as they are in `text`, on every system, so that a file is the same everywhere.
    """
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace", newline="")


def write_json(path: PathLike, content: Any) -> None:
    """Write `plain(content)` as a JSON file, whole or not at all."""
    write_text(path, json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def plain(content: Any) -> Any:
    """`content` as JSON holds it: records as objects, tuples and arrays as lists, null for a number not finite.

    >>> import numpy as np
    >>> plain({"interval": (0.5, float("nan")), "hits": np.arange(3)})
    {'interval': [0.5, None], 'hits': [0, 1, 2]}
    """
    if is_dataclass(content) and not isinstance(content, type):
        content = {field.name: getattr(content, field.name) for field in fields(content)}
    if hasattr(content, "tolist"):  # an array of numpy, or a number
        content = content.tolist()
    if isinstance(content, Mapping):
        return {name: plain(one) for name, one in content.items()}
    if isinstance(content, list | tuple):
        return [plain(one) for one in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def is_close(a: Any, b: Any) -> bool:
    """True for two contents of JSON that are the same but for the last digits, in which processors differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(is_close(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(is_close, a, b))
    if float in (kinds := {type(a), type(b)}) and kinds <= {float, int}:
        return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)
    return bool(a == b)


def cache_folder() -> Path | None:
    """Folder of kept analyses: ``HARMOLAB_CACHE``, else the user's cache folder; None when the variable is "off"."""
    named = os.environ.get("HARMOLAB_CACHE")
    if named:
        return None if named == "off" else Path(named)
    from platformdirs import user_cache_path

    return user_cache_path("harmolab")


def cached_arrays(name: str) -> Arrays | None:
    """Arrays kept under a name; None when there are none, the file is damaged, or nothing is kept."""
    import numpy as np

    folder = cache_folder()
    if folder is None:
        return None
    try:
        # numpy itself leaves a damaged file open.
        with (folder / f"{name}.npz").open("rb") as file, np.load(file, allow_pickle=False) as content:
            return dict(content)
    # A zip file with a flipped bit may claim any compression or encryption, a lone array is no context manager.
    except (*_FAULTS, MemoryError):
        return None


@cache
def remove_leftovers(folder: Path) -> None:
    """Remove the files that killed processes left half written in the cache; once a process, and not its folders."""
    for file in folder.glob(".*.tmp"):
        with suppress(OSError):  # another process may have removed it first
            if _LEFTOVER.fullmatch(file.name) and time.time() - file.lstat().st_mtime > LEFTOVER_SECONDS:
                file.unlink()


def keep_arrays(name: str, arrays: Arrays) -> None:
    """Keep arrays under a name; a cache that cannot be written is no error."""
    import numpy as np

    folder = cache_folder()
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        remove_leftovers(folder)
        with atomic_write(folder / f"{name}.npz") as part, part.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
    except OSError:
        return


def cached_once(name: str, needed: Sequence[str], make: Callable[[], Arrays]) -> Arrays:
    """Arrays kept under a name, else those of `make`, which are kept: of several processes one makes them, others wait.

    Parameters
    ----------
    name : str, hexadecimal
    needed : names of arrays; a file without one of them is none
    make : function() -> arrays
    """
    with _alone(name):
        arrays = cached_arrays(name)
        if arrays is None or any(one not in arrays for one in needed):
            arrays = make()
            keep_arrays(name, arrays)
        return arrays


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """One process at a time for a name, or another that begins alike; all at once where there is no cache to write."""
    folder = cache_folder()
    with ExitStack() as stack:
        if folder is not None:
            with suppress(OSError):
                folder.mkdir(parents=True, exist_ok=True)
                stack.enter_context(FileLock(folder / f"{name[:2]}.lock"))
        yield


def import_librosa() -> Any:
    """librosa; its numba functions are kept for this process alone where neither of numba's folders can be written."""
    try:
        import_module("librosa.core.notation")
    except RuntimeError:  # of numba, which finds no folder
        import_module("numba").config.CACHE_DIR = folder = tempfile.mkdtemp(prefix="harmolab_numba_")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        import_module("librosa.core.notation")
    return import_module("librosa")


# Tables of text: a line of names, then a line for each row, with commas, semicolons or tabs between

MAX_ROWS = 1_000_000


def read_columns(path: Path, needed: Sequence[str]) -> dict[str, list[str]]:
    """The columns of a table by name; call it inside `harmolab.files.reading`.

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
    columns: dict[str, list[str]] = {}
    for number, line in enumerate(column_lines(path, needed)):
        if number >= MAX_ROWS:
            raise ValueError(f"has more lines than the {MAX_ROWS} allowed")
        for name, word in line.items():
            columns.setdefault(name, []).append(word)
    return columns or {name: [] for name in column_names(path, needed)}


def column_names(path: Path, needed: Sequence[str]) -> list[str]:
    """The names in the first line of a table; errors as `read_columns`."""
    first = next(_lines(path), None)
    if first is None:
        raise ValueError(f"has no line of names; the first line must be {','.join(needed)}")
    names = _words(first[1], _mark(first[1]))
    if missing := [name for name in needed if name not in names]:
        raise ValueError(f"has no column {' and no '.join(missing)} in its first line, {first[1][:80]!r}")
    if len(set(names)) < len(names):
        raise ValueError(f"has a name twice in its first line, {first[1][:80]!r}")
    return names


def column_lines(path: Path, needed: Sequence[str]) -> Iterator[dict[str, str]]:
    """The lines of a table as name -> word, one at a time, of which there may be any number; else as `read_columns`."""
    names, lines = column_names(path, needed), _lines(path)
    mark = _mark(next(lines)[1])
    for place, line in lines:
        words = _words(line, mark)
        if len(words) != len(names):
            raise ValueError(f"line {place} has {len(words)} values, the first line {len(names)} names")
        yield dict(zip(names, words, strict=True))


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """(place, line) of the lines of a text that are neither empty nor a comment."""
    with path.open(encoding="utf-8-sig") as stream:
        for place, line in enumerate(stream, 1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield place, line.rstrip("\n")


def _mark(line: str) -> str:
    """The mark between the words of a line."""
    return max(",;\t", key=line.count)


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
