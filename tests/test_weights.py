"""models.weights: what is stored comes back; what is damaged or foreign is refused by name."""

import hashlib
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import safetensors.torch
import torch

from harmolab.body.skeletons import Skeleton
from harmolab.systems.harmogan.networks import Generator, load_generator
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.about import read_about
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.layers import Statistics
from harmolab.systems.training.pose_network import PoseNet, load_pose_net
from harmolab.systems.training.weights import save_weights
from tests.builders import cases, refused

ARM = Skeleton(("shoulder", "elbow", "hand"), (-1, 0, 1))
FEATURES = FeatureParams(n_mfcc=4, fps=10.0)


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
    gradient = loaded.decoder.weight_hh_l0.grad
    assert gradient is not None
    assert gradient.any()


def test_a_generator_without_feature_settings_comes_back_without(tmp_path: Path):
    save_weights(tmp_path / "g", Generator(ModelParams(4, 1, 4, 4), 2, ARM, torch.ones(3), fps=15.0))
    assert load_generator(tmp_path / "g").features is None


def test_a_pose_network_comes_back_as_it_was(tmp_path: Path):
    net = PoseNet(ARM, fps=12.0)
    save_weights(tmp_path / "net", net)
    loaded = load_pose_net(tmp_path / "net.safetensors")
    motion, mask = torch.randn(2, 20, 12), torch.ones(2, 20)
    assert torch.equal(loaded.embed(motion, mask), net.embed(motion, mask))
    assert loaded.fps == 12.0


def test_half_the_bits_take_half_the_room_and_keep_statistics(generator: Generator, tmp_path: Path):
    save_weights(tmp_path / "half", generator, half=True)
    save_weights(tmp_path / "full", generator)
    stored = safetensors.torch.load_file(tmp_path / "half.safetensors")
    assert stored["encoder.weight_hh_l0"].dtype == torch.float16
    loaded = load_generator(tmp_path / "half")
    assert loaded.encoder.weight_hh_l0.dtype == torch.float32
    assert torch.equal(loaded.motion_scale.std, generator.motion_scale.std)
    assert torch.equal(loaded.bone_lengths, generator.bone_lengths)
    torch.testing.assert_close(loaded.encoder.weight_hh_l0, generator.encoder.weight_hh_l0, atol=5e-4, rtol=0)
    sizes = [
        sum(len(values.numpy().tobytes()) for values in read.values())
        for read in (stored, safetensors.torch.load_file(tmp_path / "full.safetensors"))
    ]
    assert sizes[0] < 0.6 * sizes[1]


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


def test_nothing_is_written_when_a_value_is_not_finite(generator: Generator, tmp_path: Path):
    with torch.no_grad():
        generator.path_head[-1].bias[0] = torch.nan
    refused(r"bad\.safetensors: path_head\.2\.bias holds NaN or infinity", save_weights, tmp_path / "bad", generator)
    assert list(tmp_path.iterdir()) == []


def test_a_value_too_large_for_16_bits_is_refused(generator: Generator, tmp_path: Path):
    with torch.no_grad():
        generator.path_head[-1].bias[0] = 1e6
    refused("holds NaN or infinity", save_weights, tmp_path / "large", generator, half=True)


def test_other_modules_are_not_stored(tmp_path: Path):
    with pytest.raises(ValueError, match="weights of networks that describe themselves can be stored, got Linear"):
        save_weights(tmp_path / "linear", torch.nn.Linear(2, 2))


def test_missing_weights_are_named(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.safetensors: no such file"):
        load_generator(tmp_path / "nowhere")


@pytest.mark.parametrize("suffix", [".pt", ".pth", ".pkl"])
def test_a_pickle_is_not_opened(tmp_path: Path, suffix: str):
    path = tmp_path / f"model{suffix}"
    path.write_bytes(pickle.dumps({"a": 1}))
    refused(rf"model\{suffix}: pickled weights are never loaded", load_generator, path)


def test_a_pickle_under_another_name_is_not_opened(stored: Path):
    class Boom:
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
            return pytest.fail, ("a pickle was loaded",)

    stored.with_suffix(".safetensors").write_bytes(pickle.dumps(Boom()))
    refused(r"arm\.safetensors: is damaged or no safetensors file", load_generator, stored)


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


def test_weights_that_the_json_does_not_describe_are_refused(stored: Path):
    change_tensors(stored, lambda tensors: tensors["bone_lengths"].add_(1), hashed=False)
    refused(r"arm\.safetensors: is not the file that arm\.json describes", load_generator, stored)


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
def test_tensors_that_do_not_fit_are_refused(
    stored: Path, change: Callable[[dict[str, torch.Tensor]], object], message: str
):
    change_tensors(stored, change)
    refused(rf"arm\.safetensors: .*{message}", load_generator, stored)


@cases(
    "change, message",
    (lambda about: about.pop("format"), r"arm\.json: does not describe weights of harmolab"),
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
    (lambda about: about["build"].update(fps="fast"), "could not convert string to float"),
    (lambda about: about["build"].update(fps=1e9), "features must have 4 audio channels at 1000000000.0 Hz"),
    (lambda about: about["build"].update(n_audio=True), "describes n_audio = True"),
)
def test_a_false_description_is_refused(stored: Path, change: Callable[[dict[str, Any]], object], message: str):
    change_json(stored, change)
    refused(message, load_generator, stored)


def test_a_description_of_too_many_joints_is_refused(stored: Path):
    many = {"joints": [str(joint) for joint in range(1001)], "parents": [-1] * 1001}
    change_json(stored, lambda about: about["build"].update(skeleton=many))
    refused("describes 1001 joints, more than 1000", load_generator, stored)


def test_weights_without_json_are_refused(stored: Path):
    stored.with_suffix(".json").unlink()
    refused(r"arm\.safetensors: lacks its description arm\.json", load_generator, stored)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00\xff"])
def test_a_damaged_json_is_refused(stored: Path, text: str):
    stored.with_suffix(".json").write_text(text)
    refused(r"arm\.json: ", load_generator, stored)


@pytest.mark.parametrize("length", [0, 7, 8, 100, 2000])
def test_a_cut_off_file_is_refused(stored: Path, length: int):
    path = stored.with_suffix(".safetensors")
    path.write_bytes(path.read_bytes()[:length])
    refused(r"arm\.safetensors: ", load_generator, stored)


def test_a_generator_is_no_pose_network(stored: Path):
    refused(r"arm\.safetensors: holds a Generator, not a PoseNet", load_pose_net, stored)
