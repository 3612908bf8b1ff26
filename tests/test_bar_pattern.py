"""The recommended measure: what a bar pattern is, how it is learnt, and what a fit says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from harmolab.bar_pattern import (
    PatternFit,
    beat_positions,
    evaluate_pattern,
    fit_of_motion,
    fit_pattern,
    moment_ranks,
    normalised_speed,
    pattern_sums,
)
from harmolab.harmony import score_motion
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import Motion, Skeleton
from tests import builders

track = partial(builders.track, duration=30.0)
RECOMMENDED = HarmonyParams.room_speed()
Swing = Callable[..., Motion]


def dance_of_two(cycles: int = 12, fps: float = 60.0) -> Motion:
    """Beats every half second; fast after each even beat, slow after each odd one (a cycle of two beats, 1 s)."""
    times = np.arange(round(cycles * fps)) / fps
    # The speed is 2 + cos(2 pi t): fastest at every even beat, slowest at every odd one.
    place = 2 * times + np.sin(2 * np.pi * times) / (2 * np.pi)
    positions = np.zeros((times.size, 1, 3))
    positions[:, 0, 0] = place
    return Motion(positions, fps, Skeleton.unnamed(1))


FAST_ON_EVEN_BEATS = BarPattern(2, (1.0,), (0.0,))


def test_a_pattern_is_a_fourier_series_of_the_beat_position():
    pattern = BarPattern(2, (1.0, 0.5), (0.0, 2.0))
    # At 0: 1 + .5; half a beat on, a quarter of the cycle: cos(pi/2) + .5 cos(pi) + 2 sin(pi).
    np.testing.assert_allclose(evaluate_pattern(pattern, np.array([0.0, 0.5, 2.0])), [1.5, -0.5, 1.5], atol=1e-12)


def test_stopping_on_the_beat_is_slowest_on_the_beat():
    np.testing.assert_allclose(evaluate_pattern(BarPattern.stop_on_the_beat(), np.array([0.0, 0.5, 1.0])), [-1, 1, -1])


def test_positions_count_beats_and_go_on_beyond_them():
    beats = track([1.0, 2.0, 4.0])
    times = np.array([0.0, 0.5, 1.0, 1.5, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(beat_positions(times, beats), [-1, -0.5, 0, 0.5, 1.5, 2, 2.5])


def test_positions_start_at_the_first_beats_place_in_the_bar():
    np.testing.assert_allclose(
        beat_positions(np.array([1.0, 2.5]), track([1.0, 2.0, 3.0], bar_places=[3, 0, 1])), [3, 4.5]
    )


@pytest.mark.parametrize("times", [[], [1.0]])
def test_positions_need_a_tempo(times: list[float]):
    with pytest.raises(ValueError, match=f"a pattern needs two music beats at least, got {len(times)}"):
        beat_positions(np.array([0.0]), track(times))


def test_a_planted_pattern_is_learnt_back():
    planted = BarPattern(3, (0.5, -0.25, 0.125), (1.0, 0.125, 0.0))  # harmonics up to one turn a beat
    positions = np.arange(0, 30, 0.01)  # ten whole cycles
    learnt = fit_pattern([pattern_sums(positions, evaluate_pattern(planted, positions), 3)], source="a test")
    np.testing.assert_allclose(learnt.cosines, planted.cosines, atol=1e-9)
    np.testing.assert_allclose(learnt.sines, planted.sines, atol=1e-9)
    assert (learnt.beats, learnt.source) == (3, "a test")


def test_pieces_count_by_their_length():
    positions = np.arange(0, 3, 0.01)
    short = pattern_sums(positions, np.cos(2 * np.pi * positions), 1)
    long = pattern_sums(np.tile(positions, 3), np.zeros(3 * positions.size), 1)
    np.testing.assert_allclose(fit_pattern([short, long]).cosines, [0.25], atol=1e-9)


def test_a_pattern_of_nothing_is_refused():
    with pytest.raises(ValueError, match="no motion to fit a bar pattern on"):
        fit_pattern([])


def test_pieces_of_different_cycles_are_refused():
    pieces = [pattern_sums(np.arange(10.0), np.ones(10), beats) for beats in (2, 3)]
    with pytest.raises(ValueError, match=r"pieces with cycles of \[2, 3\] beats cannot share a pattern"):
        fit_pattern(pieces)


def test_normalised_speed_has_mean_zero_and_unit_spread(swinging_arm: Swing):
    times, speed = normalised_speed(swinging_arm(1.0, 60.0), RECOMMENDED)
    assert speed.mean() == pytest.approx(0, abs=1e-12)
    assert speed.std() == pytest.approx(1)
    assert np.diff(times) == pytest.approx(1 / 120)


def test_normalised_speed_ignores_how_large_the_dancer_is(swinging_arm: Swing):
    motion = swinging_arm(1.0, 30.0)
    giant = replace(motion, positions=1000 * motion.positions)
    np.testing.assert_allclose(
        normalised_speed(motion, RECOMMENDED)[1], normalised_speed(giant, RECOMMENDED)[1], atol=1e-9
    )


@pytest.mark.parametrize("fps", [15.0, 25.0, 30.0, 60.0])
def test_the_speed_curve_does_not_show_the_frame_rate(swinging_arm: Swing, fps: float):
    times, speed = normalised_speed(swinging_arm(1.0, 120.0), RECOMMENDED)
    slow_times, slow = normalised_speed(swinging_arm(1.0, fps), RECOMMENDED)
    inner = (slow_times > 1.0) & (slow_times < 4.5)  # the last frame of a slow motion comes earlier
    np.testing.assert_allclose(slow[inner], np.interp(slow_times[inner], times, speed), atol=0.1)


@pytest.mark.parametrize("step", [0.0, 0.02])
def test_a_dancer_at_rest_or_at_constant_speed_has_no_rhythm(step: float):
    course = 0.1 + step * np.arange(100.0)[:, None, None] * np.ones((1, 2, 3))
    for fps in (25.0, 120.0):
        assert not normalised_speed(Motion(course, fps, Skeleton.unnamed(2)), RECOMMENDED)[1].any()


def test_ranks_of_moments_are_spread_evenly_between_zero_and_one(rng: np.random.Generator):
    ranks = moment_ranks(rng.normal(size=240), BarPattern(2, (1.0, 0.3), (0.2, 0.1)))
    assert ranks.shape == (2, 240)
    for row in ranks:
        np.testing.assert_allclose(np.sort(row), (np.arange(240) + 0.5) / 240)


def test_the_moment_that_looks_like_the_pattern_ranks_highest():
    pattern = BarPattern.stop_on_the_beat()
    curve = np.zeros(24 * 9)
    around = np.arange(-12, 13)
    curve[100 + around] = evaluate_pattern(pattern, around / 24) * (1 + np.cos(np.pi * around / 12))
    assert np.argmax(moment_ranks(curve, pattern)[0]) == 100


def test_the_fit_of_a_dancer_who_stops_on_the_beat_is_high_and_half_a_beat_off_it_is_low(swinging_arm: Swing):
    arm = swinging_arm(1.0, 60.0)
    on, off = (fit_of_motion(track(first + 0.5 * np.arange(11)), arm, RECOMMENDED) for first in (0.25, 0.5))
    assert on.mean > 0.9
    assert off.mean < 0.1
    assert on.chance == off.chance == 0.5
    # The observation is no part of its null; with it, every rank occurs once and the mean is that of chance.
    assert np.append(on.null, on.mean).mean() == pytest.approx(0.5, abs=1e-9)


def test_the_mean_is_weighted_by_strength():
    fit = PatternFit(track([1.0, 2.0], [3.0, 1.0]), np.array([1.0, 0.0]), np.zeros(1), 0.5)
    assert fit.mean == 0.75


def test_a_fit_without_beats_has_mean_zero():
    assert PatternFit(track([]), np.zeros(0), np.zeros(1), 0.5).mean == 0.0


@pytest.mark.parametrize("times", [[], [3.0]])
def test_without_a_tempo_the_fit_is_that_of_chance(swinging_arm: Swing, times: list[float]):
    fit = fit_of_motion(track(times), swinging_arm(1.0, 60.0), RECOMMENDED)
    np.testing.assert_array_equal(fit.shares, np.full(len(times), 0.5))
    assert fit.chance == 0.5


def test_a_frozen_dancer_fits_as_chance_does():
    frozen = Motion(np.full((100, 2, 3), 0.1), 25.0, Skeleton.unnamed(2))
    fit = fit_of_motion(track([1.0, 2.0, 3.0]), frozen, RECOMMENDED)
    np.testing.assert_array_equal(fit.shares, [0.5, 0.5, 0.5])
    assert set(fit.null) == {0.5}


def test_known_bar_places_tell_even_beats_from_odd_ones():
    params = HarmonyParams.recommended(FAST_ON_EVEN_BEATS)
    beats = np.arange(1.0, 11.0, 0.5)
    places = [k % 4 for k in range(beats.size)]
    right = fit_of_motion(track(beats, bar_places=places), dance_of_two(), params)
    wrong = fit_of_motion(track(beats, bar_places=[(place + 1) % 4 for place in places]), dance_of_two(), params)
    assert right.mean > 0.85
    assert wrong.mean < 0.15
    assert right.chance == wrong.chance == 0.5


def test_without_bar_places_the_best_one_is_taken_and_chance_is_what_the_best_reaches():
    params = HarmonyParams.recommended(FAST_ON_EVEN_BEATS)
    beats = np.arange(1.0, 11.0, 0.5)
    fits = [fit_of_motion(track(beats + late), dance_of_two(), params) for late in (0.0, 0.5)]
    for fit in fits:
        assert fit.mean > 0.85
        assert 0.6 < fit.chance < fit.mean  # the better of two opposite places is never below the middle
    assert fits[0].mean == pytest.approx(fits[1].mean, abs=0.05)


def test_the_score_does_not_depend_on_how_many_rotations_were_asked_for():
    params = HarmonyParams.recommended(FAST_ON_EVEN_BEATS)
    beats = track(np.arange(1.0, 11.0, 0.5))
    none, many = (score_motion(beats, dance_of_two(), params=params, n_rotations=count) for count in (0, 1000))
    assert none.harmony_above_chance == pytest.approx(many.harmony_above_chance, abs=0.02)
    assert many.harmony_above_chance > 0.5


def test_a_beat_too_weak_to_count_does_not_move_the_others_in_the_bar():
    # Without the fourth beat all later ones would count as odd, and the fit would fall from high to low.
    params = HarmonyParams.recommended(FAST_ON_EVEN_BEATS)
    beats = np.arange(1.0, 11.0, 0.5)
    places = [k % 4 for k in range(beats.size)]
    strengths = np.ones(beats.size)
    strengths[3] = 0.0
    whole = fit_of_motion(track(beats, bar_places=places), dance_of_two(), params)
    weak = fit_of_motion(track(beats, bar_places=places, strengths=strengths), dance_of_two(), params)
    np.testing.assert_allclose(weak.shares, np.delete(whole.shares, 3))


def test_a_lag_is_taken_off_the_motion(swinging_arm: Swing):
    early = fit_of_motion(track(0.25 - 0.12 + 0.5 * np.arange(1, 11)), swinging_arm(1.0, 60.0), RECOMMENDED)
    params = replace(RECOMMENDED, lag=0.12)
    fit = fit_of_motion(track(0.25 - 0.12 + 0.5 * np.arange(1, 11)), swinging_arm(1.0, 60.0), params)
    assert fit.mean > 0.9 > early.mean


def test_a_motion_shorter_than_the_grid_of_moments_fits_as_chance_does(rng: np.random.Generator):
    brief = Motion(rng.normal(size=(3, 1, 3)), 240.0, Skeleton.unnamed(1))
    fit = fit_of_motion(track([0.001, 5.0, 10.0]), brief, RECOMMENDED)
    np.testing.assert_array_equal(fit.shares, [0.5, 0.5, 0.5])


def test_doubled_beats_are_refused_before_they_fill_the_memory(swinging_arm: Swing):
    with pytest.raises(ValueError, match=r"music beats lie 1e-07 s apart: are there doubles among them\?"):
        fit_of_motion(track([1.0, 1.0000001]), swinging_arm(1.0, 60.0), RECOMMENDED)


HALVED = np.pi / np.sqrt(0.5 * np.log(2))  # seconds: a Gaussian with an SD of one second keeps half of such a wave


@pytest.mark.parametrize(("period", "left"), [(HALVED, 1 / 2), (HALVED / 2, 15 / 16), (2 * HALVED, 1 - 2**-0.25)])
def test_a_gaussian_of_one_second_is_the_drift_that_is_taken_off_the_speed(period: float, left: float) -> None:
    # Its share of a wave is exp(-2 (pi SD / period)^2). Beside the slow wave a fast one, of which all is left.
    fps = 50.0
    times = (np.arange(round(40 * period * fps)) + 0.5) / fps
    waves = [np.exp(2j * np.pi * times / each) for each in (period, 0.5)]
    steps = 3 + waves[0].imag + waves[1].imag
    params = replace(RECOMMENDED, position_smoothing=0.0, smoothing=0.0)
    found, speed = normalised_speed(builders.along_x(np.cumsum(steps) / fps, fps=fps), params)
    slow, fast = (abs(np.exp(-2j * np.pi * found / each) @ speed) for each in (period, 0.5))
    assert slow / fast == pytest.approx(left, rel=0.03)
