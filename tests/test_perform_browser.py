"""The page of `harmolab perform` in a browser: it opens offline; hands, keys and strikes keep time with the sound."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.cli import app
from harmolab.musician.events import bow_turns, strikes
from harmolab.musician.page import Performed, save_performed
from harmolab.musician.synthetic import PlantedPerformance, planted_performance
from harmolab.types import Motion
from tests.builders import called, save_performance
from tests.test_player_browser import FRAME, PHONE, WIDE, flashes, opened, wait_until

pytestmark = pytest.mark.browser

SECONDS = 12.0


@pytest.fixture(scope="module", params=["piano", "violin"])
def planted(request: pytest.FixtureRequest) -> PlantedPerformance:
    return planted_performance(request.param, seconds=SECONDS, seed=3, faults=False)


@pytest.fixture(scope="module")
def performance(planted: PlantedPerformance) -> Performed:
    """Planted points in place of predicted ones, so that the moment of every strike is known."""
    own = planted.performance
    points = Motion(planted.clean, own.motion.fps, own.motion.skeleton)
    assert own.audio is not None
    return Performed(own.instrument, points, own.audio, 0.0, "These points were planted.")


@pytest.fixture(scope="module")
def saved(performance: Performed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "p.html"
    save_performed(path, performance, title="A planted piece")
    return path


@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
@pytest.mark.parametrize("drawn", ["--avatar", "--points", "--truth"])
def test_page_of_the_command_opens_offline_and_fits(
    planted: PlantedPerformance, drawn: str, viewport: dict[str, int], chromium: Any, tmp_path: Path
) -> None:
    save_performance(tmp_path / "take", planted.performance)
    options = (drawn, tmp_path / "take") if drawn == "--truth" else (drawn,)
    instrument = planted.performance.instrument
    asked = ("perform", tmp_path / "take" / "audio.wav", "--instrument", instrument, "--seconds", 4, *options)
    assert called(app, *asked, "--out", tmp_path / "p.html").exit_code == 0
    page = opened(chromium, tmp_path / "p.html", viewport)
    page.evaluate("harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 0.5")
    assert page.evaluate("document.documentElement.scrollWidth") == viewport["width"]
    assert page.is_visible("text=This player was trained on planted, synthetic players only.")
    assert not page.is_visible("#silent") and page.faults == []
    page.close()


@pytest.mark.parametrize("kind", ["music", "visual"])
def test_onsets_and_strikes_light_up_within_one_frame(
    kind: str, performance: Performed, saved: Path, chromium: Any
) -> None:
    page = opened(chromium, saved)
    page.evaluate("harmolabPlayer.rate(0.5); harmolabPlayer.seek(1); harmolabPlayer.play()")
    wait_until(page, "harmolabPlayer.time() > 1.2")
    lit = flashes(page, kind, 5.0)
    score = performance.score.score
    times = score.music.times if kind == "music" else score.visual.times
    assert len(lit) >= 4
    for drawn, waited in lit:
        late = drawn - times[times <= drawn + 1e-4][-1]
        assert -1e-4 <= late <= max(FRAME, waited) + 1e-3
    page.close()


def test_the_drawn_hands_strike_within_one_frame_of_the_marks(
    performance: Performed, planted: PlantedPerformance, saved: Path, chromium: Any
) -> None:
    page = opened(chromium, saved)
    frames, fps, joints = page.evaluate("[dancers[0].frames, dancers[0].fps, dancers[0].joints]")
    drawn = np.array(page.evaluate("Array.from(dancers[0].positions)")).reshape(frames, joints, 3)
    marks = np.array(page.evaluate("dancers[0].visual"))
    page.close()
    assert drawn.shape[1] == len(performance.figure.skeleton.joints)
    is_piano = performance.instrument == "piano"
    seen = (strikes if is_piano else bow_turns)(Motion(drawn, fps, performance.figure.skeleton)).times
    planted_marks = planted.strikes.times
    distance = [
        np.abs(marks - time).min() for time in planted_marks[(planted_marks > 0.5) & (planted_marks < SECONDS - 0.5)]
    ]
    assert len(marks) > 10 and np.median(distance) < FRAME
    late = np.array([np.abs(seen - mark).min() for mark in marks])
    assert (late <= 1 / performance.points.fps).mean() >= (0.95 if is_piano else 0.8)


@pytest.mark.parametrize("planted", ["piano"], indirect=True)
def test_the_keys_stand_still_under_the_hands(performance: Performed, saved: Path, chromium: Any) -> None:
    page = opened(chromium, saved)
    names = performance.figure.skeleton.joints
    keys = [number for number, name in enumerate(names) if name.startswith("keyboard_")]
    tips = [number for number, name in enumerate(names) if name.endswith("_index_4")]
    frames, joints = page.evaluate("[dancers[0].frames, dancers[0].joints]")
    drawn = np.array(page.evaluate("Array.from(dancers[0].positions)")).reshape(frames, joints, 3)
    page.close()
    assert np.ptp(drawn[:, keys], axis=0).max() < 1e-3
    assert np.ptp(drawn[:, tips], axis=0).max() > 0.02
