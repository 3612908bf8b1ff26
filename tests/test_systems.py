"""The contract of `harmolab.systems`: every system there is fulfils it, and so does a toy defined here.

A system joins the tests by a line in `SYSTEMS`: a function that makes a small one. Those that play an instrument
(`PLAYERS`) fulfil what is not about dances.
"""

import json
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
import torch
from typer.testing import CliRunner, Result

from harmolab import Audio, BeatTrack, Clip, Motion, Skeleton, load_motion, synthetic_clip, systems
from harmolab.body.kinematics import resample_motion
from harmolab.cli import app
from harmolab.data.synthetic import write_corpus
from harmolab.files import PathLike
from harmolab.musician.cleaning import Reference
from harmolab.musician.networks import SoundToPoints
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import PointSpace
from harmolab.musician.system import Audio2Body
from harmolab.readers.player_points import PLAYER_50
from harmolab.systems import System, find, load, names
from harmolab.systems.contract import PARTS, PLAYERS, trainable
from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.music2dance.codes import PositionCode
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.ren2020.networks import RenGenerator
from harmolab.systems.training import loop as training_loop
from harmolab.systems.training.about import DEFAULT_STEM, stored_skeleton
from harmolab.systems.training.checkpoints import load_state, open_folder
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.loop import Batching, Phase, Player, Tensors, fit, make_fabric
from harmolab.systems.training.motion_code import bone_lengths, decode_motion, encode_motion
from harmolab.systems.training.requests import DanceRequest, check_initial
from harmolab.systems.training.runs import PoseBank
from harmolab.systems.training.splits import split_units
from harmolab.systems.training.units import load_units
from harmolab.systems.training.weights import load_weights, save_weights
from tests.builders import cases, missing, refused

TOY = f"{__name__}:Toy"
FEATURES = FeatureParams(n_mfcc=2, beat_channels=True)
CODED: dict[str, Any] = {"fps": 15.0, "features": FEATURES}


# A toy system


class Swaying(torch.nn.Module):
    """Motion code (N, T, 3 J + 3) from where each frame lies between two beats."""

    system = TOY

    def __init__(self, skeleton: Skeleton) -> None:
        super().__init__()
        self.skeleton = skeleton
        self.layer = torch.nn.Linear(2, 3 * len(skeleton.joints) + 3)

    def forward(self, audio: torch.Tensor) -> torch.Tensor:
        return self.layer(audio[..., -2:])

    def description(self) -> dict[str, Any]:
        return {"skeleton": asdict(self.skeleton)}

    @classmethod
    def built(cls, build: Any, tensors: Any) -> Self:
        return cls(stored_skeleton(build))


class Toy:
    """A dancer who sways with the beat, in a place that the seed draws."""

    def __init__(self, net: Swaying) -> None:
        self.net = net

    def generate(
        self, audio: Audio, beats: BeatTrack | None = None, *, start: float = 0.0, seconds: float | None = None,
        seed: int = 0, initial: Motion | None = None,
    ) -> Motion:  # fmt: skip
        request = DanceRequest(audio, beats, start, seconds, seed, initial)
        times = start + np.arange(request.n_frames(FEATURES.fps)) / FEATURES.fps
        heard = torch.from_numpy(audio_features(audio, request.track(), times, FEATURES))
        code = self.net(heard[None])[0].detach().double().numpy()
        positions = decode_motion(code, FEATURES.fps, self.net.skeleton)
        place = np.random.default_rng(seed).uniform(-1, 1, 3) * (1, 0, 1)
        if initial is not None:
            check_initial(initial, self.net.skeleton, "the toy")
            place = initial.positions[-1].mean(axis=0) - positions[0].mean(axis=0)
        return Motion(positions + place, FEATURES.fps, self.net.skeleton)

    def save(self, folder: PathLike) -> None:
        Path(folder).mkdir(parents=True, exist_ok=True)
        save_weights(Path(folder) / DEFAULT_STEM, self.net)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        return cls(load_weights(folder, Swaying))

    @classmethod
    def train(
        cls, data: Sequence[PathLike], out: PathLike, *, seed: int = 1, resume: bool = False,
        report: Callable[[dict[str, Any], int], None] = lambda row, end: None,
    ) -> Self:  # fmt: skip
        split = split_units(load_units([*data], FEATURES, step=4))
        torch.manual_seed(seed)
        net, settings = Swaying(split.train.skeleton), {"seed": seed}
        toy = Player("net", [*net.parameters()], lambda made, shard, row: distance(made, shard.own), {"mse": 1.0})
        rates = {"coarse": lambda epoch: 0.1, "fine": lambda epoch: 0.01 / (epoch + 1)}
        phases = [
            Phase(name, 3, rate, {"net": net}, [toy], lambda shard, last: net(shard.own.audio))
            for name, rate in rates.items()
        ]
        own: dict[str, Any] = {"settings": settings, "resume": resume}
        with open_folder(Path(out), split=split, **own):
            batching, units = Batching(8, seed=seed), Tensors.of(split.train)
            fit(make_fabric(accelerator="cpu"), phases, units, batching, Path(out), report=report, **own)
            cls(net).save(out)
        return cls(net)


def distance(code: torch.Tensor, units: Tensors) -> dict[str, torch.Tensor]:
    square = (code - units.motion).square().mean(dim=-1) * units.mask
    return {"mse": square.sum() / units.mask.sum()}


# Every system there is, small


def dancer() -> Motion:
    motion = synthetic_clip("waltz", seed=2).motion
    assert motion is not None
    return resample_motion(motion, FEATURES.fps)


def with_movements(system: Any, network: Any, code: np.ndarray) -> Any:
    """A system of an untrained network, and two movements to start from."""
    bank = np.stack([code[:25], code[30:55]]).astype(np.float16)
    return system(network.eval(), PoseBank(bank, ("waltz", "waltz")), {"note": "tiny"})


def tiny(system: Any, network: Callable[..., Any]) -> Any:
    """A system whose network is made of a skeleton and its lengths, and knows the statistics of a dance."""
    torch.manual_seed(0)
    motion = dancer()
    code = encode_motion(motion.positions, motion.fps, motion.skeleton)
    made = network(motion.skeleton, torch.as_tensor(bone_lengths(motion.positions, motion.skeleton)))
    for name in ("motion_scale", "pose_scale"):
        if hasattr(made, name):
            getattr(made, name).set(torch.tensor(code.mean(axis=0)), torch.tensor(code.std(axis=0)))
    return with_movements(system, made, code)


def tiny_harmogan() -> systems.HarmoGAN:
    sizes = systems.ModelParams(hidden=8, layers=1, pose_features=8, discriminator=4)
    return tiny(systems.HarmoGAN, lambda *body: systems.Generator(sizes, FEATURES.n_audio, *body, **CODED))


def tiny_ren2020() -> systems.Ren2020:
    sizes = systems.RenParams(hidden=8, body=8, blocks=1, discriminator=4)
    return tiny(systems.Ren2020, lambda *body: RenGenerator(sizes, FEATURES.n_audio, *body, **CODED))


def tiny_lee2019() -> systems.Lee2019:
    sizes = replace(systems.LeeParams.small(), hidden=8, latent=4, critic_layers=(8,), regressor_layers=(8,))
    return tiny(systems.Lee2019, lambda *body: DancingToMusic(sizes, *body, features=FEATURES, dances=["waltz"]))


def tiny_toy() -> Toy:
    torch.manual_seed(0)
    return Toy(Swaying(dancer().skeleton).eval())


def tiny_choreographer() -> systems.Choreographer:
    return systems.Choreographer.of([synthetic_clip("waltz", seconds=15.0, fps=30.0, seed=seed) for seed in (1, 2)])


def tiny_music2dance() -> systems.Music2Dance:
    torch.manual_seed(0)
    motion = dancer()
    code = PositionCode.of([motion])
    sizes = replace(systems.Music2DanceParams.recommended(), fps=motion.fps, residual=8, skip=8, groups=1)
    network = DanceNetwork(sizes, code, ["waltz"])
    values = code.encode(motion)
    network.motion_scale.set(*(torch.tensor(part).float() for part in (values.mean(axis=0), values.std(axis=0))))
    return with_movements(systems.Music2Dance, network, np.column_stack([values, np.ones((len(values), 2))]))


def tiny_audio2body() -> Audio2Body:
    """An untrained network, and points that its components move about."""
    torch.manual_seed(0)
    params = replace(Audio2BodyParams.recommended("piano"), hidden=8, components=3)
    network = SoundToPoints(params, PLAYER_50, "piano", 3, Reference((), np.zeros((0, 2))))
    space = PointSpace.fit(np.random.default_rng(0).normal(250, 50, (40, 100)), 3)
    network.set_statistics(torch.zeros(params.n_sound), torch.ones(params.n_sound), space)
    return Audio2Body(network.eval(), {"source": "tiny"})


SYSTEMS: dict[str, Callable[[], System]] = {
    make.__name__.removeprefix("tiny_"): make
    for make in (tiny_audio2body, tiny_choreographer, tiny_harmogan, tiny_lee2019, tiny_music2dance, tiny_ren2020)
} | {TOY: tiny_toy}


@pytest.fixture(scope="module")
def clip() -> Clip:
    return synthetic_clip("cha-cha", seconds=22.0, seed=1)


@pytest.fixture(params=SYSTEMS, ids=lambda name: name.rpartition(":")[2])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


# Of tests that are about dances, or about players, alone.
of_dancers, of_players = (
    pytest.mark.parametrize("name", [name for name in SYSTEMS if (name in PLAYERS) == plays], indirect=True)
    for plays in (False, True)
)


made: Callable[[str], System] = cache(lambda name: SYSTEMS[name]())


@pytest.fixture
def system(name: str) -> System:
    return made(name)


@pytest.fixture
def saved(system: System, tmp_path: Path) -> Path:
    system.save(tmp_path / "run")
    return tmp_path / "run"


Generate = Callable[..., Motion]


@pytest.fixture
def generate(system: System, clip: Clip) -> Generate:
    return lambda **options: system.generate(clip.audio, clip.beats, **{"seconds": 3.0} | options)


def test_every_system_of_harmolab_is_tested_here():
    assert set(names()) == {name for name in SYSTEMS if ":" not in name}


def test_the_same_seed_gives_the_same_dance(generate: Generate):
    np.testing.assert_array_equal(generate(seed=3).positions, generate(seed=3).positions)


@of_dancers
def test_another_seed_gives_another_dance(generate: Generate):
    assert np.abs(generate(seed=0).positions - generate(seed=1).positions).max() > 0.01


def test_what_is_saved_dances_the_same_when_it_is_loaded(saved: Path, name: str, system: System, clip: Clip):
    again = load(saved, system=name if ":" in name else None)
    assert type(again) is type(system)
    motions = [each.generate(clip.audio, clip.beats, seconds=3.0, seed=1) for each in (system, again)]
    np.testing.assert_array_equal(motions[0].positions, motions[1].positions)


@cases("start, asked, seconds", (0, 0.5, 0.5), (4.3, 6, 6), (21, 0.7, 0.7), (18, 60, 4), (18, np.inf, 4), (18, None, 4))
def test_dance_is_as_long_as_asked_for_or_the_music_is(start: float, asked: float, seconds: float, generate: Generate):
    motion = generate(start=start, seconds=asked)
    assert motion.n_frames == pytest.approx(seconds * motion.fps, abs=1)


def test_a_dance_from_within_the_song_is_to_the_music_there(generate: Generate):
    early, late = generate(start=0.0), generate(start=7.77)
    assert np.abs(early.positions - late.positions).max() > 1e-4


@of_dancers
def test_the_dancer_is_a_person_on_the_floor(generate: Generate):
    motion = generate()
    assert 10 <= motion.fps <= 120 and len(motion.skeleton.joints) >= 5
    assert np.isfinite(motion.positions).all() and motion.valid.all()
    assert np.ptp(motion.positions, axis=(0, 1)).max() < 10


@of_players
def test_a_player_is_points_in_a_picture_and_hears_the_sound_alone(system: System, generate: Generate, clip: Clip):
    motion = system.generate(clip.audio, seconds=3.0)
    assert motion.positions.shape[2] == 2 and motion.skeleton == PLAYER_50 and 10 <= motion.fps <= 120
    assert np.isfinite(motion.positions).all() and motion.valid.all()
    alone = motion.positions
    np.testing.assert_array_equal(generate(seed=5).positions, alone)
    np.testing.assert_array_equal(generate(initial=generate(start=4.0)).positions, alone)
    quiet = system.generate(Audio(np.zeros(clip.audio.samples.size), clip.audio.sample_rate), seconds=3.0)
    assert np.abs(quiet.positions - alone).max() > 1e-4


@of_players
def test_a_player_does_not_dance(saved: Path, name: str, tmp_path: Path):
    (tmp_path / "no.wav").touch()
    dancing = ("dance", tmp_path / "no.wav", "--out", tmp_path / "dance.npz")
    sentence = f"{name} plays, it does not dance: use `harmolab perform SONG`"
    assert command(*dancing, "--system", name, code=2).stderr == f"harmolab: {sentence}\n"
    assert command(*dancing, "--weights", saved, code=2).stderr == f"harmolab: {saved}: {sentence}\n"


@pytest.mark.parametrize("options", [{"start": -1.0}, {"start": 99.0}, {"seconds": -1.0}, {"seconds": 0.0}])
def test_a_time_outside_the_music_is_refused(options: dict[str, float], generate: Generate):
    refused(r"start|seconds", generate, **options)


def test_what_is_no_sound_motion_time_or_seed_is_refused(system: System, clip: Clip):
    for option, value in {"audio": "song.wav", "initial": "walk.npz", "start": "1", "seed": -1}.items():
        refused(f"{option} must be a ", system.generate, **{"audio": clip.audio, option: value})


def test_beats_may_be_left_out(system: System, clip: Clip):
    assert system.generate(clip.audio.span(0.0, 8.0), seconds=2.0).duration == pytest.approx(2.0, abs=0.1)


@of_dancers
def test_a_dance_may_follow_a_motion(generate: Generate, clip: Clip):
    one, other = clip.motion.span(0.0, 3.0), clip.motion.span(5.0, 3.4)
    first = generate(initial=one)
    np.testing.assert_array_equal(first.positions, generate(initial=one).positions)
    assert np.abs(first.positions - generate(initial=other).positions).max() > 0.01


def test_a_motion_of_other_joints_is_not_followed(generate: Generate):
    arm = Motion(np.zeros((30, 3, 3)), 15.0, Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1)))
    refused("initial has other joints", generate, initial=arm)


# Weights that are not to be trusted


def change(folder: Path, **entries: Any) -> None:
    (folder / "model.json").write_text(json.dumps(json.loads((folder / "model.json").read_text()) | entries))


def test_damaged_weights_are_refused_by_file(saved: Path, name: str):
    (path,) = (file for file in saved.iterdir() if file.stem == DEFAULT_STEM and file.suffix != ".json")
    path.write_bytes(path.read_bytes()[:-9])
    refused(re.escape(path.name), load, saved, system=name if ":" in name else None)


def test_weights_of_another_class_are_refused(saved: Path, name: str):
    change(saved, **{"class": "Linear"})
    refused("holds a Linear, not a", load, saved, system=name)


def test_weights_of_another_system_are_refused(saved: Path, name: str):
    other = next(each for each in SYSTEMS if each != name)
    refused(f"run: was made by the system '{name}', not by '{other}'", load, saved, system=other)


def test_a_folder_without_weights_is_named(tmp_path: Path, name: str):
    missing(r"model\.json: no such file", load, tmp_path, system=name)


@pytest.mark.parametrize("stranger", ["this", "harmogan.os", "..training", "", "Harmogan", "this:s", TOY])
def test_a_file_cannot_name_a_module_or_a_class_to_import(tmp_path: Path, stranger: str):
    sys.modules.pop("this", None)
    tiny_toy().save(tmp_path)
    change(tmp_path, system=stranger)
    outside = f"was made by {stranger}, a class outside harmolab.*--system {stranger}"
    named = f"was made by the system '{stranger}', which this version"
    refused(outside if ":" in stranger else named, load, tmp_path)
    assert "this" not in sys.modules


@cases(
    "stranger, message",
    ("polka", "unknown system 'polka'; there are audio2body, choreographer, harmogan, lee2019, music2dance, ren2020"),
    (None, "unknown system None; there are audio2body"),
    ("nowhere_at_all:Toy", "there is no module nowhere_at_all; put its folder on PYTHONPATH"),
    (f"{__name__}:Nobody", "has no class Nobody"),
    ("json:dumps", "json has no class dumps"),
    ("json:JSONDecoder", "the class has no generate, save, load, train; see harmolab.systems.System"),
)
def test_an_unknown_system_is_named(stranger: str | None, message: str):
    refused(message, find, stranger)


@pytest.mark.parametrize("name", (*names(), *PARTS))
def test_a_path_is_no_list_of_corpora(name: str, tmp_path: Path):
    for data in ("corpus", tmp_path):
        refused("put the one that there is into a list", trainable(name).train, data, tmp_path / "run")


# The toy from corpus to comparison, by the commands


def command(*arguments: object, code: int = 0) -> Result:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})
    assert result.exit_code == code, result.output
    return result


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_corpus(tmp_path_factory.mktemp("corpora") / "synth", clips=8, seconds=10.0, fps=30.0, seed=2)


@pytest.fixture(scope="module")
def run(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "toy"
    result = command("train", corpus, "--out", out, "--system", TOY)
    assert f"harmolab dance SONG --weights {out} --system {TOY}" in result.stdout
    return out


def rows(folder: Path) -> list[list[str]]:
    return [line.split(",") for line in (folder / "history.csv").read_text().splitlines()]


def test_the_toy_learns_in_two_phases(run: Path):
    header, *epochs = rows(run)
    assert header == ["phase", "epoch", "rate", "mse", "total"]
    assert [row[0] for row in epochs] == 3 * ["coarse"] + 3 * ["fine"]
    assert [float(row[2]) for row in epochs] == pytest.approx([0.1, 0.1, 0.1, 0.01, 0.005, 0.01 / 3])
    assert float(epochs[-1][3]) < 0.8 * float(epochs[0][3])


@pytest.mark.slow
def test_the_toy_learns_the_same_again_and_with_other_seeds_something_else(run: Path, corpus: Path, tmp_path: Path):
    command("train", corpus, "--out", tmp_path / "again", "--system", TOY)
    command("train", corpus, "--out", tmp_path / "other", "--system", TOY, "--seed", 2)
    assert rows(tmp_path / "again") == rows(run) != rows(tmp_path / "other")


@pytest.mark.slow
def test_the_toy_goes_on_where_it_was_stopped(run: Path, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(training_loop, "SAVING_SHARE", float("inf"))
    stop = iter([None, None])
    with pytest.raises(StopIteration):  # after the third epoch
        Toy.train([corpus], tmp_path / "run", report=lambda row, end: next(stop))
    state = load_state(tmp_path / "run")
    assert state is not None and len(state[1]["history"]) == 3
    command("train", corpus, "--out", tmp_path / "run", "--system", TOY, "--resume")
    for file in ("history.csv", "model.safetensors"):
        assert (tmp_path / "run" / file).read_bytes() == (run / file).read_bytes()


def dance_words(corpus: Path, run: Path, folder: Path) -> tuple[object, ...]:
    return ("dance", next(corpus.glob("*/audio.wav")), "--weights", run, "--out", folder / "dance.npz")


def test_an_option_that_a_system_does_not_have_is_refused(corpus: Path, run: Path, tmp_path: Path):
    training = ("train", corpus, "--out", tmp_path / "run", "--preset", "paper")
    dancing = (*dance_words(corpus, run, tmp_path), "--no-plant-feet")
    for words, option in ((training, "--preset"), (dancing, "--plant-feet")):
        result = command(*words, "--system", TOY, code=2)
        assert result.stderr.strip() == f"harmolab: {option} is no option of this system"


def test_the_toys_run_is_danced_with_only_when_it_is_named(run: Path, corpus: Path, tmp_path: Path):
    dancing = dance_words(corpus, run, tmp_path)
    fault = command(*dancing, code=2).stderr
    assert f"If you trust it, name it: --system {TOY}" in fault and not (tmp_path / "dance.npz").exists()
    assert "harmony above chance" in command(*dancing, "--system", TOY, "--seconds", 3, "--verbose").output
    assert load_motion(tmp_path / "dance.npz").duration == pytest.approx(3.0, abs=0.1)
