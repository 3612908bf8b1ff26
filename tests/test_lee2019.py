"""Lee et al. 2019: pieces and the warp back, networks, loss terms, training, dancing; every reading of it, once."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from lightning_fabric import Fabric
from torch import Tensor

from harmolab import Skeleton
from harmolab.systems import FeatureParams, LeeParams
from harmolab.systems.lee2019 import networks as lee
from harmolab.systems.lee2019 import train
from harmolab.systems.lee2019.networks import DancingToMusic, line
from harmolab.systems.training import loop as training_loop
from harmolab.systems.training import network_system
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import parameter_count
from harmolab.systems.training.loop import Shard, step
from harmolab.systems.training.song_to_dance import DanceInput
from harmolab.systems.training.units import DanceUnit, MeterFrames, UnitSet, load_units
from harmolab.systems.training.weights import load_weights
from study.experiments import rivals
from study.experiments.rivals import entry_lee2019
from tests.builders import bobbing, cases, refused
from tests.tiny_training import DANCER, FPS, Stopped, descent, stopping, tiny_split

PARAMS = LeeParams(
    hidden=16, latent=6, pose_latent=4, pose_hidden=8, style=5, noise=3, style_layers=(8,), regressor_layers=(8,),
    critic_layers=(12, 6), style_epochs=2, unit_epochs=3, composition_epochs=2, batch_size=8,
)  # fmt: skip
SPLIT, N_MOTION = tiny_split(beat_channels=False), 18


@pytest.fixture
def network() -> DancingToMusic:
    return made_network()


def made_network(**changes: Any) -> DancingToMusic:
    params = replace(PARAMS, **changes)
    codes = lee.piece_set(SPLIT.train, beats=params.beats, sequence=params.sequence)
    return train.initial_network(SPLIT.train, codes, params)


@pytest.fixture
def pieces(network: DancingToMusic) -> train.Pieces:
    return train.split_pieces(network, SPLIT.train)


# Sizes


@cases(
    "part, millions",
    (lambda params: lee.PoseCoder(params, 28), 0.015),
    (lambda params: lee.MovementCoder(params, 28), 8.58),
    (lambda params: lee.UnitDecoder(params, 28), 6.34),
    (lee.DanceCoder, 7.35),
    (lee.DanceDecoder, 7.35),
    (lambda params: lee.MusicStyle(params, 28, 3), 0.006),
    (lee.StyleCoder, 0.15),
    (lambda params: lee.Critic(params, 3 * 2 * 512, 28), 3.82),
    (lambda params: lee.Critic(params, 2 * 512, 28), 1.72),
    ids=["pose", "movement", "unit", "dance", "dances", "music", "style", "units' critic", "dances' critic"],
)
def test_each_part_has_the_released_number_of_parameters(part: Callable[[LeeParams], Any], millions: float):
    with torch.device("meta"):
        assert parameter_count(part(LeeParams.paper())) / 1e6 == pytest.approx(millions, rel=0.12, abs=0.006)


def built(params: LeeParams, joints: int, n_mfcc: int) -> DancingToMusic:
    with torch.device("meta"):
        lengths, features = torch.zeros(joints, device="cpu"), FeatureParams(n_mfcc=n_mfcc)
        return DancingToMusic(params, Skeleton.unnamed(joints), lengths, features=features, dances="abc")


def test_the_released_sizes_generate_with_13_85_million_parameters():
    assert built(LeeParams.paper(), 8, 28).parameter_count() / 1e6 == pytest.approx(13.85, abs=0.01)  # 27 pose numbers


def test_the_small_sizes_generate_with_1_72_million_and_train_with_3_74():
    network = built(LeeParams.small(), 23, 20)
    taught = parameter_count(network.movements) + parameter_count(network.dance_coder)
    assert network.parameter_count() / 1e6 == pytest.approx(1.72, abs=0.015)
    assert (network.parameter_count() + taught) / 1e6 == pytest.approx(3.74, abs=0.015)


def test_our_motion_code_is_what_goes_in_and_out(network: DancingToMusic):
    assert network.n_motion == 3 * len(DANCER.joints) + 3 == N_MOTION
    code = torch.from_numpy(SPLIT.train.units[0].motion)[None]
    torch.testing.assert_close(network.motion(network.standardised(code)), code, atol=2e-5, rtol=0)


def test_numbers_are_in_standard_deviations_of_shifted_training_pieces(network: DancingToMusic, pieces: train.Pieces):
    many = pieces.poses.flatten(0, 1).repeat(400, 1, 1)
    moved = train.shifted(network, many, torch.Generator().manual_seed(1)).flatten(0, 1)
    varied = network.pose_scale.std > 2e-3
    torch.testing.assert_close(moved.mean(dim=0)[varied], torch.zeros(int(varied.sum())), atol=0.05, rtol=0)
    torch.testing.assert_close(moved.std(dim=0)[varied], torch.ones(int(varied.sum())), atol=0.05, rtol=0)


@pytest.mark.parametrize("change", [{"clip": 0.0}, {"beats": "offbeat"}, {"critic_layers": ()}, {"still": -1.0}])
def test_settings_out_of_range_are_refused_by_name(change: dict[str, Any]):
    refused(next(iter(change)), replace, PARAMS, **change)


# Pieces


def ramp_code(frames: int, channels: int = 6) -> np.ndarray:
    """A code whose joints tell the frame; its path goes one unit a frame."""
    code = np.repeat(np.arange(frames, dtype=float)[:, None], channels, axis=1)
    code[:, -3:] = 1.0
    return code


def unit_of(code: np.ndarray, beats: np.ndarray) -> DanceUnit:
    return replace(
        SPLIT.train.units[0], audio=np.zeros((len(code), 4), np.float32), motion=code.astype(np.float32),
        index=(np.arange(len(code)) < 4).astype(np.float32), beats=beats, strengths=np.ones(len(beats)),
    )  # fmt: skip


UNEVEN = np.array([0.0, 0.5, 1.1, 1.5, 2.0, 2.7, 3.1, 3.6])  # seconds


def test_beats_of_a_unit_lie_at_frames_3_11_19_and_27_of_its_two_pieces():
    one, two = lee.unit_pieces(unit_of(ramp_code(64), UNEVEN), bobbing(0.0), "music", 2)
    np.testing.assert_allclose(one[[3, 11, 19, 27], 0], UNEVEN[:4] * FPS, atol=1e-5)
    np.testing.assert_allclose(two[[3, 11, 19, 27], 0], UNEVEN[4:] * FPS, atol=1e-5)
    assert one.shape == two.shape == (32, 6)
    # None of the path is lost in the steps from beat 0 to beat 7, and before its first frame it goes on backwards.
    between = np.concatenate([one, two])[4 : 3 + 8 * 7 + 1, -1]
    assert between.sum() == pytest.approx(UNEVEN[7] * FPS, rel=1e-6)
    np.testing.assert_allclose(one[:4, 0], np.arange(-3, 1) * 7.5 / 8, atol=1e-5)
    np.testing.assert_allclose(one[:4, -1], 7.5 / 8, atol=1e-5)


def test_a_unit_of_too_few_beats_is_named():
    refused("unit0: 3 pieces need 12 beats, this unit has 8", lee.piece_set, SPLIT.train, beats="music", sequence=3)


def test_a_rest_within_a_quarter_of_a_period_is_the_beat_else_the_music_is():
    resting = bobbing(0.1, fps=60.0, seconds=4.0)  # rests at .1, .6, 1.1 ...
    np.testing.assert_allclose(lee.rest_times(np.array([0.5, 1.5, 2.5]), resting), [0.6, 1.6, 2.6], atol=0.02)
    far = np.array([0.5, 0.7, 0.88])  # a quarter of .2 s does not reach to .6
    np.testing.assert_array_equal(lee.rest_times(far, resting), far)


def test_kinematic_beats_of_a_piece_are_its_rests():
    beats, resting = 0.5 * np.arange(8.0), bobbing(0.07, fps=60.0, seconds=4.5)
    unit = unit_of(ramp_code(64), beats)
    kinematic, music = (lee.unit_pieces(unit, resting, name, 2)[1] for name in ("kinematic", "music"))
    np.testing.assert_allclose((kinematic - music)[[3, 11, 19], 0] / FPS, 0.07, atol=0.02)


@pytest.mark.parametrize("bpm", [60, 97.3, 112.5, 150, 220])
def test_canonical_beats_lie_within_a_millisecond_of_the_musics(bpm: float):
    beats = 60 / bpm * FPS * np.arange(-2, 40) + 1.234
    start = lee.beats_from(beats, 0.0)
    frames = np.arange(int(beats[30]))
    told = lee.laid_on_beats(ramp_code(400), start, frames, first=-1)[:, 0]  # the canonical frame that is shown
    inside = start[(start > 0) & (start < frames[-1])]
    numbers = np.flatnonzero((start > 0) & (start < frames[-1])) - 1
    times = np.interp(3 + 8 * numbers, told, frames)
    assert len(times) > 20
    # Between two frames the picture is a straight line; a beat of another interval bends it by less than a frame.
    np.testing.assert_allclose(times / FPS, inside / FPS, atol=1e-3)


def test_uneven_beats_are_met_exactly_where_the_warp_is_asked():
    beats = np.array([-4.0, 3.3, 9.1, 21.7, 25.0])
    np.testing.assert_allclose(line(beats, beats, lee.canonical(5, first=-1)), [-5, 3, 11, 19, 27], atol=1e-12)
    laid = lee.laid_on_beats(ramp_code(40), beats, beats[1:], first=-1)[:, 0]
    np.testing.assert_allclose(laid, [3, 11, 19, 27], atol=1e-9)


def test_pieces_laid_on_their_own_beats_are_the_recorded_movement():
    assert np.mean(errors_of(SPLIT.train, "kinematic", SPLIT.train.units)) < 0.01  # metres


def errors_of(units: UnitSet, beats: str, some: Sequence[DanceUnit]) -> list[float]:
    """Mean distance (m) of some units from themselves, cut into pieces and laid on their own beats again."""
    errors = []
    for unit in some:
        motion = units.decoded(unit.motion.astype(float))
        frames = (lee.rest_times(unit.beats, motion) if beats == "kinematic" else unit.beats) * unit.fps
        code = lee.unit_pieces(unit, motion, beats, 2).reshape(64, -1)
        at = np.arange(int(np.ceil(frames[0])), int(frames[-1]) + 1)
        pair = [units.decoded(each).positions for each in (lee.laid_on_beats(code, frames, at), unit.motion[at])]
        errors.append(float(np.linalg.norm(pair[0] - pair[1], axis=-1).mean()))
    return errors


# Networks and terms


def test_the_recurrent_layer_of_a_constant_is_torchs_own(network: DancingToMusic):
    unrolled = network.unit_decoder.unrolled
    first, value = torch.randn(3, 10), torch.randn(3, 6)
    states = [unrolled.first(first)]
    for _ in range(5):
        states.append(unrolled.cell(value, states[-1]))
    torch.testing.assert_close(unrolled(first, value, 5), unrolled.after(torch.stack(states[1:], dim=1)))


def test_padding_does_not_change_the_style(network: DancingToMusic):
    audio, mask = torch.randn(1, 20, 4), torch.ones(1, 20)
    padded = torch.cat([audio, torch.full((1, 7, 4), 9.0)], dim=1)
    longer = torch.cat([mask, torch.zeros(1, 7)], dim=1)
    torch.testing.assert_close(network.music(audio, mask), network.music(padded, longer))


def test_divergence_is_summed_over_a_code_and_averaged_over_a_batch():
    code = lee.Code(torch.tensor([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]), torch.zeros(2, 3))
    assert float(train.divergence(code)) == pytest.approx(0.5 * (3 * 0.5))
    wide = lee.Code(torch.zeros(1, 2), torch.full((1, 2), float(np.log(4.0))))
    assert float(train.divergence(wide)) == pytest.approx(2 * 0.5 * (4 - 1 - np.log(4.0)))


@pytest.mark.parametrize("epochs", [10, 270, 1000])
def test_the_ramp_has_its_midpoint_at_30_percent_of_any_number_of_epochs(epochs: int):
    params = replace(PARAMS, unit_epochs=epochs)
    shares = (np.arange(epochs) + 0.5) / epochs
    weights = np.array([train.ramp(epoch, params) for epoch in range(epochs)]) / params.kl_weight
    np.testing.assert_allclose(weights, 1 / (1 + np.exp(-(shares - 0.3) / 0.04)), rtol=1e-9)
    assert weights[0] < 0.01 and weights[-1] > 0.999


def test_a_shift_is_one_offset_of_all_joints_and_is_taken_off_again(network: DancingToMusic, pieces: train.Pieces):
    poses = pieces.poses.flatten(0, 1)
    moved = train.shifted(network, poses, torch.Generator().manual_seed(2))
    offsets = ((moved - poses) * network.pose_scale.std)[..., :3]  # the root is the first joint
    assert float(offsets[..., 0].abs().max()) <= 0.4 and float(offsets[..., 1].abs().max()) <= 0.16
    assert float(offsets[..., 0].abs().max()) > 0.2 and float(offsets[..., 2].abs().max()) == 0
    torch.testing.assert_close(offsets.amax(dim=1), offsets.amin(dim=1), atol=1e-5, rtol=0)  # constant over the unit
    plain, back = (network.motion(each).unflatten(-1, (-1, 3))[..., :-1, :] for each in (poses, moved))
    raised = (back - plain)[..., 1]
    torch.testing.assert_close(back[..., (0, 2)], plain[..., (0, 2)], atol=1e-5, rtol=0)
    torch.testing.assert_close(raised, raised[..., :1].expand_as(raised), atol=1e-5, rtol=0)


def test_units_are_decoded_with_either_shifts_movement_but_their_own_place(
    network: DancingToMusic, pieces: train.Pieces, monkeypatch: pytest.MonkeyPatch
):
    fed: list[tuple[Tensor, Tensor]] = []
    decode = network.unit_decoder.forward
    monkeypatch.setattr(network.unit_decoder, "forward", lambda *inputs: fed.append(inputs) or decode(*inputs))
    output = train.coded_units(network, pieces.take(torch.arange(3)))
    (place, movement), n = fed[0], 6
    assert torch.equal(place[: 2 * n], place[2 * n :])
    assert torch.equal(movement[: 2 * n], output.drawn)
    assert torch.equal(movement[2 * n :], torch.cat([output.drawn[n:], output.drawn[:n]]))


def test_errors_are_summed_over_shifts_and_the_ramp_weighs_divergences(network: DancingToMusic, pieces: train.Pieces):
    with torch.no_grad():
        output = train.coded_units(network, pieces.take(torch.arange(3)))
    terms, half = train.unit_terms(output, 0.01), train.unit_terms(output, 0.005)
    each = [(output.own - output.poses)[part].abs().mean() for part in (slice(6), slice(6, 12))]
    assert float(terms["own"]) == pytest.approx(float(sum(each)), rel=1e-5)
    assert float(terms["kl"]) == pytest.approx(2 * float(half["kl"])) and float(terms["nats"]) > float(terms["kl"])


def test_noise_is_drawn_by_the_units_of_a_batch_and_their_order(network: DancingToMusic, pieces: train.Pieces):
    one, again, other = (pieces.take(torch.tensor(rows)) for rows in ([0, 1, 2], [0, 1, 2], [2, 1, 0]))
    assert one.draw == again.draw != other.draw != pieces.take(torch.tensor([0, 1, 2]), 1, 2).draw
    assert torch.equal(train.coded_units(network, one).own, train.coded_units(network, again).own)


def test_the_style_of_both_kinds_of_dance_is_part_of_the_composers_loss(network: DancingToMusic, pieces: train.Pieces):
    batch = pieces.take(torch.arange(4))
    with torch.no_grad():
        output = train.composed(network, batch)
        terms = train.composition_terms(network, output, batch)
        codes = (output.real_drawn, output.fake_drawn)
        errors = [(network.regressor(code) - output.style).square().mean() for code in codes]
    assert float(terms["style"]) == pytest.approx(float(sum(errors)), rel=1e-5)
    composer = train.phases(network, pieces, replace(PARAMS, style_weight=0.25))[2].players[1]
    assert composer.weights["style"] == 0.25 and set(composer.weights) == set(terms)


def test_an_unknown_dance_is_a_class_of_its_own():
    units = [replace(unit, dance="" if number % 2 else "rumba") for number, unit in enumerate(SPLIT.train.units)]
    unlike = replace(SPLIT.train, units=tuple(units))
    codes = lee.piece_set(unlike, beats="music", sequence=2)
    network = train.initial_network(unlike, codes, PARAMS)
    assert network.dances == ("", "rumba")
    numbers = [number % 2 ^ 1 for number in range(len(units))]
    assert train.piece_tensors(network, unlike, codes, "cpu").dance.tolist() == numbers
    assert train.split_pieces(network, SPLIT.test).dance.tolist() == [-1, -1, -1]  # waltz, which it does not know


# Training


def copied(network: DancingToMusic) -> dict[str, Tensor]:
    return {name: value.detach().clone() for name, value in network.named_parameters()}


def stepped(network: DancingToMusic, number: int, pieces: train.Pieces) -> dict[str, Tensor]:
    """Parameters by name after one batch of a phase; `number` says which."""
    phase, shard = train.phases(network, pieces, PARAMS)[number], Shard(pieces, pieces, 1.0)
    output, row = phase.forward(shard, None), {"kl_weight": 0.01}
    for player in phase.players:
        terms = player.terms(output, shard, row)
        total = torch.stack([player.weights[name] * value for name, value in terms.items()]).sum()
        optimiser = torch.optim.Adam(player.parameters, lr=phase.rate(0))
        for group in optimiser.param_groups:
            group["lr"] = phase.rate(0) * group.get("share", 1.0)
        step(Fabric(accelerator="cpu"), [{"total": total}], [shard], optimiser, clip=player.clip)
    return copied(network)


@cases(
    "number, taught",
    (0, {"music"}),
    (1, {"poses", "movements", "unit_decoder"}),
    (2, {"unit_critic", "dance_critic", "dance_coder", "dance_decoder", "style_coder", "regressor", "unit_decoder"}),
    ids=["style", "units", "composition"],
)
def test_a_phase_changes_its_own_parts_and_no_frozen_ones(
    number: int, taught: set[str], network: DancingToMusic, pieces: train.Pieces
):
    before, after = copied(network), stepped(network, number, pieces)
    changed = {name.partition(".")[0] for name in before if not torch.equal(before[name], after[name])}
    assert changed <= taught
    assert number == 0 or changed == taught  # all units of the tiny split are waltzes: nothing to tell apart


def test_while_composing_the_unit_decoder_learns_at_a_tenth_of_the_rate(network: DancingToMusic, pieces: train.Pieces):
    before, after = copied(network), stepped(network, 2, pieces)
    for part, rate in (("dance_decoder", PARAMS.rate), ("unit_decoder", PARAMS.rate / 10)):
        # The first step of Adam is the rate, for every number with a gradient.
        largest = max(float((after[name] - before[name]).abs().max()) for name in before if name.startswith(part))
        assert largest == pytest.approx(rate, rel=0.01), part


@pytest.mark.parametrize(("clip", "norm"), [(None, 5.0), (10.0, 5.0), (0.5, 0.5)])
def test_a_gradient_is_not_longer_than_the_clip(clip: float | None, norm: float):
    weights = torch.nn.Parameter(torch.zeros(2))
    optimiser, total = torch.optim.SGD([weights], lr=1.0), (weights * torch.tensor([3.0, 4.0])).sum()
    step(Fabric(accelerator="cpu"), [{"total": total}], [Shard(None, None, 1.0)], optimiser, clip=clip)
    assert float(weights.detach().norm()) == pytest.approx(norm, rel=1e-4)


@pytest.mark.slow
def test_one_batch_is_learnt_by_heart(pieces: train.Pieces):
    torch.manual_seed(0)
    network = made_network(hidden=32)
    parts, batch = (network.poses, network.movements, network.unit_decoder), pieces.take(torch.arange(2))

    def loss() -> Tensor:
        terms = train.unit_terms(train.coded_units(network, batch), 0.0)
        return terms["own"] + terms["cross"]

    errors = descent([value for part in parts for value in part.parameters()], loss, steps=100, rate=1e-2)
    assert errors[-1] < 0.4 * errors[0]


def trained(folder: Path, params: LeeParams = PARAMS, **options: Any) -> DancingToMusic:
    return train.train_lee2019(SPLIT, TrainOptions(folder, accelerator="cpu", **options), params)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    trained(folder := tmp_path_factory.mktemp("runs") / "lee")
    return folder


def rows(folder: Path) -> list[list[str]]:
    return [row.split(",") for row in (folder / "history.csv").read_text().splitlines()]


def test_a_run_has_three_phases_and_ends_with_weights_that_load(run: Path):
    header, *epochs = rows(run)
    assert [row[0] for row in epochs] == 2 * ["style"] + 3 * ["units"] + 2 * ["composition"]
    units = {"own", "cross", "single", "same", "nats"}
    assert {"dance", *units, "critic_units", "gan", "val_style", "val_error"} <= set(header)
    assert load_weights(run, DancingToMusic).params == PARAMS


def test_a_training_that_cannot_be_ends_there_and_says_why(tmp_path: Path):
    refused("step must be a whole number, not negative, got '2'", train.Lee2019.train, [tmp_path], tmp_path, step="2")
    refused(f"{tmp_path}: units epoch 3: the training has diverged", trained, tmp_path, replace(PARAMS, rate=1e30))


@pytest.mark.slow
@pytest.mark.parametrize("last", [3, 5], ids=["units", "composition"])
def test_a_stopped_run_goes_on_to_the_same_bits(last: int, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(training_loop, "SAVING_SHARE", float("inf"))
    with pytest.raises(Stopped):
        trained(tmp_path / "run", report=stopping(last))
    trained(tmp_path / "run", resume=True)
    for file in ("history.csv", "model.safetensors"):
        assert (tmp_path / "run" / file).read_bytes() == (run / file).read_bytes()


# Dancing


def dance_input(song: float = 0.0) -> DanceInput:
    return DanceInput(
        audio=np.zeros((112, 4), np.float32), song=lambda: np.full((40, 4), song, np.float32),
        beats=np.arange(-20, 40) * 7.0, meters=[MeterFrames(-12, 0, 100, 1.0)],
        prior=SPLIT.train.units[0].motion[:12].astype(float), n_frames=100,
    )  # fmt: skip


def test_the_style_of_the_whole_song_is_heard(network: DancingToMusic):
    assert np.abs(network.code(dance_input(song=3.0), 1) - network.code(dance_input(), 1)).max() > 1e-4


def test_units_share_noise_by_threes_and_go_on_from_last_pose(network: DancingToMusic, monkeypatch: pytest.MonkeyPatch):
    starts: list[Tensor] = []
    whole = lee.moving_sequence
    monkeypatch.setattr(lee, "moving_sequence", lambda *parts: starts.append(parts[2]) or whole(*parts))
    assert lee.composed_units(network, dance_input(), 7, 1).shape == (7 * 32, N_MOTION) and len(starts) == 3
    torch.testing.assert_close(starts[0], network.standardised(torch.from_numpy(SPLIT.train.units[0].motion[11:12])))


@pytest.mark.parametrize(("still", "draws"), [(0.0, 1), (1e6, 21)])
def test_still_sequences_are_redrawn_twenty_times_at_most(still: float, draws: int, monkeypatch: pytest.MonkeyPatch):
    network, drawn = made_network(still=still), []
    whole = lee.drawn_sequence
    monkeypatch.setattr(lee, "drawn_sequence", lambda *parts: drawn.append(parts) or whole(*parts))
    lee.composed_units(network, dance_input(), 3, 1)
    assert len(drawn) == draws


def jump(network: DancingToMusic) -> float:
    """Largest change of step at the border of two units."""
    return float(np.abs(np.diff(lee.composed_units(network, dance_input(), 3, 1)[30:33], n=2, axis=0)).max())


def test_units_go_on_from_each_other_without_a_jump(network: DancingToMusic):
    assert jump(network) < 0.5 * jump(made_network(fade=1e-3))  # which leaves nothing of the difference to fade


def test_a_dance_goes_on_from_the_movement_before_it(network: DancingToMusic):
    prior, code = dance_input().prior, network.code(dance_input(), 1)
    change = np.diff(np.concatenate([prior[-2:], code[:1]]), n=2, axis=0)  # of the step, at the border
    assert np.abs(change[..., :-3]).max() < 0.15 < np.abs(code[20] - prior[-1]).max()


def test_the_root_of_a_dance_stays_at_the_origin(network: DancingToMusic):
    code = network.code(dance_input(), 1)[30:]  # after the first fade
    np.testing.assert_allclose(code[:, [0, 2]], 0.0, atol=1e-3)


# Weights and commands


def test_a_description_of_giants_is_refused(network: DancingToMusic):
    about = network.description()
    about["params"]["hidden"] = 10**9
    refused("describes hidden = 1000000000", DancingToMusic.built, about, network.state_dict())


# Entry tests


ENTRY = {
    "L1 of rebuilt pieces over their own mean pose's", "speed of rebuilt pieces over recorded",
    "speed of drawn movements over recorded", "divergence of z_move (nats)", "dance told by style, over guessing",
    "critic of units right", "critic of dances right",
}  # fmt: skip


def test_untrained_networks_do_not_pass_the_entry_tests(network: DancingToMusic):
    results = entry_lee2019(network, SPLIT)
    assert set(results) == ENTRY and all(np.isfinite(value) for value, _, _ in results.values())
    assert not results["L1 of rebuilt pieces over their own mean pose's"][2]
    assert results["divergence of z_move (nats)"][0] < 20 and not results["divergence of z_move (nats)"][2]


def test_a_coder_that_gives_all_back_passes_tests_of_units(network: DancingToMusic, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(rivals, "rebuilt", lambda network, pieces: pieces)
    results = entry_lee2019(network, SPLIT)
    assert results["L1 of rebuilt pieces over their own mean pose's"] == (0.0, (0.0, 0.5), True)
    assert results["speed of rebuilt pieces over recorded"] == (1.0, (0.7, 1.2), True)
    assert results["dance told by style, over guessing"][0] == 1.0  # one dance: a guess is always right


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize("beats", ["kinematic", "music"])
def test_recorded_movement_cut_and_put_back_on_its_beats_is_off_by_a_centimetre_at_most(beats: str, recorded: UnitSet):
    errors = errors_of(recorded, beats, recorded.units[::4])
    assert len(errors) > 30 and np.mean(errors) < 0.01  # metres a joint, the path's drift over eight beats included


@pytest.fixture(scope="module")
def recorded(data_root: Path) -> UnitSet:
    return load_units(data_root / "beatlocked", FeatureParams.paper())


def test_epochs_are_those_of_units_and_of_compositions_and_the_presets_when_left_out(monkeypatch: pytest.MonkeyPatch):
    trained: list[LeeParams] = []
    monkeypatch.setattr(network_system, "load_units", lambda *_, **__: None)
    monkeypatch.setattr(network_system, "noticed_split", lambda *_: SPLIT)
    monkeypatch.setattr(train.Lee2019, "train_network", classmethod(lambda *args: trained.append(args[-1])))
    for options in ({"epochs": 7}, {}):
        train.Lee2019.learn([], TrainOptions("unused"), **options)
    small = LeeParams.small()
    assert trained == [replace(small, unit_epochs=7, composition_epochs=7), small]
