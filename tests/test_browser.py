"""Notebook 04 in a real JupyterLab: run all, move sliders by keyboard, see the picture change."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
TOKEN = "a-token-for-this-test"
N_PRESSES = 40
LAG_STEP = 0.02  # seconds, of the lab's lag slider

pytestmark = pytest.mark.browser


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


@pytest.fixture(scope="module")
def jupyterlab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a JupyterLab on a copy of notebook 04."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "work").mkdir()
    shutil.copy(ROOT / "notebooks" / "04_salience_and_scoring.ipynb", folder / "work" / "lab.ipynb")
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


@pytest.fixture(scope="module")
def page(jupyterlab: str, chromium: Any) -> Iterator[object]:
    """A browser tab in which the whole notebook has been run."""
    tab = chromium.new_page(viewport={"width": 1400, "height": 1000})
    tab.goto(f"{jupyterlab}/lab/tree/lab.ipynb?reset&token={TOKEN}")
    tab.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=60_000)
    # Run without a kernel, and JupyterLab asks for one.
    tab.locator("#jp-main-statusbar").filter(has_text=re.compile(r"Python 3.*Idle")).wait_for(timeout=90_000)
    tab.get_by_role("menuitem", name="Run", exact=True).click()
    tab.locator('[data-command="runmenu:run-all"]').click()
    tab.wait_for_selector("img.widget-image", timeout=180_000)
    # The last cell's figure: everything has been run, and the kernel has nothing else to do.
    tab.locator(".jp-CodeCell").last.locator("img").wait_for(timeout=180_000)
    yield tab
    tab.close()


COUNT_PICTURES = """() => {
    window.delays = [];
    if (window.watched) return;
    window.watched = true;
    const picture = document.querySelector("img.widget-image");
    document.addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
    picture.addEventListener("load", () => window.delays.push(performance.now() - window.pressed));
}"""


def pixels(page: object) -> str:
    """The lab's picture as the browser shows it now, as base64."""
    return page.evaluate("""async () => {
        const blob = await (await fetch(document.querySelector("img.widget-image").src)).blob();
        const bytes = new Uint8Array(await blob.arrayBuffer());
        return btoa(bytes.reduce((text, byte) => text + String.fromCharCode(byte), ""));
    }""")


def press_arrows(page: object, label: str) -> np.ndarray:
    """Milliseconds from each press of an arrow key on the slider of that label to the new picture."""
    page.evaluate(COUNT_PICTURES)
    page.locator(".widget-slider").filter(has_text=label).locator(".noUi-handle").focus()
    for press in range(N_PRESSES):
        # There and back, so that the slider never arrives at its end.
        page.keyboard.press("ArrowLeft" if press % 20 < 10 else "ArrowRight")
        page.wait_for_function(f"window.delays.length > {press}", timeout=10_000)
    return np.array(page.evaluate("window.delays"))


def screenshot(page: object, name: str) -> None:
    """Kept where HARMOLAB_SCREENSHOTS says, for the eye."""
    if folder := os.environ.get("HARMOLAB_SCREENSHOTS"):
        page.locator("img.widget-image").scroll_into_view_if_needed()
        page.screenshot(path=Path(folder) / f"{name}.png")


def report(what: str, delays: np.ndarray) -> None:
    """Prints the times; holds them to a tenth of a second where HARMOLAB_TIMING asks for it."""
    high = np.percentile(delays[5:], 90)
    print(f"{what}: key press to picture, median {np.median(delays[5:]):.0f} ms, p90 {high:.0f} ms")
    if os.environ.get("HARMOLAB_TIMING"):
        assert high <= 100


@pytest.mark.parametrize("label", ["T_delay", "λ2", "lag"])
def test_arrow_keys_on_a_slider_change_the_picture_of_the_paper_mode(page: object, label: str) -> None:
    before = pixels(page)
    delays = press_arrows(page, label)
    page.keyboard.press("ArrowLeft")
    page.wait_for_function(f"window.delays.length > {N_PRESSES}", timeout=10_000)
    assert pixels(page) != before
    screenshot(page, f"lab_paper_{label}")
    report(f"paper, {label}", delays)


def test_menu_changes_the_mode_its_sliders_follow_and_the_lag_moves_the_expected_speed(page: object) -> None:
    before = pixels(page)
    page.evaluate(COUNT_PICTURES)
    page.locator(".widget-dropdown").filter(has_text="mode").locator("select").select_option("recommended")
    delay = page.locator(".widget-slider").filter(has_text="T_delay").locator(".widget-readout")
    page.wait_for_function("window.delays.length > 0", timeout=10_000)
    assert pixels(page) != before
    assert delay.inner_text() == "0.10"
    delays = press_arrows(page, "lag")
    screenshot(page, "lab_recommended")
    report("recommended, lag", delays)


def test_fast_key_presses_end_at_the_last_value(page: object) -> None:
    slider = page.locator(".widget-slider").filter(has_text="lag")
    slider.locator(".noUi-handle").focus()
    before, shown = float(slider.locator(".widget-readout").inner_text()), pixels(page)
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    page.wait_for_timeout(1500)
    assert float(slider.locator(".widget-readout").inner_text()) == pytest.approx(before + 10 * LAG_STEP)
    assert pixels(page) != shown
