"""Retiming by time-warp: harmony rises, speed stays in bounds, bones and ends stay, a second run changes nothing."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.params import HarmonyParams
from harmolab.readers.video import video_frames, write_video
from harmolab.retime.retime import Retimed, motion_at, retime, warp_video, warped_frames
from harmolab.retime.warps import METHODS, TimeWarp, beat_warp, lee_warp
from harmolab.score import score_harmony
from harmolab.types import BeatTrack, Motion
from tests.builders import bone_lengths, cases, refused, track

SECONDS = 16.0
VALLEYS = HarmonyParams.valleys()


def jittered(seed: int, *, dance: str = "jive", fps: float = 60.0) -> tuple[Motion, BeatTrack]:
    """A dance whose beats were moved by a random walk of 150 ms standard deviation that forgets 40 % a beat."""
    clip = planted_clip(ClipSettings(dance, seconds=SECONDS, seed=seed, fps=fps)).clip
    assert clip.motion is not None and clip.beats is not None
    last = (clip.motion.n_frames - 1) / fps
    beats = clip.beats.times[(clip.beats.times > 0.3) & (clip.beats.times < last - 0.3)]
    shifts = np.random.default_rng(seed).normal(0.0, 0.15, beats.size)
    for beat in range(1, beats.size):
        shifts[beat] = 0.6 * shifts[beat - 1] + 0.8 * shifts[beat]
    moved = np.maximum.accumulate(np.clip(beats + shifts, 0.1, last - 0.1) - 0.1 * np.arange(beats.size))
    moved += 0.1 * np.arange(beats.size)  # in order, and a tenth of a second apart
    inside = moved < last - 0.05
    warp = TimeWarp(np.r_[0.0, beats[inside], last], np.r_[0.0, moved[inside], last])
    return motion_at(clip.motion, warp.inverse(np.arange(clip.motion.n_frames) / clip.motion.fps)), clip.beats


def swinging(n_frames: int = 240, *, dimensions: int = 3, fps: float = 30.0) -> Motion:
    """An arm of a metre that swings once in two seconds, so that it stands still every second; its root walks."""
    angle = np.cos(np.pi * np.arange(n_frames) / fps)
    hand = np.stack([np.sin(angle), -np.cos(angle), np.zeros(n_frames)], axis=1)
    root = np.stack([0.1 * np.arange(n_frames) / fps, np.ones(n_frames), np.zeros(n_frames)], axis=1)
    positions = np.stack([root + hand, root], axis=1)  # the child comes before its parent
    return Motion(positions[..., :dimensions], fps, Skeleton(("hand", "root"), (1, -1)))


@pytest.fixture(scope="module")
def dances() -> list[tuple[Motion, BeatTrack]]:
    return [jittered(seed) for seed in range(5)]


@pytest.fixture(scope="module")
def retimed(dances: list[tuple[Motion, BeatTrack]]) -> list[Retimed]:
    return [retime(*dance) for dance in dances]


def test_a_warp_maps_its_knots_onto_each_other_and_back_and_its_speed_range_is_that_of_a_dense_grid():
    warp = TimeWarp([0.0, 1.2, 3.0, 5.0], [0.0, 1.0, 3.3, 5.0])
    np.testing.assert_allclose(warp([0.0, 1.2, 3.0, 5.0]), [0.0, 1.0, 3.3, 5.0], atol=1e-12)
    times = np.linspace(-1, 6, 701)
    np.testing.assert_allclose(warp(warp.inverse(times)), times, atol=1e-12)
    np.testing.assert_allclose(warp.inverse(times)[times > 5], times[times > 5])
    speeds = np.diff(warp.inverse(np.linspace(0, 5, 100_001))) / (5 / 100_000)
    np.testing.assert_allclose(warp.speed_range(), [speeds.min(), speeds.max()], atol=1e-3)


def test_the_mean_shift_is_counted_without_its_sign():
    assert TimeWarp([0.0, 2.1, 3.9, 6.0], [0.0, 2.0, 4.0, 6.0]).bent == pytest.approx(0.06, abs=0.02)
    assert TimeWarp.identity(3.0).bent == 0 and TimeWarp.identity(3.0).speed_range() == (1, 1)


@cases(
    "source, target, message",
    ([0.0], [0.0], "two or more times"),
    ([0.0, 1.0], [0.0, 0.5, 1.0], "as many source as target"),
    ([0.0, 2.0, 1.0], [0.0, 0.5, 1.0], "source knots must be finite and increase"),
    ([0.0, 0.5, 1.0], [0.0, 0.0, 1.0], "target knots must be finite and increase"),
    ([0.0, np.nan, 1.0], [0.0, 0.5, 1.0], "source knots must be finite"),
    ([0.0, 0.5, 1.0], [0.0, 0.5, 1.1], "keeps its ends"),
)
def test_knots_that_make_no_warp_are_refused(source: list[float], target: list[float], message: str):
    refused(message, TimeWarp, source, target)


MUSIC = track(np.arange(1.0, 9.5))


def test_late_beats_are_brought_forward_within_the_bounds():
    late = track(np.arange(1.09, 9.5))
    warp = beat_warp(late, MUSIC, 10.0)
    np.testing.assert_allclose(warp(late.times), MUSIC.times, atol=0.02)
    assert np.all(np.diff(warp.source) > 0)
    low, high = warp.speed_range()
    assert 0.7 <= low < high <= 1.4 and warp([0.0, 10.0]).tolist() == [0.0, 10.0]


def test_a_visual_beat_too_many_and_a_music_beat_too_many_are_left_out():
    visual = track([1.09, 2.09, 2.6, 3.09, 4.09, 6.09, 7.09])  # 2.6 is redundant; nothing is near 5
    warp = beat_warp(visual, track([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]), 8.0)
    np.testing.assert_allclose(warp([1.09, 2.09, 3.09, 4.09, 6.09, 7.09]), [1, 2, 3, 4, 6, 7], atol=0.02)


def test_beats_out_of_reach_of_the_bounds_do_not_break_them():
    visual = track(np.arange(1.15, 12.5, 1.0), duration=14.0)
    warp = beat_warp(visual, track(np.arange(1.0, 12.5, 1.0), duration=14.0), 14.0, slowest=0.9, fastest=1.05)
    low, high = warp.speed_range()
    assert 0.9 <= low < 1 < high <= 1.05
    assert warp(1.15) > 1.09  # a twentieth of a second is all that can be won in the first one
    np.testing.assert_allclose(warp(np.arange(5.15, 11.0)), np.arange(5.0, 10.9), atol=0.02)


def test_bounds_of_one_leave_no_freedom_and_beats_in_time_are_left_alone():
    assert beat_warp(track([1.2, 2.2, 3.2]), track([1.0, 2.0, 3.0]), 5.0, slowest=1.0, fastest=1.0).is_identity
    assert beat_warp(track([1.03, 1.97, 3.02, 4.0]), track([1.0, 2.0, 3.0, 4.0]), 5.0).is_identity


def test_a_phase_of_a_half_lands_between_the_beats_and_a_lag_is_kept():
    warped = partial(beat_warp, track(np.arange(1.3, 9.5)), MUSIC, 10.0)
    np.testing.assert_allclose(warped(phase=0.5)(np.arange(2.3, 8.5)), np.arange(2.5, 8.6), atol=0.02)
    weak = partial(beat_warp, track(np.arange(1.3, 9.5)), replace(MUSIC, strengths=np.arange(1, 10) != 5), 10.0)
    np.testing.assert_allclose(weak(phase=0.5)([4.3, 6.3]), [4.5, 6.5], atol=0.02)  # the beat at 5 is too weak
    late = warped(params=replace(VALLEYS, lag=0.05))
    np.testing.assert_allclose(late(np.arange(2.3, 8.5)), np.arange(2.05, 8.1), atol=0.02)


@pytest.mark.parametrize(("visual", "music"), [((), (1.0, 2.0)), ((1.0, 2.0), ()), ((), ())])
def test_without_beats_on_one_side_nothing_is_bent(visual: tuple[float, ...], music: tuple[float, ...]):
    for method in METHODS:
        assert beat_warp(track(visual), track(music), 10.0, method=method).is_identity


def test_the_warper_of_2019_stretches_between_nearest_beats():
    warp = lee_warp(track([1.2, 1.3, 3.9]), track([1.0, 2.0, 4.0]), 5.0)  # 1.3 is further from 1 than 1.2
    np.testing.assert_allclose(warp([1.2, 3.9]), [1.0, 4.0], atol=1e-9)
    np.testing.assert_allclose(warp.inverse([2.0, 3.0]), [2.1, 3.0], atol=1e-9)  # a straight line between
    np.testing.assert_allclose(warp.speed_range(), [0.9, 1.2], rtol=0.08)


@cases(
    "setting, message",
    ({"strength": 1.2}, "strength must lie"),
    ({"strength": float("nan")}, "strength must lie"),
    ({"phase": 2.0}, "phase must lie"),
    ({"slowest": 0.0}, "slowest must lie"),
    ({"slowest": 1.1}, "slowest must lie"),
    ({"fastest": 0.9}, "fastest must be 1 or more"),
    ({"fastest": float("inf")}, "fastest must be 1 or more"),
    ({"method": "nearest"}, "method must be one of dp, lee2019"),
    ({"params": HarmonyParams(reaction_delay=0.0)}, "reaction_delay above 0"),
    ({"params": HarmonyParams(clock=1.013)}, "own clock"),
)
def test_settings_out_of_range_are_refused_by_name(setting: dict[str, object], message: str):
    refused(message, retime, swinging(), track([1.0, 2.0]), **setting)


def test_jittered_dances_come_into_harmony_and_are_said_to_be_on_the_beat(retimed: list[Retimed]):
    assert np.mean([one.target_before.harmony_above_chance for one in retimed]) < 0.2
    assert np.mean([one.target_after.harmony_above_chance for one in retimed]) > 0.8
    assert {(one.before.judgement.level, one.after.judgement.level) for one in retimed} == {(1, 4)}
    assert np.mean([one.after.place_harmony - one.before.place_harmony for one in retimed]) > 0.3


def test_the_number_is_that_of_the_function_given():
    motion, music = swinging(), track(np.arange(1.2, 7.5, 1.0), duration=8.0)
    scores = {id(motion): score_harmony(music, music)}
    retimed = retime(motion, music, score=lambda each: scores.setdefault(id(each), score_harmony(music, track([]))))
    assert retimed.before is scores[id(motion)] and retimed.after is scores[id(retimed.motion)]


def test_jitter_of_each_movement_by_itself_is_mended_too():
    settings = [ClipSettings(dance, seconds=SECONDS, jitter=0.15) for dance in ("jive", "rumba", "tango", "waltz")]
    bent = [retime(clip.motion, clip.beats) for clip in (planted_clip(each).clip for each in settings)]
    lost = [one for one in bent if one.target_before.harmony_above_chance < 0.2]
    assert lost  # many a dance has beats in time by luck
    for dances in (lost, bent):
        assert np.mean([one.target_after.harmony_above_chance for one in dances]) > 0.8


def test_the_speed_stays_in_bounds_everywhere(retimed: list[Retimed]):
    for one in retimed:
        low, high = one.warp.speed_range()
        assert 0.7 <= low < high <= 1.4
        dense = np.linspace(0.0, one.warp.target[-1], 50_001)
        speeds = np.diff(one.warp.inverse(dense)) / np.diff(dense)
        assert 0.7 - 1e-6 <= speeds.min() < speeds.max() <= 1.4 + 1e-6


def test_bones_and_both_ends_stay(dances: list[tuple[Motion, BeatTrack]], retimed: list[Retimed]):
    for (motion, _), bent in zip(dances, (one.motion for one in retimed), strict=True):
        still = bone_lengths(motion).mean(axis=0)
        assert np.abs(bone_lengths(motion) - still).max() < 1e-9
        assert np.abs(bone_lengths(bent) - still).max() < 1e-9
        np.testing.assert_allclose(bent.positions[[0, -1]], motion.positions[[0, -1]], atol=1e-9)
        assert (bent.n_frames, bent.fps, bent.skeleton) == (motion.n_frames, motion.fps, motion.skeleton)


def test_a_second_run_changes_nothing(dances: list[tuple[Motion, BeatTrack]], retimed: list[Retimed]):
    for (_, music), once in zip(dances, retimed, strict=True):
        assert not once.warp.is_identity
        twice = retime(once.motion, music)
        assert twice.warp.is_identity and twice.motion is once.motion


def test_strength_is_the_share_of_every_shift(dances: list[tuple[Motion, BeatTrack]]):
    motion, music = dances[0]
    full, half = retime(motion, music).warp, retime(motion, music, strength=0.5).warp
    np.testing.assert_allclose(half.shifts(), 0.5 * full.shifts(), atol=1e-4)
    assert retime(motion, music, strength=0.0).motion is motion


def test_a_dance_at_fifteen_frames_a_second_is_mended(dances: list[tuple[Motion, BeatTrack]]):
    slow = [retime(*jittered(seed, fps=15.0)) for seed in (1, 2)]
    assert np.mean([r.target_after.harmony_above_chance - r.target_before.harmony_above_chance for r in slow]) > 0.4


@pytest.mark.slow
def test_the_warper_of_2019_wins_harmony_and_breaks_the_bounds(dances: list[tuple[Motion, BeatTrack]]):
    linear = [retime(*dance, method="lee2019") for dance in dances]
    assert np.mean([one.target_after.harmony_above_chance for one in linear]) > 0.5
    assert min(one.warp.speed_range()[0] for one in linear) < 0.5
    assert max(one.warp.speed_range()[1] for one in linear) > 1.6


def test_flat_motion_is_retimed_and_its_bone_keeps_its_length():
    retimed = retime(swinging(dimensions=2), track(np.arange(1.2, 7.5, 1.0), duration=8.0))
    assert retimed.target_after.harmony_above_chance > retimed.target_before.harmony_above_chance + 0.5
    np.testing.assert_allclose(bone_lengths(retimed.motion), 1.0, atol=1e-9)


def test_a_motion_that_stands_still_or_has_two_frames_comes_back_itself():
    still = Motion(np.ones((60, 2, 3)), 30.0, Skeleton(("a", "b"), (-1, 0)))
    for motion in (still, still.span(0.0, 2 / 30)):
        assert retime(motion, track([0.5, 1.0], duration=2.0)).motion is motion


def test_times_between_frames_show_poses_between():
    between = motion_at(swinging(), np.array([0.05, 0.55]))
    angle = np.cos(np.pi * np.array([0.05, 0.55]))
    np.testing.assert_allclose(between.positions[:, 0, 0] - between.positions[:, 1, 0], np.sin(angle), atol=1e-4)
    np.testing.assert_allclose(between.positions[:, 1, 0], [0.005, 0.055], atol=1e-12)


def test_a_bone_that_grows_is_interpolated_linearly():
    grown = np.zeros((3, 2, 3))
    grown[:, 1, 1] = [1.0, 2.0, 5.0]
    motion = Motion(grown, 1.0, Skeleton(("a", "b"), (-1, 0)))
    np.testing.assert_allclose(motion_at(motion, np.array([0.5, 1.5])).positions[:, 1, 1], [1.5, 3.5])


def test_a_bone_that_flips_over_and_one_of_no_length_stay_finite():
    flipping = np.zeros((2, 3, 3))
    flipping[:, 1, 1] = [1.0, -1.0]
    middle = motion_at(Motion(flipping, 1.0, Skeleton(("a", "b", "none"), (-1, 0, 0))), np.array([0.5, 1.0]))
    np.testing.assert_allclose(np.abs(middle.positions[0, :, 1]), [0.0, 1.0, 0.0])


def test_filler_frames_stay_filler():
    motion = replace(swinging(60), valid=np.arange(60) < 30)
    assert motion_at(motion, np.array([0.5, 1.5])).valid.tolist() == [True, False]


def test_a_ring_of_bones_is_refused():
    refused("form a ring", motion_at, Motion(swinging().positions, 30.0, Skeleton(("a", "b"), (1, 0))), np.array([0.5]))


def test_frames_of_a_video_come_at_warped_times():
    warp = TimeWarp([0.0, 1.0, 2.9], [0.0, 2.0, 2.9])
    shown = list(warped_frames(iter(np.arange(30, dtype=np.uint8)), 10.0, warp))
    wanted = np.floor(warp.inverse(np.arange(30) / 10) * 10 + 0.5).astype(int)
    assert np.abs(np.array(shown, int) - wanted).max() <= 1  # a moment half way between two frames may show either
    assert (len(shown), shown[0], shown[20], shown[29]) == (30, 0, 10, 29)


def test_a_video_keeps_its_colours_and_its_length(tmp_path):
    red = np.full((48, 64, 3), (200, 0, 0), np.uint8)
    write_video(tmp_path / "in.mp4", [red] * 30, 10.0)
    warp, steps = TimeWarp([0.0, 1.0, 2.9], [0.0, 1.5, 2.9]), []
    progress = lambda frames, label: steps.append((len(frames), label)) or frames  # noqa: E731
    warp_video(tmp_path / "in.mp4", tmp_path / "out.mp4", warp, progress=progress)
    frames = list(video_frames(tmp_path / "out.mp4", colour=True))
    assert (len(frames), steps) == (30, [(30, "drawing")])
    np.testing.assert_allclose(frames[10].mean(axis=(0, 1)), [200, 0, 0], atol=6)


def test_the_beats_seen_after_are_where_the_warp_says():
    retimed = retime(swinging(), track(np.arange(1.2, 7.5, 1.0), duration=8.0))
    seen = visual_beats(retimed.motion, params=VALLEYS).times
    np.testing.assert_allclose(seen, retimed.warp(np.arange(1.0, 7.5)), atol=0.02)
