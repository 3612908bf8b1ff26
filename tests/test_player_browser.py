"""The player in a browser: the sound is its clock, and its script draws the person that Python draws."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.lab.labs.one_clip import scoring_lab
from harmolab.lab.person import hulls, person_discs, shadow_outline, stage_of
from harmolab.lab.player_data import Dancer, Player, of_dance, page_motion
from harmolab.lab.report.pages import NotebookRun, write_pages
from harmolab.lab.report.templates import framed
from harmolab.musician.avatar import avatar
from harmolab.params import HarmonyParams
from harmolab.readers.keypoints import COCO_17
from harmolab.readers.player_points import PLAYER_50
from harmolab.readers.smpl import SMPL_24
from harmolab.types import Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import planted_dance, track
from tests.test_labs_browser import PHONE, WIDE, at_address, closed, drag_by_mouse, picture
from tests.test_player import delay_of
from tests.test_render import standing

pytestmark = pytest.mark.browser

FRAME = 1 / 60
FLASH = 0.12  # seconds that a beat stays lit


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=15.0)


def dancer_of(clip: Clip, motion: Motion | None = None, name: str = "one") -> Dancer:
    motion = motion or clip.motion
    return Dancer(name, motion, score_motion(clip.beats, motion, params=HarmonyParams.valleys()))


def player_of(clip: Clip, names: tuple[str, ...] = ("one",)) -> Player:
    return Player(clip.audio, [dancer_of(clip, name=name) for name in names], music=clip.beats, title="A cha-cha")


@pytest.fixture(scope="module")
def saved(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "player.html"
    player_of(clip).save(path)
    return path


def opened(chromium: Any, path: Path, viewport: dict[str, int] = WIDE, **context: Any) -> Any:
    """The page, ready to play."""
    page = at_address(chromium, path.as_uri(), viewport, **context)
    page.evaluate("harmolabPlayer.ready")
    return page


@pytest.fixture
def page(chromium: Any, saved: Path) -> Iterator[Any]:
    page = opened(chromium, saved)
    yield page
    closed(page)


def audio_time(page: Any) -> float:
    return float(page.evaluate("harmolabPlayer.time()"))


def wait_until(page: Any, condition: str) -> None:
    page.wait_for_function(condition, timeout=20_000)


def assert_lit_on_its_beats(page: Any, kind: str, beats: np.ndarray, seconds: float) -> None:
    """Each frame drawn while it plays is lit if a beat is less than a flash ago, and dark otherwise: no beat before
    its time nor a frame late. A busy machine may draw no frame at all in a flash, which is no fault of the page."""
    drawn = page.evaluate(
        """async ([kind, seconds]) => {
          const frames = [], start = harmolabPlayer.time();
          while (harmolabPlayer.time() - start < seconds) {
            await new Promise(requestAnimationFrame);
            const lit = harmolabPlayer.flashing();
            frames.push([lit.time, kind === "music" ? lit.music : lit.visual[0]]);
          }
          return frames;
        }""",
        [kind, seconds],
    )
    times, lit = np.array(drawn).T
    since = times - beats[np.maximum(np.searchsorted(beats, times, side="right") - 1, 0)]
    clear = (np.abs(times[:, None] - beats).min(axis=1) > 1e-3) & (np.abs(since - FLASH) > 1e-3)
    np.testing.assert_array_equal(lit[clear].astype(bool), ((since >= 0) & (since < FLASH))[clear])
    assert lit.sum() >= 4 and clear.mean() > 0.9


@pytest.mark.parametrize("change", [{"color_scheme": "light"}, {"media": "print"}])
def test_a_dark_system_gives_a_dark_page_and_its_pictures_follow_a_change(chromium: Any, saved: Path, change: Any):
    page = opened(chromium, saved, color_scheme="dark")
    corner = "[...document.getElementById('timeline').getContext('2d').getImageData(30, 2, 1, 1).data].slice(0, 3)"
    assert max(page.evaluate(corner)) < 60
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(23, 25, 28)"
    page.emulate_media(**change)
    wait_until(page, f"Math.min(...{corner}) > 240")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    closed(page)


def test_pressed_buttons_and_the_legend_keep_their_colours_in_print_and_where_colours_are_forced(page: Any) -> None:
    page.emulate_media(forced_colors="active")
    look = "all => all.map(one => getComputedStyle(one)).map(one => [one.backgroundColor, one.printColorAdjust])"
    looks = page.eval_on_selector_all("[aria-pressed=true], .bar", look)
    assert looks == [["rgb(34, 34, 34)", "exact"], ["rgb(0, 114, 178)", "exact"]]


def test_on_paper_the_pictures_are_as_wide_as_it_and_there_are_no_buttons(page: Any) -> None:
    page.evaluate("widths = []; plain = show; void (show = () => { plain(); widths.push(timeline.width); })")
    page.pdf(format="A4")
    assert min(page.evaluate("widths")) < 800 < page.evaluate("timeline.width")
    page.emulate_media(media="print")
    assert not page.is_visible("#play")


def test_where_it_stands_is_said_when_it_stands_and_not_while_it_plays(page: Any) -> None:
    status = "document.getElementById('status')"
    assert page.get_by_role("status").evaluate_all("all => all.map(one => one.id)") == ["status"]
    page.evaluate("harmolabPlayer.seek(2)")
    wait_until(page, f"{status}.textContent.startsWith('2.00 s. one: ')")
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 2.5")
    assert page.evaluate(f"[{status}.textContent.slice(0, 6), seekBar.ariaValueText]") == ["2.00 s", "2.0 seconds"]
    page.evaluate("harmolabPlayer.pause()")
    wait_until(page, f"!{status}.textContent.startsWith('2.00 s')")


# The clock


def played(page: Any, seconds: float) -> tuple[float, float]:
    """Seconds that pass on the wall and in the player while it plays for so long, both read at the same moments."""
    return page.evaluate(
        """async seconds => {
          const now = () => [performance.now() / 1000, harmolabPlayer.time()], first = now();
          await new Promise(done => setTimeout(done, 1000 * seconds));
          return now().map((last, clock) => last - first[clock]);
        }""",
        seconds,
    )


def test_time_advances_with_the_wall_clock(page: Any) -> None:
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.3")
    wall, player = played(page, 10)
    assert wall >= 10 and player == pytest.approx(wall, rel=0.01)


@pytest.mark.parametrize("kind", ["music", "visual"])
@pytest.mark.parametrize(("rate", "seconds"), [(1, 5.0), (0.25, 2.0)])
def test_a_flash_is_within_a_frame_of_its_beat(page: Any, clip: Clip, kind: str, rate: float, seconds: float) -> None:
    page.evaluate(f"harmolabPlayer.rate({rate}); harmolabPlayer.seek(1); harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 1.2")
    beats = clip.beats.times if kind == "music" else visual_beats(clip.motion, params=HarmonyParams.valleys()).times
    assert_lit_on_its_beats(page, kind, beats, seconds)


def test_a_quarter_of_the_speed_keeps_the_clock(page: Any) -> None:
    page.click("[data-rate='0.25']")
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.1")
    wall, player = played(page, 4)
    assert player == pytest.approx(wall / 4, rel=0.04)
    assert page.evaluate("document.getElementById('sound').preservesPitch")
    assert page.evaluate("-harmolabPlayer.flashing().time + harmolabPlayer.time()") < 0.1


def test_the_decoded_sound_starts_where_the_original_does(page: Any, clip: Clip) -> None:
    decoded = np.array(page.evaluate("ready.then(() => Array.from(original.samples))"))
    assert decoded.size == clip.audio.samples.size
    assert abs(delay_of(decoded, clip.audio.samples)) / clip.audio.sample_rate < 0.005


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
    page.evaluate("harmolabPlayer.loop(2, 2.8); harmolabPlayer.seek(2.4); harmolabPlayer.play()")
    each_frame = "() => new Promise(requestAnimationFrame).then(harmolabPlayer.time)"
    seen = page.evaluate(f"Array.fromAsync({{ length: 150 }}, {each_frame})")
    assert min(seen) >= 1.99 and max(seen) <= 2.8 + 0.1
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
    for place, key in ((3, "["), (5, "]")):
        page.evaluate(f"harmolabPlayer.seek({place})")
        page.keyboard.press(key)
    assert page.evaluate("stretch") == pytest.approx([3.0, 5.0])
    page.keyboard.press("0")
    assert page.evaluate("stretch") is None
    page.click("text=keyboard >> nth=0")  # letters, digits and signs may be what speech was taken for
    for key in ("]", "1", "ArrowRight"):
        page.keyboard.press(key)
    assert page.evaluate("[sound.playbackRate, stretch, Math.round(now())]") == [0.25, None, 6]


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
    box, first, angle = page.locator(".stage").bounding_box(), picture(page, ".stage"), page.evaluate("view.angle")
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.wheel(0, 100)
    assert page.evaluate("view.zoom") == 1  # without the focus, the wheel is the page's
    page.evaluate("delete MouseEvent.prototype.movementX")  # as on iPhones before iOS 17
    drag_by_mouse(page, box["x"] + 200, box["x"] + 300, box["y"] + 200)
    assert picture(page, ".stage") != first
    assert page.evaluate("view.angle") - angle == pytest.approx(-1.0, abs=0.05)
    page.mouse.wheel(0, -200)
    wait_until(page, "view.zoom > 1.2")


def test_every_control_is_reached_by_tab_and_has_a_name(page: Any) -> None:
    names = []
    for _ in range(30):
        page.keyboard.press("Tab")
        named = "e => e.getAttribute('aria-label') || e.textContent.trim() || (e.labels && e.labels[0].textContent)"
        names.append(page.evaluate(f"({named})(document.activeElement)"))
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
    closed(page)


def playing_frame(page: Any) -> Any:
    """The player in the page's frame, playing."""
    page.locator("iframe").first.scroll_into_view_if_needed()
    frame = page.frames[1]
    frame.wait_for_function("window.harmolabPlayer", timeout=20_000)
    frame.click("#play")
    frame.wait_for_function("harmolabPlayer.time() > 0.5", timeout=20_000)
    return frame


@pytest.mark.parametrize("sandbox", ["", ' sandbox="allow-scripts"'], ids=["free", "sandboxed"])
def test_plays_inside_a_frame(chromium: Any, clip: Clip, tmp_path: Path, sandbox: str) -> None:
    shown = player_of(clip)._repr_html_().replace("<iframe", f"<iframe{sandbox}", 1)
    (tmp_path / "notebook.html").write_text(f"<!DOCTYPE html><p>before</p>{shown}", "utf-8")
    page = at_address(chromium, (tmp_path / "notebook.html").as_uri())
    playing_frame(page)
    if not sandbox:
        is_whole = "frame => frame.contentDocument.documentElement.scrollHeight <= frame.clientHeight"
        assert page.locator("iframe").evaluate(is_whole)
    closed(page)


def test_of_players_and_labs_on_a_page_the_last_one_started_sounds(chromium: Any, clip: Clip, tmp_path: Path) -> None:
    scoring_lab(clip).save(tmp_path / "lab.html")
    lab = framed((tmp_path / "lab.html").read_text("utf-8"), title="lab", height=900)
    (tmp_path / "table.html").write_text("<!DOCTYPE html>" + 2 * (player_of(clip)._repr_html_() + lab), "utf-8")
    page = at_address(chromium, (tmp_path / "table.html").as_uri())
    silent = "(window.harmolabLab ? !harmolabLab.state.sound : document.querySelector('audio')?.paused ?? true)"
    for last in (0, 2, 1, 3, 0):  # of two players, each before a lab
        page.locator("iframe").nth(last).scroll_into_view_if_needed()
        page.frames[last + 1].get_by_role("button", name="Play").first.click(timeout=20_000)
        for number, frame in enumerate(page.frames[1:]):
            frame.wait_for_function(f"{silent} === {str(number != last).lower()}", timeout=9_000)
    closed(page)


def test_plays_in_the_offline_report(chromium: Any, clip: Clip, tmp_path: Path) -> None:
    shown = new_output("display_data", {"text/html": player_of(clip)._repr_html_(), "text/plain": "a player"})
    node = new_notebook(cells=[new_code_cell("player", outputs=[shown])])
    write_pages(tmp_path, [NotebookRun(tmp_path / "01.ipynb", node, 1.0, "")], "quick")
    page = at_address(chromium, (tmp_path / "01.html").as_uri(), PHONE)
    assert playing_frame(page).evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    closed(page)


def test_browser_that_cannot_decode_the_sound_plays_in_silence(chromium: Any, saved: Path, tmp_path: Path) -> None:
    (tmp_path / "x.html").write_text(saved.read_text("utf-8").replace('"ogg": "T2dnUw', '"ogg": "AAAAAA', 1), "utf-8")
    page = opened(chromium, tmp_path / "x.html")
    assert page.get_by_role("alert").inner_text().startswith("This browser cannot decode the sound")
    page.click("#play")
    wait_until(page, "harmolabPlayer.time() > 0.3")
    page.evaluate("sound.play = () => Promise.reject(new Error('no loudspeaker')); harmolabPlayer.play()")
    assert page.get_by_role("alert").inner_text() == "The browser does not play the sound: no loudspeaker"
    page.evaluate("delete sound.play; harmolabPlayer.play()")  # what was refused is no longer; the silence is
    assert page.get_by_role("alert").inner_text().startswith("This browser cannot decode the sound")
    closed(page)


def test_image_coordinates_are_drawn(chromium: Any, clip: Clip, tmp_path: Path) -> None:
    points = Motion(clip.motion.positions[..., :2] * [100.0, -100.0], clip.motion.fps, clip.motion.skeleton)
    Player(clip.audio, [dancer_of(clip, points)], music=clip.beats, title="flat").save(tmp_path / "x.html")
    page = opened(chromium, tmp_path / "x.html")
    inked = page.eval_on_selector(
        ".stage",
        """canvas => [[0.15, 0.5], [0.5, 1]].map(([from, to]) => canvas.getContext("2d")
          .getImageData(0, from * canvas.height, canvas.width, (to - from) * canvas.height).data
          .filter((value, index) => index % 4 === 0 && value < 90).length)""",
    )
    assert min(inked) > 200  # head and arms above, legs below
    closed(page)


def test_caption_is_the_verdict_where_there_is_one_and_else_the_beats_met(chromium: Any, clip: Clip, tmp_path: Path):
    judged, captions = Dancer("one", clip.motion, score_motion(clip.beats, clip.motion)), []
    for player in (Player(clip.audio, [judged], music=clip.beats, title="A cha-cha"), player_of(clip)):
        player.save(tmp_path / "x.html")
        page = opened(chromium, tmp_path / "x.html")
        captions.append(page.text_content("figcaption").splitlines()[0])
        closed(page)
    assert captions[0] == f"one: {of_dance(judged.score.judgement.verdict)}"
    assert captions[1].endswith("beats met")


# The person, and buttons and keys

COMMAND = "harmolab play 'a song.mp3' dance.bvh --out dance.mp4"
ARM, LEG = (("Shoulder", "Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot", "ToeBase"))
LIMBS = [f"{side}{part}" for limb in (ARM, LEG) for side in ("Left", "Right") for part in limb]
PARENTS = (-1, 0, 1, 2, 1, 4, 5, 6, 1, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)
MIXAMO = Skeleton(("mixamorig:Hips", "Spine", "Neck", "Head", *LIMBS), PARENTS)
BODIES = {
    "21 joints": (PAPER_21, 3), "23 joints": (TANG_23, 3), "SMPL": (SMPL_24, 3), "BVH": (MIXAMO, 3),
    "picture": (COCO_17, 2), "musician": (PLAYER_50, 2), "no names": (Skeleton(("a", "b", "c"), (-1, 0, 1)), 3),
}  # fmt: skip


@pytest.fixture(scope="module")
def barred() -> Clip:
    """A synthetic dance of 15 s whose beats are in bars of four, the third of them "one"; two of them missed."""
    clip = planted_dance(seconds=15.0)
    places = (np.arange(len(clip.beats)) - 2) % 4
    return replace(clip, beats=track(clip.beats.times, duration=clip.beats.duration, bar_places=places))


@pytest.fixture(scope="module")
def pair(barred: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    late = Motion(np.roll(barred.motion.positions, 17, axis=0), barred.motion.fps, barred.motion.skeleton)
    path = tmp_path_factory.mktemp("person") / "player.html"
    dancers = [dancer_of(barred), dancer_of(barred, late, "other")]
    Player(barred.audio, dancers, music=barred.beats, title="A cha-cha, synthetic", command=COMMAND).save(path)
    return path


@pytest.fixture
def pair_page(chromium: Any, pair: Path) -> Iterator[Any]:
    page = opened(chromium, pair)
    yield page
    closed(page)


def moving(skeleton: Skeleton, axes: int) -> Motion:
    """The standing body, swaying and waving each joint a little, by a fixed seed."""
    time, pose, size = np.arange(90)[:, None, None] / 30, standing(skeleton, axes)[:1], 0.08 if axes == 3 else 8.0
    wave = np.sin(2 * np.pi * 0.7 * time + np.random.default_rng(1).uniform(0, 6, pose.shape))
    return Motion(pose + size * (wave + 2 * time * np.eye(axes)[0]), 30.0, skeleton)


@pytest.mark.parametrize("name", [*BODIES, "avatar"])
def test_script_and_python_draw_the_same_key_points(name: str, chromium: Any, barred: Clip, tmp_path: Path) -> None:
    if name == "avatar":
        from study.experiments.player_in_space import player_in_space

        motion = avatar(player_in_space("violin", seconds=2.0).points, "violin")
    else:
        motion = moving(*BODIES[name])
    Player(barred.audio, [dancer_of(barred, motion)], music=barred.beats, title="x").save(tmp_path / "x.html")
    page = opened(chromium, tmp_path / "x.html")
    stage = stage_of(page_motion(motion))
    camera, positions = stage.camera(480, 640), stage.turned(stage.positions)
    for frame in (0, 20, 41):
        drawn = page.evaluate(
            """at => {
              const size = { width: 640, height: 480 }, dancer = dancers[0], points = pointsAt(dancer, at);
              const camera = cameraOf(dancer, at, size, points), parts = figureOf(dancer, camera, points);
              const shadow = shadowOf(dancer, camera, points).map(([x, y]) => [x, y]);
              return { discs: parts.map(part => part.discs), hulls: parts.map(part => hull(part.discs)), shadow };
            }""",
            frame,
        )
        only, pose = slice(frame, frame + 1), positions[frame : frame + 1]
        discs = person_discs(stage.plan, camera, pose, only)
        assert len(drawn["discs"]) == len(stage.plan.parts)
        for part, shown in enumerate(drawn["discs"]):
            expected = np.concatenate([discs.centres[0, part], discs.radii[0, part, :, None]], axis=1)[: len(shown)]
            np.testing.assert_allclose(shown, expected, atol=0.3)
        np.testing.assert_allclose(drawn["hulls"], hulls(discs.centres, discs.radii)[0], atol=0.5)
        np.testing.assert_allclose(drawn["shadow"], shadow_outline(stage.plan, camera, pose, only)[0], atol=0.5)
    closed(page)


def test_mirror_swaps_the_sides_of_the_picture(pair_page: Any) -> None:
    plain, mirrored = pair_page.evaluate(
        """[0, 1].map(() => {
          const points = pointsAt(dancers[0], 3), camera = cameraOf(dancers[0], 3, { width: 600, height: 400 }, points);
          document.getElementById("mirror").click();
          return camera.project(points[5])[0];
        })"""
    )
    assert abs(plain - 300) > 5 and plain - 300 == pytest.approx(300 - mirrored)


def test_follow_keeps_the_hips_in_the_middle(pair_page: Any) -> None:
    pair_page.keyboard.press("h")
    assert pair_page.get_attribute("#follow", "aria-pressed") == "true"
    off = pair_page.evaluate(
        """[0, 100, 300].map(at => { const dancer = dancers[0], points = pointsAt(dancer, at);
          const camera = cameraOf(dancer, at, { width: 600, height: 400 }, points);
          return camera.project(blend(dancer.hips, points))[0] - 300; })"""
    )
    np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_overlay_draws_the_second_dancer_pale_behind_the_first(pair_page: Any) -> None:
    alone = picture(pair_page, ".stage")
    pair_page.keyboard.press("o")
    assert picture(pair_page, ".stage") != alone
    assert [pair_page.locator(".stage").nth(n).is_visible() for n in (0, 1)] == [True, False]
    assert "other (pale)" in pair_page.locator("figcaption").nth(1).text_content()
    pair_page.click("#overlay")
    assert pair_page.locator(".stage").nth(1).is_visible()


def test_a_page_saved_while_it_plays_opens_as_it_was_made(chromium: Any, pair_page: Any, tmp_path: Path) -> None:
    state = "[...document.querySelectorAll('button, .stages, #status')].map(one => one.cloneNode(one.id).outerHTML)"
    new = pair_page.evaluate(state)
    for key in "xho[":
        pair_page.keyboard.press(key)
    pair_page.evaluate("harmolabPlayer.seek(3); harmolabPlayer.play()")
    (tmp_path / "x.html").write_text(pair_page.content(), "utf-8")
    page = opened(chromium, tmp_path / "x.html")
    assert page.evaluate(state) == new and audio_time(page) == 0
    page.context.close()


def test_next_miss_goes_through_the_misses_and_round(pair_page: Any) -> None:
    misses = pair_page.evaluate("dancers.flatMap(dancer => dancer.misses).sort((a, b) => a - b)")
    assert len(misses) >= 2
    pair_page.evaluate("harmolabPlayer.seek(0)")
    visited = []
    for _ in range(len(set(misses)) + 1):
        pair_page.keyboard.press("n")
        visited.append(audio_time(pair_page))
    ahead = sorted({miss for miss in misses if miss > 0.02})
    np.testing.assert_allclose(visited[: len(ahead)], ahead, atol=0.01)
    assert visited[len(ahead)] == pytest.approx(misses[0], abs=0.01)


def test_a_click_into_the_overview_goes_there_and_the_window_follows(pair_page: Any) -> None:
    box = pair_page.locator("#overview").bounding_box()
    pair_page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 5)
    assert audio_time(pair_page) == pytest.approx(12.0, abs=0.05)
    start, width = pair_page.evaluate("[view.from, span()]")
    assert start <= 12.0 <= start + width


def test_count_is_that_of_the_bars_and_clicks_are_higher_on_one(pair_page: Any, barred: Clip) -> None:
    counts = pair_page.evaluate("data.music.map(beat => [beat.count, beat.bar])")
    assert counts[:7] == [[3, 0], [4, 0], [1, 1], [2, 1], [3, 1], [4, 1], [1, 2]]
    plain = picture(pair_page, ".stage")
    pair_page.evaluate("void (addClicks = (_, times, pitch) => (window.clicked ??= []).push([pitch, times.length]))")
    pair_page.keyboard.press("c")
    wait_until(pair_page, "window.clicked && window.clicked.length === 2")
    ones = sum(count == 1 for count, _ in counts)
    assert pair_page.evaluate("window.clicked") == [[2400, ones], [1200, len(counts) - ones]]
    pair_page.evaluate(f"harmolabPlayer.seek({barred.beats.times[2] + 0.05})")
    assert picture(pair_page, ".stage") != plain


def test_voice_of_this_machine_speaks_the_count(pair_page: Any) -> None:
    pair_page.evaluate(
        """() => {
          window.words = []; window.SpeechSynthesisUtterance = function (text) { this.text = text; };
          speechSynthesis.getVoices = () => [{ localService: false, lang: "en" }, { localService: true, lang: "en" }];
          speechSynthesis.speak = word => words.push([word.text, word.voice.localService, harmolabPlayer.time()]);
        }"""
    )
    pair_page.keyboard.press("c")
    pair_page.evaluate("harmolabPlayer.play()")
    wait_until(pair_page, "window.words.length >= 5")
    beats = pair_page.evaluate("data.music.map(beat => [beat.time, String(beat.count)])")
    for word, is_local, moment in pair_page.evaluate("window.words"):
        assert is_local
        assert word in [count for time, count in beats if -0.25 < time - moment < 0.15]  # a slow machine draws late


def test_a_voice_that_comes_after_the_clicks_does_not_speak_beside_them(pair_page: Any) -> None:
    pair_page.evaluate(
        """() => {
          window.words = []; window.SpeechSynthesisUtterance = function (text) { this.text = text; };
          speechSynthesis.getVoices = () => []; speechSynthesis.speak = word => words.push(word.text);
        }"""
    )
    pair_page.keyboard.press("c")
    pair_page.evaluate("speechSynthesis.getVoices = () => [{ localService: true, lang: 'en' }]")
    pair_page.evaluate("harmolabPlayer.play()")
    wait_until(pair_page, "harmolabPlayer.time() > 2")
    assert pair_page.evaluate("window.words") == []


def test_a_preview_that_runs_no_scripts_says_where_the_page_plays(chromium: Any, saved: Path) -> None:
    page = at_address(chromium, saved.as_uri(), WIDE, java_script_enabled=False)
    assert "plays in a browser that runs scripts" in page.inner_text("main")
    closed(page)


def test_one_spike_does_not_flatten_the_curve(pair_page: Any) -> None:
    high, low = pair_page.evaluate(
        """[500, 1 + Math.sin(400)].map(spike =>
          scaleOf(Float32Array.from({ length: 1000 }, (_, i) => i === 400 ? spike : 1 + Math.sin(i))))"""
    )
    assert high == pytest.approx(low, rel=0.05) and 1.9 < high < 2.2


def test_command_of_the_video_is_shown_and_copied(pair_page: Any) -> None:
    pair_page.click("text=Save as a video")
    assert pair_page.text_content("#command") == COMMAND
    pair_page.click("#copy")
    assert pair_page.evaluate("getSelection().toString()") == COMMAND
    assert pair_page.text_content("#copy") == "copied"


def test_full_screen_fills_the_screen_with_the_picture(pair_page: Any) -> None:
    before = pair_page.locator(".stage").first.bounding_box()
    pair_page.click("#full")
    wait_until(pair_page, "document.fullscreenElement && document.fullscreenElement.id === 'show'")
    pair_page.wait_for_timeout(300)
    after = pair_page.locator(".stage").first.bounding_box()
    assert after["width"] * after["height"] > 1.2 * before["width"] * before["height"]
    assert pair_page.evaluate("document.getElementById('play').getBoundingClientRect().bottom <= innerHeight")
    pair_page.click("#full")
    wait_until(pair_page, "!document.fullscreenElement")


@pytest.mark.parametrize(("viewport", "least"), [(PHONE, 44), (WIDE, 24)])
def test_a_finger_hits_every_control_of_a_phone(chromium: Any, pair: Path, viewport: Any, least: int) -> None:
    page = opened(chromium, pair, viewport)
    small = page.evaluate(
        """least => [...document.querySelectorAll("button, label, summary, #seek")].filter(each => each.offsetParent)
          .map(each => [each.textContent, each.getBoundingClientRect()])
          .filter(([, { width, height }]) => Math.min(width, height) < least).map(([text]) => text)""",
        least,
    )
    assert small == []
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    closed(page)
