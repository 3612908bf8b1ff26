"""What the detector and the meter lab share: controls that change the picture, its copy in reports, the settings."""

from __future__ import annotations

import base64
import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.lab.figures.style import figure_style
from harmolab.lab.widgets import explorer
from harmolab.lab.widgets.labs.detector import detector_lab
from harmolab.lab.widgets.labs.lab import Lab, params_line
from harmolab.lab.widgets.labs.meter import meter_lab
from harmolab.lab.widgets.quickdraw import plain
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.types import BeatTrack, Clip, Motion, Skeleton
from tests.builders import along_x

DPI = 30  # of all pictures here
PRESETS = (HarmonyParams.paper(), HarmonyParams.recommended(), HarmonyParams.valleys())


def holding_dancer(fps: float = 30.0) -> Motion:
    """A hand that speeds up, keeps its speed for four frames and slows down, over and over."""
    speed = np.tile([1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 3.0, 2.0, 1.0, 0.5], 16)
    return along_x(np.cumsum(speed) / 32, fps=fps)  # exact in binary, so that a plateau is a tie


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the pixels each way: drawing takes most of the time here."""
    monkeypatch.setattr(explorer, "Figure", lambda **settings: Figure(**settings | {"dpi": DPI}))


@pytest.fixture(scope="module")
def human_clip() -> Clip:
    """An inexact dancer, and beats of very different strength, so that every control has something to act on."""
    clip = synthetic_clip("cha-cha", seconds=8.0, fps=30.0, jitter=0.06, omission=0.2, redundancy=0.3, seed=2)
    assert clip.beats is not None
    count = len(clip.beats)
    strengths = np.where(np.arange(count) % 3 == 0, 1.0, 0.2) + np.arange(count) % 2
    return replace(clip, beats=replace(clip.beats, strengths=strengths, bar_places=np.arange(count) % 4))


def make_lab(name: str, clip: Clip) -> Lab:
    """The lab of that name on a clip."""
    if name == "meter":
        return meter_lab(clip, annotated=replace(clip.beats, strengths=1.0 + np.arange(len(clip.beats)) % 2))
    return detector_lab(clip)


def texts(lab: Lab) -> list[str]:
    """What is written above and under the picture."""
    return [child.value for child in lab.children if hasattr(child, "value")]


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png))).astype(np.int16)


# A value that shows, for every control of every lab.
MOVES: dict[str, dict[str, object]] = {
    "detector": {
        "detector": "valleys", "fps": 25.0, "smoothing": 0.1, "position_smoothing": 0.1, "subframe": True,
    },
    "meter": {"beats": "annotated", "lambda1": 1.0, "every": 2, "first": 3, "error": 0.5},
}  # fmt: skip
LABS = ("detector", "meter")
# Nothing of these shows on this clip: each has a test of its own.
UNSEEN = {"detector": {"plateau"}}


@pytest.mark.parametrize("name", LABS)
def test_each_control_changes_the_picture_which_comes_back_with_its_value(human_clip: Clip, name: str):
    lab = make_lab(name, human_clip)
    first, start = pixels(lab.png), lab.values
    idle = []
    for control, value in MOVES[name].items():
        lab.controls[control].value = value
        assert lab.error == "", control
        idle += [control] if np.abs(pixels(lab.png) - first).max() <= 1 else []
        for other, before in start.items():
            lab.controls[other].value = before
        assert np.abs(pixels(lab.png) - first).max() <= 1, control
    assert idle == []


@pytest.mark.parametrize("name", LABS)
def test_every_control_is_tried_by_some_test(human_clip: Clip, name: str):
    assert set(MOVES[name]) | UNSEEN.get(name, set()) == set(make_lab(name, human_clip).controls)


def test_plateau_moves_the_beats_of_a_dancer_who_keeps_the_speed(human_clip: Clip):
    clip = replace(human_clip, motion=holding_dancer())
    lab = detector_lab(clip, detector="peaks", fps=None)
    before = lab.png
    lab.controls["plateau"].value = "middle"
    assert lab.error == ""
    assert lab.png != before


@pytest.mark.parametrize("name", LABS)
def test_report_gets_the_picture_that_is_drawn_when_called_directly(human_clip: Clip, name: str):
    lab = make_lab(name, human_clip)
    for control in list(MOVES[name])[:2]:
        lab.controls[control].value = MOVES[name][control]
    bundle = lab._repr_mimebundle_()
    figure = Figure(dpi=DPI)
    with figure_style():
        drawn = plain(lab._draw(**lab.values, figure=figure))
    shown = pixels(base64.b64decode(bundle["image/png"]))
    assert bundle["text/plain"] == params_line(lab.params)
    assert shown.shape == (*drawn.shape[:2], 3)
    # Kept layers are blended once more, which rounds a few pixels differently.
    assert np.abs(shown - drawn[..., :3]).max() <= 3


@pytest.mark.parametrize("name", LABS)
def test_unknown_control_is_refused_by_name(human_clip: Clip, name: str):
    with pytest.raises(ValueError, match="no control tolerance; there are "):
        {"detector": detector_lab, "meter": meter_lab}[name](human_clip, tolerance=0.1)


@pytest.mark.parametrize(
    ("name", "control", "value", "line"),
    [
        ("detector", "smoothing", 0.05, "HarmonyParams(smoothing=0.05)"),
        ("detector", "fps", None, "HarmonyParams(fps=None)"),
        ("meter", "lambda1", 1.0, "HarmonyParams(audio_threshold=1.0)"),
        ("meter", "first", 2, "HarmonyParams.paper()"),
    ],
)
def test_line_under_the_picture_follows_the_controls(
    human_clip: Clip, name: str, control: str, value: object, line: str
):
    lab = make_lab(name, human_clip)
    lab.controls[control].value = value
    assert lab.line == line
    assert f'<code style="user-select: all">{line}</code>' in texts(lab)
    assert eval(line) == lab.params


def test_picture_and_line_stay_when_a_control_causes_an_error(human_clip: Clip):
    lab = detector_lab(human_clip)
    before = lab.png
    lab.controls["detector"].options = ("turns", "tea leaves")
    lab.controls["detector"].value = "tea leaves"
    assert "detector must be one of" in lab.error
    assert lab.png == before
    assert any("HarmonyParams.paper()" in text for text in texts(lab))


@pytest.mark.parametrize("params", PRESETS)
def test_preset_is_written_by_its_name(params: HarmonyParams):
    assert params_line(params) in ("HarmonyParams.paper()", "HarmonyParams.recommended()", "HarmonyParams.valleys()")
    assert eval(params_line(params)) == params


def test_numbers_of_numpy_and_a_learnt_pattern_are_written_as_plain_python():
    pattern = BarPattern(2, (np.float64(-0.5), np.float64(0.25)), (np.float64(0.1), np.float64(0.0)), 'it\'s "learnt"')
    params = HarmonyParams(lag=np.float64(0.1), pattern=pattern)
    assert "np." not in params_line(params)
    assert eval(params_line(params)) == params


numbers = st.floats(0.0, 10.0, allow_nan=False)
any_params = st.builds(
    replace,
    st.sampled_from(PRESETS),
    audio_threshold=numbers,
    visual_threshold=st.none() | numbers,
    lag=st.floats(-1.0, 1.0),
    fps=st.none() | st.floats(1.0, 120.0),
    subframe=st.booleans(),
    **{name: st.sampled_from(choices) for name, choices in CHOICES.items()},
    pattern=st.builds(lambda values: BarPattern(1, tuple(values), tuple(values)), st.lists(numbers, min_size=1)),
)


@given(any_params)
def test_any_settings_come_back_from_their_line(params: HarmonyParams):
    assert eval(params_line(params)) == params


def test_silence_and_a_dancer_who_stands_still_draw_too(human_clip: Clip):
    still = Motion(np.zeros((180, 1, 3)), 30.0, Skeleton.unnamed(1))
    clip = replace(human_clip, motion=still, beats=BeatTrack([], [], fps=43.0, duration=6.0))
    labs = [detector_lab(clip, planted=[]), meter_lab(clip, annotated=clip.beats)]
    for lab in labs:
        for control, value in [("lambda1", 1.0), ("detector", "valleys"), ("every", 2)]:
            if control in lab.controls:
                lab.controls[control].value = value
                assert lab.error == ""
