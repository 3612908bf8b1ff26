"""Hits, hitting score, F-measure, chance level, and the scores made of them, by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.metrics.beats import kinematic_params, other_scores
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.score import (
    above_chance,
    chance_level,
    f_score,
    harmony_from_hits,
    hit_mask,
    hit_pairs,
    hitting_score,
    interval_matrix,
    nearest_intervals,
    position_matrix,
    score_harmony,
)
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip, score_motion
from tests.builders import BODY, cases, refused, track

ALL_BEATS = replace(HarmonyParams.paper(), audio_threshold=0.0, visual_threshold=None)
Swing = Callable[..., Motion]


def silence(seconds: float) -> Audio:
    return Audio(np.zeros(round(seconds * 1000)), 1000)


def test_positions_are_repeated_for_every_music_beat():
    np.testing.assert_array_equal(position_matrix(np.array([1.0, 5.0]), 3), [[1, 5], [1, 5], [1, 5]])


def test_intervals_are_distances_of_music_to_visual_beats():
    np.testing.assert_array_equal(interval_matrix(np.array([1.0, 4.0]), np.array([2.0, 3.5])), [[1, 2.5], [2, 0.5]])


def test_the_nearest_visual_beat_of_none_is_infinitely_far():
    np.testing.assert_array_equal(nearest_intervals(np.array([1.0, 2.0]), np.zeros(0)), [np.inf, np.inf])


def test_a_beat_exactly_at_the_delay_is_a_hit():
    np.testing.assert_array_equal(hit_mask(np.array([1.0, 2.0]), np.array([1.25]), delay=0.25), [True, False])


@pytest.mark.parametrize("matching", ["many", "nearest", "max"])
def test_a_delay_that_float_rounds_up_is_still_a_hit_and_a_microsecond_more_is_none(matching: str):
    music, motion = np.array([0.8]), np.array([0.7])
    assert music[0] - motion[0] > 0.1  # by the last bit
    assert hit_mask(music, motion, delay=0.1, matching=matching).all()
    assert not hit_mask(music + 1e-6, motion, delay=0.1, matching=matching).any()
    assert hit_pairs(music, motion, delay=0.1, matching=matching).tolist() == [0]
    assert hit_pairs(music + 1e-6, motion, delay=0.1, matching=matching).tolist() == [-1]


# Three music beats around two visual ones: 1.0 and 1.2 both near 1.1; 1.4 near 1.25 too.
MUSIC, MOTION = np.array([1.0, 1.2, 1.4]), np.array([1.1, 1.25])


@cases(
    "matching, expected",
    ("many", [True, True, True]),
    ("nearest", [True, True, False]),  # 1.0 takes 1.1, then 1.2 takes 1.25
    ("max", [True, True, False]),  # two pairs at most
)
def test_one_visual_beat_may_serve_one_music_beat_or_many(matching: str, expected: list[bool]):
    found = hit_mask(MUSIC, MOTION, delay=0.16, matching=matching)
    assert found.sum() == sum(expected)
    if matching != "max":
        np.testing.assert_array_equal(found, expected)


def test_greedy_matching_may_miss_a_pair_that_the_best_one_finds():
    # 1.0 takes 1.05, the only one in reach of 1.15; the best pairing gives it 0.92 instead.
    music, motion = np.array([1.0, 1.15]), np.array([0.92, 1.05])
    np.testing.assert_array_equal(hit_mask(music, motion, delay=0.1, matching="nearest"), [True, False])
    np.testing.assert_array_equal(hit_mask(music, motion, delay=0.1, matching="max"), [True, True])


@pytest.mark.parametrize("matching", ["many", "nearest", "max"])
@pytest.mark.parametrize(("music", "motion"), [([], []), ([], [1.0]), ([1.0, 2.0], [])])
def test_nothing_is_hit_without_beats(matching: str, music: list[float], motion: list[float]):
    found = hit_mask(np.array(music), np.array(motion), delay=0.1, matching=matching)
    np.testing.assert_array_equal(found, np.zeros(len(music), bool))


def test_the_hitting_score_adds_the_strengths_of_hits():
    assert hitting_score(np.array([True, False, True]), np.array([0.5, 1.0, 0.25])) == 0.75


@pytest.mark.parametrize(
    ("audio", "visual", "beta", "expected"),
    [(0.5, 0.5, 2.0, 0.5), (1.0, 0.5, 1.0, 2 / 3), (0.6, 0.3, 2.0, 5 * 0.18 / (4 * 0.3 + 0.6)), (0.0, 0.0, 2.0, 0.0)],
)
def test_the_f_score_is_a_weighted_harmonic_mean(audio: float, visual: float, beta: float, expected: float):
    assert f_score(audio, visual, beta) == pytest.approx(expected)


@cases("score, n_audio, n_visual, expected", (3.0, 4, 9, 0.6), (4.0, 4, 4, 1.0), (0.0, 0, 4, 0.0), (0.0, 4, 0, 0.0))
def test_harmony_follows_from_the_hitting_score(score: float, n_audio: int, n_visual: int, expected: float):
    assert harmony_from_hits(score, n_audio, n_visual, 2.0) == pytest.approx(expected)  # 5 * 3 / (16 + 9) = 0.6


@cases(
    "visual, expected",
    ([], 0.0),
    ([5.0], 0.05),
    ([5.0, 5.3], 0.08),  # 4.75-5.25 and 5.05-5.55 overlap
    ([0.1, 9.9], 0.07),  # cut off at both ends
    ([5.0, 5.1, 5.2], 0.07),
)
def test_chance_is_the_share_of_time_near_a_visual_beat(visual: list[float], expected: float):
    assert chance_level(np.array(visual), delay=0.25, duration=10.0) == pytest.approx(expected)


def test_chance_of_a_lagged_beat_outside_the_clip_is_nothing():
    assert chance_level(np.array([-0.5, 11.0]), delay=0.25, duration=10.0) == 0.0
    # The second reaches to .15 s, and from the start at the earliest.
    assert chance_level(np.array([-0.5, -0.1]), delay=0.25, duration=10.0) == pytest.approx(0.015)


@cases("share, chance, expected", (1.0, 0.4, 1.0), (0.4, 0.4, 0.0), (0.1, 0.4, -0.5), (1.0, 1.0, 0.0))
def test_above_chance_is_zero_at_chance_and_one_at_the_top(share: float, chance: float, expected: float):
    assert above_chance(share, chance) == pytest.approx(expected)


def test_a_chance_that_is_one_but_for_rounding_leaves_nothing_to_be_above():
    assert above_chance(1.0, 1 - 1e-12) == 0.0
    assert above_chance(1.0, 1 - 1e-6) == 1.0


def test_a_score_by_hand():
    # Four music beats of strength 1, .5, 1, .5; visual beats near the first and the last.
    music = track([1.0, 3.0, 5.0, 7.0], [2.0, 1.0, 2.0, 1.0])
    score = score_harmony(music, track([1.1, 7.2, 9.0]), params=ALL_BEATS, n_rotations=0)
    np.testing.assert_array_equal(score.hits, [True, False, False, True])
    np.testing.assert_allclose(score.intervals, [0.1, 1.9, 2.2, 0.2])
    assert (score.n_audio, score.n_visual) == (4, 3)
    assert (score.hitting_score, score.audio_harmony) == (pytest.approx(1.5), pytest.approx(1.5 / 4))
    assert (score.visual_harmony, score.harmony) == (pytest.approx(1.5 / 3), pytest.approx(5 * 1.5 / (4 * 4 + 3)))
    assert (score.hit_rate, score.chance) == (0.5, pytest.approx(3 * 0.5 / 10))
    assert score.harmony_above_chance == pytest.approx((1.5 / 3 - 0.15) / 0.85)
    assert np.isnan(score.p_value)


def test_the_hit_rate_counts_beats_that_are_not_salient_too():
    music = track([1.0, 3.0, 5.0, 7.0], [10.0, 0.1, 10.0, 0.1])
    score = score_harmony(music, track([3.0, 7.0]), params=replace(ALL_BEATS, audio_threshold=1.0), n_rotations=0)
    assert (score.n_audio, score.hitting_score, score.hit_rate) == (2, 0.0, 0.5)


def test_the_lag_is_taken_off_the_visual_beats():
    music, late = track([1.0, 3.0, 5.0]), track([1.4, 3.4, 5.4])
    assert score_harmony(music, late, params=ALL_BEATS, n_rotations=0).hit_rate == 0.0
    assert score_harmony(music, late, params=replace(ALL_BEATS, lag=0.4), n_rotations=0).hit_rate == 1.0


def test_movements_that_lag_score_as_those_that_come_so_much_earlier():
    music = track([0.5, 3.0, 5.0, 9.0], [1.0, 0.5, 1.0, 0.5])
    late, early = (track([each + 0.5, each + 3.4, each + 5.9]) for each in (0.375, 0.0))
    score = score_harmony(music, late, params=replace(ALL_BEATS, lag=0.375), n_rotations=99)
    same = score_harmony(music, early, params=ALL_BEATS, n_rotations=99)
    np.testing.assert_allclose(score.intervals, [0.0, 0.4, 0.9, 3.1], atol=1e-12)
    np.testing.assert_allclose(score.intervals, same.intervals, atol=1e-12)
    np.testing.assert_array_equal(score.null, same.null)
    assert score.p_value == same.p_value


def test_chance_of_movements_that_lag_is_counted_where_they_belong():
    # From .5 s the quarter of a second to either side is whole, from .1 s it is cut off at the start.
    params = replace(ALL_BEATS, reaction_delay=0.25, lag=0.4)
    score = score_harmony(track([1.0, 3.0]), track([0.5]), params=params, n_rotations=0)
    assert score.chance == pytest.approx(0.035)


def test_the_hit_rate_pairs_beats_as_it_is_told():
    music, between = track([1.0, 1.2]), track([1.1])
    rates = [
        score_harmony(music, between, params=replace(ALL_BEATS, matching=matching), n_rotations=0).hit_rate
        for matching in ("many", "nearest", "max")
    ]
    assert rates == [1.0, 0.5, 0.5]


def test_null_and_interval_are_shares_of_the_strengths():
    # Strengths 2 and 1: a rotation hits two thirds, a third or nothing, and so may a resampling.
    music, params = track([1.0, 5.0], [2.0, 1.0]), replace(ALL_BEATS, reaction_delay=0.25)
    score = score_harmony(music, track([1.0]), params=params, n_rotations=99)
    np.testing.assert_allclose(np.unique(score.null), [0, 1 / 3, 2 / 3])
    # A twentieth of ten seconds lies near the movement: no hit at all is (0 - .05) / .95.
    assert score.interval == pytest.approx((-0.05 / 0.95, 1.0))


def test_the_interval_counts_beats_by_their_strength():
    # Nineteen beats of strength 1 are hit, one of 50 is missed. Of resamplings 1.6 % draw it four times or more and
    # 7.5 % three times or more, so the bound at 2.5 % is that of three times.
    music = track(np.arange(20) / 2.0, [1.0] * 19 + [50.0])
    score = score_harmony(music, track(np.arange(19) / 2.0), params=replace(ALL_BEATS, reaction_delay=0.1))
    assert score.interval[0] == pytest.approx(above_chance(17 / (17 + 3 * 50), score.chance))


def test_a_beat_is_hit_where_it_fits_better_than_the_median_moment(rng: np.random.Generator):
    params = HarmonyParams.recommended(HOW_PATTERNS["rest"])
    wandering = BODY + 0.1 * gaussian_filter1d(rng.normal(size=(900, *BODY.shape)), 3, axis=0)
    beats = track(0.3 + 0.5 * np.arange(58), duration=30.0)
    score = score_motion(beats, Motion(wandering, 30.0, Skeleton.unnamed(len(BODY))), params=params, n_rotations=0)
    shares = score.shares
    assert ((shares > 0.4) & (shares <= 0.5)).any() and ((shares > 0.5) & (shares < 0.6)).any()
    assert score.hit_rate == np.mean(shares > 0.5)


@pytest.mark.parametrize(("music", "motion"), [([], []), ([], [1.0]), ([1.0], [])])
def test_no_beats_on_a_side_score_zero(music: list[float], motion: list[float]):
    score = score_harmony(track(music), track(motion))
    numbers = (score.harmony, score.audio_harmony, score.visual_harmony, score.hit_rate, score.harmony_above_chance)
    assert numbers == (0, 0, 0, 0, 0)
    assert np.isnan(score.p_value)


def test_every_beat_hit_by_chance_is_not_harmony():
    # A visual beat every 0.1 s reaches every moment.
    score = score_harmony(track([1.0, 2.0]), track(np.arange(0.0, 10.0, 0.1).tolist()), params=ALL_BEATS)
    assert (score.hit_rate, score.chance, score.harmony_above_chance, score.p_value) == (1.0, 1.0, 0.0, 1.0)


def test_perfect_beats_are_matched_only_by_rotations_of_less_than_the_delay():
    beats = track([0.7, 2.1, 3.0, 4.9, 6.3, 8.8])
    score = score_harmony(beats, beats, params=HarmonyParams.valleys(), n_rotations=999)
    assert (score.harmony_above_chance, score.interval) == (1.0, (1.0, 1.0))
    # Of 999 rotations over 10 s, the first and the last ten move by less than 0.1 s.
    assert score.p_value == pytest.approx(21 / 1000)


def test_beats_at_random_moments_have_no_small_p_value_more_often_than_chance(rng: np.random.Generator):
    values = []
    for _ in range(200):
        music, motion = (track(np.sort(rng.uniform(0, 10, 12)).tolist()) for _ in range(2))
        values.append(score_harmony(music, motion, params=HarmonyParams.valleys(), n_rotations=99).p_value)
    assert np.mean(np.array(values) <= 0.05) < 0.1
    assert 0.4 < np.mean(values) < 0.65


def test_score_motion_reads_the_beats_of_the_motion(swinging_arm: Swing):
    stops = track([0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75, 4.25, 4.75, 5.25], duration=6.0)
    score = score_motion(stops, swinging_arm(1.0, 60.0), params=HarmonyParams.valleys(), n_rotations=99)
    assert score.hit_rate == 1.0
    # Stops every 0.5 s fit again after each half second: 0.2 s of every 0.5 s are near one.
    assert score.p_value == pytest.approx(0.4, abs=0.02)
    # AIST++ puts a beat on the later of two frames, here 1/60 s after the stop: a third of its sigma.
    others = other_scores(stops, visual_beats(swinging_arm(1.0, 60.0), params=kinematic_params()))
    assert others["beat_align_music"] == pytest.approx(np.exp(-1 / 18), abs=0.001)


def test_the_clock_stretches_the_motion(swinging_arm: Swing):
    # Stops every half second become stops every 0.55 s.
    music = track([0.275 + 0.55 * k for k in range(11)], duration=6.6)
    params = replace(HarmonyParams.valleys(), clock=1.1)
    assert score_motion(music, swinging_arm(1.0, 60.0), params=params, n_rotations=0).hit_rate == 1.0
    assert score_motion(music, swinging_arm(1.0, 60.0), params=replace(params, clock=1.0)).hit_rate < 0.6


@pytest.mark.parametrize("params", [HarmonyParams.paper(), HarmonyParams.valleys(), HarmonyParams.recommended()])
def test_a_frozen_dancer_scores_zero(params: HarmonyParams):
    frozen = Motion(np.tile(np.array([[[0.1, 1.7, 0.3]]]), (150, 2, 1)), 25.0, Skeleton.unnamed(2))
    score = score_motion(track([1.0, 2.0, 3.0, 4.0], duration=6.0), frozen, params=params)
    assert (score.n_visual, score.harmony) == (0, 0.0)
    assert np.isnan(score.harmony_above_chance) if params.measure == "shape" else score.harmony_above_chance == 0.0


@pytest.mark.parametrize("params", [HarmonyParams.paper(), HarmonyParams.valleys(), HarmonyParams.recommended()])
def test_music_without_beats_scores_zero(swinging_arm: Swing, params: HarmonyParams):
    score = score_motion(track([], duration=6.0), swinging_arm(1.0, 25.0), params=params)
    assert (score.n_audio, score.harmony, score.hit_rate) == (0, 0.0, 0.0)
    assert np.isnan(score.harmony_above_chance) if params.measure == "shape" else score.harmony_above_chance == 0.0


@cases(
    "lag, kept",
    (0.25, [0.0, 0.24, 0.25, 3.0, 5.75]),
    (-0.25, [0.25, 3.0, 5.75, 5.76, 6.0]),
    (0.0, [0.0, 0.24, 0.25, 3.0, 5.75, 5.76, 6.0]),
)
def test_a_lag_takes_the_music_beats_whose_movement_would_lie_outside_of_the_clip(
    swinging_arm: Swing, lag: float, kept: list[float]
):
    # Six seconds. Danced .25 s late, 5.75 is danced at their very end and 5.76 after it; early, .24 before their start.
    beats = track([0.0, 0.24, 0.25, 3.0, 5.75, 5.76, 6.0], duration=6.0)
    params = replace(HarmonyParams.recommended(), lag=lag)
    assert score_motion(beats, swinging_arm(1.0, 60.0), params=params).music.times.tolist() == kept


STOPS = [0.25 + 0.5 * k for k in range(12)]


def clip(motion: Motion, *, seconds: float = 6.0, offset: float = 0.0, beats: list[float] | None = None) -> Clip:
    """A clip whose annotated beats are the stops of a 1 Hz arm that begins at 0 s."""
    annotated = BeatTrack(
        STOPS if beats is None else beats, np.ones(len(STOPS if beats is None else beats)), 100.0, 20.0
    )
    return Clip("arm", silence(seconds), motion, offset, beats=annotated)


def test_a_clip_without_motion_is_refused():
    refused("arm: there is no motion to score", score_clip, Clip("arm", silence(6.0)))


def test_a_clip_is_scored_with_its_annotated_beats(swinging_arm: Swing):
    score = score_clip(clip(swinging_arm(1.0, 60.0)), HarmonyParams.valleys())
    assert (score.n_audio, score.hit_rate) == (12, 1.0)


def test_a_clip_without_annotation_asks_the_tracker(swinging_arm: Swing):
    asked = []

    def tracker(audio: Audio) -> BeatTrack:
        asked.append(audio)
        return track(STOPS, duration=6.0)

    bare = replace(clip(swinging_arm(1.0, 60.0)), beats=None)
    assert score_clip(bare, HarmonyParams.valleys(), tracker=tracker).hit_rate == 1.0
    assert asked == [bare.audio]


def test_motion_that_starts_later_meets_later_beats(swinging_arm: Swing):
    late = clip(swinging_arm(1.0, 60.0, seconds=4.0), offset=1.1, beats=[time + 1.1 for time in STOPS[:8]])
    score = score_clip(late, HarmonyParams.valleys())
    assert (score.n_audio, score.hit_rate) == (8, 1.0)
    np.testing.assert_allclose(score.intervals, 0, atol=0.01)


@pytest.mark.parametrize("fps", [15.0, 25.0, 60.0])
def test_motion_that_starts_before_the_music_is_cut_to_it_without_moving_it(swinging_arm: Swing, fps: float):
    early = clip(swinging_arm(1.0, fps), offset=-1.13, beats=[time - 1.13 for time in STOPS[3:]])
    score = score_clip(early, HarmonyParams.valleys())
    assert (score.n_audio, score.hit_rate) == (9, 1.0)
    assert score.intervals[1:-1].max() < 0.01


def test_motion_that_goes_on_after_the_music_is_cut_to_it(swinging_arm: Swing):
    long = clip(swinging_arm(1.0, 60.0, seconds=30.0), seconds=6.0)
    assert score_clip(long, HarmonyParams.valleys()).n_visual in (12, 13)  # not the 60 of the whole motion


def test_with_a_clock_the_cut_falls_at_the_same_music(swinging_arm: Swing):
    # 30 s of motion last 33 s of music, of which there are 6.6: 12 stops every 0.55 s.
    long = clip(swinging_arm(1.0, 60.0, seconds=30.0), seconds=6.6, beats=[1.1 * time for time in STOPS])
    score = score_clip(long, replace(HarmonyParams.valleys(), clock=1.1))
    assert score.hit_rate == 1.0
    assert score.n_visual in (12, 13)


def test_a_clip_of_hardly_any_overlap_is_refused(swinging_arm: Swing):
    with pytest.raises(ValueError, match="arm: motion and music meet in less than two frames"):
        score_clip(clip(swinging_arm(1.0, 25.0), offset=5.99))


def test_the_same_seed_gives_the_same_interval(swinging_arm: Swing):
    # One visual beat for each music beat, half of them in reach.
    beats = [time + 0.12 * (k % 2) for k, time in enumerate(STOPS)]
    given = clip(swinging_arm(1.0, 60.0), beats=beats)
    first, again = (score_clip(given, HarmonyParams.valleys(), seed=1).interval for _ in range(2))
    assert first == again
    assert first[0] < first[1]
