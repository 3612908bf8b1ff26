"""The labs' script in a JavaScript engine without a browser: numbers, sentences and settings are those of Python."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import quickjs

from harmolab.beats.visual import visual_beats
from harmolab.lab.labs.corpus import Corpus, corpus_content, corpus_lab
from harmolab.lab.labs.live import (
    CONTROLS,
    FORMULAS,
    READS,
    SCRIPT,
    LabContent,
    LiveLab,
    Menu,
    Slider,
    Stage,
    curve_evidence,
    unread,
)
from harmolab.lab.labs.pages import inexact_corpus, inexact_dance, inexact_detector_lab, inexact_meter_lab
from harmolab.lab.labs.saliency import saliency_lab
from harmolab.lab.labs.scoring import lags, scoring_content
from tests.builders import cases, refused

STAGE = Stage.of(inexact_dance())


def with_every_control(content: LabContent, measure: str = "hits") -> LabContent:
    """The lab with every control that one of its formulas reads and that has a place for each mode's own value."""
    names = [name for name in CONTROLS if name != "position_smoothing" and not unread(content.kind, measure, [name])]
    controls = {**content.controls, **{name: CONTROLS[name] for name in names}}
    return replace(content, controls=controls, evidence={**content.evidence, **curve_evidence(STAGE.motion, controls)})


LABS: dict[str, Callable[[], LiveLab]] = {
    "scoring": lambda: LiveLab(scoring_content(STAGE)),
    "scoring, every control": lambda: LiveLab(with_every_control(scoring_content(STAGE))),
    "saliency": lambda: saliency_lab(inexact_dance()),
    "corpus": lambda: corpus_lab(inexact_corpus(6)),
    "corpus, every control": lambda: LiveLab(with_every_control(corpus_content(Corpus.of(inexact_corpus(4))))),
    "detector": inexact_detector_lab,
    "meter": inexact_meter_lab,
}
WHOLE = {"clip", "every", "first"}  # sliders of whole numbers


@pytest.fixture(scope="module", params=LABS)
def lab(request: pytest.FixtureRequest) -> LiveLab:
    return LABS[request.param]()


ANSWER = """
const read = new Set(), recorded = settings => new Proxy(settings, {
  get: (all, name) => { read.add(name); return all[name]; }, has: (all, name) => name in all,
});
function answer(text) {
  const settings = JSON.parse(text), numbers = NUMBERS[data.kind](data, recorded(complete(data, settings)));
  return JSON.stringify([numbers, settingsLine(data, settings)]);
}
"""


def engine(lab: LiveLab) -> Any:
    """A JavaScript engine with the script and the lab's data; `answer` gives numbers and line of settings, as JSON."""
    context = quickjs.Context()
    context.eval(re.sub(r"^export (default .*)?", "", SCRIPT, flags=re.MULTILINE))
    context.eval(f"const data = {json.dumps(lab.data)}; {ANSWER}")
    return context


def random_values(lab: LiveLab, rng: np.random.Generator) -> dict[str, Any]:
    """Any values of the controls: a third of the sliders on a step, the others between; and beats that were dragged."""
    values: dict[str, Any] = {}
    for name, control in lab.content.controls.items():
        if isinstance(control, Menu):
            values[name] = list(control.options)[int(rng.integers(len(control.options)))]
        else:
            values[name] = slider_value(control, rng)
    if values.get("mode") == "recommended" and lab.content.kind == "scoring":
        values["lag"] = float(rng.choice(lags()))  # the verdict is computed at the slider's steps
    for name in WHOLE & set(values):
        values[name] = float(round(values[name]))
    if lab.content.kind == "scoring" and values["mode"] != "recommended" and rng.random() < 0.3:
        values["moves"] = random_moves(lab, values, rng)
    return values


def slider_value(slider: Slider, rng: np.random.Generator) -> float:
    steps = round((slider.high - slider.low) / slider.step)
    if rng.random() < 1 / 3:
        return round(slider.low + int(rng.integers(steps + 1)) * slider.step, 6)
    return round(float(rng.uniform(slider.low, slider.high)), 4)  # smaller ones JavaScript writes in another way


def random_moves(lab: LiveLab, values: dict[str, Any], rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """One music beat and one visual beat, each moved to somewhere between its neighbours."""
    visual, moves = visual_beats(STAGE.motion, params=lab.content.params(**values)), {}
    for kind, times in (("music", STAGE.music.times), ("dance", visual.times)):
        beat = int(rng.integers(1, len(times) - 1))
        moves[kind] = {str(beat): float(rng.uniform(times[beat - 1] + 0.001, times[beat + 1] - 0.001))}
    return moves


def differences(ours: Any, theirs: Any, name: str = "") -> list[str]:
    """Names of what is not equal: numbers to 1e-9, all else exactly."""
    if isinstance(ours, dict):
        return [fault for key in ours for fault in differences(ours[key], theirs[key], f"{name}.{key}")]
    ours = ours.tolist() if isinstance(ours, np.ndarray | np.generic) else ours
    if isinstance(ours, list | tuple):
        if len(ours) != len(theirs):
            return [f"{name}: {len(ours)} and {len(theirs)}"]
        return [fault for one, other in zip(ours, theirs, strict=True) for fault in differences(one, other, name)]
    if isinstance(ours, float) and np.isnan(ours):
        ours = None
    is_equal = np.isclose(ours, theirs, rtol=1e-9, atol=1e-12) if isinstance(ours, float) else ours == theirs
    return [] if is_equal else [f"{name}: {ours} in Python, {theirs} in the script"]


def test_numbers_sentences_and_lines_of_random_settings_are_those_of_python(lab: LiveLab) -> None:
    rng, answer, wrong = np.random.default_rng(17), engine(lab).get("answer"), []
    for _ in range(100 if lab.content.kind in ("saliency", "corpus") else 300):
        lab.settings = values = random_values(lab, rng)
        numbers, line = json.loads(answer(json.dumps(values)))
        faults = differences(lab.numbers, numbers) + differences(lab.line, line, "line")
        wrong += [(values, faults)] if faults else []
    assert wrong == []


def test_numbers_sentences_and_lines_of_every_preset_are_those_of_python(lab: LiveLab) -> None:
    answer, presets = engine(lab).get("answer"), lab.content.presets
    assert len(presets) > 5
    for preset in presets:
        lab.settings = dict(lab.content.start)
        lab.set(**preset.values)
        numbers, line = json.loads(answer(json.dumps(lab.settings)))
        assert differences(lab.numbers, numbers) + differences(lab.line, line, "line") == [], preset.label


@pytest.mark.parametrize("lab", sorted(FORMULAS), indirect=True)
def test_the_formulas_read_every_setting_that_is_declared_for_them(lab: LiveLab) -> None:
    context, rng = engine(lab), np.random.default_rng(1)
    for _ in range(30):
        context.get("answer")(json.dumps(random_values(lab, rng)))
    formulas = {formula for formulas in FORMULAS[lab.content.kind].values() for formula in formulas}
    assert set(json.loads(context.eval("JSON.stringify([...read])"))) >= {
        name for formula in formulas for name in READS[formula]
    }


@cases(
    "settings, name, fault",
    ("{ delay: 1 }", "delay", "the formula place reads delay, which READS in controls.py does not declare"),
    ("{ beta: 1 }", "lag", "the formula place reads lag, which has no value"),
)
def test_a_formula_that_reads_what_it_does_not_declare_stops(settings: str, name: str, fault: str) -> None:
    context = engine(LABS["meter"]())
    with pytest.raises(quickjs.JSException, match=fault):
        context.eval(f'declared({settings}, "place").{name}')


def test_a_reading_that_a_lab_is_given_by_one_word_acts_on_the_page_as_in_python() -> None:
    controls = {**scoring_content(STAGE).controls, "saliency": CONTROLS["saliency"]}
    lab = LiveLab(replace(scoring_content(STAGE), controls=controls), {"lambda2": 3.0})
    answer, harmonies = engine(lab).get("answer"), []
    for saliency in ("threshold", "literal"):
        lab.set(saliency=saliency)
        harmonies.append(json.loads(answer(json.dumps(lab.settings)))[0]["harmony"])
        assert harmonies[-1] == pytest.approx(lab.numbers["harmony"])
    assert harmonies[0] != pytest.approx(harmonies[1])


@cases(
    "kind, control, readers",
    ("scoring", "every", "(detector, salient music, salient dance, hits, verdict); those that read it: meter"),
    ("corpus", "detector", "(salient music, salient dance, hits, corpus, place); those that read it: detector"),
    ("saliency", "clock", "(salient music, salient dance); those that read it: none of any lab"),
)
def test_a_control_that_no_formula_of_the_lab_reads_is_refused(kind: str, control: str, readers: str) -> None:
    content = LABS[kind]().content
    slider = Slider("how fast", "n", 0.0, 1.0, 0.1)
    fault = f"the {kind} lab has a control {control} that none of its formulas reads {readers}; leave the control out"
    refused(re.escape(fault), replace, content, controls={**content.controls, control: slider})


def test_a_menu_without_the_value_of_a_mode_is_refused() -> None:
    content = LABS["scoring"]().content
    with pytest.raises(ValueError, match=r"position_smoothing must be one of 0\.0, 0\.05, .*; got 0\.06"):
        replace(content, controls={**content.controls, "position_smoothing": CONTROLS["position_smoothing"]})
