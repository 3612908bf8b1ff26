"""A rater in a browser: plays a trial, answers by clicking, comes back after a reload, on a page and in JupyterLab."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest

from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer
from harmolab.lab.listening.trials import Item, TrialSet, make_trials
from harmolab.lab.player import blind_page
from harmolab.types import Clip
from tests.builders import planted_dance
from tests.test_browser import TOKEN, running_jupyterlab

pytestmark = pytest.mark.browser

N = 4
WAIT = 20_000  # milliseconds
FRAME = "iframe[title^=Dance]"
STUDY = "iframe[title='Listening study']"
WIDE, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


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


def opened(chromium: Any, address: str, viewport: dict[str, int] = WIDE) -> Any:
    """The page; `page.faults` collects errors and requests to elsewhere."""
    page = chromium.new_page(viewport=viewport)
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda message: page.faults.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: page.faults.append(request.url) if is_elsewhere(request.url, address) else None)
    page.goto(address)
    return page


def is_elsewhere(url: str, address: str) -> bool:
    return url.startswith("http") and not url.startswith(address)


def player_in(page: Any) -> Any:
    """The frame of the player, ready."""
    page.locator(FRAME).scroll_into_view_if_needed(timeout=WAIT)  # it is loaded when it comes into view
    page.frame_locator(FRAME).locator("#play").wait_for(timeout=WAIT)
    frame = page.locator(FRAME).element_handle().content_frame()
    frame.wait_for_function("window.harmolabPlayer", timeout=WAIT)
    frame.evaluate("harmolabPlayer.ready")
    return frame


def picture(frame: Any) -> str:
    return frame.eval_on_selector(".stage", "canvas => canvas.toDataURL()")


def test_rater_plays_answers_reloads_and_is_thanked(chromium: Any, asked: tuple[str, TrialSet, AnswerLog]) -> None:
    address, trials, log = asked
    page = opened(chromium, address)
    for number in range(1, N + 1):
        page.get_by_text(f"Trial {number} of {N}").wait_for(timeout=WAIT)
        frame = player_in(page)
        before = picture(frame)
        frame.click("#play")
        frame.wait_for_function("harmolabPlayer.time() > 0.3", timeout=WAIT)
        assert picture(frame) != before
        if number == 3:
            page.reload()
            page.get_by_text(f"Trial 3 of {N}").wait_for(timeout=WAIT)
        page.get_by_role("button", name=trials.choices[number % 2], exact=True).click()
        page.get_by_text(f"Trial {number + 1} of {N}" if number < N else "Thank you").wait_for(timeout=WAIT)
        assert [answer.trial for answer in log.read().answers] == [one.id for one in trials.trials[:number]]
    assert [answer.choice for answer in log.read().answers] == [trials.choices[number % 2] for number in (1, 2, 3, 4)]
    assert page.faults == []
    page.close()


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_question_player_and_answers_fit_on_one_screen(
    chromium: Any, asked: tuple[str, TrialSet, AnswerLog], viewport: dict[str, int]
) -> None:
    page = opened(chromium, asked[0], viewport)
    frame = player_in(page)
    page.wait_for_function("document.querySelector('iframe').contentDocument.documentElement.scrollHeight <= "
                           "document.querySelector('iframe').clientHeight", timeout=WAIT)  # fmt: skip
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    assert page.evaluate("document.documentElement.scrollHeight") <= viewport["height"]
    assert frame.evaluate("document.documentElement.scrollWidth <= innerWidth")
    heights = page.eval_on_selector_all("form button", "buttons => buttons.map(button => button.clientHeight)")
    assert min(heights) >= 44  # for a thumb
    page.close()


def test_keys_play_and_seek_in_the_player(chromium: Any, asked: tuple[str, TrialSet, AnswerLog]) -> None:
    page = opened(chromium, asked[0])
    frame = player_in(page)
    frame.focus(".stage")
    page.keyboard.press("ArrowRight")
    frame.wait_for_function("Math.abs(harmolabPlayer.time() - 1) < 0.05", timeout=WAIT)
    page.keyboard.press(" ")
    frame.wait_for_function("harmolabPlayer.time() > 1.3", timeout=WAIT)
    page.keyboard.press(" ")
    frame.wait_for_function("document.querySelector('#play').textContent === 'Play'", timeout=WAIT)
    assert page.faults == []
    page.close()


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
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(CELL)],
        metadata={"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}},
    )
    (tmp_path / "lab").mkdir()
    nbformat.write(notebook, tmp_path / "study.ipynb")
    with running_jupyterlab(tmp_path / "lab", tmp_path / "study.ipynb") as address:
        tab = chromium.new_page(viewport=WIDE)
        tab.goto(f"{address}/lab/tree/lab.ipynb?reset&token={TOKEN}")
        tab.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=60_000)
        tab.locator("#jp-main-statusbar").filter(has_text=re.compile(r"Python 3.*Idle")).wait_for(timeout=90_000)
        tab.get_by_role("menuitem", name="Run", exact=True).click()
        tab.locator('[data-command="runmenu:run-all"]').click()
        log = AnswerLog(tmp_path / "lab" / "work" / "answers.jsonl")
        for number in range(1, N + 1):
            tab.locator(STUDY).scroll_into_view_if_needed(timeout=120_000)  # it is loaded when it comes into view
            study = tab.locator(STUDY).element_handle().content_frame()
            study.get_by_text(f"Trial {number} of {N}").wait_for(timeout=WAIT)
            frame = player_in(study)
            frame.click("#play")
            frame.wait_for_function("harmolabPlayer.time() > 0.3", timeout=WAIT)
            assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
            study.get_by_role("button", name="inharmonious", exact=True).click()
            study.get_by_text(f"Trial {number + 1} of {N}" if number < N else "Thank you").wait_for(timeout=WAIT)
            assert len(log.read().answers) == number
        tab.close()
    assert {answer.choice for answer in log.read().answers} == {"inharmonious"}
