"""Ren et al. 2020: sizes as released, padding that never counts, losses by hand, runs that resume, dances by seed."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from torch import Tensor, nn

from harmolab import Skeleton, write_corpus
from harmolab.cli import app
from harmolab.systems import FeatureParams, LeeParams, RenParams
from harmolab.systems.ren2020 import networks as nets
from harmolab.systems.ren2020 import train as ren
from harmolab.systems.ren2020.networks import STGCN, GraphBlock, partitions
from harmolab.systems.ren2020.train import danced, players
from harmolab.systems.training import loop
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import BatchNorm, parameter_count
from harmolab.systems.training.loop import Batching, Phase, Player, Shard, Tensors, epoch_shards, fit, make_fabric
from harmolab.systems.training.song_to_dance import DanceInput
from harmolab.systems.training.splits import Split
from harmolab.systems.training.units import MeterFrames
from harmolab.systems.training.weights import load_weights, save_weights
from study.experiments.rivals import entry_ren2020
from tests import tiny_training as tiny
from tests.builders import called, cases, refused
from tests.test_lee2019 import PARAMS as LEE

TINY = RenParams(
    hidden=8, body=16, blocks=1, discriminator=4, attention=3, graph=2, graph_epochs=1, epochs=3, batch_size=5
)
FEATURES = FeatureParams(fps=tiny.FPS, n_mfcc=4)
N_MOTION = 18
TREE = Skeleton(("root", "left", "right", "left hand"), (-1, 0, 0, 1))


@pytest.fixture(scope="module")
def split() -> Split:
    return tiny.tiny_split(beat_channels=False)


@pytest.fixture(scope="module")
def units(split: Split) -> Tensors:
    return Tensors.of(split.train)


def generator_of(params: RenParams = TINY, seed: int = 0) -> nets.RenGenerator:
    torch.manual_seed(seed)
    lengths = torch.full((5,), 0.5)
    return nets.RenGenerator(params, FEATURES.n_audio, tiny.DANCER, lengths, fps=tiny.FPS, features=FEATURES)


def networks_of(params: RenParams = TINY) -> ren.Networks:
    generator = generator_of(params)
    net = STGCN(tiny.DANCER, params.graph, fps=tiny.FPS, frames=params.graph_frames).eval().requires_grad_(False)
    local = nets.LocalDiscriminator(params, N_MOTION)
    return ren.Networks(generator, local, nets.GlobalDiscriminator(params, FEATURES.n_audio, N_MOTION), net)


def clips(*lengths: int, frames: int, seed: int = 0) -> tuple[Tensor, Tensor, Tensor]:
    """Music, codes and mask of clips of these lengths; padding is far from anything real."""
    random = torch.Generator().manual_seed(seed)
    mask = (torch.arange(frames) < torch.tensor(lengths)[:, None]).float()
    audio, code = (torch.randn(len(lengths), frames, size, generator=random) for size in (4, N_MOTION))
    return audio + 50 * (1 - mask[..., None]), code - 90 * (1 - mask[..., None]), mask


# Sizes


def test_the_paper_generator_is_as_large_as_the_released_one_but_for_its_audio_front():
    joints = Skeleton(tuple("abcdefghijk"), (-1, *range(10)))  # 36 numbers a pose, as 18 points in a picture
    generator = nets.RenGenerator(RenParams.paper(), 20, joints, torch.ones(11), fps=15.0)
    assert generator.n_motion == 36
    assert parameter_count(generator) == pytest.approx(8.98e6 - 0.26e6, abs=0.02e6)


def test_the_small_generator_has_a_million_parameters():
    joints = Skeleton(tuple("abcdefghijklmnopqrstuvw"), (-1, *range(22)))
    assert parameter_count(nets.RenGenerator(RenParams.small(), 20, joints, torch.ones(23), fps=15.0)) == 1_112_828


def test_the_paper_st_gcn_is_as_large_as_the_released_one():
    net = STGCN(Skeleton(tuple("abcdefghijklmnopqr"), (-1, *range(17))), 64, fps=15.0, frames=32)
    assert parameter_count(net) == pytest.approx(3.08e6, abs=0.02e6)


def test_only_sizes_differ_between_the_presets():
    small, paper = asdict(RenParams.small()), asdict(RenParams.paper())
    assert {name for name in paper if paper[name] != small[name]} == {"hidden", "body", "discriminator", "graph"}


@cases(
    "wrong, message",
    ({"dropout": 1.0}, "dropout must leave something"),
    ({"block_weights": (1.0,)}, "block_weights must be 10 numbers"),
    ({"body": 0}, "body must be positive, got 0"),
    ({"pose_weight": -1.0}, "pose_weight must be zero or more, got -1"),
    ({"epochs": -1}, "epochs must be zero or more"),
)
def test_wrong_settings_are_named(wrong: dict[str, Any], message: str):
    refused(message, RenParams, **wrong)


# Padding


@pytest.mark.parametrize("training", [True, False])
def test_padding_changes_no_dance(training: bool):
    generator = generator_of(replace(TINY, dropout=0.0)).train(training)
    audio, _, mask = clips(20, 33, frames=33)
    noise = generator.noise(2, 60)
    longer = nn.functional.pad(audio, (0, 0, 0, 27), value=7.0), nn.functional.pad(mask, (0, 27)), noise
    with torch.no_grad():
        short, long = generator(audio, mask, noise[:, :33]), generator(*longer)
    torch.testing.assert_close(long[:, :33], short, atol=1e-5, rtol=1e-5)
    assert not long[:, 33:].any() and not short[0, 20:].any()


def test_padding_changes_no_verdict():
    networks = networks_of()
    audio, code, mask = clips(20, 33, frames=33)
    longer = [nn.functional.pad(each, (0, 0, 0, 27), value=7.0) for each in (audio, code)]
    verdicts = []
    for music, motion, real in ((audio, code, mask), (*longer, nn.functional.pad(mask, (0, 27)))):
        maps = networks.overall.maps(motion, real)
        logits, counted = networks.local(motion, real)
        judged = networks.overall.judge(networks.overall.music(music, real), maps[-1])
        features = networks.st_gcn.features(motion, real)
        verdicts.append([judged, logits[counted > 0], ren.deceiving_loss(logits, counted), *features])
    for short, long in zip(*verdicts, strict=True):
        torch.testing.assert_close(long, short, atol=1e-5, rtol=1e-4)


def test_padding_changes_no_loss():
    networks, (_, code, mask) = networks_of(), clips(20, 33, frames=33)
    other = clips(20, 33, frames=33, seed=1)[1]
    losses = []
    for more in (0, 9):
        motions = [nn.functional.pad(each, (0, 0, 0, more), value=3.0) for each in (code, other)]
        real = nn.functional.pad(mask, (0, more))
        maps = [networks.overall.maps(each, real) for each in motions]
        torch.manual_seed(0)
        penalty = ren.gradient_penalty(lambda x, m=real: networks.overall.maps(x, m)[-1][0].sum((1, 2)), *motions, real)
        losses.append(torch.stack([ren.pose_loss(*motions, real), ren.matching_loss(*maps), penalty]))
    torch.testing.assert_close(losses[0], losses[1])


def test_batch_normalisation_is_over_real_frames_alone():
    generator = generator_of(replace(TINY, blocks=1)).train()
    audio, _, mask = clips(12, 25, frames=40)
    norm = generator.blocks[0].layers[1]
    seen: list[Tensor] = []
    norm.register_forward_pre_hook(lambda module, inputs: seen.append(inputs[0]))
    generator(audio, mask, generator.noise(2, 40))
    assert seen[0].shape == (12 + 25, TINY.body)
    torch.testing.assert_close(norm.mean, seen[0].mean(dim=0))
    torch.testing.assert_close(norm.variance, seen[0].var(dim=0))


def test_batch_normalisation_is_that_of_torch():
    torch.manual_seed(0)
    ours, theirs = BatchNorm(3), nn.BatchNorm2d(3)
    for values in torch.randn(4, 5, 3, 6, 2):
        torch.testing.assert_close(ours(values), theirs(values))
    torch.testing.assert_close(ours.eval()(values), theirs.eval()(values))
    assert all(value.is_floating_point() for value in ours.state_dict().values())


def test_after_settling_statistics_depend_on_no_earlier_batch(units: Tensors):
    kept = []
    for rows in (torch.arange(3), torch.arange(9)):
        generator = generator_of()
        few = units.take(rows)
        generator.train()(few.audio, few.mask, generator.noise(*few.mask.shape))
        nets.settle(generator, units.audio, units.mask, seed=1)
        assert not generator.training
        kept.append({name: value.clone() for name, value in generator.named_buffers()})
    for name in kept[0]:
        torch.testing.assert_close(kept[0][name], kept[1][name])


# Networks


def test_the_local_windows_are_eight_frames_every_five():
    values, mask = torch.arange(40.0).view(1, 20, 2), torch.ones(1, 20)
    mask[:, 15:] = 0
    pieces, masks = nets.windows(values, mask, size=8, step=5)
    assert pieces.shape == (1, 3, 8, 2)
    assert pieces[0, :, 0, 0].tolist() == [0.0, 10.0, 20.0] and pieces[0, 1, :, 1].tolist() == [*range(11, 27, 2)]
    assert masks[0].sum(dim=1).tolist() == [8, 8, 5]


def test_windows_that_are_partly_padding_do_not_count():
    _, code, mask = clips(17, 18, 7, frames=40)
    logits, counted = networks_of().local(code, mask)
    assert counted.sum(dim=1).tolist() == [2, 3, 0]
    assert not logits[counted < 1].any() and logits[counted > 0].all()


def test_clips_shorter_than_a_window_are_refused():
    fault = "clips of 7 frames are shorter than a window of 8"
    refused(fault, nets.windows, torch.zeros(1, 7, 2), torch.ones(1, 7), size=8, step=5)


def test_the_second_stream_is_the_steps():
    both = nets.with_differences(torch.tensor([[[1.0], [4.0], [2.0]]]))
    assert both.tolist() == [[[1.0, 0.0], [4.0, 3.0], [2.0, -2.0]]]


def test_every_dance_is_judged_with_its_own_song():
    networks, (audio, code, mask) = networks_of(), clips(20, 33, 25, frames=33)

    def verdicts(music: Tensor) -> Tensor:
        return networks.overall.judge(networks.overall.music(music, mask), networks.overall.maps(code, mask)[-1])

    others = audio.clone()
    others[1:] = torch.randn_like(others[1:])
    own, changed = verdicts(audio), verdicts(others)
    torch.testing.assert_close(own[0], changed[0])
    assert (own[1:] - changed[1:]).abs().min() > 1e-4
    order = torch.tensor([2, 0, 1])
    heard = networks.overall.music(audio, mask)[order]
    torch.testing.assert_close(networks.overall.music(audio[order], mask[order]), heard)


def test_attention_is_an_average_over_time():
    overall = networks_of().overall
    frame = torch.randn(1, 1, 4)
    heard = overall.music(frame.repeat(1, 30, 1), torch.ones(1, 30))
    torch.testing.assert_close(heard, torch.tanh(overall.hearing(frame))[:, 0])


def test_noise_is_a_third_of_a_standard_normal():
    torch.manual_seed(0)
    noise = generator_of(replace(TINY, noise=10)).noise(20, 200)
    assert noise.shape == (20, 200, 10)
    assert float(noise.std()) == pytest.approx(0.33, rel=0.02) and float(noise.mean()) == pytest.approx(0, abs=0.01)


def test_noise_changes_the_dance_from_its_moment_on():
    generator, (audio, _, mask) = generator_of().eval(), clips(30, frames=30)
    noise = generator.noise(1, 30)
    other = noise.clone()
    other[:, 12:] += 1.0
    change = (generator(audio, mask, noise) - generator(audio, mask, other)).abs().amax(dim=(0, 2))
    assert not change[:12].any() and change[12:].min() > 0


def test_music_is_heard_before_it_sounds():
    generator, (audio, _, mask) = generator_of().eval(), clips(30, frames=30)
    noise, later = generator.noise(1, 30), audio.clone()
    later[:, 20:] += 5.0
    assert (generator(audio, mask, noise) - generator(later, mask, noise))[:, 15:20].abs().max() > 1e-5


# ST-GCN


def test_the_partitions_of_a_small_tree():
    own, parents, children = partitions(TREE)
    torch.testing.assert_close(own, torch.diag(torch.tensor([1 / 3, 1 / 3, 1 / 2, 1 / 2])))
    expected = torch.zeros(4, 4)
    expected[1, 0], expected[2, 0], expected[3, 1] = 1 / 3, 1 / 2, 1 / 2
    torch.testing.assert_close(parents, expected)
    expected = torch.zeros(4, 4)
    expected[0, 1], expected[0, 2], expected[1, 3] = 1 / 3, 1 / 3, 1 / 3
    torch.testing.assert_close(children, expected)


def test_a_block_passes_features_to_neighbours_only():
    torch.manual_seed(0)
    block = GraphBlock(3, 4, partitions(TREE), stride=1, residual=False).eval()
    values = torch.randn(1, 3, 20, 4)
    other = values.clone()
    other[..., 3] += 1.0  # the left hand, which only itself and the left shoulder know
    assert ((block(values) - block(other)).abs().amax(dim=(0, 1, 2)) > 1e-6).tolist() == [False, True, False, True]


def test_edges_are_learnt():
    block = GraphBlock(3, 4, partitions(TREE), stride=1, residual=False).eval()
    block(torch.randn(2, 3, 20, 4)).sum().backward()
    assert block.edges.grad is not None and bool((block.edges.grad != 0).equal(partitions(TREE) > 0))


def test_the_maps_of_the_ten_blocks():
    net = STGCN(TREE, 2, fps=15.0, frames=32).eval()
    maps = net.features(torch.randn(3, 50, 15), torch.ones(3, 50))
    sizes = [(2, 32)] * 4 + [(4, 16)] * 3 + [(8, 8)] * 3
    assert [tuple(each.shape) for each in maps] == [(3, channels, frames, 4) for channels, frames in sizes]
    assert net.embed(torch.randn(3, 50, 15), torch.ones(3, 50)).shape == (3, 32)


def test_an_st_gcn_is_stored_and_built_again(tmp_path: Path):
    net = STGCN(TREE, 2, fps=15.0, frames=24)
    net.embed(torch.randn(9, 50, 15), torch.ones(9, 50))  # statistics of its own
    save_weights(tmp_path / "net", net)
    again, clip = load_weights(tmp_path / "net", STGCN), (torch.randn(1, 50, 15), torch.ones(1, 50))
    torch.testing.assert_close(again.embed(*clip), net.eval().embed(*clip))


# Losses by hand


def test_pose_loss_is_the_mean_difference():
    target = torch.zeros(2, 3, 2)
    code = torch.tensor([[[1.0, 3.0], [9, 9], [9, 9]], [[0.0, 1.0], [1.0, 2.0], [9, 9]]])
    assert float(ren.pose_loss(code, target, torch.tensor([[1.0, 0, 0], [1, 1, 0]]))) == (2.0 + 1.0) / 2


def test_perceptual_loss_weighs_the_blocks():
    maps = [torch.ones(1, 2, 2, 2), torch.ones(1, 1, 2, 2)]
    targets = [torch.zeros(1, 2, 2, 2), 3 * torch.ones(1, 1, 2, 2)]
    assert float(ren.perceptual_loss(maps, targets, (20.0, 5.0))) == 20 * 1 + 5 * 2
    assert RenParams().block_weights == (20, 5, 1, 1, 1, 1, 1, 1, 1, 1)


def test_matching_loss_adds_the_maps_up():
    mask = torch.tensor([[1.0, 1.0, 0.0]])
    ours = [(torch.tensor([[[1.0, 3.0, 7.0]]]), mask), (torch.full((1, 2, 3), 5.0), mask)]
    assert float(ren.matching_loss(ours, [(torch.zeros(1, 1, 3), mask), (torch.full((1, 2, 3), 4.0), mask)])) == 2 + 1


def test_cross_entropies():
    log3 = float(np.log(3))  # logit of three quarters
    assert float(ren.deceiving_loss(torch.tensor([log3]))) == pytest.approx(-np.log(0.75))
    both = ren.discriminator_loss(torch.tensor([log3]), torch.tensor([log3]))
    assert float(both) == pytest.approx(-np.log(0.75) - np.log(0.25))
    logits, counted = torch.tensor([[log3, 0.0], [log3, 99.0]]), torch.tensor([[1.0, 1.0], [1.0, 0.0]])
    expected = (-(np.log(0.75) + np.log(0.5)) / 2 - np.log(0.75)) / 2
    assert float(ren.deceiving_loss(logits, counted)) == pytest.approx(expected)


def test_gradient_penalty_of_a_linear_judge():
    weight = torch.tensor([[3.0, 0.0], [0.0, 4.0], [9.0, 9.0]])
    real, fake = torch.randn(2, 1, 3, 2)
    mask = torch.tensor([[1.0, 1.0, 0.0]])
    penalty = ren.gradient_penalty(lambda code: (code * weight).sum(dim=(1, 2)), real, fake, mask)
    assert float(penalty) == pytest.approx((5 - 1) ** 2)


def test_gradient_penalty_is_taken_between_danced_and_recorded():
    seen: list[Tensor] = []

    def judge(code: Tensor) -> Tensor:
        seen.append(code)
        return code.sum(dim=(1, 2))

    ren.gradient_penalty(judge, torch.ones(50, 2, 1), torch.zeros(50, 2, 1), torch.ones(50, 2))
    mixed = seen[0].detach()
    shares = mixed[:, 0, 0]
    assert bool((mixed == shares[:, None, None]).all())  # one share a clip
    assert 0 <= float(shares.min()) < 0.2 < 0.8 < float(shares.max()) <= 1


# Steps


@pytest.fixture(scope="module")
def shard(units: Tensors) -> Shard:
    batch = units.take(torch.arange(5))
    return Shard(batch, batch, 1.0, seed=7)


def test_the_penalty_teaches_the_branch_of_motion_and_not_that_of_music(shard: Shard):
    networks = networks_of()
    ren.global_terms(networks, danced(networks.generator, shard))["penalty"].backward()
    assert networks.overall.seeing.layers[0].convolution.weight.grad.abs().max() > 0
    assert networks.overall.hearing.weight.grad is None


def test_discriminators_do_not_reach_the_generator(shard: Shard):
    networks = networks_of()
    dance = danced(networks.generator, shard)
    for terms in (ren.local_terms(networks, dance), ren.global_terms(networks, dance)):
        torch.stack([*terms.values()]).sum().backward()
    assert all(part.grad is None for part in networks.generator.parameters())


def test_every_term_reaches_the_generator(shard: Shard):
    networks = networks_of()
    terms = ren.generator_terms(networks, danced(networks.generator, shard), TINY)
    assert list(terms) == ["pose", "perceptual", "feature", "local", "global"]
    for term in terms.values():
        (slope,) = torch.autograd.grad(term, networks.generator.pose.weight, retain_graph=True)
        assert bool(slope.isfinite().all()) and slope.abs().max() > 0


def test_a_shard_is_danced_the_same_again_by_its_seed(shard: Shard):
    generator = generator_of().train()
    torch.manual_seed(3)
    first = danced(generator, shard).code
    after = torch.rand(1)
    torch.manual_seed(4)
    torch.testing.assert_close(danced(generator, shard).code, first)
    assert (danced(generator, shard._replace(seed=8)).code - first).abs().max() > 1e-3
    torch.manual_seed(3)
    assert torch.equal(torch.rand(1), after)  # whoever draws next is not disturbed


def test_shards_have_seeds_of_their_own_that_processes_do_not_change(units: Tensors):
    fabric = make_fabric(accelerator="cpu")

    def seeds(epoch: int, **other: int) -> list[int]:
        batching = Batching(**{"size": 5, "shards": 2, "seed": 1} | other)
        return [shard.seed for shards in epoch_shards(fabric, units, epoch, batching) for shard in shards]

    assert seeds(0) == seeds(0) and len(set(seeds(0) + seeds(1) + seeds(0, seed=2))) == 18
    assert seeds(0)[::2] == seeds(0, shards=1)  # the first shard of each batch


@pytest.mark.slow
def test_one_batch_is_learnt_by_heart(units: Tensors):
    generator, few = generator_of(replace(TINY, hidden=24, body=48)), units.take(torch.arange(4))
    generator.motion_scale.set(few.motion.mean(dim=(0, 1)), few.motion.std(dim=(0, 1)))
    target = generator.motion_scale(few.motion)

    def loss() -> Tensor:
        return ren.pose_loss(generator(few.audio, few.mask, generator.noise(*few.mask.shape)), target, few.mask)

    losses = tiny.descent(generator.parameters(), loss, steps=40, rate=1e-2)
    nets.settle(generator, few.audio, few.mask, seed=0)
    assert losses[-1] < 0.5 * losses[0]
    assert float(ren.pose_loss(generator.drawn(few.audio, few.mask, 5), target, few.mask)) < 0.35 * losses[0]


def test_speed_is_that_of_the_recorded_dance_over_again(units: Tensors):
    generator = generator_of()
    generator.motion_scale.set(units.motion.mean(dim=(0, 1)), units.motion.std(dim=(0, 1)) + 0.1)
    code = generator.motion_scale(units.motion)
    assert ren.speed_ratio(generator, code, units) == pytest.approx(1.0, abs=1e-5)
    assert ren.speed_ratio(generator, torch.zeros_like(code), units) < 0.5


def test_players_have_rates_of_their_own(units: Tensors, tmp_path: Path):
    slow, fast = nn.Parameter(torch.zeros(1)), nn.Parameter(torch.zeros(1))
    players = [
        Player(name, [{"params": [value], "share": share}], lambda *_, value=value: {"a": value.sum()}, {"a": 1.0})
        for name, value, share in (("slow", slow, 1.0), ("fast", fast, 5 / 3))
    ]
    phase = Phase("one", 1, rate=lambda epoch: 3e-4, modules={}, players=players, forward=lambda shard, last: None)
    fit(make_fabric(accelerator="cpu"), [phase], units, Batching(len(units)), tmp_path)
    assert float(slow.detach()) == pytest.approx(-3e-4, rel=1e-3)
    assert float(fast.detach()) == pytest.approx(-5e-4, rel=1e-3)


def test_the_generator_steps_first_and_losses_and_rates_are_as_released():
    generator, local, overall = players(networks_of(), RenParams())
    assert [each.name for each in (generator, local, overall)] == ["generator", "local", "overall"]
    assert generator.weights == {"pose": 200.0, "perceptual": 1.0, "feature": 1.0, "local": 1.0, "global": 1.0}
    assert local.weights == {"critic_local": 0.5} and overall.weights == {"critic_global": 0.5, "penalty": 1.0}
    shares = [group["share"] for each in (local, overall) for group in each.parameters if isinstance(group, dict)]
    assert [3e-4 * share for share in (1.0, *shares)] == pytest.approx([3e-4, 3e-4, 5e-4])
    assert not any(isinstance(each, dict) for each in generator.parameters)  # the phase's own rate
    assert (RenParams().epochs, RenParams().batch_size) == (400, 16)


# Training


Train = Callable[..., nets.RenGenerator]


@pytest.fixture(scope="module")
def train(split: Split) -> Train:
    def run(folder: Path, *, stop_after: int | None = None, params: RenParams = TINY, **more: Any) -> nets.RenGenerator:
        options = TrainOptions(folder, accelerator="cpu", report=tiny.stopping(stop_after), **more)
        return ren.train_ren2020(split, options, params)

    return run


@pytest.fixture(scope="module")
def run(train: Train, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ren") / "run"
    train(folder)
    return folder


def test_a_run_holds_what_belongs_to_it(run: Path):
    files = {path.name for path in run.iterdir() if not path.name.startswith((".", "events"))}
    expected = {"settings.json", "split.json", "history.csv", "state.safetensors", "model_poses.safetensors"}
    assert files == expected | {f"{stem}.{kind}" for stem in ("model", "st_gcn") for kind in ("safetensors", "json")}
    history = pd.read_csv(run / "history.csv")
    assert history["phase"].tolist() == ["adversarial"] * 3
    named = {"pose", "perceptual", "feature", "local", "global", "critic_local", "critic_global", "penalty"}
    assert named <= {*history.columns}
    assert np.isfinite(history[[*named]].to_numpy()).all()
    assert np.isfinite(history["val_pose"].iloc[-1]) and history["val_speed"].iloc[-1] > 0


@pytest.mark.slow
def test_a_run_that_was_stopped_ends_the_same(run: Path, train: Train, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(loop, "SAVING_SHARE", float("inf"))
    with pytest.raises(tiny.Stopped):
        train(tmp_path / "run", stop_after=1)
    train(tmp_path / "run", resume=True)
    for file in ("history.csv", "model.safetensors", "st_gcn.safetensors"):
        assert (tmp_path / "run" / file).read_bytes() == (run / file).read_bytes()


@pytest.mark.slow
def test_shards_change_no_more_than_batch_statistics(run: Path, train: Train, tmp_path: Path):
    train(tmp_path / "run", params=replace(TINY, shards=2))
    one, two = (pd.read_csv(folder / "history.csv") for folder in (run, tmp_path / "run"))
    np.testing.assert_allclose(two["pose"], one["pose"], rtol=0.1)


# Dancing


def dance_input(frames: int, *, first: int = 0, seed: int = 0, prior: float = 0.0) -> DanceInput:
    audio = np.random.default_rng(seed).normal(size=(frames - first, 4)).astype(np.float32)
    meters = [MeterFrames(first, first + 8, frames, 1.0)]
    before = np.full((-first, N_MOTION), prior)
    return DanceInput(audio, lambda: audio, np.arange(0.0, frames, 8), meters, before, frames)


def test_a_song_of_any_length_is_danced_in_one_pass():
    generator, calls = generator_of().eval(), []
    generator.register_forward_hook(lambda module, inputs, result: calls.append(result.shape))
    assert generator.code(dance_input(301), 0).shape == (301, N_MOTION)
    assert calls == [(1, 301, N_MOTION)]


def test_the_code_is_in_metres():
    generator = generator_of().eval()
    song = dance_input(30)
    plain = generator.code(song, 1)
    generator.motion_scale.set(torch.full((N_MOTION,), 2.0), torch.full((N_MOTION,), 3.0))
    np.testing.assert_allclose(generator.code(song, 1), 3 * plain + 2, atol=1e-5)


def test_noise_is_drawn_once_a_song_by_its_seed():
    generator = generator_of().eval()
    first = generator.code(dance_input(40), 1)
    np.testing.assert_array_equal(generator.code(dance_input(40), 1), first)
    assert np.abs(generator.code(dance_input(40), 2) - first).max() > 1e-4


def test_nothing_is_left_out_when_dancing_even_in_training_mode():
    generator = generator_of().train()
    nets.settle(generator, torch.randn(2, 30, 4), torch.ones(2, 30), seed=0)
    first = generator.code(dance_input(40), 1)
    np.testing.assert_array_equal(generator.train().code(dance_input(40), 1), first)
    assert generator.training


def test_a_dance_goes_on_from_the_movement_before_it_and_soon_forgets_it():
    generator = generator_of().eval()
    from_here, from_there = (generator.code(dance_input(40, first=-12, prior=place), 1) for place in (0.0, 1.0))
    difference = np.abs(from_there - from_here).max(axis=1)
    assert difference[0] == pytest.approx(0.72, abs=0.01)  # one frame into a fade of a quarter second
    assert difference[15:].max() < 1e-3


@cases("sizes, message", ({"body": 10**9}, "describes body"), ({"blocks": 1000}, "1000 blocks, more than"))
def test_a_description_that_cannot_be_is_refused(sizes: dict[str, int], message: str):
    generator = generator_of()
    about = generator.description()
    about["params"] |= sizes
    refused(message, nets.RenGenerator.built, about, generator.state_dict())


# Commands and entry tests


@pytest.mark.slow
@cases(
    "system, settings, tiny",
    ("ren2020", RenParams, replace(TINY, epochs=1, batch_size=50)),
    ("lee2019", LeeParams, replace(LEE, style_epochs=1, unit_epochs=1, composition_epochs=1)),
    ids=["ren2020", "lee2019"],
)
def test_the_commands_train_resume_and_dance(
    system: str, settings: Any, tiny: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    corpus = write_corpus(tmp_path / "synth", clips=8, seconds=10.0, fps=30.0, seed=2)
    monkeypatch.setattr(settings, "small", lambda: tiny)
    run, command = tmp_path / "run", ("train", corpus, "--out", tmp_path / "run", "--system", system)
    for options in ((), ("--resume",)):
        result = called(app, *command, *options, "--accelerator", "cpu")
        assert result.exit_code == 0, result.output
    song, dance = next(corpus.glob("*/audio.wav")), tmp_path / "dance.npz"
    danced = called(app, "dance", song, "--weights", run, "--out", dance, "--seconds", 3)
    assert danced.exit_code == 0, danced.output
    assert dance.is_file()


def asked(split: Split, **columns: list[float]) -> dict[str, Any]:
    """The entry tests of an untrained generator with a history whose features fall, but for these columns."""
    falling = [*np.linspace(2.0, 1.0, 20)]
    rows = pd.DataFrame({"phase": ["adversarial"] * 20, "perceptual": falling, "feature": falling} | columns)
    return entry_ren2020(generator_of().eval(), split, rows)


def test_an_untrained_network_fails_the_entry_tests_and_its_speed_is_no_condition(split: Split):
    results = asked(split)
    assert not results["L1 of training units over the mean pose's"][2]
    assert results["feature terms, last tenth of epochs over first"] == (pytest.approx(0.52, abs=1e-9), (0, 1), True)
    assert results["difference between two seeds (SD)"][0] > 0
    value, wanted, passed = results["speed on test units over recorded"]
    assert value > 0 and wanted == (0.0, np.inf) and passed


def test_feature_matching_alone_may_rise_but_not_all_features(split: Split):
    results = asked(split, feature=[*np.linspace(1.0, 2.0, 20)], perceptual=[*np.linspace(20.0, 8.0, 20)])
    assert results["feature terms, last tenth of epochs over first"][2]
    value, _, passed = results["of these, feature matching alone"]
    assert value == pytest.approx(1.975 / 1.025, abs=0.02) and passed


def test_rising_features_and_lost_numbers_fail_the_entry_tests(split: Split):
    results = asked(split, perceptual=[*np.linspace(1.0, 4.0, 20)], pose=[*np.ones(19), np.nan])
    failed = [name for name, (_, _, passed) in results.items() if not passed]
    assert failed[1:] == ["feature terms, last tenth of epochs over first", "losses that are not finite"]
