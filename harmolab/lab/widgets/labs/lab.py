"""Settings of a lab: the fields of `HarmonyParams` that its controls stand for, and the line to copy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.params import BarPattern, HarmonyParams

MODES = MappingProxyType(
    {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(), "valleys": HarmonyParams.valleys()}
)

# Fields of HarmonyParams by the names of their controls, if these differ.
FIELDS = MappingProxyType({"lambda1": "audio_threshold", "lambda2": "visual_threshold", "delay": "reaction_delay"})


def params_line(params: HarmonyParams) -> str:
    """Python text that makes these settings: a preset by its name, else the fields in which they differ from the paper.

    It needs `HarmonyParams`, and `BarPattern` where the pattern is not the usual one.

    >>> params_line(HarmonyParams(beta=1.0))
    'HarmonyParams(beta=1.0)'
    >>> params_line(HarmonyParams.valleys())
    'HarmonyParams.valleys()'
    """
    for name, preset in MODES.items():
        if params == preset:
            return f"HarmonyParams.{name}()"
    paper = MODES["paper"]
    return _call(params, [name for name, value in vars(params).items() if value != getattr(paper, name)])


def field_texts(params: HarmonyParams) -> dict[str, str]:
    """Every field of the settings as Python text, by name."""
    return {name: _text(value) for name, value in vars(params).items()}


def _call(record: HarmonyParams | BarPattern, names: Sequence[str]) -> str:
    """The call that makes a record with these fields, as Python text."""
    return f"{type(record).__name__}({', '.join(f'{name}={_text(getattr(record, name))}' for name in names)})"


def _text(value: Any) -> str:
    """A setting as Python text; numpy's numbers as plain ones."""
    if isinstance(value, BarPattern):
        return _call(value, [field.name for field in fields(value)])
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))},)"
    return repr(value.item() if isinstance(value, np.generic) else value)


def setting(params: HarmonyParams, name: str) -> Any:
    """The value at which a control stands for its field of `params`; λ2 = 0 keeps every visual beat."""
    value = getattr(params, FIELDS.get(name, name))
    return value or 0.0 if name == "lambda2" else value


def with_settings(params: HarmonyParams, **values: Any) -> HarmonyParams:
    """`params` with the fields that controls of these names and values stand for; others by their own names."""
    if "lambda2" in values:
        values["lambda2"] = values["lambda2"] or None
    return replace(params, **{FIELDS.get(name, name): value for name, value in values.items()})
