"""Bar patterns: what one is, how it is learnt, and how well moments and beats fit it."""

from functools import partial

import numpy as np
import pytest

from harmolab.params import BarPattern
from harmolab.verdict.bar_pattern import (
    GRID,
    beat_curve,
    beat_positions,
    beat_ranks,
    evaluate_pattern,
    fit_pattern,
    moment_ranks,
    pattern_fits,
    pattern_sums,
    templates,
)
from tests import builders
from tests.builders import refused

track = partial(builders.track, duration=30.0)
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
    refused("no motion to fit a bar pattern on", fit_pattern, [])


def test_pieces_of_different_cycles_are_refused():
    pieces = [pattern_sums(np.arange(10.0), np.ones(10), beats) for beats in (2, 3)]
    refused(r"pieces with cycles of \[2, 3\] beats cannot share a pattern", fit_pattern, pieces)


# Fits and ranks

WALTZ = BarPattern(3, (0.1, 0.2, 0.1), (0.4, -0.1, 0.2))


@pytest.mark.parametrize("moments", [20, 24, 48])
@pytest.mark.parametrize("pattern", [BarPattern.stop_on_the_beat(), FAST_ON_EVEN_BEATS, WALTZ])
def test_a_fit_is_the_windowed_pattern_without_mean_times_the_speed_around_a_moment(
    pattern: BarPattern, moments: int, rng: np.random.Generator
):
    speed = rng.normal(size=5 * pattern.beats * moments)
    fits = pattern_fits(speed, pattern, moments=moments)
    offsets = np.arange(-(pattern.beats * moments // 2), pattern.beats * moments // 2 + 1)
    window = np.cos(np.pi * offsets / moments / pattern.beats) ** 2
    for place, moment in ((0, 7), (pattern.beats - 1, 4 * moments)):
        expected = window * evaluate_pattern(pattern, offsets / moments + place)
        expected -= window * expected.sum() / window.sum()
        around = speed[(moment + offsets) % speed.size]
        np.testing.assert_allclose(templates(pattern, moments)[place], expected, atol=1e-12)
        assert fits[place, moment] == pytest.approx(expected @ around, abs=1e-9)


def test_ranks_of_moments_are_spread_evenly_between_zero_and_one(rng: np.random.Generator):
    np.testing.assert_allclose(np.sort(moment_ranks(rng.normal(size=240))), (np.arange(240) + 0.5) / 240)


def test_fits_that_differ_by_rounding_only_share_a_rank():
    np.testing.assert_allclose(moment_ranks(np.array([1.0, 1 + 1e-10, 0.0, 1 - 1e-8])), [0.75, 0.75, 0.125, 0.375])


def test_a_body_at_rest_ranks_in_the_middle():
    times = np.arange(1200) / 100.0
    ranks = beat_ranks(times, np.zeros(times.size), track(np.arange(1.0, 11.0, 0.5)), FAST_ON_EVEN_BEATS)
    np.testing.assert_array_equal(ranks, np.full(20, 0.5))


@pytest.mark.parametrize(("place", "fits"), [(0, True), (1, False)])
def test_known_bar_places_tell_even_beats_from_odd_ones(place: int, fits: bool):
    # Beats every half second from 1 s on; fastest on the even ones, slowest on the odd ones.
    times = np.arange(1200) / 100.0
    beats = np.arange(1.0, 11.0, 0.5)
    music = track(beats, bar_places=[(k + place) % 4 for k in range(beats.size)])
    ranks = beat_ranks(times, np.cos(2 * np.pi * times), music, FAST_ON_EVEN_BEATS)
    assert ((ranks > 0.85) == fits).all() and ((ranks < 0.15) != fits).all()


def test_beats_are_ranked_among_24_moments_a_beat_with_nothing_beyond_the_ends(rng: np.random.Generator):
    # Twelve beats whose first is the second of a bar of two; the movement lasts from the first beat to the last.
    times, speed = np.arange(265) / 48.0, rng.normal(size=265)
    ranks = beat_ranks(times, speed, track(0.5 * np.arange(12), bar_places=np.arange(1, 13) % 2), FAST_ON_EVEN_BEATS)
    kernels = templates(FAST_ON_EVEN_BEATS, 24)
    expected = [moment_ranks(np.convolve(speed, kernel[::-1], mode="same")) for kernel in kernels]
    np.testing.assert_allclose(ranks, [expected[(beat + 1) % 2][24 * beat] for beat in range(12)], atol=1e-12)


def test_without_known_bar_places_the_pattern_begins_on_the_first_beat():
    times = np.arange(1200) / 100.0
    for late, fits in ((0.0, True), (0.5, False)):
        ranks = beat_ranks(
            times, np.cos(2 * np.pi * times), track(np.arange(1.0, 11.0, 0.5) + late), FAST_ON_EVEN_BEATS
        )
        assert ((ranks > 0.85) == fits).all()


def test_beats_beyond_the_movement_count_at_its_ends_and_nothing_moves_there():
    # Two seconds of movement, slowest on each beat; beyond its ends half of the window sees nothing.
    times = np.arange(201) / 100.0
    ranks = beat_ranks(
        times, -np.cos(4 * np.pi * times), track(np.arange(0.0, 4.0, 0.5)), BarPattern.stop_on_the_beat()
    )
    assert ranks[1:4].min() > 0.95
    np.testing.assert_array_equal(ranks[4:], ranks[4])
    assert ranks[4] < ranks[1:4].min()


def test_the_curve_has_a_sample_a_moment_and_its_first_moment_a_number():
    times = np.arange(301) / 100.0
    curve, first = beat_curve(times, times, track([1.0, 1.5, 2.0]))
    # Beat 0 is at 1 s: the movement begins two beats before it and ends four beats after.
    assert (first, curve.size) == (-2 * GRID, 6 * GRID + 1)
    np.testing.assert_allclose(curve[2 * GRID], 1.0, atol=1e-12)


def test_doubled_beats_are_refused_before_they_fill_the_memory():
    times = np.arange(600) / 100.0
    with pytest.raises(ValueError, match=r"music beats lie 1e-07 s apart: are there doubles among them\?"):
        beat_curve(times, np.cos(times), track([1.0, 1.0000001]))
