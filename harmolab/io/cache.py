"""Where costly analyses are kept, and arrays in it that nobody has to trust."""

from __future__ import annotations

import os
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.io.aside import written_aside

__all__ = ["cache_folder", "cached_arrays", "keep_arrays"]

Arrays = dict[str, NDArray[Any]]


def cache_folder() -> Path | None:
    """Where analyses are kept: ``HARMOLAB_CACHE``, else the user's cache folder; None when the variable is "off"."""
    named = os.environ.get("HARMOLAB_CACHE")
    if named == "off":
        return None
    if named:
        return Path(named)
    from platformdirs import user_cache_path

    return user_cache_path("harmolab")


def cached_arrays(name: str) -> Arrays | None:
    """Arrays kept under a name; None when there are none, the file is damaged, or nothing is kept."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        # numpy leaves a damaged file open unless somebody else closes it.
        with (folder / f"{name}.npz").open("rb") as file, np.load(file, allow_pickle=False) as content:
            return dict(content)
    # A zip file with a flipped bit may claim any compression or encryption, a lone array is no context manager.
    except (OSError, KeyError, TypeError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return None


def keep_arrays(name: str, arrays: Arrays) -> None:
    """Keep arrays under a name; a cache that cannot be written is no error."""
    folder = cache_folder()
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with written_aside(folder / f"{name}.npz") as aside, aside.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
    except OSError:
        return
