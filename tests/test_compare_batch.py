"""The batch scorer gives the same numbers as scoring clip by clip."""

from dataclasses import fields, replace

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PlaceBatch, rescore, rescore_places
from harmolab.params import HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import score_harmony
from harmolab.types import BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import refused

SETTINGS = {
    "paper": HarmonyParams.paper(),
    "valleys": HarmonyParams.valleys(),
    "sliders moved": replace(
        HarmonyParams.paper(), lag=0.03, reaction_delay=0.1, visual_threshold=0.5, audio_threshold=1.0, beta=0.7
    ),
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
    early = BeatTrack([0.0], [1.0], 15.0, 6.0)
    scores = rescore(BeatBatch.of([(music, early), (music, early)]), HarmonyParams.valleys())
    np.testing.assert_array_equal(scores.hitting_score, [0.0, 0.0])


def test_other_readings_are_refused_by_name() -> None:
    batch = BeatBatch.of([(BeatTrack([1.0], [1.0], 15.0, 6.0),) * 2])
    refused("use score_harmony", rescore, batch, replace(HarmonyParams.paper(), matching="nearest"))


def test_an_empty_batch_is_refused() -> None:
    refused("at least one clip", BeatBatch.of, [])


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
    clips = [
        synthetic_clip(kind, seconds=18.0, fps=25.0 + seed, jitter=0.05, seed=seed) for seed, kind in enumerate(kinds)
    ]
    track, motion = placed(clips[0], 0)
    late = track.times + 30 / track.tempo
    return [*map(placed, clips, range(4)), (replace(track, times=late, duration=late[-1] + 1), motion)]


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
    scores = rescore_places(
        PlaceBatch.of([(music, motion), (music, still), *((one, motion) for one in few)], params), params
    )
    assert len(music) < 16
    assert scores.harmony_above_chance[0] > 0.3
    np.testing.assert_array_equal(scores.harmony_above_chance[1:], [0.0, 0.0, 0.0, 0.0])


def test_an_empty_place_batch_is_refused() -> None:
    refused("at least one clip", PlaceBatch.of, [], HarmonyParams.recommended())
