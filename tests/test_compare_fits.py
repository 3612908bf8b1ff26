"""Fits of many clips at once: as the place test, wherever the music begins, and with patterns learnt anew."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.lab.compare.scores import PeakLags, with_one_place
from harmolab.lab.compare.windows import MOMENTS, FitBatch, Lessons, coefficients, cycle_curve
from harmolab.params import BarPattern
from harmolab.shape_speed import ShapeSignal
from harmolab.types import BeatTrack
from harmolab.verdict.bar_pattern import beat_positions, evaluate_pattern, fit_pattern, pattern_sums
from harmolab.verdict.evidence import place_test
from tests.builders import metronome

RATE = 100.0
WALTZ = BarPattern(3, (0.1, 0.2, 0.1), (0.4, -0.1, 0.2))
HALF = BarPattern(2, (0.3, -0.1), (0.4, 0.0))


def smooth_noise(rng: np.random.Generator, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Seconds and values of a curve that knows nothing of any beat."""
    values = gaussian_filter1d(rng.normal(size=round(seconds * RATE)), 8)
    return np.arange(values.size) / RATE, (values - values.mean()) / values.std()


def bars(count: int, cycle: int, *, period: float = 0.5, first: float = 0.0) -> BeatTrack:
    places = np.arange(count) % cycle
    return metronome(np.ones(count), period=period, first=first, bar_places=places)


def test_curve_begins_where_a_cycle_does_and_holds_whole_cycles():
    times = np.arange(0, 8.0, 0.01)
    track = bars(12, 3, period=0.5, first=0.5)  # from 0.5 to 6 s, but the beats go on to 8 s: 16 beats, 5 whole cycles
    speed = np.cos(2 * np.pi * (times - 0.5) / 1.5)  # largest on every "one"
    curve = cycle_curve(times, speed, track, 3)
    assert curve.size == 5 * 3 * MOMENTS
    np.testing.assert_allclose(curve, np.tile(np.cos(2 * np.pi * np.arange(3 * MOMENTS) / (3 * MOMENTS)), 5), atol=2e-3)


@pytest.mark.parametrize(
    ("beats", "speed", "cycle"),
    [(1, np.ones(600), 2), (12, np.zeros(600), 2), (12, np.ones(600), 13)],
    ids=["one beat", "no movement", "no whole cycle"],
)
def test_clip_without_cycles_has_no_curve_and_no_harmony(beats: int, speed: np.ndarray, cycle: int):
    curve = cycle_curve(np.arange(600) / RATE, speed, bars(beats, cycle), cycle)
    assert curve.size == 0
    rest = coefficients(BarPattern.stop_on_the_beat(), cycle)
    np.testing.assert_array_equal(FitBatch.of([curve], cycle).harmony(rest[None]), np.zeros((1, 10 * cycle)))


@pytest.mark.parametrize("pattern", [BarPattern.stop_on_the_beat(), HALF, WALTZ])
def test_harmony_of_many_clips_is_that_of_the_place_test(pattern: BarPattern, rng: np.random.Generator):
    # Beats half a second apart lie on every fiftieth sample; the clips end with a whole cycle.
    curves, singles = [], []
    for cycles in (6, 9, 7):
        count = cycles * pattern.beats
        times, values = smooth_noise(rng, count * 0.5 + 0.01)
        track = bars(count + 1, pattern.beats)
        curves.append(cycle_curve(times, values, track, pattern.beats))
        signal = ShapeSignal(times, values, np.ones(times.size, bool), 1.0, 1.0, 1.0, 3)
        test = place_test(signal, track.times, track.bar_places, pattern)
        singles.append(2 * np.interp(np.arange(10) / 10 * 48, np.arange(test.curve.size), test.curve) - 1)
    weights = np.tile(coefficients(pattern, pattern.beats), (3, 1))
    many = FitBatch.of(curves, pattern.beats).harmony(weights)
    # One ranks 20 moments a beat, the other 48.
    np.testing.assert_allclose(many[:, :10], singles, atol=0.04)


def test_pattern_of_a_beat_is_the_same_over_a_cycle_of_beats():
    np.testing.assert_array_equal(coefficients(BarPattern(1, (-1.0,), (0.5,)), 3), [0, 0, 0, 0, -1, 0.5])
    np.testing.assert_array_equal(coefficients(HALF, 2), [0.3, 0.4, -0.1, 0.0])


def lessons_of(clips: Sequence[tuple[np.ndarray, np.ndarray]], track: BeatTrack, cycle: int) -> Lessons:
    sums = [pattern_sums(beat_positions(times, track), values, cycle) for times, values in clips]
    return Lessons.of(sums, ~np.eye(len(clips), dtype=bool), cycle)


def test_patterns_are_learnt_on_the_others(rng: np.random.Generator):
    clips = [smooth_noise(rng, 6.0) for _ in range(3)]
    track = bars(12, 2)
    weights = lessons_of(clips, track, 2).weights()
    pattern = fit_pattern([pattern_sums(beat_positions(times, track), values, 2) for times, values in clips[1:]])
    expected = coefficients(pattern, 2)
    np.testing.assert_allclose(weights[0] / np.linalg.norm(weights[0]), expected / np.linalg.norm(expected))


def test_pattern_learnt_on_later_music_is_that_of_the_moved_beats(rng: np.random.Generator):
    clips = [smooth_noise(rng, 6.0) for _ in range(2)]
    origins = np.array([0.7, 1.3])
    moved = lessons_of(clips, bars(12, 2), 2).weights(origins)
    for judged, teacher in ((0, 1), (1, 0)):
        late = bars(12, 2, first=origins[teacher] * 0.5)
        sums = pattern_sums(beat_positions(clips[teacher][0], late), clips[teacher][1], 2)
        expected = np.stack([sums.sums.real, -sums.sums.imag], axis=-1).ravel()
        np.testing.assert_allclose(moved[judged], expected, atol=1e-9)


def test_nobody_to_learn_from_leaves_movements_that_stop_on_the_beat(rng: np.random.Generator):
    weights = lessons_of([smooth_noise(rng, 6.0)], bars(12, 2), 2).weights()
    np.testing.assert_array_equal(weights, [[0.0, 0.0, -1.0, 0.0]])


def test_dancers_of_one_mind_are_right_wherever_the_music_begins_for_all(rng: np.random.Generator):
    track = bars(12, 3)
    times = np.arange(600) / RATE
    clips = [(times, evaluate_pattern(WALTZ, times / 0.5) + 0.1 * smooth_noise(rng, 6.0)[1]) for _ in range(4)]
    batch, lessons = FitBatch.of([cycle_curve(*clip, track, 3) for clip in clips], 3), lessons_of(clips, track, 3)
    first, later = (batch.harmony(lessons.weights(np.full(4, beats))) for beats in (0.0, 0.7))
    np.testing.assert_allclose(first[:, 0], later[:, 7], atol=0.1)
    assert first[:, 0].min() > 0.8 > 0.5 > first[:, 7].max()
    assert later[:, 7].min() > 0.8 > 0.5 > later[:, 0].max()


# Where nobody knows which beat is "one"


def test_place_of_one_is_the_best_of_the_other_clips():
    # Clips of two beats: three fit where the second beat is "one", the last where the first is.
    first, second = np.repeat([0.8, -0.8], 10), np.repeat([-0.6, 0.9], 10)
    values = with_one_place(np.array([second, second, second, first]), np.zeros(4, int))
    np.testing.assert_allclose(values[:, 0], [0.9, 0.9, 0.9, -0.8])  # the last has no say in its own
    np.testing.assert_array_equal(values[:, :10], values[:, 10:])


def test_places_are_chosen_by_recording_and_a_clip_alone_has_the_mean():
    first, second = np.repeat([0.8, -0.8], 10), np.repeat([-0.6, 0.9], 10)
    values = with_one_place(np.array([second, first, second, first]), np.array([0, 1, 0, 2]))
    np.testing.assert_allclose(values[:, 0], [0.9, 0.0, 0.9, 0.0], atol=1e-12)


def test_place_is_chosen_at_every_lag_as_at_none(rng: np.random.Generator):
    grid = rng.normal(size=(5, 30))
    values, moved = (with_one_place(rows, np.zeros(5, int)) for rows in (grid, np.roll(grid, -4, axis=1)))
    np.testing.assert_allclose(moved, np.roll(values, -4, axis=1))


# Lags


def test_lag_is_fitted_anew_where_the_music_begins_later():
    peaks = np.zeros((3, 10))
    peaks[[0, 1, 2], [2, 2, 5]] = 1.0
    usable = np.array([[False, True, False], [True, False, False], [False, False, False]])
    np.testing.assert_array_equal(PeakLags(peaks, usable, True).at(np.zeros(3, int)), [2, 2, 0])
    np.testing.assert_array_equal(PeakLags(peaks, usable, True).at(np.array([1, 3, 0])), [9, 1, 0])
    np.testing.assert_array_equal(PeakLags(peaks, usable, False).at(np.array([1, 3, 0])), [2, 2, 0])
