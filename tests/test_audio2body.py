"""Audio to Body Dynamics: points cleaned and placed, what is heard, the network and its training, the bow."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import soxr
import torch

from benchmarks import bench_audio2body
from harmolab.musician import bow as bowing
from harmolab.musician import cleaning, sequences
from harmolab.musician import sound_features as hearing
from harmolab.musician import train as training
from harmolab.musician.cleaning import Cleaned, CleaningRules, Reference, cleaned, placed, reference_configuration
from harmolab.musician.networks import SoundToPoints, predicted_points, predicted_strokes, synthesize_performance
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSequence, PlayedSet, PlayedSplit, PlayedWindows, PointSpace
from harmolab.musician.similarities import Similarity
from harmolab.musician.synthetic import FAULTS, PlantedPerformance, planted_performance, planted_performances
from harmolab.musician.train import errors, errors_between, mean_pose_errors, terms, train_audio2body
from harmolab.readers.player_points import HANDS_12, INSTRUMENTS, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import parameter_count
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Audio, FloatArray, Motion, Notes
from study.cells import notebook_cells
from tests.builders import cases, refused

FPS = 24.0
# Left and right shoulder, elbow, wrist and hip; the box around the whole player is 300 wide, the shoulders 100.
BODY = [[250, 100], [350, 100], [220, 180], [380, 180], [200, 240], [400, 240], [265, 260], [335, 260]]
WIDTH = 300.0
HANDS = {side: [PLAYER_50.joints.index(name) for name in hand_joints(side)] for side in SIDES}


def pose() -> FloatArray:
    """(50, 2) points of a player: fingers 10 to 40 below the wrists, 50 outwards at most."""
    fingers = np.array([(0.0, 0.0), *((12.5 * finger, 10.0 * bone) for finger in range(5) for bone in range(1, 5))])
    return np.concatenate([np.array(BODY, float), BODY[4] + fingers * [-1, 1], BODY[5] + fingers])


def playing(n_frames: int = 96) -> FloatArray:
    """(T, 50, 2) points of a player whose hands go 10 pixels to and fro in two seconds, and body 3 pixels."""
    points, time = np.repeat(pose()[None], n_frames, axis=0), np.arange(n_frames) / FPS
    points[..., 0] += 3 * np.sin(np.pi * time)[:, None]
    for numbers in HANDS.values():
        points[:, numbers, 0] += 7 * np.sin(np.pi * time)[:, None]
    return points


def performance(points: FloatArray, *, joints: Sequence[str] = PLAYER_50.joints, fps: float = FPS) -> Performance:
    return Performance("a player", "piano", None, Motion(points, fps, player_skeleton(joints)))


def part(points: FloatArray, joints: Sequence[str]) -> Performance:
    """A performance of some of the points."""
    return performance(points[:, [PLAYER_50.joints.index(name) for name in joints]], joints=joints)


def rejected(result: Cleaned) -> list[int]:
    return np.flatnonzero(~result.accepted).tolist()


def with_fault(fault: str, frames: slice) -> Performance:
    """A player with one fault in some frames."""
    points, detected = playing(), np.ones((96, 50), bool)
    if fault == "swapped":
        points[frames, HANDS["left"] + HANDS["right"]] = points[frames, HANDS["right"] + HANDS["left"]]
    elif fault == "missing":
        detected[frames, HANDS["right"]] = False
    else:
        points[frames] += {"centre": [200.0, 20.0], "jump": [0.0, -40.0]}[fault]
    return replace(performance(points), detected=detected)


# Rejecting (reading 8).


# A recording that begins with a small jump has nothing yet to hold it against.
@cases("fault, first", *itertools.product(("swapped", "missing", "centre"), (0, 40, 91)), ("jump", 40), ("jump", 91))
def test_each_fault_is_rejected_by_its_rule_and_nothing_else_is(fault: str, first: int):
    result = cleaned(with_fault(fault, slice(first, first + 5)))
    assert result.broken.tolist() == [""] * first + [fault] * 5 + [""] * (91 - first)
    assert rejected(result) == [*range(first, first + 5)]
    assert result.report() == {rule: 5 / 96 * (rule == fault) for rule in cleaning.RULES}


@cases("rules, least", (CleaningRules(), 0.10), (CleaningRules(jump=None), 0.35), ids=["mean movement", "centre"])
def test_movement_beyond_its_share_of_the_box_is_rejected(rules: CleaningRules, least: float):
    points = np.repeat(pose()[None], 30, axis=0)
    points[10] += [0.0, (least - 1e-4) * WIDTH]
    points[20] += [0.0, (least + 1e-4) * WIDTH]
    assert rejected(cleaned(performance(points), rules)) == [20]


@cases("fps, last", (24.0, 51), (30.0, 54))
def test_after_half_a_second_without_an_accepted_frame_the_next_is_accepted_anew(fps: float, last: int):
    points = playing()
    points[40:] += [0.0, 40.0]
    assert rejected(cleaned(performance(points, fps=fps), CleaningRules(cut=None))) == [*range(40, last + 1)]


def test_error_as_long_as_the_longest_run_does_not_lock_the_player_out():
    points = playing()
    points[40:52] += [0.0, 40.0]
    assert rejected(cleaned(performance(points))) == list(range(40, 52))


def test_hands_that_stay_swapped_are_rejected_as_long_as_they_are():
    assert cleaned(with_fault("swapped", slice(30, 90))).report()["swapped"] == 60 / 96


def test_whole_arms_that_stay_swapped_show_by_their_forearms():
    points = playing()
    wrists = [PLAYER_50.joints.index(f"{side}_wrist") for side in SIDES]
    left, right = [wrists[0], *HANDS["left"]], [wrists[1], *HANDS["right"]]
    points[60:, left + right] = points[60:, right + left]
    assert list(np.flatnonzero(cleaned(performance(points)).broken == "swapped")) == list(range(60, 96))


def test_arms_that_cross_are_no_error():
    """Elbows 60 apart, forearms of 100 that cross over two seconds: each hand ends nearer to the other elbow."""
    angle = np.concatenate([np.linspace(0, 0.9, 48), np.full(48, 0.9)])
    joints = ("left_elbow", "right_elbow", "left_wrist", "right_wrist")
    elbows = np.repeat(np.array([[[270.0, 180.0], [330.0, 180.0]]]), 96, axis=0)
    forearm = 100 * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    wrists = np.stack([elbows[:, 0] + forearm, elbows[:, 1] + forearm * [-1, 1]], axis=1)
    result = cleaned(performance(np.concatenate([elbows, wrists], axis=1), joints=joints), CleaningRules(jump=None))
    assert wrists[-1, 0, 0] > wrists[-1, 1, 0] + 80
    assert result.accepted.all()


def plain_walk(points: FloatArray) -> list[str]:
    """The rules "centre" and "jump" frame by frame, from frame 0 on, as reading 8 has them."""
    broken, accepted, run = [""], 0, 0
    for frame in range(1, len(points)):
        low, high = (bound(points, axis=1) for bound in (np.min, np.max))
        width = high[accepted, 0] - low[accepted, 0]
        centres = (low + high) / 2
        far = np.hypot(*(centres[frame] - centres[accepted])) > 0.35 * width
        moved = np.linalg.norm(points[frame] - points[accepted], axis=1).mean() > 0.10 * width
        rule = "centre" if far else "jump" if moved else ""
        if not rule or run == 12:
            rule, accepted, run = "", frame, 0
        else:
            run += 1
        broken.append(rule)
    return broken


@pytest.mark.parametrize("seed", [0, 4])
def test_fast_walk_agrees_with_the_plain_one(seed: int):
    rng = np.random.default_rng(seed)
    points = np.repeat(pose()[None], 300, axis=0) + rng.normal(0, 2, (300, 50, 2))
    points += np.where(rng.random((300, 1, 1)) < 0.6, 0, rng.uniform(-110, 110, (300, 1, 2)))
    points[:13] = pose()  # so that both begin at frame 0
    result = cleaned(performance(points), CleaningRules(swapped=None, cut=None))
    assert list(result.broken) == plain_walk(points)
    assert {"", "centre", "jump"} == set(result.broken)


def test_rules_that_are_off_reject_and_change_nothing():
    planted = with_fault("missing", slice(0, 96))
    result = cleaned(planted, CleaningRules.off())
    assert result.accepted.all()
    np.testing.assert_array_equal(result.motion.positions, planted.motion.positions)


def test_frames_that_a_reader_marked_as_not_valid_count_as_missing():
    planted = performance(playing())
    valid = np.arange(96) % 10 != 4
    result = cleaned(replace(planted, motion=replace(planted.motion, valid=valid)))
    np.testing.assert_array_equal(result.broken == "missing", ~valid)


def test_performance_without_a_frame_that_can_be_used_is_refused_by_name():
    planted = with_fault("missing", slice(0, 96))
    refused(r"a player: no frame is left; missing rejects 100%.*right_hand is not detected", cleaned, planted)


def test_signature_is_asked_about_the_box_of_each_complete_frame():
    calls: dict[int, FloatArray] = {}
    planted = with_fault("missing", slice(50, 60))
    result = cleaned(planted, signature=lambda frame, box: calls.update({frame: box}) or not 20 <= frame < 30)
    assert sorted(calls) == [*range(50), *range(60, 96)]
    np.testing.assert_allclose(calls[0], [150.0, 100.0, 450.0, 280.0])
    assert list(np.flatnonzero(result.broken == "signature")) == list(range(20, 30))


@pytest.mark.parametrize(
    "joints",
    [HANDS_12.joints, PLAYER_50.joints[:8], hand_joints("left"), ("left_shoulder", "right_shoulder")],
    ids=["fingertips", "body", "one hand", "shoulders"],
)
def test_parts_of_a_player_are_cleaned(joints: tuple[str, ...]):
    points = np.repeat(pose()[None], 40, axis=0)
    points[10:13] += [500.0, 0.0]
    result = cleaned(part(points, joints))
    assert rejected(result) == [10, 11, 12]
    np.testing.assert_allclose(result.motion.positions, np.repeat(result.motion.positions[:1], 40, axis=0))


def test_example_of_a_rule_is_its_frame_of_most_movement():
    points = with_fault("jump", slice(30, 34)).motion.positions.copy()
    points[32] += [0.0, -20.0]
    detected = np.ones((96, 50), bool)
    detected[70:73, 9] = False
    examples = cleaning.rejected_examples(cleaned(replace(performance(points), detected=detected)))
    assert examples in [{"jump": 32, "missing": frame} for frame in (70, 71, 72)]


# Gaps (reading 9).


def test_rejected_frames_lie_on_lines_between_accepted_ones():
    points = np.repeat(pose()[None], 20, axis=0)
    points[:, :, 0] += np.arange(20)[:, None]
    line = points.copy()
    points[8:11] += 150.0
    points[:2] += 300.0
    points[18:] += 300.0
    result = cleaned(performance(points))
    assert rejected(result) == [0, 1, 8, 9, 10, 18, 19]
    np.testing.assert_allclose(result.motion.positions[2:18], line[2:18])
    np.testing.assert_allclose(result.motion.positions[[0, 1, 18, 19]], line[[2, 2, 17, 17]])


def test_gaps_are_masked_counted_or_cut_out():
    result = cleaned(with_fault("jump", slice(40, 45)))
    ways = ("mask", "interpolate", "splice")
    masked, counted, spliced = (cleaning.training_frames(result.accepted, gaps) for gaps in ways)
    assert list(np.flatnonzero(~masked[1])) == [40, 41, 42, 43, 44]
    assert counted[1].all() and spliced[1].all()
    assert list(masked[0]) == list(counted[0]) == list(range(96))
    assert list(spliced[0]) == [*range(40), *range(45, 96)]


def test_step_is_usable_where_both_frames_around_it_are():
    usable = np.array([True, True, False, True, True])
    assert list(cleaning.usable_steps(usable, 1)) == list(usable)
    # Frames are steps 0, 4, 8, 12, 16; frame 2 spoils all steps from 5 to 11.
    assert list(np.flatnonzero(~cleaning.usable_steps(usable, 4))) == [5, 6, 7, 8, 9, 10, 11]
    assert list(cleaning.usable_steps(np.array([True]), 4)) == [True]
    refused("1 or more steps", cleaning.usable_steps, usable, 0)


# Camera shots and placing (reading 10).

CAMERA = Similarity(1.1, np.radians(4.0), np.array([30.0, -60.0]))


def two_shots(cut: int = 150, n_frames: int = 300, camera: Similarity = CAMERA) -> FloatArray:
    """A player seen by one camera, from frame `cut` on by another one; 1 pixel of noise."""
    points = playing(n_frames)
    points[cut:] = camera.apply(points[cut:])
    return points + np.random.default_rng(3).normal(0, 1, points.shape)


@pytest.mark.parametrize(
    "camera",
    [CAMERA, Similarity(1.0, 0.0, np.array([12.0, 0.0])), Similarity(0.6, 0.0, np.array([120.0, 70.0]))],
    ids=["another view", "a small shift", "a smaller picture"],
)
def test_cut_between_two_shots_is_at_its_frame(camera: Similarity):
    result = cleaned(performance(two_shots(camera=camera)))
    assert list(result.starts) == [0, 150]
    assert result.accepted.all()


def test_errors_at_a_cut_do_not_hide_it():
    points = two_shots()
    points[146:150] += [-200.0, 40.0]
    points[150:153] += [150.0, 0.0]
    result = cleaned(performance(points))
    assert len(result.starts) == 2
    assert 146 <= result.starts[1] <= 153
    assert rejected(result) == list(range(146, 153))


def test_what_is_no_cut_is_one_shot():
    time = np.arange(300) / FPS
    swaying = playing(300) + 60 * np.sin(2 * np.pi * time / 1.5)[:, None, None]  # up to 250 pixels a second
    leaping, other = np.repeat(pose()[None], 300, axis=0), playing(300)
    leaping[150:, HANDS["left"] + HANDS["right"], 0] += 60.0
    other[100:112] += 200.0
    for player in (*map(performance, (swaying, leaping, other)), part(leaping, HANDS_12.joints)):
        assert list(cleaned(player).starts) == [0]


def test_each_shot_is_placed_by_itself():
    truth = playing(300)
    result = cleaned(performance(two_shots()))
    reference = reference_configuration(cleaned(performance(truth)))
    first, second = cleaning.shot_similarities(result, reference)
    assert [first.scale, first.rotation] == pytest.approx([1.0, 0.0], abs=0.005)
    assert second.scale == pytest.approx(1 / 1.1, rel=0.005)
    assert second.rotation == pytest.approx(-np.radians(4.0), abs=np.radians(0.25))
    away = placed(result, reference).positions - truth
    assert np.abs(away.mean(axis=0)).max() < 0.5


def test_gap_at_a_cut_is_filled_from_its_own_shot():
    points = two_shots(camera=Similarity(1.0, 0.0, np.array([0.0, 300.0])))
    detected = np.ones((300, 50), bool)
    detected[145:150, 0] = detected[152:154, 0] = False
    result = cleaned(replace(performance(points), detected=detected))
    y = result.motion.positions[:, 0, 1]
    assert y[: result.starts[1]].max() < 110 and y[result.starts[1] :].min() > 390


def test_reference_is_the_medians_of_shoulders_and_hips_of_the_longest_shot():
    points = np.repeat(pose()[None], 201, axis=0)
    points[70:] += [0.0, 50.0]
    points[130:132] += [900.0, 0.0]
    reference = reference_configuration(cleaned(performance(points)))
    assert reference.joints == ("left_shoulder", "right_shoulder", "left_hip", "right_hip")
    np.testing.assert_allclose(reference.points, np.array(BODY)[[0, 1, 6, 7]] + [0, 50])
    assert reference.shoulder_width == 100.0


def test_shoulders_alone_place_a_player_without_hips():
    whole = cleaned(performance(playing()))
    upper = part(CAMERA.apply(playing()), PLAYER_50.joints[:6])
    fit = cleaning.shot_similarities(cleaned(upper), reference_configuration(whole))[0]
    assert (fit.scale, fit.rotation) == (pytest.approx(1 / CAMERA.scale), pytest.approx(-CAMERA.rotation))


def test_hands_without_shoulders_are_placed_by_the_medians_of_their_wrists():
    joints = (*hand_joints("left"), *hand_joints("right"))
    reference = reference_configuration(cleaned(part(playing(), joints)))
    assert reference.joints == ("left_hand", "right_hand")
    assert np.isnan(reference.shoulder_width)
    result = cleaned(part(CAMERA.apply(playing()), joints))
    np.testing.assert_allclose(placed(result, reference).positions, part(playing(), joints).motion.positions)


@pytest.mark.parametrize("joints", [HANDS_12.joints, hand_joints("left")], ids=["fingertips", "one hand"])
def test_hands_that_nothing_tells_the_place_of_stay_as_they_are(joints: tuple[str, ...]):
    reference = reference_configuration(cleaned(part(playing(), joints)))
    result = cleaned(part(CAMERA.apply(playing()), joints))
    assert reference.joints == ()
    np.testing.assert_array_equal(placed(result, reference).positions, result.motion.positions)
    assert cleaning.shot_similarities(result, reference)[0].scale == 1.0


def test_recording_without_the_anchors_of_the_reference_is_refused_by_name():
    whole, tips = cleaned(performance(playing())), cleaned(part(playing(), HANDS_12.joints))
    reference = reference_configuration(whole)
    refused("a player: has nothing to be aligned by, the reference left_shoulder", placed, tips, reference)
    refused("the reference nothing; take recordings with the same points", placed, whole, reference_configuration(tips))
    assert placed(tips, reference, alignment="none") is tips.motion
    refused("must be recording, frame or none, got 'video'", placed, whole, reference, alignment="video")


@pytest.mark.parametrize("alignment", ["recording", "frame"])
def test_shoulders_in_one_place_are_refused_by_name(alignment: str):
    points = playing()
    points[:, [1, 6, 7]] = points[:, :1]
    reference = reference_configuration(cleaned(performance(playing())))
    result = cleaned(performance(points))
    refused("a player: the points lie in one place", placed, result, reference, alignment=alignment)


def test_each_frame_may_be_placed_by_itself():
    result = cleaned(performance(playing()))
    reference = reference_configuration(result)
    aligned = placed(result, reference, alignment="frame").positions
    np.testing.assert_allclose(aligned[:, [0, 1, 6, 7]], np.repeat(reference.points[None], 96, axis=0), atol=1e-9)
    # The keyboard holds the hands: they went 10 pixels; the body's 3 were taken off.
    assert np.ptp(aligned[:, HANDS["left"][0], 0]) == pytest.approx(2 * 7, abs=0.1)


# Planted players: faults and cameras whose truth is known.


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_faults_are_rejected_and_few_good_frames_are(instrument: str):
    planted = [planted_performance(instrument, seed=seed, sample_rate=8000) for seed in range(21, 25)]
    results = [cleaned(one.performance) for one in planted]
    fault = np.concatenate([one.fault for one in planted])
    broken = np.concatenate([result.broken for result in results])
    assert np.mean(broken[fault == ""] != "") <= 0.08
    assert all(np.mean(broken[fault == kind] != "") >= 0.95 for kind in FAULTS)
    assert np.mean(broken[fault == "swapped hands"] == "swapped") >= 0.95
    assert np.mean(broken[fault == "missing hand"] == "missing") == 1
    assert [list(result.starts) for result in results] == [[0]] * 4


def in_own_picture(planted: PlantedPerformance) -> Performance:
    """The performance without camera, noise and faults."""
    clean = planted.camera.inverse().apply(planted.clean)
    return replace(planted.performance, motion=Motion(clean, FPS, PLAYER_50), detected=None)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_camera_is_recovered_under_noise_and_faults(instrument: str, seed: int):
    planted = planted_performance(instrument, seed=seed, sample_rate=8000)
    reference = reference_configuration(cleaned(in_own_picture(planted)))
    (fit,) = cleaning.shot_similarities(cleaned(planted.performance), reference)
    truth = planted.camera.inverse()
    assert fit.scale == pytest.approx(truth.scale, rel=0.01)
    assert fit.rotation == pytest.approx(truth.rotation, abs=np.radians(0.5))
    assert np.abs(fit.apply(planted.clean) - truth.apply(planted.clean)).max() < 1.0


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_hands_placed_frame_by_frame_take_the_sway_of_the_body(instrument: str):
    planted = planted_performance(instrument, seed=4, sample_rate=8000)
    own = in_own_picture(planted)
    reference, result = reference_configuration(cleaned(own)), cleaned(planted.performance)
    numbers, error = HANDS["left"] + HANDS["right"], {}
    for alignment in ("recording", "frame"):
        away = placed(result, reference, alignment=alignment).positions - own.motion.positions
        error[alignment] = float(np.sqrt(np.mean(away[result.accepted][:, numbers] ** 2)))
    assert error["recording"] < 1.2  # 1 pixel of noise
    assert error["frame"] > 1.5 * error["recording"]


@pytest.mark.slow
def test_an_hour_of_frames_keeps_all_but_its_bursts():
    assert bench_audio2body.aligned(bench_audio2body.hour_of_points()).valid.mean() == pytest.approx(0.9, abs=0.02)


# The network

RATE = 44100
NOWHERE = Reference((), np.zeros((0, 2)))
TINY = replace(Audio2BodyParams.tables("piano"), hidden=8, components=3, epochs=3, batch=4, sequence=24, rate=1e-2)


def noise(seconds: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.1, round(seconds * RATE))


# The sound


def test_a_click_is_in_the_frame_of_its_time_however_late_it_comes():
    """Two minutes: a hop of whole samples would be most of a frame off by then."""
    rng = np.random.default_rng(1)
    numbers = np.sort(rng.choice(24 * 120 // 8, 100, replace=False)) * 8 + 3
    times = (numbers + rng.uniform(0.02, 0.98, 100)) / 24
    samples = np.zeros(120 * RATE, np.float32)
    samples[np.round(times * RATE).astype(int)] = 1.0
    loudness = hearing.frame_mfcc(samples, Audio2BodyParams(), 24 * 120)[:, 13]
    assert np.flatnonzero(loudness > loudness.min() + 1).tolist() == np.floor(times * 24).astype(int).tolist()


def test_there_are_28_numbers_or_27_without_the_derivative_of_energy():
    params = (Audio2BodyParams(), Audio2BodyParams(energy_delta=False))
    whole, fewer = (hearing.sound_features(Audio(noise(2.0), RATE), each, 48) for each in params)
    assert (whole.shape, fewer.shape, [each.n_sound for each in params]) == ((48, 28), (48, 27), [28, 27])
    np.testing.assert_array_equal(fewer, whole[:, :27])


@pytest.mark.parametrize("rate", [48000, 96000])
def test_features_are_the_same_at_other_sample_rates(rate: int):
    low = soxr.resample(soxr.resample(noise(4.0, 3), 44100, 28000, quality="VHQ"), 28000, 96000, quality="VHQ")
    heard = [Audio(soxr.resample(low, 96000, at, quality="VHQ"), at) for at in (44100, rate)]
    features = [hearing.sound_features(each, Audio2BodyParams(), 96, cached=False) for each in heard]
    inner = slice(3, -3)
    assert (np.abs(features[0] - features[1])[inner].max(axis=0) <= 0.05 * features[0][inner].std(axis=0)).all()


def test_loudness_is_normalised_over_the_recording_and_silence_stays():
    loud = hearing.normalised_loudness(Audio(noise(1.0) * 7, RATE))
    np.testing.assert_allclose(loud, hearing.normalised_loudness(Audio(noise(1.0), RATE)), rtol=1e-5)
    assert np.square(loud).mean() == pytest.approx(1.0, rel=1e-4)
    assert not hearing.normalised_loudness(Audio(np.zeros(100), RATE)).any()
    assert np.isfinite(hearing.sound_features(Audio(np.zeros(RATE), RATE), Audio2BodyParams(), 24)).all()


def test_slopes_are_those_of_lines_through_five_frames():
    np.testing.assert_allclose(hearing.slopes(3.0 * np.arange(20.0)[:, None])[2:-2], 3.0, rtol=1e-6)
    curve = np.random.default_rng(2).normal(size=(9, 1))
    fitted = [np.polyfit(np.arange(-2, 3), curve[place - 2 : place + 3, 0], 1)[0] for place in range(2, 7)]
    np.testing.assert_allclose(hearing.slopes(curve)[2:-2, 0], fitted, rtol=1e-5)


@pytest.mark.parametrize(("pitch", "tone"), [(60, 0), (69, 9), (83, 11)])
def test_a_tone_is_heard_as_its_semitone(pitch: int, tone: int):
    sine = np.sin(2 * np.pi * 440 * 2 ** ((pitch - 69) / 12) * np.arange(2 * RATE) / RATE).astype(np.float32)
    params = (Audio2BodyParams(tones=tones) for tones in ("chroma", "semitones"))
    chroma, semitones = (hearing.tone_strengths(sine, each, 48) for each in params)
    assert chroma.shape == (48, 12)
    assert set(chroma[4:-4].argmax(axis=1)) == {tone}
    assert set(semitones[4:-4].argmax(axis=1)) == {pitch - 36}


def test_notes_are_their_keys():
    values = hearing.note_features(Notes([0.0, 0.5], [0.25, 1.0], [60, 21], [0.5, 1.0]), 24.0, 24)
    assert values.shape == (24, 88)
    np.testing.assert_array_equal(values[:, 39], [1.0] + [0.5] * 5 + [0.0] * 18)
    np.testing.assert_array_equal(values[:, 0], [0.0] * 12 + [2.0] + [1.0] * 11)
    assert values.sum() == pytest.approx(values[:, [0, 39]].sum())


# The space


def test_components_and_points_go_to_and_fro():
    frames = np.random.default_rng(0).normal(size=(200, 10)) @ np.random.default_rng(1).normal(size=(10, 10))
    space = PointSpace.fit(frames, 10)
    np.testing.assert_allclose(space.decode(space.encode(frames)), frames, atol=1e-10)
    np.testing.assert_allclose(space.basis @ space.basis.T, np.eye(10), atol=1e-10)
    assert (space.basis[np.arange(10), np.abs(space.basis).argmax(axis=1)] > 0).all()
    assert space.encode(frames).std(axis=0).max() == pytest.approx(1.0)
    assert len(set(space.sizes)) == 1
    np.testing.assert_allclose(PointSpace.fit(frames, 4, even_scale=False).encode(frames).std(axis=0), 1.0)


def test_a_share_of_the_variance_gives_the_number_of_components():
    frames = np.random.default_rng(0).normal(size=(5000, 4)) * np.sqrt([90.0, 6.0, 3.0, 1.0])
    assert [len(PointSpace.fit(frames, share).basis) for share in (0.5, 0.9, 0.95, 0.999)] == [1, 2, 2, 4]
    refused("two frames", PointSpace.fit, frames[:1], 2)


@cases("upsample, delay", (1, 0), (1, 5), (4, 0), (4, 2), (6, 5))
def test_steps_and_delay_go_to_and_fro(upsample: int, delay: int):
    frames = np.random.default_rng(0).normal(size=(17, 3))
    steps = sequences.steps_of(frames, upsample)
    assert len(steps) == upsample * 16 + 1
    moved = sequences.later(steps, delay)
    assert len(moved) == len(sequences.continued(steps, delay))
    np.testing.assert_allclose(sequences.frames_of(moved, upsample, delay), frames, atol=1e-10)
    impulse = np.zeros((9, 1))
    impulse[4] = 1.0
    assert np.flatnonzero(sequences.later(impulse, delay)[:, 0]).tolist() == [4 + delay]


# The network


def test_the_network_has_the_paper_s_size():
    network = SoundToPoints(Audio2BodyParams.tables(), HANDS_12, "piano", 15, NOWHERE)
    assert parameter_count(network) == 187_015
    assert torch.equal(network.lstm.bias_ih_l0[200:400], torch.ones(200))
    assert Audio2BodyParams.tables().delay_steps == 2
    assert Audio2BodyParams.section_4().delay_steps == 5


def fake_set(count: int = 4, *, seed: int = 0, params: Audio2BodyParams = TINY) -> PlayedSet:
    """Points that follow the sound: each moves with one of its channels."""
    rng = np.random.default_rng(seed)
    fakes = []
    for number in range(count):
        sound = np.cumsum(rng.normal(size=(60, params.n_sound)), axis=0).astype(np.float32)
        points = 100 + 10 * np.tile(sound[:, :1], (1, 24)) + rng.normal(size=(60, 24))
        accepted = np.ones(60, bool)
        accepted[10:13] = False
        fakes.append(PlayedSequence(f"piece {number}", f"{number}", sound, points, accepted, accepted))
    return PlayedSet(tuple(fakes), HANDS_12, "piano", params, NOWHERE, "synthetic")


SPLIT = PlayedSplit(("piece 0", "piece 1", "piece 2"), (), ("piece 3",))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "run"
    train_audio2body(fake_set(), SPLIT, TrainOptions(folder))
    return folder


def test_rejected_frames_have_no_gradient():
    data = fake_set()
    space = PointSpace.fit(np.concatenate([each.points for each in data.sequences]), 3)
    windows = PlayedWindows.of(data.sequences, space, TINY)
    components = torch.zeros_like(windows.target, requires_grad=True)
    terms(components, windows, "squared")["error"].backward()
    assert not components.grad[windows.mask == 0].any()
    assert components.grad[windows.mask > 0].any()
    assert windows.mask[0, : TINY.delay_steps].tolist() == [0.0, 0.0]


def test_windows_in_a_row_are_one_pass():
    network = SoundToPoints(replace(TINY, carry=3), HANDS_12, "piano", 3, NOWHERE).eval()
    sound = torch.randn(2, 72, 28)
    torch.testing.assert_close(training.windows_passed(network, sound), network(sound)[0], atol=1e-6, rtol=0)


@pytest.mark.slow
def test_training_learns_and_keeps_the_errors_of_all_sides(run: Path):
    data = fake_set(params=replace(TINY, epochs=40))
    folder = run.parent / "longer"
    network = train_audio2body(data, SPLIT, TrainOptions(folder))
    test = [data.sequences[3]]
    assert errors(network, test).full < 0.7 * mean_pose_errors(network, test).full
    assert errors(network, test).projected <= errors(network, test).full
    stored = read_about(folder)["meta"]["errors"]
    assert set(stored) == {"train", "validation", "test", "mean pose"}
    assert stored["test"]["full"] == pytest.approx(errors(network, test).full, rel=1e-5)


def test_a_piece_on_two_sides_is_refused():
    data = fake_set()
    doubled = replace(data.sequences[3], piece="0")
    refused("its piece is trained on in 'piece 0'", sequences.check_pieces, [*data.sequences[:3], doubled], SPLIT)
    refused("two sides", PlayedSplit, ("a",), (), ("a",))
    refused("no performance here", sequences.check_pieces, data.sequences[:2], SPLIT)


def test_a_performance_is_as_long_as_its_sound(run: Path):
    network = load_weights(run, SoundToPoints)
    audio = Audio(noise(3.0), RATE)
    whole = synthesize_performance(network, audio)
    assert (whole.n_frames, whole.fps, whole.skeleton) == (72, 24.0, HANDS_12)
    part = synthesize_performance(network, audio, start=1.0, seconds=1.0)
    np.testing.assert_array_equal(part.positions, whole.positions[24:48])
    refused("within the recording", synthesize_performance, network, audio, start=3.5)
    refused("two frames", synthesize_performance, network, audio, seconds=0.05)
    pianist = SoundToPoints(replace(network.params, hears="notes"), HANDS_12, "piano", 3, NOWHERE)
    refused("this network hears notes, not sound; pass them", synthesize_performance, pianist, audio)


def test_settings_that_cannot_be_are_named():
    refused("hears must be sound or notes", Audio2BodyParams, hears="smell")
    refused("whole number", Audio2BodyParams, components=2.5)
    refused("shares", Audio2BodyParams, dropout=1.0)
    refused("fps must be 240 at most", Audio2BodyParams, fps=1e4)
    refused("carry must be positive", Audio2BodyParams, carry=0)


def test_a_network_of_two_layers_is_built_again_and_an_older_description_has_one():
    network = SoundToPoints(replace(Audio2BodyParams.tables(), hidden=8, layers=2), PLAYER_50, "piano", 3, NOWHERE)
    assert network.lstm.num_layers == 2
    gate = network.lstm.bias_ih_l1[8:16] + network.lstm.bias_hh_l1[8:16]
    assert gate.tolist() == [1.0] * 8
    build = network.description()
    assert SoundToPoints.built(build, network.state_dict()).lstm.num_layers == 2
    del build["params"]["layers"]
    assert SoundToPoints.built(build, {}).lstm.num_layers == 1


# The bow

CELLS = notebook_cells("19_sound_to_hands")
PARAMS = replace(Audio2BodyParams.tables(), bow_phase=True, hidden=48, components=6, epochs=14, batch=8, rate=1e-2)


@pytest.fixture(scope="module")
def violin(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Seven planted violinists, five to train on: their sequences, their bow and a network of them."""
    own = list(planted_performances("violin", 7, seconds=20.0))
    names = [each.performance.name for each in own]
    parts = PlayedSplit(tuple(names[:5]), (), tuple(names[5:]))
    data = sequences.played_set([each.performance for each in own], PARAMS, parts)
    fitted = bowing.Bowing.fit(data.sequences[:5], PLAYER_50, PARAMS)
    trained = train_audio2body(data, parts, TrainOptions(tmp_path_factory.mktemp("runs") / "bow"))
    return SimpleNamespace(planted=own, split=parts, played=data, bow=fitted, network=trained)


# By hand


def test_strokes_alternate_against_weak_evidence_and_break_off_for_strong():
    assert bowing.alternating(np.array([2.0, 0.5, 0.1, -0.5, 1.0])).tolist() == [1, -1, 1, -1, 1]
    assert bowing.alternating(np.array([-2.0, 0.5, 0.1])).tolist() == [-1, 1, -1]
    # An overlooked turn: two down-bows in a row, of which five strokes on each side are sure.
    sure = np.array([3.0, -3.0, 3.0, -3.0, 3.0, 3.0, -3.0, 3.0, -3.0, 3.0])
    assert bowing.alternating(sure).tolist() == np.sign(sure).tolist()
    # One break costs log(.98 / .02) = 3.89. Evidence of 3.8 on one side of it is too little, of 4.0 enough.
    for least, signs in ((3.8, [1, -1]), (4.0, [1, 1])):
        assert bowing.alternating(np.array([9.0, least])).tolist() == signs
    assert bowing.alternating(np.zeros(0)).tolist() == []
    with np.errstate(divide="ignore"):
        assert bowing.alternating(np.array([1.0, 5.0, 5.0]), alternation=1.0).tolist() == [1, -1, 1]


def test_a_bow_stays_within_its_ends_and_is_drawn_to_its_mean():
    places = bowing.stroke_ends(np.array([0.5, -0.2, 0.9, -2.0]), start=0.25, mean=0.5, leak=0.0)
    np.testing.assert_allclose(places, [0.25, 0.75, 0.55, 1.0, 0.0])
    np.testing.assert_allclose(bowing.stroke_ends(np.zeros(2), start=0.0, mean=0.5, leak=0.1), [0.0, 0.05, 0.095])


def test_places_are_straight_lines_between_turns():
    bow = replace(bowing.Bowing.empty(1), levels=np.array([0.0, 0.5, 0.5]))
    places = bow.places(bowing.Strokes(np.array([1.0, 2.0, 3.0]), np.array([1, -1]), np.array([0.25, 0.5])), 5, 1.0)
    down = 0.5 + 0.25
    up = down + bowing.LEAK * (0.5 - down) - 0.5
    np.testing.assert_allclose(places, [0.5, 0.5, down, up, up])


def test_turns_are_read_from_bumps_and_moved_back():
    times = np.arange(0, 4, 1 / 96)
    turns = np.array([0.5, 1.003, 2.71])
    signal = bowing.PEAK * np.exp(-np.square((times[:, None] - turns - bowing.LATENESS) / 0.03) / 2).max(axis=1)
    np.testing.assert_allclose(bowing.turns_of(signal, 96.0), turns, atol=1e-3)
    assert bowing.turns_of(0.1 * signal, 96.0).size == 0
    assert bowing.turns_of(np.zeros(50), 96.0).size == 0


def test_strokes_have_their_mean_loudness_and_duration():
    loud = np.repeat([1.0, 3.0], 12)
    sounds = bowing.stroke_sounds(np.array([0.0, 0.5, 1.0]), loud, FPS)
    np.testing.assert_allclose(sounds, [[np.log(0.5), 1.0], [np.log(0.5), 3.0]])
    np.testing.assert_allclose(bowing.stroke_sounds(np.array([0.25, 0.75]), loud, FPS), [[np.log(0.5), 2.0]])
    assert bowing.stroke_sounds(np.zeros(1), loud, FPS).shape == (0, 2)


def test_contrasts_are_differences_to_the_neighbours():
    contrasts = bowing.stroke_contrasts(np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 4.0]]))
    assert contrasts.shape == (3, 4 * bowing.AROUND + 1)
    # Two before, one before, one after, two after; beyond the ends the last one stands for all.
    np.testing.assert_allclose(contrasts[:, 1::2], [[0, 0, -1, -3], [1, 1, -2, -2], [3, 2, 0, 0]])
    np.testing.assert_allclose(contrasts[:, -1], 1.0)
    assert bowing.stroke_contrasts(np.zeros((0, 2))).shape == (0, 4 * bowing.AROUND + 1)


def test_the_discriminant_is_the_log_odds_of_two_normal_distributions():
    rng = np.random.default_rng(0)
    truth = np.arange(40000) % 2 == 0
    values = np.column_stack([np.where(truth, 1.0, -1.0) + 2 * rng.normal(size=truth.size), np.ones(truth.size)])
    np.testing.assert_allclose(bowing.discriminant(values, truth), [2 * 1.0 / 4, 0.0], atol=0.02)
    assert not bowing.discriminant(values, np.ones(truth.size, bool)).any()


def test_a_bow_that_hears_nothing_stays_at_its_start():
    bow = replace(bowing.Bowing.empty(2), levels=np.array([0.0, 0.6, 0.3]))
    silence = np.full(48, -13.8)
    strokes = bow.strokes(np.zeros(0), silence, FPS)
    assert (strokes.turns.size, strokes.signs.size) == (1, 0)
    np.testing.assert_allclose(bow.places(strokes, 48, FPS), 0.3)
    assert bow.strokes(np.array([1.5]), silence, FPS).turns[1] == pytest.approx(1.5 + 1 / FPS)


# On the planted violinist


@pytest.mark.slow
def test_the_bow_of_the_points_is_the_planted_one(violin: SimpleNamespace):
    for each, sequence in zip(violin.planted, violin.played.sequences, strict=True):
        good = sequence.accepted
        assert each.bow is not None
        assert np.corrcoef(violin.bow.place(sequence.points)[good], each.bow[good])[0, 1] > 0.98
        rest, place = violin.bow.at_rest(sequence.points), violin.bow.place(sequence.points)
        np.testing.assert_allclose(violin.bow.at_place(rest, place), sequence.points, atol=1e-9)
        # Read through its own effect, the place of a bow at rest is the mean one, give or take string crossings.
        assert np.std(violin.bow.place(rest)[good]) < 0.2 * np.std(place[good])
    assert 0.5 < violin.bow.law[1] < 1.0  # planted: loudness (half the log energy) x duration^0.8
    assert 0.35 < violin.bow.law[2] < 0.65


@pytest.mark.slow
def test_the_turn_signal_has_a_bump_after_each_turn(violin: SimpleNamespace):
    signal = bowing.turn_signal(violin.played.sequences[0], PLAYER_50, FPS)
    turns = bowing.turns_of(np.interp(np.arange(0, signal.size - 1, 0.25), np.arange(signal.size), signal), 4 * FPS)
    times = violin.planted[0].strikes.times
    assert abs(turns.size - times.size) <= 2
    around = np.round(times[:, None] * FPS).astype(int) + np.arange(-2, 3)
    tracked = violin.played.sequences[0].accepted[around.clip(0, signal.size - 1)].all(axis=1)
    assert tracked.sum() > 20
    away = np.abs(times[tracked, None] - turns).min(axis=1)
    assert np.median(away) < 0.02
    assert np.mean(away < 0.06) > 0.9


@pytest.mark.slow
def test_directions_follow_from_planted_turns_alone(violin: SimpleNamespace):
    for each, sequence in zip(violin.planted[5:], violin.played.sequences[5:], strict=True):
        strokes = violin.bow.strokes(each.strikes.times, bowing.loudness(sequence.sound, PARAMS), FPS)
        assert strokes.signs.tolist() == [(-1) ** number for number in range(len(each.strikes))]
        assert (CELLS.true_signs(strokes, each.bow, FPS) == strokes.signs)[:-1].all()


def test_the_network_comes_below_the_ceiling_of_those_that_do_not_know_the_direction(violin: SimpleNamespace):
    test = violin.played.sequences[5:]
    truth = [CELLS.planted_points(each, violin.network.reference) for each in violin.planted[5:]]
    projected = [violin.network.projected(each.points) for each in test]
    ceiling = errors_between([violin.bow.at_rest(points) for points in truth], projected, test)
    floor = errors_between(truth, projected, test)
    full = errors(violin.network, test).full
    assert floor.full < full < 0.85 * ceiling.full
    assert ceiling.full < mean_pose_errors(violin.network, test).full
    outcome = CELLS.bow_errors(violin.network, test)
    assert outcome["predicted"] == pytest.approx(full)
    assert outcome["true place"] < outcome["predicted"]
    assert outcome["directions right"] > 0.8
    assert outcome["strokes"] == sum(predicted_strokes(violin.network, each.sound).signs.size for each in test)


def test_a_performance_follows_its_strokes(violin: SimpleNamespace):
    sequence, performance = violin.played.sequences[5], violin.planted[5].performance
    points = predicted_points(violin.network, sequence.sound)
    motion = synthesize_performance(violin.network, performance.audio)
    np.testing.assert_allclose(motion.positions.reshape(len(points), -1), points, atol=1e-6)
    part = synthesize_performance(violin.network, performance.audio, seconds=3.0)
    np.testing.assert_array_equal(part.positions, motion.positions[: part.n_frames])
    strokes = predicted_strokes(violin.network, sequence.sound)
    turned = predicted_points(violin.network, sequence.sound, strokes=strokes._replace(signs=-strokes.signs))
    assert np.abs(turned - points).max() > 20


def test_weights_keep_the_bow(violin: SimpleNamespace, tmp_path: Path):
    save_weights(tmp_path / "again", violin.network)
    again = load_weights(tmp_path / "again", SoundToPoints)
    sound = violin.played.sequences[6].sound
    np.testing.assert_array_equal(predicted_points(again, sound), predicted_points(violin.network, sound))


def test_the_loss_of_windows_has_the_turns_and_their_error_has_not(violin: SimpleNamespace):
    network, train, _ = training.prepared(violin.played, violin.split)
    without = replace(violin.played, params=replace(PARAMS, bow_phase=False))
    plain, plain_train, _ = training.prepared(without, violin.split)
    assert (train.target.shape[2], plain_train.target.shape[2]) == (7, 6)
    assert (network.linear.out_features, plain.linear.out_features) == (7, 6)
    assert "bow_scale.effect" in network.state_dict()
    assert not any("bow" in name for name in plain.state_dict())
    assert 0 <= float(train.target[..., 6].min()) < 0.01 < 0.9 < float(train.target[..., 6].max()) / bowing.PEAK <= 1


def test_correlations_of_components():
    space = PointSpace(np.zeros(3), np.eye(3), np.ones(3))
    truth = np.array([[1.0, 0.0, 5.0], [2.0, 1.0, 5.0], [3.0, 0.0, 5.0]])
    predicted = truth * (2, -1, 1)
    values = CELLS.component_correlations(space, [predicted[:2], predicted[2:]], [truth[:2], truth[2:]])
    np.testing.assert_allclose(values, [1.0, -1.0, np.nan])


# Refused


def test_bow_phase_is_refused_where_there_is_no_bow(violin: SimpleNamespace):
    refused("bow_phase is of violinists", SoundToPoints, PARAMS, PLAYER_50, "piano", 3, NOWHERE)
    refused("bow_phase is of violinists", training.prepared, replace(violin.played, instrument="piano"), violin.split)
    refused("left_shoulder", training.prepared, replace(violin.played, skeleton=HANDS_12), violin.split)
    plain = SoundToPoints(replace(PARAMS, bow_phase=False), PLAYER_50, "violin", 3, NOWHERE)
    refused("without bow_phase", predicted_strokes, plain, violin.played.sequences[0].sound)
    refused("without bow_phase", CELLS.bow_errors, plain, violin.played.sequences)
    still = replace(violin.played.sequences[0], points=np.zeros_like(violin.played.sequences[0].points))
    refused("10 strokes or more; these recordings have 0", bowing.Bowing.fit, [still], PLAYER_50, PARAMS)
