"""Labs, trials and taps in a browser: pages of their own, and in a real JupyterLab."""

import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from harmolab.lab.labs import pages
from harmolab.lab.labs.corpus import corpus_lab
from harmolab.lab.labs.live import LiveLab
from harmolab.lab.labs.one_clip import saliency_lab, scoring_lab
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer, TapServer
from harmolab.lab.listening.trials import Item, TrialSet, make_trials
from harmolab.lab.player import blind_page
from harmolab.readers.beats import TappedBeats, tapped_beats
from harmolab.types import Audio, Clip
from tests.builders import cases, planted_dance

# Labs as pages of their own

pytestmark = pytest.mark.browser

LABS: dict[str, Callable[[], LiveLab]] = {
    "scoring": lambda: scoring_lab(pages.inexact_dance()),
    "saliency": lambda: saliency_lab(pages.inexact_dance()),
    "corpus": lambda: corpus_lab(pages.inexact_corpus(14)),
    "detector": pages.inexact_detector_lab,
    "meter": pages.inexact_meter_lab,
}
TALL, WIDE, PHONE = ({"width": width, "height": height} for width, height in ((1280, 1000), (1280, 900), (390, 844)))


@pytest.fixture(scope="module", params=LABS)
def lab(request: pytest.FixtureRequest) -> LiveLab:
    return LABS[request.param]()


def at_address(chromium: Any, address: str, viewport: dict[str, int] = WIDE, **context: Any) -> Any:
    """The page; `page.faults` collects its errors, and what it asks of the network elsewhere."""
    page = chromium.new_context(viewport=viewport, **context).new_page()
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda message: page.faults.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: page.faults.append(request.url) if is_elsewhere(request.url, address) else None)
    page.goto(address)
    return page


def is_elsewhere(url: str, address: str) -> bool:
    return url.startswith("http") and not url.startswith(address)


def opened(chromium: Any, path: Path, viewport: dict[str, int] = TALL, **context: Any) -> Any:
    """The page of a lab."""
    page = at_address(chromium, path.as_uri(), viewport, **context)
    page.wait_for_function("window.harmolabLab")
    return page


def closed(page: Any) -> None:
    """Closes a page that had no fault."""
    assert page.faults == []
    page.context.close()


def fits(page: Any, viewport: dict[str, int]) -> bool:
    """Whether nothing is outside the screen."""
    width, height = page.evaluate(
        "(({ scrollWidth, scrollHeight }) => [scrollWidth, scrollHeight])(document.documentElement)"
    )
    return width <= viewport["width"] and height <= viewport["height"]


@pytest.fixture
def page(chromium: Any, lab: LiveLab, tmp_path: Path) -> Iterator[Any]:
    lab.settings = dict(lab.content.start)  # another test may have moved them
    lab.save(tmp_path / "lab.html")
    page = opened(chromium, tmp_path / "lab.html")
    yield page
    closed(page)


@pytest.fixture(scope="module")
def scoring_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lab") / "scoring.html"
    LABS["scoring"]().save(path)
    return path


def test_the_shown_sentence_and_line_are_those_of_python_for_every_preset(page: Any, lab: LiveLab) -> None:
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


def picture(place: Any, canvas: str = "canvas") -> str:
    """The pixels of the picture of a page, a frame or a lab, as text."""
    return str(place.locator(canvas).first.evaluate("canvas => canvas.toDataURL()"))


def slider(page: Any, name: str) -> Any:
    return page.locator(f'input[data-name="{name}"]')


def value(page: Any, name: str) -> float:
    return float(page.evaluate("name => harmolabLab.state.settings[name]", name))


def drag_by_mouse(page: Any, start: float, end: float, y: float) -> None:
    page.mouse.move(start, y)
    page.mouse.down()
    page.mouse.move(end, y, steps=8)
    page.mouse.up()


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
        drag_by_mouse(page, middle, left, y)
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
    closed(page)


def test_a_dragged_beat_moves_counts_and_can_be_heard(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.get_by_role("button", name="stops only").click()
    page.locator("canvas").scroll_into_view_if_needed()
    spot = page.evaluate("harmolabLab.state.picture.beats.find(beat => beat.kind === 'music' && beat.index === 7)")
    frame = page.locator("canvas").bounding_box()
    hits = page.evaluate("harmolabLab.state.numbers.hits")
    drag_by_mouse(page, frame["x"] + spot["x"], frame["x"] + spot["x"] + 17, frame["y"] + spot["middle"] - 20)
    moved = page.evaluate("harmolabLab.state.settings.moves.music[7]")
    seconds = 17 / page.evaluate("harmolabLab.state.picture.chart.x(1) - harmolabLab.state.picture.chart.x(0)")
    assert moved == pytest.approx(spot["time"] + seconds, abs=0.01)
    assert page.evaluate("harmolabLab.state.numbers.hits") == hits - 1
    assert page.evaluate("harmolabLab.state.sound.count") > 3
    page.get_by_role("button", name="stops only").click()
    assert page.evaluate("harmolabLab.state.numbers.hits") == hits
    closed(page)


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
    closed(page)


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
    closed(page)


def test_a_dark_system_gives_a_dark_lab_whose_picture_follows_a_change(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page, color_scheme="dark")
    corner = "[...document.querySelector('canvas').getContext('2d').getImageData(1, 1, 1, 1).data].slice(0, 3)"
    assert max(page.evaluate(corner)) < 60
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"Math.min(...{corner}) > 240")
    closed(page)


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
    command = [sys.executable, "-m", "nbconvert", "--to", "html", "--execute"]
    command.append(str(written(tmp_path / "lab.ipynb", cell)))
    subprocess.run(command, check=True, capture_output=True)
    context = chromium.new_context(viewport=TALL, offline=True)
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


@pytest.mark.parametrize("viewport", [TALL, PHONE])
def test_pages_of_a_site_fit_the_screen_and_ask_for_nothing(chromium: Any, tmp_path: Path, viewport: Any) -> None:
    paths = pages.write_lab_pages(tmp_path)
    assert [path.stem for path in paths] == [f"{name}_lab" for name in LABS]
    for path in paths:
        page = opened(chromium, path, viewport=viewport)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        assert page.evaluate("document.querySelector('input[type=range]').clientWidth") > 250
        closed(page)


# In JupyterLab

ROOT = Path(__file__).resolve().parents[1]
TOKEN = "a-token-for-this-test"
N_PRESSES = 20
LAG_STEP = 0.02  # seconds, of the lab's lag slider


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def settings_folder(folder: Path) -> Path:
    """JupyterLab settings under which every cell is in the page, and nothing is fetched."""
    for extension, text in {
        "notebook-extension/tracker": '{"windowingMode": "none"}',
        "apputils-extension/notification": '{"fetchNews": "false", "checkForUpdates": false}',
    }.items():
        (folder / "@jupyterlab" / extension).parent.mkdir(parents=True)
        (folder / "@jupyterlab" / f"{extension}.jupyterlab-settings").write_text(text)
    return folder


@contextmanager
def running_jupyterlab(folder: Path, notebook: Path) -> Iterator[str]:
    """Address of a JupyterLab on a copy of a notebook, called lab.ipynb."""
    (folder / "work").mkdir()
    shutil.copy(notebook, folder / "work" / "lab.ipynb")
    address = f"http://127.0.0.1:{(port := free_port())}"
    options = {
        "ServerApp.ip": "127.0.0.1",
        "ServerApp.port": port,
        "ServerApp.root_dir": folder / "work",
        "IdentityProvider.token": TOKEN,
        "LabApp.user_settings_dir": settings_folder(folder / "settings"),
        "LabApp.workspaces_dir": folder / "workspaces",
    }
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"]
    command += [f"--{name}={value}" for name, value in options.items()]
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment |= {"HARMOLAB_PROFILE": "quick", "HARMOLAB_FIGURES": str(folder / "figures")}
    with (folder / "server.log").open("w") as log:
        server = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=environment)
        try:
            wait_for(address, server, folder / "server.log")
            yield address
        finally:
            server.terminate()
            server.wait(timeout=20)


def wait_for(address: str, server: subprocess.Popen[bytes], log: Path) -> None:
    for _ in range(120):
        if server.poll() is not None:
            break
        try:
            urllib.request.urlopen(f"{address}/api", timeout=2).close()
            return
        except OSError:
            time.sleep(0.5)
    pytest.fail(f"JupyterLab did not start:\n{log.read_text()[-2000:]}")


def started(address: str, chromium: Any, viewport: dict[str, int]) -> Any:
    """A browser tab in which all cells of the notebook were just told to run."""
    tab = chromium.new_page(viewport=viewport)
    tab.goto(f"{address}/lab/tree/lab.ipynb?reset&token={TOKEN}")
    tab.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=60_000)
    # Run without a kernel, and JupyterLab asks for one.
    tab.locator("#jp-main-statusbar").filter(has_text=re.compile(r"Python 3.*Idle")).wait_for(timeout=90_000)
    tab.get_by_role("menuitem", name="Run", exact=True).click()
    tab.locator('[data-command="runmenu:run-all"]').click()
    return tab


def notebook_run(address: str, chromium: Any) -> Any:
    """A browser tab in which the whole notebook has been run."""
    tab = started(address, chromium, {"width": 1400, "height": 1000})
    tab.wait_for_selector(".harmolab-lab canvas", timeout=180_000)
    # The figure or the words of the last cell: everything has been run, and the kernel has nothing else to do.
    tab.locator(".jp-CodeCell").last.locator("img, .jp-RenderedMarkdown").first.wait_for(timeout=180_000)
    return tab


@pytest.fixture(scope="module")
def notebook(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser tab with a copy of notebook 04."""
    path = ROOT / "notebooks" / "04_salience_and_scoring.ipynb"
    with running_jupyterlab(tmp_path_factory.mktemp("lab"), path) as address:
        yield notebook_run(address, chromium)


# Times from the key press to the canvas, and to the frame after it.
COUNT_CANVASES = """() => {
    window.delays = [];
    if (window.listening) return;
    window.listening = true;
    addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
    addEventListener("input", () => requestAnimationFrame(() => requestAnimationFrame(() => {
        window.delays.push(performance.now() - window.pressed);
    })));
}"""


def play(frame: Any) -> None:
    frame.click("#play")
    frame.wait_for_function("harmolabPlayer.time() > 0.3", timeout=20_000)


def live_lab(page: Any, title: str) -> Any:
    """The lab with that heading."""
    return page.locator(".harmolab-lab").filter(has=page.get_by_role("heading", name=title)).first


def press_live_arrows(page: Any, lab: Any, name: str) -> None:
    """Presses of an arrow key on the slider of that name, each until its picture is shown."""
    page.evaluate(COUNT_CANVASES)
    lab.locator(f'input[data-name="{name}"]').focus()
    for press in range(N_PRESSES):
        # There and back, so that the slider never arrives at its end.
        page.keyboard.press("ArrowLeft" if press % 10 < 5 else "ArrowRight")
        page.wait_for_function(f"window.delays.length > {press}", timeout=10_000)
    delays = np.array(page.evaluate("window.delays"))[5:]
    print(f"{name}: key press to picture, median {np.median(delays):.0f} ms, p90 {np.percentile(delays, 90):.0f} ms")
    assert np.percentile(delays, 90) <= (50 if os.environ.get("HARMOLAB_TIMING") else np.inf)


def changes_by_arrows(page: Any, lab: Any, name: str) -> None:
    """Two more presses one way leave another picture."""
    before = picture(lab)
    press_live_arrows(page, lab, name)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"window.delays.length > {N_PRESSES + 1}", timeout=10_000)
    assert picture(lab) != before


@pytest.mark.parametrize("name", ["delay", "lambda2", "lag"])
def test_arrow_keys_on_a_slider_change_the_picture_of_the_paper_mode(notebook: Any, name: str) -> None:
    changes_by_arrows(notebook, live_lab(notebook, "The scoring lab"), name)


def test_menu_changes_the_mode_its_sliders_follow_and_the_lag_moves_the_expected_speed(notebook: Any) -> None:
    lab = live_lab(notebook, "The scoring lab")
    before = picture(lab)
    lab.locator('select[data-name="mode"]').select_option("recommended")
    assert picture(lab) != before
    assert lab.locator('input[data-name="delay"]').input_value() == "0.1"
    assert lab.locator("code").inner_text().startswith("HarmonyParams")
    press_live_arrows(notebook, lab, "lag")


def test_fast_key_presses_end_at_the_last_value(notebook: Any) -> None:
    lab = live_lab(notebook, "The scoring lab")
    lag = lab.locator('input[data-name="lag"]')
    lag.focus()
    before, shown = float(lag.input_value()), picture(lab)
    for _ in range(10):
        notebook.keyboard.press("ArrowRight")
    assert float(lag.input_value()) == pytest.approx(before + 10 * LAG_STEP)
    assert picture(lab) != shown


def test_settings_of_the_page_reach_python(notebook: Any) -> None:
    live_lab(notebook, "The scoring lab").get_by_role("button", name="50 ms").click()
    notebook.wait_for_timeout(1000)
    notebook.locator(".jp-CodeCell").last.click()
    notebook.keyboard.press("Escape")
    notebook.keyboard.press("b")
    notebook.keyboard.press("Enter")
    notebook.keyboard.type("lab.line")
    notebook.keyboard.press("Shift+Enter")
    notebook.get_by_text("'HarmonyParams(reaction_delay=0.05)'").wait_for(timeout=30_000)


# The other labs, one a cell, the corpus lab on 200 clips

CELLS = (
    """from dataclasses import replace
from harmolab.data.synthetic import ClipSettings, planted_clip, synthetic_clip
from harmolab.lab import corpus_lab, detector_lab, meter_lab, saliency_lab
planted = planted_clip(ClipSettings("cha-cha", seconds=8.0, jitter=0.03, seed=1))
song = synthetic_clip("rumba", seconds=18.0, seed=2)
kinds = ("cha-cha", "jive", "quickstep", "rumba", "samba", "tango", "waltz", "cha-cha")
clips = [synthetic_clip(kind, seconds=6.0, jitter=0.1, seed=seed) for seed, kind in enumerate(kinds)] * 25
clips = [replace(clip, name=f"{place}: {clip.dance}") for place, clip in enumerate(clips)]""",
    "detector_lab(planted.clip, planted=planted.visual_beat_times, smoothing=0.15, position_smoothing=0.15)",
    "meter_lab(song, annotated=song.beats, error=0.5)",
    "saliency_lab(planted.clip, lambda1=2.0)",
    "corpus_lab(clips, delay=0.15, clip=100)",
    # A picture in the last cell tells that everything has been run.
    "import matplotlib.pyplot as plt\nplt.plot([0, 1])",
)


def written(path: Path, *cells: str) -> Path:
    """The file of a notebook with these cells of code."""
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    nbformat.write(new_notebook(cells=[*map(new_code_cell, cells)], metadata={"kernelspec": kernel}), path)
    return path


@pytest.fixture(scope="module")
def labs(tmp_path_factory: pytest.TempPathFactory, chromium: Any) -> Iterator[Any]:
    """A browser tab with these four labs, one a cell."""
    path = written(tmp_path_factory.mktemp("source") / "labs.ipynb", *CELLS)
    with running_jupyterlab(tmp_path_factory.mktemp("lab"), path) as address:
        yield notebook_run(address, chromium)


@cases(
    "title, name",
    ("The detector lab", "smoothing"),
    ("The meter lab", "error"),
    ("The saliency lab", "lambda1"),
    ("The saliency lab", "lambda2"),
    ("The corpus lab", "delay"),
    ("The corpus lab", "late"),
    ("The corpus lab", "clip"),
)
def test_arrow_keys_on_a_slider_of_a_live_lab_change_its_picture(labs: Any, title: str, name: str) -> None:
    changes_by_arrows(labs, live_lab(labs, title), name)


# Names and numbers under a lab, and where their letters are: left, top, right, bottom.
LETTERS = """board => [...board.querySelectorAll("dt, dd")].map(node => {
    const range = document.createRange();
    range.selectNodeContents(node);
    const { left, top, right, bottom } = range.getBoundingClientRect();
    return [node.textContent, left, top, right, bottom];
})"""
SHARED = 1.0  # pixels that two boxes may share: the browser rounds


def overlaps(boxes: list[list[Any]]) -> list[tuple[str, str]]:
    """Names of the boxes that lie on one another."""
    return [
        (one[0], other[0])
        for one, other in combinations(boxes, 2)
        if all(min(one[3 + axis], other[3 + axis]) - max(one[1 + axis], other[1 + axis]) > SHARED for axis in (0, 1))
    ]


def test_boxes_that_lie_on_one_another_are_named() -> None:
    boxes = [["a", 0, 0, 10, 10], ["b", 9.5, 0, 20, 10], ["c", 5, 5, 15, 15], ["d", 0, 40, 10, 50]]
    assert overlaps(boxes) == [("a", "c"), ("b", "c")]


@pytest.mark.parametrize("width", [1280, 900])
def test_numbers_under_the_labs_do_not_overprint(labs: Any, width: int) -> None:
    labs.set_viewport_size({"width": width, "height": 1000})
    for title in ("The detector lab", "The meter lab", "The saliency lab", "The corpus lab"):
        lab = live_lab(labs, title)
        boxes = lab.locator(".board").evaluate(LETTERS)
        assert len(boxes) >= 4 and all(box[3] > box[1] and box[4] > box[2] for box in boxes)
        assert overlaps(boxes) == [], title


@pytest.mark.parametrize("width", [1400, 700])
def test_the_chosen_dance_opens_in_a_player_that_plays(labs: Any, width: int) -> None:
    labs.set_viewport_size({"width": width, "height": 1000})
    lab = live_lab(labs, "The corpus lab")
    clip = lab.locator('input[data-name="clip"]')
    clip.focus()
    labs.keyboard.press("ArrowRight")
    name = clip.get_attribute("aria-valuetext")
    labs.wait_for_timeout(500)
    lab.get_by_role("button", name="Open the chosen dance").click()
    opened = lab.locator(f'iframe[title="{name}: player"]')
    opened.wait_for(timeout=20_000)
    player = opened.element_handle().content_frame()
    player.wait_for_selector("#play")
    player.evaluate("harmolabPlayer.ready")
    assert player.locator("h1").inner_text() == name
    play(player)
    shown = lab.locator("iframe").get_attribute("srcdoc")
    press_live_arrows(labs, lab, "lag")
    assert lab.locator("iframe").get_attribute("srcdoc") == shown
    player.evaluate("harmolabPlayer.pause()")


# A rater in a browser

N = 4
WAIT = 20_000  # milliseconds
FRAME = "iframe[title^=Dance]"
STUDY = "iframe[title='Listening study']"


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=5.0)


def trials_of(kind: str) -> TrialSet:
    items = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(N)]
    return make_trials(items, kind=kind, n=N, seed=1, rater="Ada")


@pytest.fixture(params=["pick", "choice"])
def asked(request: pytest.FixtureRequest, clip: Clip, tmp_path: Path) -> Iterator[tuple[str, TrialSet, AnswerLog]]:
    """Address of a study, its trials and its log."""
    trials, log = trials_of(request.param), AnswerLog(tmp_path / "answers.jsonl")
    shown = blind_page(clip.audio, [clip.motion] * (1 if request.param == "pick" else 2))
    with StudyServer(trials, log, lambda trial: shown).running() as address:
        yield address, trials, log


def player_in(page: Any) -> Any:
    """The frame of the player, ready."""
    page.locator(FRAME).scroll_into_view_if_needed(timeout=WAIT)  # it is loaded when it comes into view
    page.frame_locator(FRAME).locator("#play").wait_for(timeout=WAIT)
    frame = page.locator(FRAME).element_handle().content_frame()
    frame.wait_for_function("window.harmolabPlayer", timeout=WAIT)
    frame.evaluate("harmolabPlayer.ready")
    return frame


def test_rater_plays_answers_reloads_and_is_thanked(chromium: Any, asked: tuple[str, TrialSet, AnswerLog]) -> None:
    address, trials, log = asked
    page = at_address(chromium, address)
    for number in range(1, N + 1):
        page.get_by_text(f"Trial {number} of {N}").wait_for(timeout=WAIT)
        frame = player_in(page)
        before = picture(frame, ".stage")
        play(frame)
        assert picture(frame, ".stage") != before
        if number == 3:
            page.reload()
            page.get_by_text(f"Trial 3 of {N}").wait_for(timeout=WAIT)
        page.get_by_role("button", name=trials.choices[number % 2], exact=True).click()
        page.get_by_text(f"Trial {number + 1} of {N}" if number < N else "Thank you").wait_for(timeout=WAIT)
        assert [answer.trial for answer in log.read().answers] == [one.id for one in trials.trials[:number]]
    assert [answer.choice for answer in log.read().answers] == [trials.choices[number % 2] for number in (1, 2, 3, 4)]
    closed(page)


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_question_player_and_answers_fit_on_one_screen(
    chromium: Any, asked: tuple[str, TrialSet, AnswerLog], viewport: dict[str, int]
) -> None:
    page = at_address(chromium, asked[0], viewport)
    frame = player_in(page)
    page.wait_for_function("document.querySelector('iframe').contentDocument.documentElement.scrollHeight <= "
                           "document.querySelector('iframe').clientHeight", timeout=WAIT)  # fmt: skip
    assert fits(page, viewport)
    assert frame.evaluate("document.documentElement.scrollWidth <= innerWidth")
    heights = page.eval_on_selector_all("form button", "buttons => buttons.map(button => button.clientHeight)")
    assert min(heights) >= 44  # for a thumb
    closed(page)


def test_keys_play_and_seek_in_the_player(chromium: Any, asked: tuple[str, TrialSet, AnswerLog]) -> None:
    page = at_address(chromium, asked[0])
    frame = player_in(page)
    frame.focus(".stage")
    page.keyboard.press("ArrowRight")
    frame.wait_for_function("Math.abs(harmolabPlayer.time() - 1) < 0.05", timeout=WAIT)
    page.keyboard.press(" ")
    frame.wait_for_function("harmolabPlayer.time() > 1.3", timeout=WAIT)
    page.keyboard.press(" ")
    frame.wait_for_function("document.querySelector('#play').textContent === 'Play'", timeout=WAIT)
    closed(page)


CELL = """from pathlib import Path
import harmolab
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.trials import Item, make_trials
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.player import blind_page
clip = harmolab.synthetic_clip("cha-cha", seconds=5.0, seed=1)
items = [Item(f"clip {n}", {"true": f"{n} t", "lagged": f"{n} l"}) for n in range(4)]
trials = make_trials(items, kind="pick", n=4, seed=1, rater="Ada")
page = blind_page(clip.audio, [clip.motion])
StudyServer(trials, AnswerLog("answers.jsonl"), lambda trial: page).start()"""


def test_page_framed_in_jupyterlab_plays_and_its_buttons_answer(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    with running_jupyterlab(tmp_path / "lab", written(tmp_path / "study.ipynb", CELL)) as address:
        tab = started(address, chromium, WIDE)
        log = AnswerLog(tmp_path / "lab" / "work" / "answers.jsonl")
        for number in range(1, N + 1):
            tab.locator(STUDY).scroll_into_view_if_needed(timeout=120_000)  # it is loaded when it comes into view
            study = tab.locator(STUDY).element_handle().content_frame()
            study.get_by_text(f"Trial {number} of {N}").wait_for(timeout=WAIT)
            frame = player_in(study)
            play(frame)
            assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
            study.get_by_role("button", name="inharmonious", exact=True).click()
            study.get_by_text(f"Trial {number + 1} of {N}" if number < N else "Thank you").wait_for(timeout=WAIT)
            assert len(log.read().answers) == number
        tab.close()
    assert {answer.choice for answer in log.read().answers} == {"inharmonious"}


# A person at the tap page

PERIOD = 1.0  # seconds: slow, so that a click that comes late on a busy machine is still a steady tap


@pytest.fixture
def kept() -> list[TappedBeats]:
    return []


@pytest.fixture
def address(click_track: Callable[..., Audio], kept: list[TappedBeats], tmp_path: Path) -> Iterator[str]:
    audio = click_track(60 / PERIOD, seconds=30.0)

    def save(taps: np.ndarray, ones: np.ndarray) -> str:
        kept.append(tapped_beats(audio, taps, ones, meter=3))
        return "Kept."

    with TapServer("song.wav", audio, save).running() as address:
        yield address


def at_beat(page: Any, beat: int) -> None:
    """Wait until the song plays this beat."""
    page.wait_for_function(f"harmolabTaps.sound.currentTime >= {beat * PERIOD}", polling=5, timeout=WAIT)


def tap_page(chromium: Any, address: str, viewport: dict[str, int] = WIDE) -> Any:
    """The page on which a song is tapped, ready."""
    page = at_address(chromium, address, viewport)
    page.get_by_text("Ready.").wait_for(timeout=WAIT)
    return page


def test_taps_of_keys_become_the_beats_of_the_song(chromium: Any, address: str, kept: list[TappedBeats]) -> None:
    page = tap_page(chromium, address)
    page.keyboard.press("p")
    for beat in range(2, 16):
        at_beat(page, beat)
        page.keyboard.press("Enter" if beat % 6 == 2 else "1" if beat % 6 == 5 else " ")
    assert page.evaluate("harmolabTaps.tempo()") == pytest.approx(60 / PERIOD, rel=0.05)
    assert page.locator("#count").inner_text() == "14 taps, 5 of them ONE"
    page.keyboard.press("s")
    page.get_by_text("Kept. You can close this page.").wait_for(timeout=WAIT)
    track = kept[0].track
    assert track.tempo == pytest.approx(60 / PERIOD, rel=0.01)
    assert len(track) >= 29
    assert track.bar_places[np.abs(track.times - 2 * PERIOD).argmin()] == 0
    closed(page)


def test_thumbs_tap_on_a_phone_and_a_refusal_can_be_mended(
    chromium: Any, address: str, kept: list[TappedBeats]
) -> None:
    page = tap_page(chromium, address, PHONE)
    page.click("#tap")
    page.get_by_text("Play the song first").wait_for(timeout=WAIT)
    page.click("#play")
    for beat in (1, 2, 3, 4, 4, 5, 7, 9, 10, 12):
        at_beat(page, beat)
        page.click("#one" if beat == 4 else "#tap")
    page.evaluate("harmolabTaps.taps().push(99)")
    page.click("#save")
    page.get_by_text("Not saved: taps must lie in the song").wait_for(timeout=WAIT)
    page.evaluate("harmolabTaps.taps().pop()")
    page.click("#save")
    page.get_by_text("Kept.").wait_for(timeout=WAIT)
    assert kept[0].track.tempo == pytest.approx(60 / PERIOD, rel=0.01)
    page.faults = [fault for fault in page.faults if "400" not in fault]
    closed(page)


def test_starting_again_forgets_all_taps(chromium: Any, address: str) -> None:
    page = tap_page(chromium, address)
    page.keyboard.press("p")
    at_beat(page, 1)
    page.keyboard.press(" ")
    page.keyboard.press("r")
    assert page.evaluate("[harmolabTaps.taps().length, harmolabTaps.sound.currentTime]") == [0, 0]
    assert page.locator("#save").is_disabled()
    closed(page)


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_all_fits_on_one_screen_with_pads_for_thumbs(chromium: Any, address: str, viewport: dict[str, int]) -> None:
    page = tap_page(chromium, address, viewport)
    assert fits(page, viewport)
    heights = page.eval_on_selector_all("button", "buttons => buttons.map(button => button.clientHeight)")
    assert min(heights) >= 44
    assert max(heights) >= 200
    closed(page)
