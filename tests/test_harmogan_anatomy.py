"""models.anatomy: sizes and shapes are measured by running a network; the generator is wired as the paper says."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from harmolab.body.skeletons import Skeleton
from harmolab.systems.harmogan.networks import Generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.units import Batch
from study.shapes import Part, anatomy, layers_of, parts_of

TINY = ModelParams(hidden=16, layers=1, pose_features=8, discriminator=4)
ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))  # C = 3 * 3 + 3 = 12
N, T, F, C = 4, 30, 5, 12


@pytest.fixture(autouse=True)
def seeded() -> None:
    torch.manual_seed(0)


class Small(nn.Module):
    """A branch, and a list of one joined to a second input; `plain` learns nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.right, self.plain = nn.GRU(2, 3, batch_first=True), nn.ReLU()
        self.steps = nn.ModuleList([nn.Linear(5, 4)])

    def forward(self, first: Tensor, second: Tensor, mask: Tensor) -> Tensor:
        once, _ = self.right(self.plain(first))
        return self.steps[0](torch.cat([once, second], dim=-1)) * mask[..., None]


def test_parts_come_in_the_order_in_which_they_run_with_layers_sizes_and_shapes():
    ones, network = torch.ones(7, 6, 2), Small()
    assert parts_of("small", network, first=ones, second=ones, mask=torch.ones(7, 6)) == [
        Part("small", "first", "input", 0, "6 \N{MULTIPLICATION SIGN} 2"),
        Part("small", "second", "input", 0, "6 \N{MULTIPLICATION SIGN} 2"),
        Part("small", "right", "GRU", 3 * (2 * 3 + 3 * 3 + 3 + 3), "6 \N{MULTIPLICATION SIGN} 3"),
        Part("small", "steps.0", "Linear", 5 * 4 + 4, "6 \N{MULTIPLICATION SIGN} 4"),
        Part("small", "output", "output", 0, "6 \N{MULTIPLICATION SIGN} 4"),
    ]
    assert not any(module._forward_hooks for module in network.modules())


def test_layers_of_a_part_are_named_with_their_number():
    assert (
        layers_of(nn.Sequential(nn.Linear(2, 2), nn.ReLU(), nn.Linear(2, 2), nn.LayerNorm(2))) == "2 Linear + LayerNorm"
    )


def generator() -> Generator:
    return Generator(TINY, F, ARM, torch.tensor([0.0, 0.3, 0.25]), fps=15.0)


@pytest.fixture
def parts() -> list[Part]:
    rng = np.random.default_rng(0)
    audio, motion, initial = (rng.normal(size=(N, T, width)).astype(np.float32) for width in (F, C, C))
    index, mask = np.zeros((N, T), np.float32), np.ones((N, T), np.float32)
    beats = np.zeros((N, 1), np.float32)
    return anatomy(generator(), Batch(audio, motion, initial, index, mask, beats, beats, beats))


def downstream(network: Generator, name: str) -> set[str]:
    """Parts whose input changes with the output of one part."""
    inputs: list[dict[str, Tensor]] = []
    audio, initial = torch.randn(2, T, F), torch.randn(2, T, C)
    parts = {key: child for key, child in network.named_children() if any(True for _ in child.parameters())}
    for shift in (0.0, 1.0):
        inputs.append({})
        hooks = [
            child.register_forward_pre_hook(lambda _, given, key=key: inputs[-1].update({key: given[0].detach()}))
            for key, child in parts.items()
        ]
        hooks.append(parts[name].register_forward_hook(lambda _, __, out, shift=shift: moved(out, shift)))
        network(audio, initial)
        for hook in hooks:
            hook.remove()
    return {key for key in parts if not torch.equal(inputs[0][key], inputs[1][key])}


def moved(output: Tensor | tuple[Tensor, Tensor], shift: float) -> Tensor | tuple[Tensor, Tensor]:
    return (output[0] + shift, output[1]) if isinstance(output, tuple) else output + shift


def test_generator_is_wired_as_the_paper_says():
    """Sec. 4.2: audio encoder, initial pose features joined to it, decoder, 2-D poses before depth."""
    heads = {"flat_head", "depth_head", "path_head"}
    network = generator()
    assert downstream(network, "hearing") == {"encoder", "decoder"} | heads
    assert downstream(network, "encoder") == downstream(network, "seeing") == {"decoder"} | heads
    assert downstream(network, "decoder") == heads
    assert downstream(network, "flat_head") == {"depth_head"}
    assert downstream(network, "depth_head") == downstream(network, "path_head") == set()


def test_skip_connections_make_heads_as_wide_as_encoder_pose_features_and_decoder_together():
    network = generator()
    known = TINY.hidden + TINY.pose_features
    assert network.decoder.input_size == known
    widths = {name: getattr(network, name)[0].in_features for name in ("flat_head", "path_head", "depth_head")}
    assert widths == {"flat_head": known + 16, "path_head": known + 16, "depth_head": known + 16 + 2 * 3}


def test_no_parameter_of_a_network_is_left_out(parts: list[Part]):
    assert sum(part.parameters for part in parts if part.network == "generator") == generator().parameter_count()


def test_discriminators_are_measured_and_segments_counted(parts: list[Part]):
    shapes = {(part.network, part.name): part.shape for part in parts}
    assert [name for network, name in shapes if network == "cross_domain"] == [
        *("audio", "motion", "hearing", "seeing", "both", "verdict", "output")
    ]
    assert shapes["spatial_temporal", "seeing"].startswith("5 of 16")
    assert [name for network, name in shapes if name.startswith("joining")] == [f"joining.{step}" for step in range(4)]


def test_looking_does_not_change_the_random_numbers_that_follow():
    torch.manual_seed(3)
    expected = torch.rand(1)
    audio, motion = np.ones((N, T, F), np.float32), np.ones((N, T, C), np.float32)
    ones, network = np.ones((N, T), np.float32), generator()
    torch.manual_seed(3)
    anatomy(network, Batch(audio, motion, motion, ones, ones, ones, ones, ones))
    assert torch.equal(torch.rand(1), expected)
