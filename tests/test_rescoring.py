"""The batch scorer gives the same numbers as scoring clip by clip."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from harmolab.harmony import score_harmony
from harmolab.params import HarmonyParams
from harmolab.rescoring import BatchScores, BeatBatch, rescore
from harmolab.types import BeatTrack

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
    for field in fields(BatchScores):
        single = [getattr(score_harmony(*pair, params=SETTINGS[name], n_rotations=0), field.name) for pair in pairs]
        np.testing.assert_allclose(getattr(batch, field.name), single, atol=1e-9, err_msg=field.name)


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
