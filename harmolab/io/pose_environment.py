"""The environment of pose estimation: MediaPipe and a numpy of its own, in a folder of the cache, made once.

MediaPipe's wheel holds its models, and asks for numpy 1, which does not fit into one process with ours. So its packages
go into a folder that another process of the same Python reads (`harmolab.io.pose_child`). Afterwards nothing needs a
network. Nothing is fetched unasked: `make_pose_environment` is called by `harmolab pose` alone, after a yes.

``HARMOLAB_POSE=off`` turns pose estimation off, whether the environment is there or not.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from filelock import FileLock

from harmolab.io.files import UNFINISHED, cache_folder
from harmolab.io.pose_process import check_child

MEDIAPIPE = "0.10.21"  # the last whose wheel holds the models that it runs without a network
# With what of its needs is used: not OpenCV, matplotlib, JAX and sound, half a gigabyte for drawing and training.
PACKAGES = (f"mediapipe=={MEDIAPIPE}", "numpy>=1.26,<2", "protobuf>=4.25.3,<5", "absl-py", "attrs", "flatbuffers")
OLDEST, NEWEST = (3, 9), (3, 12)  # Python versions that there are wheels for
DOWNLOADED, ON_DISK = 55, 155  # megabytes, measured on Linux
PIP = (sys.executable, "-P", "-m", "pip")
SWITCH = "HARMOLAB_POSE"
NAME = "pose_mediapipe"


def pose_folder() -> Path:
    """The folder of the environment for this Python, be it there or not.

    Raises
    ------
    ValueError
        Nothing is kept on this machine (``HARMOLAB_CACHE=off``).
    """
    cache = cache_folder()
    if cache is None:
        raise ValueError("HARMOLAB_CACHE is off, so there is no place for MediaPipe; set it to a folder")
    return cache / f"{NAME}_{MEDIAPIPE}_{sys.implementation.cache_tag}"


def pose_environment() -> Path | None:
    """The folder of the environment; None where it is not there, or turned off."""
    if is_off() or cache_folder() is None:
        return None
    folder = pose_folder()
    return folder if folder.is_dir() else None


def is_off() -> bool:
    """True where ``HARMOLAB_POSE`` is "off"."""
    return os.environ.get(SWITCH) == "off"


def hindrance() -> str:
    """The reason why the environment cannot be made here, without a full stop; "" without one."""
    if is_off():
        return f"{SWITCH} is off"
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        versions = " to ".join(".".join(map(str, version)) for version in (OLDEST, NEWEST))
        return (
            f"MediaPipe {MEDIAPIPE} runs in Python {versions}, and this is {sys.version_info[0]}.{sys.version_info[1]}"
        )
    if cache_folder() is None:
        return "HARMOLAB_CACHE is off, so there is no place for MediaPipe"
    return ""


def make_pose_environment(*, pip: Sequence[str] = PIP) -> Path:
    """Fetch MediaPipe into its folder, whole or not at all; the folder. One that is there is left as it is.

    Processes that ask at the same time wait for the first. What a killed one left is removed by the next.

    Parameters
    ----------
    pip : the command that installs

    Raises
    ------
    ValueError
        Why it cannot be made here; or pip's last words, or those of MediaPipe, where it does not run.
    OSError
        The folder cannot be written.
    """
    if reason := hindrance():
        raise ValueError(f"{reason}; the movement of a video is read from the flow of its picture instead")
    if find_spec("pip") is None and pip is PIP:
        raise ValueError(f"pip is not there to fetch MediaPipe with; {sys.executable} -m ensurepip brings it")
    folder = pose_folder()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder.parent / f".{folder.name}.lock"):
        for leftover in folder.parent.glob(f"{UNFINISHED}{folder.name}_*"):
            shutil.rmtree(leftover, ignore_errors=True)
        if not folder.is_dir():
            _make(folder, pip)
    return folder


def _make(folder: Path, pip: Sequence[str]) -> None:
    """Fill a hidden neighbour of the folder, try it, and rename it."""
    part = Path(tempfile.mkdtemp(prefix=f"{UNFINISHED}{folder.name}_", dir=folder.parent))
    try:
        part.chmod(0o755)
        _install(part, pip)
        check_child(part)
        part.rename(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _install(part: Path, pip: Sequence[str]) -> None:
    """Put the packages into a folder; ValueError with pip's last words where it fails."""
    options = ("--no-deps", "--only-binary", ":all:", "--quiet", "--no-input", "--disable-pip-version-check")
    command = [*pip, "install", *options, "--target", str(part), *PACKAGES]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode:
        lines = [line for line in done.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        raise ValueError(
            f"MediaPipe could not be fetched; is there a network? pip says: {errors[-1][:300] if errors else 'nothing'}"
        )


def remove_pose_environment() -> bool:
    """Remove the environment; False where there was none."""
    folder = pose_folder()
    with suppress(FileNotFoundError):
        shutil.rmtree(folder)
        return True
    return False
