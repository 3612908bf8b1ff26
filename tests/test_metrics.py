"""The field's other measures, by hand."""

import time

import mir_eval.beat
import numpy as np
import pytest

from harmolab.metrics.beats import (
    MIR_EVAL_NAMES,
    beat_align,
    beat_coverage,
    beat_hit_rate,
    kinematic_params,
    mir_eval_scores,
    other_scores,
)
from tests.builders import cases, track

STEADY = np.arange(1.0, 20.0, 0.5)


def test_beat_alignment_of_exact_beats_is_one():
    assert beat_align(STEADY, STEADY) == 1.0


def test_beat_alignment_falls_as_a_gaussian_of_the_distance():
    # One beat exact, one a sigma away, one two sigmas away.
    queries = np.array([1.0, 2.05, 3.1])
    expected = (1 + np.exp(-0.5) + np.exp(-2)) / 3
    assert beat_align(queries, np.array([1.0, 2.0, 3.0]), sigma=0.05) == pytest.approx(expected)


def test_beat_alignment_has_two_directions():
    music, motion = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0])
    assert beat_align(motion, music) == 1.0
    assert beat_align(music, motion) == pytest.approx(0.25)


@pytest.mark.parametrize(("queries", "targets"), [([], []), ([1.0], []), ([], [1.0])])
def test_beat_alignment_without_beats_is_zero(queries, targets):
    assert beat_align(np.array(queries), np.array(targets)) == 0.0


def test_coverage_is_motion_beats_per_music_beat():
    assert beat_coverage(3, 4) == 0.75
    assert beat_coverage(3, 0) == 0.0


def test_hit_rate_counts_motion_beats_near_music_beats():
    assert beat_hit_rate(np.array([1.1, 2.2, 3.0]), np.array([1.0, 2.0, 3.0])) == pytest.approx(2 / 3)


@pytest.mark.parametrize(("visual", "audio"), [([], [1.0]), ([1.0], [])])
def test_hit_rate_without_beats_is_zero(visual, audio):
    assert beat_hit_rate(np.array(visual), np.array(audio)) == 0.0


def test_mir_eval_gives_full_marks_to_the_music_itself():
    scores = mir_eval_scores(STEADY, STEADY)
    assert set(scores) == {f"mir_eval_{name}" for name in MIR_EVAL_NAMES}
    assert scores == {name: pytest.approx(1.0) for name in scores}


def test_mir_eval_drops_no_beats_of_a_short_clip():
    # Two of four within 70 ms, all in the first five seconds: F = 2 * 2 / (4 + 4).
    music, motion = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.05, 2.05, 3.3, 4.3])
    assert mir_eval_scores(music, motion, only=("f",)) == {"mir_eval_f": pytest.approx(0.5)}


@cases("music, motion", ([], STEADY), (STEADY, []), ([1.0], STEADY), (STEADY, [1.0]), ([4.24, 4.25], [0.3, 1.5, 5.0]))
def test_too_few_beats_score_zero_in_mir_eval(music, motion):
    assert set(mir_eval_scores(np.array(music), np.array(motion)).values()) == {0.0}


@cases(
    "music, motion",
    ([0.0, 0.5], [0.0, 0.5]),  # means of nothing in Goto's score
    ([0.0, 0.5, 1.0], [0.0, 0.5, 1.0, 1.5]),
    ([0.47, 4.27, 4.53], [0.83, 1.11, 4.23, 4.5]),  # mir_eval's P-score is 1.25 here
    ([1.0, 1.016, 1.031], [1.0, 1.016]),  # and Cemgil's 1.17
)
def test_mir_eval_stays_between_zero_and_one_without_warnings(music, motion):
    for value in mir_eval_scores(np.array(music), np.array(motion)).values():
        assert 0 <= value <= 1 + 1e-12


def test_the_p_score_is_that_of_mir_eval(rng: np.random.Generator):
    for _ in range(50):
        music, motion = (np.sort(rng.uniform(0, 20, rng.integers(10, 40))) for _ in range(2))
        expected = min(mir_eval.beat.p_score(music, motion), 1.0)
        assert mir_eval_scores(music, motion, only=("p_score",))["mir_eval_p_score"] == pytest.approx(expected)


def test_ten_minutes_of_music_are_judged_in_a_moment():
    music, motion = np.arange(0, 600, 0.5), np.arange(0.1, 600, 0.4)
    began = time.perf_counter()
    mir_eval_scores(music, motion)
    assert time.perf_counter() - began < 10  # mir_eval's own P-score alone takes 15 s


def test_kinematic_beats_are_valleys_smoothed_by_five_frames_at_sixty():
    params = kinematic_params()
    assert (params.detector, params.fps, params.visual_threshold) == ("valleys", None, None)
    assert params.smoothing * 60 == pytest.approx(5)


def test_all_other_scores_come_in_one_dictionary():
    motion = STEADY[:10] + 0.05
    scores = other_scores(track(STEADY, duration=30.0), track(motion, duration=30.0))
    assert scores["beat_align_motion"] == pytest.approx(np.exp(-0.5))  # 0.05 s is AIST++'s sigma
    assert (scores["beat_coverage"], scores["beat_hit_rate"]) == (10 / STEADY.size, 1.0)
    assert scores["mir_eval_f"] == pytest.approx(2 * 10 / (10 + STEADY.size))


def test_other_scores_of_a_frozen_dancer_are_zero():
    assert set(other_scores(track(STEADY, duration=30.0), track(np.zeros(0), duration=30.0)).values()) == {0.0}
