"""The relaxed harmony against the hard one: equal at tiny tau, close at small tau, differentiable everywhere else."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from torch import Tensor

from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.params import HarmonyParams
from harmolab.score import HarmonyScore, score_harmony
from harmolab.soft_score import SoftHarmony, anneal, soft_beats, soft_harmony, soft_salience, soft_speed
from harmolab.types import BeatTrack, Motion
from tests.builders import cases, refused

PAPER = HarmonyParams.paper()
VALLEYS = replace(HarmonyParams.valleys(), fps=15.0, subframe=False)
SMOOTH = replace(PAPER, smoothing=0.05)
FPS = 15.0
NAMES = {  # field of SoftHarmony -> field of HarmonyScore
    "harmony": "harmony",
    "hitting_score": "hitting_score",
    "chance": "chance",
    "above_chance": "harmony_above_chance",
    "hit_rate": "hit_rate",
    "n_visual": "n_visual",
    "n_audio": "n_audio",
}


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

    def soft(self, params: HarmonyParams, tau: float, positions: Tensor | None = None) -> SoftHarmony:
        motion = torch.tensor(self.positions) if positions is None else positions
        beats, strengths = torch.tensor(self.beats), torch.tensor(self.strengths)
        masks = torch.tensor(self.beat_mask), torch.tensor(self.mask)
        return soft_harmony(motion, beats, strengths, *masks, fps=FPS, tau=tau, params=params)

    def hard(self, params: HarmonyParams) -> list[HarmonyScore]:
        scores = []
        for row, (length, count) in enumerate(zip(self.lengths, self.counts, strict=True)):
            motion = Motion(self.positions[row, :length], FPS, Skeleton.unnamed(self.positions.shape[2]))
            music = BeatTrack(self.beats[row, :count], self.strengths[row, :count], FPS, length / FPS)
            visual = visual_beats(motion, params=params)
            scores.append(score_harmony(music, visual, params=params, n_rotations=0))
        return scores


def one_clip(
    curve: list[float], beats: list[float], *, params: HarmonyParams = VALLEYS, tau: float = 1e-8, fps: float = FPS
) -> SoftHarmony:
    """The relaxed score of one speed curve."""
    speed, times = torch.tensor([curve], dtype=torch.float64), torch.tensor([beats], dtype=torch.float64)
    music = (times, torch.ones_like(times), torch.ones_like(times))
    return soft_harmony(speed, *music, torch.ones_like(speed), fps=fps, tau=tau, params=params)


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
        times = torch.tensor(beats)[None]
        masks = torch.ones_like(times), torch.ones(1, motion.n_frames)
        soft = soft_harmony(
            torch.tensor(motion.positions)[None], times, masks[0], *masks, fps=FPS, tau=1e-6, params=params
        )
        differences.append(abs(float(soft.above_chance) - hard.harmony_above_chance))
    assert np.mean(differences) < 0.05


def test_padding_changes_nothing():
    clips, rest = Clips(3), torch.tensor(np.random.default_rng(0).normal(size=(8, 60, 5, 3)))
    filled = torch.where(torch.tensor(clips.mask)[..., None, None], torch.tensor(clips.positions), rest)
    for params in (SMOOTH, HarmonyParams.valleys()):
        plain, other = clips.soft(params, 0.2), clips.soft(params, 0.2, filled)
        for field in fields(SoftHarmony):
            torch.testing.assert_close(getattr(other, field.name), getattr(plain, field.name))


def test_clips_of_a_batch_do_not_know_each_other():
    clips = Clips(4)
    together = clips.soft(SMOOTH, 0.3)
    row, length, count = 5, int(clips.lengths[5]), int(clips.counts[5])
    alone = soft_harmony(
        torch.tensor(clips.positions[row : row + 1, :length]),
        torch.tensor(clips.beats[row : row + 1, :count]),
        torch.tensor(clips.strengths[row : row + 1, :count]),
        torch.ones(1, count),
        torch.ones(1, length),
        fps=FPS,
        tau=0.3,
        params=SMOOTH,
    )
    for field in fields(SoftHarmony):
        torch.testing.assert_close(getattr(alone, field.name)[0], getattr(together, field.name)[row])


@pytest.mark.parametrize("params", [SMOOTH, HarmonyParams.valleys()], ids=["paper smoothed", "valleys"])
def test_gradient_is_that_of_finite_differences(params: HarmonyParams):
    clips = Clips(7, count=2, frames=16, joints=2, beats=3)
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


def test_gradient_of_the_number_of_beats_exists():
    clips = Clips(5)
    motion = torch.tensor(clips.positions, requires_grad=True)
    (gradient,) = torch.autograd.grad(clips.soft(PAPER, 0.3, motion).n_visual.sum(), motion)
    assert gradient.abs().max() > 1e-3


def test_steps_along_the_gradient_raise_the_hard_score():
    clips = Clips(6)
    motion = torch.tensor(clips.positions, requires_grad=True)
    params = HarmonyParams.valleys()
    before = np.mean([score.harmony_above_chance for score in clips.hard(params)])
    optimiser = torch.optim.Adam([motion], lr=2e-3)
    for step in range(40):
        optimiser.zero_grad()
        (-clips.soft(params, anneal(step, 40, 0.5, 0.05), motion).above_chance.sum()).backward()
        optimiser.step()
    clips.positions = motion.detach().numpy()
    assert np.mean([score.harmony_above_chance for score in clips.hard(params)]) > before + 0.3


def test_the_known_valley_hits_the_known_beat():
    # The curve's only valley is at frame 3 = 0.2 s; beats at 0.25 s (hit) and 0.4 s (miss); window 0.1-0.3 of 0.6 s.
    soft = one_clip([5.0, 3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.25, 0.4], params=replace(VALLEYS, smoothing=0.0))
    assert float(soft.n_visual) == pytest.approx(1)
    assert float(soft.hitting_score) == pytest.approx(1)
    assert float(soft.chance) == pytest.approx(0.2 / 0.6)
    assert float(soft.above_chance) == pytest.approx((1 / 2 - 1 / 3) / (2 / 3))
    assert float(soft.harmony) == pytest.approx(5 * 1 / (2 * 4 + 1))
    assert float(soft.hit_rate) == pytest.approx(0.5)


def test_a_beat_exactly_at_the_delay_is_a_hit():
    params = replace(VALLEYS, smoothing=0.0, reaction_delay=0.2)
    soft = one_clip([5.0, 3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.4], params=params)
    assert float(soft.hitting_score) == pytest.approx(1)


def test_a_plateau_is_one_beat_at_its_last_frame():
    curve = torch.tensor([[1.0, 3.0, 3.0, 3.0, 2.0, 1.0]])
    weights = soft_beats(curve, torch.ones_like(curve), fps=FPS, tau=1e-6, detector="turns")
    torch.testing.assert_close(weights, torch.tensor([[0.0, 0, 0, 1, 0, 0]]))


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
    torch.testing.assert_close(soft_salience(weights, curve, tau=0.2, params=params), expected)


def test_softness_means_the_same_at_every_frame_rate():
    counts = []
    for fps in (15.0, 30.0, 120.0):
        curve = list(1.2 + np.cos(2 * np.pi * 1.7 * np.arange(0, 6, 1 / fps) + 0.4))
        counts.append(float(one_clip(curve, [1.0], params=replace(VALLEYS, fps=None), tau=0.5, fps=fps).n_visual))
    assert max(counts) / min(counts) < 1.25


def test_a_turn_half_way_between_two_frames_is_seen_while_soft():
    # The step across the valley is 0: its neighbours alone tell.
    curve = torch.tensor([[3.0, 2.0, 1.0, 1.0, 2.0, 3.0]])
    weights = soft_beats(curve, torch.ones_like(curve), fps=FPS, tau=0.5, detector="valleys")
    assert float(weights.sum()) == pytest.approx(1, abs=0.05)


def test_more_beats_raise_chance_while_soft():
    frames = np.arange(61)
    chances = [float(one_clip(list(np.cos(np.pi * frames / half)), [1.0], tau=0.3).chance) for half in (10, 5, 3)]
    assert chances == sorted(chances)
    assert chances[2] > 2 * chances[0]


def test_only_the_span_counts():
    curve = list(1.0 + np.cos(np.arange(90) * 0.8))
    speed, beats = torch.tensor([curve]), torch.tensor([[0.5, 2.1, 3.0, 3.8, 5.0]], dtype=torch.float64)
    music = (beats, torch.tensor([[1.0, 0.2, 0.4, 0.3, 0.9]]), torch.ones_like(beats))
    span = torch.tensor([[2.0, 4.0]])
    params = replace(VALLEYS, smoothing=0.0)
    soft = soft_harmony(speed, *music, torch.ones_like(speed), fps=FPS, tau=1e-8, params=params, span=span)
    # The same by hand: visual beats in [2, 4) s, three music beats, their strengths over the largest of the three.
    visual = np.array([frame / FPS for frame in range(1, 89) if curve[frame - 1] > curve[frame] < curve[frame + 1]])
    visual = visual[(visual >= 2) & (visual < 4)]
    music_beats = BeatTrack([0.1, 1.0, 1.8], [0.2, 0.4, 0.3], FPS, 2.0)
    hard = score_harmony(
        music_beats, BeatTrack(visual - 2, np.ones(visual.size), FPS, 2.0), params=params, n_rotations=0
    )
    for ours, theirs in NAMES.items():
        assert float(getattr(soft, ours)) == pytest.approx(getattr(hard, theirs), abs=1e-6), ours


@pytest.mark.parametrize("params", [PAPER, VALLEYS, HarmonyParams.valleys()], ids=["paper", "valleys", "subframe"])
@pytest.mark.parametrize("kind", ["at rest", "one step", "two frames", "no music", "no strength"])
def test_nothing_to_score_is_zero_with_a_finite_gradient(params: HarmonyParams, kind: str):
    frames = 2 if kind == "two frames" else 30
    still = torch.zeros(2, frames, 3, 3)
    if kind == "one step":
        still[:, 10:] = 1.0
    if kind in ("no music", "no strength"):
        still = torch.tensor(np.random.default_rng(0).normal(size=(2, frames, 3, 3)), dtype=torch.float32)
    still.requires_grad_()
    beats = torch.tensor([[0.05, 0.1]] * 2)
    strengths = torch.zeros(2, 2) if kind == "no strength" else torch.ones(2, 2)
    heard = torch.zeros(2, 2) if kind == "no music" else torch.ones(2, 2)
    soft = soft_harmony(still, beats, strengths, heard, torch.ones(2, frames), fps=FPS, tau=0.1, params=params)
    assert all(torch.isfinite(getattr(soft, field.name)).all() for field in fields(SoftHarmony))
    if kind != "one step":
        assert float(soft.harmony.detach().abs().max()) == 0
        assert float(soft.above_chance.detach().abs().max()) == 0
    (soft.harmony + soft.above_chance + soft.n_visual + soft.hit_rate).sum().backward()
    assert torch.isfinite(still.grad).all()


def test_sixteen_bit_positions_are_scored_in_thirty_two():
    clips = Clips(8)
    half = torch.tensor(clips.positions).bfloat16()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        soft = clips.soft(SMOOTH, 0.3, half)
    assert soft.harmony.dtype == torch.float32
    torch.testing.assert_close(soft.harmony, clips.soft(SMOOTH, 0.3, half.float()).harmony)


def test_speed_of_a_known_step():
    positions = torch.tensor([[[[0.0, 0, 0], [0, 0, 0]], [[3, 4, 0], [0, 0, 2]], [[4, 4, 0], [0, 0, 2]]]])
    torch.testing.assert_close(soft_speed(positions, 1.0), torch.tensor([[7.0, 7, 1]]))
    torch.testing.assert_close(soft_speed(positions, 2.0, reading="signed"), torch.tensor([[18.0, 18, 2]]))
    torch.testing.assert_close(soft_speed(positions, 1.0, reading="norm_of_sum")[0, 2], torch.tensor(1.0))


def test_softness_falls_geometrically():
    assert [anneal(epoch, 3, 0.4, 0.1) for epoch in range(5)] == pytest.approx([0.4, 0.2, 0.1, 0.1, 0.1])
    assert anneal(0, 1, 0.4, 0.1) == pytest.approx(0.1)
    refused("softness must be positive, got start 0", anneal, 0, 3, 0, 0.1)


@cases(
    "change, message",
    ({"positions": torch.zeros(2, 9, 3)}, r"positions must be \(N, T, J, 3\), or a speed \(N, T\)"),
    ({"positions": torch.zeros(2, 1)}, "with two frames or more"),
    ({"mask": torch.ones(2, 8)}, r"mask must be \(2, 9\)"),
    ({"strengths": torch.ones(2, 2)}, "beats, strengths and beat_mask must be"),
    ({"span": torch.zeros(2)}, r"span must be \(2, 2\)"),
    ({"tau": 0.0}, "tau must be positive, got 0.0"),
    ({"fps": -15.0}, "fps must be positive, got -15.0"),
    ({"params": replace(PAPER, fps=25.0)}, "defined at 25 fps and the motion has 15: resample it first"),
    ({"params": replace(PAPER, detector="direction")}, "'direction' has no relaxation"),
    ({"params": replace(PAPER, matching="nearest")}, "only matching = 'many' has a relaxation, got 'nearest'"),
    ({"params": replace(PAPER, saliency="literal")}, "only saliency = 'threshold' has a relaxation"),
    ({"params": replace(PAPER, position_smoothing=0.1)}, "only position_smoothing = 0.0 has a relaxation"),
    ({"params": replace(PAPER, plateau="middle")}, "only plateau = 'last' has a relaxation"),
)
def test_what_cannot_be_scored_is_refused_by_name(change: dict[str, object], message: str):
    given = {
        "positions": torch.rand(2, 9),
        "beats": torch.rand(2, 3),
        "strengths": torch.ones(2, 3),
        "beat_mask": torch.ones(2, 3),
        "mask": torch.ones(2, 9),
        "fps": FPS,
        "tau": 0.1,
        "params": PAPER,
    }
    refused(message, soft_harmony, **{**given, **change})
