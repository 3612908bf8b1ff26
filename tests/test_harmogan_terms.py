"""Loss terms: answers by hand, padding, gradients, refusals. The printed equations themselves: test_equations.py."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from harmolab.soft_score import SoftHarmony
from harmolab.systems.harmogan import losses
from harmolab.systems.training.loop import total_loss
from tests.builders import cases, refused

FPS = 10.0


def soft(**known: list[float]) -> SoftHarmony:
    """A relaxed score with some fields given and the others 0."""
    count = len(next(iter(known.values())))
    names = SoftHarmony.__dataclass_fields__
    return SoftHarmony(**{name: torch.tensor(known.get(name, [0.0] * count)) for name in names})


def number(value: Tensor) -> float:
    return float(value.detach())


def ones(motion: Tensor) -> Tensor:
    return torch.ones(motion.shape[:2])


# Pose losses


def test_kl_is_that_of_the_gaussians_drawn_out():
    # One joint, 0.07 m apart, on a fine grid: sum p log(p / q).
    grid = torch.stack(torch.meshgrid(torch.arange(-1, 1, 0.01), torch.arange(-1, 1, 0.01), indexing="ij"), dim=-1)
    here, there = torch.tensor([0.05, 0.0]), torch.tensor([0.0, 0.05])
    p, q = (torch.softmax((-(grid - mean).square().sum(dim=-1) / (2 * 0.1**2)).flatten(), 0) for mean in (here, there))
    expected = (p * (p.clamp(min=1e-30) / q.clamp(min=1e-30)).log()).sum()
    found = losses.kl_loss(there[None, None, None], here[None, None, None], torch.ones(1, 1))
    assert number(found) == pytest.approx(number(expected), rel=1e-3)


def test_gradient_is_finite_where_nothing_differs():
    motion = torch.zeros(2, 6, 9, requires_grad=True)
    losses.charbonnier_mse(motion, torch.zeros(2, 6, 9), torch.zeros(2, 6), torch.ones(2, 6)).backward()
    torch.testing.assert_close(motion.grad, torch.zeros(2, 6, 9))


def test_features_of_layers_of_different_size_weigh_alike():
    small = torch.zeros(3, 2, 5, 4), torch.ones(3, 2, 5, 4)
    large = torch.zeros(3, 8, 5, 16), torch.ones(3, 8, 5, 16)
    alone = losses.feature_loss([small[0]], [small[1]], epsilon=0.0)
    both = losses.feature_loss([small[0], large[0]], [small[1], large[1]], epsilon=0.0)
    assert number(alone) == number(both) == pytest.approx(5)  # five frames, 1 each


# Harmony


def test_the_root_of_the_counts_is_smooth_where_they_agree():
    visual = torch.tensor([5.0], requires_grad=True)
    losses.harmony_loss(SoftHarmony(**{**vars(soft(n_audio=[5.0])), "n_visual": visual})).backward()
    assert number(visual.grad) == 0


def test_count_weight_weighs_the_count_alone():
    score = soft(hitting_score=[2.0], n_visual=[9.0], n_audio=[9.0 - np.sqrt(15)])
    # (15 + 1)^(1/4) - 1 = 1.
    assert number(losses.harmony_loss(score)) == pytest.approx(-2 + 1, abs=1e-5)
    assert number(losses.harmony_loss(score, count_weight=0.5)) == pytest.approx(-2 + 0.5, abs=1e-5)


def test_above_chance_loss_by_hand():
    # Clip 1: -0.5 + ln((7 + 1) / (3 + 1))^2; clip 2: without music beats, 0. Mean over two.
    score = soft(above_chance=[0.5, 0.0], n_visual=[7.0, 6.0], n_audio=[3.0, 0.0])
    assert number(losses.above_chance_loss(score)) == pytest.approx((np.log(2) ** 2 - 0.5) / 2)
    assert number(losses.above_chance_loss(score, count_weight=0.0)) == pytest.approx(-0.25)


def test_twice_and_half_the_beats_cost_the_same():
    many, few = (soft(above_chance=[0.0], n_visual=[visual], n_audio=[9.0]) for visual in (19.0, 4.0))
    assert number(losses.above_chance_loss(many)) == pytest.approx(number(losses.above_chance_loss(few)))


# Adversarial


def test_a_sure_critic_stays_finite():
    logits = torch.tensor([200.0, -200.0], requires_grad=True)
    loss = losses.discriminator_loss(logits, -logits) + losses.generator_gan_loss(logits, logits)
    loss.backward()
    assert torch.isfinite(loss) and torch.isfinite(logits.grad).all()


# What the paper does not have


@cases("factor, cost", (0.5, 0), (1, 0), (3, 2))
def test_only_more_jerk_than_the_recorded_costs(factor: float, cost: float):
    torch.manual_seed(1)
    motion = torch.rand(2, 20, 3, 3)
    loss = losses.jerk_loss(factor * motion, motion, torch.ones(2, 20), fps=15.0)
    assert number(loss) == pytest.approx(cost, rel=1e-5, abs=1e-6)


def test_jerk_of_a_cubic_by_hand():
    # x = t^3 has jerk 6 at any rate; the recording rests, which counts as 1.
    time = torch.arange(30, dtype=torch.float64) / 25
    motion = torch.zeros(1, 30, 1, 3, dtype=torch.float64)
    motion[0, :, 0, 0] = time**3
    loss = losses.jerk_loss(motion, torch.zeros_like(motion), torch.ones(1, 30), fps=25.0)
    assert number(loss) == pytest.approx(5, rel=1e-6)


def test_too_short_a_clip_has_no_jerk():
    motion = torch.rand(1, 3, 2, 3, requires_grad=True)
    loss = losses.jerk_loss(motion, torch.zeros(1, 3, 2, 3), torch.ones(1, 3), fps=15.0)
    loss.backward()
    assert number(loss) == 0
    assert torch.isfinite(motion.grad).all()


def test_twice_as_much_movement_and_half_as_much_cost_the_same():
    still = torch.zeros(1, 5, 2, 3, requires_grad=True)
    moving = torch.zeros(1, 5, 2, 3)
    moving[0, :, :, 0] = 0.2 * torch.arange(5.0)[:, None]
    mask = torch.ones(1, 5)
    for factor in (0.5, 2.0):
        assert number(losses.energy_loss(factor * moving, moving, mask)) == pytest.approx(np.log(2), rel=1e-4)
    assert number(losses.energy_loss(moving, moving, mask)) == number(losses.energy_loss(still, still, mask)) == 0
    losses.energy_loss(still, moving, mask).backward()
    assert torch.isfinite(still.grad).all()
    cut = moving.clone()
    cut[0, 3:] = 9.0  # padding
    assert number(losses.energy_loss(cut, moving, torch.tensor([[1.0, 1, 1, 0, 0]]))) == 0


def test_a_foot_slides_only_while_the_recorded_one_stands_and_may_slide_as_fast():
    # A foot that stays for four frames at height 0, then is lifted; and the same with a slide of 0.1 m a frame.
    target = torch.zeros(1, 8, 2, 3)
    target[0, 4:, 1, 1] = 0.2
    sliding = target.clone()
    sliding[0, :, 1, 0] = 0.1 * torch.arange(8)
    # Three steps on the floor at 0.1 m * 10 Hz = 1 m/s; in the air it may move.
    assert number(losses.foot_loss(sliding, target, torch.ones(1, 8), feet=[1], fps=10.0)) == pytest.approx(1)
    late = target.clone()
    late[0, 4:, 1, 0] = torch.arange(4.0)
    assert number(losses.foot_loss(late, target, torch.ones(1, 8), feet=[1], fps=10.0)) == 0
    assert number(losses.foot_loss(sliding, sliding, torch.ones(1, 8), feet=[1], fps=10.0)) == 0


def test_up_and_down_is_no_slide():
    target = torch.zeros(1, 8, 1, 3)
    bouncing = target.clone()
    bouncing[0, ::2, 0, 1] = 0.01
    assert number(losses.foot_loss(bouncing, target, torch.ones(1, 8), feet=[0], fps=10.0)) == 0


# Refusals


def test_terms_and_weights_must_name_each_other():
    term = torch.tensor(1.0)
    refused("no weight for the loss terms gan; weights are mse", total_loss, {"mse": term, "gan": term}, {"mse": 1.0})
    message = "no loss term for the weights harmony; terms are mse"
    refused(message, total_loss, {"mse": term}, {"mse": 1.0, "harmony": 1.0})
    refused("there is no loss term to add up", total_loss, {}, {})
    assert number(total_loss({"mse": term}, {"mse": 2.0, "harmony": 0.0})) == 2


def test_shapes_that_do_not_fit_are_refused():
    four, five, one = torch.rand(1, 4, 3, 3), torch.rand(1, 5, 3, 3), torch.ones(1, 4)
    refused(r"one shape \(N, T, ...\), got \(1, 4, 3, 3\) and \(1, 5, 3, 3\)", losses.kl_loss, four, five, one)
    message = r"mask must be \(1, 4\), one entry per frame; got \(1, 5\)"
    refused(message, losses.charbonnier_mse, four, four, one, torch.ones(1, 5))
    refused("feature maps must be two equal lists of layers", losses.feature_loss, [torch.rand(1, 2, 3)], [])
    refused("foot_loss needs the indices of the feet, got none", losses.foot_loss, four, four, one, feet=[], fps=15.0)


# What does not count


def dance(seed: int = 0) -> Tensor:
    """Three clips of 40 frames of four joints that wander about places 0.3 m apart."""
    torch.manual_seed(seed)
    return 0.3 * torch.randn(3, 1, 4, 3) + 0.05 * torch.randn(3, 40, 4, 3).cumsum(dim=1)


@cases(
    "loss",
    lambda ours, theirs, mask: losses.kl_loss(ours[..., :2], theirs[..., :2], mask),
    lambda ours, theirs, mask: losses.charbonnier_mse(ours.flatten(2), theirs.flatten(2), torch.zeros(3, 40), mask),
    lambda ours, theirs, mask: losses.jerk_loss(ours, 0.1 * theirs, mask, fps=FPS),
    lambda ours, theirs, mask: losses.foot_loss(ours, 0 * theirs, mask, feet=[0, 2], fps=FPS),
    lambda ours, theirs, mask: losses.moved_loss(ours, theirs, mask),
    ids=["kl", "mse", "jerk", "foot", "moved"],
)
def test_what_does_not_count_does_not_matter(loss: Callable[[Tensor, Tensor, Tensor], Tensor]):
    ours, theirs = dance(1), dance(2)
    counted = torch.ones(3, 40)
    counted[0, 30:] = counted[1, :10] = 0
    junk = torch.where(counted[..., None, None] > 0, ours, 9 * torch.rand_like(ours))
    assert number(loss(ours, theirs, counted)) > 0
    torch.testing.assert_close(loss(junk, theirs, counted), loss(ours, theirs, counted))


def test_spread_and_turning_by_hand():
    motion = torch.zeros(2, 5, 1, 3)
    motion[0, :, 0, 0] = torch.tensor([-1.0, 1.0, -1.0, 1.0, 9.0])
    counted = torch.tensor([[1.0, 1, 1, 1, 0], [1, 1, 1, 1, 0]])
    code = torch.cat([motion.flatten(2), torch.zeros(2, 5, 2), motion[:, :, 0, :1]], dim=-1)
    distance, turning = losses.spread_and_turning(code, counted)
    assert number(distance) == pytest.approx(0.5)  # one clip 1 m about its mean, one at rest
    assert number(turning) == 0  # there and back
    assert number(losses.spread_and_turning(code.abs(), counted)[1]) == pytest.approx(0.5)


def test_four_centimetres_from_the_sketch_cost_one():
    motion = dance()
    moved = motion + 0.04 * torch.tensor([0.0, 0.6, 0.8])
    assert number(losses.moved_loss(moved, motion, ones(motion))) == pytest.approx(1, rel=1e-5)
    assert number(losses.moved_loss(motion, motion, ones(motion))) == 0
