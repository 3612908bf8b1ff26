"""Time from an event at a slider of a lab to the finished picture, in Chromium, milliseconds: median, 90 %, worst.

"drawn" ends when the picture stands on the canvas, "shown" at the second frame of the screen after that, when it has
certainly been shown. Each slider of each page is pressed one step to and fro.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

from harmolab.lab import write_lab_pages

N_MOVES = 240
MOVES = """async ([count, names]) => {
  const drawn = [], shown = [], frame = () => new Promise(requestAnimationFrame);
  for (let move = 0; move < count; move++) {
    const input = document.querySelector(`input[data-name="${names[move % names.length]}"]`);
    const step = Number(input.step), way = Math.floor(move / names.length) % 20 < 10 ? 1 : -1;
    await frame();
    const before = performance.now();
    input.valueAsNumber += way * step;
    input.dispatchEvent(new Event("input", { bubbles: true }));
    drawn.push(performance.now() - before);
    await frame(); await frame();
    shown.push(performance.now() - before);
  }
  return { drawn, shown };
}"""


def measure() -> dict[str, dict[str, list[float]]]:
    """Page -> "drawn" and "shown" -> milliseconds of every move."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as session:
        program = shutil.which("chromium") or shutil.which("google-chrome")
        browser = session.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        times = {path.stem: _moved(browser, path) for path in write_lab_pages(Path(folder))}
        browser.close()
    return times


def _moved(browser: Any, path: Path) -> dict[str, list[float]]:
    page = browser.new_page(viewport={"width": 1280, "height": 1000})
    page.goto(path.as_uri())
    page.wait_for_function("window.harmolabLab")
    sliders = "[...document.querySelectorAll('input[type=range]')].map(one => one.dataset.name)"
    return dict(page.evaluate(MOVES, [N_MOVES, page.evaluate(sliders)]))


if __name__ == "__main__":
    for name, rows in measure().items():
        for kind, row in rows.items():
            median, high, worst = np.median(row), np.percentile(row, 90), max(row)
            print(f"{name:14s}{kind}: median {median:5.1f} ms, 90 % below {high:5.1f}, worst {worst:5.1f}")
