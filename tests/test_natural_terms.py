"""Path, spread and ankles: answers by hand, what does not count, gradients of a body at rest."""

import numpy as np
import pytest
import torch
from torch import Tensor

from harmolab.systems.harmogan.losses import ankle_loss, mean_spread, net_turning, path_loss, spread_loss

FPS = 10.0


def number(value: Tensor) -> float:
    return float(value.detach())


def ones(motion: Tensor) -> Tensor:
    return torch.ones(motion.shape[:2])


def dance(seed: int = 0) -> Tensor:
    """Three clips of 40 frames of four joints that wander about places 0.3 m apart."""
    torch.manual_seed(seed)
    return 0.3 * torch.randn(3, 1, 4, 3) + 0.05 * torch.randn(3, 40, 4, 3).cumsum(dim=1)


# Path


def going(side: float, forward: float, yaw: float) -> Tensor:
    """Two clips of six frames that go on and on at these rates."""
    return torch.tensor([side, forward, yaw]).expand(2, 6, 3).clone()


def test_the_recorded_path_and_less_of_it_cost_nothing():
    path = torch.randn(2, 30, 3)
    assert number(path_loss(path, path, ones(path))) == 0
    assert number(path_loss(0.5 * path, path, ones(path))) == 0


def test_turning_five_times_as_fast_costs_by_hand():
    # Rates of .05 count beside the true ones: sqrt((5^2 + .05^2) / (1^2 + .05^2)), of frames and of clips.
    slow, fast = going(0.2, 0.0, 1.0), going(0.2, 0.0, 5.0)
    expected = 2 * np.log(np.sqrt((25 + 0.05**2) / (1 + 0.05**2)))
    assert number(path_loss(fast, slow, ones(slow))) == pytest.approx(expected, rel=1e-5)


def test_the_further_a_dancer_turns_beyond_the_recorded_the_more_it_costs():
    still = going(0.0, 0.0, 0.0)
    costs = [number(path_loss(going(0.0, 0.0, yaw), still, ones(still))) for yaw in (0.1, 0.5, 2.0, 8.0)]
    assert costs == sorted(costs) and costs[0] > 0


def test_to_sway_costs_less_than_to_circle():
    recorded = going(0.0, 0.0, 0.1)
    circling, swaying = going(0.0, 0.0, 2.0), going(0.0, 0.0, 2.0)
    swaying[:, ::2] *= -1
    assert number(path_loss(swaying, recorded, ones(recorded))) < number(path_loss(circling, recorded, ones(recorded)))


# Spread


def test_the_recorded_batch_itself_has_the_right_spread():
    motion = dance()
    assert number(spread_loss(motion, motion, ones(motion), fps=FPS, ankles=(0, 1))) == 0


def test_a_statue_on_the_mean_pose_lacks_time_and_speed():
    motion = dance()
    statue = motion.mean(dim=1, keepdim=True).expand_as(motion)
    variance = (motion - statue).square().sum(dim=-1).mean(dim=(0, 1))
    speed = (motion.diff(dim=1) * FPS).norm(dim=-1).mean(dim=(0, 1))
    expected = torch.log(variance / 1e-4 + 1).mean() + 2 * torch.log(speed / 0.01 + 1).mean()
    assert number(spread_loss(statue, motion, ones(motion), fps=FPS)) == pytest.approx(number(expected), rel=1e-4)


def test_twice_the_spread_costs_as_much_as_half_of_it():
    # All of it a movement in time about one place: 4 times the variance, twice the speed; 1 cm counts beside them.
    motion = 100 * (dance() - dance().mean(dim=1, keepdim=True))
    expected = np.log(4) + 2 * np.log(2)
    for factor in (0.5, 2.0):
        cost = spread_loss(factor * motion, motion, ones(motion), fps=FPS)
        assert number(cost) == pytest.approx(expected, rel=1e-3)


def test_clips_that_are_all_alike_cost_what_lies_between_the_recorded():
    motion = dance()
    places = motion.mean(dim=1, keepdim=True)
    alike = motion - places + places.mean(dim=0, keepdim=True)
    expected = torch.log((places - places.mean(dim=0)).square().sum(dim=-1).mean(dim=(0, 1)) / 1e-4 + 1).mean()
    assert number(spread_loss(alike, motion, ones(motion), fps=FPS)) == pytest.approx(number(expected), rel=1e-4)


def test_one_standard_deviation_away_costs_one():
    motion = 100 * dance()
    deviation = motion.flatten(0, 1).std(dim=0, correction=0)
    assert number(spread_loss(motion + deviation, motion, ones(motion), fps=FPS)) == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize("loss", ["path", "spread"])
def test_what_does_not_count_does_not_matter(loss: str):
    ours, theirs = dance(1), dance(2)
    counted = torch.ones(3, 40)
    counted[0, 30:] = counted[1, :10] = 0
    junk = torch.where(counted[..., None, None] > 0, ours, 9 * torch.rand_like(ours))

    def value(motion: Tensor) -> Tensor:
        if loss == "path":
            return path_loss(motion[:, :, 0], 0.1 * theirs[:, :, 0], counted)
        return spread_loss(motion, theirs, counted, fps=FPS, ankles=(2, 3))

    assert number(value(ours)) > 0
    torch.testing.assert_close(value(junk), value(ours))


def test_mean_spread_and_net_turning_by_hand():
    motion = torch.zeros(2, 5, 1, 3)
    motion[0, :, 0, 0] = torch.tensor([-1.0, 1.0, -1.0, 1.0, 9.0])
    counted = torch.tensor([[1.0, 1, 1, 1, 0], [1, 1, 1, 1, 0]])
    assert number(mean_spread(motion, counted)) == pytest.approx(0.5)  # one clip 1 m about its mean, one at rest
    assert number(net_turning(motion[:, :, 0, 0], counted)) == 0  # there and back
    assert number(net_turning(motion[:, :, 0, 0].abs(), counted)) == pytest.approx(0.5)


# Ankles


def standing(left: tuple[float, float], right: tuple[float, float]) -> Tensor:
    """A clip of five frames with the ankles at these places (x, z) on the floor."""
    places = torch.tensor([[left[0], 0.1, left[1]], [right[0], 0.1, right[1]]])
    return places.expand(1, 5, 2, 3).clone()


def test_ankles_by_hand():
    recorded = standing((0.2, 0.0), (-0.2, 0.0))
    closer = standing((0.1, 0.0), (-0.1, 0.0))  # .2 m nearer to each other, .2 m less to the side
    crossed = standing((-0.2, 0.0), (0.2, 0.0))  # as far apart, .8 m on the other side, .4 m crossed
    assert number(ankle_loss(recorded, recorded, ones(recorded), (0, 1))) == 0
    assert number(ankle_loss(closer, recorded, ones(closer), (0, 1))) == pytest.approx((0.2 + 0.2) / 0.1, rel=1e-5)
    assert number(ankle_loss(crossed, recorded, ones(crossed), (0, 1))) == pytest.approx((0.8 + 4) / 0.1, rel=1e-5)
    # Ankles that cross less than the recorded ones: only their side is other.
    assert number(ankle_loss(recorded, crossed, ones(crossed), (0, 1))) == pytest.approx(0.8 / 0.1, rel=1e-5)


def test_feet_that_never_step_cost_the_steps():
    recorded = standing((0.2, 0.0), (-0.2, 0.0))
    recorded[:, :, 0, 0] += 0.1 * torch.tensor([-1.0, 1.0, 0.0, 1.0, -1.0])
    still = standing((0.2, 0.0), (-0.2, 0.0))
    deviation = 0.1 * np.sqrt(0.8)
    expected = np.log(np.sqrt((deviation**2 + 0.01**2) / 0.01**2))
    assert number(ankle_loss(still, recorded, ones(still), (0, 1))) == pytest.approx(expected, rel=1e-4)


# At rest


def test_gradients_are_finite_where_nothing_moves():
    still = torch.zeros(2, 6, 2, 3, requires_grad=True)
    path = torch.zeros(2, 6, 3, requires_grad=True)
    for recorded in (torch.zeros(2, 6, 2, 3), torch.rand(2, 6, 2, 3)):
        spread_loss(still, recorded, ones(recorded), fps=FPS, ankles=(0, 1)).backward()
        path_loss(path, recorded[:, :, 0], ones(recorded)).backward()
    assert torch.isfinite(still.grad).all()
    assert torch.isfinite(path.grad).all()


def test_nothing_counted_costs_nothing():
    motion = dance().requires_grad_()
    loss = spread_loss(motion, dance(1), torch.zeros(3, 40), fps=FPS) + path_loss(
        motion[:, :, 0], dance(1)[:, :, 0], torch.zeros(3, 40)
    )
    loss.backward()
    assert number(loss) == 0
    assert torch.isfinite(motion.grad).all()
