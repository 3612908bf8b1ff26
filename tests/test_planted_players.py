"""The planted pianist and violinist play what their notes say: every number here was planted or worked out by hand."""

import functools

import numpy as np
import pytest

from harmolab.body.kinematics import fit_similarity
from harmolab.musician.players import (
    BOW,
    BOW_ENDS,
    bow_place,
    bow_turns,
    glide,
    hand_places,
    key_x,
    pianist_points,
    planted_piece,
    pulses,
    rendered_notes,
    stop_distance,
    string_numbers,
)
from harmolab.musician.synthetic import FAULTS, planted_performance, planted_performances
from harmolab.readers.player_points import FINGERS, INSTRUMENTS, PLAYER_50, SIDES, hand_joints
from harmolab.types import Notes
from tests.builders import cases, refused

EVERY_INSTRUMENT = pytest.mark.parametrize("instrument", INSTRUMENTS)
AT = {name: place for place, name in enumerate(PLAYER_50.joints)}
HANDS = {side: [AT[name] for name in hand_joints(side)] for side in SIDES}
RATE = 8000  # hertz: sound is not what most tests look at


@functools.cache
def played(instrument, seed=1, **settings):
    return planted_performance(instrument, seed=seed, sample_rate=RATE, **settings)


def own_points(planted):
    """(T, 50, 2) the clean points before the camera."""
    return planted.camera.inverse().apply(planted.clean)


def good(planted):
    return planted.fault == ""


def root_mean_square(values):
    return float(np.sqrt(np.mean(np.square(values))))


def striking_tips(planted):
    """For each side: notes, and the number of the fingertip that plays each."""
    for number, side in enumerate(SIDES):
        notes = planted.performance.notes.select(planted.performance.notes.hands == number)
        _, fingers = hand_places(key_x(notes.pitches), (-1.0, 1.0)[number])
        yield side, notes, [AT[f"{side}_{FINGERS[finger]}_4"] for finger in fingers]


# Movements on moments


def test_a_glide_arrives_at_its_onset_and_takes_the_time_it_has():
    onsets, values = np.array([1.0, 3.0, 3.1]), np.array([0.0, 10.0, 20.0])
    times = np.array([0.0, 1.0, 2.7, 2.8, 2.9, 3.0, 3.05, 3.1, 9.0])
    expected = [0, 0, 0, 0, 5, 10, 15, 20, 20]  # 0.2 s before the onset at 3, but only 0.1 s before that at 3.1
    np.testing.assert_allclose(glide(times, onsets, values, 0.2), expected, atol=1e-9)


def test_a_pulse_peaks_at_its_onset_and_lasts_its_radius_each_way():
    track = pulses(np.arange(10) / 10, np.array([0.5]), np.array([1]), np.array([4.0]), n_channels=2, radius=0.2)
    np.testing.assert_allclose(track[:, 1], [0, 0, 0, 0, 2, 4, 2, 0, 0, 0], atol=1e-9)
    assert not track[:, 0].any()


# The pianist


def test_white_keys_are_ten_pixels_wide_and_black_ones_lie_between():
    assert key_x(np.array([21, 60, 61, 62, 64, 65, 72])).tolist() == [65, 295, 300, 305, 315, 325, 365]


def test_a_hand_moves_only_to_keys_more_than_two_white_keys_away():
    keys = np.array([100.0, 120.0, 125.0, 115.0, 80.0])
    places, fingers = hand_places(keys, 1.0)
    assert places.tolist() == [100, 100, 125, 125, 80]
    assert [FINGERS[finger] for finger in fingers] == ["middle", "little", "middle", "index", "middle"]
    assert [FINGERS[finger] for finger in hand_places(keys, -1.0)[1]][:2] == ["middle", "thumb"]


@pytest.mark.parametrize("seed", [1, 2])
def test_at_each_onset_a_fingertip_is_on_its_key_and_the_wrist_near_it(seed):
    planted = played("piano", seed, fps=1000.0, seconds=12.0)
    points = own_points(planted)
    for side, notes, tips in striking_tips(planted):
        frames = np.round(notes.onsets * 1000).astype(int)
        np.testing.assert_allclose(points[frames, tips, 0], key_x(notes.pitches), atol=0.05)
        assert np.abs(points[frames, AT[f"{side}_hand"], 0] - key_x(notes.pitches)).max() <= 20.05


def test_a_struck_fingertip_is_as_low_as_the_loudness_says():
    planted = played("piano", fps=1000.0, seconds=12.0)
    points = own_points(planted)
    for side, notes, tips in striking_tips(planted):
        frames, beside = np.round(notes.onsets * 1000).astype(int), points[:, HANDS[side][0], 1]
        dips = points[frames, tips, 1] - beside[frames] - (points[0, tips, 1] - beside[0])
        np.testing.assert_allclose(dips, 0.65 * (4 + 8 * notes.loudness), atol=0.02)  # the wrist does the other 35 %


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_fingers_come_down_within_a_frame_of_the_onsets(seed):
    planted = played("piano", seed)
    points = own_points(planted)
    for side, notes, tips in striking_tips(planted):
        for onset, tip in zip(notes.onsets, tips, strict=True):
            dip = points[:, tip, 1] - points[:, AT[f"{side}_hand"], 1]
            frame = round(onset * 24)
            lowest = frame - 2 + np.argmax(dip[frame - 2 : frame + 3])
            assert abs(lowest / 24 - onset) <= 1 / 24
            assert dip[lowest] - dip[0] > 2.5  # pixels; at rest before the first note


def test_strikes_are_the_onsets_of_both_hands_and_as_loud():
    planted = played("piano")
    notes = planted.performance.notes
    assert set(planted.strikes.times) == set(notes.onsets)
    first = notes.select(notes.onsets == notes.onsets[0])
    assert len(first) == 2
    assert planted.strikes.strengths[0] == first.loudness.max()


def test_the_sway_of_the_torso_is_slow_and_leaves_the_hands_on_the_keys():
    planted = played("piano", seconds=60.0)
    sway = planted.camera.inverse().apply(planted.clean) - planted.camera.inverse().apply(planted.from_audio)
    np.testing.assert_allclose(sway[:, HANDS["left"] + HANDS["right"]], 0.0, atol=1e-9)
    shoulder = sway[:, AT["left_shoulder"], 0]
    assert 8 < np.abs(shoulder).max() <= 12
    power = np.abs(np.fft.rfft(shoulder * np.hanning(shoulder.size))) ** 2
    frequency = np.fft.rfftfreq(shoulder.size, 1 / 24)
    assert power[(frequency > 1 / 15) & (frequency < 1 / 2.7)].sum() > 0.99 * power.sum()  # periods of 3 to 13 s


def test_the_left_hand_plays_the_low_keys_at_small_x():
    planted = played("piano")
    middles = {side: planted.clean[:, HANDS[side], 0].mean() for side in SIDES}
    assert middles["left"] + 50 < middles["right"]
    assert planted.clean[:, AT["left_shoulder"], 0].max() < planted.clean[:, AT["right_shoulder"], 0].min()


# The violinist


def test_each_pitch_is_played_on_the_highest_string_that_has_it():
    assert string_numbers(np.array([55, 61, 62, 69, 75, 76, 90])).tolist() == [0, 0, 1, 2, 2, 3, 3]


def test_an_octave_is_stopped_at_half_the_string():
    np.testing.assert_allclose(stop_distance(np.array([76, 88, 62])), [0.0, 52.5, 0.0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_bow_turns_within_a_frame_of_each_onset(seed):
    planted = played("violin", seed)
    along = (own_points(planted) - own_points(planted)[:, [AT["left_shoulder"]]])[:, AT["right_hand"]] @ BOW
    steps = np.diff(along)
    turns = (np.flatnonzero(steps[:-1] * steps[1:] < -1e-6) + 1) / 24  # not the rounding of a bow at rest
    assert np.abs(planted.strikes.times[:, None] - turns).min(axis=1).max() <= 1 / 24
    assert len(turns) <= len(planted.strikes) + 1  # and where the bow stops after the last note


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bars_begin_with_a_down_bow_and_bows_alternate(seed):
    piece = planted_piece("violin", 30.0, seed)
    directions = np.sign(np.diff(bow_turns(piece)))
    assert (directions[1:] == -directions[:-1]).all()
    starts = np.searchsorted(piece.notes.onsets, piece.downbeats - 1e-6)
    np.testing.assert_allclose(piece.notes.onsets[starts], piece.downbeats, atol=1e-9)
    assert (directions[starts] == 1).all()


def test_the_bow_is_as_fast_as_loudness_says_where_it_does_not_reach_its_end():
    piece = planted_piece("violin", 60.0, 4)
    turns, notes = bow_turns(piece), piece.notes
    free = ~np.isin(turns[1:], BOW_ENDS)[:-1]
    assert free.mean() > 0.7
    durations = np.diff(notes.onsets)
    speeds = np.abs(np.diff(turns))[:-1] / durations
    np.testing.assert_allclose(speeds[free], (0.6 * notes.loudness[:-1] * durations**-0.2)[free], rtol=1e-9)


def test_a_violinists_downbeats_are_a_quarter_louder():
    loud, soft = [], []
    for seed in range(20):
        piece = planted_piece("violin", 30.0, seed)
        first = np.abs(piece.notes.onsets[:, None] - piece.downbeats).min(axis=1) < 1e-6
        loud.append(piece.notes.loudness[first].mean())
        soft.append(piece.notes.loudness[~first].mean())
    assert np.mean(loud) / np.mean(soft) == pytest.approx(1.25, abs=0.04)


def test_without_the_direction_of_the_bow_only_the_bow_arm_differs():
    planted = played("violin")
    difference = planted.camera.inverse().apply(planted.from_audio)
    difference = difference - planted.camera.inverse().apply(planted.direction_blind)
    arm = [*HANDS["right"], AT["right_wrist"], AT["right_elbow"]]
    np.testing.assert_allclose(difference[:, np.setdiff1d(np.arange(50), arm)], 0.0, atol=1e-9)
    along = difference[:, AT["right_hand"]] @ BOW
    np.testing.assert_allclose(along, 215 * (planted.bow - planted.bow.mean()), rtol=0.01, atol=0.01)


def test_a_violinist_sways_as_one_piece():
    planted = played("violin")
    sway = planted.camera.inverse().apply(planted.clean) - planted.camera.inverse().apply(planted.from_audio)
    np.testing.assert_allclose(sway - sway[:, :1], 0.0, atol=1e-9)
    assert 2 < np.abs(sway[..., 0]).max() <= 4.5
    np.testing.assert_allclose(sway[..., 1], 0.0, atol=1e-9)


def test_the_bow_rests_before_and_after_the_piece():
    piece = planted_piece("violin", 10.0, 1)
    place = bow_place(piece, np.array([0.0, 0.05, piece.notes.offsets[-1], 99.0]))
    assert place[0] == place[1]
    assert place[2] == place[3] == bow_turns(piece)[-1]


# Camera, noise and what sound can tell


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_camera_is_recovered_from_noisy_hands(seed):
    planted, frames = played("piano", seed), np.arange(720)
    hands = HANDS["left"] + HANDS["right"]
    before = pianist_points(planted_piece("piano", 30.0, seed), frames / 24, np.zeros(720))[:, hands]
    tracked = planted.performance.motion.positions[:, hands]
    camera = fit_similarity(before[good(planted)].mean(axis=0), tracked[good(planted)].mean(axis=0))
    assert camera.scale == pytest.approx(planted.camera.scale, abs=0.01)
    assert camera.rotation == pytest.approx(planted.camera.rotation, abs=np.radians(0.5))
    np.testing.assert_allclose(camera.apply(before), planted.camera.apply(before), atol=1.0)


@EVERY_INSTRUMENT
def test_cameras_differ_as_much_as_they_may(instrument):
    cameras = [played(instrument, seed, seconds=2.0).camera for seed in range(60)]
    middles = np.array([camera.apply(np.array([320.0, 240.0])) for camera in cameras]) - (320, 240)
    for values, most in (
        ([camera.scale - 1 for camera in cameras], 0.08),
        ([camera.rotation for camera in cameras], np.radians(3)),
        (middles, 25.0),
    ):
        assert 0.85 * most < np.abs(values).max() <= most


@EVERY_INSTRUMENT
def test_noise_is_as_strong_as_asked_for_and_the_player_is_in_the_picture(instrument):
    planted = played(instrument, faults=False, noise=1.0)
    assert root_mean_square(planted.performance.motion.positions - planted.clean) == pytest.approx(1.0, abs=0.01)
    assert (planted.clean > 0).all()
    assert (planted.clean < (640, 480)).all()
    assert (played(instrument, faults=False, noise=0.0).performance.motion.positions == planted.clean).all()


def test_floors_and_the_ceiling_of_a_network_without_bow_direction():
    """RMS against the tracked points, pixels: 1 of noise, and a violinist's sway in x, waves of 3 and 1.5 pixels."""
    floors = {"piano": [], "violin": []}
    blind = []
    for instrument in INSTRUMENTS:
        for seed in range(8):
            planted = played(instrument, seed)
            tracked = planted.performance.motion.positions[good(planted)]
            floors[instrument].append(root_mean_square(planted.from_audio[good(planted)] - tracked))
            if planted.direction_blind is not None:
                blind.append(root_mean_square(planted.direction_blind[good(planted)] - tracked))
    assert np.mean(floors["violin"]) == pytest.approx(np.sqrt(1 + (3**2 + 1.5**2) / 4), abs=0.1)
    assert np.mean(floors["piano"]) == pytest.approx(1.5, abs=0.1)
    assert np.mean(blind) == pytest.approx(15.0, abs=1.0)


# Faults


@EVERY_INSTRUMENT
def test_a_tenth_of_the_frames_is_faulty_in_bursts_of_one_to_six(instrument):
    shares, kinds = [], set()
    for seed in range(12):
        fault = played(instrument, seed).fault
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
    planted = played(instrument, noise=0.0)
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
    one, again, other = (planted_performance(instrument, seed=seed, seconds=6.0) for seed in (3, 3, 4))
    assert (one.performance.motion.positions == again.performance.motion.positions).all()
    assert (one.performance.audio.samples == again.performance.audio.samples).all()
    assert (one.fault == again.fault).all()
    assert one.performance.piece == again.performance.piece != other.performance.piece
    assert np.abs(one.performance.motion.positions - other.performance.motion.positions).mean() > 5


@EVERY_INSTRUMENT
def test_a_shorter_performance_is_the_beginning_of_a_longer_one(instrument):
    whole, half = played(instrument, seconds=20.0), played(instrument, seconds=10.0)
    alike = 24 * 9  # frames; the last second has a rest instead of the next notes
    notes, fewer = whole.performance.notes, half.performance.notes
    assert fewer.pitches.tolist() == notes.pitches[: len(fewer)].tolist()
    np.testing.assert_allclose(half.clean[:alike], whole.clean[:alike], atol=1e-9)
    np.testing.assert_allclose(
        half.performance.motion.positions[:alike], whole.performance.motion.positions[:alike], atol=1e-9
    )
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


def test_a_corpus_counts_its_seeds_up():
    performances = list(planted_performances("piano", 3, seed=5, seconds=2.0, sample_rate=RATE))
    assert [planted.performance.piece for planted in performances] == [f"planted piano {seed}" for seed in (5, 6, 7)]
    second = planted_performance("piano", seed=6, seconds=2.0, sample_rate=RATE)
    assert (performances[1].performance.motion.positions == second.performance.motion.positions).all()


# Sound


def one_note(pitch, loudness=1.0, length=1.0):
    return Notes([0.5], [0.5 + length], [pitch], [loudness])


@EVERY_INSTRUMENT
def test_a_note_sounds_at_its_pitch_from_its_onset_to_its_end(instrument):
    samples = rendered_notes(one_note(69), 2.0, instrument=instrument).samples.astype(float)
    assert np.abs(samples[: int(0.499 * 44100)]).max() < 1e-6
    assert np.abs(samples[int(1.51 * 44100) :]).max() < 1e-6
    sounding = samples[int(0.55 * 44100) : int(1.45 * 44100)] * np.hanning(int(1.45 * 44100) - int(0.55 * 44100))
    spectrum = np.abs(np.fft.rfft(sounding, 4 * sounding.size)) ** 2
    frequency = np.fft.rfftfreq(4 * sounding.size, 1 / 44100)
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
        levels[instrument] = [
            root_mean_square(samples[int(at * RATE) : int((at + 0.04) * RATE)]) for at in (0.505, 0.7, 2.2)
        ]
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


def test_silence_and_notes_beyond_the_end_are_silent():
    assert not rendered_notes(Notes([], [], []), 1.0).samples.any()
    late = rendered_notes(Notes([5.0], [6.0], [60]), 1.0)
    assert not late.samples.any()
    assert late.duration == 1.0


@EVERY_INSTRUMENT
def test_a_note_shorter_than_a_sample_does_no_harm(instrument):
    notes = Notes([0.2, 0.5], [0.2 + 1e-9, 0.7], [60, 127], [1.0, 1.0])
    samples = rendered_notes(notes, 1.0, RATE, instrument=instrument).samples
    assert np.isfinite(samples).all()
    assert samples.size == RATE


# Settings


@cases(
    "settings, message",
    ({"instrument": "tuba"}, "instrument must be piano or violin, got 'tuba'"),
    ({"seconds": 1.0}, "seconds must be within 2 and 3600, got 1.0"),
    ({"seconds": float("nan")}, "seconds must be within 2 and 3600, got nan"),
    ({"seed": -1}, "seed must be a whole number"),
    ({"seed": 1.5}, "seed must be a whole number"),
    ({"noise": -1.0}, "noise is in pixels"),
    ({"fps": 0.0}, "fps must be within 5 and 1000"),
    ({"sample_rate": 100}, "sample_rate must be within 8000 and 192000 Hz"),
)
def test_settings_out_of_range_are_refused_by_name(settings, message):
    refused(message, planted_performance, settings.pop("instrument", "piano"), **settings)


@cases(
    "arguments, settings, message",
    ((0.0,), {}, "seconds must be positive"),
    ((1.0, 100), {}, "sample_rate must be a whole number from 8000"),
    ((1.0, 22050.5), {}, "sample_rate must be a whole number"),
    ((1.0,), {"instrument": "tuba"}, "instrument must be piano or violin"),
)
def test_sounds_out_of_range_are_refused_by_name(arguments, settings, message):
    refused(message, rendered_notes, one_note(60), *arguments, **settings)


def test_a_piece_too_short_for_its_rests_is_refused():
    refused("it lasts at least 1 s", planted_piece, "piano", 0.5, 1)
    refused("instrument must be piano or violin", planted_piece, "tuba", 10.0, 1)
