"""Beats of movement: of joints whose stops are known, and of pictures, by optical flow, whose stops are planted."""

import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from harmolab.beats import flow as flows
from harmolab.beats.visual import curve_beats, curve_delay, motion_curve, visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_clip
from harmolab.lab.render.stick import render_skeleton
from harmolab.params import HarmonyParams
from harmolab.readers.video import video_frames
from harmolab.types import Motion
from study.figures.moving_box import moving_box
from tests.builders import cases, planted_dance, refused

PLAIN = HarmonyParams(fps=None, visual_threshold=None)
Swing = Callable[..., Motion]


def stops(hertz: float, seconds: float) -> np.ndarray:
    """When a swinging arm rests, well inside the clip."""
    times = (np.arange(100) + 0.5) / (2 * hertz)
    return times[(times > 0.3) & (times < seconds - 0.3)]


def farthest(times: np.ndarray, others: np.ndarray) -> float:
    """The largest distance from one of `times` to the nearest of `others`."""
    return float(np.abs(times[:, None] - others[None, :]).min(axis=1).max())


@pytest.mark.parametrize("fps", [15.0, 25.0, 60.0, 120.0])
def test_valleys_lie_where_the_arm_rests_at_every_frame_rate(swinging_arm: Swing, fps: float):
    assert farthest(stops(1.0, 6.0), visual_beats(swinging_arm(1.0, fps), params=HarmonyParams.valleys()).times) < 0.01


def test_peaks_lie_half_way_between_the_stops(swinging_arm: Swing):
    beats = visual_beats(swinging_arm(1.0, 60.0), params=replace(HarmonyParams.valleys(), detector="peaks")).times
    assert farthest(stops(1.0, 5.5) + 0.25, beats) < 0.01


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


STOPS = (1.2, 2.1, 3.3, 4.2, 5.6)  # seconds
TOLERANCE = 0.04  # seconds: one frame at 25 fps


def texture(height: int, width: int, seed: int = 0) -> np.ndarray:
    """A smooth random picture, so that every place of it can be told from its neighbours."""
    coarse = np.random.default_rng(seed).integers(0, 255, (height // 8 + 2, width // 8 + 2)).astype(np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


def stopping_bar(fps: float, *, seconds: float = 7.0, height: int = 120) -> Iterator[np.ndarray]:
    """A textured bar that slides to the right or back for 0.4 s, stops dead at each of STOPS, and rests."""
    bar = texture(height // 2, height // 6)
    width = height * 4 // 3
    for time in np.arange(round(seconds * fps)) / fps:
        moves = np.clip((time - np.array(STOPS) + 0.4) / 0.4, 0, 1) * [1, -1, 1, -1, 1]
        shift = np.array([[1, 0, (0.2 + 0.35 * moves.sum()) * height], [0, 1, height / 4]])
        frame = np.full((height, width), 200, np.uint8)
        yield cv2.warpAffine(bar, shift, (width, height), dst=frame, borderMode=cv2.BORDER_TRANSPARENT)


@pytest.mark.parametrize("fps", [24.0, 25.0, 29.97, 50.0])
def test_each_sudden_stop_is_one_beat_within_a_frame(fps: float) -> None:
    track = flows.flow_beats(stopping_bar(fps), fps)
    np.testing.assert_allclose(track.times, STOPS, atol=TOLERANCE)
    assert 0 < track.strengths.min() <= track.strengths.max() == 1.0
    assert (track.fps, track.duration) == (fps, round(7.0 * fps) / fps)


def test_every_other_frame_of_a_dance_gives_the_same_clear_beats() -> None:
    frames = list(render_skeleton(synthetic_clip("jive", seconds=6.0, fps=50.0, seed=1).motion, height=120))
    full, half = flows.flow_beats(frames, 50.0), flows.flow_beats(frames[::2], 25.0)
    clear_full, clear_half = (track.times[track.strengths > 0.3] for track in (full, half))  # not those near c_2
    assert len(clear_half) >= 8
    assert farthest(clear_half, full.times) <= TOLERANCE
    assert farthest(clear_full, half.times) <= TOLERANCE


@cases("right, down, bin_", (3, 0, 0), (2, 2, 2), (0, 3, 4), (-3, 0, 8), (0, -3, 12), (3, -3, 14))
def test_a_uniform_translation_is_in_the_bin_of_its_angle_with_y_down(right: int, down: int, bin_: int) -> None:
    flow = np.broadcast_to(np.array([right, down], np.float32), (40, 60, 2))
    expected = np.zeros(16)
    expected[bin_] = np.hypot(right, down)
    np.testing.assert_allclose(flows.directogram(flow, n_bins=16), expected, rtol=1e-6)


@pytest.mark.parametrize(("right", "down", "bin_"), [(3, 0, 0), (0, 3, 4), (-3, 0, 8), (0, -3, 12)])
def test_the_flow_of_a_shifted_picture_is_the_shift(right: int, down: int, bin_: int) -> None:
    scene = texture(140, 180)
    before, after = scene[10:130, 10:170], scene[10 - down : 130 - down, 10 - right : 170 - right]
    weights = flows.directogram(flows.optical_flow(before, after), n_bins=16)
    assert weights[bin_] == pytest.approx(3.0, rel=0.1)
    assert weights[bin_] >= 0.95 * weights.sum()


def test_the_plain_wall_around_a_limb_does_not_move_with_it() -> None:
    frames = list(stopping_bar(25.0, seconds=1.2))
    moving = np.linalg.norm(flows.optical_flow(frames[24], frames[25]), axis=2) > 0.5
    bar_share = (60 * 20) / (120 * 160)
    assert bar_share <= moving.mean() <= 2.5 * bar_share


def test_displacements_up_to_still_do_not_count() -> None:
    flow = np.zeros((10, 10, 2), np.float32)
    flow[..., 0] = 0.5
    assert flows.directogram(flow, still=0.5).sum() == 0
    assert flows.directogram(flow, still=0.4).sum() == pytest.approx(0.5)


def test_speeds_are_picture_heights_per_second() -> None:
    scene = texture(120, 400)
    frames = [scene[:, 200 - 3 * i : 360 - 3 * i] for i in range(8)]  # 3 pixels to the right at 20 fps: half a height
    columns = flows.flow_directograms(frames, 20.0)
    assert columns.shape == (8, 16)
    assert columns[0].sum() == 0
    np.testing.assert_allclose(columns[1:, 0], 0.5, rtol=0.1)


def test_a_lag_of_two_frames_finds_the_same_stop() -> None:
    columns = np.zeros((14, 8))
    columns[2:8, 3] = 2.0  # moved from frame 0 to frame 7 (rows are measured over two frames)
    columns[8, 3] = 1.0
    assert flows.impact_envelope(columns, lag_frames=2).argmax() == 7


def test_turning_into_the_next_direction_counts_half_of_stopping() -> None:
    columns = np.zeros((9, 8))
    columns[:5, 3] = columns[5:, 4] = 1.0
    assert flows.impact_envelope(columns).max() == pytest.approx(0.5)


@pytest.mark.parametrize("odd_one", [0.0, 50.0], ids=["a frame shown twice", "a cut between scenes"])
def test_one_odd_frame_is_no_impact(odd_one: float) -> None:
    columns = np.zeros((12, 8))
    columns[:, 3] = 1.0
    columns[6, 3] = odd_one
    assert flows.impact_envelope(columns).max() == 0


@pytest.mark.parametrize("count", range(6))
def test_too_few_frames_for_an_impact_give_as_many_zeros(count: int) -> None:
    np.testing.assert_array_equal(flows.impact_envelope(np.ones((count, 4)), lag_frames=3), np.zeros(count))


def test_peaks_are_highest_within_the_radius() -> None:
    envelope = np.array([0, 5, 0, 9, 0, 0, 0, 4, 0.0])
    peaks = {radius: flows.local_peaks(envelope, radius_frames=radius, threshold=0.5).tolist() for radius in (1, 2, 4)}
    assert peaks == {1: [1, 3, 7], 2: [3, 7], 4: [3]}


def test_a_peak_exceeds_the_mean_around_it_by_more_than_the_threshold() -> None:
    envelope = np.array([0, 0, 3, 0, 0.0])  # the mean over the three frames in the middle is 1
    assert flows.local_peaks(envelope, radius_frames=1, threshold=1.9, mean_frames=1).tolist() == [2]
    assert flows.local_peaks(envelope, radius_frames=1, threshold=2.0, mean_frames=1).tolist() == []


def test_a_flat_top_is_one_peak_in_its_middle_and_equal_peaks_give_one() -> None:
    assert list(flows.local_peaks(np.array([0, 1, 1, 1, 0, 0.0]), radius_frames=2, threshold=0.1, mean_frames=2)) == [2]
    assert len(flows.local_peaks(np.array([0, 1, 0, 1, 0, 0.0]), radius_frames=3, threshold=0.1)) == 1


def test_an_envelope_that_is_zero_or_empty_has_no_peaks() -> None:
    assert flows.local_peaks(np.zeros(20), radius_frames=2, threshold=0.0).size == 0
    assert flows.local_peaks(np.zeros(0), radius_frames=2, threshold=0.0).size == 0


def test_the_normalised_envelope_clips_outlying_peaks_at_one() -> None:
    envelope = np.zeros(210)
    envelope[5::10] = 2.0  # 21 peaks
    envelope[105] = 100.0
    np.testing.assert_allclose(flows.normalise_envelope(envelope, radius_frames=3)[5::10], 1.0)


def test_an_envelope_below_the_floor_is_zero() -> None:
    envelope = np.array([0, 1e-5, 0, 2e-5, 0])
    np.testing.assert_array_equal(flows.normalise_envelope(envelope, radius_frames=1, floor=1e-4), np.zeros(5))


def test_beats_lie_between_frames_where_the_envelope_does() -> None:
    envelope = [0, 0, 0.5, 1.0, 1.0, 0.5, 0, 0, 0, 0.0]
    assert flows.envelope_beats(envelope, 10.0, around=0.2).times.tolist() == pytest.approx([0.35])
    refused("envelope holds NaN", flows.envelope_beats, [0.0, np.nan, 0.0], 10.0)


@pytest.mark.parametrize("noise", [0.0, 2.0, 8.0])
def test_a_frozen_video_has_no_beats_even_with_sensor_noise(noise: float, rng: np.random.Generator) -> None:
    scene = texture(120, 160).astype(float)
    frames = [np.clip(scene + rng.normal(0, noise, scene.shape), 0, 255).astype(np.uint8) for _ in range(60)]
    assert len(flows.flow_beats(frames, 25.0)) == 0
    assert flows.flow_envelope(frames, 25.0).max() == 0


def test_a_scene_that_slowly_grows_darker_and_lighter_has_no_beats() -> None:
    scene = texture(120, 160)
    frames = [(scene * (0.65 + 0.35 * np.sin(0.06 * i))).astype(np.uint8) for i in range(150)]
    assert len(flows.flow_beats(frames, 25.0)) == 0


def test_a_camera_that_stops_panning_makes_a_beat() -> None:
    scene = texture(120, 400)
    offsets = [4 * min(i, 30) for i in range(60)]  # four pixels a frame up to frame 30
    track = flows.flow_beats([scene[:, x : x + 160] for x in offsets], 25.0)
    np.testing.assert_allclose(track.times, [30 / 25], atol=TOLERANCE)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_frames_have_no_beats_and_their_own_duration(count: int) -> None:
    track = flows.flow_beats(list(stopping_bar(25.0))[:count], 25.0)
    assert len(track) == 0
    assert track.duration == pytest.approx(count / 25)


def test_colour_frames_give_the_beats_of_grey_ones() -> None:
    colour = (np.repeat(frame[..., None], 3, axis=2) for frame in stopping_bar(25.0))
    np.testing.assert_allclose(flows.flow_beats(colour, 25.0).times, flows.flow_beats(stopping_bar(25.0), 25.0).times)


def test_frames_drawn_into_the_same_memory_are_told_apart() -> None:
    def reused() -> Iterator[np.ndarray]:
        memory = np.zeros((120, 160), np.uint8)
        for frame in stopping_bar(25.0):
            memory[:] = frame
            yield memory

    assert len(flows.flow_beats(reused(), 25.0)) == len(STOPS)


def test_frames_are_forgotten_once_read() -> None:
    alive: list[weakref.ref[np.ndarray]] = []
    most = 0

    def watched() -> Iterator[np.ndarray]:
        nonlocal most
        for _ in range(40):
            frame = np.zeros((32, 32), np.uint8)
            alive.append(weakref.ref(frame))
            most = max(most, sum(one() is not None for one in alive))
            yield frame

    flows.flow_beats(watched(), 25.0)
    assert most <= 3


def test_progress_sees_every_frame() -> None:
    shapes: list[tuple[int, ...]] = []
    watched = lambda frames, label: (shapes.append(frame.shape) or frame for frame in frames)  # noqa: E731
    flows.flow_beats(stopping_bar(25.0, seconds=0.4), 25.0, progress=watched)
    assert len(shapes) == 10


BLACK = np.zeros((32, 32), np.uint8)


@cases(
    "frames, fps, message",
    ([BLACK, np.zeros((32, 40), np.uint8)], 25.0, r"frame 1 has shape \(32, 40\), the first has \(32, 32\)"),
    ([np.zeros((32, 32))], 25.0, "frame 0 must be .* uint8"),
    ([np.zeros((32, 32, 4), np.uint8)], 25.0, "frame 0 must be"),
    ([np.zeros(32, np.uint8)], 25.0, "frame 0 must be"),
    ([np.zeros((8, 32), np.uint8)], 25.0, "at least 16 x 16 pixels"),
    ([], 25.0, "at least one frame"),
    *(([BLACK], fps, "fps must be positive") for fps in (0.0, -25.0, float("nan"), float("inf"))),
)
def test_what_is_no_video_is_refused(frames: list[np.ndarray], fps: float, message: str) -> None:
    refused(message, flows.flow_beats, frames, fps)
    refused("lag must lie between 0 and 1 seconds, got 2", flows.flow_beats, [BLACK], 25.0, lag=2)


def test_a_wandering_box_changes_the_beats_of_the_flow() -> None:
    dance = synthetic_clip("rumba", seconds=8.0, fps=25.0, seed=1).motion
    alone = flows.flow_beats(render_skeleton(dance, height=120), 25.0)
    boxed = flows.flow_beats(moving_box(render_skeleton(dance, height=120), 25.0, seed=0), 25.0)
    distance = np.abs(alone.times[:, None] - boxed.times[None, :]).min(axis=1)
    assert len(alone) >= 8
    assert (distance > 0.1).mean() >= 0.2  # the beats of the skeleton do not see the box at all


@pytest.mark.data
def test_a_recorded_dance_has_about_one_to_three_beats_a_second(data_root: Path) -> None:
    path = data_root / "extra" / "video" / "d2mgan_motivation_gt.mp4"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    video = video_frames(path)
    track = flows.flow_beats(video, video.fps)
    assert 1.0 <= len(track) / track.duration <= 3.0
