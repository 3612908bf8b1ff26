"""Five levels in words: what each dancer is told, and what nobody may be told."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from harmolab.corpora.synthetic import synthetic_motion
from harmolab.harmony import score_motion
from harmolab.params import DANCE_PATTERNS, BarPattern, HarmonyParams
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, Motion, Skeleton
from harmolab.verdict.judge import Judgement, judge
from harmolab.verdict.score import HarmonyScore

SECONDS, PERIOD = 24.0, 0.5
BEATS = BeatTrack(PERIOD * np.arange(1, 47), np.ones(46), 100.0, SECONDS)
MILLISECONDS = re.compile(r"\d+ ms|late|early")


def dancer(lag: float = 0.0, tempo: float = 120.0, every: float = 1.0) -> Motion:
    """A body that rests `lag` beats after every so many beats."""
    ends = (np.arange(-2, 60) * every + lag) * 60 / tempo
    return synthetic_motion(ends[(ends >= 0) & (ends < SECONDS + 1)], seconds=SECONDS, fps=30.0, seed=4)


def judged(motion: Motion, beats: BeatTrack = BEATS, pattern: BarPattern | None = None) -> Judgement:
    return judge(shape_speed(motion), beats, pattern=pattern)


def statue(size: float) -> Motion:
    """A pose that trembles by so many metres, twice a beat."""
    pose = dancer().positions[:1]
    wave = np.cos(2 * np.pi * np.arange(720) / 30 / PERIOD)[:, None, None]
    return replace(dancer(), positions=pose + size * wave * np.random.default_rng(0).normal(size=pose.shape))


def test_resting_on_the_beat_is_level_four() -> None:
    judgement = judged(dancer())
    assert judgement.level == 4
    assert judgement.verdict.startswith("You are on the beat: you rest on it (")
    assert judgement.harmony_above_chance > 0.4
    assert judgement.p_value == max(judgement.p_time, judgement.p_place)


def test_hitting_the_beat_is_level_four_and_no_286_ms_early() -> None:
    judgement = judged(dancer(0.5))
    assert (judgement.level, judgement.reading) == (4, "hit")
    assert "you hit it" in judgement.verdict
    assert any("cannot tell which" in remark for remark in judgement.remarks)


def test_a_quarter_beat_late_is_told_of_rest_or_hit() -> None:
    judgement = judged(dancer(0.25))
    assert judgement.level == 3
    pattern = r"You keep time, steadily \d+ ms (late|early) for a rest or a hit on the beat\."
    assert re.fullmatch(pattern, judgement.verdict)
    assert abs(judgement.lag_s) == pytest.approx(0.125, abs=0.02)


@pytest.mark.parametrize(("tempo", "told"), [(121.9, "121.9"), (128.4, "128.4"), (95.0, "95.0")])
def test_another_tempo_is_level_one_and_is_told(tempo: float, told: str) -> None:
    judgement = judged(dancer(tempo=tempo))
    assert judgement.level == 1
    own = re.fullmatch(
        r"No sign that you follow this beat\. Your own tempo is ([\d.]+) bpm, the music's 120\.0\.", judgement.verdict
    )
    assert own and float(own[1]) == pytest.approx(float(told), abs=0.3)


def test_half_and_double_time_are_on_the_beat_and_named() -> None:
    for every, words in ((2.0, "half time"), (0.5, "double time")):
        judgement = judged(dancer(every=every))
        assert judgement.level == 4
        assert any(words in remark for remark in judgement.remarks)


@pytest.mark.parametrize("size", [1e-3, 1e-9])
def test_a_tremor_is_too_little(size: float) -> None:
    judgement = judged(statue(size))
    assert judgement.level == 0
    assert judgement.verdict == "Cannot tell: too little movement inside the body."
    assert np.isnan(judgement.harmony_above_chance)


def test_a_statue_on_a_turntable_only_turns_and_travels() -> None:
    pose, angle = dancer().positions[0], np.cumsum(1 - np.cos(2 * np.pi * np.arange(720) / 15)) / 20
    x, y, z = pose.T
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned = np.stack([cos * x + sin * z, y + 0 * cos, cos * z - sin * x], axis=-1)
    judgement = judged(replace(dancer(), positions=turned))
    assert (judgement.level, judgement.verdict) == (0, "Cannot tell: you only turn and travel.")


def test_fifteen_beats_are_too_few() -> None:
    judgement = judged(dancer(), BEATS.select(np.arange(46) < 15))
    assert judgement.verdict == "Cannot tell: 15 beats are too few; 16 are needed."
    assert judged(dancer(), BEATS.select(np.arange(46) < 16)).level > 0
    assert judged(dancer(), BEATS.select(np.arange(46) < 1)).level == 0


def test_a_wandering_dancer_keeps_the_tempo_but_no_place() -> None:
    wander = np.array([0.0, 0.8])[np.arange(30) // 8 % 2]  # beats, for a dancer who rests on every second one
    wandering = synthetic_motion(PERIOD * (2 * np.arange(30) + wander), seconds=SECONDS, fps=30.0, seed=4)
    bars = replace(BEATS, bar_places=np.arange(1, 47) % 2)
    judgement = judged(wandering, bars, BarPattern(2, (-1.0,), (0.0,)))
    assert judgement.level == 2
    assert judgement.verdict == "You keep its tempo, but no steady place."


def test_a_dance_is_named_where_its_pattern_is_asked_for() -> None:
    rest = replace(BarPattern.stop_on_the_beat(), dance="waltz")
    assert "you move as in a waltz" in judged(dancer(), pattern=rest).verdict
    late = judged(dancer(0.3), pattern=rest)
    assert re.fullmatch(r"You keep time, steadily \d+ ms late for a waltz\.", late.verdict)


def test_no_level_below_three_says_late_early_or_milliseconds() -> None:
    shorter = BEATS.select(np.arange(46) < 15)
    for judgement in (judged(dancer(tempo=128.4)), judged(statue(1e-3)), judged(dancer(), shorter)):
        assert judgement.level < 3
        assert not any(MILLISECONDS.search(text) for text in (judgement.verdict, *judgement.remarks))


def test_what_would_show_more_is_said() -> None:
    unplaced = judged(dancer(0.3), pattern=DANCE_PATTERNS["waltz"])
    assert any("--one" in remark for remark in unplaced.remarks)
    assert any("--dance" in remark for remark in judged(dancer(0.25)).remarks)


def test_a_picture_and_two_points_say_so() -> None:
    flat = judged(Motion(dancer().positions[..., :2], 30.0, dancer().skeleton))
    assert any("picture" in remark for remark in flat.remarks)
    hands = judged(Motion(dancer().positions[:, [10, 13]], 30.0, Skeleton.unnamed(2)))
    assert any("no shape" in remark for remark in hands.remarks)


def scored(motion: Motion, **settings: object) -> HarmonyScore:
    return score_motion(BEATS, motion, params=replace(HarmonyParams.recommended(), **settings))


def test_the_score_keeps_the_judgement_and_its_number() -> None:
    score = scored(dancer())
    assert score.judgement is not None
    assert score.harmony_above_chance == score.judgement.harmony_above_chance
    assert score.p_value == score.judgement.p_value
    content = score.to_dict()
    assert {"level", "verdict", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "pulse", "share"} <= content.keys()


def test_a_lag_that_is_expected_is_no_lag() -> None:
    score = scored(dancer(0.25), lag=0.125)
    assert score.judgement is not None and score.judgement.level == 4


def test_a_statue_gets_no_number() -> None:
    content = scored(statue(1e-3)).to_dict()
    assert content["harmony_above_chance"] is None
    assert content["level"] == 0


def test_standing_still_behind_the_last_beat_changes_nothing() -> None:
    motion = dancer()
    longer = replace(
        motion, positions=np.concatenate([motion.positions, motion.positions[-1:].repeat(900, axis=0)]), valid=None
    )
    assert judged(longer).harmony_above_chance == pytest.approx(judged(motion).harmony_above_chance, abs=1e-9)


def test_one_beat_is_too_few_in_good_grammar() -> None:
    judgement = judged(dancer(), BEATS.select(BEATS.times < 0.6))
    assert judgement.verdict == "Cannot tell: 1 beat is too few; 16 are needed."


def test_beats_at_which_the_body_is_not_seen_do_not_count() -> None:
    motion = dancer()
    seen = np.abs(np.arange(motion.n_frames) / motion.fps - SECONDS / 2) > 8.9
    judgement = judged(replace(motion, valid=seen))
    assert judgement.level == 0
    assert judgement.verdict == "Cannot tell: 11 beats are too few; 16 are needed."


@pytest.mark.parametrize("dance", ["cha-cha", "waltz"])
def test_who_keeps_the_beat_but_no_bar_is_told_so(dance: str) -> None:
    pattern = DANCE_PATTERNS[dance]
    told = replace(BEATS, bar_places=np.arange(len(BEATS)) % pattern.beats)
    judgement = judged(dancer(0.1), told, pattern)
    assert judgement.level == 2
    assert "Your place in the beat is steady; the beat of the bar that it belongs to is not." in judgement.remarks


def test_a_lag_that_lies_anywhere_between_rest_and_hit_is_not_called_steady() -> None:
    steady = judged(dancer(0.25))
    anywhere = replace(steady, lag_interval=(-0.24, 0.23))
    assert "steadily" in steady.verdict
    assert not any("anywhere" in remark for remark in steady.remarks)
    assert "steadily" not in anywhere.verdict
    assert any("anywhere between rest and hit" in remark for remark in anywhere.remarks)
