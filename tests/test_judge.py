"""In time? where in the beat? The signal, its patterns, both tests, and five levels in words."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from scipy.stats import rankdata

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.player_data import of_dance
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.shape_speed import ShapeSignal, ShapeSpeed, shape_signal, shape_speed
from harmolab.significance import ranks
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict import bar_pattern, evidence, sentences
from harmolab.verdict.evidence import MOMENTS, N_RATIOS, PlaceTest, TimeTest, floor, place_test, time_test
from harmolab.verdict.judge import Judgement, judge, level_of, score_motion
from tests.builders import cases, refused, track

SECONDS, PERIOD = 24.0, 0.5
BEATS = track(PERIOD * np.arange(1, 47), duration=SECONDS)
MILLISECONDS = re.compile(r"\d+ ms|late|early")


def dancer(lag: float = 0.0, tempo: float = 120.0, every: float = 1.0, seed: int = 4) -> Motion:
    """A body that rests `lag` beats after every so many beats."""
    ends = (np.arange(-2, 60) * every + lag) * 60 / tempo
    return synthetic_motion(ends[(ends >= 0) & (ends < SECONDS + 1)], seconds=SECONDS, fps=30.0, seed=seed)


def judged(motion: Motion, beats: BeatTrack = BEATS, pattern: BarPattern | None = None) -> Judgement:
    return judge(shape_speed(motion), beats, pattern=pattern)


def trembling(size: float, beats: float = 1.0) -> Motion:
    """A pose that trembles by so many metres, to and fro in so many beats: it rests twice in them."""
    pose = dancer().positions[:1]
    wave = np.cos(2 * np.pi * np.arange(720) / 30 / PERIOD / beats)[:, None, None]
    return replace(dancer(), positions=pose + size * wave * np.random.default_rng(0).normal(size=pose.shape))


def in_half_time() -> Judgement:
    """A body that goes to and fro in four beats, and a little in two: on every second beat it is fastest."""
    moved = trembling(0.1, 4.0).positions + trembling(0.05, 2.0).positions - trembling(0.0).positions
    return judged(replace(dancer(), positions=moved))


def on_a_turntable(poses: np.ndarray) -> Motion:
    """One pose (J, 3), or those of a dance, that turn now faster, now slower."""
    return replace(dancer(), positions=turned_by(poses, np.cumsum(1 - np.cos(2 * np.pi * np.arange(720) / 15)) / 10))


def wandering() -> Judgement:
    """A dancer who rests on every second beat, and for eight of those .8 of a beat later."""
    wander = np.array([0.0, 0.8])[np.arange(30) // 8 % 2]
    motion = synthetic_motion(PERIOD * (2 * np.arange(30) + wander), seconds=SECONDS, fps=30.0, seed=4)
    return judged(motion, replace(BEATS, bar_places=np.arange(1, 47) % 2), BarPattern(2, (-1.0,), (0.0,)))


REST, HIT, HALF_TIME = HOW_PATTERNS["rest"], HOW_PATTERNS["hit"], HOW_PATTERNS["half time"]
WALTZED = replace(REST, dance="waltz")
UNSURE = replace(BEATS, quality=0.3, fit=0.5)
MIDDLE = np.abs(np.arange(720) / 30 - SECONDS / 2) < 8.9
TOO_LITTLE = r"Cannot tell: too little movement inside the body\."
NO_BEAT = r"Cannot tell: this music has no beat where you dance, or no sound\."


def first_beats(count: int) -> BeatTrack:
    return BEATS.select(np.arange(46) < count)


@cases(
    "judgement, level, verdict",
    (lambda: judged(dancer()), 4, r"You are on the beat: slow on it, fastest \d+ ms after it\."),
    (lambda: judged(dancer(), first_beats(16)), 4, "You are on the beat: slow .*"),
    (lambda: judged(dancer(), UNSURE), 4, "You are on the beat: slow .*"),
    (lambda: judged(dancer(every=2.0)), 3, r"In time: you move once in two beats \(half time\)\."),
    (in_half_time, 4, r"You are .* \(half time\): slow on it, fastest \d+ ms after it\."),
    (lambda: judged(dancer(every=2.0), pattern=HALF_TIME), 4, ".*you rest on every second one.*"),
    (lambda: judged(dancer(0.5), pattern=HIT), 4, ".*you hit it.*"),
    (lambda: judged(dancer(), pattern=WALTZED), 4, ".*you move as in a waltz.*"),
    (lambda: judged(dancer(0.5)), 3, r"In time: .* on the beat \(a hit\)\. If you meant to rest .* half a beat off\."),
    (
        lambda: judged(dancer(0.25)),
        3,
        r"In time: .* fastest 3[5-9]\d ms after the beat, and stillest 1[0-4]\d ms after it\.",
    ),
    (lambda: judged(dancer(), pattern=HIT), 3, r"You keep time, steadily half a beat off for a hit on the beat\."),
    (lambda: judged(dancer(0.25), pattern=REST), 3, r"You keep time, steadily \d+ ms late for a rest on the beat\."),
    (lambda: judged(dancer(0.3), pattern=WALTZED), 3, r"You keep time, steadily \d+ ms late for a waltz\."),
    (lambda: replace(judged(dancer(0.25), pattern=REST), lag_interval=(-0.1, 0.5)), 3, r"In time\. Whether .* told.*"),
    (wandering, 2, r"You keep its tempo, but no steady place in the beat\."),
    (lambda: judged(dancer(tempo=97.0)), 1, "No sign that you follow this beat.*"),
    (lambda: judged(trembling(1e-3)), 0, TOO_LITTLE),
    (lambda: judged(trembling(1e-9)), 0, TOO_LITTLE),
    (lambda: judged(on_a_turntable(dancer().positions[0])), 0, r"Cannot tell: you only turn and travel\."),
    (lambda: judged(dancer(), first_beats(15)), 0, r"Cannot tell: 15 beats are too few; 16 are needed\."),
    (lambda: judged(dancer(), first_beats(1)), 0, r"Cannot tell: 1 beat is too few; 16 are needed\."),
    (lambda: judged(dancer(), first_beats(0)), 0, NO_BEAT),
    (lambda: judged(replace(dancer(), valid=~MIDDLE)), 0, r"Cannot tell: 11 beats are too few; 16 are needed\."),
    (lambda: judged(dancer(tempo=97.0), UNSURE), 0, "Cannot tell: the beats found in this music are unsure, .*"),
)
def test_each_dancer_is_told_what_was_seen(judgement: Callable[[], Judgement], level: int, verdict: str) -> None:
    one = judgement()
    words = " ".join([one.verdict, *one.remarks])
    assert one.level == level
    assert re.fullmatch(verdict, one.verdict), one.verdict
    assert level > 2 or not MILLISECONDS.search(words)
    assert level > 0 or (np.isnan(one.harmony_above_chance) and np.isnan(one.p_time))
    assert (not one.beats.is_sure and level > 0) == ("unsure" in " ".join([*one.remarks, *one.details]))
    assert not re.search(r"\b[Yy]ou\b(?! meant)", of_dance(one.verdict))


@cases("first, last, count", (12.5, 24.0, 22), (0.0, 12.5, 24), (6.5, 18.5, 24))
def test_who_stands_still_for_long_hears_on_how_many_beats(first: float, last: float, count: int) -> None:
    frames = np.arange(720)
    frames[(frames > 30 * first) & (frames <= 30 * last)] = round(30 * first)
    judgement = judged(replace(dancer(), positions=dancer().positions[frames]))
    assert judgement.level == 4 and count - 4 <= judgement.n_still <= count
    words = f". On about {judgement.n_still} of 46 beats you stand still or move evenly; only the others tell."
    assert judgement.verdict.endswith(words) and judgement.without_start().verdict.endswith(words)
    few, some = (sentences.stillness(SimpleNamespace(n_still=8, beats=range(beats))) for beats in (80, 79))
    assert few == "" and some.startswith(" On about 8 of 79 beats")


def test_a_part_in_which_one_stands_and_trembles_is_at_no_other_tempo() -> None:
    # Half a minute of standing, with hands that tremble by half a millimetre at 149 a minute, then a dance.
    dance = synthetic_motion(PERIOD * np.arange(120), seconds=60.0, fps=30.0, seed=4)
    positions = dance.positions[np.maximum(np.arange(1800), 900)]
    positions[:900, [6, 15], 1] += 0.0005 * np.sin(np.pi * 149 / 60 * np.arange(900)[:, None] / 30)
    judgement = judged(replace(dance, positions=positions), track(PERIOD * np.arange(120), duration=60.0))
    assert judgement.level == 4 and judgement.other_parts == [] and 55 <= judgement.n_still <= 62


@cases("length, pulse, seen, count", (7, 0.4, True, 0), (8, 0.4, True, 8), (8, 0.4, False, 0), (8, np.nan, True, 0))
def test_stillness_begins_at_eight_beats_that_are_seen(length: int, pulse: float, seen: bool, count: int) -> None:
    times = np.arange(2400) / 100
    moves = (times < 10) | (times > 10 + PERIOD * length)
    values = np.sin(2 * np.pi * times / PERIOD) * moves
    assert evidence.still_beats(part(times=times, values=values, valid=moves | seen, pulse=pulse), BEATS.times) == count


def test_who_rests_on_every_second_beat_is_advised_to_say_so() -> None:
    once = judged(dancer(every=2.0))
    assert any('--how "half time"' in remark and "at 60 bpm, not 120" in remark for remark in once.remarks)
    assert not any("--dance" in line for line in (*once.remarks, *once.details))
    assert "half time" not in " ".join(judged(dancer(0.5)).remarks)
    unlike = "Moments in the beat are means of two unlike beats."
    assert all(any(unlike in line for line in each.remarks) for each in (judged(trembling(0.1, 4.0)), in_half_time()))


def test_little_movement_inside_the_body_and_few_joints_that_move_are_remarked() -> None:
    elbow = dancer().positions[:1].repeat(720, axis=0)
    elbow[:, 13] = dancer().positions[:, 13]
    turning, one_elbow = on_a_turntable(dancer().positions), replace(dancer(), positions=elbow)
    words = [" ".join(judged(motion).remarks) for motion in (turning, one_elbow, dancer())]
    assert [bool(re.search("You mostly turn and travel: 1.% of", each)) for each in words] == [True, False, False]
    assert [bool(re.search("Few joints move: all .* of [5-7]% of", each)) for each in words] == [False, True, False]


def test_harmony_is_a_number_where_the_place_is_asked_for() -> None:
    asked = ((0, None), (0.5, None), (0.5, HIT), (0, HIT))
    rest, hit, named, wrong = (judged(dancer(lag), pattern=how) for lag, how in asked)
    assert rest.harmony_above_chance > 0.4 and rest.p_value == max(rest.p_time, rest.p_place)
    assert np.isnan(hit.harmony_above_chance) and np.isnan(hit.p_value)
    assert any("--how hit" in remark for remark in hit.remarks)
    assert named.reading == "hit" and wrong.harmony_above_chance < -0.4
    assert judged(dancer(0.25), pattern=REST).lag_s == pytest.approx(0.125, abs=0.02)


@pytest.mark.parametrize("tempo", [90.0, 150.0])
@pytest.mark.parametrize("seconds", [0.1, 0.2, 0.3, 0.5])
def test_who_arrives_on_the_beat_is_in_time_and_neither_early_nor_late(tempo: float, seconds: float) -> None:
    beats = np.arange(1, SECONDS * tempo / 60 - 1) * 60 / tempo
    judgement = judged(arriving(beats, seconds), track(beats, duration=SECONDS))
    assert judgement.level >= 3
    assert not judgement.harmony_above_chance < -0.2
    words = " ".join([judgement.verdict, *judgement.remarks, *judgement.details])
    assert "late" not in words and "early" not in words and f"p = {judgement.p_time:.3f}" in words


def arriving(ends: np.ndarray, seconds: float) -> Motion:
    """Arms that go up and down by turns, in `seconds` each, arrive at these times and stand."""
    times = np.arange(round(SECONDS * 60)) / 60
    way = np.clip((times[:, None] - ends + seconds) / seconds, 0, 1)
    eased = way**3 * (10 - 15 * way + 6 * way**2)
    return raising(eased @ np.where(np.arange(ends.size) % 2 == 0, 1.0, -1.0))


def raising(height: np.ndarray) -> Motion:
    """A body whose arms stand at a height from 0 to 1, 60 frames a second."""
    body = np.array([[0.0, 1.0, 0.0], [0.0, 1.6, 0.0], [0.2, 1.4, 0.0], [-0.2, 1.4, 0.0], [0.1, 0.0, 0.1]])
    hands = np.array([[0.7, 1.0, 0.2], [-0.7, 1.0, 0.2]]) + 0.6 * height[:, None, None] * np.array([-0.3, 1.0, 0.2])
    positions = np.concatenate([np.broadcast_to(body, (height.size, 5, 3)), hands], axis=1)
    return Motion(positions, 60.0, Skeleton.unnamed(7))


@pytest.mark.parametrize("tempo", [121.9, 128.4, 95.0])
def test_another_tempo_is_level_one_and_is_told(tempo: float) -> None:
    judgement = judged(dancer(tempo=tempo))
    assert judgement.level == 1
    words = r"No sign that you follow this beat\. Your own tempo is ([\d.]+) bpm, the music's 120\.0\."
    own = re.fullmatch(words, judgement.verdict)
    assert own and float(own[1]) == pytest.approx(tempo, abs=0.3)


SLIPS = "No sign that you follow this beat. But part by part you are in time"  # and no tempo of one's own


@cases(
    "ends, words",
    (np.arange(180.0), ""),
    (np.r_[:60, 60:120:1.24, 120:180], " From 0:30 to 1:00 you move at another tempo than the music's."),
    (np.r_[:60, 60:180:1.24], " From 0:30 to 1:30 you move at another tempo than the music's."),
    (np.r_[:90, 90.5:180], " But part by part you are in time from 0:00 to 0:30 and from 1:00 to 1:30."),
    (np.r_[:60, 60.33:120, 120.67:180], f"{SLIPS} from 0:00 to 0:30, from 0:30 to 1:00 and from 1:00 to 1:30."),
)
def test_who_is_in_time_in_parts_only_hears_in_which(ends: FloatArray, words: str) -> None:
    motion = synthetic_motion(PERIOD * ends, seconds=90.0, fps=30.0, seed=4)
    judgement = judged(motion, track(PERIOD * np.arange(180), duration=90.0))
    assert judgement.verdict.endswith(words or "after it.") and judgement.level == (1 if "But" in words else 4)


@cases(
    "motion, words",
    (dancer(every=0.5), "the sound does not tell that from 240"),
    (dancer(0.625, every=0.75, seed=2), "if you count 160"),
    (dancer(0.5, every=1.5, seed=6), "if you count 80"),
)
def test_who_moves_once_a_beat_of_another_count_of_tracked_music_hears_of_it(motion: Motion, words: str) -> None:
    tracked, annotated = (judged(motion, replace(BEATS, quality=quality)) for quality in (1.0, None))
    assert tracked.verdict == annotated.verdict and tracked.level == 3
    mend = "say the dance (--dance), or tap the beats (`harmolab beats --tap`)"
    assert f"The music was counted at 120 bpm; {words}: {mend}." in tracked.remarks
    assert "was counted at" not in " ".join(annotated.remarks)


def test_who_dances_to_beats_that_no_program_finds_hears_that_they_can_be_tapped() -> None:
    help_words = "What would help: tap the beats of this song (`harmolab beats --tap`), and give them (--beats)."
    assert judged(dancer(tempo=97.0), UNSURE).remarks == (help_words,)


@pytest.mark.parametrize("pattern", [None, REST])
def test_who_is_half_a_beat_off_tracked_beats_hears_that_these_may_be_off_beats(pattern: BarPattern | None) -> None:
    tracked, annotated = (judged(dancer(0.5), replace(BEATS, quality=quality), pattern) for quality in (1.0, None))
    words = "If the off-beats were counted, you are on the beat"
    assert words in tracked.remarks[-1] and "--how hit" in tracked.remarks[-1]
    assert words not in " ".join(annotated.remarks + annotated.details)


@cases("rate, words", (2.0, "twice a beat (double time"), (4 / 3, "4 times in 3 beats"), (1.5, "3 times in 2 beats"))
@pytest.mark.parametrize("phase", [0.0, 0.3, 0.6])
def test_who_moves_at_another_rate_is_told_so_and_never_on_the_beat(rate: float, words: str, phase: float) -> None:
    times = np.arange(round(SECONDS * 60)) / 60
    judgement = judged(raising(0.5 - 0.5 * np.cos(np.pi * (times / PERIOD * rate + phase))))
    assert judgement.level in (1, 2, 3) and "on the beat" not in judgement.verdict
    assert words in judgement.verdict or f"Your own tempo is {120 * rate:.1f} bpm" in judgement.verdict


def test_a_waltz_is_seen_by_its_threes_without_being_told() -> None:
    times = np.arange(round(SECONDS * 100)) / 100
    course = bar_pattern.evaluate_pattern(DANCE_PATTERNS["waltz"], times / PERIOD)
    speed = 1 + 0.5 * course + 0.1 * np.random.default_rng(0).normal(size=times.size)
    energy, size = np.square(speed)[:, None] * np.ones(5), np.ones(times.size)
    judgement = judge(ShapeSpeed(100.0, speed, energy, energy.mean(axis=1), size, size > 0, 3), BEATS)
    assert (judgement.level, judgement.reading) == (4, "waltz")
    assert judgement.verdict == "You are on the beat: you move in threes, as in a waltz."


@cases("seed, every, lag, words", (4, 3, 0, "once"), (2, 0.75, 0.625, "4 times"), (6, 1.5, 0.5, "2 times"))
def test_who_moves_otherwise_in_three_beats_does_not_waltz(seed: int, every: float, lag: float, words: str) -> None:
    judgement = judged(dancer(lag, every=every, seed=seed))
    assert (judgement.level, judgement.reading) == (3, "waltz")
    assert judgement.verdict == f"In time, but not with each beat: you move {words} in 3 beats."


NUMBERS = np.arange(len(BEATS))
MISSED = np.r_[NUMBERS[:18] % 3, NUMBERS[:6], NUMBERS[:22] % 3]  # one downbeat of a waltz was missed


@cases("places", NUMBERS % 3, NUMBERS % 6, NUMBERS % 12, MISSED)
def test_who_moves_in_threes_is_in_time_also_with_bars_of_six_and_one_that_is_too_long(places: np.ndarray) -> None:
    judgement = judged(dancer(every=3), replace(BEATS, bar_places=places))
    assert judgement.verdict == "In time, but not with each beat: you move once in 3 beats."


@pytest.mark.parametrize("power", [0.199, 0.201])
def test_a_waltz_has_a_fifth_of_its_power_at_one_movement_a_bar(power: float) -> None:
    rates = {Fraction(1, 3): power, Fraction(2, 3): 0.9, Fraction(1): 0.9, Fraction(4, 3): 1.0}
    assert evidence.has_bar(TimeTest(np.zeros(241), np.zeros(241), 0.02, rates, {3: 9.0})) == (power > 0.2)


def test_what_would_show_more_is_said() -> None:
    assert any("--one" in remark for remark in judged(dancer(0.3), pattern=DANCE_PATTERNS["waltz"]).remarks)
    assert any("--dance" in remark for remark in judged(dancer(0.25)).remarks)
    # What is out of time with beats that a program found may be in time with those of the song.
    for quality, words in (
        (None, "say the dance, where"),
        (1.0, "hear the counted beats (`harmolab beats --clicks`), or"),
    ):
        out_of_time = judged(dancer(tempo=97.0), replace(BEATS, quality=quality))
        assert out_of_time.level == 1 and out_of_time.details[-1].startswith(f"What would help: {words}")


def test_without_a_start_all_is_said_that_asks_for_no_place_in_the_beat() -> None:
    no_sign = judged(dancer(tempo=97.0), pattern=REST)
    assert no_sign.without_start().remarks[1:] == no_sign.remarks[1:] and "A longer take" in no_sign.remarks[1]
    unsure, hit = (judged(dancer(lag), UNSURE).without_start() for lag in (0.0, 0.5))
    assert "unsure" in unsure.remarks[1] and len(unsure.remarks) == 2
    assert unsure.details == hit.details == () and np.isnan(judged(dancer(), pattern=REST).without_start().p_value)


def test_a_picture_and_two_points_say_so() -> None:
    for tempo, words in ((120.0, "a turning statue"), (97.0, "every fourth dancer")):
        motion = dancer(tempo=tempo)
        flat = judged(Motion(motion.positions[..., :2], 30.0, motion.skeleton))
        assert any(words in remark for remark in flat.remarks)
    hands = judged(Motion(dancer().positions[:, [10, 13]], 30.0, Skeleton.unnamed(2)))
    assert any("no shape" in remark for remark in hands.remarks)


def scored(motion: Motion, **settings: object) -> HarmonyScore:
    return score_motion(BEATS, motion, params=replace(HarmonyParams.recommended(), **settings))


def test_the_score_keeps_the_judgement_and_its_number() -> None:
    score = scored(dancer())
    judgement = score.judgement
    assert (score.harmony_above_chance, score.p_value) == (judgement.harmony_above_chance, judgement.p_value)
    content = score.to_dict()
    assert {"level", "verdict", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "pulse", "share"} <= content.keys()


def test_a_lag_that_is_expected_is_no_lag() -> None:
    assert scored(dancer(0.25), lag=0.125).judgement.level == 4


def test_beats_after_the_end_of_the_movement_do_not_count() -> None:
    whole, cut = (score_motion(beats, dancer().span(0.0, 14.8)) for beats in (BEATS, BEATS.span(0.0, 14.8)))
    assert (len(cut.music), whole.harmony_above_chance) == (29, cut.harmony_above_chance)


@pytest.mark.parametrize("dance", ["cha-cha", "waltz"])
def test_who_keeps_the_beat_but_no_bar_is_told_so(dance: str) -> None:
    pattern = DANCE_PATTERNS[dance]
    judgement = judged(dancer(0.1), replace(BEATS, bar_places=np.arange(len(BEATS)) % pattern.beats), pattern)
    assert judgement.level == 2
    steady = "Your place in the beat is steady, but not at one beat of the bar: it goes from one to another."
    assert steady in judgement.remarks


# Thresholds, a case on either side of each


USUAL = {"p": 0.02, "lag": 0.0, "wander": 0.1, "lowest": 0.1, "above": 0.5, "beside": 6, "power": 1.0}


def hand_made(**changes: float) -> Judgement:
    """A judgement on hand-made evidence: p in time, lag and its spread in beats, H and its lower end, lags as good."""
    p, lag, wander, lowest, above, beside, power = (USUAL | changes).values()
    curve = np.full(48, 0.4)
    curve[: 1 + int(beside)] = 0.5 + above / 2
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
    ({"above": 0.01, "beside": 3}, {"above": 0.0, "beside": 3}, 3),  # harmony at chance is not on the beat
)
def test_each_threshold_ends_level_four(inside: dict[str, float], outside: dict[str, float], level: int) -> None:
    assert hand_made(**inside).level == 4
    assert hand_made(**outside).level == level


def part(**changes: float) -> ShapeSignal:
    """A signal far above the floor but for what is changed."""
    return replace(ShapeSignal(np.arange(9.0), np.zeros(9), np.ones(9, bool), 0.4, 0.6, 0.6, 3, 3, 0.3), **changes)


def test_the_floor_lies_at_its_pulse_its_share_and_its_swing() -> None:
    assert floor(part(pulse=0.0301)) == "" and floor(part(pulse=0.0299)) == "too little movement inside the body"
    assert floor(part(share=0.101)) == "" and floor(part(share=0.099)) == "you only turn and travel"
    assert floor(part(share=0.01, dimensions=2)) == ""
    point = {"dimensions": 0, "pulse": np.nan}
    assert floor(part(**point, swing=0.0201)) == ""
    assert floor(part(**point, swing=0.0199)) == "too little movement inside the body"
    assert floor(part(**point, swing=1e-9, axes=2)) == ""


def test_an_own_tempo_is_told_from_eight_deviations_on() -> None:
    clear = hand_made(p=0.5)
    assert clear.time is not None
    for best, is_told in ((8.0, True), (7.9, False)):
        z = np.where(np.arange(241) == 130, best, 0.0)
        assert ("Your own tempo" in replace(clear, level=1, time=replace(clear.time, z=z, power=z)).verdict) is is_told


def test_sixteen_beats_are_judged_and_fewer_than_48_are_said_to_be_few() -> None:
    times = 0.4 * np.arange(1, 58)
    short, enough = (judged(dancer(tempo=97.0), track(times[:count], duration=SECONDS)) for count in (47, 48))
    assert any("A longer take" in text for text in (*short.remarks, *short.details))
    assert not any("A longer take" in text for text in (*enough.remarks, *enough.details))


def test_a_trembling_point_is_too_little_and_one_that_swings_is_not() -> None:
    swing = np.sin(2 * np.pi * np.arange(round(SECONDS * 60)) / 60 / PERIOD)[:, None, None]
    small, larger, large = (
        judged(Motion(size * swing * np.ones((1, 1, 3)), 60.0, Skeleton.unnamed(1))).level for size in (1e-9, 1e-3, 0.1)
    )
    assert small == larger == 0 and large >= 3
    flat, clear = (judged(Motion(size * swing * np.ones((1, 1, 2)), 60.0, Skeleton.unnamed(1))) for size in (1e-9, 0.1))
    no_body = "Only how fast you move was read, no shape: flow and fewer than three points have none; "
    assert f"{no_body}how large the movement is cannot be known." in (*flat.remarks, *flat.details)
    assert no_body in clear.details[-1] and "A longer take" in clear.remarks[-1]


def test_left_and_right_swapped_for_single_frames_is_no_dance() -> None:
    swapped = raising(np.zeros(1440)).positions + np.random.default_rng(0).normal(0, 0.002, (1440, 7, 3))
    frames = np.round(BEATS.times * 60).astype(int)
    swapped[frames] = swapped[frames][:, [0, 1, 3, 2, 4, 6, 5]]
    judgement = judged(Motion(swapped, 60.0, Skeleton.unnamed(7)))
    assert (judgement.level, judgement.verdict) == (0, "Cannot tell: too little movement inside the body.")


@pytest.mark.slow
def test_p_beside_on_the_beat_is_one_that_the_level_asks_for() -> None:
    rng = np.random.default_rng(5)
    judged_4 = 0
    for _ in range(20):
        lag, jitter, every = rng.uniform(-0.3, 0.3), rng.uniform(0, 0.15), rng.choice([0.5, 0.75, 1.0, 2.0])
        ends = np.sort((np.arange(-2, 60) * every + lag + jitter * rng.normal(size=62)) * PERIOD)
        judgement = judged(synthetic_motion(ends[(ends >= 0) & (ends < SECONDS)], seconds=SECONDS, fps=30.0, seed=4))
        if judgement.level == 4:
            judged_4 += 1
            assert judgement.p_time <= 0.05 and judgement.p_place <= 0.25
            assert float(re.findall(r"p = ([\d.]+);", " ".join(judgement.remarks))[0]) <= 0.05
            assert judgement.p_value <= 0.25 and judgement.harmony_above_chance > 0
    assert judged_4 > 2


beats_at = partial(track, duration=30.0)
WALTZ = BarPattern(3, (0.1, 0.2, 0.1), (0.4, -0.1, 0.2), dance="waltz")
FAST_ON_EVEN_BEATS = BarPattern(2, (1.0,), (0.0,))


def test_a_pattern_is_a_fourier_series_of_the_beat_position():
    # At 0: 1 + .5; half a beat on, a quarter of the cycle: cos(pi/2) + .5 cos(pi) + 2 sin(pi).
    values = bar_pattern.evaluate_pattern(BarPattern(2, (1.0, 0.5), (0.0, 2.0)), np.array([0.0, 0.5, 2.0]))
    np.testing.assert_allclose(values, [1.5, -0.5, 1.5], atol=1e-12)


def test_positions_count_beats_from_their_place_in_the_bar_and_go_on_beyond_them():
    times = np.array([0.0, 0.5, 1.0, 1.5, 3.0, 4.0, 5.0])
    expected = np.array([-1, -0.5, 0, 0.5, 1.5, 2, 2.5])
    for places, first in ((None, 0), ([3, 0, 1], 3)):
        found = bar_pattern.beat_positions(times, beats_at([1.0, 2.0, 4.0], bar_places=places))
        np.testing.assert_allclose(found, expected + first)
    for few in ([], [1.0]):
        message = f"a pattern needs two music beats at least, got {len(few)}"
        refused(message, bar_pattern.beat_positions, np.array([0.0]), beats_at(few))


def test_a_planted_pattern_is_learnt_back():
    planted = BarPattern(3, (0.5, -0.25, 0.125), (1.0, 0.125, 0.0))  # harmonics up to one turn a beat
    positions = np.arange(0, 30, 0.01)  # ten whole cycles
    sums = bar_pattern.pattern_sums(positions, bar_pattern.evaluate_pattern(planted, positions), 3)
    learnt = bar_pattern.fit_pattern([sums], source="a test")
    np.testing.assert_allclose(learnt.cosines, planted.cosines, atol=1e-9)
    np.testing.assert_allclose(learnt.sines, planted.sines, atol=1e-9)
    assert (learnt.beats, learnt.source) == (3, "a test")


def test_pieces_count_by_their_length():
    positions = np.arange(0, 3, 0.01)
    short = bar_pattern.pattern_sums(positions, np.cos(2 * np.pi * positions), 1)
    long = bar_pattern.pattern_sums(np.tile(positions, 3), np.zeros(3 * positions.size), 1)
    np.testing.assert_allclose(bar_pattern.fit_pattern([short, long]).cosines, [0.25], atol=1e-9)


def test_a_pattern_of_nothing_and_pieces_of_different_cycles_are_refused():
    refused("no motion to fit a bar pattern on", bar_pattern.fit_pattern, [])
    pieces = [bar_pattern.pattern_sums(np.arange(10.0), np.ones(10), beats) for beats in (2, 3)]
    refused(r"pieces with cycles of \[2, 3\] beats cannot share a pattern", bar_pattern.fit_pattern, pieces)


@pytest.mark.parametrize("moments", [20, 24, 48])
@pytest.mark.parametrize("pattern", [BarPattern.stop_on_the_beat(), FAST_ON_EVEN_BEATS, WALTZ])
def test_a_fit_is_the_windowed_pattern_without_mean_times_the_speed_around_a_moment(
    pattern: BarPattern, moments: int, rng: np.random.Generator
):
    speed = rng.normal(size=5 * pattern.beats * moments)
    fits = bar_pattern.pattern_fits(speed, pattern, moments=moments)
    offsets = np.arange(-(pattern.beats * moments // 2), pattern.beats * moments // 2 + 1)
    window = np.cos(np.pi * offsets / moments / pattern.beats) ** 2
    for place, moment in ((0, 7), (pattern.beats - 1, 4 * moments)):
        expected = window * bar_pattern.evaluate_pattern(pattern, offsets / moments + place)
        expected -= window * expected.sum() / window.sum()
        around = speed[(moment + offsets) % speed.size]
        np.testing.assert_allclose(bar_pattern.templates(pattern, moments)[place], expected, atol=1e-12)
        assert fits[place, moment] == pytest.approx(expected @ around, abs=1e-9)


def test_ranks_of_moments_are_spread_evenly_and_shared_where_fits_differ_by_rounding_only(rng: np.random.Generator):
    np.testing.assert_allclose(np.sort(bar_pattern.moment_ranks(rng.normal(size=240))), (np.arange(240) + 0.5) / 240)
    shared = bar_pattern.moment_ranks(np.array([1.0, 1 + 1e-10, 0.0, 1 - 1e-8]))
    np.testing.assert_allclose(shared, [0.75, 0.75, 0.125, 0.375])
    values = rng.integers(0, 9, 50)
    np.testing.assert_array_equal(ranks(values), rankdata(values))


def test_a_body_at_rest_ranks_in_the_middle():
    times = np.arange(1200) / 100.0
    ranks = bar_pattern.beat_ranks(times, np.zeros(times.size), beats_at(np.arange(1.0, 11.0, 0.5)), FAST_ON_EVEN_BEATS)
    np.testing.assert_array_equal(ranks, np.full(20, 0.5))


@cases("place, late, fits", (0, 0.0, True), (1, 0.0, False), (None, 0.0, True), (None, 0.5, False))
def test_bar_places_tell_even_beats_from_odd_ones_and_without_them_the_first_beat_begins(place, late, fits):
    # Beats every half second; fastest on whole seconds, slowest between.
    times, beats = np.arange(1200) / 100.0, np.arange(1.0, 11.0, 0.5) + late
    places = None if place is None else [(k + place) % 4 for k in range(beats.size)]
    music = beats_at(beats, bar_places=places)
    ranks = bar_pattern.beat_ranks(times, np.cos(2 * np.pi * times), music, FAST_ON_EVEN_BEATS)
    assert ((ranks > 0.85) == fits).all() and ((ranks < 0.15) != fits).all()


def test_beats_are_ranked_among_24_moments_a_beat_with_nothing_beyond_the_ends(rng: np.random.Generator):
    # Twelve beats whose first is the second of a bar of two; the movement lasts from the first beat to the last.
    times, speed = np.arange(265) / 48.0, rng.normal(size=265)
    music = beats_at(0.5 * np.arange(12), bar_places=np.arange(1, 13) % 2)
    ranks = bar_pattern.beat_ranks(times, speed, music, FAST_ON_EVEN_BEATS)
    kernels = bar_pattern.templates(FAST_ON_EVEN_BEATS, 24)
    expected = [bar_pattern.moment_ranks(np.convolve(speed, kernel[::-1], mode="same")) for kernel in kernels]
    np.testing.assert_allclose(ranks, [expected[(beat + 1) % 2][24 * beat] for beat in range(12)], atol=1e-12)


def test_beats_beyond_the_movement_count_at_its_ends_and_nothing_moves_there():
    # Two seconds of movement, slowest on each beat; beyond its ends half of the window sees nothing.
    times, music = np.arange(201) / 100.0, beats_at(np.arange(0.0, 4.0, 0.5))
    ranks = bar_pattern.beat_ranks(times, -np.cos(4 * np.pi * times), music, BarPattern.stop_on_the_beat())
    assert ranks[1:4].min() > 0.95
    np.testing.assert_array_equal(ranks[4:], ranks[4])
    assert ranks[4] < ranks[1:4].min()


def test_the_curve_has_a_sample_a_moment_and_its_first_moment_a_number():
    times = np.arange(301) / 100.0
    curve, first = bar_pattern.beat_curve(times, times, beats_at([1.0, 1.5, 2.0]))
    # Beat 0 is at 1 s: the movement begins two beats before it and ends four beats after.
    assert (first, curve.size) == (-2 * bar_pattern.GRID, 6 * bar_pattern.GRID + 1)
    np.testing.assert_allclose(curve[2 * bar_pattern.GRID], 1.0, atol=1e-12)


def test_doubled_beats_are_refused_before_they_fill_the_memory():
    times, message = np.arange(600) / 100.0, r"music beats lie 1e-07 s apart: are there doubles among them\?"
    refused(message, bar_pattern.beat_curve, times, np.cos(times), beats_at([1.0, 1.0000001]))


PLACED = PERIOD * np.arange(41)


def signal_of(speed: FloatArray, times: FloatArray | None = None) -> ShapeSignal:
    """A signal at these times (s), else a hundred a second."""
    times = np.arange(speed.size) / 100.0 if times is None else times
    return ShapeSignal(times, speed, np.ones(speed.size, bool), 0.4, 0.6, 0.6, 3)


def resting(lag: float = 0.0, every: float = 1.0) -> ShapeSignal:
    """Slowest `lag` beats after every so many beats."""
    position = np.arange(2001) / 100.0 / PERIOD
    return signal_of(-np.cos(2 * np.pi * (position - lag) / every))


def waltz(lag: float = 0.0, first: int = 0) -> ShapeSignal:
    """The pattern of a waltz whose bars begin on beat `first`, a constant lag later."""
    return signal_of(bar_pattern.evaluate_pattern(WALTZ, np.arange(2001) / 100.0 / PERIOD - lag - first))


def placed(movement: ShapeSignal, pattern: BarPattern = REST, bars: int | None = None) -> PlaceTest:
    places = None if bars is None else (np.arange(PLACED.size) - bars) % 3
    return place_test(movement, PLACED, places, pattern)


def test_one_reading_falls_in_a_straight_line_from_one_to_minus_one() -> None:
    harmony = [placed(resting(lag)).harmony_above_chance for lag in (0.0, 0.125, 0.25, 0.375, 0.5)]
    np.testing.assert_allclose(harmony, [1, 0.5, 0, -0.5, -1], atol=0.05)


@pytest.mark.parametrize("lag", [-0.2, -0.1, 0.0, 0.1, 0.2])
def test_a_lag_is_found_with_its_sign_late_is_positive(lag: float) -> None:
    assert placed(resting(2 * lag)).lag == pytest.approx(2 * lag, abs=0.025)


def test_harmony_is_never_below_minus_one_with_several_readings() -> None:
    unknown = placed(waltz(), WALTZ)
    for lag in range(MOMENTS):
        turned = replace(unknown, ranks=np.roll(unknown.ranks, lag, axis=2))
        assert -1.0 <= turned.harmony_above_chance <= 1.0
        assert turned.spread()[0][0] >= -1.0


@pytest.mark.parametrize("first", [0, 1, 2])
def test_a_waltz_lies_on_its_bar(first: int) -> None:
    known = placed(waltz(first=first), WALTZ, bars=first)
    assert known.harmony_above_chance > 0.95 and known.p_value == pytest.approx(1 / (3 * MOMENTS), abs=0.02)
    assert abs(placed(waltz(first=first), WALTZ, bars=first + 1).lag) == pytest.approx(1.0, abs=0.05)


def test_without_the_bar_every_place_is_a_reading_and_chance_knows_it() -> None:
    unknown = placed(waltz(first=2), WALTZ)
    assert len(unknown.ranks) == 3
    assert unknown.chance > 0.5 and unknown.lag == pytest.approx(0.0, abs=0.05)
    assert unknown.harmony_above_chance > 0.9


def test_chance_is_one_half_for_one_reading_and_the_mean_of_all_lags_for_several() -> None:
    assert placed(resting()).chance == 0.5
    several = placed(resting(), WALTZ)
    assert several.chance == pytest.approx(several.curve.mean())


def test_the_p_value_is_the_share_of_lags_that_do_as_well() -> None:
    assert placed(resting()).p_value == pytest.approx(1 / MOMENTS)
    assert placed(resting(0.25)).p_value == pytest.approx(0.5, abs=0.05)


def test_random_phases_have_uniform_p_values_and_no_harmony_on_average() -> None:
    tests = [placed(resting(phase)) for phase in (np.arange(40) + 0.5) / 40]
    assert np.mean([test.p_value <= 0.05 for test in tests]) <= 0.1
    assert np.mean([test.harmony_above_chance for test in tests]) == pytest.approx(0.0, abs=0.05)


def test_the_spread_is_narrow_for_a_steady_dancer_and_wide_for_a_wandering_one() -> None:
    _, steady = placed(resting(0.1)).spread()
    position = np.arange(2001) / 100.0 / PERIOD
    _, wide = placed(signal_of(-np.cos(2 * np.pi * (position - 0.4 * np.round(position / 8 % 1))))).spread()
    assert steady[1] - steady[0] < 0.05 and steady[0] <= 0.13 and steady[1] >= 0.08
    assert wide[1] - wide[0] > 0.3


def test_too_few_beats_for_a_cycle_are_an_error() -> None:
    refused("3 beats hold no whole cycle of 3", place_test, resting(), PLACED[:3], None, WALTZ)


def ranked(heights: dict[int, float]) -> PlaceTest:
    """One reading, one beat: its ranks are .5 at every lag but these (in 48ths of a beat)."""
    ranks = np.full((1, 1, MOMENTS), 0.5)
    for lag, height in heights.items():
        ranks[0, 0, lag % MOMENTS] = height
    return PlaceTest(REST, ranks, 0, 0.5)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("height", "lag"), [(0.889, 4), (0.887, 10), (0.9, 4)])
def test_three_hundredths_of_the_range_are_a_tie_and_the_nearest_lag_has_it(height: float, lag: int, side: int) -> None:
    # The range is .5 to .9: from .888 on a lag is as good as the best, 10.
    assert ranked({10 * side: 0.9, 4 * side: height}).lag == pytest.approx(lag * side / MOMENTS)


@pytest.mark.parametrize(("height", "lag"), [(0.889, 9.0), (0.887, 10.0)])
def test_neighbours_in_a_tie_are_a_plateau_with_the_lag_in_its_middle(height: float, lag: float) -> None:
    assert ranked({8: height, 9: height, 10: 0.9}).lag == pytest.approx(lag / MOMENTS)


TIMED = 0.3 + 0.5 * np.arange(60)


def timed_signal(values: FloatArray) -> ShapeSignal:
    times = np.arange(values.size) / 100.0
    inside = (times >= TIMED[0] - 1e-9) & (times <= TIMED[-1] + 1e-9)
    values = values[inside]
    return signal_of((values - values.mean()) / values.std(), times[inside])


def wave(tempo: float, phase: float = 0.0) -> FloatArray:
    """A movement of so many beats a minute, with its own noise."""
    times = np.arange(3200) / 100.0
    noise = gaussian_filter1d(np.random.default_rng(3).normal(size=times.size), 8)
    return np.cos(2 * np.pi * (times * tempo / 60 - phase)) + 3 * noise


def result(values: FloatArray) -> TimeTest:
    return time_test(timed_signal(values), TIMED)


@pytest.mark.parametrize("phase", [0.0, 0.2, 0.5, 0.9])
def test_movement_of_the_musics_tempo_is_in_time_at_any_phase(phase: float) -> None:
    test = result(wave(120.0, phase))
    assert (test.p_value, test.own_ratio) == (pytest.approx(1 / N_RATIOS), pytest.approx(1.0, abs=0.001))


@pytest.mark.parametrize("tempo", [95.0, 117.0, 122.0, 128.4, 150.0])
def test_movement_of_another_tempo_is_not_and_its_tempo_is_found(tempo: float) -> None:
    test = result(wave(tempo))
    assert test.p_value > 0.05
    assert 120 * test.own_ratio == pytest.approx(tempo, rel=0.002)


def test_the_rate_is_the_number_of_movements_a_beat() -> None:
    assert [result(wave(tempo)).rate for tempo in (60.0, 120.0, 240.0)] == [0.5, 1.0, 2.0]


def test_noise_has_p_values_as_small_as_chance_allows() -> None:
    rng = np.random.default_rng(7)
    p = [result(gaussian_filter1d(rng.normal(size=3200), 12)).p_value for _ in range(12)]
    assert np.mean(np.array(p) <= 0.05) < 0.2 and 0.3 < np.mean(p) < 0.7


def test_agreement_counts_different_blocks_only() -> None:
    # One huge movement in one block agrees with itself alone.
    values = gaussian_filter1d(np.random.default_rng(0).normal(size=3200), 8)
    values[800:1000] += 50 * np.cos(2 * np.pi * np.arange(200) / 50)
    assert result(values).own < 3


def test_with_too_few_blocks_there_is_no_evidence() -> None:
    test = time_test(timed_signal(wave(120.0)), np.append(TIMED[:8], TIMED[-1]), cycles=(3,))
    assert (test.own, test.p_value) == (-np.inf, 1.0)


def test_masked_samples_count_for_nothing() -> None:
    clean = timed_signal(wave(120.0))
    values, valid = clean.values.copy(), clean.valid.copy()
    values[500:520], valid[500:520] = 1e3, False
    masked = time_test(replace(clean, values=values, valid=valid), TIMED)
    assert masked.own == pytest.approx(time_test(clean, TIMED).own, rel=0.1)


@cases("amplitude, counts", (1.0, 1.0), (0.25, 1.0), (0.2, 0.2 / 0.22), (0.1, 0.1 / 0.21))
def test_a_block_counts_less_below_three_tenths_of_the_mean_spread(amplitude: float, counts: float) -> None:
    # Three blocks of four beats, the last moves so little. .3 of the mean is .225, .22 and .21 of the others' spread.
    times = np.arange(481) / 100.0
    values = np.cos(2 * np.pi * times / 0.4) * np.where(times < 3.2 - 1e-9, 1.0, amplitude)
    test = time_test(signal_of(values), 0.4 * np.arange(13), cycles=(1,))
    # Vectors of sizes 1, 1 and w over sqrt(2): (|sum|^2 - sum of squares) / 3^2.
    assert test.power[N_RATIOS // 2] == pytest.approx((2 + 4 * counts) / 18, rel=1e-6)


JOINTS = np.random.default_rng(1).normal(0.0, 0.5, (12, 3))
DANCE = synthetic_motion(np.arange(0.0, 8.5, 0.5), seconds=8.0, fps=30.0, seed=2)
RIG = ("Thumb", "Index", "Middle", "Ring", "Pinky")


def turned_by(body: FloatArray, angle: FloatArray) -> FloatArray:
    """(T, J, 3) positions of a body turned about the vertical by (T,) angles."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = np.moveaxis(np.broadcast_to(body, (angle.size, *body.shape[-2:])), -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def moving(positions: FloatArray, fps: float = 30.0) -> Motion:
    return Motion(positions, fps, Skeleton.unnamed(positions.shape[1]))


def numbers(motion: Motion) -> FloatArray:
    signal = shape_signal(shape_speed(motion))
    return np.array([*signal.values[::7], signal.pulse, signal.share, signal.joints])


@given(st.floats(15.0, 120.0), st.integers(0, 10_000))
def test_a_rigid_body_that_turns_and_travels_has_none(fps: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, way = np.cumsum(rng.normal(0, 0.1, 60)), np.cumsum(rng.normal(0, 0.05, (60, 1, 3)), axis=0)
    shape = shape_speed(moving(turned_by(JOINTS, angle) + way, fps))
    assert shape.speed.max() < 1e-9 * np.sqrt(shape.room.max())


def test_a_body_that_tumbles_has_next_to_none() -> None:
    assert shape_signal(shape_speed(moving(turned_by(JOINTS, np.linspace(0, 6, 120))[..., [1, 0, 2]]))).share < 0.02


@settings(max_examples=20)
@given(st.floats(0.01, 100.0), st.floats(-3.0, 3.0), st.integers(0, 1000))
def test_scale_yaw_mirror_place_and_joint_order_change_no_number(scale: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = turned_by(DANCE.positions, np.full(DANCE.n_frames, yaw)) * [-scale, scale, scale] + rng.normal(0, 9, 3)
    other = moving(positions[:, rng.permutation(positions.shape[1])])
    np.testing.assert_allclose(numbers(other), numbers(DANCE), rtol=1e-6, atol=1e-6)


def test_it_is_the_speed_of_the_joints_around_their_mean_when_nothing_turns() -> None:
    swing = np.sin(2 * np.pi * np.arange(300) / 100)
    positions = np.tile(np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]), (300, 1, 1))
    positions[:, 2:, 1] *= (1 + 0.1 * swing)[:, None]  # two joints breathe in and out
    shape = shape_speed(moving(positions, 100.0), smoothing=0.0)
    expected = np.abs(np.gradient(0.1 * swing, 0.01)) * np.sqrt(2 / 4)
    np.testing.assert_allclose(shape.speed[5:-5], expected[5:-5], atol=1e-9)


@cases(
    "joints, names, counted",
    (21, [f"mixamorig:{side}Hand{finger}{i}" for side in ("Left", "Right") for finger in RIG for i in (1, 2, 3)], 21),
    (21, ["left_index", "left_pinky", "left_thumb", "right_index", "right_pinky", "right_thumb"], 27),  # as MediaPipe
    (8, [f"left_{finger.lower()}_{place}" for finger in RIG for place in (1, 2, 3, 4)], 28),  # a player's arms
)
def test_the_fingers_of_a_rig_do_not_outvote_the_body(joints: int, names: list[str], counted: int) -> None:
    body = Motion(DANCE.positions[:, :joints], DANCE.fps, Skeleton.unnamed(joints))
    wriggling = np.random.default_rng(0).normal(0, 0.02, (DANCE.n_frames, len(names), 3)).cumsum(axis=0)
    skeleton = Skeleton((*body.skeleton.joints, *names), (-1,) * (joints + len(names)))
    shape = shape_speed(Motion(np.concatenate([body.positions, wriggling], axis=1), DANCE.fps, skeleton))
    assert shape.energy.shape[1] == counted
    assert (counted == joints) == np.array_equal(shape.speed, shape_speed(body).speed)


def test_a_frozen_pose_on_a_dancers_path_loses_what_the_dancer_keeps() -> None:
    angle = np.linspace(0, 9, DANCE.n_frames)
    statue = moving(turned_by(DANCE.positions[:1], angle) + DANCE.positions.mean(axis=1, keepdims=True))
    assert shape_signal(shape_speed(statue)).share < 1e-9
    assert shape_signal(shape_speed(DANCE)).share > 0.4


def test_the_share_of_joints_that_move_is_one_in_all_for_one_joint() -> None:
    positions = np.tile(JOINTS, (300, 1, 1))
    positions[:, 0] += 0.02 * np.random.default_rng(0).normal(size=(300, 3)).cumsum(axis=0)
    assert 1 / 12 < shape_signal(shape_speed(moving(positions))).joints < 0.15


def test_pan_roll_zoom_and_shear_of_a_camera_move_no_picture_of_a_still_body() -> None:
    flat = JOINTS[:, :2]
    time = np.arange(90)[:, None, None] / 30
    matrix = np.array([[1.0, 0.3], [-0.2, 1.1]]) * (1 + 0.2 * np.sin(time)) + np.array([[0, 1], [-1, 0]]) * 0.3 * time
    shape = shape_speed(moving(np.einsum("jd,tde->tje", flat, matrix) + 2 * time))
    assert shape.dimensions == 2 and shape.speed.max() < 1e-2 * np.sqrt(shape.room.max())


def test_two_points_have_no_shape_and_keep_their_speed_in_the_room() -> None:
    shape = shape_speed(moving(DANCE.positions[:, :2]))
    assert shape.dimensions == 0
    np.testing.assert_allclose(shape.speed, np.sqrt(shape.room))


def test_a_line_of_joints_and_joints_in_one_place_have_finite_numbers() -> None:
    wave = np.sin(np.arange(60) / 5)[:, None, None] * np.array([0.0, 0.1, 0.0])
    for body in (np.linspace(0, 1, 5)[:, None] * np.ones(3), np.zeros((5, 3))):
        assert np.isfinite(numbers(moving(body + wave))).all()


def test_nothing_outside_the_span_has_a_part_in_the_signal() -> None:
    still = np.concatenate([DANCE.positions, np.tile(DANCE.positions[-1], (900, 1, 1))])
    resting_after = replace(DANCE, positions=still, valid=None)
    alone, before_rest = (shape_signal(shape_speed(each), 1.0, 7.0) for each in (DANCE, resting_after))
    np.testing.assert_allclose(before_rest.values, alone.values, atol=1e-9)
    assert before_rest.pulse == pytest.approx(alone.pulse)


def test_frames_that_are_filler_count_for_nothing() -> None:
    valid = np.ones(DANCE.n_frames, bool)
    valid[100:110] = False
    jumped = DANCE.positions.copy()
    jumped[100:110] *= 3
    signal = shape_signal(shape_speed(replace(DANCE, positions=jumped, valid=valid)))
    assert not signal.valid[(signal.times > 3.4) & (signal.times < 3.6)].any()
    assert abs(signal.values[signal.valid].mean()) < 1e-12


@pytest.mark.parametrize("axes", [3, 2])
@pytest.mark.parametrize("measure", [HarmonyParams.recommended, HarmonyParams.paper, HarmonyParams.valleys])
def test_frames_that_were_lost_and_are_zero_change_no_score(measure: Callable[[], HarmonyParams], axes: int) -> None:
    # A tracker lost the dancer for the first and last half second, and for a third of a second between.
    moments, lines = np.arange(240), 300 * DANCE.positions[..., :axes] + 200.0
    valid = (moments >= 15) & (moments < 225) & ~((moments >= 100) & (moments < 110))
    lines[:15], lines[225:], lines[99:111] = lines[15], lines[224], np.linspace(lines[99], lines[110], 12)
    music = track(np.arange(0.0, 8.0, 0.5), duration=8.0)
    bridged, zeros = (
        score_motion(music, Motion(each, 30.0, DANCE.skeleton, valid), params=measure())
        for each in (lines, np.where(valid[:, None, None], lines, 0.0))
    )
    np.testing.assert_allclose(zeros.visual.times, bridged.visual.times, atol=1e-6)
    for name in ("harmony", "chance", "place_harmony", "shares"):
        np.testing.assert_allclose(getattr(zeros, name), getattr(bridged, name), atol=1e-6)


def test_a_span_without_movement_is_all_zero() -> None:
    signal = shape_signal(shape_speed(DANCE), 90.0, 91.0)
    assert (signal.values.size, signal.pulse) == (0, 0.0) and np.isnan(signal.share)


def rigid(turn: FloatArray, body: FloatArray) -> Motion:
    """A body (J, d) seen through matrices (T, d, d), one a frame, a hundred frames a second."""
    return moving(np.einsum("tde,je->tjd", turn, body), 100.0)


def test_the_ridge_leaves_three_millionths_of_a_round_body_that_tumbles() -> None:
    # Six joints on the axes: (2/3 + 2 R) trace w = 2/3 trace w0, so 3 R of the rotation is left, with R = 1e-6.
    angle = 0.01 * np.arange(100)
    turn = np.tile(np.eye(3), (100, 1, 1))
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 2, 1], turn[:, 1, 2] = np.sin(angle), -np.sin(angle)
    shape = shape_speed(rigid(turn, np.concatenate([np.eye(3), -np.eye(3)])), smoothing=0.0)
    np.testing.assert_allclose((shape.speed / np.sqrt(shape.room))[1:-1], 3e-6, rtol=1e-3)


def test_the_ridge_leaves_two_millionths_of_a_round_picture_that_is_zoomed() -> None:
    # Four joints on the axes: (1/2 + R) trace A = 1/2 trace A0.
    zoom = (1 + 0.01 * np.arange(100))[:, None, None] * np.eye(2)
    shape = shape_speed(rigid(zoom, np.concatenate([np.eye(2), -np.eye(2)])), smoothing=0.0)
    np.testing.assert_allclose((shape.speed / np.sqrt(shape.room))[1:-1], 2e-6, rtol=1e-3)


HALVED = np.pi / np.sqrt(0.5 * np.log(2))  # seconds: half of a wave of this period is within the SD of one second


@pytest.mark.parametrize(("period", "left"), [(HALVED, 1 / 2), (HALVED / 2, 15 / 16), (2 * HALVED, 1 - 2**-0.25)])
def test_a_gaussian_of_one_second_is_the_drift_that_is_taken_off(period: float, left: float) -> None:
    # It keeps exp(-2 (pi SD / period)^2) of a wave.
    fps, count = 10.0, round(200 * period * 10)
    speed = 2 + np.sqrt(2) * np.sin(2 * np.pi * np.arange(count) / fps / period)  # SD 1
    ones, valid = np.ones(count), np.ones(count, bool)
    signal = shape_signal(ShapeSpeed(fps, speed, ones[:, None], ones, ones, valid, 3))
    assert signal.pulse == pytest.approx(left, rel=0.01)


def test_a_bar_of_another_length_or_a_missed_beat_does_not_move_the_bars_of_a_dance():
    places, fours = np.arange(60) % 3, np.arange(24) % 4
    assert [bar_pattern.first_place(np.r_[fours[first:], np.arange(5), fours]) for first in range(4)] == [0, 1, 2, 3]
    short, missed = np.r_[places[:2], places], np.delete(places, 7)
    assert [bar_pattern.first_place(one) for one in (places, places[1:], short)] == [0, 1, 1]
    assert bar_pattern.first_place(missed) == 1  # as most beats say, which come after it
