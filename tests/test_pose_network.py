"""models.pose_features: features that see what people see, and a network that learns them."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.layers import parameter_count
from harmolab.systems.training.pose_network import EMBEDDING, PoseNet, resample, train_pose_net
from harmolab.systems.training.units import UnitSet
from tests.builders import dance_unit, refused

ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))


@pytest.fixture(autouse=True)
def seeded() -> None:
    """The same numbers whichever tests run."""
    torch.manual_seed(0)


def wave(hertz: float, phase: float, frames: int = 40, fps: float = 15.0) -> NDArray[np.float32]:
    """Motion code of an arm whose hand swings sideways `hertz` times a second."""
    code = np.zeros((frames, 12), np.float32)
    code[:, 6] = 0.3 * np.sin(2 * np.pi * (hertz * np.arange(frames) / fps + phase))
    code[:, 7] = 1.0
    return code


def waving(count: int, name: str) -> UnitSet:
    """Units of two motion groups in turn: slow and fast swinging, at random phases."""
    rng = np.random.default_rng(len(name))
    kinds = [(("slow", 0.7), ("fast", 2.5))[number % 2] for number in range(count)]
    units = [
        dance_unit(f"{name}{number}", wave(hertz, rng.uniform()), 10, groups=frozenset({kind}))
        for number, (kind, hertz) in enumerate(kinds)
    ]
    return UnitSet(tuple(units), ARM, np.array([0.0, 0.3, 0.25]), FeatureParams(n_mfcc=1))


Trained = tuple[PoseNet, list[dict[str, float]]]


@pytest.fixture(scope="module")
def trained() -> Trained:
    rows: list[dict[str, float]] = []
    return train_pose_net(waving(48, "train"), waving(12, "other"), seed=3, epochs=12, progress=rows.append), rows


def embedded(net: PoseNet, codes: list[NDArray[np.float32]]) -> torch.Tensor:
    motion = torch.from_numpy(np.stack(codes))
    with torch.no_grad():
        return net.embed(motion, torch.ones(motion.shape[:2]))


def test_resampling_takes_the_real_frames_alone_and_interpolates():
    values, mask = torch.arange(9.0).reshape(1, 9, 1), torch.ones(1, 9)
    mask[0, 4:] = 0
    torch.testing.assert_close(resample(values, mask, 7)[0, :, 0], torch.tensor([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]))


def test_the_picture_holds_positions_and_velocities_of_joints_and_path():
    net = PoseNet(Skeleton(("hip",), (-1,)), fps=10.0)
    motion = torch.zeros(1, 32, 6)
    motion[0, :, 1] = torch.arange(32) * 0.1  # rises at 1 m/s
    motion[0, :, 5] = 3.0  # yaw rate
    picture = net.picture(motion, torch.ones(1, 32))
    assert picture.shape == (1, 6, 32, 2)
    torch.testing.assert_close(picture[0, 2, :, 0], motion[0, :, 1])  # colour "y"
    torch.testing.assert_close(picture[0, 3, 1:, 0], torch.full((31,), 0.2))  # its velocity, times 0.2 s
    torch.testing.assert_close(picture[0, 4, :, 1], torch.full((32,), 3.0))  # last column: the path


def test_padding_is_not_seen():
    net, motion, mask = PoseNet(ARM, fps=15.0), torch.randn(2, 20, 12), torch.ones(2, 20)
    padded = torch.cat([motion, torch.randn(2, 6, 12)], dim=1)
    longer = torch.cat([mask, torch.zeros(2, 6)], dim=1)
    torch.testing.assert_close(net.embed(padded, longer), net.embed(motion, mask))
    torch.testing.assert_close(net.embed(motion, mask)[:1], net.embed(motion[:1], mask[:1]))  # nor is the batch


def test_the_network_is_small_and_its_maps_halve_block_by_block():
    net = PoseNet(TANG_23, fps=15.0)
    assert parameter_count(net) < 500_000
    maps = net.features(torch.randn(2, 40, 72), torch.ones(2, 40))
    assert [tuple(layer.shape) for layer in maps] == [(2, 16, 32, 24), (2, 32, 16, 12), (2, 64, 8, 6)]
    assert net.embed(torch.randn(2, 40, 72), torch.ones(2, 40)).shape == (2, EMBEDDING)


@pytest.mark.parametrize("joints", [1, 2, 24])
def test_any_skeleton_will_do(joints: int):
    net = PoseNet(Skeleton.unnamed(joints), fps=60.0)
    assert net.embed(torch.randn(1, 3, 3 * joints + 3), torch.ones(1, 3)).shape == (1, EMBEDDING)
    refused("fps must be positive and finite, got 0", PoseNet, net.skeleton, fps=0)


def test_features_pull_on_every_frame():
    net, motion = PoseNet(ARM, fps=15.0), torch.randn(1, 32, 12, requires_grad=True)
    (gradient,) = torch.autograd.grad(sum(layer.sum() for layer in net.features(motion, torch.ones(1, 32))), motion)
    assert (gradient.abs().sum(dim=2) > 0).all()


@pytest.mark.slow
def test_training_gets_better_on_units_it_was_not_trained_on(trained: Trained):
    rows = trained[1]
    assert [row["epoch"] for row in rows] == list(range(12))
    assert rows[-1]["train"] < 0.7 * rows[0]["train"]
    assert min(row["validation"] for row in rows) < 0.95 * rows[0]["validation"]


def test_a_trained_network_tells_motion_groups_apart(trained: Trained):
    phases = np.linspace(0, 1, 8, endpoint=False) + 0.03
    slow, fast = (embedded(trained[0], [wave(hertz, phase) for phase in phases]) for hertz in (0.7, 2.5))
    centres = torch.stack([slow.mean(dim=0), fast.mean(dim=0)])
    assert torch.cdist(slow, centres).argmin(dim=1).tolist() == [0] * 8
    assert torch.cdist(fast, centres).argmin(dim=1).tolist() == [1] * 8


def test_more_shaking_is_further_away(trained: Trained, rng: np.random.Generator):
    codes = [wave(0.7, phase) for phase in np.linspace(0, 1, 8)]
    intact = embedded(trained[0], codes)
    shaking = rng.normal(size=(8, 40, 12)).astype(np.float32)
    shaking[..., 9:] = 0
    noisy = [embedded(trained[0], list(np.stack(codes) + size * shaking)) for size in (0.01, 0.05, 0.2)]
    distances = [float((each - intact).norm(dim=1).mean()) for each in noisy]
    assert distances == sorted(distances) and distances[2] > 4 * distances[0]


def test_the_seed_decides_and_the_world_is_left_alone():
    torch.manual_seed(5)
    before = torch.get_rng_state()
    nets = [train_pose_net(waving(8, "a"), waving(4, "b"), seed=seed, epochs=1) for seed in (1, 1, 2)]
    assert torch.equal(torch.get_rng_state(), before)
    codes = [wave(1.0, 0.0)]
    assert torch.equal(embedded(nets[0], codes), embedded(nets[1], codes))
    assert not torch.equal(embedded(nets[0], codes), embedded(nets[2], codes))


def test_a_trained_network_does_not_train_on(trained: Trained):
    assert not trained[0].training and trained[0].motion_scale.mean[7] == pytest.approx(1.0)


@pytest.mark.parametrize(("sizes", "epochs"), [((0, 4), 1), ((4, 0), 1), ((4, 4), 0)])
def test_without_units_or_epochs_there_is_nothing_to_learn(sizes: tuple[int, int], epochs: int):
    message = f"got {sizes[0]} units, {sizes[1]} validation units and {epochs} epochs"
    refused(message, train_pose_net, waving(sizes[0], "a"), waving(sizes[1], "b"), epochs=epochs)
