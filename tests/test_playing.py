"""Do the hands meet the sound? Strikes, turns of a bow and onsets where they were planted, their score, findings."""

import html
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.data.synthetic.music import Mixer, tone
from harmolab.musician.events import (
    bow_turns,
    hand_onsets,
    note_beats,
    onset_beats,
    playing_events,
    playing_hands,
    playing_score,
    strikes,
)
from harmolab.musician.explain import explain_playing, playing_findings
from harmolab.musician.page import playing_page, playing_player, save_playing_page
from harmolab.musician.performances import Performance
from harmolab.musician.synthetic import PlantedPerformance, planted_performance
from harmolab.params import HarmonyParams
from harmolab.readers.player_points import FINGERS, HANDS_12, PLAYER_50, SIDES, fingertips, hand_joints, player_skeleton
from harmolab.score import hit_pairs
from harmolab.types import Audio, BeatTrack, FloatArray, Motion, Notes
from tests.builders import refused, still

SECONDS, FPS = 20.0, 24.0
PALM = 40.0  # pixels from the wrist to the root of each finger
DIP = 0.35  # of a strike that its whole hand goes down
STROKE = 0.09  # seconds down, and up again


# Small players of our own: whatever they do was written down here


def random_notes(seed: int, *, seconds: float = SECONDS, rate: float = 2.0) -> Notes:
    """Notes of both hands at moments that keep no tempo, 0.2 s apart in each hand and neither at the ends."""
    rng = np.random.default_rng(seed)
    onsets, hands = [], []
    for hand in range(2):
        steps = rng.exponential(1 / rate, 1000) + 0.2
        times = 0.5 + np.cumsum(steps)
        times = times[times < seconds - 0.5]
        onsets += times.tolist()
        hands += [hand] * times.size
    order = np.argsort(onsets)
    times = np.array(onsets)[order]
    loudness = rng.uniform(0.3, 1.0, times.size)
    return Notes(times, times + 0.15, rng.integers(40, 80, times.size), loudness, np.array(hands)[order])


def planted_hands(
    notes: Notes, *, fps: float = FPS, seconds: float = SECONDS, noise: float = 0.0, late: float = 0.0, seed: int = 0
) -> Motion:
    """A pianist whose finger (note number modulo five) is lowest exactly at each onset, 4 to 12 pixels by loudness."""
    times = np.arange(round(seconds * fps)) / fps
    points = np.zeros((times.size, 50, 2))
    rng = np.random.default_rng(seed)
    for number, side in enumerate(SIDES):
        depths = np.zeros((5, times.size))
        for count, note in enumerate(np.flatnonzero(notes.hands == number)):
            distance = np.abs(times - notes.onsets[note] - late) / STROKE
            pulse = np.where(distance < 1, 0.5 + 0.5 * np.cos(np.pi * distance), 0.0)
            depths[count % 5] += (4 + 8 * notes.loudness[note]) * pulse
        points[:, joints(hand_joints(side))] = (200.0 + 240 * number, 300.0)
        for finger, name in enumerate(FINGERS):
            for place in range(1, 5):
                joint = PLAYER_50.joints.index(f"{side}_{name}_{place}")
                points[:, joint] += (10.0 * finger, PALM + 8 * (place - 1))
                points[:, joint, 1] += (1 - DIP) * depths[finger] * (place - 1) / 3
        points[:, joints(hand_joints(side)), 1] += DIP * depths.sum(axis=0)[:, None]
    body = {"shoulder": (60.0, 100.0), "elbow": (80.0, 200.0), "wrist": (60.0, 300.0), "hip": (40.0, 300.0)}
    for name, (x, y) in body.items():
        for number, side in enumerate(SIDES):
            points[:, PLAYER_50.joints.index(f"{side}_{name}")] = (320 + (2 * number - 1) * x, y)
    return Motion(points + noise * rng.standard_normal(points.shape), fps, PLAYER_50)


def joints(names: tuple[str, ...]) -> list[int]:
    return [PLAYER_50.joints.index(name) for name in names]


def planted_bow(turns: FloatArray, *, tilts: float = 0.0, seconds: float = SECONDS, seed: int = 0) -> Motion:
    """A violinist whose bow goes to and fro in straight strokes between `turns`; at each it changes string, in 0.08 s.

    The bridge stands a third of the way from the left shoulder to the left hand; `tilts` is the largest angle, radians.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * FPS)) / FPS
    place = np.interp(times, turns, np.where(np.arange(turns.size) % 2, 100.0, 180.0))
    angles = tilts * rng.uniform(-1, 1, turns.size)
    knots = np.stack([turns - 0.08, turns], axis=1).ravel()  # it goes over just before each turn
    angle = np.interp(times, knots, np.stack([np.roll(angles, 1), angles], axis=1).ravel())
    points = np.zeros((times.size, 50, 2))
    points[:, joints(hand_joints("left"))] = (430.0, 150.0)
    points[:, joints(("left_shoulder",))] = (400.0, 150.0)
    bridge = np.array([410.0, 150.0])
    grip = bridge + place[:, None] * np.stack([-np.cos(0.5 + angle), np.sin(0.5 + angle)], axis=1)
    points[:, joints(hand_joints("right"))] = grip[:, None]
    return Motion(points, FPS, PLAYER_50)


@cache
def players(instrument: str) -> list[PlantedPerformance]:
    return [planted_performance(instrument, seed=seed, faults=False, sample_rate=8000) for seed in range(1, 7)]


def clean(planted: PlantedPerformance) -> Motion:
    return replace(planted.performance.motion, positions=planted.clean)


def share_near(times: FloatArray, targets: FloatArray, delay: float) -> float:
    return float((hit_pairs(times, targets, delay=delay, matching="max") >= 0).mean())


# Onsets


def test_notes_of_a_chord_are_one_onset_at_their_mean_weighted_by_loudness():
    notes = Notes([1.0, 1.03, 1.05, 2.0], [2.0, 2.0, 2.0, 3.0], [60, 64, 67, 72], [0.9, 0.3, 0.6, 0.5])
    onsets = note_beats(notes, 5.0)
    np.testing.assert_allclose(onsets.times, [(0.9 * 1.0 + 0.3 * 1.03) / 1.2, 1.05, 2.0])
    np.testing.assert_allclose(onsets.strengths, [0.9, 0.6, 0.5])
    np.testing.assert_allclose(note_beats(notes, 5.0, merge=0.05).strengths, [0.9, 0.5])


def test_silent_notes_and_notes_after_the_end_are_no_onsets():
    notes = Notes([1.0, 2.0, 9.0], [1.5, 2.5, 9.5], [60, 60, 60], [1.0, 0.0, 1.0])
    np.testing.assert_allclose(note_beats(notes, 5.0).times, [1.0])
    assert len(note_beats(Notes([], [], []), 5.0)) == 0


@pytest.mark.parametrize("rate", [22050, 44100])
def test_onsets_of_tones_lie_where_they_begin(rate: int):
    times = np.array([0.5, 0.83, 1.4, 1.62, 2.5, 3.1])
    mixer = Mixer(4.0, rate)
    for number, time in enumerate(times):
        mixer.add_note(time, tone(220 * 2 ** (number / 6), 0.6, rate, partials=(1.0, 0.5, 0.3), decay=0.3), 0.5, 0.4)
    np.testing.assert_allclose(onset_beats(Audio(mixer.mixed(), rate)).times, times, atol=0.012)


def test_vibrato_makes_no_onsets():
    rate = 44100
    t = np.arange(4 * rate) / rate
    pitch = 2 * np.pi * np.cumsum(440 * 2 ** (0.3 / 12 * np.sin(2 * np.pi * 5.5 * t))) / rate
    sound = sum(np.sin(k * pitch) / k for k in range(1, 6)) * np.minimum(np.maximum(t - 1.0, 0) / 0.05, 1)
    onsets = onset_beats(Audio(0.2 * sound, rate))
    assert onsets.times[0] == pytest.approx(1.0, abs=0.03)
    assert len(onsets) == 1


@pytest.mark.parametrize("rate", [100.0, 8000.0, 192000.0])
@pytest.mark.parametrize("size", [1, 300])
def test_silence_has_no_onsets_at_any_rate(rate: float, size: int):
    assert len(onset_beats(Audio(np.zeros(size), rate))) == 0


@pytest.mark.parametrize("instrument", ["piano", "violin"])
def test_onsets_of_planted_sound_are_its_notes(instrument: str):
    for seed in (1, 2):
        performance = planted_performance(instrument, seconds=15.0, seed=seed).performance
        notes, onsets = note_beats(performance.notes, 15.0), onset_beats(performance.audio)
        assert share_near(notes.times, onsets.times, 0.05) == 1.0
        assert share_near(onsets.times, notes.times, 0.05) >= 0.8


# Strikes


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
def test_strikes_lie_where_they_were_planted_at_any_frame_rate(fps: float):
    notes = random_notes(1)
    times, onsets = strikes(planted_hands(notes, fps=fps)).times, note_beats(notes, SECONDS).times
    assert times.size == onsets.size
    np.testing.assert_allclose(times, onsets, atol=0.02)
    assert np.abs(times - onsets).mean() < 0.004


def test_noise_of_a_pixel_hides_hardly_a_strike_and_invents_few():
    for seed in range(4):
        notes = random_notes(seed)
        times, onsets = strikes(planted_hands(notes, noise=1.0, seed=seed)).times, note_beats(notes, SECONDS).times
        assert share_near(onsets, times, 0.03) >= 0.97
        assert times.size <= 1.2 * onsets.size


def test_each_hand_has_its_own_strikes():
    notes = random_notes(2)
    motion = planted_hands(notes)
    for side, own in hand_onsets(notes, SECONDS).items():
        np.testing.assert_allclose(strikes(motion, hand=side).times, own.times, atol=0.02)


def test_wrists_and_fingertips_alone_are_enough():
    notes = random_notes(3)
    few = Motion(planted_hands(notes).positions[:, joints(HANDS_12.joints)], FPS, HANDS_12)
    np.testing.assert_allclose(strikes(few).times, note_beats(notes, SECONDS).times, atol=0.02)


def test_a_player_in_space_has_y_up():
    motion = planted_hands(random_notes(4))
    upright = np.concatenate([motion.positions * (1, -1), np.zeros((motion.n_frames, 50, 1))], axis=2)
    np.testing.assert_allclose(strikes(replace(motion, positions=upright)).times, strikes(motion).times)


def test_a_movement_of_less_than_three_hundredths_of_the_palm_is_no_strike():
    depth = np.zeros(100)
    depth[[25, 50, 75]] = [0.5 * 0.03 * PALM, 1.5 * 0.03 * PALM, 0.5 * 0.03 * PALM]
    motion = planted_hands(Notes([], [], []), seconds=100 / FPS)
    points = motion.positions.copy()
    points[:, fingertips(PLAYER_50, "left")[1], 1] += np.convolve(depth, [0.5, 1, 0.5], "same")
    motion = replace(motion, positions=points)
    np.testing.assert_allclose(strikes(motion).times, [50 / FPS], atol=1e-6)
    assert len(strikes(motion, prominence=0.1 * 0.03 * PALM)) == 3


def test_frames_that_are_not_valid_make_no_strikes():
    notes = random_notes(5)
    motion = planted_hands(notes)
    valid = np.ones(motion.n_frames, bool)
    valid[100:110] = valid[300:302] = False
    points = motion.positions.copy()
    points[~valid] = 0.0
    times = strikes(replace(motion, positions=points, valid=valid)).times
    onsets = note_beats(notes, SECONDS).times
    near = np.abs(onsets[:, None] - np.flatnonzero(~valid) / FPS).min(axis=1) < 2 * STROKE
    assert near.sum() == 2
    assert share_near(times, onsets, 0.03) == 1.0
    assert share_near(onsets[~near], times, 0.03) == 1.0
    assert len(strikes(replace(motion, valid=np.zeros(motion.n_frames, bool)))) == 0


def test_hands_that_rest_do_not_strike():
    assert len(strikes(planted_hands(Notes([], [], [])))) == 0
    assert len(strikes(Motion(np.zeros((2, 50, 2)), FPS, PLAYER_50))) == 0


def test_a_motion_without_hands_or_another_hand_is_refused_by_name():
    refused(r"strikes need the wrist and fingertips of a hand.*left_index_4", strikes, still(30, fps=FPS, axes=2))
    left = player_skeleton(hand_joints("left"))
    motion = Motion(np.zeros((30, 21, 2)), FPS, left)
    assert playing_hands(motion) == ("left",)
    refused("of the right hand", strikes, motion, hand="right")
    refused("hand must be left or right, got 'both'", strikes, motion, hand="both")
    refused("instrument must be piano or violin, got 'oboe'", playing_events, motion, "oboe")


# Turns of a bow

TURNS = np.array([1.0, 1.6, 2.1, 3.4, 4.0, 4.9, 5.3, 6.6, 7.4, 8.1, 9.5, 10.2, 11.3, 12.0, 13.1, 14.6, 15.5, 17.0])


def test_turns_of_the_bow_lie_where_they_were_planted():
    times = bow_turns(planted_bow(TURNS)).times
    np.testing.assert_allclose(times, TURNS[1:-1], atol=0.02)  # before the first and after the last it rests


def test_distance_from_the_bridge_sees_through_changes_of_string_and_the_main_direction_does_not():
    motion = planted_bow(TURNS, tilts=0.6)
    assert share_near(TURNS[1:-1], bow_turns(motion).times, 0.03) == 1.0
    assert share_near(TURNS[1:-1], bow_turns(motion, reading="direction").times, 0.03) < 0.8
    refused("reading must be distance or direction, got 'pca'", bow_turns, motion, reading="pca")


def test_main_direction_is_enough_on_one_string():
    np.testing.assert_allclose(bow_turns(planted_bow(TURNS), reading="direction").times, TURNS[1:-1], atol=0.02)


@pytest.mark.parametrize("left", [("left_shoulder",), ("left_wrist",), ("violin_bridge",)])
def test_any_point_on_the_left_stands_for_the_bridge(left: tuple[str, ...]):
    motion = planted_bow(TURNS)
    skeleton = player_skeleton((*left, "right_wrist"))
    points = np.stack([np.full((motion.n_frames, 2), (410.0, 150.0)), motion.positions[:, -1]], axis=1)
    np.testing.assert_allclose(bow_turns(Motion(points, FPS, skeleton)).times, TURNS[1:-1], atol=0.02)
    with pytest.raises(ValueError, match="turns of a bow need a point of the right hand, and left_shoulder"):
        bow_turns(Motion(points[:, :1], FPS, player_skeleton(left)))


# The score


def test_settings_of_playing_are_those_of_the_readings():
    params = HarmonyParams.playing()
    assert (params.reaction_delay, params.audio_threshold, params.visual_threshold) == (0.05, 0.0, None)


def test_planted_hands_meet_their_own_music_and_chance_meets_other_music():
    pieces = [random_notes(seed) for seed in range(5)]
    motions = [planted_hands(notes, noise=0.3) for notes in pieces]
    for notes, motion in zip(pieces, motions, strict=True):
        score = playing_score(motion, notes, "piano").score
        assert score.mean_share == pytest.approx(1.0, abs=0.01)
        assert score.chance == pytest.approx(0.1 * len(note_beats(notes, SECONDS)) / SECONDS, abs=0.1)
        assert score.p_value < 0.02
    other = [
        playing_score(motion, notes, "piano", n_rotations=0).score.harmony_above_chance
        for i, notes in enumerate(pieces)
        for j, motion in enumerate(motions)
        if i != j
    ]
    assert abs(np.mean(other)) <= 0.1


def test_a_strike_of_the_wrong_hand_counts_for_the_whole_and_not_for_the_hand():
    notes = random_notes(6)
    crossed = Notes(notes.onsets, notes.offsets, notes.pitches, notes.loudness, 1 - notes.hands)
    score = playing_score(planted_hands(crossed), notes, "piano")
    assert score.score.mean_share == pytest.approx(1.0, abs=1e-9)
    assert all(own.harmony_above_chance < 0.3 for own in score.hands.values())
    own = playing_score(planted_hands(notes), notes, "piano").hands
    assert [round(own[side].mean_share, 6) for side in SIDES] == [1.0, 1.0]


def test_notes_that_tell_no_hand_are_not_scored_by_hand():
    notes = random_notes(7)
    unknown = Notes(notes.onsets, notes.offsets, notes.pitches, notes.loudness)
    score = playing_score(planted_hands(notes), unknown, "piano")
    assert score.hands == {}
    assert set(score.events) == set(SIDES)
    onsets = note_beats(notes, SECONDS)
    assert playing_score(planted_hands(notes), onsets, "piano").score.mean_share == score.score.mean_share


@pytest.mark.parametrize("late", [0.12, -0.2])
def test_a_lag_beyond_the_tolerance_is_found_and_is_no_harmony(late: float):
    notes = random_notes(8)
    score = playing_score(planted_hands(notes, late=late, noise=0.5), notes, "piano")
    assert score.score.harmony_above_chance < 0.3
    assert score.lag.seconds == pytest.approx(late, abs=0.01)
    assert score.lag.interval[0] <= score.lag.seconds <= score.lag.interval[1]
    assert score.lag.share > 0.95
    assert not score.is_together
    assert playing_findings(score).verdict == (
        f"The hands meet the sound {abs(1000 * score.lag.seconds):.0f} ms {'late' if late > 0 else 'early'}: "
        "picture and sound may begin apart."
    )


def test_a_lag_within_the_tolerance_is_told_to_the_millisecond():
    notes = random_notes(9)
    lag = playing_score(planted_hands(notes, late=0.03), notes, "piano").lag
    assert lag.seconds == pytest.approx(0.03, abs=0.003)


def test_hands_to_other_music_have_no_lag():
    lags = [playing_score(planted_hands(random_notes(s)), random_notes(s + 50), "piano").lag for s in range(6)]
    assert np.isnan([lag.seconds for lag in lags]).sum() >= 5


def test_silence_around_the_music_changes_nothing():
    notes = random_notes(10)
    other = planted_hands(random_notes(11))
    short = playing_score(other, notes, "piano").score
    late = Notes(notes.onsets + 10, notes.offsets + 10, notes.pitches, notes.loudness, notes.hands)
    padded = np.concatenate([other.positions[:1].repeat(240, axis=0), other.positions])
    long = playing_score(replace(other, positions=padded, valid=np.ones(len(padded), bool)), late, "piano").score
    assert long.chance == pytest.approx(short.chance, abs=0.01)
    assert long.harmony_above_chance == pytest.approx(short.harmony_above_chance, abs=0.02)
    np.testing.assert_allclose(long.music.times, short.music.times + 10)
    assert long.music.duration == SECONDS + 10


@pytest.mark.parametrize("instrument", ["piano", "violin"])
def test_no_notes_and_no_movement_score_nothing_and_break_nothing(instrument: str):
    motion = planted_hands(Notes([], [], []))
    for notes in (random_notes(1), Notes([], [], []), random_notes(1).select(np.arange(len(random_notes(1))) == 0)):
        score = playing_score(motion, notes, instrument)
        assert score.score.harmony_above_chance == 0.0
        assert np.isnan(score.lag.seconds)
        assert playing_findings(score).verdict.startswith("Cannot tell")
    assert playing_score(planted_hands(random_notes(1)), Notes([], [], []), "piano").score.harmony == 0.0


# The planted players


def test_planted_pianists_score_one_with_their_own_music():
    for planted in players("piano"):
        score = playing_score(clean(planted), planted.performance.notes, "piano")
        assert score.score.mean_share == pytest.approx(1.0, abs=1e-9)
        assert [own.mean_share for own in score.hands.values()] == pytest.approx([1.0, 1.0], abs=1e-9)
        assert 0.2 < score.score.chance < 0.5
        assert score.score.p_value < 0.05
        np.testing.assert_allclose(score.score.visual.times, planted.strikes.times, atol=0.02)
        # The score of a dance hardly sees a pianist: movements of the whole body end elsewhere.
        assert score.body.harmony_above_chance < 0.25


def test_noise_of_a_pixel_costs_planted_pianists_little():
    scores = [playing_score(p.performance.motion, p.performance.notes, "piano").score for p in players("piano")]
    assert np.mean([score.mean_share for score in scores]) >= 0.95
    assert all(score.p_value < 0.05 for score in scores)


def test_planted_violinists_turn_their_bows_at_the_onsets():
    scores = [playing_score(clean(p), p.performance.notes, "violin").score for p in players("violin")]
    assert np.mean([score.harmony_above_chance for score in scores]) >= 0.88
    assert all(score.p_value < 0.05 for score in scores)


@pytest.mark.parametrize("instrument", ["piano", "violin"])
def test_planted_players_score_nothing_with_other_music(instrument: str):
    pairs = [(p, q) for p in players(instrument) for q in players(instrument) if p is not q]
    scores = [playing_score(clean(p), q.performance.notes, instrument, n_rotations=0).score for p, q in pairs]
    assert abs(np.mean([score.harmony_above_chance for score in scores])) <= 0.1


def test_rejected_frames_take_the_false_strikes_of_faults_away():
    planted = planted_performance("piano", seed=4, noise=0.2, sample_rate=8000)
    motion = planted.performance.motion
    as_tracked, rejected = (
        strikes(replace(motion, valid=valid)).times for valid in (motion.valid, planted.fault == "")
    )
    onsets = planted.strikes.times
    assert share_near(rejected, onsets, 0.05) > share_near(as_tracked, onsets, 0.05)
    assert share_near(rejected, onsets, 0.05) > 0.97


# Where hands and sound part


def performance(notes: Notes | None, motion: Motion, **fields: object) -> Performance:
    return Performance("etude", "piano", None, motion, notes=notes, **fields)


def test_missed_onsets_strays_and_crossed_hands_are_listed_where_they_were_planted():
    played = random_notes(12)
    left, right = (np.flatnonzero(played.hands == hand) for hand in range(2))
    keep = np.ones(len(played), bool)
    keep[left[3]] = False  # sounds are expected, and no finger goes down
    added = Notes([10.03], [10.1], [60], [1.0], [1])  # a finger goes down, and nothing sounds
    while np.abs(played.onsets - added.onsets).min() < 0.2:
        added = Notes(added.onsets + 0.1, added.offsets + 0.1, [60], [1.0], [1])
    both = [np.concatenate([getattr(played.select(keep), name), getattr(added, name)]) for name in vars(played)]
    order = np.argsort(both[0])
    motion = planted_hands(Notes(*(values[order] for values in both)))
    words = playing_findings(playing_score(motion, played, "piano"))
    strays = [(parting.hand, parting.time) for parting in words.partings if parting.kind == "stray"]
    assert strays == [("right", pytest.approx(added.onsets[0], abs=0.02))]
    lost = [parting for parting in words.partings if parting.kind != "stray"]
    assert [(parting.hand, parting.time) for parting in lost] == [("left", pytest.approx(played.onsets[left[3]]))]
    near = np.abs(played.onsets[right] - played.onsets[left[3]]).min() <= 0.05
    assert lost[0].kind == ("other hand" if near else "missed")
    nearest = np.delete(played.onsets[left], 3) - played.onsets[left[3]]
    assert lost[0].distance == pytest.approx(nearest[np.abs(nearest).argmin()], abs=0.02)
    assert sum(stretch.strays for stretch in words.stretches) == 1
    assert sum(stretch.onsets for stretch in words.stretches) == len(note_beats(played, SECONDS))


def test_the_stretch_in_which_hands_stop_is_named():
    notes = random_notes(13)
    motion = planted_hands(notes.select((notes.onsets < 10) | (notes.onsets > 15)))
    words = playing_findings(playing_score(motion, notes, "piano"))
    assert [(s.start, s.end) for s in words.stretches] == [(0.0, 5.0), (5.0, 10.0), (10.0, 15.0), (15.0, 20.0)]
    count = words.stretches[2].onsets
    assert f"They part most from 10 to 15 s: 0 of {count} onsets are met." in words.sentences


def test_sentences_say_the_numbers_of_the_score():
    notes = random_notes(14)
    score = playing_score(planted_hands(notes), notes, "piano")
    words = playing_findings(score)
    onsets = note_beats(notes, SECONDS)
    assert words.verdict == f"The hands meet the sound: 100% of it, where {score.score.chance:.0%} would be chance."
    assert words.sentences[0].startswith(f"{len(onsets)} of {len(onsets)} onsets have a strike within 50 ms.")
    assert [finding.kind for finding in words.findings] == ["score", "hand", "hand", "lag", "body"]
    other = playing_findings(playing_score(planted_hands(random_notes(60)), random_notes(61), "piano"))
    assert other.verdict == "There is no evidence that these hands play this sound."
    assert [finding.kind for finding in other.findings if finding.kind in ("lag", "stretch")] == []


@pytest.mark.parametrize("offset", [0.0, 1.5, -2.25])
def test_offset_puts_notes_and_hands_on_one_time_line(offset: float):
    notes = random_notes(15)
    shifted = notes.select(notes.onsets + offset > 0.2)
    shifted = Notes(shifted.onsets + offset, shifted.offsets + offset, shifted.pitches, shifted.loudness, shifted.hands)
    playing = explain_playing(performance(shifted, planted_hands(notes), offset=offset))
    assert playing.score.score.mean_share == pytest.approx(1.0, abs=1e-9)
    assert playing.skipped == pytest.approx(max(0.0, -offset))
    json.dumps(playing.to_dict(), allow_nan=False)


def test_a_performance_without_notes_is_scored_by_the_onsets_of_its_sound():
    planted = planted_performance("piano", seed=2, faults=False, noise=0.0)
    by_sound = explain_playing(replace(planted.performance, notes=None))
    assert isinstance(by_sound.sound, BeatTrack)
    assert by_sound.score.score.mean_share >= 0.98
    assert by_sound.score.hands == {}


def test_a_performance_that_cannot_be_scored_is_refused_by_name():
    motion = planted_hands(random_notes(1))
    refused("etude: has neither notes nor sound", explain_playing, performance(None, motion))
    with pytest.raises(ValueError, match=r"etude: motion starting at 90\.00 s does not overlap"):
        explain_playing(Performance("etude", "piano", Audio(np.zeros(800), 100.0), motion, offset=90.0))
    body = Motion(motion.positions[:, :8], FPS, player_skeleton(PLAYER_50.joints[:8]))
    refused("etude: strikes need the wrist", explain_playing, performance(random_notes(1), body))


# The page


@pytest.fixture(scope="module")
def page() -> str:
    return playing_page(explain_playing(planted_performance("piano", seconds=12.0, seed=3).performance))


def test_page_holds_verdict_pictures_of_both_hands_player_and_doubts(page: str):
    playing = explain_playing(planted_performance("piano", seconds=12.0, seed=3).performance)
    text = html.unescape(page)
    assert playing.words.verdict in text
    assert all(sentence in text for sentence in playing.words.sentences)
    assert page.count("data:image/png;base64,") == 4
    assert "harmolabPlayer" in text
    assert "Synthetic player: a program planted these movements" in page
    assert "The sound was rendered from the notes" in page
    assert f"<td>{playing.words.stretches[0].hits} of {playing.words.stretches[0].onsets}</td>" in page


def test_page_asks_the_network_for_nothing_and_takes_names_for_text(page: str, tmp_path: Path):
    assert not re.search(r"https?:|<script|<link|@import|url\(", re.sub(r' srcdoc="[^"]*"', "", page))
    named = replace(performance(random_notes(1), planted_hands(random_notes(1))), name="<img src=x>")
    playing = explain_playing(named)
    save_playing_page(tmp_path / "page.html", playing)
    written = (tmp_path / "page.html").read_text("utf-8")
    assert "<img src=x>" not in written
    assert "There is no player: it needs sound" in written
    refused("has no sound to play", playing_player, playing)


# Recordings


@pytest.mark.data
def test_a_camera_above_the_keys_sees_no_strikes(data_root: Path, capsys: pytest.CaptureFixture[str]):
    """Printed, not judged: in these points, seen from above, no finger goes down."""
    path = data_root / "instruments" / "tracked" / "piano_top_view.npz"
    if not path.is_file():
        pytest.skip(f"no {path.name} in {path.parent}")
    file = np.load(path)
    points = np.concatenate([file["left_hand"], file["right_hand"]], axis=1).astype(float)
    frames = np.isfinite(points).all(axis=(1, 2))
    points[~frames] = 0.0
    motion = Motion(points, float(file["fps"]), player_skeleton(hand_joints("left") + hand_joints("right")), frames)
    rows = file["notes"][np.argsort(file["notes"][:, 0], kind="stable")].astype(float)
    rows = rows[rows[:, 0] >= 0]
    notes = Notes(rows[:, 0], rows[:, 1], rows[:, 2].astype(int), rows[:, 3] / 127)
    score = playing_score(motion, notes, "piano")
    with capsys.disabled():
        print(f"\ntop view, {len(notes)} notes: {score.to_dict()}")
    assert set(score.events) == set(SIDES)
    assert np.isfinite(score.score.harmony_above_chance)


def test_the_dance_score_beside_it_is_that_of_the_valleys_of_joint_speed():
    notes = random_notes(16)
    motion = planted_hands(notes)
    first, last = note_beats(notes, SECONDS).times[[0, -1]]
    valleys = visual_beats(motion, params=HarmonyParams.playing())
    inside = valleys.times[(valleys.times >= first - 0.05) & (valleys.times <= last + 0.05)]
    np.testing.assert_allclose(playing_score(motion, notes, "piano").body.visual.times, inside)
