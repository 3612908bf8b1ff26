"""State of librosa's tracker on this machine: compiled or not, as numba's cache tells."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path


def is_tracker_compiled() -> bool:
    """True where numba's cache holds librosa's tracker for this Python. librosa is not imported, which would compile.

    The cache lies in ``NUMBA_CACHE_DIR`` where that is set, else beside librosa's files, else with the user's caches.
    """
    name = f"*beat*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    return any(next(folder.rglob(name), None) is not None for folder in _numba_caches())


def _numba_caches() -> list[Path]:
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(named)]
    from platformdirs import user_cache_path

    spec = find_spec("librosa")
    beside = [] if spec is None else [Path(folder) for folder in spec.submodule_search_locations or ()]
    return [*beside, user_cache_path("numba", appauthor=False)]
