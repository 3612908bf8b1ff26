"""A person at the tap page in a browser: plays the song, taps by key and by touch, marks "one", saves."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.lab.listening.local_page import TapServer
from harmolab.readers.beats import TappedBeats, tapped_beats
from harmolab.types import Audio
from tests.test_study_browser import PHONE, WAIT, WIDE, opened

pytestmark = pytest.mark.browser

PERIOD = 0.6  # seconds: 100 beats a minute


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


def ready(page: Any) -> None:
    page.get_by_text("Ready.").wait_for(timeout=WAIT)


def test_taps_of_keys_become_the_beats_of_the_song(chromium: Any, address: str, kept: list[TappedBeats]) -> None:
    page = opened(chromium, address)
    ready(page)
    page.keyboard.press("p")
    for beat in range(2, 16):
        at_beat(page, beat)
        page.keyboard.press("Enter" if beat % 6 == 2 else "1" if beat % 6 == 5 else " ")
    assert page.evaluate("harmolabTaps.tempo()") == pytest.approx(100, rel=0.05)
    assert page.locator("#count").inner_text() == "14 taps, 5 of them ONE"
    page.keyboard.press("s")
    page.get_by_text("Kept. You can close this page.").wait_for(timeout=WAIT)
    track = kept[0].track
    assert track.tempo == pytest.approx(100, rel=0.01)
    assert len(track) >= 49
    assert track.bar_places[np.abs(track.times - 2 * PERIOD).argmin()] == 0
    assert page.faults == []
    page.close()


def test_thumbs_tap_on_a_phone_and_a_refusal_can_be_mended(
    chromium: Any, address: str, kept: list[TappedBeats]
) -> None:
    page = opened(chromium, address, PHONE)
    ready(page)
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
    assert kept[0].track.tempo == pytest.approx(100, rel=0.01)
    assert [fault for fault in page.faults if "400" not in fault] == []
    page.close()


def test_starting_again_forgets_all_taps(chromium: Any, address: str) -> None:
    page = opened(chromium, address)
    ready(page)
    page.keyboard.press("p")
    at_beat(page, 1)
    page.keyboard.press(" ")
    page.keyboard.press("r")
    assert page.evaluate("[harmolabTaps.taps().length, harmolabTaps.sound.currentTime]") == [0, 0]
    assert page.locator("#save").is_disabled()
    page.close()


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_all_fits_on_one_screen_with_pads_for_thumbs(chromium: Any, address: str, viewport: dict[str, int]) -> None:
    page = opened(chromium, address, viewport)
    ready(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    assert page.evaluate("document.documentElement.scrollHeight") <= viewport["height"]
    heights = page.eval_on_selector_all("button", "buttons => buttons.map(button => button.clientHeight)")
    assert min(heights) >= 44
    assert max(heights) >= 200
    page.close()
