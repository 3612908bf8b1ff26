"""In time? Periodic movement of the music's tempo is, whatever its phase; other tempi and noise are not."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.shape_speed import ShapeSignal
from harmolab.types import FloatArray
from harmolab.verdict.evidence import N_RATIOS, RATIOS, TimeTest, time_test
from tests.builders import cases

RATE = 100.0
BEATS = 0.3 + 0.5 * np.arange(60)


def signal(values: FloatArray) -> ShapeSignal:
    times = np.arange(values.size) / RATE
    inside = (times >= BEATS[0] - 1e-9) & (times <= BEATS[-1] + 1e-9)
    values = values[inside]
    values = (values - values.mean()) / values.std()
    return ShapeSignal(times[inside], values, np.ones(values.size, bool), 0.4, 0.6, 0.6, 3)


def wave(tempo: float, phase: float = 0.0) -> FloatArray:
    """A movement of so many beats a minute, with its own noise."""
    times = np.arange(3200) / RATE
    noise = gaussian_filter1d(np.random.default_rng(3).normal(size=times.size), 8)
    return np.cos(2 * np.pi * (times * tempo / 60 - phase)) + 3 * noise


def result(values: FloatArray) -> TimeTest:
    return time_test(signal(values), BEATS)


@pytest.mark.parametrize("phase", [0.0, 0.2, 0.5, 0.9])
def test_movement_of_the_musics_tempo_is_in_time_at_any_phase(phase: float) -> None:
    test = result(wave(120.0, phase))
    assert (test.p_value, test.own_ratio) == (pytest.approx(1 / N_RATIOS), pytest.approx(1.0, abs=0.001))


@pytest.mark.parametrize("tempo", [95.0, 117.0, 122.0, 128.4, 150.0])
def test_movement_of_another_tempo_is_not_and_its_tempo_is_found(tempo: float) -> None:
    test = result(wave(tempo))
    assert test.p_value > 0.05
    assert 120 * test.own_ratio == pytest.approx(tempo, rel=0.002)


def test_the_rate_is_the_number_of_movements_a_beat() -> None:
    assert [result(wave(tempo)).rate for tempo in (60.0, 120.0, 240.0)] == [0.5, 1.0, 2.0]


def test_noise_has_p_values_as_small_as_chance_allows() -> None:
    rng = np.random.default_rng(7)
    p = [result(gaussian_filter1d(rng.normal(size=3200), 12)).p_value for _ in range(20)]
    assert np.mean(np.array(p) <= 0.05) < 0.2
    assert 0.3 < np.mean(p) < 0.7


def test_scale_and_sign_of_a_movement_change_nothing() -> None:
    one, other = result(wave(120.0)), result(-7 * wave(120.0))
    np.testing.assert_allclose(one.z, other.z)


def test_agreement_counts_different_blocks_only() -> None:
    # One huge movement in one block agrees with itself alone.
    values = gaussian_filter1d(np.random.default_rng(0).normal(size=3200), 8)
    values[800:1000] += 50 * np.cos(2 * np.pi * np.arange(200) / 50)
    assert result(values).own < 3


def test_with_too_few_blocks_there_is_no_evidence() -> None:
    test = time_test(signal(wave(120.0)), np.append(BEATS[:8], BEATS[-1]), cycles=(3,))
    assert (test.own, test.p_value) == (-np.inf, 1.0)


def test_masked_samples_count_for_nothing() -> None:
    clean = signal(wave(120.0))
    values, valid = clean.values.copy(), clean.valid.copy()
    values[500:520], valid[500:520] = 1e3, False
    masked = time_test(ShapeSignal(clean.times, values, valid, 0.4, 0.6, 0.6, 3), BEATS)
    assert masked.own == pytest.approx(time_test(clean, BEATS).own, rel=0.1)


def test_the_grids_lie_evenly_around_the_beats_own_tempo() -> None:
    assert RATIOS[N_RATIOS // 2] == pytest.approx(1.0)
    np.testing.assert_allclose(RATIOS * RATIOS[::-1], 1.0)


@cases("amplitude, counts", (1.0, 1.0), (0.25, 1.0), (0.2, 0.2 / 0.22), (0.1, 0.1 / 0.21))
def test_a_block_counts_less_below_three_tenths_of_the_mean_spread(amplitude: float, counts: float) -> None:
    # Three blocks of four beats, the last moves so little. .3 of the mean is .225, .22 and .21 of the others' spread.
    beats = 0.4 * np.arange(13)
    times = np.arange(481) / RATE
    values = np.cos(2 * np.pi * times / 0.4) * np.where(times < 3.2 - 1e-9, 1.0, amplitude)
    test = time_test(ShapeSignal(times, values, np.ones(481, bool), 0.4, 0.6, 0.6, 3), beats, cycles=(1,))
    # Vectors of sizes 1, 1 and w over sqrt(2): (|sum|^2 - sum of squares) / 3^2.
    assert test.power[N_RATIOS // 2] == pytest.approx((2 + 4 * counts) / 18, rel=1e-6)
