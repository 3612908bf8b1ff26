"""Which beats a viewer or listener would notice (Eq. 11-13), by hand."""

from dataclasses import replace

import numpy as np
import pytest

from harmolab.params import HarmonyParams
from harmolab.score import audio_mask, normalise_strengths, salient_audio, salient_visual, strength_steps, visual_mask
from tests.builders import cases, metronome

# Mean 2, deviations -1, 1, -1, 1: population SD 1.
STRENGTHS = np.array([1.0, 3.0, 1.0, 3.0])


def test_a_music_beat_at_the_threshold_is_not_salient():
    np.testing.assert_array_equal(audio_mask(STRENGTHS, 1.0), [False, True, False, True])
    np.testing.assert_array_equal(audio_mask(STRENGTHS, 0.99), [True, True, True, True])


def test_in_the_literal_reading_the_factor_cannot_matter():
    for factor in (0.01, 1.0, 100.0):
        np.testing.assert_array_equal(
            audio_mask(np.array([0.5, 3.0, 1.0, 3.0]), factor, reading="literal"), [False, True, False, True]
        )


def test_the_literal_reading_compares_with_the_spread_and_not_with_the_mean():
    np.testing.assert_array_equal(audio_mask(STRENGTHS, 1.0, reading="literal"), [False, True, False, True])  # 1 is SD
    np.testing.assert_array_equal(audio_mask(STRENGTHS + 0.5, 1.0, reading="literal"), [True, True, True, True])


def test_equal_music_beats_are_all_salient():
    np.testing.assert_array_equal(audio_mask(np.full(3, 0.2), 5.0), [True, True, True])


def test_a_music_beat_without_strength_is_never_salient():
    np.testing.assert_array_equal(audio_mask(np.array([0.0, 1.0]), 0.0), [False, True])


@cases("strengths, steps", ([], []), ([4.0], [0.0]), ([4.0, 1.0], [3, 3]), ([1, 5, 3], [4, 4, 2]))
def test_steps_between_strengths_repeat_the_first(strengths, steps):
    np.testing.assert_array_equal(strength_steps(np.array(strengths, dtype=float)), steps)


# R = 4, 4, 2, 6 (the first copied); SD of the defined 4, 2, 6 is sqrt(8/3) = 1.63.
VISUAL = np.array([1.0, 5.0, 3.0, 9.0])


def test_a_visual_beat_is_salient_where_its_step_exceeds_the_spread_of_steps():
    np.testing.assert_array_equal(visual_mask(VISUAL, 1.5), [True, True, False, True])  # 2.45
    np.testing.assert_array_equal(visual_mask(VISUAL, 3.0), [False, False, False, True])  # 4.90


def test_the_copied_first_step_has_no_part_in_the_spread():
    # With it the spread would be sqrt(2), and 4 above 2.6 times that.
    np.testing.assert_array_equal(visual_mask(VISUAL, 2.6), [False, False, False, True])  # 4.25
    np.testing.assert_array_equal(visual_mask(VISUAL, 2.4), [True, True, False, True])  # 3.92


@pytest.mark.parametrize("reading", ["threshold", "literal"])
def test_a_visual_beat_whose_step_is_the_spread_is_not_salient(reading):
    # R = 1, 1, 3; SD of the defined 1 and 3 is 1.
    np.testing.assert_array_equal(visual_mask(np.array([0.0, 1.0, 4.0]), 1.0, reading=reading), [False, False, True])


def test_the_printed_formula_compares_the_strength_itself():
    np.testing.assert_array_equal(visual_mask(VISUAL, 3.0, quantity="strength"), [False, True, False, True])


def test_the_literal_visual_mask_ignores_the_factor():
    np.testing.assert_array_equal(visual_mask(VISUAL, 3.0, reading="literal"), [True, True, True, True])


def test_the_first_visual_beat_may_be_dropped():
    np.testing.assert_array_equal(visual_mask(VISUAL, 1.5, first_beat="drop"), [False, True, False, True])


def test_no_threshold_keeps_every_visual_beat():
    np.testing.assert_array_equal(visual_mask(VISUAL, None), [True, True, True, True])


@pytest.mark.parametrize(("strengths", "mask"), [([], []), ([2.0], [False]), ([2.0, 3.0], [True, True])])
def test_a_visual_mask_of_few_beats_is_defined(strengths, mask):
    # One beat has no step (R = 0); of two, both have the one step there is, whose SD is 0.
    np.testing.assert_array_equal(visual_mask(np.array(strengths), 1.0), mask)


@pytest.mark.parametrize(("how", "expected"), [("max", [0.5, 1.0]), ("mean", [2 / 3, 4 / 3]), ("raw", [2.0, 4.0])])
def test_strengths_are_normalised_as_asked(how, expected):
    np.testing.assert_allclose(normalise_strengths(np.array([2.0, 4.0]), how), expected)


@pytest.mark.parametrize("strengths", [[], [0.0, 0.0]])
def test_nothing_to_normalise_is_left_alone(strengths):
    np.testing.assert_array_equal(normalise_strengths(np.array(strengths), "max"), strengths)


def test_salient_music_beats_keep_time_bar_place_and_normalised_strength():
    params = replace(HarmonyParams.paper(), audio_threshold=1.0, normalisation="max")
    kept = salient_audio(metronome([1.0, 3.0, 1.0, 3.0], bar_places=[0, 1, 2, 3], period=1.0, duration=10.0), params)
    np.testing.assert_array_equal(kept.times, [1.0, 3.0])
    np.testing.assert_array_equal(kept.strengths, [1.0, 1.0])
    np.testing.assert_array_equal(kept.bar_places, [1, 3])


def test_salient_visual_beats_keep_their_raw_strength():
    params = replace(HarmonyParams.paper(), visual_threshold=3.0)
    kept = salient_visual(metronome(VISUAL.tolist(), period=1.0, duration=10.0), params)
    np.testing.assert_array_equal(kept.times, [3.0])
    np.testing.assert_array_equal(kept.strengths, [9.0])


@cases(
    "how, times",
    ({"visual_threshold": 1.5, "first_beat": "drop"}, [1.0, 3.0]),
    ({"visual_threshold": 3.0, "visual_saliency": "strength"}, [1.0, 3.0]),
    ({"visual_threshold": 3.0, "saliency": "literal"}, [0.0, 1.0, 2.0, 3.0]),
)
def test_visual_saliency_is_read_as_the_params_say(how, times):
    kept = salient_visual(metronome(VISUAL.tolist(), period=1.0), replace(HarmonyParams.paper(), **how))
    np.testing.assert_array_equal(kept.times, times)


@pytest.mark.parametrize(("reading", "count"), [("threshold", 0), ("literal", 4)])
def test_audio_saliency_is_read_as_the_params_say(reading, count):
    params = replace(HarmonyParams.paper(), audio_threshold=100.0, saliency=reading)
    assert len(salient_audio(metronome([1.0, 3.0, 2.0, 3.0]), params)) == count
