"""Many clips at once: the batch scorer as clip by clip, and fits as the place test, wherever the music begins."""

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PlaceBatch, rescore, rescore_places
from harmolab.lab.compare.scores import PeakLags, with_one_place
from harmolab.lab.compare.windows import MOMENTS, FitBatch, Lessons, coefficients, cycle_curve
from harmolab.params import HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import score_harmony
from harmolab.shape_speed import ShapeSignal
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.bar_pattern import beat_positions, evaluate_pattern, fit_pattern, pattern_sums
from harmolab.verdict.evidence import place_test
from harmolab.verdict.judge import score_motion
from tests.builders import cases, metronome, refused

MOVED = {"lag": 0.03, "reaction_delay": 0.1, "visual_threshold": 0.5, "audio_threshold": 1.0, "beta": 0.7}
SETTINGS = {
    "paper": HarmonyParams.paper(),
    "valleys": HarmonyParams.valleys(),
    "sliders moved": replace(HarmonyParams.paper(), **MOVED),
}


def random_track(rng: np.random.Generator, most: int) -> BeatTrack:
    count = int(rng.integers(0, most))
    return BeatTrack(np.sort(rng.uniform(0, 6, count)), rng.uniform(0, 5, count), 15.0, 6.0)


@pytest.mark.parametrize("name", SETTINGS)
def test_batch_agrees_with_single_clips_even_without_beats(rng: np.random.Generator, name: str) -> None:
    pairs = [(random_track(rng, 15), random_track(rng, 40)) for _ in range(60)]
    pairs[0] = (BeatTrack([], [], 15.0, 6.0), pairs[0][1])
    pairs[1] = (pairs[1][0], BeatTrack([], [], 15.0, 6.0))
    batch = rescore(BeatBatch.of(pairs), SETTINGS[name])
    singles = [score_harmony(*pair, params=SETTINGS[name], n_rotations=0) for pair in pairs]
    for field in fields(BatchScores):
        expected = [getattr(single, field.name) for single in singles]
        np.testing.assert_allclose(getattr(batch, field.name), expected, atol=1e-9, err_msg=field.name)


def test_beats_of_one_clip_never_hit_those_of_the_next() -> None:
    music = BeatTrack([5.99], [1.0], 15.0, 6.0)
    scores = rescore(BeatBatch.of([(music, BeatTrack([0.0], [1.0], 15.0, 6.0))] * 2), HarmonyParams.valleys())
    np.testing.assert_array_equal(scores.hit_rate, [0.0, 0.0])


def test_other_readings_are_refused_by_name() -> None:
    batch = BeatBatch.of([(BeatTrack([1.0], [1.0], 15.0, 6.0),) * 2])
    refused("use score_harmony", rescore, batch, replace(HarmonyParams.paper(), matching="nearest"))


def test_an_empty_batch_is_refused() -> None:
    refused("at least one clip", BeatBatch.of, [])
    refused("at least one clip", PlaceBatch.of, [], HarmonyParams.recommended())


# The recommended mode

PATTERNS = {
    "nothing told": HarmonyParams.recommended(),
    "hit": HarmonyParams.recommended(HOW_PATTERNS["hit"]),
    "beta": replace(HarmonyParams.recommended(), beta=2.0),
    "two beats": HarmonyParams.recommended(BarPattern(2, (-0.5, -0.5), (0.1, 0.0), "planted")),
}


def placed(clip: Clip, seed: int) -> tuple[BeatTrack, Motion]:
    """Music with strengths and bar places, and the motion."""
    assert clip.beats is not None and clip.motion is not None
    count = len(clip.beats)
    strengths = np.random.default_rng(seed).uniform(0, 5, count)
    return replace(clip.beats, strengths=strengths, bar_places=(np.arange(count) + seed) % 4), clip.motion


@pytest.fixture(scope="module")
def dances() -> list[tuple[BeatTrack, Motion]]:
    """Dances of several tempi and frame rates; the last is danced half a beat late, so that it hits the beats."""
    kinds = ["cha-cha", "jive", "waltz", "rumba"]
    seeds = range(len(kinds))
    clips = [synthetic_clip(kinds[seed], seconds=18.0, fps=25.0 + seed, jitter=0.05, seed=seed) for seed in seeds]
    track, motion = placed(clips[0], 0)
    late = track.times + 30 / track.tempo
    return [*map(placed, clips, seeds), (replace(track, times=late, duration=late[-1] + 1), motion)]


@pytest.mark.parametrize("name", PATTERNS)
def test_place_batch_agrees_with_score_motion(dances: list[tuple[BeatTrack, Motion]], name: str) -> None:
    params = PATTERNS[name]
    batch = rescore_places(PlaceBatch.of(dances, params), params)
    singles = [score_motion(*pair, params=params, n_rotations=0) for pair in dances]
    for field in fields(BatchScores):
        name = "place_harmony" if field.name == "harmony_above_chance" else field.name
        expected = [getattr(single, name) for single in singles]
        np.testing.assert_allclose(getattr(batch, field.name), expected, atol=1e-9, err_msg=field.name)


def test_lag_of_score_or_of_music_is_a_lag_of_the_place_test(dances: list[tuple[BeatTrack, Motion]]) -> None:
    params = HarmonyParams.recommended()
    batch = PlaceBatch.of(dances, params)
    for steps in (5, 24, 60):  # moments of 1/48 beat
        late = steps / 48 * batch.periods
        expected = batch.curves[:, steps]
        for number, seconds in enumerate(late):
            scores = rescore_places(batch, replace(params, lag=float(seconds)))
            share = scores.harmony_above_chance * (1 - batch.chance) + batch.chance
            assert share[number] == pytest.approx(expected[number])
        moved = rescore_places(batch.moved(late), params)
        np.testing.assert_allclose(moved.harmony_above_chance, (expected - batch.chance) / (1 - batch.chance))


def test_music_half_a_beat_late_scores_about_as_beats_that_were_moved(dances: list[tuple[BeatTrack, Motion]]) -> None:
    params = HarmonyParams.recommended(BarPattern.stop_on_the_beat())
    track, motion = dances[0]
    seconds = 30 / track.tempo
    inside = track.times + seconds <= motion.duration
    music = replace(track.select(inside), times=track.times[inside] + seconds, duration=motion.duration)
    batch = PlaceBatch.of([(track, motion)], params).moved(np.array([seconds]))
    expected = score_motion(music, motion, params=params).harmony_above_chance
    assert rescore_places(batch, params).harmony_above_chance[0] == pytest.approx(expected, abs=0.05)


def test_music_that_comes_home_scores_as_before(dances: list[tuple[BeatTrack, Motion]]) -> None:
    batch = PlaceBatch.of(dances, HarmonyParams.recommended())
    np.testing.assert_array_equal(batch.moved(batch.curves.shape[1] / 48 * batch.periods).curves, batch.curves)


def test_short_clips_are_ranked_and_those_that_cannot_be_have_nothing_above_chance() -> None:
    params = HarmonyParams.recommended()
    music, motion = placed(synthetic_clip("cha-cha", seconds=4.0, fps=30.0, seed=1), 0)
    still = Motion(np.zeros((120, 3, 3)), 30.0, Skeleton.unnamed(3))
    few = [BeatTrack(times, np.ones(len(times)), 43.0, 4.0) for times in ([], [2.0], [1.0, 1.5])]
    batch = PlaceBatch.of([(music, motion), (music, still), *((one, motion) for one in few)], params)
    scores = rescore_places(batch, params)
    assert len(music) < 16
    assert scores.harmony_above_chance[0] > 0.3
    np.testing.assert_array_equal(scores.harmony_above_chance[1:], [0.0, 0.0, 0.0, 0.0])


RATE = 100.0
WALTZ = BarPattern(3, (0.1, 0.2, 0.1), (0.4, -0.1, 0.2))
HALF = BarPattern(2, (0.3, -0.1), (0.4, 0.0))


def smooth_noise(rng: np.random.Generator, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Seconds and values of a curve that knows nothing of any beat."""
    values = gaussian_filter1d(rng.normal(size=round(seconds * RATE)), 8)
    return np.arange(values.size) / RATE, (values - values.mean()) / values.std()


def bars(count: int, cycle: int, *, period: float = 0.5, first: float = 0.0) -> BeatTrack:
    return metronome(np.ones(count), period=period, first=first, bar_places=np.arange(count) % cycle)


def test_curve_begins_where_a_cycle_does_and_holds_whole_cycles():
    times = np.arange(0, 8.0, 0.01)
    track = bars(12, 3, period=0.5, first=0.5)  # from 0.5 to 6 s, but the beats go on to 8 s: 16 beats, 5 whole cycles
    speed = np.cos(2 * np.pi * (times - 0.5) / 1.5)  # largest on every "one"
    curve = cycle_curve(times, speed, track, 3)
    assert curve.size == 5 * 3 * MOMENTS
    np.testing.assert_allclose(curve, np.tile(np.cos(2 * np.pi * np.arange(3 * MOMENTS) / (3 * MOMENTS)), 5), atol=2e-3)


@cases(
    "beats, speed, cycle",
    *((1, np.ones(600), 2), (12, np.zeros(600), 2), (12, np.ones(600), 13)),
    ids=["one beat", "no movement", "no whole cycle"],
)
def test_clip_without_cycles_has_no_curve_and_no_harmony(beats: int, speed: np.ndarray, cycle: int):
    curve = cycle_curve(np.arange(600) / RATE, speed, bars(beats, cycle), cycle)
    assert curve.size == 0
    rest = coefficients(BarPattern.stop_on_the_beat(), cycle)
    np.testing.assert_array_equal(FitBatch.of([curve], cycle).harmony(rest[None]), np.zeros((1, 10 * cycle)))


@pytest.mark.parametrize("pattern", [BarPattern.stop_on_the_beat(), HALF, WALTZ])
def test_harmony_of_many_clips_is_that_of_the_place_test(pattern: BarPattern, rng: np.random.Generator):
    # Beats half a second apart lie on every fiftieth sample; the clips end with a whole cycle.
    curves, singles = [], []
    for cycles in (6, 9, 7):
        count = cycles * pattern.beats
        times, values = smooth_noise(rng, count * 0.5 + 0.01)
        track = bars(count + 1, pattern.beats)
        curves.append(cycle_curve(times, values, track, pattern.beats))
        signal = ShapeSignal(times, values, np.ones(times.size, bool), 1.0, 1.0, 1.0, 3)
        test = place_test(signal, track.times, track.bar_places, pattern)
        singles.append(2 * np.interp(np.arange(10) / 10 * 48, np.arange(test.curve.size), test.curve) - 1)
    weights = np.tile(coefficients(pattern, pattern.beats), (3, 1))
    # One ranks 20 moments a beat, the other 48.
    np.testing.assert_allclose(FitBatch.of(curves, pattern.beats).harmony(weights)[:, :10], singles, atol=0.04)


def test_pattern_of_a_beat_is_the_same_over_a_cycle_of_beats():
    np.testing.assert_array_equal(coefficients(BarPattern(1, (-1.0,), (0.5,)), 3), [0, 0, 0, 0, -1, 0.5])
    np.testing.assert_array_equal(coefficients(HALF, 2), [0.3, 0.4, -0.1, 0.0])


def lessons_of(clips: Sequence[tuple[np.ndarray, np.ndarray]], track: BeatTrack, cycle: int) -> Lessons:
    sums = [pattern_sums(beat_positions(times, track), values, cycle) for times, values in clips]
    return Lessons.of(sums, ~np.eye(len(clips), dtype=bool), cycle)


def test_patterns_are_learnt_on_the_others(rng: np.random.Generator):
    clips = [smooth_noise(rng, 6.0) for _ in range(3)]
    track = bars(12, 2)
    weights = lessons_of(clips, track, 2).weights()
    pattern = fit_pattern([pattern_sums(beat_positions(times, track), values, 2) for times, values in clips[1:]])
    expected = coefficients(pattern, 2)
    np.testing.assert_allclose(weights[0] / np.linalg.norm(weights[0]), expected / np.linalg.norm(expected))


def test_pattern_learnt_on_later_music_is_that_of_the_moved_beats(rng: np.random.Generator):
    clips = [smooth_noise(rng, 6.0) for _ in range(2)]
    origins = np.array([0.7, 1.3])
    moved = lessons_of(clips, bars(12, 2), 2).weights(origins)
    for judged, teacher in ((0, 1), (1, 0)):
        late = bars(12, 2, first=origins[teacher] * 0.5)
        sums = pattern_sums(beat_positions(clips[teacher][0], late), clips[teacher][1], 2)
        expected = np.stack([sums.sums.real, -sums.sums.imag], axis=-1).ravel()
        np.testing.assert_allclose(moved[judged], expected, atol=1e-9)


def test_nobody_to_learn_from_leaves_movements_that_stop_on_the_beat(rng: np.random.Generator):
    weights = lessons_of([smooth_noise(rng, 6.0)], bars(12, 2), 2).weights()
    np.testing.assert_array_equal(weights, [[0.0, 0.0, -1.0, 0.0]])


def test_dancers_of_one_mind_are_right_wherever_the_music_begins_for_all(rng: np.random.Generator):
    track = bars(12, 3)
    times = np.arange(600) / RATE
    clips = [(times, evaluate_pattern(WALTZ, times / 0.5) + 0.1 * smooth_noise(rng, 6.0)[1]) for _ in range(4)]
    batch, lessons = FitBatch.of([cycle_curve(*clip, track, 3) for clip in clips], 3), lessons_of(clips, track, 3)
    first, later = (batch.harmony(lessons.weights(np.full(4, beats))) for beats in (0.0, 0.7))
    np.testing.assert_allclose(first[:, 0], later[:, 7], atol=0.1)
    assert first[:, 0].min() > 0.8 > 0.5 > first[:, 7].max()
    assert later[:, 7].min() > 0.8 > 0.5 > later[:, 0].max()


# Where nobody knows which beat is "one"


def test_place_of_one_is_the_best_of_the_other_clips():
    # Clips of two beats: three fit where the second beat is "one", the last where the first is.
    first, second = np.repeat([0.8, -0.8], 10), np.repeat([-0.6, 0.9], 10)
    values = with_one_place(np.array([second, second, second, first]), np.zeros(4, int))
    np.testing.assert_allclose(values[:, 0], [0.9, 0.9, 0.9, -0.8])  # the last has no say in its own
    np.testing.assert_array_equal(values[:, :10], values[:, 10:])


def test_places_are_chosen_by_recording_and_a_clip_alone_has_the_mean():
    first, second = np.repeat([0.8, -0.8], 10), np.repeat([-0.6, 0.9], 10)
    values = with_one_place(np.array([second, first, second, first]), np.array([0, 1, 0, 2]))
    np.testing.assert_allclose(values[:, 0], [0.9, 0.0, 0.9, 0.0], atol=1e-12)


def test_place_is_chosen_at_every_lag_as_at_none(rng: np.random.Generator):
    grid = rng.normal(size=(5, 30))
    values, moved = (with_one_place(rows, np.zeros(5, int)) for rows in (grid, np.roll(grid, -4, axis=1)))
    np.testing.assert_allclose(moved, np.roll(values, -4, axis=1))


# Lags


def test_lag_is_fitted_anew_where_the_music_begins_later():
    peaks = np.zeros((3, 10))
    peaks[[0, 1, 2], [2, 2, 5]] = 1.0
    usable = np.array([[False, True, False], [True, False, False], [False, False, False]])
    np.testing.assert_array_equal(PeakLags(peaks, usable, True).at(np.zeros(3, int)), [2, 2, 0])
    np.testing.assert_array_equal(PeakLags(peaks, usable, True).at(np.array([1, 3, 0])), [9, 1, 0])
    np.testing.assert_array_equal(PeakLags(peaks, usable, False).at(np.array([1, 3, 0])), [2, 2, 0])
