"""Corpora without any effect lie inside the chance band of `compare`; recordings of dancers in time do not."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import Recording
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.compare.auc import compare
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.types import Audio, Clip, Motion
from tests.builders import cases

FPS = 30.0
SECONDS = 24.0
N_CORPORA = 12
N_DRAWS = 100


def smooth_noise(rng: np.random.Generator, period: float) -> Motion:
    """Eight joints that wander."""
    frames = round(SECONDS * FPS)
    places = gaussian_filter1d(rng.normal(size=(frames, 8, 3)), rng.uniform(3, 6), axis=0)
    return Motion(0.15 * places / places.std() + 0.5 * rng.normal(size=(8, 3)), FPS, Skeleton.unnamed(8))


def one_phase(rng: np.random.Generator, period: float) -> Motion:
    """A dancer of the music's tempo, from a random moment of its bar on."""
    beats = np.arange(-4, SECONDS / period + 4) * period + rng.uniform(0, 4 * period)
    inside = beats[(beats >= 0) & (beats < SECONDS)]
    return synthetic_motion(inside, seconds=SECONDS, fps=FPS, dance="cha-cha", seed=int(rng.integers(10**9)))


def null_corpus(move: Callable[[np.random.Generator, float], Motion], seed: int) -> list[Recording]:
    """Eight recordings of 24 s to annotated music that the motion knows nothing of; every figure is named."""
    rng = np.random.default_rng(seed)
    recordings = []
    for number in range(8):
        period = rng.uniform(0.4, 0.7)
        times, edges = np.arange(0, SECONDS + 1, period), np.linspace(0, SECONDS, 5)
        units = tuple(Unit(f"{number} {i}", edges[i], edges[i + 1], 4, f"figure {number} {i}") for i in range(4))
        annotation = BeatAnnotation(times, times[::4], 4, 60 / period, "cha-cha", units, 0.0)
        sound = Audio(np.zeros(round(1000 * (SECONDS + 1))), 1000)
        clip = Clip(f"S{number}", sound, move(rng, period), 0.0, "hand-made", dance="cha-cha")
        recordings.append(Recording(clip, annotation, Path("corpus") / f"S{number}"))
    return recordings


@pytest.mark.slow
@pytest.mark.parametrize("move", [smooth_noise, one_phase])
def test_corpora_without_effect_lie_inside_the_band(
    move: Callable[[np.random.Generator, float], Motion], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("HARMOLAB_CACHE", "off")
    outside = {"recommended": 0, "discriminant": 0, "peaks_lagged": 0}
    for seed in range(N_CORPORA):
        scores = compare(null_corpus(move, seed), n_rotations=N_DRAWS, seed=seed).summary["scores"]
        for name in outside:
            low, high = scores[name]["chance_band"]
            outside[name] += not low <= scores[name]["auc"] <= high
    # At one in ten, four and more of twelve happen once in forty.
    assert max(outside.values()) <= 3


@pytest.mark.data
@pytest.mark.slow
@cases("corpus, window, least", ("beatlocked", 6.0, 0.77), ("beatlocked", None, 0.90), ("realdance/replays", 6.0, 0.90))
def test_recorded_movement_in_time_is_told_from_lagged_music(
    data_root: Path, corpus: str, window: float | None, least: float
):
    row = compare(data_root / corpus, window=window, n_rotations=100).summary["scores"]["recommended"]
    assert row["auc"] >= least
    assert row["auc"] > row["chance_band"][1]


@pytest.mark.data
@pytest.mark.slow
def test_discriminant_tells_more_of_recorded_dance_and_finds_fewer_lags(data_root: Path):
    summary = compare(data_root / "beatlocked", n_rotations=100).summary
    row, beside = summary["scores"]["discriminant"], summary["discriminant"]
    assert row["auc"] >= 0.85
    assert row["auc"] > row["chance_band"][1]
    assert beside["interval"][0] > 0
    assert beside["lags_found"]["recommended"] > beside["lags_found"]["discriminant"]
