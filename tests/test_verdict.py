"""Timing in words: each sentence against what was planted, and silence where there is nothing to say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.corpora.synthetic import synthetic_motion
from harmolab.harmony import score_harmony
from harmolab.lab.timing.findings import beat_timing
from harmolab.lab.timing.verdict import Explanation, explain, explain_timing
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Clip, Motion
from tests.builders import planted_dance

RECOMMENDED = HarmonyParams.recommended()
LENGTH = 30.0
BEATS = np.arange(1, 60) * 0.5
SECONDS = 24.0


def track(times: np.ndarray) -> BeatTrack:
    kept = times[(times >= 0) & (times <= LENGTH)]
    return BeatTrack(kept, np.ones(kept.size), 100.0, LENGTH)


MUSIC = track(BEATS)


def timing_of(music: BeatTrack, visual: BeatTrack, params: HarmonyParams | None = None) -> Explanation:
    """The findings about every hit of two beat tracks."""
    hits = replace(params or HarmonyParams.valleys(), measure="hits")
    return explain_timing(score_harmony(music, visual, params=hits, n_rotations=0))


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=SECONDS, seed=5)


def danced(beats: np.ndarray) -> BeatTrack:
    """Visual beats of a dancer whose movements end on `beats`."""
    motion: Motion = synthetic_motion(beats, seconds=SECONDS, fps=60, seed=5, dance="cha-cha")
    return visual_beats(motion, params=RECOMMENDED)


def test_dancer_80_ms_late_in_the_second_half_is_told_so(clip: Clip):
    beats = clip.beats.times
    told = timing_of(clip.beats, danced(beats + 0.08 * (beats >= SECONDS / 2)), params=RECOMMENDED)
    finding = told.findings[-1]
    assert finding.kind == "change"
    assert finding.value == pytest.approx(0.08, abs=0.01)
    assert finding.interval[0] > 0
    assert "late on the second half and on time on the first" in finding.sentence
    assert [round(half.mean, 2) for half in told.halves] == [0.0, 0.08]


def test_dancer_on_time_is_told_so(clip: Clip):
    finding = timing_of(clip.beats, danced(clip.beats.times), params=RECOMMENDED).findings[-1]
    assert finding.kind == "mean"
    assert finding.sentence.startswith("You are on time")
    assert abs(finding.value) < 0.01


@pytest.mark.parametrize(("shift", "words"), [(0.08, "ms late throughout"), (-0.08, "ms early throughout")])
def test_constant_shift_is_told_with_its_side(clip: Clip, shift: float, words: str):
    finding = timing_of(clip.beats, danced(clip.beats.times + shift), params=RECOMMENDED).findings[-1]
    assert words in finding.sentence
    assert finding.value == pytest.approx(shift, abs=0.01)
    assert finding.interval[0] <= finding.value <= finding.interval[1]


@pytest.mark.parametrize(("clock", "words"), [(1.003, "0.3 % fast"), (0.99, "1.0 % slow"), (1.01, "1.0 % fast")])
def test_clock_that_runs_wrong_is_told_as_a_drift(clip: Clip, clock: float, words: str):
    finding = timing_of(clip.beats, danced(clip.beats.times * clock), params=RECOMMENDED).findings[-1]
    assert finding.kind == "drift"
    assert words in finding.sentence
    assert finding.value == pytest.approx(clock - 1, abs=0.001)


def test_drift_is_followed_beyond_half_a_beat():
    finding = timing_of(MUSIC, track(BEATS * 1.02)).findings[-1]
    assert finding.value == pytest.approx(0.02, abs=0.001)


def test_step_is_no_drift_and_a_line_no_step():
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 0.01, BEATS.size)
    step = timing_of(MUSIC, track(BEATS + 0.1 * (BEATS > 15) + noise))
    line = timing_of(MUSIC, track(BEATS + 0.004 * BEATS + noise))
    assert (step.findings[-1].kind, line.findings[-1].kind) == ("change", "drift")


def test_random_movements_are_given_no_timing():
    kinds = []
    for seed in range(40):
        times = np.sort(np.random.default_rng(seed).uniform(0, LENGTH, 60))
        told = timing_of(MUSIC, track(times))
        kinds.append(told.findings[-1].kind)
        assert told.halves == () or kinds[-1] != "locked"
    assert kinds.count("locked") >= 38


def test_random_movements_meet_no_more_than_chance():
    times = np.sort(np.random.default_rng(1).uniform(0, LENGTH, 60))
    told = timing_of(MUSIC, track(times))
    assert "no evidence of more or less than chance" in told.sentences[0]
    assert "nothing can be said about early or late" in told.sentences[-1]


def test_steady_dancer_is_seldom_told_a_lateness_that_is_not_there():
    rng = np.random.default_rng(2)
    told = [timing_of(MUSIC, track(BEATS + rng.normal(0, 0.03, BEATS.size))) for _ in range(100)]
    assert sum(one.sentences[-1].startswith("You are on time") for one in told) >= 95


def test_hits_and_chance_are_worked_out_by_hand():
    # 59 beats each half a second; a beat is reached within 0.1 s for 0.2 of each 0.5 s: 59 * 0.2 / 30.
    finding = timing_of(MUSIC, MUSIC).findings[0]
    assert finding.sentence.startswith("Chance alone would meet 39 % of the beats within 100 ms; you met 100 %")
    assert finding.value == 1.0
    assert finding.interval[0] > 0.9


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (BEATS, "one movement a beat"),
        (np.arange(2, 120) * 0.25, "two movements a beat"),
        (BEATS[::2], "one movement every two beats"),
        (np.arange(1, 80) * 0.37, "1.4 movements a beat"),
    ],
)
def test_movements_a_beat_are_counted(times: np.ndarray, words: str):
    assert words in timing_of(MUSIC, track(times)).sentences[1]


def test_two_movements_a_beat_can_be_late_too():
    timing = beat_timing(MUSIC, track(np.arange(2, 118) * 0.25 + 0.05))
    assert timing.grid == 2
    np.testing.assert_allclose(timing.offsets, 0.05, atol=1e-6)


def test_place_of_the_first_beat_in_its_bar_changes_nothing():
    music = BeatTrack(MUSIC.times, MUSIC.strengths, 100.0, LENGTH, (np.arange(len(MUSIC)) + 3) % 4)
    visual = track(BEATS + 0.05)
    np.testing.assert_allclose(beat_timing(music, visual).offsets, beat_timing(MUSIC, visual).offsets, atol=1e-9)


def test_expected_lag_is_no_lateness():
    late = HarmonyParams(**{**vars(HarmonyParams.valleys()), "lag": 0.08})
    assert timing_of(MUSIC, track(BEATS + 0.08), params=late).sentences[-1].startswith("You are on time")


@pytest.mark.parametrize("count", [0, 1, 5])
def test_too_few_beats_say_nothing(count: int):
    for music, visual in ((MUSIC, track(BEATS[:count])), (track(BEATS[:count]), MUSIC)):
        told = timing_of(music, visual)
        assert len(told.findings) == 1
        assert "too few to say anything" in str(told)


def test_score_comes_first_and_names_its_interval():
    params = HarmonyParams.valleys()
    score = score_harmony(MUSIC, MUSIC, params=params, n_rotations=100)
    told = explain(score)
    assert told.sentences[0].startswith(
        "Above-chance harmony is 1.00 (0 is chance, 1 is all; 95 % interval 1.00 to 1.00)"
    )
    assert told.findings[0].interval == score.interval


def test_score_without_an_interval_says_so():
    score = score_harmony(MUSIC, MUSIC, params=HarmonyParams.valleys(), n_rotations=0)
    assert "no interval" in explain(score).sentences[0]


def test_score_whose_interval_holds_zero_is_no_evidence():
    visual = track(np.sort(np.random.default_rng(1).uniform(0, LENGTH, 60)))
    score = score_harmony(MUSIC, visual, params=HarmonyParams.valleys(), n_rotations=200)
    assert "no evidence that you move with this music" in explain(score).sentences[0]
