"""Strong and weak beats and their grouping into meter units (Eq. 22, Fig. 6)."""

from __future__ import annotations

import numpy as np
import pytest

from harmolab.beats.meter import CATEGORIES, accented_places, cycle_of_meter, meter_units, strong_beats
from tests.builders import metronome

# Strengths that make the accent patterns of the four categories when each follows a weaker beat.
FOUR = [3.0, 1.0, 2.0, 1.0]
FOUR_LONG = [4.0, 3.0, 2.0, 1.0]
FIVE = [4.0, 3.0, 2.0, 3.0, 1.0]
SIX = [4.0, 3.0, 2.0, 4.0, 2.0, 1.0]


def test_a_beat_is_strong_when_stronger_than_the_one_before():
    np.testing.assert_array_equal(strong_beats(np.array([1.0, 2.0, 2.0, 1.0, 3.0])), [False, True, False, False, True])


@pytest.mark.parametrize(("strengths", "strong"), [([], []), ([5.0], [False]), ([1.0, 1.0], [False, False])])
def test_few_or_equal_beats_are_weak(strengths, strong):
    np.testing.assert_array_equal(strong_beats(np.array(strengths)), strong)


@pytest.mark.parametrize(("bar", "signature"), [(FOUR, "4/4"), (FOUR_LONG, "4/4"), (FIVE, "5/4"), (SIX, "6/4")])
def test_each_category_is_found_between_its_neighbours(bar, signature):
    units = meter_units(metronome([0.5, *bar, 9.0]))
    assert [unit.signature for unit in units] == [signature]
    assert (units[0].start, units[0].end) == (0.5, 0.5 + 0.5 * len(bar))
    assert tuple(units[0].strong.tolist()) in CATEGORIES


def test_there_are_four_categories_of_three_types():
    assert len(CATEGORIES) == 4
    assert set(CATEGORIES.values()) == {"4/4", "5/4", "6/4"}


def test_units_follow_one_another_without_overlap():
    units = meter_units(metronome([0.5, *FOUR, *FIVE, *FOUR_LONG, 9.0]))
    assert [unit.signature for unit in units] == ["4/4", "5/4", "4/4"]
    assert [unit.end for unit in units[:-1]] == [unit.start for unit in units[1:]]


def test_a_unit_needs_the_beat_that_ends_it():
    assert meter_units(metronome([0.5, *FOUR])) == ()


def test_beats_that_start_no_category_are_passed_over():
    units = meter_units(metronome([0.5, 1.0, 2.0, *FOUR_LONG, 9.0]))
    assert [(unit.start, unit.signature) for unit in units] == [(1.5, "4/4")]


@pytest.mark.parametrize("strengths", [[], [1.0], [1.0] * 12])
def test_no_accents_make_no_units(strengths):
    assert meter_units(metronome(strengths)) == ()


@pytest.mark.parametrize(("meter", "cycle"), [(None, 1), (4, 2), (6, 2), (2, 2), (3, 3), (5, 5)])
def test_a_cycle_is_half_an_even_bar_or_an_odd_bar(meter: int | None, cycle: int):
    assert cycle_of_meter(meter) == cycle


@pytest.mark.parametrize(
    ("strengths", "cycle", "places"),
    [
        ([3, 1, 1, 3, 1, 1], 3, [0, 1, 2, 0, 1, 2]),
        ([1, 1, 3, 1, 1, 2], 3, [1, 2, 0, 1, 2, 0]),
        ([9, 5, 0, 5, 0, 5], 2, [1, 0, 1, 0, 1, 0]),  # on average 3 and 5
        ([1, 1, 1], 2, [0, 1, 0]),  # no accent: the first
        ([2], 3, [0]),
        ([], 3, []),
    ],
)
def test_the_strongest_place_on_average_is_the_first_of_the_cycle(strengths, cycle, places):
    np.testing.assert_array_equal(accented_places(np.array(strengths, dtype=float), cycle), places)
