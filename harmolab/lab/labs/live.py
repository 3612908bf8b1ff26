"""A lab that a browser draws by itself: in JupyterLab, in the report, or as a page of its own, without Python.

Python reads the evidence (beats, strengths, curves) once; the script beside this module scores and draws it at every
move of a slider. In JupyterLab, Python learns of the settings afterwards, so that they can be read and copied.
"""

import base64
import html
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import anywidget
import numpy as np
import traitlets
from IPython import get_ipython

from harmolab.beats.visual import motion_curve
from harmolab.files import PathLike, plain, write_text
from harmolab.lab.player_data import LAB_SENTENCES
from harmolab.lab.report.templates import framed, rendered
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, Clip, FloatArray, Motion
from harmolab.verdict.judge import music_and_motion

# Settings of a lab: the fields of `HarmonyParams` that its controls stand for, and the line to copy

MODES: Mapping[str, HarmonyParams] = {
    "paper": HarmonyParams.paper(),
    "recommended": HarmonyParams.recommended(),
    "valleys": HarmonyParams.valleys(),
}

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


def mode_settings(mode: str) -> dict[str, Any]:
    """Values of a mode by the names that controls have; a λ2 of 0 keeps every visual beat."""
    names = {field: name for name, field in FIELDS.items()}
    values = {names.get(field, field): value for field, value in vars(MODES[mode]).items() if field != "pattern"}
    return values | {"lambda2": values["lambda2"] or 0.0}


def lab_params(mode: str = "paper", *, pattern: BarPattern | None = None, **values: Any) -> HarmonyParams:
    """A mode's settings but for those that controls of these names and values stand for.

    `pattern` goes to the mode that judges by one.
    """
    fields = {FIELDS.get(name, name): value for name, value in values.items()}
    if "visual_threshold" in fields:
        fields["visual_threshold"] = fields["visual_threshold"] or None
    own = MODES[mode]
    if own.measure == "shape":
        fields["pattern"] = pattern
    return replace(own, **fields)


# Is there a page that can show a widget? JupyterLab has one, a program that runs notebooks has none


def has_front_end() -> bool:
    """False where a program runs the notebook without a page: nbconvert, papermill, and our report.

    JupyterLab, Notebook and VS Code name the cell in the metadata of each request to execute it; those programs leave
    them empty (nbclient). Voilà runs notebooks as they do and shows widgets; it names itself in the environment. True
    where there is no kernel, and where a page, not a cell, has the lab shown.
    """
    kernel = getattr(get_ipython(), "kernel", None)
    if kernel is None or os.environ.get("SERVER_SOFTWARE", "").startswith("voila"):
        return True
    request = kernel.get_parent()
    is_cell = request.get("header", {}).get("msg_type") == "execute_request"
    return not is_cell or bool(request.get("metadata"))


# Controls, in plain words with the paper's symbol beside them, and the formulas that read them

# The settings that each formula of the labs' script reads. The script refuses to read any other, and Python a lab with
# a control that none of its formulas reads.
READS: Mapping[str, tuple[str, ...]] = {
    "detector": ("detector", "fps", "plateau", "smoothing", "position_smoothing", "subframe"),
    "salient music": ("lambda1", "normalisation", "saliency"),
    "salient dance": ("lambda2", "saliency", "visual_saliency", "first_beat"),
    "hits": ("delay", "lag", "beta", "matching"),
    "place": ("lag", "beta"),
    "verdict": ("lag",),
    "meter": ("beats", "every", "first", "error"),
    "corpus": ("late", "score", "clip"),
}
HITS = ("salient music", "salient dance", "hits")
# Kind of lab -> measure of its mode -> the formulas at work.
FORMULAS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "scoring": {"hits": ("detector", *HITS), "shape": ("verdict",)},
    "saliency": {"hits": HITS[:2]},
    "detector": {"hits": ("detector",)},
    "meter": {"hits": ("salient music", "meter")},
    "corpus": {"hits": (*HITS, "corpus"), "shape": ("place", "corpus")},
}


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

    def to_browser(self) -> dict[str, Any]:
        """The slider as JSON holds it."""
        return asdict(self)


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

    def to_browser(self) -> dict[str, Any]:
        """The menu as JSON holds it; of each choice its value, words and Python text."""
        return asdict(self) | {"options": [(value, words, repr(value)) for value, words in self.options.items()]}


# Controls of each lab, in the order of its page; some have more, which depend on its data.
LABS: Mapping[str, tuple[str, ...]] = {
    "scoring": ("delay", "lag", "lambda1", "lambda2", "beta", "mode", "detector", "matching"),
    "saliency": ("lambda1", "lambda2", "normalisation", "saliency", "visual_saliency", "first_beat"),
    "detector": ("detector", "fps", "plateau", "smoothing", "position_smoothing", "subframe"),
    "meter": ("lambda1", "every", "first", "error"),
    "corpus": ("late", "delay", "lambda1", "lambda2", "beta", "lag"),
}

MODE = {
    "paper": "the paper's: turns of speed within 0.25 s",
    "recommended": "recommended: verdict on the body's shape",
    "valleys": "stops: slowest moments within 0.1 s",
}
STRENGTHS = {"max": "of the largest", "mean": "of the mean", "raw": "as measured"}
PLATEAUS = {"last": "at its end", "middle": "at its middle", "literal": "not at all, as printed"}
RATES = {None: "as recorded", 60.0: "60", 30.0: "30", 25.0: "25", 15.0: "15", 10.0: "10"}
POSITION_SMOOTHINGS = {0.0: "not at all", **{step / 20: f"{step / 20:.2f} s" for step in range(1, 7)}}
LAG = Slider("expect the dance later by", "lag", -0.4, 0.4, 0.02, "s")
LAMBDA1 = Slider("ignore quiet music beats", "λ1", 0.0, 15.0, 0.1, "SD")
LAMBDA2 = Slider("ignore small movements", "λ2", 0.0, 15.0, 0.1, "SD")
DETECTORS = {
    "turns": "turns of the speed (fast and slow)",
    "valleys": "slowest moments",
    "peaks": "fastest moments",
    "direction": "changes of direction",
}
CONTROLS: Mapping[str, Slider | Menu] = {
    "mode": Menu("way to score", "mode", MODE),
    "detector": Menu("movements are", "detector", DETECTORS),
    "matching": Menu(
        "one movement may serve", "matching", {"many": "several music beats", "nearest": "one music beat, in turn"}
    ),
    "delay": Slider("together means within", "T_delay", 0.0, 0.5, 0.01, "s"),
    "lambda1": LAMBDA1,
    "lambda2": LAMBDA2,
    "beta": Slider("weigh missed beats", "β", 0.25, 4.0, 0.25, "×"),
    "lag": LAG,
    "normalisation": Menu("strength of a beat", "normalisation", STRENGTHS),
    "saliency": Menu(
        "threshold", "Eq. 11, 13", {"threshold": "λ standard deviations", "literal": "as printed: one SD, whatever λ"}
    ),
    "visual_saliency": Menu(
        "a movement is large by its", "Eq. 13", {"difference": "step from the one before", "strength": "speed"}
    ),
    "fps": Menu("frames a second", "fps", RATES),
    "plateau": Menu("a flat top counts", "Eq. 9", PLATEAUS),
    "smoothing": Slider("smooth the curve over", "σ", 0.0, 0.3, 0.01, "s"),
    "position_smoothing": Menu("smooth the positions first, over", "σ", POSITION_SMOOTHINGS),
    "subframe": Menu("beats lie", "subframe", {False: "on frames", True: "between frames"}),
    "first_beat": Menu("the first movement", "Eq. 12", {"copy": "has the second's step", "drop": "is left out"}),
    "late": Slider("wrong music comes later by", "late", 0.0, 1.0, 0.05, "beats"),
    "every": Slider("take one beat of every", "n", 1.0, 4.0, 1.0),
    "first": Slider("leave out at the start", "beats", 0.0, 7.0, 1.0),
    "error": Slider("measure each strength wrongly by", "error", 0.0, 1.0, 0.05, "SD"),
}


def lab_controls(kind: str) -> dict[str, Slider | Menu]:
    """The `CONTROLS` that `LABS` names for this kind of lab, by name."""
    return {name: CONTROLS[name] for name in LABS[kind]}


def unread(kind: str, measure: str, controls: Iterable[str]) -> list[str]:
    """The controls that no formula of such a lab reads in a mode of this measure."""
    read = {"mode"}.union(*(READS[formula] for formula in FORMULAS[kind].get(measure, ())))
    return [name for name in controls if name not in read]


def refuse_unread(kind: str, controls: Iterable[str]) -> None:
    """ValueError for a control that no formula of such a lab reads, whatever the mode."""
    measures = FORMULAS[kind]
    for name in controls:
        if all(unread(kind, measure, [name]) for measure in measures):
            own = ", ".join(dict.fromkeys(formula for formulas in measures.values() for formula in formulas))
            readers = ", ".join(formula for formula, names in READS.items() if name in names) or "none of any lab"
            raise ValueError(
                f"the {kind} lab has a control {name} that none of its formulas reads ({own}); those that read it: "
                f"{readers}; leave the control out, or name it in READS and read it in the script"
            )


FOLDER = Path(__file__).with_name("live")
PARTS = (
    "arrays", "hits", "verdicts", "sound", "chart", "clip_pictures", "corpus_picture", "detector", "meter", "numbers",
    "panel", "lab",
)  # fmt: skip
SCRIPT = "\n".join(
    [f"const READS = {json.dumps(dict(READS))};", *((FOLDER / f"{name}.js").read_text("utf-8") for name in PARTS)]
)
STYLE = (FOLDER / "lab.css").read_text("utf-8")
TEXTS = json.loads((FOLDER / "presets.json").read_text("utf-8"))  # kind of lab -> "about", and the rows of "presets"
LEAST_RANGE = 2.0  # standard deviations to which a slider of a λ goes at least
HEIGHT = 1100  # pixels of the frame, until its page sets it


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
    evidence : what the numbers are computed from, of plain lists and numbers
    controls : in the order of the page
    numbers : callable, ``numbers(**values)`` returns the numbers of the page, and its "sentence"
    computed : name -> number, which stands for the name in a preset, as "loud" for what was computed of the music
    pattern : BarPattern, optional, of the modes that have one
    play : callable, optional; ``play(**values)`` returns an element (HTML) to be opened under the picture
    extra : name -> value, where controls stand at first that are no setting of a mode
    name : str, of the dance and its song, for the title; "" where they are an example

    Raises
    ------
    ValueError
        For a control that no formula of the script reads in such a lab, or that cannot have a mode's own value.
    """

    kind: str
    evidence: Mapping[str, Any]
    controls: Mapping[str, Slider | Menu]
    numbers: Callable[..., dict[str, Any]]
    computed: Mapping[str, float] = field(default_factory=dict)
    pattern: BarPattern | None = None
    play: Callable[..., str] | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""

    def __post_init__(self) -> None:
        refuse_unread(self.kind, self.controls)
        for mode in self._modes():
            self.checked(self.mode_values(mode))

    @property
    def title(self) -> str:
        """Heading of the page."""
        return f"{self.name}: the {self.kind} lab" if self.name else f"The {self.kind} lab"

    @property
    def about(self) -> str:
        """Explanation at the top of the page."""
        return str(TEXTS[self.kind]["about"])

    @property
    def presets(self) -> tuple[Preset, ...]:
        """The presets of this kind of lab whose choices its menus offer, in the order of the page."""
        menus = {name: control.options for name, control in self.controls.items() if isinstance(control, Menu)}
        return tuple(
            Preset(label, {name: self.computed.get(value, value) for name, value in values.items()}, note)
            for label, values, note in TEXTS[self.kind]["presets"]
            if all(values[name] in options for name, options in menus.items() if name in values)
        )

    @property
    def start(self) -> dict[str, Any]:
        """Name -> value, where the controls stand at first: at the first mode."""
        return {**self.extra, **self.mode_values(self._modes()[0])}

    def params(self, **values: Any) -> HarmonyParams:
        """The settings that the controls stand for; the number of a clip, for one, is none."""
        settings = {"mode", *mode_settings("paper")}
        return lab_params(pattern=self.pattern, **{name: value for name, value in values.items() if name in settings})

    def to_browser(self) -> dict[str, Any]:
        """The content as JSON holds it."""
        controls = [control.to_browser() | {"name": name} for name, control in self.controls.items()]
        named = {name: field_texts(params) for name, params in MODES.items()}
        texts = {mode: field_texts(self.params(**{**self.start, **self.mode_values(mode)})) for mode in self._modes()}
        return plain(
            {name: getattr(self, name) for name in ("kind", "title", "about", "evidence", "start")}
            | {
                "words": LAB_SENTENCES,
                "controls": controls,
                "presets": [asdict(preset) for preset in self.presets],
                "modes": {mode: mode_settings(mode) for mode in MODES},
                "idle": {mode: unread(self.kind, MODES[mode].measure, self.controls) for mode in self._modes()},
                "line": {"order": list(named["paper"]), "fields": FIELDS, "named": named, "modes": texts},
                "plays": self.play is not None,
            }
        )

    def _modes(self) -> tuple[str, ...]:
        mode = self.controls.get("mode")
        return tuple(mode.options) if isinstance(mode, Menu) else ("paper",)

    def mode_values(self, mode: str) -> dict[str, Any]:
        """The mode, if there is a choice, and its own values of the controls."""
        own = {"mode": mode, **mode_settings(mode)}
        return {name: own[name] for name in self.controls if name in own}

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
        bundle = super()._repr_mimebundle_(**kwargs) if has_front_end() else None
        data, metadata = bundle or ({}, {})
        page = framed(self.page, title=self.content.title, height=HEIGHT)
        return {**data, "text/plain": f"{self.sentence}\n{self.line}", "text/html": page}, metadata


# Data of the labs of one clip

KINDS: Mapping[str, Literal["turns", "direction"]] = MappingProxyType({"joints": "turns", "direction": "direction"})


@dataclass(frozen=True, eq=False)
class Stage:
    """Data of one clip's lab: music beats and motion on one time line, the dance's pattern if known, the source.

    `has_start` as in `Clip`.
    """

    music: BeatTrack
    motion: Motion
    pattern: BarPattern | None = None
    source: str = ""
    has_start: bool = True

    @classmethod
    def of(cls, clip: Clip, pattern: BarPattern | None = None) -> "Stage":
        """The segment that a clip's music and motion share, with its `music_beats`.

        Raises
        ------
        ValueError
            If the clip has no motion.
        """
        return cls(*music_and_motion(clip), pattern, clip.source, clip.has_start)


def last_lambda(heights: FloatArray, slider: Slider) -> Slider:
    """The slider of a λ that ends where no beat is left: one step past the largest height in standard deviations."""
    spread = float(heights.std()) if heights.size else 0.0
    last = slider.step * np.ceil(float(heights.max()) / spread / slider.step) if spread > 0 else slider.high
    return replace(slider, high=float(np.clip(round(last + slider.step, 6), LEAST_RANGE, slider.high)))


def middle_lambda(music: BeatTrack) -> float:
    """λ1 to one decimal that keeps the louder half of the music beats or so; at most that of the labs' slider."""
    strengths = music.strengths
    spread = float(strengths.std()) if strengths.size else 0.0
    return min(np.floor(10 * float(np.median(strengths)) / spread) / 10, 15.0) if spread > 0 else 0.0


def track_evidence(track: BeatTrack) -> dict[str, Any]:
    """Times and strengths of a track: what the script scores."""
    return {"times": track.times, "strengths": track.strengths}


def curve_evidence(motion: Motion, controls: Mapping[str, Slider | Menu]) -> dict[str, Any]:
    """Curves, not yet smoothed, that the script reads visual beats from, and the frames that are not valid.

    There is a curve for every rate and smoothing of positions that the controls offer; a setting without a menu has
    the values of the modes that count hits.
    """
    options = {name: _options(name, controls) for name in ("fps", "subframe", "position_smoothing")}
    rates: dict[str, HarmonyParams] = {}
    for fps, subframe in product(options["fps"], options["subframe"]):
        own_rate = "interpolated" if subframe else "own"
        rates[own_rate if fps is None else f"{fps:g}"] = lab_params(fps=fps, subframe=subframe)
    return {
        "levels": options["position_smoothing"],
        "rates": {name: _curves(motion, params, options["position_smoothing"]) for name, params in rates.items()},
        "valid": {"fps": motion.fps, "frames": motion.n_frames, "gaps": np.flatnonzero(~motion.valid)},
    }


def _options(name: str, controls: Mapping[str, Slider | Menu]) -> list[Any]:
    """Values that a menu offers, else those of the modes that count hits."""
    control = controls.get(name)
    if isinstance(control, Menu):
        return list(control.options)
    return list(dict.fromkeys(mode_settings(mode)[name] for mode in MODES if MODES[mode].measure == "hits"))


def _curves(motion: Motion, params: HarmonyParams, levels: Sequence[float]) -> dict[str, Any]:
    """Rate, and the curve of each kind at each smoothing of positions; base64 of doubles, which loses no digit."""
    curves = {
        kind: [motion_curve(motion, replace(params, detector=detector, position_smoothing=level)) for level in levels]
        for kind, detector in KINDS.items()
    }
    return {
        "fps": curves["joints"][0][1],
        "curves": {kind: [_base64(curve) for curve, _ in rows] for kind, rows in curves.items()},
    }


def _base64(values: FloatArray) -> str:
    return base64.b64encode(values.astype("<f8").tobytes()).decode("ascii")
