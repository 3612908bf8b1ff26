"""Motion to visual beats, on movements whose stops and turns are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from harmolab.beats.visual import curve_beats, curve_delay, motion_curve, visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.params import HarmonyParams
from harmolab.types import Motion
from tests.builders import planted_dance, refused

PLAIN = HarmonyParams(fps=None, visual_threshold=None)
Swing = Callable[..., Motion]


def stops(hertz: float, seconds: float) -> np.ndarray:
    """When a swinging arm rests, well inside the clip."""
    times = (np.arange(100) + 0.5) / (2 * hertz)
    return times[(times > 0.3) & (times < seconds - 0.3)]


def farthest(wanted: np.ndarray, found: np.ndarray) -> float:
    """The largest distance from a wanted time to the nearest one found."""
    return float(np.abs(wanted[:, None] - found).min(axis=1).max())


@pytest.mark.parametrize("fps", [15.0, 25.0, 60.0, 120.0])
def test_valleys_lie_where_the_arm_rests_at_every_frame_rate(swinging_arm: Swing, fps: float):
    beats = visual_beats(swinging_arm(1.0, fps), params=HarmonyParams.valleys()).times
    assert farthest(stops(1.0, 6.0), beats) < 0.01


def test_peaks_lie_half_way_between_the_stops(swinging_arm: Swing):
    params = replace(HarmonyParams.valleys(), detector="peaks")
    beats = visual_beats(swinging_arm(1.0, 60.0), params=params).times
    assert farthest(stops(1.0, 5.5) + 0.25, beats) < 0.01


def test_turns_are_the_valleys_and_the_peaks(swinging_arm: Swing):
    motion = swinging_arm(1.3, 60.0)
    tracks = {
        name: visual_beats(motion, params=replace(PLAIN, detector=name)).times for name in ("turns", "valleys", "peaks")
    }
    np.testing.assert_array_equal(tracks["turns"], np.sort(np.concatenate([tracks["valleys"], tracks["peaks"]])))


def test_paper_mode_places_beats_on_frames_of_15_per_second(swinging_arm: Swing):
    frames = visual_beats(swinging_arm(1.0, 25.0)).times * 15
    np.testing.assert_allclose(frames, np.round(frames), atol=1e-9)
    assert farthest(stops(1.0, 6.0), frames / 15) <= 1 / 15


def test_a_beats_strength_is_the_speed_there():
    # 0, 3, 4, 4, 6, 9: steps of 3, 1, 0, 2, 3; a tie and a valley at the step of 0.
    positions = np.zeros((6, 1, 3))
    positions[:, 0, 0] = [0, 3, 4, 4, 6, 9]
    track = visual_beats(Motion(positions, 10.0, Skeleton.unnamed(1)), params=PLAIN)
    np.testing.assert_allclose(track.times, [0.3])
    np.testing.assert_allclose(track.strengths, [0.0])
    np.testing.assert_allclose(curve_beats(np.array([1.0, 3.0, 2.0]), 10.0, PLAIN).strengths, [3.0])


def test_speed_is_per_second_so_strengths_do_not_depend_on_the_frame_rate(swinging_arm: Swing):
    # Wrist and elbow swing through a radian at 0.6 and 0.3 m: 0.9 m * 2 pi rad/s at the fastest moment.
    for fps in (60.0, 120.0):
        curve, rate = motion_curve(swinging_arm(1.0, fps), PLAIN)
        assert curve.max() == pytest.approx(0.9 * 2 * np.pi, rel=0.01)
        assert rate == fps


def test_a_frozen_dancer_has_no_beats():
    frozen = Motion(np.tile(np.array([[[0.1, 1.7, 0.3]]]), (60, 2, 1)), 25.0, Skeleton.unnamed(2))
    for params in (HarmonyParams.paper(), HarmonyParams.valleys(), HarmonyParams.recommended(), direction()):
        assert len(visual_beats(frozen, params=params)) == 0


def direction() -> HarmonyParams:
    return replace(PLAIN, detector="direction")


def test_a_dancer_on_a_straight_course_has_no_beats():
    course = np.cumsum(np.full((60, 3, 3), 0.013), axis=0) + np.arange(3)[None, :, None] * 0.7
    moving = Motion(course, 25.0, Skeleton.unnamed(3))
    for params in (PLAIN, HarmonyParams.paper(), direction()):
        assert len(visual_beats(moving, params=params)) == 0


def test_motion_sd_finds_the_frame_at_which_one_limb_turns_back():
    steady = np.arange(20.0)
    reversing = 10.0 - np.abs(steady - 10.0)  # turns back at frame 10: the step after it goes the other way
    positions = np.stack([steady, reversing], axis=1)[:, :, None] * np.array([1.0, 0.5, 0.0])
    track = visual_beats(Motion(positions, 10.0, Skeleton.unnamed(2)), params=direction())
    np.testing.assert_allclose(track.times, [1.1])
    np.testing.assert_allclose(track.strengths, [1.0])  # turns of 2 and 0


def test_beats_on_frames_that_are_not_valid_are_left_out(swinging_arm: Swing):
    motion = swinging_arm(1.0, 60.0)
    times = np.arange(motion.n_frames) / 60
    masked = replace(motion, valid=(times < 2.0) | (times > 3.0))
    whole, rest = (visual_beats(item, params=HarmonyParams.valleys()).times for item in (motion, masked))
    np.testing.assert_array_equal(rest, whole[(whole < 2.0) | (whole > 3.0)])
    assert rest.size == whole.size - 2  # the stops at 2.25 and 2.75 s


def test_movement_in_a_picture_has_the_beats_of_the_same_movement_in_space(swinging_arm: Swing):
    space = swinging_arm(1.0, 30.0)
    picture = replace(space, positions=space.positions[:, :, :2])
    np.testing.assert_array_equal(visual_beats(space).times, visual_beats(picture).times)


def test_a_signed_speed_still_gives_strengths_that_are_not_negative(swinging_arm: Swing):
    track = visual_beats(swinging_arm(1.0, 60.0), params=replace(PLAIN, speed="signed"))
    assert len(track) > 0
    assert track.strengths.min() >= 0


def test_beats_between_frames_stand_half_a_frame_earlier():
    # A frame difference belongs to the middle of its two frames; the parabola through 1, 3, 1 is highest on the sample.
    curve = np.array([0.0, 1.0, 3.0, 1.0, 0.0])
    np.testing.assert_allclose(curve_beats(curve, 10.0, PLAIN).times, [0.2])
    np.testing.assert_allclose(curve_beats(curve, 10.0, replace(PLAIN, subframe=True)).times, [0.15])


def test_smoothing_the_positions_takes_out_sensor_noise(swinging_arm: Swing, rng: np.random.Generator):
    motion = swinging_arm(1.0, 60.0)
    noisy = replace(motion, positions=motion.positions + rng.normal(scale=0.005, size=motion.positions.shape))
    plain = replace(PLAIN, detector="valleys")
    still = replace(plain, position_smoothing=0.06, subframe=True)
    assert len(visual_beats(noisy, params=plain)) > 60  # there are 12 stops
    assert len(visual_beats(noisy, params=still)) < 20
    assert farthest(stops(1.0, 6.0), visual_beats(noisy, params=still).times) < 0.05


def test_a_motion_too_short_for_the_rate_is_refused():
    brief = Motion(np.zeros((2, 1, 3)), 60.0, Skeleton.unnamed(1))
    refused(r"a motion of 0.033 s has no two frames at 15 fps", visual_beats, brief)


@pytest.mark.parametrize("params", [HarmonyParams.valleys(), HarmonyParams.recommended()])
def test_a_curve_drawn_with_its_delay_is_lowest_at_the_valley_beats(params: HarmonyParams):
    motion = planted_dance().motion
    assert motion is not None
    curve, fps = motion_curve(motion, params)
    times = (np.arange(curve.size) - curve_delay(params)) / fps
    beats = visual_beats(motion, params=params).times
    assert beats.size > 5
    for beat in beats:
        near = np.abs(times - beat) < 2.5 / fps
        assert times[near][curve[near].argmin()] == pytest.approx(beat, abs=0.5 / fps + 1e-9)
