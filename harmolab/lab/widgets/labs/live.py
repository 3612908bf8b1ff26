"""A lab that a browser draws by itself: in JupyterLab, in the report, or as a page of its own, without Python.

Python reads the evidence (beats, strengths, curves) once; the script beside this module scores and draws it at every
move of a slider. In JupyterLab, Python learns of the settings afterwards, so that they can be read and copied.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import anywidget
import traitlets

from harmolab.io.files import PathLike, plain, write_text
from harmolab.lab.report.templates import framed, rendered
from harmolab.lab.widgets.labs.front_end import has_front_end
from harmolab.lab.widgets.labs.lab import FIELDS, MODES, field_texts, params_line, setting, with_settings
from harmolab.params import HarmonyParams

FOLDER = Path(__file__).with_name("live")
PARTS = (
    "arrays", "hits", "verdicts", "corpora", "sound", "chart", "clip_pictures", "corpus_picture", "detector", "meter",
    "panel", "lab",
)  # fmt: skip
SCRIPT = "\n".join((FOLDER / f"{name}.js").read_text("utf-8") for name in PARTS)
STYLE = (FOLDER / "lab.css").read_text("utf-8")
HEIGHT = 1100  # pixels of the frame, until its page sets it


@dataclass(frozen=True)
class Slider:
    """A slider: its plain name, the symbol beside it, its range, and the unit of its value."""

    label: str
    symbol: str
    low: float
    high: float
    step: float
    unit: str = ""

    def checked(self, name: str, value: Any) -> float:
        """The value as a float; ValueError outside the range."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
            raise ValueError(f"{name} must lie between {self.low:g} and {self.high:g}, got {value!r}")
        return float(value)


@dataclass(frozen=True)
class Menu:
    """A menu: its plain name, the symbol beside it, and value -> words of each choice."""

    label: str
    symbol: str
    options: Mapping[Any, str]

    def checked(self, name: str, value: Any) -> Any:
        """The choice, as `options` has it (a browser writes 15.0 as 15); ValueError if the value is none."""
        for option in self.options:
            if option == value:
                return option
        raise ValueError(f"{name} must be one of {', '.join(map(str, self.options))}; got {value!r}")

    def to_browser(self) -> list[tuple[Any, str, str]]:
        """Value, words and Python text of each choice."""
        return [(value, words, repr(value)) for value, words in self.options.items()]


@dataclass(frozen=True)
class Preset:
    """A button that sets controls: its words, the values, and the sentence that says what to look at."""

    label: str
    values: Mapping[str, Any]
    note: str


@dataclass(frozen=True, eq=False)
class LabContent:
    """All that the browser needs for one lab, and the functions by which Python answers for it.

    Parameters
    ----------
    kind : "scoring", "saliency", "detector", "meter" or "corpus": which part of the script draws it
    title, about : str, heading and explanation of the page
    evidence : what the numbers are computed from, of plain lists and numbers
    controls, presets : in the order of the page
    params : callable, ``params(**values)`` returns the HarmonyParams that the controls stand for
    numbers : callable, ``numbers(**values)`` returns the numbers of the page, and its "sentence"
    words : name -> sentence with places for numbers in braces
    idle : mode -> names of controls that mean nothing in it
    play : callable, optional; ``play(**values)`` returns an element (HTML) to be opened under the picture
    extra : name -> value, where controls stand at first that are no setting of a mode
    """

    kind: str
    title: str
    about: str
    evidence: Mapping[str, Any]
    controls: Mapping[str, Slider | Menu]
    presets: Sequence[Preset]
    params: Callable[..., HarmonyParams]
    numbers: Callable[..., dict[str, Any]]
    words: Mapping[str, str]
    idle: Mapping[str, Sequence[str]] = field(default_factory=dict)
    play: Callable[..., str] | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def start(self) -> dict[str, Any]:
        """Name -> value, where the controls stand at first: at the first mode."""
        return {**self.extra, **self.mode_values(self._modes()[0])}

    def to_browser(self) -> dict[str, Any]:
        """The content as JSON holds it."""
        controls = [
            asdict(control) | {"name": name, "options": control.to_browser()}
            if isinstance(control, Menu)
            else asdict(control) | {"name": name}
            for name, control in self.controls.items()
        ]
        named = {name: field_texts(params) for name, params in MODES.items()}
        modes = {mode: field_texts(self.params(**{**self.start, **self.mode_values(mode)})) for mode in self._modes()}
        names = ("kind", "title", "about", "evidence", "start", "words", "idle")
        return plain(
            {name: getattr(self, name) for name in names}
            | {
                "controls": controls,
                "presets": [asdict(preset) for preset in self.presets],
                "modes": {mode: self.mode_values(mode) for mode in self._modes()},
                "line": {"order": list(named["paper"]), "fields": FIELDS, "named": named, "modes": modes},
                "plays": self.play is not None,
            }
        )

    def _modes(self) -> tuple[str, ...]:
        mode = self.controls.get("mode")
        return tuple(mode.options) if isinstance(mode, Menu) else ("paper",)

    def mode_values(self, mode: str) -> dict[str, Any]:
        """The mode, if there is a choice, and its own values of the controls."""
        names = [name for name in self.controls if hasattr(MODES[mode], FIELDS.get(name, name))]
        own = {"mode": mode} if "mode" in self.controls else {}
        return own | {name: setting(MODES[mode], name) for name in names}

    def checked(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values of controls; ValueError for an unknown control, or a value that it cannot have."""
        if unknown := set(values) - set(self.controls):
            raise ValueError(f"no control {', '.join(sorted(unknown))}; there are {', '.join(self.controls)}")
        return {name: self.controls[name].checked(name, value) for name, value in values.items()}


class LiveLab(anywidget.AnyWidget):
    """A lab in a notebook, a report, or a page of its own; see `LabContent`.

    Examples
    --------
    >>> lab.set(delay=0.1)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    'Now 11 of 12 music beats are met; by chance alone 47 % would be.'
    """

    _esm = SCRIPT
    _css = STYLE
    data = traitlets.Dict().tag(sync=True)
    settings = traitlets.Dict().tag(sync=True)
    player = traitlets.Unicode("").tag(sync=True)

    def __init__(self, content: LabContent, values: Mapping[str, Any] = MappingProxyType({})) -> None:
        self.content = content
        super().__init__(data=content.to_browser(), settings=dict(content.start))
        self.set(**values)
        self.on_msg(lambda *_: self.play())

    @property
    def values(self) -> dict[str, Any]:
        """Values of the controls by name."""
        return self.content.checked({name: self.settings[name] for name in self.content.controls})

    @property
    def moves(self) -> dict[str, dict[str, float]]:
        """Beats that were dragged: "music" and "dance", number of the beat -> its new time in seconds."""
        return self.settings.get("moves", {})

    @property
    def params(self) -> HarmonyParams:
        """The settings that the controls stand for now."""
        return self.content.params(**self.values)

    @property
    def line(self) -> str:
        """The settings as Python text."""
        return params_line(self.params)

    @property
    def numbers(self) -> dict[str, Any]:
        """The numbers of the page, computed in Python."""
        return self.content.numbers(**self.values, **({"moves": self.moves} if self.moves else {}))

    @property
    def sentence(self) -> str:
        """The sentence of the page."""
        return str(self.numbers["sentence"])

    @property
    def page(self) -> str:
        """The lab as one HTML page that asks the network for nothing."""
        start = {**self.data, "start": dict(self.settings), "plays": False}
        return rendered("lab.html.j2", data=start, script=SCRIPT, style=STYLE)

    def save(self, path: PathLike) -> None:
        """Write the page to a file, whole or not at all."""
        write_text(path, self.page)

    def set(self, **values: Any) -> None:
        """Move controls; a mode sets the others to its own values first.

        Raises
        ------
        ValueError
            For an unknown control, or a value that it cannot have.
        """
        values = self.content.checked(values)
        own = self.content.mode_values(values["mode"]) if "mode" in values else {}
        self.settings = {**self.values, **own, **values}

    def play(self) -> None:
        """Open the player of the chosen clip under the picture, if there is one; or the reason why it cannot play."""
        if self.content.play is None:
            return
        try:
            self.player = self.content.play(**self.values)
        except ValueError as error:
            self.player = f'<p role="alert">{html.escape(str(error))}</p>'

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """The widget where a page can show it, and the lab as a page of its own, which needs no Python."""
        data, metadata = (has_front_end() and super()._repr_mimebundle_(**kwargs)) or ({}, {})
        text = f"{self.sentence}\n{self.line}"
        return {**data, "text/plain": text, "text/html": framed(self.page, title=self.content.title, height=HEIGHT)}, (
            metadata
        )


def paper_with(**values: Any) -> HarmonyParams:
    """The paper's settings but for those of controls in `values`."""
    return with_settings(MODES["paper"], **values)
