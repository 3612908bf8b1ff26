"""Weights and banks of movements: what is stored comes back; what is damaged or foreign is refused by name."""

import hashlib
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.torch
import torch
from safetensors.numpy import save_file

import harmolab
from harmolab import Skeleton
from harmolab.systems import FeatureParams, ModelParams, load
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.training import runs
from harmolab.systems.training.about import read_about
from harmolab.systems.training.layers import Statistics
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.runs import PoseBank, load_poses, pose_bank, poses_path, retimed, save_poses
from harmolab.systems.training.units import DanceUnit, UnitSet
from harmolab.systems.training.weights import save_weights
from tests.builders import ARM, cases, dance_unit, missing, refused

FEATURES = FeatureParams(n_mfcc=4, fps=10.0)
MANY = {"joints": [str(joint) for joint in range(1001)], "parents": [-1] * 1001}
C = 9  # channels of the codes in a bank


@pytest.fixture
def generator() -> Generator:
    torch.manual_seed(1)
    made = Generator(ModelParams(8, 2, 8, 4), 4, ARM, torch.tensor([0.0, 0.3, 0.25]), fps=10.0, features=FEATURES)
    made.set_statistics(Statistics.of(torch.randn(2, 9, 4), torch.randn(2, 9, 12), torch.ones(2, 9)))
    return made


@pytest.fixture
def stored(generator: Generator, tmp_path: Path) -> Path:
    save_weights(tmp_path / "arm", generator, {"seed": 7})
    return tmp_path / "arm"


def test_a_generator_comes_back_as_it_was(generator: Generator, stored: Path):
    loaded = load_generator(stored)
    assert (loaded.params, loaded.skeleton, loaded.fps, loaded.features) == (generator.params, ARM, 10.0, FEATURES)
    audio, initial = torch.randn(2, 9, 4), torch.randn(2, 9, 12)
    assert torch.equal(loaded(audio, initial).motion, generator(audio, initial).motion)
    assert not loaded.training


def test_a_loaded_generator_can_be_trained_on(stored: Path):
    loaded = load_generator(stored)
    loaded(torch.randn(1, 9, 4), torch.randn(1, 9, 12)).motion.sum().backward()
    assert loaded.decoder.weight_hh_l0.grad.any()


def test_a_pose_network_comes_back_as_it_was(tmp_path: Path):
    net = PoseNet(ARM, fps=12.0)
    save_weights(tmp_path / "net", net)
    refused(r"net: a network that trainings are measured by, no dancer; name the folder", load, tmp_path / "net")
    loaded = load_pose_net(tmp_path / "net.safetensors")
    motion, mask = torch.randn(2, 20, 12), torch.ones(2, 20)
    assert torch.equal(loaded.embed(motion, mask), net.embed(motion, mask))
    assert loaded.fps == 12.0


def test_half_the_bits_take_half_the_room_and_keep_statistics(generator: Generator, tmp_path: Path):
    save_weights(tmp_path / "half", generator, half=True)
    assert safetensors.torch.load_file(tmp_path / "half.safetensors")["encoder.weight_hh_l0"].dtype == torch.float16
    loaded = load_generator(tmp_path / "half")
    assert loaded.encoder.weight_hh_l0.dtype == torch.float32
    assert torch.equal(loaded.motion_scale.std, generator.motion_scale.std)
    assert torch.equal(loaded.bone_lengths, generator.bone_lengths)
    torch.testing.assert_close(loaded.encoder.weight_hh_l0, generator.encoder.weight_hh_l0, atol=5e-4, rtol=0)


def test_the_description_says_what_was_stored(stored: Path):
    about = read_about(stored)
    assert about["meta"] == {"seed": 7}
    assert (about["system"], about["class"]) == ("harmogan", "Generator")
    assert about["shapes"]["bone_lengths"] == [3]


def test_an_existing_folder_gets_a_file_called_model(generator: Generator, tmp_path: Path):
    save_weights(tmp_path, generator)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.json", "model.safetensors"]
    assert load_generator(tmp_path).n_audio == 4


def test_saving_twice_leaves_only_the_second(generator: Generator, stored: Path):
    with torch.no_grad():
        generator.path_head[-1].bias += 1.0
    save_weights(stored, generator)
    assert torch.equal(load_generator(stored).path_head[-1].bias, generator.path_head[-1].bias)
    assert len(list(stored.parent.iterdir())) == 2


@cases("value, half", (torch.nan, False), (1e6, True), ids=["NaN", "too large for 16 bits"])
def test_nothing_is_written_when_a_value_is_not_finite(value: float, half: bool, generator: Generator, tmp_path: Path):
    with torch.no_grad():
        generator.path_head[-1].bias[0] = value
    message = r"bad\.safetensors: path_head\.2\.bias holds NaN or infinity"
    refused(message, save_weights, tmp_path / "bad", generator, half=half)
    assert list(tmp_path.iterdir()) == []


def test_other_modules_are_not_stored(tmp_path: Path):
    message = "weights of networks that describe themselves can be stored, got Linear"
    refused(message, save_weights, tmp_path / "linear", torch.nn.Linear(2, 2))


def test_missing_weights_are_named(tmp_path: Path):
    missing(r"nowhere\.safetensors: no such file", load_generator, tmp_path / "nowhere")


@pytest.mark.slow  # a process
def test_shipped_weights_are_read_without_torchs_compiler():
    shipped = Path(harmolab.__file__).parent / "systems"
    program = (
        "import sys, harmolab.systems\nfrom harmolab.systems.training.pose_network import load_pose_net\n"
        f"load_pose_net({str(shipped / 'harmogan/weights/pose_net')!r})\n"
        f"harmolab.systems.load({str(shipped / 'music2dance/weights')!r})\n"
        "print('torch._dynamo' in sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout == "False\n"  # its import takes two seconds


@pytest.mark.parametrize("suffix", [".pt", ".pth", ".pkl", ".safetensors"])
def test_a_pickle_is_not_opened_under_any_name(stored: Path, suffix: str):
    class Boom:
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
            return pytest.fail, ("a pickle was loaded",)

    path = stored.with_suffix(suffix)
    path.write_bytes(pickle.dumps(Boom()))
    refused(rf"arm\{suffix}: (pickled weights are never loaded|is damaged or no safetensors)", load_generator, path)


def change_tensors(stored: Path, change: Callable[[dict[str, torch.Tensor]], object], *, hashed: bool = True) -> None:
    """Rewrite the tensors file, and the hash in the JSON so that it fits."""
    path = stored.with_suffix(".safetensors")
    tensors = safetensors.torch.load_file(path)
    change(tensors)
    data = safetensors.torch.save(tensors)
    path.write_bytes(data)
    if hashed:
        change_json(stored, lambda about: about.update(sha256=hashlib.sha256(data).hexdigest()))


def change_json(stored: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = stored.with_suffix(".json")
    about = json.loads(path.read_text())
    change(about)
    path.write_text(json.dumps(about))


@cases(
    "change, message",
    (lambda tensors: tensors["encoder.weight_hh_l0"].fill_(torch.nan), "encoder.weight_hh_l0 holds NaN or infinity"),
    (lambda tensors: tensors.pop("encoder.bias_hh_l1"), r"has other tensors .* such as encoder.bias_hh_l1"),
    (lambda tensors: tensors.pop("bone_lengths"), "bone_lengths"),
    (lambda tensors: tensors.update(more=torch.ones(1)), "has other tensors .* such as more"),
    (
        lambda tensors: tensors.update({"hearing.bias": torch.ones(9)}),
        r"hearing.bias has shape \(9,\); its description calls for \(2,\)",
    ),
    (lambda tensors: tensors.update({"hearing.bias": torch.ones(2).int()}), "hearing.bias must be floating-point"),
    ids=["NaN", "one missing", "bones missing", "one more", "shape", "whole numbers"],
)
def test_unfitting_tensors_are_refused(stored: Path, change: Callable[[dict[str, torch.Tensor]], object], message: str):
    change_tensors(stored, change)
    refused(rf"arm\.safetensors: .*{message}", load_generator, stored)


@cases(
    "change, message",
    (lambda about: about.pop("format"), r"arm\.json: does not describe weights of harmolab: it needs .*1 and"),
    (lambda about: about.update(format=99), r"arm\.json: has format 99; this version reads 1"),
    (lambda about: about.update(build=3), r"arm\.json: does not describe weights of harmolab"),
    (lambda about: about.update({"class": "PoseNet"}), "holds a PoseNet, not a Generator"),
    (lambda about: about["build"]["model"].update(hidden=12), "has shape"),
    (lambda about: about["build"]["model"].update(hidden=10**15), "describes hidden = 1000000000000000"),
    (lambda about: about["build"]["model"].update(hidden=65536), "has shape"),
    (lambda about: about["build"]["model"].update(layers=60000), "describes 60000 recurrent layers"),
    (lambda about: about["build"]["model"].update(extra=1), "cannot be read as weights of harmolab"),
    (lambda about: about["build"].pop("skeleton"), "cannot be read as weights of harmolab"),
    (lambda about: about["build"]["skeleton"].update(parents=[1, 0, 1]), "parents must form a tree"),
    (lambda about: about["build"]["skeleton"].update(parents=3), r"arm\.json: describes parents = 3; a list is needed"),
    (lambda about: about["build"]["features"].update(fps=1e300), r"arm\.json: fps must be 1000 at most, got 1e\+300"),
    (lambda about: about["build"].update(fps="fast"), "could not convert string to float"),
    (lambda about: about["build"].update(fps=1e9), "features must have 4 audio channels at 1000000000.0 Hz"),
    (lambda about: about["build"].update(n_audio=True), "describes n_audio = True"),
    (lambda about: about["build"].update(skeleton=MANY), "describes 1001 joints, more than 1000"),
)
def test_a_false_description_is_refused(stored: Path, change: Callable[[dict[str, Any]], object], message: str):
    change_json(stored, change)
    refused(message, load_generator, stored)


@cases(
    "suffix, damage, message",
    (".json", lambda path: path.unlink(), r"arm\.safetensors: lacks its description arm\.json"),
    (".json", lambda path: path.write_text(""), r"arm\.json: "),
    (".json", lambda path: path.write_text("[1]"), r"arm\.json: "),
    (".safetensors", lambda path: path.write_bytes(b""), r"arm\.safetensors: "),
    (".safetensors", lambda path: path.write_bytes(path.read_bytes()[:2000]), r"arm\.safetensors: "),
    (
        ".safetensors",
        lambda path: change_tensors(path, lambda tensors: tensors["bone_lengths"].add_(1), hashed=False),
        r"arm\.safetensors: is not the file that arm\.json describes",
    ),
    ids=["gone", "empty", "a list", "no weights", "cut off", "other weights"],
)
def test_a_damaged_file_is_refused_by_name(stored: Path, suffix: str, damage: Callable[[Path], object], message: str):
    damage(stored.with_suffix(suffix))
    refused(message, load_generator, stored)


# Movements a dance may start from: which are chosen, how they are stored, and what is refused


def unit(name: str, dance: str, beats_before: int, frames_before: int) -> DanceUnit:
    """A unit of 8 beats and 40 frames whose code holds the number in its name everywhere."""
    before = np.linspace(0, frames_before, beats_before, endpoint=False)
    beats = np.concatenate([before, np.linspace(frames_before, 40, 8 - beats_before)]) / 15
    motion = np.full((40, C), float(name.rpartition("-")[2]), np.float32)
    return dance_unit(name, motion, frames_before, dance=dance, beats=beats, strengths=np.ones(8))


def units(*given: DanceUnit) -> UnitSet:
    return UnitSet(given, Skeleton(("hip", "knee"), (-1, 0)), np.array([0.0, 0.4]), FeatureParams())


BANK = PoseBank(np.arange(4.0 * 3 * C).reshape(4, 3, C) / 16, ("waltz", "rumba", "waltz", ""))


def test_retimed_joints_keep_their_course_and_rates_grow_with_the_tempo():
    code = np.zeros((10, C))
    code[:, 0] = np.linspace(0, 9, 10)
    code[:, -3:] = 2.0
    faster = retimed(code, 5)
    np.testing.assert_allclose(faster[:, 0], [0, 2.25, 4.5, 6.75, 9])
    np.testing.assert_allclose(faster[:, -3:], 4.0)  # the same way in half the time
    np.testing.assert_allclose(retimed(code, 10), code)
    np.testing.assert_allclose(retimed(code[:1], 3)[:, 0], 0)


def test_bank_takes_what_was_danced_before_meters_of_four():
    found = pose_bank(units(unit("a-1", "waltz", 4, 20), unit("b-2", "waltz", 3, 15), unit("c-3", "rumba", 4, 24)))
    assert sorted(found.dances) == ["rumba", "waltz"]
    assert found.poses.shape == (2, 22, C)
    assert {float(clip[0, 0]) for clip in found.poses} == {1.0, 3.0}


def test_places_are_shared_evenly_among_dances_and_depend_on_the_seed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(runs, "POSES", 5)
    many = units(*(unit(f"w-{i}", "waltz", 4, 20) for i in range(20)), unit("r-90", "rumba", 4, 20))
    found = pose_bank(many)
    assert sorted(found.dances) == ["rumba"] + ["waltz"] * 4
    np.testing.assert_array_equal(found.poses, pose_bank(many).poses)
    other = [pose_bank(many, seed=seed).poses[:, 0, 0].tolist() for seed in range(1, 4)]
    assert any(values != found.poses[:, 0, 0].tolist() for values in other)


def test_units_without_a_meter_of_four_make_no_bank():
    refused("no unit has a meter of 4 beats", pose_bank, units(unit("b-2", "waltz", 3, 15)))


def test_bank_comes_back_in_sixteen_bits(tmp_path: Path):
    save_poses(tmp_path / "model", BANK)
    back = load_poses(tmp_path / "model")
    np.testing.assert_array_equal(back.poses, BANK.poses.astype(np.float16))
    assert back.dances == BANK.dances
    assert [file.name for file in tmp_path.iterdir()] == ["model_poses.safetensors"]


def test_bank_lies_beside_the_weights_however_they_are_named(tmp_path: Path):
    for weights in (tmp_path, tmp_path / "model", tmp_path / "model.safetensors", tmp_path / "model.json"):
        assert poses_path(weights) == tmp_path / "model_poses.safetensors"


def test_clips_of_a_dance_or_all_where_the_bank_has_none_of_it():
    np.testing.assert_array_equal(BANK.of("waltz"), BANK.poses[[0, 2]])
    assert len(BANK.of("tango")) == len(BANK.of(None)) == 4


def test_banks_missing_damaged_foreign_and_for_another_skeleton_are_refused_by_file(tmp_path: Path):
    missing(r"model_poses\.safetensors: no such file", load_poses, tmp_path / "model")
    path = tmp_path / "model_poses.safetensors"
    path.write_bytes(b"\x80\x04\x95 this is a pickle, or anything")
    refused(r"model_poses\.safetensors: .*damaged", load_poses, tmp_path / "model")
    save_file({"poses": np.zeros((2, 3, C), np.float16)}, path)
    refused("is no bank of poses", load_poses, tmp_path / "model")
    save_poses(tmp_path / "model", BANK)
    message = r"model_poses\.safetensors: .*\(4, 3, 9\); this generator needs 72 channels"
    refused(message, load_poses, tmp_path / "model", n_channels=72)
    path.write_bytes(path.read_bytes()[:-20])
    refused("damaged", load_poses, tmp_path / "model")


@cases(
    "poses, dances, fault",
    (np.zeros((2, 3)), ("a", "b"), r"got shape \(2, 3\)"),
    *((np.full((1, 3, C), each), ("a",), "must be finite") for each in (np.nan, 1e6)),
    (np.zeros((2, 3, C)), ("a",), "each of the 2 clips of poses needs a dance, got 1"),
)
def test_bank_checks_itself(poses: np.ndarray, dances: tuple[str, ...], fault: str):
    refused(fault, PoseBank, poses, dances)


def test_weights_of_a_training_that_was_stopped_are_named_as_such(tmp_path: Path):
    missing("model.json: no such file; name a folder that harmolab train wrote", read_about, tmp_path)
    missing("nowhere.json: no such file; name a folder that harmolab train wrote", read_about, tmp_path / "nowhere")
    (tmp_path / "settings.json").write_text("{}")
    missing("its training has not ended; go on with the same command and --resume", read_about, tmp_path)
