"""A lab: an Explorer whose controls stand for a `HarmonyParams`, written out under the picture; shared controls."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.figure import Figure

from harmolab.lab.widgets.explorer import Explorer, control
from harmolab.params import CHOICES, BarPattern, HarmonyParams

MODES = MappingProxyType(
    {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(), "valleys": HarmonyParams.valleys()}
)
LOOK: Mapping[str, Any] = MappingProxyType(
    {"style": {"description_width": "8.5em"}, "layout": {"width": "23em"}}  # three columns of controls on a desktop
)

# Fields of HarmonyParams by the names of their controls, if these differ.
FIELDS = MappingProxyType({"lambda1": "audio_threshold", "lambda2": "visual_threshold", "delay": "reaction_delay"})


class Lab(Explorer):
    """An Explorer that writes the settings its controls stand for as a line to copy (one click selects it).

    Parameters
    ----------
    draw : callable
        As for `Explorer`.
    params : callable
        ``params(**values)`` returns the HarmonyParams that the controls' values stand for.
    controls : name -> widget
    values : name -> value at which a control starts instead

    Raises
    ------
    ValueError
        If a value is given for a control that does not exist.
    """

    def __init__(
        self,
        draw: Callable[..., Figure],
        params: Callable[..., HarmonyParams],
        controls: Mapping[str, Any],
        values: Mapping[str, Any],
    ) -> None:
        self._params = params
        if unknown := set(values) - set(controls):
            raise ValueError(f"no control {', '.join(sorted(unknown))}; there are {', '.join(controls)}")
        for name, value in values.items():
            controls[name].value = value
        super().__init__(draw, **controls)
        self._line = widgets.HTML(value=self._settings())
        self.children: tuple[Any, ...] = (*self.children, self._line)

    @property
    def params(self) -> HarmonyParams:
        """The settings that the controls stand for now."""
        return self._params(**self.values)

    @property
    def line(self) -> str:
        """The settings as Python text."""
        return params_line(self.params)

    def _show(self) -> None:
        super()._show()
        if not self.error:  # otherwise the picture stays, and so does the line under it
            self._line.value = self._settings()

    def _settings(self) -> str:
        return f'<code style="user-select: all">{html.escape(self.line, quote=False)}</code>'

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return {**super()._repr_mimebundle_(**kwargs), "text/plain": self.line}


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


def slider(label: str, low: float, high: float, step: float, value: float) -> Any:
    """A slider; of whole numbers where all four are."""
    return control(label, (low, high, step, value), {"description": label, **LOOK})


def menu(label: str, options: Any, value: Any) -> Any:
    """A menu of choices: a list, or (name, value) pairs."""
    return widgets.Dropdown(options=options, value=value, description=label, **LOOK)


# Makers of the controls that stand for a field of HarmonyParams: value -> widget.
RATES = (("its own", None), ("60", 60.0), ("30", 30.0), ("25", 25.0), ("15", 15.0), ("10", 10.0))
CONTROLS: Mapping[str, Callable[[Any], Any]] = MappingProxyType(
    {
        "lambda1": partial(slider, "λ1 (music)", 0.0, 8.0, 0.1),
        "smoothing": partial(slider, "speed σ (s)", 0.0, 0.3, 0.01),
        "position_smoothing": partial(slider, "position σ (s)", 0.0, 0.3, 0.01),
        "fps": partial(menu, "frames a second", RATES),
        "subframe": partial(menu, "beats", (("on frames", False), ("between frames", True))),
        **{name: partial(menu, name, CHOICES[name]) for name in ("detector", "plateau")},
    }
)


def setting_controls(params: HarmonyParams, *names: str) -> dict[str, Any]:
    """The named ones of `CONTROLS`, at the values of `params`."""
    return {name: CONTROLS[name](setting(params, name)) for name in names}


def setting(params: HarmonyParams, name: str) -> Any:
    """The value at which a control stands for its field of `params`; λ2 = 0 keeps every visual beat."""
    value = getattr(params, FIELDS.get(name, name))
    return value or 0.0 if name == "lambda2" else value


def with_settings(params: HarmonyParams, **values: Any) -> HarmonyParams:
    """`params` with the fields that controls of these names and values stand for; others by their own names."""
    if "lambda2" in values:
        values["lambda2"] = values["lambda2"] or None
    return replace(params, **{FIELDS.get(name, name): value for name, value in values.items()})
