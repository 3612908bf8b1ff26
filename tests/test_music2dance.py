"""Music2Dance: sizes as published, causality, the sampler that remembers, codes, windows that do not leak."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from harmolab.body.rotations import fit_body, forward_kinematics, joint_rotations
from harmolab.body.skeletons import heading, turned
from harmolab.data.recordings import TANG_23, find_recordings, load_recording
from harmolab.data.synthetic import synthetic_clip, write_corpus
from harmolab.files import silent
from harmolab.systems import load
from harmolab.systems.music2dance import generate
from harmolab.systems.music2dance.codes import POINTS, PositionCode, RotationCode, body_points, stored_code
from harmolab.systems.music2dance.generate import heard_song
from harmolab.systems.music2dance.networks import DanceNetwork, Prediction, shifted
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.music2dance.sampler import sampler
from harmolab.systems.music2dance.sequences import (
    SequenceSet,
    Windows,
    WindowSource,
    cluster_weights,
    load_sequences,
    side_frames,
    training_statistics,
    window_starts,
)
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.systems.music2dance.train import (
    contact_accuracy,
    contact_loss,
    likelihood_loss,
    majority_contacts,
    predicted,
    train_music2dance,
    unchanged_contacts,
)
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.feet import foot_contacts
from harmolab.systems.training.groups import Segment
from harmolab.systems.training.loop import Shard
from harmolab.systems.training.splits import Split, split_units
from harmolab.types import Motion
from tests.builders import refused

DANCES = ("cha-cha", "rumba", "tango", "waltz")
TINY = replace(
    Music2DanceParams.recommended(), window=2.0, residual=8, skip=8, groups=1, lstm=8, clusters=3, first_epochs=3,
    second_epochs=2, batch_size=4, start_seconds=1.0, song=SongParams(channels=(2, 3), hidden=4, window=2.0, hop=1.0),
)  # fmt: skip
PAPER = replace(TINY, representation="rotations", carry=0.0, noisy_target=True)


def network(params: Music2DanceParams = TINY, *, seed: int = 0) -> DanceNetwork:
    torch.manual_seed(seed)
    return DanceNetwork(params, PositionCode(TANG_23, np.full(23, 0.2)), DANCES).eval()


def windows(params: Music2DanceParams, *, count: int = 3, seed: int = 0, channels: int = 72) -> Windows:
    """Random windows."""
    torch.manual_seed(seed)
    frames = params.n_frames
    moments = (torch.arange(frames) * params.song.rate / params.fps).expand(count, -1)
    return Windows(
        torch.randn(count, frames, channels), (torch.rand(count, frames, 2) > 0.5).float(),
        torch.rand(count, int(params.window * params.song.rate) + 2, params.song.n_audio), moments,
        torch.arange(count) % len(DANCES), torch.ones(count, frames),
    )  # fmt: skip


# Networks


def test_the_paper_preset_has_the_published_sizes():
    net = network(Music2DanceParams.paper())
    # 20 blocks of 32 channels and the mapping; the last block's way onward, which leads nowhere, is left out.
    unused = 32 * 32 + 32
    assert net.parameter_count() == 334_614 - unused
    assert sum(values.numel() for values in net.body.parameters()) + 4 * 5 == 272_422 - unused
    assert net.params.reach == 125


@pytest.mark.parametrize("params", [TINY, replace(TINY, generator="lstm"), replace(TINY, mapping=False)])
def test_a_frame_is_predicted_from_those_before_it_alone(params: Music2DanceParams):
    net, batch = network(params), windows(params)
    changed = batch.motion.clone()
    changed[:, 20] += 1.0
    with torch.no_grad():
        one, other = net(batch), net(batch._replace(motion=changed))
    for before, after in zip(one, other, strict=True):
        assert torch.equal(before[:, :21], after[:, :21])
        assert not torch.equal(before[:, 21], after[:, 21])


@pytest.mark.parametrize("params", [TINY, replace(TINY, generator="lstm"), replace(TINY, mapping=False)])
def test_the_song_changes_the_dance(params: Music2DanceParams):
    net, batch = network(params), windows(params)
    with torch.no_grad():
        one, other = net(batch), net(batch._replace(music=batch.music.flip(1)))
    assert (one.mean - other.mean).abs().max() > 1e-3


@pytest.mark.parametrize("params", [TINY, replace(TINY, generator="lstm"), replace(TINY, mapping=False)])
def test_items_of_a_batch_do_not_hear_each_other(params: Music2DanceParams):
    net, batch = network(params), windows(params, count=4)
    order = torch.tensor([2, 0, 3, 1])
    with torch.no_grad():
        one, other = net(batch), net(Windows(*(part[order] for part in batch)))
    for before, after in zip(one, other, strict=True):
        torch.testing.assert_close(before[order], after, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("params", [Music2DanceParams.recommended(), Music2DanceParams.paper()])
@pytest.mark.parametrize("generator", ["wavenet", "lstm"])
def test_remembering_is_the_same_as_seeing_everything_again(params: Music2DanceParams, generator: str, danced: Motion):
    params = replace(params, generator=generator, window=16.0, song=SongParams(window=16.0))
    code = RotationCode.of([danced]) if params.representation == "rotations" else PositionCode.of([danced])
    torch.manual_seed(0)
    net = DanceNetwork(params, code, DANCES).eval()
    batch = windows(params, count=2, channels=code.n_motion)
    frames = torch.cat([shifted(batch.motion), shifted(batch.contacts)], dim=-1)[0].numpy()
    with torch.no_grad():
        plain = Prediction(*(part[0] for part in net(batch)))
        stepped = sampler(net, net.music_at(batch.music, batch.moments)[0], 0)
    rows = [stepped.step(frame, number) for number, frame in enumerate(frames)]
    means, sigmas, contacts = (np.array(part) for part in zip(*rows, strict=True))
    assert len(rows) == 400
    np.testing.assert_allclose(means, plain.mean, atol=1e-5)
    np.testing.assert_allclose(sigmas, plain.log_sigma.exp(), atol=1e-5)
    np.testing.assert_allclose(contacts, plain.contacts, atol=1e-5)


def test_what_is_carried_is_in_the_mean():
    torch.manual_seed(0)
    batch = windows(TINY)
    with torch.no_grad():
        none, most = (network(replace(TINY, carry=carry))(batch).mean for carry in (0.0, 0.9))
    torch.testing.assert_close(most - none, 0.9 * shifted(batch.motion))


def test_a_long_song_is_heard_in_windows_that_fade_into_each_other():
    net = network()
    music = np.random.default_rng(0).random((200, 15)).astype(np.float32)
    moments = np.arange(0, 190, 0.4)
    whole = heard_song(net, music, moments)
    assert whole.shape == (475, 8) and bool(whole.isfinite().all())
    assert float(whole.diff(dim=0).abs().max()) < 0.5  # no jump where one window ends
    torch.testing.assert_close(whole[130:170], heard_song(net, music, moments[100:200])[30:70], atol=0.2, rtol=0.0)


def test_the_middle_of_a_window_counts_most(monkeypatch: pytest.MonkeyPatch):
    # Windows of 22 moments begin at -10, 0, 10 ... What is heard is the place in the window, as if music were nothing.
    net = network()
    monkeypatch.setattr(net, "music_at", lambda window, at: at[..., None].expand(-1, -1, 8))
    heard = heard_song(net, np.zeros((200, 15), np.float32), np.array([0.0, 13.0, 18.0, 40.5]))
    # 13: place 3, 3 from the end, and place 13, 8 from it. 18: 8 and 18, 8 and 3 from the ends. 40.5: .5, 10.5, 20.5.
    expected = [10.0, (3 * 3 + 13 * 8) / 11, (8 * 8 + 18 * 3) / 11, 10.5]
    np.testing.assert_allclose(heard, np.tile(expected, (8, 1)).T, atol=0.01)


def danced_to(net: DanceNetwork, music: np.ndarray, *, start: float = 0.0, before: int = 0) -> generate.Danced:
    """Two seconds of dance that go on from so many frames of nothing; no dice are thrown."""
    return generate.danced(
        net, music, start=start, frames=50, dance=0, seed=0, prior=np.zeros((before, net.n_motion)), progress=silent
    )


@pytest.mark.parametrize("before", [0, 25, 125])
@pytest.mark.parametrize(("start", "first"), [(0.0, 26), (0.5, 13), (0.9, 3), (0.98, 1)])
def test_the_frame_of_a_moment_hears_that_moment_however_long_the_movement_before_it(
    start: float, first: int, before: int
):
    # Ten features a second, 25 frames. The music changes from feature 11 on: heard from just after second 1.
    net = network(replace(TINY, mapping=False, temperature=0.0, smoothing=0.0))
    music = np.zeros((80, 15), np.float32)
    changed = music.copy()
    changed[11:] = 1.0
    one, other = (danced_to(net, each, start=start, before=before).code for each in (music, changed))
    assert np.flatnonzero(np.abs(one - other).max(axis=1) > 0)[0] == first


def test_a_foot_stands_where_that_is_more_likely_than_not():
    net = network()
    with torch.no_grad():
        net.body.head.layer.weight.zero_()
        net.body.head.layer.bias[-2:] = torch.tensor([0.1, -0.1])  # probabilities .525 and .475
    contacts = danced_to(net, np.zeros((40, 15), np.float32)).contacts
    np.testing.assert_array_equal(contacts, np.tile([1.0, 0.0], (50, 1)))


# Losses


def test_likelihood_is_that_of_a_gaussian():
    mean, log_sigma = torch.tensor([[[0.5, -1.0]]]), torch.tensor([[[0.0, 0.7]]])
    target = torch.tensor([[[0.1, 0.4]]])
    normal = torch.distributions.Normal(mean, log_sigma.exp())
    loss = likelihood_loss(Prediction(mean, log_sigma, torch.zeros(1, 1, 2)), target, torch.ones(1, 1))
    assert float(loss) == pytest.approx(-float(normal.log_prob(target).sum()), abs=1e-6)


def test_frames_that_were_not_recorded_do_not_count():
    params = TINY
    net, batch = network(), windows(params)
    half = batch.valid.clone()
    half[:, 25:] = 0
    with torch.no_grad():
        prediction = net(batch)
        wild = batch.motion + 100 * (1 - half)[..., None]
        assert likelihood_loss(prediction, wild, half) == likelihood_loss(prediction, batch.motion, half)
        other = torch.where(half[..., None] > 0, batch.contacts, 1 - batch.contacts)
        assert contact_loss(prediction, other, half) == contact_loss(prediction, batch.contacts, half)


def test_as_in_the_frame_before_is_counted_from_the_second_frame_on():
    contacts = torch.tensor([[[0.0, 1.0], [0.0, 1.0], [1.0, 1.0]]])
    assert float(unchanged_contacts(contacts, torch.ones(1, 3))) == pytest.approx(0.75)
    assert float(majority_contacts(contacts, torch.ones(1, 3))) == pytest.approx(0.75)


def test_a_foot_is_said_to_stand_from_a_probability_of_one_half_on():
    # The first frame does not count; of the other six all are right but one.
    logits = torch.tensor([[[9.0, 9.0], [0.1, 0.1], [-0.1, -0.1], [9.0, -9.0]]])
    contacts = torch.tensor([[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0], [0.0, 0.0]]])
    said = Prediction(logits, logits, logits)
    assert float(contact_accuracy(said, contacts, torch.ones(1, 4))) == pytest.approx(5 / 6)


def test_the_second_pass_learns_from_the_first_ones_prediction_without_a_way_back():
    net = network(replace(TINY, noise=0.0, motion_dropout=0.0))
    shard = Shard(windows(TINY), None, 1.0, 3)
    output = predicted(net, shard, second=True)
    (gradient,) = torch.autograd.grad(output.second.mean.sum(), output.first.mean, allow_unused=True)
    assert gradient is None
    batch = shard.own
    fed = torch.cat([batch.motion[:, :1], output.first.mean[:, 1:]], dim=1).detach()
    standing = torch.cat([batch.contacts[:, :1], (output.first.contacts[:, 1:] > 0).float()], dim=1)
    again = net.predicted(fed, standing, net.music_at(batch.music, batch.moments), batch.dance)
    torch.testing.assert_close(output.second.mean, again.mean)


@pytest.mark.parametrize("noisy", [True, False])
def test_noise_is_drawn_once_for_input_and_target(noisy: bool):
    params = replace(TINY, noise=0.1, noisy_target=noisy)
    batch = windows(params)
    output = predicted(network(params), Shard(batch, None, 1.0, 5), second=False)
    assert torch.equal(output.target, batch.motion) is not noisy
    again = predicted(network(params), Shard(batch, None, 1.0, 5), second=False)
    assert torch.equal(output.target, again.target) and torch.equal(output.first.mean, again.first.mean)


# Codes


@pytest.fixture(scope="module")
def danced() -> Motion:
    motion = synthetic_clip("cha-cha", seconds=12.0, fps=25.0, seed=4).motion
    assert motion is not None
    return motion


def from_origin(positions: np.ndarray, fps: float) -> np.ndarray:
    """Points that start at x = z = 0, facing +z."""
    first = heading(positions, fps, POINTS)[0]
    return turned(positions - positions[:1, :1] * [1, 0, 1], np.full((len(positions), 1), -first))


def test_rotations_give_a_body_of_fixed_bones_back(danced: Motion):
    code = RotationCode.of([danced])
    assert code.n_motion == 58
    points = body_points(danced)
    decoded = code.decode(code.encode(danced), danced.fps)
    assert np.linalg.norm(decoded - from_origin(points.positions, danced.fps), axis=2).max() < 0.01


def test_forward_kinematics_undoes_joint_rotations(danced: Motion):
    points = body_points(danced).positions
    body = fit_body(points, POINTS)
    turns = joint_rotations(points, body)
    np.testing.assert_allclose(forward_kinematics(turns, points[:, 0], body), points, atol=0.01)
    np.testing.assert_allclose(turns @ turns.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-9)


def test_end_effectors_are_told_but_not_read(danced: Motion):
    with_them, without = RotationCode.of([danced]), RotationCode.of([danced], end_effectors=False)
    code = with_them.encode(danced)
    assert without.n_motion == 43
    np.testing.assert_allclose(without.encode(danced), code[:, :43], atol=1e-9)
    changed = code.copy()
    changed[:, 43:] += 1.0
    np.testing.assert_array_equal(with_them.decode(changed, 25.0), with_them.decode(code, 25.0))


def test_positions_come_back_with_their_bones(danced: Motion):
    code = PositionCode.of([danced])
    decoded = Motion(code.decode(code.encode(danced), danced.fps), danced.fps, danced.skeleton)
    np.testing.assert_allclose(code.encode(decoded)[1:], code.encode(danced)[1:], atol=2e-3)


@pytest.mark.parametrize("make", [PositionCode.of, RotationCode.of])
def test_a_code_is_stored_and_built_again(danced: Motion, make: Callable):
    code = make([danced])
    again = stored_code(code.to_dict())
    values = code.encode(danced)
    np.testing.assert_array_equal(again.decode(values, 25.0), code.decode(values, 25.0))
    refused(r"shape|known", stored_code, {**code.to_dict(), "offsets": [[1.0]], "lengths": [1.0]})


def test_a_body_without_the_joints_that_rotations_need_is_named():
    with pytest.raises(ValueError, match="no joint for pelvis, torso, neck, head"):
        body_points(Motion(np.zeros((3, 1, 3)), 25.0, type(POINTS)(("a",), (-1,))))


def test_a_standing_foot_is_low_and_slow(danced: Motion):
    assert 0.4 < foot_contacts(danced.positions, danced.fps, danced.skeleton).mean() < 0.95
    lifted = danced.positions.copy()
    lifted[100:120] += [0.0, 0.2, 0.0]
    assert not foot_contacts(lifted, danced.fps, danced.skeleton)[102:118].any()
    slid = danced.positions + np.arange(danced.n_frames)[:, None, None] * np.array([0.02, 0.0, 0.0])
    assert not foot_contacts(slid, danced.fps, danced.skeleton).any()


# Windows


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("m2d") / "dances"
    write_corpus(root, clips=14, seconds=20.0, seed=1)
    return root


@pytest.fixture(scope="module")
def split(sequences: SequenceSet) -> Split:
    return split_units(sequences.units)


@pytest.fixture(scope="module")
def sequences(corpus: Path) -> SequenceSet:
    return load_sequences([corpus], TINY)


def source(sequences: SequenceSet, split: Split, side: str = "train") -> WindowSource:
    statistics = training_statistics(sequences, split.groups["train"])
    return WindowSource.of(sequences, split.groups[side], dances=sequences.dances, statistics=statistics)


def test_no_training_window_has_a_frame_of_a_held_out_figure(sequences: SequenceSet, split: Split):
    train = source(sequences, split)
    held_out = {*split.groups["validation"], *split.groups["test"]}
    assert held_out
    for number, start in train.places:
        sequence = sequences.sequences[number]
        assert not side_frames(sequence, held_out, TINY.fps)[start : start + TINY.n_frames].any()


def test_a_planted_leak_is_seen(sequences: SequenceSet, split: Split):
    sequence = sequences.sequences[0]
    whole = Segment(sequence.start, sequence.start + sequence.n_frames / TINY.fps, split.groups["test"][0])
    leaked = replace(sequence, segments=(whole,))
    assert not len(window_starts(leaked, split.groups["train"], TINY))
    assert len(window_starts(leaked, split.groups["test"], TINY)) == sequence.n_frames - TINY.n_frames + 1


def test_windows_of_a_held_out_side_count_its_frames_alone(sequences: SequenceSet, split: Split):
    statistics = training_statistics(sequences, split.groups["train"])
    held = WindowSource.of(sequences, split.groups["test"], dances=sequences.dances, statistics=statistics, share=0.25)
    batch = held.batch(np.arange(0, len(held.places), 7))
    assert float(batch.valid.mean(dim=1).min()) >= 0.24 and float(batch.valid.mean()) < 1


def test_music_of_a_window_lies_where_its_motion_does(sequences: SequenceSet, split: Split):
    train = source(sequences, split)
    row = len(train.places) // 2
    number, start = train.places[row]
    sequence, batch = sequences.sequences[number], train.batch(np.array([row]))
    at = (sequence.start + (start + 10) / TINY.fps) * TINY.song.rate
    place = float(batch.moments[0, 10])
    scale = [part.numpy() for part in train.statistics]
    music = batch.music[0].numpy() * scale[1] + scale[0]
    assert 0 <= float(batch.moments[0, 0]) < 1
    np.testing.assert_allclose(music[int(place)], sequence.music[int(np.floor(at))], atol=1e-4)
    assert place - int(place) == pytest.approx(at - np.floor(at), abs=1e-4)


def test_rare_movement_is_drawn_as_often(sequences: SequenceSet, split: Split):
    train = source(sequences, split)
    weights = cluster_weights(sequences.sequences, train.places, replace(TINY, clusters=4))
    assert weights.sum() == pytest.approx(1.0)
    values, counts = np.unique(weights.round(12), return_counts=True)
    np.testing.assert_allclose(
        values * counts, np.full(len(values), 0.25) * np.round(values * counts / 0.25), atol=1e-9
    )
    even = cluster_weights(sequences.sequences, train.places, replace(TINY, clusters=0))
    np.testing.assert_array_equal(even, 1 / len(train.places))


def test_the_same_indices_draw_the_same_windows_and_others_others(sequences: SequenceSet, split: Split):
    train = source(sequences, split)
    one, same, other = (train.take(torch.tensor(rows)) for rows in ([0, 1, 2], [0, 1, 2], [2, 1, 0]))
    assert torch.equal(one.motion, same.motion) and not torch.equal(one.motion, other.motion)
    halves = [train.take(torch.tensor([0, 1, 2]), rank, 2) for rank in (0, 1)]
    assert torch.equal(torch.cat([halves[0].motion[:1], halves[1].motion]), one.motion[:2])


# Training


@pytest.mark.slow
@pytest.mark.parametrize("params", [TINY, PAPER], ids=["recommended", "paper"])
def test_it_trains_saves_loads_and_dances(params: Music2DanceParams, corpus: Path, split: Split, tmp_path: Path):
    train_music2dance(split, load_sequences([corpus], params), TrainOptions(tmp_path / "run"))
    system = load(tmp_path / "run")
    assert isinstance(system, Music2Dance)
    recording = load_recording(find_recordings(corpus).folders[0])
    motion = system.generate(recording.clip.audio, seconds=4.0, seed=1, dance=recording.clip.dance)
    assert motion.n_frames == 100 and motion.fps == 25.0
    assert motion.positions[..., 1].min() > -1e-3
    assert len([path for path in (tmp_path / "run").glob("model*") if path.suffix == ".safetensors"]) == 2
