"""Five levels in words: what each dancer is told, and what nobody may be told."""

import re
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.shape_speed import ShapeSignal, ShapeSpeed, shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.evidence import PlaceTest, TimeTest, floor
from harmolab.verdict.judge import Judgement, judge, level_of, score_motion
from tests.builders import cases

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
    assert re.fullmatch(r"You are on the beat: slow on it, fastest \d+ ms after it\.", judgement.verdict)
    assert judgement.harmony_above_chance > 0.4
    assert judgement.p_value == max(judgement.p_time, judgement.p_place)


def test_a_hit_is_named_and_not_accepted_in_silence() -> None:
    judgement = judged(dancer(0.5))
    assert judgement.level == 3
    assert judgement.verdict == (
        "In time: you are fastest on the beat (a hit). If you meant to rest on it, you are half a beat late."
    )
    assert np.isnan(judgement.harmony_above_chance) and np.isnan(judgement.p_value)
    assert any("--how hit" in remark for remark in judgement.remarks)


def test_a_hit_that_was_told_is_on_the_beat_and_a_rest_then_half_a_beat_away() -> None:
    told = judged(dancer(0.5), pattern=HOW_PATTERNS["hit"])
    assert (told.level, told.reading) == (4, "hit")
    assert "you hit it" in told.verdict
    rest = judged(dancer(), pattern=HOW_PATTERNS["hit"])
    assert rest.level == 3 and rest.verdict.endswith("for a hit on the beat.")
    assert rest.harmony_above_chance < -0.4


def test_a_quarter_beat_late_is_told_what_is_seen_and_not_how_late() -> None:
    judgement = judged(dancer(0.25))
    assert judgement.level == 3
    seen = re.fullmatch(
        r"In time: you are fastest (\d+) ms after the beat, and stillest (\d+) ms after it\.", judgement.verdict
    )
    assert seen and float(seen[1]) == pytest.approx(375, abs=40) and float(seen[2]) == pytest.approx(125, abs=40)
    told = judged(dancer(0.25), pattern=HOW_PATTERNS["rest"])
    assert re.fullmatch(r"You keep time, steadily \d+ ms late for a rest on the beat\.", told.verdict)
    assert told.lag_s == pytest.approx(0.125, abs=0.02)


@pytest.mark.parametrize("tempo", [90.0, 120.0, 150.0])
@pytest.mark.parametrize("seconds", [0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5])
def test_who_arrives_on_the_beat_is_in_time_and_neither_early_nor_late(tempo: float, seconds: float) -> None:
    beats = np.arange(1, SECONDS * tempo / 60 - 1) * 60 / tempo
    judgement = judged(arriving(beats, seconds), BeatTrack(beats, np.ones(beats.size), 100.0, SECONDS))
    assert judgement.level >= 3
    assert not judgement.harmony_above_chance < -0.2
    words = " ".join([judgement.verdict, *judgement.remarks, *judgement.details])
    assert "late" not in words and "early" not in words
    assert f"p = {judgement.p_time:.3f}" in words


def arriving(ends: np.ndarray, seconds: float) -> Motion:
    """Arms that go up and down by turns, in `seconds` each, arrive at these times and stand."""
    times = np.arange(round(SECONDS * 60)) / 60
    way = np.clip((times[:, None] - ends + seconds) / seconds, 0, 1)
    eased = way**3 * (10 - 15 * way + 6 * way**2)
    height = eased @ np.where(np.arange(ends.size) % 2 == 0, 1.0, -1.0)
    return raising(height)


def raising(height: np.ndarray) -> Motion:
    """A body whose arms stand at a height from 0 to 1, 60 frames a second."""
    body = np.array([[0.0, 1.0, 0.0], [0.0, 1.6, 0.0], [0.2, 1.4, 0.0], [-0.2, 1.4, 0.0], [0.1, 0.0, 0.1]])
    hands = np.array([[0.7, 1.0, 0.2], [-0.7, 1.0, 0.2]]) + 0.6 * height[:, None, None] * np.array([-0.3, 1.0, 0.2])
    positions = np.concatenate([np.broadcast_to(body, (height.size, 5, 3)), hands], axis=1)
    return Motion(positions, 60.0, Skeleton.unnamed(7))


@pytest.mark.parametrize(("tempo", "told"), [(121.9, "121.9"), (128.4, "128.4"), (95.0, "95.0")])
def test_another_tempo_is_level_one_and_is_told(tempo: float, told: str) -> None:
    judgement = judged(dancer(tempo=tempo))
    assert judgement.level == 1
    own = re.fullmatch(
        r"No sign that you follow this beat\. Your own tempo is ([\d.]+) bpm, the music's 120\.0\.", judgement.verdict
    )
    assert own and float(own[1]) == pytest.approx(float(told), abs=0.3)


@cases("rate, words", (2.0, "twice a beat (double time"), (4 / 3, "4 times in 3 beats"), (1.5, "3 times in 2 beats"))
@pytest.mark.parametrize("phase", [0.0, 0.3, 0.6, 0.9])
def test_who_moves_at_another_rate_is_told_so_and_never_on_the_beat(rate: float, words: str, phase: float) -> None:
    times = np.arange(round(SECONDS * 60)) / 60
    judgement = judged(raising(0.5 - 0.5 * np.cos(np.pi * (times / PERIOD * rate + phase))))
    assert judgement.level in (1, 2, 3) and "on the beat" not in judgement.verdict
    assert words in judgement.verdict or f"Your own tempo is {120 * rate:.1f} bpm" in judgement.verdict


def test_half_time_is_named_beside_the_beat() -> None:
    judgement = judged(dancer(every=2.0))
    assert any("half time" in text for text in (judgement.verdict, *judgement.remarks))
    told = judged(dancer(every=2.0), pattern=HOW_PATTERNS["half time"])
    assert told.level == 4 and "you rest on every second one" in told.verdict


def test_a_waltz_is_seen_by_its_threes_without_being_told() -> None:
    times = np.arange(round(SECONDS * 100)) / 100
    speed = 1 + 0.5 * waltz_speed(times / PERIOD) + 0.1 * np.random.default_rng(0).normal(size=times.size)
    energy, size = np.square(speed)[:, None] * np.ones(5), np.ones(times.size)
    judgement = judge(ShapeSpeed(100.0, speed, energy, energy.mean(axis=1), size, size > 0, 3), BEATS)
    assert (judgement.level, judgement.reading) == (4, "waltz")
    assert judgement.verdict == "You are on the beat: you move in threes, as in a waltz."


def waltz_speed(beats: np.ndarray) -> np.ndarray:
    """The course of the waltz's pattern."""
    waves, angle = DANCE_PATTERNS["waltz"], 2 * np.pi * beats[:, None] * np.arange(1, 4) / 3
    return np.cos(angle) @ np.array(waves.cosines) + np.sin(angle) @ np.array(waves.sines)


@pytest.mark.parametrize("size", [1e-3, 1e-9])
def test_a_tremor_is_too_little(size: float) -> None:
    judgement = judged(statue(size))
    assert (judgement.level, judgement.verdict) == (0, "Cannot tell: too little movement inside the body.")
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
    judgement = judged(wandering, replace(BEATS, bar_places=np.arange(1, 47) % 2), BarPattern(2, (-1.0,), (0.0,)))
    assert (judgement.level, judgement.verdict) == (2, "You keep its tempo, but no steady place in the beat.")


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
    assert any("--one" in remark for remark in judged(dancer(0.3), pattern=DANCE_PATTERNS["waltz"]).remarks)
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
    assert (judgement.level, judgement.verdict) == (0, "Cannot tell: 11 beats are too few; 16 are needed.")


@pytest.mark.parametrize("dance", ["cha-cha", "waltz"])
def test_who_keeps_the_beat_but_no_bar_is_told_so(dance: str) -> None:
    pattern = DANCE_PATTERNS[dance]
    told = replace(BEATS, bar_places=np.arange(len(BEATS)) % pattern.beats)
    judgement = judged(dancer(0.1), told, pattern)
    assert judgement.level == 2
    assert "Your place in the beat is steady; the beat of the bar that it belongs to is not." in judgement.remarks


# Thresholds, a case on either side of each


def evidence(
    *,
    p: float = 0.02,
    lag: float = 0.0,
    wander: float = 0.1,
    lowest: float = 0.1,
    above: float = 0.5,
    beside: int = 6,
    power: float = 1.0,
) -> Judgement:
    """A judgement on hand-made evidence: p in time, lag and its spread in beats, H and its lower end, lags as good."""
    curve = np.full(48, 0.4)
    curve[1 : 1 + beside] = curve[0] = 0.5 + above / 2
    time = TimeTest(np.zeros(241), np.zeros(241), p, {Fraction(1): power, Fraction(2): 1.0}, {1: 9.0, 2: 8.0})
    place = HandMade(HOW_PATTERNS["rest"], curve[None, None, :], 0, 0.5, lag)
    level = level_of(time, place, (lowest, 0.8), (lag - wander / 2, lag + wander / 2))
    return Judgement(level, BEATS, None, None, time, place)


@dataclass(frozen=True, eq=False)
class HandMade(PlaceTest):
    """A place test whose lag is given."""

    given: float = 0.0

    @property
    def lag(self) -> float:
        return self.given


@cases(
    "inside, outside, level",
    ({"p": 0.05}, {"p": 0.0501}, 1),
    ({"wander": 0.5}, {"wander": 0.501}, 2),
    ({"lag": 0.125}, {"lag": 0.13}, 3),
    ({"lag": -0.125}, {"lag": -0.13}, 3),
    ({"lowest": 0.001}, {"lowest": 0.0}, 3),
    ({"beside": 11}, {"beside": 12}, 3),
    ({"power": 0.0101}, {"power": 0.0099}, 3),
)
def test_each_threshold_parts_level_four_from_a_lower_one(
    inside: dict[str, float], outside: dict[str, float], level: int
) -> None:
    assert evidence(**inside).level == 4
    assert evidence(**outside).level == level


def test_harmony_at_chance_is_not_on_the_beat() -> None:
    assert evidence(above=0.01, beside=3).level == 4
    assert evidence(above=0.0, beside=3).level == 3


def part(**changes: float) -> ShapeSignal:
    """A signal far above the floor but for what is changed."""
    moving = ShapeSignal(np.arange(9.0), np.zeros(9), np.ones(9, bool), 0.4, 0.6, 0.6, 3, 3, 0.3)
    return replace(moving, **changes)


def test_the_floor_lies_at_its_pulse_its_share_and_its_swing() -> None:
    assert floor(part(pulse=0.0301)) == "" and floor(part(pulse=0.0299)) == "too little movement inside the body"
    assert floor(part(share=0.101)) == "" and floor(part(share=0.099)) == "you only turn and travel"
    assert floor(part(share=0.01, dimensions=2)) == ""
    point = {"dimensions": 0, "pulse": np.nan}
    assert floor(part(**point, swing=0.0201)) == ""
    assert floor(part(**point, swing=0.0199)) == "too little movement inside the body"
    assert floor(part(**point, swing=1e-9, axes=2)) == ""


def test_an_own_tempo_is_told_from_eight_deviations_on() -> None:
    clear = evidence(p=0.5)
    assert clear.time is not None
    for best, is_told in ((8.0, True), (7.9, False)):
        z = np.where(np.arange(241) == 130, best, 0.0)
        judgement = replace(clear, level=1, time=replace(clear.time, z=z, power=z))
        assert ("Your own tempo" in judgement.verdict) is is_told


def test_sixteen_beats_are_judged_and_fewer_than_48_are_said_to_be_few() -> None:
    times = 0.4 * np.arange(1, 58)
    short, enough = (
        judged(dancer(tempo=97.0), BeatTrack(times[:count], np.ones(count), 100.0, SECONDS)) for count in (47, 48)
    )
    assert any("A longer take" in text for text in (*short.remarks, *short.details))
    assert not any("A longer take" in text for text in (*enough.remarks, *enough.details))


def test_a_trembling_point_is_too_little_and_one_that_swings_is_not() -> None:
    swing = np.sin(2 * np.pi * np.arange(round(SECONDS * 60)) / 60 / PERIOD)[:, None, None]
    for size, level in ((1e-9, 0), (1e-3, 0), (0.1, 3)):
        motion = Motion(size * swing * np.ones((1, 1, 3)), 60.0, Skeleton.unnamed(1))
        assert (judged(motion).level >= level) if level else judged(motion).level == 0
    flat = judged(Motion(1e-9 * swing * np.ones((1, 1, 2)), 60.0, Skeleton.unnamed(1)))
    assert any("how large the movement is cannot be known" in text for text in (*flat.remarks, *flat.details))


def test_left_and_right_swapped_for_single_frames_is_no_dance() -> None:
    standing = raising(np.zeros(round(SECONDS * 60))).positions + np.random.default_rng(0).normal(
        0, 0.002, (1440, 7, 3)
    )
    swapped = standing.copy()
    frames = np.round(BEATS.times * 60).astype(int)
    swapped[frames] = swapped[frames][:, [0, 1, 3, 2, 4, 6, 5]]
    judgement = judged(Motion(swapped, 60.0, Skeleton.unnamed(7)))
    assert (judgement.level, judgement.verdict) == (0, "Cannot tell: too little movement inside the body.")


def test_p_beside_on_the_beat_is_one_that_the_level_asks_for() -> None:
    rng = np.random.default_rng(5)
    judged_4 = 0
    for _ in range(60):
        lag, jitter, every = rng.uniform(-0.3, 0.3), rng.uniform(0, 0.15), rng.choice([0.5, 0.75, 1.0, 2.0])
        ends = np.sort((np.arange(-2, 60) * every + lag + jitter * rng.normal(size=62)) * PERIOD)
        judgement = judged(synthetic_motion(ends[(ends >= 0) & (ends < SECONDS)], seconds=SECONDS, fps=30.0, seed=4))
        if judgement.level == 4:
            judged_4 += 1
            assert judgement.p_time <= 0.05 and judgement.p_place <= 0.25
            assert float(re.findall(r"p = ([\d.]+);", " ".join(judgement.remarks))[0]) <= 0.05
            assert judgement.p_value <= 0.25 and judgement.harmony_above_chance > 0
    assert judged_4 > 5


def test_nothing_is_judged_by_beats_that_the_sound_does_not_keep_to() -> None:
    unsure = replace(BEATS, quality=0.3, fit=0.5)
    lost = judged(dancer(tempo=97.0), unsure)
    assert lost.level == 0 and np.isnan(lost.p_time)
    assert (
        lost.verdict == "Cannot tell: the beats found in this music are unsure, since its sound does not keep to them."
    )
    followed = judged(dancer(), unsure)
    assert followed.level == 4
    assert any("unsure" in text for text in (*followed.remarks, *followed.details))
