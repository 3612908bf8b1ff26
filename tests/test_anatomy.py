"""models.anatomy: wiring and shapes are found by running a network, so small networks with known wiring are run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from harmolab.data.units import Batch
from harmolab.models.anatomy import Part, anatomy, parts_of
from harmolab.models.harmogan import Generator
from harmolab.params import ModelParams
from harmolab.types import Skeleton

TINY = ModelParams(hidden=16, layers=1, pose_features=8, discriminator=4)
ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))  # C = 3 * 3 + 3 = 12
N, T, F, C = 4, 30, 5, 12


@pytest.fixture(autouse=True)
def seeded() -> None:
    torch.manual_seed(0)


class Made(NamedTuple):
    whole: Tensor
    half: Tensor


class Wired(nn.Module):
    """Sum of two branches, one of which is skipped to the end; `idle` is never used, `plain` learns nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.left, self.right = nn.Linear(2, 3), nn.GRU(3, 3, batch_first=True)
        self.plain = nn.ReLU()
        self.steps = nn.ModuleList([nn.Linear(5, 4)])
        self.idle = nn.Linear(1, 1)

    def forward(self, first: Tensor, second: Tensor) -> Made:
        once, _ = self.right(self.plain(self.left(first)))
        joined = self.steps[0](torch.cat([once, second], dim=-1))
        both = torch.cat([joined, second], dim=-1)
        return Made(both, both[..., :4])


def wired() -> dict[str, Part]:
    return {part.name: part for part in parts_of(Wired(), first=torch.ones(7, 6, 2), second=torch.ones(7, 6, 2))}


def test_parts_come_in_the_order_in_which_they_run_and_lists_are_opened():
    assert list(wired()) == ["first", "second", "left", "right", "steps.0", "whole", "half"]


def test_arrows_are_the_wiring_and_nothing_else():
    found = {name: part.sources for name, part in wired().items()}
    assert found == {
        "first": (),
        "second": (),
        "left": ("first",),
        "right": ("left",),
        "steps.0": ("second", "right"),
        "whole": ("second", "steps.0"),
        "half": ("steps.0",),  # `second` is in the tensor that it is cut from, and not in what is cut out
    }


def test_shapes_kinds_and_parameters_are_those_of_the_modules():
    parts = wired()
    assert (parts["left"].input, parts["left"].output) == ((7, 6, 2), (7, 6, 3))
    assert (parts["first"].input, parts["first"].output) == ((), (7, 6, 2))
    assert (parts["half"].input, parts["half"].output) == ((7, 6, 4), ())
    assert parts["right"].kind == "GRU"
    assert parts["left"].parameters == 2 * 3 + 3
    assert parts["right"].parameters == 3 * (3 * 3 + 3 * 3 + 3 + 3)


def test_layers_of_a_part_are_named_with_their_number():
    network = nn.Sequential(nn.Sequential(nn.Linear(2, 2), nn.ReLU(), nn.Linear(2, 2), nn.LayerNorm(2)))
    assert [part.kind for part in parts_of(network, input=torch.ones(1, 2))] == [
        "input",
        "2 Linear + LayerNorm",
        "output",
    ]


def test_looking_leaves_no_hook_and_no_gradient_behind():
    network = Wired()
    with torch.no_grad():
        parts_of(network, first=torch.ones(1, 2, 2), second=torch.ones(1, 2, 2))
    assert not any(module._forward_hooks for module in network.modules())
    assert all(weights.grad is None for weights in network.parameters())


class Twice(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(2, 2)

    def forward(self, values: Tensor) -> Tensor:
        return self.layer(self.layer(values))


def test_part_that_runs_twice_is_refused_and_leaves_no_hook():
    network = Twice()
    with pytest.raises(ValueError, match="layer runs more than once"):
        parts_of(network, values=torch.ones(1, 2))
    assert not network.layer._forward_hooks


@pytest.fixture
def networks() -> dict[str, tuple[Part, ...]]:
    rng = np.random.default_rng(0)
    audio, motion, initial = (rng.normal(size=(N, T, width)).astype(np.float32) for width in (F, C, C))
    index, mask = np.zeros((N, T), np.float32), np.ones((N, T), np.float32)
    beats = np.zeros((N, 1), np.float32)
    generator = Generator(TINY, F, ARM, torch.tensor([0.0, 0.3, 0.25]), fps=15.0)
    return anatomy(generator, Batch(audio, motion, initial, index, mask, beats, beats, beats))


def test_generator_is_wired_as_the_paper_says(networks: dict[str, tuple[Part, ...]]):
    """Sec. 4.2: audio encoder, initial pose features joined to it, decoder, skips to every head, 2-D before depth."""
    found = {part.name: set(part.sources) for part in networks["generator"]}
    known = {"encoder", "seeing"}
    assert found["encoder"] == {"hearing"}
    assert found["decoder"] == known
    assert found["flat_head"] == found["path_head"] == known | {"decoder"}
    assert found["depth_head"] == known | {"decoder", "flat_head"}
    assert found["flat"] == {"initial", "flat_head"}
    assert found["motion"] == {"initial", "flat_head", "depth_head", "path_head"}


def test_joined_features_are_as_wide_as_their_sources_together(networks: dict[str, tuple[Part, ...]]):
    parts = {part.name: part for part in networks["generator"]}
    for name in ("decoder", "flat_head", "depth_head", "path_head"):
        assert parts[name].input[-1] == sum(parts[source].output[-1] for source in parts[name].sources)


def test_no_parameter_of_a_network_is_left_out(networks: dict[str, tuple[Part, ...]]):
    generator = Generator(TINY, F, ARM, torch.tensor([0.0, 0.3, 0.25]), fps=15.0)
    assert sum(part.parameters for part in networks["generator"]) == generator.parameter_count()


def test_cross_domain_discriminator_has_two_branches_that_meet(networks: dict[str, tuple[Part, ...]]):
    found = {part.name: part.sources for part in networks["cross_domain"]}
    assert (found["hearing"], found["seeing"]) == (("audio",), ("motion",))
    assert set(found["both"]) == {"hearing", "seeing"}
    assert "mask" not in found


def test_spatial_temporal_discriminator_takes_in_five_segments_one_after_the_other(
    networks: dict[str, tuple[Part, ...]],
):
    parts = {part.name: part for part in networks["spatial_temporal"]}
    assert parts["seeing"].input[0] == 5 * N
    assert parts["joining.0"].sources == ("seeing",)
    for step in (1, 2, 3):
        assert parts[f"joining.{step}"].sources == ("seeing", f"joining.{step - 1}")


def test_looking_does_not_change_the_random_numbers_that_follow():
    torch.manual_seed(3)
    expected = torch.rand(1)
    values = np.ones((N, T, F), np.float32), np.ones((N, T, C), np.float32), np.ones((N, T), np.float32)
    generator = Generator(TINY, F, ARM, torch.tensor([0.0, 0.3, 0.25]), fps=15.0)
    torch.manual_seed(3)
    audio, motion, ones = values
    anatomy(generator, Batch(audio, motion, motion, ones, ones, ones, ones, ones))
    assert torch.equal(torch.rand(1), expected)
