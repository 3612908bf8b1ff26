"""The soft score of the shape of the body against the hard one, its gradients, and what a statue can win by it."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from harmolab.body.skeletons import Skeleton
from harmolab.data.synthetic import synthetic_motion
from harmolab.params import DANCE_PATTERNS, HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.soft_score import (
    MOMENTS,
    SoftHarmony,
    SoftShape,
    soft_fits,
    soft_harmony,
    soft_place,
    soft_shape_speed,
    soft_speed,
    unturned,
)
from harmolab.systems.harmogan.losses import above_chance_loss
from harmolab.types import Motion
from harmolab.verdict.bar_pattern import pattern_fits
from harmolab.verdict.evidence import place_test
from tests.builders import cases, refused

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


def soft_score(
    motion: Motion, pattern: BarPattern, *, place: int | None = 0, beats: np.ndarray = BEATS, tau: float = SOFTNESS
) -> float:
    """H of a motion as the loss sees it."""
    times, positions = torch.tensor(beats)[None], torch.tensor(motion.positions)[None]
    places = None if place is None else torch.tensor([place])
    soft = soft_harmony(
        positions, times, torch.ones_like(times), torch.ones_like(times), torch.tensor(motion.valid)[None],
        fps=motion.fps, tau=tau, params=HarmonyParams.recommended(pattern), bar_places=places,
    )  # fmt: skip
    return float(soft.above_chance)


def hard_score(motion: Motion, pattern: BarPattern, *, place: int | None = 0, beats: np.ndarray = BEATS) -> float:
    """H of the place test."""
    signal = shape_signal(shape_speed(motion), beats[0], beats[-1])
    places = None if place is None else np.arange(place, place + beats.size)
    return place_test(signal, beats, places, pattern).harmony_above_chance


@cache
def cheat(name: str, fps: float) -> Motion:
    return CHEATS[name](fps)


@pytest.mark.parametrize("fps", [15.0, 24.0, 60.0])
@pytest.mark.parametrize("name", CHEATS)
def test_soft_and_hard_score_agree(name: str, fps: float):
    motion = cheat(name, fps)
    for pattern, place in ((REST, 0), (HIT, 0), (CHA_CHA, 1), (WALTZ, 2), (WALTZ, None)):
        soft, hard = (score(motion, pattern, place=place) for score in (soft_score, hard_score))
        assert soft == pytest.approx(hard, abs=0.03), (pattern.dance or pattern.source, place)


def test_the_first_beat_counts_also_between_two_samples_of_the_movement():
    test = place_test(shape_signal(shape_speed(DANCER), BEATS[0], BEATS[-1]), BEATS, None, REST)
    assert (test.first, test.ranks.shape[1]) == (0, BEATS.size - 1)


@pytest.mark.parametrize("pattern", [REST, CHA_CHA, WALTZ])
def test_soft_fits_are_the_hard_ones_on_circles_of_any_size(pattern: BarPattern, rng: np.random.Generator):
    sizes = [cycles * pattern.beats * MOMENTS for cycles in (4, 6, 1)]
    speed = np.zeros((3, max(sizes)))
    for row, size in zip(speed, sizes, strict=True):
        row[:size] = rng.normal(size=size)
    soft = soft_fits(torch.tensor(speed), torch.tensor(sizes)[:, None], pattern)
    for row, size, fits in zip(speed, sizes, soft.numpy(), strict=True):
        np.testing.assert_allclose(fits[:, :size], pattern_fits(row[:size], pattern, moments=MOMENTS), atol=1e-12)


def test_the_difference_falls_with_the_softness():
    motion = cheat("rests", 15.0)
    hard = hard_score(motion, REST)
    differences = [abs(soft_score(motion, REST, tau=tau) - hard) for tau in (1.0, 0.5, 0.2, 0.05)]
    assert differences == sorted(differences, reverse=True)
    assert differences[0] > 0.1


def test_the_rest_is_the_pattern_when_none_is_given():
    assert soft_score(DANCER, REST) == pytest.approx(-soft_score(DANCER, HIT))
    times = torch.tensor(BEATS)[None]
    masks = torch.ones_like(times), torch.ones(1, DANCER.n_frames)
    soft = soft_harmony(
        torch.tensor(DANCER.positions)[None], times, masks[0], *masks,
        fps=15.0, tau=SOFTNESS, params=HarmonyParams.recommended(),
    )  # fmt: skip
    assert float(soft.above_chance) == soft_score(DANCER, REST)
    assert float(soft.chance) == 0.5
    # In the paper's terms: the mean rank of the beats for their hit rate, and nothing to count.
    assert float(soft.hit_rate) == pytest.approx((1 + float(soft.above_chance)) / 2, abs=0.01)
    assert float(soft.n_audio) == float(soft.n_visual) == BEATS.size
    assert float(soft.hitting_score) == pytest.approx(float(soft.hit_rate) * BEATS.size)


def test_the_training_loss_takes_it_without_counting_beats():
    walks = 0.1 * np.random.default_rng(3).normal(size=(2, 60, 5, 3)).cumsum(axis=1)
    beats = (0.2 + 0.4 * torch.arange(9)).expand(2, 9)
    soft = soft_harmony(
        torch.tensor(walks), beats, torch.ones_like(beats), torch.ones_like(beats), torch.ones(2, 60),
        fps=15.0, tau=0.2, params=HarmonyParams.recommended(CHA_CHA),
    )  # fmt: skip
    assert float(above_chance_loss(soft)) == pytest.approx(-float(soft.above_chance.mean()))
    assert abs(float(soft.above_chance.mean())) > 0.01


def test_flat_pictures_and_two_points_have_the_same_score():
    places = DANCER.positions
    flat = Motion(100 * places[..., :2], 15.0, DANCER.skeleton)
    for motion in (flat, Motion(places[:, [4, 10]], 15.0, Skeleton.unnamed(2))):
        assert soft_score(motion, REST) == pytest.approx(hard_score(motion, REST), abs=0.03)
        assert soft_score(motion, REST) > 0.2


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
    still = frozen(torch.zeros(frames), torch.zeros(frames, 2)).numpy()
    swing = phase.sin().numpy()[:, None, None]
    random = np.random.default_rng(0).normal(size=(still.shape[1], 3))
    if kind == "turning and travelling":
        return frozen(phase.sin(), torch.stack([phase.cos(), phase], dim=1)).numpy()
    if kind == "bob":
        return still + 0.1 * swing * np.array([0.0, 1.0, 0.0])
    if kind == "toe":
        return still + 0.001 * swing * (np.arange(still.shape[1]) == 5)[:, None]
    return still + {"tremor of 1 mm": 1e-3, "tremor of 1 nm": 1e-9}[kind] * swing * random


@pytest.mark.parametrize("kind", ["turning and travelling", "bob", "tremor of 1 mm", "tremor of 1 nm", "toe"])
def test_what_moves_without_dancing_gets_nothing(kind: str):
    motion = Motion(rigid(kind), 15.0, DANCER.skeleton)
    assert abs(soft_score(motion, REST)) < (0.06 if kind == "tremor of 1 mm" else 0.002)


def shape_score(positions: Tensor, tau: float = 0.3) -> Tensor:
    """H of one motion (T, J, 3) at 15 fps that should rest on the beats."""
    times = torch.tensor(BEATS)[None]
    masks = torch.ones_like(times), torch.ones(1, len(positions))
    soft = soft_harmony(positions[None], times, masks[0], *masks, fps=15.0, tau=tau, params=HarmonyParams.recommended())
    return soft.above_chance.sum()


def room_score(positions: Tensor, tau: float = 0.3) -> Tensor:
    """The same of the speed in the room."""
    speed = soft_speed(positions[None], 15.0) / positions.shape[1]
    room, times = SoftShape(speed, torch.tensor([len(positions) - 1]), 15.0), torch.tensor(BEATS)[None]
    return soft_place(room, times, torch.ones_like(times).bool(), REST, tau=tau).harmony_above_chance.sum()


def dance_gradient() -> float:
    """Largest entry of the gradient of a dance that is a quarter beat late."""
    late = torch.tensor(dancer(BEATS + TEMPO / 4, 15.0).positions, requires_grad=True)
    return float(torch.autograd.grad(shape_score(late), late)[0].abs().max())


@pytest.mark.parametrize("score", [shape_score, room_score])
def test_a_statue_that_turns_and_travels_wins_the_room_score_but_not_this_one(score: Callable[..., Tensor]):
    generator, frames = torch.Generator().manual_seed(0), DANCER.n_frames
    yaw = 0.02 * torch.randn(frames, generator=generator, dtype=torch.float64).cumsum(dim=0)
    path = 0.01 * torch.randn(frames, 2, generator=generator, dtype=torch.float64).cumsum(dim=0)
    yaw.requires_grad_()
    path.requires_grad_()
    adam = torch.optim.Adam([yaw, path], lr=0.02)
    largest = 0.0
    for _ in range(60):
        adam.zero_grad()
        (-score(frozen(yaw, path))).backward()
        largest = max(largest, float(yaw.grad.abs().max()), float(path.grad.abs().max()))
        adam.step()
    final = float(score(frozen(yaw, path), SOFTNESS).detach())
    if score is room_score:
        assert final > 0.8
        assert largest > dance_gradient()
    else:
        assert abs(final) < 1e-6
        assert largest < 1e-6 * dance_gradient()


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
    better = replace(late, positions=after.numpy())
    assert abs(hard_score(late, REST)) < 0.1
    assert hard_score(better, REST) > 0.8
    assert float((after - before).norm(dim=-1).mean()) < 0.08
    jerks = [float(each.diff(n=3, dim=0).square().mean().sqrt()) for each in (after, before)]
    assert jerks[0] < 1.5 * jerks[1]


@pytest.mark.parametrize(("joints", "axes"), [(4, 3), (4, 2), (2, 3)])
@pytest.mark.parametrize("pattern", [REST, WALTZ])
def test_gradient_is_that_of_finite_differences(joints: int, axes: int, pattern: BarPattern):
    rng = np.random.default_rng(5)
    walks = 0.1 * rng.normal(size=(2, 20, joints, axes)).cumsum(axis=1) + rng.normal(size=(joints, axes))
    positions = torch.tensor(walks, requires_grad=True)
    beats = torch.tensor([[0.1, 0.3, 0.52, 0.74, 0.9], [0.0, 0.2, 0.4, 0.6, 0.8]], dtype=torch.float64)
    counted = torch.tensor([[True] * 5, [True] * 4 + [False]])
    mask = torch.arange(20) < torch.tensor([[20], [16]])

    def score(places: Tensor) -> Tensor:
        shape = soft_shape_speed(places, mask, 15.0, smoothing=0.06)
        return soft_place(shape, beats, counted, pattern, tau=0.4, places=torch.tensor([0, 1])).harmony_above_chance

    assert torch.autograd.gradcheck(score, (positions,), eps=1e-7, atol=1e-5, fast_mode=True)


def odd_motion(kind: str) -> Tensor:
    """(2, 60, 5, 3) tensor of a body that is hard to differentiate."""
    body = torch.rand(5, 3, generator=torch.Generator().manual_seed(1))
    still = body.expand(2, 60, 5, 3).clone()
    phase = torch.arange(60.0) / 3
    if kind == "all joints at one point":
        return torch.zeros(2, 60, 5, 3)
    if kind == "one vertical line":
        return torch.tensor([0.0, 1.0, 0.0]) * still * (1 + 0.1 * phase.sin()[:, None, None])
    if kind == "one line":
        return still[..., :1] * torch.tensor([1.0, 2.0, 0.5]) * (1 + 0.1 * phase.sin()[:, None, None])
    if kind == "one joint moves":
        still[:, :, 2] += 0.1 * phase.sin()[:, None]
    if kind == "one jump":
        still[:, 30:] += 0.3 * torch.rand(5, 3, generator=torch.Generator().manual_seed(2))
    if kind == "two joints":
        return still[:, :, :2] * (1 + 0.1 * phase.sin()[:, None, None])
    if kind == "one joint":
        return still[:, :, :1] * (1 + 0.1 * phase.sin()[:, None, None])
    if kind == "two frames":
        return still[:, :2]
    return still


ODD = (
    "still", "all joints at one point", "one vertical line", "one line", "one joint moves", "one jump", "two joints",
    "one joint", "two frames",
)  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize("n_beats", [1, 7])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_are_finite(kind: str, n_beats: int, dtype: torch.dtype):
    positions = odd_motion(kind).to(dtype).requires_grad_()
    beats = (0.1 + 0.5 * torch.arange(7.0)).expand(2, 7)
    counted = torch.arange(7).expand(2, 7) < n_beats
    soft = soft_harmony(
        positions, beats, torch.ones_like(beats), counted, torch.ones(positions.shape[:2]),
        fps=15.0, tau=0.2, params=HarmonyParams.recommended(WALTZ),
    )  # fmt: skip
    numbers = [getattr(soft, field.name) for field in fields(SoftHarmony)]
    assert all(torch.isfinite(number).all() for number in numbers)
    sum(number.sum() for number in numbers).backward()
    assert torch.isfinite(positions.grad).all()
    if n_beats < 4 or kind in ("still", "all joints at one point", "one joint", "two frames"):
        assert float(soft.above_chance.detach().abs().max()) < 1e-6
    else:
        assert float(positions.grad.abs().max()) > (0 if kind == "one line" else 1e-6)


def test_padding_clips_and_beats_of_others_change_nothing():
    rng = np.random.default_rng(7)
    walks = torch.tensor(0.1 * rng.normal(size=(3, 90, 5, 3)).cumsum(axis=1) + rng.normal(size=(5, 3)))
    lengths, counts, first = torch.tensor([90, 70, 81]), torch.tensor([10, 8, 9]), torch.tensor([0, 2, 1])
    beats = torch.tensor(np.sort(rng.uniform(0.0, 4.5, (3, 10)), axis=1))
    mask, counted = torch.arange(90) < lengths[:, None], torch.arange(10) < counts[:, None]
    options = {"fps": 15.0, "tau": 0.2, "params": HarmonyParams.recommended(WALTZ)}
    filled = torch.where(mask[..., None, None], walks, torch.tensor(rng.normal(size=walks.shape)))
    together = soft_harmony(filled, beats, torch.ones_like(beats), counted, mask, bar_places=first, **options)
    for row in range(3):
        own = beats[row : row + 1, : counts[row]]
        alone = soft_harmony(
            walks[row : row + 1, : lengths[row]], own, torch.rand_like(own), torch.ones_like(own),
            torch.ones(1, int(lengths[row])), bar_places=first[row : row + 1], **options,
        )  # fmt: skip
        for field in fields(SoftHarmony):
            torch.testing.assert_close(getattr(together, field.name)[row], getattr(alone, field.name)[0])


def test_only_beats_in_the_span_count_and_keep_their_place_in_the_bar():
    positions = torch.tensor(DANCER.positions)[None]
    span = torch.tensor([[5.0, 18.0]])
    inside = (BEATS >= 5) & (BEATS < 18)
    kept, place = BEATS[inside], int(np.flatnonzero(inside)[0])
    scores = []
    for times, extra, first in ((BEATS, {"span": span}, 0), (kept, {}, place)):
        beats = torch.tensor(times)[None]
        soft = soft_harmony(
            positions, beats, torch.ones_like(beats), torch.ones_like(beats), torch.ones(1, DANCER.n_frames),
            fps=15.0, tau=SOFTNESS, params=HarmonyParams.recommended(WALTZ), bar_places=torch.tensor([first]), **extra,
        )  # fmt: skip
        scores.append(float(soft.above_chance))
    assert scores[0] == pytest.approx(scores[1])
    assert scores[0] == pytest.approx(hard_score(DANCER, WALTZ, place=place, beats=kept), abs=0.03)


def test_a_later_dance_is_expected_with_a_lag():
    times = torch.tensor(BEATS)[None]
    masks = torch.ones_like(times), torch.ones(1, DANCER.n_frames)
    params = replace(HarmonyParams.recommended(), lag=0.1)
    late = torch.tensor(dancer(BEATS + 0.1, 15.0).positions)[None]
    soft = soft_harmony(late, times, masks[0], *masks, fps=15.0, tau=SOFTNESS, params=params)
    assert float(soft.above_chance) == pytest.approx(soft_score(DANCER, REST), abs=0.03)


def test_sixteen_bits_are_scored_in_thirty_two():
    half = torch.tensor(DANCER.positions).bfloat16()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        score = shape_score(half, SOFTNESS)
    assert score.dtype == torch.float32
    torch.testing.assert_close(score, shape_score(half.float(), SOFTNESS))


def test_a_turn_about_the_vertical_is_taken_back():
    yaw = 0.3 * torch.randn(50, generator=torch.Generator().manual_seed(3), dtype=torch.float64).cumsum(dim=0)
    turned = frozen(yaw, torch.zeros(50, 2))
    still = unturned((turned - turned.mean(dim=1, keepdim=True))[None])[0]
    torch.testing.assert_close(still, still[:1].expand_as(still))


def test_shape_speed_is_that_of_the_hard_score():
    for motion in (DANCER, cheat("noise", 30.0)):
        hard = shape_speed(motion)
        soft = soft_shape_speed(
            torch.tensor(motion.positions)[None], torch.ones(1, motion.n_frames), motion.fps, smoothing=0.06
        )
        size = np.median(hard.extent)
        inside = slice(round(soft.rate), -round(soft.rate))  # the ends of a spline are a matter of taste
        times = np.arange(soft.speed.shape[1])[inside] / soft.rate
        expected = np.interp(times, hard.times, hard.speed / size)
        np.testing.assert_allclose(soft.speed[0].numpy()[inside], expected, atol=0.02 * expected.max())


@cases(
    "change, message",
    ({"positions": torch.zeros(2, 9)}, "the shape of the body needs joint positions"),
    ({"bar_places": torch.zeros(3)}, r"bar_places must be \(2,\), one a clip; got \(3,\)"),
    ({"params": replace(HarmonyParams.recommended(), clock=1.01)}, "only clock = 1.0 has a relaxation, got 1.01"),
)
def test_what_cannot_be_scored_is_refused_by_name(change: dict[str, object], message: str):
    options = {
        "positions": torch.rand(2, 9, 4, 3), "beats": torch.rand(2, 3), "strengths": torch.ones(2, 3),
        "beat_mask": torch.ones(2, 3), "mask": torch.ones(2, 9), "fps": 15.0, "tau": 0.1,
        "params": HarmonyParams.recommended(),
    }  # fmt: skip
    refused(message, soft_harmony, **{**options, **change})
