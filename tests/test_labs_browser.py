"""The labs as pages, driven in Chromium: what they show, sliders by mouse, touch and keyboard, beats dragged."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from harmolab.lab.labs.corpus import corpus_lab
from harmolab.lab.labs.live import LiveLab
from harmolab.lab.labs.pages import (
    inexact_corpus,
    inexact_dance,
    inexact_detector_lab,
    inexact_meter_lab,
    write_lab_pages,
)
from harmolab.lab.labs.saliency import saliency_lab
from harmolab.lab.labs.scoring import scoring_lab

pytestmark = pytest.mark.browser

LABS: dict[str, Callable[[], LiveLab]] = {
    "scoring": lambda: scoring_lab(inexact_dance()),
    "saliency": lambda: saliency_lab(inexact_dance()),
    "corpus": lambda: corpus_lab(inexact_corpus(14)),
    "detector": inexact_detector_lab,
    "meter": inexact_meter_lab,
}
WIDE, PHONE = {"width": 1280, "height": 1000}, {"width": 390, "height": 844}


@pytest.fixture(scope="module", params=LABS)
def lab(request: pytest.FixtureRequest) -> LiveLab:
    return LABS[request.param]()


def opened(chromium: Any, path: Path, **context: Any) -> Any:
    """The page; `page.faults` collects its errors, and what it asks the network for."""
    page = chromium.new_context(**{"viewport": WIDE, **context}).new_page()
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("request", lambda request: page.faults.append(request.url) if request.url.startswith("http") else None)
    page.goto(path.as_uri())
    page.wait_for_function("window.harmolabLab")
    return page


@pytest.fixture
def page(chromium: Any, lab: LiveLab, tmp_path: Path) -> Iterator[Any]:
    lab.settings = dict(lab.content.start)  # another test may have moved them
    lab.save(tmp_path / "lab.html")
    page = opened(chromium, tmp_path / "lab.html")
    yield page
    assert page.faults == []
    page.context.close()


@pytest.fixture(scope="module")
def scoring_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lab") / "scoring.html"
    LABS["scoring"]().save(path)
    return path


def test_the_shown_sentence_and_line_are_those_of_python_for_every_preset(lab: LiveLab, page: Any) -> None:
    buttons = page.locator(".presets button")
    assert buttons.count() == len(lab.content.presets) > 5
    for number, preset in enumerate(lab.content.presets):
        buttons.nth(number).click()
        lab.set(**{**lab.content.start, **preset.values, **({"mode": "paper"} if "mode" in lab.values else {})})
        lab.set(**preset.values)
        assert page.locator(".sentence").inner_text() == lab.sentence
        assert page.locator("code").inner_text() == lab.line
        assert page.locator(".note").inner_text() == preset.note
        assert buttons.nth(number).get_attribute("aria-pressed") == "true"


def picture(page: Any) -> str:
    """The picture's pixels, as text."""
    return str(page.evaluate("document.querySelector('canvas').toDataURL()"))


def slider(page: Any, name: str) -> Any:
    return page.locator(f'input[data-name="{name}"]')


def value(page: Any, name: str) -> float:
    return float(page.evaluate("name => harmolabLab.state.settings[name]", name))


def drag_by_finger(page: Any, start: float, end: float, y: float, steps: int = 8) -> None:
    """A finger that goes from one place of the screen to another at the same height."""
    touch = page.context.new_cdp_session(page)
    for step in range(steps + 1):
        kind = "touchMove" if step else "touchStart"
        points = [{"x": start + (end - start) * step / steps, "y": y}]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


@pytest.mark.parametrize("way", ["mouse", "tap", "finger", "keyboard"])
def test_a_slider_moved_by(way: str, chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page, viewport=PHONE, has_touch=True)
    before = picture(page), page.locator(".sentence").inner_text()
    delay = slider(page, "delay")
    delay.scroll_into_view_if_needed()
    box = delay.bounding_box()
    left, middle, y = box["x"] + 0.1 * box["width"], box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2
    if way == "mouse":
        page.mouse.move(middle, y)
        page.mouse.down()
        page.mouse.move(left, y, steps=8)
        page.mouse.up()
    elif way == "tap":
        page.touchscreen.tap(left, y)
    elif way == "finger":
        drag_by_finger(page, middle, left, y)
    else:
        delay.focus()
        for _ in range(20):
            page.keyboard.press("ArrowLeft")
    assert value(page, "delay") == pytest.approx(0.05, abs=0.011)
    assert picture(page) != before[0]
    assert page.locator(".sentence").inner_text() != before[1]
    assert page.faults == []
    page.context.close()


def test_a_dragged_beat_moves_counts_and_can_be_heard(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.get_by_role("button", name="stops only").click()
    page.locator("canvas").scroll_into_view_if_needed()
    spot = page.evaluate("harmolabLab.state.picture.beats.find(beat => beat.kind === 'music' && beat.index === 7)")
    frame = page.locator("canvas").bounding_box()
    hits = page.evaluate("harmolabLab.state.numbers.hits")
    page.mouse.move(frame["x"] + spot["x"], frame["y"] + spot["middle"] - 20)
    page.mouse.down()
    page.mouse.move(frame["x"] + spot["x"] + 17, frame["y"] + spot["middle"] - 20, steps=6)
    page.mouse.up()
    moved = page.evaluate("harmolabLab.state.settings.moves.music[7]")
    seconds = 17 / page.evaluate("harmolabLab.state.picture.chart.x(1) - harmolabLab.state.picture.chart.x(0)")
    assert moved == pytest.approx(spot["time"] + seconds, abs=0.01)
    assert page.evaluate("harmolabLab.state.numbers.hits") == hits - 1
    assert page.evaluate("harmolabLab.state.sound.count") > 3
    page.get_by_role("button", name="stops only").click()
    assert page.evaluate("harmolabLab.state.numbers.hits") == hits
    assert page.faults == []
    page.context.close()


def test_a_beat_is_chosen_and_moved_by_keys_and_stays_between_its_neighbours(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.locator("canvas").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    selected = page.evaluate("harmolabLab.state.selected")
    page.keyboard.press("Shift+ArrowRight")
    moves = page.evaluate("harmolabLab.state.settings.moves")
    assert moves[selected["kind"]][str(selected["index"])] == pytest.approx(selected["time"] + 0.01, abs=0.002)
    for _ in range(60):
        page.keyboard.press("Shift+ArrowRight")
    times = page.evaluate(f"harmolabLab.state.numbers.{'allMusic' if selected['kind'] == 'music' else 'allDance'}")
    assert times == sorted(times)
    assert page.faults == []
    page.context.close()


def test_play_schedules_a_click_for_each_beat_and_a_second_press_stops_it(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.get_by_role("button", name="Play the clicks").click()
    page.wait_for_function("harmolabLab.state.sound && harmolabLab.state.sound.time() > 0.2")
    beats = page.evaluate("harmolabLab.state.numbers.loud.kept.length + harmolabLab.state.numbers.large.kept.length")
    assert page.evaluate("harmolabLab.state.sound.count") == beats
    page.get_by_role("button", name="Play the clicks").click()
    assert page.evaluate("harmolabLab.state.sound") is None
    page.context.close()


def test_a_click_on_a_mark_chooses_its_dance(chromium: Any, tmp_path: Path) -> None:
    LABS["corpus"]().save(tmp_path / "lab.html")
    page = opened(chromium, tmp_path / "lab.html")
    spot = page.evaluate("harmolabLab.state.picture.beats.reduce((a, b) => (b.y > a.y ? b : a))")
    page.locator("canvas").click(position={"x": spot["x"], "y": spot["y"]})
    assert value(page, "clip") == spot["index"]
    assert page.faults == []
    page.context.close()


def test_recommended_mode_switches_off_what_means_nothing_in_it(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.locator('select[data-name="mode"]').select_option("recommended")
    assert slider(page, "delay").is_disabled()
    assert not slider(page, "lag").is_disabled()
    assert page.locator("code").inner_text() == "HarmonyParams.recommended()"
    page.context.close()


def test_plain_nbconvert_gives_a_page_whose_lab_is_alive_offline(chromium: Any, tmp_path: Path) -> None:
    cell = "from harmolab import synthetic_clip\nfrom harmolab.lab import saliency_lab\n"
    cell += "saliency_lab(synthetic_clip('cha-cha', seconds=6.0, seed=1))"
    nbformat.write(new_notebook(cells=[new_code_cell(cell)]), tmp_path / "lab.ipynb")
    command = [sys.executable, "-m", "nbconvert", "--to", "html", "--execute", str(tmp_path / "lab.ipynb")]
    subprocess.run(command, check=True, capture_output=True)
    context = chromium.new_context(viewport=WIDE, offline=True)
    page = context.new_page()
    page.goto((tmp_path / "lab.html").as_uri(), wait_until="commit")
    frame = page.locator("iframe").first.element_handle(timeout=20_000).content_frame()
    frame.wait_for_function("window.harmolabLab", timeout=20_000)
    assert frame.locator("canvas").bounding_box()["height"] > 100
    before = picture(frame), frame.locator(".board").inner_text()
    slider(frame, "lambda2").focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    assert picture(frame) != before[0]
    assert frame.locator(".board").inner_text() != before[1]
    context.close()


@pytest.mark.parametrize("viewport", [WIDE, PHONE])
def test_pages_of_a_site_fit_the_screen_and_ask_for_nothing(chromium: Any, tmp_path: Path, viewport: Any) -> None:
    paths = write_lab_pages(tmp_path)
    assert [path.stem for path in paths] == [f"{name}_lab" for name in LABS]
    for path in paths:
        page = opened(chromium, path, viewport=viewport)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        assert page.evaluate("document.querySelector('input[type=range]').clientWidth") > 250
        assert page.faults == []
        page.context.close()
