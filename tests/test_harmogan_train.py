"""What training teaches, batch by batch and epoch by epoch: rates, order, terms, weights, losses that fall."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from lightning_fabric import Fabric

from harmolab import HarmonyParams
from harmolab.soft_score import SoftHarmony
from harmolab.systems import HarmoGAN, ModelParams, TrainParams
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.systems.harmogan import losses
from harmolab.systems.harmogan import train as harmogan
from harmolab.systems.harmogan.losses import discriminator_terms, generator_terms, pose_terms
from harmolab.systems.harmogan.networks import GeneratorOutput, Networks, load_generator
from harmolab.systems.harmogan.train import adversarial_rate, phases, pretrain_rate, train_harmogan, validate
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.loop import Batching, Shard, Tensors, epoch_order, fit, make_fabric, total_loss
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.splits import Split
from tests import tiny_training as tiny
from tests.builders import cases, refused

PAPER: TrainParams = tiny.PAPER
RECOMMENDED: TrainParams = tiny.RECOMMENDED
MODEL: ModelParams = tiny.MODEL
TERMS = {"moved", "gan", "harmony", "smoothness", "energy", "foot"}


@pytest.fixture(scope="module")
def split() -> Split:
    return tiny.tiny_split(sketched=True)


@pytest.fixture(scope="module")
def fabric() -> Fabric:
    return make_fabric(accelerator="cpu")


@pytest.fixture
def networks(split: Split) -> Networks:
    return fresh(split, MODEL)


@pytest.fixture
def bounded(split: Split) -> Networks:
    return fresh(split, replace(MODEL, bounded=True))


def fresh(split: Split, model: ModelParams) -> Networks:
    torch.manual_seed(0)
    pose_net = PoseNet(split.train.skeleton, fps=split.train.features.fps).eval().requires_grad_(False)
    return Networks.fresh(split.train, Tensors.of(split.train), model, pose_net, seed=1)


@pytest.fixture(scope="module")
def shard(split: Split) -> Shard:
    return Shard(units_at(split, [0, 1, 2, 3]), units_at(split, [1, 2, 3, 0]), 1.0, 7)


@pytest.fixture(scope="module")
def batch(shard: Shard) -> Tensors:
    return shard.own


def units_at(split: Split, numbers: list[int]) -> Tensors:
    return Tensors.of(split.train).take(torch.tensor(numbers))


def weights(module: torch.nn.Module) -> torch.Tensor:
    return torch.cat([part.detach().flatten() for part in module.parameters()])


# Schedule


def test_pretraining_rate_falls_every_50_epochs():
    # 0.001, times 0.5, 0.2, 0.2, 0.5 in this order; the last one stays.
    rates = [pretrain_rate(epoch, TrainParams.paper()) for epoch in (0, 49, 50, 99, 100, 150, 200, 400)]
    assert rates == pytest.approx([1e-3, 1e-3, 5e-4, 5e-4, 1e-4, 2e-5, 1e-5, 1e-5])


def test_adversarial_rate_is_divided_by_2_and_5_in_turn():
    rates = [adversarial_rate(epoch, TrainParams.paper()) for epoch in (0, 4, 5, 10, 15, 20, 25, 40, 44)]
    assert rates == pytest.approx([1e-4, 1e-4, 5e-5, 1e-5, 5e-6, 1e-6, 5e-7, 1e-8, 1e-8])


@pytest.mark.parametrize(("n_units", "sizes"), [(20, [10, 10]), (23, [8, 8, 7]), (11, [6, 5]), (7, [7]), (1, [1])])
def test_an_epoch_shows_every_unit_once_in_batches_of_like_size(n_units: int, sizes: list[int]):
    batches = epoch_order(n_units, 3, Batching(10))
    assert [len(batch) for batch in batches] == sizes
    assert sorted(torch.cat(batches).tolist()) == list(range(n_units))


def test_the_order_is_drawn_anew_each_epoch_and_by_the_seed():
    def order(epoch: int, seed: int) -> list[int]:
        return torch.cat(epoch_order(30, epoch, Batching(10, seed=seed))).tolist()

    assert order(0, 1) == order(0, 1)
    assert len({tuple(order(epoch, seed)) for epoch in (0, 1) for seed in (1, 2)}) == 4


# Patience


def validated_as(monkeypatch: pytest.MonkeyPatch, *errors: float) -> None:
    """Every epoch is validated, and has the next of these errors."""
    told = iter(errors)
    monkeypatch.setattr(harmogan, "validate", lambda *_: {"val_mse": next(told)})
    monkeypatch.setattr(harmogan, "VALIDATE_EVERY", 1)


def test_pretraining_ends_when_nothing_is_gained_and_goes_back_to_the_best_epoch(
    networks: Networks, split: Split, fabric: Fabric, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    validated_as(monkeypatch, 3.0, 1.0, 2.0, 2.0, 2.0)
    kept: list[torch.Tensor] = []
    patient = replace(PAPER, pretrain_epochs=9, adversarial_epochs=0, patience=2)
    report = lambda row, end: kept.append(weights(networks.generator))  # noqa: E731
    assert [row["epoch"] for row in run(fabric, networks, split, patient, tmp_path, report=report)] == [0, 1, 2, 3]
    assert torch.equal(weights(networks.generator), kept[1])
    assert not torch.equal(kept[1], kept[3])


def test_patience_shorter_than_the_way_to_the_first_validation_waits_for_it(
    networks: Networks, split: Split, fabric: Fabric, tmp_path: Path
):
    rows = run(fabric, networks, split, replace(PAPER, pretrain_epochs=9, adversarial_epochs=0, patience=1), tmp_path)
    assert len(rows) > harmogan.VALIDATE_EVERY and "val_mse" in rows[harmogan.VALIDATE_EVERY - 1]
    assert torch.equal(weights(load_generator(tmp_path / "pretrained")), weights(networks.generator))


def test_without_patience_every_epoch_is_run_and_the_last_one_stays(
    networks: Networks, split: Split, fabric: Fabric, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    validated_as(monkeypatch, 1.0, 2.0, 3.0)
    before = weights(networks.generator)
    stubborn = replace(PAPER, pretrain_epochs=3, adversarial_epochs=0, patience=None)
    assert len(run(fabric, networks, split, stubborn, tmp_path)) == 3
    stored = load_generator(tmp_path / "pretrained")
    assert torch.equal(weights(stored), weights(networks.generator))
    assert not torch.equal(weights(stored), before)


# Batches


def test_shares_of_a_batch_are_padded_as_the_whole(split: Split):
    units = Tensors.of(split.train)
    chosen = torch.tensor([3, 0, 5, 9, 2])
    whole, shares = units.take(chosen), [units.take(chosen, rank, 2) for rank in range(2)]
    assert [len(share) for share in shares] == [3, 2]
    for name in vars(whole):
        torch.testing.assert_close(getattr(shares[0], name), getattr(whole, name)[[0, 2, 4]])
        torch.testing.assert_close(getattr(shares[1], name), getattr(whole, name)[[1, 3]])


def test_a_batch_is_as_long_as_its_longest_unit(split: Split):
    lengths = torch.tensor([unit.n_frames for unit in split.train.units])
    short = (lengths == 24).nonzero().flatten()  # eight beats of three frames; others have four
    assert lengths.max() == 32 and Tensors.of(split.train).take(short).motion.shape[1] == 24


def test_harmony_is_that_of_each_units_meter(networks: Networks, batch: Tensors, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(losses, "soft_harmony", lambda *_, span, **more: span)
    span = losses.score_batch(networks.generator, batch.motion, batch, 0.5, HarmonyParams.paper())
    assert (span * 15).round().tolist() == [[prior, 2 * prior] for prior in batch.index.sum(dim=1)]


# Terms


def made(networks: Networks, batch: Tensors) -> GeneratorOutput:
    return networks.generator(batch.audio, batch.initial)


def ours(networks: Networks, output: GeneratorOutput, shard: Shard, **changes: Any) -> dict[str, torch.Tensor]:
    return generator_terms(networks, output, shard, replace(RECOMMENDED, **changes), 0.5, tiny.PATTERNS)


def test_terms_are_those_of_equation_32_or_of_a_sketch(networks: Networks, bounded: Networks, shard: Shard):
    output, paper = made(networks, shard.own), {"kl", "mse", "feature", "gan", "harmony"}
    for params, terms in ((PAPER, paper), (replace(PAPER, harmony_weight=0.0), paper - {"harmony"})):
        assert set(generator_terms(networks, output, shard, params, 0.5)) == terms
    assert set(ours(bounded, made(bounded, shard.own), shard)) == TERMS
    assert set(pose_terms(networks.generator, output, shard.own, PAPER)) == {"kl", "mse"}
    assert set(discriminator_terms(networks, output, shard, PAPER)) == {"critic_cd", "critic_st"}


def test_a_skeleton_without_named_feet_has_no_foot_term(networks: Networks, shard: Shard):
    skeleton = networks.generator.skeleton
    networks.generator.skeleton = replace(skeleton, joints=tuple(f"joint{joint}" for joint in range(5)))
    assert "foot" not in ours(networks, made(networks, shard.own), shard)


def test_a_discriminator_that_is_not_heard_is_not_trained(networks: Networks, shard: Shard):
    deaf = replace(PAPER, cross_domain_weight=0.0)
    assert set(discriminator_terms(networks, made(networks, shard.own), shard, deaf)) == {"critic_st"}
    (group,) = networks.discriminators(deaf)
    assert {id(part) for part in group["params"]} == {id(part) for part in networks.spatial_temporal.parameters()}
    (both,) = networks.discriminators(RECOMMENDED)
    assert len(both["params"]) > len(group["params"]) and both["share"] == 0.2


def test_wrong_pairs_are_shown_to_the_critic_of_corrected_sketches_alone(networks: Networks, shard: Shard):
    output, asked = made(networks, shard.own), []
    networks.cross_domain.forward = lambda audio, motion, mask: asked.append(audio) or torch.zeros(len(audio))
    discriminator_terms(networks, output, shard, PAPER)
    assert len(asked) == 2
    found = discriminator_terms(networks, output, shard, RECOMMENDED)["critic_cd"]
    assert found == pytest.approx(3 * np.log(2))  # real, made, wrong, of each of which it knows nothing
    assert torch.equal(asked[4], losses.half_a_beat_late(shard.own)) and torch.equal(asked[5], shard.others.audio)


def test_music_half_a_beat_late_goes_round(batch: Tensors):
    late, lengths = losses.half_a_beat_late(batch), batch.mask.sum(dim=1).long().tolist()
    for row, length in enumerate(lengths):  # eight beats of 3 frames (2 late: halves are rounded to even) or 4
        expected = batch.audio[row, :length].roll({24: 2, 32: 2}[length], dims=0)
        torch.testing.assert_close(late[row, :length], expected)


def test_every_term_has_a_gradient_in_the_generator(bounded: Networks, shard: Shard):
    # A tremor gives the terms for jerk and feet something to say.
    torch.manual_seed(0)
    noise = 0.05 * torch.randn_like(shard.own.motion)
    for name in TERMS:
        bounded.generator.zero_grad()
        output = made(bounded, shard.own)
        ours(bounded, GeneratorOutput(output.motion + noise, output.flat), shard)[name].backward()
        used = [part.grad.abs().max() for part in bounded.generator.parameters() if part.grad is not None]
        assert used and torch.stack(used).max() > 0, name


def test_the_sketch_itself_costs_nothing_but_its_harmony(bounded: Networks, shard: Shard):
    terms = ours(bounded, GeneratorOutput(shard.own.initial, shard.own.initial), shard, gan_weight=0.0)
    assert {name for name, value in terms.items() if float(value)} == {"harmony"}


def test_harmony_of_a_sketch_is_by_pattern_where_there_is_one_and_by_valleys_elsewhere(
    bounded: Networks, shard: Shard, monkeypatch: pytest.MonkeyPatch
):
    measures: list[tuple[str, int]] = []

    def soft(joints: torch.Tensor, *_: Any, params: HarmonyParams, bar_places: Any, **more: Any) -> Any:
        measures.append((params.measure, len(joints)))
        score = torch.full((len(joints),), 0.25)
        return SoftHarmony(score, score, 0 * score, score, score, 1 + 0 * score, 1 + 0 * score)

    monkeypatch.setattr(losses, "soft_harmony", soft)
    found = losses.sketch_harmony(bounded.generator, shard.own.initial, shard.own, RECOMMENDED, 0.5, tiny.PATTERNS)
    assert sorted(measures) == [("hits", 2), ("shape", 2)]
    assert found == pytest.approx(-(0.25 + 2 * 0.25) / 2)


def test_the_body_is_seen_from_its_root(networks: Networks, batch: Tensors):
    joints = losses.body_joints(networks.generator, batch.motion)
    assert torch.equal(joints[:, :, 0], torch.zeros_like(joints[:, :, 0]))
    raised = batch.motion.clone()
    raised[..., 1:-3:3] += torch.rand(*raised.shape[:2], 1)  # a jump
    torch.testing.assert_close(losses.body_joints(networks.generator, raised), joints)


def test_total_is_the_terms_by_weights_of_section_5_2(split: Split, networks: Networks, fabric: Fabric, tmp_path: Path):
    once = replace(PAPER, pretrain_epochs=1, adversarial_epochs=1, batch_size=13)
    pretrain, row = run(fabric, networks, split, once, tmp_path)
    assert pretrain["total"] == pytest.approx(0.1 * pretrain["kl"] + pretrain["mse"], rel=1e-5)
    lambdas = {"kl": 1e-4, "mse": 1e-3, "feature": 1e-3, "harmony": 1.0, "gan": 1e-3}
    assert row["total"] == pytest.approx(sum(weight * row[name] for name, weight in lambdas.items()), rel=1e-5)


# Learning


def run(fabric: Fabric, networks: Networks, split: Split, params: TrainParams, folder: Path, **more: Any) -> list[Any]:
    batching = Batching(params.batch_size, params.shards, params.seed)
    steps = phases(networks, Tensors.of(split.validation), params, folder, {})
    return fit(fabric, steps, Tensors.of(split.train), batching, folder, **more)


@cases("phase, own", ("pretrain", ["generator"]), ("adversarial", ["generator", "cross_domain", "spatial_temporal"]))
def test_a_phase_changes_its_own_networks_alone(
    phase: str, own: list[str], split: Split, networks: Networks, fabric: Fabric, tmp_path: Path
):
    parts = networks.modules() | {"pose_net": networks.pose_net}
    before = {name: weights(part) for name, part in parts.items()}
    epochs = {"pretrain_epochs": 0, "adversarial_epochs": 0, f"{phase}_epochs": 1}
    run(fabric, networks, split, replace(PAPER, **epochs, batch_size=7), tmp_path)
    shares = {name: float((weights(part) != before[name]).float().mean()) for name, part in parts.items()}
    assert [name for name, share in shares.items() if share > 0.95] == own
    assert all(share == 0 for name, share in shares.items() if name not in own)


@pytest.mark.slow
def test_shards_of_a_batch_teach_what_the_batch_teaches(trained: Callable[..., torch.Tensor], tmp_path: Path):
    # 13 units in shards of 5, 4 and 4; rounding differs.
    one, three = trained("one"), trained("three", shards=3)
    assert not torch.equal(one, three)
    torch.testing.assert_close(one, three, rtol=1e-4, atol=1e-5)
    histories = ((tmp_path / name / "history.csv").read_text().splitlines() for name in ("one", "three"))
    errors, in_shards = ([float(row["mse"]) for row in csv.DictReader(history)] for history in histories)
    assert in_shards == pytest.approx(errors, rel=1e-4)


@pytest.mark.slow
def test_one_batch_can_be_learnt_by_heart(split: Split, networks: Networks, batch: Tensors):
    larger = replace(MODEL, hidden=64, pose_features=64)
    generator = Networks.fresh(split.train, Tensors.of(split.train), larger, networks.pose_net, seed=1).generator

    def loss() -> torch.Tensor:
        output = generator(batch.audio, batch.initial)
        return total_loss(pose_terms(generator, output, batch, PAPER), {"kl": 0.1, "mse": 1.0})

    errors = tiny.descent(generator.parameters(), loss, steps=60, rate=5e-3)
    assert errors[-1] < 0.2 * errors[0]


@pytest.mark.slow
@cases("params", PAPER, RECOMMENDED, ids=["paper", "recommended"])
def test_the_harmony_loss_falls_when_it_is_followed(params: TrainParams, networks: Networks, shard: Shard):
    alone = replace(params, feature_weight=0.0, gan_weight=0.0)

    def loss() -> torch.Tensor:
        return generator_terms(networks, made(networks, shard.own), shard, alone, 0.3, tiny.PATTERNS)["harmony"]

    errors = tiny.descent(networks.generator.parameters(), loss, steps=25, rate=3e-3)
    assert np.mean(errors[-5:]) < np.mean(errors[:5]) - 0.1


# Validation


def test_recorded_motion_is_validated_without_error(split: Split, networks: Networks):
    units = Tensors.of(split.validation)
    as_recorded = GeneratorOutput(units.motion, units.motion)
    networks.generator.forward = lambda audio, initial: as_recorded
    found = validate(networks.generator.train(), units, PAPER)
    assert networks.generator.training
    # Nothing differs, so every frame adds epsilon.
    assert found["val_mse"] == pytest.approx(1e-3 * float(units.mask.sum()) / len(units), rel=1e-3)
    names = ("mse", "harmony", "hit_rate", "above_chance", "body_above_chance", "count_ratio", "spread", "turning")
    assert list(found) == [f"val_{name}" for name in names]
    assert found["val_spread"] == found["val_turning"] == pytest.approx(1)
    assert 0 < found["val_hit_rate"] <= 1 and found["val_count_ratio"] > 0


# A whole run


@pytest.fixture(scope="module")
def finished(split: Split, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    folder, rows = tmp_path_factory.mktemp("runs") / "deep" / "run", []
    options = TrainOptions(folder, accelerator="cpu", report=lambda row, end: rows.append(row))
    bank = shipped_bank("puppet")
    train_harmogan(split, options, model=MODEL, params=RECOMMENDED, choreographer=bank, patterns=tiny.PATTERNS)
    return folder, rows


def test_a_run_leaves_what_its_folder_promises(finished: tuple[Path, list[Any]]):
    folder, _ = finished
    names = {path.name for path in folder.iterdir() if not path.name.startswith(("events.out.tfevents.", "."))}
    weights_of = {f"{stem}.{kind}" for stem in ("model", "pretrained", "pose_net") for kind in ("safetensors", "json")}
    assert names == weights_of | {"settings.json", "split.json", "history.csv", "state.safetensors", "sketches"}
    assert len(list(folder.glob("events.out.tfevents.*"))) == 1


def test_everybody_may_read_what_the_umask_allows(finished: tuple[Path, list[Any]], tmp_path: Path):
    (tmp_path / "plain").touch()
    allowed = (tmp_path / "plain").stat().st_mode
    for name in ("settings.json", "split.json", "history.csv", "state.safetensors"):
        assert (finished[0] / name).stat().st_mode == allowed, name


def test_the_history_has_a_row_an_epoch(finished: tuple[Path, list[Any]]):
    folder, _ = finished
    rows = list(csv.DictReader((folder / "history.csv").read_text().splitlines()))
    names = 3 * ["pretrain"] + 3 * ["adversarial"]
    assert [(row["phase"], row["epoch"]) for row in rows] == [*zip(names, "012345", strict=True)]
    terms = TERMS | {"critic_st", "critic_cd", "total"}
    assert all(rows[-1][name] for name in terms | {"rate", "tau", "val_mse", "val_harmony"})
    assert rows[0]["harmony"] == rows[0]["val_mse"] == "" and rows[2]["val_mse"]  # the last pretraining epoch is


def test_every_epoch_is_reported_and_tau_falls_geometrically_in_the_adversarial_ones(finished: tuple[Path, list[Any]]):
    assert [row["phase"] for row in finished[1]] == ["pose network"] + 3 * ["pretrain"] + 3 * ["adversarial"]
    assert [row["tau"] for row in finished[1][-3:]] == pytest.approx([0.5, (0.5 * 0.1) ** 0.5, 0.1])


def test_the_trained_generator_can_be_loaded(finished: tuple[Path, list[Any]], split: Split):
    generator = load_generator(finished[0] / "model")
    assert generator.features == split.train.features
    assert read_about(finished[0] / "model")["meta"]["units"] == 13
    assert load_pose_net(finished[0] / "pose_net").fps == 15.0
    assert not torch.equal(weights(generator), weights(load_generator(finished[0] / "pretrained")))


@pytest.fixture
def trained(split: Split, tmp_path: Path) -> Callable[..., torch.Tensor]:
    """`trained(name, **settings)`: weights after a run of two epochs."""

    def train(name: str, **changes: Any) -> torch.Tensor:
        params = replace(PAPER, **{"pretrain_epochs": 1, "adversarial_epochs": 1, "batch_size": 13, **changes})
        options = TrainOptions(tmp_path / name, accelerator="cpu")
        return weights(train_harmogan(split, options, model=MODEL, params=params))

    return train


@pytest.mark.slow
def test_the_seed_alone_decides_about_chance(trained: Callable[..., torch.Tensor]):
    torch.manual_seed(5)
    first = trained("first")
    torch.manual_seed(6)
    state = torch.random.get_rng_state()
    assert torch.equal(trained("again"), first)
    assert torch.equal(torch.random.get_rng_state(), state)  # others' random numbers are left alone
    assert not torch.equal(trained("other", seed=2), first)


def test_pretraining_taken_over_gives_the_same_as_pretraining_at_once(
    split: Split, tmp_path: Path, trained: Callable[..., torch.Tensor]
):
    # The order of the units follows the epoch's number within a run, so only a run without more pretraining can agree.
    only = replace(PAPER, pretrain_epochs=2, adversarial_epochs=0)
    at_once = train_harmogan(split, TrainOptions(tmp_path / "only", accelerator="cpu"), model=MODEL, params=only)
    over = replace(PAPER, adversarial_epochs=0)
    options = TrainOptions(str(tmp_path / "over"), accelerator="cpu")
    taken = train_harmogan(split, options, model=MODEL, params=over, pretrained=str(tmp_path / "only"))
    assert torch.equal(weights(taken), weights(at_once))
    nets = [load_pose_net(tmp_path / name / "pose_net") for name in ("only", "over")]
    assert torch.equal(weights(nets[0]), weights(nets[1]))


def test_auto_leaves_the_gpu_of_a_mac(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("lightning_fabric.accelerators.MPSAccelerator.is_available", lambda: True)
    assert make_fabric().device.type == ("cuda" if torch.cuda.is_available() else "cpu")


def test_a_machine_without_gpu_says_so():
    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    refused("accelerator cuda: this machine has no GPU that torch can use", make_fabric, accelerator="cuda")
    refused("accelerator cuda: this machine has no GPU", HarmoGAN.train, ["unread"], "run", accelerator="cuda")
