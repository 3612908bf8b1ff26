"""Arrays from files that are not trusted: sizes are compared before memory is taken."""

import io
import math
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import ArrayLike, NDArray

from harmolab.body.skeletons import Skeleton
from harmolab.files import MAX_BYTES
from harmolab.types import BoolArray, FloatArray, Motion

MIN_FPS, MAX_FPS = 1.0, 1000.0
MAX_JOINTS = 10_000
SAVING = "save joints (T, J, 3) in metres, y up: numpy.savez('dance.npz', positions=joints, fps=30)"
# Movement hardly compresses. An archive that unfolds to more than this, and a hundredfold, is a trap.
BOMB_BYTES, BOMB_RATIO = 64 * 2**20, 100


def read_npy(stream: BinaryIO, size: int, *, kinds: str = "fiu") -> NDArray[Any]:
    """The array in an open `.npy` stream of `size` bytes.

    The header is compared with the size first, so that a header that lies takes no memory. Python objects are
    never read.

    Parameters
    ----------
    stream : binary stream at the start of the array
    size : int, bytes in the stream
    kinds : str
        The dtype kinds allowed (`numpy.dtype.kind`).

    Raises
    ------
    ValueError
        It is no `.npy`, has another dtype, or holds fewer bytes than its header promises.
    """
    shape, fortran, dtype = _npy_header(stream)
    if dtype.kind not in kinds or not 0 < dtype.itemsize <= (8 if dtype.kind in "fiub" else 4096):
        raise ValueError(f"holds values of type {dtype}; only plain numbers are read, never Python objects")
    expected, present = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if expected > present or any(length < 0 for length in shape):
        raise ValueError(f"promises an array of shape {shape} ({expected} bytes), but {present} bytes are there")
    values = np.frombuffer(stream.read(expected), dtype)
    # Turning a number that is no character into text would bring Python itself to fail.
    if dtype.kind == "U" and values.view(f"{dtype.byteorder}u4").max(initial=0) > 0x10FFFF:
        raise ValueError("holds text that is none: its characters are damaged")
    return values.reshape(shape, order="F" if fortran else "C")


def npy_pickle(stream: BinaryIO) -> bytes | None:
    """The pickle that an array of Python objects is written as; None, at the start again, for an array of numbers."""
    start = stream.tell()
    _, _, dtype = _npy_header(stream)
    if dtype != np.dtype(object):
        stream.seek(start)
        return None
    return stream.read()


def npz_names(path: Path) -> frozenset[str]:
    """The names of the arrays of an `.npz`."""
    with zipfile.ZipFile(path) as archive:
        return frozenset(name.removesuffix(".npy") for name in archive.namelist())


def read_npz(path: Path, members: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` that have these names; call it inside `harmolab.files.reading`.

    Sizes are summed before anything is unpacked; other arrays in the archive are not looked at.

    Parameters
    ----------
    path : Path
    members : name -> the dtype kinds allowed, as in `read_npy`

    Raises
    ------
    ValueError
        It would unpack to too much, is packed in an unusual way, or an array is not what `read_npy` reads.
    """
    with zipfile.ZipFile(path) as archive:
        infos = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        ours = {name: info for name, info in infos.items() if name in members}
        unpacked = sum(info.file_size for info in ours.values())
        if unpacked > MAX_BYTES or unpacked > max(BOMB_BYTES, BOMB_RATIO * path.stat().st_size):
            raise ValueError(f"would unpack to {unpacked} bytes from {path.stat().st_size}; refused")
        return {name: _member(archive, info, name, members[name]) for name, info in ours.items()}


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, kinds: str) -> NDArray[Any]:
    """One array of an `.npz`."""
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"array {name!r} is packed in a way that is not read; use numpy.savez")
    data = archive.read(info)
    try:
        return read_npy(io.BytesIO(data), len(data), kinds=kinds)
    except ValueError as error:
        raise ValueError(f"array {name!r}: {error}") from None


def _npy_header(stream: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, Fortran order and dtype in the header of an `.npy` stream."""
    readers = {(1, 0): npy_format.read_array_header_1_0, (2, 0): npy_format.read_array_header_2_0}
    with warnings.catch_warnings():
        # Damaged headers make Python's parser and numpy warn about their syntax before they fail.
        warnings.simplefilter("ignore")
        version = npy_format.read_magic(stream)
        if version not in readers:
            raise ValueError(f"has .npy version {version}; save it again with numpy.save")
        return readers[version](stream)


def number_array(values: Any, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """A float array from nested lists (of JSON), of that `shape`; None stands for any length."""
    expected = "(" + ", ".join("any" if length is None else str(length) for length in shape) + ")"
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers of shape {expected}: {error}") from None
    lengths = zip(shape, array.shape, strict=False)
    if array.ndim != len(shape) or any(length not in (None, size) for length, size in lengths):
        raise ValueError(f"{name} must have shape {expected}, got {array.shape}")
    return array


def one_number(content: Mapping[str, Any], name: str) -> float:
    """The one number of an array, by its name."""
    values = np.asarray(content[name])
    if values.size != 1 or values.dtype.kind not in "fiu":
        raise ValueError(f"{name} must be one number, got shape {values.shape}")
    return float(values.item())


def in_metres(values: NDArray[Any], scale: float) -> FloatArray:
    """`values` times `scale` (metres in one unit). What is out of all bounds becomes infinite, to be refused later."""
    if not (math.isfinite(scale) and scale > 0):
        raise ValueError(f"scale must be positive (metres in one unit), got {scale}")
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(np.float64) * scale


def checked_fps(fps: Any) -> float:
    """`fps` as a float; ValueError outside 1 to 1000 frames a second."""
    rate = float(fps)
    if not MIN_FPS <= rate <= MAX_FPS:
        hint = "; was this the time of one frame?" if 0 < rate < MIN_FPS else ""
        raise ValueError(f"fps must lie between {MIN_FPS:g} and {MAX_FPS:g}, got {rate:g}{hint}")
    return rate


def check_joints(count: int) -> None:
    """ValueError for more joints than any body or cloth of markers has."""
    if count > MAX_JOINTS:
        raise ValueError(f"has {count} joints, more than the {MAX_JOINTS} allowed; were these frames?")


def checked_motion(
    positions: ArrayLike, fps: Any, skeleton: Skeleton | None = None, valid: BoolArray | None = None
) -> Motion:
    """A Motion from an array of a file; NaN and infinity are named by frame and joint.

    Frames without a body (`has_body`) are filler.

    Parameters
    ----------
    positions : (T, J, 3) or (T, J, 2) array
    fps : number, frames per second
    skeleton : Skeleton or None (joints without names)
    valid : (T,) bool array or None (all True)
    """
    array = np.asarray(positions)
    if array.ndim != 3 or array.shape[2] not in (2, 3) or array.shape[1] == 0:
        raise ValueError(f"positions must be (frames, joints, 3) or (frames, joints, 2), got shape {array.shape}")
    check_joints(array.shape[1])
    skeleton = Skeleton.unnamed(array.shape[1]) if skeleton is None else skeleton
    check_finite(array, skeleton)
    motion = Motion(array, checked_fps(fps), skeleton, valid)  # type: ignore[arg-type]  # None: all frames
    full = has_body(motion.positions)
    return motion if full.all() else replace(motion, valid=motion.valid & full)


def check_finite(positions: NDArray[Any], skeleton: Skeleton) -> None:
    """ValueError for NaN or infinity in positions (T, J, D), by the first frame and joint and the number of values."""
    if len(bad := np.argwhere(~np.isfinite(positions))):
        frame, joint = bad[0][:2]
        name = skeleton.joints[joint] if joint < len(skeleton.joints) else "?"
        raise ValueError(
            f"NaN or infinity at frame {frame}, joint {joint} ({name}), {len(bad)} values in all; interpolate or cut it"
        )


def has_body(positions: FloatArray) -> BoolArray:
    """(T,) False for frames in which all joints lie at one point, as lost ones do that are 0; True where all are so."""
    full = (positions != positions[:, :1]).any(axis=(1, 2))
    return full if full.any() else ~full
