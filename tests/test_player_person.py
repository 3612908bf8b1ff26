"""The page's script draws the person that Python draws, and its buttons and keys do what they say."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import PAPER_21, TANG_23
from harmolab.lab.person import hulls, person_discs, shadow_outline, stage_of
from harmolab.lab.player import Dancer, Player, page_motion
from harmolab.musician.avatar import avatar
from harmolab.params import HarmonyParams
from harmolab.readers.keypoints import COCO_17
from harmolab.readers.player_points import PLAYER_50
from harmolab.readers.smpl import SMPL_24
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import planted_dance
from tests.test_person import standing
from tests.test_player_browser import PHONE, audio_time, opened, wait_until

pytestmark = pytest.mark.browser

COMMAND = "harmolab render 'a song.mp3' dance.bvh --out dance.mp4"
MIXAMO = Skeleton(
    (
        "mixamorig:Hips", "Spine", "Neck", "Head", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand",
        "RightShoulder", "RightArm", "RightForeArm", "RightHand", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase",
        "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase",
    ),
    (-1, 0, 1, 2, 1, 4, 5, 6, 1, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18),
)  # fmt: skip
BODIES = {
    "21 joints": (PAPER_21, 3), "23 joints": (TANG_23, 3), "SMPL": (SMPL_24, 3), "BVH": (MIXAMO, 3),
    "picture": (COCO_17, 2), "musician": (PLAYER_50, 2), "no names": (Skeleton(("a", "b", "c"), (-1, 0, 1)), 3),
}  # fmt: skip


@pytest.fixture(scope="module")
def clip() -> Clip:
    """A synthetic dance of 15 s whose beats are in bars of four, the third of them "one"; two of them missed."""
    clip = planted_dance(seconds=15.0)
    times = clip.beats.times
    places = (np.arange(times.size) - 2) % 4
    return replace(clip, beats=BeatTrack(times, np.ones(times.size), 100.0, clip.beats.duration, places))


def dancer_of(clip: Clip, motion: Motion | None = None, name: str = "one") -> Dancer:
    motion = motion or clip.motion
    return Dancer(name, motion, score_motion(clip.beats, motion, params=HarmonyParams.valleys()))


@pytest.fixture(scope="module")
def saved(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    late = Motion(np.roll(clip.motion.positions, 17, axis=0), clip.motion.fps, clip.motion.skeleton)
    path = tmp_path_factory.mktemp("person") / "player.html"
    dancers = [dancer_of(clip), dancer_of(clip, late, "other")]
    Player(clip.audio, dancers, music=clip.beats, title="A cha-cha, synthetic", command=COMMAND).save(path)
    return path


@pytest.fixture
def page(chromium: Any, saved: Path) -> Iterator[Any]:
    page = opened(chromium, saved)
    yield page
    assert page.faults == []
    page.close()


def moving(skeleton: Skeleton, axes: int) -> Motion:
    """The standing body, swaying and waving each joint a little, by a fixed seed."""
    rng, frames = np.random.default_rng(1), np.arange(90) / 30
    pose = standing(skeleton, axes)[:1]
    phase = rng.uniform(0, 6, pose.shape)
    size = 0.08 if axes == 3 else 8.0
    wave = size * np.sin(2 * np.pi * 0.7 * frames[:, None, None] + phase)
    return Motion(pose + wave + 2 * size * frames[:, None, None] * np.eye(axes)[0], 30.0, skeleton)


@pytest.mark.parametrize("name", [*BODIES, "avatar"])
def test_script_and_python_draw_the_same_key_points(name: str, chromium: Any, clip: Clip, tmp_path: Path) -> None:
    if name == "avatar":
        from study.experiments.player_in_space import player_in_space

        motion = avatar(player_in_space("violin", seconds=2.0).points, "violin")
    else:
        motion = moving(*BODIES[name])
    Player(clip.audio, [dancer_of(clip, motion)], music=clip.beats, title="x").save(tmp_path / "x.html")
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
    assert page.faults == []
    page.close()


def test_mirror_swaps_the_sides_of_the_picture(page: Any) -> None:
    plain, mirrored = page.evaluate(
        """[0, 1].map(() => {
          const points = pointsAt(dancers[0], 3), camera = cameraOf(dancers[0], 3, { width: 600, height: 400 }, points);
          document.getElementById("mirror").click();
          return camera.project(points[5])[0];
        })"""
    )
    assert abs(plain - 300) > 5
    assert plain - 300 == pytest.approx(300 - mirrored)


def test_follow_keeps_the_hips_in_the_middle(page: Any) -> None:
    page.keyboard.press("h")
    assert page.get_attribute("#follow", "aria-pressed") == "true"
    off = page.evaluate(
        """[0, 100, 300].map(at => { const dancer = dancers[0], points = pointsAt(dancer, at);
          const camera = cameraOf(dancer, at, { width: 600, height: 400 }, points);
          return camera.project(blend(dancer.hips, points))[0] - 300; })"""
    )
    np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_overlay_draws_the_second_dancer_pale_behind_the_first(page: Any) -> None:
    first = page.locator(".stage").first
    alone = first.evaluate("canvas => canvas.toDataURL()")
    page.keyboard.press("o")
    assert first.evaluate("canvas => canvas.toDataURL()") != alone
    assert [page.locator(".stage").nth(n).is_visible() for n in (0, 1)] == [True, False]
    assert "other (pale)" in page.locator("figcaption").nth(1).text_content()
    page.click("#overlay")
    assert page.locator(".stage").nth(1).is_visible()


def test_next_miss_goes_through_the_misses_and_round(page: Any) -> None:
    misses = page.evaluate("dancers.flatMap(dancer => dancer.misses).sort((a, b) => a - b)")
    assert len(misses) >= 2
    page.evaluate("harmolabPlayer.seek(0)")
    visited = []
    for _ in range(len(set(misses)) + 1):
        page.keyboard.press("n")
        visited.append(audio_time(page))
    ahead = sorted({miss for miss in misses if miss > 0.02})
    np.testing.assert_allclose(visited[: len(ahead)], ahead, atol=0.01)
    assert visited[len(ahead)] == pytest.approx(misses[0], abs=0.01)


def test_a_click_into_the_overview_goes_there_and_the_window_follows(page: Any) -> None:
    box = page.locator("#overview").bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 5)
    assert audio_time(page) == pytest.approx(12.0, abs=0.05)
    start, width = page.evaluate("[view.from, span()]")
    assert start <= 12.0 <= start + width


def test_count_is_that_of_the_bars_and_clicks_are_higher_on_one(page: Any, clip: Clip) -> None:
    counts = page.evaluate("data.music.map(beat => [beat.count, beat.bar])")
    assert counts[:7] == [[3, 0], [4, 0], [1, 1], [2, 1], [3, 1], [4, 1], [1, 2]]
    plain = page.locator(".stage").first.evaluate("canvas => canvas.toDataURL()")
    page.evaluate("void (addClicks = (samples, times, pitch) => (window.clicked ??= []).push([pitch, times.length]))")
    page.keyboard.press("c")
    wait_until(page, "window.clicked && window.clicked.length === 2")
    ones = sum(count == 1 for count, _ in counts)
    assert page.evaluate("window.clicked") == [[2400, ones], [1200, len(counts) - ones]]
    page.evaluate(f"harmolabPlayer.seek({clip.beats.times[2] + 0.05})")
    assert page.locator(".stage").first.evaluate("canvas => canvas.toDataURL()") != plain


def test_voice_of_this_machine_speaks_the_count(page: Any) -> None:
    page.evaluate(
        """() => {
          window.words = [];
          window.SpeechSynthesisUtterance = function (text) { this.text = text; };
          const voices = [{ localService: false, lang: "en-GB" }, { localService: true, lang: "en-US" }];
          speechSynthesis.getVoices = () => voices;
          const noted = word => [word.text, word.voice.localService, harmolabPlayer.time()];
          speechSynthesis.speak = word => window.words.push(noted(word));
        }"""
    )
    page.keyboard.press("c")
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "window.words.length >= 5")
    beats = page.evaluate("data.music.map(beat => [beat.time, String(beat.count)])")
    for word, is_local, moment in page.evaluate("window.words"):
        assert is_local
        assert word in [count for time, count in beats if -0.25 < time - moment < 0.15]  # a slow machine draws late


def test_one_spike_does_not_flatten_the_curve(page: Any) -> None:
    high, low = page.evaluate(
        """(() => {
          const speeds = Float32Array.from({ length: 1000 }, (_, i) => 1 + Math.sin(i)), top = scaleOf(speeds);
          speeds[400] = 500;
          return [scaleOf(speeds), top];
        })()"""
    )
    assert high == pytest.approx(low, rel=0.05) and 1.9 < high < 2.2


def test_command_of_the_video_is_shown_and_copied(page: Any) -> None:
    page.click("text=Save as a video")
    assert page.text_content("#command") == COMMAND
    page.click("#copy")
    assert page.evaluate("getSelection().toString()") == COMMAND
    assert page.text_content("#copy") == "copied"


def test_full_screen_fills_the_screen_with_the_picture(page: Any) -> None:
    before = page.locator(".stage").first.bounding_box()
    page.click("#full")
    wait_until(page, "document.fullscreenElement && document.fullscreenElement.id === 'show'")
    page.wait_for_timeout(300)
    after = page.locator(".stage").first.bounding_box()
    assert after["width"] * after["height"] > 1.2 * before["width"] * before["height"]
    assert page.evaluate("document.getElementById('play').getBoundingClientRect().bottom <= innerHeight")
    page.click("#full")
    wait_until(page, "!document.fullscreenElement")


def test_a_finger_hits_every_control_of_a_phone(chromium: Any, saved: Path) -> None:
    page = opened(chromium, saved, PHONE)
    small = page.evaluate(
        """[...document.querySelectorAll("button, label, summary, #seek")].filter(each => each.offsetParent)
          .map(each => [each.textContent, each.getBoundingClientRect()])
          .filter(([, box]) => box.width < 44 || box.height < 44).map(([text, box]) => [text, box.width, box.height])"""
    )
    assert small == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.close()
