"""Records of arrays as cells of a table, and back to the last bit: one text, and one list of all numbers in arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import pairwise
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from harmolab.types import FloatArray

Record = TypeVar("Record")
Arrays = Sequence[NDArray[Any]]


def packed(record: object) -> dict[str, str | FloatArray]:
    """The cells "record", JSON in which an array is its number, and "numbers", the arrays one after another.

    Parameters
    ----------
    record : dataclass
        Its fields are text, numbers, None, arrays, other such dataclasses, and tuples, frozen sets of text and
        mappings from text of these. An array that several fields hold is kept once.
    """
    places: dict[int, tuple[int, NDArray[Any]]] = {}
    content = _content(record, places)
    arrays = [array for _, array in places.values()]
    about = [(array.dtype.str, array.shape) for array in arrays]
    numbers = np.concatenate([np.zeros(0), *map(_numbers, arrays)])
    return {"record": json.dumps({"content": content, "arrays": about}), "numbers": numbers}


def unpacked(kind: type[Record], cells: Mapping[str, Any]) -> Record:
    """The record of this class whose cells `packed` returned.

    Raises
    ------
    ValueError, LookupError, TypeError
        The cells are those of another class, or damaged.
    """
    text = json.loads(cells["record"])
    about = [(np.dtype(name), tuple(shape)) for name, shape in text["arrays"]]
    edges = np.cumsum([0, *(int(np.prod(shape)) * (1 + (dtype.kind == "c")) for dtype, shape in about)])
    numbers = np.asarray(cells["numbers"], np.float64)
    if numbers.size != edges[-1]:
        raise ValueError(f"holds {numbers.size} of {edges[-1]} numbers")
    parts = [numbers[start:end] for start, end in pairwise(edges.tolist())]
    arrays = [_array(part, *one) for part, one in zip(parts, about, strict=True)]
    record: Record = _value(kind, text["content"], arrays)
    return record


def _content(value: Any, places: dict[int, tuple[int, NDArray[Any]]]) -> Any:
    """A value as JSON holds it, with the place of an array in its stead: `places` has place and array by the id."""
    if isinstance(value, np.ndarray):
        return places.setdefault(id(value), (len(places), value))[0]
    if is_dataclass(value):
        return {field.name: _content(getattr(value, field.name), places) for field in fields(value)}
    if isinstance(value, Mapping):
        return {name: _content(one, places) for name, one in value.items()}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple | list):
        return [_content(one, places) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _numbers(array: NDArray[Any]) -> FloatArray:
    """All numbers of an array in C order; a complex one as its two parts. Integers are exact up to 2^53."""
    flat = array.ravel()
    return flat.view(np.float64) if flat.dtype.kind == "c" else flat.astype(np.float64)


def _array(numbers: FloatArray, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return (numbers.view(dtype) if dtype.kind == "c" else numbers.astype(dtype)).reshape(shape)


def _value(kind: Any, content: Any, arrays: Arrays) -> Any:
    """The value of this type, as the fields of records name types."""
    kinds, origin = get_args(kind), get_origin(kind)
    origin = get_origin(getattr(origin, "__value__", None)) or origin  # since numpy 2.5 NDArray is a named type
    if content is None or kind is Any:
        return content
    if NoneType in kinds:
        return _value(next(one for one in kinds if one is not NoneType), content, arrays)
    if np.ndarray in (kind, origin):
        return arrays[content]
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: _value(hints[name], one, arrays) for name, one in content.items()})  # type: ignore[operator]
    if origin is tuple:
        each = kinds[:1] * len(content) if kinds[-1] is Ellipsis else kinds
        return tuple(_value(one, part, arrays) for one, part in zip(each, content, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {name: _value(kinds[1], one, arrays) for name, one in content.items()}
    return frozenset(content) if origin is frozenset else content
