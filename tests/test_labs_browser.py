"""Labs, trials and taps in a browser, on pages of their own."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.lab.labs import pages
from harmolab.lab.labs.corpus import corpus_lab
from harmolab.lab.labs.live import LiveLab
from harmolab.lab.labs.one_clip import saliency_lab, scoring_lab
from harmolab.lab.listening.answers import AnswerLog
from harmolab.lab.listening.local_page import StudyServer, TapServer
from harmolab.lab.listening.trials import Item, TrialSet, make_trials
from harmolab.lab.player_data import blind_page
from harmolab.readers.beats import TappedBeats, tapped_beats
from harmolab.types import Audio, Clip
from tests.builders import planted_dance

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
    width, height = page.evaluate("(root => [root.scrollWidth, root.scrollHeight])(document.documentElement)")
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
        assert page.get_by_role("status").all_inner_texts() == [preset.note, lab.sentence]
        assert page.locator("code").inner_text() == lab.line
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
        points = [{"x": start + (end - start) * step / steps, "y": y}]
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove" if step else "touchStart", "touchPoints": points})
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
    hand, height = frame["x"] + spot["x"] + 9, frame["y"] + spot["middle"] - 20  # beside the beat, as near as counts
    drag_by_mouse(page, hand, hand + 2, height)  # who clicks to hear it moves nothing
    assert page.evaluate("[harmolabLab.state.settings.moves, harmolabLab.state.selected.index]") == [None, 7]
    drag_by_mouse(page, hand, hand + 17, height)
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
    page.locator("canvas").press("ArrowRight")
    page.keyboard.press("ArrowRight")
    selected = page.evaluate("harmolabLab.state.selected")
    page.keyboard.press("Shift+ArrowRight")
    moves = page.evaluate("harmolabLab.state.settings.moves")
    moment = selected["time"] + 0.01
    assert page.get_by_role("status").first.inner_text() == f"{selected['kind']} beat at {moment:.2f} s"
    assert moves[selected["kind"]][str(selected["index"])] == pytest.approx(moment, abs=0.002)
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


@pytest.mark.parametrize("change", [{"color_scheme": "light"}, {"media": "print"}])
def test_a_dark_system_gives_a_dark_lab_whose_picture_follows_a_change(chromium: Any, scoring_page: Path, change: Any):
    page = opened(chromium, scoring_page, color_scheme="dark")
    corner = "[...document.querySelector('canvas').getContext('2d').getImageData(1, 1, 1, 1).data].slice(0, 3)"
    assert max(page.evaluate(corner)) < 60
    page.emulate_media(**change)
    page.wait_for_function(f"Math.min(...{corner}) > 240")
    closed(page)


def test_recommended_mode_switches_off_what_means_nothing_in_it(chromium: Any, scoring_page: Path) -> None:
    page = opened(chromium, scoring_page)
    page.locator('select[data-name="mode"]').select_option("recommended")
    assert [slider(page, name).is_disabled() for name in ("delay", "lag")] == [True, False]
    assert page.locator("code").inner_text() == "HarmonyParams.recommended()"
    page.context.close()


@pytest.mark.parametrize("viewport", [TALL, PHONE])
def test_pages_of_a_site_fit_the_screen_and_ask_for_nothing(chromium: Any, tmp_path: Path, viewport: Any) -> None:
    paths = pages.write_lab_pages(tmp_path)
    assert [path.stem for path in paths] == [f"{name}_lab" for name in LABS]
    for path in 2 * paths:  # the second time as a browser saves them, with what the script has drawn
        page = opened(chromium, path, viewport=viewport)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        assert page.evaluate("document.querySelector('input[type=range]').clientWidth") > 250
        assert page.get_by_role("heading", level=1).count() == 1
        path.write_text(page.content(), "utf-8")
        closed(page)


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


def play(frame: Any) -> None:
    frame.click("#play")
    frame.wait_for_function("harmolabPlayer.time() > 0.3", timeout=20_000)


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
        page.get_by_role("progressbar", name=f"Trial {number} of {N}").wait_for(timeout=WAIT)
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


def test_who_cannot_hear_the_music_gives_no_answer_and_learns_what_to_do(chromium: Any, clip: Clip, tmp_path: Path):
    log = AnswerLog(tmp_path / "answers.jsonl")
    shown = blind_page(clip.audio, [clip.motion]).replace('"ogg": "T2dnUw', '"ogg": "AAAAAA', 1)  # as in old Safari
    with StudyServer(trials_of("pick"), log, lambda trial: shown).running() as address:
        page = at_address(chromium, address)
        player_in(page)
        page.click("button:text-is('harmonious')")
        page.get_by_text("This answer was not saved").wait_for(timeout=WAIT)
        closed(page)
    assert log.read().answers == ()


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
    assert frame.evaluate("[...document.all].every(one => parseFloat(getComputedStyle(one).fontSize) >= 12)")
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


def touch_at_beat(page: Any, pad: str, beat: int) -> None:
    """Touch a pad as the song plays this beat, from within the page: a click from outside waits for a busy machine."""
    touch = """async ([pad, time]) => {
      while (harmolabTaps.sound.currentTime < time) await new Promise(done => setTimeout(done, 2));
      const touched = { bubbles: true, cancelable: true, pointerType: "touch" };
      document.getElementById(pad).dispatchEvent(new PointerEvent("pointerdown", touched));
    }"""
    page.evaluate(touch, [pad, beat * PERIOD])


def tap_page(chromium: Any, address: str, viewport: dict[str, int] = WIDE) -> Any:
    """The page on which a song is tapped, ready."""
    page = at_address(chromium, address, viewport)
    page.get_by_text("Ready.").wait_for(timeout=WAIT)
    return page


def test_taps_of_keys_become_the_beats_of_the_song(chromium: Any, address: str, kept: list[TappedBeats]) -> None:
    page = tap_page(chromium, address)
    page.locator("#play").press("Enter")
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


def test_thumbs_tap_on_phones_and_a_refusal_can_be_mended(chromium: Any, address: str, kept: list[TappedBeats]) -> None:
    page = tap_page(chromium, address, PHONE)
    page.click("#tap")
    page.get_by_text("Play the song first").wait_for(timeout=WAIT)
    page.click("#play")
    for beat in (1, 2, 3, 4, 4, 5, 7, 9, 10, 12):
        touch_at_beat(page, "one" if beat == 4 else "tap", beat)
    assert page.inner_text("#message") == ""
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
    assert min(heights) >= 44 and max(heights) >= 200
    closed(page)
