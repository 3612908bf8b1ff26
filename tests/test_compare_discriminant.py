"""The discriminant of `compare`: what it learns, from whom, and that it sees what the learnt curve of speed cannot.

The bodies here change their shape at random, which no music knows of, and are carried up and down as one piece: fastest
upwards `peak` beats after every beat. The music has a beat every half second, two in a cycle.

Corpora without any effect lie inside the chance band of `compare`; recordings of dancers in time do not.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import Recording
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.compare import rows
from harmolab.lab.compare.auc import CorpusResult, compare
from harmolab.lab.compare.scores import DiscriminantLessons, FittedScore, PatternScores, beat_features, recording_lags
from harmolab.lab.compare.windows import MOMENTS, SIGNALS, FitBatch, bounce, cut_clips, signal_batch, turned_signals
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.types import Audio, Clip, FloatArray, Motion
from tests.builders import cases

FPS = 30.0
PERIOD = 0.5
SECONDS = 12.0


@pytest.fixture(autouse=True)
def scores_alone(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is kept of silent songs, nor are their recordings judged: no score of a clip follows from a verdict.

    Recorded songs are listened to once.
    """
    if "data" not in request.keywords:
        monkeypatch.setenv("HARMOLAB_CACHE", "off")
        monkeypatch.setattr(rows, "recording_verdict", lambda recording, beats, clips: None)


def bobbing(seed: int, *, peak: float = 0.0, height: float = 0.05) -> Motion:
    """Eight joints that wander about each other while all of them bob."""
    rng = np.random.default_rng(seed)
    frames = round(SECONDS * FPS)
    wander = gaussian_filter1d(rng.normal(size=(frames, 8, 3)), 4, axis=0)
    wander -= wander.mean(axis=1, keepdims=True)
    places = 0.1 * wander / wander.std() + 0.5 * rng.normal(size=(8, 3))
    places[..., 1] += height * np.sin(2 * np.pi * (np.arange(frames) / FPS / PERIOD - peak))[:, None]
    return Motion(places, FPS, Skeleton.unnamed(8))


def danced(
    name: str, motion: Motion, *figures: str, dance: str = "cha-cha", bars: bool = True, period: float = PERIOD
) -> Recording:
    """A recording that begins on a downbeat; each figure fills an equal stretch of it."""
    edges = np.linspace(0, motion.duration, len(figures) + 1)
    units = tuple(Unit(f"{name} {i}", edges[i], edges[i + 1], 4, figure) for i, figure in enumerate(figures))
    times = np.arange(0, motion.duration + 1, period)
    downbeats, meter = (times[::4], 4) if bars else (None, None)
    annotation = BeatAnnotation(times, downbeats, meter, 60 / period, dance, units, 0.0)
    sound = Audio(np.zeros(round(1000 * (motion.duration + 1))), 1000)
    return Recording(Clip(name, sound, motion, 0.0, "hand-made", dance=dance), annotation, Path("corpus") / name)


def corpus(peaks: list[float]) -> list[Recording]:
    """A recording for each, with figures of its own."""
    return [danced(f"S{i:02}", bobbing(i, peak=peak), f"a{i}", f"b{i}") for i, peak in enumerate(peaks)]


def compared(recordings: list[Recording], **options: object) -> CorpusResult:
    return compare(recordings, **({"n_rotations": 60} | options))


# What it reads


@pytest.mark.parametrize("flip", [1, -1], ids=["metres, y up", "picture, y down"])
def test_bounce_is_how_fast_the_centre_rises(flip: int):
    motion = bobbing(1, peak=0.25)
    if flip < 0:
        motion = Motion(motion.positions[..., :2] * [1, -1], FPS, motion.skeleton)
    times, upwards = bounce(motion)
    expected = np.cos(2 * np.pi * (times / PERIOD - 0.25)) * np.sqrt(2)
    inside = (times > 0.5) & (times < SECONDS - 0.5)
    np.testing.assert_allclose(upwards[inside], expected[inside], atol=0.05)


def test_body_that_keeps_its_height_does_not_bounce():
    sliding = bobbing(1, height=0.0).positions.copy()
    sliding[..., 1] = np.arange(8)
    assert not bounce(Motion(sliding, FPS, Skeleton.unnamed(8)))[1].any()


@pytest.fixture
def noise(rng: np.random.Generator) -> FitBatch:
    """Five clips of noise of 8, 12, 8, 0 and 10 beats in cycles of two."""
    sizes = (8, 12, 8, 0, 10)
    names = ("recommended", "bounce")
    return signal_batch([{name: rng.normal(size=size * MOMENTS) for name in names} for size in sizes], 2, SIGNALS)


def test_features_of_a_beat_are_turned_to_where_a_cycle_begins(rng: np.random.Generator):
    batch = signal_batch([{name: rng.normal(size=9 * MOMENTS) for name in SIGNALS}], 3, SIGNALS)
    fits, weights = batch.fits[0], rng.normal(size=12)
    features = beat_features(fits, 3)
    assert features.shape == (30, 9, 12)
    for lag, beat in ((0, 0), (0, 1), (7, 5), (13, 7)):
        moment = (beat * MOMENTS + lag * 2) % fits.shape[1]
        expected = turned_signals(weights, 3, beat % 3) @ fits[:, moment]
        assert features[lag, beat] @ weights == pytest.approx(expected)


def test_clip_that_stays_level_is_read_by_its_shape_alone(rng: np.random.Generator):
    shape = rng.normal(size=4 * MOMENTS)
    batch = signal_batch([{"recommended": shape, "bounce": np.zeros(0)}], 2, SIGNALS)
    assert batch.sizes.tolist() == [shape.size]
    np.testing.assert_array_equal(batch.fits[:, :4], FitBatch.of([shape], 2).fits)
    assert not batch.fits[:, 4:].any()


# What it learns


def by_hand(clips: list[FloatArray]) -> FloatArray:
    """The formula, over the features (L, B, F) of all clips together."""
    true = np.concatenate([rows[0] for rows in clips])
    later = np.concatenate([rows[lag] for rows in clips for lag in (3, 4, 5, 6, 7)])
    within = (np.cov(true.T, bias=True) + np.cov(later.T, bias=True)) / 2
    return np.linalg.solve(within + np.trace(within) / 8 * np.eye(8), true.mean(axis=0) - later.mean(axis=0))


def test_weights_are_those_of_the_formula_on_the_clips_that_may_teach(noise: FitBatch):
    weights = DiscriminantLessons.of(noise, ~np.eye(5, dtype=bool)).weights()
    timed = (0, 1, 2, 4)  # the fourth has no beats
    features = {i: beat_features(noise.fits[i, :, : noise.sizes[i]], 2) for i in timed}
    for judged in range(5):
        teachers = [rows for i, rows in features.items() if i != judged]
        np.testing.assert_allclose(weights[judged], by_hand(teachers), rtol=1e-9)


def test_music_that_begins_later_teaches_what_it_teaches_from_there_on(noise: FitBatch):
    origins = np.array([0.7, 0.0, 1.3, 0.5, 1.9])
    moved = noise.fits.copy()
    for row, size, origin in zip(moved, noise.sizes, origins, strict=True):
        row[:, :size] = np.roll(row[:, :size], -round(origin * MOMENTS), axis=1)
    usable = ~np.eye(5, dtype=bool)
    expected = DiscriminantLessons.of(replace(noise, fits=moved), usable).weights()
    np.testing.assert_allclose(DiscriminantLessons.of(noise, usable).weights(origins), expected, rtol=1e-9)


def test_nobody_to_learn_from_leaves_bodies_that_stop_on_the_beat(noise: FitBatch):
    usable = np.zeros((5, 5), bool)
    usable[0, 3] = True  # who has no beats teaches nothing
    weights = DiscriminantLessons.of(noise, usable).weights()
    np.testing.assert_array_equal(weights, np.tile([0.0, 0, -1, 0, 0, 0, 0, 0], (5, 1)))


@pytest.mark.slow
def test_bounce_that_is_the_only_sign_is_found_by_the_discriminant_alone():
    summary = compared(corpus([0.0] * 8)).summary
    ours, second = (summary["scores"][name] for name in ("recommended", "discriminant"))
    assert second["auc"] > max(0.95, second["chance_band"][1])
    assert ours["chance_band"][0] <= ours["auc"] <= ours["chance_band"][1]
    beside = summary["discriminant"]
    assert beside["auc_difference"] == pytest.approx(second["auc"] - ours["auc"])
    assert 0 < beside["interval"][0] <= beside["auc_difference"] <= beside["interval"][1]


@pytest.mark.slow
def test_discriminant_of_bodies_at_random_phases_lies_inside_its_chance_band():
    outside = 0
    for seed in range(4):
        peaks = np.random.default_rng(seed).uniform(0, 2, 6)
        row = compared(corpus(peaks.tolist()), seed=seed).summary["scores"]["discriminant"]
        outside += not row["chance_band"][0] <= row["auc"] <= row["chance_band"][1]
    # At one in twenty, two and more of four happen once in seventy times.
    assert outside <= 1


# From whom


@pytest.mark.slow
def test_recordings_with_a_figure_of_the_judged_one_teach_it_nothing():
    # X goes the other way; B would give A's answer away.
    a, b = (danced(name, bobbing(i, peak=0.5), "X", "X") for i, name in enumerate("AB"))
    others = corpus([0.0] * 10)[2:]
    first = compared([a, b, *others], n_rotations=0)
    second = compared([a, danced("B", bobbing(9, peak=0.3), "X", "X"), *others], n_rotations=0)
    true = first.true["discriminant"]
    assert true[:2].max() < -0.5 < 0.5 < true[4:].min()
    np.testing.assert_array_equal(true[:2], second.true["discriminant"][:2])
    assert first.true["discriminant"][4:].tolist() != second.true["discriminant"][4:].tolist()


def test_another_window_of_the_judged_recording_teaches_it_nothing():
    # Each knows only the other, who goes the other way; X is in both, so one window is left to judge it by.
    pair = compared([danced("A", bobbing(1), "X", "Y"), danced("B", bobbing(2, peak=0.5), "X", "Z")], n_rotations=0)
    assert pair.summary["n"] == 4
    assert pair.true["discriminant"].max() < -0.4


def test_dances_of_one_cycle_share_what_they_teach():
    names = ("rumba", "tango", "cha-cha")
    dances = [danced(f"S{i}", bobbing(i), f"a{i}", dance=dance) for i, dance in enumerate(names)]
    result = compared(dances, n_rotations=0)
    assert result.true["discriminant"].min() > 0.5
    assert result.summary["unfitted_parts"] == 6  # the curves of speed have nobody of their own dance


def test_another_corpus_teaches_alone():
    judged, teachers = corpus([0.5] * 4), [danced(f"T{i}", bobbing(20 + i), f"t{i}") for i in range(3)]
    result = compared(judged, fit_on=teachers)
    assert result.true["discriminant"].max() < -0.5
    assert result.wrong["discriminant"][:, 2].min() > 0.5


@pytest.mark.slow
def test_other_music_is_judged_by_what_lagged_music_taught():
    recordings = corpus([0.0] * 4)
    own, other = compared(recordings, n_rotations=0), compared(recordings, null="other", n_rotations=0)
    np.testing.assert_array_equal(own.true["discriminant"], other.true["discriminant"])
    assert other.wrong["discriminant"].shape == (8, 5)
    assert other.wrong["discriminant"].std() > 0.3  # songs of the same tempo, from random moments on


# Its lag


def test_lag_of_a_recording_is_where_its_clips_score_highest_together():
    # Cosines over a cycle of two beats, highest .3 beat late and .2 early; the third recording has no movement.
    shape = [np.cos(np.pi * (np.arange(8 * MOMENTS) / MOMENTS - peak)) for peak in (0.2, 0.4, 1.8)]
    batch = signal_batch([{"recommended": one, "bounce": 0 * one} for one in (*shape, np.zeros(0))], 2, SIGNALS)
    weights = np.tile([1.0, 0, 0, 0, 0, 0, 0, 0], (4, 1))
    part = PatternScores(np.arange(4), batch, None, lambda _: weights)
    score = FittedScore((part,), np.array([0, 0, 1, 2]), np.ones(4, bool))
    (clip, *_) = cut_clips(corpus([0.0])[0], "annotated", 6.0)
    np.testing.assert_allclose(recording_lags(score, [clip] * 4), [0.3, -0.2, np.nan], atol=1e-9)


def test_recordings_whose_lag_is_found_are_counted():
    peaks = [0.0] * 8 + [0.5]
    recordings = [danced(f"S{i}", bobbing(i, peak=peak), f"a{i}", bars=False) for i, peak in enumerate(peaks)]
    assert compared(recordings, n_rotations=0).summary["discriminant"]["lags_found"]["discriminant"] == 8


NULL_SECONDS = 24.0
N_CORPORA = 8
N_DRAWS = 60


def smooth_noise(rng: np.random.Generator, period: float) -> Motion:
    """Eight joints that wander."""
    frames = round(NULL_SECONDS * FPS)
    places = gaussian_filter1d(rng.normal(size=(frames, 8, 3)), rng.uniform(3, 6), axis=0)
    return Motion(0.15 * places / places.std() + 0.5 * rng.normal(size=(8, 3)), FPS, Skeleton.unnamed(8))


def one_phase(rng: np.random.Generator, period: float) -> Motion:
    """A dancer of the music's tempo, from a random moment of its bar on."""
    beats = np.arange(-4, NULL_SECONDS / period + 4) * period + rng.uniform(0, 4 * period)
    inside = beats[(beats >= 0) & (beats < NULL_SECONDS)]
    return synthetic_motion(inside, seconds=NULL_SECONDS, fps=FPS, dance="cha-cha", seed=int(rng.integers(10**9)))


def null_corpus(move: Callable[[np.random.Generator, float], Motion], seed: int) -> list[Recording]:
    """Eight recordings of 24 s to annotated music that the motion knows nothing of; every figure is named."""
    rng = np.random.default_rng(seed)
    recordings = []
    for number in range(8):
        period, figures = rng.uniform(0.4, 0.7), [f"figure {number} {i}" for i in range(4)]
        recordings.append(danced(f"S{number}", move(rng, period), *figures, period=period))
    return recordings


@pytest.mark.slow
@pytest.mark.parametrize("move", [smooth_noise, one_phase])
def test_corpora_without_effect_lie_inside_the_band(move: Callable[[np.random.Generator, float], Motion]):
    outside = {"recommended": 0, "discriminant": 0, "peaks_lagged": 0}
    for seed in range(N_CORPORA):
        scores = compare(null_corpus(move, seed), n_rotations=N_DRAWS, seed=seed).summary["scores"]
        for name in outside:
            low, high = scores[name]["chance_band"]
            outside[name] += not low <= scores[name]["auc"] <= high
    # At one in ten, three and more of eight happen once in 26.
    assert max(outside.values()) <= 2


@cache
def recorded(corpus: Path, window: float | None) -> dict[str, Any]:
    return compare(corpus, window=window, n_rotations=100).summary


@pytest.mark.data
@pytest.mark.slow
@cases("corpus, window, least", ("beatlocked", 6.0, 0.77), ("beatlocked", None, 0.90), ("realdance/replays", 6.0, 0.90))
def test_movement_in_time_is_told_from_lagged_music(data_root: Path, corpus: str, window: float | None, least: float):
    row = recorded(data_root / corpus, window)["scores"]["recommended"]
    assert row["auc"] >= least and row["auc"] > row["chance_band"][1]


@pytest.mark.data
@pytest.mark.slow
def test_discriminant_tells_more_of_recorded_dance_and_finds_fewer_lags(data_root: Path):
    summary = recorded(data_root / "beatlocked", 6.0)
    row, beside = summary["scores"]["discriminant"], summary["discriminant"]
    assert row["auc"] >= 0.85 and row["auc"] > row["chance_band"][1]
    assert beside["interval"][0] > 0
    assert beside["lags_found"]["recommended"] > beside["lags_found"]["discriminant"]
