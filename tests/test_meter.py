"""Strong and weak beats and their grouping into meter units (Eq. 22, Fig. 6)."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.beats.meter import CATEGORIES, cycle_of_meter, describe_beats, meter_units, strong_beats, with_one
from tests.builders import cases, metronome, refused, track

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


@pytest.mark.parametrize("seconds", [2.0, 2.3, 1.7])
def test_bars_are_counted_from_the_beat_nearest_to_one(seconds: float):
    assert with_one(track([0.0, 1.0, 2.0, 3.0, 4.0]), seconds, 3).bar_places.tolist() == [1, 2, 0, 1, 2]


@cases(
    "count, seconds, meter, fault",
    (1, 0.0, 4, "needs two beats or more to count from, this music has 1"),
    (5, float("nan"), 4, "no beat is near"),
    (5, 9.6, 4, '"one" at 9.6 s: no beat is near; the beats lie from 0.0 to 4.0 s'),
    (5, 1.0, 0, "a bar has one beat or more, got 0"),
)
def test_a_one_that_cannot_be_is_refused(count: int, seconds: float, meter: int, fault: str):
    refused(fault, with_one, metronome([1.0] * count, period=1.0, duration=6.0), seconds, meter)


def test_a_line_about_beats_says_tempo_steadiness_and_one():
    # Beats every half second are 120 in a minute.
    beats = metronome([1.0] * 5, period=0.5, duration=6.0)
    lines = [
        describe_beats(one)
        for one in (
            beats,
            replace(with_one(beats, 1.0, 3), quality=0.97),
            replace(beats, quality=0.5),
            replace(beats, quality=0.0, fit=0.0),
            replace(beats, quality=0.5, fit=0.4),
            metronome([1.0], period=0.5),
            metronome([], period=0.5),
        )
    ]
    assert lines == [
        'annotated, 120.0 bpm; "one": not known',
        '120.0 bpm, steady (97% of tracked beats on one grid); "one" known, 3 beats a bar',
        '120.0 bpm, not steady (50% of tracked beats on one grid), followed beat by beat; "one": not known',
        '120.0 bpm, too few beats to call it steady; "one": not known',
        '120.0 bpm, unsure: in about 1 of 2 s the sound does not keep to these beats; "one": not known',
        "one beat: no tempo",
        "no beats",
    ]


def test_a_line_about_beats_says_where_their_tempo_goes():
    # Eight beats at a time of equal steps: 60 beats a minute, later 120, and in the second line 60 again.
    there = np.concatenate([np.arange(10.0), 9.5 + 0.5 * np.arange(10)])
    back = np.concatenate([there, 15.0 + np.arange(10)])
    lines = [describe_beats(replace(track(times, duration=30.0), quality=0.5, fit=1.0)) for times in (there, back)]
    assert "followed beat by beat from 60 to 120 bpm;" in lines[0]
    assert "followed beat by beat between 60 and 120 bpm;" in lines[1]
