"""The relaxed scores against the hard ones: equal at tiny tau, close at small tau, differentiable everywhere else."""

from collections.abc import Callable
from dataclasses import fields, replace
from itertools import product
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from harmolab import soft_score as relaxed
from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.systems.harmogan.losses import above_chance_loss
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.bar_pattern import pattern_fits
from harmolab.verdict.evidence import place_test
from tests.builders import cases, refused, track

PAPER = HarmonyParams.paper()
VALLEYS = replace(HarmonyParams.valleys(), fps=15.0, subframe=False)
SMOOTH = replace(PAPER, smoothing=0.05)
OTHER_CLOCK = replace(HarmonyParams.recommended(), clock=1.01)
FPS = 15.0


# field of SoftHarmony -> field of HarmonyScore
NAMES = {each.name: each.name.replace("above_chance", "harmony_above_chance") for each in fields(relaxed.SoftHarmony)}


def softly(positions: ArrayLike, beats: ArrayLike, **given: Any) -> relaxed.SoftHarmony:
    """The relaxed score of a batch at 15 fps, or of one clip, in which all beats count alike unless it is said."""
    positions, beats = torch.as_tensor(positions), torch.as_tensor(beats)
    positions, beats = (each[None] if beats.ndim == 1 else each for each in (positions, beats))
    ones = torch.ones_like(beats)
    given = {"strengths": ones, "beat_mask": ones, "mask": torch.ones(positions.shape[:2]), "fps": FPS} | given
    return relaxed.soft_harmony(positions, beats, **given)


class Clips:
    """Random motions of different lengths, padded, with random beats."""

    def __init__(self, seed: int, *, count: int = 8, frames: int = 60, joints: int = 5, beats: int = 9) -> None:
        rng = np.random.default_rng(seed)
        self.positions = rng.normal(scale=0.03, size=(count, frames, joints, 3)).cumsum(axis=1)
        self.lengths = rng.integers(frames // 2, frames + 1, size=count)
        self.counts = rng.integers(1, beats + 1, size=count)
        ends = self.lengths[:, None] / FPS
        self.beats = np.sort(rng.uniform(0, np.broadcast_to(ends, (count, beats))), axis=1)
        self.strengths = rng.uniform(0.05, 1.0, (count, beats))
        self.mask = np.arange(frames) < self.lengths[:, None]
        self.beat_mask = np.arange(beats) < self.counts[:, None]

    def soft(self, params: HarmonyParams, tau: float, positions: Tensor | None = None, **more: Any) -> Any:
        motion = torch.tensor(self.positions) if positions is None else positions
        given = {name: torch.tensor(getattr(self, name)) for name in ("beats", "strengths", "beat_mask", "mask")}
        return softly(motion, **given, tau=tau, params=params, **more)

    def hard(self, params: HarmonyParams) -> list[HarmonyScore]:
        scores = []
        for row, (length, count) in enumerate(zip(self.lengths, self.counts, strict=True)):
            motion = Motion(self.positions[row, :length], FPS, Skeleton.unnamed(self.positions.shape[2]))
            music = BeatTrack(self.beats[row, :count], self.strengths[row, :count], FPS, length / FPS)
            scores.append(score_harmony(music, visual_beats(motion, params=params), params=params, n_rotations=0))
        return scores


def one_clip(curve: ArrayLike, beats: ArrayLike, *, params: HarmonyParams, tau: float = 1e-8, fps: float = FPS):
    """The relaxed score of one speed curve."""
    return softly(np.asarray(curve, float), np.asarray(beats, float), fps=fps, tau=tau, params=params)


def mean_difference(params: HarmonyParams, tau: float) -> float:
    """Mean |dh| over forty clips."""
    differences = []
    for seed in range(5):
        clips = Clips(seed)
        hard = torch.tensor([score.harmony for score in clips.hard(params)])
        differences.append((clips.soft(params, tau).harmony - hard).abs().mean())
    return float(torch.stack(differences).mean())


@cases(
    "params",
    pytest.param(PAPER, id="paper"),
    pytest.param(VALLEYS, id="valleys"),
    pytest.param(replace(PAPER, detector="peaks", first_beat="drop", lag=0.07), id="peaks, first dropped, lag"),
    pytest.param(replace(PAPER, visual_saliency="strength", normalisation="mean"), id="strength, mean"),
    pytest.param(replace(PAPER, speed="signed", visual_threshold=0.5, audio_threshold=1.0), id="signed speed"),
    pytest.param(replace(VALLEYS, speed="norm_of_sum", normalisation="raw", lag=-0.1), id="norm of sum, raw"),
    pytest.param(replace(PAPER, reaction_delay=2 / FPS, beta=1.0), id="delay of whole frames"),
    pytest.param(replace(VALLEYS, reaction_delay=0.0), id="no delay"),
)
def test_at_tiny_softness_every_number_is_that_of_the_hard_score(params: HarmonyParams):
    for seed in range(4):
        clips = Clips(seed)
        soft, hard = clips.soft(params, 1e-8), clips.hard(params)
        for ours, theirs in NAMES.items():
            expected = [getattr(score, theirs) for score in hard]
            np.testing.assert_allclose(getattr(soft, ours), expected, atol=1e-6, err_msg=ours)


@pytest.mark.parametrize("params", [PAPER, VALLEYS], ids=["paper", "valleys"])
def test_the_difference_to_the_hard_score_falls_with_tau(params: HarmonyParams):
    differences = [mean_difference(params, tau) for tau in (0.5, 0.3, 0.1, 0.02, 1e-3)]
    assert differences == sorted(differences, reverse=True)
    assert differences[-1] < 0.002


def test_beats_between_frames_agree_with_the_hard_score_at_120_hertz():
    # The relaxation refines by parabola at 15 fps; the hard score interpolates to 120 Hz first.
    params, differences = HarmonyParams.valleys(), []
    for seed in range(10):
        beats = np.arange(0.4, 5.8, 0.4 + 0.03 * seed)
        motion = synthetic_motion(beats, seconds=6.0, fps=FPS, seed=seed, jitter=0.06 * (seed % 3))
        music = BeatTrack(beats, np.ones(beats.size), FPS, motion.duration)
        hard = score_harmony(music, visual_beats(motion, params=params), params=params, n_rotations=0)
        soft = softly(motion.positions.copy(), beats, tau=1e-6, params=params)
        differences.append(abs(float(soft.above_chance) - hard.harmony_above_chance))
    assert np.mean(differences) < 0.05


@cases("params", SMOOTH, HarmonyParams.valleys(), HarmonyParams.recommended(DANCE_PATTERNS["waltz"]))
def test_padding_clips_and_beats_of_others_change_nothing(params: HarmonyParams):
    clips, rest = Clips(4, frames=90), torch.tensor(np.random.default_rng(0).normal(size=(8, 90, 5, 3)))
    places = torch.arange(8) % 3
    filled = torch.where(torch.tensor(clips.mask)[..., None, None], torch.tensor(clips.positions), rest)
    together = clips.soft(params, 0.2, filled, bar_places=places)
    for row, (length, count) in enumerate(zip(clips.lengths, clips.counts, strict=True)):
        own = torch.tensor(clips.positions[row : row + 1, :length]), torch.tensor(clips.beats[row : row + 1, :count])
        strengths = torch.tensor(clips.strengths[row : row + 1, :count])
        alone = softly(*own, strengths=strengths, tau=0.2, params=params, bar_places=places[row : row + 1])
        for name in NAMES:
            torch.testing.assert_close(getattr(alone, name)[0], getattr(together, name)[row], rtol=1e-6, atol=1e-6)


@cases("params", PAPER, HarmonyParams.valleys(), HarmonyParams.recommended())
def test_padding_that_is_not_finite_changes_neither_score_nor_gradient(params: HarmonyParams):
    scores, gradients = [], []
    for filler in (0.0, np.nan, np.inf, 1e200):
        clips = Clips(4, frames=90)
        clips.beats[~clips.beat_mask] = filler
        clips.positions[~clips.mask] = filler
        motion = torch.tensor(clips.positions, requires_grad=True)
        scores.append(clips.soft(params, 0.2, motion).above_chance)
        gradients += torch.autograd.grad(scores[-1].sum(), motion)
    assert gradients[0].any() and all(map(torch.equal, scores[1:] + gradients[1:], scores[:-1] + gradients[:-1]))


@pytest.mark.parametrize("params", [SMOOTH, HarmonyParams.valleys()], ids=["paper smoothed", "valleys"])
def test_gradient_is_that_of_finite_differences(params: HarmonyParams):
    clips = Clips(7, count=2, frames=12, joints=1, beats=3)
    motion = torch.tensor(clips.positions, requires_grad=True)

    def numbers(positions: Tensor) -> tuple[Tensor, ...]:
        soft = clips.soft(params, 0.4, positions)
        return soft.harmony, soft.hitting_score, soft.chance, soft.above_chance, soft.hit_rate, soft.n_visual

    assert torch.autograd.gradcheck(numbers, (motion,), eps=1e-7, atol=1e-5)


@pytest.mark.parametrize("params", [PAPER, VALLEYS, HarmonyParams.valleys()], ids=["paper", "valleys", "subframe"])
def test_gradient_reaches_most_frames_while_soft(params: HarmonyParams):
    clips = Clips(5)
    motion = torch.tensor(clips.positions, requires_grad=True)
    (gradient,) = torch.autograd.grad(clips.soft(params, 0.5, motion).harmony.sum(), motion)
    reached = gradient.norm(dim=3).sum(dim=2)[torch.tensor(clips.mask)] > 1e-6
    assert reached.double().mean() > 0.8


def test_steps_along_the_gradient_raise_the_hard_score():
    clips = Clips(6)
    motion = torch.tensor(clips.positions, requires_grad=True)
    params = HarmonyParams.valleys()
    before = np.mean([score.harmony_above_chance for score in clips.hard(params)])
    optimiser = torch.optim.Adam([motion], lr=2e-3)
    for step in range(40):
        optimiser.zero_grad()
        (-clips.soft(params, relaxed.anneal(step, 40, 0.5, 0.05), motion).above_chance.sum()).backward()
        optimiser.step()
    clips.positions = motion.detach().numpy()
    assert np.mean([score.harmony_above_chance for score in clips.hard(params)]) > before + 0.3


def test_the_known_valley_hits_the_known_beat_also_exactly_at_the_delay():
    # The curve's only valley is at frame 3 = 0.2 s; beats at 0.25 s (hit) and 0.4 s (miss); window 0.1-0.3 of 0.6 s.
    curve, params = [5.0, 3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], replace(VALLEYS, smoothing=0.0)
    soft = one_clip(curve, [0.25, 0.4], params=params)
    expected = {"n_visual": 1, "hitting_score": 1, "chance": 0.2 / 0.6, "above_chance": (1 / 2 - 1 / 3) / (2 / 3)}
    expected |= {"harmony": 5 * 1 / (2 * 4 + 1), "hit_rate": 0.5}
    assert {name: float(getattr(soft, name)) for name in expected} == pytest.approx(expected)
    late = one_clip(curve, [0.4], params=replace(params, reaction_delay=0.2))
    assert float(late.hitting_score) == pytest.approx(1)


def test_a_plateau_is_one_beat_at_its_last_frame_and_a_turn_between_two_frames_is_seen_while_soft():
    curve = torch.tensor([[1.0, 3.0, 3.0, 3.0, 2.0, 1.0]])
    weights = relaxed.soft_beats(curve, torch.ones_like(curve), fps=FPS, tau=1e-6, detector="turns")
    torch.testing.assert_close(weights, torch.tensor([[0.0, 0, 0, 1, 0, 0]]))
    # The step across the valley is 0: its neighbours alone tell.
    curve = torch.tensor([[3.0, 2.0, 1.0, 1.0, 2.0, 3.0]])
    weights = relaxed.soft_beats(curve, torch.ones_like(curve), fps=FPS, tau=0.5, detector="valleys")
    assert float(weights.sum()) == pytest.approx(1, abs=0.05)


def test_salience_is_the_plain_recursion():
    rng = np.random.default_rng(2)
    weights, curve = torch.tensor(rng.uniform(size=(3, 23))), torch.tensor(rng.uniform(size=(3, 23)))
    params = replace(PAPER, first_beat="drop")
    steps, known = torch.zeros_like(curve), torch.zeros_like(curve)
    last, some = torch.zeros(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)
    for frame in range(23):
        steps[:, frame], known[:, frame] = (some * curve[:, frame] - last).abs(), some
        keep = 1 - weights[:, frame]
        last, some = keep * last + weights[:, frame] * curve[:, frame], keep * some + weights[:, frame]
    share = weights * known / (weights * known).sum(dim=1, keepdim=True)
    mean = (share * steps).sum(dim=1, keepdim=True)
    spread = (share * (steps - mean) ** 2).sum(dim=1, keepdim=True).sqrt()
    expected = weights * known * torch.sigmoid((steps - spread) / (0.2 * mean))
    torch.testing.assert_close(relaxed.soft_salience(weights, curve, tau=0.2, params=params), expected)


def test_softness_means_the_same_at_every_frame_rate():
    counts = []
    for fps in (15.0, 30.0, 120.0):
        curve = list(1.2 + np.cos(2 * np.pi * 1.7 * np.arange(0, 6, 1 / fps) + 0.4))
        counts.append(float(one_clip(curve, [1.0], params=replace(VALLEYS, fps=None), tau=0.5, fps=fps).n_visual))
    assert max(counts) / min(counts) < 1.25


def test_only_the_span_counts():
    curve = list(1.0 + np.cos(np.arange(90) * 0.8))
    speed, beats = torch.tensor([curve]), torch.tensor([[0.5, 2.1, 3.0, 3.8, 5.0]], dtype=torch.float64)
    music = (beats, torch.tensor([[1.0, 0.2, 0.4, 0.3, 0.9]]), torch.ones_like(beats))
    span = torch.tensor([[2.0, 4.0]])
    params = replace(VALLEYS, smoothing=0.0)
    soft = relaxed.soft_harmony(speed, *music, torch.ones_like(speed), fps=FPS, tau=1e-8, params=params, span=span)
    # The same by hand: visual beats in [2, 4) s, three music beats, their strengths over the largest of the three.
    visual = np.array([frame / FPS for frame in range(1, 89) if curve[frame - 1] > curve[frame] < curve[frame + 1]])
    visual = visual[(visual >= 2) & (visual < 4)]
    heard, seen = track([0.1, 1.0, 1.8], [0.2, 0.4, 0.3], fps=FPS, duration=2.0), track(visual - 2, fps=FPS, duration=2)
    hard = score_harmony(heard, seen, params=params, n_rotations=0)
    for ours, theirs in NAMES.items():
        assert float(getattr(soft, ours)) == pytest.approx(getattr(hard, theirs), abs=1e-6), ours


def test_a_mask_of_sixteen_bits_counts_every_frame():
    mask = torch.arange(600) < torch.tensor([[599], [301]])
    positions, beats = torch.randn(2, 600, 4, 3, generator=torch.Generator().manual_seed(1)), torch.arange(0.95, 20.0)
    scores = [
        softly(positions, beats.expand(2, -1), mask=each, tau=0.3, params=HarmonyParams.recommended()).above_chance
        for each in (mask, mask.bfloat16())
    ]
    assert torch.equal(*scores)


def test_sixteen_bit_positions_are_scored_in_thirty_two():
    clips = Clips(8)
    half = torch.tensor(clips.positions).bfloat16()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        soft = clips.soft(SMOOTH, 0.3, half)
    assert soft.harmony.dtype == torch.float32
    torch.testing.assert_close(soft.harmony, clips.soft(SMOOTH, 0.3, half.float()).harmony)


def test_softness_falls_geometrically():
    assert [relaxed.anneal(epoch, 3, 0.4, 0.1) for epoch in range(5)] == pytest.approx([0.4, 0.2, 0.1, 0.1, 0.1])
    assert relaxed.anneal(0, 1, 0.4, 0.1) == pytest.approx(0.1)
    refused("softness must be positive, got start 0", relaxed.anneal, 0, 3, 0, 0.1)


def test_left_out_strengths_and_masks_are_ones_and_beats_that_are_not_nan():
    clips = Clips(3)
    positions, beats, ends = torch.tensor(clips.positions), torch.tensor(clips.beats), torch.tensor(clips.beat_mask)
    left_out = relaxed.soft_harmony(positions, beats.where(ends, torch.nan), fps=FPS, tau=0.5, params=PAPER)
    said = softly(positions, beats, beat_mask=ends, tau=0.5, params=PAPER)
    assert said.above_chance.std() > 0
    torch.testing.assert_close(vars(left_out), vars(said))
    settings = {"fps": FPS, "tau": 0.5, "params": PAPER}
    refused("positions must be a torch.Tensor, got ndarray", relaxed.soft_harmony, clips.positions, beats, **settings)


@cases(
    "change, message",
    ({"positions": torch.zeros(2, 9, 3)}, r"positions must be \(N, T, J, 3\), or a speed \(N, T\)"),
    ({"positions": torch.zeros(2, 1)}, "with two frames or more"),
    ({"mask": torch.ones(2, 8)}, r"mask must be \(2, 9\)"),
    ({"strengths": torch.ones(2, 2)}, "beats, strengths and beat_mask must be"),
    ({"span": torch.zeros(2)}, r"span must be \(2, 2\)"),
    ({"beats": torch.full((2, 3), float("nan"))}, "beats must be finite where beat_mask is 1"),
    ({"beats": torch.rand(2, 3).bfloat16()}, "beats are of torch.bfloat16: one at 30 s would be up to 60 ms off"),
    ({"beats": torch.tensor([[1.0, 2.0, 3.0], [3.0, 1.0, 3.0]])}, "beats must differ, .*, and pad by NaN or mask"),
    ({"beats": torch.tensor([[2.0, 1.0, 3.0]] * 2), "bar_places": torch.zeros(2)}, "ascend where bar_places"),
    ({"strengths": torch.full((2, 3), float("nan"))}, "strengths must be finite and not negative where beat_mask is 1"),
    ({"positions": torch.zeros(2, 9, 3, 4)}, r"positions must be \(N, T, J, 3\).*got \(2, 9, 3, 4\)"),
    ({"strengths": np.ones((2, 3))}, "strengths must be a torch.Tensor, got ndarray"),
    ({"positions": torch.ones(2, 9, dtype=torch.int16)}, "positions must be floating-point numbers, got torch.int16"),
    ({"params": "paper"}, r"params must be HarmonyParams, such as .*; got 'paper'"),
    ({"mask": torch.full((2, 9), 0.5)}, "mask must be True and False, or 1 and 0"),
    ({"beat_mask": torch.full((2, 3), float("nan"))}, "beat_mask must be True and False, or 1 and 0"),
    ({"positions": torch.full((2, 9), float("nan"))}, "positions must be finite up to the last frame where mask is 1"),
    ({"tau": 0.0}, "tau must be positive, got 0.0"),
    ({"fps": -15.0}, "fps must be positive, got -15.0"),
    ({"params": replace(PAPER, fps=25.0)}, "defined at 25 fps and the motion has 15: resample it first"),
    ({"params": replace(PAPER, detector="direction")}, "'direction' has no relaxation"),
    ({"params": replace(PAPER, matching="nearest")}, "only matching = 'many' has a relaxation, got 'nearest'"),
    ({"params": replace(PAPER, saliency="literal")}, "only saliency = 'threshold' has a relaxation"),
    ({"params": replace(PAPER, position_smoothing=0.1)}, "only position_smoothing = 0.0 has a relaxation"),
    ({"params": replace(PAPER, plateau="middle")}, "only plateau = 'last' has a relaxation"),
    ({"params": HarmonyParams.recommended()}, "the shape of the body needs joint positions"),
    ({"bar_places": torch.zeros(3)}, r"bar_places must be \(2,\), one a clip; got \(3,\)"),
    ({"positions": torch.rand(2, 9, 3, 3), "params": OTHER_CLOCK}, "only clock = 1.0 has a relaxation, got 1.01"),
)
def test_what_cannot_be_scored_is_refused_by_name(change: dict[str, object], message: str):
    given = {"positions": torch.rand(2, 9), "beats": torch.rand(2, 3), "tau": 0.1, "params": PAPER}
    refused(message, softly, **(given | {"mask": torch.ones(2, 9)} | change))


SECONDS = 24.0
BEATS = np.arange(0.4137, SECONDS - 0.4, 0.5)
TEMPO = 0.5
REST, HIT = HOW_PATTERNS["rest"], HOW_PATTERNS["hit"]
WALTZ, CHA_CHA = DANCE_PATTERNS["waltz"], DANCE_PATTERNS["cha-cha"]
SOFTNESS = 0.1
DANCER = synthetic_motion(BEATS, seconds=SECONDS, fps=15.0, seed=3)


def dancer(ends: np.ndarray, fps: float) -> Motion:
    """A dancer whose movements end at these times."""
    return synthetic_motion(ends, seconds=SECONDS, fps=fps, seed=3)


def drifting(fps: float) -> Motion:
    """Joints that move about smoothly, to no beat."""
    steps = np.random.default_rng(1).normal(size=(round(SECONDS * 120), 12, 3))
    places = 6 * gaussian_filter1d(steps, 20, axis=0)[:: round(120 / fps)]
    return Motion(places + np.random.default_rng(2).normal(size=(12, 3)), fps, Skeleton.unnamed(12))


CHEATS: dict[str, Callable[[float], Motion]] = {
    "rests": lambda fps: dancer(BEATS, fps),
    "60 ms late": lambda fps: dancer(BEATS + 0.06, fps),
    "a quarter late": lambda fps: dancer(BEATS + TEMPO / 4, fps),
    "half a beat late, a hit": lambda fps: dancer(BEATS + TEMPO / 2, fps),
    "half time": lambda fps: dancer(BEATS[::2], fps),
    "double time": lambda fps: dancer(np.arange(BEATS[0], SECONDS - 0.4, TEMPO / 2), fps),
    "1.6 % fast": lambda fps: dancer(np.arange(BEATS[0], SECONDS - 0.4, TEMPO / 1.016), fps),
    "another tempo": lambda fps: dancer(np.arange(BEATS[0], SECONDS - 0.4, 0.43), fps),
    "noise": drifting,
}


def soft_of(motion: Motion, pattern: BarPattern, *, place: int | None = 0, tau: float = SOFTNESS) -> float:
    """H of a motion as the loss sees it."""
    given = {
        "params": HarmonyParams.recommended(pattern),
        "bar_places": None if place is None else torch.tensor([place]),
    }
    return float(softly(motion.positions.copy(), BEATS, fps=motion.fps, tau=tau, **given).above_chance)


def hard_of(motion: Motion, pattern: BarPattern, *, place: int | None = 0, beats: np.ndarray = BEATS) -> float:
    """H of the place test."""
    signal = shape_signal(shape_speed(motion), beats[0], beats[-1])
    places = None if place is None else np.arange(place, place + beats.size)
    return place_test(signal, beats, places, pattern).harmony_above_chance


@cases("name, fps", *((name, 15.0) for name in CHEATS), *product(("rests", "noise"), (24.0, 60.0)))
def test_soft_and_hard_score_agree(name: str, fps: float):
    motion = CHEATS[name](fps)
    for pattern, place in ((REST, 0), (HIT, 0), (CHA_CHA, 1), (WALTZ, 2), (WALTZ, None)):
        soft, hard = (score(motion, pattern, place=place) for score in (soft_of, hard_of))
        assert soft == pytest.approx(hard, abs=0.03), (pattern.dance or pattern.source, place)


def test_the_first_beat_counts_also_between_two_samples_of_the_movement():
    test = place_test(shape_signal(shape_speed(DANCER), BEATS[0], BEATS[-1]), BEATS, None, REST)
    assert (test.first, test.ranks.shape[1]) == (0, BEATS.size - 1)


@pytest.mark.parametrize("pattern", [REST, CHA_CHA, WALTZ])
def test_soft_fits_are_the_hard_ones_on_circles_of_any_size(pattern: BarPattern, rng: np.random.Generator):
    sizes = [cycles * pattern.beats * relaxed.MOMENTS for cycles in (4, 6, 1)]
    speed = np.zeros((3, max(sizes)))
    for row, size in zip(speed, sizes, strict=True):
        row[:size] = rng.normal(size=size)
    soft = relaxed.soft_fits(torch.tensor(speed), torch.tensor(sizes)[:, None], pattern)
    for row, size, fits in zip(speed, sizes, soft.numpy(), strict=True):
        hard = pattern_fits(row[:size], pattern, moments=relaxed.MOMENTS)
        np.testing.assert_allclose(fits[:, :size], hard, atol=1e-12)


def test_the_difference_falls_with_the_softness():
    hard = hard_of(DANCER, REST)
    differences = [abs(soft_of(DANCER, REST, tau=tau) - hard) for tau in (1.0, 0.5, 0.2, 0.05)]
    assert differences == sorted(differences, reverse=True)
    assert differences[0] > 0.1


def test_the_rest_is_the_pattern_when_none_is_given():
    assert soft_of(DANCER, REST) == pytest.approx(-soft_of(DANCER, HIT))
    soft = softly(DANCER.positions.copy(), BEATS, tau=SOFTNESS, params=HarmonyParams.recommended())
    assert float(soft.above_chance) == soft_of(DANCER, REST)
    assert float(soft.chance) == 0.5
    # In the paper's terms: the mean rank of the beats for their hit rate, and nothing to count.
    assert float(soft.hit_rate) == pytest.approx((1 + float(soft.above_chance)) / 2, abs=0.01)
    assert float(soft.n_audio) == float(soft.n_visual) == BEATS.size
    assert float(soft.hitting_score) == pytest.approx(float(soft.hit_rate) * BEATS.size)


def test_the_training_loss_takes_it_without_counting_beats():
    walks = 0.1 * np.random.default_rng(3).normal(size=(2, 60, 5, 3)).cumsum(axis=1)
    beats = (0.2 + 0.4 * torch.arange(9)).expand(2, 9)
    soft = softly(walks, beats, tau=0.2, params=HarmonyParams.recommended(CHA_CHA))
    assert float(above_chance_loss(soft)) == pytest.approx(-float(soft.above_chance.mean()))
    assert abs(float(soft.above_chance.mean())) > 0.01


def test_flat_pictures_and_two_points_have_the_same_score():
    places = DANCER.positions
    flat = Motion(100 * places[..., :2], 15.0, DANCER.skeleton)
    for motion in (flat, Motion(places[:, [4, 10]], 15.0, Skeleton.unnamed(2))):
        assert soft_of(motion, REST) == pytest.approx(hard_of(motion, REST), abs=0.03)
        assert soft_of(motion, REST) > 0.2


def frozen(yaw: Tensor, path: Tensor) -> Tensor:
    """The 40th pose of the dancer, turned and carried: (T, J, 3)."""
    pose = torch.tensor(DANCER.positions[40])
    x, y, z = (pose - pose.mean(dim=0)).T
    cos, sin = yaw.cos()[:, None], yaw.sin()[:, None]
    return torch.stack([cos * x + sin * z + path[:, :1], y.expand(len(yaw), -1), cos * z - sin * x + path[:, 1:]], -1)


def rigid(kind: str) -> np.ndarray:
    """A pose that moves in time without dancing: 24 s at 15 fps."""
    frames = DANCER.n_frames
    phase = torch.tensor(np.pi * (np.arange(frames) / 15.0 - BEATS[0]) / TEMPO)
    if kind == "turning and travelling":
        return frozen(phase.sin(), torch.stack([phase.cos(), phase], dim=1)).numpy()
    still = frozen(torch.zeros(frames), torch.zeros(frames, 2)).numpy()
    random, toe = np.random.default_rng(0).normal(size=still.shape[1:]), (np.arange(still.shape[1]) == 5)[:, None]
    moves = {
        "bob": [0.0, 0.1, 0.0],
        "tremor of 1 mm": 1e-3 * random,
        "tremor of 1 nm": 1e-9 * random,
        "toe": 0.001 * toe,
    }
    return still + phase.sin().numpy()[:, None, None] * moves[kind]


@cases("kind", "turning and travelling", "bob", "tremor of 1 mm", "tremor of 1 nm", "toe")
def test_what_moves_without_dancing_gets_nothing(kind: str):
    motion = Motion(rigid(kind), 15.0, DANCER.skeleton)
    assert abs(soft_of(motion, REST)) < (0.06 if kind == "tremor of 1 mm" else 0.002)


def shape_score(positions: Tensor, tau: float = 0.3) -> Tensor:
    """H of one motion (T, J, 3) at 15 fps that should rest on the beats."""
    return softly(positions, BEATS, tau=tau, params=HarmonyParams.recommended()).above_chance.sum()


def room_score(positions: Tensor, tau: float = 0.3) -> Tensor:
    """The same of the speed in the room."""
    speed = relaxed.soft_speed(positions[None], 15.0) / positions.shape[1]
    room, times = relaxed.SoftShape(speed, torch.tensor([len(positions) - 1]), 15.0), torch.tensor(BEATS)[None]
    return relaxed.soft_place(room, times, torch.ones_like(times).bool(), REST, tau=tau).harmony_above_chance.sum()


def dance_gradient() -> float:
    """Largest entry of the gradient of a dance that is a quarter beat late."""
    late = torch.tensor(dancer(BEATS + TEMPO / 4, 15.0).positions, requires_grad=True)
    return float(torch.autograd.grad(shape_score(late), late)[0].abs().max())


@pytest.mark.parametrize("score", [shape_score, room_score])
def test_a_statue_that_turns_and_travels_wins_the_room_score_but_not_this_one(score: Callable[..., Tensor]):
    generator, frames = torch.Generator().manual_seed(0), DANCER.n_frames
    yaw = 0.02 * torch.randn(frames, generator=generator, dtype=torch.float64).cumsum(dim=0)
    path = 0.01 * torch.randn(frames, 2, generator=generator, dtype=torch.float64).cumsum(dim=0)
    adam = torch.optim.Adam([yaw.requires_grad_(), path.requires_grad_()], lr=0.02)
    largest = 0.0
    for _ in range(60):
        adam.zero_grad()
        (-score(frozen(yaw, path))).backward()
        largest = max(largest, float(yaw.grad.abs().max()), float(path.grad.abs().max()))
        adam.step()
    final = float(score(frozen(yaw, path), SOFTNESS).detach())
    if score is room_score:
        assert final > 0.8 and largest > dance_gradient()
    else:
        assert abs(final) < 1e-6 and largest < 1e-6 * dance_gradient()


@pytest.mark.slow
def test_a_dance_a_quarter_beat_late_is_put_right():
    late = dancer(BEATS + TEMPO / 4, 15.0)
    before, positions = torch.tensor(late.positions), torch.tensor(late.positions, requires_grad=True)
    adam = torch.optim.Adam([positions], lr=0.005)
    for _ in range(60):
        adam.zero_grad()
        change = positions - before
        rough = (change.diff(n=3, dim=0) * 15**3).square().mean()
        (5 * change.square().sum(dim=-1).mean() + 1e-5 * rough - shape_score(positions)).backward()
        adam.step()
    after = positions.detach()
    assert abs(hard_of(late, REST)) < 0.1
    assert hard_of(replace(late, positions=after.numpy()), REST) > 0.8
    assert float((after - before).norm(dim=-1).mean()) < 0.08
    jerks = [float(each.diff(n=3, dim=0).square().mean().sqrt()) for each in (after, before)]
    assert jerks[0] < 1.5 * jerks[1]


@pytest.mark.parametrize(("joints", "axes"), [(4, 3), (4, 2), (2, 3)])
@pytest.mark.parametrize("pattern", [REST, WALTZ])
def test_gradient_of_the_shape_is_that_of_finite_differences(joints: int, axes: int, pattern: BarPattern):
    rng = np.random.default_rng(5)
    walks = 0.1 * rng.normal(size=(2, 20, joints, axes)).cumsum(axis=1) + rng.normal(size=(joints, axes))
    positions = torch.tensor(walks, requires_grad=True)
    beats = torch.tensor([[0.1, 0.3, 0.52, 0.74, 0.9], [0.0, 0.2, 0.4, 0.6, 0.8]], dtype=torch.float64)
    counted = torch.tensor([[True] * 5, [True] * 4 + [False]])
    mask = torch.arange(20) < torch.tensor([[20], [16]])

    def score(joints: Tensor) -> Tensor:
        shape, places = relaxed.soft_shape_speed(joints, mask, 15.0, smoothing=0.06), torch.tensor([0, 1])
        return relaxed.soft_place(shape, beats, counted, pattern, tau=0.4, places=places).harmony_above_chance

    assert torch.autograd.gradcheck(score, (positions,), eps=1e-7, atol=1e-5, fast_mode=True)


BODY, OFFSETS = (torch.rand(5, 3, generator=torch.Generator().manual_seed(seed)) for seed in (1, 2))
STILL, SWING = BODY.expand(2, 60, 5, 3), 0.1 * (torch.arange(60.0) / 3).sin()[:, None, None]
# Bodies (2, T, J, 3) that are hard to differentiate.
ODD = {
    "still": STILL,
    "all joints at one point": 0 * STILL,
    "all joints at one point that moves": STILL[:, :, :1] * (1 + SWING) * torch.ones(5, 1),
    "one vertical line": torch.tensor([0.0, 1.0, 0.0]) * STILL * (1 + SWING),
    "one line": STILL[..., :1] * torch.tensor([1.0, 2.0, 0.5]) * (1 + SWING),
    "one joint moves": STILL + SWING * (torch.arange(5) == 2)[:, None],
    "one jump": STILL + 0.3 * OFFSETS * (torch.arange(60) >= 30)[:, None, None],
    "two joints": STILL[:, :, :2] * (1 + SWING),
    "one joint": STILL[:, :, :1] * (1 + SWING),
    "two frames": STILL[:, :2],
}


@pytest.mark.parametrize("kind", ODD)
@cases("n_beats, strength", (0, 1.0), (1, 1.0), (7, 1.0), (7, 0.0))
@pytest.mark.parametrize("params", [PAPER, VALLEYS, HarmonyParams.valleys(), HarmonyParams.recommended(WALTZ)])
def test_gradients_are_finite_and_nothing_scores_nothing(kind, n_beats, strength, params):
    positions = ODD[kind].clone().requires_grad_()
    beats = (0.1 + 0.5 * torch.arange(7.0)).expand(2, 7)
    counted = torch.arange(7).expand(2, 7) < n_beats
    soft = softly(positions, beats, strengths=strength + 0 * beats, beat_mask=counted, tau=0.2, params=params)
    numbers = [getattr(soft, name) for name in NAMES]
    assert all(torch.isfinite(number).all() for number in numbers)
    (gradient,) = torch.autograd.grad(sum(number.sum() for number in numbers), positions, create_graph=True)
    (second,) = torch.autograd.grad(gradient.sum(), positions)
    assert torch.isfinite(gradient).all() and torch.isfinite(second).all()
    if params.measure == "hits":
        if n_beats * strength == 0 or kind in ("still", "all joints at one point", "two frames"):
            assert not soft.harmony.detach().any() and not soft.above_chance.detach().any()
    elif n_beats < 4 or kind in ("still", "one joint", "two frames") or "all joints" in kind:
        assert float(soft.above_chance.detach().abs().max()) < 1e-6
    else:
        assert float(gradient.detach().abs().max()) > (0 if kind == "one line" else 1e-6)


def test_only_beats_in_the_span_count_and_keep_their_place_in_the_bar():
    inside = (BEATS >= 5) & (BEATS < 18)
    kept, place = BEATS[inside], int(np.flatnonzero(inside)[0])
    given = {"tau": SOFTNESS, "params": HarmonyParams.recommended(WALTZ)}
    positions, span = DANCER.positions.copy(), torch.tensor([[5.0, 18.0]])
    whole = softly(positions, BEATS, span=span, bar_places=torch.tensor([0]), **given).above_chance
    part = softly(positions, kept, bar_places=torch.tensor([place]), **given).above_chance
    assert float(whole) == pytest.approx(float(part))
    assert float(whole) == pytest.approx(hard_of(DANCER, WALTZ, place=place, beats=kept), abs=0.03)


@pytest.mark.parametrize("params", [replace(PAPER, fps=None), VALLEYS, HarmonyParams.recommended()])
def test_beats_of_the_whole_song_and_in_any_order_are_those_of_the_clip(params: HarmonyParams):
    part, beats = DANCER.span(0.0, 12.0).positions.copy(), BEATS[BEATS < 12.0]
    expected = softly(part, beats, tau=SOFTNESS, params=params).above_chance
    mixed = np.random.default_rng(0).permutation(np.append(BEATS, -1.0))
    torch.testing.assert_close(softly(part, mixed, tau=SOFTNESS, params=params).above_chance, expected)


def test_a_song_without_beats_scores_nothing():
    soft = softly(DANCER.positions.copy(), np.zeros(0), tau=SOFTNESS, params=HarmonyParams.recommended())
    assert not float(soft.above_chance) and not float(soft.harmony)


def test_a_later_dance_is_expected_with_a_lag():
    params, late = replace(HarmonyParams.recommended(), lag=0.1), dancer(BEATS + 0.1, 15.0)
    soft = softly(late.positions.copy(), BEATS, tau=SOFTNESS, params=params)
    assert float(soft.above_chance) == pytest.approx(soft_of(DANCER, REST), abs=0.03)
    # A beat that would be danced after the end does not count.
    beyond = softly(late.positions.copy(), np.append(BEATS, SECONDS - 0.05), tau=SOFTNESS, params=params)
    assert float(beyond.n_audio) == BEATS.size


def test_a_turn_about_the_vertical_is_taken_back():
    yaw = 0.3 * torch.randn(50, generator=torch.Generator().manual_seed(3), dtype=torch.float64).cumsum(dim=0)
    turned = frozen(yaw, torch.zeros(50, 2))
    still = relaxed.unturned((turned - turned.mean(dim=1, keepdim=True))[None])[0]
    torch.testing.assert_close(still, still[:1].expand_as(still))


def test_shape_speed_is_that_of_the_hard_score():
    for motion in (DANCER, drifting(30.0)):
        hard, positions = shape_speed(motion), torch.tensor(motion.positions)[None]
        soft = relaxed.soft_shape_speed(positions, torch.ones(1, motion.n_frames), motion.fps, smoothing=0.06)
        inside = slice(round(soft.rate), -round(soft.rate))  # the ends of a spline are a matter of taste
        times = np.arange(soft.speed.shape[1])[inside] / soft.rate
        expected = np.interp(times, hard.times, hard.speed / np.median(hard.extent))
        np.testing.assert_allclose(soft.speed[0].numpy()[inside], expected, atol=0.02 * expected.max())
