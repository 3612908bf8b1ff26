"""What must hold for every movement, every music and every setting (hypothesis)."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.lab.compare.batch import BeatBatch, rescore
from harmolab.metrics.beat_alignment import other_scores
from harmolab.params import CHOICES, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import chance_level, f_score, harmony_from_hits, hit_mask, score_harmony
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.bar_pattern import beat_ranks
from harmolab.verdict.judge import score_clip, score_motion

DURATION = 10.0
MODES = [HarmonyParams.paper(), HarmonyParams.valleys(), HarmonyParams.recommended()]
often, seldom = settings(max_examples=50, deadline=None), settings(max_examples=8, deadline=None)

# Times on a grid of 1/64 s, at least a second from both ends: sums and differences of them are exact.
places = st.lists(st.integers(64, 8 * 64), unique=True, max_size=20).map(sorted)
some_places = st.lists(st.integers(64, 8 * 64), unique=True, min_size=1, max_size=20).map(sorted)
delays = st.sampled_from([0.0, 0.05, 0.1, 0.25, 0.5])
matchings = st.sampled_from(CHOICES["matching"])


@st.composite
def tracks(draw: st.DrawFn, positions: st.SearchStrategy[list[int]] = places) -> BeatTrack:
    """Beats on the grid with strengths of 0 to 1 in eighths."""
    times = np.array(draw(positions), dtype=float) / 64
    strengths = draw(st.lists(st.integers(0, 8), min_size=times.size, max_size=times.size))
    return BeatTrack(times, np.array(strengths) / 8, 15.0, DURATION)


@st.composite
def settings_of_scores(draw: st.DrawFn) -> HarmonyParams:
    """Any reading of the hit score."""
    return HarmonyParams(
        audio_threshold=draw(st.sampled_from([0.0, 0.1, 1.0])),
        visual_threshold=draw(st.sampled_from([None, 0.0, 1.0])),
        reaction_delay=draw(delays),
        beta=draw(st.sampled_from([0.5, 1.0, 2.0])),
        saliency=draw(st.sampled_from(CHOICES["saliency"])),
        visual_saliency=draw(st.sampled_from(CHOICES["visual_saliency"])),
        first_beat=draw(st.sampled_from(CHOICES["first_beat"])),
        matching=draw(matchings),
    )


def moved(track: BeatTrack, by: float) -> BeatTrack:
    return BeatTrack(track.times + by, track.strengths, track.fps, track.duration)


def movement(seed: int, fps: float, seconds: float = 10.0) -> Motion:
    """An analytic movement of five joints with harmonics of 0.5 to 2 Hz, the same at every frame rate.

    It lasts from 0 to `seconds` at every rate.
    """
    rng = np.random.default_rng(seed)
    hertz = rng.uniform(0.5, 2.0, (3, 5, 3))
    size = rng.normal(scale=0.2, size=(3, 5, 3))
    phase = rng.uniform(0, 2 * np.pi, (3, 5, 3))
    times = np.arange(round(seconds * fps) + 1) / fps
    angle = 2 * np.pi * hertz * times[:, None, None, None] + phase
    return Motion((size * np.sin(angle)).sum(axis=1), fps, Skeleton.unnamed(5))


def steady(period: float = 0.5, first: float = 0.3, seconds: float = 10.0) -> BeatTrack:
    times = np.arange(first, seconds - 0.3, period)
    return BeatTrack(times, np.ones(times.size), 100.0, seconds)


seeds = st.integers(0, 10_000)


# Beats


@often
@given(tracks(), tracks(), st.integers(0, 64), settings_of_scores())
def test_shifting_both_tracks_changes_nothing(music: BeatTrack, motion: BeatTrack, by: int, params: HarmonyParams):
    here = score_harmony(music, motion, params=params, n_rotations=40)
    there = score_harmony(moved(music, by / 64), moved(motion, by / 64), params=params, n_rotations=40)
    np.testing.assert_array_equal(here.hits, there.hits)
    np.testing.assert_array_equal(here.intervals, there.intervals)
    for name in ("harmony", "hitting_score", "hit_rate", "chance", "harmony_above_chance", "p_value"):
        assert getattr(here, name) == pytest.approx(getattr(there, name), abs=1e-12, nan_ok=True), name


@often
@given(tracks(), tracks(), settings_of_scores())
def test_every_number_lies_in_its_range(music: BeatTrack, motion: BeatTrack, params: HarmonyParams):
    score = score_harmony(music, motion, params=params, n_rotations=20)
    for name in ("hit_rate", "chance", "audio_harmony"):
        assert 0 <= getattr(score, name) <= 1, name
    # Many music beats may share a visual one, so h can pass 1, but never (1 + beta^2) / beta^2.
    top = 1.0 if params.matching != "many" else (1 + params.beta**2) / params.beta**2
    assert 0 <= score.harmony <= top + 1e-12 and score.harmony_above_chance <= 1 + 1e-12
    assert 0 <= score.hitting_score <= score.n_audio and score.hits.size == score.intervals.size == score.n_audio
    assert np.isnan(score.p_value) or 0 < score.p_value <= 1
    low, high = score.interval
    assert np.isnan(low) or low <= high <= 1 + 1e-12


@often
@given(tracks(), tracks())
def test_other_scores_lie_between_zero_and_one(music: BeatTrack, motion: BeatTrack):
    for name, value in other_scores(music, motion).items():
        assert 0 <= value <= (20 if name == "beat_coverage" else 1 + 1e-12), name


@often
@given(st.floats(0, 50), st.integers(1, 50), st.integers(1, 50), st.sampled_from([0.1, 0.5, 1.0, 2.0, 10.0]))
def test_equations_20_and_21_agree_whenever_there_are_beats(score: float, n_audio: int, n_visual: int, beta: float):
    harmony = harmony_from_hits(score, n_audio, n_visual, beta)
    assert f_score(score / n_audio, score / n_visual, beta) == pytest.approx(harmony, rel=1e-9, abs=1e-300)


@often
@given(tracks(), tracks(), matchings)
def test_a_longer_delay_never_lowers_the_number_of_hits(music: BeatTrack, motion: BeatTrack, matching: str):
    hits = partial(hit_mask, music.times, motion.times, matching=matching)
    assert (np.diff([hits(delay=delay).sum() for delay in np.arange(0, 2, 0.0625)]) >= 0).all()


@often
@given(tracks(), tracks(), delays)
def test_one_to_one_never_exceeds_many_to_one(music: BeatTrack, motion: BeatTrack, delay: float):
    hits = partial(hit_mask, music.times, motion.times, delay=delay)
    many, nearest, most = (hits(matching=how) for how in ("many", "nearest", "max"))
    assert (nearest <= many).all() and (most <= many).all()
    assert nearest.sum() <= most.sum() <= min(len(music), len(motion))


@often
@given(tracks(some_places), st.floats(0.01, 1.0), st.floats(-2.0, 2.0))
def test_chance_is_the_share_of_a_fine_grid_of_times_that_is_hit(motion: BeatTrack, delay: float, lag: float):
    times = (np.arange(20_000) + 0.5) * (DURATION / 20_000)
    visual = motion.times - lag
    after = np.searchsorted(visual, times).clip(1, visual.size) - 1
    nearest = np.minimum(np.abs(times - visual[after]), np.abs(times - visual[np.minimum(after + 1, visual.size - 1)]))
    assert chance_level(visual, delay=delay, duration=DURATION) == pytest.approx((nearest <= delay).mean(), abs=0.003)


@often
@given(st.lists(st.tuples(tracks(), tracks()), min_size=1, max_size=4), delays, st.sampled_from([None, 0.0, 1.0]))
def test_batches_score_as_single_clips(pairs: list[tuple[BeatTrack, BeatTrack]], delay: float, threshold: float | None):
    params = HarmonyParams(reaction_delay=delay, visual_threshold=threshold, lag=0.125)
    batch = rescore(BeatBatch.of(pairs), params)
    singles = [score_harmony(music, motion, params=params, n_rotations=0) for music, motion in pairs]
    for name in ("harmony", "hit_rate", "harmony_above_chance"):
        expected = [getattr(score, name) for score in singles]
        np.testing.assert_allclose(getattr(batch, name), expected, atol=1e-9, err_msg=name)


# Movements


def scores_of(motion: Motion) -> list[float]:
    """Harmony above chance in every mode."""
    return [score_motion(steady(), motion, params=params, n_rotations=0).harmony_above_chance for params in MODES]


@seldom
@given(seeds, st.tuples(*[st.floats(-100, 100)] * 3), st.integers(0, 10_000), st.floats(0.001, 1000))
def test_where_the_dancer_stands_and_looks_and_how_large_he_is_does_not_matter(
    seed: int, by: tuple[float, float, float], turn: int, factor: float
):
    motion = movement(seed, 30.0)
    own, tilt = scores_of(motion), Rotation.random(random_state=turn).as_matrix()
    turned = motion.positions @ Rotation.from_rotvec([0.0, turn, 0.0]).as_matrix().T
    for positions in (motion.positions + np.array(by), factor * motion.positions, turned):
        np.testing.assert_allclose(scores_of(replace(motion, positions=positions)), own, atol=2e-3)
    # The shape's turns are taken out about the vertical first, so a tilted room may move that score.
    tilted = replace(motion, positions=motion.positions @ tilt.T)
    np.testing.assert_allclose(scores_of(tilted)[:-1], own[:-1], atol=2e-3)


RESTING = HarmonyParams.recommended(HOW_PATTERNS["rest"])


@seldom
@given(seeds, st.sampled_from([0.4, 0.5, 0.625, 0.75]))
@example(1142, 0.75)  # the worst that is known: at 15 fps the speed of a movement of 2 Hz is a coarse one
def test_the_frame_rate_moves_the_recommended_score_by_an_eighth_at_most_and_from_30_fps_by_three_hundredths(
    seed: int, period: float
):
    motions = [movement(seed, fps, 20.0) for fps in (15.0, 30.0, 60.0, 120.0)]
    scores = [score_motion(steady(period, seconds=20.0), motion, params=RESTING) for motion in motions]
    values = [score.harmony_above_chance for score in scores]
    # Nothing is locked here: ranks of chance, which move most.
    assert max(values) - min(values) <= 0.125 and max(values[1:]) - min(values[1:]) <= 0.03


rates = st.sampled_from([15.0, 25.0, 30.0, 60.0, 120.0])


def to_and_fro(hertz: float, share: float, phase: float, times: np.ndarray) -> np.ndarray:
    """Place on a line: a swing with one overtone."""
    return np.sin(2 * np.pi * hertz * times) + share * np.sin(4 * np.pi * hertz * times + phase)


def valleys_of(hertz: float, share: float, phase: float, fps: float) -> np.ndarray:
    """Valley beats of two limbs that swing to and fro for 8 s."""
    times = np.arange(round(8 * fps) + 1) / fps
    limbs = np.array([[1.0, 0.5, 0.0], [0.2, -0.4, 0.7]])
    positions = to_and_fro(hertz, share, phase, times)[:, None, None] * limbs
    return visual_beats(Motion(positions, fps, Skeleton.unnamed(2)), params=HarmonyParams.valleys()).times


@often
@given(st.floats(0.5, 1.0), st.floats(0, 0.1), st.floats(0, 2 * np.pi), rates)
def test_valleys_lie_within_20_ms_of_the_stops_at_any_frame_rate(hertz: float, share: float, phase: float, fps: float):
    # Smoothing by 0.05 s moves a lopsided valley by up to 30 ms, at every frame rate alike; these are not so lopsided.
    fine = np.arange(0, 8, 1e-4)
    forward = np.diff(to_and_fro(hertz, share, phase, fine)) > 0
    stops = fine[1:-1][forward[1:] != forward[:-1]]
    stops = stops[(stops > 0.3) & (stops < 7.7)]
    assert np.abs(stops[:, None] - valleys_of(hertz, share, phase, fps)).min(axis=1).max() <= 0.02


@seldom
@given(seeds, st.integers(0, 200))
def test_a_clip_scores_the_same_wherever_it_lies_in_the_music(seed: int, by: int):
    motion, beats = movement(seed, 32.0), steady(0.5, first=0.25)
    silence = Audio(np.zeros(14_000), 1000)
    long = BeatTrack(beats.times, beats.strengths, 100.0, 14.0)
    for params in MODES:
        here, there = (
            score_clip(Clip("clip", silence, motion, offset, beats=moved(long, offset)), params, n_rotations=20)
            for offset in (0.0, by / 64)
        )
        np.testing.assert_array_equal(here.hits, there.hits)
        np.testing.assert_allclose(here.intervals, there.intervals, atol=1e-9)
        for name in ("harmony", "hit_rate", "chance", "harmony_above_chance", "p_value", "interval"):
            assert getattr(here, name) == pytest.approx(getattr(there, name), abs=1e-9, nan_ok=True), name


@seldom
@given(seeds, st.integers(1, 4), st.booleans())
def test_pattern_shares_lie_between_zero_and_one(seed: int, beats: int, known: bool):
    rng = np.random.default_rng(seed)
    pattern = BarPattern(beats, tuple(rng.normal(size=2).tolist()), tuple(rng.normal(size=2).tolist()))
    music = steady()
    if known:
        music = replace(music, bar_places=np.arange(len(music)) % beats)
    signal = shape_signal(shape_speed(movement(seed, 25.0)))
    ranks = beat_ranks(signal.times, signal.values, music, pattern)
    assert ((ranks > 0) & (ranks < 1)).all()
    score = score_motion(steady(seconds=16.0), movement(seed, 25.0, 16.0), params=HarmonyParams.recommended(pattern))
    assert 0 < score.p_value <= 1 and -1 <= score.harmony_above_chance <= 1


@often
@given(tracks(), st.integers(6, 40), st.sampled_from(MODES), st.booleans())
def test_a_frozen_dancer_scores_zero_with_any_music(music: BeatTrack, frames: int, params: HarmonyParams, flat: bool):
    frozen = Motion(np.full((frames, 2, 2 if flat else 3), 0.1), 25.0, Skeleton.unnamed(2))
    score = score_motion(music, frozen, params=params, n_rotations=5)
    assert (score.n_visual, score.harmony) == (0, 0.0)
    # The recommended score says that it cannot tell; the others say chance.
    nothing = float("nan") if params.measure == "shape" else 0.0
    assert score.harmony_above_chance == pytest.approx(nothing, abs=1e-12, nan_ok=True)


@seldom
@given(seeds, st.sampled_from(MODES), st.sampled_from(CHOICES["detector"]), st.sampled_from(CHOICES["plateau"]))
def test_no_music_scores_zero_with_any_movement(seed: int, params: HarmonyParams, detector: str, plateau: str):
    nothing = BeatTrack([], [], 15.0, 8.0)
    chosen = replace(params, detector=detector, plateau=plateau)
    score = score_motion(nothing, movement(seed, 25.0), params=chosen, n_rotations=5)
    assert (score.n_audio, score.harmony, score.hit_rate) == (0, 0.0, 0.0)
    assert np.isnan(score.harmony_above_chance) if params.measure == "shape" else score.harmony_above_chance == 0.0
