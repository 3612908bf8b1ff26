"""Findings in words: each sentence against what was planted, and silence where there is nothing to say."""

import re
from dataclasses import replace

import numpy as np
import pytest

from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.explain.performance import Explanation, explain
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.types import BeatTrack, Clip
from harmolab.verdict.judge import score_motion
from tests.builders import planted_dance, refused, still

SECONDS = 24.0
TIMING = re.compile(r"\b(ms|early|late|later|earlier)\b")


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=SECONDS, seed=5)


@pytest.fixture(scope="module")
def music(clip: Clip) -> BeatTrack:
    assert clip.beats is not None
    return clip.beats


def score_of(music: BeatTrack, ends: np.ndarray) -> HarmonyScore:
    """The score of a dancer whose movements end at these times."""
    motion = synthetic_motion(np.sort(ends), seconds=SECONDS, fps=60, seed=5, dance="cha-cha")
    return score_motion(music, motion, params=HarmonyParams.recommended(HOW_PATTERNS["rest"]))


def value_of(words: Explanation, kind: str) -> float:
    return next(finding.value for finding in words.findings if finding.kind == kind)


def test_dancer_who_falls_80_ms_behind_in_the_second_half_hears_of_it(music: BeatTrack):
    words = explain(score_of(music, music.times + 0.08 * (music.times >= SECONDS / 2)))
    change = next(finding for finding in words.findings if finding.kind == "change")
    assert change.value == pytest.approx(0.08, abs=0.015)
    assert change.interval[0] > 0
    assert re.fullmatch(r"In the second half you are \d\d ms later than in the first\.", change.sentence)
    assert [half.mean for half in words.halves] == pytest.approx([0.0, 0.08], abs=0.015)


@pytest.mark.parametrize("shift", [0.0, 0.08, -0.08])
def test_a_constant_lag_is_that_of_the_judgement_and_no_change(music: BeatTrack, shift: float):
    score = score_of(music, music.times + shift)
    words = explain(score)
    assert value_of(words, "lag") == score.judgement.lag_s
    assert value_of(words, "lag") == pytest.approx(shift, abs=0.02)
    assert "change" not in [finding.kind for finding in words.findings]
    assert [half.mean for half in words.halves] == pytest.approx([shift, shift], abs=0.02)


def test_steady_dancer_is_seldom_told_a_change_that_is_not_there(music: BeatTrack):
    rng = np.random.default_rng(2)
    words = [explain(score_of(music, music.times + rng.normal(0, 0.03, len(music)))) for _ in range(12)]
    assert sum("change" in [finding.kind for finding in one.findings] for one in words) <= 1


def test_a_dancer_a_quarter_beat_late_is_not_said_to_have_jumped(music: BeatTrack):
    rng = np.random.default_rng(0)
    words = explain(score_of(music, music.times + 15 / music.tempo + rng.normal(0, 0.005, len(music))))
    assert "change" not in [finding.kind for finding in words.findings]


@pytest.mark.parametrize("seed", range(4))
def test_movement_out_of_time_is_given_no_milliseconds_and_no_side(music: BeatTrack, seed: int):
    score = score_of(music, np.random.default_rng(seed).uniform(0, SECONDS, len(music)))
    words = explain(score)
    assert score.judgement.level < 3
    assert [finding.kind for finding in words.findings][:2] == ["score", "tempo"]
    assert TIMING.search(" ".join([score.judgement.verdict, *words.sentences])) is None
    assert words.halves == ()


def test_too_little_to_judge_has_no_findings(music: BeatTrack, clip: Clip):
    assert explain(score_motion(music, still(1440, fps=60.0))) == Explanation()
    assert explain(score_motion(music.span(0.0, 5.0), clip.motion.span(0.0, 5.0))) == Explanation()


def test_beats_met_are_the_pairs_of_the_score(music: BeatTrack):
    ends = music.times.copy()
    ends[10] += 0.18  # one rest too far away
    score = score_of(music, ends)
    met = int((score.pairs >= 0).sum())
    finding = explain(score).findings[-1]
    assert finding.kind == "hits"
    assert finding.sentence.startswith(f"{met} of {len(music)} beats have a rest within 100 ms")
    assert finding.value == met / len(music) < 1


def test_a_dancer_steadily_late_hears_no_count_of_beats_missed(music: BeatTrack):
    score = score_of(music, music.times + 0.1)
    assert score.judgement.level == 3
    assert "hits" not in [finding.kind for finding in explain(score).findings]


def test_rate_and_number_are_those_of_the_judgement(music: BeatTrack):
    score = score_of(music, music.times)
    words = explain(score)
    assert value_of(words, "rate") == score.judgement.time.rate == 1.0
    assert value_of(words, "score") == score.harmony_above_chance
    assert f"Harmony above chance is {score.harmony_above_chance:.2f} (" in words.sentences[0]
    assert "from bar to bar" in words.sentences[0]
    assert "95 %" not in str(words)


def test_an_expected_lag_is_no_lateness(music: BeatTrack, clip: Clip):
    late = synthetic_motion(music.times + 0.08, seconds=SECONDS, fps=60, seed=5, dance="cha-cha")
    score = score_motion(music, late, params=replace(HarmonyParams.recommended(HOW_PATTERNS["rest"]), lag=0.08))
    assert value_of(explain(score), "lag") == pytest.approx(0.0, abs=0.02)


def test_findings_of_an_unplaced_dance_leave_its_place_out(music: BeatTrack):
    words = explain(score_of(music, music.times + 0.08 * (music.times >= SECONDS / 2))).relative()
    assert [finding.kind for finding in words.findings] == ["tempo", "rate", "change"]
    assert words.halves == ()


def test_a_score_without_a_judgement_is_refused(music: BeatTrack, clip: Clip):
    score = score_motion(music, clip.motion, params=HarmonyParams.valleys())
    refused("words need a score of measure 'shape', got 'hits'", explain, score)
