"""Key points of musicians for Audio to Body Dynamics: bad frames, gaps, several detectors, camera shots, placing."""

import itertools
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import bench_audio2body
from harmolab.body.kinematics import Similarity
from harmolab.musician.cleaning import (
    RULES,
    CleaningRules,
    cleaned,
    placed,
    reference_configuration,
    rejected_examples,
    shot_similarities,
    training_frames,
    usable_steps,
)
from harmolab.musician.performances import Performance
from harmolab.musician.synthetic import FAULTS, PlantedPerformance, planted_performance
from harmolab.readers.player_points import HANDS_12, INSTRUMENTS, PLAYER_50, SIDES, hand_joints, player_skeleton
from harmolab.types import FloatArray, Motion
from tests.builders import cases, refused

FPS = 24.0
# Left and right shoulder, elbow, wrist and hip; the box around the whole player is 300 wide, the shoulders 100.
BODY = [[250, 100], [350, 100], [220, 180], [380, 180], [200, 240], [400, 240], [265, 260], [335, 260]]
WIDTH = 300.0
HANDS = {side: [PLAYER_50.joints.index(name) for name in hand_joints(side)] for side in SIDES}


def pose() -> FloatArray:
    """(50, 2) points of a player: fingers 10 to 40 below the wrists, 50 outwards at most."""
    hands = []
    for side, wrist in zip((-1, 1), (BODY[4], BODY[5]), strict=True):
        offsets = [
            (0.0, 0.0),
            *((side * 12.5 * finger, 10.0 * phalanx) for finger in range(5) for phalanx in range(1, 5)),
        ]
        hands.append(np.array(wrist) + offsets)
    return np.concatenate([np.array(BODY, float), *hands])


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


def test_players_box_is_as_wide_as_said() -> None:
    assert np.ptp(pose()[:, 0]) == WIDTH


# Rejecting (reading 8).


# A recording that begins with a small jump has nothing yet to hold it against.
@cases("fault, first", *itertools.product(("swapped", "missing", "centre"), (0, 40, 91)), ("jump", 40), ("jump", 91))
def test_each_fault_is_rejected_by_its_rule_and_nothing_else_is(fault: str, first: int) -> None:
    result = cleaned(with_fault(fault, slice(first, first + 5)))
    expected = np.full(96, "", dtype="<U9")
    expected[first : first + 5] = fault
    np.testing.assert_array_equal(result.broken, expected)
    np.testing.assert_array_equal(result.accepted, expected == "")
    assert result.report() == {rule: 5 / 96 * (rule == fault) for rule in RULES}


def test_mean_movement_of_a_tenth_of_the_box_is_the_limit() -> None:
    points = np.repeat(pose()[None], 30, axis=0)
    points[10] += [0.0, 0.0999 * WIDTH]
    points[20] += [0.0, 0.1001 * WIDTH]
    assert list(np.flatnonzero(~cleaned(performance(points)).accepted)) == [20]


def test_centre_may_move_by_its_share_where_the_jump_is_not_tested() -> None:
    points = np.repeat(pose()[None], 30, axis=0)
    points[10] += [0.0, 0.349 * WIDTH]
    points[20] += [0.0, 0.351 * WIDTH]
    assert list(np.flatnonzero(~cleaned(performance(points), CleaningRules(jump=None)).accepted)) == [20]


def test_after_half_a_second_without_an_accepted_frame_the_next_is_accepted_anew() -> None:
    points = playing()
    points[40:] += [0.0, 40.0]
    for fps, n_rejected in ((24.0, 12), (30.0, 15)):
        result = cleaned(performance(points, fps=fps), CleaningRules(cut=None))
        assert list(np.flatnonzero(~result.accepted)) == list(range(40, 40 + n_rejected))


def test_error_as_long_as_the_longest_run_does_not_lock_the_player_out() -> None:
    points = playing()
    points[40:52] += [0.0, 40.0]
    assert list(np.flatnonzero(~cleaned(performance(points)).accepted)) == list(range(40, 52))


def test_hands_that_stay_swapped_are_rejected_as_long_as_they_are() -> None:
    assert cleaned(with_fault("swapped", slice(30, 90))).report()["swapped"] == 60 / 96


def test_whole_arms_that_stay_swapped_show_by_their_forearms() -> None:
    points = playing()
    wrists = [PLAYER_50.joints.index(f"{side}_wrist") for side in SIDES]
    left, right = [wrists[0], *HANDS["left"]], [wrists[1], *HANDS["right"]]
    points[60:, left + right] = points[60:, right + left]
    assert list(np.flatnonzero(cleaned(performance(points)).broken == "swapped")) == list(range(60, 96))


def test_arms_that_cross_are_no_error() -> None:
    """Elbows 60 apart, forearms of 100 that cross over two seconds: each hand ends nearer to the other elbow."""
    angle = np.concatenate([np.linspace(0, 0.9, 48), np.full(48, 0.9)])
    joints = ("left_elbow", "right_elbow", "left_wrist", "right_wrist")
    elbows = np.repeat(np.array([[[270.0, 180.0], [330.0, 180.0]]]), 96, axis=0)
    forearm = 100 * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    wrists = np.stack([elbows[:, 0] + forearm, elbows[:, 1] + forearm * [-1, 1]], axis=1)
    result = cleaned(performance(np.concatenate([elbows, wrists], axis=1), joints=joints), CleaningRules(jump=None))
    assert wrists[-1, 0, 0] > wrists[-1, 1, 0] + 80
    assert result.accepted.all()


def test_recording_that_begins_with_another_person_begins_at_the_player() -> None:
    assert list(cleaned(with_fault("centre", slice(0, 6))).broken[:7]) == ["centre"] * 6 + [""]


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


@pytest.mark.parametrize("seed", range(5))
def test_fast_walk_agrees_with_the_plain_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.repeat(pose()[None], 300, axis=0) + rng.normal(0, 2, (300, 50, 2))
    points += np.where(rng.random((300, 1, 1)) < 0.6, 0, rng.uniform(-110, 110, (300, 1, 2)))
    points[:13] = pose()  # so that both begin at frame 0
    result = cleaned(performance(points), CleaningRules(swapped=None, cut=None))
    assert list(result.broken) == plain_walk(points)
    assert {"", "centre", "jump"} == set(result.broken)


def test_rules_that_are_off_reject_and_change_nothing() -> None:
    planted = with_fault("missing", slice(0, 96))
    result = cleaned(planted, CleaningRules.off())
    assert result.accepted.all()
    np.testing.assert_array_equal(result.motion.positions, planted.motion.positions)


def test_frames_that_a_reader_marked_as_not_valid_count_as_missing() -> None:
    planted = performance(playing())
    valid = np.arange(96) % 10 != 4
    result = cleaned(replace(planted, motion=replace(planted.motion, valid=valid)))
    np.testing.assert_array_equal(result.broken == "missing", ~valid)


def test_performance_without_a_frame_that_can_be_used_is_refused_by_name() -> None:
    planted = with_fault("missing", slice(0, 96))
    refused(r"a player: no frame is left; missing rejects 100%.*right_hand is not detected", cleaned, planted)
    with pytest.raises(ValueError, match="a player: no frame is left; signature rejects 100%"):
        cleaned(performance(playing()), signature=lambda frame, box: False)


def test_signature_is_asked_about_the_box_of_each_complete_frame() -> None:
    calls = {}

    def is_player(frame: int, box: FloatArray) -> bool:
        calls[frame] = box
        return not 20 <= frame < 30

    result = cleaned(with_fault("missing", slice(50, 60)), signature=is_player)
    assert sorted(calls) == [*range(50), *range(60, 96)]
    np.testing.assert_allclose(calls[0], [150.0, 100.0, 450.0, 280.0])
    assert list(np.flatnonzero(result.broken == "signature")) == list(range(20, 30))


@pytest.mark.parametrize(
    "joints",
    [HANDS_12.joints, PLAYER_50.joints[:8], hand_joints("left"), ("left_shoulder", "right_shoulder")],
    ids=["fingertips", "body", "one hand", "shoulders"],
)
def test_parts_of_a_player_are_cleaned(joints: tuple[str, ...]) -> None:
    points = np.repeat(pose()[None], 40, axis=0)
    points[10:13] += [500.0, 0.0]
    result = cleaned(part(points, joints))
    assert list(np.flatnonzero(~result.accepted)) == [10, 11, 12]
    np.testing.assert_allclose(result.motion.positions, np.repeat(result.motion.positions[:1], 40, axis=0))


def test_two_frames_are_enough() -> None:
    assert cleaned(performance(playing(2))).accepted.all()


def test_example_of_a_rule_is_its_frame_of_most_movement() -> None:
    points = with_fault("jump", slice(30, 34)).motion.positions.copy()
    points[32] += [0.0, -20.0]
    detected = np.ones((96, 50), bool)
    detected[70:73, 9] = False
    examples = rejected_examples(cleaned(replace(performance(points), detected=detected)))
    assert set(examples) == {"jump", "missing"}
    assert examples["jump"] == 32
    assert examples["missing"] in (70, 71, 72)


@pytest.mark.parametrize("setting", [{"jump": 0.0}, {"centre": -1.0}, {"longest_run": np.inf}, {"cut": np.nan}])
def test_limit_that_cannot_be_is_refused_by_name(setting: dict[str, float]) -> None:
    refused(f"{next(iter(setting))} must be positive", CleaningRules, **setting)


# Gaps (reading 9).


def test_rejected_frames_lie_on_lines_between_accepted_ones() -> None:
    points = np.repeat(pose()[None], 20, axis=0)
    points[:, :, 0] += np.arange(20)[:, None]
    line = points.copy()
    points[8:11] += 150.0
    points[:2] += 300.0
    points[18:] += 300.0
    result = cleaned(performance(points))
    assert list(np.flatnonzero(~result.accepted)) == [0, 1, 8, 9, 10, 18, 19]
    np.testing.assert_allclose(result.motion.positions[2:18], line[2:18])
    np.testing.assert_allclose(result.motion.positions[[0, 1, 18, 19]], line[[2, 2, 17, 17]])


def test_gaps_are_masked_counted_or_cut_out() -> None:
    result = cleaned(with_fault("jump", slice(40, 45)))
    masked, counted, spliced = (training_frames(result.accepted, gaps) for gaps in ("mask", "interpolate", "splice"))
    assert list(np.flatnonzero(~masked[1])) == [40, 41, 42, 43, 44]
    assert counted[1].all() and spliced[1].all()
    assert list(masked[0]) == list(counted[0]) == list(range(96))
    assert list(spliced[0]) == [*range(40), *range(45, 96)]


def test_step_is_usable_where_both_frames_around_it_are() -> None:
    usable = np.array([True, True, False, True, True])
    assert list(usable_steps(usable, 1)) == list(usable)
    # Frames are steps 0, 4, 8, 12, 16; frame 2 spoils all steps from 5 to 11.
    assert list(np.flatnonzero(~usable_steps(usable, 4))) == [5, 6, 7, 8, 9, 10, 11]
    assert list(usable_steps(np.array([True]), 4)) == [True]
    refused("1 or more steps", usable_steps, usable, 0)


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
def test_cut_between_two_shots_is_at_its_frame(camera: Similarity) -> None:
    result = cleaned(performance(two_shots(camera=camera)))
    assert list(result.starts) == [0, 150]
    assert result.accepted.all()


def test_errors_at_a_cut_do_not_hide_it() -> None:
    points = two_shots()
    points[146:150] += [-200.0, 40.0]
    points[150:153] += [150.0, 0.0]
    result = cleaned(performance(points))
    assert len(result.starts) == 2
    assert 146 <= result.starts[1] <= 153
    assert list(np.flatnonzero(~result.accepted)) == list(range(146, 153))


def test_what_is_no_cut_is_one_shot() -> None:
    time = np.arange(300) / FPS
    swaying = playing(300) + 60 * np.sin(2 * np.pi * time / 1.5)[:, None, None]  # up to 250 pixels a second
    assert list(cleaned(performance(swaying)).starts) == [0]
    leaping = np.repeat(pose()[None], 300, axis=0)
    leaping[150:, HANDS["left"] + HANDS["right"], 0] += 60.0
    assert list(cleaned(performance(leaping)).starts) == [0]
    assert list(cleaned(part(leaping, HANDS_12.joints)).starts) == [0]
    other = playing(300)
    other[100:112] += 200.0
    assert list(cleaned(performance(other)).starts) == [0]


def test_each_shot_is_placed_by_itself() -> None:
    truth = playing(300)
    result = cleaned(performance(two_shots()))
    reference = reference_configuration(cleaned(performance(truth)))
    first, second = shot_similarities(result, reference)
    assert [first.scale, first.rotation] == pytest.approx([1.0, 0.0], abs=0.005)
    assert second.scale == pytest.approx(1 / 1.1, rel=0.005)
    assert second.rotation == pytest.approx(-np.radians(4.0), abs=np.radians(0.25))
    away = placed(result, reference).positions - truth
    assert np.abs(away.mean(axis=0)).max() < 0.5


def test_gap_at_a_cut_is_filled_from_its_own_shot() -> None:
    points = two_shots(camera=Similarity(1.0, 0.0, np.array([0.0, 300.0])))
    detected = np.ones((300, 50), bool)
    detected[145:150, 0] = detected[152:154, 0] = False
    result = cleaned(replace(performance(points), detected=detected))
    y = result.motion.positions[:, 0, 1]
    assert y[: result.starts[1]].max() < 110 and y[result.starts[1] :].min() > 390


def test_reference_is_the_medians_of_shoulders_and_hips_of_the_longest_shot() -> None:
    points = np.repeat(pose()[None], 201, axis=0)
    points[70:] += [0.0, 50.0]
    points[130:132] += [900.0, 0.0]
    reference = reference_configuration(cleaned(performance(points)))
    assert reference.joints == ("left_shoulder", "right_shoulder", "left_hip", "right_hip")
    np.testing.assert_allclose(reference.points, np.array(BODY)[[0, 1, 6, 7]] + [0, 50])
    assert reference.shoulder_width == 100.0


def test_shoulders_alone_place_a_player_without_hips() -> None:
    whole = cleaned(performance(playing()))
    upper = part(CAMERA.apply(playing()), PLAYER_50.joints[:6])
    fit = shot_similarities(cleaned(upper), reference_configuration(whole))[0]
    assert (fit.scale, fit.rotation) == (pytest.approx(1 / CAMERA.scale), pytest.approx(-CAMERA.rotation))


def test_hands_without_shoulders_are_placed_by_the_medians_of_their_wrists() -> None:
    joints = (*hand_joints("left"), *hand_joints("right"))
    reference = reference_configuration(cleaned(part(playing(), joints)))
    assert reference.joints == ("left_hand", "right_hand")
    assert np.isnan(reference.shoulder_width)
    result = cleaned(part(CAMERA.apply(playing()), joints))
    np.testing.assert_allclose(placed(result, reference).positions, part(playing(), joints).motion.positions)


@pytest.mark.parametrize("joints", [HANDS_12.joints, hand_joints("left")], ids=["fingertips", "one hand"])
def test_hands_that_nothing_tells_the_place_of_stay_as_they_are(joints: tuple[str, ...]) -> None:
    reference = reference_configuration(cleaned(part(playing(), joints)))
    result = cleaned(part(CAMERA.apply(playing()), joints))
    assert reference.joints == ()
    np.testing.assert_array_equal(placed(result, reference).positions, result.motion.positions)
    assert shot_similarities(result, reference)[0].scale == 1.0


def test_recording_without_the_anchors_of_the_reference_is_refused_by_name() -> None:
    whole, tips = cleaned(performance(playing())), cleaned(part(playing(), HANDS_12.joints))
    with pytest.raises(ValueError, match="a player: has nothing to be aligned by, the reference left_shoulder"):
        placed(tips, reference_configuration(whole))
    refused("the reference nothing; take recordings with the same points", placed, whole, reference_configuration(tips))
    assert placed(tips, reference_configuration(whole), alignment="none") is tips.motion
    with pytest.raises(ValueError, match="alignment must be recording, frame or none, got 'video'"):
        placed(whole, reference_configuration(whole), alignment="video")


@pytest.mark.parametrize("alignment", ["recording", "frame"])
def test_shoulders_in_one_place_are_refused_by_name(alignment: str) -> None:
    points = playing()
    points[:, [1, 6, 7]] = points[:, :1]
    reference = reference_configuration(cleaned(performance(playing())))
    with pytest.raises(ValueError, match="a player: the points lie in one place"):
        placed(cleaned(performance(points)), reference, alignment=alignment)


def test_each_frame_may_be_placed_by_itself() -> None:
    result = cleaned(performance(playing()))
    reference = reference_configuration(result)
    aligned = placed(result, reference, alignment="frame").positions
    np.testing.assert_allclose(aligned[:, [0, 1, 6, 7]], np.repeat(reference.points[None], 96, axis=0), atol=1e-9)
    # The keyboard holds the hands: they went 10 pixels; the body's 3 were taken off.
    assert np.ptp(aligned[:, HANDS["left"][0], 0]) == pytest.approx(2 * 7, abs=0.1)


# Planted players: faults and cameras whose truth is known.


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_faults_are_rejected_and_few_good_frames_are(instrument: str) -> None:
    planted = [planted_performance(instrument, seed=seed, sample_rate=8000) for seed in range(21, 29)]
    fault = np.concatenate([one.fault for one in planted])
    results = [cleaned(one.performance) for one in planted]
    broken = np.concatenate([result.broken for result in results])
    shares = {
        kind or "good": {rule: np.mean(broken[fault == kind] == rule) for rule in RULES} for kind in ("", *FAULTS)
    }
    for kind, by_rule in shares.items():
        print(instrument, f"{kind:14s}", " ".join(f"{rule} {share:.3f}" for rule, share in by_rule.items()))
    assert sum(shares.pop("good").values()) <= 0.08
    assert {kind: sum(by_rule.values()) >= 0.95 for kind, by_rule in shares.items()} == dict.fromkeys(FAULTS, True)
    assert shares["swapped hands"]["swapped"] >= 0.95
    assert shares["missing hand"]["missing"] == 1
    assert [list(result.starts) for result in results] == [[0]] * 8


def in_own_picture(planted: PlantedPerformance) -> Performance:
    """The performance without camera, noise and faults."""
    clean = planted.camera.inverse().apply(planted.clean)
    return replace(planted.performance, motion=Motion(clean, FPS, PLAYER_50), detected=None)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_planted_camera_is_recovered_under_noise_and_faults(instrument: str, seed: int) -> None:
    planted = planted_performance(instrument, seed=seed, sample_rate=8000)
    reference = reference_configuration(cleaned(in_own_picture(planted)))
    (fit,) = shot_similarities(cleaned(planted.performance), reference)
    truth = planted.camera.inverse()
    assert fit.scale == pytest.approx(truth.scale, rel=0.01)
    assert fit.rotation == pytest.approx(truth.rotation, abs=np.radians(0.5))
    assert np.abs(fit.apply(planted.clean) - truth.apply(planted.clean)).max() < 1.0


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_hands_placed_frame_by_frame_take_the_sway_of_the_body(instrument: str) -> None:
    planted = planted_performance(instrument, seed=4, sample_rate=8000)
    own = in_own_picture(planted)
    reference, result = reference_configuration(cleaned(own)), cleaned(planted.performance)
    numbers, error = HANDS["left"] + HANDS["right"], {}
    for alignment in ("recording", "frame"):
        away = placed(result, reference, alignment=alignment).positions - own.motion.positions
        error[alignment] = float(np.sqrt(np.mean(away[result.accepted][:, numbers] ** 2)))
    print(instrument, error)
    assert error["recording"] < 1.2  # 1 pixel of noise
    assert error["frame"] > 1.5 * error["recording"]


# Speed.


@pytest.mark.slow
def test_an_hour_of_frames_is_cleaned_and_placed_in_a_second() -> None:
    hour, seconds = bench_audio2body.hour_of_points(), []
    for _ in range(3):
        start = time.process_time()  # of this process: other work on the machine does not count
        bench_audio2body.aligned(hour)
        seconds.append(time.process_time() - start)
    assert min(seconds) < 1.0
    assert cleaned(hour).accepted.mean() == pytest.approx(0.9, abs=0.02)


# Real tracked points: shares are printed, not judged.


@pytest.mark.data
@pytest.mark.parametrize("name", ["pianist_side_view", "piano_top_view", "violinist"])
def test_tracked_players_are_cleaned(name: str, data_root: Path) -> None:
    path = data_root / "instruments" / "tracked" / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"no tracked players: {path} is not there")
    tracked = tracked_performance(path)
    result = cleaned(tracked)
    print(name, f"{result.accepted.mean():.3f} accepted", result.report(), f"{len(result.starts)} shots")
    assert np.isfinite(result.motion.positions).all()
    np.testing.assert_array_equal(result.motion.positions[result.accepted], tracked.motion.positions[result.accepted])


def tracked_performance(path: Path) -> Performance:
    """Tracked points, NaN where lost, with lines over what was lost."""
    with np.load(path) as file:
        names = [str(name) for name in file["joints"]] if "joints" in file else []
        groups = ([("body", names)] if names else []) + [(f"{side}_hand", hand_joints(side)) for side in SIDES]
        groups = [(group, joints) for group, joints in groups if group in file]
        values = np.concatenate([file[group] for group, _ in groups], axis=1).astype(float)
        fps = float(file["fps"])
    joints = [joint for _, group_joints in groups for joint in group_joints]
    keep = [number for number, joint in enumerate(joints) if joint in PLAYER_50.joints]
    points, frames = values[:, keep], np.arange(len(values))
    detected = np.isfinite(points).all(axis=2)
    for point, axis in np.ndindex(points.shape[1:]):
        there = detected[:, point]
        points[:, point, axis] = np.interp(frames, frames[there], points[there, point, axis])
    motion = Motion(points, fps, player_skeleton([joints[number] for number in keep]))
    return Performance(path.stem, "violin" if "violin" in path.stem else "piano", None, motion, detected)
