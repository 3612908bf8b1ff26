"""The batch scorer gives the same numbers as scoring clip by clip."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from harmolab.corpora.synthetic import synthetic_clip
from harmolab.harmony import score_harmony, score_motion
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PatternBatch, rescore, rescore_patterns
from harmolab.params import BarPattern, HarmonyParams
from harmolab.types import BeatTrack, Motion, Skeleton

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
    with pytest.raises(ValueError, match="use score_harmony"):
        rescore(batch, replace(HarmonyParams.paper(), matching="nearest"))


def test_an_empty_batch_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one clip"):
        BeatBatch.of([])


# The recommended mode

PATTERNS = {
    "recommended": HarmonyParams.recommended(),
    "sliders moved": replace(HarmonyParams.recommended(), lag=0.03, audio_threshold=1.0, beta=2.0),
    "two beats, places known": replace(
        HarmonyParams.recommended(), pattern=BarPattern(2, (-0.5, -0.5), (0.1, 0.0), "planted")
    ),
}


@pytest.fixture(scope="module")
def dances() -> list[tuple[BeatTrack, Motion]]:
    """Dances of several lengths and tempi, one who stands still, music with one beat and with none."""
    rng = np.random.default_rng(3)
    pairs = []
    for seed, kind in enumerate(["cha-cha", "jive", "waltz", "rumba", "cha-cha", "tango"]):
        clip = synthetic_clip(kind, seconds=4.0 + seed, fps=25.0 + seed, jitter=0.08, seed=seed)
        beats = clip.beats
        assert beats is not None and clip.motion is not None
        places = (np.arange(len(beats)) + seed) % 4
        pairs.append((replace(beats, strengths=rng.uniform(0, 5, len(beats)), bar_places=places), clip.motion))
    still = Motion(np.zeros((100, 1, 3)), 25.0, Skeleton.unnamed(1))
    few = [BeatTrack(times, np.ones(len(times)), 43.0, 5.0, np.arange(len(times))) for times in ([], [2.0])]
    return [*pairs, (pairs[0][0], still), *((track, pairs[1][1]) for track in few)]


def assert_as_score_motion(batch: BatchScores, pairs: list[tuple[BeatTrack, Motion]], params: HarmonyParams) -> None:
    singles = [score_motion(*pair, params=params, n_rotations=0) for pair in pairs]
    for field in fields(BatchScores):
        expected = [getattr(single, field.name) for single in singles]
        np.testing.assert_allclose(getattr(batch, field.name), expected, atol=1e-9, err_msg=field.name)


@pytest.mark.parametrize("name", PATTERNS)
def test_pattern_batch_agrees_with_score_motion(dances: list[tuple[BeatTrack, Motion]], name: str) -> None:
    batch = PatternBatch.of(dances, PATTERNS[name])
    assert_as_score_motion(rescore_patterns(batch, PATTERNS[name]), dances, PATTERNS[name])


@pytest.mark.parametrize("name", PATTERNS)
def test_pattern_batch_of_moved_music_agrees_with_score_motion(
    dances: list[tuple[BeatTrack, Motion]], name: str
) -> None:
    late = np.linspace(0.0, 0.9, len(dances))
    moved = []
    for (track, motion), seconds in zip(dances, late, strict=True):
        times = np.mod(track.times + seconds, track.duration)
        order = np.argsort(times)
        assert track.bar_places is not None
        music = replace(track, times=times[order], strengths=track.strengths[order], bar_places=track.bar_places[order])
        moved.append((music, motion))
    batch = PatternBatch.of(dances, PATTERNS[name]).moved(late)
    assert_as_score_motion(rescore_patterns(batch, PATTERNS[name]), moved, PATTERNS[name])


def test_music_that_comes_home_scores_as_before(dances: list[tuple[BeatTrack, Motion]]) -> None:
    params = HarmonyParams.recommended()
    batch = PatternBatch.of(dances[:3], params)
    # Times of 0.1 to 10 s keep 12 digits on the way round: no rank changes by that.
    home = batch.moved(batch.durations)
    np.testing.assert_allclose(
        rescore_patterns(home, params).harmony_above_chance,
        rescore_patterns(batch, params).harmony_above_chance,
        atol=1e-2,
    )


def test_pattern_of_a_bar_is_refused_where_places_are_unknown(dances: list[tuple[BeatTrack, Motion]]) -> None:
    track, motion = dances[0]
    batch = PatternBatch.of([(replace(track, bar_places=None), motion)], HarmonyParams.recommended())
    with pytest.raises(ValueError, match="bar places of all beats; use score_motion"):
        rescore_patterns(batch, PATTERNS["two beats, places known"])


def test_an_empty_pattern_batch_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one clip"):
        PatternBatch.of([], HarmonyParams.recommended())
