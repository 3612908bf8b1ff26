"""Fixtures that several test files use: signals with planted answers, and the recordings if there are any."""

import gc
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.testing
from hypothesis import settings

from harmolab.beats.audio import compile_tracker
from harmolab.body.skeletons import Skeleton
from harmolab.types import Audio, Clip, Motion

os.environ["MPLBACKEND"] = "Agg"
# nbformat asks jsonschema, which would compile a grammar of addresses for three seconds that no notebook needs.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]

# Tests run side by side; small networks in several threads each would only fight over the cores.
os.environ["OMP_NUM_THREADS"] = "1"

# A runner would build all commands anew for each call, and tests make a thousand.
typer.testing._get_command = cache(typer.testing._get_command)

ROOT = Path(__file__).resolve().parents[1]

# Notebooks that tests write elsewhere import the study too.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT / "notebooks"), os.environ.get("PYTHONPATH")]))

# The first call of librosa compiles for half a minute, which is no property of the code under test.
settings.register_profile("harmolab", deadline=None)
# `make check` tries fewer examples: pytest's --hypothesis-profile wins over the one loaded here.
settings.register_profile("quick", deadline=None, max_examples=25, database=None)
settings.load_profile("harmolab")


def pytest_collection_finish() -> None:
    """Libraries and tests stay to the end: the garbage collector need not look through them again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def figures_aside(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test may write into the project's own figures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARMOLAB_FIGURES", str(tmp_path_factory.mktemp("figures")))
        yield


@pytest.fixture(scope="session", autouse=True)
def poses_off() -> Iterator[None]:
    """Tests read videos by flow, wherever they run; those of poses turn them on."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARMOLAB_POSE", "off")
        yield


@pytest.fixture(scope="session", autouse=True)
def tracker_compiled() -> None:
    """Workers that compile librosa at the same moment would break numba's cache for each other."""
    compile_tracker()


@pytest.fixture
def rng() -> np.random.Generator:
    """The same random numbers in every run."""
    return np.random.default_rng(20)


@pytest.fixture
def click_track() -> Callable[..., Audio]:
    """`click_track(bpm)`: clicks at 0, 60/bpm, 120/bpm ... seconds, each 20 ms of a decaying 1 kHz tone."""

    def build(bpm: float, *, seconds: float = 10.0, sample_rate: int = 22050) -> Audio:
        samples = np.zeros(round(seconds * sample_rate))
        time = np.arange(round(0.02 * sample_rate)) / sample_rate
        click = np.sin(2 * np.pi * 1000 * time) * np.exp(-time / 0.005)
        for start in np.arange(0.0, seconds - 0.02, 60.0 / bpm):
            first = round(start * sample_rate)
            samples[first : first + click.size] += click
        return Audio(samples, sample_rate)

    return build


@pytest.fixture
def swinging_arm() -> Callable[..., Motion]:
    """`swinging_arm(hertz, fps)`: a straight arm that swings to and fro about a fixed shoulder.

    Its angle is sin(2 pi hertz t), so it rests (speed 0) at t = (k + 1/2) / (2 hertz) and is fastest half way between.
    """

    def build(hertz: float, fps: float, *, seconds: float = 6.0) -> Motion:
        time = np.arange(round(seconds * fps)) / fps
        angle = np.sin(2 * np.pi * hertz * time)
        direction = np.stack([np.sin(angle), -np.cos(angle), np.zeros_like(angle)], axis=1)
        shoulder = np.array([0.0, 1.4, 0.0])
        positions = shoulder + np.array([0.0, 0.3, 0.6])[None, :, None] * direction[:, None, :]
        return Motion(positions, fps, Skeleton(("shoulder", "elbow", "wrist"), (-1, 0, 1)))

    return build


@pytest.fixture(scope="session")
def planted_clip() -> Clip:
    """Six seconds of a synthetic cha-cha whose beats are known."""
    from harmolab.data.synthetic import synthetic_clip

    return synthetic_clip("cha-cha", seed=0)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A headless Chromium of Playwright, which may play sound unasked."""
    playwright = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    with playwright.sync_playwright() as session:
        if program is None and not Path(session.chromium.executable_path).is_file():
            pytest.skip("no Chromium here: install chromium, or run `playwright install chromium`")
        arguments = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        arguments += ["--autoplay-policy=no-user-gesture-required"]
        browser = session.chromium.launch(executable_path=program, args=arguments)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def data_root() -> Path:
    """The folder of recordings: ``HARMOLAB_DATA``, else ``../shared/data`` beside the repository."""
    named = os.environ.get("HARMOLAB_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no recordings: set HARMOLAB_DATA to a folder of sequences ({folder} is not there)")
    return folder
