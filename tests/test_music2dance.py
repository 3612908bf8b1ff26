"""Music2Dance: sizes, causality, the sampler that remembers, codes, windows that do not leak, trainings by command."""

import csv
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import torch

import harmolab.systems.music2dance.train as training
from harmolab import Motion, load_motion, save_motion, write_corpus
from harmolab.body.rotations import fit_body, forward_kinematics, joint_rotations
from harmolab.body.skeletons import Skeleton, heading, joint_part, turned
from harmolab.cli import app
from harmolab.data.recordings import TANG_23, load_recording
from harmolab.files import silent
from harmolab.systems import FeatureParams, find, load
from harmolab.systems.contract import PARTS, names, trainable
from harmolab.systems.music2dance import generate
from harmolab.systems.music2dance import sequences as seq
from harmolab.systems.music2dance.codes import POINTS, PositionCode, RotationCode, body_points, stored_code
from harmolab.systems.music2dance.feet import FootParams, train_feet
from harmolab.systems.music2dance.generate import heard_song, sampler
from harmolab.systems.music2dance.networks import DanceNetwork, Prediction, shifted
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.music2dance.sequences import SequenceSet
from harmolab.systems.training import units
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.feet import foot_contacts
from harmolab.systems.training.groups import Segment
from harmolab.systems.training.loop import Shard
from harmolab.systems.training.splits import Split, split_units
from harmolab.systems.training.units import load_units
from tests.builders import called, cases, planted_dance, refused
from tests.tiny_music2dance import TINY, trained

DANCES = ("cha-cha", "rumba", "tango", "waltz")


def network(params: Music2DanceParams = TINY, *, seed: int = 0) -> DanceNetwork:
    torch.manual_seed(seed)
    return DanceNetwork(params, PositionCode(TANG_23, np.full(23, 0.2)), DANCES).eval()


def windows(params: Music2DanceParams, *, count: int = 3, seed: int = 0, channels: int = 72) -> seq.Windows:
    """Random windows."""
    torch.manual_seed(seed)
    frames = params.n_frames
    moments = (torch.arange(frames) * params.song.rate / params.fps).expand(count, -1)
    return seq.Windows(
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
def test_a_frame_is_predicted_from_those_before_it_alone_and_the_song(params: Music2DanceParams):
    net, batch = network(params), windows(params)
    changed = batch.motion.clone()
    changed[:, 20] += 1.0
    with torch.no_grad():
        one, other = net(batch), net(batch._replace(motion=changed))
        unlike = net(batch._replace(music=batch.music.flip(1)))
    assert (one.mean - unlike.mean).abs().max() > 1e-3
    for before, after in zip(one, other, strict=True):
        assert torch.equal(before[:, :21], after[:, :21])
        assert not torch.equal(before[:, 21], after[:, 21])


@pytest.mark.parametrize("params", [TINY, replace(TINY, generator="lstm"), replace(TINY, mapping=False)])
def test_items_of_a_batch_do_not_hear_each_other(params: Music2DanceParams):
    net, batch = network(params), windows(params, count=4)
    order = torch.tensor([2, 0, 3, 1])
    with torch.no_grad():
        one, other = net(batch), net(seq.Windows(*(part[order] for part in batch)))
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
    prior = np.zeros((before, net.n_motion))
    return generate.danced(net, music, start=start, frames=50, dance=0, seed=0, prior=prior, progress=silent)


@pytest.mark.parametrize("before", [0, 25, 125])
@pytest.mark.parametrize(("start", "first"), [(0.0, 26), (0.5, 13), (0.9, 3), (0.98, 1)])
def test_the_frame_of_a_moment_hears_it_however_long_the_movement_before_it(start: float, first: int, before: int):
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
    np.testing.assert_array_equal(danced_to(net, np.zeros((40, 15), np.float32)).contacts, np.tile([1.0, 0.0], (50, 1)))


# Losses


def test_likelihood_is_that_of_a_gaussian():
    mean, log_sigma = torch.tensor([[[0.5, -1.0]]]), torch.tensor([[[0.0, 0.7]]])
    target = torch.tensor([[[0.1, 0.4]]])
    normal = torch.distributions.Normal(mean, log_sigma.exp())
    loss = training.likelihood_loss(Prediction(mean, log_sigma, torch.zeros(1, 1, 2)), target, torch.ones(1, 1))
    assert float(loss) == pytest.approx(-float(normal.log_prob(target).sum()), abs=1e-6)


def test_frames_that_were_not_recorded_do_not_count():
    net, batch = network(), windows(TINY)
    half = batch.valid.clone()
    half[:, 25:] = 0
    with torch.no_grad():
        prediction = net(batch)
        wild = batch.motion + 100 * (1 - half)[..., None]
        one, other = (training.likelihood_loss(prediction, motion, half) for motion in (wild, batch.motion))
        assert one == other
        other = torch.where(half[..., None] > 0, batch.contacts, 1 - batch.contacts)
        assert training.contact_loss(prediction, other, half) == training.contact_loss(prediction, batch.contacts, half)


def test_as_in_the_frame_before_is_counted_from_the_second_frame_on():
    contacts = torch.tensor([[[0.0, 1.0], [0.0, 1.0], [1.0, 1.0]]])
    for share in (training.unchanged_contacts, training.majority_contacts):
        assert float(share(contacts, torch.ones(1, 3))) == pytest.approx(0.75), share


def test_a_foot_is_said_to_stand_from_a_probability_of_one_half_on():
    # The first frame does not count; of the other six all are right but one.
    logits = torch.tensor([[[9.0, 9.0], [0.1, 0.1], [-0.1, -0.1], [9.0, -9.0]]])
    contacts = torch.tensor([[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0], [0.0, 0.0]]])
    said = Prediction(logits, logits, logits)
    assert float(training.contact_accuracy(said, contacts, torch.ones(1, 4))) == pytest.approx(5 / 6)


def test_the_second_pass_learns_from_the_first_ones_prediction_without_a_way_back():
    net = network(replace(TINY, noise=0.0, motion_dropout=0.0))
    shard = Shard(windows(TINY), None, 1.0, 3)
    output = training.predicted(net, shard, second=True)
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
    output, again = (training.predicted(network(params), Shard(batch, None, 1.0, 5), second=False) for _ in range(2))
    assert torch.equal(output.target, batch.motion) is not noisy
    assert torch.equal(output.target, again.target) and torch.equal(output.first.mean, again.first.mean)


# Codes


@pytest.fixture(scope="module")
def danced() -> Motion:
    return planted_dance(seconds=12.0, fps=25.0, seed=4).motion


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
    values = code.encode(danced)
    np.testing.assert_array_equal(stored_code(code.to_dict()).decode(values, 25.0), code.decode(values, 25.0))
    refused(r"shape|known", stored_code, {**code.to_dict(), "offsets": [[1.0]], "lengths": [1.0]})


def test_a_standing_foot_is_low_and_slow(danced: Motion):
    assert 0.4 < foot_contacts(danced.positions, danced.fps, danced.skeleton).mean() < 0.95
    lifted = danced.positions.copy()
    lifted[100:120] += [0.0, 0.2, 0.0]
    assert not foot_contacts(lifted, danced.fps, danced.skeleton)[102:118].any()
    slid = danced.positions + np.arange(danced.n_frames)[:, None, None] * np.array([0.02, 0.0, 0.0])
    assert not foot_contacts(slid, danced.fps, danced.skeleton).any()


# Windows


@pytest.fixture(scope="module")
def train(sequences: SequenceSet, split: Split) -> seq.WindowSource:
    return seq.training_windows(split, sequences)


def test_windows_held_out_count_only_their_frames(sequences: SequenceSet, split: Split, train: seq.WindowSource):
    held = seq.WindowSource.of(sequences, split.groups["test"], share=0.25, statistics=train.statistics)
    batch = held.batch(np.arange(0, len(held.places), 7))
    assert float(batch.valid.mean(dim=1).min()) >= 0.24 and float(batch.valid.mean()) < 1


def test_music_of_a_window_lies_where_its_motion_does(sequences: SequenceSet, train: seq.WindowSource):
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


def test_an_epoch_has_as_many_windows_as_fit_without_overlap(train: seq.WindowSource):
    places = np.array([(0, 0), (0, 20), (0, 90), (1, 0)])  # of 50 frames: 70 and 50 of one recording, 50 of another
    assert len(replace(train, places=places)) == 170 // 50


def test_rare_movement_is_drawn_as_often(sequences: SequenceSet, train: seq.WindowSource):
    weights = seq.cluster_weights(sequences.sequences, train.places, replace(TINY, clusters=4))
    assert weights.sum() == pytest.approx(1.0)
    values, counts = np.unique(weights.round(12), return_counts=True)
    np.testing.assert_allclose(values * counts, 0.25 * np.round(values * counts / 0.25), atol=1e-9)
    even = seq.cluster_weights(sequences.sequences, train.places, replace(TINY, clusters=0))
    np.testing.assert_array_equal(even, 1 / len(train.places))


def test_the_same_indices_draw_the_same_windows_and_others_others(train: seq.WindowSource):
    one, same, other = (train.take(torch.tensor(rows)) for rows in ([0, 1, 2], [0, 1, 2], [2, 1, 0]))
    assert torch.equal(one.motion, same.motion) and not torch.equal(one.motion, other.motion)
    halves = [train.take(torch.tensor([0, 1, 2]), rank, 2) for rank in (0, 1)]
    assert torch.equal(torch.cat([halves[0].motion[:1], halves[1].motion]), one.motion[:2])


SCRIPT = Path(__file__).with_name("tiny_music2dance.py")
# Name of a training -> its options; three epochs.
TRAININGS: dict[str, tuple[object, ...]] = {
    "music2dance": ("--system", "music2dance", "--phase1", 1, "--phase2", 2),
    "feet": ("--system", "feet", "--epochs", 3),
    "attributes": ("--system", "attributes", "--epochs", 3),
}


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """14 synthetic dances of ten seconds."""
    return write_corpus(tmp_path_factory.mktemp("m2d") / "dances", clips=14, seconds=10.0, fps=25.0, seed=2)


@pytest.fixture(scope="module")
def runs(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`runs(name)`: the folder of an unbroken training, made when it is first asked for."""
    home = tmp_path_factory.mktemp("runs")

    def run(name: str) -> Path:
        if not (home / name).exists():
            succeed(corpus, "--out", home / name, *TRAININGS[name])
        return home / name

    return run


def succeed(*arguments: object) -> None:
    result = trained(*arguments)
    assert result.exit_code == 0, result.output


def history(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "history.csv").read_text().splitlines()))


# Kill -9


# Name of a training -> its phase when it is killed.
KILLED = {"music2dance": "feedback", "feet": "feet"}
EPOCH = 2


@pytest.fixture(scope="module")
def killed(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of runs by name, killed in their third epoch."""
    home = tmp_path_factory.mktemp("killed")
    trainings = [[*map(str, (corpus, "--out", home / name, *TRAININGS[name]))] for name in KILLED]
    path = os.pathsep.join([str(SCRIPT.parents[1]), os.environ.get("PYTHONPATH", "")])
    command, environment = [sys.executable, str(SCRIPT), str(EPOCH), json.dumps(trainings)], {"PYTHONPATH": path}
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == [str([-signal.SIGKILL.value] * len(KILLED))], done.stderr
    return home


@pytest.mark.slow
@pytest.mark.parametrize("name", KILLED)
def test_killed_training_resumes_to_same_history(name: str, killed: Path, runs: Callable[[str], Path], corpus: Path):
    run = killed / name
    assert not (run / "model.json").exists()
    assert len(history(run)) == EPOCH
    assert history(runs(name))[EPOCH]["phase"] == KILLED[name]
    succeed(corpus, "--out", run, *TRAININGS[name], "--resume")
    for file in ("history.csv", "model.safetensors", "split.json", "settings.json"):
        assert (run / file).read_bytes() == (runs(name) / file).read_bytes(), file


# Options


def test_options_reach_the_run(runs: Callable[[str], Path]):
    assert [row["phase"] for row in history(runs("music2dance"))] == ["teacher"] + 2 * ["feedback"]
    params = read_about(runs("music2dance"))["build"]["params"]
    assert (params["first_epochs"], params["second_epochs"], params["representation"]) == (1, 2, "positions")


@pytest.mark.slow
def test_either_representation_trains_and_dances(corpus: Path, runs: Callable[[str], Path], tmp_path: Path):
    options = ("--representation", "rotations", "--phase1", 1, "--phase2", 0)
    succeed(corpus, "--out", tmp_path / "run", "--system", "music2dance", *options)
    assert read_about(tmp_path / "run")["build"]["code"]["kind"] == "rotations"
    audio = load_recording(next(corpus.glob("clip_*"))).clip.audio
    for run in (tmp_path / "run", runs("music2dance")):
        motion = load(run).generate(audio, seconds=4.0, seed=1)
        assert motion.n_frames == 100 and motion.positions[..., 1].min() > -1e-3


ONLY_POSITIONS = "velocity_weight is for the code of positions; use 0"
REFUSED = "Invalid value for '--representation': 'words' is not one of 'positions', 'rotations'."


@cases(
    "arguments, line",
    (("harmogan", "--phase1", 3), "--phase1 is no option of this system"),
    (("lee2019", "--phase2", 3), "--phase2 is no option of this system"),
    (("ren2020", "--pretrained", "."), "--pretrained is no option of this system"),
    (("music2dance", "--epochs", 1), "--epochs is no option of this system"),
    (("music2dance", "--preset", "small"), "preset must be recommended or paper, got 'small'"),
    (("music2dance", "--representation", "words"), REFUSED),
    (("feet", "--preset", "paper"), "--preset is no option of this system"),
    (("feet", "--representation", "rotations", "--velocity-weight", 3), ONLY_POSITIONS),
    (("attributes", "--step", 3), "--step is no option of this system"),
)
def test_what_a_system_cannot_take_is_refused_before_reading(arguments: tuple[object, ...], line: str, tmp_path: Path):
    result = trained(tmp_path, "--out", tmp_path / "run", "--system", *arguments)  # a corpus that holds nothing
    assert result.exit_code == 2 and result.stderr == f"harmolab: {line}\n"


def test_settings_of_the_song_are_no_dict(tmp_path: Path):
    message = r"song must be SongParams\(\.\.\.\), got {'rate': 10.0}"
    refused(message, trainable("music2dance").train, [tmp_path], tmp_path / "run", song={"rate": 10.0})


# Corpora that cannot be trained on


def renamed(path: Path, parts: tuple[str, ...]) -> None:
    """Give the joints of some parts of a recorded body other names."""
    motion = load_motion(path)
    places = enumerate(motion.skeleton.joints)
    joints = tuple(f"tail {place}" if joint_part(name) in parts else name for place, name in places)
    save_motion(path, replace(motion, skeleton=Skeleton(joints, motion.skeleton.parents)))


@pytest.fixture(scope="module")
def faulty(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Corpora by what is wrong with them."""
    home = tmp_path_factory.mktemp("faulty")
    recordings = sorted(corpus.glob("clip_*"))
    for name, recording in itertools.product(("no_feet", "two_bodies"), recordings[:7]):
        shutil.copytree(recording, home / name / recording.name)
    for recording in recordings[:7]:
        renamed(home / "no_feet" / recording.name / "motion.npz", ("ankle", "heel", "toe"))
    renamed(home / "two_bodies" / recordings[3].name / "motion.npz", ("finger",))
    short = write_corpus(home / "short", clips=14, seconds=7.0, fps=25.0, seed=2)
    return {"short": short, **{path.name: path for path in home.iterdir()}}


SHORT = r"harmolab: short: windows are 8 s long, .* last \d\.\d s in a row .* longest of 14 recordings lasts 7\.0 s"


@pytest.mark.slow
@pytest.mark.parametrize("system", ["music2dance", "feet"])
@cases(
    "fault, told",
    ("short", SHORT),
    ("two_bodies", r"clip_0004_\S+: has another skeleton \(21 joints\) than \S+clip_0001_\S+ \(21 joints\)"),
    ("no_feet", r"clip_0001_\S+: it must be known which foot stands, but no joint is called toe, heel, ankle"),
)
def test_an_untrainable_corpus_is_named(system: str, fault: str, told: str, faulty: dict[str, Path], tmp_path: Path):
    result = called(app, "train", faulty[fault], "--out", tmp_path / "run", "--system", system)
    aside = ("units: ", "harmolab: reading sequences: ")  # the latter on a machine that takes seconds to read
    lines = [line for line in result.stderr.splitlines() if not line.startswith(aside)]
    assert result.exit_code == 2 and len(lines) == 1, result.output
    assert re.search(told, lines[0]) and not (tmp_path / "run").exists()


# Parts are no dancers


def test_parts_are_found_by_training_alone():
    assert not {*PARTS} & {*names()}
    assert {name: trainable(name).__name__ for name in PARTS} == {"attributes": "Attributes", "feet": "Feet"}
    assert trainable("music2dance") is find("music2dance")


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_a_part_does_not_dance(part: str, runs: Callable[[str], Path], corpus: Path, tmp_path: Path):
    sentence = f"{part} is a part of music2dance, not a dancer: train it into a run of music2dance (--out RUN/{part})"
    refused(f"^{part} is a part of music2dance", find, part)
    dancing = ("dance", next(corpus.glob("*/audio.wav")), "--out", tmp_path / "dance.npz")
    assert f"harmolab: {sentence}" in called(app, *dancing, "--system", part).stderr
    assert f"harmolab: {runs(part)}: {sentence}" in called(app, *dancing, "--weights", runs(part)).stderr
    assert not (tmp_path / "dance.npz").exists()


# Leaks


@pytest.fixture(scope="module")
def split(sequences: SequenceSet) -> Split:
    return split_units(sequences.units)


@pytest.fixture(scope="module")
def sequences(corpus: Path) -> SequenceSet:
    return seq.load_sequences([corpus], TINY)


def figures(sequences: SequenceSet, number: int, start: int) -> set[str]:
    """The motion groups that a window has frames of, one frame after another."""
    sequence = sequences.sequences[number]
    times = sequence.start + (start + np.arange(TINY.n_frames)) / TINY.fps
    return {each.group for each in sequence.segments for time in times if each.start <= time < each.end}


def test_no_figure_held_out_is_in_a_training_window(split: Split, sequences: SequenceSet, train: seq.WindowSource):
    danced = set().union(*(figures(sequences, *place) for place in train.places[::5].tolist()))
    held_out = {*split.groups["validation"], *split.groups["test"]}
    assert danced and held_out and not danced & held_out


@pytest.mark.parametrize("side", ["validation", "test"])
def test_a_figure_on_two_sides_stops_a_training(side: str, split: Split, sequences: SequenceSet, tmp_path: Path):
    groups = {**split.groups, side: [*split.groups[side], split.groups["train"][0]]}
    parts = (replace(split, groups=groups), sequences, TrainOptions(tmp_path / "run"))
    refused(f"holds frame .* a figure of the {side} side", training.train_music2dance, *parts)
    refused(f"holds frame .* a figure of the {side} side", train_feet, *parts, FootParams())
    assert not (tmp_path / "run").exists()


def test_a_test_figure_within_a_training_window_is_named_by_its_frame(split: Split, sequences: SequenceSet):
    source = seq.training_windows(split, sequences)  # the first sequence dances a test figure during one of training
    number, start = source.places[0]
    sequence, changed = sequences.sequences[number], list(sequences.sequences)
    first = sequence.start + (start + 30) / TINY.fps
    segments = (*sequence.segments, Segment(first, first + 0.5, split.groups["test"][0]))
    changed[number] = replace(sequence, segments=segments)
    leaking = replace(sequences, sequences=tuple(changed))
    refused(rf"window at frame {start} holds frame {start + 30}, .* test side", seq.training_windows, split, leaking)
    seq.check_leaks(source, split.groups)


def test_the_split_is_that_of_harmogan_s_units(split: Split, corpus: Path):
    again = split_units(load_units([corpus], FeatureParams.paper(), step=2))
    assert split.to_dict() == again.to_dict()
    assert not split.train.units[0].audio.size and again.train.units[0].audio.size


@pytest.mark.parametrize("system", ["music2dance", "feet"])
def test_each_recording_is_read_once(system: str, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    read = Mock(wraps=load_recording)
    monkeypatch.setattr(units, "load_recording", read)
    epochs = ("--epochs", 0) if system == "feet" else ("--phase1", 0, "--phase2", 0)
    succeed(corpus, "--out", tmp_path / "run", "--system", system, *epochs)
    assert read.call_count == len({call.args for call in read.call_args_list}) == 14


# A likelihood that can be compared


def quick(split: Split, sequences: SequenceSet, folder: Path) -> Path:
    """The folder of a training of five epochs."""
    training.train_music2dance(split, sequences, TrainOptions(folder, resume=True, accelerator="cpu"))
    return folder


def test_the_fixed_windows_are_the_same_with_and_without_clusters(split: Split, sequences: SequenceSet):
    params = [replace(TINY, clusters=count) for count in (3, 0)]
    with_clusters, without_any = (seq.training_windows(split, replace(sequences, params=one)) for one in params)
    assert with_clusters.weights.std() > 0 == without_any.weights.std()
    rows = [training.even_rows(each) for each in (with_clusters, without_any)]
    for one, other in zip(with_clusters.batch(rows[0]), without_any.batch(rows[1]), strict=True):
        assert torch.equal(one, other)
    assert 1 < len(rows[0]) <= 64


@pytest.mark.slow
def test_validation_leaves_the_weights_as_they_are(
    split: Split, sequences: SequenceSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    rare = quick(split, sequences, tmp_path / "rare")
    monkeypatch.setattr(training, "VALIDATE_EVERY", 1)
    often = quick(split, sequences, tmp_path / "often")
    assert (often / "model.safetensors").read_bytes() == (rare / "model.safetensors").read_bytes()
    assert [bool(row["fixed_nats"]) for row in history(rare)] == [False, False, True, False, True]
    rows = history(often)
    assert all(np.isfinite(float(row["fixed_nats"])) for row in rows)
    assert float(rows[2]["fixed_nats"]) < float(rows[0]["fixed_nats"])
