"""Labs in a real JupyterLab, driven by the keyboard in a headless Chromium."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCORING_LAB = Path(__file__).resolve().parents[1] / "notebooks" / "04_salience_and_scoring.ipynb"

LAB_CODE = """
import numpy as np
from harmolab.widgets.explorer import Explorer
times = np.linspace(0, 6, 800)
def draw(hertz, delay, figure):
    speed, fields = figure.axes or figure.subplots(2, 1, sharex=True)
    speed.plot(times, np.abs(np.sin(hertz * times)), label="joint speed")
    speed.set_ylim(0, 1.3)
    speed.legend(loc="upper right")
    beats = np.arange(0.25, 6, 0.5)
    fields.broken_barh([(beat - delay, 2 * delay) for beat in beats], (0, 1), alpha=0.2)
    fields.vlines(beats, 0, 1)
    fields.set(xlabel="time (s)", ylabel="strength", title=f"delay {delay:.2f} s")
    return figure
Explorer(draw, hertz=(0.5, 8.0, 0.1, 1.0), delay=(0.0, 0.25, 0.005, 0.1))
"""


def prepare(folder: Path) -> None:
    """Fills JupyterLab's folder: two notebooks, and settings that keep its own dialogues away."""
    settings = folder / "settings" / "@jupyterlab"
    for extension, text in {
        "notebook-extension/tracker": '{"windowingMode": "none"}',  # cells out of sight are otherwise not in the page
        "apputils-extension/notification": '{"fetchNews": "false", "checkForUpdates": false}',
    }.items():
        (settings / extension).parent.mkdir(parents=True)
        (settings / f"{extension}.jupyterlab-settings").write_text(text)
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    nbformat.write(new_notebook(cells=[new_code_cell(LAB_CODE)], metadata=kernel), folder / "lab.ipynb")
    shutil.copy(SCORING_LAB, folder)


@pytest.fixture(scope="module")
def jupyterlab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a running JupyterLab."""
    folder = tmp_path_factory.mktemp("lab")
    prepare(folder)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    options = {
        "ServerApp.ip": "127.0.0.1",
        "ServerApp.port": port,
        "ServerApp.root_dir": folder,
        "IdentityProvider.token": "",
        "LabApp.expose_app_in_browser": True,
        "LabApp.user_settings_dir": folder / "settings",
        "LabApp.workspaces_dir": folder / "workspaces",
    }
    arguments = [f"--{name}={value}" for name, value in options.items()]
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    with (folder / "server.log").open("w") as log:
        command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", *arguments]
        server = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=environment)
        try:
            wait_for(f"http://127.0.0.1:{port}", server, folder / "server.log")
            yield f"http://127.0.0.1:{port}"
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
def tab(jupyterlab: str) -> Iterator[Any]:
    """An empty tab of a headless Chromium."""
    playwright = pytest.importorskip("playwright.sync_api")
    path = shutil.which("chromium") or shutil.which("google-chrome")
    with playwright.sync_playwright() as session:
        if path is None and not Path(session.chromium.executable_path).is_file():
            pytest.skip("no Chromium here: install chromium, or run `playwright install chromium`")
        browser = session.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser.new_page(viewport={"width": 1300, "height": 1000})
        browser.close()


def wait_until_idle(address: str, notebook: str) -> None:
    """Until the notebook's kernel has nothing to do and the page is connected to it."""
    for _ in range(360):
        with urllib.request.urlopen(f"{address}/api/sessions", timeout=5) as answer:
            kernels = [session["kernel"] for session in json.load(answer) if session["path"] == notebook]
        if any(kernel["connections"] and kernel["execution_state"] == "idle" for kernel in kernels):
            return
        time.sleep(0.5)
    pytest.fail(f"the kernel of {notebook} did not become idle")


def run_notebook(tab: Any, address: str, notebook: str) -> None:
    """Opens a notebook and runs all of it."""
    tab.goto(f"{address}/lab/tree/{notebook}?reset")
    tab.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=60_000)
    wait_until_idle(address, notebook)  # asked to run before, JupyterLab wants to know with which kernel
    tab.evaluate("() => { window.jupyterapp.commands.execute('notebook:run-all-cells'); }")
    tab.wait_for_selector("img.widget-image", timeout=120_000)
    wait_until_idle(address, notebook)  # sliders wait for a busy kernel


COUNT_PICTURES = """() => {
    window.delays = [];
    const picture = document.querySelector("img.widget-image");
    document.addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
    picture.addEventListener("load", () => window.delays.push(performance.now() - window.pressed));
}"""


def press_and_time(tab: Any, control: str, key: str) -> np.ndarray:
    """Milliseconds from each of twenty key presses on the control so labelled to its picture."""
    tab.evaluate("() => { window.delays = []; }")
    tab.locator(".widget-slider", has_text=control).locator(".noUi-handle").focus()
    for press in range(20):
        tab.keyboard.press(key)
        tab.wait_for_function(f"window.delays.length > {press}", timeout=10_000)
    return np.array(tab.evaluate("window.delays"))


def keep_screenshot(tab: Any, name: str) -> None:
    if folder := os.environ.get("HARMOLAB_SCREENSHOTS"):
        tab.locator("img.widget-image").scroll_into_view_if_needed()
        tab.screenshot(path=Path(folder) / name)


@pytest.mark.parametrize(("notebook", "control"), [("lab.ipynb", "hertz"), (SCORING_LAB.name, "T_delay")])
def test_key_press_brings_the_new_picture_within_a_tenth_of_a_second(
    tab: Any, jupyterlab: str, notebook: str, control: str
):
    run_notebook(tab, jupyterlab, notebook)
    tab.evaluate(COUNT_PICTURES)
    slowest_tenth = []
    for key in ["ArrowRight", "ArrowLeft"] * 3:  # the best of a few rounds: other programs may be busy
        delays = press_and_time(tab, control, key)
        slowest_tenth.append(np.percentile(delays, 90))
        print(f"{notebook}: median {np.median(delays):.0f} ms, 90th percentile {slowest_tenth[-1]:.0f} ms")
    keep_screenshot(tab, f"{notebook}.png")
    assert min(slowest_tenth) <= 100


def test_fast_key_presses_end_at_the_last_value(tab: Any, jupyterlab: str):
    run_notebook(tab, jupyterlab, "lab.ipynb")
    tab.locator(".noUi-handle").first.focus()
    before = tab.locator("img.widget-image").get_attribute("src")
    for _ in range(30):
        tab.keyboard.press("ArrowRight")
    tab.wait_for_function(
        "src => document.querySelector('.widget-readout').textContent.startsWith('4.0')"
        " && document.querySelector('img.widget-image').src !== src",
        arg=before,
        timeout=10_000,
    )
