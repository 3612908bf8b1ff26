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
from harmolab.systems import ModelParams, TrainParams
from harmolab.systems.harmogan import losses
from harmolab.systems.harmogan import train as harmogan
from harmolab.systems.harmogan.losses import Danced, danced, discriminator_terms, generator_terms, pose_terms
from harmolab.systems.harmogan.networks import GeneratorOutput, Networks, load_generator
from harmolab.systems.harmogan.train import adversarial_rate, phases, pretrain_rate, train_harmogan, validate
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import local_joints
from harmolab.systems.training.loop import Batching, Tensors, epoch_order, fit, make_fabric, total_loss
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.splits import Split
from tests import tiny_training as tiny
from tests.builders import cases, refused

PAPER: TrainParams = tiny.PAPER
RECOMMENDED: TrainParams = tiny.RECOMMENDED
MODEL: ModelParams = tiny.MODEL
TERMS = {"kl", "mse", "feature", "gan", "harmony", "smoothness", "energy", "foot", "path", "spread"}


@pytest.fixture(scope="module")
def split() -> Split:
    return tiny.tiny_split()


@pytest.fixture(scope="module")
def fabric() -> Fabric:
    return make_fabric(accelerator="cpu")


@pytest.fixture
def networks(split: Split) -> Networks:
    torch.manual_seed(0)
    pose_net = PoseNet(split.train.skeleton, fps=split.train.features.fps).eval().requires_grad_(False)
    return Networks.fresh(split.train, Tensors.of(split.train), MODEL, pose_net, seed=1)


@pytest.fixture(scope="module")
def batch(split: Split) -> Tensors:
    return units_at(split, [0, 1, 2, 3])


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
    rows = run(fabric, networks, split, patient, tmp_path, report=report)
    assert [row["epoch"] for row in rows] == [0, 1, 2, 3]
    assert torch.equal(weights(networks.generator), kept[1])
    assert not torch.equal(kept[1], kept[3])


def test_patience_shorter_than_the_way_to_the_first_validation_waits_for_it(
    networks: Networks, split: Split, fabric: Fabric, tmp_path: Path
):
    hasty = replace(PAPER, pretrain_epochs=9, adversarial_epochs=0, patience=1)
    rows = run(fabric, networks, split, hasty, tmp_path)
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


def test_terms_are_those_of_equation_32_and_ours_are_five_more(networks: Networks, batch: Tensors):
    made, paper = danced(networks.generator, batch), {"kl", "mse", "feature", "gan", "harmony"}
    ablation = replace(PAPER, harmony_weight=0.0)
    for params, terms in ((PAPER, paper), (ablation, paper - {"harmony"}), (RECOMMENDED, TERMS)):
        assert set(generator_terms(networks, made, batch, params, 0.5)) == terms
    assert set(pose_terms(networks.generator, made.own, batch, PAPER)) == {"kl", "mse"}
    assert set(discriminator_terms(networks, made, batch, PAPER)) == {"critic_cd", "critic_st"}


def test_a_skeleton_without_named_feet_has_no_foot_term(networks: Networks, batch: Tensors):
    skeleton = networks.generator.skeleton
    networks.generator.skeleton = replace(skeleton, joints=tuple(f"joint{joint}" for joint in range(5)))
    assert "foot" not in generator_terms(networks, danced(networks.generator, batch), batch, RECOMMENDED, 0.5)


def test_half_of_what_needs_no_answer_may_come_from_going_on(networks: Networks, batch: Tensors, split: Split):
    others = units_at(split, [1, 2, 3, 0])
    later = others.continued_from(batch.motion, batch.mask)
    own = generator_terms(networks, danced(networks.generator, batch), batch, PAPER, 0.5)
    after = generator_terms(networks, danced(networks.generator, later), later, PAPER, 0.5)
    both = generator_terms(networks, danced(networks.generator, batch, others), batch, PAPER, 0.5)
    for name in ("gan", "harmony"):
        torch.testing.assert_close(both[name], (own[name] + after[name]) / 2)
    for name in ("kl", "mse", "feature"):
        torch.testing.assert_close(both[name], own[name])


def test_a_dance_grows_batch_by_batch_also_into_a_smaller_one(networks: Networks, batch: Tensors, split: Split):
    next_units, small, few = (units_at(split, numbers) for numbers in ([1, 2, 3, 0], [0, 1], [2, 3]))
    first = danced(networks.generator, batch, next_units)
    later, _ = danced(networks.generator, small, few, first).later
    expected = few.continued_from(first.later[1][:2], first.later[0].mask[:2])
    torch.testing.assert_close(later.initial, expected.initial)
    assert not later.initial.requires_grad


def test_the_discriminator_of_movement_sees_what_goes_on(networks: Networks, batch: Tensors, split: Split):
    both = danced(networks.generator, batch, units_at(split, [1, 2, 3, 0]))
    alone, seen = (discriminator_terms(networks, made, batch, PAPER) for made in (Danced(both.own), both))
    later, after = both.later
    judge = networks.spatial_temporal
    more = losses.discriminator_loss(judge(batch.motion, batch.mask), judge(after, later.mask))
    torch.testing.assert_close(seen, {**alone, "critic_st": (alone["critic_st"] + more) / 2})
    assert not torch.equal(more, alone["critic_st"])


def test_a_discriminator_that_is_not_heard_is_not_trained(networks: Networks, batch: Tensors):
    made = danced(networks.generator, batch)
    assert set(discriminator_terms(networks, made, batch, RECOMMENDED)) == {"critic_st"}
    heard = {id(parameter) for parameter in networks.discriminators(RECOMMENDED)}
    assert heard == {id(parameter) for parameter in networks.spatial_temporal.parameters()}
    assert len(networks.discriminators(PAPER)) > len(heard)


def test_going_on_begins_with_the_last_frames_and_then_their_mean():
    motion = torch.arange(12.0).reshape(1, 12, 1)
    mask = (torch.arange(12) < 10).float()[None]  # frames 10 and 11 are padding
    index = torch.tensor([[1.0] * 3 + [0.0] * 5])
    none = torch.zeros(1, 8, 1)
    units = Tensors(none, none, none, index, torch.ones(1, 8), torch.zeros(1, 1), torch.zeros(1, 1), torch.zeros(1, 1))
    assert units.continued_from(motion, mask).initial[0, :, 0].tolist() == [7.0, 8.0, 9.0] + [8.0] * 5


@pytest.mark.parametrize("params", [PAPER, RECOMMENDED], ids=["paper", "recommended"])
def test_going_on_from_less_than_the_beats_before_is_finite(params: TrainParams, networks: Networks, split: Split):
    batch = units_at(split, [0, 1])
    short = replace(batch, mask=(torch.arange(batch.mask.shape[1]) < 9).float().expand_as(batch.mask))
    harmony = generator_terms(networks, danced(networks.generator, short, short), short, params, 0.5)["harmony"]
    gradients = torch.autograd.grad(harmony, list(networks.generator.parameters()))
    assert harmony.isfinite() and all(bool(gradient.isfinite().all()) for gradient in gradients)


def test_every_term_has_a_gradient_in_the_generator(networks: Networks, batch: Tensors):
    names = generator_terms(networks, danced(networks.generator, batch), batch, RECOMMENDED, 0.5)
    # A tremor gives the terms for jerk and feet something to say.
    torch.manual_seed(0)
    noise = 0.05 * torch.randn_like(batch.motion)
    for name in names:
        networks.generator.zero_grad()
        made = danced(networks.generator, batch)
        made = Danced(GeneratorOutput(made.own.motion + noise, made.own.flat))
        generator_terms(networks, made, batch, RECOMMENDED, 0.5)[name].backward()
        used = [part.grad.abs().max() for part in networks.generator.parameters() if part.grad is not None]
        assert used and torch.stack(used).max() > 0, name


def changed(batch: Tensors, part: slice, frames: torch.Tensor) -> Danced:
    """The recorded motion, but for noise on some channels at the frames (N, T) that are 1."""
    torch.manual_seed(0)
    noise = torch.zeros_like(batch.motion)
    noise[..., part] = 0.2 * torch.randn_like(noise[..., part])
    motion = batch.motion + noise * frames[..., None]
    return Danced(GeneratorOutput(motion, local_joints(motion)[..., :2]))


JOINTS, PATH = slice(None, -3), slice(-3, None)


@pytest.mark.parametrize(("frame", "same"), [("body", True), ("room", False)])
def test_harmony_of_the_body_is_the_same_on_any_path(networks: Networks, batch: Tensors, frame: str, same: bool):
    params = replace(RECOMMENDED, harmony_frame=frame)
    still, moved = (
        generator_terms(networks, changed(batch, PATH, frames), batch, params, 0.5)
        for frames in (torch.zeros_like(batch.mask), batch.mask)
    )
    for name in ("harmony", "energy"):
        assert (float(moved[name]) == pytest.approx(float(still[name]), abs=1e-6)) == same, name
    assert moved["path"] > still["path"] == 0
    assert moved["spread"] == still["spread"]


def test_path_and_spread_look_at_the_meter_alone(networks: Networks, batch: Tensors):
    before = generator_terms(networks, changed(batch, slice(None), batch.index), batch, RECOMMENDED, 0.5)
    within = generator_terms(networks, changed(batch, slice(None), 1 - batch.index), batch, RECOMMENDED, 0.5)
    assert before["path"] == 0 and within["path"] > 0
    assert before["spread"] < 1e-5 < within["spread"]


def test_the_body_is_seen_from_its_root(networks: Networks, batch: Tensors):
    joints = losses.body_joints(networks.generator, batch.motion)
    assert torch.equal(joints[:, :, 0], torch.zeros_like(joints[:, :, 0]))
    raised = batch.motion.clone()
    raised[..., 1:-3:3] += torch.rand(*raised.shape[:2], 1)  # a jump
    torch.testing.assert_close(losses.body_joints(networks.generator, raised), joints)


def test_total_is_the_terms_by_the_weights_of_section_5_2(
    split: Split, networks: Networks, fabric: Fabric, tmp_path: Path
):
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


def test_shards_of_a_batch_teach_what_the_batch_teaches(trained: Callable[..., torch.Tensor], tmp_path: Path):
    # 13 units in shards of 5, 4 and 4; rounding differs.
    one, three = trained("one"), trained("three", shards=3)
    assert not torch.equal(one, three)
    torch.testing.assert_close(one, three, rtol=1e-4, atol=1e-5)
    histories = ((tmp_path / name / "history.csv").read_text().splitlines() for name in ("one", "three"))
    errors, in_shards = ([float(row["mse"]) for row in csv.DictReader(history)] for history in histories)
    assert in_shards == pytest.approx(errors, rel=1e-4)


def test_one_batch_can_be_learnt_by_heart(split: Split, networks: Networks, batch: Tensors):
    larger = replace(MODEL, hidden=64, pose_features=64)
    generator = Networks.fresh(split.train, Tensors.of(split.train), larger, networks.pose_net, seed=1).generator

    def loss() -> torch.Tensor:
        output = generator(batch.audio, batch.initial)
        return total_loss(pose_terms(generator, output, batch, PAPER), {"kl": 0.1, "mse": 1.0})

    errors = tiny.descent(generator.parameters(), loss, steps=60, rate=5e-3)
    assert errors[-1] < 0.2 * errors[0]


@cases("params", PAPER, RECOMMENDED, ids=["paper", "recommended"])
def test_the_harmony_loss_falls_when_it_is_followed(params: TrainParams, networks: Networks, batch: Tensors):
    alone = replace(params, **{f"{name}_weight": 0.0 for name in TERMS - {"kl", "mse", "harmony"}})

    def loss() -> torch.Tensor:
        return generator_terms(networks, danced(networks.generator, batch), batch, alone, 0.3)["harmony"]

    errors = tiny.descent(networks.generator.parameters(), loss, steps=25, rate=3e-3)
    assert np.mean(errors[-5:]) < np.mean(errors[:5]) - 0.1


# Validation


def test_recorded_motion_is_validated_without_error(split: Split, networks: Networks):
    units = Tensors.of(split.validation)
    networks.generator.forward = lambda audio, initial: GeneratorOutput(
        units.motion, units.motion
    )  # dances as recorded
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
    train_harmogan(split, options, model=MODEL, params=RECOMMENDED)
    return folder, rows


def test_a_run_leaves_what_its_folder_promises(finished: tuple[Path, list[Any]]):
    folder, _ = finished
    names = {path.name for path in folder.iterdir() if not path.name.startswith(("events.out.tfevents.", "."))}
    weights_of = {f"{stem}.{kind}" for stem in ("model", "pretrained", "pose_net") for kind in ("safetensors", "json")}
    others = {"settings.json", "split.json", "history.csv", "state.safetensors", "model_poses.safetensors"}
    assert names == weights_of | others
    assert len(list(folder.glob("events.out.tfevents.*"))) == 1


def test_everybody_may_read_what_the_umask_allows(finished: tuple[Path, list[Any]], tmp_path: Path):
    (tmp_path / "plain").touch()
    allowed = (tmp_path / "plain").stat().st_mode
    for name in ("settings.json", "split.json", "history.csv", "state.safetensors"):
        assert (finished[0] / name).stat().st_mode == allowed, name


def test_the_history_has_a_row_an_epoch(finished: tuple[Path, list[Any]]):
    folder, _ = finished
    rows = list(csv.DictReader((folder / "history.csv").read_text().splitlines()))
    assert [(row["phase"], row["epoch"]) for row in rows] == [
        *(("pretrain", str(epoch)) for epoch in range(3)),
        *(("adversarial", str(epoch)) for epoch in range(3, 6)),
    ]
    terms = TERMS | {"critic_st", "total"}
    assert "critic_cd" not in rows[-1]  # its weight is 0
    assert all(rows[-1][name] for name in terms | {"rate", "tau", "val_mse", "val_harmony"})
    assert rows[0]["harmony"] == rows[0]["val_mse"] == "" and rows[2]["val_mse"]  # the last pretraining epoch is


def test_every_epoch_is_reported_and_tau_falls_geometrically_in_the_adversarial_ones(finished: tuple[Path, list[Any]]):
    assert [row["phase"] for row in finished[1]] == ["pose network"] + 3 * ["pretrain"] + 3 * ["adversarial"]
    softness = [row["tau"] for row in finished[1][-3:]]
    assert softness == pytest.approx([0.5, (0.5 * 0.05) ** 0.5, 0.05])


def test_the_trained_generator_can_be_loaded(finished: tuple[Path, list[Any]], split: Split):
    generator = load_generator(finished[0] / "model")
    assert generator.features == split.train.features
    assert read_about(finished[0] / "model")["meta"]["units"] == 13
    assert load_pose_net(finished[0] / "pose_net").fps == 15.0
    before = load_generator(finished[0] / "pretrained")
    assert not torch.equal(weights(generator), weights(before))


@pytest.fixture
def trained(split: Split, tmp_path: Path) -> Callable[..., torch.Tensor]:
    """`trained(name, **settings)`: weights after a run of two epochs."""

    def train(name: str, **changes: Any) -> torch.Tensor:
        params = replace(PAPER, **{"pretrain_epochs": 1, "adversarial_epochs": 1, "batch_size": 13, **changes})
        options = TrainOptions(tmp_path / name, accelerator="cpu")
        return weights(train_harmogan(split, options, model=MODEL, params=params))

    return train


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


def test_a_machine_without_gpu_says_so():
    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    refused("accelerator cuda: this machine has no GPU that torch can use", make_fabric, accelerator="cuda")
