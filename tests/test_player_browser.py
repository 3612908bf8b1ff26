"""The player in a browser: the sound is its clock, and the picture follows."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from harmolab.beats.visual import visual_beats
from harmolab.lab.player import Dancer, Player
from harmolab.lab.report.pages import NotebookRun, write_pages
from harmolab.params import HarmonyParams
from harmolab.types import Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import planted_dance

pytestmark = pytest.mark.browser

FRAME = 1 / 60
WIDE, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=15.0)


def player_of(clip: Clip, names: tuple[str, ...] = ("one",)) -> Player:
    score = score_motion(clip.beats, clip.motion, params=HarmonyParams.valleys())
    dancers = [Dancer(name, clip.motion, score) for name in names]
    return Player(clip.audio, dancers, music=clip.beats, title="A cha-cha")


@pytest.fixture(scope="module")
def saved(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "player.html"
    player_of(clip).save(path)
    return path


def opened(chromium: Any, path: Path, viewport: dict[str, int] = WIDE) -> Any:
    """The page, ready to play; `page.faults` collects its errors."""
    page = chromium.new_page(viewport=viewport)
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("request", lambda request: page.faults.append(request.url) if request.url.startswith("http") else None)
    page.goto(path.as_uri())
    page.evaluate("harmolabPlayer.ready")
    return page


@pytest.fixture
def page(chromium: Any, saved: Path) -> Iterator[Any]:
    page = opened(chromium, saved)
    yield page
    assert page.faults == []
    page.close()


def audio_time(page: Any) -> float:
    return float(page.evaluate("harmolabPlayer.time()"))


def wait_until(page: Any, condition: str) -> None:
    page.wait_for_function(condition, timeout=20_000)


def flashes(page: Any, kind: str, seconds: float) -> list[tuple[float, float]]:
    """(clock when a flash was first drawn, longest wait between two frames around it), while the player plays."""
    return page.evaluate(
        """async ([kind, seconds]) => {
          const found = [], player = window.harmolabPlayer;
          let before = null, start = player.time(), last = start;
          while (player.time() - start < seconds) {
            await new Promise(requestAnimationFrame);
            const drawn = player.flashing(), on = kind === "music" ? drawn.music : drawn.visual[0];
            if (on && before === false) found.push([drawn.time, drawn.time - last]);
            before = on; last = drawn.time;
          }
          return found;
        }""",
        [kind, seconds],
    )


# The clock


def test_time_advances_with_the_wall_clock(page: Any) -> None:
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.3")
    first, last = page.evaluate(
        """async () => {
          const now = () => [performance.now() / 1000, harmolabPlayer.time()], first = now();
          await new Promise(done => setTimeout(done, 10000));
          return [first, now()];
        }"""
    )
    assert last[1] - first[1] == pytest.approx(last[0] - first[0], rel=0.01)
    assert last[0] - first[0] >= 10.0


@pytest.mark.parametrize("kind", ["music", "visual"])
@pytest.mark.parametrize(("rate", "seconds"), [(1, 5.0), (0.25, 2.0)])
def test_a_flash_is_drawn_within_one_frame_of_its_beat(
    page: Any, clip: Clip, kind: str, rate: float, seconds: float
) -> None:
    page.evaluate(f"harmolabPlayer.rate({rate}); harmolabPlayer.seek(1)")
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 1.2")
    found = flashes(page, kind, seconds)
    beats = clip.beats.times if kind == "music" else visual_beats(clip.motion, params=HarmonyParams.valleys()).times
    assert len(found) >= seconds / np.diff(beats).mean() - 2
    for drawn, waited in found:
        late = drawn - beats[beats <= drawn + 1e-4][-1]
        assert -1e-4 <= late <= max(FRAME, waited) + 1e-3  # not before its beat, nor a frame after it


def test_a_quarter_of_the_speed_keeps_the_clock(page: Any) -> None:
    page.click("[data-rate='0.25']")
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.1")
    first, wall = audio_time(page), time.perf_counter()
    page.wait_for_timeout(4000)
    passed = time.perf_counter() - wall
    assert audio_time(page) - first == pytest.approx(passed / 4, rel=0.04)
    assert page.evaluate("document.getElementById('sound').preservesPitch")
    shown = page.evaluate("(() => [harmolabPlayer.flashing().time, harmolabPlayer.time()])()")
    assert shown[1] - shown[0] < 0.1


def test_the_decoded_sound_starts_where_the_original_does(page: Any, clip: Clip) -> None:
    heard = np.array(page.evaluate("ready.then(() => Array.from(original.samples))"))
    given = clip.audio.samples
    assert heard.size == given.size
    lags = np.fft.irfft(np.fft.rfft(heard, 2 * given.size) * np.conj(np.fft.rfft(given, 2 * given.size)))
    lag = int(np.argmax(lags))
    lag -= lags.size if lag > given.size else 0
    assert abs(lag) / clip.audio.sample_rate < 0.005


def test_clicks_are_mixed_in_at_the_beats(page: Any, clip: Clip) -> None:
    page.evaluate("harmolabPlayer.seek(3); original.samples.fill(0)")
    page.click("#tick")
    samples = page.evaluate(
        """async () => {
          const blob = await new Promise((done, failed) => {
            const request = new XMLHttpRequest();
            request.open("GET", document.getElementById("sound").src); request.responseType = "arraybuffer";
            request.onload = () => done(request.response); request.onerror = failed; request.send();
          });
          return Array.from(new Int16Array(blob, 44));
        }"""
    )
    loud = np.abs(np.array(samples)) > 10_000
    starts = np.flatnonzero(loud & ~np.concatenate([[False], np.convolve(loud, np.ones(2000))[: loud.size - 1] > 0.5]))
    np.testing.assert_allclose(starts / clip.audio.sample_rate, clip.beats.times, atol=1e-3)
    assert audio_time(page) == pytest.approx(3.0, abs=0.01)


# The controls


def test_seeks_by_button_bar_key_and_timeline(page: Any) -> None:
    page.eval_on_selector("#seek", "bar => { bar.value = 3; bar.dispatchEvent(new Event('input')); }")
    assert audio_time(page) == pytest.approx(3.0)
    page.keyboard.press("ArrowRight")
    assert audio_time(page) == pytest.approx(4.0)
    page.keyboard.press(".")
    assert audio_time(page) == pytest.approx(4.0 + FRAME, abs=1e-3)
    page.keyboard.press(",")
    page.keyboard.press(",")
    assert audio_time(page) == pytest.approx(4.0 - FRAME, abs=1e-3)
    box = page.locator("#timeline").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 40)
    assert audio_time(page) == pytest.approx(page.evaluate("span() / 2"), abs=0.05)
    page.evaluate("harmolabPlayer.seek(99)")
    assert audio_time(page) == pytest.approx(15.0, abs=0.01)


def test_loops_a_stretch(page: Any) -> None:
    page.evaluate("harmolabPlayer.loop(2, 2.8); harmolabPlayer.seek(2.4)")
    page.evaluate("harmolabPlayer.play()")
    seen = page.evaluate(
        """async () => {
          const seen = [];
          for (let i = 0; i < 150; i++) { await new Promise(requestAnimationFrame); seen.push(harmolabPlayer.time()); }
          return seen;
        }"""
    )
    assert min(seen) >= 1.99
    assert max(seen) <= 2.8 + 0.1
    assert (np.diff(seen) < -0.5).sum() >= 1


def test_loop_to_the_end_starts_again(page: Any) -> None:
    page.evaluate("harmolabPlayer.seek(14.2)")
    page.keyboard.press("[")
    page.evaluate("harmolabPlayer.seek(14.7); harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() < 14.5 && harmolabPlayer.time() > 14.25")


def test_keys_play_slow_down_and_loop(page: Any) -> None:
    page.keyboard.press("4")
    assert page.evaluate("document.getElementById('sound').playbackRate") == 0.25
    assert page.get_attribute("[data-rate='0.25']", "aria-pressed") == "true"
    page.keyboard.press("Space")
    wait_until(page, "harmolabPlayer.time() > 0.05")
    assert page.text_content("#play") == "Pause"
    page.keyboard.press("Space")
    wait_until(page, "document.getElementById('sound').paused")
    page.evaluate("harmolabPlayer.seek(3)")
    page.keyboard.press("[")
    page.evaluate("harmolabPlayer.seek(5)")
    page.keyboard.press("]")
    assert page.evaluate("stretch") == pytest.approx([3.0, 5.0])
    page.keyboard.press("0")
    assert page.evaluate("stretch") is None


def test_space_on_a_focused_button_is_its_own_action(page: Any) -> None:
    page.click("#play")
    wait_until(page, "harmolabPlayer.time() > 0.1")
    page.keyboard.press("Space")
    wait_until(page, "document.getElementById('sound').paused")


def test_plays_again_after_the_end(page: Any) -> None:
    page.evaluate("harmolabPlayer.seek(14.8); harmolabPlayer.play()")
    wait_until(page, "document.getElementById('sound').ended")
    page.click("#play")
    wait_until(page, "harmolabPlayer.time() > 0.1 && harmolabPlayer.time() < 5")


def test_drag_turns_and_wheel_zooms(page: Any) -> None:
    stage = page.locator(".stage")
    box, first = stage.bounding_box(), stage.evaluate("canvas => canvas.toDataURL()")
    angle = page.evaluate("view.angle")
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.wheel(0, 100)
    assert page.evaluate("view.zoom") == 1  # without the focus, the wheel is the page's
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 200, steps=4)
    page.mouse.up()
    assert stage.evaluate("canvas => canvas.toDataURL()") != first
    assert page.evaluate("view.angle") - angle == pytest.approx(-1.0, abs=0.05)
    page.mouse.wheel(0, -200)
    wait_until(page, "view.zoom > 1.2")


def test_every_control_is_reached_by_tab_and_has_a_name(page: Any) -> None:
    names = []
    for _ in range(30):
        page.keyboard.press("Tab")
        names.append(
            page.evaluate(
                "(e => e.getAttribute('aria-label') || e.textContent.trim() || (e.labels && e.labels[0].textContent))"
                "(document.activeElement)"
            )
        )
    assert all(names)
    assert {"Play", "1×", "½×", "¼×", "Loop starts here", "Position in seconds"} <= set(names)
    assert {"music", "dancer", "Keys"} <= {name.strip() for name in names}


# Where it is shown


@pytest.mark.parametrize("names", [("one",), ("one", "another with a name that is rather long")])
@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_nothing_is_wider_than_the_screen(
    chromium: Any, clip: Clip, tmp_path: Path, names: tuple[str, ...], viewport: dict[str, int]
) -> None:
    player_of(clip, names).save(tmp_path / "x.html")
    page = opened(chromium, tmp_path / "x.html", viewport)
    page.evaluate("harmolabPlayer.seek(4)")
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    assert page.locator(".stage").count() == len(names)
    assert page.faults == []
    page.close()


@pytest.mark.parametrize("sandbox", ["", ' sandbox="allow-scripts"'], ids=["free", "sandboxed"])
def test_plays_inside_a_frame(chromium: Any, clip: Clip, tmp_path: Path, sandbox: str) -> None:
    shown = player_of(clip)._repr_html_().replace("<iframe", f"<iframe{sandbox}", 1)
    (tmp_path / "notebook.html").write_text(f"<!DOCTYPE html><p>before</p>{shown}", "utf-8")
    page = chromium.new_page(viewport=WIDE)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto((tmp_path / "notebook.html").as_uri())
    frame = page.frames[1]
    frame.wait_for_function("window.harmolabPlayer", timeout=20_000)
    frame.click("#play")
    frame.wait_for_function("harmolabPlayer.time() > 0.5", timeout=20_000)
    assert faults == []
    if not sandbox:
        heights = page.evaluate(
            "(f => [f.clientHeight, f.contentDocument.documentElement.scrollHeight])(frames[0].frameElement)"
        )
        assert heights[1] <= heights[0]
    page.close()


def test_plays_in_the_offline_report(chromium: Any, clip: Clip, tmp_path: Path) -> None:
    shown = new_output("display_data", {"text/html": player_of(clip)._repr_html_(), "text/plain": "a player"})
    node = new_notebook(cells=[new_code_cell("player", outputs=[shown])])
    write_pages(tmp_path, [NotebookRun(tmp_path / "01.ipynb", node, 1.0, "")], "quick")
    page = chromium.new_page(viewport=PHONE)
    page.goto((tmp_path / "01.html").as_uri())
    page.locator("iframe").scroll_into_view_if_needed()
    frame = page.frames[1]
    frame.wait_for_function("window.harmolabPlayer", timeout=20_000)
    frame.click("#play")
    frame.wait_for_function("harmolabPlayer.time() > 0.5", timeout=20_000)
    assert frame.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    page.close()


def test_browser_that_cannot_decode_the_sound_plays_in_silence(chromium: Any, saved: Path, tmp_path: Path) -> None:
    broken = saved.read_text("utf-8").replace('"ogg": "T2dnUw', '"ogg": "AAAAAA', 1)
    (tmp_path / "x.html").write_text(broken, "utf-8")
    page = opened(chromium, tmp_path / "x.html")
    assert page.is_visible("#silent")
    page.click("#play")
    wait_until(page, "harmolabPlayer.time() > 0.3")
    assert page.faults == []
    page.close()


def test_image_coordinates_are_drawn(chromium: Any, clip: Clip, tmp_path: Path) -> None:
    points = Motion(clip.motion.positions[..., :2] * [100.0, -100.0], clip.motion.fps, clip.motion.skeleton)
    dancer = Dancer("flat", points, score_motion(clip.beats, points, params=HarmonyParams.valleys()))
    Player(clip.audio, [dancer], music=clip.beats, title="flat").save(tmp_path / "x.html")
    page = opened(chromium, tmp_path / "x.html")
    inked = page.eval_on_selector(
        ".stage",
        """canvas => {
          const { width, height } = canvas, pen = canvas.getContext("2d");
          const dark = (from, to) => pen.getImageData(0, from * height, width, (to - from) * height).data
            .filter((value, index) => index % 4 === 0 && value < 90).length;
          return [dark(0.15, 0.5), dark(0.5, 1)];
        }""",
    )
    assert min(inked) > 200  # head and arms above, legs below
    assert page.faults == []
    page.close()


def test_caption_is_the_verdict_where_there_is_one_and_else_the_beats_met(chromium: Any, clip: Clip, tmp_path: Path):
    judged = Dancer("one", clip.motion, score_motion(clip.beats, clip.motion))
    for name, player in {
        "judged": Player(clip.audio, [judged], music=clip.beats, title="A cha-cha"),
        "counted": player_of(clip),
    }.items():
        player.save(tmp_path / f"{name}.html")
    captions = {}
    for name in ("judged", "counted"):
        page = opened(chromium, tmp_path / f"{name}.html")
        captions[name] = page.text_content("figcaption").splitlines()[0]
        page.close()
    assert captions["judged"] == f"one: {judged.score.judgement.verdict}"
    assert captions["counted"].endswith("beats met")
