"""The Explorer: values to picture, picture to bundle, and once in a real JupyterLab."""

from __future__ import annotations

import base64
import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import ipywidgets
import nbformat
import numpy as np
import pytest
from matplotlib.figure import Figure
from nbformat.v4 import new_code_cell, new_notebook

from harmolab.viz.style import figure_style
from harmolab.widgets.explorer import Explorer

ROOT = Path(__file__).resolve().parents[1]
PNG = b"\x89PNG\r\n"


def draw_level(level: float, figure: Figure | None = None) -> Figure:
    """A horizontal line at `level`, on the axes of last time if there are some."""
    figure = Figure(figsize=(3, 2)) if figure is None else figure
    (ax,) = figure.axes or [figure.subplots()]
    ax.axhline(level)
    ax.set_ylim(0, 10)
    return figure


def draw_fresh(level: float) -> Figure:
    """The same line on a figure of its own."""
    return draw_level(level)


def draw_new_axes(level: float, figure: Figure) -> Figure:
    """The same line by a function that knows nothing of keeping axes."""
    ax = figure.subplots()
    ax.axhline(level)
    ax.set_ylim(0, 10)
    return figure


@pytest.mark.parametrize("draw", [draw_level, draw_fresh, draw_new_axes])
def test_moving_a_control_changes_the_picture_and_moving_it_back_restores_it(draw: Callable[..., Figure]):
    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    first = explorer.png
    explorer.controls["level"].value = 7.5
    assert explorer.values == {"level": 7.5}
    assert explorer.png.startswith(PNG)
    assert explorer.png != first
    explorer.controls["level"].value = 2.0
    assert explorer.png == first


def test_axes_that_are_kept_hold_only_the_latest_drawing():
    seen = []

    def draw(level: float, figure: Figure) -> Figure:
        draw_level(level, figure).axes[0].text(0.5, 0.5, "a")
        seen.append((figure.axes[0], [line.get_ydata()[0] for line in figure.axes[0].lines], len(figure.axes[0].texts)))
        return figure

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert [state[1:] for state in seen] == [([2.0], 1), ([3.0], 1)]
    assert seen[0][0] is seen[1][0]


def test_picture_equals_the_one_that_draw_makes_when_called_directly():
    explorer = Explorer(draw_fresh, level=(0, 10, 1, 2))
    explorer.controls["level"].value = 9
    assert explorer.png == Explorer(draw_fresh, level=(0, 10, 1, 9)).png


def test_figure_made_by_pyplot_is_closed_after_its_picture_was_taken():
    from matplotlib import pyplot

    def draw(level: float) -> Figure:
        figure, ax = pyplot.subplots()
        ax.axhline(level)
        return figure

    before = pyplot.get_fignums()
    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert pyplot.get_fignums() == before


def test_mime_bundle_holds_the_picture_beside_the_live_widget():
    explorer = Explorer(draw_level, level=(0.0, 10.0, 0.5, 2.0))
    bundle = explorer._repr_mimebundle_()
    assert base64.b64decode(bundle["image/png"]) == explorer.png
    assert "application/vnd.jupyter.widget-view+json" in bundle


@pytest.mark.parametrize(
    ("spec", "kind", "value"),
    [
        ((0.0, 1.0, 0.25, 0.5), ipywidgets.FloatSlider, 0.5),
        ((0, 8, 2, 4), ipywidgets.IntSlider, 4),
        (True, ipywidgets.Checkbox, True),
        (["valleys", "peaks"], ipywidgets.Dropdown, "valleys"),
        ({"low": 0.1, "high": 0.9}, ipywidgets.Dropdown, 0.1),
    ],
)
def test_each_kind_of_control_becomes_its_widget_with_a_label(spec: object, kind: type, value: object):
    explorer = Explorer(lambda reaction_delay: Figure(), reaction_delay=spec)
    control = explorer.controls["reaction_delay"]
    assert type(control) is kind
    assert control.description == "reaction delay"
    assert explorer.values == {"reaction_delay": value}


def test_sliders_follow_while_they_are_dragged():
    explorer = Explorer(draw_level, level=(0.0, 10.0, 0.5, 2.0))
    assert explorer.controls["level"].continuous_update is True


@pytest.mark.parametrize("spec", [(5.0, 1.0, 0.1, 2.0), (0.0, 1.0, 0.1, 2.0), (0.0, 1.0), [], "text", 3.0])
def test_control_that_means_nothing_is_refused_by_name(spec: object):
    with pytest.raises(ValueError, match="control 'level' must be"):
        Explorer(draw_level, level=spec)


def test_error_in_the_first_drawing_is_raised():
    def draw(level: float) -> Figure:
        raise KeyError(level)

    with pytest.raises(KeyError):
        Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))


def test_later_error_is_shown_with_its_place_and_goes_when_the_next_drawing_succeeds():
    def draw(level: float) -> Figure:
        if level > 5:
            raise ValueError("level <5> exceeded")
        return draw_fresh(level)

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    first = explorer.png
    explorer.controls["level"].value = 6.0
    assert explorer.error.startswith("ValueError: level <5> exceeded (test_widgets.py, line ")
    assert explorer.png == first
    explorer.controls["level"].value = 3.0
    assert explorer.error == ""
    assert explorer.png != first


def test_change_that_arrives_while_drawing_leads_to_one_more_picture():
    drawn = []

    def draw(level: float) -> Figure:
        drawn.append(level)
        if level == 3.0:  # as if the reader had moved on twice meanwhile
            explorer.controls["level"].value = 4.0
            explorer.controls["level"].value = 5.0
        return draw_fresh(level)

    explorer = Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    explorer.controls["level"].value = 3.0
    assert drawn == [2.0, 3.0, 5.0]


def test_pictures_are_drawn_in_the_style_of_the_project():
    def draw(level: float) -> Figure:
        figure = draw_fresh(level)
        shown.append(figure.axes[0].spines["top"].get_visible())
        return figure

    shown: list[bool] = []
    Explorer(draw, level=(0.0, 10.0, 0.5, 2.0))
    with figure_style():
        expected = draw_fresh(2.0).axes[0].spines["top"].get_visible()
    assert shown == [expected] == [False]


LAB_CODE = """
import numpy as np
from harmolab.widgets.explorer import Explorer
times = np.linspace(0, 6, 800)
def draw(hertz, delay, figure):
    speed, fields = figure.axes or figure.subplots(2, 1, sharex=True)
    speed.plot(times, np.abs(np.sin(hertz * times)), label="joint speed")
    speed.legend(loc="upper right")
    beats = np.arange(0.25, 6, 0.5)
    fields.broken_barh([(beat - delay, 2 * delay) for beat in beats], (0, 1), alpha=0.2)
    fields.vlines(beats, 0, 1)
    fields.set(xlabel="time (s)", ylabel="strength", title=f"delay {delay:.2f} s")
    return figure
Explorer(draw, hertz=(0.5, 8.0, 0.1, 1.0), delay=(0.0, 0.25, 0.005, 0.1))
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def jupyterlab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a JupyterLab that shows a folder with one lab in it."""
    folder = tmp_path_factory.mktemp("lab")
    settings = folder / "settings" / "@jupyterlab"
    for extension, text in {
        "notebook-extension/tracker": '{"windowingMode": "none"}',  # cells out of sight are otherwise not in the page
        "apputils-extension/notification": '{"fetchNews": "false", "checkForUpdates": false}',
    }.items():
        (settings / extension).parent.mkdir(parents=True)
        (settings / f"{extension}.jupyterlab-settings").write_text(text)
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    nbformat.write(new_notebook(cells=[new_code_cell(LAB_CODE)], metadata=kernel), folder / "lab.ipynb")
    address = f"http://127.0.0.1:{(port := free_port())}"
    options = {
        "ServerApp.ip": "127.0.0.1",
        "ServerApp.port": port,
        "ServerApp.root_dir": folder,
        "IdentityProvider.token": "",
        "LabApp.user_settings_dir": folder / "settings",
        "LabApp.workspaces_dir": folder / "workspaces",
    }
    arguments = [f"--{name}={value}" for name, value in options.items()]
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    with (folder / "server.log").open("w") as log:
        command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", *arguments]
        server = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=environment)
        try:
            wait_for(address, server, folder / "server.log")
            yield address
        finally:
            server.terminate()
            server.wait(timeout=20)


def wait_for(address: str, server: subprocess.Popen, log: Path) -> None:
    for _ in range(120):
        if server.poll() is not None:
            break
        try:
            urllib.request.urlopen(f"{address}/api", timeout=2).close()
            return
        except OSError:
            time.sleep(0.5)
    pytest.fail(f"JupyterLab did not start:\n{log.read_text()[-2000:]}")


@pytest.fixture
def page(jupyterlab: str) -> Iterator[object]:
    """A browser tab with the lab run in it."""
    playwright = pytest.importorskip("playwright.sync_api")
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with playwright.sync_playwright() as session:
        if browser_path is None and not Path(session.chromium.executable_path).is_file():
            pytest.skip("no Chromium here: install chromium, or run `playwright install chromium`")
        browser = session.chromium.launch(executable_path=browser_path, args=["--no-sandbox", "--disable-gpu"])
        tab = browser.new_page(viewport={"width": 1300, "height": 900})
        tab.goto(f"{jupyterlab}/lab/tree/lab.ipynb?reset")
        tab.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=60_000)
        for _ in range(6):  # keys pressed before the kernel is there are lost
            tab.click(".jp-CodeCell .cm-content")
            tab.keyboard.press("Control+Enter")
            with contextlib.suppress(playwright.TimeoutError):
                tab.wait_for_selector("img.widget-image", timeout=20_000)
                break
        yield tab
        browser.close()


COUNT_PICTURES = """() => {
    window.delays = [];
    const picture = document.querySelector("img.widget-image");
    document.addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
    picture.addEventListener("load", () => window.delays.push(performance.now() - window.pressed));
}"""


@pytest.mark.browser
def test_key_press_in_jupyterlab_brings_the_new_picture_within_a_tenth_of_a_second(page):
    page.evaluate(COUNT_PICTURES)
    page.locator(".noUi-handle").first.focus()
    for press in range(40):
        page.keyboard.press("ArrowRight")
        page.wait_for_function(f"window.delays.length > {press}", timeout=10_000)
    delays = np.array(page.evaluate("window.delays"))[5:]
    print(f"key press to picture: median {np.median(delays):.0f} ms, p90 {np.percentile(delays, 90):.0f} ms")
    if folder := os.environ.get("HARMOLAB_SCREENSHOTS"):
        page.screenshot(path=Path(folder) / "explorer.png")
    assert np.percentile(delays, 90) <= 100


@pytest.mark.browser
def test_fast_key_presses_in_jupyterlab_end_at_the_last_value(page):
    page.locator(".noUi-handle").first.focus()
    before = page.locator("img.widget-image").get_attribute("src")
    for _ in range(30):
        page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "src => document.querySelector('.widget-readout').textContent.startsWith('4.0')"
        " && document.querySelector('img.widget-image').src !== src",
        arg=before,
        timeout=10_000,
    )
