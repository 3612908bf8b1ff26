"""Harmonising a given motion: harmony rises, no joint leaves its reach, bones keep their lengths."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.harmonise import _Body, _Splines, harmonise
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, HarmonyParams
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.evidence import FEWEST_BEATS, place_test
from harmolab.verdict.judge import music_and_motion, score_motion
from tests.builders import bone_lengths, cases, refused

VALLEYS, RECOMMENDED = HarmonyParams.valleys(), HarmonyParams.recommended()
CHA_CHA = DANCE_PATTERNS["cha-cha"]
TREE = Skeleton(("hip", "knee", "ankle", "spine", "head", "prop"), (-1, 0, 1, 0, 3, -1))


def dance(seed: int, *, fps: float = 15.0, seconds: float = 8.0, jitter: float = 0.12) -> tuple[Motion, BeatTrack]:
    """A dance whose movements end around the beats, as far off as the jitter says."""
    beats = np.arange(0.4, seconds - 0.1, 0.5 + 0.02 * seed)
    motion = synthetic_motion(beats, seconds=seconds, fps=fps, seed=seed, jitter=jitter)
    return motion, BeatTrack(beats, np.ones(beats.size), fps, motion.duration)


def score(motion: Motion, beats: BeatTrack, params: HarmonyParams = RECOMMENDED) -> float:
    """Harmony above chance, of the place test where there are too few beats for a verdict."""
    if params.measure == "shape" and len(beats) < FEWEST_BEATS:
        signal = shape_signal(shape_speed(motion), beats.times[0], beats.times[-1])
        pattern = params.pattern or HOW_PATTERNS["rest"]
        return place_test(signal, beats.times, beats.bar_places, pattern).harmony_above_chance
    return score_motion(beats, motion, params=params, n_rotations=0).place_harmony


def jerk(motion: Motion) -> float:
    return float(np.sqrt(np.mean(np.diff(motion.positions, n=3, axis=0) ** 2)))


@cases(
    "params, fps, seconds",
    pytest.param(RECOMMENDED, 15.0, 10.0, id="recommended"),
    pytest.param(RECOMMENDED, 15.0, 6.0, id="recommended, too short to judge"),
    pytest.param(VALLEYS, 15.0, 6.0, id="valleys"),
    pytest.param(VALLEYS, 60.0, 4.0, marks=pytest.mark.slow, id="valleys, 60 hertz"),
)
def test_a_jittered_dance_is_brought_onto_the_beat_and_stays_itself(params: HarmonyParams, fps: float, seconds: float):
    motion, beats = dance(2, fps=fps, seconds=seconds)
    result = harmonise(motion, beats, steps=90, params=params)
    assert score(motion, beats, params) < 0.5
    assert score(result, beats, params) > score(motion, beats, params) + 0.35
    assert np.linalg.norm(result.positions - motion.positions, axis=2).max() <= 0.1 + 1e-9
    np.testing.assert_allclose(bone_lengths(result), bone_lengths(motion), atol=1e-6)
    assert jerk(result) < 1.25 * jerk(motion)
    assert (result.fps, result.skeleton, result.n_frames) == (motion.fps, motion.skeleton, motion.n_frames)


def test_a_perfect_dance_is_left_alone():
    motion, _ = dance(0, jitter=0.0)
    visual = visual_beats(motion, params=VALLEYS)
    beats = BeatTrack(visual.times, np.ones(len(visual)), 15.0, motion.duration)
    assert harmonise(motion, beats, steps=5, params=VALLEYS) is motion


@pytest.mark.slow
def test_the_score_in_use_never_falls():
    rests, beats = dance(2, seconds=10.0, jitter=0.0)
    placed = replace(beats, bar_places=np.arange(len(beats)) % 4)
    hits = synthetic_motion(beats.times + np.diff(beats.times)[0] / 2, seconds=10.0, fps=15.0, seed=2)
    strange = synthetic_motion(np.arange(0.4, 9.9, 0.43), seconds=10.0, fps=15.0, seed=2)
    for motion, track, pattern in (
        (rests, beats, None), (hits, placed, CHA_CHA), (strange, beats, None), (strange, beats, CHA_CHA),
    ):  # fmt: skip
        params = HarmonyParams.recommended(pattern)
        result = harmonise(motion, track, steps=12, pattern=pattern)
        assert result is motion or score(result, track, params) > score(motion, track, params)


@pytest.mark.slow
def test_without_a_dance_that_hits_the_beat_still_does():
    _, beats = dance(2, seconds=10.0)
    motion = synthetic_motion(beats.times + np.diff(beats.times)[0] / 2 + 0.07, seconds=10.0, fps=15.0, seed=2)
    result = harmonise(motion, beats, steps=60)
    told = HarmonyParams.recommended(HOW_PATTERNS["hit"])
    before, after = (score_motion(beats, each, params=told).judgement for each in (motion, result))
    assert before.lag > 0.08
    assert abs(after.lag) < 0.05
    assert after.harmony_above_chance > before.harmony_above_chance + 0.3


def test_the_pattern_of_a_dance_is_that_of_the_params():
    motion, beats = dance(2, seconds=10.0)
    track = replace(beats, bar_places=np.arange(len(beats)) % 4)
    named = harmonise(motion, track, steps=6, pattern=CHA_CHA)
    same = harmonise(motion, track, steps=6, params=HarmonyParams.recommended(CHA_CHA))
    np.testing.assert_array_equal(named.positions, same.positions)


def test_a_statue_is_given_a_dance_or_left_alone():
    motion, beats = dance(2, seconds=10.0)
    statue = replace(motion, positions=np.broadcast_to(motion.positions[:1], motion.positions.shape))
    result = harmonise(statue, beats, steps=12)
    assert np.linalg.norm(result.positions - statue.positions, axis=2).max() <= 0.1 + 1e-9
    np.testing.assert_allclose(bone_lengths(result), bone_lengths(statue), atol=1e-6)


@pytest.mark.data
@pytest.mark.slow
def test_a_recorded_rumba_is_danced_more_as_rumba_is(data_root: Path):
    music, whole = music_and_motion(load_recording(data_root / "beatlocked" / "DANCE_R_4").clip)
    part = Motion(whole.positions[:500], whole.fps, whole.skeleton, whole.valid[:500])
    beats = music.span(0.0, part.duration)
    params = HarmonyParams.recommended(DANCE_PATTERNS["rumba"])
    result = harmonise(part, beats, steps=60, params=params)
    assert score(result, beats, params) > score(part, beats, params) + 0.2
    assert jerk(result) < 1.25 * jerk(part)


def test_without_beats_nothing_moves_nor_where_nothing_can_be_bettered():
    motion, heard = dance(0)
    assert harmonise(motion, heard, steps=1, reach=1e-6) is motion
    assert harmonise(motion, BeatTrack([], [], 15.0, motion.duration), steps=5) is motion
    later = BeatTrack([9.0, 10.0], [1.0, 1.0], 15.0, 12.0)  # after the motion's end
    assert harmonise(motion, later, steps=5) is motion


def test_the_seed_decides():
    motion, beats = dance(2, seconds=4.0)
    first, again, other = (harmonise(motion, beats, steps=6, seed=seed).positions for seed in (0, np.int64(0), 1))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-6


def test_frames_that_are_not_valid_stay_marked_and_as_they_are():
    motion, beats = dance(2, seconds=4.0)
    valid = np.arange(motion.n_frames) >= 20
    result = harmonise(replace(motion, valid=valid), beats, steps=6)
    np.testing.assert_array_equal(result.valid, valid)
    assert result.positions.shape == motion.positions.shape
    moved = np.abs(result.positions - motion.positions)
    assert moved[:20].max() < 1e-12 < 1e-3 < moved[20:].max()


def test_a_flat_picture_without_bones_can_be_harmonised():
    motion, beats = dance(2, seconds=6.0)
    flat = Motion(100 * motion.positions[..., :2], 15.0, Skeleton.unnamed(motion.positions.shape[1]))
    result = harmonise(flat, beats, steps=60, reach=10.0)
    assert score(result, beats) > score(flat, beats) + 0.3
    assert np.linalg.norm(result.positions - flat.positions, axis=2).max() <= 10 + 1e-9


def test_the_steps_are_reported():
    motion, beats = dance(2, seconds=4.0)
    seen: list[tuple[list[int], str]] = []
    harmonise(motion, beats, steps=4, progress=lambda turns, label: seen.append(([*turns], label)) or turns)
    assert seen == [([0, 1, 2, 3], "harmonising")]


@pytest.mark.parametrize("size", [0.0, 0.02, 1.0, 1e3])
def test_reach_and_bones_hold_for_any_offsets(size: float, rng: np.random.Generator):
    motion = Motion(rng.normal(size=(40, 6, 3)), 15.0, TREE)
    offsets = torch.tensor(size * rng.normal(size=(40, 6, 3)))
    moved = replace(motion, positions=_Body.of(motion).moved(offsets, 0.07).numpy())
    distance = np.linalg.norm(moved.positions - motion.positions, axis=2)
    assert distance.max() <= 0.07 + 1e-12
    np.testing.assert_allclose(bone_lengths(moved), bone_lengths(motion), atol=1e-12)
    if size >= 1:
        assert distance.max() > 0.05  # the bound is nearly used up, not far too careful


def test_small_offsets_arrive_almost_whole():
    # One bone, pointing up: a sideways push of the root carries both, one of the tip only the tip.
    positions = np.tile([[0.0, 0, 0], [0, 1.0, 0]], (2, 1, 1))
    body = _Body.of(Motion(positions, 15.0, Skeleton(("a", "b"), (-1, 0))))
    offsets = torch.tensor([[[0.01, 0, 0], [0, 0, 0]], [[0, 0, 0], [0.01, 0.5, 0]]], dtype=torch.float64)
    moved = body.moved(offsets, 0.1).numpy() - positions
    np.testing.assert_allclose(moved[0], [[0.01, 0, 0], [0.01, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(moved[1], [[0, 0, 0], [0.01, -5e-5, 0]], atol=1e-6)  # no stretch


def test_a_bone_without_length_stays_without():
    body = _Body.of(Motion(np.zeros((2, 2, 3)), 15.0, Skeleton(("a", "b"), (-1, 0))))
    offsets = torch.ones(2, 2, 3, dtype=torch.float64, requires_grad=True)
    moved = body.moved(offsets, 0.1)
    torch.testing.assert_close(moved[:, 1], moved[:, 0])
    moved.sum().backward()
    assert torch.isfinite(offsets.grad).all()


def test_splines_add_up_to_one_and_meet_a_straight_line():
    motion, _ = dance(0, seconds=4.0)
    splines = _Splines.of(motion)
    torch.testing.assert_close(splines.weights.sum(dim=1), torch.ones(60, dtype=torch.float64))
    knots = torch.arange(int(splines.first[-1]) + 4, dtype=torch.float64)[:, None, None]
    expected = torch.arange(60, dtype=torch.float64) / (15 * 0.15) + 1  # the second of four knots lies at the frame
    torch.testing.assert_close(splines.at(knots)[:, 0, 0], expected)


@cases(
    "options, message",
    ({"reach": 0.0}, "reach must be positive, got 0.0"),
    ({"reach": float("nan")}, "reach must be positive, got nan"),
    ({"steps": 0}, "steps must be at least 1, got 0"),
    ({"seed": -1}, "seed must be a whole number, not negative, got -1"),
    ({"params": replace(HarmonyParams.paper(), detector="direction")}, "'direction' has no relaxation"),
)
def test_what_cannot_be_done_is_refused_by_name(options: dict[str, object], message: str):
    motion, beats = dance(0, seconds=4.0)
    refused(message, harmonise, motion, beats, **options)
