"""models.harmogan: what the generator gives, what it may know, and what the discriminators look at."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from harmolab import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.systems import FeatureParams, ModelParams
from harmolab.systems.harmogan import networks
from harmolab.systems.harmogan.networks import CrossDomainDiscriminator, Generator, SpatialTemporalDiscriminator
from harmolab.systems.training import layers
from harmolab.systems.training.layers import Normaliser, Statistics, local_joints
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.units import Batch
from study.shapes import Part, anatomy, layers_of, parts_of
from tests.builders import cases, refused

TINY = ModelParams(hidden=16, layers=1, pose_features=8, discriminator=4)
ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))
LENGTHS = torch.tensor([0.0, 0.3, 0.25])


@pytest.fixture(autouse=True)
def seeded() -> None:
    """The same numbers whichever tests run."""
    torch.manual_seed(0)


def arm_generator(fps: float = 15.0) -> Generator:
    """A tiny generator of arms that hears four channels."""
    return Generator(TINY, 4, ARM, LENGTHS, fps=fps)


noise = torch.randn


@cases("params, least, most", (ModelParams.paper(), 7e6, 9e6), (ModelParams.small(), 0.8e6, 1.2e6))
@pytest.mark.parametrize("n_audio", [20, 23])
def test_presets_have_as_many_parameters_as_they_say(params: ModelParams, least: float, most: float, n_audio: int):
    assert least <= Generator(params, n_audio, TANG_23, torch.ones(23), fps=15.0).parameter_count() <= most


def test_an_untrained_generator_returns_nearly_the_initial_poses(rng: np.random.Generator):
    arm = np.array([[0, 1, 0], [0, 1, 0.3], [0, 1, 0.55]])
    positions = np.cumsum(rng.normal(scale=0.02, size=(40, 1, 3)), axis=0) + arm
    code = torch.from_numpy(encode_motion(positions, 15.0, ARM))[None]
    generator = Generator(TINY, 4, ARM, torch.from_numpy(bone_lengths(positions, ARM)), fps=15.0)
    audio, mask = noise(1, 40, 4), torch.ones(1, 40)
    generator.set_statistics(Statistics.of(audio, code, mask))
    made = generator(audio, code)
    torch.testing.assert_close(made.motion, code, atol=0.01, rtol=0)
    torch.testing.assert_close(made.flat, local_joints(code)[..., :2], atol=0.01, rtol=0)


def test_generated_bones_have_the_reference_lengths():
    joints = local_joints(arm_generator()(noise(2, 20, 4), noise(2, 20, 12)).motion)
    lengths = (joints[..., 1:, :] - joints[..., :-1, :]).norm(dim=-1)
    torch.testing.assert_close(lengths, LENGTHS[1:].expand(2, 20, 2), atol=1e-5, rtol=0)


def test_the_world_positions_follow_the_root():
    generator = arm_generator(fps=10.0)
    motion = torch.zeros(1, 3, 12)
    motion[..., -2] = 1.0  # forward, metres per second
    torch.testing.assert_close(generator.positions(motion)[0, :, 0, 2], torch.tensor([0.0, 0.1, 0.2]))


def test_depth_is_lifted_from_the_2d_poses():
    generator, audio, initial = arm_generator(), noise(1, 6, 4), torch.zeros(1, 6, 12)
    before = generator(audio, initial)
    with torch.no_grad():
        generator.flat_head[-1].bias[2] += 5.0  # x of the elbow
    after = generator(audio, initial)
    moved = (after.flat - before.flat)[0, 0]
    torch.testing.assert_close(moved, torch.tensor([[0.0, 0], [5, 0], [0, 0]]), atol=1e-5, rtol=0)
    depth = [local_joints(made.motion)[0, 0, 0, 2] for made in (before, after)]
    assert depth[0] != depth[1]


def test_music_is_heard_seven_tenths_of_a_second_ahead_and_no_further():
    generator, audio, initial = arm_generator(fps=10.0), noise(1, 30, 4), noise(1, 30, 12)
    other = audio.clone()
    other[:, 20] += 1.0
    changed = (generator(audio, initial).motion != generator(other, initial).motion).any(dim=2)[0]
    assert changed.tolist() == [False] * 13 + [True] * 17


def test_padding_with_the_last_frame_changes_nothing():
    generator, audio, initial = arm_generator(), noise(2, 20, 4), noise(2, 20, 12)
    longer = [torch.cat([values, values[:, -1:].expand(-1, 9, -1)], dim=1) for values in (audio, initial)]
    for alone, padded in zip(generator(audio, initial), generator(*longer), strict=True):
        torch.testing.assert_close(padded[:, :20], alone)


def test_every_parameter_learns():
    generator = arm_generator()
    made = generator(noise(2, 12, 4), noise(2, 12, 12))
    (made.motion.square().sum() + made.flat.square().sum()).backward()
    idle = [name for name, values in generator.named_parameters() if values.grad is None or not values.grad.any()]
    assert idle == []


@pytest.mark.parametrize("fps", [4.0, 60.0])
def test_any_skeleton_and_frame_rate_will_do(fps: float):
    generator = Generator(TINY, 1, Skeleton.unnamed(5), torch.zeros(5), fps=fps)
    assert generator(noise(1, 3, 1), noise(1, 3, 18)).motion.shape == (1, 3, 18)


def test_centimetres_survive_mixed_precision():
    generator, audio, initial = arm_generator(), noise(1, 8, 4), noise(1, 8, 12) + 3.0
    initial[..., 0], initial[..., 2] = 3.0011, 3.0022  # bfloat16 would round to 3 and 3.015625
    with torch.no_grad():
        for head in (generator.flat_head, generator.depth_head):
            head[-1].weight.zero_()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        made = generator(audio, initial)
    assert made.motion.dtype == torch.float32
    torch.testing.assert_close(made.motion[0, 0, [0, 2]], torch.tensor([3.0011, 3.0022]), atol=1e-5, rtol=0)


def test_generator_computes_in_double_precision_too():
    assert arm_generator().double()(noise(1, 5, 4).double(), noise(1, 5, 12).double()).motion.dtype == torch.float64


@cases(
    "changes, message",
    ({"bone_lengths": torch.ones(2)}, "bone_lengths must be 3 lengths in metres"),
    ({"bone_lengths": torch.tensor([0.0, -1.0, 1.0])}, "bone_lengths must be 3 lengths in metres"),
    ({"bone_lengths": torch.tensor([0.0, float("nan"), 1.0])}, "bone_lengths must be 3 lengths in metres"),
    ({"fps": 0.0}, "n_audio and fps must be positive, got 4 and 0.0"),
    ({"n_audio": 0}, "n_audio and fps must be positive, got 0 and 15.0"),
    ({"features": FeatureParams(n_mfcc=5)}, "features must have 4 audio channels at 15.0 Hz"),
    ({"skeleton": Skeleton(("a", "b", "c"), (1, 0, -1))}, "parents must form a tree"),
)
def test_what_does_not_fit_a_generator_is_refused(changes: dict[str, object], message: str):
    given = {"params": TINY, "n_audio": 4, "skeleton": ARM, "bone_lengths": LENGTHS, "fps": 15.0} | changes
    refused(message, Generator, **given)


def test_statistics_count_real_frames_only():
    audio = torch.tensor([[[1.0], [3.0], [99.0]]])
    known = Statistics.of(audio, 10 * audio, torch.tensor([[1.0, 1.0, 0.0]]))
    assert [values.tolist() for values in known] == [[2.0], [1.0], [20.0], [10.0]]
    refused("mask must keep at least one frame", Statistics.of, audio, audio, torch.zeros(1, 3))


def test_normalising_takes_mean_and_deviation_off():
    scale = Normaliser(2)
    scale.set(torch.tensor([1.0, 5.0]), torch.tensor([2.0, 0.0]))
    # The second channel never varied: it is divided by 0.001, not by 0.
    torch.testing.assert_close(scale(torch.tensor([[5.0, 5.001]])), torch.tensor([[2.0, 1.0]]), atol=1e-3, rtol=0)


@cases(
    "mean, std, message",
    ([0.0], [1.0, 1.0], r"mean must have shape \(2,\), got \(1,\)"),
    ([0.0, 0.0], [1.0, float("nan")], "standard deviation must be finite"),
    ([0.0, 0.0], [1.0, -1.0], "standard deviation must be zero or more, got -1.0"),
)
def test_statistics_that_cannot_be_are_refused(mean: list[float], std: list[float], message: str):
    refused(message, Normaliser(2).set, torch.tensor(mean), torch.tensor(std))


def test_segments_are_even_and_hold_real_frames_only():
    values, mask = torch.arange(14.0).reshape(2, 7, 1), torch.ones(2, 7)
    mask[1, 5:] = 0
    clips = zip(*networks.segments(values, mask), strict=True)
    kept = [[piece[real > 0, 0].tolist() for piece, real in zip(*clip, strict=True)] for clip in clips]
    assert kept == [[[0], [1], [2, 3], [4], [5, 6]], [[7], [8], [9], [10], [11]]]


def discriminators() -> tuple[CrossDomainDiscriminator, SpatialTemporalDiscriminator]:
    """Both, with statistics of random motion."""
    cross, temporal = CrossDomainDiscriminator(TINY, 4, ARM), SpatialTemporalDiscriminator(TINY, ARM)
    known = Statistics.of(noise(3, 30, 4), noise(3, 30, 12) + 2.0, torch.ones(3, 30))
    cross.set_statistics(known)
    temporal.set_statistics(known)
    return cross, temporal


@pytest.mark.parametrize("length", [1, 3, 17, 20])
def test_discriminators_do_not_see_padding(length: int):
    cross, temporal = discriminators()
    audio, motion, mask = noise(1, length, 4), noise(1, length, 12), torch.ones(1, length)
    padded = [torch.cat([values, noise(1, 7, values.shape[2])], dim=1) for values in (audio, motion)]
    longer = torch.cat([mask, torch.zeros(1, 7)], dim=1)
    torch.testing.assert_close(cross(*padded, longer), cross(audio, motion, mask))
    torch.testing.assert_close(temporal(padded[1], longer), temporal(motion, mask))


def test_discriminators_see_every_real_frame():
    cross, temporal = discriminators()
    audio, motion, mask = noise(2, 23, 4), noise(2, 23, 12).requires_grad_(), torch.ones(2, 23)
    mask[0, 18:] = 0
    for logits in (cross(audio, motion, mask), temporal(motion, mask)):
        assert logits.shape == (2,)
        (gradient,) = torch.autograd.grad(logits.sum(), motion)
        assert torch.equal(gradient.abs().sum(dim=2) > 0, mask > 0)


def test_cross_domain_discriminator_hears_when_music_and_motion_are_out_of_step():
    cross, _ = discriminators()
    beat, mask = torch.zeros(1, 40, 1), torch.ones(1, 40)
    beat[:, ::8] = 5.0
    together = cross(beat.expand(-1, -1, 4), beat.expand(-1, -1, 12), mask)
    assert (together - cross(beat.expand(-1, -1, 4).roll(4, dims=1), beat.expand(-1, -1, 12), mask)).abs() > 1e-3


def test_spatial_temporal_discriminator_sees_the_order_of_segments():
    _, temporal = discriminators()
    motion, mask = noise(1, 20, 12), torch.ones(1, 20)
    swapped = torch.cat([motion[:, 16:], motion[:, 4:16], motion[:, :4]], dim=1)
    assert (temporal(motion, mask) - temporal(swapped, mask)).abs() > 1e-4


# Corrections of a movement


BODY = Skeleton(("hips", "chest", "left_shoulder", "left_elbow", "left_wrist", "left_hip", "left_knee", "left_ankle"),
                (-1, 0, 1, 2, 3, 0, 5, 6))  # fmt: skip
STANDING = torch.tensor([[0, 1, 0], [0, 1.4, 0], [0.2, 1.4, 0], [0.2, 1.1, 0], [0.2, 0.8, 0],
                         [0.1, 1, 0], [0.1, 0.5, 0], [0.1, 0, 0.0]])[None, None]  # fmt: skip


def corrected_body(**columns: tuple[float, ...]) -> Tensor:
    """The standing body with so large corrections of some joints, or of "turn", that they reach their bounds."""
    raw = torch.zeros(1, 1, 27)
    for name, values in columns.items():
        first = 24 if name == "turn" else 3 * BODY.joints.index(name)
        raw[..., first : first + 3] = 1e4 * torch.tensor(values)
    return networks.moved_within_bounds(STANDING, raw, BODY)[0, 0] - STANDING[0, 0]


def test_no_correction_changes_nothing():
    assert float(corrected_body().abs().max()) < 1e-6


def test_a_limb_joint_moves_by_four_centimetres_and_takes_what_hangs_on_it():
    # The elbow goes sideways by 4 cm of its bone of 30 cm, which keeps its length; the wrist keeps its place beside it.
    way = corrected_body(left_elbow=(1.0, 0.0, 0.0))
    length = np.hypot(0.3, 0.04)
    assert way[3].tolist() == pytest.approx([0.3 * 0.04 / length, 0.3 - 0.3 * 0.3 / length, 0], abs=1e-5)
    assert float(way[[0, 1, 2, 5, 6, 7]].abs().max()) < 1e-6


def test_the_trunk_rises_by_four_centimetres_as_one_and_turns_by_eight_degrees_with_the_arms():
    way = corrected_body(hips=(0.0, 1.0, 0.0))
    np.testing.assert_allclose(way[:6], np.tile([0, 0.04, 0], (6, 1)), rtol=0, atol=1e-5)
    assert not corrected_body(chest=(1.0, 0.0, 0.0)).abs().gt(1e-6).any()  # no joint of the trunk moves by itself
    lean = corrected_body(turn=(1.0, 0.0, 0.0))  # about the axis to the left: the chest goes forward
    angle = np.radians(8)
    assert lean[1].tolist() == pytest.approx([0, 0.4 * (np.cos(angle) - 1), 0.4 * np.sin(angle)], abs=1e-5)
    bones = layers.bones((STANDING[0] + lean)[None], BODY.parents).norm(dim=-1)
    torch.testing.assert_close(bones, layers.bones(STANDING, BODY.parents).norm(dim=-1), atol=1e-5, rtol=0)


# Anatomy: sizes and shapes are measured by running a network; the generator is wired as the paper says

N, T, F, C = 4, 30, 4, 12


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
    part = nn.Sequential(nn.Linear(2, 2), nn.ReLU(), nn.Linear(2, 2), nn.LayerNorm(2))
    assert layers_of(part) == "2 Linear + LayerNorm"


def looked_at(network: Generator) -> list[Part]:
    audio, motion, one = (np.ones((N, T, width), np.float32) for width in (F, C, 1))
    return anatomy(network, Batch(audio, motion, motion, *[one[..., 0]] * 6))


@pytest.fixture
def parts() -> list[Part]:
    return looked_at(arm_generator())


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
    network = arm_generator()
    assert downstream(network, "hearing") == {"encoder", "decoder"} | heads
    assert downstream(network, "encoder") == downstream(network, "seeing") == {"decoder"} | heads
    assert downstream(network, "decoder") == heads
    assert downstream(network, "flat_head") == {"depth_head"}
    assert downstream(network, "depth_head") == downstream(network, "path_head") == set()


def test_skip_connections_make_heads_as_wide_as_encoder_pose_features_and_decoder_together():
    network = arm_generator()
    known = TINY.hidden + TINY.pose_features
    assert network.decoder.input_size == known
    widths = {name: getattr(network, name)[0].in_features for name in ("flat_head", "path_head", "depth_head")}
    assert widths == {"flat_head": known + 16, "path_head": known + 16, "depth_head": known + 16 + 2 * 3}


def test_no_parameter_of_a_network_is_left_out(parts: list[Part]):
    assert sum(part.parameters for part in parts if part.network == "generator") == arm_generator().parameter_count()


def test_discriminators_are_measured_and_segments_counted(parts: list[Part]):
    shapes = {(part.network, part.name): part.shape for part in parts}
    names = [name for network, name in shapes if network == "cross_domain"]
    assert names == ["audio", "motion", "hearing", "seeing", "both", "verdict", "output"]
    assert shapes["spatial_temporal", "seeing"].startswith("5 of 16")
    assert [name for network, name in shapes if name.startswith("joining")] == [f"joining.{step}" for step in range(4)]


def test_looking_does_not_change_the_random_numbers_that_follow():
    torch.manual_seed(3)
    expected = torch.rand(1)
    network = arm_generator()
    torch.manual_seed(3)
    looked_at(network)
    assert torch.equal(torch.rand(1), expected)
