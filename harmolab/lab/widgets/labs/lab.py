"""What every lab is: an Explorer whose controls stand for a `HarmonyParams`, written out under the picture."""

from __future__ import annotations

import html
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.figure import Figure

from harmolab.lab.widgets.explorer import Explorer
from harmolab.params import BarPattern, HarmonyParams

MODES = MappingProxyType(
    {"paper": HarmonyParams.paper(), "recommended": HarmonyParams.recommended(), "valleys": HarmonyParams.valleys()}
)
LOOK: Mapping[str, Any] = MappingProxyType(
    {"style": {"description_width": "8.5em"}, "layout": {"width": "23em"}}  # three columns of controls on a desktop
)


class Lab(Explorer):
    """An Explorer that tells the settings its controls stand for, as a line to copy (one click selects it).

    Parameters
    ----------
    draw, **controls
        As for `Explorer`.
    params : callable
        ``params(**values)`` returns the HarmonyParams that the controls' values stand for.
    """

    def __init__(self, draw: Callable[..., Figure], params: Callable[..., HarmonyParams], /, **controls: Any) -> None:
        super().__init__(draw, **controls)
        self._params = params
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
        if not self.error:  # otherwise the picture stays, and so does what is written under it
            self._line.value = self._settings()

    def _settings(self) -> str:
        return f'<code style="user-select: all">{html.escape(self.line, quote=False)}</code>'

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return {**super()._repr_mimebundle_(**kwargs), "text/plain": self.line}


class ModeLab(Lab):
    """A Lab whose other controls follow the one called ``mode``, with one new picture for all of them.

    Parameters
    ----------
    draw, params, **controls
        As for `Lab`.
    presets : callable
        ``presets(mode)`` returns what a mode sets the other controls to, by name.
    idle : mode -> names of controls that mean nothing in it, and are greyed out
    """

    _following = False

    def __init__(
        self,
        draw: Callable[..., Figure],
        params: Callable[..., HarmonyParams],
        presets: Callable[[str], Mapping[str, Any]],
        idle: Mapping[str, Collection[str]] = MappingProxyType({}),
        /,
        **controls: Any,
    ) -> None:
        super().__init__(draw, params, **controls)
        self._presets, self._idle = presets, idle
        self._grey_out(self.values["mode"])

    def _grey_out(self, mode: str) -> None:
        for name, control in self._controls.items():
            control.disabled = name in self._idle.get(mode, ())

    def _redraw(self, change: Any = None) -> None:
        if self._following:
            return
        if change is not None and change["owner"] is self._controls["mode"]:
            self._following = True
            try:
                for name, value in self._presets(change["new"]).items():
                    self._controls[name].value = value
                self._grey_out(change["new"])
            finally:
                self._following = False
        super()._redraw(change)


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
    changed = [field.name for field in fields(params) if getattr(params, field.name) != getattr(paper, field.name)]
    return f"HarmonyParams({', '.join(f'{name}={_text(getattr(params, name))}' for name in changed)})"


def _text(value: Any) -> str:
    """A setting as Python text; numpy's numbers as plain ones."""
    if isinstance(value, BarPattern):
        return (
            f"BarPattern({', '.join(f'{field.name}={_text(getattr(value, field.name))}' for field in fields(value))})"
        )
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))},)"
    return repr(value.item() if isinstance(value, np.generic) else value)


def slider(label: str, low: float, high: float, step: float, value: float) -> Any:
    """A slider; of whole numbers where all four are."""
    whole = all(isinstance(number, int) for number in (low, high, step, value))
    kind = widgets.IntSlider if whole else widgets.FloatSlider
    number = "d" if whole else ".2f"
    return kind(value=value, min=low, max=high, step=step, description=label, readout_format=number, **LOOK)


def menu(label: str, options: Any, value: Any) -> Any:
    """A menu of choices: a list, or (name, value) pairs."""
    return widgets.Dropdown(options=options, value=value, description=label, **LOOK)


def score_sliders(mode: str) -> dict[str, Any]:
    """The sliders that every lab of a score has, at a mode's settings."""
    start = score_presets(mode)
    return {
        "lambda1": slider("λ1 (music)", 0.0, 8.0, 0.1, start["lambda1"]),
        "lambda2": slider("λ2 (dance)", 0.0, 3.0, 0.1, start["lambda2"]),
        "delay": slider("T_delay (s)", 0.0, 0.5, 0.01, start["delay"]),
        "beta": slider("β", 0.25, 4.0, 0.25, start["beta"]),
        "lag": slider("lag (s)", -0.4, 0.4, 0.02, start["lag"]),
    }


def score_presets(mode: str) -> dict[str, Any]:
    """What a mode sets those sliders to."""
    params = MODES[mode]
    return {
        "lambda1": params.audio_threshold,
        "lambda2": params.visual_threshold or 0.0,
        "delay": params.reaction_delay,
        "beta": params.beta,
        "lag": params.lag,
    }


def score_params(
    mode: str, *, lambda1: float, lambda2: float, delay: float, beta: float, lag: float, **others: Any
) -> HarmonyParams:
    """The settings that those sliders stand for, and `others` by their own names; λ2 = 0 keeps every visual beat."""
    return replace(
        MODES[mode],
        audio_threshold=lambda1,
        visual_threshold=lambda2 or None,
        reaction_delay=delay,
        beta=beta,
        lag=lag,
        **others,
    )


def start_at(
    controls: dict[str, Any],
    values: Mapping[str, Any],
    presets: Callable[[str], Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """The controls, some of them set to other values than they were made with.

    Parameters
    ----------
    controls : name -> widget
    values : name -> value
    presets : callable, optional
        What a mode sets the other controls to, unless `values` says otherwise.

    Raises
    ------
    ValueError
        If a value is given for a control that is not there.
    """
    if unknown := set(values) - set(controls):
        raise ValueError(f"no control {', '.join(sorted(unknown))}; there are {', '.join(controls)}")
    if presets is not None and "mode" in values:
        controls["mode"].value = values["mode"]  # refuses an unknown one
        values = {**presets(values["mode"]), **values}
    for name, value in values.items():
        controls[name].value = value
    return controls
