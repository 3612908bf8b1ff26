"""The score by hand (Eq. 11-21), the beats that one would notice, nulls by rotation, p-values, intervals."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import binomtest

from harmolab import score as scoring
from harmolab import significance
from harmolab.beats import salience
from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.metrics.beat_alignment import kinematic_params, other_scores
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip, score_motion
from tests.builders import BODY, cases, metronome, refused, track

ALL_BEATS = replace(HarmonyParams.paper(), audio_threshold=0.0, visual_threshold=None)
Swing = Callable[..., Motion]


def silence(seconds: float) -> Audio:
    return Audio(np.zeros(round(seconds * 1000)), 1000)


@cases(
    "matching, music, motion, expected",
    ("many", [1.0, 1.2, 1.4], [1.1, 1.25], [True, True, True]),
    ("nearest", [1.0, 1.2, 1.4], [1.1, 1.25], [True, True, False]),  # 1.0 takes 1.1, then 1.2 takes 1.25
    ("max", [1.0, 1.2, 1.4], [1.1, 1.25], [False, True, True]),
    # 1.0 takes 1.05, the only one in reach of 1.15; the best pairing gives it 0.92 instead.
    ("nearest", [1.0, 1.15], [0.92, 1.05], [True, False]),
    ("max", [1.0, 1.15], [0.92, 1.05], [True, True]),
    *((how, [], each, []) for how in ("many", "nearest", "max") for each in ([], [1.0])),
    *((how, [1.0, 2.0], [], [False, False]) for how in ("many", "nearest", "max")),
)
def test_one_visual_beat_may_serve_one_music_beat_or_many_and_none_serve_nobody(matching, music, motion, expected):
    delay = 0.16 if len(music) == 3 else 0.1
    found = scoring.hit_mask(np.array(music), np.array(motion), delay=delay, matching=matching)
    assert found.sum() == sum(expected)  # of several best pairings any will do
    if matching != "max":
        np.testing.assert_array_equal(found, expected)
    if not motion:
        assert np.isinf(scoring.nearest_intervals(np.array(music), np.zeros(0))).all()


@pytest.mark.parametrize("matching", ["many", "nearest", "max"])
def test_a_delay_that_float_rounds_up_is_still_a_hit_and_a_microsecond_more_is_none(matching: str):
    music, motion = np.array([0.8]), np.array([0.7])
    assert music[0] - motion[0] > 0.1  # by the last bit
    assert scoring.hit_mask(music, motion, delay=0.1, matching=matching).all()
    assert not scoring.hit_mask(music + 1e-6, motion, delay=0.1, matching=matching).any()
    assert scoring.hit_pairs(music, motion, delay=0.1, matching=matching).tolist() == [0]
    assert scoring.hit_pairs(music + 1e-6, motion, delay=0.1, matching=matching).tolist() == [-1]


@cases(
    "score, n_audio, n_visual, beta, expected",
    (3.0, 4, 9, 2.0, 0.6),  # 5 * 3 / (16 + 9)
    (4.0, 4, 4, 2.0, 1.0),
    (2.0, 2, 4, 1.0, 2 / 3),
    (0.0, 0, 4, 2.0, 0.0),
    (0.0, 4, 0, 2.0, 0.0),
)
def test_harmony_is_a_weighted_harmonic_mean_that_follows_from_the_hitting_score(
    score: float, n_audio: int, n_visual: int, beta: float, expected: float
):
    assert scoring.harmony_from_hits(score, n_audio, n_visual, beta) == pytest.approx(expected)
    assert scoring.f_score(score / max(n_audio, 1), score / max(n_visual, 1), beta) == pytest.approx(expected)


@cases(
    "visual, expected",
    ([], 0.0),
    ([5.0], 0.05),
    ([5.0, 5.3], 0.08),  # 4.75-5.25 and 5.05-5.55 overlap
    ([0.1, 9.9], 0.07),  # cut off at both ends
    ([5.1, 5.0, 5.2], 0.07),  # in any order
    ([-0.5, 11.0], 0.0),  # where a lag has put them
    ([-0.5, -0.1], 0.015),  # the second reaches to .15 s, and from the start at the earliest
)
def test_chance_is_the_share_of_time_near_a_visual_beat(visual: list[float], expected: float):
    assert scoring.chance_level(np.array(visual), delay=0.25, duration=10.0) == pytest.approx(expected)


@cases(
    "share, chance, expected",
    *((1.0, 0.4, 1.0), (0.4, 0.4, 0.0), (0.1, 0.4, -0.5), (1.0, 1.0, 0.0)),
    *((1.0, 1 - 1e-12, 0.0), (1.0, 1 - 1e-6, 1.0)),  # 1 but for rounding leaves nothing to be above
)
def test_above_chance_is_zero_at_chance_and_one_at_the_top(share: float, chance: float, expected: float):
    assert scoring.above_chance(share, chance) == pytest.approx(expected)


def test_a_score_by_hand():
    # Four music beats of strength 1, .5, 1, .5; visual beats near the first and the last.
    music = track([1.0, 3.0, 5.0, 7.0], [2.0, 1.0, 2.0, 1.0])
    score = scoring.score_harmony(music, track([1.1, 7.2, 9.0]), params=ALL_BEATS, n_rotations=0)
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
    params = replace(ALL_BEATS, audio_threshold=1.0)
    score = scoring.score_harmony(music, track([3.0, 7.0]), params=params, n_rotations=0)
    assert (score.n_audio, score.hitting_score, score.hit_rate) == (2, 0.0, 0.5)


def test_movements_that_lag_score_as_those_that_come_so_much_earlier():
    music = track([0.5, 3.0, 5.0, 9.0], [1.0, 0.5, 1.0, 0.5])
    late, early = (track([each + 0.5, each + 3.4, each + 5.9]) for each in (0.375, 0.0))
    score = scoring.score_harmony(music, late, params=replace(ALL_BEATS, lag=0.375), n_rotations=99)
    same = scoring.score_harmony(music, early, params=ALL_BEATS, n_rotations=99)
    np.testing.assert_allclose(score.intervals, [0.0, 0.4, 0.9, 3.1], atol=1e-12)
    np.testing.assert_allclose(score.intervals, same.intervals, atol=1e-12)
    np.testing.assert_array_equal(score.null, same.null)
    assert score.p_value == same.p_value


def test_chance_of_movements_that_lag_is_counted_where_they_belong():
    # From .5 s the quarter of a second to either side is whole, from .1 s it is cut off at the start.
    params = replace(ALL_BEATS, reaction_delay=0.25, lag=0.4)
    score = scoring.score_harmony(track([1.0, 3.0]), track([0.5]), params=params, n_rotations=0)
    assert score.chance == pytest.approx(0.035)


def test_the_hit_rate_pairs_beats_as_it_is_told():
    music, between = track([1.0, 1.2]), track([1.1])
    readings = (replace(ALL_BEATS, matching=matching) for matching in ("many", "nearest", "max"))
    scores = [scoring.score_harmony(music, between, params=params, n_rotations=0) for params in readings]
    assert [score.hit_rate for score in scores] == [1.0, 0.5, 0.5]


def test_null_and_interval_are_shares_of_the_strengths():
    # Strengths 2 and 1: a rotation hits two thirds, a third or nothing, and so may a resampling.
    music, params = track([1.0, 5.0], [2.0, 1.0]), replace(ALL_BEATS, reaction_delay=0.25)
    score = scoring.score_harmony(music, track([1.0]), params=params, n_rotations=99)
    np.testing.assert_allclose(np.unique(score.null), [0, 1 / 3, 2 / 3])
    # A twentieth of ten seconds lies near the movement: no hit at all is (0 - .05) / .95.
    assert score.interval == pytest.approx((-0.05 / 0.95, 1.0))


def test_the_interval_counts_beats_by_their_strength():
    # Nineteen beats of strength 1 are hit, one of 50 is missed. Of resamplings 1.6 % draw it four times or more and
    # 7.5 % three times or more, so the bound at 2.5 % is that of three times.
    music = track(np.arange(20) / 2.0, [1.0] * 19 + [50.0])
    score = scoring.score_harmony(music, track(np.arange(19) / 2.0), params=replace(ALL_BEATS, reaction_delay=0.1))
    assert score.interval[0] == pytest.approx(scoring.above_chance(17 / (17 + 3 * 50), score.chance))


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
    score = scoring.score_harmony(track(music), track(motion))
    numbers = (score.harmony, score.audio_harmony, score.visual_harmony, score.hit_rate, score.harmony_above_chance)
    assert numbers == (0, 0, 0, 0, 0)
    assert np.isnan(score.p_value)


def test_every_beat_hit_by_chance_is_not_harmony():
    # A visual beat every 0.1 s reaches every moment.
    score = scoring.score_harmony(track([1.0, 2.0]), track(np.arange(0.0, 10.0, 0.1).tolist()), params=ALL_BEATS)
    assert (score.hit_rate, score.chance, score.harmony_above_chance, score.p_value) == (1.0, 1.0, 0.0, 1.0)


def test_perfect_beats_are_matched_only_by_rotations_of_less_than_the_delay():
    beats = track([0.7, 2.1, 3.0, 4.9, 6.3, 8.8])
    score = scoring.score_harmony(beats, beats, params=HarmonyParams.valleys(), n_rotations=999)
    assert (score.harmony_above_chance, score.interval) == (1.0, (1.0, 1.0))
    # Of 999 rotations over 10 s, the first and the last ten move by less than 0.1 s.
    assert score.p_value == pytest.approx(21 / 1000)


def test_beats_at_random_moments_have_no_small_p_value_more_often_than_chance(rng: np.random.Generator):
    values = []
    for _ in range(200):
        music, motion = (track(np.sort(rng.uniform(0, 10, 12)).tolist()) for _ in range(2))
        values.append(scoring.score_harmony(music, motion, params=HarmonyParams.valleys(), n_rotations=99).p_value)
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


@cases(
    "lag, kept",
    (0.25, [0.0, 0.24, 0.25, 3.0, 5.75]),
    (-0.25, [0.25, 3.0, 5.75, 5.76, 6.0]),
    (0.0, [0.0, 0.24, 0.25, 3.0, 5.75, 5.76, 6.0]),
)
def test_a_lag_takes_beats_whose_movement_lies_outside_the_clip(swinging_arm: Swing, lag: float, kept: list[float]):
    # Six seconds. Danced .25 s late, 5.75 is danced at their very end and 5.76 after it; early, .24 before their start.
    beats = track([0.0, 0.24, 0.25, 3.0, 5.75, 5.76, 6.0], duration=6.0)
    params = replace(HarmonyParams.recommended(), lag=lag)
    assert score_motion(beats, swinging_arm(1.0, 60.0), params=params).music.times.tolist() == kept


STOPS = [0.25 + 0.5 * k for k in range(12)]


def clip(motion: Motion, *, seconds: float = 6.0, offset: float = 0.0, beats: list[float] | None = None) -> Clip:
    """A clip whose annotated beats are the stops of a 1 Hz arm that begins at 0 s."""
    return Clip("arm", silence(seconds), motion, offset, beats=track(STOPS if beats is None else beats, duration=20.0))


def test_a_clip_without_motion_and_a_delay_that_is_none_are_refused():
    refused("delay must be zero or more seconds, got nan", scoring.hit_mask, [1.0], [1.0], delay=float("nan"))
    refused("arm: there is no motion to score", score_clip, Clip("arm", silence(6.0)))


def test_a_clip_without_annotation_asks_the_tracker(swinging_arm: Swing):
    asked = []

    def tracker(audio: Audio) -> BeatTrack:
        asked.append(audio)
        return track(STOPS, duration=6.0)

    bare = replace(clip(swinging_arm(1.0, 60.0)), beats=None)
    assert score_clip(bare, HarmonyParams.valleys(), tracker=tracker).hit_rate == 1.0
    assert asked == [bare.audio]


@cases("fps, offset, first, seconds", (60.0, 1.1, 0, 4.0), *((fps, -1.13, 3, 6.0) for fps in (15.0, 25.0, 60.0)))
def test_motion_that_starts_elsewhere_is_cut_to_the_music_without_moving_it(
    swinging_arm: Swing, fps: float, offset: float, first: int, seconds: float
):
    stops = STOPS[first : round(2 * seconds)]
    given = clip(swinging_arm(1.0, fps, seconds=seconds), offset=offset, beats=[time + offset for time in stops])
    score = score_clip(given, HarmonyParams.valleys())
    assert (score.n_audio, score.hit_rate) == (len(stops), 1.0)
    assert score.intervals[1:-1].max() < 0.01


@pytest.mark.parametrize("clock", [1.0, 1.1])
def test_motion_that_goes_on_after_the_music_is_cut_to_it_by_any_clock(swinging_arm: Swing, clock: float):
    # At 1.1, 30 s of motion last 33 s of music, of which there are 6.6: 12 stops every 0.55 s.
    long = clip(swinging_arm(1.0, 60.0, seconds=30.0), seconds=6 * clock, beats=[clock * time for time in STOPS])
    score = score_clip(long, replace(HarmonyParams.valleys(), clock=clock))
    assert score.hit_rate == 1.0
    assert score.n_visual in (12, 13)  # not the 60 of the whole motion


def test_a_clip_of_hardly_any_overlap_is_refused(swinging_arm: Swing):
    late = clip(swinging_arm(1.0, 25.0), offset=5.99)
    refused("arm: motion and music meet in less than two frames", score_clip, late)


# Mean 2, deviations -1, 1, -1, 1: population SD 1.
STRENGTHS = np.array([1.0, 3.0, 1.0, 3.0])


@cases(
    "strengths, factor, reading, expected",
    *(([0.5, 3.0, 1.0, 3.0], factor, "literal", [False, True, False, True]) for factor in (0.01, 1.0, 100.0)),
    (STRENGTHS, 1.0, "literal", [False, True, False, True]),  # 1 is the SD, which counts and not the mean
    (STRENGTHS + 0.5, 1.0, "literal", [True, True, True, True]),
    (np.full(3, 0.2), 5.0, "threshold", [True, True, True]),
    ([0.0, 1.0], 0.0, "threshold", [False, True]),  # without strength never
    ([], 1.0, "threshold", []),
)
def test_a_music_beat_is_salient_above_the_spread_of_strengths(strengths, factor, reading, expected):
    np.testing.assert_array_equal(salience.audio_mask(np.array(strengths), factor, reading=reading), expected)


# R = 4, 4, 2, 6 (the first copied); SD of the defined 4, 2, 6 is sqrt(8/3) = 1.63.
VISUAL = np.array([1.0, 5.0, 3.0, 9.0])


@cases(
    "strengths, threshold, how, expected",
    # With the copied step the spread would be sqrt(2), and 4 above 2.6 times that.
    (VISUAL, 2.6, {}, [False, False, False, True]),  # 4.25
    (VISUAL, 2.4, {}, [True, True, False, True]),  # 3.92
    # R = 1, 1, 3; SD of the defined 1 and 3 is 1.
    *(([0.0, 1.0, 4.0], 1.0, {"reading": how}, [False, False, True]) for how in ("threshold", "literal")),
    (VISUAL, 3.0, {"quantity": "strength"}, [False, True, False, True]),
    (VISUAL, 3.0, {"reading": "literal"}, [True, True, True, True]),
    (VISUAL, 1.5, {"first_beat": "drop"}, [False, True, False, True]),
    (VISUAL, None, {}, [True, True, True, True]),
    # One beat has no step (R = 0); of two, both have the one step there is, whose SD is 0.
    *(([], 1.0, {}, []), ([2.0], 1.0, {}, [False]), ([2.0, 3.0], 1.0, {}, [True, True])),
)
def test_a_visual_beat_is_salient_where_its_step_exceeds_the_spread_of_steps(strengths, threshold, how, expected):
    np.testing.assert_array_equal(salience.visual_mask(np.array(strengths), threshold, **how), expected)


@cases(
    "strengths, how, expected",
    *(([2.0, 4.0], how, each) for how, each in (("max", [0.5, 1.0]), ("mean", [2 / 3, 4 / 3]), ("raw", [2.0, 4.0]))),
    *(([], "max", []), ([0.0, 0.0], "max", [0.0, 0.0])),
)
def test_strengths_are_normalised_as_asked(strengths, how, expected):
    np.testing.assert_allclose(salience.normalise_strengths(np.array(strengths), how), expected)


def test_salient_music_beats_keep_time_bar_place_and_normalised_strength():
    params = replace(HarmonyParams.paper(), audio_threshold=1.0, normalisation="max")
    beats = metronome([1.0, 3.0, 1.0, 3.0], bar_places=[0, 1, 2, 3], period=1.0, duration=10.0)
    kept = salience.salient_audio(beats, params)
    np.testing.assert_array_equal(kept.times, [1.0, 3.0])
    np.testing.assert_array_equal(kept.strengths, [1.0, 1.0])
    np.testing.assert_array_equal(kept.bar_places, [1, 3])


@cases(
    "how, times",
    ({"visual_threshold": 3.0}, [3.0]),
    ({"visual_threshold": 1.5, "first_beat": "drop"}, [1.0, 3.0]),
    ({"visual_threshold": 3.0, "visual_saliency": "strength"}, [1.0, 3.0]),
    ({"visual_threshold": 3.0, "saliency": "literal"}, [0.0, 1.0, 2.0, 3.0]),
)
def test_visual_saliency_is_read_as_the_params_say_and_strengths_stay_raw(how, times):
    kept = salience.salient_visual(metronome(VISUAL.tolist(), period=1.0), replace(HarmonyParams.paper(), **how))
    np.testing.assert_array_equal(kept.times, times)
    np.testing.assert_array_equal(kept.strengths, VISUAL[kept.times.astype(int)])


@pytest.mark.parametrize(("reading", "count"), [("threshold", 0), ("literal", 4)])
def test_audio_saliency_is_read_as_the_params_say(reading, count):
    params = replace(HarmonyParams.paper(), audio_threshold=100.0, saliency=reading)
    assert len(salience.salient_audio(metronome([1.0, 3.0, 2.0, 3.0]), params)) == count


def test_rotations_are_spread_evenly_and_never_zero():
    np.testing.assert_allclose(significance.rotations(8.0, 4), [1, 3, 5, 7])


def test_rotated_hits_agree_with_counting_one_by_one(rng: np.random.Generator):
    audio, visual = np.sort(rng.uniform(0, 6, 9)), np.sort(rng.uniform(0, 6, 7))
    weights = rng.uniform(size=9)
    expected = []
    for shift in significance.rotations(6.0, 50):
        distance = np.abs(audio[:, None] - np.mod(visual + shift, 6.0))
        near = np.minimum(distance, 6.0 - distance).min(axis=1) <= 0.2
        expected.append(near @ weights)
    hit = significance.rotated_hits(audio, visual, weights, delay=0.2, duration=6.0, count=50)
    np.testing.assert_allclose(hit, expected)


@cases(
    "music, motion, hits",
    ([], [1.0], 0.0),
    ([1.0], [], 0.0),
    ([1.8], [0.7], 1.0),  # half of two seconds earlier is exactly at the delay; .8 - .7 is rounded up
    ([1.8 + 1e-6], [0.7], 0.0),
)
def test_a_rotated_beat_exactly_at_the_delay_is_a_hit_and_none_hit_none(music, motion, hits):
    weights = np.ones(len(music))
    hit = significance.rotated_hits(np.array(music), np.array(motion), weights, delay=0.1, duration=2.0, count=1)
    assert hit.tolist() == [hits]


@cases(
    "observed, null, expected",
    *((5.0, [1.0, 2.0, 3.0], 0.25), (2.0, [1.0, 2.0, 3.0], 0.75), (0.0, [1.0, 2.0, 3.0], 1.0), (1.0, [], 1.0)),
    *((np.nan, [0.0, 1.0], np.nan), (1.0, [0.0, np.nan], np.nan)),
    *((0.1 + 0.2, [0.3], 1.0), (0.3 + 1e-9, [0.3], 0.5)),  # rounding put .3 below the observation
)
def test_p_value_counts_the_observation_itself(observed, null, expected):
    np.testing.assert_equal(significance.p_value(observed, null), expected)


@cases(
    "values, weights, expected",
    ([0.5, 0.5, 0.5], None, (0.5, 0.5)),
    ([1.0, 1.0, 0.0], [1.0, 2.0, 0.0], (0.0, 1.0)),  # what has no weight moves nothing, alone it is 0
    *(([], None, (np.nan, np.nan)), ([1.0], None, (np.nan, np.nan)), ([1.0, 2.0], [0.0, 0.0], (np.nan, np.nan))),
)
def test_an_interval_has_no_width_for_equal_values_and_no_ends_for_too_few(values, weights, expected):
    np.testing.assert_equal(significance.bootstrap_interval(values, weights, count=200, seed=1), expected)


def test_an_interval_holds_the_mean_and_narrows_with_more_values():
    few = significance.bootstrap_interval([0.0, 1.0] * 10)
    many = significance.bootstrap_interval([0.0, 1.0] * 1000)
    assert few[0] < many[0] < 0.5 < many[1] < few[1]
    # SD 0.5 over the square root of 20 and 2000, times 1.96.
    assert few[1] - few[0] == pytest.approx(2 * 1.96 * 0.5 / np.sqrt(20), rel=0.15)
    assert many[1] - many[0] == pytest.approx(2 * 1.96 * 0.5 / np.sqrt(2000), rel=0.15)


def test_an_interval_is_the_same_for_the_same_seed():
    values = np.arange(10.0)
    assert significance.bootstrap_interval(values, seed=3) == significance.bootstrap_interval(values, seed=3)
    assert significance.bootstrap_interval(values, seed=3) != significance.bootstrap_interval(values, seed=4)


@cases(
    "positives, negatives, expected",
    ([2.0, 3.0], [0.0, 1.0], 1.0),
    ([0.0, 1.0], [2.0, 3.0], 0.0),
    ([1.0, 1.0], [1.0], 0.5),
    ([1.0, 3.0], [2.0, 2.0], 0.5),
    ([1.0, 3.0], [0.0, 2.0], 0.75),  # 1 beats 0; 3 beats both
    ([2.0], [[1.0, 3.0], [0.0, 4.0]], 0.5),  # every value of a table
    *(([], [1.0], np.nan), ([1.0], [], np.nan), ([np.nan], [1.0], np.nan), ([1.0, 2.0], [np.nan, 0.0], np.nan)),
)
def test_auc_counts_pairs_and_ties_half(positives, negatives, expected):
    np.testing.assert_equal(significance.auc(positives, negatives), expected)


def test_mean_interval_is_students():
    # Mean 2, standard deviation 1, three values; the table's t for two degrees of freedom is 4.30265.
    half = 4.30265 / 3**0.5
    assert significance.mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2.0, 2 - half, 2 + half), abs=1e-5)


@pytest.mark.parametrize(("values", "mean"), [([], np.nan), ([2.0], 2.0), ([1.0, np.inf], np.inf)])
def test_mean_of_too_little_has_no_interval(values: list[float], mean: float):
    np.testing.assert_equal(significance.mean_interval(values), (mean, np.nan, np.nan))


@pytest.mark.parametrize(("hits", "n"), [(0, 7), (3, 7), (7, 7), (40, 90)])
def test_wilson_interval_is_scipys(hits: int, n: int):
    bounds = binomtest(hits, n).proportion_ci(0.9, method="wilson")
    assert significance.wilson_interval(hits, n, 0.9) == pytest.approx((bounds.low, bounds.high), abs=1e-12)
    assert significance.wilson_interval(0, 7)[0] == 0.0
    assert significance.wilson_interval(7, 7)[1] == 1.0


def test_wilson_interval_takes_students_quantile_where_the_variance_is_uncertain():
    # With z = 4.30265 (two degrees of freedom): centre 0.5, half width z / sqrt(4 n + 4 z**2) by hand.
    half = 4.30265 / 114.0511**0.5
    assert significance.wilson_interval(5, 10, freedom=2) == pytest.approx((0.5 - half, 0.5 + half), abs=1e-5)


def test_no_answers_have_no_wilson_interval():
    np.testing.assert_equal(significance.wilson_interval(0, 0), (np.nan, np.nan))


def test_bootstrap_of_a_statistic_is_that_of_the_mean_for_the_mean(rng: np.random.Generator):
    values = rng.normal(size=30)
    expected = significance.bootstrap_interval(values, seed=3)
    interval = significance.bootstrap_interval_of(lambda places: values[places].mean(axis=1), 30, seed=3)
    assert interval == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("value", "n"), [(1.0, 1), (np.nan, 9)])
def test_bootstrap_of_what_is_rarely_defined_is_nan(value: float, n: int):
    interval = significance.bootstrap_interval_of(lambda places: np.full(len(places), value), n)
    np.testing.assert_equal(interval, (np.nan, np.nan))


# One visual beat for one music beat; movement beyond the music; a dance of which no start is known


@cases("matching", "nearest", "max")
def test_where_a_visual_beat_serves_one_music_beat_the_null_is_matched_so_too(matching: str):
    """Music beats twice as many as visual beats: one to one no more than half of them can be met, by luck or not."""
    music, visual = track(np.arange(1, 40) / 2, duration=20.0), track(np.arange(1.0, 20.0), duration=20.0)
    params = replace(HarmonyParams.valleys(), matching=matching, reaction_delay=0.4)
    score = scoring.score_harmony(music, visual, params=params)
    assert score.null.max() <= 20 / 39 and score.p_value > 0.5
    # The chance of the reading is that of many to one: the most that luck could reach.
    assert score.chance == pytest.approx(0.8 * 19 / 20) and score.chance > score.null.mean()


def test_movement_after_the_end_of_the_music_counts_for_nothing():
    rng = np.random.default_rng(4)
    music = track(np.arange(0.5, 20.0, 0.5), duration=20.0)
    late = np.sort(np.r_[rng.uniform(0, 19.9, 35), rng.uniform(21, 40, 35)])
    params = HarmonyParams.valleys()
    tracks = (track(late, duration=40.0), track(late[late < 20], duration=20.0))
    whole, cut = (scoring.score_harmony(music, visual, params=params) for visual in tracks)
    assert (whole.p_value, whole.harmony, whole.n_visual) == (cut.p_value, cut.harmony, cut.n_visual)


def test_a_dance_of_which_no_start_is_known_has_no_number_on_its_place():
    clip = synthetic_clip("jive", seconds=30.0, seed=3)
    placed, free = (score_clip(replace(clip, has_start=has_start)) for has_start in (True, False))
    assert placed.harmony_above_chance > 0.5 and free.place_harmony == placed.place_harmony
    assert np.isnan([free.harmony_above_chance, free.p_value, *free.interval]).all()
    content = free.to_dict()
    assert content["has_start"] is False and content["p_time"] == placed.to_dict()["p_time"]
    places = ("harmony_above_chance", "p_value", "p_place", "lag_s", "fastest_after_beat_s")
    assert [content[name] for name in places] == [None] * 5
