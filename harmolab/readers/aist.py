"""AIST++ `keypoints3d` pickles to Motion, without ever running what a pickle asks for.

A pickle is a program. Before it runs, its instructions are read through: only those that build dictionaries, numbers,
strings and numpy arrays are allowed, and every length must fit the file. The numpy functions that it names are never
called either: small stand-ins note what was asked, and the arrays are made from checked bytes afterwards.
"""

import io
import math
import pickle
import pickletools
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harmolab.files import PathLike
from harmolab.readers.arrays import SAVING, checked_motion, in_metres
from harmolab.readers.keypoints import COCO_17
from harmolab.types import Motion

AIST_FPS = 60.0

# Building values, remembering them, and calling the stand-ins. Not: importing by extension code, instances, sets.
_ALLOWED = (
    *("PROTO", "FRAME", "STOP", "MARK", "POP", "POP_MARK", "MEMOIZE"),
    *("PUT", "BINPUT", "LONG_BINPUT", "GET", "BINGET", "LONG_BINGET"),
    *("NONE", "NEWTRUE", "NEWFALSE", "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "FLOAT", "BINFLOAT"),
    *("UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"),
    *("SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8"),
    *("EMPTY_DICT", "DICT", "SETITEM", "SETITEMS", "EMPTY_LIST", "LIST", "APPEND", "APPENDS"),
    *("EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2", "TUPLE3", "GLOBAL", "STACK_GLOBAL", "REDUCE", "BUILD"),
)
_MAX_INSTRUCTIONS = 100_000
_PUTS = frozenset({"PUT", "BINPUT", "LONG_BINPUT"})
# What makes a value that may be held in several places; a list of lists that are one list would fill the memory.
_SHARED = ("UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "SHORT_BINBYTES", "GLOBAL", "STACK_GLOBAL", "REDUCE", "BUILD")
_LONGEST = 1000  # letters of a text that may be
_AIST_NAME = re.compile(r"^g[A-Z]{2}_s[A-Z]{2}_c(All|\d\d)_d\d\d_m[A-Z]{2}\d_ch\d\d")


def is_aist_name(path: PathLike) -> bool:
    """True for a file that is named like a sequence of AIST++, such as ``gHO_sFM_cAll_d19_mHO1_ch02``."""
    return _AIST_NAME.match(Path(path).name) is not None


def aist_motion(content: Mapping[str, Any], fps: float, scale: float) -> Motion:
    """The 17 COCO joints of an AIST++ `keypoints3d` pickle's content; call it inside `harmolab.files.reading`.

    Takes `keypoints3d_optim` where there is one: the plain `keypoints3d` have gaps (NaN) in many sequences, and a gap
    is an error here. `scale` is metres in one unit of the file (AIST++ writes centimetres: 0.01).
    """
    name = "keypoints3d_optim" if isinstance(content.get("keypoints3d_optim"), np.ndarray) else "keypoints3d"
    points = content.get(name)
    if not isinstance(points, np.ndarray):
        others = f"of others {SAVING}, or SMPL's poses=(T, 72) and trans=(T, 3) in place of positions"
        raise ValueError(f"has no array keypoints3d but {sorted(map(str, content))[:8]}; {others}")
    if points.ndim != 3 or points.shape[1:] != (17, 3):
        raise ValueError(f"{name} must have shape (frames, 17, 3), got {points.shape}")
    return checked_motion(in_metres(points, scale), fps, COCO_17)


def read_array_pickle(data: bytes) -> dict[str, Any]:
    """The dictionary of arrays and plain values in a pickle; an array alone is called "positions".

    A dictionary in an array, as `numpy.save` writes it, is that dictionary.

    Raises
    ------
    ValueError, pickle.UnpicklingError
        Not a dictionary, damaged, or it asks for anything else than arrays of numbers.
    """
    with warnings.catch_warnings():
        # Python warns about damaged text before the instruction that holds it is refused.
        warnings.simplefilter("ignore")
        _check_instructions(data)
        content = _dictionary(_ArrayUnpickler(io.BytesIO(data)).load())
    if not isinstance(content, dict):
        raise ValueError(f"holds a {type(content).__name__}, not a dictionary of arrays")
    return {str(name): value.array() if isinstance(value, _Array) else value for name, value in content.items()}


def _dictionary(content: Any) -> Any:
    """The dictionary in an array of one object, or one with an array of numbers; anything else as it is."""
    if not isinstance(content, _Array):
        return content
    is_object = content.shape == () and isinstance(content.data, list) and len(content.data) == 1
    return content.data[0] if is_object else {"positions": content}


def _check_instructions(data: bytes) -> None:
    """ValueError at the first instruction that is not about arrays, or that would take memory out of proportion."""
    remembered: dict[Any, bool] = {}  # number of a value -> whether it may be held in several places
    is_shared = False  # whether the last value may
    for count, (opcode, argument, position) in enumerate(pickletools.genops(data), start=1):
        if count > _MAX_INSTRUCTIONS:
            raise ValueError(f"holds more than {_MAX_INSTRUCTIONS} instructions: not a few arrays")
        if opcode.name not in _ALLOWED:
            reason = f"holds the instruction {opcode.name} (byte {position})"
            raise ValueError(f"{reason}; only arrays of numbers are read, so load it where it was written and {SAVING}")
        # The unpickler makes room for the number told here, however large.
        if opcode.name in _PUTS and not 0 <= int(argument or 0) <= count:
            raise ValueError(f"is damaged: it numbers value {argument} after {count} instructions")
        if opcode.name in _PUTS or opcode.name == "MEMOIZE":
            remembered[len(remembered) if argument is None else argument] = is_shared
            continue
        is_get = opcode.name in ("GET", "BINGET", "LONG_BINGET")
        if is_get and not remembered.get(argument, True):
            raise ValueError(f"holds one list or long text in several places (byte {position}); only arrays are read")
        is_shared = is_get or (opcode.name in _SHARED and len(str(argument)) <= _LONGEST)


class _Dtype:
    """A dtype as a pickle describes it."""

    __slots__ = ("code", "order")

    def __init__(self, code: Any, *_: Any) -> None:
        self.code, self.order = code, "|"

    def __setstate__(self, state: Any) -> None:
        self.order = state[1]

    def dtype(self) -> np.dtype[Any]:
        """The dtype, if it is one of plain numbers."""
        if not re.fullmatch(r"[fiu][1248]|b1", str(self.code)) or self.order not in ("<", ">", "=", "|"):
            raise ValueError(f"holds values of type {self.code!r}; only plain numbers are read, never Python objects")
        return np.dtype(f"{self.order}{self.code}")


class _Array:
    """An array as a pickle describes it: filled by `__setstate__`, or at once (pickle protocol 5)."""

    __slots__ = ("data", "dtype", "fortran", "shape")

    def __init__(self, shape: Any = (), dtype: Any = None, fortran: Any = False, data: Any = b"") -> None:
        self.shape, self.dtype, self.fortran, self.data = shape, dtype, fortran, data

    def __setstate__(self, state: Any) -> None:
        _, self.shape, self.dtype, self.fortran, self.data = state

    def array(self) -> NDArray[Any]:
        """The array; its bytes must be there, all of them and no more."""
        if not isinstance(self.dtype, _Dtype) or not isinstance(self.data, bytes | bytearray):
            raise ValueError("holds an array whose values are Python objects; they are never read")
        shape, dtype = tuple(int(length) for length in self.shape), self.dtype.dtype()
        if any(length < 0 for length in shape) or math.prod(shape) * dtype.itemsize != len(self.data):
            raise ValueError(f"promises an array of shape {shape} and type {dtype}, with {len(self.data)} bytes")
        return np.frombuffer(self.data, dtype).reshape(shape, order="F" if self.fortran else "C")


class _Type:
    """Stands for the class numpy.ndarray, which a pickle only hands on."""


class _ArrayUnpickler(pickle.Unpickler):
    """An unpickler that knows numpy arrays, under the module names of numpy 1 and 2, and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """The stand-in for a name; every other name is refused."""
        stand_ins = {
            ("numpy", "ndarray"): _Type,
            ("numpy", "dtype"): _Dtype,
            ("_codecs", "encode"): lambda text, _: str.encode(text, "latin1"),  # bytes of protocol 2
            ("multiarray", "_reconstruct"): lambda *_: _Array(),
            ("multiarray", "scalar"): lambda dtype, data=b"": _Array((), dtype, False, data),
            ("numeric", "_frombuffer"): lambda data, dtype, shape, order: _Array(shape, dtype, order == "F", data),
        }
        module = module.removeprefix("numpy.core.").removeprefix("numpy._core.")
        if (module, name) not in stand_ins:
            reason = f"it asks for {module}.{name}, and only arrays of numbers are read"
            raise pickle.UnpicklingError(f"{reason}, so load it where it was written and {SAVING}")
        return stand_ins[module, name]
