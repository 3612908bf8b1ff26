"""Do the hands meet the sound? Strikes, turns of a bow and onsets where they were planted, their score, findings.

The planted pianist and violinist play what their notes say: every number here was planted or worked out by hand.
"""

import html
import itertools
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.data.synthetic.music import Mixer, tone
from harmolab.musician import events
from harmolab.musician import players as players_of
from harmolab.musician.events import note_beats, playing_score, strikes
from harmolab.musician.explain import ExplainedPlaying, explain_playing, playing_findings
from harmolab.musician.page import playing_page, playing_player, save_playing_page
from harmolab.musician.performances import Performance
from harmolab.musician.players import planted_piece, rendered_notes
from harmolab.musician.synthetic import FAULTS, PlantedPerformance, planted_performance, planted_performances
from harmolab.params import HarmonyParams
from harmolab.readers import player_points as names_of
from harmolab.readers.keypoints import filled_points
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, PLAYER_50, SIDES, hand_joints
from harmolab.score import hit_pairs
from harmolab.types import Audio, BeatTrack, FloatArray, Motion, Notes
from study.experiments.instrument_sets import load_tracked
from tests.builders import refused, still

SECONDS, FPS = 20.0, 24.0
RATE = 8000  # hertz: sound is not what most tests look at
PALM = 40.0  # pixels from the wrist to the root of each finger
DIP = 0.35  # of a strike that its whole hand goes down
STROKE = 0.09  # seconds down, and up again
EVERY_INSTRUMENT = pytest.mark.parametrize("instrument", INSTRUMENTS)
AT = {name: place for place, name in enumerate(PLAYER_50.joints)}
HANDS = {side: [AT[name] for name in hand_joints(side)] for side in SIDES}


# Small players of our own: whatever they do was written down here


def random_notes(seed: int, *, seconds: float = SECONDS, rate: float = 2.0) -> Notes:
    """Notes of both hands at moments that keep no tempo, 0.2 s apart in each hand and neither at the ends."""
    rng = np.random.default_rng(seed)
    onsets, hands = [], []
    for hand in range(2):
        times = 0.5 + np.cumsum(rng.exponential(1 / rate, 1000) + 0.2)
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
        points[:, HANDS[side]] = (200.0 + 240 * number, 300.0)
        for finger, name in enumerate(FINGERS):
            for place in range(1, 5):
                joint = AT[f"{side}_{name}_{place}"]
                points[:, joint] += (10.0 * finger, PALM + 8 * (place - 1))
                points[:, joint, 1] += (1 - DIP) * depths[finger] * (place - 1) / 3
        points[:, HANDS[side], 1] += DIP * depths.sum(axis=0)[:, None]
    return Motion(points + noise * rng.standard_normal(points.shape), fps, PLAYER_50)


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
    points[:, HANDS["left"]] = (430.0, 150.0)
    points[:, AT["left_shoulder"]] = (400.0, 150.0)
    grip = (410.0, 150.0) + place[:, None] * np.stack([-np.cos(0.5 + angle), np.sin(0.5 + angle)], axis=1)
    points[:, HANDS["right"]] = grip[:, None]
    return Motion(points, FPS, PLAYER_50)


@cache
def planted_player(instrument, seed=1, **settings):
    return planted_performance(instrument, seed=seed, sample_rate=RATE, **settings)


def players(instrument: str) -> list[PlantedPerformance]:
    return [planted_player(instrument, seed, faults=False) for seed in range(1, 5)]


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
    np.testing.assert_allclose(events.onset_beats(Audio(mixer.mixed(), rate)).times, times, atol=0.012)


def test_vibrato_makes_no_onsets():
    rate = 44100
    t = np.arange(4 * rate) / rate
    pitch = 2 * np.pi * np.cumsum(440 * 2 ** (0.3 / 12 * np.sin(2 * np.pi * 5.5 * t))) / rate
    sound = sum(np.sin(k * pitch) / k for k in range(1, 6)) * np.minimum(np.maximum(t - 1.0, 0) / 0.05, 1)
    assert events.onset_beats(Audio(0.2 * sound, rate)).times == pytest.approx([1.0], abs=0.03)


@pytest.mark.parametrize("rate", [100.0, 8000.0, 192000.0])
@pytest.mark.parametrize("size", [1, 300])
def test_silence_has_no_onsets_at_any_rate(rate: float, size: int):
    assert len(events.onset_beats(Audio(np.zeros(size), rate))) == 0


@EVERY_INSTRUMENT
def test_onsets_of_planted_sound_are_its_notes(instrument: str):
    performance = planted_performance(instrument, seconds=15.0, seed=1).performance
    notes, onsets = note_beats(performance.notes, 15.0), events.onset_beats(performance.audio)
    assert share_near(notes.times, onsets.times, 0.05) == 1.0
    assert share_near(onsets.times, notes.times, 0.05) >= 0.8


# Strikes


@pytest.mark.parametrize("fps", [24.0, 120.0])
def test_strikes_lie_where_they_were_planted_at_any_frame_rate(fps: float):
    notes = random_notes(1)
    times, onsets = strikes(planted_hands(notes, fps=fps)).times, note_beats(notes, SECONDS).times
    np.testing.assert_allclose(times, onsets, atol=0.02)
    assert np.abs(times - onsets).mean() < 0.004


def test_noise_of_a_pixel_hides_hardly_a_strike_and_invents_few():
    for seed in range(2):
        notes = random_notes(seed)
        times, onsets = strikes(planted_hands(notes, noise=1.0, seed=seed)).times, note_beats(notes, SECONDS).times
        assert share_near(onsets, times, 0.03) >= 0.97
        assert times.size <= 1.2 * onsets.size


@pytest.mark.parametrize("share", [0.3, 0.4])
def test_a_hand_that_is_hidden_for_a_while_makes_no_more_strikes(share: float):
    notes = random_notes(0)
    motion, hidden = planted_hands(notes, noise=1.0), np.arange(round(SECONDS * FPS)) % 120 < 120 * share
    detected = np.ones(motion.positions.shape[:2], bool)
    detected[np.ix_(hidden, HANDS["left"])] = False
    motion = replace(motion, positions=filled_points(motion.positions, detected, PLAYER_50))
    score = explain_playing(performance(notes, motion, detected=detected)).score
    onsets = events.hand_onsets(notes, SECONDS)["left"].times
    in_view = onsets[~hidden[(onsets * FPS).astype(int)]]
    corners = 2 * np.count_nonzero(np.diff(hidden.astype(int)) == 1)  # where a line over a gap begins and ends
    assert 0.8 * in_view.size <= len(score.events["left"]) <= in_view.size + corners
    as_numbers, as_bools = (strikes(motion, detected=mask).times for mask in (detected.astype(int), detected))
    np.testing.assert_array_equal(as_numbers, as_bools)


def test_each_hand_has_its_own_strikes_for_which_wrists_and_fingertips_are_enough():
    notes = random_notes(2)
    motion = planted_hands(notes)
    few = Motion(motion.positions[:, [AT[name] for name in names_of.HANDS_12.joints]], FPS, names_of.HANDS_12)
    for side, own in events.hand_onsets(notes, SECONDS).items():
        for points in (motion, few):
            np.testing.assert_allclose(strikes(points, hand=side).times, own.times, atol=0.02)


def test_a_player_in_space_has_y_up():
    motion = planted_hands(random_notes(4))
    upright = np.concatenate([motion.positions * (1, -1), np.zeros((motion.n_frames, 50, 1))], axis=2)
    np.testing.assert_allclose(strikes(replace(motion, positions=upright)).times, strikes(motion).times)


def test_a_movement_of_less_than_three_hundredths_of_the_palm_is_no_strike():
    depth = np.zeros(100)
    depth[[25, 50, 75]] = [0.5 * 0.03 * PALM, 1.5 * 0.03 * PALM, 0.5 * 0.03 * PALM]
    motion = planted_hands(Notes([], [], []), seconds=100 / FPS)
    points = motion.positions.copy()
    points[:, names_of.fingertips(PLAYER_50, "left")[1], 1] += np.convolve(depth, [0.5, 1, 0.5], "same")
    motion = replace(motion, positions=points)
    np.testing.assert_allclose(strikes(motion).times, [50 / FPS], atol=1e-6)


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
    shares = share_near(times, onsets, 0.03), share_near(onsets[~near], times, 0.03)
    assert (near.sum(), *shares) == (2, 1.0, 1.0)
    for none in (replace(motion, valid=np.zeros(motion.n_frames, bool)), Motion(np.zeros((2, 50, 2)), FPS, PLAYER_50)):
        assert len(strikes(none)) == 0


def test_a_motion_without_hands_or_another_hand_is_refused_by_name():
    refused(r"strikes need the wrist and fingertips of a hand.*left_index_4", strikes, still(30, fps=FPS, axes=2))
    motion = Motion(np.zeros((30, 21, 2)), FPS, names_of.player_skeleton(hand_joints("left")))
    assert events.playing_hands(motion) == ("left",)
    refused("of the right hand", strikes, motion, hand="right")
    refused("hand must be left or right, got 'both'", strikes, motion, hand="both")
    frames, joints = motion.positions.shape[:2]
    for wrong in (np.ones((frames, joints + 1), bool), np.ones((frames - 1, joints), bool), np.ones(frames, bool)):
        refused("detected must be .* frames and joints of the motion, got", strikes, motion, detected=wrong)
    for call in (strikes, events.bow_turns, events.onset_beats):
        refused("a harmolab.(Motion|Audio) is needed, got NoneType", call, None)
    refused("instrument must be piano or violin, got 'oboe'", events.playing_events, motion, "oboe")


# Turns of a bow

TURNS = np.array([1.0, 1.6, 2.1, 3.4, 4.0, 4.9, 5.3, 6.6, 7.4, 8.1, 9.5, 10.2, 11.3, 12.0, 13.1, 14.6, 15.5, 17.0])


def test_turns_of_the_bow_lie_where_they_were_planted():
    for reading in ("distance", "direction"):  # one string; before the first and after the last it rests
        np.testing.assert_allclose(events.bow_turns(planted_bow(TURNS), reading=reading).times, TURNS[1:-1], atol=0.02)


def test_distance_from_the_bridge_sees_through_changes_of_string_and_the_main_direction_does_not():
    motion = planted_bow(TURNS, tilts=0.6)
    assert share_near(TURNS[1:-1], events.bow_turns(motion).times, 0.03) == 1.0
    assert share_near(TURNS[1:-1], events.bow_turns(motion, reading="direction").times, 0.03) < 0.8
    refused("reading must be distance or direction, got 'pca'", events.bow_turns, motion, reading="pca")


@pytest.mark.parametrize("left", [("left_shoulder",), ("left_wrist",), ("violin_bridge",)])
def test_any_point_on_the_left_stands_for_the_bridge(left: tuple[str, ...]):
    motion = planted_bow(TURNS)
    skeleton = names_of.player_skeleton((*left, "right_wrist"))
    points = np.stack([np.full((motion.n_frames, 2), (410.0, 150.0)), motion.positions[:, -1]], axis=1)
    np.testing.assert_allclose(events.bow_turns(Motion(points, FPS, skeleton)).times, TURNS[1:-1], atol=0.02)
    alone = Motion(points[:, :1], FPS, names_of.player_skeleton(left))
    refused("turns of a bow need a point of the right hand, and left_shoulder", events.bow_turns, alone)


# The score


def test_settings_of_playing_are_those_of_the_readings():
    params = HarmonyParams.playing()
    assert (params.reaction_delay, params.audio_threshold, params.visual_threshold) == (0.05, 0.0, None)


def test_a_strike_of_the_wrong_hand_counts_for_the_whole_and_not_for_the_hand():
    notes = random_notes(6)
    crossed = Notes(notes.onsets, notes.offsets, notes.pitches, notes.loudness, 1 - notes.hands)
    score = playing_score(planted_hands(crossed), notes, "piano")
    assert score.score.mean_share == pytest.approx(1.0, abs=1e-9)
    assert all(own.harmony_above_chance < 0.3 for own in score.hands.values())
    own = playing_score(planted_hands(notes), notes, "piano")
    assert [round(own.hands[side].mean_share, 6) for side in SIDES] == [1.0, 1.0]
    assert own.score.chance == pytest.approx(0.1 * len(note_beats(notes, SECONDS)) / SECONDS, abs=0.1)


def test_notes_that_tell_no_hand_are_not_scored_by_hand():
    notes = random_notes(7)
    unknown = Notes(notes.onsets, notes.offsets, notes.pitches, notes.loudness)
    score = playing_score(planted_hands(notes), unknown, "piano")
    assert (score.hands, set(score.events)) == ({}, set(SIDES))
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
        "picture and sound may not begin together."
    )


def test_hands_to_other_music_have_no_lag():
    lags = [playing_score(planted_hands(random_notes(s)), random_notes(s + 50), "piano").lag for s in range(3)]
    assert np.isnan([lag.seconds for lag in lags]).sum() >= 2
    notes = random_notes(9)  # a lag within the tolerance is told to the millisecond
    assert playing_score(planted_hands(notes, late=0.03), notes, "piano").lag.seconds == pytest.approx(0.03, abs=0.003)


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


@EVERY_INSTRUMENT
def test_no_notes_and_no_movement_score_nothing_and_break_nothing(instrument: str):
    motion = planted_hands(Notes([], [], []))
    for notes in (random_notes(1), Notes([], [], []), random_notes(1).select(np.arange(len(random_notes(1))) == 0)):
        score = playing_score(motion, notes, instrument)
        np.testing.assert_equal((score.score.harmony_above_chance, score.lag.seconds), (0.0, np.nan))
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


def test_planted_violinists_turn_their_bows_at_the_onsets():
    scores = [playing_score(clean(p), p.performance.notes, "violin").score for p in players("violin")]
    assert np.mean([score.harmony_above_chance for score in scores]) >= 0.88
    assert all(score.p_value < 0.05 for score in scores)


@EVERY_INSTRUMENT
def test_planted_players_score_nothing_with_other_music(instrument: str):
    pairs = itertools.permutations(players(instrument), 2)
    scores = [playing_score(clean(p), q.performance.notes, instrument, n_rotations=0).score for p, q in pairs]
    assert abs(np.mean([score.harmony_above_chance for score in scores])) <= 0.1


def test_rejected_frames_take_the_false_strikes_of_faults_away():
    planted = planted_player("piano", 4, noise=0.2)
    motion = planted.performance.motion
    read = strikes(motion), strikes(replace(motion, valid=planted.fault == ""))
    as_tracked, rejected = (share_near(each.times, planted.strikes.times, 0.05) for each in read)
    assert rejected > as_tracked
    assert rejected > 0.97


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
    assert f"The hands meet least from 10 to 15 s: 0 of {words.stretches[2].onsets} onsets are met." in words.sentences


def test_sentences_say_the_numbers_of_the_score():
    notes = random_notes(14)
    score = playing_score(planted_hands(notes), notes, "piano")
    words = playing_findings(score)
    onsets = note_beats(notes, SECONDS)
    assert words.verdict == f"The hands meet the sound: 100% of it, where {score.score.chance:.0%} would be chance."
    assert words.sentences[0].startswith(f"{len(onsets)} of {len(onsets)} onsets have a strike within 50 ms.")
    assert [finding.kind for finding in words.findings] == ["score", "hand", "hand", "lag", "body"]
    late = playing_score(planted_hands(notes), notes.select(notes.onsets > 15), "piano")  # fingers move before, too
    for side, sentence in zip(SIDES, playing_findings(late).sentences[1:3], strict=True):
        strays, every = re.search(r"(\d+) of its (\d+) strikes", sentence).groups()
        assert int(every) == len(strikes(planted_hands(notes), hand=side)) > int(strays)
    other = playing_findings(playing_score(planted_hands(random_notes(60)), random_notes(61), "piano"))
    assert other.verdict == "There is no evidence that these hands play this sound."
    assert not {"lag", "stretch"} & {finding.kind for finding in other.findings}


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
    assert isinstance(by_sound.sound, BeatTrack) and by_sound.score.hands == {}
    assert by_sound.score.score.mean_share >= 0.98


def test_notes_that_are_not_those_of_the_sound_make_the_verdict():
    own, other = (planted_performance("piano", seconds=12.0, seed=seed).performance for seed in (3, 9))
    scale = Notes(np.arange(0.5, 11), np.arange(1.0, 12), 60 + np.arange(11))
    even = replace(own, notes=scale, audio=rendered_notes(scale, 12.0))  # shifted by a note, it fits as well
    assert [explain_playing(each).words.findings[0].kind for each in (own, even)] == ["score", "score"]
    late = replace(own.notes, onsets=own.notes.onsets + 0.2, offsets=own.notes.offsets + 0.2)
    for wrong in (replace(own, audio=other.audio), replace(own, notes=late)):
        playing = explain_playing(wrong)
        assert playing.words.findings[0].kind == "notes"
        assert playing.summary[0] in playing_page(playing)
        assert playing.summary[0].startswith("Cannot tell: the notes that came with this playing are not")


def test_a_performance_that_cannot_be_scored_is_refused_by_name():
    motion = planted_hands(random_notes(1))
    refused("etude: has neither notes nor sound", explain_playing, performance(None, motion))
    far = Performance("etude", "piano", Audio(np.zeros(800), 100.0), motion, offset=90.0)
    refused(r"etude: motion starting at 90\.00 s does not overlap", explain_playing, far)
    body = Motion(motion.positions[:, :8], FPS, names_of.player_skeleton(PLAYER_50.joints[:8]))
    refused("etude: strikes need the wrist", explain_playing, performance(random_notes(1), body))


# The page


@pytest.fixture(scope="module")
def explained() -> ExplainedPlaying:
    return explain_playing(planted_performance("piano", seconds=12.0, seed=3).performance)


@pytest.fixture(scope="module")
def page(explained: ExplainedPlaying) -> str:
    return playing_page(explained)


def test_page_holds_verdict_pictures_of_both_hands_player_and_doubts(explained: ExplainedPlaying, page: str):
    words, text = explained.words, html.unescape(page)
    for said in (words.verdict, *words.sentences, "harmolabPlayer"):
        assert said in text
    assert page.count("data:image/png;base64,") == 4
    assert "Synthetic player: a program planted these movements" in page
    assert "The sound was rendered from the notes" in page
    assert f"<td>{words.stretches[0].hits} of {words.stretches[0].onsets}</td>" in page


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
    tracked = load_tracked(path)
    score = playing_score(tracked.motion, tracked.notes, "piano")
    with capsys.disabled():
        print(f"\ntop view, {len(tracked.notes)} notes: {score.to_dict()}")
    assert set(score.events) == set(SIDES)
    assert np.isfinite(score.score.harmony_above_chance)


def test_the_dance_score_beside_it_is_that_of_the_valleys_of_joint_speed():
    notes = random_notes(16)
    motion = planted_hands(notes)
    first, last = note_beats(notes, SECONDS).times[[0, -1]]
    valleys = visual_beats(motion, params=HarmonyParams.playing())
    inside = valleys.times[(valleys.times >= first - 0.05) & (valleys.times <= last + 0.05)]
    np.testing.assert_allclose(playing_score(motion, notes, "piano").body.visual.times, inside)


# The planted players themselves


def own_points(planted):
    """(T, 50, 2) the clean points before the camera."""
    return planted.camera.inverse().apply(planted.clean)


def seen_alone(planted, part):
    """(T, 50, 2) points before the camera that move as the clean ones do beside those of a part."""
    own, other = (planted.camera.inverse().apply(points) for points in (planted.clean, part))
    return own - other


def spectrum_of(values, rate, finer=1):
    """Power and its frequencies."""
    size = finer * values.size
    return np.abs(np.fft.rfft(values, size)) ** 2, np.fft.rfftfreq(size, 1 / rate)


def root_mean_square(values):
    return float(np.sqrt(np.mean(np.square(values))))


# Movements on moments


def test_a_glide_arrives_at_its_onset_and_takes_the_time_it_has():
    onsets, values = np.array([1.0, 3.0, 3.1]), np.array([0.0, 10.0, 20.0])
    times = np.array([0.0, 1.0, 2.7, 2.8, 2.9, 3.0, 3.05, 3.1, 9.0])
    expected = [0, 0, 0, 0, 5, 10, 15, 20, 20]  # 0.2 s before the onset at 3, but only 0.1 s before that at 3.1
    np.testing.assert_allclose(players_of.glide(times, onsets, values, 0.2), expected, atol=1e-9)


def test_a_pulse_peaks_at_its_onset_and_lasts_its_radius_each_way():
    onset, channel, size = np.array([0.5]), np.array([1]), np.array([4.0])
    track = players_of.pulses(np.arange(10) / 10, onset, channel, size, n_channels=2, radius=0.2)
    np.testing.assert_allclose(track[:, 1], [0, 0, 0, 0, 2, 4, 2, 0, 0, 0], atol=1e-9)
    assert not track[:, 0].any()


# The pianist


def test_white_keys_are_ten_pixels_wide_and_black_ones_lie_between():
    assert players_of.key_x(np.array([21, 60, 61, 62, 64, 65, 72])).tolist() == [65, 295, 300, 305, 315, 325, 365]


def test_a_hand_moves_only_to_keys_more_than_two_white_keys_away():
    keys = np.array([100.0, 120.0, 125.0, 115.0, 80.0])
    places, fingers = players_of.hand_places(keys, 1.0)
    assert places.tolist() == [100, 100, 125, 125, 80]
    assert [FINGERS[finger] for finger in fingers] == ["middle", "little", "middle", "index", "middle"]
    assert [FINGERS[finger] for finger in players_of.hand_places(keys, -1.0)[1]][:2] == ["middle", "thumb"]


@pytest.mark.parametrize("seed", [1, 2])
def test_at_each_onset_a_fingertip_is_on_its_key_as_low_as_the_loudness_says_and_the_wrist_near_it(seed):
    planted = planted_player("piano", seed, fps=1000.0, seconds=12.0)
    points = own_points(planted)
    for number, side in enumerate(SIDES):
        notes = planted.performance.notes.select(planted.performance.notes.hands == number)
        _, fingers = players_of.hand_places(players_of.key_x(notes.pitches), (-1.0, 1.0)[number])
        tips = [AT[f"{side}_{FINGERS[finger]}_4"] for finger in fingers]
        frames, beside = np.round(notes.onsets * 1000).astype(int), points[:, AT[f"{side}_hand"]]
        np.testing.assert_array_equal(points[:, AT[f"{side}_wrist"]], beside)  # the body's wrist is the hand's
        np.testing.assert_allclose(points[frames, tips, 0], players_of.key_x(notes.pitches), atol=0.05)
        assert np.abs(beside[frames, 0] - players_of.key_x(notes.pitches)).max() <= 20.05
        dips = points[frames, tips, 1] - beside[frames, 1] - (points[0, tips, 1] - beside[0, 1])
        np.testing.assert_allclose(dips, 0.65 * (4 + 8 * notes.loudness), atol=0.02)  # the wrist does the other 35 %


def test_strikes_are_the_onsets_of_both_hands_and_as_loud():
    planted = planted_player("piano")
    notes = planted.performance.notes
    assert set(planted.strikes.times) == set(notes.onsets)
    first = notes.loudness[notes.onsets == notes.onsets[0]]
    assert (len(first), planted.strikes.strengths[0]) == (2, first.max())
    middles = [planted.clean[:, HANDS[side], 0].mean() for side in SIDES]
    assert middles[0] + 50 < middles[1]  # the left hand, on the low keys, at small x


def test_the_sway_of_the_torso_is_slow_and_leaves_the_hands_on_the_keys():
    planted = planted_player("piano", seconds=60.0)
    sway = seen_alone(planted, planted.from_audio)
    np.testing.assert_allclose(sway[:, HANDS["left"] + HANDS["right"]], 0.0, atol=1e-9)
    shoulder = sway[:, AT["left_shoulder"], 0]
    assert 8 < np.abs(shoulder).max() <= 12
    power, frequency = spectrum_of(shoulder * np.hanning(shoulder.size), 24)
    assert power[(frequency > 1 / 15) & (frequency < 1 / 2.7)].sum() > 0.99 * power.sum()  # periods of 3 to 13 s


# The violinist


def test_each_pitch_is_played_on_the_highest_string_that_has_it_and_an_octave_is_stopped_at_half_of_it():
    assert players_of.string_numbers(np.array([55, 61, 62, 69, 75, 76, 90])).tolist() == [0, 0, 1, 2, 2, 3, 3]
    np.testing.assert_allclose(players_of.stop_distance(np.array([76, 88, 62])), [0.0, 52.5, 0.0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_bow_turns_within_a_frame_of_each_onset(seed):
    planted = planted_player("violin", seed)
    along = (own_points(planted) - own_points(planted)[:, [AT["left_shoulder"]]])[:, AT["right_hand"]] @ players_of.BOW
    steps = np.diff(along)
    turns = (np.flatnonzero(steps[:-1] * steps[1:] < -1e-6) + 1) / 24  # not the rounding of a bow at rest
    assert np.abs(planted.strikes.times[:, None] - turns).min(axis=1).max() <= 1 / 24
    assert len(turns) <= len(planted.strikes) + 1  # and where the bow stops after the last note


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bars_begin_with_a_down_bow_and_bows_alternate(seed):
    piece = planted_piece("violin", 30.0, seed)
    directions = np.sign(np.diff(players_of.bow_turns(piece)))
    assert (directions[1:] == -directions[:-1]).all()
    starts = np.searchsorted(piece.notes.onsets, piece.downbeats - 1e-6)
    np.testing.assert_allclose(piece.notes.onsets[starts], piece.downbeats, atol=1e-9)
    assert (directions[starts] == 1).all()


def test_the_bow_is_as_fast_as_loudness_says_where_it_does_not_reach_its_end():
    piece = planted_piece("violin", 60.0, 4)
    turns, notes = players_of.bow_turns(piece), piece.notes
    free = ~np.isin(turns[1:], players_of.BOW_ENDS)[:-1]
    assert free.mean() > 0.7
    durations = np.diff(notes.onsets)
    speeds = np.abs(np.diff(turns))[:-1] / durations
    np.testing.assert_allclose(speeds[free], (0.6 * notes.loudness[:-1] * durations**-0.2)[free], rtol=1e-9)


def test_a_violinists_downbeats_are_a_quarter_louder():
    means = []
    for seed in range(20):
        piece = planted_piece("violin", 30.0, seed)
        first = np.abs(piece.notes.onsets[:, None] - piece.downbeats).min(axis=1) < 1e-6
        means.append([piece.notes.loudness[beats].mean() for beats in (first, ~first)])
    loud, soft = np.mean(means, axis=0)
    assert loud / soft == pytest.approx(1.25, abs=0.04)


def test_without_the_direction_of_the_bow_only_the_bow_arm_differs():
    planted = planted_player("violin")
    difference = seen_alone(planted, planted.direction_blind) - seen_alone(planted, planted.from_audio)
    arm = [*HANDS["right"], AT["right_wrist"], AT["right_elbow"]]
    np.testing.assert_allclose(difference[:, np.setdiff1d(np.arange(50), arm)], 0.0, atol=1e-9)
    along = difference[:, AT["right_hand"]] @ players_of.BOW
    np.testing.assert_allclose(along, 215 * (planted.bow - planted.bow.mean()), rtol=0.01, atol=0.01)


def test_a_violinist_sways_as_one_piece():
    planted = planted_player("violin")
    sway = seen_alone(planted, planted.from_audio)
    np.testing.assert_allclose(sway - sway[:, :1], 0.0, atol=1e-9)
    assert 2 < np.abs(sway[..., 0]).max() <= 4.5
    np.testing.assert_allclose(sway[..., 1], 0.0, atol=1e-9)


def test_the_bow_rests_before_and_after_the_piece():
    piece = planted_piece("violin", 10.0, 1)
    place = players_of.bow_place(piece, np.array([0.0, 0.05, piece.notes.offsets[-1], 99.0]))
    assert place[0] == place[1]
    assert place[2] == place[3] == players_of.bow_turns(piece)[-1]


# Camera, noise and what sound can tell


@EVERY_INSTRUMENT
def test_cameras_differ_as_much_as_they_may(instrument):
    cameras = [planted_player(instrument, seed, seconds=2.0).camera for seed in range(30)]
    middles = np.array([camera.apply(np.array([320.0, 240.0])) for camera in cameras]) - (320, 240)
    scales, rotations = ([getattr(camera, name) for camera in cameras] for name in ("scale", "rotation"))
    for values, most in ((np.array(scales) - 1, 0.08), (rotations, np.radians(3)), (middles, 25.0)):
        assert 0.8 * most < np.abs(values).max() <= most


@EVERY_INSTRUMENT
def test_noise_is_as_strong_as_asked_for_and_the_player_is_in_the_picture(instrument):
    planted = planted_player(instrument, faults=False, noise=1.0)
    assert root_mean_square(planted.performance.motion.positions - planted.clean) == pytest.approx(1.0, abs=0.01)
    assert (planted.clean > 0).all() and (planted.clean < (640, 480)).all()
    assert (planted_player(instrument, faults=False, noise=0.0).performance.motion.positions == planted.clean).all()


def test_floors_and_the_ceiling_of_a_network_without_bow_direction():
    """RMS against the tracked points, pixels: 1 of noise, and a violinist's sway in x, waves of 3 and 1.5 pixels."""
    sway = np.sqrt(1 + (3**2 + 1.5**2) / 4)
    floors = {("violin", "from_audio"): (sway, 0.1), ("piano", "from_audio"): (1.5, 0.1)}
    for (instrument, part), (floor, spread) in (floors | {("violin", "direction_blind"): (15.0, 1.0)}).items():
        players = [planted_player(instrument, seed) for seed in range(4)]
        away = [(getattr(each, part) - each.performance.motion.positions)[each.fault == ""] for each in players]
        assert np.mean([*map(root_mean_square, away)]) == pytest.approx(floor, abs=spread)


# Faults


@EVERY_INSTRUMENT
def test_a_tenth_of_the_frames_is_faulty_in_bursts_of_one_to_six(instrument):
    shares, kinds = [], set()
    for seed in range(6):
        fault = planted_player(instrument, seed).fault
        shares.append((fault != "").mean())
        kinds |= set(fault) - {""}
        edges = np.flatnonzero(np.diff((fault != "").astype(int), prepend=0, append=0))
        lengths = edges[1::2] - edges[::2]
        assert 1 <= lengths.min() <= lengths.max() <= 6
        assert fault[0] == ""
    assert np.mean(shares) == pytest.approx(0.1, abs=0.01)
    assert 0.06 < min(shares) < max(shares) < 0.14
    assert kinds == set(FAULTS)


@EVERY_INSTRUMENT
def test_each_fault_does_what_its_name_says(instrument):
    planted = planted_player(instrument, noise=0.0)
    tracked, clean, detected = planted.performance.motion.positions, planted.clean, planted.performance.detected
    assert set(planted.fault) == {"", *FAULTS}
    for frame in range(720):
        now, before, kind = tracked[frame], clean[frame], planted.fault[frame]
        if kind == "swapped hands":
            np.testing.assert_array_equal(now[HANDS["left"]], before[HANDS["right"]])
            np.testing.assert_array_equal(now[HANDS["right"]], before[HANDS["left"]])
        elif kind == "jump":
            np.testing.assert_allclose(now - before, (now - before)[:1].repeat(50, axis=0), atol=1e-9)
            assert 50 <= np.linalg.norm((now - before)[0]) <= 110
        elif kind == "other person":
            assert 150 < np.abs(now.mean(axis=0) - before.mean(axis=0))[0] < 290
            assert np.ptp(now, axis=0).max() < 0.95 * np.ptp(before, axis=0).max()
        elif kind == "missing hand":
            lost = [side for side in SIDES if not detected[frame, HANDS[side]].any()]
            assert len(lost) == 1
            assert detected[frame].sum() == 29
            np.testing.assert_array_equal(now[HANDS[lost[0]]], tracked[frame - 1, HANDS[lost[0]]])
        else:
            np.testing.assert_array_equal(now, before)
        assert kind == "missing hand" or detected[frame].all()


# Pieces and seeds


@EVERY_INSTRUMENT
def test_the_same_seed_is_the_same_performance_and_another_seed_another(instrument):
    one = planted_performance(instrument, seed=3, seconds=6.0)
    again, other = planted_performances(instrument, 2, seed=3, seconds=6.0)
    assert (one.performance.motion.positions == again.performance.motion.positions).all()
    assert (one.performance.audio.samples == again.performance.audio.samples).all()
    assert (one.fault == again.fault).all()
    assert one.performance.piece == again.performance.piece != other.performance.piece
    assert np.abs(one.performance.motion.positions - other.performance.motion.positions).mean() > 5


@EVERY_INSTRUMENT
def test_a_shorter_performance_is_the_beginning_of_a_longer_one(instrument):
    whole, half = planted_player(instrument, seconds=20.0), planted_player(instrument, seconds=10.0)
    alike = 24 * 9  # frames; the last second has a rest instead of the next notes
    notes, fewer = whole.performance.notes, half.performance.notes
    assert fewer.pitches.tolist() == notes.pitches[: len(fewer)].tolist()
    np.testing.assert_allclose(half.clean[:alike], whole.clean[:alike], atol=1e-9)
    np.testing.assert_allclose(*[each.performance.motion.positions[:alike] for each in (half, whole)], atol=1e-9)
    sound, part = whole.performance.audio.samples[RATE : 9 * RATE], half.performance.audio.samples[RATE : 9 * RATE]
    assert np.corrcoef(sound, part)[0, 1] > 0.999


def patterns(notes):
    """Every six notes in a row of one hand: their intervals and their lengths."""
    for hand in np.unique(notes.hands):
        line = notes.select(notes.hands == hand)
        steps, lengths = np.diff(line.pitches), np.diff(line.onsets)
        for first in range(len(steps) - 5):
            span = slice(first, first + 5)
            yield (*steps[span], *np.round(lengths[span] / lengths[span].min()).astype(int))


@EVERY_INSTRUMENT
def test_pieces_share_no_tune(instrument):
    pieces = [set(patterns(planted_piece(instrument, 30.0, seed).notes)) for seed in range(45)]
    assert max([len(one & other) / len(one) for one in pieces for other in pieces if one is not other]) < 0.05


@EVERY_INSTRUMENT
def test_voices_keep_to_their_range_and_one_tempo(instrument):
    ranges = {"piano": {0: (36, 60), 1: (62, 88)}, "violin": {-1: (55, 90)}}[instrument]
    for seed in range(20):
        piece = planted_piece(instrument, 30.0, seed)
        assert 66 <= 60 / piece.beat <= 112
        for hand, (low, high) in ranges.items():
            line = piece.notes.select(piece.notes.hands == hand)
            assert low <= line.pitches.min() <= line.pitches.max() <= high
            sixteenths = (line.onsets - 0.5) / piece.beat * 4
            np.testing.assert_allclose(sixteenths, np.round(sixteenths), atol=1e-6)
        assert 0.5 == piece.notes.onsets[0] < piece.notes.onsets[-1] <= 29.5


# Sound


def one_note(pitch, loudness=1.0, length=1.0):
    return Notes([0.5], [0.5 + length], [pitch], [loudness])


@EVERY_INSTRUMENT
def test_a_note_sounds_at_its_pitch_from_its_onset_to_its_end(instrument):
    samples = rendered_notes(one_note(69), 2.0, instrument=instrument).samples.astype(float)
    assert np.abs(samples[: int(0.499 * 44100)]).max() < 1e-6
    assert np.abs(samples[int(1.51 * 44100) :]).max() < 1e-6
    sounding = samples[int(0.55 * 44100) : int(1.45 * 44100)]
    spectrum, frequency = spectrum_of(sounding * np.hanning(sounding.size), 44100, finer=4)
    near = (frequency > 400) & (frequency < 480)
    assert np.average(frequency[near], weights=spectrum[near]) == pytest.approx(440, abs=2)
    assert spectrum[near].sum() > 0.3 * spectrum.sum()


@EVERY_INSTRUMENT
def test_a_note_half_as_loud_has_half_the_amplitude(instrument):
    notes = Notes([0.0, 2.0], [1.0, 3.0], [60, 60], [1.0, 0.5])
    samples = rendered_notes(notes, 3.0, RATE, instrument=instrument).samples.astype(float)
    loud, soft = (root_mean_square(samples[start * RATE + 400 : start * RATE + 7000]) for start in (0, 2))
    assert soft / loud == pytest.approx(0.5, abs=0.02)
    assert np.abs(samples).max() == pytest.approx(0.9, abs=1e-6)


def test_a_piano_dies_away_and_a_violin_lasts_with_a_slow_attack():
    levels = {}
    for instrument in INSTRUMENTS:
        samples = rendered_notes(one_note(72, length=2.0), 3.0, RATE, instrument=instrument).samples.astype(float)
        spans = (samples[int(at * RATE) : int((at + 0.04) * RATE)] for at in (0.505, 0.7, 2.2))
        levels[instrument] = [*map(root_mean_square, spans)]
    piano, violin = levels["piano"], levels["violin"]
    assert piano[0] > piano[1] > 3 * piano[2]
    assert violin[0] < 0.6 * violin[1] < 0.9 * violin[2] < violin[1]


def test_only_the_violin_has_vibrato():
    """The pitch of a note swings at 5.5 Hz by 1 %, read off the phase of its fundamental."""
    for instrument, swing in (("piano", 0.0), ("violin", 0.01)):
        samples = rendered_notes(one_note(69, length=2.0), 3.0, instrument=instrument).samples.astype(float)
        times = np.arange(samples.size) / 44100
        slow = np.convolve(samples * np.exp(-2j * np.pi * 440 * times), np.hanning(883) / 441, "same")
        bend = np.gradient(np.unwrap(np.angle(slow[int(0.7 * 44100) : int(2.3 * 44100)]))) * 44100 / (2 * np.pi * 440)
        assert np.ptp(bend) / 2 == pytest.approx(swing, abs=0.002)


@EVERY_INSTRUMENT
def test_notes_beyond_the_end_are_silent_and_one_shorter_than_a_sample_does_no_harm(instrument):
    for none in (Notes([], [], []), Notes([5.0], [6.0], [60])):
        assert not rendered_notes(none, 1.0, RATE, instrument=instrument).samples.any()
    notes = Notes([0.2, 0.5], [0.2 + 1e-9, 0.7], [60, 127], [1.0, 1.0])
    samples = rendered_notes(notes, 1.0, RATE, instrument=instrument).samples
    assert np.isfinite(samples).all()
    assert samples.size == RATE


# Settings


def test_what_is_out_of_range_is_refused_by_name():
    refused("instrument must be piano or violin, got 'tuba'", planted_performance, "tuba")
    refused("seconds must be within 2 and 3600, got 1.0", planted_performance, "piano", seconds=1.0)
    refused("seconds must be within 2 and 3600, got nan", planted_performance, "piano", seconds=float("nan"))
    refused("seed must be a whole number", planted_performance, "piano", seed=-1)
    refused("seed must be a whole number", planted_performance, "piano", seed=1.5)
    refused("noise is in pixels", planted_performance, "piano", noise=-1.0)
    refused("fps must be within 5 and 1000", planted_performance, "piano", fps=0.0)
    refused("sample_rate must be within 8000 and 192000 Hz", planted_performance, "piano", sample_rate=100)
    refused("seconds must be positive", rendered_notes, one_note(60), 0.0)
    refused("sample_rate must be a whole number from 8000", rendered_notes, one_note(60), 1.0, 100)
    refused("sample_rate must be a whole number", rendered_notes, one_note(60), 1.0, 22050.5)
    refused("instrument must be piano or violin", rendered_notes, one_note(60), 1.0, instrument="tuba")
    refused("it lasts at least 1 s", planted_piece, "piano", 0.5, 1)
    refused("instrument must be piano or violin", planted_piece, "tuba", 10.0, 1)
