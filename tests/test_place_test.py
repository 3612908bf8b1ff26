"""Where in the beat? Lags, signs and chance of the place test, on speeds worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.params import HOW_PATTERNS, BarPattern
from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray
from harmolab.verdict.evidence import MOMENTS, PlaceTest, place_test
from tests.builders import refused

PERIOD = 0.5
BEATS = PERIOD * np.arange(41)
REST, HIT = HOW_PATTERNS["rest"], HOW_PATTERNS["hit"]
WALTZ = BarPattern(3, (0.1, 0.2, 0.1), (0.4, -0.1, 0.2), dance="waltz")


def signal(speed: FloatArray) -> ShapeSignal:
    times = np.arange(speed.size) / 100.0
    return ShapeSignal(times, speed, np.ones(speed.size, bool), 0.4, 0.6, 0.6, 3)


def resting(lag: float = 0.0, every: float = 1.0) -> ShapeSignal:
    """Slowest `lag` beats after every so many beats."""
    position = np.arange(2001) / 100.0 / PERIOD
    return signal(-np.cos(2 * np.pi * (position - lag) / every))


def waltz(lag: float = 0.0, first: int = 0) -> ShapeSignal:
    """The pattern of a waltz whose bars begin on beat `first`, a constant lag later."""
    position = np.arange(2001) / 100.0 / PERIOD - lag - first
    angle = 2 * np.pi * position[:, None] * np.arange(1, 4) / 3
    return signal(np.cos(angle) @ np.array(WALTZ.cosines) + np.sin(angle) @ np.array(WALTZ.sines))


def placed(movement: ShapeSignal, pattern: BarPattern = REST, bars: int | None = None) -> PlaceTest:
    places = None if bars is None else (np.arange(BEATS.size) - bars) % 3
    return place_test(movement, BEATS, places, pattern)


def test_one_reading_falls_in_a_straight_line_from_one_to_minus_one() -> None:
    harmony = [placed(resting(lag)).harmony_above_chance for lag in (0.0, 0.125, 0.25, 0.375, 0.5)]
    np.testing.assert_allclose(harmony, [1, 0.5, 0, -0.5, -1], atol=0.05)


@pytest.mark.parametrize("lag", [-0.2, -0.1, 0.0, 0.1, 0.2])
def test_a_lag_is_found_with_its_sign_late_is_positive(lag: float) -> None:
    assert placed(resting(2 * lag)).lag == pytest.approx(2 * lag, abs=0.025)


def test_a_rest_half_a_beat_away_is_a_hit() -> None:
    assert placed(resting(0.5)).harmony_above_chance == pytest.approx(-1.0, abs=0.05)
    assert placed(resting(0.5), HIT).harmony_above_chance == pytest.approx(1.0, abs=0.05)


def test_harmony_is_never_below_minus_one_with_several_readings() -> None:
    unknown = placed(waltz(), WALTZ)
    for lag in range(MOMENTS):
        turned = replace(unknown, ranks=np.roll(unknown.ranks, lag, axis=2))
        assert -1.0 <= turned.harmony_above_chance <= 1.0
        assert turned.spread()[0][0] >= -1.0


@pytest.mark.parametrize("first", [0, 1, 2])
def test_a_waltz_lies_on_its_bar(first: int) -> None:
    known = placed(waltz(first=first), WALTZ, bars=first)
    assert known.harmony_above_chance > 0.95
    assert known.p_value == pytest.approx(1 / (3 * MOMENTS), abs=0.02)
    assert abs(placed(waltz(first=first), WALTZ, bars=first + 1).lag) == pytest.approx(1.0, abs=0.05)


def test_without_the_bar_every_place_is_a_reading_and_chance_knows_it() -> None:
    unknown = placed(waltz(first=2), WALTZ)
    assert len(unknown.ranks) == 3
    assert unknown.chance > 0.5
    assert unknown.lag == pytest.approx(0.0, abs=0.05)
    assert unknown.harmony_above_chance > 0.9


def test_chance_is_one_half_for_one_reading_and_the_mean_of_all_lags_for_several() -> None:
    assert placed(resting()).chance == 0.5
    several = placed(resting(), WALTZ)
    assert several.chance == pytest.approx(several.curve.mean())


def test_the_p_value_is_the_share_of_lags_that_do_as_well() -> None:
    assert placed(resting()).p_value == pytest.approx(1 / MOMENTS)
    assert placed(resting(0.25)).p_value == pytest.approx(0.5, abs=0.05)


def test_random_phases_have_uniform_p_values_and_no_harmony_on_average() -> None:
    tests = [placed(resting(phase)) for phase in (np.arange(40) + 0.5) / 40]
    assert np.mean([test.p_value <= 0.05 for test in tests]) <= 0.1
    assert np.mean([test.harmony_above_chance for test in tests]) == pytest.approx(0.0, abs=0.05)


def test_the_spread_is_narrow_for_a_steady_dancer_and_wide_for_a_wandering_one() -> None:
    _, steady = placed(resting(0.1)).spread()
    position = np.arange(2001) / 100.0 / PERIOD
    _, wide = placed(signal(-np.cos(2 * np.pi * (position - 0.4 * np.round(position / 8 % 1))))).spread()
    assert steady[1] - steady[0] < 0.05
    assert steady[0] <= 0.13 and steady[1] >= 0.08
    assert wide[1] - wide[0] > 0.3


def test_every_beat_has_a_share() -> None:
    shares = placed(resting()).shares(BEATS.size)
    assert shares.shape == BEATS.shape
    assert shares.min() > 0.95


def test_too_few_beats_for_a_cycle_are_an_error() -> None:
    refused("3 beats hold no whole cycle of 3", place_test, resting(), BEATS[:3], None, WALTZ)


def ranked(heights: dict[int, float]) -> PlaceTest:
    """One reading, one beat: its ranks are .5 at every lag but these (in 48ths of a beat)."""
    ranks = np.full((1, 1, MOMENTS), 0.5)
    for lag, height in heights.items():
        ranks[0, 0, lag % MOMENTS] = height
    return PlaceTest(REST, ranks, 0, 0.5)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("height", "lag"), [(0.889, 4), (0.887, 10), (0.9, 4)])
def test_three_hundredths_of_the_range_are_a_tie_and_the_nearest_lag_has_it(height: float, lag: int, side: int) -> None:
    # The range is .5 to .9: from .888 on a lag is as good as the best, 10.
    assert ranked({10 * side: 0.9, 4 * side: height}).lag == pytest.approx(lag * side / MOMENTS)


@pytest.mark.parametrize(("height", "lag"), [(0.889, 9.0), (0.887, 10.0)])
def test_neighbours_in_a_tie_are_a_plateau_with_the_lag_in_its_middle(height: float, lag: float) -> None:
    assert ranked({8: height, 9: height, 10: 0.9}).lag == pytest.approx(lag / MOMENTS)
