"""Loss terms: answers by hand, padding, gradients, refusals. The printed equations themselves: test_equations.py."""

import numpy as np
import pytest
import torch
from torch import Tensor

from harmolab.soft_score import SoftHarmony
from harmolab.systems.harmogan.losses import (
    above_chance_loss,
    adversarial_value,
    charbonnier_mse,
    discriminator_loss,
    energy_loss,
    feature_loss,
    foot_loss,
    generator_gan_loss,
    harmony_loss,
    jerk_loss,
    kl_loss,
)
from harmolab.systems.training.loop import total_loss
from tests.builders import refused


def soft(**known: list[float]) -> SoftHarmony:
    """A relaxed score with some fields given and the others 0."""
    count = len(next(iter(known.values())))
    names = SoftHarmony.__dataclass_fields__
    return SoftHarmony(**{name: torch.tensor(known.get(name, [0.0] * count)) for name in names})


def number(value: Tensor) -> float:
    return float(value.detach())


# Pose losses


def test_equal_poses_do_not_diverge():
    flat = torch.rand(2, 5, 4, 2)
    assert number(kl_loss(flat, flat, torch.ones(2, 5))) == 0


def test_kl_is_that_of_the_gaussians_drawn_out():
    # One joint, 0.07 m apart, on a fine grid: sum p log(p / q).
    grid = torch.stack(torch.meshgrid(torch.arange(-1, 1, 0.01), torch.arange(-1, 1, 0.01), indexing="ij"), dim=-1)
    here, there = torch.tensor([0.05, 0.0]), torch.tensor([0.0, 0.05])
    p, q = (torch.softmax((-(grid - mean).square().sum(dim=-1) / (2 * 0.1**2)).flatten(), 0) for mean in (here, there))
    expected = (p * (p.clamp(min=1e-30) / q.clamp(min=1e-30)).log()).sum()
    found = kl_loss(there[None, None, None], here[None, None, None], torch.ones(1, 1))
    assert number(found) == pytest.approx(number(expected), rel=1e-3)


def test_a_pose_shifted_as_a_whole_diverges():
    flat = torch.rand(1, 2, 3, 2)
    # |(0.1, 0)|^2 / (2 * 0.1^2) = 0.5 nats for every joint.
    assert number(kl_loss(flat + torch.tensor([0.1, 0.0]), flat, torch.ones(1, 2))) == pytest.approx(0.5, rel=1e-4)


@pytest.mark.parametrize("loss", ["kl", "mse", "jerk", "foot"])
def test_padded_frames_do_not_count(loss: str):
    torch.manual_seed(0)
    ours, theirs = torch.rand(2, 12, 3, 3), torch.rand(2, 12, 3, 3)
    mask = (torch.arange(12) < torch.tensor([[12], [7]])).float()
    junk = torch.where(mask[..., None, None] > 0, ours, 9 * torch.rand(2, 12, 3, 3))

    def value(motion: Tensor) -> Tensor:
        if loss == "kl":
            return kl_loss(motion[..., :2], theirs[..., :2], mask)
        if loss == "mse":
            return charbonnier_mse(motion.flatten(2), theirs.flatten(2), torch.zeros(2, 12), mask)
        if loss == "jerk":
            return jerk_loss(motion, 0.1 * theirs, mask, fps=15.0)
        return foot_loss(motion, 0.1 * theirs, mask, feet=[0, 2], fps=15.0, height=0.1)

    assert number(value(ours)) > 0
    torch.testing.assert_close(value(junk), value(ours))


def test_gradient_is_finite_where_nothing_differs():
    motion = torch.zeros(2, 6, 9, requires_grad=True)
    charbonnier_mse(motion, torch.zeros(2, 6, 9), torch.zeros(2, 6), torch.ones(2, 6)).backward()
    torch.testing.assert_close(motion.grad, torch.zeros(2, 6, 9))


def test_features_of_layers_of_different_size_weigh_alike():
    small = torch.zeros(3, 2, 5, 4), torch.ones(3, 2, 5, 4)
    large = torch.zeros(3, 8, 5, 16), torch.ones(3, 8, 5, 16)
    alone = feature_loss([small[0]], [small[1]], epsilon=0.0)
    both = feature_loss([small[0], large[0]], [small[1], large[1]], epsilon=0.0)
    assert number(alone) == number(both) == pytest.approx(5)  # five frames, 1 each


# Harmony


def test_the_root_of_the_counts_is_smooth_where_they_agree():
    visual = torch.tensor([5.0], requires_grad=True)
    harmony_loss(SoftHarmony(**{**vars(soft(n_audio=[5.0])), "n_visual": visual})).backward()
    assert number(visual.grad) == 0


def test_count_weight_weighs_the_count_alone():
    score = soft(hitting_score=[2.0], n_visual=[9.0], n_audio=[9.0 - np.sqrt(15)])
    # (15 + 1)^(1/4) - 1 = 1.
    assert number(harmony_loss(score)) == pytest.approx(-2 + 1, abs=1e-5)
    assert number(harmony_loss(score, count_weight=0.5)) == pytest.approx(-2 + 0.5, abs=1e-5)


def test_above_chance_loss_by_hand():
    # Clip 1: -0.5 + ln((7 + 1) / (3 + 1))^2; clip 2: without music beats, 0. Mean over two.
    score = soft(above_chance=[0.5, 0.0], n_visual=[7.0, 6.0], n_audio=[3.0, 0.0])
    assert number(above_chance_loss(score)) == pytest.approx((np.log(2) ** 2 - 0.5) / 2)
    assert number(above_chance_loss(score, count_weight=0.0)) == pytest.approx(-0.25)


def test_twice_and_half_the_beats_cost_the_same():
    many, few = (soft(above_chance=[0.0], n_visual=[visual], n_audio=[9.0]) for visual in (19.0, 4.0))
    assert number(above_chance_loss(many)) == pytest.approx(number(above_chance_loss(few)))


# Adversarial


def test_a_sure_critic_stays_finite():
    logits = torch.tensor([200.0, -200.0], requires_grad=True)
    loss = discriminator_loss(logits, -logits) + generator_gan_loss(logits, logits)
    loss.backward()
    assert torch.isfinite(loss)
    assert torch.isfinite(logits.grad).all()


def test_a_discriminator_that_guesses_is_worth_two_bits():
    zero = torch.zeros(4)
    assert number(discriminator_loss(zero, zero)) == pytest.approx(2 * np.log(2))
    assert number(adversarial_value(zero, zero)) == pytest.approx(-2 * np.log(2))


def test_the_generator_gains_by_being_believed():
    believed, found_out = torch.full((3,), 2.0), torch.full((3,), -2.0)
    assert number(generator_gan_loss(believed, believed)) < number(generator_gan_loss(found_out, believed))


# What the paper does not have


def test_jerk_no_greater_than_the_recorded_costs_nothing():
    torch.manual_seed(1)
    motion = torch.rand(2, 20, 3, 3)
    assert number(jerk_loss(motion, motion, torch.ones(2, 20), fps=15.0)) == pytest.approx(0, abs=1e-6)
    assert number(jerk_loss(0.5 * motion, motion, torch.ones(2, 20), fps=15.0)) == 0


def test_thrice_the_jerk_costs_two():
    torch.manual_seed(1)
    motion = torch.rand(2, 20, 3, 3)
    assert number(jerk_loss(3 * motion, motion, torch.ones(2, 20), fps=15.0)) == pytest.approx(2, rel=1e-5)


def test_jerk_of_a_cubic_by_hand():
    # x = t^3 has jerk 6 at any rate; the recording rests, which counts as 1.
    time = torch.arange(30, dtype=torch.float64) / 25
    motion = torch.zeros(1, 30, 1, 3, dtype=torch.float64)
    motion[0, :, 0, 0] = time**3
    loss = jerk_loss(motion, torch.zeros_like(motion), torch.ones(1, 30), fps=25.0)
    assert number(loss) == pytest.approx(5, rel=1e-6)


def test_too_short_a_clip_has_no_jerk():
    motion = torch.rand(1, 3, 2, 3, requires_grad=True)
    loss = jerk_loss(motion, torch.zeros(1, 3, 2, 3), torch.ones(1, 3), fps=15.0)
    loss.backward()
    assert number(loss) == 0
    assert torch.isfinite(motion.grad).all()


def test_twice_as_much_movement_and_half_as_much_cost_the_same():
    still = torch.zeros(1, 5, 2, 3)
    moving = still.clone()
    moving[0, :, :, 0] = 0.2 * torch.arange(5.0)[:, None]
    mask = torch.ones(1, 5)
    for factor in (0.5, 2.0):
        assert number(energy_loss(factor * moving, moving, mask)) == pytest.approx(np.log(2), rel=1e-4)
    assert number(energy_loss(moving, moving, mask)) == 0
    assert number(energy_loss(still, still, mask)) == 0
    cut = moving.clone()
    cut[0, 3:] = 9.0  # padding
    assert number(energy_loss(cut, moving, torch.tensor([[1.0, 1, 1, 0, 0]]))) == 0


def test_standing_still_has_a_finite_gradient():
    still = torch.zeros(1, 5, 2, 3, requires_grad=True)
    energy_loss(still, torch.rand(1, 5, 2, 3), torch.ones(1, 5)).backward()
    assert torch.isfinite(still.grad).all()


def foot_on_the_floor() -> tuple[Tensor, Tensor]:
    """A foot that stays for four frames at height 0, then is lifted; and the same with a slide of 0.1 m a frame."""
    target = torch.zeros(1, 8, 2, 3)
    target[0, 4:, 1, 1] = 0.2
    sliding = target.clone()
    sliding[0, :, 1, 0] = 0.1 * torch.arange(8)
    return sliding, target


def test_a_foot_slides_only_while_the_recorded_one_stands():
    sliding, target = foot_on_the_floor()
    # Three steps on the floor at 0.1 m * 10 Hz = 1 m/s; in the air it may move.
    assert number(foot_loss(sliding, target, torch.ones(1, 8), feet=[1], fps=10.0)) == pytest.approx(1)
    late = target.clone()
    late[0, 4:, 1, 0] = torch.arange(4.0)
    assert number(foot_loss(late, target, torch.ones(1, 8), feet=[1], fps=10.0)) == 0


def test_a_foot_may_slide_as_fast_as_the_recorded_one():
    sliding, _ = foot_on_the_floor()
    assert number(foot_loss(sliding, sliding, torch.ones(1, 8), feet=[1], fps=10.0)) == 0


def test_up_and_down_is_no_slide():
    target = torch.zeros(1, 8, 1, 3)
    bouncing = target.clone()
    bouncing[0, ::2, 0, 1] = 0.01
    assert number(foot_loss(bouncing, target, torch.ones(1, 8), feet=[0], fps=10.0)) == 0


def test_in_another_dance_a_foot_stands_where_it_is_on_the_floor_itself():
    def sliding(speed: float) -> torch.Tensor:  # metres per second, at 10 frames per second
        motion = torch.zeros(1, 8, 1, 3)
        motion[0, :, 0, 0] = 0.1 * speed * torch.arange(8.0)
        return motion

    def loss(ours: torch.Tensor, theirs: torch.Tensor) -> float:
        return number(foot_loss(ours, theirs, torch.ones(1, 8), feet=[0], fps=10.0, same_dance=False))

    assert loss(sliding(0.5), sliding(0.2)) == pytest.approx(0.3)
    assert loss(sliding(0.2), sliding(0.5)) == 0
    lifted, swung = sliding(0.2), sliding(0.5)
    lifted[0, 4:, 0, 1] = swung[0, 4:, 0, 1] = 1.0  # in the air for the second half
    swung[0, 4:, 0, 0] += torch.arange(4.0) * 2
    assert loss(swung, lifted) == pytest.approx(0.3)  # what the foot does in the air is its own business
    assert loss(sliding(0.5), lifted) == pytest.approx(0.3)  # and the recorded one's tells nothing


# Refusals


def test_terms_and_weights_must_name_each_other():
    term = torch.tensor(1.0)
    refused("no weight for the loss terms gan; weights are mse", total_loss, {"mse": term, "gan": term}, {"mse": 1.0})
    with pytest.raises(ValueError, match="no loss term for the weights harmony; terms are mse"):
        total_loss({"mse": term}, {"mse": 1.0, "harmony": 1.0})
    refused("there is no loss term to add up", total_loss, {}, {})
    assert number(total_loss({"mse": term}, {"mse": 2.0, "harmony": 0.0})) == 2


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"one shape \(N, T, ...\), got \(1, 4, 3, 2\) and \(1, 5, 3, 2\)"):
        kl_loss(torch.rand(1, 4, 3, 2), torch.rand(1, 5, 3, 2), torch.ones(1, 4))
    with pytest.raises(ValueError, match=r"mask must be \(1, 4\), one entry per frame; got \(1, 5\)"):
        charbonnier_mse(torch.rand(1, 4, 3), torch.rand(1, 4, 3), torch.zeros(1, 4), torch.ones(1, 5))
    with pytest.raises(ValueError, match="spread must be positive, got 0"):
        kl_loss(torch.rand(1, 4, 3, 2), torch.rand(1, 4, 3, 2), torch.ones(1, 4), spread=0)
    refused("feature maps must be two equal lists of layers", feature_loss, [torch.rand(1, 2, 3)], [])
    with pytest.raises(ValueError, match="foot_loss needs the indices of the feet, got none"):
        foot_loss(torch.rand(1, 4, 3, 3), torch.rand(1, 4, 3, 3), torch.ones(1, 4), feet=[], fps=15.0)
